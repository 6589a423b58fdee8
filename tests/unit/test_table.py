"""The element table: names, namespaces, edits as one transaction, and the revision that tells of every change."""

import pytest

from silo.core.elements import (
    MAX_BUFFER_SIZE,
    MAX_DIVIDER,
    Edit,
    ElementInfo,
    ElementOptions,
    Entry,
)
from silo.errors import ElementError
from silo.logger.registrations import Registrations
from silo.loop.plan import Element
from silo.settings.options import option_problems


def element(name, suffixes=("",)):
    entries = tuple(Entry(suffix, "<f8") for suffix in suffixes)
    return Element(ElementInfo(name, "-", "scalar", (), entries, ElementOptions(size=10)), ())


@pytest.fixture
def table():
    made = Registrations("/log")
    for name in ("/log/arm/q", "/log/arm/tau", "/log/armor", "/log/leg/q"):
        made.add(element(name))
    made.adopt()
    return made


def test_adopting_is_one_new_revision(table):
    before = table.revision
    table.add(element("/log/a"))
    table.add(element("/log/b"))
    table.adopt()
    assert table.revision == before + 1


def test_adopting_nothing_is_no_new_revision(table):
    before = table.revision
    table.adopt()
    assert table.revision == before


def test_an_unknown_name_gets_the_nearest_one_and_an_unknown_namespace_is_refused(table):
    with pytest.raises(ElementError, match="no element 'arm/tua'; did you mean '/log/arm/tau'"):
        table.place("arm/tua")
    with pytest.raises(ElementError, match="no element or namespace 'wing'"):
        table.select("wing")


def test_a_name_that_waits_for_update_is_told_of(table):
    table.add(element("/log/new"))
    with pytest.raises(ElementError, match=r"update\(\) does while the logger stands still"):
        table.place("new")


@pytest.mark.parametrize(
    ("name", "places"),
    [
        ("/", [0, 1, 2, 3]),
        ("", [0, 1, 2, 3]),
        ("/log/arm", [0, 1]),
        ("arm/", [0, 1]),
        ("/log", [0, 1, 2, 3]),
        ("/log//arm//q/", [0]),
        ("leg", [3]),
    ],
)
def test_a_namespace_is_every_element_below_it(table, name, places):
    assert table.select(name) == places


def test_a_change_is_one_new_revision_and_one_to_the_same_options_is_none(table):
    before = table.revision
    assert table.change({0: table.infos[0].options}) == 0
    assert table.revision == before
    assert table.change({0: ElementOptions(divider=2), 1: ElementOptions(divider=2)}) == 2
    assert table.revision == before + 1


def test_a_change_with_one_bad_value_changes_nothing(table):
    before = table.infos
    with pytest.raises(ElementError, match="element '/log/arm/tau': divider must be a whole number from 1"):
        table.change({0: ElementOptions(divider=2), 1: ElementOptions(divider=0)})
    assert table.infos == before


@pytest.mark.parametrize(
    ("options", "field", "words"),
    [
        ({"divider": 0}, "divider", f"divider must be a whole number from 1 to {MAX_DIVIDER}, got 0"),
        ({"divider": -3}, "divider", "got -3"),
        ({"divider": MAX_DIVIDER + 1}, "divider", f"got {MAX_DIVIDER + 1}"),
        ({"divider": 2.0}, "divider", "got 2.0"),
        ({"divider": True}, "divider", "got True"),
        ({"size": 0}, "size", f"size must be a whole number from 1 to {MAX_BUFFER_SIZE}, got 0"),
        ({"action": 7}, "action", "action must be save (1), both (0) or publish (2), got 7"),
        ({"buffer": "LOOPING"}, "buffer", "must be looping (1), fixed (0) or growing (2), got 'LOOPING'"),
        ({"enabled": 1}, "enabled", "enabled must be on or off, got 1"),
    ],
)
def test_a_value_out_of_range_is_named_with_its_field_and_range(options, field, words):
    (problem,) = option_problems("/x", ElementOptions(**options))
    assert problem.field == field
    assert words in problem.reason


def test_edits_of_unknown_elements_and_twice_of_one_are_problems(table):
    good = ElementOptions(size=3)
    edits = [Edit("/log/leg/q", good), Edit("/log/leg/q", good), Edit("/log/gone", good)]
    assert [(problem.name, problem.reason) for problem in table.problems(edits)] == [
        ("/log/leg/q", "edited twice in one transaction"),
        ("/log/gone", "the table has no such element"),
    ]


def test_every_field_that_is_wrong_is_a_problem_of_its_own(table):
    edits = [Edit("/log/leg/q", ElementOptions(divider=0, size=0))]
    assert [problem.field for problem in table.problems(edits)] == ["divider", "size"]


def test_edits_are_applied_in_one_revision(table):
    before = table.revision
    edits = [Edit(info.name, ElementOptions(divider=5, size=3)) for info in table.infos]
    assert table.apply(edits) == 4
    assert table.revision == before + 1
    assert {info.options.divider for info in table.infos} == {5}


def test_a_released_table_keeps_its_rows(table):
    before = table.infos
    table.release()
    assert table.infos == before
    assert all(element.parts == () for element in table.elements)
