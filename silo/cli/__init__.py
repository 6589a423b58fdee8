"""The command line `silo`. Commands are loaded when they are used: `silo ls` pays for neither NumPy nor Textual."""

from silo.cli.main import main

__all__ = ["main"]
