"""The table of a logger: its elements with their live columns, and everything that edits them."""

import time
from collections.abc import Callable, Sequence
from functools import partial

import msgspec
import numpy as np
from textual.app import ComposeResult
from textual.geometry import Region

from silo.core.arrays.columns import ColumnStore
from silo.core.conditions import new_trigger
from silo.core.quantities.writing import and_more, many, wall_clock
from silo.errors import RefusedError, SiloError
from silo.rpc.frames import Frame
from silo.settings.typed import ElementSettings, examples, is_setting, read_settings
from silo_tui.actions import BY_ID, Command, key_of
from silo_tui.modal import ask, run_alone, run_aside
from silo_tui.model.table.columns import LIVE_COLUMNS, STEADY
from silo_tui.model.table.facts import SINCE
from silo_tui.model.table.fields import Field, parse_change, phrase_for
from silo_tui.model.table.rows import SETTLES_S
from silo_tui.model.table.state import APPLIED
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.elements import WIDE, ElementsScreen
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.terminal import pace_of
from silo_tui.widgets.bars import KeyBar, left_a_file
from silo_tui.widgets.element_table import ElementTable
from silo_tui.widgets.inputs import CellEditor

COLUMN_NS = 200_000_000
COLUMNS = 120
SURVEY_S, JUDGE_S = 1.0, 0.5
KEEP_S = 0.3  # after an edit, until it is kept
KEEP_SURVEY_S = 20.0  # of the minute that a helper process keeps statistics which nobody asks for
QUIET_S = 3.0  # so long after a key no row moves by itself
WIDE_SET = 150  # cells from which settings and statistics stand side by side
NAME_ROOM = 20  # a trend is shown only where names keep this
EMPTY = """{name} has no elements yet. In the program, before log.start():

    q = log.array("q", 6, unit="rad")    # an array that is logged: write q[:] = ...

and log.collect() once per tick of the loop."""
FIELDS_BY_COMMAND = {
    "edit_divider": Field.DIVIDER, "edit_size": Field.SIZE, "next_buffer": Field.BUFFER, "next_action": Field.ACTION,
    "toggle": Field.ENABLED,
}  # fmt: skip
WORDS_WIDTH = 40
EDITOR_KEYS = "Enter sets it  Esc leaves it as it was"


class _View(msgspec.Struct, frozen=True):
    """A view that Esc takes back: its filter and order, the filter of `before`, what takes it back."""

    on: tuple[str, str]
    before: str
    back: Callable[[], object]


class TableScreen(ElementsScreen):
    """Elements, their options, their newest values."""

    scope = "table"
    filter_hint = ""
    _field_chosen = False  # by ← →: until then `e` asks which, for a toggle is no harmless guess

    def __init__(self, session: Session) -> None:
        self._typed_s = 0.0  # monotonic, of the last key
        self._ordered_s = 0.0  # monotonic, when who chose it asked for an order; 0 once what it is by was measured
        self._top_wanted = False  # then too, while no key says where the cursor is to be
        self._offered = False
        self._came_from: int | None = None  # the row of the cursor, where the editor lies over another one
        self._kept_version = -1
        self._surveying = False
        self._reset_wanted = False
        self._survey_s = 0.0
        self._no_survey = ""
        self._view: _View | None = None
        super().__init__(session, LIVE_COLUMNS)

    def lines(self) -> ComposeResult:
        """Yield the editor that lies over a cell."""
        yield CellEditor(self._take_cell)

    @property
    def _filter_and_order(self) -> tuple[str, str]:
        return self.session.rows.filter.text, self.session.rows.sort

    def view_is_on(self, before: str, sort: str, back: Callable[[], object]) -> None:
        """Have Esc take the view back that is shown; of several, one after another, what was before the first.

        `before` and `sort` are filter and order of then.
        """
        if self._view is not None and self._view.on == (before, sort):
            before, back = self._view.before, self._view.back
        self._view = _View(self._filter_and_order, before, back)

    @property
    def _view_on(self) -> "_View | None":
        """The view that is on: no other filter or order was chosen since."""
        view = self._view
        return view if view is not None and view.on == self._filter_and_order and view.on[0] else None

    @property
    def filter_before(self) -> str:
        """The filter that Esc goes back to: a view was shown over it."""
        return view.before if (view := self._view_on) is not None else ""

    def command_back(self) -> None:
        """Leave a view with its order and columns."""
        view = self._view_on
        if view is None or self._inspector_opened or self.session.rows.anchor is not None:
            super().command_back()
            return
        self._view = None
        view.back()
        self.say("")
        self.table_changed()

    def lay_out_table(self, width: int, rest: int) -> None:
        """Give values more room on a wide screen; a trend where names keep theirs."""
        narrow = width < WIDE and self.table.column_set == "settings"
        value_width = 10 if narrow else 8 if rest < WIDE else 10 if rest < 140 else 13 if rest < 170 else 20
        wide = rest >= WIDE_SET
        self.table.lay_out(value_width, trend=width >= WIDE, wide=wide, fill=not narrow)

    # -------------------------------------------------------------------------------------- what is measured

    def on_mount(self) -> None:
        """Give the keys to the table, and measure from now on."""
        self.set_interval(JUDGE_S, self._judge)

    def _judge(self) -> None:
        """Survey once a second, twice where a filter asks for what is measured."""
        session, now_s = self.session, time.monotonic()
        if self.context.upper_screen is not self:
            self._keep_statistics(now_s)
            return
        often = session.rows.filter.measured or "value" in self._quantities  # values stand still between surveys
        period_s = max(JUDGE_S if often else SURVEY_S, self._thin_s())
        due = now_s - self._survey_s >= period_s - JUDGE_S / 2
        if self._surveying or not due or not session.connected:
            return
        self._survey_s, self._surveying = now_s, True
        run_aside(self, "survey", self._survey)

    def _keep_statistics(self, now_s: float) -> None:
        """Have the statistics that the table shows go on while another screen is looked at."""
        due = now_s - self._survey_s >= KEEP_SURVEY_S
        if self._has_statistics and self.session.connected and len(self.session.table) and due:
            self._survey_s = now_s
            run_aside(self, "survey", self.session.keep_survey)

    def why_empty(self) -> str:
        """Return what to write into a program that logs nothing yet, once it was reached."""
        table = self.session.table
        has_none = table.revision >= 0 and not len(table)  # below: nothing was read yet
        return EMPTY.format(name=self.session.name) if has_none else super().why_empty()

    def _thin_s(self) -> float:
        """Return how long a thin link has to be spared; 0 where it isn't one."""
        pause_s = pace_of(self.app).statistics_s
        return pause_s if pause_s > SURVEY_S else 0.0

    async def _survey(self) -> None:
        reset, self._reset_wanted = self._reset_wanted, False
        try:
            await self.session.survey(self.table.names_near_screen(), self._quantities, reset=reset)
        except RefusedError as refused:  # as where others have all statistics that there may be
            if self._no_survey != str(refused):
                self._no_survey = str(refused)
                self.say(f"no statistics and signs: {refused}")
        except SiloError:
            return  # a lost link is told by the banner
        else:
            self._survey_came(time.monotonic())
        finally:
            self._surveying = False

    @property
    def _quantities(self) -> list[str]:
        """What is asked of what is on the screen; by an order of values these are of the moment of the order."""
        asked = self.table.quantities
        return [*asked, "value"] if self.session.rows.sort in {"value", "|value|"} and "value" not in asked else asked

    def _survey_came(self, now_s: float) -> None:
        """Draw what was measured; a live order moves rows only while nobody is at the keys, and no prompt is open."""
        rows = self.session.rows
        # a prompt about rows is open, as the editor of a cell, or a dialog over the table
        if asked := self.app.screen is not self or self.query_one(CellEditor).display:
            self._typed_s = now_s
        is_young = rows.is_young and now_s - self._ordered_s < 2 * SETTLES_S  # of a stopped logger they stay so
        is_known = self._ordered_s and rows.is_measured and not asked and not is_young
        if is_known:
            rows.refresh()
            rows.stand_still(time.time_ns())
            if self._top_wanted:
                rows.move_to(0)
            self._ordered_s, self._top_wanted = 0.0, False
        moves = rows.filter.measured or (rows.live and now_s - self._typed_s >= QUIET_S)
        if is_known or (moves and not asked):
            before, rows.held = self.table.rows_on_screen(), False
            at_top = rows.live and not rows.position and rows.anchor is None
            rows.refresh(now_s if rows.filter.measured else None)
            if at_top:  # who looks at the first ones: with its element one would be led away from them
                rows.move_to(0)
            self.table.rows_changed()
            self.show_why_empty()
            if set(self.table.rows_on_screen()) - set(before):
                self._survey_s = 0.0  # nothing was measured of these yet
            self._show_filter()
            self.request_view_soon()
        self.table.live_changed()
        self.show_bars()  # the head tells alarms of the numbers that rows show
        if self.inspector.display:  # it writes the value as its row does
            self.inspector.live_changed()
        self.info.refresh()

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Do what a key asks for; rows don't move under it."""
        self._typed_s = time.monotonic()
        self._top_wanted, self.session.rows.held = False, self.session.rows.live
        opens = command_id == "edit" or (command_id == "monitor" and left_a_file(self.session))
        if opens and self.session.dead:  # nothing is edited any more, nor comes; what it logged is to be seen
            self.open_left()
            return
        super().action_command(command_id, typed)

    def order_changed(self) -> None:
        """Show the order at once, with what is known; and measure what it needs."""
        super().order_changed()
        self._survey_s = self._typed_s = 0.0
        self._top_wanted = self.session.rows.live
        self._ordered_s = time.monotonic() if self._top_wanted else 0.0
        self._judge()

    def show_set(self, name: str) -> bool:
        """Show another set of live columns; False where there is none of that name."""
        known = super().show_set(name)
        self._survey_s = 0.0
        self._judge()
        return known

    @property
    def _has_statistics(self) -> bool:
        """Whether columns, filter or order are of samples since some time."""
        return not {*self.table.quantities, *self.session.rows.wanted()}.isdisjoint(SINCE)

    @property
    def _since(self) -> str:
        since_ns = self.session.table.facts.since_ns
        return f" since {wall_clock(since_ns)}" if since_ns else ""

    @property
    def _legend(self) -> str:
        """What a sign in small plots is, and since when statistics are, where one has them."""
        since = f"statistics{self._since}" if self._since and self._has_statistics else ""
        return " │ ".join(filter(None, (super()._legend, since)))

    def statistics_words(self) -> str:
        return f" of every sample{self._since}; {key_of('zero')} from now"

    def command_zero(self) -> None:
        self._reset_wanted, self._survey_s = True, 0.0
        self._judge()
        self.say("statistics from now")

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        """Follow a change; keep what is pending, and offer once what an earlier start kept."""
        super().table_changed()
        self._place_editor()
        table = self.session.table
        if not len(table) or self.session.link is None or self.context.read_only:
            return
        if not self._offered:
            self._offered = True
            self.context.offer_edits()
        elif table.version != self._kept_version:
            self._kept_version = table.version
            self.once_settled("kept", KEEP_S, self.context.keep_edits)

    def settings_changed(self) -> None:
        self.table.choose_columns(self.context.settings.columns)
        self._lay_out(self.app.size.width)

    def live_changed(self, frame: Frame) -> None:
        """Show new values; ask once for what was in frames that got lost: the logger still has it."""
        super().live_changed(frame)
        store = self.session.columns
        if store.gapped and store.names:
            store.past_until_ns = None
            run_alone(self, "history", self._fill, store, list(store.names))

    # ------------------------------------------------------------------------------------------------ the view

    def request_view(self) -> None:
        if self.context.upper_screen is not self:
            return
        table = self.session.table
        rows = [row for row in self.table.rows_on_screen() if table.server[Field.ENABLED, row]]
        plots: list[str] = []
        if self.table.shows_trends:
            plots = [name for row in rows if table.is_live(row) and (name := table.drawn_name(row))]
        if self.inspector.display:
            plots += [name for name in self.inspector.plot_names() if name not in plots]
        row = self.session.rows.row
        names = [table.names[each] for each in rows]
        if row is not None and table.names[row] not in names and table.server[Field.ENABLED, row]:
            names.append(table.names[row])
        if not names:  # where no row is shown the head goes on all the same: a frame is of something
            names = [table.names[each] for each in np.flatnonzero(table.server[Field.ENABLED])[:1]]
        self.session.watch(ViewRequest(tuple(names), tuple(plots), COLUMN_NS))
        self._survey_s = 0.0
        self._plan_columns(plots)

    def _plan_columns(self, plots: list[str]) -> None:
        old = self.session.columns
        if old.names == tuple(plots) and old.column_ns == COLUMN_NS:
            return
        store = ColumnStore(plots, COLUMNS, COLUMN_NS)
        store.adopt(old)
        self.session.columns = store
        known = set(old.names) if old.column_ns == COLUMN_NS else set()
        missing = [name for name in plots if name not in known]
        if missing and self.session.connected:
            run_alone(self, "history", self._fill, store, missing)

    async def _fill(self, store: ColumnStore, names: list[str]) -> None:
        end = self.session.source.end_ns
        try:
            past = await self.session.source.history(names, end - COLUMNS * COLUMN_NS, end, COLUMN_NS)
        except SiloError:
            return  # trends then fill as time goes by; a lost link is told by the banner
        store.take(past)
        self.table.live_changed()
        self.inspector.refresh()

    def plot_rows(self, chosen: Sequence[int]) -> None:
        from silo_tui.screens.plots.monitor import MonitorScreen

        rows = self.session.rows
        if chosen:
            names = self.session.table.names
            under_cursor = names[rows.row] if rows.row is not None else ""
            plotted = [names[row] for row in chosen]
            self.show_plots(MonitorScreen(self.session, plotted, under_cursor))
        else:
            self.say("nothing to plot here")

    # ------------------------------------------------------------------------------------------------------ its edits

    def command_left(self) -> None:
        self._to_field_beside(-1)

    def command_right(self) -> None:
        self._to_field_beside(1)

    def _to_field_beside(self, step: int) -> None:
        """Choose another field, and say which: the line of a name space has no cells, and not all see colours."""
        self._field_chosen = True
        self._choose_field(self.table.field_beside(step))
        if now := self._values_of(self.table.field):
            self.say(f"{self.table.field.label}: {and_more(now, 3)}; {key_of('edit')} edits it")

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what starts a demo again."""
        again = self.session.dead and self.context.has_demo()
        ways = (("loggers", f"Loggers, then {key_of('demo')} Demo again"),)
        return (*(ways if again else ()), *super().mode_keys())

    def label_now(self, command: Command) -> str:
        """Return it; nothing to take back where nothing was edited."""
        return "" if command.id == "undo" and not self.session.table.undoes else super().label_now(command)

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
        given = " ".join(typed.arguments[1:]).removeprefix("= ")
        self.derive(typed.first, given or ("" if typed.first else self._derived_of_here()))

    def _derived_of_here(self) -> str:
        """Return what a derived signal is of at first: the signal under the cursor, or two that are marked."""
        rows, table = self.session.rows, self.session.table
        names = [table.names[row] for row in rows.targets()]
        if len(names) == 1 and (entry := rows.entry_alone(row := rows.targets()[0])) is not None:
            names = [table.entry_names(row)[entry]]
        return " * ".join(self.session.short_name(name).lstrip("/") for name in names) if len(names) <= 2 else ""

    def derive(self, name: str = "", expression: str = "") -> None:
        """Make a derived signal, or change the one of that name; what isn't said is asked for."""
        from silo_tui.model.table import derived
        from silo_tui.screens.dialogs.derive import ask_derived

        one = derived.named(self.session.table, name)
        one = msgspec.structs.replace(one, expression=expression) if expression else one
        self.context.run_flow(ask_derived(self.context, self.session, one, is_whole=bool(name and expression)))

    def _entry_here(self) -> tuple[int, int, str] | None:
        """Return element, entry and name of the signal under the cursor; says so where there is none.

        The row of a vector is the vector, whose limits are of all its entries.
        """
        rows, row = self.session.rows, self.session.rows.row
        entry = rows.entry_alone(row) if row is not None and rows.entry is None else rows.entry
        if row is not None and self.session.table.elements[row].entries:
            names = self.session.table.entry_names(row)
            return row, entry or 0, self.session.table.names[row] if entry is None else names[entry]
        self.say("limits are of one element: go to its line")
        return None

    def command_limits_of_row(self) -> None:
        if len(self.session.rows.targets()) > 1:
            names, rows = self.session.table.names, self.session.rows
            self.sure_of_hidden(lambda: self._ask_limits([names[row] for row in rows.targets()]))
        elif (here := self._entry_here()) is not None:
            self._ask_limits([here[2]])

    def _of_this_alone(self) -> str:
        """Return that what comes is about the row under the cursor, where others are marked."""
        rows, count = self.session.rows, len(self.session.rows.targets())
        chosen = "in the range" if rows.anchor is not None else "that are marked"
        return f"Of the element under the cursor alone, not of the {count} {chosen}." if count > 1 else ""

    def command_last_capture(self) -> None:
        from silo_tui.screens.files.opened import open_last_capture  # no first screen waits for it

        open_last_capture(self, self.session)

    def command_arm_trigger(self) -> None:
        from silo_tui.screens.lists.triggers import arm_only  # as above

        arm_only(self, self.session.triggers)

    def command_new_of_row(self) -> None:
        if self.session.rows.row is None:  # a name space, or nothing: a trigger is of any signals
            self.context.run_flow(self._make_trigger(""))
            return
        if (here := self._entry_here()) is None:
            return
        row, entry, name = here
        choices = [
            Choice("trigger", "A trigger", "t"), Choice("limits", "Limits", "l"),
            Choice("derived", "A signal derived from it", "d"),
        ]  # fmt: skip
        question = Question(f"New for {self.session.short_name(name)}?", self._of_this_alone(), choices)
        alone = self.session.table.entry_names(row)[entry]  # a condition is of numbers
        ask(self, question, lambda answer: self._make(answer, name if answer == "limits" else alone))

    async def _make_trigger(self, name: str) -> None:
        from silo_tui.screens.dialogs.trigger_editor import ask_trigger

        made = await self.session.new_trigger(name) if name else new_trigger()
        await ask_trigger(self.context, made)

    def _make(self, answer: str, name: str) -> None:
        """Ask for a trigger, limits or a derived signal, over the table."""
        if answer == "trigger":
            self.context.run_flow(self._make_trigger(name))
        elif answer == "derived":
            self.derive("", self.session.short_name(name).lstrip("/"))
        elif answer == "limits":
            self._ask_limits([name])

    def _ask_limits(self, names: Sequence[str]) -> None:
        from silo_tui.screens.dialogs.form import told
        from silo_tui.screens.dialogs.limits import ask_limits

        self.context.run_flow(ask_limits(self.context, names, partial(told, self.context, place="alarms")))

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

    def command_edit_field(self, name: str) -> None:
        self.edit_field(Field[name])

    def _edit_field(self, field: Field) -> None:
        self._choose_field(field)
        targets = self.session.rows.targets()
        # of what is edited, not of the cursor's row, which needn't be marked
        value = self.session.table.value(field, targets[0])
        if field is Field.ENABLED:
            cycle = [int(word.value) for word in field.option.words]
            self._set(field, cycle[(cycle.index(value) + 1) % len(cycle)])
        elif field.cycles:
            self._choose_value(field, value)
        else:
            self._open_editor("" if len(self._values_of(field)) > 1 else str(value), select=True)

    def _choose_value(self, field: Field, value: int) -> None:
        """Let one of a few values be chosen from a list."""
        words = field.option.words
        choices = [Choice(str(int(each.value)), phrase_for(field, int(each.value)), each.word[0]) for each in words]
        title = f"{field.label} of {self.session.rows.targets_words}"
        question = Question(title, f"now {and_more(self._values_of(field), 3)}", choices, str(value))
        ask(self, question, lambda answer: self._set(field, int(answer)))

    def _open_editor(self, value: str, *, select: bool) -> None:
        if self.table.field not in self.table.field_spans():
            self.show_set("settings")  # in which one sees what is edited
        about, row = self.session.rows.targets_words, self.session.rows.row  # before the cursor goes there
        if self.session.rows.move_to_target():  # the editor lies over a row that is edited
            self._came_from = row
            self.context.table_changed()
        field = self.table.field
        words = "" if select else "; or words: div=5 size=10s buf=loop"  # what begins with = may be of several fields
        now = self._values_of(field)
        differ = f", now {and_more(now, 3)}" if select and len(now) > 1 else ""
        self.query_one(CellEditor).open(field, value, select=select)
        self._place_editor()
        hidden = "" if field in self.table.field_spans() else f" (its column is not shown: {key_of('columns')})"
        self.info.ask(f"{field.label} of {about}{differ}{hidden}, e.g. {examples(field.option)}{words}")
        self.query_one(KeyBar).show_instead(EDITOR_KEYS)

    def _place_editor(self) -> None:
        """Lay the editor, where it is open, over the cell under the cursor, wherever that is now."""
        editor = self.query_one(CellEditor)
        if not editor.display:
            return
        region = self.table.cell_region()
        if not editor.select_on_focus:
            region = Region(max(0, min(region.x, self.size.width - WORDS_WIDTH - 2)), region.y, WORDS_WIDTH, 1)
        editor.lie_over(region)

    def on_element_table_moved(self) -> None:
        """Have the editor of a cell go with its row."""
        super().on_element_table_moved()
        self._place_editor()

    def _back_to_table(self) -> None:
        """Go back to the row of the cursor, where the editor lay over another one."""
        row, self._came_from = self._came_from, None
        if row is not None and self.session.rows.move_to_row(row):
            self.context.table_changed()
        super()._back_to_table()

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
        return (command_id in FIELDS_BY_COMMAND and self.session.why_fixed()) or super().why_not_now(command_id)

    def value_now(self, command_id: str) -> str:
        """Return the value that a command would change, or that those that it is about have several."""
        field = FIELDS_BY_COMMAND.get(command_id)
        if command_id == "arm_trigger":
            there = self.session.triggers
            return there[0].options.name if len(there) == 1 else many(len(there), "trigger")
        if command_id == "new_of_row" and len(self.session.rows.targets()) > 1:
            return "of one element"  # whatever is marked
        if field is None:
            return super().value_now(command_id)
        found = self._values_of(field)
        return (found[0] if len(found) == 1 else "differ") if found else ""

    def _values_of(self, field: Field) -> list[str]:
        """The different values of what is edited, in words."""
        values = dict.fromkeys(self.session.table.value(field, at) for at in self.session.rows.targets().tolist())
        return [phrase_for(field, each) for each in values]

    def _set(self, field: Field, value: int) -> None:
        if self.repeated in FIELDS_BY_COMMAND:
            self.repeats = lambda: self._again(lambda: self._set(field, value))
        targets = self.session.rows.targets()
        changed = self.session.table.edit(targets, field, value)
        words = f"{field.label} {phrase_for(field, value)}: {changed} changed{self.session.rows.not_here}"
        self._edited(words if changed else f"{field.label} is {phrase_for(field, value)} already")

    def command_set(self, typed: Spelled) -> None:
        if not typed.arguments:
            raise ValueError("set what? for example `:set div=5 buf=loop size=10s act=both on=yes`")
        begin = next((at for at, word in enumerate(typed.arguments) if "=" in word or is_setting(word)), 0)
        wanted, named = read_settings(typed.arguments[begin:]), typed.arguments[:begin]
        if named:
            self._set_all(wanted, named)
        else:
            self.sure_of_hidden(lambda: self._set_all(wanted))

    def _set_all(self, wanted: ElementSettings, named: Sequence[str] = ()) -> None:
        try:
            changed = self.session.change(wanted, named)
        except (ValueError, SiloError) as error:
            self.context.fail(str(error))
            return
        takes = f"{key_of('undo')} takes {'it' if changed == 1 else 'them'} back"
        words = f"{many(changed, 'field')} changed{self.session.rows.not_here}; {takes}"
        self._edited(words if changed else "that is so already")

    def _edited(self, words: str) -> None:
        if self.session.rows.filter.text or self.session.rows.sort not in STEADY:
            self.session.rows.refresh()
        self.say(words)
        self.table_changed()

    def command_undo(self) -> None:
        label = self.session.table.undo() or ""
        again = f"; wanted back, not applied yet: {key_of('apply')}" if label.startswith(APPLIED) else ""
        waits = f"; {key_of('discard')} drops what is pending" if self.session.table.pending_count[0] else ""
        more = f"; {key_of('undo')} again: {left}" if (left := self.session.table.undoes) else "; no more to undo"
        self._edited(f"undone: {label}{again}{more}" if label else f"nothing to undo{waits}")

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
        back = f"{key_of('undo')} brings {'it' if count == 1 else 'them'} back"
        self._edited(f"{many(count, 'edit')} discarded; {back}" if count else "nothing is pending here")

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
        so = "that is so" if "=" in words else f"{label} is {value.strip()}"
        self._edited(f"{label}: {changed} changed" if changed else f"{so} already")
        return True
