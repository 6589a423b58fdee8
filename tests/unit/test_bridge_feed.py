"""What a feed of a bridge passes on: each sample once, and what of a robot is there."""

import contextlib
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from silo.bridges import services
from silo.bridges.feed import PERIOD_S, LoggerFollower
from silo.bridges.ros2.graph import Graph
from silo.bridges.services import Audit, audit
from silo.control.denials import Denials
from silo.core.elements import State
from silo.errors import ConnectionLostError, RefusedError
from silo.history.arrays import SampleArrays
from tests.waiting import DEADLINE_S, wait_until


def samples(first, count):
    ticks = np.arange(first, first + count)
    return SampleArrays(ticks, ticks * 1000, ticks.astype(float))


def test_no_sample_is_passed_on_twice_and_runs_that_are_over_are_forgotten():
    feed = LoggerFollower(lambda: None, None)
    for run in ("one", "two", "three"):
        assert feed._unseen(run, "/log/x", samples(0, 10)).ticks.tolist() == list(range(10))
        assert feed._unseen(run, "/log/x", samples(5, 10)).ticks.tolist() == list(range(10, 15))
    assert feed._last_tick == {"/log/x": 14}


class Robot:
    """A client of a robot program that is dead once its stream was read."""

    found = SimpleNamespace(label="arm")
    missed = 2

    def __init__(self):
        self.asked, self.closed, self.dead = [], 0, False
        self.parameters = SimpleNamespace(described=lambda: ["gain"])

    def __enter__(self):
        self.dead = False
        return self

    def __exit__(self, *_):
        pass

    def on_event(self, callback):
        pass

    def status(self):
        state = State.DEAD if self.dead else State.RUNNING
        return SimpleNamespace(state=state, reason="it died", revision=1)

    def table(self):
        on, off = SimpleNamespace(enabled=True), SimpleNamespace(enabled=False)
        infos = [SimpleNamespace(name="/log/off", options=off), SimpleNamespace(name="/log/x", options=on)]
        return SimpleNamespace(revision=1, elements=infos, derived=[])

    def stream(self, names, period_s):
        self.asked.append(names)
        return self

    def read(self, timeout_s):
        self.dead = True

    def close(self):
        self.closed += 1


class Refusing(Robot):
    """A client that refuses all streams but the first; of that one comes a row whenever it is read."""

    def __init__(self, feed):
        super().__init__()
        self.feed, self.reads = feed, 0

    def stream(self, names, period_s):
        self.asked.append(names)
        if len(self.asked) > 1:
            raise RefusedError("8 streams are open already")
        return self

    def read(self, timeout_s):
        self.reads += 1
        self.feed.wish(frozenset({"/log/x", "/log/y"}))


def test_a_stream_goes_on_while_another_one_is_refused(monkeypatch):
    monkeypatch.setattr("silo.bridges.feed.TABLE_PERIOD_S", 10 * PERIOD_S)
    told = []
    feed = LoggerFollower(lambda: None, SimpleNamespace(told=told.append, parameters=lambda known: None))
    robot = Refusing(feed)
    feed._table = [SimpleNamespace(name=f"/log/{name}", options=SimpleNamespace(enabled=True)) for name in "xy"]
    feed.wish(frozenset({"/log/x"}))
    for _ in range(3):
        feed._read(robot)
    assert robot.asked == [["/log/x"], *[["/log/x", "/log/y"]] * 3], "one try each round"
    assert (robot.reads, robot.closed, told) == (30, 0, ["8 streams are open already"])


def test_once_a_robot_is_gone_nothing_of_it_is_left_and_why_is_told_once_until_it_is_there_again(monkeypatch):
    monkeypatch.setattr("silo.bridges.feed.TABLE_PERIOD_S", 0.01)
    robot, told, over = Robot(), [], threading.Event()
    ways = ["", "gone", "gone", "refused", "", "it died"]

    def connect():
        if not ways:
            over.set()
        why = ways.pop(0) if ways else "it died"
        if why:
            raise ConnectionLostError(why)
        return robot

    listener = SimpleNamespace(
        table=lambda label, elements: told.append((label, len(elements))),
        parameters=lambda known: told.append(list(known)),
        told=told.append,
    )
    feed = LoggerFollower(connect, listener)
    feed.wish(frozenset({"/log/x", "/log/off"}))
    feed.start()
    try:
        assert over.wait(DEADLINE_S)
    finally:
        feed.close()
    there = [("arm", 2), ["gain"], "it died", ("", 0), []]
    assert told == [*there, "gone", "refused", *there]
    assert (robot.asked, robot.closed, feed.missed) == ([["/log/x"]] * 2, 2, 4)


class Wishless(Robot):
    """A client of which nothing is wished for any more once a sample came."""

    def __init__(self):
        super().__init__()
        self.looks = 0

    def status(self):
        self.looks += 1
        return super().status()

    def read(self, timeout_s):
        self.feed.wish(frozenset())


def test_a_feed_of_which_nothing_is_wished_is_woken_by_the_next_wish_and_by_its_end(monkeypatch):
    monkeypatch.setattr("silo.bridges.feed.TABLE_PERIOD_S", 1e6)
    robot = Wishless()
    ignored = {"table": lambda *_: None, "parameters": lambda _: None}
    robot.feed = feed = LoggerFollower(lambda: robot, SimpleNamespace(**ignored))
    feed.start()
    wait_until(lambda: robot.looks == 1)
    feed.wish(frozenset({"/log/x"}))
    wait_until(lambda: robot.looks == 3)  # it waits again
    assert (robot.asked, robot.closed) == ([["/log/x"]], 1)
    closing = threading.Thread(target=feed.close, daemon=True)
    closing.start()
    closing.join(DEADLINE_S)
    assert not closing.is_alive()


@pytest.mark.parametrize("fails", [False, True])
def test_what_ros_did_not_get_is_told_once_and_a_batch_is_taken_whatever_fails(fails):
    def publish(time_ns, message):
        if fails:
            raise ConnectionLostError("the session ended")

    pairing = SimpleNamespace(unpaired=2)
    topic = SimpleNamespace(
        messages=lambda batch: [(1, b"")], publish=publish, pairing=pairing, outlet=SimpleNamespace(topic="/bot/pose")
    )
    told, taken = [], []
    unpaired = SimpleNamespace(**{**vars(topic), "pairing": None})
    node = SimpleNamespace(_topics={"pose": topic, "x": unpaired}, _tell=told.append)
    batch = {"/log/x": SimpleNamespace(missed=3), "/log/y": SimpleNamespace(missed=0)}
    for _ in range(2):
        with pytest.raises(ConnectionLostError) if fails else contextlib.nullcontext():
            Graph._deliver(node, batch, lambda: taken.append(1))
    left_out = "2 ticks of /bot/pose left out: not all had them"
    lost = "3 samples of /log/x lost on the way to the bridge"
    assert (told, taken) == ([] if fails else [left_out, lost, lost], [1, 1])


@pytest.mark.parametrize(
    ("what", "text", "told"),
    [
        ("/bot/kp", "done", "/bot/kp, set by somebody: done"),
        ("a\n/bot/kp, set by others", "no\x1b[2J", "a\\x0a/bot/kp, set by others, set by somebody: no\\x1b[2J"),
        ("n" * 301, "t" * 301, f"{'n' * 300}... (301 letters), set by somebody: {'t' * 300}..."),
    ],
)
def test_who_calls_a_bridge_has_one_line_in_what_it_tells(what, text, told):
    assert audit(what, "set", "somebody", text) == told


def test_a_flood_of_what_is_refused_is_a_few_lines_and_all_that_is_done_is_told(monkeypatch):
    now_s = 0.0
    monkeypatch.setattr(services, "Denials", lambda: Denials(lambda: now_s))
    told: list[str] = []
    audited = Audit(told.append)
    for _ in range(1000):
        audited.note("/bot/kp", "set", "somebody", "read-only", done=False)
    for number in range(3):
        audited.note("/bot/save", "called", "somebody", f"saved {number}", done=True)
    first = "/bot/kp, set by somebody: read-only"
    assert told == [first, *(f"/bot/save, called by somebody: saved {number}" for number in range(3))]
    told.clear()
    audited.watch()
    now_s = 61.0
    audited.watch()
    assert told == [f"{first}, 999 more in 61 s"]
    told.clear()
    for number in range(1000):  # each another one
        audited.note(f"/bot/{number}", "set", "somebody", "read-only", done=False)
    assert len(told) == 32  # those of its kind, and one line of several others
