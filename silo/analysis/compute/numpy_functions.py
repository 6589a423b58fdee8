"""NumPy's functions on signals: what keeps its meaning keeps its unit, what would lose it is refused in words.

`Signal.__array_ufunc__` and `Signal.__array_function__` come here. Reductions give plain numbers, as for arrays.
"""

import operator
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from silo.analysis.compute.arithmetic import combined, compared, exact, warn_outside, wholly, wide
from silo.analysis.compute.samples import Samples
from silo.core import units
from silo.core.arrays.function_units import PLAIN, UNIT_RULES
from silo.core.arrays.values import with_nan
from silo.errors import ElementError

One = TypeVar("One", bound=Samples)

# Python's own where there is one: it takes a root or a square for what it is, and masked arrays for theirs
_SIGNS: dict[np.ufunc, tuple[Callable[[Any, Any], Any], str]] = {
    np.add: (operator.add, "+"), np.subtract: (operator.sub, "-"), np.multiply: (operator.mul, "*"),
    np.true_divide: (operator.truediv, "/"), np.floor_divide: (operator.floordiv, "//"),
    np.remainder: (operator.mod, "%"), np.power: (operator.pow, "**"), np.float_power: (np.float_power, "**"),
    np.fmod: (np.fmod, "%"), np.maximum: (np.maximum, "max"), np.minimum: (np.minimum, "min"),
    np.fmax: (np.fmax, "max"), np.fmin: (np.fmin, "min"), np.hypot: (np.hypot, "hypot"),
    np.arctan2: (np.arctan2, "arctan2"),
}  # fmt: skip
_COMPARISONS = {
    np.less: (operator.lt, "<"), np.less_equal: (operator.le, "<="), np.greater: (operator.gt, ">"),
    np.greater_equal: (operator.ge, ">="), np.equal: (operator.eq, "=="), np.not_equal: (operator.ne, "!="),
}  # fmt: skip
_WORDS: dict[np.ufunc, str] = {np.negative: "-{}", np.absolute: "abs({})"}
# as what they are computed of whole numbers
_WHOLE: dict[np.ufunc, str] = {np.negative: "-", np.square: "*", np.absolute: "abs", np.positive: "abs"}
_POWERS = {np.sqrt, np.cbrt, np.reciprocal}
_TO_UNITS = {np.deg2rad, np.radians, np.rad2deg, np.degrees}
_LOGIC = {
    np.logical_and: "and", np.logical_or: "or", np.logical_xor: "xor", np.bitwise_and: "&", np.bitwise_or: "|",
    np.bitwise_xor: "^", np.left_shift: "<<", np.right_shift: ">>",
}  # fmt: skip
# of functions that are no ufuncs: those whose result is a signal of the same unit
_KEPT = {np.clip, np.round, np.around, np.nan_to_num, np.unwrap, np.real, np.imag, np.cumsum, np.copy}
# those that a signal has as methods: both mean the same
_STATISTICS = {np.max, np.amax, np.min, np.amin, np.mean, np.std, np.var, np.median}
_JOINING = {np.concatenate, np.append, np.hstack}  # of whatever stamps


def ufunc_of(signal: One, ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
    """Return what a ufunc makes of signals, numbers and arrays. Raises ElementError for what has no meaning."""
    if keywords.get("out") is not None:
        raise ElementError(
            f"np.{ufunc.__name__} can't write signals into an array (out=, or array += signal): write "
            "array = array + signal.values"
        )
    if method != "__call__" or set(keywords) - {"out", "dtype", "where"} or keywords.get("where", True) is not True:
        plain = [_plain(one) for one in inputs]
        _check_together(ufunc.__name__, inputs)
        return getattr(ufunc, method)(*plain, **keywords)
    dtype = keywords.get("dtype")
    if dtype is not None:
        return _as_type(ufunc_of(signal, ufunc, method, inputs, {}), ufunc, dtype)
    if len(inputs) == 1:
        return _unary(signal, ufunc)
    if len(inputs) != 2:
        raise _no_meaning(ufunc)
    swapped = not isinstance(inputs[0], Samples)
    one, other = (inputs[1], inputs[0]) if swapped else inputs
    if ufunc in _COMPARISONS:
        function, sign = _COMPARISONS[ufunc]
        return compared(one, other, function, sign, swapped)
    if ufunc in _LOGIC:
        return _logical(one, other, ufunc, _LOGIC[ufunc], swapped)
    if ufunc not in _SIGNS:
        raise _no_meaning(ufunc)
    made = combined(one, other, *_SIGNS[ufunc], swapped)
    return replace(made, unit=UNIT_RULES[ufunc].of(made.unit)) if ufunc in UNIT_RULES else made


def _as_type(made: Any, ufunc: np.ufunc, dtype: Any) -> Any:
    """A result in the type that was asked for. Raises ElementError where it is of another kind."""
    wanted = np.dtype(dtype)
    if not isinstance(made, Samples) or not np.can_cast(made.dtype, wanted, "same_kind"):
        raise ElementError(
            f"np.{ufunc.__name__} can't give {wanted}: the result is {getattr(made, 'dtype', 'no signal')}; leave "
            "dtype= out, and take .values.astype(...)"
        )
    return replace(made, values=made.values.astype(wanted))


def _logical(one: One, other: Any, function: Callable[[Any, Any], Any], sign: str, swapped: bool = False) -> One:
    """Return `&`, `|` and `^` of bools or whole numbers; units have no meaning then."""
    kinds = [np.asarray(each.values if isinstance(each, Samples) else each).dtype.kind for each in (one, other)]
    if not set(kinds) <= set("biu"):
        raise ElementError(
            f"'{one.name}' {sign} ... takes truths or whole numbers: write (a > 1) & (b < 2), with parentheses"
        )
    bare = [replace(each, unit="-") if isinstance(each, Samples) else each for each in (one, other)]
    truths = kinds == ["b", "b"]

    def apply(left: Any, right: Any) -> Any:
        if truths:
            return function(np.asarray(np.ma.filled(left, False), bool), np.asarray(np.ma.filled(right, False), bool))
        return function(left, right)

    made: One = combined(bare[0], bare[1], apply, sign, swapped)
    return made


def _unary(signal: One, ufunc: np.ufunc) -> One:
    name, rule, sign = ufunc.__name__, UNIT_RULES.get(ufunc, PLAIN), _WHOLE.get(ufunc)
    values = wide(signal) if sign is None else exact(signal)
    if ufunc is np.invert and signal.values.dtype.kind in "biu":
        values = signal.values
    elif ufunc not in UNIT_RULES:
        raise _no_meaning(ufunc)
    elif ufunc in _TO_UNITS:
        if signal.unit not in ("", "-") and not units.same(signal.unit, rule.takes):
            raise ElementError(f"np.{name} takes '{rule.takes}', but '{signal.name}' is in '{signal.unit}'")
    elif rule.takes:
        values = values * _plain_factor(signal, name)
    elif ufunc in _POWERS:
        values = values.astype(np.promote_types(values.dtype, np.float64))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        made = ufunc(values) if sign is None else wholly(ufunc, sign)(values)
    words = _WORDS.get(ufunc, f"{name}({{}})").format(signal.name)
    return replace(signal, name=words, values=made, unit=rule.of(signal.unit), labels={}, component_labels={})


def _plain_factor(signal: Samples, name: str) -> float:
    """By what values are multiplied to be plain numbers (radians, of angles)."""
    factor = 1.0 if signal.unit in ("", "-") else units.factor(signal.unit, "rad")
    if factor is None:
        raise ElementError(
            f"np.{name} takes numbers or angles, but '{signal.name}' is in '{signal.unit}'; divide it by a reference "
            "of that unit, or drop the unit by .with_unit('-')"
        )
    return factor


def _plain_angle(signal: Samples) -> None:
    if signal.unit not in ("", "-") and not units.same(signal.unit, "rad"):
        raise ElementError(
            f"np.unwrap takes radians, but '{signal.name}' is in '{signal.unit}'; write np.unwrap(signal.to('rad'))"
        )


def _no_meaning(ufunc: np.ufunc) -> ElementError:
    return ElementError(f"np.{ufunc.__name__} has no meaning for signals; for plain arrays write signal.values")


def function_of(function: Callable[..., Any], args: Any, keywords: dict[str, Any]) -> Any:
    """Return what another function of NumPy makes: plain arrays and numbers, or a signal where its samples stay.

    Raises ElementError where several signals differ in unit or stamps.
    """
    if function in _STATISTICS and len(args) == 1 and isinstance(args[0], Samples) and not keywords:
        return _statistic(args[0], function)
    signals = list(_signals([args, keywords]))
    _check_together(function.__name__, signals, stamps=function not in _JOINING)
    if function is np.unwrap and signals and "period" not in keywords:
        _plain_angle(signals[0])
    made = function(*_plain(args), **_plain(keywords))
    first = args[0] if args else None
    if function in _KEPT and isinstance(first, Samples) and np.shape(made) == first.values.shape:
        return replace(first, name=f"{function.__name__}({first.name})", values=made, labels={}, component_labels={})
    return made


def _statistic(signal: Samples, function: Callable[..., Any]) -> Any:
    """Return `signal.max()` for `np.max(signal)`: per component, of the samples that are there."""
    name = function.__name__.removeprefix("a")
    made = getattr(signal, name)()
    plain = function(_plain(signal))
    if np.shape(plain) != np.shape(made) or (np.isnan(plain) and not np.isnan(made)):
        warn_outside(
            f"np.{name} of '{signal.name}' is signal.{name}() now, per component and without NaN: write "
            f"np.{name}(signal.values) for the former"
        )
    return made


def _check_together(name: str, given: Any, stamps: bool = True) -> None:
    signals = list(_signals(given))
    for other in signals[1:]:
        one = signals[0]
        if not units.same(one.unit, other.unit) and "b" not in (one.dtype.kind, other.dtype.kind):
            raise ElementError(
                f"np.{name} of '{one.name}' and '{other.name}': the unit of one is '{one.unit}', of the other "
                f"'{other.unit}'; convert one by .to(...), or take .values"
            )
        if stamps and not np.array_equal(one.time_ns, other.time_ns):
            raise ElementError(
                f"np.{name} of '{one.name}' and '{other.name}': they have samples at different times; write "
                "other.resample(one) first"
            )


def _signals(given: Any) -> Iterator[Samples]:
    if isinstance(given, Samples):
        yield given
    elif isinstance(given, list | tuple):
        for one in given:
            yield from _signals(one)
    elif isinstance(given, dict):
        yield from _signals(list(given.values()))


def _plain(given: Any) -> Any:
    if isinstance(given, Samples):
        return with_nan(given.values)  # most functions of NumPy would take what stands under a mask
    if isinstance(given, list | tuple):
        return type(given)([_plain(one) for one in given])
    if isinstance(given, dict):
        return {key: _plain(one) for key, one in given.items()}
    return given
