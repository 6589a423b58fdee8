"""The filter language: words, name globs and `field:value` terms, all of which must hold.

    torque LF              both words somewhere in the name (any case)
    /log/*/q  joint?_tau   globs: on the whole name when they begin with `/`, else on its end
    "two words"  -word     quoted; not
    unit:Nm on:no div>1 size>=1000 act:publish buf:loop kind:vector type:f4
    dirty marked conflict live

`parse` never raises: a term that can't be understood is reported and left out.
"""

import fnmatch
import re
from dataclasses import dataclass

import numpy as np

from silo_tui.model.table import Mask, TableState
from silo_tui.model.table_columns import LIVE_COLUMNS
from silo_tui.model.terms import OTHER_TERMS, Test, negate

_TERM = re.compile(r'(-?)(?:([A-Za-z]+)(>=|<=|!=|>|<|=|:))?("[^"]*"?|\S+)')
_UNFINISHED = re.compile(r"-?(?:[A-Za-z]+(?:>=|<=|!=|>|<|=|:))?$")
_FLAGS = ("dirty", "pending", "marked", "conflict", "live")
TERMS = (*(column.term for column in LIVE_COLUMNS if column.term is not None), *OTHER_TERMS)


@dataclass(frozen=True)
class Filter:
    """A parsed filter: `problems` says which terms were left out and why."""

    text: str
    tests: tuple[Test, ...]
    problems: tuple[str, ...]

    def mask(self, table: TableState, marked: Mask) -> Mask:
        """Return shape `(n,)`: the elements that pass every term."""
        result = np.ones(len(table), np.bool_)
        for test in self.tests:
            result &= test(table, marked)
        return result


def parse(text: str) -> Filter:
    """Read a filter; never raises."""
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
            tests.append(negate(test) if negated else test)
    return Filter(text, tuple(tests), tuple(problems))


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
    term = next((term for term in TERMS if key in term.names), None)
    comparing = " and ".join(each.names[0] for each in TERMS if each.compares)
    if sign not in {":", "=", "!="} and (term is None or not term.compares):
        return f"{key}{sign}{raw}: {sign} compares {comparing} only"
    if term is None:
        return f"{key}{sign} is no field; there are {' '.join(each.names[0] for each in TERMS)}"
    return term.read(sign, value)


def completions(text: str, units: list[str]) -> list[str]:
    """Return terms that the last word of `text` may become."""
    start = text.rsplit(" ", 1)[-1]
    pool = [f"unit:{unit}" for unit in units] + [word for term in TERMS for word in term.completions]
    pool += [*(term.bare for term in TERMS), "-", *_FLAGS]
    return [term for term in pool if start and term.startswith(start) and term != start]


__all__ = ["Filter", "completions", "parse"]
