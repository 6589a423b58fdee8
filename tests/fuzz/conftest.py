"""Which inputs are tried: 200 of 2,000, others with each commit; `SILO_FUZZ_INPUTS=100000` takes so many of each."""

import os

import pytest

WAYS = 10  # in which a file is damaged before the next one is written, which takes longer than to read it


@pytest.fixture
def numbers(drawn) -> list[int]:
    asked = os.environ.get("SILO_FUZZ_INPUTS")
    return list(range(int(asked))) if asked else drawn(range(2000), 200, block=WAYS)
