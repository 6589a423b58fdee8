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
        bits, into = np.finfo(little.dtype), np.finfo(made.dtype)
        raw = np.ascontiguousarray(little[nan]).view(f"<u{little.itemsize}").astype(np.uint64)
        sign = (raw >> (bits.bits - 1)) << (into.bits - 1)
        fraction, more = raw & ((1 << bits.nmant) - 1), into.nmant - bits.nmant
        fraction = fraction << more if more > 0 else fraction >> -more
        infinity = ((1 << into.nexp) - 1) << into.nmant
        made.view(f"<u{made.itemsize}")[nan] = sign | infinity | fraction
    return made.astype(dtype, copy=False)
