"""Which samples a buffer keeps: the one place where its type is turned into rows. Several elements share a ring."""

from typing import Protocol

from silo.model import BufferType


class Buffer(Protocol):
    """What decides: of an element's options, or of several that are kept alike."""

    @property
    def buffer_type(self) -> BufferType:
        """Which samples are kept."""

    @property
    def buffer_size(self) -> int:
        """How many, or how many to begin with."""


def kept_rows(options: Buffer, begin: int, end: int) -> tuple[int, int]:
    """Return which of the rows `begin <= row < end` of its ring belong to an element's buffer, as begin and end."""
    if options.buffer_type is BufferType.FIXED:
        end = min(end, options.buffer_size)
    elif options.buffer_type is BufferType.LOOPING:
        begin = max(begin, end - options.buffer_size)
    return begin, max(begin, end)


def most_kept(options: Buffer) -> int:
    """Return how many samples the buffer can keep; a number beyond any for one that grows."""
    return 2**62 if options.buffer_type is BufferType.GROWING else options.buffer_size
