"""Parameters on the screen: turned, typed, undone, back to defaults, kept as presets, and why one can't be changed."""

import pytest
from msgspec.structs import replace
from textual.widgets import Input

from silo.core.elements import LoggedEvent
from silo.core.tuning.parameters import ParameterChange, ParameterInfo, ParameterKind
from silo.errors import ElementError
from silo_tui.model.parameters import BAR, history, range_bar, stepped, why_fixed
from tests.stand_ins.fake_parameters import PARAMETERS

HEIGHT, NAME, KP, FIXED = PARAMETERS
COUNT = ParameterInfo("/log/n", ParameterKind.INT, 3, (), 0.0, 5.0, value=3)
FREE = ParameterInfo("/log/x", ParameterKind.FLOAT, 20.0, value=20.0)


@pytest.mark.parametrize(
    ("info", "steps", "becomes"),
    [
        (HEIGHT, 1, 0.485), (HEIGHT, -10, 0.43), (HEIGHT, 100, 0.54), (HEIGHT, -100, 0.4), (KP, 1, 42.0), (COUNT, 9, 5),
        (COUNT, -1, 2), (NAME, 1, "pace"), (NAME, -10, "walk"), (FREE, 1, 21.0),
        (replace(FREE, maximum=20.5), 1, 20.0), (replace(HEIGHT, maximum=0.5425), 100, 0.54),
        (ParameterInfo("/log/b", ParameterKind.BOOL, default=False, value=False), 1, True),
    ],
)  # fmt: skip
def test_an_arrow_goes_a_step_within_the_range(info, steps, becomes):
    assert stepped(info, info.value, steps) == becomes


def test_what_has_no_steps_says_what_to_do_instead():
    with pytest.raises(ElementError, match="type its value"):
        stepped(replace(FREE, shape=(2,)), (1.0, 2.0), 1)


@pytest.mark.parametrize(
    ("info", "shown"),
    [
        (HEIGHT, "[─────●────]"),
        (replace(HEIGHT, value=0.54), "[─────|───●]"),
        (NAME, "   2 of 3   "),
        (FREE, " " * BAR),
    ],
)
def test_a_bar_shows_where_in_its_range_a_value_stands(info, shown):
    assert range_bar(info) == shown


def test_who_changed_what_since_the_start_is_told_by_the_events_of_the_newest_run():
    def event(run, *values, who="alice"):
        return LoggedEvent("parameter", "", who=who, run=run, change=ParameterChange(values))

    events = [
        event("1", ("kp", 1.0, 2.0), who="bob"), event("2", ("kp", None, 5.0), ("kd", None, 1.0)),
        event("2", ("kp", 5.0, 6.0)),
    ]  # fmt: skip
    begun, newest = history(events)
    assert (begun, {name: one.who for name, one in newest.items()}) == ({"kp": 5.0, "kd": 1.0}, {"kp": "alice"})


@pytest.mark.parametrize(
    ("info", "locked", "why"),
    [(HEIGHT, True, ""), (KP, False, ""), (KP, True, "try again when it opens"), (FIXED, False, "the program alone"),
     (replace(HEIGHT, input=True), False, "silo excite")],
)  # fmt: skip
def test_what_cant_be_changed_says_why_and_the_way_out(info, locked, why):
    assert why in why_fixed(info, locked=locked)
    assert bool(why) == bool(why_fixed(info, locked=locked))


def values(fake):
    return {one.name.rpartition("/")[2]: one.value for one in fake.parameter_infos}


async def test_one_is_turned_typed_undone_and_set_again(fake, opened):
    async with opened(fake) as screen:
        await screen.press("P")
        await screen.shows("above ground")
        await screen.press("right")
        await screen.until(lambda: values(fake)["height"] == 0.485)
        await screen.shows("height 0.485 m: it holds from tick 17 on")
        await screen.press("shift+left")
        await screen.until(lambda: values(fake)["height"] == 0.435)
        await screen.press("e")
        screen.app.screen.query_one(Input).value = "0.6"
        await screen.press("enter")
        await screen.shows("0.4 to 0.54")  # why it doesn't fit
        await screen.press("down", "right", "u")  # of words the next one, and back
        await screen.until(lambda: values(fake)["name"] == "trot")
        await screen.press("u")  # both turns were one
        await screen.until(lambda: values(fake)["height"] == 0.48)
        await screen.press("ctrl+r")
        await screen.until(lambda: values(fake)["height"] == 0.435)


async def test_what_somebody_else_set_since_is_not_undone(fake, opened):
    async with opened(fake) as screen:
        await screen.press("P")
        await screen.shows("above ground")
        await screen.press("right")
        await screen.shows("it holds")
        fake.put({"/log/gait/height": 0.5})
        await screen.press("u")
        await screen.shows("somebody else set height to 0.5 m since")
        assert values(fake)["height"] == 0.5


async def test_what_is_closed_says_so_and_is_not_asked_for(fake, opened):
    fake.parameters_locked = True
    async with opened(fake) as screen:
        await screen.press("P")
        await screen.shows("above ground")
        await screen.press("down", "down", "right")
        await screen.shows("closed by the program for now")
        await screen.press("e")
        assert screen.app.screen.scope == "parameters"
        assert not fake.calls


async def test_defaults_and_presets_are_shown_before_they_are_set_as_one_change(fake, opened, tmp_path):
    fake.put({"/log/gait/height": 0.5, "/log/gains/kp": 60.0})
    async with opened(fake) as screen:
        await screen.press("P")
        await screen.shows("above ground")
        await screen.press("w")
        screen.app.screen.query_one(Input).value = str(tmp_path / "tall")
        await screen.press("enter")
        await screen.shows("saved 4 parameters")
        await screen.press("asterisk", "x")
        await screen.shows("gait/height: 0.5 -> 0.48 m")
        await screen.press("escape")
        assert not fake.calls
        await screen.press("x")
        await screen.shows("gains/kp: 60.0 -> 40.0 Nm/rad")
        await screen.press("down", "enter")
        await screen.until(lambda: values(fake)["kp"] == 40.0)
        await screen.press("c")
        screen.app.screen.query_one(Input).value = str(tmp_path / "tall.yaml")
        await screen.press("enter")
        await screen.shows("2 of 4 values differ from tall.yaml")
        await screen.press("L", "enter")
        await screen.shows("gait/height: 0.48 -> 0.5 m")
        await screen.press("down", "enter")
        await screen.until(lambda: values(fake)["height"] == 0.5)
        assert [set(call[1]) for call in fake.calls] == 2 * [{"/log/gait/height", "/log/gains/kp"}]
