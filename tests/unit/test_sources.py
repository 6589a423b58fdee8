"""What can be logged, and that what is logged is what stands in memory at that tick: by reference or by expression."""

import array
import ctypes
import datetime
import enum
import logging
import mmap
import os

import numpy as np
import pytest

from silo.collecting.run import addresses_work
from silo.errors import ElementError, SourceError


class Robot:
    """A bag of attributes."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


class Mode(enum.Enum):
    IDLE = "idle"
    WALK = "walk"


class Fault(enum.Flag):
    HOT = 1
    STALL = 2


@pytest.fixture
def logged(new_logger):
    """Logs a source: `logged(source, change, ...)` collects, calls `change`, collects, and returns all entries."""

    def log(source, *changes, **options):
        logger = new_logger()
        logger.add(source, options.pop("name", "x"), **options)
        logger.start()
        logger.collect()
        for change in changes:
            change()
            logger.collect()
        log.logger = logger
        (element,) = logger.snapshot().elements
        return [entry.values.tolist() for entry in element.entries]

    return log


# -------------------------------------------------------------------------------------------------- by reference


def test_an_array_is_logged_by_reference(logged):
    x = np.array([1.0, 2.0])

    def change():
        x[1] = 5.0

    assert logged(x, change) == [[1.0, 1.0], [2.0, 5.0]]


@pytest.mark.parametrize(
    "value", [np.nan, np.inf, -np.inf, -0.0, 5e-324, np.frombuffer(b"\1\0\0\0\0\0\xf0\x7f", "<f8")[0]]
)
def test_every_bit_of_a_float_passes(logged, new_logger, value):
    x = np.array([value])
    logger = new_logger()
    logger.add(x, "x")
    logger.start()
    logger.collect()
    assert logger.snapshot().elements[0].entries[0].values.tobytes() == x.tobytes()


def test_a_ctypes_number_is_logged_by_reference(logged):
    x = ctypes.c_int16(7)

    def change():
        x.value = -3

    assert logged(x, change) == [[7, -3]]


def test_a_ctypes_structure_is_logged_field_by_field(logged):
    class State(ctypes.Structure):
        _fields_ = [("id", ctypes.c_uint8), ("q", ctypes.c_double * 2), ("ok", ctypes.c_bool)]

    state = State(3, (1.5, 2.5), True)

    def change():
        state.q[1] = 9.0

    assert logged(state, change) == [[3, 3], [1.5, 1.5], [2.5, 9.0], [True, True]]


def test_a_packed_ctypes_structure_is_read_at_its_odd_addresses(logged):
    class State(ctypes.Structure):
        _pack_ = 1
        _fields_ = [("id", ctypes.c_uint8), ("x", ctypes.c_double), ("n", ctypes.c_int32)]

    assert logged(State(3, 1.5, -4)) == [[3], [1.5], [-4]]


def test_a_big_endian_ctypes_structure_is_logged(logged):
    class State(ctypes.BigEndianStructure):
        _fields_ = [("x", ctypes.c_double), ("n", ctypes.c_int32)]

    assert logged(State(1.5, -4)) == [[1.5], [-4]]


def test_both_views_of_a_ctypes_union_are_logged(logged):
    class Word(ctypes.Union):
        _fields_ = [("number", ctypes.c_uint32), ("bytes", ctypes.c_uint8 * 2)]

    assert logged(Word(0x0201)) == [[0x0201], [1], [2]]


def test_a_field_of_a_ctypes_structure_is_logged_by_its_address(logged):
    class State(ctypes.Structure):
        _fields_ = [("id", ctypes.c_uint8), ("x", ctypes.c_double)]

    state = State(3, 1.5)
    field = ctypes.c_double.from_buffer(state, State.x.offset)

    def change():
        state.x = 2.5

    assert logged(field, change) == [[1.5, 2.5]]


def test_an_array_array_is_logged_by_reference(logged):
    x = array.array("f", [1.0, 2.0])

    def change():
        x[0] = 8.0

    assert logged(x, change) == [[1.0, 8.0], [2.0, 2.0]]


def test_a_memoryview_is_logged_with_its_strides(logged):
    raw = bytearray(range(8))
    assert logged(memoryview(raw)[1::3]) == [[1], [4], [7]]


def test_a_bytearray_is_logged_as_bytes(logged):
    assert logged(bytearray(b"\1\2")) == [[1], [2]]


def test_mapped_memory_is_logged(logged):
    memory = mmap.mmap(-1, 4096)
    memory[:4] = b"\1\0\0\0"
    assert logged(np.frombuffer(memory, "<i4", 1)) == [[1]]


def test_the_last_bytes_before_unmapped_memory_can_be_logged(logged):
    memory = mmap.mmap(-1, mmap.PAGESIZE)
    assert logged(np.frombuffer(memory, np.uint8)[-3:]) == [[0], [0], [0]]


def test_an_object_that_offers_its_memory_is_logged(logged):
    class Device:
        def __init__(self):
            self.memory = np.array([4.0])
            self.__array_interface__ = self.memory.__array_interface__

    assert logged(Device()) == [[4.0]]


def test_a_read_only_array_is_logged(logged):
    x = np.array([1.0])
    x.setflags(write=False)
    assert logged(x) == [[1.0]]


def test_an_array_of_a_subclass_is_logged(logged):
    assert logged(np.rec.array([(1.0, 2)], dtype=[("a", "f8"), ("b", "i4")])) == [[1.0], [2]]


def test_a_masked_array_is_logged_as_its_data(logged):
    assert logged(np.ma.masked_array([1.0, 2.0], [True, False])) == [[1.0], [2.0]]


@pytest.mark.parametrize("dtype", [">f8", ">i4", ">U3", ">M8[ns]", "S7", "U2", "f2"])
def test_no_type_makes_silo_give_up_reading_by_address(new_logger, dtype):
    logger = new_logger()
    logger.add(np.ones(2, dtype), "x")
    logger.start()
    assert addresses_work(logger.present_run.plan)
    assert logger.present_run.plan.references


def test_text_keeps_its_zeros_out_of_the_log(logged):
    x = np.array([b"ab"], "S5")

    def change():
        x[0] = b"longer than five"

    assert logged(x, change) == [[b"ab", b"longe"]]


# ------------------------------------------------------------------------------------------- memory that stays


def test_resizing_a_logged_array_raises_instead_of_freeing_its_memory(new_logger):
    x = np.zeros(1000)
    new_logger().add(x, "x", kind="array")
    with pytest.raises(ValueError, match="cannot resize"):
        x.resize(2_000_000, refcheck=False)


def test_resizing_the_base_of_a_logged_view_raises(new_logger):
    base = np.zeros(1000)
    new_logger().add(base[::2][:3], "x")
    with pytest.raises(ValueError, match="cannot resize"):
        base.resize(2_000_000, refcheck=False)


@pytest.mark.parametrize("source", [array.array("d", [1.0, 2.0]), bytearray(b"abc")])
def test_a_logged_buffer_can_not_grow(new_logger, source):
    new_logger().add(source, "x")
    with pytest.raises(BufferError):
        source.extend(source)


def test_a_logged_memory_map_can_not_be_closed(new_logger):
    memory = mmap.mmap(-1, 4096)
    new_logger().add(memory, "x")
    with pytest.raises(BufferError):
        memory.close()


def test_a_closed_logger_lets_go_of_the_memory(new_logger):
    memory = mmap.mmap(-1, 4096)
    logger = new_logger()
    logger.add(np.frombuffer(memory, "<i4", 1), "x")
    logger.start()
    logger.close()
    memory.close()
    assert memory.closed


def test_an_array_that_the_program_forgot_is_still_readable(logged):
    def make():
        return np.array([4.0, 2.0])

    assert logged(make()) == [[4.0], [2.0]]


# ------------------------------------------------------------------------------------------- assigned anew


def warnings_of(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def test_an_array_that_was_assigned_anew_is_warned_of_at_start(new_logger, caplog):
    robot = Robot(x=np.zeros(3))
    logger = new_logger()
    logger.add(robot.x, "x")
    robot.x = robot.x + 1
    logger.start()
    (warning,) = warnings_of(caplog)
    assert warning.startswith("/log/x: only the logger refers to this array any more")


def test_a_column_of_an_array_that_was_assigned_anew_is_warned_of(new_logger, caplog):
    robot = Robot(x=np.zeros((3, 3)))
    logger = new_logger()
    logger.add(robot.x[:, 1], "x")
    logger.add(robot.x[0], "y")
    robot.x = robot.x + 1
    logger.start()
    assert len(warnings_of(caplog)) == 2


@pytest.mark.parametrize(
    "make",
    [
        lambda owner: owner.setdefault("x", np.zeros(3)),
        lambda owner: owner.setdefault("x", np.zeros((4, 3)))[1],
        lambda owner: owner.setdefault("view", np.arange(4.0).reshape(2, 2)),
        lambda owner: owner.setdefault("x", np.ma.masked_array([1.0, 2.0], [True, False])),
        lambda owner: memoryview(owner.setdefault("x", np.zeros(3))),
        lambda owner: np.asarray(owner.setdefault("x", (ctypes.c_double * 3)())),
        lambda owner: [owner.setdefault("x", np.zeros(1)), owner.setdefault("y", np.zeros(1))],
    ],
)
def test_an_array_that_the_program_still_has_is_not_warned_of(new_logger, caplog, make):
    owner = {}
    logger = new_logger()
    logger.add(make(owner), "x")
    logger.start()
    assert warnings_of(caplog) == []


def test_an_array_logged_twice_is_not_warned_of(new_logger, caplog):
    x = np.zeros(2)
    logger = new_logger()
    logger.add(x, "a")
    logger.add(x, "b")
    logger.start()
    assert warnings_of(caplog) == []


def test_a_variable_in_silos_own_memory_is_not_warned_of(new_logger, caplog):
    logger = new_logger()
    logger.array("x", 3)
    logger.start()
    assert warnings_of(caplog) == []


def test_a_disabled_element_is_not_warned_of(new_logger, caplog):
    logger = new_logger()
    logger.add(np.zeros(2), "x", enabled=False)
    logger.start()
    assert warnings_of(caplog) == []


# ------------------------------------------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (1.5, r"a float is a value, not a variable.*log\.array\(\"x\", \.\.\.\).*attr=\"x\""),
        (3, "an? int is a value"),
        (True, "a bool is a value"),
        (np.float64(2), "a float64 is a value"),
        ("text", "a str is a value"),
        (Mode.IDLE, "a Mode is a value"),
        ([1.0, 2.0], r"a list of plain values.*np\.array"),
        ((1, 2), "a tuple of plain values"),
        (np.array([None, 1]), "array of Python objects"),
        (np.zeros(0), r"shape \(0,\) holds no value"),
        (np.zeros((3, 0)), "holds no value"),
        (np.zeros(2, "V8"), "bytes without a meaning"),
        (object(), r"don't know how to log a object.*silo\.register"),
        ((ctypes.py_object * 2)(), "can't be logged by reference|no fixed memory"),
    ],
)
def test_what_can_not_be_referred_to_is_refused_with_what_to_write(new_logger, source, words):
    with pytest.raises((SourceError, ElementError), match=words):
        new_logger().add(source, "x")


def test_a_refusal_is_a_type_error():
    assert issubclass(SourceError, TypeError)


def test_a_ctypes_structure_with_bit_fields_is_refused(new_logger):
    class Bits(ctypes.Structure):
        _fields_ = [("a", ctypes.c_uint, 3)]

    with pytest.raises(SourceError, match="Bits can't be logged by reference"):
        new_logger().add(Bits(), "x")


def test_an_element_needs_a_name(new_logger):
    with pytest.raises(ElementError, match="give the element a name"):
        new_logger().add(np.zeros(1))


def test_an_attribute_is_named_after_itself(new_logger):
    logger = new_logger()
    logger.add(Robot(arm=Robot(speed=1.0)), attr="arm.speed")
    logger.update()
    assert logger.elements[0].name == "/log/speed"


def test_a_function_is_named_after_itself(new_logger):
    def load():
        return 1.0

    logger = new_logger()
    logger.add(load)
    logger.update()
    assert logger.elements[0].name == "/log/load"


# --------------------------------------------------------------------------------------------------- expressions


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (1.5, 2.5),
        (1.5, 3),
        (7, -9),
        (True, False),
        (1 + 2j, 3j),
        (np.float32(1.5), np.float32(2.5)),
        (np.int8(-3), np.int8(3)),
        (np.uint64(2**64 - 1), np.uint64(1)),
        (np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])),
        ([1, 2], [3, 4]),
        (np.datetime64("2020-01-01T00:00:01.5", "ns"), np.datetime64("2021-01-01", "ns")),
        (np.array([[1, 2], [3, 4]], np.uint8), np.array([[5, 6], [7, 8]], np.uint8)),
    ],
)
def test_an_attribute_is_followed_when_it_is_assigned_anew(logged, first, second):
    robot = Robot(x=first)
    found = logged(robot, lambda: setattr(robot, "x", second), attr="x")
    if isinstance(first, complex):
        assert found == [[first.real, second.real], [first.imag, second.imag]]
    else:
        expected = [np.ravel(first).tolist(), np.ravel(second).tolist()]
        assert found == [list(pair) for pair in zip(*expected, strict=True)]


def test_a_string_attribute_is_logged_as_utf8(logged):
    robot = Robot(x="stand")
    assert logged(robot, lambda: setattr(robot, "x", "läuft"), attr="x") == [[b"stand", "läuft".encode()]]


def test_a_string_attribute_that_was_empty_has_room(logged):
    robot = Robot(x="")
    assert logged(robot, lambda: setattr(robot, "x", "walking"), attr="x") == [[b"", b"walking"]]


def test_a_numpy_string_attribute_has_room_too(logged):
    robot = Robot(x=np.str_("a"))
    assert logged(robot, lambda: setattr(robot, "x", np.str_("walking")), attr="x") == [[b"a", b"walking"]]


def test_a_string_is_cut_at_its_room(logged):
    robot = Robot(x="")
    assert logged(robot, lambda: setattr(robot, "x", "walking"), attr="x", string_bytes=4) == [[b"", b"walk"]]


def test_an_enumeration_attribute_is_logged_as_its_number(logged):
    robot = Robot(x=Mode.IDLE)
    assert logged(robot, lambda: setattr(robot, "x", Mode.WALK), attr="x") == [[0, 1]]


def test_combined_flags_are_logged_as_their_bits(logged):
    robot = Robot(x=Fault.HOT)
    assert logged(robot, lambda: setattr(robot, "x", Fault.HOT | Fault.STALL), attr="x") == [[1, 3]]


def test_a_time_with_a_zone_is_logged_in_utc(logged):
    zone = datetime.timezone(datetime.timedelta(hours=2))
    robot = Robot(x=datetime.datetime(2020, 1, 1, 2, 0, 0, 5, tzinfo=zone))
    assert logged(robot, attr="x") == [[datetime.datetime(2020, 1, 1, 0, 0, 0, 5)]]


def test_a_date_and_a_duration_are_logged(logged):
    assert logged(Robot(x=datetime.date(2020, 1, 2)), attr="x") == [[datetime.datetime(2020, 1, 2)]]
    assert logged(Robot(x=datetime.timedelta(milliseconds=5)), attr="x") == [[datetime.timedelta(milliseconds=5)]]


def test_a_dotted_path_is_followed_at_every_step(logged):
    robot = Robot(arm=Robot(speed=1.0))
    assert logged(robot, lambda: setattr(robot, "arm", Robot(speed=2.0)), attr="arm.speed") == [[1.0, 2.0]]


def test_a_property_is_read_each_tick(logged):
    class Sensor:
        count = 0.0

        @property
        def value(self):
            self.count += 1
            return self.count

    found = logged(Sensor(), lambda: None, attr="value")
    assert found[0][1] == found[0][0] + 1


def test_a_function_is_called_each_due_tick(new_logger):
    calls = []

    def load():
        calls.append(1)
        return float(len(calls))

    logger = new_logger()
    logger.add(load, divider=3)
    logger.start()
    before = len(calls)
    for _ in range(7):
        logger.collect()
    assert len(calls) - before == 3


def test_a_function_with_several_results_is_called_once_per_tick(new_logger):
    robot = Robot(count=0)

    def state():
        robot.count += 1
        return {"a": float(robot.count), "b": robot.count, "c": np.full(2, robot.count), "d": [robot.count] * 2}

    logger = new_logger()
    logger.add(state)
    logger.start()
    before = robot.count
    for _ in range(5):
        logger.collect()
    found = [entry.values.tolist() for entry in logger.snapshot().elements[0].entries]
    assert found == [list(range(before + 1, before + 6))] * 6


def test_attributes_of_every_kind_stand_side_by_side_in_one_tick(new_logger):
    robot = Robot(a=1.5, b=2, c=True, d="text", e=np.float32(2.5), f=np.uint8(200), g=b"raw", h=np.arange(3), i=1j)
    logger = new_logger()
    for name in vars(robot):
        logger.add(robot, attr=name)
    logger.start()
    logger.collect()
    found = [entry.values[0] for element in logger.snapshot().elements for entry in element.entries]
    assert found == [1.5, 2, True, b"text", 2.5, 200, b"raw", 0, 1, 2, 0.0, 1.0]


# ----------------------------------------------------------------------------------------------- what fails


def test_a_float_that_can_not_be_read_is_nan_until_it_can_be_read_again(logged):
    robot = Robot(x=1.0)
    found = logged(robot, lambda: delattr(robot, "x"), lambda: setattr(robot, "x", 3.0), attr="x")
    assert np.array_equal(found[0], [1.0, np.nan, 3.0], equal_nan=True)


def test_an_integer_that_can_not_be_read_keeps_its_last_value(logged):
    robot = Robot(x=5)
    assert logged(robot, lambda: delattr(robot, "x"), attr="x") == [[5, 5]]


def test_the_others_are_logged_when_one_can_not_be_read(new_logger):
    robot = Robot(a=1.0, b=1.0, c=1.0)
    logger = new_logger()
    for name in "abc":
        logger.add(robot, attr=name)
    logger.start()
    logger.collect()
    del robot.b
    robot.a = robot.c = 2.0
    logger.collect()
    assert [e.entries[0].values[-1] for e in logger.snapshot().elements if e.name != "/log/b"] == [2.0, 2.0]


def test_failures_are_counted_per_element(new_logger):
    robot = Robot(x=1.0)
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    del robot.x
    for _ in range(3):
        logger.collect()
    assert logger.source_failures == {"/log/x": 3}


def test_a_failure_is_said_once(new_logger, caplog):
    robot = Robot(x=1.0)
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    del robot.x
    for _ in range(3):
        logger.collect()
    (warning,) = warnings_of(caplog)
    assert "/log/x: reading Robot.x failed (AttributeError" in warning


def test_an_integer_attribute_that_becomes_a_float_is_not_cut_silently(logged, caplog):
    robot = Robot(x=0)
    assert logged(robot, lambda: setattr(robot, "x", 0.5), attr="x") == [[0, 0]]
    assert logged.logger.source_failures == {"/log/x": 1}
    assert "0.5 would be cut to an integer" in warnings_of(caplog)[0]


def test_an_integer_array_that_becomes_floats_is_not_cut_silently(logged):
    robot = Robot(x=np.array([1, 2]))
    assert logged(robot, lambda: setattr(robot, "x", np.array([0.5, 1.5])), attr="x") == [[1, 1], [2, 2]]
    assert logged.logger.source_failures == {"/log/x": 1}


def test_a_number_too_large_for_its_type_is_a_failure(logged):
    robot = Robot(x=5)
    logged(robot, lambda: setattr(robot, "x", 2**80), attr="x")
    assert logged.logger.source_failures == {"/log/x": 1}


def test_an_array_that_changes_its_shape_is_a_failure(logged):
    robot = Robot(x=np.zeros(3))
    logged(robot, lambda: setattr(robot, "x", np.zeros(4)), attr="x")
    assert logged.logger.source_failures == {"/log/x": 1}


def test_a_value_without_a_type_is_refused(new_logger):
    with pytest.raises(SourceError, match=r"the value is None \(NoneType\) now, its type can't be told"):
        new_logger().add(Robot(x=None), attr="x")


def test_a_function_that_fails_is_refused_with_its_reason(new_logger):
    with pytest.raises(SourceError, match=r"reading \(\) failed \(ZeroDivisionError"):
        new_logger().add(lambda: 1 / 0, "x")


# ------------------------------------------------------------------------------------------------ checked copies


def test_when_addresses_do_not_work_variables_are_copied_by_numpy(new_logger, monkeypatch, caplog):
    monkeypatch.setattr("silo.collecting.run.addresses_work", lambda plan: False)
    x = np.array([1.0, 2.0], ">f8")
    logger = new_logger()
    logger.add(x, "x")
    logger.start()
    logger.collect()
    assert [entry.values.tolist() for entry in logger.snapshot().elements[0].entries] == [[1.0], [2.0]]
    assert "falling back to checked=True" in warnings_of(caplog)[0]


def test_the_self_test_finds_an_address_that_is_wrong(new_logger, monkeypatch):
    monkeypatch.setattr("silo.collecting.run._read_words", lambda address, size: os.urandom(size))
    logger = new_logger()
    logger.add(np.array([1.0, 2.0]), "x")
    logger.start()
    assert logger.present_run.plan.references == ()
