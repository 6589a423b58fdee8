"""Whether a logger runs, is closed, is served: what all its parts look at before they change something."""

import contextlib
import os
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from silo.core.conditions import Conditions
from silo.core.elements import State
from silo.errors import SaveError, StateError
from silo.loop.plan import Element

if TYPE_CHECKING:
    from silo.logger.serving.serving import Serving


LOOK_AGAIN_S = 0.5  # whether that is over whose thread was interrupted before it told


class Cutter:
    """That a thread prepares a stretch: as long as this is there, whatever interrupts it."""

    def __init__(self, thread: int) -> None:
        self.thread = thread


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

    While a thread is `cutting`, prepares a stretch without the lock, no other cut, start or end of the logger begins.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._unlocked()
        self.running = False
        self.closed = False
        self._whose = "is closed"
        self.reason = ""  # of the last stop
        self.serving: Serving | None = None
        self.cut: Callable[[WantedStretch], None] = _never_started  # go on with another stretch
        self.memory_bytes: Callable[[], int] = int  # that its buffers have
        self.begun_by = ""  # the client that had the present run begin; empty: the program
        self.give_way: Callable[[], None] = lambda: None  # of a run that a client began, where no tick came since

    def _unlocked(self) -> None:
        self.lock = threading.RLock()
        self._ending = threading.RLock()  # of several that end it the first one
        self._cut_over, self._ended = threading.Condition(self.lock), threading.Condition(self.lock)
        self._cutter: Callable[[], Cutter | None] = lambda: None

    def cutting(self) -> "Cutter":
        """Have nobody else begin a cut as long as what is returned is there. For who has the lock."""
        cutter = Cutter(threading.get_ident())
        self._cutter = weakref.ref(cutter)
        return cutter

    def wait_for_cut(self) -> None:
        """Wait, without the lock, until no other thread prepares a stretch. For who has the lock.

        A thread's own cut may lie below it on its stack: of a signal handler, or after an interrupt.
        """
        while self._others_cut():
            self._cut_over.wait(LOOK_AGAIN_S)

    def _others_cut(self) -> bool:
        cutter = self._cutter()
        return cutter is not None and cutter.thread != threading.get_ident()

    @contextlib.contextmanager
    def ending(self) -> Iterator[None]:
        """End it alone: of several others wait, without the lock, which one that a signal handler ends may have."""
        with self.lock:
            while not self._ending.acquire(blocking=False):
                self._ended.wait(LOOK_AGAIN_S)
        try:
            yield
        finally:
            self._ending.release()
            with self.lock:
                self._ended.notify_all()

    def cut_is_over(self) -> None:
        """Have those go on who wait for the end of a cut."""
        with self.lock:
            self._cut_over.notify_all()

    @property
    def state(self) -> State:
        """Running or stopped, as clients see it."""
        return State.RUNNING if self.running else State.STOPPED

    def check_open(self) -> None:
        """Raise StateError once it is closed."""
        if self.closed:
            raise StateError(f"logger '{self.name}' {self._whose}; make a new one")

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
            self.serving.state_changed()

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
        self.running, self.closed, self.serving = False, True, None
        self._whose = f"is that of the process that process {os.getpid()} was forked from"


def _never_started(_: WantedStretch) -> None:
    raise StateError("there is nothing to cut: the logger was never started")
