"""What the words of the `:` line do where they take arguments, or mean something else than the command's key."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from silo.core.quantities.writing import many
from silo.errors import RefusedError, SiloError
from silo.files.formats import SAVED_NAMES
from silo.rpc.refusals import RefusedWhy
from silo.settings.typed import ElementSettings, completions, read_settings
from silo_tui.actions import BY_WORD, FILE_SCOPES, NOT_EDITED, Command, key_of, typed_on_file
from silo_tui.commands import flows
from silo_tui.context import Context, SiloScreen
from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout, read, write
from silo_tui.modal import run_alone
from silo_tui.model import command_line
from silo_tui.model.paths import typed_file
from silo_tui.model.people import people_words
from silo_tui.screens import recorder
from silo_tui.screens.dialogs import confirmed
from silo_tui.screens.exporting import picture
from silo_tui.screens.opened import open_path
from silo_tui.screens.table import TableScreen
from silo_tui.sessions.live import why
from silo_tui.settings.themes import THEMES
from silo_tui.theme import theme_name

if TYPE_CHECKING:
    from silo.client.client import Client

LOST = "lost"  # the view of what a lost terminal showed, unless there is one of that name
ROBOT = "robot:"  # in front of the name of a view that the robot keeps
PICTURES = (".png", ".jpg", ".jpeg", ".gif", ".pdf")


class CommandRunner:
    """Carries out command lines and completes them; `word_x` is the command `x` as it is typed."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def complete(self, line: str) -> list[str]:
        """Return whole lines that `line` may become."""
        command = BY_WORD.get(line.lstrip(":").partition(" ")[0])
        choices = self.choices(command, line.rpartition(" ")[2]) if command is not None else ()
        words = [word for word, one in BY_WORD.items() if self._file_screen is None or typed_on_file(one)]
        return command_line.complete(line, sorted(words), choices)

    def choices(self, command: Command, begun: str = "") -> Sequence[str]:
        """Return what the argument of a typed command may be, of which `begun` is typed."""
        context = self._context
        sources: dict[str, Callable[[], Sequence[str]]] = {
            "scripts": lambda: context.script_names,
            "settings": lambda: completions(begun),
            "sorts": lambda: list(context.session.rows.orders),
            "names": lambda: context.session.table.names,
            "derived": lambda: [one.name for one in context.session.table.elements[context.session.table.own :]],
            "types": lambda: SAVED_NAMES,
            "views": lambda: ["save", *files.names()],
            "logs": lambda: command_line.logs(begun),
            "control": lambda: ("take", "force", "release", "give"),
            "themes": lambda: (*THEMES, *sorted(context.app.available_themes)),
        }
        needs = () if context.has_session else ("sorts", "names", "derived")
        source = (
            sources.get(command.typed.completes) if command.typed and command.typed.completes not in needs else None
        )
        return source() if source is not None else ()

    def run(self, line: str) -> None:
        """Carry out a command line; show what is wrong with it."""
        try:
            self._run(command_line.read(line))
        except (ValueError, SiloError) as error:
            self._context.fail(str(error))

    def _run(self, spelled: command_line.Spelled) -> None:
        command = BY_WORD.get(spelled.word)
        if command is None:
            near = [known for known in sorted(BY_WORD) if known.startswith(spelled.word[:2])]
            hint = f"; did you mean {', '.join(near)}?" if near else "; `:help` shows what there is"
            raise ValueError(f"there is no command {spelled.word!r}{hint}")
        file = self._file_screen
        if file is not None and not typed_on_file(command):
            raise RefusedError(f":{spelled.word}: {NOT_EDITED}, no logger to command")
        handler: Callable[[command_line.Spelled], None] | None = getattr(self, f"word_{command.id}", None)
        if handler is None:
            (file or self._screen_for(command)).action_command(command.id)
        elif self._context.allows(command):
            handler(spelled)

    @property
    def _file_screen(self) -> SiloScreen | None:
        """The screen of a file, where that is the uppermost."""
        screen = self._context.upper_screen
        return screen if screen is not None and screen.scope in FILE_SCOPES else None

    def _screen_for(self, command: Command) -> SiloScreen:
        """Return the table, or the list of loggers for what needs none. RefusedError when there is none."""
        screen = self._context.upper_screen
        return screen if screen is not None and "any" in command.scopes else self._table_screen

    @property
    def _table_screen(self) -> TableScreen:
        """The table of the logger that is open. RefusedError when there is none."""
        for screen in self._context.app.screen_stack:
            if isinstance(screen, TableScreen):
                return screen
        raise RefusedError("no logger is open")

    def word_start_stop(self, spelled: command_line.Spelled) -> None:
        """Carry out `:start` or `:stop`, which `S` is both."""
        running = self._context.session.running
        if running == (spelled.word == "start"):
            self._context.say(f"it is {'running' if running else 'stopped'} already")
        else:
            self._table_screen.action_command("start_stop")

    def word_load_script(self, spelled: command_line.Spelled) -> None:
        """Carry out `:load [NAME]`; without a name, ask for one."""
        self._context.run_flow(flows.load_script(self._context, spelled.arguments[0] if spelled.arguments else ""))

    def word_save_script(self, spelled: command_line.Spelled) -> None:
        """Carry out `:save [NAME]`; without a name, to the logger's own script."""
        self._context.run_flow(flows.save_script(self._context, spelled.arguments[0] if spelled.arguments else ""))

    def word_save_data(self, spelled: command_line.Spelled) -> None:
        """Carry out `:data [TYPE ...] [NAME]`; without arguments, ask."""
        from silo_tui.screens.save_data import SaveDialog

        types, name = command_line.read_save(spelled.arguments)
        self._context.app.push_screen(SaveDialog(self._context, types, name, at_once=bool(spelled.arguments)))

    def word_set(self, spelled: command_line.Spelled) -> None:
        """Carry out `:set div=5 size=10s ...` for all targets."""
        if not spelled.arguments:
            raise ValueError("set what? for example `:set div=5 buf=loop size=10s act=both on=yes`")
        wanted = read_settings(spelled.arguments)
        self._table_screen.sure_of_hidden(lambda: self._set(wanted))

    def _set(self, wanted: ElementSettings) -> None:
        context = self._context
        try:
            changed = context.session.change(wanted)
        except (ValueError, SiloError) as error:
            context.fail(str(error))
            return
        context.table_changed()
        context.say(
            f"{many(changed, 'field')} changed; {key_of('undo')} takes {'it' if changed == 1 else 'them'} back"
            if changed
            else "nothing to change"
        )

    def word_record(self, spelled: command_line.Spelled) -> None:
        """Carry out `:record [PATTERN ...]`; without a pattern, ask what."""
        context = self._context
        self._context.run_flow(recorder.begin(context, context.session, 0, " ".join(spelled.arguments)))

    def word_derive(self, spelled: command_line.Spelled) -> None:
        """Carry out `:derive [NAME [EXPRESSION]]`; what isn't typed is asked for."""
        name, expression = (*spelled.arguments[:1], "")[0], " ".join(spelled.arguments[1:])
        self._table_screen.command_derive(name, expression.removeprefix("= "))

    def word_open(self, spelled: command_line.Spelled) -> None:
        """Carry out `:open FILE`."""
        if not spelled.arguments:
            raise ValueError(
                f"open which file? for example `:open logs/run.silo`; {key_of('recordings')} lists what is on the robot"
            )
        if not self._context.has_session:
            raise RefusedError("no logger is open: leave silo-tui, and open the file by `silo-tui FILE`")
        run_alone(self._context.app, "opening", self._open, " ".join(spelled.arguments))

    async def _open(self, path: str) -> None:
        self._context.say(f"reading {path} …")
        try:
            await open_path(self._context, path)
        except (SiloError, OSError) as error:
            self._context.fail(f"{path} can't be opened: {error}")

    def word_filter(self, spelled: command_line.Spelled) -> None:
        """Carry out `:filter [TERM ...]`."""
        self._context.session.rows.set_filter(" ".join(spelled.arguments))
        self._context.table_changed()

    def word_goto(self, spelled: command_line.Spelled) -> None:
        """Carry out `:goto NAME`; a part of a name is enough."""
        context, name = self._context, " ".join(spelled.arguments)
        table, rows = context.session.table, context.session.rows
        row = table.row(name)
        if row is None:
            found = [each for each, folded in enumerate(table.folded) if name.casefold() in folded]
            if not found or not name:
                raise ValueError(f"no element has {name!r} in its name")
            row = found[0]
        if not rows.move_to_row(row):
            rows.set_filter("")
            rows.move_to_row(row)
        context.table_changed()

    def word_sort(self, spelled: command_line.Spelled) -> None:
        """Carry out `:sort COLUMN`."""
        if len(spelled.arguments) != 1 or spelled.arguments[0] not in self._context.session.rows.orders:
            raise ValueError(f"sort by one of {', '.join(self._context.session.rows.orders)}")
        self._context.session.rows.order_by(spelled.arguments[0])
        self._context.table_changed()

    def word_mark(self, spelled: command_line.Spelled) -> None:
        """Carry out `:mark [TERM ...]`; without terms, mark all that are shown."""
        rows = self._context.session.rows
        if spelled.arguments:
            from silo_tui.model.filter import parse

            rows.marked |= parse(" ".join(spelled.arguments)).mask(self._context.session.table, rows.marked)
        else:
            rows.marked[rows.shown] = True
        self._context.table_changed()

    def word_unmark(self, spelled: command_line.Spelled) -> None:
        """Carry out `:unmark`."""
        self._context.session.rows.clear_marks()
        self._context.table_changed()

    def word_theme(self, spelled: command_line.Spelled) -> None:
        """Carry out `:theme NAME`."""
        words, known = spelled.arguments, self._context.app.available_themes
        name = theme_name(words[0]) if len(words) == 1 and words[0] in THEMES else " ".join(words)
        if name not in known:
            others = ", ".join(sorted(each for each in known if not each.startswith("silo-")))
            raise ValueError(f"themes: {', '.join(THEMES)}; Textual's: {others}")
        self._context.app.theme = name

    def word_control(self, spelled: command_line.Spelled) -> None:
        """Carry out `:control take|force|release|give NAME`; without words, tell who is there."""
        self._context.run_flow(control_flow(self._context, spelled.arguments))

    def word_view(self, spelled: command_line.Spelled) -> None:
        """Carry out `:view NAME`, `:view save NAME`; without a name, tell those that there are."""
        if spelled.arguments[:1] == ("save",) and len(spelled.arguments) > 1:
            self._save_view(" ".join(spelled.arguments[1:]))
        elif spelled.arguments:
            self._context.run_flow(open_view(self._context, " ".join(spelled.arguments)))
        else:
            self._context.run_flow(tell_views(self._context))

    def _save_view(self, name: str) -> None:
        layout = views.capture(self._context)
        if layout is None:
            raise RefusedError("no logger is open: there is nothing to keep")
        plots = f" with {many(len(layout.plots), 'plot')}" if layout.plots else ""
        if name.startswith(ROBOT):
            self._context.run_flow(keep_on_robot(self._context, name.removeprefix(ROBOT), layout))
            return
        file = files.place(name)
        again = file.exists()
        files.save(file, layout)
        self._context.say(f"view {name} {'written over' if again else 'kept'}{plots}; silo-tui --view {name} opens it")

    def word_picture(self, spelled: command_line.Spelled) -> None:
        """Carry out `:picture [FILE]`."""
        given = spelled.arguments[0] if spelled.arguments else "silo-tui.svg"
        path = typed_file("the picture", given, ".svg")
        if path.suffix != ".svg":  # an SVG in a .png is a picture that nothing opens
            path = path.with_name(f"{path.stem if path.suffix.lower() in PICTURES else path.name}.svg")
        note = "" if path.name == Path(given).name else " (an SVG: browsers open it)"
        self._context.app.call_after_refresh(self._write_picture, path, note)  # without this command on it

    def _write_picture(self, path: Path, note: str) -> None:
        try:
            path.write_text(picture(self._context.app), "utf-8")
        except OSError as error:
            self._context.fail(f"can't write the picture: {error}")
            return
        self._context.say(f"picture of the screen: {path.absolute()}{note}")


CONTROL_WORDS = "take, force (from whoever has it), release, give NAME; alone, who is connected"


async def control_flow(context: Context, words: Sequence[str]) -> None:
    """Take, release or give away control, or tell who has it. RefusedError where somebody else has it."""
    session = context.session
    jobs: dict[str, Callable[[Client], str]] = {
        "take": lambda client: client.take_control(),
        "force": lambda client: client.take_control(force=True),
        "release": lambda client: client.release_control(),
        "give": lambda client: client.hand_over(words[1]),
    }
    if not words:
        await session.refresh_status()
        context.say(people_words(session.status, session.identity))
    elif words[0] not in jobs:
        near = get_close_matches(words[0], jobs, 1)
        hint = f"did you mean {near[0]}?" if near else CONTROL_WORDS
        raise RefusedError(f"control: there is no {words[0]!r}; {hint}")
    elif len(words) != (2 if words[0] == "give" else 1):
        raise RefusedError(f"control: {CONTROL_WORDS}")
    elif context.may_write("Control"):
        context.say(await session.control(jobs[words[0]]))


async def open_view(context: Context, name: str) -> None:
    """Put a view on the screen; say what of it isn't there. RefusedError where there is none of that name."""
    context.say(await view_shown(context, name))


async def view_shown(context: Context, name: str) -> str:
    """Put a view on the screen; return what is to be said of it. RefusedError where there is none of that name.

    `robot:NAME` is one that the robot keeps.
    """
    try:
        if name == LOST and LOST not in files.names() and (left := files.left_behind(context.session.name)):
            layout, problems = files.load_file(left[-1])
            for path in left:
                path.unlink(missing_ok=True)
        elif name.startswith(ROBOT):
            plain = name.removeprefix(ROBOT)
            layout, problems = read((await context.link.read(lambda client: client.kept_view(plain))).text)
        else:
            layout, problems = files.load(name)
    except ValueError as error:
        raise RefusedError(str(error)) from error
    missing = await views.show(context, layout)
    return "; ".join(filter(None, [f"view {name}", missing, *problems[:1]]))


async def tell_views(context: Context) -> None:
    """Say which views there are, here and on the robot."""
    known = files.names()
    with suppress(SiloError):  # an older silo, or no link: those of this machine are there all the same
        known += [ROBOT + name for name in (await context.link.read(lambda client: client.kept_views())).names]
    none = "no views yet; `:view save NAME` makes one, `:view save robot:NAME` one for all who look at this robot"
    context.say(f"views: {', '.join(known)}" if known else none)


async def keep_on_robot(context: Context, name: str, layout: KeptLayout) -> None:
    """Keep a view on the robot; over one of that name after a question."""
    link = context.link
    try:
        said = await link.call(lambda client: client.keep_view(name, write(layout)))
    except RefusedError as refused:
        if why(refused) is not RefusedWhy.EXISTS:
            raise
        if not await confirmed(context.app, f"Write over view {name}?", str(refused), "Write"):
            return
        said = await link.call(lambda client: client.keep_view(name, write(layout), overwrite=True))
    context.say(f"{said}; silo-tui --view {ROBOT}{name} opens it")
