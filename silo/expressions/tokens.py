"""Words of an expression: which letters are a name, a number with its unit, an operator.

A name holds `/`, so a division has blanks around it; it may hold wildcards, so where `*` multiplies is decided here
too. The result is text of the same length that Python's own parser reads, with what stood at each place.
"""

import keyword
import re
from dataclasses import dataclass

from silo.core.arguments import shown
from silo.errors import ExpressionError

MOST_CHARACTERS = 500

_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_UNIT = re.compile(r"[A-Za-zµμΩ°][A-Za-z0-9µμΩ°]*(?:/[A-Za-zµμΩ°][A-Za-z0-9]*)*")
_OPERATOR = re.compile(r"\*\*|[<>=!]=|[-+*/%<>(),]")
_LETTER = re.compile(r"[^\W\d]|[_/]")
_CLASS = re.compile(r"\[[^\[\]\s]{1,50}\]")
_LOGIC = ("and", "or", "not")
_INSTEAD = {"&": "and", "&&": "and", "|": "or", "||": "or", "!": "not", "=": "=="}


@dataclass(frozen=True)
class Tokens:
    """An expression as text that Python's parser reads, of the same length, and by place the names and units in it."""

    text: str
    python: str
    names: dict[int, str]
    units: dict[int, str]


def tokens(text: str) -> Tokens:
    """Return the words of an expression. Raises ExpressionError with the place."""
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
        self._units: dict[int, str] = {}
        self._before = ""  # what came before: "" or an operator where an operand is awaited, else "number", "name", ")"

    def run(self) -> Tokens:
        """Return all words."""
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
        divides = letter == "/" and (self._blank_follows(at) or self._before in ("number", ")"))
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
        raise self._error(f"'{letter}' has no place in an expression{hint}", at, at + 1)

    def _blank_follows(self, at: int) -> bool:
        return at + 1 >= len(self._text) or self._text[at + 1].isspace()

    def _number(self, at: int, end: int) -> int:
        unit = _UNIT.match(self._text, end)
        if unit:
            self._units[at] = unit[0]
            self._python[end : unit.end()] = " " * (unit.end() - end)
            end = unit.end()
        self._before = "number"
        return end

    def _word(self, at: int) -> int:
        text, end = self._text, at
        while end < len(text) and (length := self._part(at, end)):
            end += length
        word = text[at:end]
        if word in _LOGIC:
            self._before = word
            return end
        if len(word) > 1 and word.endswith("/") and text[end : end + 1] != "(":
            raise self._error("a division has blanks on both sides: a / b", end - 1, end)
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
