"""A logger's parameters as those of a ROS 2 node: its six services, and what stands on `/parameter_events`.

Numbers, truth values, texts and lists of them are ROS's own; an enumeration is its word, an array of several dimensions
flat. `/log/legs/kp` is `log.legs.kp`. Nobody in the graph has a name to prove or an address, so all of it is taken for
another computer: what is not `writable="anywhere"` is read-only. Pure rules, no session.

Source: github.com/ros2/rcl_interfaces. Hashes are those of Jazzy to Lyrical, in which these types are the same.
"""

import math
import struct
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from silo.bridges.services import Audit, Tune
from silo.core.tuning.parameters import ParameterInfo, ParameterKind, ParameterValue, Writable, range_text
from silo.errors import SiloError
from silo.files.bags.ros_types import ENCAPSULATION, CdrReader, add_numbers, add_text

SECOND_NS = 1_000_000_000
EVENTS, EVENT = "/parameter_events", "rcl_interfaces/msg/ParameterEvent"
EVENT_HASH = "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"
HASHES = {
    "ListParameters": "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
    "GetParameters": "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
    "GetParameterTypes": "RIHS01_da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
    "DescribeParameters": "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
    "SetParameters": "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
    "SetParametersAtomically": "RIHS01_0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
}
NOT_SET, BOOL, INTEGER, DOUBLE, STRING, BYTES, BOOLS, INTEGERS, DOUBLES, STRINGS = range(10)
Write = Callable[[bytearray], None]
_TYPES = {
    ParameterKind.BOOL: BOOL, ParameterKind.INT: INTEGER, ParameterKind.FLOAT: DOUBLE, ParameterKind.ENUM: STRING,
    ParameterKind.STRING: STRING,
}  # fmt: skip
# the fields of a ParameterValue behind its type: the code of a number, "" for a text, and whether there are many
_FIELDS = [("?", 0), ("q", 0), ("d", 0), ("", 0), ("B", 1), ("?", 1), ("q", 1), ("d", 1), ("", 1)]


@dataclass
class NodeParameters:
    """The parameters of a node by their names in ROS; without `tune` they are read-only."""

    node: str
    tune: Tune | None
    caller: str
    audit: Audit
    known: dict[str, ParameterInfo] = field(default_factory=dict)
    _told: dict[str, ParameterInfo] = field(default_factory=dict)  # by `/parameter_events`

    def services(self) -> dict[str, tuple[str, str, Callable[[bytes], bytes]]]:
        """Return type, its hash, and what answers a request, by name. They raise ValueError for what is no request."""
        answers = {
            "ListParameters": self._list,
            "GetParameters": lambda asked: _sequences(map(_add_value, self._asked(asked))),
            "GetParameterTypes": self._types,
            "DescribeParameters": lambda asked: _sequences(map(self._describe, self._asked(asked))),
            "SetParameters": self._set,
            "SetParametersAtomically": self._set_all,
        }
        names = {name: "".join(f"_{one.lower()}" if one.isupper() else one for one in name)[1:] for name in answers}
        return {
            f"{self.node}/{names[name]}": (f"rcl_interfaces/srv/{name}", HASHES[name], answer)
            for name, answer in answers.items()
        }

    def turn(self, known: Sequence[ParameterInfo]) -> bytes | None:
        """Take in what they are now; returns the message on `/parameter_events`, None where nothing changed."""
        before, self.known = self._told, _by_name(known)
        self._told = self.known
        new = [name for name in self.known if name not in before]
        gone = [name for name in before if name not in self.known]
        changed = [name for name in self.known if name in before and before[name].value != self.known[name].value]
        if not (new or gone or changed):
            return None
        body = bytearray(struct.pack("<iI", *divmod(time.time_ns(), SECOND_NS)))
        add_text(body, self.node)
        for names, found in ((new, self.known), (changed, self.known), (gone, before)):
            add_numbers(body, "I", len(names))
            for name in names:
                add_text(body, name)
                _add_value(found[name])(body)
        return ENCAPSULATION + body

    # ----------------------------------------------------------------------------------------------------- services

    def _asked(self, request: bytes) -> list[ParameterInfo | None]:
        reader = CdrReader(request, "a request")
        return [self.known.get(name) for name in reader.items(reader.text)]

    def _list(self, request: bytes) -> bytes:
        reader = CdrReader(request, "a request")
        prefixes, (depth,) = reader.items(reader.text), reader.numbers("Q")

        def is_meant(name: str) -> bool:
            rests = [name.removeprefix(f"{one}.") for one in prefixes if name.startswith(f"{one}.")]
            return name in prefixes or any(
                not depth or rest.count(".") < depth for rest in ([name] if not prefixes else rests)
            )

        names = [name for name in self.known if is_meant(name)]
        groups = dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)
        return _sequences(map(_text, names), map(_text, groups))

    def _types(self, request: bytes) -> bytes:
        types = bytes(_type_of(info) for info in self._asked(request))
        return ENCAPSULATION + struct.pack("<I", len(types)) + types

    def _describe(self, info: ParameterInfo | None) -> Write:
        def write(body: bytearray) -> None:
            if info is None:
                add_text(body, "")
                add_numbers(body, "B", NOT_SET)
                add_text(body, "")
                add_text(body, "")
                body += b"\0\0"
                add_numbers(body, "II", 0, 0)
                return
            unit = "" if info.unit in ("", "-") else f"{info.unit}; "
            add_text(body, _ros_name(info))
            add_numbers(body, "B", _type_of(info))
            add_text(body, f"{unit}{info.description}".removesuffix("; "))
            add_text(body, range_text(info))
            body += bytes([self.tune is None or info.writable is not Writable.ANYWHERE, 0])
            low, high = info.minimum, info.maximum
            bounded = low is not None and high is not None
            is_int = info.kind is ParameterKind.INT
            add_numbers(body, "I", int(bounded and not is_int))
            if low is not None and high is not None:
                if is_int:
                    add_numbers(body, "I", 1)
                    add_numbers(body, "qqQ", math.ceil(low), math.floor(high), round(info.step or 0))
                    return
                add_numbers(body, "ddd", low, high, info.step or 0.0)
            add_numbers(body, "I", 0)

        return write

    def _set(self, request: bytes) -> bytes:
        return _sequences([_result(*self._tuned(dict([one]))) for one in _parameters(request)])

    def _set_all(self, request: bytes) -> bytes:
        body = bytearray()
        _result(*self._tuned(dict(_parameters(request))))(body)
        return ENCAPSULATION + body

    def _tuned(self, values: Mapping[str, ParameterValue | None]) -> tuple[bool, str]:
        wanted = {self.known[name].name: value for name, value in values.items() if name in self.known}
        given = {name: value for name, value in wanted.items() if value is not None}
        done, text = False, "parameters can't be set: this is read-only (`silo ros2 --control`)"
        if len(wanted) < len(values):
            text = f"no parameter {', '.join(name for name in values if name not in self.known)}; nothing was changed"
        elif len(given) < len(values):
            text = "a parameter can't be taken away, it is the program's; nothing was changed"
        elif self.tune is not None:
            try:
                text, known = self.tune(given, self.caller, True)
                self.known, done = _by_name(known), True
            except SiloError as error:
                text = str(error)
        self.audit.note(", ".join(values), "set", self.caller, text, done=done)
        return done, text


def _by_name(known: Sequence[ParameterInfo]) -> dict[str, ParameterInfo]:
    """The parameters by their names in ROS, of two alike (`a/b` and `a.b`) the first."""
    found: dict[str, ParameterInfo] = {}
    for info in known:
        found.setdefault(_ros_name(info), info)
    return found


def _ros_name(info: ParameterInfo) -> str:
    return info.name.strip("/").replace("/", ".")


def _type_of(info: ParameterInfo | None) -> int:
    return NOT_SET if info is None else _TYPES[info.kind] + (BOOLS - BOOL if info.shape else 0)


# ---------------------------------------------------------------------------------------------------------- messages


def _sequences(*lists: Iterable[Write]) -> bytes:
    body = bytearray()
    for writes in map(list, lists):
        add_numbers(body, "I", len(writes))
        for write in writes:
            write(body)
    return ENCAPSULATION + body


def _text(text: str) -> Write:
    return lambda body: add_text(body, text)


def _result(done: bool, reason: str) -> Write:
    def write(body: bytearray) -> None:
        body.append(done)
        add_text(body, reason)

    return write


def _add_value(info: ParameterInfo | None) -> Write:
    kind = _type_of(info)
    value: ParameterValue = 0 if info is None else info.value
    items = list(value) if isinstance(value, tuple) else [value]

    def write(body: bytearray) -> None:
        body.append(kind)
        for place, (code, many) in enumerate(_FIELDS, start=1):
            mine = items if place == kind else [] if many else [0 if code else ""]
            if many:
                add_numbers(body, "I", len(mine))
            if code:
                add_numbers(body, code * len(mine), *mine)
            else:
                for text in mine:
                    add_text(body, str(text))

    return write


def _parameters(request: bytes) -> list[tuple[str, ParameterValue | None]]:
    """What a request sets, by name; None for what it takes away."""
    reader = CdrReader(request, "a request")
    return reader.items(lambda: (reader.text(), _value(reader)))


def _value(reader: CdrReader) -> ParameterValue | None:
    (kind,) = reader.numbers("B")
    found: ParameterValue | None = None
    for place, (code, many) in enumerate(_FIELDS, start=1):
        count = reader.count() if many else 1
        read = reader.numbers(code * count) if code else tuple(reader.text() for _ in range(count))
        if place == kind:
            found = read if many else read[0]
    return found
