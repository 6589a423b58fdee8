"""Units of functions: what NumPy's functions of one number, and those of expressions, make of a unit, in one table."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from silo.core import units

_NONE = ("", "-")


class UnitRule(NamedTuple):
    """Which unit a result has, of that of the argument, and which one the argument must have.

    takes: the unit in which the argument is wanted, `rad` for plain numbers and angles; empty for any.
    """

    of: Callable[[str], str]
    takes: str = ""


def _powered(exponent: float) -> UnitRule:
    return UnitRule(lambda unit: unit if unit in _NONE else units.power(unit, exponent))


KEPT, PLAIN = UnitRule(lambda unit: unit), UnitRule(lambda _: "-")
PER_SECOND = UnitRule(lambda unit: unit if unit in _NONE else units.quotient(unit, "s"))
_OF_NUMBERS, _TO_RADIANS = UnitRule(PLAIN.of, "rad"), UnitRule(lambda _: "rad", "rad")
UNIT_RULES: dict[np.ufunc, UnitRule] = {
    **dict.fromkeys(
        (np.negative, np.positive, np.absolute, np.fabs, np.floor, np.ceil, np.rint, np.trunc, np.conjugate,
         np.maximum, np.minimum, np.hypot), KEPT),
    np.sqrt: _powered(0.5), np.square: _powered(2.0), np.cbrt: _powered(1 / 3), np.reciprocal: _powered(-1.0),
    **dict.fromkeys(
        (np.sin, np.cos, np.tan, np.exp, np.exp2, np.expm1, np.log, np.log2, np.log10, np.log1p, np.sinh, np.cosh,
         np.tanh, np.arcsinh, np.arccosh, np.arctanh), _OF_NUMBERS),
    **dict.fromkeys((np.arcsin, np.arccos, np.arctan), _TO_RADIANS), np.arctan2: UnitRule(_TO_RADIANS.of),
    **dict.fromkeys((np.deg2rad, np.radians), UnitRule(_TO_RADIANS.of, "deg")),
    **dict.fromkeys((np.rad2deg, np.degrees), UnitRule(lambda _: "deg", "rad")),
    **dict.fromkeys((np.isnan, np.isfinite, np.isinf, np.signbit, np.sign, np.logical_not), PLAIN),
}  # fmt: skip
