"""What is pinned of some signals while a picture stands still, which nothing overwrites, and the buffers it is from.

The source begins with the columns that stood on the screen. Columns of the whole span are fetched next, then raw
samples slice by slice, those that are looked at first. What has come stays, whatever becomes of link and robot, and is
all that is drawn then; `text` says how much that is.
"""

import asyncio
import math
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from silo.core.arrays.columns import (
    FLAGS,
    MAX_COLUMNS,
    Bins,
    ColumnGrid,
    ColumnStore,
    HistoryColumns,
    NonFinite,
    bins_of,
    coarser,
    grid_of,
)
from silo.errors import SiloError
from silo.expressions.search import FoundMoments, Looking
from silo.expressions.span import Between
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.samples.searching import joined
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.words import text
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo.history.arrays import Pin

REPLY_BYTES = 2**18  # on a thin link a key gets its turn after half a minute at most
SLICES = 32  # the span is fetched in so many pieces
QUICK_S = 10.0  # what isn't looked at is fetched too where all of it comes within that time


class LinkPin:
    """A pin that is open in a helper process, which may fall silent: then what is asked of it raises a SiloError."""

    def __init__(self, link: Link, pin: "Pin") -> None:
        self._link = link
        self.pin = pin
        opened = pin.opened
        self.run, self.text = opened.run, opened.text
        self.begin_ns, self.end_ns, self.oldest_ns = opened.begin_ns, opened.end_ns, opened.oldest_ns

    @property
    def refused(self) -> str:
        """Why it is no more; empty while it is."""
        return self.pin.refused

    async def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Return columns of what is pinned."""
        return await self._link.history(names, start_ns, end_ns, column_ns, self.pin)

    async def samples(self, names: Sequence[str], start_ns: int, end_ns: int) -> dict[str, Samples]:
        """Return samples of what is pinned."""
        return await self._link.samples(names, start_ns, end_ns, self.pin, REPLY_BYTES)

    def close(self) -> None:
        """Let go of it."""
        self.pin.close()


class Buffers:
    """The buffers of the logger of a session; what can't be had of them raises a SiloError."""

    def __init__(self, session: Session) -> None:
        self._session = session

    @property
    def reachable(self) -> bool:
        """Whether somebody answers."""
        return self._session.connected

    async def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> LinkPin:
        """Pin what they hold from one time to another."""
        link = self._session.connection
        pinned = asyncio.ensure_future(link.read(lambda client: client.pin(names, start_ns, end_ns)))
        try:
            return LinkPin(link, await asyncio.shield(pinned))
        except asyncio.CancelledError:
            pinned.add_done_callback(_let_go)  # whoever asked is gone, the answer still comes
            raise

    async def find(
        self, looking: Mapping[str, Looking], around_ns: int, most: int, end_ns: int, pins: Sequence[LinkPin]
    ) -> dict[str, FoundMoments]:
        """Look for moments in them and in these pins."""
        one = next(iter(looking.values()))
        return await self._session.connection.read(
            lambda client: client.find(
                list(looking), one.what, one.level, one.direction, [each.bounds for each in looking.values()],
                end_ns=end_ns, around_ns=around_ns, most=most, pins=[each.pin for each in pins],
                run=pins[0].run if pins else "",
            )
        )  # fmt: skip

    async def measure(
        self, names: Sequence[str], a_ns: int, b_ns: int, pins: Sequence[LinkPin], run: str
    ) -> dict[str, Between]:
        """Measure entries between two moments in them and in these pins."""
        held = [each.pin for each in pins]
        return await self._session.connection.read(lambda client: client._measure(names, a_ns, b_ns, held, run))


def _let_go(pinned: "asyncio.Future[Pin]") -> None:
    if not pinned.cancelled() and pinned.exception() is None:
        pinned.result().close()


class PinnedSource:
    """What one pin holds of some signals, and the picture before it came. Lives in the event loop."""

    def __init__(
        self, live: PlotSource, plots: Sequence[Plotted], start_ns: int, end_ns: int, shown: ColumnStore
    ) -> None:
        """`shown` are the columns that are on the screen."""
        self.names = tuple(dict.fromkeys(plotted.name for plotted in plots))
        self.begin_ns, self.end_ns = start_ns, max(start_ns + 1, end_ns)
        self.problem = ""  # why no more is fetched
        self._periods = {plotted.name: live.period_ns(plotted.element.name) for plotted in plots}
        self.pin: LinkPin | None = None
        self._shown = deepcopy(shown).stretch(None)
        self._coarse: HistoryColumns | None = None
        self._slice_ns = self._slice_of()
        self._slices: dict[int, dict[str, Samples]] = {}
        self._fetching = asyncio.Lock()
        self._slice_s = math.inf  # how long a slice took at last

    # -------------------------------------------------------------------------------------------- what is, and how much

    @property
    def held_s(self) -> float:
        """Seconds that are pinned."""
        return (self.end_ns - self.begin_ns) / SECOND_NS

    @property
    def held_text(self) -> str:
        """The span that is pinned, to two digits."""
        return text.span(self.held_s, 2)

    @property
    def fetched_s(self) -> float:
        """Seconds of which all samples are here."""
        ends = ((k * self._slice_ns + self.begin_ns, (k + 1) * self._slice_ns + self.begin_ns) for k in self._slices)
        return sum(max(0, min(end, self.end_ns) - begin) for begin, end in ends) / SECOND_NS

    @property
    def complete(self) -> bool:
        """Whether every sample is here."""
        return len(self._slices) >= self._count

    @property
    def text(self) -> str:
        """How much is held and how much of it is here: `41 s held, 5.0 s of it fetched`."""
        held = self.held_text
        if self.pin is None and not self.problem:
            return "pinning …"
        if self.pin is not None and self.complete:
            return f"{held} held, all fetched"
        here = "only columns fetched" if self._coarse is not None else "only the picture fetched"
        if self._slices:
            here = f"{text.span(self.fetched_s, 2)} of {held if self.problem else 'it'} fetched"
        return f"{here}, no more: {self.problem}" if self.problem else f"{held} held, {here}"

    # --------------------------------------------------------------------------------------------------- fetching

    def opened(self, pin: LinkPin, begin_ns: int, end_ns: int) -> None:
        """The logger holds this much of it, to be read from there."""
        self.pin, self.problem = pin, ""
        if not self._slices:
            self.begin_ns, self.end_ns = begin_ns, max(begin_ns + 1, end_ns)
            self._slice_ns = self._slice_of()

    def unpinned(self, problem: str) -> None:
        """Nothing of it could be pinned: the picture that stood on the screen is all that there is."""
        self.problem = problem
        if self.pin is None:
            self.begin_ns = min(self.drawn_ns, self.end_ns - 1)
            self._slice_ns = self._slice_of()

    def _slice_of(self) -> int:
        return max(1, -(-(self.end_ns - self.begin_ns + 1) // SLICES))

    def let_go(self) -> None:
        """Let go of the pin; what was fetched stays."""
        pin, self.pin = self.pin, None
        if pin is not None:
            pin.close()

    async def fetch_columns(self, column_ns: int) -> None:
        """Fetch columns of the whole span. Errors are noted in `problem`."""
        if self.pin is None:
            return
        wide = max(column_ns, -(-(self.end_ns - self.begin_ns) // (MAX_COLUMNS - 2)))
        try:
            self._coarse = await self.pin.columns(self.names, self.begin_ns, self.end_ns + 1, wide)
        except SiloError as error:
            self.problem = str(error)

    async def fetch(self, start_ns: int, end_ns: int) -> None:
        """Fetch all samples between two times, as far as they are pinned, the newest first."""
        for number in reversed(self._numbers(start_ns, end_ns)):
            await self._fetch_slice(number)

    async def fetch_rest(self) -> bool:
        """Fetch one slice that nobody looks at yet; False where there is none, or the link is too thin for that."""
        missing = [number for number in range(self._count) if number not in self._slices]
        if not missing or self.pin is None or self.problem or len(missing) * self._slice_s > QUICK_S:
            return False
        return await self._fetch_slice(missing[-1])

    @property
    def _count(self) -> int:
        return -(-(self.end_ns - self.begin_ns + 1) // self._slice_ns)

    def _numbers(self, start_ns: int, end_ns: int) -> range:
        first = max(0, (start_ns - self.begin_ns) // self._slice_ns)
        return range(first, min(self._count, (end_ns - self.begin_ns) // self._slice_ns + 1))

    async def _fetch_slice(self, number: int) -> bool:
        async with self._fetching:
            if number in self._slices or self.pin is None:
                return number in self._slices
            start_ns = self.begin_ns + number * self._slice_ns
            began_s = time.monotonic()
            try:
                found = await self.pin.samples(self.names, start_ns, start_ns + self._slice_ns)
            except SiloError as error:
                self.problem = str(error)
                return False
            self._slice_s, self.problem = time.monotonic() - began_s, ""
            self._slices[number] = found
            return True

    def has(self, start_ns: int, end_ns: int) -> bool:
        """Return whether all samples of a stretch inside of it are here."""
        return all(number in self._slices for number in self._numbers(start_ns, end_ns))

    # -------------------------------------------------------------------------------------------------- what it shows

    async def samples(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """All samples of an entry from `start_ns` to `end_ns`, both included; where they can't come, those here."""
        await self.fetch(max(start_ns, self.begin_ns), min(end_ns, self.end_ns))
        return self.held(name, start_ns, end_ns)

    def held(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """The samples of an entry from `start_ns` to `end_ns`, both included, that are here."""
        numbers = self._numbers(max(start_ns, self.begin_ns), min(end_ns, self.end_ns))
        time_ns, values = joined(
            [some[name] for number in numbers if (some := self._slices.get(number)) and name in some]
        )
        wanted = (time_ns >= start_ns) & (time_ns <= end_ns)
        return time_ns[wanted], values[wanted]

    def with_columns(self, name: str) -> tuple[Samples, int]:
        """All that is here of an entry: its samples, and for those that are not the ends of their columns.

        Returns how wide such columns are too, 0 where none was needed. What they hold is exact, when it was is not.
        """
        time_ns, values = self.held(name, self.begin_ns, self.end_ns)
        columns = self._shown if self._coarse is None else self._coarse
        if self.complete or name not in columns.names:
            return (time_ns, values), 0
        begins, ends = _ends_of(columns, columns.names.index(name))
        middles = begins - begins % columns.column_ns + columns.column_ns // 2
        inside = (middles >= self.begin_ns) & (middles <= self.end_ns)
        inside &= ~np.isin((middles - self.begin_ns) // self._slice_ns, list(self._slices))
        if not inside.any():
            return (time_ns, values), 0
        if not len(time_ns):
            return (begins[inside], ends[inside]), columns.column_ns
        stamps = np.concatenate([time_ns, begins[inside]])
        order = np.argsort(stamps, kind="stable")
        return (stamps[order], np.concatenate([values, ends[inside]])[order]), columns.column_ns

    async def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns of a stretch of time: of the samples that are here, else asked for, else of wider columns."""
        inside = max(start_ns, self.begin_ns), min(end_ns, self.end_ns)
        if not self.has(*inside) and self.pin is not None and not self.problem:
            try:
                return await self.pin.columns(names, start_ns, end_ns, column_ns)
            except SiloError as error:
                self.problem = str(error)
        return self.columns(names, start_ns, end_ns, column_ns)

    def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns from what is here."""
        stop = end_ns // column_ns + 1
        first = max(start_ns // column_ns, stop - MAX_COLUMNS)
        grid = ColumnGrid(len(names), first, stop - first)
        whole = self.has(max(start_ns, self.begin_ns), min(end_ns, self.end_ns))
        for row, name in enumerate(names):
            if not whole:
                for wide in (self._coarse, self._shown):
                    _spread(grid, row, name, wide, column_ns)
            self._lay_samples(grid, row, name, column_ns)
        return grid.columns(names, column_ns)

    def _lay_samples(self, grid: ColumnGrid, row: int, name: str, column_ns: int) -> None:
        """Lay samples over a grid; a column without one shows the value that held, until two more would be due."""
        begin_ns, end_ns = grid.first * column_ns, (grid.first + grid.count) * column_ns
        holds_ns = 2 * self._periods.get(name, 0)
        time_ns, values = self.held(name, begin_ns - holds_ns, end_ns - 1)
        if not len(time_ns):
            return
        grid.add(row, bins_of(time_ns, column_ns), values)
        if column_ns >= holds_ns:
            return
        empty = grid.first + np.flatnonzero(np.isnan(grid.low[row]) & (grid.marks[row] == 0))
        newest = np.searchsorted(time_ns, empty * column_ns, "right") - 1
        holding = (newest >= 0) & (empty * column_ns - time_ns[newest] <= holds_ns)
        if holding.any():
            columns = empty[holding].astype(np.int64)
            grid.add(row, Bins(columns, np.arange(len(columns))), values[newest[holding]])

    @cached_property
    def drawn_ns(self) -> int:
        """The oldest moment that stood on the screen; of an empty one its end."""
        shown = self._shown
        marked = np.zeros(shown.low.shape, np.bool_) if shown.marks is None else (shown.marks & FLAGS) != 0
        drawn = np.flatnonzero((np.isfinite(shown.low) | marked).any(axis=0))
        return (shown.first + int(drawn[0])) * shown.column_ns if len(drawn) else self.end_ns

    def drawn_before(self, time_ns: int) -> int:
        """That moment where it was columns before a time, else this time."""
        return self.drawn_ns if self.drawn_ns + self._shown.column_ns <= time_ns else time_ns

    def lay_drawn(self, grid: ColumnGrid, names: Sequence[str], column_ns: int) -> None:
        """Lay what stood on the screen over a grid."""
        for row, name in enumerate(names):
            _spread(grid, row, name, self._shown, column_ns)


def _ends_of(columns: HistoryColumns, row: int) -> Samples:
    """Columns as samples: both ends of each, that one first which is nearer to the column before; and nan, inf, -inf.

    They stand at the beginning of the column, its middle and behind that: inside of it.
    """
    low, high, base = columns.low[row], columns.high[row], columns.bases.get(row, 0)
    marks = np.zeros(len(low), np.uint8) if columns.marks is None else columns.marks[row]
    drawn = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    low, high = low[drawn], high[drawn]
    middle = low / 2 + high / 2
    falls = np.diff(middle, prepend=middle[:1]) < 0
    found = [
        (drawn, 0, np.where(falls, high, low)),
        (drawn[low != high], columns.column_ns // 2, np.where(falls, low, high)[low != high]),
    ]
    for mark, value in ((NonFinite.NAN, math.nan), (NonFinite.POS_INF, math.inf), (NonFinite.NEG_INF, -math.inf)):
        marked = np.flatnonzero(marks & mark)
        found.append((marked, columns.column_ns // 2 + 1, np.full(len(marked), value)))
    time_ns = np.concatenate([(columns.first + at) * columns.column_ns + later for at, later, _ in found])
    values = np.concatenate([some for _, _, some in found])
    order = np.argsort(time_ns, kind="stable")
    exact = 0 < abs(base) < 2**62 and bool(np.isfinite(values).all())
    return time_ns[order].astype(np.int64), (values.astype(np.int64) + base if exact else values + base)[order]


def _spread(grid: ColumnGrid, row: int, name: str, other: HistoryColumns | None, column_ns: int) -> None:
    """Lay columns of another width over a grid: what a wider one says holds in all that it covers."""
    if other is None or name not in other.names or not other.low.shape[1] or not grid.count:
        return
    at = other.names.index(name)
    marks = np.zeros(other.low.shape[1], np.uint8) if other.marks is None else other.marks[at]
    low, high = other.low[at], other.high[at]
    if other.column_ns <= column_ns:
        places = (other.first + np.arange(len(low))) * other.column_ns // column_ns
        first = int(places[0])
        low, high, marks = coarser(low, high, marks, np.flatnonzero(np.diff(places, prepend=first - 1)))
    else:
        first = grid.first
        places = (first + np.arange(grid.count)) * column_ns // other.column_ns - other.first
        inside = (places >= 0) & (places < len(low))
        places = np.where(inside, places, 0)
        low, high = np.where(inside, low[places], np.nan), np.where(inside, high[places], np.nan)
        marks = np.where(inside, marks[places], 0).astype(np.uint8)
    grid.lay([row], grid_of(first, low[None], high[None], marks[None], {0: other.bases.get(at, 0)}), [0])
