"""500 signals at 1 kHz recorded for minutes, the recorder killed at random: `python .bench/long/recorder.py`.

    --minutes 10 --kills 20 --every 6 --signals 500 --width 1 --ring 10

Three phases: recorded in peace (lost, MB/s, CPU, memory of recorder and helper over time), killed at random while it is
started again by the helper process (nothing may be missing between two parts), and killed while the helper process is
held (SIGSTOP), to see how much a part lacks that nobody goes on with. All parts are read by silo, `mcap` and `rosbags`.
"""

import argparse
import itertools
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

ROBOT = """
import sys, time
import numpy as np, silo
folder, signals, width, ring = sys.argv[1], *map(int, sys.argv[2:5])
log = silo.Logger("bot", frequency=1000, max_time=0, folder=folder, script=folder + "/none.yaml")
arrays = [
    log.array(f"s{k}", (width,) if width > 1 else (), buffer="looping", size=1000 * ring)
    for k in range(signals // width)
]
serving = log.serve()
log.start()
noise = np.random.default_rng(0).standard_normal((1000, len(arrays)))
print(serving.helper_pid, flush=True)
tick, begun = 0, time.perf_counter()
while True:
    # the first holds the tick, the others noise that follows from it
    row = noise[tick % 1000]
    for array, value in zip(arrays, row):
        array[...] = value
    arrays[0][...] = tick
    log.collect()
    tick += 1
    wait = begun + tick * 0.001 - time.perf_counter()
    if wait > 0:
        time.sleep(wait)
"""


def stat(pid: int) -> tuple[float, float]:
    """CPU seconds, and MB in memory that is its own."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    own = sum(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), own / 1024


def check(path: Path, thorough: bool) -> tuple[int, int]:
    """The ticks of a part, read by all readers. Raises AssertionError for a value that is not what was logged."""
    from silo.files.bag_reader import read_bag

    found = read_bag(path)
    first = found.offset - len(found.time_ns)
    noise = np.random.default_rng(0).standard_normal((1000, len(found.elements)))
    for element in found.elements:
        assert element.lost == 0
        ticks = first + element.stamp_indices
        number = int(element.name.rpartition("s")[2])
        expected = ticks.astype(float) if number == 0 else noise[ticks % 1000, number]
        assert all((entry.values == expected).all() for entry in element.entries), element.name
    samples = sum(element.count for element in found.elements) + len(found.events)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_summary().statistics.message_count == samples
        if thorough:
            assert sum(1 for _ in reader.iter_messages()) == samples
    with Reader(path) as reader:
        assert reader.message_count == samples
        if thorough:
            assert sum(1 for _ in reader.messages()) == samples
    return first, found.offset


def main() -> int:
    """Run the phases; returns 1 if anything was lost or is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--every", type=float, default=6.0, help="seconds between two kills, on the average")
    parser.add_argument("--signals", type=int, default=500)
    parser.add_argument("--width", type=int, default=1, help="values per element")
    parser.add_argument("--ring", type=int, default=10, help="seconds that the buffers hold")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=None)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="silo-record-", dir=options.folder))
    runtime = Path(tempfile.mkdtemp(prefix="silo-record-", dir="/dev/shm"))
    os.environ |= {"SILO_RUNTIME_DIR": str(runtime), "XDG_STATE_HOME": str(folder / "state")}
    command = [
        sys.executable,
        "-c",
        ROBOT,
        str(folder),
        *(str(one) for one in (options.signals, options.width, options.ring)),
    ]
    robot = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert robot.stdout is not None
    helper = int(robot.stdout.readline())
    try:
        return phases(options, folder, robot.pid, helper)
    finally:
        robot.kill()
        robot.wait()
        shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(runtime, ignore_errors=True)


def phases(options: argparse.Namespace, folder: Path, robot: int, helper: int) -> int:
    """The three phases."""
    from silo.client.client import Client
    from silo.recovery.parts import close_parts

    rng = random.Random(options.seed)
    with Client.connect("bot", timeout_s=20.0) as client:
        client.record(to="peace", name="peace", split="1GB")
        time.sleep(2.0)
        begun_s, (cpu, _), (helper_cpu, _) = time.monotonic(), stat(client.recorders()[0].pid), stat(helper)
        before = client.recorders()[0]
        while time.monotonic() - begun_s < 60 * options.minutes:
            time.sleep(min(15.0, 60 * options.minutes / 4))
            info = client.recorders()[0]
            recorder, own = stat(info.pid), stat(helper)
            took_s = time.monotonic() - begun_s
            rate = (info.size_bytes - before.size_bytes) / took_s / 1e6
            print(
                f"{took_s:5.0f} s  lost {info.lost}  {rate:.1f} MB/s  recorder {(recorder[0] - cpu) / took_s:.1%} of a "
                f"core, {recorder[1]:.0f} MB  helper {(own[0] - helper_cpu) / took_s:.1%}, {own[1]:.0f} MB",
                flush=True,
            )
        info = client.recorders()[0]
        print(client.stop_recorder("peace"), flush=True)
        spans = [check(path, thorough=False) for path in sorted((folder / "peace").glob("*.mcap"))]
        assert all(one[1] == two[0] for one, two in itertools.pairwise(spans)), spans
        failed = bool(info.lost)
        shutil.rmtree(folder / "peace")

        client.record(to="kills", name="kills", split="1h")
        for _ in range(options.kills):
            killed = info.pid
            while (info := client.recorders()[0]).state.value != "recording" or info.pid == killed:
                time.sleep(0.1)
            time.sleep(rng.uniform(0.0, 2 * options.every))
            os.kill(info.pid, 9)
        time.sleep(6.0)
        print(client.stop_recorder("kills"), flush=True)
        while list((folder / "kills").glob("*.part")):
            time.sleep(0.1)
        paths = sorted((folder / "kills").glob("*.mcap"))
        spans = [check(path, thorough=not number % 10) for number, path in enumerate(paths)]
        missing = sum(two[0] - one[1] for one, two in itertools.pairwise(spans))
        print(f"{options.kills} kills, {len(paths)} files, read by silo, mcap, rosbags: {missing} ticks are missing")
        failed = failed or missing != 0
        shutil.rmtree(folder / "kills")

        lacks = []
        for number in range(options.kills):
            name = f"last{number}"
            client.record(to="last", name=name)
            time.sleep(rng.uniform(1.5, 3.0))
            info = next(one for one in client.recorders() if one.name == name)
            os.kill(helper, 19)  # so that nobody goes on with it
            os.kill(info.pid, 9)
            ticks = last_tick(robot)
            while not (closed := close_parts(folder / "last")[0]):
                time.sleep(0.05)
            lacks.append(ticks - check(closed[0].path, thorough=False)[1])
            os.kill(helper, 18)
            time.sleep(1.0)
            client.stop_recorder(name)
        print(f"{options.kills} kills with nobody to go on: the files lack {min(lacks)} to {max(lacks)} ticks of 1 ms")
        failed = failed or max(lacks) > 1000
    return int(failed)


def last_tick(robot: int) -> int:
    """How many ticks the robot program has logged."""
    from silo.core.runtime import list_segments
    from silo.segment.reader import SegmentReader

    (path,) = [path for path in list_segments() if f".{robot}." in path.name]
    reader = SegmentReader(path)
    try:
        return reader.ticks
    finally:
        reader.close()


if __name__ == "__main__":
    sys.exit(main())
