"""The filter language: words, name globs and `field:value` terms, all of which must hold.

    torque LF              both words somewhere in the name (any case)
    /log/*/q  joint?_tau   globs: on the whole name when they begin with `/`, else on its end
    "two words"  -word     quoted; not
    unit:Nm on:no div>1 size>=1000 act:publish buf:loop kind:vector type:f4
    dirty marked conflict live

`parse` never raises: a term that can't be understood is reported and left out.
"""

import fnmatch
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from silo_tui.model.fields import Field, synonym
from silo_tui.model.table import Mask, TableState

_TERM = re.compile(r'(-?)(?:([A-Za-z]+)(>=|<=|!=|>|<|=|:))?("[^"]*"?|\S+)')
_UNFINISHED = re.compile(r"-?(?:[A-Za-z]+(?:>=|<=|!=|>|<|=|:))?$")
_COMPARE: dict[str, Callable[[Any, Any], Any]] = {
    ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le, "=": operator.eq, ":": operator.eq,
    "!=": operator.ne,
}  # fmt: skip
_NUMBERS = {"div": Field.DIVIDER, "divider": Field.DIVIDER, "size": Field.BUFFER_SIZE}
_FLAGS = ("dirty", "pending", "marked", "conflict", "live")
TERM_NAMES = ("unit:", "on:", "div>", "size>", "act:", "buf:", "kind:", "type:", "desc:", "-", *_FLAGS)

Test = Callable[[TableState, Mask], Mask]


@dataclass(frozen=True)
class Filter:
    """A parsed filter: `problems` says which terms were left out and why."""

    text: str
    tests: tuple[Test, ...]
    problems: tuple[str, ...]

    def mask(self, table: TableState, marked: Mask) -> Mask:
        """Shape `(n,)`: the elements that pass every term."""
        result = np.ones(len(table), np.bool_)
        for test in self.tests:
            result &= test(table, marked)
        return result


def parse(text: str) -> Filter:
    """Reads a filter; never raises."""
    tests: list[Test] = []
    problems: list[str] = []
    for match in _TERM.finditer(text):
        negated, key, sign = match[1] == "-", (match[2] or "").lower(), match[3] or ""
        value = (match[4] or "").strip('"')
        if not value or _UNFINISHED.match(match[0]):
            continue  # somebody is still typing
        test = _term(key, sign, value, match[4] or "") if key else _word(value, quoted=(match[4] or "").startswith('"'))
        if isinstance(test, str):
            problems.append(test)
        else:
            tests.append(_negate(test) if negated else test)
    return Filter(text, tuple(tests), tuple(problems))


def _negate(test: Test) -> Test:
    return lambda table, marked: ~test(table, marked)


def _word(word: str, *, quoted: bool) -> Test:
    if not quoted and word.lower() in _FLAGS:
        return _flag(word.lower())
    folded = word.casefold()
    if not quoted and any(char in word for char in "*?["):
        pattern = folded if folded.startswith("/") else "*" + folded
        compiled = re.compile(fnmatch.translate(pattern))
        return lambda table, marked: np.fromiter(
            (compiled.match(name) is not None for name in table.folded), np.bool_, len(table)
        )
    return lambda table, marked: np.fromiter((folded in name for name in table.folded), np.bool_, len(table))


def _flag(word: str) -> Test:
    if word == "marked":
        return lambda table, marked: marked.copy()
    if word == "conflict":
        return lambda table, marked: np.asarray(table.conflicts.any(axis=0))
    if word == "live":
        return lambda table, marked: table.live
    return lambda table, marked: np.asarray(table.pending.any(axis=0))


def _term(key: str, sign: str, value: str, raw: str) -> Test | str:
    if key in _NUMBERS:
        return _number(_NUMBERS[key], sign, value)
    if sign not in {":", "=", "!="}:
        return f"{key}{sign}{raw}: {sign} compares div and size only"
    test: Test | str
    if key == "on":
        test = _choice(Field.ENABLED, value, "on")
    elif key in {"act", "action"}:
        test = _action(value)
    elif key in {"buf", "buffer"}:
        test = _choice(Field.BUFFER_TYPE, value, "buf")
    elif key in {"unit", "kind", "type", "desc"}:
        test = _text(key, value)
    else:
        return f"{key}{sign} is no field; there are unit on div size act buf kind type desc"
    return _negate(test) if sign == "!=" and not isinstance(test, str) else test


def _number(field: Field, sign: str, value: str) -> Test | str:
    try:
        number = float(value)
    except ValueError:
        return f"{field.title}{sign}{value}: {value!r} is no number"
    compare = _COMPARE[sign]
    return lambda table, marked: np.asarray(compare(table.values[field], number), np.bool_)


def _terms(key: str, field: Field) -> list[str]:
    return [f"{key}:{word.cell}" for word in field.option.words]


def _choice(field: Field, value: str, key: str) -> Test | str:
    wanted = synonym(field, value)
    if wanted is None:
        return f"{value!r}: write {' or '.join(_terms(key, field))}"
    return lambda table, marked: np.equal(table.values[field], wanted)


def _action(value: str) -> Test | str:
    wanted = synonym(Field.ACTION, value)
    if wanted is None:
        return f"{value!r}: write act:save, act:publish or act:both"
    if value.lower() in {"both", "pub"} or "+" in value or "_" in value:
        return lambda table, marked: np.equal(table.values[Field.ACTION], wanted)
    # `act:publish` and `act:save` ask what an element does, so that those that do both pass too
    return lambda table, marked: np.isin(table.values[Field.ACTION], (wanted, 0))


def _text(key: str, value: str) -> Test:
    folded = value.casefold()

    def passes(table: TableState, marked: Mask) -> Mask:
        if key == "unit":
            found = (element.unit.casefold() == folded for element in table.elements)
        elif key == "kind":
            found = (element.kind.casefold().startswith(folded) for element in table.elements)
        elif key == "desc":
            found = (folded in element.description.casefold() for element in table.elements)
        else:
            found = (any(folded in entry.dtype.casefold() for entry in element.entries) for element in table.elements)
        return np.fromiter(found, np.bool_, len(table))

    return passes


def completions(text: str, units: list[str]) -> list[str]:
    """Terms that the last word of `text` may become."""
    start = text.rsplit(" ", 1)[-1]
    pool = [f"unit:{unit}" for unit in units] + ["on:yes", "on:no", "act:save", "act:publish", "act:both"]
    pool += [*_terms("buf", Field.BUFFER_TYPE), *TERM_NAMES]
    return [term for term in pool if start and term.startswith(start) and term != start]


__all__ = ["TERM_NAMES", "Filter", "completions", "parse"]
