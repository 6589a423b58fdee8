"""Several processes, a logger each, read together.

A logger lives in one process: a forked child's `collect()` logs nothing. Each process makes a logger of its own, after
the fork, with a name of its own; `silo ls` lists them all, and the saved logs meet on their time stamps.

    python .docs/recipes/processes.py FOLDER
"""

import multiprocessing
import sys
import time
import warnings
from multiprocessing.synchronize import Barrier

import silo


def leg(name: str, folder: str, ready: Barrier) -> None:
    """Log 100 ticks; `serve()` makes this process visible to `silo` and `silo-tui`."""
    with silo.Logger(name, frequency=500, folder=folder, clock=time.monotonic_ns) as log:
        torque = log.array("torque", 3, unit="Nm", action="both")
        with log.serve():
            ready.wait()  # helper processes take their time to start
            log.start()
            for tick in range(100):
                torque[:] = tick
                log.collect()
                time.sleep(0.002)
            log.stop()
            log.save(name=name)


def main(folder: str) -> None:
    """Run a process per leg, then read what they logged on one time axis."""
    legs = ("left", "right")
    ready = multiprocessing.Barrier(len(legs))
    processes = [multiprocessing.Process(target=leg, args=(name, folder, ready)) for name in legs]
    for process in processes:
        process.start()
    for process in processes:
        process.join()

    left, right = (silo.open_log(name, folder)["torque"] for name in legs)
    # each ran some ticks longer than the other: the time that both have is meant, no need to be told
    warnings.filterwarnings("ignore", "calculate", silo.LogWarning)
    # the clock counts since this computer started, in every process alike
    difference = left - right.counted_from(left)
    print(f"{len(left)} samples of {legs[0]}, {len(right)} of {legs[1]}, {len(difference)} together")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
