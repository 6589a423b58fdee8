"""Messages of JSON: the numbers, truths and texts in them, and lists of such, by their paths, with the types that the
values have.

Nothing says which keys there are, so that all messages are looked at once, before any value is asked for: a key that
comes late is a signal like the first one, and integers are of a type that holds all of them.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import masked
from silo.files.others.message_types import MOST_VALUES, FieldSpec, Path
from silo.files.others.topics import Bad, Equal

_MOST_SIGNALS = 10_000  # of a topic: keys that are numbers themselves would be as many as messages
_MOST_DEPTH = 50
_LISTS = {"number": "list", "truth": "list of truths", "text": "list of texts"}  # of what, and what it is
_SIGNALS = {*_LISTS, *_LISTS.values()}
_OTHER = "list of other things"
_KIND_OF = {bool: "truth", int: "number", float: "number", str: "text"}
_EXACT = 2**53
_MOST_TEXT_BYTES = 64 << 20  # of a column


@dataclass
class _Met:
    """What stands at a path: how often as which kind, and the first message in which it is so."""

    counts: dict[str, list[int]] = field(default_factory=dict)
    low: int = 0
    high: int = 0
    inexact: bool = False
    fractions: bool = False
    most: int = 0

    def add(self, kind: str, number: int) -> None:
        """Count a value."""
        found = self.counts.setdefault(kind, [0, number])
        found[0] += 1
        found[1] = min(found[1], number)

    def number(self, value: float) -> None:
        """Take in a number: of which type a column of them must be."""
        if isinstance(value, int):
            self.low, self.high = min(self.low, value), max(self.high, value)
            self.inexact = self.inexact or not -_EXACT <= value <= _EXACT
        else:
            self.fractions = True

    @property
    def kind(self) -> str:
        """What it is as a rule; empty where it never is a signal."""
        return max(self.counts.keys() & _SIGNALS, key=lambda kind: self.counts[kind][0], default="")

    @property
    def dtype(self) -> str:
        """The type of a column: integers as long as one type holds them all."""
        if self.kind in ("truth", _LISTS["truth"]):
            return "b1"
        if self.kind in ("text", _LISTS["text"]):
            return "S"
        if self.fractions or not (self.low >= -(2**63) and self.high < 2 ** (64 if self.low >= 0 else 63)):
            return "f8"
        return "i8" if self.high < 2**63 else "u8"


def signals_of(groups: Iterable[Equal], bad: Bad) -> tuple[list[FieldSpec], list[Path], list[str]]:
    """Return the elements that messages show, what in them is none, and what has to be told of single values."""
    met: dict[Path, _Met] = {}
    for number, message in _decoded(groups, bad):
        _look(message, (), met, number)
    signals = {path: one for path, one in met.items() if one.kind}
    found = [_wanted(path, one) for path, one in signals.items()]
    told = [f"/{'/'.join(path)} {text}" for path, one in signals.items() for text in _told(one)]
    if len(met) >= _MOST_SIGNALS:
        told.append(f" has more than {_MOST_SIGNALS:,} keys: those that come later are left out")
    return found, [path for path, one in met.items() if not one.kind], told


def _wanted(path: Path, one: _Met) -> FieldSpec:
    count = one.most if one.kind in _LISTS.values() else 0
    suffixes = tuple(f"_{at}" for at in range(count)) or ("",)
    return FieldSpec(path, (path,), one.dtype, "vector" if count else "scalar", suffixes, count)


def _told(one: _Met) -> Iterator[str]:
    main = one.kind
    for kind, (count, first) in one.counts.items():
        if kind not in (main, "empty list"):
            times = "once" if count == 1 else f"in {count:,} messages"
            yield f"is a {main}, but a {kind} {times}, first in number {first:,}: left out there"
    if main in ("number", "list") and one.dtype == "f8" and one.inexact:
        yield "has integers that no type holds together with the others: they are rounded to 53 bits"


def _look(value: Any, path: Path, met: dict[Path, _Met], number: int) -> None:
    if isinstance(value, dict) and len(path) < _MOST_DEPTH:
        for key, each in value.items():
            _look(each, (*path, str(key)), met, number)
        return
    if value is None or (path not in met and len(met) >= _MOST_SIGNALS):
        return
    kind = _kind(value)
    one = met.setdefault(path, _Met())
    one.add(kind, number)
    if kind == "number":
        one.number(value)
    elif kind in _LISTS.values():
        one.most = max(one.most, len(value))
        for each in value if kind == _LISTS["number"] else ():
            one.number(each)


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, int | float):
        return "number"
    if isinstance(value, str):
        return "text"
    if value == []:
        return "empty list"
    if not isinstance(value, list) or len(value) > MOST_VALUES:
        return _OTHER
    kinds = {_KIND_OF.get(type(each), "") for each in value}
    return _LISTS.get(kinds.pop(), _OTHER) if len(kinds) == 1 else _OTHER


def columns_of(wanted: Sequence[FieldSpec], groups: Iterable[Equal], total: int, bad: Bad) -> dict[Path, NDArray[Any]]:
    """Return the values of elements in all messages.

    What a message has not is NaN, an empty text, or masked: integers stay integers.
    """
    room = {one.name: _MOST_TEXT_BYTES // max(total * max(one.count, 1), 1) for one in wanted}
    longest = {one.name: max(8 if one.count else 256, room[one.name]) for one in wanted}
    made: dict[Path, list[Any]] = {one.name: [None] * total for one in wanted}
    for number, message in _decoded(groups, bad):
        for one in wanted:
            value: Any = message
            for key in one.name:
                value = value.get(key) if isinstance(value, dict) else None
            kind = _KINDS.get(one.dtype, "number")
            if value is None or _kind(value) != (_LISTS[kind] if one.count else kind):
                continue
            if one.dtype == "S":
                most = longest[one.name]
                value = [text.encode()[:most] for text in value] if one.count else value.encode()[:most]
            made[one.name][number] = value
    return {one.name: _column(made[one.name], one) for one in wanted}


_KINDS = {"b1": "truth", "S": "text"}


def _column(values: list[Any], one: FieldSpec) -> NDArray[Any]:
    if one.dtype == "S" and not one.count:
        return np.array([b"" if value is None else value for value in values], "S")
    if one.dtype == "S":
        rows = [[*(value or ()), *[b""] * (one.count - len(value or ()))] for value in values]
        return np.array(rows, "S").reshape(len(values), one.count)
    dtype = np.dtype(one.dtype)
    missing = np.ones((len(values), one.count) if one.count else len(values), bool)
    made = np.zeros(missing.shape, dtype)
    for at, value in enumerate(values):
        if value is not None:
            place = (at, slice(len(value))) if one.count else at
            made[place] = value if dtype.kind != "f" else list(map(_float, value)) if one.count else _float(value)
            missing[place] = False
    return masked(made, missing)


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer of more than 308 digits
        return float("inf") if value > 0 else float("-inf")


def _decoded(groups: Iterable[Equal], bad: Bad) -> Iterator[tuple[int, Any]]:
    for which, rows in groups:
        for number, row in zip(which.tolist(), rows, strict=True):
            try:
                yield number, _message(row.tobytes())
            except (ValueError, RecursionError) as error:  # noqa: PERF203  # one by one, as each may be damaged
                bad.append((np.array([number]), _no_json(error)))


def _no_json(error: Exception) -> str:
    return f"it is no JSON: {error}"


def _message(text: bytes) -> Any:
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        return json.loads(text)  # Python writes NaN and Infinity, which JSON has not
