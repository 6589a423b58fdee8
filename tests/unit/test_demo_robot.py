"""The simulated robot is fit to be looked at: its signals agree with each other, its faults are there."""

import functools
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from silo.programs.demo.gait import FEET_M, MISSION_S, Gait, foot_paths, leg_angles, leg_positions, phase_at
from silo.programs.demo.program import LOOP_ELEMENTS, DemoOptions, make_robot
from silo.programs.demo.robot import (
    AMBIENT_C,
    GRAVITY_M_S2,
    MASS_KG,
    SimulatedRobot,
    Tuning,
    quaternion,
    rotation,
)
from silo.programs.demo.signals import DriveState, signals

Recorded = dict[str, NDArray[np.float64]]
FREQUENCY_HZ = 400


@pytest.fixture(scope="module")
def run() -> Recorded:
    """Twenty seconds of the robot."""
    robot = SimulatedRobot(FREQUENCY_HZ, seed=1)
    watched: dict[str, Callable[[], NDArray[np.float64]]] = {
        "position": lambda: robot.base.pose[:3],
        "quaternion": lambda: robot.base.pose[3:],
        "acceleration": lambda: robot.base.acceleration,
        "imu": lambda: robot.sensors.acceleration,
        "force": lambda: robot.legs.contact_force,
        "contact": lambda: robot.legs.contact,
        "phase": lambda: robot.legs.phase,
        "joints": lambda: robot.joints.position,
        "torque": lambda: robot.joints.torque,
        "current": lambda: robot.joints.current,
        "winding": lambda: robot.joints.winding_temperature,
        "drive_state": lambda: robot.joints.drive_state,
        "charge": lambda: robot.battery.charge,
        "sonar": lambda: robot.sensors.sonar_left,
        "pressure": lambda: robot.sensors.pressure,
        "sensor": lambda: robot.legs.force_sensor,
    }
    rows: dict[str, list[NDArray[np.float64]]] = {name: [] for name in watched}
    for _ in range(20 * FREQUENCY_HZ):
        robot.step()
        for name, read in watched.items():
            rows[name].append(read().copy())
    return {name: np.array(values) for name, values in rows.items()}


def test_legs_reach_the_feet_that_they_are_asked_for() -> None:
    feet = FEET_M + np.random.default_rng(0).uniform(-0.08, 0.08, (4, 3))
    assert np.allclose(leg_positions(leg_angles(feet))[0], feet)


def test_the_feet_stand_below_the_corners_of_a_rectangle() -> None:
    corners = [(1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, -1)]  # left front, right front, left hind, right hind
    assert np.array_equal(FEET_M, np.array(corners) * [0.33, 0.21, 0.48])


def test_a_jacobian_is_the_derivative_of_its_foot() -> None:
    angles = leg_angles(FEET_M + 0.03)
    feet, jacobian = leg_positions(angles)
    moved = angles.copy()
    moved[:, 1] += 1e-7
    assert np.allclose((leg_positions(moved)[0] - feet) / 1e-7, jacobian[:, :, 1], atol=1e-5)


def test_a_foot_path_is_closed_and_smooth() -> None:
    phases = np.linspace(0, 1, 2001)
    paths = np.array([foot_paths(np.full(4, p % 1.0), 0.6, np.full((4, 2), 0.2), 0.08)[0] for p in phases])
    assert np.allclose(paths[0], paths[-1])
    assert np.abs(np.diff(paths, 2, axis=0)).max() < 1e-5


def test_the_mission_repeats_and_begins_standing() -> None:
    assert phase_at(0.0).gait is Gait.STAND
    assert phase_at(5.0) is phase_at(5.0 + MISSION_S)


@pytest.mark.slow
def test_the_acceleration_is_the_second_derivative_of_the_position(run: Recorded) -> None:
    difference = np.diff(run["position"], 2, axis=0) * FREQUENCY_HZ**2
    assert np.allclose(difference, run["acceleration"][2:], atol=1e-6)


def test_base_imu_and_feet_obey_physics(run: Recorded) -> None:
    assert np.linalg.norm(run["imu"].mean(axis=0)) == pytest.approx(GRAVITY_M_S2, abs=0.1)
    assert np.allclose(np.linalg.norm(run["quaternion"], axis=1), 1.0)
    assert run["force"][:, :, 2].sum(axis=1).mean() == pytest.approx(MASS_KG * GRAVITY_M_S2, rel=0.05)
    assert not run["force"][run["contact"] == 0].any()  # a foot in the air carries nothing


def test_the_trot_swings_diagonal_legs_together(run: Recorded) -> None:
    contact = run["contact"][4 * FREQUENCY_HZ : 8 * FREQUENCY_HZ]
    assert (contact[:, 0] == contact[:, 3]).all()
    assert (contact[:, 0] != contact[:, 1]).mean() > 0.5
    assert contact.any(axis=1).all()


def test_joints_move_within_reach_and_torque(run: Recorded) -> None:
    assert np.ptp(run["joints"], axis=0).min() > 0.02
    assert np.abs(run["joints"]).max() < 2.6
    assert 20 < np.abs(run["torque"]).max() < 90


def test_windings_heat_with_the_square_of_their_current(run: Recorded) -> None:
    squares = (run["current"] ** 2).mean(axis=0)
    assert (run["winding"][-1] > AMBIENT_C).all()
    assert np.corrcoef(squares, run["winding"][-1])[0, 1] > 0.95


def test_each_fault_is_there_and_only_there(run: Recorded) -> None:
    assert run["charge"][-1] < run["charge"][0]
    assert 0 < np.isnan(run["sonar"]).sum() < 0.5 * len(run["sonar"])  # it is flaky
    assert np.ptp(run["pressure"][: 10 * FREQUENCY_HZ]) > 0.1
    assert np.ptp(run["pressure"][13 * FREQUENCY_HZ :]) == 0  # it sticks
    assert (run["sensor"].max(axis=0) > 1000).tolist() == [False, False, True, False]  # the broken one has spikes
    assert set(np.unique(run["drive_state"])) <= {int(state) for state in DriveState}


def test_the_same_seed_gives_the_same_motion() -> None:
    one, two, other = SimulatedRobot(seed=5), SimulatedRobot(seed=5), SimulatedRobot(seed=6)
    for _ in range(500):
        one.step(), two.step(), other.step()
    assert np.array_equal(one.joints.torque, two.joints.torque)
    assert not np.array_equal(one.joints.torque, other.joints.torque)


def test_variables_keep_their_memory() -> None:
    robot = SimulatedRobot(channels=3)
    sources = [signal.source for signal in signals(robot) if isinstance(signal.source, np.ndarray)]
    before = [source.copy() for source in sources]
    for _ in range(800):
        robot.step()
    changed = sum(not np.array_equal(old, new, equal_nan=True) for old, new in zip(before, sources, strict=True))
    assert changed > 0.8 * len(sources)  # the rest stands still by its nature: gains, error words, ...


def test_the_demo_has_five_hundred_elements_of_distinct_names() -> None:
    chosen = make_robot(DemoOptions())[1]
    assert len(chosen) + LOOP_ELEMENTS == 500
    assert len({(signal.group, signal.name) for signal in chosen}) == len(chosen)


def test_the_demo_says_in_words_what_the_letters_of_legs_and_joints_stand_for() -> None:
    said = {f"{one.group}/{one.name}": one.row.description for one in make_robot(DemoOptions())[1]}
    of_motors = [words for name, words in said.items() if name.endswith(("winding_temperature", "housing_temperature"))]
    assert len(of_motors) == 24 and all("motor" in words for words in of_motors), "found by /motor"
    assert said["legs/LF/HFE/torque"] == "left front hip flexion: measured at the joint"
    assert said["legs/RH/KFE/friction_torque"] == "right hind knee flexion"
    assert said["legs/LH/contact"] == "left hind: whether the foot carries"


@pytest.mark.parametrize("wanted", [8, 10, 500, 501, 10_000])
def test_the_number_of_elements_is_as_asked_for(wanted: int) -> None:
    assert len(make_robot(DemoOptions(elements=wanted))[1]) + LOOP_ELEMENTS == wanted


WATCHED: dict[str, Callable[[SimulatedRobot], NDArray[np.float64]]] = {
    "torque": lambda robot: np.abs(robot.joints.torque),
    "height": lambda robot: robot.base.pose[2],
    "error": lambda robot: np.abs(robot.joints.tracking_error),
    "impact": lambda robot: robot.legs.impact,
    "shaking": lambda robot: np.abs(np.diff(robot.joints.deflection)),
}


@functools.cache
def walked(tuning: Tuning) -> dict[str, float]:
    """What is watched of a walk, summed up."""
    robot, total = SimulatedRobot(200, seed=1), dict.fromkeys(WATCHED, 0.0)
    robot.tuning = tuning
    for _ in range(900):
        robot.step()
        for name, read in WATCHED.items():
            total[name] += float(np.mean(read(robot)))
    return total


@pytest.mark.parametrize(
    ("lower", "higher", "watched"),
    [
        (Tuning(step_height=0.05), Tuning(step_height=0.14), "torque"),
        (Tuning(body_height=0.53), Tuning(body_height=0.41), "torque"),
        (Tuning(body_height=0.41), Tuning(body_height=0.53), "height"),
        (Tuning(kp=5000.0), Tuning(kp=1000.0), "error"),
        (Tuning(kp=1000.0), Tuning(kp=5000.0), "impact"),
        (Tuning(kd=30.0), Tuning(kd=3.0), "shaking"),
    ],
    ids=["higher steps", "bent knees", "taller", "soft", "stiff", "damped"],
)
def test_its_parameters_change_how_it_walks(lower: Tuning, higher: Tuning, watched: str) -> None:
    assert walked(higher)[watched] > 1.03 * walked(lower)[watched]


@pytest.mark.parametrize(
    "angles", [(0.3, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 1.2), (0.3, -0.4, 1.2), (-2.0, 0.7, 3.0)]
)
def test_a_quaternion_turns_as_its_matrix_does(angles) -> None:
    x, y, z, w = quaternion(*angles)
    turned = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    np.testing.assert_allclose(turned, rotation(*angles), atol=1e-12)
