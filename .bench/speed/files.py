"""What saving and reading cost: `.silo` and CSV, beside the plain write and read of the same bytes in the same run.

    python .bench/speed/files.py [--rounds N] [--folder FOLDER] [--json]

500 elements x 10,000 ticks of float64, as a snapshot gives them: rows of one matrix. Best / median of the rounds, which
are interleaved. Memory: what the process takes more while it works, by a second thread that looks every millisecond.
"""

import argparse
import importlib.util
import json
import os
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil

from silo.analysis.opening import open_log
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.csv.reader import read_csv
from silo.files.csv.writer import write_csv
from silo.files.silo.reader import read_silo
from silo.files.silo.writer import write_silo

ELEMENTS, TICKS = 500, 10_000
SIZE_MB = ELEMENTS * TICKS * 8 / 1e6


def make_recording() -> Recording:
    """Sines with noise, in rows that begin with tick and stamp, as in the segment."""
    rows = np.random.default_rng(1).standard_normal((TICKS, ELEMENTS + 2))
    time_ns = 1_700_000_000_123_456_789 + np.arange(TICKS, dtype=np.int64) * 2_000_000
    elements = [
        RecordedElement(
            name := f"/log/group{i % 10}/signal{i}", "rad", "scalar", (), 1, BufferType.LOOPING, 0,
            (RecordedEntry(name, Entry("", "<f8"), rows[:, i + 2]),),
        )
        for i in range(ELEMENTS)
    ]  # fmt: skip
    return Recording("bench", time_ns, TICKS, elements, time_looping=True, frequency_hz=500.0)


def plain_write(path: Path, data: bytes, sync: bool) -> None:
    """One `write` of all bytes."""
    with path.open("wb", buffering=0) as file:
        file.write(data)
        if sync:
            os.fsync(file.fileno())


def read_all(path: Path) -> None:
    """Touch every value of every signal."""
    for element in read_silo(path).elements:
        for entry in element.entries:
            np.array(entry.values)


@contextmanager
def without_sync() -> Iterator[None]:
    """Leave the data to the kernel, as a plain `write` does."""
    known = os.fsync
    os.fsync = lambda descriptor: None
    try:
        yield
    finally:
        os.fsync = known


def write_unsynced(recording: Recording, path: Path) -> None:
    """`.silo` without waiting for the disk."""
    with without_sync():
        write_silo(recording, path)


def polars_csv(recording: Recording, path: Path) -> None:
    """CSV by polars, which is not asked for metadata and takes the values as they lie there."""
    import polars as pl

    pl.DataFrame({entry.name: entry.values for one in recording.elements for entry in one.entries}).write_csv(path)


def seconds(function: Callable[[], object]) -> float:
    """Duration of one call."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def extra_memory_mb(function: Callable[[], object]) -> float:
    """The most memory that a call takes beyond what was taken before."""
    process = psutil.Process()
    before = peak = process.memory_info().rss
    done = threading.Event()

    def watch() -> None:
        nonlocal peak
        while not done.wait(0.001):
            peak = max(peak, process.memory_info().rss)

    watcher = threading.Thread(target=watch)
    watcher.start()
    function()
    done.set()
    watcher.join()
    return (peak - before) / 1e6


def main() -> None:
    """Run all and print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--folder", default=None, help="where to write; a temporary folder by default")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    recording = make_recording()
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        silo, raw, table, plain = folder / "x.silo", folder / "x.raw", folder / "x.csv", folder / "plain.csv"
        data = np.ascontiguousarray(np.stack([e.entries[0].values for e in recording.elements])).tobytes()
        # the first file of a run also warms up
        memory = extra_memory_mb(lambda: write_silo(recording, silo))
        steps: dict[str, Callable[[], object]] = {
            "plain write": lambda: plain_write(raw, data, sync=False),
            "plain write + fsync": lambda: plain_write(raw, data, sync=True),
            "write .silo": lambda: write_unsynced(recording, silo),
            "write .silo + fsync": lambda: write_silo(recording, silo),
            "np.fromfile": lambda: np.fromfile(raw),
            "open .silo": lambda: read_silo(silo),
            "read all of .silo": lambda: read_all(silo),
            "open and read one signal": lambda: np.array(open_log(silo)["/log/group7/signal237"].values),
            "write CSV": lambda: write_csv(recording, table),
            "read CSV": lambda: read_csv(table),
        }
        if importlib.util.find_spec("polars"):
            steps["polars writes CSV"] = lambda: polars_csv(recording, plain)
        slow = {"write CSV", "read CSV", "polars writes CSV"}
        measured: dict[str, list[float]] = {step: [] for step in steps}
        for number in range(options.rounds):
            for step, function in steps.items():
                if number < 3 or step not in slow:
                    measured[step].append(seconds(function))
    best = {step: min(times) for step, times in measured.items()}
    middle = {step: statistics.median(times) for step, times in measured.items()}
    facts = {
        "write .silo / plain write": middle["write .silo"] / middle["plain write"],
        "write .silo / plain write, both + fsync": middle["write .silo + fsync"] / middle["plain write + fsync"],
        "read .silo / np.fromfile": middle["read all of .silo"] / middle["np.fromfile"],
        "extra memory of write .silo / data": memory / SIZE_MB,
    } | {f"{step}, million values/s": ELEMENTS * TICKS / middle[step] / 1e6 for step in steps if "CSV" in step}
    if options.json:
        print(json.dumps({"best_s": best, "median_s": middle, "facts": facts}))
        return
    print(f"{ELEMENTS} x {TICKS} float64 ({SIZE_MB:.0f} MB), {options.rounds} rounds        best    median ms")
    for step in steps:
        print(f"  {step:42} {best[step] * 1e3:12.2f} {middle[step] * 1e3:9.2f}")
    for fact, value in facts.items():
        print(f"  {fact:42} {value:12.2f}")


if __name__ == "__main__":
    main()
