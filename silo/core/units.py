"""Units of signals: formulas of words, and what becomes of them in arithmetic.

A unit is the text that the program gave. Products and quotients keep its words and cancel what stands above and below
(`rad/s` times `s` is `rad`); a text that is no formula is one opaque word. `-` and the empty text are no unit. Whether
two texts mean the same, and by how much they differ, is told by the table of SI units below; as there, `rad` is 1.

Not pint: it reads `Nm` as "number metre" (length per mass), knows no `m/s2`, adds Hz to rad/s without a factor, and
takes 0.4 s to load. Words that it doesn't know are errors, here they combine and cancel like all others.
"""

import math
import re
from collections.abc import Mapping
from fractions import Fraction
from functools import lru_cache

Formula = dict[str, Fraction]  # word -> exponent, in the order in which they came; never 0

_NONE = ("", "-")
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_POWER = r"(?:\^|\*\*)(-?[0-9]{1,6}(?:\.[0-9]{1,6})?|\(-?[0-9]{1,6}/[0-9]{1,6}\))|(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]{1,6})"
_NEXT = r"\s*(?:[*·⋅×/()]|$)"
_OPERATOR = re.compile(r"\s*(\*(?!\*)|[·⋅×/(])")
_CLOSE = re.compile(rf"\s*\)(?:{_POWER})?")
_WORD = re.compile(rf"\s*(\[[^\[\]]+\]|[^*·⋅×/()\[\]^]+?)(?:{_POWER})?(?={_NEXT})")
_SPACED_WORD = re.compile(rf"\s*([^*·⋅×/()\[\]^\s]+?)(?:{_POWER})?(?=\s|{_NEXT})")
_DIGITS_BEHIND = re.compile(r"(.*[^0-9-])(-?[0-9]{1,3})")  # `m/s2`, `s-1`
_MAX_DEPTH = 20

# what a word means, in words that mean themselves; `cycle` keeps Hz apart from rad/s
_WITH_PREFIX = {
    "m": (1.0, "m"),
    "g": (1e-3, "kg"),
    "s": (1.0, "s"),
    "A": (1.0, "A"),
    "K": (1.0, "K"),
    "mol": (1.0, "mol"),
    "cd": (1.0, "cd"),
    "rad": (1.0, "-"),
    "Hz": (1.0, "cycle/s"),
    "N": (1.0, "kg*m/s^2"),
    "Nm": (1.0, "kg*m^2/s^2"),
    "J": (1.0, "kg*m^2/s^2"),
    "W": (1.0, "kg*m^2/s^3"),
    "Wh": (3600.0, "kg*m^2/s^2"),
    "Pa": (1.0, "kg/(m*s^2)"),
    "bar": (1e5, "kg/(m*s^2)"),
    "C": (1.0, "A*s"),
    "Ah": (3600.0, "A*s"),
    "V": (1.0, "kg*m^2/(A*s^3)"),
    "Ω": (1.0, "kg*m^2/(A^2*s^3)"),
    "Ohm": (1.0, "kg*m^2/(A^2*s^3)"),
    "ohm": (1.0, "kg*m^2/(A^2*s^3)"),
    "F": (1.0, "A^2*s^4/(kg*m^2)"),
    "H": (1.0, "kg*m^2/(A^2*s^2)"),
    "T": (1.0, "kg/(A*s^2)"),
    "Wb": (1.0, "kg*m^2/(A*s^2)"),
    "Nms": (1.0, "kg*m^2/s"),
    "lm": (1.0, "cd"),
    "lx": (1.0, "cd/m^2"),
    "l": (1e-3, "m^3"),
    "L": (1e-3, "m^3"),
}
_KNOWN = {
    **_WITH_PREFIX,
    "kg": (1.0, "kg"),
    "deg": (math.pi / 180, "-"),
    "°": (math.pi / 180, "-"),
    "rpm": (math.pi / 30, "1/s"),
    "min": (60.0, "s"),
    "h": (3600.0, "s"),
    "day": (86400.0, "s"),
    "days": (86400.0, "s"),
    "kph": (1 / 3.6, "m/s"),
    "mph": (0.44704, "m/s"),
    "kn": (1852 / 3600, "m/s"),
    "in": (0.0254, "m"),
    "inch": (0.0254, "m"),
    "ft": (0.3048, "m"),
    "yd": (0.9144, "m"),
    "mi": (1609.344, "m"),
    "oz": (0.028349523125, "kg"),
    "lb": (0.45359237, "kg"),
    "lbf": (4.4482216152605, "kg*m/s^2"),
    "psi": (6894.757293168361, "kg/(m*s^2)"),
    "mmHg": (133.322387415, "kg/(m*s^2)"),
    "lux": (1.0, "cd/m^2"),
    "gauss": (1e-4, "kg/(A*s^2)"),
    "Gs": (1e-4, "kg/(A*s^2)"),
}
# words without a factor to others, that are no mistakes
_COUNTED_WORDS = """
    count counts tick ticks step steps sample samples frame frames cycle cycles pulse pulses rev turn turns digit LSB
    bit bits byte bytes B kB MB GB px pixel pixels % ‰ ppm dB dBm degC °C degF °F var VA G
    bool boolean enum flag flags bitmask mask state mode id index normalized normalised norm ratio fraction gain raw
    unitless dimensionless none number code level score probability confidence
"""
_COUNTED = frozenset(_COUNTED_WORDS.split())
# what people write, by what it is called here: told, not taken
_MISWRITTEN = {
    "rad": "radian radians rd rads",
    "deg": "degree degrees degs",
    "m": "meter meters metre metres",
    "s": "second seconds sec secs",
    "ms": "msec msecs millisecond milliseconds",
    "us": "usec usecs microsecond microseconds",
    "min": "minute minutes mins",
    "h": "hour hours hr hrs",
    "N": "newton newtons",
    "Nm": "newtonmeter newtonmeters newtonmetre newtonmetres n.m nm. n-m",
    "V": "volt volts",
    "A": "amp amps ampere amperes",
    "W": "watt watts",
    "J": "joule joules",
    "Hz": "hertz",
    "Pa": "pascal pascals",
    "K": "kelvin",
    "degC": "celsius centigrade",
    "g": "gram grams",
    "kg": "kilogram kilograms kgs kilo kilos",
    "%": "percent",
    "rpm": "revolutions/min",
}
_MEANT_BY = {given: word for word, others in _MISWRITTEN.items() for given in others.split()}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 0.1, "k": 1e3, "M": 1e6, "G": 1e9}


def product(one: str, other: str) -> str:
    """Return the unit of a product: `rad/s` and `s` make `rad`, `Nm` and `rad/s` make `W`."""
    if one in _NONE or other in _NONE:
        return (other if one in _NONE else one) or "-"
    return _called(_times(_formula(one), _formula(other)))


def quotient(one: str, other: str) -> str:
    """Return the unit of a quotient: `rad` and `s` make `rad/s`."""
    return one or "-" if other in _NONE else _called(_times(_formula(one), _formula(other), -1))


def power(unit: str, exponent: float) -> str:
    """Return the unit of a power: `m/s` to the 2 makes `m^2/s^2`. The exponent is finite."""
    # a third comes as 0.333...: the nearest fraction of small numbers is meant
    return _text(_times({}, _formula(unit), Fraction(exponent).limit_denominator(1000)))


def same(one: str, other: str) -> bool:
    """Return whether both mean the same: `Nm` and `N*m`, `m/s²` and `m/s^2`."""
    between = factor(one, other)
    return between is not None and math.isclose(between, 1.0, rel_tol=1e-12)


def factor(unit: str, to: str) -> float | None:
    """Return by what values in `unit` are multiplied to be in `to`; None where they can't be converted."""
    (mine, words), (theirs, other_words) = _meaning(unit), _meaning(to)
    return mine / theirs if words == other_words else None


def size(unit: str) -> float | None:
    """Return what one of this unit is in SI units without prefix (`ms`: 0.001); None where it isn't known."""
    mine, words = _meaning(unit)
    return mine if all(word == "cycle" or _known(word) for word in words) else None


def doubt(unit: str) -> str:
    """Return what is wrong with a unit that somebody gives, with the way out; "" for one whose words are known.

    A word of somebody's own stands in brackets: `[parsec]`.
    """
    unknown = [
        word
        for word in _formula(unit)
        if f"[{word}]" not in unit and not _known(word) and word not in _COUNTED and not word.isdigit()
    ]
    if not unknown:
        return ""
    meant = own = unit
    for word in unknown:
        meant, own = meant.replace(word, _meant(word)), own.replace(word, f"[{word}]")
    words = " and ".join(f"'{word}'" for word in unknown)
    close = f", did you mean '{meant}'?" if meant != unit else ""
    return f"unit '{unit}': silo doesn't know {words}{close}; a word of your own is written '{own}'"


def _meant(word: str) -> str:
    """The known word that somebody means; the word itself where there is none."""
    lower = word.lower()
    if lower in _MEANT_BY:
        return _MEANT_BY[lower]
    return next((known for known in (*_KNOWN, *sorted(_COUNTED)) if known.lower() == lower), word)


def _times(one: Mapping[str, Fraction], other: Mapping[str, Fraction], exponent: Fraction | int = 1) -> Formula:
    made = dict(one)
    for word, own in other.items():
        made[word] = made.get(word, Fraction(0)) + own * exponent
    return {word: own for word, own in made.items() if own}


# ------------------------------------------------------------------------------------------------- texts and formulas


def _called(formula: Formula) -> str:
    """Return what is made of other units as a text: power by its own name, and energy where it is made of that.

    `kg*m^2/s^2` by itself may be a torque.
    """
    made = _text(formula)
    name = "J" if "W" in formula and "s" in formula else "W"
    return name if len(formula) > 1 and same(made, name) else made


def _text(formula: Formula) -> str:
    if not formula:
        return "-"
    if list(formula.values()) == [1]:
        return next(iter(formula))
    above = [_written(word, exponent) for word, exponent in formula.items() if exponent > 0]
    below = [_written(word, -exponent) for word, exponent in formula.items() if exponent < 0]
    if not below:
        return "*".join(above)
    divisor = below[0] if len(below) == 1 else f"({'*'.join(below)})"
    return f"{'*'.join(above) or '1'}/{divisor}"


def _written(word: str, exponent: Fraction) -> str:
    shown = word if _Reader(word, _WORD).formula() == {word: Fraction(1)} else f"[{word}]"
    if exponent == 1:
        return shown
    if exponent.denominator == 1:
        return f"{shown}^{exponent}"
    decimal = f"{float(exponent):g}"
    return f"{shown}^{decimal if Fraction(decimal) == exponent else f'({exponent})'}"


@lru_cache(maxsize=1024)
def _formula(text: str) -> Formula:
    """Return a text as a formula. Spaces multiply where all words are known (`kg m`), else they belong to a word."""
    text = text.strip()
    if text in _NONE:
        return {}
    if " " in text:
        spaced = _Reader(text, _SPACED_WORD).formula()
        if spaced is not None and all(_known(word) for word in spaced):
            return spaced
    read = _Reader(text, _WORD).formula()
    return {text: Fraction(1)} if read is None else read


class _NoFormulaError(Exception):
    """A text isn't a product or quotient of words."""


class _Reader:
    """Reads one text from left to right: words, `*`, `/`, parentheses, powers."""

    def __init__(self, text: str, word: re.Pattern[str]) -> None:
        self._text, self._word, self._at, self._depth = text, word, 0, 0

    def formula(self) -> Formula | None:
        try:
            made = self._terms()
        except (_NoFormulaError, ZeroDivisionError):
            return None
        return made if self._at == len(self._text) else None

    def _terms(self) -> Formula:
        made = self._term()
        while True:
            operator = self._take(_OPERATOR)
            if operator is None and not (self._word is _SPACED_WORD and self._word.match(self._text, self._at)):
                return made
            if operator and operator[1] == "(":
                raise _NoFormulaError
            made = _times(made, self._term(), -1 if operator and operator[1] == "/" else 1)

    def _term(self) -> Formula:
        found = self._take(self._word)
        if found is not None:
            return _word(found)
        operator = self._take(_OPERATOR)
        self._depth += 1
        if operator is None or operator[1] != "(" or self._depth > _MAX_DEPTH:
            raise _NoFormulaError
        made = self._terms()
        closed = self._take(_CLOSE)
        if closed is None:
            raise _NoFormulaError
        return _times({}, made, _exponent(closed[1], closed[2]))

    def _take(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        found = pattern.match(self._text, self._at)
        if found is not None:
            self._at = found.end()
        return found


def _word(found: re.Match[str]) -> Formula:
    word, exponent = found[1].strip(), _exponent(found[2], found[3])
    if word.startswith("["):
        word = word[1:-1].strip()
    elif not (found[2] or found[3]) and (digits := _DIGITS_BEHIND.fullmatch(word)) and _known(digits[1]):
        word, exponent = digits[1], Fraction(digits[2])
    if word in _NONE:
        raise _NoFormulaError
    return {} if word == "1" or not exponent else {word: exponent}


def _exponent(plain: str | None, superscript: str | None) -> Fraction:
    if superscript:
        return Fraction(superscript.translate(_SUPERSCRIPTS))
    return Fraction(plain.strip("()")) if plain else Fraction(1)


# ----------------------------------------------------------------------------------------------------- what they mean


def _known(word: str) -> tuple[float, str] | None:
    if word in _KNOWN:
        return _KNOWN[word]
    if word[:1] in _PREFIXES and word[1:] in _WITH_PREFIX:
        size, meaning = _WITH_PREFIX[word[1:]]
        return _PREFIXES[word[0]] * size, meaning
    return None


@lru_cache(maxsize=1024)
def _meaning(unit: str) -> tuple[float, Formula]:
    """Return how large a unit is, in words that mean themselves."""
    size, words = 1.0, Formula()
    for word, exponent in _formula(unit).items():
        known = _known(word)
        if known is None:
            words = _times(words, {word: exponent})
            continue
        size *= known[0] ** float(exponent)
        words = _times(words, _formula(known[1]), exponent)
    return size, words
