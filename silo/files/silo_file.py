"""The `.silo` format: `write_silo` and `read_silo`, each in a module of its own."""

from silo.files.silo_reader import read_silo
from silo.files.silo_writer import write_silo

__all__ = ["read_silo", "write_silo"]
