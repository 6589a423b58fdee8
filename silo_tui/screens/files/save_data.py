"""The dialog that writes logged data to files: which types, which name, progress, and what came of it."""

import asyncio
import re
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult, RenderResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.reactive import reactive
from textual.widget import Widget
from textual.widgets import Button, Input, ProgressBar, Static

from silo.core.arguments import check_name
from silo.core.elements import FileType, SavedFile
from silo.core.quantities.writing import duration, size_text
from silo.errors import SiloError
from silo.files.formats import SAVED, SAVED_NAMES
from silo.files.naming import custom_path, files_text, with_part
from silo.rpc.published import Event, EventKind
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.modal import run_aside
from silo_tui.model.words import text
from silo_tui.screens.dialogs.form import Form
from silo_tui.unforeseen import Guarded


class CheckLine(Guarded, Widget, can_focus=True):
    """`[x] label`; space, x or a click turn it over. A `>` in front shows the focus, also without colours."""

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("space,x", "turn", "Turn", show=False)
    ]
    value: reactive[bool] = reactive(False)

    def __init__(self, label: str, value: bool, id: str) -> None:  # noqa: A002 - Textual's word
        super().__init__(id=id)
        self._label = label
        self.set_reactive(CheckLine.value, value)

    def render(self) -> RenderResult:
        return Text(f"{'>' if self.has_focus else ' '} [{'x' if self.value else ' '}] {self._label}")

    def action_turn(self) -> None:
        """Turn it over."""
        self.value = not self.value

    def on_click(self) -> None:
        self.action_turn()


FOLLOW_S = 0.05
_PART = re.compile(r"_part\d+$")
A_PART = "a part of a run: applying edits while it logs begins a new file; opening any one of them opens all"
SCRIPT = "W"  # no small letter: names are typed here, too
TICKS = dict[str, str]()  # the key of each type: the first letter of its name that is free
for _name in SAVED_NAMES:
    TICKS[next(letter for letter in _name if letter not in ("j", "k", "o", "x", *TICKS))] = _name
KEYS = f"↑↓ Move  space {' '.join(TICKS)} Tick  {SCRIPT} Script  Enter Saves  Esc Back"

KEYS_OF_NAME = "↑↓ Move  Enter Saves  Esc Back"  # letters are of the name


class SaveDialog(Form[list[SavedFile]]):
    """Asks what to save, saves, shows where it went. Saving takes place in the logger's helper process."""

    KEYS_HERE = KEYS
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("down,j", "app.focus_next", show=False),
        Binding("up,k", "app.focus_previous", show=False),
        *(Binding(letter, f"turn('{name}')", show=False) for letter, name in TICKS.items()),
        Binding(SCRIPT, "script", show=False),
        Binding("enter,ctrl+s", "save", show=False),
        Binding("o", "open", show=False),
    ]

    def __init__(
        self,
        context: Context,
        types: Sequence[FileType] = (FileType.SILO,),
        name: str = "",
        *,
        at_once: bool = False,
        go_on: bool = False,
    ) -> None:
        hints = {"name": "empty: date, time and run number"}
        super().__init__("Save data", (("name",),), {"name": name}, hints)
        self.context = context
        self._types, self._at_once = tuple(types), at_once
        self.begins_anew = at_once
        self._go_on = go_on  # leaves by itself when the files are there
        self._saving = False
        self._files: list[SavedFile] | None = None
        self._asked: list[SavedFile] | None = None  # of the last save
        self._told, self._failed = "", False  # of it, until something else is to be

    def above(self) -> ComposeResult:
        folder = self.context.session.status.folder or "the folder of the logger"
        yield Static(f"in {folder}, on the robot", classes="quiet", markup=False)
        marked = self.context.session.rows.marked_count
        all_of_it = f"all elements, not the {marked} marked alone" if marked else "what was logged"
        script = f"; {SCRIPT} saves the script instead, elsewhere {key_of('save_script')}"
        yield Static(all_of_it if self._go_on else all_of_it + script, classes="quiet", markup=False)
        for kind, one in SAVED.items():
            yield CheckLine(f"{one.name:<5} {one.about}", kind in self._types, f"type-{one.name}")

    def below(self) -> ComposeResult:
        yield ProgressBar(total=1.0, show_eta=False, id="save-progress")
        with Horizontal(classes="dialog-buttons"):
            yield Button("Save", id="save-go", compact=True, variant="primary")
            yield Button("Cancel", id="save-no", compact=True)

    def on_mount(self) -> None:
        """Give the focus to the first line; Enter saves from there too."""
        self.query_one(ProgressBar).display = False
        self.query_one(CheckLine).focus()
        for line in self.query(CheckLine):
            self.watch(line, "value", self.changed, init=False)
        self.look_soon()
        if self._at_once:
            self._begin()

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        """Name the keys that count there."""
        super().on_descendant_focus(event)
        if self._files is None:
            self.KEYS_HERE = KEYS_OF_NAME if isinstance(event.widget, Input) else KEYS
            if (screen := self.context.upper_screen) is not None:
                screen.show_keys_above()

    def on_button_pressed(self, event: Button.Pressed) -> None:
        if event.button.id == "save-go":
            self.answer()
        else:
            self.action_leave()

    def answer(self) -> None:
        """Save from wherever the focus is; closes when that is done."""
        if self._files is None:
            self._begin()
        else:
            self.action_leave()

    action_save = answer

    def made(self) -> list[SavedFile]:
        """Return the files that are to be. Raises SaveError for a name that can't be one, ValueError without a type."""
        types = [kind for kind, one in SAVED.items() if self.query_one(f"#type-{one.name}", CheckLine).value]
        if not types:
            raise ValueError("Choose at least one type.")
        name = self.fields["name"]
        return [SavedFile(check_name(name) if name else "", kind, 0) for kind in types]

    async def look(self) -> str:
        """Return what would be written of how much; of a save that began, how it stands."""
        session = self.context.session
        if not self._stands():
            await session.refresh_status()  # which counts what is held
        if self._stands():  # also of a save that began meanwhile
            return self._told
        files, status = self.made(), session.status
        paths = [custom_path("", one.path or f"{status.logger}_…", SAVED[one.type].ending) for one in files]
        names = ", ".join(with_part(path, status.part).name for path in paths)
        held = f"{text.count(status.held_samples)} samples, {duration(status.held_s)} at most"
        held += "; each part before it goes to a file of its own" * (status.part > 1)
        return f"{names}: {held}" if status.held_samples else f"{names}: would have no sample, none is held"

    def _stands(self) -> bool:
        return bool(self._told) and (self._saving or self._files is not None or self.made() == self._asked)

    def action_turn(self, kind: str) -> None:
        """Tick a type, or not."""
        if self._files is None and not self._saving:
            self.query_one(f"#type-{kind}", CheckLine).action_turn()

    def action_script(self) -> None:
        """Go on to saving the script, where nothing was saved yet."""
        screen = self.context.upper_screen
        if screen is not None and self._files is None and not (self._saving or self._go_on):
            self.dismiss()
            screen.action_command("save_script")

    def action_open(self) -> None:
        """Look into what was saved."""
        from silo_tui.screens.files.opened import open_saved

        if self._files and not self._go_on:
            context, files = self.context, self._files
            self.dismiss(files)
            context.open_over(self.app, "opening what was saved", open_saved, context, context.session, files)

    def action_leave(self) -> None:
        """Leave; a save that is under way goes on in the helper process."""
        if self._saving:
            self.context.say("the save goes on; its end will be told")
        elif self._files is None:
            self.context.say("nothing was saved")
        self.dismiss(self._files)

    def _begin(self) -> None:
        if self._saving:
            return
        try:
            files = self.made()
        except (SiloError, ValueError) as error:
            self.refuse(str(error))
            return
        self._saving, self._asked, self._given = True, files, self.fields
        self.query_one(ProgressBar).display = True
        self.query_one(ProgressBar).update(progress=0.0)
        self._result("Saving …")
        # of the app: a worker of this dialog would end with it, and with it the word of how the save went
        run_aside(self.app, "saving", self._save, [one.type for one in files], files[0].path)

    async def _save(self, types: list[FileType], name: str) -> None:
        context, session = self.context, self.context.session
        try:
            job = await context.link.call(lambda client: client.save(types, name))
        except SiloError as error:
            self._saving = False
            if self in self.app.screen_stack:
                self._result(str(error), failed=True)
            else:  # it was left while the logger was asked
                context.fail(str(error))
            return
        while self._saving:
            event, lost = session.saves.get(job), not session.connected
            if self in self.app.screen_stack:
                self._follow(event, lost=lost)
            elif lost or (event is not None and event.kind is not EventKind.SAVING):
                self._saving = False
                self._tell(event)
            await asyncio.sleep(FOLLOW_S)

    def _tell(self, event: Event | None) -> None:
        """Say on the screen below how a save ended."""
        if event is not None and event.kind is EventKind.SAVED:
            self.context.say(f"saved: {files_text(event.files)}")
        elif event is not None and event.kind is EventKind.SAVE_FAILED:
            self.context.fail(f"not saved: {event.text}")
        else:
            self.context.fail(
                f"the link was lost during the save; it goes on without us: {key_of('recordings')} lists what is there"
            )

    def _follow(self, event: Event | None, *, lost: bool) -> None:
        """Show how far the save is; what is said of it comes as events."""
        bar = self.query_one(ProgressBar)
        if lost:
            self._saving = False
            self._result("The link is lost; the save goes on without us. Look into the folder.", failed=True)
        elif event is None:
            return
        elif event.kind is EventKind.SAVED:
            self._saving = False
            bar.update(progress=1.0)
            self._files = event.files
            self._tell(event)
            if self._go_on:
                self.dismiss(self._files)
                return
            where = [f"{file.path}\n  {size_text(file.size_bytes)}" for file in event.files]
            where += [A_PART] * any(_PART.search(Path(file.path).stem) is not None for file in event.files)
            self._result("\n".join(where))
            self.KEYS_HERE = "o Opens it  Enter Esc Close"
            if (screen := self.context.upper_screen) is not None:
                screen.show_keys_above()
            for done in [*self.query(CheckLine), *self.query(".form-line"), bar]:
                done.display = False  # three formats and where they are don't fit 80x24 together
            self.query_one("#save-go", Button).label = "Close"
            self.query_one("#save-no").display = False
            self.query_one("#save-go").focus()
        elif event.kind is EventKind.SAVE_FAILED:
            self._saving = False
            bar.display = False
            self._result(event.text, failed=True)
        else:
            bar.update(progress=event.progress)

    def _result(self, words: str, *, failed: bool = False) -> None:
        self._told, self._failed = words, failed
        self.tell(words)

    def tell(self, words: str, style: str = "") -> None:
        """Say it; a save that failed stands as such, however often that is said."""
        super().tell(words, "failed" if self._failed and words == self._told else style)
