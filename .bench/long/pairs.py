"""Pairs of deaths: `python .bench/long/pairs.py [--scenarios 500] [--seed 1] [--only N] [--jobs 2]`.

A robot program with a helper process, an endless recording, its standby, and a trigger; two of {program, helper,
recorder, standby, writer, closer, command} are killed, the second up to 2 s after the first, all pairs in turn, with
restarts at random times between and around. A program that is not killed ends by `close()`; the closer is who closes
what is left then of a recorder that is killed each time it is to end, and is killed in its turn. Then `silo ls` or
`silo recover` comes, as a user would call it next (the command: it is killed, too), and `silo recover`. Counted are,
against what the program itself wrote down:

- untold: ticks that were collected and stand in no part of the recording, nor does anything say that of them: neither a
  gap that `silo verify` says somebody told of, nor the ledger of the recorder of the run they are of, or of its end.
- lost: those, and the ones that somebody told to be lost.
- spikes: those without a capture, of which no event says why.
- twice: captures of one spike, ticks in two parts, fires told again.
- left over: files that stay after the last command, and processes.
- verify: what `silo verify` says is not as it should be, where the counting finds nothing, or the other way round.

Each scenario is told by its number: `--seed S --only N` does one again. Exits with 1 if any figure is not 0.
"""

import argparse
import contextlib
import itertools
import random
import re
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import psutil
from numpy.typing import NDArray
from pair_robot import CLOSED, MOST_RUNS, is_spike
from processes import SILO, end_process, gone, show, signal_process, silo_command, wait_until, workplace

import silo
from silo.core.elements import LoggedEvent
from silo.files.event_log import read_events
from silo.files.manifest import Written, read_written
from silo.verify.folder import Verified

ROBOT = Path(__file__).with_name("pair_robot.py")
MEMBERS = ("program", "helper", "recorder", "standby", "writer")
CLOSING = ("closer", "command")  # die when the program has ended: always second
PAIRS = (
    *itertools.permutations(MEMBERS, 2),
    *((one, one) for one in MEMBERS if one != "program"),
    *((one, closing) for closing in CLOSING for one in MEMBERS),
    CLOSING,
)
MOST_APART_S = 2.0
PATIENCE_S = 60.0
COMMAND_S = 1.2  # a command is killed before that, mostly amid its work
KEPT = re.compile(
    r"\.(pair|endless)_fileNumber|\.pair\.(events(\.1)?|captures)\.jsonl|\.endless\.recorder\.(json|lock)"
)
Page = NDArray[np.int64]


@dataclass(frozen=True)
class Scenario:
    """Who dies when, when the program restarts, and what the user does next."""

    number: int
    first: str
    second: str
    first_s: float
    apart_s: float
    restarts: tuple[float, ...]
    seconds: float
    command: str

    @property
    def text(self) -> str:
        """Fit to show."""
        restarts = ", ".join(f"{one:.2f}" for one in self.restarts)
        return (
            f"scenario {self.number}: {self.first} {self.first_s:.2f} s, {self.second} +{1e3 * self.apart_s:.0f} ms, "
            f"restarts [{restarts}], to {self.seconds:.2f} s, then {self.command}"
        )


@dataclass
class Outcome:
    """What came of one."""

    scenario: Scenario
    ticks: int = 0
    lost: int = 0
    untold: int = 0
    spikes: int = 0
    twice: int = 0
    left: list[str] = field(default_factory=list)
    verify: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def is_bad(self) -> bool:
        """Whether a promise is broken."""
        return bool(self.untold or self.spikes or self.twice or self.left or self.verify or self.notes)


def draw(number: int, seed: int) -> Scenario:
    """The scenario of a number, always the same for a seed."""
    chance = random.Random(f"{seed}-{number}")
    first, second = PAIRS[number % len(PAIRS)]
    first_s = chance.uniform(0.3, 1.5)
    # half of them so close that no successor is there yet
    apart_s = chance.choice([chance.uniform(0, 0.2), chance.uniform(0, MOST_APART_S)])
    end_s = first_s + apart_s + chance.choice([0.05, 0.5, 1.5])
    # around both deaths, as well as anywhere
    near = [first_s + chance.uniform(-0.1, 0.1), first_s + apart_s + chance.uniform(-0.1, 0.1)]
    anywhere = [chance.uniform(0.1, end_s) for _ in range(2)]
    restarts = sorted(chance.sample(near + anywhere, chance.randint(0, 4)))
    return Scenario(
        number, first, second, first_s, apart_s, tuple(max(0.05, one) for one in restarts), end_s,
        chance.choice(["ls", "recover"]),
    )  # fmt: skip


def perform(scenario: Scenario) -> Outcome:
    """Do one, and count."""
    with workplace() as (folder, environment):
        page: Page = np.memmap(folder / "page", np.int64, "w+", shape=(MOST_RUNS + 1,))
        said_path = folder / "said.txt"
        types = "silo,csv" if "writer" in (scenario.first, scenario.second) else "silo"
        command = [sys.executable, str(ROBOT), str(folder / "logs"), str(folder / "page"), types,
                   str(scenario.seconds), *map(str, scenario.restarts)]  # fmt: skip
        with said_path.open("w") as said:
            robot = subprocess.Popen(command, env=environment, stdout=said, stderr=subprocess.STDOUT, text=True)
        known: dict[int, str] = {}
        outcome = Outcome(scenario)
        try:
            _strike(scenario, robot, said_path, known, environment)
            if not wait_until(lambda: robot.poll() is not None, PATIENCE_S, 0.01):
                outcome.notes.append("the program did not end")
        finally:
            robot.kill()
            robot.wait()
        _settle(environment, outcome)
        texts = [said_path.read_text()]
        if scenario.second == "command":
            _begin_command(scenario, environment, folder / "logs")
        for words in ([scenario.command], ["recover"]):
            done = silo_command(words, environment, folder / "logs")
            texts.append(done.stdout + done.stderr)
        _end_all(environment, outcome)
        found = _verified(outcome, folder, environment)
        _count(outcome, np.array(page), folder, [*texts, said_path.read_text()], found)
        _hold_against(outcome, found)
        return outcome


def _processes(environment: dict[str, str]) -> list[psutil.Process]:
    """All processes of a scenario: they have its runtime folder."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            if _is_of(process, environment):
                found.append(process)
    return found


def _role(process: psutil.Process) -> str:
    with contextlib.suppress(psutil.Error, OSError):
        words = process.cmdline()
        if str(ROBOT) in words:
            return "program"
        if "silo.recordings.writing" in words:
            return "writer"
        if "silo.recorder" in words:
            if "--close" in words:
                return "closer"
            names = [str(one.readlink()) for one in Path(f"/proc/{process.pid}/fd").iterdir() if one.is_symlink()]
            return "recorder" if any(name.endswith(".recorder.lock") for name in names) else "standby"
        if any(word.startswith("silo.helper") for word in words):
            return "helper"
    return ""


def _find(role: str, robot: "subprocess.Popen[str]", killed: set[int]) -> int | None:
    """The process that has this part now; None where there is none."""
    if role == "program":
        return robot.pid if robot.poll() is None else None
    with contextlib.suppress(psutil.Error):
        for child in psutil.Process(robot.pid).children(recursive=True):
            if child.pid not in killed and not gone(child.pid) and _role(child) == role:
                return child.pid
    return None


def _strike(
    scenario: Scenario,
    robot: "subprocess.Popen[str]",
    said: Path,
    killed: dict[int, str],
    environment: dict[str, str],
) -> None:
    if not wait_until(lambda: "started" in said.read_text() or robot.poll() is not None, PATIENCE_S, 0.005):
        raise TimeoutError(f"{scenario.text}: the program did not start")
    begun_s = time.monotonic()
    ends = begun_s + scenario.seconds + 5
    for role, at_s in ((scenario.first, scenario.first_s), (scenario.second, scenario.first_s + scenario.apart_s)):
        if role == "command":
            return
        if role == "closer":
            _strike_closer(begun_s + scenario.seconds, robot, killed, environment)
            continue
        time.sleep(max(0.0, begun_s + at_s - time.monotonic()))
        while time.monotonic() < ends and robot.poll() is None:
            victim = _orphan(role, robot, set(killed), environment)
            if victim is not None:
                signal_process(victim, signal.SIGKILL)
                killed[victim] = role
                break
            time.sleep(0.002)


def _strike_closer(
    end_s: float, robot: "subprocess.Popen[str]", killed: dict[int, str], environment: dict[str, str]
) -> None:
    """Kill each recorder that is to end, until there is one who closes what they left, and that one."""
    wait_until(lambda: robot.poll() is not None, end_s - time.monotonic(), 0.01)
    # a helper process outlives its program for that
    while (there := _processes(environment)) and time.monotonic() < end_s + PATIENCE_S:
        for process in there:
            role = _role(process)
            if process.pid not in killed and role in ("recorder", "closer"):
                signal_process(process.pid, signal.SIGKILL)
                killed[process.pid] = role
                if role == "closer":
                    return
        time.sleep(0.005)


def _begin_command(scenario: Scenario, environment: dict[str, str], folder: Path) -> None:
    """Have the user's next command die amid its work."""
    command = subprocess.Popen(
        [*SILO, scenario.command], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    with contextlib.suppress(subprocess.TimeoutExpired):
        command.wait(COMMAND_S * scenario.apart_s / MOST_APART_S)
    command.kill()
    command.wait()


def _orphan(role: str, robot: "subprocess.Popen[str]", killed: set[int], environment: dict[str, str]) -> int | None:
    found = _find(role, robot, killed)
    if found is not None or role in ("program", "helper"):
        return found
    # of a helper that was killed they have no parent any more
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            if process.ppid() == 1 and process.pid not in killed and _role(process) == role:
                return process.pid if _is_of(process, environment) else None
    return None


def _is_of(process: psutil.Process, environment: dict[str, str]) -> bool:
    return process.environ().get("SILO_RUNTIME_DIR") == environment["SILO_RUNTIME_DIR"]


def _settle(environment: dict[str, str], outcome: Outcome) -> None:
    """Wait until recorders and writers are done; a helper may stay for clients."""

    def busy() -> list[str]:
        return [role for one in _processes(environment) if not gone(one.pid) and (role := _role(one)) != "helper"]

    if not wait_until(lambda: not busy(), PATIENCE_S, 0.05):
        outcome.notes.append(f"still there: {busy()}")


def _end_all(environment: dict[str, str], outcome: Outcome) -> None:
    for process in _processes(environment):
        if not end_process(process.pid):
            outcome.left.append(f"process {process.pid}: {_role(process)}")


# ------------------------------------------------------------------------------------------------------- what is there


def _count(outcome: Outcome, page: Page, folder: Path, texts: list[str], found: Verified | None) -> None:
    logs = folder / "logs"
    truth = {run: int(page[run]) for run in range(1, int(page[0]) + 1)}
    outcome.ticks = sum(truth.values())
    events = read_events(logs, "pair")
    said = "\n".join([*texts, *(event.text for event in events)])
    written = read_written(logs / "recordings", "endless")
    recorded: Counter[tuple[int, int]] = Counter()
    for path in sorted(logs.glob("recordings/*.mcap*")):
        for run, ticks in _ticks_of(path, outcome):
            recorded.update((run, tick) for tick in ticks.tolist())
    for run, count in truth.items():
        missing = [tick for tick in range(count) if not recorded[run, tick]]
        if missing:
            outcome.lost += len(missing)
            outcome.notes.append(f"run {run}: {len(missing)} of {count} ticks are in no part, {_spans(missing)}")
            told = _told_of(run, found, written)
            outcome.untold += sum(not any(first <= tick <= last for first, last in told) for tick in missing)
    again = [key for key, times in recorded.items() if times > 1]
    if again:
        outcome.twice += len(again)
        outcome.notes.append(f"{len(again)} ticks stand in two parts, the first {min(again)}")
    _count_spikes(outcome, truth, logs, events, said)
    hidden = [path for path in logs.rglob("*") if path.name.startswith(".") or path.name.endswith(".part")]
    left = [path for path in hidden if not KEPT.fullmatch(path.name)]
    outcome.left += [str(path.relative_to(folder)) for path in (*left, *(folder / "run").iterdir())]
    if "Traceback" in said:
        outcome.notes.append("a traceback: " + said[said.index("Traceback") :][:800])
    if page[CLOSED] and "program" in (outcome.scenario.first, outcome.scenario.second):
        outcome.notes.append("(the program had closed before it was killed)")


def _ticks_of(path: Path, outcome: Outcome) -> list[tuple[int, NDArray[np.int64]]]:
    """What a file has of each run: the ticks whose sample is there, as the program counted them."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            log = silo.open_log(path)
            ticks, runs = log["tick"].values, log["run"].values
    except Exception as error:  # noqa: BLE001  # whatever a reader does with this file is the finding
        outcome.notes.append(f"{path.name}: {type(error).__name__}: {error}")
        return []
    there = ~np.isnan(ticks)
    return [(int(run), ticks[there & (runs == run)].astype(np.int64)) for run in np.unique(runs[there])]


def _told_of(number: int, found: Verified | None, written: Written | None) -> list[tuple[int, int]]:
    """The ticks of a run, both ends included, of which somebody said that they are in no part."""
    told: list[tuple[int, int]] = []
    for entry in written.runs if written is not None else ():
        if entry.number == number:
            told += [(end, sys.maxsize) for end in [*entry.end.values(), 0][:1] if entry.gone]
            told += [span for one in (found.told if found else ()) if one.run == entry.run for span in one.spans]
    return told


def _spans(ticks: list[int]) -> str:
    breaks = np.flatnonzero(np.diff(ticks) > 1)
    begins, ends = [ticks[0], *(ticks[at + 1] for at in breaks)], [*(ticks[at] for at in breaks), ticks[-1]]
    return ", ".join(f"{begin}-{end}" for begin, end in zip(begins[:4], ends[:4], strict=False))


def _count_spikes(outcome: Outcome, truth: dict[int, int], logs: Path, events: list[LoggedEvent], said: str) -> None:
    captured: Counter[tuple[int, int]] = Counter()
    for path in sorted(logs.glob("pair_*_spiked_*.silo")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            log = silo.open_log(path)
        facts = log.recording.conditions.capture
        runs = {int(run) for run in log["run"].values}
        if facts is None or len(runs) != 1:
            outcome.notes.append(f"{path.name}: of runs {sorted(runs)}")
            continue
        captured.update((run, fire) for run in runs for fire in facts.fires)
    wanted = {(run, tick) for run, count in truth.items() for tick in range(count) if is_spike(tick)}
    false = set(captured) - wanted
    # one tick may have been committed that the page lacks
    false = {(run, tick) for run, tick in false if not (is_spike(tick) and tick == truth.get(run))}
    if false:
        outcome.notes.append(f"captures where nothing was: {sorted(false)[:5]}")
    missed = sorted(wanted - set(captured))
    if missed:
        why = [event.text for event in events if event.kind in ("blind", "save failed")]
        outcome.notes.append(
            f"{len(missed)} of {len(wanted)} spikes have no capture, the first {missed[:3]}; {why[:3]}"
        )
        if not why:
            outcome.spikes += len(missed)
    again = {key: times for key, times in captured.items() if times > 1}
    fired = Counter((event.run, event.tick) for event in events if event.kind == "triggered")
    told = {key: times for key, times in fired.items() if times > 1}
    if again or told:
        outcome.twice += len(again) + len(told)
        outcome.notes.append(f"captured twice: {again}; told twice: {told}")
    if "exists already" in said:
        outcome.notes.append("exists already: " + said[max(0, said.index("exists already") - 200) :][:260])


def _verified(outcome: Outcome, folder: Path, environment: dict[str, str]) -> Verified | None:
    """What `silo verify` finds."""
    done = silo_command(["verify", "--json", "."], environment, folder / "logs")
    if done.returncode not in (0, 1):
        outcome.notes.append(f"silo verify: {done.stderr[:300]}")
        return None
    return msgspec.json.decode(done.stdout, type=Verified)


def _hold_against(outcome: Outcome, found: Verified | None) -> None:
    """Hold `silo verify` against the counting."""
    if found is None:
        return
    wrong = [one.text for one in found.problems]
    if wrong and not (outcome.untold or outcome.spikes or outcome.twice):
        outcome.verify = 1
        outcome.notes.append(f"silo verify alone: {wrong[:3]}")
    if not wrong and (outcome.untold or outcome.spikes or outcome.twice):
        outcome.verify = 1
        outcome.notes.append("silo verify finds nothing")


def main() -> int:
    """Do the scenarios, and show what came of them; 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, action="append", help="do scenario N alone")
    parser.add_argument("--jobs", type=int, default=2, help="scenarios at a time")
    parser.add_argument("--minutes", type=float, default=120, help="begin no further one after so long")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    printing = threading.Lock()

    def one(number: int) -> Outcome | None:
        if time.monotonic() > end:
            return None
        outcome = perform(draw(number, options.seed))
        if outcome.is_bad:
            with printing:
                notes = "; ".join([f"left {outcome.left}"] * bool(outcome.left) + outcome.notes)
                print(f"{outcome.scenario.text}\n    {notes}", flush=True)
        return outcome

    with ThreadPoolExecutor(options.jobs) as pool:
        found = [one for one in pool.map(one, options.only or range(options.scenarios)) if one is not None]
    return _report(found, options.seed)


def _report(outcomes: list[Outcome], seed: int) -> int:
    heads = ("pair", "scenarios", "ticks", "lost", "untold", "spikes", "twice", "left over", "verify")
    rows: list[tuple[str, ...]] = [heads]
    total: Counter[str] = Counter()
    pairs = sorted({tuple(sorted((one.scenario.first, one.scenario.second))) for one in outcomes})
    for pair in pairs:
        some = [one for one in outcomes if tuple(sorted((one.scenario.first, one.scenario.second))) == pair]
        sums = {
            "scenarios": len(some),
            "ticks": sum(one.ticks for one in some),
            "lost": sum(one.lost for one in some),
            "untold": sum(one.untold for one in some),
            "spikes": sum(one.spikes for one in some),
            "twice": sum(one.twice for one in some),
            "left": sum(bool(one.left) for one in some),
            "verify": sum(one.verify for one in some),
        }
        total.update(sums)
        rows.append((", ".join(pair), *map(str, sums.values())))
    rows.append(("all", *(str(total[key]) for key in ("scenarios", "ticks", "lost", "untold", "spikes", "twice",
                                                      "left", "verify"))))  # fmt: skip
    show(rows)
    broken = [one for one in outcomes if one.untold or one.spikes or one.twice or one.left or one.verify]
    if broken:
        print(f"seed {seed}, scenarios {' '.join(str(one.scenario.number) for one in broken)}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
