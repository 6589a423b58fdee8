"""Parameters of a logger: what a client may ask."""

from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterValue
from silo.rpc.declaring import Caller, Reply, ask, change

LONGEST_REVERT_S = 24 * 3600.0


class ParameterTable(Reply, frozen=True):
    """All parameters with their present values; `locked`: those that are `locked` are closed now."""

    parameters: list[ParameterInfo]
    locked: bool = False


class ParametersSet(Reply, frozen=True):
    """A change was taken: it holds from row `tick` on, -1 where the logger stands still; or it `waits` for a tick."""

    name: str
    tick: int = -1
    waits: bool = False

    @property
    def text(self) -> str:
        """What became of it, in words."""
        if self.waits:
            return "it waits for a tick: the program's loop calls no collect() now"
        return f"it holds from tick {self.tick} on" if self.tick >= 0 else "it holds; the logger stands still"


class ExcitationState(Reply, frozen=True):
    """How far an excitation is: `at_s` after its begin, in row `tick`; `ended` says why, from row `until` on."""

    name: str
    at_s: float = 0.0
    tick: int = -1
    ended: str = ""
    until: int = -1


class ParameterRequests(Caller):
    """Reading and setting them; `Client.parameters` is made of these."""

    @ask(slow=True)
    def _list_parameters(self) -> ParameterTable:
        """Return what each is, with its present value."""

    @change(robot=True, control=False)
    def _read_parameters(self) -> ParameterTable:
        """The same, as the helper process asks the robot program for it."""

    @change(robot=True)
    def _set_parameters(
        self, values: dict[str, ParameterValue], name: str = "", revert_after_s: float = 0.0, remote: bool = False
    ) -> ParametersSet:
        """Set some, all or none, at the end of a tick.

        One `name` is done once: whoever lost the answer asks again. What isn't confirmed is taken back after
        `revert_after_s`. `remote`: a bridge asks for somebody elsewhere; else the helper process knows whether it is.
        """

    @change(robot=True)
    def _confirm_parameters(self, name: str) -> str:
        """Keep a change that would be taken back."""

    @change(robot=True)
    def _excite(self, what: Excitation, name: str, remote: bool = False) -> ExcitationState:
        """Move a parameter around its value for a while; it ends when `_keep_excitation` doesn't come for 2 s.

        One `name` is done once, as with `_set_parameters`.
        """

    @change(robot=True)
    def _keep_excitation(self, name: str) -> ExcitationState:
        """Say that whoever asked for it is there."""

    @change(robot=True, control=False)
    def _stop_excitation(self, name: str = "", why: str = "") -> str:
        """End an excitation, whoever began it; without a name the one that runs."""
