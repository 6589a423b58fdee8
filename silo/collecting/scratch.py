"""Memory of silo's own that holds the stamp of the tick and what expressions were read to be.

Expressions of one divider lie side by side, so that one `struct.pack_into` stores them all: 20 ns each, where a NumPy
store costs 100.
"""

import logging
import struct
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.collecting.schema import STAMP_WORDS
from silo.collecting.sources import Expression, Reference, Source

logger = logging.getLogger("silo")

_PACKED = {"f8": "d", "f4": "f4x", "i8": "q", "i4": "i4x", "i2": "h6x", "i1": "b7x"}
_PACKED |= {"u8": "Q", "u4": "I4x", "u2": "H6x", "u1": "B7x", "b1": "?7x"}


def _pack_format(source: Source) -> str | None:
    """The struct format that stores an expression in whole words, None where NumPy has to store it."""
    if not isinstance(source, Expression) or source.shape or source.dtype.str.startswith(">"):
        return None
    if source.dtype.kind == "S":
        return f"{source.dtype.itemsize}s{-source.dtype.itemsize % 8}x"
    return _PACKED.get(source.dtype.str[1:])


@dataclass
class Slot:
    """One source that is copied, and where its value goes."""

    source: Source
    divider: int
    name: str
    pack_format: str | None
    view: NDArray[Any]
    offset: int = 0  # bytes from the start of the scratch
    failed: int = 0

    def store_slowly(self) -> None:
        """Read and store this one source; a failure is counted and said once, the control loop goes on."""
        try:
            self.view[...] = self._checked(self._value())
        except Exception as error:  # noqa: BLE001  # whatever a user's attribute or function raises
            self._fail(error)

    def _value(self) -> Any:
        if isinstance(self.source, Reference):
            return self.source.view
        value = self.source.read()
        return value if self.source.convert is None else self.source.convert(value)

    def _checked(self, value: Any) -> Any:
        if self.view.dtype.kind in "iu" and np.asarray(value).dtype.kind not in "iub":
            raise TypeError(f"{value!r} would be cut to an integer, which it was when it was added: write 0.0, not 0")
        return value

    def _fail(self, error: Exception) -> None:
        self.failed += 1
        if self.view.dtype.kind in "fc":
            self.view[...] = np.nan
        if self.failed == 1:
            logger.warning(
                "%s: reading %s failed (%s: %s); it is logged as %s until it can be read again",
                self.name,
                self.source,
                type(error).__name__,
                error,
                "NaN" if self.view.dtype.kind in "fc" else "its last value",
            )


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
            slot.store_slowly()

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
        groups: dict[int, list[Slot]] = defaultdict(list)
        for slot in self._slots:
            groups[slot.divider].append(slot)
        return dict(groups)

    @property
    def failures(self) -> dict[str, int]:
        """How often each element's expression could not be read, only those that failed."""
        return {slot.name: slot.failed for slot in self._slots if slot.failed}


def packer(slots: list[Slot]) -> struct.Struct:
    """One struct that stores packed slots that lie side by side."""
    return struct.Struct("<" + "".join(slot.pack_format or "" for slot in slots))
