"""What two signals, and two logs, have in common: the time that both have, for arithmetic, `compare`, `diff`."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.analysis.compare import differences
from silo.cli.group import cli
from silo.errors import LogWarning


def ramp(folder, count, name="run", period_ns=10**7, start_ns=10**18, first=0, jitter_ns=0):
    """A log of `count` ticks in which `x` counts from `first`; `slow` has every tenth."""
    noise = np.random.default_rng(count).integers(-jitter_ns, jitter_ns + 1, count)
    noise[0] = 0
    stamps = (start_ns + np.arange(count) * period_ns + noise).tolist()
    now = [stamps[0]]
    log = silo.Logger(name, frequency=1e9 / period_ns, folder=folder, script=folder / "no.yaml", clock=lambda: now[0])
    options = {"size": count, "buffer": "growing"}
    x, slow = log.array("x", unit="m", **options), log.array("slow", divider=10, **options)
    log.start()
    for tick, now[0] in enumerate(stamps, first):
        x[...] = slow[...] = tick
        log.collect()
    path = folder / f"{name}.silo"
    (saved,) = log.save()
    Path(saved.path).rename(path)
    log.close()
    return silo.open_log(path)


@pytest.fixture
def ten(tmp_path):
    return ramp(tmp_path, 1000, "ten")


@pytest.fixture
def five(tmp_path):
    return ramp(tmp_path, 500, "five", start_ns=2 * 10**18)


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_a_difference_has_the_time_that_both_have_whichever_comes_first(ten, five):
    for made in (ten["x"] - five["x"], five["x"] - ten["x"]):
        assert len(made) == 500
        assert not made.values.any()
    assert len(ten["slow"] > five["slow"]) == 50


def test_a_slow_signal_holds_until_its_next_sample_would_come_and_no_longer(ten, five):
    with pytest.warns(LogWarning):
        assert len(ten["x"] - five["slow"]) == 500
    assert len(ten["x"] - ten["slow"]) == 1000


def test_what_is_left_out_is_told_with_both_spans_and_the_way_out(ten, five):
    with pytest.warns(LogWarning) as told:
        ten["x"] - five["x"]
    words = str(told[0].message)
    assert told[0].filename == __file__
    assert "0 to 4.99 s" in words
    assert "'/log/x' has samples from 0 to 9.99 s" in words
    assert ".resample(" in words
    with pytest.warns(LogWarning, match=r"0 to 4\.99 s"):
        ten["x"] < five["x"]  # noqa: B015


def test_nothing_is_told_where_nothing_is_left_out(ten):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ten["x"] + ten["slow"]
        ten["x"] * ten["x"]


@pytest.fixture
def thirds(tmp_path):
    """A log whose `two` and `three` have every second and every third of 20 ticks, the stamps of which are uneven."""
    stamps = (10**18 + np.cumsum(np.random.default_rng(3).integers(10**6, 10**7, 20))).tolist()
    now = stamps[:1]
    log = silo.Logger("thirds", folder=tmp_path, script=tmp_path / "no.yaml", clock=lambda: now[0])
    two, three = log.array("two", (), np.int64, divider=2), log.array("three", (), np.int64, divider=3)
    log.derive("sum", "two + three")
    log.start()
    for tick, now[0] in enumerate(stamps):
        two[...] = three[...] = tick
        log.collect()
    (saved,) = log.save()
    log.close()
    return silo.open_log(saved.path), stamps


def test_what_is_made_of_every_second_and_every_third_tick_has_each_however_it_is_written(thirds):
    log, stamps = thirds
    expected = [tick // 2 * 2 + tick // 3 * 3 for tick in range(20)]
    for made in (log["two"] + log["three"], log["three"] + log["two"], log.eval("two + three"), log["sum"]):
        assert (made.values.tolist(), made.time_ns.tolist(), made.divider) == (expected, stamps, 1), made.name
    truths = log.eval("two > three")
    assert truths.values.tolist() == [tick // 2 * 2 > tick // 3 * 3 for tick in range(20)]


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_a_part_of_a_signal_meets_another_rate_at_each_tick_too_and_other_stamps_as_before(thirds):
    log, stamps = thirds
    assert (log["two"][2:5] + log["three"]).time_ns.tolist() == stamps[4:10]
    two = log["two"].resample(log["two"].times + 1e-4)
    assert (two + log["three"]).time_ns.tolist() == two.time_ns.tolist()


def test_the_last_value_holds_on_when_asked(ten, five):
    held = ten["x"] - five["x"].resample(ten["x"])
    assert len(held) == 1000
    assert held.values[-1] == 999 - 499


def test_runs_of_different_lengths_are_compared_over_what_both_have_in_both_directions(ten, five):
    for one, other in ((ten, five), (five, ten)):
        found = silo.compare(one, other)
        assert (found.rows, found.alike) == ((), 2)
        assert "the first has samples from 0 to" in str(found)
        assert "9.99 s" in str(found)
        assert "4.99 s" in str(found)


def values_differ(a, b):
    """By `silo diff`: signals whose values differ."""
    return [one.name for one in differences(a.recording, b.recording) if "samples differ" in one.what]


@pytest.mark.parametrize("how", ["three ticks later", "a day later", "jittered", "longer", "other values"])
def test_diff_and_compare_answer_alike(how, tmp_path):
    a = ramp(tmp_path, 50, "a", jitter_ns=200_000 if how == "jittered" else 0)
    ways = {
        "three ticks later": {"count": 50, "start_ns": 10**18 + 3 * 10**7},
        "a day later": {"count": 50, "start_ns": 10**18 + 86_400 * 10**9},
        "jittered": {"count": 51, "jitter_ns": 200_000},
        "longer": {"count": 80},
        "other values": {"count": 50, "first": 1},
    }
    b = ramp(tmp_path, **{"name": "b", **ways[how]})
    expected = ["/log/slow", "/log/x"] if how == "other values" else []
    for one, other in ((a, b), (b, a)):
        assert sorted(row.name for row in silo.compare(one, other).rows) == expected
        assert sorted(values_differ(one, other)) == expected


def test_both_meet_on_the_stamps_when_asked(tmp_path):
    a = ramp(tmp_path, 50, "a")
    later = ramp(tmp_path, 50, "b", start_ns=10**18 + 10**8, first=10)  # the same run, saved 10 ticks later
    assert silo.compare(a, later)
    assert not silo.compare(a, later, by="stamps").rows
    result = CliRunner().invoke(cli, ["diff", str(tmp_path / "a.silo"), str(tmp_path / "b.silo"), "--by", "stamps"])
    assert result.exit_code == 0
    assert "equal over the time that both have: 2 signals" in result.output
    assert "compared from 0.1 to 0.49 s" in result.output
    with pytest.raises(silo.SiloError, match="'start' or 'stamps'"):
        silo.compare(a, later, by="stamp")


def test_one_sample_in_common_is_compared(tmp_path):
    a, b = ramp(tmp_path, 50, "a"), ramp(tmp_path, 50, "b", start_ns=10**18 + 49 * 10**7, first=50)
    found = silo.compare(a, b, by="stamps")
    assert [(row.name, row.largest, row.samples) for row in found.rows if row.name == "/log/x"] == [("/log/x", 1.0, 1)]


def test_logs_without_a_moment_in_common_are_told_by_both(tmp_path):
    a, b = ramp(tmp_path, 50, "a"), ramp(tmp_path, 50, "b", start_ns=2 * 10**18)
    assert "there is no time in common" in silo.compare(a, b, by="stamps").not_compared["/log/x"]
    assert any("there is no time in common" in one.what for one in differences(a.recording, b.recording, by="stamps"))


def test_an_element_that_ended_early_is_not_held_on_when_a_log_is_resampled(tmp_path):
    now = [10**18]
    log = silo.Logger("ends", frequency=100, folder=tmp_path, script=tmp_path / "no.yaml", clock=lambda: now[0])
    log.array("long", size=100, buffer="growing")
    log.array("short", size=10, buffer="fixed")
    log.start()
    for tick in range(100):
        now[0] = 10**18 + tick * 10**7
        log.collect()
    (saved,) = log.save()
    log.close()
    ticks = silo.open_log(saved.path)
    again = ticks.resample(ticks["long"])
    assert (len(again["long"]), len(again["short"])) == (100, 10)


def test_a_plot_of_one_over_another_ends_where_the_other_ends(tmp_path):
    from silo.analysis.plots.charts import ChartSpec, make_chart

    log = ramp(tmp_path, 100, "long")
    short = log.clip(0, 0.495)
    elements = (log.recording.elements[0], replace(short.recording.elements[1], name="/log/short"))
    joined = replace(log.recording, elements=elements)
    chart, _ = make_chart(joined, ChartSpec(["x"], x="short"))
    assert np.isfinite(chart.curves[0].x).sum() == 50


def test_what_stands_still_meets_at_its_own_time():
    stamps = np.full(6, 10**9)
    one, other = silo.Signal("x", np.arange(6.0), stamps), silo.Signal("y", np.arange(3.0), stamps[:3])
    assert other.resample(one).values.tolist() == [2.0] * 6
    assert len(one - other) == 6
