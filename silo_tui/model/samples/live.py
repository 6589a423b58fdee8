"""The newest values of what is on the screen, and how they read in a cell."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from silo.core.arrays.columns import Floats
from silo.core.arrays.values import EXACT, numbers
from silo.core.elements import ElementInfo, Entry
from silo.core.names import component_name
from silo.rpc.frames import Frame
from silo.rpc.published import NotLive
from silo_tui.model.words import text
from silo_tui.model.words.text import Digits, digits_of

MIXED = frozenset({"pose", "twist", "angle_axis", "struct"})  # kinds whose entries have units of their own


class Reading(msgspec.Struct, frozen=True):
    """What is known of one element: the newest value per entry, NaN where none; texts where a float can't tell it.

    `reached` is how large entries were since they came on the screen: numbers are written for that, not for the newest.
    """

    newest: Floats
    texts: dict[int, str]
    held: int
    lost: int
    time_ns: int  # when the frame was made
    size: int | None = None  # of the recording's buffer, where the table says another by now; 0: it has none
    failed: int = 0  # ticks at which it could not be read
    why: NotLive | None = None  # why the newest value isn't of now, where it isn't
    reached: Floats | None = None

    def with_value(self, position: int, value: float) -> "Reading":
        """Return it with another value of an entry; as it is where that isn't known, or a float can't tell it."""
        if math.isnan(value) or position in self.texts or position >= len(self.newest):
            return self
        newest = self.newest.copy()
        newest[position] = value
        return msgspec.structs.replace(self, newest=newest)

    def reach(self, entries: slice = slice(None)) -> float:
        """Return how large some entries have been, of several their norm."""
        sizes = self.sizes[entries]
        return float(sizes[0] if len(sizes) == 1 else np.hypot.reduce(sizes))

    @property
    def sizes(self) -> Floats:
        """How large entries have been."""
        return _sizes(self.newest) if self.reached is None else self.reached


def _sizes(values: Floats) -> Floats:
    return np.where(np.isfinite(values), np.abs(values), 0.0)


class LiveValues(msgspec.Struct):
    """Readings by element name; only what is or was on the screen has one."""

    readings: dict[str, Reading] = msgspec.field(default_factory=dict)
    time_ns: int = 0

    def take(self, frame: Frame, entry_counts: Sequence[int]) -> None:
        """Take a frame over; `entry_counts` per element of the frame."""
        start = 0
        self.time_ns = frame.time_ns
        for position, (name, entries) in enumerate(zip(frame.elements, entry_counts, strict=True)):
            newest = frame.newest[start : start + entries]
            texts = {at - start: word for at, word in frame.texts.items() if start <= at < start + entries}
            start += entries
            if name in frame.unpublished:
                newest = np.full(entries, np.nan)
                texts = {}
            held, lost, size = int(frame.held[position]), int(frame.lost[position]), frame.sizes.get(position)
            failed = frame.failed.get(position, 0)
            why = frame.not_live.get(position)
            reached, old = _sizes(newest), self.readings.get(name)
            if old is not None and old.reached is not None and len(old.reached) == entries:
                reached = np.fmax(reached, old.reached)
            self.readings[name] = Reading(newest, texts, held, lost, frame.time_ns, size, failed, why, reached)

    def forget(self) -> None:
        """Forget what was read: after a new start it belongs to the run before."""
        self.readings.clear()


def entry_text(entry: Entry, value: float, word: str | None, width: int, digits: Digits | None = None) -> str:
    """Return one value as its type wants to be read: labels for enumerations, words for bool, text for strings.

    `word` is its text where a float can't tell it, `digits` are those of its row where they are known.
    """
    kind = entry.dtype[1:2]
    if kind in "SU":
        return text.cut(word or "", width)
    if word is None and np.isnan(value):
        return "nan" if kind in "fc" else "-"
    if entry.labels:
        number = int(word) if word else int(value)
        label = entry.labels.get(number)
        return text.cut(label, width) if label else f"{number}?"
    if kind == "b":
        return "true" if value else "false"
    if kind == "M" and word != "NaT":
        return text.cut(_moment(word or _date(entry.dtype, int(value))), width)
    if word is not None and (kind not in "ium" or word == "NaT"):
        return text.cut(word, width)
    if kind in "ium" and not (digits and digits.power):  # whole, unless its row has no room for that
        whole = word or (str(int(value)) if abs(value) < EXACT else "")  # beyond, its last digits are not known
        if 0 < len(whole) <= width:
            return whole
    value = float(word) if word else value
    return (digits or digits_of(abs(value), 0.0, width)).write(value, width)


def offset_text(entry: Entry, offset: float, base: int, width: int, digits: Digits | None = None) -> str:
    """Return a value of a column, which is an offset from a base; an exact one with all its digits, however wide."""
    value = offset + base
    kind = entry.dtype[1:2]
    if kind == "M" and math.isfinite(value):
        return entry_text(entry, value, _date(entry.dtype, base + int(offset)), width)
    if base and abs(offset) < EXACT:
        word = str(base + int(offset))
        return entry_text(entry, value, word, max(width, len(word)))
    return entry_text(entry, value, None, width, digits)


def value_words(entry: Entry, value: np.ndarray) -> str:
    """Return one value, shape `(1,)`, as it is read."""
    if value.dtype.kind in "SU":
        word = value[0]
        return text.clean(word.decode("utf-8", "backslashreplace") if isinstance(word, bytes) else str(word))
    found = numbers(value)
    return offset_text(entry, float(found.offsets[0]), found.base, 14)


def _date(dtype: str, count: int) -> str:
    """Return a moment as text: its type says in which unit it counts."""
    return str(np.array([count], "i8").view(dtype)[0])


def _moment(date: str) -> str:
    """Return a date and time, the time first where there is little room."""
    day, _, hours = str(np.datetime64(date).astype("datetime64[ms]")).partition("T")
    return f"{hours} {day}"


def value_text(element: ElementInfo, reading: Reading | None, width: int, digits: Digits | None = None) -> str:
    """Return the newest value of an element in one cell; several entries as a short list.

    Each of its numbers has the room of the widest, so that none moves, comes or goes when another gets a sign.
    """
    if reading is None:
        return "…"
    entries = element.entries
    if len(entries) == 1:
        return entry_text(entries[0], float(reading.newest[0]), reading.texts.get(0), width, digits)
    pieces: list[str] = []
    room = width
    sizes = reading.sizes.tolist()
    # those of one unit are written alike, others plainly where one of them is
    least = max(sizes) if has_norm(element) else min(0.1, max(sizes))
    for position, entry in enumerate(entries):
        value = float(reading.newest[position])
        word = reading.texts.get(position)
        is_number = word is None and entry.dtype[1:2] in "fiu" and not entry.labels
        if is_number:
            brief = digits_of(max(sizes[position], least), 0.0, text.BRIEF)
            is_whole = entry.dtype[1:2] in "iu" and abs(value) < 10 ** (text.BRIEF - 1)  # beside large ones no 0
            piece = entry_text(entry, value, None, text.BRIEF, None if is_whole else brief).rjust(text.BRIEF)
        else:
            piece = entry_text(entry, value, word, 8)
        rest = len(entries) - position - 1
        if len(piece) + (2 if rest else 0) > room:
            pieces.append("…")
            break
        pieces.append(piece)
        room -= len(piece) + 1
    return " ".join(pieces).lstrip()


def component_label(element: ElementInfo, chosen: int, width: int) -> str:
    """Return what stands before the norm (1) or one entry (2, 3 ...) of a vector, where that leaves it room."""
    called = "norm" if chosen == 1 else component_name(element.entries[chosen - 2].suffix)
    return f"{called} " if chosen == 1 or len(called) + 7 <= width else ""


def component_text(
    element: ElementInfo, reading: Reading, chosen: int, width: int, *, told: float = math.nan,
    digits: Digits | None = None,
) -> str:  # fmt: skip
    """Return the norm (1) or one entry (2, 3 ...) of a vector.

    `told` is the norm of the moment of what stands beside it, NaN where that isn't known; `digits` as of its row.
    """
    if chosen == 1:
        norm = float(np.sqrt(np.square(reading.newest).sum())) if math.isnan(told) else told
        return (digits or digits_of(norm, 0.0, width, signed=False)).write(norm, width)
    at = chosen - 2
    return entry_text(element.entries[at], float(reading.newest[at]), reading.texts.get(at), width, digits)


def cells_of_value(element: ElementInfo) -> int:
    """Return in how many cells the entries of a vector stand side by side, a scalar as wide as ever."""
    return (text.BRIEF + 1) * len(element.entries) - 1


def has_norm(element: ElementInfo) -> bool:
    """Return whether the norm of a vector says something: its entries are numbers of one unit."""
    numbers = all(entry.dtype[1:2] in "biuf" and not entry.labels for entry in element.entries)
    mixed = element.kind in MIXED or element.kind.startswith("vector_at_position")
    return len(element.entries) > 1 and numbers and not mixed


def fill_share(held: int, buffer_size: int) -> float:
    """Return how full a buffer is, 0 ... 1; a growing one may hold more than its first size."""
    return min(1.0, held / buffer_size) if buffer_size > 0 else 0.0
