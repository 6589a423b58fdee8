"""The event log of a logger: a file of JSON lines in its folder, `.<logger>.events.jsonl`, that outlives everybody.

Helper processes append to it; who wants to know what happened last week reads it. At `MOST_BYTES` it becomes
`.<logger>.events.1.jsonl`, which takes the place of an older one, so that both together stay below twice that. Where
lines can't be read an event stands in their place that says so: whoever shows or saves what happened tells of it.
"""

import contextlib
import fcntl
import logging
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from silo.core.elements import DAMAGED, NOTED, LoggedEvent
from silo.core.recording import Recording, with_events
from silo.core.runtime import closing_file, is_at, open_own
from silo.decoding import json_decoder
from silo.errors import reason
from silo.files.atomic import append_all, lock

MOST_BYTES = 4_000_000
ENDING = ".events.jsonl"
OLDER_ENDING = ".events.1.jsonl"
# kinds of events: nothing of a run but what became of it is told after them; it has one of each, whoever tells it
CRASHED, STOPPED = "crashed", "stopped"
_END_BYTES = 64_000  # the newest lines

_BEGIN = b'{"kind":"'

log = logging.getLogger("silo")

_encoder = msgspec.json.Encoder()
_decoder = json_decoder(LoggedEvent)


def event_log_path(folder: str | os.PathLike[str], logger: str) -> Path:
    """Return where the event log of a logger stands."""
    return Path(folder) / f".{logger}{ENDING}"


def older_event_log(folder: str | os.PathLike[str], logger: str) -> Path:
    """Return where the older half of the event log of a logger stands, once there is one."""
    return Path(folder) / f".{logger}{OLDER_ENDING}"


def loggers_with_events(folder: str | os.PathLike[str]) -> list[str]:
    """Return the names of the loggers that have an event log in a folder. Raises OSError."""
    found = (path.name for path in Path(folder).iterdir())
    return sorted(name[1 : -len(ENDING)] for name in found if name.startswith(".") and name.endswith(ENDING))


def append_events(folder: str | os.PathLike[str], logger: str, events: Sequence[LoggedEvent]) -> int:
    """Append lines, all or none; the folder is made if it isn't there. Helper processes may do so at once.

    Returns by how much higher they are numbered than they came: where another process wrote in between, its lines have
    these numbers. Raises OSError.
    """
    path = event_log_path(folder, logger)
    path.parent.mkdir(parents=True, exist_ok=True)
    higher = 0
    with _locked(path) as descriptor:
        newest = newest_number(folder, logger)
        if events and newest >= max(events[0].number, 1):
            there = set(read_events(folder, logger))  # of a try before, which a full disk ended and left
            events = [one for one in events if one not in there]
            higher = max(0, newest + 1 - events[0].number) if events else 0
            events = renumbered(events, higher)
        # that a program died says whoever comes first
        died = [one for one in events if one.kind == CRASHED]
        told = [one for one in died if not lacking([one], read_events(folder, logger, one.run))]
        append_lines(descriptor, [one for one in events if one not in told])
        if os.fstat(descriptor).st_size > MOST_BYTES:
            path.rename(older_event_log(folder, logger))
    return higher


def renumbered(events: Iterable[LoggedEvent], higher: int) -> list[LoggedEvent]:
    """Return lines with numbers that are so much higher."""
    return [msgspec.structs.replace(one, number=one.number + higher) for one in events]


def append_lines(descriptor: int, told: Sequence[msgspec.Struct]) -> None:
    """Append a line of JSON for each to a file that is open for it; a line that nobody ended stays one of its own."""
    lines = b"".join(_encoder.encode(one) + b"\n" for one in told)
    before = os.fstat(descriptor).st_size
    if before and os.pread(descriptor, 1, before - 1) != b"\n":
        lines = b"\n" + lines  # a process was killed within a line, or by a power cut
    try:
        append_all(descriptor, lines)
    except OSError:
        with contextlib.suppress(OSError):  # then lines stand twice when they are tried again, and are read once
            os.ftruncate(descriptor, before)
        raise


def add_missing(folder: str | os.PathLike[str], logger: str, run: str, events: Sequence[LoggedEvent]) -> None:
    """Append what the log lacks of a run, numbered on: of a logger that is gone nobody else comes to tell it.

    Several processes may do so at once: a line stands there once. A folder that is gone is not made again. A disk that
    refuses is told, and holds nobody up.
    """
    try:
        with _locked(event_log_path(folder, logger)) as descriptor:
            fresh = lacking(events, read_events(folder, logger, run))
            numbered = enumerate(fresh, newest_number(folder, logger) + 1)
            append_lines(descriptor, [msgspec.structs.replace(one, number=number) for number, one in numbered])
    except OSError as error:
        if Path(folder).is_dir():
            log.warning("the event log in %s can't be written (%s)", folder, reason(error))


def lacking(events: Iterable[LoggedEvent], known: Iterable[LoggedEvent]) -> list[LoggedEvent]:
    """Return those of a run that are not known yet: what its program noted by its moment, all else by its words.

    But for its end, which it has once: who saw it tells more of it than who comes later.
    """
    there = set(map(_identity, known))
    return [event for event in events if _identity(event) not in there]


def _identity(event: LoggedEvent) -> tuple[object, ...]:
    if event.kind in (CRASHED, STOPPED):
        return (event.kind,)
    return (event.time_ns, event.tick, event.text) if event.kind in NOTED else (event.kind, event.text)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[int]:
    while True:
        with closing_file(open_own(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)) as descriptor:
            lock(descriptor)
            if is_at(descriptor, path):  # else another process began a new one
                yield descriptor
                return


def read_events(folder: str | os.PathLike[str], logger: str, run: str = "") -> list[LoggedEvent]:
    """Return all that is there, oldest first, of one run or of all; an event of kind DAMAGED for what can't be read.

    None where there is no log. Raises OSError where it can't be read.
    """
    found: list[LoggedEvent] = []
    for lines in _files(event_log_path(folder, logger), older_event_log(folder, logger)):
        found += decoded(lines, run)
    return list(dict.fromkeys(found))  # a disk that was full within a line: others wrote them all once more


def with_happened(recording: Recording, folder: str | os.PathLike[str], run: str) -> Recording:
    """The recording of a run with what its event log says of it; where that can't be read it is a warning."""
    try:
        return with_events(recording, read_events(folder, recording.logger, run) if run else [])
    except OSError as error:
        text = f"the event log in {folder} can't be read ({reason(error)}): of what happened only marks are here"
        return replace(recording, warnings=(*recording.warnings, text))


def _files(path: Path, older: Path) -> list[list[bytes]]:
    """The lines of the older file and of the newer one as they stood at one moment."""
    while True:
        with contextlib.ExitStack() as opened:
            descriptors = [_opened(one, opened) for one in (older, path)]
            # one that was begun anew between the two takes the place of the older one
            if not older.exists() if descriptors[0] is None else is_at(descriptors[0], older):
                return [_settled_lines(descriptor) for descriptor in descriptors if descriptor is not None]


def _opened(path: Path, opened: contextlib.ExitStack) -> int | None:
    try:
        descriptor = open_own(path, os.O_RDONLY)
    except FileNotFoundError:
        return None
    opened.callback(os.close, descriptor)
    return descriptor


def _settled_lines(descriptor: int) -> list[bytes]:
    """The lines of a file, without a last one that is being written. One that a kill cut short is none of these."""
    is_settled = False
    with contextlib.suppress(OSError):  # somebody writes, or a file system that knows no locks
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        is_settled = True
    size = os.fstat(descriptor).st_size
    if is_settled:
        fcntl.flock(descriptor, fcntl.LOCK_UN)  # nobody waits for who only reads
    with open(descriptor, "rb", closefd=False) as file:
        text = file.read(size)
    return (text if is_settled else text[: text.rfind(b"\n") + 1]).splitlines()


def newest_number(folder: str | os.PathLike[str], logger: str) -> int:
    """Return the number of the newest line, 0 where there is none, or none that can be read."""
    for path in (event_log_path(folder, logger), older_event_log(folder, logger)):
        with contextlib.suppress(OSError), os.fdopen(open_own(path, os.O_RDONLY), "rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - _END_BYTES))
            numbers = [event.number for event in decoded(file.read().splitlines())]
            if numbers:
                return max(numbers)
    return 0


def decoded(lines: Iterable[bytes], run: str = "", before: LoggedEvent | None = None) -> Iterator[LoggedEvent]:
    """Return the events of lines, of one run or of all; `before` is the one before the first line.

    In place of lines that can't be read stands an event that says so, of the run of the one before.
    """
    wanted, damaged = run.encode(), 0
    of = before.run if before is not None else ""
    for line in filter(None, lines):
        event = _event(line) if wanted in line else None
        # lines of other runs are passed over by their looks: reading them all takes ten times as long
        if event is None and (wanted in line or not (line.startswith(_BEGIN) and line.endswith(b"}"))):
            damaged += 1
            continue
        if damaged and run in ("", of):
            yield _damage(before, damaged)
        damaged, of = 0, event.run if event is not None else ""
        if event is not None and run in ("", of):
            before = event
            yield event
    if damaged and run in ("", of):
        yield _damage(before, damaged)


def _event(line: bytes) -> LoggedEvent | None:
    try:
        return _decoder.decode(line)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None


def _damage(before: LoggedEvent | None, lines: int) -> LoggedEvent:
    """What stands in place of lines that can't be read; it takes the number of the first of them."""
    where = f"after event {before.number}" if before is not None else "at its begin"
    text = f"{lines} line{'s' * (lines > 1)} of the event log can't be read, {where}: what happened there is not known"
    if before is None:
        return LoggedEvent(DAMAGED, text, number=1)
    return msgspec.structs.replace(before, kind=DAMAGED, text=text, who="", number=before.number + 1)
