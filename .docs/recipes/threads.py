"""Several threads, a logger each, read together.

`collect()` of one logger belongs to one thread. Where control and perception run at rates of their own, each has a
logger, and the saved logs meet on their time stamps: all loggers take the same clock.

    python .docs/recipes/threads.py FOLDER
"""

import sys
import threading
import time

import silo


def control(folder: str, found: list[str], ready: threading.Barrier) -> None:
    """Log 200 ticks at 1 kHz."""
    with silo.Logger("control", frequency=1000, folder=folder, clock=time.monotonic_ns) as log:
        tau = log.array("tau", 3, unit="Nm")
        ready.wait()
        log.start()
        for tick in range(200):
            tau[:] = tick
            log.collect()
            time.sleep(0.001)
        log.stop()
        found += [saved.path for saved in log.save(name="control")]


def perception(folder: str, found: list[str], ready: threading.Barrier) -> None:
    """Log 20 ticks at 100 Hz."""
    with silo.Logger("perception", frequency=100, folder=folder, clock=time.monotonic_ns) as log:
        distance = log.array("distance", unit="m")
        ready.wait()
        log.start()
        for tick in range(20):
            distance[...] = 2.0 + tick
            log.collect()
            time.sleep(0.01)
        log.stop()
        found += [saved.path for saved in log.save(name="perception")]


def main(folder: str) -> None:
    """Run both, then read what they logged on one time axis."""
    found: list[str] = []
    ready = threading.Barrier(2)
    threads = [threading.Thread(target=work, args=(folder, found, ready)) for work in (control, perception)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    tau, distance = (silo.open_log(path)[name] for path, name in zip(sorted(found), ("tau", "distance"), strict=True))
    # times count from the start of each log; these ran at once, so the second counts from the start of the first
    distance = distance.counted_from(tau)
    together = distance.resample(tau)
    print(f"{len(tau)} samples of tau, {len(distance)} of distance")
    print(f"at the times of tau: {len(together)} values, {together.min():g} to {together.max():g}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
