"""What the screens show, as plain Python and NumPy: table, edits, filter, columns, readings, plots.

Everything in `silo_tui` may import this; it imports nothing of `silo_tui`, and neither Textual nor Zenoh. What is asked
of a logger or read from a file belongs to `sessions`, what is drawn to `widgets`.
"""
