"""Choosing a script on the robot, with what loading it would change."""

from collections.abc import Sequence

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical, VerticalScroll
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo.core.elements import FieldChange
from silo.core.quantities.writing import many
from silo.errors import SiloError
from silo.scripts.requests import ScriptDiff, Scripts
from silo.settings.conditions_diff import NONE
from silo_tui.modal import run_alone
from silo_tui.model import text
from silo_tui.screens.dialogs import ListDialog, groups_text
from silo_tui.sessions.link import Link


class ScriptsDialog(ListDialog):
    """Lists the scripts; previews the one under the cursor; answers with its name."""

    def __init__(self, link: Link, scripts: Scripts) -> None:
        super().__init__()
        self._link = link
        self._scripts = scripts
        self.previewed = ""  # the script whose difference stands on the screen

    def compose(self) -> ComposeResult:
        """Yield list and preview."""
        with Vertical(classes="dialog tall"):
            yield Static("Load a script", classes="dialog-title")
            yield Static(f"in {self._scripts.folder}, on the robot. Enter loads it.", classes="quiet", markup=False)
            current = text.file_name(self._scripts.current)
            yield OptionList(
                *(
                    Option(Text(f" {name}{'  (current)' if name == current else ''}"), id=name)
                    for name in self._scripts.names
                )
            )
            with VerticalScroll(classes="dialog-body", can_focus=False):
                yield Static("", id="preview", markup=False)

    def on_mount(self) -> None:
        """Begin at the current script."""
        options = self.query_one(OptionList)
        options.focus()
        current = text.file_name(self._scripts.current)
        if self._scripts.names:
            options.highlighted = self._scripts.names.index(current) if current in self._scripts.names else 0
        else:
            self.query_one("#preview", Static).update("There is none yet. W saves the table as one.")

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Preview it."""
        if event.option.id is not None:
            run_alone(self, "writing", self._preview, event.option.id)

    async def _preview(self, name: str) -> None:
        preview = self.query_one("#preview", Static)
        self.previewed = ""
        preview.update("…")
        try:
            diff = await self._link.read(lambda client: client.diff_script(name))
        except SiloError as error:
            preview.update(f"It can't be loaded:\n{error}")
        else:
            preview.update(script_diff_text(diff))
            self.previewed = name


def _extras_text(extras: Sequence[FieldChange]) -> Text:
    """Return differences of derived signals, limits and triggers, those of one below its name."""
    lines = Text()
    for name in dict.fromkeys(change.name for change in extras):
        lines.append(f"{name}\n", style="bold")
        for change in extras:
            if change.name == name:
                lines.append(f"  {change.field} {change.old} → {change.new}\n" if change.field else _whole(change))
    return lines


def _whole(change: FieldChange) -> str:
    return f"  new: {change.new}\n" if change.old == NONE else f"  taken away: {change.old}\n"


def script_diff_text(diff: ScriptDiff) -> Text:
    """Return what a script would change, in words."""
    lines = Text()
    if not diff.changes and not diff.extras:
        lines.append("It would change nothing.\n")
    elif diff.changes:
        elements = len({change.name for change in diff.changes})
        lines.append(f"It would change {many(elements, 'element')}:\n")
    lines.append_text(groups_text(diff.changes))
    if diff.extras:
        lines.append("\n" * bool(diff.changes) + "Beside elements it would change:\n")
        lines.append_text(_extras_text(diff.extras))
    if diff.warnings:
        lines.append("\n" + "\n".join(diff.warnings) + "\n")
    if diff.unknown:
        lines.append(f"\nNames that the logger doesn't have (they are left out): {', '.join(diff.unknown[:20])}")
        lines.append(f" and {len(diff.unknown) - 20} more" if len(diff.unknown) > 20 else "")
    return lines
