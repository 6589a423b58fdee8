"""What becomes of loggers when their process ends or forks."""

import atexit
import os
import weakref
from typing import Protocol


class Ending(Protocol):
    """A logger, seen from here."""

    def abandon(self) -> None:
        """End without `close()`; unsaved data is kept."""

    def after_fork_in_child(self) -> None:
        """Let go of everything that belongs to the parent process."""


_watched: "weakref.WeakSet[Ending]" = weakref.WeakSet()


def watch(logger: Ending) -> None:
    """See to it that the logger's data outlives a process that ends without `close()`."""
    _watched.add(logger)


@atexit.register
def _end_of_process() -> None:
    for logger in list(_watched):
        logger.abandon()


def _forked() -> None:
    for logger in list(_watched):
        logger.after_fork_in_child()


os.register_at_fork(after_in_child=_forked)
