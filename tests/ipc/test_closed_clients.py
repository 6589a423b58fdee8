"""What a client says that was closed, what commands end with, and how many lines tell of robots that were stopped."""

import os
import signal
from collections.abc import Callable

import pytest

import silo
from silo.cli import codes
from silo.cli.conditions.alarms import _code
from silo.cli.loggers.ls import _reasons
from silo.cli.main import run
from silo.client.client import Client
from silo.conditions.requests import Alarms
from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.elements import State, Status
from silo.errors import ConnectionLostError, SiloError
from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from tests.ipc.test_follow import FINE

CHILD_S = 10  # after which a child that waits for ever is ended


@pytest.mark.slow
def test_a_closed_client_says_that_it_is_closed_and_how_to_have_another(bench) -> None:
    client = Client.connect("bot")
    client.close()
    for ask in (client.status, lambda: client.mark("late"), lambda: client.view(["/log/x"])):
        with pytest.raises(ConnectionLostError, match=r"this client of logger 'bot' is closed; silo\.connect\('bot'\)"):
            ask()
    assert "closed" in repr(client)
    assert "closed" in client._repr_html_()
    assert not client.connected


def told_in_a_fork(do: Callable[[], object]) -> str:
    """What a child of this process, forked off it now, is told where it does this."""
    mine, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(CHILD_S)
        try:
            os.write(theirs, repr(do()).encode())
        except SiloError as error:
            os.write(theirs, str(error).encode())
        finally:
            os._exit(0)
    os.close(theirs)
    text = os.read(mine, 4096).decode()
    os.close(mine)
    os.waitpid(child, 0)
    return text


def iterate(client: Client) -> None:
    for _ in client.topic("x"):
        pass


@pytest.mark.slow
@pytest.mark.parametrize(
    "do",
    [
        lambda client: client.status(),
        lambda client: client.mark("from a child"),
        lambda client: client.view(["/log/x"]),
        lambda client: client.pin(["x"], 0, 1),
        lambda client: client._survey(["mean"]),
        iterate,
        lambda client: silo.connect("bot"),
        lambda client: silo.topic("silo:///bot/log/x"),
    ],
)
def test_a_forked_child_is_told_at_once_that_no_client_works_there(do, bench, client) -> None:
    text = told_in_a_fork(lambda: do(client))
    assert f"was forked from process {os.getpid()}" in text
    assert "get_context('spawn')" in text
    assert client.status().helper_pid  # that of the parent goes on


@pytest.mark.slow
def test_what_a_parent_has_open_can_be_closed_in_its_forked_child_and_goes_on_in_the_parent(bench, client, until):
    topic, view = client.topic("x"), client.view(["/log/x"])
    client.take_control()

    def close() -> str:
        for one in (topic, view, client):
            one.close()
        return "closed"

    assert told_in_a_fork(close) == "'closed'"
    bench.logger.start()

    def heard() -> bool:
        bench.ticks(1)
        return bool(topic.read())

    assert until(heard)
    assert client.status().control


def test_no_two_meanings_share_an_exit_code() -> None:
    numbers = [value for name, value in vars(codes).items() if name.startswith("EXIT_") and isinstance(value, int)]
    assert len(set(numbers)) == len(numbers)


def test_what_is_found_ends_otherwise_than_what_fails(tmp_path, monkeypatch, runtime_folder) -> None:
    monkeypatch.chdir(tmp_path)
    log = silo.Logger("bot", folder=".")
    log.add(lambda: 5.0, "x", unit="m")
    log.start()
    log.collect()
    log.stop()
    log.save("silo", name="run")
    assert run(["check", "run.silo", "--limit", "x=-,-,2,3"]) == codes.EXIT_FOUND
    assert run(["check", "run.silo", "--limit", "x=-,-,8,9"]) == 0
    for words in (["check", "none.silo"], ["check", "run.silo", "--never", "x +"], ["diff", "run.silo", "none.silo"]):
        assert run(words) == codes.EXIT_FAILED
    assert run(["check", "run.silo"]) == codes.EXIT_USAGE


def test_blind_limits_end_otherwise_than_a_logger_that_is_not_there(runtime_folder) -> None:
    blind = Alarms("run", 0, [LimitStatus("/log/x", "/log/x", LimitWord.BLIND)])
    assert _code(blind) == codes.EXIT_BLIND
    assert run(["alarms", "nosuch"]) == codes.EXIT_NO_LOGGER != codes.EXIT_BLIND


def stopped(name: str, reason: str, state: State = State.STOPPED) -> Member:
    status = Status(
        logger=name, host="robot", user="lab", pid=1, helper_pid=2, state=state, revision=1, frequency_hz=400.0,
        measured_hz=0.0, ticks=5, started_ns=FINE.started_ns, last_tick_ns=0, lost=0, elements=1, enabled=1, entries=1,
        max_time_s=0.0, prefix="/log", folder="/logs", script="robot.yaml", reason=reason,
    )  # fmt: skip
    return Member(LoggerAddress(name, 1, f"/run/{name}.sock", "lab"), status=status)


def test_robots_that_were_stopped_for_the_same_reason_share_a_line_and_each_dead_one_has_its_own() -> None:
    answers = [stopped(f"leg{number:02}", "stopped by ann@desk") for number in range(46)]
    answers += [
        stopped("arm", "time limit"),
        stopped("dog", "it died", State.DEAD),
        stopped("cat", "it died", State.DEAD),
    ]
    assert _reasons(answers) == [
        "leg00.1, leg01.1, leg02.1 and 43 more: stopped by ann@desk", "arm.1: time limit", "dog.1: it died",
        "cat.1: it died",
    ]  # fmt: skip
