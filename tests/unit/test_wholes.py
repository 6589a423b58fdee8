"""Integers of 64 bits, with a sign and without, beside what Python makes of them."""

import math
import operator
from itertools import product

import numpy as np
import pytest

import silo
from silo.core.elements import Entry
from silo.expressions.binding import Catalogue, Known, bind
from silo.expressions.evaluation import Evaluator, SourceRows

SIGNED = [2**53 + 1, -(2**53) - 1, 2**62 + 1, 2**63 - 1, 2**63 - 2, -(2**63), -(2**63) + 1, 7, -7, 1, -1, 0]
UNSIGNED = [2**53 + 1, 2**62 + 1, 2**63 - 1, 2**63, 2**63 + 1, 2**64 - 1, 2**64 - 2, 7, 1, 0]
OPERATORS = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "//": operator.floordiv, "%": operator.mod,
    "&": operator.and_, "|": operator.or_, "^": operator.xor, "<<": operator.lshift, ">>": operator.rshift,
    "**": operator.pow, "max": np.maximum, "min": np.minimum,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip
TRUTHS = {"max": max, "min": min}
KINDS = {np.int64: SIGNED, np.uint64: UNSIGNED, np.int32: [2**31 - 1, -(2**31), -3, 5], np.uint32: [2**32 - 1, 5, 0]}


def made_by_python(sign: str, one: int, other: int) -> int | float | None:
    """What is right; None where it is none, or too large to be told."""
    if (sign in ("//", "%") and other == 0) or (sign in ("<<", ">>") and not 0 <= other < 64):
        return None
    if sign == "**" and not 0 <= other < 12:
        return None
    return TRUTHS.get(sign, OPERATORS[sign])(one, other)


def signal(name: str, values: list[int], dtype: type) -> silo.Signal:
    return silo.Signal(name, np.array(values, dtype), np.arange(len(values)) * 10**9)


@pytest.mark.parametrize("sign", OPERATORS)
def test_what_signals_of_integers_make_is_what_python_makes_and_the_nearest_float_where_64_bits_are_too_few(sign):
    for (left, ones), (right, others) in product(KINDS.items(), repeat=2):
        for one, other in product(ones, others):
            expected = made_by_python(sign, one, other)
            if expected is None:
                continue
            made = OPERATORS[sign](signal("a", [one], left), signal("b", [other], right)).values[0].item()
            fits = -(2**63) <= expected < 2**64
            assert made == (expected if fits else pytest.approx(float(expected), rel=1e-15)), (left, one, right, other)
            assert isinstance(made, int | bool) == fits, (left, one, right, other)
            assert OPERATORS[sign](signal("a", [one], left), other).values[0].item() == made, (left, one, other)


@pytest.mark.parametrize("sign", ["+", "-", "*", "//", "%", "&", "|", "^", "max", "min"])
def test_what_64_bits_hold_is_next_to_what_python_makes_also_beside_what_they_do_not(sign):
    for (left, ones), (right, others) in product(KINDS.items(), repeat=2):
        pairs = list(product(ones, others))
        sides = signal("a", [one for one, _ in pairs], left), signal("b", [other for _, other in pairs], right)
        made = OPERATORS[sign](*sides)
        for (one, other), number in zip(pairs, made.values.tolist(), strict=True):
            expected = made_by_python(sign, one, other)
            if expected is not None and -(2**63) <= expected < 2**64:
                assert number in (expected, float(expected)), (left, one, right, other)


def test_of_whole_numbers_a_division_by_0_is_what_it_is_of_floats():
    for dtype in (np.int64, np.uint64):
        numbers = signal("a", [7, 0], dtype)
        for made in (numbers // 0, numbers % 0):
            np.testing.assert_array_equal(made.values, [np.inf, np.nan] if "//" in made.name else [np.nan, np.nan])


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_one_that_is_too_large_has_all_of_a_signal_be_floats(dtype):
    made = signal("a", [2**62, 5], dtype) * 5
    assert made.dtype == np.float64
    assert made.values.tolist() == [2.0**62 * 5, 25.0]


def test_integers_to_a_power_below_0_are_floats():
    assert (signal("a", [2, 4], np.int64) ** -1).values.tolist() == [0.5, 0.25]


def test_powers_without_a_sign_are_what_numpy_makes_of_floats():
    wide, exponent = [2**63 + 5, 0, 1], signal("e", [2**63, 2**63 + 1, 2**64 - 1], np.uint64)
    assert np.float_power(signal("w", wide, np.uint64), 1).values.tolist() == [2.0**63, 0.0, 1.0]
    for dtype in (np.int8, np.int64, np.uint64):
        assert np.power(signal("x", [1, 0, 2], dtype), exponent).values.tolist() == [1.0, 0.0, np.inf]
    assert np.float_power(signal("x", [True, False, True], bool), exponent).values.tolist() == [1.0, 0.0, 1.0]
    assert np.float_power(0, signal("w", wide, np.uint64)).values.tolist() == [0.0, 1.0, 0.0]


def test_signs_and_squares_do_not_wrap():
    lowest = signal("a", [-(2**63), 3], np.int64)
    assert abs(lowest).values.tolist() == [2**63, 3]
    assert (-lowest).values.tolist() == [2.0**63, -3.0]
    assert np.square(signal("u", [2**32 - 1], np.uint32)).values.tolist() == [(2**32 - 1) ** 2]
    assert np.square(signal("a", [2**40], np.int64)).values.tolist() == [2.0**80]


SEEN = [Known(f"/log/{name}", (Entry("", dtype),), "-", 0, 1) for name, dtype in (("a", "<i8"), ("b", "<u8"))]
PAIRS = list(product(SIGNED, UNSIGNED))
EXPRESSIONS = {
    "a": lambda a, b: a, "b": lambda a, b: b, "-a": lambda a, b: -a, "a + b": lambda a, b: a + b,
    "a - b": lambda a, b: a - b, "a * b": lambda a, b: a * b, "abs(a)": lambda a, b: abs(a),
    "a % b": lambda a, b: a % b if b else None, "b % a": lambda a, b: b % a if a else None,
    "a % 10": lambda a, b: a % 10, "b % -3": lambda a, b: b % -3, "min(a, b)": min, "max(a, b)": max,
    "max(a, 0)": lambda a, b: max(a, 0), "min(b, 9223372036854775808)": lambda a, b: min(b, 2**63),
    "sum(a, b)": lambda a, b: a + b, "max(abs(a), b) - b": lambda a, b: max(abs(a), b) - b,
    "a < b": operator.lt, "a == b": operator.eq, "b >= a": lambda a, b: b >= a, "a + 1 > b": lambda a, b: a + 1 > b,
    "a == 9223372036854775807": lambda a, b: a == 2**63 - 1, "b != 18446744073709551614": lambda a, b: b != 2**64 - 2,
    "abs(a) == 9007199254740992": lambda a, b: abs(a) == 2**53, "b % 10 == 5": lambda a, b: b % 10 == 5,
}  # fmt: skip


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_what_an_expression_makes_of_integers_is_what_python_makes(text):
    expected = [EXPRESSIONS[text](*pair) for pair in PAIRS]
    columns = {(0, 0): np.array([a for a, _ in PAIRS], np.int64), (1, 0): np.array([b for _, b in PAIRS], np.uint64)}
    bound = bind(text, Catalogue(SEEN))
    for at, wanted in enumerate(expected):  # each by itself, so that one that is too large makes no floats of others
        ticks = np.zeros(1, np.int64)
        rows = SourceRows(ticks, ticks, {key: column[at : at + 1] for key, column in columns.items()})
        found = Evaluator(bound, whole=True).feed({0: rows}).numbers()[0].item()
        if wanted is None:
            assert math.isnan(found)
        elif isinstance(wanted, bool) or "%" in text or not -(2**63) <= wanted < 2**64:
            assert found == pytest.approx(float(wanted), rel=1e-15), PAIRS[at]
        else:
            assert (type(found), found) == (int, wanted), PAIRS[at]
    ticks = np.arange(len(PAIRS))
    together = Evaluator(bound).feed({0: SourceRows(ticks, ticks, columns)}).numbers()
    assert together.tolist() == [
        pytest.approx(math.nan if one is None else float(one), rel=1e-15, nan_ok=True) for one in expected
    ]


def test_a_column_keeps_its_digits_beside_the_largest_and_the_smallest():
    ticks = np.arange(3)
    for dtype, values in ((np.int64, [2**63 - 1, -(2**63), 2**53 + 1]), (np.uint64, [2**64 - 1, 0, 2**53 + 1])):
        key, name = ((0, 0), "a") if dtype is np.int64 else ((1, 0), "b")
        rows = SourceRows(ticks, ticks, {key: np.array(values, dtype)})
        assert Evaluator(bind(name, Catalogue(SEEN)), whole=True).feed({0: rows}).numbers().tolist() == values


def test_the_outermost_of_a_vector_may_lie_beyond_63_bits():
    vector = [Known("/log/v", (Entry("_0", "<i8"), Entry("_1", "<u8")), "-", 0, 1)]
    ticks = np.arange(3)
    rows = SourceRows(ticks, ticks, {
        (0, 0): np.array([-5, 2**53 + 1, 2**53], np.int64), (0, 1): np.array([2**64 - 1, 2**53, 2**53 + 1], np.uint64),
    })  # fmt: skip
    for text, expected in (("min(v)", [-5, 2**53, 2**53]), ("max(v)", [2**64 - 1, 2**53 + 1, 2**53 + 1])):
        found = Evaluator(bind(text, Catalogue(vector)), whole=True).feed({0: rows}).numbers()
        assert found.tolist() == expected
