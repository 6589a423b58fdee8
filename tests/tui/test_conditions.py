"""Triggers and alarms on the screen: how they stand, what is done with them, what a condition would have done."""

import asyncio
import re

import numpy as np
import pytest
from msgspec.structs import replace

from silo.conditions.standing import CapturedSpan, LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import SignalLimits, TriggerOptions, TriggerWord, new_trigger
from silo.core.elements import BufferType, Entry, FileType, Table
from silo.errors import ConnectionLostError, ElementError, RefusedError
from silo.expressions.binding import bind
from silo.judging.checks import table_catalogue
from silo_tui.model.lists.conditions import (
    alarms_words,
    beyond_all,
    capture_words,
    fields_of,
    head_words,
    lasted_width,
    limit_head,
    limit_row,
    named_in,
    options_of_fields,
    signal_width,
    slow_words,
    tried_lines,
    trigger_row,
    waits_for,
)
from silo_tui.model.plots.limit_fields import fields_of as fields_of_limits
from silo_tui.model.plots.limit_fields import limits_of_fields
from silo_tui.screens.dialogs.limits import LimitsDialog
from tests.stand_ins.desk import Desk

NOW_NS = 1_790_000_100_000_000_000
FALL = TriggerStatus(
    TriggerOptions("fall", "abs(base/roll) > 0.6", 5.0, 1.0), TriggerWord.ARMED, 3, 3, 7, NOW_NS - 400_000_000
)
BLIND = TriggerStatus(TriggerOptions("low", "diff(battery/voltage) < -0.5"), TriggerWord.BLIND, why="/log/x is off")
HOT = LimitStatus(
    "/log/LF/HAA/torque", "/log/LF/HAA/torque", LimitWord.RED_HIGH, "Nm", 84.2, 80.0, 86.31, LimitWord.RED_HIGH,
    12, NOW_NS - 9 * 10**9, 10, NOW_NS - 12 * 10**9, NOW_NS, 2, alarm=True,
)  # fmt: skip
GIVEN = SignalLimits(
    "/log/legs/LF/HAA/torque",
    bounds=(None, None, 60.0, 80.0),
    persistence=3,
    hysteresis=1.0,
    stale_s=0.5,
    when="imu/temperature > 1",
)

JOINTS = ("HAA", "HFE", "KFE")


@pytest.mark.parametrize(
    ("dtype", "low", "high", "when"),
    [("<f8", -2.0, 3.0, "x > 3.6"), ("<f8", 48.9, 49.4871, "x > 49.55"), ("<f4", 5.0, 5.0, "x > 5.6"),
     ("<f8", 0.0, 0.0, "x > 0.2"), ("<i8", 0, 121000, "x > 140000"), ("<f8", 0.001, 0.0011, "x > 0.00112"),
     ("|b1", 0, 0, "x"), ("|b1", 1, 1, "not x"), ("|b1", 0, 1, ""), ("<f8", -1.0, np.inf, ""),
     ("<f8", 1e15, 1e15 + 3, "x > 1000000000000003.2"), ("<f8", 1.7e308, 1.7e308, ""), ("<f8", 0.0, 5e-324, "")],
)  # fmt: skip
def test_a_new_trigger_lies_beyond_all_that_was(dtype, low, high, when):
    assert beyond_all("x", Entry("", dtype), low, high) == when
    assert beyond_all("x", Entry("", "<i8", {0: "STAND"}), low, high) == ""


class TestWords:
    def test_a_trigger_is_a_line(self):
        row = trigger_row(FALL, 80, f"{'fall':<10}", FALL.options.when, NOW_NS)
        assert row == "  ARMED      fall       abs(base/roll) > 0.6          5 s    1 s     3  0.4 s"
        assert "never" in trigger_row(BLIND, 80, " " * 10, "", NOW_NS)

    def test_an_alarm_is_a_line(self):
        row = limit_row(HOT, "/LF/HAA/torque", signal_width(["/LF/HAA/torque" * 9], 80), NOW_NS)
        assert row.split() == ["HH", "/LF/HAA/torque", "84.200", "80.000", "86.310", "12", "s", "2", "NEW"]
        assert len(row) <= 80

    def test_of_an_alarm_that_ended_it_is_told_how_long_it_was_and_columns_stay(self):
        ended = replace(HOT, word=LimitWord.OK, since_ns=NOW_NS, last_ns=NOW_NS + 140_000_000)
        wide = lasted_width([HOT, ended], NOW_NS)
        over, row = (limit_row(one, "/x", 20, NOW_NS, wide) for one in (HOT, ended))
        assert " 140 ms " in row
        assert " last for " in limit_head(20, "", wide)  # a time that it lasted, no moment since which it is
        assert row.index("NEW") == over.index("NEW") == limit_head(20, "", wide).index("seen by")
        assert lasted_width([HOT], NOW_NS) == len("last for")

    @pytest.mark.parametrize(
        ("word", "value", "more", "state", "bound"),
        [
            (LimitWord.YELLOW_HIGH, 4.2, {}, "H", 4.0),
            (LimitWord.YELLOW_HIGH, 3.9, {}, "H back", 4.0),
            (LimitWord.RED_HIGH, 5.9, {}, "HH back", 6.0),
            (LimitWord.OK, 3.0, {"alarm": True}, "was HH", 6.0),
            (LimitWord.OK, 3.0, {}, "OK", 6.0),
        ],
    )
    def test_an_alarm_shows_the_bound_that_its_state_is_about_and_whether_its_value_is_back(
        self, word, value, more, state, bound
    ):
        one = LimitStatus(
            "/x", "/x", word, "", value, 6.0, 6.5, LimitWord.RED_HIGH, bounds=(None, None, 4.0, 6.0), count=1, **more
        )
        row = limit_row(one, "/x", 20, NOW_NS)
        assert row[2:].partition("/x")[0].rstrip() == state
        assert [float(each) for each in row.partition("/x")[2].split()[:2]] == [value, bound]

    def test_what_is_within_its_limits_shows_the_bound_it_is_nearest_to(self):
        well = LimitStatus("/x", "/x", LimitWord.OK, value=38.0, bounds=(None, 1.0, None, 40.0))
        assert limit_row(well, "/x", 20, NOW_NS).split() == ["OK", "/x", "38.0000", "40.0000"]
        assert limit_row(replace(well, value=3.0), "/x", 20, NOW_NS).split() == ["OK", "/x", "3.0000", "1.0000"]
        assert limit_row(replace(well, value=None), "/x", 20, NOW_NS).split() == ["OK", "/x", "40.0000"]
        stale = LimitStatus("/x", "/x", LimitWord.OK, value=3.0, stale_s=0.5)
        assert limit_row(stale, "/x", 20, NOW_NS).split() == ["OK", "/x", "3.0000", "500", "ms"]

    def test_who_saw_an_alarm_has_the_cells_that_names_spare(self):
        assert signal_width(["/LF/HAA/torque", "/x"], 160) == len("/LF/HAA/torque")
        assert signal_width(["/LF/HAA/torque" * 9], 160) == 160 - 52 - len("HH back")
        assert signal_width([], 80) == 14

    @pytest.mark.parametrize(
        ("alarm", "seen_by", "since", "told"),
        [
            (True, "", 0, "NEW"), (True, "ann@pc", 2, "2 NEW"), (False, "ann@pc", 0, "ann"), (False, "", 0, "2"),
            (True, "ann@pc", 0, "NEW"),  # the violation that was seen became a worse one
        ],
    )  # fmt: skip
    def test_an_alarm_is_new_until_somebody_has_seen_it_as_it_is(self, alarm, seen_by, since, told):
        row = limit_row(replace(HOT, alarm=alarm, seen_by=seen_by, since_seen=since), "/x", 20, NOW_NS)
        assert row.split()[-len(told.split()) :] == told.split()

    def test_the_head_tells_the_worst_alarm_and_how_many_triggers_watch(self):
        assert head_words([FALL, BLIND], [HOT]) == (
            ("1 alarm (HH)", "HH 1"), True, ("1 trigger armed", "1 armed"),
        )  # fmt: skip
        seen = replace(HOT, alarm=False, seen_by="ann")
        assert head_words([], [seen])[0] == ("1 alarm (HH) seen", "1 alarm (HH)", "HH 1")
        assert head_words([], [HOT, seen, seen])[0] == ("3 alarms (HH)", "HH 3")
        over = replace(HOT, word=LimitWord.OK)
        ended = ("1 alarm ended unseen", "1 alarm ended")
        assert head_words([], [over, replace(over, alarm=False)]) == (ended, False, ())
        assert head_words([], [over, seen])[0] == (
            "1 alarm (HH) seen, 1 ended unseen", "1 alarm (HH), 1 ended", "1 alarm (HH)", "HH 1",
        )  # fmt: skip
        assert head_words([], []) == ((), False, ())
        assert head_words([BLIND], []) == ((), False, ())  # none is armed: nothing to tell
        assert head_words([replace(FALL, state=TriggerWord.FIRING)], [])[2][0] == "trigger fall fires"

    def test_a_new_trigger_keeps_its_newest_captures(self):
        new = new_trigger()
        assert (fields_of(new)["pre"], fields_of(new)["keep"]) == ("1 s", "100")
        assert options_of_fields({**fields_of(new), "name": "a"}, new).keep == 100

    def test_the_editor_gives_back_the_trigger_that_it_shows(self):
        options = TriggerOptions("a", "x > 3", 5.0, 0.05, "falling", "x < 1", 0.02, 10.0, "single", keep=20)
        assert options_of_fields(fields_of(options), options) == options

    @pytest.mark.parametrize(
        "options",
        [
            TriggerOptions("a", "x", save=()),
            TriggerOptions("a", "x", save=(FileType.BAG, FileType.CSV)),
            TriggerOptions("a", "x", mode="auto", patience_s=0.5, armed=False),
            TriggerOptions("a", "x", 1 / 3, 123.456789),
        ],
    )
    def test_what_lines_of_a_trigger_do_not_say_stays(self, options):
        assert options_of_fields({**fields_of(options), "when": " y "}, options) == replace(options, when="y")

    @pytest.mark.parametrize(
        ("typed", "save"), [("none", ()), ("", (FileType.SILO,)), ("csv, bag", tuple(FileType)[1:])]
    )
    def test_files_of_a_capture_are_typed(self, typed, save):
        assert options_of_fields({**fields_of(FALL.options), "save": typed}, FALL.options).save == save

    @pytest.mark.parametrize(
        "limits",
        [
            SignalLimits("x", bounds=(-40.0, None, 30.25, 1e6)),
            SignalLimits(
                "x",
                bounds=(None, None, 1.0, 2.0),
                persistence=3,
                hysteresis=0.5,
                stale_s=0.5,
                when="mode == STANCE and y = 3 stale=1s",
            ),
            SignalLimits("x", stale_s=2.0),
            SignalLimits("x", bounds=(-1 / 3, None, None, 1234567890123.0), hysteresis=0.1 + 0.2),
        ],
    )
    def test_lines_of_limits_give_back_the_limits_that_they_show(self, limits):
        assert limits_of_fields(fields_of_limits(limits), SignalLimits("x")) == limits

    def test_limits_of_which_all_is_shown_lose_what_is_emptied(self):
        before = SignalLimits(
            "x", bounds=(None, None, 1.0, 2.0), persistence=3, hysteresis=0.5, stale_s=0.5, when="y > 1"
        )
        made = limits_of_fields({"HH": "2", "hyst": "0"}, before, whole=True)
        assert made == SignalLimits("x", bounds=(None, None, None, 2.0))

    @pytest.mark.parametrize(
        ("fields", "hysteresis"),
        [
            ({"HH": "2"}, 0.04), ({"H": "2", "HH": "5"}, 0.04), ({"LL": "-9", "L": "-1", "H": "2"}, 0.06),
            ({"L": "-3"}, 0.06), ({"HH": "2", "hyst": "0"}, 0.0), ({"HH": "2", "hyst": "0.5"}, 0.5),
            ({"H": "0"}, 0.0), ({"stale": "1s"}, 0.0),
        ],
    )  # fmt: skip
    def test_of_limits_that_say_nothing_of_it_an_alarm_ends_so_far_inside_that_noise_is_one(self, fields, hysteresis):
        assert limits_of_fields(fields, SignalLimits("x")).hysteresis == hysteresis
        assert limits_of_fields(fields, SignalLimits("x", hysteresis=1.0), whole=True).hysteresis == hysteresis

    def test_what_lines_of_limits_do_not_say_stays(self):
        before = SignalLimits(
            "x", bounds=(None, None, 1.0, 2.0), persistence=3, hysteresis=0.5, stale_s=0.5, when="y > 1"
        )
        made = limits_of_fields({"L": "-", "H": "3", "HH": "4", "persist": "5", "stale": "1s"}, before)
        assert made == SignalLimits(
            "x", bounds=(None, None, 3.0, 4.0), persistence=5, hysteresis=0.5, stale_s=1.0, when="y > 1"
        )

    @pytest.mark.parametrize(
        ("label", "typed", "says"),
        [("HH", "four", "HH is red high, a number; got 'four'"), ("persist", "3.0", "a whole number; got '3.0'"),
         ("hyst", "some", "hyst is how far inside"), ("stale", "soon", "stale must be a time")],
    )  # fmt: skip
    def test_a_line_that_makes_no_limits_says_what_it_is(self, label, typed, says):
        with pytest.raises((ElementError, ValueError), match=says):
            limits_of_fields({label: typed}, SignalLimits("x"))

    @pytest.mark.parametrize(
        ("field", "typed", "says"),
        [("pre", "soon", "pre"), ("keep", "-", "keep"), ("save", "xls", "xls"), ("name", " ", "name it"),
         ("mode", "normal upwards", "mode is normal or"), ("mode", "rising falling", "mode is normal or")],
    )  # fmt: skip
    def test_what_makes_no_sense_is_said(self, field, typed, says):
        with pytest.raises((ValueError, Exception), match=says):
            options_of_fields({**fields_of(FALL.options), field: typed}, FALL.options)

    @pytest.mark.parametrize(
        ("word", "value", "persistence", "hysteresis", "says"),
        [
            ("HH", 20.5, 9, 1, ""),
            ("HH", 15.0, 9, 0, "less far beyond now: the alarm ends after 9 samples in a row"),
            ("HH", 3.0, 9, 0, "within its limits now: the alarm ends after 9 samples in a row"),
            ("H", 9.5, 1, 1, "within its limits now: the alarm ends 1 inside of them"),
            ("HH", 18.0, 4, 2, "less far beyond now: the alarm ends 2 inside of them after 4 samples in a row"),
            ("LL", -25.0, 9, 0, ""),
            ("LL", 12.0, 9, 0, "beyond its limits now: an alarm after 9 samples in a row"),
            ("L", -10.0, 2, 0, "within its limits now: the alarm ends after 2 samples in a row"),
            ("OK", -20.5, 9, 0, "beyond its limits now: an alarm after 9 samples in a row"),
            ("OK", 10.0, 9, 0, ""),
            ("OK", None, 9, 0, ""),
            ("==", 30.0, 9, 0, ""),
            ("HH", 3.0, 1, 0, ""),
        ],
    )
    def test_an_alarm_that_waits_for_samples_says_for_which(self, word, value, persistence, hysteresis, says):
        bounds = (-20.0, -10.0, 10.0, 20.0)
        one = LimitStatus("/x", "/x", LimitWord(word), value=value, bounds=bounds, persistence=persistence)
        assert waits_for(replace(one, hysteresis=hysteresis)) == says

    @pytest.mark.parametrize(
        ("alarms", "says"), [(1, "1 was over, not seen since │ 1 limit"), (2, "2 were over, not seen since │ 2 limits")]
    )
    def test_alarms_that_are_over_and_that_nobody_has_seen_are_counted(self, alarms, says):
        over = LimitStatus("/log/y", "/log/y", LimitWord.OK, alarm=True)
        assert alarms_words([over] * alarms) == f"0 over limits now, {says}"

    def test_a_test_shows_where_it_would_have_fired(self, fake):
        tried = fake.try_trigger(FALL.options)
        first, places = tried_lines(tried, 60)
        assert first == "would have fired 3 × in the 60 s that are held"
        assert places.count("│") == 3
        size = capture_words(tried, FALL.options)
        assert size.startswith("each capture about")
        assert "join" not in size

    def test_a_test_says_that_fires_close_together_are_one_capture(self, fake):
        tried = fake.try_trigger(FALL.options)
        told = replace(tried, time_ns=[10**9, 3 * 10**9])
        assert "; fires within 2 s (post) of each other join" in capture_words(told, replace(FALL.options, post_s=2.0))
        assert "join" not in capture_words(told, replace(FALL.options, post_s=1.9))

    @pytest.mark.parametrize(
        ("pre_s", "post_s", "words"),
        [(2.0, 1.0, "pre of 2 s lasts 2.7 s"), (0.0, 1.0, "post of 1 s lasts 1.4 s"), (0.0, 0.0, "")],
    )
    def test_of_a_slow_loop_it_is_told_how_much_longer_a_capture_gets(self, pre_s, post_s, words):
        said = slow_words(replace(FALL.options, pre_s=pre_s, post_s=post_s), 295.0, 400.0)
        assert said.endswith(words)
        assert bool(said) == bool(words)
        assert not said or "295 of 400 Hz" in said

    @pytest.mark.parametrize(
        ("held", "blind", "says"),
        [(6000, 0, "beyond all the time"), (5000, 1000, "beyond all the time; 17 % of it can't be judged"),
         (5999, 0, "beyond for 99.9 %"), (60, 0, "beyond for 1 %"), (1, 0, "beyond for 0.0167 %")],
    )  # fmt: skip
    def test_a_test_tells_of_what_holds_without_ever_turning_true(self, fake, held, blind, says):
        tried = replace(fake.try_trigger(FALL.options), fires=0, held=held, blind=blind)
        said, _, blind_words = says.partition("; ")
        for lasts, counted in (("", "would have been violated 0 ×"), ("one violation", "one violation")):
            first = tried_lines(tried, 60, "would have been violated", "beyond", lasts=lasts)[0]
            told = f"{said} in the 60 s that are held, from its begin on: {counted}"
            assert first == told + (f"; {blind_words}" if blind_words else "")


async def done(screen):
    """Waits until what was asked for is done: meanwhile its dialog owns the keys."""
    await screen.until(lambda: not screen.app.screen.is_modal, "the end of what was asked for")


slow = pytest.mark.slow  # each walks through the whole app


@slow
class TestScreens:
    async def test_triggers_are_listed_armed_and_forced_and_removed_after_a_question_only(self, fake, opened):
        fake.trigger_statuses = [FALL, BLIND]
        async with opened(fake) as screen:
            await screen.shows("1 trigger armed")
            await screen.press("T", shows="abs(base/roll) > 0.6")
            await screen.press("t")
            await screen.until(lambda: ("arm_trigger", "fall", False) in fake.calls)
            await screen.shows("trigger 'fall' is off")
            await done(screen)
            await screen.press("j", shows="low is blind: /log/x is off; switch it on in the table")
            await screen.press("!", shows="trigger 'low' was fired")
            assert ("force_trigger", "low") in fake.calls
            await done(screen)
            await screen.press("k", "x", shows="Delete trigger fall of robot?")
            await screen.press("enter")
            await screen.until(lambda: not screen.app.screen.is_modal)
            assert len(fake.trigger_statuses) == 2
            await screen.press("x", shows="Delete trigger fall of robot?")
            await screen.press("y", shows="trigger 'fall' is removed")
            assert [one.options.name for one in fake.trigger_statuses] == ["low"]
            await done(screen)
            await screen.press("escape", at="table")

    async def test_a_trigger_is_made_tried_and_set(self, fake, screen):
        await screen.press("T", shows="No triggers. N makes one")
        await screen.press("N", shows="the condition: signals")
        await screen.press("tab")  # as one reads it
        await screen.type("x > 3", shows="name it")
        await screen.press("shift+tab")
        await screen.type("high", shows="would have fired 3 ×")
        await screen.press("enter")
        await screen.until(lambda: fake.trigger_statuses)
        await screen.shows("ARMED")
        assert fake.trigger_statuses[0].options.when == "x > 3"

    @pytest.mark.parametrize("when", ["", "x > 3"])
    async def test_a_name_that_no_file_can_have_is_told_before_enter(self, when, screen):
        await screen.press("T", "N", shows="the condition: signals")
        form = screen.app.screen
        form.field("when").value = when
        form.field("name").value = "legs/high"
        await screen.shows("names of files: 'legs/high' can't be")
        await screen.press("tab")
        form.field("name").value = "high"
        await screen.shows("would have fired 3 ×" if when else "the condition: signals")

    async def test_what_buffers_are_too_short_for_is_told_before_enter(self, screen, size=(160, 50)):
        await screen.press("T", "N", shows="the condition: signals")
        screen.app.screen.field("when").value = "x > 3"
        await screen.shows("would have fired 3 ×")
        assert "refused" not in screen.text
        screen.app.screen.field("pre").value = "3600 s"
        await screen.shows("Enter is refused: too short for pre of 3600 s")

    async def test_a_new_trigger_begins_with_a_pre_that_the_buffers_hold_and_says_so(self, fake, opened):
        short = fake.elements[0]
        fake.elements[0] = replace(
            short, options=replace(short.options, buffer=BufferType.LOOPING, divider=5, size=100)
        )
        async with opened(fake, size=(160, 50)) as screen:
            await screen.press("T", "N")
            told = "pre is 225 ms, not 1 s: all that the buffers hold"
            await screen.shows(told)
            assert screen.app.screen.field("pre").value == "225 ms"
            screen.app.screen.field("when").value = "x > 3"
            await screen.shows("would have fired 3 ×")
            assert told in screen.text
            assert "refused" not in screen.text
            screen.app.screen.field("pre").value = "1 s"
            await screen.shows("Enter is refused: too short for pre of 1 s (all hold pre=0.225s)")
            assert told not in screen.text

    async def test_the_cursor_is_on_a_trigger_that_was_just_made(self, fake, opened):
        fake.trigger_statuses = [
            TriggerStatus(TriggerOptions(name, "x > 1", 1, 1), TriggerWord.ARMED) for name in ("slip", "tilt")
        ]
        async with opened(fake.run(20)) as screen:
            await screen.press("T", shows="slip")
            await screen.press("N")
            await screen.type("high")
            await screen.press("tab")
            await screen.type("x > 3")
            await screen.press("enter")
            await screen.until(lambda: getattr(screen.app.screen, "chosen_key", "") == "high")
            await screen.press("escape")
            await screen.do("plot", "plot_trigger", shows="New trigger")  # its form, from a plot
            await screen.press("enter")
            await screen.until(lambda: len(fake.trigger_statuses) == 4, "the trigger")
            await done(screen)
            await screen.do("triggers", at="triggers")
            await screen.until(lambda: screen.app.screen.chosen_key == fake.trigger_statuses[-1].options.name)

    async def test_in_live_plots_too_a_trigger_begins_at_the_level_under_the_cursor_or_at_that_which_was_looked_for(
        self, screen, ran_s=20
    ):
        await screen.enter(":goto LF/HAA/torque")
        await screen.do("monitor")
        await screen.shows("live")
        await screen.do(*["cursor_left"] * 4, "plot_trigger")
        await screen.shows("New trigger")
        await screen.shows("PAUSED")  # as what is found: the cursor's moment would move on
        line = next(line for line in screen.text.splitlines() if "when" in line)
        level = float(re.search(r"torque > (\S+)", line)[1])
        plots = screen.app.context.upper_screen
        shown = (await plots.readings_here())["/log/legs/LF/HAA/torque"].newest[0]
        assert level == pytest.approx(shown, rel=1e-4)
        await screen.press("escape")
        await screen.do("pause")
        await screen.shows("live")
        await screen.press("f", *"<2", "enter")
        await screen.shows("falls below 2, ")
        await screen.do("plot_trigger")
        await screen.shows("legs/LF/HAA/torque < 2 ")
        await screen.press("escape")
        await screen.do("cursor_left", "cursor_left", "plot_trigger")  # elsewhere it is that of the cursor
        await screen.shows("New trigger")
        assert "torque < 2 " not in screen.text

    async def test_they_are_asked_for_again_where_no_answer_came(self, fake, opened, monkeypatch):
        fake.limit_statuses = [HOT]
        asked, alarms = [], fake.alarms

        def lost_once():
            asked.append(1)
            if len(asked) == 1:
                raise ConnectionLostError("no answer from robot")
            return alarms()

        monkeypatch.setattr(fake, "alarms", lost_once)
        async with opened(fake.run()) as screen:
            await screen.shows("1 alarm (HH)")
            assert len(asked) == 2
            assert not screen.app.screen.session.conditions_due

    async def test_alarms_are_listed_and_acknowledged_and_their_limits_deleted_after_a_question(self, fake, opened):
        fake.limit_statuses = [HOT, LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0)]
        async with opened(fake) as screen:
            await screen.shows("1 alarm (HH)")
            await screen.press("A", shows="86.31")
            assert "1 over limits now │ 2 limits" in screen.text
            assert "> HH" in screen.text  # where the cursor is reaches also who sees no colours
            await screen.press("K")
            await screen.until(lambda: ("acknowledge", "/log/LF/HAA/torque") in fake.calls)
            await screen.shows("LF/HAA/torque: 1 alarm seen by ann")
            await done(screen)
            await screen.press("x", shows="Delete limits of /LF/HAA/torque on robot?")
            await screen.press("y")
            await screen.until(lambda: ("remove_limits", HOT.limits) in fake.calls)
            await done(screen)
            await screen.press("T", shows="No triggers")

    async def test_a_form_tells_what_the_field_means_that_has_the_keys_and_what_limits_without_a_bound_do(
        self, fake, opened
    ):
        async with opened(fake) as screen:
            await screen.press("A", "N")
            await screen.shows("signal: a name as the table shows it")
            await screen.press("tab")
            await screen.shows("LL: red below this")
            here = [
                str(label.id) for label in screen.app.screen.query(".form-label") if label.styles.text_style.reverse
            ]
            assert here == ["label-LL"]  # who types sees where, whatever the colours
            await screen.press("up")
            await screen.shows("signal: a name as the table shows it")
            await screen.press("down")
            await screen.shows("LL: red below this")
            await screen.press("escape", "N")
            await screen.shows("Limits of a signal")
            await screen.type("legs/LF/HAA/torque")
            await screen.press(*["tab"] * 7)
            await screen.type("1s")
            await screen.shows("no bound: it is an alarm where it stays the same for so long")

    async def test_more_marked_alarms_than_plots_are_told(self, fake, opened):
        names = [info.name + info.entries[0].suffix for info in fake.elements[:9]]
        fake.limit_statuses = [LimitStatus(name, name, LimitWord.RED_HIGH, value=9.0, count=1) for name in names]
        async with opened(fake) as screen:
            await screen.press("A", shows="/legs/LF/contact")
            await screen.press("*", shows="9 marked │ :unmark unmarks")
            await screen.do("plot_conditions", shows="the first 6 of 9 signals: mark others")

    async def test_an_alarm_of_what_is_no_signal_of_the_table_is_not_plotted(self, fake, opened):
        fake.limit_statuses = [LimitStatus("/log/gone", "/log/gone", LimitWord.RED_HIGH, value=9.0, count=1)]
        async with opened(fake) as screen:
            await screen.press("A", shows="/gone")
            await screen.do("plot_conditions")
            await screen.shows("nothing of it can be plotted: it is no signal of the table")

    async def test_the_field_that_has_the_keys_has_them_from_the_first_picture_on(self, fake, opened, monkeypatch):
        had, focus = [], LimitsDialog.on_descendant_focus
        monkeypatch.setattr(
            LimitsDialog, "on_descendant_focus", lambda form, event: (had.append(event.widget.id), focus(form, event))
        )
        fake.limit_statuses = [HOT]
        async with opened(fake) as screen:
            await screen.press("A", shows="86.31")
            await screen.press("e")
            await screen.until(lambda: isinstance(screen.app.screen, LimitsDialog), "the form")
            await screen.press("tab", "tab", "7")
            assert screen.app.screen.fields["H"] == "7"
            assert had == ["form-LL", "form-L", "form-H"]

    async def test_limits_are_edited_from_what_they_are_and_keep_it(self, fake, opened):
        given = GIVEN
        fake.limit_statuses = [replace(HOT, name=given.name, limits=given.name).given(given)]
        async with opened(fake) as screen:
            await screen.press("A", shows="86.31")
            await screen.press("e", shows="Limits of /legs/LF/HAA/torque")
            assert screen.app.screen.fields == {
                "signal": "legs/LF/HAA/torque", "LL": "", "L": "", "H": "60", "HH": "80", "persist": "3",
                "hyst": "1", "stale": "0.5s", "when": "imu/temperature > 1",
            }  # fmt: skip
            await screen.shows("would have been violated")
            await screen.press("enter")
            await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
        assert next(call for call in fake.calls if call[0] == "set_limits")[1] == given

    async def test_who_went_to_the_worst_of_an_alarm_comes_back_by_one_escape(self, fake, opened):
        fake.run(20)
        torque, worst_ns = "/log/legs/LF/HAA/torque", fake.now_ns - 3 * 10**9
        fake.limit_statuses = [replace(HOT, name=torque, limits=torque, worst_ns=worst_ns)]
        async with opened(fake) as screen:
            await screen.do("alarms", "alarm_worst")
            for _ in range(2):
                await screen.until(lambda: getattr(screen.app.screen, "scope", "") == "monitor", "plots")
                await screen.until(lambda: screen.app.screen.window.at_ns == worst_ns, "the worst")
                await screen.press("escape", at="alarms")
                await screen.do("alarm_worst")
            await screen.until(lambda: getattr(screen.app.screen, "scope", "") == "monitor", "plots")
            await screen.until(lambda: screen.app.screen.window.at_ns == worst_ns, "the worst")
            await screen.do("pause")  # what goes on was not entered so
            await screen.until(lambda: not screen.app.screen.window.paused)
            await screen.do("pause")
            await screen.press("escape")
            await screen.until(lambda: not screen.app.screen.window.paused)
            assert screen.app.screen.scope == "monitor"

    async def test_limits_of_a_name_that_is_typed_keep_what_is_not_named(self, fake, opened):
        given = replace(GIVEN, name="/log/LF/HAA/torque")
        fake.limit_statuses = [HOT.given(given)]
        async with opened(fake) as screen:
            await screen.press("A", shows="86.31")
            await screen.press("N", shows="Limits of a signal")
            await screen.type("LF/HAA/torque")
            for word in ("tab", "tab", "tab", *"50", "tab", *"7o", "enter"):
                await screen.press(word)
            await screen.shows("HH is red high, a number")
            await screen.press("backspace", "0", "enter")
            await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
        wanted = replace(given, bounds=(None, None, 50.0, 70.0))
        assert next(call for call in fake.calls if call[0] == "set_limits")[1] == wanted

    async def test_limits_of_what_is_marked_are_of_all_of_it_by_the_pattern_that_means_it(self, fake, opened):
        async with opened(fake.run(20), size=(120, 40)) as screen:
            await screen.enter("/torque")
            await screen.press("asterisk", shows="12 marked")
            screen.app.screen.action_command("limits_of_row")
            await screen.shows("Limits of /legs/*/*/torque on")
            assert screen.app.screen.fields["signal"] == "legs/*/*/torque"
            screen.app.screen.field("HH").value = "60"
            await screen.shows("any of 12 signals: would have been violated")
            await screen.shows("an alarm ends 1.2 inside its bound: 2% of the range")
            screen.app.screen.field("signal").value = "legs/LF/*/torque"
            await screen.shows("Limits of legs/LF/*/torque on")
            await screen.shows("any of 3 signals: would have been violated")
            await screen.press("enter")
            await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
        assert fake.calls[-1][1].name == "legs/LF/*/torque"

    async def test_limits_of_marked_signals_that_no_pattern_means_are_set_one_by_one(self, fake, opened):
        bounds = (None, None, None, 60.0)
        names = ["/log/legs/LF/HAA/torque", "/log/legs/RH/KFE/torque", "/log/imu/temperature"]
        fake.limit_statuses = [LimitStatus(name, name, LimitWord.OK, bounds=bounds) for name in names]
        async with opened(fake.run(20), size=(120, 40)) as screen:
            await screen.until(lambda: screen.session.limits)
            rows = screen.session.rows
            rows.marked[[screen.session.table.names.index(name) for name in names]] = True
            screen.app.screen.action_command("limits_of_row")
            await screen.until(lambda: isinstance(screen.app.screen, LimitsDialog), "the form")
            assert screen.app.screen.fields["HH"] == "60", "what all of them have"
            screen.app.screen.field("HH").value = "70"
            await screen.press("enter")
            await screen.until(lambda: len([call for call in fake.calls if call[0] == "set_limits"]) == 3)
            assert {call[1] for call in fake.calls if call[0] == "set_limits"} == {
                SignalLimits(name, bounds=(None, None, None, 70.0)) for name in names
            }
            await screen.until(lambda: not screen.app.screen.is_modal)
            screen.app.screen.action_command("limits_of_row")
            await screen.until(lambda: isinstance(screen.app.screen, LimitsDialog), "the form")
            screen.app.screen.field("HH").value = ""
            await screen.shows("takes the limits")
            await screen.press("enter")
            await screen.until(lambda: len([call for call in fake.calls if call[0] == "remove_limits"]) == 3)

    async def test_who_gives_a_signal_limits_of_a_second_name_is_told_that_it_has_some(self, fake, opened):
        torque, pattern = "/log/legs/LF/HAA/torque", "legs/*/*/torque"
        fake.limit_statuses = [LimitStatus(torque, pattern, LimitWord.OK, bounds=(None, None, None, 60.0))]
        async with opened(fake.run(20), size=(120, 40)) as screen:
            await screen.until(lambda: screen.session.limits)
            await screen.enter("/torque")
            screen.app.screen.action_command("limits_of_row")
            await screen.shows("Limits of /legs/LF/HAA/torque")
            screen.app.screen.field("HH").value = "60"
            await screen.shows("1 signal would have two limits: those of legs/*/*/torque stay, too")
            screen.app.screen.field("signal").value = pattern
            await screen.shows("any of 12 signals: would")
            assert "two limits" not in screen.text

    async def test_limits_that_were_given_to_a_short_name_are_found_by_the_whole_one(self, fake, opened):
        torque = "/log/legs/LF/HAA/torque"
        given = LimitStatus(torque, "legs/LF/HAA/torque", LimitWord.OK, bounds=(None, None, None, 60.0))
        fake.limit_statuses = [given]
        async with opened(fake.run(20), size=(120, 40)) as screen:
            await screen.until(lambda: screen.session.limits)
            await screen.enter("/torque")
            screen.app.screen.action_command("limits_of_row")
            await screen.until(lambda: isinstance(screen.app.screen, LimitsDialog), "the form")
            assert screen.app.screen.fields["HH"] == "60"
            await screen.press("enter")
            await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
        assert fake.calls[-1][1] == given.options

    async def test_without_a_link_a_dialog_says_that_and_nothing_of_what_is_typed(self, screen, monkeypatch):
        for key, typed in (("A", {"signal": "LF/HAA/torque", "H": "50"}), ("T", {"name": "a", "when": "x > 1"})):
            await screen.press(key, "N")
            await screen.until(lambda: screen.app.screen.query("#form-told"))
            with monkeypatch.context() as patch:
                patch.setattr(screen.session, "link", None)
                for name, words in typed.items():
                    screen.app.screen.field(name).value = words
                await screen.shows(f"not connected to {screen.session.name} yet")
            await screen.press("escape")

    async def test_a_history_that_is_refused_leaves_how_often_limits_would_have_been_violated(
        self, fake, opened, monkeypatch
    ):
        def busy(*asked):
            raise RefusedError("busy; ask again")

        async with opened(fake.run(20)) as screen:
            await screen.press("A", "N")
            await screen.until(lambda: screen.app.screen.query("#form-told"))
            monkeypatch.setattr(fake, "history", busy)
            screen.app.screen.field("signal").value, screen.app.screen.field("H").value = "legs/LF/HAA/torque", "50"
            await screen.shows("would have been violated 3 ×")
            assert "busy" not in screen.text

    async def test_the_head_above_alarms_tells_what_these_do_and_not_what_rows_showed_before(self, fake, opened):
        name, never = "/log/imu/temperature", (None, None, None, 80.0)  # which its row never shows
        fake.limit_statuses = [
            LimitStatus(name, name, LimitWord.RED_HIGH, value=81.0, count=1, alarm=True, bounds=never)
        ]
        async with opened(fake.run(20), size=(100, 24)) as screen:
            await screen.shows("1 alarm ended unseen")
            for keys in (("A",), ("escape", "m")):
                await screen.press(*keys, shows="1 alarm (HH)")
            await screen.press("escape", shows="1 alarm ended unseen")

    @pytest.mark.parametrize("kind", ["limits", "trigger"])
    async def test_what_is_refused_stays_as_it_was_typed(self, fake, opened, monkeypatch, kind):
        refusals = ["that is too much"]

        def refuse(made):
            if refusals:
                raise RefusedError(refusals.pop())
            return "done"

        monkeypatch.setattr(fake, "_set_limits" if kind == "limits" else "_set_trigger", refuse)
        async with opened(fake) as screen:
            await screen.press("A" if kind == "limits" else "T")
            await screen.press("N")
            label = "signal" if kind == "limits" else "when"
            await screen.until(lambda: screen.app.screen.query(f"#form-{label}"))
            typed = {"signal": "LF/HAA/torque", "H": "50"} if kind == "limits" else {"name": "a", "when": "x > 1"}
            for name, words in typed.items():
                screen.app.screen.field(name).value = words
            await screen.press("enter", shows="that is too much")
            assert {name: screen.app.screen.fields[name] for name in typed} == typed
            line = screen.app.focused
            whole = line.value
            await screen.press("backspace")
            assert line.value == whole[:-1], "all but the last letter stays"
            await screen.press("tab", "up", "space", "b")
            assert line.value == f"{whole[:-1]} b", "also for who comes back to it"
            if kind == "trigger":
                other = screen.app.screen.field("pre")
                assert other.value == "1 s"
                other.focus()
                await screen.press("2", "s")
                assert other.value == "2s", "of what was not typed a key takes the place, as before"
                line.focus()
            line.value = whole
            await screen.press("enter")
            await screen.until(lambda: not screen.app.screen.is_modal)

    async def test_a_trigger_that_was_refused_and_left_comes_back_once(self, fake, opened, monkeypatch):
        def refuse(made):
            raise RefusedError("no buffer holds that: set size=202")

        monkeypatch.setattr(fake, "_set_trigger", refuse)
        async with opened(fake) as screen:
            for key in ("N", "t"):
                await screen.press(key)
            await screen.shows("New trigger on robot")
            own = screen.app.screen.fields["when"]
            screen.app.screen.field("name").value, screen.app.screen.field("when").value = "a", "x > 1"
            await screen.press("enter", shows="no buffer holds that: set size=202")
            await screen.press("escape", "down", "N", "t")  # as who mends it on another row
            await screen.shows("as it was left; Esc, then the same key again, begins anew")
            assert [screen.app.screen.fields[name] for name in ("name", "when")] == ["a", "x > 1"]
            await screen.press("escape", "up", "N", "t")
            await screen.until(lambda: screen.app.screen.query("#form-when"))
            assert screen.app.screen.fields["when"] == own

    @pytest.mark.parametrize(
        ("keys", "line", "title"),
        [("Nl", "LL", "Limits of"), ("Nd", "is", "Derive a signal"), ("w", "name", "Save data"),
         ("Nt", "when", "New trigger")],
    )  # fmt: skip
    async def test_what_was_typed_into_a_form_and_left_stands_there_once_more(
        self, screen, keys, line, title, ran_s=12
    ):
        begun = []
        for _ in range(3):
            await screen.press(*keys, shows=title)
            await screen.until(lambda: screen.app.screen.query(f"#form-{line}"))
            begun.append(screen.app.screen.field(line).value)
            assert ("as it was left" in screen.text) is (begun[-1] == "12.5")
            screen.app.screen.field(line).value = begun[-1] if begun[-1] == "12.5" else "12.5"
            await screen.press("escape")
            await screen.until(lambda: not screen.app.screen.is_modal)
        assert (begun[1], begun[2] == begun[0]) == ("12.5", True)

    @pytest.mark.parametrize(("keys", "line"), [("Nl", "LL"), ("Nd", "is"), ("w", "name"), ("Nt", "name")])
    async def test_what_one_types_takes_the_place_of_what_was_left(self, screen, keys, line, ran_s=12):
        for typed in ("40", "7"):
            await screen.press(*keys)
            await screen.until(lambda: screen.app.screen.query(f"#form-{line}"))
            screen.app.screen.field(line).focus()
            await screen.press(*typed)
            await screen.until(lambda: screen.app.screen.field(line).value, "what is typed")
            value = screen.app.screen.field(line).value
            await screen.press("escape")
            await screen.until(lambda: not screen.app.screen.is_modal)
        assert value == "7"

    async def test_what_was_left_comes_back_neither_over_what_others_set_meanwhile_nor_on_another_logger(
        self, new_fake, opened
    ):
        async def left(screen, keys, line):
            await screen.press(*keys)
            await screen.until(lambda: screen.app.screen.query(f"#form-{line}"))
            begun = screen.app.screen.field(line).value
            screen.app.screen.field(line).value = "" if begun == "12.5" else "12.5"
            await screen.press("escape")
            await screen.until(lambda: not screen.app.screen.is_modal)
            return begun

        arm = new_fake(name="arm").run()
        async with opened(arm, new_fake(name="legs").run(), name="arm") as screen:
            name, found = screen.app.screen._entry_here()[2], []
            for high in (3.0, 4.0):
                arm.limit_statuses = [LimitStatus(name, name, LimitWord.OK, bounds=(None, None, high, None))]
                await screen.session.refresh_conditions()
                found += [await left(screen, "Nl", "H"), await left(screen, "w", "name")]
            assert found == ["3", "", "4", "12.5"]
            await left(screen, "w", "name")
            await screen.press("ctrl+l", shows="legs")
            await screen.press("down", "enter")
            await screen.until(lambda: screen.app.context.has_session and screen.session.name == "legs")
            await screen.until(lambda: screen.session.connected and screen.app.screen.scope == "table")
            assert await left(screen, "w", "name") == ""

    async def test_limits_that_nothing_broke_have_a_line_below_what_is_over_and_say_what_they_want(self, fake, opened):
        quiet = LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0, bounds=(None, 0.0, 2.5, None))
        fake.limit_statuses = [quiet]
        async with opened(fake, size=(120, 24)) as screen:
            await screen.press("A", shows="within L 0 H 2.5 │ 0 over limits now │ 1 limit")
            fake.limit_statuses = [quiet, HOT]
            await screen.press("r", shows="86.31")
            assert screen.text.index("86.31") < screen.text.index("OK      /y")
            between = {"bounds": (None, 0.0, 2.5, None)}
            for now, told in (
                ({**between, "count": 1, "alarm": True}, "within L 0 H 2.5 again, seen by nobody yet"),
                ({**between, "count": 1, "seen_by": "ann@pc"}, "within L 0 H 2.5 again"),
                ({"stale_s": 0.5}, "never the same for 500 ms"),
                ({"bounds": (1.0, None, None, None), "stale_s": 2.0}, "within LL 1, never the same for 2 s"),
            ):
                fake.limit_statuses = [LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0, **now)]
                await screen.press("r", shows="read again")
                screen.app.screen.say("")
                await screen.shows(f"\n {told} │ 0 over limits now")

    async def test_an_alarm_that_came_again_says_who_saw_it_and_how_often_it_came_since(self, fake, opened):
        fake.limit_statuses = [replace(HOT, seen_by="ann@pc", since_seen=2, count=5)]
        async with opened(fake, size=(100, 24)) as screen:
            await screen.press("A", shows="    5 2 NEW")
            await screen.shows("2 × again since ann@pc saw it (e: persist or")

    async def test_an_element_beyond_its_limits_has_the_sign_in_the_table(self, fake, opened):
        name = fake.elements[0].name + fake.elements[0].entries[0].suffix
        fake.limit_statuses = [LimitStatus(name, name, LimitWord.RED_HIGH, value=9.0, count=1)]
        async with opened(fake, size=(120, 24)) as screen:
            await screen.until(lambda: screen.session._beyond() == {fake.elements[0].name: "HH"})
            await screen.shows("1 alarm (HH)")

    async def test_a_plot_makes_a_trigger_at_its_level(self, fake, screen, ran_s=20):
        await screen.press("m", at="monitor")
        await screen.press("N", shows="New trigger on robot")
        await screen.press("enter")
        await screen.until(lambda: fake.trigger_statuses)
        assert " > " in fake.trigger_statuses[0].options.when


OFF = TriggerStatus(TriggerOptions("spin", "norm(imu/rate) > 3"), TriggerWord.OFF)
COLD = LimitStatus("/log/a/cold", "/log/a/cold", LimitWord.YELLOW_LOW, "degC", 1.0, 2.0, 0.5, count=9, alarm=True)


@slow
class TestLists:
    """Filter, order and marks of both lists, and the ways between the screens beside the table."""

    async def test_marked_triggers_are_switched_together_and_removed_after_a_question(self, fake, opened):
        fake.trigger_statuses = [FALL, BLIND, OFF]
        async with opened(fake) as screen:
            await screen.press("T", shows="ARMED")
            await screen.press("V", "j", "V", shows="2 marked")
            await screen.press("t")
            await screen.until(lambda: ("arm_trigger", "low", False) in fake.calls)
            assert ("arm_trigger", "fall", False) in fake.calls
            await done(screen)
            await screen.press("x", shows="Delete 2 triggers of robot?")
            await screen.press("escape")
            assert not [call for call in fake.calls if call[0] == "remove_trigger"]

    async def test_what_was_captured_last_is_opened_from_the_table_whichever_trigger_it_was(
        self, fake, opened, monkeypatch
    ):
        asked = []

        async def opening(context, session, files, plotted):
            asked.append([file.path for file in files])

        monkeypatch.setattr("silo_tui.screens.files.opened.open_saved", opening)
        fake.trigger_statuses = [
            replace(
                FALL,
                last_ns=FALL.last_ns + 9,
                files=("/r/fall_1.silo",),
                whole=CapturedSpan(1, 0, 9, 5, FALL.last_ns),
                state=TriggerWord.FIRING,
            ),
            replace(BLIND, last_ns=FALL.last_ns + 1, files=("/r/low_2.silo", "/r/low_2.csv")),
            replace(OFF, last_ns=FALL.last_ns + 2),
        ]
        async with opened(fake) as screen:
            await screen.until(lambda: len(screen.session.triggers) == 3)
            screen.app.screen.action_command("last_capture")
            await screen.until(lambda: asked == [["/r/low_2.silo", "/r/low_2.csv"]])

    @pytest.mark.parametrize(
        ("command", "triggers", "said"),
        [
            ("last_capture", [FALL, BLIND], "no trigger has captured anything yet"),
            ("arm_trigger", [FALL, BLIND], "2 triggers: T is where one is chosen"),
            ("arm_trigger", [], "0 triggers: T is where they are made"),
            ("arm_trigger", [OFF], f"trigger '{OFF.options.name}' is armed (T Triggers)"),
            ("arm_trigger", [FALL], f"trigger '{FALL.options.name}' is off (T Triggers)"),
        ],
    )
    async def test_of_triggers_the_table_says_where_they_are_and_arms_the_only_one(
        self, fake, opened, command, triggers, said
    ):
        fake.trigger_statuses = triggers
        async with opened(fake) as screen:
            await screen.until(lambda: screen.session.triggers == triggers)
            screen.app.screen.action_command(command)
            await screen.shows(said)

    async def test_an_alarm_that_slipped_under_the_cursor_is_not_acknowledged_at_once_and_all_that_is_marked_are(
        self, fake, opened
    ):
        fake.limit_statuses = [HOT, COLD]
        async with opened(fake) as screen:
            await screen.press("A", shows="/a/cold")
            fake.limit_statuses = [COLD]
            await screen.press("r")
            await screen.until(lambda: "torque" not in screen.text)
            await screen.press("K", shows="/LF/HAA/torque is gone, /a/cold stands there now")
            assert not [call for call in fake.calls if call[0] == "acknowledge"]
            await screen.press("K")
            await screen.until(lambda: ("acknowledge", "/log/a/cold") in fake.calls)
            fake.limit_statuses = [HOT, COLD]
            await screen.press("r", shows="/LF/HAA/torque")
            await screen.press("*", "K")
            await screen.until(lambda: ("acknowledge", "/log/LF/HAA/torque", "/log/a/cold") in fake.calls)

    async def test_m_plots_the_signals_of_a_condition(self, fake, opened):
        name = fake.elements[0].name.removeprefix("/log/")
        fake.trigger_statuses = [TriggerStatus(TriggerOptions("one", f"abs({name}) > 1"), TriggerWord.ARMED)]
        async with opened(fake) as screen:
            await screen.press("T", shows="ARMED")
            await screen.press("m", at="monitor")
            assert {plot.element.name for plot in screen.app.screen.stack.plots} == {fake.elements[0].name}

    async def test_from_one_screen_beside_the_table_to_another_and_back_by_one_esc(self, screen):
        for key, scope in (("T", "triggers"), ("E", "events"), ("F", "recordings"), ("A", "alarms")):
            await screen.press(key)
            await screen.until(lambda scope=scope: screen.app.screen.scope == scope)
        await screen.press(":")
        await screen.enter("triggers", at="triggers")
        await screen.press("escape", at="table")

    async def test_a_row_of_the_table_makes_a_trigger_or_limits(self, fake, opened):
        fake.run(20)
        async with opened(fake) as screen:
            await screen.press("N", "t", shows="New trigger on robot")
            name, _, level = screen.app.screen.fields["when"].partition(" > ")
            past = await screen.session.source.history([f"/log/{name}"], fake.now_ns - 10**10, fake.now_ns, 10**9)
            assert np.nanmax(past.high) < float(level) < np.nanmax(past.high) + 1, "it would not have fired"
            await screen.press("escape", at="table")
            await screen.press("N", "l")
            await screen.shows("Limits of /base/orientation on")  # a row of a vector means all of it
            await screen.press("escape")
            await screen.do("component", "component")  # the norm, then its first entry
            await screen.press("N", "l", shows="Limits of /base/orientation_x")
            await screen.press("enter", shows="type a number into LL, L, H or HH")
            assert screen.app.screen.focused is screen.app.screen.field("LL")
            await screen.press("tab", "tab", "3", "tab", "2", "enter", shows="must rise")
            await screen.press("backspace", "4", shows=" H▲ HH▲")  # its newest values lie below both
            assert "╌" not in screen.text
            middle = (np.nanmin(past.low) + np.nanmax(past.high)) / 2
            screen.app.screen.field("H").value = f"{middle:.6f}"
            await screen.shows("╌")  # there it is
            screen.app.screen.field("H").value = "3"
            await screen.shows(" H▲ HH▲")
            await screen.press("enter")
            await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
            assert fake.calls[-1][1].bounds == (None, None, 3.0, 4.0)
            await screen.shows("are set (A Alarms)")
            assert screen.app.screen.scope == "table"


@pytest.mark.parametrize(
    ("name", "many"), [("legs/*/HAA/torque", True), ("imu/acceleration", True), ("imu/temperature", False)]
)
async def test_limits_of_several_values_are_looked_at_as_they_are_set(name, many, fake, opened, monkeypatch):
    fake.run(20)
    catalogue, tried, answer = table_catalogue(fake.elements, "/log"), [], fake.try_trigger

    def try_trigger(one):
        assert not bind(one.when, catalogue).width, "a condition is one truth"
        tried.append(one.when)
        return answer(one)

    monkeypatch.setattr(fake, "try_trigger", try_trigger)
    async with opened(fake) as screen:
        await screen.press("N", "l", shows="Limits of ")
        form = screen.app.screen
        form.field("signal").value = name
        form.field("L").value, form.field("H").value = "-1", "900"
        await screen.shows("would have been violated 3 ×")
        assert tried[-1] == (
            f"any(`{name}` < -1.0) or any(`{name}` > 900.0)" if many else f"`{name}` < -1.0 or `{name}` > 900.0"
        )
        form.field("signal").value = "legs/*/gone"
        await screen.shows("limits of 'legs/*/gone': no signal matches")
        form.field("signal").value = name
        await screen.shows("would have been violated 3 ×")
        await screen.press("enter")
        await screen.until(lambda: [call for call in fake.calls if call[0] == "set_limits"])
        assert fake.calls[-1][1].name == name


def test_limits_that_were_known_before_the_table_have_the_sign_of_their_element_once_it_is_there(fake):
    element = fake.elements[0]
    name = element.name + element.entries[0].suffix
    fake.limit_statuses = [LimitStatus(name, name, LimitWord.RED_HIGH, value=9.0, count=1)]
    session = Desk(fake).session
    session.table.load(Table(0, []))
    asyncio.run(session.refresh_conditions())
    asyncio.run(session.reload())
    assert session._beyond() == {element.name: "HH"}
    assert session.table.signs[session.table.row(element.name)]


def test_signals_are_found_in_a_condition_by_name_entry_and_glob(robot):
    names = [one.name for one in robot]
    first = robot[0]
    short = first.name.removeprefix("/log/")
    entry = short + first.entries[0].suffix
    assert named_in(f"abs({entry}) > 0.6 and 2 * 3 > 1", robot, "/log") == [first.name]
    assert named_in("any(*)", robot, "/log") == []
    branch = short.split("/")[0]
    assert named_in(f"max({branch}/*) > 1", robot, "/log") == [
        name for name in names if name.startswith(f"/log/{branch}/")
    ]


async def test_a_capture_without_end_says_how_long_it_is_and_what_ends_it(fake, opened):
    captures = replace(FALL, state=TriggerWord.FIRING, capturing_s=14.0)
    async with opened(fake.run(5)) as screen:
        await screen.press("T", "enter", shows="no line is here")
        for fake.trigger_statuses in ([captures], [replace(captures, files=("/logs/fall.silo",))]):
            await screen.session.refresh_conditions()
            screen.app.screen.show()
            assert screen.app.screen.message.said == "", "what was said is over"
            if not fake.trigger_statuses[0].files:
                await screen.press("enter", shows="its first capture is under way; m plots its signals │")
        await screen.shows("fall captures, 14 s so")
        for slow, words in (
            (1, "1 s after the last fire, or after 60"),
            (2, "2 s after the last fire, or after 2 min"),
        ):
            screen.session.measured_hz = screen.session.status.frequency_hz / slow
            screen.app.screen.show_words()
            assert f"the file is written {words}" in screen.app.screen.message.told[-1]


async def test_a_condition_is_tried_before_the_trigger_has_a_name(fake, screen):
    await screen.press("T", "N", shows="the condition: signals")
    await screen.press("tab")
    await screen.type("nobody > 3", shows="no signal is named 'nobody'")
    assert screen.app.screen.query_one("#form-told").has_class("quiet")  # one types still
    await screen.press("backspace", "enter", shows="'name' is empty: it stands in names of files")
    assert screen.app.screen.query_one("#form-told").has_class("failed")
    assert fake.trigger_statuses == []


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
@pytest.mark.slow
async def test_names_of_triggers_never_look_alike(size, fake, opened):
    names = ["overcurrent_left", "overcurrent_right"]
    fake.trigger_statuses = [TriggerStatus(TriggerOptions(name, "x > 1"), TriggerWord.ARMED) for name in names]
    async with opened(fake, size=size) as screen:
        await screen.press("T", shows="ARMED")
        shown = [line[2:].split()[1] for line in screen.text.splitlines() if "x > 1" in line and "ARMED" in line]
        assert len(set(shown)) == 2
        assert size[0] < 160 or shown == names


@pytest.mark.slow
async def test_twelve_motors_look_different_in_the_alarms(fake, opened):
    legs = [f"/log/legs/{leg}/{joint}/winding_temperature" for leg in ("LF", "RF", "LH", "RH") for joint in JOINTS]
    fake.limit_statuses = [replace(HOT, name=name, limits=name) for name in legs]
    async with opened(fake) as screen:
        await screen.press("A", shows="signal in /legs")
        lines = [line[2:].split()[1] for line in screen.text.splitlines() if line[2:].startswith("HH")]
        assert len(set(lines)) == 12
        assert sum("KFE" in line for line in lines) == 4


async def test_an_alarm_of_a_logger_that_was_stopped_lasts_no_longer_and_its_name_is_told_whole(fake, opened):
    fake.run()
    name = "/log/legs/LF/HAA/" + "winding_and_housing_temperature" * 3
    other = "/log/arms/LF/HAA/" + "winding_and_housing_temperature" * 3
    fake.limit_statuses = [
        replace(HOT, name=each, limits=each, since_ns=fake.now_ns - 12 * 10**9) for each in (name, other)
    ]
    fake.stop()
    async with opened(fake) as screen:
        await screen.press("A", shows="   12 s ")
        await screen.until(lambda: "temperature: above its red limit" in screen.text, "its whole name")


@pytest.mark.slow
async def test_more_alarms_than_are_listed_are_told(fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.screens.lists.alarms.MOST_LINES", 1)
    fake.limit_statuses = [HOT, COLD]
    async with opened(fake) as screen:
        await screen.press("A", shows="the first 1 of 2")
