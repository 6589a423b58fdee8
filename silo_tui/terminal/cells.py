"""The screen as a grid of cells, and what must be sent so that a terminal that shows one grid shows another.

Knows neither Textual nor a terminal: text in, text out.
"""

import re
from collections.abc import Iterable, Iterator
from operator import ne

from rich.cells import cell_len

from silo_tui.terminal.styles import DEFAULT, Styles

BLANK = " "
TAIL = ""  # the second cell of a wide character
UNKNOWN = "\0"  # what the terminal may show where we don't know; no cell is this
LONG_BLANK = 12  # blanks that are erased instead of sent, where the terminal erases to the background's colour
GAP = 4  # cells that didn't change are sent again where the way over them costs as much
PROBE = 10  # cells of what is wanted that are looked for in what is shown, to see by how much it went to the left
WORTH = 8  # cells that need be spared so that a line is moved

# one cell each in every terminal; most of what we draw
_SINGLE = re.compile("[ -~\xa0-\xac\xae-\u02ff\u0370-\u0482\u2010-\u2027\u2190-\u2193\u2500-\u25fc\u2800-\u28ff]*")
_JOINER = "\u200d"


class Grid:
    """Characters and styles of all cells."""

    def __init__(self, width: int, height: int, char: str = BLANK) -> None:
        self.width, self.height = width, height
        self.chars = [[char] * width for _ in range(height)]
        self.styles = [[DEFAULT] * width for _ in range(height)]
        self._odd: set[int] = set()  # rows that hold characters of no or two cells

    def put(self, row: int, column: int, text: str, style: int) -> int:
        """Write text from a cell on and return the column after it; what is beyond the end stays in the last cell."""
        chars, styles = self.chars[row], self.styles[row]
        if text and _SINGLE.fullmatch(text):
            column = min(column, self.width - 1)
            room = self.width - column
            if len(text) > room:
                text = text[: room - 1] + text[-1]
            stop = column + len(text)
            if row in self._odd:
                self._halve(row, column)
                self._halve(row, stop - 1)
            chars[column:stop] = text
            styles[column:stop] = [style] * len(text)
            return stop
        self._odd.add(row)
        for cluster in _clusters(text):
            width = cell_len(cluster)
            if not width:
                self._join(row, column, cluster)
                continue
            column = min(column, self.width - 1)
            fits = width <= min(2, self.width - column)
            cells = [cluster, TAIL][:width] if fits else [BLANK] * min(width, self.width - column)
            for cell, char in enumerate(cells, column):
                self._halve(row, cell)
                chars[cell], styles[cell] = char, style
            column += len(cells)
        return column

    def clear(self, row: int, start: int, stop: int, style: int) -> None:
        """Make cells blank."""
        if start < stop:
            self.put(row, start, BLANK * (stop - start), style)

    def resized(self, width: int, height: int) -> "Grid":
        """Return a grid of another size with the same upper left part."""
        grid = Grid(width, height)
        for row in range(min(height, self.height)):
            keep = min(width, self.width)
            grid.chars[row][:keep], grid.styles[row][:keep] = self.chars[row][:keep], self.styles[row][:keep]
            if keep < self.width and self.chars[row][keep] == TAIL:
                grid.chars[row][keep - 1] = BLANK
        grid._odd = {row for row in self._odd if row < height}
        return grid

    def take_row(self, other: "Grid", row: int) -> None:
        """Make a row that of another grid of the same size."""
        self.chars[row], self.styles[row] = other.chars[row][:], other.styles[row][:]

    def delete(self, row: int, start: int, count: int) -> None:
        """Take cells out, as terminals do it: what is right of them moves; nothing is known of what comes in there."""
        chars, styles = self.chars[row], self.styles[row]
        chars[start:] = [*chars[start + count :], *UNKNOWN * count]
        styles[start:] = [*styles[start + count :], *[DEFAULT] * count]

    def _halve(self, row: int, column: int) -> None:
        """A wide character of which one half is overwritten is gone, as terminals do it."""
        chars = self.chars[row]
        if chars[column] == TAIL and column:
            chars[column - 1] = BLANK
        if column + 1 < self.width and chars[column + 1] == TAIL:
            chars[column + 1] = BLANK

    def _join(self, row: int, column: int, mark: str) -> None:
        """Lay what has no width of its own over the character before it."""
        before = column - 1
        while before > 0 and self.chars[row][before] == TAIL:
            before -= 1
        if before >= 0:
            self.chars[row][before] += mark


def _clusters(text: str) -> Iterator[str]:
    """Yield what stands in one cell or two: a character with what has no width behind it."""
    cluster = ""
    for char in text:
        if cluster and (cluster[-1] == _JOINER or not cell_len(char)):
            cluster += char
            continue
        if cluster:
            yield cluster
        cluster = char
    if cluster:
        yield cluster


def difference(
    sent: Grid, wanted: Grid, rows: Iterable[int], styles: Styles, budget: int, *, erases: bool, deletes: bool
) -> tuple[str, int | None]:
    """Return what makes a terminal that shows `sent` show `wanted` in these rows, and write it into `sent`.

    The terminal's style is the default before and after; `erases` says that it erases to the background in force
    (terminfo: bce), `deletes` that it can take characters out of a line (dch). Whole rows are sent until there are
    `budget` characters or more; the first row that must wait is returned too, None where all is sent.
    """
    pieces: list[str] = []
    size, style = 0, DEFAULT
    for row in rows:
        if sent.chars[row] == wanted.chars[row] and sent.styles[row] == wanted.styles[row]:
            continue
        if size >= budget:
            return "".join([*pieces, styles.way(style, DEFAULT)]), row
        begin = len(pieces)
        cell = -1
        if deletes and (moved := _moved(sent.chars[row], wanted.chars[row])) is not None:
            cell, count = moved
            pieces.append(f"\x1b[{row + 1};{cell + 1}H\x1b[{count}P")
            sent.delete(row, cell, count)
        for start, stop in _runs(sent, wanted, row, styles):
            if start != cell:
                way = f"\x1b[{row + 1};{start + 1}H" if cell < 0 else f"\x1b[{start - cell}C"
                pieces.append(way if start > cell else f"\x1b[{start + 1}G")
            style, cell = _draw(pieces, wanted, row, (start, stop), styles, style, erases=erases)
        size += sum(len(piece) for piece in pieces[begin:])
        sent.take_row(wanted, row)
    return "".join([*pieces, styles.way(style, DEFAULT)]), None


def _moved(shown: list[str], wanted: list[str]) -> tuple[int, int] | None:
    """Return from which cell on how many are to be taken out, so that the rest of a line needn't be sent again.

    A plot that goes on is the one before, some cells to the left. None where nothing is spared.
    """
    old, new = "".join(shown), "".join(wanted)
    changed = [at for at, (was, char) in enumerate(zip(old, new, strict=False)) if was != char]
    if len(changed) <= WORTH or len(old) != len(shown) or not _SINGLE.fullmatch(old) or not _SINGLE.fullmatch(new):
        return None
    start, least, best = changed[0], len(changed) - WORTH, 0
    for at in changed[2 :: len(changed) // 4]:
        found = old.find(new[at : at + PROBE], at + 1)
        count = found - at
        if found < 0 or new[at : at + PROBE].isspace() or count == best:
            continue
        left = count + sum(map(ne, old[start + count :], new[start:]))
        if left < least:
            least, best = left, count
    return (start, best) if best else None


def _runs(sent: Grid, wanted: Grid, row: int, styles: Styles) -> Iterator[tuple[int, int]]:
    """Yield where cells look different, first and one past the last, near ones together, wide characters whole."""
    ground = styles.ground
    chars = wanted.chars[row]
    cells = zip(sent.chars[row], chars, sent.styles[row], wanted.styles[row], strict=True)
    start = stop = -1
    for at, (old, new, old_style, new_style) in enumerate(cells):
        if old == new and (old_style == new_style or (new == BLANK and ground(old_style) == ground(new_style))):
            continue
        if start < 0:
            start = at
        elif at - stop > GAP:
            yield _whole(chars, start, stop)
            start = at
        stop = at + 1
    if start >= 0:
        yield _whole(chars, start, stop)


def _whole(chars: list[str], start: int, stop: int) -> tuple[int, int]:
    while start and chars[start] == TAIL:
        start -= 1
    while stop < len(chars) and chars[stop] == TAIL:
        stop += 1
    return start, stop


def _draw(
    pieces: list[str], grid: Grid, row: int, run: tuple[int, int], styles: Styles, style: int, *, erases: bool
) -> tuple[int, int]:
    """Append what draws the cells of a run; return the style in force after it and where the cursor is."""
    chars, looks = grid.chars[row], grid.styles[row]
    at, stop = run
    ground, append = styles.ground, pieces.append
    while at < stop:
        char, look = chars[at], looks[at]
        if look != style and not (char == BLANK and ground(look) == ground(style)):
            append(styles.way(style, look))
            style = look
        if char == BLANK and erases and (blanks := _blanks(grid, row, at, stop, styles)) >= LONG_BLANK:
            append(f"\x1b[{blanks}X")
            if at + blanks == stop:
                return style, at  # erasing doesn't move the cursor
            append(f"\x1b[{blanks}C")
            at += blanks
            continue
        at += 1
        if char == TAIL:
            continue
        if len(char) == 1 and _SINGLE.fullmatch(char):
            append(char)
            continue
        # terminals disagree on how wide some characters are: both cells are blanked, and the place of the next is said
        wide = at < stop and chars[at] == TAIL
        append(f"{BLANK * (1 + wide)}\x1b[{at}G{char}")
        if at + wide < grid.width:
            append(f"\x1b[{at + 1 + wide}G")
    return style, at


def _blanks(grid: Grid, row: int, start: int, stop: int, styles: Styles) -> int:
    """Return how many cells from `start` on look the same as it and can be erased."""
    chars, looks = grid.chars[row], grid.styles[row]
    ground = styles.ground(looks[start])
    if not styles.is_plain(ground):
        return 0
    at = start + 1
    while at < stop and chars[at] == BLANK and (looks[at] == looks[start] or styles.ground(looks[at]) == ground):
        at += 1
    return at - start
