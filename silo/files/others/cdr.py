"""Messages in CDR, the encoding of ROS 2, as columns: a whole topic in a few indexed loads.

Where a value stands in a message depends on the lengths of the texts and sequences before it. So messages of one size
are taken together, the first of them is walked through, and all that have the same lengths at the same places are read
by its layout; what is left over goes round again. Measured on 20,000 `sensor_msgs/Imu`: 25 ms, against 0.6 s of one
Python object per message.
"""

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.recording import masked
from silo.files.bags.ros_types import aligned
from silo.files.others.message_types import MessageFields, Node, NumberField, Path, Repeated, Stamp, Text
from silo.files.others.topics import Bad, Equal

Bytes = NDArray[np.uint8]
Lists = frozenset[Path]  # paths, with `*` for a place in a list

_MOST_PARTS = 20_000  # texts and lists of one message: of each, one step of Python is taken
_MOST_TEXT_BYTES = 64 << 20  # of a column; each message has room for the longest
_PADDING = 3  # bytes up to the next word, as middlewares leave them at the end
_HEAD = 4  # of a message: how it is encoded; what follows is aligned from behind it
_STAMP = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])


class Place(NamedTuple):
    """Where the values of a path stand: first byte, type (of texts with length), how many values; -1 for a scalar."""

    at: int
    dtype: str
    values: int


class MessageLayout(NamedTuple):
    """The places of one walk, and the lengths that it met: byte, and what stands there."""

    places: dict[Path, Place]
    lengths: list[tuple[int, int]]
    order: str
    lists: Lists = frozenset()


def layout_of(message: MessageFields, row: bytes, lists: Lists = frozenset()) -> tuple[MessageLayout, str]:
    """Walk through one message. Of one that is none of this type the layout goes as far as the walk, and says why.

    `lists` are those lists of messages whose parts get places, too: `(*path, "0", ...)`.
    """
    made = MessageLayout({}, [], "<" if len(row) > 1 and row[1] else ">", lists)
    try:
        _fill(message, row, made)
    except ValueError as error:
        return made, str(error)
    return made, ""


def _fill(message: MessageFields, row: bytes, made: MessageLayout) -> None:
    """Raises ValueError for a message that is none of this type."""
    if len(row) < _HEAD or row[0] or row[1] > 1:
        raise ValueError(f"it is encoded in another way than CDR ({row[:_HEAD].hex()})")
    try:
        left = len(row) - _walk(message, row, _HEAD, (), made)
    except struct.error:
        raise ValueError("it ends before its last field") from None
    if left > _PADDING:
        raise ValueError(f"{left} bytes are left over behind the last field: it is of another type")


def _walk(node: Node, row: bytes, at: int, path: Path | None, made: MessageLayout) -> int:
    """Walk from a byte on, return where it ends. Of what has no path, no place is kept."""
    if isinstance(node, NumberField):
        size = np.dtype(node.dtype).itemsize
        at = aligned(at, size)
        if path is not None:
            made.places[path] = Place(at, made.order + node.dtype, -1)
        return _inside(row, at + size)
    if isinstance(node, Text):
        length, at = _length(row, at, made)
        if path is not None:
            made.places[path] = Place(at, f"S{max(length - 1, 0)}", -1)  # a NUL ends it
        return _inside(row, at + length)
    if isinstance(node, Stamp):
        at = aligned(at, 4)
        if path is not None:
            made.places[path] = Place(at, "duration" if node.duration else "time", -1)
        return _inside(row, at + _STAMP.itemsize)
    if isinstance(node, MessageFields):
        for name, each in node.fields:
            at = _walk(each, row, at, None if path is None else (*path, name), made)
        return at
    return _walk_repeated(node, row, at, path, made)


def _walk_repeated(node: Repeated, row: bytes, at: int, path: Path | None, made: MessageLayout) -> int:
    count, inner = node.count, node.node
    if count < 0:
        count, at = _length(row, at, made)
    if isinstance(inner, NumberField):
        size = np.dtype(inner.dtype).itemsize
        at = aligned(at, size) if count else at
        if path is not None:
            made.places[path] = Place(at, made.order + inner.dtype, count)
        return _inside(row, at + size * count)
    if count > len(row):
        raise ValueError("it announces more than it holds")
    met: dict[int, tuple[int, int]] = {}
    number = 0
    kept = path is not None and tuple("*" if part.isdigit() else part for part in path) in made.lists
    while number < count:
        each = (*path, str(number)) if path is not None and (kept or isinstance(inner, Text)) else None
        lengths, place = len(made.lengths), (at - _HEAD) % 8
        before = at
        at = _walk(inner, row, at, each, made)
        number += 1
        if kept or len(made.lengths) > lengths:
            continue
        # without lengths in it, what begins at the same place of a word is as long again
        first, begin = met.setdefault(place, (number - 1, before))
        if first < number - 1:
            turns = (count - number) // (number - 1 - first)
            number, at = number + turns * (number - 1 - first), _inside(row, at + turns * (before - begin))
            met.clear()
    if path is not None and isinstance(inner, Text):
        made.places[path] = Place(at, "texts", count)
    elif path is not None and kept:
        made.places[path] = Place(at, "messages", count)
    return at


def _length(row: bytes, at: int, made: MessageLayout) -> tuple[int, int]:
    at = aligned(at, 4)
    (length,) = struct.unpack_from(f"{made.order}I", row, at)
    made.lengths.append((at, length))
    if len(made.lengths) > _MOST_PARTS:
        raise ValueError(f"it has more than {_MOST_PARTS:,} texts and lists")
    return length, at + 4


def _inside(row: bytes, at: int) -> int:
    if at > len(row):
        raise ValueError("it ends before its last field")
    return at


# ------------------------------------------------------------------------------------------------------------- columns


class Longer(NamedTuple):
    """In how many messages an array has more values than its signal, the most of them, and the first such message."""

    messages: int
    most: int
    first: int

    def and_so(self, other: "Longer") -> "Longer":
        """Return both together."""
        return Longer(self.messages + other.messages, max(self.most, other.most), min(self.first, other.first))

    def __str__(self) -> str:
        times = f"{self.messages:,} messages" if self.messages > 1 else "1 message"
        return f"up to {self.most:,} values in {times}, first in number {self.first:,}"


@dataclass(frozen=True)
class WantedColumns:
    """What is wanted of all messages of a topic, how many they are, and what is found out on the way.

    `paths` says how many values an array has, 0 for all else, `dtypes` NumPy types (`S` for texts). `longer` gets the
    arrays that have more in some messages, `cut` those of texts that are too long for a column, `bad` the
    messages that can't be read.
    """

    paths: Mapping[Path, int]
    dtypes: Mapping[Path, str]
    total: int
    bad: Bad
    longer: dict[Path, Longer] = field(default_factory=dict)
    cut: set[Path] = field(default_factory=set)


def columns_of(message: MessageFields, wanted: WantedColumns, groups: Iterable[Equal]) -> dict[Path, NDArray[Any]]:
    """Return the values at some paths of all messages, shape `(total,)`, or `(total, k)` where `paths` says a k > 0.

    What a message doesn't have, as its array is shorter or as it can't be read, is NaN, NaT, an empty text, or masked:
    integers stay integers.
    """
    found: dict[Path, list[tuple[NDArray[np.int64], NDArray[Any]]]] = {path: [] for path in wanted.paths}
    longest = max(256, _MOST_TEXT_BYTES // max(wanted.total, 1))
    for which, layout, rows in alike(message, groups, wanted.bad):
        for path, count in wanted.paths.items():
            if layout.places[path].values > count:
                met = Longer(len(which), layout.places[path].values, int(which.min()))
                wanted.longer[path] = met.and_so(wanted.longer.get(path, met._replace(messages=0)))
            values = values_at(layout, rows, path, count)
            if values is None:
                continue
            if values.dtype.kind == "S" and values.dtype.itemsize > longest:
                wanted.cut.add(path)
                values = values.astype(f"S{longest}")
            found[path].append((which, values))
    return {path: _joined(parts, wanted, path) for path, parts in found.items()}


def any_whole(message: MessageFields, groups: Iterable[Equal], bad: Bad) -> bool:
    """Return whether one of some messages can be read."""
    return any(True for _ in alike(message, groups, bad))


def lengths_of(message: MessageFields, paths: Sequence[Path], groups: Iterable[Equal], bad: Bad) -> dict[Path, int]:
    """Return the largest number of values in the arrays at some paths."""
    most = dict.fromkeys(paths, 0)
    for _, layout, _ in alike(message, groups, bad):
        for path in paths:
            most[path] = max(most[path], layout.places[path].values)
    return most


def alike(
    message: MessageFields, groups: Iterable[Equal], bad: Bad, lists: Lists = frozenset()
) -> Iterator[tuple[NDArray[np.int64], MessageLayout, Bytes]]:
    """Yield messages of one layout each: which they are, the layout, their bytes."""
    for of_one_size in groups:
        which, rows = of_one_size
        while len(rows):
            layout, why = layout_of(message, rows[0].tobytes(), lists)
            # how far a walk comes hangs on what the lengths are that it meets: all that have the same end the same way
            same = (rows[:, :2] == rows[0, :2]).all(axis=1)
            for at, _ in layout.lengths:
                same &= (rows[:, at : at + 4] == rows[0, at : at + 4]).all(axis=1)
            if why:
                bad.append((which[same], why))
            elif same.all():
                yield which, layout, rows
            else:
                yield which[same], layout, rows[same]
            which, rows = which[~same], rows[~same]


def values_at(layout: MessageLayout, rows: Bytes, path: Path, count: int) -> NDArray[Any] | None:
    """Return what stands at a path in messages of one layout, of an array its first values; None where it has none."""
    at, dtype, there = layout.places[path]
    if dtype == "texts":
        parts = [values_at(layout, rows, (*path, str(number)), 0) for number in range(min(there, count))]
        texts = [part for part in parts if part is not None]
        return np.stack(texts, axis=-1) if texts else None
    if dtype in ("time", "duration"):
        stamp = _cut(rows, at, _STAMP if layout.order == "<" else _STAMP.newbyteorder(">"))
        made = stamp["sec"].astype(np.int64) * 1_000_000_000 + stamp["nanosec"].astype(np.int64)
        return made if dtype == "duration" else made.view("M8[ns]")
    if dtype[0] == "S":
        return _cut(rows, at, np.dtype(dtype)) if dtype != "S0" else np.zeros(len(rows), "S1")
    one = np.dtype(dtype)
    if there < 0:
        values = _cut(rows, at, one)
    elif not min(there, count):
        return None
    else:
        values = _cut(rows, at, np.dtype((np.void, one.itemsize * min(there, count)))).view(one).reshape(len(rows), -1)
    return values.view(np.uint8) != 0 if one.kind == "b" else values.astype(one.newbyteorder("="), copy=False)


def _cut(rows: Bytes, at: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(rows[:, at : at + dtype.itemsize]).view(dtype)[:, 0]


def _joined(parts: Sequence[tuple[NDArray[np.int64], NDArray[Any]]], wanted: WantedColumns, path: Path) -> NDArray[Any]:
    count = wanted.paths[path]
    shape = (wanted.total, count) if count else (wanted.total,)
    declared = wanted.dtypes.get(path, "f8")
    types = [values.dtype for _, values in parts] or [np.dtype("S1" if declared == "S" else declared)]
    dtype = np.result_type(*types)
    made, missing = np.zeros(shape, dtype), np.ones(shape, bool)
    for which, values in parts:
        place = (which, slice(values.shape[1])) if count else which
        made[place], missing[place] = values, False
    return masked(made, missing)
