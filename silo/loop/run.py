"""One run of a logger: from `start()` to the next one. Plan, segment and generated `collect()` belong together."""

import dataclasses
import functools
import itertools
import logging
import os
import secrets
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import LoggerOptions, Storage, Threads
from silo.core.runtime import (
    SEGMENT_SUFFIX,
    announce_segment,
    boot_id,
    pid_namespace,
    process_start,
    runtime_dir,
    user_name,
    withdraw_segment,
)
from silo.core.structs import alike
from silo.errors import SegmentError, reason
from silo.loop.clocks import looked_at
from silo.loop.generated_code import Collect, LandsChanges, generate
from silo.loop.orphaned_arrays import Unheld, Watched
from silo.loop.pieces import words_at
from silo.loop.plan import Element, Plan, make_plan
from silo.segment.held_runs import held_name
from silo.segment.layout import Cut, SegmentSchema
from silo.segment.reader import SegmentReader
from silo.segment.reasons import StopReason
from silo.segment.writer import Segment

logger = logging.getLogger("silo")
READ_TOGETHER = 500  # sources: few enough that what another thread changes is rarely seen between two reads
_numbers = itertools.count()


class Run:
    """A segment that is being written, or that was. It owns nothing until `begin`, and nothing after `drop`."""

    def __init__(
        self,
        options: LoggerOptions,
        elements: Sequence[Element],
        clock: Callable[[], int],
        on_stop: Callable[[StopReason], None],
        after_end: Collect,
        conditions: Conditions = NO_CONDITIONS,
        before: "Run | None" = None,
        number: int = 0,
        *,
        served: bool = False,
        landing: LandsChanges | None = None,
        cut: Cut | None = None,
    ) -> None:
        """Lay out the buffers. Raises SegmentError where there can be none.

        before: the logger's last run, whose layout is taken where the table is the same; number: of this one; served:
        whether its logger has a helper process, or is to get one again; landing: where changes of parameters wait, of a
        logger that has any; cut: how it goes on another run.
        """
        unchanged = before is not None and before._elements is elements
        plan = before.plan.again() if before and unchanged else _laid_out(options, elements)
        self.plan: Plan = plan
        self._elements: Sequence[Element] | None = elements
        self._watched: Watched = before._watched if before and unchanged else Watched.of(elements)
        path = self._path(options)
        self._announced = options.storage is Storage.FILE
        self.number = number
        self.saved_ticks = 0  # how many of its ticks stand in files
        self._left = False  # whether the last of these were left to another process that saves them
        self.unmarked = False  # whether these are of before it was cut, and don't tell that it is a part of a run
        self._reader: SegmentReader | None = None
        pid = os.getpid()
        schema: SegmentSchema = alike(
            SegmentSchema,
            options,
            logger=options.name,
            host=socket.gethostname(),
            user=user_name(os.getuid()),
            pid=pid,
            pid_start=process_start(pid),
            boot_id=boot_id(),
            started_ns=time.time_ns(),
            chunk_bytes=plan.chunk_bytes,
            time_buffer_type=plan.time.buffer_type,
            time_buffer_size=plan.time.size,
            rings=tuple(ring.schema for ring in plan.rings),
            elements=plan.elements,
            logger_id=options.id,
            run=secrets.token_hex(8),
            pid_namespace=pid_namespace(),
            conditions=conditions,
            number=number,
            served=served,
            parameters=tuple(landing.described()) if landing is not None else (),
            cut=cut,
        )
        self.segment = Segment(
            path,
            schema,
            plan.first_rows,
            options.memory_limit_mb * 1_000_000,
            in_memory=options.storage is not Storage.FILE,
            elements_json=plan.elements_json,
        )
        self._unheld = Unheld(self._watched, self.segment)
        self._goes_on = [True]  # taken by what ends it: one takes it, whichever threads they are
        self._generate = functools.partial(
            generate,
            clock=looked_at(clock, options.name, options.frequency_hz),
            on_stop=functools.partial(_by_itself, self._goes_on, on_stop),
            after_end=after_end,
            serialized=options.threads is Threads.SERIALIZED,
            landing=landing,
        )
        self._landing = landing
        self._is_live = False
        self.collect: Collect = _nothing
        self._retire: Callable[[], None] = _nothing

    def begin(self) -> None:
        """Make it ready, and the present one. Raises SegmentError where there is no room for its buffers."""
        self.prepare()
        self.go_live()

    def prepare(self) -> None:
        """Allocate and touch the buffers, and make `collect`. Raises SegmentError where there is no room for them.

        After an error or an interrupt, `drop` lets go of whatever there is until then.
        """
        if self._announced:
            announce_segment(self.segment.path)
        self.segment.make()
        if self._announced:
            announce_segment(self.segment.path)
        self.collect, self._retire = self._generate(self.plan, self.segment)

    def go_live(self) -> None:
        """Be the one whose ticks come next."""
        self.take_changes()
        self._unheld.tell_at_start()

    def take_changes(self) -> None:
        """Have changes of parameters recorded here from now on; again, where another run was to take its place."""
        if self._landing is not None and self._landing.record is not self.segment.changes:
            self._landing.begin_run(self.segment.changes, self._next_row, first=not self._is_live)
            self._is_live = True

    def _next_row(self) -> int:
        """The index of the next row, -1 while none comes."""
        return self.segment.ticks if self.segment.is_running else -1

    @staticmethod
    def _path(options: LoggerOptions) -> Path:
        if options.storage is Storage.FILE:
            folder, dot = Path(options.folder), "."
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise SegmentError(f"{folder}: can't make the folder for logs ({reason(error)})") from error
        else:
            folder, dot = runtime_dir(), ""
        names = (f"{dot}{options.name}.{os.getpid()}.{number}{SEGMENT_SUFFIX}" for number in _numbers)
        # pids come again, in containers at every start: a predecessor's recording keeps its name
        return next(path for path in map(folder.joinpath, names) if not path.exists() and not held_name(path).exists())

    @property
    def id(self) -> str:
        """What tells this run from all others."""
        return self.segment.schema.run

    @property
    def reader(self) -> SegmentReader:
        """A reader of this run's segment, opened at first use. Not for the control loop."""
        if self._reader is None:
            with self.segment.open_read_only() as file:
                self._reader = SegmentReader(self.segment.path, file.fileno())
        return self._reader

    def left_behind(self, pause: Callable[[], None]) -> list[int]:
        """What `look` is to be given while the loop turns: the arrays that nobody but silo holds. Takes no lock."""
        return self._unheld.without_anybody(pause)

    def look(self, found: Sequence[int] | None = None, *, last: bool = False) -> None:
        """Tell of arrays that were left behind, once. For who has the logger's lock; after the `last` look: nothing."""
        during = found is not None
        self._unheld.take(
            self._unheld.without_anybody() if found is None else found, lambda: self.reader, during=during, last=last
        )

    def end_by_cut(self) -> bool:
        """No more ticks but the one that is under way; False where it has ended, or that one ends it."""
        self._retire()
        cut = _taken(self._goes_on)
        if cut:
            self.segment.say_cut()
        return cut

    def end(self, reason: StopReason) -> None:
        """No more ticks; a `collect` that somebody kept goes to the logger's present one from now on."""
        _taken(self._goes_on)
        self._retire()
        self.segment.stop(reason)

    def leave(self) -> None:
        """Have another process save what it has: its file stays until that has done so."""
        self.saved_ticks, self.unmarked, self._left = self.segment.ticks, False, True

    @property
    def is_left(self) -> bool:
        """Whether another process has still to save what it has."""
        return self._left and self.segment.saved_ticks < self.saved_ticks

    def forget(self) -> None:
        """No more ticks and changes in this process, a forked child; the segment goes on being its parent's."""
        self._retire()
        self._end_changes()
        self.segment.forget()

    def drop(self, *, held: bool = False) -> Path | None:
        """Delete the segment, which readers that have it mapped keep, and let go of the program's variables.

        `held`: it stays under another name, which is returned, for those who still have to read it. May be called
        again, where it was interrupted.
        """
        self._retire()
        self.collect = self._retire = _nothing
        self._end_changes()
        self.plan = dataclasses.replace(self.plan, references=())
        self._elements, self._watched = None, Watched.of(())
        self._unheld.end()
        kept = self.segment.unlink(held=held, left=self.is_left)
        if self._announced and kept is None and not self.is_left:
            withdraw_segment(self.segment.path)
        if self._reader is not None:
            self._reader.close()
            self._reader = None
        return kept

    def _end_changes(self) -> None:
        if self._landing is not None:
            self._landing.end_run(self.segment.changes)
            self._landing = None


def _taken(once: list[bool]) -> bool:
    """Whether it is the caller who takes the only item of a list: one step, of two threads one."""
    try:
        return once.pop()
    except IndexError:
        return False


def _by_itself(goes_on: list[bool], on_stop: Callable[[StopReason], None], reason: StopReason) -> None:
    """Called by the tick with which a run ends by itself, unless something else has ended it."""
    if _taken(goes_on):
        on_stop(reason)


def _laid_out(options: LoggerOptions, elements: Sequence[Element]) -> Plan:
    plan = make_plan(elements, options.frequency_hz, options.max_time_s, options.size_tiers, checked=options.checked)
    if options.checked or addresses_work(plan):
        return plan
    logger.warning("reading variables by address doesn't work on this system: falling back to checked=True, 10x slower")
    return make_plan(elements, options.frequency_hz, options.max_time_s, options.size_tiers, checked=True)


def _nothing() -> None:
    """What is left of a dropped run."""


def addresses_work(plan: Plan) -> bool:
    """Whether bytes read by address are those that NumPy sees: the first and last item of every source.

    A value that another thread changes meanwhile gets further tries.
    """
    views = [reference.view for reference in plan.references]
    parts = [views[begin : begin + READ_TOGETHER] for begin in range(0, len(views), READ_TOGETHER)]
    other = itertools.chain.from_iterable(map(_read_otherwise, parts))
    return all(any(not _read_otherwise([view]) for _ in range(5)) for view in other)


def _read_otherwise(views: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
    """Those whose first or last item is not what stands at its address."""
    ends = [(place, *end) for place, view in enumerate(views) for end in _ends(view) if end[1]]
    if not ends:
        return []
    sizes = np.array([len(seen) for _, _, seen in ends])
    read = _read_bytes(np.array([address for _, address, _ in ends], np.int64), sizes)
    differs = read != np.frombuffer(b"".join([seen for _, _, seen in ends]), np.uint8)
    if not differs.any():
        return []
    return [views[place] for place in np.unique(np.repeat([place for place, _, _ in ends], sizes)[differs])]


def _ends(view: NDArray[Any]) -> list[tuple[int, bytes]]:
    """The addresses of the first and last item, and what NumPy sees there."""
    address: int = view.__array_interface__["data"][0]
    if view.size == 1:
        return [(address, view.tobytes())]
    last = address + sum((size - 1) * step for size, step in zip(view.shape, view.strides, strict=True))
    # arrays of one item, not scalars: those have the byte order of the machine, and cut strings at their zeros
    first, final = ((..., *[one] * view.ndim) for one in (slice(0, 1), slice(-1, None)))
    return [(address, view[first].tobytes()), (last, view[final].tobytes())]


def _read_bytes(addresses: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.uint8]:
    """So many bytes from each address on, one after the other, read in whole words as `collect()` does."""
    bytes_at = np.repeat(addresses - (np.cumsum(sizes) - sizes), sizes) + np.arange(sizes.sum())
    low, high = int(bytes_at.min()) // 8, int(bytes_at.max()) // 8
    words = words_at(low, high - low + 1)[bytes_at // 8 - low]
    read: NDArray[np.uint8] = words.view(np.uint8).reshape(-1, 8)[np.arange(len(words)), bytes_at % 8]
    return read
