"""Pins: copies of what the buffers held of some names for a span of time, so that one can look at it in peace.

A pin lives under a lease and not under its client's connection: it survives a link that is cut for a while, and a new
start of the logger. `Pins` may be used by all threads; what a pin holds never changes.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from silo.core.quantities.writing import duration
from silo.history.picking import PinnedRows, RingGroup, RowSelection, blocks, bounds, check_known, pick
from silo.history.requests import By, OpenPin, PinOpened
from silo.history.samples import MAX_NAMES
from silo.net.keys import VIEW_ID, check_own, client_of_view
from silo.rpc.leases import Lease, Leases, strange_part
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows, Words
from silo.state.replica import LoggerSnapshot

LEASE_S = 30.0
MAX_PINS = 64
MAX_PINNED_BYTES = 64 * 2**20  # of all clients together


@dataclass(frozen=True)
class _Pin:
    request: OpenPin
    opened: PinOpened
    rows: PinnedRows | None


class Pins(Leases[str, _Pin]):
    """All pins of all clients."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, knows: Callable[[str], bool] | None = None) -> None:
        super().__init__(MAX_PINS, clock=clock, knows=knows)

    def open(self, request: OpenPin, now: LoggerSnapshot, reader: SegmentReader | None) -> PinOpened:
        """Copy what is wanted; the same request again only renews the lease. Called by the slow thread alone."""
        _check(request)
        check_own("pin", request.pin, request.proof)
        known = self.get(request.pin)
        if known is not None and _same(known.request, request):
            self.renew(request.pin, LEASE_S)
            return known.opened
        check_known(request.names, now)
        owner = client_of_view(request.pin)
        if full := self.full(request.pin, owner):
            text = f"not pinned: {full[0]} pins are open already; close others first"
            raise RequestRefusedError(RefusedWhy.FAILED, text)
        room = MAX_PINNED_BYTES - _size_bytes(self.all(but=request.pin))
        strangers = self.strangers_beside(request.pin, owner)
        if strangers is not None:
            room = min(room, strange_part(MAX_PINNED_BYTES) - _size_bytes(strangers))
        opened, rows = _copied(request, now, reader, room)
        self.set(request.pin, _Pin(request, opened, rows), LEASE_S, owner)
        return opened

    def keep(self, pin: str, proof: str) -> None:
        """Renew a lease. Raises RequestRefusedError for a pin that is no more, or another one's."""
        check_own("pin", pin, proof)
        if self.renew(pin, LEASE_S) is None:
            raise _no_pin(pin)

    def close_for(self, pin: str, proof: str) -> str:
        """Forget a pin of who asks; one that is no more is fine. Raises RequestRefusedError for that of another one."""
        check_own("pin", pin, proof)
        self.drop(pin)
        return "the pin is closed"

    def rows(self, pin: str) -> PinnedRows | None:
        """Return what a pin holds, None for nothing. Raises RequestRefusedError for a pin that is no more."""
        known = self.get(pin)
        if known is None:
            raise _no_pin(pin)
        return known.rows


def _size_bytes(pins: list[Lease[str, _Pin]]) -> int:
    return sum(one.value.opened.size_bytes for one in pins)


def _no_pin(pin: str) -> RequestRefusedError:
    return RequestRefusedError(
        RefusedWhy.NOT_FOUND, f"the pin '{pin[:50]}' is no more: its lease of {LEASE_S:g} s ended; pin again"
    )


def _check(request: OpenPin) -> None:
    problem = None
    if not VIEW_ID.fullmatch(request.pin):
        problem = "its id must be `<client id>-<number>`, the client id of letters and digits"
    elif not request.names or len(request.names) > MAX_NAMES:
        problem = f"name 1 to {MAX_NAMES} elements or entries, got {len(request.names)}"
    elif not -(2**62) < request.start_ns <= request.end_ns < 2**62:
        problem = f"the time span {request.start_ns} ... {request.end_ns} ns is out of range, or goes backwards"
    if problem:
        raise RequestRefusedError(RefusedWhy.INVALID, f"not pinned: {problem}")


def _same(old: OpenPin, new: OpenPin) -> bool:
    return (old.names, old.start_ns, old.end_ns) == (new.names, new.start_ns, new.end_ns)


def _copied(
    request: OpenPin, now: LoggerSnapshot, reader: SegmentReader | None, room: int
) -> tuple[PinOpened, PinnedRows | None]:
    found = pick(request.names, now, reader.schema if reader is not None else None)
    if reader is None or not found.groups:
        return PinOpened(request.pin, "", 0, 0, 0, found.missing), None
    start_ns, text = _fitting(request, found, reader, room)
    if start_ns is None:
        raise RequestRefusedError(RefusedWhy.FAILED, text)
    copied: dict[int, tuple[Words, Rows]] = {}
    # what will be overwritten first is copied first, its oldest rows before the others
    for stretch in sorted(
        _stretches(reader, found, start_ns, request.end_ns), key=lambda stretch: stretch.spare_s(reader)
    ):
        copied[stretch.group.ring] = stretch.group.words, _copy(reader, stretch)
    rows = PinnedRows(reader.schema, copied)
    begin_ns, end_ns = rows.span_ns()
    oldest_ns = min([some for some in (begin_ns, _oldest_ns(reader, found)) if some], default=0)
    return PinOpened(
        request.pin, reader.schema.run, begin_ns, end_ns, rows.size_bytes, found.missing, text, oldest_ns
    ), rows


@dataclass(frozen=True)
class _Stretch:
    """Rows `begin` to before `end` of one ring, and which of their words are copied."""

    group: RingGroup
    begin: int
    end: int

    @property
    def size_bytes(self) -> int:
        return self.group.row_bytes * (self.end - self.begin)

    def spare_s(self, reader: SegmentReader) -> float:
        """How long the oldest of its rows has until it is overwritten."""
        ring = reader.schema.rings[self.group.ring]
        return (self.begin + ring.capacity - reader.head(self.group.ring)) * ring.divider / reader.schema.frequency_hz


def _stretches(reader: SegmentReader, found: RowSelection, start_ns: int, end_ns: int) -> list[_Stretch]:
    """What is copied, of each ring one stretch: all words of its groups, of the rows that any of them wants.

    A ring may have two groups: one element has all its samples there, another one those after its own buffer was full.
    """
    merged: dict[int, _Stretch] = {}
    for group in found.groups:
        one = _Stretch(group, *bounds(reader, group, start_ns, end_ns + 1, By.TIME))
        known = merged.get(group.ring)
        merged[group.ring] = one if known is None else _merged(known, one)
    return list(merged.values())


def _merged(one: _Stretch, other: _Stretch) -> _Stretch:
    spans = [stretch for stretch in (one, other) if stretch.begin < stretch.end] or [one]
    words = np.union1d(one.group.words, other.group.words)
    begin, end = min(stretch.begin for stretch in spans), max(stretch.end for stretch in spans)
    return _Stretch(RingGroup(one.group.ring, -1, words), begin, end)


def _oldest_ns(reader: SegmentReader, found: RowSelection) -> int:
    """The oldest time stamp that the buffers hold of any of them, 0 where they hold none."""
    oldest = [reader.rows(group.ring, 0, 1) for group in found.groups]
    return min((int(rows.time_ns[0]) for rows in oldest if len(rows)), default=0)


def _fitting(request: OpenPin, found: RowSelection, reader: SegmentReader, room: int) -> tuple[int | None, str]:
    """From when on the rows fit into `room` bytes, and what is to be said of it; None where nothing fits."""
    stretches = _stretches(reader, found, request.start_ns, request.end_ns)
    total = sum(stretch.size_bytes for stretch in stretches)
    if total <= room:
        return request.start_ns, ""
    rings = reader.schema.rings
    rate = sum(
        group.row_bytes * reader.schema.frequency_hz / rings[group.ring].divider
        for group in (stretch.group for stretch in stretches)
    )
    fitting_s = 0.95 * room / rate
    of_all = f"{MAX_PINNED_BYTES / 2**20:g} MB for all clients, {max(0, room) / 2**20:.3g} MB free"
    if fitting_s < 0.1:
        names = max(1, int(len(request.names) * room / total))
        return None, (
            f"not pinned: {len(request.names)} names take {total / 2**20:.3g} MB ({of_all}); "
            f"about {names} of them would fit, or close other pins"
        )
    newest_ns = min(request.end_ns, reader.last_time_ns)
    start_ns = max(request.start_ns, newest_ns - int(fitting_s * 1e9))
    wished_s = (newest_ns - request.start_ns) / 1e9
    return start_ns, f"the newest {duration(fitting_s)} of {duration(wished_s)} are pinned: more doesn't fit ({of_all})"


def _copy(reader: SegmentReader, stretch: _Stretch) -> Rows:
    group, begin = stretch.group, stretch.begin
    out = np.empty((stretch.end - begin, len(group.words)), np.uint64)
    first = row = begin
    for rows in blocks(reader, group, begin, stretch.end):
        if rows.first > row:
            first = rows.first  # a copy has no hole: the writer was faster than we
        row = rows.first + len(rows)
        out[rows.first - begin : row - begin] = rows.words
    return Rows(reader.schema.rings[group.ring], first, out[first - begin : row - begin])
