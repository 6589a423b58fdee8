"""Derived signals of a live logger: in the table, in views, histories, samples, streams, pins and statistics."""

import os
import signal

import numpy as np
import pytest

import silo
from silo.cli.main import run as silo_command
from silo.client.client import Client
from silo.core.elements import Edit, State
from silo.errors import RefusedError
from silo.history.requests import OpenPin
from silo.live.quantities import QUANTITIES
from silo.rpc.published import EventKind
from tests.ipc.conftest import TICK_NS, Heard
from tests.waiting import answered, wait_until


def table_of(client):
    return {info.name: info for info in client.table().derived}


def derive(bench, client, name, expression, unit=""):
    """Derive a signal in the program, and wait until clients know of it."""
    bench.logger.derive(name, expression, unit=unit)
    wait_until(lambda: table_of(client).get(f"/log/{name}"))


def run(bench, client, ticks):
    """Start the logger and log so many ticks, until clients see them."""
    bench.start(ticks)
    wait_until(lambda: client.status().ticks == ticks)


def newest(client, names):
    """The newest values that a view shows of elements."""
    with client.view(names, rate_hz=20.0) as view:
        return wait_until(lambda: (frame := view.frame()) and np.isfinite(frame.newest).any() and frame).newest.tolist()


def read(stream, count, name="/log/twice"):
    """So many values of a stream."""
    found: list[float] = []
    while len(found) < count:
        batch = stream.read()
        found += batch[name].values.tolist() if name in batch else []
    return found


class TestTable:
    def test_a_derived_signal_is_a_row_beside_the_elements_whose_options_are_not_to_be_edited(self, bench, client):
        bench.logger.derive("twice", "2 * q", group="more", unit="rad")
        found = wait_until(lambda: table_of(client).get("/log/more/twice"))
        assert (found.unit, found.shape, found.expression) == ("rad", (3,), "2 * q")
        assert [entry.suffix for entry in found.entries] == ["_0", "_1", "_2"]
        assert "/log/more/twice" not in {info.name for info in client.table().elements}
        with pytest.raises(RefusedError, match="is derived"):
            client.apply([Edit("/log/more/twice", found.options)], -1)

    def test_a_client_derives_a_signal_while_it_runs_and_the_event_log_has_it(self, bench, client, heard):
        run(bench, client, 10)
        assert client.derive("twice", "2 * x", "V") == "'/log/twice' is derived: 2 * x"
        assert heard.wait(EventKind.EDITED).text == "/log/twice = 2 * x"
        assert newest(client, ["/log/twice"]) == [20.0]
        assert client.derive("twice", "3 * x") == "'/log/twice' is derived anew: 3 * x"
        assert newest(client, ["/log/twice"]) == [30.0]
        assert client._remove_derived("twice") == "'twice' is derived no more"
        assert client.table().derived == []

    def test_what_makes_no_sense_is_refused_with_words(self, bench, client):
        client.derive("a", "x + 1")
        client.derive("b", "a + 1")
        client.derive("of/d", "x")
        client.derive("größe", "x")
        client._remove_derived("größe")
        for name, expression, words in (
            ("a", "b + 1", "would be computed from itself: /log/a = b .* 1, /log/b = a .* 1"),
            ("c", "c + x", "would be computed from itself"),
            ("c", "nope + 1", "no signal is named 'nope'"),
            ("c", "of + 1", "no signal is named 'of'"),
            ("x", "q", "is an element already"),
            ("/", "x", "a derived signal needs a name; nothing was changed$"),
            ("a\n", "x", r"signal name 'a\\n': write a name of letters, digits, blanks and / _ - \. \+; nothing was"),
            ("hypot(base/euler", "x", r"signal name 'hypot\(base/euler': write a name of letters, digits, blanks"),
        ):
            with pytest.raises(RefusedError, match=words):
                client.derive(name, expression)
        with pytest.raises(RefusedError, match="used by '/log/b': remove that first"):
            client._remove_derived("a")
        for name in ("z", "of"):
            with pytest.raises(RefusedError, match=f"no derived signal is called '{name}', there are /log/a, /log/b"):
                client._remove_derived(name)
        assert [one.name for one in bench.logger._conditions.now.derived] == ["/log/a", "/log/b", "/log/of/d"]

    def test_what_limits_and_triggers_use_stays(self, bench, client):
        bench.logger.derive("twice", "2 * x")
        bench.logger.limit("twice", (None, None, 1, 2))
        with pytest.raises(RefusedError, match="used by the limits of 'twice'"):
            client._remove_derived("twice")
        bench.logger._conditions._remove_limits("twice")
        bench.logger.trigger("much", "twice > 3")
        with pytest.raises(RefusedError, match="used by trigger 'much'"):
            client._remove_derived("/log/twice")

    def test_a_new_expression_may_use_what_was_derived_later(self, bench):
        bench.logger.derive("a", "x + 1")
        bench.logger.derive("b", "2 * x")
        bench.logger.derive("a", "b + 1")
        assert [one.name for one in bench.logger._conditions.now.derived] == ["/log/b", "/log/a"]

    def test_one_of_an_element_that_is_off_says_why(self, bench, client):
        bench.logger.derive("twice", "2 * kept")
        bench.logger.set("kept", enabled=False)
        run(bench, client, 5)
        found = wait_until(lambda: (info := table_of(client).get("/log/twice")) and not info.options.enabled and info)
        assert found.description == "= 2 * kept (off: /log/kept is off)"
        assert client.samples(["/log/twice"])["/log/twice"].why == "/log/kept is off"


class TestRows:
    def test_samples_history_and_newest_values_are_computed(self, bench, client):
        derive(bench, client, "twice", "2 * x")
        derive(bench, client, "change", "diff(twice)", unit="V")
        run(bench, client, 50)
        found = client.samples(["/log/twice", "/log/x", "/log/change"])
        assert found["/log/twice"].values.tolist() == (2 * found["/log/x"].values).tolist()
        assert found["/log/twice"].time_ns.tolist() == found["/log/x"].time_ns.tolist()
        assert found["/log/change"].values.tolist()[1:] == [2.0] * 49
        begin = int(found["/log/x"].time_ns[0])
        past = client.history(["/log/twice"], begin, begin + 50 * TICK_NS, 10 * TICK_NS)
        assert past.high[0, :5].tolist() == [20.0, 40.0, 60.0, 80.0, 100.0]
        assert newest(client, ["/log/twice", "/log/change"]) == [100.0, 2.0]

    def test_a_part_is_what_it_is_in_the_whole_and_signals_of_different_rates_hold(self, bench, client):
        derive(bench, client, "smooth", "mean(diff(x), 100ms) + prev(slow)")
        derive(bench, client, "both", "x - slow")
        run(bench, client, 300)
        whole = client.samples(["/log/smooth"])["/log/smooth"]
        part = client.samples(["/log/smooth"], 203, 209, by="tick")["/log/smooth"]
        assert part.values.tolist() == pytest.approx(whole.values[203:209].tolist(), abs=1e-9)
        assert client.samples(["/log/both"])["/log/both"].values.tolist() == [0, 1, 2, 3, 4] * 60

    def test_rates_that_do_not_divide_each_other_meet_at_their_common_ticks(self, bench, client):
        bench.logger.add(bench.x, "third", divider=3)
        bench.logger.add(bench.x, "second", divider=2)
        bench.logger.update()
        derive(bench, client, "both", "third - second")
        run(bench, client, 8)
        whole = client.samples(["/log/both"])["/log/both"]
        assert whole.values.tolist() == [0, 0, -2, 1, -1, -1, 0, 0]
        assert np.diff(whole.time_ns).tolist() == [TICK_NS] * 7
        for tick in range(8):
            part = client.samples(["/log/both"], tick, tick + 1, by="tick")["/log/both"]
            assert part.values.tolist() == [whole.values[tick]]

    def test_a_stream_brings_every_sample_of_one_that_is_derived_meanwhile(self, bench, client):
        derive(bench, client, "twice", "2 * x")
        bench.logger.start()
        wait_until(lambda: client.status().state is State.RUNNING)
        with client.stream(["/log/twice"], period_s=0.02) as stream:
            bench.ticks(20)
            found = read(stream, 20)
            derive(bench, client, "other", "3 * x")
            bench.ticks(10)
            assert [*found, *read(stream, 10)] == [2.0 * at for at in range(1, 31)]
            assert stream.missed == 0
        with pytest.raises(RefusedError, match="/log/nix"):
            client.stream(["/log/x", "/log/nix"])

    def test_a_stream_goes_on_with_what_is_there_when_one_of_its_signals_is_removed(self, bench, client):
        derive(bench, client, "half", "slow / 2")
        bench.logger.start()
        wait_until(lambda: client.status().state is State.RUNNING)
        with client.stream(["/log/half", "/log/x"], period_s=0.02) as stream:
            bench.ticks(20)
            found = read(stream, 20, "/log/x")
            with Client.connect("bot") as other:
                other._remove_derived("half")
            wait_until(lambda: (stream.read(0.05), stream.missing)[1])
            bench.ticks(10)
            found += read(stream, 10, "/log/x")
            assert stream.missing == {"/log/half": "it is no longer in the table"}
            # groups are numbered anew, and rows of half stand at every fifth tick
            assert (found, stream.missed) == (list(range(1, 31)), 0)

    def test_a_stream_comes_back_after_a_helper_process_without_what_was_removed(self, bench, client):
        derive(bench, client, "half", "slow / 2")
        bench.logger.start()
        wait_until(lambda: client.status().state is State.RUNNING)
        with client.stream(["/log/half", "/log/x"], period_s=0.02) as stream:
            bench.ticks(5)
            read(stream, 5, "/log/x")
            before = bench.serving.helper_pid
            os.kill(before, signal.SIGKILL)
            bench.logger._conditions._remove_derived("half")
            wait_until(lambda: (one := answered(client.status)) and one.helper_pid != before)

            def comes_again():
                bench.ticks(1)
                batch = stream.read(0.05)
                return batch is not None and "/log/x" in batch

            wait_until(comes_again)
            assert stream.missing == {"/log/half": "it is no longer in the table"}

    def test_the_same_pin_again_is_answered_though_one_of_its_signals_was_removed(self, bench, client):
        derive(bench, client, "twice", "2 * x")
        run(bench, client, 30)
        with client.pin(["/log/twice", "/log/x"], 0, 2**61) as pin:
            client._remove_derived("twice")
            wait_until(lambda: table_of(client).get("/log/twice") is None)
            request = OpenPin(
                pin=pin.id, names=["/log/twice", "/log/x"], start_ns=0, end_ns=2**61, proof=pin.request.proof
            )
            assert client._call(request) == pin.opened

    def test_a_pin_holds_it(self, bench, client):
        derive(bench, client, "twice", "2 * x")
        run(bench, client, 30)
        begin = int(client.samples(["/log/x"])["/log/x"].time_ns[0])
        with client.pin(["/log/twice"], begin, begin + 9 * TICK_NS) as pin:
            bench.ticks(2000)  # of which the buffers hold 1000
            held = client.samples(["/log/twice"], pin=pin)["/log/twice"]
        assert held.values.tolist() == [2.0 * at for at in range(1, 11)]

    def test_statistics_are_over_every_sample(self, bench, client):
        derive(bench, client, "twice", "2 * x")
        run(bench, client, 1)
        wait_until(lambda: client._survey(["max"], ["/log/twice"]).time_ns)
        bench.ticks(40)
        bench.x[...] = 0
        bench.ticks(1)

        def high_and_low():
            found = np.frombuffer(client._survey(["max", "value"], ["/log/twice"]).values).tolist()
            return found[1] == 2.0 and found

        assert wait_until(high_and_low) == [82.0, 2.0]
        table = client.table()
        every = np.frombuffer(client._survey(list(QUANTITIES), derived=True).values).reshape(len(QUANTITIES), -1)
        assert every.shape[1] == len(table.elements) + len(table.derived)

    def test_one_that_is_given_a_new_expression_is_judged_anew(self, bench, client):
        derive(bench, client, "level", "0 * x")
        bench.logger.limit("level", (None, None, 50, 1000))
        run(bench, client, 20)
        wait_until(lambda: client.alarms().limits)
        client.derive("level", "100 * x")
        wait_until(lambda: client.table().derived[0].expression == "100 * x")
        bench.ticks(5)
        assert wait_until(lambda: next((one for one in client.alarms().limits if one.count), None)).worst >= 2000


def test_the_commands_make_list_watch_and_remove_it(bench, client, capsys):
    def said(*words, code=0):
        assert silo_command([*words]) == code
        out, err = capsys.readouterr()
        return out + err

    assert "'/log/twice' is derived: 2 * q" in said("derive", "bot", "twice", "2 * q", "--unit", "rad")
    assert "/log/twice       3  rad   = 2 * q" in said("derive", "bot", "ls")
    assert "derived     1 signal" in said("info", "bot")
    assert "derived" in said("info", "bot", "twice")
    assert "is derived from others, and has no divider" in said("set", "bot", "twice", "divider=2", code=1)
    assert "would be computed from itself" in said("derive", "bot", "twice", "twice + q", code=1)
    bench.q[:] = 1, 2, 3
    run(bench, client, 5)
    assert "/log/twice  2 4 6 rad" in said("watch", "bot", "twice", "-n", "1")
    assert "is derived no more" in said("derive", "rm", "bot", "twice")
    assert "no derived signals" in said("derive", "ls")


def test_what_was_derived_while_it_ran_is_in_the_log_of_a_program_that_died(robots):
    robot = robots("bot")
    with Client.connect("bot") as client:
        heard = Heard(client)
        wait_until(lambda: client.status().ticks > 10)
        client.derive("twice", "2 * x", "V")
        robot.kill()
        (saved,) = heard.wait(EventKind.CRASHED).files
    log = silo.open_log(saved.path)
    assert log["twice"].values.tolist() == (2 * log["x"].values).tolist()
