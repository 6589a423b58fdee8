"""The element table in parts that a thin link carries: each is answered before the next one is asked for.

A message is given up that a robot's queue can't take within a fraction of a second, and its link with it: the table of
10,000 elements, 1.8 MB, never came over 64 kbit/s. Compressed as a whole it is 40 kB, a third of what it is packet by
packet.
"""

import functools
import time
import zlib
from collections.abc import Callable
from typing import Final

import msgspec

from silo.core.elements import Table
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError
from silo.rpc.declaring import Reply
from silo.rpc.foreign import NOT_UNDERSTOOD
from silo.rpc.refusals import RefusedWhy, RequestRefusedError

FIRST_BYTES = 8 * 1024  # 1 s at 64 kbit/s: less than the lease of a link
MOST_BYTES = 64 * 1024  # as Zenoh sends at once
QUICK_S = 0.5  # after a part that took no longer the next one is twice as large
MOST_ANEW = 10  # tables that came while another one was read
MOST_TABLE_BYTES = 256 * 2**20  # of a whole one, more than a million elements


class TablePart(msgspec.Struct, frozen=True):
    """Some bytes of a whole `TableReply` as it is encoded and then compressed by zlib.

    `size` and `crc32` are those of all of its bytes: parts with the same ones are of the same table.
    """

    data: bytes
    size: int
    crc32: int


class TableReply(Reply, frozen=True):
    """Carries a `Table`; where a `part` was asked for, that, and of the table its revision alone."""

    table: Table
    part: TablePart | None = None


_decoder = msgpack_decoder(TableReply)


class EncodedTable:
    """The answer with a table, `whole` or in parts of it as it is compressed once somebody asks for them."""

    def __init__(self, table: Table) -> None:
        self.whole: Final = msgspec.msgpack.encode(TableReply(table))
        self._revision = table.revision

    @functools.cached_property
    def _packed(self) -> tuple[bytes, int]:
        packed = zlib.compress(self.whole, 9)
        return packed, zlib.crc32(packed)

    def part(self, start: int, most_bytes: int) -> TableReply:
        """Return at most so many bytes from one on. Raises RequestRefusedError for numbers below 0."""
        if min(start, most_bytes) < 0:
            text = f"a part of the table begins at byte 0 or later and has some bytes, got {start} and {most_bytes}"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        packed, crc32 = self._packed
        part = TablePart(packed[start : start + most_bytes], len(packed), crc32)
        return TableReply(Table(self._revision, []), part)


class TableParts:
    """What came of a table. Kept: a link that is cut goes on with it, and what did not change doesn't come again."""

    def __init__(self) -> None:
        self._kept = (b"", 0, 0)  # as a whole, since several threads may read: bytes, and size and crc32 of all of them

    def read(self, ask: Callable[[int, int], TableReply], told: Callable[[float], None] | None) -> Table:
        """Return the table, asked for in parts: from which byte on, and how many. Raises ConnectionLostError."""
        most_bytes, anew = FIRST_BYTES, 0
        while anew <= MOST_ANEW:
            data, size, crc32 = self._kept
            asked_s = time.monotonic()
            reply = ask(len(data), most_bytes)
            quick = time.monotonic() - asked_s < QUICK_S
            most_bytes = min(2 * most_bytes, MOST_BYTES) if quick else FIRST_BYTES
            if (part := reply.part) is None:
                return reply.table  # of a robot that knows no parts
            if data and (part.size, part.crc32) != (size, crc32):
                self._kept, anew = (b"", 0, 0), anew + 1  # somebody changed it
                continue
            data += part.data
            self._kept = (data, part.size, part.crc32)
            if len(data) == part.size:
                return self._whole(data, part.crc32)
            if not part.data or len(data) > part.size:
                self._kept = (b"", 0, 0)
                raise ConnectionLostError("parts of the table came that don't fit together; try again")
            if told is not None:
                told(len(data) / part.size)
        raise ConnectionLostError("the table was changed again and again while it was read; try again")

    def _whole(self, data: bytes, crc32: int) -> Table:
        try:
            if zlib.crc32(data) == crc32:
                return _decoder.decode(zlib.decompressobj().decompress(data, MOST_TABLE_BYTES)).table
            why = "its checksum is another one"
        except (zlib.error, *NOT_UNDERSTOOD) as error:
            why = str(error)
        self._kept = (b"", 0, 0)
        raise ConnectionLostError(f"the table that came can't be read: {why}; try again")
