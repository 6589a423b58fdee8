"""Derived signals on the screen: rows with a sign, whose options are nobody's to edit, plotted as elements are."""

import numpy as np
import pytest

from silo.judging.derived import derived_infos
from silo.model import Derived, Table
from silo_tui.model import filter as filters
from silo_tui.model.fields import Field
from silo_tui.model.table import TableState

POWER = Derived("/log/power", "2 * imu/acceleration", "W")


@pytest.fixture
def table(robot):
    made = TableState()
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


def test_a_filter_finds_them(table):
    assert filters.parse("derived").mask(table, np.zeros(len(table), bool)).sum() == 1


@pytest.mark.slow
class TestScreens:
    async def test_a_row_has_a_sign_shows_its_expression_and_refuses_edits(self, fake, opened):
        fake.derived = (POWER,)
        fake.run()
        async with opened(fake, size=(160, 50)) as screen:
            await screen.press("slash", *"derived", "enter")
            await screen.shows("power")
            line = next(line for line in screen.text.splitlines() if "power" in line and "/s" not in line)
            assert line.startswith("=")
            await screen.press("i")
            await screen.shows("= 2 * imu/acceleration")
            await screen.press("d")
            await screen.shows("power is derived: divider, buffer and action")
            await screen.press("m")
            await screen.shows("power")
            await screen.until(lambda: screen.app.screen.__class__.__name__ == "MonitorScreen")
