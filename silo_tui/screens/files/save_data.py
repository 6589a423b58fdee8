"""The dialog that writes logged data to files: which types, which name, progress, and what came of it."""

import asyncio
from collections.abc import Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widgets import Button, Input, ProgressBar, Static

from silo.core.elements import FileType, SavedFile
from silo.core.quantities.writing import size_text
from silo.errors import SiloError
from silo.files.formats import SAVED, SAVED_NAMES
from silo.rpc.published import Event, EventKind
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.modal import Dialog, run_alone, run_aside
from silo_tui.widgets.check_line import CheckLine

FOLLOW_S = 0.05
HINT = f"↑ ↓ move   space or {' '.join(name[0] for name in SAVED_NAMES)} ticks   Enter saves   Esc cancels"


class SaveDialog(Dialog[list[SavedFile] | None]):
    """Asks what to save, saves, shows where it went. Saving takes place in the logger's helper process."""

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False),
        Binding("down,j", "app.focus_next", show=False),
        Binding("up,k", "app.focus_previous", show=False),
        *(Binding(name[0], f"turn('{name}')", show=False) for name in SAVED_NAMES),
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
        super().__init__()
        self.context = context
        self._types, self._name, self._at_once = tuple(types), name, at_once
        self._go_on = go_on  # leaves by itself when the files are there
        self._saving = False
        self._files: list[SavedFile] | None = None

    def compose(self) -> ComposeResult:
        """Yield types, name, buttons, progress, result."""
        with Vertical(classes="dialog"):
            yield Static("Save data", classes="dialog-title")
            folder = self.context.session.status.folder or "the folder of the logger"
            yield Static(f"in {folder}, on the robot", classes="quiet", markup=False)
            for kind, one in SAVED.items():
                yield CheckLine(f"{one.name:<5} {one.about}", kind in self._types, f"type-{one.name}")
            yield Input(self._name, placeholder="name (empty: date, time and run number)", id="save-name", compact=True)
            with Horizontal(classes="dialog-buttons"):
                yield Button("Save", id="save-go", compact=True, variant="primary")
                yield Button("Cancel", id="save-no", compact=True)
            yield Static(HINT, id="save-hint", markup=False)
            yield ProgressBar(total=1.0, show_eta=False, id="save-progress")
            yield Static("", id="save-result", markup=False)

    def on_mount(self) -> None:
        """Give the focus to the first line; Enter saves from there too."""
        self.query_one(ProgressBar).display = False
        self.query_one(CheckLine).focus()
        if self._at_once:
            self._begin()

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """Save or leave."""
        if event.button.id == "save-go" and self._files is None:
            self._begin()
        else:
            self.action_leave()

    def on_input_submitted(self) -> None:
        """Save when Enter ends the name."""
        self.action_save()

    def action_turn(self, kind: str) -> None:
        """Tick a type, or not."""
        if self._files is None and not self._saving:
            self.query_one(f"#type-{kind}", CheckLine).action_turn()

    def action_save(self) -> None:
        """Save from wherever the focus is; closes when that is done."""
        if self._files is None:
            self._begin()
        else:
            self.action_leave()

    def action_open(self) -> None:
        """Look into what was saved."""
        from silo_tui.screens.files.opened import open_saved

        if self._files and not self._go_on:
            context, files = self.context, self._files
            self.dismiss(files)
            self.app.call_after_refresh(
                lambda: run_alone(self.app, "opening", open_saved, context, context.session, files)
            )

    def action_leave(self) -> None:
        """Leave; a save that is under way goes on in the helper process."""
        if self._saving:
            self.context.say("the save goes on; its end will be told")
        elif self._files is None:
            self.context.say("nothing was saved")
        self.dismiss(self._files)

    def _begin(self) -> None:
        types = [kind for kind, one in SAVED.items() if self.query_one(f"#type-{one.name}", CheckLine).value]
        if self._saving:
            return
        if not types:
            self._result("Choose at least one type.", failed=True)
            return
        self._saving = True
        self.query_one(ProgressBar).display = True
        self.query_one(ProgressBar).update(progress=0.0)
        self._result("Saving …")
        # of the app: a worker of this dialog would end with it, and with it the word of how the save went
        run_aside(self.app, "saving", self._save, types, self.query_one("#save-name", Input).value.strip())

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
        """Say on the screen below how a save ended whose dialog was left."""
        if event is not None and event.kind is EventKind.SAVED:
            self.context.say(f"saved: {', '.join(f'{one.path} ({size_text(one.size_bytes)})' for one in event.files)}")
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
            if self._go_on:
                self.dismiss(self._files)
                return
            self._result("\n".join(f"{file.path}\n  {size_text(file.size_bytes)}" for file in event.files))
            for done in [*self.query(CheckLine), self.query_one("#save-name"), bar]:
                done.display = False  # three formats and where they are don't fit 80x24 together
            self.query_one("#save-go", Button).label = "Close"
            self.query_one("#save-no").display = False
            self.query_one("#save-hint", Static).update("o opens it   Enter or Esc closes")
            self.query_one("#save-go").focus()
        elif event.kind is EventKind.SAVE_FAILED:
            self._saving = False
            bar.display = False
            self._result(event.text, failed=True)
        else:
            bar.update(progress=event.progress)

    def _result(self, words: str, *, failed: bool = False) -> None:
        result = self.query_one("#save-result", Static)
        result.update(words)
        result.set_class(failed, "failed")
