"""Triggers and alarms on the screen: how they stand, what is done with them, what a condition would have done."""

import pytest

from silo.ipc.conditions import LimitStatus, LimitWord, TriggerStatus, TriggerWord
from silo.model import TriggerOptions
from silo_tui.model.conditions import (
    fields_of,
    head_words,
    limit_row,
    options_of_fields,
    tried_lines,
    trigger_row,
)

NOW_NS = 1_790_000_100_000_000_000
FALL = TriggerStatus(
    TriggerOptions("fall", "abs(base/roll) > 0.6", 5.0, 1.0), TriggerWord.ARMED, 3, 3, 7, NOW_NS - 400_000_000
)
BLIND = TriggerStatus(TriggerOptions("low", "diff(battery/voltage) < -0.5"), TriggerWord.BLIND, why="/log/x is off")
HOT = LimitStatus(
    "/log/LF/HAA/torque", "/log/LF/HAA/torque", LimitWord.RED_HIGH, "Nm", 84.2, 80.0, 86.31, LimitWord.RED_HIGH,
    12, NOW_NS - 9 * 10**9, 10, NOW_NS - 12 * 10**9, NOW_NS, 2, alarm=True,
)  # fmt: skip


class TestWords:
    def test_a_trigger_is_a_line(self):
        row = trigger_row(FALL, 80, NOW_NS)
        assert row == "  ARMED      fall       abs(base/roll) > 0.6          5 s    1 s     3  0.4 s"
        assert "never" in trigger_row(BLIND, 80, NOW_NS)

    def test_an_alarm_is_a_line(self):
        row = limit_row(HOT, "/LF/HAA/torque", 80, NOW_NS)
        assert row.split() == ["HH", "/LF/HAA/torque", "84.2", "80", "86.31", "00:12", "2", "NEW"]
        assert len(row) <= 80

    def test_the_head_tells_the_worst_alarm_and_how_many_triggers_watch(self):
        assert head_words([FALL, BLIND], [HOT]) == ("HH 1", True, "T 1")
        assert head_words([], []) == ("", False, "")

    def test_the_editor_gives_back_the_trigger_that_it_shows(self):
        options = TriggerOptions("a", "x > 3", 5.0, 0.05, "falling", "x < 1", 0.02, 10.0, "single", keep=20)
        assert options_of_fields(fields_of(options), options) == options

    @pytest.mark.parametrize(
        ("field", "typed", "says"),
        [("pre", "soon", "pre"), ("keep", "-", "keep"), ("save", "xls", "xls"), ("name", " ", "name it")],
    )
    def test_what_makes_no_sense_is_said(self, field, typed, says):
        with pytest.raises((ValueError, Exception), match=says):
            options_of_fields({**fields_of(FALL.options), field: typed}, FALL.options)

    def test_a_test_shows_where_it_would_have_fired(self, fake):
        first, places, size = tried_lines(fake.try_trigger(FALL.options), 60, 20)
        assert first == "would have fired 3 × in the last 60 s (all that is held)"
        assert places.count("│") == 3
        assert size.startswith("each capture about")


slow = pytest.mark.slow  # each walks through the whole app


@slow
class TestScreens:
    async def test_triggers_are_listed_armed_and_forced(self, fake, opened):
        fake.trigger_statuses = [FALL, BLIND]
        async with opened(fake) as screen:
            await screen.shows("T 1")
            await screen.press("T")
            await screen.shows("abs(base/roll) > 0.6")
            await screen.press("t")
            await screen.until(lambda: ("arm_trigger", "fall", False) in fake.calls)
            await screen.shows("trigger 'fall' is off")
            await screen.until(lambda: screen.app.screen is screen.app.context.upper_screen, "the end of it")
            await screen.press("j")
            await screen.shows("low is blind: /log/x is off; switch it on in the table")
            await screen.press("!")
            await screen.shows("trigger 'low' was fired")
            assert ("force_trigger", "low") in fake.calls
            await screen.press("escape")
            await screen.until(lambda: screen.app.screen.scope == "table")

    async def test_a_trigger_is_removed_after_a_question_only(self, fake, opened):
        fake.trigger_statuses = [FALL]
        async with opened(fake) as screen:
            await screen.press("T")
            await screen.shows("abs(base/roll) > 0.6")
            await screen.press("x")
            await screen.shows("Remove trigger fall?")
            await screen.press("enter")
            await screen.until(lambda: not screen.app.screen.is_modal)
            assert fake.trigger_statuses == [FALL]
            await screen.press("x")
            await screen.shows("Remove trigger fall?")
            await screen.press("y")
            await screen.shows("trigger 'fall' is removed")
            assert fake.trigger_statuses == []

    async def test_a_trigger_is_made_tried_and_set(self, fake, opened):
        async with opened(fake) as screen:
            await screen.press("T")
            await screen.shows("No triggers. N makes one")
            await screen.press("N")
            await screen.shows("the condition: signals")
            await screen.type("x > 3")
            await screen.shows("name it")
            await screen.press("shift+tab", "shift+tab")
            await screen.type("high")
            await screen.shows("would have fired 3 ×")
            await screen.press("enter")
            await screen.until(lambda: fake.trigger_statuses)
            await screen.shows("ARMED")
            assert fake.trigger_statuses[0].options.when == "x > 3"

    async def test_a_mistake_in_a_condition_is_said_and_nothing_set(self, fake, opened):
        async with opened(fake) as screen:
            await screen.press("T", "N")
            await screen.shows("the condition: signals")
            await screen.type("nobody > 3")
            await screen.press("shift+tab", "shift+tab")
            await screen.type("high")
            await screen.shows("no signal is named 'nobody'")
            await screen.press("escape")
            assert fake.trigger_statuses == []

    async def test_alarms_are_listed_and_acknowledged(self, fake, opened):
        fake.limit_statuses = [HOT, LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0)]
        async with opened(fake) as screen:
            await screen.shows("HH 1")
            await screen.press("A")
            await screen.shows("86.31")
            assert "1 now │ 2 limits" in screen.text
            await screen.press("K")
            await screen.until(lambda: ("acknowledge", "/log/LF/HAA/torque") in fake.calls)
            await screen.press("T")
            await screen.shows("No triggers")

    async def test_without_an_alarm_it_says_so(self, fake, opened):
        fake.limit_statuses = [LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0)]
        async with opened(fake) as screen:
            await screen.press("A")
            await screen.shows("Nothing over its limits. 1 watched, 0 blind")

    async def test_an_element_beyond_its_limits_has_the_sign_in_the_table(self, fake, opened):
        name = fake.elements[0].name + fake.elements[0].entries[0].suffix
        fake.limit_statuses = [LimitStatus(name, name, LimitWord.RED_HIGH, value=9.0, count=1)]
        async with opened(fake, size=(120, 24)) as screen:
            await screen.until(lambda: screen.session.beyond == {fake.elements[0].name: "HH"})
            await screen.shows("HH 1")

    async def test_a_plot_makes_a_trigger_at_its_level(self, fake, opened):
        async with opened(fake) as screen:
            await screen.press("m")
            await screen.until(lambda: screen.app.screen.scope == "monitor")
            await screen.press("N")
            await screen.shows("New trigger on robot")
            await screen.press("enter")
            await screen.until(lambda: fake.trigger_statuses)
            assert " > " in fake.trigger_statuses[0].options.when
