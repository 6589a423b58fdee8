"""`silo derive`: signals that are computed from others wherever rows are read."""

import click

from silo.cli.common import complete_logger, connect, json_option, logger_argument, show_json, show_rows


class Derive(click.Group):
    """A group in which deriving needs no word of its own, and whose commands may come after the logger too."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the command before the logger; `silo derive power ...` is `silo derive add power ...`."""
        if len(args) > 1 and args[0] not in self.commands and args[1] in self.commands:
            args = [args[1], args[0], *args[2:]]
        elif args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = ["add", *args]
        return super().parse_args(ctx, args)


@click.group(cls=Derive)
def derive() -> None:
    """Derive signals from others: watched, plotted, saved, judged as elements are, at no cost for the control loop.

    Also while the logger runs. EXPRESSION is that of triggers and limits; a division has blanks on both sides.

    \b
    Examples:
      silo derive demo power 'joints/tau * joints/qd' --unit W
      silo derive rms 'sqrt(mean(imu/acc_z * imu/acc_z, 100ms))'
      silo derive ls
      silo derive rm demo power
    """


@derive.command(short_help="Derive a signal; the word `add` may be left out.")
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] NAME EXPRESSION", shell_complete=complete_logger)
@click.option("--unit", default="", metavar="UNIT", help="Instead of the one that follows from its signals.")
def add(words: tuple[str, ...], unit: str) -> None:
    """Derive a signal, or give the one of its name another expression.

    `silo script save` writes it to the logger's script.

    \b
    Example:
      silo derive demo power 'joints/tau * joints/qd' --unit W
    """
    if len(words) not in (2, 3):
        raise click.UsageError("write silo derive [LOGGER] NAME 'EXPRESSION', the expression in quotes")
    with connect(words[0] if len(words) == 3 else None) as client:
        click.echo(client.derive(words[-2], words[-1], unit))


@derive.command("ls", short_help="List the derived signals.")
@logger_argument
@json_option
def ls_command(logger: str | None, as_json: bool) -> None:
    """List the derived signals, and why one can't be computed.

    \b
    Example:
      silo derive ls demo
    """
    with connect(logger) as client:
        found = client.table().derived
    if as_json:
        show_json([
            {"name": one.name, "expression": one.expression, "unit": one.unit, "values": len(one.entries),
             "computed": one.options.enabled} for one in found
        ])  # fmt: skip
        return
    if not found:
        click.echo("no derived signals; `silo derive NAME 'EXPRESSION'` makes one")
        return
    rows = [(one.name, str(len(one.entries)), "" if one.unit == "-" else one.unit, one.description) for one in found]
    show_rows([("NAME", "VALUES", "UNIT", "COMPUTED"), *rows], right=(1,))


@derive.command(short_help="Forget a derived signal.")
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] NAME", shell_complete=complete_logger)
def rm(words: tuple[str, ...]) -> None:
    """Forget a derived signal on which nothing stands: no other one, no limits, no trigger.

    \b
    Example:
      silo derive rm demo power
    """
    if len(words) not in (1, 2):
        raise click.UsageError("write silo derive rm [LOGGER] NAME")
    with connect(words[0] if len(words) == 2 else None) as client:
        click.echo(client.remove_derived(words[-1]))
