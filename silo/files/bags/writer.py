"""Bags: a recording as a rosbag2 folder with MCAP storage, or as one plain `.mcap` file.

The message records of a time window are built as NumPy structured arrays, one per group of channels with the same
layout and the same ticks, and scattered time-major into one buffer that is cut into chunks. Measured against one
Python call per message (`mcap`: 0.1 million messages/s): above 2 million messages/s, of which half is compression.
"""

import functools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, RecordedEntry, Recording, silent
from silo.core.structs import alike
from silo.errors import SaveError
from silo.files.atomic import atomic_file, atomic_folder
from silo.files.bags.events import LOG_TYPE, EventGroup, events_topic
from silo.files.bags.message_groups import MessageGroup, absent_of, group_samples
from silo.files.bags.metadata import (
    FACTS_ATTACHMENT,
    FACTS_VERSION,
    TIME_ATTACHMENT,
    PlacedElement,
    PlacedEntry,
    RecordingFacts,
    pack_facts,
    pack_times,
)
from silo.files.bags.ros_types import Channel, MessageType, channels_of, is_text
from silo.files.mcap.writer import McapWriter
from silo.files.silo.format import FilledEntry, markers_of
from silo.files.silo.missing import filled
from silo.files.texts import presentable

MAX_CHANNELS = 65535
# builtin_interfaces/Time counts seconds in an int32
MAX_STAMP_NS = 2**31 * 10**9
WINDOW_BYTES = 8 << 20
CHUNK_BYTES = 2 << 20


def write_bag(recording: Recording, path: str | os.PathLike[str], progress: Progress = silent) -> None:
    """Write a bag: a plain MCAP file if `path` ends in `.mcap`, else a rosbag2 folder.

    Every element is one topic (message types: `silo.files.bags.ros_types`); log time, publish time and header stamp are
    the tick's stamp. What happened is one more topic (`silo.files.bags.events`). `progress` gets the fraction done, 0
    to 1, per time window. Peak memory is about twice `WINDOW_BYTES` beyond the recording. Raises `SaveError` when
    stamps, types or the number of elements don't fit ROS, and when the file can't be written; then nothing stands under
    the final name. An existing folder is an error, a file is replaced.
    """
    recording = _utf8(presentable(recording))
    recording = replace(recording, elements=[filled(element) for element in recording.elements])
    final = Path(path)
    _check_times(recording)
    channels = channels_of(recording.elements)
    if len(channels) > MAX_CHANNELS:
        raise SaveError(
            f"{len(channels)} topics are too many for a bag, MCAP numbers at most {MAX_CHANNELS}: save fewer"
        )
    if final.suffix == ".mcap":
        with atomic_file(final) as file:
            _write_mcap(file, recording, channels, f"{final.name}", progress)
        return
    with atomic_folder(final) as folder:
        name = f"{final.name}_0.mcap"
        with (folder / name).open("xb", buffering=0) as file:
            metadata = _write_mcap(file, recording, channels, name, progress)
        body = "".join(f"  {line}\n" for line in metadata.splitlines())
        with (folder / "metadata.yaml").open("x", encoding="utf-8") as facts:
            facts.write(f"rosbag2_bagfile_information:\n{body}")


def _utf8(recording: Recording) -> Recording:
    """The recording with texts of 4 bytes per letter as UTF-8, which messages can hold; mostly it is the same object.

    What can't be UTF-8 stays, and travels as its bytes.
    """
    if not any(entry.values.dtype.kind == "U" for element in recording.elements for entry in element.entries):
        return recording
    elements = [replace(element, entries=tuple(map(utf8_entry, element.entries))) for element in recording.elements]
    return replace(recording, elements=elements)


def utf8_entry(entry: RecordedEntry) -> RecordedEntry:
    """The entry with its text as UTF-8, if it is one of 4 bytes per letter."""
    if entry.values.dtype.kind != "U":
        return entry
    try:
        texts = np.char.encode(entry.values, "utf-8")
    except ValueError:
        # letters that Unicode doesn't have
        return entry
    return Utf8Entry(entry.name, entry.entry, texts, entry.values.dtype.str) if is_text(texts) else entry


@dataclass(frozen=True)
class Utf8Entry(RecordedEntry):
    """An entry whose values were of type `logged`, a text of 4 bytes per letter."""

    logged: str


def _check_times(recording: Recording) -> None:
    times = recording.time_ns
    if len(times) and (times.min() < 0 or times.max() >= MAX_STAMP_NS):
        wrong = int(times.min()) if times.min() < 0 else int(times.max())
        raise SaveError(
            f"time stamp {wrong} ns can't be stored in a bag: ROS stamps go from 0 to {MAX_STAMP_NS - 1} ns (2038); "
            "save as .silo or .csv instead"
        )
    for element in recording.elements:
        last = element.first + (element.count - 1) * element.divider
        if element.count and (element.first < 0 or last >= len(times)):
            raise SaveError(
                f"{element.name}: its samples belong to time stamps {element.first} to {last}, "
                f"but the recording has only 0 to {len(times) - 1}"
            )


def _write_mcap(
    file: BinaryIO, recording: Recording, channels: Sequence[Channel], name: str, progress: Progress
) -> str:
    """Write the whole file; return rosbag2's metadata as YAML."""
    groups: list[MessageGroup | EventGroup] = [*group_samples(recording.elements, dict(enumerate(channels, start=1)))]
    counts = {
        number: element.count - len(absent_of(element, channel))
        for number, channel in enumerate(channels, start=1)
        for element in [recording.elements[channel.element]]
    }
    topics = [(channel.topic, channel.type) for channel in channels]
    if len(events := EventGroup(recording, len(channels) + 1)):
        groups.append(events)
        counts[len(channels) + 1] = len(events)
        topics.append((events_topic(recording, channels), LOG_TYPE))
    schemas, records = definitions(recording, channels, events=bool(len(events)))
    first, last = _span(recording, groups)
    metadata = metadata_yaml(recording, topics, counts, name, (first, last))

    mcap = McapWriter(file, schemas, records)
    frequency = "" if recording.frequency_hz is None else f"{recording.frequency_hz:g}"
    mcap.add_metadata(
        "silo",
        {
            "version": str(FACTS_VERSION),
            "logger": recording.logger,
            "frequency_hz": frequency,
            "elements": str(len(recording.elements)),
            "ticks": str(len(recording.time_ns)),
            **{f"about {key}": text for key, text in recording.told_about.items()},
        },
    )
    mcap.attach(FACTS_ATTACHMENT, "application/zstd", pack_facts(recording_facts(recording, channels)))
    mcap.attach(TIME_ATTACHMENT, "application/zstd", pack_times(recording.time_ns))
    write_windows(mcap, recording.time_ns, groups, progress)
    mcap.add_metadata("rosbag2", {"serialized_metadata": metadata})
    mcap.finish(counts, first, last)
    return metadata


def write_windows(
    mcap: McapWriter,
    times: NDArray[np.int64],
    groups: "Sequence[MessageGroup | EventGroup]",
    progress: Progress = silent,
) -> None:
    """Write the messages of all ticks with these time stamps as chunks."""
    total = len(times)
    per_tick = sum(group.tick_bytes / group.divider for group in groups if not isinstance(group, EventGroup))
    ticks = max(1, min(total, int(WINDOW_BYTES / max(per_tick, 1))))
    for group in groups:
        group.reserve(ticks)
    buffer = np.empty(int(per_tick * ticks) + sum(group.tick_bytes for group in groups), dtype=np.uint8)
    for begin in range(0, total, ticks):
        window = times[begin : begin + ticks]
        sizes = np.zeros(len(window), dtype=np.int64)
        for group in groups:
            group.build(begin, window)
            group.add_sizes(sizes)
        ends = np.cumsum(sizes)
        cursor = ends - sizes
        for group in groups:
            group.place(cursor, buffer)
        pieces = max(1, round(ends[-1] / CHUNK_BYTES))  # all of about the same size
        cuts = np.searchsorted(ends, np.arange(1, pieces) * (ends[-1] / pieces), side="left") + 1
        bounds = [0, *(int(cut) for cut in np.unique(cuts) if cut < len(ends)), len(ends)]
        for start, stop in pairwise(bounds):
            low = int(ends[start] - sizes[start])
            high = int(ends[stop - 1])
            if low == high:
                continue
            stamps = window[start:stop][sizes[start:stop] > 0]
            shift = mcap.definitions_size - low
            blocks = [block for group in groups if (block := group.index(start, stop, shift)) is not None]
            mcap.add_chunk(buffer[low:high].data, int(stamps.min()), int(stamps.max()), blocks)
        progress((begin + len(window)) / total)


def _span(recording: Recording, groups: "Sequence[MessageGroup | EventGroup]") -> tuple[int, int]:
    """First and last log time in ns; (0, 0) without messages."""
    due = np.zeros(len(recording.time_ns), dtype=bool)
    for group in groups:
        group.due(due)
    stamps = recording.time_ns[due]
    return (int(stamps.min()), int(stamps.max())) if len(stamps) else (0, 0)


def definitions(
    recording: Recording, channels: Sequence[Channel], *, events: bool
) -> tuple[list[Schema], list[ChannelRecord]]:
    """The schema and channel records of a file; channels count from 1. `events`: what happened is one more channel."""
    schemas: dict[str, Schema] = {}
    records = []
    for number, channel in enumerate(channels, start=1):
        name = channel.type.name
        if name not in schemas:
            schemas[name] = _schema(channel.type, len(schemas) + 1)
        about = _about(recording.elements[channel.element])
        records.append(_channel_record(number, channel.topic, channel.type, schemas[name].id, about))
    if events:
        schema = schemas.setdefault(LOG_TYPE.name, _schema(LOG_TYPE, len(schemas) + 1))
        topic = events_topic(recording, channels)
        records.append(_channel_record(len(records) + 1, topic, LOG_TYPE, schema.id, {"kind": "events"}))
    return list(schemas.values()), records


def _schema(kind: MessageType, number: int) -> Schema:
    return Schema(id=number, data=kind.text.encode(), encoding="ros2msg", name=kind.name)


@functools.cache
def _type_hash(kind: MessageType) -> str:
    return kind.type_hash  # a third of a millisecond, and most topics of a log are of a few types


def _channel_record(number: int, topic: str, kind: MessageType, schema: int, about: Mapping[str, str]) -> ChannelRecord:
    # an empty list of QoS profiles means the player's default
    about = {"offered_qos_profiles": "", "topic_type_hash": _type_hash(kind), **about}
    return ChannelRecord(id=number, topic=topic, message_encoding="cdr", metadata=about, schema_id=schema)


def _about(element: RecordedElement) -> dict[str, str]:
    """What people like to see beside a topic; the whole truth is in the facts attachment."""
    about = {"element": element.name, "unit": element.unit, "kind": element.kind}
    if element.description:
        about["description"] = element.description
    labels = element.entries[0].entry.labels if len(element.entries) == 1 else None
    if labels:
        about["labels"] = ", ".join(f"{number}={label}" for number, label in sorted(labels.items()))
    return about


def recording_facts(recording: Recording, channels: Sequence[Channel]) -> RecordingFacts:
    """What a recording is beyond its messages."""
    where: dict[tuple[int, int], tuple[int, int, str, int]] = {}
    absent: dict[int, int] = {}
    for number, channel in enumerate(channels, start=1):
        absent[number] = len(absent_of(recording.elements[channel.element], channel))
        for part in channel.parts:
            where[channel.element, part.entry] = (number, part.offset, part.wire, part.count)
    elements = tuple(
        alike(
            PlacedElement,
            element,
            count=element.count,
            entries=tuple(
                PlacedEntry(
                    entry.name,
                    entry.entry,
                    entry.logged if isinstance(entry, Utf8Entry) else str(entry.values.dtype.str),
                    *where[index, i],
                    missing=entry.missing if isinstance(entry, FilledEntry) else None,
                    absent=absent[where[index, i][0]],
                )
                for i, entry in enumerate(element.entries)
            ),
        )
        for index, element in enumerate(recording.elements)
    )
    return alike(
        RecordingFacts,
        recording,
        version=FACTS_VERSION,
        elements=elements,
        channel_sizes={n: -1 if c.is_string else c.size for n, c in enumerate(channels, start=1)},
        warnings=tuple(recording.warnings),
    )


def metadata_yaml(
    recording: Recording,
    topics: Sequence[tuple[str, MessageType]],
    counts: Mapping[int, int],
    name: str,
    span: tuple[int, int],
) -> str:
    """rosbag2's description of the bag. Version 8: QoS profiles are a text, which Humble can still parse."""
    first, last = span
    start = f"starting_time:\n{{0}}  nanoseconds_since_epoch: {first}"
    when = f"{start}\n{{0}}duration:\n{{0}}  nanoseconds: {last - first}"
    total = sum(counts.values())
    lines = [
        "version: 8",
        "storage_identifier: mcap",
        when.format(""),
        f"message_count: {total}",
        "topics_with_message_count:" + ("" if topics else " []"),
    ]
    for number, (topic, kind) in enumerate(topics, start=1):
        lines += [
            "  - topic_metadata:",
            # a topic like /log/on is safe in quotes only
            f"      name: {json.dumps(topic)}",
            f"      type: {kind.name}",
            "      serialization_format: cdr",
            '      offered_qos_profiles: ""',
            f"      type_description_hash: {_type_hash(kind)}",
            f"    message_count: {counts[number]}",
        ]
    quoted = json.dumps(name)
    lines += [
        'compression_format: ""',
        'compression_mode: ""',
        "relative_file_paths:",
        f"  - {quoted}",
        "files:",
        f"  - path: {quoted}",
        "    " + when.format("    "),
        f"    message_count: {total}",
        "custom_data:",
        f"  silo_logger: {json.dumps(recording.logger)}",
        f"  silo_why: {json.dumps(recording.why)}",
        f'  silo_markers: "{markers_of(recording)}"',
        "ros_distro: silo",
    ]
    return "\n".join(lines) + "\n"
