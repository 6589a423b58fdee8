"""Which variables of the simulated robot are logged, and how: one row per element.

Elements refer to the robot's own memory (`source` is a view of an array) or to an attribute (`attr`).
"""

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from silo.core.elements import Action, BufferType
from silo.programs.demo.gait import JOINTS, LEGS
from silo.programs.demo.parts import BatteryState, ContactState, DriveState
from silo.programs.demo.robot import SimulatedRobot

LIVE = Action.SAVE_AND_PUBLISH
SAVE = Action.SAVE
ONLY_LIVE = Action.PUBLISH
NOMINAL_HZ = 400.0
LOOPING, FIXED, GROWING = BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING


@dataclass(frozen=True)
class LoggedSignal:
    """One element. `buffer_size` None is the logger's default.

    `divider` is for 400 Hz: 4 is 100 Hz, 40 is 10 Hz, which `divider_at` keeps at other frequencies.
    """

    group: str
    name: str
    source: object
    unit: str = "-"
    divider: int = 1
    action: Action = SAVE
    buffer_type: BufferType = LOOPING
    buffer_size: int | None = None
    attr: str | None = None
    kind: str = ""
    labels: type[enum.Enum] | None = None
    description: str = ""


def divider_at(divider: int, frequency_hz: float) -> int:
    """The divider that gives the same rate as at 400 Hz, or each tick where that is faster than the loop."""
    return max(1, round(divider * frequency_hz / NOMINAL_HZ))


# attribute, unit, divider, action, labels, description
_JOINT: tuple[tuple[str, str, int, Action, type[enum.Enum] | None, str], ...] = (
    ("position", "rad", 1, LIVE, None, "measured by the encoder"),
    ("velocity", "rad/s", 1, LIVE, None, "difference of the positions"),
    ("torque", "Nm", 1, LIVE, None, "measured at the joint"),
    ("current", "A", 1, LIVE, None, "motor current"),
    ("winding_temperature", "degC", 40, LIVE, None, "heats with the square of the current"),
    ("position_command", "rad", 1, SAVE, None, ""),
    ("velocity_command", "rad/s", 1, SAVE, None, ""),
    ("torque_command", "Nm", 1, SAVE, None, ""),
    ("tracking_error", "rad", 1, LIVE, None, "command minus measured position"),
    ("acceleration", "rad/s^2", 2, SAVE, None, ""),
    ("gravity_torque", "Nm", 2, SAVE, None, "part of the torque that carries the contact force"),
    ("friction_torque", "Nm", 2, SAVE, None, ""),
    ("torque_margin", "Nm", 4, SAVE, None, "distance to the torque limit"),
    ("voltage", "V", 2, SAVE, None, "at the motor"),
    ("power", "W", 2, SAVE, None, "electrical power of the motor"),
    ("energy", "J", 40, SAVE, None, "since the program started"),
    ("housing_temperature", "degC", 400, LIVE, None, ""),
    ("encoder_count", "count", 1, SAVE, None, "65536 counts per turn"),
    ("bus_latency", "us", 4, SAVE, None, "answer time of the drive"),
    ("missed_frames", "count", 40, SAVE, None, ""),
    ("error_flags", "bits", 4, SAVE, None, "error word of the drive"),
    ("drive_state", "-", 4, LIVE, DriveState, ""),
    ("peak_torque", "Nm", 40, SAVE, None, "largest since the program started"),
    ("deflection", "rad", 4, SAVE, None, "of drive and gear under the torque"),
    ("mechanical_power", "W", 4, SAVE, None, "torque times velocity"),
    ("position_margin", "rad", 4, SAVE, None, "distance to the end stop"),
    ("thermal_load", "%", 40, LIVE, None, "of the winding, 100 is 110 degC"),
    ("drive_temperature", "degC", 400, SAVE, None, "power electronics"),
    ("gain_p", "Nm/rad", 400, SAVE, None, ""),
    ("gain_d", "Nm*s/rad", 400, SAVE, None, ""),
)

_LEG: tuple[tuple[str, str, int, Action, type[enum.Enum] | None, str], ...] = (
    ("contact", "-", 1, LIVE, None, "whether the foot carries"),
    ("contact_force", "N", 1, LIVE, None, "on the foot, in the world frame"),
    ("contact_state", "-", 1, LIVE, ContactState, ""),
    ("contact_probability", "-", 2, LIVE, None, ""),
    ("force_sensor", "N", 1, LIVE, None, "normal force as the foot's sensor reports it, with spikes on LH"),
    ("force_command", "N", 1, SAVE, None, ""),
    ("phase", "-", 1, LIVE, None, "place in the gait cycle, 0 at touchdown"),
    ("foot_position", "m", 1, LIVE, None, "in the base frame"),
    ("foot_velocity", "m/s", 1, SAVE, None, "in the base frame"),
    ("foot_target", "m", 1, SAVE, None, "in the base frame"),
    ("jacobian", "m/rad", 4, SAVE, None, "foot velocity by joint velocity"),
    ("stance_time", "s", 4, SAVE, None, ""),
    ("swing_time", "s", 4, SAVE, None, ""),
    ("step_count", "count", 40, LIVE, None, ""),
    ("slip_distance", "m", 40, SAVE, None, ""),
    ("friction_margin", "N", 4, SAVE, None, "distance to the friction cone"),
    ("impact", "N", 1, SAVE, None, "blow at touchdown"),
    ("ground_height", "m", 4, SAVE, None, "under the foot, in the world, kept while it swings"),
    ("power", "W", 40, LIVE, None, "electrical power of the three drives"),
    ("board_temperature", "degC", 400, LIVE, None, "motor driver board"),
    ("board_voltage", "V", 40, SAVE, None, ""),
    ("board_current", "A", 40, SAVE, None, ""),
    ("fan_speed", "rpm", 400, SAVE, None, ""),
)


def signals(robot: SimulatedRobot) -> list[LoggedSignal]:
    """Return every element of the robot, the most telling ones first; about 500."""
    return [
        *_body(robot),
        *_legs(robot),
        *_joints(robot),
        *_software(robot),
        *_channels(robot),
    ]


def _body(robot: SimulatedRobot) -> Iterator[LoggedSignal]:
    base, sensors, battery = robot.base, robot.sensors, robot.battery
    yield LoggedSignal("base", "pose", base.pose, "m", action=LIVE, kind="pose", description="base in the world")
    yield LoggedSignal("base", "twist", base.twist, "m/s", action=LIVE, kind="twist", description="in the base frame")
    yield LoggedSignal("base", "acceleration", base.acceleration, "m/s^2", action=LIVE, description="in the world")
    yield LoggedSignal("base", "euler", base.euler, "rad", 4, LIVE, kind="array", description="roll, pitch, yaw")
    yield LoggedSignal("base", "command", base.command, "m/s", 4, LIVE, kind="array", description="forward, left, turn")
    yield LoggedSignal("base", "centre_of_mass", base.centre_of_mass, "m", 4)
    yield LoggedSignal("base", "inertia", base.inertia, "kg m^2", 400, buffer_type=FIXED, buffer_size=1)
    yield LoggedSignal("controller", "gait", robot.controller, attr="gait", action=LIVE)
    yield LoggedSignal(
        "controller", "state", robot.controller, attr="state", divider=4, action=LIVE, description="mission"
    )
    yield LoggedSignal("imu", "acceleration", sensors.acceleration, "m/s^2", action=LIVE, description="with gravity")
    yield LoggedSignal("imu", "angular_velocity", sensors.angular_velocity, "rad/s", action=LIVE)
    yield LoggedSignal("imu", "orientation", sensors.orientation, "-", action=LIVE, kind="quaternion")
    yield LoggedSignal("imu", "magnetic_field", sensors.magnetic_field, "uT", 4)
    yield LoggedSignal("imu", "temperature", sensors.imu_temperature, "degC", 400, LIVE)
    yield LoggedSignal("imu", "gyro_bias", sensors.gyro_bias, "rad/s", 40)
    yield LoggedSignal("battery", "voltage", battery.voltage, "V", 40, LIVE)
    yield LoggedSignal("battery", "current", battery.current, "A", 40, LIVE)
    yield LoggedSignal("battery", "power", battery.power, "W", 40, LIVE)
    yield LoggedSignal("battery", "charge", battery.charge, "-", 400, LIVE, GROWING, 600, description="0 empty, 1 full")
    yield LoggedSignal("battery", "temperature", battery.temperature, "degC", 400, SAVE, GROWING, 600)
    yield LoggedSignal("battery", "cells", battery.cells, "V", 400, SAVE, GROWING, 600)
    yield LoggedSignal("battery", "state", battery, attr="state", divider=400, action=LIVE, labels=BatteryState)
    yield LoggedSignal(
        "sensors", "sonar_left", sensors.sonar_left, "m", 2, LIVE, description="loose plug: NaN now and then"
    )
    yield LoggedSignal("sensors", "sonar_right", sensors.sonar_right, "m", 2, LIVE)
    yield LoggedSignal("sensors", "pressure", sensors.pressure, "mbar", 4, LIVE, description="sticks after 12 s")
    yield LoggedSignal("sensors", "humidity", sensors.humidity, "%", 400)
    yield LoggedSignal(
        "sensors", "ranges", sensors.ranges, "m", 20, ONLY_LIVE, description="32 beams, too much to keep"
    )


def _legs(robot: SimulatedRobot) -> Iterator[LoggedSignal]:
    for row, leg in enumerate(LEGS):
        for name, unit, divider, action, labels, description in _LEG:
            source = getattr(robot.legs, name)[row, ...]
            yield LoggedSignal(
                f"legs/{leg}", name, source, unit, divider, action, labels=labels, description=description
            )  # fmt: skip


def _joints(robot: SimulatedRobot) -> Iterator[LoggedSignal]:
    for place in range(len(LEGS) * len(JOINTS)):
        group = f"legs/{LEGS[place // 3]}/{JOINTS[place % 3]}"
        for name, unit, divider, action, labels, description in _JOINT:
            source: Any = getattr(robot.joints, name)[place, ...]
            # gains are set once: their first samples say all
            buffer_type, size = (FIXED, 10) if name.startswith("gain") else (LOOPING, None)
            yield LoggedSignal(
                group, name, source, unit, divider, action, buffer_type, size, labels=labels, description=description
            )


def _software(robot: SimulatedRobot) -> Iterator[LoggedSignal]:
    controller, estimator = robot.controller, robot.estimator
    yield LoggedSignal("controller", "gait_phase", controller.gait_phase, action=LIVE)
    yield LoggedSignal("controller", "cycle_time", controller.cycle_time, "s", 40)
    yield LoggedSignal("controller", "duty", controller.duty, "-", 40)
    yield LoggedSignal("controller", "forces", controller.forces, "N", 2, kind="array")
    yield LoggedSignal("controller", "solver_iterations", controller.solver_iterations, "count", action=LIVE)
    yield LoggedSignal("controller", "solver_time", controller.solver_time, "us", action=LIVE)
    yield LoggedSignal("controller", "solver_cost", controller.solver_cost, "-", 2)
    yield LoggedSignal("controller", "stability_margin", controller.stability_margin, "m", 2, LIVE)
    yield LoggedSignal("estimator", "position", estimator.position, "m", action=LIVE)
    yield LoggedSignal("estimator", "velocity", estimator.velocity, "m/s", action=LIVE)
    yield LoggedSignal("estimator", "covariance", estimator.covariance, "-", 40)
    yield LoggedSignal("estimator", "innovation", estimator.innovation, "-", 2, kind="array")
    yield LoggedSignal("estimator", "mahalanobis", estimator.mahalanobis, "-", 2)
    yield LoggedSignal("estimator", "slip_detected", estimator.slip_detected, action=LIVE)
    yield LoggedSignal(
        "joints", "position", robot.joints.position, "rad", 1, LIVE, description="all twelve in one element"
    )
    yield LoggedSignal(
        "joints", "velocity", robot.joints.velocity, "rad/s", 1, LIVE, description="all twelve in one element"
    )
    yield LoggedSignal("joints", "torque", robot.joints.torque, "Nm", 1, LIVE, description="all twelve in one element")


def _channels(robot: SimulatedRobot) -> Iterator[LoggedSignal]:
    """Further channels for trying large tables, with settings of every sort."""
    for number in range(robot.channels.size):
        yield LoggedSignal(
            f"diagnostics/unit{number // 50:03}",
            f"channel{number:05}",
            robot.channels[number, ...],
            ("V", "A", "degC", "count")[number % 4],
            (4, 20, 40, 400)[number % 4],
            LIVE if number % 5 == 0 else SAVE,
        )
