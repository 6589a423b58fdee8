"""Triggers over the rings of a real segment: no spike missed, captures exact to the tick, ends that are told."""

import logging
from itertools import pairwise

import numpy as np
import pytest

import silo
from silo.conditions import rows
from silo.conditions.captures.files import write_capture
from silo.conditions.segment_judge import MOST_SPOOL_BYTES, SegmentJudge, try_trigger
from silo.conditions.standing import TriggerWord
from silo.core.conditions import Conditions, TriggerOptions
from silo.core.quantities.writing import count
from silo.files.manifest import CaptureList
from silo.judging.checks import trigger_rule
from silo.judging.triggers import NO_END
from silo.segment.layout import TIME_RING
from silo.segment.reader import SegmentReader
from silo.verify.folder import verify


class Robot:
    """A logger of 1 kHz without a helper, and the judge of its present run."""

    def __init__(self, folder, signals=4, size=3000):
        self.logger = silo.Logger("judged", frequency=1000, max_time=0, folder=folder, script=folder / "none.yaml")
        self.x = self.logger.array("x", signals, size=size, group="fast")
        self.slow = np.zeros(())
        self.logger.add(self.slow, "slow", divider=10, size=max(size // 10, 1))

    def start(self):
        self.logger.start()
        self.judge = SegmentJudge(SegmentReader(self.logger._present.path), self.logger.elements)

    def ticks(self, count, spikes=()):
        """Run the loop; `spikes` are (tick from now on, signal)."""
        at = dict(spikes)
        for tick in range(count):
            self.x[:] = 0.0
            if tick in at:
                self.x[at[tick]] = 100.0
            self.slow[...] = self.logger.ticks
            self.logger.collect()


@pytest.fixture
def robot(tmp_path, runtime_folder):
    made = Robot(tmp_path)
    yield made
    made.logger.close()


def test_a_capture_is_exact_to_the_tick(robot):
    robot.logger.trigger("spike", "any(fast/x > 50)", pre="20ms", post="10ms")
    robot.start()
    robot.ticks(500, [(317, 1)])
    (buffer,) = robot.judge.step().whole
    recording = buffer.recording()
    # the slow signal brings the sample that holds at tick 297, with its time stamp
    assert (recording.offset - len(recording.time_ns), recording.offset - 1) == (290, 327)
    log = silo.Log(recording)
    assert log["fast/x_1"].values.tolist() == [0.0] * 20 + [100.0] + [0.0] * 10
    assert len(log["fast/x_1"].values) == 327 - 297 + 1
    assert log["slow"].values.tolist() == [290.0, 300.0, 310.0, 320.0]
    assert recording.warnings == ()
    facts = recording.conditions.capture
    assert (facts.trigger, facts.first, facts.last, facts.fires, facts.ended) == ("spike", 297, 327, (317,), "")


def test_a_signal_is_not_stale_for_ticks_that_came_while_it_was_judged(tmp_path, runtime_folder):
    ticks = iter(range(0, 10**12, 10**6))
    logger = silo.Logger("judged", frequency=1000, folder=tmp_path, script=tmp_path / "none.yaml", clock=ticks.__next__)
    x = logger.array("x", size=3000)
    logger.limit("x", (None, None, None, 1e9), stale=0.15)
    logger.start()
    judge = SegmentJudge(SegmentReader(logger._present.path), logger.elements)

    def turn(count):
        for _ in range(count):
            x[...] += 1
            logger.collect()

    read = judge._rows.read

    def read_while_it_turns(until):
        rows = read(until)
        turn(400)
        return rows

    judge._rows.read = read_while_it_turns
    turn(100)
    judge.step()
    judge._rows.read = read
    judge.step()
    (limit,) = judge.limits.statuses()
    assert limit.stale_count == 0
    logger.close(discard=True)


def test_captures_that_wait_to_be_written_leave_no_room_for_more_and_it_is_said(robot):
    robot.logger.trigger("spike", "any(fast/x > 50)", pre="20ms", post="10ms")
    robot.start()
    reader = SegmentReader(robot.logger._present.path)
    robot.judge = SegmentJudge(reader, robot.logger.elements, unwritten=lambda: MOST_SPOOL_BYTES + 1)
    robot.ticks(500, [(317, 1)])
    found = robot.judge.step()
    assert (found.whole, len(found.fired)) == ([], 1)
    ((name, text),) = found.left_out
    assert name == "spike"
    assert text.startswith("capture 1 of 'spike' was left out")


@pytest.mark.parametrize(
    ("what", "most", "bytes_most", "ticks_most"),
    [("triggers.MOST_CAPTURE_BYTES", 2**16, 2**16, 10**9), ("checks.LONG_CAPTURE_S", 0.1, 2**19, 2050 + 206)],
)
def test_fires_without_end_close_a_capture_at_its_most_bytes_or_time_and_go_on_in_the_next(
    robot, monkeypatch, what, most, bytes_most, ticks_most
):
    monkeypatch.setattr(f"silo.judging.{what}", most)
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="200ms")
    robot.start()
    whole, held = [], 0
    for _ in range(60):
        robot.ticks(100, [(50, 0)])
        whole += robot.judge.step().whole
        held = max(held, sum(buffer.size_bytes for buffer in robot.judge._buffers))
    assert held <= 2 * bytes_most
    assert len(whole) >= 2
    for buffer, following in pairwise(whole):
        assert buffer.size_bytes <= bytes_most
        assert buffer.capture.last - buffer.capture.first + 1 <= ticks_most
        assert buffer.why == f"closed as it fired on and on: capture {buffer.capture.number + 1} goes on"
        assert following.capture.first <= buffer.capture.last  # no tick is in neither
        assert len(silo.Log(buffer.recording())["fast/x_0"]) == buffer.capture.last - buffer.capture.first + 1


@pytest.mark.parametrize(("post", "ends"), [("100ms", 60.0), ("8s", 80.05)])
def test_fires_without_end_have_a_file_within_a_minute_or_ten_times_what_one_captures(robot, post, ends):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post=post)
    rule = trigger_rule(robot.logger._conditions.now.triggers[0], 1000.0)
    assert rule.longest == ends * 1000
    robot.logger.trigger("look", "fast/x_0 > 50", save=[])
    assert trigger_rule(robot.logger._conditions.now.triggers[1], 1000.0).longest == NO_END


def test_captures_under_way_that_take_all_memory_together_are_closed_and_say_so(robot, monkeypatch):
    robot.logger.trigger("one", "fast/x_0 > 50", pre="5ms", post="20s")
    robot.logger.trigger("two", "fast/x_1 > 50", pre="5ms", post="20s")
    robot.start()
    robot.ticks(500, [(40, 0), (60, 1)])
    robot.judge.step()
    monkeypatch.setattr("silo.conditions.segment_judge.MOST_SPOOL_BYTES", 2**15)
    robot.ticks(500)
    whole = robot.judge.step().whole
    assert [buffer.trigger for buffer in whole] == ["one", "two"]
    assert all("closed as all captures in memory take" in buffer.why for buffer in whole)
    monkeypatch.undo()
    robot.ticks(100, [(50, 0)])
    robot.judge.step()
    assert [buffer.capture.number for buffer in robot.judge._buffers] == [2]


def test_a_post_that_no_memory_holds_is_refused_with_its_size(robot):
    robot.logger.array("many", 500, size=3000)
    with pytest.raises(silo.ElementError, match=r"pre and post of 43200 s are 16[0-9],[0-9]{3} MB.* at most 256 MB"):
        robot.logger.trigger("spike", "fast/x_0 > 50", post="12h")
    assert robot.logger._conditions.now.triggers == ()


def test_each_fire_is_told_also_one_that_makes_a_capture_longer(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="100ms")
    robot.start()
    robot.ticks(200, [(100, 0), (110, 0)])
    fired = robot.judge.step().fired
    robot.ticks(200, [(1, 0)])
    fired += robot.judge.step().fired
    assert [(name, [fire.tick for fire in fires]) for name, fires in fired] == [
        ("spike", [100]), ("spike", [110]), ("spike", [201])
    ]  # fmt: skip


def test_fires_of_what_chatters_are_told_together(robot):
    robot.logger.trigger("noise", "fast/x_0 > 50")
    robot.start()
    robot.ticks(1000, [(tick, 0) for tick in range(100, 900, 2)])
    fired = robot.judge.step().fired
    assert sum(len(fires) for _, fires in fired) == 400
    assert len(fired) == 21
    assert [fire.tick for fire in fired[-1][1]] == list(range(140, 900, 2))


def test_limits_that_nobody_judges_are_told_at_the_start(robot, caplog):
    robot.logger.limit("fast/x", (None, None, 1.0, 2.0))
    robot.logger.start()
    assert "limits are judged by the helper process, and there is none: call serve()" in caplog.text


def test_a_capture_may_be_longer_than_any_ring(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="100ms", post="8s")
    robot.start()
    robot.ticks(200, [(150, 0)])
    whole = robot.judge.step().whole
    for _ in range(9):
        robot.ticks(1000)
        whole += robot.judge.step().whole
    recording = whole[0].recording()
    assert len(recording.time_ns) == 8101
    assert recording.warnings == ()


def test_a_fire_within_post_makes_the_capture_longer_and_overlapping_triggers_have_their_own(robot):
    robot.logger.trigger("one", "fast/x_0 > 50", pre="5ms", post="20ms")
    robot.logger.trigger("two", "fast/x_1 > 50", pre="5ms", post="20ms")
    robot.start()
    robot.ticks(200, [(100, 0), (110, 1), (115, 0)])
    found = {buffer.trigger: buffer.capture for buffer in robot.judge.step().whole}
    assert [(found[name].first, found[name].last) for name in ("one", "two")] == [(95, 135), (105, 130)]


def test_an_end_before_post_gives_what_there_is_and_says_so(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="1s")
    robot.start()
    robot.ticks(50, [(40, 0)])
    (buffer,) = robot.judge.end("the robot program died").whole
    recording = buffer.recording()
    assert len(silo.Log(recording)["fast/x_0"].values) == 15
    assert "the robot program died, 991 ticks before its end" in recording.warnings[0]
    assert recording.conditions.capture.ended.startswith("the robot program died")


def test_rows_that_were_overwritten_before_they_were_judged_are_told(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="5ms")
    robot.start()
    robot.ticks(5000, [(100, 0), (4900, 0)])
    found = robot.judge.step()
    assert "blind for" in found.blind[0]
    assert [fire.tick for _, fires in found.fired for fire in fires] == [4900]


def test_what_is_set_while_it_runs_looks_back_at_what_buffers_hold(robot):
    robot.start()
    robot.ticks(2000, [(1999, 0)])
    robot.judge.step()
    robot.logger.trigger("mean", "mean(fast/x_0, 5s) > 0.2 or max(slow, 5s) < 1", pre=0, post=0)
    robot.logger.derive("step", "diff(fast/x_0)")
    robot.logger.derive("most", "max(fast/x_0, 5s)")
    robot.logger.limit("most", (None, 50, None, None))
    robot.logger.limit("step", (None, -50, 50, None))
    robot.judge.adopt(robot.logger._conditions.now)
    robot.ticks(100, [(5, 0)])
    assert robot.judge.step().fired == []
    assert [(one.name, one.count) for one in robot.judge.limits.statuses()] == [("/log/most", 0), ("/log/step", 3)]


def test_what_must_last_is_counted_from_where_rows_were_overwritten(robot):
    robot.logger.trigger("calm", "fast/x_0 < 50", persist="3s", pre=0, post=0)
    robot.start()
    robot.ticks(20, [(10, 0)])
    robot.judge.step()
    robot.ticks(5000)
    oldest = robot.judge._rows.oldest_tick()
    assert [fire.tick for _, fires in robot.judge.step().fired for fire in fires] == [oldest + 3000]


def test_of_a_capture_whose_rows_were_overwritten_the_ticks_that_are_missing_are_counted(tmp_path, runtime_folder):
    robot = Robot(tmp_path, size=8000)
    robot.logger.add(robot.slow, "brief", divider=10, size=103)  # the first of which something is missing
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="6s")
    robot.start()
    robot.ticks(1000, [(100, 0)])
    robot.judge.step()
    robot.ticks(5500)
    (buffer,) = robot.judge.step().whole
    recording = buffer.recording()
    robot.logger.close()
    missing = int(silo.Log(recording)["brief"].values[0]) - recording.conditions.capture.first
    assert missing > 3000
    assert (
        recording.conditions.capture.ended
        == f"the first {count(missing)} ticks were overwritten before they could be copied"
    )


def test_a_capture_whose_rows_were_all_overwritten_says_so_and_verify_names_its_ticks(robot, tmp_path):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="5ms")
    robot.start()
    robot.ticks(102, [(100, 0)])
    assert not robot.judge.step().whole
    robot.ticks(5000)
    (buffer,) = robot.judge.step().whole
    assert buffer.why == "all 11 ticks were overwritten before they could be copied"
    written = write_capture(buffer, str(tmp_path), CaptureList(str(tmp_path), "judged"), ())
    assert f"ticks 95 to 105 ({buffer.why}): " in written.text
    found = verify(tmp_path)
    assert [(one.kind, one.spans, buffer.why in one.told) for one in found.told] == [("missing", ((95, 105),), True)]


def test_windows_for_which_there_is_no_memory_are_not_judged_and_said_and_all_others_are(robot):
    for name in "abcd":
        robot.logger.trigger(name, "any(mean(fast/x, 50s) > 1000)")
        robot.logger.derive(f"of_{name}", "max(std(fast/x, 50s))")
        robot.logger.limit(f"of_{name}", (None, None, 1e9, 1e9))
    robot.logger.trigger("spike", "any(fast/x > 50)", pre="20ms", post="10ms")
    robot.start()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rows, "MOST_REMEMBERED_BYTES", 3 * 4 * 50 * 1000 * 8)  # three of them: windows of 4 values
        judge = SegmentJudge(robot.judge.reader, robot.logger.elements)
    why = "its windows remember 1.6 MB, and with those before it that is more than"
    said = [f"trigger 'd' is not judged: {why}", f"limits of 'of_d' are not judged: {why}"]
    assert [text.startswith(one) for text, one in zip(judge.problems, said, strict=True)] == [True, True]
    robot.ticks(100, [(50, 0)])
    assert [name for name, _ in judge.step().fired] == ["spike"]
    states = [one.state for one in judge.triggers()]
    assert [one is TriggerWord.BLIND for one in states] == [False, False, False, True, False]


def test_spikes_of_one_sample_at_random_places_are_all_captured_and_nothing_else(tmp_path, runtime_folder):
    robot = Robot(tmp_path, signals=500, size=2000)
    pre, post, ticks = 7, 3, 20_000
    robot.logger.trigger("spike", "max(fast/x) > 50", pre=f"{pre}ms", post=f"{post}ms")
    robot.start()
    rng = np.random.default_rng(5)
    places = np.sort(rng.choice(ticks // 20 - 1, 300, replace=False)) * 20 + rng.integers(10, 15, 300)
    signals = rng.integers(0, 500, 300)
    whole = []
    spikes = dict(zip(places.tolist(), signals.tolist(), strict=True))
    at = 0
    while at < ticks:
        count = int(rng.integers(1, 900))
        robot.ticks(count, [(place - at, signal) for place, signal in spikes.items() if at <= place < at + count])
        at += count
        whole += robot.judge.step().whole
    whole += robot.judge.end("done").whole
    assert [buffer.capture.fires[0].tick for buffer in whole] == places.tolist()
    for buffer, place, signal in zip(whole[::10], places[::10].tolist(), signals[::10].tolist(), strict=True):
        recording = buffer.recording()
        values = recording.elements[0].entries[signal].values
        assert recording.offset - 1 == place + post
        assert values.tolist() == [0.0] * pre + [100.0] + [0.0] * post
    robot.logger.close()


def test_a_pre_longer_than_a_buffer_is_refused_with_the_size_that_would_do(robot):
    with pytest.raises(silo.ElementError, match=r"'/log/fast/x' holds 3000 samples, .* s at divider 1: set size=6002"):
        robot.logger.trigger("spike", "fast/x_0 > 50", pre="5s")
    assert robot.logger._conditions.now.triggers == ()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"when": "fast/x > 3"}, "4 values"), ({"when": "fast/y_0 > 3"}, "did you mean"), ({"edge": "up"}, "rising"),
        ({"mode": "auto"}, "normal or single"), ({"post": "soon"}, "must be a time"), ({"name": "a/b"}, "contains '/'"),
        ({"save": ["xls"]}, "xls"), ({"keep": -1}, "keep"), ({"rearm": "3 >"}, "missing at the end"),
    ],
)  # fmt: skip
def test_mistakes_in_a_trigger_are_refused(robot, options, says):
    with pytest.raises(silo.ElementError, match=says):
        robot.logger.trigger(**{"name": "spike", "when": "fast/x_0 > 50", **options})
    assert robot.logger._conditions.now.triggers == ()


def test_a_start_without_a_helper_says_that_nobody_judges(robot, caplog):
    robot.logger.trigger("spike", "fast/x_0 > 50")
    with caplog.at_level(logging.WARNING, "silo"):
        robot.start()
    assert "spike: triggers are judged by the helper process, and there is none: call serve()" in caplog.text
    assert "unobservable" not in caplog.text
    robot.logger.stop()
    robot.logger.set("fast/x", enabled=False)
    robot.logger.start()
    assert "trigger 'spike' is unobservable: the elements in it are off" in caplog.text


def test_what_keeps_its_first_samples_hinders_no_trigger(robot):
    robot.logger.add(np.zeros(()), "gain", buffer="fixed", size=1)
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="20ms", post="10ms")
    robot.start()
    robot.ticks(500, [(317, 1), (320, 0)])
    (buffer,) = robot.judge.step().whole
    log = silo.Log(buffer.recording())
    assert len(log["fast/x_0"]) == 31


def test_a_trigger_whose_signal_is_recorded_no_more_is_told_to_be_blind_once_and_from_when(robot):
    robot.logger.add(robot.slow, "kept", buffer="fixed", size=100)
    robot.logger.trigger("late", "kept > 500")
    robot.start()
    robot.ticks(100)
    assert not robot.judge.step().blind
    robot.ticks(100)
    why = "'/log/kept' keeps its first samples only (buffer=fixed), and its buffer is full"
    assert robot.judge.step().blind == [f"trigger 'late' is blind from here on: {why}"]
    robot.ticks(100)
    assert not robot.judge.step().blind
    (stands,) = robot.judge.triggers()
    assert (stands.state, stands.why) == (TriggerWord.BLIND, why)


def test_what_is_captured_is_written_and_says_so_when_judging_fails(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="1s")
    robot.start()
    robot.ticks(50, [(40, 0)])
    robot.judge.step()
    robot.ticks(50)

    found = robot.judge.close("judging failed")

    (buffer,) = found.whole
    assert buffer.ended == "judging failed, 991 ticks before its end"
    assert len(silo.Log(buffer.recording())["fast/x_0"].values) == 15
    assert robot.judge.close("again").whole == []


def test_a_trigger_that_is_removed_and_set_again_within_post_has_two_captures(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="100ms")
    robot.start()
    robot.ticks(50, [(40, 0)])
    whole = robot.judge.step().whole
    conditions = robot.judge.conditions
    robot.judge.adopt(Conditions())
    robot.judge.adopt(conditions)
    robot.ticks(200, [(10, 0)])
    whole += robot.judge.step().whole
    assert [(buffer.capture.number, buffer.capture.first) for buffer in whole] == [
        (1, 35),
        (2, 55),
    ]


def test_only_what_a_successor_would_not_find_in_the_rings_is_closed_at_a_handover(robot):
    robot.logger.trigger("early", "fast/x_0 > 50", pre="5ms", post="20s")
    robot.logger.trigger("late", "fast/x_1 > 50", pre="5ms", post="20s")
    robot.start()
    robot.ticks(1000, [(40, 0)])
    robot.judge.step()
    robot.ticks(2000, [(1900, 1)])
    (buffer,) = robot.judge.hand_over("the helper process was replaced").whole
    assert (buffer.trigger, buffer.capture.first) == ("early", 35)
    assert buffer.ended.startswith("the helper process was replaced")
    kept = robot.judge.state([], [], closed=False).captures
    assert [(one.options.name, one.capture.first) for one in kept] == [("late", 2895)]


def test_an_element_that_is_off_is_left_out_of_a_wildcard_and_named(robot):
    robot.logger.array("legs/a/slip", size=3000)
    robot.slip = robot.logger.array("legs/b/slip", size=3000)
    robot.logger.trigger("slip", "any(legs/*/slip > 50)", pre="5ms", post="5ms")
    robot.logger.trigger("step", "max(diff(legs/*/slip)) > 50", pre="5ms", post="5ms")
    robot.logger.trigger("never", "fast/x_0 > 50 and legs/a/slip > 50", pre="5ms", post="5ms")
    robot.logger.update()
    robot.logger.set("legs/a/slip", enabled=False)
    robot.start()
    robot.ticks(100)
    for value in (100.0, 0.0, 100.0, 0.0):
        robot.slip[...] = value
        robot.ticks(20)
    fired = robot.judge.step().fired
    assert [(name, fire.tick) for name, fires in fired for fire in fires if name == "slip"] == [
        ("slip", 100), ("slip", 140)
    ]  # fmt: skip
    assert [fire.tick for name, fires in fired for fire in fires if name == "step"] == [100, 140]
    assert robot.judge.problems[0] == "trigger 'slip' is judged without /log/legs/a/slip: off"
    slip, _, never = robot.judge.triggers()
    assert slip.why == "judged without /log/legs/a/slip: off"
    assert never.state.name == "BLIND"


OFF_IN_IT = [
    ("fast/x_0 > 50 or off > 1", "rising", [40, 60, 90]),
    ("off > 1 or fast/x_0 > 50", "rising", [40, 60, 90]),
    ("not (fast/x_0 <= 50 and off < 1)", "rising", [40, 60, 90]),
    ("any(fast/x_0 > 50, off > 1)", "rising", [40, 60, 90]),
    ("fast/x_0 <= 50 and off < 1", "falling", [40, 60, 90]),
    ("fast/x_0 > 50 and (off > 1 or fast/x_0 > 20)", "rising", [40, 60, 90]),
]


@pytest.mark.parametrize(("when", "edge", "fires"), OFF_IN_IT)
def test_an_alternative_that_is_off_keeps_a_trigger_from_no_rise_of_the_other(robot, when, edge, fires):
    robot.logger.array("off", ())
    robot.logger.update(read_script=False)
    robot.logger.set("off", enabled=False)
    robot.logger.trigger("either", when, edge=edge)
    robot.start()
    robot.ticks(200, [(tick, 0) for tick in fires])
    found = robot.judge.step()
    assert [fire.tick for _, some in found.fired for fire in some] == fires
    assert robot.judge.problems == ["trigger 'either' is judged without /log/off: off"]
    assert robot.judge.triggers()[0].state.value == "armed"


def test_an_alternative_of_which_nothing_is_known_now_keeps_a_trigger_from_no_rise_of_the_other(robot):
    robot.logger.trigger("either", "fast/x_0 > 50 or fast/x_1 > 50")
    robot.start()
    for spike in (False, True, False, False, True, False):
        robot.x[:] = [100.0 if spike else 0.0, np.nan, 0.0, 0.0]
        robot.logger.collect()
    found = robot.judge.step()
    assert [fire.tick for _, some in found.fired for fire in some] == [1, 4]


def test_a_rearm_condition_that_is_off_is_told(robot):
    robot.logger.array("off", ())
    robot.logger.update(read_script=False)
    robot.logger.set("off", enabled=False)
    robot.logger.trigger("once", "fast/x_0 > 50", rearm="off < 1")
    robot.start()
    assert robot.judge.problems == [
        "trigger 'once' fires once and never again: its rearm condition needs /log/off, which is off"
    ]
    robot.ticks(200, [(40, 0), (60, 0)])
    assert [fire.tick for _, some in robot.judge.step().fired for fire in some] == [40]
    assert robot.judge.triggers()[0].why.startswith("fires once and never again")


def test_a_try_of_a_trigger_judges_as_the_trigger_does(robot):
    robot.logger.array("off", ())
    robot.logger.update(read_script=False)
    robot.logger.set("off", enabled=False)
    robot.start()
    robot.ticks(200, [(40, 0), (60, 0)])
    tried = TriggerOptions("try", "any(fast/x_0 > 50, off > 1)")
    found = try_trigger(tried, SegmentReader(robot.logger._present.path), robot.logger.elements)
    assert (found.ticks, found.held) == ([40, 60], 2)


def test_a_try_of_what_holds_all_the_time_tells_so_though_it_never_fires(robot):
    robot.start()
    robot.ticks(200)
    found = try_trigger(TriggerOptions("try", "fast/x_0 < 1e6"), SegmentReader(robot.logger._present.path),
                        robot.logger.elements)  # fmt: skip
    assert (found.fires, found.held, found.judged, found.blind) == (0, 200, 200, 0)
    ends = SegmentReader(robot.logger._present.path).rows(TIME_RING, 0, 200).time_ns[[0, -1]].tolist()
    assert (found.first, found.last, [found.begin_ns, found.end_ns]) == (0, 199, ends)


def test_what_there_was_no_time_to_judge_before_the_end_is_told(robot):
    robot.logger.trigger("spike", "fast/x_0 > 50", pre="5ms", post="5s")
    robot.start()
    robot.ticks(200, [(100, 0)])
    robot.judge.step()
    robot.ticks(200)
    found = robot.judge.end("closed", lambda: True)
    assert found.blind[0].startswith("triggers and limits did not judge the last 200 ticks")
    assert [buffer.why for buffer in found.whole] == ["closed, 4 901 ticks before its end"]


def test_an_alarm_that_nobody_has_seen_outlives_an_edit_of_its_limits(robot):
    def statuses():
        return {one.name.rpartition("/")[2]: one for one in robot.judge.limits.statuses()}

    def edited(high, **more):
        robot.logger.limit("fast/x", (None, None, high, None), **more)
        robot.judge.adopt(robot.logger._conditions.now)

    robot.logger.limit("fast/x", (None, None, 50, None))
    robot.start()
    robot.ticks(50, [(20, 0), (40, 0), (10, 1)])
    assert len(robot.judge.step().limits) > 1
    robot.judge.limits.acknowledge(["/log/fast/x_1"], "ann", 7)
    robot.judge.limits.news(last=True)
    for edit in ({"hysteresis": 2.0}, {"persistence": 2}):
        edited(99, **edit)
        found = statuses()
        assert [(found[one].alarm, found[one].count, found[one].seen_by) for one in ("x_0", "x_1")] == [
            (True, 2, ""), (False, 1, "ann"),
        ]  # fmt: skip
        assert robot.judge.limits.news(last=True) == []
    edited(50)
    robot.ticks(50, [(20, 1)])
    told = [one.text for one in (*robot.judge.step().limits, *robot.judge.limits.news(last=True))]
    found = statuses()
    assert (found["x_0"].count, found["x_1"].count, found["x_1"].alarm, found["x_1"].since_seen) == (2, 2, True, 1)
    assert told
    assert all("fast/x_1" in one for one in told)
