"""The thread that writes captures, of each trigger one in turn: the judge never waits for a disk."""

import logging
import math
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

from silo.errors import SaveError, SiloError
from silo.files.manifest import CaptureList
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.helper.waiting_captures import WaitingCaptures
from silo.ipc.published import EventKind
from silo.model import SavedFile

if TYPE_CHECKING:
    from silo.helper.spool import Spool

log = logging.getLogger("silo.helper")


class CaptureWriter:
    """Owns the thread. The other methods may be called by any thread."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror, self._events = mirror, events
        self._waiting = WaitingCaptures()
        self._listed: CaptureList | None = None
        self.left: set[str] = set()  # runs with captures that wait for who comes after this process
        self._files: dict[tuple[str, str], tuple[str, ...]] = {}  # of the newest capture of a trigger of a run
        self._thread = threading.Thread(target=self._write_all, name="captures")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, within_s: float = math.inf) -> None:
        """Write what waits and end; what is not begun within that time is told, and left to others. Twice is fine."""
        self._waiting.stop(within_s)
        self._thread.join()
        texts, runs = self._waiting.drop_all()
        self.left |= runs
        self._tell_left_out(texts)

    def add(self, spool: "Spool") -> None:
        """Have a capture written."""
        if self._waiting.add(spool):
            text = (
                f"trigger '{spool.trigger}' fires faster than its captures can be written: the oldest that wait are "
                "left out from here on; give it a holdoff"
            )
            self._events.publish(EventKind.SAVE_FAILED, text)

    @property
    def folder(self) -> str:
        """Where captures are written to."""
        return self._mirror.now.robot.folder

    def waiting(self, run: str = "") -> "list[Spool]":
        """Return the captures that are not written yet, of a run or of all."""
        return [one for one in self._waiting.all() if not run or one.run == run]

    @property
    def size_bytes(self) -> int:
        """Bytes of those."""
        return sum(one.size_bytes for one in self.waiting())

    def files(self, run: str, trigger: str) -> tuple[str, ...]:
        """Return the files of the newest capture of a trigger."""
        return self._files.get((run, trigger), ())

    # ------------------------------------------------------------------------------------------------- the thread

    def _write_all(self) -> None:
        while (spool := self._waiting.next()) is not None:
            self._guarded(spool)
            self._tell_left_out(self._waiting.done())
            del spool  # while the thread waits, nothing must hold the memory of a segment that is gone

    def _tell_left_out(self, texts: Sequence[tuple[str, str]]) -> None:
        for run, text in texts:
            self._events.publish(EventKind.SAVE_FAILED, text, run=run)

    def _guarded(self, spool: "Spool") -> None:
        try:
            try:
                self._write(spool)
            except SaveError as error:  # its writing process was killed, perhaps
                log.info("capture %d of '%s' is tried again: %s", spool.capture.number, spool.trigger, error)
                self._write(spool)
        except Exception as error:
            # whatever a writer does, the next capture gets its chance, and clients hear of this one
            is_ours = isinstance(error, SiloError | OSError)
            log.log(logging.WARNING if is_ours else logging.ERROR, "a capture was not saved", exc_info=not is_ours)
            why = str(error) if is_ours else repr(error)
            text = f"capture {spool.capture.number} of '{spool.trigger}' was not saved: {why}"
            self._tell(spool, EventKind.SAVE_FAILED, text)

    def _write(self, spool: "Spool") -> None:
        from silo.helper.capture_files import write_capture

        logger = spool.schema.logger
        listed = self._list_of(self.folder, logger)
        done = write_capture(spool, self.folder, listed, self._events.log.of_run(spool.run))
        if done.files and not self._was_told(spool, done.files):
            self._tell(spool, EventKind.CAPTURED, done.text, done.files)
        self._files[spool.run, spool.trigger] = tuple(file.path for file in done.files)
        if done.removed:
            log.info("trigger '%s' keeps %d captures: removed %s", spool.trigger, spool.options.keep, done.removed)

    def _tell(self, spool: "Spool", kind: EventKind, text: str, files: Sequence[SavedFile] = ()) -> None:
        """Tell it of the capture's own run, which may be over, at the tick of what fired first."""
        fire = spool.capture.fires[0]
        self._events.publish(kind, text, files=files, tick=fire.tick, stamp_ns=fire.time_ns, run=spool.run)

    def _list_of(self, folder: str, logger: str) -> CaptureList:
        """The list that was read before, of which only what is new has to be read."""
        if self._listed is None or not self._listed.is_of(folder, logger):
            self._listed = CaptureList(folder, logger)
        return self._listed

    def _was_told(self, spool: "Spool", files: list[SavedFile]) -> bool:
        told = [event.text for event in self._events.log.of_run(spool.run) if event.kind == EventKind.CAPTURED.value]
        return any(file.path in text for file in files for text in told)
