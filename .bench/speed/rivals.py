"""A tick by silo and by hand, each at its best: `python .bench/speed/rivals.py [--elements 500] [--seconds 1]`.

All take the same arrays of one float64 each, anywhere in memory, all of them once per tick, and go in turns within one
run. Others are batched: one row, one message per tick. The unit is a copy of as many bytes on the same machine; what
depends on the mood of the machine divides out. Printed for each: the fastest of the turns, the median, and the median
in copies. What is written afterwards is said too: silo and the rows of NumPy only have their values in memory by then.
"""

import argparse
import csv
import os
import platform
import statistics
import struct
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from collect import by_reference, scattered
from mcap.writer import CompressionType, Writer

ROWS = 2000
Tick = Callable[[], object]


def rows_of_numpy(arrays: list[np.ndarray]) -> Tick:
    """Rows of a matrix, as one would write it who saves by `np.savez` at the end."""
    rows, stamps = np.zeros((ROWS, len(arrays))), np.zeros(ROWS, "i8")
    slot = 0

    def tick() -> None:
        nonlocal slot
        slot = (slot + 1) % ROWS
        stamps[slot] = time.time_ns()
        np.concatenate(arrays, out=rows[slot])

    return tick


def rows_of_csv(arrays: list[np.ndarray]) -> Tick:
    """A line per tick."""
    out = csv.writer(Path(os.devnull).open("w", newline=""))  # noqa: SIM115  # open as long as the benchmark runs

    def tick() -> None:
        out.writerow([time.time_ns(), *np.concatenate(arrays).tolist()])

    return tick


def messages_of_mcap(arrays: list[np.ndarray]) -> Tick:
    """One message per tick that holds all values: std_msgs/Float64MultiArray, without compression."""
    writer = Writer(Path(os.devnull).open("wb"), compression=CompressionType.NONE)  # noqa: SIM115
    writer.start(profile="ros2")
    schema = writer.register_schema("values/msg/Values", "ros2msg", b"float64[] data")
    channel = writer.register_channel("/values", "cdr", schema)
    head = struct.pack("<III", 256, len(arrays), 0)

    def tick() -> None:
        now = time.time_ns()
        writer.add_message(channel, now, head + np.concatenate(arrays).tobytes(), now)

    return tick


def turns_us(candidates: dict[str, Tick], seconds: float, rounds: int = 25) -> dict[str, list[float]]:
    """Time per call in each turn of each candidate."""
    found: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, tick in candidates.items():
            begin, calls = time.perf_counter(), 0
            while (spent := time.perf_counter() - begin) < seconds / rounds:
                for _ in range(10):
                    tick()
                calls += 10
            found[name].append(1e6 * spent / calls)
    return found


def main() -> None:
    """Measure and print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--elements", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=1.0, help="per candidate")
    wanted = parser.parse_args()
    arrays = scattered(wanted.elements)
    plain = np.zeros(wanted.elements)
    log = by_reference(arrays)
    found = turns_us(
        {
            f"copy of {plain.nbytes} bytes": plain.copy,
            "silo": log.collect,
            "rows of a NumPy matrix": rows_of_numpy(arrays),
            "mcap, one message": messages_of_mcap(arrays),
            "csv, one line": rows_of_csv(arrays),
        },
        wanted.seconds,
    )
    log.close(discard=True)
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    print(f"{wanted.elements} elements; Python {platform.python_version()}, NumPy {np.__version__}")
    print(f"{os.cpu_count()} processors, load {load}\n")
    print("| | fastest, us | median, us | in copies |\n| --- | ---: | ---: | ---: |")
    copy_us = statistics.median(next(iter(found.values())))
    for name, times in found.items():
        median = statistics.median(times)
        print(f"| {name} | {min(times):.2f} | {median:.2f} | {median / copy_us:.1f} |")


if __name__ == "__main__":
    main()
