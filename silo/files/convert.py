"""`silo convert`: a log in one format -> the same log in another, chosen by the endings of the two names.

Formats that only others read (`.parquet`, `.mat`, `.npz`, `.h5`) are written by `silo.files.tables` and
`silo.files.arrays`, which are imported with their libraries when they are asked for.
"""

import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from silo.errors import FileFormatError, LogNotFoundError, SaveError
from silo.files.naming import is_bag_folder
from silo.recording import Progress, Recording

Writer = Callable[[Recording, Path, Progress | None], None]

READABLE = (".silo", ".csv", ".mcap", "a bag folder")
WRITABLE = (".silo", ".csv", ".mcap", ".rosbag2 (a folder; .bag, too)", ".parquet", ".mat", ".npz", ".h5")


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    progress: Progress | None = None,
    force: bool = False,
) -> Recording:
    """Read `source`, write `target`; the formats follow from the endings, a name without one is a bag folder.

    Returns the recording that was read; its `warnings` say what a damaged source lacks. `progress` gets the fraction
    written. An existing target is replaced only with `force`, and only when the new one is complete. Raises
    `LogNotFoundError`, `FileFormatError` for the source, `SaveError` for the target, `SiloError` for a missing extra.
    """
    final = Path(target)
    write = writer_for(final)
    if final.exists() and not force:
        raise SaveError(f"'{final}' exists already; add --force to replace it, or choose another name")
    recording = read_recording(source)
    if final.is_dir():
        with _set_aside(final):
            write(recording, final, progress)
    else:
        write(recording, final, progress)
    return recording


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Open any file that silo reads: `.silo`, `.csv`, `.mcap` or a bag folder.

    Raises `LogNotFoundError` or `FileFormatError`.
    """
    source = Path(path)
    if not source.exists():
        raise LogNotFoundError(f"there is no file or folder '{source}'")
    ending = source.suffix.lower()
    if is_bag_folder(source) or ending == ".mcap":
        from silo.files.bag_read import read_bag

        return read_bag(source)
    if source.is_dir():
        raise FileFormatError(f"'{source}' is a folder without a bag in it")
    if ending == ".csv":
        from silo.files.csv_file import read_csv

        return read_csv(source)
    if ending == ".silo":
        from silo.files.silo_file import read_silo

        return read_silo(source)
    raise FileFormatError(f"'{source}': silo doesn't read {ending or 'files without ending'}, only {_list(READABLE)}")


def writer_for(path: Path) -> Writer:
    """The function that writes files of this ending. Raises `SaveError` for an ending that nothing writes."""
    ending = path.suffix.lower()
    if ending == ".silo":
        from silo.files.silo_file import write_silo

        return write_silo
    if ending == ".csv":
        from silo.files.csv_file import write_csv

        return lambda recording, target, progress: write_csv(recording, target, progress=progress)
    if ending in ("", ".rosbag2", ".bag", ".mcap"):
        from silo.files.bag import write_bag

        return write_bag
    if ending == ".parquet":
        from silo.files.tables import write_parquet

        return write_parquet
    if ending in (".npz", ".mat", ".h5", ".hdf5"):
        from silo.files import arrays

        return {".npz": arrays.write_npz, ".mat": arrays.write_mat}.get(ending, arrays.write_hdf5)
    raise SaveError(f"'{path}': silo can't write {ending}, only {_list(WRITABLE)}")


@contextmanager
def _set_aside(folder: Path) -> Iterator[None]:
    """Give the name of a bag folder free for a new one; whatever goes wrong, the old one gets its name back."""
    if not is_bag_folder(folder):
        raise SaveError(f"'{folder}' is a folder, but not of a bag: it is not replaced; choose another name")
    old = folder.with_name(f".silo-{os.getpid()}-{secrets.token_hex(4)}.old")
    folder.rename(old)
    try:
        yield
    except BaseException:
        old.rename(folder)
        raise
    shutil.rmtree(old)


def _list(endings: tuple[str, ...]) -> str:
    return f"{', '.join(endings[:-1])} and {endings[-1]}"
