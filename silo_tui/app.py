# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The app: it puts context, screens and commands together, and brings what a logger reports to the screens."""

import asyncio
import gc
import os
import shlex
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, cast

from textual import events
from textual.app import App
from textual.command import CommandPalette
from textual.filter import LineFilter

from silo.core.episodes.words import said_by
from silo.net.access.senders import is_by
from silo.rpc.published import Event, EventKind
from silo_tui import terminal, theme
from silo_tui.actions import FILE_SCOPES, key_of
from silo_tui.commands import flows
from silo_tui.commands.opening import Opener
from silo_tui.commands.palette import CommandProvider
from silo_tui.commands.runner import CommandRunner
from silo_tui.context import Context
from silo_tui.gate import Gate
from silo_tui.keymap import use_keys
from silo_tui.menus import MenuReader
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.drawing import dots
from silo_tui.model.table.fields import Field
from silo_tui.model.words.command_line import BY_KEY, Spelled, folder_here
from silo_tui.sessions.demo import Demo
from silo_tui.sessions.finder import ClientFinder
from silo_tui.sessions.link import LinkChanged, LoggerEvent, ViewFailed
from silo_tui.sessions.live import Session
from silo_tui.settings.file import SettingsProblem
from silo_tui.settings.options import Settings
from silo_tui.terminal.printable import Printable
from silo_tui.tour import Tour
from silo_tui.unforeseen import Guarded, Unforeseen

if TYPE_CHECKING:
    from silo_tui.context import SiloScreen
    from silo_tui.sessions.recorded import FileSession


FIRST_LOOK_S, MOST_LOOKS = 0.01, 50  # how often is looked for the first values of a logger
START_S = 2.0  # after which garbage is looked for
BEHIND_HZ = 1.0  # how often values are painted behind a dialog
PRINTABLE = Printable()
HOMES = ("table", "file", "loggers")  # where `go_home` ends
# what is said elsewhere: by progress, by the head and the alarms
QUIET_KINDS = {EventKind.SAVING, EventKind.LIMIT, EventKind.LIMIT_ENDED, EventKind.CRASHED}  # a crash has its banner


def _collect_from_now() -> None:
    """Look for garbage again, not among what was loaded: that stays."""
    gc.freeze()
    gc.enable()


class SiloApp(Guarded, App[None]):
    """silo-tui."""

    TITLE = "silo"
    CSS_PATH = "silo.tcss"
    ENABLE_COMMAND_PALETTE = True
    COMMAND_PALETTE_BINDING = "ctrl+p"
    COMMANDS: ClassVar[set[Any]] = {CommandProvider}

    def __init__(
        self,
        finder: ClientFinder,
        *,
        name: str = "",
        demo: Demo | None = None,
        read_only: bool = False,
        rate_hz: float = 5.0,
        file: "FileSession | None" = None,
        view: str = "",
        settings: Settings | None = None,
        settings_problems: Sequence[SettingsProblem] = (),
    ) -> None:
        # without colours the terminal's own two are left as they are, and no shades of grey are sent instead
        super().__init__(driver_class=terminal.driver_class(), ansi_color=True if "NO_COLOR" in os.environ else None)
        for each in theme.THEMES:
            self.register_theme(each)
        # Textual took TEXTUAL_THEME as it was before ours were known: only a change makes it look again
        self.theme = "textual-dark"
        settings = settings or Settings()
        self.theme = theme.chosen(settings.theme, self.available_themes)
        # the sheet is read with this theme, so that it need not be read again: a tenth of what follows the imports
        self.stylesheet.set_variables(self.get_css_variables())
        self._is_read = False
        self.animation_level = "none"
        self.context = Context(self, read_only=read_only, settings=settings, settings_problems=settings_problems)
        self.context.runner = CommandRunner(self.context)
        self.context.came_back = self._catch_up
        self.context.take_up = lambda: self.context.run_flow(flows.take_up_edits(self.context), asks_robot=False)
        use_keys(settings.keymap, settings.keys)
        self._finder = finder
        self._opener = Opener(self.context, finder, name, demo, rate_hz, view)
        self.context.left = self._opener.quit
        self.context.has_demo = lambda: self._opener.demo is not None
        self._rate_hz = rate_hz
        self._file = file  # shown instead of a logger
        self._thin_words = ""
        self._news = asyncio.Lock()  # events are followed in their order
        self.unforeseen = Unforeseen()
        self.gate = Gate(self)
        self.reader = MenuReader(self, lambda: terminal.pace_of(self) == terminal.Pace())

    async def on_event(self, event: events.Event) -> None:
        """Let what is typed in by the gate; what no key of a full screen is goes to what has the focus."""
        is_typed = isinstance(event, events.Key | events.Paste) and not event.is_forwarded
        if is_typed and not self.screen_stack:
            return  # what the gate still had when the last screen went is for nobody
        typed = cast("events.Key | events.Paste", event)
        if not is_typed or not (self.gate.keeps(typed) or self.reader.takes(typed)):
            await super().on_event(event)

    def refresh_css(self, animate: bool = True) -> None:
        """Follow a change of the theme; not that of the beginning."""
        if self._is_read:
            super().refresh_css(animate)
        self._is_read = True

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Of all that is painted: nothing moves the terminal's cursor."""
        return [*super().get_line_filters(), PRINTABLE]

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Return our colours for themes that don't have them."""
        return theme.FALLBACK

    # ------------------------------------------------------------------------------------------ beginning and end

    async def on_mount(self) -> None:
        """Show a screen at once; search behind it."""
        loop = asyncio.get_running_loop()
        if not gc.isenabled():
            self.set_timer(START_S, _collect_from_now)
        if not self.is_headless:
            terminal.end_on_signals(loop, self.exit, self.release)
        if self._file is not None:  # nothing of it changes by itself
            from silo_tui.screens.files.file_table import FileTableScreen

            self.context.take_session(self._file)
            await self.push_screen(FileTableScreen(self._file))
            self.context.table_changed()
            self.context.status_changed()
            self.context.say(self.context.settings_trouble)
            return
        only = await self._opener.only_one()
        if only is None:
            await self.push_screen(self._opener.first_screen)
        self._polling = self.set_interval(1 / self._rate_hz, self._poll)
        self.set_interval(1.0, self._second)
        self._opener.search_on(only)

    def _handle_exception(self, error: Exception) -> None:
        """Tell of what nobody foresaw, and go on; only where there is no screen to tell it on, end."""
        words = self.unforeseen.words(error)
        screen = self.context.upper_screen
        if screen is None or not screen.is_there:
            super()._handle_exception(error)
        elif words:
            self.call_next(self.context.fail, words)  # from its own turn: what failed may be the screen it is told on

    def release(self) -> str:
        """End what was started: the demo's process and the connection; return how the logger that was open is left."""
        demo, session = self._opener.demo, self.context.logger_session
        # one that died says where its data is
        ends = self.context.has_demo() and session is not None and not session.dead
        words = flows.left_words(session) if session is not None and not ends else ""
        if demo is not None:
            demo.stop()
        if self.context.has_session:
            self.context.keep_edits()
            if session is not None:
                session.close()
        return "\n".join(filter(None, [words, demo.farewell if demo is not None else ""]))

    # ---------------------------------------------------------------------------------------------------- timers

    @property
    def _live_session(self) -> Session | None:
        """The logger that is open and was reached; None for a file too."""
        session = self.context.session if self.context.has_session else None
        return session if session is not None and session.link is not None else None

    async def first_values(self) -> None:
        """Bring the first values of a logger as they come, and how its conditions stand."""
        self._ask_for_conditions()
        session = self._live_session
        for _ in range(MOST_LOOKS):
            self._poll()
            if session is None or session is not self._live_session or session.live.readings:
                return
            if not session.table.server[Field.ENABLED].any():
                return  # nothing is logged of which values could come
            await asyncio.sleep(FIRST_LOOK_S)

    def _poll(self) -> None:
        """Bring the newest values to the screen, as often as the terminal takes them."""
        session = self._live_session
        # behind a dialog Textual draws the whole screen anew each time: 38 % of a processor at 160x50, so 30 %
        paint = terminal.may_paint(self, min(self._rate_hz, BEHIND_HZ) if self.screen.is_modal else self._rate_hz)
        if session is None:
            return
        frame = session.poll()
        if frame is None:
            return
        session.take_values(frame)
        if not paint:
            return
        if frame.running != session.running and not session.dead:
            run_alone(self, "status", self._follow, session.refresh_status)
        self.context.tell_upper(lambda screen: screen.live_changed(frame))
        words = terminal.thin_words(self, self._rate_hz)
        if words != self._thin_words:
            self._thin_words = words
            self.context.hear(words or "the link is good again: everything is shown")

    def _second(self) -> None:
        if terminal.backed_up(self):
            return
        self.context.tell_upper(lambda screen: screen.second_passed())
        self._opener.keep_view()
        self._ask_for_conditions()
        session = self._live_session
        if session is not None and session.lost_since is not None and session.link and session.link.connected:
            # it came back, but didn't answer at once: asked again when it has given up on that, else calls queue up
            if all(one.is_finished for one in self.workers if one.group == "regain"):
                run_aside(self, "regain", self._regain, session)
        elif session is not None and session.running and session.connected and session.status.durable_ticks >= 0:
            # no frame tells what is durable
            run_alone(self, "status", self._follow, session.refresh_status)

    def _ask_for_conditions(self) -> None:
        session = self._live_session
        if session is not None and session.conditions_due and session.fresh:
            run_alone(self, "conditions", self._follow, partial(self._learn_conditions, session))

    async def _learn_conditions(self, session: Session) -> None:
        await session.refresh_conditions()
        self.context.status_changed()
        await self._opener.first_shown.wait()  # for what is kept all of expressions is loaded, a tenth of a start
        with self.context.telling("limits and triggers can't be kept for the next start"):
            if told := session.lent.keep():
                self.context.say(told)  # beside the news that it started

    async def _follow(self, ask: Callable[[], Coroutine[Any, Any, None]]) -> None:
        with self.context.quiet():
            await ask()
        self.context.status_changed()

    # ------------------------------------------------------------------------------------------ what links report

    def on_link_changed(self, message: LinkChanged) -> None:
        """Follow a link that was lost, or is back."""
        session = self._live_session
        if session is None or message.link is not session.link:
            return
        self._follow_link(session, message.connected)

    def _catch_up(self) -> None:
        """Follow what happened in the logger while a file lay over it."""
        session = self._live_session
        if session is not None and session.link is not None:
            self._follow_link(session, session.link.connected)

    def _follow_link(self, session: Session, is_there: bool) -> None:
        if is_there:  # quiet where nobody was told that it was lost, or all was read since
            run_alone(self, "regain", self._regain, session, quiet=session.lost_since is None)
        else:
            session.lose()
            self.context.status_changed()

    async def _regain(self, session: Session, *, quiet: bool = False) -> None:
        with self.context.quiet():
            before = session.status
            words = await session.regain()
            is_new = not before.is_of_program(session.status)
            if is_new:
                self.context.tell(lambda screen: screen.say(""))  # what was answered was of the program that is gone
            if is_new or not quiet:
                self.context.hear(words)
        self.context.table_changed()
        self.context.status_changed()
        self.context.tell(lambda screen: screen.request_view())

    def on_logger_event(self, message: LoggerEvent) -> None:
        """Follow what somebody did, or what happened, in a worker: asking takes time, keys don't wait."""
        session = self._live_session
        if session is not None and message.link is session.link:
            run_aside(self, "news", self._take_event, session, message.event)

    async def _take_event(self, session: Session, event: Event) -> None:
        context = self.context
        async with self._news:
            await context.quietly(session.take_event(event))
        own = is_by(event.by, self._finder.own_name)  # whoever asked tells how it went
        if event.kind is EventKind.CRASHED:
            context.forget_news()
            context.tell(lambda screen: screen.show_said(""))  # answers from before, as "nothing was saved"
            context.note(session.table.shown(event.text), is_news=True)  # the banner tells it meanwhile
        if event.kind is EventKind.SAVE_FAILED and not own and not self.screen.is_modal:
            context.fail(event.text)
        elif event.kind not in QUIET_KINDS and not own and not session.tells_no_change(event):
            is_mark = event.kind is EventKind.MARKER and said_by(event.text) is None
            told = f'marker "{event.text}"' if is_mark else session.told(event.text)
            of = f"{event.kind.value} {event.about}" if event.about else ""
            context.hear(told + (f" ({event.by})" if event.by else ""), of=of)
        if event.kind is not EventKind.SAVING:
            context.table_changed()
            context.status_changed()

    def on_view_failed(self, message: ViewFailed) -> None:
        """Say why there are no live values; a lost link has its banner."""
        session = self._live_session
        if session is not None and session.connected and message.link is session.link:
            self.context.hear(f"no live values: {message.error}")

    # ----------------------------------------------------------------------------------------------------- commands

    def command_menus(self, menu: str = "menus") -> None:
        self.reader.open(menu)

    def command_again(self, way: str = "") -> None:
        self.reader.again(turned=way == "back")

    def command_suspend(self) -> None:
        self.action_suspend_process()

    def command_refresh(self) -> None:
        terminal.repaint(self)
        self.context.run_flow(self.context.session.reload())

    def command_detail(self) -> None:
        self.show_large("time")

    def show_large(self, mode: str) -> None:
        """Show the chosen plot alone in a view."""
        from silo_tui.screens.plots.detail import open_large
        from silo_tui.screens.plots.monitor import MonitorScreen

        if isinstance(self.screen, MonitorScreen):
            open_large(self.screen, mode)

    def command_triggers(self) -> None:
        from silo_tui.screens.lists.triggers import TriggersScreen

        self._go_aside("triggers", TriggersScreen)

    def command_alarms(self) -> None:
        from silo_tui.screens.lists.alarms import AlarmsScreen

        self._go_aside("alarms", AlarmsScreen)

    def command_parameters(self) -> None:
        from silo_tui.screens.lists.parameters import ParametersScreen

        self._go_aside("parameters", ParametersScreen)

    def _go_aside(self, scope: str, kind: "Callable[[Session], SiloScreen]") -> None:
        """Go to triggers, alarms, parameters, recordings or events; from one of them to another in its place."""
        screen = self.context.upper_screen
        if screen is None or screen.scope == scope or not self.context.has_session:
            return
        if screen.aside:
            self.pop_screen()
        self.push_screen(kind(self.context.session))

    def command_go_home(self) -> None:
        upper = self.context.upper_screen
        if upper is not None and upper.scope == "file" and self.context.file_over_logger:
            self.context.leave_file()  # from the table of a file to that of the logger behind it
        while (screen := self.context.upper_screen) is not None and not self._is_home(screen):
            self.context.leave_screen()
        behind = self.context.logger_session
        if screen is not upper and self.context.file_over_logger and behind is not None:
            self.context.say(f"the table of the file; {key_of('go_home')} again: {behind.name}")

    def _is_home(self, screen: "SiloScreen") -> bool:
        """Whether one goes no further back: a table, or the list of loggers where none is open."""
        over_table = screen.scope == "loggers" and self.context.has_session and len(self.screen_stack) > 2
        return screen.scope in HOMES and not over_table

    def command_settings(self) -> None:
        from silo_tui.screens.lists.settings import SettingsScreen

        if isinstance(self.screen, SettingsScreen):
            self.screen.command_back()
        else:
            self.push_screen(SettingsScreen(self.take_settings))

    def take_settings(self, settings: Settings) -> None:
        """Let everything follow other settings at once."""
        old, self.context.settings = self.context.settings, settings
        if settings.theme != old.theme:
            self.theme = theme.theme_name(settings.theme)
        dots.choose(settings.dots)
        if settings.mouse != old.mouse:
            terminal.take_mouse(self, wanted=terminal.mouse_wanted(settings.mouse))
        if (settings.keymap, settings.keys) != (old.keymap, old.keys):
            use_keys(settings.keymap, settings.keys)
        if settings.rate != old.rate and self._file is None:
            self._opener.rate_hz = self._rate_hz = settings.rate
            self._polling.stop()
            self._polling = self.set_interval(1 / settings.rate, self._poll)
            if (session := self._live_session) is not None and session.link is not None:
                session.link.set_rate(settings.rate)
        self.context.tell(lambda screen: screen.settings_changed())
        self.context.tell(lambda screen: screen.update_keys())

    def command_recordings(self) -> None:
        from silo_tui.screens.lists.recordings import RecordingsScreen

        self._go_aside("recordings", RecordingsScreen)

    def command_runs(self, typed: Spelled = BY_KEY) -> None:
        from silo_tui.screens.lists.runs import RunsScreen

        if self.context.file_over_logger:
            self.context.leave_file()
        folder = self.context.session.status.folder if self.context.has_session else ""
        if isinstance(self.screen, RunsScreen):
            self.pop_screen()
        self.push_screen(RunsScreen(typed.rest or (folder if os.path.isdir(folder) else ".")))  # noqa: PTH112

    def command_tour(self) -> None:
        context = self.context
        if context.tour is None and not context.has_session:
            context.say(f"the tour needs a logger: {key_of('demo')} starts the demo")
            return
        context.tour = Tour() if context.tour is None else None
        if context.tour is not None and (upper := context.upper_screen) is not None and not self._is_home(upper):
            self.command_go_home()  # its steps begin at the table
        context.say("")  # that it ended, a moment ago
        context.tell_upper(lambda screen: screen.show_news(context.news))

    def command_messages(self) -> None:
        from silo_tui.screens.lists.messages import MessagesScreen

        if not isinstance(self.screen, MessagesScreen):
            self.push_screen(MessagesScreen())

    def command_set_marker(self) -> None:
        from silo_tui.screens.dialogs.marking import ask_mark

        session = self.context.session
        ask_mark(self.context, session.frame_time_ns or session.status.last_tick_ns)

    def command_excite(self, typed: Spelled = BY_KEY) -> None:
        from silo_tui.screens.lists.parameters import ParametersScreen
        from silo_tui.screens.plots.responses import excite

        here = self.screen.chosen if isinstance(self.screen, ParametersScreen) else None
        name = typed.first or (here.name if here is not None else "")
        self.context.run_flow(excite(self.context, name, " ".join(typed.arguments[1:])))

    def command_bode(self, typed: Spelled = BY_KEY) -> None:
        from silo_tui.screens.plots.responses import show_response

        session = getattr(self.context.upper_screen, "session", self.context.session)
        self.context.run_flow(show_response(self.context, session, typed.arguments))

    def command_episode(self, typed: Spelled = BY_KEY) -> None:
        from silo_tui.screens.dialogs.marking import ask_episode

        if typed.arguments:
            self.command_say_of_episode(typed.first, " ".join(typed.arguments[1:]))
        else:
            ask_episode(self.context)

    def command_say_of_episode(self, word: str, name: str = "") -> None:
        from silo_tui.screens.dialogs.marking import say_of_episode

        run_aside(self, "mark", say_of_episode, self.context, word, name)

    def open_left(self, names: Sequence[str] = ()) -> None:
        """Open what a robot program that died left, with plots of these elements where some are named."""
        from silo_tui.screens.files.opened import open_saved

        session = self.context.session

        def plotted(file: "FileSession") -> list[str]:
            return [name for name in names if name in file.table.names]

        what = f"opening what {session.name} left"
        self.context.open_over(self, what, open_saved, self.context, session, session.left_files, plotted)

    def command_events(self) -> None:
        from silo_tui.screens.lists.events import EventsScreen

        screen = self.context.upper_screen
        if screen is not None and screen.scope in FILE_SCOPES:
            # of the file that is looked at, which needn't be the open one: a capture lies over its logger
            self.push_screen(EventsScreen(getattr(screen, "session", self.context.session)))
        else:
            self._go_aside("events", EventsScreen)

    def command_quit(self) -> None:
        if self.context.file_over_logger:
            self.context.leave_file()  # what is pending in the logger is asked for there
        self.context.run_flow(flows.leave(self.context), asks_robot=False)

    def command_quit_now(self) -> None:
        self.context.left()
        self.exit()

    async def action_quit(self) -> None:
        """Quit by Textual's own key, which counts over dialogs: on purpose, too."""
        self.command_quit_now()

    def command_help(self) -> None:
        from silo_tui.screens.lists.help import HelpScreen

        screen = self.context.upper_screen
        if screen is not None and not isinstance(self.screen, HelpScreen):
            self.push_screen(HelpScreen(screen.scope, screen.action_command))

    def command_command(self) -> None:
        self.begin_command("")

    def begin_command(self, word: str) -> None:
        """Open the command line over any screen, with a word typed already."""
        from silo_tui.screens.dialogs.questions import CommandLine

        def run(line: str | None) -> None:
            if line and line.strip(": "):
                self.context.runner.run(line)

        screen = self.context.upper_screen
        on_file = screen is not None and screen.scope in FILE_SCOPES
        begun = f"{word} " if word else ""
        session = self._live_session if word == "open" else None
        if session is not None and session.left_files:
            begun += shlex.quote(session.left_files[0].path)  # of a dead robot
        elif session is not None:  # on with a name in the folder where the logger saves
            folder = folder_here(session.status.folder)
            begun += folder if folder == shlex.quote(folder) else ""
        words = "goto filter sort picture theme help quit" if on_file else "view theme start stop help quit"
        if screen is not None and screen.scope == "table":
            words = "load save set goto sort data start stop help quit"
            self.context.learn_scripts()
        runner = self.context.runner
        self.push_screen(CommandLine(runner.complete, words, begun, runner.usage), run)

    def command_palette(self) -> None:
        if not isinstance(self.screen, CommandPalette):
            self.push_screen(CommandPalette(id="--command-palette"))

    def command_loggers(self) -> None:
        terminal.repaint(self)
        self._opener.list_on()

    def command_look_again(self) -> None:
        terminal.repaint(self)
        self._opener.try_again()
        self.context.say("looking for loggers again")  # mostly nothing else changes on the screen

    def command_demo(self) -> None:
        if self._opener.demo is None:
            self._opener.demo = Demo()
        self._opener.search_on()
