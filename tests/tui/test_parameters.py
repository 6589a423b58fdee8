"""Parameters on the screen: turned, typed, undone, back to defaults, kept as presets, and why one can't be changed."""

from types import SimpleNamespace

import pytest
from msgspec.structs import replace
from textual.widgets import Input

from silo.core.elements import LoggedEvent, State
from silo.core.tuning.excitation import EXAMPLE, read_excitation
from silo.core.tuning.parameters import ParameterChange, ParameterInfo, ParameterKind, Writable
from silo.errors import ElementError
from silo_tui.keymap import in_menu
from silo_tui.model.lists.parameters import (
    BAR,
    DEFAULT,
    about,
    differences,
    head,
    history,
    range_bar,
    row,
    stepped,
    why_fixed,
)
from silo_tui.screens.lists.parameters import ParametersScreen
from silo_tui.sessions import parameters as knobs
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
        (replace(NAME, value="walk"), 1, "trot"),
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
        (replace(NAME, value="gallop"), "   0 of 3   "),  # none of its words
        (FREE, " " * BAR),
        (replace(HEIGHT, maximum=None), " " * BAR),
        (replace(HEIGHT, minimum=0.54), " " * BAR),
    ],
)
def test_a_bar_shows_where_in_its_range_a_value_stands(info, shown):
    assert range_bar(info) == shown


@pytest.mark.parametrize(
    ("info", "beside", "begun", "shown"),
    [
        (HEIGHT, 0.48, 0.48, "   name          0.48 m [─────●────]      0.48  ann"),
        (HEIGHT, 0.5, 0.4, "  *name          0.48 m [─────●────] ≠     0.5  ann"),
        (NAME, None, None, "   name            trot    2 of 3            -  ann"),
        (NAME, "x" * 20, None, f"   name            trot    2 of 3    ≠{'x' * (DEFAULT - 2)}…  ann"),
    ],
)
def test_a_line_says_what_a_value_was_and_what_it_differs_from(info, beside, begun, shown):
    assert row(info, "name", beside, begun, "ann") == shown


def beside_it(beside, info=COUNT):
    of = SimpleNamespace(
        knobs=SimpleNamespace(preset="tall", beside=beside, locked=False), _names={info.name: "n"}, _begun={},
        _who=lambda _: "", _room=1, named=lambda name: name,
    )  # fmt: skip
    return ParametersScreen.row_of(of, replace(info, value=4), 80).plain.split("]")[1].split()


def test_beside_a_value_stands_that_of_the_preset_or_that_it_has_none():
    assert [beside_it(each) for each in ({}, {COUNT.name: 0}, {COUNT.name: 4})] == [["-"], ["≠", "0"], ["4"]]


@pytest.mark.parametrize(
    ("info", "says"),
    [
        (HEIGHT, "above ground │ 0.4 to 0.54 in steps of 0.005 m │ set on the robot alone"),
        (replace(HEIGHT, writable=Writable.ANYWHERE), "above ground │ 0.4 to 0.54 in steps of 0.005 m"),
    ],
)
def test_below_the_list_stands_where_one_is_set(info, says):
    assert about(info, locked=False) == says


def test_a_question_names_the_values_that_are_other_ones_now():
    infos, short = [HEIGHT, NAME], {HEIGHT.name: "height", NAME.name: "name"}
    values = {HEIGHT.name: 0.5, NAME.name: "trot", "/log/gone": 1.0}
    assert differences(infos, values, short) == {HEIGHT.name: ("height: 0.48 -> 0.5 m", 0.5)}


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


async def test_turns_of_which_one_looked_between_are_steps_back_of_their_own(fake, opened, monkeypatch):
    clock = SimpleNamespace(monotonic=lambda: 10.0)
    monkeypatch.setattr(knobs, "time", clock)
    async with opened(fake) as screen:
        await screen.do("parameters", shows="above ground")
        await screen.press("right")
        await screen.until(lambda: values(fake)["height"] == 0.485)
        await screen.shows("height 0.485 m: it holds")
        clock.monotonic = lambda: 12.0
        await screen.press("right", shows="height 0.49 m: it holds")
        clock.monotonic = lambda: 13.9
        await screen.press("right")
        await screen.until(lambda: values(fake)["height"] == 0.495)
        await screen.press("u")
        await screen.until(lambda: values(fake)["height"] == 0.485)
        await screen.press("u")
        await screen.until(lambda: values(fake)["height"] == 0.48)
        await screen.press("u", shows="nothing is left to take back")


async def test_one_is_turned_typed_undone_and_set_again(fake, opened, monkeypatch):
    monkeypatch.setattr(knobs, "time", SimpleNamespace(monotonic=lambda: 10.0))  # however slow the machine is
    async with opened(fake) as screen:
        await screen.do("parameters", shows="above ground")
        await screen.press("right")
        await screen.until(lambda: values(fake)["height"] == 0.485)
        await screen.shows("height 0.485 m: it holds from tick 17 on; u takes it back, m plots it")
        await screen.press("shift+left")
        await screen.until(lambda: values(fake)["height"] == 0.435)
        await screen.do("type_parameter")
        screen.app.screen.query_one(Input).value = "0.6"
        await screen.press("enter", shows="parameter '/gait/height': 0.6 doesn't fit")
        assert screen.app.screen.query_one(Input).value == "0.6"
        await screen.press("escape", "down", "right", "u")  # of words the next one, and back
        await screen.until(lambda: values(fake)["name"] == "trot")
        await screen.press("u")  # both turns were one
        await screen.until(lambda: values(fake)["height"] == 0.48)
        await screen.press("ctrl+r")
        await screen.until(lambda: values(fake)["height"] == 0.435)


async def test_the_parameter_whose_plot_is_chosen_is_turned_there(fake, opened, monkeypatch):
    fake.parameter_infos = [replace(HEIGHT, name="/log/imu/temperature")]
    async with opened(fake) as screen:
        await screen.enter(":goto imu/temperature")
        await screen.do("monitor", at="monitor")
        await screen.press("greater_than_sign")
        await screen.until(lambda: values(fake)["temperature"] == 0.485)
        await screen.shows("0.485 m: it holds")
        await screen.press("less_than_sign")
        await screen.until(lambda: values(fake)["temperature"] == 0.48)


async def test_what_is_undone_before_its_answer_came_is_what_was_set_last(fake, screen):
    await screen.do("parameters", shows="above ground")
    await screen.press("right", shows="it holds")
    fake.answers.clear()
    await screen.press("down", "right")
    await screen.until(lambda: fake.calls[-1] == ("set_parameters", {"/log/gait/name": "pace"}))
    await screen.press("u", "up", "right", "right")
    fake.answers.set()
    await screen.until(lambda: values(fake)["height"] == 0.495)
    assert values(fake)["name"] == "trot"
    set_ = [one[1] for one in fake.calls if one[0] == "set_parameters"]
    assert set_[1:3] == [{"/log/gait/name": "pace"}, {"/log/gait/name": "trot"}]


def test_the_menu_of_edits_keeps_a_preset_here_and_not_the_table():
    assert in_menu("menu_edit", "parameters")["w"][0].id == "save_preset"


async def test_what_somebody_else_set_since_is_not_undone(fake, screen):
    await screen.do("parameters", shows="above ground")
    await screen.press("right", shows="it holds")
    fake.put({"/log/gait/height": 0.5})
    await screen.press("u", shows="somebody else set height to 0.5 m since")
    assert values(fake)["height"] == 0.5


async def test_a_robot_program_that_was_started_anew_has_none_of_what_was_set_in_the_one_before(fake, screen):
    await screen.do("parameters", shows="above ground")
    await screen.press("right", shows="height 0.485 m: it holds from tick 17 on")
    fake.cut()
    await screen.shows("No link")
    fake.pid = 5000
    fake.put({"/log/gait/height": 0.48})
    fake.mend()
    await screen.shows("started again")
    await screen.until(lambda: "it holds from tick 17" not in screen.text, "the answer of the other program")
    await screen.press("u", shows="nothing is left to take back")


async def test_parameters_of_a_robot_program_that_is_gone_come_back_with_it(screen, monkeypatch):
    screen.session.take_status(replace(screen.session.status, state=State.DEAD))
    monkeypatch.setattr(knobs.Knobs, "refresh", nothing)
    await screen.do("parameters", shows="The robot program is gone; its parameters come back with it")


async def nothing(*given):
    """Bring nothing."""


async def test_what_is_closed_says_so_and_is_not_asked_for(fake, opened):
    fake.parameters_locked = True
    async with opened(fake) as screen:
        await screen.do("parameters", shows="above ground")
        await screen.press("down", "down", "right", shows="closed by the program for now")
        await screen.do("type_parameter")
        assert screen.app.screen.scope == "parameters"
        assert not fake.calls


async def test_defaults_and_presets_are_shown_before_they_are_set_as_one_change(fake, opened, tmp_path):
    fake.put({"/log/gait/height": 0.5, "/log/gains/kp": 60.0})
    async with opened(fake) as screen:
        await screen.do("parameters", shows="above ground")
        await screen.press("w")
        screen.app.screen.query_one(Input).value = str(tmp_path / "tall")
        await screen.press("enter", shows="saved 4 parameters")
        await screen.do("asterisk", "default_parameter", shows="gait/height: 0.5 -> 0.48 m")
        await screen.press("escape")
        assert not fake.calls
        await screen.do("default_parameter", shows="gains/kp: 60.0 -> 40.0 Nm/rad")
        await screen.press("down", "enter")
        await screen.until(lambda: values(fake)["kp"] == 40.0)
        await screen.shows("it holds")  # the flow is over
        await screen.do("compare_preset")
        screen.app.screen.query_one(Input).value = str(tmp_path / "tall.yaml")
        await screen.press("enter", shows="2 of 4 values differ from tall.yaml")
        await screen.do("load_preset", "enter", shows="gait/height: 0.48 -> 0.5 m")
        await screen.press("down", "enter")
        await screen.until(lambda: values(fake)["height"] == 0.5)
        assert [set(call[1]) for call in fake.calls] == 2 * [{"/log/gait/height", "/log/gains/kp"}]


async def test_one_is_excited_after_a_look_at_how_far_and_how_long_and_any_key_ends_it(fake, screen):
    await screen.do("parameters", shows="above ground")
    await screen.do("excite")
    await screen.until(lambda: screen.app.screen.query(Input), "a line to type in")
    await screen.shows("0.4 to 0.54 in steps of 0.005 m")
    line = screen.app.screen.query_one(Input)
    assert line.value == "chirp 0.1-20Hz amplitude 0.015 for 20s"
    line.value = "step amplitude 1 for 20s"
    await screen.press("enter", shows="it takes 0.4 to 0.54")  # refused as a whole, and the line stays
    line.value = "multisine 0.1-20Hz amplitude 0.02 for 20s"
    await screen.press("enter", shows="around 0.48 m, from 0.46 to 0.5:")
    await screen.press("escape")
    assert not fake.calls
    await screen.press("colon")
    await screen.type_or_paste("excite kp prbs 50Hz amplitude 2 for 20s")
    await screen.press("enter", shows="around 40.0 Nm/rad, from 38 to 42:")
    await screen.press("down", "enter", shows="3.0 of 20 s")
    await screen.press("space", shows="stopped by a key, rows 5 to 9")
    assert fake.calls == [("excite", "kp", "prbs", 2.0, 20.0, 50.0)]


@pytest.mark.parametrize(("preset", "beside"), [("", "default"), ("soft", "preset")])
def test_the_head_of_the_list_says_what_stands_beside_the_values(preset, beside):
    assert head(100, 12, preset).split() == ["parameter", "value", "range", beside, "by"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", f"an excitation begins with chirp, multisine, prbs or step, got '': {EXAMPLE}"),
        ("sine 1Hz", f"an excitation begins with chirp, multisine, prbs or step, got 'sine': {EXAMPLE}"),
        ("chirp 1-2Hz", f"amplitude and for must be said: {EXAMPLE}"),
        ("step amplitude 2", f"for must be said: {EXAMPLE}"),
        ("chirp 1-xHz amplitude 2 for 3s", "chirp must be like 0.1-20Hz, got '1-xHz'"),
        ("prbs 1-2 amplitude 2 for 3s", "prbs must be like 50Hz, got '1-2'"),
        ("step amplitude x for 3s", "amplitude must be a number, got 'x'"),
        ("step amplitude 2 for x", "'for' must be a time, got 'x'; write 20s, 500ms, 2min"),
        *[(line, f"behind the wave stand amplitude, for and ramp, each once with a value: {EXAMPLE}")
          for line in ("step amplitude 2 for 3s ramp", "step amplitude 2 amplitude 3 for 3s", "step 3 for 3s")],
    ],
)  # fmt: skip
def test_a_line_that_makes_no_sense_says_what_it_should_be(line, words):
    with pytest.raises(ElementError) as refused:
        read_excitation("kp", line)
    assert str(refused.value) == words


async def test_the_plot_of_a_parameter_says_what_stands_beside_it(screen, ran_s=12, size=(100, 24)):
    await screen.do("mark", "parameters", shows="above ground")
    await screen.do("plot_conditions", at="monitor")
    await screen.shows("with 1 signal marked in the table")
