# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Finding moments and events in plots that stand still, in all that is held of them."""

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from functools import partialmethod
from typing import TYPE_CHECKING

import numpy as np

from silo.core.elements import LoggedEvent
from silo.errors import SiloError
from silo_tui.actions import key_of
from silo_tui.modal import ask, run_alone, run_aside
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.lists.happened import gone_words, words
from silo_tui.model.plots.panels import CurveKind, kind_of
from silo_tui.model.plots.time_axis import MOMENTS
from silo_tui.model.samples.find import Search, What, parse_crossing
from silo_tui.model.samples.live import Reading
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among
from silo_tui.screens.dialogs.marking import ask_mark
from silo_tui.screens.plots.finding import SearchResult, events, look, turned

if TYPE_CHECKING:
    from silo_tui.screens.dialogs.questions import Prompt
    from silo_tui.screens.plots.plot_screen import PlotScreen

STEP_PERIODS = 64  # as far as the next sample is looked for at first
HOW = "Enter finds it: 20 either way, >20 rising, <20 falling"


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
        self._condition = ""  # that was looked for last
        self._last: tuple[SearchResult | None, int] = (None, 0)  # moment that one was led to

    # -------------------------------------------------------------------------------------------- find the moment

    def command_find(self) -> None:
        from silo_tui.screens.dialogs.find import MOMENT, ConditionDialog, FindDialog
        from silo_tui.screens.dialogs.questions import Prompt

        if not self.screen.stack.plots:
            self.screen.say("nothing is plotted to find something in")
            return
        self.screen.pause_here()
        dialog = FindDialog(
            self.screen.session.short_name(self.screen.stack.chosen_plot.name), len(self.screen.stack.plots)
        )

        def level_typed(level: str) -> None:
            self._find(replace(parse_crossing(level), everywhere=dialog.everywhere))

        def condition_typed(search: Search) -> None:
            self._condition = search.condition
            self._find(search)

        def chosen(answer: str) -> None:
            if answer == MOMENT:
                title, check = "Go to a moment", self.screen.moment_typed
                prompt = Prompt(title, f"Enter goes there: {MOMENTS}", "", "-3s", check)
                ask(self.screen, prompt, lambda words: run_alone(self.screen, "find", self._go_to_typed, words))
            elif answer == What.CROSSING.value:
                line = Prompt("Find a crossing", HOW, "", "20", parse_crossing)
                ask(self.screen, line, level_typed)
                run_alone(self.screen, "offer", self._offer_level, line)
            elif answer == What.CONDITION.value:
                ask(self.screen, ConditionDialog(self.screen.session, self._condition), condition_typed)
            else:
                self._find(Search(What(answer), everywhere=dialog.everywhere))

        ask(self.screen, dialog, chosen)

    async def _go_to_typed(self, words: str) -> None:
        await self.screen.pause.settled()  # what the times are counted from
        if await self.screen.jump_to(self.screen.moment_typed(words)):
            self.screen.say("")  # what was found before lies elsewhere

    async def _offer_level(self, line: "Prompt") -> None:
        """Offer the value at the cursor as the level: the line doesn't wait for it."""
        self.screen.stack.readings = readings = await self.screen.readings_here()
        line.offer(value_here(self.screen.stack.chosen_plot, readings))

    def _find(self, search: Search) -> None:
        run_alone(self.screen, "find", self._search, search, 0)

    def find_on(self, step: int) -> None:
        """Go on with the search; without one to the highest and lowest number, or the change next to here."""
        self.screen.pause_here()
        if self.screen.found is not None:
            run_alone(self.screen, "find", self._search, self.screen.found.search, step)
            return
        curve = kind_of(self.screen.stack.chosen_plot) is CurveKind.CURVE
        what = (What.HIGHEST if step > 0 else What.LOWEST) if curve else What.CHANGE
        run_alone(self.screen, "find", self._search, Search(what), 0 if curve else step, keep=False)

    command_next_found = partialmethod(find_on, 1)
    command_previous_found = partialmethod(find_on, -1)

    async def _search(self, search: Search, step: int, *, keep: bool = True) -> None:
        await self.screen.pause.settled()
        plots = self.screen.stack.plots if search.everywhere else [self.screen.stack.chosen_plot]
        plots = plots if not search.condition else []
        found, now = self.screen.found, self.screen.now_ns
        same = found is not None and found.search == search and found.names == tuple(plot.name for plot in plots)
        if found is None or not same or found.end_ns != self.screen.held_ns[1] or found.ends_before(now, step):
            try:
                if search.condition:
                    tried = await self.screen.session.turns_true(search.condition)
                    found = turned(search, tried, self.screen.held_ns[1])
                else:
                    found = await look(self.screen.pause.held, plots, search, self.screen.session.bounds, now)
            except SiloError as error:
                self.screen.say(f"{search.words}: {error}")
                return
        if keep:
            self.screen.found = found
        await self._go_to_found(found, step, search.words)

    async def _go_to_found(self, found: SearchResult, step: int, words: str) -> None:
        if not found.moments:
            self.screen.say(found.none())
            return
        before, last = self._last
        place = found.place(self.screen.now_ns, step, last if before == found else None)
        if place is None and step < 0 and found.before:
            self.screen.say(f"{words}: {found.before} older ones are not told")
            return
        if place is None:
            which = "only one" if found.total == 1 else f"{'last' if step > 0 else 'first'} of {found.total}"
            peaks = f"; {key_of('find')} {What.PEAK.value} finds each peak" if found.search.what is What.HIGHEST else ""
            self.screen.say(f"{words}: that is the {which}{peaks}")
            return
        moment = found.moments[place]
        if not await self.screen.jump_to(moment.time_ns):
            return
        self._last = found, place
        at = f"{found.before + place + 1} of {found.total}"
        partly = f" ({found.partly})" if found.partly else ""
        told = f", {at}: {self.screen.context.shown(moment.said)} at {self.screen.moment_words(moment.time_ns)}{partly}"
        room = self.screen.line.content_size.width - len(f"{words} in {told}")  # value and time are what was asked for
        plotted = (*(each.name for each in self.screen.stack.plots), moment.name)
        name, *_ = names = tuple(map(self.screen.session.short_name, reversed(plotted)))
        name = fitted_among(name, names, room)
        self.screen.say(
            f"{words} in {name}{told}" if len(self.screen.stack.plots) > 1 and moment.name else f"{words}{told}"
        )

    # ------------------------------------------------------------------------------------------------------- events

    def command_set_marker(self) -> None:
        a_ns = self.screen.window.at_ns if self.screen.window.paused else None
        ask_mark(self.screen.context, self.screen.source.end_ns if a_ns is None else a_ns)

    def jump_to_event(self, event: LoggedEvent) -> None:
        """Stand still where something happened; say so where its rows are gone."""
        self.screen.pause_here()
        run_alone(self.screen, "find", self._jump_to_event, event)

    async def _jump_to_event(self, event: LoggedEvent) -> None:
        await self.screen.pause.settled()
        if not await self.screen.pause.bring(event.at_ns, self.screen.window.span_ns):
            gone = gone_words(event, self.screen.session.happened)
            self.screen.say(f"{self.screen.gone_words(self._told(event))}; {gone}")
            return
        if await self.screen.jump_to(event.at_ns):
            self.screen.say(f"{self._told(event)} at {self.screen.moment_words(event.at_ns)}")

    def _told(self, event: LoggedEvent) -> str:
        return words(event, self.screen.session.told)

    def _event(self, step: int) -> None:
        self.screen.pause_here()
        run_alone(self.screen, "find", self._go_to_event, step)

    command_next_event = partialmethod(_event, 1)
    command_previous_event = partialmethod(_event, -1)

    async def _go_to_event(self, step: int) -> None:
        await self.screen.pause.settled()
        try:
            found = await events(
                self.screen.pause.held, self.screen.stack.plots, self.screen.session.bounds, self.screen.now_ns
            )
        except SiloError as error:
            self.screen.say(f"events: {error}")
            return
        if not found.moments:
            held = text.span(found.held_s, 3)
            self.screen.say(f"events: no hole, trigger, marker or start in {held} held")
            return
        await self._go_to_found(found, step, "event")

    # ------------------------------------------------------------------------------------------------------ samples

    def _step(self, step: int) -> None:
        self.screen.pause_here()
        run_aside(self.screen, "find", self._step_by, step)

    command_next_sample = partialmethod(_step, 1)
    command_previous_sample = partialmethod(_step, -1)

    async def _step_by(self, step: int) -> None:
        await self.screen.pause.settled()
        async with self._stepping:
            try:
                found = await self._sample_beside(self.screen.now_ns, step)
            except SiloError as error:
                self.screen.say(str(error))
                return
            if found is None:
                name = self.screen.session.short_name(self.screen.stack.chosen_plot.name)
                self.screen.say(f"that is the {'last' if step > 0 else 'first'} sample held of {name}")
            elif await self.screen.jump_to(found):
                self.screen.say("")

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
