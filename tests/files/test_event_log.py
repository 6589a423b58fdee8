"""The file of the event log: JSON lines that are appended, bounded, and read whatever became of them."""

import errno
import fcntl
import json
import threading

import numpy as np
import pytest

from silo.core.elements import LoggedEvent
from silo.core.recording import Recording
from silo.files import event_log
from silo.files.event_log import append_events, event_log_path, loggers_with_events, read_events
from silo.state.events import EventLog
from tests.waiting import DEADLINE_S


def line(number, run="r1", text="x"):
    return LoggedEvent("marker", text, 1000 + number, number, run=run, number=number)


def test_what_is_appended_is_read_in_order_by_run_and_in_all(tmp_path):
    append_events(tmp_path / "new", "bot", [line(1), line(2, "r2")])
    append_events(tmp_path / "new", "bot", [line(3)])
    assert [e.number for e in read_events(tmp_path / "new", "bot")] == [1, 2, 3]
    assert [e.number for e in read_events(tmp_path / "new", "bot", "r1")] == [1, 3]
    assert loggers_with_events(tmp_path / "new") == ["bot"]


def test_without_a_log_there_is_nothing(tmp_path):
    assert read_events(tmp_path, "bot") == []


def told(events):
    """Kind and number of each."""
    return [(event.kind, event.number) for event in events]


def test_a_line_that_was_cut_costs_itself_alone_and_an_event_says_so_in_its_place(tmp_path):
    append_events(tmp_path, "bot", [line(1), line(2)])
    path = event_log_path(tmp_path, "bot")
    path.write_bytes(path.read_bytes()[:-5])
    assert told(read_events(tmp_path, "bot")) == [("marker", 1), ("damaged", 2)]
    append_events(tmp_path, "bot", [line(3)])
    found = read_events(tmp_path, "bot")
    assert told(found) == [("marker", 1), ("damaged", 2), ("marker", 3)]
    assert found[1].text.startswith("1 line of the event log can't be read, after event 1")
    assert read_events(tmp_path, "bot", "r1") == found


@pytest.mark.parametrize("damage", [b"\xff\xfe\n", b"{}\n", b'{"kind":1}\n', b"\0" * 100 + b"\n", b"[" * 5000 + b"\n"])
def test_what_is_no_line_of_ours_is_told_in_its_place(tmp_path, damage):
    append_events(tmp_path, "bot", [line(1)])
    with event_log_path(tmp_path, "bot").open("ab") as file:
        file.write(2 * damage)
    append_events(tmp_path, "bot", [line(4)])
    for run in ("", "r1"):
        found = read_events(tmp_path, "bot", run)
        assert told(found) == [("marker", 1), ("damaged", 2), ("marker", 4)]
        assert found[1].text.startswith("2 lines")


def test_damage_is_told_of_the_run_in_which_it_stands(tmp_path):
    append_events(tmp_path, "bot", [line(1), line(2, "r2")])
    with event_log_path(tmp_path, "bot").open("ab") as file:
        file.write(b"{}\n")
    append_events(tmp_path, "bot", [line(4)])
    assert told(read_events(tmp_path, "bot", "r1")) == [("marker", 1), ("marker", 4)]
    assert told(read_events(tmp_path, "bot", "r2")) == [("marker", 2), ("damaged", 3)]


def test_a_log_that_is_rotated_while_it_is_read_is_read_whole(tmp_path, monkeypatch):
    append_events(tmp_path, "bot", [line(number) for number in range(1000)])
    opened = event_log._opened

    def rotated(path, stack):
        descriptor = opened(path, stack)
        if path == event_log.older_event_log(tmp_path, "bot"):
            monkeypatch.setattr(event_log, "_opened", opened)
            monkeypatch.setattr(event_log, "MOST_BYTES", 1000)
            append_events(tmp_path, "bot", [line(1000)])
        return descriptor

    monkeypatch.setattr(event_log, "_opened", rotated)
    assert [event.number for event in read_events(tmp_path, "bot")] == list(range(1001))
    assert event_log.older_event_log(tmp_path, "bot").exists()


def test_a_line_that_is_being_written_is_no_damage(tmp_path):
    append_events(tmp_path, "bot", [line(1)])
    path = event_log_path(tmp_path, "bot")
    with path.open("ab") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write(b'{"kind":"mark')
        file.flush()
        assert told(read_events(tmp_path, "bot")) == [("marker", 1)]


def test_a_disk_that_is_full_within_a_batch_leaves_none_of_it_and_the_next_try_writes_it_once(tmp_path, monkeypatch):
    append_events(tmp_path, "bot", [line(0)])
    room, write = [1000], event_log.os.write

    def full(descriptor, data):
        if not room[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        some = bytes(data)[: room[0]]
        room[0] -= len(some)
        return write(descriptor, some)

    monkeypatch.setattr(event_log.os, "write", full)
    batch = [line(number) for number in range(1, 40)]
    with pytest.raises(OSError, match="No space"):
        append_events(tmp_path, "bot", batch)
    assert told(read_events(tmp_path, "bot")) == [("marker", 0)]
    room[0] = 10**9
    append_events(tmp_path, "bot", batch)
    assert told(read_events(tmp_path, "bot")) == [("marker", number) for number in range(40)]


def test_what_an_older_silo_wrote_twice_on_a_full_disk_is_read_once(tmp_path):
    batch = [line(number) for number in range(40)]
    append_events(tmp_path, "bot", batch)
    path = event_log_path(tmp_path, "bot")
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:18]) + path.read_bytes())
    assert read_events(tmp_path, "bot") == batch


def test_it_takes_no_more_than_twice_its_part(tmp_path, monkeypatch):
    monkeypatch.setattr(event_log, "MOST_BYTES", 2000)
    for number in range(200):
        append_events(tmp_path, "bot", [line(number)])
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 4500
    numbers = [e.number for e in read_events(tmp_path, "bot")]
    assert numbers == list(range(numbers[0], 200))
    assert len(numbers) > 20


def test_a_newer_silo_s_fields_are_passed_over(tmp_path):
    append_events(tmp_path, "bot", [line(1)])
    path = event_log_path(tmp_path, "bot")
    path.write_text(json.dumps({**json.loads(path.read_text()), "place": "lab"}) + "\n")
    assert read_events(tmp_path, "bot") == [line(1)]


def test_a_line_is_in_the_file_soon_and_not_at_the_end_alone(tmp_path, until):
    log = EventLog(str(tmp_path), "bot")
    for number in range(1, 4):
        log.add(line(0))
        until(lambda: [event.number for event in read_events(tmp_path, "bot")] == list(range(1, number + 1)))  # noqa: B023
    log.stop()
    log.add(line(0))
    assert len(read_events(tmp_path, "bot")) == 3


def test_two_writers_at_once_number_no_line_twice(tmp_path, until):
    """As the helper of the run before, which still writes when the next start has its own."""
    before, after = EventLog(str(tmp_path), "bot"), EventLog(str(tmp_path), "bot")
    written = []
    for log, text in [(before, "a"), (after, "b"), (before, "c"), (after, "d"), (after, "e")]:
        log.add(line(0, text=text))
        written.append(text)
        until(lambda: [event.text for event in read_events(tmp_path, "bot")] == written)
    before.stop()
    after.stop()
    found = read_events(tmp_path, "bot")
    assert [event.number for event in found] == [1, 2, 3, 4, 5]
    assert after.since(0, 9)[0] == [found[1], found[3], found[4]]
    assert before.since(0, 9)[0] == [found[0], found[2]]
    assert (after.newest, after.written) == (5, 5)


def test_lines_that_waited_while_another_process_wrote_are_numbered_on_and_waited_for(tmp_path, monkeypatch):
    """Those that come while a batch is written, too."""
    log, append = EventLog(str(tmp_path), "bot"), event_log.append_events
    begun, going = threading.Semaphore(0), threading.Semaphore(0)

    def slow(*batch):
        begun.release()
        assert going.acquire(timeout=DEADLINE_S)
        return append(*batch)

    monkeypatch.setattr("silo.state.events.append_events", slow)
    first = log.add(line(0, text="a"))
    assert begun.acquire(timeout=DEADLINE_S)
    last = log.add(line(0, text="b"))
    append(tmp_path, "bot", [line(1, text="other"), line(2, text="another")])
    going.release()
    assert begun.acquire(timeout=DEADLINE_S)  # the second batch
    assert log.settled(first, 0).number == 3
    assert log.settled(last, 0) is None
    going.release()
    assert (log.settled(last, DEADLINE_S).number, log.settle(0)) == (4, 4)
    going.release(9)
    log.stop()
    assert [(event.text, event.number) for event in read_events(tmp_path, "bot")] == [
        ("other", 1), ("another", 2), ("a", 3), ("b", 4),
    ]  # fmt: skip
    assert [event.number for event in log.since(0, 9)[0]] == [3, 4]
    assert log.add(line(0)).number == 5


def test_what_a_full_disk_left_of_a_batch_is_not_numbered_anew(tmp_path):
    batch = [line(number) for number in range(1, 9)]
    append_events(tmp_path, "bot", batch[:3])
    assert append_events(tmp_path, "bot", batch) == 0
    assert event_log_path(tmp_path, "bot").read_bytes().count(b"\n") == len(batch)
    assert read_events(tmp_path, "bot") == batch


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError("the disk said something\n"), "the disk said something"),
        (OSError(), "OSError"),
    ],
)
def test_why_a_log_cannot_be_read_is_said_whatever_the_system_says(tmp_path, monkeypatch, error, words):
    def refuse(*_: object):
        raise error

    monkeypatch.setattr(event_log, "read_events", refuse)
    recording = Recording("robot", np.empty(0, np.int64), 0, ())
    assert f"can't be read ({words})" in event_log.with_happened(recording, tmp_path, "r1").warnings[0]


def test_words_without_end_push_no_other_line_out_of_the_log(tmp_path):
    log = EventLog(str(tmp_path), "bot")
    for number in range(40):
        log.add(line(number, text=f"mark {number}"))
        log.add(line(number, text="y" * 900_000))
    log.stop()
    found = [event.text for event in read_events(tmp_path, "bot")]
    assert [text for text in found if text.startswith("mark")] == [f"mark {number}" for number in range(40)]
    assert found[1] == f"{'y' * 4000}... (900000 letters)"
