"""The runs that recorders and the judge may still have to read: kept open here until none of them needs them any more.

A run comes by the link before its first tick, or, where no helper process was there to take it, is found in the runtime
folder, where its program left it (`silo.segment.held_runs`). It goes when it is not the present one and nobody needs
it.
"""

import contextlib
import os
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

from silo.core.conditions import Conditions
from silo.core.runtime import HELD_SUFFIX, closing_file, is_at, list_held, runtime_dir
from silo.errors import SegmentError, lacks_descriptors
from silo.rpc.published import EventKind
from silo.segment.held_runs import bound_of, bytes_of, held_name, held_runs, number_of, remove
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier
from silo.state.replica import HeldNow, Replica


class HeldRuns:
    """The main thread changes what there is; any thread may ask."""

    def __init__(self, replica: Replica, changed: Callable[[], None]) -> None:
        """`changed` is called, by any thread, when a consumer needs a run no more: then `release` is due."""
        self._replica, self.changed = replica, changed
        self._lock = threading.Lock()
        self._runs: dict[str, SegmentReader] = {}  # by their ids, oldest first
        self._conditions: dict[str, Conditions] = {}  # derived signals, limits and triggers that each had last
        self._known: set[str] = set()  # all that there ever were
        self._numbers: dict[str, int] = {}  # of these, by which they follow one another
        self._looked: set[Path] = set()
        self._told: set[str] = set()  # of which is known that they began
        self._needs: list[Callable[[str], bool]] = []
        # a consumer is asked, by the main thread, whether it needs the run of an id any more
        self.add = self._needs.append

    # ------------------------------------------------------------------------------------------ by the main thread

    def take(self) -> None:
        """Keep the run that the replica has just taken over."""
        with contextlib.suppress(SegmentError):
            reader = self._replica.open_reader()
            if reader is not None and reader.schema.run not in self._known:
                self._add(reader)
        self.note_conditions()

    def note_conditions(self) -> None:
        """Remember what the present run is watched for."""
        robot = self._replica.now.robot
        if self._replica.run and robot.segment == self._replica.segment:
            self._conditions[self._replica.run] = robot.conditions

    def find(self) -> list[str]:
        """Return the ids of runs of this logger that no helper process took over, oldest first; they are kept, too."""
        with contextlib.suppress(SegmentError):  # no runtime folder: then there is nothing in it either
            if all(path in self._looked for path in list_held()):
                return []
            options = self._replica.now.options
            found = []
            for reader in held_runs(options.name, options.id):
                self._looked.add(reader.path)
                if reader.schema.run in self._runs:
                    reader.close()
                elif reader.schema.run in self._known:
                    remove(reader.path)  # nobody needed it any more when it got this name
                    reader.close()
                else:
                    self._add(reader)
                    found.append(reader.schema.run)
            return found
        return []

    def tell_starts(self, events: EventNotifier, *, at_end: bool = False) -> None:
        """Tell of runs that began and were followed by another one, or `at_end`, before their program could say so.

        And how they ended, with their last tick: a restart may be told in one.
        """
        for run in [run for run in self.ids() if (at_end or run != self._replica.run) and run not in self._told]:
            try:
                reader = self.open(run)
            except SegmentError as error:
                if not lacks_descriptors(error):
                    self._told.add(run)  # nobody will ever read it
                continue
            self._told.add(run)
            if reader is not None:
                with contextlib.closing(reader):
                    tell_start(reader, events)
                    if (at_end or run != self._replica.run) and not reader.is_cut:
                        tell_end(reader, events)

    def _add(self, reader: SegmentReader) -> None:
        self._known.add(reader.schema.run)
        with self._lock:
            self._numbers[reader.schema.run] = number_of(reader.path)
            runs = {**self._runs, reader.schema.run: reader}
            self._runs = dict(sorted(runs.items(), key=lambda run: self._numbers[run[0]]))

    def release(self, *, at_end: bool = False) -> None:
        """Let go of the runs that nobody needs: their memory is free with that. `at_end`: of the present one, too."""
        for run, reader in list(self._runs.items()):
            if run == self._replica.run and not at_end:
                continue
            if any(needs(run) for needs in self._needs):
                self._follow_name(run, reader)
            else:
                self._forget(run)
                self._looked.discard(_held(reader))
                remove(_held(reader))
        self._count()

    def _follow_name(self, run: str, reader: SegmentReader) -> None:
        """Let go of rows that had to make room: the file of that name is another one now, and has none."""
        held = _held(reader)
        with contextlib.suppress(SegmentError, OSError):
            if held.exists() and not is_at(reader.fileno(), held):
                stub = SegmentReader(held)
                with self._lock:
                    self._runs[run] = stub
                reader.close()

    def let_go(self, *, held_alone: bool) -> None:
        """Free the memory of all, as far as it depends on this process: the robot program needs it for the next run."""
        for run, reader in list(self._runs.items()):
            if run != self._replica.run or not held_alone:
                self._forget(run)
                # what its program leaves of it under the other name is found anew
                self._known.discard(run)
                self._looked.discard(_held(reader))

    def _forget(self, run: str) -> None:
        with self._lock:
            reader = self._runs.pop(run)
        self._conditions.pop(run, None)
        reader.close()

    def _count(self) -> None:
        """Tell the status what is held, of which the present run is none."""
        paths = [_held(reader) for run, reader in self._runs.items() if run != self._replica.run]
        with contextlib.suppress(SegmentError):
            bound = bound_of(paths[0].parent if paths else runtime_dir())
            self._replica.held = HeldNow(len(paths), sum(map(bytes_of, paths)), *bound)

    # --------------------------------------------------------------------------------------------- by any thread

    def ids(self) -> list[str]:
        """Return the ids of all runs that are there, oldest first, the present one last."""
        with self._lock:
            return list(self._runs)

    def size_bytes(self, runs: Iterable[str]) -> int:
        """Return how much memory runs take, without those of which it was needed."""
        with self._lock:
            readers = [self._runs[run] for run in runs if run in self._runs]
            return sum(512 * os.fstat(reader.fileno()).st_blocks for reader in readers)

    def since(self, run: str) -> list[str]:
        """Return the ids of the runs that are there from this one on, which need not be there any more."""
        with self._lock:
            number = self._numbers.get(run)
            return [one for one in self._runs if number is not None and self._numbers[one] >= number]

    def between(self, run: str, present: SegmentReader) -> SegmentReader:
        """Return a reader of the run behind this one: with many short ones that is not the present one yet."""
        following = next((one for one in self.since(run) if one not in (run, present.schema.run)), "")
        with contextlib.suppress(SegmentError):
            return (self.open(following) if following else None) or present
        return present

    def conditions(self, run: str) -> Conditions | None:
        """Return what a run was watched for last, None where no helper process knew it."""
        return self._conditions.get(run)

    def open(self, run: str) -> SegmentReader | None:
        """Return a reader of a run for the calling thread alone; None where its memory was needed.

        Raises SegmentError for one that is damaged.
        """
        with self._lock:
            known = self._runs.get(run)
            if known is None:
                return None
            path, descriptor = known.path, known.descriptor()
        with closing_file(descriptor):
            return SegmentReader(path, descriptor)


def tell_left(reader: SegmentReader, events: EventNotifier) -> None:
    """Tell what nobody told of a run that began, or ended too, while there was no helper process."""
    tell_start(reader, events)
    tell_end(reader, events)


def tell_end(reader: SegmentReader, events: EventNotifier) -> None:
    """Tell that a run was stopped, if it was and nobody told."""
    run = reader.schema.run
    if not reader.running and not events.log.texts(EventKind.STOPPED.value, run):
        text = reader.stop_reason or "stopped"
        events.publish(EventKind.STOPPED, text, tick=reader.ticks - 1, stamp_ns=reader.last_time_ns, run=run)


def tell_start(reader: SegmentReader, events: EventNotifier) -> None:
    """Tell that a run was started, if nobody did."""
    run, begun_ns, text = reader.schema.run, reader.schema.started_ns, reader.schema.start_text
    if not events.log.texts(EventKind.STARTED.value, run):
        events.publish(EventKind.STARTED, text, tick=0, stamp_ns=reader.stamp_of(0), run=run, time_ns=begun_ns)
    tell_cut(reader, events)


def tell_cut(reader: SegmentReader, events: EventNotifier) -> None:
    """Tell that a run goes on another one, if it does and nobody told: what changed, and who asked for it."""
    run, begun_ns, cut = reader.schema.run, reader.schema.started_ns, reader.schema.cut
    if cut is not None and not events.log.texts(EventKind.CUT.value, run):
        stamp_ns = reader.stamp_of(0)
        events.publish(EventKind.CUT, cut.text, by=cut.who, tick=0, stamp_ns=stamp_ns, run=run, time_ns=begun_ns)


def _held(reader: SegmentReader) -> Path:
    """The name that the file of a run has while it is held."""
    return reader.path if reader.path.suffix == HELD_SUFFIX else held_name(reader.path)
