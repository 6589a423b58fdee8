"""Who is there, the logger at a glance, and starting and stopping it."""

from collections.abc import Callable

from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.exchange import NoAnswerError
from silo.ipc.messages import (
    GetStatus,
    Hello,
    HelloReply,
    Refused,
    Restart,
    Start,
    StatusReply,
    Stop,
    Unsaved,
    unsaved_of,
)
from silo.ipc.senders import READ_ONLY
from silo.model import Status
from silo.version import VERSION


@told_class("client")
class StateCalls(Calls):
    """Who is there, and the state of the logger."""

    def hello(self) -> HelloReply:
        """Return who is there, whether this user may change anything, and why not."""
        question = Hello(version=VERSION, client=self._name)
        reply = self._call(question)
        why_not = self._why_no_changes()
        if not why_not:
            return reply
        import msgspec

        return msgspec.structs.replace(reply, may_edit=False, why_not=why_not)

    def _why_no_changes(self) -> str:
        if self.read_only:
            return READ_ONLY
        mine = self._connection.mine
        question = Hello(version=VERSION, client=self._name, id=mine.id, proof=mine.proof)
        try:
            reply = self._connection.exchange(question, self._timeout_s, as_change=True)
        except NoAnswerError:
            return self._why_not()  # access control swallows what isn't allowed: no answer on this key is the answer
        return reply.text if isinstance(reply, Refused) else ""

    def status(self) -> Status:
        """Return the logger at a glance."""
        return self._call(GetStatus(client=self._name)).status

    def start(self, unsaved: Unsaved | str = Unsaved.REFUSE, told: Callable[[str], None] | None = None) -> Status:
        """Start the logger; the buffers are cleared.

        Args:
            unsaved: what becomes of unsaved data: `"refuse"` (why: UNSAVED), `"save"` or `"discard"`.
            told: called with where it was saved, in words.

        Returns:
            The logger at a glance, as it is then.

        Raises:
            RefusedError: it runs already, or holds unsaved data.
            GoesOnError: the robot program takes longer.
        """
        return _status(self._call(Start(unsaved=unsaved_of(unsaved), client=self._name)), told)

    def stop(self) -> Status:
        """Stop the logger; stopping a stopped one succeeds.

        Returns:
            The logger at a glance, as it is then.
        """
        return self._call(Stop(client=self._name)).status

    def restart(self, unsaved: Unsaved | str = Unsaved.REFUSE, told: Callable[[str], None] | None = None) -> Status:
        """Stop and start the logger.

        Args:
            unsaved: as for `start`.
            told: as for `start`.

        Returns:
            The logger at a glance, as it is then.

        Raises:
            RefusedError: it holds unsaved data.
            GoesOnError: the robot program takes longer.
        """
        return _status(self._call(Restart(unsaved=unsaved_of(unsaved), client=self._name)), told)


def _status(reply: StatusReply, told: Callable[[str], None] | None) -> Status:
    if reply.text and told is not None:
        told(reply.text)
    return reply.status
