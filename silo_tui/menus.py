"""The reader of keys: what is pressed on a full screen becomes a command, at once or by a menu.

A menu is a state of the reader and no screen: it is drawn over the rows above the key bar only where its letter isn't
followed by another at once, so that `g r` typed on sends no cell.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rich.cells import cell_len
from rich.text import Text
from textual import events
from textual.timer import Timer
from textual.widgets import Static

from silo_tui.actions import BY_ID, Command, commands_for, key_of, key_text
from silo_tui.context import SiloScreen
from silo_tui.keymap import DESTROYS, MENUS, TURNED, TWO_LAYERS, command_of, counts, in_menu, where
from silo_tui.model.words.names import cut_words, fitted_among
from silo_tui.unforeseen import Guarded

DRAWN_AFTER_S = 0.25
DRAWN_AFTER_THIN_S = 0.6
NOT_AGAIN = ("load_script", "load_preset", "load_into_loggers", "save_script", "control")
LINES, ARROWS = ("filter", "list_filter", "command"), ("up", "down", "left", "right")
MOST_ROWS = 7
LEAST_COLUMN = 24
LEAST_NAME = 12  # cells


class MenuLines(Guarded, Static):
    """The entries of a menu."""


class MenuReader:
    """What is pressed on full screens, and the menu that is open on one."""

    def __init__(self, app: Any, is_fast: Callable[[], bool]) -> None:
        """`is_fast` tells whether the link to the terminal carries all that is shown."""
        self._app, self._is_fast = app, is_fast
        self._menu = ""  # the command that opened it
        self._on: SiloScreen | None = None
        self._timer: Timer | None = None
        self._lines: MenuLines | None = None  # where it is drawn
        self._refused = False  # whether an entry can't be done now

    def takes(self, typed: events.Key | events.Paste) -> bool:
        """Carry out what was typed, where it is a key of a full screen; False: it is for what has the focus."""
        screen = self._app.screen if self._app.screen_stack else None
        if self._menu and screen is not self._on:
            self.close()
        if not isinstance(screen, SiloScreen):
            return False
        typing = screen.is_typing
        if isinstance(typed, events.Paste):
            if not typing:
                self._app.context.say(f"{len(typed.text)} characters pasted outside a line are no keys: left out")
            return not typing
        command = command_of(typed.key, screen.scope)
        if self._menu and (command is None or command.id != "quit_now"):
            self._take_letter(screen, typed.key)
        elif command is None or (typing and command.id != "quit_now"):
            return False
        else:
            screen.action_command(command.id)
        return True

    def open(self, menu: str) -> None:
        """Open a menu; it is drawn where nothing follows."""
        self.close()
        self._menu, self._on, self._refused = menu, self._app.screen, False
        self._timer = self._app.set_timer(DRAWN_AFTER_S if self._is_fast() else DRAWN_AFTER_THIN_S, self.draw)

    def close(self) -> None:
        """Leave the menu."""
        if self._timer is not None:
            self._timer.stop()
        if self._on is not None and self._on.is_there:
            if self._lines is not None:
                self._lines.remove()  # it takes a moment, in which another may be drawn
                self._on.show_keys("")
                self._on.cover_messages(False)
                self._on.read_said()  # what it said of a letter
            self._on.update_keys()
        self._menu, self._on, self._timer, self._lines = "", None, None, None

    def _take_letter(self, screen: SiloScreen, key: str) -> None:
        back = command_of(key, screen.scope)
        if back is not None and back.id in ("back", "quit"):
            self.close()
            return
        entries = in_menu(self._menu, screen.scope).get(key)
        if entries is None and back is not None and back.id in MENUS:
            screen.action_command(back.id)
            return
        leaves = back is not None and (back.id in LINES or (self._refused and key in ARROWS))
        if entries is None and back is not None and leaves:  # one may not know that a refusal left the menu open
            self.close()
            screen.action_command(back.id)
            return
        if entries is None:
            self.draw()
            self._app.gate.refused()
            screen.context.say(f"{key_text(key)} is not in the menu; {key_of('back')} leaves it", hint=True)
            return
        command = entries[0]
        letter, path = self._menu, self._path(key)
        why = self._why_not(screen, entries)
        if self._lines is None or not why:  # who reads the menu may pick another entry
            self.close()
        if why:
            self._refused = True
            # the menu leaves one row to read, for the sentence, its beginning, or a few words
            few, *told = (f"{path} ({command.label}): {words}" for words in (why[0], why[1], why[1].partition(";")[0]))
            fits = (words for words in told if self._lines is None or cell_len(words) <= self._app.size.width - 2)
            screen.context.say(next(fits, few))
            return
        if letter in ("menu_edit", "menu_view", "menu_plots") and command.id not in NOT_AGAIN:
            screen.repeats = partial(screen.action_command, command.id)
            screen.repeated = command.id
        screen.action_command(command.id)

    def _path(self, key: str) -> str:
        return key_text(f"{key_of(self._menu)} {key}")

    def _why_not(self, screen: SiloScreen, entries: Sequence[Command]) -> tuple[str, str] | None:
        """Return why an entry can't be done now, in a few words and in a sentence; None where it can.

        Of the commands that share its letter the first is that of this screen, if there is one.
        """
        context, scope, command = screen.context, screen.scope, entries[0]
        if command.id in MENUS:
            return None
        deletes = next((each.id for each in commands_for(scope) if TWO_LAYERS.get(each.id) == DESTROYS), "")
        if command.id == "discard" and deletes and scope not in command.scopes:
            by = f"{key_of(deletes)} deletes"
            return by, f"{by} what the cursor is on, or all that are marked"
        if not counts(command, scope):
            return where(entries, scope)
        own = scope in command.scopes or "any" in command.scopes
        if not context.has_session and not own and command.asks | command.writes | bool(command.scopes):
            return "no logger", f"no logger is open; {key_of('open_logger')} opens one that is listed"
        why_not = context.why_not(command) if scope != "loggers" or context.read_only else None
        if why_not is not None and not command.retries:
            return why_not
        why = screen.why_not_now(command.id)
        return (why, why) if why else None

    def draw(self) -> None:
        """Draw the menu that is open."""
        screen = self._on
        if not self._menu or screen is None or self._app.screen is not screen or self._lines is not None:
            return
        self._lines = MenuLines(self.picture(screen, self._app.size.width - 2), markup=False)
        screen.mount(self._lines)
        screen.cover_messages(True)
        screen.show_keys(f"a letter Does what stands behind it  {key_of('back')} Leaves the menu")

    def picture(self, screen: SiloScreen, width: int) -> Text:
        """Return the entries in columns: a letter, what it does or is now; in brackets what can't be done, and why."""
        meant = in_menu(self._menu, screen.scope)
        entries: dict[str, Command] = {}
        for key, commands in meant.items():
            if commands[0] not in entries.values():  # one that has two letters here is shown with its first
                entries[key] = commands[0]
        reasons = {key: self._why_not(screen, commands) for key, commands in meant.items()}
        of_all = {why[0] if why else "" for why in reasons.values()}  # one that all have is told once
        count = max(-(-len(entries) // MOST_ROWS), min(3, width // LEAST_COLUMN, len(entries)))
        rows, column = -(-len(entries) // count), width // count
        title, about = BY_ID[self._menu].help.removeprefix("the menu of "), screen.subject
        if len(of_all) == 1:
            rest = f"  (now: {one})" if (one := of_all.pop()) else ""
        else:
            rest = "  ( ) not now: type it for why"
        leaves, key = f"{key_of('back')} back", key_of(self._menu)
        room = width - len(leaves) - 2 - len(key) - 2
        rest = rest if len(rest) + LEAST_NAME <= room else ""
        if about and self._menu not in ("menu_go", "menus"):  # it may cover the line
            title = f"{BY_ID[self._menu].label}: "
            is_name = about.startswith("/") and " " not in about  # else words of several
            title += fitted_among(about, (), max(LEAST_NAME, room - len(title) - len(rest))) if is_name else about
        picture = Text(f"{key}  {cut_words(title, room - len(rest))}{rest}", style="bold", no_wrap=True)
        picture.append(" " * (width - picture.cell_len - len(leaves)) + leaves, style="not bold")
        drawn = []
        for key, command in entries.items():
            why = reasons[key]
            value = (why[0] if of_all else "") if why else screen.value_now(command.id)
            entry = Text(f"({key_text(key)})" if why else f" {key_text(key)} ", style="" if why else "bold")
            words = f" {command.label}{': ' if value else ''}{value}"
            if entry.cell_len + cell_len(words) > column - 1:  # no word is cut, and one blank stays
                words = f" {command.label}"
            entry.append(cut_words(words, column - 1 - entry.cell_len), style="not bold")
            drawn.append(entry)
        for row in range(rows):
            picture.append("\n")
            for entry in drawn[row::rows]:
                picture.append_text(entry).append(" " * (column - entry.cell_len))
        return picture

    def again(self, *, turned: bool) -> None:
        """Do what was done last by a menu once more, or the other way round."""
        screen: SiloScreen = self._app.screen
        if not screen.repeated:
            screen.context.say("nothing to do again yet: it repeats what a menu of edit, view or plots did last")
        elif not turned:
            if why := screen.why_not_again:
                screen.context.say(f"{key_of('again')} ({BY_ID[screen.repeated].label}): {why}")
            else:
                screen.repeats()
        elif screen.repeated in TURNED:
            screen.action_command(TURNED[screen.repeated])
        else:
            screen.context.say(f"{BY_ID[screen.repeated].label} has no other way; {key_of('undo')} takes an edit back")
