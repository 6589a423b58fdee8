"""What the helper answers to each request: one method each, registered with `answers_to`.

Pure routing: what is checked and who does it; the work is done in the modules that are called here.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from silo.errors import SaveError, ScriptError, SegmentError
from silo.helper import script_folder
from silo.helper.events import Events, plain
from silo.helper.history import check_history, history
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.pins import Pins, no_pin
from silo.helper.publisher import Publisher
from silo.helper.requests import check_edits
from silo.helper.robot import Robot
from silo.helper.samples import check_samples, samples
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc import messages
from silo.ipc.messages import (
    AddMark,
    AnyReply,
    ApplyEdits,
    ClosePin,
    CloseStream,
    CloseView,
    Columns,
    DiffScript,
    Done,
    EditsApplied,
    GetEvents,
    GetHistory,
    GetSamples,
    GetStatus,
    GetSurvey,
    GetTable,
    GoesOn,
    Hello,
    HelloReply,
    KeepPin,
    ListScripts,
    LoadScript,
    Marked,
    OpenPin,
    OpenStream,
    OpenView,
    PinOpened,
    ReadScript,
    Refused,
    RefusedWhy,
    ReplyT,
    Request,
    Restart,
    SampleRows,
    Save,
    SaveScript,
    SaveStarted,
    ScriptDiff,
    Scripts,
    ScriptText,
    Start,
    StatusReply,
    Stop,
    StreamOpened,
    Survey,
    ViewOpened,
)
from silo.ipc.published import EventKind
from silo.ipc.refusals import refused_running
from silo.ipc.versions import OLDEST, PROTOCOL
from silo.model import Edit, State
from silo.version import VERSION

Handler = Callable[["Answers", Any], Any]
Signed = TypeVar("Signed", bound=Request[Any])
Method = TypeVar("Method", bound=Handler)

MOST_EVENTS_AT_ONCE = 10_000
MOST_MARK_LETTERS = 200

HANDLERS: dict[type[Request[Any]], Handler] = {}

_encoder = msgspec.msgpack.Encoder()


def answers_to(
    *kinds: type[Request[ReplyT]],
) -> Callable[[Callable[["Answers", Any], ReplyT | bytes | GoesOn | Refused]], Any]:
    """Register a method of `Answers` for a kind of request; bytes are a reply that is encoded already."""

    def register(method: Method) -> Method:
        HANDLERS.update(dict.fromkeys(kinds, method))
        return method

    return register


class Answers:
    """Answers requests with everything that the helper has."""

    def __init__(self, mirror: Mirror, events: Events, publisher: Publisher, saver: Saver, robot: Robot) -> None:
        self._mirror = mirror
        self._events = events
        self._publisher = publisher
        self._saver = saver
        self._robot = robot
        self._pins = Pins()
        self._surveyor = Surveyor(mirror)

    def stop(self) -> None:
        """End what goes on by itself."""
        self._surveyor.stop()

    def answer(self, request: Request[Any]) -> bytes:
        """Return the encoded answer; waits for the robot process where it must."""
        reply: AnyReply | bytes
        try:
            reply = HANDLERS[type(request)](self, request)
        except script_folder.ScriptRefusedError as error:
            reply = error.refused
        except (ScriptError, SaveError) as error:
            reply = Refused(RefusedWhy.INVALID, str(error))
        except SegmentError as error:
            reply = Refused(RefusedWhy.FAILED, str(error))
        return reply if isinstance(reply, bytes) else _encoder.encode(reply)

    # ------------------------------------------------------------------------------------------------------ reading

    @answers_to(Hello)
    def _hello(self, _: Hello) -> HelloReply:
        # a client that gets this from the key `do` too may edit
        return HelloReply(PROTOCOL, VERSION, self._mirror.user, True, self._mirror.status(), OLDEST)

    @answers_to(GetStatus)
    def _status(self, _: GetStatus) -> StatusReply:
        return StatusReply(self._mirror.status())

    @answers_to(GetTable)
    def _table(self, _: GetTable) -> bytes:
        return self._mirror.now.table_reply

    @answers_to(OpenView)
    def _open_view(self, request: OpenView) -> ViewOpened | Refused:
        return self._publisher.open_view(request)

    @answers_to(CloseView)
    def _close_view(self, request: CloseView) -> Done:
        self._publisher.close_view(request.view)
        return Done("the view is closed")

    @answers_to(GetHistory)
    def _history(self, request: GetHistory) -> Columns | Refused:
        pinned = self._pins.rows(request.pin) if request.pin else None
        if isinstance(pinned, Refused):
            return pinned
        return check_history(request) or history(request, self._mirror.now, self._mirror.open_reader(), pinned)

    @answers_to(GetSamples)
    def _samples(self, request: GetSamples) -> SampleRows | Refused:
        source = self._pins.rows(request.pin) if request.pin else self._mirror.open_reader()
        if isinstance(source, Refused):
            return source
        return check_samples(request) or samples(request, self._mirror.now, source)

    @answers_to(OpenStream)
    def _open_stream(self, request: OpenStream) -> StreamOpened | Refused:
        return self._publisher.streams.open(request)

    @answers_to(CloseStream)
    def _close_stream(self, request: CloseStream) -> Done:
        self._publisher.streams.close(request.stream)
        return Done("the stream is closed")

    @answers_to(OpenPin)
    def _open_pin(self, request: OpenPin) -> PinOpened | Refused:
        return self._pins.open(request, self._mirror.now, self._mirror.open_reader())

    @answers_to(KeepPin)
    def _keep_pin(self, request: KeepPin) -> Done | Refused:
        return Done("kept") if self._pins.keep(request.pin) else no_pin(request.pin)

    @answers_to(ClosePin)
    def _close_pin(self, request: ClosePin) -> Done:
        self._pins.close(request.pin)
        return Done("the pin is closed")

    @answers_to(GetSurvey)
    def _survey(self, request: GetSurvey) -> Survey | Refused:
        return self._surveyor.answer(_signed(request))

    @answers_to(GetEvents)
    def _happened(self, request: GetEvents) -> messages.Events | Refused:
        if not 0 <= request.limit <= MOST_EVENTS_AT_ONCE:
            text = f"the limit of events must be 0 to {MOST_EVENTS_AT_ONCE}, got {request.limit}"
            return Refused(RefusedWhy.INVALID, text)
        return messages.Events(*self._events.log.since(request.since, request.limit))

    @answers_to(ListScripts)
    def _list_scripts(self, _: ListScripts) -> Scripts:
        own = self._own_script
        return Scripts(str(own.parent), script_folder.list_scripts(own), own.name)

    @property
    def _own_script(self) -> Path:
        return Path(self._mirror.now.robot.script)

    @answers_to(ReadScript)
    def _read_script(self, request: ReadScript) -> ScriptText:
        from silo.settings.script import format_script

        if not request.path:
            now = self._mirror.now
            return ScriptText(str(self._own_script), format_script(now.table.elements, extras=now.robot.extras))
        path = script_folder.resolve(request.path, self._own_script)
        return ScriptText(str(path), script_folder.read_text(path))

    @answers_to(DiffScript)
    def _diff_script(self, request: DiffScript) -> ScriptDiff:
        from silo.settings.script import apply_script, diff_options, parse_script

        path = script_folder.resolve(request.path, self._own_script)
        table = self._mirror.now.table.elements
        script = parse_script(script_folder.read_text(path), path)
        plan = apply_script(script, table, self._mirror.status().frequency_hz)
        unknown = [str(unknown.name) for unknown in plan.unknown]
        return ScriptDiff(str(path), diff_options(table, plan.options), unknown, script.warnings)

    # ----------------------------------------------------------------------------------------------------- changing

    @answers_to(Save)
    def _save(self, request: Save) -> SaveStarted | Refused:
        return self._saver.save(_signed(request))

    @answers_to(AddMark)
    def _mark(self, request: AddMark) -> Marked | Refused:
        text = plain(request.text, MOST_MARK_LETTERS).strip()
        status = self._mirror.status()
        if not text:
            return Refused(RefusedWhy.INVALID, "a mark needs some words; nothing was marked")
        if not -1 <= request.tick < max(status.ticks, 0):
            there = f"0 to {status.ticks - 1}" if status.ticks else "none yet"
            return Refused(RefusedWhy.INVALID, f"there is no tick {request.tick} (ticks: {there}); nothing was marked")
        tick = request.tick if request.tick >= 0 else None
        if request.at_ns and (tick := self._mirror.tick_at(request.at_ns)) < 0:
            return Refused(RefusedWhy.INVALID, "no tick of that time is held any more; nothing was marked")
        return Marked(self._events.publish(EventKind.MARKER, text, by=request.client, tick=tick))

    @answers_to(ApplyEdits)
    def _apply(self, request: ApplyEdits) -> EditsApplied | GoesOn | Refused:
        now = self._mirror.now
        return _must_live(now) or _must_stop(now) or check_edits(request, now) or self._through(_signed(request))

    def _through(self, request: ApplyEdits) -> EditsApplied | GoesOn | Refused:
        if not request.edits:
            return EditsApplied(self._mirror.now.table.revision, 0)
        reply = self._robot.ask(request)
        return reply if isinstance(reply, EditsApplied | GoesOn | Refused) else _unexpected(request, reply)

    @answers_to(Start, Stop, Restart)
    def _control(self, request: Start | Stop | Restart) -> StatusReply | GoesOn | Refused:
        reply = _must_live(self._mirror.now) or self._robot.ask(_signed(request))
        if isinstance(reply, GoesOn | Refused):
            return reply
        return StatusReply(self._mirror.status(), reply.text if isinstance(reply, Done) else "")

    @answers_to(LoadScript)
    def _load_script(self, request: LoadScript) -> EditsApplied | GoesOn | Refused:
        now = self._mirror.now
        return _must_live(now) or _must_stop(now) or self._load(request, now)

    def _load(self, request: LoadScript, now: LoggerSnapshot) -> EditsApplied | GoesOn | Refused:
        from silo.settings.script import apply_script, parse_script

        path = script_folder.resolve(request.path, self._own_script)
        script = parse_script(script_folder.read_text(path), path)
        plan = apply_script(script, now.table.elements, self._mirror.status().frequency_hz)
        edits = [
            Edit(info.name, options)
            for info, options in zip(now.table.elements, plan.options, strict=True)
            if options != info.options
        ]
        unknown = [name.name for name in plan.unknown]
        # the edits are based on the table that was just compared, whatever the client has seen
        based_on = now.table.revision if request.revision == -1 else request.revision
        checked = ApplyEdits(revision=based_on, edits=edits, client=request.client)
        reply = check_edits(checked, now) or self._through(_signed(checked))
        if not isinstance(reply, EditsApplied):
            return reply
        text = f"script {path} loaded: {reply.changed} elements changed"
        if unknown:
            text += f", {len(unknown)} names are not in the table"
        if script.unknown_keys:
            text += f", {len(script.unknown_keys)} keys are unknown and were left alone"
        if script.extras is not None and script.extras != now.robot.extras:
            text += "; its derived signals, limits and triggers are read when the program starts"
        self._events.publish(EventKind.SCRIPT_LOADED, text, by=request.client)
        return EditsApplied(reply.revision, reply.changed, unknown, script.warnings)

    @answers_to(SaveScript)
    def _save_script(self, request: SaveScript) -> Done:
        from silo.settings.script import kept_text, write_script

        path = script_folder.resolve(request.path, self._own_script)
        script_folder.check_target(path, overwrite=request.overwrite)
        now = self._mirror.now
        kept = write_script(path, now.table.elements, now.robot.extras)
        text = f"script saved: {path}{kept_text(kept)}"
        self._events.publish(EventKind.SCRIPT_SAVED, text, by=request.client)
        return Done(text)


def _unexpected(request: Request[Any], reply: AnyReply) -> Refused:
    text = f"the robot process answered {type(request).__name__} with a {type(reply).__name__}"
    return Refused(RefusedWhy.FAILED, text)


def _must_live(now: LoggerSnapshot) -> Refused | None:
    return Refused(RefusedWhy.DEAD, f"{now.died}; start the robot program again") if now.died else None


def _must_stop(now: LoggerSnapshot) -> Refused | None:
    return refused_running() if now.state is State.RUNNING else None


def _signed(request: Signed) -> Signed:
    """Return the request with a sender that is safe to show."""
    return msgspec.structs.replace(request, client=plain(request.client))
