"""Derived signals as rows of a table: what each is, how far back it looks, which stand on which.

A derived signal has a sample at every tick that the rates of its signals have in common (every third tick and every
second: every tick); where none of them has a sample there, it holds. All its values are float64: a condition is 1 or 0,
and NaN where it can't be told.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import msgspec

from silo.core.conditions import Derived
from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry
from silo.core.kinds import ARRAY, SCALAR
from silo.errors import ElementError, ExpressionError
from silo.expressions.binding import OFF, BoundExpression, Catalogue, Computed, Known, Part, Remembered, bind
from silo.expressions.parsing import names_in, parse

NUMBER = "<f8"


@dataclass(frozen=True)
class Lookback:
    """How much before a tick its value may depend on: a time by time stamps, and ticks beside it."""

    window_ns: int
    ticks: int


def lookback(bound: BoundExpression) -> Lookback:
    """Return how far before a tick samples are needed to compute what an expression gives there."""
    longest = max(bound.sources.values(), default=1)  # what holds may be so old
    found = _lookback(bound.root, longest)
    return Lookback(found.window_ns, found.ticks + longest)


def remembers(bound: BoundExpression) -> bool:
    """Return whether what an expression gives depends on samples before those that hold."""
    found = _lookback(bound.root, 1)
    return bool(found.window_ns or found.ticks)


def _lookback(part: Part, longest: int) -> Lookback:
    if isinstance(part, Computed):
        inner = [_lookback(one, longest) for one in part.parts]
        return Lookback(max((one.window_ns for one in inner), default=0), max((one.ticks for one in inner), default=0))
    if isinstance(part, Remembered):
        before = _lookback(part.part, longest)
        return Lookback(before.window_ns + part.window_ns, before.ticks + longest)
    return Lookback(0, 0)


def entries_of(width: int) -> tuple[Entry, ...]:
    """Return the scalars of a derived signal: one, or as many as its vector has, numbered."""
    return tuple(Entry(f"_{at}", NUMBER) for at in range(width)) if width else (Entry("", NUMBER),)


def info_of(one: Derived, bound: BoundExpression | None, why: str = "") -> ElementInfo:
    """Return a derived signal as a row of the table; it is off where `why` says that it can't be computed."""
    width, divider = (bound.width, math.gcd(*bound.sources.values()) or 1) if bound is not None else (0, 1)
    unit = one.unit if one.unit not in ("", "-") or bound is None else bound.unit
    return ElementInfo(
        name=one.name,
        unit=unit or "-",
        kind=(ARRAY if width else SCALAR).name,
        shape=(width,) if width else (),
        entries=entries_of(width),
        options=ElementOptions(not why, divider, Action.SAVE, BufferType.LOOPING, 1),
        description=f"= {one.expression}" + (f" (off: {why})" if why else ""),
        expression=one.expression,
    )


def derived_infos(elements: Sequence[ElementInfo], prefix: str, derived: Sequence[Derived]) -> list[ElementInfo]:
    """Return the derived signals of a table of elements, in their order; one that an element hides is left out.

    Their buffers are as long as the shortest of those that they are computed from.
    """
    if not derived:
        return []
    known = [Known.of(info, place if info.options.enabled else OFF) for place, info in enumerate(elements)]
    names = {info.name for info in elements}
    found = []
    for one, bound, why in bound_derived(Catalogue(known, prefix, derived)):
        if one.name in names:
            continue
        info = info_of(one, bound, why)
        if bound is not None and bound.sources:
            held = [elements[place].options for place in bound.sources]
            sizes = [min(one.size * one.divider, 2**31 - 1) for one in held]
            size = max(1, min(sizes) // info.options.divider)
            info = msgspec.structs.replace(info, options=msgspec.structs.replace(info.options, size=size))
        found.append(info)
    return found


def bound_derived(catalogue: Catalogue) -> Iterable[tuple[Derived, BoundExpression | None, str]]:
    """Yield each derived signal with what it is computed by; with a reason where it can't be computed now."""
    for place, one in enumerate(catalogue.derived):
        try:
            bound = bind(one.expression, catalogue.having(catalogue.derived[:place]))
        except ExpressionError as error:
            yield one, None, error.reason
            continue
        off = dict.fromkeys(
            catalogue.elements[column.element].name for column in bound.columns if column.source == OFF
        )  # fmt: skip
        # of a condition, what is known may decide
        blind = bool(off) and (not bound.logical or not bound.sources)
        yield one, bound, f"{', '.join(list(off)[:3])} is off" if blind else ""


def placed(one: Derived, catalogue: Catalogue) -> tuple[Derived, ...]:
    """Return the derived signals with one more, or with a new expression for one of that name, each after what it uses.

    Raises ElementError for one that would be computed from itself, ExpressionError for what can't be computed.
    """
    others = [old for old in catalogue.derived if old.name != one.name]

    leaf = one.name.rpartition("/")[2]
    before: list[Derived] = []
    after: list[Derived] = []
    for old in others:  # what can't be computed without it stands on it; what names neither it nor such a one can't
        named = bool(after) or leaf in old.expression
        (after if named and not binds(old.expression, catalogue.having(before)) else before).append(old)
    try:
        bind(one.expression, catalogue.having(before))
    except ExpressionError:
        names = names_in(parse(one.expression).root)
        theirs = catalogue.having([*after, one])
        if any(theirs.before(name) is not None and not catalogue.find(name) for name in names):
            circle = ", ".join(f"{old.name} = {old.expression}" for old in (one, *after[:2]))
            text = f"'{one.name}' would be computed from itself: {circle}; nothing was changed"
            raise ElementError(text) from None
        raise
    made = [*before, one]
    for old in after:
        if binds(old.expression, catalogue):  # else it is of elements that are gone
            bind(old.expression, catalogue.having(made))  # what stands on it must still fit
        made.append(old)
    return tuple(made)


def binds(expression: str, catalogue: Catalogue) -> bool:
    """Return whether an expression can be computed of these signals."""
    try:
        bind(expression, catalogue)
    except ExpressionError:
        return False
    return True
