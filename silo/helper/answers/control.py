"""Taking, releasing and giving control. Who sends them is known at the door, so they are answered there."""

from silo.helper.answers.table import Parts, answers_to
from silo.ipc.messages import Done, GiveControl, Refused, ReleaseControl, TakeControl


@answers_to(TakeControl)
def _take(parts: Parts, request: TakeControl) -> Done | Refused:
    return parts.operators.take(request, parts.turn.sender)


@answers_to(ReleaseControl)
def _release(parts: Parts, _: ReleaseControl) -> Done | Refused:
    return parts.operators.release(parts.turn.sender)


@answers_to(GiveControl)
def _give(parts: Parts, request: GiveControl) -> Done | Refused:
    return parts.operators.give(request, parts.turn.sender)
