"""`open_log` and `open_logs`: from what somebody calls a log to a `Log`.

    log = silo.open_log("anymal_2026", folder="logs")     # the newest whose name starts so; a path; or a run number
    bag = silo.open_log("rosbag2_2026_11_22")             # bags of others, by the stamps of the recorder or the headers

Nothing but the header is read before a signal is asked for; of JSON in bags all messages, as nothing else has the keys.
"""

import contextlib
import numbers
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from silo.analysis.compute.arithmetic import warn_outside
from silo.analysis.log import Log
from silo.analysis.stretches import joined
from silo.core.arguments import path as file_path
from silo.core.arguments import shown, switch, whole
from silo.core.calls import told
from silo.core.elements import Stretch
from silo.core.recording import DamageNotes, Recording, has_own_stamps
from silo.errors import ElementError, FileFormatError, LogNotFoundError
from silo.files.added import added_formats
from silo.files.formats import LOG_ENDINGS, OPEN_PART_ENDING, read_recording
from silo.files.naming import find_log, find_logs, logger_of, run_of

MOST_RUNS = 10**9

__all__ = ["open_log", "open_logs"]


@told("silo.open_log")
def open_log(
    which: str | os.PathLike[str] | int | Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str] = ".",
    *,
    stamps: Literal["log", "header"] = "log",
    alone: bool | None = None,
    check: bool = False,
) -> Log:
    """Open a saved log.

    Every format that silo reads (`silo.files.formats`); of a file with another ending, the first bytes tell. What a
    damaged file lacks is told by a `LogWarning` and in `log.warnings`; what is found when values are read, then.

    Bags that silo did not write (MCAP files, rosbag2 folders with MCAP or SQLite) are read topic by topic, and each
    topic has time stamps of its own: `log["/imu/angular_velocity/x"]`. Needs `pip install "silo-logger[bags]"`.

    Args:
        which: a path, a logger or the start of a file name (the newest such is meant; of several loggers, that of just
            this name), or a run number. A folder or a glob
            (`logs/*.silo`) means the newest run there, in a format that loggers save in (what it was converted to is
            named by its path); what a trigger captured has its own name, and where one is
            newer, or of a recording other parts lie beside, a `LogWarning` says what was taken. `open_logs` opens all.
            Or a list of the parts of a run that was cut, or of a recording, to be read as one.
        folder: where names and run numbers are looked for.
        stamps: of bags of others, `"log"`: when a message was recorded, which rises and is of one clock; or `"header"`:
            the stamp in its header, when it was measured, where it has one. Logs of silo have those of their ticks.
        alone: this file only, or, if false, all parts that lie beside one another as one log: those of a run that was
            cut (`log.set(..., cut=True)`), with an event of kind `cut` where one goes on another, or those of a
            recording. If it is left out, that is so of a run that was cut; of a recording, which may be of days, one
            part is opened. The time stamps of all are read, a signal is when it is asked for.
        check: hold all values of a `.silo` against its checksums, and the chunks of a recording against theirs and
            their indexes, as `silo verify` does; all of it is read. What isn't as it was written is told by a
            `LogWarning` and in `log.warnings`.

    Returns:
        The log; what is large in it is read when it is asked for.

    Raises:
        LogNotFoundError: there is none.
        FileFormatError: it is no log, or damaged beyond reading.
        ElementError: `which` or `stamps` is something else.
    """
    if stamps not in ("log", "header"):
        raise ElementError(f"unknown stamps {stamps!r}: choose 'log' (when recorded) or 'header' (when measured)")
    if folder != "." and not os.path.isdir(file_path("folder", folder)):  # noqa: PTH112
        raise LogNotFoundError(
            f"there is no folder {shown(folder)} to look in; signals are chosen from the log: log['q']"
        )
    if isinstance(which, list | tuple) and which:
        read = [_read(one, folder, stamps, check=check) for one in which]
        path, recording = read[0][0], _of_files([one for _, one in read])
    else:
        path, recording = _read(which, folder, stamps, check=check)
        alone = alone if alone is None else switch("alone", alone)
        recorded = recording.stretch is not None and bool(recording.stretch.recorder)
        if alone is False or (alone is None and not recorded):
            recording = whole_run(path, recording, check=check)
        elif alone is None and not _is_named(which, path) and (words := alone_of(path, recording)):
            warn_outside(f"{path}: {words}")
    for warning in recording.warnings:
        warn_outside(f"{path}: {warning}")
    return Log(recording, os.fspath(path))


def _is_named(which: object, path: Path) -> bool:
    """Whether this very file was named, by no folder, glob or start of its name."""
    return path.name == Path(str(which)).name and (bool(path.suffix) or path.is_file())


def _read(which: object, folder: str | os.PathLike[str], stamps: str, *, check: bool) -> tuple[Path, Recording]:
    """Find what is meant and read it, with these stamps."""
    if not isinstance(which, str | bytes | os.PathLike):
        if not isinstance(which, numbers.Integral):
            raise ElementError(
                f"which log must be a path, the start of a file name or a run number, got {shown(which)}; write "
                "silo.open_log('logs/robot_2026')"
            )
        which = whole("a run number", which, 0, MOST_RUNS)
    path = find_log(
        which if isinstance(which, int) else file_path("which log", which), file_path("folder", folder), warn_outside
    )
    recording = read_recording(path, added_formats, check=switch("check", check))
    if stamps == "header" and has_own_stamps(recording):
        from silo.files.others.recording import stamped_by_header

        recording = stamped_by_header(recording)
    return path, recording


@told("silo.open_logs")
def open_logs(which: str | os.PathLike[str], folder: str | os.PathLike[str] = ".") -> list[Log]:
    """Open several logs. Of one save in several formats the one that keeps most is taken.

    Args:
        which: a folder, a glob (`logs/run_*.silo`), or the start of a file name. What triggers captured is only among
            them where nothing else is meant (`logs/*_overcurrent_*`); else a `LogWarning` says how many were left out.
        folder: where names are looked for.

    Returns:
        The logs, oldest first.

    Raises:
        LogNotFoundError: there is none.
    """
    paths = find_logs(file_path("which logs", which), file_path("folder", folder), warn_outside, captures=False)
    logs: dict[object, Log] = {}
    for path in paths:
        log = open_log(path)
        stretch = log.recording.stretch  # the parts of one are one log
        logs.setdefault(path if stretch is None or stretch.part else stretch.run, log)
    return list(logs.values())


def _of_files(parts: Sequence[Recording]) -> Recording:
    """The run of which these are the parts. Raises ElementError where they are of several, or of none."""
    stretches = [one.stretch for one in parts]
    if len(parts) > 1 and any(one is None or not one.is_beside(stretches[0]) for one in stretches):
        raise ElementError(
            "a list of files must be parts of one run that was cut, or of one recording of a run; silo.open_logs opens "
            "logs side by side"
        )
    return joined(parts) if len(parts) > 1 else parts[0]


def whole_run(path: Path, recording: Recording, *, check: bool = False) -> Recording:
    """Return all parts as one where a recording, read from `path`, is one of a run that was cut, or recorded; else it.

    The others are looked for beside it; what can't be read of them is told in its warnings. Raises LogNotFoundError
    where one of them can't be opened.
    """
    stretch = recording.stretch
    if stretch is None or not stretch.part:
        return recording
    found: dict[object, Recording] = {stretch.part: recording}
    unread: list[str] = []
    for other in _beside(path, stretch):
        try:
            one = read_recording(other, added_formats, check=check)
        except LogNotFoundError:
            if other.exists():  # else a budget deleted it just now
                raise
            continue
        except FileFormatError as error:  # it may be of another run
            unread.append(f"a file beside it is not among its parts, as it can't be read: {error}")
            continue
        its = one.stretch
        if its is None or not its.is_beside(stretch):
            continue
        if stretch.recorder:
            found[other] = one
        # of one that was saved more than once what has most
        elif one.offset > getattr(found.get(its.part), "offset", -1):
            found[its.part] = one
    whole = joined(list(found.values())) if len(found) > 1 else recording
    if isinstance(whole.warnings, DamageNotes):
        whole.warnings.extend(unread)
        return whole
    return replace(whole, warnings=(*whole.warnings, *unread)) if unread else whole


def alone_of(path: Path, recording: Recording) -> str:
    """What to tell who reads one part of several alone; empty where it is none, or of a recording none lies beside."""
    stretch = recording.stretch
    if stretch is None or not stretch.part:
        return ""
    others = sorted(_beside(path, stretch), key=_number)
    if stretch.recorder:  # parts of a run follow one another: two of thousands are looked at
        at = sum(_number(other) < _number(path) for other in others)
        others = others[max(0, at - 1) : at + 1]
    for other in others:
        with contextlib.suppress(LogNotFoundError, FileFormatError):
            if stretch.is_beside(read_recording(other, added_formats).stretch):
                return stretch.alone
    return "" if stretch.recorder else f"{stretch.text}; no other part of it lies beside this one"


def _number(part: Path) -> tuple[int, str]:
    """How parts of a recording follow one another, by their names."""
    return run_of(part), _stem(part)


def _stem(path: Path) -> str:
    return path.name.removesuffix(OPEN_PART_ENDING).removesuffix(path.suffix)


def _beside(path: Path, stretch: Stretch) -> list[Path]:
    """The files beside one that may be other parts of its run, by their names."""
    if path.is_dir() and not path.suffix and not (path / "metadata.yaml").is_file():
        path = next(path.glob("*.mcap"), path)  # the only one in its folder was read as a bag is
    endings = (*LOG_ENDINGS, OPEN_PART_ENDING)
    named = path.is_dir() or path.name.endswith(endings)  # those that are found by a folder; of others the same ending
    if not stretch.recorder:
        beside = find_logs(path.parent) if named else path.parent.glob(f"*{path.suffix}")
        return [other for other in beside if "_part" in other.stem and other != path]
    its = logger_of(_stem(path))
    found = [other for other in path.parent.iterdir() if other.name.endswith(endings if named else path.suffix)]
    # of one in several formats the file that keeps most
    found.sort(key=lambda other: endings.index(other.suffix) if other.suffix in endings else len(endings), reverse=True)
    best = {_stem(other): other for other in found if not its or logger_of(_stem(other)) == its}
    return [other for stem, other in best.items() if stem != _stem(path)]
