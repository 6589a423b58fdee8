"""Triggers judged and captured by a real helper process: files that are whole, and say it where they aren't."""

from pathlib import Path

import pytest

import silo
import silo.analysis.log
from silo.client.client import Client
from silo.conditions.standing import LimitWord
from silo.core.conditions import TriggerWord
from silo.rpc.published import EventKind
from tests.waiting import wait_until


@pytest.fixture
def events(client):
    found = []
    client.on_event(found.append)
    return found


def captured(events, count=1):
    """The files of so many captures, in their order."""
    done = wait_until(
        lambda: len(found := [event for event in events if event.kind is EventKind.CAPTURED]) >= count and found
    )
    return [[file.path for file in event.files] for event in done]


def test_what_a_trigger_captures_is_in_a_file_of_its_name(bench, client, events):
    bench.logger.trigger("high", "x > 500", pre="50ms", post="30ms", save=["silo", "csv", "bag"])
    bench.logger.derive("twice", "2 * x")
    bench.start(600)
    ((plain, table, bag),) = captured(events)
    assert "_high_1.silo" in plain
    fired = next(event for event in events if event.kind is EventKind.TRIGGERED)
    assert fired.text == "trigger 'high' fired at tick 500"
    for path in (plain, table, bag):
        log = silo.open_log(path)
        assert log["x"].values.tolist() == list(range(496, 505))
        assert log["twice"].values.tolist() == list(range(992, 1010, 2))
        assert log.recording.conditions.capture.fires == (500,)
        assert log.warnings == ()


def test_a_capture_has_the_derived_signals_by_which_it_fired(bench, client, events):
    bench.logger.derive("p", "2 * x")
    bench.logger.trigger("high", "p > 100", pre="50ms", post="300ms")
    bench.start(60)
    wait_until(lambda: [event for event in events if event.kind is EventKind.TRIGGERED])
    bench.logger.derive("p", "x / 2")
    wait_until(lambda: client.table().derived[0].expression == "x / 2")
    bench.ticks(60)
    path = next(path for (path,) in captured(events) if "_high_1" in path)
    log = silo.open_log(path)
    assert log["p"].values.tolist() == [2 * x for x in log["x"].values.tolist()]


def test_a_new_run_within_post_closes_the_capture_and_begins_anew(bench, client, events):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="1s")
    bench.start(60)
    bench.logger.restart()
    bench.x[...] = 0
    bench.ticks(300)
    (first,), (second,) = captured(events, 2)
    with pytest.warns(silo.LogWarning):
        assert len(silo.open_log(first)["x"]) == 15
    assert len(silo.open_log(second)["x"]) == 106


def test_a_capture_over_a_cut_says_what_it_lacks_before_and_behind(bench, client, events):
    bench.logger.trigger("beat", "x == 58 or x == 63", pre="50ms", post="50ms")
    bench.start(60)
    bench.logger.set("q", divider=2, cut=True)
    bench.ticks(60)
    (first,), (second,) = captured(events, 2)
    with pytest.warns(silo.LogWarning, match="the run was cut, 3 ticks before its end"):
        assert silo.open_log(first)["x"].values.tolist() == list(range(53, 61))
    with pytest.warns(silo.LogWarning, match="the run was cut, and its first 3 ticks are of the stretch before"):
        assert silo.open_log(second)["x"].values.tolist() == list(range(61, 69))
    told = [event.text for event in events if event.kind is EventKind.CAPTURED]
    assert ["the run was cut" in text for text in told] == [True, True]


def test_a_robot_that_is_killed_within_post_leaves_a_capture_that_says_so(robots, runtime, tmp_path):
    (tmp_path / "logs").mkdir()
    script = tmp_path / "logs" / "bot.yaml"
    script.write_text("log_elements: []\ntriggers:\n  - {name: late, when: x > 300, pre_s: 0.1, post_s: 60}\n")
    robot = robots("bot")
    with Client.connect("bot") as client:
        events = []
        client.on_event(events.append)
        # it may have fired before this client came
        wait_until(lambda: any(event.kind == EventKind.TRIGGERED.value for event in client.events()))
        robot.kill()
        ((path,),) = captured(events)
    with pytest.warns(silo.LogWarning, match="the robot program died"):
        assert silo.open_log(path).recording.conditions.capture.trigger == "late"


def test_a_script_that_a_client_loads_sets_triggers(bench, client, events, tmp_path):
    text = "log_elements: []\ntriggers:\n  - {name: late, when: x > 300}\n"
    (tmp_path / "scripts" / "with.yaml").write_text(text)
    client.load_script("with.yaml")
    told = wait_until(lambda: next((event for event in events if event.kind is EventKind.SCRIPT_LOADED), None))
    assert told.text.endswith("; 1 trigger")
    assert [one.when for one in bench.logger._conditions.now.triggers] == ["x > 300"]


# ------------------------------------------------------------------------------------------- what is kept on the disk


def logs_of(bench):
    return sorted(path.name for path in Path(bench.logger.options.folder).glob("*_high_*.silo"))


def test_of_all_runs_together_the_newest_so_many_captures_stay(bench, client, events):
    bench.logger.trigger("high", "x % 10 == 0", keep=2)
    for run in range(2):
        bench.x[...] = 0
        bench.logger.start(unsaved="clear")
        bench.ticks(35)
        captured(events, 3 * (run + 1))
        bench.logger.stop()
    wait_until(lambda: len(logs_of(bench)) == 2)
    assert [name.rpartition("_")[2] for name in logs_of(bench)] == ["2.silo", "3.silo"]


def test_a_file_that_somebody_put_in_the_place_of_a_capture_is_not_removed(bench, client, events):
    bench.logger.trigger("high", "x % 10 == 0", keep=1)
    bench.start(12)
    ((path,),) = captured(events)
    Path(path).rename(f"{path}.mine")
    Path(path).write_text("mine")
    bench.ticks(20)
    captured(events, 3)
    wait_until(lambda: len(logs_of(bench)) == 2)
    assert Path(path).read_text() == "mine"


# -------------------------------------------------------------------------------------------------------- scripts


def test_a_script_leaves_alone_what_it_does_not_speak_of(bench, client, tmp_path):
    bench.logger.derive("twice", "2 * x")
    bench.logger.limit("x", (None, None, 1.0, 2.0))
    bench.logger.trigger("high", "x > 50")
    script = tmp_path / "scripts" / "more.yaml"
    script.write_text("log_elements: []\ntriggers:\n  - {name: low, when: x < 0}\n")
    wait_until(lambda: "high" in client.read_script().text)
    client.load_script("more.yaml")
    conditions = bench.logger._conditions.now
    assert [one.name for one in conditions.triggers] == ["low"]
    assert (len(conditions.derived), len(conditions.limits)) == (1, 1)
    script.write_text("log_elements: []\nsignal_limits: []\n")
    bench.logger.load_script(script)
    conditions = bench.logger._conditions.now
    assert (len(conditions.derived), len(conditions.limits), len(conditions.triggers)) == (1, 0, 1)


def test_a_script_whose_trigger_wants_more_past_than_its_buffers_hold_is_refused(bench, client, tmp_path):
    script = tmp_path / "scripts" / "more.yaml"
    text = "log_elements: []\ntriggers:\n  - {name: low, when: x < 0, pre_s: 60}\n"
    script.write_text(text)
    with pytest.raises(silo.errors.ScriptError, match="set size="):
        bench.logger.load_script(script)
    with pytest.raises(silo.RefusedError, match="set size="):
        client.load_script("more.yaml")
    assert bench.logger._conditions.now.triggers == ()


def test_a_script_may_bring_the_buffers_that_its_trigger_needs(bench, client, tmp_path):
    bench.logger.set(buffer="looping", size="70s")
    bench.logger.save_script(tmp_path / "scripts" / "more.yaml")
    script = tmp_path / "scripts" / "more.yaml"
    script.write_text(script.read_text() + "triggers:\n  - {name: low, when: x < 0, pre_s: 60}\n")
    bench.logger.set(buffer="looping", size="10s")
    client.load_script("more.yaml")
    assert bench.logger._conditions.now.triggers[0].name == "low"


# ------------------------------------------------------------------------------------------- what can't be told


def test_signals_whose_buffer_is_full_are_blind_not_quiet(bench, client, events):
    bench.logger.set("kept", buffer="fixed", size=50)
    bench.logger.trigger("high", "kept > 50")
    bench.logger.limit("kept", (None, None, 10.0, 20.0))
    bench.start(200)
    wait_until(lambda: client.triggers().tick == 200)
    (trigger,), (limit,) = client.triggers().triggers, client.alarms().limits
    assert (trigger.state, limit.word) == (TriggerWord.BLIND, LimitWord.BLIND)
    for why in (trigger.why, limit.why):
        assert why == "'/log/kept' keeps its first samples only (buffer=fixed), and its buffer is full"
    wait_until(lambda: len({event.text for event in events if event.kind is EventKind.BLIND}) == 2)
    told = [event.text for event in events if event.kind is EventKind.BLIND]
    assert len(told) == len(set(told))


def test_a_limit_event_stands_at_the_tick_of_the_worst_sample(bench, client, events):
    bench.logger.limit("x", (None, None, 100.0, 200.0))
    bench.logger.start()
    for tick in range(90):
        bench.x[...] = 150.0 if tick == 40 else 0.0
        bench.logger.collect()
        bench.now_ns += bench.tick_ns
    event = wait_until(lambda: next((one for one in events if one.kind is EventKind.LIMIT), None))
    assert event.tick == 40
    assert event.stamp_ns == bench.begin_ns + 40 * bench.tick_ns


def test_a_capture_tells_of_the_episode_that_it_lies_in_and_of_no_other(bench, client, events):
    bench.logger.trigger("high", "x > 500", pre="50ms", post="30ms", save=["silo", "csv", "bag"])
    bench.logger.start()
    with bench.logger.episode("walk"):
        bench.ticks(100)
    with bench.logger.episode("pick", object="cup"):
        bench.ticks(500)
        (paths,) = captured(events)
    for path in paths:
        (one,) = silo.open_log(path).episodes
        assert (one.name, one.about, one.first, one.start_s, one.whole) == ("pick", {"object": "cup"}, 100, 0.0, False)
