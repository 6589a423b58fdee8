"""A dialog of labelled lines, with what it says of them below: Tab goes to the next, Enter answers, Esc leaves."""

import re
from abc import abstractmethod
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from functools import cached_property
from heapq import nsmallest
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, cast

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.await_complete import AwaitComplete
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Static

from silo.errors import ExpressionError, SiloError
from silo.expressions.operations import FUNCTIONS
from silo.expressions.parsing import LOGIC
from silo_tui.actions import BY_ID, key_of
from silo_tui.modal import Dialog, run_alone
from silo_tui.sessions.link import refusal
from silo_tui.widgets.inputs import NamingLine, tell_apart
from silo_tui.widgets.lines import CURSOR

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo_tui.context import Context
    from silo_tui.model.table.state import TableState

ResultT = TypeVar("ResultT")

NUMBER = f"signals, numbers with units, + - * ** and a / with blanks, {' '.join(FUNCTIONS)}"
CONDITION = f"the condition: signals, numbers with units, and or not, {' '.join(FUNCTIONS)}"


SMALL = 0.6  # the level of an example
LEFT = "as it was left; Esc, then the same key again, begins anew"
# the last name of an expression that is being typed, or what may become one: what follows a number is its unit
_LAST_NAME = re.compile(r"(?<![\w./])(?<!\d )/?([^\W\d][\w./]+)$")


def hints_with(hints: Mapping[str, str], table: "TableState") -> dict[str, str]:
    """Return hints with names of numbers that are logged in the place of `{0}` and `{1}`: short ones, to fit in.

    Of small numbers rather than of large ones, as gains: `abs({0}) > 0.6` is not to hold all the time.
    """
    newest = table.facts.of("value", len(table))
    numbers = (
        (newest is not None and abs(newest[row]) > SMALL, len(element.name + entry.suffix), element.name + entry.suffix)
        for row, element in enumerate(table.elements[: table.own])
        for entry in element.entries
        if entry.dtype[1:2] == "f"
    )
    shortest = [table.shown(name).lstrip("/") for *_, name in nsmallest(2, numbers)] or ["a"]
    return {name: hint.format(shortest[0], shortest[-1]) for name, hint in hints.items()}


def names_in(table: "TableState") -> list[str]:
    """Return the names of all signals, as they are shown."""
    names: dict[str, None] = {}
    for element in table.elements:
        entries = [element.name + entry.suffix for entry in element.entries]
        names |= dict.fromkeys(table.shown(name).lstrip("/") for name in (element.name, *entries))
    return list(names)


def named_whole(typed: str, names: Sequence[str]) -> list[str]:
    """Return what an expression becomes with its last name made whole; nothing where that is one already."""
    if (found := _LAST_NAME.search(typed)) is None:
        return []
    last, before = found[1], typed[: found.start(1)]
    if last in FUNCTIONS or last in LOGIC or any(f"/{name}".endswith(f"/{last}") for name in names):
        return []
    return [before + name for name in names if name.startswith(last)]


class Form(Dialog[ResultT | None], Generic[ResultT]):
    """Answers with what the lines make on Enter, None on Esc; what makes no sense is said, and they stay.

    While one types that is quiet: what isn't finished is no mistake yet. What was typed and not taken stands there once
    more when the form opens on the same thing the next time.
    """

    AUTO_FOCUS = ""  # Textual gives the keys to the first field, before `start` is asked for
    AFTER_S: ClassVar[float] = 0.2  # since the last key, until what is typed is looked at
    EXPRESSION: ClassVar[str] = ""  # the label of a field that is one: mistakes of it have a place
    NAMING: ClassVar[Sequence[str]] = ()  # the labels of fields in which signals are named
    ABOUT: ClassVar[Mapping[str, str]] = {}  # what a field means, by its label: told of the one that has the keys
    NEEDED: ClassVar[Mapping[str, str]] = {}  # fields that must not stay empty, and what belongs there
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False),
        Binding("down", "app.focus_next", "Next field", show=False),
        Binding("up", "app.focus_previous", "Field before", show=False),
    ]

    def __init__(
        self,
        title: str,
        lines: Sequence[Sequence[str]],
        values: Mapping[str, str],
        hints: Mapping[str, str],
        problem: str = "",
        start: str = "",
        table: "TableState | None" = None,
    ) -> None:
        """`lines` have the labels of their fields from left to right; `problem` is why it was refused a moment ago.

        `start` has the keys at first. Signals of the `table` stand in hints, and are named.
        """
        super().__init__()
        self._start = start
        hints = hints_with(hints, table) if table is not None else hints
        self._table = table
        self._problem = problem
        self._given = {name: values.get(name, "").strip() for line in lines for name in line}
        self._refused = self._given if problem else None  # what was typed then
        # to what was typed and refused just now the first key is added, of all else it takes the place
        self.typed: Collection[str] = self._given if problem else ()
        self.about = (title, str(self._given))  # what it opens on, by which what was typed is kept
        self.begins_anew = False
        self._is_wrong = False  # what is said below: it is of what is typed no more as soon as that is another thing
        self._title, self._lines, self._values, self._hints = title, lines, values, hints

    @cached_property
    def _kept(self) -> dict[tuple[str, str], dict[str, str]]:
        """What was typed into forms of this logger and not taken, by what they opened on."""
        kept: dict[tuple[str, str], dict[str, str]] = cast(Any, self.app).context.session.typed_before
        return kept

    def compose(self) -> ComposeResult:
        if not self._problem and not self.begins_anew and (kept := self._kept.pop(self.about, None)):
            self._problem, self._values, self._refused = LEFT, kept, kept
        with Vertical(classes="dialog form"):
            yield Static(self._title, classes="dialog-title", markup=False)
            yield from self.above()
            for names in self._lines:
                with Horizontal(classes="form-line"):
                    for name in names:
                        yield Static(self._label(name), id=f"label-{name}", classes="form-label", markup=False)
                        yield self._line(name)
            if self.ABOUT:
                yield Static(self._about, id="form-about", classes="quiet", markup=False)
            yield Static("", id="form-told", markup=False)
            yield from self.below()

    @cached_property
    def _names(self) -> list[str]:
        """Those of the table as it was with the first key: they are not looked for with each."""
        return names_in(self._table) if self._table is not None else []

    def _line(self, name: str) -> Input:
        value, known = self._values.get(name, ""), f"form-{name}"
        options: Any = {"placeholder": self._hints[name], "id": known, "select_on_focus": name not in self.typed}
        if self._table is not None and name in self.NAMING:
            return NamingLine(lambda typed: named_whole(typed, self._names), value, **options)
        return Input(value, compact=True, **options)

    def above(self) -> ComposeResult:
        """Yield what stands above the lines."""
        yield from ()

    def below(self) -> ComposeResult:
        """Yield what stands below what is said."""
        yield from ()

    def on_mount(self) -> None:
        """Give the keys to a field, at once: the first picture shows it; and look at what is there."""
        for line in self.query(Input):
            tell_apart(line)
        if self._start:
            self.set_focus(self.field(self._start))
            self.look_soon()
        if self._problem:
            self.tell(self._problem, "quiet" if self._problem == LEFT else "failed")

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        self._start = str(event.widget.id).removeprefix("form-")
        for label in self.query(".form-label").results(Static):  # colours alone don't reach everybody
            name = str(label.id).removeprefix("label-")
            label.update(self._label(name))
            label.set_class(name == self._start, "here")
        for line in self.query("#form-about").results(Static):
            line.update(self._about)

    def _label(self, name: str) -> str:
        return f"{CURSOR if name == self._start else ' '}{name}"

    @property
    def _about(self) -> str:
        return f"{self._start}: {self.ABOUT[self._start]}" if self._start in self.ABOUT else ""

    def field(self, name: str) -> Input:
        """Return the line of a label."""
        return self.query_one(f"#form-{name}", Input)

    @property
    def fields(self) -> dict[str, str]:
        """What is typed, by label, without blanks around it; nothing of a dialog that was left."""
        return {str(line.id).removeprefix("form-"): line.value.strip() for line in self.query(Input)}

    @property
    def told_width(self) -> int:
        """The cells of a line of what is told."""
        return next((line.content_size.width for line in self.query("#form-told")), 80)

    def tell(self, words: str, style: str = "") -> None:
        """Say something of what is typed; the style is "quiet" or "failed", or as all else."""
        words, self._is_wrong = self._table.shown(words) if self._table is not None else words, bool(style)
        for line in self.query("#form-told").results(Static):  # none of a dialog that was left
            line.set_classes(style)
            line.update(Text(words))

    def on_input_changed(self, event: Input.Changed) -> None:
        """Look at it when the keys rest; it comes of a field that is made, too."""
        if event.value != self._values.get(str(event.input.id).removeprefix("form-"), ""):
            event.input.select_on_focus = False
        if self.fields != self._refused:
            self.changed()

    def changed(self) -> None:
        """Look at it when the keys rest: what was refused is another thing now."""
        self._problem, self._refused = "", None
        if self._is_wrong:
            self.tell("")
        self.look_soon()

    def look_soon(self) -> None:
        """Look at what is typed, once that rests."""
        self.once_settled("look", self.AFTER_S, lambda: run_alone(self, "look", self._look_now))

    async def _look_now(self) -> None:
        typed, style = self.fields, ""
        if typed and not self._problem:  # that stands until something is typed
            try:
                words = await self.look()
            except (SiloError, ValueError) as error:
                words, style = self.wrong(error), "quiet"
            if self.fields == typed:
                self.tell(words, style)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        self.answer()

    def answer(self) -> None:
        """Answer with what was made; why not stands until something is typed."""
        self.settle("look")
        self.workers.cancel_group(self, "look")
        for name, belongs in self.NEEDED.items():
            if not self.fields[name]:
                self.field(name).focus()
                self.refuse(f"'{name}' is empty: {belongs}")
                return
        try:
            made = self.made()
        except (SiloError, ValueError) as error:
            self.refuse(self.wrong(error))
        else:
            self.dismiss(made)

    def refuse(self, words: str) -> None:
        """Say why it can't be, until something else is typed."""
        self._problem, self._refused = words, self.fields
        self.tell(words, "failed")

    def dismiss(self, result: ResultT | None = None) -> AwaitComplete:
        """Leave with a result; without one what was typed is kept, once."""
        typed = self.fields
        if result is None and self._problem != LEFT and (self._problem or typed != self._given) and any(typed.values()):
            self._kept[self.about] = typed
        return super().dismiss(result)

    @abstractmethod
    async def look(self) -> str:
        """Return what the lines mean. SiloError or ValueError where that is nothing."""

    @abstractmethod
    def made(self) -> ResultT:
        """Return what the lines make: none that is needed is empty. SiloError or ValueError where that is nothing."""

    def wrong(self, error: Exception) -> str:
        """Return what is said of a mistake, of an expression under its line, which begins at the same cell."""
        if not (self.EXPRESSION and isinstance(error, ExpressionError)):
            return str(error)
        line = self.field(self.EXPRESSION)
        blank = line.region.x - self.query_one("#form-told").content_region.x
        first = len(line.value) - len(line.value.lstrip()) - int(line.scroll_offset.x)
        return f"{' ' * max(0, blank + first + error.at)}{'^' * (error.end - error.at)}\n{error.reason}"


async def taken(
    context: "Context",
    form: Callable[[ResultT | None, str], Form[ResultT]],
    send: Callable[[ResultT], Awaitable[None]],
    whole: ResultT | None = None,
) -> None:
    """Send what a form makes; where it is refused, show the form again, with what was typed and why.

    `form` makes it of what was typed last, None at first, and of why that was refused. What is `whole` is sent at once.
    """
    refused, problem = whole, await refusal(send(whole)) if whole is not None else ""
    if whole is not None and not problem:
        return
    dialog = form(refused, problem)
    begun = dialog._given
    while (answer := await context.app.push_screen_wait(dialog)) is not None:
        problem = await refusal(send(answer))
        if not problem:
            return
        refused, last = answer, dialog._start
        about, dialog = dialog.about, form(refused, problem)
        dialog.about = about
        dialog._start = last or dialog._start  # where one was, as why it was refused stands below it
        dialog.typed = [name for name, value in dialog._given.items() if value != begun[name]]


async def told(context: "Context", job: "Callable[[Client], str]", place: str) -> None:
    """Ask for something of conditions, and say what came of it, and the key of the list where it stands from now on."""
    said = await context.link.call(job)
    try:
        await context.session.refresh_conditions()
    finally:
        context.say(f"{said} ({key_of(place)} {BY_ID[place].label})")
