"""Expressions as trees: what may stand in one, read by Python's `ast` through an allowlist of our own.

Names, numbers with units, comparison chains, `and or not`, `+ - * / % **`, the functions of `FUNCTIONS`. Everything
else that Python knows (attributes, subscripts, keywords, lambdas, strings) is refused with its place. A tree knows no
signals yet: `silo.expressions.binding` looks names up.
"""

import ast
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

from silo.core.names import did_you_mean, nearest
from silo.errors import ExpressionError
from silo.expressions.tokens import Tokens, tokens

__all__ = ["FUNCTIONS", "Call", "ComparisonChain", "Expression", "ExpressionError", "Name", "Node", "Number",
           "Operation",
           "parse"]  # fmt: skip

MOST_NODES = 200

# by name: the fewest and the most arguments, and what it gives, for help
FUNCTIONS = {
    "abs": (1, 1, "without its sign"),
    "min": (1, 20, "smallest of a vector or of several, or within a time: min(x, 50ms)"),
    "max": (1, 20, "largest of a vector or of several, or within a time: max(x, 50ms)"),
    "sqrt": (1, 1, "square root"),
    "sin": (1, 1, "sine, of radians"),
    "cos": (1, 1, "cosine, of radians"),
    "tan": (1, 1, "tangent, of radians"),
    "atan2": (2, 2, "angle of (y, x), in radians"),
    "hypot": (2, 2, "length of (x, y)"),
    "norm": (1, 20, "length of a vector"),
    "sum": (1, 20, "sum of a vector"),
    "any": (1, 20, "whether one of a vector is: any(legs/*/slip)"),
    "all": (1, 20, "whether each of a vector is"),
    "isnan": (1, 1, "whether it is no number"),
    "prev": (1, 1, "value of the sample before"),
    "diff": (1, 1, "difference to the sample before"),
    "rate": (1, 1, "the same per second"),
    "mean": (2, 2, "mean within a time: mean(x, 50ms)"),
    "std": (2, 2, "standard deviation within a time: std(x, 1s)"),
}


@dataclass(frozen=True)
class Number:
    """A number as it was typed, with its unit."""

    value: float
    unit: str
    at: int
    end: int


@dataclass(frozen=True)
class Name:
    """A name of an element, of a scalar of it or of a label, or a pattern for several."""

    text: str
    at: int
    end: int


@dataclass(frozen=True)
class Operation:
    """`+ - * / % ** and or` of two or more, `neg not` of one."""

    operator: str
    operands: tuple["Node", ...]
    at: int
    end: int


@dataclass(frozen=True)
class ComparisonChain:
    """A chain: `operands[i] operators[i] operands[i + 1]` for each i."""

    operators: tuple[str, ...]
    operands: tuple["Node", ...]
    at: int
    end: int


@dataclass(frozen=True)
class Call:
    """A function of `FUNCTIONS`."""

    function: str
    arguments: tuple["Node", ...]
    at: int
    end: int


Node = Number | Name | Operation | ComparisonChain | Call


def names_in(node: Node) -> list[str]:
    """Return every name and pattern in an expression, in its order."""
    if isinstance(node, Name):
        return [node.text]
    if isinstance(node, Number):
        return []
    return [name for part in (node.arguments if isinstance(node, Call) else node.operands) for name in names_in(part)]


@dataclass(frozen=True)
class Expression:
    """What somebody wrote, and what it means."""

    text: str
    root: Node

    def error(self, reason: str, node: Node) -> ExpressionError:
        """Return an error that points at a part of it."""
        return ExpressionError(reason, self.text, node.at, node.end)


_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.Pow: "**"}
_COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_UNFINISHED = "something is missing at the end"
_CONSTANTS = {"true": 1.0, "false": 0.0}


def parse(text: str, functions: Mapping[str, tuple[int, int, str]] = FUNCTIONS) -> Expression:
    """Return an expression as a tree, with these functions. Raises ExpressionError with the place."""
    found = tokens(text)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of `1 (2)`: refused below in our words
            tree = ast.parse(found.python.strip(), mode="eval")
    except SyntaxError as error:
        skipped = len(found.python) - len(found.python.lstrip())
        why = _why(error, found)
        at = skipped + max((error.offset or 1) - 1, 0) if why is not _UNFINISHED else len(text.rstrip())
        end = skipped + (error.end_offset or 0) - 1
        raise ExpressionError(why, text, min(at, len(text.rstrip())), end) from None
    except (RecursionError, MemoryError, ValueError):
        raise ExpressionError("the expression is nested too deeply", text, 0, len(text)) from None
    return _Reader(found, functions).read(tree)


def _why(error: SyntaxError, found: Tokens) -> str:
    said = error.msg.partition(". ")[0]
    if "never closed" in said or "unmatched" in said or "does not match" in said:
        return said
    if said.startswith("too many nested"):
        return "the expression is nested too deeply"
    end = found.text.rstrip()
    if (error.offset or 0) > len(found.python.strip()) or end.endswith((*"+-*/%<>=,", " and", " or", " not")):
        return _UNFINISHED
    return "this can't be understood: is an operator missing, or too much?"


class _Reader:
    """Makes our tree of Python's, and counts its nodes."""

    def __init__(self, found: Tokens, functions: Mapping[str, tuple[int, int, str]]) -> None:
        self._found, self._functions = found, functions
        self._skipped = len(found.python) - len(found.python.lstrip())
        self._nodes = 0

    def read(self, tree: ast.Expression) -> Expression:
        """Return the expression. Raises ExpressionError."""
        return Expression(self._found.text, self._node(tree.body))

    def _span(self, node: ast.expr) -> tuple[int, int]:
        return self._skipped + node.col_offset, self._skipped + (node.end_col_offset or node.col_offset + 1)

    def _error(self, reason: str, node: ast.expr) -> ExpressionError:
        return ExpressionError(reason, self._found.text, *self._span(node))

    def _node(self, node: ast.expr) -> Node:
        self._nodes += 1
        at, end = self._span(node)
        if self._nodes > MOST_NODES:
            raise self._error(f"an expression has at most {MOST_NODES} parts; derive a signal for some of them", node)
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.Name):
            name = self._found.names[at]
            constant = _CONSTANTS.get(name.lower())
            return Name(name, at, end) if constant is None else Number(constant, "", at, end)
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            return Operation(_BINARY[type(node.op)], (self._node(node.left), self._node(node.right)), at, end)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd | ast.Not):
            inner = self._node(node.operand)
            if isinstance(node.op, ast.UAdd):
                return inner
            return Operation("neg" if isinstance(node.op, ast.USub) else "not", (inner,), at, end)
        if isinstance(node, ast.BoolOp):
            operator = "and" if isinstance(node.op, ast.And) else "or"
            return Operation(operator, tuple(map(self._node, node.values)), at, end)
        if isinstance(node, ast.Compare) and all(type(op) in _COMPARED for op in node.ops):
            operators = tuple(_COMPARED[type(op)] for op in node.ops)
            return ComparisonChain(operators, tuple(map(self._node, (node.left, *node.comparators))), at, end)
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self._error(f"{_WORDS.get(type(node), 'this')} has no place in an expression", node)

    def _number(self, node: ast.Constant) -> Number:
        at, end = self._span(node)
        value = float(node.value) if isinstance(node.value, int | float) else math.nan
        if not math.isfinite(value):
            raise self._error("this is no number that a float64 can hold", node)
        unit = self._found.units.get(at, "")
        return Number(value, unit, at, end + len(unit))

    def _call(self, node: ast.Call) -> Call:
        at, end = self._span(node)
        name = self._found.names.get(at, "") if isinstance(node.func, ast.Name) else ""
        if name not in self._functions:
            hint = did_you_mean(nearest(name, self._functions), f"there are {', '.join(self._functions)}")
            raise self._error(
                f"there is no function '{name}'{hint}" if name else "only functions are called", node.func
            )
        if node.keywords:
            raise self._error("arguments have no names here", node)
        fewest, most, _ = self._functions[name]
        if not fewest <= len(node.args) <= most:
            wanted = f"{fewest}" if fewest == most else f"{fewest} to {most}"
            example = f", as in {name}(x, 50ms)" if name in ("mean", "std") else ""
            raise self._error(
                f"{name} takes {wanted} argument{'s' if most > 1 else ''}{example}, got {len(node.args)}", node
            )
        return Call(name, tuple(map(self._node, node.args)), at, end)


_WORDS: dict[type[ast.expr], str] = {ast.Tuple: "a list"}
