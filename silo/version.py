"""The version of this silo; `pyproject.toml` reads it from this text."""

VERSION = "0.1.0"
