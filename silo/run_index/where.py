"""`--where "max(joints/tau_3) > 30 and success"`: a condition on what the index knows, so that no run is read.

`min max mean std rms last count` are those of a signal over its run; a name alone is a fact of the run (`span`, `lost`,
`limits`), a tag, a parameter, or a signal's last value. Beside `==` and `!=` enumerations and texts are compared with
words: `gait == TROT`. A run that lacks what is asked for doesn't match.
"""

import itertools
import math
import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from silo.core.names import Names, did_you_mean
from silo.core.quantities.writing import and_more
from silo.core.tuning.parameters import ParameterValue
from silo.core.units import factor
from silo.errors import ExpressionError
from silo.expressions.operations import Function
from silo.expressions.parsing import Call, ComparisonChain, Expression, Name, Node, Number, Operation, nodes_in, parse
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


def is_true(number: float) -> bool:
    """Whether something holds: what can't be computed doesn't."""
    return bool(number) and not math.isnan(number)


def _pairs(node: ComparisonChain) -> Iterator[tuple[Node, str, Node]]:
    return zip(node.operands, node.operators, node.operands[1:], strict=False)


class MissingError(Exception):
    """A run lacks what is asked for."""


class SeveralSignalsError(ExpressionError):
    """In a run a name means several signals, where one is meant."""


@dataclass(frozen=True)
class Value:
    """A number with its unit, empty where it has none; `word` is that of an enumeration or text."""

    number: float
    unit: str = ""
    word: str = ""


def said_by(
    labels: Sequence[Mapping[str, Collection[str]]], parameters: Sequence[Mapping[str, ParameterValue]]
) -> dict[str, set[str]]:
    """Return the words that elements and parameters have: labels by elements, and values of parameters."""
    found: dict[str, set[str]] = {}
    for some in labels:
        for name, words in some.items():
            found.setdefault(name, set()).update(words)
    for values in parameters:
        for name, value in values.items():
            if isinstance(value, str):
                found.setdefault(name, set()).add(value)
    return found


class Query:
    """An expression, and which of all known signals its names mean."""

    def __init__(
        self,
        text: str,
        known: Mapping[str, Sequence[str]],
        words: Collection[str] = (),
        tags: Collection[str] = (),
        said: Mapping[str, Collection[str]] = {},
    ) -> None:
        """Read it; `known` are elements with their scalars, `words` parameters and `tags` that any run has.

        `said` are the words that elements and parameters are compared with, of `said_by`. A name that is a tag of some
        runs and nothing else is 0 in all others. Raises ExpressionError with the place; a
        name that nothing has is one.
        """
        self._tags = set(tags) - set(words)
        words = (*words, *tags)
        self.expression: Expression = parse(text, FUNCTIONS)
        nodes = list(nodes_in(self.expression.root))
        named = [node for node in nodes if isinstance(node, Name)]
        calls = [node for node in nodes if isinstance(node, Call) and node.function == "tagged"]
        of_tags = [id(inner) for call in calls for inner in nodes_in(call)]
        names = Names(known, scalars=known.values)
        elements = list(known)
        self._meant: dict[str, list[str]] = {}
        self._elements: dict[str, list[str]] = {}
        self._said: dict[str, set[str]] = {}  # of a name: with what it may be compared
        for name in named:
            meant = [elements[place] for place, _ in names.find(name.text, scalars=True)]
            self._elements[name.text] = meant
            self._said[name.text] = {word for one in (*meant, name.text) for word in said.get(one, ())}
        chains = [node for node in nodes if isinstance(node, ComparisonChain)]
        asked = [self._with_word(*pair) for chain in chains for pair in _pairs(chain)]
        words_asked = [id(found[1]) for found in asked if found is not None]
        for name in named:
            if id(name) in words_asked:
                continue
            found = names.find(name.text, scalars=True)
            scalars = [known[elements[place]] if at is None else [known[elements[place]][at]] for place, at in found]
            self._meant[name.text] = [one for some in scalars for one in some]
            self._tags -= {name.text} if found else set()
            if not found and id(name) not in of_tags and name.text not in FACTS and name.text not in words:
                if name.text in itertools.chain(*said.values()):
                    raise self.expression.error(
                        f"'{name.text}' is a word: it is compared by == and != with what has it", name
                    )
                near = names.near(name.text, 1, more=[*FACTS, *words, *itertools.chain(*said.values())])
                hint = did_you_mean(near, f"facts of a run are {', '.join(FACTS)}")
                raise self.expression.error(f"no run has '{name.text}'{hint}", name)

    def _with_word(self, one: Node, how: str, other: Node) -> tuple[Node, Name] | None:
        for value, word in ((one, other), (other, one)):
            if how in ("==", "!=") and isinstance(word, Name) and word.text in self._words_of(value):
                return value, word
        return None

    def _words_of(self, node: Node) -> Collection[str]:
        if isinstance(node, Call) and node.function in ("last", "min", "max"):
            node = node.arguments[0]
        return self._said.get(node.text, ()) if isinstance(node, Name) else ()

    @property
    def signals(self) -> list[str]:
        """The signals that are asked for, by their whole names."""
        return list(dict.fromkeys(name for some in self._meant.values() for name in some))

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
            return Value(float(all(self._holds_between(*pair, node, value) for pair in _pairs(node))))
        return self._operation(node, value)

    def _holds_between(self, one: Node, how: str, other: Node, node: Node, value: Callable[[Node], Value]) -> bool:
        if (found := self._with_word(one, how, other)) is not None:
            return bool(_COMPARED[how](value(found[0]).word, found[1].text))
        return bool(_COMPARED[how](*self._alike(value(one), value(other), node)))

    def _operation(self, node: Operation, value: Callable[[Node], Value]) -> Value:
        if node.operator == "and":
            return Value(float(all(is_true(value(part).number) for part in node.operands)))
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
            return is_true(value(part).number)
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
        texts = (run.parameters.get(one) for one in (name.text, *self._elements[name.text]))
        if (text := next((one for one in texts if isinstance(one, str)), None)) is not None:
            try:
                number = self._statistic("last", name, signals)
            except MissingError:  # of a text
                number = Value(math.nan)
            return replace(number, word=text)
        return Value(0.0) if name.text in self._tags else self._statistic("last", name, signals)

    def _statistic(self, function: str, name: Name, signals: Mapping[str, SignalFacts]) -> Value:
        field, together, _ = OF_SIGNALS[function]
        found = [signals[one] for one in self._meant[name.text] if one in signals]
        values = [number for one in found if (number := getattr(one, field)) is not None]
        if not values:
            raise MissingError
        if len(values) > 1 and function not in ("min", "max", "count"):
            reason = f"'{name.text}' means {len(found)} signals ({and_more([one.name for one in found], 3)}): name one"
            raise SeveralSignalsError(reason, self.expression.text, name.at, name.end)
        units = {one.unit for one in found}
        unit = units.pop() if len(units) == 1 and function != "count" else ""
        number = float(together(values))
        named = function in ("last", "min", "max") and number.is_integer()
        word = found[0].labels.get(int(number), "") if named else ""
        return Value(number, "" if unit == "-" else unit, word)

    def _alike(self, one: Value, other: Value, node: Node) -> tuple[float, float]:
        """Both numbers in the unit of the first. Raises ExpressionError where units don't fit."""
        if not one.unit or not other.unit or one.unit == other.unit:
            return one.number, other.number
        times = factor(other.unit, one.unit)
        if times is None:
            raise self.expression.error(f"{other.unit} can't be compared with {one.unit}", node)
        return one.number, other.number * times
