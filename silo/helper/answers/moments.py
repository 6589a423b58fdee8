"""Moments that are looked for in what buffers and pins hold."""

from collections.abc import Sequence

from silo.helper.answers.table import Parts, answers_to
from silo.helper.moments import check_moments, check_span, find_moments, measure_span
from silo.helper.pinned_rows import PinnedRows
from silo.ipc.messages import FindMoments, MeasureSpan, MomentsFound, Refused, SpanMeasured


@answers_to(FindMoments)
def _find(parts: Parts, request: FindMoments) -> MomentsFound | Refused:
    refused = check_moments(request)
    if refused is not None:
        return refused
    pinned = _pinned(parts, request.pins)
    if isinstance(pinned, Refused):
        return pinned
    return find_moments(request, parts.mirror.now, parts.mirror.open_watcher(), pinned)


@answers_to(MeasureSpan)
def _measure(parts: Parts, request: MeasureSpan) -> SpanMeasured | Refused:
    refused = check_span(request)
    if refused is not None:
        return refused
    pinned = _pinned(parts, request.pins)
    if isinstance(pinned, Refused):
        return pinned
    return measure_span(request, parts.mirror.now, parts.mirror.open_watcher(), pinned)


def _pinned(parts: Parts, pins: Sequence[str]) -> list[PinnedRows] | Refused:
    """Return the rows of pins; why not, where one is no more."""
    held = [found for pin in pins if (found := parts.pins.rows(pin)) is not None]
    gone = next((each for each in held if isinstance(each, Refused)), None)
    return gone or [each for each in held if not isinstance(each, Refused)]
