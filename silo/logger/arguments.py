"""What kind of thing an argument must be: checked at the door, so that a mistake is told in the words of the caller.

Each function returns the value as the type that it names, or raises ElementError with argument, value and range.
"""

import math
import numbers
import os
from pathlib import Path

from silo.errors import ElementError


def text(argument: str, value: object, example: str) -> str:
    """A string. `example` shows how the call is written."""
    if not isinstance(value, str):
        raise ElementError(f"{argument} must be a text, got {value!r} ({type(value).__name__}); write {example}")
    return str(value)


def path(argument: str, value: object) -> Path:
    """A path, relative or absolute."""
    if not isinstance(value, str | os.PathLike) or not os.fspath(value):
        raise ElementError(f"{argument} must be a path, got {value!r}")
    found = Path(os.fsdecode(value))
    if "\0" in str(found):
        raise ElementError(f"{argument} must be a path without NUL characters, got {value!r}")
    return found


def real(argument: str, value: object, low: float, high: float, unit: str, *, include_low: bool = True) -> float:
    """A number from `low` to below `high`, which may be any kind of real number but no bool and no text."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        number = float(value)
        if math.isfinite(number) and (low <= number if include_low else low < number) and number < high:
            return number
    begin = f"from {low:g}" if include_low else f"above {low:g}"
    raise ElementError(f"{argument} must be {begin} and below {high:g} {unit}, got {value!r}")


def whole(argument: str, value: object, low: int, high: int) -> int:
    """A whole number from `low` to `high`; NumPy's are fine."""
    if isinstance(value, numbers.Integral) and not isinstance(value, bool) and low <= int(value) <= high:
        return int(value)
    raise ElementError(f"{argument} must be a whole number from {low} to {high}, got {value!r}")


def switch(argument: str, value: object) -> bool:
    """True or False."""
    if not isinstance(value, bool):
        raise ElementError(f"{argument} must be True or False, got {value!r}")
    return value
