"""Messages of JSON: the numbers, truths and texts in them by their paths, with the types that the values have.

Nothing says which keys there are, so that all messages are looked at once, before any value is asked for: a key that
comes late is a signal like the first one, and integers are of a type that holds all of them.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import masked
from silo.files.others.message_types import MOST_VALUES, FieldSpec, Path
from silo.files.others.topics import Bad, Equal

_MOST_SIGNALS = 10_000  # of a topic: keys that are numbers themselves would be as many as messages
_MOST_DEPTH = 50
_SIGNALS = {"truth", "number", "text", "list"}
_EXACT = 2**53
_MOST_TEXT_BYTES = 64 << 20  # of a column
_SOME = 300  # messages whose values are counted together


@dataclass
class _Met:
    """What stands at a path: how often as which kind, and the first message in which it is so."""

    counts: dict[str, list[int]] = field(default_factory=dict)
    low: int = 0
    high: int = 0
    fractions: bool = False
    most: int = 0

    def add(self, found: Sequence[tuple[int, Any]]) -> None:
        """Take in values and the messages that they stand in."""
        kinds = [_kind(value) for _, value in found]
        numbers: list[float] = []
        for kind in dict.fromkeys(kinds):
            of_kind = [each for each, its in zip(found, kinds, strict=True) if its == kind]
            count = self.counts.setdefault(kind, [0, of_kind[0][0]])
            count[:] = count[0] + len(of_kind), min(count[1], *(number for number, _ in of_kind))
            if kind == "list":
                self.most = max(self.most, *(len(row) for _, row in of_kind))
                numbers += [each for _, row in of_kind for each in row]
            elif kind == "number":
                numbers += [value for _, value in of_kind]
        whole = [value for value in numbers if isinstance(value, int)]
        self.low, self.high = min([self.low, *whole]), max([self.high, *whole])
        self.fractions = self.fractions or len(whole) < len(numbers)

    @property
    def kind(self) -> str:
        """What it is as a rule; empty where it never is a signal."""
        return max(self.counts.keys() & _SIGNALS, key=lambda kind: self.counts[kind][0], default="")

    @property
    def dtype(self) -> str:
        """The type of a column: integers as long as one type holds them all."""
        if self.kind == "truth":
            return "b1"
        if self.kind == "text":
            return "S"
        if self.fractions or not (self.low >= -(2**63) and self.high < 2 ** (64 if self.low >= 0 else 63)):
            return "f8"
        return "i8" if self.high < 2**63 else "u8"


def signals_of(messages: Callable[[Bad], Iterable[Equal]], bad: Bad) -> tuple[list[FieldSpec], list[Path], list[str]]:
    """Return the elements that messages show, what in them is none, and what has to be told of single values."""
    met = _met_in_all(messages(bad), bad)
    signals = {path: one for path, one in met.items() if one.kind}
    found = [_wanted(path, one) for path, one in signals.items()]
    told = [f"/{'/'.join(path)} {text}" for path, one in signals.items() for text in _told(one)]
    if len(met) >= _MOST_SIGNALS:
        told.append(f" has more than {_MOST_SIGNALS:,} keys: those that come later are left out")
    return found, [path for path, one in met.items() if not one.kind], told


def _met_in_all(messages: Iterable[Equal], bad: Bad) -> dict[Path, _Met]:
    met: dict[Path, _Met] = {}
    decoded = _decoded(messages, bad)
    while some := list(islice(decoded, _SOME)):
        found: dict[Path, list[tuple[int, Any]]] = defaultdict(list)
        for number, message in some:
            _spread(message, (), found, number)
        for path, values in found.items():
            if path in met or len(met) < _MOST_SIGNALS:
                met.setdefault(path, _Met()).add(values)
    return met


def _wanted(path: Path, one: _Met) -> FieldSpec:
    count = one.most if one.kind == "list" else 0
    suffixes = tuple(f"_{at}" for at in range(count)) or ("",)
    return FieldSpec(path, (path,), one.dtype, "vector" if count else "scalar", suffixes, count)


def _told(one: _Met) -> Iterator[str]:
    main = one.kind
    for kind, (count, first) in one.counts.items():
        if kind not in (main, "empty list"):
            times = "once" if count == 1 else f"in {count:,} messages"
            yield f"is a {main}, but a {kind} {times}, first in number {first:,}: left out there"
    if main in ("number", "list") and one.dtype == "f8" and not -_EXACT <= one.low <= one.high <= _EXACT:
        yield "has integers that no type holds together with the others: they are rounded to 53 bits"


def _spread(value: Any, path: Path, found: dict[Path, list[tuple[int, Any]]], number: int) -> None:
    if isinstance(value, dict) and len(path) < _MOST_DEPTH:
        for key, each in value.items():
            _spread(each, (*path, key), found, number)
    elif value is not None:
        found[path].append((number, value))


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, int | float):
        return "number"
    if isinstance(value, str):
        return "text"
    if value == []:
        return "empty list"
    numbers = isinstance(value, list) and len(value) <= MOST_VALUES and all(map(_number, value))
    return "list" if numbers else "list of other things"


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def columns_of(wanted: Sequence[FieldSpec], groups: Iterable[Equal], total: int, bad: Bad) -> dict[Path, NDArray[Any]]:
    """Return the values of elements in all messages.

    What a message has not is NaN, an empty text, or masked: integers stay integers.
    """
    longest = max(256, _MOST_TEXT_BYTES // max(total, 1))
    made: dict[Path, list[Any]] = {one.name: [None] * total for one in wanted}
    for number, message in _decoded(groups, bad):
        for one in wanted:
            value: Any = message
            for key in one.name:
                value = value.get(key) if isinstance(value, dict) else None
            if value is not None and _kind(value) == _KINDS.get(one.dtype, "list" if one.count else "number"):
                made[one.name][number] = value.encode()[:longest] if one.dtype == "S" else value
    return {one.name: _column(made[one.name], one) for one in wanted}


_KINDS = {"b1": "truth", "S": "text"}


def _column(values: list[Any], one: FieldSpec) -> NDArray[Any]:
    if one.dtype == "S":
        return np.array([b"" if value is None else value for value in values], "S")
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
                bad.append((np.array([number]), f"it is no JSON: {error}"))


def _message(text: bytes) -> Any:
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        return json.loads(text)  # Python writes NaN and Infinity, which JSON has not
