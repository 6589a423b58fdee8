"""A change whose answer was lost is asked for again by its number, and done once, wherever the helper process died."""

import os
import signal
import threading

import pytest
from msgspec.structs import replace

import silo
from silo.client import connection
from silo.client.client import Client
from silo.core.elements import Edit, State
from silo.errors import ConnectionLostError, RefusedError
from silo.fleet.exchange import NoAnswerError
from silo.logger.serving import serving
from silo.polling import readable
from silo.requests import AddMark, Start
from silo.rpc.declaring import Do
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused
from silo.state.requests import HelloReply, Marked, StatusReply
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow


@pytest.fixture
def client(bench):
    with Client.connect("bot", timeout_s=DEADLINE_S) as connected:
        yield connected


@pytest.fixture
def silenced(monkeypatch):
    """Has the answer to the next change be lost; `before` is called instead of sending it, where that is given."""
    exchange, lost = connection.exchange, []

    def once(*, before=None):
        lost.append(before)

    def silent(mine, root, request, *arguments, **options):
        if request.key == Do.key and lost:
            before = lost.pop()
            if before is None:
                exchange(mine, root, request, *arguments, **options)
            else:
                before()
            raise NoAnswerError("nothing came")
        return exchange(mine, root, request, *arguments, **options)

    monkeypatch.setattr(connection, "exchange", silent)
    return once


@pytest.fixture
def killing(bench, monkeypatch):
    """Has the helper process be killed as the robot program does what it asks next: before, or once it is done."""
    answer, wanted = serving.answer, []

    def kill():
        process = os.pidfd_open(bench.serving.helper_pid)
        os.kill(bench.serving.helper_pid, signal.SIGKILL)
        assert readable(process, timeout_s=DEADLINE_S)  # it has ended
        os.close(process)

    def killed(logger, request):
        when = wanted.pop() if wanted else ""
        if when == "before":
            kill()
        reply = answer(logger, request)
        if when == "after":
            kill()
        return reply

    monkeypatch.setattr(serving, "answer", killed)
    return wanted


def marks(client) -> list[str]:
    return [one.text for one in client.events() if one.kind == EventKind.MARKER.value]


def kill_helper(bench, client) -> None:
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    wait_until(lambda: not client.connected)


def test_a_change_whose_answer_was_lost_is_done_once_and_answered_as_it_was(client, silenced, bench) -> None:
    silenced()
    assert client.start().state is State.RUNNING
    bench.ticks(3)
    silenced()
    assert client.mark("slipped").tick == 2
    assert marks(client) == ["slipped"]
    silenced()
    client.wait_saved(client.save())
    assert len(client.recordings().recordings) == 1
    silenced()
    client.stop()
    table = client.table()
    one = table.elements[0]
    silenced()
    edit = Edit(one.name, replace(one.options, divider=7))
    applied = client.apply([edit], table.revision)
    assert (applied.changed, applied.revision) == (1, client.table().revision)


@pytest.mark.parametrize("when", ["before", "after"])
def test_what_the_robot_program_does_is_done_once_if_the_helper_process_dies_meanwhile(
    when, client, killing, bench
) -> None:
    table = client.table()
    one = table.elements[0]
    killing.append(when)
    applied = client.apply([Edit(one.name, replace(one.options, divider=7))], table.revision)
    assert applied.changed == 1
    assert applied.revision == client.table().revision == table.revision + 1
    killing.append(when)
    assert client.start().state is State.RUNNING
    bench.ticks(3)
    killing.append(when)
    assert client.stop().state is State.STOPPED
    assert client.status().ticks == 3


def test_what_a_helper_process_never_saw_is_done_by_the_next_one_if_the_robot_program_does_it(
    client, silenced, bench
) -> None:
    silenced(before=lambda: kill_helper(bench, client))
    assert client.start().state is State.RUNNING


def test_what_a_helper_process_may_have_done_that_died_is_not_done_by_the_next_one(client, silenced, bench) -> None:
    client.start()
    bench.ticks(1)
    silenced(before=lambda: kill_helper(bench, client))
    with pytest.raises(ConnectionLostError, match="gave no answer to AddMark; look whether it was done"):
        client.mark("slipped")
    assert marks(client) == []
    wait_until(lambda: client.connected)
    asked = AddMark("slipped", client="me", number="1", asked_pid=os.getpid())
    reply = client._connection.exchange(asked, DEADLINE_S)
    assert isinstance(reply, Refused)
    assert "look whether it was done" in reply.text
    assert marks(client) == []


def test_a_robot_that_knows_no_numbers_is_not_asked_again(client, silenced, monkeypatch) -> None:
    learn = client._connection._learn

    def of_before(reply):
        return learn(replace(reply, numbered=False) if isinstance(reply, HelloReply) else reply)

    monkeypatch.setattr(client._connection, "_learn", of_before)
    silenced()
    with pytest.raises(ConnectionLostError, match="look whether it was done"):
        client.start()


def test_a_program_that_came_in_place_of_another_is_not_asked_for_what_that_one_was_asked(
    client, silenced, monkeypatch
) -> None:
    asked = Client._asked.fget
    silenced(before=lambda: monkeypatch.setattr(Client, "_asked", property(lambda self: ("another", asked(self)[1]))))
    with pytest.raises(ConnectionLostError, match="look whether it was done"):
        client.start()


def test_who_asks_again_while_it_is_being_done_is_answered_with_who_asked_first(client, bench, monkeypatch) -> None:
    answer, begun, go_on, done = serving.answer, threading.Event(), threading.Event(), []

    def slowly(logger, request):
        done.append(request)
        begun.set()
        assert go_on.wait(DEADLINE_S)
        return answer(logger, request)

    monkeypatch.setattr(serving, "answer", slowly)
    replies: list[object] = []
    request = Start(client="me", number="a-1")

    def ask():
        replies.append(client._connection.exchange(request, 8.0))

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
        assert begun.wait(DEADLINE_S)
    go_on.set()
    for thread in threads:
        thread.join()
    assert [type(reply) for reply in replies] == [StatusReply] * 3
    assert len(done) == 1


def test_numbers_of_several_clients_are_their_own(client, bench) -> None:
    client.start()
    bench.ticks(1)

    def mark(who, number, text):
        return client._connection.exchange(AddMark(text, client=who, number=number), DEADLINE_S)

    first = mark("anna", "1", "a")
    assert isinstance(first, Marked)
    assert mark("anna", "1", "a") == first
    assert mark("ben", "1", "b") != first
    assert mark("anna", "2", "c") != first
    assert mark("", "", "d") != mark("", "", "d")
    assert marks(client) == ["a", "b", "c", "d", "d"]


def test_what_was_refused_is_refused_again_with_the_same_words(client, silenced) -> None:
    silenced()
    with pytest.raises(RefusedError) as refused:
        client.mark("too early", tick=10**6)
    assert "there is no tick" in str(refused.value)
    assert silo.RefusedError is RefusedError
