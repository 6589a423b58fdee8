"""Ctrl-C at every instruction of a start, a restart, an end and a tick: nothing is left over, and nothing is stuck."""

import contextlib
import gc
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.core import runtime
from silo.logger.current_run import CurrentRun
from silo.logger.logger import Logger
from silo.loop.run import Run
from silo.segment import held_runs
from silo.segment.writer import Segment
from tests.stand_ins.interrupting import Interrupts
from tests.stand_ins.ticking import Robot

# the code that has a file or a descriptor in its hands
OWNERS = {
    owner.__code__
    for owner in (
        *(Segment.make, Segment._fill, Segment._append_rows, Segment._append, Segment._allocate, Segment.unlink),
        *(Segment.open_read_only, Run.__init__, Run.begin, Run.drop, Run.reader.fget, held_runs.hold, held_runs.remove),
        *(CurrentRun.replace, CurrentRun._begin, CurrentRun._let_go_of_others, CurrentRun.drop),
        *(Logger.start, Logger.restart, Logger.stop, Logger._end_now, Logger._let_go, Logger._free),
        *(runtime.open_into, runtime.open_unfinished, runtime.announce_segment, runtime.withdraw_segment),
    )
}


def left_over(folders):
    files = [path for folder in folders for path in folder.iterdir()]
    maps = Path("/proc/self/maps").read_bytes()
    mapped = [line for line in maps.splitlines() if b".segment" in line] if b".segment" in maps else []
    opened = [link for link in map(link_of, os.listdir("/proc/self/fd")) if ".segment" in link]  # noqa: PTH208
    return files, opened, mapped


def link_of(descriptor):
    try:
        return os.readlink(f"/proc/self/fd/{descriptor}")  # noqa: PTH115 - for each descriptor, after each place
    except OSError:
        return ""


def made(storage, tmp_path):
    logger = silo.Logger("test", storage=storage, folder=tmp_path / "logs", script=tmp_path / "none.yaml")
    logger.array("x")
    logger.array("y", buffer="growing")
    return logger


def begun(logger):
    logger.start()
    logger.collect()
    return logger


ACTIONS = {
    "start": (lambda logger: logger, lambda logger: logger.start()),
    "restart": (begun, lambda logger: logger.restart()),
    "close": (begun, lambda logger: logger.close(discard=True)),
}


@pytest.mark.slow  # some 2,500 starts
@pytest.mark.parametrize(("what", "storage"), [("start", "file"), ("restart", "memory"), ("close", "file")])
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_an_interrupt_anywhere_leaves_no_file_and_no_descriptor_after_close(tmp_path, monkeypatch, what, storage):
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    (tmp_path / "logs").mkdir()
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(runtime))
    monkeypatch.setattr("silo.segment.writer.CHUNK_BYTES", 8192)  # each start takes a chunk, and touches all of it
    before, action = ACTIONS[what]
    interrupts = Interrupts(OWNERS.__contains__)
    first = before(made(storage, tmp_path))
    places = interrupts.places(lambda: action(first))
    first.close(discard=True)
    kept = []
    for place in places:
        logger = before(made(storage, tmp_path))
        interrupts.interrupt(place, lambda logger=logger: action(logger))
        logger.close(discard=True)
        del logger
        folders = runtime, tmp_path / "logs"
        if any(left_over(folders)) and gc.collect() and any(left := left_over(folders)):
            kept.append((place[0].co_name, place[1], left))
            for path in left[0]:
                path.unlink()
    assert len(places) > 100
    assert kept == []


def test_a_logger_that_was_closed_waits_for_no_lock_as_it_is_collected(tmp_path):
    held = [made("memory", tmp_path)]
    held[0].close(discard=True)
    life = held[0]._life
    collects = threading.Thread(target=lambda: (held.clear(), gc.collect()), daemon=True)
    with life.ends:  # as an interrupt between two instructions may leave it to the thread that was interrupted
        collects.start()
        collects.join(30)
        assert not collects.is_alive()


# ------------------------------------------------------------------------------------------------------------- ticks


@pytest.mark.parametrize("threads", ["single", "serialized"])
@pytest.mark.parametrize("kind", ["looping", "fixed", "growing"])
@pytest.mark.parametrize("dividers", [(1, 2, 3), (1, 2, 3, 4, 5, 6, 7)])
def test_an_interrupt_anywhere_in_a_tick_is_one_and_the_next_tick_goes_on(
    tmp_path, monkeypatch, dividers, kind, threads
):
    monkeypatch.setattr("silo.segment.writer.CHUNK_BYTES", 8192)  # growing: some rows per chunk
    logger = silo.Logger("test", threads=threads, folder=tmp_path, script=tmp_path / "none.yaml", max_time=0)
    robot = Robot(tick=0)
    x = logger.array("x", 98, np.int64, buffer=kind, size=500)
    for divider in dividers:
        logger.add(robot, f"y{divider}", attr="tick", divider=divider, buffer=kind, size=500)
    logger.add(np.zeros(1), "looping", size=20)
    if threads == "serialized":  # slow rows are then found by the next tick at which they are due
        logger.parameter("kp", 1.0)
    logger.start()
    interrupts = Interrupts(lambda code: code.co_filename == "<silo collect>" or code.co_name in ("claim", "more"))

    def tick():
        x[:] = robot.tick = logger.ticks
        logger.collect()

    tick()  # what the first one alone does is another test's
    places = interrupts.places(lambda: [tick() for _ in range(9)])
    assert len(places) > 100
    seen = 0
    for place in places:
        for _ in range(9):
            seen += interrupts.interrupt(place, tick)
            tick()
    assert seen > len(places)
    recording = logger.snapshot()
    for element in recording.elements[: len(dividers) + 1]:
        gone = recording.offset - len(recording.time_ns)
        assert element.entries[0].values.tolist() == (element.stamp_indices + gone).tolist()
    logger.close(discard=True)


def test_an_interrupt_anywhere_in_the_first_tick_leaves_the_run_to_its_thread(tmp_path):
    interrupts = Interrupts(lambda code: code.co_filename == "<silo collect>" or code.co_name == "claim")

    def started():
        logger = silo.Logger("test", folder=tmp_path, script=tmp_path / "none.yaml")
        logger.array("x")
        logger.start()
        return logger

    for _ in range(2):  # the first tick of a process takes some instructions more
        with started() as first:
            count = len(interrupts.places(first.collect))
            first.close(discard=True)
    assert count > 50
    for number in range(count):
        logger = started()
        assert interrupts.interrupt_at(number, logger.collect)
        before = logger.ticks
        logger.collect()
        assert logger.ticks == before + 1
        logger.close(discard=True)


@pytest.mark.skipif(sys.version_info >= (3, 11), reason="later ones look for signals at calls and loops alone")
@pytest.mark.parametrize("threads", ["single", "serialized"])
def test_a_second_interrupt_while_the_first_is_taken_back_leaves_whole_rows(new_logger, threads):
    class Interrupting:
        now = False

        @property
        def x(self):
            if self.now:
                raise KeyboardInterrupt
            return float(logger.ticks)

    logger, robot = new_logger("twice", threads=threads), Interrupting()
    for divider in (1, 2):
        logger.add(robot, f"x{divider}", attr="x", divider=divider)
    logger.start()
    interrupts = Interrupts(lambda code: code.co_filename == "<silo collect>")

    def tick(*, first=False):
        robot.now = first
        with contextlib.suppress(KeyboardInterrupt):
            logger.collect()

    tick()
    places = interrupts.places(lambda: (tick(first=True), tick(first=True)))
    for place in places:
        interrupts.interrupt(place, lambda: tick(first=True))
        tick()
    assert logger.ticks == len(places) + 1
    for element in logger.snapshot().elements:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist()
