"""What is told of a way to a robot that fails, by whom, and after how long: a cause in each layer, on two links.

    sudo python .bench/speed/ways.py [--delay 0 300] [--rows name route port ...]

A router, a robot and a desk are network namespaces of this computer (`tests/thin_net.py`), joined by a link with that
delay each way. Every cause is real but two: the version is that of a stand-in which answers as a newer silo would, and
the role is that of a user whom the rules admit to nothing. Prints a table; takes some minutes.
"""

import argparse
import json
import os
import pty
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from silo.cli.network import authority
from silo.cli.network.authority import make_network
from tests.thin_net import Computer, ThinNet, missing

SILO = [sys.executable, "-c", "from silo.cli.main import main; main()"]
TUI = [sys.executable, "-m", "silo_tui"]
ESCAPES = re.compile(rb"\x1b\[[0-9;?<>=]*[A-Za-z~]|\x1b\][^\x07]*\x07|\x1b[()=>].?")
TUI_PATIENCE_S = 60.0
NEWER = """
import json, sys, time, msgspec, zenoh
config = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
reply = msgspec.msgpack.encode({"type": "HelloReply", "protocol": 9, "oldest": 9, "version": "9.0.0"})
def answer(query):
    with query:
        query.reply("silo/robot~1111000001/newer/ask", reply)
asked = session.declare_queryable("silo/robot~1111000001/newer/ask", answer)
alive = session.liveliness().declare_token("silo/robot~1111000001/newer/alive")
print("ready", flush=True)
time.sleep(3600)
"""
# the cause, and words of its own message
CAUSES = {
    "fine": "walker",
    "name": "no computer is called",
    "route": "no way there",
    "port": "nobody listens on port",
    "authority": "not of the authority",
    "TLS name": "for another name",
    "TLS date": "not valid today",
    "password": "its password is refused",
    "role": "sees no logger",
    "version": "runs a newer silo",
}


class Site:
    """What runs, and a file for the desk with each cause."""

    def __init__(self, place: Path) -> None:
        self.net = ThinNet(place, ["router", "robot", "desk"])
        self.router, self.robot, self.desk = self.net.computers
        self._place, self.running = place, []
        users = {"anna": "operator", "robots": "robot"}
        host = self.router.address
        good = make_network(place / "good", [host], 7447, users)
        other = make_network(place / "other", [host], 7447, users)
        named = make_network(place / "named", ["robot3.elsewhere"], 7448, users)
        authority.ROBOT_DAYS = -1
        dated = make_network(place / "dated", [host], 7449, users)
        for made in (good, named, dated):
            self._router(made.server / "server.json5")
        self.way = json.loads(self._body(good.clients["anna"]))
        self.files = {
            "fine": self.way,
            "name": self._to("tls/robot..3:7447"),
            "route": self._to("tls/10.98.0.77:7447"),
            "port": self._to(f"tls/{host}:7999"),
            "authority": json.loads(self._body(other.clients["anna"])),
            "TLS name": json.loads(self._body(named.clients["anna"])) | self._end(f"tls/{host}:7448"),
            "TLS date": json.loads(self._body(dated.clients["anna"])),
            "password": json.loads(self._body(good.clients["anna"]).replace('"password": "', '"password": "x')),
            "role": json.loads(self._body(good.clients["robots"])),
            "version": self._end(f"tcp/{host}:7450"),
        }
        listening = {"mode": "peer", "listen/endpoints": [f"tcp/{host}:7450"], "scouting/multicast/enabled": False}
        self._start(self.router, [sys.executable, "-c", NEWER, json.dumps(listening)])
        shared = ["--config", str(good.clients["robots"]), "--folder", str(place / "logs"), "--name", "walker"]
        self._start(self.robot, [*SILO, "demo", "--elements", "30", *shared])

    @staticmethod
    def _body(file: Path) -> str:
        return "\n".join(line for line in file.read_text().splitlines() if not line.startswith("//"))

    @staticmethod
    def _end(endpoint: str) -> dict[str, object]:
        return {"connect": {"endpoints": [endpoint]}}

    def _to(self, endpoint: str) -> dict[str, object]:
        return self.way | self._end(endpoint)

    def _router(self, file: Path) -> None:
        self._start(self.router, [*SILO, "router", "--config", str(file)])

    def _start(self, computer: Computer, words: list[str]) -> None:
        null = subprocess.DEVNULL
        process = subprocess.Popen(
            computer.command(*words), env=computer.environment(), stdin=null, stdout=null, stderr=null
        )
        self.running.append(process)

    def choose(self, cause: str) -> None:
        """Make the remote `lab` of the desk the one with that cause."""
        folder = self.desk.place / "config" / "silo" / "remotes"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "lab.json5").write_text(json.dumps(self.files[cause]))

    def close(self) -> None:
        for process in self.running:
            process.terminate()
        for process in self.running:
            process.wait()
        self.net.__exit__(None, None, None)


def shell(site: Site, *words: str) -> tuple[float, int, str]:
    """Run a command on the desk; return how long it took, its exit code and what it said."""
    begun_s = time.monotonic()
    done = subprocess.run(
        site.desk.command(*SILO, *words), env=site.desk.environment(), capture_output=True, text=True, check=False
    )
    return time.monotonic() - begun_s, done.returncode, done.stdout + done.stderr


def screen(site: Site, words: str) -> float | None:
    """Start silo-tui on the desk; return after how long these words stand on its screen, None for never."""
    begun_s = time.monotonic()
    pid, terminal = pty.fork()
    if pid == 0:
        environment = site.desk.environment(TERM="xterm-256color", COLUMNS="160", LINES="50")
        command = site.desk.command(*TUI)
        os.execvpe(command[0], command, environment)
    seen, found = b"", None
    while found is None and time.monotonic() - begun_s < TUI_PATIENCE_S:
        if select.select([terminal], [], [], 0.1)[0]:
            try:
                seen += os.read(terminal, 65536)
            except OSError:
                break
            shown = b" ".join(ESCAPES.sub(b" ", seen).split())
            if words.encode() in shown:
                found = time.monotonic() - begun_s
    os.kill(pid, 15)
    os.waitpid(pid, 0)
    os.close(terminal)
    return found


def wait(ready: Callable[[], bool]) -> None:
    """Wait until something is so."""
    until_s = time.monotonic() + 60
    while not ready():
        assert time.monotonic() < until_s, "nothing came within 60 s"


def row(site: Site, cause: str) -> str:
    """Return a line of the table."""
    site.choose(cause)
    cells, words = [], CAUSES[cause]
    said = ""
    for command in (["remote", "doctor", "lab"], ["ls"]):
        took_s, code, told = shell(site, *command)
        right = words in " ".join(told.split())
        cells.append(f"{took_s:.1f} s, exit {code}{'' if right else ', ANOTHER MESSAGE'}")
        said = said or next((line.strip() for line in told.splitlines() if words in line), told.strip()[-150:])
    shown_s = screen(site, words)
    cells.append(f"{shown_s:.1f} s" if shown_s is not None else "never")
    return f"| {cause} | {' | '.join(cells)} | {said[:110].replace('|', '/')} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--delay", type=float, nargs="*", default=[0.0, 300.0], help="one way, ms")
    parser.add_argument("--rows", nargs="*", default=list(CAUSES), choices=list(CAUSES))
    chosen = parser.parse_args()
    if why := missing() or ("" if shutil.which("openssl") else "needs the command openssl"):
        sys.exit(why)
    with tempfile.TemporaryDirectory(prefix="silo-ways-", dir="/dev/shm") as place:
        site = Site(Path(place))
        try:
            site.choose("fine")
            wait(lambda: "walker" in shell(site, "ls")[2])
            for delay_ms in chosen.delay:
                site.net.delay_s = delay_ms / 1000
                print(f"\n{delay_ms:g} ms one way:\n")
                print("| cause | silo remote doctor | silo ls | silo-tui | message |\n| --- | --- | --- | --- | --- |")
                for cause in chosen.rows:
                    print(row(site, cause), flush=True)
        finally:
            site.close()


if __name__ == "__main__":
    main()
