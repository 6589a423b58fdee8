"""Memory of silo's own that holds the stamp of the tick and what expressions were read to be.

Expressions of one divider lie side by side, so that one `struct.pack_into` stores them all: 20 ns each, where a NumPy
store costs 100.
"""

import logging
import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.names import grouped
from silo.loop.sources import Reference, Source, ValuePath, read_steps
from silo.segment.layout import STAMP_WORDS

logger = logging.getLogger("silo")

_PACKED = {"f8": "d", "f4": "f4x", "i8": "q", "i4": "i4x", "i2": "h6x", "i1": "b7x"}
_PACKED |= {"u8": "Q", "u4": "I4x", "u2": "H6x", "u1": "B7x", "b1": "?7x"}


def _pack_format(source: Source) -> str | None:
    """The struct format that stores an expression in whole words, None where NumPy has to store it."""
    if not isinstance(source, ValuePath) or source.shape or source.dtype.str.startswith(">"):
        return None
    if source.dtype.kind == "S":
        return f"{source.dtype.itemsize}s{-source.dtype.itemsize % 8}x"
    return _PACKED.get(source.dtype.str[1:])


_MISSING = {
    "f": np.nan,
    "c": complex(np.nan, np.nan),
    "M": "NaT",
    "m": "NaT",  # as text: it has no unit that would be converted to that of the array
}
_MISSING_TEXTS = {"f": "NaN", "c": "NaN", "M": "NaT", "m": "NaT"}


@dataclass
class Slot:
    """One source that is copied, and where its value goes."""

    source: Source
    divider: int
    name: str
    pack_format: str | None
    view: NDArray[Any]
    offset: int = 0  # bytes from the start of the scratch
    said: bool = False
    first: bytes = b""  # what stands there before the first tick

    def try_store(self) -> bool:
        """Read and store this one source; False where that failed: the view is then what it was, or zero."""
        try:
            value = fitting(self._value(), self.view.dtype, self.view.shape)
            self.view[...] = value
            if self.view.dtype.kind in "SU":
                self._look_for_cut(np.asarray(value))
        except Exception as error:  # noqa: BLE001  # whatever a user's attribute or function raises
            self._say(error)
            return False
        return True

    def _look_for_cut(self, given: NDArray[Any]) -> None:
        """Tell that one of several texts is longer than their room; of one alone `silo.loop.sources` does."""
        cuts = self.source.cuts if isinstance(self.source, ValuePath) else None
        if cuts is None or not self.view.shape or given.dtype.kind not in "SU":
            return
        if given.dtype.itemsize // (4 if given.dtype.kind == "U" else 1) > cuts.room:
            longest = int(np.char.str_len(given).max())
            if longest > cuts.room:
                cuts.tell(longest)

    @property
    def needs_last(self) -> bool:
        """Whether the last value stands for one that is not there: its type has no NaN or NaT."""
        return self.view.dtype.kind not in _MISSING

    def store_missing(self, last: bytes) -> None:
        """Store what stands for a value that is not there: NaN or NaT, else the bytes of the last value."""
        if not self.needs_last:
            self.view[...] = _MISSING[self.view.dtype.kind]
        else:
            self.view.reshape(-1).view(np.uint8)[:] = np.frombuffer(last, np.uint8)

    def _value(self) -> Any:
        if isinstance(self.source, Reference):
            return self.source.view
        value = read_steps(self.source.root, self.source.steps)
        if value is None:
            raise TypeError("the value is None")
        if self.source.convert is None:
            return value
        try:
            return self.source.convert(value)
        except (KeyError, AttributeError) as error:
            raise TypeError(f"{value!r} ({type(value).__name__}) is none of what it was when it was added") from error

    def _say(self, error: Exception) -> None:
        if self.said:
            return
        self.said = True
        logger.warning(
            "%s: reading %s failed (%s: %s); it is logged as %s until it can be read again",
            self.name,
            self.source,
            type(error).__name__,
            error,
            _MISSING_TEXTS.get(self.view.dtype.kind, "its last value"),
        )


def fitting(value: Any, dtype: np.dtype[Any], shape: tuple[int, ...] = ()) -> Any:
    """The value, if storing it as `dtype` and `shape` keeps what it says; TypeError or OverflowError otherwise.

    NumPy by itself cuts 0.5 to 0 and 300 to 44, writes None as the text `None`, and spreads one value over all.
    """
    given = np.asarray(value)
    if shape and given.shape != shape:
        if given.size != math.prod(shape) or _without_ones(given.shape) != _without_ones(shape):
            raise TypeError(f"shape {given.shape} now, {shape} when it was added")
        value = given = given.reshape(shape)  # the same values, in other brackets
    if dtype.kind == "f" and given.dtype.kind == "O":
        return float(value)  # integers of any size, Decimal, Fraction
    if dtype.kind in "iu":
        if isinstance(value, int) and given.dtype.kind == "O":
            raise OverflowError(f"{value} doesn't fit into {dtype.name}")
        if given.dtype.kind not in "iub":
            raise TypeError(f"{value!r} would be cut to an integer, which it was when it was added: write 0.0, not 0")
        info = np.iinfo(dtype)
        if given.size and not (info.min <= int(given.min()) and int(given.max()) <= info.max):
            raise OverflowError(f"{value!r} doesn't fit into {dtype.name} ({info.min} to {info.max})")
    elif dtype.kind == "b" and given.dtype.kind in "iuf":
        if not np.isin(given, (0, 1)).all():
            raise TypeError(f"{value!r} is neither true nor false, which it was when it was added")
        return given.astype(bool)
    elif (dtype.kind in "SU" and given.dtype.kind not in "SU") or not np.can_cast(given.dtype, dtype, "same_kind"):
        raise TypeError(f"{value!r} is no {dtype.name}, which it was when it was added")
    elif dtype.kind in "fc" and not np.can_cast(given.dtype, dtype):
        with np.errstate(over="ignore"):
            made = given.astype(dtype)
        if (np.isinf(made) & np.isfinite(given)).any():
            raise OverflowError(f"{value!r} doesn't fit into {dtype.name}")
        return made
    return value


def _without_ones(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(size for size in shape if size != 1)


class Scratch:
    """Two words of stamp, then the slots. Add all, then `freeze`, then use."""

    def __init__(self) -> None:
        self._slots: list[Slot] = []
        self._by_source: dict[int, Slot] = {}
        self.words: NDArray[np.int64] = np.zeros(STAMP_WORDS, np.int64)

    def add(self, source: Source, divider: int, name: str) -> None:
        """Give a source a slot."""
        slot = Slot(source, divider, name, _pack_format(source), np.empty(source.shape, source.dtype))
        self._slots.append(slot)
        self._by_source[id(source)] = slot

    def freeze(self) -> None:
        """Lay out the slots, packed ones of a divider side by side."""
        self._slots.sort(key=lambda slot: (slot.divider, slot.pack_format is None))
        offset = 8 * STAMP_WORDS
        for slot in self._slots:
            slot.offset = offset
            offset += -(-max(slot.view.nbytes, 1) // 8) * 8
        self.words = np.zeros(offset // 8, np.int64)
        for slot in self._slots:
            view: NDArray[Any] = np.ndarray(slot.view.shape, slot.view.dtype, self.words.data, slot.offset)
            slot.view = view
            slot.try_store()
            slot.first = view.tobytes()

    def again(self) -> "Scratch":
        """Another one with the same layout, in memory of its own, its sources read anew."""
        made = Scratch()
        for slot in self._slots:
            made.add(slot.source, slot.divider, slot.name)
        made.freeze()
        return made

    @property
    def address(self) -> int:
        """Memory address of the first word."""
        return int(self.words.__array_interface__["data"][0])

    def place_of(self, source: Source) -> NDArray[Any] | None:
        """Where a source's value is copied to; None for what is gathered from its own memory."""
        slot = self._by_source.get(id(source))
        return None if slot is None else slot.view

    def by_divider(self) -> dict[int, list[Slot]]:
        """The slots of each divider, packed ones first and side by side."""
        return grouped((slot.divider, slot) for slot in self._slots)


def packer(slots: list[Slot]) -> struct.Struct:
    """One struct that stores packed slots that lie side by side."""
    return struct.Struct("<" + "".join(slot.pack_format or "" for slot in slots))
