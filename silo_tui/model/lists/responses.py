"""How one signal answers to another: of a log, or of what a logger's buffers hold around an excitation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.responses import Bode
from silo.analysis.parameters import LoggedExcitation, ToldExcitation, excitations_told
from silo.analysis.responses import excites
from silo.analysis.signal import Signal
from silo.core.elements import ElementInfo, LoggedEvent
from silo.core.names import Names, component_name
from silo.errors import ElementError
from silo_tui.model.words import text

AROUND = 4  # a part of an excitation that is read before and after it: windows reach over its ends
GONE = "the buffers hold nothing of the excitation any more: it was overwritten"
GOOD = 0.8  # coherence, below which the curve isn't to be trusted


@dataclass(frozen=True)
class SignalName:
    """A signal as a logger knows it: an element, or one of its entries."""

    name: str
    element: ElementInfo
    components: tuple[str, ...] = ()


def named_signal(elements: Sequence[ElementInfo], prefix: str, typed: str) -> SignalName:
    """Return the signal that is meant. Raises ElementError for none, or several."""
    entries = [[info.name + entry.suffix for entry in info.entries] for info in elements]
    names = Names(tuple(info.name for info in elements), prefix, lambda: entries)
    found = names.find(typed, scalars=True, namespaces=False)
    if len(found) > 1:
        raise ElementError(names.several(typed, found))
    if not found:
        raise ElementError(f"there is no signal '{typed}'{names.hint(typed, 'the table has all names')}")
    place, index = found[0]
    info = elements[place]
    if index is None and len(info.entries) > 1:
        return SignalName(info.name, info, tuple(component_name(entry.suffix) for entry in info.entries))
    return SignalName(entries[place][index or 0], info)


@dataclass(frozen=True)
class Response:
    """What is asked: how one signal answers to another, and to which excitation; `began_ns` is the run it was in.

    `window` is from when to when it is looked at, s from the first sample: None for all.
    """

    given: SignalName
    answer: SignalName
    told: ToldExcitation | None
    began_ns: int
    window: tuple[float | None, float | None] = (None, None)

    @property
    def words(self) -> str:
        """Of what it is: the window, else the excitation; empty where it is of all that is held."""
        if None not in self.window:
            return "{:g} to {:g} s".format(*self.window)
        return self.told.what.text if self.told is not None else ""

    @property
    def ticks(self) -> tuple[int, int]:
        """From which tick to before which one it is read."""
        if self.told is None:
            return -(2**62), 2**62
        if self.told.until is None:
            return 0, 2**62
        around = (self.told.until - self.told.tick) // AROUND + 1
        return self.told.tick - around, self.told.until + around


def typed_window(words: Sequence[str]) -> tuple[float | None, float | None]:
    """Return from when to when, as typed: two numbers or nothing. Raises ElementError."""
    try:
        start_s, stop_s = map(float, words) if words else (None, None)
    except ValueError:
        raise ElementError(f"'{' '.join(words)}' is no stretch of time: two numbers, seconds") from None
    return start_s, stop_s


def last_told(events: Sequence[LoggedEvent], given: SignalName) -> ToldExcitation | None:
    """Return the last excitation of a signal, of which the events of a run tell."""
    told = sorted(events, key=lambda event: (event.tick, event.time_ns, event.number))
    found = [one for one in excitations_told(told) if excites(one.what, given.name)]
    return found[-1] if found else None


@dataclass(frozen=True)
class HeldSamples:
    """Samples of one signal: `ticks` and `time_ns` of shape `(n,)`, `values` beside them."""

    ticks: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[np.generic]
    divider: int
    why: str = ""


class HeldResponse:
    """What the buffers hold of two signals, as the log of which transfer functions are made."""

    def __init__(self, asked: Response, given: HeldSamples, answer: HeldSamples) -> None:
        """Take the samples of both. Raises ElementError where the buffers hold none, or none of the excitation."""
        names = asked.given, asked.answer
        for name, held in zip(names, (given, answer), strict=True):
            if not len(held.ticks) and asked.told is not None and not held.why:
                raise ElementError(GONE)
            if not len(held.ticks):
                raise ElementError(f"no sample of {name.name} is held{': ' if held.why else ''}{held.why}")
        start_ns = min(int(given.time_ns[0]), int(answer.time_ns[0]))
        self._signals = {
            name.name: Signal(
                name.name, held.values, held.time_ns, name.element.unit, name.element.kind, held.divider, start_ns,
                name.components,
            )
            for name, held in zip(names, (given, answer), strict=True)
        }  # fmt: skip
        self.excitations: list[LoggedExcitation] = []
        self.missing = ""
        if asked.told is not None:
            begin, end = asked.told.tick, int(given.ticks[-1]) if asked.told.until is None else asked.told.until
            first = max(int(given.ticks[0]), int(answer.ticks[0]))
            if end <= first:
                raise ElementError(GONE)
            if first >= begin + max(given.divider, answer.divider):
                self.missing = f"the first {(first - begin) / (end - begin):.0%} of it is overwritten"
            seconds = (given.time_ns - start_ns) * 1e-9
            start_s, stop_s = np.interp([max(begin, first), end], given.ticks, seconds)
            self.excitations = [LoggedExcitation(asked.told.what, float(start_s), float(stop_s), asked.told.ended)]

    @property
    def parameters(self) -> "HeldResponse":
        """What was tuned, of which only the excitation is known."""
        return self

    def __getitem__(self, name: str) -> Signal:
        """Return one of both."""
        return self._signals[name]


def bode_words(found: Bode) -> str:
    """How much of the answer the input explains, and where it doesn't."""
    lowest = int(np.argmin(found.coherence))
    words = f"coherence {np.median(found.coherence):.2f}, lowest {found.coherence[lowest]:.2f}"
    words += f" at {text.short(found.frequency_hz[lowest], 3)} Hz"
    poor = found.coherence < GOOD
    return f"{words}; below {GOOD:g} at {poor.mean():.0%}, where the curve says little" if poor.any() else words


def rate_words(given: Signal, frequency_hz: float) -> str:
    """What to do about an input that is logged more slowly than the loop turns; empty where it isn't."""
    if given.divider <= 1:
        return ""
    rate = f" {text.compact(frequency_hz / given.divider)} times a second" if frequency_hz else ""
    return f"{given.name} is logged{rate} only: set its divider to 1 before it is excited"
