"""The limits of a logger's signals: what is beyond them, what was and nobody has seen."""

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.conditions import SignalLimits
from silo.core.quantities.writing import and_more
from silo.errors import RefusedError
from silo_tui.actions import key_of
from silo_tui.model.lists import conditions as rows
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words.names import fitting_names, inside, shared_space
from silo_tui.model.words.states import MEANINGS, limit_word
from silo_tui.model.words.text import short, span
from silo_tui.screens.dialogs.limits import ask_limits
from silo_tui.screens.dialogs.questions import confirmed
from silo_tui.screens.lists.conditions import ConditionsScreen
from silo_tui.screens.plots.monitor import MonitorScreen
from silo_tui.theme import bold

if TYPE_CHECKING:
    from silo.client.client import Client

MOST_LINES = 500


def _is_quiet(one: LimitStatus) -> bool:
    return not one.violated and one.word is not LimitWord.BLIND


def _kept(one: LimitStatus) -> str:
    """Return what a signal does that is as its limits want it."""
    given = zip(("LL", "L", "H", "HH"), one.bounds, strict=True)
    bounds = " ".join(f"{word} {short(bound)}" for word, bound in given if bound is not None)
    moves = f"never the same for {span(one.stale_s)}" if one.stale_s else ""
    return ", ".join(filter(None, [bounds and f"within {bounds}", moves]))


class AlarmsScreen(ConditionsScreen[LimitStatus]):
    """A line for each scalar with limits: what is or was over, what is blind, then what was always within them."""

    scope = "alarms"
    kinds = (SignalLimits,)
    orders = (
        Order("state", "!", "worst first, what nobody has seen before what was", lambda one: 0),
        Order("signal", "n", "name", lambda one: one.name.casefold()),
        Order("since", "s", "the newest first", lambda one: one.since_ns, True),
        Order("count", "c", "count, the largest first", lambda one: one.count + one.stale_count, True),
        Order("seen", "k", "not seen first", lambda one: (not one.alarm, one.seen_by)),
    )

    def head(self, width: int) -> str:
        return rows.limit_head(self._room, self._space, self._lasted)

    def prepare(self, found: Sequence[LimitStatus], width: int) -> None:
        """Fit the names of all into the same cells: different ones stay different."""
        names = [self.session.short_name(one.name) for one in found]
        self._space = shared_space(names)
        below = [inside(self._space, name) for name in names]
        status = self.session.status
        self._now_ns = time.time_ns() if self.session.running else status.last_tick_ns or time.time_ns()
        self._lasted = rows.lasted_width(found, self._now_ns)
        self._room = rows.signal_width(below, width, self._lasted)
        fitted = fitting_names(below, self._room)
        self._names = dict(zip(map(self.key_of, found), fitted, strict=True))

    @property
    def all(self) -> Sequence[LimitStatus]:
        return sorted(self.session.limits, key=_is_quiet)[:MOST_LINES]

    def key_of(self, one: LimitStatus) -> str:
        """Return its name, and of which limits it is where these are of a pattern: it may have two."""
        short, limits = (self.session.short_name(each).lstrip("/") for each in (one.name, one.limits))
        return one.name if short == limits else f"{one.name} of {one.limits}"

    def stands_by(self, one: LimitStatus) -> str:
        """Return its name, and whether it was always within its limits: it comes up as it is over them at first."""
        return f"{self.key_of(one)} {_is_quiet(one)}"

    def signals_of(self, one: LimitStatus) -> Sequence[str]:
        scalar = self.session.table.scalar(one.name)
        return [scalar[0].name] if scalar is not None else []

    def told(self, one: LimitStatus) -> str:
        return f"{limit_word(one.word)} {self.session.short_name(one.name)} {one.seen} {one.why}"

    def row_of(self, one: LimitStatus, width: int) -> Text:
        line = Text(rows.limit_row(one, self._names[self.key_of(one)], self._room, self._now_ns, self._lasted))
        red = one.word.is_red
        if one.is_over or one.word is LimitWord.BLIND:
            line.stylize(bold(self.app.theme_variables, "alarm" if red else "warning"), 2, 2 + rows.STATE)
        elif _is_quiet(one):
            line.stylize("dim")
        return line

    def none(self) -> str:
        return f"No limits. {key_of('alarm_new')} gives some"

    def about(self, one: LimitStatus) -> str:
        if one.why:
            return f"{one.name} is blind: {one.why}"
        count, meaning = len(self.session.limits), MEANINGS.get(limit_word(one.word), "")
        if waits := rows.waits_for(one):
            meaning = ", ".join(filter(None, [meaning, waits]))
        elif one.word is LimitWord.OK:
            meaning = f"{_kept(one)}{' again' if one.violated else ''}"
        unseen = "seen by nobody yet" if one.seen == "NEW" else ""
        if one.alarm and one.since_seen:
            way = f"{key_of('alarm_limits')}: persist or hyst keep one quiet that flaps"
            unseen = f"{one.since_seen} × again since {one.seen_by} saw it ({way})"
        whole = self.session.short_name(one.name)  # where its line has no room for it
        is_cut = self._names[self.key_of(one)] != inside(self._space, whole)
        told = f"{whole}: " * is_cut + ", ".join(filter(None, [meaning, unseen]))
        more = f"the first {MOST_LINES} of {count}" if count > MOST_LINES else ""
        return " │ ".join(filter(None, [told, more, rows.alarms_words(self.session.limits)]))

    # ------------------------------------------------------------------------------------------------- commands

    def command_acknowledge(self) -> None:
        names = [one.name for one in self.targets()]
        if names:  # a line may have come above the one that was meant: what it was is told
            which = and_more([self.named(name) for name in names], 3)
            self.context.run_flow(self._told(lambda client: f"{which}: {client.acknowledge(names)}"))

    def command_alarm_worst(self) -> None:
        one = self.here()
        if one is not None and (monitor := self._plot(one)) is not None and one.worst_ns:
            monitor.came_at_moment = True
            monitor.call_after_refresh(monitor.show_moment_of, one.worst_ns)

    enter = command_alarm_worst

    def _plot(self, one: LimitStatus) -> MonitorScreen | None:
        elements = self.signals_of(one)
        if not elements:
            self.say(f"{self.session.short_name(one.name)} is no longer in the table")
            return None
        monitor = MonitorScreen(self.session, elements)
        monitor.stack.chosen = next((at for at, each in enumerate(monitor.stack.plots) if each.name == one.name), 0)
        self.app.push_screen(monitor)
        return monitor

    def command_alarm_limits(self) -> None:
        if (one := self.here()) is not None:
            self._ask_limits([one.limits])

    def command_alarm_new(self) -> None:
        self._ask_limits([])

    def _ask_limits(self, names: Sequence[str]) -> None:
        self.context.run_flow(ask_limits(self.context, names, self.carry_out))

    def command_alarm_remove(self) -> None:
        if names := list(dict.fromkeys(one.limits for one in self.targets())):
            self.context.run_flow(self._remove(names))

    async def _remove(self, names: Sequence[str]) -> None:
        """Ask, and take them away."""
        which = self.named(names[0]) if len(names) == 1 else f"{len(names)} signals"
        body = (
            f"{', '.join(map(self.named, names))}. {key_of('acknowledge')} acknowledges an alarm and keeps its limits."
        )
        if await confirmed(self.app, f"Delete limits of {which} on {self.session.name}?", body, "Delete", "Keep them"):
            await self.carry_out(lambda client: "; ".join([client._remove_limits(name) for name in names]))

    async def _told(self, job: "Callable[[Client], str]") -> None:
        try:
            await self.carry_out(job)
        except RefusedError as error:
            self.context.say(str(error))
