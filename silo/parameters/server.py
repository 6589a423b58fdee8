"""Parameters in the helper process: the robot program has them; from where a change comes is known here."""

from dataclasses import dataclass

from silo.core.arguments import shown
from silo.core.tuning.parameters import Excitation, ParameterValue
from silo.net.access.senders import came_by_network
from silo.parameters import requests
from silo.parameters.requests import ExcitationState, ParameterRequests, ParametersSet, ParameterTable
from silo.rpc.declaring import request_of
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.state.robot_program import RobotProgram

MOST_LETTERS = 64  # of a name


@dataclass(frozen=True)
class ParameterServer(Server, does=[requests]):
    """Hands on what is asked."""

    robot: RobotProgram

    def list_parameters(self, turn: Turn) -> ParameterTable:
        found: ParameterTable = self.robot.reply(request_of(ParameterRequests._read_parameters), turn)
        return found

    def set_parameters(
        self, turn: Turn, values: dict[str, ParameterValue], name: str, revert_after_s: float, remote: bool
    ) -> ParametersSet:
        _check_name(name)
        remote = remote or came_by_network(turn.by)  # a bridge says so of its own clients, else nobody is asked
        request = request_of(ParameterRequests._set_parameters, values, name, revert_after_s, remote)
        found: ParametersSet = self.robot.reply(request, turn)
        return found

    def excite(self, turn: Turn, what: Excitation, name: str, remote: bool) -> ExcitationState:
        _check_name(name)
        request = request_of(ParameterRequests._excite, what, name, remote or came_by_network(turn.by))
        found: ExcitationState = self.robot.reply(request, turn)
        return found


def _check_name(name: str) -> None:
    """Raise RequestRefusedError for what a client can't call a change: the robot program keeps and records it."""
    if len(name) > MOST_LETTERS or not name.isprintable():
        text = f"a change is called by up to {MOST_LETTERS} letters, got {shown(name)}; nothing was changed"
        raise RequestRefusedError(RefusedWhy.INVALID, text)
