"""How one signal answers to another, on the screen: after an excitation, by its command, of a file."""

import numpy as np
import pytest
from msgspec.structs import replace
from textual.widgets import Input

import silo
from silo.analysis.parameters import ToldExcitation
from silo.analysis.responses import bode_between
from silo.core.tuning.parameters import ParameterInfo, ParameterKind
from silo.errors import ElementError
from silo.files.silo.writer import write_silo
from silo.history.arrays import SampleArrays
from silo.parameters.requests import ExcitationState
from silo_tui.model.lists.responses import HeldResponse, HeldSamples, Response, last_told, named_signal, rate_words
from tests.files.test_responses import CHIRP, HZ, WAVES, FirstOrder, logged
from tests.stand_ins.fake_signals import scalar, vector

TABLE = [scalar("/log/tau", "Nm"), scalar("/log/q", "rad"), vector("/log/imu/acc", "m/s^2"), scalar("/log/imu/q")]


def held(recording, begin=0, step=1):
    """Both signals from a tick on, as a logger's buffers hold them."""
    ticks = np.arange(begin, len(recording.time_ns), step)
    return [
        HeldSamples(ticks, recording.time_ns[ticks], one.entries[0].values[ticks], step) for one in recording.elements
    ]


def asked(told, answer="/log/q"):
    return Response(named_signal(TABLE, "/log", "tau"), named_signal(TABLE, "/log", answer), told, 0)


def test_what_the_buffers_hold_gives_the_curve_that_the_file_gives():
    recording = logged(CHIRP, FirstOrder)
    told = last_told(recording.events, named_signal(TABLE, "/log", "tau"))
    assert (told.what, told.tick, told.ended) == (CHIRP, 10 * HZ, "it is over")
    log = HeldResponse(asked(told), *held(recording))
    found, known = bode_between(log, "/log/tau", "/log/q", None, None, None), silo.Log(recording).bode("tau", "q")
    assert all(np.allclose(one, other) for one, other in zip(found, known, strict=True))
    assert not log.missing
    assert last_told(recording.events, named_signal(TABLE, "/log", "imu/q")) is None


def test_what_is_read_reaches_over_both_ends_of_the_excitation():
    assert asked(ToldExcitation(CHIRP, 1000, 3000)).ticks == (499, 3501)
    assert asked(ToldExcitation(CHIRP, 1000)).ticks[1] > 10**12
    assert asked(None).ticks[0] < -(10**12)


def test_what_is_overwritten_or_logged_slowly_is_told():
    recording, told = logged(CHIRP, FirstOrder), ToldExcitation(CHIRP, 10 * HZ, 40 * HZ)
    log = HeldResponse(asked(told), *held(recording, 16 * HZ))
    assert log.missing == "the first 20% of it is overwritten"
    assert log.excitations[0].stop_s - log.excitations[0].start_s == pytest.approx(24.0)
    with pytest.raises(ElementError, match="hold nothing of the excitation"):
        HeldResponse(asked(told), *held(recording, 40 * HZ))
    with pytest.raises(ElementError, match="hold nothing of the excitation"):
        HeldResponse(asked(told), *held(recording, len(recording.time_ns)))
    none = HeldSamples(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), 1, "it is not logged")
    with pytest.raises(ElementError, match="no sample of /log/q is held: it is not logged"):
        HeldResponse(asked(told), held(recording)[0], none)
    slow = HeldResponse(asked(told), *held(recording, step=50))
    assert "10 times a second only: set its divider to 1" in rate_words(slow["/log/tau"], HZ)
    assert not rate_words(log["/log/tau"], HZ)


def test_a_signal_is_named_as_everywhere():
    assert named_signal(TABLE, "/log", "imu/acc_y").name == "/log/imu/acc_y"
    assert named_signal(TABLE, "/log", "imu/acc").components == ("x", "y", "z")
    with pytest.raises(ElementError, match="no signal 'tua'"):
        named_signal(TABLE, "/log", "tua")


@pytest.fixture
def excited(fake, monkeypatch):
    """A logger whose input was excited, and what it holds then."""
    recording = logged(CHIRP, FirstOrder)
    samples = dict(zip(("/log/tau", "/log/q"), held(recording), strict=True))

    def read(name):
        one = samples[name]
        return SampleArrays(one.ticks, one.time_ns, one.values, one.divider, why=one.why)

    def excite(name, wave, *, wait, **more):
        assert not wait(ExcitationState("a", 3.0, 10 * HZ), 0.0)
        return ExcitationState("a", 30.0, 10 * HZ, "it is over", 40 * HZ)

    fake.elements = TABLE
    fake.parameter_infos = [ParameterInfo("/log/tau", ParameterKind.FLOAT, 0.0, (), -5.0, 5.0, value=0.0, input=True)]
    monkeypatch.setattr(fake, "_held_samples", read)
    monkeypatch.setattr(fake, "excite", excite)
    return fake


async def test_what_is_excited_is_named_as_the_table_does(excited, screen):
    await screen.enter(":excite /log/tau chirp 0.2-20Hz amplitude 2 for 30s", shows="Excite /tau?")


async def test_after_an_excitation_the_answer_of_a_signal_is_drawn(excited, screen):
    await screen.press("colon")
    await screen.type_or_paste("excite tau chirp 0.2-20Hz amplitude 2 for 30s")
    await screen.press("enter", shows="Excite tau?")
    await screen.press("down", "enter", shows="it is over, rows 5000 to 20000")
    line = screen.app.screen.query_one(Input)
    line.value = "nothing"
    await screen.press("enter", shows="no signal 'nothing'")
    line.value = "/log/q"
    await screen.press("enter", shows="coherence 1.00")
    await screen.shows("frequency [Hz]")
    assert "BODE  " in screen.text
    assert "chirp 0.2 to 20 Hz, amplitude 2, for 30 s" in screen.text
    await screen.do("response_mode", shows="rise time")
    assert "STEP  " in screen.text
    await screen.do("response_mode", "response_again", shows="coherence 1.00")
    await screen.press("escape")
    await screen.until(lambda: screen.app.context.upper_screen.scope == "table")


async def test_the_command_shows_it_later_and_says_what_is_wrong(excited, screen):
    for line, words in (
        ("bode", ":bode IN OUT"),
        ("bode tau q x", "two numbers, seconds"),
        ("bode tau nothing", "no signal 'nothing'"),
    ):
        await screen.press("colon")
        await screen.type_or_paste(line)
        await screen.press("enter", shows=words)
        await screen.press("escape")
    await screen.press("colon")
    await screen.type_or_paste("bode tau /log/q")
    await screen.press("enter", shows="coherence")  # nothing tells of an excitation: of all that is held
    screen.session.status = replace(screen.session.status, started_ns=1)
    await screen.do("response_again", shows="the logger was started anew since")


async def test_of_a_file_it_is_what_the_file_tells(tmp_path, on_file):
    path = tmp_path / "bot.silo"
    write_silo(logged(CHIRP, FirstOrder), path)
    async with on_file(path) as screen:
        await screen.press("colon")
        await screen.type_or_paste("bode tau q")
        await screen.press("enter", shows="coherence 1.00")
        assert "chirp 0.2 to 20 Hz" in screen.text
        await screen.press("colon")
        await screen.type_or_paste("bode tau q 20 20.01")
        await screen.press("enter", shows="FROM TO looks at a part of it alone")
        assert "20 to 20.01 s" in screen.text  # not the excitation
        assert "chirp" not in screen.text
        await screen.press("escape", "escape")
        await screen.until(lambda: screen.app.context.upper_screen.scope == "file")


async def test_a_step_is_shown_as_one(excited, opened, monkeypatch):
    what = WAVES["step"]
    recording = logged(what, FirstOrder)
    samples = dict(zip(("/log/tau", "/log/q"), held(recording), strict=True))
    monkeypatch.setattr(
        excited, "_held_samples",
        lambda name: SampleArrays(samples[name].ticks, samples[name].time_ns, samples[name].values),
    )  # fmt: skip
    monkeypatch.setattr(
        excited, "excite", lambda *given, **more: ExcitationState("a", 5.0, 10 * HZ, "it is over", 15 * HZ)
    )
    async with opened(excited) as screen:
        await screen.press("colon")
        await screen.type_or_paste("excite tau step amplitude 2 for 5s")
        await screen.press("enter", shows="Excite tau?")
        await screen.press("down", "enter", shows="it is over, rows")
        screen.app.screen.query_one(Input).value = "/log/q"
        await screen.press("enter", shows="rise time 0.2197 s")
