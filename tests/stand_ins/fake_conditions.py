"""Triggers, limits and derived signals of a made-up logger."""

from collections.abc import Sequence

from silo.conditions.requests import Alarms, Triggers, TriggerTried
from silo.conditions.standing import TriggerStatus
from silo.core.conditions import Derived, SignalLimits, TriggerOptions, TriggerWord
from silo.core.elements import join_name
from silo.errors import ElementError
from silo.judging.checks import table_catalogue, with_derived, without_derived
from silo.rpc.refusals import RefusedWhy
from tests.stand_ins.fake_signals import refused


class FakeConditions:
    """What is judged, and computed where it is read."""

    def triggers(self) -> Triggers:
        self._ask()
        return Triggers("run", self.ticks, list(self.trigger_statuses))

    def alarms(self) -> Alarms:
        self._ask()
        return Alarms("run", self.ticks, list(self.limit_statuses))

    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        self._ask()
        if "nobody" in trigger.when:
            raise refused(RefusedWhy.INVALID, "no signal is named 'nobody'")
        begin, end = self.now_ns - 60 * 10**9, self.now_ns
        return TriggerTried(3, [1, 2, 3], [begin, begin + 30 * 10**9, end], 0, 6000, begin, end, 6000, 0, 1_900_000)

    def _set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
        self._ask()
        self.calls.append(("set_trigger", trigger))
        made = TriggerStatus(trigger, TriggerWord.ARMED, owner="this client" if lease_s else "")
        self.trigger_statuses = [one for one in self.trigger_statuses if one.options.name != trigger.name] + [made]
        return f"trigger '{trigger.name}' is set"

    def _remove_trigger(self, name: str) -> str:
        self._ask()
        self.calls.append(("remove_trigger", name))
        self.trigger_statuses = [one for one in self.trigger_statuses if one.options.name != name]
        return f"trigger '{name}' is removed"

    def arm_trigger(self, name: str, *, armed: bool = True) -> str:
        self._ask()
        self.calls.append(("arm_trigger", name, armed))
        return f"trigger '{name}' is {'armed' if armed else 'off'}"

    def force_trigger(self, name: str) -> str:
        self._ask()
        self.calls.append(("force_trigger", name))
        return f"trigger '{name}' was fired by hand at tick {self.ticks}"

    def acknowledge(self, names: Sequence[str] = (), who: str = "") -> str:
        self._ask()
        self.calls.append(("acknowledge", *names))
        return "1 alarm seen by ann"

    def _set_limits(self, limits: SignalLimits) -> str:
        self._ask()
        self.calls.append(("set_limits", limits))
        return f"limits of '{limits.name}' are set"

    def _remove_limits(self, name: str) -> str:
        self._ask()
        self.calls.append(("remove_limits", name))
        return f"limits of '{name}' are removed"

    def derive(self, name: str, expression: str, unit: str = "") -> str:
        self._ask()
        self.calls.append(("derive", name, expression, unit))
        if self.refuse_derived:
            raise refused(RefusedWhy.INVALID, self.refuse_derived)
        whole = Derived(join_name("/log", "", name), expression, unit)
        try:
            self.derived = with_derived(self.conditions, whole, table_catalogue(self.elements, "/log")).derived
        except ElementError as error:
            raise refused(RefusedWhy.INVALID, str(error)) from error
        self.revision += 1
        return f"'{whole.name}' is derived: {expression}"

    def _remove_derived(self, name: str) -> str:
        self._ask()
        self.calls.append(("remove_derived", name))
        try:
            self.derived = without_derived(self.conditions, name, table_catalogue(self.elements, "/log")).derived
        except ElementError as error:
            raise refused(RefusedWhy.INVALID, str(error)) from error
        self.revision += 1
        return f"'{name}' is derived no more"
