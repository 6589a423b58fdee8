"""Who is there, starting and stopping, and who has control."""

from silo.control import requests as control
from silo.control.requests import GiveControl, ReleaseControl, TakeControl
from silo.helper.servers.parts import Parts, ask_robot
from silo.net.keys import may_use
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Done, Request, request_of
from silo.rpc.serving import Server, Turn
from silo.rpc.versions import OLDEST, PROTOCOL
from silo.state import requests as state
from silo.state.events import plain
from silo.state.requests import GetSummary, Hello, HelloReply, StateRequests, StatusReply, SummaryReply, Unsaved
from silo.version import VERSION


class ControlServer(Server[Parts], does=[state, control]):
    """Answers who is there and how the logger stands, has it started and stopped, and gives control."""

    def hello(self, request: Hello) -> HelloReply:
        replica = self.state.replica
        if request.id and may_use(request.id, request.proof):
            self.state.publisher.name_client(plain(request.id), plain(request.client))
        # a client that gets this from the key `do` too may edit
        status, closed = replica.status(), self.state.control_lock.closed()
        return HelloReply(PROTOCOL, VERSION, replica.user, True, status, OLDEST, closed, clock_s())

    def get_status(self) -> StatusReply:
        return StatusReply(self.state.replica.status())

    def get_summary(self, request: GetSummary) -> SummaryReply:
        return SummaryReply(self.state.publisher.summary.now())

    def start(self, turn: Turn, unsaved: Unsaved) -> StatusReply:
        return self._status_after(request_of(StateRequests._start, unsaved), turn)

    def stop(self, turn: Turn) -> StatusReply:
        return self._status_after(request_of(StateRequests._stop), turn)

    def restart(self, turn: Turn, unsaved: Unsaved) -> StatusReply:
        return self._status_after(request_of(StateRequests._restart, unsaved), turn)

    def _status_after(self, request: Request[StatusReply], turn: Turn) -> StatusReply:
        reply = ask_robot(self.state, request, turn)
        return StatusReply(self.state.replica.status(), reply.text if isinstance(reply, Done) else "")

    def take_control(self, turn: Turn, request: TakeControl) -> str:
        return self.state.control_lock.take(request, turn.sender)

    def release_control(self, turn: Turn, request: ReleaseControl) -> str:
        return self.state.control_lock.release(turn.sender)

    def give_control(self, turn: Turn, request: GiveControl) -> str:
        return self.state.control_lock.give(request, turn.sender)
