"""The least that a loop needs: a robot with attributes, some ticks, and what was logged of them."""

import logging


class Robot:
    """A bag of attributes."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


def values(logger, name="/log/x"):
    (element,) = [element for element in logger.snapshot().elements if element.name == name]
    return element.entries[0].values.tolist()


def warnings_of(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
