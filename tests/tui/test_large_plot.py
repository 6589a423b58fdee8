"""The large plot is the monitor with one plot: the same keys, the same pause, the same window."""

import asyncio
import re
from types import SimpleNamespace

import numpy as np
import pytest

from silo.analysis.compute.spectra import Peak
from silo.core.elements import BufferType
from silo_tui.actions import commands_for
from silo_tui.model.plots.picture import AXIS
from silo_tui.screens.plots.detail import _hz_words
from tests.stand_ins.fake_signals import START_NS, scalar, vector

pytestmark = pytest.mark.slow  # each walks through the whole app

TORQUE = "/log/legs/LF/HAA/torque"
SHARED = (
    "pause", "closer", "wider", "cursor_left", "cursor_right", "cursor_far_left", "cursor_b", "next_sample", "find",
    "previous_sample", "next_found", "previous_found", "next_event", "previous_event", "earlier", "later", "oldest",
    "newest", "all_held", "scale", "export_plots", "events", "set_marker",
)  # fmt: skip


async def open_large(screen, words="/LF/HAA/torque"):
    await screen.enter(words, "m")
    await screen.curves()
    below = screen.app.screen
    await screen.press("enter")
    await screen.until(lambda: screen.app.screen is not below and not screen.app.screen.stack.store.empty, "large plot")
    return below


def large(screen):
    return screen.app.screen


def test_the_large_plot_has_the_keys_of_the_monitor():
    keys = {command.id: command.keys for command in commands_for("monitor")}
    large_keys = {command.id: command.keys for command in commands_for("detail")}
    assert {each: keys[each] for each in SHARED} == {each: large_keys.get(each) for each in SHARED}


async def test_it_lives_on_a_click_puts_the_cursor_there_and_where_a_moment_is_found_the_monitor_stands_too(
    fake, screen, ran_s=19
):
    below = await open_large(screen)
    await screen.shows("RUNNING")
    assert screen.text.count("legs/LF/HAA/torque") == 1, "over the curve, and not once more above that"
    fake.advance(2.0)
    store = lambda: large(screen).stack.store  # noqa: E731
    await screen.until(lambda: store().end * store().column_ns >= fake.now_ns, "what came since")
    await screen.pilot.click("PlotStack", offset=(40, 6))
    await screen.shows("at cursor")
    await screen.press("f", "h", "enter")
    await screen.shows("of 3: 40")
    at_ns = large(screen).window.at_ns
    assert (at_ns - START_NS) % (4 * 10**9) == 0
    assert large(screen).window.cursor is not None
    await screen.press("escape", "escape")
    await screen.until(lambda: screen.app.screen is below, "the monitor")
    await screen.shows("PAUSED")
    await screen.press("space")
    await screen.until(lambda: not fake.pins, "the pin is let go of")


async def test_until_the_first_values_are_there_plots_say_that_they_are_loading(screen, monkeypatch, ran_s=12):
    source, come = screen.session.source, asyncio.Event()
    at_once = source.history

    async def history(*asked):
        await come.wait()
        return await at_once(*asked)

    monkeypatch.setattr(source, "history", history)
    for key in ("m", "enter"):
        await screen.press(key, shows="loading …")
    come.set()
    await screen.shows("│ live │")
    await screen.until(lambda: "loading" not in screen.text, "values")


async def test_it_begins_where_the_monitor_stands(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.GROWING)])
    async with opened(fake.run(61)) as screen:
        await screen.plot("m")
        await screen.press("f", "h", "enter")
        await screen.shows("of 16: 40")
        for count in range(15, 10, -1):
            await screen.press("left_square_bracket", shows=f"{count} of 16: 40")
        await screen.press("enter", shows="TIME")
        await screen.until(lambda: large(screen).window.cursor is not None, "the cursor in its picture")
        assert large(screen).window.at_ns == START_NS + 40 * 10**9
        await screen.shows("… 40.00)")


async def test_a_pause_in_it_holds_all_plots_of_the_monitor(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm"), scalar("/log/legs/LF/HFE/torque", "Nm")])
    async with opened(fake.run(20)) as screen:
        await screen.plot("asterisk", "m")
        await screen.press("enter", "space", shows="held, all fetched")
        assert set(large(screen).pause.source.names) == {TORQUE, "/log/legs/LF/HFE/torque"}


async def test_cursor_b_samples_home_end_and_all_work_in_it(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.GROWING)])
    async with opened(fake.run(30), size=(100, 30)) as screen:
        await open_large(screen)
        await screen.press("space", shows="30 s held, ")
        await screen.press("left", "B", "comma", "comma")
        await screen.until(lambda: large(screen).window.other_ns is not None, "cursor B")
        await screen.shows("slope/s")
        window = large(screen).window
        await screen.until(lambda: 0 < window.other_ns - window.at_ns <= 2 * 2_500_000, "two samples before B")
        await screen.press("home")
        await screen.until(lambda: window.at_ns == START_NS, "the oldest that is held")
        await screen.press("0")
        await screen.until(lambda: window.span_s == 30.0, "all that is held")
        await screen.press("end")
        await screen.until(lambda: window.at_ns == large(screen).held_ns[1], "the newest")


async def test_n_and_z_go_through_the_entries_of_a_vector_in_plots(new_fake, opened):
    fake = new_fake([vector("/log/base/position", "m")])
    async with opened(fake.run(20)) as screen:
        await screen.plot("m")
        names = lambda: [each.name[-1] for each in screen.app.screen.stack.plots]  # noqa: E731
        assert names() == ["x", "y", "z"]
        await screen.press("j", "z")
        assert names() == ["y"]
        await screen.press("n")
        assert names() == ["z"]
        await screen.press("z")
        assert names() == ["x", "y", "z"]
        await screen.until(
            lambda: np.isfinite(screen.app.screen.stack.store.low).any(axis=1).sum() == 3, "columns of all three"
        )


def dots(screen):
    return sum("\u2800" < char <= "\u28ff" for char in screen.text)


async def test_held_beyond_what_there_is_the_large_plot_shows_what_the_small_one_shows(screen, ran_s=60.0):
    await screen.press("m")
    await screen.until(lambda: dots(screen) > 20)
    for more in (0, 1, 1, 2):  # twice as long, four times, sixteen times
        await screen.press(*["-"] * more)
        await screen.until(lambda: dots(screen) > 10)
        await screen.press("space", shows="all fetched")
        await screen.until(lambda: dots(screen) > 10)
        await screen.press("enter", at="detail")
        await screen.until(lambda: dots(screen) > 10, "curves in the large plot")
        await screen.press("escape", at="monitor")
        await screen.press("space", shows="live")


@pytest.mark.parametrize(
    ("frequency_hz", "step_hz", "words"),
    [(0.8, 0.5, "0.8 ±0.25"), (1.99, 0.5, "2.0 ±0.25"), (2.0, 0.5, "2.0"), (81.234, 0.5, "81.2"), (3.0, 1.0, "3 ±0.5")],
)
def test_a_peak_of_few_periods_says_how_far_off_it_may_be(frequency_hz, step_hz, words):
    assert _hz_words(Peak(frequency_hz, 1.0), step_hz) == words


async def test_the_head_of_a_spectrum_has_units_whole_and_its_cursor_is_the_only_one_that_is_told(new_fake, opened):
    names = [f"/log/legs/LF/KFE/{end}" for end in ("position_of_the_joint", "position_of_the_joint_command")]
    async with opened(new_fake([scalar(name, "rad") for name in names]).run(20)) as screen:
        await screen.press("asterisk", "m", "left", "J", "enter", "tab", "tab")
        await screen.until(lambda: large(screen)._found.peaks)
        await screen.until(lambda: "Hann" in screen.text.splitlines()[1])
        title = screen.text.splitlines()[1]
        assert title.count(" [rad] ") == 2
        assert re.search(r"SPECTRUM linear  Hann [\d ]+ samples  ", title)
        assert " A " not in screen.text.splitlines()[-2]


async def test_views_of_one_signal_of_a_vector_say_which_and_name_the_key_of_the_next_and_x_y_which_is_which(
    new_fake, opened
):
    elements = [vector("/log/a", "m/s^2", "xyz"), scalar("/log/w", "rad/s")]
    async with opened(new_fake(elements).run(20), size=(80, 24)) as screen:
        await screen.press("asterisk", "m")
        await screen.press("enter", "tab", "tab", shows="/a_x [m/s^2]  SPECTRUM")
        await screen.shows("j Next of 4")
        await screen.press("j", shows="/a_y [m/s^2]  SPECTRUM")
        await screen.press("j", "tab", "tab", "tab", shows="x /a_z [m/s^2]  y /w [rad/s]  X-Y")
        await screen.press("tab", "tab", "tab")
        await screen.until(lambda: "Next of 4" not in screen.text)


async def test_a_spectrum_of_a_short_time_says_that_more_seconds_make_it_finer(screen, ran_s=20):
    await open_large(screen)
    await screen.press(*["plus"] * 4, "tab", "tab", shows="Hz, finer of more seconds: Tab, -")


TOLD = {
    "xy": [
        "x  /a [rad]", "y  /b [rad/s] over x", "r = -0.264  slope -0.319 1/s", "loop area 12.2 rad^2/s",
        "newest ●  older • ∙ ·   1 200 samples in 2.998 s",
    ],
    "spectrum": [
        "a peak 1  0.9 ±0.17 Hz  4 rad", "2  9.7 Hz  0.2 rad", "resolution 0.333 Hz, finer of more seconds: Tab, -",
        "3 s of 400 Hz, jitter 0 us", "unit rad",
    ],
    "histogram": [
        "1 200 samples", "mean -0.011", "std 2.908", "min -4.198", "1 % -4.164", "median -0.014", "99 % 4.162",
        "max 4.199",
    ],
}  # fmt: skip


async def test_each_way_of_drawing_fills_the_plot_and_says_what_it_is_of(new_fake, opened):
    async with opened(new_fake([scalar("/log/a", "rad"), scalar("/log/b", "rad/s")]).run(3), size=(120, 40)) as screen:
        await screen.press("asterisk", "m", "minus", "minus", "J", "enter", "tab")
        await screen.until(lambda: large(screen).window.span_s > 10)
        for mode, notes in TOLD.items():
            await screen.until(lambda: large(screen)._found.notes == notes, mode)  # noqa: B023
            plot = large(screen).plot
            assert (max(map(len, plot.plot.lines)), len(plot.plot.lines)) == plot.plot_size
            await screen.press("tab")


async def test_where_there_is_too_little_for_a_way_of_drawing_that_is_said(new_fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.screens.plots.detail.pair_of", lambda *_: SimpleNamespace(x=[1.0]))
    monkeypatch.setattr("silo_tui.screens.plots.detail.as_floats", lambda values: np.full(7, np.nan))
    async with opened(new_fake([scalar("/log/a", "rad"), scalar("/log/b", "rad/s")]).run(3), size=(120, 40)) as screen:
        await screen.press("asterisk", "m", "J", "enter", "tab")
        await screen.shows("1 held, 2 needed of both at the same time")
        await screen.press("tab", "tab", shows="7 held, none is a finite number")


async def test_in_an_x_y_plot_signals_are_told_by_their_axis_and_no_letter_says_another_thing(new_fake, opened):
    names = [f"/log/{name}" for name in ("position", "velocity")]
    async with opened(new_fake([scalar(name, "rad") for name in names]).run(3), size=(120, 40)) as screen:
        await screen.press("asterisk", "m")
        await screen.curves()
        await screen.press("j")  # that of the cursor is x
        await screen.press("enter", "tab", shows="x  /velocity")
        await screen.shows("x /velocity [rad]  y /position [rad]  X-Y")
        assert "y  /position" in screen.text


async def test_what_the_cursor_reads_has_room_on_a_small_screen(screen, ran_s=20):
    await open_large(screen)
    await screen.press("tab", "tab")
    await screen.until(lambda: large(screen)._found.peaks)
    await screen.press("right")
    await screen.until(lambda: re.search(r"^ *A \d", screen.text, re.MULTILINE), "its reading")
    await screen.press("plus")
    await screen.until(lambda: "No cursor" in screen.text.splitlines()[-1], "how it goes, where it stays")


async def test_in_a_spectrum_find_goes_by_height_the_cursor_reads_peaks_and_zoom_is_by_frequencies(screen, ran_s=20):
    await open_large(screen)
    await screen.press("tab", "tab")
    await screen.until(lambda: large(screen)._found.peaks)
    await screen.press("f", shows="Find in the spectrum")
    await screen.press("h", shows="peak 1: ")
    assert not large(screen).window.paused or large(screen).mode == "spectrum"
    assert "highest" not in screen.text.splitlines()[-2]
    told = re.search(r"peak 1: (\S+ Hz, \S+)", screen.text)[1]
    await screen.press("right")
    await screen.until(lambda: f"A {told}" not in screen.text.splitlines()[-2])
    await screen.press("left", shows=f"A {told}")
    assert screen.text.count(f"A {told}") == 1, "it is told in one place"
    await screen.press("escape")
    await screen.until(lambda: " A " not in screen.text, "no cursor")
    await screen.press("right", "escape", "left")
    await screen.shows(f"A {told}")  # the first step leads to the highest peak
    await screen.press("escape")
    whole_hz, step_hz = large(screen)._found.top_hz, large(screen)._found.spectrum.step_hz
    assert whole_hz == pytest.approx(200, rel=0.01)
    span_s, peak = large(screen).window.span_s, large(screen)._found.peaks[0]
    for halved in range(1, 8):
        await screen.press("plus")
        await screen.until(lambda: large(screen)._found.top_hz == whole_hz / 2**halved)  # noqa: B023
        assert large(screen)._found.peaks[0] == peak
    assert large(screen)._found.spectrum.step_hz == step_hz
    assert large(screen).window.span_s == span_s
    await screen.press("right", shows=f"A {peak.frequency_hz:.1f} Hz")
    await screen.press("plus", shows="Hz apart: a longer time has finer ones")
    await screen.press("minus")
    await screen.until(lambda: large(screen)._found.top_hz == whole_hz / 2**6)
    await screen.shows(f"A {peak.frequency_hz:.1f} Hz")  # the cursor stays on its frequency
    for mode in ("time", "spectrum"):  # where one goes for finer lines
        large(screen).action_command(f"mode_{mode}")
        await screen.until(lambda: large(screen).mode == mode)  # noqa: B023
    await screen.until(lambda: large(screen)._found.top_hz == whole_hz / 2**6, "the frequencies as before")
    await screen.do("all_held")
    await screen.until(lambda: large(screen)._found.top_hz == whole_hz)
    await screen.press("minus", shows="that is the whole spectrum")
    await screen.pilot.click("DetailPlot", offset=(AXIS + 1 + 20, 3))
    await screen.until(lambda: large(screen).plot.cursor == 20)


async def test_each_way_of_drawing_is_there_at_once_from_the_plots_also_from_a_pause(screen, ran_s=20):
    await screen.enter("/LF/HAA/torque", "m")
    await screen.curves()
    plots = screen.app.screen
    told = [("mode_spectrum", "resolution"), ("mode_histogram", "median")]
    for command, shown in (*told, ("pause", "all fetched"), *told):
        screen.app.screen.action_command(command)
        await screen.shows(shown)
        if screen.app.screen is not plots:
            await screen.press("escape")
            await screen.until(lambda: screen.app.screen is plots, "the plots")
    plots.action_command("mode_xy")  # which asks for another
    await screen.shows("xy ")
    await screen.enter("LF/HAA/position", shows="loop area")
    await screen.shows("x /legs/LF/HAA/torque [Nm]  y /legs/LF/HAA/position")


async def test_a_spectrum_without_a_peak_tells_its_highest_line_and_how_others_are_read(screen, monkeypatch, ran_s=20):
    monkeypatch.setattr("silo_tui.screens.plots.detail.peaks_of", lambda *_: [])
    await open_large(screen)
    screen.app.screen.action_command("mode_spectrum")
    await screen.shows("no peak stands out")
    line = int(large(screen)._found.spectrum.amplitudes.argmax()) + 1
    await screen.shows(f"highest {line * large(screen)._found.spectrum.step_hz:.1f} ")
    await screen.do("next_found", shows="no peak stands out; ←→ read any frequency")


@pytest.mark.parametrize("mode", ["mode_spectrum", "mode_histogram"])
async def test_what_is_computed_goes_on_with_the_robot_until_it_is_held(fake, opened, monkeypatch, mode):
    monkeypatch.setattr("silo_tui.screens.plots.detail.LIVE_S", 0.05)
    async with opened(fake.run(20)) as screen:
        await open_large(screen)
        screen.app.screen.action_command(mode)
        drawn, frames = [], []
        show, take = large(screen).plot.show, large(screen).live_changed
        monkeypatch.setattr(large(screen).plot, "show", lambda *found: (drawn.append(found), show(*found)))
        monkeypatch.setattr(large(screen), "live_changed", lambda frame: (frames.append(frame), take(frame)))
        for count in range(2, 6):
            await screen.until(lambda: fake.advance(0.1) or len(drawn) >= count)  # noqa: B023
        if mode == "mode_spectrum":  # the cursor stands, wherever the strongest line of its cell is by now
            large(screen)._put_cursor(20)
            read, count = large(screen)._read_at_cursor(), len(drawn)
            monkeypatch.setattr("silo_tui.model.drawing.big_plot.line_in", lambda *_: Peak(1.0, 1.0))
            await screen.until(lambda: fake.advance(0.1) or len(drawn) >= count + 3)
            assert large(screen)._read_at_cursor().frequency_hz == read.frequency_hz
        await screen.press("space", shows="all fetched")
        large(screen)._due_s = 0.0
        take(frames[-1])
        assert large(screen)._due_s == 0.0  # nothing was begun for it


async def test_a_cursor_is_offered_only_where_one_is_and_the_key_that_led_here_says_that_this_is_it(screen, ran_s=20):
    await open_large(screen)
    await screen.shows("←→ PgUp Earlier")
    await screen.press("enter", shows="this is the large plot already: Esc leaves it")
    for keys in (["tab"], ["tab", "tab"]):  # one over the other, a histogram
        await screen.press(*keys)
        await screen.until(lambda: "←→" not in screen.text.splitlines()[-1])
        await screen.press("left", shows="the cursor is over time and in spectra: Tab leads there")


async def test_a_view_that_was_chosen_in_a_large_plot_is_left_by_one_esc_and_the_plot_by_the_next(screen, ran_s=20):
    below = await open_large(screen)
    large(screen).action_command("mode_spectrum")
    await screen.shows("Esc No spectrum")
    await screen.press("escape")
    await screen.until(lambda: large(screen).mode == "time", "the signals over time")
    await screen.press("tab", "tab", "tab")
    assert large(screen).mode == "histogram"
    await screen.press("escape")
    assert (large(screen).scope, large(screen).mode) == ("detail", "time")
    await screen.press("escape")
    assert large(screen) is below


async def test_a_large_plot_that_was_opened_as_a_spectrum_is_left_by_one_esc(screen, ran_s=20):
    await screen.enter("/LF/HAA/torque", "m")
    await screen.curves()
    below = screen.app.screen
    below.action_command("mode_spectrum")
    await screen.until(lambda: large(screen).scope == "detail", "the spectrum")
    await screen.press("tab", "escape")
    assert large(screen).mode == "spectrum"
    await screen.press("escape")
    assert large(screen) is below


async def test_how_many_signals_a_pattern_added_is_said_and_one_turns_through_all_of_them(
    screen, ran_s=20, size=(160, 30)
):
    below = await open_large(screen)
    await screen.press("m")
    await screen.enter("HFE/*")
    await screen.until(lambda: len(below.stack.plots) > 2, "all that fit it")
    added = len(below.stack.plots) - 1
    assert added > 8
    await screen.shows(f"added {added} plots: /legs/LF/HFE/")
    assert f" and {added - 3} more: " in screen.text
    assert large(screen).plots == below.stack.plots
    screen.app.screen.action_command("mode_histogram")
    await screen.shows(f"Next of {added + 1} ")


@pytest.mark.parametrize("mode", ["mode_time", "mode_spectrum"])
async def test_a_signal_that_is_added_in_it_is_plotted_in_the_monitor_and_comes_next(fake, opened, mode):
    position = TORQUE.replace("torque", "position")
    async with opened(fake.run(20), size=(120, 30)) as screen:
        below = await open_large(screen)
        await screen.press("tab", shows="it needs two plots: m plots another")
        screen.app.screen.action_command(mode)
        await screen.press("m")
        await screen.enter("LF/HAA/position")
        await screen.shows("added /legs/LF/HAA/position: j shows it, Esc leads to the plots")
        assert large(screen).subject == "/legs/LF/HAA/torque"
        assert [each.name for each in below.stack.plots] == [TORQUE, position]
        await screen.enter(":plot LF/HAA/position", shows="that is plotted already")
        await screen.press("j")
        await screen.until(lambda: large(screen).subject == "/legs/LF/HAA/position", "the other one")
        await screen.press("k")
        screen.app.screen.action_command("mode_xy")
        await screen.shows("loop area")
        await screen.press("escape", "escape")
        await screen.until(lambda: large(screen) is below, "the plots")
        await screen.until(lambda: set(below.stack.store.names) == {TORQUE, position}, "curves of both")


@pytest.mark.parametrize("is_large", [False, True])
async def test_what_is_held_goes_on_with_another_plot(screen, is_large, ran_s=20, size=(120, 30)):
    await open_large(screen)
    if not is_large:
        await screen.press("escape")
    await screen.press("space", shows="held, all fetched")
    await screen.press("m")
    await screen.enter("LF/HAA/position")
    await screen.until(lambda: not screen.app.screen.window.paused, "it goes on")
    await screen.until(lambda: "position" in screen.text)
