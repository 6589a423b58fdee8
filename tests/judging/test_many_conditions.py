"""As many conditions as there may be are checked at once, in a time that grows with them and with the table alone."""

from types import SimpleNamespace

import msgspec
import pytest

from silo.core.conditions import Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import BufferType, Edit, ElementInfo, ElementOptions, Entry, FileType
from silo.core.names import Names
from silo.errors import ElementError
from silo.expressions import derived_signals
from silo.expressions.binding import Catalogue, Known, ScalarPlace, bind
from silo.judging import checks
from silo.judging.checks import MOST_DERIVED, MOST_LIMITS, MOST_TRIGGERS
from silo.judging.switched_off import without_off
from silo.settings.options import MAX_PROBLEMS
from silo.settings.script_conditions import checked_conditions, fitting_conditions
from silo.state.server import fitting

NAMES = [f"/log/e{at}" for at in range(MOST_LIMITS)]
TABLE = [
    ElementInfo(
        name=name, unit="-", kind="SCALAR", shape=(), entries=(Entry("", "<f8"),), options=ElementOptions(size=1000)
    )
    for name in NAMES
]
ALL = Conditions(
    tuple(Derived(f"/log/d{at}", f"e{at} + 1") for at in range(MOST_DERIVED)),
    tuple(SignalLimits(name, bounds=(None, None, 1.0, 2.0)) for name in NAMES),
    tuple(TriggerOptions(f"t{at}", f"e{at} > 1") for at in range(MOST_TRIGGERS)),
)


@pytest.fixture
def counted(monkeypatch):
    """How often an expression is bound, and how often the names of the table are gone through."""
    found = {"bound": 0, "tables": 0}

    def bind(text, catalogue, bound=checks.bind):
        found["bound"] += 1
        return bound(text, catalogue)

    def made(self, names, *args, init=Names.__init__):
        names = list(names)
        found["tables"] += len(names) >= len(NAMES)
        init(self, names, *args)

    monkeypatch.setattr(checks, "bind", bind)
    monkeypatch.setattr(derived_signals, "bind", bind)
    monkeypatch.setattr(Names, "__init__", made)
    return found


def test_each_is_bound_once_in_a_table_that_is_gone_through_once(counted) -> None:
    assert checked_conditions(ALL, TABLE, "/log", 100) == ALL
    assert counted["bound"] <= MOST_DERIVED + MOST_LIMITS + MOST_TRIGGERS
    assert counted["tables"] == 1


def test_the_rows_of_derived_signals_are_made_likewise(counted) -> None:
    assert len(derived_signals.derived_infos(TABLE, "/log", ALL.derived)) == MOST_DERIVED
    assert counted == {"bound": MOST_DERIVED, "tables": 1}


@pytest.mark.parametrize("one", [Derived("/log/" + "d" * 300, "e0"), Derived("/log/d", "e0", "m" * 300)])
def test_names_and_units_have_an_end(one) -> None:
    with pytest.raises(ElementError, match=r"has 30\d characters, 200 are possible"):
        checks.with_derived(Conditions(), one, checks.table_catalogue(TABLE, "/log"))


@pytest.mark.parametrize("name", ["e0", "nothing"])
def test_of_far_too_many_not_all_are_looked_at(counted, name) -> None:
    far = Conditions(limits=tuple(SignalLimits(name) for _ in range(50_000)))
    with pytest.raises(ElementError):
        checked_conditions(far, TABLE, "/log", 100)
    assert counted["bound"] <= 1
    assert len(fitting_conditions(far, TABLE, "/log", 100)[1]) == MAX_PROBLEMS


def test_what_stands_on_a_new_signal_comes_behind_it() -> None:
    derived = (Derived("/log/a", "e0"), Derived("/log/b", "a + 1"), Derived("/log/c", "b + 1"), Derived("/log/d", "e1"))
    catalogue = checks.table_catalogue(TABLE, "/log")
    made = checks.with_derived(Conditions(derived), Derived("/log/a", "d + e2"), catalogue)
    assert [one.name for one in made.derived] == ["/log/d", "/log/a", "/log/b", "/log/c"]


def test_a_list_of_files_without_end_is_refused() -> None:
    wanted = Conditions(triggers=(TriggerOptions("t", "e0 > 1", save=(FileType.SILO,) * 1000),))
    with pytest.raises(ElementError, match="trigger 't' saves 1000 files of a capture, there are 3 kinds"):
        checked_conditions(wanted, TABLE, "/log", 100)


def test_what_stands_there_twice_is_refused() -> None:
    twice = Conditions(limits=(SignalLimits("e0", bounds=(None, None, 1.0, 2.0)),) * 2)
    with pytest.raises(ElementError, match=r"limits? 'e0' stands there twice"):
        checked_conditions(twice, TABLE, "/log", 100)


def test_conditions_of_a_script_fit_the_table_as_its_edits_leave_it() -> None:
    options = SimpleNamespace(prefix="/log", frequency_hz=100)
    robot = SimpleNamespace(conditions=Conditions())
    elements = TABLE[:1]
    table, names = SimpleNamespace(elements=elements), Names.of(elements)
    now = SimpleNamespace(table=table, names=names, options=options, robot=robot)
    wanted = Conditions(triggers=(TriggerOptions("t", "e0 > 1", pre_s=20.0, post_s=1.0),))
    looping = ElementOptions(buffer=BufferType.LOOPING, size=5000)
    assert fitting(wanted, [Edit("/log/e0", looping)], now) == wanted
    with pytest.raises(ElementError, match="pre"):
        fitting(wanted, [Edit("/log/e0", msgspec.structs.replace(looping, size=50))], now)


def test_what_is_off_of_a_wide_vector_is_found_without_comparing_each_scalar_with_each(monkeypatch):
    entries = tuple(Entry(f"_{at}", "<f8") for at in range(1000))
    bound = bind("any(wide > 1)", Catalogue([Known("/log/wide", entries, "-", 0, 1)])).condition()
    compared = []

    def equal(one, other):
        compared.append(one)
        return vars(one) == vars(other)

    monkeypatch.setattr(ScalarPlace, "__eq__", equal)
    assert without_off(bound) == (bound, [])
    assert len(compared) < 20 * len(entries)
