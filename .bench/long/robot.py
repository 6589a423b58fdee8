"""A robot program for the long modes: `python robot.py CASE`, where CASE is a `Case` as JSON.

It does the steps of its case, then repeats `repeat` until it is killed, and says on a page of shared memory what it
does and what is committed (see `truth.py`). Saves that returned are printed: `saved TICK PATH`.
"""

import json
import os
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import truth
from truth import IDLE, PHASE, RESTARTING, RUN_FIRST, RUNNING, SAID, SAVING, STARTING, STARTS

import silo

BURST = 5  # ticks between two pauses of a paced loop
BLOCK = 500  # ticks whose values are made at once: a tick then takes some microseconds


@dataclass(frozen=True)
class Case:
    """What a robot program does. Steps are words: `serve`, `start`, `restart`, `stop`, `close`, `save TYPE...`,
    `ticks N`, `seconds S`, `raise`, `kill` (itself).

    buffer: `looping`, `fixed` or `growing`, of `size` samples. paced_s: the pause after each five ticks.
    """

    name: str
    folder: str
    page: str
    buffer: str = "looping"
    size: int = 400
    divider: int = 1
    storage: str = "memory"
    paced_s: float = 0.001
    steps: list[str] = field(default_factory=list)
    repeat: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The case as an argument."""
        return json.dumps(asdict(self))


class Source:
    """Holds an attribute that is assigned anew at each tick: it is read by an expression, not by address."""

    def __init__(self) -> None:
        self.value = 0


class Robot:
    """The logger, its variables, and the hand that turns the loop."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.page = truth.open_page(Path(case.page))
        self.tick = 0
        self.log = silo.Logger(
            case.name,
            frequency=1000,
            max_time=0,
            folder=case.folder,
            script=f"{case.folder}/none.yaml",
            storage=case.storage,
            clock=lambda: truth.stamp(self.tick),
        )
        kind, size = silo.BufferType[case.buffer.upper()], case.size
        both = silo.Action.SAVE_AND_PUBLISH
        self.scattered = [np.zeros(1, np.int64) for _ in range(truth.SCATTERED)]
        for place, array in enumerate(self.scattered):
            self.log.add(array, f"s{place}", divider=case.divider, buffer=kind, size=size)
        self.wide = self.log.array("wide", truth.WIDE, np.int64, divider=case.divider, buffer=kind, size=size)
        slow_divider = truth.SLOW_DIVIDER * case.divider
        self.slow = self.log.array(
            "slow", truth.SLOW, np.int64, divider=slow_divider, action=both, buffer=kind, size=size
        )
        self.source = Source()
        self.log.add(self.source, "read", attr="value", divider=case.divider, buffer=kind, size=size)
        # with one buffer that is not fixed the logger doesn't stop by itself when all others are full
        self.log.array("beat", dtype=np.int64, action=silo.Action.PUBLISH, size=2)
        self._make_values()

    def _make_values(self) -> None:
        """The values of the next ticks."""
        ticks = np.arange(self.tick, self.tick + BLOCK)
        self.of_wide, self.of_slow = truth.values(ticks, truth.WIDE, 1), truth.values(ticks, truth.SLOW, 2)
        columns = [truth.values(ticks, 1, 100 + place)[:, 0] for place in range(truth.SCATTERED)]
        self.of_scattered = np.stack(columns, axis=1).tolist()
        self.of_read = truth.values(ticks, 1, 3)[:, 0].tolist()

    def collect(self) -> None:
        """One tick."""
        row = self.tick % BLOCK
        if not row and self.tick:
            self._make_values()
        for array, value in zip(self.scattered, self.of_scattered[row], strict=True):
            array[0] = value
        self.wide[:] = self.of_wide[row]
        self.slow[:] = self.of_slow[row]
        self.source.value = self.of_read[row]
        self.log.collect()
        self.tick += 1
        self.page[SAID] = self.tick

    def _run_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for _ in range(BURST):
                self.collect()
            time.sleep(self.case.paced_s)

    def _begin(self, phase: int) -> None:
        self.page[RUN_FIRST] = self.tick
        self.page[PHASE] = phase
        if phase == STARTING:
            self.log.start()
        else:
            self.log.restart()
        self.page[STARTS] += 1
        self.page[PHASE] = RUNNING

    def _save(self, types: list[str]) -> None:
        self.page[PHASE] = SAVING
        tick = self.tick
        try:
            files = self.log.save(types)
        except silo.SiloError as error:
            print(f"refused {error}", flush=True)
        else:
            for file in files:
                print(f"saved {tick} {file.path}", flush=True)
        self.page[PHASE] = RUNNING

    def do(self, step: str) -> None:
        """One step of the case."""
        word, *rest = step.split()
        if word == "serve":
            print(f"helper {self.log.serve().helper_pid}", flush=True)
        elif word in ("start", "restart"):
            self._begin(STARTING if word == "start" else RESTARTING)
        elif word == "save":
            self._save(rest)
        elif word == "ticks":
            for _ in range(int(rest[0])):
                self.collect()
        elif word == "seconds":
            self._run_for(float(rest[0]))
        elif word == "raise":
            raise RuntimeError("the error of this robot program")
        elif word == "kill":
            os.kill(os.getpid(), 9)
        elif word == "stop":
            self.log.stop()
            self.page[PHASE] = IDLE
        elif word == "close":
            self.log.close()
        else:
            raise ValueError(f"a robot program knows no step '{step}'")


def main() -> None:
    """Do the steps, then repeat what is to be repeated."""
    case = Case(**json.loads(sys.argv[1]))
    robot = Robot(case)
    print("ready", flush=True)
    for step in case.steps:
        robot.do(step)
    while case.repeat:
        for step in case.repeat:
            robot.do(step)


if __name__ == "__main__":
    main()
