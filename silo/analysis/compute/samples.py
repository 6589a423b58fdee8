"""`Samples`: what was logged of one element, with its times; the ground under `Signal`.

What stands here says what is there and when. What one asks of it (statistics, calculus, arithmetic, frames, tables)
stands in `silo.analysis.signal` and in the modules that it calls, which all take `Samples` and know no `Signal`.
"""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.run_starts import RunStart, moved_ns
from silo.analysis.compute.shapes import scalars
from silo.core.arguments import INT64, shown, whole
from silo.core.arrays.values import missing_in, with_nan
from silo.core.calls import told_class
from silo.core.recording import NO_FAILURES, Failures, falls, rises
from silo.errors import ElementError

XYZW = ("x", "y", "z", "w")
MOST_SAMPLES = 100_000_000  # of a resampled signal

Self = TypeVar("Self", bound="Samples")


@told_class("signal")
@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Samples `values[i]` at `time_ns[i]`.

    Attributes:
        name: of the element, or how it was computed.
        values: shape `(m,)` for a scalar, `(m, 3)` for a vector of three, `(m, rows, columns)` for a matrix; an element
            of mixed types is a structured array. Masked (`numpy.ma`) where samples are missing of a type that has no
            NaN, as in bags of others.
        time_ns: shape `(m,)`: time stamps, ns.
        unit: `-` for none.
        kind: how the components belong together (`silo.core.kinds`).
        divider: that of the element when it was logged.
        start_ns: where `times` counts from: the first stamp of the log.
        components: names of the scalars of one sample (`x y z w`).
        labels: names of an enumeration's values.
        component_labels: the same of components that have their own, as the fields of a structure.
        description: a line about it.
        failures: the ticks at which its element could not be read; what is made of a signal keeps them (of two signals,
            those of the left one).
        axis_ns: time stamps of all ticks of its log, None where it has others: at which tick two rates meet isn't to be
            read off their own.
    """

    name: str
    values: NDArray[Any]
    time_ns: NDArray[np.int64]
    unit: str = "-"
    kind: str = "scalar"
    divider: int = 1
    start_ns: int = 0
    components: tuple[str, ...] = ()
    labels: Mapping[int, str] = field(default_factory=dict)
    description: str = ""
    failures: Failures = NO_FAILURES
    component_labels: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    axis_ns: NDArray[np.int64] | None = None
    # of a run that was cut, from which stamps on and before which it was off, overwritten or not recorded
    _holes: tuple[tuple[int, int], ...] = ()
    # where stamps of `axis_ns` step back or are there twice: at which its samples are, and when it was switched off
    _at: NDArray[np.int64] | None = None
    _off: tuple[tuple[int, int], ...] = ()
    _began: RunStart | None = None  # where its run did; None where that isn't known, or times count from elsewhere

    # ------------------------------------------------------------------------------------------------- what it is

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        unit = "" if self.unit in ("", "-") else f" [{self.unit}]"
        span = f" {self.times[0]:.6g} ... {self.times[-1]:.6g} s" if len(self) else ""
        return f"<{type(self).__name__} {self.name}{unit} {self.dtype} {self.values.shape}{span}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        plain = with_nan(self.values)  # NumPy would show what stands under a mask
        values = plain.astype(dtype, copy=False) if dtype is not None else plain
        return values.copy() if copy else values

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of one value."""
        dtype: np.dtype[Any] = self.values.dtype
        return dtype

    @property
    def times(self) -> NDArray[np.float64]:
        """Shape `(m,)`: seconds since the first time stamp of the log."""
        return (self.time_ns - self.start_ns).astype(np.float64) * 1e-9

    @property
    def texts(self) -> NDArray[np.str_]:
        """Each value as text: of an enumeration its label, or the number where it has none."""
        missing = missing_in(self.values)
        if missing.any():
            return np.where(missing, "", replace(self, values=np.asarray(self.values.data)).texts)
        if self.component_labels and self.values.dtype.names is None:
            parts = [self.component(place).texts for place in range(len(self.components))]
            return np.stack(parts, axis=-1).reshape(self.values.shape)
        if not self.labels:
            return self.values.astype("U")
        names, places = np.unique(self.values, return_inverse=True)
        labels = np.array([self.labels.get(int(name), str(name)) for name in names], "U")
        return labels[places.reshape(self.values.shape)] if len(names) else np.empty(self.values.shape, "U1")

    def component(self: Self, which: str | int) -> Self:
        """Return one scalar of a vector, quaternion, matrix, pose or structure.

        Args:
            which: its name (`x`, `0_1`) or number.

        Raises:
            ElementError: there is none; the message has the names there are.
        """
        names = self.components
        if isinstance(which, str) and which.removeprefix("_") in names:
            place = names.index(which.removeprefix("_"))
        elif isinstance(which, int) and -len(names) <= which < len(names):
            place = which % len(names)
        else:
            raise ElementError(f"'{self.name}' has no component {which!r}; it has: {', '.join(names) or 'none'}")
        values = next(itertools.islice(scalars(self.values), place, None), None)
        if values is None:
            raise ElementError(f"'{self.name}' has no component {which!r} any more: {self.values.dtype} has no parts")
        suffix = f"_{names[place]}" if names[place] else ""
        return replace(
            self,
            name=self.name + suffix,
            values=values,
            kind="scalar",
            components=(),
            labels=self.component_labels.get(names[place], self.labels),
            component_labels={},
        )

    def part(self: Self, name: str) -> Self:
        """Return several components that form a signal.

        Args:
            name: `position` or `orientation` of a pose, `linear` or `angular` of a twist.

        Raises:
            ElementError: there is no such part.
        """
        places = [index for index, component in enumerate(self.components) if component.startswith(f"{name}_")]
        if not places or self.values.dtype.names:
            raise ElementError(f"'{self.name}' has no part {name!r}; it has: {', '.join(self.components) or 'none'}")
        components = tuple(self.components[place].removeprefix(f"{name}_") for place in places)
        return replace(
            self,
            name=f"{self.name}_{name}",
            values=self.values.reshape(len(self), -1)[:, places],
            kind="quaternion" if sorted(components) == sorted(XYZW) else "vector",
            components=components,
            component_labels={
                short: self.component_labels[self.components[place]]
                for short, place in zip(components, places, strict=True)
                if self.components[place] in self.component_labels
            },
        )

    def _numbers(self, purpose: str) -> NDArray[Any]:
        """Return the values, bools as int64. Raises ElementError for what is none, with what it is wanted for."""
        if self.values.dtype.kind not in "biufc":
            raise ElementError(f"can't {purpose} '{self.name}': its values are no numbers ({self.dtype})")
        return self.values.astype(np.int64) if self.values.dtype.kind == "b" else self.values

    def _columns(
        self, purpose: str, taken: Callable[[NDArray[Any]], NDArray[Any]] = with_nan
    ) -> list[NDArray[np.float64]]:
        """Return each component as float64 of shape `(m,)`. Raises ElementError for what are no real numbers."""
        values = with_nan(taken(self._numbers(purpose)))
        if values.dtype.kind == "c":
            raise ElementError(f"can't {purpose} complex '{self.name}': take .component('real') or ('imag')")
        flat = values.reshape(len(self), -1) if len(self) else values.reshape(0, max(1, len(self.components)))
        return [flat[:, index].astype(np.float64) for index in range(flat.shape[1])]

    # ------------------------------------------------------------------------------------------------- when it is

    def _held(self: Self, time_ns: NDArray[np.int64]) -> Self:
        """Return the values that hold at these stamps, none of which may be before the first sample."""
        return replace(self, values=self.values[self._places(time_ns)], time_ns=time_ns, _at=None)

    def _places(self, time_ns: NDArray[np.int64]) -> Any:
        """Return which sample holds at each stamp; -1 before the first."""
        if not self._falls:
            return np.searchsorted(self.time_ns, time_ns, side="right") - 1
        order = np.argsort(self.time_ns, kind="stable")
        found = np.searchsorted(self.time_ns[order], time_ns, side="right") - 1
        return np.where(found < 0, -1, order[found])

    def _seconds(self, given: object) -> NDArray[np.float64]:
        """Return times as an array of numbers, of any shape. Raises ElementError."""
        try:
            found = np.asarray(given)
            if found.dtype.kind in "biuf" and given is not None:
                return found.astype(np.float64)
            if found.size == 0 and found.dtype.kind != "O":
                return np.zeros(0)
        except (TypeError, ValueError, OverflowError):
            pass
        raise ElementError(
            f"times of '{self.name}' must be numbers, in seconds since start (or a rate in Hz), got {shown(given)}"
        )

    def _stamps(self, times: NDArray[np.float64]) -> NDArray[np.int64]:
        # times that are read off `times` must find their own stamp again
        with np.errstate(invalid="ignore"):
            since = np.asarray(np.round(np.clip(times, -9.2e9, 9.2e9) * 1e9), np.int64)
        # the end of time, not its beginning, is what lies too far ahead to be counted in 64 bits
        low, high = INT64[0] - min(self.start_ns, 0), INT64[1] - max(self.start_ns, 0)
        return np.asarray(np.clip(since, low, high) + self.start_ns, np.int64)

    @property
    def _span(self) -> str:
        """From when to when there are samples, in words."""
        if not len(self):
            return "has no sample"
        first, last = (self._seconds_of(end) for end in self._bounds)
        return f"has samples from {first:g} to {last:g} s"

    @property
    def _bounds(self) -> tuple[int, int]:
        """The smallest and the largest stamp, ns; there must be samples."""
        if self._falls:
            return int(self.time_ns.min()), int(self.time_ns.max())
        return int(self.time_ns[0]), int(self.time_ns[-1])

    def _seconds_of(self, stamp_ns: int) -> float:
        return (stamp_ns - self.start_ns) * 1e-9

    @cached_property
    def _falls(self) -> bool:
        """Whether a stamp is smaller than the one before: a clock stepped back in the log."""
        return falls(self.time_ns)

    def _in_order(self: Self) -> Self:
        """Return the same with its samples in the order of their stamps; itself where they are."""
        if not self._falls:
            return self
        order = np.argsort(self.time_ns, kind="stable")
        return self._part(order)

    @property
    def _when(self) -> dict[str, Any]:
        """What is known of when its samples are, beside their stamps."""
        return {name: getattr(self, name) for name in ("axis_ns", "divider", "_holes", "_at", "_off")}

    # ---------------------------------------------------------------------------------------------- whose time it is

    def counted_from(self: Self, start: "Samples | int") -> Self:
        """Return the same stamps with `times` counted from another one.

        Signals of loggers that ran at once then meet on their stamps, not on the time since each run's start.

        Args:
            start: a stamp in ns, or a signal: where that one starts.
        """
        if isinstance(start, Samples):
            return replace(self, start_ns=start.start_ns, _began=start._began)
        return replace(self, start_ns=whole("start (in nanoseconds, or a signal)", start, *INT64), _began=None)

    def _met(self: Self, one: "Samples") -> Self:
        """Return the same on the clock of another signal: as long after the start of that run as after its own."""
        shift = moved_ns(one.start_ns, one._began, self.start_ns, self._began)
        if not shift and self.start_ns == one.start_ns:
            return self
        holes = tuple((begin + shift, end + shift) for begin, end in self._holes)
        time_ns = self.time_ns + shift if shift else self.time_ns
        return replace(self, time_ns=time_ns, start_ns=one.start_ns, _began=one._began, _holes=holes)

    def _holding(self, time_ns: NDArray[np.int64], slack_ns: float = 0.0) -> NDArray[np.bool_]:
        """Return at which stamps a value holds: from the first sample to `slack_ns` before one more would come.

        A single sample, as of a map, holds on; there must be one.
        """
        return (time_ns >= self._bounds[0]) & (time_ns < self._holds_until(slack_ns)) & ~self._in_hole(time_ns)

    @property
    def _is_moved(self) -> bool:
        """Whether its times count from another stamp than the first one of its log."""
        return self.axis_ns is not None and len(self.axis_ns) > 0 and self.start_ns != self.axis_ns[0]

    @property
    def _ticks(self) -> NDArray[np.int64] | None:
        """At which ticks of its log its samples are; None where stamps tell, and for what was made to have others."""
        axis, at = self.axis_ns, self._at
        if axis is None or at is None or len(at) != len(self) or at.max(initial=-1) >= len(axis):
            return None
        return at if np.array_equal(axis[at], self.time_ns) else None

    def _part(self: Self, which: Any, *, divider: int | None = None) -> Self:
        """Return the samples at these places, of a slice or a mask."""
        at = self._at[which] if self._at is not None and len(self._at) == len(self) else None
        values, time_ns = self.values[which], self.time_ns[which]
        return replace(
            self, values=values, time_ns=time_ns, _at=at, divider=self.divider if divider is None else divider
        )

    def _holds_until(self, slack_ns: float = 0.0) -> int:
        """Return before which stamp the last sample holds: `slack_ns` before one more would come; a single one on."""
        if len(self) < 2:
            return INT64[1]
        return min(self._bounds[1] + ceil(self._step_ns - slack_ns), INT64[1])

    def _in_hole(self, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return at which stamps it was off, overwritten or not recorded."""
        if not self._holes:
            return np.zeros(np.shape(time_ns), bool)
        begins, ends = np.array(self._holes, np.int64).T
        at = np.searchsorted(begins, time_ns, side="right") - 1
        return np.asarray((at >= 0) & (time_ns < ends[at]))

    @property
    def _step_ns(self) -> float:
        """Nanoseconds from sample to sample, as a rule; infinite where there are fewer than two.

        At least 1: where a clock stands still, a value holds at its own time.
        """
        return max(1.0, float(np.median(np.diff(self.time_ns)))) if len(self) > 1 else float("inf")

    def _check_overlap(self, other: "Samples", what: str) -> None:
        """Raise ElementError with both spans where this and another signal of the same start have no time in common.

        The last sample holds until the next would come.
        """
        if len(self) and len(other):
            begins, ends = zip(*(each._bounds for each in (self, other)), strict=True)
            if begins[1] < ends[0] + self._step_ns and begins[0] < ends[1] + other._step_ns:
                return
        raise self._nothing_in_common(other, what)

    def _nothing_in_common(self, other: "Samples", what: str) -> ElementError:
        names = (f"'{self.name}'", f"'{other.name}'") if self.name != other.name else ("the first", "the second")
        return ElementError(
            f"can't {what}: there is no time in common; since the start of its log {names[0]} {self._span}, "
            f"{names[1]} {other._span}"
        )


@dataclass(frozen=True)
class Unfolded:
    """The ticks of a log whose clock stepped back or stood still, as of a simulation, on an axis that only rises."""

    axis_ns: NDArray[np.int64]
    risen_ns: NDArray[np.int64]

    def risen(self, signal: Self) -> Self | None:
        """Return a signal with the stamps of that axis; None for one that has others than its ticks, in their order."""
        places = signal._ticks
        time_ns = self.risen_ns[places] if places is not None else self.of_episodes(signal.time_ns)
        if time_ns is None:
            return None
        off = signal._off or np.searchsorted(self.axis_ns, signal._holes)  # where it steps back there are none of these
        holes = tuple((int(self.risen_ns[begin]), int(self.risen_ns[end])) for begin, end in off)
        return replace(signal, time_ns=time_ns, axis_ns=self.risen_ns, _holes=holes)

    def of_episodes(self, time_ns: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """Return the stamps of what begins anew wherever the ticks do; None for what doesn't."""
        begins, folds = (np.flatnonzero(np.diff(each) < 0) + 1 for each in (time_ns, self.axis_ns))
        if len(begins) != len(folds):
            return None
        more = (self.risen_ns - self.axis_ns)[np.append(0, folds)]
        risen = time_ns + np.repeat(more, np.diff([0, *begins, len(time_ns)]))
        places = np.searchsorted(self.risen_ns, risen).clip(max=len(self.risen_ns) - 1)
        return risen if np.array_equal(self.risen_ns[places], risen) else None

    def folded(self, signal: Self) -> Self:
        """Return a signal of that axis with the stamps that its ticks had."""
        places = np.searchsorted(self.risen_ns, signal.time_ns).clip(max=len(self.risen_ns) - 1)
        at = places if np.array_equal(self.risen_ns[places], signal.time_ns) else None
        return replace(signal, time_ns=self.stamps(signal.time_ns), axis_ns=self.axis_ns, _at=at, _holes=())

    def stamps(self, risen_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return what the clock said at stamps of that axis, which may lie between ticks."""
        places = (np.searchsorted(self.risen_ns, risen_ns, side="right") - 1).clip(min=0)
        return np.asarray(risen_ns - (self.risen_ns - self.axis_ns)[places], np.int64)


def unfolded_ticks(axis_ns: NDArray[np.int64], *, even: bool = True) -> Unfolded:
    """Return ticks as they rise: a usual step on where the clock stepped back.

    `even`: where it stood still, too, so that no two have one stamp; else seconds stay what they are.
    """
    steps = np.diff(axis_ns, prepend=axis_ns[:1])
    if even and (steps[1:] == 0).any():
        step = max(1, int(steps[steps > 0].sum()) // len(steps))
        return Unfolded(axis_ns, axis_ns[0] + step * np.arange(len(axis_ns), dtype=np.int64))
    usual = max(1, int(np.median(steps[steps > 0]))) if (steps > 0).any() else 1
    return Unfolded(axis_ns, axis_ns[0] + np.cumsum(np.where(steps < 0, usual, steps)))


def fold_of(signal: Samples) -> Unfolded | None:
    """Return how the ticks of a signal's log rise, where they don't by themselves."""
    return None if signal.axis_ns is None or rises(signal.axis_ns) else unfolded_ticks(signal.axis_ns)


@dataclass(frozen=True)
class RisenPair:
    """Two signals by ticks that rise, of logs whose clocks stepped back or stood still; `folds` lead back, if any."""

    one: Any
    other: Any
    folds: tuple[Unfolded | None, Unfolded | None]
    two_logs: bool


def risen_pair(one: Samples, other: Samples) -> RisenPair | None:
    """Return two signals so; None where their stamps tell when they were, or nothing tells at which ticks.

    Of two logs a clock that only stood still is as good as any, and what was `counted_from` another start has stamps.
    """
    same = one.axis_ns is not None and one.axis_ns is other.axis_ns
    if not same and (not (one._falls or other._falls) or one._is_moved or other._is_moved):
        return None
    mine = fold_of(one)
    theirs = mine if same else fold_of(other)
    risen = mine.risen(one) if mine else one, theirs.risen(other) if theirs else other
    if not (mine or theirs):
        return None
    if risen[0] is None or risen[1] is None:
        if one._falls or other._falls:
            raise UntoldError
        return None
    return RisenPair(*risen, (mine, theirs), not same)


class UntoldError(Exception):
    """Of signals of a clock that stepped back nothing tells at which ticks they are."""


def is_rate(times: object) -> bool:
    """Return whether a rate is meant, not a signal or times."""
    return isinstance(times, float | int | np.number) or (isinstance(times, np.ndarray) and times.ndim == 0)


def new_times(signal: Samples, times: object) -> NDArray[np.int64]:
    """Return the stamps to resample a signal at: those of another, seconds since start, or a rate in Hz.

    Raises `ElementError`.
    """
    if isinstance(times, Samples):
        return times.time_ns
    given = signal._seconds(times)
    if given.ndim == 0:
        rate = float(given)
        if not 0 < rate < np.inf:
            raise ElementError(
                f"can't resample '{signal.name}' at {rate:g} Hz: the rate must be more than 0, and finite"
            )
        if not len(signal):
            return np.empty(0, np.int64)
        first, last = signal._bounds
        steps = (last - first) * 1e-9 * rate
        if steps > MOST_SAMPLES:
            raise ElementError(
                f"can't resample '{signal.name}' at {rate:g} Hz: that is {steps:.3g} samples, at most "
                f"{MOST_SAMPLES:,} are made; it {signal._span}"
            )
        count = int(steps + 1e-9) + 1
        # not in whole nanoseconds each: the rate is to be met over the whole signal
        return np.asarray(first + np.round(np.arange(count) * (1e9 / rate)).astype(np.int64), np.int64)
    if given.ndim > 1:
        raise ElementError(f"times to resample '{signal.name}' at must have one dimension, got shape {given.shape}")
    return signal._stamps(given)


def in_order(signal: Self, components: tuple[str, ...]) -> Self:
    """Return the signal with its components in this order, where it has just these; else as it is.

    Quaternions stand as they lay in memory, `x y z w` or `w x y z`.
    """
    if signal.components == components or sorted(signal.components) != sorted(components) or signal.values.ndim != 2:
        return signal
    places = [signal.components.index(one) for one in components]
    return replace(signal, values=signal.values[:, places], components=components)
