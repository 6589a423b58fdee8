"""What an open silo-tui does to the punctuality of a control loop: `python .bench/speed/beside_terminal.py`.

A 1 kHz loop collects 500 elements and serves them. It runs in turns beside a silo-tui that draws on a pseudo-terminal,
and beside a control: a process that burns, in as many bursts a second, the processor time that silo-tui, the terminal
and the helper process took for it. A pair is one turn of each, so that the ratio of their 99.9th percentiles of
lateness holds where the figures don't. `--nice N` has silo-tui run at that niceness. With `--at-once 3` the control is
as many processes that burn a part each at the same moment, as the three that are at work for a frame. Linux.
"""

import argparse
import contextlib
import os
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
from jitter import FREQUENCY, Robot, lateness_us
from terminal import Link, Terminal, shows

import silo
from silo.core.runtime import shared_memory_root

NAME = "beside"
FRAMES_HZ = 5
SIZE = (160, 50)
WARM_TICKS = 5 * FREQUENCY  # the screen is there and has begun to draw


@contextlib.contextmanager
def robot() -> Iterator[tuple[Robot, silo.Logger, psutil.Process]]:
    """A robot whose logger runs, and its helper process."""
    with tempfile.TemporaryDirectory(dir=shared_memory_root()) as folder:
        one = Robot()
        log = silo.Logger(NAME, frequency=FREQUENCY, max_time=30, folder=folder, script=f"{folder}/none.yaml")
        for place, array in enumerate(one.arrays):
            log.add(array, f"x{place}")
        with log.serve():
            log.start()
            [helper] = [each for each in psutil.Process().children() if "silo.helper" in each.cmdline()]
            yield one, log, helper
            log.stop()
        log.close(discard=True)


def used_s(processes: list[psutil.Process]) -> float:
    """Return the processor time that they have taken."""
    times = [each.cpu_times() for each in processes]
    return float(sum(each.user + each.system for each in times))


def turn(ticks: int, *role: object) -> tuple[np.ndarray, float, float]:
    """Lateness beside that role, and the shares of a core of its processes and of the helper."""
    with robot() as (one, log, helper):

        def tick() -> None:
            one.step()
            log.collect()

        tick()
        command = [sys.executable, __file__, *map(str, role)]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stdout.readline() == "looking\n", "the other process failed: the figures say nothing"
        others = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
        lateness_us(WARM_TICKS, tick)
        before, helped, begin = used_s(others), used_s([helper]), time.monotonic()
        found = lateness_us(ticks, tick)
        span = time.monotonic() - begin
        shares = (used_s(others) - before) / span, (used_s([helper]) - helped) / span
        process.communicate()  # ends its input
    return found, *shares


def look(plots: int, nice: int) -> None:
    """Hold silo-tui open in a terminal until the end of input."""
    with tempfile.TemporaryDirectory() as folder:
        private = {name: f"{folder}/{name}" for name in ("XDG_CONFIG_HOME", "XDG_STATE_HOME")}
        for path in private.values():
            Path(path).mkdir()
        command = ["nice", "-n", str(nice), sys.executable, "-m", "silo_tui", NAME, "--rate", str(FRAMES_HZ)]
        terminal = Terminal(command, SIZE, Link(), {**os.environ, **private})
        try:
            terminal.until(shows(b"RUNNING", b"Quit"))
            if plots:
                terminal.press(b" " * plots)
                terminal.rest(1.0)
                terminal.press(b"m")
                terminal.until(shows(b"shown"))
            print("looking", flush=True)
            while not select.select([sys.stdin], [], [], 0)[0]:
                terminal.step(0.1)
        finally:
            terminal.end()


def burn(share: float, at_once: int) -> None:
    """Use a share of a core in bursts until the end of input, in so many processes that begin theirs together."""
    due, share = time.monotonic(), share / at_once
    if all(os.fork() for _ in range(at_once - 1)):  # not in one that was forked
        print("looking", flush=True)
    while not select.select([sys.stdin], [], [], max(0.0, due - time.monotonic()))[0]:
        due = max(due, time.monotonic() - 1) + 1 / FRAMES_HZ  # what others' processes held up is made good for a second
        end = time.process_time() + share / FRAMES_HZ
        while time.process_time() < end:
            pass


def interval(ratios: list[float]) -> tuple[float, float, float]:
    """Return the median of ratios, and its 95 % interval by drawing them again."""
    drawn = np.median(np.random.default_rng(1).choice(ratios, (10_000, len(ratios))), axis=1)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return statistics.median(ratios), float(low), float(high)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=180, help="length of a turn")
    parser.add_argument("--plots", type=int, default=0, help="so many plots; 0: the table")
    parser.add_argument("--nice", type=int, default=0)
    parser.add_argument("--at-once", type=int, default=1, help="processes of the control")
    parser.add_argument("--look", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--burn", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.look:
        return look(options.plots, options.nice)
    if options.burn is not None:
        return burn(options.burn, options.at_once)

    ticks, share, alone = int(options.seconds * FREQUENCY), 0.2, 0.0
    kinds = ("silo-tui", "control")
    late: dict[str, list[float]] = {kind: [] for kind in kinds}
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores; us late at p50, p99, p99.9, and shares of a core")
    for pair in range(options.pairs):
        for kind in kinds if pair % 2 == 0 else kinds[::-1]:
            role = (
                ["--look", "--plots", options.plots, "--nice", options.nice]
                if kind == kinds[0]
                else ["--burn", share, "--at-once", options.at_once]
            )
            found, theirs, helpers = turn(ticks, *role)
            p50, p99, worst = np.percentile(found, [50, 99, 99.9])
            late[kind].append(worst)
            print(
                f"{pair + 1:2} {kind:9}{p50:8.0f}{p99:8.0f}{worst:8.0f}   {theirs:.3f} + helper {helpers:.3f}",
                flush=True,
            )
            if kind == kinds[0]:
                share = max(0.01, theirs + helpers - alone)
            else:
                alone = helpers
    middle, low, high = interval([one / other for one, other in zip(*late.values(), strict=True)])
    told = f"{middle:.2f} ({low:.2f} - {high:.2f}); load {os.getloadavg()[0]:.1f}"
    print(f"ratio of p99.9, median of {options.pairs} pairs: {told}")
    return None


if __name__ == "__main__":
    main()
