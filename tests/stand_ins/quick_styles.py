"""What Textual finds out of styles, kept for nodes alike: which rules apply to one, of all that there are.

A node is like another if the rules that may mean it look at the same names, classes and states of it and of those that
it is in. Rules that look at the place among others (`:first-child`, `:focus-within`) are looked up anew each time.
"""

from collections.abc import Hashable
from typing import Any

from textual.css.stylesheet import Stylesheet
from textual.dom import DOMNode

apply, process, replace = Stylesheet.apply, Stylesheet._process_component_classes, Stylesheet.replace_rules
OWN = {"layout", "display", "pointer"}  # each node has a layout of its own, and tells others of the rest
FLAGS = ("_has_hover_style", "_has_focus_within", "_has_order_style", "_has_odd_or_even")

_sheets: dict[tuple[Any, ...], int] = {}  # of the rules of a sheet, which are kept: no other is taken for one
_states: dict[tuple[Any, ...], tuple[str, ...] | None] = {}  # at which states the rules for such a node look
_rules: dict[tuple[Any, ...], tuple[Any, ...]] = {}  # of a node: the flags and the rules
_results: dict[int, dict[str, Any]] = {}  # of rules, which are kept: what a node then has, a layout by its name
_components: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = {}  # of a widget: the rules by the name of a part


def _number_of(sheet: Any) -> int:
    """Return which rules a sheet has."""
    rules = sheet.rules
    known = sheet.__dict__.get("_numbered")
    if known is None or known[0] is not rules:
        known = sheet._numbered = (rules, _sheets.setdefault(tuple(rules), len(_sheets)))
    return known[1]


def _states_of(sheet: Any, number: int, names: frozenset[str]) -> tuple[str, ...] | None:
    """Return at which states the rules look that may mean a node of these names; None if at places, too."""
    if (number, names) not in _states:
        found: set[str] = set()
        for name in sheet.rules_map.keys() & names:
            found.update(*(rule.pseudo_classes for rule in sheet.rules_map[name]))
        at_places = found & sheet._EXCLUDE_PSEUDO_CLASSES_FROM_CACHE
        _states[number, names] = None if at_places else tuple(sorted(found))
    return _states[number, names]


def _likeness(number: int, node: Any, states: tuple[str, ...]) -> tuple[Hashable, ...]:
    """Return what rules see of a node and of those that it is in."""
    seen: list[Hashable] = [number, states]
    while isinstance(node, DOMNode):
        checks = node._PSEUDO_CLASSES
        seen += (type(node), node._id, frozenset(node._classes))
        seen += (checks[one](node) for one in states if one in checks)
        node = node._parent
    return tuple(seen)


def apply_known(sheet: Any, node: Any, *, animate: bool = False, cache: Any = None) -> None:
    """`Stylesheet.apply`."""
    number = _number_of(sheet)
    states = _states_of(sheet, number, frozenset(node._selector_names))
    if states is None:
        apply(sheet, node, animate=animate, cache=cache)
        return
    likeness = _likeness(number, node, states)
    if likeness not in _rules:
        found = []
        sheet.replace_rules = lambda node, rules, animate=False: found.append(rules)
        sheet._process_component_classes = lambda node: None
        try:
            apply(sheet, node)
        finally:
            del sheet.replace_rules, sheet._process_component_classes
        _rules[likeness] = ([getattr(node, flag) for flag in FLAGS], *found)
    flags, *rules = _rules[likeness]
    for flag, value in zip(FLAGS, flags, strict=True):
        setattr(node, flag, value)
    for each in rules:
        _replace_known(node, each, animate=animate)
    process_known(sheet, node)


def _replace_known(node: Any, rules: dict[str, Any], *, animate: bool) -> None:
    """`Stylesheet.replace_rules`, without a look at rules that stay as they are, or are the first of a node."""
    base = node.styles.base
    there, known = base._rules, _results.get(id(rules))
    moves = animate and "transitions" in rules
    if moves or known is None:
        replace(node, rules, animate=animate)
        if not moves:
            _results[id(rules)] = there | ({"layout": there["layout"].name} if "layout" in there else {})
        return
    if there or node._is_mounted:
        now = there | ({"layout": there["layout"].name} if "layout" in there else {})
        if now != known:
            for name in [name for name in now.keys() | known.keys() if now.get(name) != known.get(name)]:
                setattr(base, name, rules.get(name))
    else:
        there.update(known)
        base._updates += len(known)
        for name in OWN & known.keys():
            del there[name]
            setattr(base, name, rules[name])
    node.notify_style_update()


class Parts(dict[str, Any]):
    """Styles of the parts of a widget, each made as it is first looked at, as most never are."""

    def __init__(self, node: Any, rules: dict[str, dict[str, Any]]) -> None:
        super().__init__()
        self.rules = rules
        self._node = node

    def __contains__(self, name: object) -> bool:
        return name in self.rules

    def __missing__(self, name: str) -> Any:
        part = DOMNode(classes=name)
        part._attach(self._node)
        part.styles.base._rules.update(self.rules[name])
        part.styles.base._updates += 1
        self[name] = part.styles
        return part.styles

    def clear(self) -> None:
        super().clear()
        self.rules = {}


def process_known(sheet: Any, node: Any) -> None:
    """`Stylesheet._process_component_classes`."""
    names = node._get_component_classes()
    if not names:
        return
    number = _number_of(sheet)
    states = _states_of(sheet, number, frozenset({"*", "DOMNode", *(f".{name}" for name in names)}))
    before = node._component_styles
    if states is not None:
        likeness = (*_likeness(number, node, states), frozenset(names))
        if likeness in _components:
            known = _components[likeness]
            had = before.rules if isinstance(before, Parts) else {name: one.base._rules for name, one in before.items()}
            if had is known:
                return
            node._component_styles = parts = Parts(node, known)
            parts.update((name, one) for name, one in before.items() if one.base._rules == known.get(name))
            if had != known:
                node.refresh()
            return
    node._component_styles = dict(before)
    process(sheet, node)
    if states is not None:
        _components[likeness] = {name: dict(node._component_styles[name].base._rules) for name in sorted(names)}
