"""Values as they travel in ROS messages, and back, bit for bit.

ROS has no float16 and its geometry messages no float32: such values travel in the next wider type. The processor turns
a signalling NaN into a quiet one when it widens; here the bits of NaNs are moved by hand, so that nothing changes.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_wire(values: NDArray[Any], wire: str, count: int = 1) -> NDArray[Any]:
    """Values of shape `(m,)` as `wire` (a NumPy type): shape `(m,)`, or `(m, count)` where one value takes several."""
    dtype, target = values.dtype, np.dtype(wire)
    if dtype.kind == "f" and target.kind == "f":
        return _resized(values, target) if dtype.itemsize < target.itemsize else values.astype(target, copy=False)
    if count == 1 and dtype.kind in "iu":
        return values
    # one run of memory in little-endian order: the bytes are the value
    plain = np.ascontiguousarray(values).astype(_little(dtype), copy=False)
    return plain.view(target) if count == 1 else plain.view(target).reshape(len(values), count)


def from_wire(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """The inverse of `to_wire`: shape `(m,)` or `(m, count)` to shape `(m,)` of `dtype`."""
    if dtype.kind == "f" and values.dtype.kind == "f":
        return _resized(values, dtype) if dtype.itemsize < values.dtype.itemsize else values.astype(dtype, copy=False)
    if values.ndim == 1 and dtype.kind in "iu":
        return values.astype(dtype, copy=False)
    plain = np.ascontiguousarray(values).view(_little(dtype)).reshape(len(values))
    return plain.astype(dtype, copy=False)


def _little(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return dtype.newbyteorder("<") if dtype.byteorder == ">" else dtype


def _resized(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Floating-point values in another width."""
    little = values.astype(_little(values.dtype), copy=False)
    with np.errstate(invalid="ignore"):
        made = little.astype(_little(dtype))
    nan = np.flatnonzero(np.isnan(little))
    if len(nan):
        bits, into = _bits(little.dtype), _bits(made.dtype)
        raw = np.ascontiguousarray(little[nan]).view(bits.unsigned).astype(np.uint64)
        sign = (raw >> (bits.size - 1)) << (into.size - 1)
        fraction, more = raw & ((1 << bits.fraction) - 1), into.fraction - bits.fraction
        fraction = fraction << more if more > 0 else fraction >> -more
        made.view(into.unsigned)[nan] = (sign | into.infinity | fraction).astype(into.unsigned)
    return made.astype(dtype, copy=False)


class _bits:  # noqa: N801 - reads as a function: the layout of a floating-point type
    """Sizes in bits of a floating-point type, and infinity's bit pattern."""

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self.size = 8 * dtype.itemsize
        self.fraction = {16: 10, 32: 23, 64: 52}[self.size]
        self.unsigned = np.dtype(f"<u{dtype.itemsize}")
        self.infinity = self.unsigned.type(((1 << (self.size - 1 - self.fraction)) - 1) << self.fraction)
