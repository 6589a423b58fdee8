"""Runs that wait for their consumers: their programs let go of them, and recorders or the judge were not done.

The file of a run has three names in its life: `.segment` while its program has it, `.held` when that is done with it
(it began another run, was closed, or died and its log was saved) and somebody still has to read it, and none. Who needs
it is told by what the consumers leave for their successors: `is_due`. How far each was stands there, too.

What doesn't fit the bound is replaced by a stub, that tells how much there was and holds none of it: who comes later
finds a hole, and writes it down as any other.
"""

import contextlib
import itertools
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from silo.core.runtime import (
    HELD_SUFFIX,
    JUDGE_SUFFIX,
    RECORDERS_SUFFIX,
    SEGMENT_SUFFIX,
    announce_segment,
    available_memory_bytes,
    boot_id,
    closing_file,
    disk_room,
    list_held,
    list_segments,
    pid_namespace,
    process_start,
    replaced_file,
    runtime_dir,
    withdraw_segment,
)
from silo.errors import SegmentError
from silo.segment.layout import ControlWord, HeaderWord, SegmentSchema
from silo.segment.reader import SegmentReader

HELD_RUNS = 64  # with their rows; each takes two descriptors of the helper process, as do stubs, of 1024
HELD_BYTES = 1_000_000_000  # and no more than a quarter of the file system
HELD_SHARE = 0.25
STUBS = 100  # of 4 kB and more, by which is known what is missing


class Program(msgspec.Struct, frozen=True):
    """A logger in a program, told from all others: pids come again, and count anew in each container."""

    logger: str = ""
    logger_id: str = ""
    pid: int = 0
    pid_start: int = 0
    boot_id: str = ""
    pid_namespace: int = 0


def program_of(schema: SegmentSchema) -> Program:
    """Return whose run a segment is."""
    return Program(schema.logger, schema.logger_id, schema.pid, schema.pid_start, schema.boot_id, schema.pid_namespace)


def child_of(logger: str, logger_id: str, pid: int) -> Program:
    """Return a logger of a process that this one can see."""
    return Program(logger, logger_id, pid, process_start(pid), boot_id(), pid_namespace())


# ----------------------------------------------------------------------------------------------------------- the ledger


def recorders_path(logger: str, logger_id: str) -> Path:
    """Return where stands what records this logger; it is there as long as a recorder is not done with its runs."""
    return runtime_dir() / f"{logger}.{logger_id}{RECORDERS_SUFFIX}"


def judge_path(logger: str, run: str) -> Path:
    """Return where stands what the judge knows of a run; it is there as long as it is not done with it."""
    return runtime_dir() / f"{logger}.{run}{JUDGE_SUFFIX}"


def is_due(schema: SegmentSchema) -> bool:
    """Whether somebody still has to read this run: a recorder of its logger, or the judge."""
    with contextlib.suppress(SegmentError):  # no runtime folder: then nobody left anything in it
        return (
            recorders_path(schema.logger, schema.logger_id).exists() or judge_path(schema.logger, schema.run).exists()
        )
    return False


def has_left(logger: str, logger_id: str) -> bool:
    """Whether recorders, or runs that are held, wait for the next helper process of a logger."""
    with contextlib.suppress(SegmentError):  # no runtime folder: then nothing is left in it either
        if recorders_path(logger, logger_id).exists():
            return True
        return any(path.name.lstrip(".").startswith(f"{logger}.") for path in list_held())
    return False


# --------------------------------------------------------------------------------------------------- the life of a name


def held_name(path: Path) -> Path:
    """Return the name that a segment has while it is held."""
    return path.with_name(path.name.removesuffix(SEGMENT_SUFFIX) + HELD_SUFFIX)


def hold(path: Path) -> Path:
    """Give a segment the name of one that is held; returns that. Raises OSError."""
    held = held_name(path)
    linked = path.name.startswith(".")
    if linked:
        announce_segment(held)  # first: what is found by two names is found
    try:
        path.rename(held)
    except FileNotFoundError:
        if not held.exists():  # somebody deleted it; else it was interrupted between the two names
            if linked:
                withdraw_segment(held)
            raise
    if linked:
        withdraw_segment(path)
    return held


def remove(path: Path) -> None:
    """Delete a segment, held or not, under its name and its link."""
    path.unlink(missing_ok=True)
    if path.name.startswith("."):
        withdraw_segment(path)


def number_of(path: Path) -> int:
    """Return by what runs of a process follow one another."""
    number = path.name.rsplit(".", 2)[-2]
    return int(number) if number.isdecimal() else 0


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Return runs, those of one process as they followed one another."""
    return sorted(paths, key=lambda path: (path.name.rsplit(".", 2)[0], number_of(path)))


def readers(paths: Iterable[Path], logger: str = "", logger_id: str = "") -> Iterator[SegmentReader]:
    """Yield readers of runs, to be closed: of one logger, or all. Damaged ones, and what is gone by now, are not."""
    for path in paths:
        if not logger or path.name.lstrip(".").startswith(f"{logger}."):
            with contextlib.suppress(SegmentError):
                reader = SegmentReader(path)
                if logger_id in ("", reader.schema.logger_id):
                    yield reader
                else:
                    reader.close()


def held_runs(logger: str = "", logger_id: str = "") -> list[SegmentReader]:
    """Return readers of runs that are held, oldest first, to be closed: of one logger, or all."""
    return list(readers(in_order(list_held()), logger, logger_id))


def all_runs(logger: str = "", logger_id: str = "", folder: Path | None = None) -> Iterator[SegmentReader]:
    """Yield readers of all runs, to be closed, each once: those that their programs have, then those that are held.

    In this order, as it is that of their names: what is let go of meanwhile is found among the others.
    """
    seen = set[str]()
    for reader in itertools.chain(readers(list_segments(folder), logger, logger_id), _held_by_now(logger, logger_id)):
        if reader.schema.run in seen:
            reader.close()
        else:
            seen.add(reader.schema.run)
            yield reader


def _held_by_now(logger: str, logger_id: str) -> Iterator[SegmentReader]:
    yield from readers(list_held(), logger, logger_id)


def is_live(program: Program) -> bool:
    """Whether a logger is still there: its program lives and did not close it.

    Told by its runs, which are seen from every container: the present one has no other name, and is locked.
    """
    if program.boot_id != boot_id():
        return False
    runs = 0
    for reader in all_runs(program.logger, program.logger_id):
        with contextlib.closing(reader):
            runs += 1
            if reader.path.suffix == SEGMENT_SUFFIX and reader.alive():
                return True
    if runs:
        return False
    if program.pid_namespace != pid_namespace():
        return True
    start = process_start(program.pid)
    return start != 0 and start == program.pid_start


# ------------------------------------------------------------------------------------------------------------ the bound


def bound_of(folder: Path) -> tuple[int, int]:
    """Return how many runs of one logger may be held in this folder, and how many bytes of them."""
    try:
        _, size_bytes = disk_room(folder)
    except OSError:
        return HELD_RUNS, HELD_BYTES
    return HELD_RUNS, min(HELD_BYTES, int(HELD_SHARE * size_bytes))


def bytes_of(path: Path) -> int:
    """Return what a file takes; 0 where it is gone."""
    try:
        return path.stat().st_blocks * 512
    except OSError:
        return 0


def _is_stub(path: Path) -> bool:
    """Whether the rows of a run went: told by itself. By its size on the disk small ones look as if they were whole."""
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW
    with contextlib.suppress(OSError), closing_file(os.open(path, flags)) as file:
        return _word(file, _word(file, 8 * HeaderWord.CONTROL_OFFSET) + 8 * ControlWord.DROPPED) != 0
    return False


def _word(file: int, offset: int) -> int:
    return int.from_bytes(os.pread(file, 8, offset), "little", signed=True)


def trim(paths: Sequence[Path], *, in_memory: bool, room_bytes: int = 0) -> list[Path]:
    """Have the oldest runs that are held make room: for the bound, and so that `room_bytes` are free beside them.

    Returns those of which the rows went, or will as soon as their readers let go of them.
    """
    there = [path for path in paths if path.exists()]
    for path in there[:-STUBS]:
        remove(path)
    whole = [path for path in there[-STUBS:] if not _is_stub(path)]
    gone: list[Path] = []
    most_runs, most_bytes = bound_of(whole[0].parent) if whole else (0, 0)
    while whole and (
        len(whole) > most_runs
        or sum(map(bytes_of, whole)) > most_bytes
        or _free_bytes(whole[0].parent, in_memory=in_memory) < room_bytes
    ):
        gone.append(whole.pop(0))
        make_stub(gone[-1])
    return gone


def _free_bytes(folder: Path, *, in_memory: bool) -> int:
    free, _ = disk_room(folder)
    return min(free, available_memory_bytes()) if in_memory else free


def make_stub(path: Path) -> None:
    """Replace a run that is held by what tells of it: its description and its counts, without a row.

    Whoever has it open keeps it. Where there is no room even for that it is deleted: the numbers of the runs tell that
    one is missing.
    """
    try:
        with contextlib.closing(SegmentReader(path)) as reader, replaced_file(path) as file:
            # zeros too: who looks at a page that isn't there takes one, and ends by SIGBUS where there is none
            file.write(os.pread(reader.fileno(), reader.rows_offset, 0))
            file.truncate(reader.size_bytes)
            file.seek(reader.control_offset(ControlWord.DROPPED))
            file.write((1).to_bytes(8, "little"))
    except (OSError, SegmentError):
        remove(path)
