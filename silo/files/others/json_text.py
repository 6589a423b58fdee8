"""Messages of JSON: the numbers, truths and texts in them by their paths, with the types that the values have."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.files.others.message_types import MOST_VALUES, Path, Wanted
from silo.files.others.topics import Equal


def signals_of(some: Iterable[Equal]) -> tuple[list[Wanted], list[Path]]:
    """Return the elements that a few messages show, and what in them is none."""
    found: dict[Path, Wanted] = {}
    left: dict[Path, None] = {}
    for _, message in _decoded(some):
        _look(message, (), found, left)
    return list(found.values()), list(left)


def _look(value: Any, path: Path, found: dict[Path, Wanted], left: dict[Path, None]) -> None:
    if isinstance(value, dict):
        for key, each in value.items():
            _look(each, (*path, str(key)), found, left)
        return
    if isinstance(value, list) and value and len(value) <= MOST_VALUES and all(map(_number, value)):
        most = max(len(value), found[path].count if path in found else 0)
        found[path] = Wanted(path, (path,), "f8", "vector", tuple(f"_{at}" for at in range(most)), most)
    elif isinstance(value, bool):
        found.setdefault(path, Wanted(path, (path,), "b1"))
    elif isinstance(value, str):
        found.setdefault(path, Wanted(path, (path,), "S"))
    elif _number(value):
        found.setdefault(path, Wanted(path, (path,), "f8"))
    elif value is not None:
        left[path] = None


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def columns_of(wanted: Sequence[Wanted], groups: Iterable[Equal], total: int) -> dict[Path, NDArray[Any]]:
    """Return the values of elements in all messages; NaN, or an empty text, where a message has none."""
    kinds: Mapping[str, type] = {"f8": np.float64, "b1": np.float64, "S": np.object_}
    made: dict[Path, NDArray[Any]] = {
        one.name: np.full(
            (total, one.count) if one.count else total, b"" if one.dtype == "S" else np.nan, kinds[one.dtype]
        )
        for one in wanted
    }
    for number, message in _decoded(groups):
        for one in wanted:
            value: Any = message
            for key in one.name:
                value = value.get(key) if isinstance(value, dict) else None
            if one.dtype == "S":
                made[one.name][number] = value.encode() if isinstance(value, str) else b""
            elif one.count and isinstance(value, list):
                kept = [each if _number(each) else np.nan for each in value[: one.count]]
                made[one.name][number, : len(kept)] = kept
            elif isinstance(value, int | float) and not one.count:
                made[one.name][number] = value
    return {one.name: _typed(made[one.name], one.dtype) for one in wanted}


def _typed(values: NDArray[Any], dtype: str) -> NDArray[Any]:
    whole = dtype == "S" or (dtype == "b1" and not np.isnan(values).any())
    return values.astype(dtype) if whole else values


def _decoded(groups: Iterable[Equal]) -> Iterable[tuple[int, Any]]:
    for which, rows in groups:
        yield from zip(which.tolist(), (msgspec.json.decode(row.tobytes()) for row in rows), strict=True)
