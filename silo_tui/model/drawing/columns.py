"""Columns as plots need them: what is kept of a signal, and how a slow one holds between its samples."""

import numpy as np

from silo.core.arrays.columns import ColumnPiece, ColumnStore, Floats, Marks

__all__ = ["ColumnPiece", "ColumnStore", "Floats", "Marks", "hold", "hold_piece"]


def hold(low: Floats, high: Floats, limit: int, marks: Marks | None = None) -> tuple[Floats, Floats]:
    """Fill gaps of at most `limit` columns with the value before: a slow signal holds between its samples.

    Of one signal, or of many of shape `(signals, columns)`. What has marks stays as it is, and nothing is held beyond
    it: a NaN ends a value, and so does a hole.
    """
    valid = ~np.isnan(low)
    stops = valid if marks is None else valid | (marks != 0)
    if limit < 1 or stops.all() or not valid.any():
        return low, high
    columns = low.shape[-1]
    places = np.broadcast_to(np.arange(columns), low.shape)
    source = np.maximum.accumulate(np.where(stops, places, -1), axis=-1)
    age = places - source
    source = np.maximum(source, 0)
    held = ~stops & np.take_along_axis(valid, source, -1) & (age <= limit)
    # of a column with several values the one nearer to the next column: both ends are in the data, the middle is not
    following = np.minimum.accumulate(np.where(valid, places, columns)[..., ::-1], axis=-1)[..., ::-1]
    following = np.where(following < columns, following, source)
    before, after = np.take_along_axis(low, source, -1), np.take_along_axis(low, following, -1)
    one = np.where(after < before, before, np.take_along_axis(high, source, -1))
    return np.where(held, one, low), np.where(held, one, high)


def hold_piece(piece: ColumnPiece, limit: int) -> ColumnPiece:
    """Return a piece whose gaps are filled so."""
    low, high = hold(piece.low, piece.high, limit, piece.marks)
    return ColumnPiece(low, high, piece.marks, piece.base)
