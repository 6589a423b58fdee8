"""How numbers that stand in one row are written: all alike, in the digits in which they differ."""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from silo_tui.model.words.text import Digits, digits_for, digits_of, row, ticks

FINITE = st.floats(allow_nan=False, allow_infinity=False)
ROWS = st.lists(
    st.one_of(FINITE, st.floats(-1e9, 1e9), st.floats(999_999, 1_000_001), st.floats(-1e-4, 1e-4)),
    min_size=1,
    max_size=6,
)
WIDTHS = st.integers(8, 30)


@pytest.mark.parametrize(
    ("values", "width", "words"),
    [
        ((999_999.5, 1_000_000.4903, 1_000_000.0), 11, ["999999.500", "1000000.490", "1000000.000"]),
        ((999_999.5, 1_000_000.4903, 1_000_000.0), 9, ["999999.5", "1000000.5", "1000000.0"]),
        ((999_999.5, 1_000_000.4903, 1_000_000.0), 8, ["1000000", "1000000", "1000000"]),  # all of them are coarser
        ((43.18e-6, 56.8e-6, 54.7993e-6), 9, ["43.18e-6", "56.80e-6", "54.80e-6"]),
        ((43.18e-6, 156.8e-6, 2e-6), 8, ["43.2e-6", "156.8e-6", "2.0e-6"]),
        ((-0.035, 0.03, -2e-3), 8, ["-0.03500", "0.03000", "-0.00200"]),
        ((-0.99996e-12, 0.99996e-12), 11, ["-1.000e-12", "1.000e-12"]),
        ((-1e-12, 1e-12, 0.25e-12), 9, ["-1.00e-12", "1.00e-12", "0.25e-12"]),
        ((999_999e3, 1_000_001e3), 11, ["999999000", "1000001000"]),
        ((1e9, 3e9), 8, ["1.000e9", "3.000e9"]),
        ((0.0, 90.0), 8, ["0.00", "90.00"]), ((-1e-15, 1.0), 8, ["0.000", "1.000"]),
        ((-0.0,), 8, ["0.0000"]), ((3.0, 3.0), 8, ["3.0000", "3.0000"]), ((9.81, 9.81 + 1e-12), 8, ["9.8100"] * 2),
        ((math.nan, 2.5, math.inf, -math.inf), 8, ["nan", "2.5000", "inf", "-inf"]),
        ((5e-324, 5e-324), 8, ["4.9e-324"] * 2), ((-1.7e308, 1.7e308), 8, ["-170e306", "170e306"]),
        ((0.0, 999_999.99996), 8, ["0", "1000000"]), ((999.99, 0.0), 6, ["1000.0", "0.0"]),
    ],
)  # fmt: skip
def test_numbers_of_a_row_are_written_alike(values, width, words):
    digits = digits_for(values, width)
    assert [digits.write(value, width) for value in values] == words


@pytest.mark.parametrize(
    ("size", "width", "digits"),
    [
        (0.0, 8, (0, 4)), (1.0, 8, (0, 4)), (999.0, 8, (0, 3)), (999.0, 11, (0, 4)), (1234.5, 11, (0, 2)),
        (1e6, 11, (0, 2)), (1e6, 8, (0, 0)), (2.5e-6, 11, (-6, 3)), (2.0**63, 11, (18, 5)), (math.inf, 11, (0, 4)),
    ],
)  # fmt: skip
def test_of_numbers_alone_their_size_says_how_they_are_written(size, width, digits):
    assert digits_of(size, 0.0, width) == digits


def test_an_integer_is_whole_where_it_has_room():
    assert digits_of(2.0**63, 0.0, 20, integer=True) == (0, 0)
    assert digits_of(2.0**63, 0.0, 19, integer=True).power == 18  # a minus has a cell of its own


@given(ROWS, WIDTHS)
@example([-1e-300, 0.0], 8)
@example([999_999.99996, 0.0], 8)
@example([1.7976931348623157e308, -5e-324], 8)
def test_no_number_of_a_row_is_wider_than_its_cell_and_none_is_written_otherwise(values, width):
    digits = digits_for(values, width)
    words = [digits.write(value, width) for value in values]
    assert max(map(len, words)) <= width
    told = [word for word in words if word not in ("0", "0.0")]  # `0e-4` would be read as small
    shapes = {(len(word.partition("e")[0].partition(".")[2]), word.partition("e")[2]) for word in told}
    assert shapes <= {(digits.decimals, str(digits.power) if digits.power else "")}


@given(ROWS, WIDTHS)
@example([0.5, 1.5], 8)
def test_a_number_that_is_read_back_is_the_number_to_half_of_its_last_digit(values, width):
    digits = digits_for(values, width)
    half = Fraction(10) ** (digits.power - digits.decimals) / 2
    slack = Fraction(max(map(abs, values))) / 10**15  # of what a float holds of it
    for value in values:
        assert abs(Fraction(digits.write(value)) - Fraction(value)) <= half + slack


@given(ROWS, WIDTHS)
def test_numbers_that_differ_by_more_than_the_last_digit_read_differently(values, width):
    digits = digits_for(values, width)
    for a, b in pairwise(sorted(values)):
        if b / 2 - a / 2 > digits.step * 0.5 * (1 + 1e-9) + 1e-15 * max(abs(a), abs(b)):
            assert digits.write(a) != digits.write(b)


@given(FINITE, FINITE)
def test_where_there_is_room_four_digits_tell_the_ends_of_a_row_apart(one, other):
    span, size = abs(one / 2 - other / 2) * 2, max(abs(one), abs(other))
    if math.isfinite(span) and span > 1e-11 * size and size > 1e-290:
        assert digits_for((one, other), 30).step <= 1.001e-3 * span


@given(st.floats(-1e12, 1e12), st.floats(0, 1e12), st.lists(st.floats(0, 1), min_size=1, max_size=9), WIDTHS)
def test_what_comes_between_the_ends_of_a_row_changes_nothing(low, extent, shares, width):
    digits = digits_for((low, low + extent), width)
    assert all(digits_for((low, low + extent, low + share * extent), width) == digits for share in shares)


def test_while_a_row_grows_decimals_go_and_do_not_come_back():
    told = [digits_for((1000.0, 1000.0 + size / 7), 11).decimals for size in range(1, 9999)]
    assert told == sorted(told, reverse=True)


def test_a_number_that_is_none_of_its_row_is_written_by_itself_where_it_has_no_room():
    assert Digits(0, 3).write(1234567.8, 10) == "1234567.8"
    assert Digits(0, 0).write(-1e300, 8) == "-1.0e300"


def test_numbers_that_stay_end_in_no_zeros_that_all_of_them_have():
    assert row(0.0, 7.5, -15.0) == ("0.0", "7.5", "-15.0")
    assert row(0.0, 10.0) == ("0", "10")
    assert ticks((0.0, 5e5, 1e6), 9) == ("0", "500000", "1000000")
    assert ticks((0.0, 250e-6), 9) == ("0", "250e-6")
    assert ticks((1e9, 1e9 + 1e-3), 9) == ()
