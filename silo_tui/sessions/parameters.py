"""The parameters of an open logger: what they are, and what was set from here, which can be undone."""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

import msgspec

from silo.core.quantities.writing import and_more
from silo.core.tuning.parameters import ParameterInfo, ParameterValue, value_text
from silo.errors import ElementError
from silo_tui.model.lists.parameters import stepped, why_fixed
from silo_tui.sessions.link import Link

MOST_STEPS_BACK = 100
ONE_TURN_S = 2.0  # arrows that rest for longer begin another step back

Values = dict[str, ParameterValue]


class Set(msgspec.Struct, frozen=True):
    """What was set from here at once: before and after. `turned_s`: when, by arrows: the next ones may join it."""

    before: Values
    after: Values
    turned_s: float = -math.inf


class Knobs(msgspec.Struct):
    """What a screen knows of parameters, and where arrows have come to that nobody answered yet.

    One change waits for the answer of the one before: what is undone is what was set last, on a slow link too.
    """

    known: dict[str, ParameterInfo] = msgspec.field(default_factory=dict)
    locked: bool = False
    preset: str = ""  # the file that they are compared with
    beside: Values = msgspec.field(default_factory=dict)  # its values
    done: list[Set] = msgspec.field(default_factory=list)
    undone: list[Set] = msgspec.field(default_factory=list)
    asked: Values = msgspec.field(default_factory=dict)
    _sending: bool = False
    _waiting: int = 0
    _one: asyncio.Lock = msgspec.field(default_factory=asyncio.Lock)

    @asynccontextmanager
    async def _in_turn(self) -> AsyncIterator[None]:
        self._waiting += 1
        try:
            await self._one.acquire()
        finally:
            self._waiting -= 1
        try:
            yield
        finally:
            self._one.release()

    async def refresh(self, link: Link) -> None:
        """Ask for all of them."""
        table = await link.read(lambda client: client._list_parameters())
        self.known = {one.name: one for one in table.parameters}
        self.locked = table.locked

    def forget(self) -> None:
        """Take nothing back of what was set in a robot program that is gone: the new one begins with its own values."""
        self.done.clear()
        self.undone.clear()

    def check(self, name: str) -> ParameterInfo:
        """Return a parameter that may be set. Raises ElementError, which says why not."""
        info = self.known.get(name)
        if info is None:
            raise ElementError(f"{name} is no parameter: the program offers it not to be tuned")
        if why := why_fixed(info, locked=self.locked):
            raise ElementError(why)
        return info

    async def set(self, link: Link, values: Mapping[str, ParameterValue]) -> str:
        """Set some as one change; return what became of it, in words. It can be undone."""
        async with self._in_turn():
            return await self._change(link, values)

    async def _change(self, link: Link, values: Mapping[str, ParameterValue], *, turned: bool = False) -> str:
        before = {name: self.check(name).value for name in values}
        words = await self._set(link, values)
        self.undone.clear()
        now_s = time.monotonic()
        last = self.done[-1] if self.done else None
        if turned and last is not None and now_s - last.turned_s < ONE_TURN_S and last.after == before:
            self.done[-1] = Set(last.before, dict(values), now_s)
        else:
            self.done = [*self.done[-MOST_STEPS_BACK + 1 :], Set(before, dict(values), now_s if turned else -math.inf)]
        return words

    async def undo(self, link: Link, *, again: bool = False) -> str:
        """Take back what was set last from here, or set it again. Raises ElementError where somebody set it since."""
        async with self._in_turn():
            of, to = (self.undone, self.done) if again else (self.done, self.undone)
            if not of:
                raise ElementError("nothing to redo" if again else "nothing is left to take back")
            last = of[-1]
            is_now, becomes = (last.before, last.after) if again else (last.after, last.before)
            await self.refresh(link)
            of.pop()  # what somebody else set since is not taken back: the one before it is next
            for name, value in is_now.items():
                if (info := self.known.get(name)) is not None and info.value != value:
                    short = name.rpartition("/")[2]
                    raise ElementError(
                        f"somebody else set {short} to {value_text(info.value, info.unit)} since: that stays; type it, "
                        "or undo once more for what was before"
                    )
            words = await self._set(link, becomes)
            to.append(last)
            return words

    async def turn(self, link: Link, name: str, steps: int) -> str:
        """Move a number on, from where the last of these went: a slow link brings several steps as one change."""
        if self._sending and not self._waiting:
            self._ask(name, steps)
            return ""
        async with self._in_turn():
            words, self._sending = "", True
            try:
                self._ask(name, steps)
                while self.asked:
                    one, value = next(iter(self.asked.items()))
                    info = self.known[one]
                    if value == info.value:
                        words = f"{one.rpartition('/')[2]} is {value_text(value, info.unit)}: it goes no further"
                    else:
                        words = await self._change(link, {one: value}, turned=True)
                    if self.asked[one] == value:
                        del self.asked[one]
            finally:
                self.asked.clear()  # also of those that failed, or whose screen was left
                self._sending = False
            return words

    def _ask(self, name: str, steps: int) -> None:
        info = self.check(name)
        self.asked[name] = stepped(info, self.asked.get(name, info.value), steps)

    async def _set(self, link: Link, values: Mapping[str, ParameterValue]) -> str:
        told = await link.call(lambda client: client.parameters.set(values).text)
        await self.refresh(link)
        now = [self.known[name] for name in values if name in self.known]
        first = [f"{one.name.rpartition('/')[2]} {value_text(one.value, one.unit)}" for one in now]
        return f"{and_more(first, 3)}: {told}"
