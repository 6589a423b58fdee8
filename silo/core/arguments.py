"""What kind of thing an argument must be: checked at the door, so that a mistake is told in the words of the caller.

Each function returns the value as the type that it names, or raises ElementError with argument, value, range and what
to write instead. Called by whatever a user can call, never by `collect()`.
"""

import enum
import math
import numbers
import operator
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import SupportsIndex, TypeVar

from silo.core.names import did_you_mean, nearest
from silo.errors import ElementError, SaveError

Word = TypeVar("Word", bound=enum.Enum)

MOST_SHOWN = 80  # characters of a value in a message
MOST_NAME_BYTES, MOST_PATH_BYTES = 255, 4095  # of Linux

INT64 = (-(2**63), 2**63 - 1)


def shown(value: object) -> str:
    """A value in a message: short, on one line, whatever its class does when it is asked."""
    try:
        said = f"{type(value).__name__}.{value.name}" if isinstance(value, enum.Enum) else repr(value)
        words = " ".join(said.split())
    except Exception:  # noqa: BLE001  # the mistake that is told of is another one
        words = f"a {type(value).__name__}"
    words = words if len(words) <= MOST_SHOWN else f"{words[:MOST_SHOWN]}..."
    return words.encode("utf-8", "backslashreplace").decode()


def text(argument: str, value: object, example: str) -> str:
    """A string that can be stored. `example` shows how the call is written."""
    if not isinstance(value, str):
        raise ElementError(f"{argument} must be a text, got {shown(value)} ({type(value).__name__}); write {example}")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ElementError(
            f"{argument} must be a text of whole characters, got {shown(value)}, which no file can hold; "
            f"write {example}"
        ) from None
    return str(value)


def line(argument: str, value: object, example: str) -> str:
    """A string on one line, without control characters."""
    given = text(argument, value, example)
    if not given.isprintable():
        raise ElementError(f"{argument} must be of printable characters, on one line, got {shown(given)}")
    return given


def texts(argument: str, value: object, example: str) -> list[str]:
    """Several strings; one alone is a mistake, as it would count as its letters."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise ElementError(f"{argument} must be a list of texts, got {shown(value)}; write {example}")
    return [text(f"each of {argument}", one, example) for one in value]


def path(argument: str, value: object) -> Path:
    """A path, relative or absolute; `~` is the home, as in a shell."""
    if not isinstance(value, str | bytes | os.PathLike) or not os.fspath(value):
        raise ElementError(f"{argument} must be a path, got {shown(value)}; write {argument}='some/path'")
    try:
        found = Path(os.fsdecode(value))
        if found.parts[:1] == ("~",):
            found = found.expanduser()
        length = len(os.fsencode(found))
        longest = max((len(os.fsencode(part)) for part in found.parts), default=0)
    except RuntimeError as error:  # there is no home
        raise ElementError(f"{argument}: {error}; write a path without '~', got {shown(value)}") from None
    except UnicodeError:
        raise ElementError(f"{argument} must be a path of whole characters, got {shown(value)}") from None
    if "\0" in str(found):
        raise ElementError(f"{argument} must be a path without NUL characters, got {shown(value)}")
    if length > MOST_PATH_BYTES or longest > MOST_NAME_BYTES:
        raise ElementError(
            f"{argument} must be a path of at most {MOST_PATH_BYTES} bytes, {MOST_NAME_BYTES} in each name, got "
            f"{shown(value)}"
        )
    return found


def real(argument: str, value: object, low: float, high: float, unit: str, *, include_low: bool = True) -> float:
    """A number from `low` to below `high`, which may be any kind of real number but no bool and no text."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number) and (low <= number if include_low else low < number) and number < high:
            return number
    begin = f"from {low:g}" if include_low else f"above {low:g}"
    own = re.escape("".join(unit.split()[:1]))  # '2ms' are no 2 Hz
    in_unit = rf"\s*([0-9.]+(?:e[0-9]+)?)\s*(?:{own})?\s*"
    typed = re.fullmatch(in_unit, value, re.IGNORECASE) if isinstance(value, str) else None
    way_out = f"; write {argument}={typed[1]}" if typed else ""
    end = f"{high:g} {unit}".strip()
    raise ElementError(f"{argument} must be {begin} and below {end}, got {shown(value)}{way_out}")


def whole_number(value: object) -> int | None:
    """A whole number of any type that has them (Python's, NumPy's, an array of one), None for anything else."""
    if type(value) is int:
        return value
    # an enumeration's member is a choice, not a number, whatever it counts as
    if isinstance(value, bool | enum.Enum) or not isinstance(value, SupportsIndex):
        return None
    try:
        return operator.index(value)
    except TypeError:  # an array of floats, or of several
        return None


def whole(argument: str, value: object, low: int, high: int) -> int:
    """A whole number from `low` to `high`; NumPy's are fine."""
    number = whole_number(value)
    if number is not None and low <= number <= high:
        return number
    hint = whole_hint(argument, value, low, high)
    raise ElementError(f"{argument} must be a whole number from {low} to {high}, got {shown(value)}{hint}")


def whole_hint(argument: str, value: object, low: float, high: float) -> str:
    """What to write instead of a float that is whole, from `low` to `high`; empty for all else."""
    if not isinstance(value, numbers.Real) or isinstance(value, numbers.Integral):
        return ""
    number = float(value)
    if not number.is_integer() or not low <= number <= high:
        return ""
    return f"; write {argument}={int(number)}" if argument.isidentifier() else f"; write {int(number)}"


def truth(value: object) -> bool | None:
    """True or False of Python or NumPy, None for anything else."""
    if isinstance(value, bool):
        return value
    # by its name: not everybody who asks has NumPy loaded
    return bool(value) if type(value).__module__ == "numpy" and type(value).__name__ in ("bool", "bool_") else None


def switch(argument: str, value: object) -> bool:
    """True or False; NumPy's are fine."""
    found = truth(value)
    if found is None:
        raise ElementError(f"{argument} must be True or False, got {shown(value)}")
    return found


def word(argument: str, value: object, kind: type[Word]) -> Word:
    """A member of an enumeration of words: itself, or its word in any case. Raises with the words there are."""
    if isinstance(value, kind):
        return value
    words = {str(member.value): member for member in kind}
    asked = (
        value.strip().lower().replace("-", "_") if isinstance(value, str) and not isinstance(value, enum.Enum) else ""
    )
    if asked in words:
        return words[asked]
    *most, last = (f"'{each}'" for each in words)
    hint = did_you_mean(nearest(asked, words, 0.5))
    raise ElementError(f"{argument} must be {', '.join(most)} or {last}, got {shown(value)}{hint}")


def check_name(name: str) -> str:
    """The name, if it is one for a file: no `/`, no dot in front, no control character, at most 200 bytes.

    Raises `SaveError` with what is wrong.
    """
    problem = None
    if not name or not name.strip():
        problem = "it is empty"
    elif "/" in name:
        problem = "it contains '/' (the folder is an option of its own)"
    elif name.startswith("."):
        problem = "it starts with a dot, which would hide the file"
    elif not name.isprintable():
        problem = "it contains a control character"
    elif len(name.encode("utf-8")) > 200:
        problem = f"it has {len(name.encode('utf-8'))} bytes, 200 are possible"
    if problem:
        raise SaveError(f"{name!r} can't be the name of a log: {problem}; choose a name like 'first_walk'")
    return name
