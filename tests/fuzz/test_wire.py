"""Damaged requests, replies and events: whatever they hold, they get words for an answer, and no thread ends.

2,000 requests; `SILO_FUZZ=100000` takes so many. The number of one that failed makes it again. The helper's own objects
answer in this process, with a real logger at the other end of their link.
"""

import logging
import os
import random
import re
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import silo
from silo.conditions.judge import Judge
from silo.control.requests import TakeControl
from silo.control.server import ControlLock
from silo.core.conditions import Derived, SignalLimits, TriggerOptions
from silo.core.elements import Edit, ElementOptions, FileType, Problem, SavedFile, Sought, Table
from silo.core.tuning.parameters import Excitation, Wave
from silo.errors import SiloError
from silo.fleet.exchange import decode_reply, encoded
from silo.helper.request_threads import Servers
from silo.helper.robot_link import RobotLink
from silo.helper.saver import Saver
from silo.history.requests import (
    By,
    ClosePin,
    CloseStream,
    Columns,
    GetHistory,
    GetSamples,
    KeepPin,
    OpenPin,
    OpenStream,
)
from silo.history.search_requests import FindMoments, MeasureSpan
from silo.link.channel import LinkChannel, LinkReply, LinkRequest
from silo.live.publisher import Publisher
from silo.live.requests import CloseView, GetSurvey, OpenView, ViewOpened
from silo.logger.serving.answers import answer, robot_state
from silo.net.keys import Root
from silo.net.session import close, open_server
from silo.recorder.requests import StartRecorder, StopRecorder
from silo.recorder.server import EndlessRecordings
from silo.recordings.requests import GetPiece, Save
from silo.requests import (
    Acknowledge,
    AddMark,
    ArmTrigger,
    ConfirmParameters,
    DeleteRecording,
    DiffScript,
    Excite,
    ForceTrigger,
    GetEvents,
    GetLimits,
    GetParts,
    GetStatus,
    GetTable,
    GetTriggers,
    GiveControl,
    KeepExcitation,
    KeepView,
    ListKeptViews,
    ListParameters,
    ListRecorders,
    ListRecordings,
    ListScripts,
    LoadScript,
    ReadKeptView,
    ReadParameters,
    ReadScript,
    ReleaseControl,
    RemoveDerived,
    RemoveLimits,
    RemoveTrigger,
    Restart,
    SaveScript,
    SetDerived,
    SetLimits,
    SetParameters,
    SetTrigger,
    Start,
    Stop,
    StopExcitation,
    TryTrigger,
    decode_ask,
    decode_do,
)
from silo.rpc.declaring import Request, leaves
from silo.rpc.published import Event, EventKind
from silo.rpc.refusals import Refused, RefusedWhy, answered
from silo.state.events import EventLog, EventNotifier
from silo.state.handover import ChangeCount, RobotState, handover_pair
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica
from silo.state.requests import ApplyEdits, GetSummary, Hello, HelloReply, StatusReply, Unsaved
from silo.state.table_parts import TableReply

NASTY: list[Any] = [
    None, True, 0, -1, 1, 2**31, 2**62, 2**63 - 1, -(2**63), 2**64 - 1, 0.0, -0.0, 1e308, float("nan"), float("inf"),
    "", "/", "..", "../../x", "/log/x", "/log/q_x", "\x00", "\x1b[2J", "x" * 5000, "é\U0001f916", "a-1", b"",
    b"\xff" * 9, [], [None], ["/log/x"] * 70, [0, 1, 2], {}, {"a": 1}, {"name": "/log/x", "options": {}},
    [{"name": "/log/x", "options": {"divider": 0}}], [[[[[]]]]],
]  # fmt: skip
KINDS = [kind.__name__ for kind in leaves(Request)]
RAW = re.compile(r"\b[A-Z]\w*(Error|Exception|Exit|Interrupt): ")
STEM = 1_700_000_000_000_000_000

GOOD: list[Request[Any]] = [
    Hello(version="0.1.0"), GetStatus(), GetSummary(), GetTable(), ListScripts(), ReadScript(path="none.yaml"),
    ReadScript(), DiffScript(path="good.yaml"),
    GetHistory(names=["/log/x", "/log/q_1"], start_ns=STEM, end_ns=STEM + 10**9, column_ns=10**7),
    OpenView(view="abc-1", values=["/log/x", "/log/q"], plots=["/log/x", "/log/q_2"], rate_hz=30.0, column_ns=10**7),
    OpenView(view="abc-2", values=["/log/q"], plots=[], rate_hz=30.0), CloseView(view="abc-1"),
    GetSamples(names=["/log/x", "/log/q_1"], start=5, end=50, by=By.TICK), GetSamples(names=["/log/q"], pin="abc-1"),
    GetSurvey(quantities=["mean", "signs"], names=["/log/x", "/log/q_1"]), GetSurvey(quantities=["value"], reset=True),
    GetSamples(names=["/log/x"], run="a", resume=[(0, 9)]), OpenStream(stream="abc-1", names=["/log/x", "/log/q_2"]),
    CloseStream(stream="abc-1"), OpenPin(pin="abc-1", names=["/log/q"], start_ns=STEM, end_ns=STEM + 10**9),
    FindMoments(names=["/log/x", "/log/q_1"], what=Sought.HIGHEST), FindMoments(names=["/log/x"], what=Sought.CROSSING,
    level=0.5, direction=1, around_ns=STEM, most=3, pins=["abc-1"], bounds=[(None, 2.0)]),
    MeasureSpan(names=["/log/x", "/log/q_1"], a_ns=STEM, b_ns=STEM + 10**9, pins=["abc-1"]),
    KeepPin(pin="abc-1"), ClosePin(pin="abc-2"),
    ApplyEdits(revision=-1, edits=[Edit("/log/x", ElementOptions(divider=2)), Edit("/log/q", ElementOptions())]),
    ListKeptViews(), KeepView(name="walk", text="sort: div", overwrite=True), ReadKeptView(name="walk"),
    Start(), Start(unsaved=Unsaved.DISCARD), Stop(), Restart(unsaved=Unsaved.DISCARD), Restart(),
    ListRecordings(), ListRecordings(most=10), GetParts(name="fuzz.silo"), DeleteRecording(name="fuzz"),
    GetPiece(path="fuzz.silo", mark="abc", offset=0, count=100),
    Save(types=[FileType.SILO], name="fuzz"), LoadScript(path="good.yaml"), SaveScript(path="new.yaml"),
    # one that is refused as it stands: no process is started for what is wrong in another way
    StartRecorder(name="fuzz", folder="fuzz", patterns=["/log/x"], split_bytes=1), StopRecorder(name="fuzz"),
    ListRecorders(), GetEvents(since=0, limit=10), AddMark(text="slipped"), AddMark(text="slipped", tick=0),
    GetTriggers(), GetLimits(), Acknowledge(names=["/log/x"], who="ann"), Acknowledge(),
    SetTrigger(trigger=TriggerOptions(name="fuzz", when="x > 2")),
    SetTrigger(trigger=TriggerOptions("scope", "x > 2", mode="auto", save=(), patience_s=0.5), lease_s=5.0),
    ArmTrigger(name="fuzz", armed=False),
    TryTrigger(trigger=TriggerOptions(name="fuzz", when="abs(q_1) > 2 or x > 1")), ForceTrigger(name="fuzz"),
    SetDerived(derived=Derived("fuzz", "2 * x", "V")), RemoveDerived(name="fuzz"),
    RemoveTrigger(name="fuzz"), SetLimits(limits=SignalLimits(name="/log/x", bounds=(-2.0, -1.0, 1.0, 2.0))),
    RemoveLimits(name="/log/x"), TakeControl(), TakeControl(force=True, lease_s=2.0), GiveControl(to="ann"),
    ReleaseControl(), ListParameters(), ReadParameters(),
    SetParameters(values={"kp": 2.0}, name="fuzz", revert_after_s=5.0), ConfirmParameters(name="fuzz"),
    Excite(what=Excitation("kp", Wave.CHIRP, 1.0, 0.5, 1.0, 20.0, 0.1), name="fuzz"), KeepExcitation(name="fuzz"),
    StopExcitation(name="fuzz"), StopExcitation(why="fuzz"),
]  # fmt: skip


def mutated(payload: bytes, rng: random.Random) -> bytes:
    """The bytes of a message with one to three things wrong: in what they say, or in the bytes themselves."""
    if rng.random() < 0.6:
        value = msgspec.msgpack.decode(payload)
        for _ in range(rng.randint(1, 3)):
            value = _changed(value, rng)
        payload = msgspec.msgpack.encode(value)
    else:
        for _ in range(rng.randint(1, 3)):
            payload = _damaged(payload, rng)
    return payload


def _changed(value: Any, rng: random.Random) -> Any:
    if isinstance(value, dict) and value:
        key = rng.choice(list(value))
        how = rng.randrange(6)
        if how == 0:
            return {name: each for name, each in value.items() if name != key}
        if how == 1:
            return {**value, rng.choice(["more", "type", "client", "names"]): rng.choice(NASTY)}
        if how == 2 and "type" in value:
            return {**value, "type": rng.choice(KINDS)}
        return {**value, key: _changed(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = rng.randrange(len(value))
        return [*value[:place], _changed(value[place], rng), *value[place + rng.randint(0, 1) :]]
    return rng.choice(NASTY)


def _damaged(data: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(data)) if data else 0
    how = rng.randrange(4)
    if how == 0 and data:
        return data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :]
    if how == 1:
        return data[:place]
    if how == 2:
        return data[:place] + rng.randbytes(rng.randint(1, 9)) + data[place:]
    return data[:place] + data[place + rng.randint(1, 9) :]


class Bench:
    """The parts of a helper process, and the robot program that it serves, as threads of this process."""

    def __init__(self, folder: Path) -> None:
        (folder / "scripts").mkdir()
        (folder / "scripts" / "good.yaml").write_text("log_elements:\n  - name: /log/x\n    divider: 3\n")
        self.logger = silo.Logger("fuzz", folder=folder / "logs", script=folder / "scripts" / "own.yaml", max_time=1)
        for name, shape in (("x", ()), ("q", 3)):
            self.logger.array(name, shape, action=silo.Action.SAVE_AND_PUBLISH)
        self.logger.parameter("kp", 1.0, min=0, max=10)
        self.logger.update()
        mine, theirs = socket.socketpair()
        runs, self.runs = handover_pair()
        self.channel = LinkChannel(theirs)
        self.robot = RobotLink(mine, runs, ChangeCount())
        self.session, self.path = open_server(Path(os.environ["SILO_RUNTIME_DIR"]), "fuzz", os.getpid())
        self.replica = Replica(robot_state(self.logger, "", -1))
        root = Root(self.replica.host, "fuzz")
        events = EventNotifier(self.session, root, self.replica, EventLog(str(folder), "fuzz"))
        held = HeldRuns(self.replica, lambda: None)
        self.publisher = Publisher(self.session, root, self.replica, events, held)
        self.saver = Saver(self.replica, events, self.robot)
        self.recording = EndlessRecordings(self.replica, events, held)
        judge = Judge(self.replica, events, held)
        self.servers = Servers(
            self.replica,
            events,
            self.publisher,
            self.saver,
            self.robot,
            judge,
            self.recording,
            ControlLock(events, self.replica, root, "fuzz"),
        )
        self.frames = self.session.declare_subscriber(root.key("view", "*"), lambda _: None)
        self.publisher.start()
        self.saver.start()
        self.threads = [threading.Thread(target=run) for run in (self._robot_program, self._follow)]
        for thread in self.threads:
            thread.start()
        self._sockets = (mine, theirs)

    def _robot_program(self) -> None:
        while (message := self.channel.receive()) is not None:
            if isinstance(message, LinkRequest):
                reply = answer(self.logger, message.request)
                self.channel.send(robot_state(self.logger, "", -1))
                self.channel.send(LinkReply(message.number, reply))

    def _follow(self) -> None:
        while (message := self.robot.receive()) is not None:
            if isinstance(message, RobotState):
                self.replica.take(message)
            elif isinstance(message, LinkReply):
                self.robot.answered(message)

    def alive(self) -> bool:
        names = {"publisher", "saver"} | {thread.name for thread in self.threads}
        return names <= {thread.name for thread in threading.enumerate()}

    def end(self) -> None:
        self.publisher.stop()
        self.saver.stop()
        for end in self._sockets:
            end.shutdown(socket.SHUT_RDWR)
        for thread in self.threads:
            thread.join()
        close(self.session)
        self.logger.close()
        for end in self._sockets:
            end.close()


class Raised(logging.Handler):
    """What was logged with an exception: some thread met one that it has no words for."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info:
            self.texts.append(self.format(record))


@pytest.fixture
def raised() -> Iterator[list[str]]:
    handler = Raised()
    for name in ("silo", "silo.helper", "silo.client"):
        logging.getLogger(name).addHandler(handler)
    yield handler.texts
    for name in ("silo", "silo.helper", "silo.client"):
        logging.getLogger(name).removeHandler(handler)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.end()


def problem_of(bench: Bench, payload: bytes, key: str, undecoded: list[bytes] | None = None) -> str:
    """What is wrong with the answer to some bytes; empty for one in words."""
    request = answered(lambda: decode_ask(payload) if key == "ask" else decode_do(payload))
    if isinstance(request, Refused) and undecoded is not None:
        undecoded.append(payload)
    found = request if isinstance(request, Refused) else answered(lambda: bench.servers.reply(request))
    reply = decode_reply(found if isinstance(found, bytes) else msgspec.msgpack.encode(found), "the helper process")
    if isinstance(reply, Refused):
        return f"raw: {reply.text}" if RAW.search(reply.text) or not reply.text else ""
    return ""


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.timeout(1800)
def test_every_damaged_request_gets_an_answer_in_words(bench, raised, numbers) -> None:
    failed: list[str] = []
    undecoded: list[bytes] = []
    for number in numbers:
        rng = random.Random(f"request {number}")
        request = rng.choice(GOOD)
        payload = mutated(encoded(request), rng)
        try:
            problem = problem_of(bench, payload, rng.choice([request.key] * 9 + ["ask", "do"]), undecoded)
        except Exception as error:  # noqa: BLE001 - what must not come out
            problem = f"{type(error).__name__}: {error}"
        if problem:
            failed.append(f"{number} {type(request).__name__} {payload[:200]!r}: {problem}")
        bench.logger.collect()
    assert failed[:20] == []
    assert raised[:3] == []
    assert bench.alive()
    assert 0.1 * len(numbers) < len(undecoded) < 0.95 * len(numbers)  # those test nothing behind the decoder


@pytest.mark.slow
def test_the_requests_that_are_mutated_are_answered_as_they_are(bench, raised) -> None:
    for request in GOOD:
        assert problem_of(bench, encoded(request), request.key) == "", request
        bench.logger.collect()
    assert {type(request) for request in GOOD} == set(leaves(Request))
    assert raised == []


@pytest.mark.slow
@pytest.mark.sampled
def test_of_damaged_replies_and_events_come_only_errors_of_silo(bench, numbers) -> None:
    status, info = bench.replica.status(), bench.logger.elements
    good = [
        HelloReply(2, "0.1.0", "me", True, status, 2),
        StatusReply(status, "saved"),
        TableReply(Table(1, info)),
        ViewOpened("a-1", 1, ["/log/x"], ["/log/x"], [], []),
        Columns(["/log/x"], 0, 1, 10**7, b"\0" * 8, b"\0" * 8),
        Refused(RefusedWhy.INVALID, "no", [Problem("/log/x", "divider", "no")]),
    ]
    event = Event(1, 2, EventKind.SAVED, "saved", "me", status, 1, 1.0, [SavedFile("x.silo", FileType.SILO, 1)])
    decoder = msgspec.msgpack.Decoder(Event)
    failed = []
    for number in numbers:
        rng = random.Random(f"reply {number}")
        try:
            if number % 4:
                decode_reply(mutated(msgspec.msgpack.encode(rng.choice(good)), rng), "it")
            else:
                decoder.decode(mutated(msgspec.msgpack.encode(event), rng))
        except (SiloError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            if number % 4 and not isinstance(error, SiloError):
                failed.append(f"{number}: {type(error).__name__}: {error}")
        except Exception as error:  # noqa: BLE001 - what must not come out
            failed.append(f"{number}: {type(error).__name__}: {error}")
    assert failed[:20] == []
