"""Presets of parameters: YAML files `name: value` of which lines and comments stay when they are written again."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from silo.core.tuning.parameters import ParameterInfo, ParameterKind, ParameterValue, fitting, meant, only_meant
from silo.errors import ElementError, ScriptError
from silo.files.atomic import atomic_file
from silo.settings.yaml_nodes import line_of, read_nodes

_TRUTH = {"true": True, "on": True, "yes": True, "false": False, "off": False, "no": False}


def typed_value(info: ParameterInfo, words: str | Sequence[str]) -> ParameterValue:
    """Return the value that somebody wrote for a parameter. Raises ElementError for one that doesn't fit."""
    if len(info.shape) == 2 and isinstance(words, str) and words.count("[") > 1:
        rows = re.findall(r"\[([^\[\]]*)\]", words)
        return fitting(info, [[_item(info, part.strip()) for part in row.split(",")] for row in rows])
    if info.shape:
        items = [part.strip() for part in words.strip(" []").split(",")] if isinstance(words, str) else list(words)
        return fitting(info, [_item(info, item) for item in items])
    return fitting(info, _item(info, words if isinstance(words, str) else str(list(words))))


def _item(info: ParameterInfo, word: str) -> object:
    """A word as what the parameter is; as it is where it isn't one: `fitting` refuses it then in words."""
    try:
        if info.kind is ParameterKind.FLOAT:
            return float(word)
        if info.kind is ParameterKind.INT:
            return int(word)
    except ValueError:
        return word
    return _TRUTH.get(word.lower(), word) if info.kind is ParameterKind.BOOL else word


def read_preset(path: str | os.PathLike[str], infos: Sequence[ParameterInfo]) -> dict[str, ParameterValue]:
    """Return the values of a preset by full names.

    Raises ScriptError, with file, line, parameter and range of each that makes no sense.
    """
    file = Path(path)
    found: dict[str, ParameterValue] = {}
    wrong = []
    for name, value in _pairs(file, read_nodes(file)[1]):
        why = _take(name.value, value, infos, found)
        if why:
            wrong.append(f"{file}:{line_of(name)}: {why}")
    if wrong:
        raise ScriptError("\n".join(wrong) + "\nnothing was changed")
    return found


def _take(name: str, value: yaml.Node, infos: Sequence[ParameterInfo], found: dict[str, ParameterValue]) -> str:
    """Add the value of a line to what was found; why it makes no sense, empty where it does."""
    items = [] if isinstance(value, yaml.ScalarNode) else value.value
    if not all(isinstance(one, yaml.ScalarNode) for one in items):
        return f"parameter '{name}': its values stand in one list, [1, 2, 3, 4], whatever its shape"
    words = value.value if isinstance(value, yaml.ScalarNode) else [one.value for one in items]
    try:
        known = {one.name: one for one in infos}
        info = known[only_meant(name, known)]
        read = typed_value(info, words)
    except ElementError as error:
        return str(error).removesuffix("; nothing was changed")
    if info.name in found:
        return f"parameter '{info.name}' stands there twice"
    found[info.name] = read
    return ""


def write_preset(path: str | os.PathLike[str], values: Mapping[str, ParameterValue]) -> Path:
    """Write values, whole or not at all. Of a preset that is there, all other lines, order and comments stay.

    Raises ScriptError where that is no preset, SaveError where the system refuses.
    """
    file = Path(path)
    text, root = read_nodes(file) if file.exists() else ("", None)
    left = dict(values)
    places = []
    for name, value in _pairs(file, root):
        known = meant(name.value, left)
        if len(known) == 1:
            places.append((value.start_mark.index, value.end_mark.index, _written(left.pop(known[0]))))
    for begin, end, written in sorted(places, reverse=True):
        text = text[:begin] + written + text[end:]
    if left and text and not text.endswith("\n"):
        text += "\n"
    text += "".join(f"{name}: {_written(value)}\n" for name, value in left.items())
    with atomic_file(file) as opened:
        opened.write(text.encode())
    return file


def _written(value: ParameterValue) -> str:
    """A value as YAML, on one line."""
    made = yaml.safe_dump(list(value) if isinstance(value, tuple) else value, default_flow_style=True, width=2**20)
    return str(made).removesuffix("\n").removesuffix("\n...")


def _pairs(file: Path, root: yaml.Node | None) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    if root is None:
        return []
    plain = (yaml.ScalarNode, yaml.SequenceNode)
    pairs = root.value if isinstance(root, yaml.MappingNode) else [(root, None)]
    for name, value in pairs:
        if not isinstance(name, yaml.ScalarNode) or not isinstance(value, plain):
            raise ScriptError(f"{file}:{line_of(name)}: a preset has lines `name: value`")
    return list(pairs)
