import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from silo.errors import ConnectionLostError
from silo.net import keys
from silo.net.session import close, open_client, open_server, owner_is_gone, socket_path

PID = 4711


@pytest.fixture
def server(runtime: Path) -> Iterator[tuple[zenoh.Session, Path]]:
    session, path = open_server(runtime, "bot", PID)
    yield session, path
    close(session)


def test_server_opens_no_network_socket(server: tuple[zenoh.Session, Path]) -> None:
    assert psutil.Process().net_connections("inet") == []


def test_client_opens_no_network_socket(server: tuple[zenoh.Session, Path]) -> None:
    session = open_client(server[1])
    try:
        assert psutil.Process().net_connections("inet") == []
    finally:
        close(session)


def test_socket_and_lock_are_closed_to_other_users(server: tuple[zenoh.Session, Path]) -> None:
    for path in (server[1], Path(f"{server[1]}.lock")):
        assert path.stat().st_mode & 0o077 == 0


def test_closing_removes_socket_and_lock(runtime: Path) -> None:
    session, _ = open_server(runtime, "bot", PID)
    close(session)
    assert list(runtime.iterdir()) == []


def test_second_logger_of_a_name_in_a_process_gets_a_socket_of_its_own(server: tuple[zenoh.Session, Path]) -> None:
    session, path = open_server(server[1].parent, "bot", PID)
    try:
        assert path != server[1]
        assert not owner_is_gone(server[1])
    finally:
        close(session)


@pytest.mark.slow
def test_socket_of_a_killed_process_is_taken_over(runtime: Path) -> None:
    code = (
        "import sys, pathlib; from silo.net.session import open_server\n"
        f"session, path = open_server(pathlib.Path({str(runtime)!r}), 'bot', {PID})\n"
        "print(path, flush=True); sys.stdin.read()"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
    path = Path(child.stdout.readline().strip())
    assert not owner_is_gone(path)
    os.kill(child.pid, signal.SIGKILL)
    child.communicate()
    assert path.exists()
    assert owner_is_gone(path)
    session, again = open_server(runtime, "bot", PID)
    close(session)
    assert again == path


def test_socket_path_that_is_too_long_is_told_with_its_length() -> None:
    with pytest.raises(ConnectionLostError, match=r"too long for a socket.*SILO_RUNTIME_DIR"):
        socket_path(Path("/" + "x" * 100), "bot", PID)


def test_client_of_a_socket_without_listener_says_so(runtime: Path) -> None:
    with pytest.raises(ConnectionLostError, match="nobody listens"):
        open_client(runtime / "bot.1.sock")


def test_configuration_file_with_a_mistake_is_named(runtime: Path, tmp_path: Path) -> None:
    config = tmp_path / "bad.json5"
    config.write_text("{ mode: }")
    with pytest.raises(ConnectionLostError, match=r"bad\.json5: is not a configuration"):
        open_server(runtime, "bot", PID, str(config))


@pytest.mark.parametrize("name", ["access-control", "tls", "router"])
def test_example_configurations_are_understood_by_zenoh(name: str) -> None:
    path = Path(__file__).parents[2] / "config" / f"{name}.json5"
    assert "listen" in str(zenoh.Config.from_file(path))


@given(st.text(min_size=1).filter(lambda name: "\x00" not in name))
def test_every_element_name_has_a_topic_that_leads_back(name: str) -> None:
    try:
        name.encode()
    except UnicodeEncodeError:
        return
    key = keys.Root("host", "bot").topic(name)
    assert str(zenoh.KeyExpr(key)) == key
    assert keys.unescape(key.split("/topic/", 1)[1]) == name.strip("/")


def test_topics_of_names_that_differ_in_reserved_characters_differ() -> None:
    root = keys.Root("host", "bot")
    assert len({root.topic(name) for name in ("/a*", "/a$", "/a?", "/a#", "/a%", "/a%2A", "/a", "/@a")}) == 8
