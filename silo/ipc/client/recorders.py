"""Endless recordings."""

from collections.abc import Sequence

from silo.arguments import texts
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import ListRecorders, RecorderInfo, RecorderStarted, StartRecorder, StopRecorder


@told_class("client")
class RecorderCalls(Calls):
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
        from silo.amounts import read_keep, read_split

        split_bytes, split_s = read_split(split)
        request = StartRecorder(
            name=name,
            folder=to,
            patterns=texts("patterns", patterns, "['/log/joints/*']"),
            split_bytes=split_bytes,
            split_s=split_s,
            keep_bytes=read_keep(keep),
            client=self._name,
        )
        return self._call(request)

    def stop_recorder(self, name: str = "") -> str:
        """Finish an endless recording; waits up to 5 s for the end of its last part.

        Args:
            name: of the recording; empty: the only one.

        Returns:
            What was done, in words, with its numbers of files and samples.

        Raises:
            RefusedError: there is none, or none of that name, or several without a name; nothing was stopped.
        """
        return self._call(StopRecorder(name=name, client=self._name)).text

    def recorders(self) -> list[RecorderInfo]:
        """Return the endless recordings of this logger; those that ended by themselves stay until they are stopped.

        Returns:
            For each its parts, samples and losses since it was started, the bytes on the disk, and how it ended.
        """
        return self._call(ListRecorders(client=self._name)).recorders
