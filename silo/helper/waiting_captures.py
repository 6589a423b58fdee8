"""Captures that wait to be written: in turn of their triggers, and of each trigger not more than make sense.

A trigger that chatters makes captures faster than any disk takes them. It must not keep those of others waiting, nor
take the memory that they need. Any thread may call.
"""

import threading
import time
from collections import OrderedDict, deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from silo.helper.spool import Spool

MOST_WAITING = 1000  # of a trigger that keeps all its captures; of others as many as it keeps, and LEAST_WAITING
LEAST_WAITING = 20
TOLD_S = 10.0  # what is left out is told together for so long


class WaitingCaptures:
    """A queue of captures for one thread that writes them."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._turns: OrderedDict[tuple[str, str], deque[Spool]] = OrderedDict()  # by run and trigger, next one first
        self._under_way: Spool | None = None
        self._dropped: dict[tuple[str, str], list[int]] = {}  # numbers of the first and the last, and how many
        self._since_s: dict[tuple[str, str], float] = {}
        self._stop_s: float | None = None

    def add(self, spool: "Spool") -> bool:
        """Let a capture wait, the oldest of a trigger of which too many do goes; whether it is the first that went."""
        key = spool.run, spool.trigger
        with self._changed:
            waiting = self._turns.setdefault(key, deque())
            waiting.append(spool)
            is_first = False
            keep = spool.options.keep
            if len(waiting) > (max(keep, LEAST_WAITING) if keep else MOST_WAITING):
                number = waiting.popleft().capture.number
                is_first = key not in self._dropped
                self._since_s.setdefault(key, time.monotonic())
                first, _, count = self._dropped.get(key, (number, number, 0))
                self._dropped[key] = [first, number, count + 1]
            self._changed.notify()
            return is_first

    def next(self) -> "Spool | None":
        """Wait for a capture and return it, of each trigger one in turn; None at the end. It counts until `done`."""
        with self._changed:
            while not self._turns:
                if self._stop_s is not None:
                    return None
                self._changed.wait()
            if self._stop_s is not None and time.monotonic() >= self._stop_s:
                return None
            key, waiting = self._turns.popitem(last=False)
            self._under_way = waiting.popleft()
            if waiting:
                self._turns[key] = waiting  # behind the others
            return self._under_way

    def done(self) -> list[tuple[str, str]]:
        """Take in that the capture is written; returns by run, in words, what was left out until some time ago."""
        with self._changed:
            self._under_way = None
            told_s = time.monotonic() - TOLD_S
            return [self._left_out(key) for key, since_s in list(self._since_s.items()) if since_s <= told_s]

    def _left_out(self, key: tuple[str, str]) -> tuple[str, str]:
        first, last, count = self._dropped.pop(key)
        del self._since_s[key]
        return key[0], (
            f"{_captures(first, last, count)} of '{key[1]}' not written: it fired faster than they could be; give it a "
            "holdoff"
        )

    def stop(self, within_s: float) -> None:
        """End `next` when nothing waits, or after so long."""
        with self._changed:
            self._stop_s = time.monotonic() + within_s
            self._changed.notify()

    def drop_all(self) -> tuple[list[tuple[str, str]], set[str]]:
        """Forget what waits; returns by run, in words, what was not written, and of which runs somebody still can."""
        with self._changed:
            texts = [self._left_out(key) for key in list(self._dropped)]
            for (run, trigger), waiting in self._turns.items():
                first, last = waiting[0].capture.number, waiting[-1].capture.number
                what = f"{_captures(first, last, len(waiting))} of '{trigger}' not written yet"
                why = "the disk was too slow for them when the logger was closed"
                texts.append((run, f"{what}: {why}; its next start does that, or `silo recover`"))
            runs = {run for run, _ in self._turns}
            self._turns.clear()
            return texts, runs

    def all(self) -> "list[Spool]":
        """Return those that are not written yet, oldest of each trigger first."""
        with self._changed:
            under_way = [] if self._under_way is None else [self._under_way]
            return [*under_way, *(spool for waiting in self._turns.values() for spool in waiting)]


def _captures(first: int, last: int, count: int) -> str:
    return f"capture {first}" if count == 1 else f"{count} captures, numbers {first} to {last},"
