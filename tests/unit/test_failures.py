"""What stands in the log where an attribute or function could not be read, and how it is told."""

import datetime
import decimal
import enum
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import silo
from silo.core.elements import BufferType
from silo.core.recording import Failures, failures_text
from silo.errors import SourceError
from silo.live.newest import NewestValues
from silo.loop.generated_code import SlowReads
from silo.loop.scratch import fitting
from silo.segment.failures import BLOCK_WORDS, read_failures, record_failure
from silo.segment.reader import SegmentReader


class Mode(enum.Enum):
    STAND = 0
    WALK = 1


class Robot:
    x: object = None


@pytest.fixture
def logged(new_logger):
    """Logs the values one after the other as an attribute; returns what stands in the log."""

    def run(values, before=0, **options):
        robot = Robot()
        robot.x = values[0]
        logger = new_logger()
        robot.other = 1.5  # stored in the same stroke: a failure must not change it, nor the first of them
        robot.first = 7
        logger.add(robot, attr="first")
        logger.add(robot, attr="x", **options)
        logger.add(robot, attr="other")
        logger.start()
        for value in values:
            robot.x = value
            logger.collect()
        recording = logger.snapshot()
        run.logger, run.recording = logger, recording
        assert recording.elements[0].entries[0].values.tolist() == [7] * len(values)
        assert recording.elements[2].entries[0].values.tolist() == [1.5] * len(values)
        return recording.elements[1].entries[0].values.tolist()

    return run


@pytest.mark.parametrize(
    ("values", "found", "failures"),
    [
        ([5, 6, 2.5, None, 8], [5, 6, 6, 6, 8], Failures(2, ((2, 3),))),
        ([5, 2**63, -(2**63) - 1, 2**63 - 1], [5, 5, 5, 2**63 - 1], Failures(2, ((1, 2),))),  # beyond 64 bits
        (
            [np.uint8(200), 300, -1, np.int64(256), 255],
            [200, 200, 200, 200, 255],
            Failures(3, ((1, 3),)),
        ),  # not wrapped
        (["walk", None, 5, "stand"], [b"walk", b"walk", b"walk", b"stand"], Failures(2, ((1, 2),))),
        ([Mode.WALK, "WALK", None, Mode.STAND], [1, 1, 1, 0], Failures(2, ((1, 2),))),  # of another enumeration
    ],
)
def test_what_becomes_something_else_holds_its_last_value(logged, values, found, failures):
    assert logged(values) == found
    assert logged.recording.elements[1].failures == failures


@pytest.mark.parametrize("strange", [None, 2.5, 2, "yes", np.nan, [1]])
def test_a_bool_is_true_false_or_held(logged, strange):
    assert logged([True, strange, False, strange, np.bool_(True), 0, 1.0]) == [1, 1, 0, 0, 1, 0, 1]


@pytest.mark.parametrize(
    ("first", "others"),
    [([0.0, 1.0, 2.0], [[7.0], (7.0, 8.0), 7.0, np.ones(1), np.ones((3, 3)), []]), (np.zeros(3), [[7.0], 7.0]),
     (np.zeros((2, 3)), [np.ones(3), np.ones((2, 1)), np.ones((3, 2)), 7.0]),
     (np.zeros(2, np.float32), [np.ones(1, np.float32), 7.0]), (np.zeros(2, "M8[s]"), [np.zeros(1, "M8[s]")])],
)  # fmt: skip
def test_a_value_of_another_shape_is_spread_over_nothing(logged, first, others):
    values = [first, *others, first]
    logged(values)
    entries = logged.recording.elements[1].entries
    rows = np.array([entry.values for entry in entries]).T
    assert np.array_equal(rows[[0, -1]], [np.ravel(first)] * 2)
    assert np.isnat(rows[1:-1]).all() if rows.dtype.kind == "M" else np.isnan(rows[1:-1]).all()
    assert logged.recording.elements[1].failures.count == len(others)


@pytest.mark.parametrize(
    ("first", "other"),
    [(np.zeros(3), [[1.0, 2.0, 3.0]]), (np.zeros((1, 3)), (1.0, 2.0, 3.0)), (np.zeros((2, 1)), np.ones(2)),
     (np.zeros(1), 5.0), (1j, [2j]), (np.float16(1), [2.0])],
)  # fmt: skip
def test_the_same_values_in_other_brackets_are_logged(logged, first, other):
    logged([first, other])
    found = logged.recording.elements[1]
    rows = np.array([entry.values for entry in found.entries]).T
    expected = np.ravel(other).astype(np.asarray(first).dtype)
    expected = [expected[0].real, expected[0].imag] if isinstance(first, complex) else expected.tolist()
    assert (rows[1].tolist(), found.failures.count) == (list(expected), 0)


def test_a_float_is_nan_where_it_could_not_be_read(logged):
    found = logged([1.0, None, "2", 3j, 4, decimal.Decimal("0.5"), 2**80])
    assert np.array_equal(found, [1.0, np.nan, np.nan, np.nan, 4.0, 0.5, 2.0**80], equal_nan=True)
    assert logged.recording.elements[1].failures == Failures(3, ((1, 3),))


@pytest.mark.parametrize("value", [datetime.datetime(2026, 1, 2), datetime.timedelta(seconds=1)])
def test_a_date_or_duration_is_not_a_time_where_it_could_not_be_read(logged, value):
    for strange in ("2026-01-03", 5):
        found = logged([value, None, strange, value])
        assert [one is None for one in found] == [False, True, True, False]


@pytest.mark.parametrize("dtype", ["i4", "u1", "i8"])
def test_an_array_of_integers_holds_what_it_was(new_logger, dtype):
    robot = Robot()
    robot.x = np.array([1, 2, 3], dtype)
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    for value in (robot.x, [1.5, 2, 3], None, np.array([4, 5]), [7, 8, 9], np.array([2**62, 0, 2**63], "u8")):
        robot.x = value
        logger.collect()
    found = np.stack([entry.values for entry in logger.snapshot().elements[0].entries], axis=1).tolist()
    assert found == [[1, 2, 3]] * 4 + [[7, 8, 9]] * 2


@pytest.mark.parametrize(
    ("first", "then", "logged"),
    [
        (np.zeros(3, bool), np.array([0, 1, 1]), [0, 1, 1]),
        (np.zeros(3, bool), [1, 0, 1.0], [1, 0, 1]),
        (np.zeros(3, bool), np.array([0, 1, 2]), [0, 0, 0]),
        (np.zeros(3, "i4"), np.array([1, 2, 3], "i8"), [1, 2, 3]),
        (np.zeros(3, "i4"), np.array([1, 2, 2**40]), [0, 0, 0]),
        (np.zeros(3, "u1"), [1, 2, 255], [1, 2, 255]),
        (np.zeros(3, "f4"), np.array([1.5, 2.5, 3.5]), [1.5, 2.5, 3.5]),
        (np.zeros(3, "f4"), np.array([1.5, np.inf, -np.inf]), [1.5, np.inf, -np.inf]),
    ],
)
def test_an_array_of_another_type_is_logged_where_its_values_fit(new_logger, first, then, logged):
    robot = Robot()
    robot.x, robot.y = first, 1.0
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.add(robot, attr="y")
    logger.start()
    robot.x = then
    logger.collect()
    x, y = logger.snapshot().elements
    assert [entry.values[-1] for entry in x.entries] == logged
    assert x.failures.count == (logged == [0, 0, 0])
    assert y.entries[0].values.tolist() == [1.0]


@pytest.mark.parametrize(
    "beyond", [1e300, np.float64(1e300), np.array(1e300), 1e300j, np.longdouble("1e300")], ids=repr
)
@pytest.mark.parametrize("dtype", ["f2", "f4", ">f4", "c8", ">c8"])
@pytest.mark.parametrize("shape", [(), (2, 2)])
def test_a_float_that_is_beyond_its_type_is_nan_and_not_infinite(new_logger, dtype, shape, beyond):
    robot = Robot()
    robot.x = np.zeros(shape, dtype) if shape else np.dtype(dtype).type(0)
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    for value in (0.5, beyond, np.inf, beyond, 0.25):
        robot.x = np.array([value] * math.prod(shape)).reshape(shape) if shape else value
        logger.collect()
    (element,) = logger.snapshot().elements
    for entry in element.entries[:1]:
        assert entry.values.tolist()[::2] == [0.5, np.inf, 0.25]
    assert all(np.isnan(entry.values[1::2]).all() for entry in element.entries)
    assert element.failures.count == 2


@pytest.mark.parametrize("strange", [7, 2.0, True, None, ["a"]])
def test_texts_in_an_array_hold_what_they_were(new_logger, strange):
    robot = Robot()
    robot.x = np.array(["ab", "cd"])
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    logger.collect()
    robot.x = strange if strange == ["a"] else [strange, strange]
    logger.collect()
    (element,) = logger.snapshot().elements
    found = [entry.values[-1] for entry in element.entries]
    assert found == ["ab", "cd"]


def test_what_could_not_be_read_is_told_in_words_of_the_program(logged, caplog):
    logged([5, None])
    assert "reading Robot.x failed (TypeError: the value is None); it is logged as its last value" in caplog.text


def test_the_other_parts_of_a_struct_go_on(new_logger):
    @dataclass
    class State:
        a: float = 1.0
        b: int = 1
        c: float = 1.0

    state = State()
    logger = new_logger()
    logger.add(state, "state")
    logger.start()
    for k in range(4):
        state.a, state.b, state.c = float(k), (None if k in (1, 2) else k), -float(k)
        logger.collect()
    (element,) = logger.snapshot().elements
    assert [entry.values.tolist() for entry in element.entries] == [[0, 1, 2, 3], [0, 0, 0, 3], [0, -1, -2, -3]]
    assert element.failures == Failures(2, ((1, 2),))


@pytest.mark.parametrize("kind", list(BufferType))
@pytest.mark.parametrize("divider", [1, 3])
def test_the_last_value_is_that_of_the_row_before_in_every_buffer(new_logger, kind, divider):
    robot = Robot()
    logger = new_logger(max_time=0)
    robot.x = 0
    logger.add(robot, attr="x", divider=divider, buffer=kind, size=20)
    logger.start()
    for tick in range(45 * divider):
        robot.x = tick if tick // divider % 3 else None
        logger.collect()
    (element,) = logger.snapshot().elements
    ticks = [due if due // divider % 3 else max(due - divider, 0) for due in range(0, 45 * divider, divider)]
    kept = {BufferType.FIXED: ticks[:20], BufferType.LOOPING: ticks[-20:], BufferType.GROWING: ticks}[kind]
    assert element.entries[0].values.tolist() == kept
    failed = 7 if kind is BufferType.FIXED else 15  # a logger of fixed buffers stops by itself when they are full
    assert element.failures.count == failed
    assert logger._present.failures == {"/log/x": failed}
    reader = SegmentReader(logger._present.path)
    seen = {one.info.name: one for one in reader.schema.elements}
    assert NewestValues(reader, [None, seen["/log/x"]], [1, 1]).failed() == {1: failed}  # as a screen has it


def test_a_value_that_failed_from_the_first_tick_is_zero_and_counted(new_logger):
    robot = Robot()
    robot.x = 5
    logger = new_logger()
    logger.add(robot, attr="x")
    robot.x = None
    logger.start()
    logger.collect()
    (element,) = logger.snapshot().elements
    assert (element.entries[0].values.tolist(), element.failures) == ([0], Failures(1, ((0, 0),)))


def test_what_failed_is_among_the_warnings_of_a_recording(logged):
    logged([5, None, 6, None, 7])
    text = "/log/x: could not be read at 2 ticks (1, 3): NaN, or its last value, stands there instead"
    assert text in logged.recording.warnings


def test_a_checked_logger_counts_its_failures_too(new_logger):
    robot = Robot()
    robot.x = 5
    logger = new_logger(checked=True)
    logger.add(robot, attr="x")
    logger.array("y", 2)
    logger.start()
    robot.x = None
    logger.collect()
    assert logger._present.failures == {"/log/x": 1}


@pytest.mark.parametrize(
    ("value", "options", "words"),
    [
        *((value, {}, "doesn't fit into 64 bits") for value in (2**63, -(2**63) - 1, 2**200)),
        (enum.Enum("Big", {"A": 1, "B": 2**70}).A, {}, "doesn't fit into 64 bits"),
        ("walking", {"string_bytes": 4}, "'walking' takes 7 bytes, string_bytes is 4: raise it"),
    ],
)
def test_what_does_not_fit_is_refused_when_it_is_added(new_logger, value, options, words):
    robot = Robot()
    robot.x = value
    with pytest.raises(SourceError, match=words):
        new_logger().add(robot, attr="x", **options)


# ----------------------------------------------------------------------------------------------- the pure rules


@given(st.lists(st.booleans(), max_size=80), st.integers(1, 4))
def test_stretches_tell_every_failed_tick_until_there_are_too_many(failed, divider):
    words = memoryview(bytearray(8 * BLOCK_WORDS)).cast("l")
    ticks = [divider * place for place, bad in enumerate(failed) if bad]
    for tick in ticks:
        record_failure(words, 0, tick, divider)
        record_failure(words, 0, tick, divider)  # a tick that was taken back and done again counts once
    found = read_failures(words.tolist())
    told = [tick for first, last in found.spans for tick in range(first, last + 1, divider)]
    assert found.count == len(ticks)
    assert set(told) <= set(ticks)
    assert told == sorted(told)
    if len(found.spans) < 15:
        assert told == ticks
    elif ticks:
        assert (told[0], told[-1]) == (ticks[0], ticks[-1])


@given(st.integers(-(2**70), 2**70), st.sampled_from(["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]))
def test_an_integer_fits_where_its_type_can_hold_it(value, dtype):
    info = np.iinfo(dtype)
    if info.min <= value <= info.max:
        assert fitting(value, np.dtype(dtype)) == value
    else:
        with pytest.raises(OverflowError):
            fitting(value, np.dtype(dtype))


def test_many_stretches_are_shortened_in_words():
    spans = tuple((k, k + k % 2) for k in range(0, 30, 3))
    text = "could not be read at 20 ticks (0, 3-4, 6, 9-10, 12, ...): NaN, or its last value, stands there instead"
    assert failures_text(Failures(20, spans)) == text


def test_where_a_failing_element_stands_in_its_rows_is_looked_for_once(new_logger, monkeypatch):
    looked = []
    columns_of = SlowReads._columns_of
    monkeypatch.setattr(SlowReads, "_columns_of", lambda self, slot: looked.append(slot.name) or columns_of(self, slot))
    robot, logger = Robot(), new_logger()
    robot.mode, robot.load = 1, 0.5
    logger.add(robot, attr="mode")
    logger.add(robot, attr="load")
    logger.start()
    logger.collect()
    robot.mode = robot.load = None
    for _ in range(5):
        logger.collect()
    assert looked == ["/log/mode"]  # NaN needs no last value
    assert silo.Log(logger.snapshot())["mode"].values.tolist() == [1] * 6
