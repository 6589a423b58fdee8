"""Views: what a user looks at (columns, order, filter, plots, span, scales), kept by name, put on the screen again."""
