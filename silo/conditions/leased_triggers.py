"""Triggers that clients hold under a lease, such as those of a scope: gone with a client that goes away.

They are in no script, no saved file and no robot process; the judge takes them beside those of the logger. May be used
by all threads.
"""

from collections.abc import Sequence

import msgspec

from silo.core.arguments import real
from silo.core.elements import Conditions, ElementInfo, LoggerOptions, TriggerOptions
from silo.errors import ElementError
from silo.rpc.leases import Leases

SHORTEST_S, LONGEST_S = 0.5, 600.0
MOST_LEASED = 16


class LeasedTriggers:
    """All of them."""

    def __init__(self) -> None:
        self._leased: Leases[str, TriggerOptions] = Leases(MOST_LEASED)

    def set(
        self, one: TriggerOptions, lease_s: float, owner: str, extras: Conditions, table: Sequence[ElementInfo],
        logger: LoggerOptions,
    ) -> bool:  # fmt: skip
        """Hold a trigger, or another one of its name; the same again only renews the lease. Whether it is a new one.

        Raises ElementError for what makes no sense beside the extras and the table of the logger.
        """
        from silo.judging.definitions import check_held, with_trigger

        real("lease_s of a trigger", lease_s, SHORTEST_S, LONGEST_S, "s")
        with self._leased:
            if self._leased.get(one.name) == one:
                self._leased.renew(one.name, lease_s, owner)
                return False
            if any(own.name == one.name for own in extras.triggers):
                raise ElementError(
                    f"trigger '{one.name}' is one of the logger: hold yours under another name; nothing was changed"
                )
            if self._leased.full(one.name, owner):
                held = ", ".join(sorted({each.owner for each in self._leased.all()}))
                raise ElementError(f"{MOST_LEASED} triggers are held by clients already ({held}); nothing was changed")
            with_trigger(extras, one, table, logger.prefix)
            check_held(one, table, logger.frequency_hz)
            self._leased.set(one.name, one, lease_s, owner)
            return True

    def drop(self, name: str) -> bool:
        """Forget one; False where there is none of that name."""
        return self._leased.drop(name) is not None

    def expire(self) -> list[tuple[str, str]]:
        """Forget those whose lease is over; returns their names and owners."""
        return [(one.key, one.owner) for one in self._leased.expire()]

    def owner(self, name: str) -> str:
        """Return who holds a trigger, empty where nobody does."""
        found = self._leased.find(name)
        return found.owner if found is not None else ""

    def beside(self, extras: Conditions) -> Conditions:
        """Return the extras of the logger with those that are held; a name that the logger has is the logger's."""
        held = [one.value for one in self._leased.all()]
        names = {one.name for one in extras.triggers}
        more = tuple(one for one in held if one.name not in names)
        return msgspec.structs.replace(extras, triggers=(*extras.triggers, *more)) if more else extras
