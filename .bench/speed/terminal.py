"""What silo-tui costs, seen from its terminal: `python .bench/speed/terminal.py [--link 8000 --delay 0.1]`.

A real demo robot and a real silo-tui under a pseudo-terminal. Per row: first paint; from a key to its answer on the
screen; processor time, bytes and frames a second while values are live. `--link N` puts N bytes a second and `--delay`
each way between them: bytes that silo-tui wrote wait in a buffer, as in ssh, which it can't see. Linux.
"""

import argparse
import fcntl
import os
import pty
import re
import select
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import termios
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from silo_tui import theme

ESCAPES = re.compile(rb"\x1b\[[0-?]*[ -/]*[@-~]|\x1b[()][0-9A-B]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)")
FRAME_START, FRAME_END = b"\x1b[?2026h", b"\x1b[?2026l"
ANSWERS = {b"\x1b[?2026$p": b"\x1b[?2026;2$y", b"\x1b[5n": b"\x1b[0n"}  # what a terminal is asked
BUFFER = 1 << 18  # of a link: as much is on its way at the most, what ssh and TCP hold
PIECE = 512  # bytes that arrive together
MOST_S = 90.0  # that anything is waited for
KEY_S = 15.0
NAME = "bench"


def cursor_line() -> re.Pattern[bytes]:
    """Return what a frame holds that shows a name on the line of the cursor: letters on its ground."""
    ground = theme.DARK.variables["line"].lstrip("#")
    red, green, blue = (int(ground[at : at + 2], 16) for at in (0, 2, 4))
    return re.compile(rb"48;2;%d;%d;%d[0-9;]*m(?:(?!48;2;).)*?[a-z_]{3}" % (red, green, blue), re.DOTALL)


@dataclass(frozen=True)
class Link:
    """What lies between: bytes a second (0: as many as come), and how long each way takes in seconds."""

    bytes_per_s: int = 0
    delay_s: float = 0.0


class Terminal:
    """A program in a pseudo-terminal behind a link. `seen` are the bytes that have arrived."""

    def __init__(self, command: list[str], size: tuple[int, int], link: Link, environment: dict[str, str]) -> None:
        self._link = link
        self._down: deque[tuple[float, bytes]] = deque()
        self._up: deque[tuple[float, bytes]] = deque()
        self._free_s, self._waiting = 0.0, 0
        self.seen = bytearray()
        self.began_s = time.monotonic()
        self.pid, self._fd = pty.fork()
        if self.pid == 0:
            os.execvpe(command[0], command, {**environment, "TERM": "xterm-256color", "COLORTERM": "truecolor"})
        fcntl.ioctl(self._fd, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
        self.open = True

    def press(self, keys: bytes) -> None:
        """Send keys; they arrive after the delay."""
        self._up.append((time.monotonic() + self._link.delay_s, keys))

    def step(self, seconds: float = 0.02) -> None:
        """Carry what is due; wait for more at the most so long."""
        now = time.monotonic()
        due = min([at for at, _ in (*list(self._down)[:1], *list(self._up)[:1])], default=now + seconds)
        readable = self.open and self._waiting < BUFFER
        if select.select([self._fd] if readable else [], [], [], max(0.0, min(seconds, due - now)))[0]:
            self._read()
        now = time.monotonic()
        while self._up and self._up[0][0] <= now and self.open:
            os.write(self._fd, self._up.popleft()[1])
        while self._down and self._down[0][0] <= now:
            at, data = self._down.popleft()
            self._waiting -= len(data)
            before = len(self.seen)
            self.seen += data
            for query, answer in ANSWERS.items():
                for _ in range(self.seen.count(query, max(0, before - len(query) + 1))):
                    self._up.append((at + self._link.delay_s, answer))

    def _read(self) -> None:
        try:
            data = os.read(self._fd, 1 << 16)
        except OSError:
            data = b""
        self.open = bool(data)
        self._waiting += len(data)
        for begin in range(0, len(data), PIECE):
            piece = data[begin : begin + PIECE]
            took_s = len(piece) / self._link.bytes_per_s if self._link.bytes_per_s else 0.0
            self._free_s = max(self._free_s, time.monotonic()) + took_s
            self._down.append((self._free_s + self._link.delay_s, piece))

    def until(self, fact: Callable[[bytes], object], most_s: float = MOST_S) -> float:
        """Wait for a fact of what arrives from now on and return the seconds it took; TimeoutError: what is there."""
        begin_s, begin = time.monotonic(), len(self.seen)
        while not fact(bytes(self.seen[begin:])):
            self.step()
            if not self.open or time.monotonic() > begin_s + most_s:
                raise TimeoutError(f"not within {most_s:g} s: {ESCAPES.sub(b'', bytes(self.seen[-2000:]))[-300:]!r}")
        return time.monotonic() - begin_s

    def rest(self, seconds: float) -> None:
        """Let time pass."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.step()

    def end(self) -> None:
        """Quit the program, or kill it."""
        self.press(b"\x11")
        for patience_s, number in ((5.0, signal.SIGTERM), (5.0, signal.SIGKILL)):
            until_s = time.monotonic() + patience_s
            while time.monotonic() < until_s:
                self.step()
                if os.waitpid(self.pid, os.WNOHANG)[0]:
                    os.close(self._fd)
                    return
            os.kill(self.pid, number)
        os.waitpid(self.pid, 0)
        os.close(self._fd)


def cpu_s(pid: int) -> float:
    """Return the processor time of one process, all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def shows(*words: bytes) -> Callable[[bytes], bool]:
    """Return a fact: all words have arrived."""
    return lambda data: all(word in (plain := ESCAPES.sub(b"", data)) for word in words) and bool(plain)


def key_times(terminal: Terminal, presses: int) -> list[float]:
    """Return the seconds from a key that moves the cursor to the end of the frame that shows its line."""
    line, found = cursor_line(), []

    def answered(data: bytes) -> bool:
        at = data.find(FRAME_START)
        match = line.search(data, at) if at >= 0 else None
        return match is not None and data.find(FRAME_END, match.end()) >= 0

    for press in range(presses):
        terminal.rest(0.15)
        terminal.press(b"j" if press % 40 < 20 else b"k")  # within one screen: no line scrolls
        try:
            found.append(terminal.until(answered, KEY_S))
        except TimeoutError:
            found.append(KEY_S)
    return found


def live(terminal: Terminal, seconds: float) -> tuple[float, float, float]:
    """Return the share of a core, kB/s and frames/s while values are live."""
    begin_s, begin, used_s = time.monotonic(), len(terminal.seen), cpu_s(terminal.pid)
    terminal.rest(seconds)
    span_s, data = time.monotonic() - begin_s, bytes(terminal.seen[begin:])
    return (cpu_s(terminal.pid) - used_s) / span_s, len(data) / span_s / 1e3, data.count(FRAME_START) / span_s


HEAD = f"{'screen':<12}{'size':>8}{'elements':>9}{'first s':>9}{'key p50':>9}{'p99 ms':>8}{'core %':>8}{'kB/s':>7}"
HEAD += f"{'frames/s':>10}{'load':>6}"


def row(
    screen: str, size: tuple[int, int], elements: int, first_s: float | None, keys: list[float], seen: tuple[float, ...]
) -> str:
    """Return a line of the table."""
    ranked = [1e3 * each for each in sorted(keys)]
    middle = f"{statistics.median(ranked):.0f}" if ranked else "-"
    worst = f"{ranked[min(len(ranked) - 1, int(0.99 * len(ranked)))]:.0f}" if ranked else "-"
    first = f"{first_s:.2f}" if first_s is not None else "-"
    core, rate, frames = seen
    return (
        f"{screen:<12}{f'{size[0]}x{size[1]}':>8}{elements:>9}{first:>9}{middle:>9}{worst:>8}{100 * core:>8.1f}"
        f"{rate:>7.1f}{frames:>10.1f}{os.getloadavg()[0]:>6.1f}"
    )


@contextmanager
def robot(elements: int, environment: dict[str, str], folder: str) -> Iterator[None]:
    """Run the demo robot of so many elements; it is there when this begins."""
    code = "from silo.cli import main; main()"
    command = [sys.executable, "-c", code, "demo", "--name", NAME, "--folder", folder, "--elements", str(elements)]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, start_new_session=True)
    try:
        assert process.stdout and b"running" in process.stdout.readline()  # a few lines follow, which the pipe holds
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(60)


def measure(size: tuple[int, int], elements: int, options: argparse.Namespace, environment: dict[str, str]) -> None:
    """Print a row for the table, and one per number of plots."""
    command = [sys.executable, "-m", "silo_tui", NAME, "--rate", f"{options.rate:g}"]
    link = Link(options.link, options.delay)
    terminal = Terminal(command, size, link, environment)
    try:
        first_s = terminal.until(shows(b"RUNNING", b"Quit", b"elem" if size[0] >= 100 else b" on"))
        first_s = time.monotonic() - terminal.began_s
        terminal.rest(options.warm)
        seen = live(terminal, options.seconds)
        print(row("table", size, elements, first_s, key_times(terminal, options.presses), seen), flush=True)
    finally:
        terminal.end()
    for plots in options.plots:
        terminal = Terminal(command, size, link, environment)
        try:
            terminal.until(shows(b"RUNNING", b"Quit"))
            terminal.press(b"ol")
            terminal.rest(1.0)
            terminal.press(b" " * plots)
            terminal.rest(1.0)
            terminal.press(b"m")
            terminal.until(shows(b"shown"))
            terminal.rest(options.warm)
            print(row(f"{plots} plots", size, elements, None, [], live(terminal, options.seconds)), flush=True)
        finally:
            terminal.end()


def numbers(text: str) -> list[int]:
    """Return the numbers of `4,16`."""
    return [int(part) for part in text.split(",") if part]


def main() -> None:
    """Measure all rows that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="80x24,160x50")
    parser.add_argument("--elements", type=numbers, default=[500, 10_000])
    parser.add_argument("--plots", type=numbers, default=[4, 16])
    parser.add_argument("--rate", type=float, default=5.0, help="frames a second that are wished")
    parser.add_argument("--seconds", type=float, default=6.0, help="how long each row is measured")
    parser.add_argument("--warm", type=float, default=3.0, help="seconds before that")
    parser.add_argument("--presses", type=int, default=40)
    parser.add_argument("--link", type=int, default=0, help="bytes a second of a thin link, 0: none")
    parser.add_argument("--delay", type=float, default=0.0, help="seconds each way")
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # what is installed is compiled: no start compiles 200 modules
    told = f", {options.link} bytes/s" if options.link else ""
    told += f", {options.delay:g} s each way" if options.delay else ""
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before{told}\n{HEAD}", flush=True)
    for elements in options.elements:
        with tempfile.TemporaryDirectory(prefix="silo-bench-") as folder:
            private = {name: f"{folder}/{name}" for name in ("SILO_RUNTIME_DIR", "XDG_CONFIG_HOME", "XDG_STATE_HOME")}
            for path in private.values():
                os.mkdir(path, 0o700)  # noqa: PTH102
            with robot(elements, {**os.environ, **private}, folder):
                for size in options.sizes.split(","):
                    columns, lines = map(int, size.split("x"))
                    measure((columns, lines), elements, options, {**os.environ, **private})


if __name__ == "__main__":
    main()
