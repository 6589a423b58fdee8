"""The robot program of `soak.py`: `python soak_robot.py FOLDER ELEMENTS FREQUENCY LIMIT_MB`, until a line comes in.

`tick` counts the ticks of the loop, whose time stamps are `BEGIN_NS + tick / frequency`: what is missing in a file or a
topic is seen. The other elements are doubles in five groups, of which those of `part0` and `part1` are published.
"""

import sys
import threading
import time

import numpy as np

import silo

BEGIN_NS = 1_700_000_000_000_000_000
MOVED = 100


def _wait_for_the_end(ended: threading.Event) -> None:
    sys.stdin.readline()
    ended.set()


def main() -> None:
    """Log at the given rate; at the end print ticks and lost rows of the last run."""
    folder, elements, frequency, limit_mb = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    period_ns = 1_000_000_000 // frequency
    tick = 0
    log = silo.Logger(
        "soaked",
        frequency=frequency,
        max_time=0,
        folder=folder,
        script=f"{folder}/none.yaml",
        memory_limit_mb=limit_mb,
        clock=lambda: BEGIN_NS + tick * period_ns,
    )
    both = silo.Action.SAVE_AND_PUBLISH
    counter = log.array("tick", dtype=np.int64, action=both, size=10 * frequency)
    values = []
    for place in range(elements - 1):
        group, action = f"part{place % 5}", both if place % 5 < 2 else silo.Action.SAVE
        values.append(log.array(f"x{place}", group=group, unit="m", action=action, size=5 * frequency))
    ended = threading.Event()
    threading.Thread(target=_wait_for_the_end, args=(ended,), daemon=True).start()
    with log, log.serve() as serving:
        log.start()
        log.collect()
        print(serving.helper_pid, flush=True)
        due_ns = time.monotonic_ns()
        while not ended.is_set():
            tick += 1
            counter[...] = tick
            for value in values[tick % 5 :: elements // MOVED]:
                value[...] = tick
            log.collect()
            due_ns = max(due_ns + period_ns, time.monotonic_ns() - 20 * period_ns)
            time.sleep(max(0.0, (due_ns - time.monotonic_ns()) * 1e-9))
        log.stop()
        print(log.ticks, sum(log[name].lost for name in log), flush=True)
        log.save()


if __name__ == "__main__":
    main()
