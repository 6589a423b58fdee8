"""The signals of a made-up robot, and its words of refusal."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry, Problem
from silo.rpc.refusals import RefusedWhy, RequestRefusedError

START_NS = 1_790_000_000_000_000_000
HZ = 400.0
OWN_NAME = "ann@here silo-tui 1"
FOLDER = "/home/ann/config"


QUIET_SCRIPT = (
    "log_elements:\n  - name: /log/imu/temperature\n    enabled: true\n    divider: 4\n"
    "  - name: /log/old/thing\n    enabled: true\n"
)


def refused(why: RefusedWhy, text: str, problems: Sequence[Problem] = ()) -> RequestRefusedError:
    return RequestRefusedError(why, text, problems)


def scalar(
    name: str, unit: str = "-", dtype: str = "<f8", labels: dict[int, str] | None = None, **options: Any
) -> ElementInfo:
    return ElementInfo(
        name, unit, "scalar", (), (Entry("", dtype, labels),), ElementOptions(**{"size": 4000, **options})
    )


def vector(name: str, unit: str, suffixes: str = "xyz", kind: str = "vector", **options: Any) -> ElementInfo:
    entries = tuple(Entry(f"_{suffix}", "<f8") for suffix in suffixes)
    return ElementInfo(name, unit, kind, (len(suffixes),), entries, ElementOptions(**{"size": 4000, **options}))


def array_of_one(name: str, unit: str = "-", **options: Any) -> ElementInfo:
    return ElementInfo(name, unit, "array", (1,), (Entry("", "<f8"),), ElementOptions(**{"size": 4000, **options}))


def robot_elements() -> list[ElementInfo]:
    both = Action.SAVE_AND_PUBLISH
    found = [
        vector("/log/base/position", "m", action=both),
        vector("/log/base/velocity", "m/s", action=both),
        vector("/log/base/orientation", "-", "xyzw", "quaternion", action=both),
        vector("/log/imu/acceleration", "m/s2", action=both),
        scalar("/log/imu/temperature", "degC", divider=40, size=100, action=both),
        scalar("/log/state/gait", dtype="<i4", labels={0: "stand", 1: "walk", 2: "trot"}, action=both),
        scalar("/log/state/operator", dtype="|S16", action=both, divider=40, size=100),
        scalar("/log/state/solver_cost", "-", buffer=BufferType.GROWING),
    ]
    for leg in ("LF", "RF", "LH", "RH"):
        found.append(scalar(f"/log/legs/{leg}/contact", dtype="|b1", action=both))
        for joint in ("HAA", "HFE", "KFE"):
            place = f"/log/legs/{leg}/{joint}"
            found += [
                scalar(f"{place}/position", "rad", action=both),
                scalar(f"{place}/velocity", "rad/s", action=both),
                scalar(f"{place}/torque", "Nm", action=both),
                scalar(f"{place}/current", "A", buffer=BufferType.FIXED),
                scalar(f"{place}/temperature", "degC", divider=40, size=100, action=both),
            ]
    return found


def signal(name: str, seconds: np.ndarray) -> np.ndarray:
    """A deterministic signal for every entry name, with one spike of one sample every 4 s in torques."""
    seed = sum(ord(char) for char in name)
    speed = 0.4 + seed % 7 / 4
    values = (1 + seed % 5) * np.sin(2 * math.pi * speed * seconds + seed) + 0.2 * np.sin(61 * seconds)
    if name.endswith("torque"):
        values = np.where(np.round(seconds * HZ) % 1600 == 0, 40.0, values)
    if name.endswith("gait"):
        values = np.floor(seconds / 3) % 3
    if name.endswith("contact"):
        values = (np.sin(2 * math.pi * speed * seconds) > 0).astype(float)
    return values


def held_ticks(options: ElementOptions, ticks: int) -> int:
    """Samples that a buffer holds: ticks 0, divider, 2 * divider ... are collected."""
    return min(options.size, -(-ticks // options.divider))
