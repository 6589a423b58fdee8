"""Ways to robots elsewhere: made by `silo remote`, tried by its doctor, which names the layer that fails."""

import json
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zenoh

import silo
from silo.cli.codes import EXIT_NO_LOGGER, EXIT_USAGE
from silo.cli.group import cli
from silo.cli.main import run
from silo.cli.network.authority import Made, make_network, robot_of, role_of
from silo.client.client import Client
from silo.errors import RefusedError, SiloError
from silo.fleet.examining import examine
from silo.helper.helper import Helper, ServingOptions
from silo.net.access.admission import admission_of
from silo.net.access.certificates import not_valid_today
from silo.net.access.probing import Layer, LayerError, endpoint_of, reach
from silo.net.access.rights import access_control
from silo.net.configuration import (
    LEASE_TRIPS,
    OPEN_TRIPS,
    find_file,
    from_file,
    remote_file,
    remotes,
    scaled,
    written,
)
from silo.net.session import open_client, open_router
from silo.rpc.versions import PROTOCOL
from tests.thin_net import free_port
from tests.waiting import wait_until

CONFIG = Path(__file__).parents[2] / "config"

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user without remotes."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path


def config_of(path: Path, endpoint: str, **more: object) -> str:
    path.write_text(json.dumps({"connect": {"endpoints": [endpoint]}, **more}))
    return str(path)


# ------------------------------------------------------------------------------------------------ files and their words


def test_what_stands_in_a_file_is_read_as_json5(tmp_path) -> None:
    file = tmp_path / "some.json5"
    file.write_text("""// a comment
    { mode: "client", /* and */ 'connect': { endpoints: ["tcp/[::1]:7447", 'a//b',], timeout_ms: 200, }, on: true,
      "a:b": -1.5e3 }  // the end""")
    found = {"endpoints": ["tcp/[::1]:7447", "a//b"], "timeout_ms": 200}
    assert written(str(file)) == {"mode": "client", "connect": found, "on": True, "a:b": -1500.0}
    file.write_text("mode: client\non: true\n")  # YAML
    assert written(str(file)) == {}


@pytest.mark.parametrize("name", ["access-control", "tls"])
def test_the_examples_are_read(name) -> None:
    assert written(str(CONFIG / f"{name}.json5"))["listen"]["endpoints"]


def test_the_rules_of_the_example_are_those_that_init_writes() -> None:
    example = written(str(CONFIG / "access-control.json5"))["access_control"]
    made = access_control({"viewer": "viewer", "engineer": "operator"})
    assert example["rules"] == made["rules"]
    assert {one["id"] for one in example["subjects"]} == {one["id"] for one in made["subjects"]}
    assert example["policies"] == made["policies"]


def test_rules_for_one_host_fit_every_id_that_its_loggers_draw() -> None:
    keys = [key for rule in access_control({"ann": "operator"}, "robot3")["rules"] for key in rule["key_exprs"]]
    assert "silo/robot3~$*/*/do/ann" in keys
    assert all(key.startswith("silo/robot3~$*/*/") for key in keys)


def test_paths_in_a_configuration_are_relative_to_its_file(tmp_path, monkeypatch) -> None:
    (tmp_path / "lab").mkdir()
    auth = {"auth": {"usrpwd": {"dictionary_file": "users.txt"}}}
    path = config_of(tmp_path / "lab" / "server.json5", "tcp/localhost:1", transport=auth)
    monkeypatch.chdir(tmp_path)
    found = json.loads(from_file(path).get_json("transport/auth/usrpwd/dictionary_file"))
    assert found == str(tmp_path / "lab" / "users.txt")


def test_times_of_a_client_leave_room_for_round_trips() -> None:
    quick, slow = (scaled(rtt_s)["transport"] for rtt_s in (0.0, 0.6))
    assert quick == {"unicast": {"open_timeout": 1000, "accept_timeout": 1000}, "link": {"tx": {"lease": 2000}}}
    trips = {f"{side}_timeout": 1000 + OPEN_TRIPS * 600 for side in ("open", "accept")}
    assert slow == {"unicast": trips, "link": {"tx": {"lease": 2000 + LEASE_TRIPS * 600}}}


def test_what_a_file_says_of_times_wins(tmp_path, monkeypatch) -> None:
    opened = []

    def note(settings):
        opened.append(settings)
        raise silo.SiloError("seen")

    monkeypatch.setattr("silo.net.session.zenoh.open", note)
    link = {"unicast": {"open_timeout": 10000}, "link": {"tx": {"lease": 10000}}}
    path = config_of(tmp_path / "c.json5", "tcp/localhost:1", transport=link)
    with pytest.raises(SiloError, match="seen"):
        open_client(None, path)
    (settings,) = opened
    assert [json.loads(settings.get_json(f"transport/{key}")) for key in ("unicast/open_timeout", "link/tx/lease")] == [
        10000,
        10000,
    ]
    assert json.loads(settings.get_json("transport/unicast/accept_timeout")) == 1000  # what it doesn't say is ours
    assert json.loads(settings.get_json("scouting/multicast/enabled")) is False


@pytest.mark.parametrize(("endpoint", "is_closed"), [("tcp/127.0.0.1:7447", False), ("tcp/0.0.0.0:7447", True)])
def test_a_router_takes_its_time_looks_for_nobody_and_lets_nobody_change_anything_where_it_is_open(
    endpoint, is_closed, tmp_path, monkeypatch
) -> None:
    opened = []

    def note(settings):
        opened.append(settings)
        raise zenoh.ZError("seen")

    monkeypatch.setattr("silo.net.session.zenoh.open", note)
    path = tmp_path / "router.json5"
    path.write_text(json.dumps({"listen": {"endpoints": [endpoint]}}))
    with pytest.raises(SiloError, match=f"can't listen on {endpoint}: .*seen"):
        open_router(str(path))
    wanted = {
        "mode": "router", "listen/endpoints": [endpoint], "transport/unicast/accept_timeout": 10_000,
        "transport/link/tx/lease": 2000, "scouting/multicast/enabled": False, "scouting/delay": 0,
        "transport/shared_memory/enabled": False, "access_control/enabled": is_closed,
    }  # fmt: skip
    assert {key: json.loads(opened[0].get_json(key)) for key in wanted} == wanted


@pytest.mark.parametrize("kind", ["tcp", "udp"])
@pytest.mark.parametrize(
    ("host", "is_open"),
    [("127.0.0.1", False), ("127.8.0.1", False), ("0.0.0.0", True),
     ("::1", False), ("::ffff:127.0.0.1", False), ("::ffff:0.0.0.0", True), ("::", True)],
)  # fmt: skip
def test_from_a_router_of_this_computer_changes_are_taken_while_no_other_reaches_it(
    kind, host, is_open, tmp_path
) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM) as router:
        router.bind((host, 0))
        if kind == "tcp":
            router.listen()
        endpoint = f"{kind}/127.0.0.1:{router.getsockname()[1]}"
        config = config_of(tmp_path / "c.json5", endpoint, mode="peer")
        found = admission_of(from_file(config), config)
        assert (found.changes, found.routers, bool(found.why_now)) == (True, (endpoint,), is_open)
    assert not found.why_now, "it listens no more"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("tls/robot3.local:7447", ("tls", "robot3.local", 7447)),
        ("tcp/[fe80::1]:7447", ("tcp", "fe80::1", 7447)),
        ("quic/10.0.0.1:7447#so_sndbuf=1", ("quic", "10.0.0.1", 7447)),
    ],
)
def test_endpoints_are_read(text, found) -> None:
    assert endpoint_of(text)[:3] == found


@pytest.mark.parametrize(
    "text", ["robot3", "tcp/robot3", "tcp/robot3:99999", "robot3:7447", "unixsock-stream//run/x.sock"]
)
def test_what_is_no_endpoint_with_a_port_is_none(text) -> None:
    assert endpoint_of(text) is None


# ----------------------------------------------------------------------------------------------------- silo remote


def test_a_remote_is_added_listed_and_removed(mine, capsys) -> None:
    assert run(["remote", "add", "lab", "tls/robot3.local:7447"]) == 0
    assert remotes() == ["lab"]
    assert remote_file("lab").stat().st_mode & 0o077 == 0
    assert find_file("lab") == str(remote_file("lab"))
    capsys.readouterr()
    assert run(["remote", "ls"]) == 0
    assert "tls/robot3.local:7447" in capsys.readouterr().out
    assert run(["remote", "rm", "lab"]) == 0
    assert remotes() == []


def test_a_remote_that_is_there_is_replaced_only_when_asked(mine, capsys) -> None:
    assert run(["remote", "add", "lab", "tcp/one:1"]) == 0
    assert run(["remote", "add", "lab", "tcp/two:2"]) == 1
    assert "nothing was changed" in capsys.readouterr().err
    assert "tcp/one:1" in remote_file("lab").read_text()
    assert run(["remote", "add", "lab", "tcp/two:2", "--replace"]) == 0
    assert "tcp/two:2" in remote_file("lab").read_text()


@pytest.mark.parametrize("words", [["local", "tcp/a:1"], ["a/b", "tcp/a:1"], ["lab", "robot3"]])
def test_what_can_be_no_remote_is_refused(mine, words) -> None:
    assert run(["remote", "add", *words]) == EXIT_USAGE
    assert remotes() == []


def test_a_file_that_is_added_keeps_its_certificates(mine) -> None:
    tls = {"link": {"tls": {"root_ca_certificate": "ca.pem"}}}
    given = config_of(mine / "client.json5", "tls/robot3:1", transport=tls)
    assert run(["remote", "add", "lab", given]) == 0
    found = written(str(remote_file("lab")))["transport"]["link"]["tls"]["root_ca_certificate"]
    assert found == str(mine / "ca.pem")


def test_a_configuration_that_is_neither_file_nor_remote_is_told(mine, capsys) -> None:
    assert run(["--config", "lab", "ls"]) == EXIT_NO_LOGGER
    assert "no remote of that name" in capsys.readouterr().err


def test_config_stands_before_or_after_every_command(mine) -> None:
    for words in (["--config", "nowhere", "ls"], ["ls", "--config", "nowhere"], ["files", "ls", "--config", "nowhere"]):
        assert run(words) == EXIT_NO_LOGGER, words


def test_every_command_that_speaks_with_loggers_takes_config() -> None:
    import click

    context = click.Context(cli)
    for name in [
        "ls",
        "info",
        "watch",
        "set",
        "start",
        "stop",
        "restart",
        "save",
        "record",
        "mark",
        "events",
        "alarms",
    ]:
        command = cli.get_command(context, name)
        assert any("--config" in each.opts for each in command.params), name


# ---------------------------------------------------------------------------------------------- init, and the doctor


class Network:
    """What `silo remote init` makes, and a robot that listens by it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        users = {"alice": "operator", "bob": "viewer"}
        self.made: Made = make_network(folder / "lab", ["localhost"], self.port, users, "127.0.0.1")
        self.server = self.made.server / "server.json5"
        with (self.made.server / "users.txt").open("a") as file:
            file.write("eve:nothing\n")  # a user without a role
        self.logger = silo.Logger("walker", folder=folder / "logs", script=folder / "walker.yaml")
        self.logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
        self.logger.serve(config=self.server)

    def client(self, user: str) -> dict[str, object]:
        return written(str(self.made.clients[user]))

    def changed(self, path: Path, **values: str) -> str:
        """A client file of alice's with other values by place, as `connect.endpoints=...`."""
        found = self.client("alice")
        for place, value in values.items():
            *way, last = place.split("__")
            inner = found
            for word in way:
                inner = inner[word]
            inner[last] = value
        path.write_text(json.dumps(found))
        return str(path)


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Network]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        patch.setenv("SILO_RUNTIME_DIR", runtime)
        made = Network(tmp_path_factory.mktemp("network"))
        yield made
        made.logger.close()


def layers(config: str) -> list[Layer]:
    return [layer for layer, _ in examine(config)]


def failure(config: str) -> LayerError:
    with pytest.raises(LayerError) as caught:
        layers(config)
    return caught.value


@pytest.mark.slow
def test_who_was_handed_a_file_is_in_with_the_role_that_init_gave(network) -> None:
    alice, bob = (str(network.made.clients[name]) for name in ("alice", "bob"))
    with silo.connect("walker", config=bob) as client:
        assert not client._hello().may_edit
        with pytest.raises(RefusedError, match=r"user 'bob' may look at .*, not change it"):
            client.start()
    with silo.connect("walker", config=alice) as client:
        assert client._hello().may_edit
        assert client.start().state.value == "running"
        client.stop()


@pytest.mark.slow
def test_who_is_connected_is_told_by_the_name_that_is_proven_whatever_the_role(network) -> None:
    alice, bob = (str(network.made.clients[name]) for name in ("alice", "bob"))

    def there(client: Client) -> list[tuple[str, str]]:
        return sorted((one.who.partition(" from ")[0], one.identity) for one in client.status().clients)

    with silo.connect("walker", config=alice) as operator, silo.connect("walker", config=bob) as viewer:
        expected = [("alice (proven)", "alice"), ("bob (proven)", "")]
        assert wait_until(lambda: there(viewer) == expected), there(viewer)
        with silo.connect("walker", config=alice) as other:
            other.take_control()
            assert "alice (proven)" in other.give_control("alice")
            operator.release_control()


@pytest.mark.slow
def test_the_doctor_finds_a_way_that_works_healthy_layer_by_layer(network) -> None:
    found = layers(str(network.made.clients["alice"]))
    assert found == [
        Layer.CONFIGURATION, Layer.NAME, Layer.ROUTE, Layer.PORT, Layer.TLS, Layer.PASSWORD, Layer.ROLE, Layer.VERSION,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("endpoint", "layer", "words"),
    [
        ("tcp/robot..3:7447", Layer.NAME, "no computer is called 'robot..3'"),
        ("tcp/127.0.0.1:{free}", Layer.PORT, "nobody listens on port"),
    ],
)
def test_where_nobody_is_the_doctor_says_whether_name_or_port_is_the_matter(tmp_path, endpoint, layer, words) -> None:
    failed = failure(config_of(tmp_path / "c.json5", endpoint.format(free=free_port())))
    assert (failed.layer, words in str(failed)) == (layer, True)


def test_an_address_that_stays_silent_is_a_matter_of_the_route(tmp_path) -> None:
    with socket.socket() as silent, socket.socket() as first, socket.socket() as second:
        silent.bind(("127.0.0.1", 0))
        silent.listen(0)  # Linux drops what comes when the queue is full
        for each in (first, second):
            each.setblocking(False)
            each.connect_ex(silent.getsockname())
        with pytest.raises(LayerError, match=r"no way there: no answer within 0\.2 s") as caught:
            reach(config_of(tmp_path / "c.json5", f"tcp/127.0.0.1:{silent.getsockname()[1]}"), 0.2)
    assert caught.value.layer is Layer.ROUTE


def test_who_takes_connections_and_says_nothing_has_refused_no_password(tmp_path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        failed = failure(config_of(tmp_path / "c.json5", f"tcp/127.0.0.1:{silent.getsockname()[1]}"))
    assert failed.layer is Layer.PORT
    assert "it takes connections, but said nothing for 1.0 s: the link is too thin" in str(failed)


AUTH = "transport__auth__usrpwd__"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "layer", "words"),
    [
        ({"connect__endpoints": "tls/127.0.0.1:{port}"}, Layer.TLS_NAME, "for another name than '127.0.0.1'"),
        ({"connect__endpoints": "tcp/localhost:{port}"}, None, "or it wants TLS, as tls/localhost:{port}, or"),
        ({f"{AUTH}password": "guess"}, Layer.PASSWORD, "user 'alice' or its password is refused"),
        ({f"{AUTH}user": "eve", f"{AUTH}password": "nothing"}, Layer.ROLE, "user 'eve' is let in, but sees no logger"),
    ],
)
def test_what_is_wrong_in_a_client_file_is_a_matter_of_its_layer(network, tmp_path, values, layer, words) -> None:
    endpoints = {name: [value.format(port=network.port)] for name, value in values.items() if "endpoints" in name}
    failed = failure(network.changed(tmp_path / "c.json5", **values | endpoints))
    assert layer in (failed.layer, None)
    assert words.format(port=network.port) in str(failed)


@pytest.mark.slow
def test_a_certificate_of_somebody_else_is_a_matter_of_the_tls_authority(network, tmp_path) -> None:
    other = make_network(tmp_path / "other", ["localhost"], network.port, {"alice": "operator"})
    failed = failure(str(other.clients["alice"]))
    assert (failed.layer, "not of the authority that we trust" in str(failed)) == (Layer.TLS_AUTHORITY, True)


@pytest.mark.slow
def test_a_certificate_that_ran_out_is_a_matter_of_the_tls_date(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("silo.cli.network.authority.ROBOT_DAYS", -1)
    port = free_port()
    made = make_network(tmp_path / "lab", ["localhost"], port, {"alice": "operator"}, "127.0.0.1")
    logger = silo.Logger("late", folder=tmp_path, script=tmp_path / "late.yaml")
    logger.add(np.zeros(1), "x")
    with logger.serve(config=made.server / "server.json5"):
        failed = failure(str(made.clients["alice"]))
    logger.close()
    assert (failed.layer, "not valid today" in str(failed)) == (Layer.TLS_DATE, True)


def test_a_robot_whose_certificate_ran_out_says_so_when_it_starts(tmp_path, monkeypatch, caplog) -> None:
    users = {"alice": "operator"}
    monkeypatch.setattr("silo.cli.network.authority.ROBOT_DAYS", -1)
    server = make_network(tmp_path / "lab", ["localhost"], 7447, users).server
    config = str(server / "server.json5")
    (words,) = not_valid_today(config)
    ends = subprocess.run(
        ["openssl", "x509", "-in", server / "certificate.pem", "-noout", "-enddate", "-dateopt", "iso_8601"],
        capture_output=True, text=True, check=True,
    ).stdout.strip().removeprefix("notAfter=")  # fmt: skip
    assert words.startswith(
        f"{server / 'certificate.pem'}: this certificate ran out on {ends[:16]} UTC: nobody gets in"
    )
    Helper(None, "late", ServingOptions(config=config))._authentication(server)
    assert f"late: {words}" in caplog.messages
    monkeypatch.setattr("silo.cli.network.authority.ROBOT_DAYS", 825)
    make_network(tmp_path / "lab", [], 7447, users)
    assert list(not_valid_today(config)) == []
    with monkeypatch.context() as early:
        early.setattr("silo.net.access.certificates.time.time", lambda: 1.0)
        assert "valid from" in next(not_valid_today(config))


@pytest.mark.slow
def test_another_silo_is_a_matter_of_the_version(network, monkeypatch) -> None:
    monkeypatch.setattr("silo.fleet.exchange.PROTOCOL", PROTOCOL)
    monkeypatch.setattr("silo.rpc.versions.PROTOCOL", PROTOCOL + 1)
    failed = failure(str(network.made.clients["alice"]))
    assert (failed.layer, "runs an older silo" in str(failed)) == (Layer.VERSION, True)


@pytest.mark.slow
def test_commands_say_what_the_doctor_says_and_do_not_exit_with_0(network, tmp_path, mine, capsys) -> None:
    wrong = network.changed(tmp_path / "c.json5", transport__auth__usrpwd__password="guess")
    for words in (["ls"], ["stop", "walker"], ["info", "walker"]):
        assert run([*words, "--config", wrong]) == EXIT_NO_LOGGER
        assert "user 'alice' or its password is refused" in capsys.readouterr().err
    assert run(["remote", "doctor", wrong]) == EXIT_NO_LOGGER
    assert "FAILS   password" in capsys.readouterr().out
    assert run(["remote", "doctor", str(network.made.clients["bob"])]) == 0
    assert "may look, not change" in capsys.readouterr().out


@pytest.mark.slow
def test_a_remote_that_fails_does_not_hide_the_loggers_of_this_computer(network, bench, mine, capsys) -> None:
    assert run(["remote", "add", "gone", f"tcp/127.0.0.1:{free_port()}"]) == 0
    assert run(["remote", "add", "lab", str(network.made.clients["bob"])]) == 0
    capsys.readouterr()
    assert run(["ls"]) == 0
    shown = capsys.readouterr()
    assert [line.split()[0] for line in shown.out.splitlines()[1:]] == ["bot", "walker"]
    assert "remote 'gone'" in shown.err
    assert "nobody listens on port" in shown.err


def test_init_again_adds_a_user_and_keeps_authority_and_passwords(tmp_path) -> None:
    first = make_network(tmp_path / "lab", ["robot3.local", "10.0.0.7"], 7447, {"alice": "operator"})
    authority = (tmp_path / "lab" / "ca.pem").read_bytes()
    alice = written(str(first.clients["alice"]))
    again = make_network(tmp_path / "lab", [], 7447, {"carol": "viewer"})
    assert sorted(again.clients) == ["alice", "carol"]
    assert (tmp_path / "lab" / "ca.pem").read_bytes() == authority
    assert written(str(again.clients["alice"])) == alice
    assert {path.stat().st_mode & 0o077 for path in (again.server / "key.pem", again.clients["carol"])} == {0}
    shown = subprocess.run(
        ["openssl", "x509", "-in", again.server / "certificate.pem", "-noout", "-text"], capture_output=True, check=True
    )
    assert b"DNS:robot3.local, IP Address:10.0.0.7" in shown.stdout


@pytest.mark.parametrize("older", [False, True])
def test_init_again_keeps_address_and_port_of_its_own_that_nobody_says_anew(tmp_path, capsys, older) -> None:
    lab = tmp_path / "lab"
    where = ["--host", "10.0.0.7", "--port", "17450", "--listen", "127.0.0.1"]
    assert run(["remote", "init", str(lab), *where, "--user", "alice:operator"]) == 0
    before = [written(str(lab / "clients" / "alice.json5")), (lab / "server" / "server.json5").read_text()]
    if older:  # which wrote neither down
        known = json.loads((lab / "network.json").read_text())
        (lab / "network.json").write_text(json.dumps({name: known[name] for name in ("hosts", "users")}))
    assert run(["remote", "init", str(lab), "--user", "carol"]) == 0
    assert written(str(lab / "clients" / "alice.json5")) == before[0]
    assert '"tls/127.0.0.1:17450"' in before[1]
    assert '"tls/127.0.0.1:17450"' in (lab / "server" / "server.json5").read_text()
    assert run(["remote", "init", str(lab), "--port", "17451", "--listen", "::1"]) == 0
    assert '"tls/[::1]:17451"' in (lab / "server" / "server.json5").read_text()


def test_init_removes_a_user_who_is_refused_from_then_on(mine, capsys) -> None:
    folder = mine / "lab"
    assert run(["remote", "init", str(folder), "--host", "h", "--user", "alice", "--user", "bob:operator"]) == 0
    before = written(str(folder / "clients" / "bob.json5"))
    assert run(["remote", "init", str(folder), "--remove", "bob"]) == 0
    assert "bob:  is removed" in capsys.readouterr().out
    assert [line.split(":")[0] for line in (folder / "server" / "users.txt").read_text().splitlines()] == ["alice"]
    assert "bob" not in (folder / "server" / "server.json5").read_text()
    assert [path.name for path in (folder / "clients").iterdir()] == ["alice.json5"]
    assert run(["remote", "init", str(folder), "--user", "bob"]) == 0  # somebody else by then
    after = written(str(folder / "clients" / "bob.json5"))
    assert after["transport"]["auth"] != before["transport"]["auth"]
    for words in (["--remove", "carol"], ["--remove", "bob", "--user", "bob"]):
        assert run(["remote", "init", str(folder), *words]) == 1
        assert "nothing was changed" in capsys.readouterr().err


@pytest.mark.parametrize("host", ["x y", "", "a/b", "tls/robot3", "robot3:7447"])
def test_a_host_that_can_not_be_is_refused(mine, capsys, host) -> None:
    assert run(["remote", "init", str(mine / "lab"), "--host", host, "--user", "alice"]) == 1
    assert f"as robot3.local or 10.0.0.7, got '{host}'; nothing was made" in capsys.readouterr().err
    assert not (mine / "lab").exists()


@pytest.mark.parametrize(
    ("of", "word"),
    [
        *((role_of, word) for word in ("alice:boss", "a b:viewer", ":viewer", "local:operator")),
        *((robot_of, name) for name in ("local", "robots", "a b", "", "a:b", ".x", "x" * 65)),
    ],
)
def test_a_user_or_robot_who_can_not_be_is_refused(of, word) -> None:
    words = {
        role_of: "--user takes NAME:ROLE, of letters and digits and viewer or operator or robot, got '{}'",
        robot_of: "--robot takes the host name of one robot, letters, digits, _ . and -, and not 'local' or 'robots', "
        "got '{}'",
    }[of].format(word)
    if word.startswith("local:"):
        words = "the user 'local' is who works on the robot itself; take another name"
    with pytest.raises(SiloError) as refused:
        of(word)
    assert str(refused.value) == f"{words}; nothing was made"


@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")
def test_init_makes_a_file_for_each_robot_and_one_more_later(mine, capsys) -> None:
    folder = mine / "lab"
    given = ["--host", "router.local", "--user", "alice:operator", "--robot", "robot3", "--robot", "robot4"]
    assert run(["remote", "init", str(folder), *given]) == 0
    before = {name: (folder / "clients" / f"{name}.json5").read_text() for name in ("robot3", "robot4")}
    assert written(str(folder / "clients" / "robot3.json5"))["metadata"]["silo"]["robot"] == "robot3"
    assert before["robot3"] != before["robot4"]
    assert run(["remote", "init", str(folder), "--robot", "robot5"]) == 0
    assert 'log.serve(config="robot5.json5")' in capsys.readouterr().out
    assert (folder / "clients" / "robot3.json5").read_text() == before["robot3"]
    control = written(str(folder / "server" / "server.json5"))["access_control"]
    sent = {key for rule in control["rules"] if rule["id"].startswith("robot4: ") and rule["flows"] == ["ingress"]
            for key in rule["key_exprs"]}  # fmt: skip
    assert all(key.startswith("silo/robot4~$*/*/") for key in sent)
    assert {name for policy in control["policies"] for name in policy["subjects"]} == {
        "alice",
        "robot3",
        "robot4",
        "robot5",
    }
    assert {path.stat().st_mode & 0o077 for path in (folder / "clients").iterdir()} == {0}


@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")
@pytest.mark.parametrize("words", [["--user", "robot3"], ["--robot", "alice"], ["--user", "x", "--robot", "x"]])
def test_a_name_is_that_of_a_person_or_of_a_robot(mine, capsys, words) -> None:
    folder = mine / "lab"
    assert run(["remote", "init", str(folder), "--host", "h", "--user", "alice", "--robot", "robot3"]) == 0
    capsys.readouterr()
    assert run(["remote", "init", str(folder), *words]) == 1
    assert "take another name; nothing was changed" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------ trying again by itself


@pytest.mark.slow
def test_watch_waits_for_a_way_that_is_not_there_yet(bench, mine, capsys, monkeypatch) -> None:
    port = free_port()
    path = config_of(mine / "desk.json5", f"tcp/127.0.0.1:{port}")
    server = mine / "server.json5"
    server.write_text(json.dumps({"listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}))
    bench.start(5)

    def listen() -> None:  # while it waits, somebody begins to listen
        bench.serving.close()
        bench.serving = bench.logger.serve(config=server)

    monkeypatch.setattr("silo.cli.common._pause", listen)
    assert run(["watch", "bot", "x", "-n", "1", "--config", path]) == 0
    shown = capsys.readouterr()
    assert "nobody listens on port" in shown.err
    assert "trying again every 1 s" in shown.err
    assert "/log/x" in shown.out
