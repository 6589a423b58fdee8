"""Takes the pictures of README and guide, and the cast of a terminal, from the program as it is now.

    python .docs/pictures/take.py [FOLDER]

`table.svg` and `monitor.svg` are drawn by silo-tui itself, on a simulated robot. `silo-tui.cast` is what a terminal of
100x30 was sent while somebody typed the keys below: `asciinema play .docs/pictures/silo-tui.cast`. Nothing is
downloaded, no font is embedded.
"""

import asyncio
import codecs
import fcntl
import json
import os
import pty
import re
import select
import struct
import sys
import tempfile
import termios
import time
from pathlib import Path

COLUMNS, LINES = 100, 30
STILL = (120, 36)
ASKED, ANSWERED = "\x1b[5n", b"\x1b[0n"
SHOWN = "RUNNING"  # what the table begins with
DEADLINE_S = 90.0
# seconds to wait, then the keys
PLAY = (
    (2.0, "/"), (0.5, "torque"), (0.8, "\r"), (0.8, "*"), (0.8, "e"), (0.6, "d"), (0.6, "2\r"), (1.2, "u"), (0.8, "m"),
    (3.0, "j"), (0.5, "j"), (1.5, " "), (1.0, "h"), (0.3, "h"), (0.3, "h"), (1.5, "\r"), (2.0, "\t"), (1.5, "\x1b"),
    (0.8, " "), (1.0, "\x1b"), (1.0, "?"), (2.0, "\x1b"), (0.8, "q"),
)  # fmt: skip


async def stills(folder: Path) -> None:
    """Draw the table and the monitor."""
    from silo_tui.app import SiloApp
    from silo_tui.screens.exporting import picture
    from silo_tui.sessions.demo import Demo
    from silo_tui.sessions.finder import ClientFinder

    demo = Demo()
    app = SiloApp(ClientFinder(), demo=demo)

    def keep(name: str) -> None:
        # fonts that a browser would load from elsewhere; every reader has a monospaced one
        drawn = re.sub(r"@font-face\s*\{[^}]*\}", "", picture(app))
        (folder / name).write_text("\n".join(line.rstrip() for line in drawn.splitlines()) + "\n")

    try:
        async with app.run_test(size=STILL) as pilot:
            while not (app.context.has_session and app.context.session.live.readings):
                await pilot.pause(0.1)
            await pilot.press("j", "space", "j", "space", "j", "space", "e", "t", "e", "d", "5", "enter")
            await pilot.pause(3)
            keep("table.svg")
            await pilot.press("u", "u", "m")
            await pilot.pause(8)
            keep("monitor.svg")
    finally:
        app.release()
        demo.stop()


def cast(path: Path, command: list[str]) -> None:
    """Record what a terminal is sent: asciinema's format 2, a line of JSON per piece."""
    child, screen = pty.fork()
    if child == 0:
        os.environ |= {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
        os.execvp(command[0], command)
    fcntl.ioctl(screen, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
    begin_s = time.monotonic()
    pieces: list[list[object]] = []
    play = list(PLAY)
    due_s = float("inf")  # until the table is there
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    while True:
        wait_s = min(1.0, max(0.0, due_s - time.monotonic()))
        if select.select([screen], [], [], wait_s)[0]:
            try:
                data = os.read(screen, 65536)
            except OSError:  # the child has ended
                break
            if not data:
                break
            text = decoder.decode(data)
            for _ in range(text.count(ASKED)):  # how far the terminal has read: one that never says is taken for slow
                os.write(screen, ANSWERED)
            if due_s == float("inf") and SHOWN in text:
                due_s = time.monotonic() + play[0][0]
            pieces.append([round(time.monotonic() - begin_s, 3), "o", text])
        if play and time.monotonic() >= due_s:
            os.write(screen, play.pop(0)[1].encode())
            due_s = time.monotonic() + (play[0][0] if play else DEADLINE_S)
        if time.monotonic() > begin_s + DEADLINE_S:
            raise SystemExit("silo-tui showed no table, or did not end")
    os.close(screen)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code:
        said = "".join(str(text) for _, _, text in pieces[-5:])
        raise SystemExit(f"silo-tui ended with exit code {code}: {said}")
    head = {"version": 2, "width": COLUMNS, "height": LINES, "title": "silo-tui", "env": {"TERM": "xterm-256color"}}
    path.write_text("\n".join(json.dumps(line, ensure_ascii=False) for line in (head, *pieces)) + "\n")


def main(folder: Path) -> None:
    """Take all of them, with settings and loggers of nobody else."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as runtime, tempfile.TemporaryDirectory() as work:
        os.environ |= {"SILO_RUNTIME_DIR": runtime, "XDG_CONFIG_HOME": work, "XDG_STATE_HOME": work}
        os.environ.pop("NO_COLOR", None)
        folder = folder.resolve()
        os.chdir(work)
        tui = [sys.executable, "-c", "from silo_tui.cli import main; main()"]
        asyncio.run(stills(folder))
        cast(folder / "silo-tui.cast", [*tui, "--demo"])
    for name in ("table.svg", "monitor.svg", "silo-tui.cast"):
        print(f"{name}: {(folder / name).stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
