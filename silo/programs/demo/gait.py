"""How the simulated robot moves its base and its feet: schedule, gaits, foot paths, leg geometry.

All feet and legs at once: arrays have one row per leg, in the order of `LEGS`.
"""

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEGS_IN_WORDS = {"LF": "left front", "RF": "right front", "LH": "left hind", "RH": "right hind"}
JOINTS_IN_WORDS = {"HAA": "hip abduction", "HFE": "hip flexion", "KFE": "knee flexion"}
LEGS, JOINTS = tuple(LEGS_IN_WORDS), tuple(JOINTS_IN_WORDS)

HEIGHT_M = 0.48  # hip above ground in the nominal stance
STEP_HEIGHT_M = 0.08
THIGH_M, SHANK_M = 0.30, 0.32
HIPS_M = np.array([[0.33, 0.12, 0.0], [0.33, -0.12, 0.0], [-0.33, 0.12, 0.0], [-0.33, -0.12, 0.0]])
HIP_OFFSETS_M = np.array([0.09, -0.09, 0.09, -0.09])  # from the abduction axis outwards to the leg's plane
KNEE_SIGNS = np.array([-1.0, -1.0, 1.0, 1.0])  # knees point inwards, front and hind
FEET_M = HIPS_M + np.stack([np.zeros(4), HIP_OFFSETS_M, np.full(4, -HEIGHT_M)], axis=1)


class Gait(enum.IntEnum):
    """Order in which the legs step."""

    STAND = 0
    WALK = 1
    TROT = 2


@dataclass(frozen=True)
class GaitTiming:
    """Cycle time, part of the cycle on the ground, and where in the cycle each leg is."""

    cycle_s: float
    duty: float
    offsets: tuple[float, float, float, float]


TIMINGS = {
    Gait.STAND: GaitTiming(0.5, 0.6, (0.0, 0.5, 0.5, 0.0)),
    Gait.WALK: GaitTiming(1.2, 0.8, (0.0, 0.5, 0.75, 0.25)),
    Gait.TROT: GaitTiming(0.5, 0.6, (0.0, 0.5, 0.5, 0.0)),  # diagonal pairs
}


@dataclass(frozen=True)
class Phase:
    """One phase of the mission: how long, and the wanted velocity of the base in its own frame."""

    name: str
    seconds: float
    gait: Gait
    forward_m_s: float = 0.0
    left_m_s: float = 0.0
    turn_rad_s: float = 0.0


MISSION = (
    Phase("standing", 1.5, Gait.STAND),
    Phase("trot forward", 8.0, Gait.TROT, forward_m_s=0.6),
    Phase("trot turn left", 5.0, Gait.TROT, forward_m_s=0.3, turn_rad_s=0.5),
    Phase("trot sideways", 4.0, Gait.TROT, left_m_s=0.2),
    Phase("walk", 7.0, Gait.WALK, forward_m_s=0.2),
    Phase("trot turn right", 5.0, Gait.TROT, forward_m_s=0.3, turn_rad_s=-0.5),
)
MISSION_S = sum(phase.seconds for phase in MISSION)


def phase_at(time_s: float) -> Phase:
    """Return the phase of the mission, which repeats."""
    left = time_s % MISSION_S
    for phase in MISSION:
        left -= phase.seconds
        if left < 0:
            return phase
    return MISSION[-1]


def foot_paths(leg_phase: Floats, duty: float, stride: Floats, lift: float) -> Floats:
    """Return feet in the heading frame, shape (4, 3): back with the ground in stance, forward through the air in swing.

    `stride` (4, 2) is the way of each foot during a stance. Position and velocity are continuous at both changes.
    """
    s = np.clip((leg_phase - duty) / (1.0 - duty), 0.0, 1.0)
    swing = -0.5 + s * s * (3.0 - 2.0 * s) + (-(1.0 - duty) / duty) * s * (1.0 + s * (2.0 * s - 3.0))
    along = np.where(leg_phase < duty, 0.5 - leg_phase / duty, swing)
    feet: Floats = FEET_M.copy()
    feet[:, :2] += stride * along[:, None]
    feet[:, 2] += lift * np.sin(np.pi * s) ** 2
    return feet


def leg_angles(feet: Floats) -> Floats:
    """Return joint angles (4, 3) that put the feet (4, 3, in the base frame) there.

    Out of reach is cut to the reach.
    """
    x, y, z = (feet - HIPS_M).T
    h = np.sqrt(np.maximum(y * y + z * z - HIP_OFFSETS_M**2, 1e-6))
    angles = np.empty((4, 3))
    angles[:, 0] = np.arctan2(z, y) - np.arctan2(-h, HIP_OFFSETS_M)
    cosine = (x * x + h * h - THIGH_M**2 - SHANK_M**2) / (2 * THIGH_M * SHANK_M)
    knee = KNEE_SIGNS * np.arccos(np.clip(cosine, -0.999, 0.999))
    angles[:, 1] = np.arctan2(-x, h) - np.arctan2(SHANK_M * np.sin(knee), THIGH_M + SHANK_M * np.cos(knee))
    angles[:, 2] = knee
    return angles


def leg_positions(angles: Floats) -> tuple[Floats, Floats]:
    """Return feet (4, 3) in the base frame, and their Jacobians (4, 3, 3) by the joint angles (4, 3)."""
    s1, c1 = np.sin(angles[:, 0]), np.cos(angles[:, 0])
    bend = angles[:, 1] + angles[:, 2]
    s23, c23 = SHANK_M * np.sin(bend), SHANK_M * np.cos(bend)
    x = -(THIGH_M * np.sin(angles[:, 1]) + s23)
    h = THIGH_M * np.cos(angles[:, 1]) + c23
    y = HIP_OFFSETS_M * c1 + h * s1
    z = HIP_OFFSETS_M * s1 - h * c1
    jacobian = np.zeros((4, 3, 3))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = -h, -c23
    jacobian[:, 1, 0], jacobian[:, 1, 1], jacobian[:, 1, 2] = -z, x * s1, -s23 * s1
    jacobian[:, 2, 0], jacobian[:, 2, 1], jacobian[:, 2, 2] = y, -x * c1, s23 * c1
    return np.stack([x, y, z], axis=1) + HIPS_M, jacobian
