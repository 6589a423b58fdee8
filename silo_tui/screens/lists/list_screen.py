"""What all lists share: the cursor that stays on its line, filter, order, marks, what a key is about, what is said."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.widgets import Static

from silo_tui.actions import BY_ID, Command, key_of, unmark_words
from silo_tui.context import SiloScreen
from silo_tui.keymap import DESTROYS, TWO_LAYERS
from silo_tui.modal import ask
from silo_tui.model.lists.ordering import Marks, Order, arranged, passes, standing
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.dialogs.questions import OrderDialog
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.inputs import Fleeting, Line
from silo_tui.widgets.lines import MARKED, Lines
from silo_tui.widgets.messages import ListLine

if TYPE_CHECKING:
    from silo.analysis.log import Log

Opener: TypeAlias = "tuple[str, Callable[[], Log]]"  # a log by its name, and what opens it

# keys that are about lines; and commands, by keys that elsewhere are about other things
OF_A_LINE = ("enter", "space", "asterisk", "V", "h", "shift+left", "o", "m", DESTROYS)
OF_LINES = ("acknowledge", "trigger_toggle", "overlay_recording", "overlay_runs", "fetch_recording", "write_events",
            "compare_runs")  # fmt: skip
READ_AGAIN = ("list_read", "look_again")
FILTER_KEYS = "Enter keeps the filter  Esc clears it"

LineT = TypeVar("LineT")


class ListScreen(SiloScreen, Generic[LineT]):
    """A list; its children say what there is, how a line reads, and what its keys do.

    A line is known by its key, wherever it stands: the cursor and the marks go with it. Lines stand as a person saw
    them, whatever becomes of them, until that person orders, filters or reads the list again: new ones come between.
    """

    orders: Sequence[Order[Any]]  # the first is the usual one
    filter_hint = "words of a line, a|b either, -not"
    words_share = 0.3  # of the screen, for the words below

    def __init__(self) -> None:
        super().__init__()
        self.marks = Marks()
        self.shown: list[LineT] = []  # what passes the filter, in order
        self.shown_keys: list[str] = []
        self._stood: list[str] = []  # all lines, as they were ordered last
        self._stands_otherwise = False  # than the order would have them now
        self.asked = ""  # the filter
        self.message = ListLine(self.words_share)
        self._order, self._turned = self.orders[0], False
        self._passing: tuple[str, Callable[[], object]] = "", bool  # what was said, and whether that is over

    def compose(self) -> ComposeResult:
        yield from self.above()
        yield Static("", id="list-head", markup=False)
        yield Lines("list-lines")
        yield Static("", id="list-advice", markup=False)
        yield self.message
        yield Line(lambda typed: [], self.filter_hint, "list-filter")
        yield from self.typed_lines()
        yield KeyBar()

    def on_mount(self) -> None:
        self.lines.focus()
        self.show()
        self.begin()

    def on_resize(self, event: events.Resize) -> None:
        self.call_after_refresh(self.show)

    # ------------------------------------------------------------------------------------------- what children say

    @property
    @abstractmethod
    def all(self) -> Sequence[LineT]:
        """What there is, in the order in which it is told."""

    @abstractmethod
    def key_of(self, one: LineT) -> str:
        """Return what tells a line from others."""

    def stands_by(self, one: LineT) -> str:
        """Return what a line keeps its place by: one for which that changes is put where it belongs."""
        return self.key_of(one)

    @abstractmethod
    def row_of(self, one: LineT, width: int) -> Text:
        """Return a line."""

    def above(self) -> ComposeResult:
        """Yield what stands above the head."""
        yield from ()

    def typed_lines(self) -> ComposeResult:
        """Yield further lines to type in."""
        yield from ()

    def begin(self) -> None:
        """Ask for what is not known yet."""

    def prepare(self, found: Sequence[LineT], width: int) -> None:
        """Make ready for a look at all lines: what a row needs to know of the others."""

    @abstractmethod
    def told(self, one: LineT) -> str:
        """Return what a filter looks in: the facts of a line, whatever of them the screen has room for."""

    def passes(self, one: LineT) -> bool:
        """Return whether a line passes the filter."""
        return passes(self.told(one), self.asked)

    def follow(self, known: str, place: int | None) -> int | None:
        """Return where the cursor goes, which was on the line of a key, at a place."""
        return self.marks.follow(known, self.shown_keys, place)

    def head(self, width: int) -> str:
        """Return the head of the list."""
        return ""

    def words(self) -> str:
        """Return what is to be said of all, where nothing else is; else of the line under the cursor."""
        return self.about(one) if (one := self.chosen) is not None else ""

    def about(self, one: LineT) -> str:
        """Return what is to be said of a line."""
        return ""

    def going_on(self) -> Sequence[str]:
        """Return what is said besides: what goes on."""
        return ()

    def advice(self) -> str:
        """Return what to do about a list that is empty, or about what is missing in it."""
        if self.shown:
            return ""
        return f"No line has {self.asked!r}. {key_of('back')} clears the filter." if self.all else self.none()

    def none(self) -> str:
        """Return why there is nothing, and what makes some."""
        return ""

    def named(self, key: str) -> str:
        """Return a line by the name that it is known by."""
        return key

    @property
    def subject(self) -> str:
        if self.marks.keys or self.scope not in BY_ID["list_mark"].scopes:
            return f"{len(self.marks.keys)} marked" * bool(self.marks.keys)
        return self.named(self.chosen_key) if self.chosen is not None else ""

    def enter(self) -> None:
        """Do what a click on the line under the cursor does."""

    def forget(self) -> bool:
        """Take back what was chosen in the list; return whether there was something."""
        return self.marks.clear()

    def leave(self) -> None:
        """Leave the screen."""
        self.context.leave_screen()

    # ------------------------------------------------------------------------------------------------- to be drawn

    def show(self) -> None:
        """Draw the lines; the cursor stays on what it was on."""
        if self._pruning or not self.query("#list-lines"):
            return  # it goes, one widget after another, or is being made
        lines, width, found = self.lines, self.size.width, self.all
        known, place = self.chosen_key, lines.highlighted
        self.prepare(found, width)
        self.marks.keep(map(self.key_of, found))
        due = arranged(found, self._order, turned=self._turned)
        stand = standing(due, self.stands_by, self._stood)
        self._stood, self._stands_otherwise = list(map(self.stands_by, stand)), stand != due
        self.shown = [one for one in stand if self.passes(one)] if self.asked else stand
        self.shown_keys = list(map(self.key_of, self.shown))
        lines.show(len(self.shown), self._row, self.follow(known, place))
        advice = self.advice()
        lines.display = bool(self.shown) or not advice
        if lines.display and self.focused is None:
            lines.focus()
        head, title = self.query_one("#list-head", Static), self.head(width) if self.shown else ""
        head.update(Text(title, no_wrap=True))
        head.display = bool(title)
        below = self.query_one("#list-advice", Static)
        below.update(advice)
        below.display = bool(advice)
        below.set_class(not lines.display, "alone")
        self.show_words()
        self.query_one(KeyBar).update()

    def label_now(self, command: Command) -> str:
        """Return it, and what Esc takes away first; nothing of what is about a line where there is none."""
        if command.id == "back" and (first := "No filter" if self.asked else "Unmark" if self.marks.keys else ""):
            return first
        nothing_there = command.id == "list_filter" and not self.all
        return "" if nothing_there or self._lacks_a_line(command) else super().label_now(command)

    def why_not_now(self, command_id: str) -> str:
        """Return why nothing can be unmarked; marks of the table are taken back there. Or that there is no line."""
        if command_id == "unmark":
            return "" if self.marks.keys else "none marked"
        return "no line is here" if self._lacks_a_line(BY_ID[command_id]) else super().why_not_now(command_id)

    def _lacks_a_line(self, command: Command) -> bool:
        """Whether a command is about lines, and there is none, or the cursor is on none."""
        about = TWO_LAYERS.get(command.id, "").split(",")[0] in OF_A_LINE or command.id in OF_LINES
        return self.chosen is None and (about or command.does == "many") and self.scope in command.scopes

    def _row(self, place: int) -> Text:
        line, key = self.row_of(self.shown[place], self.size.width), self.shown_keys[place]
        return Text.assemble(line[:1], (MARKED, "bold"), line[2:]) if key in self.marks.keys else line

    def show_words(self) -> None:
        """Draw the line of words: marks, filter and order where there are some, and what was said last."""
        if self._pruning:
            return  # as above
        words, over = self._passing
        if words and over():
            self._passing = "", bool
            if self.message.said == words:
                self.message.say("")
        parts = [f"{len(self.marks.keys)} marked", unmark_words()] if self.marks.keys else []
        parts += [f"/{self.asked}: {len(self.shown)} of {len(self.all)}"] if self.asked else []
        parts += [f"by {self._order.name}"] if self._order is not self.orders[0] or self._turned else []
        reads = next((key_of(each) for each in READ_AGAIN if self.scope in BY_ID[each].scopes), "")
        parts += [f"{reads} orders anew"] if self._stands_otherwise and reads else []
        going_on = self.going_on()
        told = [*parts, *(going_on if going_on or self.message.said else [self.words()])]
        self.message.told = [self.context.shown(words) for words in told]
        self.message.changed()

    @property
    def lines(self) -> Lines:
        """The widget."""
        return self.query_one("#list-lines", Lines)

    @property
    def chosen(self) -> LineT | None:
        """The line under the cursor."""
        place = self.lines.highlighted
        return self.shown[place] if place is not None and place < len(self.shown) else None

    def here(self) -> LineT | None:
        """Return the line under the cursor for a key that is about it; says so where there is none."""
        if (one := self.chosen) is None:
            self.say_until("no line is here", lambda: self.chosen)
        return one

    def say_until(self, words: str, over: Callable[[], object]) -> None:
        """Say what is so until `over` tells that it is no longer."""
        self._passing = words, over
        self.say(words)

    @property
    def chosen_key(self) -> str:
        """The key of the line under the cursor; empty where there is none."""
        return self.key_of(one) if (one := self.chosen) is not None else ""

    def targets(self, otherwise: str = "") -> list[LineT]:
        """Return what a key is about, and say why where that is nothing; `otherwise` where that is plain."""
        meant = set(self.marks.meant(self.shown_keys, self.chosen_key))
        found = [one for key, one in zip(self.shown_keys, self.shown, strict=True) if key in meant and self.may_be(one)]
        if not found:
            self.say(self.marks.why_none(self.shown_keys, self.chosen_key, self.named) or otherwise)
        return found

    def may_be(self, one: LineT) -> bool:
        """Return whether a key can be about a line."""
        return True

    # ---------------------------------------------------------------------------------------- what the app tells it

    def show_said(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        super().show_said(words, failed=failed, hint=hint)
        self.show_words()

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Let what was said go, and do what a key asks for."""
        self.message.say("")
        if command_id in READ_AGAIN:
            self._stood = []
        super().action_command(command_id, typed)
        self.show_words()

    def on_lines_cursor_moved(self, event: Lines.CursorMoved) -> None:
        if not self._pruning:  # as above
            self.show_words()
            self.query_one(KeyBar).update()

    def on_lines_line_picked(self, event: Lines.LinePicked) -> None:
        self.enter()

    # ------------------------------------------------------------------------------------------------------ moving

    def move(self, place: int) -> None:
        """Move the cursor."""
        self.lines.move(place)

    def command_list_step(self, lines: int) -> None:
        self.move((self.lines.highlighted or 0) + lines)

    def command_list_page(self, pages: int) -> None:
        self.command_list_step(pages * self.lines.page_rows)

    def command_list_top(self) -> None:
        self.move(0)

    def command_list_bottom(self) -> None:
        self.move(len(self.shown) - 1)

    # ------------------------------------------------------------------------------------------ marks, order, filter

    def command_list_mark(self) -> None:
        if self.here() is not None:
            self.marks.toggle(self.chosen_key)
            self.command_list_step(1)
            self.show()

    def command_list_mark_all(self) -> None:
        if self.here() is not None:
            self.marks.toggle_all(self.shown_keys)
            self.show()

    def command_list_range(self) -> None:
        if self.here() is not None:
            self.say(self.marks.range_to(self.chosen_key, self.shown_keys))
            self.show()

    def command_unmark(self) -> None:
        self.marks.clear()
        self.show()

    def command_list_order(self) -> None:
        arrow = "↓" if self._order.backwards != self._turned else "↑"
        ask(self, OrderDialog(self.orders, self._order.name, arrow), self._by)

    def _by(self, name: str) -> None:
        self._turned = not self._turned if name == self._order.name else False
        self._order = next(order for order in self.orders if order.name == name)
        self._stood = []
        self.show()

    def command_list_filter(self) -> None:
        over = self.query_one("#list-filter", Line).begin_over(self.asked)
        self.query_one(KeyBar).show_instead(over + FILTER_KEYS)

    def on_input_changed(self, event: Line.Changed) -> None:
        if event.input.id == "list-filter" and event.input.display:
            self.filter_by(event.input.value)

    def on_line_touched(self) -> None:
        """Name the keys of the filter alone."""
        self.query_one(KeyBar).show_instead(FILTER_KEYS)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        self._back_to_list()
        if event.line.id == "list-filter":
            self.filter_by(event.value)
        else:
            self.entered(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Leave a line; the filter is cleared."""
        self._back_to_list()
        if event.line.id == "list-filter":
            self.filter_by("")

    def entered(self, value: str) -> None:
        """Take what was typed in a line other than the filter."""

    def filter_by(self, words: str) -> None:
        """Show what has these words."""
        if words.strip() != self.asked:
            self.asked, self._stood = words.strip(), []
        self.message.say("")
        self.show()
        self.marks.settle()

    def _back_to_list(self) -> None:
        self.query_one(KeyBar).show_instead("")
        self.lines.focus()

    def command_back(self) -> None:
        """Leave the filter, then the marks, then the screen."""
        if self.asked:
            self.filter_by("")
        elif self.forget():
            self.show()
        else:
            self.leave()


class ComparesTwo(ListScreen[LineT]):
    """A list of logs of which two are compared."""

    @abstractmethod
    async def opener_of(self, one: LineT) -> "Opener | None":
        """Return how to open one; None, and told why, where it can't be."""

    @abstractmethod
    async def compare_logs(self, ways: Sequence[Opener]) -> None:
        """Compare two, and show what came of it."""

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what two marks are for."""
        return (("compare_runs", "Compare"),) if len(self.marks.keys) == 2 else ()

    def command_compare_runs(self) -> None:
        targets = self.targets("no run is here")
        if len(targets) == 2:
            self.context.open_over(self, "comparing two runs", self._compare, targets[::-1])
        elif targets:
            marked = f"{len(targets)} {'is' if len(targets) == 1 else 'are'} marked"
            self.say(f"{key_of('list_mark')} marks runs: two are compared, {marked}")

    async def _compare(self, targets: Sequence[LineT]) -> None:
        ways = [way for one in targets if (way := await self.opener_of(one)) is not None]
        if len(ways) == 2:
            await self.compare_logs(ways)


class LoggerList(ListScreen[LineT]):
    """A list of an open logger, or of a file: below how that stands."""

    aside = True

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session

    def above(self) -> ComposeResult:
        yield from self.bars()

    def going_on(self) -> Sequence[str]:
        return [one.words for one in self.session.fetches.values()]

    def status_changed(self) -> None:
        super().status_changed()
        self.show()
