"""Edits of a table: of the field under the cursor, of derived signals, of what is marked; all wait to be applied."""

import math
from collections.abc import Callable, Sequence
from functools import partial, partialmethod

import msgspec
from textual.geometry import Region

from silo.core.conditions import AROUND_S, TriggerOptions
from silo.core.quantities.writing import and_more, many
from silo.errors import SiloError
from silo.settings.typed import ElementSettings, examples, read_settings
from silo_tui.actions import BY_ID, Command, key_of
from silo_tui.modal import ask
from silo_tui.model.table.columns import STEADY
from silo_tui.model.table.fields import Field, next_value, parse_change, phrase_for
from silo_tui.model.table.state import APPLIED
from silo_tui.model.words import text
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.elements import ElementsScreen
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.element_table import ElementTable
from silo_tui.widgets.inputs import CellEditor

FIELDS_BY_COMMAND = {
    "edit_divider": Field.DIVIDER, "edit_size": Field.SIZE, "next_buffer": Field.BUFFER, "next_action": Field.ACTION,
    "toggle": Field.ENABLED,
}  # fmt: skip
WORDS_WIDTH = 40
EDITOR_KEYS = "Enter sets it  Esc leaves it as it was"


class Editing(ElementsScreen):
    """The commands of a logger's table that change it."""

    _field_chosen = False  # by ← →: until then `e` asks which, for a toggle is no harmless guess

    def command_left(self) -> None:
        self._field_chosen = True
        self._choose_field(self.table.field_beside(-1))

    def command_right(self) -> None:
        self._field_chosen = True
        self._choose_field(self.table.field_beside(1))

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what applies edits too, where a mode would leave it out."""
        keys, apply = super().mode_keys(), BY_ID["apply"]
        return (*keys, (apply.id, label)) if keys and (label := self.label_now(apply)) else keys

    def label_now(self, command: Command) -> str:
        """Return it; there is something to apply where edits are pending, and it says how many."""
        if command.id == "apply":
            fields = self.session.table.pending_count[0]
            return f"{command.label} {fields}" if fields else ""
        return "" if command.id == "undo" and not self.session.table.can_undo else super().label_now(command)

    def _choose_field(self, field: Field) -> None:
        self.table.field = field
        self.table.live_changed()
        self.table_head.refresh()

    # ------------------------------------------------------------------------------------------------- editing

    def command_edit(self) -> None:
        if (row := self._derived_row) is not None:
            self.derive(self.session.table.names[row])
        elif self._field_chosen:
            self.edit_field(self.table.field)
        elif self._targets_known():
            fields = FIELDS_BY_COMMAND.items()
            choices = [Choice(str(int(field)), field.label, BY_ID[command].keys) for command, field in fields]
            question = Question(f"Edit what of {self.session.rows.targets_words}?", "", choices)
            ask(self, question, lambda answer: self.edit_field(Field(int(answer))))

    @property
    def _derived_row(self) -> int | None:
        """The derived signal that a key is about, where it is about one alone."""
        targets = self.session.rows.targets()
        return int(targets[0]) if len(targets) == 1 and self.session.table.derived[targets[0]] else None

    def command_derive(self, typed: Spelled = BY_KEY) -> None:
        self.derive(typed.first, " ".join(typed.arguments[1:]).removeprefix("= "))

    def derive(self, name: str = "", expression: str = "") -> None:
        """Make a derived signal, or change the one of that name; what isn't said is asked for."""
        from silo_tui.model.table import derived
        from silo_tui.screens.dialogs.derive import ask_derived

        one = derived.named(self.session.table, name)
        one = msgspec.structs.replace(one, expression=expression) if expression else one
        self.context.run_flow(ask_derived(self.context, self.session, one, is_whole=bool(name and expression)))

    def _entry_here(self) -> tuple[int, int, str] | None:
        """Return element, entry and name of the signal under the cursor; says so where there is none."""
        row, entry = self.session.rows.row, self.session.rows.entry or 0
        if row is not None and self.session.table.elements[row].entries:
            return row, entry, self.session.table.entry_names(row)[entry]
        self.say("limits are of one element: go to its line")
        return None

    def command_limits_of_row(self) -> None:
        if (here := self._entry_here()) is not None:
            self._ask_limits(here[2])

    def command_last_capture(self) -> None:
        from silo_tui.screens.files.opened import open_last_capture  # no first screen waits for it

        open_last_capture(self, self.session)

    def command_new_of_row(self) -> None:
        if self.session.rows.row is None:  # a name space, or nothing: a trigger is of any signals
            self._make("trigger", TriggerOptions("", "", AROUND_S, AROUND_S), "")
            return
        if (here := self._entry_here()) is None:
            return
        row, entry, name = here
        short = self.session.short_name(name).lstrip("/")
        reading = self.session.live.readings.get(self.session.table.names[row])
        value = reading.newest[entry] if reading is not None and entry < len(reading.newest) else 0.0
        level = text.short(value, 3) if math.isfinite(value) else "0"
        made = TriggerOptions(short.rpartition("/")[2], f"{short} > {level}", AROUND_S, AROUND_S)
        choices = [
            Choice("trigger", f"A trigger: {made.when}", "t"), Choice("limits", "Limits", "l"),
            Choice("derived", "A signal derived from it", "d"),
        ]  # fmt: skip
        question = Question(f"New for {self.session.short_name(name)}?", "", choices)
        ask(self, question, lambda answer: self._make(answer, made, name))

    def _make(self, answer: str, made: TriggerOptions, name: str) -> None:
        """Ask for a trigger, limits or a derived signal, over the table."""
        if answer == "trigger":
            from silo_tui.screens.dialogs.trigger_editor import ask_trigger

            self.context.run_flow(ask_trigger(self.context, made))
        elif answer == "derived":
            self.derive("", self.session.short_name(name).lstrip("/"))
        elif answer == "limits":
            self._ask_limits(name)

    def _ask_limits(self, name: str) -> None:
        from silo_tui.screens.dialogs.form import told
        from silo_tui.screens.dialogs.limits import ask_limits

        self.context.run_flow(ask_limits(self.context, name, partial(told, self.context, place="alarms")))

    def _targets_known(self) -> bool:
        if len(self.session.rows.targets()) and not (why := self.session.why_fixed()):
            return True
        self.say(why if len(self.session.rows.targets()) else "nothing to edit here")
        return False

    def on_element_table_picked(self, event: ElementTable.Picked) -> None:
        """Edit the cell under the cursor when it is clicked."""
        self._field_chosen = self._field_chosen or event.field is not None
        self.action_command("edit")

    def edit_field(self, field: Field) -> None:
        """Turn logging on or off, let one of a few values be chosen, or open the editor over the cell."""
        if self._targets_known():
            self.sure_of_hidden(lambda: self._edit_field(field))

    command_toggle = partialmethod(edit_field, Field.ENABLED)
    command_edit_divider = partialmethod(edit_field, Field.DIVIDER)
    command_edit_size = partialmethod(edit_field, Field.SIZE)
    command_next_buffer = partialmethod(edit_field, Field.BUFFER)
    command_next_action = partialmethod(edit_field, Field.ACTION)

    def _edit_field(self, field: Field) -> None:
        self._choose_field(field)
        targets = self.session.rows.targets()
        # of what is edited, not of the cursor's row, which needn't be marked
        value = self.session.table.value(field, targets[0])
        if field is Field.ENABLED:
            self._set(field, next_value(field, value))
        elif field.cycles:
            self._choose_value(field, value)
        else:
            self._open_editor("" if len(self._values_of(field)) > 1 else str(value), select=True)

    def _choose_value(self, field: Field, value: int) -> None:
        """Let one of a few values be chosen from a list."""
        words = field.option.words
        choices = [Choice(str(int(each.value)), phrase_for(field, int(each.value)), each.cell[0]) for each in words]
        title = f"{field.label} of {self.session.rows.targets_words}"
        question = Question(title, f"now {and_more(self._values_of(field), 3)}", choices, str(value))
        ask(self, question, lambda answer: self._set(field, int(answer)))

    def _open_editor(self, value: str, *, select: bool) -> None:
        if self.table.field not in self.table.field_spans():
            self.show_set("settings")  # in which one sees what is edited
        about = self.session.rows.targets_words  # before the cursor goes there
        if self.session.rows.move_to_target():  # the editor lies over a row that is edited
            self.context.table_changed()
        field, region = self.table.field, self.table.cell_region()
        words = ""
        if not select:  # what begins with = may be words of several fields
            region = Region(max(0, min(region.x, self.size.width - WORDS_WIDTH - 2)), region.y, WORDS_WIDTH, 1)
            words = "; or words: div=5 size=10s buf=loop"
        now = self._values_of(field)
        differ = f", now {and_more(now, 3)}" if select and len(now) > 1 else ""
        self.query_one(CellEditor).open(field, region, value, select=select)
        hidden = "" if field in self.table.field_spans() else f" (its column is not shown: {key_of('columns')})"
        self.info.ask(f"{field.label} of {about}{differ}{hidden}, e.g. {examples(field.option)}{words}")
        self.query_one(KeyBar).show_instead(EDITOR_KEYS)

    def _again(self, edit: Callable[[], None]) -> None:
        """Make an edit of what the cursor is on now, or of what is marked."""
        if self.context.allows(BY_ID["edit"]) and self._targets_known():
            self.sure_of_hidden(edit)

    def command_edit_all(self) -> None:
        if self._targets_known():
            self.sure_of_hidden(lambda: self._open_editor("=", select=False))

    def why_not_now(self, command_id: str) -> str:
        """Return why what is pending can't be dropped, or nothing edited."""
        if command_id == "discard":
            return "" if self.session.table.pending_count[0] or self._all_derived else "none waits"
        return self.session.why_fixed() if command_id in FIELDS_BY_COMMAND else ""

    def value_now(self, command_id: str) -> str:
        """Return the value that a command would change, or that those that it is about have several."""
        field = FIELDS_BY_COMMAND.get(command_id)
        found = self._values_of(field) if field is not None else []
        return (found[0] if len(found) == 1 else "differ") if found else ""

    def _values_of(self, field: Field) -> list[str]:
        """The different values of what is edited, in words."""
        targets = self.session.rows.targets().tolist()
        return [
            phrase_for(field, each) for each in dict.fromkeys(self.session.table.value(field, at) for at in targets)
        ]

    def _set(self, field: Field, value: int) -> None:
        if self.repeated in FIELDS_BY_COMMAND:
            self.repeats = lambda: self._again(lambda: self._set(field, value))
        targets = self.session.rows.targets()
        changed = self.session.table.edit(targets, field, value)
        words = f"{field.label} {phrase_for(field, value)}: {changed} changed{self.session.rows.not_here}"
        self._edited(words if changed else "nothing to change")

    def command_set(self, typed: Spelled) -> None:
        if not typed.arguments:
            raise ValueError("set what? for example `:set div=5 buf=loop size=10s act=both on=yes`")
        wanted = read_settings(typed.arguments)
        self.sure_of_hidden(lambda: self._set_all(wanted))

    def _set_all(self, wanted: ElementSettings) -> None:
        try:
            changed = self.session.change(wanted)
        except (ValueError, SiloError) as error:
            self.context.fail(str(error))
            return
        takes = f"{key_of('undo')} takes {'it' if changed == 1 else 'them'} back"
        self._edited(
            f"{many(changed, 'field')} changed{self.session.rows.not_here}; {takes}" if changed else "nothing to change"
        )

    def _edited(self, words: str) -> None:
        if self.session.rows.filter.text or self.session.rows.sort not in STEADY:
            self.session.rows.refresh()
        self.say(words)
        self.table_changed()

    def command_undo(self) -> None:
        label = self.session.table.undo() or ""
        again = f"; wanted back, not applied yet: {key_of('apply')}" if label.startswith(APPLIED) else ""
        self._edited(f"undone: {label}{again}" if label else "nothing to undo")

    def command_redo(self) -> None:
        label = self.session.table.redo()
        self._edited(f"done again: {label}" if label else "nothing to do again")

    def command_discard(self) -> None:
        forgets = key_of("forget_derived")
        if not self._all_derived:
            self.sure_of_hidden(self._discard)
        elif forgets:
            self.say(f"a derived signal has no edits; {forgets} forgets it")
        elif self.context.allows(BY_ID["derive"]):
            self.command_forget_derived()

    @property
    def _all_derived(self) -> bool:
        """Whether a key is about derived signals alone."""
        targets = self.session.rows.targets()
        return bool(len(targets) and self.session.table.derived[targets].all())

    def command_forget_derived(self) -> None:
        from silo_tui.screens.dialogs.derive import forget

        if self._all_derived:
            self.context.run_flow(forget(self.context, self.session, self.session.rows.targets().tolist()))
        else:
            self.say(f"only derived signals can be forgotten; {key_of('discard')} drops what is pending")

    def _discard(self) -> None:
        count = self.session.table.discard(self.session.rows.targets())
        self._edited(
            f"{many(count, 'edit')} discarded; {key_of('undo')} brings them back"
            if count
            else "nothing is pending here"
        )

    def _take_cell(self, value: str) -> bool:
        """Edit as typed; False, with the reason, when that can't be."""
        field, words = self.query_one(CellEditor).field, value.strip().removeprefix("=")
        try:
            wanted = read_settings(words.split()) if "=" in words else parse_change(field, value)
            changed = self.session.change(wanted)
        except (ValueError, SiloError) as error:
            why = self.context.shown(str(error).removesuffix("; nothing was changed"))  # which the open editor says
            self.info.ask(f"? {why}")
            return False
        if self.repeated in {*FIELDS_BY_COMMAND, "edit", "edit_all"}:
            self.repeats = lambda: self._again(lambda: self._set_all(wanted))
        label = field.label if "=" not in words else "by words"
        self._edited(f"{label}: {changed} changed" if changed else "nothing to change")
        return True
