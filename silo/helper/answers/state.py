"""Who is there, the state of the logger, and starting and stopping it."""

from silo.helper.answers.table import Parts, answers_to, relayed
from silo.helper.events import plain
from silo.ipc.clocks import clock_s
from silo.ipc.keys import may_use
from silo.ipc.messages import (
    Done,
    GetStatus,
    GetSummary,
    GoesOn,
    Hello,
    HelloReply,
    Refused,
    Restart,
    Start,
    StatusReply,
    Stop,
    SummaryReply,
)
from silo.ipc.versions import OLDEST, PROTOCOL
from silo.version import VERSION


@answers_to(Hello)
def _hello(parts: Parts, request: Hello) -> HelloReply:
    if request.id and may_use(request.id, request.proof):
        parts.publisher.name_client(plain(request.id), plain(request.client))
    # a client that gets this from the key `do` too may edit
    status, closed = parts.mirror.status(), parts.operators.closed()
    return HelloReply(PROTOCOL, VERSION, parts.mirror.user, True, status, OLDEST, closed, clock_s())


@answers_to(GetStatus)
def _status(parts: Parts, _: GetStatus) -> StatusReply:
    return StatusReply(parts.mirror.status())


@answers_to(GetSummary)
def _summary(parts: Parts, _: GetSummary) -> SummaryReply:
    return SummaryReply(parts.publisher.summary.now())


@answers_to(Start, Stop, Restart)
def _control(parts: Parts, request: Start | Stop | Restart) -> StatusReply | GoesOn | Refused:
    reply = relayed(parts, request)
    if isinstance(reply, GoesOn | Refused):
        return reply
    return StatusReply(parts.mirror.status(), reply.text if isinstance(reply, Done) else "")
