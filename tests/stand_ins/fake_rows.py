"""What a made-up logger gives of its buffers: views, pins, samples, histories, statistics."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from silo.core.arrays.columns import ColumnGrid, HistoryColumns, bins_of
from silo.core.elements import BufferType, ElementInfo, Sought
from silo.expressions.search import Finder, FoundMoments, Looking
from silo.expressions.span import Between, between
from silo.history.arrays import SampleArrays
from silo.history.requests import PinOpened
from silo.live.quantities import QUANTITIES
from silo.live.requests import Survey
from silo.rpc.frames import Frame
from silo.rpc.published import NotLive
from silo.rpc.refusals import RefusedWhy
from tests.stand_ins.fake_signals import HZ, held_ticks, refused, signal


class FakeView:
    def __init__(self, client: Any, values: Sequence[str], plots: Sequence[str], column_ns: int) -> None:
        self.client, self.values, self.plots, self.column_ns = client, tuple(values), tuple(plots), column_ns
        self.seen_ns = -1
        self.seen_revision = -1
        self.from_ns = client.now_ns
        self.closed = False

    def frame(self) -> Frame | None:
        client = self.client
        unchanged = client.now_ns == self.seen_ns and client.revision == self.seen_revision
        if unchanged or not client.connected or self.closed:
            return None
        self.seen_revision = client.revision
        begin = max(self.from_ns, self.seen_ns)
        since_ns = begin if self.seen_ns < 0 else 0
        self.seen_ns = client.now_ns
        known = {info.name: info for info in client.infos}
        infos = [known[name] for name in self.values if name in known]
        unpublished = {info.name for info in infos if not info.options.enabled}
        newest, texts = [], {}
        for info in infos:
            for entry in info.entries:
                value = float(signal(info.name + entry.suffix, np.array([client.seconds]))[0])
                if entry.dtype.startswith("|S"):
                    texts[len(newest)] = "hans"
                newest.append(np.nan if info.name in unpublished or client.ticks == 0 else value)
        column = client.history(self.plots, begin, client.now_ns, self.column_ns)
        held = [held_ticks(client.recorded(name), client.ticks) if name in known else 0 for name in self.values]
        return Frame(
            elements=self.values, entries=tuple(info.name + entry.suffix for info in infos for entry in info.entries),
            plots=self.plots, unpublished=frozenset(unpublished),
            missing=frozenset(name for name in self.values if name not in known), time_ns=client.now_ns,
            tick=client.ticks, state=client.state, measured_hz=client.measured_hz, lost_total=client.lost,
            held=np.array(held, np.int64), lost=np.zeros(len(held), np.int64), newest=np.array(newest, float),
            texts=texts, column_ns=self.column_ns, first=column.first, low=column.low, high=column.high,
            marks=None, bases={}, since_ns=since_ns, sizes=client.other_sizes(self.values), missed=0,
            not_live={place: NotLive.FULL for place, name in enumerate(self.values) if client.is_full(name)},
        )  # fmt: skip

    def close(self) -> None:
        self.closed = True


NOTHING = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))


class FakePin:
    """What was held when it was pinned."""

    refused = ""

    def __init__(self, client: Any, held: dict[str, SampleArrays]) -> None:
        self.client, self.held, self.id = client, held, f"pin-{len(client.pins)}"
        self.names = tuple(held)
        stamps = np.concatenate([some.time_ns for some in held.values()] or [NOTHING[0]])
        begin, end = (int(stamps.min()), int(stamps.max())) if len(stamps) else (0, 0)
        size = sum(8 * (2 + some.values[:1].size) * len(some) for some in held.values())
        missing = {name: some.why for name, some in held.items() if some.why}
        self.opened = PinOpened(self.id, f"run-{client.started_ns}" if len(stamps) else "", begin, end, size, missing,
            oldest_ns=client.oldest_ns(self.names))  # fmt: skip

    def close(self) -> None:
        if self in self.client.pins:
            self.client.pins.remove(self)


class FakeRows:
    """Rows of the buffers, and what is computed of them."""

    def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> FakePin:
        self._ask()
        held = FakePin(self, self._some(names, start_ns, end_ns + 1, "time", None))
        self.pins.append(held)
        return held

    def samples(
        self, names: Sequence[str], start: int = -(2**62), end: int = 2**62, by: str = "time",
        pin: FakePin | None = None, reply_bytes: int = 2**20, told: Callable[[float], None] | None = None,
    ) -> dict[str, SampleArrays]:  # fmt: skip
        self._ask()
        shapes = {info.name: info.shape for info in self.infos}
        found = {
            name: replace(one, values=one.values.reshape(-1, *shapes.get(name, one.values.shape[1:])))
            for name, one in self._some(names, start, end, by, pin).items()
        }
        if told is not None:
            told(1.0)
        return found

    def _some(
        self, names: Sequence[str], start: int, end: int, by: str, pin: FakePin | None
    ) -> dict[str, SampleArrays]:
        found = {}
        for name in names:
            whole = self._held_samples(name) if pin is None else self._of_pin(pin, name)
            key = {"time": whole.time_ns, "tick": whole.ticks, "row": whole.ticks // max(1, whole.divider)}[by]
            some = (key >= start) & (key < end)
            found[name] = SampleArrays(
                whole.ticks[some], whole.time_ns[some], whole.values[some], whole.divider, why=whole.why
            )
        return found

    def find(
        self, names: Sequence[str], what: Sought, level: float = 0.0, direction: int = 0,
        bounds: Sequence[tuple[float | None, float | None]] = (), start_ns: int = -(2**62), end_ns: int = 2**62,
        around_ns: int = 0, most: int = 100, pins: Sequence[FakePin] = (), run: str = "",
    ) -> dict[str, FoundMoments]:  # fmt: skip
        self._ask()
        found = {}
        for place, name in enumerate(names):
            held = self._held_samples(name)
            stamps, values = self._all_of(name, pins, run)
            wanted = (stamps >= start_ns) & (stamps <= end_ns)
            limits = bounds[place] if bounds else (None, None)
            looking = Looking(Sought(what), level, direction, limits, round(1e9 * max(1, held.divider) / HZ))
            finder = Finder(looking, around_ns, most)
            finder.measure(values[wanted])
            finder.feed(stamps[wanted], values[wanted])
            found[name] = finder.found
        self.calls.append(("find", tuple(names), Sought(what).value))
        return found

    def _measure(
        self, names: Sequence[str], a_ns: int, b_ns: int, pins: Sequence[FakePin] = (), run: str = ""
    ) -> dict[str, Between]:
        self._ask()
        self.calls.append(("measure", tuple(names)))
        return {name: between(*self._all_of(name, pins, run), a_ns, b_ns) for name in names}

    def _all_of(self, name: str, pins: Sequence[FakePin], run: str) -> tuple[np.ndarray, np.ndarray]:
        """Every sample of an entry in pins and buffers, once."""
        parts = [self._of_pin(pin, name) for pin in pins]
        if not run or run == f"run-{self.started_ns}":
            parts.append(self._held_samples(name))
        stamps, at = np.unique(np.concatenate([some.time_ns for some in parts]), return_index=True)
        return stamps, np.concatenate([some.values for some in parts])[at]

    def _of_pin(self, pin: FakePin, name: str) -> SampleArrays:
        if pin not in self.pins:
            raise refused(RefusedWhy.NOT_FOUND, f"the pin '{pin.id}' is no more: pin again")
        return pin.held.get(name, SampleArrays(*NOTHING, why="it is not in this pin"))

    def _held_samples(self, name: str) -> SampleArrays:
        """All samples of an element or entry that its buffer holds."""
        places = {info.name: (info, info.entries) for info in self.infos}
        for info in self.infos:
            for entry in info.entries:
                places.setdefault(info.name + entry.suffix, (info, (entry,)))
        if name not in places:
            raise refused(RefusedWhy.NOT_FOUND, f"no element or entry is called '{name}'")
        info, entries = places[name]
        options = self.recorded(info.name)
        if not options.enabled or not self.started_ns:
            return SampleArrays(*NOTHING, why="nothing was logged yet" if options.enabled else "it is off")
        ticks = np.arange(0, self.ticks, options.divider)
        if options.buffer is BufferType.LOOPING:
            ticks = ticks[-options.size :]
        elif options.buffer is BufferType.FIXED and not options.action.publishes:
            ticks = ticks[: options.size]
        columns = [
            np.full(len(ticks), b"hans", entry.dtype)
            if entry.dtype[1:2] == "S"
            else signal(info.name + entry.suffix, ticks / HZ).astype(entry.dtype)
            for entry in entries
        ]
        values = columns[0] if len(entries) == 1 else np.stack(columns, axis=1)
        time_ns = self.started_ns + np.round(ticks / HZ * 1e9).astype(np.int64)
        return SampleArrays(ticks, time_ns, values, options.divider)

    def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, pin: FakePin | None = None
    ) -> HistoryColumns:
        self._ask()
        if pin is not None:
            return self._pinned_columns(pin, names, start_ns, end_ns, column_ns)
        start_ns = max(start_ns, self.started_ns or end_ns)
        first, last = start_ns // column_ns, end_ns // column_ns
        count = max(0, last - first + 1) if self.started_ns else 0
        low, high = np.full((len(names), count), np.nan), np.full((len(names), count), np.nan)
        for position, name in enumerate(names):
            element = next((info for info in self.infos if name.startswith(info.name)), None)
            if element is None or not element.options.enabled:
                continue
            ticks = np.arange(math.ceil((start_ns - self.started_ns) / 1e9 * HZ), self.ticks + 1)
            columns = (self.started_ns + np.round(ticks / HZ * 1e9).astype(np.int64)) // column_ns - first
            good = (columns >= 0) & (columns < count)
            values = signal(name, ticks / HZ)[good]
            np.fmin.at(low[position], columns[good], values)
            np.fmax.at(high[position], columns[good], values)
        return HistoryColumns(tuple(names), int(first), column_ns, low, high, until_ns=self.now_ns)

    def _pinned_columns(
        self, pin: FakePin, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int
    ) -> HistoryColumns:
        first = start_ns // column_ns
        grid = ColumnGrid(len(names), first, -(-end_ns // column_ns) - first)
        for row, name in enumerate(names):
            some = self._of_pin(pin, name)
            grid.add(row, bins_of(some.time_ns, column_ns), some.values)
        bases = dict(enumerate(grid.bases))
        return HistoryColumns(tuple(names), first, column_ns, grid.low, grid.high, grid.marks, bases, pin.opened.end_ns)

    def _survey(
        self,
        quantities: Sequence[str],
        names: Sequence[str] = (),
        *,
        reset: bool = False,
        derived: bool = False,
        some: Sequence[str] = (),
        some_quantities: Sequence[str] = (),
    ) -> Survey:
        self._ask()
        unknown = [quantity for quantity in [*quantities, *some_quantities] if quantity not in QUANTITIES]
        if unknown:
            raise refused(RefusedWhy.INVALID, f"no survey: {unknown[0]!r} is no quantity")
        if reset or not self.since_ns:
            self.since_ns = self.now_ns
        infos = self.infos if derived else self.elements
        known = {info.name: info for info in infos}
        entries = {info.name + entry.suffix: info for info in infos for entry in info.entries}
        found, more = (
            np.array(
                [[self._measured(each, name, known.get(name) or entries.get(name)) for name in of] for each in asked],
                np.float64,
            )
            for asked, of in ((quantities, names or list(known)), (some_quantities, some))
        )
        return Survey(self.revision, self.now_ns, self.since_ns, found.tobytes(), some=more.tobytes())

    def _measured(self, quantity: str, name: str, info: ElementInfo | None) -> float:
        if info is None or not info.options.enabled or not self.ticks:
            return math.nan
        if name in self.facts.get(quantity, {}):
            return self.facts[quantity][name]
        held = held_ticks(info.options, self.ticks)
        is_entry = name != info.name or len(info.entries) == 1
        suffixes = [name] if is_entry else [info.name + entry.suffix for entry in info.entries]
        moments = np.array([self.seconds]) if quantity == "value" else np.arange(0, max(self.seconds, 1 / HZ), 1 / HZ)
        of = {
            "signs": 0.0, "rate": HZ / info.options.divider, "share": 1.0, "jitter": 0.0002, "changed": 0.0,
            "change_seen": 1.0, "fill": held / info.options.size, "held": held, "count": float(self.ticks), "bad": 0.0,
        }  # fmt: skip
        if quantity in of:
            return of[quantity]
        if any(entry.dtype[1:2] not in "biuf" for entry in info.entries):
            return math.nan
        samples = np.array([signal(each, moments) for each in suffixes])
        if quantity in {"least", "most"}:
            return float(samples.min() if quantity == "least" else samples.max())
        norms = samples[0] if is_entry else np.sqrt(np.square(samples).sum(axis=0))
        if quantity == "noise":
            return float(np.sqrt(np.mean(np.square(np.diff(norms, 2))) / 6)) if len(norms) > 2 else math.nan
        return float({"value": np.mean, "min": np.min, "max": np.max, "mean": np.mean, "std": np.std}[quantity](norms))
