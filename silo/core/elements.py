"""The nouns of silo: what an element is and how it is logged.

The same structs stand in the element table, in the script, on the wire and in saved files. This module imports
neither NumPy nor Zenoh, so that commands like `silo ls` start fast.
"""

import enum
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import msgspec

from silo.core.calls import (
    FORMER_WORDS,
    ToldStruct,
    no_attribute,
    present_word,
    present_words,
    told_names,
    unknown_argument,
    unknown_word,
)
from silo.core.names import did_you_mean, nearest
from silo.core.tuning.parameters import ParameterChange
from silo.errors import ArgumentError, ElementError, UnknownNameError

MAX_DIVIDER = 2**31 - 1
MAX_BUFFER_SIZE = 2**31 - 1


_OTHER_MEMBERS = {"BOTH": "SAVE_AND_PUBLISH", **dict.fromkeys(("RING", "CIRCULAR", "ROLLING"), "LOOPING")}


class _NamedClass(enum.EnumMeta):
    if not TYPE_CHECKING:  # which are to tell of any other name

        def __getattr__(cls, name: str) -> object:  # of a class of classes
            if name.startswith("_") or name in cls._member_map_:
                return super().__getattr__(name)
            near = nearest(_OTHER_MEMBERS.get(name.upper(), name.upper()), cls.__members__)
            words = f"silo.{cls.__name__} has no {name!r}; there are {', '.join(cls.__members__)}{did_you_mean(near)}"
            raise UnknownNameError(words, name=name)


class _Named(enum.IntEnum, metaclass=_NamedClass):
    """Numbers that are also found by their names: `Action("publish")`."""

    @classmethod
    def _missing_(cls, value: object) -> "_Named":
        found = cls.__members__.get(value.strip().upper().replace(" ", "_")) if isinstance(value, str) else None
        if found is None:
            raise ElementError(unknown_word(f"silo.{cls.__name__}", value, [name.lower() for name in cls.__members__]))
        return found


class Action(_Named):
    """What becomes of the samples of an element. The numbers are those of the script."""

    SAVE_AND_PUBLISH = 0
    SAVE = 1
    PUBLISH = 2

    @property
    def saves(self) -> bool:
        """Whether samples are written when the log is saved."""
        return self is not Action.PUBLISH

    @property
    def publishes(self) -> bool:
        """Whether samples can be seen live."""
        return self is not Action.SAVE


class BufferType(_Named):
    """Which samples a buffer keeps. The numbers are those of the script.

    FIXED keeps the first `size` samples, LOOPING the newest ones, GROWING all of them.
    """

    FIXED = 0
    LOOPING = 1
    GROWING = 2
    FIXED_SIZE = 0
    EXPONENTIALLY_GROWING = 2


class FileType(_Named):
    """What `save` writes. The numbers are those of the original's save service."""

    SILO = 0
    CSV = 1
    BAG = 2


FileTypeWord: TypeAlias = Literal["silo", "csv", "bag"]
FileTypes: TypeAlias = Iterable[FileType | FileTypeWord] | FileType | FileTypeWord  # as callers name them


class Storage(str, enum.Enum):
    """Where the buffers live.

    MEMORY: in shared memory; they survive the robot program and its helper process. DISK: there too, and the helper
    process keeps a journal of them in the log folder that survives a power cut. FILE: in a file in the log folder that
    the system writes when it likes; saves memory, survives what MEMORY does, promises nothing for a power cut.
    """

    MEMORY = "memory"
    DISK = "disk"
    FILE = "file"


class Threads(str, enum.Enum):
    """Who may call `collect()`: the thread of the first tick after each start, or any, one at a time."""

    SINGLE = "single"
    SERIALIZED = "serialized"


_SET = "log.set('x', divider=3) changes them; from another program client.apply([silo.Edit('x', divider=3)])"
_OF_OPTIONS = {
    "rate": "it is the logger's frequency / .divider",
    **dict.fromkeys(("buffersize", "length", "capacity"), "it is .size"),
    **dict.fromkeys(("on", "log", "active"), "it is .enabled"),
}


@told_names("options", fixed=_SET)
class ElementOptions(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    gc=False,
    rename={"buffer": "buffer_type", "size": "buffer_size"},  # on the wire and in files
    metaclass=ToldStruct,
):
    """How one element is logged: everything that the script and the terminal can edit.

    Attributes:
        enabled: whether it is logged.
        divider: it is collected at ticks 0, d, 2d, ...
        action: saved, published, or both.
        buffer: which samples its buffer keeps.
        size: samples.
    """

    enabled: bool = True
    divider: Annotated[int, msgspec.Meta(ge=1, le=MAX_DIVIDER)] = 1
    action: Action = Action.SAVE
    buffer: BufferType = BufferType.LOOPING
    size: Annotated[int, msgspec.Meta(ge=1, le=MAX_BUFFER_SIZE)] = 1

    if not TYPE_CHECKING:  # which are to tell of any other name

        def __getattr__(self, name: str) -> object:
            if name in FORMER_WORDS:
                return getattr(self, present_word(name))
            return no_attribute("options", name, type(self), _OF_OPTIONS)


DEFAULT_OPTIONS = ElementOptions()


class Entry(msgspec.Struct, frozen=True, gc=False):
    """One scalar of an element, as it stands in a saved file.

    `suffix` follows the element's name (`_x`, `_0_1`, empty for a scalar), `dtype` is a NumPy type string
    (`<f8`, `|b1`, `|S16`, `<M8[ns]`), `labels` names the values of an enumeration.
    """

    suffix: str
    dtype: str
    labels: dict[int, str] | None = None


_OF_INFO = {one: f"it is .options.{one}" for one in ("enabled", "divider", "action", "buffer", "size")} | dict.fromkeys(
    ("value", "newest", "values"), "log['x'].newest is the newest value, silo.Log(log.snapshot())['x'].values are all"
)


@told_names("a row of the element table", _OF_INFO)
class ElementInfo(msgspec.Struct, frozen=True, omit_defaults=True, gc=False):
    """One row of the element table.

    Attributes:
        name: the full name.
        unit: `-` for none.
        kind: how the entries belong together (`silo.core.kinds`).
        shape: that of the source, `()` for a scalar.
        entries: the scalars, as they stand in saved files.
        options: how it is logged.
        description: a line about it.
        dtype: the fields of a NumPy structure (`silo.core.kinds.struct_text`), empty for all else.
        expression: what a derived signal is computed by wherever rows are read, empty for all else.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    entries: tuple[Entry, ...]
    options: ElementOptions
    description: str = ""
    dtype: str = ""
    expression: str = ""


class Sought(str, enum.Enum):
    """What one looks for in the samples of a signal; `silo.expressions.search` has the rules."""

    HIGHEST = "highest"
    LOWEST = "lowest"
    CROSSING = "crossing"
    EDGE = "edge"
    PEAK = "peak"
    CHANGE = "change"
    NOT_FINITE = "not finite"
    OUTSIDE = "outside"
    HOLE = "hole"


class Stretch(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a recording is of a run that was cut, by the id of its first: stretch `part`, from 1, or `parts` as one.

    What a `recorder` wrote is a file of a stretch, of which there may be several, also where nothing was cut; it has
    recorded that stretch since a tick, -1 where that isn't known.
    """

    run: str
    part: int = 0
    parts: int = 1
    recorder: str = ""
    since: int = -1

    @property
    def text(self) -> str:
        """It, fit to show."""
        if self.recorder:
            files = "one file" if self.part else f"{self.parts} files"
            part = f"part {self.part} of " if self.part > 1 else ""
            return f"{files} of recording '{self.recorder}' of {part}run {self.run}"
        return f"part {self.part} of run {self.run}" if self.part else f"{self.parts} parts of run {self.run}"

    @property
    def alone(self) -> str:
        """What to tell who reads the file of one part, and others lie beside it; empty for all of a run."""
        way = "silo.open_log(..., alone=False)" if self.recorder else "silo.open_log"
        words = f"alone: :runs in silo-tui, `silo stats --whole` (plot, check, convert, too) and {way} read all as one"
        return f"{self.text}, {words}" if self.part else ""

    def is_beside(self, other: "Stretch | None") -> bool:
        """Whether both are parts of one run, or of one recording of it."""
        return other is not None and bool(self.part and other.part) and self.whole == other.whole

    @property
    def whole(self) -> tuple[str, str]:
        """What it is a part of: a run, and who recorded it."""
        return self.run, self.recorder


STARTED = "started"
MARKER = "marker"  # the kind of an event that somebody set
PARAMETER = "parameter"  # of one that tells what parameters were, or became
NOTED = (MARKER, PARAMETER)  # what the program notes in its segment
SEEN = ("triggered", "captured", "limit", "limit ended")  # kinds of what is seen in samples, and told once it is judged
TOLD_LATE_NS = 60_000_000_000  # so late is told, at most, what was before something else that is told already
LATE_NS = 1_000_000_000  # what no sample tells is told when it is; told so much after the newest tick, none comes
SEEN_LATE_NS = 3600_000_000_000  # told so much after its tick by the logger's clock: that clock isn't the wall's
ROBOT_PROGRAM = "the robot program"  # who it was, where no client asked for it
DAMAGED = "damaged"  # that of one in place of lines of the event log that can't be read
GOES_ON = "goes on after a cut: its ticks count from 0"  # what the start of a stretch says that isn't the first
CUT = "cut"  # that of one with which a run goes on in another stretch
UNHELD = "unheld"  # and of one that tells of an array that nobody but silo holds any more


class LoggedEvent(msgspec.Struct, frozen=True, omit_defaults=True):
    """Something that happened: a start, an edit, a mark ...; a line of the event log.

    `kind` is a word of `silo.rpc.published.EventKind`, `text` fit to show. `time_ns` is the wall clock's. `tick` counts
    since the start of `run`, -1 where there was none; `stamp_ns` is that tick's time stamp by the logger's own clock, 0
    where it isn't known. `who` is a client as it names itself, or the logger. `number` counts the lines of the log.
    `change` is what became of parameters, where it tells of that; `times` how often it was, where one line tells of
    several.
    """

    kind: str
    text: str
    time_ns: int = 0
    tick: int = -1
    stamp_ns: int = 0
    who: str = ""
    run: str = ""
    number: int = 0
    change: ParameterChange | None = None
    times: int = 1

    @property
    def at_ns(self) -> int:
        """Where it stands in plots: the time stamp of its tick, else the wall clock."""
        return self.stamp_ns or self.time_ns

    @property
    def clock_ns(self) -> int:
        """When it was, by the wall clock: at its tick, as in plots; what was told long after that, when it was told."""
        late_ns = self.time_ns - self.at_ns
        return self.at_ns if 0 <= late_ns < (SEEN_LATE_NS if self.kind in SEEN else LATE_NS) else self.time_ns


def by_clock(events: Iterable[LoggedEvent]) -> list[LoggedEvent]:
    """Events as they were told, those that were told some time later where they were, by the wall clock.

    As a start of which is told when its helper process is there, and a save beside it. What is earlier by more than a
    minute was told by a clock that was set back, and stays behind what was before.
    """
    pieces: list[list[LoggedEvent]] = [[]]
    newest_ns = 0
    for event in events:
        if event.clock_ns < newest_ns - TOLD_LATE_NS:
            pieces.append([])
            newest_ns = 0
        newest_ns = max(newest_ns, event.clock_ns)
        pieces[-1].append(event)
    return [event for piece in pieces for event in sorted(piece, key=lambda one: one.clock_ns)]


DEFAULT_MAX_TIME_S = 10.0


SCRIPT_OF_ALL = "logger.yaml"  # in whose folder every logger that names no script reads it, as in the original
OWN_SCRIPT = f".{SCRIPT_OF_ALL}"  # behind the name of a logger: its own, of which nobody said anything


def is_default_script(file: str) -> bool:
    """Return whether a script has a name that is taken where nobody asked for one."""
    return file == SCRIPT_OF_ALL or file.endswith(OWN_SCRIPT)


_OF_LOGGERS = {
    **dict.fromkeys(("frequency", "freq", "rate", "hz"), "it is .frequency_hz"),
    **dict.fromkeys(("max_time", "duration"), "it is .max_time_s"),
    **dict.fromkeys(("path", "dir", "directory"), "it is .folder"),
}


@told_names("options", _OF_LOGGERS, fixed="it is given when the logger is made: silo.Logger('robot', frequency=500)")
class LoggerOptions(msgspec.Struct, frozen=True):
    """What a logger is made with; see `silo.Logger` for the meaning of each.

    Attributes:
        name: of the logger.
        frequency_hz: control ticks per second.
        max_time_s: how long fixed and growing logs may become.
        prefix: start of all element names.
        script: YAML file with the configuration.
        folder: where saved files go.
        storage: what data survives.
        size_tiers: rings per divider and buffer type.
        memory_limit_mb: what growing buffers may take together.
        checked: variables are copied by NumPy instead of by address.
        threads: who may call `collect()`.
        id: drawn by the logger, tells it from others of its name.
        about: where its runs come from: host, versions, commit, and what the program says of them.
    """

    name: str = "silo"
    frequency_hz: float = 100.0
    max_time_s: float = DEFAULT_MAX_TIME_S
    prefix: str = "/log"
    script: str = SCRIPT_OF_ALL
    folder: str = "."
    storage: Storage = Storage.MEMORY
    size_tiers: int = 3
    memory_limit_mb: int = 1024
    checked: bool = False
    threads: Threads = Threads.SINGLE
    id: str = ""  # drawn by the logger, tells it from others of its name
    about: dict[str, str] = {}

    def default_buffer_size(self, divider: int) -> int:
        """Return samples that hold `max_time_s`; 10 s when the logging time is not limited.

        Args:
            divider: that of the element.
        """
        return buffer_size_for(self.max_time_s or 10.0, self.frequency_hz, divider)


class State(str, enum.Enum):
    """The life of a logger as its clients see it."""

    STOPPED = "stopped"
    RUNNING = "running"
    DEAD = "dead"  # the robot process is gone; the helper still answers


class Word(str, enum.Enum):
    """Base of words of the wire that may grow: one that only a newer silo knows is read as OTHER."""

    @classmethod
    def _missing_(cls, _: object) -> "Word":
        return cls["OTHER"]


class RecorderState(Word):
    """What a recorder does."""

    WAITING = "waiting"  # for the logger to start
    RECORDING = "recording"
    FINISHING = "finishing"
    ENDED = "ended"
    FAILED = "failed"  # it ended by itself: the text says why
    DIED = "died"  # it was killed, and is started again
    OTHER = "other"

    @property
    def over(self) -> bool:
        """Whether it ended as it should, or cannot go on."""
        return self in (RecorderState.ENDED, RecorderState.FAILED)


class GroupRole(str, enum.Enum):
    """What members of a group may do that is let in: look, or change things too."""

    VIEWER = "viewer"
    OPERATOR = "operator"


class ControlMode(str, enum.Enum):
    """Whether changes need control, or anybody's are done while nobody took it."""

    ANY = "any"
    ONE = "one"


class Present(msgspec.Struct, frozen=True):
    """A client that is connected: `who` in words; `identity` tells operators apart, empty for who only looks."""

    who: str
    since_ns: int
    identity: str = ""


class Control(msgspec.Struct, frozen=True):
    """Who alone may change a logger now, until `until_ns` (nanoseconds since 1970) unless it is renewed."""

    who: str
    identity: str
    since_ns: int
    until_ns: int


class Status(msgspec.Struct, frozen=True):
    """A logger at a glance. Times are nanoseconds since 1970; `lost` counts samples that could not be
    kept, all elements together."""

    logger: str
    host: str
    user: str
    pid: int
    helper_pid: int
    state: State
    revision: int
    frequency_hz: float
    measured_hz: float
    ticks: int
    started_ns: int
    last_tick_ns: int
    lost: int
    elements: int
    enabled: int
    entries: int
    max_time_s: float
    prefix: str
    folder: str
    script: str
    reason: str = ""  # why it stopped or died, with what to do next
    segment_bytes: int = 0
    saved: bool = True  # whether everything that was collected stands in a file
    durable_ticks: int = -1  # ticks that would survive a power cut now; -1 where that wasn't asked for
    held_samples: int = 0  # what the buffers hold of the elements that are saved, all together
    held_s: float = 0.0  # from the oldest of them to the newest
    failed: int = 0  # samples that stand for ones that could not be read, all elements together
    failed_most: dict[str, int] = {}  # the elements with most of them
    recorders: int = 0  # endless recordings that are under way
    derived: int = 0  # signals that are computed from elements
    room_bytes: int = 0  # that buffers of the next start may take: what is free, and what the present ones have
    disk_free_bytes: int = 0  # where its files are saved; both 0 where that isn't known
    disk_bytes: int = 0
    alarm: str = ""  # the worst of the limits that are violated now, in the letters of LimitWord
    alarms: int = 0  # how many are
    clients: list[Present] = []  # who is connected, first come first; the first twenty
    control: Control | None = None  # who alone may change it now; None: nobody took control
    one_operator: bool = False  # whether changes need control: `serve(control="one")`
    denied: int = 0  # logins and changes that were denied within the last hour
    unheld: dict[str, int] = {}  # elements whose array nobody but silo holds, the first ten, and the tick it was seen
    idle_s: float = 0.0  # while it runs: since its last tick, or its start
    held_runs: int = 0  # runs before the present one that recorders or triggers are not done with
    held_bytes: int = 0  # their memory
    held_runs_most: int = 0  # how many may be held, and how many bytes; 0 where that isn't known
    held_bytes_most: int = 0
    begun_ns: int = 0  # when the run began that cuts went on, and how many ticks it had before the last of them;
    before_ticks: int = 0  # both 0 without a cut: `started_ns` and `ticks` are since the last one
    program: str = ""  # drawn once in the life of a logger, as pids come again; empty from an older silo
    part: int = 0  # which stretch of the run it is since the last cut, as its file will be called; 0 without a cut

    def is_of_program(self, other: "Status") -> bool:
        """Whether both are of one life of a robot program."""
        return (self.pid, self.program) == (other.pid, other.program)

    @property
    def run_began_ns(self) -> int:
        """When the run began, whatever cuts it had since."""
        return self.begun_ns or self.started_ns

    @property
    def run_ticks(self) -> int:
        """How many ticks the run has, those before its cuts too."""
        return self.before_ticks + self.ticks


STALLED_S = 3.0  # on two busy processors a loop of 400 Hz stood still for up to 0.4 s
STALLED_PERIODS = 5
SLOW_SHARE = 0.95  # of the nominal rate, below which a loop or an element is slow


def is_stalled(idle_s: float, frequency_hz: float) -> bool:
    """Return whether a logger that runs has had no tick for so long that it is not only slow."""
    return idle_s >= STALLED_S and idle_s * frequency_hz >= STALLED_PERIODS


class Table(msgspec.Struct, frozen=True):
    """The element table at one revision. Order is that of registration and never changes while the logger lives.

    `derived` are signals that are computed from them, to be watched as elements are; nobody edits their options.
    `given` are the options that the program gave, by name, of those elements which have others now by a client's wish.
    """

    revision: int
    elements: list[ElementInfo]
    derived: list[ElementInfo] = []
    given: dict[str, ElementOptions] = {}


class _EditClass(ToldStruct):
    if not TYPE_CHECKING:

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: N805  # of a class of classes
            asked = {key: value for key, value in kwargs.items() if key not in cls.__struct_fields__}
            asked = present_words(asked, ElementOptions.__struct_fields__)
            wrong = next((key for key in asked if key not in ElementOptions.__struct_fields__), "")
            named = {key: value for key, value in kwargs.items() if key in cls.__struct_fields__}
            if wrong:
                known = [*cls.__struct_fields__, *ElementOptions.__struct_fields__]
                raise ArgumentError(unknown_argument("silo.Edit", wrong, known, {}))
            if asked and (len(args) > 1 or "options" in named):
                raise ArgumentError("silo.Edit() takes options=, or some by their names, got both; nothing was done")
            return super().__call__(*args, **named, **({"options": asked} if asked else {}))


class Edit(msgspec.Struct, frozen=True, metaclass=_EditClass):
    """What is to become of one element: `silo.Edit("/log/x", divider=3)`.

    Attributes:
        name: the element, as `log.set` takes it.
        options: all its new options; or some by their names, as `log.set` takes them, and the others stay.
    """

    name: str
    options: ElementOptions

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            options: ElementOptions = ...,
            *,
            enabled: bool | Literal["on", "off"] = ...,
            divider: int | str = ...,
            action: Action | Literal["save", "publish", "both"] = ...,
            buffer: BufferType | Literal["looping", "fixed", "growing"] = ...,
            size: int | str = ...,
        ) -> None: ...


class Problem(msgspec.Struct, frozen=True):
    """Why one field of one element was rejected."""

    name: str
    field: str
    reason: str


@told_names("a saved file", dict.fromkeys(("name", "filename", "file"), "it is .path"))
class SavedFile(msgspec.Struct, frozen=True):
    """One file (or bag folder) that a save wrote.

    Attributes:
        path: where it is.
        type: its format.
        size_bytes: how much it takes, with all files of a bag.
    """

    path: str
    type: FileType
    size_bytes: int

    def __fspath__(self) -> str:
        return self.path


class FieldChange(msgspec.Struct, frozen=True):
    """One difference between two configurations, in words fit to show."""

    name: str
    field: str
    old: str
    new: str


def buffer_size_for(seconds: float, frequency_hz: float, divider: int) -> int:
    """Return samples that `seconds` fill: `ceil(seconds * frequency / divider)`, at least 1, of any size."""
    # rounded before ceil: 0.1 s x 30 Hz is 3.0000000000000004 in floating point
    return max(1, math.ceil(round(seconds * frequency_hz / divider, 6)))


def join_name(prefix: str, group: str, name: str) -> str:
    """Return `prefix/group/name` with runs of `/` folded into one and none at the end.

    A name without group that begins with the prefix, as lists show it, is whole already.
    """
    before, behind = (tuple(filter(None, text.split("/"))) for text in (prefix, f"{group}/{name}"))
    whole = not group.strip("/") and len(behind) > len(before) and behind[: len(before)] == before
    return "/" + "/".join(behind if whole else before + behind)
