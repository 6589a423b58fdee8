"""Scripts in the logger's script folder, and views of the terminal beside them."""

from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from silo.core.elements import Edit
from silo.core.quantities.writing import many
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.scripts import requests, script_folder, view_folder
from silo.scripts.requests import KeptView, KeptViews, ScriptDiff, Scripts, ScriptText
from silo.state.events import EventNotifier
from silo.state.replica import Replica
from silo.state.requests import ApplyEdits, EditsApplied
from silo.state.robot_program import RobotProgram
from silo.state.server import apply_edits

TRIES = 10  # each is in vain only if the robot program changed its table within the milliseconds of that try


@dataclass(frozen=True)
class ScriptServer(Server, does=[requests]):
    """Answers with texts; what a script changes is done by the robot program."""

    replica: Replica
    events: EventNotifier
    robot: RobotProgram

    def scripts(self) -> Scripts:
        own = self._own_script
        return Scripts(str(script_folder.folder_of(own)), script_folder.list_scripts(own), own.name)

    def read_script(self, path: str) -> ScriptText:
        from silo.settings.script import format_script

        if not path:
            now = self.replica.now
            return ScriptText(str(self._own_script), format_script(now.table.elements, conditions=now.robot.conditions))
        found = script_folder.resolve(path, self._own_script)
        return ScriptText(str(found), script_folder.read_text(found))

    def diff_script(self, path: str) -> ScriptDiff:
        from silo.segment.retention import kept_how, new_end_text
        from silo.settings.conditions_diff import diff_conditions
        from silo.settings.script import apply_script, parse_script
        from silo.settings.typed import diff_options

        found = script_folder.resolve(path, self._own_script)
        table = self.replica.now.table.elements
        script = parse_script(script_folder.read_text(found), found)
        status = self.replica.status()
        plan = apply_script(script, table, status.frequency_hz)
        planned = (replace(info, options=options) for info, options in zip(table, plan.options, strict=True))
        end = new_end_text(kept_how(table), kept_how(planned), status.max_time_s)
        unknown = [str(unknown.name) for unknown in plan.unknown]
        now = self.replica.now.robot.conditions
        conditions = diff_conditions(now, script.conditions_beside(now))
        return ScriptDiff(str(found), diff_options(table, plan.options), unknown, script.warnings, conditions, end)

    def load_script(self, turn: Turn, path: str, revision: int, cut: bool) -> EditsApplied:
        for _ in range(TRIES - 1):
            try:
                return self._load(turn, path, revision, cut=cut)
            except RequestRefusedError as refused:  # noqa: PERF203  # once, as a rule
                if revision != -1 or refused.why is not RefusedWhy.CONFLICT:
                    raise
            # The robot program changed its table on the way, and whoever asks means whatever table there is. The robot
            # process pushes its table before it answers, so the replica has it by now: compare the script anew.
        return self._load(turn, path, revision, cut=cut)

    def _load(self, turn: Turn, path: str, revision: int, *, cut: bool) -> EditsApplied:
        from silo.settings.script import apply_script, parse_script, script_conditions
        from silo.settings.script_conditions import conditions_text

        now = self.replica.now
        self.robot.must_live()
        if not cut:
            self.robot.must_stop()
        found = script_folder.resolve(path, self._own_script)
        script, table, options = parse_script(script_folder.read_text(found), found), now.table.elements, now.options
        plan = apply_script(script, table, options.frequency_hz)
        wanted = script_conditions(script, now.robot.conditions, table, plan, options.prefix, options.frequency_hz)
        edits = [
            Edit(info.name, options)
            for info, options in zip(now.table.elements, plan.options, strict=True)
            if options != info.options
        ]
        unknown = [name.name for name in plan.unknown]
        # the edits are based on the table that was just compared, whatever the client has seen
        based_on = now.table.revision if revision == -1 else revision
        conditions = wanted if wanted != now.robot.conditions else None
        request = ApplyEdits(revision=based_on, edits=edits, conditions=conditions, cut=cut)
        applied = apply_edits(self.robot, turn, request, now, fit=True)
        text = f"script {found} loaded: {many(applied.changed, 'element')} changed"
        if unknown:
            text += f", {many(len(unknown), 'name')} not in the table"
        if script.unknown_keys:
            text += f", {many(len(script.unknown_keys), 'unknown key')} left alone"
        if conditions is not None:
            text += f"; {conditions_text(conditions)}"
        self.events.publish(EventKind.SCRIPT_LOADED, text, by=turn.by)
        return EditsApplied(
            applied.revision, applied.changed, unknown, [*script.warnings, *plan.rates, *applied.warnings]
        )

    def save_script(self, turn: Turn, path: str, overwrite: bool) -> str:
        from silo.settings.script import write_script

        target = script_folder.resolve(path, self._own_script)
        script_folder.check_target(target, self._own_script, overwrite=overwrite)
        now = self.replica.now
        kept = write_script(
            target, now.table.elements, now.robot.conditions,
            own=target.resolve() == self._own_script.resolve(), prefix=now.options.prefix,
        )  # fmt: skip
        text = f"script saved: {target}{kept}"
        self.events.publish(EventKind.SCRIPT_SAVED, text, by=turn.by)
        return text

    @property
    def _own_script(self) -> Path:
        return Path(self.replica.now.robot.script)

    # ------------------------------------------------------------------------------------------------ kept views

    def kept_views(self) -> KeptViews:
        return KeptViews(str(view_folder.folder_of(self._own_script)), view_folder.names(self._own_script))

    def kept_view(self, name: str) -> KeptView:
        path, text = view_folder.read(self._own_script, name)
        return KeptView(str(path), text)

    def keep_view(self, name: str, text: str, overwrite: bool) -> str:
        return f"view kept on the robot: {view_folder.keep(self._own_script, name, text, overwrite=overwrite)}"
