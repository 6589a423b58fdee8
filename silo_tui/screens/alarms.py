# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The limits of a logger's signals: what is beyond them, what was and nobody has seen."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual.binding import Binding
from textual.widgets import OptionList

from silo.errors import RefusedError
from silo.ipc.conditions import LimitStatus, LimitWord
from silo.model import SignalLimits
from silo_tui.actions import bindings_for
from silo_tui.model.conditions import alarms_words, limit_head, limit_row
from silo_tui.screens.conditions import ConditionsScreen
from silo_tui.screens.dialogs import Prompt
from silo_tui.screens.monitor import MonitorScreen
from silo_tui.sessions.live import LiveSource
from silo_tui.widgets.bars import color

if TYPE_CHECKING:
    from silo.ipc.client import Client

MOST_LINES = 500


class AlarmsScreen(ConditionsScreen):
    """A line for each scalar that is or was over, and for what is blind."""

    scope = "alarms"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("alarms")

    def head(self, width: int) -> str:
        return limit_head(width)

    def rows(self, width: int) -> Sequence[tuple[str, Text]]:
        shown = [one for one in self.session.limits if one.violated or one.word is LimitWord.BLIND]
        blind = sum(one.word is LimitWord.BLIND for one in self.session.limits)
        watched = len(self.session.limits)
        self.empty = (
            f"Nothing over its limits. {watched} watched, {blind} blind" if watched else "No limits. N gives some"
        )
        return [(one.name, self._row(one, width)) for one in shown[:MOST_LINES]]

    def _row(self, one: LimitStatus, width: int) -> Text:
        line = Text(limit_row(one, self.session.short_name(one.name), width), no_wrap=True, overflow="ellipsis")
        red = one.word in (LimitWord.RED_HIGH, LimitWord.RED_LOW)
        if one.is_over or one.word is LimitWord.BLIND:
            line.stylize(f"bold {color(self.app.theme_variables, 'error' if red else 'warning')}", 0, 2)
        return line

    @property
    def _chosen(self) -> LimitStatus | None:
        return next((one for one in self.session.limits if one.name == self.chosen_id), None)

    def words(self) -> str:
        one = self._chosen
        if one is not None and one.why:
            return f"{one.name} is blind: {one.why}"
        return alarms_words(self.session.limits)

    # ------------------------------------------------------------------------------------------------- commands

    def command_acknowledge(self) -> None:
        one = self._chosen
        if one is not None:
            self.context.run_flow(self._told(lambda client: client.acknowledge([one.name])))

    def command_alarm_worst(self) -> None:
        one = self._chosen
        if one is None:
            return
        monitor = self._plot(one)
        if monitor is not None and one.worst_ns:
            monitor.call_after_refresh(monitor.show_moment_of, one.worst_ns)

    def command_alarm_plots(self) -> None:
        one = self._chosen
        if one is not None:
            self._plot(one)

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Go to its worst sample."""
        self.command_alarm_worst()

    def _plot(self, one: LimitStatus) -> MonitorScreen | None:
        entries = {
            info.name + entry.suffix: info.name for info in self.session.table.elements for entry in info.entries
        }
        element = entries.get(one.name)
        if element is None:
            self.say(f"{self.session.short_name(one.name)} is derived: it can't be plotted here")
            return None
        monitor = MonitorScreen(self.session, LiveSource(self.session), [element])
        places = [place for place, plotted in enumerate(monitor.stack.plots) if plotted.name == one.name]
        monitor.stack.chosen = places[0] if places else 0
        self.app.push_screen(monitor)
        return monitor

    def command_alarm_limits(self) -> None:
        one = self._chosen
        if one is not None:
            self._ask_limits(self.session.short_name(one.limits).lstrip("/"), one.limits)

    def command_alarm_new(self) -> None:
        self._ask_limits("", "")

    def _ask_limits(self, shown: str, name: str) -> None:
        body = "signal = red low, yellow low, yellow high, red high\n- for none; nothing behind = takes them away"
        prompt = Prompt("Limits", body, f"{shown} = " if shown else "", "joints/torque = -40, -30, 30, 40")
        self.app.push_screen(prompt, lambda line: self._take_limits(line, name, shown))

    def _take_limits(self, line: str | None, name: str, shown: str) -> None:
        if not line:
            return
        typed, _, bounds = line.rpartition("=")
        typed = typed.strip()
        wanted = name if typed == shown and name else typed
        words = [word.strip() for word in bounds.split(",")]
        if wanted and words == [""]:
            self.context.run_flow(self._told(lambda client: client.remove_limits(wanted)))
            return
        try:
            numbers = [None if word in ("-", "") else float(word) for word in words]
        except ValueError:
            numbers = []
        if not wanted or len(numbers) != 4:
            self.say(f"'{line}' are no limits: write signal = red low, yellow low, yellow high, red high")
            return
        low, warn_low, warn_high, high = numbers
        made = SignalLimits(wanted, (low, warn_low, warn_high, high))
        self.context.run_flow(self._told(lambda client: client.set_limits(made)))

    async def _told(self, job: "Callable[[Client], str]") -> None:
        try:
            await self.carry_out(job)
        except RefusedError as error:
            self.context.say(str(error))
