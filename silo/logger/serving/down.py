"""What a robot program leaves in the runtime folder while its helper process is down, so that `silo ls` can tell."""

import contextlib
import logging
import os

from silo.core.runtime import down_mark, open_unfinished, unopened
from silo.errors import SegmentError

log = logging.getLogger("silo")


class DownMark:
    """The file of one served logger; it counts as long as this process has it open. By the link thread only."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._file = unopened()

    def set(self) -> None:
        """Say that the helper process is down, since now unless that was said before."""
        if not self._file.closed:
            return
        try:
            open_unfinished(down_mark(self._name, os.getpid()), self._file)
        except (OSError, SegmentError) as error:
            log.debug("%s: it can't be told that the helper process is down: %s", self._name, error)

    def clear(self) -> None:
        """It is there again, or wanted no more."""
        if self._file.closed:
            return
        with contextlib.suppress(OSError, SegmentError):
            down_mark(self._name, os.getpid()).unlink(missing_ok=True)
        self._file.close()
