"""The file of the event log: JSON lines that are appended, bounded, and read whatever became of them."""

import json

import pytest

from silo.files import event_log
from silo.files.event_log import append_events, event_log_path, loggers_with_events, read_events
from silo.model import LoggedEvent


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


def test_a_line_that_was_cut_costs_itself_alone(tmp_path):
    append_events(tmp_path, "bot", [line(1), line(2)])
    path = event_log_path(tmp_path, "bot")
    path.write_bytes(path.read_bytes()[:-5])
    append_events(tmp_path, "bot", [line(3)])
    assert [e.number for e in read_events(tmp_path, "bot")] == [1, 3]


@pytest.mark.parametrize("damage", [b"\xff\xfe\n", b"{}\n", b'{"kind":1}\n', b"\0" * 100 + b"\n", b"[" * 5000 + b"\n"])
def test_what_is_no_line_of_ours_is_left_out(tmp_path, damage):
    append_events(tmp_path, "bot", [line(1)])
    with event_log_path(tmp_path, "bot").open("ab") as file:
        file.write(damage)
    append_events(tmp_path, "bot", [line(2)])
    assert [e.number for e in read_events(tmp_path, "bot")] == [1, 2]


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
