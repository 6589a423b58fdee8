"""What log files are called, and how they are found again.

`<logger>_<date>_<time>_<run number>.<ending>`: one run number per save, counted in `.<logger>_fileNumber` in the
folder of the logs, under a lock, so that several processes may save at once.
"""

import glob
import os
import re
from collections.abc import Callable, Hashable, Iterable
from datetime import datetime
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

from silo.core.arguments import check_name
from silo.core.elements import SavedFile
from silo.core.quantities.writing import and_more, size_text
from silo.core.runtime import FOLDER_GONE, closing_file, is_folder_gone, open_own
from silo.errors import LogNotFoundError, SaveError, reason
from silo.files.atomic import lock
from silo.files.formats import FORMATS, LOG_ENDINGS, is_bag_folder

_STEM = re.compile(r"(?P<logger>.+)_(?P<when>\d{8}_\d\d-\d\d-\d\d)_(?P<run>\d{5,})")
_TABLE_ENDINGS = {end for one in FORMATS if one.reader and one.writer and not one.for_logs for end in one.endings}
_OF_TRIGGER = re.compile(r"_.+_\d+")  # behind the stem: a capture

Tell = Callable[[str], object]
T = TypeVar("T")


def next_run_number(folder: str | os.PathLike[str], logger: str) -> int:
    """Take the next run number of a logger: one more than the last, 1 for the first.

    Safe when several threads and processes call it at once. A counter that is missing or damaged goes on after the
    newest log in the folder. Raises `SaveError` if the folder can't be written.
    """
    counter = Path(folder) / f".{check_name(logger)}_fileNumber"
    try:
        with closing_file(open_own(counter, os.O_RDWR | os.O_CREAT, 0o666)) as descriptor:
            # released by close, also when the process dies
            lock(descriptor)
            text = os.read(descriptor, 64).strip()
            last = int(text) if re.fullmatch(rb"\d{1,18}", text) else _newest_run(Path(folder), logger)
            number = b"%d\n" % (last + 1)
            os.pwrite(descriptor, number, 0)
            os.ftruncate(descriptor, len(number))
    except OSError as error:
        raise SaveError(f"can't count the run in '{counter}': {reason(error)}; choose another folder") from error
    return last + 1


def log_path(folder: str | os.PathLike[str], logger: str, run: int, when: datetime, ending: str) -> Path:
    """`folder/<logger>_<YYYYmmdd_HH-MM-SS>_<run, 5 digits or more><ending>`; `when` in local time."""
    return Path(folder) / f"{check_name(logger)}_{when:%Y%m%d_%H-%M-%S}_{run:05d}{ending}"


def custom_path(folder: str | os.PathLike[str], name: str, ending: str) -> Path:
    """`folder/<name><ending>`; the ending is not doubled if the name has it already."""
    stem = check_name(name)
    for known in LOG_ENDINGS:
        stem = stem.removesuffix(known)
    return Path(folder) / (check_name(stem) + ending)


def with_part(path: Path, part: int) -> Path:
    """A name that says which stretch it is of a run that was cut; that of one that was not (0) as it is."""
    ending = f"_part{part}"
    return path if not part or path.stem.endswith(ending) else path.with_name(f"{path.stem}{ending}{path.suffix}")


def logger_of(stem: str) -> str:
    """The logger that a log of this name (without ending) is of, or a capture; empty for a name that somebody chose."""
    match = _STEM.match(stem)
    return match["logger"] if match and stem[match.end() :][:1] in ("", "_") else ""


def is_capture(path: Path) -> bool:
    """Whether a file is what a trigger captured of a run, by its name."""
    match = _STEM.match(path.stem)
    return match is not None and _OF_TRIGGER.fullmatch(path.stem[match.end() :]) is not None


def find_log(
    which: str | os.PathLike[str] | int, folder: str | os.PathLike[str] = ".", tell: Tell = lambda text: None
) -> Path:
    """The log that is meant by a path, a logger or the start of a file name (the newest), or a run number.

    A relative path counts from `folder`, too. Where there are runs among what is meant, captures aren't: those have
    names of their own; that newer ones were passed over is told. Of one save in several formats the one that keeps most
    is taken. Raises `LogNotFoundError` if there is none, or if logs of several loggers have that run number, or a
    name that begins so (one of a logger of just that name is meant before these).
    """
    place = Path(os.path.expanduser(folder))  # noqa: PTH111  # pathlib raises for a `~name` that nobody has
    if isinstance(which, int):
        return _by_run(which, place)
    which = os.path.expanduser(which)  # noqa: PTH111
    if not str(which):
        raise LogNotFoundError("no log: its name is empty; '.' means the newest log of this folder")
    for path in (Path(which), place / which):
        if path.exists() and (path.is_file() or is_bag_folder(path)):
            return path
    found = _meant(which, place)
    if found:
        if _is_start(which, place) and len(loggers := _loggers(found)) > 1:
            raise LogNotFoundError(
                f"'{which}' in '{_whole(place)}' begins logs of several loggers ({', '.join(loggers)}); say which, "
                f"like '{loggers[0]}'"
            )
        return _newest(found, tell)
    if str(which).isdecimal():
        return _by_run(int(str(which)), place)
    raise _none(which, place)


def _none(which: str | os.PathLike[str], place: Path) -> LogNotFoundError:
    inside = place / which
    if inside.is_dir():
        return LogNotFoundError(f"no log in '{_whole(inside)}'{_what_is_there(inside)}")
    if inside.name and inside.parent.is_dir():  # where it would lie, which may be another folder
        which, place = inside.name, inside.parent
    return LogNotFoundError(f"no log '{which}' in '{_whole(place)}'{_what_is_there(place)}")


def _newest(found: list[Path], tell: Tell) -> Path:
    """The newest run, or of captures alone the newest of them."""
    runs = [path for path in found if not is_capture(path)]
    taken = _by_age(runs or found)[-1]
    newer = [path for path in found if runs and _age_and_preference(path)[0] >= _age_and_preference(taken)[0]]
    captures = _by_age([path for path in newer if is_capture(path)])
    if captures:
        several = f"{len(captures)} captures are" if len(captures) > 1 else "one capture is"
        name = captures[-1].name
        tell(f"'{taken.name}' was taken, the newest run; {several} newer, and meant by name, like '{name}'")
    return taken


def find_logs(
    which: str | os.PathLike[str],
    folder: str | os.PathLike[str] = ".",
    tell: Tell = lambda text: None,
    *,
    captures: bool = True,
) -> list[Path]:
    """All logs of a folder, or that a glob or the start of a file name means, oldest first; of each save one file.

    `captures`: those of triggers too; else only where nothing but captures is meant, and how many were left out is
    told. Raises `LogNotFoundError` if there is none.
    """
    place = Path(os.path.expanduser(folder))  # noqa: PTH111
    which = os.path.expanduser(which)  # noqa: PTH111
    exact = [path for path in (Path(which), place / which) if path.exists() and (path.is_file() or is_bag_folder(path))]
    found = exact[:1] or _meant(which, place)
    if not found:
        raise _none(which, place)
    runs = [path for path in found if not is_capture(path)]
    if runs and not captures and len(runs) < len(found):
        left = len(found) - len(runs)
        several = f"{left} captures are" if left > 1 else "one capture is"
        shown = f"{len(runs)} runs are" if len(runs) > 1 else "one run is"
        tell(f"{shown} taken, {several} left out: those are meant by name, like '*_TRIGGER_*'")
        found = runs
    best: dict[Path, Path] = {}
    for path in _by_age(found):
        best[path.with_suffix("")] = path
    return list(best.values())


def _whole(folder: Path) -> Path:
    """The whole path of a folder. Raises LogNotFoundError where the one that it counts from is gone."""
    try:
        return folder.resolve()
    except OSError as error:
        raise LogNotFoundError(f"no log in '{folder}': {FOLDER_GONE if is_folder_gone() else error}") from None


def _meant(which: str | os.PathLike[str], folder: Path) -> list[Path]:
    """The logs in a folder of that name, or whose names match a glob or start so."""
    start = folder / which
    if start.is_dir():
        return list(_logs(start))
    if not _is_start(which, folder):
        matching = (Path(found) for found in glob.glob(str(start), recursive=True))  # noqa: PTH207  # takes absolute patterns, too
        return [path for path in matching if path.suffix in LOG_ENDINGS and (path.is_file() or is_bag_folder(path))]
    found = [path for path in _logs(start.parent) if path.name.startswith(start.name)]
    return [path for path in found if start.name.rstrip("_") in (logger_of(path.stem), path.stem)] or found


def _is_start(which: str | os.PathLike[str], folder: Path) -> bool:
    """Whether it is the start of a name, neither a folder nor a glob."""
    return not (folder / which).is_dir() and not any(letter in str(which) for letter in "*?[")


def _loggers(found: Iterable[Path]) -> list[str]:
    return sorted({logger_of(path.stem) for path in found} - {""})


def _by_run(run: int, folder: Path) -> Path:
    found = [path for path in _logs(folder) if run_of(path) == run]
    found = [path for path in found if not is_capture(path)] or found
    loggers = _loggers(found)
    if len(loggers) > 1:
        raise LogNotFoundError(
            f"run {run} in '{_whole(folder)}' is a log of several loggers ({', '.join(loggers)}); "
            f"say which by the start of the file name, like '{loggers[0]}_'"
        )
    if not found:
        raise LogNotFoundError(f"no log of run {run} in '{_whole(folder)}'{_what_is_there(folder)}")
    return max(found, key=_age_and_preference)


def _logs(folder: Path) -> Iterable[Path]:
    if not folder.is_dir():
        return ()
    paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
    # bags of others are folders of any name
    return [
        path
        for path in paths
        if (path / "metadata.yaml").is_file()
        or (path.suffix in LOG_ENDINGS and (path.is_file() or is_bag_folder(path)))
    ]


def _folders(folder: Path) -> list[Path]:
    """The folders in one that may hold logs, a few: whoever is wrong by one looks no further."""
    if not folder.is_dir():
        return []
    inside = (path for path in folder.iterdir() if not path.name.startswith("."))
    return sorted(path for path in islice(inside, 200) if path.is_dir() and os.access(path, os.R_OK | os.X_OK))


def run_of(path: Path) -> int:
    """The run number in a name, 0 for a name that somebody chose."""
    match = _STEM.match(path.stem)  # of a capture, too, whose trigger and number stand behind
    return int(match["run"]) if match else 0


def _by_age(paths: Iterable[Path]) -> list[Path]:
    keys = {path: _age_and_preference(path) for path in paths}
    return in_order(keys, counted_by, run_of, keys.__getitem__)


def counted_by(path: Path) -> tuple[Path, str] | None:
    """Whose run number is in a name: a logger in a folder; None for a capture, which comes within a run, and others."""
    match = _STEM.fullmatch(path.stem)
    return (path.parent, match["logger"]) if match else None


def in_order(
    found: Iterable[T],
    counted: Callable[[T], Hashable],
    number: Callable[[T], int],
    key: Callable[[T], tuple[Any, ...]],
) -> list[T]:
    """Return what was made at some time, the oldest first, by a key that begins with the time.

    Of what one counts the number decides: clocks are set back, and local time goes back once a year. What nobody
    counts, None, stands by its time.
    """
    newest: dict[Hashable, float] = {}
    keyed: list[tuple[tuple[Any, ...], T]] = []
    for one in sorted(found, key=lambda one: (number(one), key(one))):
        time, *more = key(one)
        of = counted(one)
        if of is not None:
            time = newest[of] = max(newest.get(of, time), time)
        keyed.append(((time, number(one), *more), one))
    return [one for _, one in sorted(keyed, key=itemgetter(0))]


def _age_and_preference(path: Path) -> tuple[float, int, int]:
    # by the date in the name, which survives copying; by the file's own where the name has none
    match = _STEM.match(path.stem)
    made = path.stat().st_mtime
    if match:
        # a day that does not exist leaves the date of the file
        try:
            made = datetime.strptime(match["when"], "%Y%m%d_%H-%M-%S").timestamp()
        except ValueError:
            made = path.stat().st_mtime
    return made, run_of(path), -LOG_ENDINGS.index(path.suffix) if path.suffix in LOG_ENDINGS else -len(LOG_ENDINGS)


def _newest_run(folder: Path, logger: str) -> int:
    matches = (_STEM.fullmatch(path.stem) for path in _logs(folder))
    return max((int(match["run"]) for match in matches if match and match["logger"] == logger), default=0)


def _what_is_there(folder: Path) -> str:
    newest = _by_age(_logs(folder))[::-1]
    if not newest:
        below = [place.name for place in _folders(folder) if any(_logs(place))]
        there = f", but there are some in {' and '.join(map(repr, below[:3]))}: say where" if below else ""
        tables = [path.name for path in sorted(folder.glob("*")) if path.suffix in _TABLE_ENDINGS]
        there = there or (f"; {tables[0]} is what one was converted to: name the file" if tables else "")
        return f" (the folder holds no log{there})"
    return f"; there are: {and_more([path.name for path in newest], 3)}"


def files_text(files: Iterable[SavedFile]) -> str:
    """Return paths with sizes, fit to show."""
    return ", ".join(f"{file.path} ({size_text(file.size_bytes)})" for file in files) or "nothing"
