"""What the titles of plots say of their signals: without a screen."""

import math

import numpy as np
import pytest

from silo.core.arrays.columns import ColumnPiece, ColumnStore, Gap
from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo_tui.model.drawing.plots import Axis, Picture, Plotted
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.facts import PlotFacts, extremes, missing
from silo_tui.model.samples.live import Reading

NAN = math.nan
DIGITS = str(2**53 + 1)


def plotted(dtype="<f8", position=0, labels=None):
    entries = (Entry("_x", dtype, labels), Entry("_y", dtype, labels))
    return Plotted(ElementInfo("/a", "-", "vector", (2,), entries, ElementOptions()), position)


def facts(reading=None, *, ended=False, paused=False, cursor=None, at_ns=None):
    window = PlotWindow(paused_end_ns=100 if paused else None, cursor=cursor, at_ns=at_ns)
    return PlotFacts(window, {} if reading is None else {"/a": reading}, ended)


def read(*values, texts=None, held=1, time_ns=50):
    return Reading(np.array(values), texts or {}, held, 0, time_ns)


def picture(smallest=-1.0, largest=2.0, at_cursor=None, signs="", cursor_signs=""):
    """One of which the numbers alone are looked at."""
    return Picture(None, None, Axis((0.0, 1.0)), smallest, largest, at_cursor, (), signs, cursor_signs)


@pytest.mark.parametrize(
    ("of", "when"),
    [
        ({}, "now"), ({"ended": True}, "last"), ({"cursor": 3}, "now"), ({"paused": True, "cursor": 0}, "at cursor"),
        ({"paused": True, "ended": True}, "at end"),
    ],
)  # fmt: skip
def test_of_when_a_reading_is(of, when):
    assert facts(**of).when == when


@pytest.mark.parametrize(
    ("signal", "reading", "shown"),
    [
        (plotted(), read(1.5, 2.5), "1.5000"),
        (plotted(position=1), read(1.5, 2.5), "2.5000"),
        (plotted(position=1), read(1.5), "-"),
        (plotted(), read(1.5, held=0), "-"),
        (plotted(), None, "-"),
        (plotted("<i8"), read(9e15, texts={0: DIGITS}), DIGITS),  # with all its digits
        (plotted("|S20"), read(NAN, texts={0: "a long word and more"}), "a long word…"),
    ],
)
def test_the_value_that_is_told(signal, reading, shown):
    assert facts(reading).now(signal) == shown


AT = {"paused": True, "cursor": 4}


@pytest.mark.parametrize(
    ("drawn", "of", "brief", "whole"),
    [
        (picture(), {}, "1.500", "min -1.000  max 2.000  now 1.500"),
        (picture(signs="nan"), {}, "1.500", "nan  min -1.000  max 2.000  now 1.500"),
        (picture(NAN, NAN, signs="nan"), {}, "1.500", "nan  now 1.500"),
        (picture(NAN, NAN), {}, "1.500", ""),
        (picture(at_cursor=(0.5, 0.5)), AT, "0.500", "at cursor 0.500"),
        (picture(at_cursor=(0.5, 2.0)), AT, "0.500…2.000", "at cursor 0.500 … 2.000"),
        (picture(at_cursor=(0.5, 2.0)), {**AT, "at_ns": 50}, "1.500", "at cursor 1.500 (0.500 … 2.000)"),
        (picture(at_cursor=(0.5, 2.0)), {**AT, "at_ns": 51}, "0.500…2.000", "at cursor 0.500 … 2.000"),
        (picture(at_cursor=(0.5, 2.0)), {"cursor": 4, "at_ns": 50}, "0.500…2.000", "at cursor 0.500 … 2.000"),
        (picture(at_cursor=(0.5, 0.5), cursor_signs="inf"), AT, "0.500", "at cursor 0.500 inf"),
        (picture(cursor_signs="nan inf"), AT, "nan inf", "at cursor nan inf"),
    ],
)
def test_the_numbers_beside_the_name_of_a_curve(drawn, of, brief, whole):
    told = facts(read(1.5, 2.5), **of)
    assert (told.brief(plotted(), drawn), told.of_curve(plotted(), drawn)) == (brief, whole)


LABELS = {0: "stand", 1: "walk", 2: "trot"}


@pytest.mark.parametrize(
    ("reading", "of", "shown"),
    [
        (read(1.0, 1.0), {}, "now walk"),
        (read(1.0, 1.0), {"paused": True}, "at end walk"),
        (read(1.0, 1.0), {"paused": True, "cursor": 6}, "at cursor walk"),  # the sample that held then
        (None, {"paused": True, "cursor": 6}, "at cursor stand"),
        (read(1.0, 1.0), {"cursor": 6}, "at cursor stand"),
        (read(1.0, 1.0), {"cursor": 0}, ""),
    ],
)
def test_the_word_beside_the_name_of_a_lane(reading, of, shown):
    values = np.array([0, 0, 0, 2, 2, 2, NAN, NAN], float)
    piece = ColumnPiece(values, values, np.zeros(8, np.uint8))
    assert facts(reading, **of).of_lane(plotted("<i4", labels=LABELS), piece, 8) == shown


def test_the_words_of_a_lane_are_those_of_the_cell_of_the_cursor():
    first = np.array([2, 0, 1, 1, 0, 1, 1, 2], float)  # two columns a cell
    for values, shown in {
        tuple(first): ["walk … trot", "stand … walk", "walk", "stand … trot"],
        tuple(2 - first): ["stand … walk", "walk … trot", "walk", "stand … trot"],
    }.items():
        piece = ColumnPiece(np.array(values), np.array(values), np.zeros(8, np.uint8))
        told = [facts(cursor=at).of_lane(plotted("<i4", labels=LABELS), piece, 8) for at in (0, 2, 4, 6)]
        assert told == [f"at cursor {words}" for words in shown]


@pytest.mark.parametrize(
    ("dtype", "base", "words"),
    [
        ("<f8", 0, ("-1.000", "2.000")),
        ("<i8", 2**60, (str(2**60 - 1), str(2**60 + 2))),  # with all their digits
        ("<M8[s]", 1_790_000_000, ("14:13:19.00…", "14:13:22.00…")),
    ],
)
def test_the_ends_of_a_curve_are_told_apart(dtype, base, words):
    drawn = Picture(None, None, Axis((0.0, 1.0), base), -1.0, 2.0, None)
    assert extremes(plotted(dtype), drawn) == words


def test_the_numbers_beside_a_curve_are_written_for_the_range_of_its_axis():
    drawn = Picture(None, None, Axis((999_999.0, 1_000_001.0), 0), 999_999.5, 1_000_000.4903, (999_999.5, 1_000_000.0))
    assert extremes(plotted("<f8"), drawn) == ("999999.500", "1000000.490")
    assert facts(read(999_999.8)).of_curve(plotted("<f8"), drawn) == "at cursor 999999.500 … 1000000.000"


def test_what_a_curve_lacks_is_told_by_its_length_and_why():
    values, marks = np.zeros(20), np.zeros(20, np.uint8)
    values[4:8], marks[4:8] = NAN, Gap.LOST << 4
    values[12:14], marks[12:14] = NAN, Gap.LOST << 4
    values[16:18], marks[16:18] = NAN, Gap.OFF << 4
    store = ColumnStore(["/a"], 20, 10**8)
    assert missing(ColumnPiece(values, values, marks), store, 10) == "░ 600 ms lost, 200 ms not logged then"
