"""What the app and its screens ask of one another.

`Context` is all that screens and commands see of the app, `SiloScreen` all that the app sees of a screen.

Screens, dialogs and commands import this and never `silo_tui.app`; it imports widgets and what stands below them.
"""

import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from typing import Any, ClassVar, cast

import msgspec
from textual import events
from textual.app import App, ComposeResult
from textual.dom import DOMNode

from silo.core.elements import SavedFile
from silo.core.quantities.writing import wall_clock
from silo.errors import RefusedError, SiloError
from silo.files.naming import files_text
from silo.net.access.senders import READ_ONLY_WORDS
from silo.rpc.frames import Frame
from silo_tui.actions import BY_ID, Command, key_of, key_that_retries, typed_on, with_keys
from silo_tui.gate import Holding
from silo_tui.keymap import where, why_no_use
from silo_tui.modal import Dialog, Given, Leaving, Work, run_alone, settled
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.sessions import kept
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session
from silo_tui.settings.file import SettingsProblem
from silo_tui.settings.options import Settings
from silo_tui.terminal import in_browser
from silo_tui.tour import Tour
from silo_tui.widgets import messages
from silo_tui.widgets.bars import OPEN_FILE, OPENS, Banner, KeyBar, StatusBar, left_a_file
from silo_tui.widgets.inputs import Fleeting
from silo_tui.widgets.messages import MessageLine

RELABELLED = {"again", "apply", "back", "closer", "start_stop"}
MOST_TOLD = 500


def gone_words() -> str:
    """Return that nobody is there to do what was asked, and the ways out."""
    others = f"{key_of('loggers')} lists other loggers, {key_of('demo')} there starts a demo"
    return f"the robot program is gone: start it again, silo-tui follows; {others}"


class Message(msgspec.Struct, frozen=True):
    """What was said once: when, and whether it is news of the robot or the answer to a key."""

    at_s: float
    words: str
    is_news: bool

    @property
    def clock(self) -> str:
        """When, as people write it."""
        return wall_clock(int(1e9 * self.at_s))


class News(msgspec.Struct, frozen=True):
    """What was heard and may not have been read: the newest of what it is `of`, and how often that came."""

    told: Message
    of: str = ""
    times: int = 1


PAGE_WORDS = "this page is read-only: one that `silo-tui --serve --control` serves changes, too; nothing was changed"


class Context:
    """The logger that is open, who may change it, where results are told, and one flow at a time."""

    def __init__(
        self,
        app: App[Any],
        *,
        read_only: bool,
        settings: Settings | None = None,
        settings_problems: Sequence[SettingsProblem] = (),
    ) -> None:
        self.app = app
        self.read_only = read_only
        self.runner: Any = None  # the `CommandRunner`, which imports this
        self.take_up: Callable[[], None] = lambda: None  # asks what becomes of edits that were kept
        self.settings = settings or Settings()
        self.settings_problems = tuple(settings_problems)
        self.saved_settings = self.begun_settings = self.settings  # as the file has them; as the app began
        self.script_names: tuple[str, ...] = ()
        self._session: Session | None = None
        self._behind: Session | None = None  # the logger behind a file that was opened over it
        self.left_view: Any = None  # what was on the screen of the logger when it was left: a `Left` of `layouts`
        self.left: Callable[[], None] = lambda: None  # is called when the app is ended on purpose
        self.has_demo: Callable[[], bool] = lambda: False  # whether the robot is one that ends with the app
        self.came_back: Callable[[], None] = lambda: None  # catches up with the logger behind a file
        self._flow_running = self._asks_robot = False  # whether there is one, and whether the robot does what it asks
        self._saved_first = ""  # by a step of the flow that runs
        self._opening: Holding | None = None  # stands over the screen until what is opened is there
        self.told: deque[Message] = deque(maxlen=MOST_TOLD)  # all that was said, the newest last
        self.tour: Tour | None = None
        self._unread: list[News] = []  # news of the robot since a key was pressed

    # ---------------------------------------------------------------------------------------------- what is open

    @property
    def has_session(self) -> bool:
        """Whether a logger or a file is open."""
        return self._session is not None

    @property
    def session(self) -> Session:
        """The logger or file that is open. RefusedError when there is none."""
        if self._session is None:
            raise RefusedError("no logger is open")
        return self._session

    @property
    def link(self) -> Link:
        """The connection to the logger. RefusedError when there is none yet."""
        return self.session.connection

    def take_session(self, session: Session | None) -> None:
        """Make another logger the open one, or none; what waits to be told was of the last."""
        self._session = session
        self._unread.clear()

    @property
    def file_over_logger(self) -> bool:
        """Whether a file is open over a logger, which goes on behind it."""
        return self._behind is not None

    @property
    def logger_session(self) -> Session | None:
        """The logger that is open, behind a file too."""
        return self._behind or self._session

    def show_file(self, file: Session) -> None:
        """Make a file the open one, over the logger."""
        self._behind, self._session = self._session, file
        self._unread.clear()

    def leave_file(self) -> None:
        """Go back to the logger, and to the screen from which the file was opened."""
        while getattr(self.app.screen_stack[-1], "scope", "") != "file":
            self.app.pop_screen()  # what lies over its table
        self._session, self._behind = self._behind, None
        self.leave_screen()
        self.came_back()

    # ------------------------------------------------------------------------------------------------ permission

    def allows(self, command: Command) -> bool:
        """Return whether a command may be carried out now; say why when it may not, or look for a lost link at once."""
        why = self.why_not(command)
        if why is not None and command.retries:
            self.try_link()
        elif why is not None:
            self.say(f"{command.label}: {why[1]}")
        return why is None and (self.has_session or not command.writes or "loggers" in command.scopes)

    def why_not(self, command: Command) -> tuple[str, str] | None:
        """Return why a command can't be carried out now, in a few words and in a sentence; None where it can.

        Of many loggers each says itself whom it lets.
        """
        if command.writes and self.read_only:
            return "read-only", PAGE_WORDS if in_browser() else READ_ONLY_WORDS
        if not self.has_session or "loggers" in command.scopes:
            return None
        session = self.session
        if command.writes and not session.may_edit:
            return session.why_not.partition(";")[0].partition(",")[0].removeprefix("this is "), session.why_not
        if command.asks and not session.connected:
            retries = key_that_retries(screen.scope) if (screen := self.upper_screen) is not None else ""
            return "no link", f"no link to {session.name}{f'; {retries} tries now' if retries else ''}"
        if command.robot and session.dead:
            kept = "; the edits stay pending" if session.table.pending_count[0] else ""
            return "program gone", f"{gone_words()}{kept}"
        return None

    def try_link(self) -> None:
        """Look for the logger at once, where the link is lost."""
        if self.session.connected:
            self.say("the link is there")
        else:
            self.session.try_now()
            self.say(f"no link to {self.session.name}: trying now")

    def offer_edits(self) -> None:
        """Offer what an earlier start kept, where there is any."""
        if kept.left_behind(self.session.status.host, self.session.name):
            self.take_up()

    def keep_edits(self) -> None:
        """Write what is pending where the next start finds it; a lost terminal must not take it along."""
        session = self.logger_session
        if session is None or self.read_only or not len(session.table) or session.link is None:
            return
        try:
            kept.keep(kept.path_of(session.status.host, session.name), session.table.kept())
        except OSError as error:
            self.say(f"pending edits can't be kept for a lost terminal: {error}")

    # ------------------------------------------------------------------------------------------ telling the screens

    @property
    def upper_screen(self) -> "SiloScreen | None":
        """The uppermost full screen, below any dialog."""
        return next((screen for screen in reversed(self.app.screen_stack) if isinstance(screen, SiloScreen)), None)

    def key_in_table(self, command: str) -> str:
        """Return the key of a command of the table, to be named on any screen: elsewhere it may mean another thing."""
        elsewhere = (screen := self.upper_screen) is not None and screen.scope != "table"
        return f"{key_of(command)}{' in the table' * elsewhere}"

    def screen_of(self, scope: str) -> "SiloScreen | None":
        """The full screen of a scope; None where it isn't there."""
        screens = (screen for screen in self.app.screen_stack if isinstance(screen, SiloScreen))
        return next((screen for screen in screens if screen.scope == scope), None)

    def tell(self, news: "Callable[[SiloScreen], None]") -> None:
        """Call `news` with every full screen that is there; one that is being made draws what is new by itself."""
        for screen in self.app.screen_stack:
            if isinstance(screen, SiloScreen) and screen.is_there:
                news(screen)

    def tell_upper(self, news: "Callable[[SiloScreen], None]") -> None:
        """Call `news` with the uppermost full screen, if that is there."""
        if (screen := self.upper_screen) is not None and screen.is_there:
            news(screen)

    def table_changed(self) -> None:
        """Tell the screens that table, pending edits or rows shown changed."""
        if self.has_session:
            self.session.rows.refresh()
        self.tell(lambda screen: screen.table_changed())

    def status_changed(self) -> None:
        """Tell the screens that the state of the logger or of the link changed."""
        self._close_question()
        self.tell(lambda screen: screen.status_changed())
        self.tell(lambda screen: screen.update_keys())

    def say(self, words: str, *, hint: bool = False) -> None:
        """Show the result of something on the screen below any dialog; or a `hint`, that a key did nothing."""
        if (screen := self.upper_screen) is not None:
            screen.say(self._with_saved(words), hint=hint)

    def _with_saved(self, words: str) -> str:
        return "; ".join(filter(None, [words, self._saved_first]))

    def saved_first(self, files: Sequence[SavedFile]) -> None:
        """Have the end of the flow that runs tell what it saved on its way, too."""
        self._saved_first = f"saved: {files_text(files)}"

    def shown(self, words: str) -> str:
        """Return words with the names of signals as the table has them."""
        return self.session.table.shown(words) if self.has_session else words

    def note(self, words: str, *, is_news: bool = False) -> Message:
        """Keep what is said among all that was."""
        told = Message(time.time(), words, is_news)
        if words:
            self.told.append(told)
        return told

    def hear(self, words: str, *, of: str = "") -> None:
        """Tell news of the robot, on a line of their own; those `of` one thing count up in their place.

        What happens often hides nothing that happened once.
        """
        if words:
            told = self.note(self.shown(words), is_news=True)
            at = next((at for at, news in enumerate(self._unread) if of and news.of == of), None)
            if at is None:
                self._unread.append(News(told, of))
            else:
                self._unread[at] = News(told, of, self._unread[at].times + 1)
            self.tell_upper(lambda screen: screen.show_news(self.news))

    @property
    def news(self) -> str:
        """The newest that was heard and may not have been read."""
        tour = f"‣ tour {self.tour.words}" if self.tour is not None else ""
        if not self._unread:
            return tour
        before = len(self._unread) - 1
        more = f" ({before} more: {key_of('messages') or ':messages'})" if before else ""
        told, times = self._unread[-1].told, self._unread[-1].times
        often = f" ({times} ×)" if times > 1 else ""
        newest = f"‣ {told.clock} {told.words}{often}{more}"
        return "\n".join(filter(None, [tour, newest]))

    def read_news(self) -> None:
        """Take news away that stood long enough: somebody goes on."""
        if self._unread and time.time() - self._unread[-1].told.at_s >= messages.READ_S:
            self.forget_news()

    def forget_news(self) -> None:
        """Take news away that say no more what is: another thing is open, or the robot program is gone."""
        self._unread.clear()
        self.tell_upper(lambda screen: screen.show_news(self.news))

    @property
    def settings_trouble(self) -> str:
        """What of the settings file was left out, to be said at the start."""
        more = len(self.settings_problems) - 1
        rest = f" ({more} more: {key_of('settings')})" if more > 0 else ""
        return f"{self.settings_problems[0]}{rest}" if self.settings_problems else ""

    def fail(self, words: str) -> None:
        """Show an error on the screen below any dialog, whole: what waited for it may just be going."""
        self.hold_no_longer()
        words = self._with_saved(self.shown(words))
        if self.has_session and self.session.dead and self.session.status.reason:  # which the banner says
            words = words.replace(self.session.status.reason, "the robot program is gone")
        if (screen := self.upper_screen) is not None:
            screen.say(words, failed=True)

    def _close_question(self) -> None:
        """Close a question to a robot program that is gone: nobody would do what it is answered."""
        top = self.app.screen if self.app.screen_stack else None
        gone = self.has_session and (self.session.dead or self.session.closed)
        asked = isinstance(top, Dialog) and top.asks and (self._asks_robot if self._flow_running else top.loses)
        if gone and asked and top is not None:
            top.dismiss(None)
            self.say(gone_words())

    # ------------------------------------------------------------------------------------------------------ flows

    def run_flow(self, flow: Coroutine[Any, Any, None], *, asks_robot: bool = True) -> None:
        """Run a flow in a worker and show its errors; one at a time. What not `asks_robot` goes on where that died."""
        if self._flow_running:
            flow.close()
            self.say("still busy with the last command")
            return
        self._flow_running, self._asks_robot = True, asks_robot
        holding = Holding(self.session.name if self.has_session else "the logger")
        self.app.push_screen(holding)  # at once: what is typed from now on is meant for what the flow shows
        self.app.run_worker(self._guarded(flow, holding), group="flow")

    async def _guarded(self, flow: Coroutine[Any, Any, None], holding: Holding) -> None:
        try:
            try:
                await flow
            finally:
                holding.end()
        except RefusedError as error:
            problems = getattr(error, "problems", None) or []
            lines = [f"element '{problem.name}': {problem.reason}" for problem in problems[:6]]
            self.fail("\n".join([str(error), *(line for line in lines if line not in str(error))]))
        except (SiloError, OSError) as error:
            self.fail(str(error))
        finally:
            self._flow_running, self._saved_first = False, ""
            self.table_changed()
            self.status_changed()

    # -------------------------------------------------------------------------------------------- what is opened

    def open_over(self, of: DOMNode, what: str, work: Work[Given], *given: Given.args, **named: Given.kwargs) -> None:
        """Open something over the screen in a worker of `of`: what is typed meanwhile is for that. Esc gives it up."""
        self.hold_no_longer()

        def give_up() -> None:
            of.workers.cancel_group(of, "opening")
            self.say(f"{what}: given up")

        holding = self._opening = Holding(what, give_up)
        made = self.app.push_screen(holding)  # at once: what is typed from now on is meant for what is opened
        run_alone(of, "opening", self._open_over, holding, made, partial(work, *given, **named))

    async def _open_over(
        self, holding: Holding, made: Awaitable[object], work: Callable[[], Coroutine[Any, Any, object]]
    ) -> None:
        try:
            await settled(made)
            await work()
        finally:
            cast(Any, self.app).gate.holds = False
            holding.end()

    def make_room(self) -> None:
        """Let what is opened come, one screen after another: keys wait until all of it is there."""
        if self._opening is not None and not self._opening.ended:
            cast(Any, self.app).gate.holds = True
            self._opening.give_way()

    def hold_no_longer(self) -> None:
        """Let keys go to the screen again: what is opened takes long, or doesn't come."""
        if self._opening is not None:
            self._opening.end()

    def is_still_on(self, screen: "SiloScreen | None") -> bool:
        """Whether nothing but what stands for what is opened came over a screen."""
        return self.upper_screen is screen and self.app.screen in (screen, self._opening)

    # ------------------------------------------------------------------------------------------------ what is told

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Follow up on something that was reported; a link that breaks meanwhile has its banner."""
        try:
            yield
        except (SiloError, OSError) as error:
            if self.has_session and self.session.connected:
                self.hear(str(error))

    async def quietly(self, job: Coroutine[Any, Any, None]) -> None:
        """Do the same with a job."""
        with self.quiet():
            await job

    @contextmanager
    def telling(self, what: str = "", tell: Callable[[str], None] | None = None) -> Iterator[None]:
        """Tell why something could not be done, after `what` that is; by `tell`, else as a failure."""
        try:
            yield
        except (SiloError, OSError) as error:
            (tell or self.fail)(f"{what}: {error}" if what else str(error))

    def learn_scripts(self) -> None:
        """Ask for the names of the scripts, for completion."""
        run_alone(self.app, "scripts", self._learn_scripts)

    async def _learn_scripts(self) -> None:
        with self.quiet():
            scripts = await self.link.read(lambda client: client.scripts())
            self.script_names = tuple(scripts.names)

    # ----------------------------------------------------------------------------------------------------- screens

    def back_to_table(self) -> None:
        """Go from the list to the logger that is open, if one is."""
        if self.has_session and len(self.app.screen_stack) > 2:
            self.app.pop_screen()

    def leave_screen(self) -> None:
        """Go back to the screen below, which requests its view again."""
        self.app.pop_screen()
        if (screen := self.upper_screen) is not None:
            screen.table_changed()
            screen.status_changed()
            screen.request_view()


class SiloScreen(Leaving[None]):
    """A full screen of the app: keys from the list of commands, each carried out by the screen or else by the app."""

    scope = ""
    PARTS: ClassVar[Sequence[type]] = ()  # what else carries out commands of the screen: the classes of `parts`
    parts: Sequence[object] = ()
    repeats: Callable[[], object] = staticmethod(lambda: None)  # what a menu did last, with its value
    repeated = ""  # its command
    session: Session  # of a screen that is of one
    aside = False  # triggers, alarms, recordings, events: who goes from one to another comes back from both at once

    @property
    def context(self) -> Context:
        """What this screen may ask of the app."""
        return cast(Context, cast(Any, self.app).context)

    @property
    def is_typing(self) -> bool:
        """Whether somebody types in a line."""
        return isinstance(self.focused, Fleeting) and self.focused.display

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Refuse commands while somebody types in a line: keys are letters then."""
        return not self.is_typing or parameters == ("quit_now",)

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Do what a key, a click, the palette or the command line asks for."""
        if self._pruning:
            return  # its widgets go one after another: one of them had the key already
        command = BY_ID[command_id]
        if typed is BY_KEY and self.scope not in command.scopes and "any" not in command.scopes:
            self._as_typed(command)
            return
        self.context.read_news()
        self.read_said()
        if not self.context.allows(command):
            return
        places = (self, *self.parts, self.context.runner, self.app)
        found = (getattr(place, command.method, None) for place in places)
        handler: Callable[..., Any] | None = next(filter(None, found), None)
        if handler is not None:
            reads = command.typed is not None and command.typed.reads
            handler(*([command.given] if command.does else []), *([typed] if reads else []))
        self.update_keys()

    def _as_typed(self, command: Command) -> None:
        """Do by a menu what has no key here, as if its word were typed; go on in the line where it needs more.

        Of what has no word either it is said where it has a use.
        """
        if command.typed is None or not typed_on(self.scope, command):
            self.say(f"{command.label} ({with_keys(command).key_text}): {where([command], self.scope)[1]}")
            return
        word = command.typed.words[0]
        if command.typed.completes or (command.typed.usage and not command.scopes):
            self.begin_command(word)
        else:
            self.context.runner.run(word)

    def why_not_now(self, command_id: str) -> str:
        """Return why something that has a use on this screen has none now; empty where it has."""
        if command_id == "stop_recording" and self.context.has_session:
            session = self.context.session
            return "" if session.status.recorders or session.recorders else "nothing records"
        return ""

    @property
    def why_not_again(self) -> str:
        """Why what a menu did last can't be done once more now; empty where it can."""
        refused = self.context.why_not(BY_ID[self.repeated])
        return refused[1] if refused else self.why_not_now(self.repeated)

    def value_now(self, command_id: str) -> str:
        """Return what a menu tells of an entry: what it changes, as it is; what it makes, or tells it from its like."""
        told = {"top": "first line", "recordings": "of robot", "runs": "of a folder"}
        told |= {
            "add_plot": "another",
            "new_of_row": "trigger, limits",
            "trigger_new": "trigger",
            "alarm_new": "limits",
        }
        return told.get(command_id, "")

    @property
    def subject(self) -> str:
        """What the cursor is on, or what is marked, to be told by what covers it; empty where that is nothing."""
        return ""

    def open_left(self, names: Sequence[str] = ()) -> None:
        """Open what a dead robot left, with plots of these elements."""
        cast(Any, self.app).open_left(names)

    def begin_command(self, word: str) -> None:
        """Go on in the command line, with a word typed already."""
        cast(Any, self.app).begin_command(word)

    def on_key(self, event: events.Key) -> None:
        """Say of a key why it does nothing here; keys with a meaning don't come here."""
        if not isinstance(self.focused, Fleeting):
            self.context.say(why_no_use(event.key, self.scope), hint=True)

    # ---------------------------------------------------------------------------------------------- the key bar

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return commands, and what they are called now, that come first because of the mode the screen is in."""
        return ()

    def label_now(self, command: Command) -> str:
        """Return what a key of the bar is called now; empty where it has no use now."""
        session = self.context.session if self.context.has_session else None
        if session is not None and command.id in OPENS.get(self.scope, ())[:1] and left_a_file(session):
            return OPEN_FILE
        if session is not None and session.dead and (command.robot or command.id == "save_data"):
            return ""
        if command.id not in RELABELLED:
            return command.label
        if command.id == "again":
            return f"again: {BY_ID[self.repeated].label}" if self.repeated and not self.why_not_again else ""
        if command.id == "closer":
            return f"{key_of('wider')} {command.label}"  # one entry for both
        if command.id == "back" and self in self.app.screen_stack[:2]:
            return ""  # nothing is behind it
        if session is not None and command.id == "start_stop":
            return "Stop" if session.running else "Start"
        if session is not None and command.id == "apply":
            fields = session.table.pending_count[0]
            return f"{command.label} {fields}" if fields else ""
        return command.label

    def update_keys(self) -> None:
        """Let the key bar show what counts now; and the tour what is next."""
        if (tour := self.context.tour) is not None and self.context.has_session and self.context.upper_screen is self:
            tour.follow(self)
            self.show_news(self.context.news)
        for bar in self.walk_children(KeyBar):
            bar.update()

    def show_keys(self, instead: str) -> None:
        """Show other keys for a while, of what lies above; empty: the screen's own again."""
        for bar in self.walk_children(KeyBar):
            bar.show_instead(instead)

    def on_screen_suspend(self) -> None:
        """Show the keys of a dialog that lies above."""
        self.show_keys_above()

    def cover_messages(self, covered: bool) -> None:
        """Have what is said fit into the row that a menu leaves of it, or have its room again."""
        for line in self.walk_children(MessageLine):
            line.cover(covered)

    def show_keys_above(self) -> None:
        """Show the keys of what lies above this screen, where it is a dialog."""
        if self.app.screen.is_modal:
            self.show_keys(getattr(self.app.screen, "KEYS_HERE", "Enter Does it  Esc Closes"))

    def on_screen_resume(self) -> None:
        """Show the keys of the screen again, but not above a line that is typed in; and news that came meanwhile.

        What was said long before may be over.
        """
        self.update_keys()
        self.read_said()
        self.show_news(self.context.news)
        if not isinstance(self.focused, Fleeting):
            self.show_keys("")

    # --------------------------------------------------------------------------------------- how the logger stands

    @cached_property
    def status_bar(self) -> StatusBar:
        """How the logger, or the file, of this screen stands."""
        return StatusBar(self.session, beside_rows=self.scope == "table")

    def bars(self) -> ComposeResult:
        """Yield that, and what is the matter with it."""
        yield self.status_bar
        yield Banner(self.session)

    def show_bars(self) -> None:
        """Paint both again, where they are on the screen."""
        bars: list[StatusBar | Banner] = [*self.walk_children(StatusBar), *self.walk_children(Banner)]
        for bar in bars:
            bar.update()

    # ------------------------------------------------------------------------------- what the app tells a screen

    def table_changed(self) -> None:
        """Follow a change of the table, its pending edits or the rows shown."""

    def status_changed(self) -> None:
        """Follow a change of the state of the logger or of the link."""
        self.show_bars()

    def live_changed(self, frame: Frame) -> None:
        """Show new values."""
        for bar in self.walk_children(StatusBar):
            bar.update()

    def second_passed(self) -> None:
        """Paint what shows a time again, and what the head tells of recordings that grow."""
        self.show_bars()
        if self.context.has_session and self.context.session.recorders_are_due:
            run_alone(self, "recorders", self._follow_recorders)

    async def _follow_recorders(self) -> None:
        await self.context.quietly(self.context.session.refresh_recorders())

    def request_view(self) -> None:
        """Request the view of what is on this screen, again."""

    def settings_changed(self) -> None:
        """Follow a change of the user's settings."""

    def say(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        """Show the result of something that was done, or that it was refused; as soon as the screen was made.

        A `hint`, that a key did nothing, goes with the next that does something.
        """
        words = self.context.shown(words)
        self.context.note(words)
        if self.is_there:
            self.show_said(words, failed=failed, hint=hint)
        else:
            self.call_later(self.show_said, words, failed=failed, hint=hint)  # one that goes takes nothing any more

    def show_said(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        """Show what is said in the line of messages."""
        for line in self.walk_children(MessageLine):
            line.say(words, failed=failed, hint=hint)

    def read_said(self) -> None:
        """Take away what stood there long enough, as somebody goes on."""
        for line in self.walk_children(MessageLine):
            line.read()

    def show_news(self, news: str) -> None:
        """Show news of the robot there."""
        for line in self.walk_children(MessageLine):
            line.tell(news)
