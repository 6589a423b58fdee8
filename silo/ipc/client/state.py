"""Who is there, the logger at a glance, and starting and stopping it."""

from collections.abc import Callable

from silo.calls import told_class
from silo.errors import ConnectionLostError
from silo.ipc.client.calling import Calls
from silo.ipc.messages import GetStatus, Hello, HelloReply, Restart, Start, StatusReply, Stop, Unsaved, unsaved_of
from silo.model import Status
from silo.version import VERSION


@told_class("client")
class StateCalls(Calls):
    """Who is there, and the state of the logger."""

    def hello(self) -> HelloReply:
        """Return who is there, and whether this user may change anything."""
        question = Hello(version=VERSION, client=self._name)
        reply = self._call(question)
        try:
            self._connection.exchange(question, self._timeout_s, key="do")
        except ConnectionLostError:
            # access control swallows what isn't allowed: no answer on this key is the answer
            import msgspec

            return msgspec.structs.replace(reply, may_edit=False)
        return reply

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
