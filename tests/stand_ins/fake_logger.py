"""A logger that exists only in a test: the same messages and arrays as the real client, from a clock that tests move.

What it has in common with a real helper process is held by `tests/contract`, which asks both the same.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from silo.amounts import read_keep, read_split
from silo.columns import ColumnGrid, HistoryColumns, bins_of
from silo.errors import ConnectionLostError, ElementError, ScriptError, SiloError
from silo.helper.recordings import RecordingFolder, RecordingRefusedError
from silo.ipc.bulk import Outcome
from silo.ipc.conditions import LimitStatus, TriggerStatus, TriggerWord
from silo.ipc.exchange import RequestRefusedError
from silo.ipc.fetching import Fetch
from silo.ipc.frames import Frame
from silo.ipc.member import Member
from silo.ipc.messages import (
    Alarms,
    EditsApplied,
    GetPiece,
    HelloReply,
    KeptView,
    KeptViews,
    PinOpened,
    RecorderInfo,
    RecorderStarted,
    Recordings,
    Refused,
    RefusedWhy,
    ScriptDiff,
    Scripts,
    ScriptText,
    Survey,
    Triggers,
    TriggerTried,
    Unsaved,
)
from silo.ipc.published import Event, EventKind, NotLive
from silo.ipc.samples import Samples
from silo.ipc.senders import viewer_words
from silo.ipc.surveys import QUANTITIES
from silo.ipc.versions import PROTOCOL
from silo.judging.between import Between, between
from silo.judging.derived import derived_infos
from silo.judging.extras import with_derived, without_derived
from silo.judging.moments import Finder, Looking
from silo.judging.moments import Found as FoundMoments
from silo.model import (
    Action,
    BufferType,
    Control,
    Derived,
    Edit,
    ElementInfo,
    ElementOptions,
    Entry,
    Extras,
    FileType,
    LoggedEvent,
    Present,
    Problem,
    RecorderState,
    SavedFile,
    SignalLimits,
    Sought,
    State,
    Status,
    Table,
    TriggerOptions,
    join_name,
)
from silo.settings.extras_diff import diff_extras
from silo.settings.rules import edit_problems, refusal
from silo.settings.script import Script, ScriptPlan, apply_script, diff_options, format_script, parse_script
from silo.version import VERSION
from silo_tui.sessions.finder import Found, FoundLogger

START_NS = 1_790_000_000_000_000_000
HZ = 400.0
OWN_NAME = "ann@here silo-tui 1"
FOLDER = "/home/ann/config"


QUIET_SCRIPT = (
    "log_elements:\n  - name: /log/imu/temperature\n    enabled: true\n    divider: 4\n"
    "  - name: /log/old/thing\n    enabled: true\n"
)


def refused(why: RefusedWhy, text: str, problems: Sequence[Problem] = ()) -> RequestRefusedError:
    return RequestRefusedError(Refused(why, text, list(problems)))


def scalar(
    name: str, unit: str = "-", dtype: str = "<f8", labels: dict[int, str] | None = None, **options: Any
) -> ElementInfo:
    return ElementInfo(
        name, unit, "scalar", (), (Entry("", dtype, labels),), ElementOptions(**{"buffer_size": 4000, **options})
    )


def vector(name: str, unit: str, suffixes: str = "xyz", kind: str = "vector", **options: Any) -> ElementInfo:
    entries = tuple(Entry(f"_{suffix}", "<f8") for suffix in suffixes)
    return ElementInfo(name, unit, kind, (len(suffixes),), entries, ElementOptions(**{"buffer_size": 4000, **options}))


def robot_elements() -> list[ElementInfo]:
    both = Action.SAVE_AND_PUBLISH
    found = [
        vector("/log/base/position", "m", action=both),
        vector("/log/base/velocity", "m/s", action=both),
        vector("/log/base/orientation", "-", "xyzw", "quaternion", action=both),
        vector("/log/imu/acceleration", "m/s2", action=both),
        scalar("/log/imu/temperature", "degC", divider=40, buffer_size=100, action=both),
        scalar("/log/state/gait", dtype="<i4", labels={0: "stand", 1: "walk", 2: "trot"}, action=both),
        scalar("/log/state/operator", dtype="|S16", action=both, divider=40, buffer_size=100),
        scalar("/log/state/solver_cost", "-", buffer_type=BufferType.GROWING),
    ]
    for leg in ("LF", "RF", "LH", "RH"):
        found.append(scalar(f"/log/legs/{leg}/contact", dtype="|b1", action=both))
        for joint in ("HAA", "HFE", "KFE"):
            place = f"/log/legs/{leg}/{joint}"
            found += [
                scalar(f"{place}/position", "rad", action=both),
                scalar(f"{place}/velocity", "rad/s", action=both),
                scalar(f"{place}/torque", "Nm", action=both),
                scalar(f"{place}/current", "A", buffer_type=BufferType.FIXED),
                scalar(f"{place}/temperature", "degC", divider=40, buffer_size=100, action=both),
            ]
    return found


def signal(name: str, seconds: np.ndarray) -> np.ndarray:
    """A deterministic signal for every entry name, with one spike of one sample every 4 s in torques."""
    seed = sum(ord(char) for char in name)
    speed = 0.4 + seed % 7 / 4
    values = (1 + seed % 5) * np.sin(2 * math.pi * speed * seconds + seed) + 0.2 * np.sin(61 * seconds)
    if name.endswith("torque"):
        values = np.where(np.round(seconds * HZ) % 1600 == 0, 40.0, values)
    if name.endswith("gait"):
        values = np.floor(seconds / 3) % 3
    if name.endswith("contact"):
        values = (np.sin(2 * math.pi * speed * seconds) > 0).astype(float)
    return values


def _held(options: ElementOptions, ticks: int) -> int:
    """Samples that a buffer holds: ticks 0, divider, 2 * divider ... are collected."""
    return min(options.buffer_size, -(-ticks // options.divider))


class FakeView:
    def __init__(self, client: "FakeClient", values: Sequence[str], plots: Sequence[str], column_ns: int) -> None:
        self.client, self.values, self.plots, self.column_ns = client, tuple(values), tuple(plots), column_ns
        self.seen_ns = -1
        self.seen_revision = -1
        self.from_ns = client.now_ns
        self.closed = False

    def frame(self) -> Frame | None:
        client = self.client
        unchanged = client.now_ns == self.seen_ns and client.revision == self.seen_revision
        if unchanged or not client.connected or self.closed:
            return None
        self.seen_revision = client.revision
        begin = max(self.from_ns, self.seen_ns)
        since_ns = begin if self.seen_ns < 0 else 0
        self.seen_ns = client.now_ns
        known = {info.name: info for info in client.infos}
        infos = [known[name] for name in self.values if name in known]
        unpublished = {info.name for info in infos if not info.options.enabled}
        newest, texts = [], {}
        for info in infos:
            for entry in info.entries:
                value = float(signal(info.name + entry.suffix, np.array([client.seconds]))[0])
                if entry.dtype.startswith("|S"):
                    texts[len(newest)] = "hans"
                newest.append(np.nan if info.name in unpublished or client.ticks == 0 else value)
        column = client.history(self.plots, begin, client.now_ns, self.column_ns)
        held = [_held(client.recorded(name), client.ticks) if name in known else 0 for name in self.values]
        return Frame(
            elements=self.values, entries=tuple(info.name + entry.suffix for info in infos for entry in info.entries),
            plots=self.plots, unpublished=frozenset(unpublished),
            missing=frozenset(name for name in self.values if name not in known), time_ns=client.now_ns,
            tick=client.ticks, state=client.state, measured_hz=HZ, lost_total=client.lost,
            held=np.array(held, np.int64), lost=np.zeros(len(held), np.int64), newest=np.array(newest, float),
            texts=texts, column_ns=self.column_ns, first=column.first, low=column.low, high=column.high,
            marks=None, bases={}, since_ns=since_ns, sizes=client.other_sizes(self.values), missed=0,
            not_live={place: NotLive.FULL for place, name in enumerate(self.values) if client.is_full(name)},
        )  # fmt: skip

    def close(self) -> None:
        self.closed = True


NOTHING = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))


class FakePin:
    """What was held when it was pinned."""

    refused = ""

    def __init__(self, client: "FakeClient", held: dict[str, Samples]) -> None:
        self.client, self.held, self.id = client, held, f"pin-{len(client.pins)}"
        self.names = tuple(held)
        stamps = np.concatenate([some.time_ns for some in held.values()] or [NOTHING[0]])
        begin, end = (int(stamps.min()), int(stamps.max())) if len(stamps) else (0, 0)
        size = sum(8 * (2 + some.values[:1].size) * len(some) for some in held.values())
        missing = {name: some.why for name, some in held.items() if some.why}
        self.opened = PinOpened(self.id, f"run-{client.started_ns}" if len(stamps) else "", begin, end, size, missing,
            oldest_ns=client.oldest_ns(self.names))  # fmt: skip

    def close(self) -> None:
        if self in self.client.pins:
            self.client.pins.remove(self)


class FakeClient:
    """One logger. `calls` holds what was asked to change it; `advance` moves its clock."""

    kinds = EventKind
    identity = "@local me"

    def __init__(self, elements: list[ElementInfo] | None = None, name: str = "robot") -> None:
        self.elements = robot_elements() if elements is None else elements
        self.name, self.pid, self.revision = name, 4711, 1
        self._state, self.now_ns, self.started_ns, self.lost = State.STOPPED, START_NS, 0, 0
        self.saved, self.may_edit, self.connected, self.reason = True, True, True, ""
        self.durable_ticks = -1  # as without storage="disk"
        self.calls: list[tuple[Any, ...]] = []
        self.files: dict[str, str] = {"robot.yaml": format_script(self.elements), "quiet.yaml": QUIET_SCRIPT}
        self.save_error = ""
        self.save_takes_long = False
        self.logs: Path | None = None  # a real folder with recordings, where a test needs some
        self._folder = RecordingFolder()
        self.views: list[FakeView] = []
        self.pins: list[FakePin] = []
        self.trigger_statuses: list[TriggerStatus] = []
        self.limit_statuses: list[LimitStatus] = []
        self.views_kept: dict[str, str] = {}
        self.recorder_infos: list[RecorderInfo] = []
        self.controlled: Control | None = None
        self.clients: list[Present] = []
        self.derived: tuple[Derived, ...] = ()
        self.refuse_derived = ""  # why nothing is derived
        self.limit_options: tuple[SignalLimits, ...] = ()
        self.since_ns = 0  # of the statistics
        self.facts: dict[str, dict[str, float]] = {}  # measured values that a test sets, by quantity and name
        self._recorded: dict[str, ElementOptions] = {}  # what the held recording was made with
        self._event: Callable[[Event], None] = lambda event: None
        self._link: Callable[[bool], None] = lambda connected: None
        self._events = self._jobs = self._stopped_ns = 0
        self.happened: list[LoggedEvent] = []

    # -- what tests do

    @property
    def state(self) -> State:
        return self._state

    @state.setter
    def state(self, state: State) -> None:
        """A logger that no longer runs counts no more ticks."""
        if self._state is State.RUNNING and state is not State.RUNNING:
            self._stopped_ns = self.now_ns
        self._state = state

    @property
    def seconds(self) -> float:
        return (self.now_ns - self.started_ns) / 1e9 if self.started_ns else 0.0

    @property
    def infos(self) -> list[ElementInfo]:
        """The elements, then the derived signals."""
        return [*self.elements, *derived_infos(self.elements, "/log", self.derived)]

    @property
    def ticks(self) -> int:
        end_ns = self.now_ns if self.state is State.RUNNING else self._stopped_ns
        return round((end_ns - self.started_ns) / 1e9 * HZ) if self.started_ns else 0

    def recorded(self, name: str) -> ElementOptions:
        """Options of an element in the held recording."""
        known = next(info.options for info in self.infos if info.name == name)
        return self._recorded.get(name, known)

    def is_full(self, name: str) -> bool:
        """Whether an element's FIXED buffer, in which alone it is, ended."""
        info = next((info for info in self.elements if info.name == name), None)
        if info is None or info.options.action.publishes or info.options.buffer_type is not BufferType.FIXED:
            return False
        return self.ticks > info.options.buffer_size * info.options.divider

    def other_sizes(self, names: Sequence[str]) -> dict[int, int]:
        """Buffer sizes of the held recording where the table says another by now."""
        known = {info.name: info.options.buffer_size for info in self.elements}
        sizes = {place: self.recorded(name).buffer_size for place, name in enumerate(names) if name in known}
        return {place: size for place, size in sizes.items() if size != known[names[place]]}

    def run(self, seconds: float = 12.0) -> None:
        """As if it had been started that long ago."""
        self.state, self.started_ns = State.RUNNING, START_NS
        self._recorded = {info.name: info.options for info in self.elements}
        self.now_ns = START_NS + round(seconds * 1e9)
        self.saved = False

    def advance(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)

    def cut(self) -> None:
        self.connected = False
        self._link(False)

    def mend(self) -> None:
        self.connected = True
        self._link(True)

    def _kept(self) -> list[int]:
        """Samples that the buffers of the held recording hold, per saved element."""
        made = [self._recorded.get(info.name, info.options) for info in self.elements]  # not one by one: of 10,000
        return [_held(options, self.ticks) for options in made if options.enabled and options.action.saves]

    def somebody_edits(self, name: str, **options: Any) -> None:
        self._replace(name, msgspec.structs.replace(self.info(name).options, **options))
        self.revision += 1
        if self.connected:
            self.publish(EventKind.EDITED, f"{name} edited", by="bob@lab")

    def publish(self, kind: EventKind, text: str, by: str = "", **more: Any) -> None:
        self._events += 1
        self._event(Event(self._events, self.now_ns, kind, text, by, self.status(), **more))

    def info(self, name: str) -> ElementInfo:
        return next(info for info in self.elements if info.name == name)

    def _replace(self, name: str, options: ElementOptions) -> None:
        self.elements = [
            msgspec.structs.replace(info, options=options) if info.name == name else info for info in self.elements
        ]

    def _ask(self) -> None:
        if not self.connected:
            raise ConnectionLostError(f"no answer from {self.name}")

    # -- what the app asks

    def events(self, since: int = 0, limit: int = 1000) -> list[LoggedEvent]:
        self._ask()
        return [event for event in self.happened if event.number > since][-limit:]

    def mark(self, text: str, tick: int | None = None, *, at_ns: int | None = None) -> LoggedEvent:
        self._ask()
        self.calls.append(("mark", text, at_ns))
        return self.happen("marker", text, at_ns or self.now_ns, who="me@here")

    def happen(self, kind: str, text: str, at_ns: int, who: str = "robot") -> LoggedEvent:
        """Something happens, and clients hear of it."""
        tick = max(0, (at_ns - self.started_ns) * 400 // 10**9)
        event = LoggedEvent(kind, text, at_ns, tick, at_ns, who, "run1", len(self.happened) + 1)
        self.happened.append(event)
        if self.connected:
            known = {"tick": event.tick, "stamp_ns": at_ns, "logged": event.number, "run": event.run}
            self.publish(EventKind(kind), text, who, **known)
        return event

    def hello(self) -> HelloReply:
        self._ask()
        why_not = "" if self.may_edit else viewer_words("bob", f"anymal/{self.name}")
        return HelloReply(protocol=PROTOCOL, version=VERSION, user="ann", may_edit=self.may_edit,
            status=self.status(), why_not=why_not)  # fmt: skip

    def take_control(self, *, force: bool = False) -> str:
        self._ask()
        self.calls.append(("take_control", force))
        self._controlled_by("me@here silo-tui 1", "@local me")
        return f"you have control of {self.name}"

    def release_control(self) -> str:
        self._ask()
        self.controlled = None
        return f"control of {self.name} is released"

    def hand_over(self, to: str) -> str:
        self._ask()
        self._controlled_by(f"{to} (proven) from desk2, silo-tui 2", to)
        return f"{to} has control of {self.name}"

    def _controlled_by(self, who: str, identity: str) -> None:
        self.controlled = Control(who, identity, time.time_ns(), time.time_ns() + 10**10)

    def somebody_takes_control(self, name: str) -> None:
        """Another operator takes control."""
        self._controlled_by(f"{name} (proven) from desk2, silo-tui 2", name)
        self.publish(EventKind.CONTROL, "control taken", by=self.controlled.who)

    def status(self) -> Status:
        self._ask()
        return Status(
            logger=self.name, host="anymal", user="ann", pid=self.pid, helper_pid=self.pid + 1, state=self.state,
            revision=self.revision, frequency_hz=HZ, measured_hz=HZ if self.state is State.RUNNING else 0.0,
            ticks=self.ticks, started_ns=self.started_ns, last_tick_ns=self.now_ns if self.started_ns else 0,
            lost=self.lost, elements=len(self.elements), enabled=sum(info.options.enabled for info in self.elements),
            entries=sum(len(info.entries) for info in self.elements), max_time_s=10.0, prefix="/log",
            folder="/home/ann/logs", script=f"{FOLDER}/robot.yaml", reason=self.reason, saved=self.saved,
            durable_ticks=self.durable_ticks, held_samples=sum(self._kept()), held_s=max(self._kept(), default=0) / HZ,
            recorders=sum(not one.state.over for one in self.recorder_infos), control=self.controlled,
            clients=list(self.clients),
        )  # fmt: skip

    def table(self) -> Table:
        self._ask()
        return Table(self.revision, list(self.elements), self.infos[len(self.elements) :])

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
            return ScriptText(path=f"{FOLDER}/robot.yaml", text=format_script(self.elements, extras=self.extras))
        full, text = self._script(path)
        return ScriptText(path=full, text=text)

    def diff_script(self, path: str = "") -> ScriptDiff:
        script, plan = self._plan(path)
        changes = diff_options(self.elements, plan.options)
        unknown = [str(unknown.name) for unknown in plan.unknown]
        extras = diff_extras(self.extras, script.extras_beside(self.extras))
        return ScriptDiff(f"{FOLDER}/{path}", changes, unknown, script.warnings, extras)

    @property
    def extras(self) -> Extras:
        """What belongs to it beside its elements."""
        return Extras(self.derived, self.limit_options, tuple(one.options for one in self.trigger_statuses))

    def _take_extras(self, extras: Extras) -> None:
        self.derived, self.limit_options = extras.derived, extras.limits
        known = {one.options: one for one in self.trigger_statuses}
        self.trigger_statuses = [known.get(one, TriggerStatus(one, TriggerWord.ARMED)) for one in extras.triggers]

    def _check(self, revision: int) -> None:
        self._ask()
        if self.state is State.RUNNING:
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

    def apply(self, edits: Sequence[Edit], revision: int) -> EditsApplied:
        self._ask()
        self.calls.append(("apply", list(edits), revision))
        self._check(revision)
        wanted = {info.name: info.options for info in self.elements}
        if problems := edit_problems(edits, wanted):
            raise refused(RefusedWhy.INVALID, refusal(problems), problems)
        wanted.update((edit.name, edit.options) for edit in edits)
        changed = self._take([wanted[info.name] for info in self.elements])
        self.publish(EventKind.EDITED, f"{changed} elements edited", by=OWN_NAME)
        return EditsApplied(revision=self.revision, changed=changed)

    def start(self, unsaved: str = "refuse") -> Status:
        self._ask()
        self.calls.append(("start",))
        if self.state is State.RUNNING:
            raise refused(RefusedWhy.RUNNING, "it runs already: stop it first; nothing was changed")
        self._settle(unsaved)
        self._begin()
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

    def restart(self, unsaved: str = "refuse") -> Status:
        self._ask()
        self._settle(unsaved)
        self.stop()
        return self.start(Unsaved.DISCARD)

    def load_script(self, path: str = "", revision: int = -1) -> EditsApplied:
        self._ask()
        self.calls.append(("load_script", path))
        self._check(revision)
        script, plan = self._plan(path)
        changed = self._take(plan.options)
        if script.extras is not None:
            self._take_extras(script.extras)
        self.publish(EventKind.SCRIPT_LOADED, f"script {path} loaded", by=OWN_NAME)
        return EditsApplied(self.revision, changed, [str(unknown.name) for unknown in plan.unknown], script.warnings)

    def save_script(self, path: str = "", overwrite: bool = False) -> str:
        self._ask()
        self.calls.append(("save_script", path, overwrite))
        if path in self.files and not overwrite:
            raise refused(RefusedWhy.EXISTS, f"{FOLDER}/{path} exists")
        self.files[path] = format_script(self.elements, extras=self.extras)
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
        try:
            return job(self._folder, str(self.logs or "/home/ann/logs"))
        except RecordingRefusedError as error:
            raise RequestRefusedError(error.refused) from error

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

    def kept_views(self) -> KeptViews:
        self._ask()
        return KeptViews(f"{FOLDER}/views", sorted(self.views_kept))

    def kept_view(self, name: str) -> KeptView:
        self._ask()
        if name not in self.views_kept:
            raise refused(RefusedWhy.NOT_FOUND, f"there is no view '{name}' on the robot")
        return KeptView(f"{FOLDER}/views/{name}.yaml", self.views_kept[name])

    def keep_view(self, name: str, text: str, overwrite: bool = False) -> str:
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
        return RecorderStarted(made.name, made.folder)

    def stop_recorder(self, name: str = "") -> str:
        self._ask()
        self.calls.append(("stop_recorder", name))
        self.recorder_infos = [one for one in self.recorder_infos if one.name != name]
        self.publish(EventKind.RECORDING, f"recording '{name}' ended", by=OWN_NAME)
        return f"recording '{name}' ended: 1 files"

    def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> FakePin:
        self._ask()
        held = FakePin(self, self.samples(names, start_ns, end_ns + 1))
        self.pins.append(held)
        return held

    def samples(
        self, names: Sequence[str], start: int = -(2**62), end: int = 2**62, by: str = "time",
        pin: FakePin | None = None, reply_bytes: int = 2**20, told: Callable[[float], None] | None = None,
    ) -> dict[str, Samples]:  # fmt: skip
        self._ask()
        found = {}
        for name in names:
            whole = self._held_samples(name) if pin is None else self._of_pin(pin, name)
            key = {"time": whole.time_ns, "tick": whole.ticks, "row": whole.ticks // max(1, whole.divider)}[by]
            some = (key >= start) & (key < end)
            found[name] = Samples(
                whole.ticks[some], whole.time_ns[some], whole.values[some], whole.divider, why=whole.why
            )
        if told is not None:
            told(1.0)
        return found

    def find(
        self, names: Sequence[str], what: Sought, level: float = 0.0, direction: int = 0,
        bounds: Sequence[tuple[float | None, float | None]] = (), start_ns: int = -(2**62), end_ns: int = 2**62,
        around_ns: int = 0, most: int = 100, pins: Sequence[FakePin] = (), run: str = "",
    ) -> dict[str, FoundMoments]:  # fmt: skip
        self._ask()
        found = {}
        for place, name in enumerate(names):
            held = self._held_samples(name)
            stamps, values = self._all_of(name, pins, run)
            wanted = (stamps >= start_ns) & (stamps <= end_ns)
            limits = bounds[place] if bounds else (None, None)
            looking = Looking(Sought(what), level, direction, limits, round(1e9 * max(1, held.divider) / HZ))
            finder = Finder(looking, around_ns, most)
            finder.measure(values[wanted])
            finder.feed(stamps[wanted], values[wanted])
            found[name] = finder.found
        self.calls.append(("find", tuple(names), Sought(what).value))
        return found

    def measure(
        self, names: Sequence[str], a_ns: int, b_ns: int, pins: Sequence[FakePin] = (), run: str = ""
    ) -> dict[str, Between]:
        self._ask()
        self.calls.append(("measure", tuple(names)))
        return {name: between(*self._all_of(name, pins, run), a_ns, b_ns) for name in names}

    def _all_of(self, name: str, pins: Sequence[FakePin], run: str) -> tuple[np.ndarray, np.ndarray]:
        """Every sample of an entry in pins and buffers, once."""
        parts = [self._of_pin(pin, name) for pin in pins]
        if not run or run == f"run-{self.started_ns}":
            parts.append(self._held_samples(name))
        stamps, at = np.unique(np.concatenate([some.time_ns for some in parts]), return_index=True)
        return stamps, np.concatenate([some.values for some in parts])[at]

    def _of_pin(self, pin: FakePin, name: str) -> Samples:
        if pin not in self.pins:
            raise refused(RefusedWhy.NOT_FOUND, f"the pin '{pin.id}' is no more: pin again")
        return pin.held.get(name, Samples(*NOTHING, why="it is not in this pin"))

    def _held_samples(self, name: str) -> Samples:
        """All samples of an element or entry that its buffer holds."""
        places = {info.name: (info, info.entries) for info in self.infos}
        for info in self.infos:
            for entry in info.entries:
                places.setdefault(info.name + entry.suffix, (info, (entry,)))
        if name not in places:
            raise refused(RefusedWhy.NOT_FOUND, f"no element or entry is called '{name}'")
        info, entries = places[name]
        options = self.recorded(info.name)
        if not options.enabled or not self.started_ns:
            return Samples(*NOTHING, why="nothing was logged yet" if options.enabled else "it is off")
        ticks = np.arange(0, self.ticks, options.divider)
        if options.buffer_type is BufferType.LOOPING:
            ticks = ticks[-options.buffer_size :]
        elif options.buffer_type is BufferType.FIXED and not options.action.publishes:
            ticks = ticks[: options.buffer_size]
        columns = [
            np.full(len(ticks), b"hans", entry.dtype)
            if entry.dtype[1:2] == "S"
            else signal(info.name + entry.suffix, ticks / HZ).astype(entry.dtype)
            for entry in entries
        ]
        values = columns[0] if len(entries) == 1 else np.stack(columns, axis=1)
        time_ns = self.started_ns + np.round(ticks / HZ * 1e9).astype(np.int64)
        return Samples(ticks, time_ns, values, options.divider)

    def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, pin: FakePin | None = None
    ) -> HistoryColumns:
        self._ask()
        if pin is not None:
            return self._pinned_columns(pin, names, start_ns, end_ns, column_ns)
        start_ns = max(start_ns, self.started_ns or end_ns)
        first, last = start_ns // column_ns, end_ns // column_ns
        count = max(0, last - first + 1) if self.started_ns else 0
        low, high = np.full((len(names), count), np.nan), np.full((len(names), count), np.nan)
        for position, name in enumerate(names):
            element = next((info for info in self.infos if name.startswith(info.name)), None)
            if element is None or not element.options.enabled:
                continue
            ticks = np.arange(math.ceil((start_ns - self.started_ns) / 1e9 * HZ), self.ticks + 1)
            columns = (self.started_ns + np.round(ticks / HZ * 1e9).astype(np.int64)) // column_ns - first
            good = (columns >= 0) & (columns < count)
            values = signal(name, ticks / HZ)[good]
            np.fmin.at(low[position], columns[good], values)
            np.fmax.at(high[position], columns[good], values)
        return HistoryColumns(tuple(names), int(first), column_ns, low, high, until_ns=self.now_ns)

    def _pinned_columns(
        self, pin: FakePin, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int
    ) -> HistoryColumns:
        first = start_ns // column_ns
        grid = ColumnGrid(len(names), first, -(-end_ns // column_ns) - first)
        for row, name in enumerate(names):
            some = self._of_pin(pin, name)
            grid.add(row, bins_of(some.time_ns, column_ns), some.values)
        bases = dict(enumerate(grid.bases))
        return HistoryColumns(tuple(names), first, column_ns, grid.low, grid.high, grid.marks, bases, pin.opened.end_ns)

    def triggers(self) -> Triggers:
        self._ask()
        return Triggers("run", self.ticks, list(self.trigger_statuses))

    def alarms(self) -> Alarms:
        self._ask()
        return Alarms("run", self.ticks, list(self.limit_statuses))

    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        self._ask()
        if "nobody" in trigger.when:
            raise refused(RefusedWhy.INVALID, "no signal is named 'nobody'")
        begin, end = self.now_ns - 60 * 10**9, self.now_ns
        return TriggerTried(3, [1, 2, 3], [begin, begin + 30 * 10**9, end], 0, 6000, begin, end, 6000, 0, 1_900_000)

    def set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
        self._ask()
        self.calls.append(("set_trigger", trigger))
        made = TriggerStatus(trigger, TriggerWord.ARMED, owner="this client" if lease_s else "")
        self.trigger_statuses = [one for one in self.trigger_statuses if one.options.name != trigger.name] + [made]
        return f"trigger '{trigger.name}' is set"

    def remove_trigger(self, name: str) -> str:
        self._ask()
        self.calls.append(("remove_trigger", name))
        self.trigger_statuses = [one for one in self.trigger_statuses if one.options.name != name]
        return f"trigger '{name}' is removed"

    def arm_trigger(self, name: str, *, armed: bool = True) -> str:
        self._ask()
        self.calls.append(("arm_trigger", name, armed))
        return f"trigger '{name}' is {'armed' if armed else 'off'}"

    def force_trigger(self, name: str) -> str:
        self._ask()
        self.calls.append(("force_trigger", name))
        return f"trigger '{name}' was fired at tick {self.ticks}"

    def acknowledge(self, names: Sequence[str] = (), who: str = "") -> str:
        self._ask()
        self.calls.append(("acknowledge", *names))
        return "1 alarm seen by ann"

    def set_limits(self, limits: SignalLimits) -> str:
        self._ask()
        self.calls.append(("set_limits", limits))
        return f"limits of '{limits.name}' are set"

    def derive(self, name: str, expression: str, unit: str = "") -> str:
        self._ask()
        self.calls.append(("derive", name, expression, unit))
        if self.refuse_derived:
            raise refused(RefusedWhy.INVALID, self.refuse_derived)
        whole = Derived(join_name("/log", "", name), expression, unit)
        try:
            self.derived = with_derived(self.extras, whole, self.elements, "/log").derived
        except ElementError as error:
            raise refused(RefusedWhy.INVALID, str(error)) from error
        self.revision += 1
        return f"'{whole.name}' is derived: {expression}"

    def remove_derived(self, name: str) -> str:
        self._ask()
        self.calls.append(("remove_derived", name))
        try:
            self.derived = without_derived(self.extras, name, self.elements, "/log").derived
        except ElementError as error:
            raise refused(RefusedWhy.INVALID, str(error)) from error
        self.revision += 1
        return f"'{name}' is derived no more"

    def survey(
        self, quantities: Sequence[str], names: Sequence[str] = (), *, reset: bool = False, derived: bool = False
    ) -> Survey:
        self._ask()
        unknown = [quantity for quantity in quantities if quantity not in QUANTITIES]
        if unknown:
            raise refused(RefusedWhy.INVALID, f"no survey: {unknown[0]!r} is no quantity")
        if reset or not self.since_ns:
            self.since_ns = self.now_ns
        infos = self.infos if derived else self.elements
        known = {info.name: info for info in infos}
        entries = {info.name + entry.suffix: info for info in infos for entry in info.entries}
        rows = [
            [self._measured(quantity, name, known.get(name) or entries.get(name)) for name in names or known]
            for quantity in quantities
        ]
        values = np.array(rows, float).tobytes()
        return Survey(self.revision, self.now_ns, self.since_ns, values)

    def _measured(self, quantity: str, name: str, info: ElementInfo | None) -> float:
        if info is None or not info.options.enabled or not self.ticks:
            return math.nan
        if name in self.facts.get(quantity, {}):
            return self.facts[quantity][name]
        held = _held(info.options, self.ticks)
        is_entry = name != info.name or len(info.entries) == 1
        suffixes = [name] if is_entry else [info.name + entry.suffix for entry in info.entries]
        moments = np.array([self.seconds]) if quantity == "value" else np.arange(0, max(self.seconds, 1 / HZ), 1 / HZ)
        of = {
            "signs": 0.0, "rate": HZ / info.options.divider, "share": 1.0, "jitter": 0.0002, "changed": 0.0,
            "fill": held / info.options.buffer_size, "held": held, "count": float(self.ticks),
        }  # fmt: skip
        if quantity in of:
            return of[quantity]
        if any(entry.dtype[1:2] not in "biuf" for entry in info.entries):
            return math.nan
        samples = np.array([signal(each, moments) for each in suffixes])
        norms = samples[0] if is_entry else np.sqrt(np.square(samples).sum(axis=0))
        return float({"value": np.mean, "min": np.min, "max": np.max, "mean": np.mean, "std": np.std}[quantity](norms))

    def view(self, values: Sequence[str], plots: Sequence[str], rate_hz: float, column_ns: int) -> FakeView:
        self._ask()
        view = FakeView(self, values, plots, column_ns)
        self.views.append(view)
        return view

    def on_event(self, callback: Callable[[Event], None]) -> None:
        self._event = callback

    def on_link(self, callback: Callable[[bool], None]) -> None:
        self._link = callback

    def try_now(self) -> None:
        self.calls.append(("try_now",))

    def close(self) -> None:
        self.connected = False


class FakeFinder:
    own_name = OWN_NAME

    def __init__(self, *clients: FakeClient) -> None:
        self.clients = list(clients)
        self.advice: tuple[str, ...] = ()
        self.members: dict[str, Member] = {}  # how they stand, by their names
        self.attentive = True

    def find(self) -> Found:
        return Found(
            tuple(
                FoundLogger(
                    client.name, client.pid, "ann", f"{client.name}.{client.pid}", member=self.members.get(client.name)
                )
                for client in self.clients
            ),
            self.advice,
        )

    def rest(self) -> None:
        self.attentive = False

    def look_again(self) -> None:
        self.members = {name: one for name, one in self.members.items() if one.here}

    def ask_many(self, loggers: Sequence[FoundLogger], job: Any) -> Iterator[Outcome]:
        for place, logger in enumerate(loggers):
            try:
                text, files = job(self.connect(logger))
                yield Outcome(place, True, text, files)
            except SiloError as error:  # noqa: PERF203
                yield Outcome(place, False, str(error))

    def connect(self, logger: FoundLogger) -> FakeClient:
        return next(client for client in self.clients if client.pid == logger.pid and client.name == logger.name)
