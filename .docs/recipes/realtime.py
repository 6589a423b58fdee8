"""A loop at a steady rate: SCHED_FIFO, locked memory, a processor of its own, no garbage collection in between.

What a computer refuses is told and left out, so that the same program runs on a laptop. It needs either root, or in
/etc/security/limits.conf for its user: `robot - rtprio 90` and `robot - memlock unlimited`. A processor is kept free
for it by `isolcpus=3 nohz_full=3 rcu_nocbs=3` on the kernel's command line.

- `serve()` comes before: its helper process must be an ordinary one. SCHED_RESET_ON_FORK keeps it so when it is
  started again.
- Priority and processor are those of this thread alone; threads of silo keep theirs.
- `mlockall` locks the buffers too: their size must fit into the limit (`memory_limit_mb` bounds growing ones).
- `gc.freeze()` takes what was made so far out of the collector's sight; `collect()` makes no garbage.

    python .docs/recipes/realtime.py FOLDER
"""

import ctypes
import gc
import os
import sys
import time

import silo

RATE_HZ = 500
TICKS = 500
PRIORITY = 80  # below those of the kernel's interrupt threads that the loop waits for
MCL_CURRENT, MCL_FUTURE = 1, 2


def take_priority() -> str:
    """Let the scheduler put this thread before all ordinary ones. Returns what was done."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except PermissionError:
        return "no SCHED_FIFO: this user has no rtprio"
    return f"SCHED_FIFO {PRIORITY}"


def lock_memory() -> str:
    """Keep every page in memory, so that no tick waits for the disk. Returns what was done."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE):
        return f"memory not locked: {os.strerror(ctypes.get_errno())}"
    return "memory locked"


def take_processor() -> str:
    """Stay on an isolated processor, where there is one. Returns what was done."""
    try:
        with open("/sys/devices/system/cpu/isolated", encoding="ascii") as file:  # noqa: PTH123
            isolated = file.read().strip()
    except OSError:
        isolated = ""
    if not isolated:
        return "no isolated processor"
    processor = int(isolated.replace("-", ",").split(",")[0])
    os.sched_setaffinity(0, {processor})
    return f"processor {processor}"


def quiet_collector() -> str:
    """Free what can be freed now, then never in the loop. Returns what was done."""
    gc.collect()
    gc.freeze()
    gc.disable()
    return "no garbage collection"


def main(folder: str) -> None:
    """Run the loop and say how late its ticks were."""
    with silo.Logger("realtime", frequency=RATE_HZ, folder=folder, memory_limit_mb=64) as log:
        late_us = log.array("lateness", group="loop", unit="us")
        with log.serve():
            log.start()
            done = [take_processor(), lock_memory(), quiet_collector(), take_priority()]
            period_ns = 1_000_000_000 // RATE_HZ
            deadline_ns = time.monotonic_ns() + period_ns
            for _ in range(TICKS):
                while (left_ns := deadline_ns - time.monotonic_ns()) > 0:
                    time.sleep(left_ns * 1e-9)
                late_us[...] = -left_ns / 1000
                log.collect()
                deadline_ns += period_ns
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # saving is not urgent
            gc.enable()
            log.stop()
        saved = log.save("silo")
    lateness = silo.open_log(saved[0].path)["loop/lateness"]
    print(f"{len(lateness)} ticks; {'; '.join(done)}")
    print(f"late by {lateness.median():.0f} us (median), {lateness.max():.0f} us (worst)")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
