"""What the lists of triggers, alarms and parameters share: how they stand is asked for anew each second."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, TypeVar

from silo_tui.modal import run_alone
from silo_tui.model.lists.conditions import MOST_PLOTS
from silo_tui.model.words.names import fitting_names
from silo_tui.screens.lists.list_screen import LoggerList

Status = TypeVar("Status")

if TYPE_CHECKING:
    from silo.client.client import Client


class ConditionsScreen(LoggerList[Status]):
    """A list of how conditions stand, asked for anew each second while it is shown."""

    kinds: ClassVar[tuple[type, ...]] = ()  # of conditions, of which it tells what went with the program before

    def begin(self) -> None:
        self.ask()

    def ask(self) -> None:
        """Ask how they stand."""
        run_alone(self, "conditions", self._ask)

    async def _ask(self) -> None:
        if self.session.connected:
            await self.context.quietly(self.refresh_standing())
        self.show()

    async def refresh_standing(self) -> None:
        """Ask how all that is listed stands."""
        await self.session.refresh_conditions()

    async def carry_out(self, job: "Callable[[Client], str]") -> None:
        """Ask for something, and say what came of it: last, as keys are for what comes of it until then.

        The screen may be left meanwhile, so what came of it is told where one is.
        """
        said = await self.context.link.call(job)
        try:
            await self.refresh_standing()
        finally:
            self.show()
            self.marks.settle()
            self.context.say(said)

    @abstractmethod
    def signals_of(self, one: Status) -> Sequence[str]:
        """Return the elements that a line is about."""

    def fit(self, found: Sequence[Status], room: int) -> None:
        """Fit the names of all into so many cells: different ones stay different."""
        keys = list(map(self.key_of, found))
        fitted = fitting_names([self.named(key) for key in keys], room)
        self._room, self._names = room, {key: f"{fits:<{room}}" for key, fits in zip(keys, fitted, strict=True)}

    def advice(self) -> str:
        gone = self.session.lent.words(*self.kinds) if self.kinds else ""
        told = gone and f"Gone with the program before: {gone}; :restore sets them again"
        return "\n".join(filter(None, [super().advice(), told]))

    def show(self) -> None:
        super().show()
        if self.is_there:
            self.status_bar.update()

    def named(self, key: str) -> str:
        return self.session.short_name(key)

    def second_passed(self) -> None:
        super().second_passed()
        self.ask()

    def command_list_read(self) -> None:
        self.say("read again")
        self.ask()

    def command_plot_conditions(self) -> None:
        if targets := self.targets():
            self.plot([name for one in targets for name in self.signals_of(one)])

    def plot(self, found: Sequence[str]) -> None:
        """Plot the first of these that are signals of the table."""
        from silo_tui.screens.plots.monitor import MonitorScreen

        names = [name for name in dict.fromkeys(found) if self.session.source.element(name) is not None]
        if names:
            self.app.push_screen(MonitorScreen(self.session, names[:MOST_PLOTS]))
            if len(names) > MOST_PLOTS:
                self.context.say(f"the first {MOST_PLOTS} of {len(names)} signals: mark others to plot them")
        else:
            self.say("nothing of it can be plotted: it is no signal of the table")
