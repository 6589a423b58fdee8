"""Columns and values of a recording, against the samples themselves."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.analysis.log import Log
from silo.analysis.stretches import joined
from silo.core.arrays.columns import Gap, NonFinite, holes_of
from silo.core.arrays.values import newest_values
from silo.core.conditions import CaptureFacts, Conditions, Derived
from silo.core.elements import BufferType, Stretch
from silo.core.recording import Recording
from silo_tui.model.samples.recorded import RecordingSource
from silo_tui.sessions.recorded import FileSession
from tests.examples import examples
from tests.stand_ins.saved import element

START_NS = 1_790_000_000_123_456_789
STEP_NS = 2_500_000


def source(*elements, ticks=1000, times=None):
    times = START_NS + STEP_NS * np.arange(ticks, dtype=np.int64) if times is None else np.asarray(times, np.int64)
    recording = Recording("robot", times, len(times), elements, frequency_hz=400.0)
    return RecordingSource(recording, [each.name for each in elements])


def columns(of, name="/log/a", column_ns=50_000_000):
    return of.columns([name], of.begin_ns, of.end_ns, column_ns)


@given(
    data=st.data(),
    count=st.integers(1, 300),
    divider=st.integers(1, 7),
    column_ns=st.integers(STEP_NS * 8, 10**9),
)
@settings(max_examples=examples(60))
def test_a_column_holds_the_extremes_of_its_samples(data, count, divider, column_ns):
    numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)
    values = np.array(data.draw(st.lists(numbers, min_size=count, max_size=count)))
    of = source(element("a", values, divider=divider), ticks=(count - 1) * divider + 1)
    past = columns(of, column_ns=column_ns)
    places = (of.recording.time_ns[::divider][:count] // column_ns) - past.first
    low, high = np.full(past.low.shape[1], np.nan), np.full(past.low.shape[1], np.nan)
    finite = np.isfinite(values)
    np.fmin.at(low, places[finite], values[finite])
    np.fmax.at(high, places[finite], values[finite])
    there = np.zeros(len(low), bool)
    there[places] = True
    np.testing.assert_array_equal(past.low[0][there], low[there])
    np.testing.assert_array_equal(past.high[0][there], high[there])
    for mark, hit in (
        (NonFinite.NAN, np.isnan(values)),
        (NonFinite.POS_INF, values == np.inf),
        (NonFinite.NEG_INF, values == -np.inf),
    ):
        marked = np.flatnonzero(past.marks[0] & mark)
        if column_ns >= divider * STEP_NS:  # else a column without sample shows the value that holds
            np.testing.assert_array_equal(marked, np.unique(places[hit]))
        assert set(places[hit].tolist()) <= set(marked.tolist())


def test_facts_are_of_the_samples_in_the_window_without_nan():
    values = np.arange(1000.0)
    values[::3] = np.nan
    of = source(element("a", values))
    facts = of.facts("/log/a", of.begin_ns // 10**7, of.end_ns // 10**7 + 1, 10**7)
    assert (facts.smallest, facts.largest) == (1.0, 998.0)
    assert facts.mean == pytest.approx(np.nanmean(values))
    assert facts.samples == np.isfinite(values).sum()


def test_a_signal_without_a_number_has_no_facts():
    of = source(element("a", np.full(1000, np.nan)))
    facts = of.facts("/log/a", of.begin_ns // 10**7, of.end_ns // 10**7 + 1, 10**7)
    assert np.isnan([facts.smallest, facts.largest, facts.mean]).all()


def test_between_slow_samples_a_close_look_shows_the_value_that_held():
    of = source(element("a", [1.0, 2.0, 3.0], divider=400), ticks=1000)
    begin = of.begin_ns + 1_500_000_000
    past = of.columns(["/log/a"], begin, begin + 50_000_000, 1_000_000)
    assert (past.low == 2.0).all()


def test_nothing_is_shown_before_the_first_sample():
    of = source(element("a", np.ones(100), first=900))
    past = columns(of, column_ns=1_000_000)
    before = past.first + np.arange(past.low.shape[1]) < int(of.recording.time_ns[900]) // 1_000_000
    assert np.isnan(past.low[0][before]).all()
    assert (past.low[0][~before] == 1.0).all()


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        (np.array([True, False] * 500), 0, 1),
        (np.array([3, -7] * 500, "i1"), -7, 3),
        (np.array([1, 2**63] * 500, "u8"), 1, 2.0**63),
        (np.array([0.5, 2] * 500, "f2"), 0.5, 2),
        (np.array([1 + 5j, -2j] * 500), 0, 1),
        (np.array(["NaT", "1970-01-01T00:00:05"] * 500, "M8[s]"), 5, 5),
    ],
    ids=["bool", "int8", "uint64", "float16", "complex", "date"],
)
def test_numbers_of_every_type_are_drawn(values, low, high):
    past = columns(source(element("a", values)))
    assert (np.nanmin(past.low), np.nanmax(past.high)) == (low, high)


def test_what_was_read_is_kept_for_panning():
    values = np.arange(1000.0)
    of = source(element("a", values))
    before = columns(of).low
    values[:] = -1.0
    np.testing.assert_array_equal(columns(of).low, before)


def test_times_that_go_back_hide_no_sample():
    times = START_NS + STEP_NS * np.r_[np.arange(500), np.arange(300, 800)]
    values = np.zeros(1000)
    values[600] = 9.0
    of = source(element("a", values), times=times)
    assert of.clock_jumps == 1
    assert np.nanmax(columns(of).high) == 9.0


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (np.array(["NaT"], "M8[s]"), "NaT"), (np.array([b"\xffab"]), "\\xffab"),
        (np.array([2**62 + 1]), str(2**62 + 1)), (np.array([2**53]), str(2**53)),
        (np.array([2**64 - 1], "u8"), str(2**64 - 1)), (np.array([1 + 2j]), "1+2j"),
        (np.array([1_790_000_000_123_456_789], "M8[ns]"), "2026-09-21T14:13:20.123456789"),
    ],
)  # fmt: skip
def test_a_value_of_a_file_has_the_text_that_a_live_one_has(values, text):
    of = source(element("a", np.repeat(values, 1000)))
    assert of.readings(["/log/a"], of.end_ns)["/log/a"].texts == {0: text}
    assert newest_values(values)[1] == {0: text}


@pytest.mark.parametrize(
    ("made", "hole", "where"),
    [
        ({"first": 900}, Gap.OVERWRITTEN, slice(0, 89)), ({"lost": 5}, Gap.LOST, slice(12, None)),
        ({}, Gap.FULL, slice(12, None)),
    ],
)  # fmt: skip
def test_where_a_file_has_no_samples_it_says_why(made, hole, where):
    past = columns(source(element("a", np.ones(100), **made)), column_ns=25_000_000)
    assert (holes_of(past.marks[0])[where] == hole).all()
    assert np.isnan(past.low[0][where]).all()


def test_where_a_run_that_was_cut_has_no_samples_it_says_why():
    """Three stretches of 40 columns: `a` is off in the second, its oldest are overwritten in the last."""

    def part(number, *elements):
        times = START_NS + STEP_NS * np.arange(400 * number - 400, 400 * number, dtype=np.int64)
        return Recording("robot", times, 400, elements, frequency_hz=400.0, stretch=Stretch("run", number))

    first = (
        element("a", np.ones(400)),
        element("b", np.ones(400)),
        element("f", np.ones(100), buffer_type=BufferType.FIXED),
    )
    last = element("a", np.ones(200), first=200), element("c", np.ones(400)), element("f", np.ones(400))
    whole = joined([part(1, *first), part(2, element("f", np.ones(400))), part(3, *last)])
    of = RecordingSource(whole, [each.name for each in whole.elements])

    def holes(name):
        past = columns(of, name, STEP_NS * 10)
        return {
            int(at): Gap(hole) for at, hole in enumerate(holes_of(past.marks[0])) if hole and at in range(2, 119, 5)
        }

    off, overwritten = dict.fromkeys(range(42, 80, 5), Gap.OFF), dict.fromkeys(range(82, 98, 5), Gap.OVERWRITTEN)
    assert holes("/log/a") == {**off, **overwritten}
    assert holes("/log/b") == dict.fromkeys(range(42, 119, 5), Gap.OFF)
    assert holes("/log/c") == dict.fromkeys(range(2, 80, 5), Gap.OFF)
    assert holes("/log/f") == dict.fromkeys(range(12, 40, 5), Gap.FULL)


def test_a_reading_is_the_newest_sample_up_to_that_time():
    of = source(element("a", [1.0, 2.0, 3.0], divider=10, first=5), ticks=100)

    def at(tick, more=0):
        return of.readings(["/log/a"], START_NS + tick * STEP_NS + more)["/log/a"]

    assert not at(4).held
    assert at(5).newest[0] == 1.0
    assert at(14, STEP_NS - 1).newest[0] == 1.0
    assert at(15).newest[0] == 2.0
    assert at(99).newest[0] == 3.0


def test_a_reading_of_a_string_is_its_text():
    of = source(element("a", np.array([b"idle", b"w\xc3\xa4lk"] * 50, "S8")), ticks=100)
    assert of.readings(["/log/a"], of.end_ns)["/log/a"].texts == {0: "wälk"}


def test_the_last_span_is_the_whole_file():
    of = source(element("a", np.zeros(1000)))
    assert of.spans_s == tuple(sorted(of.spans_s))
    assert of.spans_s[-1] * 1e9 >= of.end_ns - of.begin_ns
    assert of.spans_s[-2] * 1e9 < of.end_ns - of.begin_ns


def test_a_file_of_one_tick_can_be_looked_at():
    of = source(element("a", [7.0]), ticks=1)
    past = of.columns(["/log/a"], of.end_ns - 10**9, of.end_ns, 10**7)
    assert np.nanmax(past.high) == 7.0


def test_an_element_without_samples_is_empty():
    of = source(element("a", np.zeros(0)), element("b", np.zeros(1000)))
    assert np.isnan(columns(of).low).all()
    assert not of.readings(["/log/a"], of.end_ns)["/log/a"].held


@given(divider=st.integers(1, 7), first=st.integers(0, 4), begin=st.integers(-50, 250), count=st.integers(0, 260))
@settings(max_examples=examples(40))
def test_the_samples_between_two_times_are_those_with_their_own_stamps(divider, first, begin, count):
    values = np.arange(30, dtype=np.int16)
    of = source(element("a", values, divider=divider, first=first * divider), ticks=240)
    start_ns, end_ns = (START_NS + STEP_NS * at for at in (begin, begin + count))
    time_ns, found = asyncio.run(of.samples("/log/a", start_ns, end_ns))
    stamps = of.recording.time_ns[first * divider :: divider][:30]
    inside = (stamps >= start_ns) & (stamps <= end_ns)
    np.testing.assert_array_equal(time_ns, stamps[inside])
    np.testing.assert_array_equal(found, values[: len(stamps)][inside])
    assert found.dtype == np.int16


def test_a_file_has_no_samples_of_a_name_that_is_not_in_it():
    time_ns, values = asyncio.run(source(element("a", [1.0])).samples("/log/b", 0, 2**62))
    assert (len(time_ns), len(values)) == (0, 0)


def test_a_file_opens_whose_derived_signal_has_no_sample_in_common_with_others():
    elements = (element("a", np.arange(40.0)[:10]), element("b", np.arange(10.0), first=30))
    times = START_NS + STEP_NS * np.arange(40, dtype=np.int64)
    conditions = Conditions(derived=(Derived("/log/sum", "a + b"),))
    log = Log(Recording("robot", times, 40, elements, frequency_hz=400.0, conditions=conditions), "run.silo")
    file = FileSession(log)
    assert (len(log), list(file.rows_of), file.status.elements) == (2, ["/log/a", "/log/b"], 2)


def test_a_sample_from_before_a_capture_makes_its_time_axis_no_longer_and_no_hole():
    # ticks 740 to 1800; asked for were 1000 to 1800
    elements = (element("a", np.arange(801.0), first=260), element("slow", np.arange(11.0), divider=100))
    times = START_NS + STEP_NS * np.arange(1061, dtype=np.int64)
    conditions = Conditions(capture=CaptureFacts("fall", 1, 1000, 1800, (1400,), (int(times[660]),)))
    recording = Recording("robot", times, 1801, elements, frequency_hz=400.0, conditions=conditions)
    of = RecordingSource(recording, [each.name for each in elements])
    assert (of.begin_ns, of.end_ns) == (times[0], times[1060])
    assert of.extent_ns(["/log/a", "/log/slow"]) == (times[260], times[1060])
    head = FileSession(Log(recording, "fall.silo")).facts_words(100, wide=True)
    assert "  2.65 s  801 ticks  " in "".join(words for _, words, _ in head)
    for name in ("/log/a", "/log/slow"):
        past = columns(of, name)
        assert not holes_of(past.marks[0]).any()
        there = past.low[0][times[260] // past.column_ns - past.first :] if name == "/log/a" else past.low[0]
        assert not np.isnan(there).any()


def test_the_head_says_beside_what_was_lost_that_there_are_holes():
    times = START_NS + STEP_NS * np.arange(10, dtype=np.int64)
    recording = Recording("robot", times, 10, (element("a", np.arange(10.0)),), gaps=((int(times[4]), int(times[5])),))
    head = FileSession(Log(recording, "whole.silo")).facts_words(100, wide=True)
    assert head[-1][1] == "  lost 0, 1 hole"


def test_the_head_of_a_narrow_screen_keeps_of_the_name_what_numbers_the_file():
    times = START_NS + STEP_NS * np.arange(10, dtype=np.int64)
    elements = (replace(element("a", np.arange(10.0)), lost=3),)
    gaps = ((int(times[4]), int(times[5])),)
    recording = Recording("robot", times, 10, elements, frequency_hz=400.0, overwritten=120000, gaps=gaps)
    for width in (60, 72, 80):
        head = FileSession(Log(recording, "anymal_20261201-061302_00042.silo")).facts_words(width, wide=False)
        words = "".join(words for _, words, _ in head)
        assert "00042" in words, width
        assert len(words) <= width
        assert words.endswith("lost 3, 1 hole, overwritten 120 000")


def test_the_head_tells_what_was_overwritten_before_a_part_was_saved_apart_from_what_was_lost():
    times = START_NS + STEP_NS * np.arange(10, dtype=np.int64)
    recording = Recording("robot", times, 10, (replace(element("a", np.arange(10.0)), lost=3),), overwritten=1200)
    head = FileSession(Log(recording, "whole.silo")).facts_words(100, wide=True)
    assert head[-1][1] == "  lost 3, overwritten 1 200"


def test_the_head_counts_derived_signals_apart_as_that_of_a_logger_does():
    times = START_NS + STEP_NS * np.arange(10, dtype=np.int64)
    elements = (element("a", np.arange(10.0)), element("twice", 2 * np.arange(10.0)))
    conditions = Conditions(derived=(Derived("/log/twice", "2 * a"), Derived("/log/lost", "a + b")))
    log = Log(Recording("robot", times, 10, elements, conditions=conditions), "run.silo")
    assert "  1 element +1 derived" in "".join(words for _, words, _ in FileSession(log).facts_words(100, wide=True))
