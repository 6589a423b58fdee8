"""`silo-tui`: reads the command line and starts the app.

Heavy imports wait until it is clear that a screen is wanted.
"""

import os
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from silo_tui.settings.themes import THEMES

if TYPE_CHECKING:
    from silo_tui.sessions.recorded import FileSession

# measured: OpenBLAS starts a thread per core when NumPy is imported, 70 ms that nothing here needs
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

EXAMPLES = """\b
Examples:
  silo-tui                 the only logger here, or a list
  silo-tui anymal          the logger called anymal
  silo-tui logs/run.silo   a saved log, with a cursor that reads values
  silo-tui --demo          a simulated robot to try it on
  ssh -C robot -t silo-tui over SSH; -C makes a frame of 17 kB one of 1 kB
"""


@click.command(epilog=EXAMPLES, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("target", required=False, default="", metavar="[LOGGER | FILE]")
@click.option("--config", default="", metavar="FILE", help="Zenoh configuration of a robot elsewhere.")
@click.option("--demo", is_flag=True, help="Start a simulated robot, open it, and end it on quitting.")
@click.option("--read-only", is_flag=True, help="Look only: nothing that changes the logger.")
@click.option(
    "--rate", type=click.FloatRange(0.5, 10.0), metavar="HZ", help="Refreshes a second. Default: 5, or as set (F2)."
)
@click.option("--theme", type=click.Choice(THEMES), help="Colours. Default: dark, or as set (F2).")
@click.option(
    "--mouse/--no-mouse",
    default=None,
    help="Take the mouse. Default: yes, but not over SSH, where it prevents selecting text; or as set (F2).",
)
@click.version_option(package_name="silo-logger", prog_name="silo-tui")
def command(
    target: str, config: str, demo: bool, read_only: bool, rate: float | None, theme: str | None, mouse: bool | None
) -> None:
    """Configure and watch the loggers of this computer, or look at a saved log.

    LOGGER is the name of one of them. FILE is a .silo, .csv or .mcap file, a bag folder, the beginning of a file name
    or a run number. A logger that runs is meant before a file of the same name; a path with one of these endings or
    a / is always a file. Press ? for all keys.
    """
    if demo and target:
        raise click.UsageError(f"--demo brings its own logger; leave out {target!r}")
    if config and demo:
        raise click.UsageError("--demo runs here; leave out --config")
    file = None if config else _file(target)
    if not all(end is not None and end.isatty() for end in (sys.stdin, sys.stdout)):  # None where the shell closed it
        raise click.ClickException("silo-tui needs a terminal; `silo watch` writes plain lines, also into a pipe")
    sys.exit(_run(target, config, file, demo=demo, read_only=read_only, rate=rate, theme=theme, mouse=mouse))


def _file(target: str) -> "FileSession | None":
    """Return the log that is meant, opened; None where a logger is meant."""
    if not target:
        return None
    from silo.errors import SiloError
    from silo_tui.sessions.finder import ClientFinder
    from silo_tui.sessions.target import file_meant

    try:
        path = file_meant(target, lambda: [logger.name for logger in ClientFinder().find().loggers])
        if path is None:
            return None
        from silo_tui.sessions.recorded import open_file

        return open_file(path)
    except (SiloError, OSError) as error:
        raise click.ClickException(str(error)) from error


def _run(
    logger: str,
    config: str,
    file: "FileSession | None",
    *,
    demo: bool,
    read_only: bool,
    rate: float | None,
    theme: str | None,
    mouse: bool | None,
) -> int:
    from silo_tui import terminal
    from silo_tui.app import SiloApp
    from silo_tui.sessions.demo import Demo
    from silo_tui.sessions.finder import ClientFinder
    from silo_tui.settings.reading import read_file

    in_file, problems = read_file()
    settings = in_file
    if theme is not None:
        os.environ.pop("TEXTUAL_THEME", None)
        settings = replace(settings, theme=theme)
    if mouse is None:
        mouse = terminal.mouse_wanted(settings.mouse)
    app = SiloApp(
        ClientFinder(config),
        name=logger,
        demo=Demo() if demo else None,
        read_only=read_only and file is None,  # nothing of a file can be changed
        rate_hz=settings.rate if rate is None else rate,
        file=file,
        settings=settings,
        settings_problems=problems,
    )
    app.context.saved_settings = in_file
    try:
        app.run(mouse=mouse)
    finally:
        app.release()
    return app.return_code or 0


def main() -> None:
    """Entry point of `silo-tui`."""
    command()
