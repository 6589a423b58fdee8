"""The least that a loop needs: a robot with attributes, some ticks, and what was logged of them."""

import contextlib
import logging
import threading


class Robot:
    """A bag of attributes."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


@contextlib.contextmanager
def turning(turn, every_s=0.001):
    """A loop in a thread of its own, as a robot has it: it turns until the block ends."""
    ended = threading.Event()

    def loop():
        while not ended.wait(every_s):
            turn()

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def values(logger, name="/log/x"):
    (element,) = [element for element in logger.snapshot().elements if element.name == name]
    return element.entries[0].values.tolist()


def warnings_of(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
