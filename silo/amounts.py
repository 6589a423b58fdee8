"""Amounts as people write them: `1GB`, `500 MB`, `10min`, `2h`; and times as they are told."""

import re

from silo.arguments import shown
from silo.errors import ElementError

MB = 1_000_000
LEAST_SPLIT_BYTES, LEAST_SPLIT_S = MB, 1.0
MOST_SPLIT_S = 31 * 86400.0
MOST_BYTES = 10**15

_BYTES = {"b": 1, "kb": 1000, "mb": MB, "gb": 1000 * MB, "tb": 1000_000 * MB}
_BYTES |= {"k": 1000, "m": MB, "g": 1000 * MB, "t": 1000_000 * MB, "kib": 2**10, "mib": 2**20, "gib": 2**30}
_SECONDS = {"s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
_AMOUNT = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]+)\s*")


def read_split(given: object) -> tuple[int, float]:
    """Return bytes and seconds after which a part ends, 0 for the one that isn't meant; of "" both are 0.

    Raises ElementError for what is neither a size nor a time.
    """
    if given in ("", None):
        return 0, 0.0
    amount = _read(given)
    if amount is not None and amount[1] in _BYTES:
        size = amount[0] * _BYTES[amount[1]]
        if LEAST_SPLIT_BYTES <= size <= MOST_BYTES:
            return int(size), 0.0
    elif amount is not None and amount[1] in _SECONDS:
        seconds = amount[0] * _SECONDS[amount[1]]
        if LEAST_SPLIT_S <= seconds <= MOST_SPLIT_S:
            return 0, seconds
    raise ElementError(
        f"split must be a size from 1MB or a time from 1s to 31d, got {shown(given)}; write split='1GB' or '10min'; "
        "nothing is recorded"
    )


def duration(seconds: float) -> str:
    """Return a time to three digits as people say it: `0.19 s`, `9.99 s`, `17.7 min`, `3.5 h`, `2.1 days`."""
    for limit, unit, scale in ((120.0, "s", 1.0), (7200.0, "min", 60.0), (172_800.0, "h", 3600.0)):
        if seconds < limit:
            return f"{seconds / scale:.3g} {unit}"
    days = seconds / 86_400
    return f"{days:.3g} days" if days < 1000 else f"{days:.0f} days"


def read_seconds(argument: str, given: str) -> float:
    """Return a time in s. Raises ElementError for what is none."""
    amount = _read(given)
    seconds = amount[0] * _SECONDS.get(amount[1], 0.0) if amount is not None else 0.0
    if not 1.0 <= seconds <= 86400.0:
        raise ElementError(f"{argument} must be a time from 1s to 1d, got {shown(given)}; write 30s, 10min, 2h")
    return seconds


def read_keep(given: object) -> int:
    """Return how many bytes are kept, 0 without a limit. Raises ElementError for what is no size."""
    if given in ("", None):
        return 0
    amount = _read(given)
    size = amount[0] * _BYTES.get(amount[1], 0) if amount is not None else 0
    if not 2 * LEAST_SPLIT_BYTES <= size <= MOST_BYTES:
        raise ElementError(f"keep must be a size from 2MB, got {shown(given)}; write keep='50GB'; nothing is recorded")
    return int(size)


def _read(given: object) -> tuple[float, str] | None:
    found = _AMOUNT.fullmatch(given) if isinstance(given, str) else None
    return (float(found[1]), found[2].lower()) if found else None
