"""Where values come from: live loggers, recordings, what was pinned or held of them. Plain Python and NumPy."""
