"""Triggers, limits and their alarms."""

from collections.abc import Sequence

from silo.arguments import texts
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import (
    Acknowledge,
    Alarms,
    ArmTrigger,
    ForceTrigger,
    GetLimits,
    GetTriggers,
    RemoveLimits,
    RemoveTrigger,
    SetLimits,
    SetTrigger,
    Triggers,
    TriggerTried,
    TryTrigger,
)
from silo.model import SignalLimits, TriggerOptions


@told_class("client")
class ConditionCalls(Calls):
    """Triggers and limits."""

    def triggers(self) -> Triggers:
        """Return how the triggers stand.

        Returns:
            Each with its options and state, and how often it fired in this run.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """
        return self._call(GetTriggers(client=self._name))

    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        """Return when a trigger would have fired in all that the buffers hold; nothing is set or captured.

        Args:
            trigger: as for `set_trigger`; its name plays no part.

        Returns:
            How many `fires`, with ticks since start and time stamps in ns of the last 1000; how much was judged, and
            about how many bytes a capture would have. `why` says why nothing could be judged.

        Raises:
            RefusedError: a condition, word or time of it makes no sense, or nothing was logged yet.
        """
        return self._call(TryTrigger(trigger=trigger, client=self._name))

    def set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
        """Add a trigger or replace the one of its name; judged from now on, also while the logger runs.

        Args:
            trigger: its condition and what it captures, times in s; `Logger.trigger` tells what they mean. Without any
                file type in `save` it captures nothing: `triggers` tells when it fired. In mode auto, which has no
                files, it fires by itself `patience_s` after the end of a capture.
            lease_s: 0: it is one of the logger's from now on. 0.5 to 600: the helper process holds it for so long,
                unless the same is set again meanwhile; it is in no script and no saved file.

        Returns:
            What was done, in words, with what its captures will lack.

        Raises:
            RefusedError: a name, condition or number makes no sense, `pre_s` is longer than what buffers hold (the
                message has the size that would do), or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(SetTrigger(trigger=trigger, lease_s=lease_s, client=self._name)).text

    def remove_trigger(self, name: str) -> str:
        """Forget a trigger, also while the logger runs; a capture that is under way goes on.

        Args:
            name: of the trigger.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is none of that name, or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(RemoveTrigger(name=name, client=self._name)).text

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
        return self._call(ArmTrigger(name=name, armed=armed, client=self._name)).text

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
        return self._call(ForceTrigger(name=name, client=self._name)).text

    def alarms(self) -> Alarms:
        """Return how the signals with limits stand.

        Returns:
            Every scalar with limits, worst first.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """
        return self._call(GetLimits(client=self._name))

    def acknowledge(self, names: Sequence[str] = (), who: str = "") -> str:
        """Say that somebody has seen alarms; a scalar that is beyond its limits stays so.

        Args:
            names: the scalars, as `alarms` has them; all without names.
            who: has seen them; empty: this client.

        Returns:
            How many alarms there were and who has seen them, in words.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
            ElementError: the names are no list of texts; nothing was asked.
        """
        seen = texts("names", names, "['/log/joints/q_0']")
        return self._call(Acknowledge(names=seen, who=who, client=self._name)).text

    def set_limits(self, limits: SignalLimits) -> str:
        """Give a signal limits, or other ones than it has; judged from now on, also while the logger runs.

        Args:
            limits: the signal's name and its bounds, in the signal's unit; `Logger.limit` tells what they mean.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is no such signal, its bounds, a number or its condition make no sense, or the robot
                program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(SetLimits(limits=limits, client=self._name)).text

    def remove_limits(self, name: str) -> str:
        """Forget the limits of a signal, also while the logger runs.

        Args:
            name: exactly the one that they were given to.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: no limits were given to it, or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(RemoveLimits(name=name, client=self._name)).text
