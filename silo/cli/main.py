"""`silo` as a program: its arguments, and what becomes of errors."""

import gc
import os
import sys
import warnings

from silo.cli.codes import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_PIPE, EXIT_USAGE
from silo.errors import reason
from silo.printing import print_printable
from silo.version import VERSION


def main() -> None:
    """Run `silo` with the arguments of this process and exit with its code."""
    if sys.argv[1:] == ["--version"]:  # alone, as scripts ask: to load click takes longer than Python does
        sys.exit(_say_version())
    # one thread is enough for what commands compute, and NumPy loads 70 ms faster
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    print_printable()
    warnings.formatwarning = lambda message, *_: f"silo: {message}\n"  # who types a command looks for no line of code
    try:
        code = run(sys.argv[1:])
    except KeyboardInterrupt:  # while it is loaded, which takes a second on a busy robot
        sys.exit(EXIT_INTERRUPTED)
    gc.freeze()  # Python looks for garbage among all that was loaded as it ends: a sixth of what `silo ls` takes
    sys.exit(code)


def _say_version() -> int:
    try:
        print(f"silo, version {VERSION}", flush=True)
    except BrokenPipeError:
        return _end_unread()
    except OSError as error:
        print(f"silo: {reason(error)}", file=sys.stderr)
        return EXIT_FAILED
    return 0


def _end_unread() -> int:
    """Return the code for who reads no more, as `silo ls | head`; what is still to be flushed goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return EXIT_PIPE


def run(arguments: list[str]) -> int:
    """Run one command; errors become a line on stderr and an exit code."""
    import click

    from silo.cli.group import cli

    if any("\0" in word for word in arguments):  # from no shell, but from programs
        click.echo("silo: an argument holds a NUL character", err=True)
        return EXIT_USAGE
    try:
        code = cli.main(arguments, prog_name="silo", standalone_mode=False)
        print(end="", flush=True)  # nothing where the shell has closed it
        return code if isinstance(code, int) else 0
    except click.UsageError as error:
        error.show()
        return EXIT_USAGE
    except click.ClickException as error:
        click.echo(f"silo: {error.format_message()}", err=True)
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        return _end_unread()
    except MemoryError:
        click.echo("silo: this takes more memory than there is; take a part of the log, or another machine", err=True)
        return EXIT_FAILED
    except OSError as error:
        from silo.core.runtime import FOLDER_GONE, is_folder_gone

        if not error.filename and isinstance(error, FileNotFoundError) and is_folder_gone():
            click.echo(f"silo: {FOLDER_GONE}", err=True)
            return EXIT_FAILED
        place = f"{error.filename}: " if error.filename else ""
        click.echo(f"silo: {place}{reason(error)}", err=True)
        return EXIT_FAILED
