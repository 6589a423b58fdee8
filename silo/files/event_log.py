"""The event log of a logger: a file of JSON lines in its folder, `.<logger>.events.jsonl`, that outlives everybody.

Helper processes append to it; who wants to know what happened last week reads it. At `MOST_BYTES` it becomes
`.<logger>.events.1.jsonl`, which takes the place of an older one, so that both together stay below twice that.
"""

import contextlib
import fcntl
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from silo.model import LoggedEvent

MOST_BYTES = 4_000_000
ENDING = ".events.jsonl"
OLDER_ENDING = ".events.1.jsonl"
_END_BYTES = 64_000  # the newest lines

_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(LoggedEvent)


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


def append_events(folder: str | os.PathLike[str], logger: str, events: Sequence[LoggedEvent]) -> None:
    """Append lines; the folder is made if it isn't there. Helper processes may do so at once. Raises OSError."""
    path = event_log_path(folder, logger)
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = b"".join(_encoder.encode(event) + b"\n" for event in events)
    with _locked(path) as descriptor:
        if os.fstat(descriptor).st_size and not _ends_with_line(descriptor):
            lines = b"\n" + lines  # a helper process was killed, or a disk full, within a line
        view = memoryview(lines)
        while view:
            view = view[os.write(descriptor, view) :]
        if os.fstat(descriptor).st_size > MOST_BYTES:
            path.rename(older_event_log(folder, logger))


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[int]:
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            if _is_still(path, descriptor):
                yield descriptor
                return
        finally:
            os.close(descriptor)


def _is_still(path: Path, descriptor: int) -> bool:
    """Whether the open file has that name: another process may have begun a new one."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _ends_with_line(descriptor: int) -> bool:
    return os.pread(descriptor, 1, os.fstat(descriptor).st_size - 1) == b"\n"


def read_events(folder: str | os.PathLike[str], logger: str, run: str = "") -> list[LoggedEvent]:
    """Return all lines that are there, oldest first, of one run or of all; a damaged line is left out.

    None where there is no log. Raises OSError where it can't be read.
    """
    path = event_log_path(folder, logger)
    found: list[LoggedEvent] = []
    for part in (older_event_log(folder, logger), path):
        with contextlib.suppress(FileNotFoundError):
            found += _decoded(part.read_bytes().splitlines(), run)
    return found


def newest_number(folder: str | os.PathLike[str], logger: str) -> int:
    """Return the number of the newest line, 0 where there is none, or none that can be read."""
    for path in (event_log_path(folder, logger), older_event_log(folder, logger)):
        with contextlib.suppress(OSError), path.open("rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - _END_BYTES))
            numbers = [event.number for event in _decoded(file.read().splitlines(), "")]
            if numbers:
                return max(numbers)
    return 0


def _decoded(lines: Iterable[bytes], run: str) -> Iterator[LoggedEvent]:
    for line in lines:
        if run.encode() in line:
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                event = _decoder.decode(line)
                if not run or event.run == run:
                    yield event
