#!/usr/bin/env python3
"""Type what README and guide tell to type for the first look, and for robots elsewhere, into a fresh environment.

    python .ci/blocks.py

README's first command makes the environment, whose silo does all else. Then one desk, a router and robots are folders
of this computer, which talk by its loopback: in a network, and with host names, of their own. Of the pages only `scp`
is another program: it copies to the folder of that host. Needs root, `unshare`, `ip` and `openssl`.
"""

import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INSIDE = "SILO_BLOCKS_PLACE"  # set in the network of its own: where the folders are
DEADLINE_S = 300.0
SCP = """#!/bin/sh
# scp [-r] FILE... HOST:[PATH]
for to; do :; done
host=${to%%:*}; path=${to#*:}
cp -r $(echo "$@" | sed "s| $to$||; s|^-r ||") "$SILO_BLOCKS_PLACE/${host%.local}/$path"
"""
PROGRAM = """
import time
import silo
with silo.Logger("anymal", frequency=100, folder="logs") as log:
    q = log.array("q", 3, action="both")
    log.start()
    {serve}
        while True:
            q += 0.01
            log.collect()
            time.sleep(0.01)
"""


def blocks(page: str, heading: str = "", kind: str = "bash") -> list[list[str]]:
    """The lines of each block of a page, below a heading where one is given."""
    text = (ROOT / page).read_text()
    if heading:
        text = text.split(f"## {heading}\n")[1].split("\n## ")[0]
    return [block.splitlines() for block in re.findall(rf"```{kind}\n(.*?)```", text, re.S)]


class Host:
    """A folder as a computer: its user has nothing of ours but the path, and the host name where programs go on."""

    def __init__(self, place: Path, name: str, programs: Path) -> None:
        self.folder, self.name = place / name, name
        (self.folder / "run").mkdir(mode=0o700, parents=True, exist_ok=True)
        own = {"HOME": str(self.folder), "SILO_RUNTIME_DIR": str(self.folder / "run"), "TERM": "xterm-256color"}
        self.environment = {"PATH": f"{place / 'bin'}:{programs}:{os.environ['PATH']}", "LANG": "C.UTF-8", **own}
        self.environment |= {f"XDG_{kind}_HOME": str(self.folder / kind) for kind in ("CONFIG", "STATE")}
        self.environment[INSIDE] = str(place)

    def typed(self, line: str, until: str = "") -> None:
        """Type a line; one that goes on is ended once `until` is seen on its screen."""
        print(f"[{self.name}] {line}", flush=True)
        pid, screen = pty.fork()
        if not pid:
            os.chdir(self.folder)
            os.execvpe("bash", ["bash", "-c", f"stty cols 80 rows 24; {line}"], self.environment)
        said, ends_s, asked = "", time.monotonic() + DEADLINE_S, False
        while time.monotonic() < ends_s:
            if not select.select([screen], [], [], 1)[0]:
                continue
            try:
                said += os.read(screen, 4096).decode(errors="replace")
            except OSError:  # the program has ended
                break
            if until and until in said and not asked:
                asked = bool(os.write(screen, b"qy"))  # a demo that ends with it is asked for
        else:
            os.kill(pid, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        os.close(screen)
        if code or until not in said:
            sys.exit(f"blocks: '{line}' ended with {code}:\n{said[-2000:]}")

    def begin(self, *words: str) -> None:
        """Begin a program that goes on, as on a computer of this name."""
        print(f"[{self.name}] {words[-1].strip().splitlines()[-1] if len(words) == 3 else ' '.join(words)}", flush=True)
        shell = f'hostname {self.name}; exec "$@"'
        command = ["unshare", "--uts", "sh", "-c", shell, "sh", *words]
        subprocess.Popen(command, cwd=self.folder, env=self.environment)


def serving(serve: str) -> str:
    """The program of a robot, with the words of a page that serve it."""
    return PROGRAM.format(serve=serve.replace("\n    ...", ""))


def seen(desk: Host) -> None:
    """Wait until the robot of the pages is seen from the desk."""
    desk.typed("for i in $(seq 60); do silo ls robot3/anymal >/dev/null 2>&1 && break; sleep 0.5; done")


GUIDE, FLEET, COMMANDS = ".docs/guide/elsewhere.md", ".docs/how-to/fleet.md", ".docs/how-to/commands.md"


def one_robot(page: str, heading: str, place: Path, programs: Path) -> None:
    """The blocks of a page on one robot and a desk."""
    desk, robot = (Host(place, one, programs) for one in ("desk", "robot3"))
    (serve,) = blocks(GUIDE, "One robot", "python")
    for line in [line for block in blocks(page, heading)[: 2 if page == GUIDE else 1] for line in block]:
        adds = line.startswith("silo remote add")
        if adds:  # what the robot needs has come to it by now
            if not (robot.folder / "silo-lab").exists():
                desk.typed("scp -r lab/server robot3.local:silo-lab")
            shutil.copy(desk.folder / "lab/clients/alice.json5", desk.folder)
            robot.begin(f"{programs}/python", "-c", serving("\n".join(serve)))
        desk.typed(line, "anymal" if line.startswith("silo-tui") else "")
        if adds:
            seen(desk)
    if page == GUIDE:
        desk.typed("silo remote doctor lab")
        for line in blocks(page, "One operator at a time")[0]:
            desk.typed(line)


def many_robots(place: Path, programs: Path) -> None:
    """The block on robots behind a router; what its comments say is done there."""
    desk, router, robot = (Host(place, one, programs) for one in ("desk", "router", "robot3"))
    *now, later = blocks(GUIDE, "Many robots")[0]
    for line in now:
        desk.typed(line)
        if there := re.search(r"# there: (.*)", line):
            router.begin(*there[1].split())
        elif program := re.search(r"# in its program: (.*)", line):
            robot.begin(f"{programs}/python", "-c", serving(f"with {program[1]}:"))
    desk.typed("silo remote add lab lab/clients/alice.json5")
    seen(desk)
    desk.typed("silo ls robot3/anymal")
    desk.typed(later)


def inside(which: str, place: Path, programs: Path) -> None:
    """One of them, in the network that was made for it."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    hosts = place / "hosts"
    hosts.write_text("127.0.0.1 localhost robot3.local router.local\n")
    subprocess.run(["mount", "--bind", hosts, "/etc/hosts"], check=True)
    if which == "many":
        many_robots(place, programs)
    else:
        one_robot(which, {GUIDE: "One robot", COMMANDS: "From another computer"}.get(which, ""), place, programs)


def main() -> None:
    """README's first command, then each of the others in a network of its own."""
    if place := os.environ.get(INSIDE):
        inside(sys.argv[1], Path(place), Path(place).parent / "fresh/bin")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as made:
        place = Path(made)
        demo = re.search(r"<!-- demo -->\n```bash\n(.*?)\n```", (ROOT / "README.md").read_text(), re.S)
        newcomer = Host(place, "newcomer", ROOT)
        newcomer.typed(f"cd {ROOT} && {demo[1].replace('.venv', f'{made}/fresh')}", "RUNNING")
        for number, which in enumerate((GUIDE, FLEET, COMMANDS, "many")):
            (place / str(number) / "bin").mkdir(parents=True)
            scp = place / str(number) / "bin/scp"
            scp.write_text(SCP)
            scp.chmod(0o755)
            command = ["unshare", "--mount", "--net", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc"]
            environment = {**os.environ, INSIDE: str(place / str(number))}
            if subprocess.call([*command, sys.executable, __file__, which], env=environment):
                sys.exit(f"blocks: not all of {which} did what the page says (it needs root, unshare, ip, openssl)")
    print("blocks: all of them did what the pages say")


if __name__ == "__main__":
    main()
