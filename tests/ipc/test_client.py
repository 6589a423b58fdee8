"""Finding loggers, connecting, and what the client says when it can't."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

import silo
from silo.client.client import Client
from silo.client.connection import Connection
from silo.core.elements import State
from silo.errors import ConnectionLostError
from silo.fleet.exchange import NoAnswerError
from silo.fleet.fleet import asked_all
from silo.fleet.many import Asking
from silo.fleet.resolving import discover
from silo.requests import Start
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy
from tests.waiting import DEADLINE_S


def test_no_logger_says_what_to_do(runtime) -> None:
    with pytest.raises(ConnectionLostError, match=r"no logger is running on this host.*serve\(\).*silo demo"):
        Client.connect()


def test_logger_is_found_by_name_label_and_when_it_is_the_only_one_and_closed_as_often_as_one_likes(bench) -> None:
    with pytest.raises(ConnectionLostError, match=rf"no logger 'nix'.*there are: bot\.{os.getpid()}"):
        Client.connect("nix")
    for name in ("bot", f"bot.{os.getpid()}", ""):
        with Client.connect(name) as client:
            assert client.status().logger == "bot"
        client.close()
        with pytest.raises(ConnectionLostError, match="this client of logger 'bot' is closed"):
            client.status()


def test_a_folder_in_place_of_a_logger_is_told_what_lists_its_logs(bench, tmp_path, monkeypatch):
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        ConnectionLostError, match=r"no logger 'logs'.*\n'logs' is a folder: `silo runs` lists the logs"
    ):
        Client.connect("logs")


def test_the_link_is_watched_once_its_owner_is_ready(bench, until) -> None:
    (found,) = discover().loggers
    ready = False
    rounds = []
    connection = Connection(found, DEADLINE_S, "a test")
    try:
        ready = True
        connection.watch(lambda: rounds.append(ready))
        until(lambda: rounds)
    finally:
        connection.close()
    assert all(rounds)


def test_a_refused_hello_is_no_connection(bench, monkeypatch) -> None:
    refused = Refused(RefusedWhy.FAILED, "KeyError: 'x'")
    monkeypatch.setattr("silo.client.connection.exchange", lambda *_, **__: refused)
    with pytest.raises(ConnectionLostError, match=r"logger 'bot' can't say who it is: KeyError: 'x'"):
        Client.connect()


def test_survey_asks_all_loggers_at_the_same_time(bench, robots, monkeypatch) -> None:
    for number in range(3):
        robots(f"robot{number}")
    all_are_asked = threading.Barrier(4)
    ask = Asking.add

    def add(*words: object) -> None:
        all_are_asked.wait(DEADLINE_S)
        ask(*words)

    monkeypatch.setattr(Asking, "add", add)
    answers = asked_all().members
    assert [answer.found.name for answer in answers if answer.status] == ["bot", "robot0", "robot1", "robot2"]


@pytest.mark.usefixtures("cold")
def test_asking_needs_neither_numpy_nor_click_nor_textual(bench) -> None:
    code = (
        "import sys; from silo.client.connect import Client\n"
        "from silo.fleet.fleet import asked_all\n"
        "asked_all()\n"
        "with Client.connect('bot') as client: client.table()\n"
        "print({'numpy', 'click', 'textual', 'yaml', 'plotext', 'mcap'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.usefixtures("cold")
def test_program_that_forgets_to_close_still_ends(bench) -> None:
    code = "from silo.client.connect import Client; client = Client.connect('bot'); view = client.view(['/log/x'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    assert done.stderr == ""


def test_threads_may_share_a_client(bench, client) -> None:
    revisions: list[int] = []

    def ask() -> None:
        revisions.extend(client.table().revision for _ in range(20))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert revisions == [bench.logger._table.revision] * 80


def test_what_the_robot_program_does_reaches_clients_also_beside_a_callback_that_fails(
    bench, client, heard, caplog
) -> None:
    def fail(_: object) -> None:
        raise ValueError("no")

    client.on_event(fail)
    client.status()  # what it wants to hear has reached the helper process before this
    bench.logger.start()
    heard.wait(EventKind.STARTED)
    bench.logger.stop()
    assert heard.wait(EventKind.STOPPED).status.state is State.STOPPED
    assert "a callback failed" in caplog.text


def test_closed_logger_says_goodbye(bench, client, heard, until) -> None:
    links: list[bool] = []
    client.on_link(links.append)
    bench.logger.close()
    until(lambda: links == [False])
    assert heard.wait(EventKind.CLOSED)
    assert not client.connected


def test_what_the_end_of_the_link_overtakes_is_heard(bench, client, heard, until, monkeypatch) -> None:
    connection = client._connection
    events, is_gone = connection._events, connection._is_gone
    ended: list[bool] = []
    looks: list[object] = []

    class Overtaken:
        """Events that arrive right after somebody looked for them, the link having ended."""

        def try_recv(self) -> object:
            if ended and looks:
                return events.try_recv()
            looks.extend(ended)
            return None

    monkeypatch.setattr(connection, "_is_gone", lambda: is_gone() and not ended.append(True))
    monkeypatch.setattr(connection, "_events", Overtaken())
    bench.logger.close()
    assert heard.wait(EventKind.CLOSED)


def test_end_that_zenoh_does_not_tell_is_noticed(bench, client, until, monkeypatch) -> None:
    links: list[bool] = []
    client.on_link(links.append)
    monkeypatch.setattr(client._connection, "_is_gone", lambda: False)
    bench.logger.close()
    until(lambda: links == [False])


def test_a_client_that_is_closed_in_a_callback_lets_its_views_end(bench, client, until, caplog) -> None:
    view = client.view(["/log/x"])
    ended: list[bool] = []

    def end(_: object) -> None:
        client.close()
        view.close()
        ended.append(True)

    client.on_event(end)
    bench.logger.start()  # a start that the client asks for may be answered later than it is told
    until(lambda: ended and not client.connected)
    assert "a callback failed" not in caplog.text


def test_a_client_that_is_closed_during_a_look_at_its_link_lets_the_session_go(bench, client, monkeypatch) -> None:
    connection = client._connection

    def closed_meanwhile(_: Path) -> bool:
        connection._stop.set()
        return True

    monkeypatch.setattr("silo.client.connection.owner_is_gone", closed_meanwhile)
    connection._looked_s = 0.0
    connection._thread.join(DEADLINE_S)
    assert not client.connected


def test_logger_that_is_served_again_is_found_again(bench, client, until, tmp_path) -> None:
    before = client.status()
    bench.serving.close()
    until(lambda: not client.connected)
    bench.logger.serve()
    until(lambda: client.connected)
    assert client.status().logger == "bot"
    assert client.status().is_of_program(before)
    bench.logger.close()
    again = silo.Logger("bot", folder=tmp_path)
    with again.serve(), Client.connect("bot") as newer:
        assert newer.status().pid == before.pid  # as those of containers are
        assert not newer.status().is_of_program(before)


@pytest.mark.slow
def test_table_of_ten_thousand_elements_arrives(runtime, tmp_path) -> None:
    import numpy as np

    values = np.zeros(10_000)
    logger = silo.Logger("big", folder=tmp_path, script=tmp_path / "big.yaml")
    for place in range(10_000):
        logger.add(values[place : place + 1], f"e{place}")
    with logger.serve(), Client.connect("big") as client:
        assert len(client.table().elements) == 10_000
    logger.close()


# Python may lie where only root can read: all is imported, then the rights are dropped
PERSON = """
import os, sys, encodings.idna
from silo.fleet.many import Asking
from silo.client.connect import Client
from silo.client.connection import Connection
from silo.errors import SiloError
groups = [int(group) for group in sys.argv[1:]]
os.setgroups(groups), os.setgid(54322), os.setuid(54322)
try:
    with Client.connect("silo-test-theirs") as client:
        print("pid", client.status().pid)
except SiloError as error:
    print(error)
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
class TestOtherUsers:
    """A robot program runs as root, people log in as themselves."""

    shared_gid = 54323

    @pytest.fixture
    def robot_of(self, robots, monkeypatch: pytest.MonkeyPatch):
        """Starts a robot program in the real place, of which there is only one."""
        monkeypatch.delenv("SILO_RUNTIME_DIR")
        place = os.open(tempfile.gettempdir(), os.O_RDONLY)  # a folder, as a file of our own would stay
        fcntl.flock(place, fcntl.LOCK_EX)
        started = []

        def start(*group: str):
            started.append(robots("silo-test-theirs", *group))
            return started[-1]

        yield start
        for robot in started:  # killed with its helper, or its log would be offered for recovery ever after
            robot.end()
            for left in Path("/dev/shm/silo-0").glob(f"silo-test-theirs.{robot.pid}.*"):
                left.unlink()
        shutil.rmtree(f"/dev/shm/silo-0-{self.shared_gid}", ignore_errors=True)
        shutil.rmtree("/dev/shm/silo-54322", ignore_errors=True)
        os.close(place)

    def ask(self, *groups: int) -> str:
        """What a person in these groups gets to hear."""
        command = [sys.executable, "-c", PERSON, *map(str, groups)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
        return done.stdout + done.stderr

    def test_stranger_hears_whose_logger_it_is_and_what_to_do(self, robot_of) -> None:
        robot_of()
        answer = self.ask()
        assert re.search(r"user root runs .*silo-test-theirs.* in /dev/shm/silo-0, which is closed to you", answer)
        assert "serve(group=" in answer

    def test_member_of_the_group_may_talk_to_a_shared_logger(self, robot_of) -> None:
        robot = robot_of(str(self.shared_gid))
        assert self.ask(self.shared_gid) == f"pid {robot.pid}\n"

    def test_others_may_not_and_hear_which_group_to_join(self, robot_of) -> None:
        robot_of(str(self.shared_gid))
        assert f"usermod -aG {self.shared_gid}" in self.ask()


def test_a_change_whose_answers_are_all_lost_is_not_said_to_be_forbidden(client, bench, monkeypatch) -> None:
    exchange, sent = client._connection.exchange, []

    def overtaken(request, *words, **more):
        reply = exchange(request, *words, **more)
        if isinstance(request, Start):
            sent.append(request)
            raise NoAnswerError("the end came before the answer")
        return reply

    monkeypatch.setattr(client._connection, "exchange", overtaken)
    monkeypatch.setattr(Start, "timeout_s", 0.5)
    with pytest.raises(ConnectionLostError, match="no answer to Start; look whether it was done") as caught:
        client.start()
    assert len(sent) > 1
    assert len({one.number for one in sent}) == 1
    assert not isinstance(caught.value, NoAnswerError)
    assert client.status().state is State.RUNNING
