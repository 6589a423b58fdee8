"""The robot program of `pairs.py`: counts its ticks, spikes at known ones, restarts at given times, records for ever.

`python pair_robot.py FOLDER PAGE TYPES SECONDS RESTART...`: ends by `close()` after so many seconds; restarts are
seconds from the first start, the first run is number 1. The page (`int64`) says what is so: `page[0]` how many runs
there were, `page[r]` how many ticks of run r are collected. It is written after each tick, by a store of 8 bytes: it
may lack the one during which the program was killed.
"""

import sys
import time

import numpy as np

import silo

FREQUENCY_HZ = 500
BUFFER_S = 20
MOST_RUNS = 100
SPIKE_EVERY, SPIKE_AT = 211, 40
CLOSED = MOST_RUNS  # where the page says that the program has come to the end of `close()`


def is_spike(tick: int) -> bool:
    """Whether the trigger fires there; all are further apart than `pre` and `post`."""
    return tick % SPIKE_EVERY == SPIKE_AT


def main() -> None:
    """Run until the time is over."""
    folder, page_path, types, seconds, *restarts = sys.argv[1:]
    page = np.memmap(page_path, np.int64, "r+", shape=(MOST_RUNS + 1,))
    log = silo.Logger("pair", frequency=FREQUENCY_HZ, max_time=0, folder=folder, script=f"{folder}/none.yaml")
    size = FREQUENCY_HZ * BUFFER_S
    tick, run, spike = (log.array(name, (), size=size) for name in ("tick", "run", "spike"))
    log.trigger("spiked", "spike > 50", pre="20ms", post="20ms", save=types.split(","))
    log.serve()
    log.record(name="endless")
    log.start()
    number = page[0] = 1
    begun_s, due_s, end_s = time.monotonic(), sorted(map(float, restarts)), float(seconds)
    count = 0
    print("started", flush=True)
    while (now_s := time.monotonic() - begun_s) < end_s:
        if due_s and now_s >= due_s[0]:
            due_s.pop(0)
            log.restart()
            count, number = 0, number + 1
            page[0] = number
        tick[...], run[...], spike[...] = count, number, 100.0 if is_spike(count) else 0.0
        log.collect()
        count += 1
        page[number] = count
        time.sleep(1 / FREQUENCY_HZ)
    log.close()
    page[CLOSED] = 1


if __name__ == "__main__":
    main()
