"""Triggers, limits and their alarms."""

from typing import ClassVar

from silo.ipc.conditions import LimitStatus, TriggerStatus
from silo.ipc.messages.base import Ask, Do, Done, Reply, RobotRequest, SlowAsk
from silo.model import SignalLimits, TriggerOptions


class Triggers(Reply, frozen=True):
    """All triggers, as they stood when `tick` ticks of the `run` were judged."""

    run: str
    tick: int
    triggers: list[TriggerStatus]


class TriggerTried(Reply, frozen=True, omit_defaults=True):
    """At which ticks a trigger would have fired: each with its time stamp, the last 1000 of `fires`.

    Judged were the ticks `first` to `last` with time stamps from `begin_ns` to `end_ns`; at `blind` of `judged` of them
    the condition could not be told. `capture_bytes` is about how large a capture would be, all its files together.
    """

    fires: int
    ticks: list[int]
    time_ns: list[int]
    first: int
    last: int
    begin_ns: int
    end_ns: int
    judged: int = 0
    blind: int = 0
    capture_bytes: int = 0
    why: str = ""


class Alarms(Reply, frozen=True):
    """All scalars with limits, worst first."""

    run: str
    tick: int
    limits: list[LimitStatus]


class GetTriggers(Ask[Triggers], frozen=True):
    """How do the triggers stand?"""


class TryTrigger(SlowAsk[TriggerTried], frozen=True):
    """When would this trigger have fired, in all that the buffers hold now? Its name plays no part."""

    trigger: TriggerOptions


class GetLimits(Ask[Alarms], frozen=True):
    """How do the signals with limits stand?"""


class SetTrigger(RobotRequest[Done], frozen=True):
    """Add a trigger, or replace the one of its name; judged from now on, also while it runs.

    With `lease_s` (0.5 to 600 s) the helper process alone holds it, beside those of the logger: in no script and no
    later program, and gone when the same request doesn't come again within that time, or by `RemoveTrigger`.
    """

    trigger: TriggerOptions
    lease_s: float = 0.0


class RemoveTrigger(RobotRequest[Done], frozen=True):
    """Forget a trigger; a capture that is under way goes on."""

    name: str


class SetLimits(RobotRequest[Done], frozen=True):
    """Give a signal limits, or other ones; judged from now on, also while it runs."""

    limits: SignalLimits


class RemoveLimits(RobotRequest[Done], frozen=True):
    """Forget the limits of a signal."""

    name: str


class ArmTrigger(Do[Done], frozen=True):
    """Watch again, also after the one capture of mode single, or (not `armed`) no more."""

    name: str
    armed: bool = True


class ForceTrigger(Do[Done], frozen=True):
    """Fire at the newest tick, whatever the condition says."""

    name: str


class Acknowledge(Do[Done], frozen=True):
    """I have seen the alarms of these scalars, of all without `names`. `who` is shown, the client if it is empty."""

    needs_control: ClassVar[bool] = False

    names: list[str] = []
    who: str = ""
