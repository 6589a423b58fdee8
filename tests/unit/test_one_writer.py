"""Who may call collect(): one thread per run, or, where it is asked for, one at a time."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from silo.errors import ElementError, StateError

OTHER = (
    r"collect\(\) belongs to the thread that called it first after start\(\), 'MainThread', and was called by 'other"
)


def call_in_thread(function):
    with ThreadPoolExecutor(1, thread_name_prefix="other") as pool:
        return pool.submit(function).result()


@pytest.fixture
def running(new_logger):
    logger = new_logger()
    logger.array("x", 3, np.int64)
    logger.start()
    return logger


def test_a_second_thread_is_refused_at_its_first_call_and_every_time(running):
    running.collect()
    for _ in range(3):
        with pytest.raises(StateError, match=OTHER):
            call_in_thread(running.collect)
    running.collect()
    assert running.ticks == 2


def test_a_kept_collect_is_refused_in_a_second_thread_too(running):
    kept = running.collect
    kept()
    with pytest.raises(StateError, match=OTHER):
        call_in_thread(kept)


def test_start_may_be_called_by_another_thread_than_the_loop(running):
    call_in_thread(running.collect)
    assert running.ticks == 1


def test_the_next_run_may_belong_to_another_thread(running):
    running.collect()
    running.restart()
    call_in_thread(running.collect)
    with pytest.raises(StateError, match=r"first after start\(\), 'other_0', and was called by 'MainThread'"):
        running.collect()
    assert running.ticks == 1


def test_of_two_first_ticks_one_wins_and_no_row_is_torn(new_logger):
    for _ in range(20):
        logger = new_logger()
        x = logger.array("x", 40, np.int64)
        logger.start()
        together = threading.Barrier(2)
        refused = []

        def loop(number, logger=logger, x=x, together=together, refused=refused):
            together.wait()
            try:
                for _ in range(200):
                    if not refused:
                        x[:] = number
                    logger.collect()
            except StateError:
                refused.append(number)

        threads = [threading.Thread(target=loop, args=(number,)) for number in (1, 2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(refused) == 1
        assert logger.ticks == 200
        logger.close()


def test_a_serialized_logger_may_be_called_by_changing_threads(new_logger):
    logger = new_logger(threads="serialized")
    logger.array("x")
    logger.start()
    for _ in range(5):
        call_in_thread(logger.collect)
        logger.collect()
    assert logger.ticks == 10


def test_an_unknown_way_of_threads_is_refused(new_logger):
    with pytest.raises(ElementError, match="threads must be 'single' or 'serialized', got 'many'"):
        new_logger(threads="many")
