"""For every type and shape, the bytes that the entries point at are those that NumPy sees."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as numpy_st

from silo.loop.sources import refer
from silo.loop.types import Component, entry_of, kind_of

numbers = st.one_of(
    numpy_st.boolean_dtypes(),
    numpy_st.integer_dtypes(endianness="?"),
    numpy_st.floating_dtypes(endianness="?"),
    numpy_st.complex_number_dtypes(endianness="?", sizes=(64, 128)),
    numpy_st.byte_string_dtypes(min_len=1, max_len=20),
    numpy_st.unicode_string_dtypes(min_len=1, max_len=5),
    numpy_st.datetime64_dtypes(endianness="?"),
)
names = st.text("abcdefg", min_size=1, max_size=3)
structures = st.lists(
    st.tuples(names, numbers, st.sampled_from([(), (1,), (2,), (3,), (2, 2)])),
    min_size=1,
    max_size=4,
    unique_by=lambda field: field[0],
)


def structured(fields, align):
    return np.dtype([(name, dtype, shape) for name, dtype, shape in fields], align=align)


dtypes = st.one_of(numbers, st.builds(structured, structures, st.booleans()))
shapes = numpy_st.array_shapes(min_dims=0, max_dims=3, max_side=4)


def item_bytes(array):
    """The scalars' bytes in memory order of the fields, items in C order."""
    for index in np.ndindex(array.shape):
        item = array[(*index, ...)]
        if item.dtype.fields is not None:
            for name in item.dtype.names:
                yield from item_bytes(item[name])
        elif item.dtype.kind == "c":
            raw = item.tobytes()
            yield raw[: len(raw) // 2]
            yield raw[len(raw) // 2 :]
        else:
            yield item.tobytes()


@given(dtype=dtypes, shape=shapes, flip=st.booleans(), data=st.data())
def test_each_entry_points_at_its_own_bytes(dtype, shape, flip, data):
    array = np.frombuffer(np.random.default_rng(0).bytes(4096), np.uint8)
    size = int(np.prod(shape)) * dtype.itemsize
    array = np.ndarray(shape, dtype, np.resize(array, size).data)
    if flip and array.ndim:
        array = array[::-1].T
    part = Component("", refer(array, "/x"), "array")
    memory = np.ndarray(size, np.uint8, array.base if array.base is not None else array)
    first = array.__array_interface__["data"][0] - memory.__array_interface__["data"][0]
    found = [
        bytes(memory[first + scalar.offset : first + scalar.offset + scalar.dtype.itemsize])
        for scalar in part.scalars(array.strides)
    ]
    assert found == list(item_bytes(array))


@given(dtype=dtypes, shape=shapes)
def test_every_scalar_has_a_name_of_its_own(dtype, shape):
    part = Component("", refer(np.zeros(shape, dtype), "/x"))
    found = [scalar.suffix for scalar in part.scalars(part.source.view.strides)]
    assert all(suffix == "" or suffix.startswith("_") for suffix in found)
    assert len(set(found)) == len(found)


@given(dtype=dtypes, shape=shapes)
def test_entries_are_little_endian_and_never_structured(dtype, shape):
    part = Component("", refer(np.zeros(shape, dtype), "/x"))
    for scalar in part.scalars(part.source.view.strides):
        made = np.dtype(entry_of(scalar, None).dtype)
        assert not made.str.startswith(">")
        assert made.itemsize == scalar.dtype.itemsize
        assert made.fields is None


@given(dtype=dtypes, shape=shapes)
def test_every_array_is_of_some_kind(dtype, shape):
    assert kind_of(dtype, shape, "") in ("scalar", "vector", "matrix", "array", "complex", "struct")
