"""The id of a client is seen by all: what is called after it is its own all the same."""

from types import SimpleNamespace

import pytest

import silo
from silo.errors import RefusedError
from silo.history.requests import ClosePin, CloseStream, KeepPin, OpenPin, OpenStream
from silo.live.quantities import QUANTITIES
from silo.live.requests import CloseView, GetSurvey, OpenView
from silo.net.keys import ClientId, may_use
from silo.state.requests import Hello
from silo.state.server import Outside, StateServer
from tests.waiting import wait_until


def test_an_id_is_used_by_who_shows_what_it_was_made_of() -> None:
    anna, bob = ClientId.drawn(), ClientId.drawn()
    assert may_use(anna.id, anna.proof)
    assert not may_use(anna.id, bob.proof)
    assert not may_use(anna.id, "")
    assert not may_use(anna.id, "\udcff")


@pytest.mark.parametrize("other", ["x1", "3fa977b2e0aa11ff", "zoe"])
def test_an_id_that_an_older_client_made_proves_nothing(other) -> None:
    assert may_use(other, "")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["view", "stream"])
def test_nobody_else_replaces_or_closes_a_view_or_a_stream(bench, client, kind) -> None:
    bench.start(5)
    with silo.connect("bot") as other:
        mine = client.view(["/log/x"], rate_hz=30) if kind == "view" else client.stream(["/log/x"])
        name = mine.request.view if kind == "view" else mine.request.stream
        forged = [OpenView(view=name), CloseView(view=name), CloseView(view=name, proof=other._connection.mine.proof)]
        if kind == "stream":
            forged = [OpenStream(stream=name, names=["/log/x"]), CloseStream(stream=name)]
        for request in forged:
            with pytest.raises(RefusedError, match="is another client's; nothing was changed"):
                other._call(request)
        bench.ticks(5)
        wait_until(mine.frame if kind == "view" else lambda: mine.read(0.1))
        mine.close()


@pytest.mark.slow
def test_nobody_else_replaces_renews_or_closes_a_pin(bench, client) -> None:
    bench.start(5)
    pin = client.pin(["/log/x"], 0, bench.now_ns)
    with silo.connect("bot") as other:
        for request in (
            OpenPin(pin=pin.id, names=["/log/x"], start_ns=1, end_ns=2),
            OpenPin(pin=pin.id, names=["/log/x"], start_ns=0, end_ns=bench.now_ns, proof=other._connection.mine.proof),
            KeepPin(pin=pin.id),
            ClosePin(pin=pin.id),
        ):
            with pytest.raises(RefusedError, match=r"the pin 'z.*' is another client's; nothing was changed"):
                other._call(request)
    assert len(client.samples(["/log/x"], pin=pin)["/log/x"]) == 5


@pytest.mark.slow
def test_nobody_else_says_who_a_client_is(bench, client) -> None:
    mine = client._connection.mine
    before = wait_until(lambda: client.status().clients)
    with silo.connect("bot") as other:
        other._call(Hello(id=mine.id, client="mallory@nowhere silo 1"))
        assert "mallory@nowhere silo 1" not in [one.who for one in client.status().clients]
    assert before[0] in client.status().clients


def test_what_a_client_says_of_itself_by_no_key_of_its_own_is_called_so() -> None:
    told: list[tuple[str, str]] = []
    replica = SimpleNamespace(status=lambda: None, user="")
    outside = Outside(lambda *one: told.append(one), lambda: None, lambda: "")
    events = SimpleNamespace(log=SimpleNamespace(newest=0))
    StateServer(replica, events, None, outside).hello(Hello(id="x1", client="root@robot (proven) silo 1"))
    assert told == [("x1", "root@robot [proven] silo 1 (says so)")]


@pytest.mark.slow
def test_nobody_else_asks_for_statistics_in_the_place_of_a_client_or_begins_them_anew(bench, client) -> None:
    bench.start(5)
    since_ns = wait_until(lambda: client._survey(["max"]).since_ns)
    bench.ticks(5)
    mine, name = client._surveyed, client._name
    with silo.connect("bot") as other:
        theirs = other._surveyed
        for proof in ("", theirs.proof, mine.id):
            with pytest.raises(RefusedError, match=r"no survey: 'z.*' is another client's; nothing was changed"):
                other._call(GetSurvey(quantities=["max"], reset=True, id=mine.id, proof=proof))
        assert other._survey(["max"], reset=True).since_ns > since_ns
        assert other._call(GetSurvey(quantities=["max"], reset=True, client=name)).since_ns > since_ns
    assert client._survey(["max"]).since_ns == since_ns


@pytest.mark.slow
def test_quantities_that_are_asked_for_again_and_again_take_no_memory(client) -> None:
    for which in ("quantities", "some_quantities"):
        with pytest.raises(RefusedError, match=r"no survey: there are \d+ quantities; name each once"):
            client._survey(**{"quantities": ["max"], which: ["max"] * 5000})
    assert client._survey([*QUANTITIES], some_quantities=[*QUANTITIES]).values


@pytest.mark.slow
def test_statistics_of_an_older_client_are_those_of_its_name(bench, client) -> None:
    bench.start(5)
    asked = GetSurvey(quantities=["max"])
    since_ns = wait_until(lambda: client._call(asked).since_ns)
    bench.ticks(5)
    assert client._survey(["max"]).since_ns > since_ns
    assert client._call(asked).since_ns == since_ns


@pytest.mark.slow
def test_who_makes_up_ids_takes_not_all_of_what_there_is(bench, client) -> None:
    bench.start(5)
    for made_up, mine in (
        (lambda name: OpenView(view=name, values=["/log/x"]), lambda: client.view(["/log/x"])),
        (lambda name: OpenStream(stream=name, names=["/log/x"]), lambda: client.stream(["/log/x"])),
        (
            lambda name: OpenPin(pin=name, names=["/log/x"], start_ns=0, end_ns=bench.now_ns),
            lambda: client.pin(["/log/x"], 0, bench.now_ns),
        ),
    ):
        with silo.connect("bot", read_only=True) as other, pytest.raises(RefusedError, match="are open already"):
            for at in range(100):
                other._call(made_up(f"bob{at}-1"))
        mine().close()
