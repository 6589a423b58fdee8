"""`timing=True`: how late the loop is, as elements of the log; the text of `collect()` stays as it was."""

import numpy as np

import silo
from silo.loop import clocks


def turned(log, ticks=5):
    log.add(np.zeros(2), "q")
    log.start()
    for _ in range(ticks):
        log.collect()
    return silo.Log(log.snapshot())


def test_period_lateness_and_work_are_logged_in_seconds(new_logger):
    run = turned(new_logger(timing=True))
    assert [run[f"timing/{name}"].unit for name in clocks.TIMES] == ["s"] * 3
    period, work = run["timing/period"].values, run["timing/work"].values
    assert np.isnan([period[0], work[0]]).all()
    assert (period[1:] >= work[1:]).all()
    assert (work[1:] > 0).all()


def test_lateness_counts_from_the_tick_that_came_earliest(monkeypatch):
    came = iter([10.0, 10.0, 10.13, 10.13, 10.2, 10.2, 10.25, 10.25, 10.36, 10.36])  # before and after each collect()
    monkeypatch.setattr(clocks.time, "perf_counter", lambda: next(came))
    values = [np.zeros(()) for _ in clocks.TIMES]
    late = []
    tick = clocks.timed(lambda: late.append(round(float(values[1]), 6)), values, 10)
    for _ in range(5):
        tick()
    assert late == [0.0, 0.03, 0.0, 0.0, 0.01]


def test_the_log_has_no_such_elements_without(new_logger):
    log = new_logger()
    assert list(turned(log)) == ["/log/q"]
    assert log.collect.__name__ == "collect"


def test_a_new_run_begins_anew(new_logger):
    log = new_logger(timing=True)
    turned(log)
    log.restart()
    log.collect()
    assert np.isnan(silo.Log(log.snapshot())["timing/period"].values).tolist() == [True]


def test_frequency_and_time_are_numbers_or_words(new_logger):
    for given, frequency_hz in (("500Hz", 500), ("1 kHz", 1000), (250, 250)):
        assert new_logger(frequency=given).options.frequency_hz == frequency_hz
    for given, seconds in (("10min", 600), ("60s", 60), ("1h", 3600), (5, 5)):
        assert new_logger(max_time=given).options.max_time_s == seconds
