"""Marking a moment: its tick is that of the key press, however long one types its words."""

from silo_tui.context import Context
from silo_tui.modal import run_aside
from silo_tui.screens.dialogs import Prompt


def ask_mark(context: Context, at_ns: int) -> None:
    """Ask for the words of a mark, and set it; Esc sets none."""

    def carry_out(words: str | None) -> None:
        if words is not None:
            run_aside(context.app, "mark", _mark, context, words.strip() or "marker", at_ns)

    body = "Its tick is taken; words may follow."
    context.app.push_screen(Prompt("Mark this moment", body, "", "marker"), carry_out)


async def _mark(context: Context, words: str, at_ns: int) -> None:
    async def mark() -> None:
        event = await context.session.mark(words, at_ns)
        context.say(f'marked tick {event.tick}: "{event.text}"')

    await context.quietly(mark())
