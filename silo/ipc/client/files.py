"""Saved files: saving, and the recordings in the logger's own folder."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from silo.arguments import real, text, whole
from silo.calls import told_class
from silo.ipc.client.calling import LONGEST_S, Calls
from silo.ipc.messages import (
    DeleteRecording,
    GetParts,
    GetPiece,
    ListRecordings,
    Piece,
    RecordingParts,
    Recordings,
    Save,
)
from silo.ipc.words import FileTypes, file_types
from silo.model import FileType, SavedFile

if TYPE_CHECKING:
    import os
    from pathlib import Path


@told_class("client")
class FileCalls(Calls):
    """Saved files."""

    def save(self, types: FileTypes = (FileType.SILO,), name: str = "") -> int:
        """Begin to save in the helper process.

        Args:
            types: `"silo"`, `"csv"`, `"bag"`, one or several.
            name: a file name without ending, instead of the usual one.

        Returns:
            The number of the job for `wait_saved`.
        """
        return self._call(Save(types=file_types(types), name=name, client=self._name)).job

    def wait_saved(
        self, job: int, timeout_s: float = 600.0, progress: Callable[[float], None] | None = None
    ) -> list[SavedFile]:
        """Wait for the end of a save.

        Args:
            job: the number that `save` returned.
            timeout_s: how long to wait, s.
            progress: called with the fraction done, 0 to 1.

        Returns:
            The files: path, size in bytes.

        Raises:
            SaveError: it failed, with the reason, or takes too long.
            ConnectionLostError: the connection is lost.
        """
        whole("job (the number that save() returned)", job, 0, 2**63 - 1)
        wait_s = real("timeout_s", timeout_s, 0, LONGEST_S, "s")
        return self._saves.wait(job, wait_s, progress, lambda: self._connection.connected)

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
        return self._call(ListRecordings(most=whole("most", most, 1, 10_000), client=self._name))

    def fetch(
        self,
        name: str,
        folder: "str | os.PathLike[str]" = ".",
        progress: Callable[[int, int], None] | None = None,
        *,
        replace: bool = False,
        patience_s: float = 30.0,
    ) -> "Path":
        """Copy a recording of the logger's folder (a file, or a bag folder) into a folder of this machine.

        In pieces, each with a checksum. When the link is cut it goes on as soon as the link is back within
        `patience_s`; what came until then is kept as `<name>.part`, and the same call later goes on behind it.

        Args:
            name: of the file or bag folder with its ending, as `recordings` has it.
            folder: where to; made where it isn't there.
            progress: called with the bytes that are here and the bytes of all of it, also while the link is cut; what
                it raises ends the call.
            replace: take the place of a file of this name that is there already.
            patience_s: how long to wait for a link that is cut, s.

        Returns:
            The path of the copy.

        Raises:
            SaveError: it is there already (without `replace`) or being fetched by another program, the disk is full, or
                the system refuses.
            ConnectionLostError: the link is cut for longer than `patience_s`, or what comes makes no sense.
            RefusedError: there is no such recording, or it was written anew meanwhile.
            ElementError: an argument makes no sense; nothing was asked.
        """
        from silo.arguments import path
        from silo.ipc.fetching import Fetch

        wait_s = real("patience_s", patience_s, 0, LONGEST_S, "s")
        ask = Fetch(self._parts_of, self._piece_of, lambda: self._connection.connected, wait_s)
        return ask.run(
            text("name", name, "client.fetch('robot_..._00007.silo')"), path("folder", folder), progress, replace
        )

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
        named = text("name", name, "client.delete_recording('robot_..._00007')")
        return self._call(DeleteRecording(name=named, client=self._name)).text

    def _parts_of(self, name: str) -> RecordingParts:
        return self._call(GetParts(name=name, client=self._name))

    def _piece_of(self, path: str, mark: str, offset: int, count: int, sum_only: bool) -> Piece:
        return self._call(
            GetPiece(path=path, mark=mark, offset=offset, count=count, sum_only=sum_only, client=self._name)
        )
