"""`silo.compare`, `silo compare` and `silo diff`: one rule, and no work twice."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.analysis import compare as comparing
from silo.analysis.compare import differences
from silo.analysis.reports import table
from silo.cli.group import cli
from silo.core.recording import Recording
from silo.errors import ElementError
from tests.stand_ins.saved import element

COUNT = 20


def recorded(elements, start_ns=10**18, jitter=0):
    noise = np.random.default_rng(1).integers(-jitter, jitter + 1, COUNT)
    return Recording("run", start_ns + np.arange(COUNT) * 10**7 + noise, COUNT, list(elements))


def many(count, differ=False):
    for place in range(count):
        values = np.sin(np.arange(COUNT) + place)
        yield element(f"/log/g{place % 7}/s{place}", values + 0.001 * (differ and place % 2))


@pytest.fixture
def met(monkeypatch):
    """How often two time bases were laid on each other."""
    calls = []
    real = comparing.in_common

    def counted(*given):
        calls.append(given)
        return real(*given)

    monkeypatch.setattr(comparing, "in_common", counted)
    return calls


@pytest.mark.parametrize("turned", [False, True])
def test_a_run_of_one_tick_is_held_against_that_moment(tmp_path, turned):
    logs = []
    for ticks, begin_ns in ((1, 10**18), (100, 10**18 + 10**15)):
        now = [begin_ns]
        log = silo.Logger("o", folder=tmp_path, script=tmp_path / "no.yaml", frequency=100, clock=lambda: now[0])  # noqa: B023
        x, wide, slow = log.array("x"), log.array("wide", 2), log.array("slow", divider=200)
        log.start()
        for tick in range(ticks):
            x[...], wide[...], slow[...] = tick, tick + (ticks > 1), 5
            log.collect()
            now[0] += 10_000_000
        logs.append(silo.open_log(log.save()[0].path))
        log.close()
    a, b = logs[::-1] if turned else logs
    found = silo.compare(a, b)
    assert {row.name: (row.count, row.samples) for row in found} == {"/log/wide_0": (1, 1), "/log/wide_1": (1, 1)}
    assert found.alike == 2
    assert found.partly["/log/x"].startswith("compared from 0 to 0 s: ")
    assert "switched off" not in found.partly["/log/x"]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("divider", "samples"), [(1, 4), (5, 5), (20, 20)])
def test_a_single_sample_is_held_against_as_long_as_its_element_would_have(turned, divider, samples):
    short, long = (
        silo.Log(Recording("r", np.arange(ticks) * 10**7, ticks, [element("n", values, divider=every)]))
        for ticks, values, every in ((4, np.zeros(-(-4 // divider)), divider), (78, np.arange(78.0) + 1, 1))
    )
    found = silo.compare(*((long, short) if turned else (short, long)))
    assert {row.name: (row.count, row.samples) for row in found} == {"/log/n": (samples, samples)}


@pytest.mark.parametrize("jitter", [0, 100_000])
def test_two_runs_are_laid_on_each_other_once_for_all_signals_of_one_time_base(met, jitter):
    a, b = silo.Log(recorded(many(50))), silo.Log(recorded(many(50, differ=True), 2 * 10**18, jitter))
    found = silo.compare(a, b)
    assert (len(found.rows), found.alike) == (25, 25)
    assert len(met) == 1


@pytest.mark.parametrize("kind", ["slower", "a pause", "a bit faster"])
def test_runs_of_as_many_samples_are_compared_at_the_same_times(kind):
    ticks = np.arange(COUNT)
    step = {"slower": 1.25, "a bit faster": 0.9}.get(kind, 1.0)
    late = 7.5 * (ticks >= 10) if kind == "a pause" else 0.0
    times = (np.round((ticks * step + late) * 10**7)).astype(np.int64)
    logs = []
    for begin_ns, at in ((10**18, ticks * 10**7), (2 * 10**18, times)):
        elements = [element(f"/log/s{place}", np.sin(at / 1e9 * (20 + place))) for place in range(3)]
        logs.append(silo.Log(Recording("run", begin_ns + at, COUNT, elements)))
    a, b = logs
    found = {row.name: row.largest for row in silo.compare(a, b).rows}
    for name in a:
        truth = np.abs((a[name] - b[name]).values).max()
        assert found.get(name, 0.0) == pytest.approx(truth, abs=1e-12)


def test_no_signal_is_made_of_what_has_the_same_bytes(monkeypatch):
    a, b = (silo.Log(recorded(many(10))) for _ in range(2))
    monkeypatch.setattr(silo.Log, "_signal", lambda *given: pytest.fail("a signal was made"))
    assert silo.compare(a, b).alike == 10


def test_the_same_bytes_at_other_times_are_compared_at_the_times_that_both_have():
    ramp = np.arange(float(COUNT))
    a, b = (recorded([element("/log/x", ramp)], start) for start in (10**18, 10**18 + 3 * 10**7))
    assert not silo.compare(silo.Log(a), silo.Log(b)).rows
    (row,) = silo.compare(silo.Log(a), silo.Log(b), by="stamps").rows
    assert row.largest == 3


def of_course(values, begin_s=0.0):
    stamps = 10**18 + round(begin_s * 1e9) + np.arange(len(values)) * 10**7
    q = element("/log/q", np.asarray(values, float))
    return silo.Log(Recording("run", stamps, len(values), [q]), start_ns=10**18)


@pytest.mark.parametrize("steps", [-7, -1, 0, 1, 7])
def test_runs_are_laid_on_each_other_by_the_course_of_a_signal(steps):
    bump = np.exp(-(((np.arange(60) - 30) / 4) ** 2))
    found = silo.compare(of_course(bump), of_course(np.roll(bump, -steps)), signal="q")
    assert found.shift_s == pytest.approx(0.01 * steps)
    assert max((row.rms for row in found.rows), default=0) < 1e-6


def test_a_course_needs_two_samples_in_both():
    short, long = of_course([0.0, 1.0]), of_course([0.0, 1.0, 1.0, 0.0])
    assert silo.compare(short, long, signal="q").shift_s == pytest.approx(0, abs=0.03)
    for pair in [(of_course([1.0]), long), (long, of_course([1.0]))]:
        with pytest.raises(ElementError, match="'/log/q' has too few samples"):
            silo.compare(*pair, signal="q")
    for pair in [(of_course([1.0, 1.0]), long), (long, of_course([1.0, 1.0]))]:
        with pytest.raises(ElementError, match="'/log/q' stands still in a run"):
            silo.compare(*pair, signal="q")


@pytest.mark.parametrize("turned", [False, True])
def test_a_course_of_a_vector_is_refused_with_the_names_of_its_components(tmp_path, turned):
    logs = []
    for shape in ((), 2):
        log = silo.Logger("arm", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml")
        q = log.array("q", shape)
        log.start()
        for tick in range(9):
            q[...] = tick
            log.collect()
        logs.append(silo.open_log(log.save("silo", name=f"run{len(logs)}")[0].path))
        log.close()
    with pytest.raises(ElementError, match="'/log/q' has components: name one of them, such as '/log/q_0'"):
        silo.compare(*(logs[::-1] if turned else logs), signal="q")


def test_how_far_a_signal_moves_is_that_of_its_finite_samples():
    rows = [np.array([1.0, np.nan, 3.0]), np.array([np.nan] * 3), np.array([1.0, 1.0, 4.0])]
    assert comparing._spread(rows) == pytest.approx([1.0, 0.0, np.sqrt(2)])
    assert comparing._spread(rows[2:]) == pytest.approx([np.sqrt(2)])
    assert comparing._spread([np.empty(0), np.empty(0)]).tolist() == [0.0, 0.0]


def test_diff_and_compare_find_the_same_signals_different():
    ramp, bad = np.arange(float(COUNT)), np.arange(float(COUNT))
    bad[7] = np.nan
    texts = np.array([b"stance"] * COUNT)
    fallen = texts.copy()
    fallen[3] = b"fallen"
    big = np.full(COUNT, 2**60, np.int64)
    a = recorded(element(f"/log/{n}", v) for n, v in (("nan", ramp), ("mode", texts), ("big", big), ("same", ramp)))
    b = recorded(element(f"/log/{n}", v) for n, v in (("nan", bad), ("mode", fallen), ("big", big + 1), ("same", ramp)))
    told = {one.name: one.what for one in differences(a, b)}
    found = silo.compare(silo.Log(a), silo.Log(b))
    assert set(told) == {row.name for row in found.rows} == {"/log/nan", "/log/mode", "/log/big"}
    assert told == {row.name: row.words for row in found.rows}
    assert told["/log/mode"] == "1 of 20 samples differ, first at 0.03 s"
    assert found.alike == 1


def test_a_value_in_another_unit_is_the_same_for_both():
    a, b = (recorded([element("/log/x", np.full(COUNT, value), unit)]) for value, unit in ((1.0, "m"), (1000.0, "mm")))
    assert not silo.compare(silo.Log(a), silo.Log(b))
    assert [one.what for one in differences(a, b)] == ["unit: m, then mm"]


def test_enumerations_are_compared_by_their_words():
    numbers = np.arange(COUNT) % 2
    swapped, numbered = {0: "trot", 1: "stand"}, {0: "stand", 1: "trot"}

    def two(mine, theirs, values):
        both = ((numbers, mine), (values, theirs))
        return [recorded([element("/log/gait", each, labels=labels)]) for each, labels in both]

    a, b = two(numbered, swapped, numbers)
    (row,) = silo.compare(silo.Log(a), silo.Log(b)).rows
    words = "compared by words, whose numbers differ: 0 is stand, then trot; 1 is trot, then stand"
    assert row.count == COUNT
    assert [one.what for one in differences(a, b)] == [words, row.words]
    a, b = two(numbered, swapped, 1 - numbers)
    comparison = silo.compare(silo.Log(a), silo.Log(b))
    assert (len(comparison), comparison.alike) == (0, 1)
    assert words in str(comparison)
    assert [(one.what, one.differs) for one in differences(a, b)] == [(words, False)]
    # what only one of them has a word for is its number
    for labels in ({0: "stand"}, {0: "stand", 1: "trot", 2: "walk"}, None):
        assert not differences(*two(numbered, labels, numbers))
    assert silo.compare(*map(silo.Log, two({0: "stand"}, {0: "stand", 1: "trot"}, 0 * numbers))).rows


def test_a_value_from_before_a_signal_was_switched_off_is_no_difference(new_logger, tmp_path):
    def run(folder, cut):
        log = new_logger("arm", frequency=100, folder=tmp_path / folder, clock=itertools.count(0, 10**7).__next__)
        x = log.array("x", buffer="growing")
        log.start()
        for tick in range(90):
            if cut and tick in (30, 60):
                log.set("x", enabled=tick == 60, cut=True)
            x[...] = tick
            log.collect()
        log.save()
        return silo.open_log(tmp_path / folder)

    whole, cut = run("whole", cut=False), run("cut", cut=True)
    for found in (silo.compare(whole, cut), silo.compare(cut, whole)):
        assert (len(found), found.alike) == (0, 1)
        assert found.partly == {"/log/x": "not where it was off, overwritten or not recorded, in one of them"}


def test_what_neither_run_has_a_sample_of_is_no_difference():
    nothing = recorded([element("/log/x", np.empty(0))])
    assert not differences(nothing, replace(nothing, elements=list(nothing.elements)))
    assert not silo.compare(silo.Log(nothing), silo.Log(nothing)).not_compared


def test_the_shell_compares_as_silo_compare_does(tmp_path):
    logs = [silo.Log(recorded(many(4, differ))) for differ in (False, True)]
    for log, path in zip(logs, (tmp_path / "a.silo", tmp_path / "b.silo"), strict=True):
        log.save(path)
    paths = [str(tmp_path / f"{name}.silo") for name in "ab"]
    shown = CliRunner().invoke(cli, ["compare", *paths])
    assert shown.exit_code == 4
    assert shown.stdout.strip() == str(silo.compare(*paths))
    shown = CliRunner().invoke(cli, ["compare", *paths, "s1", "--json"])
    (row,) = json.loads(shown.stdout)
    assert (row["name"], row["count"]) == ("/log/g1/s1", COUNT)
    assert CliRunner().invoke(cli, ["compare", *paths, "--tolerance", "0.1"]).exit_code == 0
    event = CliRunner().invoke(cli, ["compare", *paths, "--event", "s1 > 99"])
    assert event.exit_code == 1
    assert "doesn't happen in the first run" in event.output


@pytest.fixture
def several(tmp_path):
    """Four runs, each with an episode a tick later than in the one before; the third is unlike the others."""
    for number in range(4):
        clock = itertools.count(1_700_000_000_000_000_000 + number * 10**11, 10_000_000).__next__
        log = silo.Logger("dog", frequency=100, folder=tmp_path, clock=clock, script=tmp_path / "none.yaml")
        x = log.array("x")
        log.start()
        for tick in range(30):
            x[...] = np.sin(tick) if tick < 10 + number else (tick - number) * (10 if number == 2 else 1)
            if tick == 10 + number:
                with log.episode("pick"):
                    for step in range(5):
                        x[...] = step * (10 if number == 2 else 1)
                        log.collect()
            else:
                log.collect()
        log.save("silo", name=f"run{number}")
        log.close()
    return tmp_path


def test_many_runs_are_compared_with_the_first_the_most_different_first(several, monkeypatch):
    found = silo.runs(several).compare("x")
    assert found[0][0].name == "run2"
    assert len(found) == 3
    same = silo.runs(several).compare("x", episode="pick")
    assert [(run.name, bool(one)) for run, one in same] == [("run2", True), ("run1", False), ("run3", False)]
    with pytest.raises(ElementError, match="1 run can't be compared"):
        silo.runs(several)[:1].compare()
    monkeypatch.chdir(several)

    def ran(*words, code):
        result = CliRunner().invoke(cli, ["compare", *words])
        assert result.exit_code == code, result.output
        return result.stdout

    lines = ran("run0.silo..run3.silo", "x", "--png", "worst.png", code=4).splitlines()
    assert lines[1].split()[:3] == ["run2.silo", "1", "/log/x"]
    assert lines[-1] == "worst.png"
    assert Path("worst.png").read_bytes().startswith(b"\x89PNG")
    ran("run0.silo..run1.silo", "--episode", "pick", code=0)
    told = json.loads(ran("run1.silo..run3.silo", "--episode", "0", "--json", code=4))
    assert [(one["run"], len(one["differ"])) for one in told] == [("run2.silo", 1), ("run3.silo", 0)]
    ran("run0.silo", "run2.silo", "x", "--png", "pair.png", code=4)
    assert Path("pair.png").stat().st_size > 1000
    ran("run0.silo", code=2)


def test_an_episode_that_is_not_there_is_told_with_those_that_are(several):
    with pytest.raises(ElementError, match=r"run0.silo has no episode 'place'; it has pick"):
        silo.compare(several / "run0.silo", several / "run1.silo", episode="place")


@pytest.mark.parametrize(("dtype", "base"), [(np.int64, 2**60), (np.uint64, 2**63), (np.int64, -(2**60))])
def test_integers_that_no_float_holds_are_compared_to_the_last_digit(dtype, base):
    values = [np.array([base + at + more for at in range(COUNT)], dtype) for more in (0, 1)]
    a, b = (silo.Log(recorded([element("n", one)])) for one in values)
    (row,) = silo.compare(a, b).rows
    assert (row.largest, row.rms, row.mean, row.count) == (1, 1, 1, COUNT)
    assert not silo.compare(a, b, tolerance=1).rows


def test_gaps_are_measured_over_their_finite_numbers():
    rows = np.array([[3.0, -4.0, 0.0], [1.0, np.nan, -5.0], [np.nan, np.inf, -np.inf]])
    rms, mean, most = comparing._of_finite(rows)
    np.testing.assert_allclose(rms, [np.sqrt(25 / 3), np.sqrt(13), np.nan])
    np.testing.assert_allclose(mean, [-1 / 3, -2, np.nan])
    np.testing.assert_allclose(most, [4, 5, np.nan])
    np.testing.assert_allclose(comparing._of_finite(rows[:1]), [[np.sqrt(25 / 3)], [-1 / 3], [4]])


@pytest.mark.parametrize(
    ("width", "lines"),
    [
        (80, ["name                     n", "/log/a_rather_long_one  12", "x                        3"]),
        (20, ["name               n", "…rather_long_one  12", "x                  3"]),
        (9, ["name           n", "…er_long_one  12", "x              3"]),  # of a name twelve places stay
    ],
)
def test_in_a_narrow_table_names_keep_their_ends_and_columns_without_a_word_are_left_out(width, lines):
    rows = [["/log/a_rather_long_one", "12", "-"], ["x", "3", ""]]
    assert table(["name", "n", "note"], rows, width, "lrl") == lines
