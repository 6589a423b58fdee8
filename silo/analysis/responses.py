"""Transfer functions and step responses of a log: which part of it, on which time axis."""

from collections.abc import Collection, Sequence
from typing import Protocol

import numpy as np

from silo.analysis.compute.arithmetic import warn_outside
from silo.analysis.compute.responses import SEGMENTS, Bode, StepResponse, bode_of, evenly, step_of
from silo.analysis.parameters import LoggedExcitation
from silo.analysis.signal import Signal
from silo.core.arguments import real, text
from silo.core.arrays.values import Floats
from silo.core.tuning.excitation import period_s
from silo.core.tuning.parameters import Excitation, Wave
from silo.errors import ElementError

PRBS_SHARE = 0.8  # of its rate, at which it has no power
_STEPS = (Wave.STEP,)
_WITH_BAND = tuple(wave for wave in Wave if wave is not Wave.STEP)
BEFORE_STEP = 0.2  # of its time, from which its begin is known


class HasExcitations(Protocol):
    """What tells of excitations, seen from here."""

    @property
    def excitations(self) -> Sequence[LoggedExcitation]:
        """What was excited, oldest first."""


class ResponseLog(Protocol):
    """A log, seen from here."""

    @property
    def parameters(self) -> HasExcitations:
        """What was tuned."""

    def __getitem__(self, name: str, /) -> Signal:
        """One signal."""


def bode_between(
    log: ResponseLog, given: str, answer: str, start_s: float | None, stop_s: float | None, segment_s: float | None
) -> Bode:
    """Return the transfer function of a part of a log. Raises ElementError."""
    signals = _at_common_ticks(*_signals(log, given, answer))
    one = _excitation(log, signals[0], start_s, stop_s, _WITH_BAND)
    begin, end = _window(signals, one, start_s, stop_s)
    segment = (end - begin) / SEGMENTS if segment_s is None else real("segment_s", segment_s, 0, 1e6, "s")
    if one is not None and segment_s is None and 0 < (period := period_s(one.what)) < end - begin:
        segment = max(1.0, segment // period) * period  # then its sines are lines
    margin = segment / 2 if one is not None else 0.0
    times, values = _together(signals, begin - margin, end + margin)
    sampled_s, even = evenly(times, values)
    low_hz, high_hz = 0.0, 0.5 / sampled_s
    if one is not None and one.what.high_hz:
        low_hz = one.what.low_hz
        high_hz = min(high_hz, one.what.high_hz * (PRBS_SHARE if one.what.wave is Wave.PRBS else 1.0))
    return bode_of(sampled_s, even[:, 0], even[:, 1], segment, low_hz, high_hz)


def step_between(
    log: ResponseLog, given: str, answer: str, start_s: float | None, stop_s: float | None
) -> StepResponse:
    """Return the answer to the largest step in a part of a log. Raises ElementError."""
    signals = _signals(log, given, answer)
    one = _excitation(log, signals[0], start_s, stop_s, _STEPS)
    begin, end = _window(signals, one, start_s, stop_s)
    times, values = _together(signals, begin - (BEFORE_STEP * (end - begin) if one is not None else 0.0), end)
    return step_of(times, values[:, 0], values[:, 1])


def _signals(log: ResponseLog, *names: str) -> list[Signal]:
    found = [log[text("a signal", name, 'log.bode("tau", "q")')] for name in names]
    found = [one.component(0) if len(one.components) == 1 else one for one in found]
    for one in found:
        if one.components:
            parts = ", ".join(one.component(place).name for place in range(min(3, len(one.components))))
            raise ElementError(f"'{one.name}' has {len(one.components)} components, write which: {parts} ...")
        if one.values.dtype.kind not in "biuf":
            raise ElementError(f"'{one.name}' is no number")
    return found


def excites(what: Excitation, name: str) -> bool:
    """Whether an excitation moves the signal of a whole name."""
    return name in (what.name, f"{what.name}_{what.index}")


def excitation_words(
    log: ResponseLog, given: str, start_s: float | None, stop_s: float | None, *, step: bool = False
) -> str:
    """Return of which excitation a transfer function is, or the answer to a `step`; empty where it is of none."""
    if start_s is not None or stop_s is not None:
        return ""
    found = _excitations(log, log[given], _STEPS if step else _WITH_BAND)
    return _words(found[-1]) if found else ""


def _words(one: LoggedExcitation) -> str:
    return f"{one.what.text}, from {one.start_s:.6g} to {one.stop_s:.6g} s"


def _excitations(log: ResponseLog, given: Signal, waves: Collection[Wave]) -> list[LoggedExcitation]:
    return [one for one in log.parameters.excitations if excites(one.what, given.name) and one.what.wave in waves]


def _excitation(
    log: ResponseLog, given: Signal, start_s: float | None, stop_s: float | None, waves: Collection[Wave]
) -> LoggedExcitation | None:
    """The last one of this signal by one of these waves, unless somebody says which time is meant.

    Warns which of several it is. Raises ElementError where a band is wanted, and steps alone were.
    """
    if start_s is not None or stop_s is not None:
        return None
    every, found = (_excitations(log, given, which) for which in (tuple(Wave), waves))
    if every and not found and Wave.STEP not in waves:
        raise ElementError(
            f"'{given.name}' was excited by a step alone ({_words(every[-1])}), which has no band of frequencies: "
            f"log.step('{given.name}', ...), or `silo step`, tells the answer to it; a given window is taken as it is"
        )
    if len(every) > 1 and found:
        warn_outside(
            f"of {len(every)} excitations of '{given.name}' this is of the last {_kind(waves)}: {_words(found[-1])}; "
            "give a window for another one"
        )
    return found[-1] if found else None


def _kind(waves: Collection[Wave]) -> str:
    return "step" if Wave.STEP in waves else "that has a band"


def _window(
    signals: list[Signal], one: LoggedExcitation | None, start_s: float | None, stop_s: float | None
) -> tuple[float, float]:
    if one is not None:
        return one.start_s, one.stop_s
    first, last = max(float(each.times[0]) for each in signals), min(float(each.times[-1]) for each in signals)
    begin = first if start_s is None else real("start_s", start_s, -1e9, 1e9, "s")
    return begin, last if stop_s is None else real("stop_s", stop_s, -1e9, 1e9, "s")


def _at_common_ticks(one: Signal, other: Signal) -> list[Signal]:
    """Both where both have a sample, if no rate divides the other: a value held in between has another phase."""
    if one.divider % other.divider and other.divider % one.divider:
        common = np.intersect1d(one.time_ns, other.time_ns)
        if len(common):
            return [one._held(common), other._held(common)]
    return [one, other]


def _together(signals: list[Signal], begin: float, end: float) -> tuple[Floats, Floats]:
    """Both at the times of the slower one, values of shape `(n, 2)`."""
    slow = max(signals, key=lambda one: (one.divider, -len(one)))
    inside = (slow.times >= begin) & (slow.times <= end)
    times = slow.times[inside]
    if not len(times):
        gone = "; buffers keep the newest: a recording (`silo record`), or a larger size, keeps what was before"
        way_out = gone if len(slow) and end < slow.times[0] else ""
        raise ElementError(f"'{slow.name}' has no sample from {begin:g} to {end:g} s, it {slow._span}{way_out}")
    columns = [one.values[inside] if one is slow else one.resample(times).values for one in signals]
    lengths = {len(column) for column in columns}
    if len(lengths) > 1:
        raise ElementError(f"'{signals[0].name}' and '{signals[1].name}' don't reach over the same time")
    return times, np.stack([np.ma.filled(np.ma.asarray(column, float), np.nan) for column in columns], axis=1)
