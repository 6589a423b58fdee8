"""Joints, actuators and sensors of a MuJoCo model, by the names and units that the model gives them.

Layout of `qpos`, `qvel`, `sensordata` and the meaning of sensors: MuJoCo's documentation, "Computation" and "XML
reference" (https://mujoco.readthedocs.io). Quaternions stand there as w, x, y, z; a free joint's angular velocity is in
the frame of its body, its linear velocity in that of the world.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from silo.core.arguments import shown
from silo.core.calls import told
from silo.errors import SourceError
from silo.loop.sources import Variable, VariableSet

QUATERNION = "quaternion_wxyz"
# of a sensor, by the end of its type's name: unit and kind; those that are missing have no unit of their own
SENSORS = {
    "ACCELEROMETER": "m/s^2",
    "BALLANGVEL": "rad/s",
    "CLOCK": "s",
    "E_KINETIC": "J",
    "E_POTENTIAL": "J",
    "FORCE": "N",
    "FRAMEANGACC": "rad/s^2",
    "FRAMEANGVEL": "rad/s",
    "FRAMELINACC": "m/s^2",
    "FRAMELINVEL": "m/s",
    "FRAMEPOS": "m",
    "GEOMDIST": "m",
    "GEOMFROMTO": "m",
    "GYRO": "rad/s",
    "MAGNETOMETER": "T",
    "RANGEFINDER": "m",
    "SUBTREEANGMOM": "kg m^2/s",
    "SUBTREECOM": "m",
    "SUBTREELINVEL": "m/s",
    "TENDONPOS": "m",
    "TENDONVEL": "m/s",
    "TORQUE": "Nm",
    "TOUCH": "N",
    "VELOCIMETER": "m/s",
}
OF_JOINTS = {"JOINTPOS": 0, "JOINTVEL": 1, "JOINTACTFRC": 2, "JOINTLIMITPOS": 0, "JOINTLIMITVEL": 1, "JOINTLIMITFRC": 2}
TURNS, SLIDES = ("rad", "rad/s", "Nm"), ("m", "m/s", "N")  # position, velocity, force of a joint


@told("silo.mujoco")
def mujoco(model: Any, data: Any) -> VariableSet:
    """Tell `log.add` what a MuJoCo model calls its joints, actuators and sensors, and what their units are.

    The arrays of `data` are logged by reference, nothing is copied by hand: `joints/<name>/position`, `velocity`,
    `torque` (of the actuators; `force` of a slide), `orientation` and `angular_velocity` of ball and free joints;
    `actuators/<name>/control` and `force`; `sensors/<name>`. What has no name in the model is called by its number.

    >>> log.add(silo.mujoco(model, data), group="sim", divider=2)  # doctest: +SKIP

    Args:
        model: a `mujoco.MjModel`.
        data: its `mujoco.MjData`. `mj_resetData` keeps its arrays; a new one needs a new logger.

    Returns:
        What `log.add` takes as its first argument.

    Raises:
        SourceError: these are no MjModel and MjData of each other.
    """
    import mujoco as library

    if not isinstance(model, library.MjModel) or not isinstance(data, library.MjData):
        swapped = isinstance(model, library.MjData) and isinstance(data, library.MjModel)
        raise SourceError(
            "silo.mujoco takes the model first, then its data" if swapped else
            f"silo.mujoco takes a mujoco.MjModel and its MjData, got {shown(model)} and {shown(data)}; arrays of MJX "
            "lie on a GPU: copy them into an MjData, or give them to log.value"
        )  # fmt: skip
    if (len(data.qpos), len(data.qvel), len(data.sensordata)) != (model.nq, model.nv, model.nsensordata):
        raise SourceError("silo.mujoco: this MjData was made of another model; write mujoco.MjData(model)")
    return VariableSet("silo.mujoco", (*_joints(model, data), *_actuators(model, data), *_sensors(model, data)))


def _joints(model: Any, data: Any) -> Iterator[Variable]:
    from mujoco import mjtJoint

    for number in range(model.njnt):
        name = f"joints/{model.joint(number).name or number}"
        place, speed, kind = model.jnt_qposadr[number], model.jnt_dofadr[number], mjtJoint(int(model.jnt_type[number]))
        if kind in (mjtJoint.mjJNT_HINGE, mjtJoint.mjJNT_SLIDE):
            units = _units(kind == mjtJoint.mjJNT_SLIDE)
            yield Variable(_scalar(data.qpos, place), f"{name}/position", units[0])
            yield Variable(_scalar(data.qvel, speed), f"{name}/velocity", units[1])
            word = "force" if kind == mjtJoint.mjJNT_SLIDE else "torque"
            yield Variable(_scalar(data.qfrc_actuator, speed), f"{name}/{word}", units[2])
            continue
        if kind == mjtJoint.mjJNT_FREE:
            yield Variable(data.qpos[place : place + 3], f"{name}/position", "m")
            yield Variable(data.qvel[speed : speed + 3], f"{name}/velocity", "m/s")
            place, speed = place + 3, speed + 3
        yield Variable(data.qpos[place : place + 4], f"{name}/orientation", kind=QUATERNION)
        yield Variable(data.qvel[speed : speed + 3], f"{name}/angular_velocity", "rad/s")


def _actuators(model: Any, data: Any) -> Iterator[Variable]:
    for number in range(model.nu):
        name = f"actuators/{model.actuator(number).name or number}"
        yield Variable(_scalar(data.ctrl, number), f"{name}/control")
        yield Variable(_scalar(data.actuator_force, number), f"{name}/force", _unit_of_actuator(model, number))


def _sensors(model: Any, data: Any) -> Iterator[Variable]:
    from mujoco import mjtSensor

    for number in range(model.nsensor):
        name = f"sensors/{model.sensor(number).name or number}"
        begin, size = model.sensor_adr[number], model.sensor_dim[number]
        kind = mjtSensor(int(model.sensor_type[number])).name.removeprefix("mjSENS_")
        source = _scalar(data.sensordata, begin) if size == 1 else data.sensordata[begin : begin + size]
        if kind in OF_JOINTS:
            unit = _units(_slides(model, model.sensor_objid[number]))[OF_JOINTS[kind]]
        elif kind == "ACTUATORFRC":
            unit = _unit_of_actuator(model, model.sensor_objid[number])
        else:
            unit = SENSORS.get(kind, "-")
        yield Variable(source, name, unit, QUATERNION if kind.endswith("QUAT") else "")


def _scalar(values: np.ndarray[Any, Any], place: int) -> np.ndarray[Any, Any]:
    return values[place : place + 1].reshape(())


def _units(slides: bool) -> tuple[str, str, str]:
    return SLIDES if slides else TURNS


def _slides(model: Any, joint: int) -> bool:
    from mujoco import mjtJoint

    return bool(mjtJoint(int(model.jnt_type[joint])) == mjtJoint.mjJNT_SLIDE)


def _unit_of_actuator(model: Any, number: int) -> str:
    from mujoco import mjtTrn

    kind = mjtTrn(int(model.actuator_trntype[number]))
    if kind in (mjtTrn.mjTRN_JOINT, mjtTrn.mjTRN_JOINTINPARENT):
        return _units(_slides(model, model.actuator_trnid[number, 0]))[2]
    return "N" if kind == mjtTrn.mjTRN_TENDON else "-"
