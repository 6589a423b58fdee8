"""Writing a file or a folder so that it stands under its final name whole or not at all.

Every writer of `silo.files` goes through here. The work happens under a hidden temporary name in the same folder,
which is flushed to the disk and then renamed; on any failure, Ctrl-C included, it is removed.
"""

import ctypes
import errno
import fcntl
import io
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from silo.core.child import end_abandoned_holder
from silo.core.quantities.writing import size_text
from silo.core.runtime import closing_file, disk_room, is_at, sync, sync_folder
from silo.errors import SaveError, reason

PART_ENDING = ".part"
SWAP_ENDING = ".swap"  # a folder in which a new one is made that takes the name of an old one
ROOM_SHARE = 0.02  # of a disk is left free by what is written without end, or for clients, or
ROOM_BYTES = 1_000_000_000  # that many, whichever is less
ASKED_SHARE = 0.1  # of what is free may be taken by one write that somebody asked for, also where that is less
_OLD_ENDING = ".old"  # what silo up to 0.1 called an old bag while the new one was written
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator["WholeFile"]:
    """An open, unbuffered binary file that becomes `path` when the block ends without an exception.

    A file that already stood under `path` is replaced. Raises `SaveError` for every `OSError` of the block (full
    disk, no permission, missing folder); then nothing new stands under `path`.
    """
    final = Path(path)
    part = _temporary_name(final)
    with _becoming(part, final), open_part(part) as file:
        yield file
        os.fsync(file.fileno())
        part.replace(final)  # while it is locked still


@contextmanager
def atomic_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """An empty folder to fill, which becomes `path` when the block ends without an exception.

    Unlike a file, an existing `path` is never replaced: that is a `SaveError`, as is every `OSError` of the block.
    """
    final = Path(path)
    if final.exists():
        raise SaveError(f"can't save '{final}': it exists already; remove it or choose another name")
    part = _temporary_name(final)
    with _becoming(part, final), _made_part(part):
        yield part
        for file in sorted(part.rglob("*")):
            sync(file)
        sync(part)
        part.rename(final)


@contextmanager
def _becoming(part: Path, final: Path) -> Iterator[None]:
    """Sync the name that the block gave; where it fails remove `part`, and raise its OSError as SaveError."""
    try:
        yield
    except BaseException as error:
        _remove(part)
        if isinstance(error, OSError) and not isinstance(error, SaveError):
            raise _refused(final, error) from error
        raise
    _sync_name(final)


@contextmanager
def claimed(folder: str | os.PathLike[str], what: str, within_s: float) -> Iterator[int]:
    """Have something in a folder to oneself: another process that claims the same words waits; the descriptor of that.

    Who inherits the descriptor keeps the claim up, also when this process is killed. Nothing stays in the folder, and
    what one that was killed leaves is swept as `sweep_parts` does. In a file system without locks everybody has it at
    once. Raises `SaveError` where another one still has it after `within_s`, OSError.
    """
    import hashlib  # loads OpenSSL: whoever only reads what a file is called needs none

    path = Path(folder) / f".silo-claim-{hashlib.sha256(what.encode()).hexdigest()[:24]}{PART_ENDING}"
    deadline_s = time.monotonic() + within_s
    while (descriptor := _claim(path)) is None:
        if time.monotonic() > deadline_s:
            raise SaveError(f"another process has been writing {what} for {within_s:g} s: is it stopped?")
        time.sleep(0.02)  # to wait for the lock itself would never end where its holder is stopped
    try:
        yield descriptor
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)  # first, so that whoever locks it next sees that it isn't there any more
        os.close(descriptor)


def _claim(path: Path) -> int | None:
    """The locked file, None where another one has it. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    if not taken(descriptor):
        end_abandoned_holder(descriptor)
    elif is_at(descriptor, path):
        return descriptor
    os.close(descriptor)
    return None


@contextmanager
def replaced_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path at which a folder is to be made, which takes the place of the folder `path` when the block ends well.

    There is no moment at which neither stands under the name, where the file system can exchange two names. Where it
    can't, the old one lies in a folder beside it for that moment; what a kill leaves, `put_back` puts right. Raises
    `SaveError`; then the old one stands there.
    """
    final = Path(path)
    swap = _temporary_name(final, SWAP_ENDING)
    new, old = swap / "new" / final.name, swap / "old" / final.name
    try:
        with _made_part(swap):
            new.parent.mkdir()
            yield new
            if not _exchanged(new, final):
                old.parent.mkdir()
                final.rename(old)
                try:
                    new.rename(final)
                except BaseException:
                    old.rename(final)
                    raise
            sync_folder(final.parent)
    except SaveError as error:
        raise SaveError(str(error).replace(os.fspath(new), os.fspath(final))) from error
    except OSError as error:
        raise _refused(final, error, "the old one stands there") from error
    finally:
        if os.path.lexists(final):
            _remove(swap)


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two names in one step; False where the system or the file system can't. Raises OSError."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False  # a C library without it
    names = (os.fsencode(one), os.fsencode(other))
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EPERM, errno.EXDEV):
        return False
    raise OSError(number, os.strerror(number), str(other))


def put_back(folder: str | os.PathLike[str]) -> list[Path]:
    """Give folders in `folder` their names back that a kill kept from being replaced; returns them."""
    done = []
    for swap in _left(folder, (SWAP_ENDING, _OLD_ENDING)):
        with _dead(swap) as dead:
            if not dead:
                continue
            for held, final in _held(swap):
                with suppress(OSError):
                    if not os.path.lexists(final):
                        held.rename(final)
                        done.append(final)
    return done


def set_aside(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the folders that `put_back` would give their names back, by these names."""
    every = [final for swap in _left(folder, (SWAP_ENDING, _OLD_ENDING)) for _, final in _held(swap)]
    return [final for final in every if not os.path.lexists(final)]


def _held(swap: Path) -> list[tuple[Path, Path]]:
    """The old folder that is to get its name back, and the path by that name."""
    if swap.suffix == _OLD_ENDING:
        return [] if _is_being_replaced(swap) else [(swap, swap.parent / _bag_name(swap))]
    with suppress(OSError):
        return [(held, swap.parent / held.name) for held in (swap / "old").iterdir()]
    return []


def _is_being_replaced(old: Path) -> bool:
    """Whether a silo of 0.1, which locked nothing, is at it."""
    number = old.name.split("-")[1]
    return number.isdecimal() and Path("/proc", number).exists()


def _bag_name(old: Path) -> str:
    """The name that a bag had: its file is called so."""
    names = sorted(path.name for path in old.glob("*_0.mcap"))
    return names[0].removesuffix("_0.mcap") if names else f"{old.name[1:]}.rosbag2"


def _left(folder: str | os.PathLike[str], endings: tuple[str, ...]) -> list[Path]:
    names: list[str] = []
    with suppress(OSError):
        names = os.listdir(folder)  # noqa: PTH208  # of 10,000 logs no paths are made
    return [Path(folder, name) for name in sorted(names) if name.startswith(".silo-") and name.endswith(endings)]


@contextmanager
def _dead(part: Path) -> Iterator[bool]:
    """Whether the writer of something died: it is locked by him, and by us within the block."""
    descriptor = -1
    dead = False
    # what can't be opened isn't ours, or another one removes it just now
    with suppress(OSError):
        descriptor = os.open(part, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        dead = is_at(descriptor, part)
    try:
        yield dead
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def sweep_parts(folder: str | os.PathLike[str]) -> list[Path]:
    """Remove temporary files and folders in `folder` whose writers died; returns them.

    One that is being written is locked by its writer and stays, whatever process or container that is in; so does
    everything in a file system that knows no locks. What was to be replaced and has lost its name gets it back first.
    """
    put_back(folder)
    return [part for part in _left(folder, (PART_ENDING, SWAP_ENDING)) if _removed_if_dead(part)]


def _removed_if_dead(part: Path) -> bool:
    with _dead(part) as dead:
        if not dead or (part.suffix == SWAP_ENDING and _nameless(part)):
            return False
        _remove(part)
        return not part.exists()


def _nameless(swap: Path) -> bool:
    """Whether it holds the only copy of what has no name."""
    return any(not os.path.lexists(final) for _, final in _held(swap))


class WholeFile(io.FileIO):
    """An unbuffered file whose `write` takes everything or raises: the plain one may take a part of it."""

    def write(self, data: Any, /) -> int:
        """Write all of `data`; raises `OSError`, for a full disk too."""
        view = memoryview(data).cast("B")
        append_all(self.fileno(), view)
        return len(view)


def open_part(part: Path) -> WholeFile:
    """Open a new file, locked until it is closed. Raises OSError."""
    while True:
        file = WholeFile(part, "xb")
        try:
            if _locked(file.fileno(), part):
                return file
        except BaseException:
            file.close()
            raise
        file.close()


@contextmanager
def _made_part(part: Path) -> Iterator[None]:
    """A new folder, locked while it is filled. Raises OSError."""
    while True:
        part.mkdir()
        try:
            descriptor = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue
        with closing_file(descriptor):
            if _locked(descriptor, part):
                yield
                return


def lock(descriptor: int) -> bool:
    """Wait for the lock of an open file; False in a file system that knows no locks. Closing it lets go."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError:
        return False
    return True


def taken(descriptor: int) -> bool:
    """Take the lock of an open file, unless another one has it; True in a file system that knows no locks, too."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError)
    return True


def append_all(descriptor: int, data: bytes | memoryview) -> None:
    """Write bytes where an open file stands, in as many turns as the system takes. Raises OSError."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def _locked(descriptor: int, part: Path) -> bool:
    """Lock what was just made; False if who clears up behind dead writers came before that: make it again."""
    if not lock(descriptor):  # a sweep holds it for the moment in which it removes it
        return True  # then nothing is swept there either
    return is_at(descriptor, part)


def write_all(file_descriptor: int, buffers: list[memoryview], offset: int) -> None:
    """Write the buffers (of bytes, contiguous) one after the other at `offset`, whatever the kernel takes per call."""
    pending = [buffer for buffer in buffers if buffer.nbytes]
    while pending:
        # the kernel takes at most 1024 buffers and 2 GiB per call
        written = os.pwritev(file_descriptor, pending[:1024], offset)
        offset += written
        while pending and written >= pending[0].nbytes:
            written -= pending.pop(0).nbytes
        if written:
            pending[0] = pending[0][written:]


def check_folder(final: Path) -> None:
    """Raise `SaveError` where a file can't get its name as its folder isn't there: before there is work to lose."""
    if not final.parent.exists():
        raise _refused(final, FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT)))


def _refused(final: Path, error: OSError, left: str = "nothing was left under that name") -> SaveError:
    """What failed, why, and the way out."""
    advice = "choose another folder"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        advice = f"{_free(final.parent)}make room or choose another folder"
    elif error.errno == errno.EFBIG:
        advice = "raise the limit of this process for files (`ulimit -f`) or choose another folder"
    elif error.errno == errno.ENAMETOOLONG:
        advice = "choose a shorter name"
    elif error.errno == errno.ENOENT and not final.parent.exists():
        advice = f"there is no folder '{final.parent}': make it, or choose another one"
    return SaveError(f"can't save '{final}': {reason(error)}; {advice}; {left}")


def _free(folder: Path) -> str:
    with suppress(OSError):
        found = os.statvfs(folder)
        if found.f_files and not found.f_favail:  # there is room, and no inode
            return f"the disk of '{folder}' can hold no more files, whatever their size: "
        return f"{size_text(disk_room(folder)[0])} are free in '{folder}': "
    return ""


class NearlyFullError(SaveError):
    """The disk is as full as clients may have it written, or what is written without end."""


def check_room(
    folder: Path,
    coming_bytes: int,
    room: Callable[[Path], tuple[int, int]] = disk_room,
    advice: str = "make room",
    *,
    most_left: int | None = None,
) -> None:
    """Raise NearlyFullError where so much more would leave others of the disk no room, OSError.

    `most_left` is what they are left at most, see `asked_left`.
    """
    free, size = room(folder)
    left = left_free(size) if most_left is None else min(left_free(size), most_left)
    if size and free - coming_bytes < left:  # what is no disk tells of none, and refuses in its own words
        much = f": {size_text(coming_bytes)} more are too much" if free >= left else ""
        raise NearlyFullError(
            f"the disk of {folder} is nearly full: {size_text(free)} are free, and {size_text(left)} of it are left to "
            f"others{much}; {advice}"
        )


def asked_left(folder: Path) -> int:
    """Return what one write that somebody asked for leaves to others at most: of a full disk it may take its share.

    So what is small is saved, also at the end of a long day. Raises OSError.
    """
    return int((1 - ASKED_SHARE) * disk_room(folder)[0])


def left_free(size_bytes: int) -> int:
    """Return how many bytes of a disk of this size are left to others."""
    return int(min(ROOM_SHARE * size_bytes, ROOM_BYTES))


def _temporary_name(final: Path, ending: str = PART_ENDING) -> Path:
    # short and random: a final name of 255 bytes leaves no room for an ending
    return final.parent / f".silo-{os.getpid()}-{os.urandom(4).hex()}{ending}"


def _remove(part: Path) -> None:
    # what is reported is why the save failed, not that its rest could not be removed as well
    with suppress(OSError):
        if part.is_dir():
            shutil.rmtree(part)
        else:
            part.unlink(missing_ok=True)


def _sync_name(final: Path) -> None:
    """Make a rename durable that is done. Raises SaveError, which says that the new file stands there."""
    try:
        sync_folder(final.parent)
    except OSError as error:
        left = "the new one stands under that name, but may be gone after a power cut"
        raise _refused(final, error, left) from error
