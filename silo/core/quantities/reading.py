"""Amounts as people write them: `1GB`, `500 MB`, `10min`, `2h`, `10k`.

One grammar for every door: a number, and a unit of time, of size or of count. A bare `m` is minutes to some, millions
or megabytes to others: where it was taken it is told, where it never was both meanings are.
"""

import logging
import re

from silo.core.arguments import shown
from silo.errors import ElementError

log = logging.getLogger("silo")

MB = 1_000_000
LEAST_SPLIT_BYTES, LEAST_SPLIT_S = MB, 1.0
MOST_SPLIT_S = 31 * 86400.0
MOST_BYTES = 10**15

_BYTES = {"b": 1, "kb": 1000, "mb": MB, "gb": 1000 * MB, "tb": 1000_000 * MB}
_BYTES |= {"k": 1000, "m": MB, "g": 1000 * MB, "t": 1000_000 * MB, "kib": 2**10, "mib": 2**20, "gib": 2**30}
SECONDS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "min": 60.0, "mins": 60.0, "h": 3600.0, "d": 86400.0, "ms": 1e-3}
SECONDS |= {"us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
COUNTS = {"": 1.0, "k": 1e3, "m": 1e6}
HERTZ = {"hz": 1.0, "khz": 1e3}
AMOUNT = r"([0-9]+\.?[0-9]*(?:e[+-]?[0-9]+)?|\.[0-9]+(?:e[+-]?[0-9]+)?)\s*([a-zA-Zµμ]*)"
_AMOUNT = re.compile(rf"\s*{AMOUNT}\s*", re.IGNORECASE | re.ASCII)


def read_split(given: object) -> tuple[int, float]:
    """Return bytes and seconds after which a part ends, 0 for the one that isn't meant; of "" both are 0.

    Raises ElementError for what is neither a size nor a time.
    """
    if given in ("", None):
        return 0, 0.0
    size, seconds = _bytes("split", given), seconds_of(given)
    if size is not None and LEAST_SPLIT_BYTES <= size <= MOST_BYTES:
        return int(size), 0.0
    if seconds is not None and LEAST_SPLIT_S <= seconds <= MOST_SPLIT_S:
        return 0, seconds
    raise ElementError(
        f"split must be a size from 1MB or a time from 1s to 31d, got {shown(given)}; write split='1GB' or '10min'; "
        "nothing is recorded"
    )


def read_seconds(argument: str, given: str) -> float:
    """Return a time in s. Raises ElementError for what is none."""
    seconds = seconds_of(given)
    if seconds is None or not 1.0 <= seconds <= 86400.0:
        raise ElementError(
            f"{argument} must be a time from 1s to 1d, got {shown(given)}; write 30s, 10min, 2h{both_meanings(given)}"
        )
    return seconds


def read_keep(given: object) -> int:
    """Return how many bytes are kept, 0 without a limit. Raises ElementError for what is no size."""
    if given in ("", None):
        return 0
    size = _bytes("keep", given)
    if size is None or not 2 * LEAST_SPLIT_BYTES <= size <= MOST_BYTES:
        raise ElementError(f"keep must be a size from 2MB, got {shown(given)}; write keep='2MB'; nothing is recorded")
    return int(size)


def seconds_of(given: object) -> float | None:
    """Return the seconds of `10min`, `20ms`, `1d`; None for what is no time with its unit, which 0 needs not."""
    amount = read_amount(given)
    if amount == (0.0, ""):
        return 0.0
    factor = SECONDS.get(amount[1].lower()) if amount is not None else None
    return amount[0] * factor if amount is not None and factor is not None else None


def read_amount(given: object) -> tuple[float, str] | None:
    """Return number and unit as they were written; None for another text."""
    found = _AMOUNT.fullmatch(given) if isinstance(given, str) else None
    return (float(found[1]), found[2]) if found else None


def both_meanings(given: object) -> str:
    """Return what a bare `m` may mean, for an error; "" for other units."""
    amount = read_amount(given)
    if amount is None or amount[1] != "m":
        return ""
    return f" (a bare m is minutes to some, a million to others: {amount[0]:g} minutes are '{amount[0]:g}min')"


def tell_bare_m(what: str, given: str, taken: str, instead: str) -> None:
    """Tell once of a bare `m` that is taken, as it always was, as `taken`, which is written by `instead`."""
    amount = read_amount(given.lstrip("=*/+- "))
    if amount is None or amount[1] != "m" or (what, given) in _told:
        return
    _told.add((what, given))
    log.warning(
        "%s %s is taken as %s; the next release will refuse it: a bare m is minutes to others; write %s%s, or %smin "
        "for minutes",
        what, given.strip(), taken, f"{amount[0]:g}", instead, f"{amount[0]:g}",
    )  # fmt: skip


_told: set[tuple[str, str]] = set()


def _bytes(what: str, given: object) -> float | None:
    amount = read_amount(given)
    factor = _BYTES.get(amount[1].lower()) if amount is not None else None
    if amount is None or factor is None:
        return None
    tell_bare_m(what, str(given), "megabytes", "MB")
    return amount[0] * factor
