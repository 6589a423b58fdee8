"""`lost` counts samples, all elements together, wherever it stands: as the elements of a saved log count theirs."""

from contextlib import closing

import numpy as np

from silo.core.elements import BufferType
from silo.live.newest import NewestValues
from silo.segment.reader import SegmentReader


def fill_beyond_the_memory_limit(logger):
    x = logger.array("x", 300, np.int64, buffer=BufferType.GROWING, size=1)
    logger.array("y", 3, buffer=BufferType.GROWING, size=1)
    logger.array("slow", 200, divider=4, buffer=BufferType.GROWING, size=1)
    logger.start()
    for tick in range(6000):
        x[:] = tick
        logger.collect()


def losses(logger):
    return [logger[name].lost for name in logger]


def test_an_element_loses_what_is_counted_in_its_file(new_logger):
    logger = new_logger(max_time=0, memory_limit_mb=6)
    fill_beyond_the_memory_limit(logger)
    assert losses(logger) == [element.lost for element in logger.snapshot().elements]
    assert min(losses(logger)[:2]) > 0
    with closing(SegmentReader(logger._present.path)) as reader:  # and by its place in the list that a client has
        listed = [None, *reversed(reader.schema.elements)]
        assert NewestValues(reader, listed, [1] * len(listed)).lost().tolist() == [0, *reversed(losses(logger))]


def test_what_was_lost_is_known_after_the_end(new_logger):
    logger = new_logger(max_time=0, memory_limit_mb=6)
    fill_beyond_the_memory_limit(logger)
    lost = losses(logger)
    logger.close()
    assert losses(logger) == lost
    assert sum(lost) > 0
