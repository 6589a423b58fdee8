"""What is computed and judged of a logger's signals: derived signals, limits, triggers.

The part of `Logger` that takes them; they are checked against the table at once, stand in the segment of each run, and
are computed and judged by who reads its rows. The control loop has no part in any of it.
"""

import logging
from collections.abc import Iterable, Sequence

import msgspec

from silo.core.arguments import line, shown, text
from silo.core.calls import told_class
from silo.core.elements import (
    NO_EXTRAS,
    Conditions,
    Derived,
    Edit,
    ElementInfo,
    FileType,
    LoggerOptions,
    SignalLimits,
    TriggerOptions,
    join_name,
)
from silo.errors import ElementError, SaveError
from silo.logger.life_cycle import LifeCycle
from silo.logger.registrations import Registrations

log = logging.getLogger("silo")


@told_class("log")
class LoggerConditions:
    """Derived signals, limits and triggers of a logger."""

    def __init__(self, options: LoggerOptions, table: Registrations, life: LifeCycle) -> None:
        """Begin without any, of a logger with these options, this table and this life cycle."""
        self.options, self._table, self._life = options, table, life
        self.extras = NO_EXTRAS

    @property
    def is_running(self) -> bool:
        """Whether the logger runs."""
        return self._life.running

    @property
    def elements(self) -> list[ElementInfo]:
        """The rows of the table that they are checked against."""
        return self._table.infos

    def take(self, extras: Conditions) -> None:
        """Have others, which fit the table."""
        if extras.derived != self.extras.derived:
            self._table.revision += 1  # clients show them as rows of the table
        self.extras = extras

    def with_limits(self, info: ElementInfo, bounds: Sequence[float | None]) -> Conditions:
        """Return them with limits of an element that is about to be added. Raises ElementError."""
        from silo.judging.definitions import bounds_given, with_limits

        one = SignalLimits(info.name, bounds_given(info.name, bounds))
        return with_limits(self.extras, one, [*self._table.all_infos, info], self.options.prefix)

    def derive(self, name: str, expression: str | None, *, group: str = "", unit: str = "") -> None:
        """Have a signal computed from others wherever rows are read: `log.derive("power", "joints/tau * joints/qd")`.

        It is watched, plotted and saved as elements are; nothing of it stands in the buffers, and it costs the control
        loop nothing. Given again, it gets a new expression. Also while the logger runs.

        Args:
            name: its name after prefix and group, or whole with the prefix.
            expression: may use elements that were added before, and other derived signals; None forgets the signal.
            group: the namespace between prefix and name.
            unit: instead of the one that follows from its signals.

        Raises:
            ExpressionError: it makes no sense; the message shows the place.
            ElementError: the name is taken, or it would be computed from itself.
            StateError: the logger is closed.
        """
        from silo.judging.definitions import with_derived

        if expression is None:
            self.remove_derived(name)
            return
        name = text("the signal's name", name, 'log.derive("power", "joints/tau * joints/qd")')
        expression = text("expression", expression, 'log.derive("power", "joints/tau * joints/qd")')
        group, unit = text("group", group, 'group="joints"'), line("unit", unit, 'unit="W"')
        prefix = self.options.prefix
        if not name.strip("/"):
            raise ElementError("a derived signal needs a name; nothing was changed")
        if not name.isprintable():
            raise ElementError(f"signal name {name!r}: write a name of printable characters; nothing was changed")
        whole_name = join_name("", "", name)
        if group or not whole_name.startswith(f"{prefix.rstrip('/')}/"):
            whole_name = join_name(prefix, group, name)
        with self._life.lock:
            self._life.check_open()
            one = Derived(whole_name, expression, self._table.unit(whole_name, unit) if unit.strip() else "")
            self._take_derived(with_derived(self.extras, one, self._table.all_infos, prefix))

    def remove_derived(self, name: str) -> None:
        """Forget a derived signal, also while the logger runs.

        Args:
            name: whole, or without the prefix.

        Raises:
            ElementError: there is none of that name, or another one, limits or a trigger use it; nothing was changed.
            StateError: the logger is closed.
        """
        from silo.judging.definitions import without_derived

        name = text("the signal's name", name, 'log.remove_derived("power")')
        with self._life.lock:
            self._life.check_open()
            self._take_derived(without_derived(self.extras, name, self._table.all_infos, self.options.prefix))

    def _take_derived(self, extras: Conditions) -> None:
        if extras.derived != self.extras.derived:
            self.take(extras)
            self._life.tell()

    def limit(
        self,
        name: str,
        bounds: Sequence[float | None] | None,
        *,
        persistence: int = 1,
        hysteresis: float = 0.0,
        stale: float | str = 0.0,
        when: str = "",
    ) -> None:
        """Give a signal limits, also while the logger runs.

        The helper process of `serve()` judges them; they are kept in saved files, which `silo check` judges.

        Args:
            name: an element (each of its values is judged), one scalar of it, or a derived signal.
            bounds: (red_low, yellow_low, yellow_high, red_high), None for one that there isn't; a value at a bound is
                within it. None in place of all four forgets its limits.
            persistence: so many samples in a row make a state; each violation is counted all the same.
            hysteresis: how far inside a bound its state ends.
            stale: a value that stays the same for so long is one too (`"0.5s"`).
            when: an expression that must hold, else nothing is judged.

        Raises:
            ElementError: there is no such signal, or the bounds or a number make no sense; nothing was changed.
            ExpressionError: `when` makes no sense; the message shows the place.
        """
        from silo.conditions.given import limits_given

        if bounds is None:
            self.remove_limits(name)
            return
        self.set_limits(
            limits_given(name, bounds, persistence=persistence, hysteresis=hysteresis, stale=stale, when=when)
        )

    def set_limits(self, one: SignalLimits) -> None:
        """Give a signal limits as they stand in scripts, or other ones than it has; also while the logger runs.

        Args:
            one: the signal's name and its bounds, in the signal's unit; `limit` tells what they mean.

        Raises:
            ElementError: there is no such signal, its bounds or a number make no sense, or 1000 signals have limits
                already; nothing was changed.
            ExpressionError: its condition makes no sense; the message shows the place.
            StateError: the logger is closed.
        """
        from silo.judging.definitions import with_limits

        if not isinstance(one, SignalLimits):
            raise ElementError(
                f"limits must be silo.core.elements.SignalLimits, got {shown(one)}; write "
                'log.limit("joints/tau", (-40, -30, 30, 40)); nothing was changed'
            )
        with self._life.lock:
            self._life.check_open()
            self.extras = with_limits(self.extras, one, self._table.all_infos, self.options.prefix)
            self._life.tell()

    def remove_limits(self, name: str) -> None:
        """Forget the limits of a signal, also while the logger runs.

        Args:
            name: exactly the one that they were given to.

        Raises:
            ElementError: no limits were given to it; nothing was changed.
            StateError: the logger is closed.
        """
        with self._life.lock:
            self._life.check_open()
            kept = tuple(one for one in self.extras.limits if one.name != name)
            if len(kept) == len(self.extras.limits):
                names = ", ".join(one.name for one in kept[:5]) or "no signal"
                raise ElementError(f"'{name}' has no limits, {names} has; nothing was changed")
            self.extras = msgspec.structs.replace(self.extras, limits=kept)
            self._life.tell()

    def trigger(
        self,
        name: str,
        when: str | None,
        *,
        pre: float | str = 0.0,
        post: float | str = 0.0,
        edge: str = "rising",
        rearm: str = "",
        persist: float | str = 0.0,
        holdoff: float | str = 0.0,
        mode: str = "normal",
        save: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
        keep: int = 0,
        armed: bool = True,
    ) -> None:
        """Capture what all saved elements did around the moments at which a condition turns true.

            log.trigger("fall", "abs(base/roll) > 0.6", pre="5s", post="1s", rearm="abs(base/roll) < 0.3")

        The helper process of `serve()` judges every row, and writes ticks k - pre to k + post of each fire at tick k to
        files `<logger>_<date>_<run>_<name>_<number>`; a fire within `post` makes the capture longer. The control loop
        has no part in it. Times are seconds, or texts such as `"20ms"`.

        Args:
            name: stands in the names of its files.
            when: the condition; None forgets the trigger.
            pre: how long before the fire.
            post: how long after it.
            edge: `"rising"`: the condition turns true, `"falling"`: false, `"level"`: is true; `"enter"` and `"leave"`
                are the first two.
            rearm: what must be true before it fires again; without, the condition must have been false.
            persist: it must stay so for so long.
            holdoff: it ignores what follows for so long.
            mode: `"normal"`, or `"single"`: the first only.
            save: file types.
            keep: of its captures on the disk, of this run and earlier ones, the newest so many stay, 0 for all; removed
                is only what the logger's own list says that it wrote.
            armed: False: it waits until it is armed (`silo trigger arm`, silo-tui).

        Raises:
            ExpressionError: a condition makes no sense; the message shows the place.
            ElementError: a number or name makes no sense; also for a `pre` that is longer than what buffers hold, with
                the size that would do.
        """
        from silo.conditions.given import trigger_given

        if when is None:
            self.remove_trigger(name)
            return
        self.set_trigger(
            trigger_given(
                name, when, pre=pre, post=post, edge=edge, rearm=rearm, persist=persist, holdoff=holdoff, mode=mode,
                save=save, keep=keep, armed=armed,
            )
        )  # fmt: skip

    def set_trigger(self, one: TriggerOptions) -> None:
        """Set a trigger as it stands in scripts, or replace the one of its name; also while the logger runs.

        Args:
            one: its condition and what it captures, times in s; `trigger` tells what they mean.

        Raises:
            ElementError: a name, word or number makes no sense, 100 triggers are set already, `pre_s` is longer than
                what buffers hold, with the size that would do, or a capture would take more than 256 MB of memory;
                nothing was changed.
            ExpressionError: a condition makes no sense; the message shows the place.
            StateError: the logger is closed.
        """
        from silo.files.naming import check_name
        from silo.judging.definitions import check_held, with_trigger

        if not isinstance(one, TriggerOptions):
            raise ElementError(
                f"a trigger must be silo.core.elements.TriggerOptions, got {shown(one)}; write "
                'log.trigger("fall", "abs(base/roll) > 0.6"); nothing was changed'
            )
        try:
            check_name(one.name)
        except SaveError as error:
            raise ElementError(f"the trigger's name stands in names of files: {error}; nothing was changed") from None
        with self._life.lock:
            self._life.check_open()
            infos = self._table.all_infos
            check_held(one, infos, self.options.frequency_hz)
            self.extras = with_trigger(self.extras, one, infos, self.options.prefix)
            if self._life.running:
                self._warn_of_off(one)  # else at the start: until then elements may be switched on
            self._life.tell()

    def remove_trigger(self, name: str) -> None:
        """Forget a trigger, also while the logger runs; a capture that is under way goes on.

        Args:
            name: of the trigger.

        Raises:
            ElementError: there is none of that name; nothing was changed.
            StateError: the logger is closed.
        """
        with self._life.lock:
            self._life.check_open()
            kept = tuple(one for one in self.extras.triggers if one.name != name)
            if len(kept) == len(self.extras.triggers):
                names = ", ".join(one.name for one in kept)
                there = f"there are {names}" if names else "there is none"
                raise ElementError(f"no trigger is called '{name}', {there}; nothing was changed")
            self.extras = msgspec.structs.replace(self.extras, triggers=kept)
            self._life.tell()

    def apply_extras(self, extras: Conditions, edits: Sequence[Edit] = ()) -> None:
        """Take derived signals, limits and triggers of a script in the place of all that there are.

        Args:
            extras: all of them; empty ones forget what there is.
            edits: what is about to be changed of the table; they are checked beside it.

        Raises:
            ElementError: one of them doesn't fit the table, or captures more of the past than buffers hold; nothing was
                changed.
            ExpressionError: an expression makes no sense; the message shows the place.
            StateError: the logger runs, or is closed.
        """
        from silo.settings.script_conditions import checked_extras

        with self._life.lock:
            self._life.check_stopped("load a script")
            options = {edit.name: edit.options for edit in edits}
            planned = [
                msgspec.structs.replace(info, options=options.get(info.name, info.options))
                for info in self._table.infos
            ]
            self.take(checked_extras(extras, planned, self.options.prefix, self.options.frequency_hz))
            self._life.tell()

    def warn_at_start(self, *, served: bool) -> None:
        """Tell at a start which triggers and limits can't do what they were set for."""
        if self.extras.limits and not served:
            judged = ", ".join(one.name for one in self.extras.limits)
            log.warning("%s: limits are judged by the helper process, and there is none: call serve()", judged)
        if not self.extras.triggers:
            return
        from silo.judging.definitions import check_held

        names = ", ".join(one.name for one in self.extras.triggers)
        if not served:
            log.warning("%s: triggers are judged by the helper process, and there is none: call serve()", names)
        for one in self.extras.triggers:
            self._warn_of_off(one)
            try:
                check_held(one, self._table.infos, self.options.frequency_hz)
            except ElementError as error:  # each is told
                log.warning("trigger '%s' will capture less than it should: %s", one.name, error)

    def _warn_of_off(self, one: TriggerOptions) -> None:
        from silo.judging.switched_off import off_problem

        problem = off_problem(one, self._table.infos, self.options.prefix, self.extras.derived)
        if problem:
            log.warning("trigger '%s' %s", one.name, problem)
