"""Marking a moment: its tick is that of the key press, however long one types its words."""

from silo.core.episodes.words import VERDICTS
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.modal import run_aside
from silo_tui.screens.dialogs.questions import Prompt


def ask_mark(context: Context, at_ns: int) -> None:
    """Ask for the words of a mark, and set it; Esc sets none."""

    def carry_out(words: str | None) -> None:
        if words is not None:
            run_aside(context.app, "mark", _mark, context, words.strip() or "marker", at_ns)

    body = "Its tick is taken; words may follow."
    context.app.push_screen(Prompt("Mark this moment", body, "", "marker"), carry_out)


def ask_episode(context: Context) -> None:
    """Ask for the name of an episode, and begin it; Esc begins none."""

    def carry_out(name: str | None) -> None:
        if name is not None:
            run_aside(context.app, "mark", say_of_episode, context, "begin", name)

    keys = ", ".join(f"{key_of(f'episode_{word}')} {word}" for word in VERDICTS)
    body = f"Its name may follow. How it went ends it: {keys}."
    context.app.push_screen(Prompt("Begin an episode", body, "", "episode"), carry_out)


async def say_of_episode(context: Context, word: str, name: str) -> None:
    """Say something of an episode of the logger, and what became of it."""

    async def say() -> None:
        event = await context.session.say_of_episode(word, name.strip())
        context.say(f"tick {event.tick}: {event.text}")

    await context.quietly(say())


async def _mark(context: Context, words: str, at_ns: int) -> None:
    async def mark() -> None:
        event = await context.session.mark(words, at_ns)
        context.say(f'marked tick {event.tick}: "{event.text}"')

    await context.quietly(mark())
