"""One part while it is written: an MCAP file that grows by chunks, and gets its name when it is whole."""

import contextlib
import fcntl
import os
import time
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.recording import RecordedElement
from silo.core.runtime import sync
from silo.files.bags.message_groups import group_samples
from silo.files.bags.writer import MAX_STAMP_NS, metadata_yaml, write_windows
from silo.files.manifest import part_path
from silo.files.mcap.writer import McapWriter, Write
from silo.files.naming import log_path, next_run_number
from silo.files.parts.events import event_messages
from silo.files.parts.metadata import LOST_METADATA, PART_ATTACHMENT, TOTALS_METADATA, pack_part
from silo.recorder.parts.layout import ChannelLayout
from silo.segment.rows import Rows

SYNC_S, SYNC_BYTES = 5.0, 64 << 20  # how often what was written is put on the disk: a power cut loses no more
_NAMES_TOLD = 20


class OpenPart:
    """A part that is open. Every method may raise OSError of the disk."""

    def __init__(
        self, folder: Path, recorder: str, layout: ChannelLayout, begin: Mapping[int, int], write: Write | None
    ) -> None:
        """Make the file, locked as long as it is open."""
        run_number = next_run_number(folder, recorder)
        self.final = log_path(folder, recorder, run_number, datetime.now().astimezone(), ".mcap")
        self.path = part_path(folder, self.final.name)
        self.layout = layout
        self.begun_s = time.monotonic()
        self._file = self.path.open("xb", buffering=0)
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self.inode = os.fstat(self._file.fileno()).st_ino
        self._mcap = McapWriter(self._file, *layout.definitions, write=write)
        self._mcap.attach(PART_ATTACHMENT, "application/zstd", pack_part(layout.facts(recorder, begin)))
        self._rows: dict[int, int] = dict.fromkeys(layout.rings, 0)
        self._span: tuple[int, int] | None = None
        self._synced_s, self._synced_bytes = self.begun_s, 0
        self._lost = self._events = 0

    @property
    def size_bytes(self) -> int:
        """Bytes written."""
        return self._mcap.size_bytes

    @property
    def index_bytes(self) -> int:
        """Bytes of its index, which is in memory until it is finished."""
        return self._mcap.index_bytes

    @property
    def lost(self) -> int:
        """Samples that it says are missing."""
        return self._lost

    @property
    def rows(self) -> dict[int, int]:
        """Rows written, by ring."""
        return dict(self._rows)

    @property
    def samples(self) -> int:
        """Samples written."""
        return sum(rows * len(self.layout.ring_channels[ring]) for ring, rows in self._rows.items())

    def add(self, rows: Rows, elements: list[RecordedElement]) -> None:
        """Write rows of a ring, as samples of these elements, as chunks; all their stamps fit: `stamps_fit`."""
        ring = rows.ring.ring
        times = rows.time_ns
        first, last = int(times.min()), int(times.max())
        groups = group_samples(elements, self.layout.ring_channels[ring], rows.first)
        write_windows(self._mcap, np.ascontiguousarray(times), groups)
        self._rows[ring] += len(rows)
        self._stretch(first, last)

    def add_events(self, events: Sequence[LoggedEvent]) -> None:
        """Write what happened as a chunk of its own."""
        stamped = [_held(event) for event in events]
        layout = self.layout
        records, index, span = event_messages(
            layout.events_channel, stamped, layout.schema.logger, self._mcap.definitions_size
        )
        self._mcap.add_chunk(memoryview(records), *span, index)
        self._events += len(events)
        self._stretch(*span)

    def _stretch(self, first: int, last: int) -> None:
        self._span = (min(first, self._span[0]), max(last, self._span[1])) if self._span else (first, last)

    def note_gone(self, text: str) -> None:
        """Write in place that a run before this one is not whole, where nobody can count what is missing."""
        self._mcap.add_metadata(LOST_METADATA, {"why": text})

    def note_lost(self, ring: int, begin: int, end: int, why: str) -> None:
        """Write in place which rows are missing."""
        names = [element.info.name for element in self.layout.elements if element.watch_ring == ring]
        divider = self.layout.schema.rings[ring].divider
        more = f" and {len(names) - _NAMES_TOLD} more" if len(names) > _NAMES_TOLD else ""
        self._mcap.add_metadata(
            LOST_METADATA,
            {
                "first_tick": str(begin * divider),
                "last_tick": str((end - 1) * divider),
                "samples_of_each": str(end - begin),
                "elements": ", ".join(names[:_NAMES_TOLD]) + more,
                "why": why,
            },
        )
        self._lost += (end - begin) * len(names)

    def sync_if_due(self) -> None:
        """Put what was written on the disk, now and then: the end then takes no long time either."""
        now_s = time.monotonic()
        due = now_s - self._synced_s >= SYNC_S and self.size_bytes > self._synced_bytes
        if due or self.size_bytes - self._synced_bytes >= SYNC_BYTES:
            os.fdatasync(self._file.fileno())
            self._synced_s, self._synced_bytes = time.monotonic(), self.size_bytes

    def finish(self) -> int:
        """Write index and summary, sync, and give it its name; returns its size, 0 if it was empty and is removed."""
        with self._file:
            if self._span is None:
                self.path.unlink(missing_ok=True)
                return 0
            self._mcap.add_metadata(TOTALS_METADATA, {"samples": str(self.samples), "lost": str(self._lost)})
            counts = {
                number: self._rows[ring] for ring, channels in self.layout.ring_channels.items() for number in channels
            } | {self.layout.events_channel: self._events}
            text = metadata_yaml(self.layout.template, self.layout.topics, counts, self.final.name, self._span)
            self._mcap.add_metadata("rosbag2", {"serialized_metadata": text})
            self._mcap.finish(counts, *self._span)
            self._file.truncate(self._mcap.size_bytes)  # what a full disk left of a chunk
            os.fsync(self._file.fileno())
            self.path.rename(self.final)
        with contextlib.suppress(OSError):  # some network file systems refuse that
            sync(self.final.parent)
        return self._mcap.size_bytes

    def leave(self) -> None:
        """Let go of a part that can't be finished: it is closed later."""
        self._file.close()


def _held(event: LoggedEvent) -> LoggedEvent:
    """The event at a time that a file can hold."""
    if 0 <= event.at_ns < MAX_STAMP_NS:
        return event
    return msgspec.structs.replace(event, stamp_ns=min(max(event.at_ns, 1), MAX_STAMP_NS - 1))


def stamps_fit(rows: Rows) -> NDArray[np.bool_]:
    """Which rows have time stamps that the format can hold."""
    times = rows.time_ns
    return (times >= 0) & (times < MAX_STAMP_NS)
