"""Episodes of runs: as a list from the index, and as those of a data set."""

import itertools
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.datasets.check import check_lerobot
from silo.datasets.lerobot import write_lerobot
from silo.run_index.apart import what_tells
from silo.run_index.facts import RunFacts, SignalFacts
from silo.run_index.listed import ListedRun
from tests.later import Later

pq = Later("pyarrow.parquet")


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Two runs of 100 Hz with episodes of 100 ticks: good, bad, to be done again, and one that a kill cut."""
    folder = tmp_path_factory.mktemp("logs")
    for number in range(2):
        clock = itertools.count(1_700_000_000_000_000_000 + number * 3600 * 10**9, 10_000_000).__next__
        log = silo.Logger("arm", frequency=100, folder=folder, script=folder / "none.yaml", clock=clock)
        q, success = log.array("q", 2, unit="rad"), log.array("success", dtype=bool)
        log.array("slow", divider=7)
        word = np.array("abc", "U5")
        log.add(word, "word")
        log.array("last", size=20, buffer="looping")  # that it holds all of the episode that was cut, and no more
        log.start()

        def ticks(count, log=log, q=q, success=success, word=word):
            for _ in range(count):
                q[:], success[...], word[...] = log.ticks, True, str(log.ticks)
                log.collect()

        ticks(50)
        for verdict in (True, False, None):
            with log.episode("pick", verdict, speed=0.1 * (number + 1), object="cup" if verdict else "ball"):
                ticks(1)
                if verdict is False:
                    log.mark("slips")
                ticks(99)
                if verdict is False:
                    log.mark("slipped")
            ticks(10)
        log.mark('episode "pick" redo')
        log.episode("place", wet=True).__enter__()
        ticks(20)
        log.save("silo", name=f"run{number}")
        log.close()
    return folder


def test_episodes_of_the_index_are_those_of_the_logs(root):
    runs = silo.runs(root)
    assert [run.facts.episodes for run in runs] == [tuple(silo.open_log(run.path).episodes) for run in runs]
    found = runs.episodes()
    assert [(one.facts.task, one.episode.number, one.episode.verdict, one.facts.ticks) for one in found] == [
        ("pick", 0, "good", 100), ("pick", 1, "bad", 100), ("pick", 2, "redo", 100),
        ("place", 3, "", 20)] * 2  # fmt: skip
    assert found.size_bytes == runs.size_bytes == sum(run.path.stat().st_size for run in runs)
    for one in found:
        part = one.open()
        assert part["q"].values[:, 0].tolist() == list(range(one.episode.first, one.episode.last + 1))
    assert found[0].begun == runs[0].begun.fromtimestamp(runs[0].begun.timestamp() + 0.5).astimezone()


@pytest.mark.parametrize(
    ("where", "count"),
    [("success", 2), ("good and speed > 0.15", 1), ("not success", 6), ("redo", 2), ("wet", 2), ("span < 0.5", 2)],
)
def test_conditions_speak_of_episodes(root, where, count):
    assert len(silo.runs(root).episodes().where(where)) == count


def test_each_signal_of_an_episode_is_in_the_index_as_its_part_of_the_log_has_it(root):
    found = silo.runs(root).episodes()
    assert len({len(one.signals) for one in found}) == 1
    for one in found:
        log = one.open()
        for signal in one.signals:
            values = np.asarray(log[signal.name].values)
            assert signal.count == len(values), signal
            if signal.kind == "text" or not len(values):
                assert (signal.least, signal.last) == (None, None)
                continue
            numbers = values.astype(float)
            wanted = (numbers.min(), numbers.max(), numbers.mean(), numbers.std(), np.sqrt((numbers**2).mean()))
            told = (signal.least, signal.most, signal.mean, signal.std, signal.rms, signal.last)
            np.testing.assert_allclose(told, (*wanted, numbers[-1]), rtol=1e-12, atol=1e-12)
    assert [one.facts.in_episodes[0].overwritten for one in found] == [1, 1, 1, 0] * 2
    assert {signal.unit for signal in found[0].signals if signal.element == "/log/q"} == {"rad"}


def test_conditions_on_signals_limits_and_marks_are_judged_by_the_episode(root):
    runs = silo.runs(root)
    found = runs.episodes()
    most = [float(one.open()["q_0"].values.max()) for one in found]
    assert found.values("max(q)") == most
    assert len(set(most)) == 4
    assert [one.episode.number for one in found.where("150rad < max(q_0) < 300")] == [1, 1]
    assert [one.facts.marks for one in found] == [0, 2, 0, 0] * 2
    assert [one.facts.marks for one in runs] == [2, 2]
    assert [one.signals for one in found[:2]] == found[:2].signals()
    mixed = silo.runs(root)
    assert mixed.values("max(q_0)") != found.values("max(q_0)")[:2]


def test_sql_has_the_signals_of_episodes(root):
    pytest.importorskip("duckdb")
    asked = (
        "select run, number, verdict, max from episode_signals join episodes using (run, number)"
        " where signal = 'q_0' order by run, number"
    )
    found = silo.runs(root).episodes()
    wanted = [
        (one.facts.path, one.episode.number, one.episode.verdict, one.open()["q_0"].values.max()) for one in found
    ]
    assert silo.runs(root).sql(asked).rows() == wanted


def test_what_tells_bad_episodes_from_good_ones_is_the_correlation_with_the_group(root):
    found = silo.runs(root).episodes().where("span > 0.5")
    bad, rest = found.where("bad or redo"), found.where("good")
    told = {one.what: one for one in bad.apart(found)}
    assert "success" not in told
    assert "word" not in told
    for what, how, numbers in [("marks", "", [one.facts.marks for one in (*bad, *rest)]),
                               ("q_0", "max", [one.open()["q_0"].max() for one in (*bad, *rest)])]:  # fmt: skip
        one = told[what]
        assert (one.how, one.these, one.others) == (how, np.median(numbers[:4]), np.median(numbers[4:]))
        assert one.apart == pytest.approx(np.corrcoef(numbers, [1, 1, 1, 1, 0, 0])[0, 1])
    far = [abs(one.apart) for one in bad.apart(rest)]
    assert far == sorted(far, reverse=True)
    assert [one.apart for one in rest.apart(bad)] == pytest.approx([-one.apart for one in bad.apart(rest)])
    with pytest.raises(silo.ElementError, match=r"2 runs can't be told from 0"):
        rest.apart(rest)


def known(prefix, span_s=1.0, **most):
    """A run of a logger, and of each signal its largest value."""
    signals = [
        SignalFacts(f"{prefix}/{name}", f"{prefix}/{name}", "m", 1, None, value, None, None, None, None, kind)
        for name, value in most.items()
        for kind in ["enum" if name == "mode" else "number"]
    ]
    return ListedRun(RunFacts(f"{prefix}.silo", prefix=prefix, span_s=span_s), Path()), signals


def test_groups_are_told_apart_by_what_both_have_whatever_its_size():
    these = [known("/a", 2.0, x=3e300, one=1.0, same=0.1 + 0.2, mode=5.0), known("/b", 2.0, x=1e300, one=2.0, same=0.3)]
    others = [known("/a", 1.0, x=1e300, other=4.0, same=0.3, mode=1.0), known("/a", 1.5, x=None, same=0.3)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = what_tells(these, others)
    assert [one.what for one in found] == ["span", "x"]
    assert (found[0].how, found[0].unit, found[0].these, found[0].others) == ("", "s", 2.0, 1.25)
    assert found[0].apart == pytest.approx(np.corrcoef([2, 2, 1, 1.5], [1, 1, 0, 0])[0, 1])
    assert (found[1].how, found[1].unit, found[1].these, found[1].others) == ("max", "m", 2e300, 1e300)
    assert found[1].apart == pytest.approx(np.corrcoef([3, 1, 1], [1, 1, 0])[0, 1])


def test_the_command_says_what_tells_episodes_apart_and_what_is_not_kept(root, tmp_path):
    ran = CliRunner().invoke(cli, ["runs", str(root), "--episodes", "--where", "bad", "--against", "good"])
    assert ran.exit_code == 0, ran.output
    assert ran.output.splitlines()[0].split() == ["SIGNAL", "HOW", "UNIT", "THESE", "OTHERS", "APART"]
    assert any(line.split() == ["q_0", "max", "rad", "259", "149", "+1.00"] for line in ran.output.splitlines()), (
        ran.output
    )
    words = ["runs", str(root), "--episodes", "-w", "place", "--against", "good", "--where", "wet"]
    assert "2 runs can't be told from 0" in CliRunner().invoke(cli, words).output
    listed = CliRunner().invoke(cli, ["runs", str(root), "--episodes"]).output.splitlines()
    assert ["(1 signal overwritten)" in line for line in listed[1:-1]] == [True, True, True, False] * 2
    told = json.loads(CliRunner().invoke(cli, [*words[:3], "--where", "bad", "--against", "good", "--json"]).output)
    assert {"what": "marks", "how": "", "unit": "", "these": 2.0, "others": 0.0, "apart": 1.0} in told


def test_the_command_has_a_line_for_each(root):
    ran = CliRunner().invoke(cli, ["runs", str(root), "--episodes", "--where", "bad or redo", "-w", "ball"])
    assert ran.exit_code == 0, ran.output
    lines = ran.output.splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == ["run0.silo#1", "run0.silo#2", "run1.silo#1", "run1.silo#2"]
    assert lines[-1].startswith("4 episodes")
    told = json.loads(CliRunner().invoke(cli, ["runs", str(root), "--episodes", "--json"]).output)
    assert [one["episodes"][0]["name"] for one in told] == ["pick", "pick", "pick", "place"] * 2
    assert CliRunner().invoke(cli, ["runs", str(root), "--where", "episodes == 4"]).output.count(".silo") == 2


def test_an_episode_has_its_own_ticks_where_the_clock_of_a_simulation_begins_anew_with_each(tmp_path, new_logger):
    now = [0.0]
    log = new_logger("sim", frequency=100, clock=lambda: now[0])
    x, slow = log.array("x"), log.array("slow", divider=3)
    log.start()
    for number in range(3):
        for tick in range(50):
            now[0] = tick * 0.01
            if tick == 10:
                episode = log.episode("run", number=number)
                episode.__enter__()
            x[...] = slow[...] = 100 * number + tick
            log.collect()
            if tick == 39:
                episode.__exit__(None, None, None)
    path = log.save("silo", name="resets").path
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", silo.LogWarning)  # of the clock
        read = silo.open_log(path)
    truth = [np.arange(100 * number + 10, 100 * number + 40) for number in range(3)]
    rest = [[one[of] for of in range(30) if (50 * place + 10 + of) % 3 == 0] for place, one in enumerate(truth)]
    with pytest.warns(silo.LogWarning, match=r"maybe of several episodes; log.clip\(log.episodes\[0\]\) is one"):
        assert len(read.clip(read.episodes[0].start_s, read.episodes[0].stop_s)["x"]) == 90
    parts = [read.clip(one) for one in read.episodes]
    assert [part["x"].values.tolist() for part in parts] == [one.tolist() for one in truth]
    assert [part["slow"].values.tolist() for part in parts] == rest
    assert [part.start_ns for part in parts] == [read.start_ns] * 3
    with pytest.raises(silo.ElementError, match="an episode has its end"):
        read.clip(read.episodes[0], 0.3)
    with pytest.raises(silo.ElementError, match="no tick of episode 'run', which goes from tick 10 to 39"):
        parts[1].clip(read.episodes[0])
    listed = silo.runs(tmp_path).episodes()
    assert [one.open()["x"].values.tolist() for one in listed] == [one.tolist() for one in truth]
    facts = [{signal.name: (signal.count, signal.least, signal.most) for signal in one.signals} for one in listed]
    assert [one["/log/x"] for one in facts] == [(30, values[0], values[-1]) for values in truth]
    assert [one["/log/slow"] for one in facts] == [(10, values[0], values[-1]) for values in rest]
    made = write_lerobot([path], tmp_path / "set", fps=100, state=["x"], to="episodes", episodes="episodes")
    for number, values in enumerate(truth):
        frames = np.load(made.path / f"episode_{number:06d}.npz")["observation.state"]
        assert frames.ravel().tolist() == values.tolist()


def test_a_data_set_has_the_marked_episodes_without_those_to_be_done_again(root, tmp_path):
    words = ["--to", "lerobot", "--fps", "50", "--state", "q", "--episodes", "episodes", "--where", "success"]
    runs = [str(root / f"run{number}.silo") for number in range(2)]
    ran = CliRunner().invoke(cli, ["convert", *runs, str(tmp_path / "set"), *words])
    assert ran.exit_code == 0, ran.output
    assert not check_lerobot(tmp_path / "set")
    (file,) = (tmp_path / "set" / "meta" / "episodes").glob("*/*.parquet")
    rows = pq.read_table(file).to_pylist()
    assert [(row["tasks"], row["length"], row["silo/episode"], row["silo/source"]) for row in rows] == [
        (["pick"], 50, 0, runs[0]), (["pick"], 50, 0, runs[1])]  # fmt: skip
    (data,) = (tmp_path / "set" / "data").glob("*/*.parquet")
    assert np.array(pq.read_table(data)["observation.state"].to_pylist())[:50, 0].tolist() == list(range(50, 150, 2))


@pytest.mark.parametrize(
    ("options", "count"),
    [({"episodes": "episodes"}, 6), ({"episodes": "episodes", "where": "speed > 0.15 and bad"}, 1), ({}, 2)],
)
def test_what_an_episode_is_and_which_count_is_said(root, tmp_path, options, count):
    made = write_lerobot(sorted(root.glob("*.silo")), tmp_path / "set", fps=50, state=["q"], to="episodes", **options)
    assert made.episodes == count


@pytest.mark.parametrize(
    ("given", "pieces", "tasks", "untold"),
    [
        ([], "runs", ["reach", "walk", ""], 1),
        (["--task", "all"], "runs", ["all", "all", "all"], 0),
        ([], "episodes", ["pick", "pick it up", "pick", "pick it up", "pick", "pick it up"], 0),
    ],
)
def test_the_task_of_an_episode_is_what_its_program_said_of_it_or_of_the_run(tmp_path, given, pieces, tasks, untold):
    for number, about in enumerate(({"task": "reach"}, {"task": "walk"}, {})):
        with silo.Logger("arm", frequency=100, folder=tmp_path, about=about, script=tmp_path / "none.yaml") as log:
            log.array("q", 2)
            log.start()
            for said in ({}, {"task": "pick it up"}):
                with log.episode("pick", **said):
                    for _ in range(50):
                        log.collect()
            log.save("silo", name=f"run{number}")
    words = ["--to", "lerobot", "--fps", "50", "--state", "q", "--episodes", pieces, *given]
    runs = [str(tmp_path / f"run{number}.silo") for number in range(3)]
    ran = CliRunner().invoke(cli, ["convert", *runs, str(tmp_path / "set"), *words])
    assert ran.exit_code == 0, ran.output
    assert not check_lerobot(tmp_path / "set")
    (file,) = (tmp_path / "set" / "meta" / "episodes").glob("*/*.parquet")
    assert [row["tasks"] for row in pq.read_table(file).to_pylist()] == [[task] for task in tasks]
    told = pq.read_table(tmp_path / "set" / "meta" / "tasks.parquet")["task"].to_pylist()
    assert told == list(dict.fromkeys(tasks))
    warning = f"warning: 1 episode without a task ({runs[2]}): name it with --task, or have the program say it"
    assert ran.stderr.count(warning) == ran.stderr.count("without a task") == untold


def test_runs_that_are_no_captures_are_none_of_a_data_set_of_captures(root, tmp_path):
    with pytest.raises(silo.SaveError, match="it is no capture"):
        write_lerobot(sorted(root.glob("*.silo")), tmp_path / "set", fps=50, state=["q"], episodes="captures")
