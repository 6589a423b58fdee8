"""An entry of a vector, named as it is called in files, means its element where elements are shown."""

from silo.cli.edits import of_entries
from silo.core.elements import ElementInfo, ElementOptions, Entry


def element(name, *suffixes):
    entries = tuple(Entry(suffix, "<f8") for suffix in suffixes)
    return ElementInfo(name, "-", "vector", (len(suffixes),), entries, ElementOptions())


JOINTS = element("/log/joints/q", *(f"_{at}" for at in range(12)))
TABLE = [JOINTS, element("/log/base/v", "_x", "_y"), element("/log/t", "")]


def test_an_entry_means_its_element_and_that_is_told():
    told = "is of '/log/joints/q', which is shown as a whole"
    for name in ("joints/q_3", "/log/joints/q_3", "q_11"):
        assert of_entries(TABLE, [name]) == (["/log/joints/q"], [f"'{name}' {told}"])
    assert of_entries(TABLE, ["base/v_x", "t"])[0] == ["/log/base/v", "t"]


def test_a_name_of_an_element_and_what_nothing_has_stay():
    for name in ("joints/q", "*/q", "/log", "q_12", "q_", "t_0"):
        assert of_entries(TABLE, [name]) == ([name], [])


def test_several_entries_of_one_element_are_told_once():
    assert of_entries(TABLE, ["joints/q_1*"])[1] == ["'joints/q_1*' is of '/log/joints/q', which is shown as a whole"]
