"""Whether a logger runs, is closed, is served: what all its parts look at before they change something."""

import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from silo.core.conditions import Conditions
from silo.core.elements import State
from silo.errors import SaveError, StateError
from silo.logger.unclosed import LoggerEnd, after_calls, during
from silo.loop.plan import Element

if TYPE_CHECKING:
    from silo.logger.serving.serving import Serving


class WantedStretch(NamedTuple):
    """What a run is to go on as: what changed, who asked for it, and what all is to be."""

    what: str
    who: str
    elements: tuple[Element, ...]
    conditions: Conditions
    check: Callable[[], None]  # raises StateError where others changed the same meanwhile
    take: Callable[[], None]  # has all be so


class LifeCycle:
    """The state of one logger. Changes take `lock`, which `collect()` never does.

    Before it, who starts, cuts or frees the buffers takes `cutting`, with which a stretch is prepared without the lock;
    and before that, who ends the logger `ends`.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._unlocked()
        self.running = False
        self.ending: LoggerEnd | None = None  # how it ended, or is about to
        self.freed = False  # it ended, and what it had is let go of
        self.reason = ""  # of the last stop
        self.serving: Serving | None = None
        self.cut: Callable[[WantedStretch], None]  # go on with another stretch, of a run
        self.memory_bytes: Callable[[], int] = int  # that its buffers have
        self.begun_by = ""  # the client that had the present run begin; empty: the program
        self.give_way: Callable[[], None] = lambda: None  # of a run that a client began, where no tick came since

    def _unlocked(self) -> None:
        self.lock = threading.RLock()
        self.cutting, self.ends = threading.RLock(), threading.RLock()

    @property
    def closed(self) -> bool:
        """Whether it ended, or is about to."""
        return self.ending is not None

    @property
    def state(self) -> State:
        """Running or stopped, as clients see it."""
        return State.RUNNING if self.running else State.STOPPED

    def check_open(self) -> None:
        """Raise StateError once it is closed."""
        if self.closed:
            whose = self.ending.value.format(os.getpid()) if self.ending is LoggerEnd.FORKED else "is closed"
            raise StateError(f"logger '{self.name}' {whose}; make a new one")

    def check_stopped(self, what: str) -> None:
        """Raise StateError while it runs, or once it is closed; `what` can't be done then."""
        self.check_open()
        self.go_before_clients()
        if self.running:
            raise StateError(f"can't {what} while logger '{self.name}' runs: stop() it first; nothing was changed")

    def go_before_clients(self) -> None:
        """Have a run that a client began give way to what the program does, if no tick came since."""
        if self.running and self.begun_by:
            self.give_way()

    def tell(self) -> None:
        """Let the helper process know of a new state or table. Never waits."""
        if self.serving is not None:
            during(self, [], self.serving.state_changed)

    def end(self, end: Callable[[], None]) -> None:
        """Do what ends the logger, or its server: now, or after what this thread is amid."""
        if self.serving is None or not self.serving.keeps(end):
            after_calls(self, end)

    @property
    def helper_is_up(self) -> bool:
        """Whether a helper process is there right now."""
        return self.serving is not None and self.serving.is_up

    def served(self, call: str) -> "Serving":
        """Return the link to the helper process, which does a call. Raises StateError, SaveError without one."""
        self.check_open()
        if self.serving is None or not self.serving.alive:
            raise StateError(f"{call}() needs a helper process, which records: call serve() first; nothing was changed")
        if not self.serving.is_up:
            raise SaveError("the helper process is being started anew: try again in a moment; nothing was changed")
        return self.serving

    def forget(self) -> None:
        """Be closed, in a forked child: all of it belongs to the parent, which may hold the lock."""
        self._unlocked()
        if self.serving is not None:
            self.serving.forget()
        self.running, self.ending, self.freed, self.serving = False, LoggerEnd.FORKED, True, None
