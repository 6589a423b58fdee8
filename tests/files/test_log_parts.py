"""Parts of logs, the same at other times, plots and files of them, runs that are compared."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import silo


def run(folder, name="robot", count=50, delay=0, offset=0.0, extra=None, start_ns=10**18):
    """A run of `count` ticks of 0.1 s: `x` a bump that comes `delay` ticks late, `slow` every fifth tick."""
    ticks = iter(range(10**6))
    log = silo.Logger(
        name, frequency=10, folder=folder, script=folder / "no.yaml", clock=lambda: start_ns + next(ticks) * 10**8
    )
    x, mode = log.array("x", unit="m"), log.array("mode", dtype=int, labels={0: "STAND", 1: "WALK"})
    q, slow = log.array("q", 2, unit="rad"), log.array("slow", divider=5)
    if extra:
        log.array(extra)
    log.start()
    for tick in range(count):
        x[...] = np.exp(-(((tick - 20 - delay) / 4) ** 2)) + offset
        mode[...], q[:], slow[...] = tick >= 20 + delay, [tick / 10, -1], tick
        log.collect()
    (saved,) = log.save()
    log.close()
    return silo.open_log(saved.path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def log(folder):
    return run(folder)


def test_a_part_keeps_what_was_logged_in_it_and_the_time(log):
    part = log.clip(1.0, 2.0)
    assert part["x"].times.round(6).tolist() == log["x"][1.0:2.0].times.round(6).tolist()
    assert part["slow"].values.tolist() == [10, 15, 20]
    assert part["slow"].times.round(6).tolist() == [1.0, 1.5, 2.0]
    assert part.duration_s == pytest.approx(1.0)


def test_a_part_that_begins_between_two_samples_begins_with_the_next(log):
    assert log.clip(1.1, 1.9)["slow"].values.tolist() == [15]
    assert log.clip(1.1, 1.4)["slow"].values.tolist() == []
    assert log.clip(4.0)["slow"].values.tolist() == [40, 45]
    assert log.clip(None, 0.4)["slow"].values.tolist() == [0]


@pytest.mark.parametrize("ending", [".silo", ".csv", ".mcap"])
def test_a_part_is_saved_and_read_again(log, ending, tmp_path):
    part = log.clip(1.1, 2.1)
    path = part.save(tmp_path / f"part{ending}")
    again = silo.open_log(path)
    for name in part:
        assert np.array_equal(again[name].values, part[name].values), name
        assert np.array_equal(again[name].time_ns, part[name].time_ns), name


def test_a_log_at_another_rate_has_all_elements_at_the_same_times(log):
    made = log.resample(20.0)
    assert {tuple(signal.time_ns) for signal in made.values()} == {tuple(made["x"].time_ns)}
    assert made["slow"].values[:12].tolist() == [0] * 10 + [5] * 2
    assert made["mode"].labels == log["mode"].labels
    assert len(made["x"]) == 99


def test_a_log_between_its_samples_goes_straight(log):
    made = log.resample(20.0, "linear")
    assert made["slow"].values[:5].tolist() == pytest.approx([0, 0.5, 1, 1.5, 2])
    assert made["slow"].times[-1] == pytest.approx(4.5)
    assert set(made["mode"].values.tolist()) == {0, 1}


def test_the_turns_of_a_log_go_as_those_of_its_signals(new_logger):
    stamps = itertools.count(0, 100_000_000)
    log = new_logger(frequency=10, clock=stamps.__next__)
    turn = log.array("turn", 4, kind="quaternion")
    log.start()
    for at in range(20):
        turn[:] = np.array([0, 0, np.sin(at * 0.1), np.cos(at * 0.1)]) * (-1) ** at
        log.collect()
    log.stop()
    opened = silo.open_log(log.save().path)
    made = opened.resample(25.0, "linear")["turn"]
    assert made.norm().values == pytest.approx(1, abs=1e-12)
    assert made.values.tolist() == opened["turn"].resample(25.0, "linear").values.tolist()


def test_a_log_at_the_times_of_a_signal(log):
    assert log.resample(log["slow"])["x"].time_ns.tolist() == log["slow"].time_ns.tolist()


def test_a_log_is_not_saved_over_another_unless_asked(log, tmp_path):
    path = log.save(tmp_path / "x.silo")
    with pytest.raises(silo.SaveError, match="exists already; write overwrite=True"):
        log.save(path)
    assert log.save(path, overwrite=True) == path


def test_a_log_is_plotted_by_pattern(log, capsys, tmp_path):
    log.plot("x", right=["q"], terminal=True, start_s=1.0, stop_s=2.0)
    printed = capsys.readouterr().out
    assert "/log/x [m] (left)" in printed
    assert "/log/q_0 [rad] (right)" in printed
    assert log.plot("q", path=tmp_path / "q.png").read_bytes().startswith(b"\x89PNG")


def test_more_than_fits_a_plot_is_told_of(log, monkeypatch):
    monkeypatch.setattr("silo.analysis.plots.charts.MOST_CURVES", 1)
    with pytest.warns(silo.LogWarning, match="not drawn: 1 more signal of these patterns$"):
        log.plot("q", terminal=True)
    log.plot("x", terminal=True)


def test_a_name_that_means_nothing_is_told_of_and_all_of_an_empty_log_is_nothing(log, recwarn):
    empty = silo.Log(replace(log.recording, elements=[]))
    assert (empty.names("*"), list(recwarn)) == ([], [])
    for some, pattern in ((empty, "x"), (log, "nothing/*")):
        with pytest.warns(silo.LogWarning, match="has no signal that"):
            assert some.names(pattern) == []


def test_a_part_is_plotted_by_the_times_of_the_whole(log, capsys):
    log.clip(1.0, 3.0).plot("slow", terminal=True, start_s=1.0, stop_s=1.6)
    assert "10 ... 15" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda log, folder: log.clip("a"), "start_s must be from -1e+09 and below 1e+09 s since start, got 'a'"),
        (lambda log, folder: log.clip(90, 99), "the log has no tick from 90 s to 99 s; it goes from 0 to 4.9 s"),
        (lambda log, folder: log.clip(t0=1), "log.clip() has no argument 't0', did you mean 'start_s'?; "
         "nothing was done"),
        (lambda log, folder: log.resample("a"), "times of 'the log' must be numbers, in seconds since start "
         "(or a rate in Hz), got 'a'"),
        (lambda log, folder: log.resample(0), "can't resample 'the log' at 0 Hz: the rate must be more than 0, "
         "and finite"),
        (lambda log, folder: log.resample(5, "cubic"), "unknown method 'cubic' to resample a log: choose "
         "'hold' or 'linear'"),
        (lambda log, folder: log.save("x.docx"), "'x.docx': silo can't write .docx, only .silo, .mcap, "
         ".rosbag2 (a folder; .bag, too), .csv, .parquet, .mat, .npz, .h5 and .rrd"),
        (lambda log, folder: log.save(5), "path must be a path, got 5; write path='some/path'"),
        (lambda log, folder: log.save(folder), "'FOLDER' is a folder: it is not replaced; choose another name"),
        (lambda log, folder: log.plot(), "say what to plot: log.plot('/log/joints/*'); it has 4 elements, see "
         "list(log)"),
        (lambda log, folder: log.plot("nope"), "no signal matches 'nope'; there are 4 elements, such as "
         "/log/x, /log/mode, /log/q"),
        (lambda log, folder: log.plot(5), "pattern must be a text, got 5 (int); write log.plot('/log/joints/*')"),
        (lambda log, folder: log.plot("x", start_s=50.0), "there is no sample to plot in that window; the log "
         "goes from 0 to 4.9 s"),
        (lambda log, folder: log.signals, "a log has no 'signals': list(log) has the names, log['/log/x'] is "
         "one of them, log.glob('*') are all"),
        (lambda log, folder: log.to_csv("x"), "a log has no 'to_csv': it is log.save('x.csv')"),
        (lambda log, folder: log.duration, "a log has no 'duration': it is .duration_s"),
        (lambda log, folder: log.clp(1), "a log has no 'clp': did you mean 'clip'?"),
        (lambda log, folder: silo.compare(log), "silo.compare() needs b: write silo.compare(a, b, pattern=..., "
         "event=..., signal=..., ...)"),
        (lambda log, folder: silo.compare(log, 5.5), "which log must be a path, the start of a file name or a "
         "run number, got 5.5; write silo.open_log('logs/robot_2026')"),
        (lambda log, folder: silo.compare(log, log, event=5), "event must be a function of a log, got 5; write "
         "event=lambda log: log['x'] > 1"),
        (
            lambda log, folder: silo.compare(log, log, event=lambda one: one["x"] > 99),
            "the event '(/log/x > 99)' doesn't happen in the first run, which has samples from 0 to 4.9 s",
        ),
        (lambda log, folder: silo.compare(log, log, signal="nope"), "the log has no signal 'nope'; it has 4 "
         "elements, see list(log)"),
        (lambda log, folder: silo.compare(log, log, signal="q"), "'/log/q' has components: name one of them, "
         "such as '/log/q_0'"),
        (lambda log, folder: silo.compare(log, log, event=abs, signal="x"),
         "compare takes event= or signal=, not both"),
        (lambda log, folder: silo.compare(log, log, tolerance="a"), "tolerance must be from 0 and below inf, "
         "got 'a'"),
        (lambda log, folder: silo.compare(log, log).plot(), "nothing differs: no plot"),
        (lambda log, folder: silo.open_logs(folder / "nope"), "no log 'nope' in 'FOLDER'; there are: LOG"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_told_of(call, words, log, folder):
    with pytest.raises(silo.SiloError) as caught:
        call(log, folder)
    assert str(caught.value) == words.replace("FOLDER", str(folder)).replace("LOG", next(folder.glob("*.silo")).name)


# ------------------------------------------------------------------------------------------------------ two runs


def test_equal_runs_have_no_difference(log):
    found = silo.compare(log, log)
    assert not found
    assert "0 entries differ, 5 are alike" in str(found)
    assert "0 entries differ, 1 is alike" in str(silo.compare(log, log, "x"))


def test_runs_are_compared_from_their_starts(log, tmp_path):
    other = run(tmp_path, offset=0.5, extra="more", start_ns=2 * 10**18)
    found = silo.compare(log, other)
    assert [row.name for row in found.rows] == ["/log/x"]
    (row,) = found.rows
    assert (row.largest, row.rms, row.mean) == pytest.approx((0.5, 0.5, 0.5))
    assert row.differ == 1.0
    assert found.only_b == ("/log/more",)
    assert "only in the second: /log/more" in str(found)
    assert "<td>/log/x</td>" in found._repr_html_()


@pytest.mark.parametrize(
    "how",
    [
        {"event": lambda log: log["mode"] == "WALK"},
        {"event": lambda log: float(log["x"].times[log["x"].values.argmax()])},
        {"signal": "x"},
        {"signal": "/log/x"},
    ],
    ids=["a mask", "a time", "a course", "a full name"],
)
def test_runs_are_laid_on_each_other_by_an_event_or_a_course(how, log, tmp_path):
    late = run(tmp_path, delay=7, start_ns=3 * 10**18)
    found = silo.compare(log, late, **how)
    assert found.shift_s == pytest.approx(-0.7)
    assert next((row.largest for row in found.rows if row.name == "/log/x"), 0.0) < 1e-6
    assert "moved by -0.7 s" in str(found)


def test_the_most_different_signal_comes_first_and_is_plotted(log, tmp_path, capsys):
    found = silo.compare(log, run(tmp_path, delay=15))
    assert found.rows[0].rms >= found.rows[-1].rms or found.rows[0].name == "/log/x"
    found.plot("x", terminal=True)
    assert "a: /log/x" in capsys.readouterr().out


# ------------------------------------------------------------------------------------------------- folders and globs


def test_a_folder_or_a_glob_means_the_newest_log_and_all_of_them(tmp_path):
    first, second = run(tmp_path), run(tmp_path)
    assert silo.open_log(tmp_path).path == second.path
    assert silo.open_log(tmp_path / "robot_*").path == second.path
    assert silo.open_log("*00001.silo", tmp_path).path == first.path
    assert [log.path for log in silo.open_logs(tmp_path)] == [first.path, second.path]
    assert [log.path for log in silo.open_logs("robot_*", tmp_path)] == [first.path, second.path]
    assert [log.path for log in silo.open_logs(first.path)] == [first.path]


def test_of_one_save_in_several_formats_one_is_opened(tmp_path):
    log = run(tmp_path)
    log.save(log.path.replace(".silo", ".csv"))
    assert [one.path for one in silo.open_logs(tmp_path)] == [log.path]


def test_a_log_shows_itself_in_a_notebook(log):
    assert log.name == "robot"
    assert "<td>/log/x</td><td>m</td>" in log._repr_html_()
