"""The table of a logger: its elements with their live columns, and everything that edits them."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from textual.app import ComposeResult

from silo.core.arrays.columns import ColumnStore
from silo.core.quantities.writing import wall_clock
from silo.errors import RefusedError, SiloError
from silo.rpc.frames import Frame
from silo_tui.actions import key_of
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.table.cells import statistic_head
from silo_tui.model.table.columns import LIVE_COLUMNS
from silo_tui.model.table.facts import STATISTICS
from silo_tui.model.table.fields import Field
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.editing import Editing
from silo_tui.screens.elements import WIDE
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.terminal import pace_of
from silo_tui.widgets.bars import KeyBar, left_a_file
from silo_tui.widgets.element_table import FLAGS, TREND
from silo_tui.widgets.inputs import CellEditor, Fleeting, Line

COLUMN_NS = 200_000_000
COLUMNS = 120
SURVEY_S, JUDGE_S = 1.0, 0.5
KEEP_S = 0.3  # after an edit, until it is kept
KEEP_SURVEY_S = 20.0  # of the minute that a helper process keeps statistics which nobody asks for
QUIET_S = 3.0  # so long after a key no row moves by itself
WIDE_SET = 150  # cells from which settings and statistics stand side by side
NAME_ROOM = 20  # a trend is shown only where names keep this
TABLE_WIDTH = FLAGS + sum(1 + column.width for column in LIVE_COLUMNS if not column.measured)
EMPTY = """{name} has no elements yet. In the program, before log.start():

    q = log.array("q", 6, unit="rad")    # an array that is logged: write q[:] = ...

and log.collect() once per tick of the loop."""
COMMAND_KEYS = "Enter does it  Tab completes  Esc leaves"


class TableScreen(Editing):
    """Elements, their options, their newest values."""

    scope = "table"
    filter_hint = ""

    def __init__(self, session: Session) -> None:
        self._typed_s = 0.0  # monotonic, of the last key
        self._order_wanted = False  # by who chose it, until what it is by was measured
        self._top_wanted = False  # then too, while no key says where the cursor is to be
        self._offered = False
        self._kept_version = -1
        self._surveying = False
        self._reset_wanted = False
        self._survey_s = 0.0
        self._no_survey = ""
        self._window = ""  # over how long the statistics are, as the head says it
        self._view: tuple[tuple[str, str], Callable[[], object]] | None = None  # filter and order; what takes it back
        super().__init__(session, LIVE_COLUMNS)

    def lines(self) -> ComposeResult:
        """Yield the command line and the editor that lies over a cell."""
        yield Line(self.context.runner.complete, "load save set goto sort data start stop help quit", "command-line")
        yield CellEditor(self._take_cell)

    @property
    def _filter_and_order(self) -> tuple[str, str]:
        return self.session.rows.filter.text, self.session.rows.sort

    def view_is_on(self, before: tuple[str, str], back: Callable[[], object]) -> None:
        """Have Esc take the view back that is shown; of several, one after another, what was before the first.

        `before` are filter and order of then.
        """
        if self._view is not None and self._view[0] == before:
            back = self._view[1]
        self._view = self._filter_and_order, back

    def command_back(self) -> None:
        """Leave a view with its order and columns, where no other filter or order was chosen since."""
        view, rows = self._view, self.session.rows
        is_on = view is not None and view[0] == self._filter_and_order and rows.filter.text
        if view is None or not is_on or self._inspector_opened or rows.anchor is not None:
            super().command_back()
            return
        self._view = None
        view[1]()
        self.say("")
        self.table_changed()

    def lay_out_table(self, width: int, rest: int) -> None:
        """Give values more room on a wide screen; a trend where names keep theirs."""
        narrow = width < WIDE and self.table.column_set == "settings"
        value_width = 17 if narrow else 11 if width < WIDE else 14 if width < 140 else 17 if width < 170 else 24
        self.table.lay_out(value_width, wide=width >= WIDE_SET, fill=not narrow)
        rest -= self.table.measured_width + TABLE_WIDTH
        if width >= WIDE and rest - TREND - 1 >= NAME_ROOM:
            self.table.lay_out(value_width, trend=True, wide=width >= WIDE_SET)

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
        is_shown = {*self._quantities, *self.session.rows.wanted()}.intersection(STATISTICS)
        if is_shown and self.session.connected and len(self.session.table) and now_s - self._survey_s >= KEEP_SURVEY_S:
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
            await self.session.survey(self.table.names_on_screen(), self._quantities, reset=reset)
        except RefusedError as refused:  # a logger of an older silo
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
        """Draw what was measured; a live order moves rows only while nobody is at the keys."""
        rows = self.session.rows
        window = statistic_head(self.table.sight, "", 9)
        if window != self._window:
            self._window = window
            self.table_head.refresh()
        is_known = self._order_wanted and rows.is_measured
        if is_known:
            rows.refresh()
            if self._top_wanted:
                rows.move_to(0)
            self._order_wanted = self._top_wanted = False
        if is_known or rows.filter.measured or (rows.live and now_s - self._typed_s >= QUIET_S):
            before, rows.held = self.table.rows_on_screen(), False
            rows.refresh(now_s if rows.filter.measured else None)
            self.table.rows_changed()
            if set(self.table.rows_on_screen()) - set(before):
                self._survey_s = 0.0  # nothing was measured of these yet
            self._show_filter()
            self.request_view_soon()
        self.table.live_changed()
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
        self._order_wanted = self._top_wanted = self.session.rows.live
        self._judge()

    def show_set(self, name: str) -> bool:
        """Show another set of live columns; False where there is none of that name."""
        known = super().show_set(name)
        self._survey_s = 0.0
        self._judge()
        return known

    def statistics_words(self) -> str:
        since_ns = self.session.table.facts.since_ns
        since = f" since {wall_clock(since_ns)}" if since_ns else ""
        return f" of every sample{since}; {key_of('zero')} from now"

    def command_zero(self) -> None:
        self._reset_wanted, self._survey_s = True, 0.0
        self._judge()
        self.say("statistics from now")

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        """Follow a change; keep what is pending, and offer once what an earlier start kept."""
        super().table_changed()
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

    # --------------------------------------------------------------------------------------------- typed lines

    def command_command(self) -> None:
        self.context.learn_scripts()
        self.query_one(KeyBar).show_instead(COMMAND_KEYS)
        self.query_one("#command-line", Line).begin("")
        self.info.display = False

    def line_entered(self, event: Fleeting.Entered) -> None:
        if event.line.id == "command-line" and event.value.strip(": "):
            self.context.runner.run(event.value)
