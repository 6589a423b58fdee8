"""Remote access by the example configurations, on loopback: roles by user, certificates, words for what is refused."""

import json
import shutil
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import State
from silo.errors import ConnectionLostError, RefusedError
from silo.fleet.resolving import discover

pytestmark = pytest.mark.slow

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture
def port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def logger(tmp_path):
    made = silo.Logger("far", folder=tmp_path, script=tmp_path / "far.yaml")
    made.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
    yield made
    made.close()


@pytest.fixture
def guarded(logger, tmp_path, port):
    """The logger behind passwords; makes client configurations."""
    users = tmp_path / "users.txt"
    users.write_text("viewer:look\nengineer:change\n")
    text = (CONFIG / "access-control.json5").read_text()
    text = text.replace("tcp/0.0.0.0:7460", f"tcp/127.0.0.1:{port}").replace("/etc/silo/users.txt", str(users))
    (tmp_path / "server.json5").write_text(text)
    logger.serve(config=tmp_path / "server.json5")

    def client_config(user: str, password: str) -> str:
        path = tmp_path / f"{user}-{password}.json5"
        auth = {"usrpwd": {"user": user, "password": password}}
        endpoints = [f"tcp/127.0.0.1:{port}"]
        path.write_text(json.dumps({"connect": {"endpoints": endpoints}, "transport": {"auth": auth}}))
        return str(path)

    return client_config


def test_viewer_sees_values_but_may_not_edit(guarded, logger, until) -> None:
    logger.start()
    with Client.connect("far", config=guarded("viewer", "look")) as client:
        assert not client._hello().may_edit
        with client.view(["/log/x"], rate_hz=30) as view:
            logger.collect()
            until(view.frame)
        with pytest.raises(RefusedError, match=r"may look at .*, not change it"):
            client.stop()
    assert logger.is_running


def test_viewer_may_list_and_fetch_recordings_but_not_delete_them(guarded, logger, tmp_path) -> None:
    logger.start()
    logger.collect()
    (saved,) = logger.save()
    name = Path(saved.path).name
    with Client.connect("far", config=guarded("viewer", "look")) as client:
        assert [one.files[0].name for one in client.recordings().recordings] == [name]
        assert client.fetch(name, tmp_path / "here").read_bytes() == Path(saved.path).read_bytes()
        with pytest.raises(RefusedError, match=r"may look at .*, not change it"):
            client.delete_recording(name)
    assert Path(saved.path).exists()


def test_engineer_may_change(guarded, logger) -> None:
    with Client.connect("far", config=guarded("engineer", "change")) as client:
        assert client._hello().may_edit
        assert client.start().state is State.RUNNING
    assert logger.is_running


def test_wrong_password_is_told_with_what_to_check(guarded) -> None:
    with pytest.raises(ConnectionLostError, match="user 'viewer' or its password is refused"):
        Client.connect("far", config=guarded("viewer", "guess"))


def test_a_denied_change_is_an_event_and_counted_and_who_only_looks_leaves_none(guarded, logger, capsys) -> None:
    with Client.connect("far") as local:
        with Client.connect("far", config=guarded("viewer", "look")) as client:
            client._hello()
            client.status()
            assert local.status().denied == 0
            for _ in range(20):
                with pytest.raises(RefusedError, match=r"may look at .*, not change it"):
                    client.stop()
        assert local.status().denied == 20
        (told,) = [one for one in local.events() if one.kind == "denied"]
        assert told.text == "change denied: stop (no role for it)"
        assert told.who.startswith("viewer (proven) from ")
    assert run(["ls", "far"]) == 0
    header, row = capsys.readouterr().out.splitlines()
    assert row[header.index("DENIED") :].split()[0] == "20"


def test_wrong_passwords_are_an_event_and_counted(guarded, until) -> None:
    wrong = guarded("viewer", "guess")
    with Client.connect("far") as local:
        for _ in range(14):
            with pytest.raises(ConnectionLostError):
                Client.connect("far", config=wrong)
        until(lambda: local.status().denied >= 14)
        (told,) = [one for one in local.events() if one.kind == "denied"]
        assert told.text == "login refused: wrong user or password"
        assert told.who == "somebody at 127.0.0.1"


@pytest.mark.parametrize("words", [[], ["x"], ["--zenoh"], ["x", "--json"]])
def test_a_password_is_printed_by_no_command(guarded, capsys, words) -> None:
    for config in ([], ["--config", guarded("viewer", "look")]):
        assert run([*config, "address", "far", *words]) == 0
        said = capsys.readouterr()
        assert '"..."' in said.out
        assert "look" not in said.out + said.err.replace("looking", "")
        assert 'a password is left out ("..."): --to FILE writes all of it, for you alone\n' in said.err


def test_a_configuration_with_a_password_is_a_file_of_its_user_alone(guarded, tmp_path, capsys) -> None:
    file, planted = tmp_path / "far.json5", tmp_path / "planted"
    file.write_text("of before")
    file.chmod(0o644)
    assert run(["--config", guarded("viewer", "look"), "address", "far", "--to", str(file)]) == 0
    assert file.stat().st_mode & 0o777 == 0o600
    assert json.loads(file.read_text())["transport"]["auth"]["usrpwd"]["password"] == "look"
    assert "look" not in capsys.readouterr().out
    assert discover(config=str(file)).loggers
    planted.write_text("mine")
    file.unlink()
    file.symlink_to(planted)
    assert run(["address", "far", "--to", str(file)]) == 0
    assert planted.read_text() == "mine"
    assert run(["address", "far", "--to", str(tmp_path / "nowhere" / "x")]) == 1


def test_local_clients_need_no_password(guarded) -> None:
    with Client.connect("far") as client:
        assert client._hello().may_edit


def test_nothing_with_passwords_is_left_behind(guarded, logger, runtime) -> None:
    assert {path.stat().st_mode & 0o077 for path in runtime.iterdir()} == {0}
    logger.close()
    assert list(runtime.iterdir()) == []


def test_port_that_is_taken_is_told_to_the_robot_program(logger, tmp_path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        (tmp_path / "server.json5").write_text(json.dumps({"listen": {"endpoints": [endpoint]}}))
        with pytest.raises(ConnectionLostError, match=r"didn't start: can't listen"):
            logger.serve(config=tmp_path / "server.json5")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")
def test_certificates_let_in_who_has_one_of_the_same_authority(logger, tmp_path, port) -> None:
    def openssl(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=tmp_path, capture_output=True, check=True)

    openssl(
        "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=ca", "-keyout", "ca-key.pem", "-out", "ca.pem"
    )
    (tmp_path / "ext").write_text("subjectAltName=DNS:localhost")
    for name in ("robot", "alice"):
        openssl(
            "req", "-newkey", "rsa:2048", "-nodes", "-subj", f"/CN={name}", "-keyout", f"{name}-key.pem", "-out", "csr"
        )
        signing = ["-CA", "ca.pem", "-CAkey", "ca-key.pem", "-CAcreateserial", "-extfile", "ext"]
        openssl("x509", "-req", "-in", "csr", *signing, "-out", f"{name}.pem")
    text = (CONFIG / "tls.json5").read_text()
    text = text.replace("tls/0.0.0.0:7461", f"tls/127.0.0.1:{port}").replace("/etc/silo", str(tmp_path))
    (tmp_path / "server.json5").write_text(text)
    logger.serve(config=tmp_path / "server.json5")

    def connect(**certificate: object) -> str:
        tls = {"root_ca_certificate": f"{tmp_path}/ca.pem", **certificate}
        config = {"connect": {"endpoints": [f"tls/localhost:{port}"]}, "transport": {"link": {"tls": tls}}}
        (tmp_path / "client.json5").write_text(json.dumps(config))
        with Client.connect("far", config=str(tmp_path / "client.json5")) as client:
            return client.status().logger

    mine = {"connect_certificate": f"{tmp_path}/alice.pem", "connect_private_key": f"{tmp_path}/alice-key.pem"}
    assert connect(enable_mtls=True, **mine) == "far"
    with pytest.raises(ConnectionLostError):
        connect()
