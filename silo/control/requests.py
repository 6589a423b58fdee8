"""Who has control of a logger: one operator at a time, where somebody wishes so."""

from typing import ClassVar

from silo.rpc.declaring import Do, Done


class TakeControl(Do[Done], frozen=True):
    """From now on nobody else changes anything, for `lease_s`, or longer if this is sent again with `renew`.

    A renewal is refused where somebody else has control by now; `force` takes it from whoever has it.
    """

    timeout_s: ClassVar[float] = 4.0
    needs_control: ClassVar[bool] = False

    lease_s: float = 15.0
    renew: bool = False
    force: bool = False


class ReleaseControl(Do[Done], frozen=True):
    """Give control up."""

    timeout_s: ClassVar[float] = 4.0
    needs_control: ClassVar[bool] = False


class GiveControl(Do[Done], frozen=True):
    """Hand control over to a user who is connected, by name."""

    timeout_s: ClassVar[float] = 4.0
    needs_control: ClassVar[bool] = False

    to: str
