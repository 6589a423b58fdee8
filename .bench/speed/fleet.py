"""What a fleet costs: `python .bench/speed/fleet.py [--robots 30 --robots 100]`.

That many robots behind one router on loopback: five real demos, the others sessions of one process that answer and tell
summaries as helpers do. Per row: `silo ls`, whole and without the start of Python; what silo-tui with its list costs at
160x50, and the router beside it; how soon a killed program, a killed robot and one that falls silent are told. Linux.
"""

import argparse
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import psutil
from terminal import Link, Terminal, cpu_s, shows

from silo.client.client import Client
from silo.core.elements import State
from silo.fleet.fleet import Fleet, surveyed
from silo.fleet.member import Member

REAL = 5
ROBOTS = Path(__file__).parents[2] / "tests" / "stand_ins" / "simulated_robots.py"
SILO = [sys.executable, "-c", "from silo.cli import main; main()"]
SILO_TUI = [sys.executable, "-c", "from silo_tui.cli import main; main()"]
LEASE_S = 2.0  # what silo sets on loopback
MOST_S = 60.0
LOOK_S = 20.0


class Site:
    """A router with robots behind it, and the file of a desk."""

    def __init__(self, folder: Path, count: int, holding: ExitStack) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            endpoints = [f"tcp/127.0.0.1:{probe.getsockname()[1]}"]
        self.folder, self.desk = folder, str(folder / "desk.json5")
        (folder / "router.json5").write_text(json.dumps({"listen": {"endpoints": endpoints}}))
        (folder / "desk.json5").write_text(json.dumps({"connect": {"endpoints": endpoints}}))
        self._holding = holding
        runtime = holding.enter_context(tempfile.TemporaryDirectory(dir="/dev/shm"))
        self.environment = {**os.environ, "SILO_RUNTIME_DIR": runtime, "XDG_CONFIG_HOME": str(folder / "config")}
        self.router = self.begin([*SILO, "router", "--config", str(folder / "router.json5")])
        self.demos = [self.demo(f"demo{place}") for place in range(min(REAL, count))]
        self.begin([sys.executable, str(ROBOTS), self.desk, str(count - len(self.demos))], stdin=subprocess.PIPE)
        self.count = count

    def await_all(self) -> None:
        """Wait until all have come, and end the helper processes of the demos with this."""
        with Fleet(self.desk) as fleet:
            waited(lambda: sum(one.summary is not None for one in fleet.now().members) == self.count)
        for answer in surveyed(self.desk).members:
            if answer.status is not None and answer.found.name.startswith("demo"):
                self._holding.callback(_end, answer.status.helper_pid)

    def begin(self, command: list[str], **options: object) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            command, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.folder,
            **options,  # type: ignore[call-overload]
        )  # fmt: skip
        self._holding.callback(process.wait)
        self._holding.callback(process.kill)
        return process

    def demo(self, name: str) -> subprocess.Popen[bytes]:
        words = ["--name", name, "--config", self.desk, "--folder", str(self.folder / name)]
        return self.begin([*SILO, "demo", "--elements", "50", "--frequency", "100", *words])


def _end(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def waited(fact: Callable[[], object]) -> float:
    """Return how long it took until a fact; TimeoutError after a minute."""
    begun_s = time.monotonic()
    while not fact():
        if time.monotonic() - begun_s > MOST_S:
            raise TimeoutError
        time.sleep(0.01)
    return time.monotonic() - begun_s


def member(fleet: Fleet, name: str) -> Member:
    """Return what is known of a demo."""
    return next(one for one in fleet.now().members if one.found.name == name)


def ls_times(site: Site) -> tuple[list[float], list[float], list[float]]:
    """Return the seconds of `silo ls`, those of processor, and of what it asks in a process that runs already."""
    whole, used, asked = [], [], []
    for _ in range(5):
        begun_s, before = time.monotonic(), os.times()
        done = subprocess.run(
            [*SILO, "--config", site.desk, "ls"], env=site.environment, check=True, capture_output=True
        )
        whole.append(time.monotonic() - begun_s)
        after = os.times()
        used.append(after.children_user + after.children_system - before.children_user - before.children_system)
        assert len(done.stdout.splitlines()) == site.count + 1, done.stdout.decode()
        begun_s = time.monotonic()
        answers = surveyed(site.desk).members
        asked.append(time.monotonic() - begun_s)
        assert all(answer.status for answer in answers)
    return whole, used, asked


def screen_cost(site: Site) -> str:
    """Return what the list of silo-tui costs, and the router beside it."""
    environment = {**site.environment, "COLUMNS": "160", "LINES": "50"}
    terminal = Terminal([*SILO_TUI, "--config", site.desk], (160, 50), Link(), environment)
    try:
        first_s = terminal.until(shows(f"{site.count} loggers".encode()))
        terminal.rest(5.0)
        desk, router = psutil.Process(terminal.pid), psutil.Process(site.router.pid)
        begun_s, used, routed, sent = time.monotonic(), cpu_s(desk.pid), cpu_s(router.pid), len(terminal.seen)
        terminal.rest(LOOK_S)
        took_s = time.monotonic() - begun_s
        shares = [100 * (cpu_s(each.pid) - before) / took_s for each, before in ((desk, used), (router, routed))]
        sizes = [each.memory_info().rss / 1e6 for each in (desk, router)]
        sent = (len(terminal.seen) - sent) / took_s / 1000
    finally:
        terminal.end()
    return (
        f"list after {first_s:.1f} s; desk {shares[0]:.1f} % of a core, {sizes[0]:.0f} MB, {sent:.1f} kB/s to the "
        f"terminal; router {shares[1]:.1f} %, {sizes[1]:.0f} MB"
    )


def told_times(site: Site) -> str:
    """Return how soon one sees that a program was killed, a whole robot, and that one fell silent."""
    with Fleet(site.desk) as fleet:
        waited(lambda: sum(one.state is State.RUNNING for one in fleet.now().members) >= site.count)
        helpers = {}
        for name in ("demo0", "demo1", "demo2"):
            with Client.connect(member(fleet, name).found) as client:
                helpers[name] = client.status().helper_pid
        site.demos[0].kill()
        program_s = waited(lambda: member(fleet, "demo0").state is State.DEAD)
        os.kill(helpers["demo1"], signal.SIGKILL)
        site.demos[1].kill()
        robot_s = waited(lambda: not member(fleet, "demo1").here)
        os.kill(helpers["demo2"], signal.SIGSTOP)
        try:
            silent_s = waited(lambda: member(fleet, "demo2").lost)
        finally:
            os.kill(helpers["demo2"], signal.SIGCONT)
    return (
        f"killed program told after {program_s:.2f} s, killed robot {robot_s:.2f} s, silent link {silent_s:.2f} s "
        f"(lease {LEASE_S:g} s)"
    )


def main() -> None:
    """Print a row for each number of robots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, action="append", default=[], help="how many; 30 and 100")
    for count in parser.parse_args().robots or [30, 100]:
        # helper processes may still write what they save
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, ExitStack() as holding:
            site = Site(Path(folder), count, holding)
            site.await_all()
            load = os.getloadavg()[0]
            whole, used, asked = ls_times(site)
            print(
                f"{count} robots (load {load:.1f}): ls {statistics.median(whole):.2f} s (fastest {min(whole):.2f}), "
                f"{statistics.median(used):.2f} s of processor; of it asking {statistics.median(asked):.2f} s (fastest "
                f"{min(asked):.2f})"
            )
            print(f"  {screen_cost(site)}")
            print(f"  {told_times(site)}; load now {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
