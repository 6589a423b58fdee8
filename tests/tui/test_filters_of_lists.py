"""A filter of a list looks in what is known of its lines, not in what the screen has room for."""

import pytest

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus, TriggerWord
from silo.core.conditions import TriggerOptions
from silo_tui.screens.lists.list_screen import ListScreen
from silo_tui.settings.options import Settings
from tests.stand_ins.fake_signals import scalar, vector

pytestmark = pytest.mark.slow  # each walks through the whole app

LONG = "left_front_hip_flexion_extension_motor_drive_temperature_overcurrent_guard"
OPTIONS = TriggerOptions(LONG, f"abs({LONG}) > 0.6 and controller/mode == SWING", 5, 1)
TRIGGER = TriggerStatus(OPTIONS, TriggerWord.ARMED)
LIMIT = LimitStatus(f"/log/legs/{LONG}", LONG, LimitWord.RED_HIGH, "degC", 84.2, 80.0, 86.3, count=1, alarm=True)


async def filtered(screen, words):
    await screen.until(lambda: isinstance(screen.app.screen, ListScreen) and screen.app.screen.all, "lines")
    await screen.press("/")
    await screen.enter(words)
    return screen.app.screen


async def test_a_filter_finds_what_the_screen_has_no_room_for(fake, opened):
    fake.trigger_statuses, fake.limit_statuses = [TRIGGER], [LIMIT]
    async with opened(fake, size=(60, 24)) as screen:
        for key, words in (
            ("T", "extension_motor mode"), ("A", "extension_motor"), ("f2", "key write_settings next time")
        ):  # fmt: skip
            await screen.press(key)
            assert len((await filtered(screen, words)).shown) == 1
            await screen.press("escape")


async def test_a_logger_is_found_by_the_middle_of_its_name(new_fake, opened):
    async with opened(new_fake(name=LONG), new_fake(name="arm"), size=(60, 24), ready=False) as screen:
        await screen.shows("arm")
        shown = await filtered(screen, "motor_drive")
        assert [one.address for one in shown.shown] == [LONG]


async def test_a_value_is_of_the_setting_that_it_was_begun_for_wherever_the_cursor_is(screen):
    await screen.do("f2", "j", "j", "j", "change_setting", "ctrl+u")
    await screen.type("2")
    screen.app.screen.lines.move(0)
    await screen.press("enter", shows="rate: 2")
    assert screen.app.context.settings == Settings(rate=2.0)


async def test_a_key_is_of_the_command_that_it_was_asked_for_wherever_the_cursor_is(screen):
    await screen.press("f2", "/")
    await screen.type("key filter")
    await screen.do("enter", "change_setting", shows="Press the key of filter (Filter)")
    screen.app.screen_stack[-2].filter_by("key")
    screen.app.screen_stack[-2].lines.move(0)
    await screen.press("f")
    assert screen.app.context.settings.keys == {"filter": "f"}


async def test_a_row_that_is_found_by_a_component_is_told_while_one_types(new_fake, opened):
    joints = vector("/log/joints/torque", "Nm", ("LF_KFE", "RF_KFE"))
    async with opened(new_fake([joints, scalar("/log/legs/LF/torque", "Nm")])) as screen:
        await screen.type("/LF torque", shows="1 by a component: /joints/torque")
        await screen.press("escape")
        await screen.type("/legs", shows="1 of 2")
        assert "by a component" not in screen.text


async def test_what_the_first_letter_does_to_the_filter_before_is_told_until_it_is_typed(screen):
    await screen.press("f2")
    await filtered(screen, "mouse")
    await screen.press("/", shows="Type anew, → adds to it")
    await screen.press("b")
    assert "Type anew" not in screen.text
    assert "Enter keeps the filter" in screen.text
