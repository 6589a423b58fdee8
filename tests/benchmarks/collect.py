"""What a tick costs, beside what else one could do with the same values: `python tests/benchmarks/collect.py`.

All candidates of a row are timed in turns within one run, so that ratios hold on noisy machines. Times are medians in
microseconds per tick.
"""

import argparse
import csv
import io
import os
import statistics
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import silo

Tick = Callable[[], object]


def median_us(candidates: dict[str, Tick], seconds: float = 0.4, rounds: int = 15) -> dict[str, float]:
    """Median time per call, the candidates taking turns."""
    calls = {}
    for name, tick in candidates.items():
        begin, count = time.perf_counter(), 0
        while time.perf_counter() - begin < 0.02:
            tick()
            count += 1
        calls[name] = max(1, int(count / 0.02 * seconds / rounds))
    times: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, tick in candidates.items():
            begin = time.perf_counter()
            for _ in range(calls[name]):
                tick()
            times[name].append((time.perf_counter() - begin) / calls[name])
    return {name: 1e6 * statistics.median(found) for name, found in times.items()}


def new_logger(**options: object) -> silo.Logger:
    folder = tempfile.mkdtemp()
    name = f"bench{time.monotonic_ns()}"
    return silo.Logger(name, frequency=1000, max_time=3600, folder=folder, script=f"{folder}/none.yaml", **options)


def scattered(count: int) -> list[np.ndarray]:
    """Arrays of one float64 each, at addresses that have nothing to do with each other."""
    junk = []
    arrays = []
    for i in range(count):
        arrays.append(np.full(1, float(i)))
        junk.append(np.zeros(1 + i % 7))
    order = np.random.default_rng(1).permutation(count)
    return [arrays[i] for i in order]


def by_reference(arrays: list[np.ndarray], **options: object) -> silo.Logger:
    log = new_logger()
    for i, array in enumerate(arrays):
        chosen = {key: value[i % len(value)] if isinstance(value, list) else value for key, value in options.items()}
        log.add(array, f"x{i}", **{"buffer_size": 2000, **chosen})
    log.start()
    return log


def python_loop(arrays: list[np.ndarray]) -> Tick:
    rows = [[0.0] * 1000 for _ in arrays]
    state = {"slot": 0}

    def tick() -> None:
        slot = state["slot"] = (state["slot"] + 1) % 1000
        for row, array in zip(rows, arrays, strict=True):
            row[slot] = array[0]

    return tick


def csv_writer(arrays: list[np.ndarray]) -> Tick:
    out = io.StringIO()
    writer = csv.writer(out)

    def tick() -> None:
        writer.writerow([time.time_ns(), *[array[0] for array in arrays]])
        if out.tell() > 10_000_000:
            out.seek(0)

    return tick


def mcap_writer(arrays: list[np.ndarray]) -> Tick | None:
    try:
        from mcap.writer import Writer
    except ImportError:
        return None
    writer = Writer(Path(os.devnull).open("wb"))  # noqa: SIM115  # open as long as the benchmark runs
    writer.start()
    schema = writer.register_schema("float64", "ros2msg", b"float64 value")
    channels = [writer.register_channel(f"/x{i}", "cdr", schema) for i in range(len(arrays))]
    pack = struct.Struct("<Id").pack

    def tick() -> None:
        now = time.time_ns()
        for channel, array in zip(channels, arrays, strict=True):
            writer.add_message(channel, now, pack(256, array[0]), now)

    return tick


def foxglove(arrays: list[np.ndarray]) -> Tick | None:
    try:
        from foxglove import Channel, open_mcap
    except ImportError:
        return None
    open_mcap(f"{tempfile.mkdtemp()}/bench.mcap")
    channels = [Channel(f"/x{i}", message_encoding="json") for i in range(len(arrays))]

    def tick() -> None:
        for channel, array in zip(channels, arrays, strict=True):
            channel.log({"value": float(array[0])})

    return tick


def rerun(arrays: list[np.ndarray]) -> Tick | None:
    try:
        import rerun as rr
    except ImportError:
        return None
    rr.init("bench")
    rr.save(f"{tempfile.mkdtemp()}/bench.rrd")
    scalar = getattr(rr, "Scalars", None) or rr.Scalar

    def tick() -> None:
        for i, array in enumerate(arrays):
            rr.log(f"x{i}", scalar(array[0]))

    return tick


def show(title: str, times: dict[str, float]) -> None:
    first = next(iter(times.values()))
    columns = "  ".join(f"{name} {value:8.2f} ({value / first:5.2f}x)" for name, value in times.items())
    print(f"{title:<34}{columns}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer sizes and shorter turns")
    quick = parser.parse_args().quick
    seconds = 0.15 if quick else 0.4
    sizes = (10, 500) if quick else (10, 50, 100, 500, 1000, 5000)
    print("us per tick, median; in brackets: multiples of the first column\n")
    for count in sizes:
        arrays = scattered(count)
        log = by_reference(arrays)
        plain = np.zeros(count)
        others = {"loop": python_loop(arrays), "csv": csv_writer(arrays), "mcap": mcap_writer(arrays)}
        others |= {"foxglove": foxglove(arrays), "rerun": rerun(arrays)} if count <= 1000 else {}
        candidates: dict[str, Tick] = {"silo": log.collect, "copy": plain.copy}
        candidates |= {name: tick for name, tick in others.items() if tick is not None}
        show(f"{count} scattered float64, divider 1", median_us(candidates, seconds))
        log.close()
    print()
    arrays = scattered(500)
    variants: dict[str, dict[str, object]] = {
        "fixed (kept)": {"buffer_type": silo.BufferType.FIXED, "buffer_size": 200_000},
        "looping": {},
        "growing": {"buffer_type": silo.BufferType.GROWING, "buffer_size": 1000},
        "dividers 1 2 5 10": {"divider": [1, 2, 5, 10]},
        "dividers 1 ... 20": {"divider": list(range(1, 21))},
        "20 buffer sizes": {"buffer_size": [100 * (i + 1) for i in range(20)]},
        "all three types": {"buffer_type": list(silo.BufferType)},
        "published (save and publish)": {"action": silo.Action.SAVE_AND_PUBLISH},
        "nothing due": {"divider": 1_000_000, "buffer_size": 10},
        "buffers of 100": {"buffer_size": 100},
        "buffers of 20000": {"buffer_size": 20_000},
    }
    for name, options in variants.items():
        log = by_reference(arrays, **options)
        show(f"500, {name}", median_us({"silo": log.collect, "copy": np.zeros(500).copy}, 0.15))
        assert log.is_running
        assert not log.lost
        log.close()
    print()
    for count in (100, 1000, 5000):
        log = new_logger()
        log.array("q", count, buffer_size=2000)
        log.start()
        show(f"arena, {count} float64", median_us({"silo": log.collect, "copy": np.zeros(count).copy}, seconds))
        log.close()

    class Robot:
        pass

    robot = Robot()
    log = new_logger()
    for i in range(100):
        setattr(robot, f"a{i}", float(i))
        log.add(robot, attr=f"a{i}", buffer_size=2000)
    log.start()
    show("100 attributes", median_us({"silo": log.collect}, seconds))
    log.close()
    log = new_logger(checked=True)
    for i, array in enumerate(arrays):
        log.add(array, f"x{i}", buffer_size=2000)
    log.start()
    show("500 scattered, checked=True", median_us({"silo": log.collect}, seconds))
    log.close()


if __name__ == "__main__":
    main()
