"""The file types that somebody names who saves, in a program or as its client."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

from silo.core.arguments import shown
from silo.core.elements import FileType
from silo.errors import ElementError


def file_types(given: object, call: str = "log.save") -> list[FileType]:
    """The file types to save in, as they were given to a `call`. Raises ElementError."""
    if isinstance(given, str | bytes | bool) or not isinstance(given, Iterable):
        given = [given]
    return [_file_type(one, call) for one in given]


def _file_type(given: object, call: str) -> FileType:
    if isinstance(given, FileType):
        return given
    # not before: the control program loads nothing of files until it saves
    from silo.files import formats

    found = formats.file_type(given) if isinstance(given, str) else None
    if found is None:
        raise ElementError(f"unknown file type {shown(given)}; there are {formats.savable()}{_type_hint(given, call)}")
    return found


def _type_hint(given: object, call: str) -> str:
    from silo.files import formats

    if not isinstance(given, str):
        return ""
    word = given.strip().lower()
    if word == "binary":
        return "; did you mean 'silo'?"
    several = [part.strip() for part in re.split("[,; +]+", word) if part.strip()]
    if len(several) > 1 and all(formats.file_type(part) is not None for part in several):
        return f"; write {several}"
    if "." in word.lstrip("."):
        return f"; the name is an argument of its own: {call}('csv', name={Path(given).stem!r})"
    other = next((one for one in formats.FORMATS if word.removeprefix(".") in (one.name, one.ending[1:])), None)
    if other is not None:
        return f"; silo.open_log(...).save('run{other.ending}') or `silo convert` writes {other.ending} from those"
    near = get_close_matches(word, formats.SAVED_NAMES, 1)
    return f"; did you mean '{near[0]}'?" if near else ""
