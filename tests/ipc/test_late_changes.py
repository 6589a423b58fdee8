"""A change that takes long holds up no other; what a client was told to try again is never done afterwards."""

import os
import signal
import threading
from collections.abc import Callable

import pytest

from silo.client.client import Client
from silo.core.conditions import TriggerOptions
from silo.core.elements import FileType
from silo.errors import ConnectionLostError, GoesOnError, RefusedError
from silo.fleet.exchange import decode_reply, encoded
from silo.requests import AddMark
from silo.rpc.clocks import clock_s
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy
from silo.state.requests import Marked
from tests.waiting import freeze, wait_until

pytestmark = pytest.mark.slow


def marks(client: Client) -> list[str]:
    return [one.text for one in client.events() if one.kind == EventKind.MARKER.value]


def told(ask: Callable[[], object]) -> str:
    """What became of a change, as its client was told."""
    try:
        ask()
    except GoesOnError:
        return "goes on"
    except RefusedError as refused:
        assert "nothing was changed" in str(refused), refused
        return "refused"
    except ConnectionLostError:
        return "try again"
    return "done"


def test_a_mark_and_a_save_wait_for_nobodys_recorder(bench, client, heard) -> None:
    client.start()
    bench.ticks(20)
    client.record()
    pid = wait_until(lambda: client.recorders()[0].pid)
    freeze(pid)
    stopped = threading.Event()

    def stop() -> None:
        with Client.connect("bot") as other:
            other.stop_recorder()
        stopped.set()

    stopping = threading.Thread(target=stop)
    try:
        stopping.start()
        meanwhile = 0
        while not stopped.wait(0.05):
            client.mark(f"mark {meanwhile}")
            meanwhile += not stopped.is_set()
            if meanwhile == 10:
                client.save([FileType.SILO])
        assert meanwhile > 10
        heard.wait(EventKind.SAVED)
    finally:
        os.kill(pid, signal.SIGCONT)
        stopping.join()


def test_of_changes_for_a_stopped_robot_program_those_that_are_said_to_go_on_are_done_and_no_others(robots) -> None:
    robot = robots("bot")
    answers: dict[str, str] = {}

    def set_trigger(name: str) -> None:
        with Client.connect("bot") as one:
            ready.wait()
            answers[name] = told(lambda: one._set_trigger(TriggerOptions(name, "/log/x > 1e9")))

    names = ["a", "b", "c", "d"]
    ready = threading.Barrier(len(names))
    freeze(robot.pid)
    try:
        threads = [threading.Thread(target=set_trigger, args=(name,)) for name in names]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        os.kill(robot.pid, signal.SIGCONT)
    with Client.connect("bot") as client:
        client._set_trigger(TriggerOptions("last", "/log/x > 1e9"))  # after all that waited for the robot program
        there = {one.options.name for one in client.triggers().triggers}
    assert "try again" not in answers.values(), answers
    assert "goes on" in answers.values()
    assert there == {"last", *(name for name, word in answers.items() if word != "refused")}, answers


def test_what_reached_a_frozen_helper_process_is_not_done_when_it_goes_on(robots) -> None:
    robot = robots("bot")
    with Client.connect("bot") as client:
        freeze(robot.helper_pid)
        try:
            in_vain = AddMark(text="in vain")
            # the link is given up after two seconds, and with it what was sent
            assert told(lambda: client._connection.exchange(in_vain, 1.0)) == "try again"
        finally:
            os.kill(robot.helper_pid, signal.SIGCONT)
        wait_until(lambda: told(lambda: client.mark("again")) == "done")
        assert "in vain" not in marks(client)


def asked(client: Client, request: AddMark, until_s: float) -> object:
    """The answer to a request whose client waits so long by the helper's clock."""
    mine, root = client._connection.borrowed(), client._connection.root
    replies = mine.session.get(root.do(mine.user), payload=encoded(request, until_s), attachment=mine.proof)
    return decode_reply(next(iter(replies)).ok.payload.to_bytes(), "bot")


def test_a_change_whose_client_has_given_up_is_refused_and_one_that_waits_is_done(bench, client) -> None:
    client.start()
    bench.ticks(5)
    late = asked(client, AddMark(text="late"), clock_s() - 1)
    assert isinstance(late, Refused)
    assert late.why is RefusedWhy.LATE
    assert "nothing was changed" in late.text
    assert isinstance(asked(client, AddMark(text="in time"), clock_s() + 100), Marked)
    assert isinstance(asked(client, AddMark(text="of an older silo"), 0.0), Marked)
    assert marks(client) == ["in time", "of an older silo"]


def test_a_hello_tells_the_clock_of_the_helper_process(bench, client) -> None:
    before = clock_s()
    assert before <= client._hello().clock_s <= clock_s()
