"""Writing a log: `.silo` in the helper itself, CSV and bags in a process of their own.

What CSV and bags need (polars, the MCAP package, chunks to compress) would leave the helper with twice its memory for
good: 112 instead of 53 MB. The other process gets the segment as an open file, so that it doesn't matter if a restart
deletes it, and is nice to the control loop, unless that waits for it: beside two busy processes on two cores a bag took
3.6 s then, that takes 0.7 s.
"""

import contextlib
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from silo.core.child import PIPE, ChildProcess, note_holder
from silo.core.conditions import Conditions
from silo.core.elements import FileType, LoggedEvent, SavedFile
from silo.decoding import json_decoder
from silo.errors import SaveError, SiloError
from silo.files import LogOfRun, PartlySavedError, write, write_run
from silo.files.atomic import asked_left, check_room
from silo.journal.holdings import Holdings, segment_holdings
from silo.journal.reader import JournalReader
from silo.recovery.left import DIED, RunReader, missing
from silo.segment.reader import SegmentReader

NICER = 5
HOLD = "--hold"  # before the process that started the writing one, and descriptors of claims


class WriteOrder(msgspec.Struct, frozen=True, rename={"conditions": "extras"}):
    """What to write, and where; the arguments of `silo.files.write`.

    `of_dead`: the writer of the segment is gone, so that rows that aren't what it committed are damaged.
    `journal`: write what this journal proves instead of a segment; `log`: write this file again in other formats.
    `why` it is saved, in a few words.
    `awaited`: the robot program itself waits for it, so that there is nobody to be nice to.
    `leaves_room`: to others of the disk, as clients may save without end.
    `events` are what happened in that run; `conditions` its derived signals and limits as they are now, None: as
    they were when it began.
    """

    folder: str
    logger: str
    types: list[FileType]
    name: str
    of_dead: bool = False
    journal: str = ""
    why: str = ""
    log: str = ""
    awaited: bool = False
    leaves_room: bool = False
    events: list[LoggedEvent] = []
    conditions: Conditions | None = None


class WriteReport(msgspec.Struct, frozen=True):
    """A line of the writing process: how far it is, and at last what became of it: `ticks` stand in `files`."""

    progress: float
    done: bool = False
    ticks: int = 0
    files: list[SavedFile] = []
    error: str = ""
    damage: tuple[str, ...] = ()


def write_log(reader: SegmentReader, order: WriteOrder, progress: Callable[[float], None]) -> WriteReport:
    """Save what a segment holds now; the report's `error` is empty when all of it worked. Raises OSError, SaveError."""
    if order.leaves_room:
        check_room(folder := Path(order.folder), reader.held_bytes, most_left=asked_left(folder))
    if order.types == [FileType.SILO]:
        return _write(reader, order, progress)
    return write_apart(reader, order, progress)


def _write(reader: RunReader, order: WriteOrder, progress: Callable[[float], None]) -> WriteReport:
    folder = Path(order.folder)
    most_left = asked_left(folder) if order.leaves_room else 0

    def told(fraction: float) -> None:
        if order.leaves_room:  # as text it may be many times what it takes in memory
            check_room(folder, 0, most_left=most_left)
        progress(fraction)

    try:
        recording = reader.snapshot()
        damaged = missing(reader) if order.of_dead else ()
        events = LogOfRun(reader.schema.folder, reader.schema.run) if order.of_dead else order.events
        files = write_run(
            recording, order.folder, order.logger, order.types, order.name or None, told, order.why,
            events=events, conditions=order.conditions, damage=damaged,
        )  # fmt: skip
    except PartlySavedError as error:
        return _partly(error, recording.offset)
    except SiloError as error:
        return WriteReport(1.0, True, error=str(error))
    return WriteReport(1.0, True, recording.offset, files, damage=damaged)


def _partly(error: PartlySavedError, ticks: int) -> WriteReport:
    return WriteReport(1.0, True, ticks if error.saved else 0, list(error.saved), str(error))


def save_apart(
    reader: RunReader, folder: str, types: Sequence[FileType], conditions: Conditions | None
) -> tuple[list[SavedFile], Holdings]:
    """Save what a dead program left in a process of its own that is nice to others; no file if it is nothing.

    Raises SaveError.
    """
    held = segment_holdings(reader)
    if not held.samples:
        return [], held
    journal = str(reader.path) if isinstance(reader, JournalReader) else ""
    order = WriteOrder(
        folder, reader.schema.logger, list(types), "", of_dead=True, journal=journal, why=DIED, conditions=conditions
    )
    report = write_apart(None if isinstance(reader, JournalReader) else reader, order, lambda _: None)
    if report.error:
        raise SaveError(report.error)
    return report.files, held


def write_apart(
    reader: SegmentReader | None, order: WriteOrder, progress: Callable[[float], None], claims: Sequence[int] = ()
) -> WriteReport:
    """The same in a process of its own; without a reader, of the journal. Raises SaveError if that dies.

    It keeps up the `claims`, descriptors of what nobody else may write meanwhile, should this process be killed.
    """
    segments = [reader.fileno()] if reader is not None else []
    arguments: list[str | int] = [*segments, HOLD, os.getpid(), *claims]
    decoder = json_decoder(WriteReport)
    with ChildProcess("silo.recordings.writing", arguments, [*segments, *claims], stdin=PIPE, stdout=PIPE) as child:
        with contextlib.suppress(BrokenPipeError):  # its exit code, below, says more
            child.stdin.write(msgspec.json.encode(order))
            child.stdin.close()
        for line in child.stdout:
            report = decoder.decode(line)
            if report.done:
                return report
            progress(report.progress)
        code = child.wait()
    raise SaveError(
        f"the process that wrote the log ended with exit code {code}, out of memory perhaps; "
        "save as .silo, which needs least, or make room and try again"
    )


def _written(order: WriteOrder, progress: Callable[[float], None]) -> WriteReport:
    if not order.log:
        reader = JournalReader(order.journal) if order.journal else SegmentReader(f"/proc/self/fd/{sys.argv[1]}")
        return _write(reader, order, progress)
    from silo.files.formats import read_recording

    try:
        recording = read_recording(Path(order.log))
        files = write(recording, order.folder, order.logger, order.types, order.name or None, progress)
    except PartlySavedError as error:
        return _partly(error, recording.offset)
    except SiloError as error:
        return WriteReport(1.0, True, error=str(error))
    return WriteReport(1.0, True, recording.offset, files)


def main() -> None:
    """The writing process: the segment's file descriptor as argument, the order on standard input."""
    try:
        order = json_decoder(WriteOrder).decode(sys.stdin.buffer.read())
    except msgspec.ValidationError:
        raise
    except msgspec.DecodeError:
        sys.exit(1)  # the helper was killed before it had said all of it, and nobody is left to be told
    if HOLD in sys.argv:
        parent, *claims = map(int, sys.argv[sys.argv.index(HOLD) + 1 :])
        for claim in claims:
            note_holder(claim, parent)
    if not order.awaited:
        os.nice(NICER)

    def say(report: WriteReport) -> None:
        sys.stdout.buffer.write(msgspec.json.encode(report) + b"\n")
        sys.stdout.buffer.flush()

    try:
        say(_written(order, lambda fraction: say(WriteReport(min(max(fraction, 0.0), 1.0)))))
    except BrokenPipeError:
        # the helper was killed: what was written is removed, and nobody is left to be told
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


if __name__ == "__main__":
    main()
