"""What is held of some signals while a picture stands still: fetched pins, and the robot's buffers behind them.

The one place that plots, searches and jumps ask. A moment that no pin has is pinned when one goes there, as long as the
buffers have it; only what these have lost as well is gone. Whatever becomes of the link, what was fetched stays.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from silo.core.arrays.columns import ColumnStore, HistoryColumns
from silo.core.elements import LoggedEvent, Sought
from silo.errors import RefusedError, SiloError
from silo.expressions.search import FoundMoments, Looking
from silo.expressions.span import NAN, Between, between
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.samples.live import Reading
from silo_tui.model.samples.searching import found_in, joined, reading_of
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.words import text
from silo_tui.sessions.pinned import Buffers, LinkPin, PinnedSource

MOST_PIECES = 12  # a helper process has 64 pins for all its clients
NAMES_AT_ONCE = 64  # that a helper process looks through


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
    ) -> None:
        """`pinned_ns` is pinned at once, `newest_ns` the moment at which it stands still (0: the end of that).

        `shown` are the columns that were drawn.
        """
        self._live = live
        self._plots = tuple(plots)
        self._buffers = buffers
        self._pins: list[LinkPin] = []
        self._oldest_ns = 0  # in the buffers, as they said last
        self._held_from_ns = 0  # and as they said when it was held
        self._closed = False
        self._lost = False  # whether they are of another run by now
        self._covering = asyncio.Lock()
        self._newest_ns = newest_ns
        self._wish_ns = pinned_ns
        self.main = PinnedSource(live, plots, *pinned_ns, shown)
        self._pieces = [self.main]  # by time; no two have a moment in common
        # as they were, of what is held
        self.names, self.element = self.main.names, self.main.element
        self.period_ns, self.is_live = self.main.period_ns, self.main.is_live
        self._period_ns = min((self.period_ns(plotted.element.name) for plotted in plots), default=0)

    # ------------------------------------------------------------------------------------------ what is, and how much

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
        return self._buffers is not None and self._buffers.reachable and bool(self._pins) and not self._lost

    @property
    def pieces(self) -> Sequence[PinnedSource]:
        """What is pinned, by time."""
        return tuple(self._pieces)

    @property
    def pinned(self) -> bool:
        """Whether anything is pinned."""
        return bool(self._pins)

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
        if not self._pins:
            return "only the picture" if self.main.problem else ""
        return self.main.held_text if len(self._pieces) == 1 else text.span(self.held_s, 2)

    @property
    def text(self) -> str:
        """How much is pinned and how much of it is here: `41 s held, 5.0 s of it fetched`; and what was lost of it."""
        others = self._pieces if len(self._pieces) > 1 else ()
        if self.main.problem or not self._pins:
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
        found = [(piece, max(start_ns, piece.begin_ns), min(end_ns, piece.end_ns)) for piece in self._pieces]
        return [(piece, begin, end) for piece, begin, end in found if begin <= end]

    def _gaps(self, start_ns: int, end_ns: int) -> list[tuple[int, int]]:
        """What of a stretch is in no pin, but for what is too short for a sample: pins begin and end with one."""
        found, begin = [], start_ns
        for piece in self._pieces:
            found.append((begin, min(end_ns, piece.begin_ns - 1)))
            begin = max(begin, piece.end_ns + 1)
        return [gap for gap in (*found, (begin, end_ns)) if gap[1] - gap[0] > 2 * self._period_ns]

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
        self._take(pin)
        self._oldest_ns = pin.oldest_ns
        self._held_from_ns = self._held_from_ns or pin.oldest_ns
        self.main.opened(pin, pin.begin_ns, pin.end_ns)
        return pin.text

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
        run, _ = self._of_one_run
        if not pin.run or not pin.begin_ns or pin.run != run:
            pin.close()
            self._lost = self._lost or bool(pin.run and pin.run != run)
            self._oldest_ns = pin.oldest_ns if pin.run == run else self._oldest_ns
            return pin.text
        self._take(pin)
        self._oldest_ns = pin.oldest_ns
        piece = PinnedSource(self._live, self._plots, begin_ns, end_ns, ColumnStore((), 1, 1))
        whole = pin.oldest_ns < begin_ns and not pin.text
        piece.opened(pin, begin_ns if whole else pin.begin_ns, end_ns if end_ns <= newest_ns else pin.end_ns)
        self._pieces = sorted([*self._pieces, piece], key=lambda each: each.begin_ns)
        self._forget_farthest(piece)
        return pin.text

    def _take(self, pin: LinkPin) -> None:
        self._pins.append(pin)
        if self._closed:
            self.close()  # it came when nobody looks any more

    def _forget_farthest(self, here: PinnedSource) -> None:
        """Let go of the pin that is farthest from where one looks, never of the picture that was held."""
        if len(self._pieces) <= MOST_PIECES:
            return
        others = [piece for piece in self._pieces if piece is not self.main]
        farthest = max(others, key=lambda piece: abs(piece.begin_ns - here.begin_ns))
        self._pieces.remove(farthest)
        for pin in [pin for pin in self._pins if farthest.reads(pin)]:
            self._pins.remove(pin)
            pin.close()

    async def bring(self, time_ns: int, around_ns: int) -> bool:
        """Pin a moment with what is around it; False where it is held nowhere any more."""
        slack = 2 * max((self.period_ns(plotted.element.name) for plotted in self._plots), default=0)
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
            if any(piece.reads(pin) and not pin.refused for pin in self._pins):
                piece.problem = ""

    def close(self) -> None:
        """Let go of all pins."""
        self._closed = True
        pins, self._pins = self._pins, []
        for pin in pins:
            pin.close()

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
        gaps = self._buffered(start_ns, end_ns)
        inside = self._inside(start_ns, end_ns)
        if len(inside) == 1 and not gaps:
            found = await inside[0][0].history(names, start_ns, end_ns, column_ns)
        else:
            store = _room(names, start_ns, end_ns, column_ns)
            for begin, end in gaps:
                with suppress(SiloError):
                    store.take(await self._live.history(names, begin, end, column_ns))
            for piece, begin, end in inside:
                store.take(await piece.history(names, begin, max(end, begin + 1), column_ns))
            found = store.stretch(None)
        return self._with_drawn(found, start_ns)

    def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns from what is here."""
        if len(self._pieces) == 1:
            found = self.main.columns(names, start_ns, end_ns, column_ns)
        else:
            store = _room(names, start_ns, end_ns, column_ns)
            for piece, begin, end in self._inside(start_ns, end_ns):
                store.take(piece.columns(names, begin, end, column_ns))
            found = store.stretch(None)
        return self._with_drawn(found, start_ns)

    def _with_drawn(self, found: HistoryColumns, start_ns: int) -> HistoryColumns:
        is_drawn = start_ns < self.begin_ns and self.drawn_ns < self.begin_ns
        return self.main.with_drawn(found, self._pieces) if is_drawn else found

    async def readings(self, names: Sequence[str], time_ns: int) -> dict[str, Reading]:
        """What held at a time, of elements: the newest sample up to then, as far as it is pinned."""
        piece = next((each for each in self._pieces if each.begin_ns <= time_ns <= each.end_ns), None)
        if piece is None and self._pieces[-1].end_ns < time_ns:
            piece = self._pieces[-1]
        if piece is None:
            return {}
        found = {}
        for name in names:
            element = self.element(name)
            if element is not None and self.is_live(name):
                found[name] = await reading_of(piece, element, time_ns)
        return found

    # ------------------------------------------------------------------------------------------------------ searching

    @property
    def _of_one_run(self) -> tuple[str, list[LinkPin]]:
        """The run that was held, and the pins of it."""
        run = next((pin.run for pin in self._pins if pin.run), "")
        return run, [pin for pin in self._pins if pin.run == run]

    @property
    def _all_here(self) -> bool:
        return all(piece.complete for piece in self._pieces) and not self._gaps(self.begin_ns, self.end_ns)

    async def find(
        self, looking: Mapping[str, Looking], around_ns: int, most: int
    ) -> tuple[dict[str, FoundMoments], str]:
        """Look for moments in all that is held of entries, and return why some of it could not be looked through."""
        why = "" if self._all_here else self._out_of_reach
        if not self._all_here and self._in_buffers and (buffers := self._buffers) is not None:
            _, pins = self._of_one_run

            async def ask(names: Sequence[str]) -> dict[str, FoundMoments]:
                return await buffers.find({name: looking[name] for name in names}, around_ns, most, self.end_ns, pins)

            found, why = await _asked(list(looking), ask)
            if not why:
                return found, ""
        return await _find_here(self._pieces, looking, around_ns, most, why, pinned=self.pinned)

    async def measure(self, names: Sequence[str], a_ns: int, b_ns: int) -> tuple[dict[str, Between], str]:
        """Measure entries between two moments, and return of what the facts are where these aren't all samples.

        What isn't fetched is added up in the helper process; where that can't be asked, columns have what they have.
        """
        is_here = self._has(min(a_ns, b_ns), max(a_ns, b_ns))
        why = "" if is_here else self._out_of_reach
        if not is_here and self._in_buffers and (buffers := self._buffers) is not None:
            run, pins = self._of_one_run
            found, why = await _asked(names, lambda some: buffers.measure(some, a_ns, b_ns, pins, run))
            if not why:
                return found, ""
        return await _measure_here(self._pieces, names, a_ns, b_ns, why, pinned=self.pinned)

    @property
    def _out_of_reach(self) -> str:
        """Why nothing but what is here can be had."""
        reached = self._buffers is not None and self._buffers.reachable
        return "nothing is pinned" if not self._pins and reached and self.main.problem else "no link"

    def _has(self, start_ns: int, end_ns: int) -> bool:
        """Whether all samples of a stretch are here."""
        fetched = all(piece.has(begin, end) for piece, begin, end in self._inside(start_ns, end_ns))
        return fetched and not self._gaps(start_ns, end_ns)


async def _asked(
    names: Sequence[str], ask: Callable[[Sequence[str]], Awaitable[dict[str, Asked]]]
) -> tuple[dict[str, Asked], str]:
    """Ask for as many at a time as a helper process looks through; return what came, and why that is not all."""
    found: dict[str, Asked] = {}
    try:
        for begin in range(0, len(names), NAMES_AT_ONCE):
            found.update(await ask(names[begin : begin + NAMES_AT_ONCE]))
    except SiloError as error:
        return found, _why(error)
    return found, ""


def _why(error: SiloError) -> str:
    return str(error) if isinstance(error, RefusedError) else "no link"


def _room(names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> ColumnStore:
    first, stop = start_ns // column_ns, end_ns // column_ns + 1
    store = ColumnStore(names, stop - first, column_ns)
    store.advance_to(stop)
    return store


async def _find_here(
    pieces: Sequence[PinnedSource], looking: Mapping[str, Looking], around_ns: int, most: int, why: str, *, pinned: bool
) -> tuple[dict[str, FoundMoments], str]:
    """Look through what is here of some pieces: samples, and columns for those that can't come.

    Returns why some could not be looked through, too: `why`, or how wide these columns are.
    """
    for piece in pieces:
        await piece.fetch(piece.begin_ns, piece.end_ns)
    found, widest_ns = {}, 0
    for name, one in looking.items():
        if one.what is Sought.EDGE:  # a step from sample to sample: columns have none
            parts = [(piece.held(name, piece.begin_ns, piece.end_ns), 0) for piece in pieces]
        else:
            parts = [piece.with_columns(name) for piece in pieces]
        wide_ns = max(wide for _, wide in parts)
        here = joined([some for some, _ in parts])
        sought = replace(one, period_ns=max(one.period_ns, wide_ns))
        found[name] = await asyncio.to_thread(found_in, sought, here, around_ns, most)
        widest_ns = max(widest_ns, wide_ns)
    return found, _only(widest_ns, pinned=pinned) if widest_ns else why


async def _measure_here(
    pieces: Sequence[PinnedSource], names: Sequence[str], a_ns: int, b_ns: int, why: str, *, pinned: bool
) -> tuple[dict[str, Between], str]:
    """Measure what is here; where only columns are, what these tell: the ends, the smallest, the largest."""
    found, widest_ns = {}, 0
    for name in names:
        parts = [piece.with_columns(name) for piece in pieces]
        wide_ns = max(wide for _, wide in parts)
        time_ns, values = joined([some for some, _ in parts])
        facts = await asyncio.to_thread(between, time_ns, values, a_ns, b_ns)
        found[name] = facts if not wide_ns else replace(facts, mean=NAN, std=NAN, rms=NAN, not_finite=0)
        widest_ns = max(widest_ns, wide_ns)
    return found, _only(widest_ns, pinned=pinned) if widest_ns else why


def _only(widest_ns: int, *, pinned: bool) -> str:
    return f"{'columns' if pinned else 'picture'} only, to {text.span(widest_ns / 1e9, 2)}"
