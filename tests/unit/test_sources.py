"""Variables by reference: what is logged is what stands in memory at that tick, and what can't be referred to."""

import array
import ctypes
import enum
import mmap
import os

import numpy as np
import pytest

from silo.errors import ElementError, SourceError
from silo.loop import run
from silo.loop.run import addresses_work
from tests.stand_ins.ticking import Robot, warnings_of

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


def test_both_views_of_a_ctypes_union_are_logged(logged):
    class Word(ctypes.Union):
        _fields_ = [("number", ctypes.c_uint32), ("bytes", ctypes.c_uint8 * 2)]

    assert logged(Word(0x0201)) == [[0x0201], [1], [2]]


def test_an_array_array_is_logged_by_reference(logged):
    x = array.array("f", [1.0, 2.0])

    def change():
        x[0] = 8.0

    assert logged(x, change) == [[1.0, 8.0], [2.0, 2.0]]


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (memoryview(bytearray(range(8)))[1::3], [[1], [4], [7]]),  # with its strides
        (bytearray(b"\1\2"), [[1], [2]]),
        (np.rec.array([(1.0, 2)], dtype=[("a", "f8"), ("b", "i4")]), [[1.0], [2]]),
        (np.ma.masked_array([1.0, 2.0], [True, False]), [[1.0], [2.0]]),  # as its data
        (np.frombuffer(b"\1\0\0\0", "<i4"), [[1]]),  # read-only
    ],
)
def test_what_has_memory_is_logged(logged, value, found):
    assert logged(value) == found


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


@pytest.mark.parametrize("dtype", [">f8", ">i4", ">U3", ">M8[ns]", "S7", "U2", "f2"])
def test_no_type_makes_silo_give_up_reading_by_address(new_logger, dtype):
    logger = new_logger()
    logger.add(np.ones(2, dtype), "x")
    logger.start()
    assert addresses_work(logger._present.run.plan)
    assert logger._present.run.plan.references


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


# ------------------------------------------------------------------------------------------- assigned anew


def test_an_array_that_was_assigned_anew_is_warned_of_at_start(new_logger, caplog):
    robot = Robot(x=np.zeros(3))
    logger = new_logger()
    logger.add(robot.x, "x")
    robot.x = robot.x + 1
    logger.start()
    (warning,) = warnings_of(caplog)
    assert warning.startswith("/log/x: nobody but silo holds this array any more (seen at the start)")


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
        (1.5, "/log/x: a value of type float is no variable: it would never change in the log; write x = "
         'log.array("x", ...) and set x[...], or log an attribute: log.add(owner, attr="x"), or a function: '
         'log.add(lambda: x, "x")'),
        (3, "/log/x: a value of type int is no variable: it would never change in the log; write x = "
         'log.array("x", ...) and set x[...], or log an attribute: log.add(owner, attr="x"), or a function: '
         'log.add(lambda: x, "x")'),
        (True, "/log/x: a value of type bool is no variable: it would never change in the log; write x = "
         'log.array("x", ...) and set x[...], or log an attribute: log.add(owner, attr="x"), or a function: '
         'log.add(lambda: x, "x")'),
        (np.float64(2), "/log/x: a value of type float64 is no variable: it would never change in the log; write "
         'x = log.array("x", ...) and set x[...], or log an attribute: log.add(owner, attr="x"), or a function: '
         'log.add(lambda: x, "x")'),
        ("text", "/log/x: a value of type str is no variable: it would never change in the log; write x = "
         'log.array("x", ...) and set x[...], or log an attribute: log.add(owner, attr="x"), or a function: '
         'log.add(lambda: x, "x")'),
        (enum.Enum("Mode", "IDLE")["IDLE"], "/log/x: a value of type Mode is no variable: it would never change "
         'in the log; write x = log.array("x", ...) and set x[...], or log an attribute: log.add(owner, '
         'attr="x"), or a function: log.add(lambda: x, "x")'),
        ([1.0, 2.0], "/log/x: a list of plain values can't be logged by reference; use a NumPy array: x = "
         "np.array([...], float), and change it in place: x[:] = ..."),
        ((1, 2), "/log/x: a tuple of plain values can't be logged by reference; use a NumPy array: x = "
         "np.array([...], float), and change it in place: x[:] = ..."),
        (np.array([None, 1]), "/log/x: an array of Python objects (dtype object) has no fixed memory; give it "
         "a numeric or string dtype"),
        (np.zeros(0), "/log/x: an array of shape (0,) holds no value to log"),
        (np.zeros((3, 0)), "/log/x: an array of shape (3, 0) holds no value to log"),
        (np.zeros(2, "V8"), "element '/log/x': dtype |V8 is bytes without a meaning; log it as numbers: "
         "x.view('u1')"),
        (np.zeros(2, "M8"), "element '/log/x': dtype datetime64 is a time without a unit; write dtype='M8[ns]'"),
        (object(), "/log/x: don't know how to log what is of type object; log a NumPy array, an attribute "
         "(attr=...), a function, or register the type once: silo.register(object, 'field', ...)"),
        ((ctypes.py_object * 2)(), "/log/x: an array of Python objects (dtype object) has no fixed memory; "
         "give it a numeric or string dtype"),
    ],
)  # fmt: skip
def test_what_can_not_be_referred_to_is_refused_with_what_to_write(new_logger, source, words):
    with pytest.raises((SourceError, ElementError)) as caught:
        new_logger().add(source, "x")
    assert str(caught.value) == words


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


# ------------------------------------------------------------------------------------------------ checked copies


def test_when_addresses_do_not_work_variables_are_copied_by_numpy(new_logger, monkeypatch, caplog):
    monkeypatch.setattr("silo.loop.run.addresses_work", lambda plan: False)
    x = np.array([1.0, 2.0], ">f8")
    logger = new_logger()
    logger.add(x, "x")
    logger.start()
    logger.collect()
    assert [entry.values.tolist() for entry in logger.snapshot().elements[0].entries] == [[1.0], [2.0]]
    assert "falling back to checked=True" in warnings_of(caplog)[0]


def test_the_self_test_finds_an_address_that_is_wrong(new_logger, monkeypatch):
    noise = np.frombuffer(os.urandom(1000), np.uint8)
    monkeypatch.setattr("silo.loop.run._read_bytes", lambda addresses, sizes: noise[: sizes.sum()])
    logger = new_logger()
    logger.add(np.array([1.0, 2.0]), "x")
    logger.start()
    assert logger._present.run.plan.references == ()


@pytest.mark.parametrize("place", [0, 499, 500, 1200])
def test_the_self_test_finds_a_single_wrong_address_among_many(new_logger, monkeypatch, place):
    arrays = [np.full(1 + number % 3, float(number)) for number in range(1201)]
    wrong = arrays[place].__array_interface__["data"][0]
    read = run._read_bytes
    monkeypatch.setattr("silo.loop.run._read_bytes", lambda found, sizes: read(found, sizes) ^ (wrong in found))
    logger = new_logger()
    for number, one in enumerate(arrays):
        logger.add(one, f"x{number}", size=2)
    logger.start()
    assert logger._present.run.plan.references == ()


def test_values_that_change_while_they_are_compared_are_read_again(new_logger, monkeypatch):
    arrays = [np.zeros(1) for _ in range(3)]
    read, calls = run._read_bytes, []

    def other_at_first(found, sizes):
        calls.append(len(found))
        return read(found, sizes) ^ (len(calls) < 3)

    monkeypatch.setattr("silo.loop.run._read_bytes", other_at_first)
    logger = new_logger()
    for number, one in enumerate(arrays):
        logger.add(one, f"x{number}")
    logger.start()
    assert len(logger._present.run.plan.references) == 3
    assert calls == [3, 1, 1, 1, 1]  # all at once, then each of those that differed, the first one twice
