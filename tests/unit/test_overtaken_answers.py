"""The end of an answer may overtake the answer, or a part of it: what only reads is asked again, a change is not."""

from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
import zenoh

from silo.core.elements import State
from silo.errors import ConnectionLostError
from silo.fleet.exchange import AGAIN_S, NoAnswerError, exchange, those_there
from silo.fleet.many import Asking
from silo.net.keys import Root
from silo.net.sessions import SessionLease
from silo.requests import GetSummary, Start
from silo.rpc.published import Summary
from silo.state.requests import SummaryReply
from tests.waiting import wait_until

ROOT = Root("robot3", "anymal", "0123456789")


class Replies(list[Any]):
    """What came for one question; its end is told as Zenoh does."""

    def try_recv(self) -> Any:
        if not self:
            raise zenoh.ZError("channel is closed")
        return self.pop(0)


class Session:
    """Answers with what a test gives, question by question; then nothing."""

    def __init__(self, *answers: list[Any]) -> None:
        self.answers, self.asked = list(answers), 0

    def get(self, *_: object, **__: object) -> Replies:
        self.asked += 1
        return Replies(self.answers.pop(0) if self.answers else [])

    def liveliness(self) -> "Session":
        return self


def reply(key: str, payload: bytes = b"") -> Any:
    said = SimpleNamespace(key_expr=key, payload=SimpleNamespace(to_bytes=lambda: payload))
    return SimpleNamespace(ok=said, err=None)


def lease(session: Session) -> SessionLease:
    return SessionLease(session, "lab", user="alice")  # type: ignore[arg-type]


def answer() -> Any:
    return reply(ROOT.key("ask"), msgspec.msgpack.encode(SummaryReply(Summary(state=State.RUNNING, denied=7))))


@pytest.mark.parametrize("overtaken", range(len(AGAIN_S) + 1))
def test_a_question_whose_answer_was_overtaken_is_asked_again(overtaken):
    session = Session(*[[]] * overtaken, [answer()])
    assert exchange(lease(session), ROOT, GetSummary(), 2.0, "anymal").summary.denied == 7
    assert session.asked == overtaken + 1


def test_who_is_gone_is_told_to_be_after_a_few_questions():
    session = Session()
    with pytest.raises(NoAnswerError, match="gave no answer"):
        exchange(lease(session), ROOT, GetSummary(), 2.0, "anymal")
    assert session.asked == 1 + len(AGAIN_S)


def test_a_change_is_sent_once():
    session = Session()
    with pytest.raises(NoAnswerError):
        exchange(lease(session), ROOT, Start(), 2.0, "anymal")
    assert session.asked == 1


@pytest.mark.parametrize("overtaken", range(len(AGAIN_S) + 1))
def test_of_many_who_are_asked_at_a_time_those_whose_answers_were_overtaken_are_asked_again(overtaken):
    session = Session(*[[]] * overtaken, [answer()])
    asking, found = Asking(lease(session), 2.0), []
    asking.add("anymal", ROOT, GetSummary())
    wait_until(lambda: found.extend(asking.poll()) or found)
    assert [(key, payload is not None) for key, payload in found] == [("anymal", True)]
    assert (session.asked, asking.count) == (overtaken + 1, 0)


def test_who_asks_many_patiently_asks_until_the_time_is_up_and_sends_a_change_once():
    session, found = Session(*[[]] * (len(AGAIN_S) + 2), [answer()]), []
    asking = Asking(lease(session), 60.0, patient=True)
    asking.add("anymal", ROOT, GetSummary())
    wait_until(lambda: found.extend(asking.poll()) or found)
    assert [(key, payload is not None) for key, payload in found] == [("anymal", True)]
    for request, timeout_s in ((GetSummary(), 0.5), (Start(), 60.0)):
        session, found = Session(), []
        asking = Asking(lease(session), timeout_s, patient=True)
        asking.add("anymal", ROOT, request)
        wait_until(lambda asking=asking, found=found: found.extend(asking.poll()) or found)
        assert found == [("anymal", None)]
    assert session.asked == 1


def test_who_asks_many_patiently_asks_nobody_again_whose_time_would_be_up_by_then(monkeypatch):
    now_s, asked_s, found = [0.0], [], []
    monkeypatch.setattr("silo.fleet.many.time", SimpleNamespace(monotonic=lambda: now_s[0]))

    class Noting(Session):
        def get(self, *_, **__):
            asked_s.append(now_s[0])
            return super().get()

    asking = Asking(lease(Noting()), 0.5, patient=True)
    asking.add("anymal", ROOT, GetSummary())
    while not found:
        now_s[0] += 0.001
        found = asking.poll()
    assert found == [("anymal", None)]
    assert len(asked_s) == 1 + len(AGAIN_S)
    assert asked_s[-1] <= now_s[0] < 0.5 < asked_s[-1] + AGAIN_S[-1]


def test_of_many_who_are_asked_one_that_is_gone_comes_to_an_end_and_a_change_is_sent_once():
    for request, times in ((GetSummary(), 1 + len(AGAIN_S)), (Start(), 1)):
        session, found = Session(), []
        asking = Asking(lease(session), 2.0)
        asking.add("anymal", ROOT, request)
        wait_until(lambda asking=asking, found=found: found.extend(asking.poll()) or found)
        assert (found, session.asked) == ([("anymal", None)], times)


def test_beside_a_follower_whom_it_sees_is_there_though_the_end_of_the_answer_came_first():
    roots = [Root("robot3", "leg", f"{number:010x}") for number in range(4)]
    tokens = [reply(root.key("alive")) for root in roots]
    alone = lease(Session(tokens[1:2]))
    assert those_there(alone, "silo/**/alive", 2.0) == roots[1:2]
    beside = lease(Session(tokens[1:2], tokens[1:2]))
    beside.followed["somebody"] = {str(root): root for root in [*roots[:1], *roots[2:]]}
    assert those_there(beside, "silo/**/alive", 2.0) == roots
    beside.followed["somebody"] = {"arm": Root("robot3", "arm", "0" * 10)}
    assert those_there(beside, "silo/*/leg/alive", 2.0) == roots[1:2]


def test_a_session_that_ends_while_it_is_asked_again_is_told():
    class Ended(Session):
        def get(self, *words: object, **more: object) -> Replies:
            if self.asked:
                raise zenoh.ZError("session closed")
            return super().get(*words, **more)

    with pytest.raises(ConnectionLostError, match="lost the connection"):
        exchange(lease(Ended()), ROOT, GetSummary(), 2.0, "anymal")
    asking, found = Asking(lease(Ended()), 2.0), []
    asking.add("anymal", ROOT, GetSummary())
    wait_until(lambda: found.extend(asking.poll()) or found)
    assert found == [("anymal", None)]
