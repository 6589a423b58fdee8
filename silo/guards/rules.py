"""A file of rules for runs, as tests hold it.

    - never: abs(base/roll) > 0.6             # true at no tick
    - always: battery/voltage > 21V           # false at no tick
    - holds: max(joints/tau_3) < 30 and lost == 0     # of the whole run, as `silo runs --where`
    - value: rms(imu/acc_z)                   # a number of the whole run, beside that of the baseline
      within: 10%                             # or 0.3; at_most: 110%; at_least: 2.5
    - signals: joints/q*                      # each sample, beside that of the baseline
      tolerance: 0.02
      event: state/mode == TROT               # the same moment in both; by default their starts are
    - new: [missing, limits, lost]            # what the baseline didn't have; all of them if nothing is said

`name:` says what a rule is called. A number with % is a share of the baseline's, one without is as it stands.
"""

import math
from pathlib import Path

import msgspec
import yaml

from silo.errors import ScriptError
from silo.settings.yaml_nodes import describe, key_name, line_of, read_nodes

NEW = ("missing", "limits", "lost")
BOUNDS = ("within", "at_most", "at_least")
_OPTIONS = {
    "never": (), "always": (), "holds": (), "value": BOUNDS, "signals": ("tolerance", "event"), "new": (),
}  # fmt: skip


class Bound(msgspec.Struct, frozen=True):
    """A number, or a share of the baseline's."""

    number: float
    of_baseline: bool = False


class Rule(msgspec.Struct, frozen=True):
    """One rule. kind: which of them. text: its expression or pattern. parts: of `new`. where: `rules.yaml:3`."""

    kind: str
    text: str = ""
    name: str = ""
    bounds: dict[str, Bound] = {}
    tolerance: float = 0.0
    event: str = ""
    parts: tuple[str, ...] = ()
    where: str = ""

    @property
    def needs_baseline(self) -> bool:
        """Whether it holds two runs against each other."""
        shares = any(one.of_baseline for one in self.bounds.values()) or "within" in self.bounds
        return self.kind in ("signals", "new") or shares


def read_rules(path: Path) -> list[Rule]:
    """Return the rules of a file. Raises ScriptError, with file and line of each that makes no sense."""
    _, root = read_nodes(path)
    if not isinstance(root, yaml.SequenceNode) or not root.value:
        raise ScriptError(f"{path}: rules are a list, each begins with `-`: `- never: abs(base/roll) > 0.6`")
    read = [_read(node, f"{path}:{line_of(node)}") for node in root.value]
    wrong = [str(one) for one in read if isinstance(one, ScriptError)]
    if wrong:
        raise ScriptError("\n".join(wrong))
    return [one for one in read if isinstance(one, Rule)]


def _read(node: yaml.Node, where: str) -> Rule | ScriptError:
    try:
        return _rule(node, where)
    except ScriptError as error:
        return error


def _rule(node: yaml.Node, where: str) -> Rule:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    keys = [key_name(key) for key, _ in pairs]
    kinds = [key for key in keys if key in _OPTIONS]
    if len(kinds) != 1 or len(set(keys)) < len(keys):
        raise ScriptError(f"{where}: a rule is one of {', '.join(_OPTIONS)}, got {', '.join(keys) or describe(node)}")
    kind = kinds[0]
    unknown = [key for key in keys if key not in (kind, "name", *_OPTIONS[kind])]
    if unknown:
        raise ScriptError(f"{where}: {kind} has no '{unknown[0]}'; it has {', '.join(('name', *_OPTIONS[kind]))}")
    values = dict(zip(keys, (value for _, value in pairs), strict=True))
    if kind == "new":
        return Rule(kind, name=_text(values, "name", where), parts=_parts(values[kind], where), where=where)
    bounds = {key: _bound(_text(values, key, where), key, where) for key in BOUNDS if key in values}
    if kind == "value" and not bounds:
        raise ScriptError(f"{where}: a value needs {', '.join(BOUNDS)}: `within: 10%`")
    if not (text := _text(values, kind, where)):
        raise ScriptError(f"{where}: {kind} is empty")
    tolerance = _bound(_text(values, "tolerance", where) or "0", "tolerance", where)
    if tolerance.of_baseline:
        raise ScriptError(f"{where}: tolerance is a number in the unit of the signals, got a share")
    return Rule(
        kind, text, _text(values, "name", where), bounds, tolerance.number, _text(values, "event", where), where=where
    )


def _text(values: dict[str, yaml.Node], key: str, where: str) -> str:
    node = values.get(key)
    if node is not None and not isinstance(node, yaml.ScalarNode):
        raise ScriptError(f"{where}: {key} is a text, got {describe(node)}")
    return "" if node is None else str(node.value).strip()


def _parts(node: yaml.Node, where: str) -> tuple[str, ...]:
    parts = tuple(key_name(one) for one in node.value) if isinstance(node, yaml.SequenceNode) else (key_name(node),)
    unknown = [one for one in parts if one not in NEW]
    if unknown:
        raise ScriptError(f"{where}: new is a list of {', '.join(NEW)}, got '{unknown[0]}'")
    return parts


def _bound(text: str, key: str, where: str) -> Bound:
    least = -math.inf if key in ("at_most", "at_least") else 0.0
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not least <= number < math.inf:
        start = "" if least else " from 0 on"
        raise ScriptError(f"{where}: {key} is a number{start}, or a share of the baseline's (10%), got '{text}'")
    return Bound(number / 100, of_baseline=True) if text.endswith("%") else Bound(number)
