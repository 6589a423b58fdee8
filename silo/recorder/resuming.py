"""Going on after a recorder that was killed: at once, with the rows after those that its part holds.

That is told at a glance. Its part is closed beside, when this one has caught up: one of a gigabyte takes many seconds,
in which a short ring would be overwritten.
"""

import mmap
import struct
import threading
import time
from pathlib import Path

import msgspec
import zstandard
from mcap.exceptions import McapError

from silo.errors import FileFormatError
from silo.files.manifest import ClosedPart, Ledger, number_of
from silo.files.part_facts import EVENTS_RING, PartFacts
from silo.files.part_scan import rows_after
from silo.recorder.closing import claimed, close_parts

OTHERS_S = 10.0  # how long another process may take to close what a predecessor left

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


def left_rows(ledger: Ledger) -> tuple[str, dict[int, int]]:
    """Return with which rows of which run to go on, told at a glance."""
    until_s = time.monotonic() + OTHERS_S
    for path in sorted(ledger.open_parts(), key=number_of, reverse=True):
        while (found := _glance(path)) is None and time.monotonic() < until_s:
            time.sleep(0.02)  # another process closes it just now
        if found and found[0].recorder == ledger.name:
            return found[0].run, found[1]
    written = ledger.written
    if written.runs and written.entry(written.run) is None:  # its order is over
        return "", {}
    return written.run, dict(written.next_rows)


def _glance(path: Path) -> "tuple[PartFacts, dict[int, int]] | tuple[()] | None":
    """What a part says of itself, and its rows; nothing of one that can't be read, None of one that is in use."""
    final = path.with_name(path.name.removesuffix(".part"))
    try:
        # claimed, as who closes it cuts it: to read beyond its end would end this process
        with claimed(path if path.exists() else final) as file:
            # the map ends with its last view
            return rows_after(memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))) or ()
    except BlockingIOError:
        return None
    except FileNotFoundError:
        return None if final.exists() else ()  # it got its name just now
    except (OSError, *_DAMAGE):
        return ()


def fewer_rows(closed: list[ClosedPart], recorder: str, run: str, rows: dict[int, int]) -> int:
    """Return how many rows the newest part of a recorder lacks of those after which another one went on: damage."""
    ours = [part for part in closed if part.recorder == recorder and part.run == run and part.size_bytes]
    if not ours:
        return 0
    newest = max(ours, key=lambda part: number_of(part.path))
    return sum(max(0, row - newest.next_rows.get(ring, row)) for ring, row in rows.items() if ring != EVENTS_RING)
