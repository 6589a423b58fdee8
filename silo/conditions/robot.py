"""Triggers, limits and derived signals, as the robot program sets them for its clients."""

from dataclasses import dataclass
from typing import Protocol

from silo.conditions import requests
from silo.core.conditions import Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import ElementInfo, LoggerOptions, join_name
from silo.rpc.serving import Server


class ConditionsOfLogger(Protocol):
    """A logger, seen from here."""

    options: LoggerOptions

    @property
    def is_running(self) -> bool: ...
    @property
    def elements(self) -> list[ElementInfo]: ...
    @property
    def now(self) -> Conditions: ...

    def _set_trigger(self, trigger: TriggerOptions, /) -> None: ...
    def _remove_trigger(self, name: str, /) -> None: ...
    def _set_limits(self, limits: SignalLimits, /) -> None: ...
    def _remove_limits(self, name: str, /) -> None: ...
    def derive(self, name: str, expression: str, *, unit: str = "") -> None: ...
    def _remove_derived(self, name: str, /) -> None: ...
    def less_captured(self) -> list[str]: ...


@dataclass(frozen=True)
class ConditionRobot(Server, does=[requests], robot=True):
    """Has the logger do it, and says what was done."""

    logger: ConditionsOfLogger

    def set_trigger(self, trigger: TriggerOptions, lease_s: float) -> str:
        from silo.judging.checks import fixed_text
        from silo.judging.switched_off import off_problem

        logger = self.logger
        known = trigger.name in {one.name for one in logger.now.triggers}
        logger._set_trigger(trigger)
        running = "" if logger.is_running else "; it is judged when the logger is started"
        off = off_problem(trigger, logger.elements, logger.options.prefix, logger.now.derived)
        kept = f"of its captures the newest {trigger.keep} stay" if trigger.keep and trigger.save else ""
        notes = "".join(f"; {note}" for note in (kept, off and f"it {off}", fixed_text(logger.elements)) if note)
        return f"trigger '{trigger.name}' is {'replaced' if known else 'set'}{running}{notes}"

    def remove_trigger(self, name: str) -> str:
        self.logger._remove_trigger(name)
        return f"trigger '{name}' is removed"

    def set_limits(self, limits: SignalLimits) -> str:
        self.logger._set_limits(limits)
        return f"limits of '{limits.name}' are set"

    def remove_limits(self, name: str) -> str:
        self.logger._remove_limits(name)
        return f"limits of '{name}' are removed"

    def set_derived(self, derived: Derived) -> str:
        logger = self.logger
        before = {known.name for known in logger.now.derived}
        logger.derive(derived.name, derived.expression, unit=derived.unit)
        made = join_name(logger.options.prefix, "", derived.name)
        return f"'{made}' is {'derived anew' if made in before else 'derived'}: {derived.expression}"

    def remove_derived(self, name: str) -> str:
        self.logger._remove_derived(name)
        return f"'{name}' is derived no more"
