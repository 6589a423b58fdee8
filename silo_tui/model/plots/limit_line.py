"""Limits of a signal as lines to type. Pure functions."""

import re
from collections.abc import Mapping

from silo.core.elements import SignalLimits
from silo.errors import ElementError
from silo.judging.definitions import MOST_STALE_S, seconds
from silo_tui.model.plots.limits import WORDS
from silo_tui.model.words import text

HOW = "red low, yellow low, yellow high, red high"

WORD_OF = {"persist": "persistence", "hyst": "hysteresis", "stale": "stale", "when": "when"}  # by label

_WHEN = re.compile(r"(?:^|[\s,])when\s*=")
_WORD = re.compile(r"[\s,]*\b(\w+)\s*=\s*([^\s,]+)\s*$")


def fields_of(limits: SignalLimits) -> dict[str, str]:
    """Return limits as lines to edit, by label: their bounds, and what differs from limits that say no more."""
    fields = {
        word: text.short(bound, 12) for word, bound in zip(WORDS, limits.bounds, strict=True) if bound is not None
    }
    fields["persist"] = str(limits.persistence) if limits.persistence != 1 else ""
    fields["hyst"] = text.short(limits.hysteresis, 12) if limits.hysteresis else ""
    fields["stale"] = f"{text.short(limits.stale_s, 12)}s" if limits.stale_s else ""
    return {**fields, "when": limits.when}


def line_of(fields: Mapping[str, str]) -> str:
    """Return what is typed in these lines as `read_limits` takes it."""
    words = [f"{word}={fields[label]}" for label, word in WORD_OF.items() if fields.get(label)]
    return " ".join([", ".join(fields.get(word) or "-" for word in WORDS), *words])


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
