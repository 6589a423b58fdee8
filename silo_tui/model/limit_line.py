"""Limits of a signal as one line to type. Pure functions."""

import re

from silo.core.elements import SignalLimits
from silo.errors import ElementError
from silo.judging.definitions import MOST_STALE_S, seconds

HOW = "red low, yellow low, yellow high, red high"

_WHEN = re.compile(r"(?:^|[\s,])when\s*=")
_WORD = re.compile(r"[\s,]*\b(\w+)\s*=\s*([^\s,]+)\s*$")


def limits_line(limits: SignalLimits) -> str:
    """Return what `read_limits` takes: four bounds, and what differs from limits that say no more."""
    words = [", ".join("-" if bound is None else f"{bound:.12g}" for bound in limits.bounds)]
    if limits.persistence != 1:
        words.append(f"persistence={limits.persistence}")
    if limits.hysteresis:
        words.append(f"hysteresis={limits.hysteresis:.12g}")
    if limits.stale_s:
        words.append(f"stale={limits.stale_s:.12g}s")
    if limits.when:
        words.append(f"when={limits.when}")
    return " ".join(words)


def read_limits(line: str, before: SignalLimits) -> SignalLimits:
    """Return limits of the signal of `before`, which has what the line says nothing of. Raises ElementError."""
    found = _WHEN.search(line)
    rest, when = (line[: found.start()], line[found.end() :].strip()) if found else (line, before.when)
    given: dict[str, str] = {}
    while word := _WORD.search(rest):
        given[word[1]] = word[2]
        rest = rest[: word.start()]
    if unknown := sorted(given.keys() - {"persistence", "hysteresis", "stale"}):
        raise ElementError(
            f"'{unknown[0]}' is nothing of limits: write persistence=3 hysteresis=1 stale=0.5s when=EXPRESSION (last) "
            "behind the bounds; nothing was changed"
        )
    words = [word.strip() for word in rest.split(",")]
    try:
        bounds = [None if word in ("-", "") else float(word) for word in words]
        persistence = int(given.get("persistence", before.persistence))
        hysteresis = float(given.get("hysteresis", before.hysteresis))
    except ValueError:
        bounds = []
    if len(bounds) != 4:
        raise ElementError(
            f"'{line.strip()}' are no limits: write {HOW} (- for none), then persistence=3 hysteresis=1 stale=0.5s "
            "when=EXPRESSION as you need them; nothing was changed"
        )
    stale = seconds("stale", given["stale"], MOST_STALE_S) if "stale" in given else before.stale_s
    low, warn_low, warn_high, high = bounds
    return SignalLimits(before.name, (low, warn_low, warn_high, high), persistence, hysteresis, stale, when)
