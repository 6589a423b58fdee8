"""Setuptools, with an sdist that holds what is needed to test and to document it.

The top level holds no MANIFEST.in, so the folders are named here. Wheels and editable installs are those of setuptools.
"""

from pathlib import Path

from setuptools.build_meta import *  # noqa: F403 - every hook of a backend
from setuptools.build_meta import build_sdist as _build_sdist
from setuptools.command.sdist import sdist

FOLDERS = (".ci", ".docs", ".github", "config", "tests")
LEFT_OUT = {"__pycache__", "site"}


def build_sdist(sdist_directory: str, config_settings: dict[str, str | list[str] | None] | None = None) -> str:
    """Write the sdist and return its name."""
    add_defaults = sdist.add_defaults

    def add_all(self: sdist) -> None:
        add_defaults(self)
        self.filelist.extend(sorted(str(path) for folder in FOLDERS for path in _files(Path(folder))))

    sdist.add_defaults = add_all
    try:
        return _build_sdist(sdist_directory, config_settings)
    finally:
        sdist.add_defaults = add_defaults


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and not LEFT_OUT & set(path.parts)]
