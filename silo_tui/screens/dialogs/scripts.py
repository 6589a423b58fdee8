"""Choosing a script on the robot, with what loading it would change."""

from collections.abc import Sequence
from pathlib import PurePosixPath

from rich.text import Text

from silo.core.elements import FieldChange
from silo.core.quantities.writing import and_more, many
from silo.errors import SiloError
from silo.scripts.requests import ScriptDiff, Scripts
from silo.settings.conditions_diff import NONE
from silo_tui.actions import key_of
from silo_tui.model.words.names import below
from silo_tui.screens.dialogs.questions import Choice, Question, end_words, groups_text
from silo_tui.sessions.link import Link

AS_BEGUN = "/"  # in place of a name, which it can't be


def scripts_question(
    link: Link, scripts: Scripts, pending: str = "", prefix: str = "", otherwise: Sequence[str] = ()
) -> Question:
    """Return the question which script to load, with what the one under the cursor would change in the logger.

    `pending` are edits in words, which no script touches; names are told without `prefix`. `otherwise` are elements
    that the logger has otherwise than its program began with: that is offered first.
    """

    async def preview(name: str) -> Text:
        if name == AS_BEGUN:
            names = and_more([below(prefix, each) for each in otherwise], 20, "\n")
            return Text(f"It would take back what became of {many(len(otherwise), 'element')} since:\n{names}")
        try:
            return script_diff_text(await link.read(lambda client: client.diff_script(name)), prefix)
        except SiloError as error:
            return Text(f"It can't be loaded:\n{error}")

    current = PurePosixPath(scripts.current).name
    none = (
        ": Enter loads one; below, what it would change"
        if scripts.names
        else f": none yet; {key_of('save_script')} saves the present settings as one"
    )
    choices = [Choice(AS_BEGUN, "as the program began")] * bool(otherwise)
    choices += [Choice(name, f"{name}  (current)" if name == current else name) for name in scripts.names]
    body = f"in {scripts.folder}, on the robot{none}"
    body += f"\nKept, whatever is loaded: {pending}" if pending else ""
    return Question("Load a script", body, choices, current, preview if choices else None)


def _conditions_text(conditions: Sequence[FieldChange]) -> Text:
    """Return differences of derived signals, limits and triggers, those of one below its name."""
    lines = Text()
    for name in dict.fromkeys(change.name for change in conditions):
        lines.append(f"{name}\n", style="bold")
        for change in conditions:
            if change.name == name:
                lines.append(f"  {change.field} {change.old} → {change.new}\n" if change.field else _whole(change))
    return lines


def _whole(change: FieldChange) -> str:
    return f"  new: {change.new}\n" if change.old == NONE else f"  taken away: {change.old}\n"


def script_diff_text(diff: ScriptDiff, prefix: str = "") -> Text:
    """Return what a script would change, in words; names without `prefix`, as the table shows them."""
    lines = Text()
    lines.append(end_words(diff.end), style="bold")
    if not diff.changes and not diff.conditions:
        lines.append("It would change nothing.\n")
    elif diff.changes:
        elements = len({change.name for change in diff.changes})
        lines.append(f"It would change {many(elements, 'element')}:\n")
    lines.append_text(groups_text(diff.changes, prefix))
    if diff.conditions:
        lines.append("\n" * bool(diff.changes) + "Beside elements it would change:\n")
        lines.append_text(_conditions_text(diff.conditions))
    if diff.warnings:
        lines.append("\n" + "\n".join(diff.warnings) + "\n")
    if diff.unknown:
        unknown = [below(prefix, name) for name in diff.unknown]
        lines.append(f"\nNames that the logger doesn't have (they are left out): {and_more(unknown, 20)}")
    return lines
