"""silo-tui in a browser of this computer: a page served on loopback alone, behind a token, that needs no internet."""
