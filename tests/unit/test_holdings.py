"""What is said of a recording is what a file of it holds."""

from dataclasses import replace

import pytest

from silo.core.elements import Action, BufferType
from silo.journal.holdings import Holdings, _lengths, recording_holdings, segment_holdings
from silo.recovery.left import save_reader
from silo.segment.reader import SegmentReader


@pytest.mark.parametrize("max_time", [0, 1])
@pytest.mark.parametrize("ticks", [0, 1, 7, 50, 95, 250])
def test_what_is_told_of_a_segment_is_what_its_snapshot_holds(new_logger, tmp_path, ticks, max_time):
    times = iter(range(0, 10**12, 10_000_000))
    logger = new_logger(max_time=max_time, clock=lambda: next(times))
    for kind in BufferType:
        for divider in (1, 3):
            logger.array(f"{kind.name}{divider}", 2, buffer=kind, size=20, divider=divider)
    logger.array("seen", action=Action.PUBLISH)
    logger.start()
    for _ in range(ticks):
        logger.collect()
    told = segment_holdings(SegmentReader(logger._present.path))
    assert replace(told, published=0) == recording_holdings(logger.snapshot())  # a file knows of what it holds alone
    assert (told.ticks, told.published) == (logger.ticks, bool(ticks))
    assert save_reader(SegmentReader(logger._present.path), tmp_path, events=())[1] == told  # as of one that died


def test_a_looping_buffer_is_told_by_its_samples_not_by_the_ticks_since_start(new_logger):
    times = iter(range(0, 10**12, 10_000_000))
    logger = new_logger(max_time=10, clock=lambda: next(times))
    logger.array("x", size=1000)
    logger.start()
    for _ in range(12_840):
        logger.collect()
    told = segment_holdings(SegmentReader(logger._present.path))
    assert told == Holdings(12_840, 1, 1000, 9.99, most_s=9.99)
    assert told.text == "1 000 samples of 1 element over 9.99 s, of 12 840 ticks since start"


def test_one_that_holds_all_makes_the_others_no_longer_than_they_are(new_logger):
    times = iter(range(0, 10**12, 10_000_000))
    logger = new_logger(max_time=40, clock=lambda: next(times))
    logger.array("x", 3, size=1000)
    logger.array("y", size=1000)
    logger.array("kept", buffer="growing")
    logger.array("seen", action=Action.PUBLISH)
    logger.start()
    for _ in range(4000):
        logger.collect()
    told = segment_holdings(SegmentReader(logger._present.path)).text
    assert told == (
        "6 000 samples of 3 elements (1 more only published) over 40 s "
        "(most of them 9.99 s or less, what their buffers hold), of 4 000 ticks since start"
    )


@pytest.mark.parametrize("ticks", [0, 3])
def test_a_stretch_is_told_by_what_it_has_since_its_cut(new_logger, ticks):
    logger = new_logger()
    logger.array("x", buffer="growing")
    logger.start()
    logger.collect()
    assert recording_holdings(logger.snapshot()).since == "start"
    logger.set("x", divider=2, cut=True)
    for _ in range(ticks):
        logger.collect()
    reader = SegmentReader(logger._present.path)
    told = segment_holdings(reader)
    assert (told.ticks, told.since) == (ticks, "the last applied change")
    assert recording_holdings(reader.snapshot()) == told


def test_nothing_is_told_as_nothing():
    assert Holdings(1, 0, 0, 0.0).text == "no sample, of 1 tick since start"


@pytest.mark.parametrize(
    ("ends", "whole", "most"),
    [
        ([(5, 25, 2), (0, 10, 1), (8, 9, 1)], 25, 20),  # two of four are no more than half
        ([(5, 25, 1), (0, 10, 2), (8, 9, 1)], 25, 10),
        ([(7, 9, 1)], 2, 2),
    ],
)
def test_lengths_are_those_of_all_and_at_most_of_more_than_half_of_the_elements(ends, whole, most):
    assert _lengths(ends, lambda tick: tick * 10**9) == (whole, most)
