"""`Signal`: the samples of one element with their times, and what one asks of them.

A signal is a value: every operation returns a new one and leaves the log alone. Signals of different dividers meet on
the stamps of the faster one, where the slower one has the value that it held; those of different logs on the time since
the start of each. Where nothing is in common, or units don't go together, there is an error. NaN samples are left out
of statistics.
Frame changes are in `silo.analysis.frames`, tables of other libraries in `silo.analysis.exports`.
"""

import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from silo import units
from silo.analysis import calculus, exports, frames
from silo.analysis.arithmetic import combined, wide
from silo.analysis.samples import Samples
from silo.arguments import shown, text
from silo.errors import ElementError

MOST_SAMPLES = 100_000_000  # of a resampled signal

Operand: TypeAlias = Union["Signal", float, int, NDArray[Any]]


@dataclass(frozen=True, eq=False, repr=False)
class Signal(Samples):
    """Samples `values[i]` at `time_ns[i]`, with what one asks of them; the fields are those of `Samples`."""

    # ------------------------------------------------------------------------------------------------ values at times

    def value(self, time_s: ArrayLike) -> Any:
        """Return the value that held at a time in seconds since start (or at each of an array of times).

        After the last sample that one holds on. Raises `ElementError` before the first.
        """
        times = self.seconds(time_s)
        places = self.places(self.stamps(times))
        if (places < 0).any():
            raise ElementError(f"'{self.name}' has no value yet at {np.min(times):g} s; it {self.span}")
        return self.values[places] if np.ndim(places) else self.values[int(places)]

    def clip(self, start_s: float | None = None, stop_s: float | None = None) -> "Signal":
        """Return the samples from `start_s` to `stop_s`, both included.

        Times go on counting from the start of the log.
        """
        window = self._window(start_s, stop_s)
        return replace(self, values=self.values[window], time_ns=self.time_ns[window])

    def resample(
        self, times: Union["Signal", ArrayLike, float], method: Literal["hold", "linear"] = "hold"
    ) -> "Signal":
        """Return the signal at other times: those of another signal, an array of seconds, or a rate in Hz.

        `hold` takes the value that held, `linear` (numbers only) goes straight from sample to sample. Times before
        the first sample are left out, with `linear` those after the last as well. A signal of another log is met on
        the time since its log's start, and the result has its stamps. Raises `ElementError` with both spans where no
        time is left.
        """
        if method not in ("hold", "linear"):
            raise ElementError(f"unknown method {method!r} to resample '{self.name}': choose 'hold' or 'linear'")
        mine, time_ns = self, self._new_times(times)
        if isinstance(times, Signal):
            mine = self.as_if_started(times.start_ns)
            if len(times):
                mine.check_overlap(times, f"resample '{self.name}' at the times of '{times.name}'")
        inside = time_ns >= mine.time_ns[0] if len(self) else np.zeros(len(time_ns), bool)
        if method == "linear" and len(self):
            inside &= time_ns <= mine.time_ns[-1]
        if len(time_ns) and not inside.any():
            asked = (time_ns[[0, -1]] - mine.start_ns) * 1e-9
            raise ElementError(
                f"can't resample '{self.name}': '{self.name}' {self.span}, the times asked for are from "
                f"{asked[0]:g} to {asked[1]:g} s"
            )
        time_ns = time_ns[inside]
        if method == "hold":
            return mine.held(time_ns)
        columns = self.columns("interpolate")
        # relative to the first stamp: doubles hold nanoseconds only over a few months
        new, old = (time_ns - mine.start_ns).astype(np.float64), (mine.time_ns - mine.start_ns).astype(np.float64)
        made = np.stack([np.interp(new, old, column) for column in columns], axis=-1) if columns else np.empty((0, 0))
        return replace(mine, values=made.reshape(len(new), *self.values.shape[1:]), time_ns=time_ns, labels={})

    # --------------------------------------------------------------------------------------------------------- units

    def in_unit(self, unit: str) -> "Signal":
        """Return the signal converted to another unit: `mm` to `m`, `rpm` to `rad/s`.

        Raises `ElementError` where one unit isn't a multiple of the other as far as silo knows.
        """
        text("unit", unit, "signal.in_unit('rad/s')")
        factor = units.factor(self.unit, unit)
        if factor is None:
            raise ElementError(
                f"'{self.name}' is in '{self.unit}', which can't be converted to '{unit}'; if it is in '{unit}' in "
                f"truth, say so by .with_unit('{unit}')"
            )
        return replace(self, unit=unit, values=self.values if factor == 1.0 else wide(self) * factor)

    def with_unit(self, unit: str) -> "Signal":
        """Return the same values under another unit; `-` drops it."""
        return replace(self, unit=text("unit", unit, "signal.with_unit('rad/s'), or '-' for none"))

    # ---------------------------------------------------------------------------------------------------- statistics

    def average(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the mean of the samples in a window (whole signal by default), per component.

        NaN samples are left out.
        """
        return self._statistic(np.nanmean, start_s, stop_s)

    def rms(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the root of the mean square in a window."""
        return self._statistic(
            lambda values, axis: np.sqrt(np.nanmean(np.abs(values) ** 2, axis=axis)), start_s, stop_s
        )

    def std(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the standard deviation (of the samples themselves, divided by their number) in a window."""
        return self._statistic(np.nanstd, start_s, stop_s)

    def min(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the smallest value in a window."""
        return self._statistic(np.nanmin, start_s, stop_s, exact=True)

    def max(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the largest value in a window."""
        return self._statistic(np.nanmax, start_s, stop_s, exact=True)

    # ------------------------------------------------------------------------------------------------------- calculus

    def derivative(self) -> "Signal":
        """Change per second, by central differences over the real time stamps."""
        columns = [calculus.derivative(self.times, column) for column in self.columns("differentiate")]
        return self._with(columns, units.quotient(self.unit, "s"), f"d({self.name})")

    def integral(self) -> "Signal":
        """Return the area under the signal since its first sample, by trapezoids; a NaN sample adds nothing."""
        columns = [calculus.integral(self.times, column) for column in self.columns("integrate")]
        return self._with(columns, units.product(self.unit, "s"), f"integral({self.name})")

    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return frequencies in Hz, shape `(f,)`, and the amplitude of the sine at each, shape `(f,)` or `(f,
        components)`.

        Hann window, mean taken out, samples put on an even grid first; fewer than 4 samples have none.
        """
        found = [calculus.spectrum(self.times, column) for column in self.columns("take the spectrum of")]
        if not found:
            return np.zeros(0), np.zeros(0)
        if len({len(frequencies) for frequencies, _ in found}) > 1:
            raise ElementError(f"'{self.name}' has NaN in some components only: take the spectrum of each component")
        frequencies, first = found[0]
        return frequencies, first if self.values.ndim == 1 else np.stack([each for _, each in found], axis=-1)

    def norm(self) -> "Signal":
        """Return the length of a vector, sample by sample."""
        columns = self.columns("take the norm of")
        length = np.sqrt(sum((column**2 for column in columns), np.zeros(len(self))))
        return replace(self, name=f"|{self.name}|", values=length, kind="scalar", components=(), labels={})

    # ------------------------------------------------------------------------------------------------------ arithmetic

    def __add__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.add, "+")

    def __radd__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.add, "+", swapped=True)

    def __sub__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.sub, "-")

    def __rsub__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.sub, "-", swapped=True)

    def __mul__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.mul, "*")

    def __rmul__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.mul, "*", swapped=True)

    def __truediv__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.truediv, "/")

    def __rtruediv__(self, other: Operand) -> "Signal":
        return combined(self, other, operator.truediv, "/", swapped=True)

    def __pow__(self, exponent: float) -> "Signal":
        return combined(self, exponent, operator.pow, "**")

    def __neg__(self) -> "Signal":
        return replace(self, name=f"-{self.name}", values=-wide(self), labels={})

    def __abs__(self) -> "Signal":
        return replace(self, name=f"abs({self.name})", values=np.abs(wide(self)), labels={})

    # ufuncs of arrays must leave `array * signal` to the signal
    __array_ufunc__ = None

    # ------------------------------------------------------------------------------------------------ frames, tables

    def rotate(self, orientation: "Signal", inverse: bool = False) -> "Signal":
        """Return a 3-vector in the frame that the quaternion leads to; `inverse` goes back. Needs scipy."""
        return frames.rotate(self, orientation, inverse)

    def euler(self, order: str = "ZYX", degrees: bool = False) -> "Signal":
        """Return a quaternion as Euler angles; upper case: intrinsic axes. Needs scipy."""
        return frames.euler(self, order, degrees)

    def quaternion(self, order: str = "ZYX", degrees: bool = False) -> "Signal":
        """Return Euler angles (or an angle-axis, or rotation matrices) as quaternion `x y z w`. Needs scipy."""
        return frames.quaternion(self, order, degrees)

    def inverse(self) -> "Signal":
        """Return the inverse rotation of a quaternion. Needs scipy."""
        return frames.inverse(self)

    def to_numpy(self) -> NDArray[Any]:
        """Return the values, without a copy where they stand together in the file."""
        return self.values

    def to_pandas(self) -> Any:
        """Return a pandas Series, or DataFrame for several components, over time stamps. Enumerations become
        categories.
        """
        return exports.signal_to_pandas(self)

    def to_polars(self) -> Any:
        """Return a polars DataFrame with a column `time` and one per component."""
        return exports.signal_to_polars(self)

    def to_xarray(self) -> Any:
        """Return an xarray DataArray over `time`, with unit, labels and description as attributes."""
        return exports.signal_to_xarray(self)

    # ------------------------------------------------------------------------------------------------------- internals

    def _new_times(self, times: Union["Signal", ArrayLike, float]) -> NDArray[np.int64]:
        if isinstance(times, Signal):
            return times.time_ns
        given = self.seconds(times)
        if given.ndim == 0:
            rate = float(given)
            if not 0 < rate < np.inf:
                raise ElementError(
                    f"can't resample '{self.name}' at {rate:g} Hz: the rate must be more than 0, and finite"
                )
            if not len(self):
                return np.empty(0, np.int64)
            steps = (self.time_ns[-1] - self.time_ns[0]) * 1e-9 * rate
            if steps > MOST_SAMPLES:
                raise ElementError(
                    f"can't resample '{self.name}' at {rate:g} Hz: that is {steps:.3g} samples, at most "
                    f"{MOST_SAMPLES:,} are made; it {self.span}"
                )
            count = int(steps + 1e-9) + 1
            # not in whole nanoseconds each: the rate is to be met over the whole signal
            return np.asarray(self.time_ns[0] + np.round(np.arange(count) * (1e9 / rate)).astype(np.int64), np.int64)
        if given.ndim > 1:
            raise ElementError(f"times to resample '{self.name}' at must have one dimension, got shape {given.shape}")
        return self.stamps(given)

    def _window(self, start_s: float | None, stop_s: float | None) -> slice:
        start = 0 if start_s is None else np.searchsorted(self.time_ns, self._bound("start_s", start_s), side="left")
        stop = len(self) if stop_s is None else np.searchsorted(self.time_ns, self._bound("stop_s", stop_s), "right")
        return slice(int(start), max(int(start), int(stop)))

    def _bound(self, argument: str, given: float) -> NDArray[np.int64]:
        time = self.seconds(given)
        if time.ndim or np.isnan(time):
            raise ElementError(f"{argument} must be one time in seconds since start, got {shown(given)}")
        return self.stamps(time)

    def _statistic(
        self, function: Callable[..., Any], start_s: float | None, stop_s: float | None, exact: bool = False
    ) -> Any:
        values = self.numbers("take statistics of")[self._window(start_s, stop_s)]
        if not len(values):
            low = "its start" if start_s is None else f"{start_s:g} s"
            high = "its end" if stop_s is None else f"{stop_s:g} s"
            raise ElementError(f"'{self.name}' has no sample from {low} to {high}; it {self.span}")
        if not exact and values.dtype.kind != "c":
            values = values.astype(np.promote_types(values.dtype, np.float64), copy=False)
        empty = np.isnan(values).all(axis=0) if values.dtype.kind in "fc" else np.False_
        if not empty.any():
            return function(values, axis=0)
        # only NaN: the answer is NaN, without a warning of NumPy
        return np.where(empty, np.nan, function(np.where(empty, 0, values), axis=0))[()]

    def _with(self, columns: list[NDArray[np.float64]], unit: str, name: str) -> "Signal":
        values = np.stack(columns, axis=-1).reshape(self.values.shape)
        return replace(self, name=name, values=values, unit=unit, labels={})
