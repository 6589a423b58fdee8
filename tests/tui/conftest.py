"""The app in a headless terminal, on a logger that exists only in the test."""

import asyncio
import functools
import inspect
import itertools
import math
import time
import traceback
import unicodedata
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, asynccontextmanager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest
from textual import _callback, events
from textual._compositor import Compositor
from textual._context import visible_screen_stack
from textual.app import App
from textual.cache import FIFOCache
from textual.css.model import RuleSet
from textual.css.styles import RenderStyles
from textual.css.stylesheet import Stylesheet
from textual.geometry import Region
from textual.keys import REPLACED_KEYS, _character_to_key, _get_unicode_name_from_key
from textual.message import Message
from textual.message_pump import MessagePump
from textual.pilot import Pilot, WaitForScreenTimeout
from textual.reactive import Reactive
from textual.screen import ModalScreen
from textual.strip import Strip

from silo.core.elements import Action, ElementInfo
from silo_tui import actions, modal
from silo_tui.actions import BY_ID, with_keys
from silo_tui.app import SiloApp
from silo_tui.commands import opening
from silo_tui.keymap import BASES, DEFAULT, keys_in, use_keys
from silo_tui.menus import MenuReader
from silo_tui.modal import Behind
from silo_tui.model.table.fields import Field, phrase_for
from silo_tui.screens import elements
from silo_tui.screens.dialogs.find import FindDialog
from silo_tui.screens.dialogs.form import Form
from silo_tui.screens.dialogs.limits import LimitsDialog
from silo_tui.screens.dialogs.trigger_editor import TriggerEditor
from silo_tui.screens.files.file_table import FileTableScreen
from silo_tui.screens.plots import detail, plot_screen
from silo_tui.sessions.recorded import open_file
from silo_tui.settings.options import Settings
from tests.stand_ins import quick_styles
from tests.stand_ins.fake_logger import FakeClient, FakeFinder
from tests.stand_ins.fake_signals import robot_elements, scalar
from tests.waiting import DEADLINE_S


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs tests that are coroutines."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    wanted = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}

    async def carry_out() -> None:
        async with wanted["screen"] if "screen" in wanted else nullcontext() as opened:
            await pyfuncitem.obj(**wanted | ({"screen": opened} if opened else {}))

    asyncio.run(carry_out())
    return True


_for_all: list[Callable[[], AbstractContextManager[None]]] = []


def for_all(patched: Callable[[], Iterator[None]]) -> Callable[[], Iterator[None]]:
    """Have it patched from the first test of the terminal on."""
    _for_all.append(contextmanager(patched))
    return patched


@pytest.fixture(autouse=True, scope="session")
def textual_is_quick() -> Iterator[None]:
    """One fixture for all: each that a test has takes its time with each test, as it is collected and as it runs."""
    with ExitStack() as patches:
        for patched in _for_all:
            patches.enter_context(patched())
        yield


@for_all
def styles_parsed_once() -> Iterator[None]:
    """Keep what Textual parses of styles for the next app: a quarter of the processor time of each."""
    parse, parsed = Stylesheet._parse_rules, {}

    def parse_once(sheet: Stylesheet, *arguments: Any, **named: Any) -> Any:
        key = (arguments, *sorted(named.items()), *sheet._variables.items())  # in whatever order: it is that of a theme
        if key not in parsed:
            parsed[key] = parse(sheet, *arguments, **named)
        return parsed[key]

    parse_whole, wholes = Stylesheet.parse, {}

    def parse_whole_once(sheet: Stylesheet) -> None:
        key = (*sheet.source.items(), *sheet._variables.items())
        if key not in wholes:
            parse_whole(sheet)
            wholes[key] = sheet._rules, sheet.rules_map
        (sheet._rules, sheet._rules_map), sheet._require_parse = wholes[key], False

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stylesheet, "_parse_rules", parse_once)
        patch.setattr(Stylesheet, "parse", parse_whole_once)
        patch.setattr(RuleSet, "__hash__", object.__hash__)  # as Textual's, without a call: 45,000 a test of the table
        yield


@for_all
def styles_found_once() -> Iterator[None]:
    """Keep which rules mean nodes that are alike: of an app that opens they were a quarter of the processor time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stylesheet, "apply", quick_styles.apply_known)
        patch.setattr(Stylesheet, "_process_component_classes", quick_styles.process_known)
        yield


CACHES = {f"_{name}_cache": 4 for name in ("divide", "filter", "line_length", "crop_extend", "offsets")}
CACHES |= {"_crop_cache": 16, "_style_cache": 16}  # what a strip keeps, and how much


@for_all
def strips_keep_what_is_kept() -> Iterator[None]:
    """Make a cache of a strip as it is first looked into: Textual makes seven with each line, most for nothing."""

    def make_bare(strip: Strip, segments: Any, cell_length: int | None = None) -> None:
        strip._segments, strip._cell_length = list(segments), cell_length
        strip._render_cache = strip._link_ids = strip._cell_count = None

    def make_cache(strip: Strip, name: str) -> FIFOCache[Any, Any]:
        if name not in CACHES:
            raise AttributeError(name)
        made: FIFOCache[Any, Any] = FIFOCache(CACHES[name])
        setattr(strip, name, made)
        return made

    whole = Strip([])
    assert {name for name in Strip.__slots__ if isinstance(getattr(whole, name), FIFOCache)} == CACHES.keys()
    assert all(getattr(whole, name)._maxsize == most for name, most in CACHES.items())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Strip, "__init__", make_bare)
        patch.setattr(Strip, "__getattr__", make_cache, raising=False)
        yield


@for_all
def painted_when_looked_at() -> Iterator[None]:
    """Paint what is looked at, and of it the lines that are to be painted anew: Textual paints all for a terminal that
    isn't there, and all of a screen whenever one asks what stands there. Of a dialog that goes unseen it is the dialog
    alone: what shines through was painted as it was looked at itself.
    """
    paint, strips = Compositor.render_update, Compositor.render_strips
    pop, behind = App.pop_screen, Behind.render_strips
    going: list[App[Any]] = []  # those whose dialog goes
    seen: dict[Compositor, list[Strip]] = {}  # what stands there since it was painted last

    def paint_later(compositor: Compositor, full: bool = False, **options: Any) -> Any:
        unseen = compositor.root is not None and compositor.root.app.is_headless
        return None if unseen and not full else paint(compositor, full, **options)

    def painted(compositor: Compositor) -> list[Strip]:
        visible_screen_stack.set(compositor.root.app._background_screens)
        compositor.update_widgets(set(compositor.visible_widgets))
        lines = seen.get(compositor, [])
        if len(lines) != compositor.size.height or any(line.cell_length != compositor.size.width for line in lines):
            lines = [Strip([])] * compositor.size.height
            compositor._dirty_regions = {compositor.size.region}
        anew = {y for region in compositor._dirty_regions for y in region.line_range if y < len(lines)}
        compositor._dirty_regions.clear()
        if anew:
            first, last = min(anew), max(anew)
            around = Region(0, first, compositor.size.width, last - first + 1)
            chops = compositor._render_chops(around, anew.__contains__)
            lines = [Strip.join(chops[y].values()) if y in anew else line for y, line in enumerate(lines)]
        seen.clear()
        seen[compositor] = lines
        return lines

    def strips_of_now(compositor: Compositor, *size: Any) -> Any:
        if (top := compositor.root) is None or size or top is not top.app.screen:
            return strips(compositor, *size)
        return painted(compositor)

    def pop_painted(app: App[Any]) -> Any:
        if app.is_headless and app.screen_stack and (compositor := app.screen._compositor).root is not None:
            going.append(app)
            try:
                painted(compositor)  # what stood there only between two keys, too
            finally:
                going.clear()
        return pop(app)

    def strips_behind(of: Behind, width: int, height: int | None, *style: Any) -> list[Strip]:
        return [Strip.blank(width)] * (height or 0) if going else behind(of, width, height, *style)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(App, "pop_screen", pop_painted)
        patch.setattr(Behind, "render_strips", strips_behind)
        patch.setattr(Compositor, "render_update", paint_later)
        patch.setattr(Compositor, "render_strips", strips_of_now)
        yield


@for_all
def seen_through_at_once() -> Iterator[None]:
    """Draw what is behind a dialog whenever it changes, not once a second: what a test sees stands still."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(modal, "BEHIND_S", 0.0)
        yield


@for_all
def looked_at_at_once() -> Iterator[None]:
    """Look at what is typed in a form, and draw plots anew, with the key itself, not once nobody types any more."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (elements, detail, plot_screen):
            patch.setattr(module, "DEBOUNCE_S", 0.01)
        patch.setattr(opening, "LOOK_S", 0.01)  # for loggers
        for form in (Form, FindDialog, LimitsDialog, TriggerEditor):
            patch.setattr(form, "AFTER_S", 0.01)
        yield


@for_all
def parameters_counted_once() -> Iterator[None]:
    """Keep how many parameters a function has: Textual looks at the signature of each callback that is made anew."""
    count, known = _callback._count_parameters, {}

    def count_once(function: Any) -> int:
        code = getattr(function, "__code__", None)
        if code is None or hasattr(function, "__wrapped__"):
            return count(function)
        if code not in known:
            known[code] = count(function)
        return known[code]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_callback, "_count_parameters", count_once)
        yield


@functools.cache
def is_computed(node: type, method: str) -> bool:
    """Return whether a value of such nodes is computed each time that it is read."""
    return hasattr(node, method)


@for_all
def values_read_at_once() -> Iterator[None]:
    """Read values and rules of nodes where they are: Textual asks four times for each whether it is there."""
    get = Reactive.__get__

    def get_at_once(reactive: Reactive[Any], node: Any, kind: Any = None) -> Any:
        if node is not None and not is_computed(type(node), reactive.compute_name):
            values = node.__dict__
            if reactive.internal_name in values and "_id" in values:
                return values[reactive.internal_name]
        return get(reactive, node, kind)

    def rule_at_once(styles: RenderStyles, name: str, default: object = None) -> object:
        inline = styles._inline_styles._rules
        return inline[name] if name in inline else styles._base_styles._rules.get(name, default)  # type: ignore[literal-required]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Reactive, "__get__", get_at_once)
        patch.setattr(RenderStyles, "get_rule", rule_at_once)
        yield


@functools.cache
def handlers_of(node: type, message: type, name: str) -> list[tuple[type, Any]] | None:
    """Return which classes of a node handle a message by the name of a method; None where a decorator has a say."""
    found = []
    for each in node.__mro__:
        decorated = each.__dict__.get("_decorated_handlers") or {}
        method = each.__dict__.get(f"_{name}") or each.__dict__.get(name)
        if any(one in decorated for one in message.__mro__) or hasattr(method, "_textual_on"):
            return None
        if method is not None:
            found.append((each, method))
    return found


def forget_classes() -> None:
    """Look anew at what methods classes have."""
    handlers_of.cache_clear()
    is_computed.cache_clear()


@for_all
def handlers_looked_up_once() -> Iterator[None]:
    """Keep which methods handle a message until one is put into a class: Textual goes through all for each."""
    look, put, undo = MessagePump._get_dispatch_methods, pytest.MonkeyPatch.setattr, pytest.MonkeyPatch.undo

    def look_once(pump: MessagePump, name: str, message: Message) -> Iterator[tuple[type, Any]]:
        found = handlers_of(type(pump), type(message), name)
        if found is None:
            yield from look(pump, name, message)
            return
        for each, method in found:
            if message._no_default_action:
                break
            yield each, method.__get__(pump, each)

    def put_anew(patch: pytest.MonkeyPatch, *arguments: Any, **named: Any) -> None:
        put(patch, *arguments, **named)
        if isinstance(patch._setattr[-1][0], type):
            forget_classes()

    def undo_anew(patch: pytest.MonkeyPatch) -> None:
        if any(isinstance(whose, type) for whose, *_ in patch._setattr):
            forget_classes()
        undo(patch)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MessagePump, "_get_dispatch_methods", look_once)
        patch.setattr(pytest.MonkeyPatch, "setattr", put_anew)
        patch.setattr(pytest.MonkeyPatch, "undo", undo_anew)
        yield


class Silent:
    """A log that nobody reads."""

    def __init__(self) -> None:
        self.event = self

    def verbosity(self, _verbose: bool) -> "Silent":
        return self

    def __call__(self, *words: Any) -> None:
        pass

    warning = __call__


@for_all
def nothing_logged() -> Iterator[None]:
    """Textual makes two objects for each message, with which it would tell its console of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("textual.message_pump.log", Silent())
        yield


@for_all
def nothing_prevented_at_once() -> Iterator[None]:
    """Make no context where no messages are to be prevented: Textual makes two for each message."""
    prevent, nothing = MessagePump.prevent, nullcontext()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MessagePump, "prevent", lambda pump, *types: prevent(pump, *types) if types else nothing)
        yield


def busy(app: App[Any]) -> bool:
    """Return whether an app, or a widget of its screen, has something to do."""
    nodes: list[Any] = [app.screen]
    for node in nodes:  # which grows meanwhile: Textual's own walk takes a tenth of what a key does
        nodes += node._nodes._nodes
    queues = [node._message_queue for node in (app, *nodes) if not (node._closing or node._closed)]
    return any(queue.values or not queue.ready_event._waiters for queue in queues)


@for_all
def only_the_busy_are_waited_for() -> Iterator[None]:
    """Until none is busy for three turns of the loop, in which what they began goes on.

    Pilot's own wait has each widget call back, hundreds of messages a key: half of the processor time of these tests.
    """

    async def wait_for_the_busy(pilot: Pilot[Any], timeout: float = 30.0) -> bool:
        deadline, quiet, turns = time.monotonic() + timeout, 0, 0
        while quiet < 3:
            await asyncio.sleep(0 if turns < 100 else 0.001)  # one that is busy for so long waits for a thread
            if not pilot.app.screen_stack or pilot.app._exception_event.is_set():
                return False
            quiet, turns = 0 if busy(pilot.app) else quiet + 1, turns + 1
            if time.monotonic() > deadline:
                raise WaitForScreenTimeout(f"still busy after {timeout} s")
        return True

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pilot, "_wait_for_screen", wait_for_the_busy)
        yield


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where edits that were not applied, and views, are kept: never that of who runs the tests; nor is his folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "state"


# modules whose tests press the keys of `keymap: classic`; those of `Screen.do` press commands, whatever their keys are
CLASSIC = """
bursts conditions derived dialogs_and_loggers edits_stay events file_screens filters_of_lists find_screens
first_contact fitting_lines keys_of_screens large_plot leaving limits_and_log_axis lists measured
monitor_screen mouse nonsense nonsense_everywhere painted_lines parameters pause real_logger recorders
recordings_screen scope settings_doors settings_screen table_screen terminal typed_early views
"""
DEFAULT_KEYS = {command: keys_in(DEFAULT, command) for command in BASES[DEFAULT]}


@pytest.fixture(autouse=True)
def keys_of_nobody(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What keys a test gave commands counts for no other."""
    if request.path.stem.removeprefix("test_") in CLASSIC.split():
        defaults = ("classic" if each == DEFAULT else each for each in Settings.__init__.__defaults__)
        monkeypatch.setattr(Settings.__init__, "__defaults__", tuple(defaults))
        use_keys("classic", {})
    yield
    if actions._own != DEFAULT_KEYS:
        use_keys(DEFAULT, {})


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


def character_of(name: str) -> str | None:
    """Return what a key types; None for one that types nothing."""
    try:
        return unicodedata.lookup(_get_unicode_name_from_key(REPLACED_KEYS.get(name, name)))
    except KeyError:
        return name if len(name) == 1 else None


@contextmanager
def typed_on(reader: MenuReader | None) -> Iterator[None]:
    """Draw no menu between keys, however long a busy machine takes for them; one that was due follows the last."""
    if reader is None:
        yield
        return
    draw, due, goes_on = MenuReader.draw, [], True

    def draw_later() -> None:
        if goes_on:
            due.append(True)
        else:
            draw(reader)

    reader.draw = draw_later  # type: ignore[method-assign]
    yield
    goes_on = False
    if due:
        draw(reader)


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
        """Waits for a fact."""
        deadline = time.monotonic() + DEADLINE_S
        while not fact():
            assert time.monotonic() < deadline, f"still not: {what or fact}\n{self.text}"
            await self.pilot.pause(0.01)

    async def settled(self) -> None:
        """Wait until what is under way shows what it asks, or has ended, and all that it set off is done."""
        await self.until(lambda: not getattr(self.app.screen, "waits", False), "what is under way, or its end")
        await self.pilot._wait_for_screen()

    async def shows(self, words: str) -> None:
        """Wait for words, and for the place that what came with them takes."""
        await self.until(lambda: words in self.text, f"{words!r} on the screen")
        await self.pilot.pause(0)
        await self.pilot.pause(0)

    async def seen(self, shows: str, at: str) -> None:
        """Wait for what a step shows, and where it leads to, if it says so."""
        if shows:
            await self.shows(shows)
        if at:
            await self.until(lambda: getattr(self.app.screen, "scope", "") == at, f"the screen of {at}")

    async def press(self, *keys: str, shows: str = "", at: str = "") -> None:
        """Press keys one after the other; each is carried out, with what it set off, before the next.

        As of all steps, words that it `shows` are waited for, and the screen that it leads to, by its scope (`at`).

        `Pilot.press` waits besides until the process uses no processor time, at least 40 ms a key and up to seconds
        in a program that draws live values.
        """
        with typed_on(getattr(self.app, "reader", None)):
            for key in keys:
                name = _character_to_key(key) if len(key) == 1 and not key.isalnum() else key
                await self.until(self._may_be_answered, "a question that was drawn")
                self.app.gate._stray_s = -math.inf  # key by key: what was refused is read before the next
                self.app.post_message(events.Key(name, character_of(name)))
                await self.carried_out()
        await self.pilot.pause(0)
        await self.seen(shows, at)

    async def do(self, *steps: str, shows: str = "", at: str = "") -> None:
        """Press the keys of commands by their ids (`toggle`), whatever they are; other words are keys."""
        for step in steps:
            is_key = step in ("down", "up", "left", "right") or step not in BY_ID
            await self.press(*([step] if is_key else with_keys(BY_ID[step]).keys.split(",")[0].split()))
        await self.seen(shows, at)

    def _may_be_answered(self) -> bool:
        """Whether no question is open that may lose something and drops what was typed before one could read it."""
        top = self.app.screen if self.app.screen_stack else None
        return not getattr(top, "loses", False) or top.drawn_s <= time.monotonic()

    async def carried_out(self) -> None:
        """Waits until the key, what its command posted, and what that opened is done; or waits itself."""
        await self.pilot._wait_for_screen()
        deadline = time.monotonic() + DEADLINE_S
        turns = itertools.count()
        while not self.app.gate.free and not getattr(self.app.screen, "waits", False) and self.app.is_running:
            assert time.monotonic() < deadline, f"a key is not carried out\n{self.text}"
            await asyncio.sleep(0 if next(turns) < 100 else 0.001)  # what takes so long waits for a thread
        await self.pilot._wait_for_screen()

    async def leave(self) -> None:
        """Press Esc until nothing is open, and once more."""
        await self.press("escape", "escape")
        while isinstance(self.app.screen, ModalScreen):
            assert self.app.is_running
            await self.press("escape")

    async def type(self, words: str, shows: str = "", at: str = "") -> None:
        """All at once, as a slow link or a paste brings it."""
        names = {"/": "slash", ":": "colon", "*": "asterisk"}
        for char in words:
            self.app.post_message(events.Key(names.get(char, char), char))
        await self.carried_out()
        await self.seen(shows, at)

    async def enter(self, words: str, *keys: str, shows: str = "", at: str = "") -> None:
        """Type words, press Enter, then keys."""
        await self.type(words)
        await self.press("enter", *keys, shows=shows, at=at)

    async def plot(self, *keys: str) -> None:
        """Press keys that lead to plots, and wait for their curves."""
        await self.press(*keys)
        await self.curves()

    async def curves(self) -> None:
        """Wait until the plots have what was logged."""
        await self.until(lambda: not self.app.screen.stack.store.empty, "history in the plots")

    async def type_or_paste(self, words: str) -> None:
        """As somebody brings words in: what is long isn't typed."""
        if len(words) < 40:
            await self.type(words)
        else:
            self.app.post_message(events.Paste(words))
            await self.pilot.pause()


@asynccontextmanager
async def _screen_of(app: SiloApp, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Screen]:
    async with app.run_test(size=size, notifications=True) as pilot:
        screen = Screen(app, pilot)
        yield screen
        assert not app.screen_stack or screen.text is not None  # which is drawn here, where no test looks
        # which a user is told of, and a test must not pass over
        assert not app.unforeseen.errors, "".join(map("".join, map(traceback.format_exception, app.unforeseen.errors)))
        app.release()
        app.exit()  # as who uses it does: what works in it ends before its screens go
        await pilot.app._task


@pytest.fixture
def screen_of() -> Callable[..., Any]:
    """`async with screen_of(app) as screen:` runs any app."""
    return _screen_of


def is_filled(app: SiloApp) -> bool:
    """Whether all that was read of a logger is on the screen, or a question that stands above it."""
    there = app._opener._view_is_there or getattr(app.screen, "is_modal", False)
    return app.context.has_session and len(app.context.session.table) > 0 and there


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
                await screen.until(lambda: is_filled(app), "the table")
                await screen.pilot.pause()
            yield screen

    return open_app


@pytest.fixture
def screen(request: pytest.FixtureRequest, fake: FakeClient, opened: Callable[..., Any]) -> Any:
    """The app on the logger of a test, opened as the test begins.

    Defaults of the test's own parameters are options of it; one called `ran_s` is since when the logger runs.
    """
    parameters = inspect.signature(request.function).parameters.values()
    options = {each.name: each.default for each in parameters if each.default is not each.empty}
    if "size" in request.fixturenames:
        options["size"] = request.getfixturevalue("size")
    if "ran_s" in options:
        fake.run(options.pop("ran_s"))
    return opened(fake, **options)


@pytest.fixture
def on_file() -> Callable[..., Any]:
    """`async with on_file(path, size=(80, 24)) as screen:` opens a saved log and waits for its table."""

    @asynccontextmanager
    async def open_app(path: Path, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Screen]:
        async with _screen_of(SiloApp(FakeFinder(), file=open_file(path)), size) as screen:
            await screen.until(lambda: isinstance(screen.app.screen, FileTableScreen), "the table")
            await screen.pilot.pause()
            yield screen

    return open_app
