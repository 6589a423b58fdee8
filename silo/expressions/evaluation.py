"""Bound expressions computed over batches of rows, with what they remember from one batch to the next.

An expression is judged at every tick where one of its signals has a sample; the others hold. A held value is good until
the next sample of its signal would be due: after that (rows were lost, a buffer ended, an element is off) it is
unobservable, and so is what depends on it, unless the rest decides (`false and ...`). A NaN is unobservable too where
it is compared. `prev`, `diff` and `rate` step per sample of their own signals, windows use time stamps; after samples
that are missing both begin anew. However the rows are cut into batches, the results are the same, to the last bit.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import EXACT
from silo.core.arrays.wholes import bits_of, fitting, nearest, told
from silo.expressions.binding import (
    OFF,
    BoundExpression,
    BoundSignal,
    Computed,
    Constant,
    Part,
    Remembered,
    ScalarPlace,
    columns_of,
    parts_in,
)
from silo.expressions.operations import (
    COMPARING,
    OPERATIONS,
    REDUCING,
    WHOLE,
    Truth,
    Value,
    as_numbers,
    as_truth,
    columned,
    computed_whole,
    raw,
    spread,
)
from silo.expressions.windows import Window, WindowMemory

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

FALSE, TRUE, UNOBSERVABLE = 0, 1, -1


@dataclass(frozen=True)
class SourceRows:
    """New rows of one source: ticks and time stamps of shape `(n,)`, and by (element, entry) values of that shape.

    They are float64, integers int64 or uint64: sums, products and comparisons of these are exact. `holds`, of that
    shape, are how many ticks each row holds, where it isn't always the divider of the source.
    """

    ticks: Ints
    time_ns: Ints
    columns: Mapping[tuple[int, int], Floats | Ints]
    holds: Ints | None = None


@dataclass(frozen=True)
class Judged:
    """What expressions gave at ticks of shape `(n,)`, one value each: shape `(n,)`, or `(n, k)` for a vector.

    `seen[i]`, shape `(n,)`, tells where every signal of expression i had a value; None where all had.
    """

    ticks: Ints
    time_ns: Ints
    values: tuple[Value, ...]
    seen: tuple[Bools | None, ...]

    def numbers(self, which: int = 0) -> Floats:
        """Return the results of an expression as float64, NaN where they are unobservable.

        Of an evaluator of what is `whole` those that are: int64, or uint64 where that is too small, whatever they are
        where they are unobservable.
        """
        value = self.values[which]
        return as_numbers(value) if isinstance(value, Truth) else value  # type: ignore[no-any-return]

    def codes(self, which: int = 0) -> NDArray[np.int8]:
        """Return the results of a condition: TRUE, FALSE or UNOBSERVABLE. A number is true where it isn't 0."""
        truth = as_truth(self.values[which])
        codes = truth.true.astype(np.int8)
        if truth.unknown is not None:
            codes[truth.unknown] = UNOBSERVABLE
        return codes  # type: ignore[no-any-return]


@dataclass
class _Source:
    """A source as it was left by the batch before: its last tick (None before the first) and values."""

    divider: int
    tick: int | None = None
    values: dict[tuple[int, int], int | float] = field(default_factory=dict)
    holds: int | None = None  # how many ticks its last row does, where that isn't the divider

    def steps(self, rows: SourceRows | None) -> Ints:
        """How many ticks the row of the batch before, and each of this one, hold."""
        before = self.divider if self.holds is None else self.holds
        own = rows.holds if rows is not None else None
        here = np.full(0 if rows is None else len(rows.ticks), self.divider) if own is None else own
        return np.concatenate([np.asarray([before], np.int64), here])


class _Grid:
    """The ticks of one batch at which some sources have samples, and where each of them stands there."""

    def __init__(self, sources: Sequence[int], known: Mapping[int, _Source], rows: Mapping[int, SourceRows]) -> None:
        here = [rows[source] for source in sources if source in rows and len(rows[source].ticks)]
        first = here[0] if here else _NO_ROWS
        self.ticks, self.time_ns = first.ticks, first.time_ns
        # sources of one divider, which is nearly all there is, have samples at the same ticks
        self.alike = len(here) == len(sources) and all(_same(first.ticks, one.ticks) for one in here[1:])
        if here and not self.alike:
            self.ticks, found = np.unique(np.concatenate([one.ticks for one in here]), return_index=True)
            self.time_ns = np.concatenate([one.time_ns for one in here])[found]
        self._places: dict[int, NDArray[np.intp]] = {}
        self._missing: dict[int, Bools | None] = {}
        self._sources = sources
        self._known = known
        self._rows = rows

    def places(self, source: int) -> NDArray[np.intp]:
        """Which row of a source holds at each tick; -1 for the last one of the batch before."""
        found = self._places.get(source)
        if found is None:
            found = self._places[source] = np.searchsorted(self._ticks_of(source), self.ticks, "right") - 1
        return found

    def missing(self, source: int) -> Bools | None:
        """Where a source has no value, as a sample that was due isn't there; None: nowhere."""
        if self.alike:
            return None
        if source not in self._missing:
            before = self._known[source].tick
            with_before = np.concatenate([[_NEVER if before is None else before], self._ticks_of(source)])
            lost = self.ticks - np.asarray(with_before[self.places(source) + 1], np.int64) >= self._steps(source)
            self._missing[source] = lost if lost.any() else None
        return self._missing[source]

    def _ticks_of(self, source: int) -> Ints:
        return self._rows.get(source, _NO_ROWS).ticks

    def _steps(self, source: int) -> Ints | int:
        known, rows = self._known[source], self._rows.get(source)
        if known.holds is None and (rows is None or rows.holds is None):
            return known.divider
        return known.steps(rows)[self.places(source) + 1]

    def breaks(self) -> NDArray[np.intp]:
        """Places before which samples of one of the sources are missing."""
        found = [self._breaks_of(source) for source in self._sources]
        return found[0] if len(found) == 1 else np.unique(np.concatenate(found))

    def _breaks_of(self, source: int) -> NDArray[np.intp]:
        divider, before = self._known[source].divider, self._known[source].tick
        ticks = self._ticks_of(source)
        if not len(ticks):
            return _NOWHERE
        begin = int(ticks[0]) - divider if before is None else before
        if self._rows[source].holds is not None:
            steps = self._known[source].steps(self._rows[source])[:-1]
            return np.searchsorted(self.ticks, ticks[np.flatnonzero(np.diff(ticks, prepend=begin) > steps)])
        if int(ticks[-1]) - begin == len(ticks) * divider:
            return _NOWHERE
        late = ticks[np.flatnonzero(np.diff(ticks, prepend=begin) > divider)]
        return np.searchsorted(self.ticks, late)

    def held(self, source: int, column: Floats, before: Any) -> Floats:
        """A column of a source (or of what is computed at its ticks) with the value that holds at each tick."""
        if self.alike:
            return column
        with_before = np.concatenate([np.asarray(before, np.float64)[None], column])
        return self.without_missing((source,), with_before[self.places(source) + 1])

    def without_missing(self, sources: Sequence[int], values: Floats) -> Floats:
        """The values with NaN where one of the sources has none. May change them in place."""
        for source in sources:
            missing = self.missing(source)
            if missing is not None:
                values[missing] = np.nan
        return values


_NEVER = np.iinfo(np.int64).min // 2
_NOWHERE = np.zeros(0, np.intp)
_NO_ROWS = SourceRows(np.zeros(0, np.int64), np.zeros(0, np.int64), {})


def _same(one: Ints, other: Ints) -> bool:
    return one is other or (len(one) == len(other) and bool((one == other).all()))


@dataclass
class SourceMemory:
    """The last row of a source: its tick, and values by element and entry."""

    source: int
    tick: int | None
    values: list[tuple[int, int, int | float]]


@dataclass
class PartMemory:
    """What a remembering function keeps: its last result, the sample before, its window.

    Of integers beside the float64s what they may not hold.
    """

    last: np.ndarray
    sample: np.ndarray
    time_ns: int = 0
    window: WindowMemory | None = None
    last_whole: np.ndarray | None = None
    sample_whole: np.ndarray | None = None


@dataclass
class EvaluatorMemory:
    """What another evaluator of the same expressions needs to go on in this one's place."""

    sources: list[SourceMemory]
    parts: list[PartMemory]


class Evaluator:
    """Computes expressions over the rows of one run, batch after batch. A new run needs a new one.

    The expressions are judged together, at every tick where a signal of any of them has a sample. With `whole` those
    that are sums and products of columns of int64 give int64, where 64 bits hold that.
    """

    def __init__(self, *expressions: BoundExpression, whole: bool = False) -> None:
        self._gives_whole, self._has_whole, self._expressions = whole, False, expressions
        self._roots = [expression.root for expression in expressions]
        dividers = {source: divider for one in expressions for source, divider in one.sources.items()}
        self._sources = {source: _Source(dividers[source]) for source in sorted(dividers)}
        self._seen_by = [sorted({column.source for column in one.columns}) for one in expressions]
        self._wanted: dict[int, set[tuple[int, int]]] = {source: set() for source in self._sources}
        for expression in expressions:
            for column in expression.columns:
                if column.source != OFF:
                    self._wanted[column.source].add((column.element, column.entry))
        self._memories: dict[Remembered, PartMemory] = {}
        self._windows: dict[Remembered, Window] = {}
        for part in (one for expression in expressions for one in parts_in(expression.root)):
            if isinstance(part, Remembered):
                self._memories[part] = PartMemory(np.asarray(np.nan), np.asarray(np.nan))
                if part.window_ns:
                    self._windows[part] = Window(part.function, part.window_ns)
        self.sources = tuple(self._sources)  # that are needed
        # of one batch
        self._rows: Mapping[int, SourceRows] = {}
        self._grids: dict[tuple[int, ...], _Grid] = {}
        self._made: dict[Remembered, Floats] = {}
        self._made_whole: dict[Remembered, Ints] = {}
        self._wholes: dict[tuple[int, int], Ints | None] = {}  # by part and grid, which live longer
        self._small: dict[tuple[int, int], Value] = {}  # likewise what float64 holds to the last digit

    def feed(self, rows: Mapping[int, SourceRows]) -> Judged:
        """Judge the next rows of each source.

        A batch is whole up to some tick: no later one may bring a row with a tick that an earlier one went beyond.
        """
        self._rows, self._grids, self._made, self._made_whole, self._wholes, self._small = rows, {}, {}, {}, {}, {}
        columns = [column for one in rows.values() for column in one.columns.values()]
        self._has_whole = any(column.dtype.kind in "iu" for column in columns)
        grid = self._grid(self.sources)
        count = len(grid.ticks)
        with np.errstate(all="ignore"):
            for part in reversed(self._memories):  # the innermost were noted last, and others need them
                self._made[part] = self._remembered(part)
            values = tuple(spread(self._result(root, grid), count) for root in self._roots)
        seen = tuple(self._seen(sources, grid) for sources in self._seen_by)
        self._keep()
        self._rows, self._grids, self._made, self._made_whole, self._wholes, self._small = {}, {}, {}, {}, {}, {}
        return Judged(grid.ticks, grid.time_ns, values, seen)

    def memory(self) -> EvaluatorMemory:
        """Return what it remembers."""
        sources = [
            SourceMemory(source, one.tick, [(*key, value) for key, value in one.values.items()])
            for source, one in self._sources.items()
        ]
        windows = {part: window.memory() for part, window in self._windows.items()}
        parts = [replace(one, window=windows.get(part)) for part, one in self._memories.items()]
        return EvaluatorMemory(sources, parts)

    def recall(self, memory: EvaluatorMemory) -> None:
        """Go on where another one stood, of the same expressions bound to the same run. Raises ValueError."""
        for kept in memory.sources:
            known = self._sources[kept.source]
            known.tick = kept.tick
            known.values = {(element, entry): value for element, entry, value in kept.values}
        self._recall_parts(memory.parts)

    def follow(self, before: "Evaluator", ticks: int) -> None:
        """Go on where another one, of the same meaning, came to the end of the `ticks` ticks before a cut.

        Every signal has a sample at the first tick behind it. Steps and windows go on over it, unless one is missing.
        """
        missing = set()
        pairs = zip(before._expressions, self._expressions, strict=True)
        for old, new in (pair for one, other in pairs for pair in zip(one.columns, other.columns, strict=True)):
            source = before._sources.get(old.source)
            if source is None or source.tick is None or source.tick + source.steps(None)[0] < ticks:
                missing.add(new.source)
        for number, own in self._sources.items():
            own.tick = _NEVER if number in missing else -own.divider
        self._recall_parts(before.memory().parts)

    def _recall_parts(self, parts: Sequence[PartMemory]) -> None:
        for part, kept in zip(self._memories, parts, strict=True):
            self._memories[part] = replace(kept, window=None)
            if kept.window is not None and part in self._windows:
                self._windows[part].recall(kept.window)

    def _seen(self, sources: Sequence[int], grid: _Grid) -> Bools | None:
        if OFF in sources:
            return np.zeros(len(grid.ticks), bool)
        missing = [lost for source in sources if (lost := grid.missing(source)) is not None]
        return ~np.logical_or.reduce(missing) if missing else None

    def _grid(self, sources: tuple[int, ...]) -> _Grid:
        found = self._grids.get(sources)
        if found is None:
            found = self._grids[sources] = _Grid(sources, self._sources, self._rows)
        return found

    def _keep(self) -> None:
        """Note the last row of each source; the arrays of the batch are free then."""
        for source, rows in self._rows.items():
            if source in self._sources and len(rows.ticks):
                kept = self._sources[source]
                kept.tick = int(rows.ticks[-1])
                kept.holds = None if rows.holds is None else int(rows.holds[-1])
                if len(self._sources) > 1:  # alone it never has to hold
                    kept.values = {key: rows.columns[key][-1].item() for key in self._wanted[source]}
        for part, memory in self._memories.items():
            if part in self._made and len(self._made[part]):
                memory.last = np.array(self._made[part][-1])
                memory.last_whole = np.array(self._made_whole[part][-1]) if part in self._made_whole else None

    # ------------------------------------------------------------------------------------------------ values

    def _value(self, part: Part, grid: _Grid) -> Value:
        if isinstance(part, Constant):
            return part.value
        if isinstance(part, BoundSignal):
            columns = [self._column(column.element, column.entry, column.source, grid) for column in part.columns]
            return np.stack(columns, axis=1) if part.vector else columns[0]
        if isinstance(part, Remembered):
            return self._recalled(part, grid)
        values = [self._value(one, grid) for one in part.parts]
        if part.operator == "isnan":
            return self._isnan(part, values[0], grid)
        meeting = _meeting(values)
        made = OPERATIONS[part.operator](meeting)
        return self._exactly(part, grid, meeting, made) if self._has_whole else made

    # ---------------------------------------------------------------------- integers that a float64 can't hold

    def _result(self, part: Part, grid: _Grid) -> Value:
        """The value of an expression; where whole ones are asked for, and it is one, int64 or uint64."""
        made = self._value(part, grid)
        if not self._gives_whole or isinstance(made, Truth) or _may_be_none(part):
            return made
        if (whole := self._whole(part, grid)) is None:
            return made
        return fitting(whole, made)

    def _exactly(self, part: Computed, grid: _Grid, values: Sequence[Value], made: Value) -> Value:
        """What was made of float64 to the last digit, as far as it is made of integers."""
        if isinstance(made, Truth) and part.operator not in COMPARING:
            return made
        numbers, key = [as_numbers(value) for value in values], (id(part), id(grid))
        if all(map(_is_small, numbers)) and (isinstance(made, Truth) or _is_small(made)):
            self._small[key] = made  # float64 holds all of it
            return made
        sides = _all_of(self._whole(one, grid) for one in part.parts)
        if sides is None:
            return made
        bits: list[Any] = [*_meeting(sides)]
        if isinstance(made, Truth):
            (one, known), (other, also) = (told(*side) for side in zip(bits, numbers, strict=True))
            return Truth(np.where(known & also, COMPARING[part.operator](one, other), made.true), made.unknown)
        if part.operator == "**":
            whole = _power(*part.parts)
        else:
            whole, made = computed_whole(part.operator, bits, numbers, made)
        if whole is None:
            return made
        self._wholes[key] = whole
        return nearest(whole, made)

    def _whole(self, part: Part, grid: _Grid) -> Ints | None:
        """What is made of integers, modulo 2^64; None of anything else. Any number where samples are missing.

        Of what is computed `_value` comes first, which notes it.
        """
        key = id(part), id(grid)
        if key not in self._wholes:
            self._wholes[key] = self._as_whole(part, grid)
        return self._wholes[key]

    def _as_whole(self, part: Part, grid: _Grid) -> Ints | None:
        if isinstance(part, Constant):
            whole = part.whole
            if whole is None and part.value.is_integer() and abs(part.value) < EXACT:
                whole = int(part.value)
            return bits_of(whole) if whole is not None and -(2**63) <= whole < 2**64 else None
        if isinstance(part, BoundSignal):
            columns = _all_of(self._whole_column(column, grid) for column in part.columns)
            return None if columns is None else np.stack(columns, axis=1) if part.vector else columns[0]
        if isinstance(part, Remembered):
            return self._whole_recalled(part, grid)
        small = self._small.get((id(part), id(grid)))
        if small is None or isinstance(small, Truth) or part.operator not in WHOLE:
            return _power(*part.parts) if part.operator == "**" else None
        return None if _all_of(self._whole(one, grid) for one in part.parts) is None else np.asarray(small, np.int64)

    def _whole_recalled(self, part: Remembered, grid: _Grid) -> Ints | None:
        made, own, memory = self._made_whole.get(part), self._grid_of(part), self._memories[part]
        known = memory.last_whole is not None or bool(np.isnan(memory.last).all())  # else it may have a fraction
        if own is None or (made is None and (len(own.ticks) or not known)):
            return None
        if made is None:
            made = np.zeros((0, *trailing(part.part)), np.int64)
        if own is grid or (grid.alike and own.alike):
            return made
        before = _whole_before(memory.last_whole, memory.last, made.shape[1:])
        if before is None:
            return None  # it was rounded
        places = np.searchsorted(own.ticks, grid.ticks, "right")
        return np.concatenate([before[None], made])[places]

    def _whole_column(self, place: ScalarPlace, grid: _Grid) -> Ints | None:
        key, source = (place.element, place.entry), place.source
        if source == OFF:
            return None
        before = self._sources[source].values.get(key, math.nan)
        rows = self._rows.get(source)
        column: Any = _NO_WHOLE if rows is None else rows.columns[key]  # one without rows says what it is of, too
        if column.dtype.kind not in "iu" or (rows is None and not isinstance(before, int)):
            return None
        column = column.astype(np.int64, copy=False)
        if grid.alike:
            return column  # type: ignore[no-any-return]
        if isinstance(before, float) and (abs(before) > EXACT or before % 1 > 0):
            return None  # it was rounded
        held = 0 if math.isnan(before) else int(before)  # of a NaN there is no result either
        return np.concatenate([bits_of(held)[None], column])[grid.places(source) + 1]

    # ------------------------------------------------------------------------------------------------------------

    def _isnan(self, part: Computed, value: Value, grid: _Grid) -> Truth:
        """Whether a value is no number: of what has no sample at all nobody can tell."""
        numbers: Any = spread(as_numbers(value), len(grid.ticks))
        true = np.isnan(numbers)
        seen = self._seen(sorted({column.source for column in columns_of(part)}), grid)
        if seen is None:
            return Truth(true)
        unknown = np.broadcast_to(~seen if true.ndim == 1 else ~seen[:, None], true.shape)
        return Truth(true & ~unknown, unknown)

    def _column(self, element: int, entry: int, source: int, grid: _Grid) -> Floats:
        key = element, entry
        if source == OFF:
            return np.full(len(grid.ticks), np.nan)
        rows = self._rows.get(source)
        column = rows.columns[key] if rows is not None and len(rows.ticks) else _NO_VALUES
        floats = column.astype(np.float64, copy=False)
        return grid.held(source, floats, self._sources[source].values.get(key, np.nan))

    def _recalled(self, part: Remembered, grid: _Grid) -> Floats:
        """What a remembering function gave, held at the ticks of a grid."""
        made, own = self._made[part], self._grid_of(part)
        if own is None:
            return np.full((len(grid.ticks), *made.shape[1:]), np.nan)
        if own is grid or (grid.alike and own.alike):
            return made
        before = np.broadcast_to(self._memories[part].last, (1, *made.shape[1:]))
        places = np.searchsorted(own.ticks, grid.ticks, "right")
        return grid.without_missing(part.sources, np.concatenate([before, made])[places])

    def _grid_of(self, part: Remembered) -> _Grid | None:
        return None if OFF in part.sources else self._grid(part.sources)

    def _remembered(self, part: Remembered) -> Floats:
        """The results of a remembering function at the ticks of its own signals."""
        memory, grid = self._memories[part], self._grid_of(part)
        if grid is None:
            return np.full((0, *trailing(part.part)), np.nan)
        value = self._value(part.part, grid)
        samples = as_numbers(value) if isinstance(value, Truth) else value
        if not len(grid.ticks):
            return samples  # type: ignore[no-any-return]
        breaks = grid.breaks()
        if part in self._windows:
            made = self._windows[part].feed(grid.time_ns, samples, breaks)
            return grid.without_missing(part.sources, made)
        before = np.concatenate([np.broadcast_to(memory.sample, (1, *samples.shape[1:])), samples[:-1]])
        before[breaks] = np.nan
        made = before if part.function == "prev" else samples - before
        whole = self._whole(part.part, grid) if self._has_whole else None
        if whole is not None:
            made = self._stepped(part, memory, whole, made)
        memory.sample_whole = np.array(whole[-1]) if whole is not None else None
        if part.function == "rate":
            elapsed = np.diff(grid.time_ns, prepend=memory.time_ns) * 1e-9
            elapsed[elapsed <= 0] = np.nan  # the clock was set back: no rate can be told
            made = made / (elapsed if made.ndim == 1 else elapsed[:, None])
        memory.sample, memory.time_ns = np.array(samples[-1]), int(grid.time_ns[-1])
        return grid.without_missing(part.sources, made)

    def _stepped(self, part: Remembered, memory: PartMemory, whole: Ints, made: Floats) -> Floats:
        """Samples before, or differences to them, to the last digit as far as there are some."""
        before = _whole_before(memory.sample_whole, memory.sample, whole.shape[1:])
        if before is None:
            made[0], before = np.nan, whole[0]  # what came before was rounded
        every = np.concatenate([before[None], whole])
        if part.function == "prev":
            self._made_whole[part] = every[:-1]
            return made
        found = np.diff(every, axis=0)
        if part.function == "diff":
            self._made_whole[part] = found
        return nearest(found, made)


_NO_VALUES = np.zeros(0)
_NO_WHOLE = np.zeros(0, np.int64)


def _all_of(values: Iterable[Ints | None]) -> list[Ints] | None:
    """All of them; None, and no look at those behind it, where one is None."""
    found = []
    for value in values:
        if value is None:
            return None
        found.append(value)
    return found


def _is_small(numbers: Any) -> bool:
    """Whether float64 holds integers of this size to the last digit."""
    return abs(numbers) < EXACT if isinstance(numbers, float) else not (np.abs(numbers) >= EXACT).any()


def _meeting(values: Sequence[Value]) -> Sequence[Value]:
    """A scalar beside a vector meets each of its values."""
    if any(raw(value).ndim == 2 for value in values if not isinstance(value, float)):
        return [columned(value) for value in values]
    return values


def _may_be_none(part: Part) -> bool:
    """Whether it may be no number though all its signals have one: before the first sample, or a rest by 0."""
    rests = [one.parts[-1] for one in parts_in(part) if isinstance(one, Computed) and one.operator == "%"]
    by_any = not all(isinstance(by, Constant) and by.value for by in rests)
    return by_any or any(isinstance(one, Remembered) for one in parts_in(part))


def _power(base: Part, exponent: Part) -> Ints | None:
    """The whole number that one constant to the power of another is, as in `2**60`; None where it is none of them."""
    if not (isinstance(base, Constant) and isinstance(exponent, Constant)):
        return None
    if not (base.value.is_integer() and exponent.value.is_integer() and 0 <= exponent.value < 64):
        return None
    made = int(base.value) ** int(exponent.value)
    return np.asarray(made, np.int64) if abs(made) < 2**63 else None


def _whole_before(known: Ints | None, sample: Any, shape: tuple[int, ...]) -> Ints | None:
    """A value of the batch before as int64: any number where there was none, None where it may be another one."""
    if known is not None:
        return known
    values = np.where(np.isnan(sample), 0.0, sample)
    if (np.abs(values) > EXACT).any() or (values % 1).any():
        return None
    return np.broadcast_to(np.asarray(values, np.int64), shape)


def trailing(part: Part) -> tuple[int, ...]:
    """The shape of one value of a part."""
    if isinstance(part, BoundSignal):
        return (len(part.columns),) if part.vector else ()
    if isinstance(part, Remembered):
        return trailing(part.part)
    if isinstance(part, Constant) or part.operator in REDUCING:
        return ()
    return max((trailing(one) for one in part.parts), key=len)
