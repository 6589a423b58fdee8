"""What is done for a logger that ends without `close()`, and what is said of it on the console."""

import os
import sys
from collections.abc import Callable

from silo.collecting.run import Run
from silo.errors import SiloError
from silo.model import FileType, LoggerOptions, SavedFile


def write_run(run: Run, options: LoggerOptions) -> list[SavedFile]:
    """Save a run as `.silo` in this process. Raises SaveError."""
    from silo.files import write

    return write(run.reader.snapshot(), options.folder, options.name, [FileType.SILO])


def save_at_end(run: Run, options: LoggerOptions) -> bool:
    """Save a run as `.silo`, and say where; False, and said where it stays, if that failed."""
    try:
        saved = write_run(run, options)
    except SiloError as failure:
        say_where_it_is(run, options, f": {failure}")
        return False
    paths = ", ".join(file.path for file in saved)
    print(f"silo: logger '{options.name}' ended without save() or close(); saved {paths}", file=sys.stderr)
    return True


def say_where_it_is(run: Run, options: LoggerOptions, problem: str = "") -> None:
    """Say that a run was left for `silo recover`."""
    print(
        f"silo: logger '{options.name}' ended without save() or close(){problem}; {run.segment.ticks} ticks are kept "
        f"in {run.segment.path}: run `silo recover` to save them",
        file=sys.stderr,
    )


def forked_collect(name: str) -> Callable[[], None]:
    """Return `collect()` of a forked child: says once that it logs nothing there, and how to."""
    said = False

    def collect() -> None:
        nonlocal said
        if not said:
            said = True
            print(
                f"silo: collect() of logger '{name}' does nothing in process {os.getpid()}, which was forked from the "
                "one that logs: make a logger of its own there, silo.Logger('...'), after the fork",
                file=sys.stderr,
            )

    return collect
