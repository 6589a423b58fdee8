"""Triggers that clients hold under a lease: judged as others are, gone with their clients."""

import pytest

from silo.client.client import Client
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.errors import RefusedError
from tests.ipc.test_conditions import judged, trigger
from tests.waiting import wait_until

LOOKING = TriggerOptions("scope", "x % 50 == 0", pre_s=0.05, post_s=0.05, save=())


def test_it_fires_and_tells_which_ticks_it_captured_and_writes_nothing(bench, client):
    bench.start(10)
    assert client._set_trigger(LOOKING, lease_s=60) == "trigger 'scope' is held for 60 s"
    trigger(client, "scope", TriggerWord.ARMED)
    bench.ticks(88)
    bench.now_ns += 10**9  # the loop is late
    bench.ticks(4)
    judged(client, bench)
    found = trigger(client, "scope")  # while a capture is under way the one before stands still
    assert (found.state, found.captures, found.whole.number, found.whole.tick) == (TriggerWord.FIRING, 2, 1, 49)
    assert found.capturing_s == pytest.approx(1 + (102 - 94) / bench.logger.options.frequency_hz)  # by stamps
    bench.ticks(8)
    judged(client, bench)
    found = trigger(client, "scope")
    assert (found.fires, found.files) == (2, ())
    assert found.owner
    whole = found.whole
    # of the second one no tick is missing either: it ends at 104
    assert (whole.number, whole.tick, whole.first, whole.last, whole.forced) == (2, 99, 94, 104, False)


def test_it_is_in_no_script_and_not_in_the_logger_and_refused_where_it_can_not_be(bench, client):
    bench.logger.trigger("high", "x > 5")
    trigger(client, "high")
    for options, words in (
        (TriggerOptions("scope", "x < 0", mode="auto"), "auto captures without end"),  # of files
        (TriggerOptions("high", "x > 6", save=()), "'high' is one of the logger"),
        (TriggerOptions("scope", "x > 6", pre_s=60, save=()), "set size="),  # that would do
    ):
        with pytest.raises(RefusedError, match=words):
            client._set_trigger(options, lease_s=60)
    assert [one.options.name for one in client.triggers().triggers] == ["high"]
    client._set_trigger(LOOKING, lease_s=60)
    assert trigger(client, "scope").state is TriggerWord.WAITING
    client.save_script("new.yaml")
    assert "scope" not in client.read_script("new.yaml").text
    assert [one.name for one in bench.logger._conditions.now.triggers] == ["high"]


def test_it_goes_with_a_client_that_goes_away(bench, client):
    bench.start(10)
    with Client.connect("bot") as other:
        assert other._set_trigger(LOOKING, lease_s=0.5) == "trigger 'scope' is held for 0.5 s"
    wait_until(lambda: not client.triggers().triggers)


def test_the_same_again_renews_it_and_it_goes_on_counting(bench, client):
    bench.start(10)
    client._set_trigger(LOOKING, lease_s=60)
    trigger(client, "scope", TriggerWord.ARMED)
    bench.ticks(60)
    judged(client, bench)
    assert client._set_trigger(LOOKING, lease_s=60) == "trigger 'scope' is kept for 60 s"
    assert trigger(client, "scope").fires == 1


def test_it_survives_a_new_start(bench, client):
    bench.start(10)
    client._set_trigger(LOOKING, lease_s=60)
    trigger(client, "scope", TriggerWord.ARMED)
    bench.logger.restart(unsaved="clear")
    bench.ticks(10)
    trigger(client, "scope", TriggerWord.ARMED)


def test_in_mode_auto_it_fires_by_itself_when_its_condition_does_not(bench, client):
    bench.start(10)
    client._set_trigger(TriggerOptions("scope", "x < 0", post_s=0.1, mode="auto", save=(), patience_s=0.2), lease_s=60)
    trigger(client, "scope", TriggerWord.ARMED)
    bench.ticks(100)
    judged(client, bench)
    found = trigger(client, "scope")
    assert found.fires == 3  # every 10 ticks of post and 20 of patience, from the first tick after it was set
    assert found.whole.forced


def test_it_is_armed_forced_and_let_go_of_by_name(bench, client):
    bench.start(10)
    client._set_trigger(TriggerOptions("scope", "x > 20", mode="single", save=()), lease_s=60)
    trigger(client, "scope", TriggerWord.ARMED)
    bench.ticks(20)
    trigger(client, "scope", TriggerWord.FIRED)
    client.arm_trigger("scope")
    assert trigger(client, "scope").state is TriggerWord.ARMED
    assert client.force_trigger("scope") == "trigger 'scope' was fired by hand at tick 29"
    assert client._remove_trigger("scope") == "trigger 'scope' is let go of"
    assert client.triggers().triggers == []
