"""Which folders hold sockets of loggers: this user's private one, those of groups, and those that are closed to us.

    /dev/shm/silo-<uid>/         private, 0700
    /dev/shm/silo-<uid>-<gid>/   made by `serve(group=...)`: 0750, of that group

With `SILO_RUNTIME_DIR` set, only that folder and `<it>-<gid>` beside it count. Every folder is checked for owner and
mode before it is used: the parent is open to everybody, and a folder that anybody may write to can hold anything.
"""

import grp
import os
import re
import stat
from pathlib import Path

import msgspec

from silo.core.runtime import runtime_dir, shared_memory_root, user_name
from silo.errors import SegmentError, reason

_FOLDER = re.compile(r"silo-([0-9]+)(?:-([0-9]+))?")
_SOCKET_LINE = re.compile(r"(/\S*/silo-[0-9]+(?:-[0-9]+)?)/(\S+)\.[0-9]+(?:-[0-9]+)?\.sock$")


class ForbiddenFolder(msgspec.Struct, frozen=True):
    """A folder whose loggers this user may not talk to; `loggers` are those that are known to listen there."""

    owner: str
    uid: int
    path: str
    loggers: tuple[str, ...]
    advice: str


def group_folder(group: str) -> Path:
    """Return the folder that this process shares with the members of a group; made, and given to the group, where
    missing.

    Raises SegmentError with the reason: no such group, not a member of it, or somebody else's folder.
    """
    gid = _group_id(group)
    path = _group_path(os.getuid(), gid)
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        found = path.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
            raise SegmentError(f"{path}: is not a folder of this user (uid {os.getuid()}); remove it")
        os.chown(path, -1, gid)
        path.chmod(0o750)
    except OSError as error:
        raise SegmentError(
            f"{path}: can't share the folder with group '{group}' ({reason(error)}); "
            "this user must be a member of the group (log in again after `usermod -aG`)"
        ) from error
    return path


def _group_id(group: str) -> int:
    if group.isascii() and group.isdigit():
        return int(group)
    try:
        return grp.getgrnam(group).gr_gid
    except KeyError:
        raise SegmentError(f"no group '{group}' on this system; make it with `groupadd {group}`") from None


def _group_path(uid: int, gid: int) -> Path:
    override = os.environ.get("SILO_RUNTIME_DIR")
    return Path(f"{override.rstrip('/')}-{gid}") if override else shared_memory_root() / f"silo-{uid}-{gid}"


def share_socket(socket: Path, folder: Path) -> None:
    """Let the group of `folder` use a socket in it, and see from its lock whether the owner lives."""
    gid = folder.stat().st_gid
    for end, mode in (("", 0o770), (".lock", 0o640), (".secret", 0o640), (".group", 0o640), (".key", 0o640)):
        path = Path(f"{socket}{end}")
        if path.exists():
            os.chown(path, -1, gid)
            path.chmod(mode)


def usable_folders() -> list[Path]:
    """Return folders in which this user may look for loggers, the private one first."""
    return [runtime_dir(), *(path for path in _candidates() if _is_usable(path))]


def own_folders() -> list[Path]:
    """Folders for sockets that belong to this user, the private one first."""
    shared = [path for path in _candidates() if _is_usable(path) and path.lstat().st_uid == os.getuid()]
    return [runtime_dir(), *shared]


def forbidden_folders() -> list[ForbiddenFolder]:
    """Return folders of other users in which a logger listens, or seems to, and that this user may not enter."""
    if os.environ.get("SILO_RUNTIME_DIR"):
        return []
    closed = [path for path in _candidates() if not _is_usable(path)]
    listening = _listening() if closed else {}
    return [_forbidden(path, listening[str(path)]) for path in closed if str(path) in listening]


def _candidates() -> list[Path]:
    """Return all folders but the private one that are named like ours."""
    override = os.environ.get("SILO_RUNTIME_DIR")
    if override:
        own = Path(override)
        return [path for path in sorted(own.parent.glob(f"{own.name}-*")) if path.name[len(own.name) + 1 :].isdigit()]
    root = shared_memory_root()
    own = root / f"silo-{os.getuid()}"
    return [path for path in sorted(root.glob("silo-*")) if path != own and _FOLDER.fullmatch(path.name)]


def _is_usable(path: Path) -> bool:
    """Return whether a folder is what its name says, closed to strangers, and open to us."""
    try:
        found = path.lstat()
    except OSError:
        return False
    if not stat.S_ISDIR(found.st_mode) or found.st_mode & 0o027:
        return False
    named = None if os.environ.get("SILO_RUNTIME_DIR") else _FOLDER.fullmatch(path.name)
    uid, gid = (int(named[1]), named[2]) if named is not None else (found.st_uid, path.name.rpartition("-")[2])
    is_shared = gid is None or (found.st_gid == int(gid) and found.st_mode & 0o050 == 0o050)
    if found.st_uid != uid or not is_shared:  # `run-2` beside `run` may be another private folder of this user
        return False
    return os.access(path, os.R_OK | os.X_OK)


def _listening() -> dict[str, list[str]]:
    """Return names of loggers that listen, by folder, as the kernel lists them.

    Readable without entering the folder.
    """
    try:
        lines = Path("/proc/net/unix").read_text(errors="replace").splitlines()
    except OSError:
        return {}
    found: dict[str, list[str]] = {}
    for line in lines:
        match = _SOCKET_LINE.search(line)
        if match:
            names = found.setdefault(match[1], [])
            if match[2] not in names:
                names.append(match[2])
    return found


def _forbidden(path: Path, loggers: list[str]) -> ForbiddenFolder:
    uid = path.lstat().st_uid
    owner = user_name(uid)
    named = _FOLDER.fullmatch(path.name)
    if named and named[2]:
        try:
            group = grp.getgrgid(int(named[2])).gr_name
        except KeyError:
            group = named[2]
        advice = f"join the group: sudo usermod -aG {group} {user_name(os.getuid())}, then log in again"
    else:
        advice = (
            f"run this command as that user (sudo -u {owner} ...), or let the robot program share its loggers with a "
            'group that you are in: log.serve(group="...")'
        )
    return ForbiddenFolder(owner, uid, str(path), tuple(loggers), advice)
