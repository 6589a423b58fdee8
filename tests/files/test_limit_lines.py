"""Limits in plots of saved logs, and expressions and derived signals beside them."""

import numpy as np
import pytest

from silo.analysis.plots.charts import ChartSpec, make_chart
from silo.analysis.plots.drawing import draw_axes, draw_text
from silo.cli.main import run
from silo.core.conditions import Conditions, Derived, SignalLimits
from silo.core.recording import Recording
from silo.files import write
from tests.stand_ins.saved import element


@pytest.fixture
def logged():
    wave = 20 * np.sin(np.arange(200) / 20)
    conditions = Conditions(
        (Derived("/log/power", "joints/tau_0 * speed", "W"),),
        (
            SignalLimits("joints/tau", bounds=(None, -15.0, 15.0, 30.0)),
            SignalLimits("power", bounds=(None, None, None, 50.0)),
            SignalLimits("speed", bounds=(None, None, None, 9000.0)),
        ),
    )
    made = [element("joints/tau", [wave, wave / 2], "Nm"), element("speed", np.full(200, 2.0), "rad/s")]
    return Recording("r", 10**18 + np.arange(200) * 10**6, 200, made, frequency_hz=1000.0, conditions=conditions)


def levels(recording, *patterns, **options):
    return make_chart(recording, ChartSpec(patterns, **options))[0].levels


def test_limits_of_an_element_are_lines_for_each_of_its_scalars(logged):
    found = levels(logged, "tau_1")
    assert [(level.value, level.words, level.red) for level in found] == [
        (30.0, "red high", True), (15.0, "yellow high", False), (-15.0, "yellow low", False),
    ]  # fmt: skip


def test_two_signals_with_the_same_limits_have_them_once(logged):
    assert len(levels(logged, "joints/tau")) == 3


def test_limits_of_a_derived_signal_are_drawn_with_it(logged):
    assert [level.value for level in levels(logged, "power")] == [50.0]


def test_those_of_the_right_axis_stand_there(logged):
    assert {level.right for level in levels(logged, "tau_0", "power")} == {False, True}


def test_limits_far_from_the_curves_are_told_and_not_drawn(logged):
    (level,) = levels(logged, "speed")
    assert not level.inside
    text = draw_text(make_chart(logged, ChartSpec(["speed"]))[0], 80, 24, color=False)
    assert "red high 9000  beyond this plot" in text


def test_an_expression_or_a_derivative_has_none(logged):
    assert not levels(logged, "2 * speed")
    assert not levels(logged, "tau_0", transform="derivative")


def test_the_terminal_has_a_line_and_its_words(logged):
    text = draw_text(make_chart(logged, ChartSpec(["tau_0"]))[0], 80, 30, color=False)
    assert "── red high 30" in text
    assert "╌╌ yellow low -15" in text
    assert any(line.count("╌") > 40 for line in text.splitlines())
    colored = draw_text(make_chart(logged, ChartSpec(["tau_0"]))[0], 80, 30)
    assert "\x1b[31m──\x1b[0m red high 30" in colored


def test_a_chart_is_as_large_as_asked_whatever_the_terminal(logged, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("LINES", "20")
    lines = draw_text(make_chart(logged, ChartSpec(["tau_0"]))[0], 150, 50, color=False).splitlines()
    assert (len(lines), max(map(len, lines))) == (50, 150)


def test_a_picture_has_them_too(logged):
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.add_subplot()
    draw_axes(make_chart(logged, ChartSpec(["tau_0"]))[0], axes)
    assert [line.get_ydata()[0] for line in axes.lines[1:]] == [30.0, 15.0, -15.0]


def test_the_command_takes_names_expressions_and_derived_signals(logged, tmp_path, capsys):
    write(logged, tmp_path, "r", ["silo"], "run")
    assert run(["plot", str(tmp_path / "run.silo"), "abs(joints/tau_0) - 3", "power", "--width", "80"]) == 0
    text = capsys.readouterr().out
    assert "abs(joints/tau_0) - 3" in text
    assert "red high 50" in text
