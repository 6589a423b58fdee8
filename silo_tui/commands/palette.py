"""The command palette: every command of the screen, what can only be typed, and saved files to open.

What takes an argument goes on in the command line, with its word typed already.
"""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.content import Content
from textual.fuzzy import Matcher
from textual.markup import escape

from silo_tui.actions import COMMANDS, FILE_SCOPES, commands_for, commands_like, key_of, typed_on_file
from silo_tui.context import SiloScreen
from silo_tui.keymap import counts, where

if TYPE_CHECKING:
    from silo_tui.screens.lists.help import HelpLine

BY_HELP = 0.25  # of what is told, not done
BY_WORDS = 0.5  # what has these letters anywhere, above that
CALLED, TOLD = 1000.0, 500.0  # above all by letters: a name that has these words, then a sentence


class CommandProvider(Provider):
    """Feeds the palette from the list of commands."""

    async def discover(self) -> Hits:
        """Return everything, before anything is typed."""
        for title, words, do in self._offers():
            yield DiscoveryHit(Content(title), do, title, escape(words))

    async def search(self, query: str) -> Hits:
        """Return what matches: first what has the words that were typed, or their beginnings, in its name, then in its
        sentence; then a name by its letters, and what has those of each word somewhere.
        """
        matcher, typed = self.matcher(query), query.lower().split()
        begins = [re.compile(rf"\b{re.escape(word)}" if word[0].isalnum() else re.escape(word)) for word in typed]
        for title, words, do in (*self._offers(), *self._of_large_plots(), *self._of_others()):
            told = f"{title} {words}".lower()
            score = max(matcher.match(_name(title)), BY_WORDS * all(word in told for word in typed))
            at = [CALLED] * all(each.search(_name(title).lower()) for each in begins)
            at += [TOLD] * all(each.search(told) for each in begins)
            score += max(at, default=0.0)
            if score > 0:
                yield Hit(score, _lit(matcher, title), do, help=escape(words))
        for line in self._of_help():
            if line.holds(typed):
                yield Hit(BY_HELP, Content(line.left.strip()), partial(self._tell, line), help=escape(line.right))

    def _offers(self) -> Iterator[tuple[str, str, Callable[[], None]]]:
        """Yield title, meaning and what is done: by key, by a word to type, by a file to open."""
        screen = self.screen
        if not isinstance(screen, SiloScreen):
            return
        known = [command for command in commands_for(screen.scope) if not command.hidden]
        for command in known:
            yield f"{command.label}  ({command.key_text})", command.help, partial(screen.action_command, command.id)
        if not any(command.id == "command" for command in known):
            return
        there = {command.id for command in known}
        on_file = screen.scope in FILE_SCOPES
        for command in COMMANDS:
            typed = command.typed
            if typed is None or (on_file and not typed_on_file(command)) or (command.id in there and not typed.usage):
                continue
            for word in typed.words if command.id not in there else typed.words[:1]:
                words = typed.help or command.help
                yield f":{typed.usage.lstrip(':') or word}", words, partial(screen.begin_command, word)

    def _of_large_plots(self) -> Iterator[tuple[str, str, Callable[[], None]]]:
        """Yield what there is in large plots alone, as spectra: plots show it, elsewhere it leads there."""
        screen = self.screen
        if not isinstance(screen, SiloScreen):
            return
        here = {command.id for command in commands_for(screen.scope)}
        way = next((id_ for id_ in ("detail", "monitor", "plot") if id_ in here), "")
        large = "file_detail" if screen.scope in FILE_SCOPES else "detail"
        if not way or screen.scope == large:
            return
        for command in commands_for(large):
            if command.group != "Large plot" or command.id in here or command.hidden:
                continue
            steps = f"large plot, {command.key_text}"
            note = f"{command.label}: {command.key_text}, once one plot is large"
            is_next = way == "detail" or {"monitor", "file_monitor"} & set(command.scopes)  # plots have it, too
            then = command.id if is_next and command.id != "mode" else ""  # which goes from one to the next
            lead = partial(self._lead, screen, way, note, then)
            yield f"{command.label}  ({steps})", command.help, lead

    def _of_others(self) -> Iterator[tuple[str, str, Callable[[], None]]]:
        """Yield what other screens have: chosen, it says which, and how to come there."""
        screen = self.screen
        if not isinstance(screen, SiloScreen):
            return
        for command in commands_like(screen.scope):
            if not (counts(command, screen.scope) or command.hidden or command.group in ("Move", "Large plot")):
                place, _ = where([command], screen.scope)
                say = partial(screen.action_command, command.id)
                yield f"{command.label}  ({place}, {command.key_text})", command.help, say

    def _of_help(self) -> Iterator["HelpLine"]:
        """Yield what only the help has, of all screens: signs, columns, words of filters, what is done in a shell."""
        from silo_tui.screens.lists.help import entries  # no first screen waits for it

        if isinstance(self.screen, SiloScreen):
            found = entries(self.screen.scope, everywhere=True)
            yield from (line for line in found if not (line.command or line.left.startswith(":")))

    def _tell(self, line: "HelpLine") -> None:
        if isinstance(self.screen, SiloScreen):
            self.screen.context.say(f"{line.left.strip()}: {line.right}")

    def _lead(self, screen: SiloScreen, way: str, note: str, then: str) -> None:
        """Go there, and do what is wanted if it is one step away; say how to go on otherwise."""
        screen.action_command(way)
        large = self.app.screen
        if then and isinstance(large, SiloScreen) and large is not screen:
            self.app.call_after_refresh(large.action_command, then)
            return
        screen.context.say(note if way == "detail" else f"{note}: {key_of('detail')} makes it so")


def _lit(matcher: Matcher, title: str) -> Content:
    """Return a title with the letters that match, whatever brackets it has."""
    lit = Content(title)
    for at in matcher.fuzzy_search.match(matcher.query, _name(title))[1]:
        lit = lit.stylize(matcher.match_style, at, at + 1)
    return lit


def _name(title: str) -> str:
    """Return a title without the keys and the place behind it."""
    return title.partition("  (")[0]
