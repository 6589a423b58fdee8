"""The thread that judges: which run it takes, and when it is done with it."""

import os

import pytest

import silo
from silo.conditions.monitor import Judge
from silo.core.elements import LoggedEvent
from silo.errors import SegmentError
from silo.logger.serving.answers import robot_state
from silo.rpc.published import EventKind
from silo.state.event_log import EventLog
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


def test_a_run_that_cannot_be_opened_is_told_of_once(tmp_path, runtime_folder, monkeypatch) -> None:
    logger = silo.Logger("bot", max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
    replica, events = Replica(robot_state(logger, "", -1)), Events(str(tmp_path))
    held = HeldRuns(replica, lambda: None)
    judge = Judge(replica, events, held)
    looks: list[str] = []

    def damaged(run: str) -> None:
        looks.append(run)
        raise SegmentError("its header is damaged")

    monkeypatch.setattr(replica, "run", "1f")
    monkeypatch.setattr(held, "open", damaged)
    judge.start()
    try:
        wait_until(lambda: len(looks) > 2)
    finally:
        judge.stop("the test is over")
        logger.close()
    told = [event.text for event in events.log.since(0, 1000)[0] if event.kind == EventKind.BLIND.value]
    assert told == ["triggers and limits of this run are judged no more: its header is damaged"]
