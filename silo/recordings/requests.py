"""Saving, and the recordings in the logger's own folder."""

from typing import ClassVar

import msgspec

from silo.core.arguments import text, whole
from silo.core.calls import told_class
from silo.core.conditions import Conditions
from silo.core.elements import FileType, FileTypes
from silo.rpc.declaring import Caller, Do, Lane, Reply, SlowAsk, ask, change, given


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

    `disk_bytes` is the size of the disk of the folder, `free_bytes` what is free of it. `recorded` has the bytes of all
    finished parts by folder and recording, as `recordings/demo`: they count into the budget of the next one so called.
    """

    folder: str
    recordings: list[SavedRecording]
    count: int
    disk_bytes: int = 0
    free_bytes: int = 0
    recorded: dict[str, int] = {}


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


class Save(Do[SaveStarted], frozen=True, rename={"conditions": "extras"}):
    """Save the data in the helper process. The reply comes at once; progress and result come as events.

    `name` replaces the usual file name (a plain name: no `/`, no leading dot). `folder` (absolute) replaces the
    logger's own; only the robot program may choose it, and send its present `conditions`. `why` is kept in the files;
    without it, who asked. `segment` is that of a stretch before the present one, which the robot program alone names.
    """

    timeout_s: ClassVar[float] = 2.0

    types: list[FileType]
    name: str = ""
    folder: str = ""
    why: str = ""
    conditions: Conditions | None = None
    segment: str = ""


@told_class("client")
class RecordingRequests(Caller):
    """Saved files."""

    def save(self, types: FileTypes = (FileType.SILO,), name: str = "") -> int:
        """Begin to save in the helper process.

        Args:
            types: `"silo"`, `"csv"`, `"bag"`, one or several.
            name: a file name without ending, instead of the usual one.

        Returns:
            The number of the job for `wait_saved`.
        """
        from silo.files.formats import file_types

        return self._call(Save(types=file_types(types, "client.save"), name=name)).job

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
