"""Derivative and integral of samples at uneven times, the same for `Signal`, `silo plot` and any other plot; and what
lies between samples, the same for a `Signal` and a `Log`.

Pure functions on float64 arrays of shape `(m,)`, `between` on `(m, components)`; times are in seconds, there in any
unit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_TURNS = {"quaternion": slice(0, 4), "pose": slice(3, 7)}  # by kind, which components are a quaternion, in any order
_NEAR = 1 - 1e-9  # the cosine from which on two turns have no angle between them that a double could tell


def goes_straight(dtype: np.dtype[Any], labels: object) -> bool:
    """Whether there is something between two samples of this type: of whole numbers, truths and states there isn't."""
    return dtype.kind == "f" and not labels


def between(kind: str, times: Floats, values: Floats, new: Floats) -> Floats:
    """What lies straight between samples at new times, within theirs, which rise; of turns along the shorter arc."""
    columns = [np.interp(new, times, column) for column in values.T]
    made = np.stack(columns, axis=-1) if columns else np.empty((len(new), 0))
    turn = _TURNS.get(kind)
    if turn is not None and values.shape[1] == turn.stop and len(times) > 1:
        made[:, turn] = _turned(times, values[:, turn], new)
    return made


def _turned(times: Floats, turns: Floats, new: Floats) -> Floats:
    """Spherical linear interpolation of quaternions; q and -q are the same turn."""
    places = np.clip(np.searchsorted(times, new, side="right") - 1, 0, len(times) - 2)
    before, behind = turns[places], turns[places + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = ((new - times[places]) / (times[places + 1] - times[places]))[:, None]
        lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(behind, axis=1)
        cosine = ((before * behind).sum(axis=1) / lengths)[:, None]
        near = np.where(cosine < 0, -behind, behind)
        angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
        arc = (np.sin((1 - part) * angle) * before + np.sin(part * angle) * near) / np.sin(angle)
        straight = (1 - part) * before + part * near
    made = np.where(np.abs(cosine) < _NEAR, arc, straight)
    return np.where(part == 0, before, np.where(part == 1, behind, made))


def derivative(times: Floats, values: Floats) -> Floats:
    """Change per second: the slopes to both neighbours, that to the nearer one counting more; of second order.

    As `numpy.gradient` of these times. The ends have one neighbour. Over a time without samples it goes straight, as
    the integral does; NaN where a neighbour is missing. A step over which time doesn't rise is none.
    """
    if len(times) < 2:
        return np.full(len(times), np.nan)
    steps = np.diff(times)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slopes = np.diff(values) / np.where(steps > 0, steps, np.nan)
        before, behind = steps[:-1], steps[1:]
        inner = slopes[:-1] + (slopes[1:] - slopes[:-1]) * (before / (before + behind))
        across = (values[2:] - values[:-2]) / (before + behind)  # of a sample that is missing itself
    inner = np.where(np.isfinite(values[1:-1]), inner, across)
    inner = np.where((before > 0) & (behind > 0), inner, np.where(before > 0, slopes[:-1], slopes[1:]))
    return np.concatenate([slopes[:1], inner, slopes[-1:]])


def integral(times: Floats, values: Floats) -> Floats:
    """Return the area under the values since the first sample, by trapezoids; NaN and steps back add nothing."""
    areas = np.nan_to_num((values[1:] + values[:-1]) / 2 * np.maximum(np.diff(times), 0.0), nan=0.0)
    return np.concatenate([np.zeros(min(1, len(values))), np.cumsum(areas)])
