"""The calls that a journal makes of the system, in one place: tests put another there that loses power."""

import os
from pathlib import Path

from silo.core.runtime import sync


class Disk:
    """Files and folders as the system has them. Every method raises OSError where it refuses."""

    def make_folder(self, path: Path) -> None:
        """Make a folder of one's own."""
        path.mkdir(mode=0o700)

    def create(self, path: Path) -> int:
        """Make a file that isn't there yet; return its descriptor."""
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        """Write all of the data."""
        while data:
            written = os.pwrite(descriptor, data, offset)
            data, offset = data[written:], offset + written

    def truncate(self, descriptor: int, size_bytes: int) -> None:
        """Cut a file."""
        os.ftruncate(descriptor, size_bytes)

    def sync(self, descriptor: int) -> None:
        """Return when a file's data, and its length, would survive a power cut."""
        os.fdatasync(descriptor)

    def sync_folder(self, path: Path) -> None:
        """Return when the names in a folder would survive a power cut."""
        sync(path)

    def remove(self, path: Path) -> None:
        """Delete a file."""
        path.unlink()

    def close(self, descriptor: int) -> None:
        """Let go of a file."""
        os.close(descriptor)
