"""Endless recordings."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import msgspec

from silo.core.arguments import texts
from silo.core.calls import told_class
from silo.core.elements import RecorderState
from silo.core.runtime import followed
from silo.rpc.declaring import Caller, Do, Done, Lane, Reply, ask
from silo.rpc.refusals import RefusedWhy, RequestRefusedError, paths_refused

DEFAULT_FOLDER = "recordings"
MOST_LETTERS = 1000
# what a sample takes of a part beside its value: 16 of the index, and what compression leaves of its stamps (measured)
SAMPLE_BYTES = 18


class RecorderInfo(msgspec.Struct, frozen=True):
    """An endless recording. `samples`, `lost` and `parts` count since it was started, `size_bytes` is on the disk now.

    `written_bytes` counts since it was started too, what was deleted since along with it.

    `split_bytes`, `split_s` and `keep_bytes` are 0 for no limit; `text` says how it ended, if it did, or why its
    logger stands still while it waits.
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


def start_recorder(
    patterns: list[str], folder: str, split: object, keep: object, name: str, client: str = ""
) -> StartRecorder:
    """Return what asks for a recording, `split` and `keep` in words. Raises ElementError where these make no sense."""
    from silo.core.quantities.reading import read_keep, read_split

    split_bytes, split_s = read_split(split)
    return StartRecorder(
        client=client, name=name, folder=folder, patterns=patterns, split_bytes=split_bytes, split_s=split_s,
        keep_bytes=read_keep(keep),
    )  # fmt: skip


@told_class("client")
class RecorderRequests(Caller):
    """Endless recordings."""

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
            keep: `"50GB"`, above which the oldest parts of its name are deleted: from 2 MB; empty: all stay.
            name: of the recording and its files, instead of the logger's.

        Returns:
            Its `name`, its `folder` (absolute, on the robot), and in `text` what will not be recorded without end.

        Raises:
            ElementError: `split`, `keep` or the patterns make no sense; nothing is recorded.
            RefusedError: no element matches a pattern, the folder is outside of the logger's, the name can't be or is
                taken, 8 recordings are under way, or the system or a robot program that has ended prevents it; nothing
                is recorded.
        """
        return self._call(start_recorder(texts("patterns", patterns, "['/log/joints/*']"), to, split, keep, name))

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


@paths_refused("nothing is recorded")
def recording_folder(asked: str, own: Path, *, anywhere: bool) -> Path:
    """Return the folder that is meant by a path relative to the logger's folder, or an absolute one inside it.

    Raises RequestRefusedError for any other. `anywhere`: the robot program asks, which may write where it likes.
    """
    asked = asked or DEFAULT_FOLDER
    if len(asked) > MOST_LETTERS or not asked.isprintable():
        raise RequestRefusedError(
            RefusedWhy.INVALID, f"this is not the path of a folder: {asked[:80]!r}; nothing is recorded"
        )
    path = own / asked
    if anywhere:
        return path
    where = f"recordings go to {own} or folders below it; nothing is recorded"
    if ".." in Path(asked).parts or not path.is_relative_to(own):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: is outside of the logger's folder; {where}")
    found = followed(path)
    if not found.is_relative_to(own.resolve()):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: leads out of the logger's folder by a link; {where}")
    if found.exists() and not found.is_dir():
        raise RequestRefusedError(RefusedWhy.INVALID, f"{asked}: is a file; name a folder; nothing is recorded")
    return found
