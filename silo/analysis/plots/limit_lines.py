"""Limits as lines of a plot: which of a recording's belong to the signals that are shown. Pure."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from silo.analysis.compute.calculus import Floats
from silo.core.names import Names
from silo.core.recording import Recording

_WORDS = ("red low", "yellow low", "yellow high", "red high")


@dataclass(frozen=True)
class DrawnBound:
    """A bound: drawn across the plot where it lies `inside` of what the curves need, else told in words alone."""

    value: float
    words: str
    red: bool
    right: bool = False
    inside: bool = True


def limit_levels(recording: Recording, names: Collection[str], right: Collection[str]) -> list[DrawnBound]:
    """Return the bounds of these signals, each once; those of `right` are of the axis on the right."""
    found: dict[tuple[float, str, bool], DrawnBound] = {}
    own = {entry.name: element.name for element in recording.elements for entry in element.entries}
    owners = {name: own.get(name, name.rpartition("_")[0]) for name in names}
    known = Names([*{*names, *owners.values()}], recording.prefix)
    for limits in recording.conditions.limits:
        meant = {known.name(one) for one in known.find(limits.name, namespaces=False)}
        for name in names:
            if name not in meant and owners[name] not in meant:
                continue
            for value, word in zip(limits.bounds, _WORDS, strict=True):
                if value is not None:
                    level = DrawnBound(value, word, word.startswith("red"), name in right)
                    found.setdefault((value, word, level.right), level)
    return sorted(found.values(), key=lambda level: (level.right, -level.value))


def placed(levels: Sequence[DrawnBound], curves: Sequence[tuple[bool, Floats]]) -> list[DrawnBound]:
    """Return the levels with whether they lie near the curves (pairs of `right` and values): far ones flatten them."""
    made = []
    for level in levels:
        values = [values[np.isfinite(values)] for right, values in curves if right is level.right]
        low = min((float(some.min()) for some in values if len(some)), default=level.value)
        high = max((float(some.max()) for some in values if len(some)), default=level.value)
        room = (high - low) or abs(high) or 1.0
        inside = low - room <= level.value <= high + room
        made.append(DrawnBound(level.value, level.words, level.red, level.right, inside))
    return made
