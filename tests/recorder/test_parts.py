"""Parts of recordings, without a process: where they begin and end, what is deleted, lost, or left by a kill."""

import contextlib
import fcntl
import itertools
import os
import re
import shutil
import struct
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader

import silo
from silo.cli.main import run
from silo.core.elements import RecorderState
from silo.core.quantities.reading import read_keep, read_split
from silo.core.quantities.writing import size_text
from silo.errors import ElementError, FileFormatError, SaveError
from silo.files.atomic import left_free, write_all
from silo.files.bags.index import BagElements
from silo.files.bags.writer import write_bag
from silo.files.manifest import Ledger, read_written, size_of_parts
from silo.files.mcap.index import indexed_records
from silo.files.parts.scan import rows_after, scan_part
from silo.recorder.event_tail import EventTail
from silo.recorder.layout import layout_of
from silo.recorder.orders import RecordOrder
from silo.recorder.requests import StartRecorder
from silo.recorder.ring_cursor import RingCursor
from silo.recorder.server import _wrong_numbers
from silo.recorder.writing import MOST_INDEX_BYTES, QUEUE_BYTES, RecorderDisk, why_full
from silo.recovery.parts import close_part, close_parts, finished_part, left_parts, left_rows
from silo.segment.reader import SegmentReader
from tests.recorder.conftest import BEGIN_NS, STEP_NS
from tests.whole_bags import read_bag


def order(folder: Path, **options: object) -> RecordOrder:
    return RecordOrder("bot", str(folder / "rec"), **options)


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "rec").glob("bot_*.mcap"), key=lambda path: path.name.rpartition("_")[2])


def test_who_closes_what_killed_recorders_left_never_takes_a_part_that_begins_just_then(
    robot, tmp_path, truth, monkeypatch
) -> None:
    """It is empty, and for a moment not locked: another recorder of the folder, or `silo recover`, may come there."""
    lock, came = fcntl.flock, []

    def late(file: int, operation: int) -> None:
        if operation == fcntl.LOCK_EX and not came and list((tmp_path / "rec").glob("*.mcap.part")):
            came.append(close_parts(tmp_path / "rec"))
        lock(file, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    direct = truth.direct(robot, order(tmp_path))
    direct.ticks(500)
    assert direct.finish().lost == 0
    (path,) = parts(tmp_path)
    assert truth.span(read_bag(path)) == (0, 500)
    assert len(came) == 1


def test_parts_follow_one_another_without_a_gap_and_the_budget_deletes_only_its_own(robot, tmp_path, truth) -> None:
    direct = truth.direct(robot, order(tmp_path, keep_bytes=120_000))
    foreign = [tmp_path / "rec" / "other_20200101_10-00-00_00001.mcap", tmp_path / "rec" / "notes.txt"]
    for path in foreign:
        path.write_bytes(b"x" * 100_000)
    seen: dict[str, tuple[int, int]] = {}
    for ticks in np.random.default_rng(1).integers(100, 700, 24).tolist():
        direct.ticks(ticks)
        for path in parts(tmp_path):
            if path.name not in seen:
                seen[path.name] = truth.span(read_bag(path))
    assert direct.finish().lost == 0
    spans = sorted(seen.values())
    assert spans[0][0] == 0
    assert all(before[1] == after[0] for before, after in itertools.pairwise(spans))
    assert all(path.read_bytes() == b"x" * 100_000 for path in foreign)
    assert sum(path.stat().st_size for path in parts(tmp_path)) <= 120_000
    assert 0 < len(parts(tmp_path)) < len(seen)


def test_parts_of_an_earlier_recording_of_that_name_go_first_and_it_tells_so(direct, robot, tmp_path, truth) -> None:
    direct.ticks(1500)
    direct.finish()
    (kept,) = parts(tmp_path)
    budget = kept.stat().st_size + 60_000
    assert size_of_parts(tmp_path / "rec", "bot") == budget - 60_000
    again = truth.direct(robot, order(tmp_path, keep_bytes=budget))
    again.ledger.begin_order("another")
    for _ in range(12):
        again.ticks(400)
    told = [report.told for report in again.told() if report.told]
    assert not kept.exists()
    assert told == [f"deleted {kept.name} of an earlier recording 'bot', to keep {size_text(budget)}"]
    again.finish()


def test_a_file_that_was_put_in_the_place_of_a_part_is_not_deleted(robot, tmp_path, truth) -> None:
    direct = truth.direct(robot, order(tmp_path, keep_bytes=60_000))
    while not parts(tmp_path):
        direct.ticks(200)
    first = parts(tmp_path)[0]
    first.rename(tmp_path / "kept.mcap")
    first.write_text("mine")
    for _ in range(12):
        direct.ticks(500)
    assert direct.finish().parts > 4
    assert first.read_text() == "mine"
    assert (tmp_path / "kept.mcap").exists()
    assert first.name not in {part.name for part in direct.ledger.written.parts}


def test_a_recording_stops_with_words_before_the_disk_is_full(robot, tmp_path, truth) -> None:
    robot.start()
    free = [10_000_000]
    direct = truth.direct(robot, order(tmp_path), RecorderDisk(room=lambda _: (free[0], 100_000_000)))
    direct.ticks(300)
    free[0] = 2_050_000
    direct.ticks(300)
    totals = direct.finish()
    assert totals.state is RecorderState.FAILED
    assert re.sub(r"others: \S+ kB more", "others: 60 kB more", totals.text) == (
        f"the disk of {parts(tmp_path)[0].parent} is nearly full: 2.05 MB are free, and 2 MB of it are left to others: "
        "60 kB more are too much; the recording ended there, and all its parts are finished; make room, or keep less "
        "(--keep), and start it "
        "again"
    )
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 300)
    assert "0 lost, and the end of a run" in direct.ledger.written.sums().text  # what was collected after that


def test_two_percent_of_a_small_disk_and_a_gigabyte_of_a_large_one_are_left_free() -> None:
    assert left_free(10 * 10**9) == 200 * 10**6
    assert left_free(10**13) == 10**9


def test_a_disk_that_refuses_ends_the_recording_and_leaves_what_was_written(robot, tmp_path, truth) -> None:
    robot.start()
    full = [False]

    def write(descriptor: int, buffers: list[memoryview], offset: int) -> None:
        if full[0]:
            full[0] = False
            write_all(descriptor, [buffers[0], buffers[1][:100]], offset)
            raise OSError(28, "No space left on device")
        write_all(descriptor, buffers, offset)

    direct = truth.direct(robot, order(tmp_path), RecorderDisk(write=write))
    direct.ticks(300)
    full[0] = True
    direct.ticks(100)
    totals = direct.finish()
    assert totals.state is RecorderState.FAILED
    assert "No space left on device" in totals.text
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 300)
    truth.by_others(parts(tmp_path)[0])


def metadata(path: Path, name: str) -> list[dict[str, str]]:
    with path.open("rb") as file:
        return [record.metadata for record in make_reader(file).iter_metadata() if record.name == name]


def test_what_a_slow_disk_costs_is_counted_at_its_place(robot, tmp_path, truth, monkeypatch) -> None:
    monkeypatch.setattr("silo.recorder.writing.QUEUE_BYTES", 50_000)
    robot.start()
    gate = threading.Event()
    gate.set()

    def write(descriptor: int, buffers: list[memoryview], offset: int) -> None:
        gate.wait()
        write_all(descriptor, buffers, offset)

    direct = truth.direct(robot, order(tmp_path), RecorderDisk(write=write))
    direct.ticks(500)
    gate.clear()
    robot.ticks(500)  # these wait in the queue
    direct.put()
    while direct.writing.room_bytes:
        robot.ticks(200)
        direct.put()
    full_at = direct.drain.cursors[max(direct.drain.layout.rings)]
    robot.ticks(7000)  # the rings, of 2000 and some rows, are overwritten
    assert not direct.put()  # there is no room for them
    gate.set()
    direct.step()
    direct.step()
    direct.ticks(100)
    totals = direct.finish()
    (path,) = parts(tmp_path)
    found = read_bag(path)
    assert truth.span(found) == (0, robot.tick)
    x = next(element for element in found.elements if element.name == "/log/x")
    ((low, high),) = x.failures.spans
    lost = {(record["first_tick"], record["last_tick"]) for record in metadata(path, "silo/lost")}
    assert (str(low), str(high)) in lost
    assert low <= full_at * 5
    assert totals.lost == sum(element.lost for element in found.elements) > 0
    told = next(one for one in direct.told() if "samples were lost, of ticks" in one.told)
    assert re.fullmatch(
        rf"[0-9]+ samples were lost, of ticks {low} to [0-9]+: the disk took the rows too slowly, and the ring was "
        "overwritten before they were read; record fewer elements, make buffers larger, or record to another disk",
        told.told,
    )
    assert (told.told_run, told.told_tick) == (robot.log._present.run.id, low)
    assert metadata(path, "silo/totals")[0]["lost"] == str(totals.lost)
    assert "could not keep up" in found.warnings[0]
    truth.by_others(path)


def test_a_slow_disk_costs_nothing_while_queue_and_rings_have_room(robot, tmp_path, truth) -> None:
    robot.start()
    gate = threading.Event()

    def write(descriptor: int, buffers: list[memoryview], offset: int) -> None:
        gate.wait()
        write_all(descriptor, buffers, offset)

    direct = truth.direct(robot, order(tmp_path), RecorderDisk(write=write))
    for _ in range(10):
        robot.ticks(1500)
        direct.put()
    assert QUEUE_BYTES > direct.writing.room_bytes > 0
    gate.set()
    assert direct.finish().lost == 0
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, robot.tick)


def test_text_that_is_none_goes_on_as_bytes_in_a_new_part(robot, tmp_path, truth) -> None:
    direct = truth.direct(robot, order(tmp_path, patterns=("word",)))
    direct.ticks(50)
    for _ in range(20):
        robot.word[...] = b"\xff\x00\x01"
        robot.log.collect()
        robot.tick += 1
    direct.step()
    direct.finish()
    one, two = map(read_bag, parts(tmp_path))
    assert one.elements[0].entries[0].values.tolist() == [b"w%d" % k for k in range(50)]
    assert two.elements[0].entries[0].values.tolist() == [b"\xff\x00\x01"] * 20
    truth.by_others(parts(tmp_path)[1])


def test_only_elements_of_a_divider_have_time_stamps_of_all_ticks(robot, tmp_path, truth) -> None:
    direct = truth.direct(robot, order(tmp_path, patterns=("slow",)))
    direct.ticks(103)
    direct.finish()
    found = read_bag(parts(tmp_path)[0])
    truth.span(found)
    assert found.offset == 101
    assert abs(np.diff(found.time_ns) - 1_000_003).max() <= 1
    write_bag(found, tmp_path / "again.mcap")
    truth.span(read_bag(tmp_path / "again.mcap"))


@pytest.fixture
def killed(robot, tmp_path, truth) -> Iterator[Path]:
    """A part of four chunks and a bit as a kill leaves it."""
    robot.start()
    direct = truth.direct(robot, order(tmp_path))
    for _ in range(4):
        direct.ticks(100)
    (path,) = (tmp_path / "rec").glob("*.mcap.part")
    left = tmp_path / "left.mcap.part"
    left.write_bytes(path.read_bytes())
    direct.finish()
    return left


def test_a_part_cut_at_any_byte_is_closed_with_all_whole_chunks(killed, tmp_path, truth) -> None:
    whole = killed.read_bytes()
    ends = []
    for size in sorted({0, 5, 40, *np.random.default_rng(3).integers(0, len(whole), 40).tolist(), len(whole)}):
        cut = tmp_path / f"cut{size}.mcap.part"
        cut.write_bytes(whole[:size])
        closed = close_part(cut)
        assert not cut.exists()
        if closed.samples:
            found = read_bag(closed.path)
            assert found.warnings == ()
            truth.span(found)
            ends.append(found.offset)
            assert sum(truth.by_others(closed.path).values()) == closed.samples
    assert ends == sorted(ends)
    assert {100, 200, 300, 400} >= set(ends) >= {100, 200, 300}


def test_with_which_row_to_go_on_is_told_at_a_glance_as_by_reading_all(killed) -> None:
    whole = killed.read_bytes()
    told = 0
    for size in [*np.random.default_rng(4).integers(0, len(whole), 40).tolist(), len(whole)]:
        cut = memoryview(whole[:size])
        found = rows_after(cut)
        if found is not None:
            told += 1
            assert found[1] == scan_part(cut).next_rows
    assert told > 20


def test_what_a_kill_left_is_read_as_it_is(killed, truth, capsys) -> None:
    found = read_bag(killed)
    assert truth.span(found) == (0, 400)
    assert "not finished" in found.warnings[0]
    assert run(["info", str(killed)]) == 0
    assert "4 elements, 400 ticks" in capsys.readouterr().out


@pytest.mark.parametrize("closed", [True, False])
def test_of_a_part_a_signal_reads_its_own_messages_and_names_and_counts_read_none(killed, truth, monkeypatch, closed):
    path = close_part(killed).path if closed else killed
    passes = []
    real = BagElements._read
    monkeypatch.setattr(BagElements, "_read", lambda self, places: passes.append(places) or real(self, places))
    log = silo.open_log(path)
    assert [(one.name, one.count) for one in log.recording.elements] == [
        (one.name, one.count) for one in read_bag(path).elements
    ]
    assert passes == [list(range(len(log)))]  # of the one that reads all
    passes.clear()
    assert len(log.recording.time_ns) == 400
    assert len(log["x"].values) == 400
    (x,) = (place for place, one in enumerate(log.recording.elements) if one.name == "/log/x")
    assert passes == [[x]]


def test_a_part_that_is_being_written_is_not_closed_by_others(direct, tmp_path, truth) -> None:
    direct.ticks(100)
    assert left_parts(tmp_path / "rec") == []
    assert close_parts(tmp_path / "rec") == ([], [])
    direct.finish()
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 100)


@pytest.mark.parametrize("where", [0.3, 0.6, 0.9])
def test_damage_ends_a_part_or_costs_it_what_is_damaged(killed, truth, where) -> None:
    data = bytearray(killed.read_bytes())
    for place in range(int(len(data) * where), int(len(data) * where) + 20):
        data[place] ^= 0x55
    killed.write_bytes(data)
    closed, problems = close_parts(killed.parent)
    assert problems == []
    assert truth.span(read_bag(closed[0].path))[1] in (0, 100, 200, 300, 400)
    truth.by_others(closed[0].path)


def test_what_comes_behind_a_damaged_chunk_is_kept(killed, truth) -> None:
    data = bytearray(killed.read_bytes())
    chunks = [record for record in indexed_records(memoryview(bytes(data))) if record.opcode == Opcode.CHUNK]
    hurt = chunks[len(chunks) // 2]
    data[(hurt.at + hurt.end) // 2] ^= 0x55
    killed.write_bytes(data)
    found = read_bag(close_part(killed).path)
    assert truth.span(found) == (0, 400)
    assert any("chunk at byte" in text and "damaged" in text for text in found.warnings)
    assert any(element.lost for element in found.elements)


def test_zeros_behind_what_was_written_as_a_power_cut_leaves_them_are_cut_off(killed, truth) -> None:
    with killed.open("ab") as file:
        file.write(bytes(5000))
    closed = close_part(killed)
    assert truth.span(read_bag(closed.path)) == (0, 400)
    truth.by_others(closed.path)


@pytest.mark.parametrize("width", [64, 5000])
def test_zeros_within_a_part_as_a_power_cut_leaves_them_are_no_values_and_no_times(killed, width) -> None:
    whole = killed.read_bytes()
    read = 0
    for at in range(len(whole) % 97, len(whole), 97):
        killed.write_bytes(whole[:at] + bytes(len(whole[at : at + width])) + whole[at + width :])
        with contextlib.suppress(FileFormatError):
            found = read_bag(killed)
            (x,) = (one for one in found.elements if one.name == "/log/x")
            (values,) = (one.values for one in x.entries)
            ticks, there = x.stamp_indices + found.offset - len(found.time_ns), ~np.ma.getmaskarray(values)
            assert values[there].tolist() == ticks[there].tolist()
            assert (found.time_ns[x.stamp_indices] == BEGIN_NS + ticks * STEP_NS)[there].all()
            read += there.any()
    assert read > 20


def test_a_foreign_file_named_as_a_part_stays(tmp_path) -> None:
    header = b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, 8) + bytes(8)
    for name, content in (("a", b"no mcap at all, but long enough"), ("b", header)):
        (tmp_path / f"{name}.mcap.part").write_bytes(content)
    closed, problems = close_parts(tmp_path)
    assert closed == []
    assert len(problems) == 2
    assert all("it stays as it is" in text for text in problems)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("1GB", (10**9, 0.0)), ("500 mb", (5 * 10**8, 0.0)), ("10min", (0, 600.0)), ("1.5h", (0, 5400.0)),
        ("1MB", (10**6, 0.0)), ("1000TB", (10**15, 0.0)), ("1s", (0, 1.0)), ("744h", (0, 31 * 86400.0)), ("", (0, 0.0)),
    ],
)  # fmt: skip
def test_a_split_is_a_size_or_a_time(given, meant) -> None:
    assert read_split(given) == meant


@pytest.mark.parametrize("given", ["5", "-1GB", "10 apples", "999kB", "1001TB", "0s", "0.9s", "745h", 7, float("nan")])
def test_a_split_that_is_neither_is_told_of(given) -> None:
    with pytest.raises(ElementError, match="write split="):
        read_split(given)


def test_what_is_kept_is_a_size() -> None:
    assert (read_keep("50GB"), read_keep("2MB")) == (50 * 10**9, 2 * 10**6)
    for wrong in ("10min", "1.9MB", "1001TB"):
        with pytest.raises(ElementError, match="write keep="):
            read_keep(wrong)


SIZES, KEPT = (f"from {least} to 1000000000000000 bytes" for least in (10**6, 2 * 10**6))


@pytest.mark.parametrize(
    ("option", "fits", "beyond", "says"),
    [
        ("patterns", ["x"] * 1000, ["x"] * 1001, "at most 1000 patterns of 50000 letters together, got 1001"),
        ("patterns", ["x" * 25_000] * 2, ["x" * 25_000, "x" * 25_001],
         "at most 1000 patterns of 50000 letters together, got 2"),
        ("split_bytes", 10**6, 10**6 - 1, f"a part must have {SIZES}, got 999999"),
        ("split_bytes", 10**15, 10**15 + 1, f"a part must have {SIZES}, got 1000000000000001"),
        ("split_s", 1.0, 0.999, "a part must last from 1 s to 31 days, got 0.999"),
        ("split_s", 31 * 86400.0, 31 * 86400.1, "a part must last from 1 s to 31 days, got 2678403.1"),
        ("split_s", 0.0, float("nan"), "a part must last from 1 s to 31 days, got nan"),
        ("keep_bytes", 2 * 10**6, 10**6, f"keep must be {KEPT}, got 1000000"),
        ("keep_bytes", 10**15, 10**15 + 1, f"keep must be {KEPT}, got 1000000000000001"),
        ("name", "dog", "dog/cat", "'dog/cat' can't be the name of a log: it contains '/' (the folder is an option of "
         "its own); choose a name like 'first_walk'"),
    ],
)  # fmt: skip
def test_what_a_client_may_ask_of_a_recording_has_bounds(option, fits, beyond, says) -> None:
    assert not _wrong_numbers(StartRecorder(**{option: fits}))
    assert _wrong_numbers(StartRecorder(**{option: beyond})) == says


def test_a_cursor_reads_what_there_is_room_for_and_the_rest_next(robot) -> None:
    robot.start()
    robot.ticks(1000)
    reader = SegmentReader(robot.log._present.path)
    cursor, sizes, complete = RingCursor(reader, layout_of(reader.schema, ()), {}), [], False
    while not complete:
        found = cursor.read(16_000)
        sizes.append(found.size_bytes)
        complete = found.complete
    reader.close()
    assert 8_000 < max(sizes) <= 16_000
    assert set(cursor.cursors.values()) == {1000, 200}


@pytest.mark.parametrize("kind", ["looping", "growing", "fixed"])
def test_what_a_cursor_reads_or_tells_to_be_lost_is_each_row_once_at_its_tick(kind, tmp_path, truth) -> None:
    robot = truth.robot(tmp_path, size=50)
    robot.log.update()
    robot.log.set("q", buffer=kind, size=600, action="both")
    robot.start()
    reader = SegmentReader(robot.log._present.path)
    cursor, came, lost = RingCursor(reader, layout_of(reader.schema, ()), {}), {}, {}
    for count in (40, 300, 7, 1500, 1):
        robot.ticks(count)
        complete = False
        while not complete:
            found = cursor.read(2_000)
            complete = found.complete
            for loss in found.losses:
                lost.setdefault(loss.ring, []).extend(range(loss.begin, loss.end))
            for rows in found.rows:
                numbers = np.arange(rows.first, rows.first + len(rows))
                assert rows.ticks.tolist() == (numbers * rows.ring.divider).tolist()
                came.setdefault(rows.ring.ring, []).extend(numbers.tolist())
    reader.close()
    robot.log.close(discard=True)
    assert any(lost.values())
    for ring, end in cursor.cursors.items():
        assert sorted([*came[ring], *lost.get(ring, [])]) == list(range(end))
        assert came[ring] == sorted(came[ring])


def overtaken(tmp_path, truth):
    """A robot whose recorder has written 40 ticks, and what it reads next: the newest rows, and what is lost before."""
    robot = truth.robot(tmp_path, size=50)
    robot.start()
    direct = truth.direct(robot, order(tmp_path))
    direct.ticks(40)
    robot.ticks(500)
    drained = direct.drain.read(2**20)
    assert drained.losses
    return robot, direct, drained


def test_a_hole_at_the_seam_of_two_parts_is_counted_by_the_one_behind_it(tmp_path, truth) -> None:
    robot, direct, drained = overtaken(tmp_path, truth)
    writing = direct.writing
    writing.put(writing.write, replace(drained, rows=[]))  # what is missing is known, the rows behind it are to come
    writing.put(writing._finish_part, "it lasts 2 s")
    writing.put(writing.write, replace(drained, losses=[]))
    writing.put(writing._finish_part, "it lasts 2 s")
    direct.ticks(10)
    totals = direct.finish()
    robot.log.close()
    first, second, third = (read_bag(path) for path in parts(tmp_path))
    assert (first.lost, first.warnings) == (third.lost, third.warnings) == (0, ())
    assert second.lost == totals.lost == sum(one.lost for one in second.elements) > 500
    x = next(one for one in second.elements if one.name == "/log/x")
    begin = second.offset - len(second.time_ns)
    assert begin + x.first - 40 == x.lost
    assert f"{second.lost} samples were lost" in second.warnings[0]
    assert f"(ticks 40-{begin + x.first - 1}" in second.warnings[0]
    assert len(metadata(parts(tmp_path)[1], "silo/lost")) == len(drained.losses)
    (run,) = silo.runs(tmp_path)
    assert run.facts.lost == totals.lost


def test_a_hole_at_the_end_of_a_run_is_none_of_the_next_one(tmp_path, truth) -> None:
    robot, direct, drained = overtaken(tmp_path, truth)
    direct.writing.put(direct.writing.write, replace(drained, rows=[]))
    robot.start()
    reader = SegmentReader(robot.log._present.path)
    direct.drain = RingCursor(reader, layout_of(reader.schema, order(tmp_path).patterns), None)
    direct.writing.put(direct.writing.begin_run, direct.drain.layout, direct.drain.begun_with, EventTail(reader, 0))
    direct.ticks(30)
    direct.finish()
    robot.log.close()
    *_, last = (read_bag(path) for path in parts(tmp_path))
    assert (last.lost, last.warnings) == (0, ())


def test_a_part_that_was_finished_and_not_renamed_gets_its_name_alone(direct, tmp_path, truth) -> None:
    direct.ticks(103)
    direct.finish()
    (path,) = parts(tmp_path)
    whole, counts = path.read_bytes(), truth.by_others(path)
    left = path.rename(f"{path}.part")
    close_part(left)
    assert path.read_bytes() == whole
    path.rename(left).write_bytes(whole[:-3])
    close_part(left)
    assert truth.by_others(path) == counts


def test_of_two_recorders_of_one_name_in_one_folder_the_second_is_refused(direct, robot, tmp_path, truth) -> None:
    with pytest.raises(SaveError, match="another recorder writes"):
        truth.direct(robot, order(tmp_path))
    direct.finish()


@pytest.mark.parametrize(
    ("runs", "entry", "wanted"),
    [
        (["r1"], object(), ("r1", {1: 30})),
        (["r1"], None, ("", {})),  # its order is over
        ([], None, ("r1", {1: 30})),
    ],
)
def test_who_goes_on_where_no_part_is_open_begins_where_the_last_one_ended(runs, entry, wanted) -> None:
    written = SimpleNamespace(runs=runs, run="r1", entry=lambda run: entry, next_rows={1: 30})
    assert left_rows(SimpleNamespace(open_parts=list, name="bot", written=written)) == wanted


def test_who_goes_on_begins_behind_a_part_whose_end_was_never_noted(direct, robot, tmp_path) -> None:
    direct.ticks(100)
    noted = (tmp_path / "rec" / ".bot.recorder.json").read_bytes()
    direct.ticks(50)
    direct.finish()
    (tmp_path / "rec" / ".bot.recorder.json").write_bytes(noted)  # killed between the name of the part and its note
    ledger = Ledger(tmp_path / "rec", "bot", 0.0, os.getpid())
    run_id, rows = left_rows(ledger)
    ledger.settle([], finished_part)
    ledger.close()
    assert set(rows.values()) == {30, 150, 0}  # of both rings and the event log
    assert run_id == robot.log._present.run.id
    assert ledger.size_bytes == parts(tmp_path)[0].stat().st_size


def test_a_part_that_was_never_noted_counts_for_the_budget_once_it_is_closed(direct, tmp_path) -> None:
    direct.ticks(100)
    (path,) = (tmp_path / "rec").glob("*.part")
    (tmp_path / "rec" / path.name.replace("00001", "00007")).write_bytes(path.read_bytes())
    direct.finish()
    closed, _ = close_parts(tmp_path / "rec")
    ledger = Ledger(tmp_path / "rec", "bot", 0.0, os.getpid())
    ledger.settle(closed, finished_part)
    ledger.close()
    assert ledger.size_bytes == sum(path.stat().st_size for path in parts(tmp_path))
    assert len(parts(tmp_path)) == 2


def test_the_open_part_in_the_recordings_of_a_log_folder_is_recovered(killed, tmp_path, capsys) -> None:
    folder = tmp_path / "logs" / "recordings"
    folder.mkdir(parents=True)
    left = folder / killed.name
    killed.rename(left)
    assert run(["recover", "--list", str(tmp_path / "logs")]) == 0
    assert str(left) in capsys.readouterr().out
    assert run(["recover", str(tmp_path / "logs")]) == 0
    assert not left.exists()
    (closed,) = folder.glob("*.mcap")
    assert read_bag(closed).offset == 400


@pytest.mark.parametrize("bad", [range(150, 151), range(150, 280), range(150, 300)])
def test_a_clock_beyond_what_the_format_holds_ends_no_recording(tmp_path, truth, bad) -> None:
    class Leaping(truth.robot):
        def _clock(self) -> int:
            return 2**62 + self.tick if self.tick in bad else super()._clock()

    robot = Leaping(tmp_path)
    robot.start()
    recorder = truth.direct(robot, RecordOrder("bot", str(tmp_path / "rec")))
    for _ in range(3):
        recorder.ticks(100)
    totals = recorder.finish()
    robot.log.close()
    found = [read_bag(path) for path in sorted((tmp_path / "rec").glob("*.mcap"))]
    assert totals.state is not RecorderState.FAILED, totals.text
    assert totals.lost == 3 * len(bad) + sum(tick % 5 == 0 for tick in bad)
    assert totals.samples + totals.lost == 3 * 300 + 60
    assert any("before 1970 or after 2038" in text for text in [one.told for one in recorder.told()])
    for recording in found:
        truth.span(recording)
    ticks = [tick for one in found for tick in one_element(one, "/log/x")]
    assert ticks == [tick for tick in range(300) if tick not in bad]


def one_element(recording, name: str) -> list[int]:
    """The ticks that a recording has of an element."""
    element = next(element for element in recording.elements if element.name == name)
    ticks = recording.offset - len(recording.time_ns) + element.stamp_indices
    return [int(tick) for tick in ticks if not any(low <= tick <= high for low, high in element.failures.spans)]


# --------------------------------------------------------------------------------------------------- where parts end


@pytest.mark.parametrize(("limits", "up_to_date", "longest"), [
    ({"split_bytes": 1000}, True, 1000), ({"split_bytes": 1000}, False, 1500), ({"keep_bytes": 1000}, True, 500),
    ({"keep_bytes": 1000}, False, 750), ({"split_bytes": 400, "keep_bytes": 1000}, True, 400), ({}, False, None),
])  # fmt: skip
def test_a_part_ends_at_its_size_and_half_as_much_again_where_the_disk_is_behind(limits, up_to_date, longest) -> None:
    def ends(size_bytes: int) -> bool:
        part = SimpleNamespace(size_bytes=size_bytes, index_bytes=0, begun_s=0.0)
        return why_full(RecordOrder("bot", "/logs", **limits), part, 1e9, up_to_date=up_to_date) != ""

    if longest is None:
        assert not ends(2**60)
    else:
        assert [ends(size_bytes) for size_bytes in (0, longest - 1, longest, 2**60)] == [False, False, True, True]


@pytest.mark.parametrize(("up_to_date", "ends"), [(True, ["", "it lasts 60 s"]), (False, ["", ""])])
def test_a_part_of_a_time_ends_once_all_of_it_is_written(up_to_date, ends) -> None:
    part = SimpleNamespace(size_bytes=1, index_bytes=0, begun_s=100.0)
    order = RecordOrder("bot", "/logs", split_s=60.0)
    assert [why_full(order, part, now_s, up_to_date=up_to_date) for now_s in (159.9, 160.0)] == ends


def test_a_part_whose_index_is_large_ends_whatever_is_behind() -> None:
    sizes = (MOST_INDEX_BYTES - 1, MOST_INDEX_BYTES)
    parts = [SimpleNamespace(size_bytes=1, index_bytes=size, begun_s=0.0) for size in sizes]
    why = [why_full(RecordOrder("bot", "/logs"), part, 0.0, up_to_date=False) for part in parts]
    assert why == ["", "its index has 16.8 MB"]


def recorded(robot, tmp_path, truth, times: int = 4, ticks: int = 103) -> list[Path]:
    """A recording in so many parts at least, whose rings end at other ticks."""
    direct = truth.direct(robot, order(tmp_path, split_bytes=12_000))
    while len(parts(tmp_path)) < times:
        direct.ticks(ticks)
    direct.finish()
    return parts(tmp_path)


def told_of(recwarn) -> list[str]:
    return [str(one.message) for one in recwarn.list if issubclass(one.category, silo.LogWarning)]


def test_the_parts_of_a_recording_are_read_as_one_whatever_the_order(robot, tmp_path, truth) -> None:
    robot.start()
    found = recorded(robot, tmp_path, truth)
    for log in (silo.open_log(found[::-1]), silo.open_log(found[1], alone=False)):
        assert truth.span(log.recording) == (0, robot.tick)
        assert {name: len(log[name].values) for name in ("x", "slow")} == {"x": robot.tick, "slow": -(-robot.tick // 5)}
        assert all(element.own_ns is None for element in log.recording.elements)
        assert not log.warnings
        assert log.recording.told_about["recording"].startswith(f"{len(found)} files of recording 'bot' of run ")
    assert silo.open_log([*found, found[1]])["x"].values.tolist() == list(range(robot.tick)), "a copy counts once"
    assert truth.span(silo.open_log(found[:1]).recording) == truth.span(silo.open_log(found[0], alone=True).recording)


def test_values_of_parts_read_as_one_are_read_when_they_are_asked_for(robot, tmp_path, truth, monkeypatch) -> None:
    robot.start()
    found = recorded(robot, tmp_path, truth)
    read, column = [], BagElements._column
    monkeypatch.setattr(BagElements, "_column", lambda *one: read.append(one[1]) or column(*one))
    log = silo.open_log(found)
    assert ([one.count for one in log.recording.elements if one.divider == 1], read) == ([robot.tick] * 3, [])
    _ = log["x"].values
    assert len(read) == len(found)


def test_rings_of_which_one_is_read_further_meet_where_a_part_ends(direct, robot, tmp_path, truth) -> None:
    """Stamps of ticks of which a part has slow samples alone lie between its others: the next one has those logged."""
    direct.ticks(50)
    robot.ticks(50)
    drained = direct.drain.read(1 << 20)
    slow = [rows for rows in drained.rows if rows.ring.divider == 5]
    fast = [rows for rows in drained.rows if rows.ring.divider != 5]
    direct.writing.put(direct.writing.write, type(drained)(slow))
    direct.writing.put(direct.writing._finish_part)
    direct.writing.put(direct.writing.write, type(drained)(fast))
    direct.finish()
    one, two = map(read_bag, parts(tmp_path))
    assert one.offset > two.offset - len(two.time_ns)
    log = silo.open_log(parts(tmp_path))
    assert truth.span(log.recording) == (0, 100)
    assert np.unique(np.diff(log.time_ns)).tolist() == [1_000_003]


def test_ticks_that_are_in_no_part_are_told_and_what_comes_after_stands_at_its_time(robot, tmp_path, truth) -> None:
    robot.start()
    found = recorded(robot, tmp_path, truth, 5)
    low, high = truth.span(read_bag(found[1]))[0], truth.span(read_bag(found[2]))[1]
    for path in found[1:3]:
        path.unlink()
    with pytest.warns(silo.LogWarning, match=f"ticks {low} to {high - 1} are missing"):
        log = silo.open_log(found[0], alone=False)
    ticks = [*range(low), *range(high, robot.tick)]
    assert log["x"].values.tolist() == ticks
    assert log["x"].time_ns.tolist() == [1_700_000_000_000_000_000 + tick * 1_000_003 for tick in ticks]
    slow = [tick for tick in ticks if tick % 5 == 0]
    assert (-log["slow"].values).tolist() == slow
    assert log["slow"].time_ns.tolist() == [1_700_000_000_000_000_000 + tick * 1_000_003 for tick in slow]
    with pytest.raises(SaveError, match="an element with a gap between two parts of the recording"):
        log.save(tmp_path / "whole.silo")


def test_oldest_ticks_that_a_budget_deleted_are_told_and_none_from_before_the_recording(
    robot, tmp_path, truth, recwarn
) -> None:
    robot.start()
    robot.ticks(70)
    found = recorded(robot, tmp_path, truth)
    begin = truth.span(silo.open_log(found).recording)[0]
    assert not told_of(recwarn)
    first = truth.span(read_bag(found[2]))[0]
    for path in found[:2]:
        path.unlink()
    with pytest.warns(
        silo.LogWarning, match=f"ticks {begin} to {first - 1} are missing: the file that has them was del"
    ):
        log = silo.open_log(found[3], alone=False)
    assert log["x"].values.tolist() == list(range(first, robot.tick))


@pytest.mark.parametrize("ending", [".silo", ".csv", ".rosbag2", ".mcap"])
def test_parts_that_were_converted_are_read_as_one_as_well(robot, tmp_path, truth, ending) -> None:
    robot.start()
    converted = []
    for path in recorded(robot, tmp_path, truth):
        converted.append(tmp_path / "others" / f"{path.stem}{ending}")
        converted[0].parent.mkdir(exist_ok=True)
        silo.open_log(path).save(converted[-1])
    for log in (silo.open_log(converted), silo.open_log(converted[1], alone=False)):
        assert truth.span(log.recording) == (0, robot.tick)
    with pytest.warns(silo.LogWarning, match=r"one file of recording 'bot' .*alone=False"):
        silo.open_log(converted[0].parent)


def test_who_opens_one_part_of_several_by_a_folder_or_a_glob_is_told_how_to_get_all(
    robot, tmp_path, truth, capsys, recwarn
) -> None:
    robot.start()
    found = recorded(robot, tmp_path, truth)
    for which in (tmp_path / "rec", f"{tmp_path}/rec/*.mcap", f"{tmp_path}/rec/bot"):
        with pytest.warns(silo.LogWarning, match=r"one file of recording 'bot' of run .*--whole.*alone=False"):
            assert len(silo.open_log(which)["x"]) < robot.tick
    assert not told_of(recwarn)
    assert len(silo.open_log(tmp_path / "rec", alone=True)) == len(silo.open_log(found[0])) == 4
    for words in (["stats", "x"], ["check", "--never", "x < 0"]):
        assert run([words[0], str(tmp_path / "rec"), *words[1:]]) == 0
        assert "`silo stats --whole`" in capsys.readouterr().err
    assert run(["stats", "--whole", str(tmp_path / "rec"), "x"]) == 0
    told = capsys.readouterr()
    assert (str(robot.tick) in told.out, told.err) == (True, "")
    assert run(["convert", "--whole", str(tmp_path / "rec"), str(tmp_path / "whole.silo")]) == 0
    assert truth.span(silo.open_log(tmp_path / "whole.silo").recording) == (0, robot.tick)
    assert not told_of(recwarn)
    for path in found[1:]:
        path.unlink()
    silo.open_log(tmp_path / "rec")
    assert not told_of(recwarn), "the only part is all there is"


def test_the_part_that_is_being_written_is_one_of_the_recording_and_another_run_is_none(robot, tmp_path, truth) -> None:
    robot.start()
    recorded(robot, tmp_path, truth)
    robot.start()
    direct = truth.direct(robot, order(tmp_path, split_bytes=12_000))
    direct.ticks(130)
    direct.ticks(30)
    with pytest.warns(silo.LogWarning, match=r"ticks 130 to 159: the file is not finished"):
        log = silo.open_log(parts(tmp_path)[-1], alone=False)
    assert len(log["x"]) == 160
    with pytest.raises(ElementError, match="or of one recording of a run"):
        silo.open_log(parts(tmp_path))
    direct.finish()


def test_a_recording_of_a_run_that_was_cut_is_read_as_one_across_the_cut(robot, tmp_path, truth) -> None:
    robot.start()
    recorded(robot, tmp_path, truth, 2)
    robot.log.set("slow", divider=2, cut=True)
    before = robot.tick
    recorded(robot, tmp_path, truth, 5)
    log = silo.open_log(parts(tmp_path))
    assert log["x"].values.tolist() == list(range(robot.tick))
    ticks = [*range(0, before, 5), *range(before, robot.tick, 2)]
    assert (-log["slow"].values).tolist() == ticks
    assert log["slow"].time_ns.tolist() == [1_700_000_000_000_000_000 + tick * 1_000_003 for tick in ticks]
    assert not log.warnings


def test_damage_that_is_found_in_a_part_when_values_are_read_is_told_of_the_whole(robot, tmp_path, truth) -> None:
    robot.start()
    found = recorded(robot, tmp_path, truth, 2, ticks=1500)
    data = bytearray(found[1].read_bytes())
    chunks = [one for one in indexed_records(memoryview(bytes(data))) if one.opcode == Opcode.CHUNK]
    data[max(chunks, key=lambda one: one.end - one.at).end - 20] ^= 1
    found[1].write_bytes(data)
    log = silo.open_log(found)
    before = list(log.warnings)
    with pytest.warns(silo.LogWarning, match=found[1].name):
        for name in log:
            _ = log[name].values
    fresh = [text for text in log.warnings if text not in before]
    assert fresh
    assert all(text.startswith("ticks ") for text in fresh)


@pytest.mark.parametrize("deleted", ["folder", "parts", "open part"])
def test_a_recording_whose_files_somebody_deletes_goes_on_in_another_part(robot, tmp_path, truth, deleted) -> None:
    robot.start()
    folder = tmp_path / "rec"
    direct = truth.direct(robot, order(tmp_path))
    direct.ticks(300)
    if deleted == "folder":
        shutil.rmtree(folder)
    else:
        for path in [*folder.iterdir()]:
            if deleted == "parts" or path.name.endswith(".part"):
                path.unlink()
    direct.ticks(200)
    with pytest.raises(SaveError, match="another recorder writes"):
        truth.direct(robot, order(tmp_path))
    totals = direct.finish()
    assert totals.state is not RecorderState.FAILED
    (path,) = parts(tmp_path)
    found = read_bag(path)
    assert [element.entries[0].values[0] for element in found.elements if element.name == "/log/x"] == [300]
    told = [one.told for one in direct.told() if "samples were lost, of ticks 0 to " in one.told]
    assert all("was deleted, or its folder, before it was finished" in one for one in told)
    assert (
        totals.lost == sum(int(one.split()[0]) for one in told) == sum(element.lost for element in found.elements) > 0
    )
    assert f"{totals.lost} lost" in read_written(folder, direct.ledger.name).sums().text


def test_a_recording_ends_where_another_one_took_its_name_in_the_folder_made_anew(direct, tmp_path) -> None:
    direct.ticks(300)
    shutil.rmtree(tmp_path / "rec")
    (tmp_path / "rec").mkdir()
    other = Ledger(tmp_path / "rec", "bot", 0.0, os.getpid())
    direct.ticks(200)
    totals = direct.finish()
    other.close()
    assert totals.state is RecorderState.FAILED
    assert "another recorder writes" in totals.text
    assert parts(tmp_path) == []


def test_a_recording_whose_disk_is_gone_does_not_go_on_on_the_one_beneath(direct, tmp_path) -> None:
    direct.ticks(300)
    shutil.rmtree(tmp_path / "rec")
    direct.writing._device = -1
    direct.ticks(200)
    totals = direct.finish()
    assert totals.state is RecorderState.FAILED
    assert "was on another disk, which is not there any more: mount it, and record again" in totals.text
    assert not (tmp_path / "rec").exists()
