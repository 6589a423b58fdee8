"""The helper's private memory at rest and at its peaks: `python .bench/long/memory.py [--elements 500 10000]`.

A robot program with so many scalars, half of them published, is served and logs at 100 Hz. Then it is saved in each
format, and a client watches all of it as silo-tui does. Private memory is `Pss_Anon`: pages that no file or shared
segment stands behind. Exits with 1 if the helper at rest takes more than is promised: 60 MB with up to 500 elements,
90 MB with up to 10,000.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial

import psutil
from processes import Peak, connected, memory_of, show, wait_until, workplace

from silo.client.client import Client
from silo.core.elements import FileType

NAME = "weighed"
REST_S = 3.0
WATCH_S = 4.0
PROMISED_MB = {500: 60.0, 10_000: 90.0}  # at rest, up to so many elements

ROBOT = """
import sys, time
import silo
elements, folder = int(sys.argv[1]), sys.argv[2]
log = silo.Logger("weighed", frequency=100, max_time=5, folder=folder, script=folder + "/none.yaml")
kept = []
for place in range(elements):
    action = silo.Action.SAVE_AND_PUBLISH if place % 2 else silo.Action.SAVE
    kept.append(log.array(f"joint{place}", group=f"part{place % 50}", unit="rad", action=action,
                          description="an element as they are"))
serving = log.serve()
print(serving.helper_pid, flush=True)
log.start()
while True:
    for place, value in enumerate(kept[:50]):
        value[...] += place
    log.collect()
    time.sleep(0.01)
"""


def measure(elements: int) -> list[tuple[str, ...]]:
    """Rows of the table for one number of elements."""
    with workplace() as (folder, environment):
        os.environ["SILO_RUNTIME_DIR"] = environment["SILO_RUNTIME_DIR"]  # this program's own clients find the robot
        command = [sys.executable, "-c", ROBOT, str(elements), str(folder / "logs")]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as robot:
            try:
                assert robot.stdout is not None
                helper = int(robot.stdout.readline())
                return _weigh(elements, helper)
            finally:
                robot.terminate()
                robot.wait()
                if not wait_until(lambda: memory_of(helper).rss == 0, 30, 0.05):
                    os.kill(helper, 15)
                    wait_until(lambda: memory_of(helper).rss == 0, 30, 0.05)


def _weigh(elements: int, helper: int) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []

    def weigh(what: str, act: Callable[[], object], rest_s: float = REST_S) -> None:
        busy_s = _cpu_s(helper)
        with Peak(helper) as peak:
            act()
            time.sleep(rest_s)  # rest is what is measured: the helper trims its memory meanwhile
        now = memory_of(helper)
        figures = (now.private, max(peak.private, now.private), now.rss)
        rows.append((str(elements), what, *(f"{mb:.1f}" for mb in figures), f"{_cpu_s(helper) - busy_s:.2f}"))

    weigh("after start", lambda: None, 5.0)
    with connected(NAME) as client:
        weigh("client connected, table read", client.table)
        for file_type in FileType:
            weigh(f"after a save as {file_type.name.lower()}", partial(_save, client, [file_type]))
        weigh("three saves in all formats", partial(_save, client, list(FileType), 3))
        weigh("while watched like a terminal", partial(_watch, client), 0.0)
    weigh("client gone", lambda: None)
    return rows


def _cpu_s(pid: int) -> float:
    used = psutil.Process(pid).cpu_times()
    return used.user + used.system


def _save(client: Client, types: list[FileType], times: int = 1) -> None:
    for _ in range(times):
        client.wait_saved(client.save(types))


def _watch(client: Client) -> None:
    """Values of all elements and eight plots at 5 Hz, and a history, as the table and the monitor of silo-tui ask."""
    table = client.table()
    names = [info.name for info in table.elements]
    published = [info.name for info in table.elements if info.options.action.publishes][:8]
    status = client.status()
    with client.view(names, published, rate_hz=5) as view:
        end = time.monotonic() + WATCH_S
        while time.monotonic() < end:
            view.frame()
            client.history(published, status.last_tick_ns - 4_000_000_000, status.last_tick_ns, 10_000_000)
            time.sleep(0.2)


def main() -> int:
    """Measure and show; 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--elements", type=int, nargs="+", default=[500, 10_000])
    rows = [row for elements in parser.parse_args().elements for row in measure(elements)]
    show([("elements", "helper's memory, MB", "private", "its peak", "resident", "CPU s"), *rows])
    broken = []
    for elements, what, private, *_ in rows:
        limit = min((mb for most, mb in PROMISED_MB.items() if int(elements) <= most), default=None)
        if limit is not None and float(private) > limit:
            broken.append(f"{what} with {elements} elements: {private} MB, promised {limit:g}")
    for text in broken:
        print(f"BROKEN: {text}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
