"""Changes wait by what they wait for; what can't be begun in time is refused, of what takes longer the end is told."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from silo.control.authentication import Authentication
from silo.control.denials import Denials
from silo.fleet.exchange import decode_reply, encoded
from silo.helper import lanes
from silo.helper.request_threads import RequestThreads
from silo.net.keys import LOCAL_SENDER, Root
from silo.net.session import close, open_client, open_server
from silo.recorder.requests import StopRecorder
from silo.requests import AddMark, AnyReply, DeleteRecording, KeepView, ReleaseControl, Start
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Done, GoesOn, Lane, Request, spoken
from silo.rpc.refusals import Refused, RefusedWhy
from silo.rpc.serving import Sender, Turn
from silo.state.requests import ApplyEdits
from tests.waiting import DEADLINE_S, wait_until

ROOT = Root("robot", "walker", "1f")


class Answers:
    """What a helper process does: what is for the disk hangs until `disk` is set."""

    def __init__(self) -> None:
        self.disk = threading.Event()
        self.begun: list[str] = []
        self.ends: list[tuple[int, str, str]] = []

    def reply(self, request: Any, turn: Turn | None = None) -> AnyReply:
        name = type(request).__name__
        self.begun.append(name)
        if isinstance(request, KeepView | DeleteRecording):
            assert self.disk.wait(DEADLINE_S)
        return Done(name)

    def number(self) -> int:
        return 7

    def tell_end(self, job: int, request: Any, reply: Any, by: str) -> None:
        self.ends.append((job, type(request).__name__, reply.text))


class Everybody:
    """Nobody has control."""

    def check(self, request: Any, sender: Sender) -> None:
        """It is done."""


class Helper:
    """The control threads of a helper process, and a client's session to it."""

    def __init__(self, folder: Path) -> None:
        self.answers = Answers()
        self.server, path = open_server(folder, "walker", 1, None, ROOT)
        self.control = RequestThreads(  # type: ignore[arg-type]
            self.server, ROOT, self.answers, Authentication(ROOT), Everybody(), lambda *_: None, Denials(), {}
        )
        self.control.start()
        self.client = open_client(path)

    def send(self, request: Request[Any], patience_s: float = DEADLINE_S) -> "zenoh.Handler[zenoh.Reply]":
        payload = encoded(request, clock_s() + patience_s)
        return self.client.get(
            ROOT.do(LOCAL_SENDER), zenoh.handlers.FifoChannel(2), payload=payload, timeout=DEADLINE_S
        )

    def close(self) -> None:
        self.answers.disk.set()
        close(self.client)
        self.control.stop()
        close(self.server)


def told(replies: "zenoh.Handler[zenoh.Reply]") -> AnyReply:
    (reply,) = list(replies)
    return decode_reply(reply.ok.payload.to_bytes(), "it")


@pytest.fixture
def helper(runtime_folder: Path) -> Iterator[Helper]:
    made = Helper(runtime_folder)
    yield made
    made.close()


def test_a_disk_that_hangs_holds_up_neither_marks_nor_control_nor_recorders(helper) -> None:
    hanging = helper.send(KeepView(name="mine", text="x"))
    for request in (AddMark(text="slipped"), ReleaseControl(), StopRecorder()):
        assert told(helper.send(request)) == Done(type(request).__name__)
    helper.answers.disk.set()
    assert told(hanging) == Done("KeepView")


def test_what_does_not_come_to_its_turn_in_time_is_refused_before_its_client_gives_up_and_never_done(helper) -> None:
    hanging = helper.send(KeepView(name="mine", text="x"))
    late = told(helper.send(DeleteRecording(name="walker"), patience_s=0.8))
    assert isinstance(late, Refused)
    assert late.why is RefusedWhy.LATE
    assert "it waited for the robot's disk; nothing was changed; try again" in late.text
    helper.answers.disk.set()
    assert told(hanging) == Done("KeepView")
    assert told(helper.send(DeleteRecording(name="other"))) == Done("DeleteRecording")
    assert helper.answers.begun.count("DeleteRecording") == 1


def test_of_what_was_begun_and_takes_longer_than_its_client_waits_an_event_tells_the_end(helper) -> None:
    going = told(helper.send(KeepView(name="mine", text="x"), patience_s=0.8))
    assert isinstance(going, GoesOn)
    assert going.job == 7
    assert "it waits for the robot's disk" in going.text
    assert helper.answers.ends == []
    helper.answers.disk.set()
    assert wait_until(lambda: helper.answers.ends) == [(7, "KeepView", "KeepView")]


def test_more_than_may_wait_are_refused_at_once(helper, monkeypatch) -> None:
    monkeypatch.setitem(lanes.LIMITS, Lane.DISK, lanes.LaneLimit(count=4))
    waiting = [helper.send(KeepView(name="mine", text="0"))]
    wait_until(lambda: helper.answers.begun)
    waiting += [helper.send(KeepView(name="mine", text=str(number))) for number in range(4)]
    refused = told(helper.send(KeepView(name="mine", text="one more")))
    assert isinstance(refused, Refused)
    assert "wait for the robot's disk already" in refused.text
    helper.answers.disk.set()
    assert [told(one) for one in waiting] == [Done("KeepView")] * 5


def test_a_request_is_called_by_words() -> None:
    assert spoken(ApplyEdits(revision=1, edits=[])) == "apply edits"
    assert spoken(Start()) == "start"


def test_who_is_answered_by_a_helper_process_that_begins_can_also_send_it_a_change(helper) -> None:
    declared: list[str] = []

    class Session:
        def declare_queryable(self, key: str, handler: object) -> "zenoh.Queryable":
            declared.append(key)
            return helper.server.declare_queryable(key, handler)

    RequestThreads(  # type: ignore[arg-type]
        Session(), ROOT, helper.answers, Authentication(ROOT), Everybody(), lambda *_: None, Denials(), {}
    )
    assert sorted(declared) == sorted([ROOT.key("ask"), *Authentication(ROOT).keys])
    assert declared[-1] == ROOT.key("ask")
