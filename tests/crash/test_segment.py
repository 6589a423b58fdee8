"""A segment read while another process writes it at full speed, and after that process was killed."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from silo.core.runtime import list_segments
from silo.errors import SegmentError
from silo.segment.layout import TIME_RING, HeaderWord
from silo.segment.reader import SegmentReader
from tests.waiting import wait_until

WRITERS = Path(__file__).with_name("segment_writers.py")


class Writer:
    """A process that writes a segment."""

    def __init__(self, name: str, folder: Path) -> None:
        command = [sys.executable, str(WRITERS), name, str(folder)]
        home = dict(os.environ, PYTHONPATH=str(WRITERS.parents[2]))
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, env=home)
        assert self._process.stdout is not None
        self.segment = Path(self._process.stdout.readline().decode().strip())

    def kill(self) -> None:
        """As `kill -9` does."""
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()


@contextlib.contextmanager
def writing(name: str, folder: Path) -> Iterator[Writer]:
    writer = Writer(name, folder)
    try:
        yield writer
    finally:
        writer.kill()


def wait_for_ticks(reader: SegmentReader, ticks: int) -> None:
    wait_until(lambda: reader.ticks >= ticks)


def test_no_row_is_torn_while_a_writer_wraps_its_rings_at_full_speed(tmp_path):
    with writing("correlated", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 1000)
        since = dict.fromkeys(range(len(reader.schema.rings)), 0)
        seen = dict.fromkeys(since, 0)
        while min(seen.values()) < 30_000:
            for ring in reader.schema.rings:
                rows = reader.rows(ring.ring, since[ring.ring])
                number = rows.first + np.arange(len(rows))
                assert np.array_equal(rows.ticks, number * ring.divider)
                assert np.array_equal(rows.time_ns, rows.ticks * 7)
                for element in reader.schema.elements:
                    for entry in element.entries if element.ring == ring.ring else ():
                        factor = 1
                        if element.info.name.startswith("/log/s") and element.info.name != "/log/slow":
                            factor = (int(element.info.name.removeprefix("/log/s")) + 1) * 1_000_003
                        if len(element.entries) < 100 or entry.offset % 1000 < 8:
                            assert np.array_equal(rows.column(entry), rows.ticks * factor)
                since[ring.ring] = rows.first + len(rows)
                seen[ring.ring] += len(rows)


def test_every_byte_of_a_wide_row_belongs_to_one_tick(tmp_path):
    with writing("correlated", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 1000)
        (wide,) = [element for element in reader.schema.elements if element.info.name == "/log/wide"]
        begin, end = wide.entries[0].offset // 8, wide.entries[-1].offset // 8 + 1
        since, checked = 0, 0
        while checked < 20_000:
            rows = reader.rows(wide.ring, since)
            words = rows.words[:, begin:end].view(np.int64)
            assert (words == rows.ticks[:, None]).all()
            since = rows.first + len(rows)
            checked += len(rows)


def test_a_snapshot_taken_during_collection_is_cut_at_one_tick(tmp_path):
    with writing("honest", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 2000)
        for _ in range(100):
            recording = reader.snapshot()
            assert recording.time_ns[-1] == (recording.offset - 1) * 7
            for element in recording.elements:
                newest = (recording.offset - 1) // element.divider * element.divider
                times = recording.time_ns[element.stamp_indices]
                assert times[-1] == newest * 7
                if element.name in ("/log/wide", "/log/slow"):
                    assert np.array_equal(element.entries[0].values * 7, times)


def test_a_snapshot_taken_during_collection_lacks_no_sample(tmp_path):
    with writing("honest", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 2000)
        recording = reader.snapshot()
        counts = {element.name: element.count for element in recording.elements}
        assert (counts["/log/s0"], counts["/log/wide"], counts["/log/slow"]) == (300, 400, 100)
        assert recording.warnings == ()


def test_a_snapshot_that_was_overtaken_by_its_writer_says_so(tmp_path, monkeypatch):
    with writing("correlated", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 2000)
        rows = reader.rows

        def slow_rows(ring, since):
            wait_for_ticks(reader, reader.ticks + 300)
            return rows(ring, since)

        monkeypatch.setattr(reader, "rows", slow_rows)
        recording = reader.snapshot()
        assert "were overwritten while the snapshot was taken" in recording.warnings[0]
        assert "/log/live" not in [element.name for element in recording.elements], "it is only published"
        for element in recording.elements:
            assert element.first >= 0


def test_a_growing_buffer_is_read_whole_while_chunks_are_appended(tmp_path):
    with writing("growing", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 1000)
        for _ in range(5):
            (element,) = reader.snapshot().elements
            assert np.array_equal(element.entries[0].values, np.arange(element.count))
            assert np.array_equal(element.entries[-1].values, np.arange(element.count))
            wait_for_ticks(reader, element.count + 500)


@pytest.mark.parametrize("name", ["correlated", "growing", "counted"])
def test_after_kill_9_every_committed_row_is_there(tmp_path, name):
    with writing(name, tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 3000)
        seen = reader.ticks
        writer.kill()
        after = SegmentReader(writer.segment)
        assert after.ticks >= seen
        stamps = after.rows(TIME_RING, 0)
        assert stamps.ticks[-1] == after.ticks - 1
        for ring in after.schema.rings[1:]:
            rows = after.rows(ring.ring, 0)
            assert rows.ticks[-1] >= (after.ticks - 1) // ring.divider * ring.divider


def test_after_kill_9_no_tick_is_missing_whose_collect_had_returned(tmp_path):
    with writing("counted", tmp_path) as writer:
        wait_for_ticks(SegmentReader(writer.segment), 2000)
        writer.kill()
        said = int(np.fromfile(tmp_path / "said", np.int64)[0])
        recording = SegmentReader(writer.segment).snapshot()
        assert recording.offset in (said, said + 1)
        assert np.array_equal(recording.elements[0].entries[2].values, np.arange(recording.offset))


def test_a_killed_writer_is_told_from_a_living_one(tmp_path):
    with writing("counted", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        assert reader.alive()
        writer.kill()
        assert not reader.alive()
        assert reader.running  # as it said last
        assert list_segments() == [writer.segment]


def test_a_deleted_segment_can_still_be_read_by_who_has_it_open(tmp_path):
    with writing("growing", tmp_path) as writer:
        reader = SegmentReader(writer.segment)
        wait_for_ticks(reader, 500)
        writer.segment.unlink()
        ticks = reader.ticks
        wait_for_ticks(reader, ticks + 1000)
        assert reader.snapshot().elements[0].count > ticks


# --------------------------------------------------------------------------------------------------- damaged files


@pytest.fixture
def dead_segment(tmp_path):
    with writing("growing", tmp_path) as writer:
        wait_for_ticks(SegmentReader(writer.segment), 2000)
    return writer.segment


def test_a_missing_segment_is_a_segment_error(tmp_path):
    with pytest.raises(SegmentError, match=r"gone\.segment: can't open the segment"):
        SegmentReader(tmp_path / "gone.segment")


@pytest.mark.parametrize("content", [b"", b"x" * 100, b"x" * 20_000])
def test_a_file_that_is_no_segment_is_refused(tmp_path, content):
    path = tmp_path / "other.segment"
    path.write_bytes(content)
    with pytest.raises(SegmentError, match="segment"):
        SegmentReader(path)


@pytest.mark.parametrize("size", [5000, 9000, 20_000])
def test_a_segment_that_was_cut_short_is_refused(dead_segment, size):
    with dead_segment.open("r+b") as file:
        file.truncate(size)
    with pytest.raises(SegmentError, match=r"damaged|cut short|too few"):
        SegmentReader(dead_segment)


def test_a_segment_of_another_layout_is_refused_with_both_versions(dead_segment):
    with dead_segment.open("r+b") as file:
        file.seek(8 * HeaderWord.VERSION)
        file.write((99).to_bytes(8, "little"))
    with pytest.raises(SegmentError, match=r"newer silo \(layout 99, this silo reads 1 to 2\)"):
        SegmentReader(dead_segment)


def test_missing_chunks_of_a_segment_are_named(dead_segment):
    reader = SegmentReader(dead_segment)
    with dead_segment.open("r+b") as file:
        file.truncate(dead_segment.stat().st_size - (3 << 20))
    with pytest.raises(SegmentError, match="cut short, chunk"):
        SegmentReader(dead_segment).snapshot()
    reader.close()
