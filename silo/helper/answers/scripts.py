"""Scripts in the logger's script folder."""

from pathlib import Path

from silo.helper import script_folder
from silo.helper.answers.elements import through
from silo.helper.answers.table import Parts, answers_to, must_live, must_stop
from silo.helper.lanes import Lane
from silo.helper.mirror import LoggerSnapshot
from silo.helper.requests import check_edits
from silo.ipc.messages import (
    ApplyEdits,
    DiffScript,
    Done,
    EditsApplied,
    GoesOn,
    ListScripts,
    LoadScript,
    ReadScript,
    Refused,
    RefusedWhy,
    SaveScript,
    ScriptDiff,
    Scripts,
    ScriptText,
)
from silo.ipc.published import EventKind
from silo.model import Edit

TRIES = 10  # each is in vain only if the robot program changed its table within the milliseconds of that try


@answers_to(ListScripts)
def _list_scripts(parts: Parts, _: ListScripts) -> Scripts:
    own = _own_script(parts)
    return Scripts(str(script_folder.folder_of(own)), script_folder.list_scripts(own), own.name)


@answers_to(ReadScript)
def _read_script(parts: Parts, request: ReadScript) -> ScriptText:
    from silo.settings.script import format_script

    if not request.path:
        now = parts.mirror.now
        return ScriptText(str(_own_script(parts)), format_script(now.table.elements, extras=now.robot.extras))
    path = script_folder.resolve(request.path, _own_script(parts))
    return ScriptText(str(path), script_folder.read_text(path))


@answers_to(DiffScript)
def _diff_script(parts: Parts, request: DiffScript) -> ScriptDiff:
    from silo.settings.extras_diff import diff_extras
    from silo.settings.script import apply_script, diff_options, parse_script

    path = script_folder.resolve(request.path, _own_script(parts))
    table = parts.mirror.now.table.elements
    script = parse_script(script_folder.read_text(path), path)
    plan = apply_script(script, table, parts.mirror.status().frequency_hz)
    unknown = [str(unknown.name) for unknown in plan.unknown]
    now = parts.mirror.now.robot.extras
    extras = diff_extras(now, script.extras_beside(now))
    return ScriptDiff(str(path), diff_options(table, plan.options), unknown, script.warnings, extras)


@answers_to(LoadScript, lane=Lane.DISK)
def _load_script(parts: Parts, request: LoadScript) -> EditsApplied | GoesOn | Refused:
    for _ in range(TRIES):
        now = parts.mirror.now
        reply = must_live(now) or must_stop(now) or _load(parts, request, now)
        overtaken = isinstance(reply, Refused) and reply.why is RefusedWhy.CONFLICT
        if request.revision != -1 or not overtaken:
            break
        # The robot program changed its table on the way, and whoever asks means whatever table there is. The robot
        # process pushes its table before it answers, so the mirror has it by now: compare the script anew.
    return reply


def _load(parts: Parts, request: LoadScript, now: LoggerSnapshot) -> EditsApplied | GoesOn | Refused:
    from silo.settings.script import apply_script, parse_script
    from silo.settings.script_extras import extras_text

    path = script_folder.resolve(request.path, _own_script(parts))
    script = parse_script(script_folder.read_text(path), path)
    plan = apply_script(script, now.table.elements, parts.mirror.status().frequency_hz)
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
    reply = check_edits(checked, now) or through(parts, checked)
    if not isinstance(reply, EditsApplied):
        return reply
    text = f"script {path} loaded: {reply.changed} elements changed"
    if unknown:
        text += f", {len(unknown)} names are not in the table"
    if script.unknown_keys:
        text += f", {len(script.unknown_keys)} keys are unknown and were left alone"
    if extras is not None:
        text += f"; {extras_text(extras)}"
    parts.events.publish(EventKind.SCRIPT_LOADED, text, by=request.client)
    return EditsApplied(reply.revision, reply.changed, unknown, script.warnings)


@answers_to(SaveScript, lane=Lane.DISK)
def _save_script(parts: Parts, request: SaveScript) -> Done:
    from silo.settings.script import kept_text, write_script

    path = script_folder.resolve(request.path, _own_script(parts))
    script_folder.check_target(path, _own_script(parts), overwrite=request.overwrite)
    now = parts.mirror.now
    kept = write_script(path, now.table.elements, now.robot.extras)
    text = f"script saved: {path}{kept_text(kept)}"
    parts.events.publish(EventKind.SCRIPT_SAVED, text, by=request.client)
    return Done(text)


def _own_script(parts: Parts) -> Path:
    return Path(parts.mirror.now.robot.script)
