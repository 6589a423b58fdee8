"""The lines of words above the keys: news of the robot, and below the facts of a screen and the answer to a key."""

import time
from bisect import bisect_left
from collections.abc import Callable, Sequence

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text
from textual.app import RenderResult

from silo.core.quantities.writing import many, wall_clock
from silo.rpc.published import NOT_LIVE_TEXTS
from silo_tui.actions import key_of, unmark_words
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.table.cells import sign_of
from silo_tui.model.table.columns import NAME, STEADY
from silo_tui.model.words import text
from silo_tui.model.words.states import FULL, MEANINGS, OLD
from silo_tui.sessions.live import Session
from silo_tui.theme import bold
from silo_tui.widgets.bars import LONG, FittingLine, LinePart, lines_of

READ_S = 4.0  # so long answers and news of the robot stand at least; then the next key takes them away
HELD = "stands still 3 s after a key"
STAYS = 8  # rank of what gives way last, and stays beside an answer at its shortest
WORD = 16  # is not cut where it is no longer
MOST_ROWS = 3  # of news and an answer together: they stand over the rows that they are about


def beginning(words: str, room: int, rows: int, console: Console) -> str:
    """Return as much as so many rows of cells take, and where the rest is. What to do ends a message, and stays."""
    lines, rest = lines_of(words, room, console), f" … ({key_of('messages') or ':messages'})"
    if len(lines) > rows:
        at = max(words.rfind("; "), words.rfind(". "))
        rest += words[at:] if at > 0 and cell_len(words[at:]) <= 2 / 3 * room * rows else ""
        told = text.held(words)
        too_far = bisect_left(
            range(len(told)), True, key=lambda end: len(lines_of(told[:end] + rest, room, console)) > rows
        )
        most = max(0, too_far - 1)
        blank = told.rfind(" ", max(0, most - WORD), most + 1)  # of what has none as much as there is room for
        lines = lines_of(told[: blank if blank > 0 else most].rstrip() + rest, room, console)
    return "\n".join(lines[:rows])


class MessageLine(FittingLine):
    """Two messages that never take the place of one another: the answer stands behind the facts of the screen, of which
    as many as have room beside it are shown, and those that must stay (of rank 0 and `STAYS`); what is longer than the
    line wraps, a failure as far as it goes.
    """

    def __init__(self) -> None:
        super().__init__()
        self.said = ""  # the answer to a key
        self._said_s = 0.0  # monotonic, when
        self._failed = self._hint = False
        self._news = ""
        self._rows = 1
        self._most_rows = MOST_ROWS

    def say(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        """Show an answer until the next one, or until somebody goes on who had time to read it; a `hint`, that a key
        did nothing, until one does something.
        """
        self.said, self._failed, self._hint, self._said_s = words, failed, hint, time.monotonic()
        self.changed()

    def read(self) -> None:
        """Take an answer away that stood long enough: what it is about goes on, and may have ended; a hint at once."""
        if self.said and (self._hint or time.monotonic() - self._said_s >= READ_S):
            self.say("")

    def give_way(self) -> None:
        """Take an answer away as its ground changes; a failure is read first."""
        if self._failed:
            self.read()
        else:
            self.say("")

    def cover(self, covered: bool) -> None:
        """Show the beginning of what is longer than a row, while a menu covers the others."""
        self._most_rows = 1 if covered else MOST_ROWS
        self.changed()

    def tell(self, news: str) -> None:
        """Show news of the robot above; empty: none any more."""
        if news != self._news:
            self._news = news
            self.changed()

    def changed(self) -> None:
        """Draw anew, in as many lines as it takes now."""
        rows = len(self.words().wrap(self.app.console, self._room))
        self.refresh(layout=rows != self._rows)
        self._rows = rows

    @property
    def _room(self) -> int:
        return max(1, self.app.size.width - 2)

    def render(self) -> RenderResult:
        return self.words()

    def words(self) -> Text:
        """Return news, then facts and the answer."""
        below = self.below(self._room)
        if not self._news:
            return below
        rows = max(1, self._most_rows - len(below.wrap(self.app.console, self._room)))
        *tour, newest = self._news.split("\n")
        return Text("\n").join([*map(Text, tour), Text(beginning(newest, self._room, rows, self.app.console)), below])

    def cut(self, words: str) -> str:
        """Return what is shown of words with an answer."""
        return beginning(words, self._room, max(1, self._most_rows - bool(self._news)), self.app.console)

    def below(self, room: int) -> Text:
        """Return facts and the answer, or it with what must stay where the line has no room for more."""
        line = self.line(room)
        if not self._failed and not (self.said and line.cell_len > room):
            return line
        kept = [(part.words, *part.shorter)[-1] for part in self.facts() if part.words and part.rank in (0, STAYS)]
        stays = "".join(f"{each}{self.BETWEEN}" for each in kept)
        is_whole = self._failed and self._most_rows > 1
        words = stays + self.said
        answer = Text("\n".join(lines_of(words, room, self.app.console)) if is_whole else self.cut(words))
        if self._failed:
            answer.stylize(bold(self.app.theme_variables, "alarm"), len(stays))
        return answer

    def parts(self) -> list[LinePart]:
        return [*self.facts(), LinePart(0, self.said)]

    def facts(self) -> list[LinePart]:
        """Return what the screen always tells here."""
        return []


class InfoLine(MessageLine):
    """Of a table: marks, pending edits, filter; or what is to be typed."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.legend: Callable[[], str] = str  # of what is drawn in the table
        self._prompt = ""

    def ask(self, words: str) -> None:
        """Show what is to be typed, alone, whatever happens meanwhile; empty: no more."""
        self._prompt = words
        self.changed()

    def below(self, room: int) -> Text:
        return Text(self._prompt) if self._prompt else super().below(room)

    def facts(self) -> list[LinePart]:
        """Return them; what is pending and how many passed the filter stay longest. Of what an answer comes to, marks
        and filter stay beside it: the next key is about them.
        """
        session, rows = self.session, self.session.rows
        alone = not self.said  # what must stay has rank 0
        parts: list[LinePart] = []
        if rows.anchor is not None:
            parts.append(LinePart(3, f"range of {len(rows.range_rows())} ({key_of('range')} marks it)"))
        if rows.marked_count:
            hidden = f", {rows.hidden_marked} not shown" if rows.hidden_marked else ""
            parts.append(LinePart((9 if hidden else 4) * alone, f"{rows.marked_count} marked{hidden}"))
            parts.append(LinePart(2, unmark_words()))
        fields, elements = session.table.pending_count
        if fields:
            way = f" ({key_of('apply')} to apply)"
            parts.append(
                LinePart(STAYS, f"{fields} pending in {many(elements, 'element')}{way}", "", (f"{fields} pending",))
            )
        if conflicts := int(session.table.conflicts.sum()):
            parts.append(LinePart(0, f"! {many(conflicts, 'conflict')}"))
        if session.reading:
            parts.append(LinePart(0, session.reading))
        if rows.filter.text:
            unknown = (rows.filter.measured and not rows.is_measured) or (rows.most and not rows.stood_ns)
            shown = f"{len(rows.shown)} of {rows.passing if rows.most else len(session.table)}"
            stood = f" at {wall_clock(rows.stood_ns)}" if rows.stood_ns else ""
            passing = "being measured" if unknown else f"the first {shown}{stood}" if rows.most else shown
            is_near = rows.filter.text == session.near and session.near.startswith("~")  # a pattern of many names
            typed = f"/{rows.filter.text.removeprefix('/')}"
            near = f"near a limit at {wall_clock(session.near_ns)}"  # it moves on
            told = near if is_near else session.filter_words.get(rows.filter.text, "")  # what nobody typed, in words
            words = f"{told} ({typed})" if told and not is_near else told or typed
            parts.append(LinePart(6 * alone, f"{words}: {passing}", "", (f"{told or typed}: {passing}",)))
            parts += [LinePart(5, f"? {problem}") for problem in rows.filter.problems[:1]]
        if rows.sort not in STEADY or rows.turned:
            order = f"by {rows.sort} {rows.arrow}"
            held = f" ({HELD})" * rows.held
            back = f"; {key_of('sort')} {rows.orders[NAME].letter}: by name"
            parts.append(LinePart(3, f"{order}{held}{back}", "", (order + held, order)))
        if not parts and not self.said and len(rows.tree.lines):
            branches = len(rows.tree.branches)
            in_spaces = f"{len(rows.shown)} in {many(branches, 'name space')}"
            parts.append(LinePart(2, in_spaces if branches else f"element {rows.place} of {len(rows.shown)}"))
        if (edited := int(session.table.edited.sum())) and rows.filter.text != "edited":
            way = f"{key_of('view')} e" if key_of("view") else ":view edited"
            parts.append(LinePart(1, f"{edited} edited since the program began ({way})", "", (f"{edited} edited",)))
        legend = self.legend()
        since = LinePart(1, legend, "", (legend.partition(self.BETWEEN)[0],))
        return parts if self.said else [*parts, LinePart(1, _cursor_words(session)), since]


class MonitorLine(MessageLine):
    """Of plots: span, pause, cursor and scale."""

    def __init__(
        self, window: PlotWindow, told: Callable[[], Sequence[str]], state: Callable[[], str] | None = None
    ) -> None:
        """`state` returns whether plots stand still; None of a file, which always does."""
        super().__init__()
        self._window = window
        self._told = told
        self._state = state

    def facts(self) -> list[LinePart]:
        """Return what is shown of what; the last of it is read whole."""
        window = self._window
        whole = self._state is None and window.span_s == window.spans[-1]
        words = ["whole file" if whole else f"{text.span(window.span_s)} shown"]
        if self._state is not None:
            words += [self._state(), "y held" if window.fixed_scale else "y follows"]
        elif window.fixed_scale:
            words.append("y held")
        words += self._told()
        last = len(words) - 1 if not self.said else -1
        return [LinePart((place + 1) * (place != last), each) for place, each in enumerate(words)]


class ListLine(MessageLine):
    """Of a list: marks, filter, order, what is to be said of the line under the cursor; wraps, as far as it may go."""

    def __init__(self, share: float) -> None:
        """`share` is how much of the screen it takes at most."""
        super().__init__()
        self.told: Sequence[str] = ()
        self._share = share

    def below(self, room: int) -> Text:
        if self._failed:
            return super().below(room)
        told = self.told if self._most_rows > 1 or not self.said else []
        words = self.BETWEEN.join(filter(None, [self.cut(self.said), *told]))
        most = max(1, round(self.app.size.height * self._share)) if self._most_rows > 1 else 1
        return Text(beginning(words, room, most, self.app.console))


def _cursor_words(session: Session) -> str:
    """Return what columns can't tell of the row under the cursor: its sign in words, all digits, what is no number."""
    rows, parts = session.rows, []
    if rows.row is None:
        return ""
    element = session.table.elements[rows.row]
    reading = session.live.readings.get(element.name)
    state = sign_of(session.table, rows.row, reading) if session.fresh else OLD
    if state:
        why = NOT_LIVE_TEXTS[reading.why] if reading is not None and reading.why and state in (OLD, FULL) else ""
        parts.append(why if state == FULL else f"{state}: {why or MEANINGS[state]}")
    position = rows.entry or 0
    if reading is not None and (rows.entry is not None or len(element.entries) == 1):
        word = reading.texts.get(position, "")
        parts += [word] if element.entries[position].dtype[1:2] in "iu" and len(word) > LONG else []
    name = element.name + (element.entries[position].suffix if rows.entry is not None else "")
    bad = session.table.facts.detail(name, "bad")
    if bad > 0:
        parts.append(f"{many(int(bad), 'sample')} nan or inf: min to std leave nan out")
    return " │ ".join(parts)
