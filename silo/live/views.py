"""Views: what one screen of one client shows, as one batch per refresh.

`ServedView` belongs to the publisher thread. What a view holds is bounded: names, columns, rate; the rest of a batch is
as large as the screen that asked for it.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import zenoh

from silo.core.arrays.columns import MAX_COLUMNS, MIN_COLUMN_NS, ColumnGrid, bins_of
from silo.core.elements import BufferType
from silo.live.feeds import Feed, Feeds, Round
from silo.live.newest import NewestValues
from silo.live.requests import OpenView, ViewOpened
from silo.net.keys import VIEW_ID, Root, client_of_view
from silo.rpc.leases import strange_part
from silo.rpc.published import NotLive, ViewFrame
from silo.rpc.refusals import RefusedWhy
from silo.segment.layout import ElementSchema, EntrySchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows, lost_samples
from silo.state.replica import LoggerSnapshot, Replica

MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 30.0
MAX_VALUES = 20_000
MAX_PLOTS = 256
MAX_NAMES_IN_VIEWS = 60_000
MAX_FRAME_BYTES = 8 * 2**20  # rows read per ring and refresh
HEARTBEAT_S = 1.0  # a view in which nothing moves is sent this often
BACKLOG_S = 1.0  # what a new plot begins with, so that its columns join those of the history


def _problem(request: OpenView) -> str:
    if not VIEW_ID.fullmatch(request.view):
        return "its id must be `<client id>-<number>`, the client id of letters and digits"
    if len(request.values) > MAX_VALUES or len(request.plots) > MAX_PLOTS:
        return f"at most {MAX_VALUES} values and {MAX_PLOTS} plots, got {len(request.values)} and {len(request.plots)}"
    if len(set(request.values)) < len(request.values):
        return "name each of its values once"  # all numbers of an element come as often as it is named
    if not MIN_RATE_HZ <= request.rate_hz <= 1e6:  # also false for NaN
        return f"rate_hz must be {MIN_RATE_HZ} or more, got {request.rate_hz}"
    if not MIN_COLUMN_NS <= request.column_ns < 2**62:
        return f"column_ns must be {MIN_COLUMN_NS} or more, got {request.column_ns}"
    return ""


@dataclass(frozen=True)
class FrameLayout:
    """What the arrays of a view's frames mean, by one generation of the table: `opened` tells its client."""

    opened: ViewOpened
    counts: list[int]  # of entries, by element
    plots: list[tuple[str, int]]  # element and number of its entry; ("", 0) for a name that the table lacks
    values: list[str]  # whole names of elements


def layout_of(request: OpenView, now: LoggerSnapshot) -> FrameLayout:
    """How a view of the present table is laid out."""
    counts, entries, missing = [], [], []
    unpublished: dict[str, None] = {}
    found_all = now.found_all((*request.values, *request.plots))
    values = [
        found[0] if found is not None and found[1] < 0 else name
        for name, found in zip(request.values, found_all, strict=False)
    ]
    for asked, name in zip(request.values, values, strict=True):
        info = now.element(name)
        counts.append(len(info.entries) if info else 0)
        if info is None:
            missing.append(asked)
            continue
        entries += [name + entry.suffix for entry in info.entries]
        if not info.options.enabled:
            unpublished[asked] = None
    plots = []
    for name, meant in zip(request.plots, found_all[len(request.values) :], strict=True):
        found = now.entry(meant)
        plots.append(found or ("", 0))
        if found is None:
            missing.append(name)
            continue
        info = now.element(found[0])
        if info is not None and not info.options.enabled:
            unpublished[found[0]] = None
    opened = ViewOpened(request.view, now.generation, entries, list(request.plots), list(unpublished), missing)
    return FrameLayout(opened, counts, plots, values)


@dataclass
class _Plots:
    """The plots of a view that stand in one ring."""

    cursor: int
    picker: RowPicker[int]
    begun: bool = False


class ServedView(Feed[OpenView]):
    """A view that is open."""

    def __init__(self, request: OpenView, publisher: zenoh.Publisher, now_s: float) -> None:
        super().__init__(request, publisher, 1.0 / min(request.rate_hz, MAX_RATE_HZ), now_s)
        self._number = 0
        self._sent_s = -HEARTBEAT_S
        self._sent_tick = -1
        self._since_ns = 0
        self._layout: FrameLayout | None = None
        self._newest: NewestValues | None = None
        self._plots: dict[int, _Plots] = {}
        self._sizes: dict[int, int] = {}
        self._liveness: Liveness | None = None
        self._reader: SegmentReader | None = None

    def _adopt(self, now: LoggerSnapshot, reader: SegmentReader | None) -> FrameLayout:
        """Prepares for the present generation and segment."""
        layout = layout_of(self.request, now)
        self._layout, self._reader = layout, reader
        self._newest, self._plots, self._sizes, self._liveness = None, {}, {}, None
        self._sent_tick = -1
        if reader is None:
            return layout
        schemas = {element.info.name: element for element in reader.schema.elements}
        self._sizes = _other_sizes(layout.values, now, schemas)
        self._newest = NewestValues(reader, [schemas.get(name) for name in layout.values], layout.counts)
        self._liveness = Liveness(reader, [schemas.get(name) for name in layout.values], self.period_s)
        begins: dict[int, int] = {}
        wanted: dict[int, dict[int, EntrySchema]] = {}
        for signal, (name, number) in enumerate(layout.plots):
            element = schemas.get(name)
            if element is None or number >= len(element.watch_entries):
                continue
            rows = BACKLOG_S * reader.schema.frequency_hz / element.info.options.divider
            begins.setdefault(element.watch_ring, max(0, reader.head(element.watch_ring) - int(rows) - 1))
            wanted.setdefault(element.watch_ring, {})[signal] = element.watch_entries[number]
        self._plots = {ring: _Plots(begins[ring], RowPicker(entries)) for ring, entries in wanted.items()}
        return layout

    def frame(self, this: Round) -> tuple[bytes | None, bool]:
        """Return the next frame, encoded; None if nothing moved since the last one."""
        now, reader, now_s, layout = this.logger, this.reader, this.now_s, self._layout
        if layout is None or layout.opened.generation != now.generation or reader is not self._reader:
            layout = self._adopt(now, reader)
        tick = reader.ticks if reader else 0
        if tick == self._sent_tick and now_s - self._sent_s < HEARTBEAT_S:
            return None, False
        self._sent_tick, self._sent_s = tick, now_s
        self._number += 1
        newest, texts = self._newest.values() if self._newest else (np.full(sum(layout.counts), np.nan), {})
        elements = len(self.request.values)
        held = self._newest.held() if self._newest else np.zeros(elements, np.int64)
        lost = self._newest.lost() if self._newest else np.zeros(elements, np.int64)
        self._since_ns = 0
        grid = self._columns()
        frame = msgspec.msgpack.encode(
            ViewFrame(
                number=self._number,
                generation=layout.opened.generation,
                time_ns=reader.last_time_ns if reader else 0,
                tick=tick,
                state=now.state,
                measured_hz=this.measured_hz,
                lost_total=lost_samples(reader) if reader else 0,
                held=held.tobytes(),
                lost=lost.tobytes(),
                newest=newest.tobytes(),
                texts=texts,
                since_ns=self._since_ns,
                sizes=self._sizes,
                failed=self._newest.failed() if self._newest else {},
                not_live=self._liveness.missing() if self._liveness else {},
                idle_s=this.idle_s,
                **grid.packed(),
            )
        )
        return frame, False

    def _columns(self) -> ColumnGrid:
        """Columns of what came since the last frame."""
        news: list[tuple[_Plots, Rows]] = []
        first, last = 2**62, -(2**62)
        column_ns = self.request.column_ns
        begins = not any(plots.begun for plots in self._plots.values())
        # one ring that hasn't moved for minutes would make a beginning as wide: 3 MB, for a row that the history has
        most = min(MAX_COLUMNS, int(BACKLOG_S * 1e9) // column_ns + 2) if begins else MAX_COLUMNS
        for ring, plots in self._plots.items():
            rows = self._new_rows(ring, plots)
            if len(rows):
                news.append((plots, rows))
                first = min(first, int(rows.time_ns.min()) // column_ns)
                last = max(last, int(rows.time_ns.max()) // column_ns)
        if not news:
            return ColumnGrid(len(self.request.plots), 0, 0)
        if first <= last - most:
            first = last - most + 1
            self._since_ns = max(self._since_ns, first * column_ns)
        grid = ColumnGrid(len(self.request.plots), first, last - first + 1)
        for plots, rows in news:
            bins = bins_of(rows.time_ns, column_ns)
            for signal, values in plots.picker.columns(rows):
                grid.add(signal, bins, values)
        return grid

    def _new_rows(self, ring: int, plots: _Plots) -> Rows:
        reader = self._reader
        assert reader is not None  # there are no plots without a reader
        most = max(1, MAX_FRAME_BYTES // (8 * reader.schema.rings[ring].row_words))
        # a view that fell behind goes on with the newest: what it shows is now
        rows = reader.rows(ring, max(plots.cursor, reader.head(ring) - most), words=plots.picker.words)
        skipped = rows.first > (plots.cursor if plots.begun else 0)
        if skipped and len(rows):
            self._since_ns = max(self._since_ns, int(rows.time_ns[0]))
        plots.begun = plots.begun or len(rows) > 0
        plots.cursor = max(plots.cursor, rows.first + len(rows))
        return rows


def _other_sizes(names: list[str], now: LoggerSnapshot, schemas: dict[str, ElementSchema]) -> dict[int, int]:
    """Buffer sizes of the recording where they differ from the table's, by position."""
    recorded = [schemas[name].info.options.size if name in schemas else 0 for name in names]
    tables = [info.options.size if (info := now.element(name)) else 0 for name in names]
    pairs = zip(recorded, tables, strict=True)
    return {position: size for position, (size, table) in enumerate(pairs) if size != table}


class Views(Feeds[OpenView, ServedView]):
    """All views of all clients."""

    kind, most, most_of_client = "view", 64, 16

    def __init__(
        self, session: zenoh.Session, root: Root, replica: Replica, knows: Callable[[str], bool] | None = None
    ) -> None:
        super().__init__(session, root, knows)
        self._replica = replica

    def open(self, request: OpenView) -> ViewOpened:
        """Open, replace or renew a view."""
        problem = _problem(request)
        if problem:
            raise self._cant_open(problem)
        layout = layout_of(request, self._replica.now)
        self.renewed(request.view, request)
        return layout.opened

    def _is_same(self, old: OpenView, new: OpenView) -> bool:
        wishes = [(one.values, one.plots, one.rate_hz, one.column_ns) for one in (old, new)]
        return wishes[0] == wishes[1]

    def _check(self, request: OpenView, others: list[ServedView]) -> None:
        rooms = [(others, MAX_NAMES_IN_VIEWS)]
        strangers = self._feeds.strangers_beside(request.view, client_of_view(request.view))
        if strangers is not None:
            rooms.append(([one.value for one in strangers], strange_part(MAX_NAMES_IN_VIEWS)))
        for those, most in rooms:
            names = sum(len(one.values) + len(one.plots) for one in (request, *(view.request for view in those)))
            if names > most:
                text = f"all views together may show {most} names; close others first"
                raise self._cant_open(text, RefusedWhy.FAILED)

    def _made(self, request: OpenView, publisher: zenoh.Publisher) -> ServedView:
        return ServedView(request, publisher, time.monotonic())


class Liveness:
    """Which elements of one view can't be shown live, and why: their ring ends, or forgets samples too early.

    What is published has a ring that carries every sample; what is only saved is watched in its own buffer.
    """

    def __init__(self, reader: SegmentReader, elements: Sequence[ElementSchema | None], period_s: float) -> None:
        """`period_s` is how often the rows are read."""
        self._reader = reader
        self._always: dict[int, NotLive] = {}
        self._ending: dict[int, list[int]] = {}
        for place, element in enumerate(elements):
            if element is None:
                self._always[place] = NotLive.ABSENT
                continue
            ring = reader.schema.rings[element.watch_ring]
            if ring.buffer_type is not BufferType.LOOPING:
                self._ending.setdefault(ring.ring, []).append(place)
            elif ring.capacity * ring.divider < period_s * reader.schema.frequency_hz:
                self._always[place] = NotLive.SHORT

    def missing(self) -> dict[int, NotLive]:
        """Return why elements aren't live now, by their places; those that are have none."""
        found = dict(self._always)
        ticks = self._reader.ticks if self._ending else 0
        for number, places in self._ending.items():
            ring = self._reader.schema.rings[number]
            if self._reader.head(number) < ring.rows_before(ticks):
                why = NotLive.FULL if ring.buffer_type is BufferType.FIXED else NotLive.LIMIT
                found.update(dict.fromkeys(places, why))
        return found
