"""What happened, as messages of a bag: `rcl_interfaces/msg/Log` on `<prefix>/events`, which every viewer shows.

A message stands at its tick: log time and stamp are the tick's, so that it lies beside the values of that moment. What
happened before the first tick that is kept stands at that one, what happened later at the last.
"""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.recording import Recording
from silo.files.bags.message_groups import MESSAGE_HEAD, RECORD_HEAD
from silo.files.bags.ros_types import ENCAPSULATION, Channel, MessageType, add_numbers, add_text, free_topic
from silo.files.mcap.writer import MESSAGE_OPCODE, IndexBlock, index_block

LEVELS = ("DEBUG=10", "INFO=20", "WARN=30", "ERROR=40", "FATAL=50")
INFO, WARN, ERROR = 20, 30, 40
_WARNS = ("lost", "blind", "files deleted", "limit", "durable", "unheld")
_LEVEL_OF = dict.fromkeys(_WARNS, WARN) | dict.fromkeys(("save failed", "crashed"), ERROR)
LOG_TYPE = MessageType(
    "rcl_interfaces/msg/Log",
    (
        ("builtin_interfaces/Time", "stamp"),
        ("uint8", "level"),
        ("string", "name"),
        ("string", "msg"),
        ("string", "file"),
        ("string", "function"),
        ("uint32", "line"),
    ),
    tuple(f"byte {level}" for level in LEVELS),
)
_SECOND = 1_000_000_000


def events_topic(recording: Recording, channels: Sequence[Channel]) -> str:
    """The topic of the events, another one where an element has that name."""
    return free_topic(f"{recording.prefix}/events", [channel.topic for channel in channels])


def log_message(event: LoggedEvent, logger: str, stamp_ns: int) -> bytes:
    """One event as a `rcl_interfaces/msg/Log`: who did it is its name, the kind its function, the tick its line.

    The tick counts modulo 2^32. Its file is what it changed of parameters, as JSON.
    """
    change = msgspec.json.encode(event.change).decode() if event.change is not None else ""
    body = bytearray()
    add_numbers(body, "iIB", stamp_ns // _SECOND, stamp_ns % _SECOND, _LEVEL_OF.get(event.kind, INFO))
    for text in (event.who or logger, f"{event.kind}: {event.text}", change, event.kind):
        add_text(body, text)
    add_numbers(body, "I", event.tick % 2**32)
    return ENCAPSULATION + bytes(body)


class EventGroup:
    """The messages of all events, one channel: stands beside the groups of `silo.files.bags.message_groups`."""

    divider = 1
    first = 0
    count = 0  # of samples, which have ticks of their own

    def __init__(self, recording: Recording, channel: int) -> None:
        held, before = len(recording.time_ns), recording.offset - len(recording.time_ns)
        self._channel = channel
        events = sorted(recording.events, key=lambda event: event.tick) if held else []
        self._places = np.array([min(max(event.tick - before, 0), held - 1) for event in events], np.int64)
        self._records = [
            event_record(channel, number, event, recording.logger, int(recording.time_ns[place]))
            for number, (event, place) in enumerate(zip(events, self._places.tolist(), strict=True))
        ]
        self._sizes = np.array([len(record) for record in self._records], np.int64)
        self._window = slice(0, 0)
        self._ticks = np.zeros(0, np.int64)
        self._times = np.zeros(0, np.int64)
        self._positions = np.zeros(0, np.int64)

    def __len__(self) -> int:
        return len(self._records)

    @property
    def tick_bytes(self) -> int:
        """Bytes that a tick needs at most: all happened at one."""
        return int(self._sizes.sum())

    def reserve(self, ticks: int) -> None:
        """Everything is there."""

    def build(self, begin: int, times: NDArray[np.int64]) -> None:
        """Choose the events of ticks `begin` and following, one per stamp in `times`."""
        low, high = np.searchsorted(self._places, [begin, begin + len(times)]).tolist()
        self._window = slice(low, high)
        self._ticks = self._places[self._window] - begin
        self._times = times[self._ticks]

    def add_sizes(self, sizes: NDArray[np.int64]) -> None:
        """Add the bytes of the records to the ticks of the window."""
        np.add.at(sizes, self._ticks, self._sizes[self._window])

    def place(self, cursor: NDArray[np.int64], buffer: NDArray[np.uint8]) -> None:
        """Copy the records into the window's buffer from `cursor` (a place per tick) on, and move the cursor."""
        positions = []
        for record, tick in zip(self._records[self._window], self._ticks.tolist(), strict=True):
            at = int(cursor[tick])
            buffer[at : at + len(record)] = np.frombuffer(record, np.uint8)
            cursor[tick] = at + len(record)
            positions.append(at)
        self._positions = np.array(positions, np.int64)

    def index(self, start: int, stop: int, shift: int) -> IndexBlock | None:
        """Message index records of the window's ticks `start` to `stop`; `shift` turns a place into an offset."""
        low, high = np.searchsorted(self._ticks, [start, stop]).tolist()
        if low == high:
            return None
        return index_block(np.array([self._channel], "<u2"), self._times[low:high], self._positions[low:high] + shift)

    def due(self, due: NDArray[np.bool_]) -> None:
        """Set the ticks that have an event."""
        due[self._places] = True


def event_record(
    channel: int, number: int, event: LoggedEvent, logger: str, stamp_ns: int, published_ns: int | None = None
) -> bytes:
    """The message record of an event, with log time and stamp `stamp_ns`; published then, too, or at another time."""
    message = log_message(event, logger, stamp_ns)
    times = stamp_ns, stamp_ns if published_ns is None else published_ns
    head = MESSAGE_HEAD.pack(MESSAGE_OPCODE, RECORD_HEAD - 9 + len(message), channel, number, *times)
    return head + message
