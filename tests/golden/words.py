"""Every word of `silo --help`: the commands, what they take, what they say of it."""

from inspect import cleandoc

import click

from silo.cli.group import cli as silo
from silo_tui.cli import command as silo_tui


def told() -> list[str]:
    """Return the help of all commands as lines, without what click lays out differently from version to version."""
    return [*of_command("silo", silo), *of_command("silo-tui", silo_tui)]


def of_command(name: str, command: click.Command) -> list[str]:
    """Return what a command and those below it say."""
    texts = [cleandoc(text) for text in (command.help, command.epilog) if text]  # as Python 3.13 has them by itself
    lines = [f"== {name}", *(line for text in texts for line in text.splitlines())]
    for one in command.params:
        words = " ".join([*one.opts, *(f"/{other}" for other in one.secondary_opts)])
        lines.append(f"{words} {kind_of(one)}: {getattr(one, 'help', None) or ''}")
    if isinstance(command, click.Group):
        context = click.Context(command)
        for each in command.list_commands(context):
            inner = command.get_command(context, each)
            assert inner is not None
            lines += of_command(f"{name} {each}", inner)
    return lines


def kind_of(one: click.Parameter) -> str:
    """Return what a parameter takes."""
    marks = [
        word
        for word, there in (
            ("flag", getattr(one, "is_flag", False)),
            ("required", one.required),
            ("many", one.nargs == -1 or getattr(one, "multiple", False)),
            ("hidden", getattr(one, "hidden", False)),
        )
        if there
    ]
    choices = f"{list(one.type.choices)}" if isinstance(one.type, click.Choice) else ""
    bounds = f"{one.type.min}..{one.type.max}" if isinstance(one.type, click.IntRange | click.FloatRange) else ""
    told = [one.metavar or "", choices, bounds, *marks]
    return " ".join(word for word in told if word)
