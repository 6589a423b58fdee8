"""What Textual writes, followed as a terminal would: into the grid of cells that are wanted.

Sequences that don't concern cells (modes, titles, clipboard, bell) are handed on. One that may concern them and isn't
known is handed on too, and nothing is known of the terminal's cells from there on.
"""

import re
from collections.abc import Callable

import msgspec

from silo_tui.terminal.cells import Grid
from silo_tui.terminal.styles import DEFAULT, Styles

SYNC_BEGIN, SYNC_END, QUERY = "\x1b[?2026h", "\x1b[?2026l", "\x1b[?2026$p"

# CSI, OSC, other strings, other escapes, controls
_SEQUENCE = re.compile(
    "\x1b\\[(?P<codes>[0-?]*)(?P<between>[ -/]*)(?P<final>[@-~])"
    "|\x1b\\](?P<osc>[^\x07\x1b]*)(?:\x07|\x1b\\\\)"
    "|\x1b[P_^X][^\x1b]*\x1b\\\\"
    "|\x1b[ -/]*[0-OQ-WYZ`-~=<>\\\\]"
    "|(?P<control>[\x00-\x1a\x1c-\x1f\x7f-\x9f])"
)
# keyboard protocols, cursor shapes, reports, scroll of the title stack: no cell changes
_HARMLESS_FINALS = frozenset("uqnct")


class Through(msgspec.Struct, frozen=True):
    """A sequence to hand on; `forget`: whether what the terminal shows is unknown then."""

    text: str
    forget: bool = False


class Follower:
    """A terminal without glass: cursor, style and grid."""

    def __init__(self, width: int, height: int, styles: Styles, hand_on: Callable[[Through], None]) -> None:
        self.grid = Grid(width, height)
        self.row = self.column = 0
        self.synchronised = False  # whether frames come between SYNC_BEGIN and SYNC_END: the terminal knows them
        self.touched = [0] * height  # by row, the number of the `feed` that wrote to it last
        self.feeds = 0
        self._style = DEFAULT
        self._styles = styles
        self._hand_on = hand_on
        self._rest = ""  # of a sequence whose end hasn't come

    def resize(self, width: int, height: int) -> None:
        """Follow the terminal's size."""
        if (width, height) == (self.grid.width, self.grid.height):
            return
        self.grid = self.grid.resized(width, height)
        self.touched = [self.feeds] * height
        self._go(self.row, self.column)

    def feed(self, data: str) -> None:
        """Take what is written."""
        self.feeds += 1
        data, at = self._rest + data, 0
        self._rest = ""
        for found in _SEQUENCE.finditer(data):
            if found.start() > at:
                self._text(data[at : found.start()])
            at = found.end()
            if found["final"]:
                self._control_sequence(found)
            elif found["control"]:
                self._control(found["control"])
            elif found["osc"] is None or not found["osc"].startswith("8;"):  # links are left out
                self._hand_on(Through(found[0], forget=found["osc"] is None and found[0][1] not in "=>P_^X\\"))
        escape = data.find("\x1b", at)
        if escape >= 0:
            data, self._rest = data[:escape], data[escape:]
        if at < len(data):
            self._text(data[at:])

    def _text(self, text: str) -> None:
        self.touched[self.row] = self.feeds
        self.column = self.grid.put(self.row, self.column, text, self._style)

    def _control(self, char: str) -> None:
        if char == "\n":  # the terminal driver makes it a line feed and a carriage return
            self._go(self.row + 1, 0)
        elif char == "\r":
            self.column = 0
        elif char == "\b":
            self.column = max(0, self.column - 1)
        elif char == "\t":
            self._go(self.row, self.column // 8 * 8 + 8)
        elif char == "\a":
            self._hand_on(Through(char))

    def _control_sequence(self, found: "re.Match[str]") -> None:
        codes, final = found["codes"], found["final"]
        if final == "m" and not found["between"] and not codes.startswith((">", "?")):
            self._style = self._styles.after(self._style, codes)
        elif found[0] == SYNC_BEGIN:
            self.synchronised = True
        elif found[0] == SYNC_END:
            pass
        elif codes[:1] in {"?", ">", "<", "="} or found["between"] or final in _HARMLESS_FINALS:
            self._hand_on(Through(found[0]))
        elif not self._move_or_erase(final, [int(code) if code.isdigit() else 0 for code in codes.split(";")]):
            self._hand_on(Through(found[0], forget=True))

    def _move_or_erase(self, final: str, numbers: list[int]) -> bool:
        first = max(1, numbers[0])
        row, column = self.row, min(self.column, self.grid.width - 1)
        if final in "Hf":
            self._go(first - 1, max(1, numbers[1]) - 1 if len(numbers) > 1 else 0)
        elif final in "AB":
            self._go(row + (first if final == "B" else -first), column)
        elif final in "CD":
            self._go(row, column + (first if final == "C" else -first))
        elif final in "EF":
            self._go(row + (first if final == "E" else -first), 0)
        elif final in "G`":
            self._go(row, first - 1)
        elif final == "d":
            self._go(first - 1, column)
        elif final == "K" and numbers[0] <= 2:
            self._erase(row, column, numbers[0])
        elif final == "J" and numbers[0] <= 2:
            self._erase(row, column, numbers[0])
            others = range(row + 1, self.grid.height) if numbers[0] != 1 else range(row)
            for other in [*(range(row) if numbers[0] == 2 else ()), *others]:
                self._erase(other, 0, 2)
        elif final == "X":
            self._clear(row, column, min(self.grid.width, column + first))
        else:
            return False
        return True

    def _erase(self, row: int, column: int, part: int) -> None:
        self._clear(row, 0 if part else column, column + 1 if part == 1 else self.grid.width)

    def _clear(self, row: int, start: int, stop: int) -> None:
        self.touched[row] = self.feeds
        self.grid.clear(row, start, stop, self._styles.ground(self._style))

    def _go(self, row: int, column: int) -> None:
        self.row = max(0, min(row, self.grid.height - 1))
        self.column = max(0, min(column, self.grid.width - 1))
