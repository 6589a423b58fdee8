"""What a LeRobot data set says of itself, held against what is in it: its loader looks at neither times nor totals."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from silo.core.arguments import path
from silo.datasets.lerobot import COUNTERS, TIMESTAMP
from silo.decoding import converted, json_decoder
from silo.errors import FileFormatError, LogNotFoundError
from silo.files.optional_packages import need

TOLERANCE_S = 1e-4  # of lerobot for times of frames
MOST_PROBLEMS = 20
COLUMNS = [one.name for one in (TIMESTAMP, *COUNTERS)]
_TASK, _EPISODE = ["task_index"], ["episode_index", "dataset_from_index", "dataset_to_index", "length"]


def check_lerobot(folder: str | os.PathLike[str]) -> list[str]:
    """Return what is wrong with a LeRobot data set of version 3.0, at most 20 sentences; empty where all holds.

    Held against each other are totals, ranges of episodes, indices, time stamps and `fps`, tasks, shapes and types of
    features, values that are missing, and whether the statistics of all are there.

    Raises:
        LogNotFoundError: there is no data set in the folder.
        FileFormatError: its head can't be read.
        SiloError: pyarrow is missing.
    """
    root = path("folder", folder)
    parquet = need("pyarrow.parquet", "convert", "Data sets")
    head = root / "meta" / "info.json"
    if not head.is_file():
        raise LogNotFoundError(f"'{root}' is no data set: it has no meta/info.json")
    try:
        info = json_decoder(dict[str, Any]).decode(head.read_bytes())
        fps, features = int(info["fps"]), dict(info["features"])
        version = str(info["codebase_version"])
    except (msgspec.DecodeError, msgspec.ValidationError, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"'{head}': {type(error).__name__}: {error}") from None
    if not version.startswith("v3.") or fps <= 0:
        return [f"version {version} at {fps} frames/s: version v3.0 with a positive number is read"]
    found: list[str] = []
    for problem in _problems(root, parquet, info, fps, features):
        found.append(problem)
        if len(found) == MOST_PROBLEMS:
            break
    return found


def _problems(root: Path, parquet: Any, info: dict[str, Any], fps: int, features: dict[str, Any]) -> Iterator[str]:
    missing = [name for name in COLUMNS if name not in features]
    if missing:
        yield f"features lack {', '.join(missing)}"
        return
    try:
        tasks = _rows(parquet, [root / "meta" / "tasks.parquet"], _TASK)
        episodes = _rows(parquet, sorted((root / "meta" / "episodes").glob("*/*.parquet")), _EPISODE)
    except (OSError, ValueError) as error:
        yield f"what is known of tasks and episodes can't be read: {error}"
        return
    yield from _of_statistics(root / "meta" / "stats.json", features)
    if [row["task_index"] for row in tasks] != list(range(len(tasks))):
        yield "tasks.parquet: task_index isn't 0, 1, 2, ... : the row is what counts"
    yield from _of_episodes(episodes)
    frames = episodes[-1]["dataset_to_index"] if episodes else 0
    for key, count in (("total_episodes", len(episodes)), ("total_tasks", len(tasks)), ("total_frames", frames)):
        if info.get(key) != count:
            yield f"info.json says {key} {info.get(key)}, there are {count}"
    seen = 0
    for file in sorted((root / "data").glob("*/*.parquet")):
        try:
            data = parquet.ParquetFile(file)
            names = data.schema_arrow.names
        except (OSError, ValueError) as error:
            yield f"{file.relative_to(root)} can't be read: {error}"
            continue
        for name in sorted({*features} ^ {*names}):
            yield f"{file.relative_to(root)}: '{name}' is {'no feature' if name in names else 'missing'}"
        if not {*COLUMNS} <= {*names}:
            continue
        for group in range(data.num_row_groups):
            try:
                table = data.read_row_group(group)
            except (OSError, ValueError) as error:  # a value is missing where an older pyarrow takes none
                yield f"{file.relative_to(root)} can't be read, frames from {seen} on: {error}"
                seen += data.metadata.row_group(group).num_rows
                continue
            yield from _of_frames(table, seen, fps, episodes, len(tasks))
            yield from _of_columns(table, seen, features)
            seen += table.num_rows
    if seen != frames:
        yield f"the data has {seen} frames, the episodes have {frames}"


def _rows(parquet: Any, files: list[Path], wanted: list[str]) -> list[dict[str, Any]]:
    """Return the rows of tables. Raises ValueError where some have no whole numbers that are wanted, OSError."""
    rows: list[dict[str, Any]] = [row for file in files for row in parquet.read_table(file).to_pylist()]
    if lacking := [name for name in wanted if any(not isinstance(row.get(name), int) for row in rows)]:
        raise ValueError(f"{files[0].name} has no whole numbers {', '.join(lacking)}")
    return rows


def _of_statistics(file: Path, features: dict[str, Any]) -> Iterator[str]:
    """Return what is wrong with the file by which a policy scales what it is given."""
    try:
        known = converted(json.loads(file.read_bytes()), dict[str, dict[str, Any]])
    except (OSError, ValueError, RecursionError) as error:
        yield f"stats.json, by which a policy scales its inputs, can't be read: {error}"
        return
    of = {name: one.get("dtype") if isinstance(one, dict) else None for name, one in features.items()}
    numbers = [name for name, dtype in of.items() if dtype not in (None, "string", "image", "video")]
    if lacking := [name for name in numbers if not {"mean", "std", "min", "max"} <= {*known.get(name, ())}]:
        yield f"stats.json lacks mean, std, min or max of {', '.join(lacking)}"
    for name in numbers:
        if keys := [key for key, value in known.get(name, {}).items() if "None" in str(value)]:
            yield f"stats.json has null in {', '.join(keys)} of {name}: its loader makes no numbers of it"


def _of_episodes(episodes: list[dict[str, Any]]) -> Iterator[str]:
    at = 0
    for place, row in enumerate(episodes):
        begin, end, length = row["dataset_from_index"], row["dataset_to_index"], row["length"]
        if row["episode_index"] != place:
            yield f"row {place} of the episodes is episode {row['episode_index']}: they are looked up by their place"
        if (begin, end) != (at, at + length):
            yield f"episode {place} says frames {begin} to {end}; {length} from {at} on end at {at + length}"
        at = end


def _of_frames(table: Any, seen: int, fps: int, episodes: list[dict[str, Any]], tasks: int) -> Iterator[str]:
    time_s, frame, episode, index, task = (table[name].to_numpy() for name in COLUMNS)
    if not np.array_equal(index, np.arange(seen, seen + len(index))):
        yield f"frames from {seen} on: index isn't continuous"
    far = np.abs(time_s - frame / fps) > np.maximum(TOLERANCE_S, np.spacing(np.abs(time_s).astype(np.float32)))
    if far.any():
        first = int(np.flatnonzero(far)[0])
        yield f"frame {seen + first}: timestamp {time_s[first]:g} s, frame_index / fps is {frame[first] / fps:g} s"
    if len(task) and (task.min() < 0 or task.max() >= tasks):
        yield f"frames from {seen} on: task_index up to {task.max()}, there are {tasks} tasks"
    for number in np.unique(episode).tolist():
        if not 0 <= number < len(episodes):
            yield f"frames from {seen} on: episode {number}, there are {len(episodes)}"
            continue
        inside = np.flatnonzero(episode == number)
        if not np.array_equal(frame[inside], seen + inside - episodes[number]["dataset_from_index"]):
            yield f"episode {number}: frame_index doesn't count from its first frame"


def _of_columns(table: Any, seen: int, features: dict[str, Any]) -> Iterator[str]:
    for name, feature in features.items():
        column = table[name] if name in table.column_names else None
        if column is None:
            continue
        if column.null_count:
            yield f"'{name}': {column.null_count} values are missing from frame {seen} on: batches can't be made"
        shape = list(feature.get("shape", [1]))
        size = getattr(column.type, "list_size", None)
        if size is not None and [size] != shape:
            yield f"'{name}' has {size} numbers a frame, its feature says {shape}"
