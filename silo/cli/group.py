"""The group `silo`: its commands, each loaded when it is called for."""

import importlib
from typing import NamedTuple

import click

from silo.cli.codes import EXIT_FAILED, EXIT_NO_LOGGER
from silo.cli.common import READ_ONLY, config_option
from silo.errors import ConnectionLostError, SiloError
from silo.version import VERSION


class LazyCommand(NamedTuple):
    """Where a command lives, and its line in `silo --help`, so that help loads none of them."""

    section: str
    module: str
    attribute: str
    summary: str


COMMANDS = {
    "ls": LazyCommand("Loggers", "silo.cli.loggers.ls", "ls", "List the loggers that run."),
    "info": LazyCommand("Loggers", "silo.cli.loggers.info", "info", "Show a logger, its elements, or a saved file."),
    "watch": LazyCommand("Loggers", "silo.cli.loggers.watch", "watch", "Print live values."),
    "address": LazyCommand("Loggers", "silo.cli.loggers.address", "address", "Print how any language reaches a topic."),
    "set": LazyCommand("Loggers", "silo.cli.edits", "set_command", "Change how elements are logged."),
    "start": LazyCommand("Loggers", "silo.cli.loggers.life_cycle", "start", "Start logging."),
    "stop": LazyCommand("Loggers", "silo.cli.loggers.life_cycle", "stop", "Stop logging; the data stays."),
    "restart": LazyCommand("Loggers", "silo.cli.loggers.life_cycle", "restart", "Stop, and start with empty buffers."),
    "save": LazyCommand("Loggers", "silo.cli.loggers.life_cycle", "save", "Save what the buffers hold to files."),
    "files": LazyCommand("Loggers", "silo.cli.logs.recordings", "files", "List, fetch, delete recordings of a robot."),
    "record": LazyCommand("Loggers", "silo.cli.logs.record", "record", "Record to MCAP files, for days."),
    "mark": LazyCommand("Loggers", "silo.cli.loggers.events", "mark", "Mark the newest tick with some words."),
    "events": LazyCommand("Loggers", "silo.cli.loggers.events", "events", "Print what happened, and who did it."),
    "derive": LazyCommand("Loggers", "silo.cli.conditions.derive", "derive", "Compute signals from others."),
    "script": LazyCommand("Loggers", "silo.cli.loggers.scripts", "script", "Show, check, load, save, compare scripts."),
    "trigger": LazyCommand(
        "Loggers", "silo.cli.conditions.triggers", "trigger", "Save what was logged around a condition."
    ),
    "alarms": LazyCommand(
        "Loggers", "silo.cli.conditions.alarms", "alarms", "Show what is, or was, beyond its limits."
    ),
    "control": LazyCommand(
        "Loggers", "silo.cli.loggers.control", "control", "One operator at a time: take, give, release."
    ),
    "recover": LazyCommand("Loggers", "silo.cli.logs.recover", "recover", "Save what programs that died left behind."),
    "convert": LazyCommand("Saved files", "silo.cli.logs.files", "convert_command", "Convert a log to another format."),
    "plot": LazyCommand("Saved files", "silo.cli.logs.files", "plot_command", "Draw signals of a log."),
    "stats": LazyCommand(
        "Saved files", "silo.cli.logs.files", "stats_command", "Minimum, maximum, mean ... of signals."
    ),
    "check": LazyCommand(
        "Saved files", "silo.cli.logs.check", "check_command", "Judge limits and conditions on a log."
    ),
    "verify": LazyCommand(
        "Saved files", "silo.cli.logs.verify", "verify", "Find what is missing or twice in a log folder."
    ),
    "diff": LazyCommand("Saved files", "silo.cli.logs.files", "diff_command", "Show how two logs differ."),
    "compare": LazyCommand("Saved files", "silo.cli.logs.files", "compare_command", "Compare the signals of two runs."),
    "foxglove": LazyCommand(
        "Other viewers", "silo.cli.programs.foxglove", "foxglove", "Show a logger in Foxglove, PlotJuggler."
    ),
    "ros2": LazyCommand("Other viewers", "silo.cli.programs.ros2", "ros2", "Show a logger to ROS 2, by rmw_zenoh."),
    "demo": LazyCommand(
        "Programs", "silo.cli.programs.demo_and_host", "demo", "Run a simulated legged robot that logs."
    ),
    "host": LazyCommand("Programs", "silo.cli.programs.demo_and_host", "host", "Log this computer."),
    "remote": LazyCommand("Programs", "silo.cli.network.remote", "remote", "Reach loggers of other computers."),
    "router": LazyCommand("Programs", "silo.cli.network.router", "router", "Let robots and desks meet over one link."),
    "config": LazyCommand("Programs", "silo.cli.programs.config", "config", "List and copy examples of configuration."),
    "completion": LazyCommand("Programs", "silo.cli.completion", "completion", "Completion for your shell."),
}


class FailedError(click.ClickException):
    """An error of silo, as the shell is told of it."""

    exit_code = EXIT_FAILED


class NotReachedError(FailedError):
    """No such logger, or nobody there answers."""

    exit_code = EXIT_NO_LOGGER


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return all names, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command, imported now."""
        entry = COMMANDS.get(cmd_name)
        if entry is None:
            return None
        command: click.Command = getattr(importlib.import_module(entry.module), entry.attribute)
        return config_option(command)

    def invoke(self, ctx: click.Context) -> object:
        """Do what the words say. Raises FailedError for each error of silo."""
        try:
            return super().invoke(ctx)
        except SiloError as error:
            kind = NotReachedError if isinstance(error, ConnectionLostError) else FailedError
            raise kind(str(error)) from error

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names, or an error with the nearest name."""
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            from difflib import get_close_matches

            near = get_close_matches(args[0], COMMANDS, 1)
            hint = f"did you mean '{near[0]}'?" if near else "`silo --help` lists them"
            raise click.UsageError(f"no command '{args[0]}'; {hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One section per kind of command."""
        for section in dict.fromkeys(entry.section for entry in COMMANDS.values()):
            rows = [(name, entry.summary) for name, entry in COMMANDS.items() if entry.section == section]
            with formatter.section(section):
                formatter.write_dl(rows)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--config",
    envvar="SILO_CONFIG",
    default="",
    metavar="NAME|FILE",
    help="Look at this remote, or Zenoh configuration, alone; `local`: at this computer alone. Also after the command.",
)
@click.option(
    "--read-only",
    is_flag=True,
    envvar="SILO_READ_ONLY",
    help="Send nothing that changes anything. Also after the command.",
)
@click.version_option(VERSION, prog_name="silo")
@click.pass_context
def cli(ctx: click.Context, config: str, read_only: bool) -> None:
    """Log, see, configure and save the signals of robots.

    LOGGER is a name, or HOST/NAME where several have the name (`silo ls` shows them). It may be left out of every
    command while exactly one logger runs. Those of other computers are seen by `silo remote add`.

    \b
    Examples:
      silo demo                              (a simulated robot, in one terminal)
      silo ls                                (in another)
      silo watch demo '/log/base/*'
      silo set demo '*/torque' divider=2 size=30s action=both

    \b
    Exit codes:
      0  done            1  refused, failed, or beyond its limits
      2  wrong usage     3  no such logger, or it can't be reached
      4  two logs, or a script and a logger, differ
      5  some of it, or all, could not be judged
    """
    ctx.obj = config
    if read_only:
        ctx.meta[READ_ONLY] = True
