"""How a segment file is laid out, and the structs with which it explains itself.

    header       one page: eight 8-byte words, see `HeaderWord`
    schema       JSON of `SegmentSchema`
    control      64-byte lines: one for the segment, then one per ring, see `ControlWord` and `RingControl`
    chunks       one 8-byte word per possible chunk of a growing ring: ring number + 1, 0 while unused
    failures     256 bytes for each element that is read by an expression, see `silo.segment.failures`
    marks        slots of 256 bytes, see `silo.segment.marks`
    rings        rows of 8-byte words: tick, time stamp in ns, words gathered from memory
    unheld       one word per element, see `SegmentSchema`
    parameters   their changes, and what overwritten ones left, see `silo.segment.parameter_changes`; of loggers that
                 have any
    chunk data   chunks of `chunk_bytes`, appended while logging

Everything is little-endian and 8-byte aligned; each part begins on a page.

Layout 2 added `failures`, `marks`, the reason why rows were lost, and the identity of logger and run. Readers take
layout 1 too, and of the schema they ignore what they don't know, so that a field with a default needs no new layout.
"""

import enum
import platform
from typing import TypeVar

import msgspec

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import GOES_ON, STARTED, BufferType, ElementInfo, ElementOptions, Entry
from silo.core.tuning.parameters import ParameterInfo
from silo.decoding import json_decoder

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


class HeaderWord(enum.IntEnum):
    """Positions of the words of the header."""

    MAGIC = 0
    VERSION = 1
    SCHEMA_OFFSET = 2
    SCHEMA_BYTES = 3
    CONTROL_OFFSET = 4
    CHUNKS_OFFSET = 5
    CHUNKS_LIMIT = 6
    CHUNK_DATA_OFFSET = 7


class ControlWord(enum.IntEnum):
    """Words of the segment's own control line."""

    STATE = 0
    STOP_REASON = 1
    CHUNKS = 2
    SAVED_TICKS = 3
    DROPPED = 4  # 1 where the rows of a run that was held went: the file tells of it, and holds none


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


class EntrySchema(msgspec.Struct, frozen=True, gc=False, rename={"offset": "byte_offset"}):
    """Where one scalar stands in a row: bytes from the start of the row. `swapped`: big-endian in memory."""

    entry: Entry
    offset: int
    swapped: bool = False

    @property
    def dtype(self) -> str:
        """Its type, whatever the order of its bytes."""
        return self.entry.dtype


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

    def is_full_at(self, row: int) -> bool:
        """Whether there is no row of this number, nor any later: a buffer that keeps its first samples is full."""
        return self.buffer_type is BufferType.FIXED and row >= self.capacity

    def rows_before(self, tick: int) -> int:
        """How many rows the ticks before this one have."""
        return -(-tick // self.divider)


class ElementSchema(msgspec.Struct, frozen=True, gc=False):
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
        return self.entries_in(self.watch_ring)

    def entries_in(self, ring: int) -> tuple[EntrySchema, ...]:
        """Where its entries stand in the rows of one of its rings."""
        return self.entries if ring == self.ring else self.live_entries


class Cut(msgspec.Struct, frozen=True):
    """How a run goes on one before it, without a tick between: its stretch `part` (from 1) of the run `chain`.

    `text` says what changed, and `who` asked for it.
    """

    chain: str
    part: int
    text: str = ""
    who: str = ""


class SegmentSchema(msgspec.Struct, frozen=True, weakref=True, rename={"conditions": "extras"}):
    """What the segment holds and who writes it. `pid_start` and `boot_id` tell the writer from a reused pid.

    `logger_id` is drawn once in the life of a logger, `run` once per start: names may come again, these don't. `marks`
    is the word position of the slots of marks, -1 where there are none; `mark_slots` is how many. `unheld` is that of
    one word per element, -1 in older segments: 0, or one more than the tick at which was seen that nobody but silo
    holds its array any more. They come after the rings: where these stand is part of the text of `collect()`.
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
    conditions: Conditions = NO_CONDITIONS
    marks: int = -1
    mark_slots: int = 0
    unheld: int = -1
    number: int = 0  # of the run among those of its logger, from 1; 0 in older segments
    served: bool = False  # by a helper process, be it down: what none has seen is to be judged when both are gone
    about: dict[str, str] = {}
    parameters: tuple[ParameterInfo, ...] = ()  # with their values at the start of the run
    parameter_changes: int = -1  # the word position of their changes, -1 where there are none
    cut: Cut | None = None  # where it goes on another run
    parameter_image: int = -1  # the word position of what overwritten changes left, -1 in older segments

    @property
    def start_text(self) -> str:
        """What the event of its start says."""
        return STARTED if self.cut is None else GOES_ON

    @property
    def stretch(self) -> tuple[str, int]:
        """The run that cuts go on from, and the number of this stretch of it, from 1."""
        return (self.run, 1) if self.cut is None else (self.cut.chain, self.cut.part)

    def follows(self, before: "SegmentSchema") -> bool:
        """Whether this is the next stretch of the same run."""
        chain, part = before.stretch
        return self.stretch == (chain, part + 1)


def page_up(size_bytes: int) -> int:
    """The next multiple of a page."""
    return -(-size_bytes // PAGE) * PAGE


_Described = TypeVar("_Described")


def decode_description(text: bytes, kind: type[_Described]) -> _Described:
    """Decode the description of a segment or journal; fields that a newer silo added are passed over.

    The options of elements are strict where people write them; here a field that this silo doesn't know is dropped from
    them. Raises MsgspecError for what is damaged.
    """
    try:
        return json_decoder(kind).decode(text)
    except msgspec.ValidationError as error:
        if "unknown field" not in str(error):
            raise
        raw = msgspec.json.decode(text)
        _drop_unknown_options(raw)
        return json_decoder(kind).decode(msgspec.json.encode(raw))


def _drop_unknown_options(part: object) -> None:
    if isinstance(part, list):
        for one in part:
            _drop_unknown_options(one)
    elif isinstance(part, dict):
        options = part.get("options")
        if isinstance(options, dict):
            part["options"] = {
                name: options[name] for name in ElementOptions.__struct_encode_fields__ if name in options
            }
        for one in part.values():
            _drop_unknown_options(one)
