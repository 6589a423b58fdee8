"""Captures that wait to be written: in turn of their triggers, bounded, and what was left out is counted."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from silo.conditions.captures.buffer import CaptureBuffer
from silo.conditions.captures.writer import MOST_WAITING, WaitingCaptures
from silo.core.conditions import TriggerOptions
from silo.files.manifest import CaptureEntry, CaptureFile, CaptureList
from silo.judging.triggers import Capture


@dataclass
class Captured:
    """What a queue has to know of a capture."""

    options: TriggerOptions
    number: int
    run: str = "a run"

    @property
    def trigger(self):
        return self.options.name

    @property
    def capture(self):
        return Capture(self.number, 0, 1, ())


NOISE = TriggerOptions("noise", "x > 0", keep=10)
REAL = TriggerOptions("real", "z > 0")


@pytest.fixture
def waiting():
    return WaitingCaptures()


def taken(waiting):
    waiting.stop(1000.0)
    found = []
    while (one := waiting.next()) is not None:
        found.append((one.trigger, one.number))
        found += waiting.done()
    return found


def test_a_trigger_that_chatters_keeps_no_other_waiting(waiting):
    for number in range(1, 6):
        waiting.add(Captured(NOISE, number))
    waiting.add(Captured(REAL, 1))
    waiting.add(Captured(REAL, 2))
    assert [name for name, _ in taken(waiting)] == ["noise", "real", "noise", "real", "noise", "noise", "noise"]


def test_of_a_trigger_no_more_wait_than_it_keeps_and_those_left_out_are_counted(waiting):
    firsts = [waiting.add(Captured(NOISE, number)) for number in range(1, 501)]
    assert firsts.index(True) == 20
    assert firsts.count(True) == 1
    assert taken(waiting) == [("noise", number) for number in range(481, 501)]
    what = "480 captures, numbers 1 to 480, of 'noise' not written"
    text = f"{what}: it fired faster than they could be; give it a holdoff"
    assert waiting.drop_all() == ([("a run", text)], set())


def test_a_trigger_that_keeps_all_has_a_bound_too(waiting):
    for number in range(1, MOST_WAITING + 2):
        waiting.add(Captured(REAL, number))
    assert [one.number for one in waiting.all()] == list(range(2, MOST_WAITING + 2))


def test_at_the_end_of_its_time_what_was_not_begun_is_told_and_left_to_others(waiting):
    for number in (1, 2, 3):
        waiting.add(Captured(REAL, number))
    waiting.stop(0.0)
    assert waiting.next() is None
    text = (
        "3 captures, numbers 1 to 3, of 'real' not written yet: the disk was too slow for them when the logger was "
        "closed; its next start does that, or `silo recover`"
    )
    assert waiting.drop_all() == ([("a run", text)], {"a run"})
    assert waiting.all() == []


def test_a_capture_that_was_begun_is_known_by_its_name_though_most_others_are_gone(tmp_path):
    listed = CaptureList(str(tmp_path), "bot")
    listed.begun("run", "real", 1, lambda: "begun")
    for number in range(1, 2500):
        listed.note(CaptureEntry("run", "noise", number, "a name of some length" * 5, (CaptureFile("gone", 1),)))
    listed.written(CaptureEntry("run", "noise", 2500, "last"), [], keep=1)
    assert (tmp_path / ".bot.captures.jsonl").stat().st_size < 1000
    assert listed.begun("run", "real", 1, lambda: "another").name == "begun"


def test_a_list_that_another_process_wrote_anew_is_read_anew(tmp_path):
    one, other = CaptureList(str(tmp_path), "bot"), CaptureList(str(tmp_path), "bot")
    for number in range(1, 2500):
        one.note(CaptureEntry("run", "noise", number, "a name of some length" * 5, (CaptureFile("gone", 1),)))
    assert other.numbers("run") == {"noise": 2499}
    kept = tmp_path / "last"
    kept.touch()
    assert one.written(CaptureEntry("run", "noise", 2500, "last"), [str(kept)], keep=1) == []
    assert (tmp_path / ".bot.captures.jsonl").stat().st_size < 1000
    assert other.numbers("run") == {"noise": 2500}
    assert not other.has_files("run", "noise", 7)
    assert other.has_files("run", "noise", 2500)
    other.note(CaptureEntry("run", "real", 1, "name"))
    assert one.numbers("run") == {"noise": 2500, "real": 1}


def test_what_nobody_holds_any_more_is_told_up_to_the_last_tick_of_a_capture():
    of = SimpleNamespace(
        _reader=SimpleNamespace(unheld=lambda: {"a": 4, "b": 5, "c": 6}), capture=SimpleNamespace(last=5)
    )
    assert CaptureBuffer.unheld(of) == {"a": 4, "b": 5}
