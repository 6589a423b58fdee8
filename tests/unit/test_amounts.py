"""Times as they are told."""

import pytest

from silo.amounts import duration
from silo.collecting.holdings import Holdings


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.0, "0 s"), (0.19, "0.19 s"), (119.0, "119 s"), (1063.0, "17.7 min"), (12_600.0, "3.5 h"), (1e6, "11.6 days")],
)
def test_a_time_is_told_in_its_natural_unit(seconds, told):
    assert duration(seconds) == told


def test_the_span_of_a_long_recording_is_told_in_minutes():
    assert "over 17.7 min, of" in Holdings(5, 1, 5, 1063.0).text
