"""Reading bags that silo wrote, back into a `Recording` with every value bit for bit.

The facts attachment says where in which message each value stands; the message index says where in a chunk each
message stands; so a chunk is read with one indexed load per channel. A file that was cut off gives what is whole, with
a warning. Bags of others have no facts: `FileFormatError` says so.
"""

import mmap
import os
import struct
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.errors import FileFormatError, LogNotFoundError
from silo.files.atomic import reason
from silo.files.bag_channels import INDEX_ENTRY, ChannelReader, Values, channel_readers, unpack_chunk
from silo.files.bag_facts import (
    FACTS_ATTACHMENT,
    FACTS_VERSION,
    TIME_ATTACHMENT,
    RecordingFacts,
    unpack_facts,
    unpack_times,
)
from silo.files.mcap_write import MAGIC
from silo.files.part_facts import PART_ATTACHMENT, unpack_part
from silo.files.part_read import read_part
from silo.files.part_scan import attachment
from silo.recording import RecordedElement, RecordedEntry, Recording


def read_bag(path: str | os.PathLike[str]) -> Recording:
    """The recording in a bag that silo wrote: a rosbag2 folder or an `.mcap` file.

    A truncated file gives the samples that are whole; `Recording.warnings` says what is missing. Raises
    `LogNotFoundError` if it can't be opened, `FileFormatError` for damaged files and for bags of others.
    """
    file = _storage_file(Path(path))
    try:
        with file.open("rb") as opened:
            if os.fstat(opened.fileno()).st_size == 0:
                raise FileFormatError(f"{file}: the file is empty")
            # the map ends with its last view, whoever holds it
            data = memoryview(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise LogNotFoundError(f"can't open '{file}': {reason(error)}") from error
    try:
        return _read(data)
    except (struct.error, ValueError, IndexError, OverflowError, TypeError, MemoryError) as error:
        # every field of a damaged file may hold anything
        raise FileFormatError(f"{file}: {error}") from error
    except (zstandard.ZstdError, msgspec.MsgspecError) as error:
        raise FileFormatError(f"{file}: damaged: {error}") from error


def _storage_file(path: Path) -> Path:
    if not path.exists():
        raise LogNotFoundError(f"there is no file or folder '{path}'")
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        raise FileFormatError(f"{path}: a bag that silo wrote holds one .mcap file, this folder holds {len(files)}")
    return files[0]


def _read(data: memoryview) -> Recording:
    if bytes(data[: len(MAGIC)]) != MAGIC:
        raise FileFormatError("not an MCAP file: it doesn't start with the MCAP mark")
    facts: RecordingFacts | None = None
    times: NDArray[np.int64] | None = None
    elements: list[Values] = []
    readers: dict[int, ChannelReader] = {}
    chunk: bytes | None = None
    complete = False
    for opcode, body in _records(data):
        if opcode == Opcode.ATTACHMENT:
            name, _, content = attachment(body)
            if name == FACTS_ATTACHMENT:
                facts = unpack_facts(content)
                if facts.version != FACTS_VERSION:
                    raise ValueError(f"layout version {facts.version} is newer than this silo reads ({FACTS_VERSION})")
                # a message takes at least an index entry
                elements = [Values(element, len(data) // INDEX_ENTRY.itemsize) for element in facts.elements]
                readers = channel_readers(facts, elements)
            elif name == PART_ATTACHMENT:
                return read_part(data, unpack_part(content))
            elif name == TIME_ATTACHMENT:
                times = unpack_times(content)
        elif opcode == Opcode.CHUNK:
            chunk = unpack_chunk(body)
        elif opcode == Opcode.MESSAGE_INDEX and chunk is not None:
            channel, size = struct.unpack_from("<HI", body)
            entries = np.frombuffer(body[6 : 6 + size], dtype=INDEX_ENTRY)
            if channel in readers:
                readers[channel].add(chunk, entries["offset"])
        elif opcode == Opcode.DATA_END:
            complete = bytes(data[-len(MAGIC) :]) == MAGIC
            break
    if facts is None or times is None:
        raise ValueError(
            "this bag was not written by silo, or was cut off before its table"
            if complete or facts is None
            else "cut off before its time stamps"
        )
    return _recording(facts, times, elements, complete)


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Opcode and content of each whole record; stops at the first that is cut off."""
    at = len(MAGIC)
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        at += 9
        if at + length > len(data):
            return
        yield opcode, data[at : at + length]
        at += length


def _recording(facts: RecordingFacts, times: NDArray[np.int64], elements: list[Values], complete: bool) -> Recording:
    warnings = list(facts.warnings)
    missing = sum(values.facts.count - values.whole for values in elements if values.facts.entries)
    if missing:
        warnings.append(f"the file is cut off: {missing} samples are missing at the end")
    elif not complete:
        warnings.append("the file is cut off: its index is missing, which other readers need; all samples are there")
    return Recording(
        logger=facts.logger,
        time_ns=times,
        offset=facts.offset,
        elements=tuple(_element(values) for values in elements),
        prefix=facts.prefix,
        frequency_hz=facts.frequency_hz,
        started_ns=facts.started_ns,
        time_looping=facts.time_looping,
        warnings=tuple(warnings),
        why=facts.why,
        extras=facts.extras,
        events=facts.events,
    )


def _element(values: Values) -> RecordedElement:
    facts = values.facts
    return RecordedElement(
        name=facts.name,
        unit=facts.unit,
        kind=facts.kind,
        shape=facts.shape,
        divider=facts.divider,
        buffer_type=facts.buffer_type,
        first=facts.first,
        entries=tuple(
            RecordedEntry(entry.name, entry.entry, array[: values.whole])
            for entry, array in zip(facts.entries, values.arrays, strict=True)
        ),
        description=facts.description,
        lost=facts.lost,
        dtype=facts.dtype,
        failures=facts.failures,
    )
