"""What of a computer is logged: one function per source.

A probe registers its elements with the logger and returns the function that reads new values into them, or None where
this machine lacks the source. What disappears while the program runs (a network interface, a disk) becomes NaN.
"""

import math
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

from silo.logger.logger import Logger
from silo.programs.host.devices import battery, disks, fans, networks, temperatures
from silo.programs.host.reading import LIVE, MB, Rates, Reader, element, elements

_PRESSURE = tuple(Path("/proc/pressure", name) for name in ("cpu", "memory", "io"))


@dataclass(frozen=True)
class Probe:
    """A source and how many ticks pass between two readings of it (also the divider of its elements)."""

    make: Callable[[Logger, int], Reader | None]
    divider: int


# ---------------------------------------------------------------------------------------------------------- processor


def cpu_total(log: Logger, divider: int) -> Reader:
    """Load of all cores together."""
    (load,) = elements(log, "cpu", divider, [("load", "%", LIVE)])
    psutil.cpu_percent()

    def read() -> None:
        load[...] = psutil.cpu_percent()

    return read


def cpu_cores(log: Logger, divider: int) -> Reader:
    """Load of each core. The kernel counts in 10 ms: read it 5 times a second at most."""
    count = len(psutil.cpu_percent(percpu=True))
    loads = [elements(log, f"cpu/core{core:02}", divider, [("load", "%", LIVE)])[0] for core in range(count)]

    def read() -> None:
        for load, value in zip(loads, psutil.cpu_percent(percpu=True), strict=False):
            load[...] = value

    return read


def cpu_shares(log: Logger, divider: int) -> Reader:
    """Return what the processor's time went to."""
    fields = [field for field in ("user", "system", "iowait", "irq", "softirq", "steal") if field in _cpu_fields()]
    shares = elements(log, "cpu/share", divider, [(field, "%", LIVE) for field in fields])
    psutil.cpu_times_percent()

    def read() -> None:
        times = psutil.cpu_times_percent()
        for share, field in zip(shares, fields, strict=True):
            share[...] = getattr(times, field)

    return read


def _cpu_fields() -> tuple[str, ...]:
    fields: tuple[str, ...] = psutil.cpu_times_percent()._fields
    return fields


def cpu_frequencies(log: Logger, divider: int) -> Reader | None:
    """Return the clock of each core, where the kernel tells."""
    count = len(_frequencies())
    if count == 0:
        return None
    clocks = [elements(log, f"cpu/core{core:02}", divider, [("frequency", "MHz", LIVE)])[0] for core in range(count)]

    def read() -> None:
        for clock, value in zip(clocks, _frequencies(), strict=False):
            clock[...] = value

    return read


def _frequencies() -> list[float]:
    """Return MHz per core; empty where the machine doesn't tell (containers, some ARM boards)."""
    try:
        return [one.current for one in psutil.cpu_freq(percpu=True) or []]
    except (OSError, NotImplementedError, AttributeError):
        return []


def kernel(log: Logger, divider: int) -> Reader:
    """Return context switches and interrupts."""
    rates = Rates(3)
    names = ("context_switches", "interrupts", "soft_interrupts")
    values = elements(log, "kernel", divider, [(name, "1/s", LIVE) for name in names])

    def read() -> None:
        stats = psutil.cpu_stats()
        found = rates.update((stats.ctx_switches, stats.interrupts, stats.soft_interrupts))
        for value, rate in zip(values, found, strict=True):
            value[...] = rate

    return read


def load_average(log: Logger, divider: int) -> Reader:
    """Return the length of the run queue over 1, 5 and 15 minutes."""
    rows = [(f"{minutes}min", "-", LIVE) for minutes in (1, 5, 15)]
    values = elements(log, "load_average", divider, rows)

    def read() -> None:
        for value, average in zip(values, os.getloadavg(), strict=True):
            value[...] = average

    return read


def pressure(log: Logger, divider: int) -> Reader | None:
    """Return the share of the last 10 s in which some process waited for processor, memory or disk."""
    files = [path for path in _PRESSURE if not math.isnan(_some_pressure(path))]
    if not files:
        return None
    values = elements(log, "pressure", divider, [(path.name, "%", LIVE) for path in files])

    def read() -> None:
        for value, path in zip(values, files, strict=True):
            value[...] = _some_pressure(path)

    return read


def _some_pressure(path: Path) -> float:
    try:
        found = re.search(r"some avg10=([0-9.]+)", path.read_text())
    except OSError:  # not in this kernel, or not allowed
        return math.nan
    return float(found[1]) if found else math.nan


# ------------------------------------------------------------------------------------------------------------- memory


def memory(log: Logger, divider: int) -> Reader:
    """Return main memory."""
    fields = [field for field in ("used", "available", "cached", "buffers") if hasattr(psutil.virtual_memory(), field)]
    values = elements(log, "memory", divider, [("percent", "%", LIVE), *((field, "MB", LIVE) for field in fields)])

    def read() -> None:
        now = psutil.virtual_memory()
        values[0][...] = now.percent
        for value, field in zip(values[1:], fields, strict=True):
            value[...] = getattr(now, field) / MB

    return read


def swap(log: Logger, divider: int) -> Reader | None:
    """Return swap space, where there is any."""
    if psutil.swap_memory().total == 0:
        return None
    rates = Rates(2)
    rows = [("used", "MB", LIVE), ("percent", "%", LIVE), ("in", "MB/s", LIVE), ("out", "MB/s", LIVE)]
    values = elements(log, "swap", divider, rows)

    def read() -> None:
        now = psutil.swap_memory()
        moved = rates.update((now.sin, now.sout)) / MB
        for value, new in zip(values, (now.used / MB, now.percent, *moved), strict=True):
            value[...] = new

    return read


def file_systems(log: Logger, divider: int) -> Reader:
    """Return how full the file systems are that matter to a robot.

    Root, home, shared memory, the folder of the logs.
    """
    folders = {"root": "/", "home": str(Path.home()), "shm": "/dev/shm", "logs": log.options.folder}
    devices: dict[int, str] = {}
    for name, folder in folders.items():
        if Path(folder).is_dir():
            devices.setdefault(Path(folder).stat().st_dev, name)
    chosen = [(name, folders[name]) for name in devices.values()]
    rows = [("used", "%", LIVE), ("free", "MB", LIVE)]
    pairs = [elements(log, f"files/{name}", divider, rows) for name, _ in chosen]

    def read() -> None:
        for (used, free), (_, folder) in zip(pairs, chosen, strict=True):
            used[...], free[...] = _usage(folder)

    return read


def _usage(folder: str) -> tuple[float, float]:
    try:
        now = psutil.disk_usage(folder)
    except OSError:  # unmounted meanwhile
        return math.nan, math.nan
    return now.percent, now.free / MB


# ---------------------------------------------------------------------------------------------------------- processes


def processes(log: Logger, divider: int) -> Reader:
    """Return how many processes there are."""
    count = element(log, "process", divider, "count", "count", dtype="u4")

    def read() -> None:
        count[...] = len(psutil.pids())

    return read


def own_process(log: Logger, divider: int) -> Reader:
    """Return what this program itself takes."""
    rows = [("load", "%", LIVE), ("memory", "MB", LIVE), ("threads", "count", LIVE), ("open_files", "count", LIVE)]
    values = elements(log, "process/self", divider, rows)
    me = psutil.Process()
    me.cpu_percent()

    def read() -> None:
        with me.oneshot():
            found = (me.cpu_percent(), me.memory_info().rss / MB, me.num_threads(), me.num_fds())
        for value, new in zip(values, found, strict=True):
            value[...] = new

    return read


def uptime(log: Logger, divider: int) -> Reader:
    """Return seconds since this computer started."""
    value = element(log, "kernel", divider, "uptime", "s")

    def read() -> None:
        value[...] = time.clock_gettime(time.CLOCK_BOOTTIME)

    return read


# dividers at 20 Hz: 4 is 5 Hz, 20 is once a second
PROBES = (
    Probe(cpu_total, 2),
    Probe(cpu_cores, 4),
    Probe(cpu_shares, 4),
    Probe(cpu_frequencies, 20),
    Probe(load_average, 20),
    Probe(memory, 4),
    Probe(swap, 20),
    Probe(temperatures, 20),
    Probe(fans, 20),
    Probe(battery, 100),
    Probe(disks, 4),
    Probe(networks, 4),
    Probe(file_systems, 100),
    Probe(kernel, 4),
    Probe(pressure, 20),
    Probe(processes, 20),
    Probe(own_process, 20),
    Probe(uptime, 20),
)
