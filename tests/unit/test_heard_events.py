"""What a client hands out of what was told while it had no link."""

import pytest
from msgspec.structs import replace

from silo.client.heard import HeardEvents
from silo.core.elements import LoggedEvent, State, Status
from silo.rpc.published import Event
from silo.state.requests import HelloReply

STATUS = Status(
    "bot", "host", "me", 1, 2, State.RUNNING, 0, 1000.0, 1000.0, 5, 0, 0, 0, 0, 0, 0, 0.0, "", "/logs", ""
)  # fmt: skip
LINES = [LoggedEvent("marker", f"m{number}", 100 + number, number=number, who="bot") for number in range(1, 7)]


def hello(newest: int, folder: str = "/logs") -> HelloReply:
    return HelloReply(1, "1", "me", True, replace(STATUS, folder=folder), newest_event=newest)


def read(since: int, limit: int) -> list[LoggedEvent]:
    return [line for line in LINES if line.number > since][:limit]


def test_what_was_there_before_the_first_session_is_no_news() -> None:
    assert HeardEvents().missed(hello(3), read) == []


def test_each_is_handed_out_once_also_where_its_line_was_numbered_on_after_it_was_told() -> None:
    heard = HeardEvents()
    heard.missed(hello(1), read)
    # another process wrote two lines before them: in the log they have numbers 4 and 5
    for number, line in enumerate(LINES[3:5], 2):
        assert heard.is_new(Event.of(replace(line, number=number)))
    # the helper process told it after its hello, before it knew who subscribes
    missed = [event for event in heard.missed(hello(3), read) if heard.is_new(event)]
    assert [(event.text, event.logged, event.by) for event in missed] == [("m6", 6, "")]
    assert not heard.is_new(missed[0])  # it is published, too, in the new session
    progress = Event(9, 0, missed[0].kind, "saving: 10%")  # not in the log
    assert heard.is_new(progress)
    assert heard.is_new(progress)


def test_the_newest_of_what_was_handed_out_are_remembered() -> None:
    heard = HeardEvents()
    told = [Event.of(replace(LINES[0], text=str(number))) for number in range(257)]
    assert all(heard.is_new(one) for one in told)
    assert [heard.is_new(one) for one in (told[-1], told[1], told[0])] == [False, False, True]


@pytest.mark.parametrize(
    "then",
    [hello(6, "/elsewhere"), hello(1), hello(-1)],
    ids=["logger of another folder", "event log begun anew", "older helper process"],
)
def test_of_another_event_log_nothing_is_news_until_it_goes_on(then: HelloReply) -> None:
    heard = HeardEvents()
    heard.missed(hello(2), read)
    assert heard.missed(then, read) == []
    later = hello(6, then.status.folder)
    assert [event.text for event in heard.missed(later, read)] == [
        line.text for line in LINES if 0 <= then.newest_event < line.number
    ]
