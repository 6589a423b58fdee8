"""Expressions as trees: what may stand in one, read by Python's `ast` through an allowlist of our own.

Names, numbers with units, comparison chains, `and or not`, `+ - * / % **`, the functions of `FUNCTIONS`. Everything
else that Python knows (attributes, subscripts, keywords, lambdas, strings) is refused with its place. A tree knows no
signals yet: `silo.expressions.binding` looks names up.
"""

import ast
import keyword
import math
import os
import re
import threading
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from silo.core.arguments import shown
from silo.core.names import did_you_mean, nearest
from silo.errors import ExpressionError
from silo.expressions.operations import FUNCTIONS, Function

MOST_CHARACTERS = 500

_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
UNIT = re.compile(r"[A-Za-zµμΩ°][A-Za-z0-9µμΩ°]*(?:/[A-Za-zµμΩ°][A-Za-z0-9]*)*")
_UNIT_BEHIND = re.compile(rf" *({UNIT.pattern})(?![\w(])")  # nothing but a unit, or `and`, can follow a number's blank
_OPERATOR = re.compile(r"\*\*|[<>=!]=|[-+*/%<>(),]")
_LETTER = re.compile(r"[^\W\d]|[_/]")
_CLASS = re.compile(r"\[[^\[\]\s]{1,50}\]")
_BARE = re.compile(r"(?!\d)[\w/]+")
LOGIC = ("and", "or", "not")
_INSTEAD = {"&": "and", "&&": "and", "|": "or", "||": "or", "!": "not", "=": "=="}

MOST_NODES = 200

_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.Pow: "**"}
_COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_UNARY = {ast.USub: "neg", ast.Not: "not", ast.UAdd: ""}
_LOGICAL = {ast.And: "and", ast.Or: "or"}
_UNFINISHED = "something is missing at the end"
_CONSTANTS = {"true": 1.0, "false": 0.0}

_WORDS: dict[type[ast.expr], str] = {ast.Tuple: "a list"}


def written(name: str) -> str:
    """Return how a name stands in an expression: in backticks where a part of it would be an operator, or a number."""
    return name if _BARE.fullmatch(name) else f"`{name}`"


@dataclass(frozen=True)
class Tokens:
    """An expression as text that Python's parser reads, of the same length, and by place the names and units in it."""

    text: str
    python: str
    names: dict[int, str]
    units: dict[int, tuple[str, int]]  # with the place at which it ends


def tokens(text: str) -> Tokens:
    """Return the words of an expression: names, numbers with units, operators. Raises ExpressionError with the place.

    A name holds `/`, so a division has blanks around it; it may hold wildcards, so where `*` multiplies is decided here
    too.
    """
    if len(text) > MOST_CHARACTERS:
        shortened = f"{text[:60]}..."
        raise ExpressionError(
            f"an expression has at most {MOST_CHARACTERS} characters, got {len(text)}; derive a signal for a part",
            shortened if shortened.isprintable() else shown(shortened),
            0,
            1,
        )
    if not text.isprintable():
        raise ExpressionError("an expression is one line of printable characters", shown(text), 0, 1)
    if not text.strip():
        raise ExpressionError("an expression is missing; write abs(joints/tau_3) > 20", text, 0, 1)
    return _Tokenizer(text).run()


class _Tokenizer:
    """Goes through one text from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._python = list(text)
        self._names: dict[int, str] = {}
        self._units: dict[int, tuple[str, int]] = {}
        self._before = ""  # what came before: "" or an operator where an operand is awaited, else "number", "name", ")"

    def run(self) -> Tokens:
        at = 0
        while at < len(self._text):
            at = at + 1 if self._text[at].isspace() else self._next(at)
        return Tokens(self._text, "".join(self._python), self._names, self._units)

    def _next(self, at: int) -> int:
        text, awaited = self._text, self._before not in ("number", "name", ")")
        letter = text[at]
        if letter == "`":
            end = text.find("`", at + 1)
            if end <= at + 1:
                raise self._error("a name in backticks ends with a backtick", at, len(text))
            return self._name(at, end + 1, text[at + 1 : end])
        number = _NUMBER.match(text, at)
        if number:
            return self._number(at, number.end())
        wildcard = letter in "?[" or (letter == "*" and awaited and not text.startswith("**", at))
        divides = letter == "/" and (not text[at + 1 : at + 2].strip() or self._before in ("number", ")"))
        if letter == "/" and not divides and not awaited:
            raise self._error("a division has blanks on both sides: a / b", at, at + 1)
        if ((_LETTER.match(text, at) and not divides) or wildcard) and self._part(at, at):
            return self._word(at)
        operator = _OPERATOR.match(text, at)
        if operator:
            self._before = operator[0]
            return operator.end()
        instead = _INSTEAD.get(text[at : at + 2]) or _INSTEAD.get(letter)
        hint = f"; write '{instead}'" if instead else ""
        if letter in "'\"":
            hint = f"; the words of enumerations stand without: {text[at:].split(letter)[1] or 'STANCE'}"
        shown_as = "a quotation mark" if letter in "'\"" else f"'{letter}'"
        raise self._error(f"{shown_as} has no place in an expression{hint}", at, at + 1)

    def _number(self, at: int, end: int) -> int:
        unit = _UNIT_BEHIND.match(self._text, end)
        if unit and not (unit[1] in LOGIC and unit.start(1) > end):
            self._units[at] = unit[1], unit.end()
            self._python[end : unit.end()] = " " * (unit.end() - end)
            end = unit.end()
        self._before = "number"
        return end

    def _word(self, at: int) -> int:
        text, end = self._text, at
        while end < len(text) and (length := self._part(at, end)):
            end += length
        word = text[at:end]
        if word in LOGIC:
            self._before = word
            return end
        if len(word) > 1 and word.endswith("/") and text[end : end + 1] != "(":
            begun = "the name goes on behind it, or " if not text[end:].strip() else ""  # as it is while one types
            raise self._error(f"{begun}a division has blanks on both sides: a / b", end - 1, end)
        return self._name(at, end, word)

    def _part(self, start: int, at: int) -> int:
        """How many letters at this place go on with the word that starts there, 0 where it ends."""
        text = self._text
        letter, follows = text[at], text[at + 1 : at + 2]
        if letter.isalnum() or letter in "_/?":
            return 1
        if letter == "[":
            found = _CLASS.match(text, at)
            return len(found[0]) if found else 0
        if letter == ".":
            return int(at > start and (follows.isalnum() or follows == "_"))
        if letter != "*" or follows == "*":
            return 0
        # between two factors it multiplies: beside a part of a name, or where no factor stands, it is a wildcard
        touches = at == start or text[at - 1] in "/_" or follows in ("/", "_")
        return int(touches or text[at + 1 :].lstrip()[:1] in ("", ")", ","))

    def _name(self, at: int, end: int, name: str) -> int:
        self._names[at] = name
        word = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in self._text[at:end])
        if keyword.iskeyword(word) or word[0].isdigit():
            word = f"_{word[1:]}"
        self._python[at:end] = word
        self._before = "name"
        return end

    def _error(self, reason: str, at: int, end: int) -> ExpressionError:
        return ExpressionError(reason, self._text, at, end)


@dataclass(frozen=True)
class Number:
    """A number as it was typed, with its unit; `whole` is what a float64 may not hold to the last digit."""

    value: float
    unit: str
    at: int
    end: int
    whole: int | None = None


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


def nodes_in(node: Node) -> Iterator[Node]:
    """Yield a node and all that it is made of, in the order of the text, outer ones first."""
    yield node
    if not isinstance(node, Number | Name):
        for part in node.arguments if isinstance(node, Call) else node.operands:
            yield from nodes_in(part)


def names_in(node: Node) -> list[str]:
    """Return every name and pattern in an expression, in its order."""
    return [one.text for one in nodes_in(node) if isinstance(one, Name)]


@dataclass(frozen=True)
class Expression:
    """What somebody wrote, and what it means."""

    text: str
    root: Node

    def error(self, reason: str, node: Node) -> ExpressionError:
        """Return an error that points at a part of it."""
        return ExpressionError(reason, self.text, node.at, node.end)


_locks = [threading.RLock()]  # one


def _renew() -> None:
    _locks[0] = threading.RLock()


os.register_at_fork(after_in_child=_renew)  # another thread of the parent may have held it


def _tree(python: str) -> ast.Expression:
    """Return what Python reads, one after the other, whichever threads ask.

    Python 3.11 counts how deep it is in a tree for all threads together, and ends with SystemError where they take
    turns in it; and what warnings are left out is put back for all of them.
    """
    with _locks[0], warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # of `1 (2)`: refused in our words
        return ast.parse(python, mode="eval")


def parse(text: str, functions: Mapping[str, Function] = FUNCTIONS) -> Expression:
    """Return an expression as a tree, with these functions. Raises ExpressionError with the place."""
    found = tokens(text)
    try:
        tree = _tree(found.python.strip())
    except SyntaxError as error:
        skipped = len(found.python) - len(found.python.lstrip())
        why = _why(error, found)
        at = skipped + max((error.offset or 1) - 1, 0) if why is not _UNFINISHED else len(text.rstrip())
        end = skipped + (error.end_offset or 0) - 1
        raise ExpressionError(why, text, min(at, len(text.rstrip())), end) from None
    except (RecursionError, MemoryError, ValueError):
        raise ExpressionError("the expression is nested too deeply", text, 0, len(text)) from None
    return Expression(text, _Reader(found, functions).node(tree.body))


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

    def __init__(self, found: Tokens, functions: Mapping[str, Function]) -> None:
        self._found, self._functions = found, functions
        self._skipped = len(found.python) - len(found.python.lstrip())
        self._nodes = 0

    def _span(self, node: ast.expr) -> tuple[int, int]:
        return self._skipped + node.col_offset, self._skipped + (node.end_col_offset or node.col_offset + 1)

    def _error(self, reason: str, node: ast.expr) -> ExpressionError:
        return ExpressionError(reason, self._found.text, *self._span(node))

    def node(self, node: ast.expr) -> Node:
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
            return Operation(_BINARY[type(node.op)], (self.node(node.left), self.node(node.right)), at, end)
        if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            inner = self.node(node.operand)
            return Operation(operator, (inner,), at, end) if (operator := _UNARY[type(node.op)]) else inner
        if isinstance(node, ast.BoolOp):
            return Operation(_LOGICAL[type(node.op)], tuple(map(self.node, node.values)), at, end)
        if isinstance(node, ast.Compare) and all(type(op) in _COMPARED for op in node.ops):
            operators = tuple(_COMPARED[type(op)] for op in node.ops)
            return ComparisonChain(operators, tuple(map(self.node, (node.left, *node.comparators))), at, end)
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self._error(f"{_WORDS.get(type(node), 'this')} has no place in an expression", node)

    def _number(self, node: ast.Constant) -> Number:
        at, end = self._span(node)
        value = float(node.value) if isinstance(node.value, int | float) else math.nan
        if not math.isfinite(value):
            raise self._error("this is no number that a float64 can hold", node)
        unit, end = self._found.units.get(at, ("", end))
        whole = node.value if isinstance(node.value, int) else None
        return Number(value, unit, at, end, whole)

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
        fewest, most, *_ = self._functions[name]
        if not fewest <= len(node.args) <= most:
            wanted = f"{fewest}" if fewest == most else f"{fewest} to {most}"
            example = f", as in {name}(x, 50ms)" if name in ("mean", "std") else ""
            raise self._error(
                f"{name} takes {wanted} argument{'s' if most > 1 else ''}{example}, got {len(node.args)}", node
            )
        return Call(name, tuple(map(self.node, node.args)), at, end)
