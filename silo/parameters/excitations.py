"""Excitations of parameters, as clients ask for them: one at a time, for the link thread."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

from silo.core.tuning.excitation import check_rate, ends_of, number_at
from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterValue
from silo.errors import ElementError
from silo.parameters.excited import Excited
from silo.parameters.landing import STANDS_STILL, Landing, WaitingChange

MOST_KNOWN = 16  # of which is remembered how they ended
LOOK_S = 0.1  # between looks whether the loop still turns
STALLED_S = 1.0  # without a tick: then the value is brought back from outside of the loop
STALLED_TICKS = 3
STALLED = "the loop stands still"


@dataclass
class Excitations:
    """What was asked for, by the names that clients gave, the newest last."""

    landing: Landing
    known: dict[str, WaitingChange] = field(default_factory=dict)

    @property
    def running(self) -> WaitingChange | None:
        """The one that goes on, or waits for its first tick."""
        return next((one for one in list(self.landing.waiting) if one.excited and not one.excited.ended), None)

    def found(self, name: str) -> tuple[WaitingChange, Excited]:
        """Return one by the name that its client gave, or without a name the one that runs. Raises ElementError."""
        change = self.known.get(name) if name else self.running
        if change is None or change.excited is None:
            raise ElementError("no such excitation runs")
        return change, change.excited

    def described(self, info: ParameterInfo) -> ParameterInfo:
        """Return what a parameter is, with its present value."""
        return msgspec.structs.replace(info, value=self.landing.value(info))

    def swings(self, groups: set[str]) -> list[dict[str, ParameterValue]]:
        """Return the least and the most that values of some groups come to while they are excited."""
        one = self.running
        if one is None or one.excited is None or one.excited.info.group not in groups:
            return []
        info = one.excited.info
        return [{info.name: end} for end in ends_of(info, one.excited.what)]

    def check(self, info: ParameterInfo, what: Excitation, frequency_hz: float) -> None:
        """Raise ElementError where it can't begin now; `info` has the present value."""
        running = self.running
        if running is not None and running.excited is not None:
            raise ElementError(
                f"{running.excited.info.name} is being excited by {running.who or 'somebody'}: one at a time; "
                "nothing was changed"
            )
        if self.landing.next_row() < 0:
            raise ElementError(f"{STANDS_STILL}: start it first; nothing was changed")
        if any(info.name in change.names for change in list(self.landing.waiting)):
            raise ElementError(f"parameter '{info.name}' is on its way to another value; nothing was changed")
        check_rate(what, frequency_hz)

    def begin(
        self, info: ParameterInfo, what: Excitation, who: str, where: str, name: str, expects: Mapping[str, int]
    ) -> WaitingChange:
        """Have it begin with the next tick, around the value that `info` has. Raises ElementError where it can't."""
        what = msgspec.structs.replace(what, name=info.name)
        low, high = (number_at(end, what.index) for end in ends_of(info, what))
        change = self.landing.change({info.name: info.value}, who, where, name)
        place = self.landing.place_of(info, what.index)
        change.excited = Excited(what, info, place, number_at(info.value, what.index), low, high)
        change.expects = expects
        self.known[name] = change
        while len(self.known) > MOST_KNOWN:
            self.known.pop(next(iter(self.known)))
        self.landing.post(change)
        return change

    def stop(self, name: str, why: str) -> bool:
        """End one, or without a name the one that runs. Returns whether there was one."""
        change = self.known.get(name) if name else self.running
        if change is None or change.excited is None or change.excited.ended:
            return False
        change.excited.end_soon(why)
        return True

    def next_look_s(self) -> float | None:
        """Return when to look again whether the loop turns, of `time.monotonic`; None while nothing is excited."""
        return time.monotonic() + LOOK_S if self.running is not None else None

    def look(self, frequency_hz: float) -> None:
        """Bring a value back whose loop stands still."""
        one = self.running
        if one is None or one.excited is None:
            return
        if time.monotonic() - one.excited.went_s > max(STALLED_S, STALLED_TICKS / frequency_hz):
            one.excited.drop(STALLED)
