"""What all calls of a client have in common."""

from silo.errors import ElementError
from silo.ipc.client.leases import Leases
from silo.ipc.client.saves import Saves
from silo.ipc.connection import Connection
from silo.ipc.exchange import checked_reply
from silo.ipc.messages import ReplyT, Request

LONGEST_S = 1e6  # that anybody waits


class Calls:
    """What the calls of a client stand on; each topic has its own."""

    _connection: Connection
    _name: str
    _timeout_s: float
    _leases: Leases
    _saves: Saves

    def _call(self, request: Request[ReplyT]) -> ReplyT:
        try:
            reply = self._connection.exchange(request, max(request.timeout_s, self._timeout_s))
        except (OverflowError, UnicodeEncodeError) as error:
            raise ElementError(f"{type(request).__name__} can't be sent: {error}; nothing was asked") from None
        return checked_reply(request, reply)
