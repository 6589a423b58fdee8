"""Integers of up to 64 bits, with a sign or without, computed to the last digit.

They are told by their bits, which are what they are modulo 2^64, as int64, and by a float64 that is nearly them.
Expressions and the arithmetic of signals compute both side by side; what 64 bits can't hold is the float64.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Bits = NDArray[np.int64]
Floats = NDArray[np.float64]

_HALF = 2.0**63


def told(bits: Bits, made: Floats | float) -> tuple[Any, NDArray[np.bool_]]:
    """Return the integers that have these bits and are nearly `made`, as Python has them, and where they are known."""
    low, high = _within(bits, made), _within(bits.astype(np.uint64), made)
    more = np.where(~low & high, np.asarray(2**64, object), 0)
    return np.asarray(bits.astype(object) + more, object), low | high


def bits_of(numbers: Any) -> Bits:
    """Return the bits of integers of Python."""
    return np.asarray(numbers % 2**64, np.uint64).astype(np.int64)


def nearest(bits: Bits, made: Floats) -> Floats:
    """Return the float64s next to what has these bits and is nearly `made`, that itself where it isn't known."""
    unsigned = bits.astype(np.uint64)
    return np.where(_within(bits, made), bits, np.where(_within(unsigned, made), unsigned, made))


def fitting(bits: Bits, made: Floats) -> NDArray[Any]:
    """Return the whole numbers that have these bits and are nearly `made`: int64 or uint64, whichever holds all, else
    the float64s next to them. Where `made` is NaN they are any number.
    """
    if not (np.abs(bits - made) >= _HALF).any():
        return bits
    unsigned = bits.astype(np.uint64)
    return nearest(bits, made) if (np.abs(unsigned - made) >= _HALF).any() else unsigned


def _within(whole: NDArray[Any], made: Floats | float) -> NDArray[np.bool_]:
    return np.abs(whole - made) < _HALF
