"""One command for many loggers: only where that is said so, one answer from each, and none holds up the others."""

import json
import os
import pty
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from silo.cli.codes import EXIT_FAILED, EXIT_NO_LOGGER, EXIT_USAGE
from silo.cli.main import run
from silo.client.bulk import saving
from silo.core.elements import State
from silo.fleet.resolving import discover
from silo.net.session import close, open_router
from tests.stand_ins.simulated_robots import SimulatedRobots
from tests.thin_net import free_port
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The file of a desk, with a router there."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    folder = tmp_path_factory.mktemp("bulk")
    (folder / "router.json5").write_text(json.dumps({"listen": {"endpoints": [endpoint]}}))
    (folder / "desk.json5").write_text(json.dumps({"connect": {"endpoints": [endpoint]}}))
    router, _ = open_router(str(folder / "router.json5"))
    yield str(folder / "desk.json5")
    close(router)


@pytest.fixture
def robots(desk: str) -> Iterator[SimulatedRobots]:
    """Three robots, of which the first two are called alike."""
    with SimulatedRobots(desk, ["robot1", "robot2", "spot"]) as made:
        wait_until(lambda: len(discover(config=desk).loggers) == 3)
        yield made


def states(robots: SimulatedRobots) -> list[State]:
    return [robot.state for robot in robots.robots]


def test_a_glob_names_the_loggers_and_nothing_is_asked_without_all(desk, robots, capsys) -> None:
    assert run(["--config", desk, "stop", "robot*/anymal"]) == EXIT_USAGE
    said = " ".join(capsys.readouterr().err.split())
    assert "'robot*/anymal' means 2 loggers: robot1/anymal, robot2/anymal; say --all" in said
    assert "nothing was asked" in said
    assert states(robots) == [State.RUNNING] * 3


def test_with_all_each_gives_an_answer_and_no_other_is_asked(desk, robots, capsys) -> None:
    assert run(["--config", desk, "stop", "robot*/anymal", "--all"]) == 0
    lines = sorted(capsys.readouterr().out.splitlines())
    assert [line.split()[:2] for line in lines] == [["robot1/anymal", "stopped,"], ["robot2/anymal", "stopped,"]]
    assert states(robots) == [State.STOPPED, State.STOPPED, State.RUNNING]
    assert run(["--config", desk, "start", "--all"]) == 0
    said = capsys.readouterr().out
    assert "spot/anymal" in said
    assert "runs already, left alone" in said
    assert states(robots) == [State.RUNNING] * 3


def test_who_refuses_or_is_silent_has_an_answer_too_and_the_exit_code_says_that_one_failed(
    desk, robots, capsys
) -> None:
    robots.robots[0].refuses = "you are a viewer"
    robots.robots[1].mute = True
    assert run(["--config", desk, "stop", "--all"]) == EXIT_FAILED
    told = capsys.readouterr()
    lines = {line.split()[1 if line.startswith("!") else 0]: line for line in told.out.splitlines()}
    assert lines["robot1/anymal"].startswith("! ")
    assert "you are a viewer" in lines["robot1/anymal"]
    assert "did not answer within 2" in lines["robot2/anymal"]
    assert lines["spot/anymal"].split()[:2] == ["spot/anymal", "stopped,"]
    assert list(lines)[-1] == "robot2/anymal"  # the others had their answers before
    assert "1 of 3 loggers did, robot1/anymal, robot2/anymal not" in told.err


def test_with_read_only_nothing_is_changed_by_many_either(desk, robots, capsys) -> None:
    assert run(["--config", desk, "--read-only", "stop", "--all"]) == EXIT_FAILED
    assert "--read-only" in capsys.readouterr().out
    assert states(robots) == [State.RUNNING] * 3


def test_a_glob_that_nobody_fits_is_told(desk, robots, capsys) -> None:
    assert run(["--config", desk, "stop", "mars*/*", "--all"]) == EXIT_NO_LOGGER
    assert "no logger 'mars*/*'" in capsys.readouterr().err


def test_a_save_names_its_files_with_their_sizes() -> None:
    files = [SimpleNamespace(path=f"/logs/x.{ending}", size_bytes=1500) for ending in ("silo", "csv")]
    client = SimpleNamespace(save=lambda *_: 7, wait_saved=lambda number, _: files if number == 7 else [])
    assert saving(client, []) == ("saved /logs/x.silo 1.5 kB, /logs/x.csv 1.5 kB", tuple(files))


def test_answers_for_machines(desk, robots, capsys) -> None:
    robots.robots[2].refuses = "no room on its disk"
    assert run(["--config", desk, "save", "spot*/*", "--all", "--json"]) == EXIT_FAILED
    assert json.loads(capsys.readouterr().out) == [
        {"logger": "spot/anymal", "done": False, "text": "no room on its disk", "files": []}
    ]


@pytest.mark.parametrize(("answer", "state"), [("n", State.RUNNING), ("y", State.STOPPED)])
def test_on_a_terminal_the_loggers_are_named_and_it_asks(desk, robots, answer, state) -> None:
    ours, theirs = pty.openpty()
    program = "import sys; from silo.cli.main import run; sys.exit(run(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "--config", desk, "stop", "robot1/*"]
    try:
        process = subprocess.Popen(
            command, stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=Path(__file__).parents[2]
        )
        os.write(ours, f"{answer}\n".encode())
        said = process.communicate()[0].decode()
    finally:
        os.close(ours)
        os.close(theirs)
    assert "'robot1/*' means 1 logger: robot1/anymal" in said
    assert states(robots) == [state, State.RUNNING, State.RUNNING]
    assert (process.returncode == 0) == (answer == "y")
