"""Rules of samples and pins without a helper process: continuations, bounds, leases, and what streams send."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import silo
from silo.core.elements import Action, BufferType, LoggerOptions, Table
from silo.core.names import Names
from silo.history import pins as pins_module
from silo.history.arrays import Gathering
from silo.history.pins import LEASE_S, Pins
from silo.history.requests import By, GetSamples, OpenPin, SampleRows
from silo.history.samples import check_samples, samples
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, answered
from silo.segment.reader import SegmentReader
from silo.state.replica import LoggerSnapshot
from tests.examples import examples

NAMES = ["/log/a", "/log/b", "/log/b_y", "/log/c", "/log/d", "/log/e"]


class Robot:
    """A logger without helper process, its segment and its table as a helper process sees them."""

    def __init__(self, folder, name="rules"):
        self.now_ns = 0
        self.logger = silo.Logger(name, frequency=1000, max_time=0, folder=folder, clock=lambda: self.now_ns)
        self.a, self.b = np.zeros((), np.int64), np.zeros(3, np.float32)
        self.c = np.zeros((), np.dtype([("x", ">i2"), ("y", "<f8")]))
        self.logger.add(self.a, "a", buffer=BufferType.LOOPING, size=200)
        self.logger.add(self.b, "b", buffer=BufferType.GROWING, size=50, divider=3)
        self.logger.add(self.c, "c", buffer=BufferType.FIXED, size=40, action=Action.SAVE_AND_PUBLISH)
        self.logger.add(self.a, "d", buffer=BufferType.FIXED, size=70)
        # the ring in which its samples pass is that of `c`, of which it has all rows and `c` those after its own
        self.logger.add(self.a, "e", buffer=BufferType.LOOPING, size=30, action=Action.SAVE_AND_PUBLISH)
        self.logger.start()
        self.ticks(700)
        self.reader = SegmentReader(self.logger._present.run.segment.path)
        table = Table(1, list(self.logger.elements))
        self.now = LoggerSnapshot(None, LoggerOptions(), table, Names.of(table.elements, "/log"), 0, b"", 1)

    def ticks(self, count):
        for _ in range(count):
            self.a[...] += 1
            self.b[...] = self.a
            self.c["x"], self.c["y"] = self.a % 1000, self.a
            self.now_ns += 1_000_000
            self.logger.collect()


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    made = Robot(tmp_path_factory.mktemp("rules"))
    yield made
    made.logger.close()


def gathered(robot, request, sizes=None, source=None):
    """The samples of all replies; `sizes` are what each of them may hold."""
    found = Gathering(request.names)
    for size in itertools.chain(sizes or [], itertools.repeat(4096)):
        reply = samples(request, robot.now, source or robot.reader)
        assert isinstance(reply, SampleRows), reply
        assert sum(len(rows.data) for rows in reply.rows) <= request.reply_bytes
        found.take(reply)
        if all(row >= end for row, end in reply.resume):
            return found.samples()
        request = GetSamples(
            names=request.names, reply_bytes=size, run=reply.run, resume=reply.resume, by=request.by
        )  # fmt: skip
    return None


@given(
    names=st.lists(st.sampled_from(NAMES), min_size=1, max_size=5, unique=True),
    by=st.sampled_from([By.TICK, By.TIME]),
    start=st.integers(0, 720),
    count=st.integers(0, 720),
    sizes=st.lists(st.integers(4096, 9000), max_size=6),
)
@settings(max_examples=examples(60))
def test_samples_over_any_continuations_are_the_whole(robot, names, by, start, count, sizes):
    unit = 1_000_000 if by is By.TIME else 1
    first = 1 if by is By.TIME else 0  # the first time stamp is that of 1 ms
    wish = GetSamples(names=names, start=(start + first) * unit, end=(start + count + first) * unit, by=by)
    pieces = gathered(robot, GetSamples(names=names, start=wish.start, end=wish.end, by=by, reply_bytes=4096), sizes)
    whole = gathered(robot, wish)
    for name in names:
        np.testing.assert_array_equal(pieces[name].ticks, whole[name].ticks)
        np.testing.assert_array_equal(pieces[name].values, whole[name].values)
        ticks = whole[name].ticks
        assert ((ticks >= start) & (ticks < start + count)).all()
        values = whole[name].values
        if name == "/log/c":
            np.testing.assert_array_equal(values["_y"], ticks + 1)
            np.testing.assert_array_equal(values["_x"], (ticks + 1) % 1000)
        else:
            np.testing.assert_array_equal(values[:, 0] if values.ndim > 1 else values, ticks + 1)


def test_what_a_full_buffer_lacks_is_in_the_ring_that_passes_all(robot):
    ticks = gathered(robot, GetSamples(names=["/log/c"]))["/log/c"].ticks
    assert ticks.tolist() == list(range(700))
    assert gathered(robot, GetSamples(names=["/log/d"]))["/log/d"].ticks.tolist() == list(range(70))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"names": []}, "1 to 10000 names, got 0"), ({"reply_bytes": 1}, "reply_bytes must be 4096"),
        ({"reply_bytes": 2**30}, "reply_bytes must be 4096"), ({"start": 5, "end": 4}, "goes backwards"),
        ({"end": 2**63 - 1}, "out of range"), ({"resume": [(0, 1)]}, "names the run"),
        ({"resume": [(-1, 1)], "run": "x"}, "none of our replies"),
    ],
)  # fmt: skip
def test_a_wish_that_makes_no_sense_is_refused_in_words(wrong, words):
    refused = answered(lambda: check_samples(GetSamples(**{"names": ["/log/a"], **wrong})))
    assert refused.why is RefusedWhy.INVALID
    assert words in refused.text


@pytest.mark.parametrize("name", ["a", "b_y", "/b", "log/c", "b"])
def test_a_name_means_what_it_means_to_topics_and_stands_as_it_was_asked(robot, name):
    whole = f"/log/{name.rpartition('/')[2]}"
    found, expected = (gathered(robot, GetSamples(names=[one]))[one] for one in (name, whole))
    np.testing.assert_array_equal(found.values, expected.values)
    np.testing.assert_array_equal(found.ticks, expected.ticks)


@pytest.mark.parametrize(
    ("start", "end", "by", "why"),
    [
        (0, 100, By.TICK, "it was overwritten: it is kept from tick {oldest} on"),
        (0, 100 * 10**6, By.TIME, "it was overwritten: it is kept from tick {oldest} on"),
        (0, 100, By.ROW, "it was overwritten: it is kept from tick {oldest} on"),
        (900, 1000, By.TICK, "no sample of it lies there: it is kept from tick {oldest} to 699"),
        (690, 1000, By.TICK, ""),
    ],
)
def test_of_a_span_without_samples_it_is_told_why(robot, start, end, by, why):
    oldest = int(gathered(robot, GetSamples(names=["/log/a"]))["/log/a"].ticks[0])
    found = gathered(robot, GetSamples(names=["/log/a"], start=start, end=end, by=by))["/log/a"]
    assert (found.why, bool(len(found))) == (why.format(oldest=oldest), not why)


def test_a_continuation_of_other_names_is_refused(robot):
    reply = samples(GetSamples(names=["/log/a"], reply_bytes=4096), robot.now, robot.reader)
    other = GetSamples(names=["/log/a", "/log/b"], run=reply.run, resume=reply.resume)
    assert answered(lambda: samples(other, robot.now, robot.reader)).why is RefusedWhy.INVALID


# -------------------------------------------------------------------------------------------------------------- pins


def pin(robot, pins, number=1, names=("/log/a", "/log/b"), start_ns=0, end_ns=2**61):
    return pins.open(OpenPin(pin=f"c{number}-1", names=list(names), start_ns=start_ns, end_ns=end_ns), robot.now,
                     robot.reader)  # fmt: skip


def test_a_pin_holds_what_was_logged_at_these_ticks_while_the_buffers_go_on(tmp_path):
    robot, pins = Robot(tmp_path, "overwriting"), Pins()
    before = gathered(robot, GetSamples(names=NAMES))
    opened = pin(robot, pins, names=NAMES)
    robot.ticks(3000)
    held = gathered(robot, GetSamples(names=NAMES), source=pins.rows(opened.pin))
    for name in NAMES:
        np.testing.assert_array_equal(held[name].ticks, before[name].ticks)
        np.testing.assert_array_equal(held[name].values, before[name].values)
    assert gathered(robot, GetSamples(names=["/log/a"]))["/log/a"].ticks[0] > before["/log/a"].ticks[-1]
    robot.logger.close()


@given(
    names=st.lists(st.sampled_from(NAMES), min_size=1, max_size=len(NAMES), unique=True),
    start=st.integers(0, 720),
    count=st.integers(0, 720),
)
@settings(max_examples=examples(60))
def test_a_pin_of_any_names_over_any_span_has_what_the_buffers_have_of_it(robot, names, start, count):
    pins = Pins()
    span = {"start": start * 1_000_000, "end": (start + count) * 1_000_000}
    opened = pin(robot, pins, names=names, start_ns=span["start"], end_ns=span["end"] - 1 if count else span["start"])
    held = gathered(robot, GetSamples(names=names), source=pins.rows(opened.pin)) if count else {}
    there = gathered(robot, GetSamples(names=names, **span))
    assert opened.missing == {}
    for name in held:
        assert bool(held[name].why) is (len(held[name]) == 0)
        np.testing.assert_array_equal(held[name].ticks, there[name].ticks)
        np.testing.assert_array_equal(held[name].values, there[name].values)


def test_a_lease_that_is_not_renewed_ends_and_frees_its_memory(robot):
    clock = [0.0]
    pins = Pins(clock=lambda: clock[0])
    pin(robot, pins, 1)
    pin(robot, pins, 2)
    clock[0] = LEASE_S - 1
    pins.keep("c1-1", "")
    clock[0] = LEASE_S + 1
    pins.keep("c1-1", "")
    with pytest.raises(RequestRefusedError, match="is no more"):
        pins.keep("c2-1", "")
    refused = answered(lambda: pins.rows("c2-1"))
    assert isinstance(refused, Refused)
    assert refused.why is RefusedWhy.NOT_FOUND


def test_the_same_pin_again_only_renews_its_lease(robot):
    pins = Pins()
    assert pin(robot, pins) is pin(robot, pins)


def test_a_pin_for_which_there_is_too_little_room_holds_the_newest_and_says_so(robot, monkeypatch):
    monkeypatch.setattr(pins_module, "MAX_PINNED_BYTES", 6000)
    opened = pin(robot, Pins(), names=["/log/a"])
    assert "are pinned: more doesn't fit" in opened.text
    assert opened.size_bytes <= 6000
    assert opened.end_ns == robot.reader.last_time_ns


def test_pins_of_all_clients_share_the_room_and_a_refusal_names_what_would_fit(robot, monkeypatch):
    monkeypatch.setattr(pins_module, "MAX_PINNED_BYTES", 14_000)
    pins = Pins()
    first = pin(robot, pins, 1)
    refused = answered(lambda: pin(robot, pins, 2))
    assert isinstance(refused, Refused), refused
    assert "of them would fit, or close other pins" in refused.text
    pins.drop(first.pin)
    assert pin(robot, pins, 2).size_bytes == first.size_bytes


@pytest.mark.parametrize("name", ["", "../x-1", "a-b", "x" * 40 + "-1"])
def test_a_pin_of_a_strange_id_is_refused(robot, name):
    request = OpenPin(pin=name, names=["/log/a"], start_ns=0, end_ns=1)
    assert answered(lambda: Pins().open(request, robot.now, robot.reader)).why is RefusedWhy.INVALID
