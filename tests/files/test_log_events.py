"""What happened, seen from a log: on its own scale of time, in its parts, in its plots."""

from dataclasses import replace

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.analysis.plots.charts import ChartSpec, make_chart
from silo.analysis.plots.drawing import draw_axes, draw_text
from silo.cli.main import run
from silo.core.elements import BufferType, LoggedEvent, by_clock
from silo.core.recording import Recording, stamped
from silo.files.event_log import append_events

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


def test_events_stand_in_the_order_of_time_also_where_one_was_told_later(log):
    ticks = [
        LoggedEvent("triggered", "seen", START + 10**9, 20),
        LoggedEvent("marker", "before", START + 5 * 10**8, 30),
    ]
    told = (*ticks, LoggedEvent("saved", "saved", START - 10**8))
    recording = log.recording
    made = Log(replace(recording, events=stamped(told, recording.time_ns, recording.offset)))
    assert [event.text for event in made.events] == ["saved", "seen", "before"]
    assert np.all(np.diff([event.seconds for event in made.events]) > 0)


def test_what_has_no_tick_counts_from_where_the_run_of_a_clock_of_its_own_began(log):
    """Ticks 500 to 599 of a simulation are held, at 1 to 1.2 s of its clock."""
    time_ns = 10**9 + np.arange(100) * STEP
    told = (LoggedEvent("marker", "push", START + 10**9, 510), LoggedEvent("saved", "saved", START + 11 * 10**8))
    held = Recording("sim", time_ns, 600, (), started_ns=START, events=stamped(told, time_ns, 600))
    push, saved = Log(held).events
    assert (push.text, push.seconds) == ("push", pytest.approx(0.02))
    assert (saved.text, saved.seconds) == ("saved", pytest.approx(0.1))


def test_the_shell_prints_events_in_the_order_of_the_clock(tmp_path, capsys):
    """A start is told when its helper process is there; a clock that is set back by an hour begins anew."""
    seconds = (10, 9, 11, 3600, 12)
    found = [
        LoggedEvent("marker", f"at {at}", START + at * 10**9, number=number) for number, at in enumerate(seconds, 1)
    ]
    assert [one.text for one in by_clock(found)] == ["at 9", "at 10", "at 11", "at 3600", "at 12"]
    append_events(tmp_path, "bot", found[:3])
    assert run(["events", str(tmp_path)]) == 0
    assert [line.split()[-1] for line in capsys.readouterr().out.splitlines()] == ["9", "10", "11"]
