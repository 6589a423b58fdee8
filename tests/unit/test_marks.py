"""Marks that the program sets: they stand in the segment, at the newest tick, whatever becomes of the program."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from silo.core.elements import MARKER
from silo.segment.marks import SLOT, SLOTS, TEXT_BYTES
from silo.segment.reader import SegmentReader


@pytest.fixture
def log(new_logger):
    log = new_logger("marked")
    log.array("x")
    log.start()
    return log


def ticks(log, count):
    for _ in range(count):
        log.collect()


def test_a_mark_stands_at_the_newest_tick_with_its_time_stamp(log):
    ticks(log, 3)
    log.mark("push 3")
    ticks(log, 2)
    recording = log.snapshot()
    (event,) = recording.events
    assert (event.kind, event.text, event.tick, event.who) == (MARKER, "push 3", 2, "marked")
    assert event.stamp_ns == recording.time_ns[2]


def test_before_the_first_start_and_after_close_nothing_is_marked(new_logger):
    log = new_logger()
    log.mark("early")
    log.array("x")
    log.start()
    log.collect()
    assert log.snapshot().events == ()
    log.close()
    log.mark("late")


def test_after_a_stop_the_last_tick_is_marked(log):
    ticks(log, 4)
    log.stop()
    log.mark("it fell")
    assert [event.tick for event in log.snapshot().events] == [3]


def test_a_mark_that_the_program_keeps_marks_the_present_run(log):
    mark = log.mark
    log.collect()
    mark("first run")
    log.set("x", size=50, cut=True)
    log.collect()
    mark("behind a cut")
    assert [(event.text, event.tick) for event in log.snapshot().events][-1] == ("behind a cut", 0)
    log.restart()
    log.collect()
    mark("next run")
    assert [event.text for event in log.snapshot().events] == ["next run"]
    log.close()
    mark("late")


@pytest.mark.parametrize("text", ["", "ä" * 200, "x" * TEXT_BYTES, "zwölf 日本", "a\nb", "\ud800", "ends\\", 3])
def test_text_of_any_kind_is_kept_and_long_text_is_cut_at_a_letter(log, text):
    log.collect()
    log.mark(text)
    (event,) = log.snapshot().events
    told = str(text).encode("utf-8", "backslashreplace").decode()
    assert told.startswith(event.text)
    assert len(event.text.encode()) >= min(len(told.encode()), TEXT_BYTES - 3)


def test_the_newest_marks_are_kept(log):
    log.collect()
    for number in range(SLOTS + 10):
        log.mark(str(number))
    texts = [event.text for event in SegmentReader(log._present.path).marks()]
    assert texts == [str(number) for number in range(10, SLOTS + 10)]


def test_a_reader_asks_for_what_is_new(log):
    log.collect()
    reader = SegmentReader(log._present.path)
    log.mark("one")
    newest = reader.marks()[-1].number
    log.mark("two")
    assert [mark.text for mark in reader.marks(newest)] == ["two"]
    assert reader.marks(newest + 1) == []


def test_marks_of_several_threads_are_all_there(log):
    log.collect()
    threads = [threading.Thread(target=lambda n=n: [log.mark(f"{n}-{i}") for i in range(200)]) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = SegmentReader(log._present.path).marks()
    assert sorted(mark.text for mark in found) == sorted(f"{n}-{i}" for n in range(4) for i in range(200))
    assert [mark.number for mark in found] == list(range(1, 801))


def test_a_slot_that_was_not_finished_is_no_mark(log):
    log.collect()
    log.mark("whole")
    log.mark("torn")
    reader = SegmentReader(log._present.path)
    with Path(log._present.path).open("r+b") as file:  # the program was killed before it wrote the number at the end
        file.seek(8 * reader.schema.marks + 2 * SLOT.size + SLOT.size - 8)
        file.write(bytes(8))
    assert [mark.text for mark in reader.marks()] == ["whole"]


PROGRAM = """
import os, signal, sys
import silo
log = silo.Logger("killed", folder=sys.argv[1], script=sys.argv[1] + "/none.yaml")
log.array("x")
log.start()
log.collect()
print(log._present.path, flush=True)
log.mark("push 3")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_a_mark_survives_a_kill_right_after_it(tmp_path):
    from silo.files.formats import read_recording
    from silo.helper.left_logs import recover

    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)], stdout=subprocess.PIPE, text=True, check=False
    )
    assert done.returncode == -9
    (file,) = recover(done.stdout.strip()).files
    events = read_recording(file.path).events
    assert [event.kind for event in events] == ["started", "marker", "crashed"]  # who recovers it says the rest, too
    assert (events[1].text, events[1].tick) == ("push 3", 0)
