"""`silo convert`: a log in one format -> the same log in another, chosen by the endings of the two names.

Which formats there are says `silo.files.formats`.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from silo.core.arguments import path as checked_path
from silo.core.recording import Progress, Recording
from silo.errors import FileFormatError, SaveError
from silo.files.atomic import check_folder, replaced_folder
from silo.files.formats import format_of, is_bag_folder, read_recording, with_rounding_told, writer_for

CONVERTED = "converted"  # why such a file is there, instead of why its source was saved


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    progress: Progress | None = None,
    force: bool = False,
    change: Callable[[Recording], Recording] = lambda recording: recording,
) -> Recording:
    """Read `source`, write what `change` makes of it to `target`; the formats follow from the endings, a name without
    one is a bag folder.

    Returns the recording that was written; its `warnings` say what a damaged source lacks. `progress` gets the fraction
    written. An existing target is replaced only with `force`, and only when the new one is complete. Raises
    `LogNotFoundError`, `FileFormatError` for the source, `SaveError` for the target, `SiloError` for a missing extra.
    """
    from silo.files.added import added_formats

    final = checked_path("the file to write", target)
    write = writer_for(final, added_formats)
    if final.exists() and not force:
        raise SaveError(f"'{final}' exists already; add --force to replace it, or choose another name")
    check_folder(final)
    recording = change(_with_what_is_not_known(read_recording(source, added_formats, check=True), Path(source)))
    recording = with_rounding_told(replace(recording, why=CONVERTED), format_of(final))
    if not recording.elements and recording.warnings:
        raise FileFormatError(f"'{source}': nothing in it can be read, nothing was written: {recording.warnings[-1]}")
    if final.is_dir():
        _check_is_bag_alone(final)
        with replaced_folder(final) as new:
            write(recording, new, progress)
    else:
        write(recording, final, progress)
    return recording


def _with_what_is_not_known(recording: Recording, source: Path) -> Recording:
    """The recording, with a warning if the file that says what its format can't isn't there."""
    found = format_of(source)
    beside = f"{source.name}{found.beside}" if found and found.beside else ""
    if not beside or source.with_name(beside).exists():
        return recording
    text = f"there was no '{beside}' beside it: units, labels, types and buffers of the log are not known"
    return replace(recording, warnings=(*recording.warnings, text))


def _check_is_bag_alone(folder: Path) -> None:
    """Raise `SaveError` for a folder that holds anything else than a bag: it must not be lost with it."""
    others = sorted(one.name for one in folder.iterdir() if one.name != "metadata.yaml" and one.suffix != ".mcap")
    if not is_bag_folder(folder) or others or folder.resolve() == Path.cwd():
        holds = f", it holds {others[0]}" if others else ""
        raise SaveError(
            f"'{folder}' is a folder, but not of a bag alone{holds}: it is not replaced; choose another name"
        )
