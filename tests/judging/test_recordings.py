"""Expressions, derived signals and limits on recordings: by `Log`, in every format, by the shell commands."""

import json
import math

import numpy as np
import pytest

import silo
from silo.analysis.check import check
from silo.analysis.log import Log
from silo.analysis.plots.curves import pick
from silo.cli.codes import EXIT_BLIND, EXIT_FAILED, EXIT_FOUND
from silo.cli.main import run
from silo.core.conditions import Conditions, Derived, SignalLimits
from silo.core.recording import Recording
from silo.errors import ExpressionError, UnknownSignalError
from silo.expressions.over_recordings import BATCH_TICKS, RecordingJudge
from silo.files import write
from silo.files.convert import convert
from silo.files.formats import read_recording
from silo.settings.script import read_script, write_script
from tests.stand_ins.saved import element


def recording(*elements, ticks=10, conditions=None):
    time_ns = 10**18 + np.arange(ticks) * 10**6
    return Recording("robot", time_ns, ticks, elements, frequency_hz=1000.0, conditions=conditions or Conditions())


@pytest.fixture
def log():
    tau = np.arange(20.0).reshape(10, 2)
    return Log(recording(
        element("joints/tau", list(tau.T), "Nm", kind="array"),
        element("joints/qd", [np.full(10, 2.0)] * 2, "rad/s", kind="array"),
        element("mode", np.array([0, 1, 1, 0, 0], np.int32), divider=2, labels={0: "STAND", 1: "WALK"}),
        element("late", np.arange(4.0), first=6),
        conditions=Conditions(
            (Derived("/log/power", "joints/tau * joints/qd", "W"), Derived("/log/total", "sum(power)"))
        ),
    ))  # fmt: skip


def test_an_expression_of_a_log_is_a_signal(log):
    found = log.eval("abs(joints/tau_1) > 8 and mode == STAND")
    assert found.values.dtype == bool
    assert found.values.tolist() == [False] * 6 + [True] * 4
    assert found.times.tolist() == pytest.approx(np.arange(10) * 1e-3)
    assert log.eval("2 * joints/tau_0").unit == "Nm"


def test_ticks_at_which_nothing_can_be_told_are_left_out(log):
    assert log.eval("late + joints/tau_0").time_ns.tolist() == [10**18 + tick * 10**6 for tick in range(6, 10)]
    assert log.eval("diff(late) > 0").values.tolist() == [True] * 3


def test_an_error_shows_the_place(log):
    with pytest.raises(ExpressionError, match=r"did you mean 'joints/tau"):
        log.eval("joints/tua > 3")
    with pytest.raises(silo.ElementError, match="must be a text"):
        log.eval(3)


def test_long_logs_are_judged_in_batches_without_seams():
    values = np.random.default_rng(3).normal(size=BATCH_TICKS * 2 + 77)
    log = Log(recording(element("x", values), ticks=len(values)))
    np.testing.assert_array_equal(log.eval("diff(x)").values[1:], np.diff(values))


BIG = 2**60


@pytest.fixture
def whole():
    """Integers of which float64 loses digits; `slow` has every second, `v` are three, `u` has no sign."""
    return Log(recording(
        element("n", BIG + np.arange(10)),
        element("slow", BIG + np.arange(5) * 2, divider=2),
        element("v", [BIG + np.arange(10) * at for at in range(3)], kind="array"),
        element("u", np.arange(10, dtype=np.uint8)),
        element("x", np.arange(10.0)),
    ))  # fmt: skip


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("n", [BIG + at for at in range(10)]),
        ("n - slow", [at % 2 for at in range(10)]),
        ("-n + 2**60 + 1", [1 - at for at in range(10)]),
        ("3 * u - 1", [3 * at - 1 for at in range(10)]),
        ("n - v", [[at, 0, -at] for at in range(10)]),
        ("n - n + u", list(range(10))),
    ],
)
def test_sums_and_products_of_integers_keep_all_digits(whole, expression, expected):
    found = whole.eval(expression)
    assert (found.values.dtype, found.values.tolist()) == (np.int64, expected)


def test_before_the_first_sample_is_no_number_whatever_it_is_of(whole):
    for expression in ("prev(n) - n", "diff(n)", "n - prev(n)", "prev(u) * 2"):
        found = whole.eval(expression).values
        assert (found.dtype, np.isnan(found).tolist()) == (np.float64, [True] + [False] * 9), expression
    assert np.isnan(whole.eval("n % (n - n)").values).all()


def test_what_threads_evaluate_at_once_of_a_log_is_what_each_would(monkeypatch):
    """One looks at the rates that another's signals have in common; they take turns at each batch."""
    dividers = {f"d{divider}": divider for divider in (2, 3, 10, 15)}
    elements = [element(name, np.arange(-(-600 // each)), divider=each) for name, each in dividers.items()]
    log = Log(recording(*elements, ticks=600))
    expected = {text: log.eval(text).values.tolist() for text in ("d2 + d3", "d10 + d15")}
    assert {text: len(values) for text, values in expected.items()} == {"d2 + d3": 600, "d10 + d15": 120}
    judge, real = log._judge, RecordingJudge._with_rate
    other = []

    def between(self, bound):
        found = real(self, bound)
        if not other:
            other.append(True)
            judge.evaluate("d10 + d15")
        return found

    monkeypatch.setattr(RecordingJudge, "_with_rate", between)
    assert log.eval("d2 + d3").values.tolist() == expected["d2 + d3"]


@pytest.mark.parametrize("expression", ["n + x", "n / 2", "n * n", "mean(n, 3ms)", "n + 0.5", "n + 2**64"])
def test_what_is_no_sum_of_integers_or_has_no_room_in_64_bits_is_a_float(whole, expression):
    assert whole.eval(expression).values.dtype == np.float64


def test_a_derived_signal_is_in_the_log_like_any_other(log):
    power = log["power"]
    assert list(log)[-2:] == ["/log/power", "/log/total"]
    assert "power" in log
    assert (power.name, power.unit, power.values.shape) == ("/log/power", "W", (10, 2))
    assert log["/log/total"].values.tolist() == (2 * np.arange(20.0).reshape(10, 2)).sum(axis=1).tolist()
    assert log.names("*/tot*") == ["/log/total"]
    assert log.eval("total > 30").values.sum() == 6
    assert len(log.namespace("joints")) == 2


def test_what_is_derived_of_signals_without_a_sample_in_common_is_not_in_the_log():
    log = Log(recording(
        element("first", np.arange(3.0)),
        element("last", np.arange(3.0), first=7),
        conditions=Conditions((Derived("/log/both", "first + last"), Derived("/log/more", "both * 2"),
                               Derived("/log/alone", "first * 2"))),
    ))  # fmt: skip
    assert (list(log), "both" in log) == (["/log/first", "/log/last", "/log/alone"], False)
    for name in ("both", "/log/more"):
        with pytest.raises(UnknownSignalError, match="can't be computed of this log: its signals have no sample"):
            log[name]
    assert log.names("b*") == []


@pytest.mark.parametrize("ending", ["silo", "csv", "mcap", ""])
def test_files_keep_what_is_derived_and_limited(log, tmp_path, ending):
    limits = SignalLimits(
        "/log/joints/tau",
        bounds=(None, -10.0, 10.0, None),
        persistence=2,
        hysteresis=0.5,
        stale_s=0.1,
        when="mode == WALK",
    )
    conditions = Conditions(log.recording.conditions.derived, (limits,))
    made = recording(*log.recording.elements[:2], ticks=10, conditions=conditions)
    write(made, tmp_path, "robot", ["silo"], "run")
    target = tmp_path / (f"other.{ending}" if ending else "walk")
    if ending != "silo":
        convert(tmp_path / "run.silo", target, None, False)
    found = read_recording(target if ending != "silo" else tmp_path / "run.silo")
    assert found.conditions == conditions
    assert Log(found)["power"].values.sum() == 2 * np.arange(20.0).sum()


def test_a_pattern_that_is_an_expression_or_a_derived_name_is_a_curve(log):
    (curve,) = pick(log.recording, ["max(joints/tau) - 3"])
    assert (curve.name, curve.values.tolist()[:2]) == ("max(joints/tau) - 3", [-2.0, 0.0])
    assert [one.name for one in pick(log.recording, ["power"])] == ["/log/power_0", "/log/power_1"]
    assert pick(log.recording, ["mode == WALK"])[0].labels == {0: "false", 1: "true"}


class TestCheck:
    @pytest.fixture
    def spiky(self):
        values = np.zeros((1000, 2))
        values[500, 1] = 99.0
        return recording(
            element("x", list(values.T), "A", kind="array"), element("on", np.ones(500), divider=2), ticks=1000
        )

    def test_one_sample_in_a_run_is_found_with_its_peak_and_time(self, spiky):
        quiet, found = check(spiky, [SignalLimits("x", bounds=(None, None, 10, 50))])
        assert (quiet.what, quiet.worst, quiet.violated) == ("/log/x_0", "GREEN", False)
        assert (found.what, found.worst, found.samples, found.peak, found.unit) == (
            "/log/x_1",
            "RED_HIGH",
            1,
            99.0,
            "A",
        )
        assert found.peak_s == pytest.approx(0.5)

    def test_a_context_leaves_out_what_is_not_meant(self, spiky):
        (_, found) = check(spiky, [SignalLimits("x", bounds=(None, None, 10, 50), when="on > 2")])
        assert (found.worst, found.violated) == ("UNOBSERVABLE", False)
        (_, found) = check(spiky, [SignalLimits("x", bounds=(None, None, 10, 50), when="on == 1")])
        assert found.samples == 1

    def test_samples_that_are_held_beside_a_faster_context_count_once(self, spiky):
        (found,) = check(spiky, [SignalLimits("on", bounds=(None, None, 0.5, None), when="x_0 == 0")])
        assert (found.violations, found.samples) == (1, 500)

    def test_conditions_that_must_never_or_always_hold(self, spiky):
        never, always = check(spiky, [], ["x_1 > 50"], ["x_1 < 50"])
        assert (never.violations, never.first_s) == (1, pytest.approx(0.5))
        assert (always.violations, always.samples) == (1, 1)
        assert not check(spiky, [], ["x_0 > 1"])[0].violated

    def test_samples_without_a_value_are_counted_and_not_called_green_alone(self, tmp_path, capsys):
        values = np.concatenate([np.zeros(100), np.full(900, np.nan)])
        log = recording(element("x", values), ticks=1000)
        (found,) = check(log, [SignalLimits("x", bounds=(-1, -0.5, 0.5, 1))])
        assert (found.worst, found.missing, found.violated) == ("GREEN", 900, False)
        write(log, tmp_path, "robot", ["silo"], "run")
        assert run(["check", str(tmp_path / "run.silo"), "--limit", "x=-1,-.5,.5,1"]) == 0
        told = capsys.readouterr().out
        assert "green, in part" in told
        assert "/log/x: 900 of 1 000 samples have no value (NaN) and are not judged\n" in told
        assert told.endswith("nothing violated (1 judged, 1 of them in part)\n")
        (found,) = check(log, [SignalLimits("x", bounds=(-1, -0.5, 0.5, 1), stale_s=0.1)])
        assert found.violated
        assert [one.missing for one in check(log, [], ["x > 1"], ["x < 1"])] == [900, 900]

    def test_what_never_has_a_value_is_not_judged_and_says_why(self):
        (found,) = check(recording(element("x", np.full(10, np.nan))), [SignalLimits("x", bounds=(-1, -0.5, 0.5, 1))])
        assert found.worst == "UNOBSERVABLE"
        assert found.why == "10 of 10 samples have no value (NaN) and are not judged"

    def test_the_command_ends_with_a_code_for_scripts(self, spiky, tmp_path, capsys, monkeypatch):
        write(spiky, tmp_path, "robot", ["silo"], "run")
        file = str(tmp_path / "run.silo")
        assert run(["check", file, "--limit", "x=-,-,10,50"]) == EXIT_FOUND
        assert "red high" in capsys.readouterr().out
        assert run(["check", file, "--limit", "x_0=-,-,10,50", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)[0]["worst"] == "GREEN"
        assert run(["check", file, "--never", "nothing > 3"]) == EXIT_FAILED
        assert "^^^^^^^" in capsys.readouterr().err
        for words in (["check", file], ["check", file, "--limit", "x"], ["check", file, "--limit", "x=a,b,c,d"]):
            assert run(words) == 2
        assert run(["check", file, "--limit", "x=4,3,2,1"]) == EXIT_FAILED


class TestLogger:
    @pytest.fixture
    def log(self, tmp_path):
        with silo.Logger("judged", frequency=1000, folder=tmp_path, script=tmp_path / "none.yaml") as log:
            self.q = log.array("q", 2, group="joints", unit="rad")
            log.add(lambda: 3, "mode")
            yield log

    def test_mistakes_are_refused_and_nothing_changes(self, log):
        with pytest.raises(silo.errors.ExpressionError, match="did you mean 'joints/q"):
            log.derive("x", "joints/p + 1")
        with pytest.raises(silo.ElementError, match="is an element already"):
            log.derive("joints/q", "1 + mode")
        with pytest.raises(silo.ElementError, match="no signal is named 'nope'"):
            log.limit("nope", (0, 1, 2, 3))
        with pytest.raises(silo.ElementError, match="must rise"):
            log.limit("joints/q", (3, 2, 1, 0))
        with pytest.raises(silo.ElementError, match="must be a time such as"):
            log.limit("joints/q", (0, 1, 2, 3), stale="soon")
        with pytest.raises(silo.ElementError, match="red_low, yellow_low"):
            log.limit("joints/q", (0, math.nan, 2, 3))
        assert log._conditions.now == Conditions()

    @pytest.mark.parametrize("name", ["hypot(base/euler", "a*b", "x > 3", "`q`", "a,b", "q[0]", "a\nb", " ", "/", ""])
    def test_the_name_of_a_derived_signal_is_no_part_of_an_expression(self, log, name):
        with pytest.raises(silo.ElementError, match=r"letters, digits, blanks and / _ - \. \+|needs a name"):
            log.derive(name, "2 * mode")
        assert log._conditions.now == Conditions()

    @pytest.mark.parametrize("name", ["base/tilt_2", "left-right", "a.b+c", "größe", "mean speed", "/log/whole"])
    def test_the_name_of_a_derived_signal_is_words_as_of_an_element(self, log, name):
        log.derive(name, "2 * mode")
        assert [one.name for one in log._conditions.now.derived] == [f"/log/{name.removeprefix('/log/')}"]

    def test_a_prefix_of_any_letters_is_no_fault_of_what_is_derived_below_it(self, tmp_path):
        with silo.Logger("odd", prefix="/robot(1)", folder=tmp_path, script=tmp_path / "none.yaml") as log:
            log.add(lambda: 3, "mode")
            log.derive("twice", "2 * mode")
            assert [one.name for one in log._conditions.now.derived] == ["/robot(1)/twice"]

    def test_a_new_expression_replaces_the_old_one_and_must_fit_what_stands_on_it(self, log):
        log.derive("a", "joints/q_0")
        log.derive("b", "a + 1")
        log.derive("a", "joints/q_1")
        assert [one.expression for one in log._conditions.now.derived] == ["joints/q_1", "a + 1"]
        with pytest.raises(silo.ElementError, match="'/log/a' would be computed from itself"):
            log.derive("a", "b + 1")
        with pytest.raises(silo.errors.ExpressionError, match="no signal is named 'nope'"):
            log.derive("a", "joints/q_0 + nope")

    def test_while_running_a_signal_may_be_derived_but_no_script_read(self, log):
        log.start()
        log.derive("x", "mode")
        assert [one.name for one in log._conditions.now.derived] == ["/log/x"]
        with pytest.raises(silo.StateError):
            log._scripted.apply([], log._conditions.now)

    def test_a_script_keeps_what_is_derived_and_limited(self, log, tmp_path):
        log.derive("twice", "2 * joints/q + 0 * mode", unit="°")
        log.limit("twice", (None, -1.5, 3, None), when="mode == 3", stale="20ms")
        log.trigger("odd", "max(twice) > 3", pre="20ms", save=["silo", "bag"], rearm="mode < 1", mode="single")
        log.update()
        path = log.save_script(tmp_path / "kept.yaml")
        before = log._conditions.now
        log.derive("more", "mode")
        log.load_script(path)
        assert log._conditions.now == before
        assert read_script(path).warnings == []

    def test_a_script_that_says_nothing_of_them_leaves_them(self, log, tmp_path):
        log.derive("more", "mode")
        (tmp_path / "plain.yaml").write_text("log_elements: []\n")
        log.load_script(tmp_path / "plain.yaml")
        assert [one.name for one in log._conditions.now.derived] == ["/log/more"]

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("derived_signals: 3", ":2: derived_signals must be a list"),
            ("derived_signals:\n  - name: x\n    formula: y", ":3: derived_signals: no key 'formula'"),
            ("derived_signals:\n  - name: /log/x\n    expression: nope + 1", "no signal is named 'nope'"),
            ("signal_limits:\n  - name: mode\n    bounds: [1, 2]", ":4: signal_limits"),
            (
                "triggers:\n  - name: a\n    when: mode > 3\n    slope: up",
                "edge of trigger 'a' must be rising, falling, level, enter or leave, got 'up'; nothing was changed",
            ),
            ("triggers:\n  - name: a/b\n    when: mode > 3", "stands in names of files"),
            (f"triggers:\n  - name: {'測' * 70}\n    when: mode > 3", "it has 210 bytes, 200 are possible"),
            ("signal_limits:\n  - name: mode\n    bounds: [4, 3, 2, 1]", "must rise"),
        ],
    )
    def test_problems_in_a_script_are_told_and_nothing_changes(self, log, tmp_path, text, says):
        (tmp_path / "bad.yaml").write_text(f"log_elements: []\n{text}\n")
        log.update()
        with pytest.raises(silo.errors.ScriptError) as caught:
            log.load_script(tmp_path / "bad.yaml")
        assert says in str(caught.value)
        assert log._conditions.now == Conditions()

    def test_a_script_written_without_them_keeps_those_that_stand_in_it(self, log, tmp_path):
        log.derive("more", "mode")
        log.update()
        path = log.save_script(tmp_path / "kept.yaml")
        write_script(path, log.elements)
        assert read_script(path).conditions == log._conditions.now


def test_limits_of_what_is_not_in_a_log_are_unobservable_and_the_others_are_judged(tmp_path, capsys):
    limits = (
        SignalLimits("/log/off", bounds=(None, None, 1.0, 2.0)),
        SignalLimits("/log/x", bounds=(None, None, 5.0, 8.0)),
    )
    log = recording(element("x", np.arange(10.0)), conditions=Conditions(limits=limits))
    gone, found = check(log, limits)
    assert (gone.what, gone.worst, gone.violated) == ("/log/off", "UNOBSERVABLE", False)
    assert "/log/off" in gone.why
    assert (found.worst, found.samples) == ("RED_HIGH", 4)
    write(log, tmp_path, "robot", ["silo"], "run")
    assert run(["check", str(tmp_path / "run.silo")]) == EXIT_FOUND
    assert "/log/off can't be told" in capsys.readouterr().out


def test_a_log_of_which_nothing_can_be_judged_is_not_fine(tmp_path):
    log = recording(
        element("x", np.arange(10.0)),
        conditions=Conditions(limits=(SignalLimits("/log/off", bounds=(None, None, 1, 2)),)),
    )
    write(log, tmp_path, "robot", ["silo"], "run")
    assert run(["check", str(tmp_path / "run.silo")]) == EXIT_BLIND
