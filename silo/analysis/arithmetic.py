"""Arithmetic between signals: types that don't wrap around, common stamps, shapes that meet, units.

`silo.analysis.signals` calls it for its operators, `silo.analysis.frames` for the stamps of vectors and orientations.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.analysis.samples import Samples
from silo.analysis.units import quotient, unit_of
from silo.errors import ElementError

One = TypeVar("One", bound=Samples)
Other = TypeVar("Other", bound=Samples)


def combined(
    one: One,
    other: One | float | NDArray[Any],
    function: Callable[[Any, Any], Any],
    sign: str,
    swapped: bool = False,
) -> One:
    """What a function of two makes of a signal and another, a number or an array; `swapped` puts the other first."""
    base, unit, shown = one, one.unit, str(other)
    mine: NDArray[Any] = wide(one)
    theirs: Any = other
    if isinstance(other, Samples):
        base, right = aligned(one, other)
        mine, theirs, shown = wide(base), wide(right), other.name
        mine, theirs = _broadcast(mine, theirs)
        _check_shapes(one, other, mine, theirs, sign)
        unit = unit_of(one.unit, other.unit, sign)
    elif sign == "/" and swapped:
        unit = quotient("-", one.unit)
    elif sign == "**":
        unit = "-" if one.unit == "-" else f"{one.unit}^{shown}"
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values = function(theirs, mine) if swapped else function(mine, theirs)
    name = f"({shown} {sign} {one.name})" if swapped else f"({one.name} {sign} {shown})"
    made = one if values.ndim == one.values.ndim or not isinstance(other, Samples) else other
    return replace(made, name=name, values=values, time_ns=base.time_ns, divider=base.divider, unit=unit, labels={})


def wide(signal: Samples) -> NDArray[Any]:
    """The values in a type that doesn't wrap around: small integers and bools as int64."""
    values = signal.numbers("calculate with")
    if values.dtype.kind == "u" and values.dtype.itemsize == 8:
        return values.astype(np.float64)
    return values.astype(np.int64) if values.dtype.kind in "iu" else values


def aligned(one: One, other: Other) -> tuple[One, Other]:
    """Return both at the stamps of the faster one; stamps at which the other has no value yet are left out."""
    if np.array_equal(one.time_ns, other.time_ns):
        return one, other
    fast: Samples = one if _step(one) <= _step(other) else other
    slow: Samples = other if fast is one else one
    time_ns = fast.time_ns[slow.places(fast.time_ns) >= 0]
    return replace(one.held(time_ns), divider=fast.divider), replace(other.held(time_ns), divider=fast.divider)


def _step(signal: Samples) -> float:
    return float(np.median(np.diff(signal.time_ns))) if len(signal) > 1 else float("inf")


def _check_shapes(one: Samples, other: Samples, mine: NDArray[Any], theirs: NDArray[Any], sign: str) -> None:
    try:
        np.broadcast_shapes(mine.shape, theirs.shape)
    except ValueError as error:
        raise ElementError(
            f"can't calculate '{one.name}' {sign} '{other.name}': one sample has shape {one.values.shape[1:]} and "
            f"{other.values.shape[1:]}; take signals of one shape, a scalar, or a component"
        ) from error


def _broadcast(one: NDArray[Any], other: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """A scalar signal meets each component of a vector or matrix."""
    dimensions = max(one.ndim, other.ndim)
    return (
        one.reshape(one.shape + (1,) * (dimensions - one.ndim)),
        other.reshape(other.shape + (1,) * (dimensions - other.ndim)),
    )
