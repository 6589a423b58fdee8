"""What the judge stores for its successor, and what it finds of its predecessor's.

The state of a run is stored before anything of it is told, with what is about to be told: each event is told once, by
this process or by the next. Belongs to the judge thread.
"""

import contextlib
import logging
import time
from collections.abc import Callable, Sequence, Set
from pathlib import Path

import msgspec

from silo.conditions import state_file
from silo.conditions.captures.writer import CaptureWriter
from silo.conditions.segment_judge import JudgedStep, SegmentJudge
from silo.conditions.state_file import JudgeState, KeptCapture, Untold
from silo.errors import SegmentError
from silo.files.manifest import CaptureList
from silo.rpc.published import EventKind
from silo.segment.held_runs import all_runs, judge_path
from silo.state.events import EventNotifier

KEEP_S = 1.0  # how often a state is stored in which only rows are new
SHARE = 0.05  # of the time, at most, where it is large
LOOK_S = 1.0  # how often is looked whether the memory of a run is there that nobody has brought yet
GONE = "the helper process died before it came to that, and its run's memory is gone"
MOST_UNTOLD = 1000  # events of which the log in the folder is not sure, as its disk hangs

log = logging.getLogger("silo.helper")


class JudgeMemory:
    """The files of one judge."""

    def __init__(self, logger: str, logger_id: str, pid: int, events: EventNotifier, writer: CaptureWriter) -> None:
        self._logger, self._id, self._pid, self._events, self._writer = logger, logger_id, pid, events, writer
        self._left: dict[str, JudgeState] = {}
        self._own: dict[str, Path] = {}
        self.damaged: set[str] = set()  # runs of which a predecessor left what can't be read
        self._told: dict[str, list[tuple[int, Untold]]] = {}  # what the event log may not have in its file, by run
        self._before: dict[str, set[tuple[str, str]]] = {}  # what was told of a run before it was begun with, or anew
        self._due_s = 0.0
        self._failing = False
        self._look_due_s = 0.0

    # ------------------------------------------------------------------------------------------------ before us

    def look(self) -> None:
        """Read what predecessors left, and tell what they did not come to tell."""
        with contextlib.suppress(SegmentError, OSError):  # no runtime folder: then there is nothing in it either
            for path in state_file.all_states(self._logger):
                self._look_at(path)

    def _look_at(self, path: Path) -> None:
        try:
            if state_file.is_note(path):
                return
            state = state_file.read_state(path)
        except SegmentError as error:
            self.damaged.add(path.name.removeprefix(f"{self._logger}.").removesuffix(path.suffix))
            text = f"{error}; triggers and limits of its run begin anew, and know nothing of what was logged before"
            self._events.publish(EventKind.BLIND, text)
            path.unlink(missing_ok=True)
            return
        except OSError:
            return
        # pids come again, and count anew in each container; of an older silo there is no other word
        if state.program.logger_id != self._id if state.program.logger_id else state.pid != self._pid:
            return  # of a program that is gone, and its helper process with it: `silo.conditions.left_captures`
        self._left[state.run], self._own[state.run] = state, path
        self._tell_new(state.untold, state.run, state.until - 1)

    def _tell_new(self, news: Sequence[Untold], run: str, tick: int, stamp_ns: int = 0) -> None:
        """Tell of a run that is over what nobody told yet; what stands nowhere in it stands at its end."""
        known = {(event.kind, event.text) for event in self._events.log.of_run(run)}
        for one in news:
            if (one.kind, one.text) not in known:
                at = one if one.tick >= 0 else msgspec.structs.replace(one, tick=tick, stamp_ns=stamp_ns)
                self._told.setdefault(run, []).append((self._publish(at, run), one))

    def numbers(self, run: str) -> dict[str, int]:
        """Return how many captures of a run there are, by trigger."""
        with contextlib.suppress(OSError):
            return CaptureList(self._writer.folder, self._logger).numbers(run)
        return {}

    def left(self, run: str) -> JudgeState | None:
        """Return what a predecessor knew of a run, once; None where it had not begun with it."""
        state = self._left.pop(run, None)
        return None if state is None or state.is_begun_only else state

    def knows(self, run: str) -> bool:
        """Whether a predecessor had begun with a run."""
        state = self._left.get(run)
        return state is not None and not state.is_begun_only

    def forget_others(self, needed: Callable[[str], bool]) -> None:
        """Forget the runs that are over, and nobody judges, when nothing of them waits to be written.

        Of those whose memory is gone it is told what was lost; of others the program has yet to leave theirs.
        """
        now_s = time.monotonic()
        left = [state for run, state in self._left.items() if not needed(run)]
        if left and now_s >= self._look_due_s:
            self._look_due_s = now_s + LOOK_S
            there = runs_there(self._logger)
            for state in left:
                if state.run not in there:
                    del self._left[state.run]
                    lost = lost_news(state, self._writer.folder, self._logger, GONE)
                    self._tell_new(lost, state.run, state.until - 1)
        for run in [run for run in self._own if not needed(run) and run not in self._left]:
            unsure = any(number > self._events.log.written for number, _ in self._told.get(run, ()))
            if not (unsure or self._writer.waiting(run)):
                self._own.pop(run).unlink(missing_ok=True)
                self._told.pop(run, None)
                self._before.pop(run, None)

    # ------------------------------------------------------------------------------------------------- after us

    def begin(self, run: str) -> None:
        """Note what was told of a run that is judged from its begin: by one that came to its end, and was killed then.

        That forgets its state first, and has its process end after that.
        """
        self._before[run] = {(event.kind, event.text) for event in self._events.log.of_run(run)}

    def is_due(self) -> bool:
        """Whether the state should be stored though nothing happened but rows."""
        return time.monotonic() >= self._due_s

    def keep(self, judge: SegmentJudge, found: JudgedStep | None, *, closed: bool, failed: str) -> None:
        """Store the state, with what is about to be told."""
        begun_s = time.monotonic()
        run = judge.reader.schema.run
        written = self._events.log.written
        told = self._told[run] = [(number, one) for number, one in self._told.get(run, []) if number > written]
        whole = [*(found.whole if found else ()), *self._writer.waiting(run)]
        waiting = [KeptCapture(buffer.options, buffer.capture, buffer.ended) for buffer in whole]
        unsure = [*(one for _, one in told[-MOST_UNTOLD:]), *(untold(found) if found else ())]
        state = judge.state(waiting, unsure, closed=closed)
        if failed:
            state = msgspec.structs.replace(state, failed=failed)
        try:
            path = self._own.setdefault(run, judge_path(self._logger, run))
            state_file.store_state(path, state)
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

    def tell(self, found: JudgedStep, judge: SegmentJudge) -> None:
        """Publish what was found."""
        run = judge.reader.schema.run
        told = self._told.setdefault(run, [])
        before = self._before.get(run, ())
        told += [(self._publish(one, run), one) for one in untold(found) if (one.kind, one.text) not in before]

    def tell_new(self, found: JudgedStep, judge: SegmentJudge) -> None:
        """Publish what was found in a run that is over, as far as nobody did before."""
        reader = judge.reader
        self._tell_new(untold(found), reader.schema.run, reader.ticks - 1, reader.last_time_ns)

    def _publish(self, one: Untold, run: str = "") -> int:
        tick = None if one.tick < 0 else one.tick
        told = self._events.publish(
            EventKind(one.kind), one.text, tick=tick, stamp_ns=one.stamp_ns, run=run, times=one.times, about=one.about
        )
        return told.number

    def forget_all(self, unwritten: Set[str]) -> None:
        """Remove the files of this judge: there will be no successor.

        What nobody came to judge, and runs with captures that are `unwritten`, stay for recovery.
        """
        self._look_due_s = 0.0
        self.forget_others(unwritten.__contains__)
        for run in [run for run in self._own if run not in self._left and run not in unwritten]:
            with contextlib.suppress(OSError):
                self._own.pop(run).unlink(missing_ok=True)


def runs_there(logger: str, folder: str = "") -> set[str]:
    """Return the runs of a logger that are in memory still, or in its folder."""
    found = set()
    with contextlib.suppress(SegmentError):  # no runtime folder: then there is nothing in it either
        for reader in all_runs(logger, folder=Path(folder) if folder else None):
            found.add(reader.schema.run)
            reader.close()
    return found


def lost_news(state: JudgeState, folder: str, logger: str, why: str) -> list[Untold]:
    """What is to be told of a run that nobody can judge any more: lost captures, and from when on it is blind."""
    listed = CaptureList(folder, logger)
    news = [
        Untold(EventKind.BLIND.value, lost_text(kept, why), about=kept.options.name)
        for kept in state.captures
        if not listed.has_files(state.run, kept.options.name, kept.capture.number)
    ]
    if not state.closed:
        text = f"triggers and limits are blind for run {state.run} from tick {state.until} on: {why}"
        news.append(Untold(EventKind.BLIND.value, text))
    return news


def lost_text(kept: KeptCapture, why: str) -> str:
    """Say of a capture that it was lost."""
    capture = kept.capture
    return f"capture {capture.number} of '{kept.options.name}', ticks {capture.first} to {capture.last}, is lost: {why}"


def untold(found: JudgedStep) -> list[Untold]:
    """Return what a step is to tell."""
    events = [Untold(EventKind.BLIND.value, text) for text in found.blind]
    events += [Untold(EventKind.BLIND.value, text, about=name) for name, text in found.left_out]
    for name, fires in found.fired:
        first, last = fires[0], fires[-1]
        times, kind = len(fires), EventKind.TRIGGERED.value
        text = f"at tick {first.tick}" if first is last else f"{times} times, at ticks {first.tick} to {last.tick}"
        events.append(Untold(kind, f"trigger '{name}' fired {text}", first.tick, first.time_ns, times, name))
    for news in found.limits:
        kind = EventKind.LIMIT if news.over else EventKind.LIMIT_ENDED
        events.append(Untold(kind.value, news.text, news.tick, news.stamp_ns, news.times))
    return events
