"""How changes of parameters land: whole, at the end of a tick, in the thread of the loop.

What waits stands in a plain list, which `collect()` looks at: 7 ns, where an attribute takes 19 and two words 35. The
list outlives runs: a change that came while the logger stood still is not lost. Values live in a block of their own,
not in the segment, which changes at each start.
"""

import functools
import itertools
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.tuning.excitation import ENDED
from silo.core.tuning.parameters import WORD_BYTES, ParameterInfo, ParameterKind, ParameterValue, decoded, encoded
from silo.errors import reason
from silo.loop.sources import OwnMemory
from silo.parameters.excited import Excited
from silo.segment.parameter_changes import MOST_WORDS, ChangeRecord, OpenChange

MOST_AT_ONCE = 8  # changes that land in one tick
_NEVER_NS = 2.0**62  # longer than any program runs
_FAR = {ParameterKind.FLOAT: np.finfo(float).max, ParameterKind.INT: 2.0**62}  # a way that their own kind may not hold

CLOSED = "the program has closed it for now (log.parameters.lock())"
STANDS_STILL = "the logger stands still: nothing is recorded"
SET = "somebody set it"
BEFORE_BEGIN = "just before this began"
OVERTAKEN = "the program changed what belongs to it meanwhile: look at it and ask again"

log = logging.getLogger("silo")

ChangedPart: TypeAlias = tuple[ParameterInfo, slice]  # with the place of its words among those of a change


class Course(NamedTuple):
    """What of a change goes on over many ticks, from its old words to the new ones."""

    infos: tuple[ParameterInfo, ...]
    selection: slice | NDArray[np.int64]
    old: NDArray[np.int64]
    new: NDArray[np.int64]
    far: bool


@dataclass(eq=False)
class WaitingChange:
    """A change on its way. It is over once it `landed`, at `tick`, or was `refused`, in words."""

    token: int
    infos: tuple[ParameterInfo, ...]
    new: NDArray[np.int64]
    selection: slice | NDArray[np.int64]
    who: str
    where: str
    id: str = ""
    expects: Mapping[str, int] = field(default_factory=dict)  # by group, what landed there last
    own: bool = False  # of the program, which locks don't bind
    tick: int = -1
    landed: bool = False
    refused: str = ""
    old: NDArray[np.int64] | None = None
    ramp_ns: float = 0.0
    course: Course | None = None  # of one that goes on, as long as not all of it was set again
    at_ns: int = 0  # the stamp up to which it went,
    went_ns: int = 0  # and how long it has gone by now
    fraction: float = 0.0
    slot: OpenChange | None = None
    record: ChangeRecord | None = None
    excited: Excited | None = None  # it moves around what it is

    @functools.cached_property
    def parts(self) -> "list[ChangedPart]":
        """What it changes."""
        ends = list(itertools.accumulate(info.words for info in self.infos))
        return [(info, slice(end - info.words, end)) for info, end in zip(self.infos, ends, strict=True)]

    def goes_until(self, t: int) -> int:
        """Go on until this stamp; returns how long it has gone, ns.

        By what passes between two ticks, so that a clock that is set back, or begins anew, does not stop it.
        """
        self.went_ns += max(t - self.at_ns, 0)
        self.at_ns = t
        return self.went_ns


class Landing:
    """The values of all parameters of a logger, and the changes that wait for them."""

    def __init__(self) -> None:
        self.waiting: list[WaitingChange] = []
        self.infos: list[ParameterInfo] = []
        self.locked = False
        self.revision = 0
        self.record: ChangeRecord | None = None  # of the present run
        self.next_row: Callable[[], int] = _no_row
        self.last: dict[str, int] = {}  # by parameter, which change it has its value of
        self.landed: dict[str, int] = {}  # likewise by group
        self._places: dict[str, int] = {}
        self._tokens, self._revisions = itertools.count(1), itertools.count(1)
        self._recording = threading.RLock()
        self.block: OwnMemory | None = None
        self._words: NDArray[np.int64] = np.zeros(0, np.int64)
        self.used_words = 0  # that parameters have so far: the next one stands behind them

    def place(self, info: ParameterInfo) -> NDArray[np.int64]:
        """Give a new parameter its words, behind those before it, with its default in them."""
        if self.block is None:
            self.block = OwnMemory(MOST_WORDS * WORD_BYTES)
            self._words = np.ndarray((MOST_WORDS,), np.int64, self.block)
        self._places[info.name] = len(self.infos)
        self.infos.append(info)
        self.used_words = info.offset + info.words
        self._words[info.offset : self.used_words] = np.frombuffer(encoded(info, info.default), np.int64)
        return self._words[info.offset : self.used_words]

    def place_of(self, info: ParameterInfo, index: int) -> "memoryview[float]":
        """The memory of one number of a parameter."""
        place = self._words[info.offset + index :][:1].data.cast("B")
        return place.cast("d" if info.kind is ParameterKind.FLOAT else "q")  # type: ignore[return-value]

    def value(self, info: ParameterInfo) -> ParameterValue:
        """What a parameter is now."""
        return decoded(info, self._words[info.offset : info.offset + info.words].tobytes())

    def image(self) -> list[ParameterValue]:
        """What all of them are at one moment, whichever thread asks: no change lands between two of them."""
        while True:
            before, words = self.revision, self._words[: self.used_words].tobytes()
            if before == self.revision:
                return [decoded(info, memoryview(words)[info.offset * WORD_BYTES :]) for info in self.infos]

    def described(self) -> list[ParameterInfo]:
        """What each is, with its present value."""
        return [
            msgspec.structs.replace(info, value=value) for info, value in zip(self.infos, self.image(), strict=True)
        ]

    def begin_run(self, record: ChangeRecord | None, next_row: Callable[[], int], *, first: bool = True) -> None:
        """Record changes there from now on; `first`: with what landed since it was made, while the loop turned."""
        began = self._bytes()
        if record is not None and first:
            # nobody else notes anything there yet: it waits for none that notes a change elsewhere, as `post` does not
            self._record_late(record, record.begin, began)
        self.record, self.next_row = record, next_row
        if record is not None and first and (now := self._bytes()) != began:  # within this moment
            with self._recording:
                self._record_late(record, began, now)

    def _bytes(self) -> bytes:
        return self._words[: self.used_words].tobytes()

    def _record_late(self, record: ChangeRecord, before: bytes, now: bytes) -> None:
        """Have the first row of a record hold what is something else than it was before."""
        parts = [slice(WORD_BYTES * info.offset, WORD_BYTES * (info.offset + info.words)) for info in self.infos]
        late = [place for place, part in enumerate(parts) if before[part] != now[part] and part.stop <= len(before)]
        if late:
            old, new = (b"".join(words[parts[place]] for place in late) for words in (before, now))
            record.open("", BEFORE_BEGIN, "", late, new).land(0, old)

    def end_run(self, record: ChangeRecord | None) -> None:
        """Record there no more, unless another run began."""
        if self.record is record:
            self.record, self.next_row = None, _no_row

    def after(self) -> dict[str, ParameterValue]:
        """What they will be once all that waits has landed."""
        values = dict(zip((info.name for info in self.infos), self.image(), strict=True))
        for change in list(self.waiting):
            values |= {info.name: decoded(info, change.new[part].tobytes()) for info, part in self.going(change)}
        return values

    def going(self, change: WaitingChange) -> list[ChangedPart]:
        """What a change goes on changing: not what another one has set since it landed."""
        return [one for one in change.parts if not change.landed or self.last.get(one[0].name) == change.token]

    def expected(self, groups: set[str]) -> dict[str, int]:
        """By group, which change lands there last of those that are on their way, or landed last."""
        waiting = [one for one in list(self.waiting) if not one.landed]  # a ramp, and what is excited, has landed
        return {
            group: next(
                (one.token for one in reversed(waiting) if any(info.group == group for info in one.infos)),
                self.landed.get(group, 0),
            )
            for group in groups
        }

    def change(self, values: Mapping[str, ParameterValue], who: str, where: str, name: str = "") -> WaitingChange:
        """A change to values that fit, in the order of their words; it is not posted yet."""
        infos = tuple(self.infos[place] for place in sorted(self._places[one] for one in values))
        new = np.frombuffer(b"".join(encoded(info, values[info.name]) for info in infos), np.int64)
        first, last = infos[0], infos[-1]
        selection: slice | NDArray[np.int64] = slice(first.offset, last.offset + last.words)
        if last.offset + last.words - first.offset != len(new):
            selection = np.concatenate([np.arange(info.offset, info.offset + info.words) for info in infos])
        return WaitingChange(next(self._tokens), infos, new, selection, who, where, name)

    def post(self, change: WaitingChange) -> None:
        """Have a change land at the end of a tick; that notes it where another thread is noting one just now.

        It may have been interrupted there by a signal handler that waits for this thread.
        """
        if self._recording.acquire(blocking=False):
            try:
                self._open(change)
            finally:
                self._recording.release()
        self.waiting.append(change)

    def store(self, change: WaitingChange) -> None:
        """Store a change of the program's own, now: it holds from the next row on."""
        change.own = True
        self._open(change)
        self._store(change, self.next_row(), 0, ramps=False)

    def _open(self, change: WaitingChange) -> None:
        record = change.record = self.record
        if record is not None:
            going = self.going(change)
            places = [self._places[info.name] for info, _ in going]
            new = b"".join(change.new[part].tobytes() for _, part in going)
            what = change.excited.what if change.excited is not None else None
            with self._recording:
                change.slot = record.open(change.who, change.where, change.id, places, new, what)

    # --------------------------------------------------------------------------------- in the thread of the loop

    def land(self, n: int, t: int) -> None:
        """Called by `collect()` where something waits. `n` is the index of the first row with what lands, -1 without
        rows; `t` is the tick's time stamp.

        What can't be done ends itself and not the loop: it may come from anywhere.
        """
        waiting, place, landed, row = self.waiting, 0, 0, self.next_row()
        if row >= 0 and not 0 <= n <= row:
            n = row  # of the tick that was under way at a cut the next stretch has no row, nor of one before a start
        while place < len(waiting) and landed < MOST_AT_ONCE:
            change = waiting[place]
            landed += not change.landed
            try:
                over = self._go_on(change, n, t)
            except Exception as error:
                log.exception("a change of parameters can't be done")
                change.refused, over = f"it can't be done: {reason(error)}", True
                if change.excited is not None:
                    change.excited.drop(change.refused)
            if over:
                del waiting[place]
            else:
                place += 1

    def _go_on(self, change: WaitingChange, n: int, t: int) -> bool:
        if not change.landed:
            return self._decide(change, n, t)
        return self._ramp(change, n, t) if change.excited is None else self._excite(change, change.excited, n, t)

    def _decide(self, change: WaitingChange, n: int, t: int) -> bool:
        """Store it or refuse it. Returns whether it is over: a ramp goes on."""
        change.refused = self._why_refused(change, n)
        if change.refused:
            if change.slot is not None:
                change.slot.refuse()
            return True
        if change.record is not self.record or (change.slot is not None and change.slot.is_overwritten):
            # there was a start meanwhile, or more than there are slots for overtook it
            self._open(change)
        return self._store(change, n, t, ramps=True)

    def _why_refused(self, change: WaitingChange, n: int) -> str:
        if self.locked and any(info.locked for info in change.infos):
            return CLOSED
        if any(self.landed.get(group, 0) != token for group, token in change.expects.items()):
            return OVERTAKEN
        if change.excited is not None and not np.array_equal(self._words[change.selection], change.new):
            return OVERTAKEN
        if change.excited is not None:
            return STANDS_STILL if n < 0 else change.excited.why_ended()
        return ""

    def _store(self, change: WaitingChange, n: int, t: int, *, ramps: bool) -> bool:
        if change.old is None:  # else Ctrl-C came when it was stored already
            change.old = np.array(self._words[change.selection])
        if change.slot is not None:
            change.slot.land(n, change.old.tobytes())
        change.ramp_ns, far = _ramp_of(change) if ramps else (0.0, False)
        if change.ramp_ns:
            change.at_ns = t
            change.course = Course(change.infos, change.selection, change.old, change.new, far)
        else:
            self._words[change.selection] = change.new
        self.revision = next(self._revisions)
        for info in change.infos:
            self.last[info.name] = self.landed[info.group] = change.token
        for other in self.waiting:
            if other.course is not None and other is not change:
                other.course = self._left(other)
        change.tick = n
        change.landed = True
        return not change.ramp_ns

    def _ramp(self, change: WaitingChange, n: int, t: int) -> bool:
        """Go a step on the way to the new values, all of a change the same share of it, so that their ratios hold; what
        was set by another one meanwhile stays as that says.
        """
        course = change.course
        if course is not None and not (self.locked and not change.own and any(info.locked for info in course.infos)):
            change.fraction = max(change.fraction, min(1.0, change.goes_until(t) / change.ramp_ns))
            is_new = change.record is not self.record and n >= 0  # there was a start, or a cut, meanwhile
            found = np.array(self._words[course.selection]) if is_new else course.old
            there = between(course.infos, course.old, course.new, change.fraction, far=course.far)
            self._words[course.selection] = there  # at once: others read while the loop turns
            self.revision = next(self._revisions)
            if is_new:
                self._open(change)
                if change.slot is not None:
                    # where it is over now, the new run has no other tick of it
                    change.slot.land(n, (found if change.fraction >= 1.0 else there).tobytes())
            if change.fraction < 1.0:
                return False
        if change.slot is not None:
            change.slot.end(n)
        return True

    def _left(self, change: WaitingChange) -> Course | None:
        """What goes on of a change on its way: not what was set again; None for nothing."""
        going, old = self.going(change), change.old
        if not going or old is None:
            return None
        if change.course is not None and len(going) == len(change.course.infos):
            return change.course
        words = np.concatenate([np.arange(part.start, part.stop) for _, part in going])
        places = np.concatenate([np.arange(info.offset, info.offset + info.words) for info, _ in going])
        far = change.course is not None and change.course.far
        return Course(tuple(info for info, _ in going), places, old[words], change.new[words], far)

    def _excite(self, change: WaitingChange, excited: Excited, n: int, t: int) -> bool:
        """Go where its course has come to by now, and note its end."""
        if not self.going(change):
            excited.let_go(SET)
        elif self.locked and excited.info.locked:
            excited.end_soon(CLOSED)
        elif n < 0 or self.record is not change.record:
            excited.end_soon(STANDS_STILL)
        if not excited.go(change.goes_until(t) / 1e9):
            self.revision = next(self._revisions)
            return False
        self.revision = next(self._revisions)
        end = self.change({excited.info.name: self.value(excited.info)}, change.who, "")
        end.where = f"{ENDED}{excited.ended}"
        self._open(end)
        if end.slot is not None:
            end.slot.land(n, end.new.tobytes())
        excited.until = n
        return True


def between(
    infos: Sequence[ParameterInfo],
    old: NDArray[np.int64],
    new: NDArray[np.int64],
    fraction: float,
    *,
    far: bool = False,
) -> NDArray[np.int64]:
    """Words a part of the way from old to new values: numbers between them, all else as it was until the end.

    `far`: the way may be more than a number holds.
    """
    if fraction >= 1.0:
        return new
    found: NDArray[np.int64] = np.array(old)
    at = 0
    for info in infos:
        part = slice(at, at + info.words)
        at += info.words
        if info.kind is ParameterKind.FLOAT:
            a, b = old[part].view(np.float64), new[part].view(np.float64)
            found[part] = (_far_between(a, b, fraction) if far else a + fraction * (b - a)).view(np.int64)
        elif info.kind is ParameterKind.INT and far:
            made = np.rint(_far_between(old[part].astype(float), new[part].astype(float), fraction))
            found[part] = np.clip(made, -(2.0**63), np.nextafter(2.0**63, 0)).astype(np.int64)
        elif info.kind is ParameterKind.INT:
            found[part] = old[part] + np.rint(fraction * (new[part] - old[part])).astype(np.int64)
    return found


def _far_between(a: NDArray[np.float64], b: NDArray[np.float64], fraction: float) -> NDArray[np.float64]:
    return a * (1 - fraction) + b * fraction  # less exact, and never beyond what a float holds


def _ramp_of(change: WaitingChange) -> tuple[float, bool]:
    """How long a change takes that may go so many units per second, ns, and whether it goes far."""
    if change.excited is not None:
        return float(change.excited.what.duration_s * 1e9), False
    longest, far = 0.0, False
    for info, part in change.parts:
        if info.rate and change.old is not None:
            kind = np.float64 if info.kind is ParameterKind.FLOAT else np.int64
            with np.errstate(over="ignore"):
                way = change.new[part].view(kind).astype(float) - change.old[part].view(kind).astype(float)
                most = float(np.abs(way).max())
            longest, far = max(longest, most / info.rate), far or most > _FAR[info.kind]
    return float(round(min(longest * 1e9, _NEVER_NS))), far


def _no_row() -> int:
    return -1
