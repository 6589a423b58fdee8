"""What the helper answers to each request: one method each, registered with `answers_to`.

Pure routing: what is checked and who does it; the work is done in the modules that are called here.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from silo.errors import ElementError, SaveError, ScriptError, SegmentError
from silo.helper import script_folder
from silo.helper.events import Events, plain
from silo.helper.history import check_history, history
from silo.helper.judge import Judge
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.pins import Pins, no_pin
from silo.helper.publisher import Publisher
from silo.helper.recorders import Recording
from silo.helper.recordings import RecordingFolder, RecordingRefusedError
from silo.helper.requests import check_edits
from silo.helper.robot import Robot
from silo.helper.samples import check_samples, samples
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc import messages
from silo.ipc.conditions import worst_first
from silo.ipc.messages import (
    Acknowledge,
    AddMark,
    Alarms,
    AnyReply,
    ApplyEdits,
    ArmTrigger,
    ClosePin,
    CloseStream,
    CloseView,
    Columns,
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
    GoesOn,
    Hello,
    HelloReply,
    KeepPin,
    ListRecorders,
    ListRecordings,
    ListScripts,
    LoadScript,
    Marked,
    OpenPin,
    OpenStream,
    OpenView,
    Piece,
    PinOpened,
    ReadScript,
    Recorders,
    RecorderStarted,
    RecordingParts,
    Recordings,
    Refused,
    RefusedWhy,
    RemoveLimits,
    RemoveTrigger,
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

    def __init__(
        self,
        mirror: Mirror,
        events: Events,
        publisher: Publisher,
        saver: Saver,
        robot: Robot,
        judge: Judge,
        recording: Recording,
    ) -> None:
        self._mirror = mirror
        self._events = events
        self._publisher = publisher
        self._saver = saver
        self._robot = robot
        self._recording = recording
        self._judge = judge
        self._pins = Pins()
        self._recordings = RecordingFolder()
        self._surveyor = Surveyor(mirror)

    def stop(self) -> None:
        """End what goes on by itself."""
        self._surveyor.stop()

    def answer(self, request: Request[Any]) -> bytes:
        """Return the encoded answer; waits for the robot process where it must."""
        reply: AnyReply | bytes
        try:
            reply = HANDLERS[type(request)](self, request)
        except (script_folder.ScriptRefusedError, RecordingRefusedError) as error:
            reply = error.refused
        except (ScriptError, SaveError, ElementError) as error:
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

    @answers_to(ListRecorders)
    def _list_recorders(self, _: ListRecorders) -> Recorders:
        return Recorders(self._recording.infos())

    @answers_to(GetTriggers)
    def _triggers(self, _: GetTriggers) -> Triggers:
        found = self._judge.standing()
        return Triggers(found.run, found.tick, list(found.triggers))

    @answers_to(GetLimits)
    def _limits(self, _: GetLimits) -> Alarms:
        found = self._judge.standing()
        return Alarms(found.run, found.tick, worst_first(list(found.limits)))

    @answers_to(TryTrigger)
    def _try_trigger(self, request: TryTrigger) -> TriggerTried:
        from silo.helper.trials import try_trigger

        return try_trigger(request.trigger, self._mirror.open_reader(), self._mirror.now.table.elements)

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

    @answers_to(ListRecordings)
    def _list_recordings(self, request: ListRecordings) -> Recordings:
        robot = self._mirror.now.robot
        return self._recordings.listing(robot.folder, robot.logger, request.most)

    @answers_to(GetParts)
    def _parts(self, request: GetParts) -> RecordingParts:
        return self._recordings.parts(self._mirror.now.robot.folder, request.name)

    @answers_to(GetPiece)
    def _piece(self, request: GetPiece) -> Piece:
        return self._recordings.piece(self._mirror.now.robot.folder, request)

    # ----------------------------------------------------------------------------------------------------- changing

    @answers_to(DeleteRecording)
    def _delete_recording(self, request: DeleteRecording) -> Done:
        robot = self._mirror.now.robot
        text = self._recordings.delete(robot.folder, robot.logger, request.name)
        self._events.publish(EventKind.DELETED, text, by=request.client)
        return Done(text)

    @answers_to(Save)
    def _save(self, request: Save) -> SaveStarted | Refused:
        return self._saver.save(_signed(request))

    @answers_to(StartRecorder)
    def _start_recorder(self, request: StartRecorder) -> RecorderStarted | Refused:
        return _must_live(self._mirror.now) or self._recording.begin(_signed(request))

    @answers_to(StopRecorder)
    def _stop_recorder(self, request: StopRecorder) -> Done | Refused:
        return self._recording.end(_signed(request))

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
        if not request.edits and request.extras is None:
            return EditsApplied(self._mirror.now.table.revision, 0)
        reply = self._robot.ask(request)
        return reply if isinstance(reply, EditsApplied | GoesOn | Refused) else _unexpected(request, reply)

    @answers_to(Start, Stop, Restart)
    def _control(self, request: Start | Stop | Restart) -> StatusReply | GoesOn | Refused:
        reply = _must_live(self._mirror.now) or self._robot.ask(_signed(request))
        if isinstance(reply, GoesOn | Refused):
            return reply
        return StatusReply(self._mirror.status(), reply.text if isinstance(reply, Done) else "")

    @answers_to(SetTrigger, RemoveTrigger, SetLimits, RemoveLimits)
    def _conditions(self, request: SetTrigger | RemoveTrigger | SetLimits | RemoveLimits) -> Done | GoesOn | Refused:
        if isinstance(request, SetTrigger) and request.lease_s:
            return self._hold_trigger(request)
        if isinstance(request, RemoveTrigger) and self._judge.let_go(request.name):
            return Done(f"trigger '{plain(request.name)}' is let go of")
        reply = _must_live(self._mirror.now) or self._robot.ask(_signed(request))
        if isinstance(reply, Done):
            self._events.publish(EventKind.CONDITIONS, reply.text, by=request.client)
        return reply if isinstance(reply, Done | GoesOn | Refused) else _unexpected(request, reply)

    def _hold_trigger(self, request: SetTrigger) -> Done | Refused:
        refused = _must_live(self._mirror.now)
        if refused is not None:
            return refused
        is_new = self._judge.hold(request.trigger, request.lease_s, plain(request.client))
        kept = "held" if is_new else "kept"
        return Done(f"trigger '{request.trigger.name}' is {kept} for {request.lease_s:g} s")

    @answers_to(ArmTrigger)
    def _arm(self, request: ArmTrigger) -> Done | GoesOn | Refused:
        now = self._mirror.now
        if self._judge.leased.owner(request.name):
            self._judge.arm(request.name, armed=request.armed)
            return Done(f"trigger '{request.name}' is {'armed' if request.armed else 'off'}")
        known = next((one for one in now.robot.extras.triggers if one.name == request.name), None)
        if known is None:
            return _no_trigger(request.name, now)
        if known.armed != request.armed:
            changed = SetTrigger(
                trigger=msgspec.structs.replace(known, armed=request.armed), client=request.client
            )  # it stays so for the next run and in scripts
            reply = _must_live(now) or self._robot.ask(_signed(changed))
            if not isinstance(reply, Done):
                return reply if isinstance(reply, GoesOn | Refused) else _unexpected(request, reply)
        self._judge.arm(request.name, armed=request.armed)
        text = f"trigger '{request.name}' is {'armed' if request.armed else 'off'}"
        self._events.publish(EventKind.CONDITIONS, text, by=request.client)
        return Done(text)

    @answers_to(ForceTrigger)
    def _force(self, request: ForceTrigger) -> Done | Refused:
        now = self._mirror.now
        if request.name not in self._judge.names():
            return _no_trigger(request.name, now)
        refused = _must_live(now)
        return refused or Done(f"trigger '{request.name}' was fired at tick {self._judge.force(request.name)}")

    @answers_to(Acknowledge)
    def _acknowledge(self, request: Acknowledge) -> Done:
        who = plain(request.who or request.client)
        count = self._judge.acknowledge(request.names, who, time.time_ns())
        text = f"{count} alarm{'s' if count != 1 else ''} seen by {who}"
        if count:
            self._events.publish(EventKind.CONDITIONS, text, by=request.client)
        return Done(text)

    @answers_to(LoadScript)
    def _load_script(self, request: LoadScript) -> EditsApplied | GoesOn | Refused:
        now = self._mirror.now
        return _must_live(now) or _must_stop(now) or self._load(request, now)

    def _load(self, request: LoadScript, now: LoggerSnapshot) -> EditsApplied | GoesOn | Refused:
        from silo.settings.script import apply_script, parse_script
        from silo.settings.script_extras import extras_text

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
        wanted = script.extras_beside(now.robot.extras)
        extras = wanted if wanted != now.robot.extras else None
        checked = ApplyEdits(revision=based_on, edits=edits, extras=extras, client=request.client)
        reply = check_edits(checked, now) or self._through(_signed(checked))
        if not isinstance(reply, EditsApplied):
            return reply
        text = f"script {path} loaded: {reply.changed} elements changed"
        if unknown:
            text += f", {len(unknown)} names are not in the table"
        if script.unknown_keys:
            text += f", {len(script.unknown_keys)} keys are unknown and were left alone"
        if extras is not None:
            text += f"; {extras_text(extras)}"
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


def _no_trigger(name: str, now: LoggerSnapshot) -> Refused:
    names = ", ".join(one.name for one in now.robot.extras.triggers)
    there = f"there are {names}" if names else "there is none"
    return Refused(RefusedWhy.NOT_FOUND, f"no trigger is called '{plain(name)}', {there}; nothing was changed")


def _must_live(now: LoggerSnapshot) -> Refused | None:
    return Refused(RefusedWhy.DEAD, f"{now.died}; start the robot program again") if now.died else None


def _must_stop(now: LoggerSnapshot) -> Refused | None:
    return refused_running() if now.state is State.RUNNING else None


def _signed(request: Signed) -> Signed:
    """Return the request with a sender that is safe to show."""
    return msgspec.structs.replace(request, client=plain(request.client))
