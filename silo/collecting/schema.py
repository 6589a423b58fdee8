"""How a segment file is laid out, and the structs with which it explains itself.

    header       one page: eight 8-byte words, see `Header`
    schema       JSON of `SegmentSchema`
    control      64-byte lines: one for the segment, then one per ring, see `Control` and `RingControl`
    chunks       one 8-byte word per possible chunk of a growing ring: ring number + 1, 0 while unused
    failures     256 bytes for each element that is read by an expression, see `silo.collecting.failures`
    rings        rows of 8-byte words: tick, time stamp in ns, words gathered from memory
    chunk data   chunks of `chunk_bytes`, appended while logging

Everything is little-endian and 8-byte aligned; each part begins on a page.

Layout 2 added `failures`, the reason why rows were lost, and the identity of logger and run. Readers take layout 1 too,
and of the schema they ignore what they don't know, so that a field with a default needs no new layout.
"""

import enum
import platform

import msgspec

from silo.model import BufferType, ElementInfo, Entry

MAGIC = int.from_bytes(b"SILOSEG1", "little")
LAYOUT_VERSION = 2
READABLE_LAYOUTS = (1, 2)
PAGE = 4096
LINE_WORDS = 8
STAMP_WORDS = 2  # tick and time stamp open each row
TIME_RING = 0

# x86 makes stores visible in program order; elsewhere `live` of the time ring, written a tick later, counts the ticks
# that are surely whole
ORDERED_STORES = platform.machine() in ("x86_64", "AMD64", "i686")


class Header(enum.IntEnum):
    """Positions of the words of the header."""

    MAGIC = 0
    VERSION = 1
    SCHEMA_OFFSET = 2
    SCHEMA_BYTES = 3
    CONTROL_OFFSET = 4
    CHUNKS_OFFSET = 5
    CHUNKS_LIMIT = 6
    CHUNK_DATA_OFFSET = 7


class Control(enum.IntEnum):
    """Words of the segment's own control line."""

    STATE = 0
    STOP_REASON = 1
    CHUNKS = 2
    SAVED_TICKS = 3


class RingControl(enum.IntEnum):
    """Words of a ring's control line: rows ever committed, rows that could not be kept and why (a `LostWhy`).

    `live`, on the time ring alone: ticks whose rows are surely visible, where the machine may reorder stores.
    """

    HEAD = 0
    LIVE = 1
    LOST = 2
    LOST_WHY = 3


class SegmentState(enum.IntEnum):
    """Whether the writer collects."""

    RUNNING = 1
    STOPPED = 2


class EntrySchema(msgspec.Struct, frozen=True):
    """Where one scalar stands in a row: bytes from the start of the row. `swapped`: big-endian in memory."""

    entry: Entry
    byte_offset: int
    swapped: bool = False


class RingSchema(msgspec.Struct, frozen=True):
    """One ring. For GROWING, `capacity` is rows per chunk and `offset` is unused.

    `live` rings are LOOPING copies of published elements whose own buffer can't carry every sample to the helper.
    """

    ring: int
    divider: int
    buffer_type: BufferType
    capacity: int
    row_words: int
    offset: int
    live: bool = False


class ElementSchema(msgspec.Struct, frozen=True):
    """One enabled element: `ring` holds its buffer; `live_ring` passes every sample, -1 if it isn't published.

    `failures` is the word position of its block of failures, -1 for what is read by address and can't fail.
    """

    info: ElementInfo
    ring: int
    entries: tuple[EntrySchema, ...]
    live_ring: int = -1
    live_entries: tuple[EntrySchema, ...] = ()
    failures: int = -1

    @property
    def watch_ring(self) -> int:
        """The ring in which its newest samples are seen: its own where it has no other, as what is only saved."""
        return self.live_ring if self.live_ring >= 0 else self.ring

    @property
    def watch_entries(self) -> tuple[EntrySchema, ...]:
        """Where its entries stand in the rows of that ring."""
        return self.live_entries if self.live_ring >= 0 else self.entries


class SegmentSchema(msgspec.Struct, frozen=True, weakref=True):
    """What the segment holds and who writes it. `pid_start` and `boot_id` tell the writer from a reused pid.

    `logger_id` is drawn once in the life of a logger, `run` once per start: names may come again, these don't.
    """

    logger: str
    prefix: str
    host: str
    user: str
    pid: int
    pid_start: int
    boot_id: str
    started_ns: int
    frequency_hz: float
    max_time_s: float
    folder: str
    script: str
    chunk_bytes: int
    time_buffer_type: BufferType
    time_buffer_size: int
    rings: tuple[RingSchema, ...]
    elements: tuple[ElementSchema, ...]
    version: int = LAYOUT_VERSION
    logger_id: str = ""
    run: str = ""
    pid_namespace: int = 0  # in which `pid` counts, 0 in older segments


def page_up(size_bytes: int) -> int:
    """The next multiple of a page."""
    return -(-size_bytes // PAGE) * PAGE
