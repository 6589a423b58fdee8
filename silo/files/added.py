"""Formats of other packages: a reader or a writer that an installed package offers by the entry point `silo.formats`.

[project.entry-points."silo.formats"]
ulog = "silo_ulog:FORMAT"            # a `silo.files.formats.Format`; its reader and writer are texts, module:function

What silo reads and writes itself goes first: these are looked for when it can't. Who analyses and converts hands
`added_formats` on to `silo.files.formats`; a robot program, its helper process and recorders never do, so that no code
of others runs there.
"""

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from silo.core.recording import Progress, Recording
from silo.errors import FileFormatError, SaveError, SiloError, reason
from silo.files.formats import FORMATS, Format, by_mark

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "silo.formats"


@dataclass(frozen=True)
class AddedFormats:
    """What other packages read and write; `left_out` says of those that are broken what is wrong."""

    formats: tuple[Format, ...] = ()
    left_out: tuple[str, ...] = ()

    def reader(self, path: Path) -> Callable[[Path], Recording] | None:
        """Return what reads a file, by its ending, else by its first bytes; None where nothing does."""
        readers = [one for one in self.formats if one.reader]
        found = next((one for one in readers if path.suffix.lower() in one.endings), None) or by_mark(path, readers)
        return None if found is None else lambda source: _read(found, source)

    def writer(self, path: Path) -> Callable[[Recording, Path, Progress | None], None] | None:
        """Return what writes files of this ending; None where nothing does."""
        found = next((one for one in self.formats if one.writer and path.suffix.lower() in one.endings), None)
        return None if found is None else lambda recording, target, progress: _write(found, recording, target, progress)


@cache
def added_formats() -> AddedFormats:
    """Return the formats of installed packages. Asked for once per process: 20 ms and what they import themselves."""
    from importlib.metadata import entry_points

    found = [_loaded(point) for point in entry_points(group=GROUP)]
    formats = tuple(one for one in found if isinstance(one, Format))
    return AddedFormats(formats, tuple(one for one in found if isinstance(one, str)))


def _loaded(point: "EntryPoint") -> Format | str:
    """A format, or what is wrong with it."""
    try:
        return _checked(point)
    except Exception as error:  # noqa: BLE001  # code of others: whatever it raises, the other formats are there
        owner = point.dist.name if point.dist is not None else point.value
        return f"the format '{point.name}' of the package '{owner}' is left out: {_reason(error)}"


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, SiloError) else f"{type(error).__name__}: {error}"


def _checked(point: "EntryPoint") -> Format:
    found = point.load()
    if not isinstance(found, Format):
        raise FileFormatError(f"'{point.value}' is no silo.files.formats.Format, but of {type(found).__name__}")
    if found.folder or not found.endings or not (found.reader or found.writer):
        raise FileFormatError("it needs an ending, and a reader or a writer of files")
    for ending in found.endings:
        own = next((one for one in FORMATS if ending in one.endings), None)
        if own is not None and (found.writer or (own.reader and not found.mark)):
            raise FileFormatError(f"silo has '{ending}' itself")
    return found


def _read(added: Format, path: Path) -> Recording:
    try:
        recording = added.load_reader()(path)
    except (SiloError, MemoryError):
        raise
    except Exception as error:
        raise FileFormatError(f"'{path}': the reader '{added.reader}' failed: {_reason(error)}") from error
    if not isinstance(recording, Recording):
        kind = type(recording).__name__
        raise FileFormatError(f"'{path}': the reader '{added.reader}' gave no recording, but one of {kind}")
    return recording


def _write(added: Format, recording: Recording, path: Path, progress: Progress | None) -> None:
    """Write beside the target, which is replaced by what is whole."""
    try:
        made = Path(tempfile.mkdtemp(prefix=".silo-", dir=path.parent))
    except OSError as error:
        raise SaveError(f"'{path}': {reason(error)}; nothing was written") from error
    try:
        added.load_writer()(recording, made / path.name, progress)
        (made / path.name).replace(path)
    except (SiloError, MemoryError):
        raise
    except Exception as error:
        raise SaveError(f"'{path}': the writer '{added.writer}' failed: {_reason(error)}") from error
    finally:
        shutil.rmtree(made, ignore_errors=True)
