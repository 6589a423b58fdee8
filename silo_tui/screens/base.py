"""What all screens share: keys from the list of commands, and a command that goes to the screen or else to the app."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from textual.screen import Screen

from silo_tui.actions import BY_ID
from silo_tui.model.live import Frame
from silo_tui.widgets.inputs import Fleeting

if TYPE_CHECKING:
    from silo_tui.app import SiloApp

# edits are pending first and need nobody; these need the logger to answer
ASK_THE_LOGGER = {"start_stop", "restart", "apply", "save_data", "load_script", "save_script", "refresh"}


class SiloScreen(Screen[None]):
    """A full screen of the app."""

    scope = ""

    @property
    def silo(self) -> "SiloApp":
        """The app, by its own type."""
        return cast("SiloApp", self.app)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """While somebody types in a line, keys are letters."""
        typing = isinstance(self.focused, Fleeting) and self.focused.display
        return not typing or parameters == ("quit_now",)

    def action_command(self, command_id: str) -> None:
        """Does what a key, a click, the palette or the command line asks for."""
        command = BY_ID[command_id]
        if command.writes and not self.silo.may_write(command.label):
            return
        if command_id in ASK_THE_LOGGER and not self.silo.may_ask(command.label):
            return
        handler: Callable[[], Any] | None = getattr(self, f"command_{command_id}", None) or getattr(
            self.silo, f"command_{command_id}", None
        )
        if handler is not None:
            handler()

    # ------------------------------------------------------------------------------- what the app tells a screen

    def table_changed(self) -> None:
        """The table, its pending edits or the rows shown changed."""

    def status_changed(self) -> None:
        """The state of the logger or of the link changed."""

    def live_changed(self, frame: Frame) -> None:
        """New values came."""

    def second_passed(self) -> None:
        """What shows a time is to be painted again."""

    def wish_again(self) -> None:
        """Say again what this screen wants to see."""

    def say(self, words: str) -> None:
        """Shows the result of something that was done."""
