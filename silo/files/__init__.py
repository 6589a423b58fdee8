"""Recordings to files and back: `.silo`, CSV, bags. Nothing here knows a logger, a process or a screen."""

from silo.files.saving import PartlySavedError, write

__all__ = ["PartlySavedError", "write"]
