"""What belongs to a log beside its elements: derived signals, limits, triggers, and what a trigger captured.

Like the other nouns these stand in the script, on the wire and in saved files; `silo.judging` has the rules.
"""

from typing import TypeAlias

import msgspec

from silo.core.elements import FileType, Word

Bounds: TypeAlias = tuple[float | None, float | None, float | None, float | None]
"""Red low, yellow low, yellow high, red high; None for none."""

NO_BOUNDS: Bounds = (None, None, None, None)


class Derived(msgspec.Struct, frozen=True):
    """A signal that is computed from others wherever rows are read: `name` is whole, `unit` may be empty."""

    name: str
    expression: str
    unit: str = ""


class LimitOptions(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """What values are held against.

    `persistence` samples in a row make a state, `hysteresis` is how far inside a bound it ends, `stale_s` how long a
    value may stay the same (0: for ever), `when` a condition that must hold.
    """

    bounds: Bounds = NO_BOUNDS
    persistence: int = 1
    hysteresis: float = 0.0
    stale_s: float = 0.0
    when: str = ""


class SignalLimits(LimitOptions, frozen=True, omit_defaults=True):
    """Limits of an element or of one scalar of it."""

    name: str


AROUND_S = 1.0  # captured before and after each fire, where who makes a trigger at a terminal says nothing of it
CLIENTS_KEEP = (
    100  # captures of a trigger of which a client doesn't say how many: one that fires all the time has no end
)


class TriggerOptions(msgspec.Struct, frozen=True, omit_defaults=True):
    """A condition, and what is captured around the ticks at which it fires; see `Logger.trigger`.

    `slope` (people write `edge`, see `CALLED`) and `mode` are words of `silo.judging.triggers`, `keep` is how
    many captures stay on the disk, 0 for all. Not `armed`, it is kept and fires never. In mode auto it fires by
    itself `patience_s` after the end of a capture.
    """

    name: str
    when: str
    pre_s: float = 0.0
    post_s: float = 0.0
    slope: str = "rising"
    rearm: str = ""
    persist_s: float = 0.0
    holdoff_s: float = 0.0
    mode: str = "normal"
    save: tuple[FileType, ...] = (FileType.SILO,)
    keep: int = 0
    armed: bool = True
    patience_s: float = 0.0


CALLED = {  # where people write them: in programs, the shell and scripts; others are called as they are
    "pre_s": "pre",
    "post_s": "post",
    "persist_s": "persist",
    "holdoff_s": "holdoff",
    "patience_s": "patience",
    "stale_s": "stale",
    "slope": "edge",
}


def new_trigger(name: str = "", when: str = "", pre_s: float = AROUND_S, post_s: float = AROUND_S) -> TriggerOptions:
    """Return a trigger as one begins that is made at a terminal."""
    return TriggerOptions(name, when, pre_s, post_s, keep=CLIENTS_KEEP)


class TriggerWord(Word):
    """What a trigger does now."""

    ARMED = "armed"
    FIRING = "firing"  # a capture is under way
    HOLDOFF = "holdoff"
    BLIND = "blind"  # its condition can't be told
    FIRED = "fired"  # once, in mode single: arm it again
    OFF = "off"
    WAITING = "waiting"  # there is no run
    OTHER = "other"


class CaptureFacts(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a log is if a trigger captured it: ticks `first` to `last` were asked for, around those of `fires`.

    `ended` tells why it is shorter, empty if it isn't.
    """

    trigger: str
    number: int
    first: int
    last: int
    fires: tuple[int, ...] = ()
    fires_ns: tuple[int, ...] = ()
    ended: str = ""


class Conditions(msgspec.Struct, frozen=True, omit_defaults=True):
    """What belongs to a log beside its elements. A derived signal may use those before it."""

    derived: tuple[Derived, ...] = ()
    limits: tuple[SignalLimits, ...] = ()
    triggers: tuple[TriggerOptions, ...] = ()
    capture: CaptureFacts | None = None

    @property
    def judged(self) -> bool:
        """Whether there is a limit or a trigger."""
        return bool(self.limits or self.triggers)


NO_CONDITIONS = Conditions()
