"""What a robot of the long modes logged, so that anybody can tell afterwards what is torn and what is missing.

Ticks are numbered for the whole life of the robot program, over all its runs. Tick n has the time stamp `stamp(n)`, and
every value follows from n and the place in its row: a row put together of two ticks is seen, and so is one that is not
there. What was committed the robot program says in a page of shared memory, which outlives it.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import silo

TICK_NS = 1_000_000
SCATTERED, WIDE, SLOW = 12, 200, 4
SLOW_DIVIDER = 3

# words of the page
PHASE, RUN_FIRST, SAID, STARTS = range(4)
WORDS = 8
IDLE, STARTING, RUNNING, RESTARTING, SAVING = range(5)


class PhaseError(Exception):
    """The robot program did not come to the phase that was waited for."""


def new_page(path: Path) -> NDArray[np.int64]:
    """The page of a robot program, all zero: its phase, the first tick of its run, the ticks said, starts done."""
    return np.memmap(path, np.int64, "w+", shape=(WORDS,))


def open_page(path: Path) -> NDArray[np.int64]:
    """The same page in the robot program."""
    return np.memmap(path, np.int64, "r+", shape=(WORDS,))


def stamp(tick: int) -> int:
    """The time stamp of a tick, ns."""
    return (tick + 1) * TICK_NS


def values(tick: int | NDArray[np.int64], columns: int, salt: int) -> NDArray[np.int64]:
    """Shape `(columns,)` or `(ticks, columns)`: what an element holds at a tick; `salt` tells elements apart."""
    factors = np.arange(1, columns + 1, dtype=np.int64) * 1_000_003 + salt
    return np.asarray(tick, np.int64)[..., None] * factors + salt


@dataclass(frozen=True)
class Sort:
    """An element of the robot: how many columns, its salt, and every which tick it is due."""

    columns: int
    salt: int
    divider: int


def sorts(divider: int) -> dict[str, Sort]:
    """The elements of the robot by name, where those that aren't `slow` have this divider."""
    scattered = {f"/log/s{place}": Sort(1, 100 + place, divider) for place in range(SCATTERED)}
    return {
        **scattered,
        "/log/wide": Sort(WIDE, 1, divider),
        "/log/slow": Sort(SLOW, 2, SLOW_DIVIDER * divider),
        "/log/read": Sort(1, 3, divider),
    }


@dataclass(frozen=True)
class Kept:
    """What a saved file holds: its last tick, the samples that are wrong, and per element those that are missing."""

    path: Path
    last: int
    torn: int
    missing: int
    says: str


def look(path: Path, divider: int, size: int, run_first: int) -> Kept:
    """Read a saved file; `size` is that of the buffers, 0 for growing ones.

    `torn` counts samples that are not what the robot logged. `missing` counts those of each element's buffer that are
    not there, up to the last tick of the file, if that is of the run that began with tick `run_first` (nobody
    remembers where earlier runs began).
    """
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        log = silo.open_log(path)
    says = " ".join(log.warnings)
    if not len(log.time_ns):
        return Kept(path, -1, 0, 0, says)
    last = int(log.time_ns[-1]) // TICK_NS - 1
    torn = missing = 0
    for name, sort in sorts(divider).items():
        due = np.arange(run_first, last + 1, sort.divider, dtype=np.int64)
        found = log.get(name)
        ticks = found.time_ns // TICK_NS - 1 if found is not None else np.zeros(0, np.int64)
        if found is not None:
            logged = np.asarray(found.values).reshape(len(ticks), -1).astype(np.int64)
            wrong = (logged != values(ticks, sort.columns, sort.salt)).any(axis=1) | (found.time_ns % TICK_NS != 0)
            wrong[1:] |= np.diff(ticks) != sort.divider
            wrong |= ~np.isin(ticks, due) & (last >= run_first)
            torn += int(np.count_nonzero(wrong))
        missing += _missing(due, ticks, size)
    return Kept(path, last, torn, missing, says)


def _missing(due: NDArray[np.int64], ticks: NDArray[np.int64], size: int) -> int:
    """How many due ticks a buffer lost: it may keep the first `size` of them, or the newest, or all."""
    wanted = len(due) if not size else min(size, len(due))
    ends = (due[:wanted], due[len(due) - wanted :])
    return min(int(np.count_nonzero(~np.isin(part, ticks))) for part in ends)
