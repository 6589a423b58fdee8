"""The long test of spikes in its small form: `python .bench/long/spikes.py` has 10,000."""

import pytest
from spikes import Counts, spike

pytestmark = pytest.mark.slow


def test_spikes_of_one_sample_are_all_captured_by_a_real_helper_process_and_nothing_else(runtime, tmp_path):
    assert spike(tmp_path, spikes=300, signals=50, kills=0, seed=7) == Counts(missed=0, wrong=0, false=0, twice=0)
