"""How far saves in the helper process are."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from silo.core.elements import SavedFile
from silo.errors import ConnectionLostError, SaveError
from silo.rpc.published import Event, EventKind

MAX_SAVES = 64


class Saves:
    """The newest event of each save."""

    def __init__(self) -> None:
        self._newest: OrderedDict[int, Event] = OrderedDict()
        self._changed = threading.Condition()
        self._losses = 0  # of the link: what ends meanwhile is heard of by nobody

    def wake(self) -> None:
        """Have those that wait look again whether the connection is there."""
        with self._changed:
            self._changed.notify_all()

    def wait(
        self, job: int, timeout_s: float, progress: Callable[[float], None] | None, connected: Callable[[], bool]
    ) -> list[SavedFile]:
        """Return the files of a save when it is done. Raises SaveError and ConnectionLostError."""
        deadline = time.monotonic() + timeout_s
        told, losses = -1.0, self._losses
        while True:
            with self._changed:
                event = self._newest.get(job)
                if event is None or event.kind is EventKind.SAVING:
                    _check_saving(deadline, timeout_s, connected() and self._losses == losses)
                    self._changed.wait(0.1)
                    event = self._newest.get(job)
            if event is None:
                continue
            if progress is not None and event.progress > told:
                told = event.progress
                progress(told)
            if event.kind is EventKind.SAVED:
                return event.files
            if event.kind is EventKind.SAVE_FAILED:
                raise SaveError(event.text)

    def note(self, event: Event) -> None:
        """Take in an event of a save; others are passed over."""
        if not event.job:
            return
        with self._changed:
            self._newest[event.job] = event
            while len(self._newest) > MAX_SAVES:
                self._newest.popitem(last=False)
            self._changed.notify_all()

    def note_link(self, connected: bool) -> None:
        """Take in that the connection was lost or is there again."""
        with self._changed:
            self._losses += not connected
            if connected:
                self._newest.clear()  # another helper process counts from 1 again
            self._changed.notify_all()


def _check_saving(deadline: float, timeout_s: float, connected: bool) -> None:
    if not connected:
        raise ConnectionLostError("the connection was lost while the log was being saved; look into its folder")
    if time.monotonic() > deadline:
        raise SaveError(f"the save isn't done after {timeout_s:g} s; it goes on in the helper process")
