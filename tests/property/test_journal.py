"""A journal after a power cut: what was durable is there, and no row that was not logged; see `tests/power_cuts.py`."""

import contextlib
import tracemalloc

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.core.elements import BufferType
from silo.errors import SegmentError
from silo.files.formats import read_recording
from silo.helper.left_logs import recover
from silo.journal.format import Head
from silo.journal.holdings import recording_holdings, segment_holdings
from silo.journal.reader import JournalReader
from silo.journal.writer import Disk, JournalWriter
from silo.logger.logger import Logger
from silo.segment.reader import SegmentReader
from tests.examples import examples
from tests.power_cuts import RecordingDisk, check, logged_to_journal, replay

elements = st.lists(
    st.tuples(st.integers(1, 3), st.sampled_from(list(BufferType)), st.integers(1, 150)), min_size=1, max_size=4
)


runs = st.lists(st.integers(1, 60), min_size=1, max_size=12)


@pytest.mark.slow
@settings(max_examples=examples(25))
@given(options=elements, batches=runs, seed=st.integers(0, 2**32))
def test_after_a_power_cut_at_any_call_all_that_was_durable_is_there(tmp_path_factory, options, batches, seed):
    replay(tmp_path_factory.mktemp("journal"), options, batches, seed)


@pytest.mark.slow
@settings(max_examples=examples(5))
@given(options=elements, batches=runs, seed=st.integers(0, 2**32))
def test_recover_saves_all_that_was_durable(tmp_path_factory, options, batches, seed):
    replay(tmp_path_factory.mktemp("journal"), options, batches, seed, commands=0.5)


@pytest.mark.slow
@settings(max_examples=examples(15))
@given(
    options=elements,
    batches=st.lists(st.integers(1, 40), min_size=3, max_size=8),
    seed=st.integers(0, 2**32),
    refused=st.integers(0, 2),
    after=st.integers(0, 1),  # no batch has less than one write and one sync
)
def test_a_full_disk_tears_nothing(tmp_path_factory, options, batches, seed, refused, after):
    replay(tmp_path_factory.mktemp("journal"), options, batches, seed, refusals={refused: after})


def test_a_journal_of_looping_buffers_stays_small(tmp_path):
    disk = RecordingDisk()
    options = [(1, BufferType.LOOPING, 100)]
    journal = logged_to_journal(tmp_path, options, [50] * 200, disk)
    row_bytes = 8 * 5
    assert sum(file.stat().st_size for file in journal.glob("loop-*")) < 3 * row_bytes * (100 + 64) * 4
    check(JournalReader(journal).snapshot(), 10_000, options)


def test_a_ring_that_lapped_the_journal_leaves_a_hole_that_is_not_filled(tmp_path):
    disk = RecordingDisk()
    journal = logged_to_journal(tmp_path, [(1, BufferType.LOOPING, 20)], [10, 1000, 10], disk)
    (element,) = JournalReader(journal).snapshot().elements
    assert element.entries[0].values.tolist() == list(range(1000, 1020))


def test_a_torn_description_says_that_nothing_was_durable(tmp_path):
    journal = logged_to_journal(tmp_path, [(1, BufferType.LOOPING, 20)], [10], RecordingDisk())
    schema = journal / "schema"
    schema.write_bytes(schema.read_bytes()[:-1])
    with pytest.raises(SegmentError, match="the description of the journal is torn"):
        JournalReader(journal)


def test_what_is_told_of_a_journal_is_what_its_snapshot_holds(tmp_path):
    options = [(1, BufferType.LOOPING, 100), (3, BufferType.FIXED, 50), (2, BufferType.GROWING, 10)]
    for number, batches in enumerate(([1], [50, 60], [40] * 9, [30, 1000, 10])):
        (folder := tmp_path / str(number)).mkdir()
        reader = JournalReader(logged_to_journal(folder, options, batches, RecordingDisk()))
        assert segment_holdings(reader) == recording_holdings(reader.snapshot())


def test_of_rows_any_part_is_read(tmp_path):
    options = [(1, BufferType.GROWING, 10)]
    reader = JournalReader(logged_to_journal(tmp_path, options, [7] * 30, RecordingDisk(), (), 99))
    for since, limit in ((0, None), (13, 20), (205, 50), (-5, 3), (300, None), (209, 1), (5, 0)):
        rows = reader.rows(1, since, limit)
        begin = min(max(since, 0), 210)
        assert rows.first == begin
        assert rows.ticks.tolist() == list(range(210))[begin:][:limit]


def test_a_journal_is_read_in_blocks(tmp_path):
    """Of 48 MB not a tenth is held to tell of it, not a quarter to save it; a mapped file is no such memory."""
    log = Logger("big", folder=tmp_path, script=tmp_path / "none.yaml", max_time=0, clock=iter(range(10**9)).__next__)
    x = log.array("x", 4000, buffer="growing")
    with contextlib.closing(log):
        log.start()
        for tick in range(1500):
            x[:] = tick
            log.collect()
        reader = SegmentReader(log._present.path)
        schema = msgspec.structs.replace(reader.schema, boot_id="before the power cut")
        writer = JournalWriter(tmp_path / "run.journal", Head(str(tmp_path / "gone"), schema), Disk())
        writer.append(reader)
        writer.close()
    size = sum(path.stat().st_size for path in (tmp_path / "run.journal").iterdir())
    assert size > 48e6
    tracemalloc.start()
    try:
        with contextlib.closing(JournalReader(tmp_path / "run.journal")) as journal:
            assert segment_holdings(journal).samples == 1500
        assert tracemalloc.get_traced_memory()[1] < size / 10
        (file,) = recover(tmp_path / "run.journal").files
        assert tracemalloc.get_traced_memory()[1] < size / 4
    finally:
        tracemalloc.stop()
    found = read_recording(file.path).elements[0].entries
    assert all(np.array_equal(found[place].values, np.arange(1500.0)) for place in (0, 1999, 3999))
    assert [path.name for path in tmp_path.iterdir() if ".part" in path.name or path.name.startswith("tmp")] == []


@pytest.mark.parametrize("stopped", [False, True])
def test_only_what_is_known_is_said_of_what_is_missing(stopped, tmp_path, monkeypatch):
    log = Logger("arm", folder=tmp_path, script=tmp_path / "none.yaml", max_time=0)
    log.array("x")
    with contextlib.closing(log):
        log.start()
        reader = SegmentReader(log._present.path)
        writer = JournalWriter(tmp_path / "run.journal", Head(str(reader.path), reader.schema), Disk())
        for _ in range(5):
            log.collect()
        writer.append(reader)
        if stopped:
            log.stop()
            writer.append(reader)  # no new tick
        writer.close()
    text = JournalReader(tmp_path / "run.journal").proven_text
    if stopped:
        assert text == "its journal holds all 5 ticks: logging had stopped, nothing is missing"
    else:
        assert text.startswith("its journal was durable to tick 5; what was collected after that tick, if anything, ")
        assert text.endswith("is gone (it was deleted)")
        monkeypatch.setattr("silo.journal.reader.boot_id", lambda: "after a power cut")
        text = JournalReader(tmp_path / "run.journal").proven_text
        assert text.endswith("is gone (the computer was started anew)")
