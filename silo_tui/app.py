# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The app: which logger is open, which screen shows it, and the timers that bring its values to the screen."""

import asyncio
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from textual.app import App
from textual.command import CommandPalette

from silo.errors import RefusedError, SiloError
from silo.ipc.messages import Event, EventKind
from silo_tui import terminal, theme
from silo_tui.commands import flows
from silo_tui.commands.opening import Opener
from silo_tui.commands.palette import CommandProvider
from silo_tui.commands.runner import CommandRunner
from silo_tui.model import command_line
from silo_tui.screens.base import SiloScreen
from silo_tui.screens.table import TableScreen
from silo_tui.sessions.demo import Demo
from silo_tui.sessions.finder import Finder, FoundLogger
from silo_tui.sessions.link import Link, LinkChanged, LoggerEvent, ViewFailed
from silo_tui.sessions.live import LiveSource, Session

if TYPE_CHECKING:
    from silo_tui.sessions.recorded import FileSession


class SiloApp(App[None]):
    """silo-tui."""

    TITLE = "silo"
    CSS_PATH = "silo.tcss"
    ENABLE_COMMAND_PALETTE = True
    COMMAND_PALETTE_BINDING = "ctrl+p"
    COMMANDS: ClassVar[set[Any]] = {CommandProvider}

    def __init__(
        self,
        finder: Finder,
        *,
        name: str = "",
        demo: Demo | None = None,
        read_only: bool = False,
        rate_hz: float = 5.0,
        file: "FileSession | None" = None,
    ) -> None:
        super().__init__()
        for each in theme.THEMES:
            self.register_theme(each)
        # Textual took TEXTUAL_THEME as it was before ours were known: only a change makes it look again
        self.theme = "textual-dark"
        self.theme = theme.chosen() if theme.chosen() in self.available_themes else theme.DARK.name
        self.animation_level = "none"
        self.rate_hz = rate_hz
        self._opener = Opener(self, finder, name, demo, read_only=read_only)
        self._read_only = read_only
        self._session: Session | None = None
        self._file = file  # shown instead of a logger
        self._flow_running = False
        self._news = asyncio.Lock()  # events are followed in their order
        self.script_names: tuple[str, ...] = ()

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Our colours in themes that don't have them."""
        return theme.FALLBACK

    # --------------------------------------------------------------------------------------- what others ask of us

    @property
    def has_session(self) -> bool:
        """Whether a logger is open."""
        return self._session is not None

    @property
    def session(self) -> Session:
        """The logger that is open. RefusedError when there is none."""
        if self._session is None:
            raise RefusedError("no logger is open")
        return self._session

    @property
    def link(self) -> Link:
        """The connection to it."""
        link = self.session.link
        if link is None:
            raise RefusedError(f"not connected to {self.session.name} yet")
        return link

    @property
    def source(self) -> LiveSource:
        """Where plots get their data."""
        return LiveSource(self.session)

    @property
    def table_screen(self) -> TableScreen:
        """The table of the logger that is open. RefusedError when there is none."""
        for screen in self.screen_stack:
            if isinstance(screen, TableScreen):
                return screen
        raise RefusedError("no logger is open")

    def may_write(self, label: str) -> bool:
        """Whether something that changes the logger may be done; says why not."""
        if not self.has_session:
            return False
        if self._read_only:
            self.say(f"{label}: this is a read-only session (--read-only)")
            return False
        if not self.session.may_edit:
            self.say(f"{label}: {self.session.status.user or 'its user'} lets you watch this logger, not change it")
            return False
        return True

    def may_ask(self, label: str) -> bool:
        """Whether the logger answers; says so when it doesn't."""
        if not self.has_session or self.session.connected:
            return True
        self.say(f"{label}: no link to {self.session.name}; it is tried again by itself")
        return False

    def say(self, words: str) -> None:
        """Shows the result of something on the screen below any dialog."""
        if (screen := self.upper_screen) is not None:
            screen.say(words)

    def fail(self, words: str) -> None:
        """Shows an error; behind a dialog, its first line stays on the screen below."""
        if self.screen.is_modal:
            self.say(words.partition("\n")[0])
        self.notify(words, severity="error", timeout=6, markup=False)

    def table_changed(self) -> None:
        """Tells the screens."""
        if self.has_session:
            self.session.rows.refresh()
        self._tell(lambda screen: screen.table_changed())

    def status_changed(self) -> None:
        """Tells the screens."""
        self._tell(lambda screen: screen.status_changed())

    # ------------------------------------------------------------------------------------------------- beginning

    async def on_mount(self) -> None:
        """A screen at once, the search behind it."""
        loop = asyncio.get_running_loop()
        if not self.is_headless:
            terminal.end_on_signals(loop, self.exit, self.release)
        if self._file is not None:
            await self._show_file(self._file)
            return
        await self.push_screen(self._opener.first_screen)
        self.set_interval(1 / self.rate_hz, self._poll)
        self.set_interval(1.0, self._second)
        self.run_worker(self._opener.search(), group="search", exclusive=True)

    async def _show_file(self, file: "FileSession") -> None:
        """A log that was opened; nothing of it changes by itself."""
        from silo_tui.screens.file_table import FileTableScreen

        self.take_session(file)
        await self.push_screen(FileTableScreen(file))
        self.table_changed()
        self.status_changed()

    def take_session(self, session: Session | None) -> None:
        """Another logger is open, or none."""
        self._session = session

    def open_logger(self, logger: FoundLogger) -> None:
        """Opens a logger from the list; asks when edits are pending."""
        self.run_flow(flows.open_other(self, logger))

    async def open_now(self, logger: FoundLogger) -> None:
        """Opens a logger; the search for one ends."""
        self.workers.cancel_group(self, "search")
        if not await self._opener.open(logger):
            self.run_worker(self._opener.search(), group="search", exclusive=True)

    # ---------------------------------------------------------------------------------------------------- timers

    def _poll(self) -> None:
        """Brings the newest values to the screen, unless the terminal doesn't keep up."""
        session = self._session
        if session is None or session.link is None or terminal.backed_up(self):
            return
        frame = session.poll()
        if frame is None:
            return
        session.take_values(frame)
        if frame.running != session.running and not session.dead:
            self.run_worker(self._refresh_status(), group="status", exclusive=True)
        if (screen := self.upper_screen) is not None:
            screen.live_changed(frame)

    def _second(self) -> None:
        if terminal.backed_up(self):
            return
        if (screen := self.upper_screen) is not None:
            screen.second_passed()
        session = self._session
        if session is None or session.link is None:
            return
        if session.lost_since is not None and session.link.connected:
            self.run_worker(self._regain(session), group="regain")  # it came back, but didn't answer at once

    async def _refresh_status(self) -> None:
        await self._quietly(self.session.refresh_status())
        self.status_changed()

    # ------------------------------------------------------------------------------------------ what links report

    def on_link_changed(self, message: LinkChanged) -> None:
        """Lost, or back."""
        session = self._session
        if session is None or message.link is not session.link:
            return
        if message.connected:
            self.run_worker(self._regain(session), group="regain", exclusive=True)
        else:
            session.lose()
            self.status_changed()

    async def _regain(self, session: Session) -> None:
        async def follow() -> None:
            self.say(await session.regain())

        await self._quietly(follow())
        self.table_changed()
        self.status_changed()
        self._tell(lambda screen: screen.wish_again())

    def on_logger_event(self, message: LoggerEvent) -> None:
        """Somebody did something, or something happened. Followed in a worker: asking takes time, keys don't wait."""
        session = self._session
        if session is not None and message.link is session.link:
            self.run_worker(self._take_event(session, message.event), group="news")

    async def _take_event(self, session: Session, event: Event) -> None:
        async with self._news:
            await self._quietly(session.take_event(event))
        if event.kind is EventKind.SAVE_FAILED and not self.screen.is_modal:
            self.fail(event.text)
        elif event.kind is not EventKind.SAVING and event.by != self._opener.own_name:
            self.say(event.text + (f" ({event.by})" if event.by else ""))
        if event.kind is not EventKind.SAVING:
            self.table_changed()
            self.status_changed()

    def on_view_failed(self, message: ViewFailed) -> None:
        """No live values, and why; a lost link has its banner."""
        session = self._session
        if session is not None and session.connected and message.link is session.link:
            self.say(f"no live values: {message.error}")

    # ----------------------------------------------------------------------------------------------------- commands

    def run_flow(self, flow: Coroutine[Any, Any, None]) -> None:
        """Runs a flow; one at a time."""
        if self._flow_running:
            flow.close()
            self.say("still busy with the last command")
            return
        self._flow_running = True
        self.run_worker(self._guarded(flow), group="flow")

    async def _guarded(self, flow: Coroutine[Any, Any, None]) -> None:
        try:
            await flow
        except RefusedError as error:
            problems = getattr(error, "problems", None) or []
            lines = [f"element '{problem.name}': {problem.reason}" for problem in problems[:6]]
            self.fail("\n".join([str(error), *(line for line in lines if line not in str(error))]))
        except (SiloError, OSError) as error:
            self.fail(str(error))
        finally:
            self._flow_running = False
            self.table_changed()
            self.status_changed()

    async def _quietly(self, job: Coroutine[Any, Any, None]) -> None:
        """Follows up on something that was reported; a link that breaks meanwhile has its banner."""
        try:
            await job
        except (SiloError, OSError) as error:
            if self.has_session and self.session.connected:
                self.say(str(error))

    def command_start_stop(self) -> None:
        self.run_flow(flows.start_stop(self))

    def command_restart(self) -> None:
        self.run_flow(flows.restart(self))

    def command_apply(self) -> None:
        self.run_flow(flows.apply(self))

    def command_load_script(self) -> None:
        self.run_flow(flows.load_script(self))

    def command_save_script(self) -> None:
        self.run_flow(flows.save_script(self))

    def command_save_data(self) -> None:
        from silo_tui.screens.save_data import SaveDialog

        self.push_screen(SaveDialog(self.session.status.folder))

    def command_quit(self) -> None:
        self.run_flow(flows.leave(self))

    def command_quit_now(self) -> None:
        self.exit()

    def command_help(self) -> None:
        from silo_tui.screens.help import HelpScreen

        scope = self.screen.scope if isinstance(self.screen, SiloScreen) else ""
        self.push_screen(HelpScreen(scope))

    def command_palette(self) -> None:
        if not isinstance(self.screen, CommandPalette):
            self.push_screen(CommandPalette(id="--command-palette"))

    def command_loggers(self) -> None:
        self.run_worker(self._opener.show_list(), group="search", exclusive=True)

    def command_demo(self) -> None:
        if self._opener.demo is None:
            self._opener.demo = Demo()
        self.run_worker(self._opener.search(), group="search", exclusive=True)

    def reload(self) -> None:
        """Reads the table again."""
        self.run_flow(self.session.reload())

    def back_to_table(self) -> None:
        """From the list to the logger that is open, if one is."""
        if self.has_session and len(self.screen_stack) > 2:
            self.pop_screen()

    def leave_screen(self) -> None:
        """Back to the screen below, which says again what it wants to see."""
        self.pop_screen()
        if (screen := self.upper_screen) is not None:
            screen.table_changed()
            screen.status_changed()
            screen.wish_again()

    def open_monitor(self, names: Sequence[str], chosen: str = "") -> None:
        """Plots of these elements, one of them chosen."""
        from silo_tui.screens.monitor import MonitorScreen

        self.push_screen(MonitorScreen(self.session, self.source, names, chosen))

    # ---------------------------------------------------------------------------------------------- command line

    def learn_scripts(self) -> None:
        """Asks for the names of the scripts, for completion."""
        self.run_worker(self._quietly(self._learn_scripts()), group="scripts", exclusive=True)

    async def _learn_scripts(self) -> None:
        scripts = await self.link.read(lambda client: client.scripts())
        self.script_names = tuple(scripts.names)

    @property
    def command_words(self) -> list[str]:
        """What can be typed after `:`."""
        return CommandRunner.words()

    def command_arguments(self, line: str) -> Mapping[str, Sequence[str]]:
        """What the command being typed takes."""
        return CommandRunner(self).arguments(line)

    def run_command(self, line: str) -> None:
        """Carries out a command line."""
        try:
            CommandRunner(self).run(command_line.read(line))
        except (ValueError, SiloError) as error:
            self.fail(str(error))

    # ------------------------------------------------------------------------------------------------------ inside

    @property
    def upper_screen(self) -> SiloScreen | None:
        """The uppermost full screen, below any dialog."""
        return next((screen for screen in reversed(self.screen_stack) if isinstance(screen, SiloScreen)), None)

    def _tell(self, news: Callable[[SiloScreen], None]) -> None:
        for screen in self.screen_stack:
            if isinstance(screen, SiloScreen) and screen.is_mounted:
                news(screen)

    def release(self) -> None:
        """Ends what we started: the demo's process and the connection."""
        if self._opener.demo is not None:
            self._opener.demo.stop()
        if self._session is not None:
            self._session.close()
