"""Dialogs: a question with choices, a line to type, the `:` line over a screen that has none, the list of orders.

First stands what one most likely wants; where that loses or stops something, or is about many, what does nothing.
"""

import math
import re
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, ClassVar, cast

import msgspec
from rich.text import Text
from textual import events
from textual._time import get_time
from textual.app import App, ComposeResult
from textual.await_complete import AwaitComplete
from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.dom import DOMNode
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from silo.core.elements import FieldChange
from silo.core.quantities.writing import duration, size_text
from silo.errors import SiloError
from silo_tui.actions import key_of, key_text
from silo_tui.modal import Choices, Dialog, ask, run_alone
from silo_tui.model.lists.ordering import Order
from silo_tui.model.table.changes import Cost, groups_of
from silo_tui.model.table.columns import TableOrder
from silo_tui.model.table.state import PendingChange
from silo_tui.model.words.names import below, cells
from silo_tui.widgets.inputs import Fleeting, Line, tell_apart

MOVED_BY = "jkqG"  # letters that are bound
MOVES = "j k Move  PgDn PgUp Scroll  Esc Back"
MAX_LINES = 400
MAX_GROUPS = 60
LARGEST = 2  # groups: at 80x24 what they cost stands below them
AROUND = 4  # rows: a border, and below title and body; columns: a border, and beside all
WIDTH = 72
FOLLOWS_S = 1.0


class Choice(msgspec.Struct, frozen=True):
    """One answer; `key` picks it at once. `loses` tells whether something is gone by it.

    Without a value it does nothing, as Esc.
    """

    value: str
    label: str
    key: str = ""
    loses: bool = False


def _begin_of(label: str) -> str:
    """Return what a choice does, without what it tells beside that."""
    return re.split(r"[:;,(]", label)[0].strip()


class Question(Dialog[str | None]):
    """Asks; answers with the value of a choice, None on Esc. A long body scrolls."""

    asks = True
    KEYS_HERE = f"Enter Chooses  {MOVES}"

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape,q", "leave", "Back", show=False),
        Binding("pagedown,ctrl+d", "scroll(1)", show=False, priority=True),  # the choices would take them for theirs
        Binding("pageup,ctrl+u", "scroll(-1)", show=False, priority=True),
        Binding("home", "ends(False)", show=False, priority=True),
        Binding("end,G", "ends(True)", show=False, priority=True),
        Binding("j", "move(1)", show=False),
        Binding("k", "move(-1)", show=False),
    ]

    def __init__(
        self,
        title: str,
        body: Text | str,
        choices: Sequence[Choice],
        begin: str | None = None,
        about: Callable[[str], Awaitable[Text]] | None = None,
        newer: Callable[[], Awaitable[Sequence[Choice]]] | None = None,
    ) -> None:
        """`begin` has the focus at first, else the first choice. `about` tells more of one, below.

        `newer` returns the choices as they are by now, once a second: their words follow, which there are doesn't.
        """
        super().__init__()
        assert not {choice.key for choice in choices} & {*MOVED_BY}, "these move here, or leave"
        self._begin = next((at for at, choice in enumerate(choices) if choice.value == begin), 0)
        self._title = title
        self._body = body
        self._choices = list(choices)
        self.loses = any(choice.loses for choice in choices)
        self._about, self._newer = about, newer
        self.told = ""  # the choice that more is told of
        if choices:
            self.KEYS_HERE = self._keys(self._begin)

    def compose(self) -> ComposeResult:
        tall = self._about is not None
        with Vertical(classes="dialog tall" if tall else "dialog"):
            yield Static(self._title, classes="dialog-title", markup=False)
            if self._body and tall:
                yield Static(self._body, classes="quiet", markup=False)
            elif self._body:
                with VerticalScroll(classes="dialog-body", can_focus=False):
                    yield Static(self._body, markup=False)
            yield Choices(*(Option(self._line(choice), id=choice.value or None) for choice in self._choices))
            if tall:
                with VerticalScroll(classes="dialog-body", can_focus=False):
                    yield Static("", id="about", markup=False)

    def _line(self, choice: Choice) -> Text:
        line = Text(f" {choice.label}")
        if choice.key:
            line.append(f"  ({choice.key})", style="dim")
        return line

    def on_mount(self) -> None:
        self.query_one(OptionList).focus()
        self.query_one(OptionList).highlighted = self._begin if self._choices else None
        if self._about is None:  # before it is drawn: what comes a frame later comes late on a busy computer
            self._fit(self.app.size.height)
        self.call_after_refresh(self._drawn)
        if self._newer is not None:
            self.set_interval(FOLLOWS_S, partial(run_alone, self, "newer", self._follow, self._newer))

    async def _follow(self, newer: Callable[[], Awaitable[Sequence[Choice]]]) -> None:
        """Let the words of choices follow what they tell of; which there are, and their keys, stay."""
        labels = {choice.value: choice.label for choice in await newer()}
        for place, choice in enumerate(self._choices):
            label = labels.get(choice.value, choice.label)
            if label != choice.label:
                self._choices[place] = msgspec.structs.replace(choice, label=label)
                self.query_one(OptionList).replace_option_prompt_at_index(place, self._line(self._choices[place]))
        if self._about is None:  # longer words may take more lines
            self._fit(self.size.height)

    def may_lose(self, typed: events.Event) -> bool:
        """Whether it may: all but Esc, the keys of choices that lose nothing, and Enter where it begins with one."""
        harmless = {choice.key for choice in self._choices if choice.key and not choice.loses}
        first = self._choices[self._begin : self._begin + 1]
        keys = {"escape"} if any(choice.loses for choice in first) else {"escape", "enter"}
        return self.loses and not (isinstance(typed, events.Key) and (typed.key in keys or typed.character in harmless))

    def _drawn(self) -> None:
        self.drawn_s = get_time()

    def on_resize(self, event: events.Resize) -> None:
        """Let a long body scroll: the choices are always on the screen."""
        if self._about is None:
            self._fit(event.size.height)

    def _fit(self, height: int) -> None:
        choices, body = self.query_one(OptionList), self.query(".dialog-body")
        # as in silo.tcss, where they have none yet: the size of the screen may come before theirs
        width = max(1, choices.container_size.width or min(WIDTH, self.app.size.width * 96 // 100) - AROUND)
        title, *rows_of = (
            len(each.wrap(self.app.console, width)) for each in (Text(self._title), *map(self._line, self._choices))
        )
        room, rows = height * 9 // 10 - AROUND - title, sum(rows_of)
        for each in body:
            each.styles.max_height = max(3, room - rows)
        choices.styles.max_height = max(3, min(rows, room - (3 if body else 0)))

    def chosen_by(self, letter: str) -> str:
        return next((choice.label for choice in self._choices if choice.key and choice.key == letter), "")

    def on_key(self, event: events.Key) -> None:
        """Take a choice by its key; the screen below must not get it too."""
        for choice in self._choices:
            if choice.key and event.character == choice.key:
                event.stop()
                event.prevent_default()
                self.pick(choice.value)
                return
        if event.is_printable and event.character not in (*MOVED_BY, " "):
            cast(Any, self.app).gate.refused()
            self._show_keys(f"{event.character} is no answer here  ")

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        self.pick(self._choices[event.option_index].value)

    def pick(self, value: str) -> None:
        """Answer with a choice."""
        self.dismiss(value)

    def dismiss(self, result: str | None = None) -> AwaitComplete:
        """Leave; where one of the choices does nothing, and that was meant, say so."""
        nothing = next((_begin_of(choice.label) for choice in self._choices if not choice.value), "")
        if nothing and not result:
            cast(Any, self.app).context.say(f"{self._title} {nothing}: nothing was done")
        return super().dismiss(result or None)

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Say what Enter does now, and tell more of the choice under the cursor."""
        self._show_keys()
        if self._about is not None:
            run_alone(self, "about", self._tell, str(event.option.id), self._about)

    def _keys(self, at: int) -> str:
        return f"Enter {_begin_of(self._choices[at].label)}  {MOVES}"

    def _show_keys(self, before: str = "") -> None:
        """Show what the keys do here; `before` is what the one did that was pressed."""
        at = self.query_one(OptionList).highlighted or 0
        self.KEYS_HERE = before + self._keys(at)
        if (screen := cast(Any, self.app).context.upper_screen) is not None:
            screen.show_keys_above()

    async def _tell(self, value: str, about: Callable[[str], Awaitable[Text]]) -> None:
        self.told = ""
        self.query_one("#about", Static).update("…")
        self.query_one("#about", Static).update(await about(value))
        self.told = value

    def action_scroll(self, pages: int) -> None:
        """Move a long body; where there is none, choices that have no room."""
        bodies = self._long_bodies
        for body in bodies:
            body.scroll_relative(y=pages * max(1, body.size.height - 1), animate=False)
        options = cast(Any, self.query_one(OptionList))
        if not bodies and options.max_scroll_y > 0:
            (options.action_page_down if pages > 0 else options.action_page_up)()

    @property
    def _long_bodies(self) -> list[VerticalScroll]:
        return [body for body in self.query(".dialog-body").results(VerticalScroll) if body.max_scroll_y > 0]

    def action_ends(self, last: bool) -> None:
        """Go to the beginning or the end of a long body; where there is none, to the first or the last choice."""
        bodies = self._long_bodies
        for body in bodies:
            (body.scroll_end if last else body.scroll_home)(animate=False)
        options = self.query_one(OptionList)
        if not bodies:
            (options.action_last if last else options.action_first)()

    def action_move(self, step: int) -> None:
        """Go to another choice."""
        options = self.query_one(OptionList)
        (options.action_cursor_down if step > 0 else options.action_cursor_up)()


async def confirmed(
    app: App[Any], title: str, body: Text | str, label: str, harmless: str = "No", *, loses: bool = True
) -> bool:
    """Ask before something is done; what does nothing has the focus."""
    choices = [Choice("", harmless), Choice("yes", label, "y", loses)]
    return bool(await app.push_screen_wait(Question(title, body, choices)) == "yes")


class Prompt(Dialog[str | None]):
    """One line to type; None on Esc. What `check` raises is said, and the line stays."""

    KEYS_HERE = "Enter Takes it  Esc Back"

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False)
    ]

    def __init__(
        self,
        title: str,
        body: str,
        value: str = "",
        placeholder: str = "",
        check: Callable[[str], object] = lambda line: None,
        *,
        label: str = "",
    ) -> None:
        """`label` says of what stands in the line what it is."""
        super().__init__()
        self._check, self._label, self._title, self._body = check, label, title, body
        self._line = Input(value, placeholder=placeholder, compact=True)

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog"):
            yield Static(self._title, classes="dialog-title", markup=False)
            yield Static(self._body, classes="dialog-body", markup=False)
            with Horizontal(classes="form-line"):
                if self._label:
                    yield Static(self._label, classes="form-label")
                yield self._line
            yield Static("", id="line-problem", markup=False)

    def on_mount(self) -> None:
        tell_apart(self._line)

    def offer(self, value: str) -> None:
        """Offer a value that came later, be the line drawn or not, unless one is typed already."""
        if not self._line.value:
            self._line.value = value
            self._line.select_all()

    def _take(self, line: str) -> None:
        try:
            self._check(line)
        except (SiloError, ValueError) as error:
            self.query_one("#line-problem", Static).update(str(error))
        else:
            self.dismiss(line)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        self._take(event.value.strip())


def ask_line(of: DOMNode, prompt: Prompt, then: Callable[[str], object]) -> None:
    """Go on with the line that is typed; where it was left, or stays empty, nothing is done."""
    ask(of, prompt, lambda line: line and then(line))


def diff_text(changes: Sequence[PendingChange], prefix: str = "", cost: Text | None = None) -> Text:
    """Return pending edits as old → new, equal ones together; then what somebody else has changed meanwhile.

    `cost` stands behind the largest groups, where it is seen on a small terminal too.
    """
    groups = groups_of(changes, prefix)
    first = LARGEST if len(groups) > LARGEST + 1 else len(groups)  # one more takes the line that would tell of it
    lines = groups_text(changes, prefix, end=MAX_GROUPS if cost is None else first)
    if cost is not None:
        if rest := sum(group.count for group in groups[first:]):
            lines.append(f"and {rest} more, behind what all of it costs:\n", style="dim")
        lines.append_text(cost).append_text(groups_text(changes, prefix, first))
    for change in [change for change in changes if change.theirs is not None][:MAX_LINES]:
        name = below(prefix, change.name)
        lines.append(f"! {name}: {change.field} is {change.theirs} now, by somebody else\n", style="bold")
    return lines


def groups_text(changes: Sequence[FieldChange], prefix: str = "", begin: int = 0, end: int = MAX_GROUPS) -> Text:
    """Return changes in groups, the largest first: those from `begin` to `end`, and how many are listed nowhere."""
    lines = Text()
    groups = groups_of(changes, prefix)
    counted = len(str(groups[0].count)) if groups else 1
    for group in groups[begin:end]:
        lines.append(f"{group.count:>{counted}} × {below(prefix, group.pattern)}", style="bold")
        lines.append(f"  {group.words}\n")
    rest = sum(group.count for group in groups[MAX_GROUPS:]) if end == MAX_GROUPS else 0
    if rest:
        lines.append(f"and {rest} more\n")
    return lines


def end_words(end: str) -> str:
    """Return the sentence that logging will end by itself, where that is something new; a line of its own."""
    return f"{end[:1].upper()}{end[1:]}.\n" if end else ""


def cost_text(now: Cost, after: Cost, short_name: str, room_bytes: int = 0, *, stops: bool = False) -> Text:
    """Return what a table takes now and will take, with a sign at what gets worse; `held` is of what is edited.

    `room_bytes` are those that its buffers may take, 0 where that isn't known; more than these can't be started.
    `stops`: the logger will stop by itself before its memory is full.
    """
    lines = Text()
    lines.append(f"{'':<10}{'now':>16}{'after':>16}\n", style="dim")
    held = [_held(each) for each in (now, after)]
    memory = [size_text(each.memory_bytes) for each in (now, after)]
    room = f"of {size_text(room_bytes)} available" if room_bytes else ""
    over = bool(room_bytes) and after.memory_bytes > room_bytes
    _cost(lines, "memory", memory, after.memory_bytes > now.memory_bytes, room, over=over)
    disk = [size_text(each.recorded_bytes_s) + "/s" for each in (now, after)]
    _cost(lines, "recorded", disk, after.recorded_bytes_s > now.recorded_bytes_s, "while recording all")
    topics = [size_text(each.topic_bytes_s) + "/s" for each in (now, after)]
    _cost(lines, "topics", topics, after.topic_bytes_s > now.topic_bytes_s)
    note = f"the shortest: {short_name}" if short_name else ""
    until = "until it stops by itself" if stops else "until memory is full"
    note = until if math.isinf(after.shortest_s) else note
    _cost(lines, "held", held, after.shortest_s < now.shortest_s, note, sign="▼")
    return lines


def _held(cost: Cost) -> str:
    """Return for how long the edited signals are held, as one time or two, their unit once where it is seconds."""
    if not cost.shortest:
        return "nothing"
    shortest, longest = ("all" if math.isinf(each) else duration(each) for each in (cost.shortest_s, cost.longest_s))
    if shortest == longest:
        return longest
    return f"{shortest.removesuffix(' s')} … {longest}" if longest.endswith(" s") else f"{shortest} … {longest}"


def _cost(
    lines: Text, title: str, amounts: Sequence[str], worse: bool, note: str = "", *, over: bool = False, sign: str = "▲"
) -> None:
    old, new = amounts
    lines.append(f"{title:<10}{old:>16} {new:>15} ")
    lines.append("!! " if over else f"{sign}  " if worse and old != new else "   ", style="bold" if over else "")
    lines.append(f"{note}\n", style="bold" if over else "dim")


COLUMN = 32


class OrderDialog(Dialog[str | None]):
    """Answers with the order whose letter was pressed, also that of the present one; None on Esc."""

    KEYS_HERE = "a letter Orders by it  Esc Back"

    def __init__(self, orders: Sequence[Order[Any] | TableOrder], now: str, arrow: str) -> None:
        super().__init__()
        self._orders, self._now, self._arrow = orders, now, arrow

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog"):
            yield Static("Order by", classes="dialog-title", markup=False)
            yield Static(self._lines(), id="orders")

    def _lines(self) -> Text:
        lines = Text()
        told = [
            (order.words or order.name) + (f"  {self._arrow}" if order.name == self._now else "")
            for order in self._orders
        ]
        columns = 2 if max(map(cells, told)) < COLUMN - 2 else 1  # no words run into those beside them
        rows = -(-len(told) // columns)
        for left in range(rows):
            for order, words in list(zip(self._orders, told, strict=True))[left::rows]:
                lines.append(order.letter, style="bold")
                lines.append(f" {words:<{COLUMN - 2}}")
            lines.append("\n")
        lines.append("\nthe same letter again: the other way round")
        return lines

    def chosen_by(self, letter: str) -> str:
        return next((f"{one.name} {one.words}" for one in self._orders if one.letter == letter), "")

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()
        found = next((order.name for order in self._orders if order.letter == event.character), None)
        if found is not None or event.key in ("escape", "q"):
            self.dismiss(found)
        else:
            cast(Any, self.app).gate.refused()
            cast(Any, self.app).context.say(
                f"{key_text(event.key)} is no letter of an order; {key_of('back')} leaves", hint=True
            )


class WordedLine(Line):
    """A line that begins with the word of a command."""

    def action_delete_left_all(self) -> None:
        """Take away what stands behind the word, and the word only where nothing does."""
        start = len(self.value.partition(" ")[0]) + 1
        self.delete(start if start < self.cursor_position else 0, self.cursor_position)


class CommandLine(Dialog[str | None]):
    """Answers with the line that was entered; None on Esc. Plots are named and kept where they are seen."""

    KEYS_HERE = "Enter does what is typed  Tab completes it  Esc leaves"
    AUTO_FOCUS = ""

    def __init__(
        self, complete: Callable[[str], list[str]], words: str, begun: str = "", usage: Callable[[str], str] = str
    ) -> None:
        """`words` are some of those that may be typed, `begun` is typed already, `usage` says what it does."""
        super().__init__()
        self._begun = begun
        self._complete, self._words, self._usage = complete, words, usage

    def compose(self) -> ComposeResult:
        with Vertical(id="command"):
            yield Static("", id="command-notes", markup=False)
            with Horizontal():
                yield Static(":")
                yield WordedLine(self._complete, self._words, "command-over")

    def on_mount(self) -> None:
        self.query_one(Line).begin(self._begun)

    def on_input_changed(self, event: Line.Changed) -> None:
        self._note(self._usage(event.value))

    def on_line_completed(self, event: Line.Completed) -> None:
        self._note(event.words or self._usage(self.query_one(Line).value))

    def _note(self, words: str) -> None:
        notes = self.query_one("#command-notes", Static)
        notes.update(words)
        notes.display = bool(words)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        self.dismiss(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Leave; nothing is done."""
        if self.is_current:
            self.dismiss(None)
