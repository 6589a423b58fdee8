"""Derived signals on the screen: rows with a sign, whose options are nobody's to edit, plotted as elements are."""

import asyncio
import re

import numpy as np
import pytest

from silo.core.conditions import Derived, SignalLimits
from silo.core.elements import Table
from silo.core.quantities.reading import read_keep, read_split
from silo.errors import ElementError
from silo.expressions.binding import bind
from silo.expressions.derived_signals import derived_infos
from silo.judging.checks import table_catalogue
from silo.live.quantities import LOST
from silo_tui.model.plots.limit_fields import limits_of_fields
from silo_tui.model.table import derived
from silo_tui.model.table import filter as filters
from silo_tui.model.table.cells import sign_of
from silo_tui.model.table.facts import LIMIT_BITS, Facts
from silo_tui.model.table.fields import Field
from silo_tui.model.table.state import TableState
from silo_tui.screens.dialogs import derive, limits, recorder, trigger_editor
from silo_tui.screens.dialogs.form import hints_with, named_whole, names_in

POWER = Derived("/log/power", "2 * imu/acceleration", "W")


@pytest.fixture
def table(robot):
    made = TableState()
    made.prefix = "/log"
    made.load(Table(1, robot, derived_infos(robot, "/log", [POWER])))
    return made


def test_they_are_rows_behind_the_elements(table, robot):
    assert table.own == len(robot)
    assert table.names[-1] == "/log/power"
    assert table.derived.tolist() == [False] * len(robot) + [True]
    assert table.is_live(len(robot))


def test_their_options_stay_whatever_is_edited_with_them(table, robot):
    assert table.edit([0, len(robot)], Field.DIVIDER, 7) == 1
    assert [edit.name for edit in table.edits()] == [robot[0].name]


def test_one_of_an_element_that_is_off_is_off(robot):
    made = TableState()
    off = [one.options.__class__(False) for one in robot]
    elements = [one.__class__(**{**{f: getattr(one, f) for f in one.__struct_fields__}, "options": option})
                for one, option in zip(robot, off, strict=True)]  # fmt: skip
    made.load(Table(1, elements, derived_infos(elements, "/log", [POWER])))
    assert not made.is_live(len(robot))
    assert made.elements[-1].description == "= 2 * imu/acceleration (off: /log/imu/acceleration is off)"


def test_an_element_that_is_off_has_the_signs_of_its_limits_alone(table, robot, monkeypatch):
    monkeypatch.setattr(type(table), "signs", np.full(len(table), LOST | LIMIT_BITS["HH"]))
    table.signs[1] = LOST
    assert [sign_of(table, row) for row in (0, 1)] == ["HH", "lost"]
    table.server[Field.ENABLED, :2] = False
    assert [sign_of(table, row) for row in (0, 1)] == ["HH", ""]


def test_a_filter_finds_them(table):
    assert filters.parse("derived").mask(table, np.zeros(len(table), bool)).sum() == 1


@pytest.mark.slow
class TestScreens:
    async def test_a_row_has_a_sign_shows_its_expression_and_refuses_edits(self, fake, opened):
        fake.derived = (POWER,)
        async with opened(fake.run(), size=(160, 50)) as screen:
            await screen.press("slash", *"derived", "enter")
            await screen.until(lambda: re.search("^=.*power ", screen.text, re.MULTILINE), "its row with a sign")
            await screen.press("i", shows="= 2 * imu/acceleration")
            await screen.press("d", shows="power is derived: divider, buffer and action")
            await screen.press("m", shows="power")
            await screen.until(lambda: screen.app.screen.__class__.__name__ == "MonitorScreen")


def test_what_is_typed_is_told_as_it_would_be(table):
    assert derived.words_of(Derived("rms", "sqrt(imu/temperature)"), table)[0].startswith("one number")
    assert derived.words_of(Derived("double", "2 * imu/acceleration"), table) == ["3 numbers, in m/s2, every tick"]
    with pytest.raises(ElementError, match="name it before Enter"):
        derived.words_of(Derived("", "imu/temperature"), table)
    with pytest.raises(ElementError, match=r"'hypot\(base': write a name of letters, digits"):
        derived.words_of(Derived("hypot(base", "imu/temperature"), table)
    with pytest.raises(ElementError, match="is an element already"):
        derived.words_of(Derived("imu/temperature", "base/position_x"), table)


def test_an_example_is_one_of_signals_that_are_logged(table):
    hints = hints_with({"is": "{0} * {1}", "name": "a word"}, table)
    assert hints["name"] == "a word"
    assert derived.words_of(Derived("new", hints["is"]), table)[0].startswith("one number")
    assert hints_with({"is": "{0} * {1}"}, TableState())["is"] == "a * a"
    hint = hints_with({"when": "e.g. abs({0}) > 0.6 and {1} < 20"}, table)["when"]
    assert len(hint) < 60, "whole in a field at 80 columns"


def test_an_example_is_of_small_numbers_so_that_it_does_not_hold_all_the_time(table):
    hints = {"when": "{0} {1}"}
    before = hints_with(hints, table)["when"].split()
    large = [before[0].startswith(table.shown(name).lstrip("/")) for name in table.names]
    table.facts = Facts({"value": np.where(large, 2500.0, 0.1)})
    after = hints_with(hints, table)["when"].split()
    assert not {*before} & {*after}


@pytest.mark.parametrize(
    ("typed", "becomes"),
    [
        ("imu/acc", ["imu/acceleration", "imu/acceleration_x", "imu/acceleration_y", "imu/acceleration_z"]),
        ("2 * abs(/imu/tem", ["2 * abs(/imu/temperature"]),
        ("imu/temperature", []),  # a name already
        ("temperature", []),  # the end of one
        ("mode == accel", []),  # a label, or what isn't shown behind the cursor
        (
            "imu/temperature < 3 and pow",
            [f"imu/temperature < 3 and {name}" for name in ("power", *(f"power_{at}" for at in range(3)))],
        ),
        ("imu/temperature > 3 im", []),  # a unit
        ("imu/temperature > 3im", []),
        ("i", []),  # too little to be sure of
        ("abs", []),
        ("imu/temperature an", []),
        ("nothing/of", []),
        ("", []),
    ],
)
def test_the_last_name_of_an_expression_is_made_whole(table, typed, becomes):
    assert named_whole(typed, names_in(table)) == becomes


def test_a_unit_that_follows_is_not_typed_again(table):
    assert derived.present(table) == (POWER,)
    table.load(Table(2, table.elements[: table.own], derived_infos(table.elements[: table.own], "/log",
               [Derived("/log/double", "2 * imu/acceleration")])))  # fmt: skip
    assert derived.present(table) == (Derived("/log/double", "2 * imu/acceleration"),)
    assert derived.named(table, "double").expression == "2 * imu/acceleration"
    assert derived.named(table, "new") == Derived("new", "")


async def test_what_was_wrong_goes_as_soon_as_something_else_is_typed(screen, monkeypatch, ran_s=12):
    """However long it takes until that is looked at; and what was looked at meanwhile says nothing of it."""
    await screen.enter(":derive p", shows="Derive a signal on robot")
    await screen.type("n", shows="no signal is named 'n'")
    form = screen.app.screen
    monkeypatch.setattr(form, "look_soon", lambda: None)
    await screen.type("orm(base/position)")
    await screen.until(lambda: "no signal is named" not in screen.text)
    looked, look = asyncio.Event(), form.look

    async def slowly():
        words = await look()
        await looked.wait()
        return words

    monkeypatch.setattr(form, "look", slowly)
    looking = asyncio.create_task(form._look_now())
    await screen.type(" + 1")
    looked.set()
    await looking
    await screen.settled()
    assert "in m, every tick" not in screen.text


async def test_a_signal_is_derived_changed_and_forgotten_without_leaving_the_table(fake, screen, ran_s=12):
    await screen.press("colon", *"derive", "enter", shows="Derive a signal on robot")
    await screen.press("enter", shows="'name' is empty: it stands in tables")
    await screen.app.screen._look_now()  # the first look: late, where Enter came while the form was made
    await screen.settled()
    assert "'name' is empty: it stands in tables" in screen.text
    await screen.type("power")
    await screen.press("tab", "backspace", "enter")  # without the signal under the cursor
    await screen.shows("'is' is empty: signals, numbers")
    await screen.type("2 * imu/acelaration", shows="^" * len("imu/acelaration"))  # of all that was typed
    await screen.shows("did you mean 'imu/acceleration")
    lines = screen.text.splitlines()
    at = next(place for place, line in enumerate(lines) if "imu/acelaration" in line)
    carets = next(line for line in lines[at:] if "^" in line)
    assert carets.index("^") == lines[at].index("imu/acelaration")
    await screen.press("enter")
    assert screen.app.screen.is_modal
    await screen.press(*["backspace"] * len("acelaration"))
    await screen.type("acceleration", shows="3 numbers, in m/s2, every tick")
    await screen.press("enter", shows="'/power' is derived: 2 * imu/acceleration")
    assert fake.calls[-1] == ("derive", "power", "2 * imu/acceleration", "")
    await screen.press("e", shows="Derived signal power on robot")  # the cursor is on it
    await screen.press("home", "delete", "3", "enter")
    await screen.until(lambda: fake.derived == (Derived("/log/power", "3 * imu/acceleration"),))
    await screen.shows("is derived: 3 *")
    await screen.press("x", shows="Delete /power of robot?")
    await screen.press("y")
    await screen.until(lambda: not fake.derived and len(screen.session.table) == len(fake.elements))


async def test_tab_makes_a_name_whole_and_then_goes_on_and_of_two_that_are_marked_the_product_is_offered(
    screen, ran_s=12
):
    await screen.press("colon", *"derive", "enter", shows="Derive a signal on robot")
    await screen.press(*"hot", "tab", *"2 * imu/te", shows="2 * imu/te[mperature] Tab")  # what it may become
    form = screen.app.screen
    assert form.fields["is"] == "2 * imu/te"
    await screen.press("tab")
    assert form.fields["is"] == "2 * imu/temperature"
    await screen.press("tab", "K")
    assert form.fields == {"name": "hot", "is": "2 * imu/temperature", "unit": "K"}
    await screen.press("escape")
    await screen.enter("/LF/HAA position|torque")
    await screen.do("mark", "mark")
    await screen.enter(":derive", shows="legs/LF/HAA/position * legs/LF/HAA/torque")


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_a_signal_is_derived_from_the_one_under_the_cursor(size, fake, opened):
    def offered(screen):
        return next(line for line in screen.text.splitlines() if re.search(r"\bis\b +\S", line))

    async with opened(fake.run(), size=size) as screen:
        await screen.enter(":goto LF/HAA/torque")
        await screen.enter(":derive", shows="Derive a signal on robot")
        await screen.shows("legs/LF/HAA/torque")
        assert "legs/LF/HAA/torque" in offered(screen)
        await screen.shows("one number, in Nm, every tick; name it before Enter")
        await screen.press("tab", shows="norm() rate() diff()")
        await screen.press("escape")
        await screen.enter(":goto base/position")
        await screen.do("component", "component")
        await screen.enter(":derive")  # the norm, then its first entry alone
        await screen.shows("Derive a signal on robot")
        await screen.until(lambda: "base/position_x" in offered(screen), "the entry")


async def test_what_the_robot_refuses_is_said_and_nothing_typed_is_lost(fake, screen, ran_s=12):
    fake.refuse_derived = "at most 100 signals are derived; nothing was changed"
    await screen.press("colon", *"derive hot imu/temperature > 3", "enter", shows="at most 100 signals")
    await screen.app.screen._look_now()  # as the form does once it is there
    await screen.settled()
    assert "at most 100 signals" in screen.text
    assert "imu/temperature > 3" in screen.text
    fake.refuse_derived = ""
    await screen.press("enter")
    await screen.until(lambda: len(fake.derived) == 1)


async def test_what_is_typed_as_a_whole_is_done_and_what_is_not_is_asked_for(screen, ran_s=12, size=(120, 24)):
    await screen.press("colon", *"derive hot imu/temperature > 3", "enter")
    await screen.shows("'/hot' is derived: imu/temperature > 3")
    assert "hides" not in screen.text
    assert not screen.app.screen.is_modal
    await screen.enter("/legs")
    await screen.press("colon", *"derive warm imu/temperature > 2", "enter")
    await screen.shows("'/warm' is derived: imu/temperature > 2; the filter hides it: Esc shows all")
    await screen.press("/")
    await screen.enter("warm")
    await screen.until(lambda: "the filter hides it" not in screen.text, "no word of another filter")
    await screen.press("colon", *"derive cold", "enter", shows="Derive a signal on robot")


@pytest.mark.parametrize(("hints", "field"), [(trigger_editor.HINTS, "when"), (derive.HINTS, "is")])
def test_the_example_of_an_expression_is_understood(table, hints, field):
    example = hints_with(hints, table)[field].removeprefix("e.g. ")
    bound = bind(example, table_catalogue(table.elements[: table.own], table.prefix, derived.present(table)))
    assert bound.logical is (field == "when")


def test_what_else_a_form_gives_as_an_example_is_understood():
    assert recorder.HINTS["split"] == "e.g. 1GB or 10min"
    assert [read_split(words) for words in ("1GB", "10min")] == [(10**9, 0.0), (0, 600.0)]
    assert (recorder.HINTS["keep"], read_keep("50GB")) == ("all, or e.g. 50GB", 50 * 10**9)
    assert limits.HINTS["stale"] == "the same for, e.g. 0.5s"
    fields = {**dict.fromkeys(limits.HINTS, ""), "signal": "x", "stale": "0.5s"}
    assert limits_of_fields(fields, SignalLimits("x")).stale_s == 0.5
