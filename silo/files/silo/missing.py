"""Whole numbers and truths that are missing, in files whose columns hold nothing but numbers.

Floats have NaN and dates NaT; a recording has a mask for all else. Files that have none get doubles with NaN where
these hold all the others, which every reader understands; columns that are to stay integers, and 64-bit integers that
doubles can't hold, get a number that no sample is, raw bytes get zeros. `Missing`, in the facts of the file, makes the
mask of each again.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.recording import RecordedElement, RecordedEntry
from silo.core.structs import alike
from silo.files.silo.format import FilledEntry, Missing

_EXACT = 2**53

Columns = Sequence[NDArray[Any]]


def in_doubles(element: RecordedElement) -> RecordedElement:
    """Return the element without masks: NaN stands where whole numbers are missing, if doubles hold all the others.

    Else a number that none of them is.
    """
    return _without_masks(element, lambda columns: _doubles(columns) or _filled(columns))


def filled(element: RecordedElement) -> RecordedElement:
    """Return the element without masks: where whole numbers are missing stands a number that none of them is."""
    return _without_masks(element, _filled)


def is_masked(values: NDArray[Any]) -> bool:
    """Whether values have a mask: of a type without NaN, some are missing."""
    return isinstance(values, np.ma.MaskedArray)


def _without_masks(
    element: RecordedElement, change: Callable[[Columns], tuple[Columns, int | None]]
) -> RecordedElement:
    columns = [entry.values for entry in element.entries]
    if not any(map(is_masked, columns)):
        return element
    same = len({column.dtype for column in columns}) == 1  # entries of one type stay of one type
    made: list[RecordedEntry] = []
    together = change(columns) if same else None
    for number, (entry, column) in enumerate(zip(element.entries, columns, strict=True)):
        if together is None and not is_masked(column):
            made.append(entry)
            continue
        (values,), fill = change([column]) if together is None else ([together[0][number]], together[1])
        spans = _stretches(np.ma.getmaskarray(column)) if column.dtype.kind == "V" else ()
        made.append(FilledEntry(entry.name, entry.entry, values, Missing(column.dtype.str, fill, spans)))
    return alike(RecordedElement, element, entries=tuple(made))


def _stretches(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return tuple(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


def _doubles(columns: Columns) -> tuple[Columns, None] | None:
    """NaN where values are missing; None where doubles don't hold all the others."""
    for column in columns:
        there = np.ma.compressed(np.ma.asarray(column))
        wide = column.dtype.kind in "iu" and column.dtype.itemsize == 8 and len(there)
        if column.dtype.kind not in "biu" or (wide and not -_EXACT <= int(there.min()) <= int(there.max()) <= _EXACT):
            return None
    return [np.ma.filled(column.astype(np.float64), np.nan) for column in columns], None


def _filled(columns: Columns) -> tuple[Columns, int | None]:
    """A number that no value is where values are missing, and that number; zeros of raw bytes, which have none."""
    dtype = columns[0].dtype
    if dtype.kind not in "biu":
        return [np.ma.filled(column, np.zeros(1, dtype)[0]) for column in columns], None
    there = np.concatenate([np.ma.compressed(np.ma.asarray(column)) for column in columns])
    wide = np.dtype(np.uint8) if dtype.kind == "b" else dtype
    fill = _free(there, wide)
    if fill is None:
        wide = np.dtype(np.int64)
        fill = int(np.iinfo(wide).min)
    return [np.ma.filled(column.astype(wide), fill) for column in columns], fill


def _free(there: NDArray[Any], dtype: np.dtype[Any]) -> int | None:
    """A number of a type that no value is: its lowest, of unsigned ones its largest, if it may be; None for none."""
    ends = np.iinfo(dtype)
    for number in (ends.max,) if dtype.kind == "u" else (ends.min, ends.max):
        if not (there == number).any():
            return int(number)
    if dtype.itemsize < 8:
        return None
    known = set(there.tolist())
    return next(number for number in range(len(known) + 1) if number not in known)
