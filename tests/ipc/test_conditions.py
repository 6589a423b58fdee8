"""Triggers and limits that clients set, arm, try and acknowledge while the robot runs."""

import os
from pathlib import Path

import pytest

import silo
from silo.cli.main import run
from silo.client.client import Client
from silo.conditions.standing import LimitWord
from silo.core.conditions import SignalLimits, TriggerOptions, TriggerWord
from silo.core.elements import FileType
from silo.errors import ElementError
from silo.fleet.exchange import client_name
from silo.rpc.published import EventKind
from silo.settings.script import read_script
from tests.waiting import answered, wait_until


def trigger(client, name="high", state=None):
    """A trigger's status; with a state as soon as it has it."""

    def find():
        now = answered(client.triggers)
        found = next((one for one in now.triggers if one.options.name == name), None) if now else None
        return found if found and state in (None, found.state) else None

    return wait_until(find)


def alarm(client, name="/log/x", **wanted):
    """How a signal stands, as soon as it stands so."""

    def find():
        now = answered(client.alarms)
        found = next((one for one in now.limits if one.name == name), None) if now else None
        return found if found and all(getattr(found, key) == value for key, value in wanted.items()) else None

    return wait_until(find)


def spiked(bench):
    """Begin a run with limits of `x`, of which one sample, that of tick 50, is beyond them."""
    bench.logger.limit("x", (None, None, 200, 300))
    bench.start(50)
    bench.x[...] = 998
    bench.ticks(1)
    bench.x[...] = 10


def judged(client, bench):
    """Wait until all that was logged is judged."""
    wait_until(lambda: client.triggers().tick >= bench.logger.ticks)


class TestTriggers:
    def test_one_that_is_set_while_it_runs_is_judged_from_now_on(self, bench, client, heard):
        bench.start(100)
        assert client._set_trigger(TriggerOptions("high", "x % 50 == 0", pre_s=0.05)) == "trigger 'high' is set"
        trigger(client, state=TriggerWord.ARMED)
        bench.ticks(60)
        fired = heard.wait(EventKind.TRIGGERED)
        assert fired.about == "high"
        assert fired.text == "trigger 'high' fired at tick 149"
        assert trigger(client).fires == 1

    def test_one_that_the_program_sets_while_it_runs_is_judged_too(self, bench, client, heard):
        bench.start(10)
        bench.logger.trigger("late", "x > 50")
        trigger(client, "late", TriggerWord.ARMED)
        bench.ticks(60)
        assert heard.wait(EventKind.TRIGGERED).text == "trigger 'late' fired at tick 50"

    def test_what_the_program_changes_stands_in_the_event_log(self, bench, client, heard):
        bench.logger.start()
        bench.logger.trigger("late", "x > 50", post="1s")
        assert heard.wait(EventKind.CONDITIONS).text == "trigger late: x > 50, post 1 s"
        bench.logger.limit("x", (None, None, 1, 2))
        wait_until(lambda: [one.text for one in client.events() if "limits x: - - 1 2" in one.text])
        bench.logger._conditions._remove_trigger("late")
        wait_until(lambda: [one.text for one in client.events() if one.text == "trigger late removed"])

    def test_what_a_client_set_is_in_saved_scripts_and_in_the_next_run(self, bench, client, tmp_path):
        client._set_trigger(TriggerOptions("high", "x > 5"))
        assert trigger(client).state is TriggerWord.WAITING
        wait_until(lambda: "x > 5" in client.read_script().text)
        client.save_script("new.yaml")
        assert read_script(tmp_path / "scripts" / "new.yaml").conditions.triggers[0].when == "x > 5"
        bench.start(2)
        trigger(client, state=TriggerWord.ARMED)

    def test_it_survives_a_helper_process_that_dies(self, robots, runtime):
        robot = robots("bot")
        with Client.connect("bot") as client:
            client._set_trigger(TriggerOptions("far", "x > 1e9"))
            trigger(client, "far", TriggerWord.ARMED)

            os.kill(robot.helper_pid, 9)
            wait_until(lambda: not client.connected)
            wait_until(lambda: client.connected)
            robot.helper_pid = client.status().helper_pid
            assert trigger(client, "far", TriggerWord.ARMED).options.when == "x > 1e9"

    def test_off_it_does_not_fire_and_armed_again_it_does(self, bench, client, heard):
        bench.logger.trigger("high", "x % 50 == 0")
        bench.start(10)
        trigger(client, state=TriggerWord.ARMED)
        client.arm_trigger("high", armed=False)
        assert trigger(client).state is TriggerWord.OFF
        bench.ticks(100)
        judged(client, bench)
        assert client.arm_trigger("high") == "trigger 'high' is armed"
        trigger(client, state=TriggerWord.ARMED)
        bench.ticks(100)
        assert heard.wait(EventKind.TRIGGERED).text == "trigger 'high' fired at tick 149"

    def test_that_it_is_off_stands_in_scripts(self, bench, client):
        bench.logger.trigger("high", "x > 5")
        wait_until(lambda: "high" in client.read_script().text)  # the helper process knows it by now
        client.arm_trigger("high", armed=False)
        assert bench.logger._conditions.now.triggers[0].armed is False
        wait_until(lambda: "armed: false" in client.read_script().text)

    def test_one_that_is_forced_captures_what_is_newest(self, bench, client, heard):
        bench.logger.trigger("never", "x < 0", pre="50ms")
        bench.start(100)
        judged(client, bench)
        told = client.force_trigger("never")
        assert told == "trigger 'never' was fired by hand at tick 99"
        event = wait_until(lambda: next((one for one in client.events() if one.text == told), None))
        assert (event.kind, event.who) == (EventKind.CONDITIONS.value, client_name())
        bench.ticks(5)
        (file,) = heard.wait(EventKind.CAPTURED).files
        assert silo.open_log(file.path)["x"].values.tolist() == [95, 96, 97, 98, 99, 100]
        assert wait_until(lambda: trigger(client, "never").files) == (file.path,)

    def test_one_that_is_replaced_goes_on_counting(self, bench, client, heard):
        bench.logger.trigger("high", "x > 20")
        bench.start(50)
        heard.wait(EventKind.CAPTURED)
        client._set_trigger(TriggerOptions("high", "x > 100"))
        wait_until(lambda: trigger(client).options.when == "x > 100")
        bench.ticks(100)
        captured = wait_until(
            lambda: len(found := [one for one in heard.events if one.kind is EventKind.CAPTURED]) > 1 and found
        )
        assert [one.files[0].path[-7:] for one in captured] == ["_1.silo", "_2.silo"]

    def test_one_that_is_removed_is_gone(self, bench, client):
        bench.logger.trigger("high", "x > 20")
        assert client._remove_trigger("high") == "trigger 'high' is removed"
        wait_until(lambda: not client.triggers().triggers)
        with pytest.raises(silo.RefusedError, match="no trigger is called 'high', there is none"):
            client._remove_trigger("high")

    def test_one_of_an_element_that_is_off_is_blind_and_says_why_as_are_limits(self, bench, client):
        bench.logger.trigger("kept", "kept > 3")
        bench.logger.limit("kept", (None, None, None, 5))
        bench.logger.set("kept", enabled=False)
        bench.start(5)
        assert trigger(client, "kept", TriggerWord.BLIND).why == "/log/kept is off"
        assert alarm(client, "/log/kept").why == "/log/kept is off"

    def test_a_rearm_condition_that_is_off_is_told_when_it_is_set(self, bench, client, caplog):
        bench.logger.set("kept", enabled=False)
        bench.logger.start()
        told = client._set_trigger(TriggerOptions("once", "x > 3", rearm="kept < 1"))
        assert told == (
            "trigger 'once' is set; it fires once and never again: its rearm condition needs /log/kept, which is off"
        )
        bench.logger.trigger("too", "x > 3", rearm="kept < 1")
        assert "trigger 'too' fires once and never again" in caplog.text

    def test_mistakes_are_refused_and_nothing_is_changed(self, bench, client):
        for options, says in (
            (TriggerOptions("a/b", "x > 3"), "contains '/'"), (TriggerOptions("a", "nobody > 3"), "nobody"),
            (TriggerOptions("a", "x > 3", pre_s=60), "set size="), (TriggerOptions("a", "x > 3", slope="up"), "rising"),
            (TriggerOptions("a", "x > 3", keep=-1), "keep"),
        ):  # fmt: skip
            with pytest.raises(silo.RefusedError, match=says):
                client._set_trigger(options)
            assert bench.logger._conditions.now.triggers == ()

    def test_tried_it_tells_when_it_would_have_fired_or_shows_the_place_of_a_mistake(self, bench, client):
        bench.start(160)
        tried = client.try_trigger(TriggerOptions("any", "x % 50 == 0", post_s=0.1))
        assert (tried.fires, tried.ticks, tried.first, tried.last) == (3, [49, 99, 149], 0, 159)
        assert tried.time_ns[0] == bench.begin_ns + 49 * bench.tick_ns
        with pytest.raises(silo.RefusedError, match=r"\^"):
            client.try_trigger(TriggerOptions("any", "nobody > 3"))
        assert bench.logger._conditions.now.triggers == ()

    def test_tried_on_a_buffer_that_lapped_it_tells_what_is_held(self, bench, client):
        bench.start(3560)
        tried = client.try_trigger(TriggerOptions("any", "x % 500 == 0"))
        assert tried.first > 500
        assert tried.ticks == [tick for tick in range(499, 3560, 500) if tick > tried.first]


class TestLimits:
    def test_one_sample_beyond_is_counted_with_its_peak(self, bench, client, heard):
        spiked(bench)
        bench.ticks(50)
        found = alarm(client, count=1, word=LimitWord.OK)
        assert (found.worst, found.worst_word, found.worst_tick, found.alarm) == (999, LimitWord.RED_HIGH, 50, True)
        assert "/log/x HH 999 m at tick 50, limit 300 m" in heard.wait(EventKind.LIMIT).text

    def test_what_is_acknowledged_is_no_alarm_any_more_and_says_by_whom(self, bench, client):
        bench.logger.limit("x", (None, None, 20, 30))
        bench.start(25)
        assert alarm(client, word=LimitWord.YELLOW_HIGH).alarm
        assert client.acknowledge(["/log/x"], who="anna") == "1 alarm seen by anna"
        assert client.acknowledge(["/log/x"], who="anna") == "no alarm waits to be seen"
        found = alarm(client)
        assert (found.alarm, found.seen_by, found.count) == (False, "anna", 1)
        bench.ticks(10)
        assert alarm(client, word=LimitWord.RED_HIGH).alarm

    def test_the_limits_that_an_element_is_added_with_are_judged(self, bench, client):
        more = bench.logger.array("more", 3, limits=(-2, -1, 1, 2), unit="V")
        bench.logger.start()
        more[1] = -1.5
        bench.ticks(1)
        found = alarm(client, "/log/more_y", word=LimitWord.YELLOW_LOW)
        assert (found.value, found.limit, found.limits) == (-1.5, -1, "/log/more")
        assert alarm(client, "/log/more_x").word is LimitWord.OK

    def test_a_client_gives_and_takes_limits_while_it_runs(self, bench, client):
        bench.start(50)
        client._set_limits(SignalLimits("x", bounds=(None, None, 40, 100)))
        wait_until(lambda: client.alarms().limits)
        bench.ticks(1)
        assert alarm(client, count=1).since_tick >= 50
        client._remove_limits("x")
        wait_until(lambda: not client.alarms().limits)

    def test_they_are_known_after_a_robot_that_was_killed(self, robots, runtime):
        robot = robots("bot")
        with Client.connect("bot") as client:
            client._set_limits(SignalLimits("x", bounds=(None, None, 1, 2)))
            alarm(client, word=LimitWord.RED_HIGH)
            robot.kill()
            wait_until(lambda: client.status().state is silo.core.elements.State.DEAD)
            assert alarm(client).count == 1


class TestCommands:
    def test_a_trigger_is_set_tried_listed_and_removed(self, bench, client, capsys):
        bench.logger.set("kept", enabled=False)
        bench.start(60)
        wait_until(lambda: client.status().ticks == 60)
        assert run(["trigger", "bot", "test", "x % 20 == 0"]) == 0
        assert "would have fired 3 times in the 0.59 s that are held; true for 5 %" in capsys.readouterr().out
        assert run(["trigger", "bot", "add", "high", "x > 100", "--pre", "50ms", "--mode", "single"]) == 0
        bench.logger.trigger("dark", "kept > 0")
        trigger(client, state=TriggerWord.ARMED)
        trigger(client, "dark", TriggerWord.BLIND)
        assert capsys.readouterr().out == "trigger 'high' is set; of its captures the newest 100 stay\n"
        assert run(["trigger", "ls"]) == 0
        assert capsys.readouterr().out == (
            "STATE  NAME  WHEN         PRE  POST  COUNT   LAST\n"
            "ARMED  high  x > 100   0.05 s   1 s      0  never\n"
            "BLIND  dark  kept > 0     0 s   0 s      0  never\n"
            "dark: /log/kept is off\n"
        )
        assert run(["trigger", "force", "high"]) == 0
        assert run(["trigger", "disarm", "bot", "high"]) == 0
        assert run(["trigger", "arm", "high"]) == 0
        assert run(["trigger", "rm", "high"]) == 0
        assert [one.name for one in bench.logger._conditions.now.triggers] == ["dark"]

    def test_alarms_end_with_1_if_anything_was_violated(self, bench, client, capsys):
        bench.logger.limit("x", (None, None, 40, 100))
        bench.start(20)
        alarm(client, word=LimitWord.OK)
        assert run(["alarms"]) == 0
        bench.ticks(30)
        alarm(client, word=LimitWord.YELLOW_HIGH)
        assert run(["alarms", "bot"]) == 4
        assert "H" in capsys.readouterr().out
        assert run(["alarms", "--json"]) == 4
        assert '"word":"H"' in capsys.readouterr().out


@pytest.mark.parametrize("ends", ["stop", "go on", "cut"])
def test_what_fires_at_the_last_tick_stands_in_the_file_that_is_saved_at_once(bench, client, tmp_path, ends):
    bench.logger.limit("x", (None, None, 20, 30))
    bench.logger.trigger("hit", "x > 40", pre=0, post=0)
    for begin in range(3):
        bench.x[...] = 0
        bench.logger.start(unsaved="clear")
        bench.ticks(10)
        wait_until(lambda: client.alarms().tick == 10)
        bench.x[...] = 50
        bench.ticks(1)
        if ends == "stop":
            bench.logger.stop()
        elif ends == "cut":
            bench.logger.set("q", cut=True, divider=2 + begin)
            bench.ticks(1)
        kinds = [event.kind for event in silo.open_log(bench.logger.save()[-1].path).events]  # of both stretches
        assert (kinds.count("limit"), kinds.count("triggered")) == (1, 1)
        bench.logger.stop()


class TestCuts:
    """An edit of the table while it runs ends a stretch, and nothing of what somebody has yet to see."""

    @staticmethod
    def cut(bench, client):
        """Cut the run, and wait until the next stretch is judged."""
        before = client.alarms().run
        bench.ticks(1)
        bench.logger.set("q", cut=True, divider=1 + bench.logger["/log/q"].options.divider)
        bench.ticks(3)
        wait_until(lambda: client.alarms().run != before and client.alarms().tick == 3)

    def test_an_alarm_that_nobody_saw_stays_with_its_count_and_its_worst(self, bench, client):
        spiked(bench)
        bench.ticks(20)
        before = alarm(client, count=1, word=LimitWord.OK)
        self.cut(bench, client)
        after = alarm(client)
        assert (after.alarm, after.count, after.worst, after.worst_word) == (True, 1, 999, LimitWord.RED_HIGH)
        assert (after.worst_ns, after.worst_tick, after.since_ns) == (before.worst_ns, -1, before.since_ns)
        assert client.acknowledge(who="anna") == "1 alarm seen by anna"
        self.cut(bench, client)
        after = alarm(client)
        assert (after.alarm, after.count, after.seen_by) == (False, 1, "anna")

    def test_a_violation_that_lasts_is_one_and_is_told_once(self, bench, client, heard):
        bench.logger.limit("x", (None, None, 20, 1000))
        bench.start(30)
        alarm(client, word=LimitWord.YELLOW_HIGH)
        self.cut(bench, client)
        found = alarm(client, samples=14)
        assert (found.count, found.word, found.worst, found.worst_tick) == (1, LimitWord.YELLOW_HIGH, 34, 2)
        assert heard.wait(EventKind.LIMIT).text.startswith("/log/x H ")
        bench.x[...] = 0
        bench.ticks(2)
        assert (alarm(client, word=LimitWord.OK).count, alarm(client).samples) == (1, 14)
        assert len([one for one in heard.events if one.kind is EventKind.LIMIT]) == 1

    def test_a_trigger_counts_on_and_does_not_fire_again_of_what_was_true(self, bench, client, heard):
        bench.logger.trigger("once", "x > 20", mode="single")
        bench.logger.trigger("each", "x > 20", holdoff="0.5s")
        bench.logger.trigger("still", "x % 10 == 0", holdoff="0.5s")
        bench.start(25)
        heard.wait(EventKind.TRIGGERED)
        self.cut(bench, client)
        found = {one.options.name: one for one in client.triggers().triggers}
        assert {name: one.fires for name, one in found.items()} == {"once": 1, "each": 1, "still": 1}
        assert (found["once"].state, found["each"].last_tick) == (TriggerWord.FIRED, -1)
        assert found["each"].last_ns == bench.begin_ns + 20 * bench.tick_ns
        assert 0.29 < found["still"].holdoff_s < 0.33  # of 0.5 s after tick 9, at tick 3 after 26 of the first stretch
        bench.x[...] = -21
        bench.ticks(45)
        wait_until(lambda: client.triggers().tick == 48)  # of this stretch
        found = {one.options.name: one for one in client.triggers().triggers}
        assert {name: one.fires for name, one in found.items()} == {"once": 1, "each": 2, "still": 2}
        assert found["each"].captures == 2

    def test_a_trigger_that_a_client_holds_goes_on_too(self, bench, client):
        one = TriggerOptions("scope", "x > 20", mode="single", save=())
        client._set_trigger(one, lease_s=60)
        bench.start(25)
        trigger(client, "scope", TriggerWord.FIRED)
        self.cut(bench, client)
        found = trigger(client, "scope")
        assert (found.state, found.fires) == (TriggerWord.FIRED, 1)

    def test_a_jump_at_the_cut_is_seen_and_a_window_goes_on(self, bench, client):
        bench.logger.derive("step", "diff(q_x)")
        bench.logger.limit("step", (None, -50, 50, None))
        bench.logger.trigger("jump", "step > 50", save=())
        bench.logger.trigger("mean", "mean(q_x, 200ms) > 20", save=())
        bench.q[0] = 0.0
        bench.start(29)
        self.cut(bench, client)
        bench.q[0] = 100.0
        for _ in range(3):
            self.cut(bench, client)
            bench.ticks(6)
        wait_until(lambda: client.triggers().tick == 9)
        assert [trigger(client, name).fires for name in ("jump", "mean")] == [1, 1]
        assert alarm(client, "/log/step").count == 1

    def test_one_that_the_cut_changes_counts_on(self, bench, client, tmp_path):
        bench.logger.trigger("high", "x > 20", pre=0, post=0)
        bench.start(25)
        wait_until(lambda: trigger(client).fires == 1)
        script = tmp_path / "scripts" / "other.yaml"
        bench.logger.save_script(script)
        text = script.read_text().replace("x > 20", "x > 30")
        script.write_text(text.replace("divider: 5", "divider: 4"))
        bench.logger.load_script(script, cut=True)
        bench.ticks(10)
        wait_until(lambda: client.triggers().tick == 10)
        assert (trigger(client).options.when, trigger(client).fires, trigger(client).captures) == ("x > 30", 2, 2)

    def test_an_alarm_of_what_is_off_for_a_while_is_there_again_with_it(self, bench, client):
        bench.logger.limit("q_x", (None, None, 20, 30))
        bench.logger.start()
        bench.q[0] = 25.0
        bench.ticks(5)
        bench.q[0] = 0.0
        bench.ticks(5)
        alarm(client, "/log/q_x", count=1)
        for enabled in (False, True):
            before = client.alarms().run
            bench.logger.set("q", cut=True, enabled=enabled)
            bench.ticks(3)
            wait_until(lambda run=before: client.alarms().run != run and client.alarms().tick == 3)
        found = alarm(client, "/log/q_x")
        assert (found.word, found.count, found.alarm, found.worst) == (LimitWord.OK, 1, True, 25.0)

    @pytest.mark.parametrize("cut", [False, True])
    def test_who_edits_limits_takes_nobodys_alarm_away(self, bench, client, heard, cut):
        spiked(bench)
        bench.ticks(20)
        before = alarm(client, count=1, word=LimitWord.OK)
        bench.logger.limit("x", (None, None, 900, None))
        if cut:
            self.cut(bench, client)
        after = alarm(client, bounds=(None, None, 900.0, None))
        assert (after.alarm, after.count, after.worst, after.worst_ns) == (True, 1, 999, before.worst_ns)
        bench.x[...] = 950
        bench.ticks(1)
        bench.x[...] = 10
        bench.ticks(1)
        assert alarm(client, count=2).worst == 999
        assert client.acknowledge(who="anna") == "2 alarms seen by anna"
        heard.wait(EventKind.LIMIT)

    def test_what_is_off_for_a_while_is_not_stale_then_and_nothing_lasted_meanwhile(self, bench, client):
        bench.logger.limit("q_x", (None, None, 20, 30), stale="100ms")
        bench.logger.trigger("lasts", "q_x > 5", persist="200ms", save=())
        bench.logger.start()
        for tick in range(12):
            bench.q[0] = tick
            bench.ticks(1)
        for enabled, count in ((False, 50), (True, 3)):
            before = client.alarms().run
            bench.logger.set("q", cut=True, enabled=enabled)
            for tick in range(count):
                bench.q[0] = 7 + tick
                bench.ticks(1)
            wait_until(lambda run=before, n=count: client.alarms().run != run and client.alarms().tick == n)
        assert trigger(client, "lasts").fires == 0
        found = alarm(client, "/log/q_x")
        assert (found.word, found.alarm, found.stale_count) == (LimitWord.OK, False, 0)
        bench.ticks(30)
        wait_until(lambda: trigger(client, "lasts").fires == 1)

    def test_a_violation_from_before_the_cut_is_told_without_a_tick(self, bench, client, heard):
        bench.logger.limit("x", (None, None, 20, 1000))
        bench.start(19)
        wait_until(lambda: client.alarms().tick == 19)
        bench.ticks(3)
        self.cut(bench, client)
        bench.x[...] = 0
        bench.ticks(2)
        alarm(client, word=LimitWord.OK)
        assert not [event.text for event in heard.events if "tick -1" in event.text]


def test_what_may_be_set_is_saved_and_loaded_again_though_buffers_became_too_small_for_a_trigger(bench, client):
    client.trigger("deep", "x > 1e9", pre="2s")
    told = client.apply([silo.Edit("/log/q", size=50)], -1).warnings
    assert [text.split(": ")[0] for text in told] == ["trigger 'deep' will capture less than it should"]
    assert not client.apply([silo.Edit("/log/x", divider=2)], -1).warnings, "that was told already"
    client.apply([silo.Edit("/log/x", divider=1)], -1)
    client.arm_trigger("deep", armed=False)
    assert not client.apply([silo.Edit("/log/q", size=49)], -1).warnings, "it fires never"
    client.arm_trigger("deep", armed=True)
    client.apply([silo.Edit("/log/q", size=50)], -1)
    client.save_script("kept.yaml")
    assert not client.apply([silo.Edit("/log/q", size=400)], -1).warnings
    assert client.load_script("kept.yaml").warnings == told
    for armed in (False, True):
        client.arm_trigger("deep", armed=armed)
    with pytest.raises(silo.RefusedError, match="too short for pre of 3 s"):
        client.trigger("deep", "x > 1e9", pre="3s")
    bench.logger.load_script(bench.script.parent / "kept.yaml")


def test_a_program_starts_though_its_script_holds_a_trigger_for_which_buffers_became_too_small(new_logger, caplog):
    log = new_logger(frequency=100, max_time=10)
    log.array("x", buffer="looping", size=50)
    Path(log.options.script).write_text("log_elements: []\ntriggers:\n  - {name: deep, when: x < 0, pre_s: 1}\n")
    log.start()
    assert [one.name for one in log._conditions.now.triggers] == ["deep"]
    assert "trigger 'deep' will capture less than it should: too short for pre of 1 s" in caplog.text


def test_a_client_says_limits_triggers_and_signals_as_a_program_does(client, caplog):
    given = client.limit("x", (None, None, 40, 100), stale="0.5s")
    assert client._set_limits(SignalLimits("x", bounds=(None, None, 40, 100), stale_s=0.5)) == given
    told = client.trigger("far", "x > 1e9", pre="50ms", save="csv")
    assert told.startswith("trigger 'far' is set; it is judged when")
    assert "; of its captures the newest 100 stay" in told
    (one,) = client.triggers().triggers
    assert (one.options.pre_s, one.options.save) == (0.05, (FileType.CSV,))
    assert "stay" not in client.trigger("far", "x > 1e9", keep=0)
    client.derive("twice", "x * 2")
    for name, forget in {"x": client.limit, "far": client.trigger, "twice": client.derive}.items():
        forget(name, None)
    assert not client.triggers().triggers
    with pytest.raises(ElementError, match="red_high"):
        client.limit("x", (1, 2))
    with pytest.raises(AttributeError, match=r"it is client.limit\('x', \(red_low"):
        client.set_limits  # noqa: B018
