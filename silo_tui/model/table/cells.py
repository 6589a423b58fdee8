"""How the cells of the element table read: words and style, of what a logger or a file tells of an element."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from silo.conditions.standing import SIDES, LimitStatus, LimitWord
from silo.core.elements import SLOW_SHARE, BufferType, ElementInfo
from silo.live.quantities import FROZEN
from silo.rpc.published import NotLive
from silo_tui.model.samples.live import (
    LiveValues,
    Reading,
    component_label,
    component_text,
    entry_text,
    fill_share,
    value_text,
)
from silo_tui.model.table.facts import BAD, LIMIT_BITS, worst, worst_of
from silo_tui.model.table.fields import Field, word_for
from silo_tui.model.table.state import Rows, TableState
from silo_tui.model.words import text
from silo_tui.model.words.states import FULL, OLD

if TYPE_CHECKING:
    from silo.analysis.reports import ElementReport

SPAN_WIDE = 16
UNSEEN = ">"  # before how long ago a value changed, where that was not seen
ENTRY = 5  # cells of an entry among others at least, with the blank before it
WHY_NOT_LIVE: dict[NotLive | None, str] = {
    NotLive.ABSENT: "not begun", NotLive.FULL: "buffer full", NotLive.LIMIT: "mem limit", NotLive.OTHER: "not live",
}  # fmt: skip
NOT_OF_DERIVED = (Field.ACTION, Field.BUFFER, Field.SIZE)
_OF_LIMITS = sum(set(LIMIT_BITS.values()))
_OF_BOUNDS = _OF_LIMITS & ~FROZEN

Cell = tuple[str, str]  # words, and the name of their style
WAITS: Cell = "wait", "quiet"  # its first reading is on the way; `…` says that there is more than has room


class Sight(msgspec.Struct):
    """What cells are drawn from. `at_s` is the moment of a file that is shown, `reports` what the file tells.

    `component` returns what is shown of a vector (`RowList.component`), `trend` the newest columns, drawn; `widths` are
    of columns that get other room than they ask for, 0 for none. All numbers of a row are written for the narrowest of
    their columns, which has `room` cells; that of values has `value_room`.
    """

    table: TableState
    live: LiveValues
    component: Callable[[int], int]
    trend: Callable[[int], str]
    reports: "Mapping[str, ElementReport]" = msgspec.field(default_factory=dict)
    at_s: float | None = None
    fresh: bool = True
    running: bool = True
    widths: dict[str, int] = msgspec.field(default_factory=dict)
    room: int = 11
    value_room: int = 11
    digits_fewer: int = 0  # on a thin link
    statistics: bool = True  # whether they are shown: digits don't hang on those that others left
    ends: dict[tuple[str, int], list[float]] = msgspec.field(default_factory=dict)  # of numbers, as last measured
    written: dict[tuple[int, int, bool], text.Digits] = msgspec.field(default_factory=dict)  # how numbers of a line are

    def entry_name(self, row: int, entry: int) -> str:
        """Return the full name of an entry."""
        element = self.table.elements[row]
        return element.name + element.entries[entry].suffix

    def shown_name(self, row: int) -> str:
        """Return of what the row tells: the element, or the entry of it that was chosen."""
        chosen = self.component(row)
        return self.entry_name(row, chosen - 2) if chosen >= 2 else self.table.names[row]

    def report(self, row: int) -> "ElementReport":
        """Return what the file tells of an element."""
        return self.reports[self.table.names[row]]


def _cut(words: str, width: int) -> Cell:
    return text.cut(words, width), "quiet"


# ------------------------------------------------------------------------------------------- settings, facts of files


def unit(sight: Sight, row: int, width: int) -> Cell:
    """Return the unit; nothing where there is none. One without room is a sign alone: `kg m^` would be another."""
    word = sight.table.elements[row].unit
    return ("" if word == "-" else word if len(word) <= width else "…"), "quiet"


def option(field: Field) -> Callable[[Sight, int, int], Cell]:
    """Return what draws a field in its words."""
    return lambda sight, row, width: (
        "-" if _left_out(sight, row, field) else word_for(field, sight.table.value(field, row)), ""
    )  # fmt: skip


def number(field: Field) -> Callable[[Sight, int, int], Cell]:
    """Return what draws a field as a number, shorter where it must be: a number that is cut would be another one."""

    def draw(sight: Sight, row: int, width: int) -> Cell:
        if _left_out(sight, row, field):
            return "-", ""
        value = sight.table.value(field, row)
        shorter = str(value), text.compact(float(value)), text.short(value, 1)
        return next((word for word in shorter if len(word) <= width), shorter[-1]), ""

    return draw


def _left_out(sight: Sight, row: int, field: Field) -> bool:
    return field in NOT_OF_DERIVED and row >= sight.table.own


def samples(sight: Sight, row: int, width: int) -> Cell:
    """Return how many samples a file has."""
    count = sight.report(row).samples
    return _cut(str(count) if count < 10**7 else text.compact(count), width)


def span(sight: Sight, row: int, width: int) -> Cell:
    """Return from when to when, or how long."""
    return _cut(span_words(sight.report(row), width), width)


def span_words(report: "ElementReport", width: int = SPAN_WIDE) -> str:
    """Return `40.95 … 51.14`, or how long that is."""
    if report.start_s is None or report.end_s is None:
        return "-"
    if width >= SPAN_WIDE:
        return " … ".join(text.row(report.start_s, report.end_s, width=(width - 3) // 2))
    return text.short(report.end_s - report.start_s)


def type_word(element: ElementInfo, report: "ElementReport") -> str:
    """Return `float64[7]`, `enum`."""
    is_enum = bool(element.entries) and all(entry.labels for entry in element.entries)
    return report.type.replace(report.type.split("[", 1)[0], "enum") if is_enum else report.type


def type_cell(sight: Sight, row: int, width: int) -> Cell:
    """Return `f64[12]` for `float64[12]`, because a cell is small."""
    words = type_word(sight.table.elements[row], sight.report(row))
    for long, short in (("uint", "u"), ("int", "i"), ("float", "f"), ("complex", "c"), ("datetime", "date")):
        words = words.replace(long, short)
    return _cut(words, width)


def lost(sight: Sight, row: int, width: int) -> Cell:
    """Return how many samples a file lacks."""
    count = sight.report(row).lost
    return _cut(str(count), width)[0], "conflict" if count else "quiet"


# ------------------------------------------------------------------------------------------------- what is measured


def fill(sight: Sight, row: int, width: int) -> Cell:
    """Return how full the buffer is; nothing where that isn't known."""
    table = sight.table
    reading = sight.live.readings.get(table.names[row])
    if not table.server[Field.ENABLED, row] or reading is None or reading.size == 0:
        return "", ""
    share = fill_share(reading.held, reading.size or int(table.server[Field.SIZE, row]))
    stopped = share >= 1 and int(table.server[Field.BUFFER, row]) == BufferType.FIXED
    return f"{100 * share:.0f}%", "lost" if reading.lost or reading.failed else "full" if stopped else "quiet"


def _reading(sight: Sight, row: int) -> Reading | Cell:
    """Return the newest reading, or why there is none."""
    reading = sight.live.readings.get(sight.table.names[row])
    if sight.at_s is not None:
        return WAITS if reading is None else reading if reading.held else ("-", "quiet")
    if not sight.table.server[Field.ENABLED, row]:
        return "off", "quiet"
    if reading is None or not reading.held:
        return WAITS if sight.running and sight.fresh else ("-", "quiet")
    if sight.running and is_old(reading) and not reading.texts and all(map(math.isnan, reading.newest)):
        return WHY_NOT_LIVE[reading.why], "quiet"
    return reading


def is_old(reading: Reading | None) -> bool:
    """Return whether a value is the last that was kept, and not the one of now."""
    return reading is not None and reading.why in WHY_NOT_LIVE


def _value_style(sight: Sight, reading: Reading) -> str:
    is_now = sight.fresh and sight.running and not is_old(reading)
    return "value" if sight.at_s is not None or is_now else "stale"


def value(sight: Sight, row: int, width: int) -> Cell:
    """Return the newest value, or why there is none: all entries of a vector, or the chosen one, or its norm.

    Where statistics stand beside it, or rows are ordered by it, it is of the moment of these.
    """
    reading, element, chosen = _reading(sight, row), sight.table.elements[row], sight.component(row)
    if reading == WAITS and len(element.entries) == 1:  # a survey may have it before the first picture of the row
        surveyed = _as_shown(sight.table, row, Reading(np.array([math.nan]), {}, 1, 0, 0))
        reading = reading if math.isnan(surveyed.newest[0]) else surveyed
    if isinstance(reading, tuple):
        return reading
    told = sight.table.facts.detail(sight.shown_name(row), "value")
    if len(element.entries) == 1:
        reading = _as_shown(sight.table, row, reading)
    elif chosen >= 2:
        reading = reading.with_value(chosen - 2, told)
    if chosen:
        label = component_label(element, chosen, width)
        written = digits(sight, row, chosen)
        words = label + component_text(element, reading, chosen, width - len(label), told=told, digits=written)
        return words, _value_style(sight, reading)
    if len(element.entries) > 1:
        for entry in range(min(len(element.entries), width // ENTRY + 1)):
            reading = reading.with_value(entry, sight.table.facts.detail(sight.entry_name(row, entry), "value"))
    alone = digits(sight, row, 0) if len(element.entries) == 1 else None
    return value_text(element, reading, width, alone), _value_style(sight, reading)


def _as_shown(table: TableState, row: int, reading: Reading) -> Reading:
    """Return the reading of a scalar with the number that its row shows: of the moment of what stands beside it, or,
    before that was measured, that by which it came on the screen.
    """
    told, surveyed = table.facts.detail(table.names[row], "value"), table.facts.of("value", len(table))
    return reading.with_value(0, float(surveyed[row]) if math.isnan(told) and surveyed is not None else told)


def value_head(sight: Sight, width: int) -> str:
    """Return the title, of a file at which time that is, in as many digits as have room: `at 107 s`, `107 s`."""
    if sight.at_s is None:
        return "value"
    at_s = [text.short(sight.at_s, digits) for digits in range(6, 0, -1)]
    told = [*(f"at {words} s" for words in at_s[:4]), *(f"{words} s" for words in at_s)]
    return next((words for words in told if len(words) <= width), told[-1])


def digits(sight: Sight, row: int, chosen: int, *, alone: bool = False) -> text.Digits:
    """Return how value and statistics of a row are written: of all entries of a vector (0), its norm (1), or one entry.

    That is for what these were since statistics began; without such for how large values have been. `alone`: the entry
    has a line of its own, without its name before the value.
    """
    key = row, chosen, alone
    if key not in sight.written:
        sight.written[key] = _digits(sight, row, chosen, alone=alone)
    return sight.written[key]


def _digits(sight: Sight, row: int, chosen: int, *, alone: bool) -> text.Digits:
    element, facts, name = sight.table.elements[row], sight.table.facts, _told_of(sight, row, chosen)
    is_vector = len(element.entries) > 1
    ends = [facts.detail(name, each) for each in (("least", "most") if is_vector and not chosen else ("min", "max"))]
    label = component_label(element, chosen, sight.value_room) if chosen and is_vector and not alone else ""
    room = max(6, min(sight.room, sight.value_room - len(label)) - sight.digits_fewer)
    integer = chosen != 1 and element.entries[max(0, chosen - 2)].dtype[1:2] in "iu"
    if not sight.statistics:
        ends = [math.nan, math.nan]
    if all(map(math.isfinite, ends)):
        sight.ends[name, chosen] = ends
    ends = sight.ends.get((name, chosen), ends)  # what comes on the screen again reads as it did
    if all(map(math.isfinite, ends)):
        return text.digits_for(ends, room, integer=integer)
    if integer:
        return text.Digits()  # nothing stands beside it: whole, where its own cell has room for that
    sizes = [abs(end) for end in ends if math.isfinite(end)]
    if (reading := sight.live.readings.get(element.name)) is not None:
        sizes.append(reading.reach(slice(chosen - 2, chosen - 1) if chosen >= 2 else slice(None)))
    return text.digits_of(max(sizes, default=0.0), 0.0, room, signed=chosen != 1)


def _told_of(sight: Sight, row: int, chosen: int) -> str:
    """Return the name by which the measured of an element (0), of its norm (1) or of one of its entries is known."""
    return sight.entry_name(row, chosen - 2) if chosen >= 2 else sight.table.names[row]


def entry_value(sight: Sight, row: int, entry: int, width: int) -> Cell:
    """Return the newest value of an entry that has a line of its own."""
    reading = _reading(sight, row)
    if isinstance(reading, tuple):
        return reading
    reading = reading.with_value(entry, sight.table.facts.detail(sight.entry_name(row, entry), "value"))
    written = digits(sight, row, entry + 2, alone=True)
    words = component_text(sight.table.elements[row], reading, entry + 2, width, digits=written)
    return words, _value_style(sight, reading)


def trend(sight: Sight, row: int, width: int) -> Cell:
    """Return the newest columns of the first entry, drawn."""
    return sight.trend(row), "trend" if sight.at_s is not None or sight.fresh else "stale"


def sign(sight: Sight, row: int, width: int) -> Cell:
    """Return the worst that is the matter."""
    if not sight.fresh and sight.live.readings:
        return OLD, "quiet"
    reading = _reading(sight, row)
    word = sign_of(sight.table, row, None if isinstance(reading, tuple) else reading)
    is_meant = not isinstance(reading, tuple) and word == FULL and reading.why is NotLive.FULL
    return word, "quiet" if is_meant else _style(word)


def sign_of(table: TableState, row: int, reading: Reading | None = None) -> str:
    """Return the word of the worst that is the matter with a row; empty for nothing.

    Limits are judged once a second; beside a number the sign is that of the number, and of one that is old that it is.
    """
    bits, one = int(table.signs[row]), table.limits.get(table.names[row])
    if not table.server[Field.ENABLED, row]:
        return worst(bits & _OF_LIMITS)  # what is off isn't measured; its limits may be judged by others
    if one is not None and reading is not None:
        bits = bits & ~_OF_BOUNDS | LIMIT_BITS.get(limit_word_shown(table, row, one, reading).value, 0)
    is_full = reading is not None and reading.why in (NotLive.FULL, NotLive.LIMIT)
    return worst(bits) or (FULL if is_full else OLD if is_old(reading) else "")


def limit_word_shown(table: TableState, row: int, one: LimitStatus, reading: Reading) -> LimitWord:
    """Return the range of the number that a row shows of a scalar with limits."""
    return one.word_of(float(_as_shown(table, row, reading).newest[0]))


def branch_sign(sight: Sight, rows: Rows) -> Cell:
    """Return the worst sign below a branch, and how many have it; nothing stands beside it."""
    word, count = worst_of(sight.table.signs[rows])
    return (f"{word} {count} of {len(rows)}" if word else ""), _style(word)


def _style(word: str) -> str:
    # where rows are reversed a blank shows its colour
    return "lost" if word in BAD else "caution" if word else ""


def statistic(sight: Sight, row: int, width: int, title: str) -> Cell:
    """Return a statistic of one number, of a vector that of the norm or the entry that was asked for.

    Beside all its entries stand the smallest and the largest of any of them.
    """
    chosen = sight.component(row)
    if len(sight.table.elements[row].entries) == 1 or chosen:
        return _number(sight, row, chosen, title, width)
    quantity = {"min": "least", "max": "most"}.get(title)
    return ("-", "quiet") if quantity is None or sight.table.mixed[row] else _number(sight, row, 0, quantity, width)


def entry_statistic(sight: Sight, row: int, entry: int, width: int, title: str) -> Cell:
    """Return a statistic of an entry that has a line of its own."""
    return _number(sight, row, entry + 2, title, width, alone=True)


def _number(sight: Sight, row: int, chosen: int, quantity: str, width: int, *, alone: bool = False) -> Cell:
    name = _told_of(sight, row, chosen)
    found = sight.table.facts.detail(name, quantity)
    if math.isnan(found):
        return "-", "quiet"
    entry = None if chosen == 1 else sight.table.elements[row].entries[max(0, chosen - 2)]
    written = digits(sight, row, chosen, alone=alone)
    if entry is not None and (entry.labels or entry.dtype[1:2] == "b"):
        if quantity in {"min", "max"} and found == int(found):
            return entry_text(entry, found, None, width), "quiet"
        if entry.labels:
            return "-", "quiet"  # between two labels is nothing
    if entry is not None and quantity not in {"mean", "std"} and math.isfinite(found):
        return entry_text(entry, found, None, width, written), "quiet"
    if quantity == "std" and 0 < found < written.step / 2:
        written = text.digits_of(found, 0.0, width, signed=False)  # 0, or 0.000e18, would say that there is none
    return written.write(found, width), "quiet"


def noise(sight: Sight, row: int, width: int) -> Cell:
    """Return how many times the noise of the median of its siblings it has."""
    found = sight.table.noise[row]
    return ("-" if math.isnan(found) else f"{found:.1f}" if found < 1e6 else text.short(found, 3)), "quiet"


def limit(sight: Sight, row: int, width: int) -> Cell:
    """Return how far the value is from the limit that it meets first, and which that is; of a vector of the entry that
    is the nearest. Where there is little room digits go, then the word between, then the limit: no number is cut.
    """
    reading, element, table = _reading(sight, row), sight.table.elements[row], sight.table
    if isinstance(reading, tuple):
        return reading
    if len(element.entries) == 1:
        reading = _as_shown(table, row, reading)
    given = [(value, table.limits.get(sight.entry_name(row, at))) for at, value in enumerate(reading.newest.tolist())]
    bounded = [(one.share_left(value), one.closest(value)) for value, one in given if one and not math.isnan(value)]
    _, found = min(bounded, key=lambda each: each[0], default=(math.nan, None))
    if found is None:
        return "-", "quiet"
    word, bound, left = found
    side = "to" if left >= 0 else "over" if SIDES[word] > 0 else "under"
    told = f"{word.value} {text.short(bound)}"
    most, least = text.short(abs(left), 3), text.short(abs(left), 2)
    ways = (f"{most} {side} {told}", f"{least} {side} {told}", f"{least} {told}", f"{least} {side} {word.value}")
    return next((each for each in ways if len(each) <= width), ways[-1]), "quiet"


def rate(sight: Sight, row: int, width: int) -> Cell:
    """Return how often samples come, in Hz."""
    found = sight.table.facts.detail(sight.table.names[row], "rate")
    return ("" if math.isnan(found) else text.short(found)), "quiet"


def share(sight: Sight, row: int, width: int) -> Cell:
    """Return how much of the nominal rate that is."""
    found = sight.table.facts.detail(sight.table.names[row], "share")
    return ("" if math.isnan(found) else f"{100 * found:.0f}%"), "caution" if found < SLOW_SHARE else "quiet"


def _of_shown(sight: Sight, row: int, quantity: str) -> float:
    """Return a quantity of the entry that is shown where that is known, else of the element."""
    facts = sight.table.facts
    found = facts.detail(sight.shown_name(row), quantity)
    return facts.detail(sight.table.names[row], quantity) if math.isnan(found) else found


def jitter(sight: Sight, row: int, width: int) -> Cell:
    """Return how far samples are off their time."""
    seconds = _of_shown(sight, row, "jitter")
    return ("" if math.isnan(seconds) else text.span(seconds, 2)), "quiet"


def changed(sight: Sight, row: int, width: int) -> Cell:
    """Return how long ago a value changed; `>14 s` where nobody saw that: it is looked at for so long."""
    seconds, unseen = _of_shown(sight, row, "changed"), _of_shown(sight, row, "change_seen") == 0
    return ("" if math.isnan(seconds) else UNSEEN * unseen + text.span(seconds, 2)), "quiet"
