"""What large tables cost: `python .bench/speed/tables.py [--elements 10000]`.

Adding, starting, restarting, editing; time of the clock, and of the processor, which a busy machine changes less.
The copy of 400 MB at the end is there to compare machines by.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable

import msgspec
import numpy as np

import silo
from silo.core.elements import Edit


def timed(title: str, function: Callable[[], object], per: int = 1) -> None:
    """Run once and print how long it took."""
    begin, used = time.perf_counter(), time.process_time()
    function()
    wall, cpu = time.perf_counter() - begin, time.process_time() - used
    unit, scale = ("us", 1e6 / per) if per > 1 else ("ms", 1e3)
    print(f"  {title:44} {wall * scale:10.1f} {unit} {cpu * scale:10.1f} {unit} of the processor")


def main() -> None:
    """Measure one table of scattered numbers, and one of attributes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", type=int, default=10_000)
    count = parser.parse_args().elements
    print(f"{count} elements; load {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
    folder = tempfile.mkdtemp()
    arrays = [np.zeros(1) for _ in range(count)]
    log = silo.Logger("tables", frequency=1000, folder=folder, script=f"{folder}/none.yaml")

    def add() -> None:
        for number, array in enumerate(arrays):
            log.add(array, f"x{number}", size=100)

    timed("add, each", add, per=count)
    timed("start", log.start)
    log.collect()
    timed("restart of the same table", log.restart)
    log.stop()
    edits = [Edit(info.name, msgspec.structs.replace(info.options, divider=2)) for info in log.elements]
    timed("as many edits", lambda: log._scripted.apply(edits))
    timed("set of the whole table", lambda: log.set("/", divider=1))
    timed("start of the changed table", log.start)
    log.close(discard=True)

    class Robot:
        pass

    robot = Robot()
    log = silo.Logger("attributes", frequency=1000, folder=folder, script=f"{folder}/none.yaml")
    for number in range(count):
        setattr(robot, f"a{number}", float(number))
    timed("add of attributes, each", lambda: [log.add(robot, attr=f"a{i}", size=9) for i in range(count)], count)
    timed("start of attributes", log.start)
    timed("restart of attributes", log.restart)
    log.close(discard=True)
    data = np.zeros(50_000_000)
    timed("copy of 400 MB", data.copy)


if __name__ == "__main__":
    main()
