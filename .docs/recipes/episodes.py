"""Episodes of a learning program: one log each, compared at the end.

The environment has the interface of Gymnasium: `gymnasium.make("Pendulum-v1")` can stand in its place. What its state
is made of anew at each step (`state = ...`) is copied into variables of silo: they stay where they are.

    python .docs/recipes/episodes.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

import silo

STEP_S = 0.05
STEPS = 200
Step = tuple[np.ndarray, float, bool, bool, dict[str, float]]


class Pendulum:
    """cos, sin and speed of an angle; the torque pushes."""

    def reset(self, *, seed: int) -> tuple[np.ndarray, dict[str, float]]:
        """Begin anew at an angle that the seed says."""
        self.angle, self.speed = np.random.default_rng(seed).uniform(-np.pi, np.pi), 0.0
        return self._seen(), {}

    def step(self, action: float) -> Step:
        """One step of time."""
        self.speed += (15 * np.sin(self.angle) + 3 * action) * STEP_S
        self.angle += self.speed * STEP_S
        return self._seen(), -float(self.angle**2), False, False, {}

    def _seen(self) -> np.ndarray:
        return np.array([np.cos(self.angle), np.sin(self.angle), self.speed])


def main(folder: str, episodes: int = 3) -> None:
    """Run the episodes, then say what differs between the first two."""
    env = Pendulum()
    tick = 0

    def simulated() -> float:
        return tick * STEP_S  # time stamps are those of the simulation, not of the computer

    with silo.Logger("pendulum", frequency=1 / STEP_S, max_time=60, folder=folder, clock=simulated) as log:
        observation = log.array("observation", 3)
        reward, action = log.array("reward"), log.array("action", unit="Nm")
        for episode in range(episodes):
            observation[:], _ = env.reset(seed=episode)
            log.start()  # empties the buffers; what is saved stays in its file
            for tick in range(STEPS):  # noqa: B007 - the clock reads it
                action[...] = -2 * observation[1] - 0.5 * observation[2]
                observation[:], reward[...], ended, cut, _ = env.step(float(action))
                log.collect()
                if ended or cut:
                    break
            log.stop()
            log.save("silo", name=f"episode_{episode:04}")

    paths = sorted(Path(folder).glob("episode_*.silo"))
    returns = [float(silo.open_log(path)["reward"].values.sum()) for path in paths]
    print(f"{len(paths)} episodes, the best is {int(np.argmax(returns))}")
    print(silo.compare(paths[0], paths[1]))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
