"""Whether a logger runs, is closed, is served: what all its parts look at before they change something."""

import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from silo.core.elements import State
from silo.errors import SaveError, StateError

if TYPE_CHECKING:
    from silo.logger.serving.serving import Serving


class LifeCycle:
    """The state of one logger. Changes take `lock`, which `collect()` never does."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lock = threading.RLock()
        self.running = False
        self.closed = False
        self._whose = "is closed"
        self.reason = ""  # of the last stop
        self.serving: Serving | None = None
        self.cut: Callable[[str, str], None] = _never_started  # what changed, who asked: go on with another stretch
        self.memory_bytes: Callable[[], int] = int  # that its buffers have

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
        if self.running:
            raise StateError(f"can't {what} while logger '{self.name}' runs: stop() it first; nothing was changed")

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
        self.lock = threading.RLock()
        if self.serving is not None:
            self.serving.forget()
        self.running, self.closed, self.serving = False, True, None
        self._whose = f"is that of the process that process {os.getpid()} was forked from"


def _never_started(_what: str, _who: str) -> None:
    raise StateError("there is nothing to cut: the logger was never started")
