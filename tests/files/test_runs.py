"""The index of runs: what it says against the logs themselves, conditions against NumPy, labels, damage."""

import itertools
import json
import math
import os
import re
import shutil
import sqlite3
import threading
import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.analysis.reports import report
from silo.cli.group import cli
from silo.core.elements import LoggedEvent
from silo.core.episodes.words import Episode
from silo.core.quantities.writing import count
from silo.core.recording import Recording
from silo.core.tuning.parameters import ParameterChange
from silo.errors import ExpressionError, LogWarning, SiloError
from silo.files import write
from silo.run_index import finding, index, labels
from silo.run_index.archive import Archive
from silo.run_index.facts import EpisodeFacts, RunFacts, SignalFacts, by_run, facts_of, merged, read_facts, signals_of
from silo.run_index.finding import There
from silo.run_index.where import FACTS, FUNCTIONS, Query, said_by
from tests.stand_ins.saved import element, recorded_in_two

RUNS = 5


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Five runs below a folder: each with a larger torque, one marked, one in two formats, one without a signal."""
    root = tmp_path_factory.mktemp("logs")
    for number in range(RUNS):
        clock = itertools.count(1_700_000_000_000_000_000 + number * 86_400 * 10**9, 10_000_000).__next__
        folder = root / ("monday" if number < 3 else "tuesday")
        folder.mkdir(exist_ok=True)
        log = silo.Logger("anymal", frequency=100, folder=folder, script=root / "none.yaml", clock=clock,
                          about={"task": "walk" if number % 2 else "stand"})  # fmt: skip
        tau = log.array("tau", 3, group="joints", unit="Nm")
        if number < 4:
            good = log.array("success", dtype=bool)
        log.parameter("kp", 10.0 * number, min=0, max=100)
        log.start()
        for tick in range(20):
            tau[:] = number * np.sin(tick / 3 + np.arange(3))
            if number < 4:
                good[...] = number != 2
            log.collect()
        if number == 1:
            log.mark("pushed")
        log.save(("silo", "csv") if number == 3 else ("silo",), name=f"run{number}")
        log.close()
    return root


@pytest.fixture
def root(written, tmp_path):
    return shutil.copytree(written, tmp_path / "logs")


def names(runs):
    return [run.name for run in runs]


def test_the_index_says_what_the_logs_say(root):
    runs = silo.runs(root)
    assert names(runs) == [f"run{number}" for number in range(RUNS)]
    assert names(runs[1:3]) == ["run1", "run2"]
    for number, run in enumerate(runs):
        log = run.open()
        facts = run.facts
        assert run.key == (run.path, -1)
        assert (facts.robot, facts.task, facts.ticks, facts.lost) == (
            "anymal", "walk" if number % 2 else "stand", 20, 0)  # fmt: skip
        assert facts.span_s == pytest.approx(log.duration_s)
        assert facts.rate_hz == pytest.approx(19 / log.duration_s)
        assert facts.marks == (number == 1)
        assert facts.parameters == {"/log/kp": 10.0 * number}
        assert facts.elements == len(log)
        assert run.begun.timestamp() == pytest.approx(log.recording.started_ns * 1e-9)
        for signal in run.signals:
            values = np.asarray(log[signal.name]).astype(float)
            wanted = (values.min(), values.max(), values.mean(), values.std(), np.sqrt((values**2).mean()), values[-1])
            assert (signal.count, log[signal.name].unit) == (len(values), signal.unit)
            told = (signal.least, signal.most, signal.mean, signal.std, signal.rms, signal.last)
            np.testing.assert_allclose(told, wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("condition", "wanted"),
    [
        ("max(joints/tau) > 2.5", [3, 4]),
        ("max(joints/tau_x) > 2.5Nm", [3, 4]),
        ("max(joints/tau_x) > 2500mNm", [3, 4]),
        ("min(joints/tau) < -2.5 and success", [3]),
        ("not success", [2]),
        ("success or max(joints/tau) > 3.5", [0, 1, 3, 4]),
        ("1 < kp <= 20", [1, 2]),
        ("marks == 1", [1]),
        ("count(joints/tau) == 60 and lost == 0 and span < 1s", [0, 1, 2, 3, 4]),
        ("abs(last(joints/tau_x)) * 2 >= -1 * min(joints/tau_x)", None),
        ("tagged(wet)", []),
    ],
)
def test_a_condition_is_judged_by_the_index_alone(root, condition, wanted, monkeypatch):
    runs = silo.runs(root)
    if wanted is None:
        wanted = [
            number
            for number, run in enumerate(runs)
            if abs(run.open()["tau_x"].values[-1]) * 2 >= -run.open()["tau_x"].values.min()
        ]
    monkeypatch.setattr(index, "read_facts", None)
    assert names(silo.runs(root, where=condition)) == [f"run{number}" for number in wanted]


def test_limits_are_counted_by_how_often_they_were_broken_not_by_how_many_words_tell_of_it(tmp_path):
    told = ("/log/x >> 5 at tick 1, limit 4; within its limits again", "/log/x >> 6 at tick 2, limit 4, 9 times",
            "/log/x >> 6 at tick 2, limit 4, 10 times; within its limits again from tick 3 on",
            "/log/3 times << 1 at tick 2, limit 2")  # fmt: skip
    events = tuple(LoggedEvent("limit", text, tick=2) for text in told)
    events += (LoggedEvent("limit ended", "/log/x is within its limits again", tick=3),)
    recording = Recording("arm", np.arange(4), 4, [element("x", np.arange(4.0))], events=events)
    assert facts_of(recording, "run.silo", 7, tmp_path).run.limits == 1 + 9 + 10 + 1
    fired = [
        LoggedEvent("triggered", f"trigger 'fall' fired {text}", tick=1)
        for text in ("at tick 1", "3 times, at ticks 1 to 2")
    ]
    field = [
        LoggedEvent("limit", "in other words", tick=2, times=7),
        LoggedEvent("triggered", "likewise", tick=2, times=4),
    ]
    (path,) = [
        Path(one.path) for one in write(replace(recording, events=(*events, *fired, *field)), tmp_path, "arm", ["silo"])
    ]
    facts = read_facts(tmp_path, path.name, 7).run
    assert (facts.limits, facts.triggers) == (21 + 7, 1 + 3 + 4)


FACTS_OF_ONE = RunFacts(
    "a.silo", span_s=2.5, ticks=7, elements=3, rate_hz=400.0, lost=1, failed=2, marks=4, limits=5, triggers=6,
    warnings=8, episodes=(Episode("walk", 0, 6),), parameters={"kp": 20.0, "gait": "trot"},
)  # fmt: skip
SIGNALS_OF_ONE = [
    SignalFacts("/log/x", "/log/x", "m", 5, -2.0, 4.0, 1.0, 2.0, 3.0, 0.5),
    SignalFacts("/log/v_0", "/log/v", "s", 10, 1.0, 2.0, 1.5, 0.1, 0.2, 1.25),
    SignalFacts("/log/v_1", "/log/v", "s", 20, 0.0, 3.0, 1.5, 0.3, 0.4, 1.75),
    SignalFacts("/log/off", "/log/off", "-", 0, None, None, None, None, None, None),
    SignalFacts("/log/m", "/log/m", "-", 5, 0.0, 1.0, 0.5, 0.5, 0.5, 1.0, "enum", {0: "STAND", 1: "TROT"}),
]


def test_facts_take_no_room_for_what_a_run_has_not_and_never_change():
    part = EpisodeFacts(1, 2, 0, 4)
    kept = index._ENCODE(RunFacts("a.silo", in_episodes=(part,)))
    assert msgspec.msgpack.decode(kept) == {"path": "a.silo", "in_episodes": [[1, 2, 0, 4]]}
    for facts in (part, RunFacts("a.silo")):
        with pytest.raises(AttributeError, match="immutable"):
            facts.marks = 5


def query(text):
    return Query(
        text,
        {"/log/x": ["/log/x"], "/log/v": ["/log/v_0", "/log/v_1"], "/log/off": ["/log/off"], "/log/m": ["/log/m"]},
        {"wet", "kp", "gait"},
        (),
        said_by([{"/log/m": {"STAND", "TROT"}}, {"/log/m": {"WALK", "lost"}}], [{"gait": "trot"}, {"gait": "bound"}]),
    )


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        *zip(FACTS, (2.5, 7, 3, 400, 1, 2, 4, 5, 6, 1, 8), strict=True),
        ("min(x)", -2), ("max(x)", 4), ("mean(x)", 1), ("std(x)", 2), ("rms(x)", 3), ("last(x)", 0.5), ("x", 0.5),
        ("count(x)", 5), ("count(v)", 30), ("min(v)", 0), ("max(v)", 3), ("v_1", 1.75), ("max(v_0)", 2),
        ("abs(min(x))", 2), ("-min(x)", 2), ("max(x) - min(x)", 6), ("max(x) + 100cm", 5), ("100cm + max(x)", 500),
        ("max(x) % 3", 1), ("max(x) ** 2", 16), ("max(x) * 3", 12), ("max(x) / 8", 0.5), ("1 / (lost - 1)", math.nan),
        ("1 / (lost - 1) and lost", 0), ("1 / (lost - 1) or lost == 2", 0), ("lost == 2 and off", 0),
        ("count(x) == 5m", 1), ("max(v) > 2000ms", 1), ("abs(max(v)) > 4000ms", 0), ("max(x) * 3 == 12s", 1),
        ("tagged(wet)", 1), ("tagged(dry)", 0), ("wet", 1), ("kp", 20), ("off", math.nan), ("max(off)", math.nan),
        ("off > 1 or lost == 1", 1), ("lost == 2 or off", 0), ("off > 1 and lost == 1", math.nan),
        ("lost and marks", 1), ("lost and marks == 5", 0), ("lost == 2 or marks == 5", 0), ("not lost", 0),
        ("not (lost - 1)", 1), ("1 < marks < 5", 1), ("1 < marks < 4", 0), ("4 < marks < 9", 0), ("marks <= 4", 1),
        ("marks >= 4", 1), ("marks > 4", 0), ("marks != 4", 0), ("marks == 4", 1),
        ("m == TROT", 1), ("TROT == m", 1), ("m == STAND", 0), ("m != STAND", 1), ("last(m) == TROT", 1),
        ("min(m) == STAND", 1), ("max(m) == TROT and lost", 1), ("m == WALK", 0), ("m != WALK", 1), ("m == 1", 1),
        ("m == lost", 0), ("gait == trot", 1), ("gait == bound", 0), ("gait != bound", 1),
    ],
)  # fmt: skip
def test_what_a_word_of_a_condition_is(text, wanted):
    number = query(text).number(FACTS_OF_ONE, ("wet",), SIGNALS_OF_ONE)
    assert number == pytest.approx(wanted, nan_ok=True)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_word_of_a_condition_takes_one_name(function):
    query(f"{function}(x)")
    for arguments in ("", "x, x"):
        with pytest.raises(ExpressionError, match=function):
            query(f"{function}({arguments})")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("m == TROTT", "no run has 'TROTT'; did you mean 'TROT'"),
        ("x == TROT", "'TROT'"),
        ("m > TROT", "'TROT' is a word: it is compared by == and != with what has it"),
    ],
)
def test_a_word_that_the_other_side_never_has_is_none(text, says):
    with pytest.raises(ExpressionError, match=says):
        query(text)


def test_the_shell_takes_words_of_enumerations_and_of_parameters(tmp_path):
    def write(name, labels, last):
        values = np.array([0, last])
        log = silo.Log(Recording("dog", np.arange(2) * 10**9, 2, [element("m", values, labels=labels)]))
        log.save(tmp_path / f"{name}.silo")

    write("a", {0: "STAND", 1: "TROT"}, 1)
    write("b", {0: "TROT", 1: "STAND"}, 1)
    write("c", {0: "TROT", 1: "STAND"}, 0)
    for where, names in (("m == TROT", "ac"), ("last(m) != TROT", "b"), ("m == 0", "c")):
        assert sorted(run.name for run in silo.runs(tmp_path).where(where)) == [*names]


def test_the_shell_takes_the_words_of_a_text_that_was_tuned(tmp_path, new_logger):
    log = new_logger("dog", frequency=100)
    mode = log.parameter("mode", "stand")
    for word in ("stand", "walk"):
        mode.value = word
        log.start(unsaved="clear")
        log.collect()
        log.save(name=word)
        log.stop()
    for where, name in (("mode == walk", "walk"), ("mode != walk", "stand")):
        assert [run.name for run in silo.runs(log.options.folder).where(where)] == [name]


def test_the_signals_of_a_condition_are_all_that_its_names_mean_each_once():
    assert query("max(v) > x and lost and v_0 < x").signals == ["/log/v_0", "/log/v_1", "/log/x"]


@pytest.mark.parametrize(
    ("started_ns", "first_ns", "begun_ns"),
    [
        (10**18 + 5, 10**18, 10**18 + 5),
        (10**18, 10**18 + 3600 * 10**9, 10**18 + 3600 * 10**9),  # of what is held the first was an hour later
        (10**18, 10**9, 10**18),
        (0, 10**18, 10**18),
        (0, 10**9, 2 * 10**18 - 3 * 10**9),  # stamps of a clock that counts from its start: when it was written
    ],
)
def test_a_log_begins_with_its_first_stamp_or_with_its_run_where_stamps_are_no_times(
    tmp_path, started_ns, first_ns, begun_ns
):
    file = tmp_path / "run.silo"
    file.touch()
    os.utime(file, ns=(0, 2 * 10**18))
    stamps = first_ns + np.arange(4, dtype=np.int64) * 10**9
    changes = [
        ParameterChange((("/log/kp", None, 1.0), ("/log/kd", None, 0.2))),
        ParameterChange((("/log/kp", 1.0, 2.0),)),
    ]
    events = tuple(LoggedEvent("parameter", "", change=one) for one in changes)
    recording = Recording("arm", stamps, 4, [element("x", np.arange(4.0))], started_ns=started_ns, events=events)
    facts = facts_of(recording, "run.silo", 7, file).run
    assert (facts.begun_ns, facts.span_s, facts.rate_hz) == (begun_ns, 3.0, 1.0)
    assert facts.parameters == {"/log/kp": 2.0, "/log/kd": 0.2}


def test_a_run_is_known_by_its_file_though_nothing_was_told_of_it_yet(tmp_path, new_logger):
    log = new_logger()
    log.array("x")
    log.start()
    log.collect()
    run = log._present.run.id
    files = [Path(saved.path) for saved in log.save(("silo", "csv", "bag"))]
    for ending in ("npz", "parquet"):
        silo.open_log(files[0]).save(tmp_path / f"table.{ending}")
        files.append(tmp_path / f"table.{ending}")
    facts = [read_facts(file.parent, file.name, 1).run for file in files]
    assert {one.path: one.run for one in facts} == {file.name: run for file in files}
    recorded = msgspec.structs.replace(facts[0], path="r.mcap", recorder="r", part=1)
    assert len(by_run([facts[0], recorded])) == 1


def test_texts_and_signals_without_a_number_have_no_statistics(tmp_path, new_logger):
    log = new_logger()
    log.add(np.array("abc", "U5"), "word")
    log.array("gone")[...] = np.nan
    log.start()
    log.collect()
    log.save()
    (run,) = silo.runs(tmp_path)
    told = {signal.name: (signal.count, signal.least, signal.last) for signal in run.signals}
    assert told == {"/log/word": (1, None, None), "/log/gone": (0, None, None)}


@pytest.mark.parametrize(
    "values", [[1.0, 2.0, 5.0, 7.0], [1.0, math.nan, 5.0, 7.0], [1.0, math.inf, 5.0, 7.0], [-math.inf, math.inf, 1, 2]]
)
def test_the_numbers_of_pieces_together_are_those_of_the_whole(values):
    def of(some):
        stamps = np.arange(len(some), dtype=np.int64)
        recording = Recording("arm", stamps, len(some), [element("x", np.array(some))])
        return facts_of(recording, "run.silo", 7, Path()).signals

    (whole,), (found,) = of(values), signals_of([of(values[:2]), of(values[2:])])
    for field in ("count", "least", "most", "mean", "std", "rms", "last"):
        assert getattr(found, field) == (pytest.approx(one) if (one := getattr(whole, field)) is not None else None)


def test_a_number_of_each_run_is_nan_where_it_is_missing(root):
    values = silo.runs(root).values("last(success)")
    assert values[:4] == [1, 1, 0, 1]
    assert math.isnan(values[4])


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("max(joints/ta) > 1", "no run has 'joints/ta'; did you mean '/log/joints/tau"),
        ("mean(joints/tau) > 1", "'joints/tau' means 3 signals .*: name one"),
        ("max(joints/tau) > 1kg", "kg can't be compared with Nm"),
        ("max(joints/tau + 1) > 1", "max takes the name of one signal"),
        ("median(joints/tau_x) > 1", "there is no function 'median'"),
        ("max(joints/tau", "never closed"),
        ("quality > 1", f"no run has 'quality'; facts of a run are {', '.join(FACTS)}"),
    ],
)
def test_a_condition_that_means_nothing_says_where(root, condition, words):
    with pytest.raises(ExpressionError, match=words):
        silo.runs(root, where=condition)


def test_a_run_in_which_a_name_means_several_signals_is_left_out_and_told(tmp_path):
    for number, shape in enumerate([(), 3, ()]):
        log = silo.Logger("arm", folder=tmp_path, script=tmp_path / "no.yaml")
        x = log.array("x", shape)
        log.start()
        x[...] = number
        log.collect()
        log.save(name=f"run{number}")
        log.close()
    told = r"not known of run1.silo: there 'x' means 3 signals \(/log/x_x, /log/x_y, /log/x_z\): name one"
    with pytest.warns(silo.LogWarning, match=told):
        assert names(silo.runs(tmp_path, where="last(x) > 1")) == ["run2"]
    with pytest.warns(silo.LogWarning, match=told):
        assert [math.isnan(one) for one in silo.runs(tmp_path).values("last(x)")] == [False, True, False]
    said = CliRunner().invoke(cli, ["runs", str(tmp_path), "--where", "last(x) > 1"])
    assert (said.exit_code, said.stdout.count("run2.silo"), said.stdout.count("run1.silo")) == (0, 1, 0)
    assert re.fullmatch(f"warning: {told}\n", said.stderr)
    with pytest.raises(ExpressionError, match="name one"):
        silo.runs(tmp_path)[1:2].where("last(x) > 1")


def test_runs_are_found_by_words_and_times(root):
    runs = silo.runs(root)
    runs[2].tag("wet", "slip")
    runs[3].note("Fell on the Stairs")
    assert names(runs.find("walk")) == ["run1", "run3"]
    assert names(runs.find("anymal", "stairs")) == ["run3"]
    assert (
        names(runs.find("wet")) == names(runs.where("wet")) == names(silo.runs(root, where="tagged(slip)")) == ["run2"]
    )
    days = [run.begun for run in runs]
    assert names(runs.between(days[1], days[3])) == ["run1", "run2"]
    assert names(runs.between(f"{days[0]:%Y-%m-%d}", f"{days[4]:%Y-%m-%d}")) == names(runs)
    assert names(runs.between(until="2001-01-02 14:00")) == []
    assert names(silo.runs(root, since=days[4].timestamp() - 1e-5)) == ["run4"]
    with pytest.raises(silo.ElementError, match="since must be a date or time, got 'yesterday'"):
        runs.between("yesterday")


def test_what_changed_is_read_again_and_nothing_else(root, monkeypatch):
    silo.runs(root)
    read = []
    monkeypatch.setattr(index, "read_facts", lambda *given: read.append(given[1]) or read_facts(*given))
    assert len(silo.runs(root)) == RUNS
    assert read == []
    (root / "monday/run0.silo").unlink()
    os.utime(root / "monday/run1.silo", ns=(1, 1))
    shutil.copy(root / "monday/run2.silo", root / "tuesday/again.silo")
    assert len(silo.runs(root)) == RUNS
    assert sorted(read) == ["monday/run1.silo", "tuesday/again.silo"]
    read.clear()
    silo.runs(root, rebuild=True)
    assert len(read) == RUNS


def test_of_one_logger_the_run_number_decides_which_run_is_older(tmp_path, new_logger):
    zero_ns = time.time_ns() // 10**9 * 10**9
    for name, begins_s in (("arm", (30,)), ("bot", (50, 20, 60))):
        for number, begin_s in enumerate(begins_s, 1):  # the clock was set back before the second
            clock = itertools.count(zero_ns + begin_s * 10**9, 10**7).__next__
            log = new_logger(name, folder=tmp_path, clock=clock)
            log.array("x")
            log.start()
            log.collect()
            log.save(name=f"{name}_20261129_16-00-{begin_s}_{number:05}")
    runs = silo.runs(tmp_path)
    found = [(run.name.partition("_")[0], (run.facts.begun_ns - zero_ns) // 10**9) for run in runs]
    assert found == [("arm", 30), ("bot", 50), ("bot", 20), ("bot", 60)]


def test_a_log_that_can_not_be_read_is_listed_with_the_reason(root):
    (root / "broken.silo").write_bytes(b"#  ---\nnothing")
    (root / "x.mcap").write_bytes(b"\x89MCAP0\r\n")
    broken = [run for run in silo.runs(root) if run.facts.problem]
    assert sorted(names(broken)) == ["broken", "x"]
    for run in broken:
        told = {"path", "kind", "begun_ns", "size_bytes", "problem"}
        assert {name for name in RunFacts.__struct_fields__ if getattr(run.facts, name)} == told
    assert silo.runs(root, where="max(joints/tau) > 2.5")[0].name == "run3"


@pytest.mark.parametrize("damage", [b"", b"no database at all, but a text of some length" * 99])
def test_an_index_that_is_damaged_or_gone_is_made_anew(root, damage):
    before = silo.runs(root).values("max(joints/tau)")
    file = root / index.NAME
    file.write_bytes(damage) if damage else file.unlink()
    assert silo.runs(root).values("max(joints/tau)") == before
    assert file.stat().st_size > 4096


def test_an_index_that_is_asked_behind_its_end_is_not_taken_for_damaged(root):
    silo.runs(root)
    opened = index.RunIndex(root)
    opened.close()
    with pytest.raises(sqlite3.ProgrammingError):
        opened.runs()
    assert (root / index.NAME).is_file()


@pytest.mark.parametrize("begin", [1, 3])
def test_an_index_that_is_damaged_within_is_told_of_in_words_and_made_anew(root, begin):
    before = silo.runs(root).values("max(joints/tau)")
    file = root / index.NAME
    pages = file.read_bytes()
    assert len(pages) > begin * 4096
    file.write_bytes(pages[: begin * 4096] + b"\xa5" * (len(pages) - begin * 4096))
    with pytest.raises(SiloError, match=r"was damaged .*, and is removed: try again, it is made anew from the logs"):
        silo.runs(root).values("max(joints/tau)")
    assert silo.runs(root).values("max(joints/tau)") == before


def test_an_index_that_somebody_holds_for_long_is_told_of_in_words(root, monkeypatch):
    silo.runs(root)
    monkeypatch.setattr(index, "PATIENCE_S", 0.01)
    with sqlite3.connect(root / index.NAME) as other:
        other.execute("BEGIN IMMEDIATE")
        (root / "monday" / "run1.silo").unlink()
        with pytest.raises(SiloError, match="can't be used now: database is locked; try again"):
            silo.runs(root)
    other.close()
    assert len(silo.runs(root)) == RUNS - 1


def test_where_nothing_can_be_written_the_index_is_in_memory(root, monkeypatch):
    monkeypatch.setattr(index.os, "access", lambda *_: False)
    assert len(silo.runs(root, where="max(joints/tau) > 2.5")) == 2
    assert not (root / index.NAME).exists()


def test_several_may_make_it_at_once(root):
    found, begin = [], threading.Barrier(4)

    def look():
        begin.wait()
        found.append(silo.runs(root).values("max(joints/tau)"))

    threads = [threading.Thread(target=look) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [found[0]] * 4


def test_a_run_whose_best_format_is_deleted_is_not_read_again(root, monkeypatch):
    before = {run.name: run.facts for run in silo.runs(root)}
    (root / "tuesday/run3.silo").unlink()
    monkeypatch.setattr(index, "read_facts", lambda *_: pytest.fail("a run was read again"))
    runs = silo.runs(root, where="max(joints/tau) > 2.5")
    assert names(runs) == ["run3", "run4"]
    assert runs[0].facts.path == "tuesday/run3.csv"
    assert (runs[0].facts.ticks, runs[0].facts.parameters) == (before["run3"].ticks, before["run3"].parameters)
    most = max(one.most for one in runs[0].signals if one.element.endswith("tau"))
    assert runs[0].open()["joints/tau"].values.max() == most
    (root / "tuesday/run3.csv").unlink()
    assert names(silo.runs(root))[-1] == "run4"


@pytest.mark.parametrize("order", itertools.permutations(["run.silo", "run.csv", "run.mcap"], 2))
def test_of_several_formats_the_best_is_taken_in_whatever_order_they_lie_there(order, tmp_path, monkeypatch):
    monkeypatch.setattr(finding, "_below", lambda *_: iter([(name, There(len(name), 1)) for name in order]))
    best, other = sorted(order, key=["run.silo", "run.mcap", "run.csv"].index)
    assert finding.logs_below(tmp_path) == {best: There(len(best), 1, ((other, len(other), 1),))}


def test_another_format_that_changed_since_is_read(root):
    silo.runs(root)
    shutil.copy(root / "tuesday/run4.silo", root / "tuesday/run3.silo")
    (root / "tuesday/run3.csv").touch()
    (root / "tuesday/run3.silo").unlink()
    assert silo.runs(root)[3].facts.path == "tuesday/run3.csv"


def test_a_list_stays_right_while_somebody_makes_the_index_anew(root):
    runs = silo.runs(root)
    before, last = runs.values("max(joints/tau)"), [one.most for one in runs[4].signals]
    (root / "monday/run0.silo").unlink()
    silo.runs(root, rebuild=True)
    assert runs.values("max(joints/tau)")[1:] == before[1:]
    assert [one.most for one in runs[4].signals] == last


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(silo.SiloError, match="there is no folder"):
        silo.runs(tmp_path / "none")


# ----------------------------------------------------------------------------------------------------------- labels


def test_what_was_said_can_be_taken_back(root):
    run = silo.runs(root)[0]
    run.tag("slip", "wet")
    run.note("first")
    run.untag("slip")
    assert (run.tags, run.notes) == (("wet",), ("first",))
    assert [run.undo() for _ in range(4)] == [
        "that tag slip was removed", "note 'first'", "tag wet", "tag slip"
    ]  # fmt: skip
    assert (run.tags, run.notes) == ((), ())
    with pytest.raises(silo.ElementError, match="nothing was said of 'run0'"):
        run.undo()
    run.tag("good")
    assert silo.runs(root)[0].tags == ("good",)


def test_an_index_made_anew_and_a_moved_folder_lose_no_label(root, tmp_path):
    silo.runs(root)[4].tag("good")
    (root / index.NAME).unlink()
    (root / "tuesday").rename(tmp_path / "else")
    assert silo.runs(tmp_path / "else")[1].tags == ("good",)


def test_a_torn_line_costs_that_line_alone(root):
    folder = root / "monday"
    labels.tag(folder, "run0", ["one"])
    with (folder / labels.NAME).open("ab") as file:
        file.write(b'{"run": "run0", "add": "to')
    labels.tag(folder, "run0", ["two"])
    assert labels.read_labels(folder)["run0"].tags == ("one", "two")


@pytest.mark.parametrize("word", ["", "two words", "-x", "a,b", "line\nbreak"])
def test_a_tag_is_one_word(root, word):
    with pytest.raises(silo.ElementError, match="tag"):
        silo.runs(root)[0].tag("good", word)
    assert silo.runs(root)[0].tags == ()


def test_labels_of_many_writers_are_all_there(tmp_path):
    threads = [
        threading.Thread(target=lambda n=n: [labels.tag(tmp_path, "run", [f"t{n}_{i}"]) for i in range(20)])
        for n in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(labels.read_labels(tmp_path)["run"].tags) == 80


# -------------------------------------------------------------------------------------------------------- the shell


def shell(*arguments):
    return CliRunner().invoke(cli, [str(one) for one in arguments])


def said(*arguments):
    done = shell(*arguments)
    assert (done.exit_code, done.stderr) == (0, "")
    return done.stdout


def test_the_shell_lists_tags_and_notes(root, monkeypatch):
    monkeypatch.chdir(root / "monday")
    assert said("tag", "run2", "slip", "wet") == "run2: slip, wet\n"
    assert said("tag", "run2.silo", "wet", "--remove") == "run2: slip\n"
    assert said("note", "run2", "on", "the", "floor") == "run2: 1 note\n"
    listed = said("runs", root, "--tag", "slip", "--show", "max(joints/tau)")
    assert listed.splitlines()[-1].startswith("1 run, ")
    head, row = listed.splitlines()[:2]
    assert head.split()[:3] == ["RUN", "ROBOT", "BEGUN"]
    assert row.split()[0] == "monday/run2.silo"
    assert row.endswith("#slip on the floor")
    (told,) = json.loads(said("runs", root, "-w", "floor", "--json"))
    assert (told["tags"], told["notes"], told["robot"], told["lost"]) == (["slip"], ["on the floor"], "anymal", 0)
    assert said("note", "run2", "--undo") == "run2: took back note 'on the floor'\n"
    assert said("runs", root, "--where", "kp > 99") == "no run; look in another folder, or ask for less\n"


@pytest.mark.parametrize("given", [("note", "run2"), ("note", "run2", "words", "--undo")])
def test_a_note_is_words_or_an_undo(root, given, monkeypatch):
    monkeypatch.chdir(root / "monday")
    told = shell(*given)
    assert (told.exit_code, told.stderr.splitlines()[-1]) == (2, "Error: write what is to be noted, or --undo")


def test_logs_with_names_that_cannot_be_shown_are_counted(root):
    path = next(root.rglob("*.silo"))
    for name in (b"r\xff.silo", b"a\nb.silo", b"c\n.txt"):
        Path(os.fsdecode(os.fsencode(root) + b"/" + name)).write_bytes(path.read_bytes())
    assert "2 logs left out" in shell("runs", root).stderr
    assert "left out" not in shell("runs", path.parent).stderr


def test_runs_as_a_table(root):
    pytest.importorskip("pandas")
    table = silo.runs(root).to_pandas()
    assert table["robot"].tolist() == ["anymal"] * RUNS
    assert table["span_s"].tolist() == pytest.approx([0.19] * RUNS)


def test_a_run_that_went_before_it_was_read_says_so_and_began_at_no_time(tmp_path):
    gone = read_facts(tmp_path, "gone.silo", 7).run
    assert (gone.path, gone.begun_ns, gone.size_bytes) == ("gone.silo", 0, 7)
    assert "gone.silo" in gone.problem


# ------------------------------------------------------------------------------------------ several files of one run


@pytest.fixture
def cut(tmp_path):
    """A run of 60 ticks in three files: it was cut twice, `x` has half of the samples in the middle one."""
    clock = itertools.count(1_700_000_000_000_000_000, 10_000_000).__next__
    log = silo.Logger("anymal", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml", clock=clock)
    n, x = log.array("n", (), "int64", buffer="growing"), log.array("x", buffer="growing")
    log.start()
    for tick in range(60):
        if tick in (20, 40):
            log.set("x", divider=3 - log["x"].options.divider, cut=True)
        n[...], x[...] = tick, -tick
        log.collect()
        if tick == 4:
            log.mark("pushed")
        if tick == 9:
            log.episode("walk", speed=0.5).__enter__()
        if tick == 49:
            log.mark('episode "walk" end')
    log.save()
    log.close()
    return tmp_path


def test_a_run_that_was_cut_is_one_run_of_all_its_files(cut):
    runs = silo.runs(cut)
    (run,) = runs
    facts = run.facts
    assert (facts.ticks, facts.marks, facts.elements) == (60, 1, 2)
    assert (facts.span_s, facts.rate_hz) == (pytest.approx(0.59), pytest.approx(100))
    x = np.array([-tick for tick in range(60) if not 20 <= tick < 40 or tick % 2 == 0], float)
    (of_x,) = [one for one in run.signals if one.name == "/log/x"]
    assert (of_x.count, of_x.least, of_x.most, of_x.last) == (len(x), -59, 0, -59)
    assert (of_x.mean, of_x.std) == (pytest.approx(x.mean()), pytest.approx(x.std()))
    assert of_x.rms == pytest.approx(math.sqrt(np.mean(x**2)))
    assert runs.values("max(n)") == [59]
    assert run.open()["n"].values.tolist() == list(range(60))
    found = runs.sql("select signal, count(*) as of from samples group by signal order by signal").rows()
    assert found == [("n", 60), ("x", len(x))]


def test_an_episode_over_the_cuts_of_a_run_is_one(cut, tmp_path):
    (episode,) = silo.runs(cut).episodes()
    one = episode.episode
    assert (one.whole, one.about, one.first, one.last) == (True, {"speed": 0.5}, 10, 49)
    log = episode.open()
    assert log["n"].values.tolist() == list(range(10, 50))
    (of_n,) = [one for one in episode.signals if one.name == "/log/n"]
    assert (of_n.count, of_n.least, of_n.most, of_n.mean) == (40, 10, 49, 29.5)
    assert silo.runs(cut).episodes().values("count(n)") == [40]


def files(*several):
    return [
        RunFacts(path, robot="bot", ticks=ticks, elements=3, run="a", part=part, recorder=recorder, begun_ns=place)
        for place, (path, ticks, part, recorder) in enumerate(several)
    ]


@pytest.mark.parametrize(
    ("there", "expected"),
    [
        ([("1.silo", 9, 0, ""), ("rec/1.mcap", 9, 1, "bot")], [["1.silo"]]),
        ([("1.silo", 5, 0, ""), ("rec/1.mcap", 5, 1, "bot"), ("rec/2.mcap", 4, 1, "bot")],
         [["rec/1.mcap", "rec/2.mcap"]]),
        ([("1.silo", 5, 0, ""), ("2.silo", 9, 0, "")], [["1.silo"], ["2.silo"]]),
        ([("1_part1.silo", 5, 1, ""), ("2_part1.silo", 4, 1, ""), ("3_part2.silo", 4, 2, "")],
         [["1_part1.silo", "3_part2.silo"]]),
        ([("a/1.mcap", 9, 1, "bot"), ("b/1.mcap", 9, 1, "cam"), ("1.silo", 3, 0, "")], [["a/1.mcap"], ["b/1.mcap"]]),
    ],
    ids=["recorded and saved", "saved is less", "saved twice", "cut", "two recordings"],
)  # fmt: skip
def test_files_of_one_run_are_one_run(there, expected):
    found = by_run(files(*there))
    assert [[one.path for one in group] for group, _ in found] == expected
    assert sorted(path for group, others in found for path in (*(one.path for one in group), *others)) == sorted(
        path for path, *_ in there
    )


@pytest.mark.parametrize(
    ("saved", "recorded", "is_listed"),
    [
        ((0, 9, "n tau"), [(0, 20, "n")], True),
        ((0, 9, "n"), [(0, 5, "n tau"), (5, 20, "n tau")], False),
        ((0, 9, "n"), [(3, 20, "n")], True),
        ((4, 9, "n tau"), [(0, 20, "n"), (0, 20, "tau")], False),
        ((4, 9, "n"), [(0, 5, "n"), (8, 30, "n")], True),
    ],
    ids=["a signal more", "all is recorded", "ticks before", "two recordings have all", "in a hole"],
)
def test_a_save_that_has_what_no_recording_has_is_listed_by_itself(saved, recorded, is_listed):
    there = [("1.silo", *saved, ""), *((f"{n}.mcap", *one, one[2]) for n, one in enumerate(recorded))]
    every = [
        RunFacts(path, robot="bot", run="a", ticks=end - first, offset=end, elements=1, names=names, recorder=by)
        for path, first, end, names, by in there
    ]
    names = {one.path: frozenset(one.names.split()) for one in every}
    found = [[one.path for one in group] for group, _ in by_run(every, names.__getitem__)]
    assert (["1.silo"] in found) == is_listed


@pytest.mark.parametrize("ending", ["silo", "mcap"])
def test_a_file_that_is_cut_off_lost_what_it_lacks(tmp_path, ending):
    log = silo.Logger("bot", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml")
    log.array("x")
    log.array("y")
    log.start()
    for _ in range(1000):
        log.collect()
    (tmp_path / "there").mkdir()
    path = tmp_path / "there" / f"run.{ending}"
    log.save("silo", name="whole")
    log.close()
    silo.open_log(tmp_path / "whole.silo").save(tmp_path / f"run.{ending}")
    whole = (tmp_path / f"run.{ending}").read_bytes()
    path.write_bytes(whole[: -len(whole) // 3])
    with pytest.warns(silo.LogWarning, match="cut off"):
        there = silo.open_log(path)
    held = sum(one.count for one in there.recording.elements)
    (run,) = silo.runs(path.parent)
    assert run.facts.lost == run.facts.cut_off == 2000 - held > 0
    assert not silo.runs(path.parent, where="lost == 0")
    assert "cut off" in shell("runs", path.parent).stdout
    assert f"lost {count(run.facts.lost)}" in shell("info", path).stdout


def test_a_part_that_is_missing_in_the_middle_counts_as_lost(cut):
    (lost,) = cut.glob("*_part2.silo")
    lost.unlink()
    (run,) = silo.runs(cut)
    assert (run.facts.ticks, run.facts.lost, run.facts.warnings) == (40, 40, 1)
    assert not silo.runs(cut, where="lost == 0")
    with pytest.warns(silo.LogWarning, match="part 2 of this run"):
        assert len(run.open().warnings) == 1


def test_of_a_part_that_is_missing_as_many_samples_are_lost_as_dividers_let_come(tmp_path):
    clock = itertools.count(1_700_000_000_000_000_000, 10_000_000).__next__
    log = silo.Logger("anymal", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml", clock=clock)
    arrays = [log.array(f"every{divider}", divider=divider, buffer="growing") for divider in (1, 3, 7)]
    log.start()
    for tick in range(60):
        if tick in (20, 40):
            log.set("every1", divider=3 - log["every1"].options.divider, cut=True)
        for array in arrays:
            array[...] = tick
        log.collect()
    log.save()
    log.close()
    (lost,) = tmp_path.glob("*_part2.silo")
    lost.unlink()
    (run,) = silo.runs(tmp_path)
    assert run.facts.lost == 20 + 7 + 3, "with the dividers of the file before"


def test_a_tag_of_any_file_of_a_run_is_one_of_the_run(cut):
    for path in sorted(cut.glob("*_part?.silo")):
        assert CliRunner().invoke(cli, ["tag", str(path), f"of{path.stem[-1]}"]).exit_code == 0
    (run,) = silo.runs(cut)
    assert run.tags == ("of1", "of2", "of3")
    run.tag("more")
    assert run.tags == ("of1", "more", "of2", "of3")
    assert len(silo.runs(cut).where("of3")) == 1


def test_saves_of_a_cut_run_that_have_what_others_lack_are_listed_by_themselves():
    first, *second = (
        RunFacts(f"{at}.silo", robot="bot", ticks=ticks, run="a", part=part, stamp_ns=begin * 10**9, span_s=span_s)
        for at, (ticks, part, begin, span_s) in enumerate([(9, 1, 0, 9), (5, 2, 9, 5), (5, 2, 20, 5), (5, 2, 40, 5)])
    )
    found = [[one.path for one in group] for group, _ in by_run([first, *second])]
    assert found == [["1.silo"], ["2.silo"], ["0.silo", "3.silo"]], "the newest of as much goes with the first part"
    grew = msgspec.structs.replace(second[0], path="4.silo", ticks=9, span_s=9.0)
    assert [[one.path for one in group] for group, _ in by_run([first, second[0], grew])] == [["0.silo", "4.silo"]]


def test_a_run_begins_with_the_first_of_its_files_that_has_ticks():
    words = RunFacts("1.mcap", run="a", marks=1)
    filled = RunFacts("2.mcap", run="a", ticks=50, stamp_ns=10**18, span_s=0.49, rate_hz=100.0)
    facts, _ = merged([words, filled])
    assert (facts.span_s, facts.rate_hz, facts.marks) == (0.49, pytest.approx(100), 1)


def test_nobody_recorded_between_two_files_of_a_run_and_its_rate_is_that_of_before_and_after(tmp_path):
    recorded_in_two(tmp_path, hole=1000)
    (run,) = silo.runs(tmp_path)
    with pytest.warns(LogWarning, match="ticks 10 to 1009 are missing"):
        log = silo.open_log(tmp_path, alone=False)
    found = report(log.recording, "", 0)
    assert [run.facts.rate_hz, found.rate_hz, found.elements[0].rate_hz] == pytest.approx([100, 100, 100])
    assert (run.said, run.facts.span_s) == ("2 parts", pytest.approx(10.19))


def test_of_a_run_in_several_files_each_is_archived_once_whatever_comes_or_goes(cut, tmp_path):
    pytest.importorskip("pyarrow")
    pytest.importorskip("polars")
    archive = Archive(str(tmp_path / "archive"))
    names = [path.name for path in sorted(cut.glob("*_part?.silo"))]
    assert (archive.add(silo.runs(cut)).added, archive.add(silo.runs(cut)).kept) == (names, 3)
    (cut / names[0]).unlink()
    later = archive.add(silo.runs(cut))
    assert (later.added, later.kept, later.problems) == ([], 2, {})


@pytest.mark.parametrize("where", ["there", "memory://runs-in-parts"])
def test_a_run_in_several_files_is_one_in_an_archive_and_stays_whole_where_files_are_deleted(cut, tmp_path, where):
    pytest.importorskip("pyarrow")
    pytest.importorskip("polars")
    archive = Archive(where if ":" in where else str(tmp_path / where))
    names = [path.name for path in sorted(cut.glob("*_part?.silo"))]
    silo.runs(cut)[0].tag("kept")

    def answers(drawer):
        asked = {
            "runs": "run, ticks, span_s, marks, size_bytes, tags",
            "signals": "*",
            "events": "t, tick, kind, text",
            "episodes": "*",
            "episode_signals": "*",
            "parameters": "*",
            "samples": "*",
            "wide": "*",
        }
        return {table: drawer.sql(f"select {what} from {table} order by all").rows() for table, what in asked.items()}

    (cut / names[1]).rename(late := tmp_path / "late")
    assert archive.add(silo.runs(cut)).added == [names[0], names[2]]
    assert archive.sql("select ticks from runs").item() == 40
    late.rename(cut / names[1])
    assert archive.add(silo.runs(cut)).added == [names[1]], "one that comes later takes its place"
    wanted = answers(silo.runs(cut))
    assert [row[1] for row in wanted["runs"]] == [60]
    for _ in range(2):
        assert answers(archive) == wanted
        assert not archive.add(silo.runs(cut)).problems
    for name in names[:2]:
        (cut / name).unlink()
        assert archive.add(silo.runs(cut)).problems == {}
        assert archive.sql("select run, ticks from runs").rows() == [(names[0], 60)]
        assert archive.sql("select n from wide order by t")["n"].to_list() == list(range(60))
    assert answers(archive)["signals"] == wanted["signals"]


def test_a_file_of_a_year_that_no_clock_should_say_costs_no_other_its_place(written, tmp_path):
    (path,) = written.rglob("run0.silo")
    for name, changed_ns in (("good", 10**18), ("wrong", 99_999_999_999 * 10**9)):
        shutil.copy(path, tmp_path / f"{name}.silo")
        os.utime(tmp_path / f"{name}.silo", ns=(changed_ns, changed_ns))
    for _ in range(2):
        assert sorted(Path(run.path).name for run in silo.runs(tmp_path)) == ["good.silo", "wrong.silo"]


@pytest.mark.parametrize("is_there", [True, False])
def test_an_index_that_is_a_link_is_not_followed(written, tmp_path, is_there):
    victim, folder = tmp_path / "other.sqlite", tmp_path / "logs"
    folder.mkdir()
    shutil.copy(next(iter(written.rglob("run0.silo"))), folder / "a.silo")
    if is_there:
        with sqlite3.connect(victim) as theirs:
            theirs.execute("CREATE TABLE mine (x)")
    before = victim.read_bytes() if is_there else None
    (folder / finding.NAME).symlink_to(victim)
    assert [Path(run.path).name for run in silo.runs(folder)] == ["a.silo"]
    assert (victim.read_bytes() if victim.exists() else None) == before
