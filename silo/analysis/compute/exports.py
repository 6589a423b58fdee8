"""Signals and logs as tables of other libraries: pandas, polars, xarray (extras).

Time stamps keep their nanoseconds. Enumerations become categories, ticks without sample become missing values.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples
from silo.core.arrays.values import missing_in, with_nan
from silo.core.recording import places_on
from silo.errors import ElementError
from silo.files.optional_packages import need

_WHAT = "tables"


def signal_to_pandas(signal: Samples) -> Any:
    """Return a Series, or DataFrame for several components."""
    pandas = need("pandas", "analysis", _WHAT)
    index = pandas.DatetimeIndex(signal.time_ns.view("M8[ns]"), name="time")
    made = {name: _pandas_column(pandas, column, index) for name, column in _columns(signal).items()}
    if len(made) == 1 and not signal.components:
        return made[signal.name].rename(signal.name)
    return pandas.DataFrame(made, index=index)


def signal_to_polars(signal: Samples) -> Any:
    """Return a DataFrame with `time` and one column per component."""
    polars = need("polars", "analysis", _WHAT)
    time = polars.Series("time", signal.time_ns).cast(polars.Datetime("ns"))
    return polars.DataFrame([time, *(_polars_column(polars, name, each) for name, each in _columns(signal).items())])


def signal_to_xarray(signal: Samples) -> Any:
    """Return a DataArray over `time` (and `component`, or `row` and `column`)."""
    xarray = need("xarray", "analysis", _WHAT)
    values = with_nan(signal.values)
    dims = {1: ["time"], 2: ["time", "component"], 3: ["time", "row", "column"]}.get(
        values.ndim, ["time", *(f"axis_{axis}" for axis in range(values.ndim - 1))]
    )
    coordinates: dict[str, Any] = {"time": signal.time_ns.view("M8[ns]")}
    if values.ndim == 2 and len(signal.components) == values.shape[1]:
        coordinates["component"] = list(signal.components)
    attributes: dict[str, Any] = {"units": signal.unit, "description": signal.description, "divider": signal.divider}
    if values.dtype.kind in "mM":
        del attributes["units"]  # `to_netcdf` writes its own there, which say since when dates count
    if signal.labels:
        attributes["flag_values"] = list(signal.labels)
        attributes["flag_meanings"] = " ".join(label.replace(" ", "_") for label in signal.labels.values())
    return xarray.DataArray(values, coordinates, dims, name=signal.name, attrs=attributes)


def log_to_pandas(signals: Mapping[str, Samples], time_ns: NDArray[np.int64]) -> Any:
    """Return a DataFrame with one row per tick and one column per scalar."""
    pandas = need("pandas", "analysis", _WHAT)
    index = pandas.DatetimeIndex(time_ns.view("M8[ns]"), name="time")
    columns = {}
    for signal in signals.values():
        # by number of the tick: stamps may be there twice
        places = _ticks(signal, time_ns)
        for name, column in _columns(signal).items():
            series = _pandas_column(pandas, column, places)
            whole = len(column) == len(time_ns)
            if not whole and column.values.dtype.kind in "iu" and not column.labels:
                # pandas' nullable integers: as doubles, large ones would change
                series = series.astype({"i": "Int64", "u": "UInt64"}[column.values.dtype.kind])
            columns[name] = series if whole else series.reindex(range(len(time_ns)))
    frame = pandas.DataFrame(columns, index=range(len(time_ns)))
    frame.index = index
    return frame


def log_to_polars(signals: Mapping[str, Samples], time_ns: NDArray[np.int64]) -> Any:
    """Return a DataFrame with `time`, one row per tick and one column per scalar, null where there is no sample."""
    polars = need("polars", "analysis", _WHAT)
    columns = [polars.Series("time", time_ns).cast(polars.Datetime("ns"))]
    for signal in signals.values():
        indices = np.full(len(time_ns), -1, np.int64)
        indices[_ticks(signal, time_ns)] = np.arange(len(signal))
        gather = polars.Series(indices)
        gather = gather.set(gather < 0, None)
        for name, column in _columns(signal).items():
            columns.append(_polars_column(polars, name, column).gather(gather))
    return polars.DataFrame(columns)


def log_to_xarray(signals: Mapping[str, Samples], time_ns: NDArray[np.int64]) -> Any:
    """Return a Dataset; signals that have not one sample per tick have a time of their own, named after them."""
    xarray = need("xarray", "analysis", _WHAT)
    variables = {}
    for name, signal in signals.items():
        array = signal_to_xarray(signal)
        own = {dim: f"{name}.{dim}" for dim in array.dims if dim != "time"}
        if not np.array_equal(signal.time_ns, time_ns):
            own["time"] = f"{name}.time"
        variables[name] = array.rename(own)
    return xarray.Dataset(variables)


def _columns(signal: Samples) -> dict[str, Samples]:
    """The scalars of a signal, their floats as tables have them."""
    if not signal.components and signal.values.ndim > 1:
        raise ElementError(f"'{signal.name}' of shape {signal.values.shape} doesn't fit a table")
    parts = [signal.component(index) for index in range(len(signal.components))] or [signal]
    return {part.name: _column(part) for part in parts}


def _column(scalar: Samples) -> Samples:
    dtype = scalar.values.dtype
    if dtype.kind != "f" or dtype.itemsize in (4, 8):
        return scalar
    return replace(scalar, values=scalar.values.astype(np.float32 if dtype.itemsize == 2 else np.float64))


def _ticks(signal: Samples, time_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return which tick each sample belongs to: the signal's first stamp, then every divider-th.

    Where these are not the stamps of the samples, it has stamps of its own.
    """
    if signal.axis_ns is time_ns and signal._ticks is not None:
        return signal._ticks
    steps = np.arange(len(signal), dtype=np.int64) * signal.divider
    if not len(steps):
        return steps
    # a clock that stepped back gives a stamp twice
    for first in np.flatnonzero(time_ns[: max(0, len(time_ns) - int(steps[-1]))] == signal.time_ns[0]).tolist():
        if np.array_equal(time_ns[first + steps], signal.time_ns):
            return np.asarray(first + steps)
    return places_on(time_ns, signal.time_ns)


def _pandas_column(pandas: Any, column: Samples, index: Any) -> Any:
    values = column.values
    missing = missing_in(values)
    if column.labels:
        texts = column.texts
        categories = list(dict.fromkeys([*column.labels.values(), *texts[~missing].tolist()]))
        return pandas.Series(pandas.Categorical(texts, categories=categories), index=index)
    if missing.any():
        # pandas' nullable types
        data, kind = np.asarray(values.data), {"i": "Int64", "u": "UInt64", "b": "boolean"}[values.dtype.kind]
        return pandas.Series(data, index=index).astype(kind).mask(missing)
    # what silo reads from a file may be unaligned and read-only
    return pandas.Series(values.tolist() if values.dtype.kind in "UV" else values.copy(), index=index)


def _polars_column(polars: Any, name: str, column: Samples) -> Any:
    missing = missing_in(column.values)
    if not missing.any():
        return _whole_column(polars, name, column, column.values)
    series = _whole_column(polars, name, column, np.asarray(column.values.data))
    return polars.select(polars.when(polars.Series(~missing)).then(series).alias(name)).to_series()


def _whole_column(polars: Any, name: str, column: Samples, values: NDArray[Any]) -> Any:
    if column.labels:
        return polars.Series(name, column.texts.tolist(), dtype=polars.String).cast(polars.Categorical)
    if values.dtype.kind in "UV":
        cells = [v if isinstance(v, str) else bytes(v) for v in values.tolist()]
        return polars.Series(name, cells, dtype=polars.String if values.dtype.kind == "U" else polars.Binary)
    if values.dtype.kind in "mM":
        step, _ = np.datetime_data(values.dtype)
        if step not in ("ms", "us", "ns") and (values.dtype.kind, step) != ("M", "D"):  # those that polars has
            values = values.astype(f"{values.dtype.kind}8[{'ns' if step in ('ps', 'fs', 'as') else 'ms'}]")
    return polars.Series(name, np.ascontiguousarray(values))
