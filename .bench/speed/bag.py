"""How fast bags are written, beside the `mcap` package's own writer with the same messages, interleaved in one run.

    python .bench/speed/bag.py [--elements 500] [--ticks 2000] [--rounds 3]

The other writer gets its messages ready-made (bytes), so that only writing is compared.
"""

import argparse
import shutil
import statistics
import struct
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.bag_reader import read_bag
from silo.files.bags.ros_types import channels_of
from silo.files.bags.writer import definitions, write_bag


def robot_like(elements: int, ticks: int) -> Recording:
    """Smooth signals with sensor noise, stamps with jitter: neither constant nor random data."""
    rng = np.random.default_rng(1)
    time_ns = 1_700_000_000_000_000_000 + np.cumsum(rng.integers(2_400_000, 2_600_000, ticks))
    t = np.arange(ticks) / 400
    table = []
    for i in range(elements):
        values = np.sin(t * (1 + i / 50)) + rng.normal(0, 1e-3, ticks)
        entry = RecordedEntry(f"/log/joint{i:04}/position", Entry("", "<f8"), values)
        table.append(RecordedElement(entry.name, "rad", "scalar", (), 1, BufferType.LOOPING, 0, (entry,)))
    return Recording("robot", time_ns, ticks, table, frequency_hz=400.0, started_ns=int(time_ns[0]))


def mixed(elements: int, ticks: int) -> Recording:
    """Every divider from 1 to 20, buffers of many lengths, some strings: the slow cases together."""
    rng = np.random.default_rng(2)
    plain = robot_like(elements, ticks)
    table = []
    for i, element in enumerate(plain.elements):
        divider = 1 + i % 20
        count = int(rng.integers(ticks // divider // 2, ticks // divider))
        values = element.entries[0].values[:count]
        if i % 50 == 0:
            values = np.array([b"mode %d" % (k % 12) for k in range(count)], dtype="S8")
        first = ticks - 1 - (count - 1) * divider
        entry = RecordedEntry(element.name, Entry("", values.dtype.str), values)
        table.append(RecordedElement(element.name, "-", "scalar", (), divider, BufferType.LOOPING, first, (entry,)))
    return Recording("robot", plain.time_ns, ticks, table)


def write_with_mcap(recording: Recording, path: Path) -> float:
    """Seconds that the package's writer takes for the messages, time-major as a recorder would give them."""
    columns = [element.entries[0].values.tolist() for element in recording.elements]
    spent = 0.0
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="benchmark")
        schemas, records = definitions(recording, channels_of(recording.elements), events=False)
        schema = writer.register_schema(schemas[0].name, schemas[0].encoding, schemas[0].data)
        channels = [writer.register_channel(r.topic, "cdr", schema, r.metadata) for r in records]
        for k, stamp in enumerate(recording.time_ns.tolist()):
            stamped = struct.pack("<IiIII", 256, stamp // 10**9, stamp % 10**9, 1, 0)
            row = [stamped + struct.pack("<d", column[k]) for column in columns]
            begin = time.perf_counter()
            for channel, data in zip(channels, row, strict=True):
                writer.add_message(channel, stamp, data, stamp, k)
            spent += time.perf_counter() - begin
        begin = time.perf_counter()
        writer.finish()
        spent += time.perf_counter() - begin
    return spent


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def main() -> None:
    """Print messages per second, the ratio, file sizes and peak memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", type=int, default=500)
    parser.add_argument("--ticks", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="silo-bag-"))
    try:
        compare(robot_like(options.elements, options.ticks), folder, options.rounds)
        slow_cases(mixed(options.elements, options.ticks), folder, options.rounds)
        memory(robot_like(options.elements, options.ticks), folder)
    finally:
        shutil.rmtree(folder)


def compare(recording: Recording, folder: Path, rounds: int) -> None:
    """The same float64 messages through both writers."""
    count = sum(element.count for element in recording.elements)
    ours, theirs, bag = folder / "silo.mcap", folder / "mcap.mcap", folder / "bag"
    times: dict[str, list[float]] = {"silo .mcap": [], "silo folder": [], "mcap.writer": [], "silo read": []}
    for _ in range(rounds):
        times["silo .mcap"].append(seconds(lambda: write_bag(recording, ours)))
        times["mcap.writer"].append(write_with_mcap(recording, theirs))
        times["silo folder"].append(seconds(lambda: write_bag(recording, bag)))
        shutil.rmtree(bag)
        times["silo read"].append(seconds(lambda: read_bag(ours)))
    print(f"{count} messages, {len(recording.elements)} topics, median of {rounds}")
    for name, spent in times.items():
        print(f"  {name:12} {count / statistics.median(spent) / 1e6:8.2f} M messages/s")
    ratio = statistics.median(times["mcap.writer"]) / statistics.median(times["silo .mcap"])
    print(f"  ratio {ratio:.0f}x; size {ours.stat().st_size} bytes, mcap.writer's {theirs.stat().st_size}")
    for path in (ours, theirs):
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == count


def slow_cases(recording: Recording, folder: Path, rounds: int) -> None:
    """Dividers, buffers of different lengths, strings."""
    count = sum(element.count for element in recording.elements)
    spent = [seconds(lambda: write_bag(recording, folder / "mixed.mcap")) for _ in range(rounds)]
    print(f"mixed dividers, lengths, strings: {count / statistics.median(spent) / 1e6:.2f} M messages/s")


def memory(recording: Recording, folder: Path) -> None:
    """Peak memory beyond the recording."""
    tracemalloc.start()
    write_bag(recording, folder / "memory.mcap")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    data = sum(entry.values.nbytes for element in recording.elements for entry in element.entries)
    print(f"peak memory {peak / 1e6:.1f} MB for {data / 1e6:.1f} MB of values")


if __name__ == "__main__":
    main()
