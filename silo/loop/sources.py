"""Where the values of an element come from: memory read by address, or an expression read each due tick.

A by-reference source costs some 2 ns per word and tick, an expression 20 ns and more. Lists, floats and NumPy scalars
have no memory that stays: they are refused with the words that say what to write instead.
"""

import ctypes
import datetime
import enum
import itertools
import logging
import math
import mmap
import operator
import sys
import weakref
from array import array
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.errors import SourceError

log = logging.getLogger("silo")

DEFAULT_STRING_BYTES = 64
COUNTED_AT_ONCE = 500  # references, 0.2 ms: so long may a control loop have to wait for the interpreter


@dataclass(frozen=True)
class Reference:
    """Memory read by address: `view` is the array whose bytes are logged; `holds` keeps its memory where it is."""

    view: NDArray[Any]
    holds: tuple[object, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of one item."""
        return self.view.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the source."""
        return self.view.shape

    @property
    def nbytes(self) -> int:
        """Bytes of all items."""
        return self.view.nbytes

    @property
    def is_own(self) -> bool:
        """Whether `log.array` made its memory."""
        return isinstance(self.holds[-1], OwnMemory)


@dataclass(frozen=True)
class PathStep:
    """One step from an object to a value: `.name`, `[key]`, or a call."""

    attr: str = ""
    key: object = None
    call: bool = False

    def __str__(self) -> str:
        if self.call:
            return "()"
        return f".{self.attr}" if self.attr else f"[{self.key!r}]"


@dataclass(frozen=True)
class ValuePath:
    """A value read from `root` by `steps` each due tick, stored as `dtype` of `shape`.

    `convert` turns what is read into what can be stored (an enumeration's member into its number); None where it can be
    stored as it is.
    """

    root: object
    steps: tuple[PathStep, ...]
    dtype: np.dtype[Any]
    shape: tuple[int, ...] = ()
    convert: Callable[[Any], Any] | None = None
    labels: Mapping[int, str] | None = None
    cuts: "CutTexts | None" = field(default=None, compare=False)

    @property
    def nbytes(self) -> int:
        """Bytes of all items."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __str__(self) -> str:
        return type(self.root).__name__ + "".join(map(str, self.steps))


Source = Reference | ValuePath


def read_steps(root: object, steps: tuple[PathStep, ...]) -> Any:
    """What an expression reads."""
    value: Any = root
    for step in steps:
        if step.call:
            value = value()
        elif step.attr:
            value = getattr(value, step.attr)
        else:
            value = value[step.key]
    return value


def reads(source: Source, owners: Sequence[object]) -> bool:
    """Whether a source reads one of these objects, or memory of one."""
    if isinstance(source, ValuePath):
        return any(source.root is one for one in owners)
    arrays = [one for one in owners if isinstance(one, np.ndarray)]
    return any(one is held for one in owners for held in source.holds) or any(
        np.may_share_memory(source.view, one) for one in arrays
    )


def can_refer(value: object) -> bool:
    """Whether a value is memory that can be logged by reference."""
    if isinstance(value, np.generic):
        return False
    if isinstance(value, np.ndarray):
        return not value.dtype.hasobject
    buffers = (
        array,
        memoryview,
        bytearray,
        mmap.mmap,
        ctypes._SimpleCData,
        ctypes.Array,
        ctypes.Structure,
        ctypes.Union,
    )
    return isinstance(value, buffers) or hasattr(value, "__array_interface__")


def refer(value: object, name: str) -> Reference:
    """Log this memory by reference. Raises SourceError that says what to write instead."""
    if not can_refer(value):
        raise SourceError(_cant_refer(value, name))
    view = _view(value, name)
    if view.size == 0:
        raise SourceError(f"{name}: an array of shape {view.shape} holds no value to log")
    if view.dtype.hasobject:
        raise SourceError(_cant_refer(view, name))
    return Reference(view, _holds(value, view))


def _view(value: object, name: str) -> NDArray[Any]:
    try:
        if isinstance(value, np.ndarray):
            return value.view(np.ndarray)
        if isinstance(value, ctypes._SimpleCData | ctypes.Array | ctypes.Structure | ctypes.Union):
            made: NDArray[Any] = np.ndarray((), np.dtype(type(value)), value)  # type: ignore[arg-type]  # a buffer too
            return made
        if isinstance(value, bytearray | mmap.mmap):
            return np.frombuffer(value, np.uint8)
        return np.asarray(memoryview(value) if isinstance(value, array) else value)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise SourceError(f"{name}: {type(value).__name__} can't be logged by reference ({error})") from error


def _holds(value: object, view: NDArray[Any]) -> tuple[object, ...]:
    """References that keep the memory alive and in place.

    A weak reference on each array of the chain makes `resize(refcheck=False)` raise instead of freeing the memory;
    the view's buffer export does the same for `bytearray`, `array` and `mmap`.
    """
    if type(value) is np.ndarray and value.base is None:
        return value, view, value, weakref.ref(value)
    holds: list[object] = [value, view]
    link: object = value
    while isinstance(link, np.ndarray):
        holds += [link, weakref.ref(link)]
        link = link.base
    if link is not None:
        holds.append(link)
    return tuple(holds)


class HeldArrays:
    """The arrays of a table's references, and how often the references themselves refer to each.

    Made once for a table, as counting takes 3 ms for 1,000 elements; `abandoned` is asked at each start.
    """

    def __init__(self, references: Sequence[Reference]) -> None:
        holds = [reference.holds for reference in references]
        held = list(itertools.chain.from_iterable(holds))
        is_array = [isinstance(one, np.ndarray) for one in held]
        every: list[NDArray[Any]] = list(itertools.compress(held, is_array))  # type: ignore[arg-type]  # as was asked
        _, firsts, numbers = np.unique(_ids(every), return_index=True, return_inverse=True)
        arrays = [every[first] for first in firsts.tolist()]
        bases = [array.base for array in arrays]
        owed = Counter(_ids([*every, *(reference.view for reference in references), *bases]).tolist())
        # the count of a fresh object tells what one list of ours, in which each stands besides, and counting itself add
        (added,) = map(sys.getrefcount, [object()])
        self._parts = [arrays[begin : begin + COUNTED_AT_ONCE] for begin in range(0, len(arrays), COUNTED_AT_ONCE)]
        # one that may be written to by its address is never told of: as if it were referred to once more than it can be
        plain = (base is None or isinstance(base, np.ndarray | OwnMemory) for base in bases)
        self._owed = [[owed[id(array)] + added if next(plain) else 0 for array in part] for part in self._parts]
        # the arrays of each reference by their numbers: `numbers` from `begins` on
        self._numbers: NDArray[np.intp] = numbers.reshape(-1)
        self._begins = np.cumsum([0, *is_array])[np.cumsum([0, *map(len, holds)])[:-1]]

    def abandoned(self, pause: Callable[[], None] | None = None) -> list[bool]:
        """Of each reference: whether nobody else refers to the array any more, so that it can't change.

        Told only of arrays whose memory is NumPy's own, or silo's; False where others may write to it by address.
        `pause` is called before every 0.2 ms of it.
        """
        alone: list[bool] = []
        for part, owed in zip(self._parts, self._owed, strict=True):
            if pause is not None:
                pause()
            alone += map(operator.le, map(sys.getrefcount, part), owed)
        if not alone:
            return []
        if pause is not None:
            pause()
        found: list[bool] = np.logical_and.reduceat(np.array(alone)[self._numbers], self._begins).tolist()
        return found


def _ids(some: Sequence[object]) -> NDArray[np.int64]:
    return np.fromiter(map(id, some), np.int64, len(some))


class OwnMemory(mmap.mmap):
    """A block that `log.array` carves variables from: only these are ever written to.

    No array itself: else it would be the base of views of those variables, which must be theirs to be found by.
    """

    def __new__(cls, size_bytes: int) -> "OwnMemory":
        """Zeros; pages that are never used take no memory. Raises OSError, OverflowError where there is no room."""
        return super().__new__(cls, -1, size_bytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)


def _cant_refer(value: object, name: str) -> str:
    short = name.rsplit("/", 1)[-1]
    if isinstance(value, np.ndarray):
        return (
            f"{name}: an array of Python objects (dtype object) has no fixed memory; give it a numeric or string dtype"
        )
    if isinstance(value, bool | int | float | complex | np.generic | str | bytes | enum.Enum):
        return (
            f"{name}: a value of type {type(value).__name__} is no variable: it would never change in the log; "
            f'write {short} = log.array("{short}", ...) and set {short}[...], '
            f'or log an attribute: log.add(owner, attr="{short}"), or a function: log.add(lambda: {short}, "{short}")'
        )
    if isinstance(value, list | tuple):
        return (
            f"{name}: a {type(value).__name__} of plain values can't be logged by reference; "
            f"use a NumPy array: {short} = np.array([...], float), and change it in place: {short}[:] = ..."
        )
    return (
        f"{name}: don't know how to log what is of type {type(value).__name__}; log a NumPy array, an attribute "
        f"(attr=...), a function, or register the type once: silo.register({type(value).__name__}, 'field', ...)"
    )


# --------------------------------------------------------------------------------------------------- expressions


def express(
    root: object, steps: tuple[PathStep, ...], value: object, name: str, *, string_bytes: int | None = None
) -> ValuePath:
    """An expression of one value; its type is that of the `value` now. Raises SourceError where it can't be logged."""
    made = _stored_as(value, string_bytes)
    if made is None:
        raise SourceError(
            f"{name}: the value is {value!r} ({type(value).__name__}) now, its type can't be told; "
            "set it to a number, string, enum or array before it is added"
        )
    _check_fits(value, made, name, string_bytes)
    dtype, shape, convert, labels = made
    cuts = CutTexts(
        name, dtype.itemsize // (4 if dtype.kind == "U" else 1), "letters" if dtype.kind == "U" else "bytes"
    )
    if convert is encode_text:
        convert = _fitting(cuts, is_text=True)
    elif isinstance(value, bytes):
        convert = _fitting(cuts, is_text=False)
    return ValuePath(root, steps, dtype, shape, convert, labels, cuts if dtype.kind in "SU" else None)


def _check_fits(value: object, made: "_Stored", name: str, string_bytes: int | None) -> None:
    dtype, _, convert, labels = made
    numbers = labels or () if isinstance(value, enum.Enum) else [value] if isinstance(value, int) else []
    info = np.iinfo(np.int64)
    too_large = [number for number in numbers if not info.min <= number <= info.max]
    if too_large:
        raise SourceError(
            f"{name}: {too_large[0]} doesn't fit into 64 bits ({info.min} to {info.max}); "
            "log it as a float, or as two numbers"
        )
    if string_bytes is not None and dtype.kind == "S" and not isinstance(value, list | tuple | np.ndarray):
        size = len(convert(value) if convert else value)  # type: ignore[arg-type]
        if size > string_bytes:
            raise SourceError(f"{name}: {value!r} takes {size} bytes, string_bytes is {string_bytes}: raise it")


_Stored = tuple[np.dtype[Any], tuple[int, ...], Callable[[Any], Any] | None, Mapping[int, str] | None]


def _stored_as(value: object, string_bytes: int | None) -> _Stored | None:
    if isinstance(value, enum.Enum):
        convert, labels = enum_codes(type(value))
        return np.dtype(np.int64), (), convert, labels
    if isinstance(value, np.bool_):
        return np.dtype(np.bool_), (), as_bool, None
    if isinstance(value, np.ndarray | np.generic) and not isinstance(value, str | bytes):
        return _items_stored_as(np.asarray(value), string_bytes)
    if isinstance(value, bool):
        return np.dtype(np.bool_), (), as_bool, None
    for kind, dtype in ((int, np.int64), (float, np.float64), (complex, np.complex128)):
        if isinstance(value, kind):
            return np.dtype(dtype), (), None, None
    if isinstance(value, str):
        size = string_bytes or max(DEFAULT_STRING_BYTES, len(encode_text(value)))
        return np.dtype(f"S{size}"), (), encode_text, None
    if isinstance(value, bytes):
        return np.dtype(f"S{string_bytes or max(DEFAULT_STRING_BYTES, len(value))}"), (), None, None
    if isinstance(value, datetime.datetime | datetime.date):
        return np.dtype("<M8[us]"), (), as_utc, None
    if isinstance(value, datetime.timedelta):
        return np.dtype("<m8[us]"), (), as_duration, None
    if isinstance(value, list | tuple):
        return _items_stored_as(np.asarray(value), string_bytes)
    return None


def _items_stored_as(items: NDArray[Any], string_bytes: int | None) -> _Stored | None:
    if items.dtype.hasobject or items.size == 0:
        return None
    dtype = items.dtype
    if dtype.kind in "SU" and string_bytes:  # of letters as many
        dtype = np.dtype(f"{dtype.kind}{max(string_bytes, int(np.char.str_len(items).max()))}")
    return dtype, items.shape, None, None


# what is true or false by its value; None, 2 and 0.5 are neither. A dict's own lookup costs a third of a function
as_bool = {False: False, True: True}.__getitem__


def encode_text(value: str) -> bytes:
    """A string as bytes; the store cuts it at the element's length."""
    return value.encode("utf-8", "replace")


class CutTexts:
    """Tells of texts that are longer than their room: once so that people read it, and each run, for its files."""

    def __init__(self, name: str, room: int, unit: str) -> None:
        self.room, self._name, self._unit = room, name, unit
        self._told = False
        self._note: Callable[[int], None] | None = None

    def begin_run(self, note: Callable[[int], None]) -> None:
        """From now on `note` takes how long a text is that is cut."""
        self._note = note

    def tell(self, length: int) -> None:
        """One of so many bytes, or letters, was cut."""
        if not self._told:
            self._told = True
            log.warning(
                "%s: a text of %d %s is cut to %d: give string_bytes=%d or more where it is added",
                self._name, length, self._unit, self.room, length,
            )  # fmt: skip
        if self._note is not None:
            self._note(length)


def _fitting(cuts: CutTexts, *, is_text: bool) -> Callable[[Any], bytes]:
    """`encode_text`, or bytes as they are; tells of those that are cut, as its first value told how long it may be."""
    size_bytes = cuts.room

    def fitting(value: Any) -> bytes:
        text: bytes = value.encode("utf-8", "replace") if is_text else value
        if len(text) > size_bytes:
            cuts.tell(len(text))
        return text

    return fitting


def as_utc(value: datetime.datetime | datetime.date) -> np.datetime64:
    """A date or time; aware ones become UTC. Raises TypeError for anything else, None too."""
    if not isinstance(value, datetime.date):
        raise TypeError(f"{value!r} is no date or time")
    if isinstance(value, datetime.datetime) and value.tzinfo is not None:
        value = value.astimezone(datetime.timezone.utc).replace(tzinfo=None)
    return np.datetime64(value, "us")


def as_duration(value: datetime.timedelta) -> np.timedelta64:
    """A duration. Raises TypeError for anything else, None too."""
    if not isinstance(value, datetime.timedelta):
        raise TypeError(f"{value!r} is no duration")
    return np.timedelta64(value, "us")


def enum_codes(kind: type[enum.Enum]) -> tuple[Callable[[Any], Any], dict[int, str]]:
    """How members become numbers (their value, or their place where values aren't integers), and the numbers' names."""
    members = list(kind)
    if all(isinstance(member.value, int) for member in members):
        codes = {member: int(member.value) for member in members}
        if issubclass(kind, enum.Flag):  # combinations are values too
            return lambda member: member.value, {code: str(member.name) for member, code in codes.items()}
    else:
        codes = {member: place for place, member in enumerate(members)}
    return codes.__getitem__, {code: str(member.name) for member, code in codes.items()}


# ------------------------------------------------------------------- variables that come together


@dataclass(frozen=True)
class Variable:
    """One of them, as `log.add` takes it."""

    source: object
    name: str
    unit: str = "-"
    kind: str = ""


@dataclass(frozen=True)
class VariableSet:
    """What `log.add` takes in place of a variable; `origin` is the call that made them."""

    origin: str
    each: tuple[Variable, ...]
