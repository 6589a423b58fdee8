"""Saving, the recordings in the logger's own folder, and endless recordings."""

from collections.abc import Sequence
from typing import ClassVar

import msgspec

from silo.core.arguments import text, texts, whole
from silo.core.calls import told_class
from silo.core.elements import Conditions, FileType, RecorderState
from silo.rpc.declaring import Caller, Do, Done, Lane, Reply, SlowAsk, ask, change, given
from silo.rpc.words import FileTypes, file_types


class RecordingFile(msgspec.Struct, frozen=True, omit_defaults=True):
    """One file (or bag folder) of a recording; `name` is plain, `folder` is where it lies below the logger's own."""

    name: str
    type: FileType
    size_bytes: int
    changed_ns: int  # by the robot's clock
    folder: str = ""


class SavedRecording(msgspec.Struct, frozen=True, omit_defaults=True):
    """One save: the files of it, all of one `stem`.

    begun_ns: its first time stamp, ns; 0 where its files don't say. why: it was saved, in a few words. logger: which
    one wrote it. own: this one did, so that it may be deleted here. unfinished: it is being written, or its writer
    died. unread: its files were not looked into yet, ask again.
    """

    stem: str
    files: list[RecordingFile]
    begun_ns: int = 0
    span_s: float = 0.0
    why: str = ""
    logger: str = ""
    markers: int = 0
    own: bool = False
    unfinished: bool = False
    unread: bool = False

    @property
    def size_bytes(self) -> int:
        """Bytes of all its files."""
        return sum(file.size_bytes for file in self.files)


class Recordings(Reply, frozen=True):
    """What is in the logger's own folder, the newest first: at most as many as asked for, of `count`.

    `disk_bytes` is the size of the disk of the folder, `free_bytes` what is free of it.
    """

    folder: str
    recordings: list[SavedRecording]
    count: int
    disk_bytes: int = 0
    free_bytes: int = 0


class PartOfRecording(msgspec.Struct, frozen=True):
    """One plain file to fetch; `path` is relative to the logger's folder. Another `mark` means another content."""

    path: str
    size_bytes: int
    mark: str
    changed_ns: int


class RecordingParts(Reply, frozen=True):
    """The plain files that make up a recording: of a bag those in its folder, of a CSV file also the one beside it."""

    name: str
    is_folder: bool
    parts: list[PartOfRecording]


class Piece(Reply, frozen=True):
    """A piece of a file: `crc32` is over the `count` bytes that were meant, which are in `data` if they were wished."""

    count: int
    crc32: int
    data: bytes = b""


class SaveStarted(Reply, frozen=True):
    """`job` is the number under which events speak of this save."""

    job: int


class GetPiece(SlowAsk[Piece], frozen=True):
    """Read `count` bytes from `offset` on of a part of a recording; at most 4 MB, to be summed up only 64 MB.

    Refused (why: CONFLICT) where the file isn't the one with that `mark` any more.
    """

    path: str
    mark: str
    offset: int
    count: int
    sum_only: bool = False


class Save(Do[SaveStarted], frozen=True):
    """Save the data in the helper process. The reply comes at once; progress and result come as events.

    `name` replaces the usual file name (a plain name: no `/`, no leading dot). `folder` (absolute) replaces the
    logger's own; only the robot program may choose it, and send its present `extras`. `why` is kept in the files;
    without it, who asked.
    """

    timeout_s: ClassVar[float] = 2.0

    types: list[FileType]
    name: str = ""
    folder: str = ""
    why: str = ""
    extras: Conditions | None = None


class RecorderInfo(msgspec.Struct, frozen=True):
    """An endless recording. `samples`, `lost` and `parts` count since it was started, `size_bytes` is on the disk now.

    `written_bytes` counts since it was started too, what was deleted since along with it.

    `split_bytes`, `split_s` and `keep_bytes` are 0 for no limit; `text` says how it ended, if it did.
    """

    name: str
    folder: str
    state: RecorderState
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0
    part: str = ""
    parts: int = 0
    size_bytes: int = 0
    samples: int = 0
    lost: int = 0
    since_ns: int = 0
    by: str = ""
    text: str = ""
    pid: int = 0
    written_bytes: int = 0


class RecorderStarted(Reply, frozen=True):
    """It records. `folder` is absolute, on the robot; `text` says what will not be recorded as one may think."""

    name: str
    folder: str
    text: str = ""


class Recorders(Reply, frozen=True):
    """All recorders of a logger; those that ended by themselves stay until they are stopped."""

    recorders: list[RecorderInfo]


class StartRecorder(Do[RecorderStarted], frozen=True):
    """Record what these patterns mean (all without any) to MCAP files, from now on and across new starts.

    `folder` lies inside the logger's folder; only the robot program may name another. A part ends at `split_bytes` or
    after `split_s`; of all parts `keep_bytes` are kept, the oldest go. 0 is no limit. `name` is drawn if it is empty.
    """

    lane: ClassVar[Lane] = Lane.RECORDERS

    name: str = ""
    folder: str = ""
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0


class StopRecorder(Do[Done], frozen=True):
    """Finish the part and end; an empty name is the only one."""

    lane: ClassVar[Lane] = Lane.RECORDERS

    name: str = ""


@told_class("client")
class RecordingRequests(Caller):
    """Saved files and endless recordings."""

    def save(self, types: FileTypes = (FileType.SILO,), name: str = "") -> int:
        """Begin to save in the helper process.

        Args:
            types: `"silo"`, `"csv"`, `"bag"`, one or several.
            name: a file name without ending, instead of the usual one.

        Returns:
            The number of the job for `wait_saved`.
        """
        return self._call(Save(types=file_types(types), name=name)).job

    @ask("ListRecordings", slow=True)
    def recordings(self, most: int = 1000) -> Recordings:
        """Return the recordings in the logger's own folder on the robot, the newest first.

        Args:
            most: at most so many, 1 to 10 000.

        Returns:
            The rows, of `count` that there are; sizes in bytes, times in ns by the robot's clock, `span_s` in s. Of
            thousands some may be `unread` yet: ask again.

        Raises:
            ElementError: `most` is out of range.
            RefusedError: the folder can't be read, or there is none before the first save.
        """
        return given(most=whole("most", most, 1, 10_000))

    @change(timeout_s=30.0, lane=Lane.DISK)
    def delete_recording(self, name: str) -> str:
        """Delete a recording that this logger wrote.

        Args:
            name: of a file or bag folder with its ending, or the stem for all files of a save, as `recordings` has
                them.

        Returns:
            What was deleted, and how many MB, in words.

        Raises:
            RefusedError: there is none, or one of its files isn't surely of this logger: nothing was deleted. Or the
                system refuses, or a bag holds files of others, which stays; other files of the save may be gone then.
            ElementError: the name is no text; nothing was asked.
        """
        return given(name=text("name", name, "client.delete_recording('robot_..._00007')"))

    @ask("GetParts", slow=True)
    def _parts_of(self, name: str) -> RecordingParts:
        """Which plain files make up the recording `name`, a file or bag folder of the list?"""

    def _piece_of(self, path: str, mark: str, offset: int, count: int, sum_only: bool) -> Piece:
        return self._call(GetPiece(path=path, mark=mark, offset=offset, count=count, sum_only=sum_only))

    def record(
        self,
        patterns: Sequence[str] = (),
        to: str = "",
        split: str = "1GB",
        keep: str = "",
        name: str = "",
    ) -> RecorderStarted:
        """Record every sample from now on to MCAP files on the robot, across restarts, until `stop_recorder`.

        Args:
            patterns: elements, namespaces or globs; all elements without any.
            to: a folder inside the logger's, relative to that or absolute; empty: `recordings`.
            split: `"1GB"` or `"10min"`, after which a part is finished: from 1 MB, or 1 s to 31 days; empty: never.
            keep: `"50GB"`, above which its own oldest parts are deleted: from 2 MB; empty: all stay.
            name: of the recording and its files, instead of the logger's.

        Returns:
            Its `name`, its `folder` (absolute, on the robot), and in `text` what will not be recorded without end.

        Raises:
            ElementError: `split`, `keep` or the patterns make no sense; nothing is recorded.
            RefusedError: no element matches a pattern, the folder is outside of the logger's, the name can't be or is
                taken, 8 recordings are under way, or the system or a robot program that has ended prevents it; nothing
                is recorded.
        """
        from silo.core.quantities import read_keep, read_split

        split_bytes, split_s = read_split(split)
        return self._call(
            StartRecorder(
                name=name,
                folder=to,
                patterns=texts("patterns", patterns, "['/log/joints/*']"),
                split_bytes=split_bytes,
                split_s=split_s,
                keep_bytes=read_keep(keep),
            )
        )

    def stop_recorder(self, name: str = "") -> str:
        """Finish an endless recording; waits up to 5 s for the end of its last part.

        Args:
            name: of the recording; empty: the only one.

        Returns:
            What was done, in words, with its numbers of files and samples.

        Raises:
            RefusedError: there is none, or none of that name, or several without a name; nothing was stopped.
        """
        return self._call(StopRecorder(name=name)).text

    def recorders(self) -> list[RecorderInfo]:
        """Return the endless recordings of this logger; those that ended by themselves stay until they are stopped.

        Returns:
            For each its parts, samples and losses since it was started, the bytes on the disk, and how it ended.
        """
        return self._list_recorders().recorders

    @ask()
    def _list_recorders(self) -> Recorders:
        """Which endless recordings are there, and how far are they?"""
