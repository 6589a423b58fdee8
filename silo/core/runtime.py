"""The folder that holds a user's segments, sockets and locks, found from the uid alone.

`$XDG_RUNTIME_DIR` is not used: it is unset under a system service, so that a service and an SSH login of the same user
would miss each other, and it is deleted at the last logout while the robot program in tmux runs on.
"""

import contextlib
import errno
import fcntl
import functools
import io
import os
import pwd
import stat
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from silo.errors import SegmentError, reason

SEGMENT_SUFFIX = ".segment"
NEW_SUFFIX = ".new"  # of what is made to take the place of another file
DOWN_SUFFIX = ".down"
HELD_SUFFIX = ".held"  # of a run whose program is done with it, and a consumer is not: `silo.segment.held_runs`
RECORDERS_SUFFIX = ".recorders"  # of the list of what records a logger
JUDGE_SUFFIX = ".judge"  # of what the judge knows of a run
_BYTE_LOCK = struct.Struct("hhqqi4x")  # `struct flock` of the kernel


def shared_memory_root() -> Path:
    """Return `/dev/shm`, or the temporary folder where a system has none."""
    root = Path("/dev/shm")
    if root.is_dir():
        return root
    import tempfile  # 5 ms for what no system of ours needs

    return Path(tempfile.gettempdir())


def user_name(uid: int) -> str:
    """Return the name of a user, or `uid 1234` where the system knows none, as in containers."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid {uid}"


FOLDER_GONE = "the working directory of this process was deleted: change to one that is there, then try again"


def is_folder_gone() -> bool:
    """Whether the working directory of this process has no name any more."""
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def user_folder(variable: str, usual: str) -> Path:
    """Return silo's folder of this user below what a variable says, an absolute path as the standard of XDG has it.

    Else below `usual`, from home on. Raises RuntimeError where this user has no home.
    """
    base = Path(os.environ.get(variable, ""))
    return (base if base.is_absolute() else Path.home() / usual) / "silo"


def state_folder() -> Path:
    """Return where what a user's programs leave behind stands on the disk: `~/.local/state/silo`."""
    return user_folder("XDG_STATE_HOME", ".local/state")


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
            f"{folder}: can't make the folder for segments and sockets ({reason(error)}); "
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


def _runtime_files(suffix: str) -> list[Path]:
    folder = runtime_dir()
    try:
        return sorted(path for path in folder.iterdir() if path.name.endswith(suffix))
    except OSError as error:  # no descriptor is left, for the moment
        raise SegmentError(f"{folder}: can't be read now: {reason(error)}") from error


def list_segments(folder: Path | None = None) -> list[Path]:
    """Return segment files of living and dead writers.

    Those in the runtime folder, those in other folders that a link in it tells of (`storage="file"`), and those in
    `folder`. Links to segments that are gone are removed.
    """
    found = []
    for path in _runtime_files(SEGMENT_SUFFIX):
        place = _place_of(path)
        if place is not None and (place is path or place.exists()):
            found.append(place)
        elif place is not None:
            _forget_announced(path, place)
    if folder is not None:
        found += sorted(folder.absolute().glob(f".*{SEGMENT_SUFFIX}"))
    return list(dict.fromkeys(found))


def list_held() -> list[Path]:
    """Return the files of runs that are held, those in log folders by their links."""
    found = []
    for path in _runtime_files(HELD_SUFFIX):
        place = _place_of(path)
        if place is None:
            continue
        # asked first: it may get the name of one that is held while we look
        waits = place.with_name(place.name.removesuffix(HELD_SUFFIX) + SEGMENT_SUFFIX).exists()
        if place is path or place.exists():
            found.append(place)
        elif not waits:
            path.unlink(missing_ok=True)
    return found


def _place_of(path: Path) -> Path | None:
    """Return where a file is of which the runtime folder tells by itself, or by a link; None if that is gone by now."""
    try:
        return path.readlink()
    except OSError as error:
        return path if error.errno == errno.EINVAL else None


def _forget_announced(link: Path, target: Path) -> None:
    """Remove a link to a segment that is gone, and what a start that died left of it; one that goes on keeps it."""
    sweep_unfinished(target.parent)
    if not target.with_name(f".{target.name}.new").exists() and not target.exists():
        link.unlink(missing_ok=True)
        if target.exists():  # a start came between
            _link(link, target)


def announce_segment(path: Path) -> None:
    """Have a segment in a log folder found by commands that don't know the folder, until the computer starts anew.

    Called before it is made, so that what is left of a start that died is found too, and after.
    """
    _link(runtime_dir() / path.name.lstrip("."), path.absolute())


def _link(link: Path, target: Path) -> None:
    if _place_of(link) == target:
        return  # were it made anew, who looks meanwhile would find none
    link.unlink(missing_ok=True)
    with contextlib.suppress(FileExistsError):  # another process was quicker, with the same
        link.symlink_to(target)


def withdraw_segment(path: Path) -> None:
    """Take back what `announce_segment` did."""
    (runtime_dir() / path.name.lstrip(".")).unlink(missing_ok=True)


def orphaned_segments() -> list[Path]:
    """Return segments in the runtime folder whose process is gone, told by their names and locks alone."""
    pids = {path: path.name.rsplit(".", 3)[1:2] for path in list_segments()}
    dead = [path for path, pid in pids.items() if pid and pid[0].isdecimal() and not process_start(int(pid[0]))]
    return [path for path in dead if not _has_writer(path)]


def _has_writer(path: Path) -> bool:
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK
    with contextlib.suppress(OSError), closing_file(os.open(path, flags)) as descriptor:
        return has_writer(descriptor)
    return False


# ------------------------------------------------------------------------------- files of silo where others may write


def open_own(path: str | os.PathLike[str], flags: int, mode: int = 0o600) -> int:
    """Open a file of silo's own in a folder where others may put things: no link is followed, no pipe waited for.

    Raises OSError, with words for what somebody planted there.
    """
    try:
        descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, mode)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise OSError(errno.ELOOP, "it is a link, which silo doesn't follow: remove it", str(path)) from None
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise OSError(errno.EINVAL, "it is no file: remove it", str(path))


def read_own(path: str | os.PathLike[str]) -> bytes:
    """Return what stands in such a file. Raises OSError."""
    with os.fdopen(open_own(path, os.O_RDONLY), "rb") as file:
        return file.read()


def write_private(path: Path, data: str | bytes) -> None:
    """Put a file there, whole, that nobody but this user may read, whatever stood there before. Raises OSError."""
    with replaced_file(path) as file:
        file.write(data.encode() if isinstance(data, str) else data)


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[BinaryIO]:
    """Make a file that nobody but this user may read, and that takes the place of `path` when the block ends well.

    It need not outlive the computer. What a kill leaves of it in the runtime folder is swept. Raises OSError.
    """
    new = path.with_name(f".{path.name}.{os.getpid()}{NEW_SUFFIX}")
    try:
        with os.fdopen(_open_new(new), "wb") as file:
            os.fchmod(file.fileno(), 0o600)  # whatever the umask says
            yield file
            file.flush()
            new.replace(path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


def _open_new(path: Path) -> int:
    """Open a file that was not there, marked as being written: no sweep takes it."""
    while True:
        path.unlink(missing_ok=True)
        descriptor = open_own(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        lock_as_writer(descriptor)
        if is_at(descriptor, path):
            return descriptor
        os.close(descriptor)  # a sweep came between


# ---------------------------------------------------------------------------------------------- who writes a file

# A lock of the open file, not of the process: it ends with the writer, however that ends, is seen from every container
# that shares the folder, and is another one than the `flock` of who saves a segment.


@contextlib.contextmanager
def closing_file(descriptor: int) -> Iterator[int]:
    """Close an open file when the block ends."""
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def sync(path: Path) -> None:
    """Return when a file's data, or the names in a folder, would survive a power cut. Raises OSError."""
    with closing_file(os.open(path, os.O_RDONLY | os.O_CLOEXEC)) as descriptor:
        os.fsync(descriptor)


def sync_folder(folder: Path) -> None:
    """Make a rename in a folder durable; some network file systems refuse that, and the data is safe without."""
    try:
        sync(folder)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EACCES):
            raise


def lock_as_writer(descriptor: int) -> bool:
    """Mark a file as being written until it is closed; False if another process has marked it.

    A file system that knows no locks can't mark: there, True is said, and everybody takes every file for being written.
    """
    try:
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, _BYTE_LOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, 0, 1, 0))
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return True
    return True


def has_writer(descriptor: int) -> bool:
    """Whether a process has marked the file as being written; True too where that can't be told."""
    try:
        answer = fcntl.fcntl(descriptor, fcntl.F_OFD_GETLK, _BYTE_LOCK.pack(fcntl.F_RDLCK, os.SEEK_SET, 0, 1, 0))
    except OSError:
        return True
    return bool(_BYTE_LOCK.unpack(answer)[0] != fcntl.F_UNLCK)


def is_at(descriptor: int, path: Path) -> bool:
    """Whether an open file still stands under this path: another process may have removed or replaced it."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False


SWEEP_GRACE_S = 5.0


def unopened() -> io.FileIO:
    """Make the owner of a descriptor before there is one: wherever Ctrl-C comes, somebody has it who can close it."""
    return io.FileIO.__new__(io.FileIO)


def open_into(file: io.FileIO, path: str | os.PathLike[str], flags: int) -> io.FileIO:
    """Open `path` for its owner; not a folder. Raises OSError.

    By C code alone: Ctrl-C is taken between instructions of Python, where a bare number would belong to nobody.
    """
    kind = "rb" if flags & os.O_ACCMODE == os.O_RDONLY else "rb+"
    adopt = functools.partial(io.FileIO.__init__, file)
    next(map(adopt, map(os.open, (path,), (flags | os.O_CLOEXEC,), (0o600,)), (kind,)))
    return file


def open_unfinished(path: Path, file: io.FileIO) -> io.FileIO:
    """Open an empty file of our own, marked as being written: no sweep takes it. Raises OSError."""
    until_s = time.monotonic() + SWEEP_GRACE_S
    while True:
        open_into(file, path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW)
        # a sweep may have come between the two calls
        if lock_as_writer(file.fileno()) and is_at(file.fileno(), path):
            file.truncate()
            return file
        file.close()
        if time.monotonic() > until_s:
            raise FileExistsError(errno.EEXIST, "another process is making one of the same name", str(path))
        time.sleep(0.001)  # a sweep holds the mark for a moment; on a busy machine it may be put aside meanwhile


def sweep_unfinished(folder: Path) -> list[Path]:
    """Remove what was never finished because its process died while it made it, and marks of dead ones.

    It holds no tick: segments, stubs of runs that are held, states of judges, lists of recorders. What is
    being made is marked by its writer, see `open_unfinished`, and stays.
    """
    made = (SEGMENT_SUFFIX, HELD_SUFFIX, JUDGE_SUFFIX, RECORDERS_SUFFIX)
    patterns = [*(f".*{one}*{NEW_SUFFIX}" for one in made), f"*{DOWN_SUFFIX}"]
    unfinished = [path for pattern in patterns for path in folder.glob(pattern)]
    return [path for path in unfinished if _removed_if_dead(path)]


def down_mark(name: str, pid: int) -> Path:
    """Return the file by which a robot program says that its helper process is down, as long as it writes it."""
    return runtime_dir() / f"{name}.{pid}{DOWN_SUFFIX}"


def down_marks() -> list[Path]:
    """Return the marks of programs that live, in this user's folder."""
    return [path for path in sorted(runtime_dir().glob(f"*{DOWN_SUFFIX}")) if _has_writer(path)]


def _removed_if_dead(path: Path) -> bool:
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    # what can't be opened or removed isn't ours, or another one removes it just now
    with contextlib.suppress(OSError), closing_file(os.open(path, flags)) as descriptor:
        regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
        # asked first: where locks are unknown the answer is that somebody writes
        if regular and not has_writer(descriptor) and lock_as_writer(descriptor) and is_at(descriptor, path):
            path.unlink()
            return True
    return False


def followed(path: Path) -> Path:
    """Return a path without links. Raises OSError where they lead in a circle, RuntimeError before Python 3.13.

    `Path.resolve` of 3.13 raises nothing for a circle.
    """
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return path.resolve()


def nearest(folder: Path) -> Path:
    """Return a folder, or the nearest one above it that is there."""
    return next(place for place in (folder, *folder.parents) if place.exists())


def disk_room(place: Path | int) -> tuple[int, int]:
    """Return how many bytes this user may still write where a path or an open file is, and the size of that disk.

    Of a path that isn't there yet those of where it would be made. Raises OSError.
    """
    found = os.statvfs(nearest(place) if isinstance(place, Path) else place)
    return found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize


# the limit, what is used, and how sums over all groups below begin in `memory.stat`
_V1_FILES = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"
_V2_FILES = "memory.max", "memory.current", ""
_V1_NO_LIMIT = 1 << 62  # more than that is none
_GIVEN_BACK = ("active_file", "inactive_file", "slab_reclaimable")  # where memory is scarce, as in `MemAvailable`


def available_memory_bytes() -> int:
    """Return what the kernel says could be taken without swapping, of the machine and of this process's control groups.

    Very much where it doesn't say.
    """
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        lines = []
    sizes = [int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")]
    return min([*sizes, *_left_to_groups()], default=sys.maxsize)


def _left_to_groups(process: Path = Path("/proc/self"), mounted: Path = Path("/sys/fs/cgroup")) -> list[int]:
    """Return what each control group of the process that has a limit leaves, with what would be given back.

    Of both versions: `Documentation/admin-guide/cgroup-v2.rst` and `cgroup-v1/memory.rst` of the kernel.
    """
    left = []
    with contextlib.suppress(OSError):
        for line in (process / "cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers and "memory" not in controllers.split(","):
                continue
            root = mounted / "memory" if controllers else mounted
            limit, used, total = _V1_FILES if controllers else _V2_FILES
            group = root / path.lstrip("/")
            for folder in (group, *group.parents):
                if not folder.is_relative_to(root):
                    break
                with contextlib.suppress(OSError, ValueError):  # there is no limit (`max`), or no such group in sight
                    if (most := int((folder / limit).read_text())) > _V1_NO_LIMIT:
                        continue  # before its statistics are read, which take a fifth of a start
                    rows = map(str.split, (folder / "memory.stat").read_text().splitlines())
                    names = [total + name for name in _GIVEN_BACK]
                    given_back = sum(int(size) for name, size in rows if name in names)
                    left.append(min(most, max(0, most - int((folder / used).read_text()) + given_back)))
    return left


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
        state, _, start = process_facts(pid)
    except OSError:
        return 0
    return 0 if state in "ZX" else start


def process_facts(pid: int) -> tuple[str, int, int]:
    """Return the state of a process as a letter (proc(5)), the pid of its parent, and when it began. Raises OSError."""
    text = Path(f"/proc/{pid}/stat").read_bytes()  # the name of a program may hold any byte
    fields = text.rpartition(b")")[2].split()
    return ("X", 0, 0) if len(fields) < 20 else (fields[0].decode(), int(fields[1]), int(fields[19]))


def pid_namespace() -> int:
    """Tells the containers of this host apart, each of which counts its processes by itself; 0 where unknown."""
    try:
        return Path("/proc/self/ns/pid").stat().st_ino
    except OSError:
        return 0
