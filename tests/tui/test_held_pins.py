"""What is held while a picture stands still: what is pinned, asked for and let go of, moment by moment."""

from types import SimpleNamespace

import numpy as np
import pytest

from silo.core.arrays.columns import ColumnStore, HistoryColumns
from silo.core.elements import Entry
from silo.errors import ConnectionLostError, RefusedError
from silo_tui.sessions.held import HeldSource

SECOND = 10**9
PERIOD = SECOND // 100
X = "/log/x"
ELEMENT = SimpleNamespace(name=X, entries=(Entry("", "<f8"),))


class Robot:
    """Buffers from 50 to 120 s of a signal that is the time in seconds, and pins of them; notes what is asked."""

    happened = ()

    def __init__(self):
        self.run, self.oldest_ns, self.newest_ns = "run1", 50 * SECOND, 120 * SECOND
        self.reachable, self.problem = True, None
        self.asked, self.open = [], []

    def ask(self, *what):
        self.asked.append((what[0], *(each / SECOND for each in what[1:])))
        if self.problem is not None:
            raise self.problem

    async def pin(self, names, start_ns, end_ns):
        self.ask("pin", start_ns, end_ns)
        begin_ns, end_ns = max(start_ns, self.oldest_ns), min(end_ns, self.newest_ns)
        pin = Pin(self, begin_ns, end_ns) if begin_ns <= end_ns else Pin(self, 0, 0, "overwritten")
        self.open.append(pin)
        return pin

    async def find(self, looking, around_ns, most, end_ns, pins):
        self.ask("find", around_ns, end_ns)
        return dict.fromkeys(looking, len(pins))

    async def measure(self, names, a_ns, b_ns, pins, run):
        self.ask("measure", a_ns, b_ns)
        return dict.fromkeys(names, (len(pins), run))

    def period_ns(self, name):
        return PERIOD

    def element(self, name):
        return None

    async def samples(self, name, start_ns, end_ns):
        self.ask("samples", start_ns, end_ns)
        return logged(start_ns, end_ns + 1)

    async def history(self, names, start_ns, end_ns, column_ns):
        self.ask("history", start_ns, end_ns)
        return columns(start_ns, end_ns, column_ns)


class Pin:
    refused = ""

    def __init__(self, robot, begin_ns, end_ns, text=""):
        self.robot, self.begin_ns, self.end_ns, self.text = robot, begin_ns, end_ns, text
        self.run, self.oldest_ns = robot.run, robot.oldest_ns

    async def samples(self, names, start_ns, end_ns):
        self.robot.ask("slice", start_ns, end_ns)
        return {X: logged(max(start_ns, self.begin_ns), min(end_ns, self.end_ns + 1))}

    async def columns(self, names, start_ns, end_ns, column_ns):
        self.robot.ask("columns", start_ns, end_ns)
        return columns(start_ns, end_ns, column_ns)

    def close(self):
        self.robot.open.remove(self)


def logged(start_ns, stop_ns):
    time_ns = np.arange(-(-start_ns // PERIOD) * PERIOD, stop_ns, PERIOD)
    return time_ns, time_ns / SECOND


def columns(start_ns, end_ns, column_ns):
    first, stop = start_ns // column_ns, end_ns // column_ns + 1
    low = np.arange(first, stop)[None] * (column_ns / SECOND)
    return HistoryColumns((X,), first, column_ns, low, low + (column_ns - PERIOD) / SECOND)


@pytest.fixture
def robot():
    return Robot()


def held_of(robot, begin_s=90, end_s=100):
    plots = [SimpleNamespace(name=X, element=ELEMENT)]
    nothing_shown = ColumnStore((), 1, 1)
    return HeldSource(robot, plots, (begin_s * SECOND, end_s * SECOND), end_s * SECOND, nothing_shown, robot)


async def opened_of(robot, *more_s):
    held = held_of(robot)
    assert await held.open() == ""
    for begin_s, end_s in more_s:
        await held.cover(int(begin_s * SECOND), int(end_s * SECOND))
    robot.asked.clear()
    return held


def stretches(held):
    return [(piece.begin_ns / SECOND, piece.end_ns / SECOND) for piece in held.pieces]


async def test_it_says_how_much_is_pinned_and_how_much_of_it_is_here(robot):
    held = held_of(robot)
    assert (held.text, held.held_text, held.pinned) == ("pinning …", "", False)
    await held.open()
    assert (held.text, held.held_text, held.pinned) == ("10 s held, only the picture here", "10 s", True)
    await held.main.fetch_columns(SECOND)
    assert held.text == "10 s held, only columns here"
    await held.fetch(95 * SECOND, 100 * SECOND)
    assert 5.0 <= held.fetched_s < 5.5
    await held.fetch(90 * SECOND, 95 * SECOND)
    assert held.text == "10 s held, all here"
    await held.cover(60 * SECOND, 70 * SECOND)
    assert held.text == "20 s held, 10 s of it here"
    await held.fetch(60 * SECOND, 70 * SECOND)
    assert (held.text, held.held_text) == ("20 s held, all here", "20 s")


async def test_what_is_not_pinned_yet_is_pinned_the_newest_first(robot):
    held = await opened_of(robot, (60, 70))
    await held.cover(55 * SECOND, 100 * SECOND)
    asked = [(round(begin_s, 6), round(end_s, 6)) for _, begin_s, end_s in robot.asked]
    assert asked == [(70, 90), (55, 60)]
    assert [(round(begin_s, 6), round(end_s, 6)) for begin_s, end_s in stretches(held)] == [
        (55, 60), (60, 70), (70, 90), (90, 100)
    ]  # fmt: skip
    await held.cover(55 * SECOND, 100 * SECOND)
    assert len(robot.asked) == 2
    await held.cover(55 * SECOND - 2 * PERIOD, 55 * SECOND)  # too short for a sample
    assert len(robot.asked) == 2


@pytest.mark.parametrize(
    ("time_s", "there", "pinned"),
    [
        (95, True, []), (90, True, []), (100, True, []), (70, True, [(68, 72)]), (51, True, [(50, 53)]),
        (89, True, [(87, 90)]), (99, True, []), (101, True, [(100, 103)]), (110, True, [(108, 112)]), (125, False, [(123, 127)]),
        (49.99, True, [(50, 51.99)]), (40, False, []),
    ],
)  # fmt: skip
async def test_a_moment_is_brought_with_what_is_around_it_as_long_as_the_buffers_have_it(robot, time_s, there, pinned):
    held = await opened_of(robot)
    assert await held.bring(int(time_s * SECOND), 2 * SECOND) is there
    assert [(round(begin, 6), round(end, 6)) for _, begin, end in robot.asked] == pinned


async def test_where_the_buffers_have_lost_it_that_is_said(robot):
    held = held_of(robot, 20, 30)
    assert await held.open() == "overwritten"
    assert (held.pinned, held.problem, robot.open) == (False, "the logger holds nothing of it any more", [])
    assert (held.held_text, held._out_of_reach) == ("only the picture", "nothing is pinned")
    robot.reachable = False
    assert held._out_of_reach == "no link"


@pytest.mark.parametrize(
    ("problem", "words"), [(ConnectionLostError("cut"), "no link"), (RefusedError("too many pins"), "too many pins")]
)
async def test_why_no_more_can_be_pinned_is_said(robot, problem, words):
    held = await opened_of(robot)
    robot.problem = problem
    assert await held.cover(60 * SECOND, 70 * SECOND) == words
    assert stretches(held) == [(90, 100)]


async def test_buffers_of_another_run_are_none_of_it(robot):
    held = await opened_of(robot)
    assert held.begin_ns == 50 * SECOND
    robot.run = "run2"
    await held.cover(60 * SECOND, 70 * SECOND)
    assert (stretches(held), len(robot.open), held.begin_ns) == ([(90, 100)], 1, 90 * SECOND)
    await held.cover(60 * SECOND, 70 * SECOND)
    assert len(robot.asked) == 1


async def test_what_the_buffers_lost_meanwhile_is_no_longer_asked_for(robot):
    held = await opened_of(robot)
    robot.oldest_ns = 80 * SECOND
    assert await held.cover(60 * SECOND, 70 * SECOND) == "overwritten"
    assert held.begin_ns == 80 * SECOND
    await held.cover(60 * SECOND, 70 * SECOND)
    assert len(robot.asked) == 1
    await held.cover(60 * SECOND, 90 * SECOND)
    assert stretches(held)[0] == (80, pytest.approx(90))


@pytest.mark.parametrize("cut", [False, True])
async def test_samples_and_columns_are_those_of_pins_and_of_buffers_each_once(robot, cut):
    held = await opened_of(robot, (60, 70))
    await held.fetch(60 * SECOND, 100 * SECOND)
    robot.problem = ConnectionLostError("cut") if cut else None
    time_ns, values = await held.samples(X, 65 * SECOND, 95 * SECOND)
    expected = logged(65 * SECOND, 95 * SECOND + 1)[0]
    expected = expected[(expected <= 70 * SECOND) | (expected >= 90 * SECOND)] if cut else expected
    np.testing.assert_array_equal(time_ns, expected)
    np.testing.assert_array_equal(values, expected / SECOND)
    here_ns, _ = held.held(X, 65 * SECOND, 95 * SECOND)
    assert len(here_ns) == 501 + 501
    drawn = await held.history([X], 65 * SECOND, 95 * SECOND, SECOND)
    assert (drawn.first, drawn.low.shape) == (65, (1, 31))
    gap = [int(at) + 65 for at in np.flatnonzero(np.isnan(drawn.low[0]))]
    assert gap == (list(range(71, 90)) if cut else [])
    here = held.columns([X], 65 * SECOND, 95 * SECOND, SECOND)
    assert [int(at) + 65 for at in np.flatnonzero(np.isnan(here.low[0]))] == list(range(71, 90))
    assert (here.low[0, 1], here.high[0, 1]) == (66.0, 66.99)


@pytest.mark.parametrize(
    ("time_s", "value"), [(95, 95.0), (65, 65.0), (80, None), (55, None), (100, 100.0), (105, np.nan)]
)
async def test_what_held_at_a_moment_is_that_of_its_pin(robot, time_s, value):
    held = await opened_of(robot, (60, 70))
    found = await held.readings([X, "/log/other"], time_s * SECOND)
    assert set(found) == ({X} if value is not None else set())
    if found:
        np.testing.assert_array_equal(found[X].newest, [value])


async def test_what_is_not_here_is_looked_for_and_measured_by_the_robot(robot):
    held = await opened_of(robot, (60, 70))
    assert await held.find({X: None}, 95 * SECOND, 9) == ({X: 2}, "")
    assert await held.measure([X], 95 * SECOND, 65 * SECOND) == ({X: (2, "run1")}, "")
    assert robot.asked == [("find", 95, 100), ("measure", 95, 65)]
    await held.fetch(90 * SECOND, 100 * SECOND)
    robot.asked.clear()
    found, why = await held.measure([X], 99 * SECOND, 91 * SECOND)
    assert (found[X].samples, round(found[X].mean, 6), why, robot.asked) == (801, 95.0, "", [])
    robot.reachable = False
    found, why = await held.measure([X], 65 * SECOND, 95 * SECOND)
    assert (found[X].samples, why) == (501, "no link")


async def test_who_leaves_lets_go_of_all_pins_also_of_one_that_comes_late(robot):
    held = await opened_of(robot, (60, 70))
    assert len(robot.open) == 2
    held.close()
    assert (robot.open, held.pinned, held.begin_ns) == ([], False, 60 * SECOND)
    late = held_of(robot)
    late.close()
    await late.open()
    assert robot.open == []


async def test_a_link_that_is_there_again_mends_what_is_pinned_still(robot):
    held = await opened_of(robot, (60, 70))
    for piece in held.pieces:
        piece.problem = "no link"
    robot.open[0].refused = "its run has ended"
    held.mended()
    assert [piece.problem for piece in held.pieces] == ["", "no link"]
