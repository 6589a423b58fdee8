"""What elements that are off mean for a condition: left out where several are gathered, and whether it can be true."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from silo.core.conditions import Derived, TriggerOptions
from silo.core.elements import ElementInfo
from silo.expressions.binding import (
    OFF,
    BoundExpression,
    BoundSignal,
    Catalogue,
    Computed,
    Constant,
    Known,
    Part,
    Remembered,
    ScalarPlace,
    bind,
    columns_of,
)
from silo.expressions.evaluation import trailing
from silo.expressions.operations import REDUCING
from silo.judging.triggers import Slope

_KNOWN = "known "
_DECIDING = {True: ("or", "any"), False: ("and", "all")}
_LOGICAL = ("and", "all", "or", "any", "not", *(_KNOWN + one for some in _DECIDING.values() for one in some))


@dataclass(frozen=True)
class TriggerConditions:
    """The conditions of a trigger as they are judged: `when`, and `rearm` if it has one; and the elements that are off.

    `without` are those without which it is judged; it can fire, and again, or waits for `off` in vain.
    """

    bounds: tuple[BoundExpression, ...]
    without: tuple[str, ...] = ()
    can_fire: bool = True
    can_rearm: bool = True
    off: tuple[str, ...] = ()

    @property
    def problem(self) -> str:
        """What of it can't be, fit to stand behind its name; empty where all can."""
        names = ", ".join((self.off or self.without)[:3]) + (" ..." if len(self.off or self.without) > 3 else "")
        if not self.can_fire:
            return "is unobservable: the elements in it are off"
        if not self.can_rearm:
            return f"fires once and never again: its rearm condition needs {names}, which is off"
        return f"is judged without {names}: off" if self.without else ""


def trigger_conditions(options: TriggerOptions, catalogue: Catalogue) -> TriggerConditions:
    """Return how a trigger is judged. Raises ExpressionError."""

    def named(columns: Iterable[ScalarPlace]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(catalogue.elements[column.element].name for column in columns))

    slope = Slope(options.slope)
    when, gone = without_off(bind(options.when, catalogue).condition())
    when = by_what_is_known(when, rising=slope is not Slope.FALLING)
    true, false = can_be(when.root)
    can_fire = (false if slope is Slope.FALLING else true) and bool(when.sources)
    off = [column for column in when.columns if column.source == OFF]
    if not options.rearm:
        return TriggerConditions((when,), named([*gone, *off]), can_fire, off=named(off))
    rearm, left_out = without_off(bind(options.rearm, catalogue).condition())
    waited = [column for column in rearm.columns if column.source == OFF]
    can_rearm = can_be(rearm.root)[0]
    without = named([*gone, *off, *left_out, *(waited if can_rearm else ())])
    return TriggerConditions((when, rearm), without, can_fire, can_rearm, named(waited if not can_rearm else off))


def off_problem(
    options: TriggerOptions, elements: Sequence[ElementInfo], prefix: str, derived: Sequence[Derived]
) -> str:
    """Return what of a trigger can't be with the elements that are off now, fit to stand behind its name."""
    known = [Known.of(info, info.options.divider if info.options.enabled else OFF) for info in elements]
    return trigger_conditions(options, Catalogue(known, prefix, derived)).problem


def without_off(bound: BoundExpression) -> tuple[BoundExpression, list[ScalarPlace]]:
    """Return an expression whose functions of several values (`any(legs/*/slip)`) leave out those that are off.

    With the scalars that are left out. Where all of a function are off, it stays as it is.
    """
    root = _lessened(bound.root)
    columns = dict.fromkeys(columns_of(root))
    gone = [column for column in bound.columns if column not in columns]
    return (replace(bound, root=root, columns=tuple(columns)), gone) if gone else (bound, [])


def can_be(part: Part) -> tuple[bool, bool]:
    """Return whether a condition can ever be true, and whether it can be false, with what of it is off."""
    if isinstance(part, Constant):
        return part.value != 0, part.value == 0
    if isinstance(part, Computed) and part.operator in _LOGICAL:
        found = [can_be(one) for one in part.parts]
        true, false = [one[0] for one in found], [one[1] for one in found]
        if part.operator == "not":
            return false[0], true[0]
        if part.operator.startswith(_KNOWN):
            return any(true), any(false)
        return (all(true), any(false)) if part.operator in ("and", "all") else (any(true), all(false))
    known = all(column.source != OFF for column in columns_of(part))
    return known, known


def by_what_is_known(bound: BoundExpression, *, rising: bool) -> BoundExpression:
    """Return a condition whose alternatives count alone where nothing is known of the others.

    It is true (false, if not `rising`) at the same ticks. Where `a > 1 or b > 1` was true of `a` and no longer is, it
    is false, whatever `b` is of which nothing is known: so that it turns true again with `a`. A turn too many, as `b`
    was true all the time, is better than one that is missed.
    """
    return replace(bound, root=_decided(bound.root, true=rising))


def _decided(part: Part, *, true: bool) -> Part:
    if not isinstance(part, Computed) or part.operator not in _LOGICAL:
        return part
    parts = tuple(_decided(one, true=true if part.operator != "not" else not true) for one in part.parts)
    return Computed(_KNOWN + part.operator if part.operator in _DECIDING[true] else part.operator, parts)


def _lessened(part: Part) -> Part:
    if isinstance(part, Computed):
        parts = tuple(_lessened(one) for one in part.parts)
        return Computed(part.operator, tuple(map(_dropped, parts)) if part.operator in REDUCING else parts)
    return _remembering(part, _lessened(part.part)) if isinstance(part, Remembered) else part


def _dropped(part: Part) -> Part:
    shape = trailing(part)
    if not shape:
        return part
    off = _off(part, shape[0])
    on = [place for place in range(shape[0]) if place not in off]
    return _kept(part, on) if 0 < len(on) < shape[0] else part


def _off(part: Part, width: int) -> set[int]:
    if isinstance(part, BoundSignal):
        if not part.vector:
            return set(range(width)) if part.columns[0].source == OFF else set()
        return {place for place, column in enumerate(part.columns) if column.source == OFF}
    if isinstance(part, Computed) and part.operator not in REDUCING:
        return set().union(*(_off(one, width) for one in part.parts))
    return _off(part.part, width) if isinstance(part, Remembered) else set()


def _kept(part: Part, on: list[int]) -> Part:
    if isinstance(part, BoundSignal):
        return replace(part, columns=tuple(part.columns[place] for place in on)) if part.vector else part
    if isinstance(part, Computed) and part.operator not in REDUCING:
        return Computed(part.operator, tuple(_kept(one, on) for one in part.parts))
    return _remembering(part, _kept(part.part, on)) if isinstance(part, Remembered) else part


def _remembering(part: Remembered, inner: Part) -> Remembered:
    if inner == part.part:
        return part
    return replace(part, part=inner, sources=tuple(sorted({column.source for column in columns_of(inner)})))
