"""The filter language: words, name globs, regular expressions and `field:value` terms, all of which must hold.

    torque LF  LF|RF       all words somewhere in the name, in any order and case; either of them; where no name
                           has all, each of them in the name or in what the program says of the element
    "two words"  -word     quoted; not
    /log/*/q  joint?_tau   globs, as commands mean them: on the whole name when they begin with `/` (with or without the
                           logger's prefix), else behind any `/`, or anywhere where there is none
    ~HA+$                  a regular expression, somewhere in the name
    unit:Nm on:no div>1 size>=1k act:publish buf:loop state:lost kind:vector type:f4   unit:Nm|rad
    value>60 |value|>60 std>1 rate<95% fill>=50% changed<1s    what was measured, judged twice a second
    marked pending edited conflict live derived problem nan frozen slow monotone off

`monotone` is what is at its largest or smallest of all since the statistics began, as what only grows or falls

An element with edits passes by a setting that it has, or that is wanted of it.

`problem` is whatever the column `state` says, but `full`; it was called `alarm`, which goes on meaning it

`parse` never raises: a term that can't be understood is reported, with its place, and left out.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from copy import copy

import msgspec
import numpy as np

from silo.core.arrays.columns import Floats
from silo.core.names import Names
from silo_tui.model.table.columns import LIVE_COLUMNS
from silo_tui.model.table.facts import BITS
from silo_tui.model.table.fields import Field, Ints
from silo_tui.model.table.state import Mask, TableState
from silo_tui.model.table.terms import OTHER_TERMS, Test, negate
from silo_tui.model.words.states import FULL, MEANINGS

# blanks and bars inside of quotes belong to the word; a regular expression ends at a blank
_TOKEN = re.compile(r'-?~\S+|(?:"[^"]*"?|[^\s"])+')
_PART = re.compile(r'\|[A-Za-z]+\|(?:>=|<=|!=|>|<|=|:)[^\s|"]*|(?:"[^"]*"?|[^|"])+')
_TERM = re.compile(r"(\|?[A-Za-z]+\|?)(>=|<=|!=|>|<|=|:)(.*)", re.DOTALL)
_MEASURED_WORDS = ("problem", "alarm", "nan", "frozen", "slow")
_MONOTONE = "monotone"
_OF_MONOTONE = frozenset({"value", "min", "max"})
EXPLAINED: Mapping[str, str] = {
    **{f"state:{word}": MEANINGS[word] for word in (*BITS, FULL)},
    **{word: MEANINGS[word] for word in ("nan", "frozen", "slow")},
    "monotone": "now the largest or smallest, as what only grows or falls",
    "problem": "whatever the column state says, but full", "edited": "other settings than the program began with",
    "pending": "an edit waits to be applied", "off": "not logged",
}  # fmt: skip
TERMS = (*(term for column in LIVE_COLUMNS for term in column.terms), *OTHER_TERMS)


class Condition(msgspec.Struct, frozen=True):
    """One term as it was typed, what it lets pass, and what has to be surveyed for it."""

    text: str
    test: Test
    quantities: frozenset[str] = frozenset()
    of_settings: bool = False

    def passes(self, table: TableState, marked: Mask) -> Mask:
        """Return shape `(n,)`: what passes it, by the settings wanted or by those in force: no edit hides its row.

        All, also of its opposite, until what it asks for was measured of this table.
        """
        if any(table.facts.of(quantity, len(table)) is None for quantity in self.quantities):
            return np.ones(len(table), np.bool_)
        found = self.test(table, marked, table.values)
        if not self.of_settings or not table.pending.any():
            return found
        return found | self.test(table, marked, table.server)


class Filter(msgspec.Struct, frozen=True):
    """A parsed filter: `problems` says which terms were left out and why, `places` where they stand in the text."""

    text: str
    conditions: tuple[Condition, ...]
    problems: tuple[str, ...]
    places: tuple[tuple[int, int], ...] = ()

    @property
    def quantities(self) -> frozenset[str]:
        """What it asks for of what is measured."""
        return frozenset[str]().union(*(condition.quantities for condition in self.conditions))

    @property
    def measured(self) -> bool:
        """Whether it asks for what is measured, so that rows come and go by themselves."""
        return bool(self.quantities)

    def mask(self, table: TableState, marked: Mask) -> Mask:
        """Return shape `(n,)`: the elements that pass every term.

        Where no name has all words, each of them may be in the name or in the description.
        """
        steady = [each.passes(_named(table), marked) for each in self.conditions if not each.quantities]
        if steady and not np.logical_and.reduce(steady).any() and not table.said_too:
            table = copy(table)
            table.said_too = True
        result = np.ones(len(table), np.bool_)
        for condition in self.conditions:
            result &= condition.passes(table, marked)
        return result

    def by_component(self, table: TableState, marked: Mask, passing: Sequence[int]) -> list[int]:
        """Return which of those that pass do so by the name of a component alone, as `joints/torque` does LF."""
        named = copy(table)
        named.searched = [names[:1] for names in table.searched]
        by_name = self.mask(named, marked)
        return [row for row in passing if not by_name[row]]

    def by_description(self, table: TableState, marked: Mask, passing: Sequence[int]) -> list[int]:
        """Return which of those that pass do so by what is said of them: their names don't have all words."""
        by_name = self.mask(_named(table), marked)
        return [row for row in passing if not by_name[row]]

    def more_described(self, table: TableState, marked: Mask) -> int:
        """Return how many don't pass of which a word is said, as others have it in their names."""
        said = copy(table)
        said.said_too = True
        return int((self.mask(said, marked) & ~self.mask(table, marked)).sum())

    def blocked_by(self, table: TableState, marked: Mask) -> tuple[str, int] | None:
        """Return the term without which most elements would be left, and how many; None where no single one is it."""
        masks = [condition.passes(table, marked) for condition in self.conditions]
        left = []
        for at in range(len(masks)):
            others = [mask for other, mask in enumerate(masks) if other != at]
            left.append(int(np.logical_and.reduce(others).sum()) if others else len(table))
        most = max(left, default=0)
        return (self.conditions[left.index(most)].text, most) if most else None

    def without_any(self, table: TableState, marked: Mask) -> list[str]:
        """Return the terms that nothing passes, each by itself."""
        return [each.text for each in self.conditions if not each.passes(table, marked).any()]


def _named(table: TableState) -> TableState:
    """Return a table of whose elements nothing is said."""
    named = copy(table)
    named.described = [""] * len(table)
    return named


def parse(text: str) -> Filter:
    """Read a filter; never raises."""
    conditions: list[Condition] = []
    problems: list[str] = []
    places: list[tuple[int, int]] = []
    for match in _TOKEN.finditer(text):
        found = _condition(match[0])
        if isinstance(found, str):
            problems.append(found)
            places.append(match.span())
        elif found is not None:
            conditions.append(found)
    return Filter(text, tuple(conditions), tuple(problems), tuple(places))


def _condition(token: str) -> Condition | str | None:
    """Return what a word lets pass, why it can't be read, or None while somebody is still typing it."""
    negated = token.startswith("-")
    body = token[1:] if negated else token
    parts = [body] if body.startswith("~") else _PART.findall(body)
    tests: list[Test] = []
    quantities: frozenset[str] = frozenset()
    of_settings = False
    key = sign = ""
    for part in parts:
        if (term := _TERM.fullmatch(part)) is not None:
            key, sign, value = term[1].lower(), term[2], term[3].strip('"')
            test = _term(key, sign, value, part) if value else None
            asked = [each for each in TERMS if key in each.names]
            quantities = quantities.union(*(each.quantities for each in asked))
            of_settings |= any(each.of_settings for each in asked)
        elif key and sign in {":", "=", "!="} and not part.startswith("~"):  # unit:Nm|rad
            test = _term(key, sign, part.strip('"'), part)
        else:
            test = _word(part)
            quantities |= {"signs"} if part.lower() in _MEASURED_WORDS else set()
            quantities |= _OF_MONOTONE if part.lower() == _MONOTONE else set()
            of_settings |= part.lower() == "off"
        if isinstance(test, str):
            return test
        if test is not None:
            tests.append(test)
    if not tests:
        return None
    both = _joined(tests, np.logical_and if sign == "!=" else np.logical_or)
    return Condition(token, negate(both) if negated else both, quantities, of_settings)


def _joined(tests: list[Test], join: np.ufunc) -> Test:
    return lambda table, marked, settings: join.reduce([test(table, marked, settings) for test in tests])


def _word(word: str) -> Test | str | None:
    if word.startswith("~"):
        return _regex(word[1:])
    quoted = word.startswith('"')
    word = word.replace('"', "")
    if not word:
        return None
    if not quoted and word.lower() in _FLAGS:
        return _FLAGS[word.lower()]
    if not quoted and set(word) & set("(){}"):
        return "brackets group nothing here: LF|RF is either, ~ begins a regular expression"
    folded = word.casefold()
    if not quoted and any(char in word for char in "*?["):
        return _by_glob(folded)
    if "_" in folded:  # as names are typed by heart: LF_KFE is LF/KFE, too
        by_name = _by_name(lambda name: folded in name or folded in name.replace("/", "_"))
    else:
        by_name = _by_name(lambda name: folded in name)

    def test(table: TableState, marked: Mask, settings: Ints) -> Mask:
        found = by_name(table, marked, settings)
        if found.any() and not table.said_too:
            return found
        return found | np.fromiter((folded in one for one in table.described), np.bool_, len(table))

    return test


def _by_glob(pattern: str) -> Test:
    """Return a test of names by a pattern, as commands mean it."""

    def find(table: TableState) -> Mask:
        names = Names([found[0] for found in table.searched], table.prefix.casefold(), lambda: table.searched)
        found = np.zeros(len(table), np.bool_)
        anywhere = [] if pattern.startswith("/") else names.part_of(pattern)
        found[[place for place, _ in names.find(pattern, scalars=True) or anywhere]] = True
        return found

    return _of_names(find)


def _regex(pattern: str) -> Test | str | None:
    if not pattern:
        return None
    try:
        compiled = re.compile(pattern, re.IGNORECASE)
    except (re.error, OverflowError, RecursionError) as error:
        return f"~{pattern}: no regular expression: {error}"
    return _by_name(lambda name: compiled.search(name) is not None)


def _by_name(passes: Callable[[str], bool]) -> Test:
    """Return a test of names in small letters, of elements and of their components."""
    return _of_names(
        lambda table: np.fromiter((any(map(passes, names)) for names in table.searched), np.bool_, len(table))
    )


def _of_names(find: Callable[[TableState], Mask]) -> Test:
    """Return a test of names that looks at each once, as long as the table has those."""
    looked: list[tuple[list[list[str]], Mask]] = []

    def test(table: TableState, marked: Mask, settings: Ints) -> Mask:
        if not looked or looked[0][0] is not table.searched:
            looked[:] = [(table.searched, find(table))]
        return looked[0][1]

    return test


def _is_extreme(measured: Mapping[str, Floats]) -> Mask:
    found: Mask = (measured["value"] >= measured["max"]) | (measured["value"] <= measured["min"])
    return found


def _pending(table: TableState, marked: Mask, settings: Ints) -> Mask:
    return np.asarray(table.pending.any(axis=0))


def _signed(bits: int) -> Test:
    return lambda table, marked, settings: np.asarray((table.signs & bits) != 0)


_FLAGS: Mapping[str, Test] = {
    "dirty": _pending, "pending": _pending,
    "marked": lambda table, marked, settings: marked.copy(),
    "edited": lambda table, marked, settings: table.edited,
    "conflict": lambda table, marked, settings: np.asarray(table.conflicts.any(axis=0)),
    "live": lambda table, marked, settings: table.live,
    "derived": lambda table, marked, settings: table.derived,
    "off": lambda table, marked, settings: np.asarray(settings[Field.ENABLED] == 0),
    _MONOTONE: lambda table, marked, settings: _is_extreme(table.facts.quantities),
    **{word: _signed(BITS.get(word, -1)) for word in _MEASURED_WORDS},
}  # fmt: skip


def _term(key: str, sign: str, value: str, raw: str) -> Test | str:
    term = next((term for term in TERMS if key in term.names), None)
    comparing = " and ".join(each.names[0] for each in TERMS if each.compares)
    if sign not in {":", "=", "!="} and (term is None or not term.compares):
        return f"{raw}: {sign} compares {comparing} only"
    if term is None:
        return f"{key}{sign} is no field; there are {' '.join(each.names[0] for each in TERMS)}"
    return term.read(sign, value)


def explained(text: str) -> str:
    """Return what the last word of a filter means; empty where it is none of the filter's own, as a part of a name."""
    word = text.rpartition(" ")[2].removeprefix("-")
    return f"{word}: {EXPLAINED[word]}" if word in EXPLAINED else ""


def completions(text: str, units: list[str]) -> list[str]:
    """Return terms that the last word of `text` may become."""
    start = text.rsplit(" ", 1)[-1]
    pool = [f"unit:{unit}" for unit in units] + [word for term in TERMS for word in term.completions]
    pool += [*(term.bare for term in TERMS), "-", *_FLAGS]
    return [term for term in pool if start and term.startswith(start) and term != start]
