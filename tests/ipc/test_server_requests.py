"""Status, table, edits, start and stop; what garbage does."""

import itertools
import os
import signal
import threading
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import silo
from silo.client.client import Client
from silo.core.elements import BufferType, Edit, ElementOptions, FileType, State
from silo.errors import RefusedError
from silo.fleet.exchange import encoded
from silo.history.requests import GetHistory
from silo.live.requests import OpenView
from silo.logger.serving.answers import answer
from silo.net.keys import ANY_ALIVE
from silo.net.session import close, open_client
from silo.recordings.requests import Save
from silo.rpc.declaring import RobotRequest
from silo.rpc.published import EventKind
from silo.rpc.versions import PROTOCOL
from silo.state.requests import ApplyEdits
from tests.examples import examples
from tests.waiting import DEADLINE_S, answered, wait_until


def options(client: Client, name: str) -> ElementOptions:
    return next(info.options for info in client.table().elements if info.name == name)


def edit(client: Client, name: str, **changes: object) -> Edit:
    return Edit(name, msgspec.structs.replace(options(client, name), **changes))


def test_its_process_version_table_and_last_tick_are_told_and_who_changed_it(bench, client, heard) -> None:
    """What a logger does that a stand-in of it does as well is in `tests/contract`."""
    hello = client._hello()
    assert (hello.status.logger, hello.status.pid, hello.version) == ("bot", os.getpid(), silo.__version__)
    assert client.table().elements == bench.logger.elements
    client.apply([edit(client, "/log/x", divider=2)], -1)
    assert bench.logger.elements[0].options.divider == 2
    client.start()
    bench.ticks(3)
    assert client.status().last_tick_ns == bench.now_ns - 10_000_000
    edited, started = heard.wait(EventKind.EDITED), heard.wait(EventKind.STARTED)
    assert started.number == edited.number + 1
    assert edited.by.endswith(str(os.getpid()))


def test_the_table_has_what_elements_were_given_that_are_logged_otherwise_now(bench, client):
    begun = options(client, "/log/x")
    assert client.table().given == {}
    client.apply([edit(client, "/log/x", divider=5)], -1)
    client.apply([edit(client, "/log/x", divider=7)], -1)
    assert client.table().given == {"/log/x": begun}
    client.apply([Edit("/log/x", begun)], -1)
    assert client.table().given == {}
    bench.logger.set("x", divider=9)
    assert client.table().given == {}, "the program's own settings are no edits"
    client.apply([edit(client, "/log/x", divider=5), edit(client, "/log/q", divider=5)], -1)
    bench.logger.remove("x")
    bench.logger.array("x", divider=4)
    bench.logger.update()
    assert list(client.table().given) == ["/log/q"]
    client.start()
    bench.ticks(2)
    client.apply([edit(client, "/log/kept", divider=3)], -1, cut=True)
    assert sorted(client.table().given) == ["/log/kept", "/log/q"]
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    wait_until(lambda: sorted(answered(lambda: client.table().given) or ()) == ["/log/kept", "/log/q"])


def test_an_edit_of_some_options_leaves_the_others_of_the_table_as_they_are(bench, client):
    client.apply([Edit("/log/x", divider=4, buffer="fixed", size=50)], -1)
    before = client.table().revision
    client.apply([Edit("/log/x", size="*2")], -1)
    (now,) = (one.options for one in client.table().elements if one.name == "/log/x")
    assert (now.divider, now.buffer, now.size) == (4, BufferType.FIXED, 100)
    whose = rf"\(it is at revision {before + 1}, the edits are based on {before}\)"
    with pytest.raises(RefusedError, match=f"somebody changed the table meanwhile {whose}: read it again; nothing was"):
        client.apply([Edit("/log/x", divider=9)], before)
    with pytest.raises(RefusedError, match="edited twice"):
        client.apply([edit(client, "/log/x", divider=2), edit(client, "/log/x", divider=3)], -1)


@pytest.fixture
def slow_to_tell(bench, client, monkeypatch):
    """The same logger; its program gets no time to tell its helper process of changes for a while."""
    serving = bench.logger._life.serving
    tell, told = serving._push_state, threading.Event()

    def late():
        told.wait(0.2)
        tell()

    monkeypatch.setattr(serving, "_push_state", late)
    yield bench.logger
    told.set()


def test_what_the_program_did_is_known_to_whoever_asks_after_it(slow_to_tell, client):
    """The program tells it in a thread of its own, a moment later."""
    logger = slow_to_tell
    logger.add(np.zeros(()), "new")
    logger.update()
    assert client.table().elements[-1].name == "/log/new"
    logger.start()
    assert client.status().state is State.RUNNING
    logger.collect()
    assert client.wait_saved(client.save())
    logger.stop()
    assert client.status().state is State.STOPPED


# --------------------------------------------------------------------------------------------------------- garbage


@pytest.fixture
def raw(bench):
    """Sends bytes as they are; returns the decoded answers."""
    session = open_client(Path(bench.serving.socket_path))
    (token,) = session.liveliness().get(ANY_ALIVE, timeout=DEADLINE_S)
    root = str(token.ok.key_expr).removesuffix("/alive")

    def send(payload: bytes | None, kind: str = "ask") -> list[object]:
        key = f"{root}/do/@local" if kind == "do" else f"{root}/{kind}"
        replies = session.get(key, payload=payload, timeout=DEADLINE_S)
        return [msgspec.msgpack.decode(reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None]

    yield send
    close(session)


GARBAGE = [
    None,
    b"",
    b"\xff" * 100,
    b"\x93" * 5000,
    msgspec.msgpack.encode({"type": "Nix"}),
    msgspec.msgpack.encode({"type": "OpenView", "view": 7}),
    msgspec.msgpack.encode({"type": "GetHistory", "names": "x", "start_ns": 0, "end_ns": 1, "column_ns": 1}),
    msgspec.msgpack.encode({"type": "ApplyEdits", "revision": -1, "edits": [1, None, {}, {"name": 3}]}),
    msgspec.msgpack.encode({"type": "ApplyEdits", "revision": -1, "edits": {"a": 1}}),
    msgspec.msgpack.encode({"type": "Save", "types": [99]}),
    msgspec.msgpack.encode({"type": "Save", "types": [0] * 1000, "name": "../../x"}),
    msgspec.msgpack.encode({"type": "LoadScript", "path": "\x00\x1b[2J"}),
]


@pytest.fixture
def reached(bench, monkeypatch):
    """What reaches the robot program."""
    found = []

    def noted(logger, request):
        found.append(request)
        return answer(logger, request)

    monkeypatch.setattr("silo.logger.serving.serving.answer", noted)
    return found


TOO_MUCH = {
    "conditions": {
        "type": "ApplyEdits", "revision": -1, "cut": True, "edits": [],
        "extras": {"limits": [{"name": f"d{at}"} for at in range(20_000)]},
    },
    "one name again and again": {
        "type": "ApplyEdits", "revision": -1, "cut": True, "edits": [], "extras": {"limits": [{"name": "x"}] * 20_000},
    },
    "parameters": {"type": "SetParameters", "values": {f"x{at}": 1.0 for at in range(20_000)}},
    "a trigger": {"type": "SetTrigger", "trigger": {"name": "t" * RobotRequest.max_bytes, "when": "x > 1"}},
}  # fmt: skip


def test_what_would_hold_up_the_robot_program_is_refused_before_it_reaches_that(raw, reached) -> None:
    """It reads a request with the interpreter held, and its control loop waits for that."""
    for what, request in TOO_MUCH.items():
        (reply,) = raw(msgspec.msgpack.encode({"protocol": PROTOCOL, **request}), "do")
        assert (reply["type"], reply["why"], reached) == ("Refused", "invalid", []), what


def test_conditions_that_fit_come_to_the_robot_program_as_of_the_table_that_they_were_checked_with(
    bench, raw, reached
) -> None:
    extras = {
        "derived": [{"name": "/log/two", "expression": "2 * x"}],
        "limits": [{"name": "two", "bounds": (1, 2, 3, 4)}],
    }
    wanted = {"type": "ApplyEdits", "protocol": PROTOCOL, "revision": -1, "edits": [], "extras": extras}
    (reply,) = raw(msgspec.msgpack.encode(wanted), "do")
    assert reply["type"] == "EditsApplied"
    assert [one.name for one in bench.logger._conditions.now.limits] == ["two"]
    assert reached[0].revision == bench.logger._scripted.revision - 1


def test_garbage_and_absurd_wishes_are_refused_in_words_and_change_nothing(bench, client, raw) -> None:
    before = client.table()
    for payload, kind in itertools.product(GARBAGE, ("ask", "do")):
        (answer,) = raw(payload, kind)
        assert answer["type"] == "Refused", answer
        assert answer["text"]
    for wish in ABSURD:
        (answer,) = raw(encoded(wish))
        assert (answer["type"], answer["why"]) == ("Refused", "invalid"), wish
    assert raw(b"\xc1" * 3_000_000, "ask")[0]["why"] == "invalid"  # beyond every limit
    (answer,) = raw(encoded(Save(types=[FileType.SILO])), "do")
    assert "nothing was logged yet" in answer["text"]
    assert client.table() == before
    assert client.status().helper_pid == bench.serving.helper_pid


@settings(max_examples=examples(100), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
def test_any_bytes_get_one_answer(raw, payload) -> None:
    assert len(raw(payload, "do")) == 1


ABSURD = [
    OpenView(view="../x", values=["/log/x"]),
    OpenView(view="a-1", values=["/log/x"], rate_hz=float("nan")),
    OpenView(view="a-1", values=["/log/x"], rate_hz=-1.0),
    OpenView(view="a-1", plots=["/log/x"], column_ns=0),
    OpenView(view="a-1", values=["x"] * 20_001),
    GetHistory(names=[], start_ns=0, end_ns=10, column_ns=1),
    GetHistory(names=["/log/x"], start_ns=0, end_ns=10**18, column_ns=1_000),
    GetHistory(names=["/log/x"], start_ns=10, end_ns=0, column_ns=1_000),
    GetHistory(names=["/log/x"], start_ns=0, end_ns=10, column_ns=-5),
]


def test_name_of_a_client_can_not_steer_a_terminal(raw, heard, bench) -> None:
    raw(
        encoded(
            ApplyEdits(revision=-1, edits=[Edit("/log/x", ElementOptions(divider=3))], client="\x1b[2Jevil" + "x" * 999)
        ),
        "do",
    )
    by = heard.wait(EventKind.EDITED).by
    assert by.startswith("[2Jevil")
    assert len(by) < 130


def test_request_on_a_wildcard_key_is_refused(bench, client) -> None:
    session = open_client(Path(bench.serving.socket_path))
    try:
        replies = {
            key: list(session.get(key, payload=b"", target=zenoh.QueryTarget.ALL, timeout=DEADLINE_S))
            for key in ("silo/**", "silo/*/bot/ask", "silo/*/bot/do")
        }
    finally:
        close(session)
    # what changes something does nothing for a wildcard; one that is wider than a key of ours never comes through
    kinds = [
        [msgspec.msgpack.decode(reply.ok.payload.to_bytes())["type"] for reply in some if reply.ok is not None]
        for some in replies.values()
    ]
    assert kinds == [[], ["Refused"], ["Refused"]]  # `do` is that of protocol 1
