"""An index is kept up to date as files come: by a process of its own, which is nice to the control loop.

The helper process says that files came or went. Where the folder, or one that it is in, has an index, it is brought up
to date a second later; without one nothing happens: `silo runs` makes it.
"""

import logging
import os
import queue
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from silo.core.child import ChildProcess
from silo.core.elements import SavedFile
from silo.errors import SiloError, reason
from silo.run_index.finding import NAME
from silo.state.events import EventNotifier
from silo.state.replica import Replica

SETTLE_S = 1.0  # what is saved in several formats comes one after another
NICER = 10

log = logging.getLogger("silo.helper")


class IndexKeeper:
    """Owns the thread that has indexes brought up to date."""

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        """Hear of files by what is told of them."""
        self._replica = replica
        self._changed: queue.SimpleQueue[Path | None] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="index")
        self.start = self._thread.start
        events.files_changed = self._note

    def stop(self) -> None:
        """End; what came last is left to a process that goes on."""
        self._changed.put(None)
        self._ended.set()
        self._thread.join()

    def _note(self, files: Sequence[SavedFile]) -> None:
        for folder in {Path(file.path).parent for file in files} or [Path(self._replica.now.robot.folder)]:
            self._changed.put(folder)

    def _keep(self) -> None:
        folders: set[Path | None] = set()
        while None not in folders:
            folders = {self._changed.get()}
            self._ended.wait(SETTLE_S)
            while not self._changed.empty():
                folders.add(self._changed.get())
            for root in {root for folder in folders if folder is not None for root in _indexed(folder)}:
                self._bring_up_to_date(root)

    def _bring_up_to_date(self, root: Path) -> None:
        try:
            child = ChildProcess(__name__, [str(root)])
        except OSError as error:
            log.warning("the index of %s is not kept: %s", root, reason(error))
            return
        while child.is_there and not self._ended.wait(SETTLE_S):
            pass


def _indexed(folder: Path) -> list[Path]:
    """The folders with an index that speaks of the logs of a folder."""
    try:
        return [one for one in (folder.resolve(), *folder.resolve().parents) if (one / NAME).exists()]
    except OSError:
        return []


def main() -> None:
    """Bring the index of a folder up to date; that it can't be is for whoever asks for the runs."""
    from silo.run_index.index import RunIndex

    os.nice(NICER)
    try:
        index = RunIndex(Path(sys.argv[1]))
        index.refresh()
        index.close()
    except SiloError as error:
        log.warning("the index of %s is not kept: %s", sys.argv[1], error)


if __name__ == "__main__":
    main()
