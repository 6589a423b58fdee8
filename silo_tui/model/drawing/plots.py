"""What a plot is of, and how it is drawn: the dots of each signal, its axis, what stands at the cursor."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import ColumnPiece, ColumnStore, Floats, Marks, NonFinite
from silo.core.elements import ElementInfo, Entry
from silo_tui.model.drawing import axes, braille, dots
from silo_tui.model.drawing.axes import LogAxis, axis_of, scale_of, words_of
from silo_tui.model.drawing.window import PlotWindow


def hold(low: Floats, high: Floats, limit: int, marks: Marks | None = None) -> tuple[Floats, Floats]:
    """Fill gaps of at most `limit` columns with the value before: a slow signal holds between its samples.

    Of one signal, or of many of shape `(signals, columns)`. What has marks stays as it is, and nothing is held beyond
    it: a NaN ends a value, and so does a hole.
    """
    valid = ~np.isnan(low)
    stops = valid if marks is None else valid | (marks != 0)
    if limit < 1 or stops.all() or not valid.any():
        return low, high
    columns = low.shape[-1]
    places = np.broadcast_to(np.arange(columns), low.shape)
    source = np.maximum.accumulate(np.where(stops, places, -1), axis=-1)
    age = places - source
    source = np.maximum(source, 0)
    held = ~stops & np.take_along_axis(valid, source, -1) & (age <= limit)
    # of a column with several values the one nearer to the next column: both ends are in the data, the middle is not
    following = np.minimum.accumulate(np.where(valid, places, columns)[..., ::-1], axis=-1)[..., ::-1]
    following = np.where(following < columns, following, source)
    before, after = np.take_along_axis(low, source, -1), np.take_along_axis(low, following, -1)
    one = np.where(after < before, before, np.take_along_axis(high, source, -1))
    return np.where(held, one, low), np.where(held, one, high)


def hold_piece(piece: ColumnPiece, limit: int) -> ColumnPiece:
    """Return a piece whose gaps are filled so."""
    low, high = hold(piece.low, piece.high, limit, piece.marks)
    return ColumnPiece(low, high, piece.marks, piece.base)


Owners = NDArray[np.int8]


class Plotted(msgspec.Struct, frozen=True):
    """One plot: an entry of an element."""

    element: ElementInfo
    position: int

    @property
    def entry(self) -> Entry:
        """The entry that is plotted."""
        return self.element.entries[self.position]

    @property
    def name(self) -> str:
        """Full name of the entry."""
        return self.element.name + self.entry.suffix

    @property
    def numeric(self) -> bool:
        """Whether there is a curve to draw."""
        return self.entry.dtype[1:2] not in "SU"


def plots_of(elements: list[ElementInfo]) -> list[Plotted]:
    """Return every entry of every element, in their order."""
    return [Plotted(element, position) for element in elements for position in range(len(element.entries))]


class Axis(msgspec.Struct, frozen=True):
    """Where values stand in a plot: the ends of its scale; where `log` is one, they are places on that."""

    scale: axes.Scale
    base: int = 0
    log: LogAxis | None = None

    def rows(self, values: Floats, rows: int) -> NDArray[np.int64]:
        """Return the row of dots of values, offsets from the base, 0 at the bottom; those outside at its edge."""
        return braille.row_of(self.places(values), self.scale, rows)

    def places(self, values: Floats) -> Floats:
        """Return where values stand on the scale."""
        return values if self.log is None else self.log.place(values)

    def words(self, lines: int, width: int) -> tuple[dict[int, str], str]:
        """Return what stands on which line of the axis, and what these numbers count from."""
        if self.log is not None:
            return words_of(self.log, self.scale, lines), ""
        return axes.tick_words(axes.ticks_of(self.scale, lines), self.base, width)


class Picture(msgspec.Struct, frozen=True):
    """One signal, ready to be drawn: its dots, its axis, and what stands at the cursor.

    All numbers are offsets from the base of the axis; NaN where there is no finite one. `signs` names what is no
    number. `newest` is the row of dots of the newest value, None where there is none.
    """

    piece: ColumnPiece
    lit: dots.Dots
    axis: Axis
    smallest: float
    largest: float
    at_cursor: tuple[float, float] | None
    holes: tuple[braille.DrawnHole, ...] = ()
    signs: str = ""
    cursor_signs: str = ""
    newest: int | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        """The signal alone, as lines."""
        return tuple(dots.lines_of(together([self])[0]))


def pieces_of(
    store: ColumnStore, series: Sequence[Plotted], columns: int, period_of: Callable[[str], int]
) -> list[ColumnPiece]:
    """Return the newest columns of signals, the values of slow ones held between their samples."""
    return [
        hold_piece(
            store.piece(plotted.name, store.end, columns),
            max(2, 2 * period_of(plotted.element.name) // max(1, store.column_ns) + 1),
        )
        for plotted in series
    ]


def draw(store: ColumnStore, window: PlotWindow, plotted: Plotted, width: int, height: int, period_ns: int) -> Picture:
    """Draw a signal alone, in `width` x `height` cells, from the newest columns of a store."""
    return draw_panel(store, window, [plotted], [False], width, height, lambda name: period_ns)[0]


def draw_panel(
    store: ColumnStore,
    window: PlotWindow,
    series: Sequence[Plotted],
    right: Sequence[bool],
    width: int,
    height: int,
    period_of: Callable[[str], int],
    ghosts: Mapping[int, ColumnPiece] = MappingProxyType({}),
) -> list[Picture]:
    """Draw signals that share a plot; `right` says which belong to the axis on the right.

    `ghosts` are what a saved run had then, by the place of the signal: they share its axis, and come behind the others.
    """
    pieces = pieces_of(store, series, 2 * width, period_of) + list(ghosts.values())
    right = [*right, *(right[place] for place in ghosts)]
    found: dict[bool, Axis] = {}
    for side in dict.fromkeys(right):
        members = [at for at, its in enumerate(right) if its is side]
        log = any(series[at].name in window.logs for at in members if at < len(series))
        base = 0 if log else max((pieces[at].base for at in members), key=abs)
        for at in members:
            pieces[at] = _on_base(pieces[at], base)
        key = "|".join(series[at].name for at in members if at < len(series))
        found[side] = _axis_of(window, key, [pieces[at] for at in members], height, base, log=log)
    found = _zeros_met(found, height)
    return [_picture(window, piece, found[side], width, height) for piece, side in zip(pieces, right, strict=True)]


def _zeros_met(found: dict[bool, Axis], height: int) -> dict[bool, Axis]:
    """Return two axes, which both have a zero, with the zeros on one line: a curve below it is below that of both."""
    ends = [axis.scale for axis in found.values()]
    plain = all(axis.log is None and not axis.base for axis in found.values())
    have_zeros = all(low <= 0 <= high and axes.has_round(low, high) for low, high in ends)
    if len(found) < 2 or height < 3 or not plain or not have_zeros:
        return found
    met = zip(found.items(), axes.zeros_met(ends, height), strict=True)
    return {side: msgspec.structs.replace(axis, scale=scale) for (side, axis), scale in met}


def _axis_of(window: PlotWindow, key: str, pieces: Sequence[ColumnPiece], height: int, base: int, *, log: bool) -> Axis:
    spans = [ends for piece in pieces if (ends := braille.value_range(piece.low, piece.high))]
    around = (min(low for low, _ in spans), max(high for _, high in spans)) if spans else None
    if not log:
        return Axis(window.follow_scale(key, around, height, base), base)
    axis = axis_of([values for piece in pieces for values in (piece.low, piece.high)])
    if axis is None or around is None:
        return Axis((math.nan, math.nan), base)
    if window.fixed_scale and key in window.log_scales:
        low, high = window.log_scales[key]
        axis = LogAxis(axis.least, axis.signed or low <= 0)
        bottom, top = axis.place(np.array([low, high])).tolist()
        return Axis((bottom, top), base, axis)
    scale = scale_of(axis, *around)
    window.log_scales[key] = axis.value(scale[0]), axis.value(scale[1])
    return Axis(scale, base, axis)


def _on_base(piece: ColumnPiece, base: int) -> ColumnPiece:
    if piece.base == base:
        return piece
    shift = float(piece.base - base)
    return ColumnPiece(piece.low + shift, piece.high + shift, piece.marks, base)


def _picture(window: PlotWindow, piece: ColumnPiece, axis: Axis, width: int, height: int) -> Picture:
    columns = 2 * width
    ends = braille.value_range(piece.low, piece.high) or (math.nan, math.nan)
    at_cursor, cursor_signs = None, ""
    if window.cursor is not None:
        last = columns - 1 - window.cursor
        here = slice(max(0, last - 1), last + 1)
        if not np.isnan(piece.low[here]).all():
            at_cursor = float(np.nanmin(piece.low[here])), float(np.nanmax(piece.high[here]))
        cursor_signs = signs_of(piece.marks[here])
    lit = braille.curve(axis.places(piece.low), axis.places(piece.high), axis.scale, width, height)
    newest = np.flatnonzero(~np.isnan(piece.low))[-1:]
    middle = piece.low[newest] / 2 + piece.high[newest] / 2  # its upper end is where the curve was, not where it is
    row = int(axis.rows(middle, 4 * height)[0]) if len(newest) else None
    return Picture(
        piece,
        lit,
        axis,
        *ends,
        at_cursor,
        tuple(braille.holes(piece.low, piece.marks, width)),
        signs_of(piece.marks),
        cursor_signs,
        None if row is None else 4 * height - 1 - row,
    )


NOBODY, HOLE = -1, -2


def over_one_another(lit: Sequence[dots.Dots], order: Iterable[int]) -> tuple[dots.Cells, Owners]:
    """Return the cells of curves, drawn in this order, the last one in front, and which of them each cell is of."""
    rows, columns = lit[0].shape
    owners = np.full((rows // 4, columns // 2), NOBODY, np.int8)
    for at in order:
        owners[lit[at].reshape(rows // 4, 4, columns // 2, 2).any(axis=(1, 3))] = at
    every: dots.Dots = np.any(np.stack(lit), axis=0)
    return dots.cells(every), owners


def together(pictures: Sequence[Picture], front: int = 0, ghosts: int = 0) -> tuple[dots.Cells, Owners]:
    """Return the cells of pictures over one another, shape `(height, width)`, and whose colour each cell has.

    The one in `front` is drawn last, the last `ghosts` pictures first. NOBODY owns an empty cell, HOLE one that is
    shaded.
    """
    begin = len(pictures) - ghosts
    others = (*range(begin, len(pictures)), *(at for at in range(begin) if at != front))
    cells, owners = over_one_another([picture.lit for picture in pictures], (*others, front))
    for at, picture in enumerate(pictures):
        marked = cells.copy()
        braille.draw_marks(marked, picture.piece.marks)
        owners[marked != cells] = at
        cells = marked
    for hole in pictures[front].holes:
        shaded = cells.copy()
        braille.draw_hole(shaded, hole)
        free = (shaded != cells) & (owners == NOBODY)
        cells[free], owners[free] = shaded[free], HOLE
    return cells, owners


def signs_of(marks: Marks) -> str:
    """Return which samples of these columns are no finite numbers: `nan inf`."""
    flags = int(np.bitwise_or.reduce(marks, initial=0))
    names = ((NonFinite.NAN, "nan"), (NonFinite.POS_INF, "inf"), (NonFinite.NEG_INF, "-inf"))
    return " ".join(name for mark, name in names if flags & mark)


# --------------------------------------------------------------------------------------------- trends of a whole table
# One NumPy call for all. Measured for 46 rows on the slow core: 1 ms, where one by one they took 11 ms, a fifth of what
# a live table cost.


HOLD = 4  # columns that a slow signal holds


def trends(store: ColumnStore, names: Sequence[str], width: int) -> list[str]:
    """Return the newest `2 * width` columns of each signal as `width` cells; blank where the store hasn't got it."""
    pieces = [store.piece(name, store.end, 2 * width) for name in names]
    low, high, marks = (np.array([getattr(each, of) for each in pieces]) for of in ("low", "high", "marks"))
    return trend_lines(*hold(low, high, HOLD, marks), marks) if low.size else [""] * len(names)


def trend_lines(low: Floats, high: Floats, marks: Marks) -> list[str]:
    """Return one line for each signal, of arrays of shape (signals, 2 x cells), NaN where there is no value.

    A signal fills its height, and is in its middle where it is constant.
    """
    columns = low.shape[1]
    smallest = np.where(np.isnan(low), np.inf, low).min(axis=1)
    largest = np.where(np.isnan(high), -np.inf, high).max(axis=1)
    smallest, largest = np.where(smallest <= largest, (smallest, largest), 0.0)
    with np.errstate(over="ignore"):
        constant = ~(largest - smallest > np.maximum(np.abs(smallest), np.abs(largest)) * braille.CONSTANT)
        scales = np.where(constant, smallest - 1, smallest), np.where(constant, largest + 1, largest)
    cells = dots.cells(braille.curve(low, high, scales, columns // 2, 1).reshape(-1, columns))
    valid = ~np.isnan(low)
    extent = columns - valid.argmax(axis=1) - valid[:, ::-1].argmax(axis=1)  # from the first value to the last
    for at in np.flatnonzero((extent > valid.sum(axis=1)) | marks.any(axis=1)).tolist():
        braille.draw_over(cells[at : at + 1], low[at], marks[at])
    return dots.lines_of(cells)
