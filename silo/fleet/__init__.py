"""Which loggers there are, here and elsewhere, and how they stand."""
