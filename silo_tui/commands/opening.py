"""Finding a logger and opening it: at the beginning, from the list, and again after the robot program was restarted."""

import asyncio
from collections.abc import Sequence
from typing import TYPE_CHECKING

from silo.errors import SiloError
from silo_tui.screens.loggers import LoggersScreen
from silo_tui.screens.table import TableScreen
from silo_tui.sessions.demo import Demo
from silo_tui.sessions.finder import Finder, Found, FoundLogger
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo_tui.app import SiloApp

LOOK_S = 1.0
DEMO_LOOK_S = 0.1


class Opener:
    """Looks for loggers in a thread and opens one: `wanted` is the name asked for, `demo` the one we started."""

    def __init__(self, app: "SiloApp", finder: Finder, wanted: str, demo: Demo | None, *, read_only: bool) -> None:
        self.demo = demo
        self._app = app
        self._finder = finder
        self._wanted = wanted
        self._read_only = read_only
        self._failed: dict[str, str] = {}  # by key, why it could not be opened: not tried again by itself

    @property
    def first_screen(self) -> LoggersScreen:
        """What is shown until a logger is found."""
        return LoggersScreen("" if self.demo is not None else self._wanted)

    @property
    def own_name(self) -> str:
        """How events speak of us."""
        return self._finder.own_name

    async def search(self) -> None:
        """Looks until the logger that is meant is there, and opens it."""
        if self.demo is not None:
            await asyncio.to_thread(self.demo.start)
        while True:
            found, problem = await self._look()
            if self.demo is not None:
                problem = self.demo.ended() or problem
            chosen = self._choice(found.loggers)
            if chosen is not None and not problem and await self.open(chosen):
                return
            screen = self._app.screen
            if isinstance(screen, LoggersScreen):
                problems = [problem, *(self._failed.get(each.key, "") for each in found.loggers)]
                # of several of one name one is to be chosen; else all are shown
                screen.show(
                    self._named(found.loggers) or found.loggers, found.advice, "\n\n".join(filter(None, problems))
                )
            await asyncio.sleep(DEMO_LOOK_S if self.demo is not None and not problem else LOOK_S)

    async def show_list(self) -> None:
        """Lists the loggers as long as the list is on the screen."""
        screen = LoggersScreen()
        await self._app.push_screen(screen)
        while self._app.screen is screen:
            found, problem = await self._look()
            if self._app.screen is screen:
                screen.show(found.loggers, found.advice, problem)
            await asyncio.sleep(LOOK_S)

    async def open(self, logger: FoundLogger) -> bool:
        """Opens a logger on a new table; False when it doesn't answer, which is remembered and shown."""
        app = self._app
        await self.let_go()
        session = Session(logger.name)
        app.take_session(session)
        screen = TableScreen(session, read_only=self._read_only)
        while len(app.screen_stack) > 2:
            await app.pop_screen()
        await app.switch_screen(screen)
        try:
            await self._attach(session, logger)
        except (SiloError, OSError) as error:
            self._failed[logger.key] = f"{logger.name} (pid {logger.pid}): {error}"
            app.take_session(None)
            await app.switch_screen(self.first_screen)
            return False
        self._failed.pop(logger.key, None)
        app.table_changed()
        app.status_changed()
        return True

    async def let_go(self) -> None:
        """Closes the logger that is open; in a thread, because a frozen one takes seconds."""
        if self._app.has_session:
            await asyncio.to_thread(self._app.session.close)
            self._app.take_session(None)

    async def _attach(self, session: Session, logger: FoundLogger) -> None:
        client = await asyncio.to_thread(self._finder.connect, logger)
        link = Link(client, self._app.post_message, self._app.rate_hz)
        try:
            await session.attach(link)
        except (SiloError, OSError):
            await asyncio.to_thread(link.close)
            raise

    async def _look(self) -> tuple[Found, str]:
        try:
            return await asyncio.to_thread(self._finder.find), ""
        except (SiloError, OSError) as error:
            return Found(()), str(error)

    def _choice(self, loggers: Sequence[FoundLogger]) -> FoundLogger | None:
        """The one that is opened without asking."""
        if self.demo is not None:
            return next((each for each in loggers if self.demo.owns(each.pid)), None)
        named = self._named(loggers)
        return named[0] if len(named) == 1 and named[0].key not in self._failed else None

    def _named(self, loggers: Sequence[FoundLogger]) -> list[FoundLogger]:
        """Those that are meant by NAME or NAME.PID."""
        wanted = self._wanted
        return [each for each in loggers if not wanted or wanted in {each.name, f"{each.name}.{each.pid}"}]
