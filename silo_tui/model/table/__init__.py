"""The table of elements: settings and edits, what was measured, rows, columns, filter. Plain Python and NumPy."""
