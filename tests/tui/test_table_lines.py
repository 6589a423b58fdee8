"""The lines of the element table, without an app: what they say, what is painted, which are seen, what a click is."""

from math import nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.style import Style
from textual.geometry import Offset, Region, Size
from textual.scroll_view import ScrollView

from silo_tui.model.samples.live import Reading
from silo_tui.model.table.columns import FLAGS, LIVE_COLUMNS
from silo_tui.model.table.facts import STATISTICS, Facts
from silo_tui.model.table.fields import Field
from silo_tui.terminal.thinness import Pace
from silo_tui.widgets import element_table
from silo_tui.widgets.element_table import ElementTable, TableHead, fitted
from tests.stand_ins.desk import Desk, Drawn
from tests.stand_ins.fake_signals import scalar, vector

TURN, PLACE, HEAT = "/log/base/orientation", "/log/base/position", "/log/imu/temperature"


class Looks:
    """Styles by their names."""

    def _style(self, *names: str) -> Style:
        return Style(meta={"names": tuple(filter(None, names))})

    def get_component_rich_style(self, *names: str, **_: Any) -> Style:
        return self._style(*names)


class Table(Looks, Drawn, ElementTable):
    """The table."""

    height, top, virtual_size = 10, 0, Size(0, 0)

    def __init__(self, desk: Desk, width: int = 80) -> None:
        self.posted: list[Any] = []
        self.areas: list[tuple[int, int]] = []  # that were painted: column, line
        self.width = width
        super().__init__(desk.session, LIVE_COLUMNS)
        self.follow()

    scroll_offset = property(lambda self: Offset(0, self.top))
    scroll_y = property(lambda self: self.top)
    region = property(lambda self: Region(3, 2, self.width, self.height))

    def refresh(self, *regions: Any, **_: Any) -> Any:
        self.areas += [(one.x, one.y) for one in regions]
        return self

    def post_message(self, message: Any) -> bool:
        self.posted.append(message)
        return True

    def scroll_to(self, *, y: float, **_: Any) -> None:  # type: ignore[override]
        self.top = int(y)

    def follow(self) -> None:
        self.rows.refresh()
        self.rows_changed()

    @property
    def text(self) -> list[str]:
        return [self.render_line(y).text for y in range(self.height)]

    def looks(self, y: int) -> dict[str, tuple[str, ...]]:
        """Of each word of a line, the names of its style."""
        return {one.text.strip(): one.style.meta["names"] for one in self.render_line(y) if one.text.strip()}


class Head(Looks, Drawn, TableHead):
    """The heads of its columns."""

    def __init__(self, table: Table) -> None:
        super().__init__(table)
        self.width, self.posted = table.width, []

    def post_message(self, message: Any) -> bool:
        self.posted.append(message.order)
        return True


@pytest.fixture
def desk(fake):
    return Desk(fake.run())


@pytest.fixture
def table(desk):
    return Table(desk)


def test_a_line_has_its_name_its_settings_and_what_is_measured(table):
    assert table.text[:2] == [
        " >/base/orientation            [x]    1 save+pub loop  4000                wait▐",
        "  /base/position         m     [x]    1 save+pub loop  4000                wait ",
    ]
    table.session.live.readings[HEAT] = Reading(np.array([21.5]), {}, 50, 0, 0)
    table.follow()
    assert table.text[4].startswith("  /imu/temperature       degC  [x]   40 save+pub loop   100 ")
    assert "21.5" in table.text[4]


def test_in_a_tree_name_spaces_have_lines_and_names_their_last_level(table):
    table.rows.order_by("tree")
    table.follow()
    assert [line[:31].rstrip() for line in table.text[:8]] == [
        "  ▼ base                 3", " >  ► orientation |4|", "    ► position |3|       m",
        "    ► velocity |3|       m/s", "  ▼ imu                  2", "    ► acceleration |3|   m/s2",
        "      temperature        degC", "  ▼ legs                 64",
    ]  # fmt: skip
    table.rows.move_to(0)
    table.rows.fold()
    table.rows.unfolded = {"/log/imu/acceleration": 3}
    table.follow()
    assert [line[:24].rstrip() for line in table.text[:7]] == [
        " >► base", "  ▼ imu",
        "    ▼ acceleration |3|", "        x", "        y", "        z", "      temperature",
    ]  # fmt: skip


def test_marks_edits_conflicts_and_what_is_derived_have_signs(fake):
    fake.derive("hot", "imu/temperature > 3")
    desk = Desk(fake)
    table = Table(desk)
    desk.edit(PLACE)
    table.rows.marked[desk.session.table.row(PLACE)] = True
    desk.edit(HEAT, 80)
    fake.somebody_edits(HEAT, divider=20)
    desk.session.table.load(fake.table())
    table.follow()
    signs = {line[FLAGS:].split()[0]: line[:FLAGS] for line in table.text}
    assert (signs["/base/orientation"], signs["/base/position"], signs["/imu/temperature"]) == (" >", "*+", "! ")
    at = {line[FLAGS:].split()[0]: y for y, line in enumerate(table.text)}
    assert table.looks(at["/base/position"])["5"][-1] == "table--pending"
    assert table.looks(at["/imu/temperature"])["80"][-1] == "table--conflict"
    table.rows.order_by("tree")
    table.follow()
    signs = {line[FLAGS:].split()[1 if line[FLAGS:].split()[0] in "▼►+-" else 0]: line[:FLAGS] for line in table.text}
    assert (signs["base"], signs["position"], signs["imu"], signs["temperature"], signs["hot"]) == (
        "* ",
        "*+",
        "! ",
        "! ",
        "= ",
    )


def test_the_cursor_s_line_and_its_cell_look_different(table):
    table.field = Field.DIVIDER
    table.rows.move_to(1)
    table.show_cursor()
    assert table.looks(1)["1"] == ("table--row", "table--cursor", "table--cell")
    assert table.looks(0)["1"] == ("table--row",)
    assert table.text[1][1] == ">"
    table.session.table.edit([table.session.table.row(TURN)], Field.ENABLED, 0)
    table.follow()
    assert table.looks(0)["/base/orientation"] == ("table--row", "table--off")
    table.session.table.edit([table.session.table.row(PLACE)], Field.ENABLED, 0)
    table.follow()
    assert "table--off" not in table.looks(1)["/base/position"]


def test_a_range_is_seen_while_it_is_made(table):
    assert table.text
    table.rows.begin_range()
    table.areas.clear()
    table.rows.move_to(2)
    table.show_cursor()
    assert sorted(table.areas) == [(0, 0), (0, 1), (0, 2)]
    assert ["table--range" in names for names in (table.looks(y)["save+pub"] for y in range(4))] == [True] * 3 + [False]
    assert [line[1] for line in table.text[:4]] == ["+", "+", "»", " "]


def test_below_the_last_line_nothing_is_drawn(table):
    table.rows.set_filter("temperature")
    table.height = 20
    table.follow()
    assert table.text[13:] == [" " * 80] * 7
    assert all(line.strip() for line in table.text[:13])


@pytest.mark.parametrize(("top", "rail"), [(0, "▐         "), (31, "    ▐     "), (62, "         ▐")])
def test_a_rail_shows_where_in_the_list_one_is(top, rail, table):
    table.top = top
    table.rows.move_to(top)
    table.show_cursor()
    assert "".join(line[-1] for line in table.text) == rail


def test_the_cursor_is_brought_on_the_screen_and_no_farther(table):
    for position, top in ((9, 0), (10, 1), (5, 1), (0, 0), (71, 62), (62, 62), (61, 61)):
        table.rows.move_to(position)
        table.show_cursor()
        assert table.top == top, position
        assert isinstance(table.posted[-1], ElementTable.Moved)


def test_a_move_of_the_cursor_paints_two_lines_and_new_values_what_is_measured_of_theirs(table):
    assert table.text
    table.areas.clear()
    table.rows.move_to(3)
    table.show_cursor()
    assert table.areas == [(0, 0), (0, 3)]
    assert table.text
    table.areas.clear()
    table.session.live.readings[HEAT] = Reading(np.array([21.5]), {}, 50, 0, 0)
    table.live_changed()
    assert table.areas == [(table.laid.rest, 4)]
    assert table.text
    table.areas.clear()
    table.live_changed()
    assert table.areas == []


def test_of_a_scroll_other_panes_are_told_where_it_is_by_whole_lines(table, monkeypatch):
    monkeypatch.setattr(ScrollView, "watch_scroll_y", lambda *_: None)
    table.posted.clear()
    table.watch_scroll_y(1.0, 1.2)
    assert table.posted == []
    table.watch_scroll_y(1.0, 2.0)
    assert isinstance(table.posted[0], ElementTable.Moved)


def test_trends_are_drawn_once_a_second_and_when_something_of_the_past_came(table, monkeypatch):
    clock, drawn = SimpleNamespace(s=table._trends_due_s + 1), []

    def trends(rows: Any, width: int) -> dict[int, str]:
        drawn.append(len(rows))
        return dict.fromkeys(rows, "⣀" * width)

    monkeypatch.setattr(element_table.time, "monotonic", lambda: clock.s)
    monkeypatch.setattr(table.session, "trends", trends)
    table.width = 120
    table.lay_out(trend=True)
    assert table.shows_trends
    for after_s, made in ((0.0, 1), (Pace().trend_s - 0.1, 1), (0.2, 2), (0.1, 2)):
        clock.s += after_s
        table.live_changed()
        assert table.text
        assert len(drawn) == made, after_s
    assert "⣀" * 10 in table.text[0]
    table.session.columns.past_until_ns = 5
    table.live_changed()
    assert len(drawn) == 3


def click(table: Table, x: int, y: int, chain: int = 1) -> list[Any]:
    table.posted.clear()
    table.on_click(SimpleNamespace(x=x, y=y, chain=chain))  # type: ignore[arg-type]
    return [one.field for one in table.posted if isinstance(one, ElementTable.Picked)]


def test_a_click_puts_the_cursor_there_and_a_second_one_edits(table):
    divider = table.text[2].index(" 1 save+pub") + 1
    assert click(table, divider, 2) == []
    assert (table.rows.position, table.field) == (2, Field.DIVIDER)
    assert click(table, divider, 2) == [Field.DIVIDER]
    assert click(table, 10, 2) == []  # a name
    assert click(table, 10, 2, chain=2) == [None]
    assert click(table, table.text[2].index("loop"), 2) == []
    assert table.field is Field.BUFFER
    table.top = 5
    click(table, 10, 0)
    assert table.rows.position == 5


def test_a_click_in_front_of_a_name_marks_it(table):
    click(table, FLAGS - 1, 3)
    assert (table.rows.position, table.rows.marked_count, table.text[3][1]) == (3, 1, "»")
    click(table, FLAGS, 4)
    assert table.rows.marked_count == 1


def test_a_click_below_the_last_line_does_nothing(table):
    table.rows.set_filter("gait")
    table.follow()
    table.posted.clear()
    assert click(table, 10, 1) == []
    assert table.posted == []


def test_the_editor_of_a_cell_lies_over_it(table):
    table.rows.move_to(12)
    table.show_cursor()
    table.field = Field.SIZE
    line = table.text[12 - table.top]
    region = table.cell_region()
    assert line[region.x - 3 :][: region.width].strip() == "4000"
    assert region.y == 2 + 12 - table.top
    assert region.height == 1


def test_fields_are_gone_through_from_left_to_right(table):
    table.field, found = Field.ENABLED, []
    for _ in range(6):
        found.append(table.field)
        table.field = table.field_beside(1)
    assert found == [*list(Field), list(Field)[-1]]
    assert table.field_beside(-1) is list(Field)[-2]
    table.field = Field.ENABLED
    assert table.field_beside(-1) is Field.ENABLED


def test_columns_are_chosen_by_their_titles(table):
    assert table.choose_columns(["div", "smell"]) == ["smell"]
    table.follow()
    assert "save+pub" not in table.text[0]
    assert " 1 " in table.text[0]
    assert table.choose_columns([]) == []
    table.follow()
    assert "save+pub" in table.text[0]


def test_the_head_names_columns_and_the_order(table):
    head = Head(table)
    for order, begins in (("name", "  ↑name "), ("tree", "  ↑name "), ("div", "  name ")):
        table.rows.sort = order
        table.follow()
        assert head.render_line(0).text.startswith(begins), order
    line = head.render_line(0).text
    assert "↓div" in line
    table.rows.turned = True
    table.follow()
    assert "↑div" in head.render_line(0).text
    assert [one.style.meta["names"] for one in head.render_line(0) if one.text.strip() == "on"] == [("head--field",)]


def test_a_click_on_a_head_asks_for_its_order(table):
    head = Head(table)
    line = head.render_line(0).text
    for title in ("name", "unit", "div", "act", "buf", "size"):
        for x in (line.index(title), line.index(title) + len(title) - 1):
            head.on_click(SimpleNamespace(x=x))  # type: ignore[arg-type]
    assert head.posted == [each for each in ("name", "unit", "div", "act", "buf", "size") for _ in range(2)]


def test_of_what_is_on_the_screen_the_names_are_told(table):
    table.rows.order_by("tree")
    table.rows.unfolded = {TURN: 4}
    table.height = 6
    table.follow()
    assert table.rows_on_screen() == [table.session.table.row(TURN)]
    assert table.names_near_screen()[0] == TURN
    assert {f"{TURN}_{each}" for each in "xyzw"} <= set(table.names_near_screen())
    table.rows.unfolded = {}
    table.rows.order_by("name")
    table.follow()
    beyond = table.session.table.names[table.rows.shown[table.height]]
    assert beyond in table.names_near_screen(), "what comes into view is measured"
    table.sight.digits_fewer = 1
    assert beyond not in table.names_near_screen(), "but over a thin link"


@pytest.mark.parametrize(
    ("name", "cells", "shown"),
    [("/log/a", 11, STATISTICS), (f"/log/{'a' * 10}", 9, STATISTICS), (f"/log/{'a' * 30}", 10, ("min", "max"))],
)
def test_statistics_are_wide_where_names_leave_room(name, cells, shown, new_fake):
    table = Table(Desk(new_fake([scalar(name, "Pa")])), width=80)
    table.column_set, table._laid = "statistics", None
    widths = {column.title: width for column, width in table.laid.measured}
    assert {title: widths[title] for title in STATISTICS if title in widths} == dict.fromkeys(shown, cells)
    assert (table.sight.room, table.sight.value_room) == (min(cells, widths["value"]), widths["value"])


@pytest.mark.parametrize(("words", "shown"), [("", True), ("torque", True), ("inertia", False)])
def test_units_of_which_none_has_room_have_no_column(words, shown, new_fake):
    table = Table(Desk(new_fake([scalar("/log/a/inertia", "kg" * 30), scalar("/log/torque", "Nm")])), width=80)
    table.rows.set_filter(words)
    table.follow()
    assert ("unit" in table.titles) is shown
    assert shown or not any("…" in line for line in table.text), "a column of ellipses"


def test_of_the_first_of_an_order_names_are_told_as_among_all(new_fake):
    """Of the ten hottest, one of each leg: nobody saw of which joint."""
    names = [f"/log/legs/{leg}/{joint}/drive_temperature" for leg in ("LF", "RF") for joint in ("HAA", "KFE")]
    table = Table(Desk(new_fake([scalar(name, "degC") for name in names])), width=70)
    table.session.table.facts = Facts({"signs": np.zeros(4), "value": np.array([1.0, 9.0, 2.0, 8.0])})
    table.rows.sort = "value"
    table.rows.show_first(2)
    table.follow()
    assert [leg in line and "KFE" in line for leg, line in zip(("LF", "RF"), table.text, strict=False)] == [True] * 2


def test_names_that_share_a_name_space_are_told_below_it(new_fake):
    elements = [vector(f"/log/{'deep/' * 4}{'leg' * 8}{each}", "m") for each in range(3)]
    table = Table(Desk(new_fake(elements)), width=72)
    space = table.laid.told.space
    assert space == "/deep/deep/deep/deep"
    assert "↑…deep/deep/deep  " in Head(table).render_line(0).text
    assert all(space not in line for line in table.text)


@pytest.mark.parametrize(
    ("words", "width", "right", "made"),
    [
        ("abc", 5, False, "abc  "), ("abc", 5, True, "  abc"), ("abcdef", 5, False, "abcde"),
        ("漢字", 5, False, "漢字 "), ("漢字", 5, True, " 漢字"), ("漢字漢", 5, False, "漢字 "),
    ],
)  # fmt: skip
def test_words_take_exactly_their_cells(words, width, right, made):
    assert fitted(words, width, right=right) == made


def test_numbers_of_a_row_are_written_anew_for_what_they_are_by_now_and_looked_at_once(table, monkeypatch):
    table.column_set = "statistics"
    table.lay_out()
    row, looked = table.session.table.row(HEAT), []
    monkeypatch.setattr(Facts, "detail", lambda self, name, of: looked.append(of) or self.details[name].get(of, nan))
    for most, words in ((2000.0, "1500"), (2.0, "1.500")):
        told = {"value": most * 0.75, "min": 0.0, "max": most, "mean": most / 2, "std": most / 8}
        table.session.table.facts = Facts(details={HEAT: told})
        table.session.live.readings[HEAT] = Reading(np.array([most]), {}, 50, 0, 0)
        looked.clear()
        pieces = table._pieces(row, row, None, table.laid)
        assert pieces[1][0].strip() == words
        assert looked.count("min") == 2  # for its own cell, and for how all are written
