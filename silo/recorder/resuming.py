"""Going on after a recorder that was killed: its part is closed beside, while the rings are read from where it stood.

A part of a gigabyte takes seconds to close, in which a short ring would be overwritten.
"""

import contextlib
import mmap
import struct
import threading
from pathlib import Path

import msgspec
import zstandard
from mcap.exceptions import McapError

from silo.errors import FileFormatError
from silo.files.part_scan import rows_after
from silo.recorder.closing import ClosedPart, close_parts, left_parts
from silo.recorder.ledger import Written

_DAMAGE = (
    struct.error, ValueError, IndexError, OverflowError, MemoryError, FileFormatError, zstandard.ZstdError,
    msgspec.MsgspecError, McapError,
)  # fmt: skip


class Closing:
    """A thread that closes what killed recorders left in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._found: tuple[list[ClosedPart], list[str]] = ([], [])
        self._error: BaseException | None = None
        self._over = threading.Event()
        threading.Thread(target=self._run, name="closing", daemon=True).start()

    def _run(self) -> None:
        try:
            self._found = close_parts(self._folder)
        except BaseException as error:  # noqa: BLE001  # it is raised where it is waited for
            self._error = error
        self._over.set()

    @property
    def is_over(self) -> bool:
        """Whether all is closed."""
        return self._over.is_set()

    def result(self) -> tuple[list[ClosedPart], list[str]]:
        """Wait for it; returns what was closed, and in words what could not be."""
        self._over.wait()
        if self._error is not None:
            raise self._error
        return self._found


def left_rows(folder: Path, name: str, written: Written) -> tuple[str, dict[int, int]]:
    """Return with which rows of which run to go on, told at a glance; what closing finds is what counts.

    Before anybody closes, who cuts the file: to read beyond its end would end this process.
    """
    for path in reversed(left_parts(folder)):
        with contextlib.suppress(OSError, *_DAMAGE):
            with path.open("rb") as file:
                # the map ends with its last view
                found = rows_after(memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)))
            if found is not None and found[0].recorder == name:
                return found[0].run, found[1]
    return written.run, dict(written.next_rows)
