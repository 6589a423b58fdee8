"""What a silo of before left behind is read, every value: a robot that was logged for 50 ticks by version 0.2.0."""

import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest

from silo.conditions.state_file import read_state
from silo.core.recording import Recording
from silo.files.event_log import event_log_path, read_events
from silo.files.formats import read_recording
from silo.files.manifest import captures_path, read_captures, read_written, written_path
from silo.journal.reader import JournalReader
from silo.segment.reader import SegmentReader
from tests.golden.__main__ import FOLDER

READ = FOLDER / "read"
TICK = np.arange(50)
VALUES = {
    "/log/joints/q": np.stack([TICK, TICK / 2, -TICK], axis=1).astype(float),
    "/log/n": np.arange(0, 10, 2)[:, None],
    "/log/g": np.array([[k * 0.1, k * 0.2] for k in range(50)], np.float32),
    "/log/mode": np.array([b"SWING" if k % 2 else b"STANCE" for k in range(50)])[:, None],
}
MARK = ("push", 20)


def same(recording: Recording, names: set[str]) -> None:
    """The values, units and stamps that were logged, and the mark that was set."""
    found = {one.name: np.stack([entry.values for entry in one.entries], axis=1) for one in recording.elements}
    assert found.keys() == names
    for name in names:
        assert found[name].tolist() == VALUES[name].tolist(), name
    units = {one.name: one.unit for one in recording.elements}
    assert {units[name] for name in names & {"/log/joints/q"}} <= {"rad"}
    assert set(np.diff(recording.time_ns)) == {10_000_000}
    assert recording.logger == "robot"


@pytest.fixture
def segment(tmp_path: Path) -> Path:
    path = tmp_path / "robot.1.0.segment"
    path.write_bytes(gzip.decompress((READ / "layout_2.segment.gz").read_bytes()))
    return path


def test_a_segment_is_read(segment) -> None:
    recording = SegmentReader(segment).snapshot()
    same(recording, set(VALUES))
    assert [one.name for one in recording.conditions.triggers] == ["high"]


def test_a_journal_is_read(tmp_path) -> None:
    shutil.copytree(READ / "journal", tmp_path / "journal")
    same(JournalReader(tmp_path / "journal").snapshot(), set(VALUES))


def test_a_bag_is_read_with_its_events() -> None:
    recording = read_recording(READ / "run.mcap")
    same(recording, set(VALUES))
    assert MARK in [(event.text, event.tick) for event in recording.events]


def test_a_silo_file_without_checksums_of_its_values_is_read_as_one_that_has_them() -> None:
    before, now = read_recording(READ / "run.silo", check=True), read_recording(FOLDER / "run.silo", check=True)
    assert before.warnings == now.warnings
    assert before.time_ns.tolist() == now.time_ns.tolist()
    for one, other in zip(before.elements, now.elements, strict=True):
        assert (one.name, one.unit, one.first, one.divider) == (other.name, other.unit, other.first, other.divider)
        values = [[entry.values.tobytes() for entry in each.entries] for each in (one, other)]
        assert values[0] == values[1]


def test_a_part_of_an_endless_recording_is_read_with_its_events() -> None:
    recording = read_recording(READ / "part.mcap")
    same(recording, {"/log/joints/q"})
    assert MARK in [(event.text, event.tick) for event in recording.events]


def test_a_log_of_events_is_read(tmp_path) -> None:
    shutil.copy(READ / "events.jsonl", event_log_path(tmp_path, "robot"))
    events = read_events(tmp_path, "robot")
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert MARK in [(event.text, event.tick) for event in events]


def test_the_state_of_a_judge_is_read() -> None:
    state = read_state(READ / "robot.judge")
    assert (state.until, [one.options.name for one in state.triggers]) == (50, ["high"])


def test_a_list_of_captures_is_read(tmp_path) -> None:
    shutil.copy(READ / "captures.jsonl", captures_path(tmp_path, "robot"))
    found = {
        (one.trigger, one.number): [file.name[-5:] for file in one.files] for one in read_captures(tmp_path, "robot")
    }
    assert found == {("high", 1): [".silo", "1.csv"], ("high", 2): [".silo", "2.csv"], ("low", 1): []}


@pytest.mark.parametrize("name", ["recorder.json", "recorder_without_runs.json"])
def test_a_list_of_parts_is_read(tmp_path, name) -> None:
    shutil.copy(READ / name, written_path(tmp_path, "robot"))
    written = read_written(tmp_path, "robot")
    assert (written.run, written.next_rows, written.parts[0].size_bytes) == ("run1", {0: 50, 1: 25}, 100)
    runs = [(one.run, one.lost(), one.done) for one in written.runs]
    assert runs == ([("run1", 15, True), ("run2", 0, False)] if "without" not in name else [])


@pytest.mark.parametrize("name", ["run.silo", "run.csv"])
def test_what_was_written_in_all_formats_is_read(name) -> None:
    recording = read_recording(FOLDER / name)
    assert [one.name for one in recording.elements][:4] == ["/log/q", "/log/tau", "/log/count", "/log/flags"]
    (count,) = next(one for one in recording.elements if one.name == "/log/count").entries
    assert count.values.tolist() == [2**60 + k for k in range(4)]
