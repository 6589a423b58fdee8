"""What a recording is beyond its messages, as it travels inside our bags.

ROS messages hold no units, kinds, labels, dividers or buffer types, and no stamps of ticks at which nothing was due.
These structs are an attachment of the MCAP file (JSON, compressed); readers that don't know it skip it.
"""

from typing import TypeVar

import msgspec
import numpy as np
import zstandard
from numpy.typing import NDArray

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import BufferType, Entry, LoggedEvent, Stretch
from silo.core.recording import NO_FAILURES, Failures
from silo.decoding import json_decoder
from silo.files.mcap.chunks import most_room
from silo.files.silo.format import Missing

FACTS_ATTACHMENT = "silo/recording.json.zst"
TIME_ATTACHMENT = "silo/time_ns.zst"
FACTS_VERSION = 1
_MAX_BYTES = 2**31
Facts = TypeVar("Facts", bound=msgspec.Struct)


class PlacedEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """One entry and where it stands: channel, bytes from the message's start, NumPy type there and how many of it.

    `dtype` is the NumPy type of the values there, `missing` says which of them are none. Of a channel with `absent`
    messages less than samples, the sequence number of a message is that of its sample.
    """

    name: str
    entry: Entry
    dtype: str
    channel: int
    offset: int
    wire: str
    wire_count: int = 1
    missing: Missing | None = None
    absent: int = 0


class PlacedElement(msgspec.Struct, frozen=True, omit_defaults=True):
    """`RecordedElement` without its values; `count` is the number of samples."""

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    divider: int
    buffer_type: BufferType
    first: int
    count: int
    entries: tuple[PlacedEntry, ...]
    description: str = ""
    lost: int = 0
    dtype: str = ""
    failures: Failures = NO_FAILURES


class RecordingFacts(msgspec.Struct, frozen=True, omit_defaults=True, rename={"conditions": "extras"}):
    """`Recording` without values and time stamps. `channel_sizes` are the message lengths, -1 for strings."""

    version: int
    logger: str
    offset: int
    prefix: str
    elements: tuple[PlacedElement, ...]
    channel_sizes: dict[int, int]
    frequency_hz: float | None = None
    started_ns: int = 0
    time_looping: bool = False
    warnings: tuple[str, ...] = ()
    why: str = ""
    conditions: Conditions = NO_CONDITIONS
    events: tuple[LoggedEvent, ...] = ()
    about: dict[str, str] = {}
    stretch: Stretch | None = None
    run: str = ""


def pack_facts(facts: msgspec.Struct) -> bytes:
    """An attachment's bytes."""
    return zstandard.compress(msgspec.json.encode(facts))


def unpack_facts(kind: type[Facts], data: bytes) -> Facts:
    """Raises `zstandard.ZstdError` or `msgspec.MsgspecError` for damaged bytes."""
    return json_decoder(kind).decode(_decompressed(data, most_room(data)))


def pack_times(time_ns: NDArray[np.int64]) -> bytes:
    """Differences, byte planes apart: a steady clock takes 2 - 3 bytes per tick instead of 8."""
    planes = np.diff(time_ns, prepend=np.int64(0)).astype("<i8").view(np.uint8).reshape(-1, 8).T
    return zstandard.compress(planes.tobytes())


def unpack_times(data: bytes) -> NDArray[np.int64]:
    """Raises `zstandard.ZstdError` or `ValueError` for damaged bytes."""
    # the stamps of a steady clock are packed as small as zeros
    planes = np.frombuffer(_decompressed(data, _MAX_BYTES), dtype=np.uint8).reshape(8, -1)
    return np.cumsum(np.ascontiguousarray(planes.T).reshape(-1).view("<i8"), dtype=np.int64)


def _decompressed(data: bytes, most: int) -> bytes:
    """What an attachment is. Raises ZstdError for damaged bytes, and for those that announce more than `most`."""
    # the size stands in the frame: refuse before allocating what a damaged frame claims
    if zstandard.frame_content_size(data) > most:
        raise zstandard.ZstdError(f"{len(data):,} bytes announce more than {most:,}")
    return zstandard.decompress(data)
