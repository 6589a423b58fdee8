"""`silo-tui`: reads the command line and starts the app.

Heavy imports wait until it is clear that a screen is wanted.
"""

import gc
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from silo.printing import print_printable
from silo_tui.settings.themes import THEMES

if TYPE_CHECKING:
    from silo_tui.sessions.recorded import FileSession

# measured: OpenBLAS starts a thread per core when NumPy is imported, 70 ms that nothing here needs
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

WEB = "pip install 'silo-logger[web]'"  # what --serve needs
EXAMPLES = """\b
Examples:
  silo-tui                 the only logger here, or a list
  silo-tui anymal          the logger called anymal
  silo-tui robot3/anymal   that of another computer: `silo remote add` shows the way
  silo-tui logs/run.silo   a saved log, with a cursor that reads values
  silo-tui --demo          a simulated robot to try it on
  ssh -C robot -t silo-tui over SSH; -C makes a frame of 1 kB a quarter of it
"""


@click.command(epilog=EXAMPLES, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("target", required=False, default="", metavar="[LOGGER | FILE]")
@click.option(
    "--config",
    envvar="SILO_CONFIG",
    default="",
    metavar="NAME|FILE",
    help="Look at this remote, or Zenoh configuration, alone; `local`: at this computer alone.",
)
@click.option(
    "--demo", is_flag=True, help="Start a simulated robot, open it, and end it on quitting; what it logged is saved."
)
@click.option(
    "--read-only", is_flag=True, envvar="SILO_READ_ONLY", help="Look only: nothing is sent that changes the logger."
)
@click.option(
    "--rate", type=click.FloatRange(0.5, 10.0), metavar="HZ", help="Refreshes a second. Default: 5, or as set (g s)."
)
@click.option("--view", default="", metavar="NAME", help="Open with a view that was kept by `:view save NAME`.")
@click.option("--theme", type=click.Choice(THEMES), help="Colours. Default: dark, or as set (g s).")
@click.option(
    "--mouse/--no-mouse",
    default=None,
    help="Take the mouse. Default: yes, but not over SSH, where it prevents selecting text; or as set (g s).",
)
@click.option(
    "--serve",
    is_flag=True,
    help=f"Show it in a browser of this computer instead: prints the address to open. Needs {WEB}.",
)
@click.option(
    "--port", default=0, type=click.IntRange(0, 65535), help="With --serve: a fixed port. Default: a free one."
)
@click.option("--control", is_flag=True, help="With --serve: edits, start and stop too, not only looking.")
@click.version_option(package_name="silo-logger", prog_name="silo-tui")
def command(
    target: str,
    config: str,
    demo: bool,
    read_only: bool,
    rate: float | None,
    view: str,
    theme: str | None,
    mouse: bool | None,
    serve: bool,
    port: int,
    control: bool,
) -> None:
    """Configure and watch the loggers of this computer and of remotes, or look at a saved log.

    LOGGER is the name of one of them, or HOST/NAME. FILE is a .silo, .csv or .mcap file, a bag folder, the beginning of
    a file name or a run number. A logger that runs is meant before a file of the same name or path; a path with one of
    these endings, or that begins with ./ or /, is always a file. Press ? for all keys.
    """
    target = _address(target)
    if demo and target:
        raise click.UsageError(f"--demo brings its own logger; leave out {target!r}")
    if demo:
        if click.get_current_context().get_parameter_source("config") is ParameterSource.COMMANDLINE:
            raise click.UsageError("--demo runs here; leave out --config")
        config = "local"
    if serve:
        given = [*([target] if target else []), *(["--demo"] if demo else ["--config", config] if config else [])]
        given += [*(["--rate", f"{rate:g}"] if rate else []), *(["--view", view] if view else [])]
        given += ["--theme", theme] if theme else []
        _serve(given, port, control=control and not read_only)
        return
    if control or port:
        raise click.UsageError("--port and --control are for --serve")
    gc.disable()  # of what is loaded nothing goes; looking for it is a sixth of the start, the app has it begin again
    # what runs elsewhere is a logger; a path is a file wherever one looks for loggers
    file = _file(target, _running if config in ("", "local") else lambda: {target})
    ends = (sys.stdin, sys.stdout)  # None where the shell closed it
    in_browser = os.environ.get("TEXTUAL_DRIVER", "").endswith(":WebDriver")
    if not in_browser and not all(end is not None and end.isatty() for end in ends):
        raise click.ClickException("silo-tui needs a terminal; `silo watch` writes plain lines, also into a pipe")
    if not in_browser and (sys.stderr is None or not sys.stderr.isatty()):  # the screen is drawn there
        raise click.ClickException(
            "silo-tui draws its screen on stderr, which is no terminal here: start it without 2>, nothing was done"
        )
    sys.exit(_run(target, config, file, demo=demo, read_only=read_only, rate=rate, view=view, theme=theme, mouse=mouse))


def _address(target: str) -> str:
    """Return the address that a URL names, `silo://robot3/anymal`; anything else as it is."""
    if not target.startswith("silo://"):
        return target
    from silo.errors import SiloError
    from silo.net.found import logger_of

    try:
        return logger_of(target)
    except SiloError as error:
        raise click.ClickException(str(error)) from error


def _serve(arguments: list[str], port: int, *, control: bool) -> None:
    from silo.errors import SiloError

    try:
        from silo_tui.web.serving import serve
    except ImportError as error:
        raise click.ClickException(f"--serve needs more: {WEB} ({error})") from error
    try:
        serve(arguments, port, control=control, tell=click.echo)
    except SiloError as error:
        raise click.ClickException(str(error)) from error


def _file(target: str, running: Callable[[], set[str]]) -> "FileSession | None":
    """Return the log that is meant, opened; None where a logger is meant."""
    if not target:
        return None
    from silo.errors import SiloError
    from silo_tui.sessions.target import file_meant

    try:
        path = file_meant(target, running)
        if path is None:
            return None
        from silo_tui.sessions.recorded import open_file

        if sys.stderr is not None and sys.stderr.isatty():  # a CSV takes seconds, and there is no screen yet
            click.echo(f"reading {path} …", err=True)
        return open_file(path)
    except (SiloError, OSError) as error:
        raise click.ClickException(str(error)) from error


def _running() -> set[str]:
    """Return every word that means a logger that runs."""
    from silo_tui.sessions.finder import ClientFinder

    finder = ClientFinder()
    try:
        return {word for each in finder.find().loggers for word in each.addresses}
    finally:
        finder.close()


def _run(
    logger: str,
    config: str,
    file: "FileSession | None",
    *,
    demo: bool,
    read_only: bool,
    rate: float | None,
    view: str,
    theme: str | None,
    mouse: bool | None,
) -> int:
    from silo_tui.sessions.finder import ClientFinder

    finder = ClientFinder(config, read_only=read_only)
    if file is None and not demo:
        finder.begin()
    from silo_tui import terminal
    from silo_tui.app import SiloApp
    from silo_tui.sessions.demo import Demo
    from silo_tui.settings.file import SettingsProblem, is_there
    from silo_tui.settings.options import Settings

    in_file, problems = Settings(), list[SettingsProblem]()
    if is_there():
        from silo_tui.settings.reading import read_file

        in_file, problems = read_file()
    settings = in_file
    if theme is not None:
        os.environ.pop("TEXTUAL_THEME", None)
        settings = replace(settings, theme=theme)
    elif terminal.has_few_colors() and "theme" not in in_file.named and not os.environ.get("TEXTUAL_THEME"):
        in_file = settings = replace(settings, theme="16")  # nobody chose it: it is not to be written
    if mouse is None:
        mouse = terminal.mouse_wanted(settings.mouse)
    app = SiloApp(
        finder,
        name=logger,
        demo=Demo() if demo else None,
        read_only=read_only and file is None,  # nothing of a file can be changed
        rate_hz=settings.rate if rate is None else rate,
        file=file,
        view=view,
        settings=settings,
        settings_problems=problems,
    )
    app.context.saved_settings = in_file
    try:
        app.run(mouse=mouse)
    finally:
        if words := app.release():
            click.echo(words)
        finder.close()
    return app.return_code or 0


def main() -> None:
    """Entry point of `silo-tui`."""
    print_printable()
    command()
