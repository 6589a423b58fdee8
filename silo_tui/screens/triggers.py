# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The triggers of a logger: how each stands, armed and off, set and tried."""

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual.binding import Binding
from textual.widgets import OptionList

from silo.ipc.conditions import TriggerStatus, TriggerWord
from silo.model import TriggerOptions
from silo_tui.actions import bindings_for
from silo_tui.model.conditions import CAUTION, LOUD, named_in, times_head, trigger_row
from silo_tui.model.lists import Order
from silo_tui.screens.conditions import MOST_PLOTS, ConditionsScreen
from silo_tui.screens.dialogs import Choice, Question
from silo_tui.screens.trigger_editor import TriggerEditor
from silo_tui.widgets.bars import color

if TYPE_CHECKING:
    from silo.ipc.client import Client

# what is the matter first
STATES = (
    TriggerWord.FIRING, TriggerWord.BLIND, TriggerWord.OTHER, TriggerWord.HOLDOFF, TriggerWord.ARMED, TriggerWord.FIRED,
    TriggerWord.WAITING, TriggerWord.OFF,
)  # fmt: skip


class TriggersScreen(ConditionsScreen[TriggerStatus]):
    """A line for each trigger."""

    scope = "triggers"
    empty = "No triggers. N makes one; on a plot it takes its level"
    orders = (
        Order("made", "g", "as they were made", lambda one: 0),
        Order("name", "n", "name", lambda one: one.options.name.casefold()),
        Order("state", "!", "state, what fires first", lambda one: STATES.index(one.state)),
        Order("count", "c", "count, the largest first", lambda one: one.fires, True),
        Order("last", "l", "last time, the newest first", lambda one: one.last_ns, True),
    )
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("triggers")

    def head(self, width: int) -> str:
        return times_head(width)

    @property
    def all(self) -> Sequence[TriggerStatus]:
        return self.session.triggers

    def key_of(self, one: TriggerStatus) -> str:
        return one.options.name

    def signals_of(self, one: TriggerStatus) -> Sequence[str]:
        return named_in(one.options.when, self.session.table.elements, self.session.table.prefix)

    def row_of(self, one: TriggerStatus, width: int) -> Text:
        name = "error" if one.state in LOUD else "warning" if one.state in CAUTION else "success"
        line = Text(trigger_row(one, width), no_wrap=True, overflow="ellipsis")
        quiet = one.state in (TriggerWord.OFF, TriggerWord.WAITING)
        line.stylize("" if quiet else f"bold {color(self.app.theme_variables, name)}", 2, 12)
        return line

    def words(self) -> str:
        one = self.chosen
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
        """Arm what is off, or switch off; of several, all as the first."""
        targets = self.targets
        if targets:
            armed = targets[0].state in (TriggerWord.OFF, TriggerWord.FIRED)
            self._do(targets, lambda client, name: client.arm_trigger(name, armed=armed))

    def command_trigger_force(self) -> None:
        self._do(self.targets, lambda client, name: client.force_trigger(name))

    def command_trigger_remove(self) -> None:
        """Forget the trigger; several after a question."""
        targets = self.targets
        if len(targets) < 2:
            self._remove(targets)
            return
        body = "\n".join(f"{one.options.name}: {one.options.when}" for one in targets)
        choices = [Choice("no", "Keep them"), Choice("yes", f"Forget {len(targets)} triggers", "y")]
        self.app.push_screen(
            Question(f"Forget {len(targets)} triggers of {self.session.name}?", body, choices),
            lambda answer: self._remove(targets) if answer == "yes" else None,
        )

    def _remove(self, targets: Sequence[TriggerStatus]) -> None:
        self._do(targets, lambda client, name: client.remove_trigger(name))

    def _do(self, targets: Sequence[TriggerStatus], job: "Callable[[Client, str], str]") -> None:
        names = [one.options.name for one in targets]
        if names:
            self.context.run_flow(self._told(lambda client: "; ".join([job(client, name) for name in names])))

    def command_trigger_edit(self) -> None:
        one = self.chosen
        if one is not None:
            self.edit(one.options, is_new=False)

    def command_trigger_new(self) -> None:
        self.edit(TriggerOptions("", "", 1.0, 1.0), is_new=True)

    def edit(self, options: TriggerOptions, *, is_new: bool) -> None:
        """Open the editor on a trigger."""
        self.app.push_screen(TriggerEditor(self.session, options, is_new=is_new), self._edited)

    def _edited(self, made: TriggerOptions | None) -> None:
        if made is not None:
            self.context.run_flow(self._told(lambda client: client.set_trigger(made)))

    def command_trigger_capture(self) -> None:
        one = self.chosen
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
        known = named_in(one.options.when, file.table.elements, file.status.prefix)
        named = [name for name in known if name in set(names)]
        monitor = FileMonitorScreen(file, (named or names)[:MOST_PLOTS])
        await self.app.push_screen(monitor)
        if file.capture is not None and file.capture.fires_ns:
            monitor.call_after_refresh(monitor.show_moment_of, file.capture.fires_ns[0])

    async def _told(self, job: "Callable[[Client], str]") -> None:
        self.say(await self.context.link.call(job))
        await self.session.refresh_conditions()
        self.show()
