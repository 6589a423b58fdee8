"""Two enumerations held against each other: their words are what they mean, their numbers may be others."""

from collections.abc import Mapping

from silo.core.quantities.writing import and_more

Words = Mapping[int, str]


def to_compare(one: Words, other: Words) -> tuple[dict[int, str], dict[int, str]]:
    """Return the words that say whether values of two enumerations are the same; what has none is its number.

    They are equal where numbers say it, too: a number that has a word in one of them alone, and a word that the other
    one doesn't know, is no contradiction.
    """
    return _known(one, other), _known(other, one)


def _known(mine: Words, theirs: Words) -> dict[int, str]:
    words = {*theirs.values()}
    return {number: word for number, word in mine.items() if number in theirs or word in words}


def contradiction(one: Words, other: Words) -> str:
    """Return where the numbers of two enumerations differ, in words; "" where they don't contradict each other."""
    mine, theirs = to_compare(one, other)
    numbers = [number for number in sorted({*mine, *theirs}) if mine.get(number) != theirs.get(number)]
    told = [f"{number} is {mine.get(number, 'no word')}, then {theirs.get(number, 'no word')}" for number in numbers]
    return and_more(told, 3, "; ")
