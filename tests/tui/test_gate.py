"""The way in for what is typed, without an app: what passes at once, what waits for what it is meant for, what goes."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from textual import events
from textual.widgets import Input

from silo_tui import gate as module
from silo_tui.gate import DROPPED, STRAY, TELLS_AFTER_S, Gate, Holding
from silo_tui.modal import Dialog


class Pump:
    """What does one thing after the other."""

    _task = None
    _message_queue = SimpleNamespace(values=["something to do"])
    is_mounted = True

    def call_later(self, do: Callable[[], object]) -> bool:
        asyncio.get_running_loop().call_soon(do)
        return True

    call_after_refresh = call_later
    ancestors_with_self = property(lambda self: [self])


class Ended(Pump):
    """What has ended takes nothing."""

    def call_later(self, do: Callable[[], object]) -> bool:
        return False

    call_after_refresh = call_later


class Asks(Pump, Dialog[None]):  # type: ignore[misc]
    """A dialog: it waits for what is on its way, or may lose something by `x`."""

    def __init__(self, *, waits: bool = False, loses: bool = False, drawn_s: float = 0.0) -> None:
        self.waits, self.loses, self.drawn_s = waits, loses, drawn_s

    def may_lose(self, typed: Any) -> bool:
        return getattr(typed, "key", "x") == "x"


class Writing(Pump, Input):  # type: ignore[misc]
    """A line to type in."""

    def __init__(self) -> None:
        pass


class App(Pump):
    """An app of which each key is carried out as it passes: `meant` is what becomes of it."""

    def __init__(self, screen: Any = None) -> None:
        self.screen_stack, self.focused = [screen or Pump()], None
        self.passed: list[Any] = []
        self.meant: dict[str, Callable[[], object]] = {}
        self.said: list[str] = []
        self.works: list[Any] = []
        self.context = SimpleNamespace(say=self.said.append)
        self.gate = Gate(self)
        self.settled: list[int] = []  # how many keys had passed each time all was carried out
        settle = self.gate._settled

        async def settled() -> None:
            await settle()
            self.settled.append(len(self.passed))

        self.gate._settled = settled

    screen = property(lambda self: self.screen_stack[-1])

    def post_message(self, typed: Any) -> None:
        assert self.gate.keeps(typed) is False
        name = getattr(typed, "key", "paste")
        self.passed.append(name)
        if name in self.meant:
            self.call_later(self.meant[name])

    def run_worker(self, work: Any, **_: Any) -> None:
        self.works.append(asyncio.ensure_future(work()))

    def type(self, *keys: str, at_s: float = 1.0) -> list[bool]:
        typed = [events.Key(key, key if len(key) == 1 else None) for key in keys]
        for each in typed:
            each.time = at_s
        return [self.gate.keeps(each) for each in typed]

    async def done(self) -> None:
        while not self.gate.free:
            await asyncio.sleep(0)
        assert not any(work.done() for work in self.works)

    async def turns(self, count: int = 30) -> None:
        for _ in range(count):
            await asyncio.sleep(0)


async def test_each_key_passes_when_the_one_before_is_carried_out():
    app = App()
    assert app.type("a", "b", "c") == [True] * 3
    assert (app.passed, app.gate.free) == (["a"], False)
    await app.done()
    assert (app.passed, app.gate.free) == (["a", "b", "c"], True)
    app.type("d")
    assert app.passed == ["a", "b", "c", "d"]
    await app.done()


async def test_one_worker_serves_all_keys_and_another_one_where_that_has_ended():
    app = App()
    for typed in ("a", "b"):
        app.type(typed)
        await app.done()
    (worker,) = app.works
    app.works.clear()
    worker.cancel()
    await app.turns()
    app.type("c", "d")
    await app.done()
    assert (app.passed, len(app.works)) == (["a", "b", "c", "d"], 1)


async def test_who_has_nothing_to_do_is_not_told_to_say_so():
    app, told = App(), []
    app.call_later = told.append
    app._message_queue = SimpleNamespace(values=[], ready_event=SimpleNamespace(_waiters=["for a message"]))
    app.type("a", "b")
    await app.done()
    assert (app.passed, told) == (["a", "b"], [])


async def test_letters_of_a_line_follow_one_another_at_once_and_what_ends_it_waits_for_them():
    app = App()
    app.focused = Writing()
    app.type("a", "b", "c", "enter", "d")
    assert app.passed == ["a"]
    await app.done()
    assert app.passed == ["a", "b", "c", "enter", "d"]
    assert app.settled == [1, 3, 4, 5]


async def test_what_is_pasted_waits_as_keys_do():
    app = App()
    app.type("a")
    assert app.gate.keeps(events.Paste("words")) is True
    await app.done()
    assert app.passed == ["a", "paste"]


async def test_a_key_waits_for_what_the_one_before_opens():
    app, holding = App(), Asks(waits=True)
    app.meant["a"] = lambda: app.screen_stack.append(holding)
    app.type("a", "b", "c")
    await app.turns()
    assert app.passed == ["a"]
    app.screen_stack.append(Asks())
    holding.waits = False
    app.gate.moved()
    await app.done()
    assert app.passed == ["a", "b", "c"]


async def test_a_key_typed_while_something_is_on_its_way_waits_for_it():
    app = App(Asks(waits=True))
    app.type("a")
    await app.turns()
    assert (app.passed, app.gate.free) == ([], False)
    app.screen_stack[-1].waits = False
    app.gate.moved()
    await app.done()
    assert app.passed == ["a"]


@pytest.mark.parametrize(
    ("key", "waits", "passes"),
    [("ctrl+q", True, True), ("ctrl+q", False, True), ("escape", True, True), ("ctrl+c", True, True),
     ("escape", False, False), ("ctrl+c", False, False)],
)  # fmt: skip
async def test_what_ends_the_program_or_lets_go_passes_at_once_and_what_was_typed_before_is_forgotten(
    key, waits, passes
):
    app = App(Asks(waits=waits))
    app.type("a", "b")
    assert app.type(key) == [not passes]
    app.screen_stack[-1].waits = False
    app.gate.moved()
    await app.done()
    assert app.passed == (["a"] * (not waits) if passes else ["a", "b", key])


async def test_what_was_typed_for_a_dialog_that_never_came_is_forgotten():
    app = App(Asks(waits=True))
    app.type("a", "b")
    app.gate.drop()
    app.screen_stack[-1].waits = False
    app.gate.moved()
    await app.done()
    assert (app.passed, app.gate.free) == ([], True)


async def test_without_a_screen_nothing_is_kept():
    app = App()
    app.screen_stack.clear()
    assert app.type("a") == [False]


async def test_as_the_program_ends_what_is_kept_goes_with_it():
    app = App()
    app.meant["a"] = app.screen_stack.clear
    app.type("a", "b")
    await app.done()
    assert (app.passed, app.gate.free) == (["a"], True)


async def test_who_has_ended_is_not_waited_for():
    app = App()
    app.focused = Ended()
    app.type("a", "b")
    await app.done()
    assert app.passed == ["a", "b"]


@pytest.mark.parametrize(
    ("keys", "at_s", "passed", "said"),
    [
        ("x", 1.0, [], [DROPPED]), ("x y", 1.0, ["y"], [DROPPED]), ("y x", 1.0, ["y"], [DROPPED]),
        ("x", 5.0, ["x"], []), ("y", 1.0, ["y"], []),
    ],
)  # fmt: skip
async def test_what_was_typed_before_a_question_that_may_lose_something_is_dropped(keys, at_s, passed, said):
    app = App(Asks(loses=True, drawn_s=5.0))
    app.type(*keys.split(), at_s=at_s)
    await app.done()
    assert (app.passed, app.said) == (passed, said)


async def test_what_was_typed_once_the_question_was_drawn_is_not_dropped_with_what_came_before():
    app = App(Asks(loses=True, drawn_s=5.0))
    app.gate.free = False
    app.type("x", "y")
    app.type("z", at_s=5.0)
    app.gate._let_through()
    app.gate._let_through()
    assert (app.passed, app.said) == (["z"], [DROPPED])


@pytest.mark.parametrize(
    ("after_s", "passed"), [([0.1, 0.2], "x"), ([0.4, 0.8], "x"), ([0.6, 0.7], "xae"), ([0.1, 0.7], "xe")]
)
async def test_what_is_typed_on_at_once_behind_a_key_that_was_refused_is_no_command(after_s, passed):
    app = App()
    app.meant["x"] = app.gate.refused
    for key, at_s in zip("xae", [0.0, *after_s], strict=True):
        app.type(key, at_s=1.0 + at_s)
    await app.done()
    assert ("".join(app.passed), set(app.said)) == (passed, {STRAY} if len(passed) < 3 else set())


# -------------------------------------------------------------------------------------------------- what is waited for


class Held(Holding):
    """What stands over a screen meanwhile; `line` is what it says."""

    is_active = True

    def __init__(self, app: Any) -> None:
        super().__init__("robot")
        self.of, self.gone, self.line = app, 0, SimpleNamespace(display=False, update=self.say)
        self.words = ""

    app = property(lambda self: self.of)

    def say(self, words: str) -> None:
        self.words = words

    def query_one(self, *_: Any) -> Any:
        return self.line

    def query(self, *_: Any) -> Any:
        return [self.line]

    def dismiss(self, result: None = None) -> Any:
        self.gone += 1

    def set_interval(self, *_: Any) -> Any:
        pass

    def call_later(self, do: Any, *_: Any) -> Any:
        do()


@pytest.fixture
def held(monkeypatch):
    clock = SimpleNamespace(s=100.0)
    clock.monotonic = lambda: clock.s
    monkeypatch.setattr(module, "time", clock)
    calls: list[str] = []
    app = SimpleNamespace(
        gate=SimpleNamespace(moved=lambda: calls.append("moved"), drop=lambda: calls.append("drop")),
        context=SimpleNamespace(tell=lambda news: calls.append("keys"), left=lambda: calls.append("left")),
        exit=lambda: calls.append("exit"),
    )
    found = Held(app)
    found.clock, found.calls = clock, calls
    return found


def test_for_what_one_waits_is_said_after_a_moment(held):
    held.clock.s += TELLS_AFTER_S - 0.01
    held._tell()
    assert not held.line.display
    held.clock.s += 0.96
    held._tell()
    assert held.line.display
    assert held.words == "waiting for robot 1.2 s"
    held.on_screen_suspend()
    assert not held.line.display
    held.is_active = False
    held._tell()
    assert not held.line.display


def test_for_the_next_step_the_seconds_are_counted_anew(held):
    held.clock.s += 10
    held.on_screen_resume()
    held._tell()
    assert not held.line.display
    assert held.gone == 0


def test_once_it_has_ended_it_goes_and_what_was_typed_for_its_dialog_too(held):
    held.on_mount()
    held.end()
    assert (held.waits, held.gone, held.calls) == (False, 1, ["drop", "moved"])


def test_what_was_typed_after_its_dialog_is_for_what_follows(held):
    held.on_mount()
    held.on_screen_suspend()
    held.calls.clear()
    held.end()
    assert (held.gone, held.calls) == (1, ["moved"])


def test_one_that_ends_before_it_was_made_or_below_a_dialog_goes_as_soon_as_it_can(held):
    held.end()
    assert held.gone == 0
    held.on_mount()
    assert held.gone == 1
    held.is_active = False
    held.end()
    assert held.gone == 1
    held.is_active = True
    held.on_screen_resume()
    assert held.gone == 2


@pytest.mark.parametrize(
    ("key", "gone", "calls"),
    [("escape", 1, ["moved"]), ("ctrl+c", 1, ["moved"]), ("ctrl+q", 0, ["left", "exit"]), ("y", 0, [])],
)
def test_keys_over_it_are_for_nobody_below(key, gone, calls, held):
    stopped: list[str] = []
    event: Any = SimpleNamespace(
        key=key, stop=lambda: stopped.append("stop"), prevent_default=lambda: stopped.append("no default")
    )
    held.on_key(event)
    assert (held.gone, held.calls, held.waits) == (gone, calls, not gone)
    assert stopped == ["stop", "no default"]
