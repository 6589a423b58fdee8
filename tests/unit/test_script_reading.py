"""Reading scripts: what is accepted, and how each mistake is told."""

import gc
import os
import re
from pathlib import Path

import msgspec
import pytest

from silo.core.conditions import NO_CONDITIONS, Conditions, SignalLimits, TriggerOptions
from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry, FileType
from silo.errors import ScriptError
from silo.settings.script import (
    MAX_PROBLEMS,
    MAX_SCRIPT_BYTES,
    Script,
    ScriptElement,
    apply_script,
    format_script,
    parse_script,
    read_script,
    write_script,
)
from silo.settings.typed import ElementSettings

FIXTURES = Path(__file__).resolve().parents[3] / "shared" / "fixtures"
WHOLE = "must be a whole number from 1 to 2147483647"


def script(text: str) -> Script:
    return parse_script(text, "config/robot.yaml")


def complaint(text: str) -> str:
    with pytest.raises(ScriptError) as error:
        script(text)
    return str(error.value)


def element(text: str) -> ScriptElement:
    (only,) = script(f"log_elements:\n  - name: /log/x\n    {text}\n").elements
    return only


def element_complaint(text: str) -> str:
    return complaint(f"log_elements:\n  - name: /log/x\n    {text}\n")


def test_every_key_of_an_element_is_read() -> None:
    buffer = "buffer:\n      type: 0\n      size: 10"
    text = f"log_elements:\n  - name: /log/grp/x\n    enabled: true\n    divider: 3\n    {buffer}\n    action: 2\n"
    assert script(text).elements == (
        ScriptElement(
            "/log/grp/x",
            2,
            ElementSettings(enabled=True, divider=3, action=Action.PUBLISH, buffer=BufferType.FIXED, size=10),
        ),
    )


@pytest.mark.parametrize(
    ("word", "member"),
    [
        ("1", 1),
        ("LOOPING", 1),
        ("looping", 1),
        ("Fixed_Size", 0),
        ("fixed", 0),
        ("exponentially-growing", 2),
        ("'2'", 2),
    ],
)
def test_buffer_types_are_given_by_number_or_name(word: str, member: int) -> None:
    assert element(f"buffer: {{type: {word}}}").asked["buffer"] is BufferType(member)


@pytest.mark.parametrize(("word", "member"), [("0", 0), ("save_and_publish", 0), ("Save", 1), ("PUBLISH", 2)])
def test_actions_are_given_by_number_or_name(word: str, member: int) -> None:
    assert element(f"action: {word}").asked["action"] is Action(member)


@pytest.mark.parametrize(("word", "value"), [("true", True), ("False", False), ("yes", True), ("OFF", False)])
def test_enabled_takes_the_words_that_yaml_knows(word: str, value: bool) -> None:
    assert element(f"enabled: {word}").asked["enabled"] is value


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_bytes(b"\xef\xbb\xbflog_elements:\r\n  - name: /log/x\r\n    divider: 4\r\n")
    assert read_script(path).elements == (ScriptElement("/log/x", 2, ElementSettings(divider=4)),)


def test_an_anchor_may_be_used_for_several_buffers() -> None:
    text = "log_elements:\n- {name: /a, buffer: &b {type: 2, size: 7}}\n- {name: /b, buffer: *b}\n"
    assert [item.asked["size"] for item in script(text).elements] == [7, 7]


@pytest.mark.skipif(not FIXTURES.is_dir(), reason="files of the original are not here")
@pytest.mark.parametrize("name", ["looping_wrapped", "mixed_dividers", "time_buffer_full"])
def test_scripts_of_the_original_are_read(name: str) -> None:
    text = (FIXTURES / f"{name}.yaml").read_text()
    assert len(read_script(FIXTURES / f"{name}.yaml").elements) == text.count("- name:")


@pytest.mark.skipif(not FIXTURES.is_dir(), reason="files of the original are not here")
def test_the_buffer_of_size_zero_that_the_original_allows_is_the_only_complaint_about_its_script() -> None:
    with pytest.raises(ScriptError) as error:
        read_script(FIXTURES / "all_types.yaml")
    (line,) = str(error.value).splitlines()
    assert line.endswith(f":182: element '/log/extra/zero_size_buffer': size {WHOLE}, got 0; nothing was changed")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("divider: 0", f"divider {WHOLE}, got 0"),
        ("divider: -1", f"divider {WHOLE}, got -1"),
        ("divider: 2147483648", f"divider {WHOLE}, got 2147483648"),
        ("divider: true", "divider must be 1 to 2147483647 or 50Hz, got true"),
        ("divider: 2.5", f"divider {WHOLE}, got 2.5"),
        ("divider: '2'", f"divider {WHOLE}, got the text '2'"),
        ("divider: 010", f"divider {WHOLE}, got 010"),
        ("divider: [2]", f"divider {WHOLE}, got a list"),
        ("divider:", "divider has no value; give a whole number from 1 to 2147483647, or remove the key"),
        ("divider: !!int 5", f"divider {WHOLE}, got a value with the tag 'tag:yaml.org,2002:int'"),
        ("buffer: {size: 0}", f"size {WHOLE}, got 0"),
        ("buffer: 5", "buffer must have keys (type, size), got 5"),
        ("buffer: {type: 3}", "buffer must be looping (1), fixed (0) or growing (2), got 3"),
        ("buffer: {type: true}", "buffer must be looping (1), fixed (0) or growing (2), got true"),
        ("action: -1", "action must be save (1), both (0) or publish (2), got -1"),
        ("enabled: 2", "enabled must be on or off, got 2"),
        ("enabled: 'true'", "enabled must be on or off, got the text 'true'"),
        ("enabled: {a: b}", "enabled must be on or off, got a group of keys"),
    ],
)
def test_a_wrong_value_is_told_in_words(text: str, reason: str) -> None:
    assert element_complaint(text) == f"config/robot.yaml:3: element '/log/x': {reason}; nothing was changed"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("dividr: 2", "unknown key 'dividr' in an element; did you mean 'divider'?"),
        ("rate: 2", "unknown key 'rate' in an element; known are name, enabled, divider, buffer, action"),
        ("buffer: {sice: 2}", "unknown key 'sice' in buffer; did you mean 'size'?"),
    ],
)
def test_an_unknown_key_is_a_warning_with_its_line_and_the_nearest_key(text: str, reason: str) -> None:
    found = script(f"log_elements:\n  - name: /log/x\n    {text}\n    enabled: true\n")
    assert found.warnings == [f"config/robot.yaml:3: element '/log/x': {reason}; it was left alone"]


def test_what_is_off_as_nothing_says_that_it_is_on_is_told() -> None:
    found = script(
        "log_elements:\n- name: /a\n  divider: 5\n- name: /b\n  enabled: false\n- {name: /c, enabled: true}\n"
    )
    off = "element '/a' is off, as it has no key 'enabled': write `enabled: true`"
    assert found.warnings == [f"config/robot.yaml:2: {off}"]
    many = script("log_elements:\n" + "".join(f"- name: /x{at}\n" for at in range(MAX_PROBLEMS + 2)))
    assert (len(many.warnings), many.warnings[-1]) == (MAX_PROBLEMS + 1, "config/robot.yaml: and 2 more")


def test_unknown_keys_beside_a_problem_are_told_with_it() -> None:
    lines = complaint("note: 1\nlog_elements:\n- {name: /a, divider: 0, rate: 5}\n").splitlines()
    assert [line.split(":")[1] for line in lines] == ["3", "1", "3"]


def test_a_number_with_thousands_of_digits_is_out_of_range() -> None:
    assert f"divider {WHOLE}, got 999" in element_complaint("divider: " + "9" * 5000)


def test_all_problems_come_at_once_each_with_its_line() -> None:
    text = "log_elements:\n- name: /a\n  divider: 0\n  action: 9\n- divider: 1\n- 5\n"
    assert complaint(text).splitlines() == [
        f"config/robot.yaml:3: element '/a': divider {WHOLE}, got 0",
        "config/robot.yaml:4: element '/a': action must be save (1), both (0) or publish (2), got 9",
        "config/robot.yaml:5: element 2 of the list: name is missing",
        "config/robot.yaml:6: element 3 of the list: must have keys (`name: ...`), got 5; nothing was changed",
    ]


def test_a_flood_of_problems_is_cut() -> None:
    lines = complaint("log_elements:\n" + "- 5\n" * (MAX_PROBLEMS + 7)).splitlines()
    assert len(lines) == MAX_PROBLEMS + 1
    assert lines[-1] == "config/robot.yaml: and 7 more problems; nothing was changed"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("log_elements:\n- name: /a\nlog_elements: []\n", "3: key 'log_elements' stands twice, first in line 1"),
        ("log_elements:\n- name: /a\n- name: /b\n- name: /a\n", "4: element '/a': listed twice, first in line 2"),
        (
            "log_elements:\n  - name: /log/x\n    divider: 1\n    divider: 2\n",
            "4: element '/log/x': key 'divider' stands twice, first in line 3",
        ),
        ("", "1: the script is empty; it must start with `log_elements:`"),
        ("# nothing\n", "1: the script is empty; it must start with `log_elements:`"),
        ("- name: /a\n", "1: a script must have keys (log_elements), got a list"),
        ("hello\n", "1: a script must have keys (log_elements), got hello"),
        ("{}\n", "1: `log_elements:` is missing; `log_elements: []` has all of them on"),
        ("log_element: []", "1: unknown key 'log_element' in a script; did you mean 'log_elements'?"),
        ("log_elements: {}", "1: log_elements must be a list (`- name: ...`), got a group of keys"),
        ("log_elements:\n- name: /a\n\tdivider: 1", "3: a tab stands where YAML wants spaces; indent with two spaces"),
        ("log_elements: []\n---\n{}", "2: a second document starts here (`---`); a script is one document"),
        ("log_elements:\n  - name: /a\n\n\x07", "4: not valid YAML: a control character that must not stand in text"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_script_or_says_a_thing_twice_is_told_with_its_line(text: str, reason: str) -> None:
    assert complaint(text) == f"config/robot.yaml:{reason}; nothing was changed"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("log_elements:\n  - name: [/a\n    divider: 1\n", "config/robot.yaml:3: not valid YAML: "),
        ("log_elements: [\n  {name: /a}\n\n\n", "config/robot.yaml:2: not valid YAML: "),  # the last text, not the end
        ("log_elements: *nothing\n", "found undefined alias"),
        ("[" * 17, "nested deeper than 16 levels"),
        ("[" * 1_000_000, "nested deeper than 16 levels"),  # before it costs anything
    ],
    ids=range(5),
)
def test_a_syntax_error_has_its_line(text: str, words: str) -> None:
    assert words in complaint(text)


def test_an_alias_bomb_is_just_a_wrong_value() -> None:
    laughs = "a: &a [x, x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 9)}]\n" for i in range(12)
    )
    assert "unknown key 'a' in a script" in complaint(laughs + "log_elements: *m\n")


def test_a_file_too_large_for_a_script_is_not_parsed(tmp_path: Path) -> None:
    path = tmp_path / "huge.yaml"
    with path.open("wb") as file:
        file.truncate(MAX_SCRIPT_BYTES + 1)
    with pytest.raises(ScriptError, match="larger than 8 MB"):
        read_script(path)


def test_a_missing_file_tells_where_it_was_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScriptError) as error:
        read_script("none.yaml")
    assert str(error.value).startswith(f"none.yaml: no such file (looked for {tmp_path / 'none.yaml'}); ")


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_script_that_may_not_be_read_says_so(tmp_path: Path) -> None:
    path = tmp_path / "secret.yaml"
    path.touch(0o000)
    with pytest.raises(ScriptError, match="Permission denied"):
        read_script(path)


def test_other_encodings_are_told_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "latin.yaml"
    path.write_bytes(b"log_elements:\n  - name: /log/\xe9\n")
    with pytest.raises(ScriptError) as error:
        read_script(path)
    assert str(error.value) == f"{path}:2: byte 0xe9 is not UTF-8; save the file as UTF-8; nothing was changed"


def test_reading_leaves_the_garbage_collector_as_it_was() -> None:
    complaint("")
    assert gc.isenabled()
    gc.disable()
    try:
        script("log_elements: []")
        assert not gc.isenabled()
    finally:
        gc.enable()


TRIGGER = "log_elements: []\ntriggers:\n  - name: fall\n    when: x > 1\n    {}\n"


@pytest.mark.parametrize(
    ("word", "armed"), [("no", False), ("off", False), ("false", False), ("yes", True), ("on", True)]
)
def test_a_trigger_is_armed_by_the_words_that_an_element_takes(word: str, armed: bool) -> None:
    conditions = script(TRIGGER.format(f"armed: {word}")).conditions
    assert conditions is not None
    assert conditions.triggers[0].armed is armed


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("[silo]", (FileType.SILO,)),
        ("[silo, CSV]", (FileType.SILO, FileType.CSV)),
        ("[0, 2]", (FileType.SILO, FileType.BAG)),
        ("bag", (FileType.BAG,)),
    ],
)
def test_what_a_trigger_saves_is_given_by_name_or_number(words: str, expected: tuple[FileType, ...]) -> None:
    conditions = script(TRIGGER.format(f"save: {words}")).conditions
    assert conditions is not None
    assert conditions.triggers[0].save == expected


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("armed: perhaps", ":5: triggers 'fall': armed must be on or off, got perhaps"),
        ('armed: "no"', ":5: triggers 'fall': armed must be on or off, got the text 'no'"),
        ("save: [parquet]", ":5: triggers 'fall': save must be one or a list of silo, csv, bag, got a list"),
        (
            "pre_s: soon",
            ":5: triggers 'fall': pre_s must be a time such as 0.5s or 20ms, or a number of seconds, got soon",
        ),
        (
            "pre: 1m",
            ":5: triggers 'fall': pre must be a time such as 0.5s or 20ms, or a number of seconds (a bare m is",
        ),
        ("pre: 1\n    pre_s: 2", ":6: triggers 'fall': key 'pre_s' stands twice, as 'pre', too: keep 'pre' alone"),
        (
            "slope: level\n    edge: level",
            ":6: triggers 'fall': key 'edge' stands twice, as 'slope', too: keep 'edge' alone",
        ),
        ("keep: 1.5", ":5: triggers 'fall': keep must be a whole number, got 1.5"),
        ("rearm: [a]", ":5: triggers 'fall': rearm must be a text, got a list"),
        ("when: y", ":5: triggers 'fall': key 'when' stands twice"),
    ],
)
def test_a_wrong_value_of_a_trigger_is_told_in_words_with_its_line(text: str, reason: str) -> None:
    assert reason in complaint(TRIGGER.format(text))


def test_bounds_that_are_no_four_numbers_are_told() -> None:
    text = "log_elements: []\nsignal_limits:\n  - name: q\n    bounds: [1, {}]\n"
    for rest in ("2", "2, 3", "x, 3, 4", "[2], 3, 4"):
        assert ":4: signal_limits 'q': bounds must be four numbers" in complaint(text.format(rest))
    conditions = script(text.format("null, 3, ~")).conditions
    assert conditions is not None
    assert conditions.limits[0].bounds == (1.0, None, 3.0, None)


@pytest.mark.parametrize(
    ("new", "old"),
    [
        ("pre: 1s\n    post: 0.25s", "pre_s: 1.0\n    post_s: 0.25"),
        ("pre: 1\n    post: 250ms", "pre_s: 1\n    post_s: 0.25"),
        ("persist: 20ms\n    holdoff: 10min", "persist_s: 0.02\n    holdoff_s: 600"),
        ("edge: falling\n    patience: 2s", "slope: falling\n    patience_s: 2"),
        ("save: [silo, csv]", "save: [0, 1]"),
        ("save: silo", "save: [0]"),
        ("save: []\n    armed: no", "save: []\n    armed: false"),
    ],
)
def test_what_a_script_says_in_words_of_programs_is_what_it_said_in_those_of_before(new: str, old: str) -> None:
    made, before = (script(TRIGGER.format(text)) for text in (new, old))
    assert made.conditions == before.conditions
    assert (made.warnings, before.warnings) == ([], [])
    again = format_script([], (), made.conditions or NO_CONDITIONS)
    assert script(again).conditions == made.conditions
    assert not re.search("_s:|slope|\\[0", again)


@pytest.mark.parametrize("time_s", [0.02, 0.1 + 0.2, 1 / 3, 5.0, 600.0, 1e-9, 123456.789, 0.001, 0.0001])
def test_a_time_that_is_written_is_read_to_the_last_digit(time_s: float) -> None:
    made = Conditions(
        limits=(SignalLimits("q", bounds=(None, -1.5, 30.0, None), persistence=2, hysteresis=time_s, stale_s=time_s),),
        triggers=(TriggerOptions("fall", "x > 1", time_s, time_s, persist_s=time_s),),
    )
    assert script(format_script([], (), made)).conditions == made


def test_what_is_written_is_as_a_person_writes_it() -> None:
    made = Conditions(
        limits=(SignalLimits("q", bounds=(None, -1.5, 30.0, None), stale_s=0.1),),
        triggers=(TriggerOptions("fall", "x > 1", 5.0, 0.25, "falling", mode="single", save=(FileType.CSV,), keep=20),),
    )
    assert format_script([], (), made) == (
        "log_elements: []\n"
        'signal_limits:\n  - name: "q"\n    bounds: [null, -1.5, 30, null]\n    stale: 100ms\n'
        'triggers:\n  - name: "fall"\n    when: "x > 1"\n    pre: 5s\n    post: 250ms\n    edge: falling\n'
        "    mode: single\n    save: csv\n    keep: 20\n"
    )


def test_elements_that_a_script_does_not_speak_of_stay_as_they_are() -> None:
    found = script("triggers:\n  - {name: a, when: x > 1}\n")
    assert (found.elements, found.kinds, found.lists_elements) == ((), {"triggers"}, False)
    off = ElementInfo("/x", "-", "scalar", (), (Entry("", "<f8"),), ElementOptions(enabled=False, divider=3))
    assert apply_script(found, [off], 100.0).options == (off.options,)
    on = apply_script(script("log_elements: []\ntriggers: []\n"), [off], 100.0).options
    assert on == (ElementOptions(enabled=True, divider=3),)
    assert "unknown key 'log_element' in a script; did you mean 'log_elements'?" in complaint(
        "log_element: []\ntriggers: []\n"
    )
    assert "later_silo" in script("later_silo: 1\ntriggers: []\n").warnings[0]


def test_the_script_of_the_guide_says_what_its_calls_say(new_logger, tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / ".docs/guide/conditions.md").read_text()
    (text,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    log = new_logger(frequency=100)
    kept = [log.array(name) for name in ("joints/tau", "joints/dq")]
    kept += [log.array("base/roll", unit="rad"), log.array("controller/mode", dtype="u1", labels={1: "STANCE"})]
    (tmp_path / "guide.yaml").write_text(text)
    assert log.load_script(tmp_path / "guide.yaml") == []
    of_script = log._conditions.now
    log.load_script(_emptied(tmp_path))
    assert log._conditions.now == Conditions()
    log.derive("power", "joints/tau * joints/dq", unit="W")
    when = "controller/mode == STANCE"
    log.limit("joints/tau", (-40, -30, 30, 40), persistence=4, hysteresis=0.5, stale="100ms", when=when)
    log.trigger(
        "fall", "abs(base/roll) > 30deg", pre="5s", post="1s", edge="rising", rearm="abs(base/roll) < 15deg",
        persist="20ms", holdoff="10s", mode="normal", save="silo", keep=20, armed=True,
    )  # fmt: skip
    assert log._conditions.now == of_script
    assert len(kept) == 4


def _emptied(folder: Path) -> Path:
    made = folder / "none.yaml"
    made.write_text("derived_signals: []\nsignal_limits: []\ntriggers: []\n")
    return made


KNOWN = "known are name, when, pre, post, edge, rearm, persist, holdoff, mode, save, keep, armed, patience"


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        ("triggers:\n  - {name: a, when: x > 1, later_silo: 3}", f"triggers 'a': unknown key 'later_silo'; {KNOWN}"),
        ("triggers:\n  - {name: a, when: x > 1, edges: 3}", "triggers 'a': unknown key 'edges'; did you mean 'edge'?"),
        ("triggers:\n  - {name: a, when: x > 1, ? [b, c] : 3}", f"triggers 'a': unknown key 'a list'; {KNOWN}"),
        ("signal_limits:\n  - {name: q, bound: [1, 2, 3, 4]}",
         "signal_limits 'q': unknown key 'bound'; did you mean 'bounds'?"),
        ("derived_signals:\n  - {name: d, expression: x, note: y}",
         "derived_signals 'd': unknown key 'note'; known are name, expression, unit"),
    ],
)  # fmt: skip
def test_an_unknown_key_of_a_condition_is_a_warning_with_its_line(text: str, warning: str) -> None:
    found = script(f"log_elements: []\n{text}\n")
    assert found.warnings == [f"config/robot.yaml:3: {warning}; it was left alone"]
    assert found.conditions is not None
    assert found.conditions != Conditions()


def test_unknown_keys_of_conditions_stand_again_in_a_script_that_is_written(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(
        "log_elements: []\n"
        "derived_signals:\n  - {name: /log/d, expression: x, note: [1, {deep: 2}]}\n"
        "triggers:\n  - name: fall\n    when: x > 1\n    later_silo:\n      more: 3\n  - {name: other, when: x > 2}\n"
    )
    before = read_script(path)
    assert write_script(path, []) == "; kept what silo doesn't know: note of /log/d, later_silo of fall"
    after = read_script(path)
    assert after.conditions == before.conditions
    assert [key.label for key in after.unknown_keys] == ["note of /log/d", "later_silo of fall"]
    assert "more: 3" in path.read_text()
    assert before.conditions is not None
    gone = msgspec.structs.replace(before.conditions, triggers=before.conditions.triggers[1:])
    assert write_script(path, [], gone) == "; kept what silo doesn't know: note of /log/d"
