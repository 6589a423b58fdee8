"""Runs as a LeRobot data set: values against the source, statistics against NumPy, damage against the check."""

import itertools
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import silo
from silo.analysis.signal import Signal
from silo.cli.group import cli
from silo.core.elements import Stretch
from silo.core.recording import Recording
from silo.datasets.check import check_lerobot
from silo.datasets.frames import Wanted, frames, wanted_of
from silo.datasets.lerobot import write_lerobot
from silo.datasets.moments import Moments, merged
from tests.later import Later
from tests.stand_ins.saved import element

pa, pq = Later("pyarrow"), Later("pyarrow.parquet")

FPS = 30
TEN = ("min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Three runs of one robot: 200 Hz, a command every 4th tick, a text, an enumeration; the second one failed."""
    folder = tmp_path_factory.mktemp("runs")
    for number in range(3):
        # nanoseconds, in steps of a tick; asked once when the logger is made
        clock = itertools.count(-5_000_000, 5_000_000).__next__
        log = silo.Logger("arm", frequency=200, folder=folder, script=folder / "none.yaml", clock=clock)
        q, command = log.array("q", 3, group="joints", unit="rad"), log.array("cmd", 2, unit="Nm", divider=4)
        speed, good = log.array("speed"), log.array("ok", dtype=bool)
        camera = np.array("", "U20")
        log.add(camera, "camera")
        log.array("mixed", (), [("a", "f8"), ("b", "i4")], size=1)
        log.array("huge", (), "u8", size=1)[...] = 2**64 - 1
        log.start()
        for tick in range(400 + 50 * number):
            q[:], command[:], speed[...] = np.sin(tick / 50 + np.arange(3)), (tick, number), tick % 7
            good[...], camera[...] = number != 1, f"{number}/{tick}.png"
            log.collect()
        log.save("silo", name=f"run{number}")
        log.close()
    return sorted(folder.glob("*.silo"))


@pytest.fixture(scope="module")
def made(runs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("set") / "out"
    return write_lerobot(
        runs, folder, fps=FPS, state=["joints/*", "speed"], action=["cmd"], also=["camera", "ok"], window=["joints/q"],
        task=lambda log: f"with {int(log['cmd'].values[0, 1])}", where="ok", robot="arm",
    )  # fmt: skip


# ---------------------------------------------------------------------------------------------------------- frames


@st.composite
def signals(draw):
    count = draw(st.integers(1, 40))
    steps = draw(st.lists(st.integers(1, 80_000_000), min_size=count, max_size=count))
    stamps = np.cumsum(steps, dtype=np.int64) + draw(st.integers(0, 10**18))
    return Signal("x", np.arange(count) * 1.5 - 7, stamps, start_ns=int(stamps[0]))


@given(signals(), st.integers(1, 120))
def test_a_frame_holds_what_was_known_at_its_time(signal, fps):
    last, mean = (frames([Wanted("x", (signal,), how)], fps).columns[0] for how in ("last", "mean"))
    begin, end = int(signal.time_ns[0]), int(signal.time_ns[-1])
    grid = list(itertools.takewhile(lambda at: at <= end, (begin + i * 10**9 // fps for i in itertools.count())))
    assert len(last) == len(mean) == len(grid)
    before = -1
    for at, newest, average in zip(grid, last, mean, strict=True):
        known = signal.values[signal.time_ns <= at]
        since = known if before < 0 else signal.values[(signal.time_ns > before) & (signal.time_ns <= at)]
        assert newest == known[-1]
        assert average == pytest.approx(since.mean() if len(since) and before >= 0 else known[-1])
        before = at


def test_a_pattern_means_all_its_signals_and_one_that_two_mean_is_there_once(runs):
    wanted = wanted_of(silo.open_log(runs[0]), ["[js]*", "joints/q"], ["cmd"], (), "last", ())
    names = [[signal.name for signal in one.signals] for one in wanted]
    assert names == [["/log/joints/q", "/log/speed"], ["/log/cmd"]]


def test_a_window_holds_all_samples_since_the_frame_before():
    fast = Signal("imu", np.arange(20.0), np.arange(20, dtype=np.int64) * 10_000_000)
    made = frames([Wanted("imu", (fast,), "window")], 20)
    assert made.features[0].shape == (5, 1)
    assert made.columns[0][..., 0].tolist() == [
        [0, 0, 0, 0, 0],
        [1, 2, 3, 4, 5],
        [6, 7, 8, 9, 10],
        [11, 12, 13, 14, 15],
    ]


def test_every_sample_is_in_a_window_where_frames_are_no_multiple_of_its_step():
    fast = Signal("imu", np.arange(100.0), np.arange(100, dtype=np.int64) * 10_000_000)
    windows = frames([Wanted("imu", (fast,), "window")], 30).columns[0][..., 0]
    assert windows[:4].tolist() == [[0, 0, 0, 0], [0, 1, 2, 3], [3, 4, 5, 6], [7, 8, 9, 10]]
    assert set(windows.ravel()) == set(range(int(windows[-1, -1]) + 1))


def test_windows_of_runs_are_as_wide_as_the_widest(tmp_path, new_logger):
    paths = []
    for steps in ([10, 10, 10, 10] * 10, [10, 10, 4, 4, 12] * 8):
        stamps = itertools.accumulate(step * 1_000_000 for step in steps)
        log = new_logger(f"run{len(paths)}", frequency=100, clock=stamps.__next__)
        x = log.array("x")
        log.start()
        for tick in range(len(steps) - 2):
            x[...] = tick
            log.collect()
        log.stop()
        paths.append(log.save().path)
    done = write_lerobot(paths, tmp_path / "out", fps=25, state=["x"], window=["x"], to="episodes")
    assert (done.episodes, done.left_out) == (2, [])
    for path in (tmp_path / "out").glob("*.npz"):
        window = np.load(path)["observation.x"][..., 0].astype(int)
        assert set(range(window.max() + 1)) == set(window.ravel())
        assert window.shape[1] == 5


@pytest.mark.parametrize("stamps", [[0], [0, 100_000_000], [0, 90_000_000, 190_000_000]])
def test_a_window_of_as_many_samples_as_frames_is_one_sample(stamps):
    made = frames([Wanted("imu", (Signal("imu", np.arange(len(stamps)) + 1.0, np.array(stamps)),), "window")], 10)
    assert made.features[0].shape == (1, 1)


def test_frames_begin_where_every_signal_has_a_value():
    early = Signal("early", np.arange(10), np.arange(10, dtype=np.int64) * 10**8, unit="m")
    late = Signal("late", np.arange(10), np.arange(10, dtype=np.int64) * 10**8 + 3 * 10**8)
    made = frames([Wanted("both", (early, replace(late, start_ns=10**9)))], 10)
    assert made.begin_s == pytest.approx(0.3)
    assert frames([Wanted("both", (replace(early, start_ns=2 * 10**8), late))], 10).begin_s == pytest.approx(0.1)
    assert made.columns[0].tolist() == [[3, 0], [4, 1], [5, 2], [6, 3], [7, 4], [8, 5], [9, 6]]
    assert (made.features[0].dtype, made.features[0].units) == ("int64", ("m", "-"))
    apart = Signal("apart", np.arange(2), np.arange(2, dtype=np.int64) + 10**12)
    for signal, words in ((apart, "no time in common: 'apart'"), (early.clip(2, 3), "'early' has no samples")):
        with pytest.raises(silo.ElementError, match=words):
            frames([Wanted("both", (early, signal))], 10)


def test_the_last_sample_of_a_slow_signal_holds_until_the_next_would_come():
    fast = Signal("fast", np.arange(100), np.arange(100, dtype=np.int64) * 10_000_000)
    slow = Signal("slow", np.arange(2), np.arange(2, dtype=np.int64) * 500_000_000)
    made = frames([Wanted("both", (fast, slow))], 10)
    assert made.columns[0].tolist() == [[10 * tick, tick // 5] for tick in range(10)]
    assert made.lacks == ""
    short = replace(slow, values=slow.values[:2], time_ns=slow.time_ns // 5 + 10**8)
    made = frames([Wanted("both", (fast, short))], 10)
    assert made.columns[0].tolist() == [[10, 0], [20, 1]]
    assert made.lacks == (
        "8 of 10 frames are not there: 'slow' has no sample before, the last sample of 'slow' holds no longer"
    )


def test_frames_of_a_time_without_any_sample_are_told_and_more_than_are_made_refused():
    stamps = np.arange(100, dtype=np.int64) * 10**7
    late = stamps + np.where(stamps >= 6 * 10**8, 3 * 10**9, 0) + np.where(stamps >= 8 * 10**8, 2 * 10**9, 0)
    both = tuple(Signal("x", np.arange(len(at)), at) for at in (late, late[::10]))
    told = "250 of 300 frames hold what was before, as no sample came from 0.59 s to 3.6 s, from 3.79 s to 5.8 s"
    assert frames([Wanted("both", both)], 50).held == told
    steady = Signal("y", np.arange(610), np.arange(610, dtype=np.int64) * 10**7)
    assert frames([Wanted("all", (*both, steady))], 50).held == ""
    assert frames([Wanted("slow", (Signal("x", np.arange(9), np.arange(9) * 3 * 10**9),))], 50).held == ""
    years = [Wanted("x", (Signal("x", stamps, late + (late > 10**9) * 10**17),))]
    why = r"5000000250 of 5000000300 frames hold .* 0\.59 s to 1e\+08 s, .*: at most 100,000,000 frames are made of"
    for span_ns, way_out in ((None, " a run: episodes that"), ((0, 10**17 + 6 * 10**9), " a run$")):
        with pytest.raises(silo.ElementError, match=f"{why}{way_out}"):
            frames(years, 50, span_ns=span_ns)


def test_a_run_in_which_a_clock_was_set_forward_is_told(tmp_path, new_logger):
    now = [10**18]
    log = new_logger("run", frequency=100, clock=lambda: now[0])
    x = log.array("x")
    log.start()
    for tick in range(300):
        x[...] = tick
        log.collect()
        now[0] += 4 * 10**9 if tick == 200 else 10_000_000
    path, out = log.save().path, tmp_path / "out"
    asked = ["convert", str(path), str(out), "--to", "lerobot", "--fps", "50", "--state", "x", "--task", "walk"]
    assert CliRunner().invoke(cli, asked).output.splitlines() == [
        f"warning: {path}: 199 of 350 frames hold what was before, as no sample came from 2 s to 6 s",
        f"{out}  1 episodes, 350 frames at 50/s",
    ]


def test_of_whole_numbers_side_by_side_with_others_the_mean_is_taken_of_words_the_last():
    stamps = np.arange(10, dtype=np.int64) * 10**7
    number, word = Signal("n", np.arange(10), stamps), Signal("w", np.arange(10), stamps, labels={1: "A"})
    made = frames([Wanted("state", (number, word), "mean", dtype="float32")], 25)
    assert made.columns[0].tolist() == [[0, 0], [2.5, 4], [6.5, 8]]
    assert made.features[0].labels == {"w": {1: "A"}}
    assert frames([Wanted("also", (number,), "mean")], 25).columns[0].tolist() == [0, 4, 8]


def test_nan_is_in_no_mean_of_a_frame_where_there_is_a_number():
    values = np.array([0, np.nan, 2, 3, np.nan, np.nan, np.nan, np.inf, 1, np.inf, -np.inf])
    made = frames([Wanted("x", (Signal("x", values, np.arange(11, dtype=np.int64) * 10**7),), "mean")], 50)
    np.testing.assert_equal(made.columns[0], [0, 2, 3, np.nan, np.inf, np.nan])


def simulated(log, resets=True):
    """Three episodes of 81 ticks each in a run of 300, a slow signal, maybe with a clock that begins anew with each."""
    x, slow = log.array("x"), log.array("slow", divider=50)
    log.start()
    for tick in range(300):
        if tick % 100 == 10:
            episode = log.episode("run").__enter__()
        x[...], slow[...] = tick, tick
        log.clock.now_ns = 10_000_000 * (tick % 100 if resets else tick)
        log.collect()
        if tick % 100 == 90:
            episode.success = True
            episode.__exit__(None, None, None)
    log.stop()
    return log.save().path


@pytest.fixture
def simulation(new_logger):
    class Clock:
        now_ns = 0

        def __call__(self):
            return self.now_ns

    clock = Clock()
    log = new_logger("sim", frequency=100, clock=clock, max_time=60)
    log.clock = clock
    return log


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
@pytest.mark.parametrize("resets", [True, False])
def test_what_a_slow_signal_was_before_an_episode_is_known_in_it(simulation, tmp_path, resets):
    path = simulated(simulation, resets)
    made = write_lerobot([path], tmp_path / "out", fps=50, state=["x", "slow"], episodes="episodes", to="episodes")
    assert (made.episodes, made.left_out, made.short) == (3, [], [])
    for number, file in enumerate(sorted((tmp_path / "out").glob("*.npz"))):
        ticks = 100 * number + np.arange(10, 91, 2)
        assert np.load(file)["observation.state"].tolist() == [[tick, tick // 50 * 50] for tick in ticks]


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_a_run_whose_clock_began_anew_makes_no_frames_but_of_its_episodes(simulation, tmp_path):
    log = silo.open_log(simulated(simulation))
    with pytest.raises(silo.SaveError, match=r"the clock of '/log/x' goes back by 0.99 s: episodes that"):
        write_lerobot([log], tmp_path / "out", fps=50, state=["x"], to="episodes")


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_of_what_was_known_before_an_episode_two_samples_are_read_and_none_from_before_a_reset(simulation):
    log = silo.open_log(simulated(simulation, resets=False))
    known = log._of_episode(log.episodes[2], known=True)
    assert known["x"].values.tolist() == list(range(209, 291))
    assert known["slow"].values.tolist() == [150, 200, 250]
    assert known["slow"].times.tolist() == pytest.approx([1.5, 2.0, 2.5])


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_what_came_before_a_reset_is_not_known_after_it(simulation):
    log = silo.open_log(simulated(simulation))
    known = log._of_episode(log.episodes[2], known=True)
    assert known["slow"].values.tolist() == [200, 250]
    assert known["slow"].times.tolist() == pytest.approx([0, 0.5])


def test_frames_of_slow_signals_alone_go_on_to_the_end_of_an_episode_also_where_ticks_are_uneven(tmp_path, new_logger):
    stamps = itertools.accumulate(itertools.cycle([9_000_000, 11_500_000, 9_500_000]))
    log = new_logger("arm", frequency=100, clock=stamps.__next__)
    slow, ended = log.array("slow", divider=10), log.array("ended", size=30, buffer="fixed")
    log.start()
    for tick in range(200):
        slow[...] = ended[...] = tick
        if tick in (25, 125):
            episode = log.episode("pick").__enter__()
        log.collect()
        if tick in (79, 179):
            episode.__exit__(None, None, None)
    log.stop()
    path = log.save().path
    given = {"fps": 100, "episodes": "episodes", "to": "episodes"}
    made = write_lerobot([path], tmp_path / "slow", state=["slow"], **given)
    assert (made.episodes, made.frames, made.short) == (2, 110, [])
    made = write_lerobot([path], tmp_path / "ended", state=["slow", "ended"], **given)
    assert made.short == [
        (f"{path}#0", "50 of 55 frames are not there: the last sample of '/log/ended' holds no longer")
    ]
    why = "its signals have no time in common: the last sample of '/log/ended' holds no longer when it begins"
    assert made.left_out == [(f"{path}#1", why)]


def test_no_frames_are_made_of_a_time_for_which_a_cut_had_a_signal_switched_off(tmp_path, new_logger):
    log = new_logger("arm", frequency=100, clock=itertools.count(0, 10_000_000).__next__)
    x, y = log.array("x", buffer="growing"), log.array("y", buffer="growing")
    log.start()
    for tick in range(120):
        if tick in (40, 80):
            log.set("y", enabled=tick == 80, cut=True)
        x[...] = y[...] = tick
        if tick == 90:
            episode = log.episode("pick").__enter__()
        log.collect()
    episode.__exit__(None, None, None)
    log.save()
    run = silo.open_log(tmp_path)
    given = {"fps": 50, "state": ["x", "y"], "to": "episodes"}
    why = r"'/log/y' was off, overwritten or not recorded from 0.4 s to 0.8 s: episodes that the program marks"
    with pytest.raises(silo.SaveError, match=why):
        write_lerobot([run], tmp_path / "runs", **given)
    made = write_lerobot([run], tmp_path / "marked", episodes="episodes", **given)
    assert (made.episodes, made.frames, made.left_out, made.short) == (1, 15, [], [])
    assert write_lerobot([run], tmp_path / "one", fps=2, state=["x", "y"], to="episodes").frames == 3


@given(st.lists(st.integers(1, 30), min_size=1, max_size=5), st.integers(0, 99))
def test_what_is_no_finite_number_is_in_no_statistic(sizes, seed):
    parts = [np.random.default_rng([seed, size]).normal(3, 10, (size, 3)) for size in sizes]
    for number, part in enumerate(parts):
        part[number % 3 :: 4, 0] = (np.nan, np.inf, -np.inf)[number % 3]
        part[:, 1] = np.nan if number else part[:, 1]
        part[:, 2] = np.nan
    found: dict = {}
    for part in parts:
        found = merged(found, [("x", Moments.of(part))])
    told, whole = found["x"].told(), np.concatenate(parts)
    for place, numbers in enumerate(column[np.isfinite(column)] for column in whole.T):
        for name, of in (("min", np.min), ("max", np.max), ("mean", np.mean), ("std", np.std)):
            assert told[name][place] == pytest.approx(of(numbers) if len(numbers) else np.nan, abs=1e-9, nan_ok=True)
    weights = [np.isfinite(part[:, 0]).sum() for part in parts]
    medians = [np.median(part[np.isfinite(part[:, 0]), 0]) if some else 0 for part, some in zip(parts, weights)]  # noqa: B905
    assert told["q50"][0] == pytest.approx(
        np.average(medians, weights=weights) if any(weights) else np.nan, nan_ok=True
    )
    assert (told["count"], tuple(told)) == ([len(whole)], TEN)


# ------------------------------------------------------------------------------------------------------- a data set


def test_a_policy_has_numbers_to_scale_by_where_some_samples_are_none(tmp_path, new_logger):
    log = new_logger("arm", frequency=100, clock=itertools.count(10**18, 10_000_000).__next__)
    q, none = log.array("q", 3), log.array("none")
    log.start()
    for tick in range(50):
        q[:] = tick, np.nan if tick == 7 else tick, 1e300 if tick == 9 else tick
        none[...] = np.nan
        log.collect()
    path = log.save().path
    made = write_lerobot([path], tmp_path / "data", fps=100, state=["q", "none"], window=["q"])
    words = "'q_y' in 1 of 50 frames, 'q_z' in 1 of 50 frames"
    told = f"no finite numbers: {words}, 'none' in 50 of 50 frames (observation.state); {words} (observation.q)"
    assert made.not_finite == [(str(path), told)]
    stats = json.loads((tmp_path / "data/meta/stats.json").read_text())["observation.state"]
    assert stats["min"] == pytest.approx([0, 0, 0, np.nan], nan_ok=True)
    assert stats["mean"] == pytest.approx([24.5, 1218 / 49, 1216 / 49, np.nan], nan_ok=True)
    assert check_lerobot(tmp_path / "data") == []
    shown = CliRunner().invoke(cli, ["convert", str(path), str(tmp_path / "two"), "--to", "lerobot", "--fps", "50",
                                     "--state", "none"])  # fmt: skip
    assert f"warning: {path}: no finite numbers: 'none' in 25 of 25 frames (observation.state)" in shown.output


def test_every_value_is_the_one_of_the_run_at_that_time(runs, made):
    assert (made.episodes, len(made.left_out), made.lost) == (2, 1, 0)
    assert made.left_out[0][0].endswith("run1.silo")
    assert check_lerobot(made.path) == []
    table = pq.read_table(made.path / "data/chunk-000/file-000.parquet")
    rows = pq.read_table(made.path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for row, path in zip(rows, (runs[0], runs[2]), strict=True):
        run = silo.open_log(path)
        part = table.slice(row["dataset_from_index"], row["length"])
        times = np.arange(row["length"]) / FPS + 1e-7
        state = np.concatenate([run["joints/q"].value(times), run["speed"].value(times)[:, None]], axis=1)
        assert np.array_equal(np.array(part["observation.state"].to_pylist()), state.astype(np.float32))
        assert np.array_equal(np.array(part["action"].to_pylist()), run["cmd"].value(times))
        assert part["observation.camera"].to_pylist() == run["camera"].value(times).tolist()
        newest = np.array(part["observation.joints.q"].to_pylist())[:, -1]
        assert np.array_equal(newest, run["joints/q"].value(times).astype(np.float32))
        assert part["timestamp"].to_numpy() == pytest.approx(np.arange(row["length"]) / FPS)
        assert row["silo/source"] == str(path)
        for name in ("observation.state", "action", "timestamp", "index"):
            values = np.array(part[name].to_pylist(), float).reshape(row["length"], -1)
            np.testing.assert_allclose(row[f"stats/{name}/mean"], values.mean(0), rtol=1e-6, atol=1e-6)
            np.testing.assert_allclose(row[f"stats/{name}/q99"], np.quantile(values, 0.99, axis=0), rtol=1e-6)
    assert rows[1]["dataset_to_index"] == len(table) == made.frames
    assert [row["tasks"] for row in rows] == [["with 0"], ["with 2"]]
    tasks = pq.read_table(made.path / "meta/tasks.parquet").to_pandas()
    assert tasks.iloc[1].name == "with 2"
    assert table["task_index"].to_numpy()[-1] == 1


def test_the_head_says_what_the_columns_are(made):
    info = json.loads((made.path / "meta/info.json").read_text())
    stats = json.loads((made.path / "meta/stats.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", FPS, "arm")
    assert info["splits"] == {"train": "0:2"}
    state = info["features"]["observation.state"]
    assert state["names"] == ["joints/q_x", "joints/q_y", "joints/q_z", "speed"]
    assert state["units"] == ["rad", "rad", "rad", "-"]
    assert {name: (one["dtype"], one["shape"]) for name, one in info["features"].items()} == {
        "observation.state": ("float32", [4]),
        "action": ("float32", [2]),
        "observation.camera": ("string", [1]),
        "observation.ok": ("bool", [1]),
        "observation.joints.q": ("float32", [7, 3]),
        "timestamp": ("float32", [1]),
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), ("int64", [1])),
    }
    assert set(stats) == set(info["features"]) - {"observation.camera"}
    assert all(tuple(one) == TEN for one in stats.values())


def test_others_read_it(made):
    datasets = pytest.importorskip("datasets")
    read = datasets.load_dataset("parquet", data_files=str(made.path / "data/*/*.parquet"), split="train")
    assert len(read) == made.frames
    assert len(read[0]["observation.joints.q"]) == 7


# ---------------------------------------------------------------------------------------------- what is refused


def test_a_file_per_episode_holds_the_same_frames(runs, made, tmp_path):
    arguments = {"fps": FPS, "state": ["joints/*", "speed"], "action": ["cmd"], "also": ["camera", "ok"], "where": "ok"}
    write_lerobot(runs, tmp_path / "out", to="episodes", task="pick", window=["joints/q"], **arguments)
    told = json.loads((tmp_path / "out" / "episodes.json").read_text())
    frames_of = pq.read_table(next(made.path.glob("data/*/*.parquet"))).to_pydict()
    assert [one["frames"] for one in told["episodes"]] == [
        frames_of["episode_index"].count(0), frames_of["episode_index"].count(1)
    ]  # fmt: skip
    arrays = [np.load(tmp_path / "out" / one["file"]) for one in told["episodes"]]
    for feature in told["features"]:
        whole = np.concatenate([one[feature["name"]] for one in arrays])
        np.testing.assert_array_equal(whole, np.array(frames_of[feature["name"]], whole.dtype).reshape(whole.shape))
    assert {one["task"] for one in told["episodes"]} == {"pick"}
    assert arrays[0]["timestamp"][1] == 1 / FPS
    write_lerobot(runs[:1], tmp_path / "out", to="episodes", force=True, **arguments)
    assert len(list((tmp_path / "out").glob("*.npz"))) == 1


def test_a_run_that_was_cut_is_there_once_however_many_of_its_parts_are_given(tmp_path, new_logger):
    log = new_logger(frequency=100, clock=itertools.count(0, 10_000_000).__next__)
    x = log.array("x")
    log.start()
    for tick in range(300):
        x[...] = tick
        if tick in (100, 200):
            log.set("x", size=1000 + tick, cut=True)
        log.collect()
    log.stop()
    log.save()
    parts = sorted(tmp_path.glob("*_part?.silo"))
    made = write_lerobot(parts, tmp_path / "set", fps=FPS, state=["x"])
    alone = write_lerobot(parts[:1], tmp_path / "alone", fps=FPS, state=["x"])
    assert (len(parts), made.episodes, made.frames) == (3, 1, alone.frames)
    assert [source for source, _ in made.left_out] == [str(part) for part in parts[1:]]
    assert all(f"the same run as {parts[0]}" in why for _, why in made.left_out)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"state": []}, "at least one signal of the state"),
        ({"fps": 0}, "fps must be a whole number from 1"),
        ({"how": "window"}, "how must be 'last' or 'mean'"),
        ({"state": ["joint/q"]}, "nothing was written: .*run0.silo: no signal is meant by 'joint/q'; did you mean"),
        ({"state": ["camera"]}, "'/log/camera' holds text, no numbers; name it in `also`"),
        ({"also": ["mixed"]}, "'/log/mixed' holds values of several types, no numbers; name its parts"),
        ({"also": ["huge"]}, "'/log/huge': 18446744073709551615 is more than a whole number of a data set holds"),
        ({"also": ["speed"], "window": ["speed"]}, "'observation.speed' is asked for twice"),
        ({"where": "speed > 100"}, "'speed > 100' is not true at its end"),
    ],
)
def test_what_can_not_be_is_refused_and_nothing_is_left(runs, tmp_path, given, words):
    with pytest.raises(silo.SiloError, match=words):
        write_lerobot(runs, tmp_path / "out", **({"fps": FPS, "state": ["joints/q"]} | given))
    assert list(tmp_path.iterdir()) == []


def test_runs_of_another_kind_are_told_apart(runs, tmp_path, new_logger):
    log = new_logger("other")
    log.array("q", 4, group="joints")
    log.start()
    log.collect()
    other = log.save(name="other").path
    with pytest.raises(
        silo.ElementError, match=r"other.silo': 'observation.state' is float32 \[3\] in the first run and"
    ):
        write_lerobot([runs[0], other], tmp_path / "out", fps=FPS, state=["joints/q"])
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("to", ["lerobot", "episodes"])
def test_words_of_enumerations_are_told_and_runs_in_which_they_contradict_are_refused(tmp_path, to):
    def run(labels):
        values = np.arange(100) % 2
        return silo.Log(Recording("dog", np.arange(100) * 10**7, 100, [element("m", values, labels=labels)]))

    stand, more, swapped = {0: "STAND"}, {0: "STAND", 1: "TROT"}, {0: "TROT", 1: "STAND"}
    given = {"fps": FPS, "state": ["m"], "also": ["m"], "to": to}
    write_lerobot([run(stand), run(more)], tmp_path / "out", **given)
    head = json.loads((tmp_path / "out" / ("meta/info.json" if to == "lerobot" else "episodes.json")).read_text())
    features = head["features"]
    features = features if to == "lerobot" else {one["name"]: one for one in features}
    for name in ("observation.state", "observation.m"):
        assert features[name]["labels"] == {"m": {"0": "STAND", "1": "TROT"}}
    with pytest.raises(silo.ElementError, match=r"'m' of 'observation.state' .*0 is STAND, then TROT; 1 is TROT, then"):
        write_lerobot([run(more), run(swapped)], tmp_path / "none", **given)
    assert not (tmp_path / "none").exists()


def test_only_a_data_set_is_replaced_and_only_if_asked(runs, tmp_path):
    def write(**more):
        return write_lerobot(runs[:1], tmp_path / "out", fps=FPS, state=["joints/q"], **more)

    write()
    with pytest.raises(silo.SaveError, match="exists already"):
        write()
    assert write(force=True).episodes == 1
    (tmp_path / "out/meta/info.json").unlink()
    with pytest.raises(silo.SaveError, match="no data set: it is not replaced"):
        write(force=True)


def changed(path, column, row, value):
    table = pq.read_table(path)
    values = table[column].to_pylist()
    values[row] = value
    place = table.schema.get_field_index(column)
    pq.write_table(
        table.set_column(place, table.schema.field(place), pa.array(values, table.schema.field(place).type)), path
    )


DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
DAMAGE = {  # the column, where, the row that is changed, to what
    "timestamp": (DATA, 5, 9.0, ["frame 5: timestamp 9 s, frame_index / fps is 0.166667 s"]),
    "index": (DATA, 3, 0, ["frames from 0 on: index isn't continuous"]),
    "frame_index": (DATA, 0, 1, ["frame 0: timestamp 0 s, frame_index / fps is 0.0333333 s",
                                 "episode 0: frame_index doesn't count from its first frame"]),
    "episode_index": (DATA, -1, 7, ["frames from 0 on: episode 7, there are 2"]),
    "task_index": (DATA, 0, 2, ["frames from 0 on: task_index up to 2, there are 2 tasks"]),
    "action": (DATA, 0, None, ["'action': 1 values are missing from frame 0 on: batches can't be made"]),
    "length": (EPISODES, 0, 3, ["episode 0 says frames 0 to 60; 3 from 0 on end at 3"]),
    "dataset_to_index": (EPISODES, 1, 99, ["episode 1 says frames 60 to 99; 75 from 60 on end at 135",
                                           "info.json says total_frames 135, there are 99",
                                           "the data has 135 frames, the episodes have 99"]),
}  # fmt: skip


@pytest.mark.parametrize("column", DAMAGE)
def test_what_its_loader_would_take_is_found(made, tmp_path, column):
    file, row, value, words = DAMAGE[column]
    copy = shutil.copytree(made.path, tmp_path / "copy")
    pq.write_table(pq.read_table(copy / DATA), copy / DATA)  # both episodes in one piece
    assert check_lerobot(copy) == []
    changed(copy / file, column, row, value)
    problems = check_lerobot(copy)
    assert problems == words or (value is None and "can't be read" in problems[0])  # by an older pyarrow


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (
            lambda meta: (meta / "stats.json").unlink(),
            r"stats.json, by which a policy scales its inputs, can't be read: ",
        ),
        (
            lambda meta: (meta / "stats.json").write_bytes(b'{"action": {"mean": [0'),
            r"stats.json, by which .* can't be read",
        ),
        (
            lambda meta: (meta / "stats.json").write_text(
                (meta / "stats.json").read_text().replace('"mean": [', '"mean": [null, ', 1)
            ),
            r"stats.json has null in mean of observation.state: its loader makes no numbers of it",
        ),
        (lambda meta: (meta / "stats.json").write_bytes(b"{}"), r"stats.json lacks mean, std, min or max of .*action"),
        (
            lambda meta: pq.write_table(pa.table({"other": [1]}), meta / "tasks.parquet"),
            r"what is known of tasks and episodes can't be read: tasks.parquet has no whole numbers task_index$",
        ),
        (
            lambda meta: pq.write_table(pa.table({"episode_index": [0]}), next(meta.glob("episodes/*/*.parquet"))),
            r"file-000.parquet has no whole numbers dataset_from_index, dataset_to_index, length$",
        ),
    ],
)
def test_what_a_policy_and_the_loader_need_beside_the_frames_is_found(made, tmp_path, damage, words):
    copy = shutil.copytree(made.path, tmp_path / "copy")
    damage(copy / "meta")
    (problem,) = check_lerobot(copy)
    assert re.search(words, problem)


def test_a_head_that_says_something_else_is_found(made, tmp_path):
    copy = shutil.copytree(made.path, tmp_path / "copy")
    head = copy / "meta/info.json"
    whole = json.loads(head.read_text())
    features, read = whole["features"], "version v3.0 with a positive number is read"
    others = {name: one for name, one in features.items() if name != "action"} | {"more": {}}
    for change, words in (
        ({"total_episodes": 3}, ["info.json says total_episodes 3, there are 2"]),
        ({"codebase_version": "v2.1"}, [f"version v2.1 at 30 frames/s: {read}"]),
        ({"fps": 0}, [f"version v3.0 at 0 frames/s: {read}"]),
        ({"features": {}}, ["features lack timestamp, frame_index, episode_index, index, task_index"]),
        ({"features": others}, [f"{DATA}: 'action' is no feature", f"{DATA}: 'more' is missing"]),
        (
            {"features": features | {"observation.state": features["observation.state"] | {"shape": [2]}}},
            ["'observation.state' has 4 numbers a frame, its feature says [2]"] * 2,
        ),
    ):
        head.write_text(json.dumps(whole | change))
        assert check_lerobot(copy) == words
    head.write_text("{")
    with pytest.raises(silo.errors.FileFormatError, match=r"info.json'"):
        check_lerobot(copy)
    with pytest.raises(silo.errors.LogNotFoundError, match="no data set"):
        check_lerobot(tmp_path)


@pytest.mark.slow
def test_rerun_finds_its_file_whole_with_what_was_told(runs, tmp_path):
    pytest.importorskip("rerun")
    recording = replace(silo.open_log(runs[0]).recording, warnings=("a wheel was loose",), stretch=Stretch("1f", 2))
    silo.Log(recording).save(tmp_path / "run.rrd")

    def said(*arguments):
        command = [sys.executable, "-m", "rerun", "rrd", *arguments, tmp_path / "run.rrd"]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
        return ran.stdout + ran.stderr

    assert "1 file verified without error" in said("verify")
    assert "/log/joints/q: 2" in said("stats")
    everything = said("print", "-vvv")
    assert "a wheel was loose" in everything
    assert "part 2 of run 1f" in everything
    assert "0/399.png" in everything


def test_duckdb_reads_it(made):
    duckdb = pytest.importorskip("duckdb")
    with duckdb.connect() as database:
        (frames_there, last), = database.execute(
            f"select count(*), max(frame_index) from '{made.path}/data/**/*.parquet'"
        ).fetchall()  # fmt: skip
        (episodes,) = database.execute(f"select count(*) from '{made.path}/meta/episodes/**/*.parquet'").fetchone()
    assert (frames_there, episodes) == (made.frames, made.episodes)
    assert last == max(pq.read_table(f"{made.path}/data").column("frame_index").to_pylist())
