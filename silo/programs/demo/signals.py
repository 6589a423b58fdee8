"""The variables of the simulated robot, and how each is logged: one row per variable, from which its memory is made.

`silo.programs.demo.robot` fills them. Elements refer to that memory (`source` is a view of an array), or to an
attribute where a variable is no number (`attr`).
"""

import enum
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from silo.core.elements import Action, BufferType
from silo.programs.demo.gait import HEIGHT_M, JOINTS, LEGS, Gait

LIVE = Action.SAVE_AND_PUBLISH
SAVE = Action.SAVE
ONLY_LIVE = Action.PUBLISH
NOMINAL_HZ = 400.0
LOOPING, FIXED, GROWING = BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING

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


class Row(NamedTuple):
    """One variable. `name` is `part.variable`, or that of a variable of each joint or leg; `element` if that is not it.

    `divider` is for 400 Hz: 4 is 100 Hz, 40 is 10 Hz, which `divider_at` keeps at other frequencies. `start` is the
    first value, of `dtype` if that is given; a text or an enumeration's is no array. `buffer_size` None is the logger's
    default.
    """

    name: str
    unit: str = "-"
    divider: int = 1
    action: Action = SAVE
    description: str = ""
    start: Any = 0.0
    dtype: str | None = None
    kind: str = ""
    labels: type[enum.Enum] | None = None
    buffer_type: BufferType = LOOPING
    buffer_size: int | None = None
    element: str = ""


class LoggedSignal(NamedTuple):
    """One element: its row, where it stands, and its memory."""

    group: str
    name: str
    source: object
    row: Row
    attr: str | None = None


class Part:
    """A part of the robot: its variables as attributes, arrays but for texts and enumerations."""

    def __init__(self, rows: Iterable[Row], count: int | None = None) -> None:
        """Make them; of joints and legs `count` of each, one behind the other."""
        for row in rows:
            name = row.name.rpartition(".")[2]
            if row.dtype is None and isinstance(row.start, str | enum.Enum):
                setattr(self, name, row.start)
                continue
            start = np.array(row.start, row.dtype)
            setattr(self, name, start if count is None else np.full((count, *start.shape), start, start.dtype))

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...
        def __setattr__(self, name: str, value: Any) -> None: ...


# of each of the twelve drives, leg by leg (LF, RF, LH, RH) and from the hip down
_JOINT = (
    Row("position", "rad", 1, LIVE, "measured by the encoder"),
    Row("velocity", "rad/s", 1, LIVE, "difference of the positions"),
    Row("torque", "Nm", 1, LIVE, "measured at the joint"),
    Row("current", "A", 1, LIVE, "motor current"),
    Row("winding_temperature", "degC", 40, LIVE, "heats with the square of the current", start=31.0),
    Row("position_command", "rad"),
    Row("velocity_command", "rad/s"),
    Row("torque_command", "Nm"),
    Row("tracking_error", "rad", 1, LIVE, "command minus measured position"),
    Row("acceleration", "rad/s^2", 2),
    Row("gravity_torque", "Nm", 2, SAVE, "part of the torque that carries the contact force"),
    Row("friction_torque", "Nm", 2),
    Row("torque_margin", "Nm", 4, SAVE, "distance to the torque limit"),
    Row("voltage", "V", 2, SAVE, "at the motor"),
    Row("power", "W", 2, SAVE, "electrical power of the motor"),
    Row("energy", "J", 40, SAVE, "since the program started"),
    Row("housing_temperature", "degC", 400, LIVE, start=27.0),
    Row("encoder_count", "count", 1, SAVE, "65536 counts per turn", dtype="i4"),
    Row("bus_latency", "us", 4, SAVE, "answer time of the drive", dtype="f4"),
    Row("missed_frames", "count", 40, dtype="u4"),
    Row("error_flags", "bits", 4, SAVE, "error word of the drive", dtype="u2"),
    Row("drive_state", "-", 4, LIVE, start=DriveState.OPERATIONAL, dtype="u1", labels=DriveState),
    Row("peak_torque", "Nm", 40, SAVE, "largest since the program started"),
    Row("deflection", "rad", 4, SAVE, "of drive and gear under the torque"),
    Row("mechanical_power", "W", 4, SAVE, "torque times velocity"),
    Row("position_margin", "rad", 4, SAVE, "distance to the end stop"),
    Row("thermal_load", "%", 40, LIVE, "of the winding, 100 is 110 degC"),
    Row("drive_temperature", "degC", 400, SAVE, "power electronics", start=30.0),
    Row("gain_p", "Nm/rad", 400, start=GAIN_P_NM_RAD, dtype="f4", buffer_type=FIXED, buffer_size=10),
    Row("gain_d", "Nm*s/rad", 400, start=12.0, dtype="f4", buffer_type=FIXED, buffer_size=10),
)

# of each of the four legs
_LEG = (
    Row("contact", "-", 1, LIVE, "whether the foot carries", start=1.0, dtype="?"),
    Row("contact_force", "N", 1, LIVE, "on the foot, in the world frame", start=np.zeros(3)),
    Row("contact_state", "-", 1, LIVE, start=ContactState.CLOSED, dtype="u1", labels=ContactState),
    Row("contact_probability", "-", 2, LIVE, start=1.0),
    Row("force_sensor", "N", 1, LIVE, "normal force as the foot's sensor reports it, with spikes on LH"),
    Row("force_command", "N", start=np.zeros(3)),
    Row("phase", "-", 1, LIVE, "place in the gait cycle, 0 at touchdown"),
    Row("foot_position", "m", 1, LIVE, "in the base frame", start=np.zeros(3)),
    Row("foot_velocity", "m/s", 1, SAVE, "in the base frame", start=np.zeros(3)),
    Row("foot_target", "m", 1, SAVE, "in the base frame", start=np.zeros(3)),
    Row("jacobian", "m/rad", 4, SAVE, "foot velocity by joint velocity", start=np.zeros((3, 3))),
    Row("stance_time", "s", 4),
    Row("swing_time", "s", 4),
    Row("step_count", "count", 40, LIVE, dtype="u4"),
    Row("slip_distance", "m", 40),
    Row("friction_margin", "N", 4, SAVE, "distance to the friction cone"),
    Row("impact", "N", 1, SAVE, "blow at touchdown"),
    Row("ground_height", "m", 4, SAVE, "under the foot, in the world, kept while it swings"),
    Row("power", "W", 40, LIVE, "electrical power of the three drives"),
    Row("board_temperature", "degC", 400, LIVE, "motor driver board", start=30.0),
    Row("board_voltage", "V", 40, start=48.0),
    Row("board_current", "A", 40),
    Row("fan_speed", "rpm", 400, dtype="u2"),
)

# of the body, its sensors and its mission
_BODY = (
    Row(
        "base.pose",
        "m",
        1,
        LIVE,
        "base in the world",
        start=[0.0, 0.0, HEIGHT_M, 0.0, 0.0, 0.0, 1.0],
        kind="pose",
    ),
    Row("base.twist", "m/s", 1, LIVE, "in the base frame", start=np.zeros(6), kind="twist"),
    Row("base.acceleration", "m/s^2", 1, LIVE, "in the world", start=np.zeros(3)),
    Row("base.euler", "rad", 4, LIVE, "roll, pitch, yaw", start=np.zeros(3), kind="array"),
    Row("base.command", "m/s", 4, LIVE, "forward, left, turn", start=np.zeros(3), kind="array"),
    Row("base.centre_of_mass", "m", 4, start=np.zeros(3)),
    Row("base.inertia", "kg m^2", 400, start=np.diag([1.1, 2.9, 3.2]), buffer_type=FIXED, buffer_size=1),
    Row("controller.gait", "-", 1, LIVE, start=Gait.STAND),
    Row("controller.state", "-", 4, LIVE, "mission", start="standing"),
    Row(
        "sensors.acceleration",
        "m/s^2",
        1,
        LIVE,
        "with gravity",
        start=[0.0, 0.0, GRAVITY_M_S2],
        element="imu/acceleration",
    ),
    Row("sensors.angular_velocity", "rad/s", 1, LIVE, start=np.zeros(3), element="imu/angular_velocity"),
    Row(
        "sensors.orientation",
        "-",
        1,
        LIVE,
        start=[0.0, 0.0, 0.0, 1.0],
        kind="quaternion",
        element="imu/orientation",
    ),
    Row("sensors.magnetic_field", "uT", 4, start=np.zeros(3, np.float32), element="imu/magnetic_field"),
    Row("sensors.imu_temperature", "degC", 400, LIVE, start=35.0, dtype="f4", element="imu/temperature"),
    Row("sensors.gyro_bias", "rad/s", 40, start=[0.002, -0.001, 0.0015], element="imu/gyro_bias"),
    Row("battery.voltage", "V", 40, LIVE, start=50.0),
    Row("battery.current", "A", 40, LIVE),
    Row("battery.power", "W", 40, LIVE),
    Row("battery.charge", "-", 400, LIVE, "0 empty, 1 full", start=0.93, buffer_type=GROWING, buffer_size=600),
    Row("battery.temperature", "degC", 400, start=26.0, buffer_type=GROWING, buffer_size=600),
    Row("battery.cells", "V", 400, start=np.full(12, 4.1, np.float32), buffer_type=GROWING, buffer_size=600),
    Row("battery.state", "-", 400, LIVE, start=BatteryState.DISCHARGING, labels=BatteryState),
    Row("sensors.sonar_left", "m", 2, LIVE, "loose plug: NaN now and then", start=1.5),
    Row("sensors.sonar_right", "m", 2, LIVE, start=1.5),
    Row("sensors.pressure", "mbar", 4, LIVE, "sticks after 12 s", start=1013.2),
    Row("sensors.humidity", "%", 400, start=41.0, dtype="f4"),
    Row("sensors.ranges", "m", 20, ONLY_LIVE, "32 beams, too much to keep", start=np.full(32, 4.0, np.float32)),
)

# of the controller and the estimator
_SOFTWARE = (
    Row("controller.gait_phase", "-", 1, LIVE),
    Row("controller.cycle_time", "s", 40, start=0.5),
    Row("controller.duty", "-", 40, start=0.6),
    Row("controller.forces", "N", 2, start=np.zeros(12), kind="array"),
    Row("controller.solver_iterations", "count", 1, LIVE, start=0, dtype="i2"),
    Row("controller.solver_time", "us", 1, LIVE),
    Row("controller.solver_cost", "-", 2),
    Row("controller.stability_margin", "m", 2, LIVE),
    Row("estimator.position", "m", 1, LIVE, start=np.zeros(3)),
    Row("estimator.velocity", "m/s", 1, LIVE, start=np.zeros(3)),
    Row("estimator.covariance", "-", 40, start=np.eye(6) * 1e-4),
    Row("estimator.innovation", "-", 2, start=np.zeros(12), kind="array"),
    Row("estimator.mahalanobis", "-", 2),
    Row("estimator.slip_detected", "-", 1, LIVE, start=False),
)

# all twelve in one element
_WHOLE = tuple(
    row._replace(name=f"joints.{row.name}", description="all twelve in one element")
    for row in _JOINT
    if row.name in ("position", "velocity", "torque")
)


class Variables:
    """All variables of the robot, as they are at the start; `channels` further ones are for trying large tables."""

    def __init__(self, channels: int = 0) -> None:
        self.joints, self.legs = Part(_JOINT, 12), Part(_LEG, 4)
        self.base, self.sensors, self.battery, self.controller, self.estimator = (
            Part(row for row in (*_BODY, *_SOFTWARE) if row.name.startswith(f"{name}."))
            for name in ("base", "sensors", "battery", "controller", "estimator")
        )
        self.channels = np.zeros(channels)


def signals(robot: Variables) -> list[LoggedSignal]:
    """Return every element of the robot, the most telling ones first; about 500."""
    legs = (f"legs/{leg}" for leg in LEGS)
    joints = (f"legs/{leg}/{joint}" for leg in LEGS for joint in JOINTS)
    return [
        *(_single(robot, row) for row in _BODY),
        *_each(robot.legs, _LEG, legs),
        *_each(robot.joints, _JOINT, joints),
        *(_single(robot, row) for row in (*_SOFTWARE, *_WHOLE)),
        *_channels(robot),
    ]


def _single(robot: Variables, row: Row) -> LoggedSignal:
    of, _, variable = row.name.partition(".")
    group, _, name = (row.element or f"{of}/{variable}").rpartition("/")
    whole = getattr(robot, of)
    found = getattr(whole, variable)
    is_array = isinstance(found, np.ndarray)
    return LoggedSignal(group, name, found if is_array else whole, row, None if is_array else variable)


def _each(of: Part, rows: Iterable[Row], groups: Iterable[str]) -> Iterator[LoggedSignal]:
    listed = list(rows)
    for place, group in enumerate(groups):
        for row in listed:
            yield LoggedSignal(group, row.name, getattr(of, row.name)[place, ...], row)


def divider_at(divider: int, frequency_hz: float) -> int:
    """The divider that gives the same rate as at 400 Hz, or each tick where that is faster than the loop."""
    return max(1, round(divider * frequency_hz / NOMINAL_HZ))


def _channels(robot: Variables) -> Iterator[LoggedSignal]:
    """Further channels for trying large tables, with settings of every sort."""
    for number in range(robot.channels.size):
        kind = number % 4
        row = Row("", ("V", "A", "degC", "count")[kind], (4, 20, 40, 400)[kind], SAVE if number % 5 else LIVE)
        group, name = f"diagnostics/unit{number // 50:03}", f"channel{number:05}"
        yield LoggedSignal(group, name, robot.channels[number, ...], row)
