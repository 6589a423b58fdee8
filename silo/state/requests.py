"""Who is there, the logger's state, starting and stopping it; its table and edits of it; what happened, and marks."""

import enum
from collections.abc import Callable, Sequence

from silo.core.arguments import line, shown, switch, whole
from silo.core.calls import told_class
from silo.core.conditions import Conditions
from silo.core.elements import Edit, ElementOptions, LoggedEvent, Problem, Status, Table
from silo.errors import ElementError
from silo.rpc.declaring import Ask, Caller, Do, Reply, RobotRequest, ask, change, request_of
from silo.rpc.published import Summary
from silo.rpc.refusals import RefusedWhy, RequestRefusedError, meant
from silo.state.table_parts import TableParts, TableReply


class HelloReply(Reply, frozen=True):
    """`may_edit` tells whether `do` requests of this client get through, `why_not` why they don't.

    `oldest` to `protocol` are understood. `clock_s` is what the helper's clock shows, for `until_s` of requests; 0 of
    an older silo. `newest_event` is the number of the newest line of the event log, -1 of an older silo. `numbered`
    tells whether a change with a number may be asked for again.
    """

    protocol: int
    version: str
    user: str
    may_edit: bool
    status: Status
    oldest: int = 1
    why_not: str = ""
    clock_s: float = 0.0
    newest_event: int = -1
    numbered: bool = False


class StatusReply(Reply, frozen=True):
    """Carries a `Status`; `text` says what else was done, empty for nothing."""

    status: Status
    text: str = ""


class Hello(Ask[HelloReply], frozen=True):
    """Who am I and what may I do? Answered whatever protocol and `version` the client has.

    May be asked on the key `do` too: only who may change something gets an answer. `id` is that of the client's token,
    by which it is shown among those who are connected, under the name of that key; `proof` shows that it is this
    client's.
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


class EditsApplied(Reply, frozen=True):
    """`changed` counts elements; `unknown` are names of a script that the table doesn't have.

    `warnings` are `file:line: reason` of keys of the script that silo doesn't know.
    """

    revision: int
    changed: int
    unknown: list[str] = []
    warnings: list[str] = []


class ApplyEdits(RobotRequest[EditsApplied], frozen=True, rename={"conditions": "extras"}):
    """All or nothing, and only while stopped, or at a `cut` of the run, which goes on in another stretch.

    `revision` is the table's that the edits are based on (-1: any). As large as a table is: the helper process hands on
    one edit of each element at most, and conditions that fit.
    """

    max_bytes = Do.max_bytes

    revision: int
    edits: list[Edit]
    conditions: Conditions | None = None  # derived signals, limits and triggers of a script, None: they stay
    cut: bool = False


class Events(Reply, frozen=True):
    """Lines of the event log, oldest first. `missed` counts those asked for that are older and not among them."""

    events: list[LoggedEvent]
    missed: int = 0


class Marked(Reply, frozen=True):
    """The mark as it stands in the event log."""

    event: LoggedEvent


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
        return _status(self._start(meant(Unsaved, "unsaved", unsaved, "nothing was changed")), told)

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
        return _status(self._restart(meant(Unsaved, "unsaved", unsaved, "nothing was changed")), told)

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


@told_class("client")
class TableRequests(Caller):
    """The element table."""

    _parts: TableParts | None = None  # in which it comes over a network

    def table(self, told: Callable[[float], None] | None = None) -> Table:
        """Return the element table with its revision.

        Over a network it comes in parts, and only if it isn't the one that was read last.

        Args:
            told: called with the share that has come, 0 to 1, after each part.

        Raises:
            ConnectionLostError: nobody answers, or what comes makes no sense.
        """
        return self._table().table if self._parts is None else self._parts.read(self._table, told)

    @ask("GetTable", timeout_s=15.0)
    def _table(self, start: int = 0, most_bytes: int = 0) -> TableReply:
        """Which elements are there, with which options? The whole answer, or at most so many bytes of it from one on.

        Bytes are of the answer as it is compressed; 0: the whole answer as it is.
        """

    def apply(self, edits: Sequence[Edit], revision: int, *, cut: bool = False) -> EditsApplied:
        """Apply edits as one transaction, all or none.

        Args:
            edits: what to change.
            revision: that of the table they are based on; -1: whichever.
            cut: while the logger runs, too: from its next tick on it goes on as changed, in another stretch. What was
                logged until then is saved to a file of its own.

        Returns:
            The new revision, and how many elements changed.

        Raises:
            ElementError: they are no list of edits.
            RefusedError: the logger runs (without `cut`) or can't be cut now, the table has changed since, or an edit
                can't be; nothing was changed.
        """
        if isinstance(edits, str) or not isinstance(edits, Sequence):
            raise ElementError(f"edits must be a list of silo.Edit, got {shown(edits)}; nothing was changed")
        if any(isinstance(one, Edit) and not _is_whole(one) for one in edits):
            from silo.settings.typed import whole_edits  # who only asks, as `silo ls`, doesn't load it

            table = self.table()
            revision = table.revision if revision == -1 else revision
            status = self._call(request_of(StateRequests._get_status)).status
            edits = whole_edits(edits, table.elements, status.prefix, status.frequency_hz)
        return self._call(ApplyEdits(revision=revision, edits=list(edits), cut=switch("cut", cut)))


def _is_whole(edit: Edit) -> bool:
    return isinstance(edit.options, ElementOptions) and edit.name.startswith("/")


@told_class("client")
class EventRequests(Caller):
    """The event log, and marks in it."""

    def events(self, since: int = 0, limit: int = 1000) -> list[LoggedEvent]:
        """Return what happened after line `since` of the event log: the newest `limit` lines of it, oldest first.

        Args:
            since: the number of a line; `number` of the last line returned is the next one.
            limit: how many lines at most.

        Returns:
            Events with their ticks, time stamps in ns, and who did it.

        Raises:
            RefusedError: the limit is out of range.
            ConnectionLostError: the helper process doesn't answer.
        """
        return self._get_events(since, limit).events

    @ask()
    def _get_events(self, since: int = 0, limit: int = 1000) -> Events:
        """What happened after line `since` of the event log? The newest `limit` of it."""

    def mark(self, text: str, tick: int | None = None, *, at_ns: int | None = None) -> LoggedEvent:
        """Mark a tick of the present run, by default the newest, with some words.

        Args:
            text: the words.
            tick: which tick since start; the newest if it isn't given.
            at_ns: a time stamp in ns instead; the newest tick up to it is marked.

        Returns:
            The line of the event log.

        Raises:
            ElementError: the words or a number make no sense.
            RefusedError: there is no such tick any more; nothing was marked.
            GoesOnError: it is marked, and its line not written yet: the disk takes long.
            ConnectionLostError: the helper process doesn't answer.
        """
        return self._add_mark(
            line("text", text, 'client.mark("slipped")'),
            -1 if tick is None else whole("tick", tick, 0, 2**62),
            0 if at_ns is None else whole("at_ns", at_ns, 1, 2**63 - 1),
        ).event

    @change(control=False, timeout_s=2.0)
    def _add_mark(self, text: str, tick: int = -1, at_ns: int = 0) -> Marked:
        """Mark a tick of the present run with some words; -1 is the newest.

        With a time stamp `at_ns`, the newest tick up to it.
        """


def _status(reply: StatusReply, told: Callable[[str], None] | None) -> Status:
    if reply.text and told is not None:
        told(reply.text)
    return reply.status


def refused_running() -> RequestRefusedError:
    """Return what is raised for an edit of a logger that runs."""
    text = "the logger is running: stop it first, or have it go on as changed (--cut, cut=True); nothing was changed"
    return RequestRefusedError(RefusedWhy.RUNNING, text)


def check_revision(request: ApplyEdits, revision: int) -> None:
    """Raise RequestRefusedError for edits that are based on another revision than the table's."""
    if request.revision not in (-1, revision):
        raise RequestRefusedError(
            RefusedWhy.CONFLICT,
            f"somebody changed the table meanwhile (it is at revision {revision}, the edits are based on "
            f"{request.revision}): read it again; nothing was changed",
        )


def check_none(problems: list[Problem]) -> None:
    """Raise RequestRefusedError with what is wrong, if something is."""
    if problems:
        from silo.settings.options import refusal  # what lists loggers has no use for

        raise RequestRefusedError(RefusedWhy.INVALID, refusal(problems), problems)
