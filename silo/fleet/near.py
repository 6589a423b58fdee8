"""The loggers of this computer: what a scan of the folders says, about a millisecond, and nobody is asked."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
from msgspec.structs import replace

from silo.core.runtime import DOWN_SUFFIX, down_marks, process_start, user_name
from silo.net import keys
from silo.net.folders import ForbiddenFolder, forbidden_folders, usable_folders
from silo.net.found import LoggerAddress
from silo.net.session import SOCKET_SUFFIX, Beside, owner_is_gone

_SOCKET = re.compile(r"(?P<name>.+)\.(?P<pid>[0-9]+)(?:-(?P<copy>[0-9]+))?\.sock")
_DOWN = re.compile(rf"(?P<name>.+)\.(?P<pid>[0-9]+){re.escape(DOWN_SUFFIX)}")
HERE = ""  # in place of a remote: the loggers of this computer can't be looked for


class Near(msgspec.Struct, frozen=True):
    """The loggers of this computer, the folders that are closed to us, and those that nobody can reach now.

    Of the `left` the helper process has just died, and the program, which lives, has not said yet that it is `down`.
    """

    loggers: tuple[LoggerAddress, ...] = ()
    forbidden: tuple[ForbiddenFolder, ...] = ()
    down: tuple[LoggerAddress, ...] = ()
    left: tuple[LoggerAddress, ...] = ()


def near_loggers() -> Near:
    """Return what is seen of this computer by a scan of its folders.

    A logger whose robot program died is left out once the program was started again.
    """
    all_found = [found for folder in usable_folders() for found in _scan(folder)]
    loggers = [found for found in all_found if not (found.dead and _has_successor(found, all_found))]
    reached = {(found.name, found.pid) for found in loggers}
    down = (found for found in _down() if (found.name, found.pid) not in reached)
    left = [found for folder in usable_folders() for found in _left(folder)]
    return Near(tuple(loggers), tuple(forbidden_folders()), tuple(down), tuple(left))


def _down() -> list[LoggerAddress]:
    """Loggers of this user whose helper process died, and whose program can't start another."""
    loggers = []
    for path in down_marks():
        match = _DOWN.fullmatch(path.name)
        try:
            found = path.lstat()
        except FileNotFoundError:
            continue  # it is there again
        if match is not None:
            owner = user_name(found.st_uid)
            loggers.append(LoggerAddress(match["name"], int(match["pid"]), "", owner, since=found.st_mtime))
    return loggers


def unreachable_text(name: str, why: str) -> str:
    """Return why there is no way to a remote; `HERE` is no remote."""
    return f"remote '{name}': {why}" if name != HERE else why


def down_text(found: LoggerAddress) -> str:
    """Return what it means that a logger is down."""
    return (
        f"logger '{found.name}' (process {found.pid}): its helper process is down since "
        f"{max(0.0, time.time() - found.since):.0f} s and nobody can reach it; logging goes on, and the program starts "
        "another by itself again and again: its output says why that fails"
    )


def _has_successor(gone: LoggerAddress, others: list[LoggerAddress]) -> bool:
    """Return whether a logger of this name was started after this one died."""
    same = [found for found in others if not found.dead and (found.name, found.user) == (gone.name, gone.user)]
    return any(found.since >= gone.since for found in same)


def _left(folder: Path) -> Iterator[LoggerAddress]:
    for path, match in _sockets(folder):
        if owner_is_gone(path) and process_start(int(match["pid"])) != 0:
            yield LoggerAddress(match["name"], int(match["pid"]), "", "")


def _sockets(folder: Path) -> Iterator[tuple[Path, re.Match[str]]]:
    for path in folder.glob(f"*{SOCKET_SUFFIX}"):
        if (match := _SOCKET.fullmatch(path.name)) is not None:
            yield path, match


def _scan(folder: Path) -> list[LoggerAddress]:
    loggers = []
    for path, match in _sockets(folder):
        if owner_is_gone(path):
            continue
        mark = Beside.DEAD.of(path)
        dead = mark.exists()
        try:
            owner = user_name(path.lstat().st_uid)
            since = (mark if dead else path).lstat().st_mtime
        except FileNotFoundError:
            continue
        root = _root_of_socket(path)
        host, drawn = (root.host, root.id) if root is not None else ("", "")
        name, pid, copy = match["name"], int(match["pid"]), int(match["copy"] or 0)
        loggers.append(LoggerAddress(name, pid, str(path), owner, "", host, dead, since, drawn, copy))
    return loggers


def seen_now(found: LoggerAddress) -> LoggerAddress:
    """Return a logger of this computer with the keys that it has now: it draws others when it is served again."""
    root = _root_of_socket(Path(found.socket))
    return replace(found, host=root.host, id=root.id) if root is not None else replace(found, host="", id="")


def _root_of_socket(path: Path) -> keys.Root | None:
    """Return what stands beside a socket; None where an older silo made it, or its owner is ending."""
    try:
        return keys.root_of(Beside.KEY.of(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
