"""A robot program with much to save: NAME FOLDER TICKS. Every value is the tick it was logged at, every tick is 1 ms.

It logs TICKS at once, prints the helper's pid, goes on at 500 Hz, and obeys the lines it reads: `save TYPE NAME FOLDER`
(`-` for the logger's own) prints what came of it, `end` prints the ticks logged and the samples lost, and ends.
"""

import sys
import threading
import time

import silo
from silo.core.elements import Action, BufferType
from silo.errors import SiloError

LOOPING_SIZE = 4000


def save(log: silo.Logger, words: list[str]) -> None:
    """Save as a robot program does, and say how it went."""
    file_type, name, folder = words
    try:
        (file,) = log.save(file_type, name, folder=None if folder == "-" else folder)
        print(file.path, flush=True)
    except SiloError as error:
        print(f"failed: {error}", flush=True)


def obey(log: silo.Logger, end: threading.Event) -> None:
    """Do what the test asks, while the loop goes on in the main thread."""
    try:
        for line in sys.stdin:
            command, *words = line.split()
            if command == "end":
                break
            save(log, words)
    finally:
        end.set()


def main() -> None:
    name, folder, ticks = sys.argv[1:]
    tick = 0
    log = silo.Logger(
        name, frequency=500, max_time=0, folder=folder, script="/none.yaml", clock=lambda: tick * 1_000_000
    )
    grow = log.array("grow", 1500, buffer=BufferType.GROWING)
    loop = log.array("loop", 500, size=LOOPING_SIZE)
    slow = log.array("slow", 3, divider=7, size=LOOPING_SIZE)
    beat = log.array("beat", size=LOOPING_SIZE, action=Action.SAVE_AND_PUBLISH)
    end = threading.Event()
    with log, log.serve() as serving:
        log.start()
        threading.Thread(target=obey, args=(log, end), daemon=True).start()
        while not end.is_set():
            grow[:] = loop[:] = slow[:] = beat[...] = tick
            log.collect()
            tick += 1
            if tick == int(ticks):
                print(serving.helper_pid, flush=True)
            if tick >= int(ticks):
                time.sleep(0.002)
        log.stop()
        print(log.ticks, sum(log[name].lost for name in log), tick, flush=True)


main()
