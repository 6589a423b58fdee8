"""Moments that are looked for in what buffers and pins hold."""

from silo.helper.answers.table import Parts, answers_to
from silo.helper.moments import check_moments, find_moments
from silo.ipc.messages import FindMoments, MomentsFound, Refused


@answers_to(FindMoments)
def _find(parts: Parts, request: FindMoments) -> MomentsFound | Refused:
    refused = check_moments(request)
    if refused is not None:
        return refused
    held = [found for pin in request.pins if (found := parts.pins.rows(pin)) is not None]
    gone = next((each for each in held if isinstance(each, Refused)), None)
    pinned = [each for each in held if not isinstance(each, Refused)]
    return gone or find_moments(request, parts.mirror.now, parts.mirror.open_watcher(), pinned)
