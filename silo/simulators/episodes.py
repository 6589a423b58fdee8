"""An environment of Gymnasium whose steps are ticks, and whose episodes are runs."""

import logging
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Env, Wrapper, spaces

from silo.errors import SourceError
from silo.logger.logger import Logger

log = logging.getLogger("silo")

Keep = Callable[[Any], None]


class LoggedEnvironment(Wrapper):  # type: ignore[misc]  # of a package that may be missing
    """What `silo.gymnasium` returns. `log` is its logger."""

    def __init__(
        self, env: Env, folder: str | os.PathLike[str], name: str, frequency: float | str | None, every: int
    ) -> None:
        super().__init__(env)
        self.name = name or _name(env)
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._every, self._begun = every, 0
        self._steps = 0
        self._return = 0.0
        self._ended = ""
        rate = _rate(env) if frequency is None else frequency
        self.log = Logger(self.name, frequency=rate, max_time=0, folder=folder, clock=self._time_s)
        self._number = 1 + max((self._numbered(path) for path in self._folder.iterdir()), default=0)
        self._actions: list[np.ndarray[Any, Any]] = []
        observed = _keeper(self.log, "observation", env.observation_space, [])
        acted = _keeper(self.log, "action", env.action_space, self._actions)
        if observed is None or acted is None:
            raise SourceError(
                f"silo.gymnasium: of {self.name} can't be logged: {env.observation_space} and {env.action_space}; "
                "log what you need of it by silo.Logger and log.value"
            )
        self._observed, self._acted = observed, acted
        self._reward = self.log.array("reward", buffer="growing")
        self._terminated, self._truncated = (
            self.log.array(word, dtype=bool, buffer="growing") for word in ("terminated", "truncated")
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Save the episode before, and begin another one; what was observed at first is its tick 0, without action."""
        observation, info = super().reset(seed=seed, options=options)
        self._save()
        self._steps, self._return, self._ended = 0, 0.0, ""
        self._begun += 1
        if (self._begun - 1) % self._every:
            return observation, info
        for array in (*self._actions, self._reward, self._terminated, self._truncated):
            array[...] = 0
        self.log.start()
        self._observed(observation)
        self.log.collect()
        self.log.mark(f"episode {self._number}" + ("" if seed is None else f", seed {seed}"))
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One step, logged."""
        observation, reward, terminated, truncated, info = super().step(action)
        if not self.log.is_running:
            return observation, reward, terminated, truncated, info
        self._steps += 1
        self._return += float(reward)
        self._acted(action)
        self._observed(observation)
        self._reward[...], self._terminated[...], self._truncated[...] = reward, terminated, truncated
        self.log.collect()
        if (terminated or truncated) and not self._ended:
            self._ended = "terminated" if terminated else "truncated"
            self.log.mark(f"{self._ended} after {self._steps} steps, return {self._return:.6g}")
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Save the last episode and close logger and environment."""
        self._save()
        self.log.close()
        super().close()

    def _save(self) -> None:
        if not self.log.is_running:
            return
        self.log.stop()
        self.log.save("silo", name=f"{self.name}_episode_{self._number:05}", folder=self._folder)
        self._number += 1

    def _time_s(self) -> float:
        return self._steps / self.log.options.frequency_hz if self._steps else 0.0

    def _numbered(self, path: Path) -> int:
        found = re.fullmatch(rf"{re.escape(self.name)}_episode_(\d+)\.silo", path.name)
        return int(found[1]) if found else 0


def _name(env: Env) -> str:
    """The logger's name: letters of its specification, without the version's slash and colons."""
    given = env.spec.id if env.spec is not None else type(env.unwrapped).__name__
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", given)


def _rate(env: Env) -> float:
    step_s = getattr(env.unwrapped, "dt", None)
    if isinstance(step_s, int | float) and step_s > 0:
        return 1 / float(step_s)
    return float(env.metadata.get("render_fps") or 1)


def _keeper(logger: Logger, name: str, space: Any, made: list[np.ndarray[Any, Any]]) -> Keep | None:
    """Make the variables of a space, which `made` gets, and return what copies a value into them; None for none."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        parts = space.spaces.items() if isinstance(space, spaces.Dict) else enumerate(space.spaces)
        keepers = [(key, keep) for key, part in parts if (keep := _keeper(logger, f"{name}/{key}", part, made))]

        def keep_parts(value: Any) -> None:
            for key, keep in keepers:
                keep(value[key])

        return keep_parts if keepers else None
    if space.shape is None or np.dtype(space.dtype).kind not in "biuf":
        log.warning("silo.gymnasium: %s is not logged: %s is no array of numbers", name, space)
        return None
    array = logger.array(name, space.shape, space.dtype, buffer="growing")
    made.append(array)
    return lambda value: array.__setitem__(..., value)
