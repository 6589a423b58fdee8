# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The table of a logger: its elements with their live columns, and everything that edits them."""

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding

from silo.errors import SiloError
from silo.ipc.frames import Frame
from silo.settings.words import examples
from silo_tui.actions import bindings_for
from silo_tui.model import text
from silo_tui.model.columns import ColumnStore
from silo_tui.model.fields import Field, next_value, parse_change, phrase_for
from silo_tui.model.table_columns import LIVE_COLUMNS
from silo_tui.screens.elements import WIDE, ElementsScreen
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import LiveSource, Session
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar
from silo_tui.widgets.element_table import FLAGS, ElementTable
from silo_tui.widgets.inputs import CellEditor, Fleeting, Line
from silo_tui.widgets.inspector import Inspector
from silo_tui.widgets.live_pane import TREND, VALUE, LivePane

COLUMN_NS = 200_000_000
COLUMNS = 120
NAME_ROOM = 20  # a trend is shown only where names keep this
TABLE_WIDTH = FLAGS + sum(1 + column.width for column in LIVE_COLUMNS)
EDITOR_KEYS = "Enter sets it  Esc leaves it as it was"
COMMAND_KEYS = "Enter does it  Tab completes  Esc leaves"


class TableScreen(ElementsScreen):
    """Elements, their options, their newest values."""

    scope = "table"
    filter_hint = "words, globs, unit:Nm on:no div>1 dirty"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("table")

    def __init__(
        self,
        session: Session,
        run_command: Callable[[str], None],
        complete_command: Callable[[str], list[str]],
        *,
        read_only: bool,
    ) -> None:
        table = ElementTable(session, LIVE_COLUMNS)
        super().__init__(
            session,
            table,
            LivePane(session, table),
            Inspector(session),
            (StatusBar(session, read_only=read_only), Banner(session)),
            read_only=read_only,
        )
        self.source = LiveSource(session)
        self._run_command = run_command
        self._complete_command = complete_command

    def lines(self) -> ComposeResult:
        """Yield the command line and the editor that lies over a cell."""
        yield Line(self._complete_command, "load save set goto sort data start stop help quit", "command-line")
        yield CellEditor(self._take_cell)

    def inspector_width(self, width: int) -> int:
        """Return the cells of the inspector on a screen of `width` cells."""
        return 32 if width < 140 else min(64, 34 + (width - 130) // 3)

    def lay_out_pane(self, width: int, rest: int) -> None:
        """Give values more room on a wide screen; a trend where names keep theirs."""
        value_width = VALUE if width < WIDE else 14 if width < 140 else 17 if width < 170 else 24
        self.pane.lay_out(value_width, trend=False)
        rest -= self.pane.wanted_width + TABLE_WIDTH
        self.pane.lay_out(value_width, trend=width >= WIDE and rest - TREND - 1 >= NAME_ROOM)

    # ------------------------------------------------------------------------------------ what the app tells us

    def settings_changed(self) -> None:
        """Show the columns that are wanted."""
        self.table.choose_columns(self.context.settings.columns)
        self.table_head.refresh()

    def live_changed(self, frame: Frame) -> None:
        """Show new values; ask once for what was in frames that got lost: the logger still has it."""
        super().live_changed(frame)
        store = self.session.columns
        if store.gapped and store.names:
            store.past_until_ns = None
            self.run_worker(self._fill(store, list(store.names)), group="history", exclusive=True)

    # ------------------------------------------------------------------------------------------------ the view

    def request_view(self) -> None:
        """Say what is on the screen."""
        if self.context.upper_screen is not self:
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
        end = self.source.end_ns
        try:
            past = await self.source.history(names, end - COLUMNS * COLUMN_NS, end, COLUMN_NS)
        except SiloError:
            return  # trends then fill as time goes by; a lost link is told by the banner
        store.take(past)
        self.pane.live_changed()
        self.inspector.refresh()

    def command_left(self) -> None:
        self._choose_field(self.table.field_beside(-1))

    def command_right(self) -> None:
        self._choose_field(self.table.field_beside(1))

    def _choose_field(self, field: Field) -> None:
        self.table.field = field
        self.table.redraw_cursor()
        self.table_head.refresh()

    # ------------------------------------------------------------------------------------------------- editing

    def command_edit(self) -> None:
        self.edit_field(self.table.field)

    def on_element_table_picked(self, event: ElementTable.Picked) -> None:
        """Edit the cell under the cursor when it is clicked."""
        self.action_command("edit")

    def edit_field(self, field: Field) -> None:
        """Step a field on, or opens the editor over its cell."""
        rows = self.session.rows
        if rows.row is None:
            return
        self._choose_field(field)
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
        from silo_tui.screens.monitor import MonitorScreen

        rows = self.session.rows
        chosen = rows.targets()
        if len(chosen):
            names = self.session.table.names
            under_cursor = names[rows.row] if rows.row is not None else ""
            plotted = [names[int(row)] for row in chosen]
            self.app.push_screen(MonitorScreen(self.session, self.source, plotted, under_cursor))

    # --------------------------------------------------------------------------------------------- typed lines

    def command_command(self) -> None:
        self.context.learn_scripts()
        self.query_one(KeyBar).show_instead(COMMAND_KEYS)
        self.query_one("#command-line", Line).begin("")
        self.info.display = False

    def line_entered(self, event: Fleeting.Entered) -> None:
        """Carry out what was entered in the command line."""
        if event.line.id == "command-line" and event.value.strip(": "):
            self._run_command(event.value)

    def _take_cell(self, value: str) -> bool:
        """Edit as typed; False, with the reason, when that can't be."""
        field = self.query_one(CellEditor).field
        try:
            changed = self.session.change(parse_change(field, value))
        except ValueError as error:
            shown = f"? {str(error).removesuffix('; nothing was changed')}"  # which the open editor says
            self.info.ask(shown)
            if len(shown) > self.info.size.width:
                self.context.fail(str(error))  # the line shows its beginning only
            return False
        self._edited(f"{field.label}: {changed} changed" if changed else "nothing to change")
        return True
