"""A thread that keeps up with a logger: its element table, and the samples of what somebody looks at.

The robot program may end and begin anew; the thread waits for it and goes on.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from silo.core.elements import ElementInfo, State
from silo.core.tuning.parameters import ParameterInfo
from silo.errors import ConnectionLostError, RefusedError, SiloError
from silo.history.arrays import SampleArrays, Stream, StreamBatch, after
from silo.rpc.published import Event, EventKind

if TYPE_CHECKING:
    from silo.client.client import Client

PERIOD_S = 0.05
TABLE_PERIOD_S = 1.0
LAST_BATCHES = 3  # of a stream that another one takes over: what was under way, and what covers its begin
MOST_PENDING = 4  # batches that were handed over and are not taken yet


@dataclass(frozen=True)
class Listener:
    """Who is told, each from the feed's thread: of elements and derived signals.

    `taken` of the samples is to be called when they were dealt with.
    """

    table: Callable[[str, Sequence[ElementInfo]], None]  # the logger's label and its elements; none: it is gone
    samples: Callable[[Mapping[str, SampleArrays], Callable[[], None]], None]
    told: Callable[[str], None]
    parameters: Callable[[Sequence[ParameterInfo]], None] = lambda _: None  # those of it, whenever one changed


class LoggerFollower:
    """Reads a logger for a bridge. Its thread begins with `start` and ends with `close`.

    `missed` counts samples that were overwritten or dropped before the bridge had them.
    """

    def __init__(self, connect: "Callable[[], Client]", listener: Listener) -> None:
        self._connect = connect
        self._listener = listener
        self._wished: frozenset[str] = frozenset()
        self._ended = threading.Event()
        self._changed = threading.Event()
        self._pending = threading.Semaphore(MOST_PENDING)
        self._stream: Stream | None = None
        self._streamed: frozenset[str] = frozenset()
        self._refused = ""  # why there is no stream of what is wished for
        self._outdated = False  # the stream may name elements that are off now
        self._seen_run = ""  # the newest one, of which `_last_tick` is, by element
        self._last_tick: dict[str, int] = {}
        self._table: Sequence[ElementInfo] | None = None
        self._parameters: Sequence[ParameterInfo] = ()
        self._parameters_due_s = math.inf  # of `time.monotonic`
        self.missed = 0
        self._thread = threading.Thread(target=self._run, name="feed", daemon=True)
        self.start = self._thread.start

    def close(self) -> None:
        """End it; waits until it has let go of the logger."""
        self._ended.set()
        self._changed.set()
        self._thread.join()

    def wish(self, names: frozenset[str]) -> None:
        """Have the samples of these elements from now on, and no others."""
        self._wished = names
        self._changed.set()

    # ---------------------------------------------------------------------------------------------------- the thread

    def _run(self) -> None:
        said = ""
        while not self._ended.is_set():
            try:
                with self._connect() as client:
                    said = ""
                    self._follow(client)
            except SiloError as error:
                if str(error) != said:  # once, however often it is tried
                    said = str(error)
                    self._listener.told(said)
            finally:
                self._end_stream()
            self._announce("", ())
            self._announce_parameters(())
            self._ended.wait(TABLE_PERIOD_S)

    def _follow(self, client: "Client") -> None:
        revision = -1
        client.on_event(self._heard)
        self._parameters_due_s = 0.0
        while not self._ended.is_set():
            status = client.status()
            if status.state is State.DEAD:
                raise ConnectionLostError(status.reason or "the robot program ended")
            if status.revision != revision:
                table = client.table()
                revision = table.revision
                self._announce(client.found.label, [*table.elements, *table.derived])
                self._outdated = True
            self._read(client)

    def _announce(self, label: str, elements: Sequence[ElementInfo]) -> None:
        if self._table != elements:
            self._table = elements
            self._listener.table(label, elements)

    def _heard(self, event: Event) -> None:
        if event.kind is EventKind.PARAMETER:
            self._parameters_due_s = 0.0
            self._changed.set()

    def _look_at_parameters(self, client: "Client") -> None:
        """Read them where one changed, and again while one moves: a ramp has an event at its begin alone."""
        if time.monotonic() < self._parameters_due_s:
            return
        self._parameters_due_s = math.inf
        try:
            moved = self._announce_parameters(client.parameters.described())
        except RefusedError:  # a robot that has none yet, or is busy: with its next event
            return
        if moved:
            self._parameters_due_s = min(self._parameters_due_s, time.monotonic() + TABLE_PERIOD_S)

    def _announce_parameters(self, known: Sequence[ParameterInfo]) -> bool:
        moved = known != self._parameters
        if moved:
            self._parameters = known
            self._listener.parameters(known)
        return moved

    def _read(self, client: "Client") -> None:
        """Pass on what comes, until it is time to look at the table."""
        for number in range(max(1, round(TABLE_PERIOD_S / PERIOD_S))):
            if self._ended.is_set():
                return
            self._look_at_parameters(client)
            # what was refused is asked for again in the next round
            if (self._outdated or self._wished != self._streamed) and not (number and self._refused):
                self._change_stream(client)
            if self._stream is None:
                self._changed.wait(TABLE_PERIOD_S)
                self._changed.clear()
                return
            self._pass_on(self._stream.read(PERIOD_S))

    def _change_stream(self, client: "Client") -> None:
        wished = self._wished
        known = {element.name for element in self._table or () if element.options.enabled}
        names = sorted(wished & known)
        stream, before = None, self._refused
        try:
            stream = client.stream(names, PERIOD_S) if names else None
            self._refused = ""
        except RefusedError as error:  # for now: it is tried again, and told once; what there is goes on meanwhile
            self._refused = str(error)
            if self._refused != before:
                self._listener.told(self._refused)
            return
        if self._stream is not None:  # what was under way before the new one began
            for _ in range(LAST_BATCHES):
                self._pass_on(self._stream.read(2 * PERIOD_S))
        self._end_stream()
        self._stream, self._streamed, self._outdated = stream, wished, False

    def _end_stream(self) -> None:
        if self._stream is not None:
            self.missed += self._stream.missed
            self._stream.close()
        self._stream, self._streamed = None, frozenset()

    def _pass_on(self, batch: StreamBatch | None) -> None:
        if batch is None:
            return
        fresh = {name: self._unseen(batch.run, name, batch[name]) for name in batch}
        while not self._pending.acquire(timeout=1.0):
            if self._ended.is_set():
                return
        self._listener.samples({name: one for name, one in fresh.items() if len(one)}, self._pending.release)

    def _unseen(self, run: str, name: str, samples: SampleArrays) -> SampleArrays:
        """What of it was not passed on by the stream before."""
        if not len(samples):
            return samples
        if run != self._seen_run:
            self._seen_run, self._last_tick = run, {}
        last = self._last_tick.get(name, -1)
        self._last_tick[name] = max(last, int(samples.ticks[-1]))
        return after(samples, last)
