"""Finding moments and events in plots that stand still, in all that is held of them, and going from there to others.

The source looks (`HeldRows.find`): a file by itself, a logger's helper process in its buffers.
"""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from silo.core.conditions import Bounds
from silo.core.elements import Entry, LoggedEvent
from silo.errors import SiloError
from silo.expressions.search import FoundMoments
from silo_tui.actions import key_of
from silo_tui.modal import ask, run_alone, run_aside
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.lists.happened import gone_words, words
from silo_tui.model.plots.limits import inner
from silo_tui.model.samples.find import EVENTS, LETTERS, Moment, Search, What, happened, neighbour
from silo_tui.model.samples.live import Reading, value_words
from silo_tui.model.samples.source import HeldRows
from silo_tui.model.words import text
from silo_tui.model.words.command_line import Spelled
from silo_tui.model.words.names import fitted_among
from silo_tui.screens.dialogs.marking import ask_mark

if TYPE_CHECKING:
    from silo.conditions.requests import TriggerTried
    from silo_tui.screens.plots.plot_screen import PlotScreen

MOST_MOMENTS = 1000  # of a signal that are here at a time
LEAST_PART = 0.01  # of what is held that is worth telling where it is not looked through
MANY_HOLES = 20  # from so many on those that are as long as most are how a loop jitters
WELL_ABOVE = 3  # times as long as most
NAME = 12  # cells of a name that tells signals apart
HOLE_S = 0.1  # that is an event: what is shorter is how a busy computer ticks


@dataclass(frozen=True)
class SearchResult:
    """What a search came to: `total` moments, of which those after the first `before` are here, in the order of time.

    `held_s` is how much was looked through, `partly` why not all that is held was.
    """

    search: Search
    names: tuple[str, ...]
    end_ns: int
    moments: tuple[Moment, ...]
    held_s: float
    total: int
    before: int = 0
    partly: str = ""

    def none(self, of: str = "") -> str:
        """Return what to say when nothing was found, `of` what."""
        if not self.held_s and self.partly:
            return f"{self.search.words}: none, {self.partly}"
        words = f"{self.search.words}: none {self.looked_through}{of}"
        return f"{words}; not looked through further: {self.partly}" if self.partly else words

    @property
    def looked_through(self) -> str:
        """How much was looked through, in words."""
        return f"in {text.span(self.held_s, 3)} held"

    def place(self, now_ns: int, step: int, last: int | None = None) -> int | None:
        """Return which moment to go to; of the first of a search the next one, or else the last before.

        Who stands where `last` led goes on from it: several signals may have theirs at one time.
        """
        times = [moment.time_ns for moment in self.moments]
        if step and last is not None and times[last] == now_ns:
            return last + step if 0 <= last + step < len(times) else None
        if step:
            return neighbour(times, now_ns, step)
        if self.search.begin:
            return 0 if self.search.begin > 0 else len(times) - 1
        at = neighbour(times, now_ns - 1, 1)
        return at if at is not None else neighbour(times, now_ns, -1)

    def leads_on(self, now_ns: int, step: int, last: int) -> bool:
        """Return whether there is one more that way from where `last` led."""
        return self.place(now_ns, step, last) is not None or self.ends_before(now_ns, step)

    def ends_before(self, now_ns: int, step: int) -> bool:
        """Return whether the next one isn't here, but there may be more that way."""
        if self.search.condition or self.place(now_ns, step) is not None:
            return False  # of a condition the newest are told, wherever one asks from
        return self.before > 0 if step < 0 else self.before + len(self.moments) < self.total


async def look(
    source: HeldRows, plots: Sequence[Plotted], search: Search, bounds: Mapping[str, Bounds], around_ns: int
) -> SearchResult:
    """Look through all that is held of some entries, for the moments next to a time. Raises a SiloError."""
    if search.what in LETTERS:
        return _happened(source, plots, search)
    looking = {}
    for plotted in plots:
        one = search.looking(source.period_ns(plotted.element.name), inner(bounds, plotted.name))
        if one is not None and not (search.what is What.OUTSIDE and one.bounds == (None, None)):
            looking[plotted.name] = one
    names = tuple(plotted.name for plotted in plots)
    if not looking:
        return SearchResult(search, names, source.end_ns, (), 0.0, 0, 0, "no limits are set on these signals")
    most = max(1, min(MOST_MOMENTS, 10_000 // len(looking)))
    found, partly = await source.find(looking, around_ns, most)
    entries = {plotted.name: plotted.entry for plotted in plots}
    begins = [one.begin_ns for one in found.values() if one.end_ns]
    ends = [one.end_ns for one in found.values() if one.end_ns]
    held_s = (max(ends) - min(begins)) / 1e9 if ends else 0.0
    moments, before, total = merged(found, entries, search.what)
    if search.what is What.HOLE and not search.least_s and total > MANY_HOLES:
        usual_ns = np.median(np.concatenate([one.values for one in found.values()]))
        longer = await look(
            source, plots, replace(search, least_s=float(WELL_ABOVE * usual_ns / 1e9)), bounds, around_ns
        )
        if longer.total:
            others = f"{total - longer.total} up to {text.span(longer.search.least_s, 2)} left out"
            return replace(longer, search=search, partly="; ".join(filter(None, [others, longer.partly])))
    return SearchResult(search, names, source.end_ns, moments, held_s, total, before, partly)


def merged(
    found: Mapping[str, FoundMoments], entries: Mapping[str, Entry], what: What
) -> tuple[tuple[Moment, ...], int, int]:
    """Return the moments of several signals in the order of time, how many come before them, and how many there are.

    Only where those of every signal are known: what lies beyond is asked for when one goes there.
    """
    first = max((int(one.time_ns[0]) for one in found.values() if one.before and len(one.time_ns)), default=None)
    last = min(
        (int(one.time_ns[-1]) for one in found.values() if one.before + len(one.time_ns) < one.total), default=None
    )
    moments: list[Moment] = []
    before = 0
    for name, one in found.items():
        begin = 0 if first is None else int(np.searchsorted(one.time_ns, first, "left"))
        stop = len(one.time_ns) if last is None else int(np.searchsorted(one.time_ns, last, "right"))
        before += one.before + begin
        moments += [
            Moment(int(one.time_ns[at]), name, "", _Told(entries[name], one.values[at : at + 1], what))
            for at in range(begin, stop)
        ]
    moments.sort(key=lambda moment: moment.time_ns)
    return tuple(moments), before, sum(one.total for one in found.values())


@dataclass(frozen=True)
class _Told:
    """What is said of a moment, made when it is looked at."""

    entry: Entry
    value: np.ndarray
    what: What

    def __call__(self) -> str:
        if self.what is What.HOLE:
            return f"{text.span(int(self.value[0]) / 1e9, 3)} without sample"
        return value_words(self.entry, self.value)


def within(tried: "TriggerTried", held_ns: tuple[int, int]) -> "TriggerTried":
    """Return what a test found of a stretch that is held; `why` where that is nothing.

    The test judged what the logger holds now: of a pause that may be the newest part or nothing any more, and only the
    newest moments are told; at how many of its ticks the condition held, or could not be told, nobody knows then.
    """
    end_ns = held_ns[1]
    times = [time_ns for time_ns in tried.time_ns if time_ns <= end_ns]
    older = tried.fires - len(tried.time_ns)
    gone, is_all, why = tried.begin_ns > end_ns, tried.end_ns <= end_ns, tried.why
    if gone:
        crossing = f"{key_of('find')} > 5 looks for a value there"
        why = why or f"the logger, which judges it, has overwritten what is held here; {crossing}"
    elif older > 0 and not times:
        why = why or "only later ones are told"
    return msgspec.structs.replace(
        tried, fires=older + len(times), time_ns=times, end_ns=min(tried.end_ns, end_ns), why=why,
        judged=tried.judged * is_all, held=tried.held * is_all,
    )  # fmt: skip


def turned(search: Search, tried: "TriggerTried", held_ns: tuple[int, int]) -> SearchResult:
    """Return the moments of a stretch that is held at which a condition turned true, as a test of it found them."""
    begin_ns, end_ns = held_ns
    tried = within(tried, held_ns)
    moments = tuple(Moment(time_ns, "", "turns true") for time_ns in tried.time_ns)
    held_s = 0.0 if tried.why else max(0, tried.end_ns - tried.begin_ns) / 1e9
    partly = tried.why
    if tried.begin_ns - begin_ns > (end_ns - begin_ns) * LEAST_PART:
        partly = partly or f"only the newest {text.span(held_s, 2)} can be searched"
    return SearchResult(search, (), end_ns, moments, held_s, tried.fires, tried.fires - len(moments), partly)


def _happened(source: HeldRows, plots: Sequence[Plotted], search: Search) -> SearchResult:
    moments = happened(source, source.begin_ns, source.end_ns, LETTERS[search.what])
    names = tuple(plotted.name for plotted in plots)
    held_s = (source.end_ns - source.begin_ns) / 1e9
    return SearchResult(search, names, source.end_ns, tuple(moments), held_s, len(moments))


async def events(
    source: HeldRows, plots: Sequence[Plotted], bounds: Mapping[str, Bounds], around_ns: int
) -> SearchResult:
    """Look for all that is an event, whichever: long holes, and what happened."""
    found = await look(source, plots, Search(What.HOLE, least_s=HOLE_S), bounds, around_ns)
    more = happened(source, source.begin_ns, source.end_ns, EVENTS, {plotted.name for plotted in plots})
    moments = sorted([*found.moments, *more], key=lambda moment: moment.time_ns)
    held_s = max(found.held_s, (source.end_ns - source.begin_ns) / 1e9)
    return replace(found, moments=tuple(moments), held_s=held_s, total=found.total + len(more))


STEP_PERIODS = 64  # as far as the next sample is looked for at first


def value_here(plotted: Plotted, readings: Mapping[str, Reading]) -> str:
    """Return the value of a signal as it is typed; empty where there is none."""
    reading = readings.get(plotted.element.name)
    if reading is None or plotted.position >= len(reading.newest) or np.isnan(reading.newest[plotted.position]):
        return ""
    return text.short(reading.newest[plotted.position], 6)


class MomentSearch:
    """The commands of a monitor that look for moments and go there."""

    def __init__(self, screen: "PlotScreen") -> None:
        self.screen = screen
        self._stepping = asyncio.Lock()  # two keys at once are two samples
        self.found: SearchResult | None = None  # what was looked for last
        self._typed = ""  # what was looked for last
        self._last: tuple[SearchResult | None, int] = (None, 0)  # moment that one was led to

    # -------------------------------------------------------------------------------------------- find the moment

    def command_find(self) -> None:
        from silo_tui.screens.dialogs.find import LINE, FindDialog

        if self._is_nothing_plotted():
            return
        screen, stack = self.screen, self.screen.stack
        let_go = screen.pause_for_now()

        def chosen(search: Search) -> None:
            self._typed = dialog.fields[LINE] or self._typed
            if search.what is What.MOMENT:
                run_alone(screen, "find", self._go_to_typed, search.condition)
            elif search.what is What.SIGNAL:
                let_go()
                self._go_to_signal(search.condition)
            else:
                self._find(search)

        name, level = screen.session.short_name(stack.chosen_plot.name), value_here(stack.chosen_plot, stack.readings)
        plots = [screen.session.short_name(each.name) for each in stack.plots]
        dialog = FindDialog(
            screen.session, self._typed, name, plots, level,
            self._turns_true, self._counted, screen.moment_typed,
        )  # fmt: skip
        ask(screen, dialog, chosen, let_go)

    def _go_to_signal(self, typed: str) -> None:
        """Choose the plot of a signal; plot it where it is in none."""
        names = [self.screen.session.short_name(each.name).casefold() for each in self.screen.stack.plots]
        at = next((at for at, name in enumerate(names) if typed.casefold() in name), None)
        if at is None:
            self.screen.action_command("add_plot", Spelled("plot", (typed,)))
        else:
            self.screen._choose(at)

    async def _counted(self, search: Search) -> str:
        """Return how often something is found in what is held, or what Enter does. Raises ValueError."""
        if search.what is What.MOMENT:
            return f"Enter goes to {self.screen.moment_words(self.screen.moment_typed(search.condition))}"
        if search.what is What.SIGNAL:
            return "Enter goes to its plot, or plots it"
        await self.screen.pause.settled()
        found = await self._looked(search, self.screen.now_ns)
        return f"{search.words}: {found.total} × {found.looked_through}" if found.total else found.none()

    async def _looked(self, search: Search, around_ns: int) -> SearchResult:
        plots = self.screen.stack.plots if search.everywhere else [self.screen.stack.chosen_plot]
        return await look(self.screen.pause.held, plots, search, self.screen.session.bounds, around_ns)

    def _is_nothing_plotted(self) -> bool:
        if not self.screen.stack.plots:
            self.screen.say("nothing is plotted to find something in")
        return not self.screen.stack.plots

    async def _turns_true(self, condition: str) -> "TriggerTried":
        return within(await self.screen.pause.turns_true(condition), self.screen.held_ns)

    def crossing_here(self, name: str) -> Search | None:
        """Return the search for a level of a signal that led to where one is; None where none did."""
        found, place = self._last
        led = found is not None and found.search.what in (What.CROSSING, What.BEYOND) and found.moments[place]
        return found.search if led and found and (led.name, led.time_ns) == (name, self.screen.now_ns) else None

    async def _go_to_typed(self, words: str) -> None:
        await self.screen.pause.settled()  # what the times are counted from
        if await self.screen.jump_to(self.screen.moment_typed(words)):
            self.screen.say("")  # what was found before lies elsewhere

    def _find(self, search: Search) -> None:
        run_alone(self.screen, "find", self._search, search, 0)

    def command_find_on(self, step: int) -> None:
        """Go on with the search; without one say how one begins."""
        if self._is_nothing_plotted():
            return
        if self.found is None:
            on = key_of("next_found" if step > 0 else "previous_found")
            self.screen.say(f"{key_of('find')} first: type what to look for; {on} then goes on from there")
            return
        self.screen.pause_here()
        run_alone(self.screen, "find", self._search, self.found.search, step)

    async def _search(self, search: Search, step: int) -> None:
        await self.screen.pause.settled()
        plots = self.screen.stack.plots if search.everywhere else [self.screen.stack.chosen_plot]
        plots = plots if not search.condition else []
        found, now = self.found, self.screen.now_ns
        same = found is not None and found.search == search and found.names == tuple(plot.name for plot in plots)
        if search.begin and not step:
            now, same = self.screen.held_ns[search.begin < 0], False
        if found is None or not same or found.end_ns != self.screen.held_ns[1] or found.ends_before(now, step):
            try:
                if search.condition:
                    found = turned(search, await self._turns_true(search.condition), self.screen.held_ns)
                else:
                    found = await self._looked(search, now)
            except SiloError as error:
                self.screen.say(f"{search.words}: {error}")
                return
        self.found = found
        await self._go_to_found(found, step, search.words, ("next_found", "previous_found"))

    async def _go_to_found(self, found: SearchResult, step: int, words: str, others: tuple[str, str]) -> None:
        """Go to a moment, and tell it, with the keys of the commands that go to `others`."""
        if not found.moments:
            names = () if found.search.what in LETTERS else found.names  # what happened is of none
            one = "".join(f" of {self.screen.session.short_name(each)}" for each in names)
            self.screen.say(found.none(f" of {len(names)} signals" if len(names) > 1 else one))
            return
        before, last = self._last
        place = found.place(self.screen.now_ns, step, last if before == found else None)
        if place is None and step < 0 and found.before:
            self.screen.say(f"{words}: {found.before} older ones are not told")
            return
        if place is None:
            which = "only one" if found.total == 1 else f"{'last' if step > 0 else 'first'} of {found.total}"
            peaks = f"; {key_of('find')} peak finds each" if found.search.what is What.HIGHEST else ""
            self.screen.say(f"{words}: that is the {which} {found.looked_through}{peaks}")
            return
        moment = found.moments[place]
        if not await self.screen.jump_to(moment.time_ns):
            return
        self._last = found, place
        ways = zip((1, -1), others, strict=True)
        on = [
            f"{key_of(command)} {'next' if way > 0 else 'before'}"
            for way, command in ways
            if found.leads_on(moment.time_ns, way, place)
        ]
        keys = f" ({', '.join(on)})" if not step and on else ""  # who goes on knows them
        partly = f" ({found.partly})" if found.partly else ""
        said = f", {found.before + place + 1} of {found.total}: {self.screen.context.shown(moment.said)}"
        when, of = self.screen.moment_words(moment.time_ns), f" of {text.span(found.held_s, 2)} held"
        plotted = (*(each.name for each in self.screen.stack.plots), moment.name)
        name, *_ = names = tuple(map(self.screen.session.short_name, reversed(plotted)))
        room = self.screen.line.content_size.width - len(f"{words} in {said} at {partly}{keys}")
        short, several = when.partition("  ")[0], len(names) > 2
        times = (f"{when}{of}", f"{short}{of}", short)  # the clock of A is among the facts
        told = next((each for each in times if len(each) + NAME * several <= room), short)
        name = fitted_among(name, names, room - len(told)) if several or len(name) <= room - len(told) else ""
        name = f" in {name}" if moment.name and name else ""
        self.screen.say(f"{words}{name}{said} at {told}{partly}{keys}")

    # ------------------------------------------------------------------------------------------------------- events

    def command_set_marker(self) -> None:
        a_ns = self.screen.window.at_ns if self.screen.window.paused else None
        ask_mark(self.screen.context, self.screen.source.end_ns if a_ns is None else a_ns)

    def jump_to_event(self, event: LoggedEvent) -> None:
        """Stand still where something happened; where its rows are gone say so, and go on as before."""
        run_alone(self.screen, "find", self._jump_to_event, event, self.screen.pause_for_now())

    async def _jump_to_event(self, event: LoggedEvent, let_go: Callable[[], None]) -> None:
        await self.screen.pause.settled()
        if not await self.screen.pause.bring(event.at_ns, self.screen.window.span_ns):
            gone = gone_words(event, self.screen.session.happened)
            told = f"{self.screen.gone_words(self._told(event))}; {gone}"
            let_go()
            self.screen.say(told)
            return
        if await self.screen.jump_to(event.at_ns):
            self.screen.say(f"at {self.screen.moment_words(event.at_ns)}: {self._told(event)}")

    def _told(self, event: LoggedEvent) -> str:
        return words(event, self.screen.session.told)

    def command_step_event(self, step: int) -> None:
        self.screen.pause_here()
        run_alone(self.screen, "find", self._go_to_event, step)

    async def _go_to_event(self, step: int) -> None:
        await self.screen.pause.settled()
        screen = self.screen
        with screen.context.telling("events", screen.say):
            found = await events(screen.pause.held, screen.stack.plots, screen.session.bounds, screen.now_ns)
            if not found.moments:
                screen.say(f"events: no hole, trigger, marker or start in {text.span(found.held_s, 3)} held")
                return
            await self._go_to_found(found, step, "event", ("next_event", "previous_event"))

    # ------------------------------------------------------------------------------------------------------ samples

    def command_step_sample(self, step: int) -> None:
        self.screen.pause_here()
        run_aside(self.screen, "find", self._step_by, step)

    async def _step_by(self, step: int) -> None:
        await self.screen.pause.settled()
        screen = self.screen
        async with self._stepping:
            begun_ns = screen.now_ns
            with screen.context.telling(tell=screen.say):
                found = await self._sample_beside(begun_ns, step)
                if screen.now_ns != begun_ns:
                    return  # a key that came later has moved the cursor meanwhile
                if found is None:
                    name = screen.session.short_name(screen.stack.chosen_plot.name)
                    screen.say(f"that is the {'last' if step > 0 else 'first'} sample held of {name}")
                elif await screen.jump_to(found):
                    screen.say("")

    async def _sample_beside(self, now_ns: int, step: int) -> int | None:
        """Return the time of the next (1) or last (-1) sample of the chosen signal; None where none is held."""
        plotted, (oldest, newest) = self.screen.stack.chosen_plot, self.screen.held_ns
        reach = STEP_PERIODS * max(1, self.screen.source.period_ns(plotted.element.name))
        while True:  # mostly it is near; where there is a hole it is looked for farther
            begin, end = (now_ns + 1, now_ns + reach) if step > 0 else (now_ns - reach, now_ns - 1)
            time_ns, _ = await self.screen.source.samples(plotted.name, max(begin, oldest), min(end, newest))
            if len(time_ns):
                return int(time_ns[0 if step > 0 else -1])
            if begin <= oldest if step < 0 else end >= newest:
                return None
            reach *= 8
