"""The command line of the screen (`:load x.yaml`): reading it and completing it. What commands do stands in the app."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from silo.model import FileType
from silo_tui.model.fields import Change, Field, parse_change

FIELD_WORDS = {
    "on": Field.ENABLED, "div": Field.DIVIDER, "act": Field.ACTION, "buf": Field.BUFFER_TYPE, "size": Field.BUFFER_SIZE,
}  # fmt: skip
# the words of `silo set`, of the scripts and of the dialogs mean the same
FIELD_SYNONYMS = {
    **FIELD_WORDS, "enabled": Field.ENABLED, "logging": Field.ENABLED, "divider": Field.DIVIDER,
    "action": Field.ACTION, "buffer": Field.BUFFER_TYPE, "buffer_type": Field.BUFFER_TYPE,
    "buffer_size": Field.BUFFER_SIZE,
}  # fmt: skip


@dataclass(frozen=True)
class Spelled:
    """A command as typed: its word and its arguments."""

    word: str
    arguments: tuple[str, ...]


def read(line: str) -> Spelled:
    """Split a command line as a shell would. ValueError for an open quote or an empty line."""
    try:
        words = shlex.split(line.lstrip(": "))
    except ValueError as error:
        raise ValueError(f"{line!r}: {error}") from None
    if not words:
        raise ValueError("an empty command; `:help` lists them")
    return Spelled(words[0], tuple(words[1:]))


def read_settings(arguments: Sequence[str]) -> list[tuple[Field, Change]]:
    """Return `div=5 size=10s buf=loop off` as changes. ValueError names what can't be read."""
    if not arguments:
        raise ValueError("set what? for example `:set div=5 buf=loop size=10s act=both on=yes`")
    found = []
    for argument in arguments:
        word, sign, value = argument.partition("=")
        if argument.lower() in {"on", "off"}:
            word, sign, value = "on", "=", argument
        field = FIELD_SYNONYMS.get(word.lower())
        if not sign or field is None:
            raise ValueError(f"{argument!r}: write one of {', '.join(f'{known}=' for known in FIELD_WORDS)}, on or off")
        found.append((field, parse_change(field, value)))
    # the divider first: a size from time depends on it
    return sorted(found, key=lambda pair: pair[0] is not Field.DIVIDER)


def read_save(arguments: Sequence[str]) -> tuple[list[FileType], str]:
    """Return `silo csv my-run`: file types and a name. ValueError when two names are given."""
    types: list[FileType] = []
    name = ""
    for argument in arguments:
        kind = {"silo": FileType.SILO, "csv": FileType.CSV, "bag": FileType.BAG}.get(argument.lower())
        if kind is not None:
            types.append(kind)
        elif name:
            raise ValueError(f"one name is enough, got {name!r} and {argument!r}")
        else:
            name = argument
    return types or [FileType.SILO], name


def complete(line: str, words: Sequence[str], choices: Sequence[str]) -> list[str]:
    """Return whole lines that `line` may become: command words first, then the `choices` for its last argument."""
    body = line.lstrip(":")
    word, space, rest = body.partition(" ")
    if not space:
        return [known for known in words if known.startswith(word) and known != word]
    head, last = rest.rpartition(" ")[0], rest.rpartition(" ")[2]
    before = f"{word} {head} " if head else f"{word} "
    return [before + choice for choice in choices if choice.startswith(last) and choice != last]
