"""Transfer functions and step responses, against systems whose function is known; what a log tells of excitations."""

import json
import math
import warnings
from dataclasses import replace

import msgspec
import numpy as np
import pytest

import silo
from silo.analysis.compute.responses import step_of
from silo.cli.main import run
from silo.core.elements import BufferType, Entry, LoggedEvent
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.core.tuning.parameters import Excitation, ParameterChange, Wave
from silo.errors import ElementError
from silo.parameters.excited import course_of

HZ = 500
REST_S, DURATION_S = 10.0, 30.0
CHIRP = Excitation("/log/tau", Wave.CHIRP, 2.0, DURATION_S, 0.2, 20.0, 1.0)
WAVES = {
    "chirp": CHIRP,
    "multisine": Excitation("/log/tau", Wave.MULTISINE, 2.0, DURATION_S, 0.5, 20.0, 1.0),
    "prbs": Excitation("/log/tau", Wave.PRBS, 2.0, DURATION_S, 0.0, 50.0, 0.0),
    "step": Excitation("/log/tau", Wave.STEP, 2.0, 5.0),
}
RESONANCE = 2 * math.pi * 5, 0.1


class FirstOrder:
    """1 / (0.1 s + 1), sampled by a hold."""

    delay, pole = 0, math.exp(-1 / (0.1 * HZ))
    forward, back = (0.0, 1 - pole), (1.0, -pole)


class Resonant:
    """w^2 / (s^2 + 2 z w s + w^2), sampled by a hold: an overshoot of 73 %."""

    delay, (turn, damping) = 0, RESONANCE
    decay, swing = math.exp(-damping * turn / HZ), turn * math.sqrt(1 - damping**2) / HZ
    sine, cosine = damping / math.sqrt(1 - damping**2) * math.sin(swing), math.cos(swing)
    forward = (0.0, 1 - decay * (cosine + sine), decay**2 + decay * (sine - cosine))
    back = (1.0, -2 * decay * cosine, decay**2)


class Delayed(FirstOrder):
    """The first one, 20 ms later."""

    delay = 10


SYSTEMS = {"first": FirstOrder, "resonant": Resonant, "delayed": Delayed}


def answer(system, given):
    out = np.zeros(len(given))
    late = np.concatenate([np.zeros(system.delay), given])[: len(given)]
    for at in range(2, len(given)):
        out[at] = sum(b * late[at - place] for place, b in enumerate(system.forward))
        out[at] -= sum(a * out[at - place] for place, a in enumerate(system.back) if place)
    return out


def function(system, hz):
    z = np.exp(-2j * np.pi * np.asarray(hz) / HZ)
    above = sum(b * z**place for place, b in enumerate(system.forward))
    return above / sum(a * z**place for place, a in enumerate(system.back)) * z**system.delay


def logged(what, system, noise=0.0, told=True):
    """A log of an excitation and its answer, as a robot leaves it."""
    course, rest = course_of(what), round(REST_S * HZ)
    count = round(what.duration_s * HZ)
    given = np.concatenate([np.zeros(rest), [course(at / HZ) for at in range(count)], np.zeros(rest)])
    out = answer(system, given) + noise * np.random.default_rng(1).normal(size=len(given))
    elements = [
        RecordedElement(
            name, unit, "scalar", (), 1, BufferType.FIXED, 0, (RecordedEntry(name, Entry("", "<f8"), column),)
        )
        for name, unit, column in (("/log/tau", "Nm", given), ("/log/q", "rad", out))
    ]
    change = ParameterChange((("/log/tau", 0.0, 0.0),), "shell", excitation=what)
    end = ParameterChange((("/log/tau", 0.0, 0.0),), "excitation ended: it is over")
    events = [
        LoggedEvent("parameter", "begin", tick=rest, change=change),
        LoggedEvent("parameter", "end", tick=rest + count, change=end, number=1),
    ]
    times = np.arange(len(given), dtype=np.int64) * (1_000_000_000 // HZ)
    kept = tuple(events) if told else ()
    return Recording("bot", times, len(given), elements, frequency_hz=float(HZ), events=kept)


# largest errors in dB and degrees over the band: what was measured, and a third more
LIMITS = {
    ("first", "chirp"): (0.04, 1.6), ("first", "multisine"): (0.2, 1.0), ("first", "prbs"): (0.11, 1.1),
    ("resonant", "chirp"): (0.15, 1.0), ("resonant", "multisine"): (0.6, 7.0), ("resonant", "prbs"): (0.3, 3.0),
    ("delayed", "chirp"): (0.04, 1.9), ("delayed", "multisine"): (0.2, 1.4), ("delayed", "prbs"): (0.11, 1.3),
}  # fmt: skip


@pytest.mark.parametrize(("system", "wave"), LIMITS)
def test_the_transfer_function_of_a_known_system_is_found_over_the_band(system, wave):
    hz, db, deg, coherence = silo.Log(logged(WAVES[wave], SYSTEMS[system])).bode("tau", "q")
    known = function(SYSTEMS[system], hz)
    errors = np.abs(db - 20 * np.log10(np.abs(known))), np.abs((deg - np.degrees(np.angle(known)) + 180) % 360 - 180)
    assert all(error.max() <= limit for error, limit in zip(errors, LIMITS[system, wave], strict=True)), [
        float(error.max()) for error in errors
    ]
    assert hz[0] <= 0.6
    assert hz[-1] >= (17 if wave == "chirp" else 19)
    assert coherence.min() > 0.95
    assert np.abs(np.diff(deg)).max() < 60  # without jumps


def test_noise_of_the_output_is_seen_in_the_coherence_and_hardly_moves_the_gain():
    quiet, loud = (silo.Log(logged(WAVES["prbs"], FirstOrder, noise)).bode("tau", "q") for noise in (0.0, 0.1))
    low = quiet.frequency_hz < 5
    assert loud.coherence[~low].min() < 0.95 < quiet.coherence.min()
    assert np.abs(loud.magnitude_db - quiet.magnitude_db)[low].max() < 0.5


def test_without_an_excitation_the_whole_log_is_taken_and_a_window_is_taken_at_its_word():
    log = silo.Log(logged(CHIRP, FirstOrder, told=False))
    assert log.bode("tau", "q").frequency_hz[-1] > 15
    high = log.bode("tau", "q", REST_S + 20, REST_S + DURATION_S)
    assert high.frequency_hz[0] > 1  # what was before isn't in it
    log.bode("q", "tau")  # any signal is an input


@pytest.mark.parametrize("dividers", [(3, 2), (3, 4), (2, 6), (1, 5)])
def test_rates_of_which_none_divides_the_other_meet_at_the_ticks_that_both_have(dividers):
    whole = logged(CHIRP, FirstOrder)
    elements = []
    for element, divider in zip(whole.elements, dividers, strict=True):
        (entry,) = element.entries
        some = RecordedEntry(entry.name, entry.entry, entry.values[::divider])
        elements.append(replace(element, divider=divider, entries=(some,)))
    hz, db, deg, _ = silo.Log(replace(whole, elements=tuple(elements))).bode("tau", "q")
    known, middle = function(FirstOrder, hz), (hz > 1) & (hz < 12)
    assert np.abs((deg - np.degrees(np.angle(known)) + 180) % 360 - 180)[middle].max() < 1.5
    assert np.abs(db - 20 * np.log10(np.abs(known)))[middle].max() < 0.5
    assert hz[-1] > 17


def test_samples_of_a_late_loop_are_put_on_an_even_grid():
    recording = logged(CHIRP, FirstOrder)
    recording.time_ns[:] += np.random.default_rng(2).integers(-400_000, 400_000, len(recording.time_ns))
    found = silo.Log(recording).bode("tau", "q")
    low = found.frequency_hz < 10
    error = found.magnitude_db - 20 * np.log10(np.abs(function(FirstOrder, found.frequency_hz)))
    assert np.abs(error[low]).max() < 0.5


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_step_response_has_rise_time_overshoot_and_gain(name):
    found = silo.Log(logged(WAVES["step"], SYSTEMS[name])).step("tau", "q")
    assert (found.step, found.start) == (2.0, 0.0)
    assert found.at_s == pytest.approx(REST_S, abs=2 / HZ)
    assert found.gain == pytest.approx(1.0, abs=0.001)
    damping = RESONANCE[1]
    overshoot = math.exp(-math.pi * damping / math.sqrt(1 - damping**2)) if name == "resonant" else 0.0
    assert found.overshoot == pytest.approx(overshoot, abs=0.005)
    assert found.rise_s == pytest.approx(0.0352 if name == "resonant" else 0.1 * math.log(9), abs=0.002)
    delay = 10 / HZ if name == "delayed" else 0.0
    if name != "resonant":
        assert found.settled_s == pytest.approx(0.1 * math.log(50) + delay, abs=2 / HZ)


def test_a_step_with_a_ramp_is_as_high_as_it_comes_to():
    what = Excitation("/log/tau", Wave.STEP, 2.0, 5.0, ramp_s=0.5)
    found = silo.Log(logged(what, FirstOrder)).step("tau", "q")
    assert found.step == pytest.approx(2.0)
    assert found.gain == pytest.approx(1.0, abs=0.001)
    cut = step_of(np.arange(5.0), np.array([0.0, 0, 0, 1, 2]), np.array([0.0, 0, 0, 0, 4]))  # as the log ends
    assert (cut.step, cut.at_s, cut.gain) == (2.0, 3.0, 2.0)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda log: log.bode("tau", "q", 3.0, 3.01), "5 samples of both are too few, at least 64 are needed"),
        (lambda log: log.bode("tau", "q", 1.0, 5.0), "the input has no power from 0 to 250 Hz"),
        (lambda log: log.step("tau", "q", 1.0, 5.0), "the input has no step"),
        (
            lambda log: log.bode("tau", "q", 100.0, 101.0),
            "'/log/tau' has no sample from 100 to 101 s, it has samples from 0 to 49.998 s",
        ),
        (
            lambda log: log.clip(5.0).bode("tau", "q", 1.0, 2.0),
            "'/log/tau' has no sample from 1 to 2 s, it has samples from 5 to 49.998 s; buffers keep the newest: a "
            "recording (`silo record`), or a larger size, keeps what was before",
        ),
        (lambda log: log.bode("tau", "nothing"), "the log has no signal 'nothing'; it has 2 elements, see list(log)"),
    ],
)  # fmt: skip
def test_what_can_not_be_told_is_said(ask, words):
    with pytest.raises(ElementError) as caught:
        ask(silo.Log(logged(CHIRP, FirstOrder)))
    assert str(caught.value) == words


def chirp_then_step():
    one, other = logged(CHIRP, FirstOrder), logged(WAVES["step"], FirstOrder)
    count = len(one.time_ns)
    later = [msgspec.structs.replace(event, tick=event.tick + count, number=9) for event in other.events]
    columns = [
        np.concatenate([a.entries[0].values, b.entries[0].values])
        for a, b in zip(one.elements, other.elements, strict=True)
    ]
    elements = [
        replace(element, entries=(replace(element.entries[0], values=column),))
        for element, column in zip(one.elements, columns, strict=True)
    ]
    both = count + len(other.time_ns)
    times = np.arange(both, dtype=np.int64) * (1_000_000_000 // HZ)
    return silo.Log(replace(one, time_ns=times, offset=both, elements=elements, events=(*one.events, *later)))


def test_a_transfer_function_is_of_the_last_excitation_that_has_a_band_and_that_is_said():
    log = chirp_then_step()
    with pytest.warns(
        silo.LogWarning, match="of 2 excitations of '/log/tau' this is of the last that has a band"
    ) as told:
        found = log.bode("tau", "q")
    assert "chirp 0.2 to 20 Hz, amplitude 2, for 30 s, ramps of 1 s, from 10 to 40 s" in str(told[0].message)
    assert found.frequency_hz[-1] > 15
    with pytest.warns(silo.LogWarning, match="of the last step: step, amplitude 2, for 5 s, from 60 to 65 s"):
        assert log.step("tau", "q").at_s == pytest.approx(60, abs=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log.bode("tau", "q", 10.0, 40.0)


def test_a_transfer_function_of_a_step_alone_is_refused_with_the_way_out():
    log = silo.Log(logged(WAVES["step"], FirstOrder))
    with pytest.raises(ElementError, match=r"by a step alone \(step, amplitude 2.* no band of frequencies: log.step"):
        log.bode("tau", "q")


def test_the_log_tells_what_was_excited_and_when():
    (found,) = silo.Log(logged(CHIRP, FirstOrder)).parameters.excitations
    assert (found.what, found.ended) == (CHIRP, "it is over")
    assert (found.start_s, found.stop_s) == (REST_S, REST_S + DURATION_S)


def test_the_shell_draws_both_and_gives_numbers_to_machines(tmp_path, capsys):
    for name, what in (("chirp", CHIRP), ("step", WAVES["step"])):
        silo.Log(logged(what, Resonant)).save(tmp_path / f"{name}.silo")
    chirp, step = str(tmp_path / "chirp.silo"), str(tmp_path / "step.silo")
    assert run(["bode", chirp, "tau", "q", "--width", "80", "--height", "30"]) == 0
    shown = capsys.readouterr().out
    assert all(words in shown for words in ("magnitude [dB]", "phase [deg]", "coherence", "frequency [Hz]"))
    assert max(map(len, shown.splitlines())) <= 80
    assert shown.endswith("\nof chirp 0.2 to 20 Hz, amplitude 2, for 30 s, ramps of 1 s, from 10 to 40 s\n")
    assert run(["bode", chirp, "tau", "q", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"frequency_hz", "magnitude_db", "phase_deg", "coherence", "excitation"}
    assert found["excitation"] == "chirp 0.2 to 20 Hz, amplitude 2, for 30 s, ramps of 1 s, from 10 to 40 s"
    assert max(found["magnitude_db"]) == pytest.approx(14.0, abs=0.3)
    assert run(["step", step, "tau", "q", "--width", "80", "--height", "20"]) == 0
    shown = capsys.readouterr().out
    assert "overshoot 72.9%" in shown
    assert "of step, amplitude 2, for 5 s, from 10 to 15 s" in shown
    assert run(["bode", chirp, "tau", "nothing"]) == 1
    assert run(["bode", chirp, "tau", "q", "--png", str(tmp_path / "bode.png")]) == 0
    assert (tmp_path / "bode.png").read_bytes().startswith(b"\x89PNG")
