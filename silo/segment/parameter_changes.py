"""Changes of parameters, recorded in the segment as marks are: what landed is as safe as a committed row.

    control      one line: bytes of texts ever begun
    slots        128 bytes each: number, tick, wall clock, when a ramp was over, which it is of those that landed, where
                 its text stands, number again
    texts        a ring of bytes: who, where and which parameters as JSON, the new words, the words before

A slot is opened when a change is accepted, and says so: `tick` waits. When it lands, the words before are copied to
their place, then the tick is stored: the commit word, one more than the index of the first row with the new values.
They land in another order than they are accepted: what the program sets itself overtakes what waits.
Only loggers with parameters have this part.

Of changes that are overwritten stays what they left: beside it, in a place of its own, stands an image of all words.

    control      one line: odd while it changes, how many it holds, ticks of the first and the last one, when that was,
                 the highest of their orders
    words        what all parameters were after these
    orders       of each parameter, the order of the change that it has its words of
"""

import itertools
import struct
import time
import zlib
from collections import deque
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import PARAMETER, LoggedEvent
from silo.core.tuning.parameters import (
    WORD_BYTES,
    Excitation,
    ParameterChange,
    ParameterInfo,
    decoded,
    encoded,
    value_text,
)
from silo.decoding import json_decoder

SLOTS = 1024  # the newest that are kept for readers; a power of two
SLOT = struct.Struct("@qqqqqqqqq48xq")  # see above, with sizes of head and words, and the checksum of both
SLOT_WORDS = SLOT.size // WORD_BYTES
LINE_WORDS = 8
MOST_LETTERS = 300  # of each text
TEXT_BYTES = 1 << 20
AREA_BYTES = WORD_BYTES * LINE_WORDS + SLOTS * SLOT.size + TEXT_BYTES
MOST_WORDS = 1 << 14  # of all parameters of a logger: the largest change takes a third of the texts

TICK, TIME, UNTIL, ORDER = 1, 2, 3, 4  # words of a slot
WAITS, REFUSED, STANDING = 0, -2, -1  # instead of a tick: not yet, never, while the logger stood still

TURN, FOLDED, FIRST, LAST, FOLDED_NS, HIGHEST = range(6)  # words of the image's control line
READS = 100  # of an image that changes meanwhile: then it is taken as it is, as its writer may be dead

MOST_NAMES = 4  # told in the text of an event


def image_bytes(infos: Sequence[ParameterInfo]) -> int:
    """What the image of these parameters takes."""
    return WORD_BYTES * (LINE_WORDS + len(infos) + sum(info.words for info in infos))


class _Head(msgspec.Struct, array_like=True):
    """The facts of a text; of what is no excitation there are four."""

    who: str
    where: str
    name: str
    places: list[int]
    excitation: Excitation | None = None


class OpenChange:
    """The slot of one change, from its acceptance to its end."""

    __slots__ = ("_at", "_old", "_record", "is_overwritten", "landed", "new", "place", "places")

    def __init__(
        self, record: "ChangeRecord", at: int, old: slice, place: int, places: Sequence[int], new: bytes
    ) -> None:
        self._record, self._at, self._old = record, at, old
        self.place, self.places, self.new = place, places, new
        self.landed: tuple[int, int, int] | None = None  # tick, wall clock and order
        self.is_overwritten = False

    def land(self, tick: int, old: bytes) -> None:
        """Commit it: the first row with the new values has this index, -1 while no rows come."""
        record = self._record
        order, time_ns = next(record.landed), time.time_ns()
        self.landed = tick, time_ns, order
        if self.is_overwritten:  # within this moment
            record.fold(self)
            return
        record.texts[self._old] = old
        record.words[self._at + ORDER] = order
        record.words[self._at + TIME] = time_ns
        record.words[self._at + TICK] = tick + 1 if tick >= 0 else STANDING

    def refuse(self) -> None:
        """It never comes."""
        if not self.is_overwritten:
            self._record.words[self._at + TICK] = REFUSED

    def end(self, tick: int) -> None:
        """The ramp is over."""
        if not self.is_overwritten:
            self._record.words[self._at + UNTIL] = tick + 1


class ChangeRecord:
    """The writer's end. Its caller sees to it that one thread at a time opens a change."""

    def __init__(self, area: memoryview, image: memoryview, infos: Sequence[ParameterInfo]) -> None:
        """Record in these bytes of a segment, zeros so far."""
        self.words = area.cast("q")
        self._slots = area[WORD_BYTES * LINE_WORDS :][: SLOTS * SLOT.size]
        self.texts = area[WORD_BYTES * LINE_WORDS + SLOTS * SLOT.size :]
        self._numbers, self.landed = itertools.count(1), itertools.count(1)
        self._place = 0
        self._kept: deque[OpenChange] = deque()  # those whose slot and text are not overwritten yet, the oldest first
        self._line = image.cast("q")[:LINE_WORDS]
        self._image = image[WORD_BYTES * LINE_WORDS :]
        self._parts = _parts(infos)
        self._orders = image[image_bytes(infos) - WORD_BYTES * len(infos) :].cast("q")
        for info, part in zip(infos, self._parts, strict=True):
            self._image[part] = encoded(info, info.value)
        self.begin = bytes(self._image[: self._parts[-1].stop if infos else 0])  # what they were when it was made

    def open(
        self, who: str, where: str, name: str, places: Sequence[int], new: bytes, excitation: Excitation | None = None
    ) -> OpenChange:
        """Note a change of the parameters at these places, that waits to land."""
        number = next(self._numbers)
        # whatever came in: the loop itself notes how an excitation ends, and no text pushes the other changes out
        facts = (who[:MOST_LETTERS], where[:MOST_LETTERS], name[:MOST_LETTERS], places)
        head = msgspec.json.encode(facts if excitation is None else (*facts, excitation))
        size = len(head) + 2 * len(new)
        if self._place % TEXT_BYTES + size > TEXT_BYTES:
            self._place += -self._place % TEXT_BYTES
        place, self._place = self._place, self._place + size
        while self._kept and (len(self._kept) == SLOTS or self._kept[0].place < self._place - TEXT_BYTES):
            oldest = self._kept.popleft()
            oldest.is_overwritten = True
            self.fold(oldest)
        self.words[0] = self._place  # first: whoever reads what is overwritten now can tell
        begin = place % TEXT_BYTES
        self.texts[begin : begin + len(head)] = head
        self.texts[begin + len(head) : begin + len(head) + len(new)] = new
        at = (number & (SLOTS - 1)) * SLOT.size
        check = zlib.crc32(new, zlib.crc32(head))
        SLOT.pack_into(self._slots, at, number, WAITS, 0, 0, 0, place, len(head), len(new), check, number)
        old = slice(begin + len(head) + len(new), begin + size)
        opened = OpenChange(self, LINE_WORDS + at // WORD_BYTES, old, place, places, new)
        self._kept.append(opened)
        return opened

    def fold(self, change: OpenChange) -> None:
        """Have the image hold what a change left, before it is overwritten, if it landed at a row."""
        if change.landed is None:
            return
        tick, time_ns, order = change.landed
        line = self._line
        line[TURN] += 1
        at = 0
        for place in change.places:
            part = self._parts[place]
            size = part.stop - part.start
            if order > self._orders[place] and tick >= 0:
                self._image[part] = change.new[at : at + size]
                self._orders[place] = order
            at += size
        if tick >= 0:
            line[FIRST] = min(line[FIRST], tick) if line[LAST] else tick
            line[LAST] = max(line[LAST], tick + 1)
            line[FOLDED_NS] = max(line[FOLDED_NS], time_ns)
        line[FOLDED] += 1
        line[HIGHEST] = max(line[HIGHEST], order)
        line[TURN] += 1


def _parts(infos: Sequence[ParameterInfo]) -> list[slice]:
    """Where each of these stands among the bytes of all."""
    ends = list(itertools.accumulate((WORD_BYTES * info.words for info in infos), initial=0))
    return [slice(begin, end) for begin, end in itertools.pairwise(ends)]


def read_image(
    words: NDArray[np.uint64], infos: Sequence[ParameterInfo], kept: Sequence[LoggedEvent], logger: str, run: str
) -> LoggedEvent | None:
    """What all parameters were once those changes had landed that are overwritten; None where none is.

    `kept` are those that are not, read before this: some of them may have landed between the others.
    """
    signed = words.view(np.int64)
    for _ in range(READS):
        before = int(signed[TURN])
        line, data, orders = signed[:LINE_WORDS].tolist(), words[LINE_WORDS:].tobytes(), signed[-len(infos) :].tolist()
        if not before % 2 and before == int(signed[TURN]):
            break
    if not line[LAST]:
        return None
    found = {info.name: decoded(info, data[part]) for info, part in zip(infos, _parts(infos), strict=True)}
    since = dict(zip(found, orders, strict=True))
    for event in kept:
        if event.change is not None and event.number < line[HIGHEST]:
            found |= {name: new for name, _, new in event.change.values if event.number > since[name]}
    values = tuple((name, None, value) for name, value in found.items())
    last = line[LAST] - 1
    change = ParameterChange(values, order=line[HIGHEST], span=last - line[FIRST])
    text = f"{_count(values)} after {line[FOLDED]:,} changes that are not kept"
    return LoggedEvent(PARAMETER, text, line[FOLDED_NS], last, who=logger, run=run, number=line[HIGHEST], change=change)


def _count(of: Sequence[object]) -> str:
    return "1 parameter" if len(of) == 1 else f"{len(of)} parameters"


def read_changes(
    words: NDArray[np.uint64], since: int, infos: Sequence[ParameterInfo], logger: str, run: str
) -> list[LoggedEvent]:
    """What landed after the first `since` changes, as far as the slots still hold it, in its order."""
    slots = words[LINE_WORDS : LINE_WORDS + SLOTS * SLOT_WORDS].reshape(-1, SLOT_WORDS).view(np.int64)
    copied = np.ascontiguousarray(slots[slots[:, ORDER] > since])
    unfinished = copied[copied[:, TICK] == WAITS, ORDER]  # comes next: what landed after it is told then
    if len(unfinished):
        copied = copied[copied[:, ORDER] < unfinished.min()]
    texts = words[LINE_WORDS + SLOTS * SLOT_WORDS :].view(np.uint8)
    found = [_event(row.tobytes(), words, texts, infos, logger, run) for row in copied[np.argsort(copied[:, ORDER])]]
    return [event for event in found if event is not None]


def _event(
    slot: bytes, words: NDArray[np.uint64], texts: NDArray[np.uint8], infos: Sequence[ParameterInfo], logger: str,
    run: str,
) -> LoggedEvent | None:  # fmt: skip
    number, tick, time_ns, until, order, place, head_bytes, new_bytes, check, again = SLOT.unpack(slot)
    if number != again or tick in (WAITS, REFUSED) or not 0 <= head_bytes + 2 * new_bytes <= TEXT_BYTES:
        return None
    begin = place % TEXT_BYTES
    data = texts[begin : begin + head_bytes + 2 * new_bytes].tobytes()
    if int(words[0]) - place > TEXT_BYTES:  # looked at after the copy: it may be another text by now
        return None
    head, new, old = data[:head_bytes], data[head_bytes:][:new_bytes], data[head_bytes + new_bytes :]
    if zlib.crc32(new, zlib.crc32(head)) != check:
        return None
    try:
        facts = json_decoder(_Head).decode(head)
        changed = [infos[one] for one in facts.places]
    except (msgspec.DecodeError, IndexError):
        return None
    at, values = 0, []
    for info in changed:
        size = info.words * WORD_BYTES
        values.append((info.name, decoded(info, old[at : at + size]), decoded(info, new[at : at + size])))
        at += size
    change = ParameterChange(tuple(values), facts.where, facts.name, until - 1, facts.excitation, order)
    text = change_text(change, {info.name: info.unit for info in changed})
    return LoggedEvent(
        PARAMETER, text, time_ns, max(tick - 1, -1), who=facts.who or logger, run=run, number=order, change=change
    )


def change_text(change: ParameterChange, units: dict[str, str]) -> str:
    """What changed, in words."""
    if change.excitation is not None:
        name, around, _ = change.values[0]
        what = f"{name.rpartition('/')[2]} excited around {value_text(around, units.get(name, '-'))}"
        return f"{what}: {change.excitation.text} ({change.where})"
    told = [
        f"{name.rpartition('/')[2]} {value_text(old)} -> {value_text(new, units.get(name, '-'))}"
        for name, old, new in change.values[:MOST_NAMES]
    ]
    more = len(change.values) - len(told)
    return ", ".join(told) + (f" and {more} more" if more else "") + (f" ({change.where})" if change.where else "")


def image_event(infos: Sequence[ParameterInfo], started_ns: int, logger: str, run: str) -> LoggedEvent:
    """What all parameters were at the first tick of a run."""
    change = ParameterChange(tuple((info.name, None, info.value) for info in infos), order=0)
    return LoggedEvent(PARAMETER, f"{_count(infos)} at the start", started_ns, 0, who=logger, run=run, change=change)
