"""What is held while a picture stands still: what is pinned, asked for and let go of, moment by moment."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from silo.core.arrays.columns import ColumnStore, HistoryColumns
from silo.core.elements import Entry, Sought
from silo.errors import ConnectionLostError, RefusedError
from silo.expressions.search import Looking
from silo_tui.sessions import pinned
from silo_tui.sessions.held import MOST_PIECES, NAMES_AT_ONCE, HeldSource
from silo_tui.sessions.pinned import Buffers, PinnedSource

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
        self.silent = 0, 0  # when nothing was logged
        self.asked, self.open = [], []

    def ask(self, *what):
        self.asked.append((what[0], *(each / SECOND for each in what[1:])))
        if self.problem is not None:
            raise self.problem

    async def pin(self, names, start_ns, end_ns):
        self.ask("pin", start_ns, end_ns)
        begin_ns, end_ns = (
            -(-max(start_ns, self.oldest_ns) // PERIOD) * PERIOD, min(end_ns, self.newest_ns) // PERIOD * PERIOD
        )  # fmt: skip
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
        time_ns, values = logged(max(start_ns, self.begin_ns), min(end_ns, self.end_ns + 1))
        there = (time_ns < self.robot.silent[0]) | (time_ns >= self.robot.silent[1])
        return {X: (time_ns[there], values[there])}

    async def columns(self, names, start_ns, end_ns, column_ns):
        self.robot.ask("columns", start_ns, end_ns, column_ns)
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
    assert (held.text, held.held_text, held.pinned) == ("10 s held, only the picture fetched", "10 s", True)
    await held.main.fetch_columns(SECOND)
    assert held.text == "10 s held, only columns fetched"
    await held.fetch(95 * SECOND, 100 * SECOND)
    assert 5.0 <= held.fetched_s < 5.5
    await held.fetch(90 * SECOND, 95 * SECOND)
    assert held.text == "10 s held, all fetched"
    await held.cover(60 * SECOND, 70 * SECOND)
    assert held.text == "20 s held, 10 s of it fetched"
    await held.fetch(60 * SECOND, 70 * SECOND)
    assert (held.text, held.held_text) == ("20 s held, all fetched", "20 s")


async def test_what_is_not_pinned_yet_is_pinned_the_newest_first(robot):
    held = await opened_of(robot, (60, 70))
    await held.cover(55 * SECOND, 100 * SECOND)
    asked = [(round(begin_s, 6), round(end_s, 6)) for _, begin_s, end_s in robot.asked]
    assert asked == [(70, 90), (55, 60)]
    assert [(piece.begin_ns, piece.end_ns) for piece in held.pieces] == [  # no moment is in none of them
        (55 * SECOND, 60 * SECOND - 1), (60 * SECOND, 70 * SECOND), (70 * SECOND + 1, 90 * SECOND - 1),
        (90 * SECOND, 100 * SECOND),
    ]  # fmt: skip
    await held.cover(55 * SECOND, 100 * SECOND)
    assert len(robot.asked) == 2
    await held.cover(55 * SECOND - 2 * PERIOD, 55 * SECOND)  # too short for a sample
    assert len(robot.asked) == 2


@pytest.mark.parametrize(
    ("time_s", "there", "pinned"),
    [
        (95, True, []), (90, True, []), (100, True, []), (70, True, [(68, 72)]), (51, True, [(50, 53)]),
        (89, True, [(87, 90)]), (99, True, []), (101, True, [(100, 103)]), (110, True, [(108, 112)]),
            (125, False, [(123, 127)]),
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
    assert (held.pinned, held.main.problem, robot.open) == (False, "the logger holds nothing of it any more", [])
    assert (held.held_text, held._out_of_reach) == ("only the picture", "nothing is pinned")
    robot.reachable = False
    assert held._out_of_reach == "no link"


async def test_what_was_held_and_is_overwritten_by_now_is_said(robot):
    held = await opened_of(robot)
    await held.fetch(90 * SECOND, 100 * SECOND)
    assert held.text == "10 s held, all fetched"
    robot.oldest_ns = 80 * SECOND
    await held.cover(50 * SECOND, 70 * SECOND)
    assert held.text == "10 s held, all fetched, 30 s before it overwritten"


async def test_between_samples_that_are_here_all_is_told_whatever_of_the_rest_are_columns_alone(robot):
    held = await opened_of(robot)
    await held.main.fetch_columns(700_000_000)  # whose ends are none of what is fetched at a time
    await held.fetch(97 * SECOND, 98 * SECOND)
    for a_s, b_s, samples, mean in ((97.2, 97.8, 61, 97.5), (97.8, 97.2, 61, 97.5), (97.195, 97.805, 62, 97.495)):
        found, why = await held.measure([X], round(a_s * SECOND), round(b_s * SECOND))
        assert (found[X].samples, round(found[X].mean, 6), why) == (samples, mean, "")
        assert (found[X].at_a, found[X].at_b) == (np.floor(a_s * 100 + 1e-6) / 100, np.floor(b_s * 100 + 1e-6) / 100)
    assert "measure" not in [what for what, *_ in robot.asked]


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


@pytest.mark.parametrize(
    ("problem", "words"), [(ConnectionLostError("cut"), "no link"), (RefusedError("too much"), "too much")]
)
async def test_where_the_robot_does_not_answer_what_is_here_is_looked_through_and_measured(robot, problem, words):
    held = await opened_of(robot, (60, 70))
    highest, edge = {X: Looking(Sought.HIGHEST)}, {X: Looking(Sought.EDGE)}
    await held.main.fetch_columns(SECOND)
    robot.problem = problem
    found, why = await held.find(highest, 95 * SECOND, 9)
    assert (found[X].values.tolist(), why) == ([99.99], "columns only, to 1 s")
    found, why = await held.find(edge, 95 * SECOND, 9)
    assert (found[X].total, why) == (0, words)
    found, why = await held.measure([X], 95 * SECOND, 92 * SECOND)
    assert (found[X].smallest, found[X].largest, why) == (92.0, 95.0, "columns only, to 1 s")
    assert np.isnan([found[X].mean, found[X].std, found[X].rms]).all()
    robot.problem = None
    await held.fetch(60 * SECOND, 100 * SECOND)
    robot.problem = problem
    found, why = await held.find(highest, 95 * SECOND, 9)
    assert (found[X].values.tolist(), why) == ([100.0], words)
    found, why = await held.measure([X], 65 * SECOND, 95 * SECOND)
    assert (found[X].samples, why) == (501 + 501, words)
    held.main._slices.clear()
    held.close()
    assert (await held.measure([X], 92 * SECOND, 95 * SECOND))[1] == "picture only, to 1 s"


async def test_of_many_signals_some_are_asked_for_at_a_time(robot):
    held = await opened_of(robot)
    names = [f"/log/{each}" for each in range(2 * NAMES_AT_ONCE + 1)]
    found, _ = await held.find(dict.fromkeys(names), 95 * SECOND, 9)
    measured, _ = await held.measure(names, 91 * SECOND, 95 * SECOND)
    assert list(found) == list(measured) == names
    assert [what for what, *_ in robot.asked] == ["find"] * 3 + ["measure"] * 3


@pytest.mark.parametrize("error", [None, ConnectionLostError("cut")])
async def test_a_pin_that_comes_when_nobody_waits_for_it_any_more_is_let_go_of(error):
    came, closed = asyncio.Event(), []

    async def read(job):
        await came.wait()
        if error is not None:
            raise error
        return SimpleNamespace(close=lambda: closed.append(1))

    buffers = Buffers(SimpleNamespace(connection=SimpleNamespace(read=read)))
    asking = asyncio.ensure_future(buffers.pin([X], 0, 1))
    await asyncio.sleep(0)
    asking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asking
    came.set()
    for _ in range(5):
        await asyncio.sleep(0)
    assert closed == ([1] if error is None else [])


async def test_who_leaves_lets_go_of_all_pins_also_of_one_that_comes_late(robot):
    held = await opened_of(robot, (60, 70))
    assert len(robot.open) == 2
    held.close()
    assert (robot.open, held.pinned, held.begin_ns) == ([], False, 60 * SECOND)
    late = held_of(robot)
    late.close()
    await late.open()
    assert robot.open == []


async def test_who_left_before_it_was_pinned_asks_for_nothing(robot):
    held = held_of(robot)
    looking = asyncio.ensure_future(held.look(91 * SECOND, 99 * SECOND, SECOND))
    await asyncio.sleep(0)
    held.close()
    await held.fill(SECOND, 5 * SECOND)
    await looking
    assert (robot.asked, robot.open) == ([], [])


async def test_a_link_that_is_there_again_mends_what_is_pinned_still(robot):
    held = await opened_of(robot, (60, 70))
    for piece in held.pieces:
        piece.problem = "no link"
    robot.open[0].refused = "its run has ended"
    held.mended()
    assert [piece.problem for piece in held.pieces] == ["", "no link"]


async def test_of_many_pins_the_farthest_is_let_go_of(robot):
    held = await opened_of(robot)
    for at in range(MOST_PIECES):
        await held.cover((85 - at) * SECOND, (85 - at) * SECOND + SECOND // 2)
    assert len(held.pieces) == len(robot.open) == MOST_PIECES
    assert stretches(held)[-2:] == [(84, 84.5), (90, 100)]


# ------------------------------------------------------------------------------------------------------- one pin


def pinned_of(robot, shown=None):
    """Eight seconds of the signal, from 92 to 100 s: a slice takes a quarter of a second."""
    source = PinnedSource(robot, [SimpleNamespace(name=X, element=ELEMENT)], 0, 1, shown or ColumnStore((), 1, 1))
    source.opened(Pin(robot, 92 * SECOND, 100 * SECOND - 1), 92 * SECOND, 100 * SECOND - 1)
    return source


def drawn(found):
    return [(low, high) for low, high in zip(found.low[0].tolist(), found.high[0].tolist(), strict=True)]


async def test_slices_are_fetched_the_newest_first_and_each_once(robot):
    source = pinned_of(robot)
    await source.fetch(99 * SECOND, 101 * SECOND)
    assert robot.asked == [("slice", at, at + 0.25) for at in (99.75, 99.5, 99.25, 99.0)]
    await source.fetch(99 * SECOND - 1, 99 * SECOND)
    assert robot.asked[4:] == [("slice", 98.75, 99.0)]
    assert (source.has(99 * SECOND, 100 * SECOND - 1), source.has(98 * SECOND, 99 * SECOND)) == (True, False)
    assert (round(source.fetched_s, 6), source.text) == (1.25, "8 s held, 1.2 s of it fetched")


async def test_what_nobody_looks_at_is_fetched_too_where_it_comes_quickly(robot, monkeypatch):
    source = pinned_of(robot)
    assert not await source.fetch_rest()  # nobody knows how long that takes
    clock = SimpleNamespace(s=0.0)

    def monotonic():
        clock.s += 0.39
        return clock.s

    monkeypatch.setattr(pinned, "time", SimpleNamespace(monotonic=monotonic))
    await source.fetch(99 * SECOND, 100 * SECOND)
    assert not await source.fetch_rest()  # 28 of 0.39 s are more than 10 s
    await source.fetch(98 * SECOND + SECOND // 4, 99 * SECOND - 1)
    robot.asked.clear()
    assert await source.fetch_rest()
    assert robot.asked == [("slice", 98.0, 98.25)]
    robot.problem = ConnectionLostError("cut")
    assert not await source.fetch_rest()
    assert source.text == "2 s of 8 s fetched, no more: cut"
    robot.asked.clear()
    assert not await source.fetch_rest()
    assert robot.asked == []
    robot.problem = None
    await source.fetch(92 * SECOND, 92 * SECOND)
    assert source.problem == ""
    while await source.fetch_rest():
        pass
    assert (source.complete, source.text) == (True, "8 s held, all fetched")


@pytest.mark.parametrize(("wished_ns", "wide_ns"), [(SECOND, SECOND), (1000, 1_954_080)])
async def test_columns_of_the_whole_span_are_as_many_as_there_may_be(robot, wished_ns, wide_ns):
    source = pinned_of(robot)
    await source.fetch_columns(wished_ns)
    assert robot.asked == [("columns", 92, 100, wide_ns / SECOND)]
    robot.problem = ConnectionLostError("cut")
    await source.fetch_columns(SECOND)
    assert source.text == "only columns fetched, no more: cut"


@pytest.mark.parametrize(
    ("column_ns", "ends"),
    [
        (SECOND // 2, [(96.0, 96.99), (96.0, 96.99), (97.0, 97.99), (97.0, 97.99)]),
        (SECOND, [(96.0, 96.99), (97.0, 97.99)]), (2 * SECOND, [(96.0, 97.99)]),
    ],
)  # fmt: skip
async def test_what_is_not_here_is_drawn_of_wider_columns_or_of_narrower_ones(robot, column_ns, ends):
    source = pinned_of(robot)
    await source.fetch_columns(SECOND)
    found = source.columns([X, "/log/other"], 96 * SECOND, 98 * SECOND - 1, column_ns)
    assert (found.first, drawn(found)) == (96 * SECOND // column_ns, ends)
    assert np.isnan(found.low[1]).all()


async def test_what_was_drawn_stays_drawn(robot):
    shown = ColumnStore((X,), 8, SECOND)
    shown.take(columns(95 * SECOND, 98 * SECOND, SECOND))
    source = pinned_of(robot, shown)
    shown.advance_to(1000)
    found = source.columns([X], 94 * SECOND, 96 * SECOND, SECOND)
    assert np.isnan(found.low[0, 0])
    assert drawn(found)[1:] == [(95.0, 95.99), (96.0, 96.99)]
    alone = PinnedSource(
        robot, [SimpleNamespace(name=X, element=ELEMENT)], 90 * SECOND, 99 * SECOND, ColumnStore((), 1, 1)
    )
    alone._shown = source._shown
    alone.unpinned("it is gone")
    assert (alone.begin_ns, alone.end_ns) == (95 * SECOND, 99 * SECOND)
    assert alone.text == "only the picture fetched, no more: it is gone"
    empty = PinnedSource(
        robot, [SimpleNamespace(name=X, element=ELEMENT)], 90 * SECOND, 99 * SECOND, ColumnStore((), 1, 1)
    )
    empty.unpinned("it is gone")
    assert (empty.begin_ns, empty.end_ns) == (99 * SECOND - 1, 99 * SECOND)


async def test_what_was_drawn_and_is_in_no_buffer_any_more_stays_drawn_and_is_told(robot):
    shown = ColumnStore((X,), 40, SECOND)
    shown.take(columns(70 * SECOND, 99 * SECOND, SECOND))
    robot.oldest_ns = 90 * SECOND
    held = HeldSource(
        robot, [SimpleNamespace(name=X, element=ELEMENT)], (60 * SECOND, 100 * SECOND), 100 * SECOND, shown, robot
    )
    await held.open()
    for fetched in (False, True):
        if fetched:
            await held.fetch(90 * SECOND, 100 * SECOND)
            assert held.text == "10 s held, all fetched, 20 s before it as drawn"
        for found in (
            held.columns([X], 60 * SECOND, 99 * SECOND, SECOND),
            await held.history([X], 60 * SECOND, 99 * SECOND, SECOND),
        ):
            np.testing.assert_array_equal(found.low[0, 10:], np.arange(70.0, 100.0))
    robot.oldest_ns = 95 * SECOND
    assert await held.bring(75 * SECOND, SECOND)
    assert not await held.bring(65 * SECOND, SECOND)
    assert (held.drawn_ns, held.begin_ns) == (70 * SECOND, 90 * SECOND)


async def test_what_was_drawn_before_the_pin_stays_drawn_until_it_is_fetched_from_the_buffers(robot):
    shown = ColumnStore((X,), 40, SECOND)
    shown.take(columns(70 * SECOND, 99 * SECOND, SECOND))
    plots = [SimpleNamespace(name=X, element=ELEMENT)]
    held = HeldSource(robot, plots, (90 * SECOND, 100 * SECOND), 100 * SECOND, shown, robot)
    await held.open()
    assert held.begin_ns == 50 * SECOND  # the buffers have it
    drawn = held.columns([X], 80 * SECOND, 94 * SECOND, SECOND)
    np.testing.assert_array_equal(drawn.low[0], np.arange(80.0, 95.0))
    await held.fetch(90 * SECOND, 100 * SECOND)
    fetched = held.columns([X], 80 * SECOND, 94 * SECOND, SECOND)
    np.testing.assert_array_equal(fetched.low[0], [*[np.nan] * 10, *np.arange(90.0, 95.0)])


async def test_between_two_samples_the_value_holds_but_not_for_longer_than_two_periods(robot):
    robot.silent = 95 * SECOND + 5 * PERIOD, 95 * SECOND + 9 * PERIOD
    source = pinned_of(robot)
    await source.fetch(92 * SECOND, 100 * SECOND)
    found = source.columns([X], 95 * SECOND + 3 * PERIOD, 95 * SECOND + 10 * PERIOD - 1, PERIOD // 2)
    assert found.first == 19006
    np.testing.assert_array_equal(found.low[0], [95.03, 95.03, *[95.04] * 5, *[np.nan] * 5, 95.09, 95.09])
    wide = source.columns([X], 95 * SECOND + 3 * PERIOD, 95 * SECOND + 10 * PERIOD - 1, 2 * PERIOD)
    np.testing.assert_array_equal(wide.low[0], [95.02, 95.04, np.nan, 95.09])
    assert wide.high[0, 0] == 95.03


async def test_samples_and_for_those_that_are_not_here_the_ends_of_columns_make_one_curve(robot):
    source = pinned_of(robot)
    assert source.with_columns(X)[1] == 0
    await source.fetch_columns(SECOND)
    (time_ns, values), wide_ns = source.with_columns(X)
    assert (len(time_ns), wide_ns, values[:2].tolist()) == (16, SECOND, [92.0, 92.99])
    await source.fetch(96 * SECOND, 100 * SECOND)
    (time_ns, values), wide_ns = source.with_columns(X)
    assert (len(time_ns), wide_ns) == (8 + 400, SECOND)
    assert (np.diff(time_ns) > 0).all()
    assert values[:9].tolist() == [92.0, 92.99, 93.0, 93.99, 94.0, 94.99, 95.0, 95.99, 96.0]
    await source.fetch(92 * SECOND, 96 * SECOND)
    (time_ns, _), wide_ns = source.with_columns(X)
    assert (len(time_ns), wide_ns) == (800, 0)


async def test_columns_are_asked_for_only_where_samples_are_missing(robot):
    source = pinned_of(robot)
    await source.fetch(96 * SECOND, 100 * SECOND)
    robot.asked.clear()
    found = await source.history([X], 97 * SECOND, 99 * SECOND - 1, SECOND)
    assert (drawn(found), robot.asked) == ([(97.0, 97.99), (98.0, 98.99)], [])
    await source.history([X], 95 * SECOND, 99 * SECOND, SECOND)
    assert [what for what, *_ in robot.asked] == ["columns"]
    robot.problem = ConnectionLostError("cut")
    for _ in range(2):
        found = await source.history([X], 95 * SECOND, 97 * SECOND - 1, SECOND)
        assert (np.isnan(found.low[0, 0]), drawn(found)[1]) == (True, (96.0, 96.99))
    assert (len(robot.asked), source.problem) == (2, "cut")
