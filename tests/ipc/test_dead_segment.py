"""A network segment goes down with many robots in it: the router goes on, and the others are seen all the time."""

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import thin_net
from tests.stand_ins import simulated_robots
from tests.thin_net import Computer, ThinNet

WHY_NOT = thin_net.missing()
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT or "it can be run")]

SILO = [sys.executable, "-c", "from silo.cli.main import main; main()"]
HEALTHY = 12

# on the desk: who is seen with an answer, again and again, until all of the dead host are told to be lost
LOOKING = """
import sys, json
from silo.fleet.fleet import Fleet, asked_all

def seen():
    return [one.found.host for one in asked_all(config, answer_s=8.0).members if one.status is not None]

config, dead = sys.argv[1], int(sys.argv[2])
with Fleet(config) as fleet:
    while [one.here for one in fleet.now().members].count(True) < int(sys.argv[3]) + dead:
        fleet.wait(fleet.now().number, 1.0)
    print(json.dumps(seen()), flush=True)
    sys.stdin.readline()
    while sum(one.found.host == "robot4" and one.lost for one in fleet.now().members) < dead:
        print(json.dumps(seen()), flush=True)
    print(json.dumps(seen()), flush=True)
    members = fleet.now().members
print(json.dumps([[one.found.host, one.lost] for one in members]), flush=True)
"""


class Site:
    """A router, a desk, a host with healthy robots, and one whose link goes down."""

    def __init__(self, place: Path, dead: int) -> None:
        self.running: list[subprocess.Popen[str]] = []
        self.net = ThinNet(place, ["router", "desk", "robot3", "robot4"])
        self.router, self.desk, healthy, self.cut = self.net.computers
        endpoint = {"endpoints": [f"tcp/{self.router.address}:7447"]}
        (place / "router.json5").write_text(json.dumps({"listen": endpoint}))
        self.client = str(place / "client.json5")
        Path(self.client).write_text(json.dumps({"connect": endpoint}))
        router = self.start(self.router, *SILO, "router", "--config", str(place / "router.json5"))
        assert router.stdout.readline().startswith("router on")
        for computer, count in ((healthy, HEALTHY), (self.cut, dead)):
            words = [self.client, str(count), "--host", computer.host]
            robots = self.start(computer, sys.executable, simulated_robots.__file__, *words)
            assert robots.stdout.readline().startswith(f"{count} robots")

    def start(self, computer: Computer, *words: str) -> "subprocess.Popen[str]":
        one = subprocess.Popen(
            computer.command(*words), env=computer.environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        self.running.append(one)
        return one

    def close(self) -> None:
        for process in reversed(self.running):
            process.kill()
            process.wait()
        self.net.__exit__(None, None, None)


@pytest.fixture
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    with tempfile.TemporaryDirectory(prefix="silo-segment-", dir="/dev/shm") as place:
        made = Site(Path(place), request.param)
        yield made
        made.close()


@pytest.mark.parametrize(("site", "dead"), [(30, 30), (60, 60)], indirect=["site"])
def test_robots_behind_a_link_that_went_down_hide_no_others_and_stay_in_the_list(site, dead) -> None:
    desk = site.start(site.desk, sys.executable, "-c", LOOKING, site.client, str(dead), str(HEALTHY))
    assert Counter(json.loads(desk.stdout.readline())) == {"robot3": HEALTHY, "robot4": dead}
    site.net.cut(site.cut)
    desk.stdin.write("\n")
    desk.stdin.flush()
    *looks, members = [json.loads(line) for line in desk.stdout]
    assert {look.count("robot3") for look in looks} == {HEALTHY}
    assert Counter(map(tuple, members)) == {("robot3", False): HEALTHY, ("robot4", True): dead}
