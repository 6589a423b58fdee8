"""Functions and operations of expressions on whole arrays: numbers, and truths that may be unknown.

Truths follow Kleene: what is known decides where it can (`false and unknown` is false), else the result is unknown. A
NaN is unknown where it is compared.
"""

import functools
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from silo.core.arrays.function_units import KEPT, PER_SECOND, PLAIN, UNIT_RULES, UnitRule
from silo.core.arrays.wholes import Bits, bits_of, told


@dataclass(frozen=True)
class Truth:
    """Truths of any shape; where `unknown` (None: nowhere) they are neither true nor false, and `true` is False."""

    true: Any
    unknown: Any = None


Value = Truth | Any  # else float64, or a float


def raw(value: Value) -> Any:
    """Return numbers or truths as an array."""
    return np.asarray(value.true if isinstance(value, Truth) else value)


def columned(value: Value) -> Value:
    """Return a value per tick as a column beside vectors."""
    if isinstance(value, Truth):
        unknown = value.unknown
        return Truth(columned(value.true), None if unknown is None else columned(unknown))
    return value[:, None] if isinstance(value, np.ndarray) and value.ndim == 1 else value


def spread(value: Value, count: int) -> Value:
    """Return a value as an array with one row per tick."""
    if isinstance(value, Truth):
        true = np.broadcast_to(value.true, (count,)) if np.ndim(value.true) == 0 else value.true
        unknown = value.unknown
        if unknown is not None and np.shape(unknown) != true.shape:
            unknown = np.broadcast_to(unknown, true.shape)
        return Truth(true, unknown)
    return np.full(count, value) if np.ndim(value) == 0 else value


def as_numbers(value: Value) -> Any:
    """Return a value as float64; a truth is 1 or 0, NaN where it is unknown."""
    if not isinstance(value, Truth):
        return value
    numbers = np.asarray(value.true, np.float64)
    return numbers if value.unknown is None else np.where(value.unknown, np.nan, numbers)


def as_truth(value: Value) -> Truth:
    """Return a value as truths: what isn't 0 is true, of a NaN nobody can tell."""
    if isinstance(value, Truth):
        return value
    unknown = _nan_in(value)
    true = np.not_equal(value, 0.0)
    return Truth(true, None) if unknown is None else Truth(true & ~unknown, unknown)


def _nan_in(value: Any) -> Any:
    """Where there is a NaN, None if nowhere."""
    if isinstance(value, float):  # of constants alone, as in 0 / 0
        return np.True_ if math.isnan(value) else None
    found = np.isnan(value)
    return found if found.any() else None


def _either(one: Any, other: Any) -> Any:
    if one is None or other is None:
        return other if one is None else one
    return one | other


def _together(values: list[Value], true_of: Callable[[list[Any]], Any], false_of: Callable[[list[Any]], Any]) -> Truth:
    """What is true of several, and what is false of them; where neither is, it is unknown."""
    truths = [as_truth(value) for value in values]
    true = true_of([truth.true for truth in truths])
    if all(truth.unknown is None for truth in truths):
        return Truth(true)
    return Truth(true, ~(true | false_of([_not([truth]).true for truth in truths])))


def _not(values: list[Value]) -> Truth:
    truth = as_truth(values[0])
    return Truth(~truth.true if truth.unknown is None else ~(truth.true | truth.unknown), truth.unknown)


def _otherwise(*how: Callable[[list[Any]], Any]) -> Any:
    """One of several for all of them, and the other way round: not all of them are not."""
    return lambda values: _not([_together([_not([value]) for value in values], *how)])


def _comparison(function: Any) -> Any:
    def compared(values: list[Value]) -> Truth:
        left, right = as_numbers(values[0]), as_numbers(values[1])
        unknown = _either(_nan_in(left), _nan_in(right))
        true = function(left, right)
        if unknown is None:
            return Truth(true)
        return Truth(true & ~unknown, np.broadcast_to(unknown, np.shape(true)))

    return compared


def _numeric(function: Any) -> Any:
    def applied(values: list[Value]) -> Any:
        numbers = [as_numbers(value) for value in values]
        return function(*numbers) if len(numbers) == 1 else functools.reduce(function, numbers)

    return applied


def _reduced(function: Any) -> Any:
    def applied(values: list[Value]) -> Any:
        return function(_side_by_side([as_numbers(value) for value in values]))

    return applied


def _side_by_side(values: list[Any]) -> Any:
    """Scalars and vectors as one vector per tick."""
    if len(values) == 1:
        return values[0]
    count = max((len(value) for value in values if np.ndim(value)), default=1)
    return np.concatenate(
        [value if np.ndim(value) == 2 else np.broadcast_to(np.asarray(value).reshape(-1, 1), (count, 1))
         for value in values], axis=1,
    )  # fmt: skip


_one_of = functools.partial(functools.reduce, operator.or_)
_all_of = functools.partial(functools.reduce, operator.and_)


def _any_beside(parts: list[Any]) -> Any:
    return _side_by_side(parts).any(axis=1)


def _all_beside(parts: list[Any]) -> Any:
    return _side_by_side(parts).all(axis=1)


class Function(NamedTuple):
    """A function: the fewest and the most arguments, what it gives, for help, and what computes it.

    ufunc: that of NumPy, None where `silo.expressions.binding` makes it of what remembers or takes vectors.
    unit: that of the result; of a ufunc as in `UNIT_RULES`.
    """

    fewest: int
    most: int
    help: str
    ufunc: np.ufunc | None = None
    unit: UnitRule = KEPT

    @property
    def rule(self) -> UnitRule:
        """Which unit it takes and gives."""
        return UNIT_RULES[self.ufunc] if self.ufunc is not None else self.unit


FUNCTIONS = {
    "abs": Function(1, 1, "without its sign", np.absolute),
    "min": Function(1, 20, "smallest of a vector or of several, or within a time: min(x, 50ms)", np.minimum),
    "max": Function(1, 20, "largest of a vector or of several, or within a time: max(x, 50ms)", np.maximum),
    "sqrt": Function(1, 1, "square root", np.sqrt),
    "sin": Function(1, 1, "sine, of an angle", np.sin),
    "cos": Function(1, 1, "cosine, of an angle", np.cos),
    "tan": Function(1, 1, "tangent, of an angle", np.tan),
    "atan2": Function(2, 2, "angle of (y, x), in radians", np.arctan2),
    "hypot": Function(2, 2, "length of (x, y)", np.hypot),
    "norm": Function(1, 20, "length of a vector"),
    "sum": Function(1, 20, "sum of a vector or of several, or within a time: sum(x, 50ms)"),
    "any": Function(
        1, 20, "whether one of a vector is: any(legs/*/slip), or is within a time: any(x > 3, 50ms)", unit=PLAIN
    ),
    "all": Function(1, 20, "whether each of a vector is, or is all of a time: all(x > 3, 50ms)", unit=PLAIN),
    "isnan": Function(1, 1, "whether it is no number", unit=PLAIN),
    "prev": Function(1, 1, "value of the sample before"),
    "diff": Function(1, 1, "difference to the sample before"),
    "rate": Function(1, 1, "the same per second", unit=PER_SECOND),
    "mean": Function(2, 2, "mean within a time: mean(x, 50ms)"),
    "std": Function(2, 2, "standard deviation within a time: std(x, 1s)"),
}
REDUCING = ("any", "all", "norm_of", "sum_of", "min_of", "max_of", "known any", "known all")

COMPARING = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal,
             "!=": np.not_equal}  # fmt: skip
ADDING = {"+": np.add, "-": np.subtract, "*": np.multiply, "neg": np.negative}

OPERATIONS: dict[str, Any] = {
    # one that is false decides, whatever is unknown beside it
    "and": lambda values: _together(values, _all_of, _one_of), "or": _otherwise(_all_of, _one_of), "not": _not,
    "all": lambda values: _together(values, _all_beside, _any_beside), "any": _otherwise(_all_beside, _any_beside),
    # of those that are known; unknown where none is
    "known or": lambda values: _together(values, _one_of, _one_of), "known and": _otherwise(_one_of, _one_of),
    "known any": lambda values: _together(values, _any_beside, _any_beside),
    "known all": _otherwise(_any_beside, _any_beside),
    **{sign: _comparison(function) for sign, function in COMPARING.items()},
    **{sign: _numeric(function) for sign, function in ADDING.items()},
    "/": _numeric(np.divide), "%": _numeric(np.mod), "**": _numeric(np.power),
    **{name: _numeric(one.ufunc) for name, one in FUNCTIONS.items() if one.ufunc is not None},
    "norm_of": _reduced(lambda vector: np.sqrt(np.sum(vector * vector, axis=1))),
    "sum_of": _reduced(lambda vector: np.sum(vector, axis=1)),
    "min_of": _reduced(lambda vector: np.min(vector, axis=1)),
    "max_of": _reduced(lambda vector: np.max(vector, axis=1)),
}  # fmt: skip


WHOLE = {*ADDING, "sum_of", "abs", "%", "min", "max", "min_of", "max_of"}  # make integers of integers


def computed_whole(sign: str, bits: list[Bits], numbers: list[Any], made: Any) -> tuple[Bits | None, Any]:
    """Return what an operation makes of integers as `silo.core.arrays.wholes` tells them, of their bits and float64s.

    `made` is what it made of the float64s. None for the bits of what isn't whole.
    """
    if sign in ADDING or sign == "sum_of":
        return np.asarray(OPERATIONS[sign](bits), np.int64), made  # modulo 2^64 that is right
    if sign == "abs":
        return np.where(numbers[0] < 0, -bits[0], bits[0]), made
    if sign == "%":
        (over, known), (by, also) = map(told, bits, numbers)
        rest, exact = over % np.where(by == 0, 1, by), known & also & (by != 0)
        whole = np.where(exact, bits_of(rest), np.asarray(made).astype(np.int64))
        return whole, np.where(exact, np.asarray(rest, np.float64), made)
    if sign in _OUTER:
        if sign.endswith("_of"):
            every, known = told(_side_by_side(bits), _side_by_side(numbers))
        else:
            each = zip(*map(told, bits, numbers), strict=True)
            every, known = (np.stack(np.broadcast_arrays(*one), axis=-1) for one in each)
        outer, beyond = _OUTER[sign]
        return bits_of(outer.reduce(np.where(known, every, beyond), axis=-1)), made
    return None, made


_OUTER: dict[str, tuple[np.ufunc, int]] = {  # what is outermost, and a number that nothing lies beyond
    **dict.fromkeys(("min", "min_of"), (np.minimum, 2**64)), **dict.fromkeys(("max", "max_of"), (np.maximum, -(2**63))),
}  # fmt: skip
