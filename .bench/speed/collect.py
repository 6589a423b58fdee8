"""What a tick costs, beside what else one could do with the same values: `python .bench/speed/collect.py`.

All candidates of a row are timed in turns within one run, so that ratios hold on noisy machines. Times are medians in
microseconds per tick; in brackets they are multiples of a copy of 4 kB (500 doubles) in the same run, which is what to
compare with another machine. The first table is a tight loop, in which everything stays in the caches; the second one a
loop that sleeps between ticks, as a robot's does, where each tick finds them cold: there every candidate costs more.

Rivals are taken at their best: what can write all values of a tick as one message does so. The C++ original
(`signal_logger`) was measured on another day, in a tight loop of its own, so that its figures stand beside a copy of
that day's machine only roughly; `ORIGINAL_US` says where they come from.
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

# best / median us per `collectLoggerData()` of N doubles, divider 1, LOOPING: built with -O3 on a machine of two cores
# that also runs this benchmark, beside others' work ("What it costs" of the notes on the original)
ORIGINAL_US = {10: (0.32, 0.48), 100: (2.7, 3.8), 500: (16.7, 25.0), 1000: (48.0, 63.0), 5000: (525.0, 665.0)}
COPIED = np.zeros(500)  # 4 kB


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
        log.add(array, f"x{i}", **{"size": 2000, **chosen})
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


def mcap_batched(arrays: list[np.ndarray]) -> Tick | None:
    """One message with all values: the fastest way that the library has."""
    try:
        from mcap.writer import Writer
    except ImportError:
        return None
    writer = Writer(Path(os.devnull).open("wb"))  # noqa: SIM115  # open as long as the benchmark runs
    writer.start()
    schema = writer.register_schema("float64s", "ros2msg", b"float64[] values")
    channel = writer.register_channel("/x", "cdr", schema)
    pack = struct.Struct(f"<IIxxxx{len(arrays)}d").pack

    def tick() -> None:
        now = time.time_ns()
        writer.add_message(channel, now, pack(256, len(arrays), *[array[0] for array in arrays]), now)

    return tick


def npz_row(arrays: list[np.ndarray]) -> Tick:
    """A row of a matrix that `np.savez` would write: what one writes by hand."""
    rows = np.zeros((1000, 1 + len(arrays)))
    state = {"slot": 0}

    def tick() -> None:
        slot = state["slot"] = (state["slot"] + 1) % 1000
        rows[slot] = [time.time(), *[array[0] for array in arrays]]

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


def foxglove_batched(arrays: list[np.ndarray]) -> Tick | None:
    try:
        from foxglove import Channel, open_mcap
    except ImportError:
        return None
    open_mcap(f"{tempfile.mkdtemp()}/bench.mcap")
    channel = Channel("/x", message_encoding="json")
    names = [f"x{i}" for i in range(len(arrays))]

    def tick() -> None:
        channel.log({name: float(array[0]) for name, array in zip(names, arrays, strict=True)})

    return tick


def rerun_batched(arrays: list[np.ndarray]) -> Tick | None:
    try:
        import rerun as rr
    except ImportError:
        return None
    rr.init("bench_batched")
    rr.save(f"{tempfile.mkdtemp()}/bench.rrd")
    scalars = getattr(rr, "Scalars", None)
    if scalars is None:
        return None

    def tick() -> None:
        rr.log("x", scalars([array[0] for array in arrays]))

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


def paced_us(candidates: dict[str, Tick], hz: float = 1000.0, ticks: int = 1500) -> dict[str, float]:
    """Median time per call in a loop that sleeps between its ticks; the candidates taking turns by hundreds."""
    period_ns = int(1e9 / hz)
    times: dict[str, list[int]] = {name: [] for name in candidates}
    for _ in range(ticks // 100):
        for name, tick in candidates.items():
            due = time.monotonic_ns()
            for _ in range(100):
                due += period_ns
                time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
                begin = time.perf_counter_ns()
                tick()
                times[name].append(time.perf_counter_ns() - begin)
    return {name: statistics.median(found) / 1e3 for name, found in times.items()}


def show(title: str, times: dict[str, float]) -> None:
    copy = times["4 kB copy"]
    columns = "  ".join(f"{name} {value:.2f} ({value / copy:.1f}x)" for name, value in times.items())
    print(f"{title:<34}{columns}", flush=True)


def load() -> str:
    """What else the machine does: a high figure explains a high spread."""
    return f"load {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores"


def timed(candidates: dict[str, Tick], seconds: float) -> dict[str, float]:
    return median_us({**candidates, "4 kB copy": COPIED.copy}, seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer sizes and shorter turns")
    quick = parser.parse_args().quick
    seconds = 0.15 if quick else 0.4
    sizes = (10, 500) if quick else (10, 50, 100, 500, 1000, 5000)
    print(f"us per tick, median; in brackets: multiples of a copy of 4 kB. {load()} at the beginning\n")
    for count in sizes:
        arrays = scattered(count)
        log = by_reference(arrays)
        others: dict[str, Tick | None] = {"loop": python_loop(arrays), "npz row": npz_row(arrays)}
        others |= {"csv": csv_writer(arrays), "mcap": mcap_writer(arrays), "mcap, one message": mcap_batched(arrays)}
        if count <= 1000:
            others |= {"foxglove": foxglove(arrays), "foxglove, one message": foxglove_batched(arrays)}
            others |= {"rerun": rerun(arrays), "rerun, one message": rerun_batched(arrays)}
        candidates: dict[str, Tick] = {"silo": log.collect}
        candidates |= {name: tick for name, tick in others.items() if tick is not None}
        show(f"{count} scattered float64, divider 1", timed(candidates, seconds))
        if count in ORIGINAL_US:
            best, median = ORIGINAL_US[count]
            print(f"{'':<34}the C++ original, on its day: {best:g} at best, {median:g} in the median")
        log.close(discard=True)
    print(f"\nthe same in a loop of 1000 Hz that sleeps between its ticks ({load()})\n")
    for count in sizes[:4]:
        arrays = scattered(count)
        log = by_reference(arrays)
        mcap = mcap_batched(arrays)
        candidates = {"silo": log.collect, "loop": python_loop(arrays), "4 kB copy": COPIED.copy}
        candidates |= {"mcap, one message": mcap} if mcap is not None else {}
        show(f"{count} scattered float64, paced", paced_us(candidates, ticks=500 if quick else 1500))
        log.close(discard=True)
    print()
    arrays = scattered(500)
    variants: dict[str, dict[str, object]] = {
        "fixed (kept)": {"buffer": silo.BufferType.FIXED, "size": 200_000},
        "looping": {},
        "growing": {"buffer": silo.BufferType.GROWING, "size": 1000},
        "dividers 1 2 5 10": {"divider": [1, 2, 5, 10]},
        "dividers 1 ... 20": {"divider": list(range(1, 21))},
        "dividers 100 ... 104": {"divider": list(range(100, 105))},
        "dividers 100 ... 599": {"divider": list(range(100, 600)), "size": 20},
        "20 buffer sizes": {"size": [100 * (i + 1) for i in range(20)]},
        "all three types": {"buffer": list(silo.BufferType)},
        "published (save and publish)": {"action": silo.Action.SAVE_AND_PUBLISH},
        "nothing due": {"divider": 1_000_000, "size": 10},
        "buffers of 100": {"size": 100},
        "buffers of 20000": {"size": 20_000},
    }
    for name, options in variants.items():
        log = by_reference(arrays, **options)
        for _ in range(1000):  # at the first tick all dividers are due
            log.collect()
        show(f"500, {name}", timed({"silo": log.collect}, 0.15))
        assert log.is_running
        assert not sum(log[name].lost for name in log)
        log.close(discard=True)
    print()
    for count in (10, 100, 1000, 5000):
        log = new_logger()
        log.array("q", count, size=2000)
        log.start()
        show(f"arena, {count} float64", timed({"silo": log.collect}, seconds))
        log.close(discard=True)

    class Robot:
        pass

    robot = Robot()
    log = new_logger()
    for i in range(100):
        setattr(robot, f"a{i}", float(i))
        log.add(robot, attr=f"a{i}", size=2000)
    log.start()
    show("100 attributes", timed({"silo": log.collect}, seconds))
    log.close(discard=True)
    log = new_logger(checked=True)
    for i, array in enumerate(arrays):
        log.add(array, f"x{i}", size=2000)
    log.start()
    show("500 scattered, checked=True", timed({"silo": log.collect}, seconds))
    log.close(discard=True)


if __name__ == "__main__":
    main()
