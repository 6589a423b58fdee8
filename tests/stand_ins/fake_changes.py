"""What changes a made-up logger: scripts, edits, starts and stops, saves, recordings, kept views."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from silo.conditions.standing import TriggerStatus
from silo.core.conditions import Conditions, TriggerWord
from silo.core.elements import Edit, ElementOptions, FileType, RecorderState, SavedFile, State, Status
from silo.core.quantities.reading import read_keep, read_split
from silo.errors import ScriptError
from silo.recorder.requests import RecorderInfo, RecorderStarted
from silo.recordings.fetching import Fetch
from silo.recordings.folder import RecordingFolder
from silo.recordings.requests import GetPiece, Recordings
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy
from silo.scripts.requests import KeptView, KeptViews, ScriptDiff, Scripts, ScriptText
from silo.segment.retention import end_text, kept_how, new_end_text
from silo.settings.conditions_diff import diff_conditions
from silo.settings.options import edit_problems, refusal
from silo.settings.script import Script, ScriptPlan, apply_script, format_script, parse_script
from silo.settings.typed import diff_options
from silo.state.requests import EditsApplied, Unsaved
from tests.stand_ins.fake_signals import FOLDER, HZ, OWN_NAME, refused


class FakeChanges:
    """What is done to it, at the next revision."""

    def scripts(self) -> Scripts:
        self._ask()
        return Scripts(folder=FOLDER, names=sorted(self.files), current="robot.yaml")

    def _script(self, path: str) -> tuple[str, str]:
        """Path on the robot and text of a script."""
        self._ask()
        if path not in self.files:
            raise refused(RefusedWhy.NOT_FOUND, f"there is no script {path!r} in {FOLDER}")
        return f"{FOLDER}/{path}", self.files[path]

    def _plan(self, path: str) -> tuple[Script, ScriptPlan]:
        full, text = self._script(path)
        try:
            script = parse_script(text, full)
            return script, apply_script(script, self.elements, HZ)
        except ScriptError as error:
            raise refused(RefusedWhy.INVALID, str(error)) from error

    def read_script(self, path: str = "") -> ScriptText:
        self._ask()
        if not path:
            return ScriptText(
                path=f"{FOLDER}/robot.yaml", text=format_script(self.elements, conditions=self.conditions)
            )
        full, text = self._script(path)
        return ScriptText(path=full, text=text)

    def diff_script(self, path: str = "") -> ScriptDiff:
        script, plan = self._plan(path)
        changes = diff_options(self.elements, plan.options)
        unknown = [str(unknown.name) for unknown in plan.unknown]
        conditions = diff_conditions(self.conditions, script.conditions_beside(self.conditions))
        planned = (
            msgspec.structs.replace(info, options=options)
            for info, options in zip(self.elements, plan.options, strict=True)
        )
        end = new_end_text(kept_how(self.elements), kept_how(planned), self.status().max_time_s)
        return ScriptDiff(f"{FOLDER}/{path}", changes, unknown, script.warnings, conditions, end)

    @property
    def conditions(self) -> Conditions:
        """What belongs to it beside its elements."""
        return Conditions(self.derived, self.limit_options, tuple(one.options for one in self.trigger_statuses))

    def _take_conditions(self, conditions: Conditions) -> None:
        self.derived, self.limit_options = conditions.derived, conditions.limits
        known = {one.options: one for one in self.trigger_statuses}
        self.trigger_statuses = [known.get(one, TriggerStatus(one, TriggerWord.ARMED)) for one in conditions.triggers]

    def _check(self, revision: int, *, stopped: bool = True) -> None:
        self._ask()
        if stopped and self.state is State.RUNNING:
            raise refused(RefusedWhy.RUNNING, "the logger runs: stop it first")
        if revision not in {self.revision, -1}:
            raise refused(RefusedWhy.CONFLICT, "the table was changed by bob@lab meanwhile")

    def _take(self, wanted: Sequence[ElementOptions]) -> int:
        """Takes new options over and returns how many elements they change."""
        changed = sum(info.options != options for info, options in zip(self.elements, wanted, strict=True))
        self.elements = [
            msgspec.structs.replace(info, options=options) for info, options in zip(self.elements, wanted, strict=True)
        ]
        self.revision += changed > 0
        return changed

    def apply(self, edits: Sequence[Edit], revision: int, *, cut: bool = False) -> EditsApplied:
        self._ask()
        self.calls.append(("cut" if cut else "apply", list(edits), revision))
        self._check(revision, stopped=not cut)
        wanted = {info.name: info.options for info in self.elements}
        if problems := edit_problems(edits, wanted):
            raise refused(RefusedWhy.INVALID, refusal(problems), problems)
        wanted.update((edit.name, edit.options) for edit in edits)
        before = kept_how(self.elements)
        changed = self._take([wanted[info.name] for info in self.elements])
        end = new_end_text(before, kept_how(self.elements), self.status().max_time_s)
        self.publish(EventKind.EDITED, f"{changed} elements edited", by=OWN_NAME)
        return EditsApplied(revision=self.revision, changed=changed, warnings=[end] if end else [])

    def start(self, unsaved: str = "refuse", told: Callable[[str], None] = lambda _: None) -> Status:
        self._ask()
        self.calls.append(("start",))
        if self.state is State.RUNNING:
            raise refused(RefusedWhy.RUNNING, "it runs already: stop it first; nothing was changed")
        self._settle(unsaved)
        self._begin()
        if end := end_text(kept_how(self.elements), self.status().max_time_s):
            told(end)
        return self.status()

    def _settle(self, unsaved: str) -> None:
        if Unsaved(unsaved) is Unsaved.REFUSE and self.ticks and not self.saved:
            raise refused(RefusedWhy.UNSAVED, "it holds what is in no file (save or discard); nothing was changed")

    def _begin(self) -> None:
        self.state, self.started_ns, self.saved = State.RUNNING, self.now_ns, False
        self._recorded = {info.name: info.options for info in self.elements}
        self.publish(EventKind.STARTED, "started", by=OWN_NAME)

    def stop(self) -> Status:
        self._ask()
        self.calls.append(("stop",))
        self._end()
        return self.status()

    def _end(self) -> None:
        if self.state is State.RUNNING:
            self.state = State.STOPPED
            self.publish(EventKind.STOPPED, "stopped", by=OWN_NAME)

    def restart(self, unsaved: str = "refuse", told: Callable[[str], None] = lambda _: None) -> Status:
        self._ask()
        self._settle(unsaved)
        self.stop()
        return self.start(Unsaved.DISCARD, told)

    def load_script(self, path: str = "", revision: int = -1, cut: bool = False) -> EditsApplied:
        self._ask()
        self.calls.append(("load_script and go on" if cut else "load_script", path))
        self._check(revision, stopped=not cut)
        script, plan = self._plan(path)
        changed = self._take(plan.options)
        if script.conditions is not None:
            self._take_conditions(script.conditions)
        self.publish(EventKind.SCRIPT_LOADED, f"script {path} loaded", by=OWN_NAME)
        return EditsApplied(self.revision, changed, [str(unknown.name) for unknown in plan.unknown], script.warnings)

    def save_script(self, path: str = "", overwrite: bool = False) -> str:
        self._ask()
        self.calls.append(("save_script", path, overwrite))
        if path in self.files and not overwrite:
            raise refused(RefusedWhy.EXISTS, f"{FOLDER}/{path} exists")
        self.files[path] = format_script(self.elements, conditions=self.conditions)
        self.publish(EventKind.SCRIPT_SAVED, f"script {path} saved", by=OWN_NAME)
        return f"saved {FOLDER}/{path}"

    def save(self, types: Sequence[FileType], name: str = "") -> int:
        self._ask()
        self.calls.append(("save", list(types), name))
        if not self.ticks:
            text = "nothing was logged yet: start the logger first"
            self.publish(EventKind.SAVE_FAILED, text, by=OWN_NAME)
            raise refused(RefusedWhy.FAILED, text)
        self._jobs += 1
        self.publish(EventKind.SAVING, "saving", by=OWN_NAME, job=self._jobs, progress=0.5)
        if not self.save_takes_long:
            self.end_save(types, name)
        return self._jobs

    def end_save(self, types: Sequence[FileType], name: str = "") -> None:
        """Tell how the last save ended."""
        if self.save_error:
            self.publish(EventKind.SAVE_FAILED, self.save_error, by=OWN_NAME, job=self._jobs)
        else:
            stem = name or "robot_00001"
            files = [SavedFile(f"/home/ann/logs/{stem}.{kind.name.lower()}", kind, 1_234_567) for kind in types]
            self.saved = True
            told = {"job": self._jobs, "progress": 1.0, "files": files}
            self.publish(EventKind.SAVED, f"saved {files[0].path}", by=OWN_NAME, **told)

    def _recordings_of(self, job: Callable[[RecordingFolder, str], Any]) -> Any:
        self._ask()
        return job(self._folder, str(self.logs or "/home/ann/logs"))

    def recordings(self, most: int = 1000) -> Recordings:
        if self.logs is None:
            self._ask()
            return Recordings("/home/ann/logs", [], 0)
        found: Recordings = self._recordings_of(lambda folder, place: folder.listing(place, self.name, most))
        return found

    def fetch(
        self, name: str, folder: Any = ".", progress: Callable[[int, int], None] | None = None,
        *, replace: bool = False, patience_s: float = 30.0,
    ) -> Path:  # fmt: skip
        def piece(path: str, mark: str, offset: int, count: int, sum_only: bool) -> Any:
            request = GetPiece(path=path, mark=mark, offset=offset, count=count, sum_only=sum_only)
            return self._recordings_of(lambda folder, place: folder.piece(place, request))

        def parts(name: str) -> Any:
            return self._recordings_of(lambda folder, place: folder.parts(place, name))

        return Fetch(parts, piece, lambda: self.connected, patience_s).run(name, Path(folder), progress, replace)

    def delete_recording(self, name: str) -> str:
        self.calls.append(("delete", name))
        text: str = self._recordings_of(lambda folder, place: folder.delete(place, self.name, name))
        self.publish(EventKind.DELETED, text, by=OWN_NAME)
        return text

    def oldest_ns(self, names: Sequence[str]) -> int:
        """The oldest moment that the buffers hold of any of these."""
        held = [self._held_samples(name).time_ns for name in names]
        return min([int(stamps[0]) for stamps in held if len(stamps)], default=0)

    def _kept_views(self) -> KeptViews:
        self._ask()
        return KeptViews(f"{FOLDER}/views", sorted(self.views_kept))

    def _kept_view(self, name: str) -> KeptView:
        self._ask()
        if name not in self.views_kept:
            raise refused(RefusedWhy.NOT_FOUND, f"there is no view '{name}' on the robot")
        return KeptView(f"{FOLDER}/views/{name}.yaml", self.views_kept[name])

    def _keep_view(self, name: str, text: str, overwrite: bool = False) -> str:
        self._ask()
        if name in self.views_kept and not overwrite:
            raise refused(RefusedWhy.EXISTS, f"there is a view '{name}' on the robot")
        self.views_kept[name] = text
        return f"view kept on the robot: {FOLDER}/views/{name}.yaml"

    def recorders(self) -> list[RecorderInfo]:
        self._ask()
        return list(self.recorder_infos)

    def record(
        self, patterns: Sequence[str] = (), to: str = "", split: str = "1GB", keep: str = "", name: str = ""
    ) -> RecorderStarted:
        self._ask()
        self.calls.append(("record", tuple(patterns), to, split, keep, name))
        made = RecorderInfo(
            name or self.name, f"/home/ann/logs/{to or 'recordings'}", RecorderState.RECORDING, list(patterns),
            *read_split(split), read_keep(keep), "part1.mcap", since_ns=self.now_ns, by=OWN_NAME,
        )  # fmt: skip
        self.recorder_infos.append(made)
        self.publish(EventKind.RECORDING, f"recording '{made.name}'", by=OWN_NAME)
        return RecorderStarted(made.name, made.folder, self.record_warns)

    def stop_recorder(self, name: str = "") -> str:
        self._ask()
        self.calls.append(("stop_recorder", name))
        self.recorder_infos = [one for one in self.recorder_infos if one.name != name]
        self.publish(EventKind.RECORDING, f"recording '{name}' ended", by=OWN_NAME)
        return f"recording '{name}' ended: 1 files"
