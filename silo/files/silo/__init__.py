"""The `.silo` format: a text header, table lines, and values that stay in the file until they are touched."""
