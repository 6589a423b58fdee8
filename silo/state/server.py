"""Who is there and how the logger stands; starting and stopping it; its table and edits of it; its event log."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

from silo.core.conditions import Conditions
from silo.core.elements import Edit, Problem, State
from silo.errors import GoesOnError
from silo.net.access.senders import SAYS_SO, bracketed
from silo.net.keys import may_use
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Done, Request, request_of
from silo.rpc.published import EventKind, Summary
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.rpc.versions import OLDEST, PROTOCOL
from silo.settings.options import MAX_NAME, edit_problems, shorten
from silo.state import requests
from silo.state.events import EventNotifier, plain
from silo.state.replica import LoggerSnapshot, Replica
from silo.state.requests import (
    ApplyEdits,
    EditsApplied,
    StateRequests,
    StatusReply,
    Unsaved,
    check_none,
    check_revision,
)
from silo.state.robot_program import RobotProgram
from silo.state.table_parts import TableReply
from silo.version import VERSION

MOST_EVENTS_AT_ONCE = 10_000
MOST_MARK_LETTERS = 200
WRITTEN_S = 0.5  # a disk that takes longer holds no client up

IS_DERIVED = (
    "is derived from others, and has no divider, buffer or action of its own; edit those, or give it another "
    "expression (silo derive)"
)


@dataclass(frozen=True)
class Outside:
    """What stands here of those who look on, whom other features know."""

    name_client: Callable[[str, str], None]  # the id of a client, and who it is
    summary: Callable[[], Summary]
    closed: Callable[[], str]  # why nobody from the network may change anything


@dataclass(frozen=True)
class StateServer(Server, does=[requests]):
    """Answers how the logger stands, and has it started, stopped and edited."""

    replica: Replica
    events: EventNotifier
    robot: RobotProgram
    outside: Outside

    def hello(self, request: requests.Hello) -> requests.HelloReply:
        if request.id and may_use(request.id, request.proof):
            # who says it by its own key, too, is known
            self.outside.name_client(plain(request.id), f"{bracketed(plain(request.client))}{SAYS_SO}")
        # a client that gets this from the key `do` too may edit
        status, closed, newest = self.replica.status(), self.outside.closed(), self.events.log.newest
        user = self.replica.user
        return requests.HelloReply(PROTOCOL, VERSION, user, True, status, OLDEST, closed, clock_s(), newest, True)

    def get_status(self) -> StatusReply:
        return StatusReply(self.replica.status())

    def get_summary(self, request: requests.GetSummary) -> requests.SummaryReply:
        return requests.SummaryReply(self.outside.summary())

    def start(self, turn: Turn, unsaved: Unsaved) -> StatusReply:
        return self._status_after(request_of(StateRequests._start, unsaved), turn)

    def stop(self, turn: Turn) -> StatusReply:
        return self._status_after(request_of(StateRequests._stop), turn)

    def restart(self, turn: Turn, unsaved: Unsaved) -> StatusReply:
        return self._status_after(request_of(StateRequests._restart, unsaved), turn)

    def _status_after(self, request: Request[StatusReply], turn: Turn) -> StatusReply:
        reply = self.robot.ask(request, turn)
        return StatusReply(self.replica.status(), reply.text if isinstance(reply, Done) else "")

    def table(self, start: int, most_bytes: int) -> TableReply | bytes:
        encoded = self.replica.now.encoded_table
        return encoded.part(start, most_bytes) if most_bytes else encoded.whole

    def apply_edits(self, turn: Turn, request: ApplyEdits) -> EditsApplied:
        self.robot.must_live()
        if not request.cut:
            self.robot.must_stop()
        return apply_edits(self.robot, turn, request, self.replica.now)

    def get_events(self, since: int, limit: int) -> requests.Events:
        if not 0 <= limit <= MOST_EVENTS_AT_ONCE:
            text = f"the limit of events must be 0 to {MOST_EVENTS_AT_ONCE}, got {limit}"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        return requests.Events(*self.events.log.since(since, limit))

    def add_mark(self, turn: Turn, text: str, tick: int, at_ns: int) -> requests.Marked:
        events, replica = self.events, self.replica
        words = plain(text, MOST_MARK_LETTERS).strip()
        status = replica.status()
        problem, meant = "", tick if tick >= 0 else None
        if not words:
            problem = "a mark needs some words"
        elif not -1 <= tick < max(status.ticks, 0):
            there = f"0 to {status.ticks - 1}" if status.ticks else "none yet"
            problem = f"there is no tick {tick} (ticks: {there})"
        elif at_ns and (meant := replica.tick_at(at_ns)) < 0:
            problem = "no tick of that time is held any more"
        if problem:
            raise RequestRefusedError(RefusedWhy.INVALID, f"{problem}; nothing was marked")
        # who typed the words meant the moment of the key, for both: how long ago its tick was, the stamps know
        age_ns = 0
        if at_ns and meant is not None and status.state is State.RUNNING:
            age_ns = status.last_tick_ns - replica.stamp_of(meant)
        time_ns = time.time_ns() - max(0, age_ns)
        mark = events.publish(EventKind.MARKER, words, by=turn.by, tick=meant, time_ns=time_ns)
        written = events.log.settled(mark, WRITTEN_S)
        if written is None:
            raise GoesOnError(
                "the mark is noted, and the disk of the event log takes long just now: until it is there, a kill of "
                "the helper process would lose it"
            )
        return requests.Marked(written)  # it outlives a kill of this process, and has its number for good


def apply_edits(
    robot: RobotProgram, turn: Turn, request: ApplyEdits, now: LoggerSnapshot, *, fit: bool = False
) -> EditsApplied:
    """Have edits of the table that is there now done, once they are checked. Raises what refuses them.

    `fit`: the conditions were found to fit this table, and are based on it.
    """
    check_edits(request, now)
    if request.conditions is not None and not fit:
        # they fit this table: for the robot program, whose loop goes on, they are then to be taken
        conditions = fitting(request.conditions, request.edits, now)
        request = msgspec.structs.replace(request, revision=now.table.revision, conditions=conditions)
    elif request.conditions is None and not request.edits:
        return EditsApplied(robot.replica.now.table.revision, 0)
    return robot.reply(request, turn)


def fitting(conditions: Conditions, edits: Sequence[Edit], now: LoggerSnapshot) -> Conditions:
    """Return conditions that fit the table as it is once edits of it are done.

    Raises ElementError for the first that doesn't.
    """
    from silo.settings.script_conditions import checked_conditions

    elements = list(now.table.elements)
    for edit in edits:
        place = now.names.places[edit.name]
        elements[place] = msgspec.structs.replace(elements[place], options=edit.options)
    there = now.robot.conditions.triggers
    return checked_conditions(conditions, elements, now.options.prefix, now.options.frequency_hz, there)


def check_edits(request: ApplyEdits, now: LoggerSnapshot) -> None:
    """Raise why edits of the present table can't be applied; what can be told here never reaches the robot process."""
    check_revision(request, now.table.revision)
    places, own = now.names.places, len(now.table.elements)
    derived = next((edit.name for edit in request.edits if places.get(edit.name, -1) >= own), None)
    if derived is not None:
        check_none([Problem(shorten(derived, MAX_NAME), "name", IS_DERIVED)])
    check_none(edit_problems(request.edits, places))
