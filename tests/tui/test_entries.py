"""The entries that widgets, filter, help, palette and command line are made from are whole and lead somewhere."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import Table
from silo.settings.typed import examples
from silo_tui.actions import BY_WORD, COMMANDS
from silo_tui.app import SiloApp
from silo_tui.commands.runner import CommandRunner
from silo_tui.keymap import in_bar, use_keys
from silo_tui.model.samples.live import LiveValues
from silo_tui.model.table.cells import Sight
from silo_tui.model.table.columns import (
    FILE_COLUMNS,
    FILE_SETS,
    FLAGS,
    LIVE_COLUMNS,
    LIVE_SETS,
    NAME_ROOM,
    in_set,
    laid_out,
    orders_of,
    shown_columns,
)  # fmt: skip
from silo_tui.model.table.facts import STATISTICS
from silo_tui.model.table.fields import Field
from silo_tui.model.table.filter import parse
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import TableState
from silo_tui.model.words.names import MIN_WIDTH, Told, among
from silo_tui.screens.table import TableScreen
from tests.stand_ins.fake_logger import FakeClient


@pytest.fixture
def table(robot):
    state = TableState()
    state.load(Table(1, robot))
    return state


def test_every_field_is_edited_in_one_column():
    assert sorted(column.field for column in LIVE_COLUMNS if column.field is not None) == list(Field)
    assert all(examples(column.field.option) for column in LIVE_COLUMNS if column.field is not None)


@pytest.mark.parametrize("columns", [LIVE_COLUMNS, FILE_COLUMNS])
def test_each_order_has_a_name_and_a_letter_of_its_own(columns):
    orders = [order for column in columns for order in column.orders]
    known = orders_of(columns)
    assert len(known) == len(orders) + 3
    assert len({order.letter for order in known.values()}) == len(known)


@pytest.mark.parametrize(("columns", "sets"), [(LIVE_COLUMNS, LIVE_SETS), (FILE_COLUMNS, FILE_SETS)])
def test_every_column_stands_in_a_set_that_its_table_has_or_is_that_of_an_order(columns, sets):
    for column in columns:
        assert any(in_set(column, name, wide=False) for name in sets) or column.gives(column.title), column.title
    for name in sets:
        assert in_set(next(column for column in columns if column.title == "value"), name, wide=False)


@pytest.mark.parametrize("columns", [LIVE_COLUMNS, FILE_COLUMNS])
def test_a_wide_screen_has_statistics_beside_settings_settings_beside_timing_and_neither_the_other_way(columns):
    for column in columns:
        alone, others = ("timing", "settings") if column.measured else ("statistics", "timing")
        assert in_set(column, alone, wide=True) is (alone in column.sets), column.title
        comes = ("wide" if column.measured else "settings") in column.sets
        assert in_set(column, others, wide=True) is (comes or others in column.sets), column.title


@pytest.mark.parametrize("order", orders_of(LIVE_COLUMNS))
def test_every_order_shows_every_element_once(table, order):
    rows = RowList(table)
    rows.sort = order
    rows.refresh()
    assert sorted(rows.shown) == list(range(len(table)))


STEADY = [column for column in LIVE_COLUMNS if not column.measured]


def _sight(table):
    return Sight(table, LiveValues(), lambda row: 0, lambda row: "")


@pytest.mark.parametrize("column", STEADY, ids=lambda column: column.title)
def test_every_cell_fits_its_column(table, column):
    most = [1, 2**31 - 1, 0, 0, 2**31 - 1]
    for field, value in zip(Field, most, strict=True):
        table.edit(np.arange(len(table)), field, value)
    for row in range(len(table)):
        words, _ = column.draw(_sight(table), row, column.width)
        assert len(words) <= column.width, row


def _widths(columns, table):
    return [(column, column.width_in(_sight(table), 80)) for column in columns]


@pytest.mark.parametrize("names", [NAME_ROOM, 30])
@pytest.mark.parametrize("width", range(20, 160, 3))
def test_whole_columns_are_left_out_in_their_order_until_names_have_room(table, width, names):
    shown = shown_columns(_widths(LIVE_COLUMNS, table), width, names)
    titles = [column.title for column, _ in shown]
    orders = [column.leaves for column in LIVE_COLUMNS if column.leaves]
    left_out = [column.leaves for column in LIVE_COLUMNS if column.title not in titles]
    assert len(set(orders)) == len(orders)
    assert sorted(left_out) == sorted(orders)[: len(left_out)]
    room = width - sum(1 + cells for _, cells in shown)
    assert room >= names or not [column for column, _ in shown if column.leaves]


def test_statistics_give_way_before_the_unit_and_the_ends_of_the_values_last(table):
    gone: list[str] = []
    for names in range(10, 80):
        shown = shown_columns(_widths([each for each in LIVE_COLUMNS if "statistics" in each.sets], table), 80, names)
        gone += [each for each in ("min", "max", "mean", "std", "unit") if each not in {c.title for c, _ in shown}]
    assert list(dict.fromkeys(gone)) == ["std", "mean", "max", "min", "unit"]


def test_what_is_measured_keeps_its_unit_where_it_is_ordered_by(table):
    for columns, kept in ((STEADY, False), (LIVE_COLUMNS, True)):
        shown = [column.title for column, _ in shown_columns(_widths(columns, table), 30, 16, "std")]
        assert ("unit" in shown) == ("std" in shown) == kept


@given(st.integers(20, 200), st.integers(8, 60), st.sampled_from(LIVE_SETS), st.sampled_from(["name", "std", "value"]))
def test_names_and_columns_share_the_whole_width_and_names_are_whole_before_statistics_are_wide(
    width, longest, chosen, sort
):
    sight = _sight(TableState())
    columns = [each for each in LIVE_COLUMNS if each.gives(sort) or in_set(each, chosen, wide=width > 140)]
    told = Told("", among(("x" * longest,)))
    laid = laid_out(width, told, columns, sight, sort, 17, [1, 7, 12])
    shown = {each.title: cells for each, cells in (*laid.steady, *laid.measured)}
    taken = FLAGS + laid.names + sum(1 + cells for cells in shown.values())
    assert taken == width - 1 or (laid.names == MIN_WIDTH and taken >= width - 1)
    assert sum(1 + cells for _, cells in laid.measured) == width - 1 - laid.rest
    assert {each.title for each in columns} == {*shown, *laid.left_out}
    if any(shown.get(each, 8) > 8 for each in STATISTICS) or shown.get("value", 11) > 11:
        assert laid.names >= min(longest, width // 2)
    assert laid.names <= longest or all(shown.get(each, 11) == 11 for each in STATISTICS)
    assert shown.get("unit", 5) in (5, 7, 8, 12)


@pytest.mark.parametrize("column", [column for column in LIVE_COLUMNS if column.terms], ids=lambda column: column.title)
def test_every_completed_term_can_be_read(column):
    for term in column.terms:
        assert not any(parse(words).problems for words in term.completions)


def test_every_typed_word_belongs_to_one_command():
    words = [word for command in COMMANDS if command.typed for word in command.typed.words]
    assert sorted(words) == sorted(BY_WORD)


def test_a_command_without_keys_can_be_typed_and_is_carried_out():
    for command in COMMANDS:
        if not command.scopes:
            assert command.typed is not None, command.id
            assert any(hasattr(kind, command.method) for kind in (CommandRunner, TableScreen, SiloApp)), command.id


WRITES = """
acknowledge alarm_limits alarm_new alarm_remove apply arm_trigger default_parameter delete_recording derive edit
edit_all edit_divider edit_size episode episode_bad episode_good episode_redo excite forget_derived limits_of_row
load_into_loggers load_preset load_script new_of_row next_action next_buffer plot_trigger record restart
restart_loggers restore save_data save_loggers save_script set set_marker start_stop start_stop_loggers stop_recording
toggle trigger_edit trigger_force trigger_new trigger_remove trigger_toggle turn_down turn_far_down turn_far_up
turn_plotted_down turn_plotted_up turn_up type_parameter
"""
# they edit the table alone, or ask other loggers than the one that is open
NEED_NO_LINK = """
edit edit_all edit_divider edit_size load_into_loggers next_action next_buffer restart_loggers save_loggers set
start_stop_loggers toggle
"""


def test_what_changes_something_is_refused_who_only_looks_and_needs_a_link_unless_it_edits_the_table():
    assert [one.id for one in sorted(COMMANDS, key=lambda one: one.id) if one.writes] == WRITES.split()
    asking = {one.id for one in COMMANDS if one.asks}
    assert set(WRITES.split()) - asking == set(NEED_NO_LINK.split())
    looking = asking - set(WRITES.split())
    assert " ".join(sorted(looking)) == "catch control fetch_recording list_read parameters recordings refresh try_link"
    assert {one.id for one in COMMANDS if one.retries} == {"list_read", "refresh", "try_link"}


BARS = {
    ("two-layer", "table"): "mark monitor fold filter menu_edit menu_go menu_view menu_record sort apply undo "
    "start_stop save_data again back help command quit mark_shown",
    ("two-layer", "monitor"): "pause detail add_plot closer cursor_left earlier later newest find menu_plots "
    "menu_go menu_view menu_record apply start_stop export_plots again back arrange_plots help command quit",
    ("two-layer", "detail"): "pause add_plot closer cursor_left earlier later newest find menu_plots menu_go "
    "menu_view menu_record apply start_stop export_plots again back mode detail_refresh help command quit",
    ("two-layer", "triggers"): "list_mark trigger_capture trigger_toggle trigger_new plot_conditions list_filter "
    "menu_edit menu_go menu_view menu_record list_order apply start_stop trigger_remove again back help command quit",
    ("two-layer", "file"): "mark plot fold filter menu_go menu_view sort again back help command quit mark_shown",
    ("classic", "table"): "mark filter sort fold edit apply monitor start_stop save_data help command quit mark_shown "
    "toggle undo",
    ("classic", "monitor"): "pause closer cursor_left find scale detail cursor_b earlier start_stop later "
    "arrange_plots newest all_held add_plot drop_plot help export_plots command quit",
    ("classic", "detail"): "pause mode closer level cursor_left find scale cursor_b earlier detail_refresh later "
    "detail_swap newest all_held add_plot help export_plots command quit",
    ("classic", "alarms"): "acknowledge list_mark alarm_worst alarm_limits alarm_new alarm_remove plot_conditions "
    "list_filter list_order help command quit",
    ("classic", "recordings"): "open_recording list_mark fetch_recording overlay_recording delete_recording record "
    "stop_recording compare_runs list_filter list_order help command quit",
}


@pytest.mark.parametrize(("keys", "scope"), BARS)
def test_the_bar_of_a_screen_names_first_what_one_is_there_for(keys, scope):
    use_keys(keys, {})
    assert " ".join(command.id for command, _ in in_bar(scope, read_only=False)) == BARS[keys, scope]


@pytest.mark.parametrize("scope", ["table", "monitor", "alarms", "recordings"])
def test_a_key_that_a_user_gave_a_command_stands_in_the_bar_where_its_own_stood(scope):
    before = in_bar(scope, read_only=False)
    own = {command.id: f"f{at}" for at, (command, _) in enumerate(before, 1) if " " not in command.keys.split(",")[0]}
    use_keys("two-layer", own)
    after = in_bar(scope, read_only=False)
    assert [(command.id, rank) for command, rank in after] == [(command.id, rank) for command, rank in before]
    shown = {command.id: command.footer_key for command, _ in after}
    assert {each: shown[each] for each in own} == {each: key.upper() for each, key in own.items()}


async def test_every_argument_that_can_be_completed_has_its_choices(fake, opened):
    fake.derive("hot", "imu/temperature > 3")
    Path("logs").mkdir()
    async with opened(fake) as screen:
        runner = CommandRunner(screen.app.context)
        screen.app.context.learn_scripts()
        await screen.until(lambda: screen.app.context.script_names)
        for command in COMMANDS:
            if command.typed is not None and command.typed.completes:
                assert runner.choices(command), command.id


async def test_a_typed_command_that_writes_is_refused_as_its_key_is(new_fake, opened):
    fake: FakeClient = new_fake()
    async with opened(fake, size=(120, 30), read_only=True) as screen:
        for line in ("set div=5", "load quiet.yaml", "data silo", "start"):
            CommandRunner(screen.app.context).run(line)
            await screen.shows("this is read-only")
            screen.app.context.say("")
        assert (fake.calls, screen.session.table.pending_count) == ([], (0, 0))


async def test_the_name_of_a_vector_tells_which_entry_is_shown_alone(screen, ran_s=12):
    await screen.enter(":goto base/position")
    await screen.do("component", "component")  # the norm, then its first entry
    screen.app.screen.show_set("statistics")
    await screen.shows("/base/position_x ")
    await screen.do("component", shows="/base/position_y ")
    assert "/base/position_x" not in screen.text
    await screen.do("component", "component")
    await screen.until(lambda: "/base/position " in screen.text and "/base/position_" not in screen.text)
