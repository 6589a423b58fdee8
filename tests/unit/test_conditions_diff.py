"""What differs between derived signals, limits and triggers, in words."""

from silo.core.conditions import NO_CONDITIONS, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import FileType
from silo.settings.conditions_diff import diff_conditions
from silo.settings.script_conditions import conditions_text

FALL = TriggerOptions("fall", "abs(base/roll) > 0.6", 5.0, 1.0)
HOT = SignalLimits("/log/temperature", bounds=(None, None, 60.0, 80.5))
POWER = Derived("/log/power", "tau * qd", "W")


def words(now, new):
    return [(change.name, change.field, change.old, change.new) for change in diff_conditions(now, new)]


def test_equal_ones_differ_in_nothing():
    both = Conditions((POWER,), (HOT,), (FALL,))
    assert words(both, both) == words(NO_CONDITIONS, NO_CONDITIONS) == []


def test_what_comes_is_told_with_all_that_is_unusual_of_it():
    assert words(NO_CONDITIONS, Conditions((POWER,), (HOT,), (FALL,))) == [
        ("derived /log/power", "", "none", "tau * qd, unit W"),
        ("limits /log/temperature", "", "none", "- - 60 80.5"),
        ("trigger fall", "", "none", "abs(base/roll) > 0.6, pre 5 s, post 1 s"),
    ]


def test_how_many_there_are_is_told_of_each_kind():
    assert conditions_text(Conditions((POWER,), (HOT,) * 2, (FALL,) * 3)) == "1 derived signal, 2 limits, 3 triggers"
    assert conditions_text(Conditions(limits=(HOT,))) == "1 limit"
    assert conditions_text(NO_CONDITIONS) == "no derived signals, limits, triggers any more"


def test_what_goes_is_told_with_what_it_was():
    assert words(Conditions(triggers=(FALL,)), NO_CONDITIONS) == [
        ("trigger fall", "", "abs(base/roll) > 0.6, pre 5 s, post 1 s", "none")
    ]


def test_what_changes_is_told_field_by_field():
    other = TriggerOptions("fall", "abs(base/roll) > 0.6", 2.5, 1.0, save=(FileType.SILO, FileType.BAG), armed=False)
    assert words(Conditions((), (HOT,), (FALL,)), Conditions((), (SignalLimits(HOT.name, stale_s=0.5),), (other,))) == [
        ("limits /log/temperature", "bounds", "- - 60 80.5", "- - - -"),
        ("limits /log/temperature", "stale", "0 s", "0.5 s"),
        ("trigger fall", "pre", "5 s", "2.5 s"),
        ("trigger fall", "save", "silo", "silo bag"),
        ("trigger fall", "armed", "yes", "no"),
    ]
