"""Lists of messages that say what they are of: transforms by their frames, states of joints, diagnostics, statistics.

Each key (`odom->arm`, `motors/LF_HAA`) is signals of its own, with the time stamps at which it came. Publishers take
turns on such topics, so a message holds some of the keys, and which isn't known before all of them were looked at.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.recording import masked
from silo.files.others import cdr
from silo.files.others.message_types import (
    FieldSpec,
    MessageFields,
    Node,
    NumberField,
    Path,
    Repeated,
    Text,
    signals_of,
)
from silo.files.others.topics import Bad, Equal

MOST_KEYS = 10_000


class Item(NamedTuple):
    """One place of the lists in messages of one layout: its key in each of them, and where its values stand."""

    keys: NDArray[Any]
    columns: dict[Path, NDArray[Any]]


Take = Callable[[cdr.MessageLayout, NDArray[np.uint8]], Iterator[Item]]


@dataclass(frozen=True)
class KeyedList:
    """A kind of message with a list in it: how its items are found, and the elements that each key has."""

    take: Take
    specs: tuple[FieldSpec, ...]
    lists: frozenset[Path]


@dataclass(frozen=True)
class KeyedValues:
    """What came under one key: of which messages, and the values by their paths."""

    which: NDArray[np.int64]
    columns: dict[Path, NDArray[Any]]

    def specs(self, kind: KeyedList) -> list[FieldSpec]:
        """Return the elements that this key has, with the types that were found."""
        mine = [one for one in kind.specs if one.paths[0] in self.columns]
        types = [self.columns[one.paths[0]].dtype for one in mine]
        return [replace(one, dtype="S" if type_.kind == "S" else one.dtype if one.dtype != "S" else "f8")
                for one, type_ in zip(mine, types, strict=True)]  # fmt: skip


def keyed_list(message: MessageFields) -> KeyedList | None:
    """Return how the lists of a type are read; None for one that has none that silo knows."""
    made = _KINDS.get(message.name)
    try:
        return made(message) if made is not None else None
    except KeyError:  # of another make than the type of that name that everybody has
        return None


def of_keys(message: MessageFields, kind: KeyedList, groups: Iterable[Equal], bad: Bad) -> dict[str, KeyedValues]:
    """Return the values of each key, in the order of messages. Beyond `MOST_KEYS` they are left out."""
    found: dict[bytes, list[tuple[NDArray[np.int64], dict[Path, NDArray[Any]]]]] = {}
    for which, layout, rows in cdr.alike(message, groups, bad, kind.lists):
        for item in kind.take(layout, rows):
            names, places = np.unique(item.keys, return_inverse=True)
            for number, name in enumerate(names.tolist()):
                if name not in found and len(found) >= MOST_KEYS:
                    continue
                mine = slice(None) if len(names) == 1 else places.ravel() == number
                parts = {path: values[mine] for path, values in item.columns.items()}
                found.setdefault(name, []).append((which[mine], parts))
    made = {name.decode("utf-8", "backslashreplace"): _joined(kind.specs, parts) for name, parts in found.items()}
    return dict(sorted(made.items()))


def _joined(
    specs: Sequence[FieldSpec], parts: Sequence[tuple[NDArray[np.int64], dict[Path, NDArray[Any]]]]
) -> KeyedValues:
    which = np.concatenate([one for one, _ in parts])
    order = np.argsort(which, kind="stable")
    columns = {}
    for path in dict.fromkeys(path for _, one in parts for path in one):
        values = [one[path] if path in one else _none(len(those), specs, path) for those, one in parts]
        masks = any(np.ma.isMA(one) for one in values)
        joined: NDArray[Any] = np.ma.concatenate(values) if masks else np.concatenate(values)  # type: ignore[no-untyped-call]
        columns[path] = joined[order] if joined.dtype.kind != "S" else numbers_in(joined[order])
    return KeyedValues(which[order], columns)


def _none(count: int, specs: Sequence[FieldSpec], path: Path) -> NDArray[Any]:
    kind = next((one.dtype for one in specs if path in one.paths), "f8")
    return masked(np.zeros(count, "S1" if kind == "S" else kind), np.ones(count, bool))


def numbers_in(texts: NDArray[Any]) -> NDArray[Any]:
    """Return texts as numbers where all of them are some, else as they are."""
    try:
        return texts.astype(np.float64)
    except ValueError:
        return texts


# --------------------------------------------------------------------------------------------------------------- kinds


def _listed(layout: cdr.MessageLayout, path: Path) -> range:
    return range(layout.places[path].values) if path in layout.places else range(0)


def _value(layout: cdr.MessageLayout, rows: NDArray[np.uint8], path: Path) -> NDArray[Any]:
    values = cdr.values_at(layout, rows, path, 0)
    assert values is not None
    return values


def _inner(message: MessageFields, field: str) -> MessageFields:
    """The type of a list's messages. Raises KeyError where that is no such list: a bag may call anything by a name."""
    node = dict(message.fields)[field]
    if not (isinstance(node, Repeated) and node.count < 0 and isinstance(node.node, MessageFields)):
        raise KeyError(field)
    return node.node


def _check(message: MessageFields, path: Path, kind: type[Node]) -> None:
    """Raise KeyError where there is nothing of a kind at a path."""
    inner = dict(message.fields)[path[0]]
    if len(path) > 1 and isinstance(inner, MessageFields):
        _check(inner, path[1:], kind)
    elif len(path) > 1 or not isinstance(inner, kind):
        raise KeyError(path[-1])


def _plain(
    field: str, keys: Sequence[Path], between: bytes = b"", unnamed: str = ""
) -> Callable[[MessageFields], KeyedList]:
    """Items of a list, each with its key in it; what lies in the field `unnamed` is called without it."""

    def short(path: Path) -> Path:
        return path[1:] if path[0] == unnamed else path

    def made(message: MessageFields) -> KeyedList:
        inner = _inner(message, field)
        for key in keys:
            _check(inner, key, Text)
        specs = [one for one in signals_of(inner)[0] if one.paths[0] not in keys and not one.count]
        paths = [path for one in specs for path in one.paths]
        shown = [replace(one, name=short(one.name), paths=tuple(map(short, one.paths))) for one in specs]

        def take(layout: cdr.MessageLayout, rows: NDArray[np.uint8]) -> Iterator[Item]:
            for at in _listed(layout, (field,)):
                above = (field, str(at))
                parts = [_value(layout, rows, (*above, *key)) for key in keys]
                name = parts[0]
                for part in parts[1:]:
                    name = np.char.add(np.char.add(name, between), part)
                yield Item(name, {short(path): _value(layout, rows, (*above, *path)) for path in paths})

        return KeyedList(take, tuple(shown), frozenset({(field,)}))

    return made


def _diagnostics(message: MessageFields) -> KeyedList:
    plain = _plain("status", (("name",),))(message)
    pairs = _inner(_inner(message, "status"), "values")
    for each in ("key", "value"):
        _check(pairs, (each,), Text)
    value = FieldSpec((), ((),), "S")

    def take(layout: cdr.MessageLayout, rows: NDArray[np.uint8]) -> Iterator[Item]:
        yield from plain.take(layout, rows)
        for at in _listed(layout, ("status",)):
            name = _value(layout, rows, ("status", str(at), "name"))
            for each in _listed(layout, ("status", str(at), "values")):
                above = ("status", str(at), "values", str(each))
                key = np.char.add(np.char.add(name, b"/"), _value(layout, rows, (*above, "key")))
                yield Item(key, {(): _value(layout, rows, (*above, "value"))})

    return KeyedList(take, (*plain.specs, value), plain.lists | {("status", "*", "values")})


def _interfaces(message: MessageFields) -> KeyedList:
    def take(layout: cdr.MessageLayout, rows: NDArray[np.uint8]) -> Iterator[Item]:
        joints = layout.places[("joint_names",)].values
        for at in _listed(layout, ("interface_values",)):
            if at >= joints:
                return
            joint = _value(layout, rows, ("joint_names", str(at)))
            above = ("interface_values", str(at))
            names, values = (*above, "interface_names"), (*above, "values")
            numbers = cdr.values_at(layout, rows, values, layout.places[values].values)
            for each in range(min(layout.places[names].values, 0 if numbers is None else numbers.shape[1])):
                word = _value(layout, rows, (*names, str(each)))
                assert numbers is not None
                yield Item(np.char.add(np.char.add(joint, b"/"), word), {(): numbers[:, each]})

    fields = dict(_inner(message, "interface_values").fields)
    names, words, values = dict(message.fields)["joint_names"], fields["interface_names"], fields["values"]
    if not all(isinstance(one, Repeated) and isinstance(one.node, Text) for one in (names, words)):
        raise KeyError("joint_names")
    if not (isinstance(values, Repeated) and isinstance(values.node, NumberField)):
        raise KeyError("values")
    return KeyedList(take, (FieldSpec((), ((),), values.node.dtype),), frozenset({("interface_values",)}))


_TRANSFORMS = _plain("transforms", (("header", "frame_id"), ("child_frame_id",)), b"->", "transform")
_KINDS: dict[str, Callable[[MessageFields], KeyedList]] = {
    "tf2_msgs/msg/TFMessage": _TRANSFORMS,
    "tf/msg/tfMessage": _TRANSFORMS,
    "diagnostic_msgs/msg/DiagnosticArray": _diagnostics,
    "control_msgs/msg/DynamicJointState": _interfaces,
    "control_msgs/msg/DynamicInterfaceGroupValues": _interfaces,
    "pal_statistics_msgs/msg/Statistics": _plain("statistics", (("name",),)),
}
