"""Finding a logger and opening it: at the beginning, from the list, and again after the robot program was restarted."""

import asyncio
import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from silo.errors import ConnectionLostError, RefusedError, SiloError, VersionError
from silo_tui.commands import flows
from silo_tui.commands.view_flows import LAST, view_left, view_shown
from silo_tui.context import Context
from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.modal import run_alone, settled
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.screens.table import TableScreen
from silo_tui.sessions.demo import Demo
from silo_tui.sessions.finder import ClientFinder, Found
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session
from silo_tui.sessions.target import also_a_file

if TYPE_CHECKING:
    from silo_tui.commands.many import Many
    from silo_tui.screens.lists.loggers import LoggersScreen

LOOK_S = 1.0
AT_ONCE_S = 0.3  # that the first screen waits for a look around
AGAIN_S = 5.0  # after a logger didn't answer: a link may be cut for a moment
DEMO_LOOK_S = 0.1


class Opener:
    """Looks for loggers in a thread and opens one: `wanted` is the name asked for, `demo` the one we started."""

    def __init__(
        self, context: Context, finder: ClientFinder, wanted: str, demo: Demo | None, rate_hz: float, view: str = ""
    ) -> None:
        self.demo = demo
        self._context = context
        self._app = context.app
        self.first_shown = asyncio.Event()  # a logger on its table
        self._finder = finder
        self._wanted = wanted
        self._view = view  # put on the screen of the first logger that is opened
        self.rate_hz = rate_hz
        self._many: Many | None = None
        self._kept: KeptLayout | None = None
        self._quits = False
        self._view_is_there = True  # not while a logger is being opened: what is kept of its view is yet to be shown
        self._failed: dict[str, str] = {}  # by key, why it could not be opened
        self._again_s: dict[str, float] = {}  # by key, when it is tried again; never, where that can't help

    @property
    def first_screen(self) -> "LoggersScreen":
        """What is shown until a logger is found."""
        screen = self._list("" if self.demo is not None else self._wanted)
        if self.demo is not None:
            screen.take((), (), starting=True)
        return screen

    def _list(self, wanted: str = "") -> "LoggersScreen":
        from silo_tui.commands.many import Many
        from silo_tui.screens.lists.loggers import LoggersScreen

        self._many = self._many or Many(self._context, lambda: self._finder)
        return LoggersScreen(self.choose, wanted, self._many.begin)

    @property
    def _list_here(self) -> "LoggersScreen | None":
        """The list of loggers, where it is on the screen."""
        screen = self._app.screen
        return cast("LoggersScreen", screen) if getattr(screen, "scope", "") == "loggers" else None

    def search_on(self, only: FoundLogger | None = None) -> None:
        """Begin the search, or begin it anew; with the one that `only_one` found."""
        run_alone(self._app, "search", self._search, only)

    async def only_one(self) -> FoundLogger | None:
        """Return the logger that is meant where the first look around tells of it at once: no list is made for it."""
        if self.demo is not None:
            return None
        try:
            found, problem = await asyncio.wait_for(self._look(), AT_ONCE_S)
        except asyncio.TimeoutError:
            return None
        return None if problem else self._choice(found.loggers)

    def try_again(self) -> None:
        """Try again also what could not be opened."""
        self._failed.clear()
        self._finder.look_again()
        if not self._context.has_session:
            self.search_on()

    def list_on(self) -> None:
        """Show the list of loggers; the search ends."""
        run_alone(self._app, "search", self._show_list)

    def choose(self, logger: FoundLogger) -> None:
        """Open a logger from the list; ask when edits are pending."""
        self._context.run_flow(self._open_chosen(logger), asks_robot=False)

    async def _open_chosen(self, logger: FoundLogger) -> None:
        if not await flows.may_leave(self._context):
            return
        self.leave_view()
        self._app.workers.cancel_group(self._app, "search")
        if not await self._open(logger):
            self.search_on()

    async def _search(self, only: FoundLogger | None) -> None:
        """Look until the logger that is meant is there, and open it."""
        if only is not None and await self._open(only):
            return
        if self.demo is not None:
            await asyncio.to_thread(self.demo.start)
        while True:
            found, problem = await self._look()
            if self.demo is not None:
                problem = self.demo.ended() or problem
            chosen = self._choice(found.loggers)
            if not self._app.screen_stack:
                return  # the program was ended meanwhile
            # not while settings or help are read, or a line is typed: opening would take them away, and what is typed
            # on would be keys of the table
            here = self._list_here is not None and not self._list_here.is_typing
            if chosen is not None and not problem and here and await self._open(chosen):
                return
            if not self._app.screen_stack:
                return
            if (screen := self._list_here) is not None:
                problems = [problem, *(self._failed.get(each.key, "") for each in found.loggers)]
                # of several of one name one is to be chosen; else all are shown
                meant = [each for each in found.loggers if each.is_meant_by(self._wanted)]
                fails = chosen is not None and chosen.key in self._failed
                starting = self.demo is not None and not self.demo.ended() and not fails
                words = "\n\n".join(filter(None, problems))
                screen.take(meant or found.loggers, found.advice, words, starting=starting)
            await asyncio.sleep(DEMO_LOOK_S if self.demo is not None and not problem else LOOK_S)

    async def _show_list(self) -> None:
        """List the loggers as long as the list is on the screen."""
        screen = self._list()
        await self._app.push_screen(screen)
        while self._app.screen is screen:
            found, problem = await self._look()
            if self._app.screen is screen:
                screen.take(found.loggers, found.advice, problem)
                session = self._context.logger_session
                for one in found.loggers:  # the table calls it as the list does: another one of its name may run by now
                    if session is not None and session.link is not None and one.key == session.link.logger_key:
                        session.address = one.address if one.alike else ""
            await asyncio.sleep(LOOK_S)

    async def _open(self, logger: FoundLogger) -> bool:
        """Open a logger on a new table; return False when it doesn't answer, which is remembered and shown."""
        app, context = self._app, self._context
        await self._let_go()
        if not app.screen_stack:
            return True  # the program was ended meanwhile
        session = Session(logger.name)
        session.own_name = self._finder.own_name
        session.address = logger.address if logger.alike else ""
        self._view_is_there = False
        context.take_session(session)
        screen = TableScreen(session)
        while len(app.screen_stack) > 2:
            await settled(app.pop_screen())
        shown = asyncio.Event()
        filling = asyncio.ensure_future(self._fill(screen, logger, shown))
        try:
            with app.batch_update():  # painted once, where the values come at once
                await settled((app.switch_screen if len(app.screen_stack) > 1 else app.push_screen)(screen))
                shown.set()
                await asyncio.wait([filling], timeout=AT_ONCE_S)
            app.call_after_refresh(self.first_shown.set)
            await filling
        except (SiloError, OSError) as error:
            self._failed[logger.key] = f"{logger.name} ({logger.where}): {error}"
            passes = isinstance(error, ConnectionLostError) and not isinstance(error, VersionError)
            self._again_s[logger.key] = time.monotonic() + AGAIN_S if passes else math.inf
            context.take_session(None)
            if app.screen_stack:
                await settled(app.switch_screen(self.first_screen))
            return False
        finally:
            filling.cancel()  # of an opening that was given up
        return True

    async def _fill(self, screen: TableScreen, logger: FoundLogger, shown: asyncio.Event) -> None:
        """Connect to a logger and bring all of it to its table, once that is shown."""
        app, context = self._app, self._context
        await self._attach(screen.session, logger)
        await shown.wait()
        self._failed.pop(logger.key, None)
        self._again_s.pop(logger.key, None)
        if not app.screen_stack:
            return
        self._finder.rest()
        words = await self._show_view()  # first: the question about edits that were kept stands above it
        self._view_is_there = True
        context.table_changed()
        context.status_changed()
        screen.request_view()  # at once: nobody scrolls yet
        demo = self.demo if self.demo is not None and self.demo.owns(logger.pid) else None
        begun = demo.begun_with(screen.session.status.script) if demo is not None else ""
        if words := "; ".join(filter(None, [context.settings_trouble, begun, words, also_a_file(self._wanted)])):
            context.say(words)
        await cast(Any, app).first_values()

    async def _show_view(self) -> str:
        """Put on the screen what was asked for, or what was left last; return what to say.

        What was left is only offered: who begins with a filter, or plots that stand still, that nobody asked for takes
        them for the logger.
        """
        context, view, wish = self._context, self._view, self._context.settings.view
        self._view, context.left_view = "", None
        try:
            left = files.left_last(context.session.name) if wish != "off" else None
            context.left_view = left
            if view:
                return await view_shown(context, view)
            if left is not None and wish == "always":
                return await view_left(context, left)
            if left is not None:
                return f"`:view {LAST}` shows what was on the screen {left.since}"
        except (RefusedError, ValueError, OSError) as error:
            return str(error)
        return ""

    def keep_view(self, *, at_end: bool = False) -> None:
        """Keep what is on the screen for the next time, if that is wished; until the end only once something is."""
        if not self._view_is_there or self._quits:
            return
        layout = views.capture(self._context) if self._context.settings.view != "off" else None
        if layout is None or (not at_end and layout == (self._kept or KeptLayout())):
            return
        self._kept = layout
        try:
            files.save(files.left_by_us(self._context.session.name), layout)
        except (SiloError, OSError) as error:
            self._context.say(str(error))

    def leave_view(self) -> None:
        """Keep what is on the screen of a logger that is left on purpose; what was offered before is older."""
        self.keep_view(at_end=True)
        left, session = self._context.left_view, self._context.logger_session
        if left is not None and session is not None and left.path != files.left_by_us(session.name):
            left.path.unlink(missing_ok=True)
        self._kept = None

    def quit(self) -> None:
        """Keep what is on the screen at the end; the last of the timers finds it as it is taken away."""
        self.leave_view()
        self._quits = True

    async def _let_go(self) -> None:
        """Close the logger that is open; in a thread, because a frozen one takes seconds."""
        if self._context.has_session:
            await asyncio.to_thread(self._context.session.close)
            self._context.take_session(None)

    async def _attach(self, session: Session, logger: FoundLogger) -> None:
        client = await asyncio.to_thread(self._finder.connect, logger)
        link = Link(client, self._app.post_message, self.rate_hz)
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
        """Return the one that is opened without asking."""
        if self.demo is not None:
            return next((each for each in loggers if self.demo.owns(each.pid)), None)
        named = self._named(loggers)
        # who has seen several, and is left with one, chose none of them
        gone = any(each.has_gone and each.is_meant_by(self._wanted) for each in loggers)
        only = named[0] if len(named) == 1 and not gone else None
        return only if only is not None and time.monotonic() >= self._again_s.get(only.key, 0.0) else None

    def _named(self, loggers: Sequence[FoundLogger]) -> list[FoundLogger]:
        """Return those that are meant by a name or an address; the dead only where none of them lives."""
        named = [each for each in loggers if each.member.here and each.is_meant_by(self._wanted)]
        return [each for each in named if not each.member.dead] or named
