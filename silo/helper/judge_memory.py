"""What the judge stores for its successor, and what it finds of its predecessor's.

The state of a run is stored before anything of it is told, with what is about to be told: each event is told once, by
this process or by the next. Belongs to the judge thread.
"""

import contextlib
import logging
import time
from pathlib import Path

import msgspec

from silo.errors import SegmentError
from silo.helper.capture_list import CaptureList
from silo.helper.capture_writer import CaptureWriter
from silo.helper.events import Events
from silo.helper.judge_state import (
    JudgeState,
    KeptCapture,
    Untold,
    left_states,
    read_state,
    state_path,
    store_state,
)
from silo.helper.segment_judge import SegmentJudge, Step
from silo.ipc.published import EventKind

KEEP_S = 1.0  # how often a state is stored in which only rows are new
SHARE = 0.05  # of the time, at most, where it is large
MOST_UNTOLD = 1000  # events of which the log in the folder is not sure, as its disk hangs

log = logging.getLogger("silo.helper")


class JudgeMemory:
    """The files of one judge."""

    def __init__(self, logger: str, pid: int, events: Events, writer: CaptureWriter) -> None:
        self._logger, self._pid, self._events, self._writer = logger, pid, events, writer
        self._left: dict[str, JudgeState] = {}
        self._own: dict[str, Path] = {}
        self._damaged: set[str] = set()
        self._told: list[tuple[int, Untold]] = []  # what the event log may not have in its file yet, by its number
        self._run = ""
        self._due_s = 0.0
        self._failing = False

    # ------------------------------------------------------------------------------------------------ before us

    def look(self) -> None:
        """Read what predecessors left, and tell what they did not come to tell."""
        with contextlib.suppress(SegmentError, OSError):  # no runtime folder: then there is nothing in it either
            for path in left_states(self._logger):
                self._look_at(path)

    def _look_at(self, path: Path) -> None:
        try:
            state = read_state(path)
        except SegmentError as error:
            self._damaged.add(path.name.removeprefix(f"{self._logger}.").removesuffix(path.suffix))
            text = f"{error}; triggers and limits of its run begin anew, and know nothing of what was logged before"
            self._events.publish(EventKind.BLIND, text)
            path.unlink(missing_ok=True)
            return
        except OSError:
            return
        if state.pid != self._pid:
            return  # of a program that is gone, and its helper process with it: `silo.helper.capture_recovery`
        self._left[state.run], self._own[state.run] = state, path
        self._tell_left(state)

    def _tell_left(self, state: JudgeState) -> None:
        known = {(event.kind, event.text) for event in self._events.log.of_run(state.run)}
        for one in state.untold:
            if (one.kind, one.text) not in known:
                self._publish(one, run=state.run)

    def _tell_lost(self, state: JudgeState, why: str) -> None:
        listed = CaptureList(self._writer.folder, self._logger)
        for kept in state.captures:
            entry = None
            with contextlib.suppress(OSError):
                entry = listed.find(state.run, kept.options.name, kept.capture.number)
            if entry is None or not entry.files:
                self._events.publish(EventKind.BLIND, lost_text(kept, why))

    def was_damaged(self, run: str) -> bool:
        """Whether a predecessor left of this run what can't be read."""
        return run in self._damaged

    def numbers(self, run: str) -> dict[str, int]:
        """Return how many captures of a run there are, by trigger."""
        with contextlib.suppress(OSError):
            return CaptureList(self._writer.folder, self._logger).numbers(run)
        return {}

    def left(self, run: str) -> JudgeState | None:
        """Return what a predecessor knew of a run, once."""
        return self._left.pop(run, None)

    def forget_others(self, run: str) -> None:
        """Tell what became of runs that are over, and forget them when nothing of them waits to be written."""
        for other, state in [(name, state) for name, state in self._left.items() if name != run]:
            del self._left[other]
            self._tell_lost(state, "the helper process died before it was written, and a new run has taken its memory")
        for other in [name for name in self._own if name != run and not self._writer.waiting(name)]:
            self._own.pop(other).unlink(missing_ok=True)

    # ------------------------------------------------------------------------------------------------- after us

    def is_due(self) -> bool:
        """Whether the state should be stored though nothing happened but rows."""
        return time.monotonic() >= self._due_s

    def keep(self, judge: SegmentJudge, found: Step | None, *, closed: bool, failed: str) -> None:
        """Store the state, with what is about to be told."""
        begun_s = time.monotonic()
        run = judge.reader.schema.run
        if run != self._run:
            self._run, self._told = run, []
        written = self._events.log.written
        self._told = [(number, one) for number, one in self._told if number > written]
        whole = [*(found.whole if found else ()), *self._writer.waiting(run)]
        waiting = [KeptCapture(spool.options, spool.capture, spool.ended) for spool in whole]
        unsure = [*(one for _, one in self._told[-MOST_UNTOLD:]), *(untold(found) if found else ())]
        state = judge.state(waiting, unsure, closed=closed)
        if failed:
            state = msgspec.structs.replace(state, failed=failed)
        try:
            path = self._own.setdefault(run, state_path(self._logger, run))
            store_state(path, state)
            self._failing = False
        except (OSError, SegmentError) as error:
            if not self._failing:
                log.warning(
                    "what triggers and limits know can't be stored (%s): should this process be killed, the next one "
                    "judges anew what the buffers hold", error,
                )  # fmt: skip
            self._failing = True
        now_s = time.monotonic()
        self._due_s = now_s + max(KEEP_S, (now_s - begun_s) / SHARE)

    def tell(self, found: Step) -> None:
        """Publish what was found."""
        for one in untold(found):
            self._told.append((self._publish(one), one))

    def _publish(self, one: Untold, run: str = "") -> int:
        tick = None if one.tick < 0 else one.tick
        return self._events.publish(EventKind(one.kind), one.text, tick=tick, stamp_ns=one.stamp_ns, run=run).number

    def forget_all(self) -> None:
        """Remove the files of this judge: there will be no successor."""
        for path in self._own.values():
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        self._own = {}


def lost_text(kept: KeptCapture, why: str) -> str:
    """Say of a capture that it was lost."""
    capture = kept.capture
    return f"capture {capture.number} of '{kept.options.name}', ticks {capture.first} to {capture.last}, is lost: {why}"


def untold(found: Step) -> list[Untold]:
    """Return what a step is to tell."""
    events = [Untold(EventKind.BLIND.value, text) for text in found.blind]
    for name, fires in found.fired:
        first, last = fires[0], fires[-1]
        text = f"at tick {first.tick}" if first is last else f"{len(fires)} times, at ticks {first.tick} to {last.tick}"
        events.append(Untold(EventKind.TRIGGERED.value, f"trigger '{name}' fired {text}", first.tick, first.time_ns))
    for news in found.limits:
        kind = EventKind.LIMIT if news.over else EventKind.LIMIT_ENDED
        events.append(Untold(kind.value, news.text, news.tick, news.stamp_ns))
    return events
