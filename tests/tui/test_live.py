"""How newest values read in a cell."""

import re
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo.core.quantities.writing import duration_text, many
from silo_tui.model.samples.live import (
    LiveValues,
    Reading,
    component_label,
    component_text,
    entry_text,
    fill_share,
    has_norm,
    offset_text,
    value_text,
)
from silo_tui.model.words import text
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import LiveSource


@pytest.mark.parametrize(
    ("dtype", "value", "word", "shown"),
    [
        ("<f8", -0.7568, None, "-0.7568"), ("<f8", 1234.5678, None, "1234.57"), ("<f8", 1.5e7, None, "15000000.0"),
        ("<f8", 2.5e-6, None, "2.500e-6"), ("<f8", float("nan"), None, "nan"), ("<f8", float("-inf"), None, "-inf"),
        ("<i4", -42.0, None, "-42"), ("|b1", 1.0, None, "true"), ("|S8", float("nan"), "hello", "hello"),
        ("|S80", float("nan"), "a much longer text", "a much lon…"), ("<i8", 2.0**40, None, "1099511627776"[:13]),
        ("<M8[ms]", 1_790_000_000_123.0, None, "14:13:20.1…"), ("|S8", float("nan"), None, ""),
        ("<i4", float("nan"), None, "-"), ("<u8", 2.0**64, None, "18.4467e18"),
        ("<i8", 2.0**53, "12345", "12345"),
    ],
)  # fmt: skip
def test_a_value_reads_as_its_type_wants(dtype, value, word, shown):
    width = 13 if dtype == "<i8" else 11
    assert entry_text(Entry("", dtype), value, word, width) == shown


def test_an_enumeration_reads_as_its_label():
    entry = Entry("", "<i4", {2: "trot"})
    assert [entry_text(entry, value, None, 11) for value in (2.0, 7.0)] == ["trot", "7?"]
    element = ElementInfo("/v", "-", "scalar", (), (entry,), ElementOptions())
    assert value_text(element, Reading(np.array([np.nan]), {0: "2"}, 1, 0, 0), 11) == "trot"


def test_escape_sequences_in_a_logged_string_don_t_reach_the_terminal():
    assert entry_text(Entry("", "|S16"), float("nan"), "\x1b[2Jboom\n", 16) == "·[2Jboom·"


def test_a_vector_reads_as_a_list_cut_where_it_must():
    element = ElementInfo("/v", "m", "vector", (3,), tuple(Entry(f"_{c}", "<f8") for c in "xyz"), ElementOptions())
    reading = Reading(np.array([1.0, -2.5, 0.001]), {}, 1, 0, 0)
    assert (value_text(element, reading, 20), value_text(element, reading, 8)) == ("1.00 -2.50  0.00", "1.00 …")


def test_each_element_of_a_frame_gets_its_own_values_and_words():
    newest = np.array([1.0, 2.0, np.nan, np.nan, 5.0])
    frame = SimpleNamespace(
        elements=("/v", "/word", "/off", "/t"), newest=newest, texts={2: "one", 3: "off"}, time_ns=7,
        unpublished={"/off"}, held=[1, 2, 3, 4], lost=[0, 5, 0, 0], sizes={1: 100}, failed={3: 6}, not_live={},
    )  # fmt: skip
    live = LiveValues()
    live.take(frame, [2, 1, 1, 1])
    found = live.readings
    assert [found[name].newest.tolist() for name in ("/v", "/t")] == [[1.0, 2.0], [5.0]]
    assert [found[name].texts for name in frame.elements] == [{}, {0: "one"}, {}, {}]
    assert [(one.held, one.lost, one.size, one.failed) for one in found.values()] == [
        (1, 0, None, 0), (2, 5, 100, 0), (3, 0, None, 0), (4, 0, None, 6),
    ]  # fmt: skip
    assert live.time_ns == found["/v"].time_ns == 7


@pytest.mark.parametrize(
    ("dtype", "offset", "base", "shown"),
    [
        ("<f8", 1.5, 0, "1.5000"), ("<i8", 3.0, 2**60, str(2**60 + 3)), ("<i8", -3.0, 2**60, str(2**60 - 3)),
        ("<i8", 2.0**53, 2**60, "1.16193e18"), ("<M8[s]", 5.0, 1_790_000_000, "14:13:25.00…"),
        ("<M8[s]", float("nan"), 1_790_000_000, "-"),
    ],
)  # fmt: skip
def test_an_offset_from_a_base_reads_as_the_value_that_it_stands_for(dtype, offset, base, shown):
    assert offset_text(Entry("", dtype), offset, base, 12 if dtype[1] == "M" else 11) == shown


@pytest.mark.parametrize(
    ("chosen", "width", "shown"),
    [(1, 13, "norm 98765.43"), (1, 11, "norm 98765"), (2, 11, "x 3.0000"), (4, 9, "z 4.0000"), (4, 8, "z 4.000"),
     (4, 7, "4.0000"), (3, 10, "y 98765.4"), (3, 11, "y 98765.43")],
)  # fmt: skip
def test_a_part_of_a_vector_has_its_name_before_it_where_there_is_room(chosen, width, shown):
    element = ElementInfo("/v", "m", "vector", (3,), tuple(Entry(f"_{c}", "<f8") for c in "xyz"), ElementOptions())
    reading = Reading(np.array([3.0, 98765.4321, 4.0]), {}, 1, 0, 0)
    label = component_label(element, chosen, width)
    assert label + component_text(element, reading, chosen, width - len(label)) == shown


NUMBER, WORD = Entry("_x", "<f8"), Entry("_s", "|S8")


@pytest.mark.parametrize(
    ("kind", "entries", "norm"),
    [
        ("vector", [NUMBER, NUMBER], True), ("vector", [NUMBER], False), ("vector", [NUMBER, WORD], False),
        ("vector", [NUMBER, Entry("_g", "<i4", {0: "a"})], False), ("pose", [NUMBER, NUMBER], False),
        ("vector_at_position", [NUMBER, NUMBER], False), ("array", [Entry("_1", "|b1"), NUMBER], True),
    ],
)  # fmt: skip
def test_there_is_a_norm_of_numbers_of_one_unit(kind, entries, norm):
    assert has_norm(ElementInfo("/v", "m", kind, (len(entries),), tuple(entries), ElementOptions())) is norm


def test_entries_of_all_kinds_stand_side_by_side():
    entries = (NUMBER, WORD, Entry("_n", "<i8"), Entry("_g", "<i4", {2: "trotting along"}), Entry("_b", "|b1"))
    element = ElementInfo("/s", "-", "struct", (5,), entries, ElementOptions())
    reading = Reading(np.array([1.0, np.nan, 2.0**53, 2.0, 1.0]), {1: "hello", 2: str(2**53)}, 1, 0, 0)
    assert value_text(element, reading, 40) == "1.00 hello 9.01e15 trottin… true"
    assert value_text(element, None, 40) == "…"


def test_another_value_is_taken_where_a_float_can_tell_it():
    reading = Reading(np.array([1.0, np.nan]), {1: "hello"}, 1, 0, 0)
    assert reading.with_value(0, 2.0).newest[0] == 2.0
    assert reading.newest[0] == 1.0
    for position, value in ((0, np.nan), (1, 2.0), (2, 2.0)):
        assert reading.with_value(position, value) is reading


@pytest.mark.parametrize(("held", "size", "share"), [(5, 10, 0.5), (20, 10, 1.0), (1, 1, 1.0), (5, 0, 0.0)])
def test_a_buffer_is_full_at_most(held, size, share):
    assert fill_share(held, size) == share


@pytest.mark.parametrize("width", range(5, 40))
def test_no_entry_of_a_vector_moves_or_goes_when_another_gets_a_sign(width):
    element = ElementInfo("/v", "m", "vector", (5,), tuple(Entry(f"_{n}", "<f8") for n in range(5)), ElementOptions())
    values = np.array([1.0, -2.5, 20.5, 0.3, 123.0])
    told = [value_text(element, Reading(signed, {}, 1, 0, 0), width) for signed in (values, -values, abs(values))]
    assert len({len(words.split()) for words in told}) == 1
    assert max(map(len, told)) <= width
    ends = [[match.end() - len(words) for match in re.finditer(r"\S+", words)] for words in told]
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize(
    ("seconds", "shown"), [(0, "00:00"), (75, "01:15"), (3723, "1:02:03"), (90000, "1 d 01:00"), (-3, "00:00")]
)
def test_durations(seconds, shown):
    assert duration_text(seconds) == shown


@pytest.mark.parametrize(
    ("seconds", "shown"), [(2e-5, "20 us"), (0.002, "2 ms"), (10, "10 s"), (300, "5 min"), (7200, "2 h")]
)
def test_spans(seconds, shown):
    assert text.span(seconds) == shown


def test_a_number_alone_has_no_more_digits_than_it_needs():
    assert [text.short(value) for value in (0.000012345, 1234567.0, -12.5)] == ["1.234e-5", "1.235e6", "-12.5"]
    assert [text.short(value) for value in (193510.3, -12345.6, 1e5, 999999.4)] == ["193510", "-12346", "1e5", "1e6"]
    assert text.span(0.495, 2) == "500 ms", "no more digits than that"
    assert [text.span(value, 2) for value in (0.9996, 119.6, 0.0123, 2e-4)] == ["1 s", "2 min", "12 ms", "200 us"]


@pytest.mark.parametrize(("kind", "words"), [("vector", "0.00 -0.93  3.50"), ("pose", "0.00 -0.93  3.50")])
def test_an_entry_that_is_nothing_beside_the_others_is_a_zero_where_their_unit_is_one(kind, words):
    entries = tuple(Entry(suffix, "<f8") for suffix in ("_x", "_y", "_z"))
    element = ElementInfo("/log/a", "m", kind, (3,), entries, ElementOptions())
    reading = Reading(np.array([2e-8, -0.93, 3.5]), {}, 1, 0, 0)
    assert value_text(element, reading, 17) == words


@pytest.mark.parametrize(
    ("write", "told"),
    [
        (text.ago, {-1: "0.0 s", 9.9: "9.9 s", 10: "10 s", 59: "59 s", 60: "1 min", 3540: "59 min", 3600: "1 h",
               79_200: "22 h", 86_400: "1 d", 2_592_000: "30 d"}),
        (text.compact, {999.0: "999", 1000.0: "1000", 9999.0: "9999", 1e4: "10k"}),
        (lambda count: many(count, "tick"), {0: "0 ticks", 1: "1 tick", 12345: "12 345 ticks"}),
    ],
)  # fmt: skip
def test_where_one_unit_ends_the_next_begins(write, told):
    assert {value: write(value) for value in told} == told


def test_what_is_asked_for_while_another_view_is_opened_is_opened_next():
    opened, of = [], SimpleNamespace(_lock=nullcontext(), _closed=False, _opened=None, _opening=False)

    def opens(request):
        opened.append(request)
        if request == 1:
            for meanwhile in (2, 3):
                Link.watch(of, meanwhile)

    of._reading = SimpleNamespace(submit=lambda job: job())
    of._open_requested, of._replace_view = (lambda: Link._open_requested(of)), opens
    Link.watch(of, 1)
    assert (opened, of._opening) == ([1, 3], False)


def frame_of(*newest, elements=("/a",)):
    return SimpleNamespace(
        elements=elements, newest=np.array(newest), texts={}, time_ns=7, unpublished=set(), held=[1], lost=[0],
        sizes={}, failed={}, not_live={},
    )  # fmt: skip


def test_numbers_are_written_for_how_large_they_were_and_do_not_change_with_the_newest():
    live = LiveValues()
    reached = []
    for newest in ((1e-5, -2.0), (-0.5, 1.0), (np.nan, np.inf), (0.1, 0.0)):
        live.take(frame_of(*newest), [2])
        reached.append(live.readings["/a"].sizes.tolist())
    assert reached == [[1e-5, 2.0], [0.5, 2.0], [0.5, 2.0], [0.5, 2.0]]
    assert live.readings["/a"].reach(slice(1, 2)) == 2.0
    live.take(frame_of(3.0), [1])  # another signal of its name
    assert live.readings["/a"].sizes.tolist() == [3.0]
    live.forget()
    live.take(frame_of(0.25), [1])
    assert live.readings["/a"].sizes.tolist() == [0.25]


@pytest.mark.parametrize(
    ("kind", "words"), [("vector", "0.0 -1e-3  2e-3"), ("pose", "0.0 -1e-3  2e-3")]
)  # fmt: skip
def test_entries_of_one_unit_are_written_alike(kind, words):
    element = ElementInfo("/v", "m", kind, (3,), tuple(Entry(f"_{c}", "<f8") for c in "xyz"), ElementOptions())
    assert value_text(element, Reading(np.array([5e-5, -1e-3, 2e-3]), {}, 1, 0, 0), 17) == words
    larger = Reading(np.array([5e-5, -1e-3, 2e-3]), {}, 1, 0, 0, reached=np.array([5e-5, 75.0, 2e-3]))
    assert value_text(element, larger, 17).split() == (["0.0"] * 3 if kind == "vector" else ["0.00", "0.0", "0.00"])


@pytest.mark.parametrize("kind", ["vector", "pose", "twist"])
@pytest.mark.parametrize("values", [(1.79, -2e-3, 0.0), (1e-4, 0.0, -3e-4), (3.0, 1e-9, 2e-5)])
def test_a_vector_has_one_power_of_ten_or_plain_decimals(kind, values):
    element = ElementInfo("/v", "m", kind, (3,), tuple(Entry(f"_{c}", "<f8") for c in "xyz"), ElementOptions())
    told = value_text(element, Reading(np.array(values), {}, 1, 0, 0), 17).split()
    assert len({word.partition("e")[2] for word in told if word not in ("0", "0.0")}) == 1, told
    assert not [word for word in told if word.startswith("0e")], told


def test_an_integer_beside_large_ones_is_none_that_is_rounded():
    """`[2**60, 5, 0]` read `1.15e18 0 0`."""
    element = ElementInfo("/v", "-", "vector", (3,), tuple(Entry(f"_{c}", "<i8") for c in "xyz"), ElementOptions())
    reading = Reading(np.array([2.0**60, 5.0, 0.0]), {0: str(2**60)}, 1, 0, 0)
    assert value_text(element, reading, 24).split() == ["1.15e18", "5", "0"]


def test_entries_that_are_integers_stay_some():
    element = ElementInfo("/n", "-", "vector", (2,), tuple(Entry(f"_{c}", "<i4") for c in "xy"), ElementOptions())
    assert value_text(element, Reading(np.array([120.0, -3.0]), {}, 1, 0, 0), 17) == "120    -3"


@pytest.mark.parametrize(
    ("running", "frame_ns", "last_tick_ns", "end_ns"),
    [(True, 7, 5, 7), (True, 0, 5, 5), (False, 7, 5, 5), (False, 7, 0, 7), (False, 0, 5, 5), (False, 0, 0, 0)],
)
def test_what_is_logged_goes_to_the_newest_frame_or_to_the_last_tick_of_what_is_stopped(
    running, frame_ns, last_tick_ns, end_ns
):
    status = SimpleNamespace(last_tick_ns=last_tick_ns)
    session = SimpleNamespace(running=running, frame_time_ns=frame_ns, status=status)
    assert LiveSource(session).end_ns == end_ns
