"""What conditions cost: `python .bench/speed/judging.py [--seconds 20]`.

Expressions per row, in batches as they come (50 rows), large ones and row by row; `log.mark`; and a loop of 500 signals
at 1 kHz with 20 triggers and 100 limits: the share of a core that the helper process takes, and `collect()` with and
without, in turns of one run, so that both share the machine's moods. Process time, as others use the machine too.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import silo
from silo.client.client import Client
from silo.core.elements import Entry
from silo.core.runtime import shared_memory_root
from silo.expressions.binding import Catalogue, Known, bind
from silo.expressions.evaluation import Evaluator, SourceRows

EXPRESSIONS = (
    "abs(tau_3) > 20 and mode == 2", "diff(v) < -0.5", "rate(x)", "norm(tau)", "any(tau > 50)", "mean(x, 20ms)",
    "mean(x, 50ms)", "mean(x, 1s)", "std(x, 20ms)", "std(x, 50ms)", "std(x, 1s)", "max(x, 1s) - min(x, 1s)",
)  # fmt: skip
ROWS = 20_000
SIGNALS = 500


def expression_us(text: str, batch: int) -> float:
    """Microseconds per row, the median of the batches."""
    elements = [
        Known("/log/tau", tuple(Entry(f"_{at}", "<f8", None) for at in range(12)), "Nm", 0, 1),
        *(Known(f"/log/{name}", (Entry("", "<f8", None),), "-", 0, 1) for name in ("x", "v", "mode")),
    ]
    rng = np.random.default_rng(0)
    columns = {(at, n): rng.normal(size=ROWS) for at, one in enumerate(elements) for n in range(len(one.entries))}
    ticks = np.arange(ROWS, dtype=np.int64)
    judge = Evaluator(bind(text, Catalogue(elements)))
    taken = []
    for low in range(0, ROWS, batch):
        part = slice(low, low + batch)
        rows = SourceRows(ticks[part], ticks[part] * 1_000_000, {key: column[part] for key, column in columns.items()})
        begun = time.perf_counter()
        judge.feed({0: rows})
        taken.append((time.perf_counter() - begun) / len(rows.ticks))
    return float(np.median(taken[len(taken) // 4 :])) * 1e6


def cpu_s(pid: int) -> float:
    """Seconds of CPU that a process has taken."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Robot:
    """A served logger of 500 signals."""

    def __init__(self, name: str, folder: Path, *, conditions: bool) -> None:
        self.log = silo.Logger(name, frequency=1000, max_time=0, folder=folder, script=folder / "none.yaml")
        self.arrays = [self.log.array(f"s{at}", (), group="sig", buffer="looping", size=8000) for at in range(SIGNALS)]
        if conditions:
            for at in range(20):
                self.log.trigger(f"t{at}", f"abs(s{at}) > 5 and s{at + 1} < mean(s{at + 2}, 50ms)", pre="1s", post="1s")
            for at in range(100):
                self.log.limit(f"sig/s{at}", (-20, -10, 10, 20), persistence=3, hysteresis=1)
        self.serving = self.log.serve()
        self.log.start()
        self.taken: list[int] = []

    def tick(self) -> None:
        """Collect, and note how long it took."""
        begun = time.perf_counter_ns()
        self.log.collect()
        self.taken.append(time.perf_counter_ns() - begun)


def loop(seconds: float) -> None:
    """500 signals at 1 kHz, two loggers in one loop: with conditions and without."""
    with tempfile.TemporaryDirectory(dir=shared_memory_root()) as place:
        robots = [Robot(name, Path(place), conditions=name == "judged") for name in ("plain", "judged")]
        noise = np.random.default_rng(1).normal(size=(997, SIGNALS))
        before = [cpu_s(robot.serving.helper_pid) for robot in robots]
        begun = time.monotonic()
        for tick in range(int(seconds * 1000)):
            row = noise[tick % 997]
            for robot in robots if tick % 2 else reversed(robots):
                for array, value in zip(robot.arrays, row, strict=True):
                    array[...] = value
                robot.tick()
            time.sleep(max(0.0, begun + (tick + 1) * 1e-3 - time.monotonic()))
        elapsed_s = time.monotonic() - begun
        with Client.connect("judged") as client:
            judged = client.triggers().tick
        for robot, start in zip(robots, before, strict=True):
            share = (cpu_s(robot.serving.helper_pid) - start) / elapsed_s
            median, worst = np.percentile(robot.taken, [50, 99]) / 1e3
            print(f"{robot.log.name:>8}: helper {share:6.1%} of a core; collect() {median:.2f} us, 99 % {worst:.2f} us")
        rate = int(seconds * 1000) / elapsed_s
        print(f"20 triggers, 100 limits, {SIGNALS} signals at {rate:.0f} Hz; {judged} ticks judged at the end")
        for robot in robots:
            robot.log.close(discard=True)


def mark_ns() -> float:
    """Nanoseconds of `log.mark`, the median."""
    with tempfile.TemporaryDirectory(dir=shared_memory_root()) as place:
        log = silo.Logger("marked", frequency=1000, folder=place, script=Path(place) / "none.yaml")
        log.array("x", 3)
        log.start()
        log.collect()
        taken = []
        for _ in range(2000):
            begun = time.perf_counter_ns()
            for _ in range(10):
                log.mark("push 3")
            taken.append((time.perf_counter_ns() - begun) / 10)
        log.close(discard=True)
        return float(np.median(taken))


def main() -> None:
    """Print all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    chosen = parser.parse_args()
    print(f"{'expression':<32} {'50 rows':>8} {'5000':>7} {'1 row':>7}   us per row")
    for text in EXPRESSIONS:
        print(f"{text:<32} " + " ".join(f"{expression_us(text, batch):7.2f}" for batch in (50, 5000, 1)))
    print(f"log.mark: {mark_ns():.0f} ns")
    loop(chosen.seconds)


if __name__ == "__main__":
    main()
