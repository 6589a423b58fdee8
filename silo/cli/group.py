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


# section, command, module:function (of the command's name, if none is said), line of the help
_ROWS = (
    ("Loggers", "ls", "loggers.ls", "List the loggers that run."),
    ("Loggers", "info", "loggers.info", "Show a logger, its elements, or a saved file."),
    ("Loggers", "watch", "loggers.watch", "Print live values."),
    ("Loggers", "address", "loggers.address", "Print how any language reaches a topic."),
    ("Loggers", "set", "edits:set_command", "Change how elements are logged."),
    ("Loggers", "param", "loggers.param", "Tune parameters; keep them as presets."),
    ("Loggers", "excite", "loggers.excite", "Move a parameter around its value, to measure."),
    ("Loggers", "start", "loggers.life_cycle", "Start logging."),
    ("Loggers", "stop", "loggers.life_cycle", "Stop logging; the data stays."),
    ("Loggers", "restart", "loggers.life_cycle", "Stop, and start with empty buffers."),
    ("Loggers", "save", "loggers.life_cycle", "Save what the buffers hold to files."),
    ("Loggers", "files", "logs.robot_files", "List, fetch, delete recordings of a robot."),
    ("Loggers", "record", "logs.record", "Record to MCAP files, for days."),
    ("Loggers", "mark", "loggers.events", "Mark the newest tick with some words."),
    ("Loggers", "episode", "loggers.events", "Say of an episode: begin, end, good, bad, redo."),
    ("Loggers", "events", "loggers.events", "Print what happened, and who did it."),
    ("Loggers", "derive", "conditions.derive", "Compute signals from others."),
    ("Loggers", "script", "loggers.scripts", "Show, check, load, save, diff scripts."),
    ("Loggers", "trigger", "conditions.triggers", "Save what was logged around a condition."),
    ("Loggers", "alarms", "conditions.alarms", "Show what is, or was, beyond its limits."),
    ("Loggers", "control", "loggers.control", "One operator at a time: take, give, release."),
    ("Loggers", "recover", "logs.recover", "Save what programs that died left behind."),
    ("Saved files", "runs", "logs.runs", "List the runs in folders, by what was measured."),
    ("Saved files", "tag", "logs.runs", "Give a run tags."),
    ("Saved files", "note", "logs.runs", "Say something of a run."),
    ("Saved files", "query", "logs.query", "Ask runs in SQL."),
    ("Saved files", "archive", "logs.query", "Keep runs as Parquet, by robot and date."),
    ("Saved files", "convert", "logs.saved_logs:convert_command", "Convert a log to another format."),
    ("Saved files", "plot", "logs.saved_logs:plot_command", "Draw signals of a log."),
    ("Saved files", "bode", "logs.responses", "Transfer function between two signals."),
    ("Saved files", "step", "logs.responses", "Step response: rise time, overshoot."),
    ("Saved files", "stats", "logs.saved_logs:stats_command", "Minimum, maximum, mean ... of signals."),
    ("Saved files", "check", "logs.check:check_command", "Judge limits and conditions on a log."),
    ("Saved files", "verify", "logs.verify", "Find what is missing or twice in a log folder."),
    ("Saved files", "diff", "logs.saved_logs:diff_command", "Show how two logs differ."),
    ("Saved files", "compare", "logs.saved_logs:compare_command", "Compare the signals of two runs."),
    ("Other viewers", "foxglove", "programs.viewers", "Show a logger in Foxglove, PlotJuggler."),
    ("Other viewers", "ros2", "programs.viewers", "Show a logger to ROS 2, by rmw_zenoh."),
    ("Other viewers", "mcp", "programs.viewers", "Show runs to an agent, read-only."),
    ("Programs", "demo", "programs.demo_and_host", "Run a simulated legged robot that logs."),
    ("Programs", "host", "programs.demo_and_host", "Log this computer."),
    ("Programs", "remote", "network.remote", "Reach loggers of other computers."),
    ("Programs", "router", "network.router", "Let robots and desks meet over one link."),
    ("Programs", "config", "programs.config", "List and copy examples of configuration."),
    ("Programs", "completion", "completion", "Completion for your shell."),
)


COMMANDS = {
    name: LazyCommand(section, f"silo.cli.{place.partition(':')[0]}", place.partition(":")[2] or name, summary)
    for section, name, place, summary in _ROWS
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
            from silo.cli.other_words import what_instead

            raise click.UsageError(f"no command '{args[0]}'{what_instead(args, list(COMMANDS))}", ctx)
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
      0  done            1  refused, failed, or unreadable
      2  wrong usage     3  no such logger, or it can't be reached
      4  something was found: beyond limits, not whole, different
      5  some of it, or all, could not be judged
    """
    ctx.obj = config
    if read_only:
        ctx.meta[READ_ONLY] = True
