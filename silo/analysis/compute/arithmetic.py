"""Arithmetic between signals: types that don't wrap around, common stamps, shapes that meet, units.

`silo.analysis.compute.numpy_functions` calls it, `silo.analysis.compute.frames` for stamps of vectors and orientations.
"""

import functools
import math
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples, UntoldError, in_order, risen_pair
from silo.core import units
from silo.core.arguments import shown
from silo.core.arrays.enumerations import to_compare
from silo.core.arrays.values import missing_in
from silo.core.recording import falls
from silo.errors import ElementError, LogWarning

UNTOLD = (
    "the clock of their log stepped back, and they have no samples at its ticks any more: they meet by their times, "
    "maybe those of several episodes; take them of log.clip(episode), or write log.eval('...')"
)

One = TypeVar("One", bound=Samples)
Other = TypeVar("Other", bound=Samples)


def combined(
    one: One, other: One | float | NDArray[Any], function: Callable[[Any, Any], Any], sign: str, swapped: bool = False
) -> One:
    """Return what a function makes of a signal and another, a number or an array; `swapped` puts the other first."""
    if not isinstance(other, Samples):
        _warn_of_turn(one, other, sign)
    values, made, name = _both(one, other, wholly(function, sign), sign, swapped, exact, "calculate")
    return replace(
        made, name=name, values=values, unit=_unit(one, other, sign, swapped), labels={}, component_labels={}
    )


def compared(
    one: One,
    other: One | float | str | NDArray[Any],
    function: Callable[[Any, Any], Any],
    sign: str,
    swapped: bool = False,
) -> One:
    """Return where a comparison holds: bools at the stamps of both. Labels and texts are compared as texts, of two
    signals where their labels have other numbers.

    Raises `ElementError` for units that don't go together, and for what can't be compared.
    """
    if isinstance(other, str | bytes) or one.values.dtype.kind in "SU":
        return _texts_compared(one, other, function, sign)
    numbers = _words_numbered(one, other) if isinstance(other, Samples) and sign in ("==", "!=") else None
    numbers = numbers or (lambda signal: signal._numbers("compare"))
    values, made, name = _both(one, other, _to_the_last_digit(function), sign, swapped, numbers, "compare")
    truths = np.asarray(np.ma.filled(values, sign == "!="), bool)  # what is missing is, as a NaN, only unequal
    return replace(made, name=name, values=truths, unit="-", labels={}, component_labels={})


def _to_the_last_digit(function: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return what compares integers of which one has no sign as they are: NumPy before 2 makes both floats."""

    def holds(one: Any, other: Any) -> Any:
        sides = np.asanyarray(one), np.asanyarray(other)
        mixed = {(side.dtype.kind, side.dtype.itemsize) for side in sides} == {("i", 8), ("u", 8)}
        return function(*(side.astype(object) for side in sides)) if mixed else function(one, other)

    return holds


def _words_numbered(one: Samples, other: Samples) -> Callable[[Samples], NDArray[Any]] | None:
    """Return what gives each word of two enumerations a number, that of both; None where theirs are no others."""
    words = to_compare(one.labels, other.labels)
    if words[0] == words[1]:
        return None
    known: dict[str, int] = {}

    def numbers(signal: Samples) -> NDArray[Any]:
        texts = replace(signal, labels=words[0] if signal.labels == one.labels else words[1]).texts
        names, places = np.unique(texts, return_inverse=True)
        made = np.array([known.setdefault(str(name), len(known)) for name in names])[places.reshape(texts.shape)]
        missing = missing_in(signal.values)
        return np.ma.array(made, mask=missing) if missing.any() else made

    return numbers


def _both(
    one: One,
    other: One | float | NDArray[Any],
    function: Callable[[Any, Any], Any],
    sign: str,
    swapped: bool,
    numbers: Callable[[Samples], NDArray[Any]],
    verb: str,
) -> tuple[NDArray[Any], One, str]:
    """What a function makes of two values at common stamps, the signal whose kind it has, and its name."""
    base, theirs, words = one, other, other.name if isinstance(other, Samples) else _words(other)
    if isinstance(other, Samples):
        _unit(one, other, sign, swapped)
        base, right = together(one, other, f"{verb} '{one.name}' {sign} '{words}'")
        mine, theirs = _broadcast(numbers(base), numbers(right))
        _check_shapes(one, other, mine, theirs, sign)
    else:
        _check_operand(one, other, sign)
        mine = numbers(one)
        if isinstance(theirs, np.uint64) and theirs < 2**63:  # beside int64 NumPy would make both floats
            theirs = np.int64(theirs)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values = function(theirs, mine) if swapped else function(mine, theirs)
    made = one if values.ndim == one.values.ndim or not isinstance(other, Samples) else other
    made = replace(made, time_ns=base.time_ns, start_ns=base.start_ns, divider=base.divider, _at=base._at)
    return values, made, f"({words} {sign} {one.name})" if swapped else f"({one.name} {sign} {words})"


def _texts_compared(one: One, other: object, function: Callable[[Any, Any], Any], sign: str) -> One:
    asked = other.decode("utf-8", "replace") if isinstance(other, bytes) else other
    if sign not in ("==", "!=") or not isinstance(asked, str):
        raise ElementError(
            f"can't compare '{one.name}' {sign} {shown(other)}: texts and labels are compared by == and != to a text"
        )
    if one.values.dtype.kind not in "SU":
        if not one.labels:
            raise ElementError(
                f"can't compare '{one.name}' {sign} {shown(other)}: its values are numbers without names"
            )
        if asked not in one.labels.values():
            raise ElementError(f"'{one.name}' has no value {asked!r}; it has: {', '.join(one.labels.values())}")
    values = function(one.texts, asked)
    return replace(
        one,
        name=f"({one.name} {sign} {asked!r})",
        values=np.asarray(values, bool),
        unit="-",
        labels={},
        component_labels={},
    )


def _words(other: object) -> str:
    return "array" if isinstance(other, np.ndarray) and other.size > 1 else str(other)


def wide(signal: Samples) -> NDArray[Any]:
    """Return the values in a type that doesn't wrap around: small integers and bools as int64."""
    values = signal._numbers("calculate with")
    if values.dtype.kind == "u" and values.dtype.itemsize == 8:
        return values.astype(np.float64)
    return values.astype(np.int64) if values.dtype.kind in "iu" else values


def exact(signal: Samples) -> NDArray[Any]:
    """The same for what can be computed of whole numbers without a sign to the last digit: they stay as they are."""
    values = signal._numbers("calculate with")
    return values if _is_unsigned(values) and not np.ma.is_masked(values) else wide(signal)


def _is_unsigned(values: NDArray[Any]) -> bool:
    return values.dtype.kind == "u" and values.dtype.itemsize == 8


def wholly(function: Callable[..., Any], sign: str) -> Callable[..., Any]:
    """Return what computes of whole numbers whole ones where 64 bits hold the result, with a sign or without, and else
    float64; uint64 beside other numbers is float64, too.
    """

    def made(*given: Any) -> Any:
        sides = [side if np.ma.isMaskedArray(side) else np.asarray(side) for side in given]
        signed = not any(map(_is_unsigned, sides))
        if not all(side.dtype.kind in "iu" for side in sides) or function in _OF_FLOATS:
            return function(*(given if signed else _floats(sides)))
        if signed and sign in _WITHIN:
            return function(*sides)
        floats = _floats(sides)
        if sign in _SHIFTS:
            nearly = np.floor(floats[0] * 2.0 ** (floats[1] * _SHIFTS[sign]))
        else:
            nearly = np.zeros(()) if sign in _WITHIN[2:] else function(*floats)
        within = signed or all((np.abs(side) < 2.0**63).all() for side in floats)
        if sign == "**" and (sides[1] < 0).any():
            return nearly
        if within and (np.abs(nearly) < 2.0**62).all():  # nothing wraps around
            return function(*(side.astype(np.int64) for side in sides))
        return _by_python(_fmod if function is np.fmod else function, sign, sides, nearly)

    return made


_OF_FLOATS = (np.float_power, np.hypot, np.arctan2)
_SHIFTS = {"<<": 1, ">>": -1}
_WITHIN = ("max", "min", "&", "|", "^")  # the result is no larger than what it is made of; floats have no bits
_fmod = np.frompyfunc(lambda one, other: abs(one) % abs(other) * (1 if one >= 0 else -1), 2, 1)


def _by_python(function: Callable[..., Any], sign: str, sides: Sequence[NDArray[Any]], nearly: NDArray[Any]) -> Any:
    """Return what Python, whose integers are as long as they have to be, makes of some: int64 or uint64, whichever
    holds all, else the float64s next to them. What is `nearly` infinite, or no number, stays that.
    """
    mask = functools.reduce(np.logical_or, map(np.ma.getmaskarray, sides))
    data = np.broadcast_arrays(*map(np.ma.getdata, sides))
    found = np.where(mask, 0.0, np.ma.getdata(nearly)).astype(object)
    exact = ~mask & (np.abs(np.ma.getdata(nearly)) < 2.0**65) & ((sign not in _SHIFTS) | (data[-1] >= 0))
    found[exact] = function(*(side[exact].astype(object) for side in data))
    found[mask] = 0
    numbers = found.ravel().tolist()
    low, high = (one(numbers, default=0) for one in (min, max))
    kinds: tuple[Any, ...] = (np.int64, np.uint64) if all(isinstance(one, int) for one in numbers) else ()
    fits = (kind for kind in kinds if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max)
    made: NDArray[Any] = found.astype(next(fits, np.float64))
    return np.ma.array(made, mask=mask) if any(map(np.ma.isMaskedArray, sides)) else made


def _floats(sides: Sequence[NDArray[Any]]) -> list[NDArray[np.float64]]:
    return [side.astype(np.float64) for side in sides]


def aligned(one: One, other: Other, what: str, two_clocks: bool = False) -> tuple[One, Other]:
    """Return both at the ticks that their rates have in common, as far as both go: the time that both have.

    Of every second tick and every fourth that is the faster one's, of every second and third each tick; of two logs, or
    of what has stamps of its own, the stamps of the faster one.
    A value holds until the next would come: from a slow signal's first sample to one step behind its last; a single
    sample, as of a map, holds on. What goes on longer is asked for by `resample`. The other one of another log is moved
    to the start of `one`; there, and of `two_clocks`, samples of one rate within half a step are of one tick, as no
    clock repeats itself to the nanosecond. Raises `ElementError`, which says what can't be done, where they have no
    time in common.
    """
    other = in_order(other, one.components)
    if not np.array_equal(one.time_ns, other.time_ns) and (found := _by_ticks(one, other, what)):
        return found
    met = other._met(one)
    other, two_clocks = met, two_clocks or met.time_ns is not other.time_ns
    if np.array_equal(one.time_ns, other.time_ns):
        return one, other
    one._check_overlap(other, what)
    fast: Samples = one if one._step_ns <= other._step_ns else other
    slow: Samples = other if fast is one else one
    half = fast._step_ns / 2 if len(fast) > 1 else 0.0
    one_rate = two_clocks and slow._step_ns < 1.5 * fast._step_ns
    time_ns = None if two_clocks else _common_ticks(one, other)
    if time_ns is not None and len(time_ns):
        divider = math.gcd(one.divider, other.divider)
        return replace(one._held(time_ns), divider=divider), replace(other._held(time_ns), divider=divider)
    places = slow._places(fast.time_ns + int(half) if one_rate else fast.time_ns)
    inside = (places >= 0) & (slow._holding(fast.time_ns, half) | (fast.time_ns < slow._bounds[0]))
    if not inside.any():
        raise one._nothing_in_common(other, what)
    time_ns, places = fast.time_ns[inside], places[inside]
    made = {id(fast): fast.values[inside], id(slow): slow.values[places]}
    return (
        replace(one, values=made[id(one)], time_ns=time_ns, divider=fast.divider),
        replace(other, values=made[id(other)], time_ns=time_ns, divider=fast.divider),
    )


def _by_ticks(one: One, other: Other, what: str) -> tuple[One, Other] | None:
    """Return both as `aligned` does by ticks, of logs whose clocks stepped back or stood still; None of others."""
    try:
        pair = risen_pair(one, other)
    except UntoldError:
        warn_outside(f"{what}: {UNTOLD}")
        return None
    if pair is None:
        return None
    left, right = aligned(pair.one, pair.other, what, two_clocks=pair.two_logs)
    fold = pair.folds[0]
    if fold is None:
        return left, right
    left = fold.folded(left)
    return left, replace(right, time_ns=left.time_ns, axis_ns=left.axis_ns, _at=left._at)


def _common_ticks(one: Samples, other: Samples) -> NDArray[np.int64] | None:
    """Return the stamps of the ticks that two rates of one log have in common, where both hold, by their ticks.

    None where the faster one has them, and for what isn't of one log.
    """
    axis, divider = one.axis_ns, math.gcd(one.divider, other.divider)
    if axis is None or axis is not other.axis_ns or divider in (one.divider, other.divider):
        return None
    if one._falls or other._falls or falls(axis):
        return None
    places = [int(np.searchsorted(axis, each.time_ns[0])) for each in (one, other)]
    for place, each in zip(places, (one, other), strict=True):
        if not np.array_equal(axis[place :: each.divider][: len(each)], each.time_ns):
            return None  # what was made of it has other stamps
    end = min(place + each.divider * len(each) for place, each in zip(places, (one, other), strict=True))
    return axis[max(places) : end : divider]


def common_words(one: Samples, other: Samples, common: Samples) -> str:
    """Return from when to when two signals are taken together, and both spans; "" where nothing is left out.

    A step of the slower one is no loss: so much its phase may differ. `common` is what `aligned` gave for `one`.
    """
    moved = other._met(one)
    if not len(common) or common.time_ns is one.time_ns:
        return ""
    if (one._falls or moved._falls) and len(common) >= max(len(one), len(moved)):
        return ""  # by ticks, all of them
    several = [each for each in (one, moved) if len(each) > 1]  # a single one holds on
    step = max((each._step_ns for each in several), default=0.0)
    begin, end = common._bounds
    if all(begin - each._bounds[0] <= step and each._bounds[1] - end <= step for each in several):
        return ""
    return f"{common._seconds_of(begin):g} to {common._seconds_of(end):g} s"


def together(one: One, other: Other, what: str) -> tuple[One, Other]:
    """Return both as `aligned` does, and warn where one of them goes on without the other, with both spans."""
    mine, theirs = aligned(one, other, what)
    span = common_words(one, other, mine)
    if span:
        shorter = other if len(one) and one._seconds_of(one._bounds[1]) > other._seconds_of(other._bounds[1]) else one
        warn_outside(
            f"{what}: only from {span}, the time that both have; '{one.name}' {one._span}, '{other.name}' "
            f"{other._span}. To hold the last value of '{shorter.name}' beyond its end, write .resample(...) of it"
        )
    return mine, theirs


def in_common(one: One, other: Other) -> tuple[One, Other, str]:
    """Return both at the stamps that they have in common, and words on both spans where one goes on longer.

    Raises `ElementError` where there is no time in common.
    """
    mine, theirs = aligned(one, other, "compare them", two_clocks=True)
    span = common_words(one, other, mine)
    other = other._met(one)
    return mine, theirs, span and f"compared from {span}: the first {one._span}, the second {other._span}"


def warn_outside(words: str) -> None:
    """Warn at the line of the program that calls silo, not in silo, nor in NumPy's operators, which call it."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(("silo.", "numpy.lib.mixins")):
        frame, level = frame.f_back, level + 1
    warnings.warn(words, LogWarning, stacklevel=level)


def _unit(one: Samples, other: Samples | float | NDArray[Any], sign: str, swapped: bool) -> str:
    """Return the unit of what is calculated. Raises `ElementError` where units don't go together."""
    if sign == "**":
        return _exponent_unit(one) if swapped and not isinstance(other, Samples) else _power_unit(one, other)
    if sign in ("*", "/", "//"):
        theirs = other.unit if isinstance(other, Samples) else "-"
        left, right = (theirs, one.unit) if swapped else (one.unit, theirs)
        return units.product(left, right) if sign == "*" else units.quotient(left, right)
    if not isinstance(other, Samples) or other.unit in ("", "-"):
        return one.unit
    if one.unit in ("", "-"):
        return other.unit
    if units.same(one.unit, other.unit):
        return one.unit
    convert = units.factor(other.unit, one.unit) is not None
    way_out = f"convert that one by .to('{one.unit}')" if convert else "drop a unit by .with_unit('-')"
    raise ElementError(
        f"can't calculate '{one.name}' {sign} '{other.name}': the unit of one is '{one.unit}', of the other "
        f"'{other.unit}'; {way_out}"
    )


def _power_unit(base: Samples, exponent: Samples | float | NDArray[Any]) -> str:
    if isinstance(exponent, Samples):
        _exponent_unit(exponent)
    if base.unit in ("", "-"):
        return base.unit
    if isinstance(exponent, float | int | np.number) and np.isfinite(exponent) and np.isreal(exponent):
        return units.power(base.unit, float(exponent.real))
    raise ElementError(
        f"'{base.name}' has the unit '{base.unit}', so its exponent must be one finite number, the same for all "
        "samples; or drop the unit by .with_unit('-')"
    )


def _exponent_unit(exponent: Samples) -> str:
    if exponent.unit not in ("", "-"):
        raise ElementError(
            f"'{exponent.name}' can't be an exponent: it has the unit '{exponent.unit}'; drop it by .with_unit('-')"
        )
    return "-"


def _warn_of_turn(signal: Samples, number: object, sign: str) -> None:
    """Warn of `q * 180 / np.pi`: numbers have no unit, so what is in degrees then would stay in `rad`."""
    if sign not in ("*", "/") or not isinstance(number, float | np.floating) or signal.unit not in ("rad", "deg", "°"):
        return
    if any(math.isclose(number, turn, rel_tol=1e-4) for turn in (math.pi, math.pi / 180, 180 / math.pi)):
        to = "deg" if signal.unit == "rad" else "rad"
        warn_outside(
            f"'{signal.name}' {sign} {number:.6g} stays in '{signal.unit}', as a number has no unit: to convert write "
            f".to('{to}'), or say what it is in by .with_unit(...) first; the next release will refuse it"
        )


def _check_shapes(one: Samples, other: Samples, mine: NDArray[Any], theirs: NDArray[Any], sign: str) -> None:
    try:
        np.broadcast_shapes(mine.shape, theirs.shape)
    except ValueError as error:
        raise ElementError(
            f"can't calculate '{one.name}' {sign} '{other.name}': one sample has shape {one.values.shape[1:]} and "
            f"{other.values.shape[1:]}; take signals of one shape, a scalar, or a component"
        ) from error


def _check_operand(one: Samples, other: object, sign: str) -> None:
    """Raise `ElementError` for what is no number, nor an array of numbers that meets the values."""
    try:
        found = np.asarray(other)
    except (TypeError, ValueError) as error:
        raise ElementError(f"can't calculate '{one.name}' {sign} {shown(other)}: {error}") from None
    if found.dtype.kind not in "biufc":
        raise ElementError(
            f"can't calculate '{one.name}' {sign} {shown(other)} ({type(other).__name__}): take a signal, a number of "
            "at most 64 bits, or an array of numbers"
        )
    try:
        fits = np.broadcast_shapes(one.values.shape, found.shape) == one.values.shape
    except ValueError:
        fits = False
    if not fits:
        raise ElementError(
            f"can't calculate '{one.name}' {sign} an array of shape {found.shape}: the values have shape "
            f"{one.values.shape}; take a number, or an array of one sample or of all"
        )


def _broadcast(one: NDArray[Any], other: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return both with as many axes: a scalar signal meets each component of a vector or matrix."""
    dimensions = max(one.ndim, other.ndim)
    return (
        one.reshape(one.shape + (1,) * (dimensions - one.ndim)),
        other.reshape(other.shape + (1,) * (dimensions - other.ndim)),
    )
