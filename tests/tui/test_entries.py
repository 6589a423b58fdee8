"""The entries that widgets, filter, help, palette and command line are made from are whole and lead somewhere."""

from pathlib import Path

import numpy as np
import pytest

from silo.core.elements import Table
from silo.settings.typed import examples
from silo_tui.actions import BY_WORD, COMMANDS
from silo_tui.app import SiloApp
from silo_tui.commands.runner import CommandRunner
from silo_tui.model.samples.live import LiveValues
from silo_tui.model.table.cells import Sight
from silo_tui.model.table.columns import (
    FILE_COLUMNS,
    FILE_SETS,
    LIVE_COLUMNS,
    LIVE_SETS,
    NAME_ROOM,
    in_set,
    orders_of,
    shown_columns,
)  # fmt: skip
from silo_tui.model.table.fields import Field
from silo_tui.model.table.filter import parse
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import TableState
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
def test_every_column_stands_in_a_set_that_its_table_has(columns, sets):
    for column in columns:
        assert any(in_set(column, name, wide=False) for name in sets), column.title
    for name in sets:
        assert in_set(next(column for column in columns if column.title == "value"), name, wide=False)


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


@pytest.mark.parametrize("width", range(20, 80))
def test_whole_columns_are_left_out_in_their_order_until_names_have_room(table, width):
    shown = [column for column, _ in shown_columns(STEADY, _sight(table), width, width)]
    left_out = [column.leaves for column in STEADY if column not in shown]
    assert sorted(left_out) == list(range(1, len(left_out) + 1))
    room = width - sum(1 + column.width for column in shown)
    assert room >= NAME_ROOM or not [column for column in shown if column.leaves]


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
            assert any(hasattr(kind, f"command_{command.id}") for kind in (CommandRunner, TableScreen, SiloApp)), (
                command.id
            )


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
