"""How loggers end, what is done for one that ends without `close()`, and what is said of it on the console."""

import atexit
import contextlib
import enum
import functools
import inspect
import logging
import os
import sys
import weakref
from collections.abc import Callable, Container, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, ParamSpec, Protocol, TypeVar, cast

from silo.core.conditions import Conditions
from silo.core.elements import FileType, LoggerOptions, SavedFile, Storage
from silo.core.recording import Recording
from silo.errors import SiloError
from silo.journal.format import list_journals, remove_journal
from silo.journal.holdings import segment_holdings
from silo.loop.run import Run

log = logging.getLogger("silo")

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


class LoggerEnd(enum.Enum):
    """How a logger ends: what its value says of it. Each decides what becomes of ticks that stand in no file."""

    CLOSED = "was closed after a save() that failed"  # they are dropped, which is said; kept where that failed
    DISCARDED = "was closed to drop what it has"  # they are dropped, without a word
    BLOCK = "ended without save()"  # at the clean end of a `with`: they are saved as by save(), else as at any end
    ERROR = "ended by an error, or Ctrl-C, without save()"  # in a `with`: as any that did not close
    UNCLOSED = "ended without save() or close()"  # the helper process saves them, or else this one
    FORGOTTEN = "was let go of without save() or close()"  # by the program: as before, but this one writes no file
    FORKED = "is that of the process that process {} was forked from"  # nothing of it is this one's

    @property
    def keeps(self) -> bool:
        """Whether ticks that stand in no file are kept."""
        return self in (LoggerEnd.BLOCK, LoggerEnd.ERROR, LoggerEnd.UNCLOSED, LoggerEnd.FORGOTTEN)


def during(life: object, to_end: list[Callable[[], None]], call: Callable[P, R], *args: P.args, **kw: P.kwargs) -> R:
    """Do a call of a logger that has this life; what ends that, or its server, meanwhile, is done as it is over.

    It stands in the list `to_end` then.
    """
    ends = to_end  # from here on, not before: of a call that a handler keeps from beginning
    try:
        return call(*args, **kw)
    finally:
        for end in ends:
            end()


def after_calls(life: object, end: Callable[[], None]) -> None:
    """End a logger, or its server, now; or where this thread is amid a call of it, as in a signal handler, after that.

    Its stack tells that: nothing has to be put back where an interrupt comes.
    """
    call, frame = None, cast("FrameType | None", sys._getframe())
    while frame is not None:
        if frame.f_code is during.__code__ and frame.f_locals["life"] is life and "ends" in frame.f_locals:
            call = frame
        frame = frame.f_back
    if call is None:
        during(life, [], end)
    else:
        call.f_locals["ends"].append(end)


def ends_after_calls(leave: Container[str]) -> Callable[[C], C]:
    """Have a logger end after its public methods, but those to `leave`, and not amid them."""

    def over(method: Callable[..., R]) -> Callable[..., R]:
        @functools.wraps(method)
        def call(self: Any, *args: Any, **kwargs: Any) -> R:
            ends: list[Callable[[], None]] = []
            try:
                return during(self._life, ends, method, self, *args, **kwargs)
            finally:
                if ends:
                    log.warning("%s: it was to end amid %s(), and did as that was done", self.name, method.__name__)

        return call

    def wrapped(cls: C) -> C:
        for name, found in list(vars(cls).items()):
            if inspect.isfunction(found) and name not in leave and (name[0] != "_" or name == "__getitem__"):
                setattr(cls, name, over(found))
        return cls

    return wrapped


class UnclosedLogger(Protocol):
    """A logger, seen from here."""

    options: LoggerOptions

    @property
    def _is_closed(self) -> bool: ...

    def _end(self, ending: LoggerEnd) -> None: ...

    def _after_fork_in_child(self) -> None:
        """Let go of everything that belongs to the parent process."""


_living: "weakref.WeakSet[UnclosedLogger]" = weakref.WeakSet()
watch = _living.add  # of a logger whose data is to outlive a process that ends without `close()`


def end_namesakes(name: str) -> None:
    """End loggers of a name that live in this process: clients could not tell them from the one to be made."""
    for other in [each for each in _living if each.options.name == name and not each._is_closed]:
        print(
            f"silo: logger '{name}' was made a second time in this program (a cell run again, a name rebound?): the "
            "first one is closed; give loggers that are to live side by side names of their own",
            file=sys.stderr,
        )
        other._end(LoggerEnd.UNCLOSED)


@atexit.register
def _end_of_process() -> None:
    with contextlib.ExitStack() as each:  # which does the others where one fails
        for logger in list(_living):
            each.callback(logger._end, LoggerEnd.UNCLOSED)


def _forked() -> None:
    for logger in list(_living):
        logger._after_fork_in_child()


os.register_at_fork(after_in_child=_forked)


def save_run(
    recording: Recording,
    run: str,
    options: LoggerOptions,
    why: str,
    conditions: Conditions,
    types: Sequence[FileType] = (FileType.SILO,),
    name: str = "",
    folder: Path | None = None,
) -> list[SavedFile]:
    """Save what a run holds in this process, with what the event log says of it. Raises SaveError.

    `conditions` are derived signals, limits and triggers as they are now, not as they were when it began.
    """
    from silo.files import LogOfRun, write_run

    where, told = folder or options.folder, LogOfRun(options.folder, run)
    return write_run(recording, where, options.name, types, name or None, why=why, events=told, conditions=conditions)


def save_at_end(run: Run, options: LoggerOptions, conditions: Conditions, ended: str) -> bool:
    """Save a run as `.silo`, and say where, and how its logger `ended`; False, and said where it is, if that failed."""
    try:
        saved = save_run(run.reader.snapshot(), run.id, options, "program ended without saving", conditions)
        say_saved(run, options.name, saved, ended)
    except SiloError as failure:
        say_where_it_is(run, options, f": {failure}", ended)
        return False
    return True


def say_saved(run: Run, name: str, saved: Sequence[SavedFile], ended: str) -> None:
    """Say what was saved of a run whose program saved nothing itself."""
    held = segment_holdings(run.reader).text
    paths = ", ".join(file.path for file in saved)
    print(f"silo: logger '{name}' {ended}; saved {held}: {paths}", file=sys.stderr)


def say_dropped(name: str, ticks: int) -> None:
    """Say that `close()` drops what was not saved, and what keeps it."""
    what = "1 tick that was not saved is" if ticks == 1 else f"{ticks} ticks that were not saved are"
    print(
        f"silo: logger '{name}' was closed without save(): {what} dropped (what was recorded or captured "
        "stays). save() before close() keeps it, or the end of a `with silo.Logger(...)` that doesn't close; "
        "close(discard=True) drops it without a word",
        file=sys.stderr,
    )


def drop_journals(options: LoggerOptions) -> None:
    """Remove the journals of a logger that is closed or saved: its helper process may have left them."""
    if options.storage is Storage.DISK:
        for path in list_journals(options.folder, options.name, options.id):
            remove_journal(path)


def say_where_it_is(run: Run, options: LoggerOptions, problem: str = "", ended: str = LoggerEnd.UNCLOSED.value) -> None:
    """Say that a run was left for `silo recover`."""
    try:
        held = segment_holdings(run.reader).text
    except SiloError as error:
        held = f"what it holds ({error})"
    print(
        f"silo: logger '{options.name}' {ended}{problem}; {run.segment.path} keeps {held}: "
        "run `silo recover` to save it",
        file=sys.stderr,
    )


def say_what_is_held(options: LoggerOptions) -> None:
    """Say that recorders, or triggers, are not done with the last run."""
    print(
        f"silo: logger '{options.name}' was closed before its helper process was done: what is recorded of it, or what "
        "its triggers captured, may not be complete; its next start completes that, or `silo recover`",
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
