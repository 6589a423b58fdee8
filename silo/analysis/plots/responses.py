"""Charts of transfer functions and step responses."""

import math

import numpy as np

from silo.analysis.compute.responses import Bode, StepResponse
from silo.analysis.plots.drawing import Chart, Curve


def bode_charts(found: Bode, title: str = "") -> tuple[Chart, Chart]:
    """The magnitude, and the phase with the coherence, over the logarithm of the frequency."""
    x = np.log10(found.frequency_hz)
    ticks = _decades(float(found.frequency_hz[0]), float(found.frequency_hz[-1]))
    magnitude = Chart([Curve("magnitude [dB]", x, found.magnitude_db)], title, left_label="dB", x_ticks=ticks)
    phase = Chart(
        [Curve("phase [deg]", x, found.phase_deg), Curve("coherence", x, found.coherence, right=True)],
        x_label="frequency [Hz]", left_label="deg", x_ticks=ticks, right_span=(0.0, 1.0),
    )  # fmt: skip
    return magnitude, phase


def step_chart(found: StepResponse, unit: str = "", title: str = "") -> Chart:
    """The course of the output from the step on, with where it comes to."""
    ends = np.array([found.times[0], found.times[-1]])
    curves = [Curve("output", found.times, found.values), Curve("comes to", ends, np.full(2, found.final))]
    return Chart(curves, title, "time since the step [s]", unit)


def step_words(found: StepResponse, given_unit: str = "", unit: str = "") -> tuple[str, str]:
    """From where to where it went, and how; the units are those of the input and of the output."""
    by, unit = ("" if one in ("", "-") else f" {one}" for one in (given_unit, unit))
    rise = "no rise to 90 %" if math.isnan(found.rise_s) else f"rise time {found.rise_s:.4g} s (10 to 90 %)"
    settled = "not settled" if math.isnan(found.settled_s) else f"within 2 % after {found.settled_s:.4g} s"
    return (
        f"step of {found.step:g}{by} at {found.at_s:.6g} s: from {found.start:.6g} to {found.final:.6g}{unit}, gain "
        f"{found.gain:.4g}",
        f"{rise}, overshoot {found.overshoot:.1%}, {settled}",
    )


def _decades(low: float, high: float) -> dict[float, str]:
    """1, 2 and 5 of each decade between two frequencies, by their logarithms; the powers of ten alone of many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    shares = (1,) if len(powers) > 4 else (1, 2, 5)
    found = [share * 10.0**power for power in powers for share in shares]
    return {math.log10(hz): f"{hz:g}" for hz in found if low * 0.999 <= hz <= high * 1.001}
