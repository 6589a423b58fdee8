"""The writer's end of a segment: makes the file, hands out the memory, appends chunks for growing rings.

Only `start()` and the chunk allocation do system calls; the stores of a tick are in the generated `collect()`.
"""

import contextlib
import errno
import itertools
import logging
import mmap
import os
import resource
import threading
from io import FileIO
from pathlib import Path

import msgspec
import numpy as np

from silo.core.elements import BufferType
from silo.core.quantities.writing import size_text
from silo.core.runtime import (
    available_memory_bytes,
    disk_room,
    is_at,
    open_into,
    open_unfinished,
    orphaned_segments,
    unopened,
)
from silo.errors import NoRoomError, SegmentError, reason
from silo.segment.failures import BLOCK_WORDS, record_cut
from silo.segment.held_runs import hold
from silo.segment.layout import (
    LAYOUT_VERSION,
    LINE_WORDS,
    MAGIC,
    PAGE,
    TIME_RING,
    ControlWord,
    ElementSchema,
    HeaderWord,
    RingControl,
    RingSchema,
    SegmentSchema,
    SegmentState,
    page_up,
)
from silo.segment.marks import MARKS_BYTES, SLOTS, MarksOfRun
from silo.segment.parameter_changes import AREA_BYTES, ChangeRecord, image_bytes
from silo.segment.reasons import LOST_TEXTS, LostWhy, StopReason

log = logging.getLogger("silo")

CHUNK_BYTES = 1 << 20
SPARE_CHUNKS = 4096  # words of the directory for time stamps past the memory limit: 268 million ticks


def chunk_bytes_for(row_words: int) -> int:
    """Bytes of a chunk: 1 MB, or one row where rows are larger."""
    return max(CHUNK_BYTES, page_up(8 * row_words))


class Segment:
    """A segment file, mapped for writing. One writer.

    It owns nothing until `make`, and nothing after `unlink`. An interrupt may come anywhere: whoever has this object
    can let go of all that it owns at that moment, by `unlink`.
    """

    def __init__(
        self,
        path: Path,
        schema: SegmentSchema,
        first_rows: dict[int, int],
        memory_limit_bytes: int,
        *,
        in_memory: bool = True,
        elements_json: bytes = b"",
    ) -> None:
        """Lay the file out.

        `first_rows` tells for each GROWING ring how many rows to have ready. `in_memory`: the file takes memory, no
        disk. `elements_json`: the elements of the schema, if they were encoded before.
        """
        self.path = path
        self._temporary = path.with_name(f".{path.name}.new")
        self._file = unopened()
        self._kept: Path | None = None  # its name after `unlink`
        self.words = memoryview(b"").cast("l")
        self.marks: MarksOfRun | None = None
        self.changes: ChangeRecord | None = None  # of parameters, where there are any
        self._first_rows = first_rows
        self.first_chunks: dict[int, list[memoryview]] = {}  # those that were made ready at start, as 8-byte words
        self._in_memory = in_memory
        self._limit_bytes = memory_limit_bytes
        self._limit_chunks = max(1, memory_limit_bytes // schema.chunk_bytes)
        self._directory_words = self._limit_chunks + SPARE_CHUNKS
        elements_json = elements_json or msgspec.json.encode(schema.elements)
        self._control = PAGE + _schema_room(schema, elements_json)
        self._directory = self._control + page_up(8 * LINE_WORDS * (1 + len(schema.rings)))
        elements, end = _place_failures(schema.elements, self._directory + page_up(8 * self._directory_words))
        rings, rings_end = _place(schema.rings, end + MARKS_BYTES)
        changes = rings_end + page_up(8 * len(elements))
        image = changes + page_up(AREA_BYTES)
        self._chunk_data = image + page_up(image_bytes(schema.parameters)) if schema.parameters else changes
        self.schema = msgspec.structs.replace(
            schema,
            rings=rings,
            elements=elements,
            marks=end // 8,
            mark_slots=SLOTS,
            unheld=rings_end // 8,
            parameter_changes=changes // 8 if schema.parameters else -1,
            parameter_image=image // 8 if schema.parameters else -1,
        )
        if elements is not schema.elements:
            elements_json = msgspec.json.encode(elements)
        self._growing = {ring.ring: ring for ring in rings if ring.buffer_type is BufferType.GROWING}
        self._chunks = 0
        self._next: dict[int, memoryview] = {}
        # reentrant: a forgotten logger may be collected, and deleted, by the very thread that allocates for it
        self._allocating = threading.RLock()
        self._wanted = threading.Event()
        self._ended = False
        self._grows = True
        self._why: LostWhy | None = None  # it doesn't, until rows are lost by that
        self._untold: LostWhy | None = None  # and then until that was said
        self._counted: tuple[int, int, int] | None = None  # ticks, lost rows and saved ticks of a deleted segment
        self._failed: dict[str, int] | None = None  # and its failures
        self._body = _encoded(self.schema, elements_json)
        self._thread = threading.Thread(target=self._prepare_chunks, name="silo-chunks", daemon=True)

    def make(self) -> None:
        """Make the file under a temporary name, allocate and touch every page, then give it its name.

        Raises SegmentError where there is no room. `unlink` it then, as after an interrupt.
        """
        try:
            open_unfinished(self._temporary, self._file)
        except OSError as error:
            raise SegmentError(f"{self.path.parent}: can't make a segment there ({reason(error)})") from error
        try:
            self._fill(self._file.fileno(), self._body)
            self._body = b""
            for ring in self._growing:
                self.first_chunks[ring] = self._append_rows(ring, self._first_rows.get(ring, 1))
            self._temporary.rename(self.path)
        except OSError as error:
            raise SegmentError(f"{self.path}: can't make the buffers ({reason(error)})") from error
        if self._growing:
            self._thread.start()

    def _fill(self, descriptor: int, body: bytes) -> None:
        if self.path.exists():  # pids come again, in containers at every start: no unsaved recording is replaced
            raise SegmentError(f"{self.path}: there is a recording of that name already; start again")
        if self._in_memory and self._chunk_data > (available := available_memory_bytes()):
            # a tmpfs may be larger than the memory: what doesn't fit would have the kernel kill the robot program
            raise NoRoomError(
                f"no memory for {size_text(self._chunk_data)} of buffers, {size_text(available)} are available; "
                f'make buffers smaller, or use storage="file"{_held_by_dead()}',
                self._chunk_data,
                available,
            )
        self._allocate(descriptor, 0, self._chunk_data)
        mapped = mmap.mmap(descriptor, self._chunk_data)
        # a strided NumPy store touches every page without the GIL: no page fault is left for the control loop
        np.frombuffer(mapped, np.uint8)[::PAGE] = 0
        self.words = memoryview(mapped).cast("l")
        marks = memoryview(mapped)[8 * self.schema.marks :][:MARKS_BYTES]
        self.marks = marks, self.words, self.ring_control(TIME_RING), itertools.count(1).__next__
        if self.schema.parameters:
            area = memoryview(mapped)[8 * self.schema.parameter_changes :][:AREA_BYTES]
            image = memoryview(mapped)[8 * self.schema.parameter_image :][: image_bytes(self.schema.parameters)]
            self.changes = ChangeRecord(area, image, self.schema.parameters)
        mapped[PAGE : PAGE + len(body)] = body
        header = {
            HeaderWord.VERSION: LAYOUT_VERSION,
            HeaderWord.SCHEMA_OFFSET: PAGE,
            HeaderWord.SCHEMA_BYTES: len(body),
            HeaderWord.CONTROL_OFFSET: self._control,
            HeaderWord.CHUNKS_OFFSET: self._directory,
            HeaderWord.CHUNKS_LIMIT: self._directory_words,
            HeaderWord.CHUNK_DATA_OFFSET: self._chunk_data,
            HeaderWord.MAGIC: MAGIC,
        }
        for position, value in header.items():
            self.words[position] = value
        self._set(ControlWord.STATE, SegmentState.RUNNING)

    def _set(self, word: ControlWord, value: int) -> None:
        if self._counted:
            return  # deleted by another thread while a tick was under way
        self.words[self._control // 8 + word] = value

    def _allocate(self, descriptor: int, offset: int, size_bytes: int) -> None:
        try:
            os.posix_fallocate(descriptor, offset, size_bytes)
        except OSError as error:
            if error.errno == errno.EFBIG:
                limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
                raise SegmentError(
                    f"{self.path.parent}: this process may make files of {size_text(limit)} only (RLIMIT_FSIZE, "
                    f"`ulimit -f`), the buffers take {size_text(offset + size_bytes)} ({reason(error)}): raise "
                    "that limit, or make buffers smaller"
                ) from error
            free_bytes, _ = disk_room(self.path.parent)
            raise NoRoomError(
                f"{self.path.parent}: no room for {size_text(size_bytes)} of buffers, "
                f"{size_text(free_bytes)} are free ({reason(error)}); "
                f'make buffers smaller, enlarge /dev/shm, or use storage="file"{_held_by_dead()}',
                size_bytes,
                free_bytes,
            ) from error

    def ring_control(self, ring: int) -> int:
        """Word position of a ring's control line."""
        return self._control // 8 + LINE_WORDS * (1 + ring)

    @property
    def named(self) -> bool:
        """Whether the file still has its name: somebody may have deleted it from the folder of the buffers."""
        return not self._file.closed and os.fstat(self._file.fileno()).st_nlink > 0

    @property
    def size_bytes(self) -> int:
        """The size of the file, whether it has a name or not; 0 once it is let go of."""
        return 0 if self._file.closed else os.fstat(self._file.fileno()).st_size

    def open_read_only(self) -> FileIO:
        """Open the file once more, for reading, also where its name is gone; the caller closes it."""
        if self._file.closed:
            raise SegmentError(f"{self.path}: its memory was let go of")
        return open_into(unopened(), f"/proc/self/fd/{self._file.fileno()}", os.O_RDONLY)

    @property
    def ticks(self) -> int:
        """Ticks collected since start."""
        return self._counted[0] if self._counted else self.words[self.ring_control(TIME_RING)]

    @property
    def lost_rows(self) -> int:
        """Rows that could not be kept, all rings together."""
        if self._counted:
            return self._counted[1]
        return sum(self.words[self.ring_control(ring.ring) + RingControl.LOST] for ring in self.schema.rings)

    @property
    def failures(self) -> dict[str, int]:
        """At how many ticks each element could not be read, only those that failed."""
        if self._failed is not None:
            return self._failed
        blocks = {element.info.name: element.failures for element in self.schema.elements if element.failures >= 0}
        return {name: self.words[block] for name, block in blocks.items() if self.words[block]}

    def note_cut(self, block: int, length: int) -> None:
        """Remember in the block of failures of an element that a text of so many bytes or letters was cut."""
        if not self._counted and not self._file.closed:
            record_cut(self.words, block, length)

    def note_unheld(self, place: int, tick: int) -> None:
        """Remember that nobody but silo held the array of the element at this place of the schema, seen at a tick."""
        if not self._counted and not self._file.closed:
            self.words[self.schema.unheld + place] = tick + 1

    @property
    def is_running(self) -> bool:
        """Whether rows may still come."""
        return not self._counted and self.words[self._control // 8 + ControlWord.STATE] == SegmentState.RUNNING

    def say_cut(self) -> None:
        """Note that another run goes on this one, whose last tick may still be under way."""
        self._set(ControlWord.STOP_REASON, StopReason.CUT)

    def stop(self, reason: StopReason) -> None:
        """Mark that no more rows will come."""
        self._set(ControlWord.STOP_REASON, reason)
        self._set(ControlWord.STATE, SegmentState.STOPPED)
        self._end_chunks()

    def mark_saved(self, ticks: int) -> None:
        """Remember how many ticks stand in a saved file."""
        self._set(ControlWord.SAVED_TICKS, ticks)

    @property
    def saved_ticks(self) -> int:
        """How many ticks stand in a saved file, also one that another process made."""
        return self._counted[2] if self._counted else self.words[self._control // 8 + ControlWord.SAVED_TICKS]

    def next_chunk(self, ring: int) -> memoryview | None:
        """The next chunk of a growing ring, None at the memory limit or where the folder is full.

        It was prepared by the thread as a rule; in a loop faster than real time it is made here (some 0.2 ms).
        """
        with self._allocating:
            chunk = self._next.pop(ring, None) or self._append_within_limit(ring)
            if chunk is None and not self._ended:
                self._untold, self._why = self._why, None  # the first rows are lost now
        self._wanted.set()
        return chunk

    def _prepare_chunks(self) -> None:
        """Keep one chunk ready per growing ring."""
        while not self._ended:
            for ring in self._growing:
                self._make_ready(ring)
            self._tell_of_end()
            self._wanted.wait()
            self._wanted.clear()
        self._tell_of_end()

    def _make_ready(self, ring: int) -> None:
        with self._allocating:
            if ring not in self._next and (chunk := self._append_within_limit(ring)):
                self._next[ring] = chunk

    def _append_within_limit(self, ring: int) -> memoryview | None:
        # the time ring may pass the limit: without time stamps no other ring is worth anything
        limit = self._directory_words if ring == TIME_RING else self._limit_chunks
        if self._ended:
            return None
        if self._chunks >= limit:
            self._ended_by(ring, LostWhy.MEMORY_LIMIT)
            return None
        try:
            return self._append(ring)
        except (SegmentError, OSError):  # no memory before the limit is reached: the caller counts what it can't keep
            self._ended_by(ring, LostWhy.NO_ROOM)
            return None

    def _ended_by(self, ring: int, why: LostWhy) -> None:
        """Remember why a ring can't grow; the loop counts the rows that it doesn't keep for it."""
        if not self._counted:
            self.words[self.ring_control(ring) + RingControl.LOST_WHY] = why
            if self._grows:
                self._grows, self._why = False, why

    def _tell_of_end(self) -> None:
        """Say once that rows are dropped as a ring can't grow, in the thread for which nothing waits."""
        with self._allocating:
            why, self._untold = self._untold, None
        if why is not None:
            log.warning(
                "%s: %s: what its growing buffers have no room for is dropped from here on; save() and start() anew, "
                "or record() to a disk while it runs",
                self.schema.logger,
                LOST_TEXTS[why],
            )

    def growth_ended(self) -> StopReason:
        """Why the time ring, and with it the logger, can't go on."""
        full = self.words[self.ring_control(TIME_RING) + RingControl.LOST_WHY] == LostWhy.NO_ROOM
        return StopReason.NO_ROOM if full else StopReason.MEMORY_LIMIT

    def _append_rows(self, ring: int, rows: int) -> list[memoryview]:
        wanted = max(1, -(-rows // self._growing[ring].capacity))
        # one chunk each is granted whatever the limit: a ring without any would keep nothing
        if wanted > 1 and ring != TIME_RING and self._chunks + wanted > self._limit_chunks:
            chunk_mb = self.schema.chunk_bytes / 1e6
            raise SegmentError(
                f"growing buffers are to begin with {(self._chunks + wanted) * chunk_mb:.0f} MB or more, "
                f"the memory limit is {self._limit_bytes / 1e6:.0f} MB: raise memory_limit_mb, "
                "or give them a smaller size (they grow from there)"
            )
        return [self._append(ring) for _ in range(wanted)]

    def _append(self, ring: int) -> memoryview:
        if self._chunks >= self._directory_words:
            raise SegmentError(f"{self.path}: the directory of {self._directory_words} chunks is full")
        size_bytes = self.schema.chunk_bytes
        offset = self._chunk_data + self._chunks * size_bytes
        self._allocate(self._file.fileno(), offset, size_bytes)
        mapped = mmap.mmap(self._file.fileno(), size_bytes, offset=offset)
        # MAP_POPULATE keeps the GIL for 0.4 ms here; a NumPy store of more than 500 items drops it while it faults
        np.frombuffer(mapped, np.uint8)[:: PAGE // 2] = 0
        self.words[self._directory // 8 + self._chunks] = ring + 1
        self._chunks += 1
        self._set(ControlWord.CHUNKS, self._chunks)
        return memoryview(mapped).cast("l")

    def _end_chunks(self) -> None:
        self._ended = True
        self._wanted.set()

    def unlink(self, *, held: bool = False, left: bool = False) -> Path | None:
        """Delete the file and let go of its memory, which readers keep; `ticks` and `lost` stay what they are.

        `held`: it gets another name instead, which is returned: somebody still has to read it; `left`: it stays, for
        who saves it. May be called again: it goes on where it was interrupted.
        """
        self._end_chunks()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()  # it may be making a chunk
        self._count()
        if not self._file.closed:
            if held and self._kept is None and not left:
                with contextlib.suppress(OSError):
                    self._kept = hold(self.path)
            for path in [self._temporary, self.path] if self._kept is None and not left else []:
                if is_at(self._file.fileno(), path):
                    path.unlink(missing_ok=True)
        self._let_go()
        return self._kept

    def forget(self) -> None:
        """Let go of its memory in a forked child, whose parent has the file, and may have it for long."""
        self._ended, self._allocating = True, threading.RLock()  # a thread that is not in this process may hold it
        self._count()
        self._let_go()

    def _count(self) -> None:
        if len(self.words):
            self._failed = self.failures
            self._counted = self.ticks, self.lost_rows, self.saved_ticks
        else:  # it was never made
            self._failed, self._counted = self._failed or {}, self._counted or (0, 0, 0)

    def _let_go(self) -> None:
        with self._allocating:
            self.words = memoryview(b"").cast("l")
            self.marks = self.changes = None
            self._next.clear()
            self.first_chunks.clear()
            self._file.close()


def _held_by_dead() -> str:
    """What of the missing room can be had: recordings of programs that died take theirs until they are saved."""
    sizes = []
    for path in orphaned_segments():
        with contextlib.suppress(FileNotFoundError):  # another process saved it just now
            sizes.append(path.stat().st_size)
    if not sizes:
        return ""
    several = f"{len(sizes)} recordings" if len(sizes) > 1 else "a recording"
    return f"; {several} of programs that died hold {size_text(sum(sizes))}: run `silo recover`"


def _encoded(schema: SegmentSchema, elements_json: bytes) -> bytes:
    """The text of the schema. 10,000 elements take 30 ms to encode, and most restarts have them encoded already."""
    return msgspec.json.encode(msgspec.structs.replace(schema, elements=msgspec.Raw(elements_json)))


def _schema_room(schema: SegmentSchema, elements_json: bytes) -> int:
    """Bytes for the schema once its offsets are known: sized with the longest offset there can be."""
    rings = tuple(msgspec.structs.replace(ring, offset=2**53) for ring in schema.rings)
    longest = len(str(2**53)) * sum(element.failures >= 0 for element in schema.elements)
    placed = msgspec.structs.replace(schema, rings=rings, marks=2**53, mark_slots=SLOTS, unheld=2**53)
    if schema.parameters:
        placed = msgspec.structs.replace(placed, parameter_changes=2**53, parameter_image=2**53)
    return page_up(len(_encoded(placed, elements_json)) + longest)


def _place_failures(elements: tuple[ElementSchema, ...], offset: int) -> tuple[tuple[ElementSchema, ...], int]:
    """The elements with the places of their blocks of failures (those that have one), and where these end."""
    word = offset // 8
    placed = []
    for element in elements:
        if element.failures < 0:
            placed.append(element)
        else:
            placed.append(msgspec.structs.replace(element, failures=word))
            word += BLOCK_WORDS
    return (elements if word == offset // 8 else tuple(placed)), page_up(8 * word)


def _place(rings: tuple[RingSchema, ...], offset: int) -> tuple[tuple[RingSchema, ...], int]:
    """The rings with their offsets, each on a page of its own, and where they end."""
    placed = []
    for ring in rings:
        placed.append(msgspec.structs.replace(ring, offset=offset))
        if ring.buffer_type is not BufferType.GROWING:
            offset += page_up(8 * ring.row_words * ring.capacity)
    return tuple(placed), offset


class Chunks:
    """Hands a growing ring its chunks one after the other."""

    def __init__(self, segment: Segment, schema: RingSchema) -> None:
        self._segment, self._schema = segment, schema
        self._chunks: list[memoryview | None] = list(segment.first_chunks[schema.ring])
        self._given = 0  # chunks before this one are full and no more wanted

    def more(self, number: int) -> tuple[memoryview | None, int, int]:
        """Memory, position and end of the ring's chunk `number`; end -1 where it can't grow any more.

        The newest chunk can be asked for again: the tick that got it may have been interrupted.
        """
        if number == len(self._chunks):
            self._chunks.append(self._segment.next_chunk(self._schema.ring))
        for full in range(self._given, number - 1):
            self._chunks[full] = None
        self._given = max(self._given, number - 1)
        chunk = self._chunks[number]
        return chunk, 0, -1 if chunk is None else self._schema.capacity * self._schema.row_words

    def newest(self, row: int) -> tuple[memoryview, int] | None:
        """Where a row of the present chunk or of the one before stands: memory and position."""
        number, slot = divmod(row, self._schema.capacity)
        chunk = self._chunks[number] if number < len(self._chunks) else None
        return None if chunk is None else (chunk, slot * self._schema.row_words)
