"""Loggers whose loop a test turns by hand."""

import pytest

from tests.stand_ins.ticking import Robot


@pytest.fixture
def counting(new_logger):
    """A running logger of one element that counts the ticks: `counting(size=5)`."""

    def make(logger_options=None, **options):
        logger = new_logger(**(logger_options or {}))
        robot = Robot(x=-1)

        def count():
            robot.x += 1
            return robot.x

        logger.add(count, "x", **options)
        logger.start()
        robot.x = -1
        return logger

    return make


@pytest.fixture
def logged(new_logger):
    """Logs a source: `logged(source, change, ...)` collects, calls `change`, collects, and returns all entries."""

    def log(source, *changes, **options):
        logger = new_logger()
        logger.add(source, options.pop("name", "x"), **options)
        logger.start()
        logger.collect()
        for change in changes:
            change()
            logger.collect()
        log.logger = logger
        (element,) = logger.snapshot().elements
        return [entry.values.tolist() for entry in element.entries]

    return log
