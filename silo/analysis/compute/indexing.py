"""What `signal[...]` gives: a sample, a stretch of samples or of time, those of a mask, a component.

Whole numbers count samples, fractions (`2.0`) are seconds since start: `signal[5]`, `signal[10:20]`, `signal[2.0:3.5]`.
Those never count from the end, as numbers of samples do: what is counted from another moment has times below 0.
"""

import operator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from silo.analysis.compute.samples import Samples
from silo.core.arguments import shown
from silo.core.recording import within
from silo.errors import ElementError

One = TypeVar("One", bound=Samples)


class NoSuchSampleError(ElementError, IndexError):
    """A signal has no such sample."""


def chosen(signal: One, key: Any, clip: Any) -> Any:
    """Return what a key stands for. `clip(start_s, stop_s)` cuts by time.

    Raises ElementError with what can be written instead.
    """
    if isinstance(key, str):
        return signal.component(key)
    if key is Ellipsis:
        return signal
    if isinstance(key, tuple):
        return _across(signal, key, clip)
    if isinstance(key, slice):
        return _stretch(signal, key, clip)
    if isinstance(key, float | np.floating):
        raise ElementError(
            f"'{signal.name}'[{float(key):g}]: samples are counted by whole numbers; write .value({float(key)}) for "
            f"the value at a time, or [{float(key)}:{float(key) + 1}] for a stretch of seconds"
        )
    if isinstance(key, Samples):
        return _masked(signal, key)
    found = _places(signal, key)
    if isinstance(found, int):
        return signal.values[found]
    return signal._part(found, divider=1)


def _places(signal: Samples, key: Any) -> Any:
    """Return a place, or an array of places or of a mask. Raises ElementError."""
    try:
        place = operator.index(key)
    except TypeError:
        pass
    else:
        if not isinstance(key, bool | np.bool_):
            if not -len(signal) <= place < len(signal):
                raise NoSuchSampleError(
                    f"'{signal.name}' has no sample {place}: it has {len(signal)}, counted from 0; seconds are written "
                    f"as fractions, [{place}.0:{place + 1}.0], or .value({place})"
                )
            return place
    try:
        found = np.asarray(key)
    except (TypeError, ValueError):
        found = np.asarray(None)
    if found.dtype.kind == "b" and found.shape == (len(signal),):
        return found
    if found.dtype.kind in "iu" and found.ndim == 1:
        if len(found) and not (-len(signal) <= found.min() and found.max() < len(signal)):
            raise NoSuchSampleError(f"'{signal.name}' has {len(signal)} samples, not all of {shown(key)}")
        return found
    if found.dtype.kind == "b":
        raise ElementError(
            f"a mask of '{signal.name}' must have one truth for each of its {len(signal)} samples, got shape "
            f"{found.shape}"
        )
    raise ElementError(
        f"can't take {shown(key)} of '{signal.name}': write a number of a sample, a slice of samples [10:20] or of "
        "seconds [2.0:3.5], a mask, or the name of a component"
    )


def _masked(signal: One, mask: Samples) -> One:
    if mask.values.dtype.kind != "b" or mask.values.ndim > 1:
        raise ElementError(
            f"'{mask.name}' can't choose samples of '{signal.name}': it is no mask of one truth per sample "
            f"({mask.dtype}, shape {mask.values.shape}); write a comparison, signal[signal['x'] > 1]"
        )
    if not np.array_equal(mask.time_ns, signal.time_ns):
        raise ElementError(
            f"'{mask.name}' can't choose samples of '{signal.name}': their time stamps differ; write "
            f"mask.resample(signal) first"
        )
    there = np.asarray(np.ma.filled(mask.values, False))
    return signal._part(there, divider=1)


def _stretch(signal: One, key: slice, clip: Any) -> One:
    if any(isinstance(bound, float | np.floating) for bound in (key.start, key.stop)):
        if key.step is not None:
            raise ElementError(
                f"a stretch of seconds of '{signal.name}' takes no step; write .clip({key.start}, {key.stop})[::2], or "
                ".resample(10) for 10 Hz"
            )
        _check_begin(signal, key)
        made: One = clip(key.start, key.stop)
        return made
    try:
        part = slice(*(None if bound is None else operator.index(bound) for bound in (key.start, key.stop, key.step)))
        signal.values[part]
    except (TypeError, ValueError):
        raise ElementError(
            f"bounds of '{signal.name}'[...] must be whole numbers of samples [10:20] or seconds [2.0:3.5], "
            f"got {shown(key)}"
        ) from None
    return signal._part(part, divider=signal.divider * abs(part.step or 1))


def _check_begin(signal: Samples, key: slice) -> None:
    """Refuse seconds that look as if they counted from the end; one around a moment may begin before the start."""
    bound = key.stop if key.stop is not None else key.start
    if not all(isinstance(one, float | int | np.number | None) for one in (key.start, key.stop)):
        return  # who cuts says so
    if not bound < 0 or (len(signal) and signal._seconds_of(signal._bounds[0]) < 0):
        return
    end = signal._seconds_of(signal._bounds[1]) if len(signal) else 0.0
    written = [round(end + float(one), 9) if one is not None and one < 0 else one for one in (key.start, key.stop)]
    asked, meant = (":".join("" if one is None else f"{float(one)}" for one in some)
                    for some in ((key.start, key.stop), written))  # fmt: skip
    raise ElementError(
        f"'{signal.name}'[{asked}]: seconds count from the start, and it {signal._span}; counted from its end that is "
        f"[{meant}]"
    )


def _across(signal: One, key: tuple[Any, ...], clip: Any) -> Any:
    """Samples and components: `signal[:, 0]`, `signal[5, "x"]`, `matrix[:, 0, 1]`."""
    if not key:
        return signal
    rows, *parts = key
    if not parts:
        return chosen(signal, rows, clip)
    picked = signal
    if len(parts) == 1 and isinstance(parts[0], str):
        picked = signal.component(parts[0])
    else:
        whole = (slice(None), *parts)
        try:
            values = signal.values[whole]
        except (IndexError, TypeError, ValueError) as error:
            raise NoSuchSampleError(
                f"one sample of '{signal.name}' has shape {signal.values.shape[1:]}: can't take {shown(parts)} of it "
                f"({error})"
            ) from None
        names = np.array(signal.components, object)
        if names.size == signal.values[:1].size or len(signal) == 0:
            names = names.reshape(signal.values.shape[1:])[tuple(parts)] if names.size else names
        components = tuple(np.ravel(names).tolist()) if values.ndim > 1 else ()
        text = ",".join(_text(part) for part in parts)
        name = f"{signal.name}_{names}" if isinstance(names, str) else f"{signal.name}[{text}]"
        kind = "scalar" if values.ndim == 1 else "array"
        picked = replace(signal, name=name, values=values, kind=kind, components=components)
        if isinstance(names, str):
            labels = signal.component_labels.get(names, signal.labels)
            picked = replace(picked, labels=labels, component_labels={})
    if isinstance(rows, slice) or rows is Ellipsis:
        return picked if rows in (slice(None), Ellipsis) else _stretch(picked, rows, _clip_of(picked, signal, clip))
    return chosen(picked, rows, clip)


def _clip_of(picked: Samples, signal: Samples, clip: Any) -> Any:
    """Cut a part of a signal as the whole would be cut."""

    def cut(start_s: float | None, stop_s: float | None) -> Any:
        window = clip(start_s, stop_s).time_ns
        part = within(signal.time_ns, *((window.min(), window.max()) if len(window) else (1, 0)))
        return replace(picked._part(part), time_ns=window)

    return cut


def _text(part: Any) -> str:
    if isinstance(part, slice):
        return ":".join("" if bound is None else str(bound) for bound in (part.start, part.stop))
    return str(part)
