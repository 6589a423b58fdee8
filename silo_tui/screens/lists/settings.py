"""The user's settings: each changed by a key, shown at once, kept by `w`."""

import string
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import msgspec
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from silo_tui.actions import BY_ID, COMMANDS, key_of, key_text, places_of, with_keys
from silo_tui.keymap import DESTROYS, clashes, keys_in
from silo_tui.modal import Dialog, ask
from silo_tui.model.lists.ordering import Order
from silo_tui.screens.lists.list_screen import ListScreen
from silo_tui.settings.file import path
from silo_tui.settings.keys import key_problem, label
from silo_tui.settings.options import OPTIONS, Option, Settings, typed
from silo_tui.settings.reading import read
from silo_tui.settings.writing import write_file
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.inputs import Line

NAMES = 20
FREE = (*string.ascii_letters, *(f"f{number}" for number in range(1, 13)))  # keys to offer
TYPING_KEYS = "Enter takes it  Tab completes  Esc leaves it as it was"


@dataclass(frozen=True)
class SettingRow:
    """One line: an option, a command whose keys can be changed, or (with neither) words alone."""

    id: str
    option: Option | None = None
    command: str = ""
    words: str = ""


def all_rows(problems: Sequence[str], width: int, keymap: str) -> list[SettingRow]:
    """Return the lines: what is wrong with the file, whole, options, then the keys of every command."""
    told = [part for problem in problems for part in wrap(f"! {problem}", max(20, width - 2), subsequent_indent="  ")]
    rows = [SettingRow(f"problem {place}", words=part) for place, part in enumerate(told)]
    rows += [SettingRow(option.name, option=option) for option in OPTIONS]
    return rows + [SettingRow(f"key {each.id}", command=each.id) for each in COMMANDS if keys_in(keymap, each.id)]


def row_text(row: SettingRow, settings: Settings, saved: Settings, *, width: int | None) -> Text:
    """Return a line of so many cells, None: all that there is to say; `*` in front: not written yet."""
    if row.option is not None:
        option = row.option
        is_new = getattr(settings, option.name) != getattr(saved, option.name)
        line = Text(f" {'*' if is_new else ' '}{option.name:<{NAMES}} ")
        return _values(line, option, getattr(settings, option.name), width)
    if row.command:
        command, own = BY_ID[row.command], row.command in settings.keys
        is_new = settings.keys.get(row.command) != saved.keys.get(row.command)
        line = Text(f" {'*' if is_new else ' '}{'key ' + row.command:<{NAMES}} ")
        now = with_keys(command)  # that of another screen, where the user gave the same there one
        if own:
            keys = keys_in(settings.keymap, row.command, settings.keys)
            now = msgspec.structs.replace(command, keys=keys)
        line.append(now.key_text, style="bold")
        if own:
            before = keys_in(settings.keymap, row.command).split(",")
            gone = ", ".join(key_text(each) for each in before if each not in keys.split(","))
            line.append(f"  (yours; {gone} no longer)" if gone else "  (yours)")
        at = f" ({places})" if (places := places_of([command])) else ""
        line.append(f"  {command.label}{at}" + (f": {command.help}" if command.help != command.label else ""))
        return line
    return Text(row.words, style="bold")


def _values(line: Text, option: Option, value: Any, width: int | None) -> Text:
    if not option.words:
        return line.append(typed(value), style="bold").append(f"   {option.meaning}, {option.range_text}")
    chosen = (value or option.words) if option.several else (value,)
    for word in option.words:
        is_chosen = word in chosen
        mark = ("[x] " if is_chosen else "[ ] ") if option.several else ("► " if is_chosen else "  ")
        line.append(mark + word, style="bold" if is_chosen else "").append("  ")
    place = option.words.index(value) if not option.several else -1
    notes = [notes[place] for notes in (option.samples, option.meanings) if notes and place >= 0 and notes[place]]
    if option.several and not value:
        notes = ["none chosen: all"]
    begin = "│ "  # else it reads as one of the words
    for note in [*notes, option.meaning] if width is None else notes or [option.meaning]:
        if width is None or line.cell_len + len(begin + note) < width - 4:
            line.append(f"{begin}{note}  ")
            begin = ""
    return line


class SettingsScreen(ListScreen[SettingRow]):
    """A list of lines; `take` makes everything follow other settings."""

    scope = "settings"
    orders = (Order("settings", "", "as they stand", lambda row: 0),)
    filter_hint = "words of a setting or a command"

    def __init__(self, take: Callable[[Settings], None]) -> None:
        super().__init__()
        self._take = take
        self._typed_of: Option | None = None  # what is typed in the line is of
        self._arrows_at = ""  # the row in which arrows chose last

    def above(self) -> ComposeResult:
        yield Static(f" silo settings  {_shown(path())}", id="settings-title", markup=False)

    def typed_lines(self) -> ComposeResult:
        yield Line(self._completions, "", "settings-value")

    def settings_changed(self) -> None:
        self.show()

    @property
    def all(self) -> Sequence[SettingRow]:
        problems = [str(problem) for problem in self.context.settings_problems]
        return all_rows(problems, self.size.width, self.context.settings.keymap)

    def key_of(self, one: SettingRow) -> str:
        return one.id

    def told(self, one: SettingRow) -> str:
        return row_text(one, self.context.settings, self.context.saved_settings, width=None).plain

    def row_of(self, one: SettingRow, width: int) -> Text:
        return row_text(one, self.context.settings, self.context.saved_settings, width=width)

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return the way back from what the line under the cursor has otherwise than without a file."""
        row, settings = self.chosen, self.context.settings
        option = row.option if row is not None else None
        is_other = option is not None and getattr(settings, option.name) != getattr(Settings(), option.name)
        is_own = row is not None and row.command in settings.keys
        return (("default_setting", "Default"),) if is_own or is_other else ()

    def move(self, place: int) -> None:
        self._arrows_at = ""
        super().move(place)

    def follow(self, known: str, place: int | None) -> int | None:
        """Return where the cursor goes: first to a setting, below what is wrong with the file."""
        if not known and not self.asked:
            return next((at for at, row in enumerate(self.shown) if row.option is not None), 0)
        return super().follow(known, place)

    def _change(self, words: str, **fields: Any) -> None:
        self._take(replace(self.context.settings, **fields))
        self.say(f"{words}; {key_of('write_settings')} writes it to the file")

    # ------------------------------------------------------------------------------------------------ changing

    def command_change_setting(self) -> None:
        row = self.here()
        if row is None:
            return
        if row.command:
            command = row.command
            ask(self, KeyDialog(command, self.context.settings), lambda key: self._take_key(command, key))
        elif row.option is not None and row.option.words and not row.option.several:
            if self._arrows_at == row.id:  # who chose with the arrows says yes to that
                word = getattr(self.context.settings, row.option.name)
                self.say(f"{row.option.name} is {word} already; {key_of('write_settings')} writes it to the file")
                return
            self._choose(row.option, 1)
        elif row.option is not None:
            self._typed_of, value = row.option, getattr(self.context.settings, row.option.name)
            line = self.query_one("#settings-value", Line)
            line.placeholder = f"e.g. {' '.join(row.option.words[:3])}; nothing: all" if row.option.several else ""
            self.query_one(KeyBar).show_instead(f"{row.option.name}: {TYPING_KEYS}")
            line.begin(" ".join(value) if row.option.several else typed(value))

    enter = command_change_setting

    def command_choose_word(self, step: int) -> None:
        option = row.option if (row := self.chosen) is not None else None
        if option is not None and option.several:
            self.command_change_setting()
            return
        if option is None or not option.words:
            self.say(f"{key_of('change_setting')} changes this one")
            return
        self._arrows_at = option.name
        self._choose(option, step)

    def _choose(self, option: Option, step: int) -> None:
        place = option.words.index(getattr(self.context.settings, option.name))
        word = option.words[(place + step) % len(option.words)]
        self._change(f"{option.name}: {word}", **{option.name: word})

    def command_default_setting(self) -> None:
        row, settings = self.here(), self.context.settings
        if row is None:
            return
        if row.command:
            keys = {command: own for command, own in settings.keys.items() if command != row.command}
            if (problem := _clash(settings.keymap, keys, row.command)) and row.command in settings.keys:
                self.say(f"not given back: {problem}")
                return
            own = keys_in(settings.keymap, row.command)
            self._change(f"{row.command}: {msgspec.structs.replace(BY_ID[row.command], keys=own).key_text}", keys=keys)
        elif row.option is not None:
            value = getattr(Settings(), row.option.name)
            self._change(f"{row.option.name}: {typed(value) if value else 'all'}", **{row.option.name: value})

    def _take_key(self, command: str, key: str) -> None:
        settings = self.context.settings
        keys = {**settings.keys, command: key}
        if key == keys_in(settings.keymap, command):  # what it has without a file is nobody's own
            del keys[command]
        self._change(f"{command}: {key_text(key)}", keys=keys)

    def command_write_settings(self) -> None:
        context = self.context
        with context.telling(tell=self.say):
            written = write_file(context.saved_settings, context.settings)
            context.saved_settings = context.settings
            self.show()
            self.say(f"written: {_shown(written)}")

    # --------------------------------------------------------------------------------------------- typed lines

    def _completions(self, line: str) -> list[str]:
        head, _, last = line.rpartition(" ")
        words = self._typed_of.words if self._typed_of is not None else ()
        return [f"{head} {word}".lstrip() for word in words if word.startswith(last) and word != last]

    def entered(self, value: str) -> None:
        """Take what was typed; it is read as the file is, so the words are the same."""
        option = self._typed_of
        if option is not None:
            line = f"[{', '.join(value.replace(',', ' ').split())}]" if option.several else value
            found, problems = read(f"{option.name}: {line}\n")
            if problems:
                self.say(f"{problems[0].why}; nothing was changed")
            else:
                self._change(f"{option.name}: {value or 'all'}", **{option.name: getattr(found, option.name)})

    def leave(self) -> None:
        super().leave()
        if self.context.settings != self.context.saved_settings:
            keys = f"{key_of('settings')} {key_of('write_settings')}"
            self.context.say(f"the settings count until you quit, which asks; {keys} keeps them")


class KeyDialog(Dialog[str | None]):
    """Takes the key that is pressed; None on Esc. A key that can't be is told, and another one waited for."""

    KEYS_HERE = "the next key you press is used  Esc leaves it as it was"

    def __init__(self, command: str, settings: Settings) -> None:
        super().__init__()
        self._command, self._settings = command, settings

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog"):
            yield Static(f"Press the key of {label(self._command)}", classes="dialog-title", markup=False)
            yield Static(BY_ID[self._command].help, markup=False)
            free = " ".join(map(key_text, free_keys(self._command, self._settings)))
            yield Static(
                f"now {with_keys(BY_ID[self._command]).key_text or 'none'}; free: {free or 'none'}", markup=False
            )
            yield Static("", id="key-problem", markup=False)

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()
        if event.key == "escape":
            self.dismiss(None)
            return
        problem = key_problem(event.key) or _clash(
            self._settings.keymap, {**self._settings.keys, self._command: event.key}, self._command
        )
        if problem:
            self.query_one("#key-problem", Static).update(f"{problem}; press another")
        else:
            self.dismiss(event.key)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave every key to `on_key`, those of the app and of Textual too."""
        return False


def free_keys(command: str, settings: Settings) -> list[str]:
    """Return the letters and F keys that no other command has on a screen of this one."""
    mine = {*keys_in(settings.keymap, command, settings.keys).split(","), DESTROYS}
    others = (key for key in FREE if key not in mine)
    return [key for key in others if not _clash(settings.keymap, {**settings.keys, command: key}, command)]


def _clash(keymap: str, keys: dict[str, str], command: str) -> str:
    """Return which command has a key of `command` already."""
    for mine, theirs, key, scope in clashes(keymap, keys):
        if command in (mine, theirs):
            other = theirs if mine == command else mine
            return f"{key_text(key)} is {label(other)} already ({scope})"
    return ""


def _shown(file: Path) -> str:
    home = str(Path.home()) if Path.home() != Path("/") else "\0"
    return str(file).replace(home + "/", "~/", 1) if str(file).startswith(home + "/") else str(file)
