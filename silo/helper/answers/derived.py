"""Signals that are computed from others."""

from silo.helper.answers.table import Parts, answers_to, relayed, unexpected
from silo.ipc.messages import Done, GoesOn, Refused, RemoveDerived, SetDerived


@answers_to(SetDerived, RemoveDerived)
def _derive(parts: Parts, request: SetDerived | RemoveDerived) -> Done | GoesOn | Refused:
    # what changed is told to all when the robot process tells it
    reply = relayed(parts, request)
    return reply if isinstance(reply, Done | GoesOn | Refused) else unexpected(request, reply)
