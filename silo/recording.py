"""What was logged, as plain data: the one noun between segments, files and analysis.

The segment's reader makes a `Recording` (a snapshot), every file writer takes one, every file reader returns one.
It knows no logger, no file and no process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.model import BufferType, Entry

Progress = Callable[[float], None]  # called with the share that is done, 0 to 1


@dataclass(frozen=True)
class RecordedEntry:
    """One scalar signal: `values` has shape `(m,)`, oldest first; it may be a strided view or a memory map.

    Enumerations stay integers here, `entry.labels` names them. Strings are bytes (`S` dtype).
    """

    name: str
    entry: Entry
    values: NDArray[Any]


@dataclass(frozen=True)
class RecordedElement:
    """One element with its samples.

    Sample i of every entry belongs to time stamp `first + i * divider` of the recording: a buffer keeps either the
    first or the newest samples, so what it holds is always one unbroken run. `lost` counts the samples that fell
    due and could not be kept although the policy asked for them (memory limit). `dtype` are the fields of a NumPy
    structure (`silo.kinds.struct_text`), empty for all else.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    divider: int
    buffer_type: BufferType
    first: int
    entries: tuple[RecordedEntry, ...]
    description: str = ""
    lost: int = 0
    dtype: str = ""

    @property
    def count(self) -> int:
        """Samples per entry."""
        return len(self.entries[0].values) if self.entries else 0

    @property
    def stamp_indices(self) -> NDArray[np.int64]:
        """Shape `(count,)`: which time stamp of the recording each sample belongs to."""
        return self.first + np.arange(self.count, dtype=np.int64) * self.divider


@dataclass(frozen=True)
class Recording:
    """A whole log at one moment.

    `time_ns` has shape `(n,)`: int64 nanoseconds since 1970 (or of the logger's own clock), one per kept tick, oldest
    first; the last one is tick `offset - 1`. `offset` counts the ticks since start (the original's "time
    synchronization offset"). `started_ns` is the wall clock at start, 0 where unknown.
    """

    logger: str
    time_ns: NDArray[np.int64]
    offset: int
    elements: Sequence[RecordedElement]
    prefix: str = "/log"
    frequency_hz: float | None = None
    started_ns: int = 0
    time_looping: bool = False
    warnings: tuple[str, ...] = field(default=())

    @property
    def entry_count(self) -> int:
        """Scalar signals of all elements, the time stamps not counted."""
        return sum(len(element.entries) for element in self.elements)
