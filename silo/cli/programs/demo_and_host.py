"""`silo demo` and `silo host`: programs that log."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from silo.cli.common import TypedPath, configuration, together
from silo.files.formats import SAVED_NAMES, file_types


def _common(name: str, frequency: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    return together(
        click.option("--name", default=name, show_default=True, help="Name of the logger."),
        click.option(
            "--frequency",
            "frequency_hz",
            type=click.FloatRange(0, 10_000, min_open=True),
            default=frequency,
            show_default=True,
            help="Ticks per second.",
        ),
        click.option(
            "--time-limit",
            "time_limit_s",
            type=click.FloatRange(min=0, min_open=True),
            help="End by itself after so long, s.",
        ),
        click.option(
            "--folder", type=TypedPath(path_type=Path, file_okay=False), default=Path(), help="Where saved files go."
        ),
        click.option(
            "--script", type=TypedPath(path_type=Path, dir_okay=False), help="Script; FOLDER/NAME.yaml if not given."
        ),
        click.option("--group", help="Let members of this system group in."),
        click.option(
            "--config",
            type=TypedPath(path_type=Path, dir_okay=False),
            help="Let other computers in by this Zenoh configuration (`silo remote init` makes one).",
        ),
        click.option("--stopped", is_flag=True, help="Don't start logging; wait for `silo start`."),
        click.option(
            "--save",
            multiple=True,
            type=click.Choice(SAVED_NAMES),
            help="Save at the end; may be repeated. Ctrl-C saves .silo without it.",
        ),
    )


def before() -> Path | None:
    """Return what `silo --config FILE` says before the command; SILO_CONFIG is of clients alone."""
    root = click.get_current_context().find_root()
    typed = root.get_parameter_source("config") is ParameterSource.COMMANDLINE
    return Path(configuration()) if typed and configuration() else None


def _read(given: dict[str, Any]) -> dict[str, Any]:
    return {**given, "save": tuple(file_types(given["save"])), "config": given["config"] or before()}


@click.command()
@_common("demo", 400.0)
@click.option("--elements", type=click.IntRange(5, 200_000), help="So many elements; 500 if not given.")
@click.option("--seed", type=int, default=0, show_default=True, help="Another seed, other noise and faults.")
@click.option(
    "--with-parent", "parent_pid", type=int, hidden=True, help="End when the parent process, of this pid, is gone."
)
def demo(**given: Any) -> None:
    """Run a simulated legged robot that logs 500 elements at 400 Hz, until Ctrl-C.

    It walks and trots through a mission of half a minute, and slips at random: base/tilt is derived and has limits, the
    trigger 'slip' waits to be armed. Among its sensors are a flaky, a stuck and a noisy one.

    \b
    Examples:
      silo demo
      silo demo --time-limit 30 --save silo --save bag --folder logs
      silo demo --elements 10000 --stopped
    """
    from silo.programs.demo.program import DemoOptions, run_demo

    run_demo(DemoOptions(**_read(given)), click.echo)


@click.command()
@_common("host", 20.0)
def host(**given: Any) -> None:
    """Log this computer until Ctrl-C: processor, memory, disks, networks, temperatures; ten minutes are kept.

    What the computer lacks is left out. Useful beside any robot program.

    \b
    Examples:
      silo host
      silo host --save csv --time-limit 60
    """
    from silo.programs.host.program import HostOptions, run_host

    run_host(HostOptions(**_read(given)), click.echo)
