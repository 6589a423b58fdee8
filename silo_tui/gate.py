"""The one way in for what is typed: a key is let through when the last one was carried out, with what it opened.

Over a slow link, or in a busy program, keys come before the dialog that they answer was made. Textual gives a key to
what has the focus as it comes: it answered nobody, or edited the table below.
"""

import asyncio
import math
import re
import time
from collections import deque
from collections.abc import Callable
from typing import Any, cast

from textual import events
from textual.app import ComposeResult
from textual.message_pump import MessagePump
from textual.widgets import Input, Static

from silo_tui.modal import Dialog, run_aside
from silo_tui.model.words import text

AT_ONCE = ("ctrl+q",)  # ends the program, whatever is waited for
LETS_GO = ("escape", "ctrl+c")  # what is waited for while a flow is under way
DROPPED = "keys typed before this question was there were dropped: it may lose something"
STRAY = "what was typed on at once, behind a key that is none here, was left out"
TELLS_AFTER_S = 0.3
IN_ONE_GO_S = 0.5  # between the letters of a word
WALKS = 2  # the key up to the app, then what it posted on its way
Typed = events.Key | events.Paste


async def _done(pump: MessagePump, *, drawn: bool = False) -> None:
    """Wait until a pump has done what it was told until now, and drawn it; or until it has ended."""
    queue: Any = pump._message_queue
    if not drawn and not queue.values and queue.ready_event._waiters:
        await asyncio.sleep(0)  # it was told nothing: no message has it say so
        return
    passed = asyncio.Event()
    if not (pump.call_after_refresh if drawn else pump.call_later)(passed.set):
        return
    tasks = [pump._task] if pump._task else []
    ended = cast(Callable[[object], None], lambda _: passed.set())  # no task of its own waits: some ten a key
    for task in tasks:
        task.add_done_callback(ended)
    await passed.wait()
    for task in tasks:
        task.remove_done_callback(ended)


class Gate:
    """Keeps what is typed until what it is meant for is there. What it waits for are facts, never a time."""

    def __init__(self, app: Any) -> None:
        self._app = app
        self._kept: deque[Typed] = deque()
        self._through: list[Typed] = []  # on their way, until they pass
        self._moved = asyncio.Event()
        self._typed = asyncio.Event()
        self._serves = False
        self.free = True  # whether all that was typed is carried out
        self.holds = False  # while what was opened is shown, one screen after another
        self._spelled: tuple[str, str, float] = "", "", 0.0  # what a letter chose, as far as it is typed, and when
        self._last = self._opener = ""  # the last key, and the one before what was chosen, which opens that again
        self._letter_s = self._stray_s = -math.inf  # when the last letter was typed, and one of a word for nobody

    def keeps(self, typed: Typed) -> bool:
        """Whether what was typed must wait, or is dropped; else it is carried out now."""
        if not self._app.screen_stack:
            return False
        if any(typed is each for each in self._through):
            self._through = [each for each in self._through if each is not typed]
            if self._app.screen.is_mounted:
                return False
            # a screen that is being made opened by itself meanwhile
            self._kept.insert(sum(each.time < typed.time for each in self._kept), typed)
            return True
        key = typed.key if isinstance(typed, events.Key) else ""
        waits = isinstance(self._app.screen, Dialog) and self._app.screen.waits
        if key in AT_ONCE or (waits and key in LETS_GO):
            self._kept.clear()
            return False
        self._kept.append(typed)
        if self.free:
            self.free = False
            if not (waits or self.holds):
                self._let_through()
            self._typed.set()
            if not self._serves:
                self._serves = True
                run_aside(self._app, "keys", self._serve)
        return True

    def drop(self) -> None:
        """Forget what was typed for a dialog that never came."""
        self._kept.clear()

    def moved(self) -> None:
        """Look again: what was waited for has come, or won't."""
        self._moved.set()

    def _let_through(self) -> None:
        typed, top = self._kept.popleft(), self._app.screen
        if isinstance(top, Dialog) and typed.time < top.drawn_s and top.may_lose(typed):
            self._app.context.say(DROPPED)
            while self._kept and self._kept[0].time < top.drawn_s:  # what followed it was meant for where it led
                self._kept.popleft()
            return
        if self._is_astray(typed) or self._spells_on(typed, top):
            return
        letter = (typed.character or "") if isinstance(typed, events.Key) else ""
        self._letter_s = typed.time if letter.isalpha() else -math.inf
        self._through.append(typed)
        self._app.post_message(typed)

    def refused(self) -> None:
        """Take letters that follow at once on the last one for a word that it began, as it means nothing here."""
        self._stray_s = self._letter_s

    def _is_astray(self, typed: Typed) -> bool:
        """Whether it goes on with a word of which a letter was refused: some other letter of it might be a command."""
        is_of_word = isinstance(typed, events.Key) and typed.is_printable
        if not is_of_word or typed.time - self._stray_s >= IN_ONE_GO_S:
            return False
        self._stray_s = typed.time
        self._app.context.say(STRAY)
        return True

    def _spells_on(self, typed: Typed, top: Any) -> bool:
        """Whether it only spells out the word of what one letter chose already: on the screen it would be a command."""
        letter = (typed.character or "") if isinstance(typed, events.Key) else ""
        words, begun, at_s = self._spelled
        goes_on = letter.isalpha() and letter != self._opener and typed.time - at_s < IN_ONE_GO_S and bool(begun)
        on_screen = not isinstance(top, Dialog) and not isinstance(self._app.focused, Input)
        if goes_on and on_screen and re.search(rf"\b{re.escape(begun)}{letter}", words):
            self._spelled = words, begun + letter, typed.time
            self._app.context.say(f"{letter}: left out, {begun[0]} alone chose it")
            return True
        chosen = top.chosen_by(letter) if letter and isinstance(top, Dialog) else ""
        self._spelled = chosen, letter if chosen else "", typed.time
        self._opener, self._last = self._last if chosen else "", letter
        return False

    async def _serve(self) -> None:
        """Go on with each that is typed: a worker of its own for each key took a tenth of what a key does."""
        try:
            while True:
                await self._typed.wait()
                self._typed.clear()
                await self._go_on()
        finally:
            self._serves = False

    async def _go_on(self) -> None:
        try:
            await self._settled()
            while self._kept and self._app.screen_stack:
                types = self._types()
                self._let_through()
                while types and self._types():
                    self._let_through()
                await self._settled()
        finally:
            self.free = True

    def _types(self) -> bool:
        """Whether the next key is a letter of a line that is typed in: it opens nothing, others may follow at once."""
        is_letter = bool(self._kept) and isinstance(key := self._kept[0], events.Key) and key.is_printable
        return is_letter and isinstance(self._app.focused, Input)

    async def _settled(self) -> None:
        """Wait until the last key was carried out, and what it opened can take keys."""
        await _done(self._app)
        while self._app.screen_stack:  # none is there as the program ends
            top, focused = self._app.screen, self._app.focused
            if self.holds or (isinstance(top, Dialog) and top.waits):
                self._moved.clear()
                await self._moved.wait()
                continue
            for _ in range(WALKS):
                for pump in (focused or top).ancestors_with_self:
                    await _done(pump)
            if isinstance(top, Dialog) and top.loses:
                await _done(top, drawn=True)
            if self._app.screen_stack[-1:] == [top] and focused is self._app.focused:
                return


class Holding(Dialog[None]):
    """Stands over a screen while what was asked for is on its way, and says after a moment for what it waits.

    What is typed meanwhile is for the dialog that comes: without this it would edit the table.
    """

    KEYS_HERE = "Esc Closes, the request goes on"

    def __init__(self, what: str, gives_up: Callable[[], object] | None = None) -> None:
        """Wait for `what`; that which Esc ends, by `gives_up`, is told at once."""
        super().__init__()
        self._what, self._gives_up = what if gives_up is not None else f"waiting for {what}", gives_up
        if gives_up is not None:
            self.KEYS_HERE = "Esc Gives it up"
        self._began = time.monotonic()
        self.ended = False
        self._there = False
        self._answered = False  # whether a dialog was there: what is typed after it is for what follows

    @property
    def waits(self) -> bool:  # type: ignore[override]
        """Whether what was asked for is still on its way."""
        return not self.ended

    def compose(self) -> ComposeResult:
        """Yield the line."""
        yield Static("", id="waiting", markup=False)

    def on_mount(self) -> None:
        """Begin to count the seconds; go, where what was asked for came sooner than this."""
        self._there = True
        self.set_interval(0.1, self._tell)
        self._tell()
        if self.ended:
            self.call_later(self.end)

    def _tell(self) -> None:
        waited = time.monotonic() - self._began
        if (self._gives_up is not None or waited >= TELLS_AFTER_S) and self.is_active:
            since = text.span(round(waited, 1)) if waited >= TELLS_AFTER_S else "…"
            line = self.query_one("#waiting", Static)
            line.display = True
            line.update(f"{self._what} {since}")  # the lowest line says what Esc does

    def on_screen_suspend(self) -> None:
        """Make room for the dialog that came."""
        for line in self.query("#waiting"):
            line.display = False
        self._answered = True
        self._tell_keys()
        self._gate.moved()

    def _tell_keys(self) -> None:
        cast(Any, self.app).context.tell(lambda screen: screen.show_keys_above())

    def on_screen_resume(self) -> None:
        """Wait for the next step."""
        self._tell_keys()
        self._began = time.monotonic()
        if self.ended:
            self.end()

    def give_way(self) -> None:
        """Go for what was asked for, which comes now: what was typed is meant for that."""
        self._answered = True
        self.end()

    def end(self) -> None:
        """Go, at once or as soon as what lies above is gone."""
        if not self.ended and not self._answered:
            self._gate.drop()
        self.ended = True
        if self._there and self.is_active:  # one that is still being made can't be taken away
            self.dismiss()
        self._gate.moved()

    @property
    def _gate(self) -> Gate:
        return cast(Gate, cast(Any, self.app).gate)

    def on_key(self, event: events.Key) -> None:
        """Keep the key from the screen below."""
        event.stop()
        event.prevent_default()
        if event.key in LETS_GO:
            self.ended = True
            self.dismiss()
            self._gate.moved()
            if self._gives_up is not None:
                self._gives_up()
        elif event.key == "ctrl+q":
            cast(Any, self.app).context.left()
            self.app.exit()
