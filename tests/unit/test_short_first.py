"""Who asks for much, again and again, keeps nobody out who asks for little."""

from collections import deque

import pytest

from silo.core.elements import Table
from silo.core.names import Names
from silo.helper.request_threads import LONG_TURN, MAX_LONG, MAX_WAITING, SHORT_BYTES, ShortFirst
from silo.state.replica import MOST_SEARCHED, LoggerSnapshot
from tests.stand_ins.fake_signals import scalar


class Query:
    """As Zenoh has it."""

    def __init__(self, name: str, size: int) -> None:
        self.name, self.payload, self.dropped = name, b"x" * size, False

    def drop(self) -> None:
        self.dropped = True


class Handler:
    """Gives what came; at the end it raises, as one that is closed does."""

    def __init__(self, *queries: Query) -> None:
        self._queries = deque(queries)

    def recv(self) -> Query:
        return self._queries.popleft()

    def try_recv(self) -> Query | None:
        return self._queries.popleft() if self._queries else None


def short(at: int) -> Query:
    return Query(f"short {at}", 100)


def long(at: int) -> Query:
    return Query(f"long {at}", SHORT_BYTES + 1)


def test_short_ones_come_before_long_ones_that_came_before_them() -> None:
    intake = ShortFirst(Handler(long(1), long(2), short(1), short(2)))
    assert [intake.recv().name for _ in range(4)] == ["short 1", "short 2", "long 1", "long 2"]
    with pytest.raises(IndexError):
        intake.recv()


def test_among_many_short_ones_long_ones_have_their_turn() -> None:
    intake = ShortFirst(Handler(long(1), *map(short, range(LONG_TURN))))
    assert [intake.recv().name for _ in range(LONG_TURN)][-1] == "long 1"


def test_of_too_many_the_oldest_of_their_sort_are_dropped() -> None:
    longer, shorter = [long(at) for at in range(MAX_LONG + 3)], [short(at) for at in range(MAX_WAITING)]
    intake = ShortFirst(Handler(*longer, *shorter))
    intake.recv()
    assert [one.name for one in longer if one.dropped] == ["long 0", "long 1", "long 2"]
    assert not any(one.dropped for one in shorter)


def test_of_many_names_that_there_are_not_only_the_first_are_searched_for(monkeypatch) -> None:
    table = Table(1, [scalar("/log/q"), scalar("/log/p")])
    now = LoggerSnapshot(None, None, table, Names.of(table.elements, "/log"), 2, b"", 1)
    searched = []

    def found(self, name):
        if not name.startswith("/log/"):
            searched.append(name)
            return None
        return name, -1

    monkeypatch.setattr(LoggerSnapshot, "found", found)
    many = [f"none {at}" for at in range(MOST_SEARCHED + 500)]
    assert now.found_all(["/log/p", *many, "/log/q"]) == [("/log/p", -1), *[None] * len(many), ("/log/q", -1)]
    assert searched == many[:MOST_SEARCHED]
