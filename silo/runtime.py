"""The folder that holds a user's segments, sockets and locks, found from the uid alone.

`$XDG_RUNTIME_DIR` is not used: it is unset under a system service, so that a service and an SSH login of the same user
would miss each other, and it is deleted at the last logout while the robot program in tmux runs on.
"""

import os
import pwd
import stat
import sys
import tempfile
from pathlib import Path

from silo.errors import SegmentError

SEGMENT_SUFFIX = ".segment"


def shared_memory_root() -> Path:
    """Return `/dev/shm`, or the temporary folder where a system has none."""
    root = Path("/dev/shm")
    return root if root.is_dir() else Path(tempfile.gettempdir())


def user_name(uid: int) -> str:
    """Return the name of a user, or `uid 1234` where the system knows none, as in containers."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid {uid}"


def runtime_dir() -> Path:
    """Return this user's private folder, made where missing.

    `SILO_RUNTIME_DIR` overrides the place. Raises SegmentError if somebody else owns the folder or may look into it.
    """
    override = os.environ.get("SILO_RUNTIME_DIR")
    folder = Path(override) if override else shared_memory_root() / f"silo-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, parents=bool(override), exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise SegmentError(
            f"{folder}: can't make the folder for segments and sockets ({error.strerror}); "
            "set SILO_RUNTIME_DIR to a folder that this user owns"
        ) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise SegmentError(
            f"{folder}: is not a folder of this user (uid {os.getuid()}); remove it or set SILO_RUNTIME_DIR"
        )
    if found.st_mode & 0o077:
        raise SegmentError(
            f"{folder}: mode is {found.st_mode & 0o777:o}, others could look in; run: chmod 700 {folder}"
        )
    return folder


def list_segments(folder: Path | None = None) -> list[Path]:
    """Return segment files of living and dead writers.

    Those in the runtime folder, and in `folder` (`storage="file"`).
    """
    found = sorted(runtime_dir().glob(f"*{SEGMENT_SUFFIX}"))
    if folder is not None:
        found += sorted(folder.glob(f".*{SEGMENT_SUFFIX}"))
    return found


def orphaned_segments() -> list[Path]:
    """Return segments in the runtime folder whose process is gone, told by their names alone."""
    pids = {path: path.name.rsplit(".", 3)[1:2] for path in list_segments()}
    return [path for path, pid in pids.items() if pid and pid[0].isdecimal() and not process_start(int(pid[0]))]


def available_memory_bytes() -> int:
    """Return what the kernel says could be taken without swapping; very much where it doesn't say."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        lines = []
    sizes = [int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")]
    return sizes[0] if sizes else sys.maxsize


def boot_id() -> str:
    """Return what changes with every boot: a segment of another boot can't have a living writer."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


def process_start(pid: int) -> int:
    """Return clock ticks since boot at which a process began, 0 if it isn't there.

    Tells a reused pid from the writer.
    """
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return 0
    fields = text.rsplit(")", 1)[1].split()
    return 0 if fields[0] in "ZX" else int(fields[19])
