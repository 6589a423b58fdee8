"""What is in a file: the table of a logger with other columns and without what edits."""

import math
import time
from collections.abc import Callable, Sequence

from silo.core.arrays.columns import ColumnStore
from silo_tui.modal import run_alone
from silo_tui.model.table.columns import FILE_COLUMNS
from silo_tui.model.table.facts import NOTHING
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.elements import ElementsScreen
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.element_table import TREND
from silo_tui.widgets.messages import MessageLine

VALUES = 96  # from this width values stand beside the table
TELLS_AFTER_S = 0.3


class FileTableScreen(ElementsScreen):
    """The elements of a file."""

    scope = "file"
    inspector_least = 34
    filter_hint = "words, globs, unit:Nm div>1 size>1000 buf:loop"

    def __init__(self, session: FileSession, leave: Callable[[], None] | None = None) -> None:
        super().__init__(session, FILE_COLUMNS)
        self.file = session
        self._top_wanted = False  # by who chose an order, until it is known
        self._leave = leave  # to what it was opened from

    def lay_out_table(self, width: int, rest: int) -> None:
        """Show values and trends where there is room: the inspector has the value too, and a plot."""
        room = rest >= VALUES
        rows = self.session.rows
        few = self.table.column_set != "values" or ((rows.live or rows.filter.measured) and not room)
        self.table.lay_out(12 if room else 8 * few, trend=room, bare=few)  # beside states, which leave room

    def request_view(self) -> None:
        """Read values and columns of what is on the screen."""
        if self.context.upper_screen is not self:
            return
        table, file = self.session.table, self.file
        rows = self.table.rows_on_screen()
        row = self.session.rows.row
        rows += [row] if row is not None and row not in rows else []
        file.read([table.names[each] for each in rows])
        source = file.source
        if self.table.shows_trends:
            trends = [name for each in rows if (name := table.drawn_name(each))]
            store = _empty_store(trends, 2 * TREND, source.begin_ns, source.end_ns)
            if not _alike(store, self.session.columns):
                run_alone(self, "trends", self._read_trends, store)
        if self.inspector.display and row is not None:
            begin, end = source.extent_ns([table.names[row]])
            names = self.inspector.plot_names() if end > begin else ()  # nothing to see of one sample
            store = _empty_store(names, 2 * max(8, self.inspector.plot_width), begin, end)
            if not _alike(store, self.inspector.store):
                run_alone(self, "plots", self._read_plots, store, begin, end)
        self.table_head.refresh()
        self.table.live_changed()
        self.inspector.refresh()
        self._measure()

    # ---------------------------------------------------------------------------------------- what has to be reckoned

    def _measure(self) -> None:
        """Reckon what filter, order and columns need and isn't known yet of this moment."""
        details = self.table.names_near_screen()
        if self.file.unmeasured(details, self.table.quantities):
            run_alone(self, "facts", self._measured, details)
        elif self.session.table.facts.time_ns not in (0, self.file.time_ns):
            self.session.table.facts = NOTHING  # of another moment, and nobody asks for them any more

    async def _measured(self, details: Sequence[str]) -> None:
        begun_s = time.monotonic()

        def tell(done: int) -> None:
            if self.file.reading or time.monotonic() - begun_s >= TELLS_AFTER_S:
                self._tell_reading(f"reading all samples: {done} of {len(self.session.table)} elements")

        try:
            await self.file.measure(details, self.table.quantities, tell)
        finally:  # also where something else is read in its place
            self._tell_reading("")
        rows = self.session.rows
        rows.refresh()
        if self._top_wanted:
            rows.move_to(0)
            self._top_wanted = False
        self.table_changed()
        self._show_filter()

    def _tell_reading(self, words: str) -> None:
        """Tell how far it is beside what was answered, which stands until the next key."""
        self.file.reading = words
        for line in self.walk_children(MessageLine):
            line.changed()

    def order_changed(self) -> None:
        """Show the order with what is known, and its column; what it needs is reckoned then."""
        super().order_changed()
        self._top_wanted = self.session.rows.live
        self._lay_out(self.app.size.width)

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Do what a key asks for; who moved on isn't taken to the top any more."""
        self._top_wanted = False
        super().action_command(command_id, typed)

    def statistics_words(self) -> str:
        return " of every sample in the file"

    # ------------------------------------------------------------------------------------------- trends and plots

    async def _read_trends(self, store: ColumnStore) -> None:
        await self._read(store, self.file.source.begin_ns, self.file.source.end_ns)
        self.session.columns = store
        self.table.live_changed()

    async def _read_plots(self, store: ColumnStore, begin_ns: int, end_ns: int) -> None:
        await self._read(store, begin_ns, end_ns)
        self.inspector.store = store
        self.inspector.refresh()

    async def _read(self, store: ColumnStore, begin_ns: int, end_ns: int) -> None:
        store.take(await self.file.source.history(store.names, begin_ns, end_ns, store.column_ns))

    # --------------------------------------------------------------------------------------------------- commands

    def on_element_table_picked(self) -> None:
        self.command_plot()

    def command_back(self) -> None:
        """Leave range, filter and marks; then the file, where it was opened from inside."""
        rows = self.session.rows
        if self._leave is None or rows.anchor is not None or rows.filter.text or rows.marked_count:
            super().command_back()
        else:
            self._leave()

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return how to go back, where there is something behind."""
        return super().mode_keys() or ((("back", "Back"),) if self._leave is not None else ())

    def plot_rows(self, chosen: Sequence[int]) -> None:
        from silo_tui.screens.plots.monitor import MonitorScreen

        names = [self.session.table.names[row] for row in chosen]
        names = [name for name in names if self.file.rows_of[name].samples]
        if names:
            self.show_plots(MonitorScreen(self.file, names))
        else:
            self.say("no samples of it in this file" if chosen else "nothing to plot")


def _empty_store(names: Sequence[str], columns: int, begin_ns: int, end_ns: int) -> ColumnStore:
    """Return room for all from `begin_ns` to `end_ns`."""
    return ColumnStore(names, columns, max(1, math.ceil((end_ns - begin_ns) / (columns - 1))))


def _alike(one: ColumnStore, other: ColumnStore) -> bool:
    return (one.names, one.count, one.column_ns) == (other.names, other.count, other.column_ns)
