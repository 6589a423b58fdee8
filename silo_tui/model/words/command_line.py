"""The command line of the screen (`:load x.yaml`): reading and completing it. What words do: `commands/runner.py`."""

import os
import shlex
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import msgspec

from silo.core.elements import FileType
from silo.errors import ElementError
from silo.files.formats import LOG_ENDINGS, file_type
from silo_tui.model.words.paths import typed_path


class Spelled(msgspec.Struct, frozen=True):
    """A command as typed: its word and its arguments."""

    word: str
    arguments: tuple[str, ...]

    @property
    def first(self) -> str:
        """The first argument; empty without any."""
        return next(iter(self.arguments), "")

    @property
    def rest(self) -> str:
        """All arguments, as one."""
        return " ".join(self.arguments)


BY_KEY = Spelled("", ())  # what a command is told whose key was pressed
WHAT_TO_PLOT = "say what to plot: `:plot NAME`, the end of a name, or a pattern; Tab takes the name in brackets"


def read(line: str) -> Spelled:
    """Split a command line as a shell would. ValueError for an open quote or an empty line."""
    try:
        words = shlex.split(line.lstrip(": "))
    except ValueError as error:
        raise ValueError(f"{line!r}: {error}") from None
    if not words:
        raise ValueError("an empty command; `:help` lists them")
    return Spelled(words[0], tuple(words[1:]))


def read_save(arguments: Sequence[str]) -> tuple[list[FileType], str]:
    """Return `silo csv my-run`: file types and a name. ValueError when two names are given."""
    types: list[FileType] = []
    name = ""
    for argument in arguments:
        kind = file_type(argument)
        if kind is not None:
            types.append(kind)
        elif name:
            raise ValueError(f"one name is enough, got {name!r} and {argument!r}")
        else:
            name = argument
    return types or [FileType.SILO], name


def logs(begun: str, near: str = "") -> list[str]:
    """Return paths of logs, the newest first, and folders that what is typed of one may become, as it is typed.

    Where nothing is typed, the folder `near` is the first, where the logger saves.
    """
    typed, _, last = begun.rpartition("/")
    before = f"{typed}/" if "/" in begun else ""
    try:
        found = sorted(typed_path("the log", before or ".").iterdir(), key=_newest_first)
    except (ElementError, OSError):
        return []
    shown = [path for path in found if path.name.startswith(last) and (last or not path.name.startswith("."))]
    folders = [f"{before}{path.name}/" for path in shown if path.is_dir() and not path.name.endswith(LOG_ENDINGS)]
    first = [folder] if not begun and (folder := folder_here(near)) else []
    found_logs = [f"{before}{path.name}" for path in shown if path.name.endswith(LOG_ENDINGS)]
    return list(dict.fromkeys([*first, *found_logs, *folders]))


def folder_here(near: str) -> str:
    """Return the folder where a logger saves as one types it, with a slash; empty where this machine has none."""
    if not near or not Path(near).is_dir():
        return ""
    below = os.path.relpath(near)
    return f"{near if below.startswith('..') else below}/"


def _newest_first(path: Path) -> tuple[float, str]:
    """Return what logs are ordered by, and folders by their names."""
    is_log = path.name.endswith(LOG_ENDINGS)
    return (-path.lstat().st_mtime if is_log else 0.0, path.name)


def neighbours_first(names: Sequence[str], here: str) -> list[str]:
    """Return names in the order in which somebody who looks at one of them may want them: first those that share most
    levels with it, itself behind these; else as they are.
    """
    levels = here.split("/")

    def far(name: str) -> tuple[int, bool]:
        shared = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(name.split("/"), levels, strict=False)))
        return -min(shared, len(levels) - 1), name == here

    return sorted(names, key=far) if here else list(names)


def complete(line: str, words: Sequence[str], choices: Sequence[str]) -> list[str]:
    """Return whole lines that `line` may become: command words first, then the `choices` for its last argument.

    Choices that begin so come first, then names of which a part behind a `/` does; of several words that are none by
    themselves, those that have all of them.
    """
    body = line.lstrip(":")
    word, space, rest = body.partition(" ")
    if not space:
        return [known for known in words if known.startswith(word) and known != word]
    head, last = rest.rpartition(" ")[0], rest.rpartition(" ")[2]
    if head and last and (all_in := [each for each in choices if all(one in each for one in rest.split())]):
        return [f"{word} {each}" for each in all_in]
    before = f"{word} {head} " if head else f"{word} "
    begin_so = [choice for choice in choices if choice.startswith(last) and choice != last]
    inside = [choice for choice in choices if last and f"/{last}" in choice and not choice.startswith(last)]
    return [before + choice for choice in [*begin_so, *inside]]
