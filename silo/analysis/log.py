"""`Log`: a log as a mapping from names to signals, with its parts, tables and plots.

log = silo.open_log("anymal_2026", folder="logs")
torque = log["/log/joints/tau"]
torque.mean(2.0, 3.5)
"""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from silo.analysis.compute import exports
from silo.analysis.compute.arithmetic import warn_outside
from silo.analysis.compute.responses import Bode, StepResponse
from silo.analysis.compute.run_starts import moved_ns, run_start
from silo.analysis.compute.samples import is_rate, unfolded_ticks
from silo.analysis.compute.shapes import assembled, component_names
from silo.analysis.lookup import names_of
from silo.analysis.parameters import LoggedParameters, parameters_of
from silo.analysis.plots.events import LogEvent, episodes_of, events_of
from silo.analysis.responses import bode_between, step_between
from silo.analysis.signal import Signal
from silo.analysis.stretches import clipped, clipped_to_ticks, holes, off_ticks, resampled, resampled_by_ticks
from silo.core.arguments import INT64, real, shown, switch, text
from silo.core.arguments import path as file_path
from silo.core.calls import no_attribute, told_class
from silo.core.conditions import NO_CONDITIONS
from silo.core.episodes.words import Episode
from silo.core.kinds import SCALAR
from silo.core.names import did_you_mean, is_glob
from silo.core.parameter_images import NOT_KNOWN
from silo.core.quantities.writing import html_table, many
from silo.core.recording import (
    RecordedElement,
    Recording,
    common_axis,
    distinct,
    falls,
    has_own_stamps,
    lasted_s,
    read_ahead,
    rises,
    stamps_of,
    ticks_of,
)
from silo.core.structs import alike
from silo.errors import ArgumentError, ElementError, SaveError, UnknownSignalError
from silo.expressions.derived_samples import NOTHING_IN_COMMON, computable
from silo.expressions.over_recordings import RecordingJudge, narrowed
from silo.files.added import added_formats
from silo.files.atomic import check_folder
from silo.files.formats import format_of, with_rounding_told, writer_for

# what others call it
_OTHER_NAMES = {
    "element": "it is log['q']",
    "signals": "list(log) has the names, log['/log/x'] is one of them, log.glob('*') are all",
    "columns": "list(log) has the names",
    "head": "it is log.to_pandas().head()",
    "describe": "it is log.to_pandas().describe(), or `silo stats FILE`",
    "shape": "log['/log/x'].shape is that of a signal, len(log) counts them",
    "mean": "it is of a signal: log['/log/x'].mean()",
    "max": "it is of a signal: log['/log/x'].max()",
    "min": "it is of a signal: log['/log/x'].min()",
    "std": "it is of a signal: log['/log/x'].std()",
    "close": "nothing is to be closed: a log is a value",
    "filter": "log.names('joints/*') and log.glob('joints/*') choose, log.namespace('joints') is that part of the log",
    "topics": "list(log) has the names of all signals",
    "time": "it is .times (seconds since start) or .time_ns",
    "duration": "it is .duration_s",
    "elements": "list(log) has the names, log['/log/x'] is one of them",
    "frequency": "it is log.recording.frequency_hz",
    "to_csv": "it is log.save('x.csv')",
    "to_parquet": "it is log.save('x.parquet')",
    "to_mat": "it is log.save('x.mat')",
    "to_numpy": "it is log['/log/x'].values, or log.to_pandas()",
    "df": "it is log.to_pandas()",
    "dataframe": "it is log.to_pandas()",
    "t": "it is .times (seconds since start) or .time_ns",
    "start_time": "it is log.recording.started_ns",
    "rate": "it is log.recording.frequency_hz",
    "metadata": "it is log.recording, and log.recording.about",
    "info": "it is log.recording, or `silo info FILE`",
    "about": "it is log.recording.about",
    "marks": "it is log.events",
    "export": "it is log.save('x.csv')",
    "query": "it is log.eval('x > 1'); SQL is of silo.runs('logs').sql(...)",
}


@told_class("log", make="silo.Log")
class Log(Mapping[str, Signal]):
    """A recorded log: names of elements -> signals.

    Indexing takes the name of an element (`/log/imu/acc`, also without its prefix: `imu/acc`), of one of its scalars
    (`/log/imu/acc_x`) or of a derived signal, which is computed then; iteration gives elements and derived signals.
    `recording` is what any writer takes.
    """

    def __init__(self, recording: Recording, path: str = "", start_ns: int | None = None) -> None:
        """Make a log of a recording; files are opened by `silo.open_log`.

        Args:
            recording: the samples.
            path: the file they are from, to be shown.
            start_ns: where times count from; the first time stamp if not given.

        Raises:
            ElementError: it is no recording.
        """
        if not isinstance(recording, Recording):
            raise ElementError(f"Log takes a Recording, got {shown(recording)}; open files by silo.open_log(...)")
        self.recording = recording
        self.path = path
        self._start_ns = start_ns
        self._began = run_start(recording) if start_ns is None else None
        elements = names_of(recording)
        # an element of the same name stands for itself
        defined = [one.name for one in recording.conditions.derived if one.name not in elements.places]
        told = computable(self._judge) if defined else {}
        self._elements = elements.names
        self._derived = [name for name in defined if not told[name]]
        self._blind = {name: told[name] for name in defined if told[name]}  # what they need isn't in the log
        self._names = names_of(recording, [*self._derived, *self._blind]) if defined else elements

    # ------------------------------------------------------------------------------------------------------- mapping

    def __getitem__(self, name: str) -> Signal:
        if not isinstance(name, str):
            several = isinstance(name, list | tuple) and all(isinstance(one, str) for one in name)
            way_out = f"[log[name] for name in {shown(name)}] are several" if several else "list(log) has all names"
            raise UnknownSignalError(
                f"a signal is named by a text, got {shown(name)} ({type(name).__name__}); {way_out}"
            )
        found = self._names.find(name, scalars=True, namespaces=False)
        if len(found) > 1:
            raise UnknownSignalError(
                f"{self._names.several(name, found)}; log.glob({name!r}) are all signals that match"
            )
        if not found:
            raise UnknownSignalError(f"the log has no signal '{name}'{self._hint(name)}")
        place, index = found[0]
        key = self._names.name(found[0])
        if self._blind.get(key) == NOTHING_IN_COMMON:
            raise UnknownSignalError(f"'{key}' is derived, and can't be computed of this log: {NOTHING_IN_COMMON}")
        if place >= len(self._elements):
            return self._evaluated(f"`{key}`", key)
        element = self.recording.elements[place]
        if index is None:
            return self._signal(key, element)
        entry = element.entries[index]
        return self._signal(key, replace(element, name=key, kind=SCALAR.name, shape=(), entries=(entry,)))

    def __setitem__(self, name: str, values: object) -> NoReturn:
        raise ArgumentError(
            f"a log is only read, log[{name!r}] can't be set or deleted: keep what you compute in a variable, {name} = "
            "log['x'] * 2, or add a column to log.to_pandas()"
        )

    def __delitem__(self, name: str) -> NoReturn:
        self.__setitem__(name, None)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if dtype is not None and np.dtype(dtype) == object:
            one = np.empty((), object)
            one[()] = self
            return one
        raise ArgumentError(
            "a log is no array: log.to_pandas() is a table of all signals, log['/log/x'].values an array"
        )

    def __array_ufunc__(self, ufunc: np.ufunc, *_: object, **__: object) -> object:
        # an array is no log, and no part of one
        return ufunc is np.not_equal if ufunc in (np.equal, np.not_equal) else self.__array__()

    def __enter__(self) -> "Log":
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: a log is a value, nothing is to be closed."""

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str):
            return False
        return len(found := self._names.find(name, scalars=True, namespaces=False)) == 1 and found[0][0] < len(self)

    def _hint(self, name: str) -> str:
        """What is said of a name that there isn't."""
        if inside := self._names.find(name):
            return f"; it is a namespace of {len(inside)}: log.namespace({name!r}), log.glob({name!r})"
        return did_you_mean(self._names.near(name, scalars=True), f"it has {len(self)} elements, see list(log)")

    def __iter__(self) -> Iterator[str]:
        yield from self._elements
        yield from self._derived

    def __len__(self) -> int:
        return len(self._elements) + len(self._derived)

    def __repr__(self) -> str:
        return f"<Log {self.path or self.recording.logger}: {len(self)} elements, {self.duration_s:.6g} s>"

    def _repr_html_(self) -> str:
        rows: list[tuple[object, ...]] = [
            (name, element.unit, element.kind, element.count, element.divider, element.lost or "")
            for name, element in zip(self._elements, self.recording.elements, strict=True)
        ]
        rows += [
            (one.name, one.unit, one.kind, len(one), one.divider, "") for one in map(self.__getitem__, self._derived)
        ]
        return html_table(repr(self)[1:-1], ("element", "unit", "kind", "samples", "divider", "lost"), rows)

    def _ipython_key_completions_(self) -> list[str]:
        """What `log["<TAB>` offers: the names, and what they are without the prefix."""
        prefix = f"{self.recording.prefix.rstrip('/')}/"
        return [key for name in self for key in dict.fromkeys((name.removeprefix(prefix), name))]

    @property
    def name(self) -> str:
        """The name of the logger that logged it."""
        return self.recording.logger

    if not TYPE_CHECKING:  # type checkers know which names there are

        def __getattr__(self, name: str) -> object:
            known = not name.startswith("_") and name in self
            others = {name: f"the signal is log['{name}']"} if known else _OTHER_NAMES
            return no_attribute("a log", name, type(self), others)

    def names(self, pattern: str = "*") -> list[str]:
        """Return names of elements, in the order of the file. Where there are none, a warning has names alike.

        Args:
            pattern: a name as `log[...]` takes it, the end of one behind a `/`, a namespace, or a glob with `*`, `?`
                and `[...]`; with or without the prefix.
        """
        text("pattern", pattern, "log.names('/log/joints/*')")
        found = self._named(pattern)
        if not found and (len(self) or pattern != "*"):
            warn_outside(f"the log has no signal that '{pattern}' means{self._hint(pattern)}; this will be an error")
        return found

    def _named(self, pattern: str) -> list[str]:
        found = self._names.find(pattern, scalars=True)
        if is_glob(pattern) and (before := self._names.whole(pattern)) and before != found:
            warn_outside(
                f"'{pattern}' means {len(before)} signals here, and behind every '/' from the next release on "
                f"({len(found)} of this log): write '{self._names.keys(pattern)[1]}' for the former"
            )
            found = before
        return [self._names.name(one) for one in found if one[0] < len(self)]

    def glob(self, pattern: str) -> list[Signal]:
        """Return the signals whose names match a pattern.

        Args:
            pattern: with `*`, `?` and `[...]`, with or without the prefix.
        """
        return [self[name] for name in self.names(pattern)]

    def namespace(self, name: str) -> "Log":
        """Return the part of the log below a namespace: `log.namespace("/log/joints")`. May be empty.

        Args:
            name: the namespace, with or without the prefix.
        """
        bare = text("name", name, "log.namespace('/log/joints')").strip("/")
        starts = (f"/{bare}/", f"{bare}/", f"{self.recording.prefix}/{bare}/")
        kept = [element for element in self.recording.elements if element.name.startswith(starts)] if bare else None
        elements = self.recording.elements if kept is None else kept
        # what is derived may need signals that are left out
        conditions = self.recording.conditions if kept is None else NO_CONDITIONS
        return self._of(replace(self.recording, elements=elements, conditions=conditions))

    def _of(self, recording: Recording) -> "Log":
        """A log of what was made of this one: its times count from where they did, and its run began when it did."""
        made = Log(recording, self.path, self.start_ns)
        made._began = self._began
        return made

    # ----------------------------------------------------------------------------------------------- parts, other times

    def clip(self, start_s: float | Episode | None = None, stop_s: float | None = None) -> "Log":
        """Return the part of the log from `start_s` to `stop_s`, both included, or the part that is an episode.

        Times go on counting from the start of the whole log.

        Args:
            start_s: seconds since start; None: from the first tick. Or one of `log.episodes`: its ticks are meant, also
                where the clock of a simulation begins anew with each of them.
            stop_s: seconds since start; None: to the last tick.

        Raises:
            ElementError: there is no tick between them.
        """
        if isinstance(start_s, Episode):
            return self._of_episode(start_s, stop_s)
        low, high = (self._bound(*each) for each in (("start_s", start_s, 0), ("stop_s", stop_s, 1)))
        made = clipped(self.recording, low, high)
        if not len(made.time_ns) and len(self.time_ns):
            raise ElementError(
                f"the log has no tick from {'its start' if start_s is None else f'{start_s:g} s'} to "
                f"{'its end' if stop_s is None else f'{stop_s:g} s'}; it goes from 0 to {self.duration_s:g} s"
            )
        if falls(made.time_ns) and len(self.episodes) > 1:
            warn_outside(
                "the clock stepped back: that is every tick with such a time, maybe of several episodes; "
                "log.clip(log.episodes[0]) is one of them"
            )
        return self._of(made)

    def _of_episode(self, episode: Episode, stop_s: object = None, *, known: bool = False) -> "Log":
        """The part that is an episode; with what was `known` when it began."""
        if stop_s is not None:
            raise ElementError("an episode has its end: log.clip(episode), or log.clip(start_s, stop_s)")
        made = clipped_to_ticks(self.recording, episode.first, episode.last, known=known)
        if not len(made.time_ns):
            ticks = f"tick {episode.first} to {episode.last}"
            raise ElementError(f"the log has no tick of episode '{episode.name}', which goes from {ticks}")
        return self._of(made)

    def _bound(self, argument: str, given: float | None, end: int) -> int:
        if given is None:
            return INT64[end]
        return self.start_ns + round(_seconds(argument, given) * 1e9)

    def resample(self, times: "Signal | ArrayLike | float", method: Literal["hold", "linear"] = "hold") -> "Log":
        """Return the log with every element at the same times.

        Args:
            times: a rate in Hz, seconds since start, or a signal, whose times are meant.
            method: `"hold"` takes the value that held; `"linear"` goes straight from sample to sample: of floats,
                quaternions and poses turn on the shortest way; all others hold. Of an element that a cut had switched
                off for a while, and of a recording of which a part is missing, nothing holds then: NaN stands there, or
                a sample is missing.

        Raises:
            ElementError: an unknown method, or times that are none.
        """
        if method not in ("hold", "linear"):
            raise ElementError(f"unknown method {method!r} to resample a log: choose 'hold' or 'linear'")
        axis = self.recording.time_ns
        ticks = Signal(
            name="the log", values=axis, time_ns=axis, start_ns=self.start_ns, axis_ns=axis, _began=self._began
        )
        by_ticks = times.axis_ns is axis if isinstance(times, Signal) else is_rate(times)
        if falls(axis) and by_ticks:
            ticks = replace(ticks, _at=np.arange(len(axis)))
            fold = unfolded_ticks(axis, even=isinstance(times, Signal))
            risen, at = fold.risen(ticks), fold.risen(times) if isinstance(times, Signal) else times
            if risen is not None and at is not None:
                stamps = distinct(risen.resample(at).time_ns)
                return self._of(resampled_by_ticks(self.recording, fold, stamps, method == "linear"))
        time_ns = ticks.resample(times).time_ns
        return self._of(resampled(self.recording, distinct(time_ns), method == "linear"))

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the log to a file.

        Args:
            path: its ending says the format (`silo convert --help` lists them).
            overwrite: replace a file that is there.

        Returns:
            The path.

        Raises:
            SaveError: no format has this ending, the file is there already, or the system refuses.
        """
        target = file_path("path", path)
        write = writer_for(target, added_formats)
        if target.is_dir():
            raise SaveError(f"'{target}' is a folder: it is not replaced; choose another name")
        if target.exists() and not switch("overwrite", overwrite):
            raise SaveError(f"'{target}' exists already; write overwrite=True to replace it, or another name")
        check_folder(target)
        told = with_rounding_told(self.recording, format_of(target))
        for words in told.warnings[len(self.recording.warnings) :]:
            warn_outside(words)
        write(told, target, None)
        return target

    def plot(
        self,
        *patterns: str,
        right: Sequence[str] = (),
        x: str | None = None,
        start_s: float | None = None,
        stop_s: float | None = None,
        ax: Any = None,
        path: str | os.PathLike[str] | None = None,
        terminal: bool | None = None,
        title: str = "",
    ) -> Any:
        """Plot signals: `log.plot("joints/q_*", right=["joints/tau_0"])`.

        Args:
            *patterns: names or patterns of signals.
            right: those on the axis on the right.
            x: a signal instead of time.
            start_s: seconds since start.
            stop_s: seconds since start.
            ax: axes of matplotlib to draw on.
            path: a PNG file to write.
            terminal: print it as text; by default where there is no matplotlib, or no screen.
            title: what stands above; the file's name if it is left out.

        Returns:
            The axes, the path, or None for a terminal.

        Raises:
            ElementError: a pattern matches nothing, or there is no sample.
        """
        from silo.analysis.plots.charts import MOST_CURVES, ChartSpec, make_chart
        from silo.analysis.plots.showing import show

        if not patterns:
            raise ElementError(
                f"say what to plot: log.plot('/log/joints/*'); it has {len(self)} elements, see list(log)"
            )
        for pattern in patterns:
            text("pattern", pattern, "log.plot('/log/joints/*')")
        if isinstance(right, str):
            right = [right]
        offset_s = (int(self.time_ns[0]) - self.start_ns) * 1e-9 if len(self.time_ns) else 0.0
        bounds = (("start_s", start_s), ("stop_s", stop_s))
        window = [None if bound is None else _seconds(name, bound) - offset_s for name, bound in bounds]
        spec = ChartSpec(list(patterns), list(right), x, "", window[0], window[1], MOST_CURVES)
        chart, left_out = make_chart(self.recording, spec, title or os.path.basename(self.path))  # noqa: PTH119
        if left_out:
            warn_outside(f"not drawn: {many(left_out, 'more signal')} of these patterns")
        return show(chart, ax, path, terminal)

    def bode(
        self,
        input: str,  # noqa: A002  # as everybody calls it
        output: str,
        start_s: float | None = None,
        stop_s: float | None = None,
        *,
        segment_s: float | None = None,
    ) -> Bode:
        """Return the transfer function from one signal to another: `hz, db, deg, coherence = run.bode("tau", "q")`.

        Welch's H1 estimate. Without times it is that of the last excitation of the input that has a band (a step has
        none), else of the whole log; which of several is told by a `LogWarning`. Where the coherence is well below 1,
        noise, something else or what is not linear moves the output.

        Args:
            input: what was moved.
            output: what answered.
            start_s: seconds since start.
            stop_s: seconds since start.
            segment_s: how long a window is; a third of it all if it is left out. Longer ones tell closer frequencies
                apart, more of them average noise.

        Returns:
            Frequencies in Hz at which the input has power, magnitude in dB, phase in degrees, coherence 0 to 1.

        Raises:
            ElementError: too few samples, a hole, no power in the input, signals of several components, or an input
                that was excited by steps alone.
        """
        return bode_between(self, input, output, start_s, stop_s, segment_s)

    def step(
        self,
        input: str,  # noqa: A002  # as everybody calls it
        output: str,
        start_s: float | None = None,
        stop_s: float | None = None,
    ) -> StepResponse:
        """Return how a signal answers to the largest step of another: rise time, overshoot, gain.

        Without times it is that of the last excitation of the input by a step, else of the whole log.

        Args:
            input: what jumped.
            output: what answered.
            start_s: seconds since start.
            stop_s: seconds since start.

        Returns:
            `rise_s` from 10 to 90 %, `overshoot` as a share, `settled_s`, `gain`, and the course of it.

        Raises:
            ElementError: the input has no step, or signals of several components.
        """
        return step_between(self, input, output, start_s, stop_s)

    def eval(self, expression: str) -> Signal:
        """Return the signal that an expression gives: `log.eval("abs(joints/tau_3) > 20 and mode == STANCE")`.

        It has a value at every tick that the rates of its signals have in common (of every third tick and every second:
        every tick), where they hold, as derived signals have. It is bool where it is a condition, int64 (or uint64)
        where it is a sum or product of integers. Ticks at which it can't be told (a signal has no sample yet, or its
        buffer had ended) are left out.

        Args:
            expression: signals, numbers, operators and functions.

        Raises:
            ExpressionError: it makes no sense; the message shows the place.
        """
        text("expression", expression, "log.eval('abs(joints/tau_3) > 20')")
        return self._evaluated(expression, expression, exact=True)

    @cached_property
    def _rises(self) -> bool:
        """Whether stamps alone tell when ticks were; looked at once for all signals."""
        return rises(self.recording.time_ns)

    def _evaluated(self, expression: str, name: str, *, exact: bool = False) -> Signal:
        recording = narrowed(self.recording, [expression])  # of a bag of others, no more than the expression needs
        judge = self._judge if recording is self.recording else RecordingJudge(recording)
        found = judge.evaluate(expression, whole=exact)  # derived signals are float64 wherever they are read
        dividers = set(found.bound.sources.values())
        axis = None if self._rises else self.recording.time_ns
        return Signal(
            name=name,
            values=found.values,
            time_ns=found.time_ns,
            unit=found.bound.unit,
            kind="array" if found.bound.width else "scalar",
            divider=math.gcd(*dividers),
            start_ns=self.start_ns,
            _began=self._began,
            axis_ns=axis,
            _at=None if axis is None else found.ticks,
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
        """Shape `(n,)`: the same in seconds since the first of the file."""
        return (self.time_ns - self.start_ns).astype(np.float64) * 1e-9

    @property
    def start_ns(self) -> int:
        """The first time stamp of the file, from which all times count (of a clipped log, that of the whole).

        Not where the run began, where its buffers looped: that is `run_start_ns`.

        Of a log without a tick, the wall clock at its start.
        """
        if self._start_ns is not None:
            return self._start_ns
        return int(self.time_ns[0]) if len(self.time_ns) else self.recording.started_ns

    @property
    def run_start_ns(self) -> int | None:
        """The time stamp at which the run began, on which it meets others; None where its file doesn't tell.

        Where buffers that loop hold no more of it than the end, it is counted back by the ticks before.
        """
        return None if self._began is None else self._began.stamp_ns

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last time stamp; where the clock stepped back, those that passed in between."""
        return lasted_s(self.time_ns)

    @cached_property
    def parameters(self) -> LoggedParameters:
        """What was tuned: `log.parameters.at(12.5)` are all values then, `log.parameters.changes` who changed what."""
        return parameters_of(self.recording, self.start_ns)

    @property
    def events(self) -> list[LogEvent]:
        """What happened, in the order of time: marks, starts, stops, edits, triggers, losses, saves, and who did it."""
        return events_of(self.recording, self.start_ns)

    @property
    def episodes(self) -> list[Episode]:
        """What `log.episode("pick")` marked, in the order of time: `log.clip(one)` is its part."""
        return episodes_of(self.recording, self.start_ns)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is missing, damaged, or could not be read when it was logged; of a bag, as far as values were read."""
        told = (text for text in self.recording.warnings if not text.startswith(NOT_KNOWN))  # in a part other times are
        return (*told, *self.parameters.warnings)

    # --------------------------------------------------------------------------------------------------------- tables

    def to_pandas(self, pattern: str = "*") -> Any:
        """Return a pandas DataFrame: one row per tick, one column per scalar, missing where there is no sample.

        Its index are times in UTC without a zone, as pandas has them by itself: `frame.tz_localize("UTC")` gives them
        theirs, to join with a Parquet file, whose column `time` has it.

        Args:
            pattern: which elements, with `*`, `?` and `[...]`.
        """
        return exports.log_to_pandas(*self._table(pattern))

    def to_polars(self, pattern: str = "*") -> Any:
        """Return a polars DataFrame: `time`, then one column per scalar, null where there is no sample.

        Args:
            pattern: which elements, with `*`, `?` and `[...]`.
        """
        return exports.log_to_polars(*self._table(pattern))

    def to_xarray(self, pattern: str = "*") -> Any:
        """Return an xarray Dataset with one variable per element.

        Args:
            pattern: which elements, with `*`, `?` and `[...]`.
        """
        return exports.log_to_xarray(*self._table(pattern))

    def _table(self, pattern: str) -> tuple[dict[str, Signal], NDArray[np.int64]]:
        """Return signals, and the stamps of the rows of a table of them: the ticks, or all stamps that they have."""
        names = self.names(pattern)
        wanted = set(names)
        read_ahead(self.recording.elements[place] for place, name in enumerate(self._elements) if name in wanted)
        signals = {name: self[name] for name in names}
        # what a cut changed has stamps of its own, too, but ticks are rows of the table whichever elements are in it
        own = has_own_stamps(self.recording) and not any(element.holds for element in self.recording.elements)
        return signals, common_axis([one.time_ns for one in signals.values()]) if own else self.time_ns

    def _signal(self, name: str, element: RecordedElement) -> Signal:
        entries = element.entries
        labels = [entry.entry.labels for entry in entries]
        alone = len({repr(each) for each in labels}) == 1
        names = component_names(element)
        return alike(
            Signal,
            element,
            name=name,
            values=assembled(element),
            time_ns=stamps_of(self.recording, element),
            **time_facts(self, element),
            start_ns=self.start_ns,
            _began=self._began,
            components=names,
            labels=(labels[0] if alone else None) or {},
            component_labels={} if alone else {name: each for name, each in zip(names, labels, strict=True) if each},
        )


def time_facts(log: Log, element: RecordedElement) -> dict[str, Any]:
    """What `Samples` of an element of a log know of when they are, beside their stamps."""
    recording = log.recording
    ticks = element.own_ns is None or bool(element.holds)
    facts: dict[str, Any] = {"axis_ns": recording.time_ns if ticks else None, "divider": element.divider}
    facts["_holes"] = holes(recording, element)
    if ticks and not log._rises:
        facts |= {"_at": ticks_of(recording.time_ns, element), "_off": off_ticks(recording, element)}
    return facts


def run_begins(logs: Sequence[Log]) -> list[int]:
    """Return which stamps of some logs are the same time since the starts of their runs: of the first one its start."""
    first, known = logs[0], all(log._began is not None and not log._began.capture for log in logs)
    zero_ns = first._began.stamp_ns if known and first._began is not None else first.start_ns
    return [zero_ns - moved_ns(first.start_ns, first._began, log.start_ns, log._began) for log in logs]


def _seconds(argument: str, given: float) -> float:
    return real(argument, given, -1e9, 1e9, "s since start")
