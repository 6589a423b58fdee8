"""Signals that are computed from others."""

from silo.helper.answers.table import Parts, answers_to, must_live, signed, unexpected
from silo.ipc.messages import Done, GoesOn, Refused, RemoveDerived, SetDerived


@answers_to(SetDerived, RemoveDerived)
def _derive(parts: Parts, request: SetDerived | RemoveDerived) -> Done | GoesOn | Refused:
    # what changed is told to all when the robot process tells it
    reply = must_live(parts.mirror.now) or parts.robot.ask(signed(request))
    return reply if isinstance(reply, Done | GoesOn | Refused) else unexpected(request, reply)
