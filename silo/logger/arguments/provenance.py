"""Where a run comes from: host, versions, the program, and the git commit of its folder. Stands in every file.

Found once per process, when the first logger is made: files of git are read, no process is started, and looking for
changes ends after 0.1 s.
"""

import functools
import hashlib
import os
import platform
import socket
import struct
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from silo.core.arguments import line, shown
from silo.errors import ElementError
from silo.version import VERSION

MOST_FACTS, MOST_CHARACTERS = 100, 1000
LONGEST_LOOK_S = 0.1
LARGEST_INDEX = 64 << 20
_ENTRY = struct.Struct(">10I20sH")  # of git's index: times, device, inode, mode, owner, size; the blob's name; flags


def about_run(given: Mapping[str, object] | None) -> dict[str, str]:
    """Return what is known of the program, and what it says itself, which goes first. Raises ElementError."""
    if given is not None and not isinstance(given, Mapping):
        raise ElementError(f"about must be a dictionary, got {shown(given)}; write about={{'operator': 'alice'}}")
    said = {line("a name in about", key, "about={'operator': 'alice'}"): str(one) for key, one in (given or {}).items()}
    if len(said) > MOST_FACTS or any(len(one) > MOST_CHARACTERS for one in said.values()):
        raise ElementError(f"about takes {MOST_FACTS} texts of {MOST_CHARACTERS} characters each")
    return {key: one.encode("utf-8", "backslashreplace").decode() for key, one in {**_found(), **said}.items()}


@functools.lru_cache(maxsize=1)
def _found() -> dict[str, str]:
    main = getattr(sys.modules.get("__main__"), "__file__", None)
    program = Path(main).absolute() if main else None
    found = {
        "host": socket.gethostname(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "silo": VERSION,
    }
    if program is not None:
        found["program"] = str(program)
    git = git_state(program.parent if program is not None else Path.cwd())
    return {**found, "git": git} if git else found


def git_state(folder: Path, longest_s: float = LONGEST_LOOK_S) -> str:
    """Return the commit that a folder is at, and whether files that git knows differ from it; empty without git.

    Changes are looked for no longer than `longest_s`.
    """
    try:
        tree = next((one for one in (folder, *folder.parents) if (one / ".git").exists()), None)
        if tree is None:
            return ""
        git = tree / ".git"
        if git.is_file():  # of a worktree, or a submodule
            git = tree / git.read_text().removeprefix("gitdir:").strip()
        commit = _commit(git)
        return f"{commit}{_changes(tree, git / 'index', time.monotonic() + longest_s)}" if commit else ""
    except (OSError, ValueError, struct.error):  # no reason not to log
        return ""


def _commit(git: Path) -> str:
    head = (git / "HEAD").read_text().strip()
    if not head.startswith("ref:"):
        return head
    ref = head.removeprefix("ref:").strip()
    common = git / "commondir"
    for home in (git, git / common.read_text().strip()) if common.exists() else (git,):
        if (home / ref).exists():
            return (home / ref).read_text().strip()
        packed = home / "packed-refs"
        for one in packed.read_text().splitlines() if packed.exists() else ():
            if one.endswith(f" {ref}"):
                return one.split()[0]
    return ""


def _changes(tree: Path, index: Path, until_s: float) -> str:
    """Return what is to be said of changes that aren't committed."""
    if not index.exists() or index.stat().st_size > LARGEST_INDEX:
        return ""
    data = index.read_bytes()
    mark, version, count = struct.unpack_from(">4sII", data)
    if mark != b"DIRC" or version not in (2, 3):
        return ""
    for place, name in _entries(data, count):
        if time.monotonic() > until_s:
            return " (not all files were looked at)"
        if _differs(tree / os.fsdecode(name), *_ENTRY.unpack_from(data, place)):
            return " (with changes)"
    return ""


def _entries(data: bytes, count: int) -> Iterator[tuple[int, bytes]]:
    place = 12
    for _ in range(count):
        begin = place + _ENTRY.size + (2 if _ENTRY.unpack_from(data, place)[-1] & 0x4000 else 0)
        end = data.index(b"\0", begin)
        yield place, data[begin:end]
        place += (end - place + 8) // 8 * 8


def _differs(path: Path, *entry: Any) -> bool:
    """Whether a file isn't what git has: by size and time, and where the time alone differs by what is in it."""
    mode, size, name, flags = entry[6], entry[9], entry[10], entry[11]
    if mode & 0o170000 != 0o100000 or flags & 0x8000:  # links, submodules; what git takes as it is
        return False
    try:
        found = path.stat()
        if found.st_size != size:
            return True
        if (int(found.st_mtime), found.st_mtime_ns % 10**9) == (entry[2], entry[3]):
            return False
        held = hashlib.sha1(b"blob %d\0" % size + path.read_bytes(), usedforsecurity=False).digest()
    except FileNotFoundError:
        return True
    return bool(held != name)
