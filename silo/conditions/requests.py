"""Triggers, limits and their alarms, and signals that are computed from others: what a client may ask."""

from collections.abc import Sequence

from silo.conditions.standing import LimitStatus, TriggerStatus
from silo.core.arguments import line, text, texts
from silo.core.calls import told_class
from silo.core.conditions import Derived, SignalLimits, TriggerOptions
from silo.rpc.declaring import Caller, Lane, Reply, ask, change, given

_EXAMPLE = 'client.derive("power", "joints/tau * joints/qd")'


class Triggers(Reply, frozen=True):
    """All triggers, as they stood when `tick` ticks of the `run` were judged."""

    run: str
    tick: int
    triggers: list[TriggerStatus]


class TriggerTried(Reply, frozen=True, omit_defaults=True):
    """At which ticks a trigger would have fired: each with its time stamp, the last 1000 of `fires`.

    Judged were the ticks `first` to `last` with time stamps from `begin_ns` to `end_ns`; at `blind` of `judged` of them
    the condition could not be told, at `held` of them it held: of one that holds all the time nothing ever fires.
    `capture_bytes` is about how large a capture would be, all its files together.
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
    held: int = 0


class Alarms(Reply, frozen=True):
    """All scalars with limits, worst first."""

    run: str
    tick: int
    limits: list[LimitStatus]


@told_class("client")
class ConditionRequests(Caller):
    """Triggers, limits, derived signals."""

    @ask("GetTriggers")
    def triggers(self) -> Triggers:
        """Return how the triggers stand.

        Returns:
            Each with its options and state, and how often it fired in this run.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """

    @ask(slow=True)
    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        """Return when a trigger would have fired in all that the buffers hold; nothing is set or captured.

        Args:
            trigger: as `trigger` makes it; its name plays no part.

        Returns:
            How many `fires`, with ticks since start and time stamps in ns of the last 1000; how much was judged, and
            about how many bytes a capture would have. `why` says why nothing could be judged.

        Raises:
            RefusedError: a condition, word or time of it makes no sense, or nothing was logged yet.
        """

    @change(robot=True)
    def _set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
        """Add a trigger or replace the one of its name; judged from now on, also while the logger runs.

        With a lease of 0.5 to 600 s the helper process holds it for so long, unless the same is set again meanwhile; it
        is in no script and no saved file. In mode auto, which has no files, it fires by itself `patience_s` after the
        end of a capture.
        """

    @change(robot=True)
    def _remove_trigger(self, name: str) -> str:
        """Forget a trigger, also while the logger runs; a capture that is under way goes on."""

    @change(lane=Lane.ROBOT)
    def arm_trigger(self, name: str, *, armed: bool = True) -> str:
        """Have a trigger watch again, also after the one capture of mode single, or no more.

        A trigger that is off stays so for the next run and in scripts. A capture that is under way goes on.

        Args:
            name: of the trigger.
            armed: False: it fires no more, until it is armed or forced.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is none of that name, the robot program has ended, or the helper process is too busy
                judging rows; the message says which.
            GoesOnError: the robot program takes longer.
        """

    @change()
    def force_trigger(self, name: str) -> str:
        """Fire a trigger at the newest tick, whatever its condition says, armed or not.

        Args:
            name: of the trigger.

        Returns:
            What was done, in words, with the tick.

        Raises:
            RefusedError: there is none of that name, the logger doesn't run, or the helper process is too busy judging
                rows.
        """

    @ask("GetLimits")
    def alarms(self) -> Alarms:
        """Return how the signals with limits stand.

        Returns:
            Every scalar with limits, worst first.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """

    @change(control=False)
    def acknowledge(self, names: Sequence[str] = (), who: str = "") -> str:
        """Say that somebody has seen alarms; a scalar that is beyond its limits stays so.

        Args:
            names: the scalars, as `alarms` has them; all without names.
            who: has seen them; empty: this client.

        Returns:
            How many alarms were new and who has seen them, in words.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
            ElementError: the names are no list of texts; nothing was asked.
        """
        return given(names=texts("names", names, "['/log/joints/q_0']"))

    @change(robot=True)
    def _set_limits(self, limits: SignalLimits) -> str:
        """Give a signal limits, or other ones than it has; judged from now on, also while the logger runs."""

    @change(robot=True)
    def _remove_limits(self, name: str) -> str:
        """Forget the limits of a signal, also while the logger runs."""

    def derive(self, name: str, expression: str | None, unit: str = "") -> str:
        """Have a signal computed from others wherever rows are read, also while the logger runs.

            client.derive("power", "joints/tau * joints/qd", unit="W")

        It is watched, plotted and saved as elements are, and recorded from then on. Given again, it gets a new
        expression, which a recording has from the next run on.

        Args:
            name: with or without the prefix of the logger; of letters, digits, blanks and / _ - . +.
            expression: may use elements and other derived signals; None forgets the signal, on which nothing may stand.
            unit: instead of the one that follows from its signals.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: it can't be computed, and why, or the robot program has ended; nothing was changed.
            ElementError: name or expression is no text; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        if expression is None:
            return self._remove_derived(name)
        name, expression = text("the signal's name", name, _EXAMPLE), text("expression", expression, _EXAMPLE)
        return self._set_derived(Derived(name, expression, line("unit", unit, 'unit="W"')))

    @change(robot=True)
    def _set_derived(self, derived: Derived) -> str:
        """Derive a signal from others, or give one of that name another expression; also while the logger runs.

        The name is whole, or without the logger's prefix.
        """

    @change(robot=True)
    def _remove_derived(self, name: str) -> str:
        """Forget a derived signal on which nothing stands, also while the logger runs."""
        return given(name=text("the signal's name", name, 'client.derive("power", None)'))
