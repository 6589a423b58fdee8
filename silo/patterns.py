"""Which elements patterns mean: the rule of all commands."""

import re
from collections.abc import Sequence
from fnmatch import translate


def pattern_matcher(pattern: str) -> "re.Pattern[str]":
    """An element, a namespace, or a glob (`*` crosses `/`); what begins with neither `/` nor `*` may begin anywhere.

    Behind a `/`, that is.
    """
    anchored = pattern if pattern.startswith(("/", "*")) else f"*/{pattern}"
    anchored = anchored.rstrip("/") or "/*"
    return re.compile(f"{translate(anchored)}|{translate(anchored + '/*')}")


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The names that a pattern means; all without patterns."""
    matchers = [pattern_matcher(pattern) for pattern in patterns]
    return [name for name in names if not matchers or any(matcher.match(name) for matcher in matchers)]
