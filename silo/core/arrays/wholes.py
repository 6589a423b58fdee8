"""Integers of up to 64 bits, with a sign or without, computed to the last digit.

They are told by their bits, which are what they are modulo 2^64, as int64, and by a float64 that is nearly them.
Expressions and the arithmetic of signals compute both side by side; what 64 bits can't hold is the float64.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Bits = NDArray[np.int64]
Floats = NDArray[np.float64]

_HALF = 2.0**63


class Wholes(NamedTuple):
    """Integers of any shape: their bits, and where they are 2^63 or more; `known` is False where they are others."""

    bits: Bits
    high: NDArray[np.bool_]
    known: NDArray[np.bool_] | np.bool_ = np.True_


def wholes(values: NDArray[Any]) -> Wholes:
    """Return what an array of integers holds."""
    bits = values.astype(np.int64)
    return Wholes(bits, bits < 0 if values.dtype.kind == "u" else np.zeros(bits.shape, bool))


def told(bits: Bits, made: Floats | float) -> Wholes:
    """Return the integers that have these bits and are nearly `made`."""
    low, high = _within(bits, made), _within(bits.astype(np.uint64), made)
    return Wholes(bits, ~low & high, low | high)


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


def compared(function: Callable[[Any, Any], Any], one: Wholes, other: Wholes) -> NDArray[np.bool_]:
    """Return whether a comparison holds."""
    made: NDArray[np.bool_] = np.where(
        one.high == other.high, function(one.bits, other.bits), function(one.high, other.high)
    )
    return made


def stacked(parts: Sequence[Wholes]) -> Wholes:
    """Return several that meet as one, with an axis more."""
    return Wholes(*(np.stack(np.broadcast_arrays(*each), axis=-1) for each in zip(*parts, strict=True)))


def outermost(function: np.ufunc, of: Wholes) -> Bits:
    """Return the bits of the smallest (np.minimum) or largest (np.maximum) along the last axis, of those known."""
    ahead = (of.high if function is np.maximum else ~of.high) & of.known  # where there is one it is among these
    ahead |= of.known & ~ahead.any(axis=-1, keepdims=True)
    others = np.iinfo(np.int64).min if function is np.maximum else np.iinfo(np.int64).max
    made: Bits = function.reduce(np.where(ahead, of.bits, others), axis=-1)
    return made


def divided(over: Wholes, by: Wholes) -> tuple[tuple[Bits, Floats], tuple[Bits, Floats]]:
    """Return quotient and rest as Python has them: the rest has the sign of the divisor, which must not be 0."""
    (minus, size), (by_minus, by_size) = _sized(over), _sized(by)
    quotient, rest = np.divmod(size, by_size)
    beyond = (minus != by_minus) & (rest != 0)
    return _signed(minus != by_minus, quotient + beyond), _signed(by_minus, np.where(beyond, by_size - rest, rest))


def _sized(of: Wholes) -> tuple[NDArray[np.bool_], NDArray[np.uint64]]:
    """Where they are negative, and how large without their sign."""
    minus = (of.bits < 0) & ~of.high
    return minus, np.where(minus, -of.bits, of.bits).astype(np.uint64)


def _signed(minus: NDArray[np.bool_], size: NDArray[np.uint64]) -> tuple[Bits, Floats]:
    bits, made = size.astype(np.int64), size.astype(np.float64)
    return np.where(minus, -bits, bits), np.where(minus, -made, made)
