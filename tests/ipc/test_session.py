import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from silo.client.client import Client
from silo.core.runtime import user_name
from silo.errors import ConnectionLostError
from silo.net import keys
from silo.net.access.senders import local_identity
from silo.net.found import LoggerAddress
from silo.net.session import (
    MAX_SOCKET_PATH,
    Beside,
    close,
    leading_to,
    open_client,
    open_server,
    owner_is_gone,
    socket_path,
)
from silo.net.sessions import _shown

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


@pytest.mark.parametrize(
    ("beside", "read", "ask", "says"),
    [
        (Beside.SECRET, "read_text", leading_to, lambda path: {"connect": {"endpoints": [f"unixsock-stream/{path}"]}}),
        (Beside.OWN, "read_bytes", _shown, lambda _: (None, local_identity(user_name(os.getuid())))),
    ],
)
def test_a_word_that_goes_with_its_server_while_it_is_read_is_none(runtime, monkeypatch, beside, read, ask, says):
    path = socket_path(runtime, "bot", PID)
    beside.of(path).write_text("local:1f")
    plain = getattr(Path, read)

    def gone(file: Path) -> object:
        file.unlink(missing_ok=True)
        return plain(file)

    monkeypatch.setattr(Path, read, gone)
    assert ask(path) == says(path)


def test_socket_path_that_is_too_long_is_told_with_its_length() -> None:
    longest = Path("/" + "x" * (MAX_SOCKET_PATH - len("//bot.7.sock")))
    assert socket_path(longest, "bot", 7) == longest / "bot.7.sock"
    with pytest.raises(ConnectionLostError, match=r"too long for a socket.*SILO_RUNTIME_DIR"):
        socket_path(longest, "bot", 77)


def test_client_of_a_socket_without_listener_says_so(runtime: Path) -> None:
    with pytest.raises(ConnectionLostError, match="nobody listens"):
        open_client(runtime / "bot.1.sock")


class Starved:
    """Stands before a server: what comes first is met by `greet`, and what comes then is let through."""

    def __init__(self, path: Path, behind: Path, greet: Callable[[socket.socket], bool]) -> None:
        """`greet` returns whether that connection is let through, too."""
        self.path, self.count = path, 0
        self._behind, self._greet = behind, greet
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            client, _ = self._listener.accept()
            self.count += 1
            threading.Thread(target=self._meet, args=(client, self.count == 1), daemon=True).start()

    def _meet(self, client: socket.socket, first: bool) -> None:
        with client, socket.socket(socket.AF_UNIX) as server:
            if first and not self._greet(client):
                return
            server.connect(str(self._behind))
            back = threading.Thread(target=self._copy, args=(server, client), daemon=True)
            back.start()
            self._copy(client, server)
            back.join()

    @staticmethod
    def _copy(source: socket.socket, to: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                to.sendall(data)
            to.shutdown(socket.SHUT_WR)


def test_client_that_was_closed_out_by_a_starved_server_comes_again(
    server: tuple[zenoh.Session, Path], runtime: Path
) -> None:
    starved = Starved(runtime / "starved.sock", server[1], lambda client: False)
    close(open_client(starved.path, open_s=60.0))
    assert starved.count == 2


def test_a_client_comes_again_while_it_may_wait(bench, runtime: Path) -> None:
    starved = Starved(runtime / "starved.sock", Path(bench.serving.socket_path), lambda client: False)
    with Client.connect(LoggerAddress("bot", os.getpid(), str(starved.path), ""), timeout_s=60.0) as client:
        assert client.status().logger == "bot"
    assert starved.count == 2


def test_client_waits_for_a_starved_server_as_long_as_it_was_told_to(
    server: tuple[zenoh.Session, Path], runtime: Path
) -> None:
    met, gave_up = threading.Event(), threading.Event()

    def greet(client: socket.socket) -> bool:
        met.set()
        return gave_up.wait(60)

    starved = Starved(runtime / "starved.sock", server[1], greet)
    silent = socket.socket(socket.AF_UNIX)
    silent.bind(str(runtime / "silent.sock"))
    silent.listen()
    with silent, ThreadPoolExecutor(1) as beside:
        patient = beside.submit(open_client, starved.path, open_s=60.0)
        assert met.wait(60)
        with pytest.raises(ConnectionLostError, match="its helper process doesn't answer"):
            open_client(runtime / "silent.sock")
        gave_up.set()
        close(patient.result(60))
    assert starved.count == 1  # who came later gave up sooner


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
    root = keys.Root(name.replace("/", ""), name.replace("/", "."), "1f")
    assert not set("*$?# ") & set(str(root))
    assert keys.root_of(root.key("ask")) == root


def test_topics_of_names_that_differ_in_reserved_characters_differ() -> None:
    root = keys.Root("host", "bot")
    assert len({root.topic(name) for name in ("/a*", "/a$", "/a?", "/a#", "/a%", "/a%2A", "/a", "/@a")}) == 8
