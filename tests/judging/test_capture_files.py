"""Captures that two processes know of: written once, whoever comes first, and found written by who comes second."""

import contextlib
import dataclasses
import functools
import os
import threading
import zlib
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

import silo
from silo.conditions import state_file
from silo.conditions.captures.buffer import bytes_per_tick
from silo.conditions.captures.files import write_capture
from silo.conditions.captures.writer import CaptureWriter
from silo.conditions.left_captures import recover_captures
from silo.conditions.segment_judge import SegmentJudge
from silo.conditions.state_file import KeptCapture, begun_state, note_begun, read_state, store_state
from silo.core.elements import Action, BufferType, ElementOptions
from silo.errors import SaveError, SegmentError
from silo.files import naming
from silo.files.atomic import check_room, claimed, sweep_parts
from silo.files.manifest import CaptureList
from silo.recordings import writing
from silo.rpc.published import EventKind
from silo.segment.held_runs import judge_path
from silo.segment.reader import SegmentReader

LONG_S = 1.0  # what the first one waits for may never come: then it goes on


def test_what_a_capture_takes_for_each_tick_is_what_is_saved_without_end_by_its_dividers():
    def ring(row_words, divider, buffer_type=BufferType.LOOPING):
        return SimpleNamespace(row_words=row_words, divider=divider, buffer_type=buffer_type)

    def element(ring, action=Action.SAVE):
        return SimpleNamespace(ring=ring, info=SimpleNamespace(options=ElementOptions(action=action)))

    rings = [ring(2, 1), ring(6, 4), ring(50, 1, BufferType.FIXED), ring(10, 1)]
    elements = [element(1), element(2), element(3, Action.PUBLISH)]
    assert bytes_per_tick(SimpleNamespace(rings=rings, elements=elements)) == 8 * (2 + 6 / 4)


@pytest.fixture
def signal():
    return np.zeros(())


@pytest.fixture
def robot(tmp_path, runtime_folder, signal):
    """A logger of which one spike was captured, by a judge without a helper process."""
    logger = silo.Logger("bot", frequency=1000, max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    logger.add(signal, "x", size=3000)
    logger.trigger("spike", "x > 50", pre="20ms", post="10ms", save=["silo", "csv"])
    logger.start()
    for tick in range(500):
        signal[...] = 100.0 if tick == 300 else 0.0
        logger.collect()
    yield logger
    logger.close()


def judge_of(robot):
    return SegmentJudge(SegmentReader(robot._present.path), robot.elements)


def orphaned(state):
    """What a judge stored, as if its logger was gone."""
    program = msgspec.structs.replace(state.program, logger_id="")
    return msgspec.structs.replace(state, pid_start=state.pid_start + 1, program=program)


def twice(robot, folder):
    """What two processes make of one capture: the second begins as soon as the first is within."""

    def write(number):
        (buffer,) = judge_of(robot).step().whole
        return write_capture(buffer, str(folder), CaptureList(str(folder), "bot"), []).files

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(write, range(2)))


@pytest.mark.slow
def test_two_that_begin_a_capture_at_once_give_it_one_name(robot, tmp_path, monkeypatch):
    both, number = threading.Barrier(2), naming.next_run_number

    def counted(*arguments):
        with contextlib.suppress(threading.BrokenBarrierError):  # the other one waits for us
            both.wait(LONG_S)
        return number(*arguments)

    monkeypatch.setattr(naming, "next_run_number", counted)
    one, other = twice(robot, tmp_path)
    assert one == other
    assert len(list(tmp_path.glob("bot_*_spike_1.silo"))) == 1


@pytest.mark.slow
def test_who_comes_while_another_process_writes_a_capture_finds_it_written(robot, tmp_path, monkeypatch):
    write_apart, both = writing.write_apart, threading.Barrier(2)

    def slow(*arguments):
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(LONG_S)
        return write_apart(*arguments)

    monkeypatch.setattr(writing, "write_apart", slow)
    one, other = twice(robot, tmp_path)
    assert one == other
    assert sorted(path.suffix for path in tmp_path.glob("bot_*_spike_1*")) == [".csv", ".json", ".silo"]


def test_what_another_process_has_claimed_for_long_is_refused_in_words(tmp_path):
    with claimed(tmp_path, "capture 1", 1.0), pytest.raises(SaveError, match=r"writing capture 1 for 0.1 s"):  # noqa: SIM117
        with claimed(tmp_path, "capture 1", 0.1):
            pass
    assert list(tmp_path.iterdir()) == []


def test_a_claim_is_kept_up_by_who_inherits_it_and_swept_after_them(tmp_path):
    kept = -1
    with claimed(tmp_path, "capture 1", 1.0) as claim:
        kept = os.dup(claim)
        (path,) = tmp_path.iterdir()
        copy = path.with_name("copy")
        os.link(path, copy)
    copy.rename(path)  # as it stands where the one who claimed it was killed
    assert sweep_parts(tmp_path) == []
    with pytest.raises(SaveError), claimed(tmp_path, "capture 1", 0.1):
        pass
    os.close(kept)
    assert sweep_parts(tmp_path) == [path]


def test_an_episode_whose_end_was_not_told_yet_is_not_taken_for_one_that_a_capture_lies_in(robot, signal, tmp_path):
    judge = judge_of(robot)
    with robot.episode("walk"):
        robot.collect()
        told = judge.reader.stamped_marks()
    with robot.episode("pick"):
        for tick in range(200):
            signal[...] = 100.0 if tick == 100 else 0.0
            robot.collect()
    *_, buffer = judge.step().whole
    assert [one.name for one in silo.Log(buffer.recording(told)).episodes] == ["pick"]


@pytest.mark.slow
def test_a_capture_that_was_written_is_not_written_again_where_another_folder_is_asked_for(robot, tmp_path):
    judge = judge_of(robot)
    (buffer,) = judge.step().whole
    write_capture(buffer, str(tmp_path), CaptureList(str(tmp_path), "bot"), [])
    state = judge.state([KeptCapture(buffer.options, buffer.capture)], [], closed=False)
    store_state(judge_path("bot", state.run), orphaned(state))
    other = tmp_path / "other"
    other.mkdir()
    assert recover_captures(judge.reader, str(other)).files == []
    assert list(other.glob("*.silo")) == []


@pytest.mark.slow
@pytest.mark.parametrize("is_told", [True, False])
def test_what_holds_over_a_cut_that_nobody_judged_is_judged_on(robot, signal, tmp_path, is_told):
    robot.stop()
    robot.trigger("long", "x > 50", persist="10ms", pre="1ms", post="1ms")
    robot.start()
    for tick in range(20):
        if tick == 10:
            robot.set("x", size=2000, cut=True)
        signal[...] = 100.0 if 4 <= tick < 16 else 0.0
        robot.collect()
    readers = [SegmentReader(run.segment.path) for run in robot._present.stretches]
    for one in readers:
        store_state(judge_path("bot", one.schema.run), orphaned(begun_state(one.schema)))
    before = recover_captures(readers[0], str(tmp_path))
    found = recover_captures(readers[1], str(tmp_path), before.judge if is_told else None)
    assert ["_long_" in file.path for file in found.files] == [True] * is_told
    assert any("'long'" in text for text in found.texts) == is_told


@pytest.mark.slow
def test_of_many_captures_that_are_recovered_some_are_named_and_the_others_counted(robot, tmp_path):
    judge = judge_of(robot)
    (buffer,) = judge.step().whole
    waiting = [
        KeptCapture(buffer.options, dataclasses.replace(buffer.capture, number=number)) for number in range(1, 8)
    ]
    state = judge.state(waiting, [], closed=True)
    store_state(judge_path("bot", state.run), orphaned(state))
    found = recover_captures(judge.reader, str(tmp_path))
    assert len(found.files) == 14  # in two formats
    told = "; ".join(found.texts)
    assert (told.count("capture "), told.endswith(" and 4 more")) == (3, True)


def test_what_a_judge_stores_while_its_run_is_noted_as_begun_stays(robot, monkeypatch):
    judge = judge_of(robot)
    judge.step()
    path, write = judge_path("bot", judge.reader.schema.run), state_file.write_private
    stored = threading.Thread(target=store_state, args=(path, judge.state([], [], closed=False)))

    def while_another_writes(path, body):
        if not stored.ident:
            stored.start()
            stored.join(LONG_S)
        write(path, body)

    monkeypatch.setattr(state_file, "write_private", while_another_writes)
    note_begun(judge.reader.schema)
    stored.join()
    assert read_state(path).until == 500
    magic, body = path.read_bytes()[: len(state_file._MAGIC)], b"\xc1"
    for text, words in (
        (magic + b"1234" + body, "damaged, or of another silo"),
        (magic + zlib.crc32(body).to_bytes(4, "little") + body,
         r"damaged (MessagePack data is malformed: invalid opcode '\xc1' (byte 0))"),
    ):  # fmt: skip
        path.write_bytes(text)
        with pytest.raises(SegmentError) as damaged:
            read_state(path)
        assert str(damaged.value) == f"{path}: the state of the triggers is {words}"


@pytest.mark.slow
def test_captures_leave_others_room_on_the_disk_and_those_left_out_are_told_together(robot, tmp_path, monkeypatch):
    room, told = [10**9], []
    check = functools.partial(check_room, room=lambda _: (room[0], 10**9))
    monkeypatch.setattr("silo.conditions.captures.files.check_room", check)
    monkeypatch.setattr("silo.conditions.captures.writer.TOLD_S", 0.0)
    events = SimpleNamespace(
        publish=lambda kind, text, **_: told.append((kind, text)),
        log=SimpleNamespace(of_run=lambda _: (), texts=lambda *_: (), settle=lambda _: None),
    )
    writer = CaptureWriter(SimpleNamespace(now=SimpleNamespace(robot=SimpleNamespace(folder=str(tmp_path)))), events)
    (first,) = judge_of(robot).step().whole
    writer._guarded(first)
    assert [kind for kind, _ in told] == [EventKind.CAPTURED]
    room[0] = 20_000_000
    told.clear()
    for number in (2, 3):
        (buffer,) = judge_of(robot).step().whole
        buffer.capture = dataclasses.replace(buffer.capture, number=number)
        writer._guarded(buffer)
    writer._tell_left_out(writer._waiting.done())
    (kind, begun), (_, sum_of_both) = told
    assert kind is EventKind.SAVE_FAILED
    assert "captures of trigger 'spike' are left out from here on" in begun
    assert "nearly full: 20 MB are free, and 20 MB of it are left to others" in begun
    assert sum_of_both.startswith("2 captures, numbers 2 to 3, of 'spike' not written: the disk of")
    assert len(list(tmp_path.glob("*_spike_*.silo"))) == 1


@pytest.mark.slow
def test_a_capture_is_waiting_for_until_the_line_that_tells_of_it_is_on_the_disk(robot, tmp_path):
    """Else a kill in between lost the line: the successor knew the capture as written and told nothing."""
    seen = []
    log = SimpleNamespace(
        of_run=lambda _: (), texts=lambda *_: (), settle=lambda _: seen.append(("settled", writer.waiting()))
    )
    events = SimpleNamespace(publish=lambda kind, *_, **__: seen.append((kind, writer.waiting())), log=log)
    writer = CaptureWriter(SimpleNamespace(now=SimpleNamespace(robot=SimpleNamespace(folder=str(tmp_path)))), events)
    (first,) = judge_of(robot).step().whole
    writer.add(first)
    writer.start()
    writer.stop()
    assert seen == [(EventKind.CAPTURED, [first]), ("settled", [first])]
    assert writer.waiting() == []
