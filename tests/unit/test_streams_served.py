"""What the frames of a stream hold: a stream begins with what comes, and leaves nothing out from then on."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from silo.errors import SegmentError
from silo.history.requests import OpenStream, StreamFrame
from silo.live import feeds, streams
from silo.live.feeds import Feeds, Round
from silo.live.publisher import MOST_BEHIND_BYTES, Publisher
from silo.live.streams import ServedStream
from silo.logger.serving.answers import robot_state
from silo.segment.reader import SegmentReader
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica


def at_once(_: str, present: SegmentReader) -> SegmentReader:
    """No run began and ended between two looks."""
    return present


def test_a_stream_goes_on_as_the_table_changes_and_has_a_new_run_from_its_first_row_on(new_logger, monkeypatch):
    log = new_logger("bot", frequency=100)
    log.array("x")
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x", "/log/gone"]), None, 0.0, at_once)

    def came(ticks, generation):
        for _ in range(ticks):
            log.collect()
        now, reader = (
            replace(Replica(robot_state(log, "", -1)).now, generation=generation),
            SegmentReader(log._present.path),
        )
        this = Round(now, reader, 0.0, 100.0, 0.0)
        stream.prepare(this)
        data, more = stream.frame(this)
        rows = msgspec.msgpack.decode(data, type=StreamFrame).rows if data else []
        return [(one.first, one.count) for one in rows], more

    log.start()
    assert came(3, 1) == ([], False)
    assert came(2, 1) == ([(3, 2)], False)
    assert came(2, 2) == ([(5, 2)], False)
    log.restart()
    assert came(4, 2) == ([(0, 4)], False)
    assert came(0, 2) == ([], False)
    # clients read all of it by the same words
    assert (stream.opened.generation, stream.opened.missing) == (0, {"/log/gone": "it is no longer in the table"})
    assert stream.told(0) == stream.opened
    monkeypatch.setattr(streams, "MAX_FRAME_BYTES", 2 * 24 + 1)
    assert came(3, 2) == ([(4, 2)], True)
    assert came(0, 2) == ([(6, 1)], False)


def test_each_frame_tells_how_many_rows_there_were_to_come_before_its_run(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x", size=10, buffer="looping")
    log.start()
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x"]), None, 0.0, at_once)

    def came(ticks):
        for _ in range(ticks):
            log.collect()
        this = Round(Replica(robot_state(log, "", -1)).now, SegmentReader(log._present.path), 0.0, 100.0, 0.0)
        stream.prepare(this)
        data, _ = stream.frame(this)
        frame = msgspec.msgpack.decode(data, type=StreamFrame) if data else None
        return frame and (frame.earlier, [(one.first, one.count) for one in frame.rows])

    assert came(3) is None  # it begins with what comes
    assert came(2) == (0, [(3, 2)])
    capacity = log._present.run.segment.schema.rings[-1].capacity
    assert came(capacity + 4) == (0, [(10, capacity - 1)])  # the others are overwritten
    log.restart()
    assert came(3) == (2 + 4 + capacity, [(0, 3)])
    log.restart()
    assert came(2) == (2 + 4 + capacity + 3, [(0, 2)])


def test_a_client_is_told_how_to_read_what_was_sent_since_it_asked(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x"]), None, 0.0, at_once)
    for generation in range(12):
        log.collect()
        log.set("x", divider=2 + generation, cut=True)
        now = replace(Replica(robot_state(log, "", -1)).now, generation=generation)
        stream.adopt(now, SegmentReader(log._present.path))
    told = stream.told(8)
    assert ([one.generation for one in told.earlier], told.generation) == ([9, 10], 11)
    assert [one.names[0].divider for one in told.earlier] == [11, 12]
    assert [one.generation for one in stream.told(0).earlier] == [4, 5, 6, 7, 8, 9, 10]
    assert stream.told(-1).earlier == []


def test_a_run_that_is_cut_or_ends_is_sent_to_its_end_before_the_next_one(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x")
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x"]), None, 0.0, at_once)
    runs = []

    def came(ticks=0, now_s=0.0):
        """What the next frame has: the number of its run, the first row, and how many; and if there is more."""
        for _ in range(ticks):
            log.collect()
        this = Round(Replica(robot_state(log, "", -1)).now, SegmentReader(log._present.path), now_s, 100.0, 0.0)
        stream.prepare(this)
        data, more = stream.frame(this)
        frame = msgspec.msgpack.decode(data, type=StreamFrame) if data else None
        if frame is not None and frame.run not in runs:
            runs.append(frame.run)
        return [(runs.index(frame.run), one.first, one.count) for one in frame.rows] if frame else [], more

    def cut(divider):
        for _ in range(3):
            log.collect()
        log.set("x", divider=divider, cut=True)

    log.start()
    assert came() == ([], False)
    assert came(2) == ([(0, 0, 2)], False)
    cut(2)
    assert came() == ([(0, 2, 3)], False), "a tick may be under way yet"
    assert came() == ([], False)
    assert came(2) == ([(1, 0, 1)], False)
    cut(1)
    assert came(1) == ([(1, 1, 2)], True), "the rest comes at once"
    assert came() == ([(2, 0, 1)], False)
    cut(2)
    assert came(now_s=1.0) == ([(2, 1, 3)], False)
    assert came(now_s=3.0) == ([], False), "a loop that is paused ends nothing, and holds nothing up"
    assert stream._run == log._present.run.id
    log.collect()
    log.restart()
    assert came(4) == ([(3, 0, 1)], True)
    assert came() == ([(4, 0, 2)], False)


def test_who_had_a_stream_before_goes_on_where_it_was_as_far_back_as_is_carried(new_logger, monkeypatch):
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.array("slow", divider=2)
    log.start()
    for _ in range(10):
        log.collect()
    now, reader = Replica(robot_state(log, "", -1)).now, SegmentReader(log._present.path)

    def begins(**asked):
        stream = ServedStream(OpenStream(stream="a-1", names=["/log/x", "/log/slow"], **asked), None, 0.0, at_once)
        stream.adopt(now, reader)
        data, _ = stream.frame(Round(now, reader, 0.0, 100.0, 0.0))
        return [(one.first, one.count) for one in msgspec.msgpack.decode(data, type=StreamFrame).rows] if data else []

    run, rows = log._present.run.id, {"/log/x": [7], "/log/slow": [5]}
    assert begins() == []
    assert begins(run=run, rows=rows) == [(7, 3)]
    assert begins(run=run, rows={"/log/slow": [0], "/log/x": [-1]}) == [(0, 5)], "of others what comes"
    assert begins(run=run, rows={"/log/x": [99]}) == [], "no row that isn't there yet is waited for"
    assert begins(run="another", rows=rows) == begins(run="-") == [(0, 10), (0, 5)]
    assert begins(run=run) == []
    monkeypatch.setattr(streams, "BEHIND_BYTES", 2 * 24 * 2)
    assert begins(run="another", rows=rows) == [(8, 2), (3, 2)]


def test_who_had_a_stream_before_is_told_once_of_the_runs_that_came_and_went_meanwhile(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.array("slow", divider=2)
    log.start()
    now, reader = Replica(robot_state(log, "", -1)).now, SegmentReader(log._present.path)
    over = [("before", 90), ("known", 80), ("a", 5), ("b", 2)]

    def told(run):
        stream = ServedStream(OpenStream(stream="a-1", names=["/log/x", "/log/slow"], run=run), None, 0.0, at_once)
        stream.adopt(now, reader)
        stream.count_missed([*over, (log._present.run.id, 70)])
        return [stream.told(-1).missed for _ in range(2)]

    assert told("known") == [5 + 3 + 2 + 1, 0]
    assert told("b") == told("gone") == told("") == told(log._present.run.id) == [0, 0]


def test_a_run_that_is_over_is_sent_at_once_so_that_its_memory_goes(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    log.collect()
    now = Replica(robot_state(log, "", -1)).now
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x"], period_s=10.0), None, 0.0, at_once)
    stream.adopt(now, SegmentReader(log._present.path))
    stream.due_s = 10.0
    assert not stream.is_due(Round(now, SegmentReader(log._present.path), 1.0))
    log.restart()
    assert stream.is_due(Round(now, SegmentReader(log._present.path), 1.0))


def test_of_runs_that_wait_for_a_stream_the_oldest_make_room_and_the_next_one_is_read(new_logger):
    held = HeldRuns(Replica(robot_state(new_logger("bot"), "", -1)), lambda: None)
    for number, run in enumerate("WXABCP"):
        held._add(SimpleNamespace(schema=SimpleNamespace(run=run), path=Path(f"bot.1.{number}.segment")))
    read, present = {"X"}, SimpleNamespace(schema=SimpleNamespace(run="P"))
    held.size_bytes = lambda runs: MOST_BEHIND_BYTES // 3 * len(list(runs))
    publisher = SimpleNamespace(_held=held, _now_read=lambda: read)
    held.open = lambda run: run
    assert held.between("X", present) == "A"
    for run in "WXABC":
        if not Publisher.needs(publisher, run):
            del held._runs[run]
    assert held.ids() == ["A", "B", "C", "P"], "W is before the one that is read, X too much"
    assert [held.between(run, present) for run in "XABC?"] == ["A", "B", "C", present, present]
    read.clear()
    assert not Publisher.needs(publisher, "C")


def test_who_does_not_listen_yet_is_sent_nothing_and_not_asked_for_again_at_once(monkeypatch):
    monkeypatch.setattr(feeds, "matching", lambda _: False)
    feed = SimpleNamespace(prepare=lambda _: None, publisher=None, frame=lambda _: pytest.fail("made for nobody"))
    assert Feeds._send(SimpleNamespace(kind="view"), "a-1", feed, None) is False


def test_a_run_that_can_not_be_read_is_told_of_once(caplog):
    rounds = iter(["cut short", "cut short", "gone", "gone"])

    def fails(_: float) -> float:
        problem = next(rounds, None)
        publisher._ending = problem is None
        raise SegmentError(problem or "gone")

    publisher = SimpleNamespace(
        _ending=False, _told="", _round=fails, _begin_anew=lambda now_s: now_s, views=SimpleNamespace(stop=list),
        streams=SimpleNamespace(stop=list), _wake=SimpleNamespace(wait=lambda _: None, clear=list),
    )  # fmt: skip
    Publisher._run(publisher)
    assert caplog.messages == [f"publishing failed, trying again: {problem}" for problem in ("cut short", "gone")]
