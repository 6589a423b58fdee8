"""What the helper answers to each request. Pure routing: the work is done in the modules that are called here."""

from pathlib import Path
from typing import TypeVar

import msgspec

import silo
from silo.errors import SaveError, ScriptError
from silo.helper import script_folder
from silo.helper.events import Events, plain
from silo.helper.history import check_history, history
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.publisher import Publisher
from silo.helper.requests import check_edits
from silo.helper.robot import Robot
from silo.helper.saver import Saver
from silo.ipc.messages import (
    PROTOCOL,
    AnyAsk,
    AnyDo,
    AnyReply,
    ApplyEdits,
    CloseView,
    DiffScript,
    Done,
    EditsApplied,
    EventKind,
    GetHistory,
    GetStatus,
    GetTable,
    Hello,
    HelloReply,
    ListScripts,
    LoadScript,
    OpenView,
    ReadScript,
    Refused,
    RefusedWhy,
    Restart,
    Save,
    SaveScript,
    ScriptDiff,
    Scripts,
    ScriptText,
    Start,
    StatusReply,
    Stop,
    TableReply,
)
from silo.model import Edit, State

Signed = TypeVar("Signed", ApplyEdits, Save)

_encoder = msgspec.msgpack.Encoder()


class Answers:
    """Answers requests with everything that the helper has."""

    def __init__(self, mirror: Mirror, events: Events, publisher: Publisher, saver: Saver, robot: Robot) -> None:
        self._mirror = mirror
        self._events = events
        self._publisher = publisher
        self._saver = saver
        self._robot = robot

    # ------------------------------------------------------------------------------------------------------ reading

    def ask(self, request: AnyAsk) -> bytes:
        """The encoded answer to a request that reads."""
        if isinstance(request, GetTable):
            return self._mirror.now.table_reply
        return _encoder.encode(self._answer(request))

    def _answer(self, request: AnyAsk) -> AnyReply:
        try:
            if isinstance(request, Hello):
                return self.hello()
            if isinstance(request, GetTable):
                return TableReply(self._mirror.now.table)
            if isinstance(request, GetStatus):
                return StatusReply(self._mirror.status())
            if isinstance(request, OpenView):
                return self._publisher.open_view(request)
            if isinstance(request, CloseView):
                self._publisher.close_view(request.view)
                return Done("the view is closed")
            if isinstance(request, GetHistory):
                return check_history(request) or history(request, self._mirror.now, self._mirror.open_reader())
            if isinstance(request, ListScripts):
                own = self._own_script
                return Scripts(str(own.parent), script_folder.list_scripts(own), own.name)
            if isinstance(request, ReadScript):
                return self._read_script(request)
            return self._diff_script(request)
        except script_folder.ScriptRefusedError as error:
            return error.refused
        except ScriptError as error:
            return Refused(RefusedWhy.INVALID, str(error))

    def hello(self) -> HelloReply:
        """Who this is. A client that gets it from the key `do` too may edit."""
        return HelloReply(PROTOCOL, silo.__version__, self._mirror.user, True, self._mirror.status())

    @property
    def _own_script(self) -> Path:
        return Path(self._mirror.now.robot.script)

    def _read_script(self, request: ReadScript) -> ScriptText:
        from silo.settings.script import format_script

        if not request.path:
            return ScriptText(str(self._own_script), format_script(self._mirror.now.table.elements))
        path = script_folder.resolve(request.path, self._own_script)
        return ScriptText(str(path), script_folder.read_text(path))

    def _diff_script(self, request: DiffScript) -> ScriptDiff:
        from silo.settings.script import apply_script, diff_options, parse_script

        path = script_folder.resolve(request.path, self._own_script)
        table = self._mirror.now.table.elements
        script = parse_script(script_folder.read_text(path), path)
        plan = apply_script(script, table, self._mirror.status().frequency_hz)
        unknown = [str(unknown.name) for unknown in plan.unknown]
        return ScriptDiff(str(path), diff_options(table, plan.options), unknown, script.warnings)

    # ----------------------------------------------------------------------------------------------------- changing

    def do(self, request: AnyDo | Hello) -> bytes:
        """The encoded answer to a request that changes something; waits for the robot process where it must."""
        try:
            reply = self._do(request)
        except script_folder.ScriptRefusedError as error:
            reply = error.refused
        except (ScriptError, SaveError) as error:
            reply = Refused(RefusedWhy.INVALID, str(error))
        return _encoder.encode(reply)

    def _do(self, request: AnyDo | Hello) -> AnyReply:
        if isinstance(request, Hello):
            return self.hello()
        if isinstance(request, Save):
            return self._saver.save(_signed(request))
        if isinstance(request, SaveScript):
            return self._save_script(request)
        now = self._mirror.now
        if now.died:
            return Refused(RefusedWhy.DEAD, f"{now.died}; start the robot program again")
        if isinstance(request, ApplyEdits):
            return _must_stop(now) or check_edits(request, now) or self._through(_signed(request))
        if isinstance(request, LoadScript):
            return _must_stop(now) or self._load_script(request, now)
        return self._control(request)

    def _through(self, request: ApplyEdits) -> AnyReply:
        if not request.edits:
            return EditsApplied(self._mirror.now.table.revision, 0)
        return self._robot.ask(request)

    def _control(self, request: Start | Stop | Restart) -> AnyReply:
        reply = self._robot.ask(msgspec.structs.replace(request, client=plain(request.client)))
        return reply if isinstance(reply, Refused) else StatusReply(self._mirror.status())

    def _load_script(self, request: LoadScript, now: LoggerSnapshot) -> AnyReply:
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
        self._events.publish(EventKind.SCRIPT_LOADED, text, by=request.client)
        return EditsApplied(reply.revision, reply.changed, unknown, script.warnings)

    def _save_script(self, request: SaveScript) -> AnyReply:
        from silo.settings.script import kept_text, write_script

        path = script_folder.resolve(request.path, self._own_script)
        script_folder.check_target(path, overwrite=request.overwrite)
        kept = write_script(path, self._mirror.now.table.elements)
        text = f"script saved: {path}{kept_text(kept)}"
        self._events.publish(EventKind.SCRIPT_SAVED, text, by=request.client)
        return Done(text)


def _must_stop(now: LoggerSnapshot) -> Refused | None:
    if now.state is not State.RUNNING:
        return None
    return Refused(RefusedWhy.RUNNING, "the logger is running: stop it, then apply; nothing was changed")


def _signed(request: Signed) -> Signed:
    """The request with a sender that is safe to show."""
    return msgspec.structs.replace(request, client=plain(request.client))
