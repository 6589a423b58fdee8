"""A view as YAML, read and written: apart from `KeptLayout`, as a start without files of views needs no YAML."""

import math
from collections.abc import Callable
from typing import Any

import msgspec
import yaml

from silo.core.names import did_you_mean, nearest
from silo.settings.yaml_nodes import describe, is_null, key_name, line_of
from silo_tui.layouts.layout import KeptLayout
from silo_tui.settings.reading import nodes, pairs


def _text(node: yaml.Node) -> str:
    if not isinstance(node, yaml.ScalarNode):
        raise ValueError(f"a text, not {describe(node)}")  # noqa: TRY004 - of the file, not of the program
    return "" if is_null(node) else str(node.value)


def _texts(node: yaml.Node) -> tuple[str, ...]:
    if isinstance(node, yaml.SequenceNode):
        return tuple(dict.fromkeys(_text(each) for each in node.value))
    if is_null(node):
        return ()
    raise ValueError(f"a list such as [a, b], not {describe(node)}")


def _panels(node: yaml.Node) -> tuple[tuple[str, ...], ...]:
    if isinstance(node, yaml.SequenceNode):
        seen: set[str] = set()
        found = []
        for each in node.value:
            names = _texts(each) if isinstance(each, yaml.SequenceNode) else (_text(each),)
            found.append(tuple(name for name in names if name not in seen))
            seen.update(names)
        return tuple(panel for panel in found if panel)
    _texts(node)  # nothing, or what says that it is no list
    return ()


def _truth(node: yaml.Node) -> bool:
    word = _text(node).lower()
    if word not in ("true", "false"):
        raise ValueError(f"true or false, not {describe(node)}")
    return word == "true"


def _components(node: yaml.Node) -> dict[str, str]:
    if not isinstance(node, yaml.MappingNode) and not is_null(node):
        raise ValueError(f"lines such as `base/position: norm`, not {describe(node)}")
    return {_text(name): _text(word) for name, word in pairs(node)}


def _number(node: yaml.Node) -> float:
    try:
        number = float(_text(node))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"a number, not {describe(node)}")
    return number


def _rows(node: yaml.Node) -> int:
    most = _number(node)
    if most < 0 or most != int(most):
        raise ValueError(f"a number of rows, 0 for all, not {describe(node)}")
    return int(most)


def _span(node: yaml.Node) -> float:
    span = _number(node)
    if span <= 0:
        raise ValueError(f"seconds above 0, not {describe(node)}")
    return span


def _scales(node: yaml.Node) -> dict[str, tuple[float, float]]:
    if not isinstance(node, yaml.MappingNode) and not is_null(node):
        raise ValueError(f"lines such as `joint/torque: [-30, 40]`, not {describe(node)}")
    found = {}
    for name, ends in pairs(node):
        numbers = [_number(each) for each in ends.value] if isinstance(ends, yaml.SequenceNode) else []
        if len(numbers) != 2 or numbers[0] >= numbers[1]:
            raise ValueError(f"[bottom, top] for {_text(name)}, not {describe(ends)}")
        found[_text(name)] = (numbers[0], numbers[1])
    return found


FIELDS: dict[str, Callable[[yaml.Node], Any]] = {
    "sort": _text, "turned": _truth, "filter": _text, "columns": _texts, "set": _text, "folded": _texts,
    "unfolded": _texts, "components": _components, "inspector": _truth, "plots": _panels, "chosen": _text,
    "span_s": _span, "scales": _scales, "logs": _texts, "most": _rows,
}  # fmt: skip


def read(text: str) -> tuple[KeptLayout, list[str]]:
    """Return a view as a file has it, and what of it was left out and why, by line."""
    root, struck, _ = nodes(text)
    problems = [f"line {problem.line}: {problem.reason}" for problem in struck]
    found: dict[str, Any] = {}
    for key, value in pairs(root):
        name = key_name(key)
        try:
            found[name] = _reader(name)(value)
        except ValueError as error:
            sign = " is" if name in FIELDS else ""
            problems.append(f"line {line_of(key)}: {name}{sign} {error}")
    return KeptLayout(**found), problems


def _reader(name: str) -> Callable[[yaml.Node], Any]:
    if name not in FIELDS:
        raise ValueError("is unknown" + did_you_mean(nearest(name, FIELDS), f"there are {', '.join(FIELDS)}"))
    return FIELDS[name]


def write(layout: KeptLayout) -> str:
    """Return a view as its file has it: what differs from a table without anything chosen."""
    kept, empty = (msgspec.json.decode(msgspec.json.encode(each)) for each in (layout, KeptLayout()))  # tuples as lists
    kept = {name: value for name, value in kept.items() if value != empty[name]}
    if "plots" in kept:
        kept["plots"] = [panel if len(panel) > 1 else panel[0] for panel in kept["plots"]]
    return str(yaml.safe_dump(kept, sort_keys=False, allow_unicode=True)) if kept else "{}\n"
