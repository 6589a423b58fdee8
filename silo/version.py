"""The version of this silo; `pyproject.toml` reads it from this text."""

VERSION = "0.2.0"
