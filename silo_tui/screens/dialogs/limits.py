"""Edit the limits of signals: a line each, and below how often they would have been violated in what is held."""

from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import astuple
from textual.widgets import Static

from silo.conditions.requests import TriggerTried
from silo.core.arrays.columns import ColumnStore
from silo.core.conditions import SignalLimits, TriggerOptions
from silo.core.quantities.writing import and_more, many
from silo.errors import SiloError
from silo.judging.checks import bind_limits, rule_of, scalar_names, table_catalogue
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import draw, plots_of
from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.lists.conditions import NOW, held_axis, tried_lines
from silo_tui.model.plots.limit_fields import BOUNDS, HYSTERESIS, fields_of, limits_of_fields
from silo_tui.model.plots.limits import between, lines_of
from silo_tui.model.plots.picture import LIMIT
from silo_tui.model.table.changes import patterns_of
from silo_tui.model.table.derived import present
from silo_tui.model.words.text import short
from silo_tui.screens.dialogs.form import Form, taken
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo_tui.context import Context

LINES = (("signal",), ("LL", "L"), ("H", "HH"), ("persist", "hyst"), ("stale", "when"))
HINTS = {
    "signal": "e.g. {0}", **BOUNDS,
    "persist": "samples in a row: 1", "hyst": f"{HYSTERESIS:.0%} of the range", "stale": "the same for, e.g. 0.5s",
    "when": "a condition that must hold",
}  # fmt: skip
HELP = "type a number into LL, L, H or HH (empty: no such bound), or a time into stale: so long it may stay the same"
STALE = "no bound: it is an alarm where it stays the same for so long"
TREND_LINES, MARKS = 4, 8  # the signal below: how tall, and cells of bounds beside it
TAKES_AWAY = "no bound and nothing stale: Enter takes the limits of it away"


@dataclass(frozen=True)
class LimitsWish:
    """What signals are to have, as they are `shown` in the form; `takes_away`: none any more."""

    shown: str
    limits: tuple[SignalLimits, ...]
    takes_away: bool = False


async def ask_limits(
    context: "Context", names: Sequence[str], carry_out: "Callable[[Callable[[Client], str]], Awaitable[None]]"
) -> None:
    """Ask for limits of signals, of which one without names, with those that they have; `carry_out` sends the wish."""
    session, table = context.session, context.session.table
    patterns = patterns_of(names, table.names[: table.own], table.prefix)
    called = {session.short_name(one).lstrip("/"): one for one in patterns}
    given = {shown: _present(session, shown) for shown in called}
    whole = {shown: one.name if (one := given[shown]) else name for shown, name in called.items()}
    alike = {one and astuple(one)[1:] for one in given.values()}
    first = next(iter(given.values()), None) if len(alike) == 1 else None

    def form(wish: LimitsWish | None, problem: str) -> LimitsDialog:
        if wish is None:
            return LimitsDialog(session, whole, first)
        return LimitsDialog(session, whole, None if wish.takes_away else wish.limits[0], problem, wish.shown)

    def send(wish: LimitsWish) -> Awaitable[None]:
        def each(client: "Client") -> str:
            if wish.takes_away:
                return and_more([client._remove_limits(one.name) for one in wish.limits], 1)
            return and_more([client._set_limits(one) for one in wish.limits], 1)

        return carry_out(each)

    await taken(context, form, send)


def _present(session: Session, shown: str) -> SignalLimits | None:
    """Return the limits that were given to what is called so."""
    known = [one.options for one in session.limits]
    return next((one for one in known if shown in (one.name, session.short_name(one.name).lstrip("/"))), None)


class LimitsDialog(Form[LimitsWish]):
    """Answers with the limits on Enter."""

    KEYS_HERE = "Enter Sets them  Tab Next field  → Edits what stands there  Esc Back"
    NAMING = ("signal", "when")
    AFTER_S = 0.5
    NEEDED: ClassVar = {"signal": "the name of a signal, as the table shows it"}
    ABOUT: ClassVar = {
        "signal": "a name as the table shows it; of several a pattern, legs/*/torque, or names with commas between",
        "LL": "red below this", "L": "yellow below this", "H": "yellow above this", "HH": "red above this",
        "persist": "so many samples in a row beyond a bound make an alarm: 1 at the first",
        "hyst": "an alarm ends only so far inside the bound, in its unit, so that noise is one alarm; 0: at the bound",
        "stale": "an alarm where the value stays the same for so long: 0.5s; empty: never",
        "when": "judged only while this holds, as controller/mode == WALK; empty: always",
    }  # fmt: skip

    def __init__(
        self,
        session: Session,
        whole: Mapping[str, str],
        limits: SignalLimits | None,
        problem: str = "",
        shown: str = "",
    ) -> None:
        """`whole` has whole names by what is shown of them; `shown` is what was typed instead, a moment ago."""
        self._session, self._whole, self._shown = session, whole, ", ".join(whole)
        given = {"signal": shown or self._shown, **(fields_of(limits) if limits is not None else {})}
        start = "LL" if given["signal"] else "signal"
        super().__init__(self._titled(given["signal"]), LINES, given, HINTS, problem, start, session.table)

    def _titled(self, shown: str) -> str:
        return f"Limits of {f'/{shown}' if shown in self._whole else shown or 'a signal'} on {self._session.name}"

    def changed(self) -> None:
        super().changed()
        self.query_one(".dialog-title", Static).update(self._titled(self.fields["signal"]))

    def made(self) -> LimitsWish:
        """Return what is typed; of other signals than it began with, what is not typed stays as those have it."""
        fields, shown = self.fields, self.fields["signal"]
        is_same = shown == self._shown
        words = self._whole if is_same else [word for each in shown.split(",") if (word := each.strip())]
        before = {word: _present(self._session, word) for word in words}
        limits = [
            limits_of_fields(fields, before[word] or SignalLimits(self._whole.get(word, word)), whole=is_same)
            for word in words
        ]
        if any(bound is not None for bound in limits[0].bounds) or limits[0].stale_s:
            rule_of(limits[0])  # its bounds make sense together
            return LimitsWish(shown, tuple(limits))
        gone = tuple(one for one, had in zip(limits, before.values(), strict=True) if had is not None)
        if not gone:
            raise ValueError(HELP)
        return LimitsWish(shown, gone, takes_away=True)

    async def look(self) -> str:
        if not self.fields["signal"]:
            return HELP
        wish, table = self.made(), self._session.table
        if wish.takes_away:
            return TAKES_AWAY
        limits = wish.limits[0]
        catalogue = table_catalogue(table.elements[: table.own], table.prefix, present(table))
        # as Enter has it: a name, which may mean several values
        signals = [(bind_limits(one, catalogue)[1][0], one.name) for one in wish.limits]
        names = {name for signal, given in signals for name in scalar_names(signal, catalogue, given)}
        (low, high), twice = between(limits.bounds), self._twice(wish.limits, names)
        if limits.hysteresis and not self.fields["hyst"]:
            twice = [
                f"an alarm ends {short(limits.hysteresis)} inside its bound: {HYSTERESIS:.0%} of the range",
                *twice,
            ]
        beyond = [
            f"any({one.expression.text} {{}})" if one.width else f"{one.expression.text} {{}}" for one, _ in signals
        ]
        tests = [each.format(f"< {low!r}") for each in beyond if low is not None]
        tests += [each.format(f"> {high!r}") for each in beyond if high is not None]
        if not tests:
            return "\n".join([STALE, *twice])
        when = " or ".join(tests)
        wanted = TriggerOptions("new", f"({when}) and ({limits.when})" if limits.when else when)
        tried = await self._session.tried(wanted)
        width = self.told_width - MARKS + len(NOW)
        lasts = "one violation, begun before that"
        told = tried_lines(tried, width, "would have been violated", "beyond", lasts=lasts)
        told[0] = f"any of {len(names)} signals: " * (len(names) > 1) + told[0]
        trend = await self._trend(limits, wish.shown, tried, width) if len(names) == 1 else []
        return "\n".join([*told, *trend, *twice])

    def _twice(self, limits: Sequence[SignalLimits], names: Collection[str]) -> list[str]:
        """Return that some of the scalars have other limits, too, which were given to another name."""
        given = {one.name for one in limits}
        others = [one for one in self._session.limits if one.name in names and one.limits not in given]
        if not others:
            return []
        of = dict.fromkeys(self._session.short_name(one.limits).lstrip("/") for one in others)
        count = many(len({one.name for one in others}), "signal")
        return [f"{count} would have two limits: those of {and_more(list(of), 2)} stay, too"]

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
