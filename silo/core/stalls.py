"""Whether a logger that runs ticks at all: a frozen program looks like one that logs, but for its ticks."""

from silo.core.quantities.writing import duration

STALLED_S = 3.0  # on two busy processors a loop of 400 Hz stood still for up to 0.4 s
STALLED_PERIODS = 5


def is_stalled(idle_s: float, frequency_hz: float) -> bool:
    """Return whether a logger that runs has had no tick for so long that it is not only slow."""
    return idle_s >= STALLED_S and idle_s * frequency_hz >= STALLED_PERIODS


def idle_words(idle_s: float) -> str:
    """Return `no tick for 4 min`."""
    return f"no tick for {whole_duration(idle_s)}"


def whole_duration(seconds: float) -> str:
    """Return a time that goes on, in whole units: `14 s`, `5 min`, `3 h`."""
    unit = 1 if seconds < 120 else 60 if seconds < 7200 else 3600
    return duration(float(seconds // unit * unit))
