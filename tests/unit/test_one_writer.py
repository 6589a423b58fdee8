"""Who may call collect(): one thread per run, or, where it is asked for, one at a time."""

import ctypes
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from silo.errors import StateError

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


def test_the_next_run_may_belong_to_another_thread(running):
    running.collect()
    running.restart()
    call_in_thread(running.collect)
    said = r"first after start\(\), 'other_0', which has ended, and was called by 'MainThread'"
    with pytest.raises(StateError, match=said):
        running.collect()
    assert running.ticks == 1


def ids_of(function, wanted=None):
    """Call a function in new threads, one after the other, until one has the wanted id; returns that id."""
    for _ in range(1000):
        found = []
        thread = threading.Thread(target=lambda found=found: found.extend([threading.get_ident(), function()]))
        thread.start()
        thread.join()
        if wanted in (None, found[0]):
            return found[0]
    raise AssertionError("Linux gave no thread the id of one that had ended")


def test_a_thread_with_the_id_of_the_owner_that_ended_is_refused(running):
    first = ids_of(running.collect)
    said = []

    def collect():
        try:
            running.collect()
        except StateError as error:
            said.append(str(error))

    ids_of(collect, first)
    assert said
    assert all(
        "first after start(), 'Thread-" in text and "', which has ended, and was called" in text for text in said
    )
    assert running.ticks == 1


def test_a_run_of_another_logger_in_the_thread_that_ended_ends_too_and_the_next_start_is_free(running, new_logger):
    other = new_logger("other")
    other.array("y")
    other.start()
    ids_of(lambda: (running.collect(), other.collect()))
    for logger in (running, other):
        with pytest.raises(StateError, match="which has ended"):
            logger.collect()
        logger.restart()
        logger.collect()
        assert logger.ticks == 1


def test_a_thread_that_c_code_began_keeps_its_run_from_call_to_call(running):
    """What Python knows of it ends with each call. The calls after the first are those of destructors at its end."""
    library, raised, known = ctypes.CDLL(None), [], []

    def tick():
        known.append(threading.current_thread().ident)
        try:
            running.collect()
        except StateError as error:
            raised.append(error)

    destructor = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(lambda _: tick())
    keys = [ctypes.c_uint() for _ in range(3)]
    for key in keys:
        assert library.pthread_key_create(ctypes.byref(key), destructor) == 0

    @ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)
    def loop(_):
        tick()
        for key in keys:
            library.pthread_setspecific(key, ctypes.c_void_p(1))

    thread = ctypes.c_ulong()
    assert library.pthread_create(ctypes.byref(thread), None, loop, None) == 0
    assert library.pthread_join(thread, None) == 0
    for key in keys:
        library.pthread_key_delete(key)
    assert raised == []
    assert len(set(known)) == 1
    assert running.ticks == 4


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
