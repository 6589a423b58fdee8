"""Two robots of one cloned image behind a router, and two desks with different roles, each a computer of its own.

Every command reaches the one robot that it names, or none; what was done says by whom.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from silo.cli.codes import EXIT_FAILED, EXIT_USAGE
from silo.cli.network.authority import make_network
from silo.core.elements import LoggedEvent
from silo.files.event_log import read_events
from silo.net.keys import Root, root_of
from tests import thin_net
from tests.thin_net import Computer, ThinNet
from tests.waiting import DEADLINE_S, wait_until

WHY_NOT = thin_net.missing() or ("" if shutil.which("openssl") else "makes certificates with openssl")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT or "it can be run")]

SILO = [sys.executable, "-c", "from silo.cli.main import main; main()"]
PORT = 7447


class Laboratory:
    """The computers, and what runs on them."""

    def __init__(self, place: Path) -> None:
        self.net = ThinNet(place, ["router", "robot", "robot", "desk1", "desk2"], delay_s=0.01)
        self.router, *self.robots, self.anna, self.bob = self.net.computers
        users = {"anna": "operator", "bob": "viewer", "robots": "robot"}
        made = make_network(place / "lab", [self.router.address], PORT, users)
        self.running = [self.start(self.router, "router", "--config", str(made.server / "server.json5"))]
        for robot in self.robots:
            shared = ["--config", str(made.clients["robots"]), "--folder", str(robot.place / "logs")]
            slow = ["--elements", "30", "--frequency", "50"]
            self.running.append(self.start(robot, "demo", "--name", "same", *slow, *shared))
        for desk, user in ((self.anna, "anna"), (self.bob, "bob")):
            assert self.run(desk, "remote", "add", "lab", str(made.clients[user])).returncode == 0

    def wait(self) -> None:
        """Wait until a desk sees both robots."""
        self.addresses = wait_until(lambda: found if len(found := self.seen(self.anna)) == 2 else [])

    def start(self, computer: Computer, *words: str) -> "subprocess.Popen[bytes]":
        with (computer.place / "output.txt").open("wb") as output:
            return subprocess.Popen(
                computer.command(*SILO, *words), env=computer.environment(), stdout=output, stderr=output
            )

    def run(self, computer: Computer, *words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            computer.command(*SILO, *words), env=computer.environment(), capture_output=True, text=True,
            timeout=DEADLINE_S, check=False,
        )  # fmt: skip

    def seen(self, computer: Computer) -> list[str]:
        """The addresses that a desk is told, which end the lines of loggers that are alike."""
        lines = self.run(computer, "ls").stdout.splitlines()[1:]
        return [word for line in lines if "~" in (word := line.split()[-1])]

    def happened(self, robot: Computer) -> list[LoggedEvent]:
        """What was asked of a robot, by its event log."""
        kinds = {kind for _, kind in CHANGES}
        return [one for one in read_events(robot.place / "logs", "same") if one.kind in kinds]

    def robot_of(self, address: str) -> Computer:
        """The robot that has an address, as it knows itself."""
        return next(one for one in self.robots if address in [root.address for root in self._roots(one)])

    def _roots(self, robot: Computer) -> list[Root]:
        return [root_of(key.read_text()) for key in (robot.place / "run").glob("*.key")]

    def close(self) -> None:
        for process in reversed(self.running):
            process.terminate()
        for process in self.running:
            process.wait()
        self.net.__exit__(None, None, None)


@pytest.fixture(scope="module")
def laboratory() -> Iterator[Laboratory]:
    with tempfile.TemporaryDirectory(prefix="silo-lab-", dir="/dev/shm") as place:
        made = Laboratory(Path(place))
        try:
            made.wait()
            yield made
        finally:
            made.close()


CHANGES = [
    (["stop", "{}"], "stopped"),
    (["set", "{}", "/log/base/euler", "divider=7"], "edited"),
    (["start", "{}", "--discard"], "started"),
    (["mark", "{}", "slipped"], "marker"),
    (["save", "{}"], "saved"),
    (["trigger", "add", "{}", "high", "/log/base/tilt > 5"], "conditions"),
]


@pytest.mark.parametrize("which", [0, 1])
def test_every_command_reaches_the_robot_that_it_names_and_says_by_whom(laboratory, which) -> None:
    address = laboratory.addresses[which]
    meant = laboratory.robot_of(address)
    (other,) = (robot for robot in laboratory.robots if robot is not meant)
    # each has told of its own start before anything is asked of it
    known, untouched = (
        len(wait_until(lambda: laboratory.happened(meant))),
        wait_until(lambda: laboratory.happened(other)),
    )
    for words, _ in CHANGES:
        done = laboratory.run(laboratory.anna, *(word.format(address) for word in words))
        assert done.returncode == 0, (words, done.stderr)
    kinds = [kind for _, kind in CHANGES]
    told = wait_until(lambda: now if len(now := laboratory.happened(meant)[known:]) >= len(kinds) else [])
    assert [one.kind for one in told] == kinds
    assert {one.who.split(",")[0] for one in told} == {"anna (proven) from desk1"}
    assert laboratory.happened(other) == untouched
    console = (meant.place / "output.txt").read_text()
    assert re.search(r"silo: same: .*stop.*, by anna \(proven\) from desk1, ", console), console


def test_a_name_that_both_have_reaches_none_and_lists_their_addresses(laboratory) -> None:
    before = [laboratory.happened(robot) for robot in laboratory.robots]
    for words in (["stop", "same"], ["stop", "robot/same"], ["stop"], ["set", "same", "/log/base/euler", "off"]):
        done = laboratory.run(laboratory.anna, *words)
        assert done.returncode == EXIT_USAGE
        assert all(address in done.stderr for address in laboratory.addresses)
    assert [laboratory.happened(robot) for robot in laboratory.robots] == before


def test_a_viewer_reads_all_and_changes_nothing(laboratory) -> None:
    before = [laboratory.happened(robot) for robot in laboratory.robots]
    assert set(laboratory.seen(laboratory.bob)) == set(laboratory.addresses)
    first, second = laboratory.addresses
    for address, changes in ((first, CHANGES), (second, CHANGES[:1])):
        for words, _ in changes:
            asked = [word.format(address).replace("=7", "=9") for word in words]  # what is set already isn't asked for
            done = laboratory.run(laboratory.bob, *asked)
            told = f"user 'bob' may look at {address}, not change it" in done.stderr
            assert (done.returncode, told) == (EXIT_FAILED, True), (asked, done.stderr)
    assert [laboratory.happened(robot) for robot in laboratory.robots] == before
