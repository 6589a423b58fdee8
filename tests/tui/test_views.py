"""Views: what is on the screen is kept by a name and put on it again, on another robot as far as it has it."""

import os

import pytest

from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.layouts.views import capture
from silo_tui.screens.plots.monitor import MonitorScreen
from silo_tui.settings.file import SettingsProblem
from silo_tui.settings.options import Settings

pytestmark = pytest.mark.slow  # each walks through the whole app


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return tmp_path / "silo"


async def run(screen, line):
    await screen.press("colon")
    await screen.enter(line)


async def test_a_view_is_kept_and_put_on_the_screen_again(new_fake, opened):
    fake, second = new_fake(), new_fake()
    fake.run()
    second.run()
    async with opened(fake) as screen:
        await run(screen, "sort div")
        await run(screen, "filter base")
        await screen.press("j", "space", "space", "m", at="monitor")
        monitor = screen.app.screen
        await screen.press("minus", "j")
        await screen.until(lambda: monitor.stack.chosen > 0)
        kept = capture(screen.app.context)
        await run(screen, "view save walk")
        await screen.shows(f"view walk kept with {len(kept.plots)} plots")
        assert isinstance(screen.app.screen, MonitorScreen)
        assert kept.sort == "div"
        assert kept.filter == "base"
        assert kept.span_s == 20.0
        assert len(kept.plots) > 1
    async with opened(second, view="walk") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        assert capture(screen.app.context) == kept
        await screen.shows("view walk")


async def test_a_view_keeps_axes_of_powers_of_ten(new_fake, opened):
    fake, second = new_fake(), new_fake()
    fake.run()
    second.run()
    async with opened(fake) as screen:
        await run(screen, "filter HAA/torque")
        await screen.press("m", at="monitor")
        await screen.settled()
        await screen.do("log_axis", shows="1e2 ┤")  # what is not painted has no scale
        await screen.do("scale")
        kept = capture(screen.app.context)
        assert kept.logs == ("/legs/LF/HAA/torque",)
        assert set(kept.scales) == {"/legs/LF/HAA/torque"}
        await run(screen, "view save tor")
        await screen.shows("view tor kept")
    async with opened(second, view="tor") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        assert capture(screen.app.context) == kept


async def test_plots_belong_to_what_is_on_the_screen_before_they_are_drawn(screen):
    screen.app.push_screen(MonitorScreen(screen.session, screen.session.table.names[:1]))
    kept = capture(screen.app.context)
    await screen.until(lambda: screen.app.screen.is_there, "the plots")
    assert kept.plots
    assert capture(screen.app.context) == kept


async def test_a_view_is_kept_by_its_word_and_listed(screen):
    await run(screen, "sort size")
    await run(screen, "view save my view")
    await screen.shows("view my view kept")
    await run(screen, "sort name")
    await run(screen, "view")
    await screen.shows("views: my view")
    await run(screen, "view my view")
    await screen.until(lambda: screen.session.rows.sort == "size")


async def test_a_view_keeps_order_column_set_folds_and_components(new_fake, opened):
    wanted = KeptLayout(
        "tree", columns=("div", "size"), set="statistics", folded=("/legs/LF",), unfolded=("/base/velocity",),
        components={"/base/position": "_y", "/imu/acceleration": "norm"}, inspector=True,
    )  # fmt: skip
    first, second = new_fake(), new_fake()
    async with opened(first) as screen:
        await screen.do("o", "n", "columns")
        screen.app.screen.table.choose_columns(("div", "size"))
        for name, keys in (
            ("LF/HAA/torque", "zkz"), ("base/velocity", "z"), ("base/position", "nnn"), ("acceleration", "n")
        ):  # fmt: skip
            await run(screen, f"goto {name}")
            await screen.press(*keys)
        rows = screen.session.rows
        rows.folded = frozenset({"/legs/LF"})
        await screen.do("inspector")
        assert capture(screen.app.context) == wanted
        await run(screen, "view save walk")
        await screen.shows("view walk kept")
    async with opened(second, view="walk", size=(80, 48)) as screen:
        await screen.shows("view walk")
        assert capture(screen.app.context) == wanted
        assert screen.app.screen.inspector.display
        await screen.shows("► LF")


async def test_a_view_keeps_which_way_round_an_order_is(new_fake, opened):
    files.save(files.place("least"), KeptLayout("value", turned=True))
    async with opened(new_fake(), view="least") as screen:
        await screen.shows("by value ↑")
        assert capture(screen.app.context) == KeptLayout("value", turned=True)
        files.save(files.place("worst"), KeptLayout("!"))  # as the order by state was called
        await screen.enter(":view worst")
        await screen.until(lambda: capture(screen.app.context) == KeptLayout("state"), "the order")


async def test_a_view_keeps_the_held_scale_of_signals_that_share_a_plot(new_fake, opened):
    pair = ("/legs/LF/HAA/torque", "/legs/LF/HFE/torque")
    layout = KeptLayout(plots=(pair,), scales={"|".join(pair): (-300.0, 700.0)})
    files.save(files.place("joined"), layout)
    fake = new_fake()
    async with opened(fake.run(), view="joined") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        await screen.shows("600 ┤")  # of -300 to 700 the last one in steps of 200
        scales = screen.app.screen.window.scales
        assert scales == {"/log/legs/LF/HAA/torque|/log/legs/LF/HFE/torque": (-300.0, 700.0)}
        assert capture(screen.app.context).scales == layout.scales


async def test_chosen_columns_stay_when_the_terminal_changes_its_size(fake, opened):
    async with opened(fake, settings=Settings(columns=("div", "size"))) as screen:
        await screen.pilot.resize_terminal(100, 30)
        await screen.pilot.pause()
        heads = screen.text.splitlines()[1].split()
        assert "div" in heads
        assert "act" not in heads


def of_a_process_that_is_gone(left):
    """The number is the largest that there is: the tests' own process goes on."""
    return left.rename(left.with_name(left.name.replace(f".none.{os.getpid()}.", ".none.4194303.")))


async def test_what_a_lost_terminal_showed_is_offered_by_a_line_and_comes_when_it_is_asked_for(new_fake, opened):
    async with opened(new_fake()) as screen:
        await run(screen, "sort div")
        await run(screen, "filter base")
        mine = files.left_by_us(screen.session.name)
        await screen.until(mine.exists, "kept within a second")
        await screen.until(lambda: files.load_file(mine)[0] == KeptLayout("div", filter="base"))
    left = of_a_process_that_is_gone(mine)
    async with opened(new_fake()) as screen:
        await screen.shows("`:view last` shows what was on the screen ")
        assert capture(screen.app.context) == KeptLayout()
        await run(screen, "view last")
        await screen.until(lambda: capture(screen.app.context) == KeptLayout("div", filter="base"))
        await screen.shows("this is what was on the screen ")
        await run(screen, "filter")
        await run(screen, "sort name")
        await screen.press("q")
        await screen.until(lambda: not screen.app.is_running)
    assert not left.exists(), "what was there at the end is newer"
    async with opened(new_fake()) as screen:
        assert capture(screen.app.context) == KeptLayout()
        assert ":view last" not in screen.text


async def test_what_is_offered_takes_no_room_from_what_of_the_settings_was_left_out(new_fake, opened):
    files.save(files.left_by_us("robot"), KeptLayout("div", filter="base"))
    of_a_process_that_is_gone(files.left_by_us("robot"))
    async with opened(new_fake(), settings_problems=[SettingsProblem("line 1", "'colums' is unknown")]) as screen:
        await screen.shows("`:view last` shows")
        assert "'colums' is unknown" in screen.text


async def test_edits_and_plots_that_were_left_both_come_back(new_fake, opened):
    fake = new_fake()
    async with opened(fake.run()) as screen:
        await screen.do("toggle", "m", at="monitor")
        mine = files.left_by_us(screen.session.name)
        await screen.until(lambda: mine.exists() and files.load_file(mine)[0].plots, "kept within a second")
    of_a_process_that_is_gone(mine)
    second = new_fake()
    second.run()
    async with opened(second) as screen:
        await screen.shows("Take up 1 edit")
        await screen.press("t")
        await screen.until(lambda: not screen.app.screen.is_modal)
        await run(screen, "view last")
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen), "the plots")
        assert screen.session.table.pending_count == (1, 1)
        await screen.until(lambda: not screen.app.context._flow_running)


async def test_what_a_logger_doesnt_have_is_told_and_the_rest_is_shown(fake, opened):
    name = fake.table().elements[0].name
    entry = name + fake.table().elements[0].entries[0].suffix
    files.save(files.place("old"), KeptLayout(sort="nope", plots=(("gone/x", entry),), columns=("div", "nope")))
    async with opened(fake, size=(160, 50), view="old") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        assert [plotted.name for plotted in screen.app.screen.stack.plots] == [entry]
        await screen.shows("not on this logger: order nope, column nope, 1 of 2 plots (gone/x)")


async def test_a_view_is_kept_on_the_robot_for_all_who_look_at_it(new_fake, opened):
    fake, second = new_fake(), new_fake()
    async with opened(fake) as screen:
        await run(screen, "sort div")
        await run(screen, "view save robot:lab walk")
        await screen.shows("view kept on the robot")
        await run(screen, "view")
        await screen.shows("views: robot:lab walk")
        await run(screen, "view save robot:lab walk")
        await screen.shows("Write over view lab walk?")
        await screen.press("y", shows="view kept on the robot")
    second.views_kept = fake.views_kept
    async with opened(second, view="robot:lab walk") as screen:
        await screen.shows("view robot:lab walk")
        assert screen.session.rows.sort == "div"
        await run(screen, "view lab walk")
        await screen.shows("view robot:lab walk")
        await run(screen, "view robot:other")
        await screen.shows("there is no view 'other' on the robot")
        second.views_kept["hottest"] = second.views_kept["lab walk"]
        await run(screen, "view hottest")
        await screen.shows("│ view hottest")
        await screen.until(lambda: not screen.app.context._flow_running)
        assert screen.session.rows.filter.text == "unit:degC"
        screen.app.screen.action_command("view")
        await screen.shows("Look at what?")
        assert "View robot:lab walk" not in screen.text
        await screen.press("r", shows="View robot:lab walk")
        await screen.press("2")
        await screen.until(lambda: screen.session.rows.sort == "div", "the robot's view")


async def test_a_view_that_is_yet_to_be_shown_is_not_overwritten_by_what_is_there_before_it(fake, opened, monkeypatch):
    show, last, found = views.show, files.left_by_us("robot"), []

    async def show_late(context, layout):
        context.app._opener.keep_view()  # a second has passed since the table came
        found.append(files.load_file(last)[0].sort)
        return await show(context, layout)

    files.save(last, KeptLayout(sort="div"))
    monkeypatch.setattr(views, "show", show_late)
    async with opened(fake, settings=Settings(view="always")) as screen:
        await screen.until(lambda: screen.session.rows.sort == "div")
    assert found == ["div"]


@pytest.mark.parametrize("key", ["q", "ctrl+q"])
async def test_who_quits_on_purpose_is_offered_the_view_the_next_time_and_finds_no_old_filter(key, new_fake, opened):
    async with opened(new_fake()) as screen:
        await run(screen, "filter torque")  # less than a second before the end
        await screen.press(key)
        await screen.until(lambda: not screen.app.is_running)
        screen.app._opener.keep_view()  # the last of its timers
    async with opened(new_fake()) as screen:
        assert capture(screen.app.context) == KeptLayout()
        await screen.shows("`:view last` shows what was on the screen ")
        screen.app.screen.action_command("view")
        await screen.shows("What was on the screen ")
        await screen.press("a")
        await screen.until(lambda: screen.session.rows.filter.text == "torque")


async def test_ctrl_q_over_a_dialog_is_on_purpose_too(new_fake, opened):
    async with opened(new_fake()) as screen:
        await run(screen, "filter torque")
        await screen.press("o", "escape", "?")
        await screen.press("ctrl+q")
        await screen.until(lambda: not screen.app.is_running)
    assert files.left_last(screen.session.name).layout.filter == "torque"
