"""`Signal`: the samples of one element with their times, and what one asks of them.

A signal is a value: every operation returns a new one and leaves the log alone. Signals of different dividers meet on
the stamps of the faster one, where the slower one has the value that it held. NaN samples are left out of statistics.
Frame changes are in `silo.analysis.frames`, tables of other libraries in `silo.analysis.exports`.
"""

import itertools
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from silo.analysis import calculus
from silo.analysis.arithmetic import combined, wide
from silo.analysis.shapes import scalars
from silo.analysis.units import product, quotient
from silo.errors import ElementError

Operand: TypeAlias = Union["Signal", float, int, NDArray[Any]]


@dataclass(frozen=True, eq=False, repr=False)
class Signal:
    """Samples `values[i]` at `time_ns[i]`.

    `values` has shape `(m,)` for a scalar, `(m, 3)` for a vector of three, `(m, rows, columns)` for a matrix; an
    element of mixed types is a structured array. `components` names the scalars of one sample (`x y z w`).
    `labels` names the values of an enumeration. `start_ns` is where `times` counts from: the first stamp of the log.
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

    # ------------------------------------------------------------------------------------------------- what it is

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        unit = "" if self.unit in ("", "-") else f" [{self.unit}]"
        span = f" {self.times[0]:.6g} ... {self.times[-1]:.6g} s" if len(self) else ""
        return f"<Signal {self.name}{unit} {self.dtype} {self.values.shape}{span}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        values = self.values.astype(dtype, copy=False) if dtype is not None else self.values
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
        if not self.labels:
            return self.values.astype("U")
        names, places = np.unique(self.values, return_inverse=True)
        labels = np.array([self.labels.get(int(name), str(name)) for name in names], "U")
        return labels[places.reshape(self.values.shape)] if len(names) else np.empty(self.values.shape, "U1")

    def component(self, which: str | int) -> "Signal":
        """One scalar of a vector, quaternion, matrix, pose or structure: by name (`x`, `0_1`) or by number.

        Raises `ElementError` with the names there are.
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
        return replace(self, name=self.name + suffix, values=values, kind="scalar", components=())

    def part(self, name: str) -> "Signal":
        """Several components that form a signal: `position` and `orientation` of a pose, `linear` and `angular`."""
        places = [index for index, component in enumerate(self.components) if component.startswith(f"{name}_")]
        if not places or self.values.dtype.names:
            raise ElementError(f"'{self.name}' has no part {name!r}; it has: {', '.join(self.components) or 'none'}")
        components = tuple(self.components[place].removeprefix(f"{name}_") for place in places)
        return replace(
            self,
            name=f"{self.name}_{name}",
            values=self.values.reshape(len(self), -1)[:, places],
            kind="quaternion" if components == ("x", "y", "z", "w") else "vector",
            components=components,
        )

    # ------------------------------------------------------------------------------------------------ values at times

    def value(self, time_s: ArrayLike) -> Any:
        """The value that held at a time in seconds since start (or at each of an array of times).

        After the last sample that one holds on. Raises `ElementError` before the first.
        """
        places = self._places(np.asarray(time_s, np.float64))
        if (places < 0).any():
            raise ElementError(f"'{self.name}' has no value yet at {np.min(time_s):g} s; {self._span()}")
        return self.values[places] if np.ndim(places) else self.values[int(places)]

    def clip(self, start_s: float | None = None, stop_s: float | None = None) -> "Signal":
        """The samples from `start_s` to `stop_s`, both included; times go on counting from the start of the log."""
        window = self._window(start_s, stop_s)
        return replace(self, values=self.values[window], time_ns=self.time_ns[window])

    def resample(
        self, times: Union["Signal", ArrayLike, float], method: Literal["hold", "linear"] = "hold"
    ) -> "Signal":
        """The signal at other times: those of another signal, an array of seconds, or a rate in Hz.

        `hold` takes the value that held, `linear` (numbers only) goes straight from sample to sample. Times before
        the first sample are left out, with `linear` those after the last as well.
        """
        if method not in ("hold", "linear"):
            raise ElementError(f"unknown method {method!r} to resample '{self.name}': choose 'hold' or 'linear'")
        time_ns = self._new_times(times)
        inside = time_ns >= self.time_ns[0] if len(self) else np.zeros(len(time_ns), bool)
        if method == "linear" and len(self):
            inside &= time_ns <= self.time_ns[-1]
        time_ns = time_ns[inside]
        if method == "hold":
            places = np.searchsorted(self.time_ns, time_ns, side="right") - 1
            return replace(self, values=self.values[places], time_ns=time_ns)
        columns = self._columns("interpolate")
        # relative to the first stamp: doubles hold nanoseconds only over a few months
        new, old = (time_ns - self.start_ns).astype(np.float64), (self.time_ns - self.start_ns).astype(np.float64)
        made = np.stack([np.interp(new, old, column) for column in columns], axis=-1) if columns else np.empty((0, 0))
        return replace(self, values=made.reshape(len(new), *self.values.shape[1:]), time_ns=time_ns, labels={})

    # ---------------------------------------------------------------------------------------------------- statistics

    def average(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Mean of the samples in a window (whole signal by default), per component; NaN samples are left out."""
        return self._statistic(np.nanmean, start_s, stop_s)

    def rms(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Root of the mean square in a window."""
        return self._statistic(
            lambda values, axis: np.sqrt(np.nanmean(np.abs(values) ** 2, axis=axis)), start_s, stop_s
        )

    def std(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Standard deviation (of the samples themselves, divided by their number) in a window."""
        return self._statistic(np.nanstd, start_s, stop_s)

    def min(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Smallest value in a window."""
        return self._statistic(np.nanmin, start_s, stop_s, exact=True)

    def max(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Largest value in a window."""
        return self._statistic(np.nanmax, start_s, stop_s, exact=True)

    # ------------------------------------------------------------------------------------------------------- calculus

    def derivative(self) -> "Signal":
        """Change per second, by central differences over the real time stamps."""
        columns = [calculus.derivative(self.times, column) for column in self._columns("differentiate")]
        return self._with(columns, quotient(self.unit, "s"), f"d({self.name})")

    def integral(self) -> "Signal":
        """Area under the signal since its first sample, by trapezoids; a NaN sample adds nothing."""
        columns = [calculus.integral(self.times, column) for column in self._columns("integrate")]
        return self._with(columns, product(self.unit, "s"), f"integral({self.name})")

    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Frequencies in Hz, shape `(f,)`, and the amplitude of the sine at each, shape `(f,)` or `(f, components)`.

        Hann window, mean taken out, samples put on an even grid first; fewer than 4 samples have none.
        """
        found = [calculus.spectrum(self.times, column) for column in self._columns("take the spectrum of")]
        if not found:
            return np.zeros(0), np.zeros(0)
        if len({len(frequencies) for frequencies, _ in found}) > 1:
            raise ElementError(f"'{self.name}' has NaN in some components only: take the spectrum of each component")
        frequencies, first = found[0]
        return frequencies, first if self.values.ndim == 1 else np.stack([each for _, each in found], axis=-1)

    def norm(self) -> "Signal":
        """Length of a vector, sample by sample."""
        columns = self._columns("take the norm of")
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
        """A 3-vector in the frame that the quaternion leads to; `inverse` goes back. Needs scipy."""
        from silo.analysis.frames import rotate

        return rotate(self, orientation, inverse)

    def euler(self, order: str = "ZYX", degrees: bool = False) -> "Signal":
        """A quaternion as Euler angles; upper case: intrinsic axes. Needs scipy."""
        from silo.analysis.frames import euler

        return euler(self, order, degrees)

    def quaternion(self, order: str = "ZYX", degrees: bool = False) -> "Signal":
        """Euler angles (or an angle-axis, or rotation matrices) as quaternion `x y z w`. Needs scipy."""
        from silo.analysis.frames import quaternion

        return quaternion(self, order, degrees)

    def inverse(self) -> "Signal":
        """The inverse rotation of a quaternion. Needs scipy."""
        from silo.analysis.frames import inverse

        return inverse(self)

    def numbers(self, purpose: str) -> NDArray[Any]:
        """The values, bools as int64. Raises `ElementError`, which names the purpose, where they are no numbers."""
        if self.values.dtype.kind not in "biufc":
            raise ElementError(f"can't {purpose} '{self.name}': its values are no numbers ({self.dtype})")
        return self.values.astype(np.int64) if self.values.dtype.kind == "b" else self.values

    def to_numpy(self) -> NDArray[Any]:
        """The values, without a copy where they stand together in the file."""
        return self.values

    def to_pandas(self) -> Any:
        """A pandas Series, or DataFrame for several components, over time stamps. Enumerations become categories."""
        from silo.analysis.exports import signal_to_pandas

        return signal_to_pandas(self)

    def to_polars(self) -> Any:
        """A polars DataFrame with a column `time` and one per component."""
        from silo.analysis.exports import signal_to_polars

        return signal_to_polars(self)

    def to_xarray(self) -> Any:
        """An xarray DataArray over `time`, with unit, labels and description as attributes."""
        from silo.analysis.exports import signal_to_xarray

        return signal_to_xarray(self)

    # ------------------------------------------------------------------------------------------------------- internals

    def _places(self, times: NDArray[np.float64]) -> Any:
        return np.searchsorted(self.time_ns, self._ns(times), side="right") - 1

    def _ns(self, times: NDArray[np.float64]) -> NDArray[np.int64]:
        # times that are read off `times` must find their own stamp again
        with np.errstate(invalid="ignore"):
            since = np.asarray(np.round(np.clip(times, -9e9, 9e9) * 1e9), np.int64)
        return np.asarray(since + self.start_ns, np.int64)

    def _new_times(self, times: Union["Signal", ArrayLike, float]) -> NDArray[np.int64]:
        if isinstance(times, Signal):
            return times.time_ns
        if np.ndim(times) == 0:
            rate = float(times)  # type: ignore[arg-type]  # a 0-d array like
            if not rate > 0:
                raise ElementError(f"can't resample '{self.name}' at {rate:g} Hz: the rate must be more than 0")
            if not len(self):
                return np.empty(0, np.int64)
            count = int((self.time_ns[-1] - self.time_ns[0]) * 1e-9 * rate + 1e-9) + 1
            steps = np.round(np.arange(count) * (1e9 / rate)).astype(np.int64)
            return np.asarray(self.time_ns[0] + steps, np.int64)
        return self._ns(np.asarray(times, np.float64))

    def _window(self, start_s: float | None, stop_s: float | None) -> slice:
        start = 0 if start_s is None else np.searchsorted(self.time_ns, self._ns(np.float64(start_s)), side="left")
        stop = len(self) if stop_s is None else np.searchsorted(self.time_ns, self._ns(np.float64(stop_s)), "right")
        return slice(int(start), max(int(start), int(stop)))

    def _statistic(
        self, function: Callable[..., Any], start_s: float | None, stop_s: float | None, exact: bool = False
    ) -> Any:
        values = self.numbers("take statistics of")[self._window(start_s, stop_s)]
        if not len(values):
            low = "its start" if start_s is None else f"{start_s:g} s"
            high = "its end" if stop_s is None else f"{stop_s:g} s"
            raise ElementError(f"'{self.name}' has no sample from {low} to {high}; {self._span()}")
        if not exact and values.dtype.kind != "c":
            values = values.astype(np.promote_types(values.dtype, np.float64), copy=False)
        empty = np.isnan(values).all(axis=0) if values.dtype.kind in "fc" else np.False_
        if not empty.any():
            return function(values, axis=0)
        # only NaN: the answer is NaN, without a warning of NumPy
        return np.where(empty, np.nan, function(np.where(empty, 0, values), axis=0))[()]

    def _span(self) -> str:
        if not len(self):
            return "it has no sample"
        return f"it has samples from {self.times[0]:g} to {self.times[-1]:g} s"

    def _columns(self, purpose: str) -> list[NDArray[np.float64]]:
        values = self.numbers(purpose)
        if values.dtype.kind == "c":
            raise ElementError(f"can't {purpose} complex '{self.name}': take .component('real') or ('imag')")
        flat = values.reshape(len(self), -1) if len(self) else values.reshape(0, max(1, len(self.components)))
        return [flat[:, index].astype(np.float64) for index in range(flat.shape[1])]

    def _with(self, columns: list[NDArray[np.float64]], unit: str, name: str) -> "Signal":
        values = np.stack(columns, axis=-1).reshape(self.values.shape)
        return replace(self, name=name, values=values, unit=unit, labels={})
