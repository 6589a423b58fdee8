"""What is held of some signals while a picture stands still: fetched pins, and the robot's buffers behind them.

The one place that plots, searches and jumps ask. A moment that no pin has is pinned when one goes there, as long as the
buffers have it; only what these have lost as well is gone. Whatever becomes of the link, what was fetched stays.
`Pause` holds and lets go: the screen has its keys, calls `hold`, awaits `fill` in a worker, and `release`s.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar, cast

import numpy as np

from silo.conditions.requests import TriggerTried
from silo.core.arrays.columns import ColumnGrid, ColumnStore, HistoryColumns, grid_of
from silo.core.elements import BufferType, ElementInfo, LoggedEvent, Sought
from silo.errors import RefusedError, SiloError
from silo.expressions.search import FoundMoments, Looking
from silo.expressions.span import NAN, Between, between
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS, SPANS_S
from silo_tui.model.samples.live import Reading
from silo_tui.model.samples.searching import found_in, joined, reading_of
from silo_tui.model.samples.source import HeldRows, PlotSource, Samples
from silo_tui.model.table.derived import present
from silo_tui.model.table.fields import Field, phrase_for
from silo_tui.model.words import text
from silo_tui.sessions.live import Session
from silo_tui.sessions.pinned import Buffers, LinkPin, PinnedSource

MOST_PIECES = 12  # a helper process has 64 pins for all its clients
NAMES_AT_ONCE = 64  # that a helper process looks through
PINNED_BYTES = 16 * 2**20  # of what was before the picture: all clients of a helper process share 64 MB

Asked = TypeVar("Asked")


class HeldSource:
    """A source of plots that stands still. Lives in the event loop."""

    live = False

    def __init__(
        self,
        live: PlotSource,
        plots: Sequence[Plotted],
        pinned_ns: tuple[int, int],
        newest_ns: int,
        shown: ColumnStore,
        buffers: Buffers | None,
        deep_ns: int = 0,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        """`pinned_ns` is pinned at once, `newest_ns` the moment at which it stands still (0: the end of that).

        `shown` are the columns that were drawn, `deep_ns` is how much before them is pinned by `fill`; `changed` is
        called when more is here.
        """
        self._live = live
        self._plots = tuple(plots)
        self._buffers = buffers
        self._deep_ns = deep_ns
        self._changed = changed
        self._since_s = time.monotonic()
        self.note = ""  # what could not be had
        self.settled = asyncio.Event()  # it is known what is pinned, or that nothing is
        self._unreached = False  # nothing could be pinned, because nobody answered
        self._oldest_ns = 0  # in the buffers, as they said last
        self._held_from_ns = 0  # and as they said when it was held
        self._closed = False
        self._lost = False  # whether they are of another run by now
        self._covering = asyncio.Lock()
        self._newest_ns = newest_ns
        self._wish_ns = pinned_ns
        self.main = PinnedSource(live, plots, *pinned_ns, shown)
        self._pieces = [self.main]  # by time; no two have a moment in common
        self.names = self.main.names
        self._elements = {plotted.element.name: plotted.element for plotted in plots}  # as they were
        self._periods = {name: live.period_ns(name) for name in self._elements}

    # ------------------------------------------------------------------------------------------ what is, and how much

    def element(self, name: str) -> ElementInfo | None:
        """Return the element of that name, as it was."""
        return self._elements.get(name) or self._live.element(name)

    def period_ns(self, element: str) -> int:
        """Return the time between two samples of an element, as it was."""
        return self._periods.get(element) or self._live.period_ns(element)

    def is_live(self, element: str) -> bool:
        """Return whether the element is held."""
        return element in self._elements

    @property
    def happened(self) -> Sequence[LoggedEvent]:
        """What happened, also since the picture was held."""
        return self._live.happened

    @property
    def begin_ns(self) -> int:
        """The oldest moment that can be looked at: pinned, or still in the buffers."""
        pinned = self._pieces[0].begin_ns
        return min(pinned, self._oldest_ns) if self._oldest_ns and self._in_buffers else pinned

    @property
    def drawn_ns(self) -> int:
        """The oldest moment of which anything is known: what stood on the screen stays there, held or not."""
        return self.main.drawn_before(self.begin_ns)

    @property
    def end_ns(self) -> int:
        """The moment at which it stands still, or the newest that was looked at since."""
        return max(self._newest_ns, self._pieces[-1].end_ns)

    @property
    def _in_buffers(self) -> bool:
        """Whether there may be more in the buffers than in the pins."""
        return self._buffers is not None and self._buffers.reachable and self.pinned and not self._lost

    @property
    def pieces(self) -> Sequence[PinnedSource]:
        """What is pinned, by time."""
        return tuple(self._pieces)

    @property
    def pinned(self) -> bool:
        """Whether anything is pinned."""
        return bool(self._pins)

    @property
    def _pins(self) -> list[LinkPin]:
        return [piece.pin for piece in self._pieces if piece.pin is not None]

    @property
    def held_s(self) -> float:
        """Seconds that are pinned."""
        return sum(piece.held_s for piece in self._pieces)

    @property
    def fetched_s(self) -> float:
        """Seconds of which all samples are here."""
        return sum(piece.fetched_s for piece in self._pieces)

    @property
    def held_text(self) -> str:
        """How much is pinned; empty while that isn't known."""
        if not self.pinned:
            return "only the picture" if self.main.problem else ""
        return self.main.held_text if len(self._pieces) == 1 else text.span(self.held_s, 2)

    @property
    def head(self) -> str:
        """For the head of the screen: `PAUSED 12 s ago, 41 s held`."""
        ago, held = text.span(max(1, round(time.monotonic() - self._since_s))), self.held_text
        return f"PAUSED {ago} ago, {held} held" if held else f"PAUSED {ago} ago"

    @property
    def text(self) -> str:
        """How much is pinned and how much of it is here: `41 s held, 5.0 s of it fetched`; and what was lost of it."""
        others = self._pieces if len(self._pieces) > 1 else ()
        if self.main.problem or not self.pinned:
            return self.main.text
        share = "all" if all(piece.complete for piece in others) else f"{text.span(self.fetched_s, 2)} of it"
        words = f"{self.held_text} held, {share} fetched" if others else self.main.text
        lost_ns = sum(end - begin for begin, end in self._gaps(self._held_from_ns, min(self._oldest_ns, self.end_ns)))
        lost_s = lost_ns / SECOND_NS
        drawn_s = (self.begin_ns - self.drawn_ns) / SECOND_NS
        least_s = self.held_s / 100  # a few ticks go between the picture and what was before it
        if drawn_s > least_s:
            return f"{words}, {text.span(drawn_s, 2)} before it as drawn"
        return f"{words}, {text.span(lost_s, 2)} before it overwritten" if lost_s > least_s else words

    def covers(self, time_ns: int) -> bool:
        """Return whether a moment is pinned."""
        return any(piece.begin_ns <= time_ns <= piece.end_ns for piece in self._pieces)

    def _inside(self, start_ns: int, end_ns: int) -> list[tuple[PinnedSource, int, int]]:
        """What is pinned of a stretch, by time: each pin with the begin and the end of what it has of it."""
        last = self._pieces[-1]  # whose newest value holds for a while
        found = [
            (one, max(start_ns, one.begin_ns), end_ns if one is last else min(end_ns, one.end_ns))
            for one in self._pieces
        ]
        return [(piece, begin, end) for piece, begin, end in found if begin <= end]

    def _gaps(self, start_ns: int, end_ns: int) -> list[tuple[int, int]]:
        """What of a stretch is in no pin, but for what is too short for a sample: pins begin and end with one."""
        found, begin, least_ns = [], start_ns, 2 * min(self._periods.values(), default=0)
        for piece in self._pieces:
            found.append((begin, min(end_ns, piece.begin_ns - 1)))
            begin = max(begin, piece.end_ns + 1)
        return [gap for gap in (*found, (begin, end_ns)) if gap[1] - gap[0] > least_ns]

    # ------------------------------------------------------------------------------------------------------- pinning

    async def open(self) -> str:
        """Pin the picture; return what of it could not be had. Raises a SiloError where nothing can."""
        if self._buffers is None or not self.names:
            return ""
        pin = await self._buffers.pin(self.names, *self._wish_ns)
        if not pin.run or not pin.begin_ns:  # the buffers had turned over before the wish came
            pin.close()
            self.main.unpinned("the logger holds nothing of it any more")
            return pin.text
        self._held_from_ns = self._held_from_ns or pin.oldest_ns
        return self._take(self.main, pin, pin.begin_ns, pin.end_ns)

    async def fill(self, column_ns: int, span_ns: int) -> None:
        """Have the logger pin it; then fetch columns of all, samples of the picture, and the rest if quick."""
        try:
            opened = await self._opened()
        finally:
            self.settled.set()
        if not opened:
            return
        main = self.main
        await main.fetch_columns(column_ns)
        self._changed()
        await main.fetch(main.end_ns - span_ns, main.end_ns)
        self._changed()
        while not self._closed and await main.fetch_rest():
            self._changed()
        for piece in self.pieces:
            if piece is not main:
                await piece.fetch_columns(column_ns)
                if main.complete and piece.held_s <= main.held_s:  # it comes as quickly
                    await piece.fetch(piece.begin_ns, piece.end_ns)
                self._changed()

    async def _opened(self) -> bool:
        """Have the logger pin it; False where there is nothing to fetch."""
        if self._closed or self._buffers is None or not self.names:
            return False
        try:
            note = await self.open()
            # at once: a window that is wider later asks for what is overwritten by then
            self.note = await self.cover(self.end_ns - self._deep_ns, self.end_ns) or note
        except SiloError as error:
            self._unreached = not isinstance(error, RefusedError)
            self.main.unpinned("nothing is pinned: " + ("no link" if self._unreached else str(error)))
            self._changed()
            return False
        self._unreached = False
        self._changed()
        return not (self.main.problem or self._closed)

    async def look(self, start_ns: int, end_ns: int, column_ns: int) -> None:
        """Pin and fetch what is looked at now, as far as the logger has it still; after a link that was lost too."""
        await self.settled.wait()
        if self._closed:
            return
        if self._buffers is not None and self._buffers.reachable:
            self.mended()
            if self._unreached or not (self.pinned or self.main.problem):
                await self._opened()
        before = self.pieces
        if not (self.covers(start_ns) and self.covers(end_ns)):
            # a window more: who goes back mostly goes on
            self.note = await self.cover(2 * start_ns - end_ns, min(end_ns, self.end_ns)) or self.note
        for piece in self.pieces:
            if piece not in before:
                await piece.fetch_columns(column_ns)
        self._changed()
        await self.fetch(start_ns, end_ns)
        self._changed()

    async def cover(self, start_ns: int, end_ns: int) -> str:
        """Pin what of a stretch is in no pin yet and in the buffers still; return what could not be had, and why."""
        async with self._covering:
            told, newest_ns = "", self.end_ns
            for gap in reversed(self._gaps(max(start_ns, self.begin_ns), end_ns)):
                if self._in_buffers:
                    told = await self._pin_more(*gap, newest_ns) or told
            return told

    async def _pin_more(self, begin_ns: int, end_ns: int, newest_ns: int) -> str:
        assert self._buffers is not None
        try:
            pin = await self._buffers.pin(self.names, begin_ns, end_ns)
        except SiloError as error:
            return _why(error)
        is_of_it = pin.run == self._run
        if not is_of_it or not pin.begin_ns:
            pin.close()
            self._lost = self._lost or bool(pin.run and not is_of_it)
            self._oldest_ns = pin.oldest_ns if is_of_it else self._oldest_ns
            return pin.text
        piece = PinnedSource(self._live, self._plots, begin_ns, end_ns, ColumnStore((), 1, 1))
        self._pieces = sorted([*self._pieces, piece], key=lambda each: each.begin_ns)
        whole = pin.oldest_ns < begin_ns and not pin.text
        begin_ns, end_ns = begin_ns if whole else pin.begin_ns, end_ns if end_ns <= newest_ns else pin.end_ns
        told = self._take(piece, pin, begin_ns, end_ns)
        self._forget_farthest(piece)
        return told

    def _take(self, piece: PinnedSource, pin: LinkPin, begin_ns: int, end_ns: int) -> str:
        """Have a piece read what is pinned; return what could not be had."""
        piece.opened(pin, begin_ns, end_ns)
        self._oldest_ns = pin.oldest_ns
        if self._closed:
            self.close()  # it came when nobody looks any more
        return pin.text

    def _forget_farthest(self, here: PinnedSource) -> None:
        """Let go of the pin that is farthest from where one looks, never of the picture that was held."""
        if len(self._pieces) > MOST_PIECES:
            others = [piece for piece in self._pieces if piece is not self.main]
            farthest = max(others, key=lambda piece: abs(piece.begin_ns - here.begin_ns))
            self._pieces.remove(farthest)
            farthest.let_go()

    async def bring(self, time_ns: int, around_ns: int) -> bool:
        """Pin a moment with what is around it; False where it is held nowhere any more."""
        slack = 2 * max(self._periods.values(), default=0)
        if not self.covers(time_ns):
            # what came after the picture was held is pinned only where one goes there
            end_ns = time_ns + around_ns
            await self.cover(time_ns - around_ns, end_ns if time_ns > self.end_ns else min(end_ns, self.end_ns))
        is_drawn = self.drawn_ns <= time_ns < self.begin_ns
        return is_drawn or any(one.begin_ns - slack <= time_ns <= one.end_ns + slack for one in self._pieces)

    async def fetch(self, start_ns: int, end_ns: int) -> None:
        """Fetch all samples between two times, as far as they are pinned, the newest first."""
        for piece, begin, end in reversed(self._inside(start_ns, end_ns)):
            await piece.fetch(begin, end)

    def mended(self) -> None:
        """Try again what failed: the link is there."""
        for piece in self._pieces:
            if piece.pin is not None and not piece.pin.refused:
                piece.problem = ""

    def close(self) -> None:
        """Let go of all pins."""
        self._closed = True
        self.settled.set()
        for piece in self._pieces:
            piece.let_go()

    # ---------------------------------------------------------------------------------------------------- what it shows

    async def samples(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """All samples of an entry from `start_ns` to `end_ns`, both included; where they can't come, those here."""
        parts: list[tuple[int, Samples]] = [
            (begin, await piece.samples(name, begin, end)) for piece, begin, end in self._inside(start_ns, end_ns)
        ]
        gaps = self._buffered(start_ns, end_ns)
        parts += [(begin, await self._buffered_samples(name, begin, end)) for begin, end in gaps]
        return joined([some for _, some in sorted(parts, key=lambda part: part[0])])

    def _buffered(self, start_ns: int, end_ns: int) -> list[tuple[int, int]]:
        """What of a stretch the buffers have alone."""
        return self._gaps(max(start_ns, self.begin_ns), min(end_ns, self.end_ns)) if self._in_buffers else []

    async def _buffered_samples(self, name: str, begin_ns: int, end_ns: int) -> Samples:
        try:
            return await self._live.samples(name, begin_ns, end_ns)
        except SiloError:  # what is pinned is all that there is
            return joined(())

    def held(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """The samples of an entry from `start_ns` to `end_ns`, both included, that are here."""
        return joined([piece.held(name, start_ns, end_ns) for piece in self._pieces])

    async def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns of a stretch of time: of the pins, of the buffers where these have it alone, of what was drawn."""
        parts = []
        for begin, end in self._buffered(start_ns, end_ns):
            with suppress(SiloError):
                parts.append(await self._live.history(names, begin, end, column_ns))
        for piece, begin, end in self._inside(start_ns, end_ns):
            parts.append(await piece.history(names, begin, max(end, begin + 1), column_ns))
        return self._together(names, start_ns, end_ns, column_ns, parts)

    def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns from what is here; until more is, those that stood on the screen."""
        parts = [one.columns(names, begin, end, column_ns) for one, begin, end in self._inside(start_ns, end_ns)]
        waits = len(self._pieces) == 1 and not self.main.has(start_ns, end_ns)
        return self._together(names, start_ns, end_ns, column_ns, parts, waits=waits)

    def _together(
        self,
        names: Sequence[str],
        start_ns: int,
        end_ns: int,
        column_ns: int,
        parts: Sequence[HistoryColumns],
        *,
        waits: bool = False,
    ) -> HistoryColumns:
        """Return parts as one, and what stood on the screen where nothing is held, or more `waits` to be fetched."""
        first = start_ns // column_ns
        grid = ColumnGrid(len(names), first, end_ns // column_ns + 1 - first)
        if waits or (start_ns < self.begin_ns and self.drawn_ns < self.begin_ns):
            self.main.lay_drawn(grid, names, column_ns)
            begins = (first + np.arange(grid.count)) * column_ns
            for piece in self._pieces:
                inside = (begins + column_ns > piece.begin_ns) & (begins <= piece.end_ns)
                grid.low[:, inside] = grid.high[:, inside] = np.nan
                grid.marks[:, inside] = 0
        for part in parts:
            rows = range(len(part.names))
            grid.lay(rows, grid_of(part.first, part.low, part.high, part.marks, part.bases), rows)
        return grid.columns(names, column_ns)

    async def readings(self, names: Sequence[str], time_ns: int) -> dict[str, Reading]:
        """What held at a time, of elements: the newest sample up to then, as far as it is pinned."""
        piece = next((each for each in self._pieces if each.begin_ns <= time_ns <= each.end_ns), None)
        if piece is None and self._pieces[-1].end_ns < time_ns:
            piece = self._pieces[-1]
        if piece is None:
            return {}
        held = [self._elements[name] for name in names if name in self._elements]
        return {one.name: await reading_of(piece.samples, self._periods[one.name], one, time_ns) for one in held}

    # ------------------------------------------------------------------------------------------------------ searching

    @property
    def _run(self) -> str:
        """The run that was held."""
        return self.main.pin.run if self.main.pin is not None else ""

    def all_pinned(self, name: str) -> Samples | None:
        """All samples of an entry from the oldest that is pinned to the newest; None where not all are here."""
        begin_ns, end_ns = self._pieces[0].begin_ns, self._pieces[-1].end_ns
        return self.held(name, begin_ns, end_ns) if name in self.names and self._has(begin_ns, end_ns) else None

    async def find(
        self, looking: Mapping[str, Looking], around_ns: int, most: int
    ) -> tuple[dict[str, FoundMoments], str]:
        """Look for moments in all that is held of entries, and return why some of it could not be looked through."""
        pins = self._pins

        async def ask(buffers: Buffers, some: Sequence[str]) -> dict[str, FoundMoments]:
            return await buffers.find({name: looking[name] for name in some}, around_ns, most, self.end_ns, pins)

        async def look(name: str) -> tuple[FoundMoments, int]:
            one = looking[name]
            if one.what is Sought.EDGE:  # a step from sample to sample: columns have none
                samples, wide_ns = joined([each.held(name, each.begin_ns, each.end_ns) for each in self._pieces]), 0
            else:
                samples, wide_ns = self._with_columns(name)
            sought = replace(one, period_ns=max(one.period_ns, wide_ns))
            return await asyncio.to_thread(found_in, sought, samples, around_ns, most), wide_ns

        is_here = all(piece.complete for piece in self._pieces) and not self._gaps(self.begin_ns, self.end_ns)
        return await self._asked_or_here(tuple(looking), is_here, ask, look, fetch=True)

    async def measure(self, names: Sequence[str], a_ns: int, b_ns: int) -> tuple[dict[str, Between], str]:
        """Measure entries between two moments, and return of what the facts are where these aren't all samples.

        What isn't fetched is added up in the helper process; where that can't be asked, columns have what they have:
        the ends, the smallest, the largest.
        """
        run, pins = self._run, self._pins
        begin_ns, end_ns = min(a_ns, b_ns), max(a_ns, b_ns)
        is_here = self._has(begin_ns, end_ns)

        async def measure(name: str) -> tuple[Between, int]:
            samples, wide_ns = self._with_columns(name)
            if is_here:  # of what is not, only what held as the earlier cursor came counts
                earlier = samples[0] < begin_ns
                samples = joined([(samples[0][earlier], samples[1][earlier]), self.held(name, begin_ns, end_ns)])
                wide_ns = 0
            facts = await asyncio.to_thread(between, *samples, a_ns, b_ns)
            return facts if not wide_ns else replace(facts, mean=NAN, std=NAN, rms=NAN, not_finite=0), wide_ns

        return await self._asked_or_here(
            names, is_here, lambda buffers, some: buffers.measure(some, a_ns, b_ns, pins, run), measure
        )

    async def _asked_or_here(
        self,
        names: Sequence[str],
        is_here: bool,
        ask: Callable[[Buffers, Sequence[str]], Awaitable[dict[str, Asked]]],
        here: Callable[[str], Awaitable[tuple[Asked, int]]],
        *,
        fetch: bool = False,
    ) -> tuple[dict[str, Asked], str]:
        """Have the helper process do what can't be done with what `is_here`, so many names at a time; else do it here.

        `here` tells how wide the columns were that it had to take for samples, too. Returns why that isn't all: nobody
        answers, or how wide these columns are.
        """
        why, found = "" if is_here else self._out_of_reach, dict[str, Asked]()
        if not is_here and self._in_buffers and self._buffers is not None:
            try:
                for begin in range(0, len(names), NAMES_AT_ONCE):
                    found.update(await ask(self._buffers, names[begin : begin + NAMES_AT_ONCE]))
            except SiloError as error:
                why = _why(error)
            else:
                return found, ""
        for piece in self._pieces if fetch else ():
            await piece.fetch(piece.begin_ns, piece.end_ns)
        told = {name: await here(name) for name in names}
        widest_ns = max((wide_ns for _, wide_ns in told.values()), default=0)
        only = f"{'columns' if self.pinned else 'picture'} only, to {text.span(widest_ns / 1e9, 2)}"
        return {name: found for name, (found, _) in told.items()}, only if widest_ns else why

    def _with_columns(self, name: str) -> tuple[Samples, int]:
        """All that is here of an entry: samples, and for those that can't come the ends of columns, and their width."""
        parts = [piece.with_columns(name) for piece in self._pieces]
        return joined([some for some, _ in parts]), max(wide for _, wide in parts)

    @property
    def _out_of_reach(self) -> str:
        """Why nothing but what is here can be had."""
        reached = self._buffers is not None and self._buffers.reachable
        return "nothing is pinned" if not self.pinned and reached and self.main.problem else "no link"

    def _has(self, start_ns: int, end_ns: int) -> bool:
        """Whether all samples of a stretch are here."""
        fetched = all(piece.has(begin, end) for piece, begin, end in self._inside(start_ns, end_ns))
        return fetched and not self._gaps(start_ns, end_ns)


def _why(error: SiloError) -> str:
    return str(error) if isinstance(error, RefusedError) else "no link"


def _tells_all(tried: TriggerTried | SiloError, begin_ns: int) -> bool:
    """Whether a logger could tell from a moment on when a condition turned true."""
    return not isinstance(tried, SiloError) and not (tried.why or tried.blind) and tried.begin_ns <= begin_ns


class Pause:
    """What the plots of a screen hold: one thing at a time. A large plot borrows it. Lives in the event loop."""

    def __init__(self, session: Session, changed: Callable[[], None]) -> None:
        """`changed` is called when more is here."""
        self._session = session
        self._live = session.source
        self.changed = changed
        self.source: HeldSource | None = None

    async def settled(self) -> None:
        """Wait until it is known what is pinned, or that nothing is."""
        if self.source is not None:
            await self.source.settled.wait()

    @property
    def possible(self) -> bool:
        """Whether there is anything that goes on by itself."""
        return self._live.live

    @property
    def held(self) -> HeldRows:
        """What is held, and the logger's buffers behind it; of a file all."""
        held = self.source or self._live
        if held.live:
            raise RefusedError("nothing is held: space holds the picture")
        return cast(HeldRows, held)

    async def turns_true(self, condition: str) -> TriggerTried:
        """Return when a condition turned true in all that the logger holds; where it can't tell, in what is pinned.

        Raises ExpressionError with the place of a mistake, a SiloError where neither can tell.
        """
        try:
            tried: TriggerTried | SiloError = await self._session.turns_true(condition)
        except SiloError as error:
            tried = error
        if (source := self.source) is not None and source.pinned and not _tells_all(tried, source.pieces[0].begin_ns):
            from silo_tui.model.samples.turning import samples_for, together, turned_true

            table = self._session.table
            elements, held = table.elements[: table.own], source.all_pinned
            recording = samples_for(condition, elements, table.prefix, present(table), held)
            if recording is not None:
                here = await turned_true(recording, condition)
                return here if isinstance(tried, SiloError) else together(tried, here)
        if isinstance(tried, SiloError):
            raise tried
        return tried

    @property
    def text(self) -> str:
        """How much is held; empty while nothing is."""
        return "; ".join(filter(None, [self.source.text, self.source.note])) if self.source is not None else ""

    @property
    def head(self) -> str:
        """That for the head of the screen."""
        return self.source.head if self.source is not None else ""

    def held_ns(self, plots: Sequence[Plotted]) -> tuple[int, int]:
        """The oldest and the newest moment that can be looked at: held or drawn, in a file, or surely in the buffers.

        These have room for more than they were asked to hold.
        """
        if self.source is not None:
            return self.source.drawn_ns, self.source.end_ns
        if not self.possible:
            return self._live.begin_ns, self._live.end_ns
        newest_ns, started_ns = self._live.end_ns, self._session.status.started_ns
        longest = self._longest(plots)
        span_ns = 0 if longest is None else self._span_ns(longest)
        return newest_ns - min(span_ns, newest_ns - started_ns), newest_ns

    def why_no_more(self, plots: Sequence[Plotted]) -> str:
        """Return which signal is held longest, how long and by what buffer; empty where that is since the start."""
        longest = self._longest(plots)
        if longest is None or self._span_ns(longest) >= self._live.end_ns - self._session.status.started_ns:
            return ""
        options, name = longest.options, self._session.short_name(longest.name)
        begin_ns, end_ns = self.held_ns(plots)
        span_ns = max(self._span_ns(longest), end_ns - begin_ns)  # a loop that is slower fills a buffer in more time
        holds, buffer = text.span(span_ns / SECOND_NS, 2), phrase_for(Field.BUFFER, options.buffer)
        return f"{name} holds {holds} (buffer {buffer} {options.size} at divider {options.divider})"

    def _longest(self, plots: Sequence[Plotted]) -> ElementInfo | None:
        """Return which of the plotted elements is held longest."""
        return max((plotted.element for plotted in plots), key=self._span_ns, default=None)

    def _span_ns(self, element: ElementInfo) -> int:
        """Return how long an element is held: by a buffer that doesn't loop all since the start."""
        if element.options.buffer is not BufferType.LOOPING:
            return self._live.end_ns - self._session.status.started_ns
        return element.options.size * self._live.period_ns(element.name)

    def hold(
        self, plots: Sequence[Plotted], end_ns: int, span_ns: int, shown: ColumnStore, newest_ns: int = 0
    ) -> HeldSource:
        """Hold the picture that ends there, and what was before it: for at least as long, and as the buffers have it.

        `newest_ns` is now, where the picture is an earlier one.
        """
        self.release()
        plots = [plotted for plotted in plots if self._live.is_live(plotted.element.name)]
        buffers = Buffers(self._session) if self._session.link is not None else None
        elements = {plotted.element.name: plotted.element for plotted in plots}
        bytes_s = sum(
            (16 + 8 * len(one.entries)) * SECOND_NS / self._live.period_ns(name) for name, one in elements.items()
        )
        deep_ns = round(min(SPANS_S[-1], PINNED_BYTES / max(1, bytes_s)) * SECOND_NS)
        wish_ns = end_ns - 2 * span_ns, end_ns
        self.source = HeldSource(self._live, plots, wish_ns, newest_ns, shown, buffers, deep_ns, self._tell)
        return self.source

    def _tell(self) -> None:
        self.changed()  # whoever has it by now

    async def bring(self, time_ns: int, around_ns: int) -> bool:
        """Have a moment pinned; False where neither pins nor the logger's buffers hold it any more."""
        await self.settled()
        if not self.possible:
            return self._live.begin_ns <= time_ns <= self._live.end_ns
        return self.source is not None and await self.source.bring(time_ns, around_ns)

    def release(self) -> None:
        """Let go of what is held."""
        source, self.source = self.source, None
        if source is not None:
            source.close()
