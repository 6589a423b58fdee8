"""Plots one below the other, without an app: titles, cursors, the axis, which are there, what a click means."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.style import Style

from silo.core.arrays.columns import ColumnStore, Gap, HistoryColumns
from silo.core.elements import ElementInfo, LoggedEvent
from silo_tui.model.drawing.plots import plots_of
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.picture import AXIS
from silo_tui.model.samples.live import Reading
from silo_tui.screens.plots.monitor import MonitorScreen
from silo_tui.widgets.plot_stack import PlotStack
from tests.stand_ins.desk import Drawn
from tests.stand_ins.fake_signals import scalar, vector

WIDTH, COLUMN_NS = 60, 100_000_000


class Stack(Drawn, PlotStack):
    """Plots of signals that each rise from 0 to 10."""

    width, height = WIDTH, 14

    def __init__(self, *elements: ElementInfo) -> None:
        self.off: set[str] = set()
        self.posted: list[Any] = []
        self.lines_painted: list[int] = []
        source = SimpleNamespace(
            live=True,
            happened=[],
            end_ns=10**10,
            period_ns=lambda _: COLUMN_NS,
            is_live=lambda name: name not in self.off,
        )
        super().__init__(plots_of(list(elements)), PlotWindow(), source)  # type: ignore[arg-type]
        self.post_message = self.posted.append  # type: ignore[method-assign, assignment]
        self.prefix = "/log"
        self.fill()

    @property
    def app(self) -> Any:
        console = SimpleNamespace(color_system="truecolor")
        return SimpleNamespace(no_color=False, console=console, current_theme=SimpleNamespace(dark=True))

    def _style(self, *names: str) -> Style:
        return Style(color=f"#{sum(map(ord, names[0])):06x}")

    def refresh(self, *regions: Any, **_: Any) -> Any:
        self.lines_painted += [region.y for region in regions] or [-1]
        return self

    def fill(self, count: int | None = None) -> None:
        names = tuple(plotted.name for plotted in self.plots)
        count = count or self.columns
        self.store = ColumnStore(names, count, COLUMN_NS)
        ramp = np.tile(np.linspace(0.0, 10.0, count), (len(names), 1))
        self.store.take(HistoryColumns(names, 0, COLUMN_NS, ramp, ramp))
        self.redraw()

    def share(self, *places: tuple[int, ...]) -> "Stack":
        """Have signals share panels."""
        plots = list(self.plots)
        self.show_panels([tuple(plots[at] for at in panel) for panel in places])
        self.fill()
        return self

    @property
    def text(self) -> list[str]:
        return [self.render_line(y).text for y in range(self.height)]


HEAT, ON = scalar("/log/imu/temperature", "degC"), scalar("/log/state/on", "-", dtype="|b1")
POSITION = vector("/log/base/position", "m")


@pytest.fixture
def stack():
    return Stack(HEAT, ON, POSITION)


# ------------------------------------------------------------------------------------------------------ what is drawn


def test_one_signal_alone_has_no_letter_and_more_room():
    stack = Stack(HEAT)
    assert stack.text[0].startswith(">/imu/temperature degC")
    assert (stack.right_width, stack.plot_width) == (2, WIDTH - AXIS - 2)
    assert stack.text[1][-2:] == "  "


@pytest.mark.parametrize(
    ("change", "width"),
    [
        (lambda stack: None, 2),
        (lambda stack: setattr(stack, "level", 1.0), 8),
        (lambda stack: setattr(stack, "bounds", {HEAT.name: (None, None, 9.0, None)}), 8),
        (lambda stack: setattr(stack, "bounds", {"/log/other": (None, None, 9.0, None)}), 2),
        (lambda stack: setattr(stack, "ghost", stack.store), 4),
    ],
)
def test_right_of_curves_there_is_room_for_what_stands_there(change, width):
    stack = Stack(HEAT)
    change(stack)
    assert stack.right_width == width


def test_what_is_off_says_how_it_is_switched_on(stack):
    stack.off = {HEAT.name}
    stack.redraw()
    assert stack.text[0].rstrip() == ">a /imu/temperature degC"
    assert stack.text[1].rstrip() == " " * AXIS + " off: e t in the table switches it on"
    assert not stack.text[2].strip()


def test_signals_that_share_a_plot_have_their_names_side_by_side_with_letters_in_their_colours():
    stack = Stack(HEAT, POSITION).share((0,), (1, 2, 3))
    stack.choose(2)
    found = [line.rstrip() for line in stack.text if "/base/position" in line]
    assert [line.split()[:2] for line in found] == [
        ["b", "/base/position_x"], [">c", "/base/position_y"], ["d", "/base/position_z"],
    ]  # fmt: skip
    assert all(line.split()[-1] == "m" for line in found)
    stack.width = 80
    stack.fill()
    found = [line.rstrip() for line in stack.text if "/base/position" in line]
    assert [line.count("/base/position") for line in found] == [2, 1]
    assert found[0].index(">c /base/position_y") == 40
    heads = [stack._title(1, 0)[at].style.color for at in (0, 4)]
    assert len(set(heads)) == 2
    stack.fresh = False
    assert len({stack._title(1, 0)[at].style.color for at in (0, 4)}) == 1


def test_names_beside_one_another_share_the_whole_line_and_say_of_when_their_numbers_are_where_that_has_room():
    stack = Stack(HEAT, scalar("/log/imu/heat", "degC"))
    stack.width = 160
    stack.share((0, 1))
    assert stack.text[0].rstrip() == f"{'>a /imu/temperature now - degC':80}{' b /imu/heat now - degC'}"
    stack.window.cursor = 4
    stack.redraw()
    told = " ".join(re.sub(r"[\d.…]+", "#", stack.text[0]).split())
    assert told == ">a /imu/temperature at cursor # degC b /imu/heat at cursor # degC"
    stack.width = 80
    stack.redraw()
    assert ">a /imu/temperature at" not in stack.text[0] and " degC" in stack.text[0]


def test_a_long_name_gives_way_to_the_numbers_and_stays_apart_from_the_others():
    long = [scalar(f"/log/{'very/' * 12}deep/{end}", "Nm") for end in ("one", "two")]
    lines = Stack(*long).text
    titles = [line for line in lines if "max 10" in line]
    assert [len(line) for line in titles] == [WIDTH, WIDTH]
    assert "one" in titles[0] and "two" in titles[1]


def test_the_newest_value_stands_at_the_end_of_a_title():
    stack = Stack(HEAT)
    stack.readings = {HEAT.name: Reading(np.array([3.25]), {}, 1, 0, 0)}
    assert "now 3.25" in stack.text[0]
    stack.ended = True
    stack.redraw()
    assert stack.text[-1].rstrip().endswith("end")


def test_a_span_is_told_of_a_signal(stack):
    assert stack.span_of(stack.plots[0]) == (0.0, 10.0)
    assert stack.scale_of_first() == (0.0, 10.0)
    stack.store = ColumnStore((), 1, 1)
    stack.redraw()
    assert stack.span_of(stack.plots[0]) == (0.0, 0.0)
    assert stack.missing() == ""


def test_what_is_missing_is_told_of_the_chosen_plot_else_of_another_that_is_shown():
    stack = Stack(HEAT, POSITION)
    names = tuple(plotted.name for plotted in stack.plots)
    low = np.ones((len(names), stack.columns))
    marks = np.zeros(low.shape, np.uint8)
    for row, begin, hole, told in ((1, 40, Gap.LOST, "░ 2 s lost"), (0, 0, Gap.BEFORE, "2 s before the start")):
        low[row, begin : begin + 20], marks[row, begin : begin + 20] = np.nan, int(hole) << 4
        stack.store = ColumnStore(names, stack.columns, COLUMN_NS)
        stack.store.take(HistoryColumns(names, 0, COLUMN_NS, low, low, marks))
        assert stack.missing() == told
    assert stack.missing(before=False) == "░ 2 s lost"


# --------------------------------------------------------------------------------------------------- cursors, events


def column_of(line: str, sign: str) -> list[int]:
    return [at - AXIS - 1 for at, char in enumerate(line) if char == sign and at > AXIS]


@pytest.mark.parametrize(("cursor", "cell"), [(0, -1), (1, -1), (2, -2), (40, -21)])
def test_the_cursor_stands_where_no_curve_is(cursor, cell):
    stack = Stack(HEAT)
    stack.window.cursor = cursor
    stack.redraw()
    line = stack.text[1 if cursor > 20 else 8]
    assert column_of(line, "│")[-1] == stack.plot_width + cell


def test_both_cursors_have_their_letters_below():
    stack = Stack(HEAT)
    stack.window.cursor = 14
    stack.redraw()
    assert "A" not in stack.text[-1]
    stack.window.other_ns = (stack.store.end - 1 - 60) * COLUMN_NS
    stack.redraw()
    assert stack.other_cursor == 60
    assert (stack.text[-1].index("A") - AXIS - 1, stack.text[-1].index("B") - AXIS - 1) == (
        stack.plot_width - 8,
        stack.plot_width - 31,
    )
    assert column_of(stack.text[1], "┊") == [stack.plot_width - 31]


@pytest.mark.parametrize(
    ("columns_ago", "there", "told"),
    [(0, True, "B"), (1, True, "B"), (-1, False, "B→"), (95, True, "B"), (96, False, "←B")],
)
def test_cursor_b_is_in_the_picture_or_on_the_side_that_is_told(columns_ago, there, told):
    stack = Stack(HEAT)
    assert stack.columns == 96
    stack.window.other_ns = (stack.store.end - 1 - columns_ago) * COLUMN_NS
    assert (stack.other_cursor is not None) is there
    assert re.findall("←?B→?", stack.text[-1]) == [told]
    assert stack.text[-1].strip().startswith(told) or not told.startswith("←")
    stack.window.at_ns = stack.window.other_ns  # A is where B is, in what is drawn now
    stack.fill(60)
    assert stack.text
    assert stack.window.cursor == stack.other_cursor
    stack.store = ColumnStore((), 1, 1)
    assert stack.other_cursor is None


def test_what_happened_is_a_line_in_the_plots_of_its_time(stack):
    at_ns = (stack.store.end - 21) * COLUMN_NS
    stack.source.happened = [LoggedEvent("marker", "fell", at_ns, 0, at_ns, "ann", "run1", 1)]
    stack.redraw()
    cell = stack.plot_width - 11
    assert {line[AXIS + 1 + cell] for line in stack.text[1:2]} == {"╎"}
    assert stack.text[-1][AXIS + 1 + cell] != " "
    stack.window.cursor = 20
    stack.redraw()
    assert stack.text[1][AXIS + 1 + cell] == "│"
    stack.window.cursor = None
    at_ns -= 20 * COLUMN_NS
    stack.source.happened.append(LoggedEvent("marker", "up", at_ns, 0, at_ns, "ann", "run1", 2))
    stack.redraw()
    assert [at - AXIS - 1 for at, char in enumerate(stack.text[1]) if char == "╎"] == [cell - 10, cell]


GAIT = scalar("/log/state/gait", dtype="<i4", labels={0: "stand", 1: "walk"})
OPERATOR = scalar("/log/state/operator", dtype="|S16")


def test_of_words_it_is_drawn_since_when_which_is_and_which_is_now():
    stack = Stack(GAIT, OPERATOR)
    steps = np.tile(np.repeat([0.0, 1.0], stack.columns // 2), (2, 1))
    names = GAIT.name, OPERATOR.name
    stack.store = ColumnStore(names, stack.columns, COLUMN_NS)
    stack.store.take(HistoryColumns(names, 0, COLUMN_NS, steps, steps))
    stack.redraw()
    assert stack.text[0].rstrip() == ">a /state/gait                                        now -"
    assert stack.text[1].rstrip() == f"        a │{'stand':<21}│{'walk':<20}│-"
    assert stack.text[3].rstrip() == f"        b │{'':<42}│"
    stack.readings = {
        GAIT.name: Reading(np.array([1.0]), {}, 1, 0, 0),
        OPERATOR.name: Reading(np.array([np.nan]), {0: "ann of the lab"}, 1, 0, 0),
    }
    stack.redraw()
    assert stack.text[1].rstrip().endswith("│walk")
    assert stack.text[3].rstrip() == f"        b │{'ann of the lab':<42}│ann o…"
    at_ns = (stack.store.end - 2 * (stack.plot_width - 3) + 1) * COLUMN_NS  # below the blank of `ann of`
    stack.source.happened = [LoggedEvent("marker", "fell", at_ns, 0, at_ns, "ann", "run1", 1)]
    stack.redraw()
    assert (stack.text[1][AXIS + 4], stack.text[3][AXIS + 1 : AXIS + 15]) == ("n", "ann of the lab")
    at_ns += 2 * (20 - 3) * COLUMN_NS
    stack.source.happened = [LoggedEvent("marker", "fell", at_ns, 0, at_ns, "ann", "run1", 2)]
    stack.redraw()
    assert stack.text[3].index("╎") == AXIS + 1 + 20
    stack.source.happened = []
    stack.events = {OPERATOR.name: [(0, "bob"), (6 * 10**9, "ann of the lab")]}
    stack.redraw()
    assert stack.text[3].startswith("        b │bob  ")
    assert "│ann of the…│" in stack.text[3]


def test_a_curve_alone_has_the_colour_of_curves_and_several_each_their_own():
    stack = Stack(HEAT, POSITION).share((0,), (1, 2, 3))
    alone = {one.style.color for one in stack._line(3) if one.text.strip("│┤ ") and one.style.color}
    assert stack._style("plot--line").color in alone
    shared = {one.style.color for y in range(8, 13) for one in stack._line(y)}
    assert stack._style("plot--line").color not in shared
    stack.fresh = False
    stack.redraw()
    assert stack._style("plot--stale").color in {one.style.color for one in stack._line(3)}


# ------------------------------------------------------------------------------------- which are there, which is chosen


def test_where_not_all_have_room_the_chosen_one_is_on_the_screen(stack):
    assert (stack.fitting, [each.name[-1] for each in stack.on_screen()]) == (3, ["e", "n", "x"])
    assert stack.choose(4) is True
    assert (stack.first, stack.fitting, stack.chosen_panel) == (2, 3, 4)
    assert [line[0] for line in stack.text if "position" in line] == [" ", " ", ">"]
    assert stack.choose(3) is False
    assert [line[0] for line in stack.text if "position" in line] == [" ", ">", " "]
    assert stack.choose(99) is False
    assert stack.chosen == 4
    assert stack.choose(-5) is True
    assert (stack.chosen, stack.first) == (0, 0)


def test_of_another_choice_only_the_lines_of_both_are_painted(stack):
    assert stack.text
    stack.lines_painted.clear()
    stack.choose(2)
    assert stack.lines_painted == [0, 8]


def test_new_columns_paint_what_looks_different_alone(stack):
    assert stack.text
    stack.lines_painted.clear()
    stack.advance()
    assert stack.lines_painted == []
    end = stack.store.end
    stack.store.advance_to(end + 1)
    stack.advance()
    assert stack.store.end == end + 2  # whole cells
    assert set(stack.lines_painted) >= {1, 2, 3, 4, 5, 7}
    assert 13 not in stack.lines_painted


def test_lines_are_drawn_anew_for_another_size(stack):
    before = stack.text
    stack.width = 70
    assert [len(line) for line in stack.text] == [70] * 14
    assert stack.text != before


def test_what_is_taken_away_leaves_the_chosen_one_chosen(stack):
    stack.choose(2)
    stack.keep([each for each in stack.plots if each.element is not ON])
    assert [len(panel) for panel in stack.panels] == [1, 1, 1, 1]
    assert stack.chosen_plot.name.endswith("position_x")
    stack.keep([stack.plots[0], *plots_of([ON])])
    assert [each.name for each in stack.plots] == [HEAT.name, ON.name]
    assert stack.chosen == 1


def test_a_large_plot_shows_the_chosen_signal_those_beside_it_and_the_others():
    stack = Stack(HEAT, POSITION, ON).share((0,), (1, 2, 3), (4,))
    stack.choose(2)
    shown, mine = stack.for_detail()
    assert ([each.name[-2:] for each in shown], mine) == (["_y", "_x", "_z", "re", "on"], 3)
    stack.off = {POSITION.name}
    shown, mine = stack.for_detail()
    assert ([each.name[-2:] for each in shown], mine) == (["re", "on"], 1)


# ------------------------------------------------------------------------------------------------------------ the mouse


def click(stack: Stack, x: int, y: int) -> tuple[int, int | None] | None:
    stack.posted.clear()
    stack.on_click(SimpleNamespace(x=x, y=y))  # type: ignore[arg-type]
    return (stack.posted[0].index, stack.posted[0].column) if stack.posted else None


def test_a_click_chooses_a_plot_and_where_its_cursor_stands(stack):
    last = AXIS + stack.plot_width
    assert click(stack, 20, 0) == (0, None)  # a title
    assert click(stack, last, 1) == (0, 0)
    assert click(stack, last - 1, 1) == (0, 2)
    assert click(stack, last + 1, 1) == (0, None)
    assert click(stack, AXIS + 1, 5) == (0, 2 * (stack.plot_width - 1))
    assert click(stack, AXIS, 5) == (0, None)
    assert click(stack, last, 7) == (1, 0)
    assert click(stack, last, 12) == (2, 0)
    assert click(stack, last, 13) is None  # the time axis


def test_a_click_on_a_name_of_several_chooses_that_one_and_on_the_curve_keeps_it():
    stack = Stack(HEAT, POSITION).share((0,), (1, 2, 3))
    stack.width = 80
    stack.fill()
    top = next(at for at, line in enumerate(stack.text) if "position_x" in line)
    assert [click(stack, x, top + line) for line, x in ((0, 0), (0, 39), (0, 40), (1, 0), (1, 79))] == [
        (1, None), (1, None), (2, None), (3, None), (3, None),
    ]  # fmt: skip
    assert click(stack, AXIS + stack.plot_width, top + 3) == (1, 0)
    stack.choose(3)
    assert click(stack, AXIS + stack.plot_width, top + 3) == (3, 0)


@pytest.mark.parametrize("ctrl", [True, False])
def test_the_wheel_goes_on_or_zooms(ctrl, stack):
    stopped: list[bool] = []
    event: Any = SimpleNamespace(ctrl=ctrl, stop=lambda: stopped.append(True))
    stack.on_mouse_scroll_down(event)
    stack.on_mouse_scroll_up(event)
    assert [(each.step, each.zooms) for each in stack.posted] == [(1, ctrl), (-1, ctrl)]
    assert len(stopped) == 2
    done: list[str] = []
    for each in stack.posted:
        MonitorScreen.on_plot_stack_wheeled(SimpleNamespace(action_command=done.append), each)  # type: ignore[arg-type]
    assert done == (["wider", "closer"] if ctrl else ["plot_down", "plot_up"])


def test_another_size_and_another_margin_are_told():
    stack = Stack(HEAT)
    stack.on_resize()
    stack.bounds = {HEAT.name: (None, None, 9.0, None)}
    stack.redraw()
    stack.redraw()
    assert [type(each) for each in stack.posted] == [PlotStack.Resized] * 2
