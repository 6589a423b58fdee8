"""What takes more than one screen: flows with questions, the `:` line, the palette, opening another logger.

Only the app imports this. Which commands there are stands in `silo_tui.actions`; what concerns one screen alone is
a method of that screen.
"""
