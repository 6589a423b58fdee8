"""A client of one logger: what `silo`, `silo-tui`, bridges and users' programs talk to a helper process with."""
