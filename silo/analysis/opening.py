"""`open_log` and `open_logs`: from what somebody calls a log to a `Log`.

    log = silo.open_log("anymal_2026", folder="logs")     # the newest whose name starts so; a path; or a run number
    bag = silo.open_log("rosbag2_2026_11_22")             # bags of others, by the stamps of the recorder or the headers

Nothing but the header is read before a signal is asked for; of JSON in bags all messages, as nothing else has the keys.
"""

import numbers
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from silo.analysis.compute.arithmetic import warn_outside
from silo.analysis.log import Log
from silo.analysis.stretches import joined
from silo.core.arguments import path as file_path
from silo.core.arguments import shown, switch, whole
from silo.core.calls import told
from silo.core.recording import Recording, has_own_stamps
from silo.errors import ElementError, LogNotFoundError
from silo.files.added import added_formats
from silo.files.formats import LOG_ENDINGS, read_recording
from silo.files.naming import find_log, find_logs

MOST_RUNS = 10**9

__all__ = ["open_log", "open_logs"]


@told("silo.open_log")
def open_log(
    which: str | os.PathLike[str] | int | Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str] = ".",
    *,
    stamps: Literal["log", "header"] = "log",
    alone: bool = False,
    check: bool = False,
) -> Log:
    """Open a saved log.

    Every format that silo reads (`silo.files.formats`); of a file with another ending, the first bytes tell. What a
    damaged file lacks is told by a `LogWarning` and in `log.warnings`; what is found when values are read, then.

    Bags that silo did not write (MCAP files, rosbag2 folders with MCAP or SQLite) are read topic by topic, and each
    topic has time stamps of its own: `log["/imu/angular_velocity/x"]`. Needs `pip install "silo-logger[bags]"`.

    Args:
        which: a path, the start of a file name (the newest such is meant), or a run number. A folder or a glob
            (`logs/*.silo`) means the newest run there; what a trigger captured has its own name, and where one is
            newer, a `LogWarning` says what was taken. `open_logs` opens all. Or a list of the parts of a run that was
            cut.
        folder: where names and run numbers are looked for.
        stamps: of bags of others, `"log"`: when a message was recorded, which rises and is of one clock; or `"header"`:
            the stamp in its header, when it was measured, where it has one. Logs of silo have those of their ticks.
        alone: of a run that was cut (`log.set(..., cut=True)`) this file only. Else all of its parts that lie beside
            one another are read as one log, with an event of kind `cut` where one goes on another.
        check: hold all values of a `.silo` against its checksums, as `silo verify` does; all of it is read. What isn't
            as it was written is told by a `LogWarning` and in `log.warnings`.

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
    if isinstance(which, list | tuple) and len(which) > 1:
        return _of_files([open_log(one, folder, stamps=stamps, alone=True, check=check) for one in which])
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
    if not switch("alone", alone):
        recording = whole_run(path, recording, check=check)
    for warning in recording.warnings:
        warn_outside(f"{path}: {warning}")
    return Log(recording, os.fspath(path))


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


def _of_files(logs: Sequence[Log]) -> Log:
    """The run of which logs are the parts. Raises ElementError where they are of several, or of none."""
    stretches = [log.recording.stretch for log in logs]
    runs = {one.run if one is not None and one.part else "" for one in stretches}
    if len(runs) != 1 or "" in runs:
        raise ElementError(
            "a list of files must be parts of one run that was cut; silo.open_logs opens logs side by side"
        )
    return Log(joined([log.recording for log in logs]), logs[0].path)


def whole_run(path: Path, recording: Recording, *, check: bool = False) -> Recording:
    """Return all stretches as one where a recording, read from `path`, is one of a run that was cut; else itself.

    The others are looked for beside it. Raises FileFormatError where one of them can't be read.
    """
    stretch = recording.stretch
    if stretch is None or not stretch.part:
        return recording
    found = {stretch.part: recording}
    named = path.is_dir() or path.suffix in LOG_ENDINGS  # those that are found by a folder; of others the same ending
    beside = find_logs(path.parent) if named else path.parent.glob(f"*{path.suffix}")
    for other in [other for other in beside if "_part" in other.stem and other != path]:
        one = read_recording(other, added_formats, check=check)
        its = one.stretch
        # of one that was saved more than once what has most
        if its and its.part and its.run == stretch.run and one.offset > getattr(found.get(its.part), "offset", -1):
            found[its.part] = one
    return joined(list(found.values())) if len(found) > 1 else recording
