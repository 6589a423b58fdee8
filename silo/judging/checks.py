"""Derived signals, limits and triggers (structs: `silo.core.conditions`): checked as given, bound as rows are read."""

from collections.abc import Sequence
from typing import TypeVar

import msgspec
import numpy as np

from silo.core.arguments import check_name, real, shown, whole, word
from silo.core.conditions import Bounds, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import BufferType, ElementInfo, FileType
from silo.core.names import GIVEN, is_given
from silo.core.quantities.reading import both_meanings, seconds_of
from silo.errors import ElementError, ExpressionError, SaveError
from silo.expressions.binding import BoundExpression, Catalogue, Known, bind
from silo.expressions.derived_signals import binds, placed
from silo.judging.limits import LimitRule, limit_rule
from silo.judging.triggers import NO_END, Slope, TriggerMode, TriggerRule, check_length, check_pre, longest_pre

MOST_DERIVED = 200
MOST_LIMITS = 1000
MOST_TRIGGERS = 100
MOST_KEPT = 1_000_000  # captures of a trigger
MOST_LETTERS = 200  # of a name or a unit
MOST_STALE_S = MOST_TRIGGER_S = 86_400.0
LONG_CAPTURE_S, LONG_CAPTURE = 60.0, 10  # or so many times what one fire captures

WORD_BYTES = 8  # a time stamp

_Named = TypeVar("_Named", bound=SignalLimits | TriggerOptions)


def seconds(argument: str, given: object, most_s: float) -> float:
    """Return a time given in seconds, or as text with its unit (`20ms`). Raises ElementError."""
    if isinstance(given, str):
        found = seconds_of(given)
        if found is None:
            raise ElementError(
                f"{argument} must be a time such as 0.5s or 20ms, got {shown(given)}{both_meanings(given)}"
            )
        given = found
    return real(argument, given, 0, most_s, "s")


def typed_seconds(argument: str, typed: str, most_s: float) -> float:
    """Return a time as people type it: as `seconds`, and a number alone is in seconds. Raises ElementError."""
    word = typed.replace(" ", "")
    try:
        number = float(word)
    except ValueError:
        return seconds(argument, word, most_s)
    return seconds(argument, number, most_s)


def table_catalogue(elements: Sequence[ElementInfo], prefix: str, derived: Sequence[Derived] = ()) -> Catalogue:
    """Return what expressions may name in a table of elements; whether they are logged plays no part."""
    return Catalogue([Known.of(info, info.options.divider) for info in elements], prefix, derived)


def _check_count(conditions: Conditions) -> None:
    """Raise ElementError for more of a kind than there may be."""
    for there, most, what in (
        (conditions.derived, MOST_DERIVED, "signals are derived"),
        (conditions.limits, MOST_LIMITS, "signals have limits"),
        (conditions.triggers, MOST_TRIGGERS, "triggers are set"),
    ):
        if len(there) > most:
            raise ElementError(f"at most {most} {what}; nothing was changed")


def _check_words(*words: str) -> None:
    """Raise ElementError for a name or a unit without end: it goes to every client and into every file."""
    for word_given in words:
        if len(word_given) > MOST_LETTERS:
            text = f"{shown(word_given)} has {len(word_given)} characters, {MOST_LETTERS} are possible"
            raise ElementError(f"{text}; nothing was changed")


def with_derived(conditions: Conditions, one: Derived, catalogue: Catalogue) -> Conditions:
    """Return the conditions with one more derived signal, or with a new expression for one of that name.

    `catalogue` is of the table (`table_catalogue`), here and below.

    Raises ElementError for a name that an element has or that may not be given (`GIVEN`), or for one that would be
    computed from itself, ExpressionError for what can't be computed.
    """
    _check_words(one.name, one.unit)
    below = one.name.removeprefix(catalogue.prefix)
    if not is_given(below):
        raise ElementError(f"signal name {shown(below.strip('/'))}: write a name of {GIVEN}; nothing was changed")
    if catalogue.has(one.name):
        raise ElementError(f"'{one.name}' is an element already: derive it under another name; nothing was changed")
    made = msgspec.structs.replace(conditions, derived=placed(one, catalogue.having(conditions.derived)))
    _check_count(made)
    return made


def without_derived(conditions: Conditions, name: str, catalogue: Catalogue) -> Conditions:
    """Return the conditions without the derived signal of this name, whole or from behind a `/`.

    Raises ElementError where there is none, or where something stands on it.
    """
    catalogue = catalogue.having(conditions.derived)
    found = catalogue.before(name)
    if found is None:
        names = ", ".join(one.name for one in conditions.derived[:5])
        there = f"there are {names}" if names else "there is none"
        raise ElementError(f"no derived signal is called '{name}', {there}; nothing was changed")
    gone = found[0]
    kept = tuple(one for one in conditions.derived if one is not gone)
    less = catalogue.having(kept)
    users = [f"'{one.name}'" for one in kept if binds(one.expression, catalogue) and not binds(one.expression, less)]
    users += [f"the limits of '{one.name}'" for one in conditions.limits if not _fits(one, less)]
    users += [
        f"trigger '{one.name}'"
        for one in conditions.triggers
        if not all(binds(text, less) for text in (one.when, one.rearm) if text)
    ]
    if users:
        raise ElementError(f"'{gone.name}' is used by {', '.join(users[:3])}: remove that first; nothing was changed")
    return msgspec.structs.replace(conditions, derived=kept)


def _fits(limits: SignalLimits, catalogue: Catalogue) -> bool:
    try:
        bind_limits(limits, catalogue)
    except ElementError:
        return False
    return True


def with_limits(conditions: Conditions, one: SignalLimits, catalogue: Catalogue) -> Conditions:
    """Return the conditions with limits of one more signal, or with new ones for it. Raises ElementError."""
    bind_limits(one, catalogue.having(conditions.derived))
    made = msgspec.structs.replace(conditions, limits=_with(one, conditions.limits))
    _check_count(made)
    return made


def _with(one: _Named, others: tuple[_Named, ...]) -> tuple[_Named, ...]:
    """The others with one more, in the place of that of its name if there is one."""
    if one.name not in {old.name for old in others}:
        return (*others, one)
    return tuple(one if old.name == one.name else old for old in others)


def with_trigger(conditions: Conditions, one: TriggerOptions, catalogue: Catalogue) -> Conditions:
    """Return the conditions with one more trigger, or with a new one of that name. Raises ElementError."""
    check_trigger_name(one.name)
    catalogue = catalogue.having(conditions.derived)
    trigger_rule(one, 1.0)  # its words and times make sense
    for text in filter(None, (one.when, one.rearm)):
        bind(text, catalogue).condition()
    whole(f"keep of trigger '{one.name}'", one.keep, 0, MOST_KEPT)
    if len(one.save) > len(FileType):
        text = f"trigger '{one.name}' saves {len(one.save)} files of a capture, there are {len(FileType)} kinds"
        raise ElementError(f"{text}; nothing was changed")
    made = msgspec.structs.replace(conditions, triggers=_with(one, conditions.triggers))
    _check_count(made)
    return made


def check_trigger_name(name: str) -> None:
    """Raise ElementError for a name of a trigger that no file can have."""
    try:
        check_name(name)
    except SaveError as error:
        raise ElementError(f"the trigger's name stands in names of files: {error}; nothing was changed") from None


def trigger_rule(options: TriggerOptions, frequency_hz: float) -> TriggerRule:
    """Return what a trigger does, in ticks. Raises ElementError for words and times that make no sense."""
    name = f"of trigger '{options.name}'"

    def ticks(what: str, given_s: float) -> int:
        return round(real(f"{what} {name}", given_s, 0, MOST_TRIGGER_S, "s") * frequency_hz)

    try:
        slope = Slope(options.slope)
    except ValueError:
        words = "rising, falling, level, enter or leave"
        raise ElementError(f"edge {name} must be {words}, got '{options.slope}'; nothing was changed") from None
    mode = word(f"mode {name}", options.mode, TriggerMode)
    if mode is TriggerMode.AUTO and options.save:
        raise ElementError(
            f"mode {name} must be normal or single: auto captures without end, which is for looking (a scope), not for "
            "files; nothing was changed"
        )
    pre, post = ticks("pre", options.pre_s), ticks("post", options.post_s)
    return TriggerRule(
        pre,
        post,
        slope,
        ticks("persist", options.persist_s),
        ticks("holdoff", options.holdoff_s),
        mode,
        ticks("patience", options.patience_s),
        round(long_capture_s(options) * frequency_hz) if options.save else NO_END,
    )


def long_capture_s(options: TriggerOptions) -> float:
    """Return after how long one that fires on and on has a file: while one still looks at it."""
    return max(LONG_CAPTURE_S, LONG_CAPTURE * (options.pre_s + options.post_s))


def check_held(one: TriggerOptions, elements: Sequence[ElementInfo], frequency_hz: float) -> None:
    """Raise ElementError where the buffers can't hold what a trigger captures of the past, with the size that would.

    Likewise where a capture would take more memory than one may.
    """
    rule, saved = trigger_rule(one, frequency_hz), _saved(elements)
    check_pre(rule.pre, frequency_hz, saved)
    if one.save:
        check_length(rule.pre + rule.post + 1, frequency_hz, _bytes_per_tick(saved))


def as_held(one: TriggerOptions, elements: Sequence[ElementInfo], frequency_hz: float) -> TriggerOptions:
    """Return a trigger with the longest pre that the buffers hold, where that is shorter than its own."""
    longest = longest_pre(frequency_hz, _saved(elements))
    if longest is None or one.pre_s * frequency_hz <= longest:
        return one
    return msgspec.structs.replace(one, pre_s=max(longest, 0) / frequency_hz)


def _saved(elements: Sequence[ElementInfo]) -> list[ElementInfo]:
    return [info for info in elements if info.options.enabled and info.options.action.saves]


def _bytes_per_tick(saved: Sequence[ElementInfo]) -> float:
    """Of what captures hold, without what keeps its first samples: that has an end."""
    return WORD_BYTES + sum(
        sum(np.dtype(entry.dtype).itemsize for entry in info.entries) / info.options.divider
        for info in saved
        if info.options.buffer is not BufferType.FIXED
    )


def fixed_text(elements: Sequence[ElementInfo]) -> str:
    """Return how many elements captures lack once their buffers are full, in words; empty where there are none."""
    fixed = [info.name for info in _saved(elements) if info.options.buffer is BufferType.FIXED]
    if not fixed:
        return ""
    more = f" and {len(fixed) - 1} more keep" if len(fixed) > 1 else " keeps"
    return f"'{fixed[0]}'{more} first samples only (buffer=fixed), in captures too"


def bounds_given(name: str, bounds: object) -> Bounds:
    """Return the four bounds that a program gives. Raises ElementError."""
    if isinstance(bounds, str | bytes) or not isinstance(bounds, Sequence) or len(bounds) != 4:
        raise ElementError(
            f"limits of '{name}' must be (red_low, yellow_low, yellow_high, red_high), got {shown(bounds)}; "
            "nothing was changed"
        )
    return bounds[0], bounds[1], bounds[2], bounds[3]


def rule_of(limits: SignalLimits) -> LimitRule:
    """Return the rule that limits stand for. Raises ElementError."""
    name = f"limits of '{limits.name}'"
    stale_ns = round(real(f"stale of {name}", limits.stale_s, 0, MOST_STALE_S, "s") * 1e9)
    if all(bound is None for bound in limits.bounds) and stale_ns:
        return LimitRule(stale_ns=stale_ns)
    return limit_rule(limits.bounds, limits.persistence, limits.hysteresis, stale_ns, name)


def bind_limits(limits: SignalLimits, catalogue: Catalogue) -> tuple[LimitRule, tuple[BoundExpression, ...]]:
    """Return the rule of limits, and the expressions to judge together: the signal, and its context if it has one.

    Raises ElementError, for a name that isn't there ExpressionError.
    """
    rule = rule_of(limits)
    # a name of any letters
    quoted = f"`{limits.name}`" if "`" not in limits.name else limits.name
    try:
        signal = bind(quoted, catalogue)
    except ExpressionError as error:
        raise ElementError(f"limits of '{limits.name}': {error.reason}; nothing was changed") from None
    if not limits.when:
        return rule, (signal,)
    return rule, (signal, bind(limits.when, catalogue).condition())


def scalar_names(bound: BoundExpression, catalogue: Catalogue, name: str) -> list[str]:
    """Return the names of the values that a bound name has: those of its scalars, or numbered ones if it is derived."""
    plain = catalogue.find(name)
    if plain:
        return [catalogue.name(column.element, column.entry) for column in bound.columns]
    derived = catalogue.before(name)
    whole_name = derived[0].name if derived else name
    return [f"{whole_name}_{at}" for at in range(bound.width)] if bound.width else [whole_name]
