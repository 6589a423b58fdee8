"""What the present run of a logger holds: looked at, saved, recorded."""

import contextlib
import dataclasses
import logging
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from pathlib import Path
from typing import ParamSpec

from silo.core.arguments import path, text, texts
from silo.core.calls import told_class
from silo.core.elements import ROBOT_PROGRAM, FileType, FileTypes, LoggerOptions, SavedFile
from silo.core.recording import Recording
from silo.errors import ElementError, SegmentError, SiloError, StateError
from silo.logger.conditions import LoggerConditions
from silo.logger.current_run import CurrentRun, is_to_be_saved
from silo.logger.life_cycle import LifeCycle
from silo.logger.registrations import Registrations
from silo.logger.results import LoggedElement, NewValues, NewValuesReader, SavedFiles, look_at
from silo.logger.unclosed import LoggerEnd, save_at_end, save_run, say_saved, say_where_it_is
from silo.loop.run import Run

P = ParamSpec("P")

log = logging.getLogger("silo")


@told_class("log")
class RunData:
    """The samples of a logger's present or last run."""

    def __init__(
        self,
        options: LoggerOptions,
        table: Registrations,
        conditions: LoggerConditions,
        life: LifeCycle,
        present: CurrentRun,
    ) -> None:
        self._options, self._table, self._conditions = options, table, conditions
        self._life, self._present = life, present
        self._new_values = NewValuesReader()
        self.saving = threading.RLock()  # of stretches before the present one
        self.failed: Run | None = None  # of which the program's last save() did not come to its end

    def look_for_unheld(self, run: Run | None = None, found: Sequence[int] | None = None) -> None:
        """Tell of arrays that nobody but silo holds any more: those `found` of a run while it turned, else looked for.

        For the serving thread, and for whatever ends a run or saves it.
        """
        with self._life.lock:
            present = self._present.run
            with contextlib.suppress(SegmentError):  # whoever cut it short is told of by what is done next
                if present is not None and not self._life.closed and run in (None, present):
                    present.look(found, last=not self._life.running)

    def snapshot(self) -> Recording:
        """Return what the buffers hold now, cut at one tick; collection goes on. Raises StateError before the first
        start.
        """
        with self._life.lock:
            self._life.check_open()
            if self._present.run is None:
                raise StateError("nothing was logged yet: call start() and collect() first")
            self.look_for_unheld()
            # derived signals and limits as they are, not as they were at the start
            return dataclasses.replace(self._present.run.reader.snapshot(), conditions=self._conditions.now)

    def element(self, name: str) -> LoggedElement:
        """Return one element: its options, the newest value, how many samples its buffer holds. Also `log[name]`.

        Args:
            name: the full name, or the name after the prefix.

        Raises:
            ElementError: there is no such element.
        """
        text("the element's name", name, 'log["joints/q"]')
        with self._life.lock:
            info = self._table.elements[self._table.place(name)].info
            run = None if self._life.closed else self._present.run
            if run is None:
                return LoggedElement(info, lost=self._present.lost.get(info.name, 0))
            return look_at(info, run.reader, self._present.failures.get(info.name, 0))

    def read_new_values(self, name: str) -> NewValues:
        """Return all samples of an element since the last such call, oldest first.

        Args:
            name: the full name, or the name after the prefix.

        Returns:
            Time stamps of shape `(n,)` in ns, values of shape `(n, *shape of the element)`; `missed` counts samples
            that were overwritten before they were read.

        Raises:
            StateError: nothing was logged yet.
            ElementError: there is no such element.
        """
        text("the element's name", name, 'log.read_new_values("joints/q")')
        with self._life.lock:
            self._life.check_open()
            info = self._table.elements[self._table.place(name)].info
            if self._present.run is None:
                raise StateError("nothing was logged yet: call start() and collect() first")
            return self._new_values.read(self._present.run, info.name)

    # ---------------------------------------------------------------------------------------- saving, recording

    def save(
        self,
        types: FileTypes = (FileType.SILO,),
        name: str | None = None,
        folder: str | os.PathLike[str] | None = None,
    ) -> SavedFiles:
        """Save what the buffers hold to files; collection goes on and nothing is emptied.

        Served loggers save in their helper process.

        Args:
            types: `"silo"`, `"csv"`, `"bag"`, one or several.
            name: a file name without ending, instead of `<logger>_<date>_<run number>`.
            folder: where to, instead of the logger's folder (should that be full, or not be there).

        Returns:
            The files, in the order of `types`: path, size in bytes. Of a single one, `.path` is its path.

        Raises:
            SaveError: the system refuses. Nothing stands under the final name, the data is still in memory.
            StateError: nothing was logged yet.
            ElementError: a type is none that can be saved, or stands where the name does; `name="csv"` is a name.
        """
        # the control program loads nothing of files until it saves
        from silo.files.formats import file_types

        chosen = file_types(types)
        name = text("name", name or "", 'log.save(name="first_walk")')
        where = path("folder", folder) if folder else Path(self._options.folder)
        self._life.check_open()
        run = self._present.run
        if run is None:
            raise StateError("nothing to save: nothing was logged yet; call start() and collect() first")
        try:
            before = self._save_cut_off(chosen, name, where)
            if not run.segment.ticks:
                since = "start()" if run.segment.schema.cut is None else "the cut"
                log.warning("%s: nothing was collected since %s, the file holds no samples", self._options.name, since)
            self.look_for_unheld()
            saved = self._saved_by_helper(chosen, name, str(where.resolve()) if folder else "")
            if saved is None:
                why = "saved by the robot program"
                with self._life.lock:  # a start(), or close(), of another thread has the memory of this run go
                    self._life.check_open()
                    run = self._present.run or run
                    ticks, recording, conditions = run.segment.ticks, run.reader.snapshot(), self._conditions.now
                with self._noting_parts(run, ticks):
                    saved = save_run(recording, run.id, self._options, why, conditions, chosen, name, where)
                with self._life.lock:  # what the helper process saved, `note_saved` was told
                    self._present.mark_saved(run, ticks)
        except BaseException:
            if not self._life.closed:  # else by another thread, which dropped it
                self.failed = run
            raise
        self.failed = None
        return SavedFiles([*before, *saved])

    @property
    def save_failed(self) -> bool:
        """Whether the program tried to save what it has, and could not."""
        return self.failed is not None and self.failed in self._present.stretches

    def save_unsaved(self, ended: str) -> None:
        """Save what is in no file as `save()` does, and say so; where that fails it is left to the logger's end."""
        run = self._present.run
        if self._life.closed or run is None or not self._present.has_unsaved:
            return
        try:
            saved = self.save()
        except SiloError as error:
            log.warning("%s: saving at the end failed: %s", self._options.name, error)
        else:
            say_saved(run, self._options.name, saved, ended)

    def save_at_end(self, ending: LoggerEnd) -> bool:
        """Save what is in no file, each stretch to its own, and say where; whether that went well with all."""
        for one in filter(is_to_be_saved, self._present.stretches):
            if ending is LoggerEnd.FORGOTTEN:  # the collector may run in any thread: no place to write files
                say_where_it_is(one, self._options, ended=ending.value)
            elif save_at_end(one, self._options, self._conditions.now, ending.value):
                self._present.mark_saved(one, one.segment.ticks)
        return not any(map(is_to_be_saved, self._present.stretches))

    def save_cut_off(self) -> None:
        """Have the helper process save the stretches before the present one, if it is there; nobody waits for it."""
        if self._life.helper_is_up and any(map(is_to_be_saved, self._present.cut_off)):
            threading.Thread(target=self._save_alone, name="silo-cut", daemon=True).start()

    def _save_alone(self) -> None:
        """What can't be saved is told, and stays for the next save."""
        try:
            self._save_cut_off([FileType.SILO], "", Path(self._options.folder))
        except SiloError as error:
            if not self._life.closed:
                log.warning(
                    "%s: what was logged before a cut is in no file yet: %s; it stays in memory, save() tries again",
                    self._options.name, error,
                )  # fmt: skip

    def _save_cut_off(self, types: list[FileType], name: str, where: Path) -> list[SavedFile]:
        """Save the stretches before the present one that are in no file, each to its own, and let go of them."""
        files: list[SavedFile] = []
        with self.saving:
            for run in self._present.cut_off.copy():
                self._present.wait_over(run)
                if not is_to_be_saved(run):
                    continue
                ticks = run.segment.ticks
                saved = self._saved_by_helper(types, name, str(where.resolve()), run)
                if saved is None:
                    with self._life.lock:
                        if self._life.closed or run not in self._present.cut_off:
                            continue  # another thread started, or closed: that saves it, or drops it
                        recording, conditions = run.reader.snapshot(), self._conditions.now
                    why = "saved when edits were applied"
                    with self._noting_parts(run, ticks):
                        saved = save_run(recording, run.id, self._options, why, conditions, types, name, where)
                files += saved
                with self._life.lock:
                    self._present.mark_saved(run, ticks)
            with self._life.lock:
                self._present.settle_cut()
        return files

    @contextlib.contextmanager
    def _noting_parts(self, run: Run, ticks: int) -> Iterator[None]:
        """Where some formats can't be written the others have the ticks all the same."""
        from silo.files import PartlySavedError

        try:
            yield
        except PartlySavedError as error:
            if error.saved:
                with self._life.lock:
                    self._present.mark_saved(run, ticks)
            raise

    def _saved_by_helper(
        self, types: list[FileType], name: str, folder: str, run: Run | None = None
    ) -> list[SavedFile] | None:
        """The files that the helper process wrote; None where there is none, or one that is frozen."""
        if self._life.serving is None or not self._life.serving.is_up:
            return None
        from silo.logger.serving.serving import HelperFrozenError

        try:
            return self._life.serving.save(types, name, folder, run)
        except HelperFrozenError as error:
            log.warning("%s: %s; saving in this process", self._options.name, error)
            return None

    def record(
        self,
        patterns: Iterable[str] = (),
        *,
        to: str | os.PathLike[str] = "recordings",
        split: str = "1GB",
        keep: str = "",
        name: str = "",
    ) -> str:
        """Record every sample from now on to MCAP files, across restarts, until `stop_recording`.

        Needs `serve()`: a process of the helper's writes, the loop has no part in it. The call waits for its first
        words. All parts of a run are one log by `silo.open_log(folder, alone=False)`.

        Args:
            patterns: elements, namespaces or globs; all elements without any.
            to: a folder, absolute or relative to the logger's.
            split: `"1GB"` or `"10min"`, after which a part is finished: from 1 MB, or 1 s to 31 days; empty: never.
            keep: `"50GB"`, above which the oldest parts of its name are deleted: from 2 MB; empty: all stay.
            name: of the recording and its files, instead of the logger's.

        Returns:
            The name of the recording.

        Raises:
            ElementError: an argument makes no sense; nothing is recorded.
            StateError: there is no helper process, call `serve()` first.
            SaveError: no element matches a pattern, the name is taken, the system refuses, or the helper process is
                just being started anew.
        """
        from silo.recorder.requests import start_recorder

        chosen = texts("patterns", patterns, "log.record(['joints/*'])")
        name = text("name", name, 'log.record(name="walk")')
        request = start_recorder(chosen, str(path("to", to)), split, keep, name, ROBOT_PROGRAM)
        started = self._life.served("record").record(request)
        if started.text:
            log.warning("%s: %s", self._options.name, started.text)
        return started.name

    def stop_recording(self, name: str = "") -> str:
        """Finish an endless recording; waits up to 5 s for the end of its last part.

        Args:
            name: what `record` returned; empty: the only one.

        Returns:
            What was done, in words, with its numbers of files and samples.

        Raises:
            ElementError: the name is no text.
            StateError: there is no helper process, call `serve()` first.
            SaveError: there is none, or none of that name, or several without a name; nothing was stopped. Or the
                helper process is just being started anew.
        """
        return self._life.served("stop_recording").stop_recording(text("name", name, 'log.stop_recording("walk")'))

    def note_saved(self, run_id: str, ticks: int) -> None:
        """Take in that the helper process saved the first `ticks` of a run for one of its clients."""
        with self._life.lock:
            for run in [run for run in self._present.stretches if run.id == run_id]:
                self._present.mark_saved(run, ticks)
                if run is self._present.run:
                    self.save_cut_off()  # a save is of all stretches: of those, too, that could not be saved before


def types_in_one_list(save: Callable[P, SavedFiles]) -> Callable[P, SavedFiles]:
    """Have `log.save("csv", "silo")` refused: the second is meant as a type, unless it is given as `name=`."""

    @wraps(save)
    def call(*args: P.args, **kwargs: P.kwargs) -> SavedFiles:
        if len(args) > 2 and isinstance(name := args[2], str):  # the logger is the first
            from silo.files.formats import SAVED_NAMES, file_types

            if name in SAVED_NAMES:
                given = [*(one.name.lower() for one in file_types(args[1])), name]
                raise ElementError(
                    f"log.save() takes types in one list, got {name!r} for a name: write log.save({given}); "
                    f"a file of that name is log.save(..., name={name!r})"
                )
        return save(*args, **kwargs)

    return call
