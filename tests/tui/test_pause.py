"""Holding the picture: what is pinned stays, whatever becomes of buffers, link and robot."""

import re
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from textual.widgets import Input

from silo.conditions.requests import TriggerTried
from silo.core.elements import BufferType
from silo.history.requests import PinOpened
from silo_tui.actions import key_of
from silo_tui.screens.dialogs.questions import Prompt
from silo_tui.screens.lists.events import EventsScreen
from silo_tui.screens.plots.plot_screen import PlotScreen
from tests.stand_ins.fake_signals import HZ, START_NS, scalar, signal

pytestmark = pytest.mark.slow  # each walks through the whole app

TORQUE = "/log/legs/LF/HAA/torque"
OTHER = "/log/legs/LH/HAA/torque"
OFF = {"fires": 0, "ticks": [], "time_ns": [], "begin_ns": 0, "end_ns": 0}


def monitor(screen):
    return screen.app.screen


async def open_torque(screen):
    await screen.enter("/LF/HAA/torque", "m")
    await screen.curves()


async def hold(screen):
    await screen.press("space", shows="held, all fetched")
    return monitor(screen).pause.source


def store_of(screen):
    return monitor(screen).stack.store


def filled(screen, share=0.95):
    low = store_of(screen).low
    return low.size and np.isfinite(low).mean() > share


def logged(time_ns):
    """What the fake logs of the torque at these times."""
    return signal(TORQUE, np.round((time_ns - START_NS) / 1e9 * HZ) / HZ)


@pytest.fixture(autouse=True)
def shallow(monkeypatch):
    """No room for more than the picture and as much before it: there is something that no pin has."""
    monkeypatch.setattr("silo_tui.sessions.held.PINNED_BYTES", 0)


@pytest.fixture
def deep(new_fake):
    """A logger whose buffers hold all that it logged."""
    return new_fake([scalar(TORQUE, "Nm", buffer=BufferType.GROWING)])


async def test_space_pins_the_picture_and_as_much_before_it_and_the_axis_counts_from_where_the_cursor_does(
    deep, opened
):
    fake = deep
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        held = await hold(screen)
        await screen.shows(" ago, 20 s held")
        assert len(fake.pins) == 1
        assert 1.9 * monitor(screen).window.span_s < held.held_s <= 2 * monitor(screen).window.span_s
        assert held.fetched_s == held.held_s
        await screen.press("home")
        await screen.until(lambda: "A -59." in screen.text or "A -60." in screen.text, "the oldest moment")
        axis = next(line for line in screen.text.splitlines() if line.rstrip().endswith(" s") and "│" not in line)
        assert monitor(screen).window.span_s == 10.0
        assert [int(word) for word in axis.replace(" s", "").split()][:5] == [-60, -58, -56, -54, -52]


async def test_what_is_pinned_stays_when_the_buffers_overwrite_it(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=8000)])
    async with opened(fake.run(60)) as screen:
        await screen.press("m")
        await screen.until(lambda: not store_of(screen).empty, "history in the plot")
        held = await hold(screen)
        fake.advance(500)
        assert len(fake.samples([TORQUE], 0, held.end_ns)[TORQUE]) == 0
        before = monitor(screen).window.paused_end_ns
        await screen.press("pageup")
        await screen.until(lambda: store_of(screen).end * store_of(screen).column_ns <= before, "an earlier window")
        await screen.until(lambda: filled(screen), "all of the earlier window")
        time_ns, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
        np.testing.assert_array_equal(values, logged(time_ns))


async def test_a_condition_is_judged_by_what_is_pinned_when_the_buffers_have_overwritten_it(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=8000), scalar(OTHER, "Nm", size=8000)])
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        held = await hold(screen)
        fake.advance(500)
        time_ns, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
        rises = np.flatnonzero((values[1:] > 1) & (values[:-1] <= 1)) + 1
        assert len(rises) > 1
        await screen.do("find")
        await screen.type("legs/LF/HAA/torque > 1")
        await screen.shows(f"turned true {len(rises)} × in the 19.9 s that are held")
        await screen.press("enter", shows=f"torque > 1, {len(rises)} of {len(rises)}: turns true")
        await screen.until(lambda: monitor(screen).now_ns == time_ns[rises[-1]], "the newest of them")
        await screen.do("find")
        await screen.type("LH/HAA/torque > 1")  # which is not plotted
        await screen.shows("the logger, which judges it, has overwritten what is held here")


@pytest.mark.parametrize("why", ["", "/log/legs/LF/HAA/torque is off"])
async def test_a_condition_is_judged_by_what_is_pinned_where_the_logger_can_tell_it_of_a_part_alone(
    new_fake, opened, monkeypatch, why
):
    """As of two signals, of which one has a shorter buffer; or of one that was switched off since."""
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=8000)])
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        held = await hold(screen)
        early_ns = held.begin_ns - 10**9
        tried = TriggerTried(2, [1, 2], [early_ns, fake.now_ns + 10**9], 0, 6000, early_ns, fake.now_ns, 6000, 5000)
        tried = msgspec.structs.replace(tried, why=why, **OFF if why else {})
        monkeypatch.setattr(fake, "try_trigger", lambda _: tried)
        time_ns, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
        rises = np.flatnonzero((values[1:] > 1) & (values[:-1] <= 1)) + 1
        found = await monitor(screen).pause.turns_true("legs/LF/HAA/torque > 1")
        assert found.time_ns == [early_ns] * (not why) + time_ns[rises].tolist()
        assert (found.fires, found.why) == (len(found.time_ns), "")


async def test_a_window_that_is_wider_later_shows_what_the_buffers_held_at_the_pause(new_fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.sessions.held.PINNED_BYTES", 2**24)
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=4000)])
    async with opened(fake.run(25)) as screen:
        await screen.press("m")
        await screen.press("plus", "plus")
        await screen.until(lambda: monitor(screen).window.span_s == 2.0 and filled(screen), "two seconds")
        await screen.press("space", shows="10 s held, 4 s of it fetched")
        fake.advance(16)
        await screen.press("minus", "minus", shows="10 s held, all fetched")
        held = monitor(screen).pause.source
        time_ns, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
        assert time_ns[-1] - time_ns[0] > 9.9e9
        np.testing.assert_array_equal(values, logged(time_ns))


async def test_zoom_pan_and_samples_work_after_the_link_was_cut(fake, screen, ran_s=60):
    await open_torque(screen)
    held = await hold(screen)
    fake.cut()
    await screen.press("plus", "plus", "plus", "pageup")
    await screen.until(lambda: monitor(screen).window.span_s == 1.0 and filled(screen), "one second of columns")
    stamps, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
    np.testing.assert_array_equal(values, logged(stamps))
    assert len(stamps) == round(held.held_s * HZ) + 1


async def test_a_link_that_is_cut_at_once_leaves_the_picture_which_claims_no_seconds_and_is_looked_through_and_measured(
    fake, screen, ran_s=61
):
    await open_torque(screen)
    await screen.until(lambda: filled(screen), "the whole picture")
    fake.cut()
    await screen.press("space", shows="only the picture fetched")
    await screen.shows("ago, only the picture held")
    await screen.until(lambda: filled(screen), "the whole picture")
    assert "20 s held" not in screen.text
    await screen.do("find", "h", "enter", shows="highest, ")
    await screen.shows(": 40.0000 at -")
    await screen.shows("(picture only, to ")
    assert abs((monitor(screen).window.at_ns - START_NS) / 1e9 % 4) < 0.2  # a spike every 4 s
    await screen.do("cursor_b", *["shift+left"] * 3, shows="picture only, to ")
    await screen.shows("; mean, std and rms need all samples")

    def told():
        line = [line for line in screen.text.splitlines() if "torque" in line][-1]
        words = line.split()[1:]
        return words if len(words) == 5 and all(re.fullmatch(r"[-+.\de]+", word) for word in words) else []

    await screen.until(told, "facts of the columns between the cursors")
    at_a, _, _, smallest, largest = map(float, told())
    assert smallest <= at_a <= largest


async def test_what_one_key_entered_escape_leaves_in_one_and_space_again_or_leaving_the_plots_lets_go(
    fake, screen, ran_s=60
):
    await open_torque(screen)
    shown = monitor(screen)
    for keys, steps in (
        (("find", "h", "enter"), ["Live"]), (("home",), ["Live"]), (("space", "h"), ["No cursor", "Live"]),
        (("h",), ["No cursor"]),
    ):  # fmt: skip
        await screen.do(*keys)
        await screen.until(lambda: shown.window.cursor is not None, "the cursor is there")
        for step in steps:
            await screen.until(lambda step=step: shown.way_back()[0] == step, step)
            await screen.press("escape")
        await screen.until(lambda: shown.window.cursor is None and not shown.window.paused, "all is left")
        assert screen.app.screen is shown
    held = await hold(screen)
    await screen.press("space")
    await screen.until(lambda: not fake.pins, "the pin is let go of")
    fake.advance(3)
    await screen.until(lambda: store_of(screen).end * store_of(screen).column_ns > held.end_ns, "it goes on")
    await hold(screen)
    assert fake.pins
    await screen.press("escape", "escape")
    await screen.until(lambda: not fake.pins, "the pin is let go of")


async def test_what_was_held_for_a_question_that_is_left_goes_on(fake, screen, ran_s=60):
    """One key held the picture to look for something in it: one that looks for nothing lets go of it."""
    await open_torque(screen)
    shown = monitor(screen)
    for letters in ("", "-3s", "last above 1", "torque > 1"):
        await screen.do("find", shows="Find in")
        await screen.type(letters)
        assert shown.window.paused
        await screen.press("escape")
        await screen.until(lambda: not shown.window.paused and not fake.pins, "it goes on")
        assert screen.app.screen is shown
    await hold(screen)
    await screen.do("find")
    await screen.press("escape")
    await screen.until(lambda: screen.app.screen is shown, "the plots")
    assert shown.window.paused, "that pause was another key's"


async def test_scrolling_back_while_it_runs_looks_into_the_buffers_and_end_returns(deep, opened):
    fake = deep
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        await screen.press("pageup", "pageup", shows="End: now")
        await screen.until(lambda: filled(screen), "what was logged before")
        assert not fake.pins
        await screen.press("end")
        fake.advance(2)
        await screen.until(lambda: store_of(screen).end * store_of(screen).column_ns >= fake.now_ns, "it goes on")


async def test_where_no_more_is_held_scrolling_back_says_so_until_it_goes_on_and_holes_are_told_without_a_key(
    monkeypatch, screen, ran_s=60
):
    await open_torque(screen)
    await screen.shows(f"10 s held (older: {key_of('recordings')}, if recorded)")
    await screen.press("pageup")
    await screen.shows("that is the oldest: /legs/LF/HAA/torque holds 10 s (buffer looping")
    assert "PAUSED" in screen.text
    await screen.press("escape")
    await screen.until(lambda: not monitor(screen).window.paused, "it goes on")
    assert monitor(screen).line.said == ""
    monkeypatch.setattr(screen.app.screen.stack, "missing", lambda before: "2 s before the start")
    screen.app._second()
    await screen.shows("2 s before the start")
    monkeypatch.setattr(screen.app.screen.stack, "missing", lambda before: "")
    screen.app._second()
    await screen.until(lambda: "before the start" not in screen.text)


async def test_scrolling_back_by_less_than_half_a_window_says_how_far_it_went_and_why(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=4800)])
    async with opened(fake.run(60)) as screen:
        await screen.press("m")
        await screen.until(lambda: not store_of(screen).empty, "history in the plot")
        await screen.press("pageup", shows=" s back: that is the oldest: ")
        said = monitor(screen).line.said
        assert "HAA/torque holds 12 s (buffer looping 4800 at divider 1); " in said
        assert said.endswith("; s in the table holds more, :record records, F has what is saved")
        await screen.shows("←→ Cursor")
        monitor(screen).line.say("")
        await screen.press("pageup")
        await screen.until(lambda: monitor(screen).line.said.startswith("that is the oldest: "))


async def test_of_several_signals_that_which_is_held_longest_ends_what_is_held_and_none_that_is_held_since_the_start(
    new_fake, opened
):
    fake = new_fake([
        scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=2400),
        scalar(OTHER, "Nm", buffer=BufferType.LOOPING, size=4800),
    ])  # fmt: skip
    async with opened(fake.run(11)) as screen:
        await screen.press("*", "m")
        await screen.until(lambda: not store_of(screen).empty, "history in the plot")
        await screen.press("pageup", shows="the oldest that is held; ⇧← cursor by ten")
        await screen.press("escape")
        fake.advance(60)
        await screen.until(lambda: store_of(screen).end * store_of(screen).column_ns >= fake.now_ns, "it goes on")
        await screen.press("pageup", shows="that is the oldest: /legs/LH/HAA/torque holds 12 s (buffer looping")


async def test_buffers_that_hold_more_than_they_were_asked_to_are_looked_back_in(fake, monkeypatch, screen, ran_s=60):
    await open_torque(screen)
    monkeypatch.setattr(type(screen.session.source), "period_ns", lambda source, name: 1_000_000)  # of 2.5 ms
    window = monitor(screen).window
    await screen.press("plus")
    await screen.until(lambda: window.span_s == 5.0)
    await screen.press("pageup")
    half_ns = 2 * 10**9
    await screen.until(lambda: window.paused and window.paused_end_ns < fake.now_ns - half_ns, "half a window back")
    assert "oldest" not in screen.text
    await screen.press(*["pageup"] * 3, shows="torque holds 10 s (buffer")  # not the 4 s that it was asked for


async def test_a_spike_of_one_sample_shows_in_what_is_pinned_at_every_zoom_fetched_or_not(screen, ran_s=61):
    await open_torque(screen)
    held = await hold(screen)
    for column_ns in (1_000_000, 10_000_000, 250_000_000):
        found = held.columns([TORQUE], held.begin_ns, held.end_ns, column_ns)
        if found.low.shape[1] < 4096:
            assert np.nanmax(found.high) == 40.0
    _, values = await held.samples(TORQUE, held.begin_ns, held.end_ns)
    assert values.max() == 40.0
    held.main._slices.clear()  # columns of what is not fetched come from wider ones
    wide = held.columns([TORQUE], held.begin_ns, held.end_ns, 500_000_000)
    close = held.columns([TORQUE], held.end_ns - 10**9, held.end_ns, 2_000_000)
    assert np.nanmax(wide.high) == 40.0
    assert np.isfinite(close.low).mean() > 0.95


async def test_what_was_found_is_read_whole_at_80_columns(screen, ran_s=60):
    await screen.enter("/LF/", "asterisk", "m")
    await screen.curves()
    await screen.do("find", "h", "enter")
    await screen.until(lambda: re.search(r"highest in \S+, \d+ of \d+: \S+ at -\d+\.\d+ s", screen.text), "the answer")
    told = next(line for line in screen.text.splitlines() if "highest in" in line)
    assert re.search(r" s( of \d+ s held)? \(", told)


# ------------------------------------------------------------------------------- what the buffers hold behind the pin


@pytest.fixture
def spiked(new_fake):
    """A logger that holds 100 s; the torque has a spike at 4, 8, ... s."""

    def make(size=40_000):
        return new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=size)])

    return make


async def test_the_highest_is_looked_for_in_all_that_the_buffers_hold(spiked, opened):
    fake = spiked()
    async with opened(fake.run(61)) as screen:
        await open_torque(screen)
        await screen.press("plus", "plus", "plus")  # a second, in which there is no spike, as in the one before
        await screen.until(lambda: monitor(screen).window.span_s == 1.0)
        fake.advance(1.9)
        await screen.until(lambda: store_of(screen).end * store_of(screen).column_ns >= fake.now_ns, "newest columns")
        await screen.do("find", "h", "enter", shows="highest, 16 of 16: 40")
        held = monitor(screen).pause.source
        assert monitor(screen).window.at_ns == START_NS + 60 * 10**9
        assert monitor(screen).window.at_ns < held.main.begin_ns
        assert held.covers(monitor(screen).window.at_ns)


async def test_a_moment_that_the_buffers_lost_is_said_with_the_oldest_that_is_held(spiked, opened, monkeypatch):
    fake = spiked(8000)
    fake.run(60)
    fake.happen("marker", "long ago", fake.started_ns + 10**9)
    async with opened(fake) as screen:
        await open_torque(screen)
        await screen.do("events", "enter", shows="no plot has it: ")
        assert isinstance(screen.app.screen, EventsScreen)
        monkeypatch.setattr(
            EventsScreen, "_is_gone", lambda *_: False
        )  # of other elements it is held, for all it knows
        await screen.press("enter")
        await screen.shows("overwritten, these plots hold from -19.99")
        assert re.search(r"plots hold from -19.99\d s to 0.000 s", monitor(screen).line.said)  # no clocks at 80 columns
        await screen.shows(" to 0.000 s")
        assert monitor(screen).window.cursor is None
        assert not monitor(screen).window.paused


@pytest.mark.parametrize("keys", [("events", "enter"), ("previous_event",)])
async def test_an_event_that_the_buffers_hold_is_gone_to_beyond_the_pin(spiked, opened, keys):
    fake = spiked()
    fake.run(60)
    fake.happen("marker", "long ago", fake.started_ns + 10**9)
    async with opened(fake) as screen:
        await open_torque(screen)
        await screen.do(*keys, shows="at -58.99")
        await screen.shows(': "long ago"')
        assert monitor(screen).window.at_ns == fake.started_ns + 10**9


async def test_brackets_step_far_beyond_the_pin_and_what_was_pinned_there_survives_link_and_buffers(spiked, opened):
    fake = spiked()
    async with opened(fake.run(61)) as screen:
        await open_torque(screen)
        await screen.do("find", "h", "enter", shows="16 of 16: 40")
        for count in range(15, 10, -1):
            await screen.do("previous_found", shows=f"{count} of 16: 40")
        held, at_ns = monitor(screen).pause.source, START_NS + 40 * 10**9
        assert monitor(screen).window.at_ns == at_ns
        await screen.until(lambda: filled(screen), "the picture there")
        await screen.until(lambda: len(held.held(TORQUE, at_ns - 10**9, at_ns + 10**9)[0]) > 700, "the samples there")
        fake.advance(500)
        fake.cut()
        time_ns, values = await held.samples(TORQUE, at_ns - 10**9, at_ns + 10**9)
        np.testing.assert_array_equal(values, logged(time_ns))
        assert 40 in values


async def test_all_pins_are_let_go_of_with_the_pause(spiked, opened):
    fake = spiked()
    async with opened(fake.run(61)) as screen:
        await open_torque(screen)
        await screen.press("space", "home")
        await screen.until(lambda: len(fake.pins) > 1, "a second pin")
        await screen.press("space")
        await screen.until(lambda: not fake.pins, "all pins are let go of")


async def test_finding_from_an_earlier_window_looks_at_what_came_after_it_too(spiked, opened):
    fake = spiked()
    async with opened(fake.run(61)) as screen:
        await open_torque(screen)
        await screen.press("pageup", "pageup", "pageup", shows="End: now")
        await screen.do("find", "l", "enter", shows="lowest, ")
        await screen.do("find", "h", "enter", shows="of 16: 40")


async def test_a_full_stop_steps_into_what_no_pin_has(spiked, opened):
    fake = spiked()
    async with opened(fake.run(61)) as screen:
        await open_torque(screen)
        held = await hold(screen)
        begin = held.main.begin_ns
        monitor(screen)._go_to(begin)
        await screen.do("previous_sample", "previous_sample")
        await screen.until(lambda: monitor(screen).window.at_ns == begin - 2 * 2_500_000, "two samples before the pin")


# ----------------------------------------------------------------------------------- what is shown is of what is pinned

GAIT = "/log/state/gait"


async def open_gait(screen):
    await screen.enter("/gait", "m")
    await screen.curves()


async def test_in_a_pause_words_and_values_are_those_of_the_cursor_not_of_now(fake, screen, ran_s=60.5):
    await open_gait(screen)
    words = ("stand", "walk", "trot")  # each for 3 s
    pinned = words[int(60.5 / 3) % 3]
    await screen.shows(f"now {pinned}")
    await hold(screen)
    await screen.shows(f"at end {pinned}")
    fake.advance(3.2)
    seen_ns = fake.now_ns
    await screen.until(lambda: screen.session.frame_time_ns == seen_ns, "a live frame")
    await screen.pilot.pause()
    assert f"at end {pinned}" in screen.text
    assert "now " not in screen.text.replace("nowhere", "")
    await screen.press("right")  # the cursor comes in at the left
    other = words[int(50.5 / 3) % 3]
    await screen.shows(f"at cursor {other}")
    await screen.until(lambda: f"│{other}" in screen.text, "the word beside the band")
    await screen.press("escape", shows=f"at end {pinned}")


async def test_who_goes_on_while_a_moment_is_brought_is_led_nowhere(fake, monkeypatch, screen, ran_s=61):
    await open_torque(screen)
    await hold(screen)
    plots, bring = screen.app.screen, screen.app.screen.pause.bring

    async def brought(*asked):
        plots.go_on()
        return True

    monkeypatch.setattr(plots.pause, "bring", brought)
    assert not await plots.jump_to(fake.now_ns)
    assert not plots.window.paused
    monkeypatch.setattr(plots.pause, "bring", bring)
    await screen.shows("live")


async def test_what_is_offered_before_the_line_is_drawn_stands_in_it(screen):
    asked, answers = Prompt("Level", "of what", "", "20"), []
    screen.app.push_screen(asked, answers.append)
    asked.offer("40")
    await screen.settled()
    await screen.press("enter")
    assert answers == ["40"]


# ------------------------------------------------------------------------------------ when nothing could be pinned


def only_empty_pins(fake, monkeypatch):
    """As a helper process answers whose ring turned before the wish came: its run, and no row."""
    pin = fake.pin

    def empty(names, start_ns, end_ns):
        held = pin(names, -(2**62), -(2**62))
        held.opened = PinOpened(held.id, "run-1", 0, 0, 0, {}, "", fake.oldest_ns(names))
        return held

    monkeypatch.setattr(fake, "pin", empty)


async def test_a_pin_without_rows_leaves_the_times_and_the_picture_as_they_were(fake, opened, monkeypatch):
    fake.run(60)
    only_empty_pins(fake, monkeypatch)
    async with opened(fake) as screen:
        await open_torque(screen)
        await screen.until(lambda: filled(screen), "the whole picture")
        await screen.press("space", shows="only the picture fetched, no more: the logger holds nothing of it any more")
        await screen.shows(" ago   lost 0")  # for which the head leaves out what the line above says
        await screen.press("left")
        await screen.until(lambda: "A -" in screen.text, "the moment of the cursor, before now")
        assert (
            START_NS
            < monitor(screen).pause.source.begin_ns
            < monitor(screen).pause.source.end_ns
            < START_NS + 61 * 10**9
        )
        assert filled(screen)
        assert not fake.pins


async def test_what_could_not_be_pinned_is_pinned_whole_when_the_link_is_back(deep, opened):
    fake = deep
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        await screen.until(lambda: filled(screen), "the whole picture")
        fake.cut()
        await screen.press("space", shows="only the picture held")
        fake.mend()
        await screen.until(lambda: screen.session.connected)
        await screen.press("plus", shows="ago, 20 s held")


async def test_the_title_tells_the_sample_that_was_found_and_a_crossing_is_offered_at_its_value(fake, screen, ran_s=61):
    await open_torque(screen)
    await hold(screen)
    await screen.do("find", "h", "enter", shows="of 3: 40")
    await screen.until(lambda: re.search(r"at cursor 40(\.0*)? \(-?[\d.]+ … 40", screen.text), "the sample")
    fake.advance(1.3)
    await screen.do("find")
    await screen.until(lambda: screen.app.screen.query_one(Input).placeholder.startswith("e.g. > 40 "), "the spike")


async def test_what_lies_between_is_added_up_in_the_helper_where_it_is_not_here(deep, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.sessions.pinned.QUICK_S", 0.0)
    fake = deep
    async with opened(fake.run(60)) as screen:
        await open_torque(screen)
        await screen.press("space", shows="20 s held, 11 s of it fetched")
        held = monitor(screen).pause.source
        asked = len(fake.calls)
        facts, partly = await held.measure([TORQUE], held.begin_ns, held.end_ns)
        assert fake.calls[asked:] == [("measure", (TORQUE,))]
        assert (partly, facts[TORQUE].samples) == ("", 1 + (held.end_ns - held.begin_ns) * HZ // 10**9)
        here = held.end_ns - 10**9
        facts, _ = await held.measure([TORQUE], here, held.end_ns)
        assert len(fake.calls) == asked + 1
        assert facts[TORQUE].samples == 1 + HZ


async def test_what_the_plot_showed_stays_to_be_seen_where_the_buffers_hold_it_no_more(new_fake, opened):
    fake = new_fake([scalar(TORQUE, "Nm", buffer=BufferType.LOOPING, size=1600)])  # of 4 s, with room for 8 s
    async with opened(fake.run(5)) as screen:
        await screen.press("m")
        await screen.until(lambda: not store_of(screen).empty, "history in the plot")
        for _ in range(10):
            fake.advance(0.5)
            await screen.until(
                lambda: store_of(screen).end * store_of(screen).column_ns >= fake.now_ns, "what came meanwhile"
            )
        await screen.until(lambda: filled(screen), "ten seconds as they came")
        await screen.press("space", shows="before it as drawn")
        await screen.until(lambda: monitor(screen).pause.source.main.complete, "all samples")
        assert filled(screen)
        await screen.do("oldest")
        await screen.until(lambda: monitor(screen).window.at_ns == monitor(screen).held_ns[0], "the oldest drawn")


@pytest.mark.parametrize(("at_ns", "found_ns"), [(None, None), (5, 10), (10, 10), (50, 50)])
async def test_a_cursor_over_what_was_overwritten_goes_to_the_oldest_that_is_held(at_ns, found_ns):
    async def look(*_):
        pass

    window = SimpleNamespace(at_ns=at_ns, column_ns=lambda _: 1, span_ns=100)
    source = SimpleNamespace(look=look)
    plots = SimpleNamespace(
        window=window, stack=SimpleNamespace(columns=100), shown_ns=(50, 150), held_ns=(10, 150),
        pause=SimpleNamespace(source=source), _show_held=lambda _: None, _empty=lambda: None, _read_moment=lambda: None,
    )  # fmt: skip
    await PlotScreen._look(plots)
    assert window.at_ns == found_ns
