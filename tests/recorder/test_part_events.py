"""What happened, limits and triggers in the parts of an endless recording: there for silo and for everybody else."""

import contextlib
import itertools
import os
import socket
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from silo import open_log, runs
from silo.cli.main import run
from silo.core.conditions import Derived
from silo.core.elements import LoggedEvent, RecorderState
from silo.datasets.lerobot import write_lerobot
from silo.errors import FileFormatError, SaveError
from silo.files.bags.writer import write_bag
from silo.files.event_log import append_events, event_log_path, older_event_log
from silo.files.parts.scan import rows_after, scan_part
from silo.files.summaries import opened_file
from silo.journal.derived_rows import with_derived_rows
from silo.recorder import event_tail
from silo.recorder.layout import layout_of, more_derived
from silo.recorder.orders import Finish, NewConditions, RecordOrder, conditions_file, encode
from silo.recordings.folder import _times
from silo.recovery.parts import close_part
from silo.segment.reader import SegmentReader
from tests.waiting import wait_until
from tests.whole_bags import read_bag


def order(folder: Path, **options: object) -> RecordOrder:
    return RecordOrder("bot", str(folder / "rec"), **options)


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "rec").glob("bot_*.mcap"), key=lambda path: path.name.rpartition("_")[2])


@pytest.fixture
def happens(robot, tmp_path):
    """Writes an event of the present run into the event log, as a helper process does."""
    numbers = itertools.count(1)

    def happen(text: str, tick: int, kind: str = "marker", stamp_ns: int = 0) -> LoggedEvent:
        run_id = robot.log._present.run.id
        event = LoggedEvent(kind, text, 1_800_000_000_000_000_000 + tick, tick, stamp_ns, "me", run_id, next(numbers))
        append_events(tmp_path, "bot", [event])
        return event

    return happen


def kept(path: Path) -> list[tuple[str, str, int]]:
    return [(event.kind, event.text, event.tick) for event in read_bag(path).events]


def test_a_part_of_nothing_but_events_is_read_as_an_empty_run(direct, robot, tmp_path, happens) -> None:
    told = happens("before the first tick", -1)
    direct.finish()
    (path,) = parts(tmp_path)
    assert kept(path) == [(told.kind, told.text, told.tick)]
    log = open_log(path)
    assert {name: len(log[name].values) for name in log} == dict.fromkeys(robot.log, 0)
    for ending in (".silo", ".csv", ".mcap", ".parquet"):
        assert run(["convert", str(path), str(tmp_path / f"again{ending}")]) == 0


def test_a_mark_right_before_the_end_of_a_run_is_waited_for_until_the_log_has_it(
    direct, robot, tmp_path, monkeypatch
) -> None:
    robot.ticks(20)
    robot.log.mark("fell")
    (mark,) = direct.drain.reader.stamped_marks()
    waits: list[float] = []

    def is_told_later(pause_s: float) -> None:
        waits.append(pause_s)
        if len(waits) == 2:
            append_events(tmp_path, "bot", [msgspec.structs.replace(mark, number=1)])

    monkeypatch.setattr(event_tail, "time", SimpleNamespace(monotonic=lambda: 0.0, sleep=is_told_later))
    direct.finish()
    (path,) = parts(tmp_path)
    assert [(event.text, event.tick) for event in read_bag(path).events] == [("fell", 19)]
    assert len(waits) == 2


def test_a_part_goes_from_its_first_sample_to_its_last_whenever_what_it_tells_of_happened(
    direct, robot, tmp_path, happens
) -> None:
    direct.ticks(50)
    happens("by another clock", 0, stamp_ns=robot.log._present.run.segment.schema.started_ns)
    direct.finish()
    (path,) = parts(tmp_path)
    with opened_file(os.open(path.parent, os.O_RDONLY), path.name) as file:
        begin_ns, end_ns = _times(file, path.stat().st_size)
    stamps = open_log(path).time_ns
    assert (begin_ns, end_ns) == (stamps[0], stamps[-1])
    with path.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_end_time > end_ns


def test_what_happened_stands_in_the_part_as_in_the_event_log(direct, robot, tmp_path, truth, happens) -> None:
    told = [happens("before the first tick", -1), happens("started", 0, "started")]
    robot.ticks(50)
    told.append(happens("slipped … 10 °C", 20))
    direct.step()
    told.append(happens("trigger 'fall' fired", 49, "triggered"))
    direct.ticks(50)
    direct.finish()
    found = read_bag(parts(tmp_path)[0])
    stamps = found.time_ns.tolist()
    assert list(found.events) == [msgspec.structs.replace(event, stamp_ns=stamps[max(event.tick, 0)]) for event in told]
    assert [event.text for event in open_log(parts(tmp_path)[0]).events] == [event.text for event in told]
    assert truth.span(found) == (0, 100)


def test_other_readers_find_events_as_messages_of_ros(direct, robot, tmp_path, truth, happens) -> None:
    robot.ticks(30)
    happens("slipped", 12)
    direct.step()
    direct.finish()
    (path,) = parts(tmp_path)
    assert truth.by_others(path)["/log/events"] == 1
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(path) as reader:
        ((connection, stamp, raw),) = [one for one in reader.messages() if one[0].topic == "/log/events"]
        message = store.deserialize_cdr(raw, connection.msgtype)
    assert (message.msg, message.name, message.line) == ("marker: slipped", "me", 12)
    assert stamp == message.stamp.sec * 10**9 + message.stamp.nanosec
    with path.open("rb") as file:
        assert [channel.topic for _, channel, _ in make_reader(file).iter_messages(topics="/log/events")] == [
            "/log/events"
        ]


def test_a_mark_while_nothing_else_happens_is_in_the_part_at_once(direct, tmp_path, happens) -> None:
    direct.ticks(30)
    happens("stands still", 29)
    direct.writing.put(direct.writing.look_for_events)
    wait_until(lambda: direct.writing.is_idle)
    (path,) = (tmp_path / "rec").glob("*.mcap.part")
    assert kept(path) == [("marker", "stands still", 29)]
    direct.finish()
    assert kept(parts(tmp_path)[0]) == [("marker", "stands still", 29)]


def test_a_mark_after_the_last_row_of_a_part_has_one_of_its_own_if_no_row_follows(
    robot, tmp_path, truth, happens
) -> None:
    direct = truth.direct(robot, order(tmp_path, keep_bytes=40_000))
    while not parts(tmp_path):
        direct.ticks(100)
    happens("stands still", robot.tick - 1)
    direct.finish()
    path = parts(tmp_path)[-1]
    assert kept(path) == [("marker", "stands still", robot.tick - 1)]
    truth.by_others(path)
    write_bag(read_bag(path), tmp_path / "again.mcap")


def test_an_episode_over_two_parts_lacks_its_end_in_the_first_and_its_beginning_in_the_second(
    robot, tmp_path, truth, happens
) -> None:
    direct = truth.direct(robot, order(tmp_path, split_bytes=40_000))
    robot.ticks(100)
    happens('episode "pick" begin {"object":"cup"}', 49)
    while not parts(tmp_path):
        direct.ticks(100)
    seam = len(open_log(parts(tmp_path)[0]).time_ns)
    robot.ticks(100)
    happens('episode "pick" end good', robot.tick - 11)
    direct.step()
    direct.finish()
    first, *_, last = [open_log(path) for path in parts(tmp_path)]
    (one,), (other,) = first.episodes, last.episodes
    assert (one.first, one.last, one.success, one.whole, one.about) == (50, seam - 1, None, False, {"object": "cup"})
    assert (other.last, other.success, other.whole) == (robot.tick - 11, True, False)
    assert other.start_s == 0
    found = runs(tmp_path / "rec").episodes()
    assert [(run.episode.success, run.episode.whole) for run in found] == [(True, True)]  # of all parts
    assert [int(signal.most) for run in found for signal in run.signals if signal.name == "/log/x"] == [
        int(run.open()["x"].values.max()) for run in found
    ]


def test_news_of_recorders_alone_begin_no_part(direct, tmp_path, happens) -> None:
    happens("recording 'bot': finished", 0, "recording")
    direct.finish()
    assert list((tmp_path / "rec").glob("*.mcap*")) == []


def test_events_of_a_part_cut_at_any_byte_are_read_and_closed(direct, robot, tmp_path, truth, happens) -> None:
    for number in range(4):
        robot.ticks(50)
        happens(f"mark {number}", robot.tick - 1)
        direct.step()
    (path,) = (tmp_path / "rec").glob("*.mcap.part")
    whole = path.read_bytes()
    direct.finish()
    most = 0
    for size in [*np.random.default_rng(5).integers(len(whole) // 2, len(whole), 25).tolist(), len(whole)]:
        cut = tmp_path / f"cut{size}.mcap.part"
        cut.write_bytes(whole[:size])
        scan = scan_part(memoryview(whole[:size]))
        glance = rows_after(memoryview(whole[:size]))
        assert glance is not None
        assert glance[1] == scan.next_rows
        closed = close_part(cut)
        if closed.size_bytes:
            found = read_bag(closed.path)
            truth.span(found)
            assert [event.text for event in found.events] == [f"mark {number}" for number in range(len(found.events))]
            assert scan.next_rows[-1] == (found.events[-1].number + 1 if found.events else 0)
            assert sum(truth.by_others(closed.path).values()) == closed.samples + len(found.events)
            most = max(most, len(found.events))
    assert most == 4
    cut.write_bytes(whole)  # whose name another one got
    stays = f"{cut}: can't get its name, as there is a {closed.path.name}: rename that one and try again"
    with pytest.raises(SaveError) as told:
        close_part(cut)
    assert (str(told.value), cut.exists()) == (stays, True)


def test_limits_and_triggers_stand_in_every_part(robot, tmp_path, truth, capsys) -> None:
    robot.log.update(read_script=False)
    robot.log.limit("x", (None, None, 150, 250))
    robot.log.trigger("high", "x > 100", pre="10ms", post="10ms")
    direct = truth.direct(robot, order(tmp_path))
    direct.ticks(300)
    direct.finish()
    found = open_log(parts(tmp_path)[0]).recording.conditions
    assert [one.name for one in found.limits] == ["x"]
    assert [one.name for one in found.triggers] == ["high"]
    assert run(["check", str(parts(tmp_path)[0])]) == 4
    assert "RED" in capsys.readouterr().out.upper()


def test_limits_of_what_is_not_recorded_stay_away(robot, tmp_path, truth, capsys) -> None:
    robot.log.update(read_script=False)
    robot.log.limit("x", (None, None, 150, 250))
    robot.log.limit("slow", (None, None, 150, 250))
    direct = truth.direct(robot, order(tmp_path, patterns=("slow",)))
    direct.ticks(300)
    direct.finish()
    assert [one.name for one in open_log(parts(tmp_path)[0]).recording.conditions.limits] == ["slow"]
    assert run(["check", str(parts(tmp_path)[0])]) == 0
    capsys.readouterr()


def test_other_limits_begin_another_part(robot, tmp_path, truth) -> None:
    robot.log.update(read_script=False)
    direct = truth.direct(robot, order(tmp_path))
    direct.ticks(50)
    robot.log.limit("x", (None, None, 150, 250))
    direct.writing.put(direct.writing.change_conditions, robot.log._conditions.now)
    direct.ticks(50)
    direct.finish()
    told = [each for news in direct.writing.news if (each := news(RecorderState.RECORDING).finished)]
    names = [str(path) for path in parts(tmp_path)]
    assert told == [f"a part, it goes on in the next (limits or triggers changed): {names[0]}", names[1]]
    one, two = (read_bag(path) for path in parts(tmp_path))
    assert [len(found.conditions.limits) for found in (one, two)] == [0, 1]
    assert [truth.span(one), truth.span(two)] == [(0, 50), (50, 100)]


def test_the_event_log_is_followed_through_its_renaming(direct, robot, tmp_path, happens) -> None:
    robot.ticks(30)
    happens("one", 1)
    direct.step()
    happens("two", 2)
    event_log_path(tmp_path, "bot").rename(older_event_log(tmp_path, "bot"))
    happens("three", 3)
    direct.step()
    direct.writing.put(direct.writing.look_for_events)
    direct.finish()
    assert [text for _, text, _ in kept(parts(tmp_path)[0])] == ["one", "two", "three"]


@pytest.mark.slow
def test_no_event_is_missing_or_twice_when_another_recorder_goes_on(robot, recorders, tmp_path, truth, happens) -> None:
    robot.start()
    recorder = recorders(order(tmp_path))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(200)
    happens("before", 150)

    def opened() -> list[tuple[str, str, int]]:
        with contextlib.suppress(StopIteration, FileFormatError):  # there is none yet, or it is being begun
            return kept(next((tmp_path / "rec").glob("*.mcap.part")))
        return []

    wait_until(opened)
    recorder.kill()
    happens("between", 199)
    robot.ticks(100)
    again = recorders(order(tmp_path, resume=True))
    again.follow(robot.log)
    again.wait_recording()
    happens("after", 299)
    wait_until(lambda: len(opened()) == 2)
    again.finish()
    assert [text for path in parts(tmp_path) for _, text, _ in kept(path)] == ["before", "between", "after"]
    for path in parts(tmp_path):
        truth.by_others(path)


@pytest.mark.slow
def test_of_a_run_that_is_under_way_a_new_recorder_takes_what_happens_from_then_on(
    robot, recorders, tmp_path, happens
) -> None:
    robot.start()
    robot.ticks(100)
    happens("long ago", 10)
    recorder = recorders(order(tmp_path))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(50)
    happens("now", 120)
    recorder.finish()
    assert [text for _, text, _ in kept(parts(tmp_path)[0])] == ["now"]


@pytest.mark.slow
def test_that_a_program_ended_is_in_its_last_part_though_the_kernel_still_clears_up_behind_it(
    robot, recorders, tmp_path
) -> None:
    robot.start()
    recorder = recorders(RecordOrder("bot", str(tmp_path / "rec")))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(100)
    recorder.socket.send(encode(Finish("its program is gone", died=True)))  # this process, the writer, lives
    recorder.end()
    (path,) = (tmp_path / "rec").glob("*.mcap")
    assert [event.kind for event in read_bag(path).events] == ["started", "crashed"]  # which nobody else had told


@pytest.fixture
def tuned(robot):
    """A robot with two parameters; what they were at each tick that was collected stands in `.were`."""
    kp, kd = robot.log.parameter("kp", 1.0), robot.log.parameter("kd", 0.5)
    ticks, robot.were = robot.ticks, []

    def noted(count: int) -> None:
        for _ in range(count):
            ticks(1)
            robot.were.append((kp.value, kd.value))

    robot.ticks, robot.kp, robot.kd = noted, kp, kd
    return robot


ONLY = ("x", "slow")


def check_parameters(tuned, paths: list[Path]) -> None:
    """Each part tells what parameters were at its ticks, and of changes those at its ticks alone."""
    for path in paths:
        log = open_log(path, alone=True)
        first = log.recording.offset - len(log.times)
        were = [tuple(log.parameters.at(time_s)[f"/log/{name}"] for name in ("kp", "kd")) for time_s in log.times]
        assert were == tuned.were[first : log.recording.offset]
        assert all(first <= event.tick < log.recording.offset for event in log.parameters.changes)


def tell_log(tuned, tmp_path, first: int = 1) -> None:
    """What a helper process does, later: the event log tells of all changes that the segment has."""
    with contextlib.closing(SegmentReader(tuned.log._present.path)) as reader:
        lines = [msgspec.structs.replace(one, number=at) for at, one in enumerate(reader.stamped_changes(), first)]
    append_events(tmp_path, "bot", lines)


@pytest.mark.parametrize("before", [0, 37])
def test_each_part_tells_what_parameters_were_at_its_begin_and_what_they_became_in_it(
    tuned, tmp_path, truth, before
) -> None:
    tuned.start()
    tuned.ticks(before)
    if before:
        tuned.kd.value = 0.75
        tuned.ticks(3)
    direct = truth.direct(tuned, order(tmp_path, split_bytes=8_000, patterns=ONLY))
    rng, changed = np.random.default_rng(3), 0
    while len(parts(tmp_path)) < 4:
        for _ in range(3):
            tuned.ticks(int(rng.integers(20, 60)))
            tuned.kp.value = float(changed + 2)
            changed += 1
        tuned.ticks(1)
        direct.step()
    tell_log(tuned, tmp_path)  # too late for most parts, and known already
    tuned.ticks(10)
    direct.step()
    direct.finish()
    check_parameters(tuned, parts(tmp_path))
    told = [event.tick for path in parts(tmp_path) for event in open_log(path).parameters.changes]
    assert len(told) == len(set(told)) == changed
    for path in parts(tmp_path):  # an older message would be taken for the begin of the part
        found = read_bag(path)
        assert all(event.at_ns >= found.time_ns[0] for event in found.events if event.kind == "parameter")
    whole = open_log(parts(tmp_path))
    assert [event.tick for event in whole.parameters.changes] == told
    assert sum(event.kind == "parameter" for event in whole.recording.events) == changed + 1, "one image, of the begin"
    check_parameters(tuned, parts(tmp_path))


def test_a_part_begins_where_its_rows_do_though_a_buffer_is_full(tuned, tmp_path, truth) -> None:
    short = tuned.log.array("short", (), np.int64, buffer="fixed", size=5)
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, split_bytes=8_000, patterns=(*ONLY, "short")))
    while len(parts(tmp_path)) < 3:
        tuned.ticks(50)
        direct.step()
    direct.finish()
    assert short.shape == ()
    check_parameters(tuned, parts(tmp_path))
    for path in parts(tmp_path)[1:]:
        found = read_bag(path)
        (image,) = [event for event in found.events if event.kind == "parameter"]
        assert image.tick == found.offset - len(found.time_ns)
        with path.open("rb") as file:
            assert make_reader(file).get_summary().statistics.message_start_time == found.time_ns[0]


def test_a_change_of_which_the_log_alone_knows_any_more_is_in_the_part_and_in_the_image_of_the_next(
    tuned, tmp_path, truth
) -> None:
    tuned.start()
    tuned.ticks(10)
    tuned.kd.value = 0.75
    tell_log(tuned, tmp_path)
    for step in range(1100):
        tuned.kp.value = float(step)
    tuned.ticks(5)
    with contextlib.closing(SegmentReader(tuned.log._present.path)) as reader:
        kept = [one for one in reader.changes(0) if not one.change.is_image]
        assert "/log/kd" not in {name for one in kept for name, _, _ in one.change.values}
    direct = truth.direct(tuned, order(tmp_path, patterns=ONLY))
    tuned.ticks(20)
    direct.step()
    direct.finish()
    check_parameters(tuned, parts(tmp_path))


def test_a_change_at_a_tick_that_two_parts_have_is_in_both_and_once_in_the_whole(tuned, tmp_path, truth) -> None:
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, patterns=ONLY))
    tuned.ticks(60)
    direct.step()
    tuned.ticks(20)
    tuned.kp.value = 7.0
    tuned.ticks(20)
    drained = direct.drain.read(1 << 20)
    for slow in (True, False):
        rows = [one for one in drained.rows if (one.ring.divider == 5) is slow]
        direct.writing.put(direct.writing.write, type(drained)(rows))
        direct.writing.put(direct.writing._finish_part)
    direct.finish()
    one, two = parts(tmp_path)
    assert [event.tick for path in (one, two) for event in open_log(path).parameters.changes] == [80, 80]
    check_parameters(tuned, [one, two])
    assert [event.tick for event in open_log([one, two]).parameters.changes] == [80]


def test_a_change_behind_the_last_row_of_all_parts_is_in_one_of_its_own(tuned, tmp_path, truth) -> None:
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, patterns=ONLY))
    tuned.ticks(30)
    direct.step()
    direct.writing.put(direct.writing._finish_part)
    tuned.kp.value = 9.0
    direct.finish()
    first, last = parts(tmp_path)
    assert open_log(first).parameters.at(1) == {"/log/kp": 1.0, "/log/kd": 0.5}
    assert [event.tick for event in open_log(last).parameters.changes] == [30]
    assert open_log([first, last]).parameters.changes[0].change.values == (("/log/kp", 1.0, 9.0),)


def test_who_goes_on_behind_a_part_that_tells_of_parameters_has_each_event_once(
    tuned, tmp_path, truth, happens
) -> None:
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, patterns=ONLY))
    happens("first", 0)
    tuned.ticks(40)
    direct.step()
    tuned.kp.value = 4.0
    tuned.ticks(10)
    direct.step()
    (path,) = (tmp_path / "rec").glob("*.mcap.part")
    data = memoryview(path.read_bytes())
    (_, rows), scan = rows_after(data), scan_part(data)
    assert rows == scan.next_rows
    assert rows[-1] == 2, "the line after the one that stands there"
    direct.finish()
    assert [event.text for event in read_bag(parts(tmp_path)[0]).events if event.kind == "marker"] == ["first"]


def test_what_a_kill_leaves_of_a_part_has_no_row_without_the_change_from_which_on_it_holds(
    tuned, tmp_path, truth
) -> None:
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, patterns=ONLY))
    for step in range(6):
        tuned.ticks(15)
        tuned.kp.value = step + 2.0
        tuned.ticks(15)
        direct.step()
    (path,) = (tmp_path / "rec").glob("*.mcap.part")
    whole = path.read_bytes()
    direct.finish()
    found = set()
    for size in range(len(whole) // 4, len(whole), 97):
        cut = tmp_path / f"cut{size}.mcap.part"
        cut.write_bytes(whole[:size])
        closed = close_part(cut)
        if closed.samples:
            log = open_log(closed.path)
            were = [log.parameters.at(time_s)["/log/kp"] for time_s in log.times]
            assert were == [kp for kp, _ in tuned.were[: len(were)]]
            found.add(len(were))
    assert len(found) > 3


def test_a_change_in_ticks_that_were_lost_is_told_in_the_next_part(tuned, tmp_path, truth, monkeypatch) -> None:
    monkeypatch.setattr("silo.recorder.writing.MOST_HOLE_ROWS", 100)
    tuned.start()
    direct = truth.direct(tuned, order(tmp_path, patterns=("x",)))
    tuned.ticks(50)
    direct.step()
    tuned.ticks(20)
    tuned.kp.value = 3.0
    tuned.ticks(3000)
    direct.step()
    direct.finish()
    first, last = parts(tmp_path)
    assert open_log(first).parameters.changes == []
    assert [event.tick for event in open_log(last).parameters.changes] == [70]
    assert open_log(last).parameters.at(0)["/log/kp"] == 3.0


def changed(recorder, log) -> None:
    """What a helper process does when limits, triggers or derived signals are others."""
    conditions = conditions_file(log._conditions.now)
    socket.send_fds(recorder.socket, [encode(NewConditions(log.ticks))], [conditions])
    os.close(conditions)


def derived_of(folder: Path, name: str) -> list[tuple[int, float]]:
    """Of a recording the ticks and values of what is a multiple of x."""
    found = []
    for path in parts(folder):
        if name in (log := open_log(path)):
            ticks = log["x"].values[np.searchsorted(log["x"].time_ns, log[name].time_ns)]
            found += zip(ticks.tolist(), log[name].values.tolist(), strict=True)
    return found


@pytest.mark.slow
def test_what_is_derived_while_a_recording_goes_on_is_in_its_parts_from_then_on_also_behind_a_kill(
    robot, recorders, tmp_path, truth
) -> None:
    robot.log.derive("d0", "x * 2")
    robot.start()
    recorder = recorders(order(tmp_path))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(103)
    wait_until(lambda: recorder.reports[-1].samples)
    robot.log.derive("d1", "slow * -3")
    robot.log.derive("d2", "x * 3")
    changed(recorder, robot.log)
    wait_until(lambda: len(parts(tmp_path)) == 1)
    robot.ticks(103)
    wait_until(lambda: list((tmp_path / "rec").glob("*.mcap.part")))
    before = recorder.reports[-1].samples
    wait_until(lambda: recorder.reports[-1].samples > before or recorder.reports[-1].samples >= 103 * 9)
    recorder.kill()
    robot.ticks(103)
    again = recorders(order(tmp_path, resume=True))
    robot.log.derive("d0", "x * 5")  # it stays what it is, and what comes behind is found all the same
    again.follow(robot.log)
    again.wait_recording()
    robot.ticks(103)
    total = again.finish()
    assert total.lost == 0
    assert derived_of(tmp_path, "d0") == [(tick, 2.0 * tick) for tick in range(robot.tick)]
    for name, divider in (("d1", 5), ("d2", 1)):
        found = derived_of(tmp_path, name)
        assert 0 < found[0][0] <= 105
        assert found == [(tick, 3.0 * tick) for tick in range(found[0][0], robot.tick, divider)]
    whole = open_log(parts(tmp_path))
    assert whole["d2"].values.tolist() == [value for _, value in derived_of(tmp_path, "d2")]
    assert not whole.warnings


@pytest.mark.slow
def test_what_was_logged_before_limits_changed_stands_in_the_part_before(robot, recorders, tmp_path) -> None:
    robot.log.update(read_script=False)
    robot.start()
    recorder = recorders(order(tmp_path, patterns=("x", "slow")))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(103)
    wait_until(lambda: recorder.reports[-1].samples)
    robot.ticks(40)  # which it has not read
    robot.log.limit("x", (None, None, 150, 250))
    changed(recorder, robot.log)
    robot.ticks(60)
    recorder.finish()
    found = [open_log(path, alone=True) for path in parts(tmp_path)]
    assert [[len(log[name]) for log in found] for name in ("x", "slow")] == [[143, 60], [29, 12]]


@pytest.mark.slow
def test_what_is_derived_and_not_chosen_or_is_another_now_begins_no_part(robot, recorders, tmp_path, truth) -> None:
    robot.log.derive("x2", "x * 2")
    robot.start()
    recorder = recorders(order(tmp_path, patterns=("x*",)))
    recorder.follow(robot.log)
    recorder.wait_recording()
    robot.ticks(50)
    wait_until(lambda: recorder.reports[-1].samples)
    robot.log.derive("d1", "x * 3")
    changed(recorder, robot.log)
    robot.log.derive("x2", "x * 5")
    changed(recorder, robot.log)
    robot.log.derive("x4", "x2 * 2")  # of what it isn't in the recording
    changed(recorder, robot.log)
    robot.ticks(50)
    recorder.finish()
    assert [report.told for report in recorder.reports if report.told] == [
        "/log/x4: not recorded in this run, as what it is computed of was derived anew, or removed, and is recorded as "
        "it was"
    ]
    assert len(parts(tmp_path)) == 1
    assert derived_of(tmp_path, "x2") == [(tick, 2.0 * tick) for tick in range(100)]


def test_what_is_derived_stands_behind_what_is_recorded_and_never_on_what_is_another_now() -> None:
    old = (Derived("/log/a", "x"), Derived("/log/b", "2 * a"))
    more = Derived("/log/c", "3 * x")
    assert more_derived(old, (*old, more)) == ((*old, more), [])
    assert more_derived(old, (more, *old[::-1])) == ((*old, more), []), "by its place is told which row is whose"
    assert more_derived(old, (old[0],)) == (old, [])
    other = Derived("/log/a", "7 * x")
    assert more_derived(old, (other, old[1])) == (old, [])
    stands = Derived("/log/d", "a + 1"), Derived("/log/e", "/log/d + 1"), more
    assert more_derived(old, (other, old[1], *stands)) == ((*old, more), ["/log/d", "/log/e"])


def test_signals_that_come_later_count_from_where_they_begin(direct, robot, tmp_path) -> None:
    direct.ticks(103)
    run = with_derived_rows(SegmentReader(robot.log._present.path), [Derived("/log/d1", "x * 3")])
    direct.drain = direct.drain.going_on(run, layout_of(run.schema, ()))
    direct.writing.put(direct.writing.add_signals, direct.drain.layout, dict(direct.drain.cursors))
    direct.ticks(47)
    totals = direct.finish()
    assert (totals.lost, totals.parts) == (0, 2)
    assert direct.ledger.written.runs[0].begin[max(direct.drain.layout.rings)] == 103
    assert ["d1" in open_log(path) for path in parts(tmp_path)] == [False, True]
    assert derived_of(tmp_path, "d1") == [(tick, 3.0 * tick) for tick in range(103, 150)]


def test_an_episode_over_the_parts_of_a_recording_is_one_in_data_sets_and_lists(
    robot, tmp_path, truth, happens
) -> None:
    robot.start()
    for word, tick, begun in (("begin", 20, 1), ("end", 70, 2)):
        direct = truth.direct(robot, order(tmp_path, resume=begun == 2))
        robot.ticks(50)
        happens(f'episode "walk" {word}', tick)
        direct.step()
        direct.finish()
    assert len(parts(tmp_path)) == 2
    made = write_lerobot(parts(tmp_path), tmp_path / "set", fps=1000, state=["x"], episodes="episodes", to="episodes")
    assert (made.episodes, [source for source, _ in made.left_out]) == (1, [str(parts(tmp_path)[1])])
    robot.log.save(folder=tmp_path)
    (listed,) = runs(tmp_path)
    assert (listed.facts.ticks, [(one.first, one.last) for one in listed.facts.episodes]) == (100, [(21, 70)])
