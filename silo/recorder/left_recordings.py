"""Endless recordings of programs that are gone, and their helper processes with them: completed from what they left.

What was recorded is told by the list of recorders in the runtime folder, how far each was by its ledger and its parts,
and the rows are in the runs that are held, and in the last one. A recorder goes on with them as one that is replaced.

Who finishes what: a ledger is that of its order as long as a list names that one. Who would begin another order under
that name has it completed first (`settle_order`), be it that the next helper process or `silo recover` is about to do
so, is at it, or never comes: the list is claimed by one process at a time. A recorder that comes to go on with an order
after which another one began has nothing to go on by, and records nothing.
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
    open_own,
    runtime_dir,
)
from silo.errors import SegmentError, reason
from silo.files.event_log import add_missing
from silo.files.manifest import name_in_use, read_written
from silo.polling import readable
from silo.recorder.orders import CLOSED, RecordOrder
from silo.recorder.process import RecorderHandover, RecorderProcess, store, stored
from silo.recovery.left import claimed_file, log_start
from silo.rpc.published import EventKind
from silo.segment.held_runs import Program, all_runs, is_live, number_of
from silo.segment.layout import SegmentSchema
from silo.segment.reader import SegmentReader

MOST_LIVES = 3  # of a recorder that dies again and again
LOOK_S = 0.05  # how often is looked whether a program that lives is done with an order

log = logging.getLogger("silo")

Tell = Callable[[RecordOrder, str], object]


def told(order: RecordOrder, text: str) -> str:
    """Return what is told of a recording with its name."""
    return f"recording '{order.name}': {text}"


def left_lists() -> list[tuple[Path, list[RecorderHandover]]]:
    """Return what recorded loggers that are gone; damaged lists, that nobody can use, are removed."""
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
                if kept and not is_live(kept[0].program):
                    found.append((path, kept))
                if not kept and is_at(descriptor, path):  # else its helper process began another
                    path.unlink(missing_ok=True)
    return found


def _stored(path: Path) -> list[RecorderHandover]:
    """The list; none where it is damaged, which is told: it goes."""
    try:
        return stored(path)
    except SegmentError as error:
        log.warning("%s", error)
        return []


def settle_order(order: str, tell: Tell, wait_s: float) -> list[str]:
    """Have an order be over under whose name another one is to begin: completed if its program is gone.

    Returns in words what could not be completed: that is let go of. One of a program that lives is waited for so long.
    Raises SaveError if it still goes on then.
    """
    problems: list[str] = []
    until_s = time.monotonic() + wait_s
    while (one := listed(order)) is not None:
        problems += complete_recordings(tell, lambda one: one.order.order == order, for_good=True)
        if listed(order) is None:
            break
        if time.monotonic() > until_s:
            raise name_in_use(Path(one.order.folder))
        time.sleep(LOOK_S)  # nothing tells of the end of another helper process's order
    return problems


def listed(order: str) -> RecorderHandover | None:
    """Return what lists of helper processes say of an order that is not over; None where none names it."""
    with contextlib.suppress(SegmentError):  # no runtime folder: then there is nothing in it either
        for path in runtime_dir().glob(f"*{RECORDERS_SUFFIX}"):
            with contextlib.suppress(SegmentError):  # a damaged one is told by who would complete it
                for one in stored(path):
                    if one.order.order == order:
                        return one
    return None


def complete_recordings(
    tell: Tell, wanted: Callable[[RecorderHandover], bool] = lambda _: True, *, for_good: bool = False
) -> list[str]:
    """Complete what was recorded of loggers that are gone; `tell` is told of each recording.

    Returns in words what could not be completed: it stays for the next time, but is let go of `for_good`.
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
            if not (rest := _stored(path)):
                continue
            runs = _runs_of(rest[0].program, held)
            for one in filter(wanted, rest.copy()):
                problem = _complete_one(one, runs, tell)
                if problem:
                    over = for_good or _is_over(one.order)
                    more = "is in no part is not recorded" if over else "is there stays for the next try"
                    problems.append(f"recording '{one.order.name}' in {one.order.folder} {problem}; what of it {more}")
                if not problem or over:
                    rest.remove(one)
            for reader in runs:
                log_start(reader)
            store(path, rest)
    return problems


def _is_over(order: RecordOrder) -> bool:
    written = read_written(Path(order.folder), order.name)
    return written is not None and order.order in written.orders


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
    code = 0
    for _ in range(MOST_LIVES):
        try:
            recorder.start(order)
        except OSError as error:
            return f"can't be completed: {reason(error)}"
        for reader in runs:
            recorder.follow(reader, None)
        recorder.finish(kept.ending or CLOSED, 0)
        _listen(recorder, tell)
        code = recorder.reap()
        if recorder.report.state.over:
            break
    if recorder.report.state is not RecorderState.ENDED:
        return f"can't be completed: {recorder.report.text or f'its process died (exit code {code}) each time'}"
    if runs:
        _log(recorder, runs[-1].schema)
    tell(order, f"completed in {order.folder}, {recorder.sums().text}")
    return ""


def _log(recorder: RecorderProcess, schema: SegmentSchema) -> None:
    """Have the event log say of its last run what the helper process would have."""
    name, folder = recorder.order.name, Path(recorder.order.folder)
    written = read_written(folder, name)
    mine = written is not None and written.order == recorder.order.order
    parts = [part for part in written.parts if part.name not in written.earlier] if written and mine else []
    texts = [told(recorder.order, f"finished {folder / part.name}") for part in parts]
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
            tell(recorder.order, report.told)
