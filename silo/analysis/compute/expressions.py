"""What somebody types for a signal: a name, or an expression that `silo.expressions.over_recordings` computes over a
recording."""

from collections.abc import Mapping

from silo.expressions.binding import BoundExpression
from silo.expressions.over_recordings import BATCH_TICKS, Evaluated, RecordingJudge, narrowed

__all__ = ["BATCH_TICKS", "Evaluated", "RecordingJudge", "is_expression", "labels_of", "narrowed"]


def is_expression(pattern: str) -> bool:
    """Whether what somebody typed for a signal computes something."""
    return (
        any(letter in pattern for letter in "()<>=+%")
        or any(f" {sign} " in pattern for sign in "*/-")
        or (pattern.startswith("-"))
    )


def labels_of(bound: BoundExpression) -> Mapping[int, str]:
    """Return the names of values of what an expression gives."""
    return {0: "false", 1: "true"} if bound.logical else bound.labels
