"""What a recorder tells when there is much to tell, and where what became of it stands."""

import threading
import time
from collections import deque
from types import SimpleNamespace

import pytest

from silo.core.elements import BufferType, RecorderState
from silo.recorder import recorder
from silo.recorder.orders import Finish, News, Progress, Report, encode
from silo.recorder.process import RecorderProcess
from silo.recorder.recorder import Recorder
from silo.recorder.requests import StopRecorder
from silo.recorder.ring_cursor import RingCursor
from silo.recorder.server import EndlessRecordings
from silo.rpc.published import EventKind
from silo.segment.layout import RingSchema
from silo.state.events import EventNotifier
from silo.state.handover import handover_pair


def test_the_last_words_of_one_that_ended_before_it_read_all_are_heard():
    recorder = object.__new__(RecorderProcess)
    recorder.socket, theirs = handover_pair()
    with recorder.socket:
        recorder._send(Finish("closed", 0))
        theirs.send(encode(Report(RecorderState.FAILED, "no room")))
        theirs.close()
        assert recorder.receive() == Report(RecorderState.FAILED, "no room")
        assert recorder.receive() is None


def test_what_was_said_last_is_done_though_who_said_it_had_not_read_all_reports():
    recorder = object.__new__(Recorder)
    recorder._why, (recorder._socket, theirs) = "", handover_pair()
    with recorder._socket:
        recorder._send(Report(RecorderState.RECORDING))
        theirs.send(encode(Finish("closed", 7)))
        theirs.close()
        recorder._listen(0.0)
        assert (recorder._why, recorder._until) == ("closed", 7)


def test_of_a_disk_that_is_too_slow_for_ever_only_losses_are_left_out():
    recorder = object.__new__(Recorder)
    news = deque([News(Report, finished="first.mcap", told_run="run", told_tick=7)])
    news += [News(Report, told="lost 5 rows", told_run="run", told_tick=tick) for tick in range(30)]
    recorder._writing = SimpleNamespace(
        news=news, end_news=News(Report), totals=Progress(RecorderState.RECORDING), open_bytes=0
    )
    recorder._tell_clients("the part that a killed recorder left was damaged")
    news.append(News(Report, done="run"))
    told = [recorder._report() for _ in range(3)]
    assert [(each.finished, each.told, each.done) for each in told] == [
        ("first.mcap", "", ""),
        ("", "the part that a killed recorder left was damaged", ""),
        ("", "", "run"),
    ]


@pytest.mark.parametrize(
    ("last", "place"),
    [
        (Report(RecorderState.DIED, told="lost 5 rows", told_run="before", told_tick=100), ("", None)),
        (Report(RecorderState.FAILED, told_run="run", told_tick=100), ("run", 100)),
        (Report(RecorderState.FAILED, told_run="run"), ("run", None)),
        (Report(RecorderState.ENDED, told_run="asked in", told_tick=100), ("asked in", 100)),
        (Report(RecorderState.ENDED), ("asked in", None)),
        (Report(RecorderState.ENDED, told_run="before", told_tick=100), ("asked in", None)),
    ],
)
def test_the_end_of_a_recording_stands_where_it_ended_not_where_something_was_lost_before(last, place):
    published, failed = [], last.state is not RecorderState.ENDED
    asked_in = "" if failed else "asked in"
    server = object.__new__(EndlessRecordings)
    server._lock = threading.RLock()
    server._events = SimpleNamespace(publish=lambda kind, text, *, by, run, tick: published.append((run, tick)))
    server._held = SimpleNamespace(changed=lambda: None)
    server._store = lambda: None
    server._recorders, server._replica = {}, SimpleNamespace(recorders=1)
    recorder = SimpleNamespace(
        report=last, again_s=0.0, runs=deque(), reported=threading.Event(), ended=threading.Event(),
        order=SimpleNamespace(name="walk"), kept=SimpleNamespace(by="ann", last=asked_in),
        sums=lambda: SimpleNamespace(parts=1, samples=5, lost=5, text="5 lost"),
    )  # fmt: skip
    server._over(recorder, "the disk is full", failed=failed)
    assert published == [place]
    assert recorder.report.state is (RecorderState.FAILED if failed else RecorderState.ENDED)
    assert server._replica.recorders == 0


@pytest.mark.parametrize(("tick", "held", "late_ns"), [(100, True, 3 * 10**8), (None, True, 0), (100, False, 0)])
def test_what_is_told_of_a_tick_has_its_time_by_the_clock_too(tick, held, late_ns, monkeypatch):
    monkeypatch.setattr(time, "time_ns", lambda: 50 * 10**9)
    status, notifier = SimpleNamespace(ticks=221, last_tick_ns=10**9), object.__new__(EventNotifier)
    now = SimpleNamespace(robot=SimpleNamespace(logger="bot"))
    notifier._replica = SimpleNamespace(
        run="run", now=now, status=lambda: status, stamp_of=lambda _: 7 * 10**8 if held else 0
    )
    notifier.log, notifier._put = SimpleNamespace(add=lambda event: event), lambda *_, **__: None
    notifier.files_changed = list
    told = notifier.publish(EventKind.RECORDING, "recording 'walk' ended", tick=tick)
    assert (told.tick, told.time_ns) == (220 if tick is None else tick, 50 * 10**9 - late_ns)


def test_an_end_that_takes_its_time_is_told_until_it_is_over(monkeypatch):
    waits, sent = iter([False, False, True]), []
    totals = SimpleNamespace(state=RecorderState.RECORDING, text="")
    over = SimpleNamespace(is_set=lambda: True, wait=lambda _: next(waits))
    writing = SimpleNamespace(over=over, totals=totals, news=[], start=list, end=list, join=list)
    monkeypatch.setattr(recorder, "Writing", lambda *_: writing)
    ledger = SimpleNamespace(
        written=SimpleNamespace(run="", next_rows={}, runs=[], order=""),
        begin_order=id,
        sums=lambda: SimpleNamespace(gone=2),
    )
    of = SimpleNamespace(
        _order=SimpleNamespace(resume=False, order=None), _told_before=[], _why="it was stopped", _drain=None,
        _look_for_gone=list, _drain_last=list, _settle=list, _send=sent.append,
        _report=lambda: (totals.state.value, totals.text),
    )  # fmt: skip
    assert Recorder._record(of, ledger) is RecorderState.ENDED
    ended = ("ended", "it was stopped; the end of 2 runs is in no file")
    assert sent == [("finishing", ""), ("finishing", ""), ended]


@pytest.mark.parametrize(
    ("state", "why"), [(RecorderState.FAILED, "the disk refused: it is gone; "), (RecorderState.ENDED, "")]
)
def test_who_stops_a_recording_that_had_ended_by_itself_is_told_why(state, why):
    server, ended = object.__new__(EndlessRecordings), threading.Event()
    ended.set()
    server._lock = threading.RLock()
    server._events = SimpleNamespace(log=SimpleNamespace(settle=lambda _: 0))
    server._replica, server._store = SimpleNamespace(run="run"), lambda: None
    recorder = SimpleNamespace(
        report=Report(state, "the disk refused: it is gone"), ended=ended, given_up=False, finish=lambda *_, **__: None,
        order=SimpleNamespace(keep_bytes=0, folder="/logs"), sums=lambda: SimpleNamespace(text="1 file, 0 lost"),
        place=lambda: "/logs/walk.mcap",
    )  # fmt: skip
    server._recorders = {"walk": recorder}
    assert server.end(StopRecorder()) == f"recording 'walk' ended, in /logs/walk.mcap: {why}1 file, 0 lost"
    assert server._recorders == {}


@pytest.mark.parametrize(("ticks", "read", "done"), [(7, 3, False), (7, 4, True), (6, 3, True), (6, 2, False)])
def test_a_run_is_read_to_its_end_once_the_row_of_its_last_tick_is(ticks, read, done):
    ring = RingSchema(1, 2, BufferType.LOOPING, 9, 1, 0)
    of = SimpleNamespace(
        is_over=lambda: True, reader=SimpleNamespace(ticks=ticks, head=lambda _: 9), cursors={1: read},
        layout=SimpleNamespace(rings={1: ring}),
    )  # fmt: skip
    assert RingCursor.done(of) is done
    of.is_over = lambda: False
    assert not RingCursor.done(of)


@pytest.mark.parametrize("taken", [True, False])
def test_limits_of_a_run_that_could_not_be_handed_over_are_told_of_none_before_it(taken):
    server, told = object.__new__(EndlessRecordings), []
    server._held = SimpleNamespace(ids=lambda: ["before", "now"])
    robot = SimpleNamespace(segment="s", conditions="new limits")
    server._replica = SimpleNamespace(run="now", segment="s", now=SimpleNamespace(robot=robot))
    server._hand_over = lambda recorder, run: taken
    recorder = SimpleNamespace(
        known={"before"}, runs=["before"], ending=False, lacks=lambda run: run == "now",
        change=lambda conditions, tick: told.append(conditions),
    )  # fmt: skip
    server._follow(recorder)
    assert told == (["new limits"] if taken else [])
