"""What differs between two logs, as a list; Enter plots a signal of both."""

import asyncio
from collections.abc import Sequence

from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from silo.analysis.compare import Comparison, SignalDifference, compare
from silo.analysis.log import Log
from silo_tui.context import SiloScreen
from silo_tui.modal import run_alone
from silo_tui.model.lists import runs as rows
from silo_tui.model.lists.recordings import fitting_stems
from silo_tui.model.words.names import below, first_levels, without_prefix
from silo_tui.screens.files.opened import show_read
from silo_tui.screens.lists.list_screen import ListScreen, Opener


async def show_differences(screen: SiloScreen, ways: Sequence[Opener]) -> None:
    """Compare two logs, and show what came of it."""

    def read() -> tuple[list[tuple[str, Log]], Comparison]:
        logs = [(name, way()) for name, way in ways]
        return logs, compare(logs[0][1], logs[1][1])

    with screen.context.telling(f"{' and '.join(name for name, _ in ways)} can't be compared"):
        logs, found = await asyncio.to_thread(read)
        screen.say("")
        screen.app.push_screen(ComparisonScreen(logs, found))


class ComparisonScreen(ListScreen[SignalDifference]):
    """What differs between two runs, a line for each signal."""

    scope = "comparison"
    orders = rows.COMPARED
    filter_hint = "words of a name"

    def __init__(self, logs: Sequence[tuple[str, Log]], found: Comparison) -> None:
        super().__init__()
        self._logs, self._found, self._prefix = logs, found, logs[0][1].recording.prefix

    def named(self, key: str) -> str:
        return below(self._prefix, key)

    def above(self) -> ComposeResult:
        yield Static("", id="compared-title", markup=False)

    def begin(self) -> None:
        """Keep all that is to be said of it among what was: below the list there may be no room for it."""
        for words in reversed(self._notes):  # as messages stand, the newest first
            self.context.note(words)

    @property
    def all(self) -> Sequence[SignalDifference]:
        return self._found.rows

    def key_of(self, one: SignalDifference) -> str:
        return one.name

    def told(self, one: SignalDifference) -> str:
        return f"{one.name} {one.unit}"

    def prepare(self, found: Sequence[SignalDifference], width: int) -> None:
        names = [name for name, _ in self._logs]
        short = fitting_stems(names, self._logs[0][1].recording.logger, (width - len(" , then ")) // 2)
        self.query_one("#compared-title", Static).update(f" {', then '.join(short[name] for name in names)}")
        self._table = rows.Differences(found, self._prefix, max(40, width) - 3)

    def head(self, width: int) -> str:
        return f"  {self._table.head}"

    def row_of(self, one: SignalDifference, width: int) -> Text:
        return Text(f"  {self._table.row(one)}", no_wrap=True)

    @property
    def _notes(self) -> Sequence[str]:
        found = self._found
        levels = first_levels([*found.only_a, *found.only_b, *found.not_compared, *found.partly], self._prefix)
        return [found.counted, *(without_prefix(each, self._prefix, levels) for each in found.notes)]

    def words(self) -> str:
        more = "`silo compare` in a shell has options: from an event on, within a tolerance, as a plot"
        return "\n".join([*self._notes, more])

    def none(self) -> str:
        return "Nothing differs."

    def command_plot_compared(self) -> None:
        if (one := self.here()) is not None:
            run_alone(self, "opening", self._plot, one.name, one.at_s)

    async def _plot(self, name: str, at_s: float) -> None:
        """Plot a scalar of both where they differ most, as its line says."""
        with self.context.telling(f"{self.named(name)} of these runs can't lie over each other"):
            found = await asyncio.to_thread(rows.of_one, self._logs, name)
            if found is None:
                self.say(f"{self.named(name)} is derived, and stands in no file: plot the signals that it is of")
                return
            made = Log(found.recording, " + ".join(run for run, _ in self._logs))
            at_ns = min(found.start_ns + round(1e9 * at_s), int(found.recording.time_ns[-1]))  # of steps that are wider
            await show_read(self.context, lambda: made, f"{self.named(name)} can't be shown", found.names, at_ns)

    enter = command_plot_compared
