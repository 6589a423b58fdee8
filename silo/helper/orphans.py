"""What earlier processes of this logger left unsaved: the helper saves it beside its work, once clients can come.

In a writing process of its own, which is told to be nice to the control loop; one after the other. What can't be saved
stays, and it is said how to save it by hand.
"""

import contextlib
import logging
import threading

from silo.core.elements import SavedFile
from silo.errors import SiloError, StateError
from silo.files.saving import describe
from silo.helper.left_logs import recover, settle_left
from silo.recovery.left import LeftRun
from silo.recovery.runs import left_of, sweep
from silo.rpc.published import EventKind
from silo.state.events import EventNotifier
from silo.state.replica import Replica

log = logging.getLogger("silo.helper")


class OrphanRecovery:
    """Owns the thread that saves what predecessors left."""

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        self._replica = replica
        self._events = events
        self._ended = threading.Event()
        # a daemon: should the helper have to end before it is done, the segment stays for the next one
        self._thread = threading.Thread(target=self._run, name="predecessors", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Begin no other segment, and wait at most `timeout_s` for the one under way."""
        self._ended.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        options = self._replica.now.options
        try:
            for problem in settle_left(self._tell, lambda *of: of == (options.name, options.folder), options.folder):
                log.error("%s", problem)
                self._events.publish(EventKind.RECORDING_FAILED, problem)
        except Exception:  # what is in the segments is saved all the same, and stays as long as it is due
            log.exception("what earlier programs left to be recorded, or captured, can't be completed")
        with contextlib.suppress(SiloError):  # no runtime folder any more: then there is nothing in it either
            sweep(options)
            for stale in left_of(options):
                if not self._ended.is_set():
                    self._recover(stale)

    def _tell(self, kind: EventKind, text: str, files: list[SavedFile]) -> None:
        log.warning("%s", text)
        self._events.publish(kind, text, files=files, logged=self._events.log.newest)  # its own run has it logged

    def _recover(self, stale: LeftRun) -> None:
        if stale.schema is None or stale.holdings is None:
            return
        from silo.recordings.writing import save_apart

        who = f"an earlier run of this logger (process {stale.schema.pid}) ended without close()"
        try:
            done = recover(stale.path, save=save_apart, log=self._events.log.add_missing, wait=False)
        except StateError:
            return  # its own helper, or somebody's `silo recover`, saves it and says so
        except (SiloError, OSError) as error:
            if stale.path.exists():  # else likewise
                self._tell_failed(stale, who, str(error))
            return
        if done.files or done.more:
            texts = [f"{who}; {done.saved}: {describe(done.files)}", *done.more]
            self._tell(EventKind.RECOVERED, "; ".join(texts), done.files)

    def _tell_failed(self, stale: LeftRun, who: str, problem: str) -> None:
        text = f"{who}, and its log could not be saved: {problem}; run `silo recover {stale.path}`"
        log.error("%s", text)
        self._events.publish(EventKind.SAVE_FAILED, text)
