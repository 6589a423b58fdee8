"""Limits of signals as plots know them: where their lines lie, and what is outside. Pure functions."""

from collections.abc import Mapping

Bounds4 = tuple[float | None, float | None, float | None, float | None]
"""Red low, yellow low, yellow high, red high; None for none."""

WORDS = ("LL", "L", "H", "HH")


def inner(bounds: Mapping[str, Bounds4], name: str) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of a scalar that is within its limits."""
    red_low, low, high, red_high = bounds.get(name, (None, None, None, None))
    return red_low if low is None else low, red_high if high is None else high
