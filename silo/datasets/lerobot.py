"""Runs -> a LeRobot data set, version 3.0, without cameras: one episode per run; or a NumPy file for each.

The layout is that of the package lerobot 0.6.1 (`src/lerobot/datasets/`): `meta/info.json`, `meta/stats.json`,
`meta/tasks.parquet`, `meta/episodes/chunk-*/file-*.parquet`, `data/chunk-*/file-*.parquet`. Its loader checks neither
time stamps nor totals: `silo.datasets.check` does. Memory holds one run at a time.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.log import Log
from silo.analysis.opening import open_log
from silo.core.arguments import INT64, path, shown, whole
from silo.core.recording import Progress
from silo.datasets.episodes import EpisodeLog, Pieces, SeenMoments, facts_of, pieces_of, task_of, with_facts
from silo.datasets.frames import HOWS, Feature, FrameTable, How, frames, same_features, wanted_of, widths_of
from silo.datasets.moments import Moments, merged
from silo.datasets.npz import ENTRY, EpisodeFiles
from silo.errors import ElementError, SaveError, SiloError
from silo.files.atomic import atomic_folder, replaced_folder
from silo.files.optional_packages import need

VERSION = "v3.0"
CHUNKS_SIZE = 1000
FILE_MB = 100
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
TIMESTAMP = Feature("timestamp", "float32", (1,))
COUNTERS = tuple(Feature(name, "int64", (1,)) for name in ("frame_index", "episode_index", "index", "task_index"))


@dataclass
class DataSet:
    """What was written: episodes, frames, and by run what was left out and why, of which frames it is short, which hold
    what was long before, which numbers are NaN or infinite in how many of them, and which moments are in another, too.
    Of the episodes in `no_task` nobody said what was done.
    """

    path: Path
    episodes: int = 0
    frames: int = 0
    left_out: list[tuple[str, str]] = field(default_factory=list)
    short: list[tuple[str, str]] = field(default_factory=list)
    held: list[tuple[str, str]] = field(default_factory=list)
    not_finite: list[tuple[str, str]] = field(default_factory=list)
    again: list[tuple[str, str]] = field(default_factory=list)
    no_task: list[str] = field(default_factory=list)
    lost: int = 0


def write_lerobot(
    runs: Sequence[str | os.PathLike[str] | Log],
    folder: str | os.PathLike[str],
    *,
    fps: int,
    state: Sequence[str],
    action: Sequence[str] = (),
    also: Sequence[str] = (),
    window: Sequence[str] = (),
    how: How = "last",
    to: Literal["lerobot", "episodes"] = "lerobot",
    episodes: Pieces = "runs",
    task: str | Callable[[Log], str] = "",
    where: str = "",
    robot: str = "",
    force: bool = False,
    progress: Progress | None = None,
) -> DataSet:
    """Write runs as a LeRobot data set: an episode of each.

    A run that has none of the time in common, or for which `where` doesn't hold at its end, is left out and named in
    what is returned. The folder appears when all of it is written.

    Args:
        runs: files, or logs.
        folder: what is made. It must not be there, unless `force`.
        fps: frames per second (Hz), a whole number.
        state: patterns of the signals that are `observation.state`, float32, side by side in this order.
        action: of those that are `action`.
        also: of those that become features of their own, `observation.<name>`, with their types; texts too.
        window: likewise, but each frame holds all samples since the frame before: `(samples, numbers)`. It is as wide
            as the most that came between two frames, in any run; where fewer came, it begins with samples that stand
            at the end of the frame before, too.
        how: what of a signal with a higher rate stands in a frame: `"last"` sample, or `"mean"` since the frame before
            (without NaN); of bools, enumerations, texts, and whole numbers in `also`, the last in any case.
        to: `"episodes"` writes a NumPy file per episode instead (`silo.datasets.npz`).
        episodes: what is an episode: each of the runs, each that the program marked in them (`log.episode`), or those
            of the runs that are captures. One that is to be done again (redo) is left out.
        task: what was done, in words, or a function of a log that says it; if it is empty, what the program said: the
            `task` in `about` of an episode, its name, or the `task` in `about` of the run.
        where: an expression; only episodes count for which it is true at their last sample. Of marked ones it knows
            what was said of them: `success`, `good`, `bad`, facts that are numbers.
        robot: the type of robot.
        force: replace a data set that is there.
        progress: called with the fraction that is done.

    Raises:
        SaveError: the folder is there, the system refuses, or no run is left.
        ElementError: a run's features differ from those of the first one; a number is out of range.
        SiloError: pyarrow is missing.
    """
    fps = whole("fps", fps, 1, INT64[1])
    if how not in HOWS[:2]:
        raise ElementError(f"how must be 'last' or 'mean', got {shown(how)}; whole windows are asked for by window=")
    final = path("folder", folder)
    if not state:
        raise ElementError("a data set needs at least one signal of the state: state=['joints/*']")
    replaced = final.is_dir() and force
    if replaced and not any((final / name).is_file() for name in ("meta/info.json", ENTRY)):
        raise SaveError(f"'{final}' is a folder, but no data set: it is not replaced; choose another name")
    with (replaced_folder if replaced else atomic_folder)(final) as part:
        part.mkdir(exist_ok=True)
        with ExitStack() as stack:
            writer = (EpisodeFiles if to == "episodes" else _Writer)(part, fps, robot, stack)
            done = DataSet(final)
            features = partial(wanted_of, state=state, action=action, also=also, how=how, window=window)
            seen = SeenMoments()
            widths: dict[str, int] = {}  # of all runs, as each frame has one shape
            for one in _episodes(runs, episodes, where, DataSet(final)) if window else ():
                with suppress(SiloError):  # it is left out below, and told why
                    for name, width in widths_of(features(one.known), fps, one.span_ns).items():
                        widths[name] = max(width, widths.get(name, 1))
            for one in _episodes(runs, episodes, where, done, progress):
                try:
                    made = frames(features(one.known), fps, widths, one.span_ns)
                except SiloError as error:
                    done.left_out.append((one.name, str(error)))
                    continue
                words = task(one.log) if callable(task) else task or task_of(one.log, one.marked)
                lost = sum(element.lost for element in one.log.recording.elements)
                facts = {"silo/source": one.source, "silo/begin_s": made.begin_s, "silo/lost": lost}
                writer.add(one.name, made, words, facts | ({} if one.marked is None else facts_of(one.marked)))
                done.lost += lost
                done.no_task.extend([] if words else [one.name])
                tells = (
                    (done.short, made.lacks),
                    (done.held, made.held),
                    (done.not_finite, made.not_finite),
                    (done.again, seen.again(one.name, one.log)),
                )
                for told, why in tells:
                    told.extend([(one.name, why)] if why else [])
            done.episodes, done.frames = len(writer.rows), writer.frames
            if not writer.rows:
                why = f": {done.left_out[0][0]}: {done.left_out[0][1]}" if done.left_out else "; name some"
                raise SaveError(f"no run is left for a data set, nothing was written{why}")
            writer.end()
    return done


def _episodes(
    runs: Sequence[str | os.PathLike[str] | Log],
    pieces: Pieces,
    where: str,
    done: DataSet,
    progress: Progress | None = None,
) -> Iterator[EpisodeLog]:
    """Those of the runs that count; the others are noted as left out."""
    whole_runs: dict[tuple[str, str], str] = {}  # those of which several parts may be given, by their ids
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs))
        source = run.path or run.name if isinstance(run, Log) else os.fspath(run)
        try:
            opened = run if isinstance(run, Log) else open_log(run, alone=False)
            stretch = opened.recording.stretch
            first = source
            if stretch is not None and not stretch.part:
                first = whole_runs.setdefault(stretch.whole, source)
            if first != source:
                done.left_out.append((source, f"a part of the same run as {first}, with which all of it came"))
                continue
            found = pieces_of(opened, source, pieces)
        except SiloError as error:
            done.left_out.append((source, str(error)))
            continue
        for one in found:
            try:
                if where and not _holds(one.log if one.marked is None else with_facts(one.log, one.marked), where):
                    done.left_out.append((one.name, f"'{where}' is not true at its end"))
                    continue
            except SiloError as error:
                done.left_out.append((one.name, str(error)))
                continue
            yield one


def _holds(log: Log, expression: str) -> bool:
    values = log.eval(expression).values
    return bool(len(values)) and bool(np.all(values[-1]))


class _Writer:
    """A data set as it grows: data at once, what is known of episodes and tasks at the end."""

    def __init__(self, folder: Path, fps: int, robot: str, stack: ExitStack) -> None:
        self._folder, self._fps, self._robot, self._stack = folder, fps, robot, stack
        self._arrow, self._parquet = (need(name, "convert", "Data sets") for name in ("pyarrow", "pyarrow.parquet"))
        self._features: tuple[Feature, ...] = ()
        self._tasks: dict[str, int] = {}
        self._stats: dict[str, Moments] = {}
        self._file: Any = None
        self._sink: Any = None
        self._place = -1
        self.rows: list[dict[str, Any]] = []
        self.frames = 0

    def add(self, name: str, made: FrameTable, task: str, facts: dict[str, Any]) -> None:
        """Write an episode. Raises ElementError where its features aren't those of the first one."""
        self._features = same_features(self._features, made, name)
        count, episode = len(made), len(self.rows)
        number = self._tasks.setdefault(task, len(self._tasks))
        steps = np.arange(count, dtype=np.int64)
        counters = (steps, np.full(count, episode), steps + self.frames, np.full(count, number))
        columns = dict(zip((one.name for one in self._all), (*made.columns, steps / self._fps, *counters), strict=True))
        columns["timestamp"] = columns["timestamp"].astype(np.float32)
        if self._sink is None or self._sink.tell() >= FILE_MB << 20:
            self._next_file()
        cells = [self._cells(one, columns[one.name]) for one in self._all]
        self._file.write_table(self._arrow.table(cells, schema=self._file.schema))
        stats = {one.name: Moments.of(columns[one.name]) for one in self._all if one.dtype != "string"}
        self._stats = merged(self._stats, stats.items())
        self.rows.append(
            {
                "episode_index": episode,
                "tasks": [task],
                "length": count,
                "data/chunk_index": self._place // CHUNKS_SIZE,
                "data/file_index": self._place % CHUNKS_SIZE,
                "dataset_from_index": self.frames,
                "dataset_to_index": self.frames + count,
                **{
                    f"stats/{feature}/{key}": value
                    for feature, one in stats.items()
                    for key, value in one.told().items()
                },
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **facts,
            }
        )
        self.frames += count

    def end(self) -> None:
        if self._file is not None:
            self._file.close()
        arrow = self._arrow
        self._write(EPISODES.format(chunk_index=0, file_index=0), arrow.Table.from_pylist(self.rows))
        index = {"index_columns": ["task"], "column_indexes": [], "columns": [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
            for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
        ]}  # fmt: skip
        tasks = arrow.table({"task_index": arrow.array(self._tasks.values()), "task": list(self._tasks)})
        self._write("meta/tasks.parquet", tasks.replace_schema_metadata({"pandas": msgspec.json.encode(index)}))
        self._json("stats.json", {name: one.told() for name, one in self._stats.items()})
        episodes = len(self.rows)
        self._json(
            "info.json",
            {
                "codebase_version": VERSION,
                "robot_type": self._robot or None,
                "fps": self._fps,
                "total_episodes": episodes,
                "total_frames": self.frames,
                "total_tasks": len(self._tasks),
                "chunks_size": CHUNKS_SIZE,
                "data_files_size_in_mb": FILE_MB,
                "splits": {"train": f"0:{episodes}"},
                "data_path": DATA,
                "video_path": None,
                "features": {one.name: _told(one) for one in self._all},
            },
        )

    @property
    def _all(self) -> tuple[Feature, ...]:
        return (*self._features, TIMESTAMP, *COUNTERS)

    def _next_file(self) -> None:
        if self._file is not None:
            self._file.close()
        self._place += 1
        target = self._folder / DATA.format(
            chunk_index=self._place // CHUNKS_SIZE, file_index=self._place % CHUNKS_SIZE
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        self._sink = self._stack.enter_context(target.open("wb"))
        features = {"info": {"features": {one.name: _of_hugging_face(one) for one in self._all}}}
        fields = [self._arrow.field(one.name, self._type(one)) for one in self._all]
        schema = self._arrow.schema(fields, metadata={"huggingface": msgspec.json.encode(features)})
        self._file = self._stack.enter_context(self._parquet.ParquetWriter(self._sink, schema, compression="snappy"))

    def _type(self, feature: Feature) -> Any:
        kind = getattr(self._arrow, {"bool": "bool_"}.get(feature.dtype, feature.dtype))()
        if feature.shape == (1,):
            return kind
        if len(feature.shape) == 1:
            return self._arrow.list_(kind, feature.shape[0])
        for _ in feature.shape:
            kind = self._arrow.list_(kind)
        return kind

    def _cells(self, feature: Feature, values: NDArray[Any]) -> Any:
        if feature.shape == (1,):
            return self._arrow.array(values, type=self._type(feature))
        flat = self._arrow.array(values.reshape(-1))
        if len(feature.shape) == 1:
            return self._arrow.FixedSizeListArray.from_arrays(flat, feature.shape[0])
        for size in reversed(feature.shape):
            flat = self._arrow.ListArray.from_arrays(np.arange(0, len(flat) + 1, size, dtype=np.int32), flat)
        return flat

    def _write(self, name: str, table: Any) -> None:
        (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
        self._parquet.write_table(table, self._folder / name, compression="snappy")

    def _json(self, name: str, value: object) -> None:
        (self._folder / "meta").mkdir(exist_ok=True)
        # NaN, as Python's own JSON has it: of null no loader makes a number
        (self._folder / "meta" / name).write_text(json.dumps(value, indent=4))


def _told(feature: Feature) -> dict[str, Any]:
    said = {"dtype": feature.dtype, "shape": list(feature.shape), "names": list(feature.names) or None}
    said |= {"units": list(feature.units)} if feature.units else {}
    return said | ({"labels": feature.labels} if feature.labels else {})


def _of_hugging_face(feature: Feature) -> dict[str, Any]:
    """The feature in the words of the package `datasets` 4."""
    if len(feature.shape) > 1:
        return {"shape": list(feature.shape), "dtype": feature.dtype, "_type": f"Array{len(feature.shape)}D"}
    one = {"dtype": feature.dtype, "_type": "Value"}
    return one if feature.shape == (1,) else {"feature": one, "length": feature.shape[0], "_type": "List"}
