"""Waiting until something can be read from a descriptor, or written to it, whatever its number."""

import errno
import math
import os
import select
from collections.abc import Iterable

LONGEST_WAIT_MS = 2**31 - 1


def readable(*descriptors: int, timeout_s: float | None = None) -> list[int]:
    """Wait until there is something to read, or an end, and return where; none after the timeout.

    Whatever their numbers: `select` takes none beyond 1023, and a robot program may have more files open.
    """
    return _ready(descriptors, select.POLLIN, timeout_s)


def writable(descriptor: int, timeout_s: float) -> bool:
    """Wait likewise until something can be written; whether it can."""
    return bool(_ready((descriptor,), select.POLLOUT, timeout_s))


def _ready(descriptors: Iterable[int], events: int, timeout_s: float | None) -> list[int]:
    asked = select.poll()
    for descriptor in descriptors:
        asked.register(descriptor, events)
    timeout_ms = None if timeout_s is None else min(math.ceil(timeout_s * 1000), LONGEST_WAIT_MS)
    found = asked.poll(timeout_ms)
    if any(event & select.POLLNVAL for _, event in found):
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    return [descriptor for descriptor, _ in found]
