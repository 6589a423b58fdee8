"""How the programs of silo run: a logger by their options, a loop at a steady rate, what is said at both ends."""

import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from silo.core.elements import FileType
from silo.core.quantities.writing import many, size_text
from silo.logger.logger import Logger
from silo.programs.rate import EndSignals, Rate

PARENT_LOOK_S = 1.0


@dataclass(frozen=True, kw_only=True)
class ProgramOptions:
    """What `silo demo` and `silo host` can be told; see their help."""

    name: str
    frequency_hz: float
    time_limit_s: float | None = None
    folder: Path = Path()
    script: Path | None = None
    stopped: bool = False
    save: tuple[FileType, ...] = ()
    group: str | None = None  # for `Logger.serve`
    config: Path | None = None
    parent_pid: int | None = None  # end when this process, which started us, is gone

    @property
    def own_script(self) -> Path:
        """The script: in the folder, where none was named."""
        return self.script or self.folder / f"{self.name}.yaml"


def opened(options: ProgramOptions) -> Logger:
    """Return the logger of a program, without elements. Raises SiloError."""
    options.folder.mkdir(parents=True, exist_ok=True)
    return Logger(
        options.name,
        frequency=options.frequency_hz,
        max_time=0,  # no limit: run until Ctrl-C
        script=options.own_script,
        folder=options.folder,
    )


def read_own_script(log: Logger, options: ProgramOptions) -> None:
    """Read it, now that the elements are there. Raises SiloError."""
    log.update(read_script=bool(options.script) or options.own_script.exists())  # ours need not be there


def run(
    log: Logger, options: ProgramOptions, tick: Callable[[Rate], None], say: Callable[[str], None], ways: Sequence[str]
) -> None:
    """Serve, and call `tick`, which waits, until Ctrl-C, SIGTERM or the time limit; save what is to be.

    `ways` are lines on what to do with this program. Raises SiloError.
    """
    with log, EndSignals() as ending, log.serve(group=options.group, config=options.config):
        if not options.stopped:
            log.start()
        say(welcome(log, ways))
        if options.parent_pid is not None:
            threading.Thread(target=end_with, args=(options.parent_pid,), daemon=True).start()
        rate = Rate(options.frequency_hz)
        end_s = time.monotonic() + (options.time_limit_s or float("inf"))
        while not ending.received and time.monotonic() < end_s:
            tick(rate)
        log.stop()
        farewell(log, options.save, say, cut_short=bool(ending.received))
        log.close(discard=True)  # what nobody asked to keep, after a limit of time: `farewell` tells of it


def end_with(parent_pid: int) -> None:
    """End the program in order when its parent is gone: a killed one can't. For a thread, so that the loop pays 0."""
    while os.getppid() == parent_pid:
        time.sleep(PARENT_LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)


def welcome(log: Logger, ways: Sequence[str]) -> str:
    """Return what a user needs to know at the start."""
    options, running = log.options, "running" if log.is_running else "stopped"
    script = options.script if Path(options.script).exists() else f"{options.script} (none yet: everything is logged)"
    return (
        f"logger '{options.name}': {many(len(log.elements), 'element')} at {options.frequency_hz:g} Hz, {running}\n"
        f"  script  {script}\n"
        f"  folder  {options.folder}\n"
        f"  watch   silo-tui {options.name}   or   silo watch {options.name}\n"
        + "".join(f"  {way}\n" for way in ways)
        + "  end     Ctrl-C"
    )


def farewell(log: Logger, types: Sequence[FileType], say: Callable[[str], None], *, cut_short: bool = False) -> None:
    """Save if asked to, or as `.silo` what is in no file when `cut_short` by a signal; say where the data is."""
    name = log.options.name
    if cut_short and not types and log.has_unsaved:
        types = (FileType.SILO,)
    if log.ticks == 0:
        say(f"logger '{name}' ended; nothing was logged, so there is nothing to save")
        return
    if types:
        saved = log.save(types)
        say(f"logger '{name}' ended after {many(log.ticks, 'tick')}; what its buffers held is saved:")
        for file in saved:
            say(f"  {file.path} ({size_text(file.size_bytes)})")
        return
    note = "" if not log.has_unsaved else f" and not saved (use --save, or `silo save {name}` before it ends)"
    say(f"logger '{name}' ended; {many(log.ticks, 'tick')} logged{note}")
