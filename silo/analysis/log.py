"""`open_log`: any log that silo reads, as a mapping from names to signals.

    log = silo.open_log("anymal_2026", folder="logs")     # the newest whose name starts so; a path; or a run number
    torque = log["/log/joints/tau"]
    torque.average(2.0, 3.5)

Nothing but the header is read before a signal is asked for.
"""

import difflib
import math
import numbers
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.expressions import RecordingJudge
from silo.analysis.shapes import assembled, component_names
from silo.analysis.signals import Signal
from silo.arguments import path as file_path
from silo.arguments import shown, text, whole
from silo.errors import ElementError
from silo.files.formats import read_recording
from silo.files.naming import find_log
from silo.files.silo_whole import FileElements
from silo.kinds import SCALAR
from silo.model import NO_EXTRAS
from silo.recording import RecordedElement, RecordedEntry, Recording

MOST_RUNS = 10**9

__all__ = ["Log", "LogWarning", "Signal", "UnknownSignalError", "open_log"]


class LogWarning(UserWarning):
    """A log is damaged, cut off, or not complete; the text says what is missing."""


class UnknownSignalError(ElementError, KeyError):
    """The log has no signal of that name."""

    def __str__(self) -> str:
        return str(self.args[0])


def open_log(which: str | os.PathLike[str] | int, folder: str | os.PathLike[str] = ".") -> "Log":
    """Open a log by path, by the start of its file name (the newest such in `folder`), or by run number.

    Every format that silo reads (`silo.files.formats`); of a file with another ending, the first bytes tell.
    What a damaged file lacks is told by a `LogWarning` and in `log.warnings`. Raises `LogNotFoundError`,
    `FileFormatError`.
    """
    if not isinstance(which, str | bytes | os.PathLike):
        if not isinstance(which, numbers.Integral):
            raise ElementError(
                f"which log must be a path, the start of a file name or a run number, got {shown(which)}; write "
                "silo.open_log('logs/robot_2026')"
            )
        which = whole("a run number", which, 0, MOST_RUNS)
    path = find_log(which if isinstance(which, int) else file_path("which log", which), file_path("folder", folder))
    recording = read_recording(path)
    for warning in recording.warnings:
        warnings.warn(f"{path}: {warning}", LogWarning, stacklevel=2)
    return Log(recording, os.fspath(path))


class Log(Mapping[str, Signal]):
    """A recorded log: names of elements -> signals.

    Indexing takes the name of an element (`/log/imu/acc`, also without its prefix: `imu/acc`), of one of its scalars
    (`/log/imu/acc_x`) or of a derived signal, which is computed then; iteration gives elements and derived signals.
    `recording` is what any writer takes.
    """

    def __init__(self, recording: Recording, path: str = "") -> None:
        if not isinstance(recording, Recording):
            raise ElementError(f"Log takes a Recording, got {shown(recording)}; open files by silo.open_log(...)")
        self.recording = recording
        self.path = path
        self._elements: dict[str, int] = {}
        for place, name in enumerate(_names(recording.elements)):
            self._elements[_unused(name, self._elements)] = place
        # an element of the same name stands for itself
        self._derived = [one.name for one in recording.extras.derived if one.name not in self._elements]

    @cached_property
    def _entries(self) -> dict[str, tuple[RecordedElement, RecordedEntry]]:
        # made only for who asks for a scalar of an element, or for a name that is not there
        found: dict[str, tuple[RecordedElement, RecordedEntry]] = {}
        for element in self.recording.elements:
            for entry in element.entries:
                found.setdefault(entry.name, (element, entry))
        return found

    # ------------------------------------------------------------------------------------------------------- mapping

    def __getitem__(self, name: str) -> Signal:
        if not isinstance(name, str):
            raise UnknownSignalError(
                f"a signal is named by a text, got {shown(name)} ({type(name).__name__}); list(log) has all names"
            )
        for key in self._keys(name):
            if key in self._elements:
                return self._signal(key, self.recording.elements[self._elements[key]])
            if key in self._entries:
                element, entry = self._entries[key]
                return self._signal(key, replace(element, name=key, kind=SCALAR.name, shape=(), entries=(entry,)))
            if key in self._derived:
                return self._evaluated(f"`{key}`", key)
        near = difflib.get_close_matches(name, [*self._elements, *self._entries, *self._derived], 3, 0.5)
        near = near or [key for key in self._elements if name.lower() in key.lower()][:3]
        hint = f"; did you mean {', '.join(near)}?" if near else f"; it has {len(self)} elements, see list(log)"
        raise UnknownSignalError(f"the log has no signal '{name}'{hint}")

    def __contains__(self, name: object) -> bool:
        known = self._keys(name) if isinstance(name, str) else ()
        return any(key in self._elements or key in self._entries or key in self._derived for key in known)

    def __iter__(self) -> Iterator[str]:
        yield from self._elements
        yield from self._derived

    def __len__(self) -> int:
        return len(self._elements) + len(self._derived)

    def __repr__(self) -> str:
        return f"<Log {self.path or self.recording.logger}: {len(self)} elements, {self.duration_s:.6g} s>"

    def names(self, pattern: str = "*") -> list[str]:
        """Names of the elements that match a pattern with `*`, `?` and `[...]`, in the order of the file."""
        text("pattern", pattern, "log.names('/log/joints/*')")
        prefixed = f"{self.recording.prefix}/{pattern.lstrip('/')}"
        return [name for name in self if fnmatchcase(name, pattern) or fnmatchcase(name, prefixed)]

    def glob(self, pattern: str) -> list[Signal]:
        """The signals whose names match a pattern."""
        return [self[name] for name in self.names(pattern)]

    def namespace(self, name: str) -> "Log":
        """The part of the log below a namespace: `log.namespace("/log/joints")`. May be empty."""
        bare = text("name", name, "log.namespace('/log/joints')").strip("/")
        starts = (f"/{bare}/", f"{bare}/", f"{self.recording.prefix}/{bare}/")
        kept = [element for element in self.recording.elements if element.name.startswith(starts)] if bare else None
        elements = self.recording.elements if kept is None else kept
        # what is derived may need signals that are left out
        extras = self.recording.extras if kept is None else NO_EXTRAS
        return Log(replace(self.recording, elements=elements, extras=extras), self.path)

    def eval(self, expression: str) -> Signal:
        """The signal that an expression gives: `log.eval("abs(joints/tau_3) > 20 and controller/mode == STANCE")`.

        It has a value at every tick where one of its signals has a sample, the others hold; it is bool where it is a
        condition. Ticks at which it can't be told (a signal has no sample yet, or its buffer had ended) are left out.
        Raises `ExpressionError`, which shows the place.
        """
        text("expression", expression, "log.eval('abs(joints/tau_3) > 20')")
        return self._evaluated(expression, expression)

    def _evaluated(self, expression: str, name: str) -> Signal:
        found = self._judge.evaluate(expression)
        dividers = set(found.bound.sources.values())
        return Signal(
            name=name,
            values=found.values,
            time_ns=found.time_ns,
            unit=found.bound.unit,
            kind="array" if found.bound.width else "scalar",
            divider=math.gcd(*dividers),
            start_ns=self.start_ns,
            components=tuple(map(str, range(found.bound.width))),
            labels={} if found.bound.logical else found.bound.labels,
        )

    @cached_property
    def _judge(self) -> RecordingJudge:
        return RecordingJudge(self.recording)

    # ---------------------------------------------------------------------------------------------------------- facts

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Shape `(n,)`: the time stamps of all kept ticks."""
        return self.recording.time_ns

    @property
    def times(self) -> NDArray[np.float64]:
        """Shape `(n,)`: the same in seconds since the first."""
        return (self.time_ns - self.start_ns).astype(np.float64) * 1e-9

    @property
    def start_ns(self) -> int:
        """The first time stamp, from which all times count."""
        return int(self.time_ns[0]) if len(self.time_ns) else 0

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last time stamp."""
        return float(self.time_ns[-1] - self.time_ns[0]) * 1e-9 if len(self.time_ns) else 0.0

    @property
    def warnings(self) -> Sequence[str]:
        """What is missing, damaged, or could not be read when it was logged."""
        return self.recording.warnings

    # --------------------------------------------------------------------------------------------------------- tables

    def to_pandas(self, pattern: str = "*") -> Any:
        """A pandas DataFrame: one row per tick, one column per scalar, missing where there is no sample."""
        from silo.analysis.exports import log_to_pandas

        return log_to_pandas({name: self[name] for name in self.names(pattern)}, self.time_ns)

    def to_polars(self, pattern: str = "*") -> Any:
        """A polars DataFrame: `time`, then one column per scalar, null where there is no sample."""
        from silo.analysis.exports import log_to_polars

        return log_to_polars({name: self[name] for name in self.names(pattern)}, self.time_ns)

    def to_xarray(self, pattern: str = "*") -> Any:
        """An xarray Dataset with one variable per element."""
        from silo.analysis.exports import log_to_xarray

        return log_to_xarray({name: self[name] for name in self.names(pattern)}, self.time_ns)

    def _keys(self, name: str) -> tuple[str, str]:
        return name, f"{self.recording.prefix}/{name.lstrip('/')}"

    def _signal(self, name: str, element: RecordedElement) -> Signal:
        count = element.count
        stop = element.first + (count - 1) * element.divider + 1 if count else element.first
        entries = element.entries
        labels = entries[0].entry.labels if len({repr(entry.entry.labels) for entry in entries}) == 1 else None
        return Signal(
            name=name,
            values=assembled(element),
            time_ns=self.time_ns[element.first : stop : element.divider],
            unit=element.unit,
            kind=element.kind,
            divider=element.divider,
            start_ns=self.start_ns,
            components=component_names(element),
            labels=labels or {},
            description=element.description,
            failures=element.failures,
        )


def _names(elements: Sequence[RecordedElement]) -> list[str]:
    return elements.names if isinstance(elements, FileElements) else [element.name for element in elements]


def _unused(name: str, taken: Mapping[str, object]) -> str:
    number = 1
    unique = name
    while unique in taken:
        number += 1
        unique = f"{name}#{number}"
    return unique
