"""Parameters by a client: set at the end of a tick, told the tick, refused in words, recorded whatever is killed."""

import os
import signal
import threading
import time
from types import SimpleNamespace

import pytest

import silo
from silo.cli.main import run
from silo.client.parameters import ClientParameters
from silo.core.tuning.parameters import Excitation, Wave
from silo.errors import RefusedError
from silo.parameters.requests import ParameterRequests
from silo.rpc.declaring import request_of
from silo.rpc.published import EventKind
from silo.segment.parameter_changes import MOST_WORDS
from tests.ipc.conftest import Heard
from tests.stand_ins.ticking import turning
from tests.waiting import wait_until


@pytest.fixture
def tuned(bench):
    """The served logger with two gains, running; its loop turns in a thread while the test lasts."""
    logger = bench.logger
    logger.stop()
    logger.parameter("kp", 40.0, min=0, max=200, group="legs")
    logger.parameter("kd", 1.0, group="legs", check=lambda kd: kd < 100)
    logger.start()
    with turning(logger.collect):
        yield logger


def test_a_client_sets_some_and_is_told_the_tick_from_which_they_hold(tuned, client):
    told = client.parameters.set({"kp": 50.0, "kd": 2.0})
    assert told.tick > 0
    assert client.parameters["kp"] == 50.0
    (change,) = tuned._present.run.reader.changes(0)
    assert (change.tick, change.change.where) == (told.tick, "this computer")
    client.parameters["kp"] = 60.0
    assert dict(client.parameters) == {"/log/legs/kp": 60.0, "/log/legs/kd": 2.0}


def test_all_that_a_logger_has_room_for_is_set_at_once(bench, client):
    bench.logger.parameter("map", [0.5] * MOST_WORDS)
    values = [one / 7 for one in range(MOST_WORDS)]
    bench.logger.start()
    with turning(bench.logger.collect):
        client.parameters.set({"map": values})
    assert client.parameters["map"] == tuple(values)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["/a/kp", "/b/kp"], "'kp' may be /a/kp, /b/kp: write more of the name; nothing was changed"),
        (["/log/kd", "/log/ki"], "no parameter 'kp'; there are 2: /log/kd, /log/ki"),
        (["/log/kpp"], "no parameter 'kp'; did you mean 'kpp'?"), ([], "no parameter 'kp'; there are none"),
    ],
)  # fmt: skip
def test_a_name_of_no_or_of_several_parameters_is_told_with_those_that_there_are(names, words):
    known = SimpleNamespace(parameters=[SimpleNamespace(name=name) for name in names])
    with pytest.raises(silo.ElementError) as refused:
        ClientParameters(SimpleNamespace(_list_parameters=lambda: known)).info("kp")
    assert str(refused.value) == words


def test_what_is_refused_is_told_in_the_words_of_the_robot_and_nothing_changes(tuned, client):
    for values, words in (
        ({"kp": 201.0, "kd": 2.0}, "201.0 doesn't fit, it takes 0 to 200"),
        ({"kd": 100.0}, "its check refuses it"),
        ({"kx": 1.0}, "no parameter 'kx'; there are 2"),
    ):
        with pytest.raises(RefusedError, match=words):
            client.parameters.set(values)
        assert tuned.parameters.read() == {"/log/legs/kp": 40.0, "/log/legs/kd": 1.0}
    with silo.connect("bot", read_only=True) as looker:
        assert looker.parameters["kp"] == 40.0
        with pytest.raises(RefusedError):
            looker.parameters["kp"] = 50.0
    for after_s in (float("nan"), float("inf"), 1e300, -1.0):
        asked = request_of(ParameterRequests._set_parameters, {"kp": 50.0}, "a", after_s)
        with pytest.raises(RefusedError, match="revert_after must be from 0 and below 86400 s"):
            client._call(asked)
        assert client.parameters["kp"] == 40.0
    assert client.parameters.set({"kp": 50.0}).tick > 0


def test_a_check_that_would_wait_for_itself_refuses_at_once(bench, client):
    logger = bench.logger
    logger.stop()
    logger.parameter("kp", 40.0, check=lambda _: logger.save())
    logger.start()
    with turning(logger.collect), pytest.raises(RefusedError, match="no save and no recording within a check"):
        client.parameters.set({"kp": 50.0})
    assert logger.parameters.read() == {"/log/kp": 40.0}
    assert logger.save().path


def test_a_change_is_an_event_and_stands_in_the_file_that_the_helper_process_saves(tuned, client):
    heard = Heard(client)
    told = client.parameters.set({"kp": 50.0})
    event = wait_until(lambda: next((one for one in heard.events if "kp 40.0 -> 50.0" in one.text), None))
    assert (event.kind, event.tick) == (EventKind.PARAMETER, told.tick)
    log = silo.open_log(tuned.save().path)
    (change,) = log.parameters.changes
    assert (change.tick, change.change.values) == (told.tick, (("/log/legs/kp", 40.0, 50.0),))
    assert log.parameters.at(1e6)["/log/legs/kp"] == 50.0


def test_a_parameter_is_a_topic_as_any_signal_is_whoever_sets_it(tuned, client):
    with silo.topic("silo:///bot/log/legs/kp") as topic:
        assert next(iter(topic)).values[-1] == 40.0
        client.parameters["kp"] = 50.0
        wait_until(lambda: next(iter(topic)).values[-1] == 50.0)


def test_a_helper_process_that_is_killed_loses_no_change_and_tells_none_twice(tuned, client):
    client.parameters.set({"kp": 50.0})
    wait_until(lambda: [one for one in client.events() if "50.0" in one.text])
    os.kill(tuned._life.serving.helper_pid, signal.SIGKILL)
    tuned.parameters["kp"].value = 60.0

    def told():
        try:
            return [one.text for one in client.events() if one.kind == EventKind.PARAMETER.value]
        except silo.SiloError:
            return []

    wait_until(lambda: any("60.0" in text for text in told()))
    assert sum("-> 50.0" in text for text in told()) == 1


def test_a_change_that_no_tick_comes_for_waits_and_is_told_so(bench):
    bench.logger.stop()
    bench.logger.parameter("kp", 40.0)
    with silo.connect("bot") as client:
        told = client.parameters.set({"kp": 50.0})
        assert told.waits
        bench.logger.collect()
        assert client.parameters["kp"] == 50.0


def test_a_change_is_answered_with_its_tick_where_one_comes_soon(bench, client, monkeypatch):
    """Its client waits for it: a second, while the program looks whether it landed."""
    bench.logger.stop()
    bench.logger.parameter("kp", 40.0)
    bench.logger.start()
    serving, looks = bench.logger._life.serving, []
    look = serving._look_at_parameters
    monkeypatch.setattr(serving, "_look_at_parameters", lambda: (look(), looks.append(len(serving._landing))))
    told = []
    asking = threading.Thread(target=lambda: told.append(client.parameters.set({"kp": 50.0})))
    asking.start()
    wait_until(lambda: sum(looks) >= 3 or told)
    assert not told  # as it has not landed
    bench.logger.collect()
    asking.join()
    assert (told[0].waits, told[0].tick) == (False, 1)


def test_what_is_not_confirmed_is_taken_back_by_the_robot_program(tuned, client):
    client.parameters.set({"kp": 50.0}, revert_after=0.05)
    wait_until(lambda: client.parameters["kp"] == 40.0)
    kept = client.parameters.set({"kp": 60.0}, revert_after=60)
    assert client.parameters.confirm(kept) == "it stays"


def test_setting_and_confirming_need_control_and_reading_does_not():
    needs = {name: vars(ParameterRequests)[name].request for name in ("_set_parameters", "_confirm_parameters")}
    assert all(kind.needs_control and kind.key == "do" for kind in needs.values())
    assert vars(ParameterRequests)["_list_parameters"].request.key == "ask"


def test_a_client_cannot_say_that_it_is_on_the_robot(monkeypatch):
    from silo.parameters import server
    from silo.rpc.serving import Sender, Turn

    sent = []

    class Program:
        def reply(self, request, turn):
            sent.append(request.remote)

    monkeypatch.setattr(server, "came_by_network", lambda who: who == "far")
    request = request_of(ParameterRequests._set_parameters, {"kp": 1.0}, "", 0.0, remote=False)
    for who in ("far", "near"):
        turn = Turn(Sender("", who))
        server.ParameterServer(Program()).set_parameters(turn, request.values, "", 0.0, request.remote)
    assert sent == [True, False]


def test_the_shell_lists_sets_saves_compares_and_loads(tuned, client, tmp_path, capsys):
    preset = tmp_path / "walk.yaml"
    preset.write_text("kp: 10   # of Monday\n")
    assert run(["param", "set", "bot", "kp=50", "kd=2.5"]) == 0
    assert "it holds from tick" in capsys.readouterr().out
    assert run(["param", "get", "bot", "kp"]) == 0
    assert capsys.readouterr().out == "50.0\n"
    assert run(["param", "save", "bot", str(preset)]) == 0
    assert preset.read_text() == "kp: 50.0   # of Monday\n/log/legs/kd: 2.5\n"
    client.parameters.set({"kp": 60.0})
    capsys.readouterr()
    assert run(["param", "diff", "bot", str(preset)]) == 4
    assert capsys.readouterr().out == f"/log/legs/kp: 60.0 now, 50.0 in {preset}\n"
    assert run(["param", "load", "bot", str(preset)]) == 0
    assert run(["param", "diff", "bot", str(preset)]) == 0
    capsys.readouterr()
    assert run(["param", "ls", "bot"]) == 0
    assert "/log/legs/kp   50.0  -     0 to 200    40.0" in capsys.readouterr().out
    assert run(["param", "set", "bot", "kp=201"]) == 1
    assert "201.0 doesn't fit, it takes 0 to 200" in capsys.readouterr().err
    assert run(["param", "set", "bot", "kp=20", "legs/kp=21"]) == 2
    assert "'/log/legs/kp' is given twice" in capsys.readouterr().err
    assert client.parameters["kp"] == 50.0


def test_a_preset_with_what_the_program_alone_sets_is_refused_with_its_file(bench, client, tmp_path, capsys):
    logger, preset = bench.logger, tmp_path / "walk.yaml"
    logger.stop()
    logger.parameter("mine", 1, writable=False)
    logger.start()
    preset.write_text("mine: 2\n")
    with turning(logger.collect):
        assert run(["param", "load", "bot", str(preset)]) == 1
    assert f"{preset}: parameter '/log/mine': the program alone sets it" in capsys.readouterr().err


def test_each_word_of_the_shell_is_one_value_whatever_stands_in_it(bench, client):
    logger = bench.logger
    logger.stop()
    word = logger.parameter("text", "a")
    floor = logger.parameter("floor", "wet floor", choices=["wet floor", "dry floor"])
    gains = logger.parameter("gains", [1.0, 2.0])
    logger.start()
    with turning(logger.collect):
        assert run(["param", "set", "bot", "text=slow floor=7", "floor=dry floor", "gains=[0.5, 0.25]"]) == 0
    assert (word.value, floor.value, list(gains.value)) == ("slow floor=7", "dry floor", [0.5, 0.25])


def test_silo_param_watch_prints_each_change_from_now_on_and_nothing_else(tuned, client, monkeypatch, capsys):
    client.parameters["kp"] = 45.0
    wait_until(lambda: any("-> 45.0" in one.text for one in client.events()))

    def passes(seconds):
        """Something happens while it sleeps; then Ctrl-C."""
        if client.parameters["kp"] == 50.0:
            raise KeyboardInterrupt
        client.mark("not of a parameter")
        client.parameters["kp"] = 50.0
        wait_until(lambda: any("-> 50.0" in one.text for one in client.events()))

    clock = SimpleNamespace(sleep=passes, strftime=time.strftime, localtime=time.localtime)  # of that module alone
    monkeypatch.setattr("silo.cli.loggers.events.time", clock)
    assert run(["param", "watch", "bot"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert "kp 45.0 -> 50.0" in line


def test_a_change_is_called_by_a_short_name_of_printable_letters(tuned, client):
    """The robot program keeps 256 of them, and its run holds them beside who changed what."""
    client.parameters["kp"] = 50.0
    before = len(tuned._present.run.reader.changes(0))
    excitation = Excitation("kp", Wave.STEP, 1.0, 1.0)
    for name in ("x" * 65, "x" * 100_000, "a\x1b[2J"):
        for request in (
            request_of(ParameterRequests._set_parameters, {"kp": 60.0}, name),
            request_of(ParameterRequests._excite, excitation, name),
        ):
            with pytest.raises(RefusedError, match="a change is called by up to 64 letters, got"):
                client._call(request)
    assert client.parameters["kp"] == 50.0
    assert len(tuned._present.run.reader.changes(0)) == before
