"""The log folders in which this user's loggers keep journals (`storage="disk"`), for who looks after a power cut.

Then `/dev/shm` and `/run` are empty, and nobody knows where a robot program logged. So the helper process that makes a
journal leaves a link to its folder in `$XDG_STATE_HOME/silo/journals` (`~/.local/state/...` if that isn't set), on the
disk before the first tick is called durable. `silo recover` and `silo ls` follow these links, and remove those behind
which no journal is any more. Needs no NumPy: `silo ls` looks here each time.
"""

import contextlib
import os
import time
from pathlib import Path

from silo.core.runtime import state_folder, sync

JOURNALS = "journals"
RECORDINGS = "recordings"  # of recorders: what a kill left open is found as journals are
UNNAMED_FILES = ".silo-*.part"  # that a kill kept from their names
OPEN_PARTS = "*.mcap.part"  # of recordings that a kill left open
_FILES = {JOURNALS: (".*.journal", UNNAMED_FILES), RECORDINGS: (OPEN_PARTS, UNNAMED_FILES)}
KEPT_S = 30 * 86400.0  # of a link to a folder that isn't there: its disk may be mounted again


def remember_folder(folder: Path, kind: str = JOURNALS) -> None:
    """Have a folder that holds a journal, or parts of recordings, found after a power cut; durable when this returns.

    Raises OSError where the state folder can't be written, RuntimeError where this user has no home.
    """
    target = folder.absolute()
    links = state_folder() / kind
    links.mkdir(mode=0o700, parents=True, exist_ok=True)
    import hashlib  # loads OpenSSL: `silo ls` reads what is remembered, and remembers nothing

    link = links / hashlib.blake2b(os.fsencode(target), digest_size=8).hexdigest()
    with contextlib.suppress(FileNotFoundError):
        os.utime(link, follow_symlinks=False)
        return
    with contextlib.suppress(FileExistsError):  # two loggers of one folder
        link.symlink_to(target)
    # the link, and the folders that may have been made for it
    for place in (links, links.parent, links.parent.parent):
        sync(place)


def remembered_folders(kind: str = JOURNALS) -> list[Path]:
    """Return the folders that hold such files; those that aren't there, for their disk isn't mounted, too.

    Links to folders without any are removed, and after a month those to folders that aren't there.
    """
    found = []
    with contextlib.suppress(OSError, RuntimeError):  # nothing was ever remembered
        for link in sorted((state_folder() / kind).iterdir()):
            with contextlib.suppress(OSError):  # no link, or another process removes it just now
                folder = link.readlink()
                there = os.path.lexists(folder)
                if _has_files(folder, kind) or not (there or time.time() - link.lstat().st_mtime > KEPT_S):
                    found.append(folder)
                    continue
                link.unlink()
                if _has_files(folder, kind):  # begun meanwhile
                    remember_folder(folder, kind)
                    found.append(folder)
    return found


def _has_files(folder: Path, kind: str) -> bool:
    return any(any(folder.glob(files)) for files in _FILES[kind])
