"""Excitation of a parameter: what is asked for in words, which course it takes, what of it fits.

Pure rules, without NumPy: clients show what the robot program will do, by the same functions.
"""

import math

from silo.core.arguments import shown
from silo.core.quantities.reading import seconds_of
from silo.core.tuning.parameters import (
    Excitation,
    ParameterInfo,
    ParameterKind,
    ParameterValue,
    Wave,
    range_text,
    value_text,
)
from silo.errors import ElementError

LEASE_S = 2.0  # whoever asked for it and says nothing for so long is gone: it ends
ENDED = "excitation ended: "  # begins the event of its end
OVER = "it is over"  # behind that, of one that came to its own end
LONGEST_S = 3600.0
LOWEST_HZ = 1e-4
WHOLE, LARGEST = 2.0**53, 1e300  # beyond, a float is no whole number, or none at all
FINEST = 8  # the lowest sine of a multisine is at most that harmonic of its period
MOST_BITS = 1 << 16  # of a PRBS
USUAL_RAMP_S = 1.0
HIGHEST_SHARE = 0.4  # of the rate of the loop: above, a sine is hardly more than a change of sign


def element_of(name: str) -> tuple[str, int]:
    """Return which value of which parameter a name means: `tau_offset[3]`, of others 0."""
    bare, bracket, index = name.partition("[")
    number = index.removesuffix("]")
    return (bare, int(number)) if bracket and number.isdecimal() else (name, 0)


def usual_ramp_s(wave: Wave, duration_s: float) -> float:
    """How long it rises and falls if nobody says so: a step is meant to jump."""
    return 0.0 if wave is Wave.STEP else min(USUAL_RAMP_S, duration_s / 10)


def ends_of(info: ParameterInfo, what: Excitation) -> tuple[ParameterValue, ParameterValue]:
    """The whole values of a parameter, least and most, that an excitation of its present one comes to.

    Raises ElementError where it leaves the bounds, with them, or asks for what makes no sense.
    """
    _check_numbers(what)
    subject = f"parameter '{info.name}'"
    if info.kind not in (ParameterKind.FLOAT, ParameterKind.INT):
        raise ElementError(f"{subject}: a {info.kind.value} can't be excited, numbers can; nothing was changed")
    if not 0 <= what.index < info.count:
        raise ElementError(f"{subject}: it has the values 0 to {info.count - 1}, not {what.index}; nothing was changed")
    now = number_at(info.value, what.index)
    largest = WHOLE if info.kind is ParameterKind.INT else LARGEST
    if abs(now) + abs(what.amplitude) > largest or not math.isfinite(what.amplitude / (info.step or 1.0)):
        raise ElementError(f"{subject}: around {now:g} it can't be excited by {what.amplitude:g}; nothing was changed")
    if what.wave is Wave.STEP:
        low, high = sorted((now, now + what.amplitude))
    else:
        low, high = now - abs(what.amplitude), now + abs(what.amplitude)
    rooms = [now - info.minimum] if info.minimum is not None and low < now else []
    rooms += [info.maximum - now] if info.maximum is not None and high > now else []
    if rooms and max(high - now, now - low) > min(rooms) + 1e-12 * abs(now):
        raise ElementError(
            f"{subject}: {value_text(now)} with an amplitude of {what.amplitude:g} goes from {low:g} to {high:g}, it "
            f"takes {range_text(info)}: an amplitude of at most {max(0.0, min(rooms)):g} fits; nothing was changed"
        )
    fastest = steepest(what)
    if info.rate and math.isfinite(fastest) and fastest > info.rate:
        raise ElementError(
            f"{subject}: it moves by at most {info.rate:g} a second (rate=), this one by up to {fastest:g}: lower its "
            "amplitude or frequency; nothing was changed"
        )
    return _with(info, what.index, low), _with(info, what.index, high)


def check_rate(what: Excitation, frequency_hz: float) -> None:
    """Raise ElementError where a loop of this rate is too slow for it."""
    most = HIGHEST_SHARE * frequency_hz if what.wave is not Wave.PRBS else frequency_hz
    if what.high_hz > most:
        raise ElementError(
            f"{what.high_hz:g} Hz is too fast for a loop of {frequency_hz:g} Hz: up to {most:g} Hz; nothing was changed"
        )


def number_at(value: ParameterValue, index: int) -> float:
    """Return the number of a value that an excitation means, where it is an array."""
    found = value[index] if isinstance(value, tuple) else value
    assert isinstance(found, float | int)
    return found


def _with(info: ParameterInfo, index: int, number: float) -> ParameterValue:
    number = round(number) if info.kind is ParameterKind.INT else number
    if not isinstance(info.value, tuple):
        return number
    return (*info.value[:index], number, *info.value[index + 1 :])


def _check_numbers(what: Excitation) -> None:
    numbers = (what.amplitude, what.duration_s, what.low_hz, what.high_hz, what.ramp_s)
    if not all(map(math.isfinite, numbers)) or not what.amplitude:
        raise ElementError(f"an amplitude is a number other than 0, got {what.amplitude:g}; nothing was changed")
    if not 0 < what.duration_s <= LONGEST_S:
        raise ElementError(f"it lasts more than 0 and up to {LONGEST_S:g} s, got {what.duration_s:g} s")
    if not 0 <= 2 * what.ramp_s <= what.duration_s:
        raise ElementError(f"ramps take 0 to half of its {what.duration_s:g} s, got {what.ramp_s:g} s")
    if what.wave is Wave.PRBS and not 0 < what.high_hz * what.duration_s <= MOST_BITS:
        raise ElementError(f"a PRBS has a rate above 0, and up to {MOST_BITS} bits: got {what.high_hz:g} bit/s")
    if what.wave in (Wave.CHIRP, Wave.MULTISINE) and not LOWEST_HZ <= what.low_hz <= what.high_hz:
        raise ElementError(
            f"frequencies go up from {LOWEST_HZ:g} Hz or more, as 0.1-20Hz, got {what.low_hz:g} to {what.high_hz:g} Hz"
        )


def period_s(what: Excitation) -> float:
    """The period of a multisine, of which all its sines are harmonics; 0 of others."""
    if what.wave is not Wave.MULTISINE:
        return 0.0
    lowest = max(1, min(FINEST, int(what.low_hz * what.duration_s)))  # of a period that fits in
    return lowest / what.low_hz


def steepest(what: Excitation) -> float:
    """By how much it changes a second at most; infinity for jumps."""
    if what.wave in (Wave.PRBS, Wave.STEP):
        return math.inf if not what.ramp_s or what.wave is Wave.PRBS else abs(what.amplitude) / what.ramp_s
    return abs(what.amplitude) * (2 * math.pi * what.high_hz + (1 / what.ramp_s if what.ramp_s else 0.0))


EXAMPLE = "chirp 0.1-20Hz amplitude 2 for 20s"
_WORDS = ("amplitude", "for", "ramp")


def excitation_of(
    name: str, wave: Wave, band: str, amplitude: float, lasting: str, ramp: str | None = None
) -> Excitation:
    """Return what the words ask for. Raises ElementError where they make no sense."""
    low_hz, high_hz = _band(wave, band)
    duration_s = _seconds("for", lasting)
    ramp_s = usual_ramp_s(wave, duration_s) if ramp is None else _seconds("ramp", ramp)
    bare, index = element_of(name)
    return Excitation(bare, wave, amplitude, duration_s, low_hz, high_hz, ramp_s, index)


def read_excitation(name: str, line: str) -> Excitation:
    """Read a whole line: a wave with its band or rate, then `amplitude`, `for`, `ramp`. Raises ElementError."""
    first, *rest = line.replace(",", " ").split() or [""]
    if first not in [wave.value for wave in Wave]:
        raise ElementError(f"an excitation begins with chirp, multisine, prbs or step, got {shown(first)}: {EXAMPLE}")
    band = "" if first == Wave.STEP.value or not rest else rest.pop(0)
    given = dict(zip(rest[::2], rest[1::2], strict=False))
    if len(rest) % 2 or len(given) * 2 != len(rest) or not set(given) <= set(_WORDS):
        raise ElementError(f"behind the wave stand amplitude, for and ramp, each once with a value: {EXAMPLE}")
    if missing := [word for word in _WORDS[:2] if word not in given]:
        raise ElementError(f"{' and '.join(missing)} must be said: {EXAMPLE}")
    try:
        amplitude = float(given["amplitude"])
    except ValueError:
        raise ElementError(f"amplitude must be a number, got {shown(given['amplitude'])}") from None
    return excitation_of(name, Wave(first), band, amplitude, given["for"], given.get("ramp"))


def _band(wave: Wave, words: str) -> tuple[float, float]:
    if wave is Wave.STEP:
        return 0.0, 0.0
    low, dash, high = words.lower().replace(" ", "").removesuffix("hz").rpartition("-")
    try:
        if wave is Wave.PRBS:
            return 0.0, float(high if not dash else "-")
        return float(low.removesuffix("hz") if dash else high), float(high)
    except ValueError:
        example = "50Hz" if wave is Wave.PRBS else "0.1-20Hz"
        raise ElementError(f"{wave.value} must be like {example}, got {shown(words)}") from None


def _seconds(word: str, given: str) -> float:
    seconds = seconds_of(given)
    if seconds is None:
        raise ElementError(f"'{word}' must be a time, got {shown(given)}; write 20s, 500ms, 2min")
    return seconds
