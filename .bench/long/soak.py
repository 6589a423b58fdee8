"""Lets a logger run for long under use and abuse: `python .bench/long/soak.py [--minutes 60]`.

A robot program with 1,000 elements at 500 Hz. Clients watch, follow topics, save in all formats, come and go; some are
killed, some stopped (SIGSTOP) and killed later. Each minute the buffers become growing ones, or looping again, by
`silo stop`, `set`, `start`, and a flood of requests comes. Everything is sampled each few seconds.

- uncounted: ticks missing in a saved file or on a topic that nobody counted as lost.
- growth: of private memory (`Pss_Anon`) after the first third, by a straight line, and how far it would get in an hour.
- descriptors, segments held: what is more at the end, at rest, than after the first third; deleted segments that are
  still mapped.

Exits with 1 if a tick is uncounted, memory rose by more than `--rise` MB, or descriptors or segments are left.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from processes import HERE, descriptors_of, end_process, gone, memory_of, show, signal_process, silo_command, workplace
from soak_robot import BEGIN_NS

import silo

NAME = "soaked"
KEEP_FILES = 4
STOPPED_S = 15.0
SETTLE_S = 8.0


@dataclass
class Sample:
    """One moment: seconds since the beginning, MB of helper and robot, descriptors, MB in the runtime folder."""

    at_s: float
    helper: float
    helper_rss: float
    robot: float
    helper_descriptors: int
    robot_descriptors: int
    shared: float


@dataclass
class Soak:
    """What runs, and what was found."""

    folder: Path
    environment: dict[str, str]
    robot: "subprocess.Popen[str]"
    helper: int
    period_ns: int
    began_s: float = field(default_factory=time.monotonic)
    samples: list[Sample] = field(default_factory=list)
    clients: list["subprocess.Popen[str]"] = field(default_factory=list)
    ending: dict[int, float] = field(default_factory=dict)  # clients to be killed, and when
    counts: dict[str, int] = field(default_factory=dict)
    uncounted: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def at_s(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.began_s

    def count(self, what: str) -> None:
        """Remember that something was done."""
        self.counts[what] = self.counts.get(what, 0) + 1

    def begin_client(self, kind: str, seconds: float) -> "subprocess.Popen[str]":
        """Start a client of a kind."""
        command = [sys.executable, str(HERE / "soak_client.py"), kind, str(seconds)]
        client = subprocess.Popen(
            command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.clients.append(client)
        self.count(f"clients that {kind}")
        return client

    def sample(self) -> None:
        """Take down how things are."""
        helper, robot = memory_of(self.helper), memory_of(self.robot.pid)
        shared = sum(path.stat().st_size for path in (self.folder / "run").glob("*.segment")) / 1e6
        self.samples.append(
            Sample(
                self.at_s,
                helper.private,
                helper.rss,
                robot.private,
                descriptors_of(self.helper),
                descriptors_of(self.robot.pid),
                shared,
            )
        )
        if not helper.rss or self.robot.poll() is not None:
            raise SystemExit("BROKEN: robot program or helper process ended")

    def tend_clients(self) -> None:
        """Kill those whose time has come, and hear those that ended."""
        for client in list(self.clients):
            due_s = self.ending.get(client.pid)
            if due_s is not None and self.at_s > due_s:
                client.kill()
            if client.poll() is None:
                continue
            self.clients.remove(client)
            assert client.stdout is not None
            text = client.stdout.read()
            client.stdout.close()
            told = [int(line.split()[1]) for line in text.splitlines() if line.startswith("uncounted ")]
            self.uncounted += sum(told)
            if sum(told) or "Traceback" in text:
                self.notes.append(f"a client said: {text[-1500:]}")

    def look_at_files(self, *, keep: int) -> None:
        """Check saved `.silo` files for ticks that are missing and not counted, and delete all but the newest."""
        paths = sorted((self.folder / "logs").glob("soaked_*"), key=lambda path: path.stat().st_mtime)
        for path in paths[: len(paths) - keep]:
            if path.suffix == ".silo":
                self._look(path)
            _delete(path)

    def _look(self, path: Path) -> None:
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            log = silo.open_log(path)
        self.count("files looked at")
        gaps = int(np.count_nonzero(np.diff(log.time_ns) != self.period_ns))
        ticks = log["/log/tick"]
        wrong = int(np.count_nonzero(ticks.values != (ticks.time_ns - BEGIN_NS) // self.period_ns))
        short = 0
        for element in log.recording.elements:
            due = -(-(len(log.time_ns) - element.first) // element.divider)
            # a growing buffer at the memory limit keeps its first rows, and counts the others
            short += int(element.count + element.lost < due and element.buffer_type is silo.BufferType.GROWING)
        if gaps or wrong or short:
            self.uncounted += gaps + wrong + short
            self.notes.append(f"{path.name}: {gaps} gaps, {wrong} wrong ticks, {short} elements too short")


def _delete(path: Path) -> None:
    if path.is_dir():
        for part in path.iterdir():
            part.unlink()
        path.rmdir()
    else:
        path.unlink()


def abuse(soak: Soak, chance: random.Random) -> None:
    """A few clients that end well, are killed, or are stopped and killed later."""
    kind = chance.choice(["watch", "follow", "visit", "watch", "follow"])
    client = soak.begin_client(kind, chance.uniform(5, 20))
    fate = chance.choice(["left alone", "killed", "stopped"])
    soak.count(f"clients {fate}")
    if fate == "killed":
        soak.ending[client.pid] = soak.at_s + chance.uniform(0.5, 6)
    elif fate == "stopped":
        time.sleep(chance.uniform(0.5, 3))
        signal_process(client.pid, signal.SIGSTOP)
        soak.ending[client.pid] = soak.at_s + STOPPED_S


def edit(soak: Soak, *, growing: bool) -> None:
    """Stop, edit and start as a user does."""
    buffer = ["buffer=growing", "size=1000"] if growing else ["buffer=looping", "size=5s"]
    for words in (["stop", NAME], ["set", NAME, "*", *buffer], ["start", NAME, "--discard"]):
        done = silo_command(words, soak.environment, soak.folder)
        if done.returncode:
            soak.notes.append(f"silo {' '.join(words)}: {done.stdout}{done.stderr}".strip())
    soak.count("edits")


def run(soak: Soak, seconds: float, turn_s: float, seed: int) -> None:
    """The whole program of use and abuse."""
    chance = random.Random(seed)
    soak.begin_client("watch", seconds)
    soak.begin_client("follow", seconds)
    saver = soak.begin_client("save", seconds)
    turn, sampled_s, abused_s = 0, 0.0, 0.0
    while soak.at_s < seconds:
        if soak.at_s > (turn + 1) * turn_s / 2:
            turn += 1
            edit(soak, growing=turn % 2 == 1)
            if turn % 2 == 0:
                soak.begin_client("flood", turn_s / 6)
            if saver.poll() is not None and soak.at_s < seconds - turn_s:  # a restart may come into a save
                saver = soak.begin_client("save", seconds - soak.at_s)
        if soak.at_s > abused_s:
            abused_s = soak.at_s + chance.uniform(2, 8)
            abuse(soak, chance)
        if soak.at_s > sampled_s:
            sampled_s = soak.at_s + min(5.0, seconds / 60)
            soak.sample()
            soak.look_at_files(keep=KEEP_FILES)
        soak.tend_clients()
        time.sleep(0.1)
    edit(soak, growing=False)
    for client in soak.clients:
        client.kill()
    soak.tend_clients()
    time.sleep(SETTLE_S)
    soak.tend_clients()
    soak.sample()


def deleted_maps(pid: int) -> int:
    """Segments that were deleted and are still mapped by a process."""
    lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    return len({line.split()[4] for line in lines if ".segment (deleted)" in line})


def report(soak: Soak, rise_mb: float) -> int:
    """The table; 1 if a promise is broken."""
    at = np.array([sample.at_s for sample in soak.samples])
    third = at > at[-1] / 3
    rows: list[tuple[str, ...]] = [("", "first third", "end", "peak", "rise", "per hour")]
    broken = [f"{soak.uncounted} ticks are missing that nobody counted"] if soak.uncounted else []
    for name in ("helper", "helper_rss", "robot", "helper_descriptors", "robot_descriptors", "shared"):
        found = np.array([getattr(sample, name) for sample in soak.samples], float)
        slope = float(np.polyfit(at[third], found[third], 1)[0]) if third.sum() > 2 else 0.0
        rise = slope * (at[-1] - at[-1] / 3)
        before = float(np.median(found[~third]))
        figures = (before, found[-1], found.max(), rise, slope * 3600)
        rows.append((name.replace("_", " "), *(f"{figure:.1f}" for figure in figures)))
        if name in ("helper", "robot") and rise > rise_mb:
            broken.append(f"private memory of the {name} rose by {rise:.1f} MB, allowed {rise_mb:g}")
        if name.endswith("descriptors") and found[-1] > np.max(found[~third]):
            broken.append(f"{name}: {found[-1]:.0f} at rest, at most {np.max(found[~third]):.0f} in the first third")
    held = {who: deleted_maps(pid) for who, pid in (("helper", soak.helper), ("robot", soak.robot.pid))}
    broken += [f"the {who} holds {number} deleted segments" for who, number in held.items() if number]
    segments = len(list((soak.folder / "run").glob("*.segment*")))
    if segments != 1:
        broken.append(f"{segments} segments stand in the runtime folder, one is in use")
    print(", ".join(f"{number} {what}" for what, number in sorted(soak.counts.items())))
    print(f"{at[-1]:.0f} s, {len(at)} samples; ticks uncounted: {soak.uncounted}; deleted segments held: {held}\n")
    show(rows)
    for note in soak.notes[:20]:
        print(f"note: {note}")
    for text in broken:
        print(f"BROKEN: {text}")
    return 1 if broken else 0


def main() -> int:
    """Soak a logger; 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--elements", type=int, default=1000)
    parser.add_argument("--frequency", type=int, default=500, help="Hz, a divisor of 1e9")
    parser.add_argument("--limit", type=int, default=200, help="memory of growing buffers, MB")
    parser.add_argument("--turn", type=float, default=60, help="seconds of a turn: growing, looping, a flood")
    parser.add_argument("--rise", type=float, default=8, help="MB that private memory may rise after the first third")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=Path, help="write all samples into this CSV file")
    options = parser.parse_args()
    with workplace() as (folder, environment):
        os.environ["SILO_RUNTIME_DIR"] = environment["SILO_RUNTIME_DIR"]
        words = [str(folder / "logs"), str(options.elements), str(options.frequency), str(options.limit)]
        command = [sys.executable, str(HERE / "soak_robot.py"), *words]
        with subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as robot:
            assert robot.stdin is not None
            assert robot.stdout is not None
            helper = int(robot.stdout.readline())
            soak = Soak(folder, environment, robot, helper, 1_000_000_000 // options.frequency)
            try:
                run(soak, 60 * options.minutes, options.turn, options.seed)
                done = report(soak, options.rise)
                robot.stdin.write("end\n")
                robot.stdin.close()
                print("the last run, ticks and lost rows:", robot.stdout.read().strip())
                soak.look_at_files(keep=0)
                done |= bool(robot.wait())
            finally:
                robot.kill()
                for client in soak.clients:
                    client.kill()
                if not gone(helper):
                    end_process(helper)
            if options.samples:
                lines = [",".join(map(str, vars(sample).values())) for sample in soak.samples]
                options.samples.write_text("\n".join([",".join(vars(soak.samples[0])), *lines]) + "\n")
            return done


if __name__ == "__main__":
    sys.exit(main())
