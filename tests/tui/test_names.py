"""Names that are too long for their column."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.core.quantities.writing import size_text
from silo_tui.model.words import text
from silo_tui.model.words.names import (
    TAIL,
    NamesInTree,
    NamesShown,
    among,
    cells,
    first_levels,
    fitted_among,
    fitting_names,
    in_tree,
    inside,
    shared_space,
    space_words,
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
MOTORS = [
    f"/legged_robot/{place}/{leg}_{joint}/motor/{part}_temperature"
    for place, leg in (("left_front", "LF"), ("right_front", "RF"), ("left_hind", "LH"), ("right_hind", "RH"))
    for joint in ("HAA", "HFE", "KFE")
    for part in ("housing", "winding")
]


def test_of_words_that_tell_names_apart_three_letters_stay():
    names = [f"/legs/{leg}/HAA/{part}_temperature" for leg in ("LF", "RH") for part in ("drive", "housing", "winding")]
    assert fitting_names(names, 20)[:3] == ["…/LF/…/drive_t…ature", "…/LF/…/housing…ature", "…/LF/…/winding…ature"]
    assert fitting_names(names, 16)[:3] == ["…/LF/…/dri…ature", "…/LF/…/hou…ature", "…/LF/…/win…ature"]
    assert fitting_names(names, 12)[:3] == ["…LF…dr…ature", "…LF…ho…ature", "…LF…wi…ature"]


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


NAME_SETS = st.one_of(
    NAMES,
    st.lists(  # as robots have them: the same words again and again
        st.lists(
            st.lists(st.sampled_from(["left", "right", "LF", "KFE", "motor", "temp", "temperature"]), min_size=1)
            .map("_".join), min_size=1, max_size=5,
        ).map(lambda levels: "/" + "/".join(levels)),
        unique=True, max_size=40,
    ),
)  # fmt: skip


@given(NAME_SETS, st.integers(0, 40), st.randoms())
@settings(max_examples=200)
def test_in_as_many_cells_as_tell_names_apart_each_is_its_own_pattern_and_keeps_its_tail(names, more, random):
    width = max(8, NamesShown(names).least + more)
    fitted = fitting_names(names, width)
    assert len(set(fitted)) == len(names)
    for name, fits in zip(names, fitted, strict=True):
        assert cells(fits) <= width
        pieces = [re.escape(piece) for piece in fits.split("…")]
        assert re.fullmatch(".+".join(pieces), name), fits  # letters are left out where a sign stands for them alone
        assert not fits.endswith("…")
        *_, word = re.findall(r"[^\W_]+[\W_]*$|[\W_]+$", name)
        assert fits.endswith(word[-min(len(word), TAIL) :])
    again = random.sample(names, len(names))
    assert dict(zip(again, fitting_names(again, width), strict=True)) == dict(zip(names, fitted, strict=True))


@given(NAME_SETS)
def test_names_are_told_apart_wherever_three_letters_of_each_word_have_room(names):
    shown = NamesShown(names)
    assert shown.least <= shown.readable <= shown.longest


def test_a_word_that_all_names_of_the_same_end_have_goes_first():
    assert fitting_names(MOTORS, 20)[:2] == ["…/LF_HAA/…/hou…ature", "…/LF_HAA/…/win…ature"]
    assert fitting_names(MOTORS, 30)[:2] == ["…/LF_HAA/…/housing_temperature", "…/LF_HAA/…/winding_temperature"]
    assert NamesShown(MOTORS).readable == len("…LF_HAA…hou…ature")


def test_a_word_that_is_left_out_elsewhere_stays_where_it_tells():
    names = [f"/arm/{part}/temperature_of_winding" for part in ("motor", "brake", "gear")] + ["/arm/motor/torque_limit"]
    assert fitting_names(names, 16) == ["…/motor/…winding", "…/brake/…winding", "…/gear/…winding", "…torque_limit"]


def test_what_stands_between_words_tells_names_apart_where_words_do_not():
    names = ["/battery/temperature", "/legs/RH/winding_temperature", "/legs/LF/winding_temperature"]
    assert fitting_names(names, 15)[1] == "…/RH/wind…ature"
    assert fitting_names(["/leg/winding_temperature", "/leg/winding/temperature"], 12) == [
        "…_temp…ature", "…/temp…ature",
    ]  # fmt: skip


def test_a_name_begins_as_it_does_where_letters_of_that_have_room_too():
    names = ["/controller/gait", "/controller/gait_phase", "/battery/voltage", "/sensors/absolute_encoder_counter_high"]
    assert fitting_names(names, 20)[1] == "/control…/gait_phase"  # …/gait_phase stood below /controller/gait
    assert fitting_names(names, 16)[1] == "/con…/gait_phase"
    assert fitting_names(names, 14)[1] == "…gait_phase"  # two letters of it tell nothing
    names = [f"left_front/LF_{joint}/joint/{what}" for joint in ("HAA", "KFE") for what in ("position", "torque")]
    assert fitting_names(names, 24)[1] == "…LF_HAA/joint/torque"  # a level tells it: not lef…/LF_HAA/joint/torque


def test_a_short_last_word_keeps_what_stands_before_it():
    conditions = [f"/legged_robot/{leg}_KFE/winding_temperature > 50" for leg in ("LF", "RF")]
    assert fitting_names(conditions, 20) == ["…/LF…winding… > 50", "…/RF…winding… > 50"]


def test_the_first_word_of_the_last_level_stays_as_it_has_room():
    assert fitting_names(["/a/communication_error_count", "/a/position"], 14)[0] == "…communi…count"


def test_a_name_that_ends_as_another_begins_keeps_what_it_has_more():
    assert fitting_names(["/legs/LF/KFE/position", "/legs/LF/KFE/position_command"], 14) == [
        "…KFE/position", "…posit…command",
    ]  # fmt: skip


@pytest.mark.parametrize("width", [20, 24, 29])
def test_a_joint_is_never_hidden(width):
    for name, fits in zip(LEGS, fitting_names(LEGS, width), strict=True):
        assert name.split("/")[3] in fits.split("/")


@pytest.mark.parametrize(("width", "words"), [(24, "name in /legged_robot"), (15, "/legged_robot"), (9, "…robot")])
def test_the_namespace_that_all_share_stands_once_above(width, words):
    assert shared_space(MOTORS) == "/legged_robot"
    assert inside("/legged_robot", MOTORS[0]) == "left_front/LF_HAA/motor/housing_temperature"
    assert space_words("name", "/legged_robot", width) == words


def test_what_stands_above_names_is_what_all_have():
    assert shared_space(["/joints/q", "/joints/dq"]) == "/joints"
    assert shared_space(["/joints/q", "/joint/dq"]) == shared_space(["/q", "/dq"]) == shared_space(["/joints/q"]) == ""
    assert (inside("", "/q"), space_words("name", "", 20, "↓")) == ("/q", "↓name")


@given(NAME_SETS)
def test_below_what_they_share_names_are_as_different(names):
    space = shared_space(names)
    below = [inside(space, name) for name in names]
    assert len(set(below)) == len(names)
    assert all(name in (short, f"{space}/{short}") for name, short in zip(names, below, strict=True))


def test_a_name_alone_and_labels_of_a_tree_are_whole_before_columns_have_room():
    assert among(("/controller/state",)).readable == len("/controller/state")
    joints = [f"{leg}/{joint}" for leg in ("LF", "RH") for joint in ("HAA", "HFE")]
    tree = in_tree(tuple(f"/legs/{joint}/winding_temperature" for joint in joints))
    assert tree.readable == 2 * 4 + len("winding_temperature")


@given(NAME_SETS, st.integers(8, 30))
def test_labels_of_a_branch_are_told_apart(names, width):
    told = NamesInTree(names)
    branches = {"/".join(name.split("/")[:depth]) for name in names for depth in range(2, name.count("/") + 2)}
    found = [(path.rpartition("/")[0], told.fitted(path, width)) for path in branches]
    assert len(set(found)) == len(found)


def test_how_many_entries_a_vector_has_stands_there_where_its_label_has_room():
    told = NamesInTree(["/base/euler_angles", "/base/position"])
    assert told.fitted("/base/euler_angles", 16, " |3|") == "euler_angles |3|"
    assert told.fitted("/base/euler_angles", 14, " |3|") == "eul…angles |3|"
    assert told.fitted("/base/euler_angles", 11, " |3|") == "eule…angles"
    assert told.longest == 2 + 2 + len("euler_angles |3|")


def test_names_that_have_no_room_at_all_have_their_end_and_a_number():
    names = [f"motor_of_joint_{leg}{joint}_{side}" for leg in "ABCD" for joint in "ABCD" for side in ("left", "right")]
    fitted = fitting_names(names, 8)
    assert len(set(fitted)) == len(names)


def test_ten_thousand_names_look_different():
    names = [
        f"/robot/limb{each // 100:03}/measured_temperature_of_winding_{each % 100:02}/raw" for each in range(10_000)
    ]
    assert len(set(fitting_names(names, 24))) == len(names)


def test_a_name_keeps_its_last_word_where_that_has_room():
    names = [f"/legs/LF/HAA/{name}" for name in ("torque", "torque_margin", "torque_command", "friction_torque")]
    assert fitting_names([*names, "/loop/ticks"], 16)[:4] == [
        "…LF/HAA/torque", "…torque_margin", "…torque_command", "…/frictio…torque",
    ]  # fmt: skip
    assert fitted_among(names[3], (), 20) == "…HAA/friction_torque"


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
