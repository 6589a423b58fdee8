"""The lines around the table: status on top, banner, information, keys at the bottom."""

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, cast

import msgspec
from msgspec.structs import replace
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text
from textual.app import RenderResult
from textual.widget import Widget

from silo.core.elements import State, is_stalled
from silo.core.quantities.writing import duration_text, idle_words
from silo_tui.actions import BY_ID, KEY_TEXTS, Command, commands_for, key_of, key_text, key_that_retries, with_keys
from silo_tui.keymap import in_bar
from silo_tui.model.lists import recorders
from silo_tui.model.lists.conditions import head_words
from silo_tui.model.words import text
from silo_tui.model.words.names import cut_words
from silo_tui.model.words.people import head_words as people_head
from silo_tui.sessions.live import Session
from silo_tui.terminal import thin_head
from silo_tui.theme import ROLES, bold, color
from silo_tui.unforeseen import Guarded

OF_MODE = 99  # rank in the key bar of what a mode asks for: all else gives way first
# what never gives way, whatever a mode asks for
ALWAYS = {"table": ("edit", "menu_edit", "apply", "undo", "start_stop")}
LONG = 10  # digits from which on a column may not have room for a whole number
# how what a dead program left is opened: Enter has a meaning of its own on most screens
OPENS = {"table": ("monitor", "edit"), "monitor": ("detail",)}
OPEN_FILE = "Open the file"  # what the first of these keys is called then, which stays in the bar
STATE_SIGNS = {State.RUNNING: "● RUNNING", State.STOPPED: "■ STOPPED", State.DEAD: "✖ DEAD"}


class LinePart(msgspec.Struct, frozen=True):
    """Words of a line. The lowest `rank` gives way first, for one of `shorter` where there is one; 0 never does."""

    rank: int
    words: str
    style: str = ""
    shorter: tuple[str, ...] = ()
    at_end: bool = False  # stands at the right end, with what follows: it comes and goes, and shifts nothing


def fitting(parts: Sequence[LinePart], room: int, between: str = "") -> list[LinePart]:
    """Return the parts of which so many cells have room."""
    kept = [part for part in parts if part.words]
    while sum(cell_len(part.words) for part in kept) + len(between) * (len(kept) - 1) > room:
        at = min((at for at, part in enumerate(kept) if part.rank), key=lambda at: kept[at].rank, default=None)
        if at is None:
            break
        part = kept[at]
        less = [replace(part, rank=part.rank * (len(part.shorter) > 1), words=each) for each in part.shorter[:1]]
        kept[at : at + 1] = [replace(each, shorter=part.shorter[1:]) for each in less]
    return kept


class FittingLine(Guarded, Widget):
    """One line of parts, as many as there is room for."""

    BETWEEN = " │ "

    @abstractmethod
    def parts(self) -> list[LinePart]:
        """Return what there is to say, from left to right."""

    def line(self, room: int) -> Text:
        """Return what of it has room, the last one cut where even what must stay has none."""
        line, parts = Text(no_wrap=True, overflow="ellipsis"), fitting(self.parts(), room, self.BETWEEN)
        for place, part in enumerate(parts):
            if part.at_end and not parts[place - 1].at_end:
                line.append(" " * (room - line.cell_len - sum(cell_len(each.words) for each in parts[place:])))
            line.append(self.BETWEEN if place else "").append(part.words, style=part.style)
        return line

    def render(self) -> RenderResult:
        return self.line(self.content_size.width)


class StatusBar(FittingLine):
    """A logger, or a file, at a glance: who, what state, how long, what was lost, how fast, how many; at the right end
    what isn't as always.

    It stands still: numbers have a width of their own, and the last of the left gives way first.
    """

    BETWEEN = ""

    def __init__(self, session: Session, *, beside_rows: bool = True) -> None:
        super().__init__()
        self.session = session
        self._beside_rows = beside_rows  # whose numbers it tells alarms of; elsewhere they may be of long ago
        self._drawn = ""
        self.mode = ""  # stands reversed behind the state

    def update(self) -> None:
        """Paint anew if it reads differently."""
        if self._line().plain != self._drawn:
            self.refresh()

    def render(self) -> RenderResult:
        line = self._line()
        self._drawn = line.plain
        return line

    def _line(self) -> Text:
        """As much as there is room for: what is as always gives way first, an alarm and a loss never."""
        return self.line(self.content_size.width)

    def parts(self) -> list[LinePart]:
        """Return what is as always before what gives way last."""
        session, status, wide = self.session, self.session.status, self.size.width >= 100
        variables, thin = self.app.theme_variables, self._thin()
        if session.at_s is not None:
            shortest = sum(len((each.words, *each.shorter)[-1]) for each in thin)
            told = session.facts_words(self.content_size.width - shortest, wide=wide)
            return [
                *(LinePart(rank, words, bold(variables, style) if style in ROLES else style)
                  for rank, words, style in told), *thin,
            ]  # fmt: skip
        host = f"{status.host}/" if status.host and self.size.width >= 60 else ""
        parts = [LinePart(12, "silo ", "bold"), LinePart(0, f"{session.address or host + session.name}  ")]

        def add(rank: int, words: str, style: str = "") -> None:
            parts.append(LinePart(rank, words, style))

        if not session.link or status.helper_pid == 0:
            add(0, "connecting …")
            return parts
        if not session.connected:  # what it was; how it stands now nobody knows
            sign = "- CLOSED" if session.closed else "~ NO LINK"
            add(0, f"{sign} {text.since(session.lost_s)}", bold(variables, "dead"))
            add(5, f", was {status.state.name}")
        else:
            name = {State.RUNNING: "success", State.STOPPED: "warning", State.DEAD: "dead"}[status.state]
            add(0, STATE_SIGNS[status.state], bold(variables, name))
            add(10, f" {duration_text(session.run_seconds)}" if status.started_ns else "")
        if self.mode:
            initials = " ".join(some.split()[0] for some in self.mode.split("  ") if some.strip())
            shorter = tuple(f" {words} " for words in (self.mode.partition(",")[0], initials) if words)
            parts += [LinePart(0, "  "), LinePart(9, f" {self.mode} ", "reverse", shorter)]
        if lost := session.lost_total:
            add(0, f"  lost {text.count(lost)}", bold(variables, "alarm"))
        elif session.fresh:  # of a dead program nobody knows what it would have logged
            add(11, "  lost 0")
        if session.connected:
            parts += self._pace(wide=wide)
        limits = session.limits_shown() if self._beside_rows else session.limits
        judged = ([], []) if session.dead else (session.triggers, limits)  # nobody watches any more
        alarm, is_red, watching = head_words(*judged)
        parts += thin
        for rank, forms, role in ((8, alarm, "alarm" if is_red else "warning"), (6, watching, "")):
            long, *less = [f"  {words}" for words in forms] or [""]  # neither ever gives way, their words do
            parts.append(LinePart(rank, long, bold(variables, role), tuple(less), at_end=True))
        parts += self._recorders()
        self._add_others(lambda rank, words, style: parts.append(LinePart(rank, words, style, at_end=True)))
        return parts

    def _thin(self) -> list[LinePart]:
        """Return what the link, or this computer, does not take; of the link less and less."""
        forms: list[str] = []
        room, live = self.content_size.width, self.session.running and self.session.at_s is None and not self.mode
        while (words := thin_head(self.app, room)) and f"  {words}" not in forms:
            if not live and not words.startswith("THIN"):
                break  # of what stands still nothing is drawn too rarely
            forms.append(f"  {words}")
            room = len(words) - 1
        caution = color(self.app.theme_variables, "warning")
        rank = 4 if len(forms) > 1 or " of " in "".join(forms) else 0  # a number alone may go
        return [LinePart(rank, forms[0], caution, tuple(forms[1:]), at_end=True)] if forms else []

    def _recorders(self) -> list[LinePart]:
        """Return how many record, and how much is on the disk of it where there is room."""
        count, size = self.session.status.recorders, recorders.head_words(self.session.recorders)
        words, style = f"  REC {count}", bold(self.app.theme_variables, "success")
        whole = LinePart(4, f"{words}  {size}", style, (words,), at_end=True)
        return [] if not count else [whole] if size else [LinePart(0, words, style, at_end=True)]

    def _add_others(self, add: Callable[[int, str, str], None]) -> None:
        """Add how much is durable, who may change something, and who is there."""
        session, status, variables = self.session, self.session.status, self.app.theme_variables
        caution = color(variables, "warning")
        if status.durable_ticks >= 0:  # storage="disk"
            add(1, f"  durable to tick {text.count(status.durable_ticks)}", "")
        if not session.may_edit or cast(Any, self.app).context.read_only:
            add(0, "  read-only", caution)
        controlling, others = people_head(session.status, session.identity, session.own_name)
        if controlling:
            add(0, f"  {controlling}", "" if session.has_control else caution)
        if others:
            add(5, f"  {others}", "")

    def _pace(self, *, wide: bool) -> list[LinePart]:
        """Return how fast is logged, and how much."""
        session, status, variables = self.session, self.session.status, self.app.theme_variables
        caution, nominal_hz = bold(variables, "warning"), status.frequency_hz
        rate, slow = rate_words(session.measured_hz, nominal_hz), " slow" * session.loop_slow
        parts = []
        if session.running and is_stalled(session.idle_s, nominal_hz):
            parts.append(LinePart(0, f"  ‼ {idle_words(session.idle_s)}", bold(variables, "alarm")))
        elif session.running:
            shorter = (f"  {rate.strip()} Hz{slow}", *([] if slow else [""]))
            told = f"  {rate} of {text.short(nominal_hz)} Hz{slow}"
            parts.append(LinePart(7, told, slow and caution, shorter))  # before alarms, which have 8; `slow` stays
        if (not (self.mode or status.recorders) or wide) and not session.dead:  # what isn't normal needs the room
            room = " " * (len(" slow") if session.running and not slow else 0)
            parts.append(LinePart(3, f"{room}  {status.enabled}/{status.elements}{' elements' * wide} on"))
            parts.append(LinePart(2, f" +{status.derived} derived" if status.derived else ""))
        if wide:
            ticks = text.count(session.ticks)  # since a cut, if there was one
            words, *less = f"  {ticks} ticks", ""
            if status.before_ticks:
                before = text.count(status.before_ticks)
                words, *less = f"  {before} ticks before the cut, {ticks} since", f"  {ticks} ticks since the cut", ""
            parts.append(LinePart(1, words, "", tuple(less)))
        if slow and wide and session.jitter_s:
            parts.append(LinePart(1, f"  jitter {text.span(session.jitter_s, 2)}", caution))
        return parts


def rate_words(rate_hz: float, nominal_hz: float) -> str:
    """Return a measured rate in four digits, as wide as the rate that it should be; `…` where none was measured yet."""
    decimals = min(3, max(0, 3 - math.floor(math.log10(nominal_hz)))) if nominal_hz > 0 else 1
    return f"{f'{rate_hz:.{decimals}f}' if rate_hz else '…':>{len(f'{nominal_hz:.{decimals}f}')}}"


def left_a_file(session: Session) -> bool:
    """Return whether a robot program that died left a file."""
    reason = session.status.reason
    return session.dead and bool(session.left_files or ": saved " in reason or "; saved " in reason)


def lines_of(words: str, room: int, console: Console) -> list[str]:
    """Return words in lines of so many cells, broken at blanks, none of them within a number or the keys of a menu."""
    return [text.loosened(line.plain) for line in Text(text.held(words)).wrap(console, room)]


class Banner(Guarded, Widget):
    """What is wrong and what to do, in one or two lines over the table; hidden when all is well."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self._shown = ""

    def on_mount(self) -> None:
        self.update()

    def update(self) -> None:
        """Follow the state of the logger."""
        words = self._words()
        if words != self._shown:
            self._shown = words
            self.display = bool(words)
            self.refresh(layout=True)

    def render(self) -> RenderResult:
        return Text("\n".join(lines_of(self._shown, max(1, self.app.size.width - 2), self.app.console)))

    def _words(self) -> str:
        session = self.session
        if session.at_s is not None:
            return session.trouble(2 * self.app.size.width - 16)  # two lines, and what breaking at words costs
        if session.link is None:
            return ""
        if session.closed:
            told = key_of("messages") or ":messages"
            return f"The robot program closed {session.name}; {told} tells how. silo-tui follows when it starts again."
        if session.lost_s is not None:
            retries = key_that_retries(getattr(self.screen, "scope", ""))
            tries = f" {retries} tries now." if retries else ""
            kept = ", pending edits are kept" if session.table.pending_count[0] else ""
            return f"No link to {session.name}. Values are {text.since(session.lost_s)} old{kept}.{tries}"
        if session.dead:
            words = f"{session.name} died: {session.status.reason or 'nothing is known of why'}"
            if left_a_file(session):
                words = f"{words.rstrip('.')}. {self._opens()}"
            if cast(Any, self.app).context.has_demo():
                words = f"{words.rstrip('.')}; {key_of('loggers')}, then {key_of('demo')} starts the demo again."
            return words
        if len(session.table) and not session.table.live.any() and session.running:
            keys = f"press {key_of('toggle')}, then {key_of('apply')} to apply"
            return f"Nothing is logged, every element is off: mark elements, {keys}."
        return ""

    def _opens(self) -> str:
        """Return how what a dead program left is opened."""
        scope = getattr(self.screen, "scope", "")
        if scope == "recordings":
            return "It is in this list."
        keys = [key_of(each, last=True) for each in OPENS.get(scope, ())]
        enter = key_text("enter")
        return f"{enter if enter in keys else keys[0]} opens it." if keys else f"{key_of('recordings')} lists it."


def _called(command: Command, label: str) -> Command:
    """Return a command with this label; most have it, and each key asks for all of them."""
    return command if command.label == label else replace(command, label=label)


def _first_and_last(words: str, room: int) -> str:
    """Return the keys of a dialog as far as there is room: what Enter does and how one leaves stay, that whole."""
    keys, between = words.split("  "), "  "
    ends = (0, len(keys) - 1)
    parts = [LinePart(0 if at in ends else len(keys) - at, each) for at, each in enumerate(keys)]
    first, *rest = [part.words for part in fitting(parts, room, between)]
    left = room - sum(cell_len(each) + len(between) for each in rest)
    return between.join([cut_words(first, max(1, left)), *rest])


def _as_many(parts: Sequence[LinePart], room: int, between: str) -> list[LinePart]:
    """Return the keys that have room, the most wanted first, and others that fit where one has none."""
    kept: list[LinePart] = []
    for part in sorted(parts, key=lambda part: part.rank)[::-1]:
        if sum(cell_len(each.words) + len(between) for each in (*kept, part)) <= room + len(between):
            kept.append(part)
    return [part for part in parts if part in kept]


class KeyBar(Guarded, Widget):
    """The keys that matter now, as many as fit; help and quit always at its end. A click does what the key does."""

    LAST = ("help", "quit")

    def __init__(self) -> None:
        super().__init__()
        self.auto_links = False
        self._instead = ""
        self._drawn: list[tuple[Command, int]] = []

    def show_instead(self, words: str) -> None:
        """Show other keys for a while, of a line to type in or a dialog; empty: those of the screen again."""
        self._instead = words
        self.refresh()

    def update(self) -> None:
        """Paint anew if other keys count now."""
        if self._commands() != self._drawn:
            self.refresh()

    def _commands(self) -> list[tuple[Command, int]]:
        """Return what is shown from left to right, with its rank: what the screen's mode asks for, then the rest."""
        screen = cast(Any, self.screen)
        in_mode = [_called(with_keys(BY_ID[each]), label) for each, label in screen.mode_keys()]
        if getattr(screen, "session", None) is not None and screen.session.lost_s is not None:
            tries = [command for command in commands_for(screen.scope) if command.retries]
            in_mode = [*(_called(command, "Try now") for command in tries), *in_mode]
        known = {command.id for command in in_mode}
        shown = in_bar(screen.scope, read_only=cast(Any, self.app).context.read_only)
        labels = [(command, rank, screen.label_now(command)) for command, rank in shown]
        always = ALWAYS.get(screen.scope, ())
        first = OF_MODE + 1
        now = [
            (_called(command, label), first if command.id in always or label == OPEN_FILE else rank)
            for command, rank, label in labels
        ]
        mode = [(command, OF_MODE - place) for place, command in enumerate(in_mode)]
        return [*mode, *((command, rank) for command, rank in now if command.id not in known and command.label)]

    def render(self) -> RenderResult:
        """Return as many keys as fit, close together before one gives way."""
        if self._instead:
            style = bold(self.app.theme_variables, "foreground")
            return Text(f" {_first_and_last(self._instead, self.size.width - 1)}", style, no_wrap=True)
        self._drawn = self._commands()
        words = {word.plain: (word, rank, command.id) for command, rank in self._drawn if (word := self._word(command))}
        parts = [LinePart(rank, plain) for plain, (_, rank, each) in words.items() if each not in self.LAST]
        last = [plain for end in self.LAST for plain, (_, _, each) in words.items() if each == end]
        for between in ("  ", " "):
            end = Text(between, no_wrap=True).join(words[plain][0] for plain in last)
            room = self.size.width - 1 - len(end) - len(between)
            kept = _as_many(parts, room, between)
            if len(kept) == len(parts) or not with_keys(BY_ID["menu_go"]).keys:
                break
        line = Text(" ", no_wrap=True, overflow="ellipsis")
        line.append_text(Text(between).join(words[part.words][0] for part in kept))
        line.append(" " * (self.size.width - len(end) - line.cell_len))
        return line.append_text(end)

    def _word(self, command: Command) -> Text:
        key_color = color(self.app.theme_variables, "primary")
        word = Text(command.footer_key, style=f"bold {key_color}" if not self.app.no_color else "bold")
        other, _, label = command.label.partition(" ")  # one entry may be of two keys: `+ - Zoom`
        if label and (not other[0].isalnum() or other in KEY_TEXTS.values()):
            word.append(f" {other}")
        else:
            label = command.label
        word = Text().append_text(word).append(f" {label}")
        word.apply_meta({"@click": f"screen.command('{command.id}')"}, 0, len(word))
        return word
