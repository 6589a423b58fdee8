"""A change of parameters in a part of an endless recording is read as it stood in the event log.

What is known where some of them are missing.
"""

import numpy as np
import pytest
from msgspec.structs import replace

import silo
from silo.core.elements import PARAMETER, LoggedEvent
from silo.core.parameter_images import FOR_EVER, Unknown, image_until, unknown_of_runs, unknown_ticks
from silo.core.recording import Recording
from silo.core.tuning.parameters import ParameterChange
from silo.errors import ElementError
from silo.files.parts.events import event_messages, events_of


def test_a_change_comes_out_of_a_part_as_it_went_in():
    change = ParameterChange((("/log/kp", 40.0, 50.0), ("/log/gait", "STAND", "TROT")), "network", "a", 12)
    event = LoggedEvent(PARAMETER, "kp 40.0 -> 50.0", 5, 7, 9, "alice", "r", 3, change)
    data, _, _ = event_messages(1, [event], "bot", 0)
    assert events_of(data, np.zeros(1, np.uint64), 3, 7, "r") == [event]


def told(tick: int, old: float | None, new: float, order: int, span: int = 0) -> LoggedEvent:
    change = ParameterChange((("/log/kp", old, new),), order=order, span=span)
    return LoggedEvent(PARAMETER, f"{old} {new}", tick, tick, run="r", change=change)


START, FIRST, SECOND, FIFTH = told(0, None, 1.0, 0), told(3, 1.0, 2.0, 1), told(4, 2.0, 3.0, 2), told(9, 5.0, 6.0, 5)
IMAGE = told(8, None, 5.0, 4, span=5)


@pytest.mark.parametrize(
    ("events", "unknown"),
    [
        ([START, FIRST, SECOND], []),
        ([START, FIRST, SECOND, IMAGE, FIFTH], [Unknown(4, 8, 2, True)]),
        ([START, FIRST, IMAGE], [Unknown(3, 8, 3, True)]),
        ([START, IMAGE, FIFTH], [Unknown(3, 8, 4, True)]),
        ([IMAGE, FIFTH], [Unknown(3, 8, 1, True)]),
        ([START, SECOND, FIFTH], [Unknown(0, 4, 1, False), Unknown(4, 9, 2, False)]),
        ([SECOND, told(6, 3.0, 4.0, 3)], []),  # of a part
        ([START, FIRST, image_until(IMAGE, 5)], [Unknown(3, FOR_EVER, 3, True)]),  # of a capture that ended before
        ([START], []),
        ([told(4, None, 1.0, -1)], []),
    ],
)
def test_where_changes_are_missing_nothing_is_known_until_an_image_comes(events, unknown):
    assert unknown_ticks(events) == unknown


def test_of_several_runs_each_is_looked_at_by_its_ticks_whatever_the_clock_was_set_to():
    events = [START, IMAGE, told(12, None, 7.0, 6, span=3)]
    alone = unknown_ticks(events)
    assert alone == [Unknown(3, 8, 4, True), Unknown(9, 12, 2, True)]
    back = [replace(event, time_ns=-event.time_ns, run=run) for run in "rs" for event in reversed(events)]
    assert unknown_of_runs(back) == 2 * alone


def test_of_an_image_behind_the_last_tick_all_of_whose_changes_are_there_too_nothing_stays():
    assert image_until(IMAGE, 8) == IMAGE
    assert image_until(IMAGE, 2) is None
    assert image_until(FIFTH, 8) is None


STANDING = told(-1, 6.0, 7.0, 6)


def outcome(log: silo.Log, time_s: float) -> object:
    try:
        return log.parameters.at(time_s)
    except ElementError as error:
        assert "is not known" in str(error)
        return "unknown"


@pytest.mark.parametrize(
    "events",
    [
        [START],
        [START, FIRST, SECOND],
        [START, FIRST, SECOND, IMAGE, FIFTH, STANDING],
        [START, FIRST, IMAGE],
        [START, IMAGE, FIFTH],
        [START, SECOND, FIFTH],
        [START, FIRST, image_until(IMAGE, 5)],
    ],
)
def test_what_parameters_were_is_the_same_in_parts_and_at_other_times(events):
    events = [replace(event, stamp_ns=max(event.tick, 0) * 10**9) for event in events]
    log = silo.Log(Recording("dog", np.arange(12) * 10**9, 12, [], events=tuple(events)))
    wanted = [outcome(log, second) for second in range(12)]
    images = [event for event in events if event.change.is_image and event.change.order > 0]
    for begin in range(12):
        for end in range(begin, 12):
            part = log.clip(begin, end)
            for second in range(begin, end + 1):
                found = outcome(part, second)
                # a part that begins where changes without an image are missing may not know what they were to its end
                assert found == wanted[second] or (found == "unknown" and wanted[begin] == "unknown" and not images)
            assert part.clip(begin, end).parameters.names == part.parameters.names
            assert not {event.text for event in part.parameters.changes} - {event.text for event in events}
    for rate in (1, 4):
        other = log.resample(rate)
        assert [outcome(other, second) for second in range(12)] == wanted
        assert len(other.warnings) == len(log.warnings)


@pytest.mark.parametrize("method", ["hold", "linear"])
@pytest.mark.parametrize(("rate", "late"), [(100, 0), (1000, 0), (30, 4)])
def test_at_another_rate_parameters_are_what_they_were_though_samples_of_them_are_held(tmp_path, rate, late, method):
    now = [10**18]
    log = silo.Logger("dog", frequency=100, folder=tmp_path, clock=lambda: now[0])
    x, kp, gains = log.array("x"), log.parameter("kp", 1.0), log.parameter("gains", [0, 0])
    log.start()
    wanted = []
    for tick in range(60):
        if tick in (set_to := {3: 50.0, 13: 60.0, 17: 20.0, 18: 30.0, 44: 70.0, 53: 1.0}):
            kp.value = set_to[tick]
        if tick == 25:
            gains.value = [2, 3]
        x[...] = tick
        wanted.append(log.parameters.read())
        log.collect()
        now[0] += 10**7
    whole = silo.open_log(log.save().path)
    log.close()
    other = whole.resample(rate, method)
    twice = other.resample(rate)
    other.save(tmp_path / "other.parquet")
    # the next of its own ticks has what was set
    saved = silo.open_log(tmp_path / "other.parquet")
    for read, behind in ((whole, 0), (other, late), (twice, late), (saved, late)):
        for tick in range(60):
            assert read.parameters.at(tick * 0.01) in wanted[max(0, tick - behind) : tick + 1]
    for begin in range(0, 50, 5):
        part = other.clip(begin * 0.01, begin * 0.01 + 0.1)
        for tick in range(begin + late, begin + 9):
            assert part.parameters.at(tick * 0.01) in wanted[max(0, tick - late) : tick + 1]
