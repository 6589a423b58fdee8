"""The run that a logger has: how the next one takes its place, and how much of it stands in files.

A run that holds unsaved data is let go of only by a decision: the program's (`clear`), or after it was saved. A cut
has another one go on it, tick by tick, while the loop turns: the stretches before that one stay until they are saved.
"""

import contextlib
import gc
import logging
import sys
import threading
import time
import weakref
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from silo.core.conditions import Conditions
from silo.core.elements import ElementInfo, LoggerOptions, Storage
from silo.core.quantities.writing import many
from silo.errors import NoRoomError, StateError, UnsavedError
from silo.journal.format import remove_journals
from silo.journal.holdings import segment_holdings
from silo.logger.unclosed import save_run
from silo.loop.run import Run
from silo.segment.held_runs import bytes_of, trim
from silo.segment.reasons import LAST_TICK_S, StopReason

log = logging.getLogger("silo")

SWITCH_S = 0.0002  # how long a tick may wait for the interpreter while a stretch is prepared: 5 ms otherwise
MOST_ELEMENTS = 500  # of a run that is cut: to prepare 10,000 makes ticks late by 5 - 40 ms
MOST_CUT_OFF = 16  # stretches that no file has yet
FREEING_S = 3.0  # how long other processes may take to unmap what was deleted


class CurrentRun:
    """Holds the present run, or the last one; nothing before the first start.

    Whatever owns a file is in `_own` from before it is made until it is let go of: wherever an interrupt comes, the
    next start and `drop` find it.
    """

    def __init__(self) -> None:
        self.run: Run | None = None
        self.number = 0
        self._own: list[Run] = []
        self._begun = 0  # runs before the present one
        self.begun_ns = 0  # when the first stretch of the present one began; 0 without a cut
        self.cut_off: list[Run] = []  # stretches before the present one, until they are saved
        self._ticks_before, self._lost_before, self._failed_before = 0, Counter[str](), Counter[str]()
        self._held: list[Path] = []  # runs before this one that somebody still has to read
        self._told_of_drop = False
        self.saved_before = ""  # where the run before this one was saved, if that was done at the start of this one
        self._wanted: Callable[[Run], bool] = lambda _: False
        self._lost_at_end: dict[str, int] = {}
        self._gone = self._gone_first = 0  # of those, since each start does so, and at the first of these

    def replace(
        self,
        make: Callable[[], Run],
        options: LoggerOptions,
        conditions: Conditions,
        let_go: Callable[[bool], None],
        hand_over: Callable[[], None],
        wanted: Callable[[Run], bool],
    ) -> Run:
        """Make a new run in the place of the present one, which stays if that fails.

        `hand_over` makes the new one known before the old one's files go: else these look as if somebody else had
        deleted them. Those of a run that is `wanted` by others stay, within bounds, until they are done with it. Where
        there is no room, the rows of such runs go first. Where both don't fit into the memory then, the present one is
        saved if it must be, and freed before the new one is made. `let_go` has other processes free it too, or (True)
        those before it alone.

        Raises SegmentError, SaveError: the present run stays.
        """
        in_memory = options.storage is not Storage.FILE
        self._wanted = wanted
        self._let_go_of_others()  # that an interrupt left
        try:
            made = self._begin(make)
        except NoRoomError as error:
            made = self._made_room(error, make, options, conditions, let_go)
        self._begun, self.run = self.runs, made
        self._forget_stretches()
        hand_over()
        self._let_go_of_others()
        self._trim(in_memory=in_memory, room_bytes=made.segment.size_bytes)
        return made

    @property
    def runs(self) -> int:
        """How many runs began."""
        return max(self._begun, self.run.number if self.run is not None else 0)

    def _begin(self, make: Callable[[], Run], begin: Callable[[Run], None] = Run.begin) -> Run:
        made = make()
        self._own.append(made)
        try:
            begin(made)
        except BaseException:
            self.let_go(made)
            raise
        return made

    def prepare(self, make: Callable[[], Run]) -> Run:
        """Make a run ready that is to go on the present one, whose loop turns meanwhile. Raises SegmentError."""
        with _unhurried():
            return self._begin(make, Run.prepare)

    def go_on(self, made: Run) -> None:
        """Have a run that was made ready be the present one; the one before it stays until it is saved."""
        before = self.run
        assert before is not None
        if before is not made:  # else this was interrupted
            if before.segment.schema.cut is None and before.saved_ticks:
                before.unmarked = True
                before.segment.mark_saved(0)  # for who finds it when this process is gone
            if before not in self.cut_off:
                self.cut_off.append(before)  # first: what is in neither place is let go of
            self.begun_ns = self.begun_ns or before.segment.schema.started_ns
            self._begun, self.run = self.runs, made
        made.go_live()

    def settle_cut(self) -> None:
        """Let go of stretches that are saved. A stretch is over once the next one has a tick, or has ended, too."""
        runs = [*self.cut_off, self.run]
        for run, following in zip(self.cut_off.copy(), runs[1:], strict=True):
            assert following is not None
            if following.segment.ticks or not following.segment.is_running:
                if run.segment.is_running:
                    run.segment.stop(StopReason.CUT)
                if not is_to_be_saved(run):
                    self._count(run)
                    remove_journals(run.segment.schema)
                    self.cut_off.remove(run)
                    self.let_go(run, held=self._wanted(run))

    def wait_over(self, run: Run) -> None:
        """Wait until no tick of a stretch is under way, as far as the next one tells: for a thread of its own."""
        runs, until_s = self.stretches, time.monotonic() + LAST_TICK_S
        following = runs[runs.index(run) + 1] if run in runs[:-1] else run
        while following.segment.is_running and not following.segment.ticks and time.monotonic() < until_s:
            time.sleep(0.002)  # the end of another thread's tick can only be polled: a tick tells nobody

    def _count(self, run: Run) -> None:
        self._ticks_before += run.segment.ticks
        self._lost_before.update(_lost(run))
        self._failed_before.update(run.segment.failures)

    def _forget_stretches(self) -> None:
        self.cut_off, self.begun_ns = [], 0
        self._ticks_before, self._lost_before, self._failed_before = 0, Counter(), Counter()

    def _patiently(self, make: Callable[[], Run]) -> Run:
        """Begin a run as soon as there is room: memory is free when the last process has let go of it."""
        until_s = time.monotonic() + FREEING_S
        while time.monotonic() < until_s:
            with contextlib.suppress(NoRoomError):
                return self._begin(make)
            time.sleep(0.02)  # the end of another process's mapping can only be polled
        return self._begin(make)

    def _made_room(
        self,
        error: NoRoomError,
        make: Callable[[], Run],
        options: LoggerOptions,
        conditions: Conditions,
        let_go: Callable[[bool], None],
    ) -> Run:
        in_memory = options.storage is not Storage.FILE
        held_bytes = sum(map(bytes_of, self._held))
        present_bytes = self.run.segment.size_bytes if self.run is not None else 0
        if error.needed_bytes > error.free_bytes + held_bytes + present_bytes:
            raise error
        if held_bytes:
            let_go(True)
            self._trim(in_memory=in_memory, room_bytes=error.needed_bytes)
            if self.run is None or error.needed_bytes <= error.free_bytes + held_bytes:
                with contextlib.suppress(NoRoomError):  # else whoever reads them takes longer to let go of them
                    return self._patiently(make)
        if self.run is None:
            raise error
        if self.has_unsaved:
            self._save(options, conditions)
        let_go(False)
        self._lost_at_end, self._begun = self.lost, self.runs
        self.run = None
        self._forget_stretches()
        self._let_go_of_others()
        self._trim(in_memory=in_memory, room_bytes=error.needed_bytes)
        return self._patiently(make)

    def _let_go_of_others(self) -> None:
        for run in [run for run in self._own if run is not self.run and run not in self.cut_off]:
            self.let_go(run, held=self._wanted(run))

    def let_go(self, run: Run, *, held: bool = False) -> None:
        """Free a run; of one that was made ready, and is not to go on the present one after all, nothing is `held`."""
        path = run.drop(held=held)
        if path is not None and path not in self._held:
            self._held.append(path)
        if run in self._own:
            self._own.remove(run)

    def _trim(self, *, in_memory: bool, room_bytes: int) -> None:
        """Keep to the bound of what may be held."""
        self._held = [path for path in self._held if path.exists()]
        self._tell_gone(len(trim(self._held, in_memory=in_memory, room_bytes=room_bytes)) if self._held else 0)

    def _tell_gone(self, count: int) -> None:
        """Tell of runs that made room: once when that begins, and in one number when it is over."""
        if count and not self._gone:
            log.warning(
                "%s before this one made room before recorders or triggers had read it to its end: what was not "
                "recorded is lost, and is told where it is recorded; how many do is told when it is over",
                "1 run" if count == 1 else f"{count} runs",
            )
        elif not count and self._gone > self._gone_first:
            log.warning("%d runs in all made room before recorders or triggers had read them to their end", self._gone)
        if count and not self._gone:
            self._gone_first = count
        self._gone = self._gone + count if count else 0

    def drop(self) -> bool:
        """Free the memory of all runs; the counts of the last one stay, and the files of those that are wanted.

        Returns whether the last one is, and no helper process that it was left to sees to that.
        """
        self._lost_at_end = self.lost
        is_left = self.is_left  # first: who has saved it by then was done with all else before
        for run in self.cut_off:
            self._count(run)
        self.cut_off = []
        self._let_go_of_others()
        self._tell_gone(0)
        if self.run is None or self.run not in self._own:
            return False
        held = self._wanted(self.run)
        self.let_go(self.run, held=held)
        return held and not is_left

    def forget(self) -> None:
        """Have no run, in a forked child: those of its parent stay as they are."""
        _unhurried.forget()
        for run in self.stretches:
            run.forget()
        vars(self).update(vars(CurrentRun()))

    @property
    def ticks(self) -> int:
        """Ticks logged since the last start."""
        return self._ticks_before + sum(run.segment.ticks for run in self.stretches)

    @property
    def ticks_before(self) -> int:
        """Ticks logged before the last cut; 0 without one."""
        return self._ticks_before + sum(run.segment.ticks for run in self.cut_off)

    @property
    def stretches(self) -> list[Run]:
        """The present run, behind those that it goes on and that are in no file."""
        return [*self.cut_off, self.run] if self.run is not None else []

    def memory_bytes(self) -> int:
        """Return what its buffers take, of all stretches."""
        return sum(run.segment.size_bytes for run in self.stretches)

    @property
    def lost(self) -> dict[str, int]:
        """How many samples of each element could not be kept since the last start, also of a run that was dropped."""
        if self.run is not None and self.run.segment.lost_rows and not self.run.segment.size_bytes:
            return self._lost_at_end
        return dict(sum(map(_lost, self.stretches), self._lost_before.copy()))

    @property
    def failures(self) -> dict[str, int]:
        """At how many ticks each element could not be read since the last start."""
        return dict(sum((Counter(run.segment.failures) for run in self.stretches), self._failed_before.copy()))

    @property
    def path(self) -> str:
        """The file of the run, empty before the first start."""
        return str(self.run.segment.path) if self.run else ""

    @property
    def has_unsaved(self) -> bool:
        """Whether it has ticks that stand in no file."""
        return self.unsaved_ticks > 0

    @property
    def unsaved_ticks(self) -> int:
        """How many of its ticks stand in no file."""
        return sum(map(unsaved_of, self.stretches))

    @property
    def unsaved_before(self) -> int:
        """How many ticks of the stretches before the present one stand in no file."""
        return sum(map(unsaved_of, self.cut_off))

    def check_room(self, folder: str) -> None:
        """Raise SaveError where what is in no file yet would leave others of the disk no room, OSError."""
        # the control program loads nothing of files until it saves
        from silo.files.atomic import asked_left, check_room

        if unsaved := [*filter(is_to_be_saved, self.stretches)]:
            where, bytes_held = Path(folder), sum(run.reader.held_bytes for run in unsaved)
            check_room(where, bytes_held, most_left=asked_left(where))

    def mark_saved(self, run: Run, ticks: int) -> None:
        """Remember that the first `ticks` of a run stand in files, unless it is none of those that are there."""
        if run in self.stretches and (ticks > run.saved_ticks or run.unmarked):
            run.saved_ticks, run.unmarked = ticks, False
            run.segment.mark_saved(ticks)

    def leave(self) -> bool:
        """Have what is in no file be another process's, that is told to save it; whether there is any."""
        if self.has_unsaved:
            for run in self.stretches:
                run.leave()
        return self.is_left

    @property
    def is_left(self) -> bool:
        """Whether another process has still to save what it holds."""
        return any(run.is_left for run in self.stretches)

    def _save(self, options: LoggerOptions, conditions: Conditions) -> None:
        """Save in this process: the link thread, which an answer of the helper comes by, may wait for the caller."""
        paths = []
        for run in filter(is_to_be_saved, self.stretches):
            ticks, held = run.segment.ticks, run.reader.snapshot()
            saved = save_run(held, run.id, options, "saved before the next start", conditions)
            paths += [file.path for file in saved]
            self.mark_saved(run, ticks)
        self.saved_before = f"the last run was saved before it is cleared: {', '.join(paths)}"
        log.warning("%s: %s", options.name, self.saved_before)

    def tell_of_drop(self, ticks: int, name: str) -> None:
        """Say once that a start dropped unsaved ticks: a program that learns from run to run has many."""
        if ticks and not self.saved_before and not self._told_of_drop:
            self._told_of_drop = True
            log.warning(
                "%s: this start dropped %s of the last run that were not saved (what was recorded or captured stays): "
                'save() before it, or start(unsaved="save"), keeps them (said once)',
                name,
                many(ticks, "tick"),
            )

    def settle(self, unsaved: str, options: LoggerOptions, conditions: Conditions) -> int:
        """Do with unsaved data what `start(unsaved=...)` was told; return how many ticks the start drops.

        Raises UnsavedError, or SaveError: nothing was changed.
        """
        if unsaved not in ("clear", "save", "refuse"):
            raise StateError(f"unsaved must be 'clear', 'save' or 'refuse', got {unsaved!r}; nothing was changed")
        self.saved_before = ""
        if unsaved == "clear" or not self.has_unsaved:
            return self.unsaved_ticks
        if unsaved == "save":
            self._save(options, conditions)
            return 0
        assert self.run is not None
        held = segment_holdings(self.run.reader).text
        held += f", and {many(self.unsaved_before, 'tick')} before that" if self.unsaved_before else ""
        raise UnsavedError(
            f"logger '{options.name}' holds {held}, and what is new of it is in no file; a start clears it: save it "
            "first, or say what is to become of it (the program by unsaved='save' or 'clear', a client by 'save' or "
            "'discard', in the shell --save or --discard); nothing was changed"
        )


def check_cut(present: CurrentRun, run: Run, table: Sequence[ElementInfo], *, exciting: bool) -> None:
    """Raise StateError where a run can't be cut now, with the way out."""
    enabled = sum(info.options.enabled for info in table)
    if enabled > MOST_ELEMENTS:
        why = (
            f"{enabled} elements are too many for a cut ({MOST_ELEMENTS} at most), which would make ticks late: "
            "stop, change, start"
        )
    elif exciting:
        why = "a parameter is being excited, which a cut would end: wait for its end, or stop it"
    elif not run.segment.ticks:
        why = "it had no tick yet, or none since its last cut: collect() comes first; change all at once"
    elif len(present.cut_off) >= MOST_CUT_OFF:
        why = f"{MOST_CUT_OFF} stretches before this one wait to be saved: save() first"
    else:
        return
    raise StateError(f"can't cut: {why}; nothing was changed")


def unsaved_of(run: Run) -> int:
    """How many ticks of a run stand in no file."""
    return max(0, run.segment.ticks - run.saved_ticks)


def is_to_be_saved(run: Run) -> bool:
    """Whether ticks of a run stand in no file, or in one alone that doesn't tell that others go on it."""
    return bool(unsaved_of(run)) or run.unmarked


def _lost(run: Run) -> Counter[str]:
    """How many samples of each element of a run could not be kept, if any."""
    if not run.segment.lost_rows or not run.segment.size_bytes:
        return Counter()
    reader = run.reader
    return Counter({element.info.name: reader.ring_lost(element.ring) for element in reader.schema.elements})


class _Within:
    """That a thread prepares a stretch: as long as this is there, whatever interrupts it."""


class _Unhurried:
    """Lets loops' threads have the interpreter at once, and no collection of garbage hold them up, while within.

    It is the process's: of several that are within at once the first changes it, and the last puts it back.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._within: dict[int, weakref.ref[_Within]] = {}
        self._before: tuple[float, bool] | None = None  # how it was

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        mine = _Within()
        key = id(mine)
        try:
            with self._lock:
                # where an interrupt comes amid what ends it, it is ended as this goes
                self._within[key] = weakref.ref(mine, lambda _: self._over(key))
                if self._before is None:
                    self._before = (sys.getswitchinterval(), gc.isenabled())
                    sys.setswitchinterval(min(self._before[0], SWITCH_S))
                    gc.disable()
            yield
        finally:
            try:
                self._over(key)
            finally:
                del mine  # which the traceback of an interrupt would keep

    def _over(self, key: int) -> None:
        with self._lock:
            if self._within.keys() <= {key}:
                self._put_back()
            self._within.pop(key, None)  # last: interrupted before that it is done once more

    def forget(self) -> None:
        """Nobody is within, in a forked child; its parent's threads may have been."""
        self._lock, self._within = threading.RLock(), {}
        self._put_back()

    def _put_back(self) -> None:
        if self._before is not None:
            interval_s, collects = self._before
            sys.setswitchinterval(interval_s)
            if collects:
                gc.enable()
            self._before = None  # last, likewise


_unhurried = _Unhurried()
