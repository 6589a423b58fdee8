"""What the commands of the `:` line do."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from silo.files.formats import SAVED_NAMES
from silo.settings.words import completions, read_settings
from silo_tui.commands import flows
from silo_tui.model import command_line
from silo_tui.model.rows import SORTS

if TYPE_CHECKING:
    from silo_tui.app import SiloApp

DEED_WORDS = {
    "start": "start_stop", "stop": "start_stop", "restart": "restart", "apply": "apply", "undo": "undo", "redo": "redo",
    "monitor": "monitor", "help": "help", "refresh": "refresh", "loggers": "loggers", "discard": "discard",
}  # fmt: skip
OWN_WORDS = (
    "load",
    "save",
    "data",
    "set",
    "filter",
    "goto",
    "sort",
    "mark",
    "unmark",
    "theme",
    "picture",
    "quit",
    "q",
    "q!",
)


class CommandRunner:
    """Carries out one command line."""

    def __init__(self, app: "SiloApp") -> None:
        self._app = app

    @staticmethod
    def words() -> list[str]:
        """All commands."""
        return sorted({*DEED_WORDS, *OWN_WORDS})

    def arguments(self, line: str) -> Mapping[str, Sequence[str]]:
        """Possible arguments of the command that `line` begins with."""
        app = self._app
        word = line.lstrip(":").partition(" ")[0]
        if word == "goto" and app.has_session:
            return {"goto": app.session.table.names}
        return {
            "load": app.script_names, "save": app.script_names, "sort": SORTS,
            "set": completions(line.rpartition(" ")[2]),
            "data": SAVED_NAMES, "theme": tuple(sorted(app.available_themes)),
        }  # fmt: skip

    def run(self, spelled: command_line.Spelled) -> None:
        """Does it. ValueError says what is wrong with the line."""
        word, arguments = spelled.word, spelled.arguments
        if word in DEED_WORDS:
            self._command(word)
            return
        handler = {
            "load": self._load, "save": self._save, "data": self._data, "set": self._set, "filter": self._filter,
            "goto": self._goto, "sort": self._sort, "mark": self._mark, "unmark": self._unmark, "theme": self._theme,
            "picture": self._picture,
            "quit": self._quit, "q": self._quit, "q!": self._quit_now,
        }.get(word)  # fmt: skip
        if handler is None:
            near = [known for known in self.words() if known.startswith(word[:2])]
            hint = f"; did you mean {', '.join(near)}?" if near else "; `:help` shows what there is"
            raise ValueError(f"there is no command {word!r}{hint}")
        handler(arguments)

    def _command(self, word: str) -> None:
        app = self._app
        if word in {"start", "stop"} and app.session.running == (word == "start"):
            app.say(f"it is {'running' if app.session.running else 'stopped'} already")
            return
        screen = app.table_screen
        screen.action_command(DEED_WORDS[word])

    def _writing(self, label: str) -> None:
        if not self._app.may_write(label):
            raise ValueError(f"{label}: this session may only look")

    def _asking(self, label: str) -> bool:
        self._writing(label)
        return self._app.may_ask(label)

    def _load(self, arguments: Sequence[str]) -> None:
        if not self._asking("Load script"):
            return
        self._app.run_flow(flows.load_script(self._app, arguments[0] if arguments else ""))

    def _save(self, arguments: Sequence[str]) -> None:
        if not self._asking("Save script"):
            return
        self._app.run_flow(flows.save_script(self._app, arguments[0] if arguments else ""))

    def _data(self, arguments: Sequence[str]) -> None:
        from silo_tui.screens.save_data import SaveDialog

        if not self._asking("Save data"):
            return
        types, name = command_line.read_save(arguments)
        self._app.push_screen(SaveDialog(self._app.session.status.folder, types, name, at_once=bool(arguments)))

    def _set(self, arguments: Sequence[str]) -> None:
        self._writing("Edit")
        app = self._app
        if not arguments:
            raise ValueError("set what? for example `:set div=5 buf=loop size=10s act=both on=yes`")
        changed = app.table_screen.change(app.session.rows.targets(), read_settings(arguments))
        app.table_changed()
        app.say(f"{changed} fields changed; u takes them back" if changed else "nothing to change")

    def _filter(self, arguments: Sequence[str]) -> None:
        self._app.session.rows.set_filter(" ".join(arguments))
        self._app.table_changed()

    def _goto(self, arguments: Sequence[str]) -> None:
        app, name = self._app, " ".join(arguments)
        table, rows = app.session.table, app.session.rows
        row = table.row(name)
        if row is None:
            found = [each for each, folded in enumerate(table.folded) if name.casefold() in folded]
            if not found or not name:
                raise ValueError(f"no element has {name!r} in its name")
            row = found[0]
        if not rows.move_to_row(row):
            rows.set_filter("")
            rows.move_to_row(row)
        app.table_changed()

    def _sort(self, arguments: Sequence[str]) -> None:
        if len(arguments) != 1 or arguments[0] not in SORTS:
            raise ValueError(f"sort by one of {', '.join(SORTS)}")
        self._app.session.rows.sort = arguments[0]
        self._app.table_changed()

    def _mark(self, arguments: Sequence[str]) -> None:
        rows = self._app.session.rows
        if arguments:
            from silo_tui.model.filter import parse

            rows.marked |= parse(" ".join(arguments)).mask(self._app.session.table, rows.marked)
        else:
            rows.marked[rows.shown] = True
        self._app.table_changed()

    def _unmark(self, arguments: Sequence[str]) -> None:
        self._app.session.rows.clear_marks()
        self._app.table_changed()

    def _theme(self, arguments: Sequence[str]) -> None:
        if len(arguments) != 1 or arguments[0] not in self._app.available_themes:
            raise ValueError(f"themes: {', '.join(sorted(self._app.available_themes))}")
        self._app.theme = arguments[0]

    def _picture(self, arguments: Sequence[str]) -> None:
        path = Path(arguments[0] if arguments else "silo-tui.svg").expanduser()
        self._app.call_after_refresh(self._write_picture, path)  # without this command on it

    def _write_picture(self, path: Path) -> None:
        try:
            path.write_text(picture(self._app), "utf-8")
        except OSError as error:
            self._app.fail(f"can't write the picture: {error}")
            return
        self._app.say(f"picture of the screen: {path.absolute()}")

    def _quit(self, arguments: Sequence[str]) -> None:
        self._app.run_flow(flows.leave(self._app))

    def _quit_now(self, arguments: Sequence[str]) -> None:
        self._app.exit()


def picture(app: "SiloApp") -> str:
    """The screen as SVG. Blanks between braille dots become blank braille, which is as wide as they are."""

    def widen(match: re.Match[str]) -> str:
        has_dots = any("\u2800" < char <= "\u28ff" for char in match[0])
        return match[0].replace("&#160;", "\u2800") if has_dots else match[0]

    return re.sub(r">[^<>]+</text>", widen, app.export_screenshot(title="silo-tui"))
