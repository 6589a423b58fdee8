"""Who is there, the logger's state, and starting and stopping it."""

import enum

from silo.errors import RefusedError
from silo.ipc.published import Summary
from silo.model import Status
from silo.rpc.declaring import Ask, Reply, RobotRequest


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


class GetStatus(Ask[StatusReply], frozen=True):
    """What is the logger's state?"""


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


class Start(RobotRequest[StatusReply], frozen=True):
    """Clear the buffers and log."""

    unsaved: Unsaved = Unsaved.REFUSE


class Stop(RobotRequest[StatusReply], frozen=True):
    """Stop logging. Stopping a stopped logger succeeds."""


class Restart(RobotRequest[StatusReply], frozen=True):
    """Stop and start."""

    unsaved: Unsaved = Unsaved.REFUSE
