"""What MuJoCo and Gymnasium know of their variables: names, units and values, against what they say themselves."""

from typing import ClassVar

import numpy as np
import pytest

import silo
from silo.core.units import doubt
from silo.loop.sources import Variable, VariableSet

MODEL = """
<mujoco>
  <worldbody>
    <body pos="0 0 1">
      <freejoint name="base"/><geom size=".1"/>
      <body><joint name="knee"/><geom size=".1" pos=".2 0 0"/></body>
      <body><joint name="rail" type="slide"/><geom size=".1" pos="-.2 0 0"/></body>
      <body><joint name="hip" type="ball"/><geom size=".1" pos="0 .2 0"/></body>
      <site name="imu"/>
    </body>
  </worldbody>
  <actuator><motor name="knee" joint="knee" gear="5"/><motor joint="rail"/></actuator>
  <sensor>
    <gyro name="gyro" site="imu"/><framequat name="attitude" objtype="site" objname="imu"/>
    <jointpos name="rail" joint="rail"/><jointvel joint="knee"/><actuatorfrc name="push" actuator="knee"/>
  </sensor>
</mujoco>
"""
UNITS = {
    "joints/base/position": "m",
    "joints/base/velocity": "m/s",
    "joints/base/orientation": "-",
    "joints/base/angular_velocity": "rad/s",
    "joints/knee/position": "rad",
    "joints/knee/velocity": "rad/s",
    "joints/knee/torque": "Nm",
    "joints/rail/position": "m",
    "joints/rail/velocity": "m/s",
    "joints/rail/force": "N",
    "joints/hip/orientation": "-",
    "joints/hip/angular_velocity": "rad/s",
    "actuators/knee/control": "-",
    "actuators/knee/force": "Nm",
    "actuators/1/control": "-",
    "actuators/1/force": "N",
    "sensors/gyro": "rad/s",
    "sensors/attitude": "-",
    "sensors/rail": "m",
    "sensors/3": "rad/s",
    "sensors/push": "Nm",
}


@pytest.fixture(scope="module")
def mujoco():
    return pytest.importorskip("mujoco")


@pytest.fixture
def simulated(mujoco):
    model = mujoco.MjModel.from_xml_string(MODEL)
    return model, mujoco.MjData(model)


@pytest.mark.slow  # MuJoCo asks a process which GLFW it has
def test_each_variable_of_a_model_has_its_name_unit_and_values(mujoco, simulated, new_logger):
    model, data = simulated
    log = new_logger(prefix="")
    log.add(silo.mujoco(model, data), divider=2)
    log.start()
    assert {info.name.lstrip("/"): info.unit for info in log.elements} == UNITS
    assert {info.options.divider for info in log.elements} == {2}
    data.ctrl[:] = 2, -3
    mujoco.mj_step(model, data)
    log.collect()
    log.stop()
    run = silo.open_log(log.save().path)
    joint = {name: data.joint(name) for name in ("base", "knee", "rail", "hip")}
    expected = {
        "joints/base/position": joint["base"].qpos[:3],
        "joints/base/orientation": joint["base"].qpos[3:],
        "joints/base/velocity": joint["base"].qvel[:3],
        "joints/base/angular_velocity": joint["base"].qvel[3:],
        "joints/knee/position": joint["knee"].qpos[0],
        "joints/knee/torque": 10.0,  # control times gear
        "joints/rail/velocity": joint["rail"].qvel[0],
        "joints/rail/force": -3.0,
        "joints/hip/orientation": joint["hip"].qpos,
        "joints/hip/angular_velocity": joint["hip"].qvel,
        "actuators/knee/force": 2.0,
        "actuators/1/control": -3.0,
        "sensors/gyro": data.sensor("gyro").data,
        "sensors/attitude": data.sensor("attitude").data,
        "sensors/push": data.sensor("push").data[0],
    }
    for name, value in expected.items():
        assert run[name].values[-1].tolist() == np.asarray(value).tolist(), name
    kinds = {info.name.lstrip("/"): info.kind for info in log.elements}
    assert kinds["joints/hip/orientation"] == kinds["sensors/attitude"] == kinds["joints/base/orientation"]
    assert kinds["joints/hip/orientation"].startswith("quaternion")


@pytest.mark.slow  # MuJoCo asks a process which GLFW it has
def test_what_is_no_model_with_its_data_is_refused(mujoco, simulated):
    model, data = simulated
    other = mujoco.MjModel.from_xml_string("<mujoco/>")
    for given, words in [
        ((data, model), "model first"),
        ((model, 3), "got .* and 3"),
        ((other, data), "another model"),
    ]:
        with pytest.raises(silo.errors.SourceError, match=words):
            silo.mujoco(*given)


def test_the_units_of_sensors_are_units():
    from silo.simulators import mujoco as module

    assert [unit for unit in module.SENSORS.values() if doubt(unit)] == []


@pytest.mark.parametrize(
    "given", [{"name": "q"}, {"unit": "rad"}, {"kind": "pose"}, {"attr": "x"}, {"limits": (0, 1, 2, 3)}]
)
def test_variables_that_come_together_keep_their_own_words(new_logger, given):
    with pytest.raises(silo.ElementError, match=f"{next(iter(given))}= is each variable's own"):
        new_logger().add(VariableSet("made", (Variable(np.zeros(1), "x"),)), **given)


def test_variables_that_come_together_are_added_all_or_none(new_logger):
    three = VariableSet("made", tuple(Variable(np.zeros(2), name, "m") for name in ("x", "y", "taken")))
    log, null = new_logger(), silo.NullLogger()
    log.add(np.zeros(1), "arm/taken")
    with pytest.raises(silo.ElementError, match="'/log/arm/taken' is there already"):
        log.add(three, group="arm")
    log.add(three, group="leg")
    log.update()
    null.add(three, group="leg")
    assert [info.name for info in log.elements] == ["/log/arm/taken", "/log/leg/x", "/log/leg/y", "/log/leg/taken"]
    assert [info.name for info in null.elements] == ["/log/leg/x", "/log/leg/y", "/log/leg/taken"]


# ------------------------------------------------------------------------------------------------------- Gymnasium


@pytest.fixture(scope="module")
def gymnasium():
    return pytest.importorskip("gymnasium")


@pytest.fixture(scope="module")
def counting(gymnasium):
    """An environment that counts its steps, in spaces of every kind."""

    class Counting(gymnasium.Env):
        metadata: ClassVar = {"render_fps": 20}
        action_space = gymnasium.spaces.Discrete(3)
        observation_space = gymnasium.spaces.Dict(
            arm=gymnasium.spaces.Box(-1, 1, (2,)),
            parts=gymnasium.spaces.Tuple([gymnasium.spaces.Discrete(9), gymnasium.spaces.MultiBinary(2)]),
            words=gymnasium.spaces.Text(5),
        )

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.count = 0
            return self._seen(), {}

        def step(self, action):
            self.count += 1
            return self._seen(), -float(action), self.count == 3, False, {}

        def _seen(self):
            return {"arm": np.array([self.count, 0]), "parts": (self.count, np.array([1, 0])), "words": "x"}

    return Counting


def test_an_episode_is_a_file(counting, tmp_path, caplog):
    env = silo.gymnasium(counting(), tmp_path / "runs", name="arm", every=2)
    for episode in range(3):
        env.reset(seed=episode)
        while not env.step(2)[2]:
            pass
    env.close()
    again = silo.gymnasium(counting(), tmp_path / "runs", name="arm", frequency="10Hz")
    again.reset()
    again.close()
    assert "Text(" in caplog.text
    first, second, later = map(silo.open_log, sorted((tmp_path / "runs").iterdir()))
    assert [first.path, second.path, later.path] == [
        str(tmp_path / "runs" / f"arm_episode_0000{n}.silo") for n in (1, 2, 3)
    ]
    assert first["reward"].values.tolist() == [0, -2, -2, -2]
    assert first["action"].values.tolist() == second["action"].values.tolist() == [0, 2, 2, 2]
    assert first["terminated"].values.tolist() == [False, False, False, True]
    assert first["observation/arm"].values[:, 0].tolist() == [0, 1, 2, 3]
    assert first["observation/parts/0"].values.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(first["reward"].times, [0, 0.05, 0.1, 0.15])
    assert [event.text for event in second.events] == ["episode 2, seed 2", "terminated after 3 steps, return -6"]
    assert later["reward"].values.tolist() == [0]


def test_what_is_no_environment_is_refused(gymnasium, counting, tmp_path):
    with pytest.raises(silo.errors.SourceError, match="vector of environments by itself"):
        silo.gymnasium(3)
    with pytest.raises(silo.ElementError, match="every"):
        silo.gymnasium(counting(), tmp_path, every=0)
    wordy = counting()
    wordy.observation_space = gymnasium.spaces.Text(3)
    with pytest.raises(silo.errors.SourceError, match="can't be logged"):
        silo.gymnasium(wordy, tmp_path)
