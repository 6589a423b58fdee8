"""`lost` counts samples, all elements together, wherever it stands: as the elements of a saved log count theirs."""

import numpy as np

from silo.core.elements import BufferType


def fill_beyond_the_memory_limit(logger):
    x = logger.array("x", 300, np.int64, buffer=BufferType.GROWING, size=1)
    logger.array("y", 3, buffer=BufferType.GROWING, size=1)
    logger.array("slow", 200, divider=4, buffer=BufferType.GROWING, size=1)
    logger.start()
    for tick in range(6000):
        x[:] = tick
        logger.collect()


def test_a_logger_loses_what_its_elements_lose_together(new_logger):
    logger = new_logger(max_time=0, memory_limit_mb=6)
    fill_beyond_the_memory_limit(logger)
    lost = [element.lost for element in logger.snapshot().elements]
    assert logger.lost == sum(lost)
    assert min(lost[:2]) > 0


def test_what_was_lost_is_known_after_the_end(new_logger):
    logger = new_logger(max_time=0, memory_limit_mb=6)
    fill_beyond_the_memory_limit(logger)
    lost = logger.lost
    logger.close()
    assert logger.lost == lost > 0
