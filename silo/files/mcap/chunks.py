"""Chunks of MCAP files, unpacked: the one way for all that reads them, ours and those of others, whole and cut short.

What a chunk announces is looked at before anything is unpacked: a few bytes may say that they are gigabytes. Where the
index of a file is damaged, `walked` finds the messages of a chunk by their records.
"""

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

INDEX_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])
RECORD = struct.Struct("<BQ")  # the head of a record: opcode, length
# Writers cut chunks at 1 to 10 MB, and a message may be larger; blank pictures and maps shrink to a 30,000th. So small
# ones may unpack to this much whatever they weigh, larger ones to what lz4 can pack at best.
MOST_ROOM = 64 << 20
MOST_RATIO = 256
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_MESSAGE = np.dtype(
    {
        "names": ["opcode", "length", "channel", "time"],
        "formats": ["u1", "<u8", "<u2", "<u8"],
        "offsets": [0, 1, 9, 15],
        "itemsize": RECORD.size + MESSAGE.size,
    }
)
_BARE_RECORDS = 4096  # more than that, and more than packed bytes, are no records of a writer
_HEAD = struct.Struct("<QQQII")  # of a chunk: first and last time, size, checksum, length of the compression's name


def mapped(file: BinaryIO) -> memoryview:
    """Return the bytes of a file, none of an empty one; the map ends with its last view, whoever holds it."""
    if not os.fstat(file.fileno()).st_size:
        return memoryview(b"")
    return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def most_room(packed: bytes | memoryview) -> int:
    """Return to how many bytes these may unpack."""
    return max(MOST_ROOM, MOST_RATIO * len(packed))


def unpack_chunk(body: memoryview) -> bytes | memoryview:
    """The records of a chunk; one that is not compressed stays a view of its file.

    Raises ValueError or ZstdError for one that is damaged, announces more than so few bytes can hold, or is packed in a
    way that isn't known.
    """
    size, checksum, compression, content = _head(body)
    chunk: bytes | memoryview = content
    if compression == "zstd":
        chunk = _of_zstd(content, size)
    elif compression == "lz4":
        chunk = _of_lz4(content, size)
    elif compression:
        raise ValueError(f"a chunk is compressed with {compression!r}, not with zstd or lz4")
    if len(chunk) != size or (checksum and zlib.crc32(chunk) != checksum):
        raise ValueError("a chunk is damaged: wrong checksum")
    return chunk


def chunk_start(body: memoryview, length: int) -> bytes:
    """The first bytes of a chunk of ours, a tenth of the work of unpacking it; its checksum is not looked at."""
    size, _, _, content = _head(body)
    with zstandard.ZstdDecompressor().stream_reader(content) as stream:
        start: bytes = stream.read(min(length, size))
    return start


def _head(body: memoryview) -> tuple[int, int, str, memoryview]:
    """Size and checksum of what a chunk unpacks to, how it is packed, and the packed bytes."""
    if len(body) < _HEAD.size:
        raise ValueError("a chunk is damaged: it ends within its head")
    _, _, size, checksum, length = _HEAD.unpack_from(body)
    at = _HEAD.size + length
    if at + 8 > len(body):
        raise ValueError("a chunk is damaged: it ends within its head")
    compression = bytes(body[_HEAD.size : at]).decode(errors="replace")
    (packed,) = struct.unpack_from("<Q", body, at)
    content = body[at + 8 : at + 8 + packed]
    if compression and size > (most := most_room(content)):
        raise ValueError(
            f"a chunk is damaged: it announces {size:,} bytes, of {len(content):,} that are packed at most {most:,} "
            "are believed"
        )
    return size, checksum, compression, content


def _of_zstd(content: memoryview, size: int) -> bytes:
    announced = zstandard.frame_content_size(bytes(content[:32]))
    if announced >= 0:
        # a frame that says how much it is gets that much room, whatever it holds
        if announced != size:
            raise ValueError("a chunk is damaged: it has not the size that it announces")
        return zstandard.decompress(content)
    return zstandard.ZstdDecompressor().decompress(content, max_output_size=max(size, 1))


def _of_lz4(content: memoryview, size: int) -> bytes:
    try:
        chunk: bytes = lz4.frame.LZ4FrameDecompressor().decompress(bytes(content), max_length=size + 1)
    except (RuntimeError, EOFError) as error:
        raise ValueError(f"a chunk is damaged: {error}") from error
    return chunk


def records(data: bytes | memoryview, at: int = 0) -> Iterator[tuple[int, int, memoryview]]:
    """Opcode, place and body of each whole record from there on; ends where there is none."""
    view = memoryview(data)
    while at + RECORD.size <= len(view):
        opcode, length = RECORD.unpack_from(view, at)
        end = at + RECORD.size + length
        if not opcode or end > len(view):  # zeros: 0 is nobody's opcode
            return
        yield opcode, at, view[at + RECORD.size : end]
        at = end


def walked(chunk: bytes | memoryview, packed: int) -> tuple[dict[int, NDArray[np.void]], list[tuple[int, memoryview]]]:
    """The index entries of each channel of a chunk by its records, and what else stands in it: opcode and body.

    `packed` is what the chunk takes in the file. Raises ValueError where so few bytes can't be so many records.
    """
    found: dict[int, list[tuple[int, int]]] = {}
    others: list[tuple[int, memoryview]] = []
    left = max(_BARE_RECORDS, packed)
    for opcode, at, body in records(chunk):
        left -= 1
        if not left:
            raise ValueError(f"a chunk is damaged: {packed:,} bytes announce more records than that")
        if opcode == Opcode.MESSAGE and len(body) >= MESSAGE.size:
            channel, _, log_time, _ = MESSAGE.unpack_from(body)
            found.setdefault(channel, []).append((log_time, at))
        elif opcode != Opcode.MESSAGE:
            others.append((opcode, body))
    return {channel: np.array(pairs, INDEX_ENTRY) for channel, pairs in found.items()}, others


def are_messages(
    block: bytes | memoryview, channels: "int | NDArray[np.uint16]", entries: NDArray[np.void]
) -> NDArray[np.bool_]:
    """Which index entries point at whole messages of these channels, logged then: an index has no checksum."""
    room = len(block) - _MESSAGE.itemsize
    if room < 0:
        return np.zeros(entries.shape, bool)
    inside = entries["offset"] <= room
    places = np.where(inside, entries["offset"], 0)
    every: NDArray[np.void] = np.ndarray((room + 1,), _MESSAGE, block, 0, (1,))
    found = every[places.astype(np.int64)]
    whole = (found["length"] >= MESSAGE.size) & (found["length"] <= len(block) - RECORD.size - places)
    mine = (found["opcode"] == Opcode.MESSAGE) & (found["channel"] == channels) & (found["time"] == entries["time"])
    return np.asarray(inside & whole & mine)
