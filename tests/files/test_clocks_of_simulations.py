"""Logs whose clock begins anew with each reset, or stands still for some ticks: signals meet by their ticks."""

import contextlib
import warnings

import numpy as np
import pytest

import silo
from silo.analysis.log import Log
from silo.analysis.reports import report
from silo.core.elements import LoggedEvent
from silo.core.recording import Recording, samples_of_ticks
from tests.stand_ins.saved import element

TICKS = 400


def anew(tick):
    return (tick % 150) * 0.01


def still(tick):
    return (tick // 5) * 0.05


def both(tick):
    return ((tick % 150) // 5) * 0.05


@pytest.fixture
def logged(new_logger):
    """Makes a log of two elements that hold the number of their tick, `w` slower, maybe off for a while by two cuts."""

    def made(clock, *, cut="", ticks=TICKS):
        now = [0]
        log = new_logger("sim", frequency=100, max_time=0, clock=lambda: clock(now[0]))
        n = log.array("n", size=1000)
        w = log.array("w", divider=3, size=1000)
        log.start()
        for tick in range(ticks):
            now[0] = tick
            n[...] = w[...] = tick
            if tick == 200 and cut == "divider":
                log.set("w", divider=2, cut=True)
            if cut == "off" and tick in (200, 260):
                log.set("w", enabled=tick == 260, cut=True)
            log.collect()
        log.stop()
        log.save()
        with contextlib.nullcontext() if clock is still else pytest.warns(silo.LogWarning):
            return silo.open_log(log.options.folder)

    return made


def sampled(cut):
    """At which ticks `w` has a sample, and what it holds at each: NaN where nothing."""
    at = [k for k in range(TICKS) if (k < 200 and k % 3 == 0) or (k >= 200 and _late(k, cut))]
    held = np.full(TICKS, np.nan)
    for begin, end in zip(at, [*at[1:], TICKS], strict=True):
        held[begin:end] = begin
    if cut == "off":
        held[200:260] = np.nan
    return at, held


def _late(k, cut):
    if cut == "divider":
        return (k - 200) % 2 == 0
    return k >= 260 and (k - 260) % 3 == 0 if cut == "off" else k % 3 == 0


@pytest.mark.parametrize("cut", ["", "divider", "off"])
@pytest.mark.parametrize("clock", [anew, still, both], ids=lambda clock: clock.__name__)
def test_signals_meet_by_their_ticks_however_it_is_written(logged, clock, cut):
    log = logged(clock, cut=cut)
    at, held = sampled(cut)
    known = ~np.isnan(held)
    difference = (np.arange(TICKS) - held)[known]
    assert log["w"].values.tolist() == at
    for made in (log["n"] - log["w"], log["n"] - log["w"].resample(log["n"])):
        np.testing.assert_array_equal(made.values, difference)
        np.testing.assert_array_equal(made.time_ns, log["n"].time_ns[known])
    np.testing.assert_array_equal(log.eval("n - w").values[-len(difference) :], difference)
    table = log.to_polars()
    column = next(name for name in table.columns if name.endswith("/w"))
    assert table[column].drop_nulls().to_list() == at
    frame = log.to_pandas()
    assert frame[column].dropna().tolist() == at
    assert np.flatnonzero(frame[column].notna()).tolist() == at


@pytest.mark.parametrize("cut", ["", "divider"])
def test_each_episode_is_at_one_rate(logged, cut):
    log = logged(anew, cut=cut)
    _, held = sampled(cut)
    for made in (log.resample(100), log.resample(log["n"])):
        assert made["n"].values.tolist() == list(range(TICKS))
        np.testing.assert_array_equal(made.time_ns, log.time_ns)
        np.testing.assert_array_equal(made["w"].values, held[: len(made["w"])])
    assert log["n"].resample(50).values.tolist() == list(range(0, TICKS, 2))
    half = log.resample(50, "linear")
    assert half["n"].values.tolist() == list(range(0, TICKS, 2))


def test_an_episode_of_a_run_that_was_cut_has_its_own_samples(logged):
    log = logged(anew, cut="divider")
    recording = log.recording
    slow = next(one for one in recording.elements if one.name.endswith("/w"))
    mine = samples_of_ticks(recording, slow, 150, 300)
    assert log["w"].values[mine].tolist() == [k for k in sampled("divider")[0] if 150 <= k < 300]


def test_runs_of_several_episodes_are_compared_tick_by_tick(logged, tmp_path):
    one, other = logged(anew), logged(anew, ticks=TICKS - 3)
    found = silo.compare(one, other)
    assert (len(found), found.alike) == (0, 2), str(found)


@pytest.mark.parametrize("cut", ["", "off"])
@pytest.mark.parametrize("clock", [anew, still, both], ids=lambda clock: clock.__name__)
def test_parts_of_signals_and_what_is_made_of_them_keep_their_ticks(logged, clock, cut):
    log = logged(clock, cut=cut)
    at, held = sampled(cut)
    n, w, known = log["n"], log["w"], ~np.isnan(held)
    np.testing.assert_array_equal(((n - w) + w).values, n.values[known])
    late = known & (np.arange(TICKS) >= 150) & (np.arange(TICKS) < 300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal((n[150:300] - w).values, (np.arange(TICKS) - held)[late])
        np.testing.assert_array_equal((n[n.values % 2 == 1] - w).values, (np.arange(TICKS) - held)[known][1::2])
        np.testing.assert_array_equal((log.eval("2 * w") - w).values, w.values[: len(at)])
    for made in (lambda: n[:0] - w, lambda: n - w[:0], lambda: n[:0].resample(w)):
        with pytest.raises(silo.ElementError, match="no time in common"):
            made()
    with pytest.raises(silo.ElementError, match="must be numbers"):
        log.resample([[1], [1, 2]])


def test_what_was_off_for_as_long_as_an_episode_is_where_it_was(new_logger):
    now = [0]
    log = new_logger("sim", frequency=100, max_time=0, clock=lambda: anew(now[0]))
    n, w = log.array("n", size=1000), log.array("w", divider=3, size=1000)
    log.start()
    for tick in range(TICKS):
        now[0] = tick
        n[...] = w[...] = tick
        if tick in (100, 250):
            log.set("w", enabled=tick == 250, cut=True)
        log.collect()
    log.stop()
    log.save()
    with pytest.warns(silo.LogWarning):
        log = silo.open_log(log.options.folder)
    for made in (log["n"] - log["w"], log.eval("n - w")):
        assert (made.values.min(), made.values.max(), len(made)) == (0, 2, TICKS - 150)


def test_the_newest_of_a_looping_buffer_is_of_the_last_episodes(new_logger):
    now = [0]
    log = new_logger("sim", frequency=100, max_time=0, clock=lambda: anew(now[0]))
    n, w = log.array("n", size=1000), log.array("w", divider=3, size=50, buffer="looping")
    log.start()
    for tick in range(TICKS):
        now[0] = tick
        n[...] = w[...] = tick
        log.collect()
    log.stop()
    log.save()
    with pytest.warns(silo.LogWarning):
        log = silo.open_log(log.options.folder)
    made = log["n"] - log["w"]
    assert (made.values.min(), made.values.max()) == (0, 2)
    table = log.to_polars()
    rows = table.with_row_index().drop_nulls()
    column = next(name for name in table.columns if name.endswith("/w"))
    assert rows["index"].to_list() == rows[column].to_list()


def test_missing_ticks_of_episodes_have_no_samples_at_a_rate():
    axis = np.concatenate([np.arange(50), np.arange(20), np.arange(30, 60)]) * 10_000_000
    values = np.arange(100.0)
    missing = ((int(axis[69]), int(axis[70])),)
    made = Recording("sim", axis, 100, [element("x", values)], prefix="/log", gaps=missing)
    found = Log(made).resample(100)["x"].values
    assert len(found) == 110
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found)), np.arange(70, 80))


def test_rates_of_a_clock_that_begins_anew_are_those_of_its_steps_ahead(logged, tmp_path):
    log = logged(anew)
    found = report(log.recording, "run", 0)
    assert found.rate_hz == pytest.approx(100)
    assert [one.rate_hz for one in found.elements] == pytest.approx([100, 100 / 3])
    (run,) = silo.runs(log.path.rpartition("/")[0])
    assert run.facts.rate_hz == pytest.approx(100)


def test_what_has_no_tick_counts_from_the_start_where_stamps_are_of_another_clock():
    start = 1_700_000_000 * 10**9
    told = (LoggedEvent("marker", "begin", start - 10**8), LoggedEvent("marker", "push", start + 10**9, 3, 3 * 10**7))
    stamps = 10**7 * np.arange(5)
    log = Log(Recording("sim", stamps, 5, [element("n", np.arange(5.0))], started_ns=start, events=told))
    assert [event.seconds for event in log.events] == pytest.approx([-0.1, 0.03])
