"""Memory that `log.array` carves variables from: side by side, so that a tick copies them in one stroke."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.errors import SourceError
from silo.loop.sources import OwnMemory

BLOCK_BYTES = 1 << 18  # pages that are never used are never touched


class Arena:
    """Grows by blocks; what was handed out never moves."""

    def __init__(self) -> None:
        self._block: OwnMemory | None = None
        self._size = self._used = 0

    def array(self, sizes: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
        """Zeros of this shape and type, aligned to 8 bytes. Raises SourceError where there is no memory for them."""
        count = math.prod(sizes) * kind.itemsize
        size = max(8, -(-count // 8) * 8)
        if self._block is None or self._used + size > self._size:
            try:
                self._block, self._size = OwnMemory(max(BLOCK_BYTES, size)), max(BLOCK_BYTES, size)
            except (OSError, OverflowError):
                raise SourceError(f"no memory for an array of shape {sizes} and type {kind}: {count} bytes") from None
            self._used = 0
        array: NDArray[Any] = np.ndarray(sizes, kind, self._block, self._used)
        self._used += size
        return array
