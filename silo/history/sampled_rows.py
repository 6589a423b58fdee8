"""Raw rows as they travel: 8-byte words as they stand in a ring, and where each entry is to be found in them.

Rows are sent as they are, so that a helper process copies a ring's memory once, however many elements are asked for;
the client picks them apart. Imports no NumPy.
"""

import msgspec


class SampledEntry(msgspec.Struct, frozen=True, array_like=True):
    """One scalar: `offset` bytes from the begin of its row; `swapped`: big-endian there."""

    suffix: str
    dtype: str
    offset: int
    swapped: bool = False


class SampledName(msgspec.Struct, frozen=True):
    """Where the samples of a name stand: in rows of the group `group`, one at every `divider` ticks.

    A name may have two groups: its own buffer, and what came after that was full. `shape` is that of the element, empty
    for a single entry.
    """

    name: str
    group: int
    divider: int
    shape: tuple[int, ...]
    entries: list[SampledEntry]


class SampledRows(msgspec.Struct, frozen=True):
    """Rows `first ... first + count - 1` since start, without a gap.

    Each row opens with its tick and its time stamp in ns, both int64; the words of its entries follow. All
    little-endian.
    """

    group: int
    first: int
    count: int
    data: bytes


class StreamFrame(msgspec.Struct, frozen=True):
    """What came since the last frame of a stream: put on `.../stream/<id>`; `generation` is that of `StreamOpened`.

    A row number beyond the one that was expected is a loss; a smaller one with another `run` is a new start.
    """

    generation: int
    run: str
    rows: list[SampledRows]
