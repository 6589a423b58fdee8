"""Help, made from the list of commands: columns that fill the screen, searched with `/`, all screens by Tab."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, groupby, pairwise
from textwrap import wrap
from typing import ClassVar

from rich.cells import cell_len, set_cell_size
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.widgets import Input, Static

from silo.settings.typed import help_rows
from silo_tui.actions import COMMANDS, FILE_SCOPES, PLACES, commands_for, commands_like
from silo_tui.modal import Dialog
from silo_tui.model.drawing.braille import NAN, NEG_INF, POS_INF, SHADE
from silo_tui.model.lists.happened import EVENT_LINE, NAMES
from silo_tui.model.table.filter import TERMS
from silo_tui.model.words.states import MEANINGS
from silo_tui.model.words.text import held, loosened
from silo_tui.theme import bold
from silo_tui.widgets.inputs import Fleeting, Line
from silo_tui.widgets.lines import MARKED, ON_MARKED
from silo_tui.widgets.plot_stack import CURSOR_A, CURSOR_B

THREE_FROM, TWO_FROM = 120, 72
GAP = 2
UNEVEN = 0.25  # of the longest column another may be shorter, so that no group is divided
LAST_GROUPS = ("Logger", "Go")

HEAD = (
    ("● RUNNING 02:41", "it logs, for so long"),
    ("■ STOPPED 02:41", "it logs nothing now; what it logged for so long is held"),
    ("✖ DEAD 02:41", "the robot program is gone; what it logged is saved, or held"),
    ("~ NO LINK 14 s", "nobody answers for so long: values are old, edits are kept"),
    ("- CLOSED 14 s", "the robot program closed its logger so long ago; silo-tui follows when it starts again"),
    ("488/500 elements on", "so many are logged, of all; +1 derived: computed from them"),
    ("… of 400 Hz", "ticks a second as measured, of how many; …: none was yet"),
    ("318 of 400 Hz slow", "the loop makes fewer ticks than it should: filter `lateness` (logged with timing=True)"),
    ("‼ no tick for 4 s", "the loop stands still"),
    ("118 024 ticks", "of the run, or since the cut"),
    ("lost 0", "samples that the buffers could not keep"),
    ("1 alarm (HH), HH 1", "so many are beyond limits, the worst so far"),
    ("1 alarm ended unseen", "it is over, and nobody has said that he saw it: acknowledge it in the list of alarms"),
    ("2 triggers armed, FIRES", "conditions that watch, and capture when they turn true"),
    ("REC 1", "endless recordings that run"), ("durable to tick 400", "what a power cut leaves"),
    ("read-only", "nothing can be changed from here; who may is told"),
    ("PAUSED SCOPE FILE", "of plots: they stand still, show crossings, are of a saved file"),
    ("THIN 1.2 of 5 Hz", "the link takes so many pictures a second, carries kbit/s, answers after ms; keys go first"),
    ("DRAWN 1.2 of 5 Hz", "your terminal is drawn less often, mostly as its computer is busy; the robot is not slowed"),
)  # fmt: skip
COLUMNS = (
    ("name in /legs", "all that are shown begin so"), ("▼ legs 412, ►", "a branch of so many, or a vector; folded: ►"),
    ("norm", "of a vector, in place of its entries"), ("unit", "of the value; - none"), ("on", "whether it is logged"),
    ("div", "divider: it is logged every so many ticks"),
    ("action", "saved, published, or both (save+pub)"),
    ("buf", "buffer: keeps the newest (loop), the first (fix), or all (grow)"), ("size", "samples that its buffer has"),
    ("fill", "how much of it is full"), ("value", "the newest; a number in a file: at that time"),
    ("min max mean std", "of each sample since the line below says; of a vector the ends of any entry, of one unit"),
    ("noise/median", "noise (std of second differences) against the median of those that are called alike"),
    ("limit", "how far the value is from the limit that it meets first, as an order (`o x`) has it"),
    ("rate", "samples a second, as measured"),
    ("state", "the worst that is the matter: its words stand below"),
    ("%", "of the samples that it should have"), ("jitter", "how far samples are off their time"),
    ("changed", "how long ago the value did; > that was not seen: it is the same for longer"),
    ("trend", f"its newest curve; {NAN} nan, {POS_INF} {NEG_INF} inf, {SHADE} a hole"),
    ("samples, span s, type, lost", "of a file: how many, how long, of which type, how many lost"),
)  # fmt: skip
SIGNS = (
    ("*", "pending: prepared here, not applied yet (underlined)"), ("!", "conflict: somebody else changed it too"),
    ("E", "edited: it has other settings than its program began with; /edited shows all, the inspector both"),
    (MARKED, f"marked: edits and plots are about all that is marked; {ON_MARKED} with the cursor on it"),
    ("‣ 12:51:44 …", "news of the robot, and when they came; `:messages` shows all"),
    ("…, wait", "there is more than has room: the inspector has all of it; wait: it is on its way"),
    ("↓ ↑", "before a title: ordered by it, ↓ the largest on top, ↑ the smallest, or from a to z"),
    ("=", "derived: computed from others; its options are those of its signals"),
)  # fmt: skip
PLOT_SCOPES = ("monitor", "detail", "file_monitor", "file_detail")
PLOT_SIGNS = (
    *((each, f"below a plot: {name}") for each, name in NAMES.items()),
    (EVENT_LINE, "where it happened"), (CURSOR_A, "cursor A"), (CURSOR_B, "cursor B"),
    (SHADE, "a hole, with its reason: stopped, lost, off, full …"),
)  # fmt: skip
FILE_SIGNS = (
    (MARKED, "marked: the plots are of all that is marked"), ("= 1.23", "the value that held at the cursor"),
    ("min max mean", "of the samples in the window"),
)  # fmt: skip
COLOURS = {
    "alarm": "alarm, lost", "warning": "warning, slow", "pending": "pending edit", "dead": "ended",
    "selected": "marked", "success": "runs", "primary": "key",
}  # fmt: skip
_NUMBER = re.compile(r"\d+(?:[ .:]\d+)*")
WORDS = (
    ("torque LF", "both words in the name, else in name or description"),
    ("LF|RF", "either"),
    ("~regex", "by a regular expression"),
    ("/log/*/q", "globs"),
    ("-word", "not"),
)


@dataclass(frozen=True)
class HelpLine:
    """A line of help; `command` is what Enter does, or tells where it has a use, `label` its word in menus."""

    left: str
    right: str
    group: str
    command: str = ""
    label: str = ""

    def holds(self, words: Sequence[str]) -> bool:
        """Return whether all of these words are in it; of numbers, which change, any."""
        own = _NUMBER.sub("0", f"{self.left} {self.right} {self.group} {self.command} {self.label}".casefold())
        return all(_NUMBER.sub("0", word) in own for word in words)


def entries(scope: str, *, everywhere: bool) -> list[HelpLine]:
    """Return the lines of help: those of a screen, or of all screens, that one first."""
    here = commands_for(scope)
    commands = list(here)
    if everywhere:
        known = {command.id for command in here}
        commands += [command for command in commands_like(scope) if command.id not in known]
    found = []
    # what every screen has comes last
    for group in sorted(dict.fromkeys(command.group for command in commands), key=LAST_GROUPS.count):
        members = [command for command in commands if command.group == group and command.keys]
        found += [HelpLine(each.key_text, each.help, group, each.id, each.label) for each in members]
    on_file = scope in FILE_SCOPES
    of_table, of_plots = (everywhere or scope in scopes for scopes in (("table", "file"), PLOT_SCOPES))
    signs = FILE_SIGNS if on_file else (*SIGNS, *MEANINGS.items())
    parts = (
        ("First line", of_table, HEAD), ("Columns", of_table, COLUMNS), ("Signs", of_table, signs),
        ("Filter", of_table, (*WORDS, *filter_rows())), ("In plots", of_plots, PLOT_SIGNS),
        ("Kinds", not of_plots and scope in ("events", "file_events"), NAMES.items()),
        ("Commands", not on_file and (everywhere or scope == "table"), typed_rows()),
    )  # fmt: skip
    return found + [HelpLine(*each, group) for group, is_there, rows in parts if is_there for each in rows]


def filter_rows() -> list[tuple[str, str]]:
    """Return a row per field of the filter language: how it is written, and with which words."""
    rows = []
    for term in TERMS:
        words = [each.partition(":")[2] for each in term.completions]
        rows.append((term.bare, " ".join(words) if words else "a number, also =" if term.compares else "a word of it"))
    return rows


def typed_rows() -> list[tuple[str, str]]:
    """Return a row per command that has a line of its own, and one per setting of `:set`."""
    typed = sorted((command.typed for command in COMMANDS if command.typed is not None), key=lambda each: each.place)
    rows = []
    for each in typed:
        rows += [(each.usage, each.help)] if each.usage else []
        if each.completes == "settings":
            rows += [(f"  {example}", meaning) for example, meaning in help_rows()]
    return rows


def column_count(width: int) -> int:
    """Return how many columns a screen of that width has."""
    return 3 if width >= THREE_FROM else 2 if width >= TWO_FROM else 1


def page(found: Iterable[HelpLine], width: int, chosen: HelpLine | None = None) -> Text:
    """Return the lines in columns, groups under their titles, all as tall as one another where that can be."""
    found = list(found)
    count = column_count(width)
    room = (width - 2 - GAP * (count - 1)) // count
    key_room = min(max((cell_len(entry.left) for entry in found if entry.group != "Commands"), default=0), room // 3)
    columns = _columns(
        [(entry.group, _lines(entry, key_room, room, is_chosen=entry is chosen)) for entry in found], count
    )
    height = max(map(len, columns))
    made = []
    for row in range(height):
        line = Text(" ")
        for column, lines in enumerate(columns):
            cell = lines[row] if row < len(lines) else Text("")
            line.append_text(cell).append(" " * (room - cell.cell_len + GAP * (column < count - 1)))
        made.append(line)
    return Text("\n").join(made)


def _columns(entries: Sequence[tuple[str, list[Text]]], count: int) -> list[list[Text]]:
    """Return the lines of entries with the titles of their groups, as so many columns; each begins with a title.

    No group is divided where that makes none much longer: its begin would stand out of sight, below.
    """
    if (whole := _whole_groups(entries, count)) is not None:
        return whole
    titles = len({group for group, _ in entries})
    height = -(-(sum(len(lines) for _, lines in entries) + 2 * titles) // count)
    columns: list[list[Text]] = [[]]
    before = ""
    for group, lines in entries:
        title = [Text(group, style="underline")]
        begun = title if group != before else []
        gap = [Text("")] if begun and columns[-1] else []
        if len(columns[-1]) + len(gap + begun + lines) > height and len(columns) < count:
            columns.append([])
            gap, begun = [], begun or [Text(f"{group} (more)", style="underline")]
        columns[-1] += [*gap, *begun, *lines]
        before = group
    return [*columns, *([] for _ in range(count - len(columns)))]


def _whole_groups(entries: Sequence[tuple[str, list[Text]]], count: int) -> list[list[Text]] | None:
    groups = [
        [Text(title, style="underline"), *(line for _, lines in each for line in lines), Text("")]
        for title, each in groupby(entries, key=lambda entry: entry[0])
    ]
    if len(groups) < count:
        return None
    ways = ([0, *breaks, len(groups)] for breaks in combinations(range(1, len(groups)), count - 1))
    made = ([[*chain(*groups[begin:end])] for begin, end in pairwise(way)] for way in ways)
    best = min(made, key=_uneven)
    return best if _uneven(best) <= UNEVEN * max(map(len, best)) else None


def _uneven(columns: Sequence[Sequence[Text]]) -> int:
    return max(map(len, columns)) - min(map(len, columns))


def _lines(entry: HelpLine, key_room: int, room: int, *, is_chosen: bool) -> list[Text]:
    """Return an entry in a column: what is too long goes on in the next line, never out of sight."""
    style = "bold reverse" if is_chosen else "bold"
    left = entry.left
    if cell_len(left) > key_room:
        head = [Text(set_cell_size(left, min(cell_len(left), room)), style=style)]
    else:
        head = [Text(left, style=style).append(" " * (key_room - cell_len(left)))]
    width = max(1, room - key_room - 1)
    right = wrap(held(entry.right), width, break_long_words=False, break_on_hyphens=False)
    rest = [loosened(line[:width]) for line in right]
    if cell_len(left) <= key_room and rest:
        head[0].append(f" {rest.pop(0)}", style="not bold not reverse")
    return head + [Text(" " * (key_room + 1) + words) for words in rest]


class HelpScreen(Dialog[None]):
    """Keys, words and signs of the screen below; `do` carries out a command of it."""

    KEYS_HERE = ""
    AUTO_FOCUS = ""  # the line to search in takes keys only while it is there
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape,q,question_mark,f1", "back", "Back", show=False),
        Binding("slash", "search", show=False),
        Binding("tab", "everywhere", show=False, priority=True),
        Binding("enter", "do", show=False),
        Binding("t", "tour", show=False),
        Binding("j,down", "move(1)", show=False),
        Binding("k,up", "move(-1)", show=False),
        Binding("pagedown,ctrl+d,space", "scroll(1)", show=False),
        Binding("pageup,ctrl+u", "scroll(-1)", show=False),
        Binding("g,home", "end(0)", show=False),
        Binding("G,end", "end(1)", show=False),
    ]

    def __init__(self, scope: str, do: Callable[[str], None] = lambda command: None) -> None:
        super().__init__()
        self._scope, self._do = scope, do
        self._everywhere = not commands_for(scope)
        self._words = ""
        self._chosen = 0
        self._found: list[HelpLine] = []

    def compose(self) -> ComposeResult:
        yield Static("", id="help-title", markup=False)
        with VerticalScroll(id="help-body", can_focus=False):
            yield Static("", id="help-page", markup=False)
        yield Line(lambda line: [], "words of what you look for", "help-search")
        yield Static("", id="help-keys", markup=False)

    def on_resize(self, event: events.Resize) -> None:
        self._show()

    def _show(self) -> None:
        words = self._words.casefold().split()
        here = entries(self._scope, everywhere=self._everywhere)
        found = [entry for entry in here if entry.holds(words)]
        where = "all screens" if self._everywhere else f"the {PLACES.get(self._scope, self._scope)}"
        if words and not found and not self._everywhere:  # what isn't here may be elsewhere
            here = entries(self._scope, everywhere=True)
            found = [entry for entry in here if entry.holds(words)]
            where = "all screens"
        self._found = found
        self._chosen = max(0, min(self._chosen, len(found) - 1))
        held = f'  {len(found)} of {len(here)} hold "{self._words.strip()}"' if words else ""
        variables = self.app.theme_variables
        here_too = [role for role in COLOURS if role != "pending" or self._scope not in FILE_SCOPES]
        told = [Text(COLOURS[role], bold(variables, role)) for role in here_too if not self.app.no_color]
        colours = Text("  ").join([Text("\n Colours:"), *told]) if told else Text("")
        self.query_one("#help-title", Static).update(Text.assemble(f" silo help of {where}{held}", colours))
        chosen = found[self._chosen] if words and found else None
        text = page(found, self.size.width - 1, chosen) if found else Text(" Nothing holds these words. Esc: all again")
        self.query_one("#help-page", Static).update(text)
        typing = self.query_one(Line).display
        does = f"Enter {chosen.label}" if chosen and chosen.command else "Enter has no use here"
        does = "Enter finds" if typing else does
        keys = f"{does}  ↑↓ Choose" if typing or words else "/ Search"
        tab = "Tab This screen" if self._everywhere else "Tab All screens"
        self.query_one("#help-keys", Static).update(f" {keys}  {tab}  t Tour  j k Scroll  Esc Closes")

    # --------------------------------------------------------------------------------------------------- keys

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave letters to the line that is typed in."""
        return action == "everywhere" or not self.query_one(Line).display

    def on_key(self, event: events.Key) -> None:
        """Choose among what was found while words are typed."""
        if self.query_one(Line).display and event.key in ("up", "down"):
            self._choose(1 if event.key == "down" else -1)
            event.stop()

    def action_search(self) -> None:
        """Type words."""
        self.query_one(Line).begin_over(self._words)
        self._show()

    def action_everywhere(self) -> None:
        """Show all screens, or this one again."""
        self._everywhere = not self._everywhere
        self._show()

    def action_do(self) -> None:
        """Do what is chosen, if it was searched for."""
        if self._words and self._found:
            command = self._found[self._chosen].command
            if command:
                self.dismiss()
                self.app.call_later(self._do, command)  # what it asks for is answered to a screen that stays

    def action_tour(self) -> None:
        """Begin the tour, or end it."""
        self.dismiss()
        self.app.call_later(self._do, "tour")

    def action_back(self) -> None:
        """Show all again, then leave."""
        if self._words:
            self._words = ""
            self._show()
        else:
            self.dismiss()

    def action_move(self, lines: int) -> None:
        """Choose among what was found, or scroll."""
        if self._words:
            self._choose(lines)
        else:
            self.query_one(VerticalScroll).scroll_relative(y=lines, animate=False)

    def _choose(self, step: int) -> None:
        self._chosen = max(0, min(self._chosen + step, len(self._found) - 1))
        self._show()

    def action_scroll(self, pages: int) -> None:
        """Scroll by a page."""
        body = self.query_one(VerticalScroll)
        body.scroll_relative(y=pages * max(1, body.size.height - 1), animate=False)

    def action_end(self, last: int) -> None:
        """Go to the first or to the last line."""
        body = self.query_one(VerticalScroll)
        body.scroll_to(y=body.max_scroll_y if last else 0, animate=False)

    def on_input_changed(self, event: Input.Changed) -> None:
        if event.input.display and event.value != self._words:
            self._words, self._chosen = event.value, 0
            self._show()

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        self._words = event.value
        self._show()  # who typed on, Enter too, has read nothing: the next one does it

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        self._words = ""
        self._show()
