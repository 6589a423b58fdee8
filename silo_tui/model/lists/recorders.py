"""Endless recordings as rows of text: what runs, for how long, how fast, how much of its budget is full. Pure."""

import math
from collections.abc import Sequence

import msgspec

from silo.core.elements import RecorderState
from silo.core.names import matching
from silo.core.quantities.writing import size_text
from silo.recorder.requests import RecorderInfo
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among

WORDS = {
    RecorderState.WAITING: "WAIT", RecorderState.RECORDING: "REC", RecorderState.FINISHING: "ENDS",
    RecorderState.ENDED: "OVER", RecorderState.FAILED: "STOP", RecorderState.DIED: "DIED", RecorderState.OTHER: "?",
}  # fmt: skip
LOUD = (RecorderState.FAILED,)
CAUTION = (RecorderState.WAITING, RecorderState.DIED, RecorderState.OTHER)
USUAL = "recordings"  # the folder, which needs no mention
BAR = 5
BUDGET = 20  # cells of what is written, of its budget
FULL_SHARE = 0.8  # of the budget, from which it is amber
RATE_S = 2.5  # least time between two looks that make a rate: a recorder writes once a second


class WritingPace(msgspec.Struct, frozen=True):
    """How much a recorder had written when it was looked at, and how fast that was going; NaN is not known yet."""

    at_s: float
    written_bytes: int
    bytes_s: float = float("nan")

    def next(self, at_s: float, written_bytes: int) -> "WritingPace":
        """Return the pace after another look; of one that comes too soon, the same."""
        if at_s - self.at_s < RATE_S:
            return self
        return WritingPace(at_s, written_bytes, max(0.0, (written_bytes - self.written_bytes) / (at_s - self.at_s)))


def head(width: int) -> str:
    """Return the titles of the columns."""
    return _line(("", "running", "signals", "for", "rate", "written, of budget", "parts", "lost"), width)


def row(
    one: RecorderInfo,
    names: Sequence[str],
    pace: WritingPace | None,
    folder: str,
    width: int,
    now_ns: int,
    among: Sequence[RecorderInfo] = (),
) -> str:
    """Return one `among` recorders as a line of so many cells; `names` are of all elements, `folder` the logger's."""
    places = tuple(_place(each, folder) for each in among)
    name = fitted_among(_place(one, folder), places, _room(width))
    known = pace is not None and not math.isnan(pace.bytes_s)
    if one.state.over:
        rate, budget = one.text or "ended", ""
    else:
        rate = f"{size_text(pace.bytes_s)}/s" if pace is not None and known else "…"
        budget = budget_text(one)
    cells = (
        WORDS[one.state], name, str(len(matching(names, one.patterns))), text.running((now_ns - one.since_ns) / 1e9),
        rate, budget, str(one.parts + bool(one.part)), text.count(one.lost),
    )  # fmt: skip
    return _line(cells, width)


def _place(one: RecorderInfo, folder: str) -> str:
    place = one.folder.removeprefix(folder.rstrip("/") + "/")
    return one.name if place == USUAL else f"{place}/{one.name}"


def _room(width: int) -> int:
    return max(9, width - 68)


def size_of(one: RecorderInfo) -> int:
    """Return what is on the disk of a budget, without one what was written since it was started."""
    return one.size_bytes if one.keep_bytes else one.written_bytes


def budget_text(one: RecorderInfo) -> str:
    """Return a bar and `21 of 50 GB`; without a budget what was written since it was started."""
    if not one.keep_bytes:
        return f"{'':{BAR}} {size_text(size_of(one))}"
    sizes = _of(one.size_bytes, one.keep_bytes)
    if BAR + 1 + len(sizes) > BUDGET:  # in kB of more: of a bar nothing would show
        return sizes
    return f"{text.bar(min(1.0, one.size_bytes / one.keep_bytes), BAR):{BAR}} {sizes}"


def head_words(found: Sequence[RecorderInfo]) -> str:
    """Return how much there is of what records, as their lines tell, and of how much it may be; empty where none is."""
    going = [one for one in found if not one.state.over]
    size, keep = sum(map(size_of, going)), sum(one.keep_bytes for one in going)
    if not going:
        return ""
    return _of(size, keep) if all(one.keep_bytes for one in going) else size_text(size)


def _of(part: int, whole: int) -> str:
    """Return two sizes in the unit of the larger one where both show: `21 of 50 GB`, `0.4 of 2 GB`, `45 MB of 2 GB`."""
    unit, scale = next(
        ((unit, 10.0**power) for unit, power in (("GB", 9), ("MB", 6)) if whole >= 10**power), ("kB", 1e3)
    )
    some = f"{part / scale:.1f}".removesuffix(".0") if not 0 < part < 0.1 * scale else size_text(float(f"{part:.2g}"))
    return f"{some} of {text.short(whole / scale, 3)} {unit}"


def _line(cells: Sequence[str], width: int) -> str:
    state, name, signals, since, rate, budget, parts, lost = cells
    room = _room(width)
    if rate and not budget and parts:  # why it ended takes the room of both
        rate = text.clean(rate)
        told = f"{rate[:30] + '…' if len(rate) > 31 else rate:<31}"
    else:
        told = f"{rate:>10} {budget:<{BUDGET}}"
    return f"  {state:<4} {name:<{room}} {signals:>7} {since:>8} {told} {parts:>5} {lost:>5}"
