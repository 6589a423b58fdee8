"""What it costs to look into a saved log, by format: `python .bench/speed/reading.py [--ticks 10000] [--formats csv]`.

500 signals of float64: 10,000 ticks are 40 MB of values and 95 MB of CSV, 100,000 ticks ten times that. Each step is a
process of its own, as users start one: seconds of the clock and of the processor (medians), and its largest memory. The
first row is `python -c pass`. A part is one of an endless recording; `others` is a bag that silo didn't write.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import silo

ELEMENTS = 500
NAME = "/log/group7/signal237"
COMMAND = "import sys; from silo.cli import main; sys.argv = ['silo', {words}]; main()"
AT_END = """
import atexit, os, sys
memory = lambda: next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
atexit.register(lambda: print("", sum(os.times()[:2]), memory(), sep="\\n", file=sys.stderr))
"""
STEPS = {
    "pass": "pass",
    "open": "import silo; len(silo.open_log(FILE))",
    "one signal": "import silo; silo.open_log(FILE)[NAME].values.sum()",
    "eval": "import silo; silo.open_log(FILE).eval(f'abs({NAME})').values.sum()",
    "silo stats": COMMAND.format(words="'stats', FILE, NAME"),
    "silo plot": COMMAND.format(words="'plot', FILE, NAME"),
    "TAB": "import os; os.environ.update(_SILO_COMPLETE='bash_complete', COMP_CWORD='3', "
    "COMP_WORDS=f'silo plot {FILE} /log/group7/s'); from silo.cli import main; main()",
}


def log_of(ticks: int, folder: Path, record: bool) -> Path:
    """Log noise, save it as `.silo`, or record it; return the file."""
    values = np.random.default_rng(1).standard_normal((997, ELEMENTS))
    row = values[0].copy()
    log = silo.Logger("bench", frequency=500.0, folder=folder)
    buffer = "looping" if record else "fixed"
    for i in range(ELEMENTS):
        log.add(
            row[i : i + 1].reshape(()),
            f"group{i % 10}/signal{i}",
            unit="rad",
            size=ticks,
            buffer=buffer,
        )
    with log:
        if record:
            log.serve()
        log.start()
        if record:
            log.record(to=folder)
        for tick in range(ticks):
            row[:] = values[tick % 997]
            log.collect()
            if record:
                time.sleep(0.0005)
        log.stop()
        if record:
            log.stop_recording()
            return max(folder.rglob("*.mcap"), key=lambda path: path.stat().st_size)
        return Path(log.save(types=["silo"])[0].path)


def used_by(step: str, file: Path, name: str) -> tuple[float, float, float]:
    """Run a step; return its seconds of the clock and of the processor, and its megabytes. Raises where it fails."""
    began = time.perf_counter()
    words = [sys.executable, "-c", f"{AT_END}\nFILE, NAME = {str(file)!r}, {name!r}\n{STEPS[step]}"]
    told = subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    processor, memory = told.split()[-2:]
    return time.perf_counter() - began, float(processor), float(memory) / 1024


def converted(source: Path, target: Path) -> Path:
    """The log in another format."""
    subprocess.run([Path(sys.executable).with_name("silo"), "convert", source, target], check=True, capture_output=True)
    return target


def by_others(source: Path, target: Path) -> Path:
    """The same values as a bag of plain Float64 messages, without anything of silo in it."""
    from mcap_ros2.writer import Writer

    log = silo.open_log(source)
    with target.open("wb") as out:
        writer = Writer(out)
        schema = writer.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for name in log:
            for stamp, value in zip(log.time_ns.tolist(), log[name].values.tolist(), strict=True):
                writer.write_message(name, schema, {"data": value}, stamp, stamp)
        writer.finish()
    return target


def main() -> None:
    """Make each file, take the steps, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", help="where to write; a temporary folder by default")
    makers: dict[str, Callable[[Path, Path], Path]] = {
        "silo": lambda source, folder: source,
        **{kind: lambda source, folder, kind=kind: converted(source, folder / f"x.{kind}")
           for kind in ("mcap", "csv", "parquet", "npz", "mat", "h5")},  # type: ignore[misc]
        "part": lambda source, folder: log_of(options.ticks, folder / "part", record=True),
        "others": lambda source, folder: by_others(source, folder / "others.mcap"),
    }  # fmt: skip
    parser.add_argument("--formats", nargs="+", choices=makers, default=list(makers))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as made:
        folder = Path(made)
        source = log_of(options.ticks, folder, record=False)
        for kind in options.formats:
            (folder / kind).mkdir(exist_ok=True)
            file = makers[kind](source, folder / kind)
            print(f"{kind}, {file.stat().st_size / 1e6:.0f} MB {'':12} s   s of processor        MB", flush=True)
            name = next(one for one in silo.open_log(file) if one.startswith(NAME))
            for step in STEPS:
                clock, processor, memory = zip(*(used_by(step, file, name) for _ in range(options.rounds)), strict=True)
                print(
                    f"  {step:18} {statistics.median(clock):10.2f} {statistics.median(processor):10.2f} "
                    f"{max(memory):12.0f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
