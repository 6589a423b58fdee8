"""What happened, seen from a log: on its own scale of time, in its parts, in its plots."""

from dataclasses import replace

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.analysis.plots.charts import ChartSpec, make_chart
from silo.analysis.plots.drawing import draw_axes, draw_text
from silo.core.elements import BufferType, LoggedEvent
from silo.core.recording import Recording, stamped

START = 1_700_000_000_000_000_000
STEP = 2_000_000


@pytest.fixture
def log(recorded, plan):
    recording = recorded([plan("/log/x", size=100, buffer_type=BufferType.GROWING)], 100, start_ns=START, step_ns=STEP)
    told = (
        LoggedEvent("started", "started", START + 9, 0, who="bot"),
        LoggedEvent("marker", "push", START + 9, 40, who="me"),
        LoggedEvent("marker", "late", START + 10**9, 120, who="me"),
    )
    return Log(replace(recording, events=stamped(told, recording.time_ns, recording.offset)))


def test_events_have_tick_time_seconds_and_author(log):
    push = log.events[1]
    assert (push.tick, push.time_ns, push.kind, push.text, push.who) == (40, START + 40 * STEP, "marker", "push", "me")
    assert push.seconds == pytest.approx(0.08)
    assert [event.words for event in log.events] == ["started", "marker push", "marker late"]


def test_a_part_of_a_log_has_what_happened_in_it(log):
    assert [event.text for event in log.clip(0.05, 0.1).events] == ["push"]
    assert log.clip(0.05, 0.1).events[0].seconds == pytest.approx(0.08)
    assert log.clip(0.1, 0.15).events == []


def test_a_log_at_other_times_has_them_at_the_tick_that_held(log):
    again = log.resample(100.0)
    push = next(event for event in again.events if event.text == "push")
    assert again.time_ns[push.tick] <= START + 40 * STEP < again.time_ns[push.tick + 1]


def test_plots_have_a_line_where_it_happened(log):
    chart, _ = make_chart(log.recording, ChartSpec(["/log/x"]))
    assert [words for _, words in chart.events] == ["started", "marker push"]
    text = draw_text(chart, color=False)
    assert "│  0.08  marker push" in text


def test_pictures_have_it_too(log):
    figures = pytest.importorskip("matplotlib.figure")
    axes = figures.Figure().add_subplot()
    chart, _ = make_chart(log.recording, ChartSpec(["/log/x"]))
    draw_axes(chart, axes)
    assert [text.get_text() for text in axes.texts] == ["started", "marker push"]


def test_a_spectrum_has_no_lines_of_time(log):
    chart, _ = make_chart(log.recording, ChartSpec(["/log/x"], transform="spectrum"))
    assert chart.events == ()


def test_events_of_a_run_without_a_tick_count_from_its_start():
    events = (LoggedEvent("parameter", "kp = 4", START + 5 * 10**8),)
    empty = Log(Recording("robot", np.zeros(0, np.int64), 0, (), started_ns=START, events=events))
    assert [event.seconds for event in empty.events] == [0.5]
