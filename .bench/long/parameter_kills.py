"""Kills a program, its helper or a client while a group of parameters is set: `python .bench/long/parameter_kills.py`.

A program at 1 kHz has two parameters, `kd = -kp`, which a client sets as one change as fast as it is answered. One of
the three is killed at a moment drawn by the seed; the program (`silo recover`, where it was killed) then leaves a file.

- half: rows of the file in which one of the two holds without the other.
- untold: changes that the client was told of which the file's record lacks, or whose value isn't in the row from which
  it was to hold, if there came one.
- unrecorded: values in rows that no recorded change of both explains.

Each kill is told by its number: `--seed S --only N` does one again. Exits with 1 if any figure is not 0.
"""

import argparse
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from processes import end_process, show, signal_process, silo_command, wait_until, workplace

import silo

VICTIMS = ("program", "helper", "client")
LATEST_S = 0.3
FIGURES = ("changes", "half", "untold", "unrecorded", "no file")

PROGRAM = """
import signal, time, silo
ended = []
signal.signal(signal.SIGTERM, lambda number, frame: ended.append(number))
log = silo.Logger("knobs", frequency=1000, max_time=0, folder="logs", script="logs/none.yaml")
kp, kd = log.parameter("kp", 1.0, min=0, max=1e9), log.parameter("kd", -1.0, min=-1e9, max=0)
log.update()
log.set("kp", divider=1, buffer="growing", size=200), log.set("kd", divider=1, buffer="growing", size=200)
log.serve()
log.start()
print("running", flush=True)
next_s = time.monotonic()
while not ended:
    next_s += 1e-3
    log.collect()
    time.sleep(max(0.0, next_s - time.monotonic()))
log.stop()
log.save()
log.close()
"""

CLIENT = """
import sys, silo
client, value = silo.connect("knobs", timeout_s=60.0), 1.0
while True:
    value += 1.0
    answer = client.parameters.set({"kp": value, "kd": -value})
    print(value, answer.tick, flush=True)
"""


def told(path: Path) -> list[tuple[float, int]]:
    """What the client was told, whole lines alone: values, and the ticks from which they held."""
    lines = path.read_text().rpartition("\n")[0].splitlines()
    return [(float(value), int(tick)) for value, tick in map(str.split, lines)]


def helper_of(program: int) -> int:
    """The helper process of a program; 0 if there is none."""
    done = subprocess.run(["pgrep", "-P", str(program)], capture_output=True, text=True, check=False)
    return int(done.stdout.split()[0]) if done.stdout else 0


def kill(number: int, seed: int) -> Counter[str]:
    """Kill once, and count what went wrong."""
    chance = random.Random(f"{seed}-{number}")
    victim, delay_s = VICTIMS[number % 3], chance.uniform(0, LATEST_S)
    found = Counter({victim: 1})
    with workplace() as (folder, environment):
        answers = folder / "answers"
        common = {"cwd": folder, "env": environment, "stderr": subprocess.DEVNULL}
        program = subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, **common)
        program.stdout.readline()
        with answers.open("w") as file:
            client = subprocess.Popen([sys.executable, "-c", CLIENT], stdout=file, **common)
        if not wait_until(lambda: len(told(answers)) > 3, 60.0, 0.01):
            raise RuntimeError(f"kill {number}: no change was answered within a minute")
        time.sleep(delay_s)
        helper = helper_of(program.pid)
        signal_process({"program": program.pid, "helper": helper, "client": client.pid}[victim], signal.SIGKILL)
        time.sleep(0.05)
        client.kill()
        client.wait()
        end_process(program.pid)
        program.wait()
        if victim == "program":
            wait_until(lambda: not Path(f"/proc/{helper}").exists(), 30.0, 0.01)
            silo_command(["recover"], environment, folder)
        files = sorted((folder / "logs").glob("*.silo"))
        if len(files) != 1:
            found["no file"] += 1
            return found
        log = silo.open_log(files[0])
        kp, kd = np.asarray(log["kp"].values), np.asarray(log["kd"].values)
        told_of = told(answers)
        recorded = {tuple(new for _, _, new in one.change.values) for one in log.parameters.changes} | {(1.0, -1.0)}
        found["changes"] += len(told_of)
        found["half"] += int(np.count_nonzero(kp != -kd))
        found["untold"] += sum(
            (value, -value) not in recorded or (0 <= tick < len(kp) and float(kp[tick]) != value)
            for value, tick in told_of
        )
        found["unrecorded"] += sum((value, -value) not in recorded for value in np.unique(kp))
    return found


def main() -> int:
    """Kill so often, and show what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="the number of one kill")
    asked = parser.parse_args()
    total = Counter[str]()
    for number in range(asked.kills) if asked.only is None else (asked.only,):
        found = kill(number, asked.seed)
        total += found
        if any(found[name] for name in FIGURES[1:]):
            print(f"kill {number}: {dict(found)}", flush=True)
    show(
        [
            ("killed", *VICTIMS, *FIGURES),
            (str(sum(total[one] for one in VICTIMS)), *(str(total[one]) for one in (*VICTIMS, *FIGURES))),
        ]
    )
    return int(any(total[name] for name in FIGURES[1:]))


if __name__ == "__main__":
    sys.exit(main())
