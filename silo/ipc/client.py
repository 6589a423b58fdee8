"""A client of one logger: what `silo`, `silo-tui` and your own programs use to talk to a helper process.

All calls block until the answer is there, and may be made by any thread. A refusal raises RefusedError (with `why` and
`problems`), silence ConnectionLostError; the connection comes back by itself. No NumPy is imported before a view, a
topic or a history is asked for.
"""

import itertools
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from silo.arguments import line, real, shown, text, texts, whole
from silo.calls import told_class
from silo.display import html_table
from silo.errors import ConnectionLostError, ElementError, RefusedError, SaveError
from silo.ipc.connection import Connection, Pending
from silo.ipc.discovery import Discovery, Found, discover, not_found_text
from silo.ipc.exchange import checked_reply, client_name, decode_reply, key_of
from silo.ipc.messages import (
    Acknowledge,
    AddMark,
    Alarms,
    ApplyEdits,
    ArmTrigger,
    Ask,
    By,
    ClosePin,
    CloseStream,
    CloseView,
    DeleteRecording,
    DiffScript,
    Done,
    EditsApplied,
    ForceTrigger,
    GetEvents,
    GetHistory,
    GetLimits,
    GetParts,
    GetPiece,
    GetSamples,
    GetStatus,
    GetSurvey,
    GetTable,
    GetTriggers,
    Hello,
    HelloReply,
    KeepPin,
    ListRecorders,
    ListRecordings,
    ListScripts,
    LoadScript,
    OpenPin,
    OpenStream,
    OpenView,
    Piece,
    ReadScript,
    RecorderInfo,
    RecorderStarted,
    RecordingParts,
    Recordings,
    Refused,
    RemoveLimits,
    RemoveTrigger,
    ReplyT,
    Request,
    Restart,
    Save,
    SaveScript,
    ScriptDiff,
    Scripts,
    ScriptText,
    SetLimits,
    SetTrigger,
    Start,
    StartRecorder,
    StatusReply,
    Stop,
    StopRecorder,
    StreamOpened,
    Survey,
    Triggers,
    TriggerTried,
    TryTrigger,
    Unsaved,
    ViewOpened,
    by_of,
    unsaved_of,
)
from silo.ipc.published import Event, EventKind
from silo.ipc.words import FileTypes, file_types, full_name, why_silent
from silo.model import Edit, FileType, LoggedEvent, SavedFile, SignalLimits, Status, Table, TriggerOptions
from silo.version import VERSION

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from silo.columns import HistoryColumns
    from silo.ipc.samples import Pin, Samples, Stream
    from silo.ipc.topic import Topic
    from silo.ipc.view import View

    Leased = View | Stream | Pin

RENEW_S = 2.0  # a third of a view's lease
MAX_SAVES = 64
LONGEST_S = 1e6  # that anybody waits

__all__ = ["Client", "Discovery", "Found", "connect", "discover"]


@told_class("client", make="Client")
class Client:
    """A connection to one logger. A context manager."""

    def __init__(self, found: Found, timeout_s: float = Ask.timeout_s) -> None:
        """Connect to a logger that was found; `connect` looks for it.

        Args:
            found: which logger.
            timeout_s: how long to wait for an answer, at least.

        Raises:
            ConnectionLostError: nobody answers.
        """
        self._timeout_s = timeout_s
        self._name = client_name()
        self._views: dict[Leased, float] = {}  # and streams and pins: all that has a lease
        self._renewals: dict[Leased, Pending] = {}
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._saves: OrderedDict[int, Event] = OrderedDict()
        self._saves_changed = threading.Condition()
        self._views_session = 1
        self._connection = Connection(found, timeout_s, self._name, self._renew_views)
        self._connection.on_event(self._note_save)
        self._connection.on_link(self._note_link)
        self._connection.watch()

    @classmethod
    def connect(cls, logger: "str | Found" = "", timeout_s: float = Ask.timeout_s, config: str = "") -> "Client":
        """Connect to a logger.

        Args:
            logger: what `discover` found, a name, `name.pid` where several have the name, or empty for the only one.
            timeout_s: how long to wait for an answer, at least.
            config: a Zenoh configuration for loggers of other hosts.

        Returns:
            A client; close it, or use it as a context manager.

        Raises:
            ConnectionLostError: there is none, or several could be meant; the message says what to do.
        """
        timeout_s = real("timeout_s", timeout_s, 0, LONGEST_S, "s", include_low=False)
        if isinstance(logger, Found):
            return cls(logger, timeout_s)
        text("logger", logger, 'Client.connect("robot")')
        text("config", config, 'Client.connect("robot", config="client.json5")')
        discovery = discover(timeout_s, config)
        named = discovery.named(logger)
        if not named:
            raise ConnectionLostError(not_found_text(logger, discovery))
        if len({found.label for found in named}) > 1:
            labels = ", ".join(found.label for found in named)
            raise ConnectionLostError(f"several loggers are running, say which one you mean: {labels}")
        return cls(named[0], timeout_s)

    def __repr__(self) -> str:
        found = self.found
        where = f" on {found.host}" if found.host else ""
        return f"<Client of {found.label}{where}: {'connected' if self.connected else 'not connected'}>"

    def _repr_html_(self) -> str:
        found = self.found
        state = "connected" if self.connected else "not connected"
        rows = [("logger", found.label), ("user", found.user), ("host", found.host or "this one"), ("state", state)]
        return html_table(f"Client of {found.label}", ("", ""), rows)

    # ------------------------------------------------------------------------------------------------ the connection

    @property
    def found(self) -> Found:
        """Which logger this is; changes when the robot program was started anew."""
        return self._connection.found

    @property
    def connected(self) -> bool:
        """Whether the helper process answers."""
        return self._connection.connected

    def on_event(self, callback: Callable[[Event], None]) -> None:
        """Call back for every event, in a thread of its own.

        Args:
            callback: must not wait long.
        """
        self._connection.on_event(callback)

    def on_link(self, callback: Callable[[bool], None]) -> None:
        """Call back when the connection is lost or there again.

        Args:
            callback: gets False when the helper process is gone, True when one is there again.
        """
        self._connection.on_link(callback)

    def close(self) -> None:
        """End views and connection; closing twice is fine."""
        self._connection.close()
        with self._saves_changed:
            self._saves_changed.notify_all()

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _call(self, request: Request[ReplyT]) -> ReplyT:
        try:
            reply = self._connection.exchange(request, max(request.timeout_s, self._timeout_s))
        except (OverflowError, UnicodeEncodeError) as error:
            raise ElementError(f"{type(request).__name__} can't be sent: {error}; nothing was asked") from None
        return checked_reply(request, reply)

    # ----------------------------------------------------------------------------------------------------- reading

    def hello(self) -> HelloReply:
        """Return who is there, and whether this user may change anything."""
        question = Hello(version=VERSION, client=self._name)
        reply = self._call(question)
        try:
            self._connection.exchange(question, self._timeout_s, key="do")
        except ConnectionLostError:
            # access control swallows what isn't allowed: no answer on this key is the answer
            import msgspec

            return msgspec.structs.replace(reply, may_edit=False)
        return reply

    def status(self) -> Status:
        """Return the logger at a glance."""
        return self._call(GetStatus(client=self._name)).status

    def table(self) -> Table:
        """Return the element table with its revision."""
        return self._call(GetTable(client=self._name)).table

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
        return self._call(GetEvents(since=since, limit=limit, client=self._name)).events

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
            ConnectionLostError: the helper process doesn't answer.
        """
        request = AddMark(
            text=line("text", text, 'client.mark("slipped")'),
            tick=-1 if tick is None else whole("tick", tick, 0, 2**62),
            at_ns=0 if at_ns is None else whole("at_ns", at_ns, 1, 2**63 - 1),
            client=self._name,
        )
        return self._call(request).event

    def scripts(self) -> Scripts:
        """Return the scripts in the logger's script folder."""
        return self._call(ListScripts(client=self._name))

    def read_script(self, path: str = "") -> ScriptText:
        """Return the text of a script on the robot's side.

        Args:
            path: within the script folder; empty: the running configuration as a script.
        """
        return self._call(ReadScript(path=path, client=self._name))

    def diff_script(self, path: str = "") -> ScriptDiff:
        """Return what loading a script would change.

        Args:
            path: within the script folder; empty: the logger's own script.
        """
        return self._call(DiffScript(path=path, client=self._name))

    def recordings(self, most: int = 1000) -> Recordings:
        """Return the recordings in the logger's own folder on the robot, the newest first.

        Args:
            most: at most so many, 1 to 10 000.

        Returns:
            The rows, of `count` that there are; sizes in bytes, times in ns by the robot's clock, `span_s` in s. Of
            thousands some may be `unread` yet: ask again.

        Raises:
            ElementError: `most` is out of range.
            RefusedError: the folder can't be read, or there is none before the first save.
        """
        return self._call(ListRecordings(most=whole("most", most, 1, 10_000), client=self._name))

    def fetch(
        self,
        name: str,
        folder: "str | os.PathLike[str]" = ".",
        progress: Callable[[int, int], None] | None = None,
        *,
        replace: bool = False,
        patience_s: float = 30.0,
    ) -> "Path":
        """Copy a recording of the logger's folder (a file, or a bag folder) into a folder of this machine.

        In pieces, each with a checksum. When the link is cut it goes on as soon as the link is back within
        `patience_s`; what came until then is kept as `<name>.part`, and the same call later goes on behind it.

        Args:
            name: of the file or bag folder with its ending, as `recordings` has it.
            folder: where to; made where it isn't there.
            progress: called with the bytes that are here and the bytes of all of it, also while the link is cut; what
                it raises ends the call.
            replace: take the place of a file of this name that is there already.
            patience_s: how long to wait for a link that is cut, s.

        Returns:
            The path of the copy.

        Raises:
            SaveError: it is there already (without `replace`) or being fetched by another program, the disk is full, or
                the system refuses.
            ConnectionLostError: the link is cut for longer than `patience_s`, or what comes makes no sense.
            RefusedError: there is no such recording, or it was written anew meanwhile.
            ElementError: an argument makes no sense; nothing was asked.
        """
        from silo.arguments import path
        from silo.ipc.fetching import Fetch

        wait_s = real("patience_s", patience_s, 0, LONGEST_S, "s")
        ask = Fetch(self._parts_of, self._piece_of, lambda: self.connected, wait_s)
        return ask.run(
            text("name", name, "client.fetch('robot_..._00007.silo')"), path("folder", folder), progress, replace
        )

    def _parts_of(self, name: str) -> RecordingParts:
        return self._call(GetParts(name=name, client=self._name))

    def _piece_of(self, path: str, mark: str, offset: int, count: int, sum_only: bool) -> Piece:
        return self._call(
            GetPiece(path=path, mark=mark, offset=offset, count=count, sum_only=sum_only, client=self._name)
        )

    def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, pin: "Pin | None" = None
    ) -> "HistoryColumns":
        """Return past samples as minimum and maximum per column, straight from the buffers or of a pin.

        Args:
            names: 1 to 64 entries.
            start_ns: the first time stamp.
            end_ns: the time stamp after the last.
            column_ns: width of a column; there may be at most 4096.
            pin: what to read instead of the buffers.

        Returns:
            Columns of all names, of which column k covers the time stamps from `k * column_ns` to before the next.

        Raises:
            RefusedError: a name is unknown, a number out of range, or the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.view import history_columns

        request = GetHistory(
            names=texts("names", names, "['/log/joints/q_0']"),
            start_ns=start_ns,
            end_ns=end_ns,
            column_ns=column_ns,
            pin=pin.id if pin is not None else "",
            client=self._name,
        )
        return history_columns(self._call(request))

    def samples(
        self,
        names: Sequence[str],
        start: int = -(2**62),
        end: int = 2**62,
        by: By | str = By.TIME,
        pin: "Pin | None" = None,
        reply_bytes: int = 2**20,
        told: Callable[[float], None] | None = None,
    ) -> "dict[str, Samples]":
        """Return all samples that the buffers (or a pin) hold of elements or entries, with `start <= ... < end`.

        What comes while it is read is left out.

        Args:
            names: elements or entries, 1 to 10 000.
            start: the first, see `by`.
            end: the one after the last, see `by`.
            by: `"time"`: the ends are time stamps in ns; `"tick"`: ticks since start; `"row"`: numbers of samples since
                start.
            pin: what to read instead of the buffers.
            reply_bytes: size of the pieces in which they are asked for, 4096 to 4 MiB.
            told: called with the share that has come, 0 to 1.

        Returns:
            By name: `ticks` and `time_ns` of shape `(n,)`, `values` of shape `(n, *shape of the element)`, oldest
            first; of a name without samples `why` there are none.

        Raises:
            RefusedError: the logger was started anew meanwhile, a name or `by` is unknown, a number out of range, or
                the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Gathering

        request = GetSamples(
            names=texts("names", names, "['/log/joints/q']"),
            start=start,
            end=end,
            by=by_of(by),
            reply_bytes=reply_bytes,
            pin=pin.id if pin is not None else "",
            client=self._name,
        )
        gathering = Gathering(request.names)
        while True:
            reply = self._call(request)
            gathering.take(reply)
            if told is not None:
                told(gathering.share)
            if all(row >= stop for row, stop in reply.resume):
                return gathering.samples()
            request = GetSamples(
                names=request.names, by=request.by, reply_bytes=reply_bytes, pin=request.pin, run=reply.run,
                resume=reply.resume, client=self._name,
            )  # fmt: skip

    def survey(self, quantities: Sequence[str], names: Sequence[str] = (), *, reset: bool = False) -> Survey:
        """Return quantities of elements or entries, with statistics over all samples since this client asked first.

        The statistics end when it hasn't asked for a minute.

        Args:
            quantities: one or several of `silo.ipc.surveys.QUANTITIES`, such as `"mean"`, `"std"`, `"rate"` (Hz).
            names: elements or entries, at most 20 000; all elements of the table where it is empty.
            reset: begin the statistics anew.

        Returns:
            The survey; its `values` are the bytes of float64 of shape `(quantities, names)`, NaN where a quantity isn't
            known.

        Raises:
            RefusedError: a quantity is unknown, there are too many names, or too many clients have statistics.
            ElementError: one of both is no list of texts; nothing was asked.
        """
        request = GetSurvey(
            quantities=texts("quantities", quantities, "['mean', 'std']"),
            names=texts("names", names, "['/log/joints/q']"),
            reset=reset,
            client=self._name,
        )
        return self._call(request)

    # ---------------------------------------------------------------------------------------------------- changing

    def apply(self, edits: Sequence[Edit], revision: int) -> EditsApplied:
        """Apply edits as one transaction, all or none.

        Args:
            edits: what to change.
            revision: that of the table they are based on; -1: whichever.

        Returns:
            The new revision, and how many elements changed.

        Raises:
            ElementError: they are no list of edits.
            RefusedError: the logger runs, the table has changed since, or an edit can't be; nothing was changed.
        """
        if isinstance(edits, str) or not isinstance(edits, Sequence):
            raise ElementError(f"edits must be a list of silo.model.Edit, got {shown(edits)}; nothing was changed")
        request = ApplyEdits(revision=revision, edits=list(edits), client=self._name)
        return self._call(request)

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
        return _status(self._call(Start(unsaved=unsaved_of(unsaved), client=self._name)), told)

    def stop(self) -> Status:
        """Stop the logger; stopping a stopped one succeeds.

        Returns:
            The logger at a glance, as it is then.
        """
        return self._call(Stop(client=self._name)).status

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
        return _status(self._call(Restart(unsaved=unsaved_of(unsaved), client=self._name)), told)

    def load_script(self, path: str = "", revision: int = -1) -> EditsApplied:
        """Apply a script on the robot's side.

        Args:
            path: within the script folder; empty: the logger's own.
            revision: that of the table it is based on; -1: whichever.

        Returns:
            The new revision, how many elements changed, and the names that the table lacks.

        Raises:
            RefusedError: the logger runs, or the script has problems; nothing was changed.
        """
        return self._call(LoadScript(path=path, revision=revision, client=self._name))

    def save_script(self, path: str = "", overwrite: bool = False) -> str:
        """Write the configuration to a script on the robot's side.

        Args:
            path: within the script folder; empty: the logger's own.
            overwrite: replace a script that is there.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: it is there already, or the system refuses.
        """
        request = SaveScript(path=path, overwrite=overwrite, client=self._name)
        return self._call(request).text

    def delete_recording(self, name: str) -> str:
        """Delete a recording that this logger wrote.

        Args:
            name: of a file or bag folder with its ending, or the stem for all files of a save, as `recordings` has
                them.

        Returns:
            What was deleted, and how many MB, in words.

        Raises:
            RefusedError: there is none, or one of its files isn't surely of this logger: nothing was deleted. Or the
                system refuses, or a bag holds files of others, which stays; other files of the save may be gone then.
            ElementError: the name is no text; nothing was asked.
        """
        named = text("name", name, "client.delete_recording('robot_..._00007')")
        return self._call(DeleteRecording(name=named, client=self._name)).text

    # ------------------------------------------------------------------------------------------- triggers, limits

    def triggers(self) -> Triggers:
        """Return how the triggers stand.

        Returns:
            Each with its options and state, and how often it fired in this run.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """
        return self._call(GetTriggers(client=self._name))

    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        """Return when a trigger would have fired in all that the buffers hold; nothing is set or captured.

        Args:
            trigger: as for `set_trigger`; its name plays no part.

        Returns:
            How many `fires`, with ticks since start and time stamps in ns of the last 1000; how much was judged, and
            about how many bytes a capture would have. `why` says why nothing could be judged.

        Raises:
            RefusedError: a condition, word or time of it makes no sense, or nothing was logged yet.
        """
        return self._call(TryTrigger(trigger=trigger, client=self._name))

    def set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
        """Add a trigger or replace the one of its name; judged from now on, also while the logger runs.

        Args:
            trigger: its condition and what it captures, times in s; `Logger.trigger` tells what they mean. Without any
                file type in `save` it captures nothing: `triggers` tells when it fired. In mode auto, which has no
                files, it fires by itself `patience_s` after the end of a capture.
            lease_s: 0: it is one of the logger's from now on. 0.5 to 600: the helper process holds it for so long,
                unless the same is set again meanwhile; it is in no script and no saved file.

        Returns:
            What was done, in words, with what its captures will lack.

        Raises:
            RefusedError: a name, condition or number makes no sense, `pre_s` is longer than what buffers hold (the
                message has the size that would do), or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(SetTrigger(trigger=trigger, lease_s=lease_s, client=self._name)).text

    def remove_trigger(self, name: str) -> str:
        """Forget a trigger, also while the logger runs; a capture that is under way goes on.

        Args:
            name: of the trigger.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is none of that name, or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(RemoveTrigger(name=name, client=self._name)).text

    def arm_trigger(self, name: str, *, armed: bool = True) -> str:
        """Have a trigger watch again, also after the one capture of mode single, or no more.

        A trigger that is off stays so for the next run and in scripts. A capture that is under way goes on.

        Args:
            name: of the trigger.
            armed: False: it fires no more, until it is armed or forced.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is none of that name, the robot program has ended, or the helper process is too busy
                judging rows; the message says which.
            GoesOnError: the robot program takes longer.
        """
        return self._call(ArmTrigger(name=name, armed=armed, client=self._name)).text

    def force_trigger(self, name: str) -> str:
        """Fire a trigger at the newest tick, whatever its condition says, armed or not.

        Args:
            name: of the trigger.

        Returns:
            What was done, in words, with the tick.

        Raises:
            RefusedError: there is none of that name, the logger doesn't run, or the helper process is too busy judging
                rows.
        """
        return self._call(ForceTrigger(name=name, client=self._name)).text

    def alarms(self) -> Alarms:
        """Return how the signals with limits stand.

        Returns:
            Every scalar with limits, worst first.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
        """
        return self._call(GetLimits(client=self._name))

    def acknowledge(self, names: Sequence[str] = (), who: str = "") -> str:
        """Say that somebody has seen alarms; a scalar that is beyond its limits stays so.

        Args:
            names: the scalars, as `alarms` has them; all without names.
            who: has seen them; empty: this client.

        Returns:
            How many alarms there were and who has seen them, in words.

        Raises:
            RefusedError: the helper process is too busy judging rows; ask again in a moment.
            ElementError: the names are no list of texts; nothing was asked.
        """
        seen = texts("names", names, "['/log/joints/q_0']")
        return self._call(Acknowledge(names=seen, who=who, client=self._name)).text

    def set_limits(self, limits: SignalLimits) -> str:
        """Give a signal limits, or other ones than it has; judged from now on, also while the logger runs.

        Args:
            limits: the signal's name and its bounds, in the signal's unit; `Logger.limit` tells what they mean.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: there is no such signal, its bounds, a number or its condition make no sense, or the robot
                program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(SetLimits(limits=limits, client=self._name)).text

    def remove_limits(self, name: str) -> str:
        """Forget the limits of a signal, also while the logger runs.

        Args:
            name: exactly the one that they were given to.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: no limits were given to it, or the robot program has ended; nothing was changed.
            GoesOnError: the robot program takes longer.
        """
        return self._call(RemoveLimits(name=name, client=self._name)).text

    # ------------------------------------------------------------------------------------------------------ saving

    def save(self, types: FileTypes = (FileType.SILO,), name: str = "") -> int:
        """Begin to save in the helper process.

        Args:
            types: `"silo"`, `"csv"`, `"bag"`, one or several.
            name: a file name without ending, instead of the usual one.

        Returns:
            The number of the job for `wait_saved`.
        """
        return self._call(Save(types=file_types(types), name=name, client=self._name)).job

    def record(
        self,
        patterns: Sequence[str] = (),
        to: str = "",
        split: str = "1GB",
        keep: str = "",
        name: str = "",
    ) -> RecorderStarted:
        """Record every sample from now on to MCAP files on the robot, across restarts, until `stop_recorder`.

        Args:
            patterns: elements, namespaces or globs; all elements without any.
            to: a folder inside the logger's, relative to that or absolute; empty: `recordings`.
            split: `"1GB"` or `"10min"`, after which a part is finished: from 1 MB, or 1 s to 31 days; empty: never.
            keep: `"50GB"`, above which its own oldest parts are deleted: from 2 MB; empty: all stay.
            name: of the recording and its files, instead of the logger's.

        Returns:
            Its `name`, its `folder` (absolute, on the robot), and in `text` what will not be recorded without end.

        Raises:
            ElementError: `split`, `keep` or the patterns make no sense; nothing is recorded.
            RefusedError: no element matches a pattern, the folder is outside of the logger's, the name can't be or is
                taken, 8 recordings are under way, or the system or a robot program that has ended prevents it; nothing
                is recorded.
        """
        from silo.amounts import read_keep, read_split

        split_bytes, split_s = read_split(split)
        request = StartRecorder(
            name=name,
            folder=to,
            patterns=texts("patterns", patterns, "['/log/joints/*']"),
            split_bytes=split_bytes,
            split_s=split_s,
            keep_bytes=read_keep(keep),
            client=self._name,
        )
        return self._call(request)

    def stop_recorder(self, name: str = "") -> str:
        """Finish an endless recording; waits up to 5 s for the end of its last part.

        Args:
            name: of the recording; empty: the only one.

        Returns:
            What was done, in words, with its numbers of files and samples.

        Raises:
            RefusedError: there is none, or none of that name, or several without a name; nothing was stopped.
        """
        return self._call(StopRecorder(name=name, client=self._name)).text

    def recorders(self) -> list[RecorderInfo]:
        """Return the endless recordings of this logger; those that ended by themselves stay until they are stopped.

        Returns:
            For each its parts, samples and losses since it was started, the bytes on the disk, and how it ended.
        """
        return self._call(ListRecorders(client=self._name)).recorders

    def wait_saved(
        self, job: int, timeout_s: float = 600.0, progress: Callable[[float], None] | None = None
    ) -> list[SavedFile]:
        """Wait for the end of a save.

        Args:
            job: the number that `save` returned.
            timeout_s: how long to wait, s.
            progress: called with the fraction done, 0 to 1.

        Returns:
            The files: path, size in bytes.

        Raises:
            SaveError: it failed, with the reason, or takes too long.
            ConnectionLostError: the connection is lost.
        """
        whole("job (the number that save() returned)", job, 0, 2**63 - 1)
        deadline = time.monotonic() + real("timeout_s", timeout_s, 0, LONGEST_S, "s")
        told = -1.0
        while True:
            with self._saves_changed:
                event = self._saves.get(job)
                if event is None or event.kind is EventKind.SAVING:
                    self._check_saving(deadline, timeout_s)
                    self._saves_changed.wait(0.1)
                    event = self._saves.get(job)
            if event is None:
                continue
            if progress is not None and event.progress > told:
                told = event.progress
                progress(told)
            if event.kind is EventKind.SAVED:
                return event.files
            if event.kind is EventKind.SAVE_FAILED:
                raise SaveError(event.text)

    def _check_saving(self, deadline: float, timeout_s: float) -> None:
        if not self.connected:
            raise ConnectionLostError("the connection was lost while the log was being saved; look into its folder")
        if time.monotonic() > deadline:
            raise SaveError(f"the save isn't done after {timeout_s:g} s; it goes on in the helper process")

    def _note_save(self, event: Event) -> None:
        if not event.job:
            return
        with self._saves_changed:
            self._saves[event.job] = event
            while len(self._saves) > MAX_SAVES:
                self._saves.popitem(last=False)
            self._saves_changed.notify_all()

    def _note_link(self, connected: bool) -> None:
        with self._saves_changed:
            if connected:
                self._saves.clear()  # another helper process counts from 1 again
            self._saves_changed.notify_all()

    # ------------------------------------------------------------------------------------------------------- views

    def view(
        self,
        values: Sequence[str] = (),
        plots: Sequence[str] = (),
        rate_hz: float = 5.0,
        column_ns: int = 100_000_000,
    ) -> "View":
        """Open a view: newest values and fill of elements, minimum and maximum per column of entries.

        It goes on across reconnections until it is closed.

        Args:
            values: the elements.
            plots: the entries.
            rate_hz: frames per second.
            column_ns: width of a column.

        Returns:
            The view; its `read()` gives frames.

        Raises:
            RefusedError: a name or number is out of range.
            ConnectionLostError: nobody answers.
        """
        from silo.ipc.view import View

        request = OpenView(
            view="",
            values=texts("values", values, "['/log/joints/q']"),
            plots=texts("plots", plots, "['/log/joints/q_0']"),
            rate_hz=rate_hz,
            column_ns=column_ns,
            client=self._name,
        )
        view = View(request, next(self._numbers), lambda: self._renew_soon(view), self._forget_view)
        self._connection.attach(view)
        try:
            view.accept(self._call(view.request))
        except (RefusedError, ConnectionLostError):
            view.close()
            raise
        with self._lock:
            self._views[view] = time.monotonic() + RENEW_S
        return view

    def topic(self, element: str) -> "Topic":
        """Subscribe to every sample of a published element: `for batch in client.topic("joints/q"): ...`.

        Args:
            element: its full name, or the name after the prefix.

        Returns:
            The subscription; close it, or use it as a context manager.

        Raises:
            ElementError: there is no such element.
        """
        from silo.ipc.topic import Topic

        text("element", element, "client.topic('/log/joints/q')")
        name = full_name(element, self.status(), self.table())
        topic = Topic(name, self._connection.forget, lambda: why_silent(name, self.status(), self.table()))
        self._connection.attach(topic)
        return topic

    def stream(self, names: Sequence[str], period_s: float = 0.05) -> "Stream":
        """Subscribe to every sample of elements or entries from now on, whatever their action; iterate over it.

        It goes on across reconnections and new starts until it is closed. Numbered: what this reader is too slow for is
        counted, and never holds up the helper process.

        Args:
            names: elements or entries, at least one.
            period_s: time between two deliveries, s.

        Returns:
            The stream, of batches with `Samples` by name; close it, or use it as a context manager.

        Raises:
            RefusedError: a name is unknown, a number out of range, or too many streams are open.
            ConnectionLostError: nobody answers.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Stream

        wished = texts("names", names, "['/log/joints/q']")
        request = OpenStream(stream="", names=wished, period_s=period_s, client=self._name)
        stream = Stream(request, next(self._numbers), lambda: self._renew_soon(stream), self._forget_view)
        self._connection.attach(stream)
        try:
            stream.accept(self._call(stream.request))
        except (RefusedError, ConnectionLostError):
            stream.close()
            raise
        with self._lock:
            self._views[stream] = time.monotonic() + RENEW_S
        return stream

    def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> "Pin":
        """Have the helper process keep a copy of what the buffers hold, whatever they overwrite.

        `samples` and `history` read it until it is closed. Where not all fits the newest part is kept: 64 MiB for all
        clients together.

        Args:
            names: elements or entries, 1 to 10 000.
            start_ns: the first time stamp.
            end_ns: the last time stamp.

        Returns:
            The pin; its `opened` says what is held: time stamps in ns, `size_bytes`, and of names without rows why.

        Raises:
            RefusedError: nothing of it fits, a name is unknown, a number out of range, or too many pins are open.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Pin

        request = OpenPin(
            pin=f"{secrets.token_hex(8)}-1",  # of its own, because it outlives the session
            names=texts("names", names, "['/log/joints/q']"),
            start_ns=start_ns,
            end_ns=end_ns,
            client=self._name,
        )
        opened = self._call(request)
        pin = Pin(request.names, opened, KeepPin(pin=opened.pin, client=self._name), self._forget_view)
        self._connection.attach(pin)
        with self._lock:
            self._views[pin] = time.monotonic() + RENEW_S
        return pin

    def _forget_view(self, view: "Leased") -> None:
        self._connection.forget(view)
        with self._lock:
            known = self._views.pop(view, None)
            self._renewals.pop(view, None)
        if known is not None and self.connected:
            # nobody waits for the answer: if it gets lost, the lease ends the view
            request = self._closing(view)
            Pending(self._connection.session(), key_of(request, self._connection.root), request, 1.0)

    def _closing(self, leased: "Leased") -> Request[Done]:
        renewal = leased.renewal
        if isinstance(renewal, OpenView):
            return CloseView(view=renewal.view, client=self._name)
        if isinstance(renewal, OpenStream):
            return CloseStream(stream=renewal.stream, client=self._name)
        return ClosePin(pin=renewal.pin, client=self._name)

    def _renew_soon(self, view: "Leased") -> None:
        with self._lock:
            if view in self._views:
                self._views[view] = 0.0

    def _renew_views(self) -> None:
        """Renew leases, and open views anew in a new session. Called by the connection's thread; never waits."""
        now_s = time.monotonic()
        with self._lock:
            if self._views_session != self._connection.sessions:
                self._views_session = self._connection.sessions
                self._renewals.clear()
                self._views = dict.fromkeys(self._views, 0.0)
            due = [view for view, at_s in self._views.items() if now_s >= at_s and view not in self._renewals]
            waiting = list(self._renewals.items())
        for view, pending in waiting:
            done, payload = pending.poll()
            if done:
                with self._lock:
                    self._renewals.pop(view, None)
                self._take_renewal(view, payload)
        for view in due:
            request = view.renewal
            key = key_of(request, self._connection.root)
            pending = Pending(self._connection.session(), key, request, request.timeout_s)
            with self._lock:
                if view in self._views:
                    self._renewals[view] = pending
                    self._views[view] = now_s + RENEW_S

    def _take_renewal(self, view: "Leased", payload: bytes | None) -> None:
        if payload is None:
            self._renew_soon(view)
            return
        reply = decode_reply(payload, "the helper process")
        if isinstance(reply, ViewOpened | StreamOpened):
            accept: Callable[[ViewOpened | StreamOpened], None] | None = getattr(view, "accept", None)
            if accept is not None:
                accept(reply)
        elif isinstance(reply, Refused):
            view.refuse(reply.text)


def connect(logger: "str | Found" = "", timeout_s: float = Ask.timeout_s, config: str = "") -> Client:
    """Connect to a running logger.

    Args:
        logger: its name, `name.pid` where several have the name, or empty for the only one.
        timeout_s: how long to wait for an answer, at least.
        config: a Zenoh configuration for loggers of other hosts.

    Returns:
        A client; close it, or use it as a context manager.

    Raises:
        ConnectionLostError: there is none, or several could be meant; the message says what to do.
    """
    return Client.connect(logger, timeout_s, config)


def _status(reply: StatusReply, told: Callable[[str], None] | None) -> Status:
    if reply.text and told is not None:
        told(reply.text)
    return reply.status
