"""Names that are too long for their column."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.core.quantities.writing import size_text
from silo_tui.model.words import text
from silo_tui.model.words.names import (
    _around,
    cells,
    first_levels,
    fitted_among,
    fitting_names,
    fitting_names_below,
    without_prefix,
)

# cells for names in a table of 80, 120 and 160 columns with the columns of settings or of statistics
WIDTHS = [20, 29, 52]
LEVEL = st.text(alphabet="abX_1", min_size=1, max_size=24)
NAMES = st.lists(st.lists(LEVEL, min_size=1, max_size=5).map(lambda levels: "/" + "/".join(levels)), unique=True)
LEGS = [
    f"/legs/{leg}/{joint}/{signal}"
    for leg in ("LF", "RF", "LH", "RH")
    for joint in ("HAA", "HFE", "KFE")
    for signal in ("drive_temperature", "drive_temperature_limit", "torque", "drive_temperatures_of_windings")
]


def test_of_levels_that_differ_in_their_first_word_three_letters_of_it_stay():
    names = [f"/legs/LF/HAA/{part}_temperature" for part in ("drive", "housing", "winding")]
    assert fitting_names(names, 20) == ["/l…/LF/HAA/dri…ature", "/l…/LF/HAA/hou…ature", "/l…/LF/HAA/win…ature"]
    assert fitting_names(names, 18) == ["/l…/LF/HAA/dri…ure", "/l…/LF/HAA/hou…ure", "/l…/LF/HAA/win…ure"]


@pytest.mark.parametrize("width", WIDTHS)
@given(names=NAMES)
@settings(max_examples=40)
def test_different_names_never_look_alike(width, names):
    fitted = fitting_names(names, width)
    assert len(set(fitted)) == len(names)
    assert all(cells(name) <= width for name in fitted)


@given(st.lists(st.text(max_size=30), unique_by=lambda name: "".join(c if c.isprintable() else "·" for c in name)))
def test_names_in_any_script_fit_and_differ(names):
    fitted = fitting_names(names, 12)
    assert len(set(fitted)) == len(names)
    assert all(cells(name) <= 12 for name in fitted)


def test_a_name_that_fits_stays_whole():
    assert fitting_names(["/base/euler", *LEGS], 52)[0] == "/base/euler"


def test_levels_on_the_left_become_their_unique_beginning_and_the_longest_loses_its_middle():
    fitted = dict(zip(LEGS, fitting_names(LEGS, 26), strict=True))
    assert fitted["/legs/LF/HAA/torque"] == "/legs/LF/HAA/torque"
    assert fitted["/legs/LF/HAA/drive_temperature"] == "/l…/LF/HAA/dri…temperature"


def test_a_name_that_has_no_room_for_all_its_levels_keeps_the_end_of_the_last_one_whole():
    assert fitting_names(["/legs/LF/KFE/position", "/legs/LF/KFE/position_command"], 14) == [
        "…/KFE/position", "…ition_command",
    ]  # fmt: skip


@pytest.mark.parametrize("width", [20, 24, 29])
def test_a_joint_is_never_hidden(width):
    for name, fits in zip(LEGS, fitting_names(LEGS, width), strict=True):
        assert name.split("/")[3] in fits.split("/")


def test_a_level_of_few_letters_stays_whole_as_that_saves_one():
    names = ["/legs/LF/KFE/winding_temperature", "/legs/LF/HAA/winding_temperature", "/legions/LF/HAA/x"]
    assert fitting_names(names, 24)[0] == "/legs/LF/KFE/windi…ature"


def test_the_namespace_that_all_share_stands_once_above():
    names = ["/legs/LF/HAA/drive_temperature", "/legs/RH/KFE/winding_temperature"]
    assert fitting_names_below(names, 27, 20) == (
        "/legs", ["LF/HAA/drive_temperature", "RH/KFE/winding_temperature"],
    )  # fmt: skip
    assert fitting_names_below(names[:1], 27, 8) == ("/legs/LF", ["HAA/drive_temperature"])  # as it has room
    assert fitting_names_below(names, 40, 20) == ("", names)  # where all fit, they are whole


@given(NAMES, st.integers(12, 40))
def test_below_what_they_share_different_names_never_look_alike(names, width):
    space, fitted = fitting_names_below(names, width, width - 8)
    assert len(set(fitted)) == len(names)
    assert all(name.startswith(space) for name in names)
    assert cells(space) <= max(0, width - 8)


def test_levels_that_begin_alike_keep_the_letters_in_which_they_differ():
    names = ["/controller/a/long_signal_name", "/contactor/a/long_signal_name"]
    first, second = fitting_names(names, 26)
    assert (first[:7], second[:7]) == ("/contr…", "/conta…")


def test_the_order_of_names_doesn_t_change_how_they_look():
    assert dict(zip(LEGS, fitting_names(LEGS, 22), strict=True)) == dict(
        zip(reversed(LEGS), fitting_names(LEGS[::-1], 22), strict=True)
    )


def test_ten_thousand_names_look_different():
    names = [
        f"/robot/limb{each // 100:03}/measured_temperature_of_winding_{each % 100:02}/raw" for each in range(10_000)
    ]
    assert len(set(fitting_names(names, 24))) == len(names)


def test_a_name_keeps_its_last_word_where_that_has_room():
    names = [f"/legs/LF/HAA/{name}" for name in ("torque", "torque_margin", "torque_command", "friction_torque")]
    assert [name[13:] for name in fitting_names([*names, "/loop/ticks"], 24)[:4]] == [
        "torque",
        "torq…margin",
        "tor…command",
        "fric…torque",
    ]
    assert fitted_among(names[3], (), 20) == "/l…/LF/HAA/fri…orque"


def test_words_have_the_names_of_signals_as_tables_give_them():
    names = ["/log/legs/LF/contact", "/log/tau"]
    levels = first_levels([*names, "/log/tau_x"], "/log")
    assert levels == {"legs", "tau", "tau_x"}
    told = "12 x /log/legs/*/contact, /log/tau_x: divider 1 -> 5; saved /log/run_7.silo, robot/log/tau"
    shown = "12 x /legs/*/contact, /tau_x: divider 1 -> 5; saved /log/run_7.silo, robot/log/tau"
    assert without_prefix(told, "/log", levels) == shown
    assert without_prefix(told, "", levels) == told


def test_sizes_go_on_behind_gigabytes():
    assert [size_text(size) for size in (812, 1.2e6, 2.5e9, 2.5e12)] == ["812 B", "1.2 MB", "2.5 GB", "2.5 TB"]


def test_seconds_go_on_to_two_minutes():
    assert [text.span(seconds) for seconds in (0.5, 59.0, 119.0, 120.0, 7199.0)] == [
        "500 ms", "59 s", "119 s", "2 min", "120 min",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "width"),
    [("abc", 3), ("größe…", 6), ("e\u0301a", 2), ("関節", 4), ("a関e\u0301…", 5), ("ｱ", 1)],
)
def test_a_text_takes_as_many_cells_as_a_terminal_gives_it(words, width):
    assert cells(words) == width


@pytest.mark.parametrize(
    ("name", "begin", "words"),
    [("xyLFabcdefghi", 2, "xyLF…defghi"), ("wxyLFabcdefghi", 3, "…xyLF…defghi"), ("LFabcdefghijk", 0, "LF…fghijk")],
)
def test_letters_are_left_out_where_a_sign_stands_for_them_alone(name, begin, words):
    assert _around(name, begin, begin + 2, 12) == words
