"""What elements that are off mean for a condition: left out where several are gathered, and whether it can be true."""

from dataclasses import replace

from silo.judging.binding import OFF, Bound, Column, Computed, Constant, Part, Remembered, Signal, columns_of
from silo.judging.evaluation import trailing
from silo.judging.operations import REDUCING


def without_off(bound: Bound) -> tuple[Bound, list[Column]]:
    """Return an expression whose functions of several values (`any(legs/*/slip)`) leave out those that are off.

    With the scalars that are left out. Where all of a function are off, it stays as it is.
    """
    root = _lessened(bound.root)
    columns = tuple(dict.fromkeys(columns_of(root)))
    gone = [column for column in bound.columns if column not in columns]
    return (replace(bound, root=root, columns=columns), gone) if gone else (bound, [])


def can_be(part: Part) -> tuple[bool, bool]:
    """Return whether a condition can ever be true, and whether it can be false, with what of it is off."""
    if isinstance(part, Constant):
        return part.value != 0, part.value == 0
    if isinstance(part, Computed) and part.operator in ("and", "all", "or", "any", "not"):
        found = [can_be(one) for one in part.parts]
        true, false = [one[0] for one in found], [one[1] for one in found]
        if part.operator == "not":
            return false[0], true[0]
        return (all(true), any(false)) if part.operator in ("and", "all") else (any(true), all(false))
    known = all(column.source != OFF for column in columns_of(part))
    return known, known


def _lessened(part: Part) -> Part:
    if isinstance(part, Computed):
        parts = tuple(_lessened(one) for one in part.parts)
        return Computed(part.operator, tuple(map(_dropped, parts)) if part.operator in REDUCING else parts)
    return _remembering(part, _lessened(part.part)) if isinstance(part, Remembered) else part


def _dropped(part: Part) -> Part:
    shape = trailing(part)
    if not shape:
        return part
    on = [place for place in range(shape[0]) if place not in _off(part, shape[0])]
    return _kept(part, on) if 0 < len(on) < shape[0] else part


def _off(part: Part, width: int) -> set[int]:
    if isinstance(part, Signal):
        if not part.vector:
            return set(range(width)) if part.columns[0].source == OFF else set()
        return {place for place, column in enumerate(part.columns) if column.source == OFF}
    if isinstance(part, Computed) and part.operator not in REDUCING:
        return set().union(*(_off(one, width) for one in part.parts))
    return _off(part.part, width) if isinstance(part, Remembered) else set()


def _kept(part: Part, on: list[int]) -> Part:
    if isinstance(part, Signal):
        return replace(part, columns=tuple(part.columns[place] for place in on)) if part.vector else part
    if isinstance(part, Computed) and part.operator not in REDUCING:
        return Computed(part.operator, tuple(_kept(one, on) for one in part.parts))
    return _remembering(part, _kept(part.part, on)) if isinstance(part, Remembered) else part


def _remembering(part: Remembered, inner: Part) -> Remembered:
    if inner == part.part:
        return part
    return replace(part, part=inner, sources=tuple(sorted({column.source for column in columns_of(inner)})))
