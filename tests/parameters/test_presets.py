"""Presets: values of parameters in YAML, of which lines and comments stay."""

import pytest

from silo.core.tuning.parameters import ParameterInfo, ParameterKind
from silo.errors import ElementError, ScriptError
from silo.settings.presets import read_preset, typed_value, write_preset

INFOS = [
    ParameterInfo("/log/legs/kp", ParameterKind.FLOAT, 40.0, minimum=0, maximum=200),
    ParameterInfo("/log/n", ParameterKind.INT, 4),
    ParameterInfo("/log/on", ParameterKind.BOOL, True),
    ParameterInfo("/log/gait", ParameterKind.ENUM, "STAND", choices=("STAND", "TROT")),
    ParameterInfo("/log/gains", ParameterKind.FLOAT, (1.0, 2.0), (2,)),
    ParameterInfo("/log/note", ParameterKind.STRING, "hi", string_bytes=16),
]
VALUES = {one.name: one.default for one in INFOS}


def test_what_is_written_is_read_as_it_was(tmp_path):
    assert read_preset(write_preset(tmp_path / "walk.yaml", VALUES), INFOS) == VALUES


@pytest.mark.parametrize("text", ["on", "a: b", "1", "# no", " x ", "'", ""])
def test_a_text_that_means_something_in_yaml_is_read_as_it_was(tmp_path, text):
    file = write_preset(tmp_path / "walk.yaml", {"/log/note": text})
    assert read_preset(file, INFOS) == {"/log/note": text}


@pytest.mark.parametrize("words", ["5, 6, 7, 8", "[5,6,7,8]", "[[5,6],[7,8]]", "[5, 6], [7, 8]"])
def test_a_matrix_is_typed_as_its_values_or_its_rows(words):
    matrix = ParameterInfo("/log/m", ParameterKind.FLOAT, (0.0,) * 4, (2, 2))
    assert typed_value(matrix, words) == (5.0, 6.0, 7.0, 8.0)
    with pytest.raises(ElementError, match="takes 2 x 2 values"):
        typed_value(matrix, "[[5,6,7],[8]]")


def test_lines_order_and_comments_of_a_preset_stay(tmp_path):
    file = tmp_path / "walk.yaml"
    file.write_text("# of Monday\nn: 3   # legs that stand\n\nlegs/kp: 10\ngains: [1, 2]  # both\nunknown: 5\n")
    write_preset(file, {"/log/legs/kp": 50.0, "/log/n": 4, "/log/gains": (3.0, 4.0), "/log/on": False})
    assert file.read_text() == (
        "# of Monday\nn: 4   # legs that stand\n\nlegs/kp: 50.0\ngains: [3.0, 4.0]  # both\nunknown: 5\n"
        "/log/on: false\n"
    )


def test_what_makes_no_sense_is_told_with_file_line_parameter_and_range(tmp_path):
    file = tmp_path / "walk.yaml"
    file.write_text("kp: 50\nn: 1.5\n\nkp: 60\nlegs/kp: 201\ngait: FLY\nkx: 1\n")
    with pytest.raises(ScriptError) as refused:
        read_preset(file, INFOS)
    assert str(refused.value).splitlines() == [
        f"{file}:2: parameter '/log/n': '1.5' doesn't fit, it takes a whole number",
        f"{file}:4: parameter '/log/legs/kp' stands there twice",
        f"{file}:5: parameter '/log/legs/kp': 201.0 doesn't fit, it takes 0 to 200",
        f"{file}:6: parameter '/log/gait': 'FLY' doesn't fit, it takes one of STAND, TROT",
        f"{file}:7: no parameter 'kx'; there are 6: {', '.join(one.name for one in INFOS[:5])}",
        "nothing was changed",
    ]


@pytest.mark.parametrize("text", ["\n- a\n", "n: 3\na: {b: c}\n", "n: 3\na: b: c\n", "\nn 3\n"])
def test_what_is_no_preset_is_told_with_its_line(tmp_path, text):
    file = tmp_path / "walk.yaml"
    file.write_text(text)
    with pytest.raises(ScriptError, match=r"walk\.yaml:2: "):
        read_preset(file, INFOS)


@pytest.mark.parametrize(
    "line", ["gains: [[1, 2]]", "gains: [{a: 1}, 2]", "on: [[on]]", "legs/kp: [[1]]", "note: [[]]"]
)
def test_lists_within_a_list_are_told_of(tmp_path, line):
    file, name = tmp_path / "walk.yaml", line.partition(":")[0]
    file.write_text(f"n: 3\n{line}\n")
    with pytest.raises(ScriptError, match=rf"walk.yaml:2: parameter '{name}': its values stand in one list"):
        read_preset(file, INFOS)
