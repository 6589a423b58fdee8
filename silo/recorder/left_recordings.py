"""Endless recordings of programs that are gone, and their helper processes with them: completed from what they left.

What was recorded is told by the list of recorders in the runtime folder, how far each was by its ledger and its parts,
and the rows are in the runs that are held, and in the last one. A recorder goes on with them as one that is replaced.
"""

import contextlib
import logging
import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec

from silo.core.elements import LoggedEvent, RecorderState
from silo.core.runtime import (
    RECORDERS_SUFFIX,
    closing_file,
    is_at,
    list_segments,
    open_own,
    process_start,
    runtime_dir,
)
from silo.errors import SegmentError, reason
from silo.files.event_log import add_missing
from silo.files.manifest import read_written
from silo.polling import readable
from silo.recorder.orders import CLOSED
from silo.recorder.process import RecorderHandover, RecorderProcess, store, stored
from silo.recovery.left import claimed_file, log_start
from silo.rpc.published import EventKind
from silo.segment.held_runs import Program, all_runs, is_live, number_of, readers
from silo.segment.layout import SegmentSchema
from silo.segment.reader import SegmentReader

MOST_LIVES = 3  # of a recorder that dies again and again

log = logging.getLogger("silo")

Tell = Callable[[str], object]


def left_lists() -> list[tuple[Path, list[RecorderHandover]]]:
    """Return what recorded loggers that are gone; lists of older helper processes, that nobody can use, are removed."""
    found = []
    with contextlib.suppress(SegmentError):  # no runtime folder: then there is nothing in it either
        for path in sorted(runtime_dir().glob(f"*{RECORDERS_SUFFIX}")):
            try:
                descriptor = open_own(path, os.O_RDONLY)
            except FileNotFoundError:
                continue  # its helper process needs it no more
            except OSError as error:
                log.warning("%s can't be opened (%s): what was recorded waits until it can be", path, reason(error))
                continue
            with closing_file(descriptor):
                kept = _stored(path)
                if kept and kept[0].program.pid:
                    if not is_live(kept[0].program):
                        found.append((path, kept))
                elif _is_forgotten(path) and is_at(descriptor, path):  # else its helper process began another
                    path.unlink(missing_ok=True)
    return found


def _stored(path: Path) -> list[RecorderHandover]:
    """The list; none where it is damaged, which is told: it goes."""
    try:
        return stored(path)
    except SegmentError as error:
        log.warning("%s", error)
        return []


def _is_forgotten(path: Path) -> bool:
    """Whether a list of an older silo, by name and pid, is of a program that is gone, as far as is seen here."""
    start, _, pid = path.name.removesuffix(RECORDERS_SUFFIX).rpartition(".")
    if not pid.isdecimal():
        return True  # a damaged one
    for reader in readers(list_segments(), f"{start}.{pid}"):
        with contextlib.closing(reader):
            if reader.alive():
                return False  # perhaps of a process of another container, which has no start here
    return not process_start(int(pid))


def complete_recordings(tell: Tell, wanted: Callable[[RecorderHandover], bool] = lambda _: True) -> list[str]:
    """Complete what was recorded of loggers that are gone; `tell` is told of each recording.

    Returns in words what could not be completed: it stays for the next time.
    """
    problems: list[str] = []
    for path, found in left_lists():
        if not any(map(wanted, found)):
            continue
        with contextlib.ExitStack() as held:
            try:
                held.enter_context(claimed_file(path, os.O_RDWR, wait=True))
            except FileNotFoundError:
                continue  # another process completed them
            problems += _complete(path, _stored(path), tell)
    return problems


def _complete(path: Path, kept: Sequence[RecorderHandover], tell: Tell) -> list[str]:
    problems: list[str] = []
    rest = list(kept)
    if not rest:
        return problems
    with contextlib.ExitStack() as closing:
        runs = _runs_of(kept[0].program, closing)
        for one in kept:
            problem = _complete_one(one, runs, tell)
            if problem:
                problems.append(problem)
            else:
                rest.remove(one)
        for reader in runs:
            log_start(reader)
    store(path, rest)
    return problems


def _runs_of(program: Program, closing: contextlib.ExitStack) -> list[SegmentReader]:
    """What there is of a logger, oldest first: runs that are held, and the last one."""
    found = list(all_runs(program.logger, program.logger_id))
    for reader in found:
        closing.callback(reader.close)
    return sorted(found, key=lambda reader: number_of(reader.path))


def _complete_one(kept: RecorderHandover, runs: Sequence[SegmentReader], tell: Tell) -> str:
    """Have a recorder go on, to the end of the last run; returns why it could not."""
    order = msgspec.structs.replace(kept.order, resume=True)
    wanted = kept.wanted([reader.schema.run for reader in runs])
    runs = [reader for reader in runs if reader.schema.run in wanted]
    recorder = RecorderProcess(msgspec.structs.replace(kept, order=order))
    recorder.runs = [*wanted]
    for _ in range(MOST_LIVES):
        try:
            recorder.start(order)
        except OSError as error:
            return f"recording '{order.name}' can't be completed: {reason(error)}; what there is of it stays"
        for reader in runs:
            recorder.follow(reader, None)
        recorder.finish(kept.ending or CLOSED, 0)
        _listen(recorder, tell)
        recorder.reap()
        if recorder.report.state.over:
            break
    text = f"recording '{order.name}' in {order.folder}"
    if recorder.report.state is not RecorderState.ENDED:
        why = recorder.report.text or "its process died each time"
        return f"{text} can't be completed: {why}; what is there of it stays for the next try"
    if runs:
        _log(recorder, runs[-1].schema)
    tell(f"{text}: completed, {recorder.sums().text}")
    return ""


def _log(recorder: RecorderProcess, schema: SegmentSchema) -> None:
    """Have the event log say of its last run what the helper process would have."""
    name, folder = recorder.order.name, Path(recorder.order.folder)
    written = read_written(folder, name)
    texts = [f"recording '{name}': finished {folder / part.name}" for part in written.parts] if written else []
    texts.append(f"recording '{name}' ended: {recorder.report.text}; {recorder.sums().text}")
    line = partial(LoggedEvent, EventKind.RECORDING.value, time_ns=time.time_ns(), who=schema.logger, run=schema.run)
    add_missing(schema.folder, schema.logger, schema.run, [line(text) for text in texts])


def _listen(recorder: RecorderProcess, tell: Tell) -> None:
    """Hear a recorder to its end."""
    while True:
        readable(recorder.socket.fileno())
        try:
            report = recorder.receive()
        except BlockingIOError:
            continue
        if report is None:
            return
        recorder.report = report
        if report.told:
            tell(f"recording '{recorder.order.name}': {report.told}")
