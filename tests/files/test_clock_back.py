"""A clock that steps back within a log: told when the log is opened, and what is asked of it is answered right."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.analysis.compute.samples import unfolded_ticks
from silo.cli.group import cli

STEP = 10**7
START = 10**18
COUNT = 40
BACK = 20  # the tick that has the stamp of the first one again


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("back")
    now = [START]
    log = silo.Logger("back", frequency=100, folder=folder, script=folder / "no.yaml", clock=lambda: now[0])
    x, slow = log.array("x"), log.array("slow", divider=3)
    log.start()
    for tick in range(COUNT):
        now[0] = START + tick % BACK * STEP
        x[...] = slow[...] = tick
        log.collect()
    (saved,) = log.save()
    log.close()
    return saved.path


@pytest.fixture(scope="module")
def log(path):
    with pytest.warns(silo.LogWarning, match=r"the clock stepped back once, first by 0\.19 s at 0\.19 s"):
        return silo.open_log(path)


def ticks_within(low_s, high_s, divider=1):
    """What lies there, by looking at each tick."""
    return [t for t in range(0, COUNT, divider) if low_s - 1e-9 <= t % BACK * STEP * 1e-9 <= high_s + 1e-9]


@pytest.mark.parametrize(("low", "high"), [(0.02, 0.06), (0.0, 0.19), (0.185, 0.4), (0.05, 0.05)])
def test_a_part_has_all_that_was_collected_at_these_times(log, low, high):
    assert log["x"].clip(low, high).values.tolist() == ticks_within(low, high)
    assert log["x"][low:high].values.tolist() == ticks_within(low, high)
    part = log.clip(low, high)
    assert part["x"].values.tolist() == ticks_within(low, high)
    assert part["slow"].values.tolist() == ticks_within(low, high, 3)
    assert part["slow"].times.round(6).tolist() == [t % BACK * 0.01 for t in ticks_within(low, high, 3)]


def test_statistics_of_a_window_are_of_all_its_samples(log):
    assert log["x"].mean(0.02, 0.06) == np.mean(ticks_within(0.02, 0.06))
    assert log["x"].max(0.0, 0.1) == 30


def test_the_value_at_a_time_is_the_one_that_was_collected_last(log):
    assert log["x"].value(0.05) == 25
    assert log["x"].value([0.0, 0.055, 0.19]).tolist() == [20, 25, 39]
    assert log["slow"].value(0.05) == 24


def test_the_same_at_a_rate_is_in_the_order_of_ticks_at_other_times_in_that_of_time(log):
    assert log["x"].resample(100.0).values.tolist() == list(range(COUNT))
    assert log.resample([0.0, 0.1, 0.19])["x"].values.tolist() == [20, 30, 39]
    assert log["x"].resample([0.1, 0.19], "linear").values.tolist() == [30, 39]


@pytest.mark.parametrize(
    ("stamps", "even", "risen"),
    [
        ([5, 7, 9, 6, 8], True, [5, 7, 9, 11, 13]),
        ([5, 5, 3], False, [5, 5, 6]),
        ([0, 0, 10, 10], False, [0, 0, 10, 10]),
        ([9, 9, 29, 29], True, [9, 14, 19, 24]),
        ([9, 9, 10, 10], True, [9, 10, 11, 12]),
        ([9, 9], True, [9, 10]),
    ],
)
def test_ticks_rise_by_a_usual_step_where_their_stamps_do_not(stamps, even, risen):
    assert unfolded_ticks(np.array(stamps, np.int64), even=even).risen_ns.tolist() == risen


def test_a_table_has_each_sample_in_its_row(log):
    pytest.importorskip("pandas")
    frame = log.to_pandas()
    assert frame["/log/x"].tolist() == list(range(COUNT))
    assert frame["/log/slow"].dropna().tolist() == list(range(0, COUNT, 3))
    assert np.flatnonzero(frame["/log/slow"].notna()).tolist() == list(range(0, COUNT, 3))


def test_how_long_it_took_is_what_passed_between_the_steps(path, tmp_path, log):
    lasted = (COUNT - 2) * STEP * 1e-9
    assert log.duration_s == pytest.approx(lasted)
    (run,) = silo.runs(Path(path).parent)
    assert run.facts.span_s == pytest.approx(lasted)
    told = json.loads(CliRunner().invoke(cli, ["info", str(path), "--json"]).stdout)
    assert told["duration_s"] == pytest.approx(lasted)
    assert [(one["start_s"], one["end_s"]) for one in told["elements"]] == [(0.0, 0.19)] * 2


def test_a_part_over_the_step_that_a_format_can_not_keep_is_told_why_and_saved_at_a_rate(log, tmp_path):
    part = log.clip(0.0, 0.11)
    with pytest.raises(silo.SaveError, match=r"but an element across a step back of the clock has its own: choose"):
        part.save(tmp_path / "part.silo")
    part.resample(100).save(tmp_path / "part.silo")


def test_the_shell_tells_of_it(path):
    result = CliRunner().invoke(cli, ["stats", str(path)])
    assert result.exit_code == 0
    assert "the clock stepped back once" in result.output


@pytest.mark.parametrize("ending", [".csv", ".mcap", ".rosbag2"])
def test_each_format_tells_of_it_once_and_goes_on_to_tell_what_is_found_later(path, tmp_path, ending):
    copy = tmp_path / f"copy{ending}"
    with pytest.warns(silo.LogWarning, match="the clock stepped back once"):
        silo.open_log(path).save(copy)
    with pytest.warns(silo.LogWarning, match="the clock stepped back once"):
        log = silo.open_log(copy)
    assert [text.startswith("the clock stepped back once") for text in log.warnings] == [True]
    if ending != ".csv":
        with pytest.warns(silo.LogWarning, match="found later"):
            log.recording.warnings.add("found later")
        assert "found later" in log.warnings
