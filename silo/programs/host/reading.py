"""What all probes of `silo host` share: elements, rates, names."""

import math
import re
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.core.elements import Action, buffer_size_for
from silo.logger.logger import Logger

LIVE = Action.SAVE_AND_PUBLISH
SAVE = Action.SAVE
MB = 1e6
KEEP_S = 600.0

Reader = Callable[[], None]
Row = tuple[str, str, Action]  # name, unit, action


def element(
    log: Logger, group: str, divider: int, name: str, unit: str = "-", action: Action = LIVE, dtype: DTypeLike = float
) -> NDArray[Any]:
    """Return a scalar in silo's memory, of which the last ten minutes are kept."""
    size = buffer_size_for(KEEP_S, log.options.frequency_hz, divider)
    return log.array(
        name, (), dtype, group=group, unit=unit, divider=divider, action=action, buffer_size=size
    )  # fmt: skip


def elements(log: Logger, group: str, divider: int, rows: Sequence[Row]) -> list[NDArray[Any]]:
    """Return one float per row, NaN until it is read."""
    made = [element(log, group, divider, *row) for row in rows]
    lose(made)
    return made


def lose(values: Sequence[NDArray[Any]]) -> None:
    """The source is gone: NaN, not a value that stands still."""
    for value in values:
        value[...] = math.nan


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
