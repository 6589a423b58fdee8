"""Charts as text and as PNG, and how they are made from what the user asked for."""

import itertools
import re
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import silo
from silo.analysis.compute.calculus import derivative
from silo.analysis.compute.spectra import lines_of, longest_piece
from silo.analysis.plots.charts import ChartSpec, make_chart
from silo.analysis.plots.curves import pick
from silo.analysis.plots.drawing import Chart, Curve, draw_png, draw_text, nice_ticks, thin_out, tick_texts
from silo.analysis.plots.limit_lines import DrawnBound
from silo.analysis.plots.showing import _has_screen
from silo.core.recording import Recording
from silo.errors import ElementError, LogWarning, SiloError
from tests.examples import examples
from tests.stand_ins.saved import element

TICKS = 400
SECONDS = np.arange(TICKS) / 100
ESCAPE = re.compile("\x1b\\[[0-9;]*m")


@pytest.fixture
def log() -> Recording:
    mode = (np.arange(TICKS) // 100).astype("i1")
    table = [
        element("/log/LF/torque", [10 * np.sin(SECONDS)], unit="Nm"),
        element("/log/RF/torque", [10 * np.cos(SECONDS)], unit="Nm"),
        element("/log/LF/position", [SECONDS**2], unit="rad"),
        element("/log/mode", [mode], labels={0: "STAND", 1: "WALK", 2: "TROT", 3: "FALL"}),
        element("/log/text", [np.array([b"on", b"off"] * 200)]),
        element("/log/base", [np.cos(SECONDS), np.sin(SECONDS)], "m", suffixes=("_x", "_y")),
        element("/log/slow", [np.arange(4.0)], unit="degC", divider=100, first=50),
        element("/log/x", [SECONDS]),
        element("/log/gap", [np.where(SECONDS > 2, np.nan, 1.0)]),
    ]
    return Recording("robot", 1_000_000_000 + np.arange(TICKS, dtype=np.int64) * 10_000_000, TICKS, table)


def line(values=None, **more):
    values = np.sin(SECONDS * 5) if values is None else values
    return Chart([Curve("/log/x [rad]", SECONDS[: len(values)], values)], x_label="time [s]", **more)


A, B = Curve("a", SECONDS, SECONDS), Curve("b", SECONDS, -SECONDS)


class TestText:
    def test_with_colour_the_text_is_the_same_size_and_without_there_is_no_escape_sequence(self):
        plain, colored = draw_text(line(), color=False), draw_text(line(), color=True)
        assert ("\x1b" in plain, "\x1b" in colored) == (False, True)
        assert len(ESCAPE.sub("", colored).split("\n")) == len(plain.split("\n"))

    @settings(max_examples=examples(60))
    @given(
        width=st.integers(1, 200),
        height=st.integers(1, 60),
        count=st.integers(1, 40),
        values=st.lists(st.floats(width=64), max_size=50),
        color=st.booleans(),
    )
    def test_any_values_fit_any_terminal(self, width, height, count, values, color):
        y = np.array(values, dtype=np.float64)
        curves = [Curve("/log/" + "long" * i, np.arange(len(y)) * 0.1, y, right=bool(i % 2)) for i in range(count)]
        chart = Chart(curves, "title" * 20, "time [s]", "rad" * 20, "Nm")
        rows = ESCAPE.sub("", draw_text(chart, width, height, color=color)).split("\n")
        assert len(rows) <= max(height, 8)
        assert max(map(len, rows)) <= max(width, 30)

    def test_many_events_leave_room_for_the_curve(self):
        x = np.linspace(0, 5, 500)
        chart = Chart([Curve("q", x, np.sin(x))], "", "s", "rad", events=[(0.01 * i, "hit") for i in range(20)])
        drawn = draw_text(chart, 70, 8, color=False).split("\n")
        assert len(drawn) == 8
        assert sum(bool(re.search("[⠁-⣿]", row)) for row in drawn) == 2
        assert drawn[-2].startswith("── q")
        assert drawn[-1] == "   ... and 20 more"

    def test_a_spike_of_one_sample_among_a_million_shows(self):
        values = np.zeros(1_000_000)
        values[123_456] = 1.0
        chart = Chart([Curve("x", np.arange(1e6), values)])
        flat = Chart([Curve("x", np.arange(1e6), np.where(values, 0.0, values))])
        rows = draw_text(chart, 60, 12, color=False).split("\n")
        assert draw_text(flat, 60, 12, color=False).split("\n")[1:9] != rows[1:9]
        assert sum("⡇" in row or "⢸" in row for row in rows) >= 4

    @pytest.mark.parametrize(
        ("chart", "words"),
        [
            (Chart([A, B]), ["•• a", "×× b"]),  # without colour curves differ by their marks
            (Chart([A, replace(B, right=True)]), ["a (left)  0 ... 3.99", "b (right)  -3.99 ... 0"]),
            (line(np.full(TICKS, np.nan)), ["no finite value"]),
            (line(np.arange(TICKS) % 2 * 1.0, left_ticks={0: "STAND", 1: "WALK"}), ["STAND┤", "WALK┤"]),
        ],
    )
    def test_legend_and_axes_say_what_is_drawn(self, chart, words):
        text = draw_text(chart, color=False)
        assert [one for one in words if one not in text] == []

    def test_words_of_a_file_are_none_of_the_escape_sequences_that_it_is_drawn_with(self):
        evil = "\x1b[31m\x9b5m\u202e\x07"
        curve = Curve(evil, np.arange(3.0), np.array([0.0, 1, 0]))
        levels = [DrawnBound(0.5, evil, red=False)]
        chart = Chart([curve], evil, evil, evil, evil, events=[(1.0, evil)], levels=levels)
        text = draw_text(chart, 100, 24, color=True)
        assert "\x1b[31m" not in text
        assert all(line.isprintable() for line in ESCAPE.sub("", text).split("\n"))
        assert text.count(r"\x1b[31m\x9b5m\u202e\x07") >= 4

    @pytest.mark.parametrize("size", [1e-300, 1e-310, 5e-324])
    def test_the_smallest_numbers_are_a_wave_with_their_size_at_the_axis(self, size):
        x = np.arange(20.0)
        lines = draw_text(Chart([Curve("a", x, np.where(x % 2 == 0, size, -size))]), 60, 12, color=False).splitlines()
        assert sum(any("\u2800" < char <= "\u28ff" for char in line) for line in lines) > 5, lines
        assert f"e-{f'{size:e}'.split('-')[1]}" in "".join(lines)

    def test_a_constant_next_to_zero_is_not_drawn_as_zero(self):
        drawn = draw_text(Chart([Curve("a", np.arange(20.0), np.full(20, 1e-300))]), 60, 12, color=False)
        assert "1.0" in drawn
        assert "-1" not in drawn.replace("e-1", "")

    def test_rounding_errors_of_a_constant_are_a_flat_line(self):
        text = draw_text(line(40 + np.arange(TICKS) % 2 * 1e-14), 60, 12, color=False)
        assert sum("⠤" in row or "⠒" in row or "⠉" in row for row in text.split("\n")[:-1]) == 1


class TestPng:
    def test_it_is_a_picture_of_the_size_asked_for(self, tmp_path):
        chart = replace(line(), curves=[*line().curves, Curve("b", SECONDS, -SECONDS, right=True)])
        draw_png(chart, tmp_path / "a.png", 640, 400)
        data = (tmp_path / "a.png").read_bytes()
        assert data[:8] == b"\x89PNG\r\n\x1a\n"
        assert struct.unpack(">II", data[16:24]) == (640, 400)
        assert [path.name for path in tmp_path.iterdir()] == ["a.png"]

    def test_without_matplotlib_it_says_what_to_install(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        with pytest.raises(SiloError, match=r'pip install "silo-logger\[plot\]"'):
            draw_png(line(), tmp_path / "a.png")


class TestThinningOut:
    def test_minimum_and_maximum_of_each_column_survive(self):
        values = np.random.default_rng(1).normal(size=10_000)
        x, y = thin_out(np.arange(10_000.0), values, 50)
        assert len(x) == len(y) == 100
        assert (y.min(), y.max()) == (values.min(), values.max())

    def test_a_column_without_a_value_is_a_gap(self):
        values = np.ones(10_000)
        values[2000:4000] = np.nan
        _, y = thin_out(np.arange(10_000.0), values, 50)
        assert np.isnan(y).sum() == 20

    def test_few_points_stay_as_they_are(self):
        x, y = thin_out(SECONDS, SECONDS, 500)
        assert (x is not None and len(x) == TICKS) and y.tolist() == SECONDS.tolist()


class TestTicks:
    @given(low=st.floats(-1e12, 1e12), span=st.floats(1e-9, 1e12), count=st.integers(2, 12))
    def test_they_are_few_rising_and_inside(self, low, span, count):
        high = low + span
        ticks = nice_ticks(low, high, count)
        assert len(ticks) <= count + 2
        assert all(a < b for a, b in itertools.pairwise(ticks))
        slack = 1e-6 * span + 1e-6 * max(abs(low), abs(high)) * 1e-6
        assert all(low - slack <= tick <= high + slack for tick in ticks)

    def test_they_are_round(self):
        assert nice_ticks(0.13, 9.9, 5) == [2, 4, 6, 8]

    @pytest.mark.parametrize(
        ("ticks", "texts"),
        [
            ([0, 0.5, 1], ["0.0", "0.5", "1.0"]),
            ([0, 20, 40], ["0", "20", "40"]),
            ([1e9, 2e9], ["1e+09", "2e+09"]),
            ([1.00001e9, 1.00002e9], ["1.00001e+09", "1.00002e+09"]),
            ([0, 2e-5], ["0", "2e-05"]),
        ],
    )
    def test_their_texts_tell_them_apart(self, ticks, texts):
        assert tick_texts(ticks) == texts


class TestPicking:
    @pytest.mark.parametrize(
        ("pattern", "names"),
        [
            ("/log/LF/torque", ["/log/LF/torque"]),
            ("torque", ["/log/LF/torque", "/log/RF/torque"]),
            ("*/LF/*", ["/log/LF/torque", "/log/LF/position"]),
            ("/log/base", ["/log/base_x", "/log/base_y"]),
            ("base_y", ["/log/base_y"]),
            ("x", ["/log/x"]),
            ("LF/pos", ["/log/LF/position"]),
            ("LF", ["/log/LF/torque", "/log/LF/position"]),
            ("/log/*/torque", ["/log/LF/torque", "/log/RF/torque"]),
        ],
    )
    def test_a_pattern_is_a_name_a_glob_or_a_part(self, log, pattern, names):
        assert [signal.name for signal in pick(log, [pattern])] == names

    def test_a_signal_comes_once_however_often_it_matches(self, log):
        assert len(pick(log, ["LF/torque", "torque", "*"])) == 10


class TestCharts:
    def test_two_units_take_two_axes(self, log):
        chart, _ = make_chart(log, ChartSpec(["torque", "LF/position"]))
        assert [curve.right for curve in chart.curves] == [False, False, True]
        assert (chart.left_label, chart.right_label) == ("Nm", "rad")

    def test_the_right_axis_takes_what_was_asked_for(self, log):
        chart, _ = make_chart(log, ChartSpec(["torque"], right=["RF/torque"]))
        assert [(curve.label, curve.right) for curve in chart.curves] == [
            ("/log/LF/torque [Nm]", False),
            ("/log/RF/torque [Nm]", True),
        ]

    @pytest.mark.parametrize(
        ("spec", "x"),
        [
            (ChartSpec(["slow"]), [0.5, 1.5, 2.5, 3.5]),  # seconds from the start of the log
            (ChartSpec(["LF/torque"], start=1.0, stop=1.05), [1.0, 1.01, 1.02, 1.03, 1.04, 1.05]),
        ],
    )
    def test_time_is_seconds_and_a_window_cuts_in_them(self, log, spec, x):
        assert make_chart(log, spec)[0].curves[0].x.tolist() == pytest.approx(x)

    @pytest.mark.parametrize(
        ("spec", "words"),
        [
            (
                ChartSpec(["torqeu"]),
                "no signal matches 'torqeu'; there are 9 elements, such as /log/RF/torque, /log/LF/torque",
            ),  # names close ones
            (
                ChartSpec(["LF/torque"], start=77),
                "there is no sample to plot in that window; the log goes from 0 to 3.99 s",
            ),
            (
                ChartSpec(["base_y"], x="torque"),
                "'torque' must be one signal for the x axis, but matches 2: /log/LF/torque, /log/RF/torque ...",
            ),
        ],
    )
    def test_what_can_not_be_drawn_is_said(self, log, spec, words):
        with pytest.raises(ElementError) as caught:
            make_chart(log, spec)
        assert str(caught.value) == words

    @pytest.mark.parametrize("window", [{"start_s": "1"}, {"stop_s": float("nan")}])
    def test_a_window_that_is_no_time_is_refused_in_words(self, log, window):
        with pytest.raises(ElementError, match=f"{next(iter(window))} must be from .* s since start, got"):
            silo.Log(log).plot("LF/torque", **window)

    def test_an_enumeration_has_its_names_at_the_axis_and_strings_become_levels_with_their_text(self, log):
        assert make_chart(log, ChartSpec(["mode"]))[0].left_ticks == {0: "STAND", 1: "WALK", 2: "TROT", 3: "FALL"}
        chart, _ = make_chart(log, ChartSpec(["text"]))
        assert chart.left_ticks == {0: "off", 1: "on"}
        assert chart.curves[0].y[:2].tolist() == [1, 0]

    def test_x_y_takes_the_value_that_held(self, log):
        chart, _ = make_chart(log, ChartSpec(["base_y"], x="slow"))
        assert np.isnan(chart.curves[0].x[:50]).all()
        assert chart.curves[0].x[[50, 149, 150, 399]].tolist() == [0, 0, 1, 3]
        assert chart.x_label == "/log/slow [degC]"

    def test_a_part_of_names_is_drawn_and_it_is_told_what_to_write(self, log):
        with pytest.warns(LogWarning, match=r"'orqu' is only a part of names: .* write '\*orqu\*'"):
            chart, _ = make_chart(log, ChartSpec(["orqu"]))
        assert len(chart.curves) == 2

    def test_too_many_signals_are_counted(self, log):
        chart, left_out = make_chart(log, ChartSpec(["*"], most=5))
        assert (len(chart.curves), left_out) == (5, 5)

    def test_a_derivative_is_per_second(self, log):
        chart, _ = make_chart(log, ChartSpec(["LF/position"], transform="derivative"))
        assert chart.curves[0].y[1:-1] == pytest.approx(2 * SECONDS[1:-1])
        assert chart.left_label == "rad/s"

    def test_a_spectrum_is_over_frequency(self, log):
        chart, _ = make_chart(log, ChartSpec(["LF/torque"], transform="spectrum"))
        assert chart.x_label == "frequency [Hz]"
        assert chart.curves[0].x[-1] == pytest.approx(50)


def test_a_sine_has_its_amplitude_in_the_spectrum_at_its_frequency():
    times = np.arange(1000) / 500
    frequencies, amplitudes = lines_of(longest_piece((times * 1e9).astype(int), 3 * np.sin(2 * np.pi * 60 * times) + 7))
    assert frequencies[np.argmax(amplitudes)] == pytest.approx(60, abs=0.3)
    assert amplitudes.max() == pytest.approx(3, rel=0.02)


def test_a_derivative_beside_a_gap_is_a_gap():
    slope = derivative(np.arange(5.0), np.array([0.0, 1.0, np.nan, 3.0, 4.0]))
    assert np.isnan(slope).tolist() == [False, True, False, True, False]


def test_a_derivative_at_uneven_times_is_that_of_numpy():
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.002, 0.02, 400))
    times[200:] += 2.0  # a time without samples
    wave = np.sin(times)
    np.testing.assert_allclose(derivative(times, wave), np.gradient(wave, times), rtol=1e-9, atol=1e-9)
    assert np.abs(derivative(times, wave) - np.cos(times)).max() < 0.02
    parabola = derivative(times, times**2)[1:-1]
    np.testing.assert_allclose(parabola, 2 * times[1:-1])


def test_a_derivative_goes_over_no_step_in_which_time_stands_still_or_falls():
    slope = derivative(np.array([0.0, 1, 1, 2, 1.5, 3]), np.array([0.0, 2, 7, 10, 50, 53]))
    assert slope.tolist() == [2, 2, 3, 3, 2, 2]
    assert np.isnan(derivative(np.zeros(3), np.arange(3.0))).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_samples_have_neither_slope_nor_spectrum_but_no_error(count):
    times = np.arange(count) * 1.0
    assert len(derivative(times, times)) == count
    assert len(lines_of(longest_piece(times.astype(int), times))[0]) == 0


@pytest.mark.parametrize(
    ("name", "notebook", "shown"),
    [("", False, False), ("DISPLAY", False, True), ("WAYLAND_DISPLAY", False, True), ("MPLBACKEND", False, True),
     ("", True, True)],
)  # fmt: skip
def test_a_plot_is_text_where_nothing_shows_pictures(monkeypatch, name, notebook, shown):
    mpl = pytest.importorskip("matplotlib")
    for variable in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)
    monkeypatch.setitem(sys.modules, "IPython", sys)
    monkeypatch.setattr(mpl, "get_backend", lambda: "module://matplotlib_inline" if notebook else "agg")
    if name:
        monkeypatch.setenv(name, "agg")
    assert _has_screen() is shown
