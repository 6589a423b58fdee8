"""What travels between a logger's helper process and its clients.

All are msgspec structs in msgpack. Requests that only read go to the key `ask`, those that change something to `do`:
two keys, so that roles can be given by access control. Every request gets exactly one reply.
"""

import enum

import msgspec

from silo.model import Edit, FieldChange, FileType, Problem, SavedFile, State, Status, Table

PROTOCOL = 1

# ------------------------------------------------------------------------------------------------- requests: `ask`


class Request(msgspec.Struct, frozen=True, tag=True, kw_only=True):
    """Base of all requests. `client` says who asks, for events: `alice@laptop silo-tui 4711`."""

    client: str = ""


class Hello(Request, frozen=True):
    """Who am I and what may I do? Answered by `HelloReply`. Everybody may ask."""


class GetStatus(Request, frozen=True):
    """Answered by `Status`."""


class GetTable(Request, frozen=True):
    """Answered by `Table`."""


class ListScripts(Request, frozen=True):
    """Answered by `Scripts`: the YAML files in the folder of the logger's script."""


class ReadScript(Request, frozen=True):
    """Answered by `ScriptText`. An empty path is the running configuration as a script."""

    path: str = ""


class DiffScript(Request, frozen=True):
    """What loading this script would change; checks it too. Answered by `ScriptDiff`."""

    path: str = ""


class GetHistory(Request, frozen=True):
    """Past samples in columns of `column_ns`; answered by `Columns`. Column k covers `[k, k + 1) * column_ns`.

    `names` are entry names (`/log/q_x`). At most 4096 columns.
    """

    names: list[str]
    start_ns: int
    end_ns: int
    column_ns: int


class OpenView(Request, frozen=True):
    """Opens or replaces the view `view` (an id that the client makes): one `ViewFrame` per refresh.

    `values` are element names of which the newest value of every entry is wanted, `plots` entry names of which minimum
    and maximum per column of `column_ns` are wanted. A view ends when it isn't opened again within its lease (6 s; the
    same request renews it) or when its client's liveliness token disappears. Answered by `ViewOpened`.
    """

    view: str
    values: list[str] = []
    plots: list[str] = []
    rate_hz: float = 5.0
    column_ns: int = 100_000_000


class CloseView(Request, frozen=True):
    """Answered by `Done`."""

    view: str


# -------------------------------------------------------------------------------------------------- requests: `do`


class ApplyEdits(Request, frozen=True):
    """All or nothing, and only while stopped. `revision` is the table's that the edits are based on (-1: any)."""

    revision: int
    edits: list[Edit]


class Start(Request, frozen=True):
    """Answered by `Status`."""


class Stop(Request, frozen=True):
    """Answered by `Status`. Stopping a stopped logger succeeds."""


class Restart(Request, frozen=True):
    """Answered by `Status`."""


class Save(Request, frozen=True):
    """Save the data in the helper process. Answered by `SaveStarted` at once; progress and result come as events.

    `name` replaces the usual file name (a plain name: no `/`, no leading dot). `folder` (absolute) replaces the
    logger's own; only the robot program may choose it.
    """

    types: list[FileType]
    name: str = ""
    folder: str = ""


class LoadScript(Request, frozen=True):
    """Apply a script, only while stopped. Answered by `EditsApplied` (with the unknown names) or `Refused`."""

    path: str = ""
    revision: int = -1


class SaveScript(Request, frozen=True):
    """Write the configuration to a script inside the script folder. Answered by `Done`, or `Refused` if it exists."""

    path: str = ""
    overwrite: bool = False


# --------------------------------------------------------------------------------------------------------- replies


class Reply(msgspec.Struct, frozen=True, tag=True):
    """Base of the replies that are not nouns of their own."""


class HelloReply(Reply, frozen=True):
    """`may_edit` tells whether `do` requests of this client get through."""

    protocol: int
    version: str
    user: str
    may_edit: bool
    status: Status


class StatusReply(Reply, frozen=True):
    """Carries a `Status`."""

    status: Status


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
    """What differs between the running configuration (`old`) and a script (`new`); `unknown` names the table lacks."""

    path: str
    changes: list[FieldChange]
    unknown: list[str]


class EditsApplied(Reply, frozen=True):
    """`changed` counts elements; `unknown` are names of a script that the table doesn't have."""

    revision: int
    changed: int
    unknown: list[str] = []


class ViewOpened(Reply, frozen=True):
    """How to read the frames of a view.

    `entries` are the entries of `values`, element after element; `unpublished` the elements without live values (their
    action is SAVE, or they are disabled); `missing` the names that the table doesn't have.
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


class SaveStarted(Reply, frozen=True):
    """`job` is the number under which events speak of this save."""

    job: int


class Done(Reply, frozen=True):
    """It worked; `text` says what was done, fit to show."""

    text: str = ""


class RefusedWhy(str, enum.Enum):
    """The reasons that a client can act on."""

    RUNNING = "running"  # stop first
    CONFLICT = "conflict"  # somebody else changed the table: read it again
    INVALID = "invalid"
    NOT_FOUND = "not found"
    EXISTS = "exists"
    FORBIDDEN = "forbidden"
    DEAD = "dead"
    FAILED = "failed"


class Refused(Reply, frozen=True):
    """Nothing was changed. `text` says why and what to do; `problems` has one line per rejected field."""

    why: RefusedWhy
    text: str
    problems: list[Problem] = []


AnyAsk = Hello | GetStatus | GetTable | ListScripts | ReadScript | DiffScript | GetHistory | OpenView | CloseView
AnyDo = ApplyEdits | Start | Stop | Restart | Save | LoadScript | SaveScript
AnyReply = (
    HelloReply | StatusReply | TableReply | Scripts | ScriptText | ScriptDiff | EditsApplied
    | ViewOpened | Columns | SaveStarted | Done | Refused
)  # fmt: skip


# ------------------------------------------------------------------------------------------------ published: views


class ViewFrame(msgspec.Struct, frozen=True, omit_defaults=True):
    """One refresh of one view: put on `.../view/<id>`.

    `number` counts frames, so that gaps are seen. `generation` is that of the `ViewOpened` that explains the frame: it
    changes with a restart or an edit, and the client opens the view again. `held` and `lost` have one int64 per element
    of `values`; `newest` one float64 per entry (NaN where there is none); `texts` holds by its position each newest
    value that a float64 can't tell: strings, dates, NaT, complex numbers, the digits of integers from 2**53 on;
    `low`/`high` float64 of shape `(len(plots), count)`: columns `first ... first + count - 1`, the last of them perhaps
    not complete yet (it comes again), with `marks` and `bases` as in `Columns`. They hold every sample since the frame
    before; where some were skipped `since_ns` is the time from which on they are whole, else 0.
    """

    number: int
    generation: int
    time_ns: int
    tick: int
    state: State
    measured_hz: float
    lost_total: int
    held: bytes
    lost: bytes
    newest: bytes
    texts: dict[int, str]
    first: int
    count: int
    low: bytes
    high: bytes
    marks: bytes = b""
    bases: dict[int, int] = {}
    since_ns: int = 0


# ----------------------------------------------------------------------------------------------- published: events


class EventKind(str, enum.Enum):
    """What happened."""

    STARTED = "started"
    STOPPED = "stopped"
    EDITED = "edited"
    SAVING = "saving"  # progress
    SAVED = "saved"
    SAVE_FAILED = "save failed"
    LOST = "lost"
    CRASHED = "crashed"
    RECOVERED = "recovered"
    CLOSED = "closed"
    SCRIPT_SAVED = "script saved"
    SCRIPT_LOADED = "script loaded"


class Event(msgspec.Struct, frozen=True):
    """Put on `.../event`; `text` is fit to show as it stands. `number` counts all events of a helper."""

    number: int
    time_ns: int
    kind: EventKind
    text: str
    by: str = ""
    status: Status | None = None
    job: int = 0
    progress: float = 0.0
    files: list[SavedFile] = []
