"""Who is there, the logger's state, and starting and stopping it."""

import enum
from collections.abc import Callable

from silo.core.calls import told_class
from silo.core.elements import Status
from silo.errors import RefusedError
from silo.rpc.declaring import Ask, Caller, Reply, ask, change
from silo.rpc.published import Summary


class HelloReply(Reply, frozen=True):
    """`may_edit` tells whether `do` requests of this client get through, `why_not` why they don't.

    `oldest` to `protocol` are understood. `clock_s` is what the helper's clock shows, for `until_s` of requests; 0 of
    an older silo.
    """

    protocol: int
    version: str
    user: str
    may_edit: bool
    status: Status
    oldest: int = 1
    why_not: str = ""
    clock_s: float = 0.0


class StatusReply(Reply, frozen=True):
    """Carries a `Status`; `text` says what else was done, empty for nothing."""

    status: Status
    text: str = ""


class Hello(Ask[HelloReply], frozen=True):
    """Who am I and what may I do? Answered whatever protocol and `version` the client has.

    May be asked on the key `do` too: only who may change something gets an answer. `id` is that of the client's token,
    by which it is shown among those who are connected; `proof` shows that it is this client's.
    """

    version: str = ""
    id: str = ""
    proof: str = ""


class SummaryReply(Reply, frozen=True):
    """Carries a `Summary`."""

    summary: Summary


class GetSummary(Ask[SummaryReply], frozen=True):
    """What is published for those who look at many loggers, for who has just come."""


class Unsaved(str, enum.Enum):
    """What becomes of data that is in no file when the buffers are cleared."""

    REFUSE = "refuse"  # then nothing is cleared
    SAVE = "save"
    DISCARD = "discard"


def unsaved_of(word: Unsaved | str) -> Unsaved:
    """Return what a word means. Raises RefusedError for one that means nothing."""
    try:
        return Unsaved(word)
    except ValueError:
        words = ", ".join(repr(one.value) for one in Unsaved)
        raise RefusedError(f"unsaved must be one of {words}, got {word!r}; nothing was changed") from None


@told_class("client")
class StateRequests(Caller):
    """The state of the logger, starting and stopping it."""

    def status(self) -> Status:
        """Return the logger at a glance."""
        return self._get_status().status

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
        return _status(self._start(unsaved_of(unsaved)), told)

    def stop(self) -> Status:
        """Stop the logger; stopping a stopped one succeeds.

        Returns:
            The logger at a glance, as it is then.
        """
        return self._stop().status

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
        return _status(self._restart(unsaved_of(unsaved)), told)

    @ask()
    def _get_status(self) -> StatusReply:
        """What is the logger's state?"""

    @change(robot=True)
    def _start(self, unsaved: Unsaved = Unsaved.REFUSE) -> StatusReply:
        """Clear the buffers and log."""

    @change(robot=True)
    def _stop(self) -> StatusReply:
        """Stop logging. Stopping a stopped logger succeeds."""

    @change(robot=True)
    def _restart(self, unsaved: Unsaved = Unsaved.REFUSE) -> StatusReply:
        """Stop and start."""


def _status(reply: StatusReply, told: Callable[[str], None] | None) -> Status:
    if reply.text and told is not None:
        told(reply.text)
    return reply.status
