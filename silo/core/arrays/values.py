"""One rule for logged values of every type: as numbers that a curve can show, and as text.

| values | as numbers | as text, where a float64 can't tell them |
| --- | --- | --- |
| bool, enumerations, integers | exact, see `Numbers` | digits from 2^53 on |
| float | as they are | |
| datetime, timedelta | as they count, exact; NaT is a NaN | ISO 8601, `NaT` |
| complex | real part | `1+2j` |
| strings, bytes | a NaN | UTF-8, other bytes as `\\xff` |
| missing (masked) | a NaN | empty |

Live values, files, charts and the shell commands use it alike; it knows none of them.
"""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

# integers up to here are exact as float64
EXACT = 2**53

Floats = NDArray[np.float64]


def is_without_unit(dtype: np.dtype[Any]) -> bool:
    """Whether values are times of which nobody knows what they count: `datetime64` alone."""
    return dtype.kind in "mM" and np.datetime_data(dtype)[0] == "generic"


class Numbers(msgspec.Struct, frozen=True):
    """Values as float64, shape `(n,)`: value i is `base + offsets[i]`.

    `base` is 0 unless there are integers beyond 2^52 that span no more than that: then it is the multiple of 2^53 next
    to them, so that they are exact.
    """

    offsets: Floats
    base: int = 0


def with_nan(values: NDArray[Any]) -> NDArray[Any]:
    """Return masked values as float64 with NaN where they are missing, of any shape; all others as they are."""
    if not isinstance(values, np.ma.MaskedArray):
        return values
    made: NDArray[Any] = np.ma.filled(values.astype(np.float64 if values.dtype.kind in "biu" else values.dtype), np.nan)
    return made


def missing_in(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where values are missing, of their shape; only what has no NaN and no NaT says so by a mask."""
    return np.ma.getmaskarray(values)


def numbers(values: NDArray[Any]) -> Numbers:
    """Return any values as numbers; what is no number is NaN. The table at the top of the module is the rule."""
    if isinstance(values, np.ma.MaskedArray):
        there = ~missing_in(values)
        known = numbers(np.asarray(values.data)[there])
        offsets = np.full(len(values), np.nan)
        offsets[there] = known.offsets
        return Numbers(offsets, known.base)
    kind = values.dtype.kind
    if kind in "Mm":
        missing = np.isnat(values)
        counted = numbers(np.where(missing, 0, values.astype(np.int64)))
        if not missing.any():
            return counted
        # the base belongs to the moments that there are
        known = numbers(values[~missing].astype(np.int64))
        offsets = np.full(len(values), np.nan)
        offsets[~missing] = known.offsets
        return Numbers(offsets, known.base)
    if kind in "iu" and values.dtype.itemsize == 8 and len(values):
        smallest, largest = int(values.min()), int(values.max())
        # of what spans more no base keeps all digits
        if max(-smallest, largest) > EXACT // 2 and largest - smallest <= EXACT // 2:
            middle = (smallest + largest) // 2
            # 2^64 itself is no integer of 64 bits, and could not travel
            base = min((middle + EXACT // 2) // EXACT * EXACT, 2**64 - EXACT)
            return Numbers(_distances(values, base), base)
    if kind == "c":
        values = values.real
    elif kind not in "biuf":
        return Numbers(np.full(len(values), np.nan))
    with np.errstate(over="ignore", invalid="ignore"):
        return Numbers(values.astype(np.float64))


def as_floats(column: NDArray[Any]) -> Floats:
    """Return any values as the nearest float64, shape `(n,)`; what is no number becomes NaN."""
    found = numbers(column)
    return found.offsets + found.base if found.base else found.offsets


def as_exact(column: NDArray[Any]) -> NDArray[Any]:
    """Return integers as int64, those that need the 64th bit as uint64, shape `(n,)`, other values as the nearest
    float64.
    """
    if column.dtype.kind not in "iu" or np.ma.is_masked(column):
        return as_floats(column)
    if column.dtype.kind == "u" and column.dtype.itemsize == 8 and len(column) and int(column.max()) >= 2**63:
        return np.asarray(column)
    return np.asarray(column, np.int64)


def difference(first: NDArray[Any], second: NDArray[Any]) -> Floats:
    """Return `second - first` as float64, of integers to the last digit; NaN where one of them is no number."""
    made = as_floats(second) - as_floats(first)
    if any(each.dtype.kind not in "iu" or np.ma.is_masked(each) for each in (first, second)):
        return made
    with np.errstate(over="ignore"):  # modulo 2^64 it is right where it fits
        steps = np.asarray(second).astype(np.int64) - np.asarray(first).astype(np.int64)
    return np.where(np.abs(made) < 2.0**62, steps, made)


def from_base(values: NDArray[Any]) -> NDArray[Any]:
    """Return large integers less what they have in common, per component; all else as it is, NaN where it is missing.

    What doesn't depend on where zero is (a deviation, a slope) is exact then. `values` has shape `(n,)` or `(n, ...)`.
    """
    if values.dtype.kind not in "iu" or values.dtype.itemsize < 8 or not len(values):
        return with_nan(values)
    columns = values.reshape(len(values), -1)
    return np.stack([numbers(column).offsets for column in columns.T], axis=1).reshape(values.shape)


def _distances(values: NDArray[Any], base: int) -> Floats:
    """How far 64-bit integers lie from a base: modulo 2^64 there is no overflow, exact up to 2^53."""
    words = np.ascontiguousarray(values).view(np.uint64)
    zero = np.uint64(base % 2**64)
    above = values >= base if np.iinfo(values.dtype).min <= base <= np.iinfo(values.dtype).max else base < 0
    distances: Floats = np.where(above, (words - zero).astype(np.float64), -(zero - words).astype(np.float64))
    return distances


def rebased(offsets: Floats, old: int, new: int) -> Floats:
    """Return offsets from another base."""
    return offsets + float(old - new) if old != new else offsets


def newest_values(column: NDArray[Any]) -> tuple[Floats, dict[int, str]]:
    """Return values as the nearest float64, and by index the text of those that a float64 can't tell."""
    kind, size = column.dtype.kind, column.dtype.itemsize
    if kind in "biuf":
        floats = as_floats(column)
        if kind in "bf" or size < 8:
            return floats, {}
        return floats, {int(at): str(int(column[at])) for at in np.flatnonzero(np.abs(floats) >= EXACT)}
    return as_floats(column), {at: text_of(value) for at, value in enumerate(column)}


def text_of(value: Any) -> str:
    """Return one value of a column as text, everywhere the same: bytes that are no UTF-8 as escapes."""
    if value is None or value is np.ma.masked:
        return ""
    if isinstance(value, bytes):
        return value.rstrip(b"\0").decode("utf-8", "backslashreplace")
    if isinstance(value, np.timedelta64):
        return "NaT" if np.isnat(value) else str(int(value.astype(np.int64)))
    if isinstance(value, complex | np.complexfloating):
        return f"{value.real:.6g}{value.imag:+.6g}j"
    return str(value)
