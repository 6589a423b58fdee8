"""A recorder in a process of its own: every sample is in its files, whatever is killed, restarted, or in the way."""

import os
import shutil
import signal
import socket
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from silo.analysis.opening import open_log
from silo.core.elements import RecorderState
from silo.files.parts.metadata import PART_ENDING
from silo.files.parts.scan import rows_after
from silo.recorder.orders import Finish, Follow, RecordOrder, encode
from silo.recorder.process import RecorderHandover, RecorderProcess, Spare
from silo.recorder.recorder import Recorder
from silo.recorder.ring_cursor import Drained, RingCursor
from silo.recovery.parts import close_parts
from tests.waiting import freeze, wait_until
from tests.whole_bags import read_bag

pytestmark = pytest.mark.slow


def order(folder: Path, **options: object) -> RecordOrder:
    return RecordOrder("bot", str(folder / "rec"), **options)


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "rec").glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2])


def open_parts(folder: Path) -> list[Path]:
    return sorted((folder / "rec").glob(f"*{PART_ENDING}"))


def held(folder: Path) -> int:
    """Bytes of parts that are open."""
    return sum(path.stat().st_size for path in open_parts(folder))


def holds_rows(folder: Path) -> bool:
    """Whether an open part holds more than what it begins with."""
    found = [rows_after(memoryview(path.read_bytes())) for path in open_parts(folder)]
    return any(told and any(told[1][ring.ring] > ring.begin for ring in told[0].rings) for told in found)


def begin(robot, recorders, folder: Path, **options: object):
    """A recorder that records the present run."""
    recorder = recorders(order(folder, **options))
    recorder.follow(robot.log)
    recorder.wait_recording()
    return recorder


def test_every_sample_is_in_the_files_and_all_readers_find_it(robot, recorders, tmp_path, truth) -> None:
    robot.start()
    robot.ticks(7)
    recorder = begin(robot, recorders, tmp_path)
    begun = robot.tick
    for _ in range(2):
        robot.ticks(300)
        before = held(tmp_path)
        wait_until(lambda: held(tmp_path) > before)  # noqa: B023 - it waits here
    robot.ticks(11)
    report = recorder.finish()
    (path,) = parts(tmp_path)
    assert (report.state, report.lost, report.parts) == (RecorderState.ENDED, 0, 1)
    assert truth.span(read_bag(path)) == (begun, robot.tick)
    counts = truth.by_others(path)
    assert counts["/log/x"] == counts["/log/q"] == counts["/log/word"] == robot.tick - begun
    assert sum(counts.values()) == report.samples
    assert open_log(path)["/log/x"].values[-1] == robot.tick - 1


@pytest.mark.parametrize("left_bytes", [0, 100_000])
def test_its_first_words_tell_at_once_whether_it_records(robot, recorders, small_disk, left_bytes) -> None:
    robot.start()
    if left_bytes:
        (small_disk / "ballast").write_bytes(bytes(shutil.disk_usage(small_disk).free - left_bytes))
    recorder = recorders(order(small_disk, runs=(robot.log._present.run.id,)), report_s=3600)
    recorder.follow(robot.log)
    wait_until(lambda: recorder.reports)
    first = recorder.reports[0]
    assert first.state is (RecorderState.FAILED if left_bytes else RecorderState.RECORDING)
    assert ("is nearly full" in first.text) == bool(left_bytes)


def test_where_no_run_is_under_way_its_first_words_say_so_at_once(recorders, tmp_path) -> None:
    recorder = recorders(order(tmp_path, runs=()), report_s=3600)
    wait_until(lambda: recorder.reports)
    assert recorder.reports[0].state is RecorderState.WAITING


def test_a_new_run_gets_a_part_of_its_own_from_its_first_tick_on(robot, recorders, tmp_path, truth) -> None:
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(200)
    robot.start()
    first = robot.run_first
    robot.ticks(20)  # before the recorder hears of it
    recorder.follow(robot.log)
    robot.ticks(100)
    last = recorder.finish()
    assert (last.lost, last.told_run, last.told_tick) == (0, robot.log._present.run.id, 119)
    assert [each.told_tick for each in recorder.reports if each.finished] == [199, 119]
    one, two = parts(tmp_path)
    assert truth.span(read_bag(one)) == (0, 200)
    assert truth.span(read_bag(two), first) == (0, 120)


def test_a_stopped_logger_leaves_a_finished_part_and_its_next_run_is_recorded(
    robot, recorders, tmp_path, truth
) -> None:
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(50)
    robot.log.stop()
    wait_until(lambda: parts(tmp_path))
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 50)
    robot.start()
    recorder.follow(robot.log)
    robot.ticks(30)
    recorder.finish()
    assert truth.span(read_bag(parts(tmp_path)[1]), 50) == (0, 30)


def test_a_recorder_goes_on_before_what_a_killed_one_left_is_closed(
    robot, recorders, tmp_path, truth, monkeypatch
) -> None:
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(300)
    wait_until(lambda: holds_rows(tmp_path))
    recorder.kill()
    robot.ticks(1500)
    may_close = threading.Event()
    monkeypatch.setattr("silo.recorder.recorder.close_parts", lambda folder: may_close.wait() and close_parts(folder))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    again = Recorder(order(tmp_path, resume=True), theirs)
    thread = threading.Thread(target=again.run)
    thread.start()
    with robot.log._present.run.segment.open_read_only() as file:
        socket.send_fds(ours, [encode(Follow(robot.log._present.path))], [file.fileno()])
    wait_until(lambda: len(open_parts(tmp_path)) == 2 and open_parts(tmp_path)[1].stat().st_size > 10_000)
    robot.ticks(1500)  # the rings hold 2000 rows: what was there before is overwritten now
    may_close.set()
    wait_until(lambda: len(parts(tmp_path)) == 1)
    ours.send(encode(Finish("the test is over")))
    thread.join()
    ours.close()
    theirs.close()
    spans = [truth.span(read_bag(path)) for path in parts(tmp_path)]
    assert [spans[0][0], spans[0][1], spans[1][1]] == [0, spans[1][0], robot.tick]


def test_what_is_logged_between_the_last_look_and_the_end_is_left_to_the_next_one(
    robot, recorders, tmp_path, truth, monkeypatch
) -> None:
    robot.start()
    robot.ticks(50)
    look, drain_last = RingCursor.read, Recorder._drain_last
    last = threading.Event()

    def looked(self: RingCursor, room_bytes: int) -> Drained:
        found = look(self, room_bytes)
        if last.is_set():
            last.clear()
            robot.ticks(2)
            robot.log.stop()
        return found

    monkeypatch.setattr(RingCursor, "read", looked)
    monkeypatch.setattr(Recorder, "_drain_last", lambda self: last.set() or drain_last(self))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        with robot.log._present.run.segment.open_read_only() as file:
            socket.send_fds(ours, [encode(Follow(robot.log._present.path))], [file.fileno()])
        ours.shutdown(socket.SHUT_WR)  # as of a helper process that was killed
        Recorder(order(tmp_path, order="one"), theirs).run()
    again = recorders(order(tmp_path, order="one", resume=True))
    again.follow(robot.log)
    assert again.finish().lost == 0
    spans = [truth.span(read_bag(path)) for path in parts(tmp_path)]
    assert spans == [(0, 50), (50, 52)]


def test_without_the_one_who_started_it_a_recorder_finishes_and_ends(robot, recorders, tmp_path, truth) -> None:
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(120)
    recorder.socket.shutdown(2)
    recorder.end()
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 120)


def test_at_sigterm_a_recorder_finishes_its_part(robot, recorders, tmp_path, truth) -> None:
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(120)
    os.kill(recorder.process.pid, signal.SIGTERM)
    assert recorder.end().state is RecorderState.ENDED
    assert truth.span(read_bag(parts(tmp_path)[0])) == (0, 120)


def test_a_ledger_that_a_kill_left_half_written_is_removed(tmp_path) -> None:
    left = tmp_path / f".silo-{2**22 + 5}-0123abcd.part"
    left.touch()
    assert close_parts(tmp_path) == ([], [])
    assert not left.exists()


def test_what_the_ring_for_live_values_has_no_more_is_taken_from_the_buffer_that_is_saved(
    recorders, tmp_path, truth
) -> None:
    robot = truth.robot(tmp_path)
    robot.log.update()
    kinds = {"x": "fixed", "q": "growing", "word": "fixed"}
    for name, kind in kinds.items():
        robot.log.set(name, buffer=kind, size=3000, action="both")
    robot.start()
    recorder = begin(robot, recorders, tmp_path)
    robot.ticks(100)
    wait_until(lambda: holds_rows(tmp_path))
    recorder.kill()
    robot.ticks(2900)
    rings = {one.info.name: one.live_ring for one in robot.log._present.run.reader.schema.elements}
    sizes = {
        name: robot.log._present.run.reader.schema.rings[ring].capacity for name, ring in rings.items() if ring > 0
    }
    assert 0 < max(sizes.values()) <= 2000  # of which nothing would be overwritten if they were larger
    again = recorders(order(tmp_path, resume=True))
    again.follow(robot.log)
    again.wait_recording()
    report = again.finish()
    robot.log.close()
    spans = [truth.span(read_bag(path)) for path in parts(tmp_path)]
    assert [spans[0][1], spans[1][1]] == [spans[1][0], 3000]
    assert report.lost == 0
    for path in parts(tmp_path):
        truth.by_others(path)


def test_what_no_buffer_has_any_more_is_told_as_lost_for_want_of_a_recorder(recorders, tmp_path, truth) -> None:
    robot = truth.robot(tmp_path)
    robot.log.update()
    robot.log.set("x", buffer="fixed", size=500, action="both")
    robot.start()
    recorder = begin(robot, recorders, tmp_path, patterns=("x",))
    robot.ticks(100)
    wait_until(lambda: holds_rows(tmp_path))
    recorder.kill()
    robot.ticks(3900)
    again = recorders(order(tmp_path, resume=True, patterns=("x",)))
    again.follow(robot.log)
    again.wait_recording()
    report = again.finish()
    robot.log.close()
    told = [one.told for one in again.reports if "were lost" in one.told]
    (element,) = read_bag(parts(tmp_path)[-1]).elements
    assert element.lost == report.lost > 0
    assert [f"of ticks 500 to {499 + report.lost}: no recorder read them in time" in one for one in told] == [True]


@pytest.mark.parametrize(
    ("names", "full", "words"),
    [
        ([], [], ["nothing of this run is recorded: no element matches joints/* imu"]),
        (["x"], [], []),
        (["x"], ["/log/x"], ["set buffer=looping to record without end: elements come to an end when their buffers "
                             "are full (/log/x), those that grow when there is no memory"]),
    ],
)  # fmt: skip
def test_what_of_a_run_is_not_recorded_without_end_is_told(tmp_path, monkeypatch, names, full, words) -> None:
    told: list[str] = []
    monkeypatch.setattr("silo.recorder.recorder.EventTail", lambda *_: None)
    monkeypatch.setattr("silo.recorder.recorder.ending", lambda _: full)
    writing = SimpleNamespace(put=lambda *_: None, begin_run=None)
    made = SimpleNamespace(_tell_clients=told.append, _writing=writing, _gone="", _missed=[])
    made._order = order(tmp_path, patterns=["joints/*", "imu"])
    run = SimpleNamespace(layout=SimpleNamespace(elements=names), reader=None, begun_with={})
    Recorder._announce(made, run, 0)
    assert told == words


def test_a_frozen_spare_is_passed_over_and_ended(robot, tmp_path) -> None:
    robot.start()
    robot.ticks(3)
    spare = Spare()
    freeze(spare.child.pid)
    recorder = RecorderProcess(RecorderHandover(order(tmp_path), "", 0))
    recorder.start(recorder.order, spare)
    try:
        assert not spare.child.is_there
        assert recorder.pid != spare.child.pid
    finally:
        recorder.socket.close()
        recorder._child.kill()
    spare = Spare()
    freeze(spare.child.pid)
    spare.end()  # waited for ever
    assert not spare.child.is_there
