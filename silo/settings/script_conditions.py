"""Derived signals, limits and triggers in a script: keys of silo beside `log_elements`, which the original ignores.

derived_signals:
  - name: /log/power
    expression: "joints/tau * joints/qd"
    unit: "W"
signal_limits:
  - name: /log/joints/tau
    bounds: [-40, -30, 30, 40]
    when: "controller/mode == STANCE"
triggers:
  - name: fall
    when: "abs(base/roll) > 0.6"
    pre: 5s
    post: 1s

Keys and values are those of programs and the shell; the names of fields, which scripts had before (`pre_s`, `slope`),
are read as well. A key that is there stands for all of its kind, `triggers: []` for none; of a kind without a key
everything stays as it was, such as what the program has set.
"""

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, TypeAlias, TypeVar

import msgspec
import yaml

from silo.core.conditions import CALLED, NO_CONDITIONS, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import ElementInfo, FileType
from silo.core.names import did_you_mean, nearest
from silo.core.quantities.reading import both_meanings, seconds_of
from silo.core.quantities.writing import many
from silo.errors import ElementError, ExpressionError
from silo.settings.options import MAX_PROBLEMS, OPTION, shorten
from silo.settings.typed import read_word
from silo.settings.yaml_nodes import Pair, describe, is_null, is_plain, key_name, line_of

Kind = Literal["derived_signals", "signal_limits", "triggers"]
DERIVED: Final = "derived_signals"
LIMITS: Final = "signal_limits"
TRIGGERS: Final = "triggers"
KEYS = (DERIVED, LIMITS, TRIGGERS)

_Item = TypeVar("_Item", Derived, SignalLimits, TriggerOptions)


Lines: TypeAlias = dict[tuple[Kind, str], int]  # by kind and name: where it begins


def read_conditions(
    keys: Mapping[str, yaml.Node],
    report: Callable[[int, str], None],
    note: Callable[[Kind, str, Pair, str], None],
    lines: Lines,
) -> Conditions | None:
    """Return what the keys of a script say; None if they aren't there. Fills `lines`.

    Problems are reported with their lines; keys that silo doesn't know are noted: of which kind, of what, and why.
    """
    if not any(key in keys for key in KEYS):
        return None
    return Conditions(
        tuple(_items(keys.get(DERIVED), DERIVED, Derived, report, note, lines)),
        tuple(_items(keys.get(LIMITS), LIMITS, SignalLimits, report, note, lines)),
        tuple(_items(keys.get(TRIGGERS), TRIGGERS, TriggerOptions, report, note, lines)),
    )


def merged(script: Conditions, given: Collection[str], now: Conditions) -> Conditions:
    """Return what a script leads to beside what there is: kinds whose keys it lacks stay."""
    return msgspec.structs.replace(
        now,
        derived=script.derived if DERIVED in given else now.derived,
        limits=script.limits if LIMITS in given else now.limits,
        triggers=script.triggers if TRIGGERS in given else now.triggers,
    )


def kinds_of(conditions: Conditions) -> list[tuple[Kind, Sequence[Derived | SignalLimits | TriggerOptions]]]:
    """Return what there is of each kind, by its key in a script."""
    return [(DERIVED, conditions.derived), (LIMITS, conditions.limits), (TRIGGERS, conditions.triggers)]


def _items(
    node: yaml.Node | None,
    key: Kind,
    kind: type[_Item],
    report: Callable[[int, str], None],
    note: Callable[[Kind, str, Pair, str], None],
    lines: Lines,
) -> list[_Item]:
    if node is None or is_null(node):
        return []
    if not isinstance(node, yaml.SequenceNode):
        report(line_of(node), f"{key} must be a list (`- name: ...`), got {describe(node)}")
        return []
    found = []
    for item in node.value:
        if not isinstance(item, yaml.MappingNode):
            report(line_of(item), f"{key}: must have keys (`name: ...`), got {describe(item)}")
            continue
        made = _item(item, key, kind, report, note)
        if made is None:
            continue
        if (first := lines.setdefault((key, made.name), line_of(item))) != line_of(item):
            report(line_of(item), f"{key} '{shorten(made.name)}': listed twice, first in line {first}")
        found.append(made)
    return found


def _item(
    item: yaml.MappingNode,
    key: Kind,
    kind: type[_Item],
    report: Callable[[int, str], None],
    note: Callable[[Kind, str, Pair, str], None],
) -> _Item | None:
    fields = {CALLED.get(one.name, one.name): one for one in msgspec.structs.fields(kind)}
    of_before = {one.name: called for called, one in fields.items() if one.name != called}
    stands: dict[str, str] = {}  # as what
    named = [value for each, value in item.value if key_name(each) == "name" and isinstance(value, yaml.ScalarNode)]
    name = str(named[0].value) if named else ""
    where = f"{key} '{shorten(name)}'" if name else key
    values: dict[str, Any] = {}
    unknown: list[Pair] = []
    well = True
    for each, value in item.value:
        word = key_name(each)
        field = fields.get(of_before.get(word, word))
        if field is None:
            unknown.append((each, value))
        elif field.name in values:
            other = stands[field.name]
            both = f"as '{other}', too: keep '{of_before.get(word, word)}' alone, which is what it is called now"
            report(line_of(each), f"{where}: key '{word}' stands twice{'' if other == word else f', {both}'}")
            well = False
        else:
            stands[field.name] = word
            try:
                values[field.name] = _value(value, field.type, field.name)
            except _UnfitError as unfit:
                values[field.name] = None
                report(line_of(value), f"{where}: {word} must be {unfit}, got {describe(value)}")
                well = False
    missing = [field.name for field in fields.values() if field.required and values.get(field.name, "") == ""]
    if missing and unknown:  # then one of the unknown keys is meant for it
        name = shorten(key_name(unknown[0][0]))
        report(line_of(item), f"{key}: no key '{name}'; there are {', '.join(fields)}, and {missing[0]} is missing")
        return None
    for pair in unknown:
        hint = did_you_mean(nearest(key_name(pair[0]).lower(), fields), f"known are {', '.join(fields)}")
        note(key, name, pair, f"{where}: unknown key '{shorten(key_name(pair[0]))}'{hint}")
    if missing:
        report(line_of(item), f"{where}: {missing[0]} is missing")
    return None if missing or not well else kind(**values)


class _UnfitError(Exception):
    """A value is none of its field; the text says what it must be."""


def _value(node: yaml.Node, wanted: Any, field: str = "") -> Any:
    """The value of a field of this type, of that name. Raises `_UnfitError`."""
    if wanted is bool:
        found = read_word(OPTION["enabled"], node.value) if is_plain(node) else None
        if found is None:
            raise _UnfitError("on or off")
        return found
    if wanted is str:
        if not isinstance(node, yaml.ScalarNode) or is_null(node):
            raise _UnfitError("a text")
        return str(node.value)
    if wanted in (int, float):
        is_time, given = field.endswith("_s"), node.value if isinstance(node, yaml.ScalarNode) else None
        if is_time and (time_s := seconds_of(given)) is not None:
            return time_s
        try:
            return wanted(node.value if isinstance(node, yaml.ScalarNode) else "")
        except (ValueError, OverflowError):
            time = f"a time such as 0.5s or 20ms, or a number of seconds{both_meanings(given)}"
            raise _UnfitError(time if is_time else "a whole number" if wanted is int else "a number") from None
    if wanted == tuple[FileType, ...]:
        return tuple(map(_file_type, node.value if isinstance(node, yaml.SequenceNode) else [node]))
    return _bounds(node)


def _file_type(node: yaml.Node) -> FileType:
    word = str(node.value).casefold() if isinstance(node, yaml.ScalarNode) else ""
    for one in FileType:
        if word in (one.name.casefold(), str(int(one))):
            return one
    raise _UnfitError(f"one or a list of {', '.join(one.name.lower() for one in FileType)}")


def _bounds(node: yaml.Node) -> tuple[float | None, ...]:
    try:
        found = [None if is_null(one) else _value(one, float) for one in node.value]
    except (_UnfitError, TypeError, AttributeError):
        found = []
    if not isinstance(node, yaml.SequenceNode) or len(found) != 4:
        raise _UnfitError("four numbers, [red low, yellow low, yellow high, red high], null where there is none")
    return tuple(found)


def format_conditions(
    conditions: Conditions, unknown: Callable[[str, str, int], str] = lambda place, name, indent: ""
) -> str:
    """Return the keys of a script; empty where there is nothing to say.

    unknown: the text of the keys that silo doesn't know, of a kind and a name, with so many blanks before each line.
    """
    lines = []
    for key, items in kinds_of(conditions):
        lines += [f"{key}:\n"] if items else []
        for item in items:
            fields = [(name, value) for name, value in msgspec.to_builtins(item).items() if value != ""]
            lines += [
                f"  {'- ' if at == 0 else '  '}{CALLED.get(name, name)}: {_written(name, value)}\n"
                for at, (name, value) in enumerate(fields)
            ]
            lines.append(unknown(key, item.name, 4))
    return "".join(lines)


_WORDS_ALONE = frozenset({"slope", "mode"})


def _written(field: str, value: Any) -> str:
    """The value of a field as people write it, which reads as exactly that."""
    if field.endswith("_s") and 0 <= value < math.inf:
        in_ms = f"{value * 1000:g}ms"
        return in_ms if 0 < value < 1 and seconds_of(in_ms) == value else f"{_number(value)}s"
    if field == "save":
        names = [FileType(one).name.lower() for one in value]
        return names[0] if len(names) == 1 else f"[{', '.join(names)}]"
    if field == "bounds":
        return f"[{', '.join('null' if one is None else _number(one) for one in value)}]"
    if isinstance(value, float):  # a number, or a time that no text says
        return _number(value)
    if field in _WORDS_ALONE and str(value).isalpha():
        return str(value)
    return json.dumps(value, ensure_ascii=False)


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")


def conditions_text(conditions: Conditions) -> str:
    """Return how many there are of each, in words."""
    kinds = {"derived signal": conditions.derived, "limit": conditions.limits, "trigger": conditions.triggers}
    told = [many(len(those), noun) for noun, those in kinds.items() if those]
    return ", ".join(told) or "no derived signals, limits, triggers any more"


def checked_conditions(
    conditions: Conditions,
    elements: Sequence[ElementInfo],
    prefix: str,
    frequency_hz: float,
    there: Sequence[TriggerOptions] = (),
) -> Conditions:
    """Return conditions that fit a table. Raises ElementError for the first that doesn't."""
    made, unfit = fitting_conditions(conditions, elements, prefix, frequency_hz, there, most=1)
    if unfit:
        raise unfit[0].error
    return made


class UnfitCondition(NamedTuple):
    """What doesn't fit a table, and why."""

    kind: Kind
    name: str
    error: ElementError

    def __str__(self) -> str:
        words = self.error.reason if isinstance(self.error, ExpressionError) else str(self.error)
        named = "" if f"'{self.name}'" in words else f"{self.kind} '{shorten(self.name)}': "
        return named + words.removesuffix("; nothing was changed")

    @property
    def is_of_another_table(self) -> bool:
        """Whether it speaks of what this table doesn't have, as one of another program, or of before a change."""
        return isinstance(self.error, ExpressionError) or isinstance(self.error.__context__, ExpressionError)


def fitting_conditions(
    conditions: Conditions,
    elements: Sequence[ElementInfo],
    prefix: str,
    frequency_hz: float,
    there: Sequence[TriggerOptions] = (),
    *,
    most: int = MAX_PROBLEMS,
) -> tuple[Conditions, list[UnfitCondition]]:
    """Return what of conditions fits a table, and what doesn't; with `most` of that it ends.

    Triggers that are `there` stay, though buffers have become too small for them.
    """
    from silo.judging.checks import check_held, table_catalogue, with_derived, with_limits, with_trigger

    catalogue, made, names = table_catalogue(elements, prefix), NO_CONDITIONS, set[tuple[str, str]]()

    def add(kind: Kind, one: Derived | SignalLimits | TriggerOptions) -> Conditions:
        if (kind, one.name) in names:
            raise ElementError(f"{kind} '{shorten(one.name)}' stands there twice; nothing was changed")
        names.add((kind, one.name))
        if isinstance(one, Derived):
            return with_derived(made, one, catalogue)
        if isinstance(one, SignalLimits):
            return with_limits(made, one, catalogue)
        if one not in there:
            check_held(one, elements, frequency_hz)
        return with_trigger(made, one, catalogue)

    unfit: list[UnfitCondition] = []
    for kind, items in kinds_of(conditions):
        for one in items:
            try:
                made = add(kind, one)
            except ElementError as error:  # noqa: PERF203  # each may be wrong, and all that are shall be told
                unfit.append(UnfitCondition(kind, one.name, error))
                if len(unfit) >= most:
                    return made, unfit
    return made, unfit


def with_left_out(
    now: Conditions, script: Conditions, elements: Sequence[ElementInfo], prefix: str
) -> tuple[Conditions, list[str]]:
    """Return conditions with those of a script, too, that speak of what a table lacks, and the names of these."""
    each = sum(len(items) for _, items in kinds_of(script))
    _, unfit = fitting_conditions(script, elements, prefix, 1.0, script.triggers, most=each + 1)
    gone = {(one.kind, one.name) for one in unfit if one.is_of_another_table}

    def kept(kind: Kind, items: Sequence[_Item], there: Sequence[_Item]) -> tuple[_Item, ...]:
        names = {one.name for one in there}
        return tuple(one for one in items if (kind, one.name) in gone and one.name not in names)

    more = Conditions(
        kept(DERIVED, script.derived, now.derived),
        kept(LIMITS, script.limits, now.limits),
        kept(TRIGGERS, script.triggers, now.triggers),
    )
    names = [one.name for _, items in kinds_of(more) for one in items]
    return Conditions(now.derived + more.derived, now.limits + more.limits, now.triggers + more.triggers), names
