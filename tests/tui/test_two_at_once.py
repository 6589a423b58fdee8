"""Two who ask at once: what one of them fetches or pins is neither fetched nor pinned by the other."""

import asyncio
from types import SimpleNamespace

import numpy as np

from silo.core.arrays.columns import ColumnStore, HistoryColumns, NonFinite
from silo.rpc.published import Event, EventKind
from silo.state.requests import Unsaved
from silo_tui.sessions.held import MOST_PIECES, HeldSource
from silo_tui.sessions.pinned import SLICES, PinnedSource, _ends_of

SECOND = 10**9
PLOTS = [SimpleNamespace(name="/log/x", element=SimpleNamespace(name="/log/x"))]
LIVE = SimpleNamespace(period_ns=lambda name: SECOND // 100, element=lambda name: None, happened=())
NOTHING_SHOWN = ColumnStore((), 1, 1)


async def others_go_on():
    """Let everything else that can run do so, as a link does."""
    for _ in range(5):
        await asyncio.sleep(0)


class YieldingPin:
    """A pin, and the buffers that it is from, which go on with others before they answer."""

    run, refused, text, reachable = "run1", "", "", True

    def __init__(self, begin_ns, end_ns, asked):
        self.begin_ns, self.end_ns, self.oldest_ns, self.asked = begin_ns, end_ns, begin_ns, asked

    async def samples(self, names, start_ns, end_ns):
        self.asked.append(start_ns)
        await others_go_on()
        return {name: (np.array([start_ns]), np.array([1.0])) for name in names}

    async def pin(self, names, start_ns, end_ns):
        self.asked.append(start_ns)
        await others_go_on()
        pin = YieldingPin(start_ns, end_ns, [])
        pin.oldest_ns = SECOND
        return pin

    def close(self):
        """Let go of it."""


async def test_a_slice_that_two_look_at_is_fetched_once():
    asked = []
    source = PinnedSource(LIVE, PLOTS, SECOND, 2 * SECOND, NOTHING_SHOWN)
    source.opened(YieldingPin(SECOND, 2 * SECOND, asked), SECOND, 2 * SECOND)
    await source.samples("/log/x", SECOND, SECOND + 1)
    assert (round(source.fetched_s, 6), source.complete) == (1 / SLICES, False)
    looks = [source.samples("/log/x", SECOND, 2 * SECOND) for _ in range(3)]
    answers = await asyncio.gather(*looks, source.fetch_rest())
    assert len(asked) == len(set(asked)) == SLICES
    assert [len(time_ns) for time_ns, _ in answers[:3]] == [SLICES] * 3
    assert (source.fetched_s, source.held_s, source.complete) == (1.0, 1.0, True)


async def test_a_moment_that_two_go_to_is_pinned_once():
    asked = []
    buffers = YieldingPin(SECOND, 100 * SECOND, asked)
    source = HeldSource(LIVE, PLOTS, (90 * SECOND, 100 * SECOND), 100 * SECOND, NOTHING_SHOWN, buffers)
    await source.open()
    assert asked == [90 * SECOND]
    await asyncio.gather(*(source.cover(40 * SECOND, 50 * SECOND) for _ in range(3)))
    assert asked == [90 * SECOND, 40 * SECOND]
    stretches = [(piece.begin_ns, piece.end_ns) for piece in source.pieces]
    assert stretches == [(40 * SECOND, 50 * SECOND), (90 * SECOND, 100 * SECOND)]


async def test_news_of_before_a_start_that_arrive_after_its_answer_stop_nothing(fake, opened):
    fake.run()
    async with opened(fake) as screen:
        session = screen.app.context.session
        await session.stop()
        stopped = fake.status()
        fake.now_ns += 1_000_000
        await session.start(Unsaved.DISCARD)
        assert session.running
        await session.take_event(Event(1, fake.now_ns, EventKind.STOPPED, "stopped", "", stopped))
        assert session.running  # a question would offer what fits a stopped logger
        started = fake.status()
        await session.stop()
        await session.take_event(Event(2, fake.now_ns, EventKind.STARTED, "started", "", started))
        assert not session.running


async def test_events_that_two_ask_for_stand_there_once_in_their_order(fake, opened, monkeypatch):
    fake.run()
    async with opened(fake) as screen:
        session = screen.app.context.session
        monkeypatch.setattr(fake, "publish", lambda *_, **__: None)
        for number in range(3):
            fake.happen("marker", f"push {number}", fake.now_ns)
        asked = asyncio.gather(session.learn_events(), session.learn_events())
        session._note(Event(1, fake.now_ns, EventKind.MARKER, "push 0", "", logged=1))
        await asked
        assert [(one.number, one.text) for one in session.happened] == [(each + 1, f"push {each}") for each in range(3)]


def test_ends_of_columns_stand_within_their_column_in_the_order_of_the_curve():
    low, high = np.array([[1.0, 2.0, np.nan, 0.0]]), np.array([[3.0, 2.0, np.nan, 1.0]])
    marks = np.array([[0, NonFinite.NAN, NonFinite.POS_INF, 0]], np.uint8)
    time_ns, values = _ends_of(HistoryColumns(("/log/x",), 10, 100, low, high, marks), 0)
    assert time_ns.tolist() == [1000, 1050, 1100, 1151, 1251, 1300, 1350]
    np.testing.assert_array_equal(values, [1.0, 3.0, 2.0, np.nan, np.inf, 1.0, 0.0])
    moved = HistoryColumns(("/log/x",), 10, 100, low[:, :2], high[:, :2], None, {0: 2**60})
    assert _ends_of(moved, 0)[1].tolist() == [2**60 + 1, 2**60 + 3, 2**60 + 2]


def test_the_piece_that_is_farthest_is_let_go_never_the_picture_that_was_held():
    closed: list[int] = []
    held = object.__new__(HeldSource)

    def piece(begin_ns):
        return SimpleNamespace(begin_ns=begin_ns, pin=begin_ns, let_go=lambda: closed.append(begin_ns))

    held._pieces = [piece(begin_ns) for begin_ns in (0, *range(100, 100 + MOST_PIECES))]
    held.main = held._pieces[0]
    held._forget_farthest(held._pieces[-1])
    assert closed == [100]
    assert [each.begin_ns for each in held._pieces] == [0, *range(101, 100 + MOST_PIECES)]
    assert len(held._pins) == MOST_PIECES
    held._forget_farthest(held._pieces[-1])
    assert closed == [100]
