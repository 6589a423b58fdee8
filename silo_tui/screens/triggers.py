# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The triggers of a logger: how each stands, armed and off, set and tried."""

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding
from textual.widgets import OptionList

from silo.ipc.conditions import TriggerStatus, TriggerWord
from silo.model import TriggerOptions
from silo_tui.actions import bindings_for
from silo_tui.model.conditions import CAUTION, LOUD, times_head, trigger_row
from silo_tui.screens.conditions import ConditionsScreen
from silo_tui.screens.trigger_editor import TriggerEditor
from silo_tui.widgets.bars import color

MOST_PLOTS = 6


class TriggersScreen(ConditionsScreen):
    """A line for each trigger."""

    scope = "triggers"
    empty = "No triggers. N makes one; on a plot it takes its level"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("triggers")

    def head(self, width: int) -> str:
        return times_head(width)

    def rows(self, width: int) -> Sequence[tuple[str, Text]]:
        return [(one.options.name, self._row(one, width)) for one in self.session.triggers]

    def _row(self, one: TriggerStatus, width: int) -> Text:
        name = "error" if one.state in LOUD else "warning" if one.state in CAUTION else "success"
        line = Text(trigger_row(one, width), no_wrap=True, overflow="ellipsis")
        quiet = one.state in (TriggerWord.OFF, TriggerWord.WAITING)
        line.stylize("" if quiet else f"bold {color(self.app.theme_variables, name)}", 2, 12)
        return line

    @property
    def _chosen(self) -> TriggerStatus | None:
        return next((one for one in self.session.triggers if one.options.name == self.chosen_id), None)

    def words(self) -> str:
        one = self._chosen
        if one is None:
            return ""
        name = one.options.name
        if one.state is TriggerWord.BLIND:
            return f"{name} is blind: {one.why}" + ("; switch it on in the table" if one.why.endswith("is off") else "")
        if one.state is TriggerWord.FIRED:
            return f"{name} has fired (mode single): t arms it again"
        if one.state is TriggerWord.WAITING:
            return f"{name} waits for the logger to run"
        if one.files:
            return f"last capture: {Path(one.files[0]).name}"
        return f"{name}: {one.options.when}"

    # ------------------------------------------------------------------------------------------------- commands

    def command_trigger_toggle(self) -> None:
        one = self._chosen
        if one is not None:
            armed = one.state in (TriggerWord.OFF, TriggerWord.FIRED)
            self.context.run_flow(self.carry_out(lambda client: client.arm_trigger(one.options.name, armed=armed)))

    def command_trigger_force(self) -> None:
        one = self._chosen
        if one is not None:
            self.context.run_flow(self.carry_out(lambda client: client.force_trigger(one.options.name)))

    def command_trigger_remove(self) -> None:
        one = self._chosen
        if one is not None:
            self.context.run_flow(self.carry_out(lambda client: client.remove_trigger(one.options.name)))

    def command_trigger_edit(self) -> None:
        one = self._chosen
        if one is not None:
            self.edit(one.options, is_new=False)

    def command_trigger_new(self) -> None:
        self.edit(TriggerOptions("", "", 1.0, 1.0), is_new=True)

    def edit(self, options: TriggerOptions, *, is_new: bool) -> None:
        """Open the editor on a trigger."""
        self.app.push_screen(TriggerEditor(self.session, options, is_new=is_new), self._edited)

    def _edited(self, made: TriggerOptions | None) -> None:
        if made is not None:
            self.context.run_flow(self.carry_out(lambda client: client.set_trigger(made)))

    def command_trigger_capture(self) -> None:
        one = self._chosen
        if one is None or not one.files:
            self.say("it has captured nothing yet")
            return
        self.context.run_flow(self._open(one))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Open what it captured last."""
        self.command_trigger_capture()

    async def _open(self, one: TriggerStatus) -> None:
        """Plot the signals of the condition as they were captured, the cursor at the fire."""
        path = next((path for path in one.files if Path(path).exists()), "")
        if not path:
            self.say(f"it lies on the robot: {one.files[0]}")
            return
        from silo_tui.screens.file_monitor import FileMonitorScreen
        from silo_tui.sessions.recorded import open_file

        file = await asyncio.to_thread(open_file, path)
        names = [name for name in file.rows_of if file.rows_of[name].samples]
        named = [name for name in names if file.short_name(name).strip("/") in one.options.when]
        monitor = FileMonitorScreen(file, (named or names)[:MOST_PLOTS])
        await self.app.push_screen(monitor)
        if file.capture is not None and file.capture.fires_ns:
            monitor.call_after_refresh(monitor.show_moment_of, file.capture.fires_ns[0])
