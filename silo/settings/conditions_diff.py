"""What differs between the derived signals, limits and triggers of two configurations, in words. Pure."""

from collections.abc import Iterable, Sequence
from typing import Any

from silo.core.conditions import CALLED, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import FieldChange, FileType

NONE = "none"  # what stands for one that there isn't

_Item = Derived | SignalLimits | TriggerOptions


def diff_conditions(now: Conditions, new: Conditions) -> list[FieldChange]:
    """Return what changes when `now` becomes `new`: an entry per field, one for what comes or goes as a whole."""
    return [
        *_diff("derived", now.derived, new.derived),
        *_diff("limits", now.limits, new.limits),
        *_diff("trigger", now.triggers, new.triggers),
    ]


def _diff(noun: str, now: Sequence[_Item], new: Sequence[_Item]) -> Iterable[FieldChange]:
    old_of = {one.name: one for one in now}
    new_of = {one.name: one for one in new}
    for name in dict.fromkeys([*old_of, *new_of]):
        old, made = old_of.get(name), new_of.get(name)
        if old is None or made is None:
            yield FieldChange(f"{noun} {name}", "", _whole(old), _whole(made))
            continue
        for field in old.__struct_fields__:
            before, after = getattr(old, field), getattr(made, field)
            if before != after:
                yield FieldChange(f"{noun} {name}", _label(field), _words(field, before), _words(field, after))


def _whole(one: _Item | None) -> str:
    """Return all that is said of one: its first field as it is, of the others those that are not the usual."""
    if one is None:
        return NONE
    usual = type(one).__struct_defaults__
    fields = one.__struct_fields__[1:]
    first, *others = fields
    without = len(fields) - len(usual)  # those that have no default come first
    said = [_words(first, getattr(one, first))]
    for place, field in enumerate(others, 1):
        value = getattr(one, field)
        if place < without or value != usual[place - without]:
            said.append(f"{_label(field)} {_words(field, value)}")
    return ", ".join(said)


def _label(field: str) -> str:
    return CALLED.get(field, field)


def _words(field: str, value: Any) -> str:
    if field == "bounds":
        return " ".join("-" if bound is None else f"{bound:g}" for bound in value)
    if field == "save":
        return " ".join(FileType(kind).name.lower() for kind in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if field.endswith("_s"):
        return f"{value:g} s"
    return f"{value:g}" if isinstance(value, float) else str(value) or NONE
