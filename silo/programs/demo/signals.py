"""The variables of the simulated robot, and how each is logged: one row per variable, from which its memory is made.

`silo.programs.demo.robot` fills them. Elements refer to that memory (`source` is a view of an array), or to an
attribute where a variable is no number (`attr`).
"""

import enum
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from silo.core.elements import Action, BufferType
from silo.programs.demo.gait import HEIGHT_M, JOINTS, JOINTS_IN_WORDS, LEGS, LEGS_IN_WORDS, Gait

LIVE = Action.SAVE_AND_PUBLISH
SAVE = Action.SAVE
ONLY_LIVE = Action.PUBLISH
NOMINAL_HZ = 400.0
LOOPING, FIXED, GROWING = BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING

GRAVITY_M_S2 = 9.81
GAIN_P_NM_RAD = 2500.0
GAIN_D_NMS_RAD = 12.0


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


class DemoSignal(NamedTuple):
    """One variable. `name` is `part.variable`, or that of a variable of each joint or leg; `element` if that is not it.

    `divider` is for 400 Hz: 4 is 100 Hz, 40 is 10 Hz, which `divider_at` keeps at other frequencies. `start` is the
    first value, of `dtype` if that is given; a text or an enumeration's is no array. `size` None is the logger's
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
    buffer: BufferType = LOOPING
    size: int | None = None
    element: str = ""


class LoggedSignal(NamedTuple):
    """One element: its row, where it stands, and its memory."""

    group: str
    name: str
    source: object
    row: DemoSignal
    attr: str | None = None


class RobotPart:
    """A part of the robot: its variables as attributes, arrays but for texts and enumerations."""

    def __init__(self, rows: Iterable[DemoSignal], count: int | None = None) -> None:
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
    DemoSignal("position", "rad", 1, LIVE, "measured by the encoder"),
    DemoSignal("velocity", "rad/s", 1, LIVE, "difference of the positions"),
    DemoSignal("torque", "Nm", 1, LIVE, "measured at the joint"),
    DemoSignal("current", "A", 1, LIVE, "motor current"),
    DemoSignal("winding_temperature", "degC", 40, LIVE, "motor winding, heats with the current squared", start=31.0),
    DemoSignal("position_command", "rad"),
    DemoSignal("velocity_command", "rad/s"),
    DemoSignal("torque_command", "Nm"),
    DemoSignal("tracking_error", "rad", 1, LIVE, "command minus measured position"),
    DemoSignal("acceleration", "rad/s^2", 2),
    DemoSignal("gravity_torque", "Nm", 2, SAVE, "part of the torque that carries the contact force"),
    DemoSignal("friction_torque", "Nm", 2),
    DemoSignal("torque_margin", "Nm", 4, SAVE, "distance to the torque limit"),
    DemoSignal("voltage", "V", 2, SAVE, "at the motor"),
    DemoSignal("power", "W", 2, SAVE, "electrical power of the motor"),
    DemoSignal("energy", "J", 40, SAVE, "since the program started"),
    DemoSignal("housing_temperature", "degC", 400, LIVE, "motor housing", start=27.0),
    DemoSignal("encoder_count", "count", 1, SAVE, "65536 counts per turn", dtype="i4"),
    DemoSignal("bus_latency", "us", 4, SAVE, "answer time of the drive", dtype="f4"),
    DemoSignal("missed_frames", "count", 40, dtype="u4"),
    DemoSignal("error_flags", "bits", 4, SAVE, "error word of the drive", dtype="u2"),
    DemoSignal("drive_state", "-", 4, LIVE, start=DriveState.OPERATIONAL, dtype="u1", labels=DriveState),
    DemoSignal("peak_torque", "Nm", 40, SAVE, "largest since the program started"),
    DemoSignal("deflection", "rad", 4, SAVE, "of drive and gear under the torque"),
    DemoSignal("mechanical_power", "W", 4, SAVE, "torque times velocity"),
    DemoSignal("position_margin", "rad", 4, SAVE, "distance to the end stop"),
    DemoSignal("thermal_load", "%", 40, LIVE, "of the motor winding, 100 is 110 degC"),
    DemoSignal("drive_temperature", "degC", 400, SAVE, "power electronics", start=30.0),
    DemoSignal("gain_p", "Nm/rad", 400, start=GAIN_P_NM_RAD, dtype="f4", buffer=FIXED, size=10),
    DemoSignal("gain_d", "Nm*s/rad", 400, start=GAIN_D_NMS_RAD, dtype="f4", buffer=FIXED, size=10),
)

# of each of the four legs
_LEG = (
    DemoSignal("contact", "-", 1, LIVE, "whether the foot carries", start=1.0, dtype="?"),
    DemoSignal("contact_force", "N", 1, LIVE, "on the foot, in the world frame", start=np.zeros(3)),
    DemoSignal("contact_state", "-", 1, LIVE, start=ContactState.CLOSED, dtype="u1", labels=ContactState),
    DemoSignal("contact_probability", "-", 2, LIVE, start=1.0),
    DemoSignal("force_sensor", "N", 1, LIVE, "normal force as the foot's sensor reports it, with spikes on LH"),
    DemoSignal("force_command", "N", start=np.zeros(3)),
    DemoSignal("phase", "-", 1, LIVE, "place in the gait cycle, 0 at touchdown"),
    DemoSignal("foot_position", "m", 1, LIVE, "in the base frame", start=np.zeros(3)),
    DemoSignal("foot_velocity", "m/s", 1, SAVE, "in the base frame", start=np.zeros(3)),
    DemoSignal("foot_target", "m", 1, SAVE, "in the base frame", start=np.zeros(3)),
    DemoSignal("jacobian", "m/rad", 4, SAVE, "foot velocity by joint velocity", start=np.zeros((3, 3))),
    DemoSignal("stance_time", "s", 4),
    DemoSignal("swing_time", "s", 4),
    DemoSignal("step_count", "count", 40, LIVE, dtype="u4"),
    DemoSignal("slip_distance", "m", 40),
    DemoSignal("friction_margin", "N", 4, SAVE, "distance to the friction cone"),
    DemoSignal("impact", "N", 1, SAVE, "blow at touchdown"),
    DemoSignal("ground_height", "m", 4, SAVE, "under the foot, in the world, kept while it swings"),
    DemoSignal("power", "W", 40, LIVE, "electrical power of the three drives"),
    DemoSignal("board_temperature", "degC", 400, LIVE, "motor driver board", start=30.0),
    DemoSignal("board_current", "A", 40),
    DemoSignal("fan_speed", "rpm", 400, dtype="u2"),
)

# of the body, its sensors and its mission
_BODY = (
    DemoSignal(
        "base.pose", "m", 1, LIVE, "base in the world", start=[0.0, 0.0, HEIGHT_M, 0.0, 0.0, 0.0, 1.0], kind="pose"
    ),
    DemoSignal("base.twist", "m/s", 1, LIVE, "in the base frame", start=np.zeros(6), kind="twist"),
    DemoSignal("base.acceleration", "m/s^2", 1, LIVE, "in the world", start=np.zeros(3)),
    DemoSignal("base.euler", "rad", 4, LIVE, start=np.zeros(3), kind="components(roll, pitch, yaw)"),
    DemoSignal(
        "base.command",
        "-",
        4,
        LIVE,
        "forward and left in m/s, turn in rad/s",
        start=np.zeros(3),
        kind="components(forward, left, turn)",
    ),
    DemoSignal("base.centre_of_mass", "m", 4, start=np.zeros(3)),
    DemoSignal("base.inertia", "kg m^2", 400, start=np.diag([1.1, 2.9, 3.2]), buffer=FIXED, size=1),
    DemoSignal("controller.gait", "-", 1, LIVE, start=Gait.STAND),
    DemoSignal("controller.state", "-", 4, LIVE, "mission", start="standing"),
    DemoSignal(
        "sensors.acceleration",
        "m/s^2",
        1,
        LIVE,
        "with gravity",
        start=[0.0, 0.0, GRAVITY_M_S2],
        element="imu/acceleration",
    ),
    DemoSignal("sensors.angular_velocity", "rad/s", 1, LIVE, start=np.zeros(3), element="imu/angular_velocity"),
    DemoSignal(
        "sensors.orientation", "-", 1, LIVE, start=[0.0, 0.0, 0.0, 1.0], kind="quaternion", element="imu/orientation"
    ),
    DemoSignal("sensors.magnetic_field", "uT", 4, start=np.zeros(3, np.float32), element="imu/magnetic_field"),
    DemoSignal("sensors.imu_temperature", "degC", 400, LIVE, start=35.0, dtype="f4", element="imu/temperature"),
    DemoSignal("sensors.gyro_bias", "rad/s", 40, start=[0.002, -0.001, 0.0015], element="imu/gyro_bias"),
    DemoSignal("battery.voltage", "V", 40, LIVE, start=50.0),
    DemoSignal("battery.current", "A", 40, LIVE),
    DemoSignal("battery.power", "W", 40, LIVE),
    DemoSignal("battery.charge", "-", 400, LIVE, "0 empty, 1 full", start=0.93, buffer=GROWING, size=600),
    DemoSignal("battery.temperature", "degC", 400, start=26.0, buffer=GROWING, size=600),
    DemoSignal("battery.cells", "V", 400, start=np.full(12, 4.1, np.float32), buffer=GROWING, size=600),
    DemoSignal("battery.state", "-", 400, LIVE, start=BatteryState.DISCHARGING, labels=BatteryState),
    DemoSignal("sensors.sonar_left", "m", 2, LIVE, "loose plug: NaN now and then", start=1.5),
    DemoSignal("sensors.sonar_right", "m", 2, LIVE, start=1.5),
    DemoSignal("sensors.pressure", "mbar", 4, LIVE, "sticks after 12 s", start=1013.2),
    DemoSignal("sensors.humidity", "%", 400, start=41.0, dtype="f4"),
    DemoSignal("sensors.ranges", "m", 20, ONLY_LIVE, "32 beams, too much to keep", start=np.full(32, 4.0, np.float32)),
)

# of the controller and the estimator
_SOFTWARE = (
    DemoSignal("controller.gait_phase", "-", 1, LIVE),
    DemoSignal("controller.cycle_time", "s", 40, start=0.5),
    DemoSignal("controller.duty", "-", 40, start=0.6),
    DemoSignal("controller.forces", "N", 2, start=np.zeros(12), kind="array"),
    DemoSignal("controller.solver_iterations", "count", 1, LIVE, start=0, dtype="i2"),
    DemoSignal("controller.solver_time", "us", 1, LIVE),
    DemoSignal("controller.solver_cost", "-", 2),
    DemoSignal("controller.stability_margin", "m", 2, LIVE),
    DemoSignal("estimator.position", "m", 1, LIVE, start=np.zeros(3)),
    DemoSignal("estimator.velocity", "m/s", 1, LIVE, start=np.zeros(3)),
    DemoSignal("estimator.covariance", "-", 40, start=np.eye(6) * 1e-4),
    DemoSignal("estimator.innovation", "-", 2, start=np.zeros(12), kind="array"),
    DemoSignal("estimator.mahalanobis", "-", 2),
    DemoSignal("estimator.slip_detected", "-", 1, LIVE, start=False),
)

# all twelve in one element
_WHOLE = tuple(
    row._replace(
        name=f"joints.{row.name}",
        description="all twelve in one element",
        kind=f"components({', '.join(f'{leg}_{joint}' for leg in LEGS for joint in JOINTS)})",
    )
    for row in _JOINT
    if row.name in ("position", "velocity", "torque")
)


class Variables:
    """All variables of the robot, as they are at the start; `channels` further ones are for trying large tables."""

    def __init__(self, channels: int = 0) -> None:
        self.joints, self.legs = RobotPart(_JOINT, 12), RobotPart(_LEG, 4)
        self.base, self.sensors, self.battery, self.controller, self.estimator = (
            RobotPart(row for row in (*_BODY, *_SOFTWARE) if row.name.startswith(f"{name}."))
            for name in ("base", "sensors", "battery", "controller", "estimator")
        )
        self.channels = np.zeros(channels)


def signals(robot: Variables) -> list[LoggedSignal]:
    """Return every element of the robot, the most telling ones first; about 500."""
    legs = {f"legs/{leg}": called for leg, called in LEGS_IN_WORDS.items()}
    joints = {
        f"legs/{leg}/{joint}": f"{called} {words}"
        for leg, called in LEGS_IN_WORDS.items()
        for joint, words in JOINTS_IN_WORDS.items()
    }
    return [
        *(_single(robot, row) for row in _BODY),
        *_each(robot.legs, _LEG, legs),
        *_each(robot.joints, _JOINT, joints),
        *(_single(robot, row) for row in (*_SOFTWARE, *_WHOLE)),
        *_channels(robot),
    ]


def _single(robot: Variables, row: DemoSignal) -> LoggedSignal:
    of, _, variable = row.name.partition(".")
    group, _, name = (row.element or f"{of}/{variable}").rpartition("/")
    whole = getattr(robot, of)
    found = getattr(whole, variable)
    is_array = isinstance(found, np.ndarray)
    return LoggedSignal(group, name, found if is_array else whole, row, None if is_array else variable)


def _each(of: RobotPart, rows: Sequence[DemoSignal], groups: Mapping[str, str]) -> Iterator[LoggedSignal]:
    """Elements of each group, which say of what they are: nobody has to know what its letters stand for."""
    for place, (group, of_what) in enumerate(groups.items()):
        for row in rows:
            told = row._replace(description=": ".join(filter(None, [of_what, row.description])))
            yield LoggedSignal(group, row.name, getattr(of, row.name)[place, ...], told)


def divider_at(divider: int, frequency_hz: float) -> int:
    """The divider that gives the same rate as at 400 Hz, or each tick where that is faster than the loop."""
    return max(1, round(divider * frequency_hz / NOMINAL_HZ))


def _channels(robot: Variables) -> Iterator[LoggedSignal]:
    """Further channels for trying large tables, with settings of every sort."""
    for number in range(robot.channels.size):
        kind = number % 4
        row = DemoSignal("", ("V", "A", "degC", "count")[kind], (4, 20, 40, 400)[kind], SAVE if number % 5 else LIVE)
        group, name = f"diagnostics/unit{number // 50:03}", f"channel{number:05}"
        yield LoggedSignal(group, name, robot.channels[number, ...], row)
