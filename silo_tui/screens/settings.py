# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The user's settings: each changed by a key, shown at once, kept by `w`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option as ListLine

from silo.errors import SiloError
from silo_tui.actions import BY_ID, COMMANDS, bindings_for, key_text, with_keys
from silo_tui.context import SiloScreen
from silo_tui.modal import Dialog
from silo_tui.settings.keys import clashes, key_problem, label
from silo_tui.settings.options import OPTIONS, Option, Settings, typed
from silo_tui.settings.reading import path, read
from silo_tui.settings.writing import write_file
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.inputs import Fleeting, Line

NAMES = 20
TYPING_KEYS = "Enter takes it  Tab completes  Esc leaves it as it was"
SEARCH_KEYS = "Enter goes to the lines  Esc shows all again"


@dataclass(frozen=True)
class Row:
    """One line: an option, a command whose keys can be changed, or (with neither) words alone."""

    id: str
    option: Option | None = None
    command: str = ""
    words: str = ""


def all_rows(problems: tuple[str, ...]) -> list[Row]:
    """Return the lines: what is wrong with the file, options, then the keys of every command."""
    rows = [Row(f"problem {place}", words=f"! {problem}") for place, problem in enumerate(problems)]
    rows += [Row(option.name, option=option) for option in OPTIONS]
    return rows + [Row(f"key {each.id}", command=each.id) for each in COMMANDS if each.keys]


def row_text(row: Row, settings: Settings, saved: Settings, *, width: int) -> Text:
    """Return a line; `*` in front: not written yet."""
    if row.option is not None:
        option = row.option
        is_new = getattr(settings, option.name) != getattr(saved, option.name)
        line = Text(f"{'*' if is_new else ' '} {option.name:<{NAMES}} ")
        return _values(line, option, getattr(settings, option.name), width)
    if row.command:
        command = BY_ID[row.command]
        own = row.command in settings.keys
        is_new = settings.keys.get(row.command) != saved.keys.get(row.command)
        line = Text(f"{'*' if is_new else ' '} {'key ' + row.command:<{NAMES}} ")
        line.append(with_keys(settings.keys, command).key_text, style="bold")
        if own:
            line.append(f"  (yours; was {command.key_text})")
        line.append(f"  {command.label}: {command.help}" if command.help != command.label else f"  {command.label}")
        return line
    return Text(row.words, style="bold")


def _values(line: Text, option: Option, value: Any, width: int) -> Text:
    if not option.words:
        return line.append(typed(value), style="bold").append(f"   {option.meaning}, {option.range_text}")
    chosen = value if option.several else (value,)
    for word in option.words:
        is_chosen = word in chosen
        mark = ("[x] " if is_chosen else "[ ] ") if option.several else ("► " if is_chosen else "  ")
        line.append(mark + word, style="bold" if is_chosen else "").append("  ")
    place = option.words.index(value) if not option.several else -1
    notes = [notes[place] for notes in (option.samples, option.meanings) if notes and place >= 0 and notes[place]]
    if option.several and not value:
        notes = ["none chosen: all"]
    for note in notes or [option.meaning]:
        if line.cell_len + len(note) < width - 4:
            line.append(f"{note}  ")
    return line


class SettingsScreen(SiloScreen):
    """A list of lines; `take` makes everything follow other settings."""

    scope = "settings"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("settings")

    def __init__(self, take: Callable[[Settings], None]) -> None:
        super().__init__()
        self._take = take
        self._rows: list[Row] = []
        self._words = ""

    def compose(self) -> ComposeResult:
        """Yield title, lines, message, lines to type in, keys."""
        yield Static(f" silo settings  {_shown(path())}", id="settings-title", markup=False)
        yield OptionList(id="settings-list", markup=False)
        yield Static("", id="settings-said", markup=False)
        yield Line(self._completions, "", "settings-value")
        yield Line(lambda line: [], "words of a setting or a command", "settings-search")
        yield KeyBar(self.scope)

    def on_mount(self) -> None:
        """Show all lines; the first setting has the cursor."""
        self._show_rows()
        self._list.focus()
        self._list.highlighted = min(len(self.context.settings_problems), self._list.option_count - 1)

    def on_resize(self, event: events.Resize) -> None:
        """Leave out or show what a setting means."""
        self._show_rows()

    @property
    def _list(self) -> OptionList:
        return self.query_one(OptionList)

    def say(self, words: str) -> None:
        """Show the result of something."""
        self.query_one("#settings-said", Static).update(f" {words}")

    def settings_changed(self) -> None:
        """Draw the lines with the new settings."""
        self._show_rows()

    def _show_rows(self) -> None:
        context, lines = self.context, self._list
        kept = self._row.id if self._row is not None else ""
        problems = tuple(str(problem) for problem in context.settings_problems)
        wanted = self._words.casefold().split()
        found = [(row, self._text(row)) for row in all_rows(problems)]
        found = [(row, line) for row, line in found if all(word in line.plain.casefold() for word in wanted)]
        self._rows = [row for row, _ in found]
        lines.clear_options()
        lines.add_options(ListLine(line, id=row.id) for row, line in found)
        places = [place for place, row in enumerate(self._rows) if row.id == kept]
        if self._rows:
            lines.highlighted = places[0] if places else 0

    def _text(self, row: Row) -> Text:
        context = self.context
        line = row_text(row, context.settings, context.saved_settings, width=self.size.width)
        if row.option is not None or row.command:  # what is wrong with the file is read whole
            line.truncate(max(20, self.size.width - 3), overflow="ellipsis")
        return line

    @property
    def _row(self) -> Row | None:
        place = self._list.highlighted
        return self._rows[place] if place is not None and place < len(self._rows) else None

    def _change(self, words: str, **fields: Any) -> None:
        self._take(replace(self.context.settings, **fields))
        self.say(f"{words}; w keeps it")

    # -------------------------------------------------------------------------------------------------- moving

    def command_next_setting(self) -> None:
        self._move(1)

    def command_previous_setting(self) -> None:
        self._move(-1)

    def command_first_setting(self) -> None:
        self._list.action_first()

    def command_last_setting(self) -> None:
        self._list.action_last()

    def command_settings_down(self) -> None:
        self._move(max(1, self._list.size.height - 1))

    def command_settings_up(self) -> None:
        self._move(-max(1, self._list.size.height - 1))

    def _move(self, lines: int) -> None:
        place = (self._list.highlighted or 0) + lines
        if self._rows:
            self._list.highlighted = max(0, min(place, len(self._rows) - 1))

    # ------------------------------------------------------------------------------------------------ changing

    def command_change_setting(self) -> None:
        row = self._row
        if row is None:
            return
        if row.command:
            self.app.push_screen(KeyDialog(row.command, self.context.settings), self._take_key)
        elif row.option is not None and row.option.words and not row.option.several:
            self._step(1)
        elif row.option is not None:
            value = getattr(self.context.settings, row.option.name)
            self.query_one(KeyBar).show_instead(TYPING_KEYS)
            self.query_one("#settings-said").display = False
            self.query_one("#settings-value", Line).begin(" ".join(value) if row.option.several else typed(value))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Change what is clicked."""
        event.stop()
        self.command_change_setting()

    def command_earlier_word(self) -> None:
        self._step(-1)

    def command_later_word(self) -> None:
        self._step(1)

    def _step(self, step: int) -> None:
        option = self._row.option if self._row is not None else None
        if option is None or not option.words or option.several:
            self.say("e changes this one")
            return
        place = option.words.index(getattr(self.context.settings, option.name))
        word = option.words[(place + step) % len(option.words)]
        self._change(f"{option.name}: {word}", **{option.name: word})

    def command_default_setting(self) -> None:
        row, settings = self._row, self.context.settings
        if row is None:
            return
        if row.command:
            keys = {command: own for command, own in settings.keys.items() if command != row.command}
            if (problem := _clash(keys, row.command)) and row.command in settings.keys:
                self.say(f"not given back: {problem}")
                return
            self._change(f"{row.command}: {BY_ID[row.command].key_text}", keys=keys)
        elif row.option is not None:
            value = getattr(Settings(), row.option.name)
            self._change(f"{row.option.name}: {typed(value) if value else 'all'}", **{row.option.name: value})

    def _take_key(self, key: str | None) -> None:
        row = self._row
        if row is not None and key:
            keys = {**self.context.settings.keys, row.command: key}
            self._change(f"{row.command}: {key_text(key)}", keys=keys)

    def command_write_settings(self) -> None:
        context = self.context
        try:
            written = write_file(context.saved_settings, context.settings)
        except SiloError as error:
            self.say(str(error))
            return
        context.saved_settings = context.settings
        self._show_rows()
        self.say(f"written: {_shown(written)}")

    # --------------------------------------------------------------------------------------------- typed lines

    def command_find_setting(self) -> None:
        self.query_one(KeyBar).show_instead(SEARCH_KEYS)
        self.query_one("#settings-said").display = False
        self.query_one("#settings-search", Line).begin(self._words)

    def _completions(self, line: str) -> list[str]:
        option = self._row.option if self._row is not None else None
        head, _, last = line.rpartition(" ")
        words = option.words if option is not None else ()
        return [f"{head} {word}".lstrip() for word in words if word.startswith(last) and word != last]

    def on_input_changed(self, event: Input.Changed) -> None:
        """Search while it is typed."""
        if event.input.id == "settings-search" and event.input.display:
            self._search(event.input.value)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Take what was typed; it is read as the file is, so the words are the same."""
        self._back_to_list()
        option = self._row.option if self._row is not None else None
        if event.line.id == "settings-search":
            self._search(event.value)
        elif option is not None:
            value = f"[{', '.join(event.value.replace(',', ' ').split())}]" if option.several else event.value
            found, problems = read(f"{option.name}: {value}\n")
            if problems:
                self.say(f"{problems[0].why}; nothing was changed")
            else:
                self._change(f"{option.name}: {event.value or 'all'}", **{option.name: getattr(found, option.name)})

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Leave a line; after a search all lines are shown."""
        self._back_to_list()
        if event.line.id == "settings-search":
            self._search("")

    def _search(self, words: str) -> None:
        self._words = words
        self._show_rows()

    def _back_to_list(self) -> None:
        self.query_one("#settings-said").display = True
        self.query_one(KeyBar).show_instead("")
        self._list.focus()

    def command_back(self) -> None:
        if self._words:
            self._search("")
        else:
            self.context.leave_screen()
            if self.context.settings != self.context.saved_settings:
                self.context.say("the settings count until you quit; F2 w keeps them")


class KeyDialog(Dialog[str | None]):
    """Takes the key that is pressed; None on Esc. A key that can't be is told, and another one waited for."""

    KEYS_HERE = "the next key is taken  Esc leaves it as it was"

    def __init__(self, command: str, settings: Settings) -> None:
        super().__init__()
        self._command, self._settings = command, settings

    def compose(self) -> ComposeResult:
        """Yield what is asked for, and why a key can't be."""
        with Vertical(classes="dialog"):
            yield Static(f"Press the key of {label(self._command)}", classes="dialog-title", markup=False)
            yield Static(BY_ID[self._command].help, markup=False)
            yield Static("", id="key-problem", markup=False)

    def on_key(self, event: events.Key) -> None:
        """Take the key, whatever it is bound to elsewhere."""
        event.stop()
        event.prevent_default()
        if event.key == "escape":
            self.dismiss(None)
            return
        problem = key_problem(event.key) or _clash({**self._settings.keys, self._command: event.key}, self._command)
        if problem:
            self.query_one("#key-problem", Static).update(f"{problem}; press another")
        else:
            self.dismiss(event.key)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave every key to `on_key`, those of the app and of Textual too."""
        return False


def _clash(keys: dict[str, str], command: str) -> str:
    """Return which command has a key of `command` already."""
    for mine, theirs, key, scope in clashes(keys):
        if command in (mine, theirs):
            other = theirs if mine == command else mine
            return f"{key_text(key)} is {label(other)} already ({scope})"
    return ""


def _shown(file: Path) -> str:
    home = str(Path.home()) if Path.home() != Path("/") else "\0"
    return str(file).replace(home + "/", "~/", 1) if str(file).startswith(home + "/") else str(file)
