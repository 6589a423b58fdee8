"""Elements of a whole bag that silo wrote, each read when it is asked for: by the index behind the chunks.

An element alone costs unpacking the chunks that hold its messages, and nothing for the other elements' messages; who
asks for several gets the rest in one more pass. Used by `silo.files.bag_reader`.
"""

import struct
import warnings
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Statistics
from numpy.typing import NDArray

from silo.core.recording import Failures, RecordedElement, RecordedEntry, Recording, alike, failures_at, lazy_entry
from silo.errors import FileFormatError, LogWarning
from silo.files.bags.channels import Values, are_right, channel_readers, logged_dtype, most_samples
from silo.files.bags.metadata import PlacedElement, RecordingFacts
from silo.files.mcap.chunks import INDEX_ENTRY, unpack_chunk
from silo.files.mcap.writer import MAGIC

ALONE = 3  # so many elements that nobody asked for together are read one by one; each costs unpacking its chunks
_HEAD = struct.Struct("<BQ")  # of a record: opcode, length
_CHUNK = struct.Struct("<QQQQI")  # of a chunk index: first and last time, where, length, bytes of the offsets
_OFFSET = np.dtype([("channel", "<u2"), ("offset", "<u8")])
_FOOTER = struct.Struct("<BQQQI")


@dataclass(frozen=True)
class Index:
    """What the summary says: attachments by name with place and length, messages per channel, chunks.

    A chunk is where it begins, its length, and where the message index of each channel begins, shape `(channels,)`.
    """

    attachments: Mapping[str, tuple[int, int]]
    counts: Mapping[int, int]
    chunks: Sequence[tuple[int, int, NDArray[np.void]]]


def read_index(data: memoryview) -> Index | None:
    """The summary of a finished MCAP file, None where there is none or it is damaged."""
    end = len(data) - len(MAGIC) - _FOOTER.size
    if end < len(MAGIC) or bytes(data[-len(MAGIC) :]) != MAGIC:
        return None
    opcode, length, start, _, checksum = _FOOTER.unpack_from(data, end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size or not len(MAGIC) <= start < end:
        return None
    # the footer counts up to its checksum, which others may leave out
    if checksum and zlib.crc32(data[start : end + _FOOTER.size - 4]) != checksum:
        return None
    try:
        return _summary(data, start, end)
    except (McapError, ValueError, struct.error):
        return None  # it has no checksum, or one of what is wrong: the file is read by its records


def _summary(data: memoryview, start: int, end: int) -> Index:
    attachments: dict[str, tuple[int, int]] = {}
    counts: Mapping[int, int] = {}
    chunks: list[tuple[int, int, NDArray[np.void]]] = []
    at = start
    while at < end:
        opcode, length = _HEAD.unpack_from(data, at)
        body = data[at + _HEAD.size : at + _HEAD.size + length]
        if opcode == Opcode.ATTACHMENT_INDEX:
            one = AttachmentIndex.read(ReadDataStream(BytesIO(body)))
            attachments[one.name] = (one.offset, one.length)
        elif opcode == Opcode.STATISTICS:
            counts = Statistics.read(ReadDataStream(BytesIO(body))).channel_message_counts
        elif opcode == Opcode.CHUNK_INDEX:
            _, _, place, size, taken = _CHUNK.unpack_from(body)
            chunks.append((place, size, np.frombuffer(body[_CHUNK.size : _CHUNK.size + taken], _OFFSET)))
        at += _HEAD.size + length
    return Index(attachments, counts, chunks)


def record_at(data: memoryview, at: int, opcode: int) -> memoryview:
    """The body of the record that begins there. Raises ValueError if there is another one, or none."""
    if at + _HEAD.size > len(data):
        raise ValueError("the index points out of the file")
    found, length = _HEAD.unpack_from(data, at)
    if found != opcode or at + _HEAD.size + length > len(data):
        raise ValueError("the index points at something else")
    return data[at + _HEAD.size : at + _HEAD.size + length]


@contextmanager
def damage_told(file: Path) -> Iterator[None]:
    """Turn what a damaged file leads to, whose fields may hold anything, into FileFormatError."""
    try:
        yield
    except DAMAGE as error:
        raise FileFormatError(f"{file}: {told_damage(error)}") from error
    except MemoryError as error:
        raise FileFormatError(f"{file}: it takes more memory than there is") from error


# what a file leads to whose fields may hold anything
DAMAGE = (
    struct.error, ValueError, LookupError, ArithmeticError, TypeError, RecursionError, EOFError, McapError,
    zstandard.ZstdError, msgspec.MsgspecError,
)  # fmt: skip


def told_damage(error: BaseException) -> str:
    """Return what is wrong with a file, in words."""
    text = str(error)
    if isinstance(error, ValueError) and not isinstance(error, UnicodeError | msgspec.MsgspecError):
        return text
    if isinstance(error, LookupError):
        return f"damaged: it names {text}, which isn't there"
    return f"damaged: {text or type(error).__name__}"


class DamageNotes(list[str]):
    """What is missing or damaged in a file; what is found once it is open is a `LogWarning` too."""

    def __init__(self, file: Path, texts: Iterable[str] = ()) -> None:
        super().__init__(texts)
        self.file = file
        self.loud = False

    def add(self, text: str) -> None:
        """Tell something, once."""
        if text not in self:
            self.append(text)
            if self.loud:
                warnings.warn(f"{self.file}: {text}", LogWarning, stacklevel=2)


def keep_quiet(recording: Recording) -> None:
    """Have what is found later stand in the recording's warnings alone, for who prints these himself."""
    if isinstance(recording.warnings, DamageNotes):
        recording.warnings.loud = False


class BagElements:
    """The elements of a whole bag: what they are stands in its facts, values are read when they are first asked for.

    `warnings` grows by what is then found damaged, and so do the failures of the element.
    """

    def __init__(self, file: Path, data: memoryview, facts: RecordingFacts, index: Index, ticks: int) -> None:
        self._file = file
        self._zero, self._ticks = facts.offset - ticks, ticks
        self._data = data
        self._facts = facts
        self._index = index
        self._values: dict[int, Values] = {}
        self._asked: set[int] = set()  # to be read together with the next one
        self.warnings = DamageNotes(file, facts.warnings)
        self.warnings.loud = True
        self.elements = tuple(self._element(place, one) for place, one in enumerate(facts.elements))

    def _element(self, place: int, facts: PlacedElement) -> RecordedElement:
        # a damaged count must not announce more than the file can hold
        count = most_samples(facts, len(self._data) // INDEX_ENTRY.itemsize, self._ticks)
        ahead = partial(self._asked.add, place)
        entries = [
            lazy_entry(one.name, one.entry, partial(self._column, place, at), logged_dtype(one), count, ahead)
            for at, one in enumerate(facts.entries)
        ]
        return alike(RecordedElement, facts, entries=tuple(entries))

    def _column(self, place: int, at: int) -> NDArray[Any]:
        if place not in self._values:
            asked = {*range(len(self.elements))} if len(self._values) >= ALONE else {place, *self._asked}
            wanted = sorted(asked - self._values.keys())
            with damage_told(self._file):
                self._values.update(zip(wanted, self._read(wanted), strict=True))
            self._asked.clear()
        return self._values[place].column(at)

    def _read(self, places: list[int]) -> list[Values]:
        # a damaged count must not reserve memory that the file can't fill
        most = len(self._data) // INDEX_ENTRY.itemsize
        elements = [Values(self._facts.elements[place], most, self._ticks) for place in places]
        readers = channel_readers(self._facts, elements)
        wanted = np.array(sorted(readers), np.uint16)
        for place, _, offsets in self._index.chunks:
            here = offsets[np.isin(offsets["channel"], wanted)]
            if not len(here):
                continue
            chunk = self._chunk(place)
            listed = list(zip(here["channel"].tolist(), here["offset"].tolist(), strict=True))
            found = [(readers[channel], self._entries(channel, at)["offset"]) for channel, at in listed]
            known = chunk is not None and are_right(chunk, found)
            for (_, at), (reader, entries) in zip(listed, found, strict=True):
                if chunk is None:
                    reader.skip(len(entries))
                elif not reader.add(chunk, entries, known):
                    self._tell(f"an index at byte {at:,} is damaged: {len(entries):,} samples can't be found by it")
        for values in elements:
            if values.facts.entries and values.short > 0:
                self._tell(f"'{values.facts.name}' has {values.short:,} samples less than its table says")
                values.fill_up()
        for place, values in zip(places, elements, strict=True):
            # as frozen as its list of warnings is: what was told before nobody could know of this
            object.__setattr__(self.elements[place], "failures", with_gaps(values, self._zero))
        return elements

    def _chunk(self, place: int) -> bytes | None:
        try:
            return bytes(unpack_chunk(record_at(self._data, place, Opcode.CHUNK)))
        except DAMAGE as error:
            self._tell(f"what was logged in the chunk at byte {place:,} can't be read ({told_damage(error)})")
            return None

    def _entries(self, channel: int, at: int) -> NDArray[np.void]:
        """Where the messages of a channel begin in a chunk; nothing of an index that is damaged."""
        try:
            body = record_at(self._data, at, Opcode.MESSAGE_INDEX)
            found, size = struct.unpack_from("<HI", body)
            if found == channel:
                return np.frombuffer(body[6 : 6 + size], INDEX_ENTRY)
        except DAMAGE:
            pass
        self._tell(f"an index at byte {at:,} is damaged")
        return np.empty(0, INDEX_ENTRY)

    def _tell(self, what: str) -> None:
        self.warnings.add(f"{what}: {GAPS}")


GAPS = "NaN stands there, and nothing (masked) where a type has no NaN"


def recorded(values: Values, zero: int) -> RecordedElement:
    """An element with the samples of it that are whole; `zero` is the tick of the recording's first time stamp."""
    facts = values.facts
    entries = tuple(RecordedEntry(e.name, e.entry, values.column(index)) for index, e in enumerate(facts.entries))
    return alike(RecordedElement, facts, entries=entries, failures=with_gaps(values, zero))


def with_gaps(values: Values, zero: int) -> Failures:
    """The failures of an element, with the ticks whose samples are damaged; `zero` is the first tick."""
    facts = values.facts
    ticks = zero + facts.first + np.flatnonzero(values.missing[: values.whole]) * facts.divider
    return failures_at(facts.failures, ticks, facts.divider)
