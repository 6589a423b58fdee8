# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Finding moments and events in plots that stand still, in all that is held of them."""

from dataclasses import replace
from typing import TYPE_CHECKING

from silo.core.elements import LoggedEvent
from silo.errors import SiloError
from silo_tui.modal import run_alone
from silo_tui.model import text
from silo_tui.model.find import Search, What, parse_crossing
from silo_tui.model.happened import gone_words, words
from silo_tui.model.panels import CurveKind, kind_of
from silo_tui.screens.finding import SearchResult, events, look
from silo_tui.screens.marking import ask_mark
from silo_tui.screens.standing import StandingStill, value_here

if TYPE_CHECKING:
    from silo_tui.screens.dialogs import Prompt

HOW = "Enter finds it: 20 either way, >20 rising, <20 falling"


class Searching(StandingStill):
    """The commands that look for moments and go there."""

    # -------------------------------------------------------------------------------------------- find the moment

    def command_find(self) -> None:
        from silo_tui.screens.dialogs import Prompt
        from silo_tui.screens.find import FindDialog

        if not self.stack.plots:
            self.say("nothing is plotted to find something in")
            return
        self._pause_here()
        dialog = FindDialog(self._short(self.stack.chosen_plot.name), len(self.stack.plots))

        def level_typed(level: str | None) -> None:
            if level is not None:
                self._find(replace(parse_crossing(level), everywhere=dialog.everywhere))

        def chosen(answer: str | None) -> None:
            if answer == What.CROSSING.value:
                line = Prompt("Find a crossing", HOW, "", "20", parse_crossing)
                self.app.push_screen(line, level_typed)
                run_alone(self, "offer", self._offer_level, line)
            elif answer is not None:
                self._find(Search(What(answer), everywhere=dialog.everywhere))

        self.app.push_screen(dialog, chosen)

    async def _offer_level(self, line: "Prompt") -> None:
        """Offer the value at the cursor as the level: the line doesn't wait for it."""
        self.stack.readings = readings = await self._readings_here()
        line.offer(value_here(self.stack.chosen_plot, readings))

    def _find(self, search: Search) -> None:
        run_alone(self, "find", self._search, search, 0)

    def command_next_found(self) -> None:
        self._find_on(1)

    def command_previous_found(self) -> None:
        self._find_on(-1)

    def _find_on(self, step: int) -> None:
        """Go on with the search; without one to the highest and lowest number, or the change next to here."""
        self._pause_here()
        if self._found is not None:
            run_alone(self, "find", self._search, self._found.search, step)
            return
        curve = kind_of(self.stack.chosen_plot) is CurveKind.CURVE
        what = (What.HIGHEST if step > 0 else What.LOWEST) if curve else What.CHANGE
        run_alone(self, "find", self._search, Search(what), 0 if curve else step, keep=False)

    async def _search(self, search: Search, step: int, *, keep: bool = True) -> None:
        await self.pause.settled()
        plots = self.stack.plots if search.everywhere else [self.stack.chosen_plot]
        found, now = self._found, self._now_ns
        same = found is not None and found.search == search and found.names == tuple(plot.name for plot in plots)
        if found is None or not same or found.end_ns != self._newest_ns or found.ends_before(now, step):
            try:
                found = await look(self.held, plots, search, self.session.bounds, now)
            except SiloError as error:
                self.say(f"{search.words}: {error}")
                return
        if keep:
            self._found = found
        await self._go_to_found(found, step, search.words)

    async def _go_to_found(self, found: SearchResult, step: int, words: str) -> None:
        if not found.moments:
            self.say(found.none())
            return
        place = found.place(self._now_ns, step)
        if place is None:
            which = "only one" if found.total == 1 else f"{'last' if step > 0 else 'first'} of {found.total}"
            self.say(f"{words}: that is the {which}")
            return
        moment = found.moments[place]
        if not await self._jump_to(moment.time_ns):
            return
        at = f"{found.before + place + 1} of {found.total}"
        partly = f" ({found.partly})" if found.partly else ""
        said = self.session.table.shown(moment.said)
        told = f", {at}: {said} at {self.moment_words(moment.time_ns)}{partly}"
        room = self.line.content_size.width - len(f"{words} in {told}")  # value and time are what was asked for
        name = text.shorten_left(self._short(moment.name), max(8, room))
        self.say(f"{words} in {name}{told}" if len(self.stack.plots) > 1 and moment.name else f"{words}{told}")

    # ------------------------------------------------------------------------------------------------------- events

    def command_set_marker(self) -> None:
        a_ns = self._at_ns if self.window.paused else None
        ask_mark(self.context, self.source.end_ns if a_ns is None else a_ns)

    def jump_to_event(self, event: LoggedEvent) -> None:
        """Stand still where something happened; say so where its rows are gone."""
        self._pause_here()
        run_alone(self, "find", self._jump_to_event, event)

    async def _jump_to_event(self, event: LoggedEvent) -> None:
        await self.pause.settled()
        if not await self.bring(event.at_ns):
            gone = gone_words(event, self.session.happened)
            self.say(f"{self._told(event)}: gone, oldest held {self.moment_words(self._oldest_ns)}; {gone}")
            return
        await self._jump_to(event.at_ns)
        self.say(f"{self._told(event)} at {self.moment_words(event.at_ns)}")

    def _told(self, event: LoggedEvent) -> str:
        return words(event, self.session.table.shown)

    def command_next_event(self) -> None:
        self._event(1)

    def command_previous_event(self) -> None:
        self._event(-1)

    def _event(self, step: int) -> None:
        self._pause_here()
        run_alone(self, "find", self._go_to_event, step)

    async def _go_to_event(self, step: int) -> None:
        await self.pause.settled()
        try:
            found = await events(self.held, self.stack.plots, self.session.bounds, self._now_ns)
        except SiloError as error:
            self.say(f"events: {error}")
            return
        if not found.moments:
            held = text.span(float(f"{found.held_s:.3g}"))
            self.say(f"events: no hole, trigger, marker or start in {held} held")
            return
        await self._go_to_found(found, step, "event")
