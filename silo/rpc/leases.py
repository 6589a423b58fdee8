"""What clients hold for a while, and what is forgotten when nobody renews it. The one rule for when a lease ends.

Views, streams, pins, triggers of clients, control, statistics: who keeps them says for how long, and what then.
"""

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

import msgspec

Key = TypeVar("Key")
ClosingT = TypeVar("ClosingT", bound="Closing")
Value = TypeVar("Value")


class Closing:
    """Base of what is closed at the end of a `with`."""

    close: Callable[[], None]

    def __enter__(self: ClosingT) -> ClosingT:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Lease(msgspec.Struct, Generic[Key, Value], frozen=True):
    """Something that is held: by whom, and until when, by the clock of its leases."""

    key: Key
    value: Value
    owner: str
    ends_s: float


def strange_part(of: int) -> int:
    """Return how much of something may be held by owners that nobody knows."""
    return of - of // 4


class Leases(Generic[Key, Value]):
    """What is held, by key. One whose time is over is there no more, and told once: by `expire`, or when it is dropped.

    May be used by all threads; `with leases:` does several steps as one.
    """

    def __init__(
        self,
        most: int | None = None,
        most_of_owner: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        knows: Callable[[str], bool] | None = None,
    ) -> None:
        """`most` may be held by all together, `most_of_owner` by one.

        A part of them is for owners that somebody `knows`: others call themselves whatever they like, each time anew.
        """
        self._most, self._most_of_owner, self._clock, self._knows = most, most_of_owner, clock, knows
        self._held: dict[Key, Lease[Key, Value]] = {}
        self._over: list[Lease[Key, Value]] = []  # that ended and were replaced before anybody asked
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def find(self, key: Key) -> Lease[Key, Value] | None:
        """Return the lease of a key; None where nothing is held."""
        with self._lock:
            found = self._held.get(key)
            return found if found is not None and self._clock() < found.ends_s else None

    def get(self, key: Key) -> Value | None:
        """Return what is held under a key; None for nothing."""
        found = self.find(key)
        return found.value if found is not None else None

    def all(self, but: Key | None = None) -> list[Lease[Key, Value]]:
        """Return all leases, or those of other keys than `but`."""
        with self._lock:
            now_s = self._clock()
            return [one for one in self._held.values() if now_s < one.ends_s and one.key != but]

    def full(self, key: Key, owner: str) -> tuple[int, bool] | None:
        """Return how many are held where one more of this key is too many, and whether by this owner alone."""
        others = self.all(but=key)
        if self._most is not None and len(others) >= self._most:
            return len(others), False
        strangers = self.strangers_beside(key, owner)
        if self._most is not None and strangers is not None and len(strangers) >= strange_part(self._most):
            return len(strangers), False
        own = sum(one.owner == owner for one in others)
        return (own, True) if self._most_of_owner is not None and own >= self._most_of_owner else None

    def strangers_beside(self, key: Key, owner: str) -> list[Lease[Key, Value]] | None:
        """Return what of other keys owners hold that nobody knows, as nobody knows this one; None where it is known."""
        knows = self._knows
        if knows is None or knows(owner):
            return None
        return [one for one in self.all(but=key) if not knows(one.owner)]

    def set(self, key: Key, value: Value, lease_s: float, owner: str = "") -> None:
        """Hold something for so long, in place of what is held under this key."""
        with self._lock:
            now_s, before = self._clock(), self._held.pop(key, None)
            if before is not None and now_s >= before.ends_s:
                self._over.append(before)
            self._held[key] = Lease(key, value, owner, now_s + lease_s)

    def renew(self, key: Key, lease_s: float, owner: str | None = None) -> Value | None:
        """Let it last for so long from now on, for this owner where one is named; None where nothing is held."""
        with self._lock:
            known = self.find(key)
            if known is None:
                return None
            ends_s = self._clock() + lease_s
            self._held[key] = Lease(key, known.value, known.owner if owner is None else owner, ends_s)
            return known.value

    def drop(self, key: Key) -> Value | None:
        """Let go of it, and return what it was, be its time over or not."""
        with self._lock:
            found = self._held.pop(key, None)
        return found.value if found is not None else None

    def drop_of(self, owner: str) -> list[Lease[Key, Value]]:
        """Let go of all that one holds, as one that is gone."""
        with self._lock:
            found = [one for one in self._held.values() if one.owner == owner]
            for one in found:
                del self._held[one.key]
        return found

    def expire(self) -> list[Lease[Key, Value]]:
        """Let go of what nobody renewed, and return it: each once, the oldest end first."""
        with self._lock:
            now_s = self._clock()
            over = [*self._over, *(one for one in self._held.values() if now_s >= one.ends_s)]
            self._over = []
            for one in over:
                if self._held.get(one.key) is one:
                    del self._held[one.key]
        return sorted(over, key=lambda one: one.ends_s)
