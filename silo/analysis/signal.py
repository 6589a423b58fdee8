"""`Signal`: the samples of one element with their times, and what one asks of them.

A signal is a value: every operation returns a new one and leaves the log alone. Signals of different dividers meet at
every tick that their rates have in common (every second and every third: each), where they have the value that they
held; those of different logs on the time since the start of each run. Where nothing is in common, or units don't go
together, there is an error. NaN samples are left out of statistics.
Operators are NumPy's, which call `silo.analysis.compute.numpy_functions`; frame changes are in
`silo.analysis.compute.frames`, tables of other libraries in `silo.analysis.compute.exports`.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NoReturn, TypeAlias, Union, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import ArrayLike, NDArray

from silo.analysis.compute import calculus, exports, frames, indexing, numpy_functions, spectra
from silo.analysis.compute.arithmetic import UNTOLD, warn_outside, wide
from silo.analysis.compute.samples import Samples, UntoldError, is_rate, new_times, risen_pair, unfolded_ticks
from silo.core import units
from silo.core.arguments import INT64, shown, text
from silo.core.arrays.values import from_base, with_nan
from silo.core.calls import no_attribute, told_class
from silo.core.quantities.writing import html_table
from silo.core.recording import rises, within
from silo.errors import ArgumentError, ElementError

# what others call it
_OTHER_NAMES = {
    "time": "it is .times (seconds since start) or .time_ns",
    "t": "it is .times (seconds since start) or .time_ns",
    "timestamps": "it is .time_ns, or .times in seconds since start",
    "data": "it is .values",
    "value_at": "it is .value(time)",
    "at": "it is .value(time), or [2.0:3.5] for a stretch",
    "loc": "it is [2.0:3.5] for seconds, [10:20] for samples",
    "iloc": "it is [10:20]",
    "convert": "it is .to('deg')",
    "sum": "of samples it is signal.values.sum(), over time .integral()",
    "diff": "it is .derivative(), or np.diff(signal)",
    "cumsum": "it is .integral(), or np.cumsum(signal)",
    "T": "it is .values.T",
    "astype": "it is .values.astype(...)",
    "reshape": "it is .values.reshape(...)",
    "tolist": "it is .values.tolist()",
    "fft": "it is .spectrum()",
    "avg": "it is .mean()",
    "index": "it is .times (seconds since start) or .time_ns",
    "abs": "it is np.abs(signal)",
    "argmax": "it is signal.values.argmax(); signal.times[...] of that is when",
    "idxmax": "it is signal.times[signal.values.argmax()]",
    "first": "it is [0]",
    "last": "it is [-1]",
    "head": "it is [:5]",
    **dict.fromkeys(
        ("filter", "lowpass", "smooth"), "it is of SciPy: scipy.signal.sosfiltfilt(sos, signal.values, axis=0)"
    ),
    "rolling": "it is signal.to_pandas().rolling(10)",
    # members of 0.1
    "average": "it is .mean()",
    "in_unit": "it is .to('deg')",
    **dict.fromkeys(
        (
            "as_if_started", "bounds", "check_overlap", "columns", "falls", "held", "holding", "in_order",
            "nothing_in_common", "numbers", "places", "seconds", "seconds_of", "span", "stamps", "step_ns",
        ),
        "it is silo's own",
    ),
}  # fmt: skip

Operand: TypeAlias = Union["Signal", float, int, NDArray[Any]]


class _Operators(NDArrayOperatorsMixin):
    """Those of NumPy; `signal += 1` makes another one, as signals are values."""


for _name in ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "and", "or", "xor", "lshift", "rshift"):
    setattr(_Operators, f"__i{_name}__", getattr(NDArrayOperatorsMixin, f"__{_name}__"))


@told_class("signal", make="silo.Signal")
@dataclass(frozen=True, eq=False, repr=False)
class Signal(Samples, _Operators):
    """Samples `values[i]` at `time_ns[i]`, with what one asks of them; the fields are those of `Samples`.

    Signals stand for their values where one calculates.
    """

    if TYPE_CHECKING:  # NumPy's say Any

        def _with_another(self, other: Operand) -> "Signal": ...
        def _negative(self) -> "Signal": ...

        __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _with_another
        __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __pow__ = __rpow__ = _with_another
        __lt__ = __le__ = __gt__ = __ge__ = _with_another
        __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = _with_another
        __neg__ = __pos__ = __abs__ = __invert__ = _negative

    def __eq__(self, other: object) -> "Signal":  # type: ignore[override]  # as arrays do
        return NotImplemented if other is None else np.equal(self, other)  # type: ignore[call-overload]

    def __ne__(self, other: object) -> "Signal":  # type: ignore[override]
        return NotImplemented if other is None else np.not_equal(self, other)  # type: ignore[call-overload]

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        if self.values.size == 1:
            return bool(self.values.reshape(-1)[0])
        raise ElementError(
            f"'{self.name}' has {len(self)} samples, so it is neither true nor false: write .any(), .all() or len(...)"
        )

    def __float__(self) -> float:
        if self.values.size == 1:
            return float(self.values.reshape(-1)[0])
        raise ElementError(f"'{self.name}' has {len(self)} samples: write .mean(), .value(time) or [0] for one number")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **keywords: Any) -> Any:
        return numpy_functions.ufunc_of(self, ufunc, method, inputs, keywords)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, args: tuple[Any, ...], keywords: dict[str, Any]
    ) -> Any:
        return numpy_functions.function_of(function, args, keywords)

    # ------------------------------------------------------------------------------------------------ values at times

    def value(self, time_s: ArrayLike) -> Any:
        """Return the value that held at a time. After the last sample that one holds on.

        Args:
            time_s: seconds since start, one or an array of them.

        Raises:
            ElementError: the time is before the first sample, or while a cut had switched it off.
        """
        times = self._seconds(time_s)
        stamps = self._stamps(times)
        places, off = self._places(stamps), self._in_hole(stamps)
        if off.any():
            raise ElementError(
                f"'{self.name}' has no value at {np.min(times[off]):g} s: it was off, overwritten or not recorded, then"
            )
        if (places < 0).any():
            raise ElementError(f"'{self.name}' has no value yet at {np.min(times):g} s; it {self._span}")
        return self.values[places] if np.ndim(places) else self.values[int(places)]

    def clip(self, start_s: float | None = None, stop_s: float | None = None) -> "Signal":
        """Return the samples from `start_s` to `stop_s`, both included.

        Times go on counting from the start of the log.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        window = self._window(start_s, stop_s)
        return self._part(window)

    def resample(
        self, times: Union["Signal", ArrayLike, float], method: Literal["hold", "linear"] = "hold"
    ) -> "Signal":
        """Return the signal at other times.

        Times before the first sample are left out, those while a cut had it switched off, and with `linear` those after
        the last as well. A signal of another log is met on the time since its log's start; the result has its stamps.

        Args:
            times: another signal, whose times are meant, an array of seconds since start, or a rate in Hz.
            method: `"hold"` takes the value that held, `"linear"` (numbers only) goes straight from sample to sample:
                of floats, quaternions and poses turn on the shortest way; whole numbers, bools, enumerations hold.

        Raises:
            ElementError: no time is left; the message has both spans.
        """
        if method not in ("hold", "linear"):
            raise ElementError(f"unknown method {method!r} to resample '{self.name}': choose 'hold' or 'linear'")
        if self._falls and is_rate(times) and self.axis_ns is not None and not rises(self.axis_ns):
            ticks = unfolded_ticks(self.axis_ns, even=False)
            if (risen := ticks.risen(self)) is not None:
                return ticks.folded(risen.resample(times, method))
        if isinstance(times, Signal):
            try:
                pair = risen_pair(self, times)
            except UntoldError:
                warn_outside(f"resample '{self.name}' at the times of '{times.name}': {UNTOLD}")
                pair = None
            if pair is not None:
                found: Signal = pair.one.resample(pair.other, method)
                return pair.folds[1].folded(found) if pair.folds[1] else found
        mine, time_ns = self, new_times(self, times)
        if isinstance(times, Signal):
            mine = self._met(times)
            if len(times):
                mine._check_overlap(times, f"resample '{self.name}' at the times of '{times.name}'")
        inside = time_ns >= mine._bounds[0] if len(self) else np.zeros(len(time_ns), bool)
        if method == "linear" and len(self):
            inside &= time_ns <= mine._bounds[1]
        inside &= ~mine._in_hole(time_ns)
        if len(time_ns) and not inside.any():
            asked = (time_ns[[0, -1]] - mine.start_ns) * 1e-9
            raise ElementError(
                f"can't resample '{self.name}': '{self.name}' {self._span}, the times asked for are from "
                f"{asked[0]:g} to {asked[1]:g} s"
            )
        time_ns = time_ns[inside]
        if method == "hold":
            return mine._held(time_ns)
        mine = mine._in_order()
        columns = mine._columns("interpolate")
        if not calculus.goes_straight(self.dtype, self.labels or self.component_labels):
            return mine._held(time_ns)
        # relative to the first stamp: doubles hold nanoseconds only over a few months
        new, old = (time_ns - mine.start_ns).astype(np.float64), (mine.time_ns - mine.start_ns).astype(np.float64)
        flat = np.stack(columns, axis=-1) if columns else np.empty((len(old), 0))
        made = calculus.between(self.kind, old, flat, new) if len(old) else flat
        return replace(mine, values=made.reshape(len(new), *self.values.shape[1:]), time_ns=time_ns)

    # --------------------------------------------------------------------------------------------------------- units

    def to(self, unit: str) -> "Signal":
        """Return the signal converted to another unit: `signal.to("deg")`, `mm` to `m`, `rpm` to `rad/s`.

        Args:
            unit: the unit of the result.

        Raises:
            ElementError: one unit isn't a multiple of the other as far as silo knows.
        """
        text("unit", unit, "signal.to('rad/s')")
        factor = units.factor(self.unit, unit)
        if factor is None:
            doubts = "".join(f"; {words}" for words in map(units.doubt, (self.unit, unit)) if words)
            raise ElementError(
                f"'{self.name}' is in '{self.unit}', which can't be converted to '{unit}'; if it is in '{unit}' in "
                f"truth, say so by .with_unit('{unit}'){doubts}"
            )
        return replace(self, unit=unit, values=self.values if factor == 1.0 else wide(self) * factor)

    def with_unit(self, unit: str) -> "Signal":
        """Return the same values under another unit.

        Args:
            unit: what they are in, in truth; `-` for none.
        """
        given = text("unit", unit, "signal.with_unit('rad/s'), or '-' for none")
        if wrong := units.doubt(given):
            warn_outside(f"{wrong}; the next release will refuse it")
        return replace(self, unit=given)

    # ---------------------------------------------------------------------------------------------------- statistics

    def median(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the median of the samples in a window, per component.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanmedian, start_s, stop_s)

    def var(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the variance in a window, the square of `std`.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanvar, start_s, stop_s, taken=from_base)

    def mean(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the mean of the samples in a window (whole signal by default), per component.

        NaN samples are left out.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanmean, start_s, stop_s)

    def rms(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the root of the mean square in a window.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(
            lambda values, axis: np.sqrt(np.nanmean(np.abs(values) ** 2, axis=axis)), start_s, stop_s
        )

    def std(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the standard deviation (of the samples themselves, divided by their number) in a window.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanstd, start_s, stop_s, taken=from_base)

    def min(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the smallest value in a window.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanmin, start_s, stop_s, exact=True)

    def max(self, start_s: float | None = None, stop_s: float | None = None) -> Any:
        """Return the largest value in a window.

        Args:
            start_s: seconds since start; None: from the first sample.
            stop_s: seconds since start; None: to the last sample.
        """
        return self._statistic(np.nanmax, start_s, stop_s, exact=True)

    # ------------------------------------------------------------------------------------------------------- calculus

    def derivative(self) -> "Signal":
        """Return the change per second over the real time stamps, as `numpy.gradient` does at uneven times.

        Over a time without samples it goes straight, as `integral` does; beside a NaN sample it is NaN.
        """
        columns = [calculus.derivative(self.times, column) for column in self._columns("differentiate", from_base)]
        return self._with(columns, units.quotient(self.unit, "s"), f"d({self.name})")

    def integral(self) -> "Signal":
        """Return the area under the signal since its first sample, by trapezoids; a NaN sample adds nothing."""
        columns = [calculus.integral(self.times, column) for column in self._columns("integrate")]
        return self._with(columns, units.product(self.unit, "s"), f"integral({self.name})")

    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the amplitudes of the sines that the signal is made of.

        Hann window, mean taken out, of the longest stretch without a hole; a loop that is late makes none: its samples
        are put on an even grid. A warning says how much is left out. Fewer than 4 samples have no spectrum.

        Returns:
            Frequencies in Hz, shape `(f,)`, and the amplitude at each, shape `(f,)` or `(f, components)`.

        Raises:
            ElementError: some components have NaN, others not.
        """
        pieces = [
            spectra.longest_piece(self.time_ns, column, most=None) for column in self._columns("take the spectrum of")
        ]
        found = [spectra.lines_of(piece) for piece in pieces]
        if not found:
            return np.zeros(0), np.zeros(0)
        if pieces[0].left_out:
            warn_outside(f"spectrum of '{self.name}', which has holes: {pieces[0].left_out}")
        if len({len(frequencies) for frequencies, _ in found}) > 1:
            raise ElementError(f"'{self.name}' has NaN in some components only: take the spectrum of each component")
        frequencies, first = found[0]
        return frequencies, first if self.values.ndim == 1 else np.stack([each for _, each in found], axis=-1)

    def norm(self) -> "Signal":
        """Return the length of a vector, sample by sample."""
        columns = self._columns("take the norm of")
        length = np.sqrt(sum((column**2 for column in columns), np.zeros(len(self))))
        return replace(
            self, name=f"|{self.name}|", values=length, kind="scalar", components=(), labels={}, component_labels={}
        )

    # ----------------------------------------------------------------------------------------------------- as an array

    def __iter__(self) -> Iterator[Any]:
        """The samples, oldest first."""
        return iter(self.values)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of `values`: samples first."""
        return tuple(self.values.shape)

    @property
    def ndim(self) -> int:
        """How many dimensions `values` has."""
        return int(self.values.ndim)

    @property
    def size(self) -> int:
        """How many numbers `values` has."""
        return int(self.values.size)

    def any(self) -> bool:
        """Return whether any value is true, or not 0."""
        return bool(np.any(self._numbers("look for truths in")))

    def all(self) -> bool:
        """Return whether all values are true, or not 0."""
        return bool(np.all(self._numbers("look for truths in")))

    def when(self) -> NDArray[np.float64]:
        """Return the times at which a mask becomes true: `(signal > 1).when()`.

        Returns:
            Seconds since start, shape `(n,)`.

        Raises:
            ElementError: it is no mask.
        """
        if self.values.dtype.kind != "b" or self.values.ndim > 1:
            raise ElementError(f"'{self.name}' is no mask; write a comparison: (signal > 1).when()")
        before = np.concatenate([[False], self.values[:-1]])
        times: NDArray[np.float64] = self.times[self.values & ~before[: len(self.values)]]
        return times

    def __getitem__(self, key: Any) -> Any:
        """Return a sample (`[5]`), samples (`[10:20]`), those of a time (`[2.0:3.5]` in seconds, both included), of a
        mask (`[signal > 1]`), or a component (`["x"]`, `[:, 0]`).
        """
        return indexing.chosen(self, key, self.clip)

    def __setitem__(self, key: object, values: object) -> NoReturn:
        raise ArgumentError("a signal is only read: values = signal.values.copy(), then values[...] = ...; or np.where")

    def __round__(self, digits: int = 0) -> "Signal":
        return cast(Signal, np.round(cast(Any, self), digits))

    if not TYPE_CHECKING:  # type checkers know which names there are

        def __getattr__(self, name: str) -> object:
            others = _OTHER_NAMES | {one: f"it is signal['{one}']" for one in self.components}
            return no_attribute("a signal", name, type(self), others)

    # ------------------------------------------------------------------------------------------------------- plotting

    def plot(
        self,
        *others: "Signal",
        ax: Any = None,
        path: str | os.PathLike[str] | None = None,
        terminal: bool | None = None,
        title: str = "",
    ) -> Any:
        """Plot this signal, and others, over the time since their starts; all components.

        Args:
            *others: further signals.
            ax: axes of matplotlib to draw on.
            path: a PNG file to write.
            terminal: print it as text; by default where there is no matplotlib, or no screen.
            title: what stands above; the name if it is left out.

        Returns:
            The axes, the path, or None for a terminal.
        """
        from silo.analysis.plots.showing import show, signal_chart

        return show(signal_chart([self, *others], title or self.name), ax, path, terminal)

    # ------------------------------------------------------------------------------------------------ frames, tables

    def rotate(self, orientation: "Signal", inverse: bool = False) -> "Signal":
        """Return a 3-vector in the frame that the quaternion leads to. Needs scipy.

        Args:
            orientation: quaternions, `x y z w` or as their components say.
            inverse: rotate back.

        Raises:
            ElementError: one isn't a 3-vector, or the other no quaternion.
        """
        return frames.rotate(self, orientation, inverse)

    def euler(self, order: str = "ZYX", degrees: bool = False) -> "Signal":
        """Return a quaternion as Euler angles. Needs scipy.

        Args:
            order: three axes; upper case: intrinsic ones.
            degrees: in degrees, not radians.

        Raises:
            ElementError: it is no quaternion, or there is no such order.
        """
        return frames.euler(self, order, degrees)

    def quaternion(self, order: str = "ZYX", degrees: bool | None = None) -> "Signal":
        """Return Euler angles (or an angle-axis, or rotation matrices) as quaternion `x y z w`. Needs scipy.

        Args:
            order: three axes; upper case: intrinsic ones.
            degrees: they are in degrees, or not, whatever their unit is; None: as that says, radians if there is none.

        Raises:
            ElementError: it is no rotation, or there is no such order.
        """
        return frames.quaternion(self, order, degrees)

    def inverse(self) -> "Signal":
        """Return the inverse rotation of a quaternion. Needs scipy."""
        return frames.inverse(self)

    def _repr_html_(self) -> str:
        rows = [
            (f"{float(time):.6g}", *np.ravel(value).tolist())
            for time, value in zip(self.times[:8], self.values[:8], strict=True)
        ]
        more = f"and {len(self) - 8} more samples" if len(self) > 8 else ""
        return html_table(repr(self)[1:-1], ("time [s]", *(self.components or ("value",))), rows, more)

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

    def _window(self, start_s: float | None, stop_s: float | None) -> slice | NDArray[np.bool_]:
        start = INT64[0] if start_s is None else int(self._bound("start_s", start_s))
        stop = INT64[1] if stop_s is None else int(self._bound("stop_s", stop_s))
        return within(self.time_ns, start, stop)

    def _none_between(self, start_s: float | None, stop_s: float | None) -> ElementError:
        low = "its start" if start_s is None else f"{start_s:g} s"
        high = "its end" if stop_s is None else f"{stop_s:g} s"
        return ElementError(f"'{self.name}' has no sample from {low} to {high}; it {self._span}")

    def _bound(self, argument: str, given: float) -> NDArray[np.int64]:
        time = self._seconds(given)
        if time.ndim or np.isnan(time):
            raise ElementError(f"{argument} must be one time in seconds since start, got {shown(given)}")
        return self._stamps(time)

    def _statistic(
        self,
        function: Callable[..., Any],
        start_s: float | None,
        stop_s: float | None,
        exact: bool = False,
        taken: Callable[[NDArray[Any]], NDArray[Any]] = with_nan,
    ) -> Any:
        values = self._numbers("take statistics of")[self._window(start_s, stop_s)]
        if not len(values):
            raise self._none_between(start_s, stop_s)
        if isinstance(values, np.ma.MaskedArray) and not (exact and values.count(axis=0).all()):
            values = taken(values)
        if isinstance(values, np.ma.MaskedArray):
            # integers stay exact
            return np.asarray(values.min(axis=0) if function is np.nanmin else values.max(axis=0))[()]
        if not exact and values.dtype.kind != "c":
            values = taken(values).astype(np.promote_types(values.dtype, np.float64), copy=False)
        empty = np.isnan(values).all(axis=0) if values.dtype.kind in "fc" else np.False_
        if not empty.any():
            return function(values, axis=0)
        # only NaN: the answer is NaN, without a warning of NumPy
        return np.where(empty, np.nan, function(np.where(empty, 0, values), axis=0))[()]

    def _with(self, columns: list[NDArray[np.float64]], unit: str, name: str) -> "Signal":
        values = np.stack(columns, axis=-1).reshape(self.values.shape)
        return replace(self, name=name, values=values, unit=unit, labels={}, component_labels={})
