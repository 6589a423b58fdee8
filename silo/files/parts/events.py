"""What happened, in a part of an endless recording: chunks of `rcl_interfaces/msg/Log`, written as it comes.

A message is numbered as in the event log, published at the wall clock's time, and logged at that of its tick, so that
an event is read as it stands in the log, and a recorder that goes on knows which it has.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.tuning.parameters import ParameterChange
from silo.decoding import json_decoder
from silo.files.bags.events import event_record
from silo.files.bags.message_groups import MESSAGE_HEAD, RECORD_HEAD
from silo.files.bags.ros_types import CdrReader
from silo.files.mcap.chunks import INDEX_ENTRY
from silo.files.mcap.writer import IndexBlock, index_block
from silo.files.parts.metadata import SEQUENCES, row_of


def event_messages(
    channel: int, events: Sequence[LoggedEvent], logger: str, shift: int
) -> tuple[bytes, list[IndexBlock], tuple[int, int]]:
    """Return message records of events, their index, and their first and last time; `shift` is what is before them.

    Each event stands at its `at_ns`, which a file must be able to hold.
    """
    records = [
        event_record(channel, event.number % SEQUENCES, event, logger, event.at_ns, max(event.time_ns, 0))
        for event in events
    ]
    ends = np.cumsum([len(record) for record in records])
    times = np.array([event.at_ns for event in events], np.int64)
    places = shift + np.concatenate([[0], ends[:-1]]).astype(np.int64)
    index = index_block(np.array([channel], "<u2"), times, places)
    return b"".join(records), [index], (int(times.min()), int(times.max()))


def last_number(chunk: bytes, index: memoryview, begin: int) -> int:
    """Return the number of the last event of a chunk of a part that begins with event `begin`."""
    (offset,) = struct.unpack_from("<Q", index, len(index) - INDEX_ENTRY.itemsize + 8)
    return row_of(MESSAGE_HEAD.unpack_from(chunk, offset)[3], begin)


def events_of(chunk: bytes, offsets: NDArray[np.uint64], begin: int, tick: int, run: str) -> list[LoggedEvent]:
    """Return the events at these places of a chunk. `tick` is one of the part: ticks in messages count in 32 bits.

    Raises ValueError (as msgspec's errors are) or struct.error for damaged bytes.
    """
    return [_event(chunk, offset, begin, tick, run) for offset in offsets.tolist()]


def _event(chunk: bytes, offset: int, begin: int, tick: int, run: str) -> LoggedEvent:
    _, length, _, sequence, logged_ns, published_ns = MESSAGE_HEAD.unpack_from(chunk, offset)
    message = CdrReader(chunk[offset + RECORD_HEAD : offset + 9 + length])
    message.numbers("iIB")  # stamp and level
    who, text, change, kind = (message.text() for _ in range(4))
    (line,) = message.numbers("I")
    near = tick + (line - tick + SEQUENCES // 2) % SEQUENCES - SEQUENCES // 2
    return LoggedEvent(
        kind,
        text.removeprefix(f"{kind}: "),
        published_ns,
        near,
        logged_ns,
        who,
        run,
        row_of(sequence, begin),
        json_decoder(ParameterChange).decode(change) if change else None,
    )
