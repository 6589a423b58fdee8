"""What is whole of a part of an endless recording: its records up to where it was cut, and which rows they hold.

Each chunk counts with its message index behind it, or not at all. Every checksum is looked at: after a power cut a file
may hold zeros where its size says that there is data.
"""

import struct
from dataclasses import dataclass, field

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, Metadata, MetadataIndex, Schema

from silo.errors import FileFormatError
from silo.files.mcap.chunks import INDEX_ENTRY, RECORD, are_messages, records, unpack_chunk
from silo.files.mcap.damage import DAMAGE
from silo.files.mcap.index import ENTRIES_AT, IndexedRecord, attachment, indexed_records, parsed
from silo.files.mcap.writer import MAGIC, Begun, chunk_index, file_start
from silo.files.parts.events import last_number
from silo.files.parts.metadata import EVENTS_RING, PART_ATTACHMENT, PartFacts, RingFacts, row_of, unpack_part

SEQUENCE_AT = 11  # in a message record
NO_INDEX = "the index is damaged: its times, or where it points, are not those of the messages"
CUT_SHORT = (  # of one that was finished
    "the file is cut off: its end is missing, as of a copy that was interrupted; copy it again, or `silo convert` what "
    "is left of it, so that other readers read that, too"
)
_IN_CHUNK = (Opcode.SCHEMA, Opcode.CHANNEL)


@dataclass
class PartScan:
    """What is whole of a part. `rows` are its stretches of rows by ring, as (first, one after the last).

    `damaged` tells of the chunks that are not, before its end.
    """

    begun: Begun = field(default_factory=Begun)
    facts: PartFacts | None = None
    finished: bool = False
    counts: dict[int, int] = field(default_factory=dict)  # messages by channel
    start_ns: int = 0
    end_ns: int = 0
    rows: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    damaged: list[str] = field(default_factory=list)

    @property
    def next_rows(self) -> dict[int, int]:
        """By ring, the row that comes after what the part holds."""
        found = {ring.ring: ring.begin for ring in self.facts.rings} if self.facts else {}
        return found | {ring: max(end for _, end in stretches) for ring, stretches in self.rows.items() if stretches}

    def add_rows(self, ring: int, first: int, end: int) -> None:
        """Take in rows of a chunk."""
        stretches = self.rows.setdefault(ring, [])
        if stretches and stretches[-1][1] == first:
            stretches[-1] = (stretches[-1][0], end)
        else:
            stretches.append((first, end))


def first_row(ring: RingFacts, chunk: bytes, index: memoryview) -> int:
    """The row of the first message of a chunk."""
    (offset,) = struct.unpack_from("<Q", index, ENTRIES_AT + 8)
    (sequence,) = struct.unpack_from("<I", chunk, offset + SEQUENCE_AT)
    return row_of(sequence, ring.begin)


def _row_after(ring: RingFacts, chunk: bytes, index: memoryview) -> int:
    """The row after the last one of a chunk, given its first message index."""
    if ring.ring == EVENTS_RING:
        return last_number(chunk, index, ring.begin) + 1
    return first_row(ring, chunk, index) + (len(index) - ENTRIES_AT) // INDEX_ENTRY.itemsize


def scan_part(data: memoryview) -> PartScan:
    """Read a part from front to back. Raises FileFormatError for what is no part of ours."""
    scan = PartScan()
    if file_start().startswith(data):
        return scan  # nothing yet
    if bytes(data[: len(MAGIC)]) != MAGIC:
        raise FileFormatError("not an MCAP file: it doesn't start with the MCAP mark")
    scan.begun.size = len(MAGIC)
    cut: list[str] = []  # at the end of a file that isn't finished nothing is damaged
    for record in indexed_records(data):
        if record.opcode == Opcode.CHUNK:
            # one that is damaged ends the file where nothing whole comes behind it; the first one has the definitions
            wrong = _take_chunk(scan, record)
            if wrong:
                cut.append(f"of the chunk at byte {record.at:,} {wrong}")
            else:
                scan.damaged, cut = [*scan.damaged, *cut], []
            if not scan.begun.channels:
                scan.damaged += cut if bytes(data[-len(MAGIC) :]) == MAGIC else []
                return scan
        elif record.opcode == Opcode.DATA_END:
            scan.finished = bytes(data[-len(MAGIC) :]) == MAGIC and len(data) > record.end
            scan.damaged += cut
            return scan
        elif record.opcode == Opcode.ATTACHMENT:
            _take_attachment(scan, record)
        elif record.opcode == Opcode.METADATA:
            name = parsed(Metadata, record.body).name
            scan.begun.metadata.append(MetadataIndex(record.at, record.end - record.at, name))
            scan.begun.size = record.end
        elif record.opcode == Opcode.HEADER:
            scan.begun.size = record.end
        else:
            return scan  # nothing else stands in a part: zeros, perhaps, that were never on the disk
    return scan


def rows_after(data: memoryview) -> tuple[PartFacts, dict[int, int]] | None:
    """Return what a part says of itself, and by ring the row after its last one, without reading what is in between.

    Milliseconds for a gigabyte, where `scan_part` takes seconds; None for what it takes more to tell.
    """
    facts: PartFacts | None = None
    last: dict[int, tuple[RingFacts, memoryview, memoryview]] = {}
    at = len(MAGIC)
    while (record := next(records(data, at), None)) is not None:
        opcode, at, body = record
        at += RECORD.size + len(body)
        if opcode == Opcode.CHUNK:
            index = next(records(data, at), None)
            if facts is None or index is None or index[0] != Opcode.MESSAGE_INDEX:
                break
            (channel,) = struct.unpack_from("<H", index[2])
            ring = next((ring for ring in facts.rings if channel in ring.channels), None)
            if ring is None:
                break
            at += (RECORD.size + len(index[2])) * len(ring.channels)  # all channels of a ring have as many messages
            if at > len(data):
                break
            last[ring.ring] = ring, body, index[2]
        elif opcode == Opcode.ATTACHMENT:
            name, _, content = attachment(body)
            facts = unpack_part(content) if name == PART_ATTACHMENT else facts
        elif opcode not in (Opcode.METADATA, Opcode.HEADER):
            break
    if facts is None:
        return None
    rows = {ring.ring: ring.begin for ring in facts.rings}
    for ring, body, first in last.values():
        rows[ring.ring] = _row_after(ring, bytes(unpack_chunk(body)), first)
    return facts, rows


def _take_chunk(scan: PartScan, record: IndexedRecord) -> str:
    """Take in a chunk with its index; return what is damaged, empty where nothing is."""
    if scan.facts is None or not record.index:
        return "the index is missing"
    ring = scan.facts.ring_of(struct.unpack_from("<H", record.index[0])[0], len(record.index))
    if ring is None:
        return NO_INDEX
    try:
        data = bytes(unpack_chunk(record.body))
    except DAMAGE as error:
        return f"nothing can be read ({error})"
    if not index_fits(data, record.index):
        return NO_INDEX
    if not scan.begun.channels:
        _take_definitions(scan, data)
    offsets = b""
    for channel, count, place in record.indexed:
        scan.counts[channel] = scan.counts.get(channel, 0) + count
        offsets += struct.pack("<HQ", channel, place)
    index = record.index[0]
    scan.add_rows(ring.ring, first_row(ring, data, index), _row_after(ring, data, index))
    start_ns, end_ns, size, _, length = struct.unpack_from("<QQQII", record.body)
    scan.start_ns = min(scan.start_ns, start_ns) if scan.begun.chunk_indexes else start_ns
    scan.end_ns = max(scan.end_ns, end_ns)
    place_of_chunk = (start_ns, end_ns, record.at, record.end - record.at)
    compression = bytes(record.body[28 : 32 + length])
    packed = len(record.body) - 40 - length
    index_length = record.index_end - record.end
    scan.begun.chunk_indexes.append(chunk_index(place_of_chunk, offsets, index_length, compression, packed, size))
    scan.begun.size = record.index_end
    return ""


def index_fits(chunk: bytes, index: list[memoryview]) -> bool:
    """Whether index records point at the messages that they name: they have no checksum of their own.

    All of a ring's channels have as many messages, so that they are looked at at once: 500 take 2 instead of 20 ms.
    """
    size = len(index[0]) - ENTRIES_AT
    if size <= 0 or size % INDEX_ENTRY.itemsize or len({len(one) for one in index}) > 1:
        return False
    body = np.dtype([("channel", "<u2"), ("size", "<u4"), ("entries", INDEX_ENTRY, (size // INDEX_ENTRY.itemsize,))])
    records = np.frombuffer(b"".join(index), body)
    right = are_messages(chunk, records["channel"][:, None], records["entries"])
    return bool((records["size"] == size).all() and right.all())


def _take_definitions(scan: PartScan, data: bytes) -> None:
    """Schemas and channels, which stand before the messages of the first chunk."""
    for opcode, _, body in records(data):
        if opcode not in _IN_CHUNK:
            break
        kind, found = (Schema, scan.begun.schemas) if opcode == Opcode.SCHEMA else (Channel, scan.begun.channels)
        found.append(parsed(kind, body))


def _take_attachment(scan: PartScan, record: IndexedRecord) -> None:
    name, media, content = attachment(record.body)
    scan.begun.attachments.append(AttachmentIndex(record.at, record.end - record.at, 0, 0, len(content), name, media))
    if name == PART_ATTACHMENT:
        scan.facts = unpack_part(content)
    scan.begun.size = record.end
