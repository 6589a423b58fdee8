"""Edit one trigger: lines for what it says, and below them what it would have done in all that is held."""

from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.timer import Timer
from textual.widgets import Input, Static

from silo.errors import SiloError
from silo.model import TriggerOptions
from silo_tui.context import Later
from silo_tui.modal import Dialog
from silo_tui.model.conditions import fields_of, options_of_fields, tried_lines
from silo_tui.sessions.live import Session

TRY_AFTER_S = 0.5  # since the last key
UNNAMED = "name it before Enter: the name stands in names of files"
LINES = (("name", "mode"), ("when",), ("rearm",), ("pre", "post"), ("persist", "holdoff"), ("save", "keep"))
HINTS = {
    "name": "a word for names of files", "when": "abs(base/roll) > 0.6 and controller/mode == STANCE",
    "rearm": "else: the condition was false", "pre": "5s", "post": "1s", "persist": "20ms", "holdoff": "10s",
    "mode": "normal single, rising falling level", "save": "silo csv bag", "keep": "newest so many, 0 all",
}  # fmt: skip


class TriggerEditor(Dialog[TriggerOptions | None]):
    """Answers with the trigger on Enter, None on Esc."""

    KEYS_HERE = "Enter Sets it  Tab Next field  Esc Back"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False)
    ]

    def __init__(self, session: Session, options: TriggerOptions, *, is_new: bool) -> None:
        super().__init__()
        self._session = session
        self._options = options
        self._is_new = is_new
        self._timer: Timer | None = None

    def compose(self) -> ComposeResult:
        """Yield title, lines to type in, what the test says."""
        where = f"on {self._session.name}"
        title = f"New trigger {where}" if self._is_new else f"Trigger {self._options.name} {where}"
        fields = fields_of(self._options)
        with Vertical(classes="dialog", id="trigger-editor"):
            yield Static(title, classes="dialog-title", markup=False)
            for names in LINES:
                with Horizontal(classes="trigger-line"):
                    for name in names:
                        yield Static(name, classes="trigger-label", markup=False)
                        yield Input(fields[name], placeholder=HINTS[name], compact=True, id=f"trigger-{name}")
            yield Static("", id="trigger-told", markup=False)

    def on_mount(self) -> None:
        """Begin with the condition where there is none yet, else with the name."""
        self.query_one("#trigger-name" if self._options.when and self._is_new else "#trigger-when", Input).focus()
        self._try_soon()

    def _fields(self) -> dict[str, str]:
        return {name: self.query_one(f"#trigger-{name}", Input).value for names in LINES for name in names}

    def _made(self) -> TriggerOptions:
        return options_of_fields(self._fields(), self._options)

    def _tell(self, words: str) -> None:
        for line in self.query("#trigger-told").results(Static):  # none of an editor that was left
            line.update(Text(words))

    # ------------------------------------------------------------------------------------------------------- trying

    def on_input_changed(self, event: Input.Changed) -> None:
        """Try it when the keys rest."""
        self._try_soon()

    def _try_soon(self) -> None:
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.set_timer(
            TRY_AFTER_S, lambda: self.run_worker(Later(self._try), group="try", exclusive=True)
        )

    async def _try(self) -> None:
        if not self.query("#trigger-when"):
            return  # it was left
        if not self.query_one("#trigger-when", Input).value.strip():
            self._tell("the condition: signals, numbers with units, and or not, prev diff rate mean min max any all")
            return
        fields = self._fields()
        unnamed = not fields["name"].strip()
        try:  # the condition counts while there is no name yet
            made = options_of_fields({**fields, "name": "new"} if unnamed else fields, self._options)
        except (SiloError, ValueError) as error:
            self._tell(str(error))
            return
        link = self._session.link
        if link is None:
            return
        try:
            tried = await link.read(lambda client: client.try_trigger(made))
        except SiloError as error:
            self._tell(str(error))
            return
        width = next((line.content_size.width for line in self.query("#trigger-told")), 80)
        self._tell("\n".join([*tried_lines(tried, width, made.keep), *([UNNAMED] if unnamed else [])]))

    # ------------------------------------------------------------------------------------------------------- ending

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Answer with the trigger; what makes no sense is said, and the editor stays."""
        try:
            made = self._made()
        except (SiloError, ValueError) as error:
            self._tell(str(error))
            return
        if made.when:
            self.dismiss(made)
        else:
            self._tell("a trigger needs a condition, such as abs(base/roll) > 0.6")

    def action_leave(self) -> None:
        """Leave; nothing is set."""
        self.dismiss(None)
