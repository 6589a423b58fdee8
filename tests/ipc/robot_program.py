"""A robot program for tests: NAME FOLDER [GROUP [fall | foxglove]]. Prints the helper's pid once it is served and runs.

Ends at end of input; with `fall`, killed right after a mark.
"""

import os
import signal
import sys
import time

import numpy as np

import silo


def main() -> None:
    name, folder = sys.argv[1:3]
    group = sys.argv[3] or None if len(sys.argv) > 3 else None
    logger = silo.Logger(name, frequency=500, max_time=60, folder=folder, script=f"{folder}/{name}.yaml")
    x = np.zeros(())
    logger.add(x, "x", action=silo.Action.SAVE_AND_PUBLISH)
    q = logger.array("q", 12, action=silo.Action.SAVE_AND_PUBLISH)
    serving = logger.serve(group=group, foxglove=0 if sys.argv[4:] == ["foxglove"] else None)
    logger.start()
    for _ in range(50):
        logger.collect()
    print(serving.helper_pid, flush=True)
    if sys.argv[4:] == ["fall"]:
        logger.mark("it falls")
        os.kill(os.getpid(), signal.SIGKILL)
    while True:
        x[...] += 1
        q += 1
        logger.collect()
        time.sleep(0.002)


main()
