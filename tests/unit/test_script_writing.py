"""Applying, comparing and writing scripts."""

from pathlib import Path

import pytest

import silo
from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry, FieldChange
from silo.errors import ScriptError
from silo.settings.script import MAX_SUGGESTIONS, apply_script, format_script, parse_script, read_script, write_script
from silo.settings.typed import diff_options

FIXTURES = Path(__file__).resolve().parents[3] / "shared" / "fixtures"
USUAL = ElementOptions(True, 2, Action.PUBLISH, BufferType.FIXED, 30)


def info(name: str, options: ElementOptions = USUAL) -> ElementInfo:
    return ElementInfo(name, "-", "scalar", (), (Entry("", "<f8"),), options)


def plan_for(body: str, *table: ElementInfo) -> tuple[ElementOptions, ...]:
    return apply_script(parse_script(f"log_elements:\n{body}", "s.yaml"), table, 100.0).options


def test_a_listed_element_keeps_the_settings_that_are_not_given() -> None:
    assert plan_for("- {name: /a, enabled: true, divider: 5}", info("/a")) == (
        ElementOptions(True, 5, Action.PUBLISH, BufferType.FIXED, 30),
    )


def test_a_listed_element_without_enabled_is_disabled() -> None:
    assert plan_for("- {name: /a}", info("/a"))[0].enabled is False


def test_an_element_that_is_not_listed_is_enabled_and_else_unchanged() -> None:
    off = ElementOptions(False, 7, Action.SAVE, BufferType.GROWING, 3)
    assert plan_for(" []", info("/a", off)) == (ElementOptions(True, 7, Action.SAVE, BufferType.GROWING, 3),)


def test_options_come_in_the_order_of_the_table() -> None:
    options = plan_for("- {name: /b, divider: 9}\n- {name: /a, divider: 8}", info("/a"), info("/c"), info("/b"))
    assert [option.divider for option in options] == [8, 2, 9]


def test_unknown_names_are_returned_with_line_and_suggestion() -> None:
    script = parse_script("log_elements:\n- name: /log/joints/tua\n- name: /elsewhere\n", "s.yaml")
    unknown = apply_script(script, [info("/log/joints/tau")], 100.0).unknown
    assert [str(name) for name in unknown] == [
        "2: no element '/log/joints/tua'; did you mean '/log/joints/tau'?",
        "3: no element '/elsewhere'",
    ]
    many = [info(f"/log/joints/{name}") for name in ("q", "dq", "torque")]
    (gone,) = apply_script(
        parse_script("log_elements:\n- name: /log/joints/tau\n", "s.yaml"), many, 100.0, "/log"
    ).unknown
    assert gone.suggestion == "/log/joints/torque", "as lines of triggers suggest"
    lines = "".join(f"- name: /log/joints/tau{number}\n" for number in range(MAX_SUGGESTIONS + 2))
    unknown = apply_script(parse_script(f"log_elements:\n{lines}", "s.yaml"), [info("/log/joints/tau")], 100.0).unknown
    assert ["did you mean" in str(name) for name in unknown] == [True] * MAX_SUGGESTIONS + [False] * 2


@pytest.mark.skipif(not FIXTURES.is_dir(), reason="files of the original are not here")
@pytest.mark.parametrize("name", ["looping_wrapped", "mixed_dividers", "time_buffer_full"])
def test_writing_gives_the_bytes_of_the_original(name: str) -> None:
    path = FIXTURES / f"{name}.yaml"
    script = read_script(path)
    table = [info(element.name) for element in script.elements]
    plan = apply_script(script, table, 100.0)
    after = [info(element.name, options) for element, options in zip(table, plan.options, strict=True)]
    assert format_script(after).encode() == path.read_bytes()


def test_a_written_script_reads_back_as_the_same_options(tmp_path: Path) -> None:
    table = [info("/log/a"), info('/log/ünïcode: #1 "quoted"\n', ElementOptions(False, 3))]
    write_script(tmp_path / "s.yaml", table)
    assert diff_options(table, apply_script(read_script(tmp_path / "s.yaml"), table, 100.0).options) == []


def test_writing_replaces_a_script_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("old")
    path.chmod(0o640)
    write_script(path, [info("/a")])
    assert path.read_text() == format_script([info("/a")])
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_writing_through_a_symbolic_link_keeps_the_link(tmp_path: Path) -> None:
    (tmp_path / "link.yaml").symlink_to(tmp_path / "real.yaml")
    write_script(tmp_path / "link.yaml", [info("/a")])
    assert (tmp_path / "link.yaml").is_symlink()
    assert "/a" in (tmp_path / "real.yaml").read_text()


def test_a_script_that_can_not_be_written_changes_nothing(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match="can't be written"):
        write_script(tmp_path / "none" / "s.yaml", [info("/a")])
    path = tmp_path / "s.yaml"
    path.write_text("old")
    with pytest.raises(ScriptError, match="not valid Unicode"):
        write_script(path, [info("/a\udc80")])
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_difference_names_each_field_in_words() -> None:
    new = ElementOptions(False, 4, Action.SAVE, BufferType.LOOPING, 31)
    assert diff_options([info("/a"), info("/b")], [new, USUAL]) == [
        FieldChange("/a", "enabled", "on", "off"),
        FieldChange("/a", "divider", "2", "4"),
        FieldChange("/a", "action", "publish", "save"),
        FieldChange("/a", "buffer", "fixed", "looping"),
        FieldChange("/a", "size", "30", "31"),
    ]


NOTED = """\
version: 3
log_elements:
  - name: /a
    enabled: true
    note: "why: it's slow"
    buffer:
      size: 30
      guard: {high: [1, 2]}
    limits:
      low: -1
      text: |
        two
          lines
  - {name: /gone, note: lost}
tail: [&u {a: 1}, *u]
"""


def test_unknown_keys_survive_saving_the_script_again(tmp_path: Path) -> None:
    import yaml

    path = tmp_path / "s.yaml"
    path.write_text(NOTED)
    kept = write_script(path, [info("/a"), info("/b")])
    assert kept == "; kept what silo doesn't know: version, note of /a, guard of /a, limits of /a, tail"
    assert "/gone" not in path.read_text()  # not this logger's own script
    before, after = yaml.safe_load(NOTED), yaml.safe_load(path.read_text())
    assert (after["version"], after["tail"]) == (before["version"], before["tail"])
    for key in ("note", "limits"):
        assert after["log_elements"][0][key] == before["log_elements"][0][key]
    assert after["log_elements"][0]["buffer"]["guard"] == {"high": [1, 2]}
    assert diff_options([info("/a")], apply_script(read_script(path), [info("/a")], 100.0).options) == []


def test_elements_that_are_away_stay_in_the_own_script(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(
        "log_elements:\n- &g {name: /grip, enabled: true, divider: 20 Hz, note: [&n x, *n]}\n- {name: /a, divider: 2}\n"
        "- {name: /wrong, divider: -3}\n- {name: '/odd: #', buffer: {size: 7}}\n"
    )
    kept = write_script(path, [info("/a")], own=True)
    gone = "(delete their lines if they are gone for good)"
    assert kept == f"; kept what this program doesn't have: /grip, /odd: # {gone}"
    once = path.read_bytes()
    write_script(path, [info("/a")], own=True)
    assert path.read_bytes() == once
    table = [info("/a"), info("/grip"), info("/odd: #")]
    a, grip, odd = apply_script(read_script(path), table, 100.0).options
    assert (a, grip.divider, grip.enabled, odd.buffer_size) == (USUAL, 5, True, 7)
    assert [key.label for key in read_script(path).unknown_keys] == ["note of /grip"]
    assert write_script(path, [], own=True).count("/") == 3
    assert len(read_script(path).elements) == 3


def test_saving_again_changes_no_byte(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("version: 3\nlog_elements:\n- {name: /a, x: &b [1], y: *b}\ntail: [&c {a: 1}, *c]\n")
    write_script(path, [info("/a")])
    once = path.read_bytes()
    write_script(path, [info("/a")])
    assert path.read_bytes() == once


def test_an_unknown_key_that_holds_itself_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("log_elements:\n- name: /a\nloop: &l [1, *l]\n")
    assert write_script(path, [info("/a")]) == "; kept what silo doesn't know: loop"
    assert read_script(path).unknown_keys[0].label == "loop"


@pytest.mark.parametrize("way", [None, "s.yaml", "sub/../s.yaml", "link.yaml", "WHOLE"])
def test_the_own_script_is_that_by_whatever_path_it_is_named(tmp_path, monkeypatch, way):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "s.yaml").write_text("log_elements:\n  - {name: /log/away, enabled: true, divider: 7}\n")
    (tmp_path / "link.yaml").symlink_to("s.yaml")
    log = silo.Logger("a", folder=tmp_path, script="s.yaml")
    log.array("x", ())
    log.save_script(str(tmp_path / "s.yaml") if way == "WHOLE" else way)
    log.save_script("other.yaml")
    assert [one.name for one in read_script("s.yaml").elements] == ["/log/x", "/log/away"]
    assert [one.name for one in read_script("other.yaml").elements] == ["/log/x"]
