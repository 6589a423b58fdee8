"""Where the cells of a CSV table stand in its text, found for all of them at once; a column is read when it is asked
for.

Looking for commas and ends of lines takes 0.2 s for 100 MB, so that one column of many costs little more; quotes are
looked at where there are any.
"""

import contextlib
import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.decoding import json_decoder
from silo.errors import FileFormatError

QUOTE = b'"'
_COMMA, LINE, _MARK, _RETURN, _NINE, _EXPONENT = b',\n"\r9e'
_PIECE = 1 << 20  # bytes that are looked at together: they stay in the cache
_ROWS_TOLD = 256  # of a plain table, rows that tell the types
_LONGEST_LINE = 1 << 26  # a million columns with names of 64 bytes
_WIDEST = 64  # bytes of a cell that are taken together; longer ones one by one
_DOUBLE = 8  # bytes
_BLANK = b" \t\r\v\f"
_QUOTED = re.compile(rb'"((?:[^"]|"")*)')

Words = NDArray[np.bytes_]
Places = NDArray[Any]  # of 4 bytes where these do


class Cells(NamedTuple):
    """A table of columns: where its records begin, shape `(rows,)`, and each cell ends, shape `(rows, width)`.

    `odd` are records of other lengths: the number of each, the header being the first, and how many cells it has.
    `plain` if there is nothing in it but figures, points and exponents. `unclosed` is where the first quote stands that
    begins a cell and is never closed, -1 for none. `has_blanks`: before a quote that begins a cell may stand some.
    """

    text: NDArray[np.uint8]
    starts: Places
    ends: Places
    odd: list[tuple[int, int]]
    plain: bool
    unclosed: int = -1
    has_blanks: bool = False

    def begins(self, number: int) -> Places:
        """Where the cells of a column begin."""
        return self.ends[:, number - 1] + 1 if number else self.starts

    @property
    def sizes(self) -> Places:
        """The bytes of each cell, shape `(rows, width)`."""
        found = np.empty_like(self.ends)
        np.subtract(self.ends[:, 0], self.starts, out=found[:, 0])
        np.subtract(self.ends[:, 1:], self.ends[:, :-1], out=found[:, 1:])
        found[:, 1:] -= 1
        return found

    def column(self, number: int, rows: NDArray[np.intp] | slice = slice(None)) -> Words:
        """The texts of some rows of a column. A quoted one keeps its first quote: empty, it is no empty cell."""
        begins = self.begins(number)[rows]
        sizes = self.ends[rows, number] - begins
        longest = max(1, int(sizes.max(initial=0)))
        if longest > _WIDEST or not len(begins) or longest > len(self.text):
            text = self.text.data
            found = np.array([bytes(text[at : at + size]) for at, size in zip(begins, sizes, strict=True)], "S")
        else:
            # what begins at any byte, of which those at the last ones would reach behind the text
            every: Words = np.ndarray((len(self.text) - longest + 1,), f"S{longest}", self.text, 0, (1,))
            found = every[np.minimum(begins, len(every) - 1)]
            letters = found.view(np.uint8).reshape(len(found), longest)
            for row in np.flatnonzero(begins >= len(every)).tolist():
                letters[row, : sizes[row]] = self.text[begins[row] : begins[row] + sizes[row]]
            letters[np.arange(longest) >= sizes[:, None]] = 0
        if self.has_blanks:
            stripped = np.char.lstrip(found)
            found = np.where(np.char.startswith(stripped, QUOTE), stripped, found)
        quoted = np.char.startswith(found, QUOTE)
        return np.array([unquoted(cell) for cell in found.tolist()], "S") if quoted.any() else found

    @property
    def _step(self) -> int:
        return max(1, len(self.starts) // _ROWS_TOLD) if self.plain else 1

    @property
    def sampled(self) -> bool:
        """Whether not all rows are looked at for the letters of the columns."""
        return self._step > 1

    def letters(self) -> NDArray[np.uint8]:
        """Which kinds of letters each column has, shape `(width,)`: the bits `DIGITS`, `SIGNS`, `POINTS` and `OTHERS`.

        Of a plain table some rows tell, see `sampled`: in others may stand a point or a sign, no letter.
        """
        width = self.ends.shape[1]
        found = np.zeros(width, np.uint8)
        step = self._step
        lines = max(1, _PIECE // (width * 16)) if step == 1 else 1
        for start in range(0, len(self.starts), max(step, lines)):
            begin, ends = int(self.starts[start]), self.ends[start : start + lines]
            kinds = self.text[begin : int(ends[-1, -1])].tobytes().translate(_KINDS) + b"\0"
            # from each cell to the next one, commas and ends of lines counting as nothing
            begins = np.concatenate([[0], ends.ravel()[:-1] + 1 - begin])
            told = np.bitwise_or.reduceat(np.frombuffer(kinds, np.uint8), begins)
            found |= np.bitwise_or.reduce(told.reshape(-1, width), axis=0)
        return found


DIGITS, POINTS, OTHERS, SIGNS = 1, 2, 4, 8
_CLASSES = {b"0123456789": DIGITS, b"+-": SIGNS, b".eEnaNif": POINTS, b",\n\r": 0}
_KINDS = bytes(next((kind for of, kind in _CLASSES.items() if letter in of), OTHERS) for letter in range(256))


def as_numbers(cells: Words, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The texts as numbers of a type. Raises `ValueError` or `OverflowError` for what is none.

    Nearly all texts of numbers are JSON, which is decoded in a fifth of the time that NumPy takes.
    """
    if dtype.itemsize > _DOUBLE:
        return cells.astype(dtype)
    whole = dtype.kind in "iu"
    if whole and len(cells) and b"." in bytes(cells[0]):
        raise ValueError("no whole number")
    text = b"[%b]" % b",".join(cells.tolist())
    if b"_" in text:  # digits of Python alone; elsewhere a name, as `1_2`
        raise ValueError("no number")
    if not whole or not any(point in text for point in (b".", b"e", b"E")):
        with contextlib.suppress(msgspec.DecodeError):
            found: list[Any] = (json_decoder(list[int]) if whole else json_decoder(list[float])).decode(text)
            if len(found) == len(cells):
                return np.array(found, dtype)
    return cells.astype(dtype)


def unquoted(cell: bytes) -> bytes:
    """A cell with its first quote alone; what comes behind the one that ends it is no part of it."""
    match = _QUOTED.match(cell)
    return cell if match is None else QUOTE + match[1].replace(b'""', QUOTE)


def first_record(text: NDArray[np.uint8], begin: int) -> tuple[list[bytes], int]:
    """The cells of the first record from this byte on that isn't blank, and where the next one begins.

    Only as much of the text is looked at as holds its end. Raises FileFormatError for a line that has none.
    """
    size = _PIECE
    while True:
        window = text[: begin + size]
        whole = len(window) == len(text)
        ends, *_, unclosed, _ = _separators(window, begin)
        cells, following = next(_records(window, begin, ends), ([], len(text)))
        if whole or (following <= len(window) and not begin <= unclosed < following):
            return cells, min(following, len(text))
        if size >= _LONGEST_LINE and LINE not in window[begin:]:
            raise FileFormatError(f"the line that begins at byte {begin:,} has no end within {_LONGEST_LINE:,} bytes")
        size *= 2


def records(text: NDArray[np.uint8], begin: int) -> Iterator[list[bytes]]:
    """The cells of each record from this byte on that isn't blank; a quoted cell may hold line breaks."""
    ends, *_ = _separators(text, begin)
    return (cells for cells, _ in _records(text, begin, ends))


def _records(text: NDArray[np.uint8], begin: int, ends: Places) -> Iterator[tuple[list[bytes], int]]:
    """The cells of each record, and where the next one begins."""
    letters = text.data
    lines = np.flatnonzero(_ends_line(text, ends))
    for places in np.split(ends, lines + 1)[:-1]:
        record = bytes(letters[begin : places[-1]]).removesuffix(b"\r")
        cells = record.split(b",")
        if QUOTE in record:
            bounds = [-1, *(places - begin).tolist()]
            cells = [record[one + 1 : other] for one, other in pairwise(bounds)]
            cells = [unquoted(word) if (word := cell.lstrip()).startswith(QUOTE) else cell for cell in cells]
        begin = int(places[-1]) + 1
        if record.strip():
            yield cells, begin


def _ends_line(text: NDArray[np.uint8], ends: Places) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (ends == len(text)) | (text[np.minimum(ends, max(len(text) - 1, 0))] == LINE)
    return found


def find_cells(text: NDArray[np.uint8], begin: int, width: int) -> Cells:
    """The cells of a table of so many columns whose records begin at this byte; empty lines are none."""
    ends, count, plain, unclosed, has_blanks = _separators(text, begin)
    regular = width > 1 and len(ends) == width * count
    last = ends[width - 1 :: width] if regular else ends
    odd: list[tuple[int, int]] = []
    if regular and _ends_line(text, last).all():
        ends = ends.reshape(-1, width)
        starts = np.concatenate([ends[:1, -1] * 0 + begin, ends[:-1, -1] + 1])
    else:
        lines = np.flatnonzero(_ends_line(text, ends))
        counts = np.diff(lines, prepend=-1)
        starts = np.append(begin, ends[lines[:-1]] + 1)[: len(lines)]
        records = ~_blank(text, starts, ends[lines], counts)
        whole = records & (counts == width)
        wrong = records & ~whole
        odd = list(zip((1 + np.cumsum(records))[wrong].tolist(), counts[wrong].tolist(), strict=True))
        starts, ends = starts[whole], ends[lines[whole][:, None] - np.arange(width - 1, -1, -1)]
    if len(ends) and ends[0, -1] and text[ends[0, -1] - 1] == _RETURN:
        ends = ends.copy()
        ends[:, -1] -= (ends[:, -1] > (ends[:, -2] + 1 if width > 1 else starts)) & (text[ends[:, -1] - 1] == _RETURN)
    return Cells(text, starts, ends, odd, plain, unclosed, has_blanks)


def _separators(text: NDArray[np.uint8], begin: int) -> tuple[Places, int, bool, int, bool]:
    """Where cells end: at commas and ends of lines outside of quotes, and at the end of the text.

    Also how many of these end a line, 0 if there are quotes, whether all between them are numbers without NaN, where a
    quote is never closed, and whether there may be blanks before one that begins a cell.
    """
    kind = np.int32 if len(text) < 2**31 - 1 else np.int64
    found: list[Places] = [np.empty(0, kind)]
    marks: list[Places] = [np.empty(0, kind)]
    lines, plain, unclosed, has_blanks = 0, True, -1, False
    for start in range(begin, len(text), _PIECE):
        piece = text[start : start + _PIECE]
        line = piece == LINE
        lines += int(np.count_nonzero(line))
        found.append((np.flatnonzero((piece == _COMMA) | line) + start).astype(kind))
        plain = plain and bool((piece[piece > _NINE] | 0x20 == _EXPONENT).all())
        mark = piece == _MARK
        if mark.any():
            marks.append((np.flatnonzero(mark) + start).astype(kind))
    ends, quotes = np.concatenate(found), np.concatenate(marks)
    if quoted := len(quotes) > 0:
        quotes, unclosed = _quoting(text, begin, quotes)
        has_blanks = bool(np.isin(text[quotes[::2] - 1], [*_BLANK.replace(b"\n", b"")]).any())
        ends, lines, plain = ends[np.searchsorted(quotes, ends) % 2 == 0], 0, False
    if begin < len(text) and (not len(ends) or ends[-1] != len(text) - 1 or text[ends[-1]] != LINE):
        ends, lines = np.append(ends, np.array(len(text), kind)), lines + (not quoted)
    return ends, lines, plain, unclosed, has_blanks


def _quoting(text: NDArray[np.uint8], begin: int, marks: Places) -> tuple[Places, int]:
    """The quotes that begin and end cells, in turns, and where the first one stands that is never closed, else -1.

    One within a cell that doesn't begin with it is a letter (`5" pipe`), as is one that is never closed.
    """
    opening = marks[::2]
    before = text[np.maximum(opening - 1, 0)]
    begins = (opening == begin) | (before == _COMMA) | (before == LINE)
    begins[1:] |= opening[1:] == marks[1:-1:2] + 1  # of two in a cell, which mean one
    begins[~begins] = [_begins_cell(text, begin, mark) for mark in opening[~begins].tolist()]
    if begins.all() and len(marks) % 2 == 0:
        return marks, -1
    found: list[int] = []
    places, at = marks.tolist(), 0
    while at < len(places):
        opened, at = places[at], at + 1
        if not _begins_cell(text, begin, opened):
            continue
        while at + 1 < len(places) and places[at + 1] == places[at] + 1:
            at += 2
        if at >= len(places):
            return np.array(found, marks.dtype), opened
        found += [opened, places[at]]
        at += 1
    return np.array(found, marks.dtype), -1


def _begins_cell(text: NDArray[np.uint8], begin: int, place: int) -> bool:
    """Whether there are but blanks between a place and the comma, or the end of a line, before it."""
    while place > begin and text[place - 1] in _BLANK:
        place -= 1
    return place == begin or int(text[place - 1]) in (_COMMA, LINE)


def _blank(
    text: NDArray[np.uint8], begins: NDArray[np.int64], ends: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which lines hold nothing but blanks."""
    found: NDArray[np.bool_] = (counts == 1) & (ends - begins < 80)
    for line in np.flatnonzero(found).tolist():
        found[line] = not bytes(text[begins[line] : ends[line]]).strip(_BLANK)
    return found
