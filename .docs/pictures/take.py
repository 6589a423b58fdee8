"""Takes the pictures of README and guide, and the cast of a terminal, from the program as it is now.

    python .docs/pictures/take.py [FOLDER]
    python .docs/pictures/take.py --look FOLDER [WORD]...

`table.svg` and `monitor.svg` are drawn by silo-tui itself, on a simulated robot. `silo-tui.cast` is what a terminal of
100x30 was sent while somebody typed the keys below: `asciinema play .docs/pictures/silo-tui.cast`. Nothing is
downloaded, no font is embedded.

`--look` draws each screen in each theme and size into a folder, to be looked at and compared before and after a change:
as SVG, and as PNG where chromium is installed. Words pick some: `table 80x24`, `16`.
"""

import asyncio
import codecs
import fcntl
import json
import os
import pty
import re
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path

COLUMNS, LINES = 100, 30
STILL = (120, 36)
LOOKED_AT = ((80, 24), (120, 35), (160, 50))
COLOURS = ("dark", "light", "contrast", "16")
# keys that lead from the table to each screen, empty to wait; the next one begins at the table again
SCREENS = {
    "table": ("j", "space", "e", "t"), "tree": ("o", "n"), "columns": ("v", "c"), "filter": ("slash", *"torque"),
    "inspector": ("v", "i"), "menu": ("e",), "order": ("o",), "look-at": ("v", "v"), "stop": ("S",),
    "plots": ("j", "j", "m"), "large": ("j", "m", "enter"), "scope": ("j", "m", "p", "c"),
    "x-y": ("j", "m", "enter", "p", "x"), "spectrum": ("j", "m", "enter", "p", "s"),
    "histogram": ("j", "m", "enter", "p", "h"), "derive": ("r", "d"), "record": ("r", "r"),
    "messages": ("e", "t", "g", "m"), "runs": ("w", "enter", "", "escape", "f3"),
    "file": ("w", "enter", "", "o"), "file-plots": ("w", "enter", "", "o", "", "j", "m"),
    "alarms": ("g", "a"), "triggers": ("g", "t"),
    "parameters": ("g", "p"), "recordings": ("g", "r"), "events": ("g", "e"), "settings": ("f2",),
    "help": ("question_mark",), "apply": ("j", "e", "t", "a"), "loggers": ("g", "l"), "save": ("w",),
    "limits": ("g", "a", "r", "n"), "trigger": ("g", "t", "r", "n"), "find": ("j", "m", "slash"),
    "condition": ("j", "m", "slash", "w"),
}  # fmt: skip
CELL = (10, 21)  # about, in pixels
ASKED, ANSWERED = "\x1b[5n", b"\x1b[0n"
ELSEWHERE = "/data/ann/robots"  # what a path of this machine is shown as
SHOWN = "RUNNING"  # what the table begins with
DEADLINE_S = 90.0
# seconds to wait, then the keys
PLAY = (
    (2.0, "/"), (0.5, "torque"), (0.8, "\r"), (0.8, "*"), (0.8, "e"), (0.6, "d"), (0.6, "2\r"), (1.2, "u"), (0.8, "m"),
    (3.0, "j"), (0.5, "j"), (1.5, " "), (1.0, "h"), (0.3, "h"), (0.3, "h"), (1.5, "\r"), (2.0, "\t"), (1.5, "\x1b"),
    (0.8, " "), (1.0, "\x1b"), (1.0, "?"), (2.5, "\x1b"), (1.0, "g"), (1.5, "t"), (1.5, "r"), (1.0, "t"), (2.0, "r"),
    (1.0, "f"), (3.0, "\r"), (2.5, "l"), (0.2, "l"), (0.2, "l"), (1.5, "\x1b"), (1.0, "g"), (1.0, "e"), (2.0, "\x1b"),
    (1.0, "w"), (2.0, "\r"), (3.0, "o"), (2.0, "m"), (3.0, "\x1b"), (1.0, "\x1b"), (1.0, "q"), (0.8, "y"),
)  # fmt: skip


async def stills(folder: Path) -> None:
    """Draw the table and the monitor."""
    from silo_tui.app import SiloApp
    from silo_tui.screens.dialogs.exporting import picture
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


async def looks(folder: Path, picked: list[str]) -> None:
    """Draw the screens that all of the words pick, in each theme and size."""
    from silo_tui.app import SiloApp
    from silo_tui.screens.dialogs.exporting import picture
    from silo_tui.sessions.demo import Demo
    from silo_tui.sessions.finder import ClientFinder
    from silo_tui.settings.options import Settings

    for size in LOOKED_AT:
        for colours in COLOURS:
            for name, keys in SCREENS.items():
                words = [name, f"{size[0]}x{size[1]}", colours]
                if not set(picked) <= set(words):
                    continue
                os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(
                    dir=Path.cwd()
                )  # nothing is taken up from the one before
                demo = Demo()
                app = SiloApp(ClientFinder(), demo=demo, settings=Settings(theme=colours))
                try:
                    async with app.run_test(size=size) as pilot:
                        while not (app.context.has_session and app.context.session.live.readings):
                            await pilot.pause(0.1)
                        for key in keys:
                            await pilot.press(*filter(None, [key]))
                            await pilot.pause(0.3 if key else 3)
                        await pilot.pause(3)
                        drawn = folder / f"{'-'.join(words)}.svg"
                        drawn.write_text(picture(app))
                finally:
                    app.release()
                    demo.stop()
                as_png(drawn, size)


def as_png(drawn: Path, size: tuple[int, int]) -> None:
    """Write what a browser makes of a picture beside it, where there is one."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        return
    window = f"--window-size={CELL[0] * size[0] * 5 // 4},{CELL[1] * size[1] * 5 // 4}"
    made = [f"--screenshot={drawn.with_suffix('.png')}", "--headless", "--no-sandbox", "--hide-scrollbars", window]
    subprocess.run([browser, *made, drawn.as_uri()], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


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
    elsewhere(str(Path.cwd()), pieces)
    head = {"version": 2, "width": COLUMNS, "height": LINES, "title": "silo-tui", "env": {"TERM": "xterm-256color"}}
    path.write_text("\n".join(json.dumps(line, ensure_ascii=False) for line in (head, *pieces)) + "\n")


def elsewhere(here: str, pieces: list[list[object]]) -> None:
    """Put a path of no machine in the place of this one, as long, so that frames stay; it may stand in two pieces."""
    there = ELSEWHERE[: len(here)].ljust(len(here), "s")
    for piece, after in zip(pieces, [*pieces[1:], [0, "o", ""]], strict=True):
        begin, end = str(piece[2]), str(after[2])
        both = (begin + end).replace(here, there)
        piece[2], after[2] = both[: len(begin)], both[len(begin) :]


def main(folder: Path, picked: list[str] | None = None) -> None:
    """Take all of them, or those to look at, with settings and loggers of nobody else."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as runtime, tempfile.TemporaryDirectory() as work:
        kept = f"{work}/kept"  # a folder `silo` where a program starts would be taken for the package
        os.environ |= {"SILO_RUNTIME_DIR": runtime, "XDG_CONFIG_HOME": kept, "XDG_STATE_HOME": kept}
        os.environ.pop("NO_COLOR", None)
        folder = folder.resolve()
        folder.mkdir(parents=True, exist_ok=True)
        os.chdir(work)
        if picked is not None:
            asyncio.run(looks(folder, picked))
            return
        tui = [sys.executable, "-c", "from silo_tui.cli import main; main()"]
        asyncio.run(stills(folder))
        cast(folder / "silo-tui.cast", [*tui, "--demo"])
    for name in ("table.svg", "monitor.svg", "silo-tui.cast"):
        print(f"{name}: {(folder / name).stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--look"] and len(sys.argv) > 2:
        main(Path(sys.argv[2]), sys.argv[3:])
    else:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
