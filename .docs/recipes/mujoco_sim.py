"""MuJoCo: its state logged by reference, on the time of the simulation. Needs `pip install mujoco`.

The arrays of `MjData` stay where they are as long as it lives, so they are added once and never copied by hand.
`mj_resetData` keeps them too; a new `MjData` needs a new logger.

    python .docs/recipes/mujoco_sim.py FOLDER
"""

import sys

import mujoco
import numpy as np

import silo

MODEL = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body name="base" pos="0 0 .6">
      <freejoint/>
      <geom type="box" size=".2 .1 .05" mass="5"/>
      <body name="leg" pos="0 0 -.05">
        <joint name="knee" axis="0 1 0" damping=".1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass=".5"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="knee" gear="10"/></actuator>
</mujoco>
"""
STEPS = 1000


def main(folder: str) -> None:
    """Simulate two seconds and find the hardest contact."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    rate_hz = 1 / model.opt.timestep
    with silo.Logger("mujoco", frequency=rate_hz, folder=folder, clock=lambda: float(data.time)) as log:
        log.add(silo.mujoco(model, data))  # joints, actuators and sensors by their names, with units
        log.add(data, attr="ncon", group="contacts")  # a number is read each tick
        force = log.array("force", group="contacts", unit="N")
        wrench = np.zeros(6)
        log.start()
        for _ in range(STEPS):
            data.ctrl[:] = 0.5 * np.sin(5 * data.time)
            mujoco.mj_step(model, data)
            force[...] = 0
            for contact in range(data.ncon):
                mujoco.mj_contactForce(model, data, contact, wrench)
                force += wrench[0]
            log.collect()
        log.stop()
        saved = log.save("silo")
    run = silo.open_log(saved[0].path)
    hardest = run["contacts/force"]
    when_s = hardest.times[int(np.argmax(hardest.values))]
    print(f"{len(hardest)} steps, the hardest contact: {hardest.max():.0f} N at {when_s:.2f} s")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
