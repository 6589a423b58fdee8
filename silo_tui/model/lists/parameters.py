"""Parameters, as their screen shows them: rows of plain text, steps, why one can't be changed. Pure."""

import math
from collections.abc import Mapping, Sequence

from silo.core.elements import LoggedEvent
from silo.core.tuning.parameters import (
    ParameterInfo,
    ParameterKind,
    ParameterValue,
    Writable,
    fitting,
    range_text,
    value_text,
)
from silo.errors import ElementError
from silo_tui.model.words import text

NUMBERS = (ParameterKind.FLOAT, ParameterKind.INT)
FINE_SHARE = 100  # without a step of its own it goes in so many steps through its range
VALUE, BAR, DEFAULT = 15, 12, 9


def history(events: Sequence[LoggedEvent]) -> tuple[dict[str, ParameterValue], dict[str, LoggedEvent]]:
    """Return what each was when the newest run started, as far as that is told, and the newest change of each."""
    begun: dict[str, ParameterValue] = {}
    newest: dict[str, LoggedEvent] = {}
    told = [one for one in events if one.change is not None]
    run = told[-1].run if told else ""
    for event in told:
        if event.run != run or event.change is None:
            continue
        for name, old, new in event.change.values:
            if old is not None:
                newest[name] = event
            begun.setdefault(name, new if old is None else old)
    return begun, newest


def name_width(names: Sequence[str], width: int) -> int:
    """Return the cells of names: as many as the longest takes, where all else keeps its own."""
    return max(10, min(max(map(len, names), default=0), width - VALUE - BAR - DEFAULT - 20))


def head(width: int, name: int, preset: str = "") -> str:
    """Return the head of the list; with a preset its values stand where the defaults do."""
    beside = "preset" if preset else "default"
    return f"   {'parameter':<{name}} {'value':>{VALUE}} {'range':^{BAR}} {beside:>{DEFAULT}}  by"


def row(one: ParameterInfo, name: str, beside: ParameterValue | None, begun: ParameterValue | None, by: str) -> str:
    """Return a parameter as a line. `beside` is the default, or the value of a preset.

    A `*` says that it changed since the start, a `≠` that it isn't what stands beside it. The cursor and marks have
    the cells before it.
    """
    sign = "*" if begun is not None and begun != one.value else " "
    differs = "≠" if beside is not None and beside != one.value else " "
    value = text.cut(value_text(one.value, one.unit), VALUE)
    shown = "-" if beside is None else text.cut(value_text(beside), DEFAULT - 1)
    return f"  {sign}{name} {value:>{VALUE}} {range_bar(one)} {differs}{shown:>{DEFAULT - 1}}  {text.clean(by)}"


def range_bar(one: ParameterInfo) -> str:
    """Return where a value stands in its range, in cells; `|` is its default."""
    if one.kind is ParameterKind.ENUM and not one.shape:
        place = one.choices.index(str(one.value)) + 1 if one.value in one.choices else 0
        return f"{place} of {len(one.choices)}".center(BAR)
    low, high = one.minimum, one.maximum
    if one.kind not in NUMBERS or one.shape or low is None or high is None or high <= low:
        return " " * BAR
    cells = ["─"] * (BAR - 2)
    for value, sign in ((one.default, "|"), (one.value, "●")):
        share = (float(value) - low) / (high - low)  # type: ignore[arg-type]
        cells[round(min(1.0, max(0.0, share)) * (len(cells) - 1))] = sign
    return f"[{''.join(cells)}]"


def fine_step(one: ParameterInfo) -> float:
    """Return by how much an arrow moves a number."""
    if one.step:
        return one.step
    if one.kind is ParameterKind.INT:
        return 1
    if one.minimum is not None and one.maximum is not None:
        return (one.maximum - one.minimum) / FINE_SHARE
    size = max(abs(float(one.value)), abs(float(one.default)))  # type: ignore[arg-type]
    return 10.0 ** math.floor(math.log10(size)) / 10 if size else 0.1


def stepped(one: ParameterInfo, value: ParameterValue, steps: int) -> ParameterValue:
    """Return a value so many steps on, in its range; of words the next. Raises ElementError where there are none."""
    if one.shape or one.kind is ParameterKind.STRING:
        raise ElementError(f"{one.name} goes in no steps: type its value")
    if one.kind is ParameterKind.BOOL:
        return steps > 0
    if one.kind is ParameterKind.ENUM:
        place = one.choices.index(str(value)) + (1 if steps > 0 else -1)
        return one.choices[max(0, min(len(one.choices) - 1, place))]
    step = fine_step(one)
    from_ = float(one.minimum or 0.0)
    moved = from_ + (round((float(value) - from_) / step) + steps) * step  # type: ignore[arg-type]
    low, high = one.minimum, one.maximum
    if high is not None and moved > high:
        moved = from_ + math.floor((high - from_) / step + 1e-9) * step
    moved = max(moved, low) if low is not None else moved
    return fitting(one, round(moved) if one.kind is ParameterKind.INT else float(f"{moved:.12g}"))


def why_fixed(one: ParameterInfo, *, locked: bool) -> str:
    """Return why nobody can change a parameter here, with the way out; empty where that isn't known here."""
    name = one.name.rpartition("/")[2]
    if one.input:
        return f"{name} is an input, 0 unless it is excited (:excite, silo excite)"
    if one.writable is Writable.NO:
        return f"{name}: the program alone sets it (writable=False in log.parameter)"
    if locked and one.locked:
        return f"{name} is closed by the program for now (log.parameters.lock()): try again when it opens them"
    return ""


def about(one: ParameterInfo, *, locked: bool) -> str:
    """Return what is to be known of a parameter, in a line."""
    fixed = why_fixed(one, locked=locked)
    unit = "" if one.unit in ("", "-") else f" {one.unit}"
    remote = " │ set on the robot alone" if one.writable is Writable.HERE else ""
    return " │ ".join(filter(None, [fixed, text.clean(one.description), f"{range_text(one)}{unit}"])) + (
        "" if fixed or one.input else remote
    )


def differences(
    infos: Sequence[ParameterInfo], values: Mapping[str, ParameterValue], short: Mapping[str, str]
) -> dict[str, tuple[str, ParameterValue]]:
    """Return of values those that aren't so now, by name, each with its line for a question."""
    known = {one.name: one for one in infos}
    return {
        name: (f"{short[name]}: {value_text(known[name].value)} -> {value_text(value, known[name].unit)}", value)
        for name, value in values.items()
        if name in known and known[name].value != value
    }
