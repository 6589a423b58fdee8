"""What a helper process publishes without being asked for each: frames of views, and events.

msgspec structs in msgpack, as the messages are. A frame goes to the one client that opened its view, an event to all.
"""

from typing import Any

import msgspec

from silo.core.elements import LoggedEvent, SavedFile, State, Status, Word

MOST_NAMES = 8  # of clients, in a summary
MOST_REASON = 200  # letters
ATTACHED = "silo/samples;attached"  # of a topic whose encoding is too long for Zenoh: it stands in the attachment


class NotLive(Word):
    """Why an element that is enabled isn't shown live."""

    ABSENT = "absent"  # switched on after the recording began
    FULL = "full"  # its FIXED buffer keeps the first samples, and has them
    LIMIT = "limit"  # its GROWING buffer came to the memory limit
    SHORT = "short"  # its LOOPING buffer is shorter than the time between two frames: plots have holes
    OTHER = "other"


NOT_LIVE_TEXTS = {
    NotLive.ABSENT: "not in this recording: it was switched on later",
    NotLive.FULL: "buffer full: this is its last sample",
    NotLive.LIMIT: "memory limit reached: this is its last sample",
    NotLive.SHORT: "short buffer: plots miss samples",
    NotLive.OTHER: "not of now",
}


class ViewFrame(msgspec.Struct, frozen=True, omit_defaults=True):
    """One refresh of one view: put on `.../view/<id>`.

    `number` counts frames, so that gaps are seen. `generation` is that of the `ViewOpened` that explains the frame:
    it changes with a restart or an edit, and the client opens the view again. `lost_total` counts samples. `held`
    and `lost` have one int64 per element of `values`; `newest` one float64 per entry (NaN where there is none);
    `texts` holds by its position each newest value that a float64 can't tell: strings, dates, NaT, complex numbers,
    the digits of integers from 2**53 on; `low`/`high` float64 of shape `(len(plots), count)`: columns
    `first ... first + count - 1`, the last of them perhaps not complete yet (it comes again), with `marks` and
    `bases` as in `Columns`. They hold every sample since the frame
    before; where some were skipped `since_ns` is the time from which on they are whole, else 0. `sizes` are the buffer
    sizes of the held recording by position in `values`, where they aren't the table's: it was edited since, or the
    recording lacks the element (0).
    `failed` has by its position in `values` at how many ticks an element could not be read, of those that ever failed.
    `not_live` has by its position in `values` why an element's newest value isn't of now, of those where it isn't.
    `idle_s` is that of `Status`.
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
    sizes: dict[int, int] = {}
    failed: dict[int, int] = {}
    not_live: dict[int, NotLive] = {}
    idle_s: float = 0.0


class Summary(msgspec.Struct, frozen=True, array_like=True, kw_only=True):
    """A logger in a few hundred bytes, for who looks at many: put on `.../summary` while somebody subscribes.

    At most once a second when it says something new, else every ten seconds, as any single one may be dropped. Fields
    are those of `Status`, sent without their names in this order: new ones come last; but `started_ns` and `ticks` are
    of the whole run, its `run_began_ns` and `run_ticks`. `closed` is set in the last one of a program that closed its
    logger; without it program and helper were killed, or the link is cut.
    """

    state: State
    frequency_hz: float = 0.0
    measured_hz: float = 0.0
    ticks: int = 0
    started_ns: int = 0
    lost: int = 0
    saved: bool = True
    disk_free_bytes: int = 0
    disk_bytes: int = 0
    alarm: str = ""
    alarms: int = 0
    clients: list[str] = []
    recorders: int = 0
    pid: int = 0
    user: str = ""
    reason: str = ""
    closed: bool = False
    control: str = ""  # who alone may change it now; empty where nobody took control
    denied: int = 0
    idle_s: float = 0.0

    @classmethod
    def of(cls, status: Status) -> "Summary":
        """Return what a status says, in short."""
        taken = {name: getattr(status, name) for name in cls.__struct_fields__ if name not in ("closed", "control")}
        taken |= {"started_ns": status.run_began_ns, "ticks": status.run_ticks}
        taken["clients"] = [one.who for one in status.clients[:MOST_NAMES]]
        control = status.control.who if status.control is not None else ""
        reason = status.reason  # its end stays whole: there stands which file has what was logged
        if len(reason) > MOST_REASON:
            reason = f"{reason[: MOST_REASON // 2 - 3].rstrip()} … {reason[-MOST_REASON // 2 :].lstrip()}"
        return cls(**{**taken, "reason": reason, "control": control})


class EventKind(Word):
    """What happened."""

    STARTED = "started"
    STOPPED = "stopped"
    CUT = "cut"  # it goes on in another stretch, with other options
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
    FILES_DELETED = "files deleted"
    DURABLE = "durable"  # the journal stopped or goes on
    DELETED = "deleted"  # somebody deleted a recording
    RECORDING = "recording"  # of an endless recording: begun, ended, a part finished, samples lost
    RECORDING_FAILED = "recording failed"  # it ended by itself
    ENDED = "ended"  # a request that went on came to its end, well or not
    TRIGGERED = "triggered"
    CAPTURED = "captured"
    BLIND = "blind"  # what a trigger can't see, or didn't
    LIMIT = "limit"  # a value went beyond its limits, or is stale
    LIMIT_ENDED = "limit ended"
    CONDITIONS = "conditions"  # somebody changed triggers or limits, or has seen alarms
    DENIED = "denied"  # a login, or a change by who may not make it
    CONTROL = "control"  # somebody took it, gave it away, or lost it
    MARKER = "marker"  # somebody, or the program, marked a tick
    DAMAGED = "damaged"  # stands in place of lines of the event log that can't be read
    UNHELD = "unheld"  # nobody but silo holds the array of an element any more
    PARAMETER = "parameter"  # a parameter changed, or what all were at a start
    HELPER = "helper"  # the helper process before this one died, and the program started this one
    OTHER = "other"


class Event(msgspec.Struct, frozen=True):
    """Put on `.../event`; `text` is fit to show as it stands. `number` counts all events of a helper.

    `tick` and `stamp_ns` say where it stands in the data (-1, 0: nowhere), `logged` its number in the event log, 0 for
    what is only news (the progress of a save). `about` names the trigger that it is of; empty: of none, or told by an
    older silo.
    """

    number: int
    time_ns: int
    kind: EventKind
    text: str
    by: str = ""
    status: Status | None = None
    job: int = 0
    progress: float = 0.0
    files: list[SavedFile] = []
    tick: int = -1
    stamp_ns: int = 0
    logged: int = 0
    run: str = ""
    about: str = ""

    @classmethod
    def of(cls, line: LoggedEvent, number: int = 0, **more: Any) -> "Event":
        """Return what a line of the event log tells, with `more` than stands there."""
        return cls(
            number, line.time_ns, EventKind(line.kind), line.text, tick=line.tick, stamp_ns=line.stamp_ns,
            logged=line.number, run=line.run, **more,
        )  # fmt: skip
