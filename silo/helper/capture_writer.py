"""The thread that writes captures, of each trigger one in turn: the judge never waits for a disk."""

import dataclasses
import logging
import math
import threading
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from silo.errors import SaveError, SiloError
from silo.files.saving import size_of
from silo.helper.capture_list import CaptureEntry, CaptureList
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.helper.waiting_captures import WaitingCaptures
from silo.ipc.published import EventKind
from silo.model import FileType, SavedFile
from silo.recording import with_events

if TYPE_CHECKING:
    from silo.helper.spool import Spool

log = logging.getLogger("silo.helper")


class CaptureWriter:
    """Owns the thread. The other methods may be called by any thread."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror, self._events = mirror, events
        self._waiting = WaitingCaptures()
        self._listed: CaptureList | None = None
        self._files: dict[tuple[str, str], tuple[str, ...]] = {}  # of the newest capture of a trigger of a run
        self._thread = threading.Thread(target=self._write_all, name="captures")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, within_s: float = math.inf) -> None:
        """Write what waits and end; what is not begun within that time is told, and left out. May be called twice."""
        self._waiting.stop(within_s)
        self._thread.join()
        for text in self._waiting.drop_all():
            self._events.publish(EventKind.SAVE_FAILED, text)

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
            for text in self._waiting.done():
                self._events.publish(EventKind.SAVE_FAILED, text)
            del spool  # while the thread waits, nothing must hold the memory of a segment that is gone

    def _guarded(self, spool: "Spool") -> None:
        try:
            self._write(spool)
        except Exception as error:
            # whatever a writer does, the next capture gets its chance, and clients hear of this one
            log.exception("a capture was not saved")
            why = str(error) if isinstance(error, SiloError | OSError) else repr(error)
            text = f"capture {spool.capture.number} of '{spool.trigger}' was not saved: {why}"
            self._events.publish(EventKind.SAVE_FAILED, text)

    def _write(self, spool: "Spool") -> None:
        from silo.files.naming import next_run_number

        folder, capture, logger = self.folder, spool.capture, spool.schema.logger
        Path(folder).mkdir(parents=True, exist_ok=True)
        listed = self._list_of(folder, logger)
        entry = listed.find(spool.run, spool.trigger, capture.number)
        if entry is None:
            begun = f"{logger}_{datetime.now():%Y%m%d_%H-%M-%S}_{next_run_number(folder, logger):05d}"
            name = f"{begun}_{spool.trigger}_{capture.number}"
            entry = CaptureEntry(spool.run, spool.trigger, capture.number, name)
            listed.note(entry)  # a helper process that is killed from here on leaves the name to its successor
        files = self._written(spool, folder, entry.name)
        ended = spool.why and f" ({spool.why})"
        paths = ", ".join(file.path for file in files)
        text = f"capture {capture.number} of '{spool.trigger}', ticks {capture.first} to {capture.last}{ended}: {paths}"
        if not self._was_told(spool, files):
            self._events.publish(EventKind.CAPTURED, text, files=files)
        self._files[spool.run, spool.trigger] = tuple(file.path for file in files)
        removed = listed.written(entry, [file.path for file in files], spool.options.keep)
        if removed:
            log.info("trigger '%s' keeps %d captures: removed %s", spool.trigger, spool.options.keep, removed)

    def _list_of(self, folder: str, logger: str) -> CaptureList:
        """The list that was read before, of which only what is new has to be read."""
        if self._listed is None or not self._listed.is_of(folder, logger):
            self._listed = CaptureList(folder, logger)
        return self._listed

    def _was_told(self, spool: "Spool", files: list[SavedFile]) -> bool:
        told = [event.text for event in self._events.log.of_run(spool.run) if event.kind == EventKind.CAPTURED.value]
        return any(file.path in text for file in files for text in told)

    def _written(self, spool: "Spool", folder: str, name: str) -> list[SavedFile]:
        """The files of a capture; those that a predecessor wrote already are left as they are."""
        from silo.files import write
        from silo.files.formats import SAVED
        from silo.files.naming import custom_path
        from silo.helper.writing import WriteOrder, write_apart

        wanted: list[FileType] = list(dict.fromkeys((FileType.SILO, *spool.options.save)))
        paths = {kind: custom_path(folder, name, SAVED[kind].ending) for kind in wanted}
        files = [SavedFile(str(path), kind, size_of(path)) for kind, path in paths.items() if path.exists()]
        there = {file.type for file in files}
        if there.issuperset(spool.options.save):
            return [file for file in files if file.type in spool.options.save]
        options, logger = spool.options, spool.schema.logger
        if FileType.SILO not in there:
            happened = self._events.log.of_run(spool.run)
            first, last = spool.capture.first, spool.capture.last
            recording = with_events(spool.recording(), [event for event in happened if first <= event.tick <= last])
            # derived signals and limits by which it fired, whatever they are by now
            extras = msgspec.structs.replace(spool.extras, capture=recording.extras.capture)
            recording = dataclasses.replace(recording, extras=extras)
            files += write(recording, folder, logger, [FileType.SILO], name, why=f"trigger {options.name}")
        others: list[FileType] = [kind for kind in wanted if kind is not FileType.SILO and kind not in there]
        if others:
            # what CSV and bags need would leave this process with twice its memory
            order = WriteOrder(folder, logger, others, name, log=str(paths[FileType.SILO]))
            report = write_apart(None, order, lambda _: None)
            files += report.files
            if report.error:
                raise SaveError(f"{report.error}; saved: {', '.join(file.path for file in files)}")
        if FileType.SILO not in options.save:
            paths[FileType.SILO].unlink(missing_ok=True)
        return sorted((file for file in files if file.type in options.save), key=lambda file: wanted.index(file.type))
