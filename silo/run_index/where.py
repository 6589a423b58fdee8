"""`--where "max(joints/tau_3) > 30 and success"`: a condition on what the index knows, so that no run is read.

`min max mean std rms last count` are those of a signal over its run; a name alone is a fact of the run (`span`, `lost`,
`limits`), a tag, a parameter, or a signal's last value. A run that lacks what is asked for doesn't match.
"""

import math
import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from silo.core.names import Names, did_you_mean
from silo.core.units import factor
from silo.expressions.operations import Function
from silo.expressions.parsing import Call, ComparisonChain, Expression, Name, Node, Number, Operation, parse
from silo.run_index.facts import RunFacts, SignalFacts

FACTS: dict[str, tuple[str, Callable[[RunFacts], float]]] = {
    "span": ("s", lambda run: run.span_s),
    "ticks": ("", lambda run: float(run.ticks)),
    "elements": ("", lambda run: float(run.elements)),
    "frequency": ("Hz", lambda run: run.rate_hz),
    "lost": ("", lambda run: float(run.lost)),
    "failed": ("", lambda run: float(run.failed)),
    "marks": ("", lambda run: float(run.marks)),
    "limits": ("", lambda run: float(run.limits)),
    "triggers": ("", lambda run: float(run.triggers)),
    "episodes": ("", lambda run: float(len(run.episodes))),
    "warnings": ("", lambda run: float(run.warnings)),
}
OF_SIGNALS: dict[str, tuple[str, Callable[[Sequence[float]], float], str]] = {
    "min": ("least", min, "smallest value"), "max": ("most", max, "largest value"),
    "mean": ("mean", operator.itemgetter(0), "mean"), "std": ("std", operator.itemgetter(0), "standard deviation"),
    "rms": ("rms", operator.itemgetter(0), "root of the mean square"),
    "last": ("last", operator.itemgetter(0), "last value"), "count": ("count", sum, "samples but NaN"),
}  # fmt: skip
FUNCTIONS = {name: Function(1, 1, f"{what} of a signal") for name, (_, _, what) in OF_SIGNALS.items()} | {
    "abs": Function(1, 1, "without its sign"), "tagged": Function(1, 1, "whether the run has this tag"),
}  # fmt: skip
_COMPARED = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq,
             "!=": operator.ne}  # fmt: skip
_ARITHMETIC: dict[str, Callable[..., float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "%": operator.mod,
    "**": operator.pow, "neg": operator.neg,
}  # fmt: skip


def _names(node: Node, of_tag: bool = False) -> Iterator[tuple[Name, bool]]:
    """Every name in an expression, and whether it is that of a tag."""
    if isinstance(node, Name):
        yield node, of_tag
    elif not isinstance(node, Number):
        for part in node.arguments if isinstance(node, Call) else node.operands:
            yield from _names(part, isinstance(node, Call) and node.function == "tagged")


def _true(number: float) -> bool:
    """Whether something holds: what can't be computed doesn't."""
    return bool(number) and not math.isnan(number)


class MissingError(Exception):
    """A run lacks what is asked for."""


@dataclass(frozen=True)
class Value:
    """A number with its unit, empty where it has none."""

    number: float
    unit: str = ""


class Query:
    """An expression, and which of all known signals its names mean."""

    def __init__(
        self, text: str, known: Mapping[str, Sequence[str]], words: Collection[str] = (), tags: Collection[str] = ()
    ) -> None:
        """Read it; `known` are elements with their scalars, `words` parameters and `tags` that any run has.

        A name that is a tag of some runs and nothing else is 0 in all others. Raises ExpressionError with the place; a
        name that nothing has is one.
        """
        self._tags = set(tags) - set(words)
        words = (*words, *tags)
        self.expression: Expression = parse(text, FUNCTIONS)
        names = Names(known, scalars=known.values)
        elements = list(known)
        self._meant: dict[str, list[str]] = {}
        for name, of_tag in _names(self.expression.root):
            found = names.find(name.text, scalars=True)
            scalars = [known[elements[place]] if at is None else [known[elements[place]][at]] for place, at in found]
            self._meant[name.text] = [one for some in scalars for one in some]
            self._tags -= {name.text} if found else set()
            if not found and not of_tag and name.text not in FACTS and name.text not in words:
                near = names.near(name.text, 1, more=[*FACTS, *words])
                hint = did_you_mean(near, f"facts of a run are {', '.join(FACTS)}")
                raise self.expression.error(f"no run has '{name.text}'{hint}", name)

    @property
    def signals(self) -> list[str]:
        """The signals that are asked for, by their whole names."""
        return list(dict.fromkeys(name for some in self._meant.values() for name in some))

    def holds(self, run: RunFacts, tags: Sequence[str], signals: Sequence[SignalFacts]) -> bool:
        """Whether it holds for a run; False where the run lacks something. Raises ExpressionError."""
        return _true(self.number(run, tags, signals))

    def number(self, run: RunFacts, tags: Sequence[str], signals: Sequence[SignalFacts]) -> float:
        """Return what it is for a run, NaN where the run lacks something. Raises ExpressionError."""
        try:
            return self._value(self.expression.root, run, tags, {one.name: one for one in signals}).number
        except MissingError:
            return math.nan

    def _value(self, node: Node, run: RunFacts, tags: Sequence[str], signals: Mapping[str, SignalFacts]) -> Value:
        def value(part: Node) -> Value:
            return self._value(part, run, tags, signals)

        if isinstance(node, Number):
            return Value(node.value, node.unit)
        if isinstance(node, Name):
            return self._named(node, run, tags, signals)
        if isinstance(node, Call):
            if node.function == "abs":
                inner = value(node.arguments[0])
                return Value(abs(inner.number), inner.unit)
            argument = node.arguments[0]
            if not isinstance(argument, Name):
                raise self.expression.error(f"{node.function} takes the name of one signal", argument)
            if node.function == "tagged":
                return Value(float(argument.text in tags))
            return self._statistic(node.function, argument, signals)
        if isinstance(node, ComparisonChain):
            values = [value(part) for part in node.operands]
            pairs = zip(values, node.operators, values[1:], strict=False)
            return Value(float(all(_COMPARED[how](*self._alike(one, other, node)) for one, how, other in pairs)))
        return self._operation(node, value)

    def _operation(self, node: Operation, value: Callable[[Node], Value]) -> Value:
        if node.operator == "and":
            return Value(float(all(_true(value(part).number) for part in node.operands)))
        if node.operator == "or":
            return Value(float(any(self._or_missing(part, value) for part in node.operands)))
        if node.operator == "not":
            return Value(float(not value(node.operands[0]).number))
        values = [value(part) for part in node.operands]
        numbers = [one.number for one in values]
        if node.operator in ("+", "-", "%") and len(values) == 2:
            numbers = list(self._alike(values[0], values[1], node))
        unit = values[0].unit if node.operator in ("+", "-", "%", "neg") else ""
        try:
            return Value(float(_ARITHMETIC[node.operator](*numbers)), unit)
        except (ZeroDivisionError, OverflowError, TypeError):
            return Value(math.nan, unit)

    @staticmethod
    def _or_missing(part: Node, value: Callable[[Node], Value]) -> bool:
        try:
            return _true(value(part).number)
        except MissingError:
            return False

    def _named(self, name: Name, run: RunFacts, tags: Sequence[str], signals: Mapping[str, SignalFacts]) -> Value:
        if name.text in FACTS:
            unit, read = FACTS[name.text]
            return Value(read(run), unit)
        if name.text in tags:
            return Value(1.0)
        parameter = run.parameters.get(name.text)
        if isinstance(parameter, bool | int | float):
            return Value(float(parameter))
        return Value(0.0) if name.text in self._tags else self._statistic("last", name, signals)

    def _statistic(self, function: str, name: Name, signals: Mapping[str, SignalFacts]) -> Value:
        field, together, _ = OF_SIGNALS[function]
        found = [signals[one] for one in self._meant[name.text] if one in signals]
        values = [number for one in found if (number := getattr(one, field)) is not None]
        if not values:
            raise MissingError
        if len(values) > 1 and function not in ("min", "max", "count"):
            names = ", ".join(one.name for one in found[:3])
            raise self.expression.error(f"'{name.text}' means {len(found)} signals ({names}): name one", name)
        units = {one.unit for one in found}
        unit = units.pop() if len(units) == 1 and function != "count" else ""
        return Value(float(together(values)), "" if unit == "-" else unit)

    def _alike(self, one: Value, other: Value, node: Node) -> tuple[float, float]:
        """Both numbers in the unit of the first. Raises ExpressionError where units don't fit."""
        if not one.unit or not other.unit or one.unit == other.unit:
            return one.number, other.number
        times = factor(other.unit, one.unit)
        if times is None:
            raise self.expression.error(f"{other.unit} can't be compared with {one.unit}", node)
        return one.number, other.number * times
