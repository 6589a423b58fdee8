"""The run that a logger has: how the next one takes its place, and how much of it stands in files.

A run that holds unsaved data is let go of only by a decision: the program's (`clear`), or after it was saved.
"""

import contextlib
import logging
import time
from collections.abc import Callable
from pathlib import Path

from silo.core.elements import Conditions, LoggerOptions, Storage
from silo.errors import NoRoomError, StateError, UnsavedError
from silo.journal.holdings import segment_holdings
from silo.logger.unclosed import save_run
from silo.loop.run import Run
from silo.segment.held_runs import bytes_of, trim

log = logging.getLogger("silo")

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
        self._held: list[Path] = []  # runs before this one that somebody still has to read
        self.saved_before = ""  # where the run before this one was saved, if that was done at the start of this one
        self._lost_at_end: dict[str, int] = {}
        self._gone = self._gone_first = 0  # of those, since each start does so, and at the first of these

    def replace(
        self,
        make: Callable[[], Run],
        options: LoggerOptions,
        extras: Conditions,
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
        self._let_go_of_others(wanted)  # that an interrupt left
        try:
            made = self._begin(make)
        except NoRoomError as error:
            made = self._made_room(error, make, options, extras, let_go, wanted)
        self._begun, self.run = self.runs, made
        hand_over()
        self._let_go_of_others(wanted)
        self._trim(in_memory=in_memory, room_bytes=made.segment.size_bytes)
        return made

    @property
    def runs(self) -> int:
        """How many runs began."""
        return max(self._begun, self.run.number if self.run is not None else 0)

    def _begin(self, make: Callable[[], Run]) -> Run:
        made = make()
        self._own.append(made)
        try:
            made.begin()
        except BaseException:
            self._let_go(made)
            raise
        return made

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
        extras: Conditions,
        let_go: Callable[[bool], None],
        wanted: Callable[[Run], bool],
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
            self._save(options, extras)
        let_go(False)
        self._lost_at_end, self._begun = self.lost, self.runs
        self.run = None
        self._let_go_of_others(wanted)
        self._trim(in_memory=in_memory, room_bytes=error.needed_bytes)
        return self._patiently(make)

    def _let_go_of_others(self, wanted: Callable[[Run], bool]) -> None:
        for run in [run for run in self._own if run is not self.run]:
            self._let_go(run, held=wanted(run))

    def _let_go(self, run: Run, *, held: bool = False) -> None:
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

    def drop(self, wanted: Callable[[Run], bool]) -> bool:
        """Free the memory of all runs; the counts of the last one stay, and the files of those that are `wanted`.

        Returns whether the last one is.
        """
        self._let_go_of_others(wanted)
        self._tell_gone(0)
        if self.run is None or self.run not in self._own:
            return False
        self._lost_at_end = self.lost
        held = wanted(self.run)
        self._let_go(self.run, held=held)
        return held

    def forget(self) -> None:
        """Have no run, in a forked child: those of its parent stay as they are."""
        if self.run is not None:
            self.run.forget()
        vars(self).update(vars(CurrentRun()))

    @property
    def ticks(self) -> int:
        """Ticks logged since the last start."""
        return self.run.segment.ticks if self.run else 0

    @property
    def lost(self) -> dict[str, int]:
        """How many samples of each element could not be kept since the last start, also of a run that was dropped."""
        if self.run is None or not self.run.segment.lost_rows:
            return {}
        if not self.run.segment.size_bytes:
            return self._lost_at_end
        reader = self.run.reader
        return {element.info.name: reader.ring_lost(element.ring) for element in reader.schema.elements}

    @property
    def failures(self) -> dict[str, int]:
        """At how many ticks each element could not be read since the last start."""
        return self.run.segment.failures if self.run else {}

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
        return max(0, self.ticks - (self.run.saved_ticks if self.run else 0))

    def mark_saved(self, run: Run, ticks: int) -> None:
        """Remember that the first `ticks` of a run stand in files, unless it is the present one no more."""
        if run is self.run and ticks > run.saved_ticks:
            run.saved_ticks = ticks
            run.segment.mark_saved(ticks)

    def _save(self, options: LoggerOptions, extras: Conditions) -> None:
        """Save in this process: the link thread, which an answer of the helper comes by, may wait for the caller."""
        assert self.run is not None
        run, ticks = self.run, self.run.segment.ticks
        why, held = "saved before the next start", run.reader.snapshot()
        paths = ", ".join(file.path for file in save_run(held, run.id, options, why, extras))
        self.mark_saved(run, ticks)
        self.saved_before = f"the last run was saved before it is cleared: {paths}"
        log.warning("%s: %s", options.name, self.saved_before)

    def settle(self, unsaved: str, options: LoggerOptions, extras: Conditions) -> None:
        """Do with unsaved data what `start(unsaved=...)` was told.

        Raises UnsavedError, or SaveError: nothing was changed.
        """
        if unsaved not in ("clear", "save", "refuse"):
            raise StateError(f"unsaved must be 'clear', 'save' or 'refuse', got {unsaved!r}; nothing was changed")
        self.saved_before = ""
        if not self.has_unsaved or unsaved == "clear":
            return
        if unsaved == "save":
            self._save(options, extras)
            return
        assert self.run is not None
        held = segment_holdings(self.run.reader).text
        raise UnsavedError(
            f"logger '{options.name}' holds {held}, and what is new of it is in no file; a start clears it: save it "
            "first, or say what is to become of it (save or discard); nothing was changed"
        )
