"""What somebody asks for in words: `chirp 0.1-20Hz amplitude 2 for 20s` is an excitation."""

from silo.core.arguments import shown
from silo.core.quantities.reading import seconds_of
from silo.core.tuning.excitation import element_of, usual_ramp_s
from silo.core.tuning.parameters import Excitation, Wave
from silo.errors import ElementError

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
