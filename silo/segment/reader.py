"""Reading a segment while it is written: rows, fill levels, and snapshots cut at one tick.

No locks and no retries: rows are copied, then the head is read again and what was overwritten meanwhile is cut.
"""

import errno
import functools
import hashlib
import mmap
import os
import stat
import weakref
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import MOST_NAME_BYTES, shown
from silo.core.elements import BufferType, LoggedEvent
from silo.core.recording import NO_FAILURES, Failures, Recording
from silo.core.runtime import boot_id, has_writer, open_into, pid_namespace, process_start, unopened
from silo.errors import SegmentError, reason
from silo.segment.failures import BLOCK_WORDS, read_cut, read_failures
from silo.segment.layout import (
    LINE_WORDS,
    MAGIC,
    ORDERED_STORES,
    PAGE,
    READABLE_LAYOUTS,
    STAMP_WORDS,
    TIME_RING,
    ControlWord,
    ElementSchema,
    HeaderWord,
    RingControl,
    RingSchema,
    SegmentSchema,
    SegmentState,
    decode_description,
)
from silo.segment.marks import SLOT_WORDS, read_marks
from silo.segment.parameter_changes import AREA_BYTES, image_bytes, image_event, read_changes, read_image
from silo.segment.reasons import STOP_TEXTS, LostWhy, StopReason
from silo.segment.retention import item_bytes
from silo.segment.rows import Rows
from silo.segment.snapshot import in_chain, snapshot

# the writer may be filling the row after the head, whose slot holds an old row; elsewhere than on x86 one row further
UNSAFE_ROWS = 1 if ORDERED_STORES else 2

# the schemas that somebody in this process holds, by the hash of their text: a helper has several readers of a segment,
# and one of 10,000 elements takes 11 MB and 70 ms
_decoded: "weakref.WeakValueDictionary[bytes, SegmentSchema]" = weakref.WeakValueDictionary()


def decoded_schema(text: bytes) -> SegmentSchema:
    """The schema that a segment describes itself with, the same object for all readers. Raises MsgspecError."""
    key = hashlib.blake2b(text).digest()
    schema = _decoded.get(key)
    if schema is None:
        schema = _decoded[key] = decode_description(text, SegmentSchema)
    return schema


class SegmentReader:
    """A segment file, mapped read-only. May be used while the writer writes; by one thread at a time."""

    def __init__(self, path: str | Path, descriptor: int | None = None) -> None:
        """Raises SegmentError where the file is missing, not a segment, or damaged.

        With a `descriptor` that file is read, opened anew, whatever became of the name `path`; it stays the caller's.
        """
        self.path = Path(path)
        try:
            # a pipe of that name must not hold anybody up
            name = self.path if descriptor is None else f"/proc/self/fd/{descriptor}"
            if Path(name).is_dir():
                raise SegmentError(f"{path}: is not a silo segment ({os.strerror(errno.EISDIR)})")
            self._file = open_into(unopened(), name, os.O_RDONLY | os.O_NONBLOCK)
        except (OSError, ValueError) as error:
            raise SegmentError(f"{path}: can't open the segment ({reason(error)})") from error
        try:
            self._remap()
            self.schema = self._read_schema()
            self._control = self._words_at(HeaderWord.CONTROL_OFFSET)
            self._directory = self._words_at(HeaderWord.CHUNKS_OFFSET)
            self._directory_words = int(self._words[HeaderWord.CHUNKS_LIMIT])
            self._chunk_data = 8 * self._words_at(HeaderWord.CHUNK_DATA_OFFSET)
            self._check_layout()
            self._written = self.schema  # a reader with derived signals has more elements
        except BaseException:
            self._file.close()
            raise
        self._growing: dict[int, list[int]] = {}  # the places of the chunks of each growing ring, in order
        self._chunks_seen = 0
        self._writer_gone = False

    def _remap(self) -> None:
        found = os.fstat(self._file.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise SegmentError(f"{self.path}: is not a silo segment, not even a file")
        self._size_bytes = found.st_size
        if self._size_bytes < 2 * PAGE:
            raise SegmentError(f"{self.path}: {self._size_bytes} bytes are too few for a segment")
        try:
            self._map = mmap.mmap(self._file.fileno(), self._size_bytes, access=mmap.ACCESS_READ)
        except (OSError, ValueError, OverflowError) as error:
            raise SegmentError(f"{self.path}: {self._size_bytes} bytes can't be mapped ({error})") from error
        self._words = np.frombuffer(self._map, np.uint64, self._size_bytes // 8)

    def _words_at(self, position: HeaderWord) -> int:
        offset = int(self._words[position])
        if offset % 8:
            raise self._damaged(f"{position.name.lower()} is {offset}, no multiple of 8")
        return offset // 8

    def _damaged(self, what: str) -> SegmentError:
        return SegmentError(f"{self.path}: the segment is damaged: {what}")

    def _read_schema(self) -> SegmentSchema:
        magic, version, begin, size = (int(word) for word in self._words[:4])
        if magic != MAGIC:
            raise SegmentError(f"{self.path}: is not a silo segment")
        if version not in READABLE_LAYOUTS:
            older, newer = READABLE_LAYOUTS[0], READABLE_LAYOUTS[-1]
            raise SegmentError(
                f"{self.path}: was written by a newer silo (layout {version}, this silo reads {older} to {newer}): "
                "update silo here, then try again; the data stays where it is"
            )
        if begin + size > self._size_bytes:
            raise SegmentError(f"{self.path}: cut short, {self._size_bytes} of {begin + size} bytes are there")
        try:
            return decoded_schema(self._map[begin : begin + size])
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise SegmentError(f"{self.path}: the segment's description is damaged ({error})") from error

    def _check_layout(self) -> None:
        """What the description says must fit the file, and itself: everything that reads rows relies on it."""
        schema = self.schema
        for name in (schema.logger, schema.run, schema.logger_id):  # files are named after them
            if "/" in name or "\0" in name or len(os.fsencode(name)) > MOST_NAME_BYTES // 3:
                raise self._damaged(f"{shown(name)} is no name")
        ends = [
            8 * (self._control + LINE_WORDS * (1 + len(schema.rings))),
            8 * (self._directory + self._directory_words),
        ]
        if not schema.rings or (schema.rings[0].divider, schema.rings[0].live) != (1, False):
            raise self._damaged("there is no ring of time stamps")
        for place, ring in enumerate(schema.rings):
            sensible = ring.ring == place and ring.row_words >= STAMP_WORDS and ring.capacity >= 1 and ring.divider >= 1
            if not sensible or ring.offset < 0 or ring.offset % 8:
                raise self._damaged(f"ring {ring.ring} of its description makes no sense")
            row_bytes = 8 * ring.row_words * ring.capacity
            if ring.buffer_type is not BufferType.GROWING:
                ends.append(ring.offset + row_bytes)
            elif row_bytes > schema.chunk_bytes or schema.chunk_bytes % 8:
                raise self._damaged(f"rows of ring {ring.ring} don't fit its chunks")
        for element in schema.elements:
            self._check_element(element)
        ends += [8 * place + AREA_BYTES for place in [schema.parameter_changes] if place >= 0]
        ends += [8 * place + image_bytes(schema.parameters) for place in [schema.parameter_image] if place >= 0]
        ends += [8 * (element.failures + BLOCK_WORDS) for element in schema.elements if element.failures >= 0]
        if schema.marks >= 0:
            if schema.mark_slots < 0:
                raise self._damaged(f"it announces {schema.mark_slots} slots of marks")
            ends.append(8 * (schema.marks + SLOT_WORDS * schema.mark_slots))
        if schema.unheld >= 0:
            ends.append(8 * (schema.unheld + len(schema.elements)))
        if max(ends) > self._size_bytes:
            raise SegmentError(f"{self.path}: cut short, {self._size_bytes} of {max(ends)} bytes are there")

    def _check_element(self, element: ElementSchema) -> None:
        options, rings = element.info.options, self.schema.rings
        for number, entries in ((element.ring, element.entries), (element.live_ring, element.live_entries)):
            if number == -1 and entries is element.live_entries:
                continue
            if not 0 <= number < len(rings) or rings[number].divider != options.divider:
                raise self._damaged(f"{element.info.name!r} has no ring of its divider")
            row_bytes = 8 * rings[number].row_words
            for entry in entries:
                size = item_bytes(entry.entry.dtype)
                if size < 0:
                    raise self._damaged(f"{element.info.name!r} is of the unknown type {entry.entry.dtype!r}")
                if not 0 <= entry.offset <= row_bytes - size:
                    raise self._damaged(f"{element.info.name!r} reaches beyond its row")
        ring = rings[element.ring]
        if ring.buffer_type is not options.buffer:
            raise self._damaged(f"{element.info.name!r} has no ring of its buffer type")
        if ring.buffer_type is not BufferType.GROWING and options.size > ring.capacity:
            raise self._damaged(f"the ring of {element.info.name!r} is too small for its buffer")

    def fileno(self) -> int:
        """The open file, to be handed to another process: it stays readable when the segment is deleted."""
        return self._file.fileno()

    def descriptor(self) -> int:
        """Return another descriptor of the file, to be closed. Raises SegmentError while none can be had."""
        try:
            return os.dup(self.fileno())
        except OSError as error:
            raise SegmentError(f"{self.path}: can't be opened now: {reason(error)}") from error

    def close(self) -> None:
        """Let go of the file. Arrays that were handed out stay valid."""
        self._file.close()

    def release_pages(self) -> None:
        """Let go of the memory pages that were read; they are mapped again when they are read again.

        A reader that follows a ring for long would otherwise count the whole segment as its own memory.
        """
        self._map.madvise(mmap.MADV_DONTNEED)

    # ------------------------------------------------------------------------------------------------ state

    def _control_word(self, word: ControlWord) -> int:
        self._check_size()
        return int(self._words[self._control + word])

    def _ring_word(self, ring: int, word: RingControl) -> int:
        self._check_size()
        return int(self._words[self._control + LINE_WORDS * (1 + ring) + word])

    @property
    def running(self) -> bool:
        """Whether the writer says that it collects (a writer that was killed still says so)."""
        return self._control_word(ControlWord.STATE) == SegmentState.RUNNING

    @property
    def stop_reason(self) -> str:
        """Why collection ended, fit to show; empty while it runs."""
        code = self._control_word(ControlWord.STOP_REASON)
        return STOP_TEXTS[StopReason(code)] if code in StopReason._value2member_map_ else ""

    @property
    def is_cut(self) -> bool:
        """Whether another run goes on this one."""
        return self._control_word(ControlWord.STOP_REASON) == StopReason.CUT

    @property
    def ticks(self) -> int:
        """Ticks collected since start."""
        return self.head(TIME_RING)

    @property
    def saved_ticks(self) -> int:
        """Ticks that stood in a file at the last save."""
        return self._control_word(ControlWord.SAVED_TICKS)

    def control_offset(self, word: ControlWord) -> int:
        """Where in the file a word of its own stands."""
        return 8 * (self._control + word)

    @property
    def rows_offset(self) -> int:
        """Where in the file rows begin: before that is all that tells of them."""
        places = [ring.offset for ring in self.schema.rings if ring.buffer_type is not BufferType.GROWING]
        return min([*places, self._chunk_data])

    @functools.cached_property
    def dropped(self) -> bool:
        """Whether the rows of a run that was held went, for want of room: this is another file than was written."""
        return self._control_word(ControlWord.DROPPED) != 0

    @property
    def last_time_ns(self) -> int:
        """Time stamp of the newest tick, 0 before the first."""
        newest = self.rows(TIME_RING, self.ticks - 1)
        return int(newest.time_ns[-1]) if len(newest) else 0

    @property
    def size_bytes(self) -> int:
        """The size of the file."""
        return self._size_bytes if self._file.closed else os.fstat(self._file.fileno()).st_size

    @property
    def held_bytes(self) -> int:
        """Bytes of the rows that it holds: about what a `.silo` file of them takes."""
        return sum(self._held_rows(ring) * ring.row_words * 8 for ring in self.schema.rings if not ring.live)

    def _held_rows(self, ring: RingSchema) -> int:
        head = self.head(ring.ring)
        return head if ring.buffer_type is BufferType.GROWING else min(head, ring.capacity)

    def alive(self) -> bool:
        """Whether the writing process still exists."""
        schema = self.schema
        if schema.boot_id != boot_id():
            alive = False
        elif schema.pid_namespace in (0, pid_namespace()):
            alive = process_start(schema.pid) == schema.pid_start
        else:
            alive = has_writer(self._file.fileno())  # pids of another container say nothing here
        self._writer_gone = not alive
        return alive

    def head(self, ring: int) -> int:
        """Rows ever committed to a ring."""
        head = self._ring_word(ring, RingControl.HEAD)
        if ORDERED_STORES or self._writer_gone or not self.running:
            return head
        whole_ticks = self._ring_word(TIME_RING, RingControl.LIVE)
        return min(head, self.schema.rings[ring].rows_before(whole_ticks))

    def first(self, _ring: int) -> int:
        """The oldest row that can have been kept: any, in a segment."""
        return 0

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept."""
        return self._ring_word(ring, RingControl.LOST)

    def failures(self, element: ElementSchema) -> Failures:
        """At which ticks an element could not be read."""
        if element.failures < 0:
            return NO_FAILURES
        self._check_size()
        return read_failures(self._words[element.failures : element.failures + BLOCK_WORDS].tolist())

    def cut_texts(self) -> dict[str, int]:
        """Elements of which texts were cut to their room, with the length of the longest."""
        self._check_size()
        able = [element for element in self.schema.elements if element.failures >= 0]
        blocks = {one.info.name: self._words[one.failures : one.failures + BLOCK_WORDS] for one in able}
        return {name: cut for name, block in blocks.items() if (cut := read_cut(block[:2].tolist()))}

    @functools.cached_property
    def _failing(self) -> tuple[list[str], NDArray[np.intp]]:
        """Names of the elements that can fail, and where their counts stand."""
        able = [element for element in self.schema.elements if element.failures >= 0]
        return [element.info.name for element in able], np.array([element.failures for element in able], np.intp)

    def failure_counts(self) -> dict[str, int]:
        """At how many ticks each element could not be read; only those that ever failed."""
        names, places = self._failing
        self._check_size()
        counts = self._words[places]
        return {names[at]: int(counts[at]) for at in np.flatnonzero(counts).tolist()}

    def unheld(self) -> dict[str, int]:
        """Elements whose array nobody but silo holds any more, with the tick at which that was seen."""
        schema = self._written
        if schema.unheld < 0:
            return {}
        self._check_size()
        words = self._words[schema.unheld : schema.unheld + len(schema.elements)]
        return {schema.elements[at].info.name: int(words[at]) - 1 for at in np.flatnonzero(words).tolist()}

    # ------------------------------------------------------------------------------------------------- rows

    def rows(self, ring: int, since: int, limit: int | None = None, words: NDArray[np.intp] | None = None) -> Rows:
        """Committed rows with index `since` and later that are still there, copied; at most the first `limit` of them.

        `Rows.first` is larger than `since` where older rows were overwritten. Of each row only the words at these
        places are copied, ascending, or all.
        """
        layout = self.schema.rings[ring]
        self._check_size()
        head = self.head(ring)
        if layout.buffer_type is BufferType.FIXED and head > layout.capacity:
            raise self._damaged(f"ring {ring} says that it holds {head} rows, {layout.capacity} fit in")
        begin = max(since, head if self.dropped else 0)
        if layout.buffer_type is BufferType.LOOPING:
            begin = max(begin, head - layout.capacity + UNSAFE_ROWS)
        end = max(head if limit is None else min(head, begin + limit), begin)
        copied = self._copy(layout, begin, end, words)
        if layout.buffer_type is BufferType.LOOPING:
            safe = self._ring_word(ring, RingControl.HEAD) - layout.capacity + UNSAFE_ROWS
            if safe > begin:
                cut = min(safe, end) - begin
                return Rows(layout, begin + cut, copied[cut:])
        return Rows(layout, begin, copied)

    def _check_size(self) -> None:
        """Raise SegmentError if the file was cut under the mapping; costs 0.5 us.

        To read memory beyond the end of a file ends the process (SIGBUS). A file that is cut in the midst of a copy
        still does that: nobody who keeps to silo's ways cuts one.
        """
        if not self._file.closed and (size := os.fstat(self._file.fileno()).st_size) < self._size_bytes:
            raise SegmentError(
                f"{self.path}: somebody cut the segment short while it was in use, {size} of {self._size_bytes} bytes "
                "are left: what it held is gone; start the logger anew, which makes another one"
            )

    def _copy(
        self, ring: RingSchema, begin: int, end: int, words: NDArray[np.intp] | None = None
    ) -> NDArray[np.uint64]:
        if ring.buffer_type is BufferType.GROWING and end > begin:
            self._chunk(ring.ring, (end - 1) // ring.capacity)  # before memory is taken for what isn't there
        some = words if words is not None and len(words) < ring.row_words else None
        out = np.empty((end - begin, ring.row_words if some is None else len(some)), np.uint64)
        done = 0
        while done < len(out):
            block, slot = self._block(ring, begin + done)
            count = min(len(out) - done, len(block) - slot)
            rows = block[slot : slot + count]
            if some is None:
                out[done : done + count] = rows
            else:
                np.take(rows, some, axis=1, out=out[done : done + count], mode="clip")
            done += count
        return out

    def _block(self, ring: RingSchema, row: int) -> tuple[NDArray[np.uint64], int]:
        """The memory, shape `(capacity, row_words)`, that holds a row, and the row's place in it."""
        number, slot = divmod(row, ring.capacity)
        if ring.buffer_type is not BufferType.GROWING:
            offset = ring.offset
        else:
            offset = self._chunk_data + self._chunk(ring.ring, number) * self.schema.chunk_bytes
        size_words = ring.capacity * ring.row_words
        return self._words[offset // 8 : offset // 8 + size_words].reshape(ring.capacity, ring.row_words), slot

    def _chunk(self, ring: int, number: int) -> int:
        """Which chunk of the file is the ring's chunk `number`."""
        places = self._growing.get(ring, [])
        if number >= len(places):
            used = min(self._control_word(ControlWord.CHUNKS), self._directory_words)
            if used > self._chunks_seen and self._chunk_data + used * self.schema.chunk_bytes > self._size_bytes:
                self._remap()
                if self._chunk_data + used * self.schema.chunk_bytes > self._size_bytes:
                    raise SegmentError(f"{self.path}: cut short, chunk {used - 1} of the segment is missing")
            owners = self._words[self._directory + self._chunks_seen : self._directory + used]
            for place, owner in enumerate(owners.tolist(), self._chunks_seen):
                self._growing.setdefault(owner - 1, []).append(place)
            self._chunks_seen = used
            places = self._growing.get(ring, [])
        if number >= len(places):
            raise SegmentError(f"{self.path}: damaged, chunk {number} of ring {ring} isn't in the directory")
        return places[number]

    def marks(self, since: int = 0) -> list[LoggedEvent]:
        """The program's marks after number `since` that are still there, in their order, without time stamps."""
        if self.schema.marks < 0:
            return []
        self._check_size()
        words = self._words[self.schema.marks : self.schema.marks + SLOT_WORDS * self.schema.mark_slots]
        return read_marks(words, since, self.schema.logger, self.schema.run)

    def changes(self, since: int = -1) -> list[LoggedEvent]:
        """The changes of parameters that landed after the first `since`, those that are still there.

        At their head what all parameters were at the start, where that is asked for: `since` is -1. In place of changes
        since then that are overwritten an image stands of what they left.
        """
        schema = self.schema
        if not schema.parameters:
            return []
        self._check_size()
        words = self._words[schema.parameter_changes : schema.parameter_changes + AREA_BYTES // 8]
        found = read_changes(words, max(since, 0), schema.parameters, schema.logger, schema.run)
        if (image := self._image(found)) is not None and image.number > since:
            kept = read_changes(words, 0, schema.parameters, schema.logger, schema.run)
            image = self._image(kept) or image
            found = sorted([image, *(one for one in kept if one.number > since)], key=lambda one: one.number)
        if since >= 0:
            return found
        return [image_event(schema.parameters, schema.started_ns, schema.logger, schema.run), *found]

    def _image(self, kept: list[LoggedEvent]) -> LoggedEvent | None:
        """What overwritten changes left: to be read behind those that are `kept`, of which more are by then."""
        schema = self.schema
        begin, size = schema.parameter_image, image_bytes(schema.parameters) // 8
        if begin < 0:
            return None
        return read_image(self._words[begin : begin + size], schema.parameters, kept, schema.logger, schema.run)

    def stamped_changes(self, since: int = -1) -> list[LoggedEvent]:
        """The same with the time stamps of their ticks, as far as these are still held."""
        return [msgspec.structs.replace(one, stamp_ns=self.stamp_of(one.tick)) for one in self.changes(since)]

    def stamped_marks(self, since: int = 0) -> list[LoggedEvent]:
        """The same with the time stamps of their ticks, as far as these are still held."""
        found = self.marks(since)
        stamps = {tick: self.stamp_of(tick) for tick in {mark.tick for mark in found}}
        return [msgspec.structs.replace(mark, stamp_ns=stamps[mark.tick]) for mark in found]

    def stamp_of(self, tick: int) -> int:
        """The time stamp of a tick; 0 where it is not held."""
        rows = self.rows(TIME_RING, max(tick, 0), 1)
        return int(rows.time_ns[0]) if len(rows) and rows.first == tick else 0

    def lost_whys(self) -> tuple[LostWhy, ...]:
        """Why rows could not be kept, each reason once."""
        lossy = [ring.ring for ring in self.schema.rings if self.ring_lost(ring.ring)]
        words = {self._ring_word(ring, RingControl.LOST_WHY) for ring in lossy}
        return tuple(why for why in LostWhy if why in words)

    # --------------------------------------------------------------------------------------------- snapshot

    def snapshot(self) -> Recording:
        """All elements that are saved, cut at one tick; collection goes on meanwhile."""
        if not ORDERED_STORES:
            self.alive()  # of a writer that was killed, the newest row counts too
        return in_chain(snapshot(self), self._written, cut_off=self.is_cut)
