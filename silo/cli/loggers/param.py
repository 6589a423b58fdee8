"""`silo param`: the parameters of a logger, read, set, kept as presets."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.codes import EXIT_FOUND
from silo.cli.verbs import Listing, LoggerFirst, Target, Words, verb
from silo.core.elements import PARAMETER
from silo.core.tuning.parameters import range_text, value_text
from silo.errors import RefusedError

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.tuning.parameters import ParameterInfo


@click.group(cls=LoggerFirst)
def param() -> None:
    """Read and set what a program offers to be tuned, and keep it as presets.

    \b
    Examples:
      silo param ls
      silo param set kp=50 kd=2
      silo param save walk.yaml
      silo param load walk.yaml
    """


def _assignments(ctx: click.Context, words: Sequence[str], usage: str) -> Target:
    """Take a logger, which may be left out, and words `NAME=VALUE`."""
    named = [word for word in words if "=" in word]
    others = [word for word in words if "=" not in word]
    if not named or len(others) > 1:
        raise click.UsageError(f"write {ctx.command_path} [LOGGER] {usage}", ctx)
    return Target(others[0] if others else None, named)


def _row(one: "ParameterInfo") -> tuple[str, ...]:
    changed = "" if one.value == one.default else value_text(one.default)
    writable = "excite" if one.input else one.writable.value
    return one.name, value_text(one.value), one.unit, range_text(one), changed, writable


PARAMETERS: "Listing[list[ParameterInfo]]" = Listing(
    ("NAME", "VALUE", "UNIT", "RANGE", "DEFAULT", "WRITABLE"),
    _row,
    "no parameters; `log.parameter(...)` declares them in the program",
    right=(1,),
)


@verb(param, "ls", shown=PARAMETERS)
def ls(client: "Client") -> "list[ParameterInfo]":
    """List the parameters: value, range, and the default where it is another one."""
    return client.parameters.described()


@verb(param, "get", "NAME")
def get(client: "Client", name: str) -> str:
    """Print the value of one parameter."""
    return value_text(client.parameters[name])


@verb(param, "set", "NAME=VALUE...", Words(_assignments))
def set_command(client: "Client", *words: str) -> str:
    """Set parameters, all or none, at the end of one tick; prints from which tick on they hold.

    \b
    Examples:
      silo param set demo kp=50 kd=2
      silo param set demo gains=1,2,3 'surface=dry floor'
    """
    from silo.core.tuning.parameters import only_meant
    from silo.settings.presets import typed_value

    known = {one.name: one for one in client.parameters.described()}
    values = {}
    for name, _, value in (word.partition("=") for word in words):
        info = known[only_meant(name, known)]
        if info.name in values:
            raise click.UsageError(f"parameter '{info.name}' is given twice; nothing was changed")
        values[info.name] = typed_value(info, value)
    return client.parameters.set(values).text


@verb(param, "watch")
def watch(client: "Client") -> None:
    """Print each change from now on, whoever makes it: when, from which tick, what it was; until Ctrl-C."""
    from silo.cli.loggers.events import watch_kind

    watch_kind(client, PARAMETER)


@verb(param, "save", "FILE.yaml")
def save(client: "Client", file: str) -> str:
    """Write all values to a preset on this computer; lines and comments of one that is there stay."""
    from silo.settings.presets import write_preset

    values = {one.name: one.value for one in client.parameters.described() if not one.input}
    return f"{write_preset(file, values)}: {len(values)} parameters"


@verb(param, "load", "FILE.yaml")
def load(client: "Client", file: str) -> str:
    """Set what a preset on this computer says, as one change: all or nothing."""
    from silo.settings.presets import read_preset

    known = client.parameters.described()
    now = {one.name: one.value for one in known}
    values = {name: value for name, value in read_preset(Path(file), known).items() if now[name] != value}
    try:
        return client.parameters.set(values).text if values else "nothing differs, nothing was changed"
    except RefusedError as refused:
        raise RefusedError(f"{file}: {refused}") from None


@verb(param, "diff", "FILE.yaml")
def diff(client: "Client", file: str) -> None:
    """Show where a preset on this computer and the present values differ; exit code 4 where they do."""
    from silo.settings.presets import read_preset

    known = {one.name: one for one in client.parameters.described()}
    preset = read_preset(Path(file), list(known.values()))
    differs = [name for name, value in preset.items() if known[name].value != value]
    for name in differs:
        click.echo(f"{name}: {value_text(known[name].value)} now, {value_text(preset[name])} in {file}")
    if differs:
        click.get_current_context().exit(EXIT_FOUND)
