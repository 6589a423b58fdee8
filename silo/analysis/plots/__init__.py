"""Charts of signals: what belongs into one, drawn in a terminal or as a PNG file."""
