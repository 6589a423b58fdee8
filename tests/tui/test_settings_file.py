"""The user's settings file: every mistake costs its own line, is told with its number, and writing keeps the rest."""

import os
import stat
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.errors import SaveError
from silo_tui.actions import BY_ID, COMMANDS
from silo_tui.keymap import clashes
from silo_tui.settings.file import path
from silo_tui.settings.keys import key_problem, read_key, read_path, typed_keys
from silo_tui.settings.options import OPTIONS, Settings, typed
from silo_tui.settings.reading import KEYS_ALONE, read, read_file
from silo_tui.settings.writing import rewritten, write_file

WHOLE = """\
# mine
theme: light      # the sun shines here
rate: 2
mouse: off
columns: [div, size]   # all I want
keymap: classic

keys:
  # as in less
  filter: [/, ctrl+f]
  sort: "O"
"""


def test_a_file_is_taken_as_it_is():
    found, problems = read(WHOLE)
    assert not problems
    assert found == Settings(
        theme="light",
        rate=2.0,
        mouse="off",
        columns=("div", "size"),
        keys={"filter": "slash,ctrl+f", "sort": "O"},
        keymap="classic",
    )


@pytest.mark.parametrize("text", ["", "\n", "# nothing\n", "keys:\n", "---\n", "columns:\n", "keys: {}\n"])
def test_an_empty_file_sets_nothing(text):
    assert read(text) == (Settings(), [])


CLASSIC = "keymap: classic\n"
MISTAKES = [
    ("colums: [div]", "'colums' is unknown; did you mean 'columns'?"),
    ("qwertz: 5", "'qwertz' is unknown; there are theme"),
    ("theme: drak", "theme is dark, light, contrast, 16, not drak; did you mean 'dark'?"),
    ("theme: [dark]", "not a list"),
    ("theme:", "not nothing"),
    ("rate: fast", "rate is 0.5 to 10, not fast"),
    ("rate: 100", "rate is 0.5 to 10, not 100"),
    ("rate: nan", "rate is 0.5 to 10, not nan"),
    ("columns: [div, sice]", "not sice; did you mean 'size'?"),
    ("theme: 'dark", "not valid YAML"),
    ("columns: [div", "not valid YAML"),
    ("  rate: 2", "not valid YAML"),
    ("rate: *2", "signs need quotes"),
    ("\ttheme: dark", "tab"),
    ("keys: 5", "keys is a group of lines"),
    ("keys:\n  fliter: f", "'fliter' is no command; did you mean 'filter'?"),
    ("keys:\n  set: f", "'set' is no command"),  # it can only be typed
    ("keys:\n  filter: crtl+f", "'crtl+f' is no key; did you mean 'ctrl+f'?"),
    ("keys:\n  filter: ctl+a", "did you mean 'ctrl+a'?"),
    ("keys:\n  filter: ctl+z", "did you mean 'ctrl+z'?"),
    ("keys:\n  filter: F13", "'F13' is no key; did you mean 'f3'?"),
    ("keys:\n  filter: e crtl+f", "'crtl+f' is no key"),
    ("keys:\n  filter: e d x", "'e d x' is more than two keys; a menu and a letter are, for example `e d`"),
    ("keys:\n  filter: alt+f", "terminals keep alt"),
    ("keys:\n  filter: ctrl+i", "terminals send it as Tab"),
    ("keys:\n  filter: shift+f", "write 'F'"),
    ("keys:\n  filter: #", "needs a key; a sign such as # needs quotes"),
    ("keys:\n  filter: e", "e of filter is edit (Edit) already (table)"),
    ("keys:\n  cursor_left: space", "space of cursor_left is pause (Pause) already (plots)"),
    ('keys:\n  filter: "?"', "? of filter is help (Help) already"),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES)
def test_a_mistake_costs_its_line_and_no_other(line, words):
    text = f"dots: blocks\n{line}\nview: last\nkeymap: classic\n"
    found, problems = read(text)
    assert (found.dots, found.view) == ("blocks", "always")
    assert found == Settings(dots="blocks", view="always", keymap="classic")
    assert len(problems) == 1
    assert words in str(problems[0])
    assert f"line {2 + line.count(chr(10))}:" in str(problems[0])


@pytest.mark.parametrize(
    ("text", "found", "told"),
    [
        ("rate: 2\nrate: 3\n", {"rate": 2.0}, "line 2: rate is there twice; the first counts. Left out"),
        (f"{CLASSIC}keys:\n  filter: f10\n  filter: f11\n", {"keys": {"filter": "f10"}},
         "line 4: filter is there twice; the first counts. Left out"),
        ("# mine\n- theme\n", {}, "line 2: write lines such as `theme: dark`, not a list"),
        (f"{CLASSIC}keys:\n  sort: O\n  apply: O\n", {"keys": {"sort": "O"}}, "line 4: O of apply is sort (Order) "),
    ],
)  # fmt: skip
def test_of_two_lines_for_one_thing_the_later_is_left_out_and_what_is_no_line_and_it_is_told(text, found, told):
    keymap = {"keymap": "classic"} if text.startswith(CLASSIC) else {}
    settings, problems = read(text)
    assert settings == Settings(**found, **keymap)
    (problem,) = map(str, problems)
    assert problem.startswith(f"tui.yaml {told}")


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("F1", "f1"), ("F12", "f12"), ("^F", "ctrl+f"), ("Ctrl+F", "ctrl+f"), ("Esc", "escape"), ("page up", "pageup"),
        ("PgUp", "pageup"), ("f", "f"), ("F", "F"), ("/", "slash"), ("Shift+Left", "shift+left"),
        ("ctrl+shift+up", "ctrl+shift+up"),
    ],
)  # fmt: skip
def test_a_key_is_read_as_people_write_it(words, key):
    assert read_key(words) == read_path(f" {words} ") == key


@pytest.mark.parametrize(("words", "keys"), [("e d", "e d"), ("g  F2", "g f2"), ("page down", "pagedown")])
def test_a_menu_and_a_letter_are_read_as_one(words, keys):
    assert read_path(words) == keys


@pytest.mark.parametrize(
    ("key", "why"),
    [
        ("f", ""),
        ("ctrl+f", ""),
        ("backslash", ""),
        ("quotation_mark", ""),
        ("ctrl+i", "terminals send it as Tab"),
        ("alt+f", "keep alt"),
    ],
)
def test_a_key_that_was_pressed_may_be_one_that_no_command_can_have(key, why):
    assert why in key_problem(key)
    assert bool(key_problem(key)) is bool(why)


@pytest.mark.parametrize(
    ("base", "text", "keys"),
    [
        ("classic", "filter: f10, ctrl+f", {"filter": "f10,ctrl+f"}), ("classic", 'filter: ","', {"filter": "comma"}),
        ("classic", 'filter: " , "', {"filter": "comma"}), ("classic", "filter: [f10, f10]", {"filter": "f10"}),
        ("classic", 'filter: ["/", f10]', {"filter": "slash,f10"}),
        ("two-layer", "last_capture: f10", {"last_capture": "f10"}),  # in classic alone it has one
        ("classic", "apply: x\n  discard: a", {"apply": "x", "discard": "a"}),
    ],
)  # fmt: skip
def test_a_command_has_one_key_or_several_and_two_may_change_theirs(base, text, keys):
    assert read(f"keymap: {base}\nkeys:\n  {text}\n") == (Settings(keymap=base, keys=keys), [])


def test_a_line_left_out_takes_its_key_back_from_another():
    # without `discard: e` x is discard's again
    found, problems = read("keys:\n  apply: x\n  discard: e\nkeymap: classic\n")
    assert found.keys == {}
    assert [problem.line for problem in problems] == [2, 3]


def test_keys_without_a_keymap_stay_those_of_before_and_it_is_told():
    found, problems = read("keys:\n  apply: x\n  discard: a\n")
    assert (found.keymap, found.keys) == ("classic", {"apply": "x", "discard": "a"})
    assert [(problem.line, problem.reason) for problem in problems] == [(1, KEYS_ALONE)]
    made = rewritten("rate: 2\n", Settings(), Settings(keys={"apply": "x"}))
    assert read(made) == (Settings(rate=2.0, keys={"apply": "x"}), [])


def test_the_commands_themselves_share_no_key_on_a_screen():
    assert not list(clashes("classic", {}))


@pytest.mark.parametrize("command", [each for each in COMMANDS if each.keys], ids=lambda each: each.id)
def test_every_key_is_read_as_it_is_written(command):
    from_file, problems = read(f"keys:\n  {command.id}: {typed_keys(command.keys)}\nkeymap: classic\n")
    assert not problems
    assert from_file.keys == {command.id: command.keys}
    assert [read_key(word) for word in BY_ID[command.id].key_text.split(" ")] == command.keys.split(",")


# ------------------------------------------------------------------------------------------------------------ writing


def test_only_what_changed_is_written_and_comments_stay():
    old, _ = read(WHOLE)
    new = Settings("dark", "octants", "off", 2.0, "off", ("div",), {"filter": "f", "sort": "O", "apply": "Z"})
    text = rewritten(WHOLE, old, new)
    assert read(text) == (new, [])
    assert "theme: dark      # the sun shines here\n" in text
    assert "columns: [div]   # all I want\n" in text
    assert "  # as in less\n" in text
    assert text.startswith("# mine\n")


def test_a_key_given_back_leaves_the_file():
    old, _ = read(WHOLE)
    assert read(rewritten(WHOLE, old, Settings())) == (Settings(), [])


def test_lines_that_were_left_out_stay_in_the_file():
    text = "colums: [div]\ntheme: 'dark\nrate: 2\n"
    old, problems = read(text)
    assert len(problems) == 2
    made = rewritten(text, old, Settings(rate=3.0))
    assert made == "colums: [div]\ntheme: 'dark\nrate: 3\n"


def test_what_was_typed_in_an_editor_meanwhile_stays():
    old = Settings()
    assert rewritten("rate: 2\n", old, Settings(theme="light")) == "rate: 2\ntheme: light\n"


LISTS = ["columns:\n- div\n- size # s\nrate: 2\n", "columns:\n  - div\n\nrate: 2\n", "columns:\nrate: 2\n"]


@pytest.mark.parametrize("text", LISTS)
def test_a_list_in_lines_becomes_one_line(text):
    old, _ = read(text)
    made = rewritten(text, old, Settings(rate=2.0, columns=("buf",)))
    assert read(made) == (Settings(rate=2.0, columns=("buf",)), [])


values = st.fixed_dictionaries(
    {
        option.name: st.lists(st.sampled_from(option.words), unique=True).map(tuple)
        if option.several
        else st.sampled_from(option.words)
        if option.words
        else st.sampled_from([0.5, 1.0, 2.5, 10.0])
        for option in OPTIONS
    }
)
keys = st.dictionaries(
    st.sampled_from(["filter", "sort", "apply"]),
    st.sampled_from(["f10", "f11,ctrl+f", "number_sign", "e backslash,quotation_mark"]),
).filter(lambda found: not list(clashes("classic", found)))
made_settings = st.builds(lambda fields, own: Settings(**fields, keys=own), values, keys)
layouts = st.sampled_from(
    ["", "# a\n", WHOLE, "keys: {filter: f10}\n", "keys:\n\n# end", "rate: 3", "colums: 1\n", *LISTS]
)


@settings(max_examples=60, deadline=None)
@given(layouts, made_settings)
def test_whatever_is_written_is_read_again(text, new):
    old, problems = read(text)
    made = rewritten(text, old, new)
    again, told = read(made)
    assert again == new
    assert len([each for each in told if each.reason != KEYS_ALONE]) == len(
        [each for each in problems if each.reason != KEYS_ALONE]
    )
    assert rewritten(made, new, new) == made


@pytest.mark.parametrize("text", ["keys:", "keys:\n", "keys:\n  filter:\n", "rate:\nkeys:\n  filter: f10\n"])
def test_no_line_that_is_written_ends_in_a_blank(text):
    made = rewritten(text, Settings(), Settings(rate=3.0, keys={"filter": "f11"}))
    assert [line for line in made.splitlines() if line != line.rstrip()] == []


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "silo"


def test_the_file_is_made_where_there_is_none(home):
    assert read_file() == (Settings(), [])
    assert write_file(Settings(), Settings(theme="light")) == home / "tui.yaml"
    assert read_file()[0].theme == "light"
    assert [each.name for each in home.iterdir()] == ["tui.yaml"]
    assert stat.S_IMODE(home.stat().st_mode) == 0o700


def test_a_link_stays_a_link_and_its_file_keeps_its_mode(home, tmp_path):
    home.mkdir(parents=True)
    kept = tmp_path / "dotfiles.yaml"
    kept.write_text("rate: 2\n")
    kept.chmod(0o600)
    path().symlink_to(kept)
    write_file(read_file()[0], Settings(rate=3.0))
    assert path().is_symlink()
    assert kept.read_text() == "rate: 3\n"
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (b"rate: \xff", "byte 7 is no UTF-8"),
        (None, "can't be read (it is no file)"),
        (b"#" * 1_000_001, "can't be read (it has more than 1 MB)"),
    ],
)
def test_a_file_that_cant_be_read_leaves_the_defaults_and_is_not_written_over(home, bad, why):
    home.mkdir(parents=True)
    path().mkdir() if bad is None else path().write_bytes(bad)
    found, problems = read_file()
    assert found == Settings()
    assert list(map(str, problems)) == [f"tui.yaml: {why}; the defaults count"]
    with pytest.raises(SaveError, match="nothing was changed"):
        write_file(found, Settings(rate=3.0))


def test_a_large_file_is_read(home):
    home.mkdir(parents=True)
    path().write_bytes(b"rate: 2\n".ljust(1_000_000, b"#"))
    assert read_file() == (Settings(rate=2.0), [])


def test_a_relative_config_home_is_none(monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", "here")
    assert path() == path().expanduser()
    assert path().is_absolute() or not os.environ.get("HOME")


@given(st.text(max_size=60))
@settings(max_examples=100, deadline=None)
def test_no_text_at_all_stops_the_reader(text):
    found, problems = read(text)
    assert found == Settings() or not problems or text
    assert all(typed(getattr(found, option.name)) for option in OPTIONS)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[0:", 1), ("rate: 7\nkeys: {a: 1\ntheme: dark", 2), ("rate: 7\nx\ntheme: dark", 2),
        ("rate: 7\n'x\ntheme: dark", 2), ("rate: 7\n  theme: dark", 2), ("rate: 7\ntheme: dark\n- a", 3),
        ("rate: 7\ncolumns:\n  - unit\n - on", 4),
    ],
)  # fmt: skip
def test_what_is_no_yaml_is_told_of_with_the_line_where_it_begins(text, line):
    found, problems = read(text)
    assert problems[0].line == line
    assert found.rate == (7 if text.startswith("rate") else Settings().rate)


@pytest.mark.parametrize(
    "text",
    [
        "? [a, b]\n: c\n",
        "? {a: b}\n: c\n",
        "keys:\n  ? [a, b]\n  : c\n",
        "? [theme]\n: light\n",
        "keys: {? [a] : x}\n",
        "? [a, b]",
    ],
)
def test_a_key_that_is_a_list_or_a_group_costs_its_line_and_no_other(text):
    found, problems = read(f"theme: light\n{text}")
    assert found.theme == "light"
    assert problems
    assert all(problem.line for problem in problems)
    assert "theme: dark" in rewritten(f"theme: light\n{text}", found, replace(found, theme="dark"))


def test_a_list_that_holds_itself_is_told_of_and_can_be_written_over():
    text = "columns: &all [*all]\ntheme: light\n"
    found, problems = read(text)
    assert problems
    assert "theme: dark" in rewritten(text, found, replace(found, theme="dark"))


OLD_NAMES = "keys:\n  next_logger: f\n  next_recording: [n, f]\n  mark_loggers: y\nkeymap: classic\n"


def test_keys_of_one_list_are_taken_as_those_of_all_lists_and_told():
    found, problems = read(OLD_NAMES)
    assert found.keys == {"list_down": "f,n", "list_mark_all": "y"}
    assert [problem.line for problem in problems] == [2, 3, 4]
    assert str(problems[0]).endswith("next_logger is list_down now, one for all lists: taken as that; write list_down")


def test_a_key_of_lists_that_is_changed_takes_the_place_of_its_names_of_before():
    found, _ = read(OLD_NAMES)
    made = rewritten(OLD_NAMES, found, replace(found, keys={**found.keys, "list_down": "ctrl+f"}))
    assert made == "keys:\n  list_down: ctrl+f\n  mark_loggers: y\nkeymap: classic\n"
    given_back = {name: keys for name, keys in found.keys.items() if name != "list_mark_all"}
    assert "mark_loggers" not in rewritten(OLD_NAMES, found, replace(found, keys=given_back))


def test_a_file_that_a_line_does_not_fit_into_is_left_as_it_is():
    with pytest.raises(SaveError, match="can't take the changes as it is: look at its lines; nothing was changed"):
        rewritten("{theme: dark}\n", Settings(), Settings(rate=3.0))
