"""Programs that write a segment while a test reads it, or that are killed: `python segment_writers.py NAME FOLDER`."""

import ctypes
import sys
import time

import numpy as np

import silo
from silo.core.elements import BufferType

COLUMNS = 24


def correlated(folder: str, frequency: float = 100, columns: int = 1500) -> None:
    """At full speed for ever: every word of a row follows from its tick, in rings that wrap every few milliseconds."""
    tick = 0
    clock = lambda: tick * 7  # noqa: E731
    log = silo.Logger("writer", frequency=frequency, folder=folder, script=f"{folder}/none.yaml", clock=clock)
    scattered = [np.zeros(1, np.int64) for _ in range(COLUMNS)]
    for place, array in enumerate(scattered):
        log.add(array, f"s{place}", size=300)
    wide = log.array("wide", columns, np.int64, size=400)  # more than one gather, and a copy
    slow = log.array("slow", 4, np.int64, divider=3, size=100)
    live = log.array("live", 2, np.int64, action=silo.Action.PUBLISH, size=5)
    log.start()
    print(log._present.path, flush=True)
    while True:
        for place, array in enumerate(scattered):
            array[0] = tick * (place + 1) * 1_000_003
        wide[:] = tick
        slow[:] = tick
        live[:] = tick
        log.collect()
        tick += 1


def honest(folder: str) -> None:
    """The same, by a logger that was told how fast it will be: a snapshot has a quarter of a second."""
    correlated(folder, frequency=100_000, columns=50)


def growing(folder: str) -> None:
    """Grows at full speed: chunks of 1 MB come every few hundred rows."""
    log = silo.Logger("writer", frequency=100, max_time=0, folder=folder, script=f"{folder}/none.yaml")
    wide = log.array("wide", 300, np.int64, buffer=BufferType.GROWING, size=1)
    log.start()
    print(log._present.path, flush=True)
    tick = 0
    while True:
        wide[:] = tick
        log.collect()
        tick += 1


def counted(folder: str) -> None:
    """Says which ticks are committed through a pipe of its own: what was said must be found after `kill -9`."""
    log = silo.Logger("writer", frequency=1000, folder=folder, script=f"{folder}/none.yaml")
    x = log.array("x", 3, np.int64, size=1_000_000)
    said = ctypes.c_int64.from_buffer(np.memmap(f"{folder}/said", np.int64, "w+", shape=(1,)))
    log.start()
    print(log._present.path, flush=True)
    tick = 0
    while True:
        x[:] = tick
        log.collect()
        tick += 1
        said.value = tick
        if tick % 100 == 0:
            time.sleep(0.0005)


if __name__ == "__main__":
    {"correlated": correlated, "honest": honest, "growing": growing, "counted": counted}[sys.argv[1]](sys.argv[2])
