"""Two silos of different protocols say which one is older. `tests/data/protocol_1.json` holds messages of the first."""

import json
from pathlib import Path

import msgspec
import pytest

import silo
from silo.cli.codes import EXIT_NO_LOGGER
from silo.cli.main import run
from silo.client.client import Client
from silo.errors import ConnectionLostError, RefusedError, VersionError
from silo.fleet.exchange import decode_reply, encoded
from silo.fleet.fleet import asked_all
from silo.net.session import close, open_client
from silo.requests import GetStatus, Start, decode_ask, decode_do
from silo.rpc.declaring import Done, Request, leaves
from silo.rpc.published import Event, EventKind, ViewFrame
from silo.rpc.refusals import Refused, RefusedWhy, answered, checked
from silo.rpc.versions import PROTOCOL, client_problem, robot_problem
from silo.state.requests import Hello, Unsaved
from tests.waiting import DEADLINE_S, wait_until

FIRST = json.loads((Path(__file__).parents[1] / "data" / "protocol_1.json").read_text())
REQUESTS_1 = {name: bytes.fromhex(data) for name, data in FIRST["requests"].items()}
REPLIES_1 = {name: bytes.fromhex(data) for name, data in FIRST["replies"].items()}
OF = {kind.__name__: kind for kind in leaves(Request)}


def received(payload: bytes, kind: str) -> Request | Refused:
    return answered(lambda: decode_ask(payload) if OF[kind].key == "ask" else decode_do(payload))


class Refused1(msgspec.Struct, frozen=True, tag="Refused"):
    """What a client of protocol 1 takes for a refusal."""

    why: str
    text: str
    problems: list[dict[str, str]] = []


# ----------------------------------------------------------------------------------------- a client of protocol 1


@pytest.mark.parametrize("name", [name for name in REQUESTS_1 if name != "Hello"])
def test_a_request_of_protocol_1_is_refused_in_words_and_values_that_its_client_knows(name) -> None:
    refused = received(REQUESTS_1[name], name)
    old = msgspec.msgpack.decode(msgspec.msgpack.encode(refused), type=Refused1)
    assert old.why in FIRST["refusals"]
    assert "is older (protocol 1) than that of the robot" in old.text
    assert f"({silo.__version__}, protocol {PROTOCOL}): update silo on the computer where this program runs" in old.text


def test_a_hello_of_protocol_1_is_answered_so_that_its_client_connects_and_reads_the_refusals() -> None:
    request = received(REQUESTS_1["Hello"], "Hello")
    assert isinstance(request, Hello)
    assert (request.protocol, request.version) == (1, "")


def test_what_protocol_1_reads_in_a_hello_is_still_there(bench, client) -> None:
    old = msgspec.msgpack.decode(REPLIES_1["HelloReply"])
    new = msgspec.msgpack.decode(msgspec.msgpack.encode(client._hello()))
    assert old.keys() <= new.keys()
    assert old["status"].keys() <= new["status"].keys()


def test_a_real_helper_refuses_every_request_of_protocol_1_and_changes_nothing(bench) -> None:
    session = open_client(Path(bench.serving.socket_path))
    try:
        for name, payload in REQUESTS_1.items():
            replies = list(session.get(f"silo/*/bot/{OF[name].key}", payload=payload, timeout=DEADLINE_S))
            (answer,) = [msgspec.msgpack.decode(reply.ok.payload.to_bytes()) for reply in replies]
            assert answer["type"] == ("HelloReply" if name == "Hello" else "Refused"), name
    finally:
        close(session)
    assert not bench.logger.is_running


# ---------------------------------------------------------------------------------- a helper process of protocol 1


def test_the_hello_of_a_helper_of_protocol_1_says_who_is_older_and_what_to_update() -> None:
    with pytest.raises(VersionError) as problem:
        decode_reply(REPLIES_1["HelloReply"], "logger 'bot'")
    assert str(problem.value) == (
        f"logger 'bot' runs an older silo (0.1.0, protocol 1) than this program ({silo.__version__}, protocol "
        f"{PROTOCOL}): update silo on the robot and start its program again"
    )


@pytest.mark.parametrize("name", [name for name in REPLIES_1 if name != "HelloReply"])
def test_a_reply_of_protocol_1_is_decoded(name) -> None:
    assert type(decode_reply(REPLIES_1[name], "it")).__name__ == name


def test_an_event_and_a_frame_of_protocol_1_are_decoded() -> None:
    assert msgspec.msgpack.decode(bytes.fromhex(FIRST["event"]), type=Event).kind is EventKind.SAVED
    assert msgspec.msgpack.decode(bytes.fromhex(FIRST["frame"]), type=ViewFrame).tick == 7


# ---------------------------------------------------------------------------------------------------- newer peers


def test_a_newer_client_is_refused_with_what_to_update() -> None:
    newer = msgspec.structs.replace(Start(), protocol=PROTOCOL + 1)
    refused = answered(lambda: decode_do(msgspec.msgpack.encode(newer)))
    assert f"the silo of this program is newer (protocol {PROTOCOL + 1}) than that of the robot" in refused.text
    assert "update silo on the robot" in refused.text


def test_a_request_that_tells_no_protocol_is_of_the_first() -> None:
    refused = answered(lambda: decode_ask(msgspec.msgpack.encode({"type": "GetNothing"})))
    assert refused.text.startswith("the silo of this program is older (protocol 1) than")


def test_a_request_that_only_a_newer_silo_knows_is_refused_for_its_version() -> None:
    refused = answered(lambda: decode_ask(msgspec.msgpack.encode({"type": "GetSamples", "protocol": PROTOCOL + 1})))
    assert "is newer (protocol" in refused.text


def test_the_hello_of_a_newer_helper_is_understood_whatever_else_is_in_it() -> None:
    hello = {**msgspec.msgpack.decode(REPLIES_1["HelloReply"]), "protocol": 9, "oldest": 8, "version": "4.0"}
    hello["status"] = {**hello["status"], "state": "paused"}
    with pytest.raises(VersionError, match=r"newer silo \(4\.0, protocol 8 to 9\) .*update silo on this computer"):
        decode_reply(msgspec.msgpack.encode(hello), "logger 'bot'")


def test_a_newer_helper_that_still_understands_us_is_no_problem() -> None:
    assert robot_problem("it", PROTOCOL + 3, PROTOCOL, "9.0") == ""
    assert client_problem(PROTOCOL) == ""


def test_kinds_of_events_and_reasons_that_are_not_known_yet_are_read_as_others() -> None:
    event = {**msgspec.msgpack.decode(bytes.fromhex(FIRST["event"])), "kind": "limit reached", "limit": [1, 2]}
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(event), type=Event).kind is EventKind.OTHER
    refused = {**msgspec.msgpack.decode(REPLIES_1["Refused"]), "why": "too late"}
    assert decode_reply(msgspec.msgpack.encode(refused), "it").why is RefusedWhy.FAILED


def test_fields_that_are_not_known_yet_are_passed_over() -> None:
    payload = msgspec.msgpack.encode({**msgspec.msgpack.decode(encoded(Start())), "more": {"a": 1}})
    assert decode_do(payload).unsaved is Unsaved.REFUSE


def test_every_request_is_sent_with_our_protocol() -> None:
    assert decode_ask(encoded(GetStatus())).protocol == PROTOCOL


# ------------------------------------------------------------------------------- a real helper of another protocol


PATCH = """
import sys
if "silo.helper" in sys.orig_argv:
    import silo.rpc.versions as versions
    versions.PROTOCOL, versions.OLDEST = {protocol}, {oldest}
"""


@pytest.fixture(params=[(1, 1, "older"), (9, 8, "newer")], ids=["older", "newer"])
def other(request, runtime, tmp_path, monkeypatch):
    """A logger whose helper process speaks another protocol, and which word is said of it."""
    protocol, oldest, word = request.param
    (tmp_path / "patch").mkdir()
    (tmp_path / "patch" / "sitecustomize.py").write_text(PATCH.format(protocol=protocol, oldest=oldest))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path / 'patch'}:{Path(silo.__file__).parents[1]}")
    logger = silo.Logger("bot", folder=tmp_path, script=tmp_path / "none.yaml")
    logger.array("x")
    with logger.serve():
        yield word
    logger.close()


@pytest.mark.slow
def test_a_client_is_told_once_at_the_connection_that_the_robot_is_of_another_silo(other) -> None:
    with pytest.raises(VersionError, match=rf"logger 'bot' runs an? {other} silo .* than this program"):
        Client.connect("bot")


@pytest.mark.slow
def test_silo_ls_lists_a_logger_of_another_silo_as_such(other, capsys) -> None:
    (answer,) = asked_all().members
    assert (answer.status, answer.word) == (None, "other silo")
    assert run(["ls"]) == EXIT_NO_LOGGER  # there is nobody that can be asked
    shown = capsys.readouterr()
    assert "other silo" in shown.out
    assert f"runs an {other}" in shown.err.replace(" a newer", " an newer")
    assert run(["info", "bot"]) == EXIT_NO_LOGGER


def test_a_logger_that_comes_back_with_another_silo_is_told_as_such(bench, client, monkeypatch) -> None:
    monkeypatch.setattr("silo.fleet.exchange.PROTOCOL", PROTOCOL)
    monkeypatch.setattr("silo.rpc.versions.PROTOCOL", PROTOCOL + 1)  # from now on ours is the newer one
    bench.serving.close()
    wait_until(lambda: not client.connected)
    bench.logger.serve()

    def told() -> str:
        try:
            client.status()
        except VersionError as problem:
            return str(problem)
        except ConnectionLostError:
            return ""
        return ""

    assert "runs an older silo" in wait_until(told)


def test_other_replies_than_a_refusal_or_the_one_asked_for_are_told() -> None:
    with pytest.raises(ConnectionLostError, match="answered GetStatus with a Done"):
        checked(GetStatus(), Done())
    with pytest.raises(RefusedError):
        checked(GetStatus(), Refused(RefusedWhy.FAILED, "no"))
