"""The triggers of a logger: how each stands, armed and off, set and tried."""

import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from silo.conditions.standing import TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord, new_trigger
from silo.core.quantities.writing import many
from silo.judging.checks import long_capture_s
from silo_tui.actions import Command, key_of
from silo_tui.context import SiloScreen
from silo_tui.model.lists.conditions import CAUTION, LOUD, name_width, named_in, times_head, trigger_row, when_width
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words import text
from silo_tui.model.words.names import fitting_names
from silo_tui.screens.dialogs.form import taken, told
from silo_tui.screens.dialogs.questions import confirmed
from silo_tui.screens.dialogs.trigger_editor import TriggerEditor, ask_trigger
from silo_tui.screens.files.opened import open_capture
from silo_tui.screens.lists.conditions import ConditionsScreen
from silo_tui.theme import bold

if TYPE_CHECKING:
    from silo.client.client import Client

# what is the matter first
STATES = (
    TriggerWord.FIRING, TriggerWord.BLIND, TriggerWord.OTHER, TriggerWord.HOLDOFF, TriggerWord.ARMED, TriggerWord.FIRED,
    TriggerWord.WAITING, TriggerWord.OFF,
)  # fmt: skip


def _is_off(one: TriggerStatus) -> bool:
    return one.state in (TriggerWord.OFF, TriggerWord.FIRED)


def arm_only(screen: SiloScreen, found: Sequence[TriggerStatus]) -> None:
    """Arm the only trigger, or switch it off; of several, say where one is chosen."""
    if len(found) == 1:
        name, armed = found[0].options.name, _is_off(found[0])
        arm = told(screen.context, lambda client: client.arm_trigger(name, armed=armed), "triggers")
        screen.context.run_flow(arm)
    else:
        does = "is where one is chosen" if found else "is where they are made"
        screen.say(f"{many(len(found), 'trigger')}: {key_of('triggers')} {does}")


class TriggersScreen(ConditionsScreen[TriggerStatus]):
    """A line for each trigger."""

    scope = "triggers"
    kinds = (TriggerOptions,)
    orders = (
        Order("made", "g", "as they were made", lambda one: 0),
        Order("name", "n", "name", lambda one: one.options.name.casefold()),
        Order("state", "!", "state, what fires first", lambda one: STATES.index(one.state)),
        Order("count", "c", "count, the largest first", lambda one: one.fires, True),
        Order("last", "l", "last time, the newest first", lambda one: one.last_ns, True),
    )

    def follow(self, known: str, place: int | None) -> int | None:
        """Begin at the trigger that was made last: the next keys are about it."""
        made = self.session.made_trigger
        return self.shown_keys.index(made) if not known and made in self.shown_keys else super().follow(known, place)

    def head(self, width: int) -> str:
        return times_head(width, self._room)

    def prepare(self, found: Sequence[TriggerStatus], width: int) -> None:
        self.fit(found, name_width([one.options.name for one in found], width))
        whens = [one.options.when for one in found]
        self._whens = dict(zip(whens, fitting_names(whens, when_width(width, self._room)), strict=True))

    @property
    def all(self) -> Sequence[TriggerStatus]:
        return self.session.triggers

    def key_of(self, one: TriggerStatus) -> str:
        return one.options.name

    def label_now(self, command: Command) -> str:
        """Return it; a trigger without a capture has no last one."""
        has_none = command.id == "trigger_capture" and self.chosen is not None and not self.chosen.files
        return "" if has_none else super().label_now(command)

    def signals_of(self, one: TriggerStatus) -> Sequence[str]:
        return named_in(one.options.when, self.session.table.elements, self.session.table.prefix)

    def told(self, one: TriggerStatus) -> str:
        return f"{one.state.value} {one.options.name} {one.options.when} {one.why}"

    def row_of(self, one: TriggerStatus, width: int) -> Text:
        name = "alarm" if one.state in LOUD else "warning" if one.state in CAUTION else "success"
        line = Text(
            trigger_row(one, width, self._names[one.options.name], self._whens[one.options.when], time.time_ns())
        )
        quiet = one.state in (TriggerWord.OFF, TriggerWord.WAITING)
        line.stylize(bold(self.app.theme_variables, "" if quiet else name), 2, 12)
        return line

    def none(self) -> str:
        return f"No triggers. {key_of('trigger_new')} makes one; on a plot it takes its level"

    def about(self, one: TriggerStatus) -> str:
        name = one.options.name
        if one.state is TriggerWord.BLIND:
            return f"{name} is blind: {one.why}" + ("; switch it on in the table" if one.why.endswith("is off") else "")
        if one.state is TriggerWord.FIRED:
            return f"{name} has fired (mode single): {key_of('trigger_toggle')} arms it again"
        if one.state is TriggerWord.WAITING:
            return f"{name} waits for the logger to run"
        if one.files:
            joined = (
                f"{one.fires} fires in {many(one.captures, 'capture')}, the last" if one.fires > one.captures else ""
            )
            return f"{joined or 'last capture'}: {Path(one.files[0]).name}"
        return f"{name}: {one.options.when}"

    def going_on(self) -> Sequence[str]:
        """Return what is going on, a capture of the trigger under the cursor too."""
        one, found = self.chosen, super().going_on()
        if one is None or one.state is not TriggerWord.FIRING:
            return found
        session = self.session  # a capture ends after so many ticks
        slower = session.status.frequency_hz / session.rate_hz if session.loop_slow else 1.0
        post = text.span(one.options.post_s * slower) if one.options.post_s else "0 s"
        latest = text.span(long_capture_s(one.options) * slower)
        ends = f"; {key_of('trigger_toggle')} switches it off, so that it ends" if one.options.armed else ""
        so_far = f", {text.ago(one.capturing_s)} so far" if one.capturing_s else ""
        return [
            *found,
            f"{one.options.name} captures{so_far}: the file is written {post} after the last fire, or"
            f" after {latest}{ends}",
        ]

    # ------------------------------------------------------------------------------------------------- commands

    def command_trigger_toggle(self) -> None:
        """Arm what is off, or switch off; of several, all as the first."""
        if targets := self.targets():
            armed = _is_off(targets[0])
            self._do(targets, lambda client, name: client.arm_trigger(name, armed=armed))

    def command_trigger_force(self) -> None:
        self._do(self.targets(), lambda client, name: client.force_trigger(name))

    def _do(self, targets: Sequence[TriggerStatus], job: "Callable[[Client, str], str]") -> None:
        names = [one.options.name for one in targets]
        if names:
            self.context.run_flow(self.carry_out(lambda client: "; ".join([job(client, name) for name in names])))

    def command_trigger_remove(self) -> None:
        if targets := self.targets():
            self.context.run_flow(self._remove(targets))

    async def _remove(self, targets: Sequence[TriggerStatus]) -> None:
        """Ask, and forget them."""
        names, one = [each.options.name for each in targets], len(targets) == 1
        kept = f"{many(sum(each.fires for each in targets), 'fire')} in this run"
        its, it = ("its", "it") if one else ("their", "them")
        lines = [f"{each.options.name}: {each.options.when}" for each in targets]
        lines += [f"{kept}; {its} captures stay where they are."]
        lines += [f"{key_of('trigger_toggle')} switches {it} off and keeps {it}."]
        title = f"Delete {f'trigger {names[0]}' if one else f'{len(names)} triggers'} of {self.session.name}?"
        if await confirmed(self.app, title, "\n".join(lines), "Delete", f"Keep {it}"):
            await self.carry_out(lambda client: "; ".join([client._remove_trigger(name) for name in names]))

    def command_trigger_edit(self) -> None:
        if (one := self.here()) is not None:
            self.context.run_flow(self._edit(one.options))

    async def _edit(self, options: TriggerOptions) -> None:
        def form(made: TriggerOptions | None, problem: str) -> TriggerEditor:
            return TriggerEditor(self.session, made or options, is_new=False, problem=problem)

        await taken(self.context, form, self._set)

    def command_trigger_new(self) -> None:
        new = new_trigger()
        self.context.run_flow(ask_trigger(self.context, new, self._set_new))

    async def _set_new(self, made: TriggerOptions) -> None:
        await self._set(made)
        if made.name in self.shown_keys:
            self.lines.highlighted = self.shown_keys.index(made.name)  # the next keys are about it

    def _set(self, made: TriggerOptions) -> Awaitable[None]:
        return self.carry_out(lambda client: client._set_trigger(made))

    def command_trigger_capture(self) -> None:
        one = self.here()
        if one is not None and not one.files:
            why = "its first capture is under way" if one.capturing_s else f"{one.options.name} has no capture yet"
            self.say_until(
                f"{why}; {key_of('plot_conditions')} plots its signals",
                lambda: any(each.files and each.options.name == one.options.name for each in self.session.triggers),
            )
        elif one is not None:
            what = f"opening the last capture of {one.options.name}"
            self.context.open_over(self, what, open_capture, self.context, self.session, one)

    enter = command_trigger_capture
