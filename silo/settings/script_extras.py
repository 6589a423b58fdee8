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
    pre_s: 5
    post_s: 1

A key that is there stands for all of its kind, `triggers: []` for none; of a kind without a key everything stays as it
was, such as what the program has set.
"""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypeVar

import msgspec
import yaml

from silo.model import NO_EXTRAS, Derived, ElementInfo, Extras, SignalLimits, TriggerOptions
from silo.settings.yaml_nodes import describe, is_null, line_of

DERIVED, LIMITS, TRIGGERS = "derived_signals", "signal_limits", "triggers"
KEYS = (DERIVED, LIMITS, TRIGGERS)

_Item = TypeVar("_Item", Derived, SignalLimits, TriggerOptions)

MOST_DEPTH = 3


def read_extras(keys: Mapping[str, yaml.Node], report: Callable[[int, str], None]) -> Extras | None:
    """Return what the keys of a script say; None if they aren't there. Problems are reported with their lines."""
    if not any(key in keys for key in KEYS):
        return None
    return Extras(
        tuple(_items(keys.get(DERIVED), DERIVED, Derived, report)),
        tuple(_items(keys.get(LIMITS), LIMITS, SignalLimits, report)),
        tuple(_items(keys.get(TRIGGERS), TRIGGERS, TriggerOptions, report)),
    )


def given_kinds(keys: Mapping[str, yaml.Node]) -> frozenset[str]:
    """Return which of the keys are there."""
    return frozenset(key for key in KEYS if key in keys)


def merged(script: Extras, given: Collection[str], now: Extras) -> Extras:
    """Return what a script leads to beside what there is: kinds whose keys it lacks stay."""
    return msgspec.structs.replace(
        now,
        derived=script.derived if DERIVED in given else now.derived,
        limits=script.limits if LIMITS in given else now.limits,
        triggers=script.triggers if TRIGGERS in given else now.triggers,
    )


def _items(node: yaml.Node | None, key: str, kind: type[_Item], report: Callable[[int, str], None]) -> list[_Item]:
    if node is None or is_null(node):
        return []
    if not isinstance(node, yaml.SequenceNode):
        report(line_of(node), f"{key} must be a list (`- name: ...`), got {describe(node)}")
        return []
    found = []
    for item in node.value:
        plain = _plain(item, MOST_DEPTH)
        unknown = plain.keys() - set(kind.__struct_fields__) if isinstance(plain, dict) else ()
        if unknown:
            report(line_of(item), f"{key}: no key '{min(unknown)}'; there are {', '.join(kind.__struct_fields__)}")
            continue
        try:
            found.append(msgspec.convert(plain, kind, strict=False))
        except msgspec.ValidationError as error:
            report(line_of(item), f"{key}: {error}")
    return found


def _plain(node: yaml.Node, depth: int) -> Any:
    if isinstance(node, yaml.MappingNode) and depth:
        return {str(key.value): _plain(value, depth - 1) for key, value in node.value}
    if isinstance(node, yaml.SequenceNode) and depth:
        return [_plain(one, depth - 1) for one in node.value]
    return None if is_null(node) or not isinstance(node, yaml.ScalarNode) else str(node.value)


def format_extras(extras: Extras) -> str:
    """Return the keys of a script; empty where there is nothing to say."""
    lines = []
    for key, items in ((DERIVED, extras.derived), (LIMITS, extras.limits), (TRIGGERS, extras.triggers)):
        lines += [f"{key}:\n"] if items else []
        for item in items:
            fields = [(name, value) for name, value in msgspec.to_builtins(item).items() if value != ""]
            lines += [
                f"  {'- ' if at == 0 else '  '}{name}: {json.dumps(value, ensure_ascii=False)}\n"
                for at, (name, value) in enumerate(fields)
            ]
    return "".join(lines)


def extras_text(extras: Extras) -> str:
    """Return how many there are of each, in words."""
    counts = [
        (len(extras.derived), "derived signal"), (len(extras.limits), "limit"), (len(extras.triggers), "trigger")
    ]  # fmt: skip
    told = [f"{count} {noun}{'s' if count != 1 else ''}" for count, noun in counts if count]
    return ", ".join(told) or "no derived signals, limits, triggers any more"


def checked_extras(extras: Extras, elements: Sequence[ElementInfo], prefix: str, frequency_hz: float) -> Extras:
    """Return extras that fit a table. Raises ElementError for the first that doesn't."""
    from silo.judging.extras import check_held, with_derived, with_limits, with_trigger

    made = NO_EXTRAS
    for derived in extras.derived:
        made = with_derived(made, derived, elements, prefix)
    for limits in extras.limits:
        made = with_limits(made, limits, elements, prefix)
    for trigger in extras.triggers:
        made = with_trigger(made, trigger, elements, prefix)
        check_held(trigger, elements, frequency_hz)
    return made
