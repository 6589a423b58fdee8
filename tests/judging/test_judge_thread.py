"""The thread that judges: which run it takes, and when it is done with it."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

import silo
from silo.conditions.judge import Judge, _how_it_ended
from silo.core.elements import LoggedEvent
from silo.errors import SegmentError
from silo.helper import runs
from silo.helper.runs import Runs
from silo.logger.serving.answers import robot_state
from silo.rpc.published import EventKind
from silo.segment.held_runs import judge_path
from silo.state.events import EventLog
from silo.state.handover import RunOffer
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica
from tests.waiting import wait_until


class Events:
    """What is told of a run, kept to oneself."""

    def __init__(self, folder: str) -> None:
        self.log = EventLog(folder, "bot")

    def publish(self, kind: EventKind, text: str, **_: object) -> LoggedEvent:
        return self.log.add(LoggedEvent(kind.value, text, 1, 0, 1, "bot", "", 0))


def spiked(folder: Path) -> tuple[silo.Logger, Callable[[], None]]:
    """A logger with a trigger, and what begins a run in which it fires at the second tick."""
    logger = silo.Logger("bot", max_time=0, folder=folder, script=folder / "none.yaml")
    x = logger.array("x", ())
    logger.trigger("spike", "x > 50", pre="20ms", post="10ms")

    def spike() -> None:
        logger.start(unsaved="clear")
        for value in (1.0, 60.0):
            x[...] = value
            logger.collect()

    return logger, spike


@pytest.mark.slow
def test_a_run_that_it_found_before_it_was_handed_over_is_let_go_of_at_its_end(tmp_path, runtime_folder) -> None:
    logger = silo.Logger("bot", max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    x = logger.array("x", ())
    logger.trigger("spike", "x > 50", pre="20ms", post="10ms")
    logger.start()
    replica = Replica(robot_state(logger, "", -1))
    held = HeldRuns(replica, lambda: None)
    judge = Judge(replica, Events(str(tmp_path)), held)
    judge.start()
    try:
        x[...] = 1.0
        logger.collect()
        run = logger._present.run.id
        descriptor = os.open(logger._present.path, os.O_RDONLY)
        replica.take_run(RunOffer(run, logger._present.path), descriptor)
        held.take()
        wait_until(lambda: judge.standing().run == run)
        judge.take(run)
        assert judge.needs(run)
        replica.let_go()
        wait_until(lambda: not judge.needs(run))
    finally:
        judge.stop("the test is over")
        replica.let_go()
        logger.close()


def test_what_is_judged_is_what_the_program_has_by_now(tmp_path, runtime_folder) -> None:
    logger = silo.Logger("bot", max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    logger.array("x", ())
    logger.start()
    logger.collect()
    replica = Replica(robot_state(logger, "", -1))
    held = HeldRuns(replica, lambda: None)
    replica.take_run(RunOffer(logger._present.run.id, logger._present.path), os.open(logger._present.path, os.O_RDONLY))
    held.take()
    judge = Judge(replica, Events(str(tmp_path)), held)

    def judged() -> list[str]:
        replica.take(robot_state(logger, "", -1))
        judge._step()
        return [one.options.name for one in judge._stands().triggers]

    try:
        assert judged() == []
        logger.trigger("spike", "x > 50", pre="20ms", post="10ms")
        assert judged() == ["spike"]
        known = judge._judge
        assert known is not None
        assert judged() == ["spike"]
        logger.trigger("fall", "x < -50", pre="20ms", post="10ms")
        assert judged() == ["spike", "fall"]
        assert judge._judge is known  # what it has seen so far counts on
        held.note_conditions()  # and who judges it once it is over, knows
        noted = held.conditions(replica.run)
        assert noted is not None
        assert [one.name for one in noted.triggers] == ["spike", "fall"]
    finally:
        replica.let_go()
        held.let_go(held_alone=False)
        logger.close()


def test_what_clients_changed_is_stored_before_they_hear_of_it_and_rows_alone_once_in_a_while(
    tmp_path, runtime_folder, monkeypatch
) -> None:
    monkeypatch.setattr("silo.conditions.memory.KEEP_S", 1e6)
    logger, spike = spiked(tmp_path)
    logger.limit("x", (None, None, 40, 50))
    spike()
    for _ in range(20):  # the capture is whole
        logger.collect()
    present = logger._present
    replica = Replica(robot_state(logger, "", -1))
    held = HeldRuns(replica, lambda: None)
    replica.take_run(RunOffer(present.run.id, present.path), os.open(present.path, os.O_RDONLY))
    held.take()
    judge = Judge(replica, Events(str(tmp_path)), held)
    stored = judge_path("bot", present.run.id)
    try:
        judge._step()
        seen = {stored.read_bytes()}
        logger.collect()
        judge._step()
        assert {stored.read_bytes()} == seen, "nothing happened but rows"
        judge.arm("spike", armed=False)
        seen.add(stored.read_bytes())
        assert judge.acknowledge(["/log/x"], "ann@desk", 1) == 1
        seen.add(stored.read_bytes())
        judge.arm("spike", armed=True)
        seen.add(stored.read_bytes())
        assert judge.force("spike") == 22
        seen.add(stored.read_bytes())
        assert len(seen) == 5
    finally:
        replica.let_go()
        held.let_go(held_alone=False)
        logger.close()


@pytest.mark.parametrize(
    ("error", "says"),
    [(SegmentError("its header is damaged"), "its header is damaged"), (KeyError("x"), "KeyError: 'x'")],
)
def test_a_run_that_cannot_be_opened_is_told_of_once(tmp_path, runtime_folder, monkeypatch, error, says) -> None:
    logger = silo.Logger("bot", max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    replica, events = Replica(robot_state(logger, "", -1)), Events(str(tmp_path))
    held = HeldRuns(replica, lambda: None)
    judge = Judge(replica, events, held)
    looks: list[str] = []

    def damaged(run: str) -> None:
        looks.append(run)
        raise error

    monkeypatch.setattr(replica, "run", "1f")
    monkeypatch.setattr(held, "open", damaged)
    judge.start()
    try:
        wait_until(lambda: len(looks) > 2)
    finally:
        judge.stop("the test is over")
        logger.close()
    told = [event.text for event in events.log.since(0, 1000)[0] if event.kind == EventKind.BLIND.value]
    assert told == [f"triggers and limits of this run are judged no more: {says}"]


@pytest.mark.parametrize("is_due", [False, True])
def test_a_run_that_begins_while_no_file_can_be_opened_is_judged_from_its_first_row_once_one_can(
    tmp_path, runtime_folder, monkeypatch, is_due
) -> None:
    logger, spike = spiked(tmp_path)
    spike()
    replica, events = Replica(robot_state(logger, "", -1)), Events(str(tmp_path))
    held = HeldRuns(replica, lambda: None)
    replica.take_run(RunOffer(logger._present.run.id, logger._present.path), os.open(logger._present.path, os.O_RDONLY))
    held.take()
    judge = Judge(replica, events, held)
    if is_due:
        judge.take(replica.run)
    remembering, tries = judge._remembering, iter([OSError(errno.EMFILE, "no")] * 2)

    def loads() -> object:
        for error in tries:
            raise error
        return remembering()

    monkeypatch.setattr(judge, "_remembering", loads)
    try:
        for _ in range(3):
            judge._guarded()
        told = [(event.kind, event.text) for event in events.log.since(0, 1000)[0]]
        assert told == [(EventKind.TRIGGERED.value, "trigger 'spike' fired at tick 1")]
    finally:
        replica.let_go()
        held.let_go(held_alone=False)
        logger.close()


@pytest.mark.parametrize("fails", ["_catch_up", "_made"])
def test_a_run_that_ended_before_is_judged_or_it_is_told_why_not_where_no_file_can_be_opened(
    tmp_path, runtime_folder, monkeypatch, fails
) -> None:
    logger, spike = spiked(tmp_path)
    spike()
    replica, events = Replica(robot_state(logger, "", -1)), Events(str(tmp_path))
    held, run = HeldRuns(replica, lambda: None), logger._present.run.id
    replica.take_run(RunOffer(run, logger._present.path), os.open(logger._present.path, os.O_RDONLY))
    held.take()
    judge = Judge(replica, events, held)
    judge.take(run, left=True)
    does, tries, done = getattr(judge, fails), iter([OSError(errno.EMFILE, "no")]), list[object]()

    def failing(*given: object) -> object:
        for error in tries:
            raise error
        done.append(given)
        return does(*given)

    monkeypatch.setattr(replica, "run", "")
    monkeypatch.setattr(judge, fails, failing)
    try:
        for _ in range(3):
            judge._guarded()
        fired = "trigger 'spike' fired at tick 1"
        assert len(done) == (fails == "_catch_up")
        why = f"triggers and limits of run {run} are not judged to its end: [Errno {errno.EMFILE}] no"
        assert [event.text for event in events.log.since(0, 1000)[0]] == [fired if done else why]
    finally:
        held.let_go(held_alone=False)
        logger.close()


@pytest.mark.parametrize("is_over", [False, True])
def test_what_is_said_of_a_run_while_it_is_taken_up_is_not_forgotten(tmp_path, runtime_folder, is_over) -> None:
    logger = silo.Logger("bot", max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    x = logger.array("x", ())
    logger.trigger("spike", "x > 50", pre="20ms", post="10ms")
    logger.start()
    x[...] = 1.0
    logger.collect()
    run = logger._present.run.id
    replica = Replica(robot_state(logger, "", -1))
    held = HeldRuns(replica, lambda: None)
    replica.take_run(RunOffer(run, logger._present.path), os.open(logger._present.path, os.O_RDONLY))
    held.take()
    judge = Judge(replica, Events(str(tmp_path)), held)
    taken: list[tuple[str, bool]] = []

    def takes_up(run: str) -> None:
        taken.append((run, False))
        if len(taken) == 1:
            judge.take(run, left=is_over)  # the main thread, at this very moment

    judge._next_run, judge._judge_left = takes_up, lambda reader: taken.append((reader.schema.run, True))
    try:
        judge.take(run)
        judge._step()
        assert judge.needs(run) is is_over
        judge._step()
        assert ((run, True) in taken) is is_over
        assert not judge.needs(run)
    finally:
        replica.let_go()
        held.let_go(held_alone=False)
        logger.close()


@pytest.mark.parametrize("left", [False, True])
def test_a_run_found_at_the_start_is_judged_to_its_end_unless_it_goes_on(monkeypatch, left) -> None:
    taken: list[object] = []
    reader = SimpleNamespace(close=lambda: None)
    held = SimpleNamespace(add=lambda _: None, find=list, ids=lambda: ["1f"], open=lambda _: reader)
    judge = SimpleNamespace(needs=None, take=lambda run, left: taken.append((run, left)))
    marks = SimpleNamespace(take_left=lambda _: taken.append("its marks"))
    recording = SimpleNamespace(needs=None, follow_present=lambda: taken.append("recorded"))
    monkeypatch.setattr(runs, "tell_left", lambda *_: None)
    replica = SimpleNamespace(run="2f" if left else "1f")
    Runs(None, replica, held, None, marks, judge, recording, SimpleNamespace(needs=None), []).begin()
    assert taken == [("1f", left), *(["its marks", "recorded"] if left else [])]


def test_that_a_run_was_cut_is_said_alike_whether_its_end_was_seen_or_found(new_logger) -> None:
    logger = new_logger("bot")
    logger.array("x")
    logger.start()
    logger.collect()
    logger.set("x", divider=2, cut=True)
    logger.collect()
    (before,) = logger._present.cut_off
    assert _how_it_ended(before.reader, "a new run began") == "the run was cut"
    present = logger._present.run.reader
    assert _how_it_ended(present, "a new run began") == "a new run began"
    logger.stop()
    assert _how_it_ended(present, "a new run began") == present.stop_reason
    assert "stop" in present.stop_reason


def test_a_run_that_cannot_be_opened_for_want_of_a_file_is_taken_up_later_and_ends_no_other(
    tmp_path, runtime_folder, monkeypatch
) -> None:
    logger, spike = spiked(tmp_path)
    replica, events = Replica(robot_state(logger, "", -1)), Events(str(tmp_path))
    held = HeldRuns(replica, lambda: None)
    judge = Judge(replica, events, held)

    def begin() -> None:
        spike()
        path = logger._present.path
        replica.take_run(RunOffer(logger._present.run.id, path), os.open(path, os.O_RDONLY))
        held.take()

    def no_file(run: str) -> None:
        raise SegmentError("can't be opened now") from OSError(errno.EMFILE, "no")

    try:
        begin()
        judge.take(replica.run)
        judge._guarded()
        known = judge._judge
        logger.stop()
        begin()
        with monkeypatch.context() as lacking:
            lacking.setattr(held, "open", no_file)
            judge.take(replica.run)
            judge._guarded()
            assert judge._judge is known
            assert judge.needs(replica.run)
        judge._guarded()
        told = [(event.kind, event.text) for event in events.log.since(0, 1000)[0]]
        assert told == [(EventKind.TRIGGERED.value, "trigger 'spike' fired at tick 1")] * 2
    finally:
        replica.let_go()
        held.let_go(held_alone=False)
        logger.close()
