"""Columns of scalars <-> samples as the program had them: vectors, matrices, complex numbers, structures.

A recording holds one column per scalar. `assembled` makes of them what was logged, `scalars` takes it apart again.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.kinds import STRUCT, is_complex, struct_fields
from silo.core.recording import RecordedElement, RecordedEntry


def assembled(element: RecordedElement) -> NDArray[Any]:
    """The samples in the shape of the element: `(m, *shape)`; a structured array where the entries' types differ."""
    columns = [_readable(entry.values) for entry in element.entries]
    count, shape = element.count, element.shape
    types = {column.dtype for column in columns}
    if element.kind == STRUCT.name:
        made = _as_declared(element)
        return _flat_record(element, columns) if made is None else made
    if (
        is_complex(element.kind, shape, [entry.entry.suffix for entry in element.entries])
        and {one.kind for one in types} == {"f"}
        and len(types) == 1
    ):
        return _complex(columns, (count, *shape))
    if len(types) > 1 and any(column.dtype.kind != "U" for column in columns):
        return _flat_record(element, columns)
    if math.prod(shape) != len(columns):
        return columns[0] if len(columns) == 1 else _stacked(columns)
    # one column stays what it is, a view of the file
    return (columns[0] if len(columns) == 1 else _stacked(columns)).reshape(count, *shape)


def _stacked(columns: list[NDArray[Any]]) -> NDArray[Any]:
    masked = any(isinstance(column, np.ma.MaskedArray) for column in columns)
    made: NDArray[Any] = np.ma.stack(columns, axis=-1) if masked else np.stack(columns, axis=-1)
    return made


def component_names(element: RecordedElement) -> tuple[str, ...]:
    """The names of the scalars of one sample; none where a sample is a scalar."""
    return tuple(map(_component, element.entries)) if len(element.entries) > 1 or element.shape else ()


def scalars(values: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Columns of shape `(m,)` of samples of shape `(m, *shape)`, in the order of the entries."""
    items = values.reshape(len(values), math.prod(values.shape[1:]))
    for place in range(items.shape[1]):
        item = items[:, place]
        if item.dtype.names is not None:
            for name in item.dtype.names:
                yield from scalars(item[name])
        elif item.dtype.kind == "c":
            yield item.real
            yield item.imag
        else:
            yield item


def _complex(columns: list[NDArray[Any]], shape: tuple[int, ...]) -> NDArray[Any]:
    parts = np.stack(columns, axis=-1)
    # by storage, not by arithmetic: inf + 0j would make a NaN
    half = parts.dtype if parts.dtype.itemsize >= 4 else np.dtype(np.float32)
    return np.ascontiguousarray(parts, half).view(np.result_type(half, np.complex64)).reshape(shape)


def _as_declared(element: RecordedElement) -> NDArray[Any] | None:
    """The structured array as it was logged, None where the log doesn't say or the entries don't fit."""
    fields = struct_fields(element.dtype)
    try:
        dtype = np.dtype(fields) if fields else None
    except (ValueError, TypeError, SyntaxError, OverflowError, MemoryError):
        # of a damaged file
        return None
    if dtype is None or dtype.hasobject:
        return None
    size = math.prod(element.shape) * len(list(scalars(np.empty(1, dtype))))
    if size != len(element.entries):
        return None
    made = np.zeros((element.count, *element.shape), dtype)
    for place, entry in zip(scalars(made), element.entries, strict=True):
        # a field of bytes stays bytes; one of text stands in files as UTF-8
        column = _readable(entry.values) if place.dtype.kind == "U" else entry.values
        if column.dtype.kind != place.dtype.kind:
            return None
        place[:] = column
    return made


def _flat_record(element: RecordedElement, columns: list[NDArray[Any]]) -> NDArray[Any]:
    if len(columns) == 1:
        return columns[0]
    names = [_component(entry) for entry in element.entries]
    if len(set(names)) < len(names) or not all(names):
        names = [entry.name for entry in element.entries]
    record = np.empty(element.count, [(name, column.dtype) for name, column in zip(names, columns, strict=True)])
    for name, column in zip(names, columns, strict=True):
        record[name] = column
    return record


def _readable(values: NDArray[Any]) -> NDArray[Any]:
    return np.char.decode(values, "utf-8", "backslashreplace") if values.dtype.kind == "S" else values


def _component(entry: RecordedEntry) -> str:
    return entry.entry.suffix.removeprefix("_")
