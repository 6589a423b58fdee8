"""Two runs meet on the time since their starts, also where buffers looped and the files hold no more than the end."""

import datetime
from dataclasses import replace

import numpy as np
import pytest

import silo
from silo.analysis.compare import differences
from silo.analysis.log import Log, run_begins
from silo.analysis.reports import format_report, report
from silo.core.conditions import CaptureFacts, Conditions
from silo.core.elements import LoggedEvent, Stretch
from silo.core.recording import Recording
from silo.guards.guard import guard
from silo.guards.rules import read_rules
from silo_tui.model.lists.runs import of_one, together

BEGAN_NS = 1_796_000_000 * 10**9


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A step at 11.5 s of a run of 12 s and of one of 15 s, of which both files hold the newest 10 s."""
    folder = tmp_path_factory.mktemp("logs")
    return [logged(folder, "a", 1200), logged(folder, "b", 1500, begin_s=100)]


def logged(folder, name, ticks, begin_s=0):
    stamps = iter(begin_s + np.arange(ticks + 9) * 0.01)
    with silo.Logger(name, frequency=100, folder=folder, clock=lambda: float(next(stamps))) as log:
        q = log.array("q")
        log.start()
        for tick in range(ticks):
            q[...] = tick >= 1150
            log.collect()
        return silo.open_log(log.save().path)


def test_two_runs_whose_buffers_looped_are_alike_where_they_did_the_same(runs):
    found = silo.compare(*runs)
    assert not found, found
    assert "the first file begins 2 s after its run did, counted by 200 ticks that it doesn't hold" in str(found)
    assert "the second file begins 5 s after its run did" in str(found)
    assert [one for one in differences(*(run.recording for run in runs)) if one.name == "/log/q" and one.differs] == []


def test_a_run_is_held_against_a_good_one_at_the_same_time_since_their_starts(runs, tmp_path):
    rules = tmp_path / "rules.yaml"
    rules.write_text("- signals: q\n")
    good, run = (one.recording for one in runs)
    assert not any(one.violated for one in guard(run, read_rules(rules), good))


@pytest.mark.filterwarnings("ignore:.*the time that both have")
def test_signals_of_two_runs_meet_on_the_time_since_their_starts(runs):
    a, b = (run["q"] for run in runs)
    assert not (a - b).values.any()
    assert (a - b).times[[0, -1]] == pytest.approx([3.0, 9.99])
    assert (b.resample(a).values == a.values[300:]).all()
    assert not (runs[0].clip(4, 9)["q"] - runs[1].eval("q")).values.any()
    assert (a - b.counted_from(b.start_ns)).values.any(), "who says where times count from is heard"
    for start in (a, a.start_ns):
        with pytest.raises(silo.ElementError, match="no time in common"):
            a - b.counted_from(start)  # on the stamps, as they are


def test_runs_lie_over_each_other_in_the_terminal_by_the_time_since_their_starts(runs):
    named = list(zip("ab", runs, strict=True))
    log = Log(together(named))
    assert (log["q/a"].values == log["q/b"].values).all()
    one = of_one(named, "/log/q")
    assert one.start_ns == -3 * 10**9, "what is 3 s behind the first sample of the first run stands at 0"


def test_a_run_that_is_whole_meets_one_whose_buffers_looped(tmp_path):
    whole, end = (logged(tmp_path, name, ticks) for name, ticks in (("whole", 900), ("end", 1500)))
    assert (whole.run_start_ns, end.run_start_ns) == (whole.start_ns, 10_000_000)
    with pytest.warns(silo.LogWarning, match="from 5 to 8.99 s"):
        assert (whole["q"] - end["q"]).times[0] == pytest.approx(5)


@pytest.mark.parametrize("ending", ["csv", "npz", "parquet"])
def test_a_run_and_its_copy_in_another_format_meet_on_their_stamps(runs, tmp_path, ending):
    path = runs[0].save(tmp_path / f"copy.{ending}")
    assert not silo.compare(runs[0], path)
    thinner = runs[0].resample(10.0).save(tmp_path / f"thin.{ending}")
    assert not silo.compare(runs[0], thinner)


def test_a_file_that_doesnt_tell_when_its_run_began_meets_others_by_its_first_sample(runs):
    untold = Log(replace(runs[1].recording, started_ns=0))
    assert untold.run_start_ns is None
    found = silo.compare(runs[0], untold)
    assert found.shift_s == 0
    assert "laid on each other by their first samples: the file of the second doesn't tell when its run began" in str(
        found
    )


def held(time_ns, ticks, **more):
    return Recording("robot", np.asarray(time_ns, np.int64), ticks, (), started_ns=BEGAN_NS, **more)


def test_a_run_begins_at_its_first_tick_counted_back_from_the_earliest_whose_stamp_is_known():
    time_ns = BEGAN_NS + np.arange(400, 500) * 10**7
    assert Log(held(time_ns, 500)).run_start_ns == BEGAN_NS
    known = LoggedEvent("marker", "there", tick=100, stamp_ns=BEGAN_NS + 3 * 10**9)  # it waited after that
    assert Log(held(time_ns, 500, events=(known,))).run_start_ns == BEGAN_NS + 2 * 10**9
    first = LoggedEvent("started", "started", tick=0, stamp_ns=BEGAN_NS + 77)
    assert Log(held(time_ns, 500, events=(first, known))).run_start_ns == BEGAN_NS + 77
    assert Log(held(time_ns, 600)).run_start_ns == BEGAN_NS, "not before it was started"
    assert Log(held(time_ns, 0)).run_start_ns is None
    assert Log(held(time_ns[:1], 500)).run_start_ns is None, "nothing tells how far ticks were from each other"
    assert Log(held(time_ns[:1], 401, frequency_hz=100.0)).run_start_ns == BEGAN_NS


def test_the_parts_of_a_run_that_was_cut_meet_by_the_starts_of_each(runs):
    first = replace(runs[0].recording, offset=1000, stretch=Stretch("cut", part=1, parts=2))
    second = replace(first, time_ns=first.time_ns + 10**10, stretch=Stretch("cut", part=2, parts=2))
    assert not silo.compare(Log(first), Log(second))
    unknown = [replace(one, stretch=None) for one in (first, second)]
    with pytest.raises(silo.ElementError, match="no time in common"):
        Log(unknown[0])["q"] - Log(unknown[1])["q"]  # of one run all stamps are of one clock


def test_two_captures_meet_by_their_first_samples(runs):
    captures = [
        Log(replace(run.recording, conditions=Conditions(capture=CaptureFacts("hit", 1, first, first + 999))))
        for run, first in zip(runs, (200, 500), strict=True)
    ]
    assert run_begins(captures) == [one.start_ns for one in captures]
    assert silo.compare(*captures).shift_s == 0


def test_the_report_of_a_file_says_when_its_run_was_started(runs):
    time_ns = BEGAN_NS + np.arange(400, 500) * 10**7
    when = datetime.datetime.fromtimestamp(BEGAN_NS / 1e9, tz=datetime.timezone.utc).astimezone()
    assert f"started {when:%Y-%m-%d %H:%M:%S %z}" in format_report(report(held(time_ns, 500), "x.silo", 1), 120)
    untold = format_report(report(replace(held(time_ns, 500), started_ns=0), "x.silo", 1), 120)
    assert "first sample 20" in untold and "started" not in untold
