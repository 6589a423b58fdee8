"""How a source of `silo host` is read: its elements, its rates, its names."""

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import Action, buffer_size_for
from silo.logger.logger import Logger

LIVE = Action.SAVE_AND_PUBLISH
SAVE = Action.SAVE
MB = 1e6
KEEP_S = 600.0

Reader = Callable[[], None]


class Measured(NamedTuple):
    """What is logged of a number of a source: times `scale`, and its growth per second where it is a `rate`."""

    unit: str
    action: Action = LIVE
    scale: float = 1.0
    rate: bool = False
    dtype: str = "f8"


class Probe(NamedTuple):
    """A source: what `ask` tells, by names below `group`, each as the last word of it says, or all alike.

    `divider` is how many ticks pass between two readings, also that of the elements.
    """

    group: str
    divider: int
    columns: Measured | Mapping[str, Measured]
    ask: Callable[[Logger], Mapping[str, float]]

    def column(self, name: str) -> Measured:
        """Return what is logged of a name."""
        return self.columns if isinstance(self.columns, Measured) else self.columns[name.rpartition("/")[2]]


def reader(probe: Probe, log: Logger) -> Reader | None:
    """Add the elements of a source; return what reads new values into them, None where this machine lacks it.

    What is there no more while the program runs (a network interface, a disk) becomes NaN.
    """
    columns = {name: probe.column(name) for name in probe.ask(log)}
    if not columns:
        return None
    values = {name: _element(log, probe, name, column) for name, column in columns.items()}
    counted = [name for name, column in columns.items() if column.rate]
    rates = Rates(len(counted))

    def read() -> None:
        now = dict(probe.ask(log))
        now |= zip(counted, rates.update([now.get(name, math.nan) for name in counted]), strict=True)
        for name, column in columns.items():
            gone = math.nan if column.dtype == "f8" else 0
            values[name][...] = now.get(name, gone) * column.scale

    return read


def _element(log: Logger, probe: Probe, name: str, column: Measured) -> NDArray[Any]:
    """Return a scalar in silo's memory, of which the last ten minutes are kept."""
    below, _, last = name.rpartition("/")
    size = buffer_size_for(KEEP_S, log.options.frequency_hz, probe.divider)
    made = log.array(
        last, (), column.dtype, group=f"{probe.group}/{below}".rstrip("/"), unit=column.unit, divider=probe.divider,
        action=column.action, size=size,
    )  # fmt: skip
    if column.dtype == "f8":
        made[...] = math.nan
    return made


def plain_name(text: str) -> str:
    """Return a name fit for an element: what isn't a letter, digit, `_`, `-` or `.` becomes `_`."""
    return re.sub(r"[^\w.-]+", "_", text).strip("_") or "unnamed"


class Rates:
    """Counters to rates per second; the first reading and a counter that went back give NaN."""

    def __init__(self, count: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._last = np.full(count, math.nan)
        self._last_s = math.nan
        self._clock = clock

    def update(self, counters: Sequence[float]) -> NDArray[np.float64]:
        """Return rates since the last update, shape `(count,)`."""
        now_s, now = self._clock(), np.asarray(counters, float)
        grown = now - self._last
        rates = np.where(grown >= 0, grown, math.nan) / max(now_s - self._last_s, 1e-3)
        self._last, self._last_s = now, now_s
        return rates
