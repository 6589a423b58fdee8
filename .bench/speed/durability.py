"""What `storage="disk"` promises and costs: `python .bench/speed/durability.py --folder FOLDER`.

The window: how long after a tick a client is told that it would survive a power cut, in milliseconds. A client in a
process of its own asks for the status some 200 times a second, which is the resolution. The cost: how late ticks begin,
in microseconds, in turns with `storage="memory"` and with `storage="disk"`, everything else the same.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import silo
from silo.client.client import Client

NAME = "durability"
DOUBLES = 500
ASK_S = 0.005


def turn(storage: str, frequency: int, seconds: float, folder: str) -> tuple[np.ndarray, np.ndarray]:
    """A paced loop: how late each tick began (us), and how long until it was durable (ms; none for memory)."""
    log = silo.Logger(
        NAME, frequency=frequency, max_time=0, folder=folder, script=f"{folder}/none.yaml", storage=storage
    )
    values = [log.array(f"x{number}", size=int(frequency * seconds) + 1000) for number in range(DOUBLES)]
    with log.serve():
        log.start()
        command = [sys.executable, __file__, "--ask"]
        with subprocess.Popen(command, stdin=-1, stdout=-1, text=True) as client:
            assert client.stdin is not None
            assert client.stdout is not None
            client.stdout.readline()  # it is connected
            period = 1_000_000_000 // frequency
            late, deadline = np.zeros(int(frequency * seconds)), time.monotonic_ns() + period
            for tick in range(len(late)):
                while (left := deadline - time.monotonic_ns()) > 0:
                    time.sleep(left * 1e-9)
                late[tick] = -left * 1e-3
                values[tick % DOUBLES][...] = tick
                log.collect()
                deadline += period * max(1, -(-(time.monotonic_ns() - deadline) // period))
            time.sleep(0.5)  # the last ticks become durable too
            client.stdin.close()
            told = np.array(json.loads(client.stdout.readline()), np.int64).reshape(-1, 2)
        stamps = log.snapshot().time_ns
    log.close(discard=True)
    return late, window_ms(stamps, told) if storage == "disk" else np.zeros(0)


def window_ms(stamps: np.ndarray, told: np.ndarray) -> np.ndarray:
    """For each tick, until when a client was told that it is durable. `told`: rows of time (ns) and durable ticks."""
    first = np.searchsorted(told[:, 1], np.arange(len(stamps)), side="right")
    known = first < len(told)
    return np.asarray((told[first[known], 0] - stamps[known]) / 1e6)


def ask() -> None:
    """The client: asks until its input ends, then tells when it heard of which tick."""
    told: list[tuple[int, int]] = []
    with Client.connect(NAME) as client:
        print(flush=True)
        import select

        while not select.select([sys.stdin], [], [], ASK_S)[0]:
            durable = client.status().durable_ticks
            if not told or told[-1][1] != durable:
                told.append((time.time_ns(), durable))
    print(json.dumps(told), flush=True)


def row(values: np.ndarray, unit: str) -> str:
    """Median, p99 and worst of some values."""
    median, high, worst = np.percentile(values, [50, 99, 100])
    return f"median {median:8.1f}  p99 {high:8.1f}  worst {worst:8.1f} {unit}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="a folder on the disk that is to be measured")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each turn")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--ask", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.ask:
        ask()
        return
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        for frequency in (500, 1000):
            late: dict[str, list[np.ndarray]] = {"memory": [], "disk": []}
            windows = []
            for _ in range(arguments.turns):
                for storage, found in late.items():
                    lateness, window = turn(storage, frequency, arguments.seconds, folder)
                    found.append(lateness)
                    windows.append(window)
            print(f"{frequency} Hz, {DOUBLES} doubles: durable after  {row(np.concatenate(windows), 'ms')}")
            for storage, found in late.items():
                print(f"    a tick begins late, storage={storage:<8} {row(np.concatenate(found), 'us')}")


if __name__ == "__main__":
    main()
