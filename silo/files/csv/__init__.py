"""CSV: tables with a row per tick, and what CSV can't say in a file beside."""
