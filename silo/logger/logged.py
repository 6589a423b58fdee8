"""What a logger has logged: how far it is, its samples, saving them and recording them without end."""

import contextlib
import dataclasses
import logging
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from silo.core.arguments import path, text, texts
from silo.core.calls import told_class
from silo.core.elements import FileType, LoggerOptions, SavedFile, State
from silo.core.printing import MOST_ROWS, html_table
from silo.core.recording import Recording
from silo.errors import SaveError, SegmentError, StateError
from silo.logger.calls.keywords import FileTypes
from silo.logger.calls.options import file_types
from silo.logger.calls.other_names import listed, not_deleted, not_set, with_other_names
from silo.logger.conditions import LoggerConditions
from silo.logger.current_run import CurrentRun
from silo.logger.elements import LoggedElement, SavedFiles, look_at, newest_text
from silo.logger.new_values import NewValues, NewValuesReader
from silo.loop.run import Run

if TYPE_CHECKING:
    from silo.logger.helper.serving import Serving

log = logging.getLogger("silo")


@with_other_names
@told_class("log")
class Logged(LoggerConditions):
    """The state and the data of the current or last run."""

    def __init__(self, options: LoggerOptions) -> None:
        super().__init__(options)
        self._present = CurrentRun()
        self._reason = ""
        self._new_values = NewValuesReader()
        self._serving: Serving | None = None

    # ----------------------------------------------------------------------------------------------- the state

    @property
    def state(self) -> State:
        """Running or stopped, as clients see it."""
        return State.RUNNING if self._running else State.STOPPED

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, for good."""
        return self._closed

    @property
    def is_running(self) -> bool:
        """Whether `collect()` logs."""
        return self._running

    @property
    def ticks(self) -> int:
        """Ticks logged since the last start."""
        return self._present.ticks

    @property
    def lost(self) -> int:
        """Samples that could not be kept since the last start (memory limit, full folder), all elements together."""
        return self._present.lost

    @property
    def stop_reason(self) -> str:
        """Why the logger stopped, empty while it runs or before the first start."""
        return self._reason

    @property
    def source_failures(self) -> dict[str, int]:
        """At how many ticks each element could not be read since start; only attributes and functions that failed."""
        return self._present.failures

    @property
    def segment_path(self) -> str:
        """The file of the current or last run, empty before the first start."""
        return self._present.path

    @property
    def present_run(self) -> Run | None:
        """The current or last run; for the serving thread."""
        return self._present.run

    def look_for_unheld(self, run: Run | None = None, found: Sequence[int] | None = None) -> None:
        """Tell of arrays that nobody but silo holds any more.

        For the serving thread, and for whatever ends a run or saves it.

        Args:
            run: the one that was looked at, while its loop turned; the present one if not given.
            found: what was seen of it.
        """
        with self._lock:
            present = self._present.run
            with contextlib.suppress(SegmentError):  # whoever cut it short is told of by what is done next
                if present is not None and not self._closed and run in (None, present):
                    present.look(found, last=not self._running)

    # ---------------------------------------------------------------------------------------------------- data

    def snapshot(self) -> Recording:
        """Return what the buffers hold now, cut at one tick; collection goes on. Raises StateError before the first
        start.
        """
        with self._lock:
            self._check_open()
            if self._present.run is None:
                raise StateError("nothing was logged yet: call start() and collect() first")
            self.look_for_unheld()
            # derived signals and limits as they are, not as they were at the start
            return dataclasses.replace(self._present.run.reader.snapshot(), extras=self._extras)

    def element(self, name: str) -> LoggedElement:
        """Return one element: its options, the newest value, how many samples its buffer holds. Also `log[name]`.

        Args:
            name: the full name, or the name after the prefix.

        Raises:
            ElementError: there is no such element.
        """
        text("the element's name", name, 'log["joints/q"]')
        with self._lock:
            info = self._table.elements[self._table.place(name)].info
            run = None if self._closed else self._present.run
            return look_at(info, run.reader if run is not None else None)

    def __getitem__(self, name: str) -> LoggedElement:
        return self.element(name)

    def __setitem__(self, name: str, value: object) -> NoReturn:
        not_set(name)

    def __delitem__(self, name: str) -> NoReturn:
        not_deleted(name)

    def __dir__(self) -> list[str]:
        return listed(super().__dir__(), type(self))

    def __repr__(self) -> str:
        return f"<Logger {self._about()}>"

    def _about(self) -> str:
        state = "closed" if self._closed else self.state.value
        reason = f" ({self._reason})" if self._reason and not self._running else ""
        held = f", {self.ticks} ticks{', not saved' if self.has_unsaved else ''}" if self._present.number else ""
        pending = f", {len(self._table.pending)} added since" if self._table.pending else ""
        return f"{self.name}: {len(self)} elements{pending}, {self.options.frequency_hz:g} Hz, {state}{reason}{held}"

    def _repr_html_(self) -> str:
        rows = [
            (one.name, one.unit, "on" if one.options.enabled else "off", one.options.divider,
             one.options.action.name.lower(), f"{one.options.buffer_type.name.lower()} {one.options.buffer_size}",
             one.held, newest_text(one))
            for one in (self.element(name) for name in list(self)[: MOST_ROWS + 1])
        ]  # fmt: skip
        heads = ("element", "unit", "log", "divider", "action", "buffer", "held", "newest")
        more = f"{len(self)} elements in all" if len(self) > MOST_ROWS else ""
        return html_table(f"Logger {self._about()}", heads, rows[:MOST_ROWS], more)

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
        with self._lock:
            self._check_open()
            info = self._table.elements[self._table.place(name)].info
            if self._present.run is None:
                raise StateError("nothing was logged yet: call start() and collect() first")
            return self._new_values.read(self._present.run.reader, info.name)

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
        """
        chosen = file_types(types)
        name = text("name", name or "", 'log.save(name="first_walk")')
        where = path("folder", folder) if folder else Path(self.options.folder)
        self._check_open()
        run = self._present.run
        if run is None:
            raise StateError("nothing to save: nothing was logged yet; call start() and collect() first")
        ticks = run.segment.ticks
        if not ticks:
            log.warning("%s: nothing was collected since start(), the file holds no samples", self.options.name)
        self.look_for_unheld()
        saved = self._saved_by_helper(chosen, name, str(where.resolve()) if folder else "")
        if saved is None:
            from silo.files import LogOfRun, write_run

            saved = write_run(
                self.snapshot(),
                where,
                self.options.name,
                chosen,
                name or None,
                why="saved by the robot program",
                events=LogOfRun(self.options.folder, run.id),
            )
        with self._lock:
            self._present.mark_saved(run, ticks)
        return SavedFiles(saved)

    def _saved_by_helper(self, types: list[FileType], name: str, folder: str) -> list[SavedFile] | None:
        """The files that the helper process wrote; None where there is none, or one that is frozen."""
        if self._serving is None or not self._serving.is_up:
            return None
        from silo.logger.helper.serving import HelperFrozenError

        try:
            return self._serving.save(types, name, folder)
        except HelperFrozenError as error:
            log.warning("%s: %s; saving in this process", self.options.name, error)
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
        words.

        Args:
            patterns: elements, namespaces or globs; all elements without any.
            to: a folder, absolute or relative to the logger's.
            split: `"1GB"` or `"10min"`, after which a part is finished: from 1 MB, or 1 s to 31 days; empty: never.
            keep: `"50GB"`, above which its own oldest parts are deleted: from 2 MB; empty: all stay.
            name: of the recording and its files, instead of the logger's.

        Returns:
            The name of the recording.

        Raises:
            ElementError: an argument makes no sense; nothing is recorded.
            StateError: there is no helper process, call `serve()` first.
            SaveError: no element matches a pattern, the name is taken, the system refuses, or the helper process is
                just being started anew.
        """
        from silo.core.quantities.reading import read_keep, read_split
        from silo.recorder.requests import StartRecorder

        split_bytes, split_s = read_split(split)
        request = StartRecorder(
            name=text("name", name, 'log.record(name="walk")'),
            folder=str(path("to", to)),
            patterns=texts("patterns", patterns, "log.record(['joints/*'])"),
            split_bytes=split_bytes,
            split_s=split_s,
            keep_bytes=read_keep(keep),
            client="the robot program",
        )
        started = self._served("record").record(request)
        if started.text:
            log.warning("%s: %s", self.options.name, started.text)
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
        return self._served("stop_recording").stop_recording(text("name", name, 'log.stop_recording("walk")'))

    def _served(self, call: str) -> "Serving":
        self._check_open()
        if self._serving is None or not self._serving.alive:
            raise StateError(f"{call}() needs a helper process, which records: call serve() first; nothing was changed")
        if not self._serving.is_up:
            raise SaveError("the helper process is being started anew: try again in a moment; nothing was changed")
        return self._serving

    def note_saved(self, run_id: str, ticks: int) -> None:
        """Take in that the helper process saved the first `ticks` of a run for one of its clients.

        Args:
            run_id: the run that was saved.
            ticks: how many of its ticks stand in a file.
        """
        with self._lock:
            run = self._present.run
            if run is not None and run.id == run_id:
                self._present.mark_saved(run, ticks)

    @property
    def has_unsaved(self) -> bool:
        """Whether ticks were logged that stand in no file."""
        return self._present.has_unsaved
