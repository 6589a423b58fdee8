"""Taking control of a logger, and handing it over: one operator at a time."""

from collections.abc import Callable

from silo.arguments import real, switch, text
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.client.holding import Held
from silo.ipc.messages import GiveControl, ReleaseControl, TakeControl

LEASE_S = 15.0  # of a client that renews it: seven renewals, or 15 s of a link that is away
LONGEST_LEASE_S = 24 * 3600.0


@told_class("client")
class ControlCalls(Calls):
    """Who alone changes something."""

    _held: Held | None = None

    def take_control(
        self,
        *,
        force: bool = False,
        lease_s: float | None = None,
        on_lost: Callable[[str], None] | None = None,
    ) -> str:
        """Take control: from now on nobody else changes anything, until it is released, given away or taken.

        It is kept while this client lives and its link does, and ends 15 s after; with a `lease_s` of your own it goes
        on without this client.

        Args:
            force: take it from whoever has it; everybody is told.
            lease_s: how long it lasts without being renewed, 1 s to a day; None: renewed by this client.
            on_lost: called with the reason when somebody else has it by now; in a thread of the connection.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: somebody else has it, since when, and the way out; or this user may not change anything.
        """
        switch("force", force)
        if lease_s is not None:
            lease_s = real("lease_s", lease_s, 1.0, LONGEST_LEASE_S, "s")
        words = self._call(TakeControl(lease_s=lease_s or LEASE_S, force=force, client=self._name)).text
        if lease_s is None:
            self._let_go()
            self._held = Held(TakeControl(lease_s=LEASE_S, renew=True, client=self._name), on_lost)
            self._leases.add(self._held)
        return words

    def release_control(self) -> str:
        """Give control up.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: somebody else has it.
        """
        self._let_go()
        return self._call(ReleaseControl(client=self._name)).text

    def hand_over(self, to: str) -> str:
        """Give control to another operator who is connected.

        Args:
            to: the user's name, as `status().clients` has it.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: nobody of that name is connected, or somebody else has control.
        """
        text("to", to, 'client.hand_over("anna")')
        words = self._call(GiveControl(to=to, client=self._name)).text
        self._let_go()
        return words

    def _let_go(self) -> None:
        """Renew it no more."""
        if self._held is not None:
            self._leases.drop(self._held)
        self._held = None
