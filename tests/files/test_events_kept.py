"""What happened, in files: every format that silo reads keeps it, and other people's readers show it."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from silo.core.elements import LoggedEvent
from silo.core.recording import stamped, with_events
from silo.files.bags.ros_types import MessageType
from silo.files.bags.writer import write_bag
from silo.files.formats import FORMATS, read_recording, writer_for

READ = [one for one in FORMATS if one.reader and one.writer]
TEXTS = st.one_of(
    st.text(max_size=12), st.sampled_from(["# Binary Data\n", "\n# silo event {}", "a\0b", "\ud800", 'x"y'])
)
START = 1_700_000_000_000_000_000


def events():
    made = st.builds(
        LoggedEvent,
        kind=st.sampled_from(["marker", "started", "of a newer silo"]),
        text=TEXTS,
        time_ns=st.integers(0, 2**62),
        tick=st.integers(-1, 20),
        stamp_ns=st.integers(0, 2**62),
        who=TEXTS,
        run=st.sampled_from(["", "a1b2"]),
        number=st.integers(0, 2**40),
    )
    return st.lists(made, max_size=5).map(tuple)


@pytest.fixture
def walk(recorded, plan):
    recording = recorded([plan("/log/x", size=30), plan("/log/slow", divider=7, size=9)], 30, start_ns=START)
    told = (
        LoggedEvent("started", "started", START, 0, who="robot"),
        LoggedEvent("marker", "push 3", START + 5, 12, who="me@desk"),
        LoggedEvent("marker", "ünd", START + 6, 12, who="me@desk"),
        LoggedEvent("lost", "3 rows", START + 7, 29),
        LoggedEvent("stopped", "asked", START + 8, 31),
    )
    return replace(recording, events=stamped(told, recording.time_ns, recording.offset))


@pytest.mark.parametrize("one", READ, ids=lambda one: one.name)
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(told=events(), ticks=st.integers(0, 9), elements=st.booleans())
def test_every_format_that_is_read_keeps_all_of_it(one, told, ticks, elements, recorded, plan):
    log = replace(recorded([plan("/log/x")] if elements and ticks else [], ticks, start_ns=START), events=told)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x{one.ending}"
        writer_for(path)(log, path, None)
        again = read_recording(path)
    plain = [text.encode("utf-8", "backslashreplace").decode() for event in told for text in (event.text, event.who)]
    assert [text for event in again.events for text in (event.text, event.who)] == plain
    blank = [msgspec.structs.replace(event, text="", who="") for event in told]
    assert [msgspec.structs.replace(event, text="", who="") for event in again.events] == blank


def test_a_silo_file_has_a_comment_line_for_each(walk, tmp_path):
    path = tmp_path / "walk.silo"
    writer_for(path)(walk, path, None)
    head = path.read_bytes().split(b"# Binary Data\n")[0]
    assert [json.loads(line[13:])["text"] for line in head.split(b"\n") if line.startswith(b"# silo event ")] == [
        event.text for event in walk.events
    ]


def test_a_damaged_line_costs_that_event_alone(walk, tmp_path):
    path = tmp_path / "walk.silo"
    writer_for(path)(walk, path, None)
    path.write_bytes(path.read_bytes().replace(b'"push 3"', b'"push 3 '))
    again = read_recording(path)
    assert [event.text for event in again.events] == ["started", "ünd", "3 rows", "asked"]
    assert any("comment with facts" in warning for warning in again.warnings)


MESSAGES = [
    (0, 20, "robot", "started: started", "started", 0),
    (12, 20, "me@desk", "marker: push 3", "marker", 12),
    (12, 20, "me@desk", "marker: ünd", "marker", 12),
    (29, 30, "robot", "lost: 3 rows", "lost", 29),
    (29, 20, "robot", "stopped: asked", "stopped", 31),
]


def test_bags_have_them_as_log_messages_for_mcap(walk, tmp_path):
    write_bag(replace(walk, logger="robot"), tmp_path / "walk.mcap")
    with (tmp_path / "walk.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = list(reader.iter_decoded_messages(topics=["/log/events"]))
        counts = reader.get_summary().statistics.message_count
    assert {schema.name for schema, *_ in found} == {"rcl_interfaces/msg/Log"}
    assert counts == 5 + sum(element.count for element in walk.elements)
    told = [
        (int(np.searchsorted(walk.time_ns, message.log_time)), m.level, m.name, m.msg, m.function, m.line)
        for _, _, message, m in found
    ]
    assert told == MESSAGES
    assert all(m.stamp.sec * 10**9 + m.stamp.nanosec == message.log_time for _, _, message, m in found)


def test_the_types_of_the_messages_are_those_of_ros():
    from rosbags.typesys import Stores, get_typestore

    from silo.bridges.ros2.standard import JOINT_STATE, STRING_TYPE
    from silo.files.bags.events import LOG_TYPE

    store = get_typestore(Stores.ROS2_HUMBLE)
    layout = ("std_msgs/MultiArrayLayout", "layout")
    arrays = [MessageType("std_msgs/msg/Float64MultiArray", (layout, ("float64[]", "data")))]
    for one in (LOG_TYPE, STRING_TYPE, JOINT_STATE, *arrays):
        assert store.hash_rihs01(one.name) == one.type_hash


def test_an_element_called_events_keeps_its_topic(recorded, plan, tmp_path):
    log = recorded([plan("/log/events")], 5, start_ns=START)
    write_bag(replace(log, events=(LoggedEvent("marker", "x", START, 2),)), tmp_path / "x.mcap")
    with (tmp_path / "x.mcap").open("rb") as file:
        topics = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    assert topics == {"/log/events", "/log/events_2"}


def test_many_events_at_one_tick_and_small_chunks_are_read_in_order(recorded, plan, tmp_path, monkeypatch):
    monkeypatch.setattr("silo.files.bags.writer.CHUNK_BYTES", 500)
    monkeypatch.setattr("silo.files.bags.writer.WINDOW_BYTES", 2000)
    log = recorded([plan("/log/x", size=200)], 200, start_ns=START)
    told = tuple(LoggedEvent("marker", f"{number}" * 9, START, number // 3 * 5) for number in range(90))
    write_bag(replace(log, events=told), tmp_path / "x.mcap")
    with (tmp_path / "x.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        texts = [m.msg for *_, m in reader.iter_decoded_messages(topics=["/log/events"])]
    assert texts == [f"marker: {event.text}" for event in told]


def test_parquet_has_a_column_and_all_of_it_in_the_metadata(walk, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "walk.parquet"
    writer_for(path)(walk, path, None)
    table = parquet.read_table(path)
    column = table["events"].to_pylist()
    assert column[12] == "marker: push 3\nmarker: ünd"
    assert [row for row, cell in enumerate(column) if cell] == [0, 12, 29]
    assert msgspec.json.decode(table.schema.metadata[b"events"], type=tuple[LoggedEvent, ...]) == walk.events


def test_without_events_a_parquet_file_has_no_such_column(recorded, plan, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "walk.parquet"
    writer_for(path)(recorded([plan("/log/x")], 5, start_ns=START), path, None)
    assert "events" not in parquet.read_table(path).column_names


def test_events_of_the_log_join_the_marks_once_and_in_order(walk):
    again = with_events(walk, [*walk.events, LoggedEvent("saved", "x", START + 1, 3)])
    assert [event.text for event in again.events] == ["started", "x", "push 3", "ünd", "3 rows", "asked"]
    assert again.events[1].stamp_ns == walk.time_ns[3]
