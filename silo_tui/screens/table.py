# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The main screen: the element table with its live columns, and everything that edits it."""

from typing import ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.timer import Timer
from textual.widgets import Input, Static

from silo.errors import SiloError
from silo.settings.words import Settings, apply_settings, examples
from silo_tui.actions import bindings_for
from silo_tui.model import command_line, text
from silo_tui.model import filter as filters
from silo_tui.model.columns import ColumnStore
from silo_tui.model.fields import Field, next_value, options_of, parse_change, phrase_for, rows_of
from silo_tui.model.live import Frame
from silo_tui.model.table import Rows
from silo_tui.screens.base import SiloScreen
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import Banner, InfoLine, KeyBar, StatusBar
from silo_tui.widgets.element_table import FIXED_WIDTH, ElementTable, TableHead
from silo_tui.widgets.inputs import CellEditor, Fleeting, Line
from silo_tui.widgets.inspector import Inspector
from silo_tui.widgets.live_pane import TREND, VALUE, LivePane

WIDE = 110
COLUMN_NS = 200_000_000
COLUMNS = 120
DEBOUNCE_S = 0.15
NAME_ROOM = 20
EDITOR_KEYS = "Enter sets it  Esc leaves it as it was"
FILTER_KEYS = "Enter keeps the filter  Tab completes  Esc clears it"
COMMAND_KEYS = "Enter does it  Tab completes  Esc leaves"


class TableScreen(SiloScreen):
    """Elements, their options, their newest values."""

    scope = "table"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("table")

    def __init__(self, session: Session, *, read_only: bool) -> None:
        super().__init__()
        self.session = session
        self._read_only = read_only
        self._inspector_wanted = True
        self._wish_timer: Timer | None = None

    def compose(self) -> ComposeResult:
        """Status, banner, table with live columns and inspector, information, keys."""
        session = self.session
        self.table = ElementTable(session)
        self.pane = LivePane(session, self.table)
        self.inspector = Inspector(session)
        self.status_bar = StatusBar(session, read_only=self._read_only)
        self.banner = Banner(session)
        self.info = InfoLine(session)
        self.live_head = Static("", id="live-head", markup=False)
        self.table_head = TableHead(self.table)
        yield self.status_bar
        yield self.banner
        with Horizontal(id="body"):
            with Vertical(id="left"):
                with Horizontal(id="heads"):
                    yield self.table_head
                    yield self.live_head
                with Horizontal(id="panes"):
                    yield self.table
                    yield self.pane
            yield self.inspector
        yield Static("", id="empty", markup=False)
        yield self.info
        yield Line(self._complete_filter, "words, globs, unit:Nm on:no div>1 dirty", "filter-line")
        yield Line(self._complete_command, "load save set goto sort data start stop help quit", "command-line")
        yield KeyBar("table", read_only=self._read_only)
        yield CellEditor(self._take_cell)

    def on_mount(self) -> None:
        """The table has the keys."""
        self.table.focus()
        self._lay_out(self.app.size.width)

    def on_resize(self, event: events.Resize) -> None:
        """Wide terminals show more."""
        self._lay_out(event.size.width)

    def _lay_out(self, width: int) -> None:
        inspector = self._inspector_wanted and width >= WIDE
        pane_width = 32 if width < 140 else min(64, 34 + (width - 130) // 3)
        self.inspector.display = inspector
        self.inspector.styles.width = pane_width
        value_width = VALUE if width < WIDE else 14 if width < 140 else 17 if width < 170 else 24
        self.pane.lay_out(value_width, trend=False)
        rest = width - (pane_width if inspector else 0) - self.pane.wanted_width - FIXED_WIDTH
        self.pane.lay_out(value_width, trend=width >= WIDE and rest - TREND - 1 >= NAME_ROOM)
        self.live_head.update(self.pane.head)
        self.live_head.styles.width = self.pane.wanted_width
        self.table_head.refresh()
        self.wish_soon()

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        """Rows, edits or marks changed."""
        self.table.rows_changed()
        self.table_head.refresh()
        self.pane.live_changed()
        self.inspector.refresh()
        self.info.refresh()
        self._show_emptiness()
        self.wish_soon()

    def status_changed(self) -> None:
        """State or link changed."""
        self.status_bar.update()
        self.banner.update()
        self.info.refresh()
        self.pane.live_changed()
        self.table.refresh()
        self.inspector.refresh()

    def live_changed(self, frame: Frame) -> None:
        """New values."""
        self.pane.live_changed()
        self.status_bar.update()
        if self.inspector.display:
            self.inspector.live_changed()
        store = self.session.columns
        if store.gapped and store.names:
            store.past_until_ns = None  # asked for once: the logger still has what was in the frames that got lost
            self.run_worker(self._fill(store, list(store.names)), group="history", exclusive=True)

    def second_passed(self) -> None:
        """Times go on."""
        self.status_bar.update()
        self.banner.update()

    def say(self, words: str) -> None:
        """The result of something."""
        self.info.say(words)

    def _show_emptiness(self) -> None:
        empty = self.query_one("#empty", Static)
        nothing = not len(self.session.rows.shown) and bool(len(self.session.table))
        empty.display = nothing
        if nothing:
            empty.update(f"No element passes the filter {self.session.rows.filter.text!r}. Esc clears it.")

    # ------------------------------------------------------------------------------------------------ the view

    def on_element_table_moved(self) -> None:
        """Cursor or scroll changed: other panes follow, the view soon."""
        self.pane.live_changed()
        if self.inspector.display:
            self.inspector.refresh()
        self.table_head.refresh()
        self.info.refresh()
        self.wish_soon()

    def wish_soon(self) -> None:
        """The view is opened anew when the rows on the screen have settled."""
        if self._wish_timer is not None:
            self._wish_timer.stop()
        self._wish_timer = self.set_timer(DEBOUNCE_S, self.wish_again)

    def wish_again(self) -> None:
        """Says what is on the screen."""
        if self.silo.upper_screen is not self:
            return
        table = self.session.table
        rows = [row for row in self.table.rows_on_screen() if table.server[Field.ENABLED, row]]
        plots: list[str] = []
        if self.pane.trend_width:
            plots = [table.entry_names(row)[0] for row in rows if table.is_live(row) and table.elements[row].entries]
        if self.inspector.display:
            plots += [name for name in self.inspector.plot_names() if name not in plots]
        row = self.session.rows.row
        names = [table.names[each] for each in rows]
        if row is not None and table.names[row] not in names and table.server[Field.ENABLED, row]:
            names.append(table.names[row])
        self.session.watch(ViewRequest(tuple(names), tuple(plots), COLUMN_NS))
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
            self.run_worker(self._fill(store, missing), group="history", exclusive=True)

    async def _fill(self, store: ColumnStore, names: list[str]) -> None:
        end = self.silo.source.end_ns
        try:
            past = await self.silo.source.history(names, end - COLUMNS * COLUMN_NS, end, COLUMN_NS)
        except SiloError:
            return  # trends then fill as time goes by; a lost link is told by the banner
        store.take(past)
        self.pane.live_changed()
        self.inspector.refresh()

    # -------------------------------------------------------------------------------------------------- moving

    def _move(self, position: int) -> None:
        self.session.rows.move_to(position)
        self.table.show_cursor()

    def command_down(self) -> None:
        self._move(self.session.rows.position + 1)

    def command_up(self) -> None:
        self._move(self.session.rows.position - 1)

    def command_top(self) -> None:
        self._move(0)

    def command_bottom(self) -> None:
        self._move(len(self.session.rows.shown) - 1)

    def command_half_down(self) -> None:
        self._move(self.session.rows.position + max(1, self.table.size.height // 2))

    def command_half_up(self) -> None:
        self._move(self.session.rows.position - max(1, self.table.size.height // 2))

    def command_left(self) -> None:
        self._choose_shown(-1)

    def command_right(self) -> None:
        self._choose_shown(1)

    def _choose_shown(self, step: int) -> None:
        shown = [field for field in self.table.fields if (field - self.table.field) * step > 0]
        if shown:
            self._choose_field(int(min(shown, key=lambda field: abs(field - self.table.field))))

    def _choose_field(self, number: int) -> None:
        self.table.field = Field(max(0, min(len(Field) - 1, number)))
        self.table.redraw_cursor()
        self.table_head.refresh()

    # ---------------------------------------------------------------------------------------- filter and marks

    def command_filter(self) -> None:
        self.query_one(KeyBar).show_instead(FILTER_KEYS)
        self.query_one("#filter-line", Line).begin(self.session.rows.filter.text)
        self.info.display = False

    def command_mark(self) -> None:
        self.session.rows.toggle_mark()
        self.table.redraw_cursor()
        self.command_down()

    def command_mark_shown(self) -> None:
        self.session.rows.mark_shown()
        self._marks_changed()

    def command_range(self) -> None:
        rows = self.session.rows
        if rows.anchor is None:
            rows.begin_range()
        else:
            self.say(f"range of {rows.end_range()} marked")
        self._marks_changed()

    def _marks_changed(self) -> None:
        self.table.refresh()
        self.info.refresh()

    def command_sort(self) -> None:
        self.say(f"sorted by {self.session.rows.next_sort()}")
        self.table_changed()

    def command_inspector(self) -> None:
        self._inspector_wanted = not self._inspector_wanted
        if self.app.size.width < WIDE:
            self.say(f"the inspector needs {WIDE} columns; this terminal has {self.app.size.width}")
        self._lay_out(self.app.size.width)

    def command_back(self) -> None:
        """Range, then filter, then marks; never pending edits."""
        rows = self.session.rows
        if rows.anchor is not None:
            rows.anchor = None
        elif rows.filter.text:
            rows.set_filter("")
        elif rows.marked_count:
            rows.clear_marks()
        self.say("")
        self.table_changed()

    # ------------------------------------------------------------------------------------------------- editing

    def command_edit(self) -> None:
        self.edit_field(self.table.field)

    def on_element_table_picked(self, event: ElementTable.Picked) -> None:
        """A click on the cursor's cell edits it."""
        self.action_command("edit")

    def edit_field(self, field: Field) -> None:
        """Steps a field on, or opens the editor over its cell."""
        rows = self.session.rows
        if rows.row is None:
            return
        self._choose_field(int(field))
        targets = rows.targets()
        # of what is edited, not of the cursor's row, which needn't be marked
        value = int(self.session.table.values[field, targets[0] if len(targets) else rows.row])
        if field.cycles:
            self._set(field, next_value(field, value))
        else:
            self._open_editor(str(value), select=True)

    def _open_editor(self, value: str, *, select: bool) -> None:
        field, count = self.table.field, len(self.session.rows.targets())
        self.query_one(CellEditor).open(field, self.table.cell_region(), value, select=select)
        self.info.ask(f"{field.label} of {text.plural(count, 'element')}: {examples(field.option)}")
        self.query_one(KeyBar).show_instead(EDITOR_KEYS)

    def command_toggle(self) -> None:
        self.edit_field(Field.ENABLED)

    def command_edit_divider(self) -> None:
        self.edit_field(Field.DIVIDER)

    def command_edit_size(self) -> None:
        self.edit_field(Field.BUFFER_SIZE)

    def command_next_buffer(self) -> None:
        self.edit_field(Field.BUFFER_TYPE)

    def command_next_action(self) -> None:
        self.edit_field(Field.ACTION)

    def command_edit_all(self) -> None:
        if self.session.rows.row is not None:
            self._open_editor("=", select=False)

    def _set(self, field: Field, value: int) -> None:
        targets = self.session.rows.targets()
        changed = self.session.table.edit(targets, field, value)
        self._edited(f"{field.label} {phrase_for(field, value)}: {changed} changed" if changed else "nothing to change")

    def change(self, targets: Rows, settings: Settings) -> int:
        """Edits `targets` as typed, all or none, in one undo step. ValueError says what is out of range."""
        table = self.session.table
        values = table.values
        elements = [(table.names[row], options_of(values[:, row])) for row in targets]
        made = apply_settings(settings, elements, self.session.status.frequency_hz)
        return table.edit_all(targets, rows_of(made))

    def _edited(self, words: str) -> None:
        if self.session.rows.filter.text or self.session.rows.sort not in {"name", "added"}:
            self.session.rows.refresh()
        self.say(words)
        self.table_changed()

    def command_undo(self) -> None:
        label = self.session.table.undo()
        self._edited(f"undone: {label}" if label else "nothing to undo")

    def command_redo(self) -> None:
        label = self.session.table.redo()
        self._edited(f"done again: {label}" if label else "nothing to do again")

    def command_discard(self) -> None:
        count = self.session.table.discard(self.session.rows.targets())
        self._edited(
            f"{text.plural(count, 'edit')} discarded; u brings them back" if count else "nothing is pending here"
        )

    def command_monitor(self) -> None:
        rows = self.session.rows
        chosen = rows.targets()
        if len(chosen):
            names = self.session.table.names
            self.silo.open_monitor([names[int(row)] for row in chosen], names[rows.row] if rows.row is not None else "")

    def command_refresh(self) -> None:
        self.silo.reload()

    # --------------------------------------------------------------------------------------------- typed lines

    def command_command(self) -> None:
        self.silo.learn_scripts()
        self.query_one(KeyBar).show_instead(COMMAND_KEYS)
        self.query_one("#command-line", Line).begin("")
        self.info.display = False

    def on_input_changed(self, event: Input.Changed) -> None:
        """The filter works while it is typed."""
        if event.input.id == "filter-line" and event.input.display:
            self.session.rows.set_filter(event.input.value)  # of keys that came at once, what they made
            self.table_changed()

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Enter in one of the lines; a cell was taken when it was checked."""
        self._back_to_table()
        if event.line.id == "filter-line":  # typed and entered at once, the line is gone before it says that it changed
            self.session.rows.set_filter(event.value)
            self.table_changed()
        if event.line.id == "command-line" and event.value.strip(": "):
            self.silo.run_command(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Esc in a line; in the filter it clears the filter too."""
        self._back_to_table()
        self.say("")
        if event.line.id == "filter-line":
            self.session.rows.set_filter("")
            self.table_changed()

    def _back_to_table(self) -> None:
        self.query_one(KeyBar).show_instead("")
        self.info.ask("")
        self.info.display = True
        self.info.refresh()
        self.table.focus()

    def _take_cell(self, value: str) -> bool:
        """Edits as typed; False, with the reason, when that can't be."""
        field = self.query_one(CellEditor).field
        try:
            changed = self.change(self.session.rows.targets(), parse_change(field, value))
        except ValueError as error:
            shown = f"? {str(error).removesuffix('; nothing was changed')}"  # which the open editor says
            self.info.ask(shown)
            if len(shown) > self.info.size.width:
                self.silo.fail(str(error))  # the line shows its beginning only
            return False
        self._edited(f"{field.label}: {changed} changed" if changed else "nothing to change")
        return True

    def _complete_filter(self, line: str) -> list[str]:
        head, _, last = line.rpartition(" ")
        units = sorted({element.unit for element in self.session.table.elements if element.unit != "-"})
        return [f"{head} {term}".lstrip() for term in filters.completions(last, units)]

    def _complete_command(self, line: str) -> list[str]:
        return command_line.complete(line, self.silo.command_words, self.silo.command_arguments(line))
