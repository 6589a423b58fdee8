"""A robot program with `storage="disk"`: NAME FOLDER. One element of each buffer type at two dividers, 500 Hz.

Values and time stamps follow from the tick, so that every one can be checked. It prints its helper's pid and its
segment, obeys the lines `restart`, `save`, `close`, and answers each with `done`.
"""

import sys
import time
from threading import Thread

import silo
from silo.core.elements import BufferType

OPTIONS = [(divider, kind, size) for kind, size in zip(BufferType, (100, 60, 1000), strict=True) for divider in (1, 3)]


def main() -> None:
    tick = 0
    log = silo.Logger(
        sys.argv[1],
        frequency=500,
        max_time=0,
        folder=sys.argv[2],
        script="/none.yaml",
        storage="disk",
        clock=lambda: 1000 + tick,
    )
    arrays = [
        log.array(f"x{number}", 3, divider=divider, buffer=kind, size=size)
        for number, (divider, kind, size) in enumerate(OPTIONS)
    ]
    wishes: list[str] = []
    serving = log.serve()
    log.start()
    print(serving.helper_pid, log._present.path, flush=True)
    Thread(target=lambda: wishes.extend(iter(sys.stdin.readline, "")), daemon=True).start()
    while True:
        for array in arrays:
            array[:] = tick, -tick, tick / 2
        log.collect()
        tick += 1
        while wishes:
            wish = wishes.pop(0).strip()
            if wish == "restart":
                tick = 0
                log.restart()
            elif wish == "save":
                log.stop()
                log.save()
            elif wish == "close":
                log.close()
            print("done", flush=True)
        time.sleep(0.002)


if __name__ == "__main__":
    main()
