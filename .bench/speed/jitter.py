"""What silo does to the punctuality of a control loop: `python .bench/speed/jitter.py`.

A 1 kHz loop runs in turns without silo and with all of it: 500 elements collected, the helper process serving, a client
in a process of its own that watches 50 published elements (a view at 10 Hz and every sample of five topics), and one
save after the other. Lateness is how long after its deadline a tick began, in microseconds.

Both kinds of turns share the machine's moods, so that the ratio holds where the figures don't.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

import silo
from silo.client.client import Client
from silo.core.elements import Action, FileType
from silo.core.runtime import shared_memory_root

FREQUENCY = 1000
ELEMENTS = 500
WATCHED = 50
NAME = "jitter"


class Robot:
    """Variables, and a step that changes them: some 30 us of work."""

    def __init__(self) -> None:
        self.arrays = [np.zeros(1) for _ in range(ELEMENTS)]
        self._state = np.linspace(0, 1, 200)

    def step(self) -> None:
        """One control tick."""
        for _ in range(5):
            self._state = np.sin(self._state) + 0.1
        for array, value in zip(self.arrays[:20], self._state, strict=False):
            array[0] = value


def lateness_us(ticks: int, tick: Callable[[], None]) -> np.ndarray:
    """How late each tick of a paced loop began."""
    period = 1_000_000_000 // FREQUENCY
    found = np.zeros(ticks)
    deadline = time.monotonic_ns() + period
    for place in range(ticks):
        while (left := deadline - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        found[place] = -left * 1e-3
        tick()
        # a loop that is late goes on at the next deadline that is still to come
        deadline += period * max(1, -(-(time.monotonic_ns() - deadline) // period))
    return found


def without_silo(ticks: int) -> np.ndarray:
    return lateness_us(ticks, Robot().step)


def with_silo(ticks: int, folder: str) -> tuple[np.ndarray, str]:
    """The lateness, and what the client did meanwhile."""
    robot = Robot()
    log = silo.Logger(NAME, frequency=FREQUENCY, max_time=30, folder=folder, script=f"{folder}/none.yaml")
    for place, array in enumerate(robot.arrays):
        action = Action.SAVE_AND_PUBLISH if place < WATCHED else Action.SAVE
        log.add(array, f"x{place}", action=action)
    log.update()
    with log.serve():
        log.start()
        log.collect()  # a log without a tick can't be saved
        command = [sys.executable, __file__, "--watch", str(ticks / FREQUENCY)]
        client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert client.stdout is not None
        client.stdout.readline()  # it is connected

        def tick() -> None:
            robot.step()
            log.collect()

        found = lateness_us(ticks, tick)
        said, _ = client.communicate()
        assert client.returncode == 0, "the client failed: the figures say nothing"
        log.stop()
    log.close(discard=True)
    return found, said.strip()


def watch(seconds: float) -> None:
    """The client: a view, topics and saves."""
    names = [f"/log/x{place}" for place in range(WATCHED)]
    with Client.connect(NAME) as client, client.view(names, names[:8], rate_hz=10) as view:
        topics = [client.topic(name) for name in names[:5]]
        print("connected", flush=True)
        frames = samples = saves = 0
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            job = client.save([FileType.SILO], name=f"save{saves % 3}-{time.monotonic_ns()}")
            client.wait_saved(job)
            saves += 1
            frames += view.frame() is not None
            samples += sum(len(batch.time_ns) for topic in topics for batch in topic.read())
        print(f"{saves} saves, {frames} frames looked at, {samples} samples")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=6, help="turns of each kind")
    parser.add_argument("--seconds", type=float, default=4, help="length of a turn")
    parser.add_argument("--watch", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.watch:
        watch(options.watch)
        return
    ticks = int(options.seconds * FREQUENCY)
    plain, logged = [], []
    for number in range(options.rounds):
        plain.append(without_silo(ticks))
        with tempfile.TemporaryDirectory(dir=shared_memory_root()) as folder:
            late, said = with_silo(ticks, folder)
        logged.append(late)
        print(f"round {number + 1}: {said}", flush=True)
    print(f"\nlateness of a {FREQUENCY} Hz loop in us   p50       p99       max")
    figures = []
    for name, rounds in (("without silo", plain), ("with silo, helper, client, saves", logged)):
        late = np.concatenate(rounds)
        figures.append((np.percentile(late, 50), np.percentile(late, 99), late.max()))
        print(f"{name:<34} {figures[-1][0]:7.0f}   {figures[-1][1]:7.0f}   {figures[-1][2]:7.0f}")
    ratios = [with_it / without for without, with_it in zip(*figures, strict=True)]
    print(f"{'ratio':<34} {ratios[0]:7.2f}   {ratios[1]:7.2f}   {ratios[2]:7.2f}")


if __name__ == "__main__":
    main()
