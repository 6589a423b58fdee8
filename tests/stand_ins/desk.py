"""Flows and commands without a screen: what they ask is answered by keys, and kept with what they say."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from rich.console import Console
from textual.geometry import Size

from silo.core.elements import FileType, SavedFile
from silo_tui.context import Context, SiloScreen
from silo_tui.model.table.fields import Field
from silo_tui.screens.dialogs.questions import Question
from silo_tui.screens.files.save_data import SaveDialog
from silo_tui.sessions.live import Session
from tests.stand_ins.fake_logger import FakeClient

ESC, LEFT = "escape", "left without saving"
NAME = "/log/base/orientation"
SAVED = SavedFile("/home/ann/logs/robot_00001.silo", FileType.SILO, 1_234_567)


class Straight:
    """A link that answers at once."""

    connected, identity = True, "@local me"

    def __init__(self, client: FakeClient) -> None:
        self.client = client

    async def call(self, job: Callable[[Any], Any]) -> Any:
        return job(self.client)

    read = aside = call

    def watch_again(self) -> None:
        pass

    def try_now(self) -> None:
        self.client._try_now()


class Line:
    """A line to type, of which a real one can't be made without an app."""

    def __init__(self, title: str, body: str, value: str = "", placeholder: str = "", *, label: str = "") -> None:
        self.title, self.body, self.value = title, body, value


class Desk(Context):
    """What a flow sees of the app, and the user before it: keys, or a line, for what is asked in turn."""

    def __init__(self, fake: FakeClient, *answers: str | None, read_only: bool = False) -> None:
        super().__init__(cast(Any, self), read_only=read_only)
        self.fake = fake
        self.asked: list[str] = []
        self.said: list[str] = []
        self.ended = False
        self.left_view: Any = None
        self._work: list[Any] = []
        self.answers = list(answers)
        self.screen_stack: list[Any] = []
        session = Session(fake.name)
        session.own_name = "ann@here silo-tui 1"
        self.take_session(session)
        asyncio.run(session.attach(cast(Any, Straight(fake))))
        fake.calls.clear()
        self._seen = self._now

    @property
    def _now(self) -> tuple[Any, int]:
        return self.session.status.state, self.session.table.revision

    def status_changed(self) -> None:
        self._seen = self._now[0], self._seen[1]

    def table_changed(self) -> None:
        self._seen = self._seen[0], self._now[1]

    async def push_screen_wait(self, dialog: Any) -> Any:
        assert self._seen == self._now, "below a question the screens still show what was"
        answer = self.answers.pop(0)
        if isinstance(dialog, SaveDialog):
            assert dialog._at_once and dialog._go_on, "one that is part of a flow saves, and goes by itself"
            self.asked.append("save")
            if answer == LEFT:
                return None
            self.fake.calls.append(("save",))
            self.fake.saved = True
            return [SAVED]
        if isinstance(dialog, Line):
            self.asked.append("\n".join([dialog.title, dialog.body, dialog.value]))
            return answer
        assert isinstance(dialog, Question)
        offered = [f"({each.key}) {each.label}{'!' * each.loses}" for each in dialog._choices]
        self.asked.append("\n".join([dialog._title, str(dialog._body), *offered]))
        chosen = next((each.value for each in dialog._choices if each.key and each.key == answer), None)
        assert chosen is not None or answer in (ESC, None), f"{answer} is none of {offered}"
        return chosen or None

    def say(self, words: str, *, hint: bool = False) -> None:
        self.said.append(self._with_saved(words))

    def fail(self, words: str) -> None:
        self.said.append(f"failed: {words}")

    def call_after_refresh(self, do: Any, *given: Any) -> None:
        do(*given)

    def exit(self) -> None:
        self.ended = True

    def run_worker(self, work: Any, **_: Any) -> None:
        self._work.append(work)

    def run_flow(self, flow: Any, **_: Any) -> None:
        self.does(flow)

    def does(self, flow: Any = None) -> str:
        """Carry out a flow, or what was begun; return what was said last. All must be asked that has an answer."""
        asyncio.run(self._carried_out(flow))
        assert not self.answers, "this was never asked for"
        return self.said[-1] if self.said else ""

    async def _carried_out(self, flow: Any) -> None:
        if flow is not None:
            await flow
        while self._work:
            await self._work.pop(0)()
            await asyncio.sleep(0)  # what its threads told

    @property
    def done(self) -> str:
        """What was asked of the logger."""
        return " ".join(str(call[0]) for call in self.fake.calls)

    def edit(self, name: str = NAME, divider: int = 5) -> "Desk":
        """Edit, as the table does."""
        self.session.table.edit([self.session.table.row(name)], Field.DIVIDER, divider)
        return self


class Sheet(SiloScreen):
    """A full screen that keeps what it is told."""

    scope = "table"

    def __init__(self, *, is_there: bool = True, is_modal: bool = False) -> None:
        super().__init__()
        self.there, self.modal = is_there, is_modal
        self.told: list[Any] = []

    is_there = property(lambda self: self.there)  # type: ignore[assignment]
    is_modal = property(lambda self: self.modal)  # type: ignore[assignment]

    def say(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        self.told.append(("failed: " if failed else "") + words)

    def show_news(self, news: str) -> None:
        self.told.append(news)

    def table_changed(self) -> None:
        self.told.append("table")

    def status_changed(self) -> None:
        self.told.append("status")

    def update_keys(self) -> None:
        self.told.append("keys")

    def request_view(self) -> None:
        self.told.append("view")


class Plain(Desk):
    """A desk whose words go to a sheet, as the app has it."""

    say, fail, run_flow = Context.say, Context.fail, Context.run_flow
    table_changed, status_changed = Context.table_changed, Context.status_changed
    kind: type[Sheet] = Sheet  # of its screen

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.sheet = self.kind()
        self.screen_stack = [self.sheet]

    @property
    def screen(self) -> Any:
        return self.screen_stack[-1]

    def pop_screen(self) -> None:
        self.screen_stack.pop()

    def push_screen(self, screen: Any) -> None:
        self.holding = screen

    @property
    def context(self) -> Context:
        return self

    @property
    def heard(self) -> str:
        return self.sheet.told[-1] if self.sheet.told else ""


class Drawn:
    """A widget of so many cells, in an app whose colours are their names."""

    width, height = 80, 1
    read_only = has_demo = False
    screen: Any = None

    @property
    def app(self) -> Any:
        console = Console(width=self.width, color_system=None)
        return SimpleNamespace(
            theme_variables=Colours(), size=Size(self.width, 24), console=console, no_color=False, _driver=None,
            context=SimpleNamespace(read_only=self.read_only, has_demo=lambda: self.has_demo),
        )  # fmt: skip

    size = content_size = property(lambda self: Size(self.width, self.height))

    painted = 0

    def refresh(self, *_: Any, **__: Any) -> None:
        self.painted += 1


class Colours(dict[str, str]):
    """Each name has a colour of its own."""

    def get(self, name: str, default: str = "") -> str:
        return f"#{sum(map(ord, name)):06x}"
