"""Runs -> a folder of NumPy files, one per episode: what a loader of ten lines reads.

episode_000000.npz    an array per feature, `(frames, numbers)`, and `timestamp` (s, from the first frame)
episodes.json         fps, the features with the names and units of their numbers, and a line per episode
"""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from silo.datasets.frames import Feature, FrameTable, same_features
from silo.errors import SaveError, reason

ENTRY = "episodes.json"


class EpisodeFiles:
    """The folder as it grows; the list at the end."""

    def __init__(self, folder: Path, fps: int, robot: str, stack: ExitStack) -> None:
        self._folder, self._fps, self._robot = folder, fps, robot
        self._features: tuple[Feature, ...] = ()
        self.rows: list[dict[str, Any]] = []
        self.frames = 0

    def add(self, name: str, made: FrameTable, task: str, facts: dict[str, Any]) -> None:
        """Write an episode. Raises ElementError where its features aren't those of the first one, SaveError."""
        self._features = same_features(self._features, made, name)
        file = f"episode_{len(self.rows):06d}.npz"
        # texts are objects in frames
        columns = (one.astype(str) if one.dtype.kind == "O" else one for one in made.columns)
        arrays = dict(zip((one.name for one in made.features), columns, strict=True))
        try:
            np.savez_compressed(
                self._folder / file, allow_pickle=False, timestamp=np.arange(len(made)) / self._fps, **arrays
            )
        except OSError as error:
            raise SaveError(f"'{file}' can't be written: {reason(error)}") from error
        told = {key.removeprefix("silo/"): value for key, value in facts.items()}
        self.rows.append({"file": file, "frames": len(made), "task": task, **told})
        self.frames += len(made)

    def end(self) -> None:
        """Write the list."""
        about = {"fps": self._fps, "robot": self._robot, "features": self._features, "episodes": self.rows}
        (self._folder / ENTRY).write_bytes(msgspec.json.format(msgspec.json.encode(about), indent=2))
