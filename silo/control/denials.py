"""What was denied: logins, and changes by who may not make them. Each is told, and a flood of them in a few lines."""

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from silo.core.quantities.writing import duration

FIRST_S, LONGEST_S = 60.0, 3600.0  # between two lines of one kind, twice as long each time that it went on
MOST_KINDS = 32  # of which each has lines of its own
COUNTED_S = 3600.0
_MINUTE_S = 60.0

log = logging.getLogger("silo.helper")


@dataclass
class _Kind:
    """What was denied to somebody: when it is told again, and how many came since it was told."""

    due_s: float
    wait_s: float
    since_s: float
    untold: int = 0


class Denials:
    """Counts what was denied, and tells it by `tell(text, who)`, else on the console. Any thread may note."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.tell: Callable[[str, str], object] | None = None
        self._now = now
        self._lock = threading.Lock()
        self._kinds: dict[tuple[str, str], _Kind] = {}
        self._minutes: dict[int, int] = {}
        self._last = ""

    @property
    def count(self) -> int:
        """How many there were within the last hour."""
        with self._lock:
            self._forget()
            return sum(self._minutes.values())

    @property
    def told(self) -> tuple[int, str]:
        """How many there were within the last hour, and the last of them in words."""
        count = self.count
        return count, self._last if count else ""

    def note(self, what: str, who: str) -> None:
        """Take one in; the first of its kind is told at once."""
        with self._lock:
            now_s = self._now()
            self._forget()
            self._last = f"{what}, by {who}"
            minute = int(now_s // _MINUTE_S)
            self._minutes[minute] = self._minutes.get(minute, 0) + 1
            key = (what, who)
            if key not in self._kinds and len(self._kinds) >= MOST_KINDS:
                key = ("logins and changes were denied", "several others")
            known = self._kinds.get(key)
            if known is not None:
                known.untold += 1
                return
            self._kinds[key] = _Kind(now_s + FIRST_S, FIRST_S, now_s)
        self._say(*key)

    def watch(self) -> None:
        """Tell how many more there were, where it is time."""
        due: list[tuple[str, str]] = []
        with self._lock:
            now_s = self._now()
            for (what, who), kind in list(self._kinds.items()):
                if now_s < kind.due_s:
                    continue
                if not kind.untold:
                    del self._kinds[what, who]  # it ended: the next one is told at once
                    continue
                due.append((f"{what}, {kind.untold} more in {duration(now_s - kind.since_s)}", who))
                wait_s = min(2 * kind.wait_s, LONGEST_S)
                self._kinds[what, who] = _Kind(now_s + wait_s, wait_s, now_s)
        for text, who in due:
            self._say(text, who)

    def _forget(self) -> None:
        oldest = math.floor((self._now() - COUNTED_S) / _MINUTE_S)
        self._minutes = {minute: count for minute, count in self._minutes.items() if minute > oldest}

    def _say(self, text: str, who: str) -> None:
        if self.tell is not None:
            self.tell(text, who)
        else:
            log.warning("%s, by %s", text, who)
