"""The sixteen tasks of the guide, each done with exactly the keys that the page names, at 80x24."""

import re
from pathlib import Path

import numpy as np
import pytest
from textual.widgets import OptionList

from silo.core.elements import BufferType, Entry, FileType
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files import write
from silo.programs.demo.robot import SimulatedRobot
from silo.programs.demo.signals import signals
from silo_tui.gate import Holding
from silo_tui.model.plots.panels import isolate
from silo_tui.model.table.fields import Field
from silo_tui.screens.plots.monitor import MonitorScreen
from tests.stand_ins.fake_signals import scalar

pytestmark = pytest.mark.slow  # each walks through the whole app

PAGE = Path(__file__).parents[2] / ".docs" / "guide" / "sixteen.md"
NAMES = {"Enter": "enter", "Esc": "escape"}
TORQUE = "/log/legs/LF/HAA/torque"


def tasks():
    """The rows of the page: number, and ways of keys and typed words; `and` begins another one."""
    found = {}
    for line in PAGE.read_text("utf-8").splitlines():
        row = re.fullmatch(r"\| (\d+) \| ([^|]+) \| (.+) \|", line)
        if row is not None:
            ways = row[3].split(" and ")
            found[int(row[1])] = [re.findall(r"`([^`]+)`|\*([^*]+)\*(?!`)", way) for way in ways]
    return found


TASKS = tasks()


def is_read(dialog):
    """Whether a dialog tells what the choice under the cursor would do: who takes it before is asked once more."""
    choices = dialog.query_one(OptionList) if dialog.query("#about") else None
    return choices is None or choices.highlighted is None or dialog.told == choices.highlighted_option.id


async def free(screen):
    """Waits until what was asked for is there, and said: meanwhile nobody takes keys."""
    await screen.until(lambda: screen.app._exit or not isinstance(screen.app.screen, Holding), "an answer")
    await screen.until(lambda: is_read(screen.app.screen), "what a choice would do")


async def do(screen, number, way=0):
    """Press what the page says."""
    for key, words in TASKS[number][way]:
        await free(screen)
        if words:
            await screen.type(words)
        else:
            await screen.press(NAMES.get(key, key))
    await free(screen)


async def plots(screen):
    await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen), "plots")
    await screen.curves()
    return screen.app.screen


def test_the_page_has_sixteen_tasks_of_few_keys():
    assert list(TASKS) == list(range(1, 17))
    assert max(len(way) for ways in TASKS.values() for way in ways) <= 7


async def test_1_the_hottest_motor_is_on_top(screen, ran_s=20):
    await do(screen, 1)
    rows = screen.session.rows
    await screen.until(lambda: "value" in screen.session.table.facts.quantities, "what was measured")
    await screen.until(lambda: rows.row == rows.shown[0], "the cursor on top")
    values = screen.session.table.facts.of("value", len(screen.session.table))
    assert values[rows.row] == max(values[row] for row in rows.shown)
    assert len(rows.shown) == 12


@pytest.fixture
def demo(new_fake):
    """A logger with the elements of `silo demo`: many more of them are torques than those of the small robot."""
    robot = signals(SimulatedRobot(400, seed=1))
    return new_fake([scalar(f"/log/{each.group}/{each.name}", each.row.unit, action=each.row.action) for each in robot])


@pytest.mark.parametrize("robot", ["fake", "demo"])
async def test_2_three_torques_and_nothing_else_are_plotted_live(robot, request, opened):
    logger = request.getfixturevalue(robot)
    logger.run(20)
    async with opened(logger) as screen:
        await do(screen, 2)
        shown = await plots(screen)
        assert screen.app.context.session.rows.marked_count == 3
        for joint in ("HAA", "HFE", "KFE"):
            await screen.until(lambda joint=joint: f"LF/{joint}/torque " in screen.text, joint)
        assert len(re.findall(r"/LF/\w+/\w+", screen.text)) == 3
        end = shown.stack.store.end
        logger.advance(1.0)
        await screen.until(lambda: shown.stack.store.end > end, "new values")


async def test_3_and_4_all_torques_are_edited_and_applied_while_it_runs(fake, screen, ran_s=20):
    await do(screen, 3)
    await screen.until(lambda: screen.session.table.pending_count[1] == 12, "the edits")
    assert (screen.value(TORQUE, Field.DIVIDER), screen.value(TORQUE, Field.SIZE)) == ("5", "800")
    await do(screen, 4)
    await screen.until(lambda: fake.recorded(TORQUE).divider == 5, "what was applied")
    assert fake.recorded(TORQUE).buffer_type is BufferType.LOOPING
    assert [call[0] for call in fake.calls] == ["stop", "save", "apply", "start"]


async def test_5_a_script_is_saved_under_a_name_and_another_one_loaded(fake, screen):
    await do(screen, 5)
    await screen.until(lambda: "walk.yaml" in fake.files, "the script")
    await do(screen, 5, 1)
    await screen.until(lambda: [call for call in fake.calls if call[0] == "load_script"], "the other one")


async def test_6_it_is_started_and_stopped(screen):
    await do(screen, 6)
    await screen.shows("● RUNNING")
    await do(screen, 6, 1)
    await screen.shows("■ STOPPED")


async def test_7_three_formats_are_saved(fake, screen, ran_s=12):
    await do(screen, 7)
    await screen.until(lambda: fake.calls, "the save")
    assert set(fake.calls[0][1]) == set(FileType)


@pytest.mark.parametrize(("task", "says"), [(8, r"highest, \d of \d: 40.0000 at -\d"), (10, r"highest.* at -\d")])
async def test_8_and_10_a_spike_is_found_and_read_and_the_time_of_the_maximum_told(task, says, screen, ran_s=21):
    await screen.enter("/LF/HAA/torque", "m")
    await plots(screen)
    await do(screen, task)
    await screen.until(lambda: re.search(says, screen.text), "the spike, or when it was")


async def test_9_two_signals_stand_in_one_plot(screen, ran_s=20):
    await screen.enter("/LF HAA torque|velocity")
    await do(screen, 9)
    shown = await plots(screen)
    assert [len(panel) for panel in shown.stack.panels] == [2]
    assert len(isolate(shown.stack.panels, shown.stack.plots[0])) == 2


async def test_11_an_edit_is_taken_back(screen):
    await screen.do("toggle")
    assert screen.session.table.pending_count == (1, 1)
    await do(screen, 11)
    assert screen.session.table.pending_count == (0, 0)


async def test_12_what_was_just_saved_is_opened(fake, opened, tmp_path):
    fake.run()
    fake.logs = tmp_path
    time_ns = 1_790_000_000 * 10**9 + np.arange(100, dtype=np.int64) * 10**7
    entry = RecordedEntry(TORQUE, Entry("", "<f8"), np.sin(np.arange(100) / 9))
    torque = RecordedElement(TORQUE, "Nm", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))
    write(Recording("robot", time_ns, 100, [torque]), tmp_path, "robot", ["silo"], "robot_00001", why="saved by me")
    async with opened(fake) as screen:
        keys = TASKS[12][0]
        for key, _ in keys[:-1]:
            await free(screen)
            await screen.press(NAMES.get(key, key))
        await screen.shows("o Opens it")
        await screen.press(keys[-1][0], at="file")


async def test_13_another_logger_is_opened(new_fake, opened):
    async with opened(new_fake(name="arm"), new_fake(name="legs"), ready=False) as screen:
        await screen.shows("legs")
        await screen.press("enter")
        await screen.until(lambda: screen.app.context.has_session and screen.session.connected, "the first one")
        await screen.until(lambda: not screen.app.context._flow_running, "all of it: another is opened then")
        keys = TASKS[13][0]
        await screen.press(*(key for key, _ in keys[:2]), shows="legs")
        for key, _ in keys[2:]:
            await screen.press(NAMES.get(key, key))
        await screen.until(lambda: screen.app.context.has_session and screen.session.name == "legs", "the other one")


async def test_14_the_table_is_ordered_by_rate(screen, ran_s=20):
    await do(screen, 14)
    await screen.shows("by rate ↓")


async def test_15_a_name_space_is_folded(screen):
    await do(screen, 15)
    assert screen.session.rows.folded == {"/base"}
    assert len(screen.session.rows.tree.branches) > 0


async def test_16_it_ends(screen):
    await do(screen, 16)
    await screen.until(lambda: not screen.app.is_running or screen.app._exit, "the end")
