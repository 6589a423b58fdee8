"""Reading and binding expressions: what they mean, and errors that show the place."""

import ast
import contextlib
import math
import re
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.conditions import Derived
from silo.core.elements import Entry
from silo.errors import ExpressionError
from silo.expressions.binding import OFF, BoundSignal, Catalogue, Constant, Known, bind
from silo.expressions.derived_signals import Lookback, lookback
from silo.expressions.evaluation import Evaluator, SourceRows
from silo.expressions.operations import FUNCTIONS
from silo.expressions.parsing import MOST_CHARACTERS, MOST_NODES, Call, Name, Operation, parse


def known(name, *suffixes, unit="-", dtype="<f8", labels=None, source=0):
    return Known(name, tuple(Entry(suffix, dtype, labels) for suffix in suffixes or ("",)), unit, source, 1)


CATALOGUE = Catalogue([
    known("/log/joints/tau", "_0", "_1", "_2", unit="Nm"),
    known("/log/joints/qd", "_0", "_1", "_2", unit="rad/s"),
    known("/log/base/roll", unit="rad"),
    known("/log/controller/mode", dtype="<i4", labels={0: "STANCE", 3: "TROT"}),
    known("/log/label", dtype="|S8"),
    known("/log/legs/LF/slip", dtype="|b1"),
    known("/log/legs/RF/slip", dtype="|b1", source=OFF),
    known("/log/a/x", unit="V"),
    known("/log/b/x"),
    known("/log/odd-name"),
    known("/log/wide", *[f"_{n}" for n in range(4)]),
])  # fmt: skip


def refusal(text):
    with pytest.raises(ExpressionError) as caught:
        bind(text, CATALOGUE)
    assert caught.value.reason in str(caught.value)
    return caught.value


def pointed_at(error):
    return error.text[error.at : error.end]


# ------------------------------------------------------------------------------------------------------ reading


def test_a_name_with_a_slash_is_one_word_and_a_division_has_blanks():
    assert parse("joints/tau").root == Name("joints/tau", 0, 10)
    assert parse("a / b").root == Operation("/", (Name("a", 0, 1), Name("b", 4, 5)), 0, 5)
    assert parse("(a)/2").root.operator == "/"
    assert parse("lambda").root == Name("lambda", 0, 6)  # no word of Python


def test_a_division_that_lacks_a_blank_is_told():
    for text, at in (("a /b", 2), ("a/ b", 1), ("base/roll + a/ b", 13)):
        error = refusal(text)
        assert "a division has blanks on both sides" in error.reason
        assert (error.at, pointed_at(error)[0]) == (at, "/")
    assert refusal("base/roll/joints/tau_0").reason.startswith("no signal")
    assert "roll / x" in str(refusal("roll/x"))


def test_threads_that_read_at_once_do_so_one_after_the_other(monkeypatch):
    both, read, before = threading.Barrier(2), ast.parse, list(warnings.filters)

    def read_together(*given, **named):
        with contextlib.suppress(threading.BrokenBarrierError):  # the other one waits for us
            both.wait(0.1)
        return read(*given, **named)

    with monkeypatch.context() as patch, ThreadPoolExecutor() as pool:
        patch.setattr(ast, "parse", read_together)
        list(pool.map(parse, ["a + 1", "a + 2"]))
    assert both.broken
    assert warnings.filters == before


@pytest.mark.parametrize("text", ["any(legs/*/slip)", "max(*/slip)", "max(joints/tau_*)", "sum(acc*)", "any(l[LR]/x)"])
def test_a_star_beside_a_part_of_a_name_is_a_wildcard(text):
    call = parse(text).root
    assert isinstance(call, Call)
    assert isinstance(call.arguments[0], Name)


@pytest.mark.parametrize("text", ["a*b", "2*b", "x_3*2", "x * y", "(a)*b", "joints/tau_3*joints/qd_3"])
def test_a_star_between_factors_multiplies(text):
    assert parse(text).root.operator == "*"


def test_a_name_that_is_being_typed_is_no_division_alone():
    with pytest.raises(ExpressionError, match="the name goes on behind it, or a division has blanks on both sides"):
        parse("a * base/")


def test_numbers_may_have_units_and_exponents():
    assert (parse("50ms").root.value, parse("50ms").root.unit) == (50.0, "ms")
    assert parse("1.5e3rad/s").root.unit == "rad/s"
    assert (parse("6 A").root.value, parse("6 A").root.unit, parse("6  A").root.end) == (6.0, "A", 4)
    behind = parse("x > 6 m/s and y < 7").root
    assert [one.operands[1].unit for one in behind.operands] == ["m/s", ""]
    assert bind("tau > 6 Nm or roll > 1 rad", CATALOGUE)
    for text in ("6 max(x)", "6 a_b", "6 7"):
        with pytest.raises(ExpressionError, match="operator missing"):
            parse(text)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("abs(x", "("), ("x > > 3", ">"), ("x.y.z(3)", "x.y.z"), ("f'x'", "'"), ("lambda: 3", ":"), ("x if y", "if"),
        ("a && b", "&"), ("x = 3", "="), ("foo(x)", "foo"), ("a, b", "a, b"), ("max(*x, **y)", "**"),
        ("any(x, k=1)", "="),
        ("mean(x)", "mean(x)"), ("1e999", "1e999"), ("x; y", ";"), ("{x}", "{"), ("x @ y", "@"),
        ("[x for x in y]", "["),
        ("`x", "`x"), ("x\\y", "\\"),
    ],
)  # fmt: skip
def test_what_has_no_place_is_refused_with_its_place(text, place):
    error = refusal(text)
    assert pointed_at(error).startswith(place[0]) or place in pointed_at(error)
    assert error.text == text
    assert "^" in str(error).splitlines()[-1]


def test_what_is_missing_at_the_end_is_told_there():
    error = refusal("base/roll >")
    assert error.reason == "something is missing at the end"
    assert error.at == len("base/roll >")


def test_length_and_parts_are_bounded():
    assert str(MOST_CHARACTERS) in refusal("x" * (MOST_CHARACTERS + 1)).reason
    assert str(MOST_NODES) in refusal("-" * 400 + "x").reason
    assert "nested" in refusal("(" * 240 + "x" + ")" * 240).reason
    parse(" + ".join(["x"] * 100))


@given(st.text(max_size=60) | st.text(alphabet="ab_/*.?[]()<>=!+-%,0123456789 `&|'\"\\:{}@", max_size=60))
def test_any_text_is_read_or_refused_with_its_place(text):
    try:
        bind(text, CATALOGUE)
    except ExpressionError as error:
        assert 0 <= error.at < error.end <= len(error.text) + 1


# ------------------------------------------------------------------------------------------------------ binding


@pytest.mark.parametrize("text", ["/log/base/roll", "base/roll", "roll", "log/base/roll", "`base/roll`"])
def test_a_name_may_be_short_as_long_as_it_is_one(text):
    (column,) = bind(text, CATALOGUE).columns
    assert column.element == 2


def test_a_name_that_several_have_is_refused_with_them():
    assert "may be /log/a/x, /log/b/x" in refusal("x > 3").reason


def test_an_unknown_name_is_told_with_the_nearest():
    error = refusal("abs(joints/tua_1) > 3")
    assert "did you mean 'joints/tau_1" in error.reason
    assert pointed_at(error) == "joints/tua_1"
    assert "joints/tau_1" in refusal("joints/tau[1]").reason


@pytest.mark.parametrize(
    ("text", "says"),
    [("acc[1]", "that scalar of it is named 'acc_y'"), ("imu/acc[0]", "named 'imu/acc_x'"),
     ("acc[3]", "'acc' has acc_x, acc_y, acc_z"), ("wide[6]", "'wide' has wide_0, wide_1, wide_2, wide_3 and 2 more"),
     ("nobody[1]", "is named 'nobody_1'")],
)  # fmt: skip
def test_an_index_is_answered_with_the_name_that_is_there(text, says):
    named = Catalogue([known("/log/imu/acc", "_x", "_y", "_z"), known("/log/wide", "_0", "_1", "_2", "_3", "_a", "_b")])
    with pytest.raises(ExpressionError) as caught:
        bind(text, named)
    assert says in caught.value.reason
    for name in re.findall(r"is named '(acc_.|imu/acc_.)'", caught.value.reason):
        assert bind(name, named)


def test_a_name_of_other_letters_stands_in_backticks():
    assert bind("`odd-name` > 3", CATALOGUE).columns[0].element == 9
    assert parse("`x`").root.text == parse("x").root.text
    for text in ("`odd-name", "`` > `", "``"):
        assert refusal(text).reason == "a name in backticks ends with a backtick"


def test_where_there_is_one_element_it_is_told_as_one():
    with pytest.raises(ExpressionError) as caught:
        bind("zzz > 3", Catalogue([known("/log/a/x")]))
    assert caught.value.reason == "no signal is named 'zzz'; there is 1 element"


def test_a_name_of_other_letters_is_meant_in_backticks():
    assert refusal("odd-name > 3").reason == "no signal is named 'odd'; did you mean '`odd-name`'?"


def test_words_in_quotation_marks_are_told_how_they_stand():
    for mark in "'\"":
        told = refusal(f"mode == {mark}TROT{mark}").reason
        assert told == "a quotation mark has no place in an expression; the words of enumerations stand without: TROT"


def test_a_text_is_no_number_and_how_it_is_compared_is_told():
    told = refusal("label == 3").reason
    assert told.startswith("'/log/label' is no number (") and told.endswith(
        "in Python log['label'] == 'word' compares it"
    )


def test_labels_are_numbers_beside_their_signal():
    bound = bind("controller/mode == TROT", CATALOGUE)
    assert bound.root.parts[1] == Constant(3.0, 3)
    assert bind("STANCE != mode", CATALOGUE).root.parts[0] == Constant(0.0, 0)
    assert "did you mean 'STANCE" in refusal("mode == STANCY").reason
    assert "neither a label (STANCE, TROT) nor a signal" in refusal("mode == 2 or mode == QQQQ").reason


def test_a_number_with_a_unit_is_in_that_of_its_signal():
    assert bind("abs(roll) > 30deg", CATALOGUE).root.parts[1].value == pytest.approx(math.pi / 6)
    assert bind("-5deg < roll", CATALOGUE).root.parts[0].value == pytest.approx(-math.pi / 36)
    assert bind("b/x > 20ms", CATALOGUE).root.parts[1].value == pytest.approx(0.02)
    assert "doesn't go with 'Nm'; leave it out, or multiply by one (x * 1s)" in refusal("joints/tau_0 > 3V").reason
    assert "doesn't go with" in refusal("roll + a/x > 1").reason


def test_products_have_their_unit_and_vectors_their_width():
    bound = bind("joints/tau * joints/qd", CATALOGUE)
    assert (bound.unit, bound.width, bound.logical) == ("W", 3, False)
    assert bind("rate(roll)", CATALOGUE).unit == "rad/s"
    assert "vectors of 3 and 4 values" in refusal("joints/tau + wide").reason


def test_a_pattern_is_a_vector_of_all_that_match():
    bound = bind("any(legs/*/slip)", CATALOGUE)
    assert isinstance(bound.root.parts[0], BoundSignal)
    assert [column.source for column in bound.columns] == [0, OFF]
    assert bound.sources == {0: 1}
    assert "no signal matches" in refusal("any(legs/*/slop)").reason


@pytest.mark.parametrize(
    ("text", "window_s", "ticks"),
    [
        ("a/x", 0, 1), ("slow", 0, 10), ("a/x + slow", 0, 10), ("diff(a/x)", 0, 2), ("diff(diff(slow))", 0, 30),
        ("mean(a/x, 1s)", 1, 2), ("max(mean(a/x, 1s), 0.5s) + diff(a/x)", 1.5, 3),
        ("mean(a/x, 1s) > diff(diff(a/x))", 1, 3),
    ],
)  # fmt: skip
def test_how_far_back_the_samples_are_that_a_value_needs(text, window_s, ticks):
    slow = Known("/log/slow", (Entry("", "<f8"),), "-", 1, 10)
    assert lookback(bind(text, Catalogue([known("/log/a/x"), slow]))) == Lookback(round(window_s * 1e9), ticks)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("norm(joints/tau, 20ms) > 3", "norm takes no time: write max(norm(...), 20ms)"),
        ("any(base/roll, joints/tau, 20ms)", "any takes one value beside a time: write any(any(...), 20ms)"),
        ("sum(base/roll, base/roll, 20ms) > 1", "sum takes one value beside a time: write sum(sum(...), 20ms)"),
    ],
)
def test_a_time_is_no_value_of_a_vector(text, says):
    error = refusal(text)
    assert (error.reason, pointed_at(error)) == (says, "20ms")


def test_the_guide_lists_every_function():
    page = (Path(__file__).parents[2] / ".docs/guide/conditions.md").read_text()
    listed = page.partition("## Functions of expressions")[2].partition("##")[0]
    assert [name for name in FUNCTIONS if f"`{name}(" not in listed] == []


def test_a_condition_is_one_truth():
    with pytest.raises(ExpressionError, match=r"3 values.*any"):
        bind("joints/tau > 3", CATALOGUE).condition()
    assert bind("any(joints/tau > 3)", CATALOGUE).condition().width == 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("label > 3", "is no number"),
        ("5 > 3", "names no signal"),
        ("mean(roll, 50)", "missing its unit"),
        ("mean(roll, 2h)", "at most 60 s"),
        ("norm(roll)", "takes a vector"),
        ("prev(3) + roll", "names no signal"),
    ],
)
def test_what_can_not_be_computed_is_told(text, says):
    assert says in refusal(text).reason


@pytest.mark.parametrize("unit", ["deg", "rad", "-"])
def test_a_sine_is_of_the_angle_whatever_its_unit(unit):
    turn = 30.0 if unit == "deg" else np.pi / 6
    rows = SourceRows(np.arange(1), np.arange(1), {(0, 0): np.array([turn])})
    bound = bind("sin(tilt)", Catalogue([known("/log/tilt", unit=unit)], "/log"))
    assert bound.unit == "-"
    assert np.allclose(Evaluator(bound).feed({0: rows}).values[0], 0.5)


def test_a_sine_of_what_is_no_angle_is_refused_and_of_a_number_of_degrees_taken():
    with pytest.raises(ExpressionError, match=r"sin takes numbers or angles, and this is in 'Nm': divide it by 1Nm"):
        bind("sin(tau)", CATALOGUE)
    assert bind("sin(tau / 1Nm) > sin(30deg)", CATALOGUE).logical
    assert bind("sqrt(rate(roll) * roll)", CATALOGUE).unit == "rad/s^0.5"


@pytest.mark.parametrize("unit", ["Nm", "%", "m/s^2", "m/s2", "N*m", "N·m", "kg m^2", "[parsec]", "1/s", "cycle"])
def test_what_is_told_of_a_sine_of_no_angle_can_be_typed(unit):
    elements = [known("/log/x", unit=unit)]
    with pytest.raises(ExpressionError, match="takes numbers or angles") as caught:
        bind("sin(x)", Catalogue(elements, "/log"))
    divided = re.search(r"divide it by (\S+),", caught.value.reason)
    if divided:
        assert bind(f"sin(x / {divided[1]})", Catalogue(elements, "/log")).unit == "-"
    given = re.search("derive a signal of it with unit='(.+)'", caught.value.reason)[1]
    derived = Catalogue(elements, "/log", (Derived("/log/angle", "x", given),))
    assert bind("sin(angle)", derived).unit == "-"


@pytest.mark.parametrize(("unit", "turns"), [("Hz", 0.25), ("kHz", 0.00025), ("1/s", 0.25)])
def test_a_sine_of_turns_that_were_made_radians_is_of_that_number(unit, turns):
    rows = SourceRows(np.arange(1), np.arange(1), {(0, 0): np.array([turns]), (1, 0): np.array([1.0])})
    bound = bind("sin(6.283185307 * f * t)", Catalogue([known("/log/f", unit=unit), known("/log/t", unit="s")], "/log"))
    assert np.allclose(Evaluator(bound).feed({0: rows}).values[0], 1.0)


@pytest.mark.parametrize(
    "angle", ["d * 3.14159265 / 180", "0.01745 * d", "d / 57.2958", "-d * 3.1416 / 180 + 0.1", "made"]
)
def test_an_angle_that_somebody_made_radians_is_not_converted_again_without_a_word(angle):
    elements = [known("/log/d", unit="deg")]
    catalogue = Catalogue(elements, "/log", (Derived("/log/made", "d * 3.14159 / 180", ""),))
    with pytest.raises(ExpressionError, match=r"an angle in 'deg', which sin converts by itself.*leave the factor out"):
        bind(f"sin({angle})", catalogue)
    for fit in ("d", "d * 0.018", "2 * d - 3", "1deg * 3"):
        assert bind(f"sin({fit}) > 0.5 * sin(d)", catalogue).logical
    meant = Catalogue(elements, "/log", (Derived("/log/made", "d * 3.14159 / 180", "rad"),))
    assert bind("sin(made)", meant).unit == "-"


# ---------------------------------------------------------------------------------------------------------- effort

CHAIN = Catalogue(CATALOGUE.elements, derived=[Derived("/log/d0", "roll + 1")] + [
    Derived(f"/log/d{at + 1}", f"d{at} + d{at} * 2") for at in range(200)
])  # fmt: skip
WIDE = Catalogue([known("/log/w", *[f"_{n}" for n in range(1000)]), known("/log/x")])


def test_signals_that_are_derived_from_one_another_over_and_over_are_refused_at_once():
    assert bind("d3", CHAIN).width == 0
    with pytest.raises(ExpressionError, match="this takes more than 1,000 operations: derive less"):
        bind("d9", CHAIN)
    with pytest.raises(ExpressionError, match="more than 20 derived signals stand on one another in this: derive less"):
        bind("d199", CHAIN)
    nested = [Derived("/log/n0", "roll")] + [
        Derived(f"/log/n{at + 1}", "(" * 20 + f"n{at} + 1" + ") * 1" * 20) for at in range(18)
    ]
    with pytest.raises(ExpressionError, match="nested too deeply"):
        bind("n18", Catalogue(CATALOGUE.elements, derived=nested))


def test_more_values_for_a_row_than_anybody_computes_are_refused():
    assert bind("sum(w" + " + w" * 40 + ")", WIDE).width == 0
    with pytest.raises(ExpressionError, match="more than 100,000 values of a row"):
        bind("sum(w" + " + w" * 60 + ")", WIDE)


@pytest.mark.parametrize(
    ("text", "kept_s"),
    [("w", 0), ("mean(x, 60s)", 60), ("std(w, 10s)", 10_000), ("mean(x, 60s) + max(w, 2s)", 2060), ("prev(x)", 0)],
)
def test_what_windows_remember_is_counted_and_has_an_end(text, kept_s):
    assert bind(text, WIDE).kept_s == kept_s
    with pytest.raises(ExpressionError, match="its windows remember more than 10,000 s of values"):
        bind(f"min(std(w, 9s)) + std(x, 2s) + mean(w, 1s) + ({text if kept_s else 'mean(x, 1s)'})", WIDE)


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("tau_0 / 0", "tau_0 / 0"), ("1 + tau_0 / 0.0", "tau_0 / 0.0"), ("tau_0 % 0", "tau_0 % 0"),
        ("tau_0 / -0", "tau_0 / -0"), ("joints/tau / (0 * 2)", "joints/tau / (0 * 2)"), ("roll / 0deg > 1", "roll / 0"),
    ],
)  # fmt: skip
def test_a_signal_that_is_divided_by_0_is_refused(text, at):
    error = refusal(text)
    assert error.reason == "this divides by 0, which gives no number at any time"
    assert pointed_at(error) == at


@pytest.mark.parametrize(
    "text", ["0 / tau_0", "tau_0 / 1e-300", "tau_0 / tau_1", "tau_0 / (0 * tau_1)", "tau_0 < 1 / 0"]
)
def test_what_may_be_a_number_is_divided(text):
    bind(text, CATALOGUE)
