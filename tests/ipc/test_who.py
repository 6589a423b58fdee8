"""Who did what: the words of events, roles of a group, one operator at a time, clients that only look."""

import functools
import grp
import itertools
import json
import os
import re
import signal
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import zenoh

import silo
from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.client.client import Client
from silo.control.authentication import Authentication
from silo.core.elements import Status
from silo.errors import ArgumentError, ConnectionLostError, ElementError, RefusedError
from silo.fleet.resolving import discover
from silo.net.access.admission import INSECURE, Admission, admission_of, router_admission, rules_hold_names
from silo.net.access.senders import (
    PROVEN,
    bracketed,
    came_by_network,
    claim_of,
    network_words,
    on_behalf,
    short_words,
)
from silo.net.configuration import from_file
from silo.net.keys import Root
from silo.net.session import Beside, close, open_router
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy, answered
from silo.rpc.serving import Sender
from tests.thin_net import free_port
from tests.waiting import answered as answered_soon
from tests.waiting import wait_until

ROOT = Root("robot3", "walker", "3fa977b2e0")
UNIX, SERIAL = "unixsock-stream//run/router.sock", "serial//dev/ttyUSB0#baudrate=115200"  # without host and port
GROUP = grp.getgrgid(os.getgid()).gr_name


def file_of(path: Path, **values: object) -> str:
    path.write_text(json.dumps(values))
    return str(path)


def admitted(path: Path, **values: object) -> Admission:
    config = file_of(path, **values)
    return admission_of(from_file(config), config)


# ------------------------------------------------------------------------------------------------------ words


def test_the_words_of_a_sender_say_whether_its_name_is_proven() -> None:
    client = "mallory@desk2 silo-tui 4711"
    assert network_words("anna", client, proven=True) == "anna (proven) from desk2, silo-tui 4711"
    assert network_words("anna", client, proven=False) == "anna (says so) from desk2, silo-tui 4711"
    assert network_words("anna", "", proven=True) == "anna (proven)"
    assert all(came_by_network(network_words("anna", client, proven=proven)) for proven in (True, False))
    assert not came_by_network("anna (says so) of group lab")


def test_who_names_another_one_over_a_network_stands_beside_it() -> None:
    carol = network_words("carol", "carol@desk silo 7", proven=True)
    assert on_behalf(carol, "alice (proven) from desk2") == f"{carol} for alice [proven] from desk2"
    assert on_behalf(carol, "") == carol
    assert on_behalf("root@robot3 silo 4714", "anna (proven)") == "anna [proven]"


def test_nobody_can_claim_to_be_proven() -> None:
    assert claim_of("anna@desk (proven) 1").program == "[proven] 1"
    assert not came_by_network(bracketed("anna (proven) from desk2"))
    assert network_words("bob", "x@anna(proven) y", proven=False).count("(") == 1


def test_a_name_that_nobody_checked_can_not_call_itself_proven_nor_move_a_cursor() -> None:
    authentication = Authentication(ROOT, Admission(True, False))
    for name in ("anna (proven)", "anna (proven) from desk,", "\x1b[2Janna\n"):
        sender = authentication.sender(ROOT.do(name), b"", "x@desk silo 1")
        assert isinstance(sender, Sender)
        assert sender.words.isprintable()
        assert PROVEN not in sender.words
        assert PROVEN not in short_words(sender.words)


# ------------------------------------------------------------------------------------------------------- authentication


def test_a_request_that_means_several_robots_is_refused() -> None:
    authentication = Authentication(ROOT, Admission(True, True))
    for key in ("silo/**", "silo/*/*/do/anna", f"{ROOT}/do/*", f"{ROOT}/d$*/anna", f"{ROOT}/do", f"{ROOT}/do/"):
        refused = answered(lambda key=key: authentication.sender(key, b"", "anna@desk silo 1"))
        assert isinstance(refused, Refused), key
        assert refused.why is RefusedWhy.INVALID
    assert authentication.sender(f"{ROOT}/do/anna", b"", "x@desk silo 1") == Sender(
        "anna", "anna (proven) from desk, silo 1"
    )


def test_a_user_name_of_any_letters_is_a_part_of_a_key() -> None:
    authentication = Authentication(ROOT, Admission(True, True))
    for name in ("anna", "änna/berg", "a*b$c#d?e", "@local", "50% x"):
        key = ROOT.do(name)
        zenoh.KeyExpr(key)
        sender = authentication.sender(key, b"", "")
        assert isinstance(sender, Sender)
        assert sender.identity == (name if name != "@local" else "@local somebody")


# ----------------------------------------------------------------------------------- ways in without authentication


@pytest.mark.parametrize(
    ("endpoint", "changes"),
    [("tcp/127.0.0.1:7447", True), ("tcp/[::1]:7447", True), ("tcp/0.0.0.0:7447", False), ("udp/10.0.0.1:7447", False),
     ("tcp/robot3.local:7447", False), ("tls/0.0.0.0:7447", False)],
)  # fmt: skip
def test_a_robot_that_listens_beyond_loopback_and_asks_nobody_who_he_is_takes_no_changes(
    tmp_path, endpoint, changes
) -> None:
    found = admitted(tmp_path / "c.json5", listen={"endpoints": [endpoint]})
    assert (found.changes, found.proven) == (changes, False)
    assert (INSECURE in found.why) != changes


@pytest.mark.parametrize(("endpoint", "changes"), [("tls/router.local:7447", True), ("tcp/router.local:7447", False)])
def test_a_robot_takes_changes_from_routers_that_show_a_certificate_alone(tmp_path, endpoint, changes) -> None:
    found = admitted(tmp_path / "c.json5", connect={"endpoints": [endpoint]})
    assert (found.changes, found.proven) == (changes, False)  # who wrote that router's rules is not known
    said = {"silo": {"router_checks_names": True}}
    assert admitted(tmp_path / "c.json5", connect={"endpoints": [endpoint]}, metadata=said).proven == changes


def test_who_wants_it_open_all_the_same_says_so_in_the_file(tmp_path) -> None:
    said = {"silo": {INSECURE: True}}
    for way in ({"connect": {"endpoints": ["tcp/router.local:7447"]}}, {"listen": {"endpoints": ["tcp/0.0.0.0:7447"]}}):
        found = admitted(tmp_path / "c.json5", **way, metadata=said)
        assert (found.changes, found.proven, found.why) == (True, False, "")


@pytest.mark.parametrize(
    "joined", ["", "tcp/127.0.0.1:7447", UNIX, "tcp/router.local:7447", SERIAL, "tls/router.local:7447"]
)
@pytest.mark.parametrize(
    "taken", ["", "tcp/127.0.0.1:7447", UNIX, "tcp/0.0.0.0:7447", SERIAL, "tcp/0.0.0.0:7447 by password"]
)
def test_names_hold_where_all_ways_in_ask_for_them_and_whoever_passes_them_on_said_that_it_checks_them(
    taken, joined, tmp_path
) -> None:
    endpoint, _, asks = taken.partition(" by ")
    ways = {
        "listen": {"endpoints": [endpoint] if endpoint else []},
        "connect": {"endpoints": [joined] if joined else []},
    }
    auth = {"auth": {"usrpwd": {"dictionary_file": "users.txt"}}} if asks else {}
    is_open = joined in ("tcp/router.local:7447", SERIAL) or taken in ("tcp/0.0.0.0:7447", SERIAL)
    for insecure, checked, key in itertools.product((False, True), (False, True), ("anna", "*")):
        rule = {"id": "r", "permission": "allow", "messages": ["query"], "key_exprs": [f"silo/*/*/do/{key}"]}
        control = {
            "enabled": True, "default_permission": "deny", "rules": [rule],
            "subjects": [{"id": "s", "usernames": ["anna"]}], "policies": [{"rules": ["r"], "subjects": ["s"]}],
        }  # fmt: skip
        said = {"silo": {INSECURE: insecure, "router_checks_names": checked}}
        found = admitted(
            tmp_path / "c.json5", mode="peer", **ways, access_control=control, transport=auth, metadata=said
        )
        changes = bool(taken or joined) and (insecure or not is_open)
        at_ways_in = not taken or key == "anna"
        by_routers = not joined or (joined.startswith("tls/") and checked)
        assert found[:2] == (changes, changes and at_ways_in and by_routers), (insecure, checked, key)
        assert bool(found.why) is (is_open and not insecure)
        if joined == UNIX:
            assert found.why_now == found.why, "what has no port listens for nobody else"
        if not joined and taken:
            config = str(tmp_path / "c.json5")
            router = router_admission(from_file(config), [endpoint], config)
            assert router[:2] == (changes, not is_open and at_ways_in), "of a router that listens so"


def test_names_are_proven_where_each_user_is_admitted_to_its_own_key_alone(tmp_path) -> None:
    def rules(*keys: str, users: tuple[str, ...] = ("anna",), default: str = "deny", **certified: list[str]) -> bool:
        rule = {"id": "r", "permission": "allow", "messages": ["query"], "key_exprs": list(keys)}
        control = {
            "enabled": True,
            "default_permission": default,
            "rules": [rule],
            "subjects": [{"id": "s", **({"usernames": list(users)} if users else {}), **certified}],
            "policies": [{"rules": ["r"], "subjects": ["s"]}],
        }
        return rules_hold_names(from_file(file_of(tmp_path / "r.json5", access_control=control)))

    assert rules("silo/*/*/do/anna", "silo/*/*/ask")
    assert rules("silo/robot3~$*/*/do/anna")
    assert not rules("silo/*/*/do/*")
    assert not rules("silo/**")
    assert not rules("silo/*/*/do/bob")
    assert not rules("silo/*/*/do/anna", users=("anna", "bob"))
    assert not rules("silo/*/*/do/anna", default="allow")
    assert rules("silo/*/*/do/anna", users=(), cert_common_names=["anna"])
    assert not rules("silo/*/*/do/anna", users=(), cert_common_names=["bob"])
    assert not rules("silo/*/*/do/anna", cert_common_names=["bob"])
    assert not rules("silo/*/*/do/anna", users=()), "anybody"
    assert not rules_hold_names(from_file(file_of(tmp_path / "none.json5")))


@pytest.mark.slow
def test_rules_that_allow_what_they_do_not_name_are_refused(tmp_path, runtime) -> None:
    control = {"enabled": True, "default_permission": "allow", "rules": [], "subjects": [], "policies": []}
    config = file_of(tmp_path / "c.json5", access_control=control)
    with silo.Logger("open", folder=tmp_path, script=tmp_path / "x.yaml") as logger:
        logger.add(np.zeros(3), "x")
        with pytest.raises(ConnectionLostError, match='must have default_permission: "deny"'):
            logger.serve(config=config)


@pytest.mark.slow
def test_a_stranger_at_an_open_router_sees_and_changes_nothing(tmp_path, runtime, capfd) -> None:
    port = free_port()
    open_config = zenoh.Config()  # as a `zenohd` that somebody else started, open to the whole network
    scouting = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": False, "scouting/delay": 0}
    for key, value in {"mode": "router", "listen/endpoints": [f"tcp/0.0.0.0:{port}"], **scouting}.items():
        open_config.insert_json5(key, json.dumps(value))
    way = {"connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}
    robot, desk = file_of(tmp_path / "robot.json5", **way), file_of(tmp_path / "desk.json5", **way)

    def seen() -> bool:
        try:
            return bool(discover(config=desk).loggers)
        except ConnectionLostError:
            return False

    router = zenoh.open(open_config)
    with silo.Logger("walker", folder=tmp_path, script=tmp_path / "x.yaml") as logger:
        logger.add(np.zeros(3), "x")
        logger.serve(config=robot)
        wait_until(seen)
        with silo.connect("walker", config=desk) as stranger:
            hello = stranger._hello()
            assert (hello.may_edit, INSECURE in hello.why_not) == (False, True)
            assert stranger.status().logger == "walker"
            with pytest.raises(RefusedError, match=r"takes no changes from this network: nobody knows who is behind"):
                stranger.start()
        with silo.connect("walker", config="local") as here:
            assert here.start().state.value == "running"
    router.close()


@pytest.mark.slow
def test_a_router_that_lets_in_everybody_lets_nobody_change_anything(tmp_path, runtime) -> None:
    port = free_port()
    config = file_of(tmp_path / "router.json5", listen={"endpoints": [f"tcp/0.0.0.0:{port}"]})
    way = {"connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}
    said = {"metadata": {"silo": {INSECURE: True}}}  # the robot trusts whatever router there is
    robot, desk = file_of(tmp_path / "robot.json5", **way, **said), file_of(tmp_path / "desk.json5", **way)
    router, _ = open_router(config)
    with silo.Logger("walker", folder=tmp_path, script=tmp_path / "x.yaml") as logger:
        logger.add(np.zeros(3), "x")
        logger.serve(config=robot)
        found = wait_until(lambda: _found(desk))
        with Client.connect(found) as stranger:
            assert not stranger._hello().may_edit
            with pytest.raises(RefusedError, match="may look at"):
                stranger.start()
    close(router)


def _found(config: str) -> object:
    try:
        return discover(config=config).loggers[0]
    except ConnectionLostError:
        return None


# ----------------------------------------------------------------------------------------------------------- a group


@pytest.fixture
def shared(runtime, tmp_path):
    """A logger that a group shares; we are of it, once the file of the robot's own user is gone."""
    made = silo.Logger("lab", folder=tmp_path, script=tmp_path / "lab.yaml")
    made.add(np.zeros(3), "x")
    yield made
    made.close()


@pytest.mark.slow
def test_a_group_whose_role_is_viewer_looks_and_changes_nothing(shared) -> None:
    serving = shared.serve(group=GROUP, group_role="viewer")
    with Client.connect("lab") as owner:
        assert owner._hello().may_edit
        owner.start()
    Beside.OWN.of(Path(serving.socket_path)).unlink()
    with Client.connect("lab") as member:
        hello = member._hello()
        assert not hello.may_edit
        assert member.status().logger == "lab"
        with pytest.raises(RefusedError, match=f"group '{GROUP}' may look at lab, not change it") as caught:
            member.stop()
        assert str(caught.value) == hello.why_not
    assert shared.is_running


@pytest.mark.slow
def test_a_group_whose_role_is_operator_changes_things_and_events_say_of_which_group(shared) -> None:
    serving = shared.serve(group=GROUP)
    Beside.OWN.of(Path(serving.socket_path)).unlink()
    with Client.connect("lab") as member:
        member.start()
        who = wait_until(lambda: [one.who for one in member.events() if one.kind == "started"])[0]
    assert f"(says so) of group {GROUP}, " in who


@pytest.mark.slow
def test_who_shows_neither_word_of_a_shared_socket_is_refused(shared) -> None:
    serving = shared.serve(group=GROUP)
    for file in (Beside.OWN.of(Path(serving.socket_path)), Beside.GROUP.of(Path(serving.socket_path))):
        file.unlink()
    with (
        Client.connect("lab") as stranger,
        pytest.raises(RefusedError, match="comes neither from the robot's user nor"),
    ):
        stranger.start()


@pytest.mark.slow
def test_only_the_group_may_read_the_word_of_the_group_and_only_the_owner_its_own(shared) -> None:
    path = Path(shared.serve(group=GROUP).socket_path)
    assert Beside.OWN.of(path).stat().st_mode & 0o777 == 0o600
    assert Beside.GROUP.of(path).stat().st_mode & 0o777 == 0o640


def test_a_role_without_a_group_is_refused(bench) -> None:
    bench.serving.close()
    with pytest.raises(ArgumentError, match="name it"):
        bench.logger.serve(group_role="viewer")


def test_a_role_or_mode_that_there_is_not_is_refused_with_those_that_there_are(shared) -> None:
    with pytest.raises(ElementError, match="group_role must be 'viewer' or 'operator'"):
        shared.serve(group=GROUP, group_role="looker")
    with pytest.raises(ElementError, match="control must be 'any' or 'one'"):
        shared.serve(control="two")


# --------------------------------------------------------------------------------------------------- looking only


def test_a_read_only_client_sends_nothing_that_changes_something(bench) -> None:
    with silo.connect("bot", read_only=True) as looker:
        assert looker.status().logger == "bot"
        hello = looker._hello()
        assert (hello.may_edit, "read-only" in hello.why_not) == (False, True)
        for change in (looker.start, looker.stop, looker.save, lambda: looker.mark("x"), looker.take_control):
            with pytest.raises(RefusedError, match=r"this is read-only .*nothing was changed"):
                change()
        assert looker.events() == []
    assert not bench.logger.is_running


def test_silo_read_only_changes_nothing_and_says_why(bench, capsys, monkeypatch) -> None:
    for words in (["--read-only", "start", "bot"], ["start", "bot", "--read-only"]):
        assert run(words) == EXIT_FAILED
        assert "read-only" in capsys.readouterr().err
    monkeypatch.setenv("SILO_READ_ONLY", "1")
    assert run(["start", "bot"]) == EXIT_FAILED
    assert "SILO_READ_ONLY" in capsys.readouterr().err
    assert not bench.logger.is_running


# ------------------------------------------------------------------------------------------------ one operator


class Other:
    """Another user of the same computer, as far as names go."""

    def __init__(self, name: str) -> None:
        with mock.patch("silo.client.client.client_name", lambda: f"{name}@robot3 silo-tui 1"):
            self.client = Client.connect("bot")

    def __enter__(self) -> Client:
        return self.client

    def __exit__(self, *_: object) -> None:
        self.client.close()


def test_who_has_control_alone_changes_things_and_the_refusal_says_who_since_when_and_the_way_out(bench) -> None:
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control()
        with pytest.raises(RefusedError, match=r"anna@robot3 .* has control of bot since .* s: .*--force") as caught:
            bob.start()
        assert caught.value.why is RefusedWhy.CONTROL
        # also where others have its name
        commands = re.findall(r"`silo control (\w+) (\S+)", str(caught.value))
        assert commands == [("give", bob.found.root.address), ("take", bob.found.label)]
        assert anna.start().control.identity == "@local anna"
        anna.release_control()
        assert bob.stop().control is None


def test_marks_and_the_program_itself_need_no_control(bench) -> None:
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control()
        bench.start(1)
        assert bob.mark("slipped").text == "slipped"
        bench.logger.stop()


def test_control_is_taken_by_force_and_everybody_is_told(bench, heard) -> None:
    lost: list[str] = []
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control(on_lost=lost.append)
        with pytest.raises(RefusedError, match="has control"):
            bob.take_control()
        bob.take_control(force=True)
        wait_until(lambda: lost)
        assert "bob@robot3" in lost[0]
        with pytest.raises(RefusedError, match="bob@robot3"):
            anna.start()
    texts = [event.text for event in heard.events if event.kind is EventKind.CONTROL]
    assert texts[:2] == ["control taken", "control taken from anna@robot3 silo-tui 1"]


def test_control_is_handed_over_to_an_operator_who_is_connected(bench) -> None:
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control()
        with pytest.raises(RefusedError, match="no operator 'carol' is connected"):
            anna.give_control("carol")
        wait_until(lambda: "@local bob" in {one.identity for one in anna.status().clients})
        anna.give_control("bob")
        assert bob.status().control.identity == "@local bob"
        with pytest.raises(RefusedError, match="bob@robot3"):
            anna.start()
        assert bob.start().state.value == "running"


def test_control_ends_with_its_lease_when_an_operator_dies(bench, heard) -> None:
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control(lease_s=1.0)  # and is never heard of again
        assert wait_until(lambda: bob.status().control is None)
        assert bob.start().state.value == "running"
    assert heard.wait(EventKind.CONTROL).text == "control taken"
    wait_until(lambda: [event for event in heard.events if "ended: nobody renewed it" in event.text])


def test_control_is_kept_while_its_client_lives_and_released_with_it(bench) -> None:
    with Other("bob") as bob:
        with Other("anna") as anna:
            anna.take_control()
            first = bob.status().control.until_ns
            assert wait_until(lambda: bob.status().control.until_ns > first)
        assert bob.status().control is None


def next_helper(bench, *clients: Client) -> Status:
    """End the helper process by force; the status that the next one tells, once all clients are connected to it."""
    killed = bench.serving.helper_pid
    os.kill(killed, signal.SIGKILL)

    def told_by_next(client: Client) -> Status | None:
        told = answered_soon(client.status)
        return told if told and told.helper_pid != killed else None

    return [wait_until(functools.partial(told_by_next, client)) for client in clients][-1]


def test_control_outlives_the_helper_process_with_what_is_left_of_its_time(bench) -> None:
    with Other("anna") as anna, Other("bob") as bob:
        anna.take_control(lease_s=600.0)  # as `silo control take --for` does, whose program ends then
        before = bob.status().control
        for _ in range(2):
            after = next_helper(bench, anna, bob).control
            assert (after.who, after.since_ns) == (before.who, before.since_ns)
            assert (after.until_ns, after.identity) == (before.until_ns, before.identity)
            with pytest.raises(RefusedError, match=r"anna@robot3 .* has control of bot .* ends in (\d\.\d+|10) min"):
                bob.start()
        anna.release_control()
        assert next_helper(bench, bob).control is None


def test_a_logger_may_want_one_operator_before_anything_is_changed(bench, capsys) -> None:
    bench.serving.close()
    bench.serving = bench.logger.serve(control="one")
    with Other("anna") as anna:
        assert anna.status().one_operator
        assert run(["control", "show", "bot"]) == 0
        assert f"changes need it: `silo control take {anna.found.label}`" in capsys.readouterr().out
        with pytest.raises(RefusedError, match=rf"need control .*`silo control take {anna.found.label}`"):
            anna.start()
        denied = wait_until(lambda: [one.text for one in anna.events() if "denied" in one.text])
        assert denied == ["change denied: start (without control)"]
        anna.take_control()
        assert anna.start().state.value == "running"


def test_the_status_tells_who_is_connected_and_of_who_only_looks_no_name(bench) -> None:
    with Other("anna") as anna:
        (found,) = wait_until(lambda: anna.status().clients)
        assert (found.who, found.identity) == ("anna@robot3 silo-tui 1", "@local anna")
        with silo.connect("bot", read_only=True):
            wait_until(lambda: len(anna.status().clients) == 2)
            assert sorted(one.identity for one in anna.status().clients) == ["", "@local anna"]
    with Other("bob") as bob:
        wait_until(lambda: [one for one in bob.status().clients if one.identity == "@local anna"] == [])


def test_silo_control_takes_tells_and_releases(bench, capsys) -> None:
    assert run(["control", "take", "bot", "--for", "10s"]) == 0
    assert run(["control", "show", "bot"]) == 0
    said = capsys.readouterr().out
    assert "you have control of bot until you release it; it ends in 10 s unless it is renewed" in said
    assert "has control since" in said
    with Other("bob") as bob:
        with pytest.raises(RefusedError, match="has control"):
            bob.start()
        assert run(["control", "release", "bot"]) == 0
        bob.start()
