"""What people say of runs: tags and notes, a line each in a file beside the runs, which is only ever added to.

`silo-labels.jsonl` stands in the folder of the runs that it speaks of and goes with it; the index can be lost, this
can't. What is taken back is a line, too.
"""

import getpass
import os
import time
from collections.abc import Iterable
from pathlib import Path

import msgspec

from silo.core.arguments import line
from silo.core.runtime import closing_file
from silo.decoding import converted, json_decoder
from silo.errors import ElementError, SaveError, reason
from silo.files.atomic import lock
from silo.files.event_log import append_lines

NAME = "silo-labels.jsonl"
MOST_BYTES = 64 << 20


class Label(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line: a tag that was given or taken, a note, or that the last such line of this run is taken back."""

    run: str
    when_ns: int = 0
    who: str = ""
    add: str = ""
    remove: str = ""
    note: str = ""
    undo: bool = False


class Labels(msgspec.Struct, frozen=True):
    """What holds of a run now."""

    tags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def read_labels(folder: Path) -> dict[str, Labels]:
    """Return what is said of the runs in a folder, by file name without ending; a line that is damaged says nothing."""
    said: dict[str, list[Label]] = {}
    for label in _lines(folder):
        lines = said.setdefault(label.run, [])
        if not label.undo:
            lines.append(label)
        elif lines:
            lines.pop()
    return {run: _holding(lines) for run, lines in said.items()}


def tag(folder: Path, run: str, add: Iterable[str] = (), remove: Iterable[str] = ()) -> None:
    """Give a run tags and take others. Raises ElementError for a tag that is no word, SaveError."""
    _add(folder, [_label(run, add=_word(one)) for one in add] + [_label(run, remove=_word(one)) for one in remove])


def note(folder: Path, run: str, text: str) -> None:
    """Say something of a run. Raises ElementError for what is no line, SaveError."""
    text = line("a note", text, 'run.note("slipped on the wet floor")').strip()
    if not text:
        raise ElementError("a note is empty: write what is to be known of the run")
    _add(folder, [_label(run, note=text)])


def undo(folder: Path, run: str) -> str:
    """Take the last tag or note of a run back, and return what it was, in words. Raises ElementError, SaveError."""
    lines: list[Label] = []
    for label in _lines(folder):
        if label.run == run:
            lines = lines[:-1] if label.undo else [*lines, label]
    if not lines:
        raise ElementError(f"nothing was said of '{run}' that could be taken back")
    _add(folder, [_label(run, undo=True)])
    last = lines[-1]
    return (
        f"note '{last.note}'" if last.note else f"tag {last.add}" if last.add else f"that tag {last.remove} was removed"
    )


def _label(run: str, **more: object) -> Label:
    return converted({"run": run, "when_ns": time.time_ns(), "who": getpass.getuser(), **more}, Label)


def _word(text: str) -> str:
    text = line("a tag", text, 'run.tag("slip")').strip()
    if not text or any(letter.isspace() or letter == "," for letter in text) or text[0] in "-+/":
        raise ElementError(f"a tag is one word, got {text!r}; a sentence is a note: silo note RUN '...'")
    return text


def _holding(lines: Iterable[Label]) -> Labels:
    tags: dict[str, None] = {}
    notes = []
    for label in lines:
        if label.add:
            tags[label.add] = None
        if label.remove:
            tags.pop(label.remove, None)
        if label.note:
            notes.append(label.note)
    return Labels(tuple(tags), tuple(notes))


def _lines(folder: Path) -> Iterable[Label]:
    try:
        with (folder / NAME).open("rb") as file:
            data = file.read(MOST_BYTES)
    except OSError:
        return
    for text in data.splitlines():
        try:
            yield json_decoder(Label).decode(text)
        except (msgspec.MsgspecError, UnicodeDecodeError):  # noqa: PERF203 - each line may be damaged
            continue


def _add(folder: Path, labels: list[Label]) -> None:
    """Add lines in one piece, behind those of any other writer."""
    path = folder / NAME
    try:
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        with closing_file(os.open(path, flags, 0o666)) as descriptor:
            lock(descriptor)
            append_lines(descriptor, labels)
            os.fsync(descriptor)
    except OSError as error:
        raise SaveError(f"'{path}' can't be written: {reason(error)}; nothing was changed") from error
