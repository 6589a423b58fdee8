"""Rows of a robot with long names say which they are at 80 cells, with whatever columns and on whatever screen."""

import time

import pytest
from msgspec.structs import replace

from silo.conditions.standing import LimitWord, TriggerStatus
from silo.core.conditions import TriggerWord, new_trigger
from silo_tui.model.table.facts import STATISTICS
from tests.stand_ins.fake_signals import scalar, vector
from tests.tui.test_conditions import HOT

LEGS = {"left_front": "LF", "right_front": "RF", "left_hind": "LH", "right_hind": "RH"}
JOINTS = [f"/legged_robot/{place}/{leg}_{joint}" for place, leg in LEGS.items() for joint in ("HAA", "HFE", "KFE")]
WINDINGS = [f"{joint}/motor/winding_temperature" for joint in JOINTS]


@pytest.fixture
def robot(new_fake):
    signals = [scalar(f"/log{name}", "degC") for name in WINDINGS]
    signals += [scalar(f"/log{joint}/motor/housing_temperature", "degC") for joint in JOINTS]
    signals += [scalar(f"/log{joint}/joint/position_measured", "rad/[second]") for joint in JOINTS]
    signals += [scalar(f"/log{joint}/drive_status/communication_error_count") for joint in JOINTS]
    signals += [vector(f"/log/legged_robot/{place}/contact_force_estimated_in_world_frame", "N") for place in LEGS]
    return new_fake(signals)


def told(screen):
    """Return what stands in the column of names."""
    table = screen.app.screen.table
    rows = screen.text.splitlines()[2 : 2 + table.size.height]
    return [words for row in rows if (words := row[2 : 2 + table.laid.names].strip())]


@pytest.mark.parametrize("sets", [0, 1, 2])
@pytest.mark.parametrize("asked", ["", "winding", "joint|motor"])
async def test_each_row_of_the_table_says_which_it_is(robot, opened, sets, asked):
    async with opened(robot.run()) as screen:
        await screen.enter(f"/{asked}")
        await screen.do(*["columns"] * sets, shows="/legged_robot ")
        await screen.until(lambda: "LF_HAA" in screen.text, "the first rows")
        shown = told(screen)
        assert len(set(shown)) == len(shown) >= 12
        assert not [words for words in shown if "~" in words]
        joints = {name.split("/")[-3] for name in WINDINGS}
        assert asked == "" or all(any(joint in words for joint in joints) for words in shown)
        assert "rad/…" not in screen.text


async def test_a_tree_cuts_no_branch_without_a_sign(new_fake, opened):
    branch = "an_assembly_of_which_the_name_has_no_room"
    async with opened(new_fake([scalar(f"/log/{branch}_{side}/value") for side in ("left", "right")])) as screen:
        await screen.press("o", "n", shows="▼ an…the_name_has_no_room_left ")
        await screen.shows("▼ an…name_has_no_room_right ")


@pytest.mark.parametrize(("size", "left_out"), [((80, 24), ("std",)), ((120, 24), ())])
async def test_statistics_give_way_to_what_tells_names_apart_and_the_message_says_so(new_fake, opened, size, left_out):
    sides = [f"{one}_of_the_{other}_motor" for one in ("bottom", "middle") for other in ("primary", "secondary")]
    legs = [f"{leg}/{joint}" for leg in ("fore", "hind") for joint in ("knee", "ankle")]
    signals = [scalar(f"/log/{leg}/{side}/rate") for leg in legs for side in sides]
    async with opened(new_fake(signals).run(), size=size) as screen:
        await screen.do("columns", shows="columns: ")
        laid = screen.app.screen.table.laid
        assert laid.names >= laid.told.names.readable > 20
        assert laid.left_out == left_out
        assert ("; std at a wider terminal" in " ".join(screen.text.split())) == bool(left_out)


@pytest.mark.parametrize("sets", [0, 1, 2])
async def test_titles_are_whole_where_no_row_passes_the_filter(robot, opened, sets):
    async with opened(robot.run()) as screen:
        await screen.do(*["columns"] * sets, shows="unit")
        laid = screen.app.screen.table.laid
        await screen.enter("/edited", shows="No element passes")
        empty = screen.app.screen.table.laid
        assert (empty.names, empty.steady, empty.measured) == (laid.names, laid.steady, laid.measured)


async def test_folding_a_list_makes_it_a_tree_and_says_which_keys_bring_it_back(robot, opened):
    async with opened(robot.run()) as screen:
        await screen.press("down", "v", "f", shows="by name, as a tree; o l brings the list back")
        await screen.press("o", "l")
        await screen.until(lambda: "▼" not in screen.text, "the list")


async def test_alarms_and_triggers_say_of_which_motor_they_are(robot, opened):
    hot = replace(HOT, word=LimitWord.RED_HIGH, since_ns=time.time_ns())  # of 70 days more cells are told
    robot.limit_statuses = [replace(hot, name=f"/log{name}") for name in WINDINGS]
    robot.trigger_statuses = [
        TriggerStatus(new_trigger(f"winding_of_{name.split('/')[3]}_is_hot", f"{name} > 50"), TriggerWord.ARMED)
        for name in WINDINGS
    ]
    async with opened(robot.run()) as screen:
        await screen.do("alarms", shows=" /legged_robot ")
        for joint in ("LF_HAA", "RH_KFE"):
            await screen.shows(f"…/{joint}/…temperature ")
        await screen.do("back", "triggers")
        for joint in ("LF_HAA", "RH_KFE"):
            await screen.shows(f"{joint}/…wind… > 50 ")


@pytest.mark.parametrize(
    ("joint", "at_least", "at_most"), [("an_actuator_of_it_with_more_words", 8, 8), ("LF", 10, 11)]
)
async def test_names_are_whole_before_statistics_have_more_than_they_need(new_fake, opened, joint, at_least, at_most):
    """As far as half of the width goes."""
    names = [f"{leg}/{joint}/{name}" for leg in ("left", "right") for name in ("p", "v")]
    async with opened(new_fake([scalar(f"/log/{each}") for each in names]).run(), size=(160, 30)) as screen:
        await screen.shows(" mean")
        laid = screen.app.screen.table.laid
        cells = [given for each, given in laid.measured if each.title in STATISTICS]
        assert len(cells) == 4
        assert at_least <= min(cells) <= max(cells) <= at_most
        assert laid.names >= laid.told.names.longest or max(cells) == 8
