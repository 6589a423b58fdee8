"""A picture that stands still at each crossing of a level, as an oscilloscope draws it: its settings, and one capture.

Pure data and functions. Times in a picture count from the crossing.
"""

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from silo.core.arrays.columns import ColumnGrid, ColumnStore, bins_of
from silo_tui.model.drawing.window import SECOND_NS, SPANS_S
from silo_tui.model.samples.recorded import SHORT_SPANS_S
from silo_tui.model.samples.source import Samples
from silo_tui.model.words import text

SPANS = (*SHORT_SPANS_S, *SPANS_S)
SAMPLES = 200  # in a picture at first
AUTO_S = 2.0  # without a crossing, from when on mode auto shows what is there
LEVEL_STEPS = 20  # of the height of the picture


class Mode(enum.Enum):
    """When the next picture comes."""

    NORMAL = "normal"  # with the next crossing
    SINGLE = "single"  # when it is armed again
    AUTO = "auto"  # without a crossing after a while too


NEXT = {Mode.NORMAL: Mode.SINGLE, Mode.SINGLE: Mode.AUTO, Mode.AUTO: Mode.NORMAL}


@dataclass(frozen=True)
class Scope:
    """What is waited for: `direction` is 1 for rising, -1 for falling; `pre` is the share before the crossing."""

    level: float
    direction: int = 1
    mode: Mode = Mode.NORMAL
    pre: float = 0.4
    span_s: float = 0.2

    @property
    def pre_ns(self) -> int:
        """How much of the picture is before the crossing."""
        return round(self.pre * self.span_s * SECOND_NS)

    @property
    def post_ns(self) -> int:
        """How much of it is after the crossing."""
        return round(self.span_s * SECOND_NS) - self.pre_ns

    @property
    def words(self) -> str:
        """The settings as they are read."""
        way = "↑ rising" if self.direction > 0 else "↓ falling"
        return f"{way} through {text.short(self.level, 6)}   pre {self.pre:.0%}"


def fitting_span(period_ns: int) -> float:
    """Return the span in which a pulse of one sample is seen: about 200 samples."""
    wanted = SAMPLES * period_ns / SECOND_NS
    return min(SPANS, key=lambda span: abs(math.log(span / wanted)))


def other_span(span_s: float, *, closer: bool) -> float:
    """Return the next shorter or longer span; the same one at the ends."""
    at = SPANS.index(span_s) + (-1 if closer else 1)
    return SPANS[max(0, min(len(SPANS) - 1, at))]


def halfway(low: float, high: float) -> float:
    """Return a level between two values, with no more digits than it needs."""
    middle, extent = low / 2 + high / 2, high - low
    if not extent > 0 or not math.isfinite(extent):
        return middle
    return round(middle, max(0, 1 - math.floor(math.log10(extent))))


def parse_settings(words: str, scope: Scope) -> Scope:
    """Return the settings as typed: `rising 20 pre 40`. Raises ValueError."""
    rest = words.replace("%", " ").replace(",", " ").split()
    found = scope
    while rest:
        word = rest.pop(0)
        if word in ("rising", "falling"):
            found = replace(found, direction=1 if word == "rising" else -1)
        elif word == "pre" and rest:
            share = _number(rest.pop(0)) / 100
            if not 0 <= share <= 1:
                raise ValueError(f"pre is a share of the picture, 0 to 100 %, got {100 * share:g}")
            found = replace(found, pre=share)
        elif word in {mode.value for mode in Mode}:
            found = replace(found, mode=Mode(word))
        else:
            found = replace(found, level=_number(word))
    if not math.isfinite(found.level):
        raise ValueError("the level is a number")
    return found


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        modes = ", ".join(mode.value for mode in Mode)
        raise ValueError(f"{word!r} is no level such as 20, and none of rising, falling, pre 40, {modes}") from None


def picture_of(samples: Mapping[str, Samples], scope: Scope, at_ns: int, columns: int) -> ColumnStore:
    """Return the columns of a capture, its crossing always at the same place."""
    column_ns = max(1, math.ceil(scope.span_s * SECOND_NS / columns))
    end = -(-scope.post_ns // column_ns)
    grid = ColumnGrid(len(samples), end - columns, columns)
    for row, (time_ns, values) in enumerate(samples.values()):
        inside = (time_ns >= at_ns - scope.pre_ns) & (time_ns <= at_ns + scope.post_ns)
        if inside.any() and values.dtype.kind not in "SUV":
            grid.add(row, bins_of(time_ns[inside] - at_ns, column_ns), values[inside])
    store = ColumnStore(list(samples), columns, column_ns)
    store.advance_to(end)
    store.take(grid.columns(list(samples), column_ns))
    return store


def axis_word(scope: Scope, share: float) -> str:
    """Return what stands under a place of the time axis: time from the crossing on."""
    at_s = share * scope.span_s - scope.pre * scope.span_s
    if abs(at_s) < scope.span_s / 1000:
        return "0"
    factor, unit = (1000, "ms") if scope.span_s < 2 else (1, "s")
    return f"{at_s * factor:+.4g} {unit}"


def newest_of(times: Sequence[int] | np.ndarray, after_ns: int) -> tuple[int | None, int]:
    """Return the newest of some crossings after a moment, and how many came between."""
    later = [int(each) for each in times if int(each) > after_ns]
    return (later[-1], len(later) - 1) if later else (None, 0)
