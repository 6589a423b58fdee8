"""A table that comes in parts is whole, of one revision, and doesn't come twice."""

import itertools
import random

import msgspec
import pytest

from silo.core.elements import ElementInfo, ElementOptions, Entry, Table
from silo.errors import ConnectionLostError
from silo.rpc.refusals import RequestRefusedError
from silo.state import table_parts
from silo.state.table_parts import (
    FIRST_BYTES,
    MOST_ANEW,
    MOST_BYTES,
    QUICK_S,
    EncodedTable,
    TablePart,
    TableParts,
    TableReply,
)


def table(revision, count=2000):
    names = random.Random(revision)
    return Table(
        revision,
        [
            ElementInfo(f"/log/{names.getrandbits(128):x}", "m", "scalar", (), (Entry("", "<f8"),), ElementOptions())
            for _ in range(count)
        ],
    )


class Robot:
    """Answers as a helper process does, and counts what it is asked."""

    def __init__(self, first):
        self.table, self.asked, self.fails_at = first, [], None
        self.encoded = EncodedTable(first)

    def edit(self, revision, count=2000):
        self.table = table(revision, count)
        self.encoded = EncodedTable(self.table)

    def ask(self, start, most_bytes):
        self.asked.append((start, most_bytes))
        if len(self.asked) == self.fails_at:
            raise ConnectionLostError("cut")
        reply = msgspec.msgpack.encode(self.encoded.part(start, most_bytes))
        assert len(reply) < most_bytes + 200
        return msgspec.msgpack.decode(reply, type=TableReply)


@pytest.fixture
def robot():
    return Robot(table(1))


def test_a_table_comes_whole_in_parts_and_is_told_of_after_each(robot):
    shares = []
    assert TableParts().read(robot.ask, shares.append) == robot.table
    assert len(robot.asked) == 3
    assert shares == sorted(shares)
    assert len(shares) == len(robot.asked) - 1
    assert all(0 < share < 1 for share in shares)
    assert [start for start, _ in robot.asked][1] == FIRST_BYTES


def test_parts_grow_while_they_are_quick_and_are_small_again_when_one_was_not(robot, monkeypatch):
    took_s = iter([0.0, 0.0, 0.0, 0.0, 2 * QUICK_S, *[0.0] * 99])
    now_s = [0.0]
    monkeypatch.setattr(table_parts.time, "monotonic", lambda: now_s[0])

    def ask(start, most_bytes):
        now_s[0] += next(took_s)
        return robot.ask(start, most_bytes)

    robot.edit(1, 20_000)
    assert TableParts().read(ask, None) == robot.table
    sizes = [most for _, most in robot.asked]
    assert sizes[:5] == [FIRST_BYTES, 2 * FIRST_BYTES, 4 * FIRST_BYTES, MOST_BYTES, MOST_BYTES]
    assert sizes[5:7] == [FIRST_BYTES, 2 * FIRST_BYTES]


def test_what_did_not_change_does_not_come_again_and_what_did_does(robot):
    parts = TableParts()
    parts.read(robot.ask, None)
    robot.asked.clear()
    assert parts.read(robot.ask, None) == robot.table
    assert len(robot.asked) == 1
    robot.edit(2)
    assert parts.read(robot.ask, None) == robot.table


def test_a_link_that_is_cut_goes_on_where_it_was(robot):
    parts, robot.fails_at = TableParts(), 3
    with pytest.raises(ConnectionLostError):
        parts.read(robot.ask, None)
    assert parts.read(robot.ask, None) == robot.table
    starts = [start for start, _ in robot.asked]
    assert starts[2] == starts[3] == FIRST_BYTES * 3


@pytest.mark.parametrize("count", [2000, 10, 0])
def test_a_table_that_is_edited_while_it_is_read_is_read_anew_all_of_one_revision(robot, count):
    def ask(start, most_bytes):
        if len(robot.asked) == 2:
            robot.edit(2, count)
        return robot.ask(start, most_bytes)

    found = TableParts().read(ask, None)
    assert found == robot.table
    assert found.revision == 2


def test_a_table_that_is_edited_all_the_time_is_given_up(robot):
    revisions = itertools.count(2)

    def ask(start, most_bytes):
        robot.edit(next(revisions), 5000)
        return robot.ask(start, most_bytes)

    with pytest.raises(ConnectionLostError, match="again and again"):
        TableParts().read(ask, None)
    assert len(robot.asked) <= 2 * MOST_ANEW + 3


def test_a_robot_of_before_answers_with_all_of_it():
    there = table(1)
    assert TableParts().read(lambda start, most_bytes: TableReply(there), None) is there


@pytest.mark.parametrize(
    "part", [TablePart(b"", 10, 0), TablePart(b"x" * 11, 10, 0), TablePart(b"x" * 10, 10, 0), TablePart(b"", 0, 0)]
)
def test_parts_that_make_no_sense_are_told_and_not_kept(part, robot):
    parts = TableParts()
    with pytest.raises(ConnectionLostError):
        parts.read(lambda start, most_bytes: TableReply(Table(1, []), part), None)
    assert parts.read(robot.ask, None) == robot.table


@pytest.mark.parametrize(("start", "most_bytes"), [(-1, 10), (0, -1)])
def test_numbers_below_0_are_refused(start, most_bytes, robot):
    with pytest.raises(RequestRefusedError, match="byte 0 or later"):
        robot.encoded.part(start, most_bytes)
