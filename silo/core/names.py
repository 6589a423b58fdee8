"""Which elements patterns mean: the rule of all commands."""

import re
from collections.abc import Sequence
from fnmatch import translate


def _matcher(pattern: str) -> "re.Pattern[str]":
    """An element, a namespace, or a glob (`*` crosses `/`); what begins with neither `/` nor `*` may begin anywhere.

    Behind a `/`, that is.
    """
    anchored = pattern if pattern.startswith(("/", "*")) else f"*/{pattern}"
    anchored = anchored.rstrip("/") or "/*"
    return re.compile(f"{translate(anchored)}|{translate(anchored + '/*')}")


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The names that a pattern means; all without patterns."""
    if not patterns:
        return list(names)
    chosen = {place for pattern in patterns for place in places(names, pattern)}
    return [name for place, name in enumerate(names) if place in chosen]


def places(names: Sequence[str], pattern: str) -> list[int]:
    """Which names a pattern means: `/joints/q` one without its prefix, too, where nothing is called so."""
    for one in dict.fromkeys((pattern, pattern.lstrip("/"))):
        matcher = _matcher(one)
        if found := [place for place, name in enumerate(names) if matcher.match(name)]:
            return found
    return []
