"""Parameters: numbers and words that a program offers to be tuned while it runs. What they are, and which values fit.

Pure rules, without NumPy: clients, helper process and robot program judge alike. A value in memory takes whole words of
8 bytes, so that what changes is stored in words.
"""

import enum
import math
import struct
from collections.abc import Collection, Sequence

import msgspec

from silo.core.arguments import shown
from silo.core.names import did_you_mean, nearest
from silo.core.quantities.writing import there_are
from silo.errors import ElementError

WORD_BYTES = 8

ParameterScalar = float | int | bool | str
ParameterValue = float | int | bool | str | tuple[float | int | bool | str, ...]  # arrays flat, rows first


class ParameterKind(str, enum.Enum):
    """What a value is."""

    FLOAT = "float"
    INT = "int"
    BOOL = "bool"
    ENUM = "enum"
    STRING = "string"


class Writable(str, enum.Enum):
    """Whose changes are taken, beside the program's own: nobody's, of this computer, from everywhere."""

    NO = "no"
    HERE = "here"
    ANYWHERE = "anywhere"


class ParameterInfo(msgspec.Struct, frozen=True, omit_defaults=True):
    """One parameter. `value` is what it was when this was made: at the start of a run, or when somebody asked.

    `offset` is the position of its first word among the words of all parameters. `locked`: it is closed while the
    program holds `log.parameters.lock()`. `rate` is in units per second. `input`: it is 0 but while it is excited.
    """

    name: str
    kind: ParameterKind
    default: ParameterValue
    shape: tuple[int, ...] = ()
    minimum: int | float | None = None
    maximum: int | float | None = None
    step: int | float | None = None
    unit: str = "-"
    choices: tuple[str, ...] = ()
    rate: float | None = None
    writable: Writable = Writable.HERE
    locked: bool = False
    string_bytes: int = 0
    description: str = ""
    offset: int = 0
    value: ParameterValue = 0
    input: bool = False

    @property
    def count(self) -> int:
        """How many values it has."""
        return math.prod(self.shape)

    @property
    def item_bytes(self) -> int:
        """What each of them takes."""
        if self.kind is ParameterKind.BOOL:
            return 1
        return self.string_bytes if self.kind is ParameterKind.STRING else WORD_BYTES

    @property
    def words(self) -> int:
        """How many words it takes."""
        if not self.shape and self.kind is not ParameterKind.STRING:  # asked three times where one is set
            return 1
        return max(1, -(-self.count * self.item_bytes // WORD_BYTES))

    @property
    def group(self) -> str:
        """The namespace in which it stands: what belongs together."""
        return self.name.rpartition("/")[0]


class Wave(str, enum.Enum):
    """The course of an excitation."""

    CHIRP = "chirp"
    MULTISINE = "multisine"
    PRBS = "prbs"
    STEP = "step"


class Excitation(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a parameter does for `duration_s`, around the value that it had: all numbers of it.

    A chirp goes from `low_hz` to `high_hz`, as long in each octave. A multisine has harmonics of `low_hz` up to
    `high_hz`. A PRBS decides `high_hz` times a second between both ends. A step is `amplitude` (also a negative one)
    away. It rises and falls within `ramp_s` at its begin and end. `index` is the value of an array that is meant.
    """

    name: str
    wave: Wave
    amplitude: float
    duration_s: float
    low_hz: float = 0.0
    high_hz: float = 0.0
    ramp_s: float = 0.0
    index: int = 0

    @property
    def text(self) -> str:
        """All of its numbers in words, but the unit."""
        course = {
            Wave.PRBS: f" of {self.high_hz:g} bit/s",
            Wave.STEP: "",
        }.get(self.wave, f" {self.low_hz:g} to {self.high_hz:g} Hz")
        ramps = f", ramps of {self.ramp_s:g} s" if self.ramp_s else ""
        return f"{self.wave.value}{course}, amplitude {self.amplitude:g}, for {self.duration_s:g} s{ramps}"


class ParameterChange(msgspec.Struct, frozen=True, omit_defaults=True):
    """What an event changed: names with the values before and after. Of the image at a start there is none before.

    `where` tells by which way it came, `id` what its client called it, `until` the tick at which a ramp was over.
    Where an `excitation` begins, before and after are the value around which it goes.

    `order` counts those that landed in a run, from 1; -1 where nobody knows. Of an image it is how many came before it:
    0 at the start, more where the oldest are not kept. Then `span` is how many ticks before the image the first of
    these landed. In a log at another rate, where samples are held, those of the first `held` ticks are older than it.
    """

    values: tuple[tuple[str, ParameterValue | None, ParameterValue], ...] = ()
    where: str = ""
    id: str = ""
    until: int = -1
    excitation: Excitation | None = None
    order: int = -1
    span: int = 0
    held: int = 0

    @property
    def is_image(self) -> bool:
        """Whether it tells what parameters were, and not that somebody changed them."""
        return all(old is None for _, old, _ in self.values)


def meant(name: str, known: Collection[str]) -> list[str]:
    """Return the parameters that a name means: the one that has it, else all that end so behind a `/`."""
    return [name] if name in known else [one for one in known if one.endswith(f"/{name.strip('/')}")]


def only_meant(name: str, known: Collection[str]) -> str:
    """Return the full name of the only parameter that a name means. Raises ElementError."""
    found = meant(name, known)
    if len(found) == 1:
        return found[0]
    if found:
        raise ElementError(f"'{name}' may be {', '.join(found)}: write more of the name; nothing was changed")
    near = nearest(name, [*known, *(one.rpartition("/")[2] for one in known)])
    there = ": ".join(filter(None, [there_are(len(known)), ", ".join([*known][:5])]))
    raise ElementError(f"no parameter '{name}'{did_you_mean(near, there)}")


def value_text(value: object, unit: str = "-") -> str:
    """A value, as it is shown."""
    if isinstance(value, tuple | list):
        shown = f"[{', '.join(map(value_text, value))}]"
    elif isinstance(value, bool):
        shown = "on" if value else "off"
    else:
        shown = repr(value) if isinstance(value, float) else str(value)
    return shown if unit in ("", "-") else f"{shown} {unit}"


def range_text(info: ParameterInfo) -> str:
    """Which values fit, in words."""
    if info.kind is ParameterKind.ENUM:
        return f"one of {', '.join(info.choices)}"
    if info.kind is ParameterKind.STRING:
        return f"up to {info.string_bytes} bytes of text"
    if info.kind is ParameterKind.BOOL:
        return "true or false"
    low, high, step = (None if one is None else bound_text(one) for one in (info.minimum, info.maximum, info.step))
    whole = info.kind is ParameterKind.INT
    if low is None and high is None:
        text = "a whole number" if whole else "any number"
    else:
        ends = f"{low} to {high}" if None not in (low, high) else f"up to {high}" if low is None else f"from {low}"
        text = f"whole numbers {ends}" if whole else ends
    return text + (f" in steps of {step}" if info.step else "")


def bound_text(number: float) -> str:
    """A bound with all its digits: what fits is judged by these."""
    return str(int(number)) if isinstance(number, int) or (number.is_integer() and abs(number) < 1e16) else repr(number)


def fitting(info: ParameterInfo, given: object) -> ParameterValue:
    """Return a value as this parameter keeps it. Raises ElementError, which names it, the value and what fits."""
    if not info.shape:
        return _fitting_item(info, given)
    items = _flat(given, info.shape)
    if items is None:
        shape = " x ".join(map(str, info.shape))
        raise ElementError(f"parameter '{info.name}': takes {shape} values, got {shown(given)}; nothing was changed")
    return tuple(_fitting_item(info, item) for item in items)


def _flat(given: object, shape: tuple[int, ...]) -> list[object] | None:
    """The items of an array of this shape, or of a flat list of as many."""
    listed = given.tolist() if hasattr(given, "tolist") else given
    if not isinstance(listed, list | tuple):
        return None
    items = list(listed)
    if len(items) == math.prod(shape) and not any(isinstance(item, list | tuple) for item in items):
        return items if len(shape) == 1 or not hasattr(given, "shape") else None
    if len(shape) < 2 or len(items) != shape[0]:
        return None
    rows = [_flat(item, shape[1:]) for item in items]
    return None if any(row is None for row in rows) else [item for row in rows if row for item in row]


def _fitting_item(info: ParameterInfo, given: object) -> ParameterScalar:
    if isinstance(given, enum.Enum) and info.kind is ParameterKind.ENUM:
        given = given.name
    elif hasattr(given, "item") and getattr(given, "shape", None) == ():
        given = given.item()
    if info.kind is ParameterKind.BOOL:
        return given if isinstance(given, bool) else _refuse(info, given)
    if info.kind is ParameterKind.ENUM:
        return given if isinstance(given, str) and given in info.choices else _refuse(info, given)
    if info.kind is ParameterKind.STRING:
        fits = (
            isinstance(given, str) and "\0" not in given and len(given.encode("utf-8", "replace")) <= info.string_bytes
        )
        return str(given) if fits and str(given).isprintable() else _refuse(info, given)
    if isinstance(given, bool) or not isinstance(given, int | float):
        return _refuse(info, given)
    return _fitting_number(info, given)


def _fitting_number(info: ParameterInfo, given: float) -> float:
    if isinstance(given, float) and not math.isfinite(given):
        return _refuse(info, given)
    if info.kind is ParameterKind.INT and (given != int(given) or not -(2**63) <= given < 2**63):
        return _refuse(info, given)
    if info.kind is ParameterKind.FLOAT and abs(given) > 1.7976931348623157e308:
        return _refuse(info, given)
    value = int(given) if info.kind is ParameterKind.INT else float(given)
    if info.input and value:
        raise ElementError(
            f"parameter '{info.name}': an input is 0 unless it is excited (`silo excite`); nothing was changed"
        )
    low, high = info.minimum, info.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        return _refuse(info, given)
    if info.step and not _is_step(value - (low or 0), info.step):
        if not math.isfinite((value - (low or 0)) / info.step):
            return _refuse(info, given)
        begin, steps = low or 0, math.floor((value - (low or 0)) / info.step)
        beside = [begin + some * info.step for some in (steps, steps + 1)]
        near = [bound_text(float(f"{one:.12g}")) for one in beside if high is None or one <= high]
        return _refuse(info, given, f", as {' or '.join(near)}")
    return value


def _is_step(way: float, step: float) -> bool:
    if isinstance(way, int) and isinstance(step, int):
        return way % step == 0
    steps = way / step
    return math.isfinite(steps) and abs(steps - round(steps)) <= 1e-6 * max(1.0, abs(steps) * 1e-6)


def _refuse(info: ParameterInfo, given: object, near: str = "") -> float:
    unit = "" if info.unit in ("", "-") else f" {info.unit}"
    takes = range_text(info)
    if info.kind is ParameterKind.INT and isinstance(given, int) and not -(2**63) <= given < 2**63:
        takes += " of 64 bits with a sign (-2^63 to 2^63 - 1)"
    if info.kind is ParameterKind.STRING and isinstance(given, str) and not given.isprintable():
        takes += " without line breaks and other letters that can't be printed"
    raise ElementError(
        f"parameter '{info.name}': {shown(given)} doesn't fit, it takes {takes}{unit}{near}; nothing was changed"
    )


# ------------------------------------------------------------------------------------------------- in memory


def encoded(info: ParameterInfo, value: ParameterValue) -> bytes:
    """The words of a value that fits."""
    items: Sequence[ParameterScalar] = value if isinstance(value, tuple) else (value,)
    if info.kind is ParameterKind.FLOAT:
        data = struct.pack(f"={len(items)}d", *items)
    elif info.kind is ParameterKind.INT:
        data = struct.pack(f"={len(items)}q", *items)
    elif info.kind is ParameterKind.ENUM:
        data = struct.pack(f"={len(items)}q", *(info.choices.index(str(item)) for item in items))
    elif info.kind is ParameterKind.BOOL:
        data = bytes(map(bool, items))
    else:
        data = b"".join(str(item).encode().ljust(info.string_bytes, b"\0") for item in items)
    return data.ljust(info.words * WORD_BYTES, b"\0")


def decoded(info: ParameterInfo, data: bytes | memoryview) -> ParameterValue:
    """The value in some words."""
    count = info.count
    items: list[ParameterScalar]
    if info.kind is ParameterKind.FLOAT:
        items = list(struct.unpack_from(f"={count}d", data))
    elif info.kind in (ParameterKind.INT, ParameterKind.ENUM):
        items = list(struct.unpack_from(f"={count}q", data))
        if info.kind is ParameterKind.ENUM:
            items = [info.choices[int(item)] if 0 <= int(item) < len(info.choices) else str(item) for item in items]
    elif info.kind is ParameterKind.BOOL:
        items = [bool(item) for item in bytes(data[:count])]
    else:
        size = info.string_bytes
        parts = [bytes(data[place * size : (place + 1) * size]) for place in range(count)]
        items = [part.rstrip(b"\0").decode("utf-8", "replace") for part in parts]
    return tuple(items) if info.shape else items[0]
