"""The parameters of a logger: what each is and may be, who set it; turned by arrows, typed, undone, kept as presets."""

from collections.abc import Callable, Coroutine, Sequence
from functools import partial, partialmethod
from pathlib import Path
from typing import Any

import msgspec
from rich.text import Text

from silo.core.quantities.writing import and_more, many
from silo.core.tuning.parameters import ParameterInfo, ParameterValue, range_text, value_text
from silo.net.access.senders import short_words
from silo.settings.presets import read_preset, typed_value, write_preset
from silo_tui.actions import key_of
from silo_tui.modal import ask, run_aside
from silo_tui.model.lists import parameters as rows
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words.paths import typed_file
from silo_tui.screens.dialogs.questions import Prompt, ask_line, confirmed
from silo_tui.screens.lists.conditions import ConditionsScreen
from silo_tui.sessions.live import Session

MOST_TOLD = 12


class ParametersScreen(ConditionsScreen[ParameterInfo]):
    """A line for each parameter."""

    scope = "parameters"
    orders = (
        Order("declared", "g", "as the program declared them", lambda one: 0),
        Order("name", "n", "name", lambda one: one.name.casefold()),
        Order("changed", "c", "what isn't its default first", lambda one: one.value == one.default),
    )

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.knobs = session.knobs
        self._begun, self._newest = rows.history(())
        self._written = ""  # the preset that was written last

    async def refresh_standing(self) -> None:
        await self.knobs.refresh(self.context.link)

    @property
    def all(self) -> Sequence[ParameterInfo]:
        return list(self.knobs.known.values())

    def key_of(self, one: ParameterInfo) -> str:
        return one.name

    def head(self, width: int) -> str:
        return rows.head(width, self._room, self.knobs.preset)

    def prepare(self, found: Sequence[ParameterInfo], width: int) -> None:
        self.fit(found, rows.name_width([self.named(one.name) for one in found], width))
        self._begun, self._newest = rows.history(self.session.happened)

    def told(self, one: ParameterInfo) -> str:
        changed = "" if one.value == one.default else "changed"
        return f"{self.named(one.name)} {value_text(one.value, one.unit)} {one.description} {changed} {self._who(one)}"

    def _who(self, one: ParameterInfo) -> str:
        event = self._newest.get(one.name)
        return short_words(event.who) if event is not None else ""

    def row_of(self, one: ParameterInfo, width: int) -> Text:
        beside = self.knobs.beside.get(one.name) if self.knobs.preset else one.default
        line = Text(rows.row(one, self._names[one.name], beside, self._begun.get(one.name), self._who(one)))
        if rows.why_fixed(one, locked=self.knobs.locked):
            line.stylize("dim")
        elif one.value != one.default:
            line.stylize("bold", 0, 4 + self._room + rows.VALUE)
        group = self.named(one.name).rpartition("/")[0]
        if group and self._names[one.name].startswith(group):
            line.stylize("dim", 3, 3 + len(group) + 1)
        return line

    def none(self) -> str:
        if self.session.dead:
            return "The robot program is gone; its parameters come back with it"
        return "No parameters: log.parameter(...) in the program offers values to be tuned"

    def about(self, one: ParameterInfo) -> str:
        return rows.about(one, locked=self.knobs.locked)

    def signals_of(self, one: ParameterInfo) -> Sequence[str]:
        return [one.name]

    def beside_of(self) -> tuple[Sequence[str], str]:
        """What stood in the plots below, else what is marked in the table: what the parameters move; which it is."""
        from silo_tui.screens.plots.monitor import MonitorScreen

        plotted = [
            each.element.name for below in self.app.screen_stack if isinstance(below, MonitorScreen)
            for each in below.stack.plots
        ]  # fmt: skip
        if plotted:
            return plotted, "of the plots before"
        rows = self.session.rows
        which = "marked in the table" if rows.marked_count else "under the cursor of the table"
        return [self.session.table.names[row] for row in rows.targets()], which

    # ------------------------------------------------------------------------------------------------- commands

    def command_turn(self, steps: int) -> None:
        if (one := self.here()) is not None:
            turn = partial(self.knobs.turn, self.context.link, one.name, steps)
            run_aside(self, "turning", self._tell, turn, self._way_on())

    @staticmethod
    def _way_on() -> str:
        """What a stranger does next, whose keys no bar has room for."""
        return f"; {key_of('undo')} takes it back, {key_of('plot_conditions')} plots it"

    async def _tell(self, job: Callable[[], Coroutine[Any, Any, str]], more: str = "") -> None:
        with self.context.telling(tell=self.say):
            if words := await job():
                self.say(words + more)
        self.show()

    def command_type_parameter(self) -> None:
        one = self.here()
        if one is None:
            return
        if why := rows.why_fixed(one, locked=self.knobs.locked):
            self.say(why)
            return
        unit = "" if one.unit in ("", "-") else f", {one.unit}"
        body = "\n".join(filter(None, [one.description, f"{range_text(one)}{unit}; default {value_text(one.default)}"]))
        shown = value_text(one.value).strip("[]")
        called = msgspec.structs.replace(one, name=self.named(one.name))  # what is wrong is told of that name
        prompt = Prompt(called.name, body, shown, check=partial(typed_value, called))
        ask(self, prompt, lambda typed: self._set({one.name: typed_value(one, typed)}))

    enter = command_type_parameter

    def _set(self, values: dict[str, ParameterValue]) -> None:
        job = partial(self.knobs.set, self.context.link, values)
        run_aside(self, "setting", self._tell, job, self._way_on())

    def _undo(self, *, again: bool) -> None:
        run_aside(self, "setting", self._tell, partial(self.knobs.undo, self.context.link, again=again))

    command_undo = partialmethod(_undo, again=False)
    command_redo = partialmethod(_undo, again=True)

    def command_default_parameter(self) -> None:
        targets = self.targets()
        wanted = {one.name: one.default for one in targets}
        if targets:
            self._ask_to_set("Back to defaults", wanted, "all of it is its default already")

    def _ask_to_set(self, title: str, wanted: dict[str, ParameterValue], same: str) -> None:
        """Set values after a question that shows each, as one change."""
        differs = rows.differences(self.all, wanted, {one.name: self.named(one.name) for one in self.all})
        if not differs:
            self.say(same)
            return
        lines = [line for line, _ in differs.values()]
        body = and_more(lines, MOST_TOLD, "\n")
        self.context.run_flow(self._asked(title, body, {name: value for name, (_, value) in differs.items()}))

    async def _asked(self, title: str, body: str, values: dict[str, ParameterValue]) -> None:
        label = f"Set {many(len(values), 'parameter')}"
        if await confirmed(self.app, f"{title}?", body, label, "Leave them"):
            await self._tell(partial(self.knobs.set, self.context.link, values))

    def command_save_preset(self) -> None:
        begin = self.knobs.preset or f"{self.session.name}-preset.yaml"
        body = "All values to a file on this machine; lines and comments of one that is there stay."
        ask_line(self, Prompt("Save preset", body, begin, label="file"), self._save)

    def _save(self, typed: str) -> None:
        values = {one.name: one.value for one in self.all if not one.input}
        with self.context.telling():
            path = write_preset(typed_file("the preset", typed, ".yaml"), values)
            self._written = typed
            self.say(f"saved {many(len(values), 'parameter')}: {path}")

    def command_load_preset(self) -> None:
        body = "A file on this machine; what it would change is shown first."
        self._ask_preset("Load preset", body, self.knobs.preset or self._written, self._load)

    def _load(self, path: Path, values: dict[str, ParameterValue]) -> None:
        self._ask_to_set(f"Load {path.name}", values, f"{path.name}: nothing differs")

    def command_compare_preset(self) -> None:
        if self.knobs.preset:
            self.say(f"no longer compared with {self.knobs.preset}")
            self.knobs.preset, self.knobs.beside = "", {}
            self.show()
            return
        body = "Its values stand where the defaults do, with ≠ where they differ; the same key ends it."
        self._ask_preset("Compare with a preset", body, f"{self.session.name}-preset.yaml", self._compare)

    def _compare(self, path: Path, values: dict[str, ParameterValue]) -> None:
        self.knobs.preset, self.knobs.beside = str(path), values
        differ = [name for name, value in values.items() if self.knobs.known[name].value != value]
        self.say(f"{len(differ)} of {many(len(values), 'value')} differ from {path.name}")
        self.show()

    def _ask_preset(
        self, title: str, body: str, begin: str, then: Callable[[Path, dict[str, ParameterValue]], None]
    ) -> None:
        def read(typed: str) -> None:
            with self.context.telling():
                path = typed_file("the preset", typed, ".yaml")
                then(path, read_preset(path, self.all))

        ask_line(self, Prompt(title, body, begin, label="file"), read)

    def command_plot_conditions(self) -> None:
        if targets := self.targets():
            beside, which = self.beside_of()
            self.plot([*(one.name for one in targets[:2]), *beside])
            if beside:
                self.context.say(f"with {many(len(beside), 'signal')} {which}")
