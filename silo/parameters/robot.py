"""Parameters, as the robot program sets them for its clients."""

import secrets
from dataclasses import dataclass

from silo.core.arguments import real
from silo.core.tuning.parameters import Excitation, ParameterValue
from silo.parameters import requests
from silo.parameters.parameters import Parameters
from silo.parameters.requests import LONGEST_REVERT_S, ExcitationState, ParametersSet, ParameterTable
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn


@dataclass(frozen=True)
class ParameterRobot(Server, does=[requests], robot=True):
    """Checks changes and has them wait for a tick; the link's thread answers when they have landed."""

    parameters: Parameters
    frequency_hz: float

    def read_parameters(self) -> ParameterTable:
        landing = self.parameters.landing
        return ParameterTable(landing.described(), landing.locked)

    def set_parameters(
        self, turn: Turn, values: dict[str, ParameterValue], name: str, revert_after_s: float, remote: bool
    ) -> ParametersSet:
        where = "network" if remote else "this computer"
        name = name or secrets.token_hex(8)
        # by which the thread of the link waits: one that is no time has it end, or never wait again
        revert_s = real("revert_after", revert_after_s, 0, LONGEST_REVERT_S, "s")
        self.parameters.request(values, turn.by, where, name, remote=remote, revert_s=revert_s)
        return ended(self.parameters, name)

    def confirm_parameters(self, name: str) -> str:
        if not self.parameters.confirm(name):
            raise RequestRefusedError(RefusedWhy.NOT_FOUND, "no change of that name waits to be confirmed")
        return "it stays"

    def excite(self, turn: Turn, what: Excitation, name: str, remote: bool) -> ExcitationState:
        where = "network" if remote else "this computer"
        name = name or secrets.token_hex(8)
        self.parameters.excite(what, turn.by, where, name, remote=remote, frequency_hz=self.frequency_hz)
        return self._excitation(name)

    def keep_excitation(self, name: str) -> ExcitationState:
        self.parameters.excitations.found(name)[1].keep()
        return self._excitation(name)

    def stop_excitation(self, turn: Turn, name: str, why: str) -> str:
        # the helper process alone says why; a client is not believed that it was another one
        stopped = self.parameters.excitations.stop(name, f"stopped by {turn.by}" if turn.by else why)
        return "it goes back" if stopped else "nothing is excited"

    def _excitation(self, name: str) -> ExcitationState:
        change, excited = self.parameters.excitations.found(name)
        return ExcitationState(name, excited.at_s, change.tick, change.refused or excited.ended, excited.until)


def ended(parameters: Parameters, name: str) -> ParametersSet:
    """Return what became of a change so far. Raises RequestRefusedError where it was refused at its tick."""
    change = parameters.end_of(name)
    if change is None or not (change.landed or change.refused):
        return ParametersSet(name, waits=True)
    if change.refused:
        raise RequestRefusedError(RefusedWhy.CONFLICT, f"{change.refused}; nothing was changed")
    return ParametersSet(name, change.tick)
