"""Memory that `log.array` carves variables from: side by side, so that a tick copies them in one stroke."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.errors import SourceError

BLOCK_WORDS = 1 << 15  # 256 kB; pages that are never used are never touched


class Arena:
    """Grows by blocks; what was handed out never moves."""

    def __init__(self) -> None:
        self._block: NDArray[np.uint64] = np.zeros(0, np.uint64)
        self._used = 0

    def array(self, shape: int | tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Zeros of this shape and type, aligned to 8 bytes. Raises SourceError for types without fixed memory."""
        kind = np.dtype(dtype)
        if kind.hasobject or kind.itemsize == 0:
            raise SourceError(f"dtype {kind} has no fixed size in memory; for text give a length: dtype='S32'")
        sizes = (shape,) if isinstance(shape, int) else tuple(shape)
        count = int(np.prod(sizes, dtype=np.int64)) * kind.itemsize
        words = max(1, -(-count // 8))
        if self._used + words > len(self._block):
            self._block = np.zeros(max(BLOCK_WORDS, words), np.uint64)
            self._used = 0
        array: NDArray[Any] = np.ndarray(sizes, kind, self._block.data, 8 * self._used)
        self._used += words
        return array
