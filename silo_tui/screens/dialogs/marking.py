"""Marking a moment: its tick is that of the key press, however long one types its words."""

from silo.core.episodes.words import VERDICTS
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.modal import ask, run_aside
from silo_tui.screens.dialogs.questions import Prompt


def ask_mark(context: Context, at_ns: int) -> None:
    """Ask for the words of a mark, and set it; Esc sets none."""
    prompt = Prompt("Mark this moment", "Its tick is taken; words may follow.", "", "marker")
    ask(context.app, prompt, lambda words: run_aside(context.app, "mark", _mark, context, words or "marker", at_ns))


def ask_episode(context: Context) -> None:
    """Ask for the name of an episode, and begin it; Esc begins none."""
    keys = ", ".join(f"{key_of(f'episode_{word}')} {word}" for word in VERDICTS)
    body = f"Its name may follow. How it went ends it: {keys}."
    prompt = Prompt("Begin an episode", body, "", "episode")
    ask(context.app, prompt, lambda name: run_aside(context.app, "mark", say_of_episode, context, "begin", name))


async def say_of_episode(context: Context, word: str, name: str) -> None:
    """Say something of an episode of the logger, and what became of it."""
    with context.quiet():
        event = await context.session.say_of_episode(word, name.strip())
        context.say(f"tick {event.tick}: {event.text}")


async def _mark(context: Context, words: str, at_ns: int) -> None:
    with context.quiet():
        event = await context.session.mark(words, at_ns)
        context.say(f'marked tick {event.tick}: "{event.text}"')
