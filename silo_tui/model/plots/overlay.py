"""A saved run laid over the plots of a live one: both count time from their start."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from silo.core.arrays.columns import ColumnPiece, ColumnStore
from silo.core.quantities.writing import duration_text
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.samples.recorded import RecordingSource

SIGN = "'"  # behind the letter of its signal
LONGEST_NS = 30 * 86400 * SECOND_NS


@dataclass(frozen=True)
class Overlay:
    """A recording, by the name that is shown, and when its run began by its own time stamps."""

    name: str
    source: RecordingSource
    began_ns: int

    def columns(
        self, names: tuple[str, ...], first: int, count: int, column_ns: int, live_began_ns: int
    ) -> ColumnStore:
        """Return its columns `first ...` on the grid of a live run that began at `live_began_ns`.

        It is moved by whole columns, so that it stands at most half a column beside its time.
        """
        moved = round((live_began_ns - self.began_ns) / column_ns)
        begin = (first - moved) * column_ns
        past = self.source.columns(names, begin, begin + (count - 1) * column_ns, column_ns)
        store = ColumnStore(names, count, column_ns)
        store.take(replace(past, first=past.first + moved))
        store.advance_to(first + count)
        return store

    def extent(self, elements: Sequence[str] = ()) -> str:
        """From when to when it has data, of some elements where these are named, since its start."""
        if elements and not any(map(self.source.is_live, elements)):
            return "nothing of these signals"
        ends = self.source.extent_ns(elements) if elements else (self.source.begin_ns, self.source.end_ns)
        begin, end = ((at - self.began_ns) / SECOND_NS for at in ends)
        return f"{duration_text(begin)} to {duration_text(end)} after its start"


def overlay_of(name: str, source: RecordingSource) -> Overlay:
    """Return an overlay of a recording: its start is the logger's own, else counted back by the ticks before."""
    recording = source.recording
    began, oldest_ns = recording.started_ns, int(source.time_ns[0])
    if not 0 < began <= oldest_ns or oldest_ns - began > LONGEST_NS:
        before = max(0, recording.offset - len(recording.time_ns))
        period_ns = (source.end_ns - oldest_ns) / max(1, len(recording.time_ns) - 1)
        began = oldest_ns - round(before * period_ns)
    return Overlay(name, source, began)


def ghost_piece(store: ColumnStore, name: str, end: int, width: int) -> ColumnPiece | None:
    """Return the newest columns of an entry without marks and holes; None where it has none there."""
    if store.row(name) is None:
        return None
    piece = store.piece(name, end, width)
    return (
        None
        if np.isnan(piece.low).all()
        else ColumnPiece(piece.low, piece.high, np.zeros_like(piece.marks), piece.base)
    )
