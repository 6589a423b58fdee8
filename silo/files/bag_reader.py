"""Reading bags that silo wrote, back into a `Recording` with every value bit for bit.

The facts attachment says where in which message each value stands; the message index says where in a chunk each
message stands; so a chunk is read with one indexed load per channel, and `open_bag` reads only what is asked for
(`silo.files.bags.index`). A file that was cut off gives what is whole, with a warning. Bags of others have no facts:
`open_bag` gives them to `silo.files.others`.
"""

import mmap
import os
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.core.recording import Recording, alike
from silo.errors import FileFormatError, LogNotFoundError, SiloError
from silo.files.atomic import reason
from silo.files.bags.channels import ChannelReader, Values, channel_readers
from silo.files.bags.index import (
    DAMAGE,
    GAPS,
    BagElements,
    DamageNotes,
    Index,
    damage_told,
    read_index,
    record_at,
    recorded,
    told_damage,
)
from silo.files.bags.metadata import (
    FACTS_ATTACHMENT,
    FACTS_VERSION,
    TIME_ATTACHMENT,
    RecordingFacts,
    unpack_facts,
    unpack_times,
)
from silo.files.formats import refuse_others
from silo.files.mcap.chunks import INDEX_ENTRY, records, unpack_chunk
from silo.files.mcap.writer import MAGIC
from silo.files.parts.metadata import PART_ATTACHMENT, unpack_part
from silo.files.parts.reader import read_part
from silo.files.parts.scan import attachment


def read_bag(path: str | os.PathLike[str]) -> Recording:
    """The recording in a bag that silo wrote: a rosbag2 folder or an `.mcap` file.

    A truncated file gives the samples that are whole; `Recording.warnings` says what is missing. Raises
    `LogNotFoundError` if it can't be opened, `FileFormatError` for damaged files and for bags of others.
    """
    file, data = _mapped(path)
    with damage_told(file):
        return _read(data)


def open_bag(path: str | os.PathLike[str]) -> Recording:
    """As `read_bag`, but of a whole file each element is read when it is asked for, and bags of others are read too.

    What is damaged in an element raises `FileFormatError` then.
    """
    source = Path(path)
    if _is_of_others(source):
        return _opened_others(source)
    file, data = _mapped(path)
    with damage_told(file):
        index = read_index(data)
        if index is None or {FACTS_ATTACHMENT, PART_ATTACHMENT} & index.attachments.keys():
            try:
                return _read_by_index(file, data, index) or _read(data)
            except _NotOursError:
                pass
            except _LostFactsError as error:
                return _as_of_others(source, error)
    return _opened_others(source)


def _as_of_others(source: Path, error: ValueError) -> Recording:
    """A bag of silo without what it says of itself: its messages have a description of their own.

    Raises the error where they can't be read either.
    """
    try:
        found = _opened_others(source)
    except SiloError:
        raise error from None
    lost = f"what silo wrote beside the messages can't be read ({error}): read as a bag of others, each topic by itself"
    if isinstance(found.warnings, DamageNotes):
        found.warnings.insert(0, lost)
    return found


def _is_of_others(path: Path) -> bool:
    """Whether the files alone tell that silo did not write it: it writes one .mcap file."""
    return path.suffix == ".db3" or (path.is_dir() and len(list(path.glob("*.mcap"))) != 1)


def _opened_others(path: Path) -> Recording:
    from silo.files.others.recording import open_others

    return open_others(path)


def _mapped(path: str | os.PathLike[str]) -> tuple[Path, memoryview]:
    file = _storage_file(Path(path))
    refuse_others(file)
    try:
        with file.open("rb") as opened:
            if os.fstat(opened.fileno()).st_size == 0:
                raise FileFormatError(f"{file}: the file is empty")
            # the map ends with its last view, whoever holds it
            return file, memoryview(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise LogNotFoundError(f"can't open '{file}': {reason(error)}") from error


def _storage_file(path: Path) -> Path:
    if not path.exists():
        raise LogNotFoundError(f"there is no file or folder '{path}'")
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        raise FileFormatError(f"{path}: a bag that silo wrote holds one .mcap file, this folder holds {len(files)}")
    return files[0]


def _read_by_index(file: Path, data: memoryview, index: Index | None) -> Recording | None:
    """The recording, its elements to be read when they are asked for; None where the file isn't whole or is a part."""
    if (
        index is None
        or PART_ATTACHMENT in index.attachments
        or not {FACTS_ATTACHMENT, TIME_ATTACHMENT} <= set(index.attachments)
    ):
        return None
    try:
        facts = unpack_facts(_attached(data, index, FACTS_ATTACHMENT))
        times = unpack_times(_attached(data, index, TIME_ATTACHMENT))
    except DAMAGE as error:
        raise _LostFactsError(told_damage(error)) from error
    _check(facts, len(times))
    counts = index.counts
    if facts.version != FACTS_VERSION or any(
        counts.get(entry.channel, 0) != element.count - entry.absent
        for element in facts.elements
        for entry in element.entries
    ):
        return None
    bag = BagElements(file, data, facts, index, len(times))
    return alike(Recording, facts, time_ns=times, elements=bag.elements, warnings=bag.warnings)


def _attached(data: memoryview, index: Index, name: str) -> bytes:
    at, _ = index.attachments[name]
    return attachment(record_at(data, at, Opcode.ATTACHMENT))[2]


def _check(facts: RecordingFacts, ticks: int) -> None:
    """Raise `_LostFactsError` for samples without a time stamp."""
    for one in facts.elements:
        last = one.first + (one.count - 1) * one.divider
        if one.count < 0 or one.divider < 1 or (one.count and not 0 <= one.first <= last < ticks):
            raise _LostFactsError(f"'{one.name}' has samples without a time stamp")


class _LostFactsError(ValueError):
    """What silo wrote beside the messages can't be read."""


class _NotOursError(ValueError):
    """No attachment of silo is in it."""


_UNPACK: Mapping[str, Callable[[bytes], Any]] = {
    FACTS_ATTACHMENT: unpack_facts,
    PART_ATTACHMENT: unpack_part,
    TIME_ATTACHMENT: unpack_times,
}


def _understood(body: memoryview) -> tuple[str, Any]:
    """Name and content of an attachment. Raises `_LostFactsError`."""
    try:
        name, _, content = attachment(body)
        return name, _UNPACK.get(name, bytes)(content)
    except DAMAGE as error:
        raise _LostFactsError(told_damage(error)) from error


def _read(data: memoryview) -> Recording:  # noqa: PLR0912  # a branch per record
    if bytes(data[: len(MAGIC)]) != MAGIC:
        raise FileFormatError("not an MCAP file: it doesn't start with the MCAP mark")
    facts: RecordingFacts | None = None
    times: NDArray[np.int64] | None = None
    elements: list[Values] = []
    readers: dict[int, ChannelReader] = {}
    chunk: bytes | None = None
    known = complete = False
    damaged: list[str] = []
    for opcode, at, body in records(data, len(MAGIC)):
        if opcode == Opcode.ATTACHMENT:
            name, content = _understood(body)
            if name == FACTS_ATTACHMENT:
                facts = content
                if facts.version != FACTS_VERSION:
                    raise ValueError(f"layout version {facts.version} is newer than this silo reads ({FACTS_VERSION})")
            elif name == PART_ATTACHMENT:
                return read_part(data, content)
            elif name == TIME_ATTACHMENT:
                times = content
            if facts is not None and times is not None and not elements:
                _check(facts, len(times))
                # a message takes at least an index entry
                most = len(data) // INDEX_ENTRY.itemsize
                elements = [Values(element, most, len(times)) for element in facts.elements]
                readers = channel_readers(facts, elements)
        elif opcode == Opcode.CHUNK:
            # in bags of silo, facts come first
            known, chunk = facts is not None, None
            if known:
                try:
                    chunk = bytes(unpack_chunk(body))
                except DAMAGE as error:
                    damaged.append(f"what was logged in the chunk at byte {at:,} can't be read ({told_damage(error)})")
        elif opcode == Opcode.MESSAGE_INDEX and known:
            channel, size = struct.unpack_from("<HI", body)
            entries = np.frombuffer(body[6 : 6 + size], dtype=INDEX_ENTRY)
            if channel not in readers:
                continue
            if chunk is None:
                readers[channel].skip(len(entries))
            elif not readers[channel].add(chunk, entries["offset"]):
                damaged.append(f"an index at byte {at:,} is damaged: {len(entries):,} samples can't be found by it")
        elif opcode == Opcode.DATA_END:
            complete = bytes(data[-len(MAGIC) :]) == MAGIC
            break
    if facts is None:
        raise _NotOursError("this bag was not written by silo, or was cut off before its table")
    if times is None:
        raise ValueError("cut off before its time stamps")
    zero = facts.offset - len(times)
    told = (*_warnings(facts, elements, complete), *(f"{what}: {GAPS}" for what in damaged))
    found = tuple(recorded(values, zero) for values in elements)
    return alike(Recording, facts, time_ns=times, elements=found, warnings=told)


def _warnings(facts: RecordingFacts, elements: list[Values], complete: bool) -> tuple[str, ...]:
    missing = sum(values.short for values in elements if values.facts.entries)
    if missing > 0:
        return (*facts.warnings, f"the file is cut off: {missing} samples are missing at the end")
    if not complete:
        cut = "the file is cut off: its index is missing, which other readers need; all samples are there"
        return (*facts.warnings, cut)
    return facts.warnings
