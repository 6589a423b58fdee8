"""What all calls of a client have in common."""

import contextlib

import msgspec

from silo.errors import ElementError
from silo.ipc.client.leases import Leases
from silo.ipc.client.saves import Saves
from silo.ipc.connection import Connection
from silo.ipc.exchange import NoAnswerError
from silo.ipc.messages import AnyReply, Hello
from silo.ipc.senders import read_only_words, viewer_words
from silo.rpc.declaring import Caller, Do, ReplyT, Request
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, checked
from silo.version import VERSION

LONGEST_S = 1e6  # that anybody waits


class Calls(Caller):
    """What the calls of a client stand on; each topic has its own."""

    _connection: Connection
    _name: str
    _timeout_s: float
    _leases: Leases
    _saves: Saves
    read_only: bool

    def _call(self, request: Request[ReplyT]) -> ReplyT:
        changes = request.key == Do.key
        if changes and self.read_only:
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, read_only_words(type(request).__name__))
        request = msgspec.structs.replace(request, client=self._name)
        try:
            reply = self._connection.exchange(request, max(request.timeout_s, self._timeout_s))
        except NoAnswerError:
            if not changes:
                raise
            reply = self._told_why(request)
        except (OverflowError, UnicodeEncodeError) as error:
            raise ElementError(f"{type(request).__name__} can't be sent: {error}; nothing was asked") from None
        return checked(request, reply)

    def _told_why(self, request: Request[ReplyT]) -> AnyReply:
        """Ask under the key for those whom rules keep from `do`: the robot says why, and tells who sits before it."""
        with contextlib.suppress(NoAnswerError):  # a robot, or rules, of before
            return self._connection.exchange(request, self._timeout_s, refused=True)
        return Refused(RefusedWhy.FORBIDDEN, self._why_not())

    def _why_not(self) -> str:
        """Return why this user's changes get no answer, from a logger that answers what reads; raises if it doesn't."""
        question = Hello(version=VERSION, client=self._name)
        reply = checked(question, self._connection.exchange(question, self._timeout_s))
        return reply.why_not or viewer_words(self._connection.user, self._connection.root.address)
