"""A terminal as far as our frames need one: what a person would see of the bytes that it was sent."""

import re
import unicodedata

_TOKEN = re.compile(
    "\x1b\\[([0-?]*)([ -/]*)([@-~])|\x1b\\][^\x07\x1b]*(?:\x07|\x1b\\\\)|\x1b[0-Z=>\\\\]|\n|\r|.", re.DOTALL
)
BLANK = (" ", "", "", frozenset())


class Emulator:
    """Cells are (character, foreground, background, flags); the second half of a wide character is ("", ...).

    Wraps nothing, as Textual wants it; erases to the background in force, as xterm does.
    """

    def __init__(self, width, height):
        self.width, self.height = width, height
        self.cells = [[BLANK] * width for _ in range(height)]
        self.row = self.column = 0
        self.style = ("", "", frozenset())
        self.queries = 0
        self.modes = set()

    def feed(self, data):
        for codes, between, final, token in (
            (found[1], found[2], found[3], found[0]) for found in _TOKEN.finditer(data)
        ):
            if final:
                self._sequence(codes, between, final)
            elif token == "\n":
                self.row, self.column = min(self.row + 1, self.height - 1), 0
            elif token == "\r":
                self.column = 0
            elif len(token) == 1 and token >= " ":
                self._char(token)

    def resize(self, width, height):
        rows = [(row + [BLANK] * width)[:width] for row in self.cells[:height]]
        self.cells = rows + [[BLANK] * width for _ in range(height - len(rows))]
        self.width, self.height = width, height

    def seen(self):
        """What a person sees: a foreground on a blank isn't seen."""
        return [[_seen(cell) for cell in row] for row in self.cells]

    @property
    def text(self):
        return "\n".join("".join(cell[0] for cell in row).rstrip() for row in self.cells)

    def _char(self, char):
        wide = unicodedata.east_asian_width(char) in "WF"
        if unicodedata.combining(char) or char in "\u200d\ufe0f":
            before = self.column - 1
            while before > 0 and self.cells[self.row][before][0] == "":
                before -= 1
            if before >= 0:
                self.cells[self.row][before] = (
                    self.cells[self.row][before][0] + char,
                    *self.cells[self.row][before][1:],
                )
            return
        self.column = min(self.column, self.width - 1)
        if wide and self.column + 2 > self.width:
            char, wide = " ", False
        for column in range(self.column, self.column + 1 + wide):
            self._halve(column)
            self.cells[self.row][column] = (char if column == self.column else "", *self.style)
        self.column += 1 + wide

    def _halve(self, column):
        row = self.cells[self.row]
        if row[column][0] == "" and column:
            row[column - 1] = (" ", *row[column - 1][1:])
        if column + 1 < self.width and row[column + 1][0] == "":
            row[column + 1] = (" ", *row[column + 1][1:])

    def _sequence(self, codes, between, final):
        if codes.startswith("?"):
            if final == "p":
                self.queries += 1
            elif final in "hl":
                (self.modes.add if final == "h" else self.modes.discard)(codes)
                if codes == "?1049" and final == "h":
                    self.cells = [[BLANK] * self.width for _ in range(self.height)]
            return
        numbers = [int(code or 0) for code in codes.split(";")] if final != "m" and codes[:1] not in "><=" else [0]
        first = max(1, numbers[0])
        if final == "H":
            self.row = min(first, self.height) - 1
            self.column = min(max(1, numbers[1] if len(numbers) > 1 else 1), self.width) - 1
        elif final == "C":
            self.column = min(self.column + first, self.width - 1)
        elif final == "G":
            self.column = min(first, self.width) - 1
        elif final == "X":
            for column in range(self.column, min(self.width, self.column + first)):
                self._halve(column)
                self.cells[self.row][column] = (" ", "", self.style[1], frozenset())
        elif final == "P":
            row, blank = self.cells[self.row], (" ", "", self.style[1], frozenset())
            row[self.column :] = [*row[self.column + first :], *[blank] * min(first, self.width - self.column)]
        elif final == "J":
            self.cells = [[(" ", "", self.style[1], frozenset())] * self.width for _ in range(self.height)]
        elif final == "m" and not between and codes[:1] not in {">"}:
            self._style(codes.split(";"))
        elif final == "n" and codes == "5":
            self.queries += 1
        elif final not in "uqtm":
            raise AssertionError(f"unknown sequence {codes!r}{between}{final}")

    def _style(self, codes):
        front, back, flags = self.style
        codes = [code or "0" for code in codes]
        while codes:
            code = int(codes.pop(0))
            if code == 0:
                front, back, flags = "", "", frozenset()
            elif code in {38, 48}:
                color = tuple(codes[: 4 if codes[0] == "2" else 2])
                del codes[: len(color)]
                front, back = (color, back) if code == 38 else (front, color)
            elif code in {39, 49}:
                front, back = ("", back) if code == 39 else (front, "")
            elif 30 <= code <= 37 or 90 <= code <= 97:
                front = code
            elif 40 <= code <= 47 or 100 <= code <= 107:
                back = code
            else:
                assert code <= 9 or code == 21 or 51 <= code <= 53, code
                flags |= {code}
        self.style = (front, back, flags)


def _seen(cell):
    char, _front, back, flags = cell
    shown = flags & {4, 7, 9, 21, 51, 52, 53}
    return cell if char not in {" ", ""} or shown else (char, "", back, frozenset())
