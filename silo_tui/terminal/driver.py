"""The driver between Textual and the terminal: only cells that changed are sent, and no more than the link carries.

What Textual writes goes into the grid of wanted cells (`parser`); `flush` sends the difference to what the terminal
shows (`cells`), as much of it as may be on its way (`pacing`). All but reading happens in the event loop's thread;
two notes come from others: that an answer came (input thread) and that all was written (output thread).
"""

import asyncio
import os
import selectors
import signal
import sys
import threading
import time
from codecs import getincrementaldecoder
from collections import deque
from contextlib import suppress
from typing import IO, Any

from textual import events
from textual._parser import ParseError
from textual.app import App
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from silo_tui.terminal.answers import ALIVE_ANSWER, ALIVE_QUERY, AnswerFilter, KeyReader, knows_mode
from silo_tui.terminal.cells import UNKNOWN, Grid, difference
from silo_tui.terminal.pacing import Pacer, waited_s
from silo_tui.terminal.parser import QUERY, SYNC_BEGIN, SYNC_END, Follower, Through
from silo_tui.terminal.signals import over_ssh
from silo_tui.terminal.styles import Styles
from silo_tui.terminal.thinness import FAT_BYTES_PER_S, HERE_S, LAG_S, START_S, Busyness, Painted, Thinness

ESCAPE_S = 0.1  # as long as Textual waits for the rest of an escape sequence
URGENT_S = 1.0  # what is painted so soon after a key is its echo
FAREWELL_S = 1.0  # how long the last answers are waited for, so that the shell doesn't get them
ALT_SCREEN = "\x1b[?1049h"


class _Output:
    """The terminal as the output thread sees it; tells when all was written."""

    def __init__(self, file: IO[str], written: "threading.Event", tell: Any) -> None:
        self._file = file
        self._written = written
        self._tell = tell

    def write(self, text: str) -> None:
        """Write."""
        self._file.write(text)

    def flush(self) -> None:
        """Hand over what was written, and tell."""
        self._file.flush()
        self._written.set()
        self._tell()

    def fileno(self) -> int:
        """Return the terminal's descriptor."""
        return self._file.fileno()


class CellDriver(LinuxDriver):
    """Textual's driver for Linux, sending differences."""

    def __init__(
        self, app: App[Any], *, debug: bool = False, mouse: bool = True, size: tuple[int, int] | None = None
    ) -> None:
        super().__init__(app, debug=debug, mouse=mouse, size=size)
        self.pacer = Pacer()
        self.thinness = Thinness()
        self.busyness = Busyness()
        self.painted = Painted()
        self._styles = Styles()
        width, height = self._get_terminal_size()
        self._follower = Follower(width, height, self._styles, self._hand_on)
        self._sent = Grid(width, height, UNKNOWN)
        self._forget = False  # set by signal handlers: the terminal may show anything
        self._cursor = (0, 0)
        self._next_row = 0  # where a frame that was cut goes on
        self._rows_waiting = False
        self._drawing = False  # whether there is a screen to draw on
        self._urgent_from = -1  # number of the first write after the newest key
        self._urgent_until_s = 0.0
        self._alive_query = False  # whether the terminal is asked whether it is alive: it doesn't report modes
        self._answers: deque[tuple[bytes, float]] = deque()  # from the input thread, with the time they came
        self._answer_came = threading.Event()
        self._painted_s = 0.0
        self._began_s: float | None = None  # when it was first asked whether to paint
        self._hung_up = False
        self._screens = 0  # begun
        self._suspended = False
        self._owner = threading.get_ident()
        self._erases, self._deletes = _told_of_terminal()
        self._written = threading.Event()
        self._written.set()
        self._timer: asyncio.TimerHandle | None = None
        self._file = _Output(sys.__stderr__, self._written, self._from_thread)  # type: ignore[assignment, arg-type]

    # ------------------------------------------------------------------------------------------- for the app

    @property
    def behind(self) -> bool:
        """Whether the terminal has not yet been sent all that is wanted."""
        return self._rows_waiting or not self._written.is_set()

    def repaint(self) -> None:
        """Send the whole screen again: whatever else wrote on it, or damaged it, is gone then."""
        self._forget = True
        self._pump()

    def take_mouse(self, *, wanted: bool) -> None:
        """Take the mouse from the terminal, or leave it to it, while the app runs."""
        if self._mouse == wanted:
            return
        if wanted:
            self._mouse = True
            self._enable_mouse_support()
        else:
            self._disable_mouse_support()
            self._mouse = False

    def may_paint(self, wished_hz: float) -> bool:
        """Return whether values are to be painted now; asked `wished_hz` times a second."""
        now_s = time.monotonic()
        self._take_answers()
        # a lost packet costs one more way there and back: that is no thin link
        lags = self.pacer.paced and self.pacer.lag_s(now_s) > max(LAG_S, self.pacer.fastest_s)
        here = bool(self.pacer.answers) and self.pacer.fastest_s < HERE_S and not over_ssh()
        fat = self.pacer.paced and (here or self.pacer.bytes_per_s > FAT_BYTES_PER_S)
        self.busyness.note(waited_s(), now_s)
        self._began_s = now_s if self._began_s is None else self._began_s
        starts = now_s < self._began_s + START_S or (self.pacer.paced and not self.pacer.answers)  # none is back yet
        if fat or not (self.busyness.is_busy or starts):  # else nobody knows what the link carries
            self.thinness.note(late=(self.behind or lags) and not fat, now_s=now_s)
        # a timer that comes a little early is still in time
        paint = not self.behind and now_s >= self._painted_s + 0.9 / self.thinness.value_hz(wished_hz)
        self.painted.note(wished_hz, painted=paint, now_s=now_s)
        if paint:
            self._painted_s = now_s
        return paint

    # ---------------------------------------------------------------------------------------------- writing

    def write(self, data: str) -> None:
        """Follow what Textual draws; `flush` sends it."""
        if threading.get_ident() != self._owner:  # modes that Textual's input thread switches on
            super().write(data)
            return
        width, height = self._get_terminal_size()
        if (width, height) != (self._sent.width, self._sent.height):
            self._follower.resize(width, height)
            self._sent = Grid(width, height, UNKNOWN)
        self._follower.feed(data)

    def flush(self) -> None:
        """Send what changed, as far as the terminal keeps up."""
        self._pump()

    def _hand_on(self, sequence: Through) -> None:
        """Hand on what doesn't concern cells; a query of Textual's own is answered in its turn."""
        if sequence.forget:
            self._pump()
            self._forget = True
        if sequence.text == ALT_SCREEN:
            self._begin_screen()
            return
        super().write(sequence.text)
        if sequence.text == QUERY:
            # a terminal that answers only the second one doesn't report modes: it is asked whether it is alive
            super().write(ALIVE_QUERY)
            self.pacer.sent(len(QUERY), time.monotonic())

    def _begin_screen(self) -> None:
        """Begin on an empty screen: what it shows is known, so that blanks needn't be sent."""
        super().write(f"{ALT_SCREEN}\x1b[m\x1b[2J\x1b[H")
        width, height = self._get_terminal_size()
        self._follower.resize(width, height)
        self._sent = Grid(width, height)
        self._cursor = (0, 0)
        self._forget = False
        self._screens += 1

    def _pump(self) -> None:
        """Send the newest difference, if the terminal may be sent something; else it is called again."""
        if not self._drawing or not self._written.is_set():
            self._rows_waiting |= self._drawing
            return
        now_s = time.monotonic()
        self._take_answers()
        self.pacer.check(now_s)
        if self._forget:
            self._forget = False
            self._sent = Grid(self._sent.width, self._sent.height, UNKNOWN)
        urgent = now_s < self._urgent_until_s
        room = self.pacer.room(urgent=urgent)
        self._rows_waiting = True
        if room > 0:
            screen = self._screens
            text = self._frame(room, urgent=urgent)
            if screen != self._screens:  # it was suspended and resumed in between: this is of the screen before
                self._rows_waiting = True
                return
            self._send(text, now_s)
        self._wake_later(now_s)

    def _frame(self, room: int, *, urgent: bool) -> str:
        """Return the next piece of the difference, at most about `room` characters of it."""
        follower, sent = self._follower, self._sent
        rows = [*range(self._next_row, sent.height), *range(min(self._next_row, sent.height))]
        if urgent:  # what a key changed goes first
            rows.sort(key=lambda row: follower.touched[row] < self._urgent_from)
        text, waits = difference(
            sent, follower.grid, rows, self._styles, room, erases=self._erases, deletes=self._deletes
        )
        self._next_row = 0 if waits is None else waits
        self._rows_waiting = waits is not None
        cursor = (follower.row, min(follower.column, sent.width - 1))
        if text or cursor != self._cursor:
            # where an input method shows what is composed
            text += f"\x1b[{cursor[0] + 1};{cursor[1] + 1}H"
            self._cursor = cursor
        return text

    def _send(self, text: str, now_s: float) -> None:
        if not text:
            return
        if self._follower.synchronised:
            text = f"{SYNC_BEGIN}{text}{SYNC_END}"
        if self.pacer.paced:  # who doesn't answer isn't asked
            text += ALIVE_QUERY if self._alive_query else QUERY
            self.pacer.sent(len(text.encode()), now_s)
        self._written.clear()
        super().write(text)

    def _wake_later(self, now_s: float) -> None:
        """See again when an answer is overdue."""
        if self._timer is not None:
            self._timer.cancel()
        due_s = self.pacer.due_s if self._rows_waiting else None
        self._timer = None if due_s is None else self._loop.call_later(max(0.0, due_s - now_s), self._pump)

    def _from_thread(self) -> None:
        """Let the event loop look: the output thread has written all, or an answer came."""
        with suppress(RuntimeError):  # the loop has ended, and with it the screen
            self._loop.call_soon_threadsafe(self._look)

    def _look(self) -> None:
        self._take_answers()
        if self._rows_waiting:
            self._pump()

    def _take_answers(self) -> None:
        while self._answers:
            answer, came_s = self._answers.popleft()
            if answer == ALIVE_ANSWER:
                # the first one without one before to the query of the mode: that won't come
                self._alive_query |= not self.pacer.answers
                if not self._alive_query:
                    continue
            else:
                self._follower.synchronised |= knows_mode(answer)
            self.pacer.answered(came_s)

    # ---------------------------------------------------------------------------------------- beginning and end

    def start_application_mode(self) -> None:
        """Take the terminal."""
        screens = self._screens
        super().start_application_mode()  # type: ignore[no-untyped-call]
        if screens == self._screens:
            return  # brought back into the background: it will be stopped again
        textual_follows = signal.getsignal(signal.SIGWINCH)

        def resized(number: int, frame: Any) -> None:
            self._forget = True  # terminals move, cut and wrap what they show
            if callable(textual_follows):
                textual_follows(number, frame)

        signal.signal(signal.SIGWINCH, resized)
        # not before the terminal has stopped echoing: it would show the answers to our queries
        self._drawing = True
        self._pump()

    def stop_application_mode(self) -> None:
        """Give the terminal back as it was."""
        self._drawing = False
        super().stop_application_mode()

    def disable_input(self) -> None:
        """Stop reading, after the last answers: else the shell would take them for typed."""
        self._drawing = False
        limit_s = time.monotonic() + FAREWELL_S
        while self._key_thread is not None and self._key_thread.is_alive() and not self._hung_up:
            self._answer_came.clear()
            self._take_answers()
            left_s = min(limit_s, self.pacer.farewell_s or 0.0) - time.monotonic()
            if left_s <= 0:
                break
            self._answer_came.wait(left_s)
        super().disable_input()

    def _sigtstp_application(self, *_: Any) -> None:
        """Suspend as soon as nothing is being drawn: the signal may come in the midst of a frame."""
        self._loop.call_soon_threadsafe(self._suspend)

    def _suspend(self) -> None:
        self._suspended = True
        super()._sigtstp_application()

    def _sigcont_application(self, *_: Any) -> None:
        if self._suspended:
            self._suspended = False
            super()._sigcont_application()
            self._suspended = not self._drawing  # brought back into the background, where it can't draw
        else:  # stopped from outside, without giving the terminal back
            self._loop.call_soon_threadsafe(self.repaint)

    # ---------------------------------------------------------------------------------------------- reading

    def process_message(self, message: Message) -> None:
        """Note what is typed: what it changes goes before all else."""
        if isinstance(message, (events.Key, events.MouseDown, events.MouseScrollDown, events.MouseScrollUp)):
            self._urgent_from = self._follower.feeds + 1
            self._urgent_until_s = time.monotonic() + URGENT_S
            self.pacer.key()
        super().process_message(message)

    def _note_answers(self, answers: tuple[bytes, ...]) -> None:
        if answers:
            now_s = time.monotonic()
            self._answers.extend((answer, now_s) for answer in answers)
            self._answer_came.set()
            self._from_thread()

    def run_input_thread(self) -> None:
        """Read keys, without the answers to our queries. As Textual's own, which has no place to put a filter in."""
        answers, keys = AnswerFilter(), KeyReader(debug=self._debug)
        decode = getincrementaldecoder("utf-8")("replace").decode
        selector = selectors.DefaultSelector()
        selector.register(self.fileno, selectors.EVENT_READ)

        def take(typed: bytes) -> None:
            if words := decode(typed):
                for event in keys.feed(words):
                    self.process_message(event)

        try:
            while not self.exit_event.is_set():
                if not selector.select(ESCAPE_S):
                    take(answers.waited())
                elif not (data := os.read(self.fileno, 4096)):
                    self._hung_up = True
                    break
                else:
                    found = answers.feed(data)
                    take(found.typed)
                    self._note_answers(found.answers)
                for event in keys.tick():
                    self.process_message(event)
        except OSError:  # the terminal is gone
            self._hung_up = True
        finally:
            selector.close()
            with suppress(EOFError, ParseError):
                keys.end()


def _told_of_terminal() -> tuple[bool, bool]:
    """Return whether erasing fills with the background in force here, and whether characters can be taken out of lines.

    As the terminal's description says.
    """
    try:
        import curses

        curses.setupterm(os.environ.get("TERM") or "dumb", sys.__stderr__.fileno() if sys.__stderr__ else -1)
        return curses.tigetflag("bce") == 1, curses.tigetstr("dch") == b"\x1b[%p1%dP"
    except Exception:  # noqa: BLE001 - curses.error is one; without a description nothing is taken for granted
        return False, False
