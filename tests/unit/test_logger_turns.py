"""The turns of a loop: buffers that are full, threads, forks, interrupts, clocks that fail."""

import os
import signal
import threading

import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.errors import StateError
from silo.segment import writer
from tests.stand_ins.ticking import Robot, collect, values
from tests.waiting import DEADLINE_S

# ------------------------------------------------------------------------------------------- stopping by itself


def test_a_logger_of_fixed_buffers_stops_by_itself_when_all_are_full(counting):
    logger = counting(buffer=BufferType.FIXED, size=4, divider=3)
    collect(logger, 100)
    assert (logger.ticks, values(logger), logger.is_running) == (12, [0, 1, 2, 3], False)


def test_a_logger_with_max_time_stops_by_itself(counting):
    logger = counting({"frequency": 10, "max_time": 2}, buffer=BufferType.GROWING)
    collect(logger, 100)
    assert (logger.ticks, logger.is_running) == (20, False)
    assert "stopped by itself: the time buffer is full" in logger.stop_reason


def test_a_logger_that_max_time_ended_names_what_had_it_end_and_what_has_no_end(new_logger):
    logger = new_logger(frequency=10, max_time=2)
    kept = [logger.array("q"), logger.array("temp", buffer="growing")]
    logger.start()
    collect(logger, 100)
    assert (logger.ticks, len(kept)) == (20, 2)
    assert logger.stop_reason.endswith("is reached), as not all buffers are looping (/log/temp); max_time=0 has no end")


def test_a_logger_of_looping_buffers_never_stops_by_itself(counting):
    logger = counting({"frequency": 10, "max_time": 2}, size=5)
    collect(logger, 1000)
    assert (logger.ticks, values(logger)) == (1000, [995, 996, 997, 998, 999])


def test_the_segment_says_why_it_ended(counting):
    logger = counting()
    logger.stop()
    assert logger._present.run.reader.stop_reason == logger.stop_reason == "stopped on request"


# --------------------------------------------------------------------------------------- calls in the wrong place


def test_a_second_thread_in_collect_gets_an_error_and_no_row_is_torn(new_logger):
    logger = new_logger(threads="serialized")
    entered, leave = threading.Event(), threading.Event()

    def slow():
        entered.set()
        leave.wait(DEADLINE_S)
        return 1.0

    leave.set()
    logger.add(slow, "x")
    logger.start()
    leave.clear()
    entered.clear()
    first = threading.Thread(target=logger.collect)
    first.start()
    assert entered.wait(DEADLINE_S)
    with pytest.raises(StateError, match=r"collect\(\) was called by a second thread"):
        logger.collect()
    leave.set()
    first.join()
    logger.collect()
    assert logger.ticks == 2


def test_a_source_that_calls_collect_gets_an_error(new_logger, caplog):
    logger = new_logger()
    logger.add(lambda: logger.collect() or 1.0, "x")
    logger.start()
    logger.collect()
    assert logger._present.failures == {"/log/x": 1}
    assert logger.ticks == 1


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("kind", list(BufferType))
@pytest.mark.parametrize("dividers", [(1, 2), (1, 2, 3, 4, 5, 6, 7)])
def test_a_tick_that_is_interrupted_is_logged_wholly_or_not_at_all(new_logger, monkeypatch, interrupt, kind, dividers):
    logger = new_logger(max_time=0)
    robot = Robot(tick=0, interrupt=False)

    def interrupted():
        if robot.interrupt:
            raise interrupt
        return robot.tick

    monkeypatch.setattr(writer, "CHUNK_BYTES", 8192)  # growing: ten rows per chunk
    x = logger.array("x", 98, np.int64, buffer=kind, size=7)
    for divider in dividers:
        read = interrupted if divider == dividers[-1] else lambda: robot.tick
        logger.add(read, f"y{divider}", divider=divider, buffer=kind, size=7)
    logger.add(np.zeros(1), "growing", buffer=BufferType.GROWING, size=1)
    logger.start()
    tick = 0
    for _ in range(40):
        x[:] = robot.tick = tick
        robot.interrupt = True
        if tick % dividers[-1] == 0:
            with pytest.raises(interrupt):
                logger.collect()
        robot.interrupt = False
        logger.collect()
        tick += 1
    recording = logger.snapshot()
    assert recording.offset == tick
    for element in recording.elements[:-1]:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist()
    assert len(logger.read_new_values("x").values) == len(recording.elements[0].stamp_indices)


def test_a_clock_that_fails_leaves_the_tick_to_the_next_call(new_logger):
    times = iter([0, 10, None, 30])

    def clock():
        now = next(times)
        if now is None:
            raise RuntimeError("no time")
        return now

    logger = new_logger(clock=clock)
    logger.array("x")
    logger.start()
    logger.collect()
    with pytest.raises(RuntimeError, match="no time"):
        logger.collect()
    logger.collect()
    assert logger.snapshot().time_ns.tolist() == [10, 30]


def test_a_kept_collect_of_a_stopped_logger_does_nothing(counting):
    logger = counting()
    kept = logger.collect
    logger.stop()
    kept()
    assert logger.ticks == 0


def test_collect_kept_before_start_logs_after_it(new_logger):
    logger = new_logger()
    kept = logger.collect
    logger.array("x")
    logger.start()
    kept()
    assert logger.ticks == 1


def test_restarts_from_another_thread_neither_tear_rows_nor_stop_the_loop(new_logger):
    logger = new_logger()
    x = logger.array("x", 40, np.int64, size=100)
    logger.start()
    done = threading.Event()
    failures = []

    def restart():
        for _ in range(40):
            logger.restart()
        done.set()

    other = threading.Thread(target=restart)
    other.start()
    number = 0
    while not done.is_set():
        number += 1
        x[:] = number
        try:
            logger.collect()
        except StateError as error:
            failures.append(error)
    other.join()
    assert failures == []
    collect(logger, 5)
    for element in logger.snapshot().elements:
        rows = np.stack([entry.values for entry in element.entries])
        assert (rows == rows[0]).all()


@pytest.mark.slow
def test_a_forked_child_does_not_write_into_its_parents_buffers(counting):
    logger = counting()
    kept = logger.collect
    collect(logger, 3)
    child = os.fork()
    if child == 0:
        try:
            kept()
            logger.collect()
            with pytest.raises(StateError, match=r"'.*' is that of the process that process .* was forked from"):
                logger.save()
            os._exit(0 if not logger.is_running and logger.ticks == 0 else 1)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    logger.collect()
    assert values(logger) == [0, 1, 2, 3]


def test_ctrl_c_anywhere_in_collect_leaves_whole_rows(new_logger):
    logger = new_logger(max_time=0)
    robot = Robot(x=0)
    for divider in (1, 2, 3):
        logger.add(lambda: robot.x, f"x{divider}", divider=divider, size=100_000)
    logger.start()

    def interrupt(_, frame):
        if "<silo collect>" in (frame.f_code.co_filename, frame.f_back.f_code.co_filename):
            raise KeyboardInterrupt

    def loop():
        while True:
            robot.x = logger.ticks
            logger.collect()

    previous = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.0007, 0.0007)
    try:
        for _ in range(100):
            with pytest.raises(KeyboardInterrupt):
                loop()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    for element in logger.snapshot().elements:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist()
