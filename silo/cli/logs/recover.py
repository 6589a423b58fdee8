"""`silo recover`: what programs that died without saving left in shared memory, or in journals on the disk."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.common import TypedPath, json_option, show_json, types_option
from silo.core.elements import FileType
from silo.core.quantities.writing import many, size_text
from silo.errors import LogNotFoundError, SaveError, SegmentError, SiloError
from silo.journal.folders import OPEN_PARTS, RECORDINGS, remembered_folders

if TYPE_CHECKING:
    from silo.recorder.process import RecorderHandover
    from silo.recovery.left import LeftRun


@click.command()
@click.argument("paths", nargs=-1, type=TypedPath(path_type=Path), metavar="[FOLDER|SEGMENT]...")
@click.option("-l", "--list", "only_list", is_flag=True, help="Only show what can be recovered.")
@click.option("--folder", type=TypedPath(path_type=Path, file_okay=False), help="Instead of the logger's own folder.")
@click.option(
    "--look-in",
    type=TypedPath(path_type=Path, file_okay=False, exists=True),
    default=Path(),
    help="A log folder to look in as well; this folder if not given.",
)
@types_option
@json_option
def recover(
    paths: tuple[Path, ...], only_list: bool, folder: Path | None, look_in: Path, types: tuple[str, ...], as_json: bool
) -> None:
    """Save what programs left behind that died without saving, and free its memory.

    After a power cut that is what journals prove (storage='disk'): they are looked for in this folder, and in the log
    folders in which loggers of this user kept them. FOLDER: only what is in that log folder, or was to be saved there.

    The helper process of a logger does this by itself, also when the program is started again; this command is for when
    nobody does. Rests that hold no data are removed on the way. Endless recordings (`silo record`) are completed from
    what is in memory, and parts of them that a kill left open are closed where they are.

    \b
    Examples:
      silo recover --list
      silo recover /data/logs
      silo recover --folder logs -t silo -t csv
    """
    from silo.core.runtime import list_segments
    from silo.files.formats import file_types

    chosen = file_types(types)
    missing = [path for path in paths if not os.path.lexists(path)]
    if missing:
        raise LogNotFoundError(
            f"'{missing[0]}': there is no such folder or segment; `silo recover --list` shows what can be recovered; "
            "nothing was done"
        )
    single, runs = _meant(paths, look_in)
    named = [path.resolve() for path in paths if path not in single] if paths else None  # folders; None for all
    folders = _recording_folders(named, look_in)
    if only_list and single:
        raise click.UsageError(f"--list shows what is found in folders; {single[0]} is none")
    left = _incomplete(named)
    looked_in = [look_in, *_known_folders()] if named is None else named
    if only_list:
        for one in left:
            click.echo(f"recording '{one.order.name}' in {one.order.folder} is not complete", err=as_json)
        _show_parts(folders, as_json)
        _show(runs, as_json, looked_in, quiet=_show_set_aside(looked_in, as_json))
    else:
        settled = _settle(left, named, as_json)
        closed = _close_parts(folders, as_json) or settled
        own = [Path(one.schema.folder) for one in runs if one.schema and named is None]
        if looked_in:
            closed |= _sweep([*looked_in, *folders, *own])
        found = [*single, *(one.path for one in runs if one.holdings)]
        _recover(found, folder, chosen, as_json, single, looked_in, quiet=closed)
        list_segments()  # removes the links to those that are gone now
    damaged = [one for one in runs if one.holdings is None]
    if damaged:
        if not only_list:
            _say(damaged)
        raise SegmentError(f"{many(len(damaged), 'segment')} can't be read; nothing of them was changed")


def _incomplete(named: Sequence[Path] | None) -> "list[RecorderHandover]":
    """Endless recordings of programs that are gone: all, or those into the folders that are named."""
    from silo.core.runtime import RECORDERS_SUFFIX, runtime_dir

    if not any(runtime_dir().glob(f"*{RECORDERS_SUFFIX}")):
        return []
    from silo.recorder.left_recordings import left_lists

    found = [one for _, kept in left_lists() for one in kept]
    return [one for one in found if named is None or any(map(Path(one.order.folder).is_relative_to, named))]


def _settle(left: "list[RecorderHandover]", named: Sequence[Path] | None, as_json: bool) -> bool:
    """Complete endless recordings from what is in memory, and judge what programs that died held for that.

    All, or those whose folders are named. Returns whether there was anything to tell.
    """
    from silo.core.runtime import HELD_SUFFIX, JUDGE_SUFFIX, runtime_dir

    if not left and not any(path.suffix in (HELD_SUFFIX, JUDGE_SUFFIX) for path in runtime_dir().iterdir()):
        return False
    from silo.helper.left_logs import settle_left

    told: list[str] = []

    def tell(_kind: object, text: str, _files: object) -> None:
        told.append(text)
        click.echo(text, err=as_json)

    def wanted(_logger: str, folder: str) -> bool:
        return named is None or Path(folder) in named

    for problem in settle_left(tell, wanted, recordings=lambda one: one in left):
        click.echo(problem, err=True)
    return bool(left or told)


def _meant(paths: Sequence[Path], look_in: Path) -> "tuple[list[Path], list[LeftRun]]":
    """What is named by itself, and what is found: everywhere, or in the folders that are named."""
    from silo.journal.format import JOURNAL_SUFFIX
    from silo.recovery.journals import is_journal
    from silo.recovery.runs import find_all

    if not paths:
        return [], find_all([look_in, *_known_folders()])
    folders = [path for path in paths if path.is_dir() and path.suffix != JOURNAL_SUFFIX and not is_journal(path)]
    inside = {path.resolve() for path in folders}
    found = find_all(folders) if folders else []
    runs = [
        one
        for one in found
        if one.path.parent.resolve() in inside or (one.schema is not None and Path(one.schema.folder) in inside)
    ]
    return [path for path in paths if path not in folders], runs


def _recording_folders(named: Sequence[Path] | None, look_in: Path) -> list[Path]:
    """Where open parts of recordings may be."""
    from silo.recorder.requests import DEFAULT_FOLDER

    given = [look_in] if named is None else named
    # `log.record()` records there where nobody names a folder
    folders = [*given, *(path / DEFAULT_FOLDER for path in given)]
    if named is None:
        folders += remembered_folders(RECORDINGS)
    return list(dict.fromkeys(folder.resolve() for folder in folders if folder.is_dir()))


def _show_parts(folders: Sequence[Path], as_json: bool) -> None:
    for folder in folders:
        if any(folder.glob(OPEN_PARTS)):
            from silo.recovery.parts import left_parts

            for path in left_parts(folder):
                text = f"{path}  {size_text(path.stat().st_size)} of a recording, left open by a kill"
                click.echo(text, err=as_json)


def _show_set_aside(folders: Sequence[Path], as_json: bool) -> bool:
    """Show bags that lost their names; returns whether there are any."""
    from silo.files.atomic import set_aside

    found = [path for folder in dict.fromkeys(map(Path.resolve, folders)) for path in set_aside(folder)]
    for path in found:
        click.echo(f"{path}  a bag that lost its name as a conversion was killed", err=as_json)
    return bool(found)


def _close_parts(folders: Sequence[Path], as_json: bool) -> bool:
    """Close what killed recorders left open; returns whether there was anything."""
    done = False
    for folder in folders:
        if any(folder.glob(OPEN_PARTS)):
            from silo.recovery.parts import close_parts

            closed, problems = close_parts(folder)
            for part in closed:
                click.echo(part.text, err=as_json)
            for problem in problems:
                click.echo(problem, err=True)
            done = done or bool(closed)
    return done


def _known_folders() -> list[Path]:
    """Log folders in which loggers of this user kept journals."""
    return [folder for folder in remembered_folders() if folder.is_dir()]


def _sweep(folders: Sequence[Path]) -> bool:
    """Remove rests that hold no data; returns whether a bag has its name again."""
    from silo.core.runtime import runtime_dir, sweep_unfinished
    from silo.files.atomic import put_back, sweep_parts
    from silo.net.folders import own_folders
    from silo.net.session import sweep
    from silo.recovery.journals import sweep_journals

    for own in own_folders():
        sweep(own)
    named = False
    removed = sweep_unfinished(runtime_dir())
    for folder in dict.fromkeys(path.resolve() for path in folders):
        for path in put_back(folder):
            named = True
            click.echo(f"{path}: has its name again: a conversion that was to replace it was killed", err=True)
        removed += sweep_unfinished(folder) + sweep_parts(folder)
    for path in removed:
        click.echo(f"{path}: was never finished, its process died; removed", err=True)
    for folder in dict.fromkeys(path.resolve() for path in folders):
        for path in sweep_journals(folder):
            click.echo(f"{path}: a journal in which no tick was durable yet; removed", err=True)
    return named


def _show(runs: "Sequence[LeftRun]", as_json: bool, looked_in: Sequence[Path], *, quiet: bool) -> None:
    if as_json:
        show_json([_facts(one) for one in runs])
        return
    _say(runs)
    if not runs and not quiet:
        _say_nothing(looked_in)


def _say_nothing(looked_in: Sequence[Path]) -> None:
    """Say so, and where stands what programs logged that died, and whose memory was saved before."""
    from silo.helper.left_logs import saved_before

    click.echo("nothing to recover")
    for folder in dict.fromkeys(path.resolve() for path in looked_in):
        for row in saved_before(folder):
            click.echo(f"what '{row.logger}' logged last was saved already ({row.why}):")
            for file in row.files:
                click.echo(f"  {folder / file.name}  {size_text(file.size_bytes)}")
    for folder in remembered_folders():
        if not folder.is_dir():
            click.echo(
                f"{folder}: a logger kept a journal there (storage='disk'), and the folder isn't there now: "
                "if its disk isn't mounted, mount it and try again",
                err=True,
            )


def _say(runs: "Sequence[LeftRun]") -> None:
    for one in runs:
        logger = f"logger '{one.schema.logger}': " if one.schema else ""
        held = f"{one.holdings.text}; " if one.holdings else ""
        click.echo(f"{one.path}  {logger}{held}{one.reason}", err=one.holdings is None)


def _facts(one: "LeftRun") -> dict[str, object]:
    held = one.holdings
    return {
        "path": str(one.path),
        "logger": one.schema.logger if one.schema else "",
        "ticks": one.ticks,
        "samples": held.samples if held else 0,
        "seconds": held.seconds if held else 0.0,
        "readable": held is not None,
        "reason": one.reason,
    }


def _recover(
    paths: Sequence[Path],
    folder: Path | None,
    types: Sequence[FileType],
    as_json: bool,
    named: Sequence[Path],
    looked_in: Sequence[Path],
    *,
    quiet: bool,
) -> None:
    """Each segment by itself: one that fails doesn't keep the others. Raises SaveError at the end if any did.

    `named` are those that the user wrote; all others were found, so that one that is gone now was there a moment ago.
    """
    from silo.helper.left_logs import recover as recover_segment
    from silo.recovery.left import SavedMeanwhileError

    files, failed, recovered, refused = [], 0, None, False
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        try:
            recovered = recover_segment(path, folder, types, before=recovered)
        except SavedMeanwhileError as error:
            click.echo(str(error), err=as_json)
            continue
        except SiloError as error:
            if path not in named and not path.exists():
                click.echo(f"{path}: is gone: another process saved or removed it meanwhile", err=as_json)
                continue
            text = str(error)
            click.echo(text if text.startswith(str(path)) else f"{path}: {text}", err=True)
            failed, refused = failed + 1, refused or isinstance(error, SaveError)
            continue
        files += recovered.files
        if not as_json:
            click.echo(f"{path}: {recovered.text}")
            for file in recovered.files:
                click.echo(f"  {file.path}  {size_text(file.size_bytes)}")
    if as_json:
        show_json(files)
    elif not paths and not quiet:
        _say_nothing(looked_in)
    if failed:
        elsewhere = "; `silo recover --folder DIR` saves it elsewhere" if refused and folder is None else ""
        raise SaveError(
            f"{failed} of {many(len(paths), 'segment')} could not be recovered; what failed stays as it is{elsewhere}"
        )
