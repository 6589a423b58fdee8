"""Who has control of a logger: one operator at a time, where somebody wishes so."""

from typing import ClassVar

from silo.rpc.declaring import Caller, Do, Done, change

LONGEST_LEASE_S = 24 * 3600.0


class TakeControl(Do[Done], frozen=True):
    """From now on no other user changes anything, for `lease_s`, or longer if this is sent again with `renew`.

    A renewal is refused where somebody else has control by now; `force` takes it from whoever has it.
    """

    timeout_s: ClassVar[float] = 4.0
    needs_control: ClassVar[bool] = False

    lease_s: float = 15.0
    renew: bool = False
    force: bool = False


class ControlRequests(Caller):
    """Giving control up, and away."""

    @change(control=False, timeout_s=4.0)
    def _release_control(self) -> str:
        """Give control up."""

    @change(control=False, timeout_s=4.0)
    def _give_control(self, to: str) -> str:
        """Hand control over to a user who is connected, by name."""
