"""What is computed and judged of a logger's signals: derived signals, limits, triggers.

The part of `Logger` that takes them; they are checked against the table at once, stand in the segment of each run, and
are computed and judged by who reads its rows. The control loop has no part in any of it.
"""

import logging
from collections.abc import Sequence

import msgspec

from silo.conditions.given import TakesConditions
from silo.core.arguments import line, shown, text
from silo.core.calls import told_class
from silo.core.conditions import NO_CONDITIONS, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import ElementInfo, LoggerOptions, join_name
from silo.errors import ElementError
from silo.logger.life_cycle import LifeCycle
from silo.logger.registrations import Registrations

log = logging.getLogger("silo")


@told_class("log", shared=TakesConditions)
class LoggerConditions(TakesConditions[None]):
    """Derived signals, limits and triggers of a logger."""

    def __init__(self, options: LoggerOptions, table: Registrations, life: LifeCycle) -> None:
        self.options, self._table, self._life = options, table, life
        self.now = NO_CONDITIONS

    @property
    def is_running(self) -> bool:
        """Whether the logger runs."""
        return self._life.running

    @property
    def elements(self) -> list[ElementInfo]:
        """The rows of the table that they are checked against."""
        return self._table.infos

    def take(self, conditions: Conditions) -> None:
        """Have others, which fit the table."""
        if conditions.derived != self.now.derived:
            self._table.revision += 1  # clients show them as rows of the table
        self.now = conditions

    def with_limits(self, info: ElementInfo, bounds: Sequence[float | None]) -> Conditions:
        """Return them with limits of an element that is about to be added. Raises ElementError."""
        from silo.judging.checks import bounds_given, table_catalogue, with_limits

        one = SignalLimits(info.name, bounds=bounds_given(info.name, bounds))
        return with_limits(self.now, one, table_catalogue([*self._table.all_infos, info], self.options.prefix))

    def derive(self, name: str, expression: str | None, *, group: str = "", unit: str = "") -> None:
        """Have a signal computed from others wherever rows are read: `log.derive("power", "joints/tau * joints/qd")`.

        It is watched, plotted and saved as elements are; nothing of it stands in the buffers, and it costs the control
        loop nothing. Given again, it gets a new expression. Also while the logger runs: a recording has it from then
        on, in a new part; one that gets a new expression, or is removed, is recorded as before until the run ends.

        Args:
            name: its name after prefix and group, or whole with the prefix: letters, digits, blanks and / _ - . +.
            expression: may use elements that were added before, and other derived signals; None forgets the signal,
                which nothing else may use.
            group: the namespace between prefix and name.
            unit: instead of the one that follows from its signals.

        Raises:
            ExpressionError: it makes no sense; the message shows the place.
            ElementError: the name is taken or is none, or it would be computed from itself.
            StateError: the logger is closed.
        """
        from silo.judging.checks import table_catalogue, with_derived

        if expression is None:
            self._remove_derived(name)
            return
        name = text("the signal's name", name, 'log.derive("power", "joints/tau * joints/qd")')
        expression = text("expression", expression, 'log.derive("power", "joints/tau * joints/qd")')
        group, unit = text("group", group, 'group="joints"'), line("unit", unit, 'unit="W"')
        prefix = self.options.prefix
        if not name.strip("/"):
            raise ElementError("a derived signal needs a name; nothing was changed")
        whole_name = join_name(prefix, group, name)
        with self._life.lock:
            self._life.check_open()
            one = Derived(whole_name, expression, self._table.unit(whole_name, unit) if unit.strip() else "")
            self._take_derived(with_derived(self.now, one, table_catalogue(self._table.all_infos, prefix)))

    def _remove_derived(self, name: str) -> None:
        from silo.judging.checks import table_catalogue, without_derived

        name = text("the signal's name", name, 'log.derive("power", None)')
        with self._life.lock:
            self._life.check_open()
            catalogue = table_catalogue(self._table.all_infos, self.options.prefix)
            self._take_derived(without_derived(self.now, name, catalogue))

    def _take_derived(self, conditions: Conditions) -> None:
        if conditions.derived != self.now.derived:
            self.take(conditions)
            self._life.tell()

    def _set_limits(self, limits: SignalLimits) -> None:
        from silo.judging.checks import table_catalogue, with_limits

        if not isinstance(limits, SignalLimits):
            raise ElementError(
                f"limits must be silo.core.conditions.SignalLimits, got {shown(limits)}; write "
                'log.limit("joints/tau", (-40, -30, 30, 40)); nothing was changed'
            )
        with self._life.lock:
            self._life.check_open()
            self.now = with_limits(self.now, limits, table_catalogue(self._table.all_infos, self.options.prefix))
            self._life.tell()

    def _remove_limits(self, name: str) -> None:
        with self._life.lock:
            self._life.check_open()
            kept = tuple(one for one in self.now.limits if one.name != name)
            if len(kept) == len(self.now.limits):
                names = ", ".join(one.name for one in kept[:5]) or "no signal"
                raise ElementError(f"'{name}' has no limits, {names} has; nothing was changed")
            self.now = msgspec.structs.replace(self.now, limits=kept)
            self._life.tell()

    def _set_trigger(self, trigger: TriggerOptions) -> None:
        from silo.judging.checks import check_held, table_catalogue, with_trigger

        if not isinstance(trigger, TriggerOptions):
            raise ElementError(
                f"a trigger must be silo.core.conditions.TriggerOptions, got {shown(trigger)}; write "
                'log.trigger("fall", "abs(base/roll) > 0.6"); nothing was changed'
            )
        with self._life.lock:
            self._life.check_open()
            infos = self._table.all_infos
            before = {one.name: one for one in self.now.triggers}.get(trigger.name)
            if before is None or msgspec.structs.replace(before, armed=trigger.armed) != trigger:
                check_held(trigger, infos, self.options.frequency_hz)
            self.now = with_trigger(self.now, trigger, table_catalogue(infos, self.options.prefix))
            if self._life.running:
                self._warn_of_off(trigger)  # else at the start: until then elements may be switched on
            self._life.tell()

    def _remove_trigger(self, name: str) -> None:
        with self._life.lock:
            self._life.check_open()
            kept = tuple(one for one in self.now.triggers if one.name != name)
            if len(kept) == len(self.now.triggers):
                names = ", ".join(one.name for one in kept)
                there = f"there are {names}" if names else "there is none"
                raise ElementError(f"no trigger is called '{name}', {there}; nothing was changed")
            self.now = msgspec.structs.replace(self.now, triggers=kept)
            self._life.tell()

    def warn_at_start(self, *, served: bool) -> None:
        """Tell at a start which triggers and limits can't do what they were set for."""
        if self.now.limits and not served:
            judged = ", ".join(one.name for one in self.now.limits)
            log.warning("%s: limits are judged by the helper process, and there is none: call serve()", judged)
        if not self.now.triggers:
            return
        names = ", ".join(one.name for one in self.now.triggers)
        if not served:
            log.warning("%s: triggers are judged by the helper process, and there is none: call serve()", names)
        for one in self.now.triggers:
            self._warn_of_off(one)
        for text_of_one in self.less_captured():
            log.warning("%s", text_of_one)

    def less_captured(self) -> list[str]:
        """Return for which triggers that are armed buffers hold too little, in words, with what would do."""
        from silo.judging.checks import check_held

        found = []
        for one in (each for each in self.now.triggers if each.armed):
            try:
                check_held(one, self._table.infos, self.options.frequency_hz)
            except ElementError as error:  # noqa: PERF203  # each is told
                why = str(error).removesuffix("; nothing was changed")
                found.append(f"trigger '{one.name}' will capture less than it should: {why}")
        return found

    def _warn_of_off(self, one: TriggerOptions) -> None:
        from silo.judging.switched_off import off_problem

        problem = off_problem(one, self._table.infos, self.options.prefix, self.now.derived)
        if problem:
            log.warning("trigger '%s' %s", one.name, problem)
