"""Damaged segments: nothing but silo's errors comes out of them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("mutate_segments.py")
SEED = int(os.environ.get("SILO_FUZZ_SEED", "1"))


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.timeout(1800)
def test_a_damaged_segment_is_read_right_or_refused_with_a_segment_error(numbers, tmp_path: Path) -> None:
    home = dict(os.environ, PYTHONPATH=str(PROGRAM.parents[2]), OPENBLAS_NUM_THREADS="1")
    command = [sys.executable, str(PROGRAM), str(tmp_path), str(SEED), *map(str, numbers)]
    done = subprocess.run(command, env=home, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout[-5000:]}\n{done.stderr[-2000:]}"
    inputs, refused, failed = map(int, re.findall(r"\d+", done.stdout.splitlines()[-1]))
    assert (inputs, failed) == (len(numbers), 0)
    assert 0.1 * inputs < refused < 0.9 * inputs  # mutations that are all refused at the door test nothing behind it
