"""Triggers that clients hold under a lease, such as those of a scope: gone with a client that goes away.

They are in no script, no saved file and no robot process; the judge takes them beside those of the logger. May be used
by all threads.
"""

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from silo.arguments import real
from silo.errors import ElementError
from silo.model import ElementInfo, Extras, LoggerOptions, TriggerOptions

SHORTEST_S, LONGEST_S = 0.5, 600.0
MOST_LEASED = 16


@dataclass
class _Leased:
    options: TriggerOptions
    owner: str
    lease_s: float
    expires_s: float


class LeasedTriggers:
    """All of them."""

    def __init__(self) -> None:
        self._leased: dict[str, _Leased] = {}
        self._lock = threading.Lock()

    def set(
        self, one: TriggerOptions, lease_s: float, owner: str, extras: Extras, table: Sequence[ElementInfo],
        logger: LoggerOptions,
    ) -> bool:  # fmt: skip
        """Hold a trigger, or another one of its name; the same again only renews the lease. Whether it is a new one.

        Raises ElementError for what makes no sense beside the extras and the table of the logger.
        """
        from silo.judging.extras import check_held, with_trigger

        real("lease_s of a trigger", lease_s, SHORTEST_S, LONGEST_S, "s")
        self.expire()
        with self._lock:
            known = self._leased.get(one.name)
            if known is not None and known.options == one:
                known.lease_s, known.expires_s, known.owner = lease_s, time.monotonic() + lease_s, owner
                return False
            if any(own.name == one.name for own in extras.triggers):
                raise ElementError(
                    f"trigger '{one.name}' is one of the logger: hold yours under another name; nothing was changed"
                )
            if known is None and len(self._leased) >= MOST_LEASED:
                held = ", ".join(sorted({each.owner for each in self._leased.values()}))
                raise ElementError(f"{MOST_LEASED} triggers are held by clients already ({held}); nothing was changed")
            with_trigger(extras, one, table, logger.prefix)
            check_held(one, table, logger.frequency_hz)
            self._leased[one.name] = _Leased(one, owner, lease_s, time.monotonic() + lease_s)
            return True

    def drop(self, name: str) -> bool:
        """Forget one; False where there is none of that name."""
        with self._lock:
            return self._leased.pop(name, None) is not None

    def expire(self) -> list[tuple[str, str]]:
        """Forget those whose lease is over; returns their names and owners."""
        now_s = time.monotonic()
        with self._lock:
            over = [(name, one.owner) for name, one in self._leased.items() if now_s >= one.expires_s]
            for name, _ in over:
                del self._leased[name]
        return over

    def owner(self, name: str) -> str:
        """Return who holds a trigger, empty where nobody does."""
        with self._lock:
            return self._leased[name].owner if name in self._leased else ""

    def beside(self, extras: Extras) -> Extras:
        """Return the extras of the logger with those that are held; a name that the logger has is the logger's."""
        with self._lock:
            held = [one.options for one in self._leased.values()]
        names = {one.name for one in extras.triggers}
        more = tuple(one for one in held if one.name not in names)
        return msgspec.structs.replace(extras, triggers=(*extras.triggers, *more)) if more else extras
