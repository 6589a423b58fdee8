"""A logger that exists only in a test: the same messages and arrays as the real client, from a clock that tests move.

What it has in common with a real helper process is held by `tests/contract`, which asks both the same.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from silo.client.bulk import Outcome
from silo.conditions.standing import LimitStatus, TriggerStatus
from silo.core.conditions import Derived, SignalLimits
from silo.core.elements import (
    BufferType,
    Control,
    ElementInfo,
    ElementOptions,
    LoggedEvent,
    Present,
    State,
    Status,
    Table,
)
from silo.errors import ConnectionLostError, SiloError
from silo.expressions.derived_signals import derived_infos
from silo.fleet.member import Member
from silo.net.access.senders import viewer_words
from silo.net.found import LoggerAddress
from silo.recorder.requests import RecorderInfo
from silo.recordings.folder import RecordingFolder
from silo.rpc.published import Event, EventKind
from silo.rpc.versions import PROTOCOL
from silo.settings.script import format_script
from silo.state.requests import HelloReply
from silo.version import VERSION
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.sessions.finder import Found
from tests.stand_ins.fake_changes import FakeChanges
from tests.stand_ins.fake_conditions import FakeConditions
from tests.stand_ins.fake_parameters import FakeParameters
from tests.stand_ins.fake_rows import FakePin, FakeRows, FakeView
from tests.stand_ins.fake_signals import FOLDER, HZ, OWN_NAME, QUIET_SCRIPT, START_NS, held_ticks, robot_elements


class FakeClient(FakeRows, FakeChanges, FakeConditions, FakeParameters):
    """One logger. `calls` holds what was asked to change it; `advance` moves its clock."""

    kinds = EventKind
    _identity = "@local me"

    def __init__(self, elements: list[ElementInfo] | None = None, name: str = "robot") -> None:
        self.elements = robot_elements() if elements is None else elements
        self.measured_hz = HZ
        self.max_time_s = 0.0
        self.name, self.pid, self.program, self.revision = name, 4711, "a1", 1
        self._state, self.now_ns, self.started_ns, self.lost = State.STOPPED, START_NS, 0, 0
        self.saved, self.may_edit, self.connected, self.reason = True, True, True, ""
        self.durable_ticks = -1  # as without storage="disk"
        self.part = 0  # as before the first cut
        self.calls: list[tuple[Any, ...]] = []
        self.files: dict[str, str] = {"robot.yaml": format_script(self.elements), "quiet.yaml": QUIET_SCRIPT}
        self.save_error = ""
        self.save_takes_long = False
        self.record_warns = ""
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
        self.given: dict[str, ElementOptions] = {}
        self._infos: tuple[Any, list[ElementInfo]] | None = None  # the derived signals, and of what they were made
        self.refuse_derived = ""  # why nothing is derived
        self.limit_options: tuple[SignalLimits, ...] = ()
        self.since_ns = 0  # of the statistics
        self.facts: dict[str, dict[str, float]] = {}  # measured values that a test sets, by quantity and name
        self._recorded: dict[str, ElementOptions] = {}  # what the held recording was made with
        self._event: Callable[[Event], None] = lambda event: None
        self._link: Callable[[bool], None] = lambda connected: None
        self._events = self._jobs = self._stopped_ns = 0
        self.happened: list[LoggedEvent] = []
        FakeParameters.__init__(self)

    # -- what tests do

    @property
    def found(self) -> LoggerAddress:
        return LoggerAddress(self.name, self.pid, f"{self.name}.{self.pid}", "ann")

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
        made_of = [*self.elements], self.derived
        if self._infos is None or self._infos[0] != made_of:
            self._infos = made_of, derived_infos(self.elements, "/log", self.derived)
        return [*self.elements, *self._infos[1]]

    @property
    def ticks(self) -> int:
        end_ns = self.now_ns if self.state is State.RUNNING else self._stopped_ns
        return round((end_ns - self.started_ns) / 1e9 * HZ) if self.started_ns else 0

    def recorded(self, name: str) -> ElementOptions:
        """Options of an element in the held recording."""
        if name in self._recorded:
            return self._recorded[name]
        return next(info.options for info in self.infos if info.name == name)

    def is_full(self, name: str) -> bool:
        """Whether an element's FIXED buffer, in which alone it is, ended."""
        info = next((info for info in self.elements if info.name == name), None)
        if info is None or info.options.action.publishes or info.options.buffer is not BufferType.FIXED:
            return False
        return self.ticks > info.options.size * info.options.divider

    def other_sizes(self, names: Sequence[str]) -> dict[int, int]:
        """Buffer sizes of the held recording where the table says another by now."""
        known = {info.name: info.options.size for info in self.elements}
        sizes = {place: self.recorded(name).buffer_size for place, name in enumerate(names) if name in known}
        return {place: size for place, size in sizes.items() if size != known[names[place]]}

    def run(self, seconds: float = 12.0) -> "FakeClient":
        """As if it had been started that long ago; returned for who opens it."""
        self.state, self.started_ns = State.RUNNING, START_NS
        self._recorded = {info.name: info.options for info in self.elements}
        self.now_ns = START_NS + round(seconds * 1e9)
        self.saved = False
        return self

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
        return [held_ticks(options, self.ticks) for options in made if options.enabled and options.action.saves]

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

    def _hello(self) -> HelloReply:
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

    def give_control(self, to: str) -> str:
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
            revision=self.revision, frequency_hz=HZ,
            measured_hz=self.measured_hz if self.state is State.RUNNING else 0.0,
            ticks=self.ticks, started_ns=self.started_ns, last_tick_ns=self.now_ns if self.started_ns else 0,
            lost=self.lost, elements=len(self.elements), enabled=sum(info.options.enabled for info in self.elements),
            entries=sum(len(info.entries) for info in self.elements), max_time_s=self.max_time_s, prefix="/log",
            folder="/home/ann/logs", script=f"{FOLDER}/robot.yaml", reason=self.reason, saved=self.saved,
            durable_ticks=self.durable_ticks, held_samples=sum(self._kept()), held_s=max(self._kept(), default=0) / HZ,
            recorders=sum(not one.state.over for one in self.recorder_infos), control=self.controlled,
            clients=list(self.clients), program=self.program, part=self.part,
        )  # fmt: skip

    def table(self, told: Callable[[float], None] | None = None) -> Table:
        self._ask()
        return Table(self.revision, list(self.elements), self.infos[len(self.elements) :], self.given)

    def view(self, values: Sequence[str], plots: Sequence[str], rate_hz: float, column_ns: int) -> FakeView:
        self._ask()
        view = FakeView(self, values, plots, column_ns)
        self.views.append(view)
        return view

    def on_event(self, callback: Callable[[Event], None]) -> None:
        self._event = callback

    def on_link(self, callback: Callable[[bool], None]) -> None:
        self._link = callback

    def _try_now(self) -> None:
        self.calls.append(("try_now",))

    def close(self) -> None:
        self.connected = False


class FakeFinder:
    own_name = OWN_NAME

    def __init__(self, *clients: FakeClient) -> None:
        self.clients = list(clients)
        self.advice: tuple[str, ...] = ()
        self.members: dict[str, Member] = {}  # how they stand, by their names or keys
        self.attentive = True

    def find(self) -> Found:
        return Found(
            tuple(
                FoundLogger(
                    client.name,
                    client.pid,
                    "ann",
                    key,
                    self.members.get(key) or self.members.get(client.name) or Member(client.found),
                    addresses=client.found.addresses,
                    alike=sum(other.name == client.name for other in self.clients) > 1,
                )
                for client, key in ((client, f"{client.name}.{client.pid}") for client in self.clients)
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
