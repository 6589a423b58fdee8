"""What the commands say is so: rates, failed reads, integers, dead loggers, and the way out of a refusal."""

import contextlib
import json
import os
import signal

import pytest

import silo
from silo.cli.codes import EXIT_FAILED, EXIT_NO_LOGGER, EXIT_USAGE
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import State
from silo.errors import ElementError
from tests.waiting import freeze

pytestmark = pytest.mark.slow


def shown_rate(capsys, state):
    """What `silo ls` shows under HZ, which is aligned right, for the only logger in that state."""
    assert run(["ls"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    words = {state, "no tick"} if state == "running" else {state}  # a busy machine may be slow to tick
    (row,) = [row for row in rows if any(f" {word} " in row for word in words)]
    return row[: head.index("HZ") + 2].split()[-1]


def test_a_stopped_logger_has_no_rate(bench, client, capsys, until):
    assert shown_rate(capsys, "stopped") == "-"
    bench.logger.start()
    until(lambda: client.status().state is State.RUNNING)
    assert shown_rate(capsys, "running") in ("-", "0")  # not the nominal one: it hasn't ticked yet

    def ticked() -> bool:
        bench.ticks(1)
        return shown_rate(capsys, "running") not in ("-", "0")

    until(ticked)


@pytest.mark.parametrize("words", [["buffer=growing"], ["buffer=fixed", "size=200s"]], ids=str)
def test_whatever_has_a_logger_end_by_itself_says_so(bench, client, capsys, until, words):
    def said(*typed: str) -> str:
        assert run(list(typed)) == 0
        bench.ticks(log.is_running)
        out, err = capsys.readouterr()
        return out + err

    end = "logging stops by itself after 10 s (max_time), as not all buffers are looping (/log/kept)"
    log = bench.logger
    log.start()
    bench.ticks(1)
    until(lambda: client.status().state is State.RUNNING)
    assert "10 s, which ends nothing now: all buffers are looping" in said("info")
    assert said("set", "kept", *words, "--cut").count(end) == 1
    assert end not in said("set", "kept", "divider=2", "--cut")
    assert "which ends nothing" not in said("info")
    assert end in said("restart", "--discard")
    said("stop")
    assert end in said("start", "--discard")
    said("stop")
    assert end in said("start", "--all", "--discard")
    said("stop")
    said("set", "kept", "buffer=looping")
    assert end in said("set", "kept", *words)
    assert end not in said("set", "kept", "divider=3")


def test_a_dead_logger_has_no_rate_and_says_where_its_recording_is(robots, capsys, until, tmp_path):
    robot = robots("bot")
    with Client.connect("bot") as client:
        until(lambda: client.status().ticks > 10)
        robot.kill()
        until(lambda: (status := client.status()).state.value == "dead" and status.saved)
        assert shown_rate(capsys, "dead") == "-"
        assert run(["info", "bot"]) == 0
        (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("recording")]
        assert "all that the buffers held of its" in line
        assert "logs" in line


def test_of_a_logger_that_died_with_its_helper_info_says_what_it_left(robots, capsys, until):
    robot = robots("bot")
    with Client.connect("bot") as client:
        until(lambda: client.status().ticks > 10)
        freeze(robot.helper_pid)
        robot.kill()
    os.kill(robot.helper_pid, signal.SIGKILL)
    until(lambda: run(["info", "bot"]) == EXIT_NO_LOGGER and "it held" in (said := capsys.readouterr().err) and said)
    assert run(["info", "bot"]) == EXIT_NO_LOGGER
    assert "logger 'bot' died: process" in (said := capsys.readouterr().err)
    assert "`silo recover` saves it" in said
    assert run(["info", "other"]) == EXIT_NO_LOGGER
    assert "it held" not in capsys.readouterr().err


def test_watch_as_json_keeps_integers_and_truth_values(bench, capsys):
    bench.start(5)
    assert run(["watch", "/log/gait", "/log/mixed", "/log/x", "--json", "--count", "1"]) == 0
    values = json.loads(capsys.readouterr().out)["values"]
    assert {name: type(value) for name, value in values.items()} == {
        "/log/gait": int,
        "/log/mixed_a": float,
        "/log/mixed_n": int,
        "/log/x": float,
    }


def test_watch_tells_of_values_that_could_not_be_read(runtime, tmp_path, capsys):
    class Battery:
        charge = 7

    battery = Battery()
    log = silo.Logger("pack", folder=tmp_path, script=tmp_path / "none.yaml")
    log.add(battery, "charge", attr="charge", action=silo.Action.SAVE_AND_PUBLISH)
    log.array("y", action=silo.Action.SAVE_AND_PUBLISH)
    with contextlib.closing(log), log.serve():
        log.start()
        log.collect()
        battery.charge = None
        log.collect()
        log.collect()
        assert run(["watch", "/log/*", "--count", "1"]) == 0
        charge, y = capsys.readouterr().out.splitlines()
        assert charge.endswith("/log/charge  7  ! not read at 2 ticks")
        assert "not read" not in y
        assert run(["watch", "/log/*", "--count", "1", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["failed"] == {"/log/charge": 2}


def test_a_start_of_a_running_logger_names_the_commands(bench, capsys):
    bench.logger.start()
    assert run(["start", "bot"]) == EXIT_FAILED
    said = capsys.readouterr().err
    name = f"bot.{os.getpid()}"
    assert f"'{name}' runs already: `silo restart {name}`, or `silo stop {name}` first; nothing was changed" in said
    assert "stop()" not in said


@pytest.mark.parametrize("words", [["set", "joints", "size=1e9"], ["watch", "joints"]])
def test_a_pattern_alone_is_not_taken_for_a_logger_without_a_word(words, bench, tmp_path, capsys):
    with contextlib.closing(silo.Logger("other", folder=tmp_path, script=tmp_path / "none.yaml")) as other:
        other.array("z", group="joints")
        with other.serve():
            assert run(words) == EXIT_USAGE
            said = capsys.readouterr().err
    assert "no logger is called 'joints', and several run: say which before it: bot." in " ".join(said.split())


def test_a_topic_of_an_unknown_name_is_an_error_that_names_near_ones(client):
    with pytest.raises(ElementError, match=r"has no element '/log/slo'; did you mean '/log/slow'"):
        client.topic("/log/slo")
    with pytest.raises(ElementError, match=r"it has 8 elements, see client.table"):
        client.topic("nope, and far from everything")
    client.topic("/log/slow").close()


def test_a_script_that_is_no_yaml_is_a_line_and_no_traceback(runtime, tmp_path, capsys):
    bad = tmp_path / "bad.yaml"
    bad.write_text("log_elements:\n  - name: [\n")
    for program in ("demo", "host"):
        assert run([program, "--script", str(bad), "--folder", str(tmp_path)]) == EXIT_FAILED
        said = capsys.readouterr().err
        assert said.startswith(f"silo: {bad}:")
        assert "Traceback" not in said
