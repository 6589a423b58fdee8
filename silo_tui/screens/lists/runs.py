"""The runs of a folder of this machine, from its index: by words or what was measured; opened, compared, overlaid."""

import asyncio
import math
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from silo.analysis.compare import Comparison, SignalDifference, compare
from silo.analysis.log import Log
from silo.analysis.opening import open_log
from silo.core.quantities.writing import many
from silo.errors import SiloError
from silo.run_index.listed import ListedRun
from silo.run_index.runs import RunList, runs
from silo_tui.actions import key_of
from silo_tui.context import SiloScreen
from silo_tui.modal import ask, run_alone
from silo_tui.model.lists import runs as rows
from silo_tui.model.lists.ordering import Order
from silo_tui.model.lists.recordings import fitting_stems
from silo_tui.model.words.names import below, first_levels, fitted_among, without_prefix
from silo_tui.model.words.paths import typed_path
from silo_tui.screens.dialogs.questions import Prompt
from silo_tui.screens.files.opened import show_read
from silo_tui.screens.lists.list_screen import ComparesTwo, ListScreen, Opener

MOST_TICKS = 50_000_000  # their time stamps take 400 MB


class RunsScreen(ComparesTwo[ListedRun]):
    """A list of runs; columns more are statistics of theirs."""

    scope = "runs"
    orders = rows.ORDERS
    filter_hint = "words, or max(tau) > 30 and lost == 0"

    def __init__(self, folder: str) -> None:
        super().__init__()
        self._folder = folder
        self.found: RunList | None = None
        self.values: dict[str, dict[str, float]] = {}  # of columns more, by expression and path
        self._holding: set[str] | None = None  # those for which the filter's condition holds
        self._failed = ""
        self._far = ""  # how many files that are new were read

    def begin(self) -> None:
        self.command_list_read()

    def command_list_read(self) -> None:
        run_alone(self, "runs", self._read)

    async def _read(self) -> None:
        try:
            folder = typed_path("the folder", self._folder)
            self.found, self._failed = await asyncio.to_thread(runs, folder, told=self._is_at), ""
            for expression in list(self.values):
                del self.values[expression]  # which the runs that are there now may know nothing of
                self._add(expression)
        except (SiloError, OSError) as error:
            self._failed = str(error)
        self.show()

    def _is_at(self, done: int, total: int) -> None:
        """Take how far the reading is, of its thread."""
        self._far = f"\n{done} of {total} new files; each is read once"

    def second_passed(self) -> None:
        super().second_passed()
        if self.found is None:
            self.show()

    # ------------------------------------------------------------------------------------------------------- lines

    @property
    def all(self) -> Sequence[ListedRun]:
        return self.found if self.found is not None else ()

    def key_of(self, one: ListedRun) -> str:
        return one.facts.path

    def prepare(self, found: Sequence[ListedRun], width: int) -> None:
        """Know all paths: different ones never look alike."""
        self._widths = rows.widths(found, max(40, width), len(self.values))
        robots = {one.facts.robot for one in found}
        own = robots.pop() if len(robots) == 1 else ""  # of several a name says which one it is
        self._names = fitting_stems([one.facts.path for one in found], own, self._widths.name)

    def row_of(self, one: ListedRun, width: int) -> Text:
        values = [column[one.facts.path] for column in self.values.values()]
        words = Text("  " + rows.row(one, self._names[one.facts.path], self._widths, time.time(), values))
        if one.facts.problem:
            words.stylize("dim")
        return words

    def told(self, one: ListedRun) -> str:
        return rows.told(one)

    def passes(self, one: ListedRun) -> bool:
        return one.facts.path in self._holding if self._holding is not None else super().passes(one)

    def filter_by(self, words: str) -> None:
        """Take a condition for what holds by the index; while it is being typed what held before is shown."""
        if rows.is_condition(words):
            run_alone(self, "where", self._judge, words)
        else:
            self._holding = None
            super().filter_by(words)

    async def _judge(self, words: str) -> None:
        if self.found is not None:
            try:
                self._holding = {one.facts.path for one in await asyncio.to_thread(self.found.where, words)}
            except SiloError as error:
                self.say(str(error).splitlines()[0])
                return
            super().filter_by(words)

    def head(self, width: int) -> str:
        return rows.head(self._widths, list(self.values))

    def words(self) -> str:
        if self.found is None:
            return ""
        unread = sum(bool(one.facts.problem) for one in self.found)
        return f"{many(len(self.found), 'run')} in {fitted_among(self._folder, (), 40)}" + (
            f", {unread} can't be read" if unread else ""
        )

    def advice(self) -> str:
        if self._failed:
            return f"{self._folder}: {self._failed}"
        if self.found is None:
            return f"Reading what is known of {self._folder} …{self._far}"
        if len(self.found):
            return super().advice()
        return f"There is no run in {self._folder}. Save one, or look elsewhere: :runs FOLDER"

    def may_be(self, one: ListedRun) -> bool:
        return not one.facts.problem

    # ------------------------------------------------------------------------------------------ columns, opening

    def command_runs_column(self) -> None:
        body = "A statistic of each run: max(joints/tau), rms(imu/acc_z), a parameter. Again: takes it away."
        self.app.push_screen(
            Prompt("A column more", body, "", "e.g. max(joints/tau)", self._add_or_drop), self._ordered
        )

    def _add_or_drop(self, expression: str) -> None:
        """Raises SiloError for an expression that can't be understood."""
        expression = expression.strip()
        if self.values.pop(expression, None) is None and expression:
            self._add(expression)

    def _add(self, expression: str) -> None:
        if self.found is not None:
            numbers = self.found.values(expression)
            self.values[expression] = {one.facts.path: at for one, at in zip(self.found, numbers, strict=True)}

    def _ordered(self, _: str | None) -> None:
        """Let the newest column be an order too."""
        newest = list(self.values.values())[-1:]
        self.orders = (
            *rows.ORDERS,
            *(Order("value", "v", "value, the largest first", _by(one), True) for one in newest),
        )
        if self._order.name == "value":
            self._order = self.orders[-1 if newest else 0]
        self.show()

    def command_open_run(self) -> None:
        if (one := self.here()) is not None:
            is_long = one.facts.ticks > MOST_TICKS  # of days: the part under its name, which says that it is one
            read = partial(open_log, one.path) if is_long else one.open
            what, failed = f"opening {self._names[one.facts.path]}", f"{one.facts.path} can't be opened"
            self.context.open_over(self, what, show_read, self.context, read, failed)

    enter = command_open_run

    async def opener_of(self, one: ListedRun) -> Opener:
        return one.name, one.open

    async def compare_logs(self, ways: Sequence[Opener]) -> None:
        await show_differences(self, ways)

    def command_overlay_runs(self) -> None:
        targets = self.targets("no run is here")
        if len(targets) < 2:
            self.say(f"{key_of('list_mark')} marks runs: two or more lie over each other")
            return
        body = f"{many(len(targets), 'run')}, by the time since their start; or since the first event with these words:"
        prompt = Prompt("Overlay", body, "", "start")
        ask(self, prompt, lambda event: self._show_together(targets, event.strip()))

    def _show_together(self, targets: list[ListedRun], event: str) -> None:
        def read() -> Log:
            logs = [(one.name, one.open()) for one in targets]
            return Log(rows.together(logs, event), str(Path(self._folder) / " + ".join(one.name for one in targets)))

        what, failed = f"reading {many(len(targets), 'run')}", "these runs can't lie over each other"
        self.context.open_over(self, what, show_read, self.context, read, failed)


async def show_differences(screen: SiloScreen, ways: Sequence[Opener]) -> None:
    """Compare two logs, and show what came of it."""

    def read() -> tuple[list[tuple[str, Log]], Comparison]:
        logs = [(name, way()) for name, way in ways]
        return logs, compare(logs[0][1], logs[1][1])

    with screen.context.telling(f"{' and '.join(name for name, _ in ways)} can't be compared"):
        logs, found = await asyncio.to_thread(read)
        screen.context.make_room()
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
            self.context.open_over(self, f"plotting {self.named(one.name)}", self._plot, one.name, one.at_s)

    async def _plot(self, name: str, at_s: float) -> None:
        """Plot a scalar of both where they differ most, as its line says."""
        with self.context.telling(f"{self.named(name)} of these runs can't lie over each other"):
            found = await asyncio.to_thread(rows.of_one, self._logs, name)
            if found is None:
                self.say(f"{self.named(name)} is derived, and stands in no file: plot the signals that it is of")
                return
            made = Log(found.recording, " + ".join(run for run, _ in self._logs))
            stamps = found.recording.time_ns  # of steps that are wider
            at_ns = min(max(found.start_ns + round(1e9 * at_s), int(stamps[0])), int(stamps[-1]))
            await show_read(self.context, lambda: made, f"{self.named(name)} can't be shown", found.names, at_ns)

    enter = command_plot_compared


def _by(column: dict[str, float]) -> "rows.Key":
    return lambda one: -math.inf if math.isnan(column[one.facts.path]) else column[one.facts.path]
