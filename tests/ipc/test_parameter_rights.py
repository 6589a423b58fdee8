"""Who may turn what: every role tries every verb on parameters and inputs of each kind, on one robot, as one table."""

import contextlib
import json
from pathlib import Path

import pytest

import silo
from silo.client.client import Client
from silo.core.tuning.parameters import Excitation, Wave
from silo.errors import RefusedError
from silo.parameters import excited as excited_module
from tests.stand_ins.ticking import turning
from tests.thin_net import free_port
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

CONFIG = Path(__file__).parents[2] / "config"
WRITABLE = {"here": True, "anywhere": "anywhere", "program": False}
ROLES = ("operator on the robot", "operator elsewhere", "viewer elsewhere", "read-only", "without control")

YES = ""
HERE, PROGRAM = "it is set on the robot alone", "the program alone sets it"
LOOKS, READ_ONLY, CONTROL = "may look at", "read-only", "has control"


def row(here: str, elsewhere: str) -> tuple[str, str, str, str, str]:
    """What each role is told where the program doesn't mind."""
    return here, elsewhere, LOOKS, READ_ONLY, CONTROL


TABLE = {
    ("list", "here"): (YES,) * 5,
    **{
        (verb, kind): row(here, elsewhere)
        for verb in ("set", "set for 10 s", "excite")
        for kind, here, elsewhere in (("here", YES, HERE), ("anywhere", YES, YES), ("program", PROGRAM, PROGRAM))
    },
    ("set with one of the program's", "anywhere"): row(PROGRAM, PROGRAM),
    ("confirm", "anywhere"): row(YES, YES),
    ("stop what is excited", "anywhere"): (YES, YES, LOOKS, READ_ONLY, YES),  # whoever may change may end it
}


def attempt(client: Client, logger: silo.Logger, verb: str, kind: str) -> None:
    """Do it; what it leaves is put back by the program."""
    parameters, tuned = client.parameters, logger.parameters
    if verb == "list":
        assert client.parameters[kind] == 1.0
    elif verb == "confirm":
        change = tuned.request({kind: 2.0}, "", "", "by a test", remote=False, revert_s=10)
        wait_until(lambda: change.landed)
        client._confirm_parameters("by a test")
    elif verb == "stop what is excited":
        tuned.excite(wave("tau_anywhere"), "", "", "by a test", remote=False, frequency_hz=1000)
        client._stop_excitation()
    elif verb == "excite":
        client._excite(wave(f"tau_{kind}"), "")
    elif verb == "set with one of the program's":
        parameters.set({kind: 2.0, "program": 2.0})
    else:
        parameters.set({kind: 2.0}, revert_after=10 if "10 s" in verb else 0)
        assert tuned[kind].value == 2.0


def wave(name: str) -> Excitation:
    return Excitation(name, Wave.CHIRP, 1.0, 600.0, 1.0, 5.0)


def put_back(logger: silo.Logger) -> None:
    """Nothing is excited, waits or differs any more, and no change has a name."""
    tuned = logger.parameters
    tuned.excitations.stop("", "the next case")
    wait_until(lambda: tuned.excitations.running is None)
    tuned._reverts.clear()
    tuned._ends.clear()
    tuned.set(dict.fromkeys(WRITABLE, 1.0))


@pytest.fixture
def robot(runtime, tmp_path, monkeypatch):
    """A robot behind passwords, its loop turning; and how to reach it by role."""
    monkeypatch.setattr(excited_module, "LEASE_S", 600.0)  # nobody keeps going what is excited here
    port = free_port()
    users = tmp_path / "users.txt"
    users.write_text("viewer:look\nengineer:change\n")
    text = (CONFIG / "access-control.json5").read_text()
    text = text.replace("tcp/0.0.0.0:7460", f"tcp/127.0.0.1:{port}").replace("/etc/silo/users.txt", str(users))
    (tmp_path / "server.json5").write_text(text)
    with silo.Logger("far", frequency=1000, folder=tmp_path / "logs", script=tmp_path / "x.yaml") as logger:
        for kind, writable in WRITABLE.items():
            logger.parameter(kind, 1.0, writable=writable)
            logger.input(f"tau_{kind}", -5, 5, writable=writable)
        logger.start()
        logger.serve(config=tmp_path / "server.json5")

        def elsewhere(user: str, password: str) -> Client:
            path = tmp_path / f"{user}.json5"
            auth = {"usrpwd": {"user": user, "password": password}}
            path.write_text(
                json.dumps({"connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}, "transport": {"auth": auth}})
            )
            return Client.connect("far", config=str(path))

        with turning(logger.collect), contextlib.ExitStack() as opened:
            reached = {
                "operator on the robot": Client.connect("far"),
                "operator elsewhere": elsewhere("engineer", "change"),
                "viewer elsewhere": elsewhere("viewer", "look"),
                "read-only": Client.connect("far", read_only=True),
                "without control": Client.connect("far"),
            }
            for client in reached.values():
                opened.enter_context(client)
            yield logger, reached


def test_each_role_may_do_what_the_table_says_and_is_told_why_it_may_not(robot):
    logger, reached = robot
    wrong = []
    for role in ROLES:
        if role == "without control":
            reached["operator elsewhere"].take_control()
        for (verb, kind), told in TABLE.items():
            put_back(logger)
            words, said = told[ROLES.index(role)], YES
            try:
                attempt(reached[role], logger, verb, kind)
            except RefusedError as error:
                said = str(error)
            changed = verb.startswith("set") and any(logger.parameters[one].value != 1.0 for one in WRITABLE)
            if words not in said or (said and not words) or (said and changed):
                wrong.append((role, verb, kind, words, said))
    assert wrong == []
