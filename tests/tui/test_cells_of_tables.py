"""What stands in the cells of the table of elements, and in which style: without a screen."""

import numpy as np
import pytest

from silo.analysis.reports import ElementReport
from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.elements import BufferType, ElementInfo, ElementOptions, Entry, Table
from silo.live.quantities import FROZEN, NOT_FINITE
from silo.rpc.published import NotLive
from silo_tui.model.samples.live import LiveValues, Reading
from silo_tui.model.table import cells
from silo_tui.model.table.cells import Sight
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.fields import Field
from silo_tui.model.table.state import TableState
from tests.stand_ins.fake_signals import scalar, vector

ELEMENTS = [
    scalar("/t", "Nm"), vector("/v", "m/s"), vector("/p", "-", kind="pose"), scalar("/n", dtype="<i4"),
    scalar("/gait", dtype="<i4", labels={0: "stand", 1: "walk"}), scalar("/on", dtype="|b1"),
    scalar("/off", enabled=False), scalar("/fixed", buffer=BufferType.FIXED),
    ElementInfo("/m", "-", "vector", (2,), (Entry("_n", "<i4"), Entry("_x", "<f8")), ElementOptions()),
    scalar("/derived", "-"),
]  # fmt: skip
ROW = {element.name: row for row, element in enumerate(ELEMENTS)}
OF_V = (3.0, 0.0, 4.0)
NAN = float("nan")


def read(*values, held=1, lost=0, **more):
    return Reading(np.array(values), {}, held, lost, 0, **more)


def sight_of(name, reading=None, chosen=0, facts=None, signs=0, **more):
    """What cells of one row are drawn from: `facts` are those of names on the screen."""
    table, live = TableState(), LiveValues()
    table.load(Table(1, ELEMENTS[:-1], ELEMENTS[-1:]))
    quantities = {"signs": np.where(np.arange(len(ELEMENTS)) == ROW[name], float(signs), 0.0)}
    table.facts = Facts(quantities, details=facts or {})
    if reading is not None:
        live.readings[name] = reading
    return Sight(table, live, lambda row: chosen, lambda row: "▁▂", **more)


def test_a_row_that_came_up_by_its_value_shows_the_one_it_was_ordered_by():
    sight = sight_of("/t", read(1.5))
    values = np.full(len(ELEMENTS), NAN)
    values[ROW["/t"]] = 2.5
    sight.table.facts = Facts({"value": values})
    assert cells.value(sight, ROW["/t"], 11) == ("2.5000", "value")
    sight.live.readings.clear()
    sight.written.clear()
    assert cells.value(sight, ROW["/t"], 11) == ("2.5000", "value"), "before its first picture, too"
    assert cells.value(sight, ROW["/n"], 11) == cells.WAITS, "of which nothing is known"
    sight.live.readings["/t"] = read(1.5)
    one = LimitStatus("/t", "/t", LimitWord.OK, bounds=(None, None, None, 2.0))
    sight.table.limits = {"/t": one}
    assert cells.sign(sight, ROW["/t"], 6)[0] == "HH", "as the number beside it, not as that of another moment"
    assert cells.limit_word_shown(sight.table, ROW["/t"], one, read(1.5)).value == "HH"  # which the head tells


@pytest.mark.parametrize(
    ("value", "judged", "more", "letters"),
    [
        (0.5, LimitWord.OK, {}, ""), (1.5, LimitWord.OK, {}, "H"), (2.5, LimitWord.YELLOW_HIGH, {}, "HH"),
        (-3.0, LimitWord.RED_HIGH, {}, "LL"), (0.5, LimitWord.YELLOW_HIGH, {}, ""),
        (0.95, LimitWord.YELLOW_HIGH, {"hysteresis": 0.1}, "H"), (0.95, LimitWord.OK, {"hysteresis": 0.1}, ""),
        (1.95, LimitWord.YELLOW_HIGH, {"hysteresis": 0.1}, "H"), (1.95, LimitWord.RED_HIGH, {"hysteresis": 0.1}, "HH"),
        (0.85, LimitWord.RED_HIGH, {"hysteresis": 0.1}, ""),
        (1.5, LimitWord.OK, {"persistence": 3}, ""), (0.5, LimitWord.YELLOW_HIGH, {"when": "on"}, "H"),
        (NAN, LimitWord.YELLOW_HIGH, {}, ""), (1.5, LimitWord.STALE, {}, "frozen"),
    ],
)  # fmt: skip
def test_the_sign_of_a_limit_is_of_the_value_that_stands_beside_it(value, judged, more, letters):
    sight = sight_of("/t", read(value))
    one = LimitStatus("/t", "t", judged, bounds=(-2.0, None, 1.0, 2.0), **more)
    sight.table.limits = {"/t": one}
    sight.table.take_beyond({"/t": judged.value} if one.is_over else {})
    assert cells.sign(sight, ROW["/t"], 2)[0] == letters


@pytest.mark.parametrize(
    ("bound", "width", "words"),
    [(0.15, 18, "0.063 over HH 0.15"), (0.15, 19, "0.0633 over HH 0.15"),
     (0.15, 16, "0.063 HH 0.15"), (-1234.5, 18, "0.063 HH -1234"), (-1234.5, 12, "0.063 over HH")],
)  # fmt: skip
def test_how_far_a_value_is_from_a_limit_is_told_in_whole_numbers_whatever_room_there_is(bound, width, words):
    sight = sight_of("/t", read(bound + 0.0633))
    sight.table.limits = {"/t": LimitStatus("/t", "t", LimitWord.OK, bounds=(None, None, None, bound), value=1.0)}
    assert cells.limit(sight, ROW["/t"], width)[0] == words


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("/t", (2.13,), "1.87 to H 4"), ("/t", (4.5,), "0.5 over H 4"), ("/t", (6.25,), "0.25 over HH 6"),
        ("/t", (-4.5,), "0.5 under LL -4"), ("/t", (NAN,), "-"), ("/n", (1.0,), "-"),
        ("/v", (0.0, NAN, 3.5), "0.5 to H 4"), ("/v", (NAN, 3.0, 3.5), "1 to HH 4"),
    ],
)  # fmt: skip
def test_how_far_a_value_is_from_the_limit_that_it_meets_first_of_a_vector_the_nearest_entry(name, values, words):
    sight = sight_of(name, read(*values))
    entries = [entry.suffix for entry in ELEMENTS[ROW["/v"]].entries]
    bounds = {"/t": (-4.0, None, 4.0, 6.0), f"/v{entries[1]}": (None, None, None, 4.0)}
    bounds[f"/v{entries[2]}"] = (None, None, 4.0, None) if np.isnan(values[-2:][0]) else (None, None, 40.0, None)
    limits = {one: LimitStatus(one, one, LimitWord.OK, bounds=each, value=1.0) for one, each in bounds.items()}
    sight.table.limits = limits
    assert cells.limit(sight, ROW[name], 16) == (words, "quiet")
    shares = sight.table.shares_left
    assert shares[ROW["/t"]] == 3.0 / 8.0
    assert shares[ROW["/v"]] == 0.75
    assert np.isnan(shares[ROW["/n"]])


@pytest.mark.parametrize(
    ("why", "cell"),
    [(NotLive.FULL, ("full", "quiet")), (NotLive.LIMIT, ("full", "caution")), (NotLive.OTHER, ("old", "caution")),
     (NotLive.SHORT, ("", "")), (None, ("", ""))],
)  # fmt: skip
def test_a_value_that_is_the_last_one_kept_has_a_sign_and_warns_where_nobody_asked_for_that(why, cell):
    assert cells.sign(sight_of("/t", read(1.5, why=why)), ROW["/t"], 2) == cell


def test_what_is_off_is_not_told_to_have_been_switched_on_later():
    assert cells.sign_of(sight_of("/off").table, ROW["/off"], read(1.5, why=NotLive.ABSENT)) == ""


@pytest.mark.parametrize(
    ("name", "reading", "more", "cell"),
    [
        ("/t", read(1.5), {}, ("1.5000", "value")),
        ("/t", read(1.5), {"fresh": False}, ("1.5000", "stale")),
        ("/t", read(1.5), {"running": False}, ("1.5000", "stale")),
        ("/t", read(1.5), {"fresh": False, "at_s": 2.0}, ("1.5000", "value")),  # a moment of a file
        ("/t", read(NAN, held=0), {"at_s": 2.0}, ("-", "quiet")),
        ("/t", None, {"at_s": 2.0}, ("wait", "quiet")),  # of a large file that is still read
        ("/t", None, {}, ("wait", "quiet")),
        ("/t", read(1.5, held=0), {}, ("wait", "quiet")),
        ("/t", None, {"fresh": False}, ("-", "quiet")),
        ("/t", None, {"running": False}, ("-", "quiet")),
        ("/off", read(1.5), {}, ("off", "quiet")),
        ("/t", read(1.5, why=NotLive.FULL), {}, ("1.5000", "stale")),  # it is known, and its sign says that it is old
        ("/t", read(NAN, why=NotLive.FULL), {}, ("buffer full", "quiet")),
        ("/t", read(1.5, why=NotLive.FULL), {"running": False}, ("1.5000", "stale")),
        ("/t", read(1.5), {"facts": {"/t": {"value": 2.5}}}, ("2.5000", "value")),  # of the statistics' moment
        ("/t", read(1.5), {"facts": {"/t": {"min": 0.0, "max": 90.0}}}, ("1.50", "value")),
        ("/t", read(123.4567), {"digits_fewer": 5}, ("123.5", "value")),
        ("/v", read(*OF_V), {"width": 17}, ("3.00  0.00  4.00", "value")),
        ("/v", read(*OF_V), {"facts": {"/v_z": {"value": 5.0}}, "width": 17}, ("3.00  0.00  5.00", "value")),
        ("/v", read(*OF_V), {"chosen": 1}, ("norm 5.0000", "value")),
        ("/v", read(*OF_V), {"chosen": 2, "facts": {"/v_x": {"value": 6.0}}}, ("x 6.0000", "value")),
        ("/v", read(*OF_V), {"chosen": 4}, ("z 4.0000", "value")),
        ("/v", read(*OF_V), {"chosen": 4, "facts": {"/v_z": {"value": 6.0}}}, ("z 6.0000", "value")),
    ],
)  # fmt: skip
def test_a_value_or_why_there_is_none(name, reading, more, cell):
    width = more.pop("width", 11)
    assert cells.value(sight_of(name, reading, **more), ROW[name], width) == cell


@pytest.mark.parametrize(
    ("reading", "more", "cell"),
    [
        (read(*OF_V), {}, ("4.0000", "value")),
        (read(*OF_V), {"facts": {"/v_z": {"value": 6.0, "min": 0.0, "max": 90.0}}}, ("6.00", "value")),
        (None, {}, ("wait", "quiet")),
    ],
)
def test_an_entry_on_a_line_of_its_own_has_no_name_before_it(reading, more, cell):
    assert cells.entry_value(sight_of("/v", reading, **more), ROW["/v"], 2, 11) == cell


@pytest.mark.parametrize(
    ("name", "reading", "cell"),
    [
        ("/t", read(1.0, held=2000), ("50%", "quiet")),
        ("/t", read(1.0, held=2000, size=2500), ("80%", "quiet")),  # the recording's buffer
        ("/t", read(1.0, held=2000, size=0), ("", "")),
        ("/t", None, ("", "")),
        ("/off", read(1.0, held=2000), ("", "")),
        ("/t", read(1.0, held=4000), ("100%", "quiet")),  # it rolls
        ("/fixed", read(1.0, held=4000), ("100%", "full")),
        ("/fixed", read(1.0, held=3990), ("100%", "quiet")),
        ("/t", read(1.0, held=2000, lost=1), ("50%", "lost")),
        ("/t", read(1.0, held=2000, failed=1), ("50%", "lost")),
    ],
)
def test_how_full_a_buffer_is(name, reading, cell):
    assert cells.fill(sight_of(name, reading), ROW[name], 4) == cell


@pytest.mark.parametrize(
    ("name", "title", "told", "more", "cell"),
    [
        ("/t", "mean", {"/t": {"mean": 2.5}}, {}, "2.5000"),
        ("/t", "mean", {}, {}, "-"),  # not asked yet
        ("/t", "mean", {"/t": {"mean": np.nan}}, {}, "-"),  # it has none yet
        ("/t", "mean", {"/t": {"mean": 2.5, "min": 0.0, "max": 90.0}}, {}, "2.50"),
        ("/t", "std", {"/t": {"min": 2.0**60, "max": 2.0**60 + 1024, "std": 231.5}}, {}, "231.5000"),  # not 0.000e18
        ("/n", "min", {"/n": {"min": 5.0}}, {}, "5"),
        ("/n", "mean", {"/n": {"mean": 5.5, "min": 5.0, "max": 6.0}}, {}, "5.500"),
        ("/gait", "max", {"/gait": {"max": 1.0}}, {}, "walk"),
        ("/gait", "max", {"/gait": {"max": 0.5}}, {}, "-"),
        ("/gait", "mean", {"/gait": {"mean": 1.0}}, {}, "-"),  # between two labels is nothing
        ("/on", "min", {"/on": {"min": 0.0}}, {}, "false"),
        ("/on", "mean", {"/on": {"mean": 0.25}}, {}, "0.2500"),
        ("/v", "min", {"/v": {"least": -2.0}}, {}, "-2.0000"),
        ("/v", "max", {"/v": {"least": 0.0, "most": 90.0}}, {}, "90.00"),
        ("/v", "mean", {"/v": {"mean": 3.0}}, {}, "-"),
        ("/p", "min", {"/p": {"least": -2.0}}, {}, "-"),  # of several units
        ("/v", "mean", {"/v": {"mean": 3.0}}, {"chosen": 1}, "3.0000"),
        ("/v", "mean", {"/v_x": {"mean": 4.0}}, {"chosen": 2}, "4.0000"),
        ("/m", "min", {"/m_n": {"min": 4.0}}, {"chosen": 2}, "4"),
        ("/m", "min", {"/m_x": {"min": 4.0}}, {"chosen": 3}, "4.0000"),
        ("/m", "min", {"/m": {"least": 4.0}}, {}, "4"),
    ],
)
def test_a_statistic_reads_as_its_signal_does(name, title, told, more, cell):
    assert cells.statistic(sight_of(name, facts=told, **more), ROW[name], 8, title) == (cell, "quiet")


@pytest.mark.parametrize(
    ("at_s", "width", "head"),
    [
        (None, 8, "value"), (21.9975, 12, "at 21.9975 s"), (21.9975, 8, "at 22 s"), (1234567.0, 4, "1e6 s"),
        (106.9, 7, "106.9 s"),
    ],
)  # fmt: skip
def test_the_head_of_values_says_of_when_they_are_in_as_many_digits_as_it_has_room_for(at_s, width, head):
    assert cells.value_head(sight_of("/t", at_s=at_s), width) == head


@pytest.mark.parametrize(
    ("name", "reading", "more", "cell"),
    [
        ("/t", read(1.0), {"signs": NOT_FINITE | FROZEN}, ("nan", "lost")),
        ("/t", read(1.0), {"signs": FROZEN}, ("frozen", "caution")),
        ("/t", read(1.0), {}, ("", "")),
        ("/t", read(1.0), {"signs": NOT_FINITE, "fresh": False}, ("old", "quiet")),
        ("/t", None, {"signs": NOT_FINITE, "fresh": False}, ("nan", "lost")),
        ("/off", read(1.0), {"signs": NOT_FINITE}, ("", "")),
    ],
)
def test_the_worst_sign_stands_alone(name, reading, more, cell):
    assert cells.sign(sight_of(name, reading, **more), ROW[name], 2) == cell


@pytest.mark.parametrize(
    ("draw", "quantity", "told"),
    [
        (cells.share, "share", {NAN: ("", "quiet"), 0.5: ("50%", "caution"), 0.95: ("95%", "quiet")}),
        (cells.rate, "rate", {NAN: ("", "quiet"), 99.5: ("99.5", "quiet")}),
        (cells.jitter, "jitter", {NAN: ("", "quiet"), 0.00154: ("1.5 ms", "quiet")}),
    ],
)
def test_what_is_measured_of_an_element_or_nothing_where_it_is_not_known(draw, quantity, told):
    for value, cell in told.items():
        assert draw(sight_of("/t", facts={"/t": {quantity: value}}), ROW["/t"], 8) == cell


def test_a_stretch_of_time_is_of_the_entry_that_is_shown_where_it_is_known():
    draw, facts = cells.changed, {"/v": {"changed": 5.0}, "/v_x": {"changed": 2.0, "change_seen": 0.0}}
    shown = [draw(sight_of("/v", chosen=chosen, facts=facts), ROW["/v"], 8)[0] for chosen in (0, 2, 3)]
    assert shown == ["5 s", ">2 s", "5 s"], "nobody saw _x change"


@pytest.mark.parametrize(
    ("draw", "name", "width", "shown"),
    [
        (cells.unit, "/t", 5, "Nm"), (cells.unit, "/n", 5, ""), (cells.unit, "/v", 2, "…"),
        (cells.option(Field.ENABLED), "/t", 3, "[x]"), (cells.option(Field.ENABLED), "/derived", 3, "[x]"),
        (cells.option(Field.BUFFER), "/fixed", 4, "fix"), (cells.option(Field.BUFFER), "/derived", 4, "-"),
        (cells.number(Field.SIZE), "/t", 4, "4000"), (cells.number(Field.SIZE), "/t", 3, "4e3"),
        (cells.number(Field.SIZE), "/derived", 4, "-"), (cells.number(Field.DIVIDER), "/derived", 4, "1"),
    ],
)  # fmt: skip
def test_settings_and_what_a_derived_signal_has_none_of(draw, name, width, shown):
    assert draw(sight_of(name), ROW[name], width)[0] == shown


def test_a_branch_has_the_worst_sign_below_it_and_of_how_many():
    rows = np.array([ROW["/t"], ROW["/v"]])
    assert cells.branch_sign(sight_of("/t", signs=NOT_FINITE), rows) == ("nan 1 of 2", "lost")
    assert cells.branch_sign(sight_of("/t"), rows) == ("", "")


@pytest.mark.parametrize(
    ("more", "style"), [({}, "trend"), ({"fresh": False}, "stale"), ({"fresh": False, "at_s": 1.0}, "trend")]
)
def test_a_trend_that_goes_on_no_more_is_dim(more, style):
    assert cells.trend(sight_of("/t", **more), 0, 10) == ("▁▂", style)


def report(type_="float64", samples=100, start_s=1.0, end_s=51.14, lost=0):
    return ElementReport("/t", "Nm", type_, "scalar", 1, "rolling", samples, start_s, end_s, 400.0, lost)


@pytest.mark.parametrize(
    ("draw", "of", "width", "cell"),
    [
        (cells.samples, report(samples=9_999_999), 7, ("9999999", "quiet")),
        (cells.samples, report(samples=10_000_000), 7, ("10M", "quiet")),
        (cells.span, report(), 6, ("50.14", "quiet")),
        (cells.span, report(), 16, ("1.00 … 51.14", "quiet")),
        (cells.span, report(start_s=None, end_s=None), 6, ("-", "quiet")),
        (cells.span, report(start_s=1.234567, end_s=1.234589), 20, ("1.234567 … 1.234589", "quiet")),
        (cells.type_cell, report("float64[7]"), 10, ("f64[7]", "quiet")),
        (cells.type_cell, report("datetime64[ns]"), 10, ("date64[ns]", "quiet")),
        (cells.lost, report(), 5, ("0", "quiet")),
        (cells.lost, report(lost=3), 5, ("3", "conflict")),
    ],
)
def test_what_a_file_tells_of_an_element(draw, of, width, cell):
    assert draw(sight_of("/t", reports={"/t": of}), ROW["/t"], width) == cell


@pytest.mark.parametrize(("name", "words"), [("/gait", "enum[7]"), ("/n", "i32[7]"), ("/m", "i32[7]")])
def test_what_has_labels_is_an_enumeration(name, words):
    assert cells.type_cell(sight_of(name, reports={name: report("int32[7]")}), ROW[name], 10) == (words, "quiet")


STATISTICS = ("min", "max", "mean", "std")


@pytest.mark.parametrize(
    ("dtype", "facts", "room", "told"),
    [
        ("<f8", (1_000_000.4903, 999_999.5, 1_000_000.4999, 1_000_000.0, 0.35), 11,
         ["1000000.490", "999999.500", "1000000.500", "1000000.000", "0.350"]),
        ("<f8", (1_000_000.4903, 999_999.5, 1_000_000.4999, 1_000_000.0, 0.35), 8,
         ["1000000", "1000000", "1000000", "1000000", "0.3500"]),  # 0 would say that there is no noise
        ("<f8", (54.7993e-6, 43e-6, 57e-6, 50e-6, 2e-6), 8,
         ["54.80e-6", "43.00e-6", "57.00e-6", "50.00e-6", "2.00e-6"]),
        ("<f8", (0.03, -0.035, 0.0352, -2e-3, 0.021), 8, ["0.03000", "-0.03500", "0.03520", "-0.00200", "0.02100"]),
        ("<f8", (0.5, -np.inf, 1.0, NAN, NAN), 8, ["0.5000", "-inf", "1.0000", "-", "-"]),
        ("<i4", (7.0, -9.0, 9.0, 0.25, 6.5), 8, ["7", "-9", "9", "0.25", "6.50"]),
        ("<u8", (2.0**63, 0.0, 2.0**63, 2.0**62, 1e18), 8,
         ["9.223e18", "0.000e18", "9.223e18", "4.612e18", "1.000e18"]),
    ],
)  # fmt: skip
def test_all_numbers_of_a_row_are_written_alike(dtype, facts, room, told):
    name = "/t" if dtype == "<f8" else "/n"
    details = dict(zip(("value", *STATISTICS), facts, strict=True))
    sight = sight_of(name, read(facts[0]), facts={name: details}, room=room)
    entry = ELEMENTS[ROW[name]].entries[0]
    assert entry.dtype == dtype or dtype == "<u8"
    words = [cells.value(sight, ROW[name], 11)[0]]
    words += [cells.statistic(sight, ROW[name], room, title)[0] for title in STATISTICS]
    assert words == told


def test_what_comes_on_the_screen_again_reads_as_it_did_before_it_was_measured_anew():
    """Rows that came up by an order of values had other decimals, and blanks, until they were measured."""
    sight = sight_of("/t", read(40.88812), facts={"/t": {"value": 40.8881, "min": 31.2, "max": 43.76}})

    def shown():
        sight.written.clear()
        return cells.value(sight, ROW["/t"], 11)[0], cells.statistic(sight, ROW["/t"], 8, "min")[0]

    assert shown() == ("40.89", "31.20")
    sight.table.facts = Facts({"value": sight.table.facts.quantities["signs"] + 40.8881})  # of all, of none the rest
    assert shown() == ("40.89", "-")


def test_an_integer_that_nothing_stands_beside_has_the_room_of_its_cell():
    words = Reading(np.array([2.0**63]), {0: str(2**63)}, 1, 0, 0)
    shown = [cells.value(sight_of("/n", words, room=17, value_room=17), ROW["/n"], width)[0] for width in (19, 17)]
    assert shown == [str(2**63), "9.22337203685e18"]


def test_the_norm_and_the_lines_of_entries_are_written_alike_too():
    told = dict(zip(("value", *STATISTICS), (1.5, 0.25, 2.0, 1.0, 0.125), strict=True))
    sight = sight_of("/v", read(*OF_V), 1, {"/v": told, "/v_x": told}, room=8)
    row = ROW["/v"]
    assert cells.value(sight, row, 11)[0] == "norm 1.500"
    assert [cells.statistic(sight, row, 8, title)[0] for title in STATISTICS] == ["0.250", "2.000", "1.000", "0.125"]
    assert cells.entry_value(sight, row, 0, 11)[0] == "1.500"
    assert [cells.entry_statistic(sight, row, 0, 8, title)[0] for title in STATISTICS[:2]] == ["0.250", "2.000"]


def test_on_a_thin_link_all_numbers_of_a_row_have_fewer_digits():
    told = {"/t": {"value": 123.4567, "min": 0.0, "max": 200.0}}
    sight = sight_of("/t", read(123.4567), facts=told, room=8, digits_fewer=2)
    assert (cells.value(sight, ROW["/t"], 11)[0], cells.statistic(sight, ROW["/t"], 8, "max")[0]) == ("123.5", "200.0")
    told["/t"]["max"] = 2.0
    sight.written.clear()  # as the table does for each line
    assert cells.statistic(sight, ROW["/t"], 8, "min")[0] == "0.000"
