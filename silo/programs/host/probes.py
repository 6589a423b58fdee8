"""What of a computer is logged: a row per source. What this machine lacks is left out."""

import math
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import psutil

from silo.logger.logger import Logger
from silo.programs.host.reading import MB, SAVE, Measured, Probe, plain_name

Found = dict[str, float]

_SHARES = ("user", "system", "iowait", "irq", "softirq", "steal")
_MEMORY = ("used", "available", "cached", "buffers")
_NOT_DISKS = ("loop", "ram", "zram", "sr", "fd", "dm-", "md")

PERCENT, MEGABYTES, COUNT = Measured("%"), Measured("MB", scale=1 / MB), Measured("count")
_DISK = {
    "read": Measured("MB/s", scale=1 / MB, rate=True),
    "write": Measured("MB/s", scale=1 / MB, rate=True),
    "read_operations": Measured("1/s", SAVE, rate=True),
    "write_operations": Measured("1/s", SAVE, rate=True),
    "busy": Measured("%", scale=0.1, rate=True),  # ms per s
    "read_total": Measured("MB", SAVE, 1 / MB),
    "write_total": Measured("MB", SAVE, 1 / MB),
}
_NETWORK = {
    "received": Measured("kB/s", scale=1e-3, rate=True),
    "sent": Measured("kB/s", scale=1e-3, rate=True),
    "received_packets": Measured("1/s", SAVE, rate=True),
    "sent_packets": Measured("1/s", SAVE, rate=True),
    "received_total": Measured("MB", SAVE, 1 / MB),
    "sent_total": Measured("MB", SAVE, 1 / MB),
    "errors": COUNT,
    "drops": COUNT,
}
_SWAP = {
    "used": MEGABYTES,
    "percent": PERCENT,
    "in": Measured("MB/s", scale=1 / MB, rate=True),
    "out": Measured("MB/s", scale=1 / MB, rate=True),
}
_OWN = {"load": PERCENT, "memory": MEGABYTES, "threads": COUNT, "open_files": COUNT}


def _fields(found: Any, names: Iterable[str]) -> Found:
    """Return those of the names that there are on this system."""
    return {name: getattr(found, name) for name in names if hasattr(found, name)}


def _numbered(name: str, values: Iterable[float]) -> Found:
    return {f"core{core:02}/{name}": value for core, value in enumerate(values)}


def _below(members: Iterable[tuple[str, Iterable[float]]], columns: Iterable[str]) -> Found:
    """Return values by names like `sda/read`."""
    heads = list(columns)
    return {f"{name}/{head}": value for name, row in members for head, value in zip(heads, row, strict=True)}


def _frequencies() -> list[float]:
    """Return MHz per core; empty where the machine doesn't tell (containers, some ARM boards)."""
    try:
        return [one.current for one in psutil.cpu_freq(percpu=True) or []]
    except (OSError, NotImplementedError, AttributeError):
        return []


def _kernel(_: Logger) -> Found:
    now = psutil.cpu_stats()
    return {
        "context_switches": now.ctx_switches, "interrupts": now.interrupts, "soft_interrupts": now.soft_interrupts
    }  # fmt: skip


def _pressure(_: Logger) -> Found:
    """Return the share of the last 10 s in which some process waited for processor, memory or disk."""
    found: Found = {}
    for name in ("cpu", "memory", "io"):
        try:
            told = re.search(r"some avg10=([0-9.]+)", Path("/proc/pressure", name).read_text())
        except OSError:  # not in this kernel, or not allowed
            continue
        found |= {name: float(told[1])} if told else {}
    return found


def _memory(_: Logger) -> Found:
    now = psutil.virtual_memory()
    return {"percent": now.percent, **_fields(now, _MEMORY)}


def _swap(_: Logger) -> Found:
    now = psutil.swap_memory()
    return {"used": now.used, "percent": now.percent, "in": now.sin, "out": now.sout} if now.total else {}


def _file_systems(log: Logger) -> Found:
    """Return how full the file systems are that matter to a robot, each once."""
    folders = {"root": "/", "home": str(Path.home()), "shm": "/dev/shm", "logs": log.options.folder}
    found: Found = {}
    seen: set[int] = set()
    for name, folder in folders.items():
        try:
            device, now = Path(folder).stat().st_dev, psutil.disk_usage(folder)
        except OSError:  # not on this system, or unmounted meanwhile
            continue
        if device not in seen:
            seen.add(device)
            found |= {f"{name}/used": now.percent, f"{name}/free": now.free}
    return found


@cache
def _myself() -> psutil.Process:
    return psutil.Process()


def _own(_: Logger) -> Found:
    me = _myself()
    with me.oneshot():
        return dict(zip(_OWN, (me.cpu_percent(), me.memory_info().rss, me.num_threads(), me.num_fds()), strict=True))


def _disks(_: Logger) -> Found:
    """Return bytes and operations of each disk (not of its partitions)."""
    try:
        counters = psutil.disk_io_counters(perdisk=True, nowrap=False) or {}
    except (OSError, RuntimeError):  # containers without /sys/block
        return {}
    whole = {name: one for name, one in counters.items() if not name.startswith(_NOT_DISKS) and _is_whole(name)}
    rows = (
        (plain_name(name), (one.read_bytes, one.write_bytes, one.read_count, one.write_count,
                            getattr(one, "busy_time", math.nan), one.read_bytes, one.write_bytes))
        for name, one in whole.items()
    )  # fmt: skip
    return _below(rows, _DISK)


def _is_whole(name: str) -> bool:
    """Return whether this is a disk and not a partition; where /sys doesn't tell, everything counts."""
    return not Path("/sys/block").is_dir() or Path("/sys/block", name).exists()


def _networks(_: Logger) -> Found:
    rows = (
        (plain_name(name), (one.bytes_recv, one.bytes_sent, one.packets_recv, one.packets_sent, one.bytes_recv,
                            one.bytes_sent, one.errin + one.errout, one.dropin + one.dropout))
        for name, one in psutil.net_io_counters(pernic=True, nowrap=False).items()
    )  # fmt: skip
    return _below(rows, _NETWORK)


def _sensors(function: str) -> Callable[[Logger], Found]:
    """Return what asks for all sensors of a kind; psutil has these functions only on systems that have sensors."""

    def ask(_: Logger) -> Found:
        told: Mapping[str, list[Any]] = getattr(psutil, function, dict)()
        found: Found = {}
        for chip, sensors in told.items():
            for place, one in enumerate(sensors):
                name = f"{plain_name(chip)}/{plain_name(one.label or str(place))}"
                same = sum(each == name or each.startswith(f"{name}_") for each in found)
                found[f"{name}_{same + 1}" if name in found else name] = one.current
        return found

    return ask


def _battery(_: Logger) -> Found:
    now = getattr(psutil, "sensors_battery", lambda: None)()
    return {"charge": now.percent, "plugged": bool(now.power_plugged)} if now else {}


# dividers at 20 Hz: 4 is 5 Hz, 20 is once a second; the kernel counts the load of cores in 10 ms
PROBES = (
    Probe("cpu", 2, {"load": PERCENT}, lambda _: {"load": psutil.cpu_percent()}),
    Probe("cpu", 4, {"load": PERCENT}, lambda _: _numbered("load", psutil.cpu_percent(percpu=True))),
    Probe("cpu/share", 4, PERCENT, lambda _: _fields(psutil.cpu_times_percent(), _SHARES)),
    Probe("cpu", 20, {"frequency": Measured("MHz")}, lambda _: _numbered("frequency", _frequencies())),
    Probe(
        "load_average",
        20,
        Measured("-"),
        lambda _: dict(zip(("1min", "5min", "15min"), os.getloadavg(), strict=True)),
    ),
    Probe("memory", 4, {"percent": PERCENT, **dict.fromkeys(_MEMORY, MEGABYTES)}, _memory),
    Probe("swap", 20, _SWAP, _swap),
    Probe("temperature", 20, Measured("degC"), _sensors("sensors_temperatures")),
    Probe("fan", 20, Measured("rpm"), _sensors("sensors_fans")),
    Probe("battery", 100, {"charge": PERCENT, "plugged": Measured("-", dtype="?")}, _battery),
    Probe("disk", 4, _DISK, _disks),
    Probe("network", 4, _NETWORK, _networks),
    Probe("files", 100, {"used": PERCENT, "free": MEGABYTES}, _file_systems),
    Probe("kernel", 4, Measured("1/s", rate=True), _kernel),
    Probe("pressure", 20, PERCENT, _pressure),
    Probe("process", 20, Measured("count", dtype="u4"), lambda _: {"count": len(psutil.pids())}),
    Probe("process/self", 20, _OWN, _own),
    Probe("kernel", 20, Measured("s"), lambda _: {"uptime": time.clock_gettime(time.CLOCK_BOOTTIME)}),
)
