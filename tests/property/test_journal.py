"""A journal after a power cut: what was durable is there, and no row that was not logged; see `tests/power_cuts.py`."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.collecting.journal_reader import JournalReader
from silo.errors import SegmentError
from silo.model import BufferType
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
