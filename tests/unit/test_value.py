"""`log.value`: what has no memory of its own is logged by its name."""

from fractions import Fraction

import numpy as np
import pytest

import silo
from silo.errors import SourceError


class Tensor:
    """What torch's tensors have of what is documented: with a gradient or on a GPU, they are no arrays."""

    def __init__(self, values, device="cuda", grad=True):
        self.values, self.device, self.grad = np.asarray(values, np.float32), device, grad

    def detach(self):
        return Tensor(self.values, self.device, grad=False)

    def cpu(self):
        return Tensor(self.values, "cpu", self.grad)

    def __array__(self, dtype=None, copy=None):
        if self.grad:
            raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")
        if self.device != "cpu":
            raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() to copy it first.")
        return self.values


class ByDlpack:
    """An array that says where its memory is in no other way."""

    def __init__(self, values):
        self._values = np.asarray(values)

    def __dlpack__(self, **options):
        return self._values.__dlpack__()

    def __dlpack_device__(self):
        return self._values.__dlpack_device__()


def logged(log, name):
    return silo.Log(log.snapshot())[name].values.tolist()


def test_a_number_is_logged_tick_by_tick_and_holds_until_the_next(new_logger):
    log = new_logger()
    log.value("cost", 3, unit="J")
    log.start()
    for cost in (3, 4.5, None, np.float32(2)):
        if cost is not None:
            log.value("cost", cost)
        log.collect()
    assert logged(log, "cost") == [3.0, 4.5, 4.5, 2.0]
    assert log["cost"].unit == "J"


@pytest.mark.parametrize(
    ("value", "dtype"),
    [(3, "f8"), (Fraction(7, 2), "f8"), (2**70, "f8"), (True, "?"), (np.float32(2), "f4"), (np.uint8(9), "u1")],
)
def test_a_number_of_python_is_a_double_and_one_of_numpy_keeps_its_type(value, dtype, new_logger):
    log = new_logger()
    log.value("x", value)
    log.start()
    log.collect()
    found = silo.Log(log.snapshot())["x"].values
    assert (found.tolist(), found.dtype) == ([float(value)], np.dtype(dtype))


@pytest.mark.parametrize("value", [Tensor([1, 2]), ByDlpack([1.0, 2.0]), np.array([1.0, 2.0]), [1.0, 2.0]])
def test_a_tensor_is_logged_wherever_it_lies(value, new_logger):
    log = new_logger()
    log.value("latent", value, group="net")
    log.start()
    log.collect()
    assert logged(log, "net/latent") == [[1.0, 2.0]]


def test_what_was_written_is_a_copy(new_logger):
    log = new_logger()
    x = np.array([1.0])
    log.value("x", x)
    x[0] = 9
    log.start()
    log.collect()
    assert logged(log, "x") == [[1.0]]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([1.0, 2.0, 3.0], "log.value('x', ...) began with float64 of shape (2,), got float64 of shape (3,): "
         "give another name to what is something else; nothing was changed"),
        ([1j, 2j], "log.value('x', ...) began with float64 of shape (2,), got complex128 of shape (2,): give "
         "another name to what is something else; nothing was changed"),
    ],
)  # fmt: skip
def test_another_shape_or_kind_is_refused_and_the_value_stays(value, words, new_logger):
    log = new_logger()
    log.value("x", [1.0, 2.0])
    with pytest.raises(silo.ElementError) as caught:
        log.value("x", value)
    assert str(caught.value) == words
    log.start()
    log.collect()
    assert logged(log, "x") == [[1.0, 2.0]]


@pytest.mark.parametrize(
    ("first", "then"),
    [
        (1.0, [2.0, np.float32(3), 4]),
        (np.zeros(2), [np.ones(2), [2.0, 3.0], np.array([4, 5]), np.ma.array([6.0, 7.0])]),
        (np.zeros(2, "f4"), [np.ones(2, "f4"), np.array([2.0, 3.0])]),
    ],
)
def test_each_next_value_is_logged_whatever_it_is_made_of(first, then, new_logger):
    log = new_logger()
    log.value("x", first)
    log.start()
    for value in then:
        log.value("x", value)
        log.collect()
    assert logged(log, "x") == [np.asarray(value).tolist() for value in then]


@pytest.mark.parametrize("value", ["STANCE", object(), [[1], [2, 3]], {"a": 1}])
def test_what_is_no_number_is_refused_with_what_to_write(value, new_logger):
    log = new_logger()
    with pytest.raises(SourceError, match=r"log\.value"):
        log.value("mode", value)
    assert len(log.elements) == 0


def test_a_logger_that_does_nothing_takes_it_too():
    silo.NullLogger().value("cost", 3)
