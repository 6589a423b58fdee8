"""The struct of every message and of every file of ours: its shape, and one encoded sample.

Shapes tell names, types and defaults as they are encoded, never what a class is called: a class may be renamed, its tag
may not. A struct that stands in several places is told at the first of them.
"""

import enum
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

import msgspec
import numpy as np
from msgspec import inspect

from silo.conditions.state_file import JudgeState, array_of, array_parts
from silo.core.elements import LoggedEvent
from silo.files.bags.metadata import RecordingFacts
from silo.files.csv.metadata import CsvFacts
from silo.files.manifest import CaptureEntry, Written
from silo.files.parts.metadata import PartFacts
from silo.files.silo.format import ElementFacts, LogFacts
from silo.history.requests import StreamFrame
from silo.journal.format import Commit, Head
from silo.link.channel import LinkMessage
from silo.recorder.orders import Command, RecordOrder, Report
from silo.recorder.process import RecorderHandover
from silo.recordings.writing import WriteOrder, WriteReport
from silo.requests import AnyReply
from silo.rpc.declaring import Request, RobotRequest, leaves, reply_type
from silo.rpc.published import Event, Summary, ViewFrame
from silo.state.handover import RunOffer

SHOWN = "Start"  # of a union of requests, in whatever order modules are imported
DEPTH = 6  # of samples: `Conditions` within `Conditions` would have no end


@dataclass(frozen=True)
class Told:
    """A struct and how it is encoded. `name` tells where it travels or stands, and stays when a class is renamed."""

    name: str
    kind: Any
    json: bool = False

    def encode(self, value: object) -> bytes:
        """Return it as it travels."""
        return msgspec.json.encode(value) if self.json else msgspec.msgpack.encode(value, enc_hook=array_parts)

    def decode(self, data: bytes) -> object:
        """Return what was encoded."""
        if self.json:
            return msgspec.json.decode(data, type=self.kind)
        return msgspec.msgpack.decode(data, type=self.kind, dec_hook=array_of)


def tagged(where: str, kinds: tuple[Any, ...], *, json: bool = False) -> list[Told]:
    """Return them by their tags, in an order that no move changes."""
    found = {inspect.type_info(kind).tag: kind for kind in kinds}
    return [Told(f"{where} {tag}", found[tag], json) for tag in sorted(found)]


def all_told() -> list[Told]:
    """Return everything that is encoded for another process, or for another day."""
    return [
        *tagged("request", leaves(Request)),
        *tagged("reply", get_args(AnyReply)),
        Told("put on view", ViewFrame),
        Told("put on stream", StreamFrame),
        Told("put on summary", Summary),
        Told("put on event", Event),
        *tagged("link", get_args(LinkMessage)),
        Told("link run", RunOffer),
        Told("recorder order", RecordOrder, json=True),
        *tagged("recorder command", get_args(Command), json=True),
        Told("recorder report", Report, json=True),
        Told("writer order", WriteOrder, json=True),
        Told("writer report", WriteReport, json=True),
        Told("file .silo log", LogFacts, json=True),
        Told("file .silo element", ElementFacts, json=True),
        Told("file .csv.json", CsvFacts, json=True),
        Told("file .mcap log", RecordingFacts, json=True),
        Told("file .mcap part", PartFacts, json=True),
        Told("file events", LoggedEvent, json=True),
        Told("file captures", CaptureEntry, json=True),
        Told("file recorder", Written, json=True),
        Told("file recorders", RecorderHandover, json=True),
        Told("file judge", JudgeState),
        Told("file segment", Head, json=True),
        Told("file journal commit", Commit),
    ]


class Shapes:
    """Turns types into text and lists, each struct once."""

    def __init__(self) -> None:
        self.found: dict[str, object] = {}
        self._names: dict[type, str] = {}

    def add(self, told: Told) -> None:
        """Describe a struct and all in it."""
        kind = inspect.type_info(told.kind)
        if self._names.get(told.kind):
            self.found[told.name] = f"as {self._names[told.kind]}"
            return
        self._struct(kind, told.name)

    def _struct(self, kind: Any, where: str) -> str:
        cls = kind.cls
        if cls in self._names:
            return self._names[cls]
        self._names[cls] = where
        shape: dict[str, object] = {}
        self.found[where] = shape  # its place, before those of what is in it
        if kind.tag is not None:
            shape["tag"] = f"{kind.tag_field}={kind.tag}"
        if kind.array_like:
            shape["as"] = "array"
        if kind.forbid_unknown_fields:
            shape["unknown fields"] = "refused"
        shape["fields"] = {
            one.encode_name: self._type(one.type, f"{where}.{one.encode_name}") + self._default(one)
            for one in kind.fields
        }
        return where

    def _default(self, one: Any) -> str:
        if one.required:
            return ""
        value = one.default_factory() if one.default is msgspec.NODEFAULT else one.default
        return f" = {msgspec.json.encode(value).decode()}"

    def _type(self, kind: Any, where: str) -> str:
        if isinstance(kind, inspect.StructType):
            return f"<{self._struct(kind, where)}>"
        if isinstance(kind, inspect.UnionType):
            found = [self._type(one, f"{where}|{place}") for place, one in enumerate(kind.types)]
            if all(isinstance(one, inspect.StructType) for one in kind.types):
                found.sort()  # tags tell them apart, and their order is that in which modules were loaded
            return " | ".join(found)
        if isinstance(kind, inspect.DictType):
            return f"{{{self._type(kind.key_type, where)}: {self._type(kind.value_type, f'{where}{{}}')}}}"
        if isinstance(kind, inspect.TupleType):
            return f"({', '.join(self._type(one, f'{where}[{i}]') for i, one in enumerate(kind.item_types))})"
        if hasattr(kind, "item_type"):
            return f"[{self._type(kind.item_type, f'{where}[]')}]"
        if is_enumeration(kind):
            return f"one of {[one.value for one in kind.cls]}"
        if isinstance(kind, inspect.LiteralType):
            return f"one of {list(kind.values)}"
        if isinstance(kind, inspect.CustomType):
            return kind.cls.__name__
        if isinstance(kind, inspect.DataclassType):
            return f"<{self._struct_of_dataclass(kind, where)}>"
        limits = {
            name: value for name in ("ge", "gt", "le", "lt", "max_length") if (value := getattr(kind, name, None))
        }
        return type(kind).__name__.removesuffix("Type").lower() + (f" {limits}" if limits else "")

    def _struct_of_dataclass(self, kind: Any, where: str) -> str:
        if kind.cls not in self._names:
            self._names[kind.cls] = where
            shape: dict[str, object] = {}
            self.found[where] = shape
            shape["fields"] = {
                one.encode_name: self._type(one.type, f"{where}.{one.encode_name}") for one in kind.fields
            }
        return self._names[kind.cls]


SAMPLES: dict[type, Callable[[], object]] = {
    inspect.IntType: lambda: 7,
    inspect.FloatType: lambda: 1.5,
    inspect.StrType: lambda: "é",
    inspect.BytesType: lambda: b"\x00\xff",
    inspect.BoolType: lambda: True,
    inspect.NoneType: lambda: None,
    inspect.AnyType: lambda: 3,
    inspect.RawType: lambda: msgspec.Raw(b"\x01"),
}


def is_enumeration(kind: Any) -> bool:
    """Whether a type is an enumeration, also one that has a class of its own, which msgspec takes for any other."""
    own = isinstance(kind, inspect.CustomType) and issubclass(kind.cls, enum.Enum)
    return own or isinstance(kind, inspect.EnumType)


def sample(kind: Any, depth: int = 0) -> Any:
    """Return a value of a type in which as much as can be isn't as by default."""
    deep = depth > DEPTH
    if isinstance(kind, inspect.StructType | inspect.DataclassType):
        left_out = [one for one in kind.fields if deep and not getattr(one, "required", True)]
        chosen = {one.name: sample(one.type, depth + 1) for one in kind.fields if one not in left_out}
        # what is true by default shows only where it is false
        chosen |= {one.name: False for one in kind.fields if getattr(one, "default", None) is True}
        return kind.cls(**chosen)
    if isinstance(kind, inspect.UnionType):
        kinds = [one for one in kind.types if not isinstance(one, inspect.NoneType)]
        return sample(next((one for one in kinds if getattr(one, "tag", "") == SHOWN), kinds[0]), depth)
    if isinstance(kind, inspect.DictType):
        return {} if deep else {sample(kind.key_type, depth + 1): sample(kind.value_type, depth + 1)}
    if isinstance(kind, inspect.TupleType):
        return tuple(sample(one, depth + 1) for one in kind.item_types)
    if hasattr(kind, "item_type"):
        items = [] if deep else [sample(kind.item_type, depth + 1)]
        whole = {inspect.VarTupleType: tuple, inspect.SetType: set, inspect.FrozenSetType: frozenset}
        return whole.get(type(kind), list)(items)
    if is_enumeration(kind):
        members: list[enum.Enum] = list(kind.cls)
        return members[-1]
    if isinstance(kind, inspect.LiteralType):
        return kind.values[-1]
    if isinstance(kind, inspect.CustomType):
        return np.arange(2.0)
    return SAMPLES[type(kind)]()


def asked() -> dict[str, str]:
    """Return of each request how it is sent, who does it, and what comes back."""
    found = {}
    for kind in leaves(Request):
        changes = getattr(kind, "needs_control", None)
        control = "" if changes is None else ", needs control" if changes else ", without control"
        robot = ", done by the robot program" if issubclass(kind, RobotRequest) else ""
        reply = inspect.type_info(reply_type(kind)).tag
        told = f"{kind.key}{control}{robot}, {kind.timeout_s:g} s, {kind.max_bytes} bytes: {reply}"
        found[str(inspect.type_info(kind).tag)] = told
    return dict(sorted(found.items()))


def told() -> dict[str, object]:
    """Return what `structs.json` holds."""
    shapes, samples = Shapes(), {}
    for one in all_told():
        shapes.add(one)
        data = one.encode(sample(inspect.type_info(one.kind)))
        samples[one.name] = data.decode() if one.json else data.hex()
    return {"requests": asked(), "shapes": shapes.found, "samples": samples}


def written() -> str:
    """Return the text of `structs.json`."""
    return json.dumps(told(), indent=1, ensure_ascii=False) + "\n"
