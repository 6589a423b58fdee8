"""An excitation by a client: begun in the robot program, kept by whoever asked, ended by what happens around it."""

import os
import signal
import subprocess
import sys

import pytest

from silo.cli.main import run
from silo.parameters import excited as excited_module
from silo.parameters.excited import GONE
from silo.parameters.requests import ParameterRequests
from silo.rpc.published import EventKind
from tests.stand_ins.ticking import turning
from tests.waiting import wait_until

LONG = {"amplitude": 2.0, "duration": 600, "low_hz": 0.05, "high_hz": 5}


@pytest.fixture
def excited(bench, monkeypatch):
    """The served logger with an input, running; its loop turns in a thread while the test lasts.

    A client of a busy machine is not taken for gone.
    """
    monkeypatch.setattr(excited_module, "LEASE_S", 60.0)
    logger = bench.logger
    logger.stop()
    logger.input("tau", min=-5, max=5, unit="Nm")
    logger.start()
    with turning(lambda: bench.ticks(1)):
        yield logger


def begun(logger):
    """Wait for the excitation that goes on."""
    wait_until(lambda: (one := logger.parameters.excitations.running) and one.landed)
    return logger.parameters.excitations.running.excited


def is_back(logger, excited):
    """Wait for its end, and for the value that was before."""
    wait_until(lambda: excited.ended)
    return float(logger.parameters["tau"]) == 0.0


def test_a_client_has_it_begun_and_hears_how_it_ended_and_all_numbers_are_events(excited, client):
    ended = client.parameters.excite("tau", "chirp", amplitude=2.0, duration=0.5, low_hz=1, high_hz=20)
    assert ended.ended == "it is over"
    assert 0 < ended.tick < ended.until
    found = wait_until(lambda: [one for one in client.events() if one.change and one.tick == ended.until])
    assert found[0].text == "tau 0.0 -> 0.0 Nm (excitation ended: it is over)"
    (begin,) = [one for one in client.events() if one.change and one.change.excitation]
    assert (begin.tick, begin.change.excitation.high_hz) == (ended.tick, 20.0)
    assert not [one.text for one in client.events() if one.kind == EventKind.LOST.value]


def test_a_key_ends_it_and_so_does_whatever_interrupts_its_client(excited, client):
    ended = client.parameters.excite("tau", "chirp", **LONG, wait=lambda state, _: state.at_s > 0.02)
    assert "stopped by" in ended.ended

    def interrupt(state, _):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        client.parameters.excite("tau", "chirp", **LONG, wait=interrupt)
    wait_until(lambda: excited.parameters.excitations.running is None)
    assert float(excited.parameters["tau"]) == 0.0


PROGRAM = """
import silo
silo.connect("bot").parameters.excite("tau", "chirp", amplitude=2.0, duration=600, low_hz=0.05, high_hz=5)
"""


def test_a_client_that_is_killed_and_a_helper_process_that_is_leave_the_value_as_it_was(excited, monkeypatch):
    client = subprocess.Popen([sys.executable, "-c", PROGRAM])
    course = begun(excited)
    client.kill()
    client.wait()
    monkeypatch.setattr(excited_module, "LEASE_S", 2.0)
    assert is_back(excited, course)
    assert course.ended == GONE
    monkeypatch.setattr(excited_module, "LEASE_S", 60.0)
    client = subprocess.Popen([sys.executable, "-c", PROGRAM], stderr=subprocess.DEVNULL)
    course = begun(excited)
    os.kill(excited._life.serving.helper_pid, signal.SIGKILL)
    assert is_back(excited, course)
    client.kill()
    client.wait()


def test_each_limit_that_fires_ends_it_however_often(excited, client):
    excited.limit("tau", (None, None, 1.0, 1.5))
    for _ in range(3):
        ended = client.parameters.excite("tau", "step", amplitude=2.0, duration=600)
        assert "limit: /log/tau HH 2 Nm at tick" in ended.ended
        assert float(excited.parameters["tau"]) == 0.0


def test_beginning_needs_control_and_ending_it_does_not():
    needs = {
        name: vars(ParameterRequests)[name].request.needs_control
        for name in ("_excite", "_keep_excitation", "_stop_excitation")
    }
    assert needs == {"_excite": True, "_keep_excitation": True, "_stop_excitation": False}


def test_the_shell_says_what_it_will_do_and_does_it_if_it_may(excited, capsys):
    asked = ["excite", "bot", "tau", "--chirp", "1-20Hz", "--amplitude", "2", "--for", "300ms"]
    assert run([*asked, "--yes"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "tau around 0.0 Nm, from -2 to 2: chirp 1 to 20 Hz, amplitude 2, for 0.3 s, ramps of 0.03 s"
    assert told[-1].startswith("tau: it is over; rows ")
    assert run(asked) == 2
    assert "say --yes" in capsys.readouterr().err
    for wrong, words in (("6", "an amplitude of at most 5 fits"), ("nan", "a number other than 0")):
        assert run([*asked[:-3], wrong, "--for", "1s", "--yes"]) == 1
        assert words in capsys.readouterr().err
    excited.limit("tau", (None, None, 1.0, 1.5))
    assert run([*asked[:-1], "600s", "--yes"]) == 1, "something else ended it"
    assert "limit: /log/tau" in capsys.readouterr().out
    assert run(["excite", "bot", "tau", "--amplitude", "1", "--for", "1s"]) == 2
    assert run(["param", "set", "bot", "tau=1"]) == 1
    assert "an input is 0 unless it is excited" in capsys.readouterr().err
