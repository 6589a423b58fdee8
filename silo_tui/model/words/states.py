"""The words for what is the matter with a signal, one table for columns, alarms, filter, help and inspector."""

from silo.conditions.standing import LimitWord

OLD = "old"  # nothing comes
FULL = "full"  # of one row: its buffer keeps no more
BLIND = "blind"  # of a limit
MEANINGS = {
    "HH": "above its red limit", "LL": "below its red limit", "H": "above its yellow limit",
    "L": "below its yellow limit", "nan": "nan or inf among its newest values",
    "frozen": "it changes no more, or a limit calls it stale",
    "slow": "fewer samples than its divider asks for",
    "lost": "the buffer could not keep all samples",
    OLD: "no link, the program is dead, or it was switched on later",
    FULL: "its buffer keeps what it has: this is its last sample",
}  # fmt: skip
WIDEST = max(map(len, MEANINGS))


def limit_word(word: LimitWord) -> str:
    """Return how a limit stands, by the words of the table."""
    return {LimitWord.STALE: "frozen", LimitWord.BLIND: BLIND}.get(word, word.value)
