"""The variables of the simulated robot, grouped as its software would: what the program logs by reference."""

import enum

import numpy as np

from silo.programs.demo.gait import HEIGHT_M, Gait

GRAVITY_M_S2 = 9.81
GAIN_P_NM_RAD = 2500.0


class ContactState(enum.IntEnum):
    """What a foot does."""

    OPEN = 0
    CLOSED = 1
    SLIPPING = 2


class DriveState(enum.IntEnum):
    """What a motor drive reports."""

    DISABLED = 0
    STANDBY = 1
    OPERATIONAL = 2
    WARM = 3
    ERROR = 4


class BatteryState(enum.IntEnum):
    """What the battery's controller reports."""

    DISCHARGING = 0
    LOW = 1
    CRITICAL = 2


class Base:
    """Pose, twist and acceleration of the body, and what was asked of it."""

    def __init__(self) -> None:
        self.pose = np.array([0.0, 0.0, HEIGHT_M, 0.0, 0.0, 0.0, 1.0])  # position, quaternion x y z w, in the world
        self.twist = np.zeros(6)  # linear and angular, in the base frame
        self.acceleration = np.zeros(3)  # in the world
        self.euler = np.zeros(3)  # roll, pitch, yaw
        self.command = np.zeros(3)  # forward, left, turn
        self.rotation = np.eye(3)
        self.inertia = np.diag([1.1, 2.9, 3.2])
        self.centre_of_mass = np.zeros(3)


class Joints:
    """The twelve drives, leg by leg (LF, RF, LH, RH) and from the hip down; every array has shape (12,)."""

    def __init__(self) -> None:
        self.position = np.zeros(12)
        self.velocity = np.zeros(12)
        self.acceleration = np.zeros(12)
        self.torque = np.zeros(12)
        self.position_command = np.zeros(12)
        self.velocity_command = np.zeros(12)
        self.torque_command = np.zeros(12)
        self.tracking_error = np.zeros(12)
        self.gravity_torque = np.zeros(12)
        self.friction_torque = np.zeros(12)
        self.current = np.zeros(12)
        self.voltage = np.zeros(12)
        self.power = np.zeros(12)
        self.energy = np.zeros(12)
        self.winding_temperature = np.full(12, 31.0)
        self.housing_temperature = np.full(12, 27.0)
        self.encoder_count = np.zeros(12, np.int32)
        self.bus_latency = np.zeros(12, np.float32)
        self.missed_frames = np.zeros(12, np.uint32)
        self.error_flags = np.zeros(12, np.uint16)
        self.drive_state = np.full(12, DriveState.OPERATIONAL, np.uint8)
        self.gain_p = np.full(12, GAIN_P_NM_RAD, np.float32)
        self.gain_d = np.full(12, 12.0, np.float32)
        self.torque_margin = np.zeros(12)
        self.peak_torque = np.zeros(12)
        self.deflection = np.zeros(12)
        self.mechanical_power = np.zeros(12)
        self.position_margin = np.zeros(12)
        self.thermal_load = np.zeros(12)
        self.drive_temperature = np.full(12, 30.0)


class Legs:
    """Feet and contacts; every array has four rows (LF, RF, LH, RH)."""

    def __init__(self) -> None:
        self.phase = np.zeros(4)
        self.contact = np.ones(4, np.bool_)
        self.contact_state = np.full(4, ContactState.CLOSED, np.uint8)
        self.contact_probability = np.ones(4)
        self.contact_force = np.zeros((4, 3))
        self.force_command = np.zeros((4, 3))
        self.force_sensor = np.zeros(4)
        self.foot_position = np.zeros((4, 3))
        self.foot_velocity = np.zeros((4, 3))
        self.foot_target = np.zeros((4, 3))
        self.jacobian = np.zeros((4, 3, 3))
        self.stance_time = np.zeros(4)
        self.swing_time = np.zeros(4)
        self.step_count = np.zeros(4, np.uint32)
        self.slip_distance = np.zeros(4)
        self.friction_margin = np.zeros(4)
        self.impact = np.zeros(4)
        self.ground_height = np.zeros(4)
        self.power = np.zeros(4)
        self.board_temperature = np.full(4, 30.0)
        self.board_voltage = np.full(4, 48.0)
        self.board_current = np.zeros(4)
        self.fan_speed = np.zeros(4, np.uint16)


class Sensors:
    """What the body's sensors report, faults included."""

    def __init__(self) -> None:
        self.acceleration = np.array([0.0, 0.0, GRAVITY_M_S2])
        self.angular_velocity = np.zeros(3)
        self.orientation = np.array([0.0, 0.0, 0.0, 1.0])
        self.magnetic_field = np.zeros(3, np.float32)
        self.imu_temperature = np.array(35.0, np.float32)
        self.gyro_bias = np.array([0.002, -0.001, 0.0015])
        self.sonar_left = np.array(1.5)
        self.sonar_right = np.array(1.5)
        self.pressure = np.array(1013.2)  # sticks after twelve seconds: a sensor fault to find in a plot
        self.humidity = np.array(41.0, np.float32)
        self.ranges = np.full(32, 4.0, np.float32)


class Estimator:
    """The state estimator's view of the base."""

    def __init__(self) -> None:
        self.position = np.zeros(3)
        self.velocity = np.zeros(3)
        self.covariance = np.eye(6) * 1e-4
        self.innovation = np.zeros(12)
        self.mahalanobis = np.array(0.0)
        self.slip_detected = np.array(False)


class Controller:
    """The locomotion controller: gait, state machine, solver."""

    def __init__(self) -> None:
        self.gait = Gait.STAND
        self.state = "standing"
        self.gait_phase = np.array(0.0)
        self.cycle_time = np.array(0.5)
        self.duty = np.array(0.6)  # part of the cycle that a foot is on the ground
        self.solver_iterations = np.array(0, np.int16)
        self.solver_time = np.array(0.0)
        self.solver_cost = np.array(0.0)
        self.stability_margin = np.array(0.0)
        self.forces = np.zeros(12)


class Battery:
    """Twelve cells in series."""

    def __init__(self) -> None:
        self.voltage = np.array(50.0)
        self.current = np.array(0.0)
        self.power = np.array(0.0)
        self.charge = np.array(0.93)
        self.temperature = np.array(26.0)
        self.cells = np.full(12, 4.1, np.float32)
        self.state = BatteryState.DISCHARGING
