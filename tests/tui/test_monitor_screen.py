"""The monitor and the large plot, driven by keys."""

import re
import threading
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from silo.core.arrays.columns import Gap, hole_mark
from silo.core.elements import State, Table
from silo.errors import RefusedError
from silo.rpc.published import EventKind
from silo_tui.model.drawing.dots import BLANK
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

TORQUE = "/log/legs/LF/HAA/torque"


def monitor(screen):
    return screen.app.screen


async def open_torque(screen):
    await screen.enter("/LF/HAA/torque", "m")
    await screen.curves()


async def test_plots_are_full_the_moment_they_open_show_a_spike_of_one_sample_and_move_until_the_link_is_lost(
    fake, screen, ran_s=20
):
    await open_torque(screen)
    stack = monitor(screen).stack
    assert not np.isnan(stack.store.piece(TORQUE, stack.store.end, 100).low).any()
    await screen.shows("max 40")
    top = next(line for line in screen.text.splitlines() if " 40 ┤" in line)
    assert any(char not in f"{BLANK}0123456789.- │┤" for char in top), top
    before = stack.store.end
    fake.advance(2.0)
    await screen.until(lambda: stack.store.end > before)
    fake.cut()
    await screen.shows("No link to robot")
    assert not stack.fresh


async def test_why_no_values_come_is_said(fake, opened, monkeypatch):
    def view(*_):
        raise RefusedError("1000 views are open")

    async with opened(fake.run(2)) as screen:
        monkeypatch.setattr(fake, "view", view)
        await screen.enter("/LF/HAA/torque", "m", shows="no live values: 1000 views are open")


async def test_a_curve_goes_on_by_whole_cells_so_that_they_stay_as_they_are_and_lost_frames_are_fetched(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await open_torque(screen)
        store, first = monitor(screen).stack.store, monitor(screen).stack.store.end
        for _ in range(6):
            before = store.end
            fake.advance(0.5)
            await screen.until(lambda before=before: store.end > before, "new columns")
            assert (store.end - first) % 2 == 0
        await screen.until(lambda: fake.views[-1].seen_ns == fake.now_ns, "a frame")
        store = monitor(screen).stack.store
        fake.advance(2.0)
        fake.views[-1].from_ns, fake.views[-1].seen_ns = fake.now_ns, -1  # what came in these 2 s is gone
        fake.advance(0.5)
        newest = fake.now_ns // store.column_ns
        await screen.until(lambda: store.end > newest, "the frame after that")
        await screen.until(lambda: not np.isnan(store.piece(TORQUE, newest, 100).low).any(), "what was lost")


async def test_another_plot_that_is_chosen_leaves_the_rest_as_a_whole_repaint_shows_it(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await screen.type("/LF")
        await screen.press("enter", "asterisk", "m")
        await screen.until(lambda: not monitor(screen).stack.store.empty, "history in the plots")
        await screen.until(lambda: not re.search(r"now -\s", screen.text), "the newest of each signal")
        for key in ("j", "j", "k", "j"):
            await screen.press(key)
            shown = list(screen._lines())  # with their styles
            monitor(screen).stack.redraw()
            await screen.pilot.pause()
            assert list(screen._lines()) == shown, key


async def test_a_pause_holds_the_picture_follows_the_theme_walks_back_and_zooms_on_in_the_large_plot(
    fake, screen, ran_s=30
):
    await open_torque(screen)
    await screen.press("space", shows="PAUSED")
    before = monitor(screen).stack.store.end
    fake.advance(5.0)
    await screen.until(lambda: screen.session.frame_time_ns == fake.now_ns, "what was logged meanwhile")
    await screen.pilot.pause()
    assert monitor(screen).stack.store.end == before
    before = [segment.style.color for segment in monitor(screen).stack.render_line(2)]
    screen.app.theme = "silo-light"
    await screen.until(
        lambda: not {segment.style.color for segment in monitor(screen).stack.render_line(2)} & set(before)
    )
    await screen.press("plus", "left")  # as much is held as was shown: there is more to go back in
    end = monitor(screen).window.paused_end_ns
    await screen.press(*["shift+left"] * 8)
    assert monitor(screen).window.paused_end_ns < end
    await screen.press(*["plus"] * 12, "enter", shows="TIME")
    plot = screen.app.screen
    assert plot.window.span_s == 0.001
    await screen.press("minus")
    assert plot.window.span_s == 0.002


async def test_zoom_shows_another_span_at_a_held_scale_the_cursor_reads_and_the_detail_plot_has_axes(screen, ran_s=20):
    await open_torque(screen)
    await screen.press("plus", shows="5 s shown")
    await screen.press("minus", "minus", shows="20 s shown")
    await screen.press("y", shows="y held")
    scale = monitor(screen).window.scales[TORQUE]
    await screen.press(*["plus"] * 4, shows="1 s shown")
    assert monitor(screen).window.scales[TORQUE] == scale
    await screen.press("left", shows="at cursor")
    await screen.shows("cursor at -")
    await screen.press("enter", shows="TIME")
    await screen.press("tab", "tab", shows="SPECTRUM")


async def test_a_wider_span_has_no_blank_though_its_history_comes_late(fake, opened):
    fake.run(60)
    gate = threading.Event()
    gate.set()
    history = fake.history

    def late(*asked):
        found = history(*asked)  # as it was when it was asked for
        # frames are made of it too, by the screen's own thread
        assert threading.current_thread() is threading.main_thread() or gate.wait(DEADLINE_S)
        return found

    fake.history = late
    async with opened(fake) as screen:
        await open_torque(screen)
        gate.clear()
        await screen.press("minus", "minus")
        for _ in range(8):
            fake.advance(0.25)
            await screen.pilot.pause(0.05)
        gate.set()
        await screen.shows("30 s shown")
        store = monitor(screen).session.columns
        await screen.until(lambda: monitor(screen).stack.store is store and store.past_until_ns, "the history")
        for _ in range(3):
            fake.advance(0.25)
            newest = fake.now_ns // store.column_ns
            await screen.until(lambda newest=newest: store.end > newest, "the newest frame")
        await screen.until(lambda: not np.isnan(store.piece(TORQUE, newest, 120).low).any(), "no blank")


async def test_what_was_overwritten_is_said_under_the_plots(fake, opened):
    fake.run(20)
    history = fake.history

    def short(names, start_ns, end_ns, column_ns):
        found = history(names, start_ns, end_ns, column_ns)
        marks = np.zeros(found.low.shape, np.uint8)
        gone = found.first + np.arange(found.low.shape[1]) < (fake.now_ns - 4_000_000_000) // column_ns
        found.low[:, gone] = found.high[:, gone] = np.nan
        marks[:, gone] = hole_mark(Gap.OVERWRITTEN)
        return replace(found, marks=marks)

    fake.history = short
    async with opened(fake) as screen:
        await open_torque(screen)
        await screen.shows("░ overwritten ░")
        await screen.shows("░ 5.9 s overwritten")


async def test_of_a_vector_one_entry_or_all_are_plotted_as_it_is_looked_at_folded_or_marked(screen, ran_s=20):
    await screen.enter("/base/position")
    await screen.do("component", "component", shows="entry x alone, 1 of 3")
    await screen.plot("m")
    assert [each.name for each in screen.app.screen.stack.plots] == ["/log/base/position_x"]
    await screen.press("escape")
    await screen.do("component", shows="entry y alone, 2 of 3")
    await screen.do("component", "component", shows="its entries side by side")
    await screen.plot("m")
    assert len(screen.app.screen.stack.plots) == 3
    await screen.press("escape")
    await screen.do("fold")
    await screen.press("j")
    await screen.plot("m")
    assert [each.name for each in screen.app.screen.stack.plots] == ["/log/base/position_x"]
    await screen.press("escape")
    await screen.press("space", shows="base/position marked, with all")  # beside filter and marks
    await screen.plot("m")
    assert len(screen.app.screen.stack.plots) == 3
    await screen.press("escape", "space", shows="base/position no longer marked, with all")


async def test_the_cursor_is_drawn_a_cell_further_for_each_press(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await open_torque(screen)

        def cell():
            return next(line for line in screen.text.splitlines() if "┤" in line).rfind("│")

        await screen.press("left", shows="cursor at -")
        begin = cell()
        for step in range(1, 4):
            await screen.press("left")
            await screen.until(lambda step=step: cell() == begin - step)


async def test_every_marked_element_has_its_plots(screen, ran_s=20, size=(120, 40)):
    await screen.press("space", "space", "m", shows="/base/position_z")
    assert len(monitor(screen).stack.plots) == 7


async def test_one_that_is_only_saved_is_plotted_and_two_against_one_another(screen, ran_s=20):
    await screen.enter("/solver_cost", "m", shows="/state/solver_cost")
    await screen.shows("max")
    await screen.press("escape")
    await screen.enter("/LF torque", "asterisk", "m", "enter", "tab", shows="X-Y")
    await screen.shows("r = ")


async def test_escape_gives_the_table_its_view_again_and_the_line_of_plots_says_that_the_logger_is_dead(
    fake, screen, ran_s=20
):
    await open_torque(screen)
    await screen.press("escape")
    await screen.until(lambda: fake.views[-1].values == (TORQUE,) and not fake.views[-1].plots)
    await screen.plot("m")
    await screen.shows("│ live │")
    fake.state, fake.reason = State.DEAD, "nothing is known of why"
    fake.publish(EventKind.CRASHED, "it died")
    await screen.shows("│ DEAD │")
    axis = next(line for line in screen.text.splitlines() if "-2.5 s" in line)
    assert axis.rstrip().endswith("end")
    assert "now" not in screen.text.replace("known", "")
    assert "│ live │" not in screen.text


async def test_a_second_that_passes_before_the_plots_are_laid_out_ends_nothing(screen, ran_s=20):
    screen.app.screen.command_monitor()  # on the stack, nothing of it made yet
    assert not screen.app.context.upper_screen.is_mounted
    screen.app._second()
    screen.app._poll()
    await screen.curves()


@pytest.mark.parametrize("mode", ["PAUSED 41 s ago, 3 s held", "SCOPE normal  CAUGHT 0.8 s ago"])
async def test_the_head_keeps_alarm_loss_and_recording_where_the_mode_is_long(mode, screen, monkeypatch, ran_s=20):
    await open_torque(screen)
    bar = monitor(screen).status_bar
    monkeypatch.setattr("silo_tui.widgets.bars.head_words", lambda *_: (("12 alarms HH", "HH 12"), True, ()))
    session = screen.session
    session.status = msgspec.structs.replace(session.status, recorders=1)
    session.measured_hz, session.lost_total, bar.mode = 361.5, 1240, mode
    words = bar._line().plain
    assert len(words) <= 80
    for part in ("HH 12", "REC 1", "lost 1 240", "361.5 Hz slow", "anymal/robot", *mode.split()[:1]):
        assert part in words
    if "CAUGHT" in mode:
        assert "CAUGHT" in words


async def test_keys_of_a_plot_say_that_nothing_is_plotted_where_its_signal_is_no_longer_in_the_table(screen, ran_s=20):
    await screen.press("m")
    await screen.curves()
    shown, table = screen.app.screen, screen.session.table
    gone = {each.element.name for each in shown.stack.plots}
    table.load(Table(table.revision + 1, [each for each in table.elements if each.name not in gone]))
    shown.table_changed()
    assert not shown.stack.plots
    for does in ("join_plots", "plot_trigger", "isolate_plot", "catch", "next_found", "turn_plotted_up"):
        shown.say("")
        shown.action_command(does)
        await screen.shows("nothing is plotted")
        assert screen.app.screen is shown


async def test_how_many_elements_are_plotted_is_told_where_that_is_another_number_than_of_plots(screen, ran_s=20):
    await screen.do("mark", "mark", "monitor")
    await screen.shows("plots 1-5 of 7, of 2 elements, vectors by entry (j next)")
    await screen.do("plot_bottom", shows=" of 7, of 2 elements, vectors by entry (k before)")


async def test_another_signal_is_plotted_by_its_name_without_leaving_the_plots(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await open_torque(screen)
        await screen.press("m", shows="added by their names; :xy over")
        await screen.press(*"LF/HAA/pos", "tab", "enter")
        await screen.shows("added /legs/LF/HAA/position; J lays it over the plot above")
        stack = monitor(screen).stack
        assert [each.name for each in stack.plots] == [TORQUE, TORQUE.replace("torque", "position")]
        assert stack.chosen_plot is stack.plots[1]
        await screen.press("J")
        await screen.until(lambda: [len(panel) for panel in stack.panels] == [2], "one plot of both")
        await screen.enter(":plot LF/HAA/torque", shows="that is plotted already")
        await screen.enter(":plot LF/HAA/torqe", shows="no element is called 'LF/HAA/torqe'")
        await screen.press("m", "enter", shows="say what to plot")
        await screen.enter(":plot position")
        await screen.until(lambda: len(stack.plots) > 2, "all that end so")
        assert all(each.element.name.endswith(("/torque", "/position")) for each in stack.plots)
        assert len({each.name for each in stack.plots}) == len(stack.plots)
        await screen.press("space", "m", shows="added by their names")


async def test_what_is_named_is_plotted_from_the_table_whatever_is_marked(screen, ran_s=20):
    await screen.press("space")
    await screen.enter(":plot LF/HAA/torque")
    await screen.until(lambda: monitor(screen).scope == "monitor", "the plots")
    assert [each.name for each in monitor(screen).stack.plots] == [TORQUE]
    await screen.enter(":plot RF/HAA/torque LH/HAA/torque", shows="added 2 plots")
    await screen.press("escape")
    await screen.enter(":plot", shows="say what to plot")
    typed = [TORQUE.replace("LF", leg) for leg in ("RF", "LH", "LF")]
    await screen.enter(f":plot {' '.join(typed)}")
    await screen.until(lambda: [each.name for each in monitor(screen).stack.plots] == typed, "in the order as typed")


async def test_tab_offers_the_neighbours_of_the_plot_that_is_chosen_first(screen, ran_s=20):
    await screen.enter("/RF/KFE/torque", "m")
    await screen.curves()
    await screen.do("add_plot")
    await screen.press("tab", shows="plot /legs/RF/KFE/position")
    await screen.press("tab", shows="plot /legs/RF/KFE/velocity")


async def test_what_is_found_in_plots_are_values_where_there_is_room_to_say_so(screen, ran_s=20, size=(160, 30)):
    await open_torque(screen)
    await screen.shows("f Find value  ")
    await screen.press("enter", at="detail")
    await screen.shows("f Find value  ")
    screen.app.screen.action_command("mode_spectrum")
    await screen.shows("f Find peak  ")
    await screen.press("escape", "escape")
    await screen.pilot.resize_terminal(80, 24)
    await screen.shows("f Find  ")
