"""Paths as they are typed."""

import os
from pathlib import Path

from silo.core import arguments
from silo.errors import ElementError


def typed_path(what: str, given: str) -> Path:
    """Return a path of this machine as it is typed, `~` too; of a `~name` that nobody has, as it stands.

    `what` is to be at it. Raises ElementError for what no path can be.
    """
    # os.path: pathlib raises where nobody has that name, or home
    return arguments.path(what, os.path.expanduser(given))  # noqa: PTH111


def typed_file(what: str, given: str, ending: str) -> Path:
    """Return the path of a file as it is typed, with an ending where it has none. Raises ElementError for a folder."""
    path = typed_path(what, given)
    if not path.name or given.endswith("/") or path.name == ".." or os.path.isdir(path):  # noqa: PTH112 - which has no words for a folder that can't be read
        raise ElementError(f"{what} must be a file, {given!r} is a folder; write {str(path / f'name{ending}')!r}")
    return path if path.suffix else path.with_name(path.name + ending)
