"""A logger that exists only here: the same messages and arrays as the real client, from a clock that tests move."""

import asyncio
import inspect
import math
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import pytest
from textual import events

from silo.errors import ConnectionLostError, RefusedError
from silo.ipc.messages import (
    EditsApplied,
    Event,
    EventKind,
    HelloReply,
    RefusedWhy,
    ScriptDiff,
    Scripts,
    ScriptText,
)
from silo.model import (
    Action,
    BufferType,
    ElementInfo,
    ElementOptions,
    Entry,
    FieldChange,
    FileType,
    Problem,
    SavedFile,
    State,
    Status,
    Table,
)
from silo_tui.app import SiloApp
from silo_tui.model.fields import Field, phrase_for
from silo_tui.model.source import Column
from silo_tui.sessions.finder import Found, FoundLogger

START_NS = 1_790_000_000_000_000_000
HZ = 400.0


def refused(why: RefusedWhy, text: str, problems: list[Problem] | None = None) -> RefusedError:
    error = RefusedError(text)
    error.why, error.problems = why, problems or []  # type: ignore[attr-defined]
    return error


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


@dataclass(frozen=True)
class FakeFrame:
    elements: tuple[str, ...]
    plots: tuple[str, ...]
    unpublished: frozenset[str]
    time_ns: int
    tick: int
    running: bool
    measured_hz: float
    lost_total: int
    held: np.ndarray
    lost: np.ndarray
    newest: np.ndarray
    texts: dict[int, str]
    column_ns: int
    first: int
    low: np.ndarray
    high: np.ndarray


class FakeView:
    def __init__(self, client: "FakeClient", values: Sequence[str], plots: Sequence[str], column_ns: int) -> None:
        self.client, self.values, self.plots, self.column_ns = client, tuple(values), tuple(plots), column_ns
        self.seen_ns = -1
        self.from_ns = client.now_ns
        self.closed = False

    def frame(self) -> FakeFrame | None:
        client = self.client
        if client.now_ns == self.seen_ns or not client.connected or self.closed:
            return None
        begin = max(self.from_ns, self.seen_ns)
        self.seen_ns = client.now_ns
        infos = [client.info(name) for name in self.values]
        unpublished = {info.name for info in infos if not info.options.action.publishes or not info.options.enabled}
        newest, texts = [], {}
        for info in infos:
            for entry in info.entries:
                value = float(signal(info.name + entry.suffix, np.array([client.seconds]))[0])
                if entry.dtype.startswith("|S"):
                    texts[len(newest)] = "hans"
                newest.append(np.nan if info.name in unpublished or client.ticks == 0 else value)
        column = client.history(self.plots, begin, client.now_ns, self.column_ns)
        held = [min(info.options.buffer_size, client.ticks // info.options.divider) for info in infos]
        return FakeFrame(
            elements=self.values, plots=self.plots, unpublished=frozenset(unpublished), time_ns=client.now_ns,
            tick=client.ticks, running=client.state is State.RUNNING, measured_hz=HZ, lost_total=client.lost,
            held=np.array(held), lost=np.zeros(len(infos), int), newest=np.array(newest, float),
            texts=texts, column_ns=self.column_ns,
            first=column.first, low=column.low, high=column.high,
        )  # fmt: skip

    def close(self) -> None:
        self.closed = True


class FakeClient:
    """One logger. `calls` holds what was asked to change it; `advance` moves its clock."""

    kinds = EventKind

    def __init__(self, elements: list[ElementInfo] | None = None, name: str = "robot") -> None:
        self.elements = robot_elements() if elements is None else elements
        self.name, self.pid, self.revision = name, 4711, 1
        self.state, self.now_ns, self.started_ns, self.lost = State.STOPPED, START_NS, 0, 0
        self.saved, self.may_edit, self.connected, self.reason = True, True, True, ""
        self.calls: list[tuple[Any, ...]] = []
        self.files: dict[str, str] = {"robot.yaml": "", "quiet.yaml": ""}
        self.save_error = ""
        self.views: list[FakeView] = []
        self._event: Callable[[Event], None] = lambda event: None
        self._link: Callable[[bool], None] = lambda connected: None
        self._events = 0

    # -- what tests do

    @property
    def seconds(self) -> float:
        return (self.now_ns - self.started_ns) / 1e9 if self.started_ns else 0.0

    @property
    def ticks(self) -> int:
        return round(self.seconds * HZ)

    def run(self, seconds: float = 12.0) -> None:
        """As if it had been started that long ago."""
        self.state, self.started_ns = State.RUNNING, START_NS
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

    def hello(self) -> HelloReply:
        self._ask()
        return HelloReply(protocol=1, version="0.1.0", user="ann", may_edit=self.may_edit, status=self.status())

    def status(self) -> Status:
        self._ask()
        return Status(
            logger=self.name, host="anymal", user="ann", pid=self.pid, helper_pid=self.pid + 1, state=self.state,
            revision=self.revision, frequency_hz=HZ, measured_hz=HZ if self.state is State.RUNNING else 0.0,
            ticks=self.ticks, started_ns=self.started_ns, last_tick_ns=self.now_ns if self.started_ns else 0,
            lost=self.lost, elements=len(self.elements), enabled=sum(info.options.enabled for info in self.elements),
            entries=sum(len(info.entries) for info in self.elements), max_time_s=10.0, prefix="/log",
            folder="/home/ann/logs", script="/home/ann/config/robot.yaml", reason=self.reason, saved=self.saved,
        )  # fmt: skip

    def table(self) -> Table:
        self._ask()
        return Table(self.revision, list(self.elements))

    def scripts(self) -> Scripts:
        self._ask()
        return Scripts(folder="/home/ann/config", names=sorted(self.files), current="/home/ann/config/robot.yaml")

    def read_script(self, path: str = "") -> ScriptText:
        return ScriptText(path=path, text=self.files.get(path, ""))

    def diff_script(self, path: str = "") -> ScriptDiff:
        if path not in self.files:
            raise refused(RefusedWhy.NOT_FOUND, f"there is no script {path!r} in /home/ann/config")
        changes = [FieldChange("/log/imu/temperature", "divider", "40", "4")] if path == "quiet.yaml" else []
        return ScriptDiff(path=f"/home/ann/config/{path}", changes=changes, unknown=["/log/old/thing"])

    def apply(self, edits: Sequence[Any], revision: int) -> EditsApplied:
        self._ask()
        self.calls.append(("apply", list(edits), revision))
        if self.state is State.RUNNING:
            raise refused(RefusedWhy.RUNNING, "the logger runs: stop it first")
        if revision not in {self.revision, -1}:
            raise refused(RefusedWhy.CONFLICT, "the table was changed by bob@lab meanwhile")
        for edit in edits:
            self._replace(edit.name, edit.options)
        self.revision += 1
        return EditsApplied(revision=self.revision, changed=len(edits))

    def start(self) -> Status:
        self.calls.append(("start",))
        if self.state is not State.RUNNING:
            self.state, self.started_ns, self.saved = State.RUNNING, self.now_ns, False
        return self.status()

    def stop(self) -> Status:
        self.calls.append(("stop",))
        self.state = State.STOPPED
        return self.status()

    def restart(self) -> Status:
        self.stop()
        return self.start()

    def load_script(self, path: str = "", revision: int = -1) -> EditsApplied:
        self.calls.append(("load_script", path))
        if self.state is State.RUNNING:
            raise refused(RefusedWhy.RUNNING, "the logger runs: stop it first")
        self._replace(
            "/log/imu/temperature", msgspec.structs.replace(self.info("/log/imu/temperature").options, divider=4)
        )
        self.revision += 1
        return EditsApplied(revision=self.revision, changed=1, unknown=["/log/old/thing"])

    def save_script(self, path: str = "", overwrite: bool = False) -> str:
        self.calls.append(("save_script", path, overwrite))
        if path in self.files and not overwrite:
            raise refused(RefusedWhy.EXISTS, f"/home/ann/config/{path} exists")
        self.files[path] = ""
        return f"saved /home/ann/config/{path}"

    def save(self, types: Sequence[FileType], name: str = "") -> int:
        self.calls.append(("save", list(types), name))
        self.publish(EventKind.SAVING, "saving", job=1, progress=0.5)
        if self.save_error:
            self.publish(EventKind.SAVE_FAILED, self.save_error, job=1)
        else:
            files = [SavedFile(f"/home/ann/logs/robot_00001.{kind.name.lower()}", kind, 1_234_567) for kind in types]
            self.saved = True
            self.publish(EventKind.SAVED, f"saved {files[0].path}", job=1, files=files)
        return 1

    def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> Column:
        self._ask()
        start_ns = max(start_ns, self.started_ns or end_ns)
        first, last = start_ns // column_ns, end_ns // column_ns
        count = max(0, last - first + 1) if self.started_ns else 0
        low, high = np.full((len(names), count), np.nan), np.full((len(names), count), np.nan)
        for position, name in enumerate(names):
            element = next((info for info in self.elements if name.startswith(info.name)), None)
            if element is None or not element.options.action.publishes:
                continue
            ticks = np.arange(math.ceil((start_ns - self.started_ns) / 1e9 * HZ), self.ticks + 1)
            columns = (self.started_ns + np.round(ticks / HZ * 1e9).astype(np.int64)) // column_ns - first
            good = (columns >= 0) & (columns < count)
            values = signal(name, ticks / HZ)[good]
            np.fmin.at(low[position], columns[good], values)
            np.fmax.at(high[position], columns[good], values)
        return Column(tuple(names), int(first), column_ns, low, high)

    def view(self, values: Sequence[str], plots: Sequence[str], rate_hz: float, column_ns: int) -> FakeView:
        self._ask()
        view = FakeView(self, values, plots, column_ns)
        self.views.append(view)
        return view

    def on_event(self, callback: Callable[[Event], None]) -> None:
        self._event = callback

    def on_link(self, callback: Callable[[bool], None]) -> None:
        self._link = callback

    def close(self) -> None:
        self.connected = False


class FakeFinder:
    own_name = "ann@here silo-tui 1"

    def __init__(self, *clients: FakeClient) -> None:
        self.clients = list(clients)
        self.advice: tuple[str, ...] = ()

    def find(self) -> Found:
        return Found(
            tuple(
                FoundLogger(client.name, client.pid, "ann", f"{client.name}.{client.pid}") for client in self.clients
            ),
            self.advice,
        )

    def connect(self, logger: FoundLogger) -> FakeClient:
        return next(client for client in self.clients if client.pid == logger.pid and client.name == logger.name)


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs tests that are coroutines."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    wanted = pyfuncitem._fixtureinfo.argnames
    asyncio.run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in wanted}))
    return True


@pytest.fixture
def fake() -> FakeClient:
    return FakeClient()


@pytest.fixture
def new_fake() -> type[FakeClient]:
    return FakeClient


@pytest.fixture
def new_finder() -> type[FakeFinder]:
    return FakeFinder


@pytest.fixture
def wide_table() -> Callable[[int], list[ElementInfo]]:
    """A table of any number of elements."""
    return lambda count: [
        scalar(f"/log/group{each // 100:03}/signal{each:05}", "Nm", action=Action.SAVE_AND_PUBLISH)
        for each in range(count)
    ]


@pytest.fixture
def robot() -> list[ElementInfo]:
    return robot_elements()


class Screen:
    """An app in a headless terminal, with the steps that tests take."""

    def __init__(self, app: SiloApp, pilot: Any) -> None:
        self.app, self.pilot = app, pilot

    @property
    def session(self) -> Any:
        return self.app.context.session

    @property
    def text(self) -> str:
        """What stands on the screen."""
        return "\n".join("".join(segment.text for segment in line) for line in self._lines()).replace("\xa0", " ")

    def _lines(self) -> Any:
        screen = self.app.screen
        return screen._compositor.render_strips()

    def value(self, name: str, field: Field) -> str:
        row = self.session.table.row(name)
        return phrase_for(field, int(self.session.table.values[field, row]))

    async def until(self, fact: Callable[[], Any], what: str = "") -> None:
        """Waits for a fact, 10 s at most."""
        for _ in range(500):
            if fact():
                return
            await self.pilot.pause(0.02)
        raise AssertionError(f"still not: {what or fact}\n{self.text}")

    async def shows(self, words: str) -> None:
        await self.until(lambda: words in self.text, f"{words!r} on the screen")

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)

    async def type(self, words: str) -> None:
        """All at once, as a slow link or a paste brings it."""
        names = {"/": "slash", ":": "colon", "*": "asterisk"}
        for char in words:
            self.app.post_message(events.Key(names.get(char, char), char))
        await self.pilot.pause()


@asynccontextmanager
async def _screen_of(app: SiloApp, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Screen]:
    async with app.run_test(size=size, notifications=True) as pilot:
        yield Screen(app, pilot)
        app.release()


@pytest.fixture
def screen_of() -> Callable[..., Any]:
    """`async with screen_of(app) as screen:` runs any app."""
    return _screen_of


@pytest.fixture
def opened() -> Callable[..., Any]:
    """`async with opened(fake, size=(80, 24)) as screen:` waits until the table is there."""

    @asynccontextmanager
    async def open_app(
        *fakes: FakeClient, size: tuple[int, int] = (80, 24), ready: bool = True, **options: Any
    ) -> AsyncIterator[Screen]:
        # twice the usual rate: tests wait for values
        app = SiloApp(FakeFinder(*fakes), **{"rate_hz": 10.0, **options})
        async with _screen_of(app, size) as screen:
            if ready:
                await screen.until(lambda: app.context.has_session and len(app.context.session.table) > 0, "the table")
                await screen.pilot.pause()
            yield screen

    return open_app
