"""Memory that `log.array` carves variables from: side by side, so that a tick copies them in one stroke."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.errors import SourceError

BLOCK_WORDS = 1 << 15  # 256 kB; pages that are never used are never touched


class Arena:
    """Grows by blocks; what was handed out never moves."""

    def __init__(self) -> None:
        self._block: NDArray[np.uint64] = np.zeros(0, np.uint64)
        self._used = 0

    def array(self, sizes: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
        """Zeros of this shape and type, aligned to 8 bytes. Raises SourceError where there is no memory for them."""
        count = math.prod(sizes) * kind.itemsize
        words = max(1, -(-count // 8))
        if self._used + words > len(self._block):
            try:
                self._block = np.zeros(max(BLOCK_WORDS, words), np.uint64)
            except MemoryError:
                raise SourceError(f"no memory for an array of shape {sizes} and type {kind}: {count} bytes") from None
            self._used = 0
        array: NDArray[Any] = np.ndarray(sizes, kind, self._block.data, 8 * self._used)
        self._used += words
        return array
