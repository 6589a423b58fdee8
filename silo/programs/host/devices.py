"""Disks, networks, sensors of the computer: which of them are there differs from machine to machine."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from silo.logger.logger import Logger
from silo.programs.host.reading import LIVE, MB, SAVE, Rates, Reader, Row, element, elements, lose, plain_name

_NOT_DISKS = ("loop", "ram", "zram", "sr", "fd", "dm-", "md")


def disks(log: Logger, divider: int) -> Reader | None:
    """Return bytes and operations of each disk (not of its partitions)."""
    names = [name for name in _disk_counters() if not name.startswith(_NOT_DISKS) and _is_whole(name)]
    if not names:
        return None
    rows: list[Row] = [
        ("read", "MB/s", LIVE),
        ("write", "MB/s", LIVE),
        ("read_operations", "1/s", SAVE),
        ("write_operations", "1/s", SAVE),
        ("busy", "%", LIVE),
        ("read_total", "MB", SAVE),
        ("write_total", "MB", SAVE),
    ]
    values = [elements(log, f"disk/{plain_name(name)}", divider, rows) for name in names]
    rates = [Rates(5) for _ in names]

    def read() -> None:
        counters = _disk_counters()
        for name, row, rate in zip(names, values, rates, strict=True):
            one = counters.get(name)
            if one is None:
                lose(row)
                continue
            busy = getattr(one, "busy_time", math.nan)
            speed = rate.update((one.read_bytes, one.write_bytes, one.read_count, one.write_count, busy))
            speed *= (1 / MB, 1 / MB, 1, 1, 0.1)  # busy: ms per s to percent
            for value, new in zip(row, (*speed, one.read_bytes / MB, one.write_bytes / MB), strict=True):
                value[...] = new

    return read


def _disk_counters() -> dict[str, Any]:
    try:
        return dict(psutil.disk_io_counters(perdisk=True, nowrap=False) or {})
    except (OSError, RuntimeError):  # containers without /sys/block
        return {}


def _is_whole(name: str) -> bool:
    """Return whether this is a disk and not a partition; where /sys doesn't tell, everything counts."""
    return not Path("/sys/block").is_dir() or Path("/sys/block", name).exists()


def networks(log: Logger, divider: int) -> Reader | None:
    """Return bytes, packets and errors of each network interface that was there at the start."""
    names = list(psutil.net_io_counters(pernic=True, nowrap=False))
    if not names:
        return None
    rows: list[Row] = [
        ("received", "kB/s", LIVE),
        ("sent", "kB/s", LIVE),
        ("received_packets", "1/s", SAVE),
        ("sent_packets", "1/s", SAVE),
        ("received_total", "MB", SAVE),
        ("sent_total", "MB", SAVE),
        ("errors", "count", LIVE),
        ("drops", "count", LIVE),
    ]
    values = [elements(log, f"network/{plain_name(name)}", divider, rows) for name in names]
    rates = [Rates(4) for _ in names]

    def read() -> None:
        counters = psutil.net_io_counters(pernic=True, nowrap=False)
        for name, row, rate in zip(names, values, rates, strict=True):
            one = counters.get(name)
            if one is None:
                lose(row)
                continue
            speed = rate.update((one.bytes_recv, one.bytes_sent, one.packets_recv, one.packets_sent))
            speed[:2] /= 1000
            totals = (one.bytes_recv / MB, one.bytes_sent / MB, one.errin + one.errout, one.dropin + one.dropout)
            for value, new in zip(row, (*speed, *totals), strict=True):
                value[...] = new

    return read


# ------------------------------------------------------------------------------------------------------------ sensors


def temperatures(log: Logger, divider: int) -> Reader | None:
    """Return every temperature sensor."""
    return _sensors(log, divider, "temperature", "degC", "sensors_temperatures")


def fans(log: Logger, divider: int) -> Reader | None:
    """Return every fan."""
    return _sensors(log, divider, "fan", "rpm", "sensors_fans")


def _sensors(log: Logger, divider: int, group: str, unit: str, function: str) -> Reader | None:
    # psutil has these functions only on systems that have sensors
    ask: Callable[[], dict[str, list[Any]]] = getattr(psutil, function, dict)
    places = [(chip, place, one.label) for chip, found in ask().items() for place, one in enumerate(found)]
    if not places:
        return None
    names = _distinct([f"{plain_name(chip)}/{plain_name(label or str(place))}" for chip, place, label in places])
    values = elements(log, group, divider, [(name, unit, LIVE) for name in names])

    def read() -> None:
        now = ask()
        for value, (chip, place, _) in zip(values, places, strict=True):
            found = now.get(chip, [])
            value[...] = found[place].current if place < len(found) else math.nan

    return read


def _distinct(names: list[str]) -> list[str]:
    """Return the names, with a number where one comes again (two disks of one model have sensors of one name)."""
    seen: dict[str, int] = {}
    made = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        made.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    return made


def battery(log: Logger, divider: int) -> Reader | None:
    """Return the battery of a laptop or a board with one."""
    ask: Callable[[], Any] = getattr(psutil, "sensors_battery", lambda: None)
    if ask() is None:
        return None
    (charge,) = elements(log, "battery", divider, [("charge", "%", LIVE)])
    plugged = element(log, "battery", divider, "plugged", dtype=bool)

    def read() -> None:
        now = ask()
        charge[...] = now.percent if now else math.nan
        plugged[...] = bool(now and now.power_plugged)

    return read
