"""A logger is made of parts, each of which works without the others, or with the few that it is given."""

import inspect

import numpy as np
import pytest

from silo.core.calls import of
from silo.core.elements import LoggerOptions
from silo.errors import ArgumentError, StateError
from silo.logger.arguments.other_names import OTHER_NAMES
from silo.logger.conditions import LoggerConditions
from silo.logger.life_cycle import LifeCycle
from silo.logger.logger import Logger
from silo.logger.registrations import Registrations
from silo.logger.run_data import RunData
from silo.logger.scripted_table import ScriptedTable
from silo.logger.unclosed import LoggerEnd

PARTS = {"_scripted": ScriptedTable, "_conditions": LoggerConditions, "_data": RunData}


@pytest.fixture
def parts(tmp_path):
    options = LoggerOptions(name="arm", frequency_hz=100, folder=str(tmp_path), script=str(tmp_path / "arm.yaml"))
    life = LifeCycle(options.name)
    table = Registrations(options.prefix)
    conditions = LoggerConditions(options, table, life)
    return life, table, conditions, ScriptedTable(options, table, conditions, life)


def test_a_table_is_filled_changed_and_scripted_without_a_logger(parts):
    _, table, _, scripted = parts
    scripted.array("q", 3, unit="rad")
    scripted.update()
    assert scripted.set("q", divider=5) == 1
    path = scripted.save_script()
    assert scripted.set("q", divider=1) == 1
    assert scripted.load_script(path) == []
    assert [(info.name, info.options.divider) for info in table.infos] == [("/log/q", 5)]


def test_conditions_are_checked_against_a_table_without_a_logger(parts):
    _, table, conditions, scripted = parts
    scripted.add(np.zeros(1), "tau", limits=(-40, -30, 30, 40))
    before = table.revision
    conditions.derive("double", "tau * 2")
    conditions.trigger("fall", "double > 1")
    assert table.revision > before
    assert [one.name for one in conditions.now.limits] == ["/log/tau"]
    assert [one.name for one in conditions.now.triggers] == ["fall"]
    conditions._remove_trigger("fall")
    assert conditions.now.triggers == ()


def test_what_a_life_cycle_forbids_no_part_does(parts):
    life, _, conditions, scripted = parts
    scripted.array("q", 3)
    scripted.update()
    life.running = True
    with pytest.raises(StateError, match="can't change elements while logger 'arm' runs"):
        scripted.set("q", divider=2)
    life.running = False
    conditions.derive("d", "q_z")
    conditions.trigger("t", "q_z > 1")
    conditions.limit("q_z", (None, None, 1, 2))
    life.ending, before = LoggerEnd.CLOSED, conditions.now
    for call in (
        lambda: scripted.array("x"),
        scripted.save_script,
        lambda: conditions.derive("e", "q_z"),
        lambda: conditions.derive("d", None),
        lambda: conditions.trigger("u", "q_z > 1"),
        lambda: conditions._remove_trigger("t"),
        lambda: conditions.limit("q_y", (None, None, 1, 2)),
        lambda: conditions._remove_limits("/log/q_z"),
    ):
        with pytest.raises(StateError, match="logger 'arm' is closed"):
            call()
    assert conditions.now is before


@pytest.mark.parametrize("attribute", PARTS)
def test_a_logger_has_what_it_hands_calls_on_to(attribute, new_logger):
    logger, kind = new_logger(), PARTS[attribute]
    assert type(getattr(logger, attribute)) is kind
    handed = {name for name, found in vars(kind).items() if inspect.isfunction(found) and not name.startswith("_")}
    mine = handed & vars(Logger).keys() - OTHER_NAMES.keys()
    assert mine
    assert all(inspect.unwrap(getattr(Logger, name)) is inspect.unwrap(getattr(kind, name)) for name in mine)


def test_a_call_that_is_handed_on_is_told_of_as_the_parts():
    class Whole:
        remove = of("_part", ScriptedTable.remove)
        _part = None

    assert inspect.signature(Whole.remove) == inspect.signature(ScriptedTable.remove)
    with pytest.raises(ArgumentError, match=r"log.remove\(\) needs name"):
        Whole().remove()
