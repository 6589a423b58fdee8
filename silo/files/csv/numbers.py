"""The numbers of a CSV table by polars, where it is installed and the table is plain: 10 times as fast as in Python.

Whatever isn't plain (texts or quotes among the numbers, records of other lengths) gives None, and
`silo.files.csv.reader` reads it cell by cell, with its warnings: both give the same.
"""

import re
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SMALLEST = 1_000_000  # bytes; below, loading polars costs more than it saves

MOST_LOOKED_AT = 100  # lines

_WHOLE = re.compile(rb"[+-]?[0-9]{1,18}")
_NUMBER = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|-?(?:nan|NaN|inf)")
_QUOTE = b'"'
_BOM = b"\xef\xbb\xbf"


class Filled(NamedTuple):
    """The filled cells of a column of numbers: which rows they are in, and the values there."""

    places: NDArray[np.intp]
    values: NDArray[Any]


class NumberTable(NamedTuple):
    """A table of numbers: the texts of the first column, and the other columns."""

    first: NDArray[np.bytes_]
    columns: list[Filled]


def read_numbers(data: bytes, width: int, types: Sequence[np.dtype[Any]] | None) -> NumberTable | None:
    """Return a table of columns with `width` of them in its first record, None for one that isn't plain.

    types: those of the columns but the first, where they are known; else they follow from the texts.
    """
    if len(data) < SMALLEST or find_spec("polars") is None or not _may_be_plain(data, width):
        return None
    kinds = _types_of_sample(data, width) if types is None else types
    if kinds is None or len(kinds) != width - 1 or not all(map(_is_number, kinds)):
        return None
    import polars

    schema = {str(place): _polars_type(polars, kind) for place, kind in enumerate(kinds, start=1)}
    try:
        frame = polars.read_csv(
            data, has_header=False, skip_rows=1, schema={"0": polars.String, **schema}, quote_char=None
        )
    except (polars.exceptions.PolarsError, ValueError):
        return None
    # polars fills short lines up without a word, and refuses long ones: with the right sum none is short either
    if data.count(b",", data.find(b"\n")) != frame.height * (width - 1):
        return None
    first = frame.to_series(0)
    texts = np.array(first.to_list(), "S") if not first.null_count() else np.empty(0, "S1")
    if len(texts) != frame.height or not frame.height or _QUOTE in texts.tobytes():
        return None
    columns = [_filled(frame.to_series(place)) for place in range(1, width)]
    if types is None and not all(map(_is_exact, columns)):
        return None
    return NumberTable(texts, columns)


def _may_be_plain(data: bytes, width: int) -> bool:
    """Whether the first record is a line of its own, as those below may be."""
    head = data.find(b"\n")
    return head > 0 and width >= 2 and not data.startswith(_BOM) and data[head - 1 : head] != b"\r"


def _types_of_sample(data: bytes, width: int) -> list[np.dtype[Any]] | None:
    """What the first lines tell: whole numbers, or others; None for texts, and for a column that is empty there.

    Where a later line tells otherwise, polars refuses it.
    """
    begin = data.find(b"\n") + 1
    lines = data[begin : begin + MOST_LOOKED_AT * 32 * width].split(b"\n")[:MOST_LOOKED_AT]
    rows = [line.split(b",") for line in (lines[:-1] if len(lines) > 1 else lines)]
    if any(len(row) != width for row in rows):
        return None
    types = []
    for column in list(zip(*rows, strict=True))[1:]:
        cells = [cell for cell in column if cell]
        if not cells or not all(_NUMBER.fullmatch(cell) for cell in cells):
            return None
        types.append(np.dtype(np.int64 if all(_WHOLE.fullmatch(cell) for cell in cells) else np.float64))
    return types


def _is_number(kind: np.dtype[Any]) -> bool:
    return kind.kind in "biumM" or (kind.kind == "f" and kind.itemsize <= 8)


def _polars_type(polars: Any, kind: np.dtype[Any]) -> Any:
    return {"f": polars.Float64, "u": polars.UInt64}.get(kind.kind, polars.Int64)


def _filled(series: Any) -> Filled:
    if not series.null_count():
        return Filled(np.arange(len(series)), series.to_numpy())
    return Filled(np.flatnonzero(series.is_not_null().to_numpy()), series.drop_nulls().to_numpy())


def _is_exact(column: Filled) -> bool:
    """Whether no integer beyond 2**53 may have become a float."""
    values = column.values
    if values.dtype.kind != "f" or not len(values):
        return bool(len(values))  # an empty column has no type
    with np.errstate(invalid="ignore"):
        return not bool((np.abs(values[np.isfinite(values)]) >= 2**53).any())
