"""The element table, and edits of it."""

from silo.helper.answers.table import Parts, answers_to, must_live, must_stop, relayed, unexpected
from silo.helper.requests import check_edits
from silo.ipc.messages import ApplyEdits, EditsApplied, GetTable, GoesOn, Refused


@answers_to(GetTable)
def _table(parts: Parts, _: GetTable) -> bytes:
    return parts.mirror.now.table_reply


@answers_to(ApplyEdits)
def _apply(parts: Parts, request: ApplyEdits) -> EditsApplied | GoesOn | Refused:
    now = parts.mirror.now
    return must_live(now) or must_stop(now) or check_edits(request, now) or through(parts, request)


def through(parts: Parts, request: ApplyEdits) -> EditsApplied | GoesOn | Refused:
    """Return what the robot process answers to edits that were checked."""
    if not request.edits and request.extras is None:
        return EditsApplied(parts.mirror.now.table.revision, 0)
    reply = relayed(parts, request)
    return reply if isinstance(reply, EditsApplied | GoesOn | Refused) else unexpected(request, reply)
