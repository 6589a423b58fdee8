"""What travels between a logger's helper process and its clients.

All are msgspec structs in msgpack. Requests that only read go to the key `ask`, those that change something to `do`:
two keys, so that roles can be given by access control. Every request gets exactly one reply.

A request says here all that there is to know of it: its fields, its key, its reply, how long its client waits. What is
done is one handler in `silo.helper.answers` (and, if the robot process does it, one in `silo.logger.answers`); who asks
calls a method of `silo.ipc.client.Client`.
"""

import enum
import functools
import operator
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeAlias, TypeVar, get_args

import msgspec

from silo.errors import RefusedError
from silo.ipc.conditions import LimitStatus, TriggerStatus
from silo.ipc.sampled import SampledName, SampledRows
from silo.model import (
    Edit,
    Extras,
    FieldChange,
    FileType,
    LoggedEvent,
    Problem,
    RecorderState,
    SignalLimits,
    Status,
    Table,
    TriggerOptions,
)

ReplyT = TypeVar("ReplyT", bound="Reply")

# --------------------------------------------------------------------------------------------------------- replies


class Reply(msgspec.Struct, frozen=True, tag=True):
    """Base of the replies that are not nouns of their own."""


class HelloReply(Reply, frozen=True):
    """`may_edit` tells whether `do` requests of this client get through. `oldest` to `protocol` are understood."""

    protocol: int
    version: str
    user: str
    may_edit: bool
    status: Status
    oldest: int = 1


class StatusReply(Reply, frozen=True):
    """Carries a `Status`; `text` says what else was done, empty for nothing."""

    status: Status
    text: str = ""


class TableReply(Reply, frozen=True):
    """Carries a `Table`."""

    table: Table


class Scripts(Reply, frozen=True):
    """`names` relative to `folder`; `current` is the logger's own."""

    folder: str
    names: list[str]
    current: str


class ScriptText(Reply, frozen=True):
    """A script's text; `path` as it stands on the robot."""

    path: str
    text: str


class ScriptDiff(Reply, frozen=True):
    """What differs between the running configuration (`old`) and a script (`new`); `unknown` names the table lacks.

    `warnings` are `file:line: reason` of keys that silo doesn't know.
    """

    path: str
    changes: list[FieldChange]
    unknown: list[str]
    warnings: list[str] = []


class EditsApplied(Reply, frozen=True):
    """`changed` counts elements; `unknown` are names of a script that the table doesn't have.

    `warnings` are `file:line: reason` of keys of the script that silo doesn't know.
    """

    revision: int
    changed: int
    unknown: list[str] = []
    warnings: list[str] = []


class Survey(Reply, frozen=True):
    """`values`: float64 of shape `(quantities, names)`, NaN where a quantity isn't known.

    Without names they are those of the table of `revision`, in its order. Statistics begin at `since_ns`; `skipped`
    rows were overwritten before they could be read, because their buffer is very small. `jitter_s` is that of the loop:
    the standard deviation of the time between its ticks, 0 where it isn't known.
    """

    revision: int
    time_ns: int
    since_ns: int
    values: bytes
    skipped: int = 0
    jitter_s: float = 0.0


class ViewOpened(Reply, frozen=True):
    """How to read the frames of a view.

    `entries` are the entries of `values`, element after element; `unpublished` the elements without live values, as
    they are disabled (frames say of the others why they aren't live); `missing` the names that the table doesn't have.
    """

    view: str
    generation: int
    entries: list[str]
    plots: list[str]
    unpublished: list[str]
    missing: list[str]


class Columns(Reply, frozen=True, omit_defaults=True):
    """Minimum and maximum per column: little-endian float64 of shape `(len(names), count)`, NaN without finite value.

    They are offsets from `bases` (by place in `names`, 0 where it isn't named), so that integers beyond 2^53 are exact.
    `marks` are bytes of the same shape, empty for all 0: see `silo.columns.Mark`, and `Hole` in the upper four bits.
    `until_ns` is the newest time stamp that is surely in it.
    """

    names: list[str]
    first: int
    count: int
    column_ns: int
    low: bytes
    high: bytes
    marks: bytes = b""
    bases: dict[int, int] = {}
    until_ns: int = 0


class SampleRows(Reply, frozen=True, omit_defaults=True):
    """Raw rows of some names, see `silo.ipc.sampled`. `rows` has at most one stretch per group.

    `resume` has for each group the row to go on with and the row to end before; both are equal where nothing is left.
    Ask again with it and with `run` until then. `names` explains the rows, and comes with the first reply only.
    `missing` says of names without rows why, by name.
    """

    run: str
    rows: list[SampledRows]
    resume: list[tuple[int, int]]
    names: list[SampledName] = []
    missing: dict[str, str] = {}


class StreamOpened(Reply, frozen=True):
    """How to read the frames of a stream: those of this `generation` have groups as in `names`."""

    stream: str
    generation: int
    names: list[SampledName]
    missing: dict[str, str]


class PinOpened(Reply, frozen=True):
    """What a pin holds: rows of the `run` with time stamps from `begin_ns` to `end_ns`, both included, 0 where none.

    `text` says what of the wish could not be had, and why; empty where all of it is held.
    """

    pin: str
    run: str
    begin_ns: int
    end_ns: int
    size_bytes: int
    missing: dict[str, str] = {}
    text: str = ""


class RecordingFile(msgspec.Struct, frozen=True, omit_defaults=True):
    """One file (or bag folder) of a recording in the logger's folder; `name` is relative to it."""

    name: str
    type: FileType
    size_bytes: int
    changed_ns: int  # by the robot's clock


class SavedRecording(msgspec.Struct, frozen=True, omit_defaults=True):
    """One save: the files of it, all of one `stem`.

    begun_ns: its first time stamp, ns; 0 where its files don't say. why: it was saved, in a few words. logger: which
    one wrote it. own: this one did, so that it may be deleted here. unfinished: it is being written, or its writer
    died. unread: its files were not looked into yet, ask again.
    """

    stem: str
    files: list[RecordingFile]
    begun_ns: int = 0
    span_s: float = 0.0
    why: str = ""
    logger: str = ""
    markers: int = 0
    own: bool = False
    unfinished: bool = False
    unread: bool = False

    @property
    def size_bytes(self) -> int:
        """Bytes of all its files."""
        return sum(file.size_bytes for file in self.files)


class Recordings(Reply, frozen=True):
    """What is in the logger's own folder, the newest first: at most as many as asked for, of `count`.

    `disk_bytes` is the size of the disk of the folder, `free_bytes` what is free of it.
    """

    folder: str
    recordings: list[SavedRecording]
    count: int
    disk_bytes: int = 0
    free_bytes: int = 0


class PartOfRecording(msgspec.Struct, frozen=True):
    """One plain file to fetch; `path` is relative to the logger's folder. Another `mark` means another content."""

    path: str
    size_bytes: int
    mark: str
    changed_ns: int


class RecordingParts(Reply, frozen=True):
    """The plain files that make up a recording: of a bag those in its folder, of a CSV file also the one beside it."""

    name: str
    is_folder: bool
    parts: list[PartOfRecording]


class Piece(Reply, frozen=True):
    """A piece of a file: `crc32` is over the `count` bytes that were meant, which are in `data` if they were wished."""

    count: int
    crc32: int
    data: bytes = b""


class Triggers(Reply, frozen=True):
    """All triggers, as they stood when `tick` ticks of the `run` were judged."""

    run: str
    tick: int
    triggers: list[TriggerStatus]


class TriggerTried(Reply, frozen=True, omit_defaults=True):
    """At which ticks a trigger would have fired: each with its time stamp, the last 1000 of `fires`.

    Judged were the ticks `first` to `last` with time stamps from `begin_ns` to `end_ns`; at `blind` of `judged` of them
    the condition could not be told. `capture_bytes` is about how large a capture would be, all its files together.
    """

    fires: int
    ticks: list[int]
    time_ns: list[int]
    first: int
    last: int
    begin_ns: int
    end_ns: int
    judged: int = 0
    blind: int = 0
    capture_bytes: int = 0
    why: str = ""


class Alarms(Reply, frozen=True):
    """All scalars with limits, worst first."""

    run: str
    tick: int
    limits: list[LimitStatus]


class SaveStarted(Reply, frozen=True):
    """`job` is the number under which events speak of this save."""

    job: int


class RecorderInfo(msgspec.Struct, frozen=True):
    """An endless recording. `samples`, `lost` and `parts` count since it was started, `size_bytes` is on the disk now.

    `split_bytes`, `split_s` and `keep_bytes` are 0 for no limit; `text` says how it ended, if it did.
    """

    name: str
    folder: str
    state: RecorderState
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0
    part: str = ""
    parts: int = 0
    size_bytes: int = 0
    samples: int = 0
    lost: int = 0
    since_ns: int = 0
    by: str = ""
    text: str = ""
    pid: int = 0


class RecorderStarted(Reply, frozen=True):
    """It records. `folder` is absolute, on the robot; `text` says what will not be recorded as one may think."""

    name: str
    folder: str
    text: str = ""


class Recorders(Reply, frozen=True):
    """All recorders of a logger; those that ended by themselves stay until they are stopped."""

    recorders: list[RecorderInfo]


class Done(Reply, frozen=True):
    """It worked; `text` says what was done, fit to show."""

    text: str = ""


class Events(Reply, frozen=True):
    """Lines of the event log, oldest first. `missed` counts those asked for that are older and not among them."""

    events: list[LoggedEvent]
    missed: int = 0


class Marked(Reply, frozen=True):
    """The mark as it stands in the event log."""

    event: LoggedEvent


class GoesOn(Reply, frozen=True):
    """The robot process hasn't answered yet, and may still do it: an event with the number `job` tells how it ended."""

    job: int
    text: str


class RefusedWhy(str, enum.Enum):
    """The reasons that a client can act on. One that only a newer silo knows is read as FAILED."""

    RUNNING = "running"  # stop first
    CONFLICT = "conflict"  # somebody else changed the table: read it again
    INVALID = "invalid"
    NOT_FOUND = "not found"
    EXISTS = "exists"
    FORBIDDEN = "forbidden"
    DEAD = "dead"
    FAILED = "failed"
    UNSAVED = "unsaved"  # save or discard

    @classmethod
    def _missing_(cls, _: object) -> "RefusedWhy":
        return cls.FAILED


class Refused(Reply, frozen=True):
    """Nothing was changed. `text` says why and what to do; `problems` has one line per rejected field."""

    why: RefusedWhy
    text: str
    problems: list[Problem] = []


# -------------------------------------------------------------------------------------------------------- requests


class Request(msgspec.Struct, Generic[ReplyT], frozen=True, tag=True, kw_only=True):
    """Base of all requests, by the type of their reply.

    `client` says who asks, for events: `alice@laptop silo-tui 4711`; `protocol` is the client's, set when the request
    is sent (those of protocol 1 said none). `timeout_s` is how long a client waits, `max_bytes` what a helper process
    reads.
    """

    key: ClassVar[str]
    timeout_s: ClassVar[float]
    max_bytes: ClassVar[int]

    client: str = ""
    protocol: int = 1


class Ask(Request[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that only read."""

    key: ClassVar[str] = "ask"
    timeout_s: ClassVar[float] = 2.0
    max_bytes: ClassVar[int] = 2 * 2**20


class SlowAsk(Ask[ReplyT], Generic[ReplyT], frozen=True):
    """Base of those for which files or gigabytes are read: a thread of its own answers them."""

    timeout_s: ClassVar[float] = 15.0


class Do(Request[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that change something."""

    key: ClassVar[str] = "do"
    timeout_s: ClassVar[float] = 8.0  # the helper itself waits 5 s for the robot process
    max_bytes: ClassVar[int] = 8 * 2**20 - 4096  # with Zenoh's own bytes within MAX_MESSAGE_BYTES


class RobotRequest(Do[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that the helper process hands on to the robot process."""


# ------------------------------------------------------------------------------------------------ requests that read


class Hello(Ask[HelloReply], frozen=True):
    """Who am I and what may I do? Answered whatever protocol and `version` the client has.

    May be asked on the key `do` too: only who may change something gets an answer.
    """

    version: str = ""


class GetStatus(Ask[StatusReply], frozen=True):
    """What is the logger's state?"""


class GetTable(Ask[TableReply], frozen=True):
    """Which elements are there, with which options?"""


class ListRecorders(Ask[Recorders], frozen=True):
    """Which endless recordings are there, and how far are they?"""


class GetEvents(Ask[Events], frozen=True):
    """What happened after line `since` of the event log? The newest `limit` of it."""

    since: int = 0
    limit: int = 1000


class ListScripts(SlowAsk[Scripts], frozen=True):
    """Which YAML files are in the folder of the logger's script?"""

    timeout_s: ClassVar[float] = 15.0


class ReadScript(SlowAsk[ScriptText], frozen=True):
    """What stands in a script? An empty path is the running configuration as a script."""

    path: str = ""


class DiffScript(SlowAsk[ScriptDiff], frozen=True):
    """What would loading this script change? Checks it too."""

    path: str = ""


class GetHistory(SlowAsk[Columns], frozen=True):
    """Past samples in columns of `column_ns`. Column k covers `[k, k + 1) * column_ns`.

    `names` are entry names (`/log/q_x`). At most 4096 columns.
    """

    names: list[str]
    start_ns: int
    end_ns: int
    column_ns: int
    pin: str = ""  # of what this pin holds


class By(str, enum.Enum):
    """What the ends of a stretch of samples count."""

    TIME = "time"  # ns
    TICK = "tick"  # since start
    ROW = "row"  # samples since start, of each element its own


def by_of(word: By | str) -> By:
    """Return what a word means. Raises RefusedError for one that means nothing."""
    try:
        return By(word)
    except ValueError:
        raise RefusedError(f"by must be 'time', 'tick' or 'row', got {word!r}; nothing was asked") from None


class GetSamples(SlowAsk[SampleRows], frozen=True):
    """Raw samples of elements or entries, with `start <= time stamp, tick or row < end`; of what a pin holds, if named.

    The reply has at most `reply_bytes` of rows and says how to go on: ask again with its `run` and `resume`.
    """

    names: list[str]
    start: int = -(2**62)
    end: int = 2**62
    by: By = By.TIME
    reply_bytes: int = 2**20
    pin: str = ""
    run: str = ""
    resume: list[tuple[int, int]] = []


class OpenStream(Ask[StreamOpened], frozen=True):
    """Open or renew the stream `stream` (an id as of a view): all samples of these names from now on, as they come.

    Frames come each `period_s` on `.../stream/<id>`. Leased as a view is. Frames that the client does not take in time
    are dropped: its rows are numbered, so that it sees the gap.
    """

    stream: str
    names: list[str]
    period_s: float = 0.05


class CloseStream(Ask[Done], frozen=True):
    """Send no more frames of this stream."""

    stream: str


class OpenPin(SlowAsk[PinOpened], frozen=True):
    """Copy what the buffers hold of these names from `start_ns` to `end_ns`, both included, for later requests.

    `pin` is an id as of a view. The newest part is copied where not all fits. It ends when it isn't kept for 30 s.
    """

    pin: str
    names: list[str]
    start_ns: int
    end_ns: int


class KeepPin(Ask[Done], frozen=True):
    """I still need this pin; refused (why: NOT_FOUND) where it is no more."""

    pin: str


class ClosePin(Ask[Done], frozen=True):
    """Forget this pin."""

    pin: str


class ListRecordings(SlowAsk[Recordings], frozen=True):
    """Which recordings are in the logger's own folder? The newest first, at most `most`."""

    most: int = 1000


class GetParts(SlowAsk[RecordingParts], frozen=True):
    """Which plain files make up the recording `name`, a file or bag folder of the list?"""

    name: str


class GetPiece(SlowAsk[Piece], frozen=True):
    """Read `count` bytes from `offset` on of a part of a recording; at most 4 MB, to be summed up only 64 MB.

    Refused (why: CONFLICT) where the file isn't the one with that `mark` any more.
    """

    path: str
    mark: str
    offset: int
    count: int
    sum_only: bool = False


class GetSurvey(SlowAsk[Survey], frozen=True):
    """Quantities (`silo.ipc.surveys`) of some elements or entries, of all elements of the table without `names`.

    Statistics are over every sample since this client asked first, or since its last `reset`; they end when it hasn't
    asked for a minute.
    """

    quantities: list[str]
    names: list[str] = []
    reset: bool = False


class OpenView(Ask[ViewOpened], frozen=True):
    """Open or replace the view `view` (an id that the client makes): one `ViewFrame` per refresh.

    `values` are element names of which the newest value of every entry is wanted, `plots` entry names of which minimum
    and maximum per column of `column_ns` are wanted. A view ends when it isn't opened again within its lease (6 s; the
    same request renews it) or when its client's liveliness token disappears.
    """

    view: str
    values: list[str] = []
    plots: list[str] = []
    rate_hz: float = 5.0
    column_ns: int = 100_000_000


class CloseView(Ask[Done], frozen=True):
    """Send no more frames of this view."""

    view: str


class GetTriggers(Ask[Triggers], frozen=True):
    """How do the triggers stand?"""


class TryTrigger(SlowAsk[TriggerTried], frozen=True):
    """When would this trigger have fired, in all that the buffers hold now? Its name plays no part."""

    trigger: TriggerOptions


class GetLimits(Ask[Alarms], frozen=True):
    """How do the signals with limits stand?"""


# ---------------------------------------------------------------------------------------------- requests that change


class ApplyEdits(RobotRequest[EditsApplied], frozen=True):
    """All or nothing, and only while stopped. `revision` is the table's that the edits are based on (-1: any)."""

    revision: int
    edits: list[Edit]
    extras: Extras | None = None  # derived signals, limits and triggers of a script, None: they stay


class SetTrigger(RobotRequest[Done], frozen=True):
    """Add a trigger, or replace the one of its name; judged from now on, also while it runs.

    With `lease_s` (0.5 to 600 s) the helper process alone holds it, beside those of the logger: in no script and no
    later program, and gone when the same request doesn't come again within that time, or by `RemoveTrigger`.
    """

    trigger: TriggerOptions
    lease_s: float = 0.0


class RemoveTrigger(RobotRequest[Done], frozen=True):
    """Forget a trigger; a capture that is under way goes on."""

    name: str


class SetLimits(RobotRequest[Done], frozen=True):
    """Give a signal limits, or other ones; judged from now on, also while it runs."""

    limits: SignalLimits


class RemoveLimits(RobotRequest[Done], frozen=True):
    """Forget the limits of a signal."""

    name: str


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


class Save(Do[SaveStarted], frozen=True):
    """Save the data in the helper process. The reply comes at once; progress and result come as events.

    `name` replaces the usual file name (a plain name: no `/`, no leading dot). `folder` (absolute) replaces the
    logger's own; only the robot program may choose it. `why` is kept in the files; without it, who asked.
    """

    timeout_s: ClassVar[float] = 2.0

    types: list[FileType]
    name: str = ""
    folder: str = ""
    why: str = ""


class DeleteRecording(Do[Done], frozen=True):
    """Delete a recording that this logger wrote: by the name of a file or bag folder that one, by its stem all of them.

    Refused for all that isn't surely of this logger.
    """

    timeout_s: ClassVar[float] = 30.0

    name: str


class StartRecorder(Do[RecorderStarted], frozen=True):
    """Record what these patterns mean (all without any) to MCAP files, from now on and across new starts.

    `folder` lies inside the logger's folder; only the robot program may name another. A part ends at `split_bytes` or
    after `split_s`; of all parts `keep_bytes` are kept, the oldest go. 0 is no limit. `name` is drawn if it is empty.
    """

    name: str = ""
    folder: str = ""
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0


class StopRecorder(Do[Done], frozen=True):
    """Finish the part and end; an empty name is the only one."""

    name: str = ""


class ArmTrigger(Do[Done], frozen=True):
    """Watch again, also after the one capture of mode single, or (not `armed`) no more."""

    name: str
    armed: bool = True


class ForceTrigger(Do[Done], frozen=True):
    """Fire at the newest tick, whatever the condition says."""

    name: str


class Acknowledge(Do[Done], frozen=True):
    """I have seen the alarms of these scalars, of all without `names`. `who` is shown, the client if it is empty."""

    names: list[str] = []
    who: str = ""


class AddMark(Do[Marked], frozen=True):
    """Mark a tick of the present run with some words; -1 is the newest.

    With a time stamp `at_ns`, the newest tick up to it.
    """

    timeout_s: ClassVar[float] = 2.0

    text: str
    tick: int = -1
    at_ns: int = 0


class LoadScript(Do[EditsApplied], frozen=True):
    """Apply a script, only while stopped. The reply has the names that the table lacks."""

    path: str = ""
    revision: int = -1


class SaveScript(Do[Done], frozen=True):
    """Write the configuration to a script inside the script folder; refused if it exists."""

    timeout_s: ClassVar[float] = 15.0

    path: str = ""
    overwrite: bool = False


# ------------------------------------------------------------------------------------------------- all there are


def leaves(base: type[msgspec.Struct]) -> tuple[type[Any], ...]:
    """Return the structs below a base that are no bases themselves."""
    found: list[type[Any]] = []
    for kind in base.__subclasses__():
        found += leaves(kind) or (kind,)
    return tuple(found)


def reply_type(request: type[Request[ReplyT]]) -> type[ReplyT]:
    """Return the type of the reply that a request declares."""
    kind: type[ReplyT] = get_args(vars(request)["__orig_bases__"][0])[0]
    return kind


if TYPE_CHECKING:
    AnyAsk: TypeAlias = Ask[Any]
    AnyDo: TypeAlias = Do[Any]
    AnyReply: TypeAlias = Reply
else:  # the unions of all of them, by whose tags msgspec decodes
    AnyAsk = functools.reduce(operator.or_, leaves(Ask))
    AnyDo = functools.reduce(operator.or_, leaves(Do))
    AnyReply = functools.reduce(operator.or_, leaves(Reply))
