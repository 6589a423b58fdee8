"""Expressions bound to signals: what they may name looked up, labels and units replaced by numbers, widths checked.

A name is an element, a scalar of one (with its suffix), or either without the prefix, from behind any `/`; a pattern
names several. What an element of several scalars gives is a vector. The result knows where each value stands, and is
what `silo.expressions.evaluation` computes.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from silo.core import units
from silo.core.arrays.function_units import UnitRule
from silo.core.conditions import Derived
from silo.core.elements import ElementInfo, Entry
from silo.core.kinds import in_parts
from silo.core.names import Found, Names, did_you_mean, is_glob, nearest
from silo.core.quantities.writing import and_more, there_are
from silo.errors import ElementError
from silo.expressions.operations import FUNCTIONS
from silo.expressions.parsing import (
    UNIT,
    Call,
    ComparisonChain,
    Expression,
    Name,
    Node,
    Number,
    Operation,
    parse,
    written,
)

OFF = -1  # the source of an element that isn't logged

MOST_WIDTH = 1000  # scalars in a vector
MOST_WINDOW_S = 60.0
# of one expression, with all the derived signals that it stands on, each as often as it is named
MOST_OPERATIONS = 1000
MOST_DEPTH = 20  # derived signals that stand on one another
MOST_VALUES = 100_000  # that are computed for a row
MOST_KEPT_S = 10_000.0  # seconds of values in windows, over their dividers: 80 MB at 1 kHz

_STEPS = ("prev", "diff", "rate")
_OF_TRUTHS = {"any": "max", "all": "min"}  # what they are of 0 and 1
_OVER_TIME = ("min", "max", "sum", *_OF_TRUTHS)  # beside those that are nothing else
_NUMERIC = "biufMm"


@dataclass(frozen=True)
class Known:
    """An element that an expression may name. Elements of one `source` have their samples at the same ticks.

    `source` is OFF where it isn't logged: what depends on it is unobservable.
    """

    name: str
    entries: tuple[Entry, ...]
    unit: str
    source: int
    divider: int
    kind: str = ""  # of the element

    @classmethod
    def of(cls, info: ElementInfo, source: int) -> "Known":
        """Return an element of a table, whose samples a source has."""
        return cls(info.name, info.entries, info.unit, source, info.options.divider, info.kind)


class Catalogue:
    """The elements that expressions may name, in the order of the table. Made once for many expressions."""

    def __init__(self, elements: Sequence[Known], prefix: str = "/log", derived: Sequence[Derived] = ()) -> None:
        self.elements = elements
        self.prefix = prefix
        self.derived = derived

    def before(self, name: str) -> tuple[Derived, "Catalogue"] | None:
        """Return the derived signal of this name, and what its expression may name: elements, and those before it."""
        found = Names((one.name for one in self.derived), self.prefix).find(name, namespaces=False)
        if not found or is_glob(name):
            return None
        place = found[0][0]
        return self.derived[place], self.having(self.derived[:place])

    def having(self, derived: Sequence[Derived]) -> "Catalogue":
        """Return the same elements with other derived signals beside them: what is known of their names stays known."""
        made = Catalogue(self.elements, self.prefix, derived)
        vars(made)["_names"] = self._names
        return made

    def has(self, name: str) -> bool:
        """Whether an element or a scalar has this whole name."""
        return self._names.has(name)

    @cached_property
    def _names(self) -> Names:
        return Names.of(self.elements, self.prefix)

    def find(self, text: str) -> list[Found]:
        """Return what a name or a pattern names: one thing, or several where the name isn't unique."""
        return self._names.find(text, scalars=True, namespaces=False)

    def name(self, place: int, entry: int | None) -> str:
        """Return the full name of an element or of a scalar."""
        element = self.elements[place]
        return element.name if entry is None else element.name + element.entries[entry].suffix

    def unit(self, place: int, entry: int) -> str | None:
        """Return the unit of a scalar: of dates and durations what they count, None where that is none."""
        element = self.elements[place]
        dtype = np.dtype(element.entries[entry].dtype)
        if dtype.kind not in "mM":
            return element.unit
        step, count = np.datetime_data(dtype)
        return _COUNTED.get(step) if count == 1 else None

    def near(self, text: str) -> list[str]:
        """Return the three names nearest to one that is not there, as short as they may be written."""
        if inside := self._names.find(text):  # a namespace
            text = self._names.name(inside[0])
        near = self._names.near(text, scalars=True, more=[one.name for one in self.derived])
        return [name.removeprefix(f"{self._names.prefix}/") for name in near]


_BY_PARTS = ("norm", "prev", "diff", "rate", "mean")
_COUNTED = {"ns": "ns", "us": "us", "ms": "ms", "s": "s", "m": "min", "h": "h", "D": "day"}  # by NumPy's letters


@dataclass(frozen=True)
class ScalarPlace:
    """Where one scalar comes from: element and entry by number, and the source of the element."""

    element: int
    entry: int
    source: int


# ------------------------------------------------------------------------------------------------ what is computed


@dataclass(frozen=True)
class Constant:
    """A number; `whole` is what a float64 may not hold to the last digit."""

    value: float
    whole: int | None = None


@dataclass(frozen=True)
class BoundSignal:
    """A scalar, or a vector of several."""

    columns: tuple[ScalarPlace, ...]
    vector: bool


@dataclass(frozen=True)
class Computed:
    """What `operator` makes of the parts: an operation, a comparison, or a function without memory."""

    operator: str
    parts: tuple["Part", ...]


@dataclass(frozen=True, eq=False)
class Remembered:
    """A function that remembers samples of its part: a step, or a window of `window_ns`. Compared by identity."""

    function: str
    part: "Part"
    window_ns: int
    sources: tuple[int, ...]


Part = Constant | BoundSignal | Computed | Remembered


@dataclass(frozen=True)
class BoundExpression:
    """An expression with its signals. `width` is 0 for a scalar, else the length of its vector.

    `sources` has every source that it is judged at, with its divider; empty where all its signals are off. `kept_s` are
    the seconds of its windows times their values, over the dividers: how much it remembers.
    """

    expression: Expression
    root: Part
    width: int
    unit: str
    logical: bool
    labels: Mapping[int, str]
    columns: tuple[ScalarPlace, ...]
    sources: Mapping[int, int]
    kept_s: float = 0.0

    def condition(self) -> "BoundExpression":
        """Return the same, where it is one truth. Raises ExpressionError for a vector."""
        if self.width:
            raise self.expression.error(
                f"this has {self.width} values, a condition one: write any(...) or all(...)", self.expression.root
            )
        return self


@dataclass
class _Found:
    """A part while it is bound. `unit` is None where it takes any; `literal` is a number that was typed."""

    part: Part
    width: int = 0
    unit: str | None = None
    logical: bool = False
    literal: bool = False
    labels: Mapping[int, str] = field(default_factory=dict)


def bind(expression: Expression | str, catalogue: Catalogue) -> BoundExpression:
    """Return an expression bound to these elements. Raises ExpressionError with the place, and the nearest names."""
    if isinstance(expression, str):
        expression = parse(expression)
    effort = _Effort()
    try:
        found = _Binder(expression, catalogue, effort).bind(expression.root, parts=True)
    except _TooMuchError as error:
        raise expression.error(f"{error}: derive less from one another, or of fewer values", expression.root) from None
    except RecursionError:
        text = "with the derived signals in it this is nested too deeply"
        raise expression.error(text, expression.root) from None
    columns = tuple(dict.fromkeys(columns_of(found.part)))
    dividers = {column.source: catalogue.elements[column.element].divider for column in columns}
    dividers.pop(OFF, None)
    if not columns:
        raise expression.error("this names no signal, so it never changes", expression.root)
    return BoundExpression(
        expression, found.part, found.width, found.unit or "-", found.logical, found.labels, columns,
        dict(sorted(dividers.items())), effort.kept_s,
    )  # fmt: skip


class _TooMuchError(Exception):
    """An expression that takes more than anybody could compute beside a robot."""


@dataclass
class _Effort:
    """What an expression takes, counted as it is bound: one that names a derived signal twice computes it twice."""

    operations: int = 0
    values: int = 0
    kept_s: float = 0.0

    def add(self, found: _Found) -> None:
        """Take in a part. Raises _TooMuchError."""
        self.operations += 1
        self.values += max(1, found.width)
        for count, most, what in (
            (self.operations, MOST_OPERATIONS, "operations"), (self.values, MOST_VALUES, "values of a row"),
        ):  # fmt: skip
            if count > most:
                raise _TooMuchError(f"with the derived signals in it this takes more than {most:,} {what}")

    def keep(self, seconds: float) -> None:
        """Take in what a window remembers. Raises _TooMuchError."""
        self.kept_s += seconds
        if self.kept_s > MOST_KEPT_S:
            raise _TooMuchError(
                f"its windows remember more than {MOST_KEPT_S:,.0f} s of values (seconds times values of a vector)"
            )


def parts_in(part: Part) -> Iterator[Part]:
    """Yield a part and all that it is made of, outer ones first."""
    yield part
    for one in part.parts if isinstance(part, Computed) else (part.part,) if isinstance(part, Remembered) else ():
        yield from parts_in(one)


def columns_of(part: Part) -> list[ScalarPlace]:
    """Return all scalars that a part depends on."""
    return [column for one in parts_in(part) if isinstance(one, BoundSignal) for column in one.columns]


def means_else(before: Sequence[BoundExpression], again: Callable[[], Sequence[BoundExpression]]) -> bool:
    """Whether words that are bound `again` compute something else than before, or can't be bound any more."""
    try:
        now = again()
    except ElementError:
        return True
    return [meaning(bound) for bound in now] != [meaning(bound) for bound in before]


def meaning(bound: BoundExpression, named: Callable[[ScalarPlace], object] = lambda place: place) -> object:
    """Return what expressions have in common that compute the same, whatever words they are written in.

    Those of two catalogues may be compared by what a scalar is called there.
    """

    def of(part: Part) -> object:
        if isinstance(part, Computed):
            return part.operator, tuple(of(one) for one in part.parts)
        if isinstance(part, Remembered):
            return part.function, part.window_ns, of(part.part)
        if isinstance(part, BoundSignal):
            return part.vector, tuple(named(column) for column in part.columns)
        return part

    return of(bound.root)


class _Binder:
    """Binds one expression, from its leaves to its root."""

    def __init__(self, expression: Expression, catalogue: Catalogue, effort: _Effort, depth: int = 0) -> None:
        self._expression, self._error = expression, expression.error
        self._catalogue, self._effort, self._depth = catalogue, effort, depth
        if depth > MOST_DEPTH:
            raise _TooMuchError(f"more than {MOST_DEPTH} derived signals stand on one another in this")

    def bind(self, node: Node, *, parts: bool = False) -> _Found:
        """`parts`: of complex numbers their real and imaginary parts will do, each by itself."""
        found = self._bound(node, parts=parts)
        self._effort.add(found)
        return found

    def _bound(self, node: Node, *, parts: bool) -> _Found:
        if not parts:
            self._refuse_complex(node)
        if isinstance(node, Number):
            return _Found(Constant(node.value, node.whole), unit=node.unit or None, literal=True)
        if isinstance(node, Name):
            return self._name(node)
        if isinstance(node, ComparisonChain):
            return self._comparison(node)
        if isinstance(node, Operation):
            return self._operation(node)
        return self._call(node)

    # --------------------------------------------------------------------------------------------------- names

    def _name(self, node: Name, labels: Mapping[int, str] | None = None) -> _Found:
        found = self._catalogue.find(node.text)
        if not found and (derived := self._catalogue.before(node.text)) is not None:
            one, catalogue = derived
            inner = parse(one.expression)
            part = _Binder(inner, catalogue, self._effort, self._depth + 1).bind(inner.root, parts=True)
            return replace(part, unit=one.unit if one.unit not in ("", "-") else part.unit)
        pattern = is_glob(node.text)
        bare = re.sub(r"\[(\d+)\]$", r"_\1", node.text)
        if not found or (bare != node.text and self._catalogue.find(bare) == found):  # brackets are those of patterns
            raise self._error(self._unknown(node, labels or {}), node)
        if len(found) > 1 and not pattern:
            names = [self._catalogue.name(*place) for place in found]
            raise self._error(f"'{node.text}' may be {and_more(names, 3)}: write more of the name", node)
        columns = []
        for place, entry in found:
            element = self._catalogue.elements[place]
            numbers = range(len(element.entries)) if entry is None else (entry,)
            for number in numbers:
                if np.dtype(element.entries[number].dtype).kind not in _NUMERIC:
                    name, dtype = self._catalogue.name(place, entry), np.dtype(element.entries[number].dtype)
                    short = name.removeprefix(f"{self._catalogue.prefix.rstrip('/')}/")
                    way_out = f"; in Python log['{short}'] == 'word' compares it" if dtype.kind in "SU" else ""
                    raise self._error(f"'{name}' is no number ({element.entries[number].dtype}){way_out}", node)
                if self._catalogue.unit(place, number) is None:
                    words = f"'{self._catalogue.name(place, entry)}' counts what has no unit here"
                    raise self._error(f"{words} ({element.entries[number].dtype}): log it as m8[ms] or M8[ms]", node)
            columns += [ScalarPlace(place, number, element.source) for number in numbers]
        if not 1 <= len(columns) <= MOST_WIDTH:
            raise self._error(f"'{node.text}' has {len(columns)} values; 1 to {MOST_WIDTH} go together", node)
        entries = [self._catalogue.elements[column.element].entries[column.entry] for column in columns]
        given = {self._catalogue.unit(column.element, column.entry) for column in columns}
        unit = given.pop() if len(given) == 1 else ""
        vector = pattern or len(columns) > 1
        same = all(entry.labels == entries[0].labels for entry in entries)
        return _Found(
            BoundSignal(tuple(columns), vector), len(columns) if vector else 0, None if unit in ("", "-") else unit,
            np.dtype(entries[0].dtype).kind == "b", labels=(entries[0].labels or {}) if same else {},
        )  # fmt: skip

    def _complex(self, node: Node) -> Known | None:
        """The complex element that something has as many parts as, and is calculated of part by part; else None."""
        if isinstance(node, Name):
            found = self._catalogue.find(node.text)
            known = self._catalogue.elements[found[0][0]] if len(found) == 1 and found[0][1] is None else None
            return known if known is not None and in_parts(known.kind, None, known.entries) else None
        if isinstance(node, Call):
            return self._complex(node.arguments[0]) if node.function in _BY_PARTS[1:] else None
        if isinstance(node, Operation) and self._is_linear(node):
            return next(filter(None, map(self._complex, node.operands)))
        return None

    def _is_linear(self, node: Operation) -> bool:
        """Whether an operation with complex numbers is one with each of their parts."""
        found = [self._complex(one) is not None for one in node.operands]
        factor = [isinstance(one, Number) for one in node.operands]
        if node.operator in ("*", "/"):
            return (found[0] and factor[1]) or (node.operator == "*" and factor[0] and found[1])
        return node.operator in ("neg", "+", "-") and all(found)

    def _refuse_complex(self, node: Node) -> None:
        known = self._complex(node)
        if known is not None:
            short = known.name.removeprefix(f"{self._catalogue.prefix.rstrip('/')}/")
            norm = f"; norm({short}) is its magnitude" if len(known.entries) == 2 else ""
            part = short + known.entries[0].suffix
            raise self._error(f"'{short}' is complex, which has no place here: name its parts, as {part}{norm}", node)

    def _unknown(self, node: Name, labels: Mapping[int, str]) -> str:
        text = node.text
        if "[" in text and (bare := re.sub(r"\[(\d+)\]", r"_\1", text)) != text:
            return f"no signal matches '{text}'; {self._scalar_words(text, bare)}"
        if close := nearest(text, labels.values()):
            return f"there is no label '{text}'{did_you_mean(close)}"
        if labels and "/" not in text:
            return f"'{text}' is neither a label ({', '.join(list(labels.values())[:8])}) nor a signal"
        if "/" in text.strip("/") and all(self._catalogue.find(part) for part in text.split("/", 1)):
            return f"no signal '{text}'; a division has blanks on both sides: {text.replace('/', ' / ', 1)}"
        hint = did_you_mean(
            map(written, self._catalogue.near(text)), there_are(len(self._catalogue.elements), "element")
        )
        matches = "matches" if is_glob(text) else "is named"
        return f"no signal {matches} '{text}'{hint}"

    def _scalar_words(self, text: str, bare: str) -> str:
        """Tell what the scalar of an array is named that somebody wrote with an index."""
        head, _, rest = text.partition("[")
        found = self._catalogue.find(head)
        if self._catalogue.find(bare) or len(found) != 1 or found[0][1] is not None:
            return f"one scalar of an array is named '{bare}'"
        names = [f"{head}{entry.suffix}" for entry in self._catalogue.elements[found[0][0]].entries]
        index = rest.removesuffix("]")
        if index.isdecimal() and int(index) < len(names):
            return f"that scalar of it is named '{names[int(index)]}'"
        return f"'{head}' has {and_more(names, 4)}"

    # ---------------------------------------------------------------------------------------------- operations

    def _comparison(self, node: ComparisonChain) -> _Found:
        found: list[_Found | None] = [None if isinstance(one, Name) else self.bind(one) for one in node.operands]
        # labels last: which are meant tells what they are compared with
        for at, one in enumerate(node.operands):
            if isinstance(one, Name) and (self._catalogue.find(one.text) or self._catalogue.before(one.text)):
                self._refuse_complex(one)
                found[at] = self._name(one)
        sides: list[_Found] = []
        for at, one in enumerate(node.operands):
            beside = [
                side.labels for place in (at - 1, at + 1) if 0 <= place < len(found) and (side := found[place])
            ]  # fmt: skip
            labels = next((names for names in beside if names), {})
            value = next((number for number, label in labels.items() if isinstance(one, Name) and label == one.text),
                         None)  # fmt: skip
            known = found[at]
            if value is not None:
                sides.append(_Found(Constant(float(value), int(value)), literal=True))
            elif known is None:
                assert isinstance(one, Name)
                sides.append(self._name(one, labels))
            else:
                sides.append(known)
        sides = self._in_one_unit(sides, node.operands)
        width = self._width(sides, node)
        pairs = tuple(
            Computed(operator, (sides[at].part, sides[at + 1].part)) for at, operator in enumerate(node.operators)
        )
        return _Found(pairs[0] if len(pairs) == 1 else Computed("and", pairs), width, logical=True)

    def _operation(self, node: Operation) -> _Found:
        operator = node.operator
        sides = [self.bind(one, parts=self._is_linear(node)) for one in node.operands]
        if operator == "neg":
            inner = sides[0]
            if isinstance(inner.part, Constant):
                whole = inner.part.whole
                return replace(inner, part=Constant(-inner.part.value, None if whole is None else -whole))
            return replace(inner, part=Computed(operator, (inner.part,)), logical=False, labels={})
        width = self._width(sides, node)
        if operator in ("and", "or", "not"):
            return _Found(Computed(operator, tuple(side.part for side in sides)), width, logical=True)
        unit = None
        if operator in "+-%":
            sides = self._in_one_unit(sides, node.operands)
            unit = next((side.unit for side in sides if side.unit), None)
        elif operator in "*/":
            left, right = (side.unit or "-" for side in sides)
            unit = units.product(left, right) if operator == "*" else units.quotient(left, right)
        elif sides[0].unit and isinstance(sides[1].part, Constant):
            unit = units.power(sides[0].unit, sides[1].part.value)
        parts = tuple(side.part for side in sides)
        if operator in "/%" and columns_of(parts[0]) and not columns_of(parts[1]) and _constant(parts[1]) == 0:
            raise self._error("this divides by 0, which gives no number at any time", node)
        literal = all(side.literal for side in sides)
        return _Found(Computed(operator, parts), width, None if unit in (None, "-") else unit, literal=literal)

    def _width(self, sides: Sequence[_Found], node: Node) -> int:
        widths = sorted({side.width for side in sides if side.width})
        if len(widths) > 1:
            raise self._error(f"vectors of {' and '.join(map(str, widths))} values don't go together", node)
        return widths[0] if widths else 0

    def _in_one_unit(self, sides: Sequence[_Found], nodes: Sequence[Node], wanted: str = "") -> list[_Found]:
        """The sides in the unit wanted, or that of the first that is no literal; else literals are in SI units."""
        unit = wanted or next((side.unit for side in sides if side.unit and not side.literal), None)
        made = []
        for side, node in zip(sides, nodes, strict=True):
            if not side.unit or side.unit == unit:
                made.append(side)
                continue
            factor = units.factor(side.unit, unit) if unit else units.size(side.unit)
            if factor is None:
                wanted = f"doesn't go with '{unit}'" if unit else "isn't known"
                raise self._error(f"the unit '{side.unit}' {wanted}; leave it out, or multiply by one (x * 1s)", node)
            scaled: Part = Computed("*", (side.part, Constant(factor))) if factor != 1 else side.part
            if isinstance(side.part, Constant):
                scaled = Constant(side.part.value * factor)
            made.append(replace(side, part=scaled, unit=unit, labels={}))
        return made

    # ----------------------------------------------------------------------------------------------- functions

    def _call(self, node: Call) -> _Found:
        name = node.function
        sides = [self.bind(one, parts=name in _BY_PARTS) for one in node.arguments]
        timed = len(sides) > 1 and _is_time(node.arguments[-1])
        if name in ("mean", "std") or (name in _OVER_TIME and timed and len(sides) == 2):
            return self._window(node, sides)
        if timed and name in (*_OF_TRUTHS, "sum", "norm"):
            time = node.arguments[-1]
            takes, over = ("no time", "max") if name == "norm" else ("one value beside a time", name)
            words = f"{over}({name}(...), {self._expression.text[time.at : time.end]})"
            raise self._error(f"{name} takes {takes}: write {words}", time)
        first, rule = sides[0], FUNCTIONS[name].rule
        if name in _STEPS:
            part = Remembered(name, first.part, 0, _sources_of(self._columns(first.part, node)))
            keeps = name == "prev"
            labels = first.labels if keeps else {}
            return _Found(part, first.width, _unit(rule, sides), keeps and first.logical, labels=labels)
        if name in ("any", "all", "isnan"):
            gathered, width = (self._gathered(sides, node), 0) if name != "isnan" else ((first.part,), first.width)
            return _Found(Computed(name, gathered), width, logical=True)
        if name in ("norm", "sum") or (name in ("min", "max") and len(sides) == 1):
            sides = self._in_one_unit(sides, node.arguments)
            return _Found(Computed(f"{name}_of", self._gathered(sides, node)), 0, _unit(rule, sides))
        width = self._width(sides, node)
        if rule.takes and first.unit:
            sides = [self._plain(first, name, rule.takes, node.arguments[0]), *sides[1:]]
        if rule.takes or len(sides) > 1:
            sides = self._in_one_unit(sides, node.arguments, rule.takes)
        return _Found(Computed(name, tuple(side.part for side in sides)), width, _unit(rule, sides))

    def _plain(self, side: _Found, name: str, takes: str, node: Node) -> _Found:
        """What a function of numbers or angles is given: of what has a unit that is none, a number where it can be."""
        unit = side.unit or "-"
        factor = units.factor(unit, takes)
        if factor is None and "cycle" not in unit and units.factor(unit, "Hz*s") is not None:
            return replace(self._in_one_unit([side], [node], "Hz*s")[0], unit=None)  # 2 pi f t
        if factor is None:
            divided = f"divide it by 1{unit}, or " if UNIT.fullmatch(unit) else ""
            raise self._error(
                f"{name} takes numbers or angles, and this is in '{unit}': {divided}derive a signal of it with "
                f"unit='{takes}'",
                node,
            )
        if factor != 1 and _is_scaled(side.part, factor):
            raise self._error(
                f"this is an angle in '{unit}', which {name} converts by itself, times {factor:.5g}: it would be "
                f"converted twice; leave the factor out, {name}(x)",
                node,
            )
        return side

    def _gathered(self, sides: Sequence[_Found], node: Call) -> tuple[Part, ...]:
        if len(sides) == 1 and not sides[0].width:
            raise self._error(f"{node.function} takes a vector, a pattern or several values; this is one", node)
        return tuple(side.part for side in sides)

    def _window(self, node: Call, sides: Sequence[_Found]) -> _Found:
        duration = node.arguments[1]
        if not _is_time(duration):
            raise self._error(f"the time of a window is missing its unit: {node.function}(x, 50ms)", duration)
        assert isinstance(duration, Number)
        seconds = duration.value * (units.factor(duration.unit, "s") or 0.0)
        if not 1e-9 <= seconds <= MOST_WINDOW_S:
            raise self._error(f"a window is above 0 and at most {MOST_WINDOW_S:g} s long", duration)
        inner, part, logical = sides[0], sides[0].part, node.function in _OF_TRUTHS
        if logical and not inner.logical:
            part = Computed("!=", (part, Constant(0.0)))
        function = _OF_TRUTHS.get(node.function, node.function)
        columns = self._columns(part, node)
        divider = min(self._catalogue.elements[column.element].divider for column in columns)
        self._effort.keep(seconds * max(1, inner.width) / divider)
        part = Remembered(function, part, round(seconds * 1e9), _sources_of(columns))
        return _Found(part, inner.width, None if logical else inner.unit, logical)

    def _columns(self, part: Part, node: Node) -> list[ScalarPlace]:
        columns = columns_of(part)
        if not columns:
            raise self._error("this names no signal, so it never changes", node)
        return columns


def _sources_of(columns: Iterable[ScalarPlace]) -> tuple[int, ...]:
    return tuple(sorted({column.source for column in columns}))


def _unit(rule: UnitRule, sides: Sequence[_Found]) -> str | None:
    unit = rule.of(next((side.unit for side in sides if side.unit), "-"))
    return None if unit == "-" else unit


def _is_scaled(part: Part, factor: float) -> bool:
    """Whether somebody multiplied by about this factor, in one of the terms of a sum."""
    if isinstance(part, Computed) and part.operator in ("+", "-", "neg", "abs"):
        return any(_is_scaled(one, factor) for one in part.parts)
    return not isinstance(part, Constant) and math.isclose(abs(_constant(part)), factor, rel_tol=1e-3)


def _constant(part: Part) -> float:
    """By which number a product is multiplied."""
    if isinstance(part, Constant):
        return part.value
    if not isinstance(part, Computed) or part.operator not in ("*", "/", "neg"):
        return 1.0
    first, *others = map(_constant, part.parts)
    for other in others:
        first = first * other if part.operator == "*" else first / other if other else math.inf
    return first


def _is_time(node: Node) -> bool:
    return isinstance(node, Number) and bool(node.unit) and units.factor(node.unit, "s") is not None
