"""Edit the limits of a signal: a line each, and below how often they would have been violated in what is held."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from silo.conditions.requests import TriggerTried
from silo.core.arrays.columns import ColumnStore
from silo.core.conditions import SignalLimits, TriggerOptions
from silo.errors import SiloError
from silo.judging.checks import bind_limits, rule_of, table_catalogue
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import draw, plots_of
from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.lists.conditions import NOW, held_axis, tried_lines
from silo_tui.model.plots.limit_line import BOUNDS, fields_of, limits_of_fields
from silo_tui.model.plots.limits import between, lines_of
from silo_tui.model.plots.picture import LIMIT
from silo_tui.model.table.derived import present
from silo_tui.screens.dialogs.form import Form, taken
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo_tui.context import Context

LINES = (("signal",), ("LL", "L"), ("H", "HH"), ("persist", "hyst"), ("stale", "when"))
HINTS = {
    "signal": "e.g. {0}", **BOUNDS,
    "persist": "samples in a row: 1", "hyst": "ends so far inside: 0", "stale": "the same for, e.g. 0.5s",
    "when": "a condition that must hold",
}  # fmt: skip
HELP = "type a number into LL, L, H or HH (empty: no such bound), or a time into stale: so long it may stay the same"
STALE = "no bound: it is an alarm where it stays the same for so long"
TREND_LINES, MARKS = 4, 8  # the signal below: how tall, and cells of bounds beside it
TAKES_AWAY = "no bound and nothing stale: Enter takes the limits of it away"


@dataclass(frozen=True)
class LimitsWish:
    """What a signal is to have; `limits` None: none any more. `shown` is its short name."""

    shown: str
    name: str
    limits: SignalLimits | None


async def ask_limits(
    context: "Context", name: str, carry_out: "Callable[[Callable[[Client], str]], Awaitable[None]]"
) -> None:
    """Ask for limits of a signal, of which one without a name, with those that it has; `carry_out` sends the wish."""
    session, shown = context.session, context.session.short_name(name).lstrip("/")
    given = next((one.options for one in session.limits if name == one.limits), None)

    def form(wish: LimitsWish | None, problem: str) -> LimitsDialog:
        if wish is None:
            return LimitsDialog(session, shown, name, given)
        return LimitsDialog(session, wish.shown, wish.name, wish.limits, problem)

    def send(wish: LimitsWish) -> Awaitable[None]:
        made = wish.limits
        if made is None:
            return carry_out(lambda client: client._remove_limits(wish.name))
        return carry_out(lambda client: client._set_limits(made))

    await taken(context, form, send)


class LimitsDialog(Form[LimitsWish]):
    """Answers with the limits on Enter."""

    KEYS_HERE = "Enter Sets them  Tab Next field  → Edits what stands there  Esc Back"
    NAMING = ("signal", "when")
    AFTER_S = 0.5
    NEEDED: ClassVar = {"signal": "the name of a signal, as the table shows it"}
    ABOUT: ClassVar = {
        "signal": "a name as the table shows it",
        "LL": "red below this", "L": "yellow below this", "H": "yellow above this", "HH": "red above this",
        "persist": "so many samples in a row beyond a bound make an alarm: 1 at the first",
        "hyst": "an alarm ends only so far inside the bound, in its unit: calms one that flaps",
        "stale": "an alarm where the value stays the same for so long: 0.5s; empty: never",
        "when": "judged only while this holds, as controller/mode == WALK; empty: always",
    }  # fmt: skip

    def __init__(self, session: Session, shown: str, name: str, limits: SignalLimits | None, problem: str = "") -> None:
        """`name` is the whole name of the signal that is `shown`; without one it is to be typed."""
        title = f"Limits of {session.short_name(name) or 'a signal'} on {session.name}"
        given = {"signal": shown, **(fields_of(limits) if limits is not None else {})}
        super().__init__(title, LINES, given, HINTS, problem, "LL" if shown else "signal", session.table)
        self._session, self._shown, self._name = session, shown, name

    def made(self) -> LimitsWish:
        """Return what is typed; of another signal than it began with, what is not typed stays as that one has it."""
        fields, shown = self.fields, self.fields["signal"]
        is_same = shown == self._shown
        name = self._name if is_same and self._name else shown
        before = None if is_same else self._present(shown)
        limits = limits_of_fields(fields, before or SignalLimits(name))
        if any(bound is not None for bound in limits.bounds) or limits.stale_s:
            rule_of(limits)  # its bounds make sense together
            return LimitsWish(shown, limits.name, limits)
        if self._present(limits.name) is None:
            raise ValueError(HELP)
        return LimitsWish(shown, limits.name, None)

    def _present(self, shown: str) -> SignalLimits | None:
        known = [one.options for one in self._session.limits]
        short = self._session.short_name
        return next((one for one in known if shown in (one.name, short(one.name).lstrip("/"))), None)

    async def look(self) -> str:
        if not self.fields["signal"]:
            return HELP
        limits = self.made().limits
        if limits is None:
            return TAKES_AWAY
        (low, high), shown, table = between(limits.bounds), self.fields["signal"], self._session.table
        catalogue = table_catalogue(table.elements[: table.own], table.prefix, present(table))
        signal = bind_limits(limits, catalogue)[1][0]  # as Enter has it: a name, which may mean several values
        beyond = f"any({signal.expression.text} {{}})" if signal.width else f"{signal.expression.text} {{}}"
        tests = [beyond.format(f"< {low!r}")] if low is not None else []
        tests += [beyond.format(f"> {high!r}")] if high is not None else []
        if not tests:
            return STALE
        when = " or ".join(tests)
        wanted = TriggerOptions("new", f"({when}) and ({limits.when})" if limits.when else when)
        tried = await self._session.tried(wanted)
        width = self.told_width - MARKS + len(NOW)
        lasts = "one violation, begun before that"
        told = tried_lines(tried, width, "would have been violated", "beyond", lasts=lasts)
        return "\n".join([*told, *await self._trend(limits, shown, tried, width)])

    async def _trend(self, limits: SignalLimits, shown: str, tried: TriggerTried, whole: int) -> list[str]:
        """Return the signal as lines of dots below the axis of what was tried, over dashes where bounds are; beside
        each line stand the bounds that lie there, or beyond it.
        """
        session, source, (left, width) = self._session, self._session.source, held_axis(tried, whole)
        names, short = (limits.name, shown), session.short_name
        plots = plots_of(session.table.elements)
        plotted = next((each for each in plots if {each.name, short(each.name).lstrip("/")} & {*names}), None)
        window, end_ns = PlotWindow((tried.end_ns - tried.begin_ns) / SECOND_NS), tried.end_ns
        if plotted is None or not plotted.numeric or not window.span_ns or not source.is_live(plotted.element.name):
            return []
        store = ColumnStore([plotted.name], 2 * width, window.column_ns(2 * width))
        store.advance_to(end_ns // store.column_ns + 1)
        try:
            store.take(await source.history([plotted.name], end_ns - window.span_ns, end_ns, store.column_ns))
        except SiloError:
            return []  # how often they would have been violated is told without its curve
        picture = draw(store, window, plotted, width, TREND_LINES, source.period_ns(plotted.element.name))
        rows, beside = list(picture.lines), [""] * TREND_LINES
        for line in lines_of(limits.bounds, picture.axis, TREND_LINES):
            beside[line.line] += f" {line.mark}"
            if not line.beyond:  # dashed, behind the curve, as in the plots
                dashes = (LIMIT + BLANK) * width
                rows[line.line] = "".join(
                    dash if cell == BLANK else cell for cell, dash in zip(rows[line.line], dashes, strict=False)
                )
        return [f"{'':{len(left)}}{row}{marks}" for row, marks in zip(rows, beside, strict=True)]
