"""The event log, and marks in it."""

from silo.helper.answers.table import Parts, answers_to
from silo.helper.events import plain
from silo.ipc import messages
from silo.ipc.messages import AddMark, GetEvents, Marked, Refused, RefusedWhy
from silo.ipc.published import EventKind

MOST_EVENTS_AT_ONCE = 10_000
MOST_MARK_LETTERS = 200
WRITTEN_S = 0.5  # a disk that takes longer holds no client up


@answers_to(GetEvents)
def _happened(parts: Parts, request: GetEvents) -> messages.Events | Refused:
    if not 0 <= request.limit <= MOST_EVENTS_AT_ONCE:
        text = f"the limit of events must be 0 to {MOST_EVENTS_AT_ONCE}, got {request.limit}"
        return Refused(RefusedWhy.INVALID, text)
    return messages.Events(*parts.events.log.since(request.since, request.limit))


@answers_to(AddMark)
def _mark(parts: Parts, request: AddMark) -> Marked | Refused:
    text = plain(request.text, MOST_MARK_LETTERS).strip()
    status = parts.mirror.status()
    if not text:
        return Refused(RefusedWhy.INVALID, "a mark needs some words; nothing was marked")
    if not -1 <= request.tick < max(status.ticks, 0):
        there = f"0 to {status.ticks - 1}" if status.ticks else "none yet"
        return Refused(RefusedWhy.INVALID, f"there is no tick {request.tick} (ticks: {there}); nothing was marked")
    tick = request.tick if request.tick >= 0 else None
    if request.at_ns and (tick := parts.mirror.tick_at(request.at_ns)) < 0:
        return Refused(RefusedWhy.INVALID, "no tick of that time is held any more; nothing was marked")
    mark = parts.events.publish(EventKind.MARKER, text, by=request.client, tick=tick)
    parts.events.log.wait_written(mark.number, WRITTEN_S)  # what was answered outlives a kill of this process
    return Marked(mark)
