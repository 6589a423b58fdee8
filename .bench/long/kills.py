"""Kills robot programs and their helpers, and looks for what was lost: `python .bench/long/kills.py [--kills 500]`.

A third of the kills take the robot program alone, a third robot program and helper together (one is stopped while the
other is killed, so that neither sees the other's end), a third come within 50 ms of a start. They hit loggers that run,
start, restart and save, with looping, fixed and growing buffers, served and not, in memory and on disk. After each, the
silo command comes that a user would give next: `silo ls`, `silo recover`, or the same program again; then, where data
is still kept, `silo recover`.

- torn: saved samples that are not what the program had logged.
- lost: kills after which a committed tick stands in no file.
- not announced: those of them, and recordings kept, of which no output said a word.
- false: kills after which a file lacks samples that its buffers had.
- left over: kills after which the runtime folder or the log folder holds more than files after that command. A
  recording that the command announced, in memory or in a journal, is kept on purpose until `silo recover`; the journal
  of a kept segment too. After `silo recover` nothing of either may be there.

Each kill is told by its number: `--seed S --only N` does one again. Exits with 1 if any figure is not 0.
"""

import argparse
import contextlib
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import psutil
from numpy.typing import NDArray
from processes import ROBOT, end_process, gone, show, signal_process, silo_command, wait_until, workplace
from robot import Case
from truth import (
    PHASE,
    RESTARTING,
    RUN_FIRST,
    RUNNING,
    SAID,
    SAVING,
    STARTING,
    STARTS,
    PhaseError,
    look,
    new_page,
)

from silo.journal.format import journals_of
from silo.net.session import SOCKET_SUFFIX, owner_is_gone
from silo.recovery.journals import left_journals
from silo.segment.reader import SegmentReader

VICTIMS = ("robot", "both", "early")
MOMENTS = {"running": RUNNING, "starting": STARTING, "restarting": RESTARTING, "saving": SAVING}
COMMANDS = ("ls", "recover", "again")
SPREAD_S = {"running": 0.4, "starting": 0.01, "restarting": 0.01, "saving": 0.06}
EARLY_S = 0.05
PHASE_TIMEOUT_S = 60.0
SETTLE_S = 40.0
Page = NDArray[np.int64]
ANNOUNCED = re.compile(r"lost|not (be )?saved|in no file|could not|can't be|are gone|nothing was logged|kept in")
KEPT = re.compile(r"silo recover|recovered|predecessor|before it|ended without close")


@dataclass(frozen=True)
class Kill:
    """One kill: what is hit, when, in which setting, and what the user does next."""

    number: int
    victim: str
    moment: str
    delay_s: float
    served: str
    buffer: str
    divider: int
    size: int
    storage: str
    types: str
    command: str

    @property
    def text(self) -> str:
        """Fit to show."""
        return (
            f"kill {self.number}: {self.victim} {self.moment} +{1e3 * self.delay_s:.1f} ms, served {self.served}, "
            f"{self.buffer} {self.size} /{self.divider} in {self.storage}, then {self.command}"
        )


@dataclass
class Outcome:
    """What a kill did."""

    kill: Kill
    torn: int = 0
    lost: bool = False
    silent: bool = False
    false: bool = False
    left: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def draw(number: int, seed: int) -> Kill:
    """The kill of a number, always the same for a seed."""
    chance = random.Random(f"{seed}-{number}")
    victim = VICTIMS[number % 3]
    moment = "starting" if victim == "early" else chance.choice(["running", "running", "restarting", "saving"])
    # half of the early kills hit the start itself, which takes some milliseconds
    spread_s = chance.choice([EARLY_S, SPREAD_S["starting"]]) if victim == "early" else SPREAD_S[moment]
    return Kill(
        number=number,
        victim=victim,
        moment=moment,
        delay_s=chance.uniform(0, spread_s),
        served=chance.choice(["before", "before", "after", "no"]),
        buffer=chance.choice(["looping", "fixed", "growing"]),
        divider=chance.choice([1, 1, 2, 5]),
        size=chance.choice([50, 400, 3000]),
        storage=chance.choice(["memory", "memory", "disk", "file"]),
        types=chance.choice(["silo", "silo", "csv", "bag"]),
        command=chance.choice(COMMANDS),
    )


def case_of(kill: Kill, folder: Path) -> Case:
    """What the robot program does until it is killed."""
    serve_first = ["serve"] if kill.served == "before" else []
    serve_later = ["serve"] if kill.served == "after" else []
    again = {"restarting": ["restart"], "saving": [f"save {kill.types}"]}.get(kill.moment, [])
    return Case(
        name="killed",
        folder=str(folder / "logs"),
        page=str(folder / "page"),
        buffer=kill.buffer,
        size=kill.size,
        divider=kill.divider,
        storage=kill.storage,
        steps=[*serve_first, "start", *serve_later, "ticks 3"],
        repeat=["seconds 0.1", *again],
    )


def perform(kill: Kill) -> Outcome:
    """Do one kill and look at what is left."""
    with workplace() as (folder, environment):
        page = new_page(folder / "page")
        said_path = folder / "said.txt"
        case = case_of(kill, folder)
        with said_path.open("w+") as said:
            command = [sys.executable, str(ROBOT), case.text]
            robot = subprocess.Popen(command, env=environment, stdout=said, stderr=subprocess.STDOUT, text=True)
        try:
            helpers = _strike(kill, robot, page)
            if not helpers:  # a process that was killed keeps what it holds until its last thread has ended
                sockets = [*(folder / "run").glob(f"*{SOCKET_SUFFIX}")]
                wait_until(lambda: all(map(owner_is_gone, sockets)), SETTLE_S, 0.001)
        finally:
            robot.kill()
            robot.wait()
        outcome = Outcome(kill)
        for helper in helpers:
            wait_until(partial(_has_saved, helper, said_path), SETTLE_S, 0.02)
        texts = [said_path.read_text()]
        texts.append(_next_command(kill, case, folder, environment))
        for helper in helpers:
            if not end_process(helper):
                outcome.notes.append("the helper did not end by SIGTERM")
        _judge(outcome, page.copy(), folder, environment, [*texts, said_path.read_text()])
        return outcome


def _has_saved(helper: int, said_path: Path) -> bool:
    """Whether a helper is done with what its robot program left; one that saved says so and stays a while."""
    return gone(helper) or "ended without close" in said_path.read_text()


def _strike(kill: Kill, robot: "subprocess.Popen[str]", page: Page) -> list[int]:
    """Kill at the moment; returns the helpers that live on (those that were killed have ended)."""
    # a logger served after its start is "running" before its helper is there: that is a kill worth having, too
    phase = MOMENTS[kill.moment]
    started = kill.moment == "starting" or wait_until(
        lambda: page[STARTS] > 0 or robot.poll() is not None, PHASE_TIMEOUT_S
    )
    # a start may be over before it is seen; the other phases come again
    if not started or not wait_until(
        lambda: page[PHASE] == phase or robot.poll() is not None or phase == STARTING < page[PHASE],
        PHASE_TIMEOUT_S,
        0.0002,
    ):
        raise PhaseError(f"{kill.text}: the robot program did not come so far, phase {page[PHASE]}")
    if robot.poll() is not None:
        raise PhaseError(f"{kill.text}: the robot program ended with {robot.returncode}")
    time.sleep(kill.delay_s)
    signal_process(robot.pid, signal.SIGSTOP)
    helpers = [child.pid for child in psutil.Process(robot.pid).children(recursive=True)]
    if kill.victim == "both" or (kill.victim == "early" and kill.number % 2):
        for helper in helpers:
            signal_process(helper, signal.SIGKILL)
        helpers = []
    robot.kill()
    robot.wait()
    return helpers


def _next_command(kill: Kill, case: Case, folder: Path, environment: dict[str, str]) -> str:
    """What the user does next, and what is said to it."""
    logs = folder / "logs"
    if kill.command != "again":
        done = silo_command([kill.command], environment, logs)
        return done.stdout + done.stderr
    new_page(folder / "page2")
    steps = ["serve", "start", "ticks 5", "save silo", "close"]
    case = Case(
        name=case.name,
        folder=case.folder,
        page=str(folder / "page2"),
        storage=case.storage,
        steps=steps,
        size=case.size,
    )
    command = [sys.executable, str(ROBOT), case.text]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False, cwd=logs)
    text = done.stdout + done.stderr
    own = [line.split(maxsplit=2)[2] for line in text.splitlines() if line.startswith("saved ")]
    for path in own:
        Path(path).unlink()  # the second program's own log is not what is looked for
    return text if not done.returncode else f"{text}\nthe second program ended with {done.returncode}"


def _judge(outcome: Outcome, page: Page, folder: Path, environment: dict[str, str], texts: list[str]) -> None:
    kill = outcome.kill
    logs = folder / "logs"
    kept = _segments(folder)
    outcome.left = _litter(folder)
    said = "\n".join(texts)
    if kept:
        if kill.command == "recover":
            outcome.left += [path.name for path in kept]
        elif _holds_data(page) and not KEPT.search(texts[1]):
            outcome.silent = True
            outcome.notes.append("a recording is kept, and the next command doesn't say so")
        last = silo_command(["recover"], environment, logs)
        said += last.stdout + last.stderr
        outcome.left += [str(path.relative_to(folder)) for path in _segments(folder)]
        outcome.left += [name for name in _litter(folder) if name not in outcome.left]
    _look_at_files(outcome, page, logs, [texts[0], said])
    if "Traceback" in said.replace("the error of this robot", ""):
        outcome.notes.append("a traceback: " + said[said.index("Traceback") :][:600])


def _holds_data(page: Page) -> bool:
    return bool(page[SAID] > page[RUN_FIRST])


def _segments(folder: Path) -> list[Path]:
    """Recordings that are kept: segments in memory and on disk, and journals whose segment is gone."""
    found = [*folder.glob("run/*.segment"), *folder.glob("logs/.*.segment")]
    orphans = {one.path for one in left_journals(folder / "logs") if one.holdings and one.ticks}
    there = [path for path in found if not path.name.endswith(".new") and path.exists()]  # no link to one that is gone
    return [*there, *sorted(orphans)]


def _needed_journals(folder: Path) -> set[Path]:
    """The journals of segments that are kept: a power cut would take these."""
    needed = set()
    for path in _segments(folder):
        if not path.is_dir():
            with contextlib.closing(SegmentReader(path)) as reader:
                needed.update(journals_of(reader.schema, folder / "logs"))
    return needed


def _litter(folder: Path) -> list[str]:
    """What is neither a file that was saved nor a recording."""
    kept = {*_segments(folder), *_needed_journals(folder)}
    # the number of the next file, kept between programs, and what happened, which outlives them
    own = re.compile(r"\.\w+(_fileNumber|\.events(\.1)?\.jsonl)$")
    hidden = [path for path in (folder / "logs").iterdir() if path.name.startswith(".") or ".part" in path.name]
    hidden = [path for path in hidden if not own.match(path.name)]
    found = [*(folder / "run").iterdir(), *hidden]
    return [str(path.relative_to(folder)) for path in found if path not in kept]


def _look_at_files(outcome: Outcome, page: Page, logs: Path, texts: list[str]) -> None:
    """Torn and missing samples of every file, and whether the run that was killed stands in one."""
    kill = outcome.kill
    first, committed = int(page[RUN_FIRST]), int(page[SAID])
    newest = -1
    ends: dict[str, int] = {}
    for path in sorted(logs.iterdir()):
        if path.name.startswith(".") or path.suffix not in (".silo", ".csv", ".rosbag2"):
            continue
        try:
            found = look(path, kill.divider, kill.size if kill.buffer != "growing" else 0, first)
        except Exception as error:  # noqa: BLE001  # whatever a reader does with this file is the finding
            outcome.torn += 1
            outcome.notes.append(f"{path.name}: {type(error).__name__}: {error}")
            continue
        ends[str(path)] = found.last
        outcome.torn += found.torn
        if found.torn:
            outcome.notes.append(f"{path.name} has {found.torn} torn samples")
        newest = max(newest, found.last)
        if found.missing and not ANNOUNCED.search(found.says):
            outcome.false = True
            outcome.notes.append(f"{path.name} lacks {found.missing} samples")
    for tick, path in re.findall(r"^saved (\d+) (.+)$", texts[0], re.MULTILINE):
        if ends.get(path, -1) < int(tick) - 1:
            outcome.false = True
            outcome.notes.append(f"{path}: saved to tick {tick}, as was said, but holds {ends.get(path)}")
    if committed > first and newest < committed - 1:
        outcome.lost = True
        text = f"{committed - max(newest + 1, first)} of {committed - first} ticks are in no file"
        outcome.notes.append(text)
        outcome.silent |= not ANNOUNCED.search(texts[1])


def main() -> int:
    """Kill, and show what came of it; 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, action="append", help="do kill number N alone")
    parser.add_argument("--jobs", type=int, default=2, help="kills at a time")
    parser.add_argument("--minutes", type=float, default=120, help="begin no further kill after so long")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    numbers = options.only or range(options.kills)
    printing = threading.Lock()

    def one(number: int) -> Outcome | None:
        if time.monotonic() > end:
            return None
        kill = draw(number, options.seed)
        outcome = perform(kill)
        bad = outcome.torn or outcome.lost or outcome.silent or outcome.false or outcome.left or outcome.notes
        if bad:
            with printing:
                print(f"{kill.text}\n    left {outcome.left}; " + "; ".join(outcome.notes), flush=True)
        return outcome

    with ThreadPoolExecutor(options.jobs) as pool:
        outcomes = [outcome for outcome in pool.map(one, numbers) if outcome is not None]
    return _report(outcomes)


def _report(outcomes: list[Outcome]) -> int:
    rows: list[tuple[str, ...]] = [("victim", "kills", "torn", "lost", "not announced", "false", "left over")]
    total: Counter[str] = Counter()
    for victim in VICTIMS:
        some = [outcome for outcome in outcomes if outcome.kill.victim == victim]
        sums = {
            "kills": len(some),
            "torn": sum(outcome.torn for outcome in some),
            "lost": sum(outcome.lost for outcome in some),
            "silent": sum(outcome.silent for outcome in some),
            "false": sum(outcome.false for outcome in some),
            "left": sum(bool(outcome.left) for outcome in some),
        }
        total.update(sums)
        rows.append((victim, *map(str, sums.values())))
    rows.append(("all", *(str(total[key]) for key in ("kills", "torn", "lost", "silent", "false", "left"))))
    print(f"\nphases hit: {dict(Counter(outcome.kill.moment for outcome in outcomes))}")
    show(rows)
    return 1 if sum(total.values()) > total["kills"] else 0


if __name__ == "__main__":
    sys.exit(main())
