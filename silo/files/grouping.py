"""Putting scalar entries back together: which neighbours in a file were one vector, quaternion, matrix or pose.

Used where a file says nothing about it (files of the original, CSV). The rules are the suffixes that the traits give.
"""

import re
from collections.abc import Hashable, Sequence

import msgspec

_XYZ = ("_x", "_y", "_z")
_QUATERNION = ("_x", "_y", "_z", "_w")
_FIXED_PATTERNS: tuple[tuple[str, tuple[int, ...], tuple[str, ...]], ...] = (
    ("pose", (7,), (*(f"_position{s}" for s in _XYZ), *(f"_orientation{s}" for s in _QUATERNION))),
    ("twist", (6,), (*(f"_linear{s}" for s in _XYZ), *(f"_angular{s}" for s in _XYZ))),
    ("quaternion", (4,), _QUATERNION),
    ("angle_axis", (4,), ("_angle", *_XYZ)),
    ("vector", (3,), _XYZ),
    ("complex", (), ("_real", "_imag")),
)
_AT_POSITION = re.compile(r"(?P<base>.+?)_vector_in_(?P<frame>.+)_frame_x")
_CELL = re.compile(r"(?P<base>.+)_(?P<row>0)_(?P<column>0)")
_FIRST = re.compile(r"(?P<base>.+)_0")


class Group(msgspec.Struct, frozen=True):
    """Entries `start ... start + len(suffixes)` are one element of this name, kind and shape."""

    name: str
    kind: str
    shape: tuple[int, ...]
    start: int
    suffixes: tuple[str, ...]


def regroup(names: Sequence[str], likeness: Sequence[Hashable]) -> list[Group]:
    """Groups that cover all entries in order; only neighbours of equal `likeness` (divider, type ...) are joined."""
    groups: list[Group] = []
    start = 0
    while start < len(names):
        stop = start + 1
        while stop < len(names) and likeness[stop] == likeness[start]:
            stop += 1
        run = names[start:stop]
        position = 0
        while position < len(run):
            group = _group_at(run, position, start)
            groups.append(group)
            position += len(group.suffixes)
        start = stop
    return groups


def _group_at(run: Sequence[str], position: int, start: int) -> Group:
    first = run[position]
    for kind, shape, suffixes in _FIXED_PATTERNS:
        base = first.removesuffix(suffixes[0])
        if base not in ("", first) and _follows(run, position, base, suffixes):
            return Group(base, kind, shape, start + position, suffixes)
    return (
        _vector_at_position(run, position, start)
        or _matrix(run, position, start)
        or _vector(run, position, start)
        or Group(first, "scalar", (), start + position, ("",))
    )


def _vector_at_position(run: Sequence[str], position: int, start: int) -> Group | None:
    match = _AT_POSITION.fullmatch(run[position])
    if match is None or position + 6 > len(run):
        return None
    base, frame = match["base"], match["frame"]
    vector = tuple(f"_vector_in_{frame}_frame{s}" for s in _XYZ)
    at = re.fullmatch(re.escape(base) + r"(_at_position_in_.+_frame)_x", run[position + 3])
    suffixes = (*vector, *(at[1] + s for s in _XYZ)) if at else ()
    if not suffixes or not _follows(run, position, base, suffixes):
        return None
    return Group(base, "vector_at_position", (6,), start + position, suffixes)


def _matrix(run: Sequence[str], position: int, start: int) -> Group | None:
    match = _CELL.fullmatch(run[position])
    if match is None:
        return None
    base = match["base"]
    columns = 1
    while position + columns < len(run) and run[position + columns] == f"{base}_0_{columns}":
        columns += 1
    rows = 1
    while _follows(run, position + rows * columns, base, tuple(f"_{rows}_{c}" for c in range(columns))):
        rows += 1
    if rows == 1 or columns == 1:
        return None
    suffixes = tuple(f"_{r}_{c}" for r in range(rows) for c in range(columns))
    return Group(base, "matrix", (rows, columns), start + position, suffixes)


def _vector(run: Sequence[str], position: int, start: int) -> Group | None:
    match = _FIRST.fullmatch(run[position])
    if match is None:
        return None
    base = match["base"]
    length = 1
    while position + length < len(run) and run[position + length] == f"{base}_{length}":
        length += 1
    if length == 1:
        return None
    return Group(base, "vector", (length,), start + position, tuple(f"_{i}" for i in range(length)))


def _follows(run: Sequence[str], position: int, base: str, suffixes: Sequence[str]) -> bool:
    return list(run[position : position + len(suffixes)]) == [base + suffix for suffix in suffixes]
