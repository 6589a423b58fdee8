"""A link that is lost under a call, of a helper process that lives: who asks hears what is so, and no other error."""

import os
import signal

import pytest
from msgspec.structs import replace

from silo.client import connection
from silo.client.client import Client
from silo.errors import ConnectionLostError
from silo.fleet.exchange import NoAnswerError
from silo.live.topic import Topic
from silo.net.session import close
from silo.rpc.declaring import Do
from silo.rpc.published import Event, EventKind
from tests.waiting import DEADLINE_S, freeze, wait_until

pytestmark = pytest.mark.slow


def cut_once(bench, client: Client) -> None:
    """Have the client's session end, as that of a helper process which stood still for too long."""
    freeze(bench.serving.helper_pid)
    wait_until(lambda: not client.connected)
    os.kill(bench.serving.helper_pid, signal.SIGCONT)


def test_what_reads_is_asked_again_in_the_next_session(bench, monkeypatch) -> None:
    asked: list[object] = []
    with Client.connect("bot", timeout_s=min(DEADLINE_S, 60)) as client:
        exchange = connection.exchange

        def late(mine, *arguments, **options):
            if not asked:
                cut_once(bench, client)
            asked.append(mine)
            return exchange(mine, *arguments, **options)

        monkeypatch.setattr(connection, "exchange", late)
        assert client.status().helper_pid == bench.serving.helper_pid
        assert len(set(map(id, asked))) == 2


def test_a_change_that_a_cut_swallowed_is_not_told_as_one_that_the_user_may_not_make(client, monkeypatch) -> None:
    exchange, cut = connection.exchange, True

    def over_a_link_that_comes_back(mine, root, request, *arguments, as_change=False, **options):
        nonlocal cut
        if cut and (as_change or request.key == Do.key):
            raise NoAnswerError("the link is cut")
        cut = False  # what reads is asked until it is there
        return exchange(mine, root, request, *arguments, as_change=as_change, **options)

    monkeypatch.setattr(connection, "exchange", over_a_link_that_comes_back)
    assert client.mark("pushed").text == "pushed"
    assert not cut
    assert [one.text for one in client.events()].count("pushed") == 1


def test_what_happens_while_the_link_is_lost_is_told_once_when_it_is_back(bench, monkeypatch) -> None:
    told: list[Event] = []
    others: list[Event] = []
    bench.start(1)
    try_again = connection.Connection._try_again
    with Client.connect("bot") as client:
        client.on_event(told.append)
        client.mark("before")
        wait_until(lambda: [event for event in told if event.text == "before"])
        monkeypatch.setattr(connection.Connection, "_try_again", lambda _: None)
        cut_once(bench, client)
        with Client.connect("bot") as other:
            other.on_event(others.append)
            other.mark("meanwhile")
            bench.logger.mark("by the program")
            bench.ticks(1)
            wait_until(lambda: len([event for event in others if event.kind is EventKind.MARKER]) == 2)
        monkeypatch.setattr(connection.Connection, "_try_again", try_again)
        wait_until(lambda: client.connected)
        client.mark("after")
        wait_until(lambda: [event for event in told if event.text == "after"])
    marks = [event for event in told if event.kind is EventKind.MARKER]
    assert [event.text for event in marks] == ["before", "meanwhile", "by the program", "after"]
    unnumbered = {"number": 0, "status": None}
    assert [replace(event, **unnumbered) for event in marks[1:3]] == [replace(event, **unnumbered) for event in others]


def test_a_session_that_ends_just_now_is_told_as_a_lost_connection(client) -> None:
    view = client.view(["/log/x"])
    close(client._connection.borrowed().session)  # as its thread does, between a look at it and its use
    view.close()
    for ask in (lambda: client.topic("/log/x"), lambda: client.view(["/log/x"]), lambda: client.mark("pushed")):
        with pytest.raises(
            ConnectionLostError, match=r"lost the connection|no connection"
        ):  # its thread may be quicker
            ask()


def test_a_session_that_ends_under_the_thread_that_watches_it_is_followed_by_another_one(client) -> None:
    was = client._connection.sessions
    close(client._connection.borrowed().session)
    wait_until(lambda: client._connection.sessions > was)
    assert client.status().logger == "bot"


def test_what_subscribes_while_the_session_is_replaced_hears_the_next_one(bench, client, monkeypatch) -> None:
    attach = Topic.attach

    def overtaken(topic, *arguments):
        attach(topic, *arguments)
        monkeypatch.undo()
        cut_once(bench, client)
        wait_until(lambda: client.connected)

    monkeypatch.setattr(Topic, "attach", overtaken)
    topic = client.topic("/log/x")
    bench.logger.start()

    def heard() -> object:
        bench.ticks(5)
        return topic.read()

    wait_until(heard)
