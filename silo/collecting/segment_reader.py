"""Reading a segment while it is written: rows, fill levels, and snapshots cut at one tick.

No locks and no retries: rows are copied, then the head is read again and what was overwritten meanwhile is cut.
"""

import mmap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.collecting.schema import (
    LAYOUT_VERSION,
    LINE_WORDS,
    MAGIC,
    ORDERED_STORES,
    PAGE,
    STAMP_WORDS,
    STOP_TEXTS,
    TIME_RING,
    Control,
    ElementSchema,
    EntrySchema,
    Header,
    RingControl,
    RingSchema,
    SegmentSchema,
    SegmentState,
    StopReason,
)
from silo.errors import SegmentError
from silo.model import BufferType
from silo.recording import RecordedElement, RecordedEntry, Recording
from silo.runtime import boot_id, process_start

# the writer may be filling the row after the head, whose slot holds an old row; elsewhere than on x86 one row further
UNSAFE_ROWS = 1 if ORDERED_STORES else 2


@dataclass(frozen=True)
class Rows:
    """Rows of one ring, oldest first: uint64 of shape `(n, row_words)`; row i is the ring's row `first + i`."""

    ring: RingSchema
    first: int
    words: NDArray[np.uint64]

    def __len__(self) -> int:
        return len(self.words)

    @property
    def ticks(self) -> NDArray[np.int64]:
        """Shape `(n,)`: ticks since start."""
        return self.words[:, 0].view(np.int64)

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Shape `(n,)`: time stamps."""
        return self.words[:, 1].view(np.int64)

    def column(self, entry: EntrySchema) -> NDArray[Any]:
        """Shape `(n,)`: one entry, as a strided view in the entry's own type."""
        dtype = np.dtype(entry.entry.dtype)
        if dtype.itemsize == 0 or not len(self.words):
            return np.zeros(len(self.words), dtype)
        stored = dtype.newbyteorder(">") if entry.swapped else dtype
        shape, strides = (len(self.words),), (8 * self.words.shape[1],)
        column: NDArray[Any] = np.ndarray(shape, stored, self.words.data, entry.byte_offset, strides)
        return column.astype(dtype) if entry.swapped else column

    def part(self, begin: int, end: int) -> "Rows":
        """The rows with index `begin <= index < end`, without a copy."""
        low, high = max(begin - self.first, 0), max(end - self.first, 0)
        return Rows(self.ring, self.first + min(low, len(self)), self.words[low:high])


class SegmentReader:
    """A segment file, mapped read-only. May be used while the writer writes; by one thread at a time."""

    def __init__(self, path: str | Path) -> None:
        """Raises SegmentError where the file is missing, not a segment, or damaged."""
        self.path = Path(path)
        try:
            self._file = self.path.open("rb")
        except OSError as error:
            raise SegmentError(f"{path}: can't open the segment ({error.strerror})") from error
        try:
            self._remap()
            self.schema = self._read_schema()
        except BaseException:
            self._file.close()
            raise
        self._control = int(self._words[Header.CONTROL_OFFSET]) // 8
        self._directory = int(self._words[Header.CHUNKS_OFFSET]) // 8
        self._directory_words = int(self._words[Header.CHUNKS_LIMIT])
        self._chunk_data = int(self._words[Header.CHUNK_DATA_OFFSET])
        self._check_layout()
        self._growing: dict[int, list[int]] = {}  # the places of the chunks of each growing ring, in order
        self._chunks_seen = 0
        self._writer_gone = False

    def _remap(self) -> None:
        self._size_bytes = self._file.seek(0, 2)
        if self._size_bytes < 2 * PAGE:
            raise SegmentError(f"{self.path}: {self._size_bytes} bytes are too few for a segment")
        self._map = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        self._words = np.frombuffer(self._map, np.uint64, self._size_bytes // 8)

    def _read_schema(self) -> SegmentSchema:
        magic, version, begin, size = (int(word) for word in self._words[:4])
        if magic != MAGIC:
            raise SegmentError(f"{self.path}: is not a silo segment")
        if version != LAYOUT_VERSION:
            raise SegmentError(f"{self.path}: layout version {version}, this silo reads {LAYOUT_VERSION}")
        try:
            return msgspec.json.decode(self._map[begin : begin + size], type=SegmentSchema)
        except msgspec.MsgspecError as error:
            raise SegmentError(f"{self.path}: the segment's description is damaged ({error})") from error

    def _check_layout(self) -> None:
        ends = [
            8 * (self._control + LINE_WORDS * (1 + len(self.schema.rings))),
            8 * (self._directory + self._directory_words),
        ]
        for ring in self.schema.rings:
            if ring.row_words < STAMP_WORDS or ring.capacity < 1 or ring.divider < 1:
                raise SegmentError(f"{self.path}: ring {ring.ring} of the segment's description makes no sense")
            if ring.buffer_type is not BufferType.GROWING:
                ends.append(ring.offset + 8 * ring.row_words * ring.capacity)
        if max(ends) > self._size_bytes:
            raise SegmentError(f"{self.path}: cut short, {self._size_bytes} of {max(ends)} bytes are there")

    def fileno(self) -> int:
        """The open file, to be handed to another process: it stays readable when the segment is deleted."""
        return self._file.fileno()

    def close(self) -> None:
        """Let go of the file. Arrays that were handed out stay valid."""
        self._file.close()

    def release_pages(self) -> None:
        """Let go of the memory pages that were read; they are mapped again when they are read again.

        A reader that follows a ring for long would otherwise count the whole segment as its own memory.
        """
        self._map.madvise(mmap.MADV_DONTNEED)

    # ------------------------------------------------------------------------------------------------ state

    def _control_word(self, word: Control) -> int:
        return int(self._words[self._control + word])

    def _ring_word(self, ring: int, word: RingControl) -> int:
        return int(self._words[self._control + LINE_WORDS * (1 + ring) + word])

    @property
    def running(self) -> bool:
        """Whether the writer says that it collects (a writer that was killed still says so)."""
        return self._control_word(Control.STATE) == SegmentState.RUNNING

    @property
    def stop_reason(self) -> str:
        """Why collection ended, fit to show; empty while it runs."""
        code = self._control_word(Control.STOP_REASON)
        return STOP_TEXTS[StopReason(code)] if code in StopReason._value2member_map_ else ""

    @property
    def ticks(self) -> int:
        """Ticks collected since start."""
        return self.head(TIME_RING)

    @property
    def saved_ticks(self) -> int:
        """Ticks that stood in a file at the last save."""
        return self._control_word(Control.SAVED_TICKS)

    @property
    def last_time_ns(self) -> int:
        """Time stamp of the newest tick, 0 before the first."""
        newest = self.rows(TIME_RING, self.ticks - 1)
        return int(newest.time_ns[-1]) if len(newest) else 0

    @property
    def lost(self) -> int:
        """Rows that could not be kept, all rings together."""
        return sum(self.ring_lost(ring.ring) for ring in self.schema.rings)

    @property
    def size_bytes(self) -> int:
        """The size of the file."""
        return self.path.stat().st_size if self.path.exists() else self._size_bytes

    def alive(self) -> bool:
        """Whether the writing process still exists."""
        schema = self.schema
        alive = schema.boot_id == boot_id() and process_start(schema.pid) == schema.pid_start
        self._writer_gone = not alive
        return alive

    def head(self, ring: int) -> int:
        """Rows ever committed to a ring."""
        head = self._ring_word(ring, RingControl.HEAD)
        if ORDERED_STORES or self._writer_gone or not self.running:
            return head
        whole_ticks = self._ring_word(TIME_RING, RingControl.LIVE)
        return min(head, -(-whole_ticks // self.schema.rings[ring].divider))

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept."""
        return self._ring_word(ring, RingControl.LOST)

    def held(self, element: ElementSchema) -> int:
        """Samples of an element that are in its buffer now."""
        head = self.head(element.ring)
        if element.info.options.buffer_type is BufferType.GROWING:
            return head
        return min(head, element.info.options.buffer_size)

    def element_lost(self, element: ElementSchema) -> int:
        """Samples of an element that could not be kept."""
        return self.ring_lost(element.ring)

    # ------------------------------------------------------------------------------------------------- rows

    def rows(self, ring: int, since: int, limit: int | None = None) -> Rows:
        """Committed rows with index `since` and later that are still there, copied; at most the first `limit` of them.

        `Rows.first` is larger than `since` where older rows were overwritten.
        """
        layout = self.schema.rings[ring]
        head = self.head(ring)
        begin = max(since, 0)
        if layout.buffer_type is BufferType.LOOPING:
            begin = max(begin, head - layout.capacity + UNSAFE_ROWS)
        end = max(head if limit is None else min(head, begin + limit), begin)
        words = self._copy(layout, begin, end)
        if layout.buffer_type is BufferType.LOOPING:
            safe = self._ring_word(ring, RingControl.HEAD) - layout.capacity + UNSAFE_ROWS
            if safe > begin:
                cut = min(safe, end) - begin
                return Rows(layout, begin + cut, words[cut:])
        return Rows(layout, begin, words)

    def _copy(self, ring: RingSchema, begin: int, end: int) -> NDArray[np.uint64]:
        out = np.empty((end - begin, ring.row_words), np.uint64)
        done = 0
        while done < len(out):
            block, slot = self._block(ring, begin + done)
            count = min(len(out) - done, len(block) - slot)
            out[done : done + count] = block[slot : slot + count]
            done += count
        return out

    def _block(self, ring: RingSchema, row: int) -> tuple[NDArray[np.uint64], int]:
        """The memory, shape `(capacity, row_words)`, that holds a row, and the row's place in it."""
        number, slot = divmod(row, ring.capacity)
        if ring.buffer_type is not BufferType.GROWING:
            offset = ring.offset
        else:
            offset = self._chunk_data + self._chunk(ring.ring, number) * self.schema.chunk_bytes
            if offset + self.schema.chunk_bytes > self._size_bytes:
                self._remap()
                if offset + self.schema.chunk_bytes > self._size_bytes:
                    raise SegmentError(f"{self.path}: cut short, chunk {number} of ring {ring.ring} is missing")
        size_words = ring.capacity * ring.row_words
        return self._words[offset // 8 : offset // 8 + size_words].reshape(ring.capacity, ring.row_words), slot

    def _chunk(self, ring: int, number: int) -> int:
        """Which chunk of the file is the ring's chunk `number`."""
        places = self._growing.get(ring, [])
        if number >= len(places):
            used = min(self._control_word(Control.CHUNKS), self._directory_words)
            owners = self._words[self._directory + self._chunks_seen : self._directory + used]
            for place, owner in enumerate(owners.tolist(), self._chunks_seen):
                self._growing.setdefault(owner - 1, []).append(place)
            self._chunks_seen = used
            places = self._growing.get(ring, [])
        if number >= len(places):
            raise SegmentError(f"{self.path}: damaged, chunk {number} of ring {ring} isn't in the directory")
        return places[number]

    # --------------------------------------------------------------------------------------------- snapshot

    def snapshot(self) -> Recording:
        """All elements that are saved, cut at one tick; collection goes on meanwhile.

        Takes a copy of the rings that are needed; entry values are strided views of it.
        """
        schema = self.schema
        if not ORDERED_STORES:
            self.alive()  # of a writer that was killed, the newest row counts too
        ticks = self.ticks
        saved = [element for element in schema.elements if element.info.options.action.saves]
        due = {element.ring: -(-ticks // element.info.options.divider) for element in saved}
        looping = [ring for ring in due if schema.rings[ring].buffer_type is BufferType.LOOPING]
        # what is being overwritten comes first: a growing buffer of 100 MB takes longer than a looping one has to spare
        copies = {ring: self.rows(ring, self._oldest_wanted(ring, due[ring])) for ring in looping}
        stamps = self._time_stamps(ticks)
        first_tick = ticks - len(stamps)
        for ring in due.keys() - copies.keys():
            copies[ring] = self.rows(ring, 0, due[ring])
        elements = [self._recorded(element, copies[element.ring], due[element.ring], first_tick) for element in saved]
        return Recording(
            logger=schema.logger,
            time_ns=stamps,
            offset=ticks,
            elements=[element for element in elements if element.count],
            prefix=schema.prefix,
            frequency_hz=schema.frequency_hz,
            started_ns=schema.started_ns,
            time_looping=schema.time_buffer_type is BufferType.LOOPING,
            warnings=self._warnings(elements, ticks),
        )

    def _oldest_wanted(self, ring: int, due: int) -> int:
        if self.schema.rings[ring].buffer_type is not BufferType.LOOPING:
            return 0
        return due - max(e.info.options.buffer_size for e in self.schema.elements if e.ring == ring)

    def _time_stamps(self, ticks: int) -> NDArray[np.int64]:
        first = 0
        if self.schema.time_buffer_type is BufferType.LOOPING:
            first = max(0, ticks - self.schema.time_buffer_size)
        return np.ascontiguousarray(self.rows(TIME_RING, first).part(first, ticks).time_ns)

    def _recorded(self, element: ElementSchema, rows: Rows, due: int, first_tick: int) -> RecordedElement:
        info = element.info
        end = min(due, rows.first + len(rows))
        begin = rows.first
        if info.options.buffer_type is BufferType.FIXED:
            end = min(end, info.options.buffer_size)
        elif info.options.buffer_type is BufferType.LOOPING:
            begin = max(begin, end - info.options.buffer_size)
        begin = max(begin, -(-first_tick // info.options.divider))  # no sample without its time stamp
        kept = rows.part(begin, max(begin, end))
        return RecordedElement(
            name=info.name,
            unit=info.unit,
            kind=info.kind,
            shape=info.shape,
            divider=info.options.divider,
            buffer_type=info.options.buffer_type,
            first=begin * info.options.divider - first_tick,
            entries=tuple(
                RecordedEntry(info.name + entry.entry.suffix, entry.entry, kept.column(entry))
                for entry in element.entries
            ),
            description=info.description,
            lost=self.element_lost(element),
            dtype=info.dtype,
        )

    def _warnings(self, elements: list[RecordedElement], ticks: int) -> tuple[str, ...]:
        warnings = []
        if self.lost:
            warnings.append(f"{self.lost} rows could not be kept: the memory limit was reached")
        sizes = {element.info.name: element.info.options.buffer_size for element in self.schema.elements}
        short = [
            element.name
            for element in elements
            if element.buffer_type is BufferType.LOOPING
            and element.count < min(sizes[element.name], -(-ticks // element.divider))
        ]
        if short:
            warnings.append(f"the oldest samples of {', '.join(short)} were overwritten while the snapshot was taken")
        return tuple(warnings)
