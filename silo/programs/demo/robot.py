"""The simulated robot: a quadruped of 50 kg with twelve drives, stepped with NumPy, one step per control tick.

The base follows a gait; legs, forces, torques, currents, heat and battery follow from it, so that signals fit together:
the IMU is the second derivative of the pose plus noise, torques carry the contact forces, windings heat with the
square of the current. Sensors have the faults of real ones. Variables keep their memory: a logger refers to them.
"""

import math
from typing import NamedTuple, SupportsFloat

import numpy as np

from silo.programs.demo.gait import (
    FEET_M,
    HEIGHT_M,
    STEP_HEIGHT_M,
    TIMINGS,
    Floats,
    Gait,
    Phase,
    foot_paths,
    leg_angles,
    leg_positions,
    phase_at,
)
from silo.programs.demo.signals import (
    GAIN_D_NMS_RAD,
    GAIN_P_NM_RAD,
    GRAVITY_M_S2,
    BatteryState,
    ContactState,
    DriveState,
    Variables,
)

MASS_KG = 50.0
TORQUE_LIMIT_NM = 80.0
ROTOR_KG_M2 = 0.05  # of each drive through its gear: higher steps take more torque
TORQUE_CONSTANT_NM_A = 3.2  # at the joint, through the gear
RESISTANCE_OHM = 0.15
AMBIENT_C = 22.0
BATTERY_WH = 900.0
STUCK_AFTER_S = 12.0
FALLS_S = (6.0, 20.0)  # so long it walks between two slips that nearly make it fall
PUSH_S = 0.08
SLOW_TICKS = 20  # what changes slowly is computed every so many ticks

_NOISE_ROWS = 4096
_LEVERS_M = np.stack([-FEET_M[:, 1], FEET_M[:, 0]], axis=1)  # a turn of 1 rad/s moves each foot so
_MAGNETIC_UT = np.array([21.0, 0.0, -43.0])
_GRAVITY = np.array([0.0, 0.0, GRAVITY_M_S2])
_REACH_RAD = np.tile([0.7, 1.6, 2.6], 4)
_ODOMETRY = np.array([1.004, 1.004, 1.0])  # legs slip a little, so that the estimate drifts with the distance
_BEAMS_RAD = np.linspace(-np.pi, np.pi, 32, endpoint=False)


class Tuning(NamedTuple):
    """What is tuned while it walks: numbers, or parameters of a logger."""

    body_height: SupportsFloat = HEIGHT_M
    step_height: SupportsFloat = STEP_HEIGHT_M
    kp: SupportsFloat = GAIN_P_NM_RAD
    kd: SupportsFloat = GAIN_D_NMS_RAD


class SimulatedRobot(Variables):
    """The whole robot. `step()` moves it on by one tick of `1 / frequency_hz` seconds.

    The same seed gives the same motion and the same faults. `channels` further diagnostic values serve to try large
    tables: sine waves of many frequencies.
    """

    def __init__(self, frequency_hz: float = 400.0, seed: int = 0, channels: int = 0) -> None:
        random = np.random.default_rng(seed)
        self.dt = 1.0 / frequency_hz
        self.ticks = 0
        super().__init__(channels)
        self.base.rotation = np.eye(3)  # which nobody logs
        self.tuning = Tuning()
        self._height, self._height_rate = HEIGHT_M, 0.0
        self._channel_rates = 2 * np.pi * random.uniform(0.05, 5.0, channels)
        self._noise = random.standard_normal((_NOISE_ROWS, 96))  # drawn once: 1 us per tick instead of 10
        self._chance = random.random((_NOISE_ROWS, 8))
        self._cell_offsets = random.normal(0.0, 0.008, 12)
        self._velocity = np.zeros(3)  # forward, left, turn: what the body does of its command
        self._world_velocity = np.zeros(3)
        self._offsets = np.array(TIMINGS[Gait.STAND].offsets)
        self._moving = 0.0  # 0 standing, 1 in full motion
        self._phase = 0.0
        self._sway = 0.0
        self._x = self._y = self._yaw = 0.0
        self._slip_until = self._flaky_until = self._error_until = 0
        self._fate = np.random.default_rng([seed, 1])  # of its own: the noise stays the same
        self._falls_at = self._fate.uniform(*FALLS_S) * frequency_hz  # ticks
        self._push_until, self._push_rad_s2 = 0, 0.0
        self._tilt = self._tilt_rate = 0.0  # about the way it walks, beside the gait
        self._plan_feet()
        self.joints.position_command[:] = leg_angles(self.legs.foot_target).ravel()
        self.joints.position[:] = self.joints.position_command
        self.legs.foot_position[:] = self.legs.foot_target

    @property
    def time_s(self) -> float:
        """Simulated time since the robot was made."""
        return self.ticks * self.dt

    def step(self) -> None:
        """One tick."""
        self.ticks += 1
        noise = self._noise[(self.ticks * 17) % _NOISE_ROWS]
        chance = self._chance[(self.ticks * 13 + self.ticks // _NOISE_ROWS) % _NOISE_ROWS].tolist()
        phase = phase_at(self.time_s)
        self._follow(phase)
        self._move_base()
        self._plan_feet()
        self._carry(noise, chance)
        self._drive(noise, chance)
        self._sense(noise, chance)
        self._think(phase, noise, chance)
        if self.ticks % SLOW_TICKS == 0:
            self.joints.gain_p[:], self.joints.gain_d[:] = float(self.tuning.kp), float(self.tuning.kd)
            self._warm(SLOW_TICKS * self.dt)
            self._drain(SLOW_TICKS * self.dt, noise)
        if self.channels.size:
            np.sin(self._channel_rates * self.time_s, out=self.channels)

    # -------------------------------------------------------------------------------------------------- base and feet

    def _follow(self, phase: Phase) -> None:
        """The body and the gait follow their command with a time constant of 0.3 s."""
        share = self.dt / 0.3
        timing = TIMINGS[phase.gait]
        controller = self.controller
        self.base.command[:] = phase.forward_m_s, phase.left_m_s, phase.turn_rad_s
        self._velocity += share * (self.base.command - self._velocity)
        self._moving += share * ((phase.gait is not Gait.STAND) - self._moving)
        self._offsets += share * ((np.array(timing.offsets) - self._offsets + 0.5) % 1.0 - 0.5)
        controller.cycle_time += share * (timing.cycle_s - controller.cycle_time)
        controller.duty += share * (timing.duty - controller.duty)
        self._phase = (self._phase + self._moving * self.dt / float(controller.cycle_time)) % 1.0

    def _move_base(self) -> None:
        """Pose by the gait; twist and acceleration are its differences, so that the signals agree with each other."""
        base, dt, moving = self.base, self.dt, self._moving
        forward, left, turn = self._velocity.tolist()
        self._yaw += turn * dt
        sine, cosine = math.sin(self._yaw), math.cos(self._yaw)
        self._x += dt * (forward * cosine - left * sine)
        self._y += dt * (forward * sine + left * cosine)
        angle = 2 * math.pi * self._phase
        self._sway = 0.006 * moving * math.sin(angle)
        # it takes half a second to stand up: 9 cm at once are 6 m/s^2
        self._height_rate += dt * (64.0 * (float(self.tuning.body_height) - self._height) - 16.0 * self._height_rate)
        self._height += dt * self._height_rate
        height = self._height - 0.006 * moving * (1 - math.cos(2 * angle))
        position = np.array([self._x - self._sway * sine, self._y + self._sway * cosine, height])
        push = self._push_rad_s2 if self.ticks < self._push_until else 0.0
        self._tilt_rate += dt * (push - 80.0 * self._tilt - 8.0 * self._tilt_rate)
        self._tilt += dt * self._tilt_rate
        roll = 0.025 * moving * math.sin(angle + 0.6) + self._tilt
        pitch = 0.015 * moving * math.sin(2 * angle) - 0.02 * forward
        rates = ((np.array([roll, pitch, self._yaw]) - base.euler) / dt).tolist()

        velocity = (position - base.pose[:3]) / dt
        base.acceleration[:] = (velocity - self._world_velocity) / dt
        self._world_velocity = velocity
        base.euler[:] = roll, pitch, self._yaw
        base.rotation[:] = rotation(roll, pitch, self._yaw)
        base.pose[:3] = position
        base.pose[3:] = quaternion(roll, pitch, self._yaw)
        base.twist[:3] = velocity @ base.rotation
        base.twist[3:] = body_rates(roll, pitch, rates)
        base.centre_of_mass[:] = 0.01 * math.sin(angle), -0.4 * self._sway, 0.03

    def _plan_feet(self) -> None:
        legs, controller = self.legs, self.controller
        np.mod(self._phase + self._offsets, 1.0, out=legs.phase)
        forward, left, turn = self._velocity.tolist()
        seconds = float(controller.duty) * float(controller.cycle_time) * self._moving
        stride = (np.array([forward, left]) + turn * _LEVERS_M) * seconds
        feet = foot_paths(legs.phase, float(controller.duty), stride, float(self.tuning.step_height) * self._moving)
        feet[:, 1] -= self._sway
        feet[:, 2] += HEIGHT_M - float(self.base.pose[2])
        roll, pitch, _ = self.base.euler.tolist()
        legs.foot_target[:] = feet @ rotation(roll, pitch, 0.0)

    # -------------------------------------------------------------------------------------------------- legs and joints

    def _carry(self, noise: Floats, chance: list[float]) -> None:
        """The feet on the ground carry weight and acceleration, and take a blow when they touch down."""
        legs, dt = self.legs, self.dt
        duty = float(self.controller.duty)
        stepping = min(1.0, self._moving / 0.1)
        load = 1.0 + stepping * (np.clip(np.minimum(legs.phase, duty - legs.phase) / 0.08, 0.0, 1.0) - 1.0)
        contact = load > 0.0
        legs.step_count += contact & ~legs.contact
        legs.contact[:] = contact
        legs.stance_time[:] = np.where(contact, legs.stance_time + dt, 0.0)
        legs.swing_time[:] = np.where(contact, 0.0, legs.swing_time + dt)

        wanted = MASS_KG * (self.base.acceleration + _GRAVITY)
        legs.force_command[:] = np.outer(load / max(float(load.sum()), 0.2), wanted)
        legs.contact_force[:] = legs.force_command
        since_touchdown = legs.phase * float(self.controller.cycle_time)
        stiffness = math.sqrt(float(self.tuning.kp) / GAIN_P_NM_RAD)  # stiff legs come down hard
        legs.impact[:] = contact * (70.0 * self._moving * stiffness) * np.exp(-since_touchdown / 0.012)
        legs.contact_force[:, 2] += legs.impact
        legs.force_sensor[:] = legs.contact_force[:, 2] + 2.5 * noise[:4]
        if chance[0] < 0.0015:
            legs.force_sensor[2] += 1800.0  # a broken shield on the left hind foot: spikes of one sample
        legs.contact_probability[:] = np.clip(load * 1.6 + 0.02 * noise[4:8], 0.0, 1.0)

        if chance[1] < 0.0008 * self._moving:
            self._slip_until = self.ticks + 16
        early = contact & (legs.phase < 0.3)
        if self.ticks >= self._falls_at and self._moving > 0.9 and early.any():
            self._nearly_fall()
        slipping = contact & (self.ticks < self._slip_until) & (legs.phase < 0.3)
        legs.slip_distance += slipping * (0.25 * dt)
        legs.contact_state[:] = np.where(slipping, ContactState.SLIPPING, contact)
        sideways = np.hypot(legs.contact_force[:, 0], legs.contact_force[:, 1])
        legs.friction_margin[:] = np.where(contact, 0.6 * legs.contact_force[:, 2] - sideways, 0.0)
        self.estimator.slip_detected[()] = slipping.any()

    def _nearly_fall(self) -> None:
        """A foot loses its hold: the body tilts by some 0.2 rad and is caught again within a second."""
        self._slip_until = self._push_until = self.ticks + max(1, round(PUSH_S / self.dt))
        self._push_rad_s2 = float(self._fate.choice([-1.0, 1.0]) * self._fate.uniform(40.0, 60.0))
        self._falls_at = self.ticks + self._fate.uniform(*FALLS_S) / self.dt

    def _drive(self, noise: Floats, chance: list[float]) -> None:
        """Angles from the feet, torques from the forces, currents from the torques."""
        joints, legs, dt = self.joints, self.legs, self.dt
        command = leg_angles(legs.foot_target).ravel()
        velocity_command = (command - joints.position_command) / dt
        swung = ROTOR_KG_M2 * (velocity_command - joints.velocity_command) / dt
        joints.velocity_command[:] = velocity_command
        joints.position_command[:] = command

        position = command - joints.deflection + 2e-5 * noise[8:20]
        velocity = (position - joints.position) / dt
        joints.acceleration[:] = (velocity - joints.velocity) / dt
        joints.velocity[:] = velocity
        joints.position[:] = position
        feet, legs.jacobian[:] = leg_positions(position.reshape(4, 3))
        legs.foot_velocity[:] = (feet - legs.foot_position) / dt
        legs.foot_position[:] = feet
        world = feet @ self.base.rotation.T
        legs.ground_height[:] = np.where(legs.contact, world[:, 2] + self.base.pose[2], legs.ground_height)

        forces = legs.contact_force @ self.base.rotation
        joints.gravity_torque[:] = -np.matmul(forces[:, None, :], legs.jacobian).ravel()
        joints.friction_torque[:] = 0.5 * np.tanh(20.0 * joints.velocity_command) + 0.12 * joints.velocity_command
        joints.torque_command[:] = joints.gravity_torque + joints.friction_torque + swung
        joints.torque[:] = joints.torque_command + 0.15 * noise[20:32]
        # drive and gear give way, with the gains of the start in 10 ms
        kp, kd = float(self.tuning.kp), float(self.tuning.kd)
        settled_s = 0.01 * (kd / GAIN_D_NMS_RAD) * (GAIN_P_NM_RAD / kp)
        joints.deflection += min(1.0, dt / settled_s) * (joints.torque / kp - joints.deflection)
        np.subtract(joints.position_command, joints.position, out=joints.tracking_error)
        strength = np.abs(joints.torque)
        np.subtract(TORQUE_LIMIT_NM, strength, out=joints.torque_margin)
        np.maximum(joints.peak_torque, strength, out=joints.peak_torque)
        np.subtract(_REACH_RAD, np.abs(joints.position), out=joints.position_margin)
        np.multiply(joints.torque, joints.velocity, out=joints.mechanical_power)

        joints.current[:] = joints.torque / TORQUE_CONSTANT_NM_A + 0.04 * noise[32:44]
        joints.voltage[:] = RESISTANCE_OHM * joints.current + TORQUE_CONSTANT_NM_A * joints.velocity
        np.multiply(joints.voltage, joints.current, out=joints.power)
        joints.energy += joints.power * dt
        joints.encoder_count[:] = joints.position * (65536 / (2 * math.pi))
        joints.bus_latency[:] = 240.0 + 9.0 * noise[44:56] ** 2
        joints.missed_frames[int(chance[2] * 12)] += chance[3] < 0.004
        if chance[4] < 0.0004:
            self._error_until = self.ticks + 40
        joints.error_flags[7] = 0x10 if self.ticks < self._error_until else 0

    def _warm(self, seconds: float) -> None:
        """Windings heat with the square of the current, give it to the housing, and that to the air."""
        joints, legs = self.joints, self.legs
        loss = RESISTANCE_OHM * joints.current**2
        inwards = (joints.winding_temperature - joints.housing_temperature) / 1.6
        outwards = (joints.housing_temperature - AMBIENT_C) / 1.1
        joints.winding_temperature += seconds / 12.0 * (loss - inwards)
        joints.housing_temperature += seconds / 180.0 * (inwards - outwards)
        joints.thermal_load[:] = 100.0 * (joints.winding_temperature - AMBIENT_C) / (110.0 - AMBIENT_C)
        joints.drive_temperature += seconds / 40.0 * (30.0 + 0.4 * loss - joints.drive_temperature)
        warm = np.where(joints.winding_temperature > 45.0, DriveState.WARM, DriveState.OPERATIONAL)
        joints.drive_state[:] = np.where(joints.error_flags != 0, DriveState.ERROR, warm)
        legs.power[:] = joints.power.reshape(4, 3).sum(axis=1)
        legs.board_current[:] = 0.4 + np.abs(legs.power) / 48.0
        legs.board_temperature += seconds / 60.0 * (0.02 * np.abs(legs.power) - (legs.board_temperature - 30.0) / 4.0)
        legs.fan_speed[:] = np.clip(80.0 * (legs.board_temperature - 20.0), 0.0, 6000.0)

    # ---------------------------------------------------------------------------------------- sensors and software

    def _sense(self, noise: Floats, chance: list[float]) -> None:
        base, sensors, time_s = self.base, self.sensors, self.time_s
        sensors.acceleration[:] = (base.acceleration + _GRAVITY) @ base.rotation + 0.06 * noise[56:59]
        sensors.angular_velocity[:] = base.twist[3:] + sensors.gyro_bias + 0.003 * noise[59:62]
        sensors.orientation[:] = base.pose[3:]
        sensors.magnetic_field[:] = _MAGNETIC_UT @ base.rotation + 0.2 * noise[62:65]
        if chance[5] < 0.0008:
            self._flaky_until = self.ticks + 20 + int(chance[6] * 300)
        distance = 1.5 + 0.4 * math.sin(0.4 * time_s)
        sensors.sonar_right[()] = distance + 0.01 * noise[65]
        # a loose plug on the left one
        sensors.sonar_left[()] = math.nan if self.ticks < self._flaky_until else 3.0 - distance + 0.01 * noise[66]
        if time_s < STUCK_AFTER_S:
            sensors.pressure[()] = 1013.2 + 0.3 * math.sin(0.9 * time_s) + 0.04 * noise[67]
        if self.ticks % SLOW_TICKS == 0:
            sensors.imu_temperature[()] = 35.0 + 6.0 * (1.0 - math.exp(-time_s / 90.0)) + 0.02 * noise[68]
            sensors.humidity[()] = 41.0 + 2.0 * math.sin(0.02 * time_s)
            sensors.ranges[:] = 4.0 + 1.5 * np.cos(2 * (_BEAMS_RAD + self._yaw)) + 0.02 * noise[:32]

    def _think(self, phase: Phase, noise: Floats, chance: list[float]) -> None:
        estimator, controller, base = self.estimator, self.controller, self.base
        estimator.position[:] = base.pose[:3] * _ODOMETRY
        estimator.velocity[:] = base.twist[:3] + 0.004 * noise[69:72]
        estimator.innovation[:] = 0.01 * noise[72:84]
        estimator.mahalanobis[()] = float(noise[72:84] @ noise[72:84])
        controller.gait = phase.gait
        controller.state = phase.name
        controller.gait_phase[()] = self._phase
        controller.forces[:] = self.legs.force_command.ravel()
        slow_solve = chance[7] < 0.003
        controller.solver_iterations[()] = 28 if slow_solve else 5 + int(3 * abs(noise[84]))
        controller.solver_time[()] = (900.0 if slow_solve else 210.0) + 12.0 * noise[85]
        controller.solver_cost[()] = 0.8 + 0.5 * self._moving + 0.05 * abs(noise[86])
        controller.stability_margin[()] = 0.14 - 0.09 * self._moving * abs(math.sin(2 * math.pi * self._phase))

    def _drain(self, seconds: float, noise: Floats) -> None:
        battery, estimator = self.battery, self.estimator
        power = 65.0 + float(np.maximum(self.legs.power, 0.0).sum())
        battery.power[()] = power
        battery.current[()] = power / float(battery.voltage)
        battery.charge -= power * seconds / 3600.0 / BATTERY_WH
        battery.voltage[()] = 42.0 + 8.4 * float(battery.charge) - 0.05 * float(battery.current) + 0.01 * noise[87]
        battery.cells[:] = float(battery.voltage) / 12.0 + self._cell_offsets
        battery.temperature += seconds / 300.0 * (0.02 * power - (battery.temperature - 24.0))
        charge = float(battery.charge)
        if charge < 0.2:
            battery.state = BatteryState.LOW if charge > 0.05 else BatteryState.CRITICAL
        estimator.covariance[0, 0] += 1e-7 * seconds
        estimator.covariance[1, 1] += 1e-7 * seconds
        estimator.covariance[0, 1] = estimator.covariance[1, 0] = 2e-8 * math.sin(self._yaw)


# ------------------------------------------------------------------------------------------------------------ rotations


def rotation(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation matrix (3, 3) from the body to the world: yaw, then pitch, then roll."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the same rotation as x, y, z, w."""
    sr, cr, sp, cp = math.sin(roll / 2), math.cos(roll / 2), math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def body_rates(roll: float, pitch: float, rates: list[float]) -> tuple[float, float, float]:
    """Return the angular velocity in the body frame from the rates of roll, pitch and yaw."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    roll_rate, pitch_rate, yaw_rate = rates
    return (
        roll_rate - yaw_rate * sp,
        pitch_rate * cr + yaw_rate * sr * cp,
        -pitch_rate * sr + yaw_rate * cr * cp,
    )
