"""The law of keys, as data: which key does what, on which screens; every screen is held against it."""

import ast
import re
from pathlib import Path

import pytest

import silo_tui
from silo_tui.actions import BY_ID, COMMANDS, commands_for, key_of, key_that_retries, use_keys
from silo_tui.keymap import where, why_no_use

# T table, P plots, D large plot, G triggers, A alarms, R recordings, E events, L loggers, H settings, K parameters,
# U runs, V their comparison, B Bode plot; each on a logger, and, where there is one, on a file
SCREENS = {
    "T": ("table", "file"), "P": ("monitor", "file_monitor"), "D": ("detail", "file_detail"), "G": ("triggers",),
    "A": ("alarms",), "R": ("recordings",), "E": ("events", "file_events"), "L": ("loggers",), "H": ("settings",),
    "K": ("parameters",), "U": ("runs",), "B": ("response",), "M": ("messages",), "V": ("comparison",),
}  # fmt: skip
ALL = "TPDGARELHKUMV"
# keys; what their commands are called, any of these words; where
LAW = (
    ("j down", "next down older", ALL),
    ("k up", "previous up newer", ALL),
    ("g", "top first follow", ALL),
    ("G", "bottom last oldest", ALL),
    ("ctrl+d pagedown", "page later", ALL),
    ("ctrl+u pageup", "page earlier", ALL),
    ("home", "top first oldest start follow", ALL),
    ("end", "bottom last now end oldest", ALL),
    ("0", "all whole", "PD"),
    ("left right h l", "field cursor turn", "TPDK"),
    ("shift+left shift+right", "far", "PDK"),
    ("comma full_stop", "sample", "PD"),
    ("enter", "edit detail open plot go to capture worst change", "TPGARELHKUV"),
    ("escape", "back", ALL + "B"),
    ("tab", "field view", "TPDRHB"),
    ("slash", "filter search", "TGARELHKUMV"),
    ("o", "order", "TGARELKUV"),
    ("C", "columns", "TGARELU"),
    ("z", "fold", "TPL"),
    ("n", "entry", "TP"),
    ("Z", "zero", "TP"),
    ("space", "mark pause", "TPDGARLKU"),
    ("asterisk", "all", "TGARLKU"),
    ("V", "range", "TGARLKU"),
    ("e", "edit limits change", "TGAHK"),
    ("t", "on/off arm/off stop", "TGR"),
    ("x", "discard remove delete default", "TPGARHK"),
    ("d", "divider", "T"),
    ("s", "size", "T"),
    ("b", "buffer", "T"),
    ("p", "publish", "T"),
    ("equals_sign", "set", "T"),
    ("u", "undo", "TK"),
    ("ctrl+r", "redo", "TK"),
    ("a", "apply", "T"),
    ("i", "inspector", "T"),
    ("m", "monitor plot", "TPDGAK"),
    ("r", "refresh again", "TGARELDKUB"),
    ("S", "start", "TPL"),
    ("R", "restart", "TPL"),
    ("L", "load", "TLK"),
    ("W", "save", "TL"),
    ("w", "save write fetch", "TPDREHLK"),
    ("plus minus", "shorter longer", "PD"),
    ("y", "scale", "PD"),
    ("Y", "log", "PD"),
    ("J", "join", "P"),
    ("I", "isolate", "P"),
    ("B", "cursor b", "PD"),
    ("f", "find", "PD"),
    ("right_square_bracket left_square_bracket", "found peak", "PD"),
    ("right_curly_bracket left_curly_bracket", "event newer older", "PDE"),
    ("c", "catch compare", "PDK"),
    ("less_than_sign greater_than_sign", "level turn", "PK"),
    ("exclamation_mark", "force", "G"),
    ("X", "swap", "D"),
    ("N", "new record", "TPGAR"),
    ("M", "marker", "TPDE"),
    ("K", "acknowledge", "A"),
    ("O", "overlay", "RU"),
    ("D", "demo", "L"),
    ("T", "triggers", "TPDGARELK"),
    ("A", "alarms", "TPDGARELK"),
    ("F", "recordings", "TPDGARELK"),
    ("E", "events", "TPDGARELK"),
    ("P", "parameters", "TPDGARELK"),
    ("ctrl+l", "loggers", "TPDGAREK"),
    ("f2", "settings", "TPDGARELKUBMV"),
    ("colon", "command", ALL + "B"),
    ("question_mark", "help", ALL + "B"),
    ("ctrl+p", "palette", ALL + "B"),
    ("q ctrl+q", "quit", ALL + "B"),
    ("ctrl+z", "suspend", ALL + "B"),
)
EDITING = "e t x d s b p equals_sign u ctrl+r a S R L W r w N M"
OF_LOGGERS = "T A F P ctrl+l"
# what the law wants and isn't there, and why
LEFT_OUT = {
    "table": (),
    "file": (
        (EDITING, "a saved file: nothing to edit, to start or to read again (which is said)"),
        (OF_LOGGERS, "of a logger: Esc goes back to it"),
        ("left right h l tab", "there are no fields to edit"),
        ("Z", "its statistics are of the whole run"),
    ),
    "monitor": (),
    "detail": (),
    "triggers": (("C", "one set of columns"), ("T", "here already")),
    "alarms": (("C", "one set of columns"), ("A", "here already")),
    "recordings": (
        ("C", "one set of columns"), ("F", "here already"), ("tab", "one view"),
    ),
    "events": (("C", "one set of columns"), ("E", "here already")),
    "parameters": (("P", "here already"),),
    "loggers": (
        ("C", "one set of columns"), ("z", "no branches"), ("W", "the table of one logger: there"),
        ("T A F E P", "of a logger: Enter opens one"),
    ),
    "settings": (("tab", "one view"),),
    "runs": (),
    "response": (),
    "messages": (),
    "comparison": (),
}  # fmt: skip
LEFT_OUT["file_monitor"] = (
    *LEFT_OUT["monitor"], ("c Z", "of what comes"),
    ("space S R N M less_than_sign greater_than_sign", "a file stands still, and nothing of it is edited"),
    (OF_LOGGERS, "of a logger"),
)  # fmt: skip
LEFT_OUT["file_detail"] = (*LEFT_OUT["detail"], ("r space c M", "nothing comes any more"), (OF_LOGGERS, "of a logger"))
LEFT_OUT["file_events"] = (*LEFT_OUT["events"], ("r M", "nothing comes any more"), (OF_LOGGERS, "of a logger"))
SCOPES = [scope for scopes in SCREENS.values() for scope in scopes]


def wanted(scope):
    """Which keys the law gives a screen, with the words of each."""
    letter = next(letter for letter, scopes in SCREENS.items() if scope in scopes)
    return {key: words.split() for keys, words, where in LAW if letter in where for key in keys.split()}


def there(scope):
    found = {}
    for command in commands_for(scope):
        for key in command.keys.split(","):
            found.setdefault(key, []).append(command)
    return found


def left_out(scope):
    return {key for keys, _ in LEFT_OUT[scope] for key in keys.split()}


@pytest.mark.parametrize("scope", SCOPES)
def test_a_screen_has_every_key_of_the_law_or_says_why_not(scope):
    assert set(wanted(scope)) - set(there(scope)) == left_out(scope)


@pytest.mark.parametrize("scope", SCOPES)
def test_a_key_does_what_the_law_calls_it(scope):
    for key, words in wanted(scope).items():
        for command in there(scope).get(key, ()):
            told = f"{command.label} {command.help}".casefold()
            assert any(word in told for word in words), f"{key} on {scope} is {command.id}: {told}"


@pytest.mark.parametrize("scope", SCOPES)
def test_no_key_has_two_meanings_on_a_screen(scope):
    assert {key: [each.id for each in found] for key, found in there(scope).items() if len(found) > 1} == {}


def test_a_key_that_the_law_knows_means_nothing_else_on_a_screen_that_lacks_it():
    law = {key for keys, _, _ in LAW for key in keys.split()}
    # h and l choose words in the settings, = is + of a keyboard without it; without a link r tries now on all screens
    known = {"settings": {"left", "right", "h", "l", "home", "end", "f2"}, "monitor": {"r"}}
    for scope in SCOPES:
        more = (set(there(scope)) & law) - set(wanted(scope)) - known.get(scope, set())
        assert more <= {"equals_sign"}, (scope, more)


def test_every_screen_is_held_against_the_law():
    assert {scope for command in COMMANDS for scope in command.scopes} - {"any", "scope"} == set(
        SCOPES
    )  # the scope has keys of its own


def test_a_key_without_a_use_says_where_it_has_one():
    assert why_no_use("V", "monitor") == (
        "V (Range) has no use here: it is a key of table, triggers (T), alarms (A) and others"
    )
    use_keys({"zero": "f9"})
    assert why_no_use("f9", "settings").startswith("F9 (Zero) has no use here: it is a key of table")
    use_keys({})
    assert why_no_use("w", "file") == (
        "a saved file: nothing to edit; w (Write): it is a key of plots of a file, large plot of a file, "
        "events of a file"
    )
    assert why_no_use("Q", "table") == "Q is no key of silo-tui; ? shows those that are"
    assert why_no_use("backspace", "table").startswith("Backspace is no key")
    assert why_no_use("shift+f5", "table").startswith("⇧F5 is no key")
    assert {why_no_use(key, scope) for key in "tuS" for scope in ("file", "file_events", "file_detail")} == {
        "a saved file: nothing to edit"
    }


def test_what_is_said_names_the_users_keys():
    assert key_of("refresh") == "r"
    use_keys({"refresh": "ctrl+f", "list_read": "f5,f6"})
    assert (key_of("refresh"), key_of("list_read"), key_of("list_read", last=True)) == ("^f", "F5", "F6")
    assert [key_that_retries(scope) for scope in ("table", "monitor", "events", "settings")] == [
        "^f",
        "r",
        "F5",
        "",
    ]


def sentences():
    """Yield what stands in quotes, but for docstrings, with its file."""
    for path in sorted(Path(silo_tui.__file__).parent.rglob("*.py")):
        tree = ast.parse(path.read_text("utf-8"))
        docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
                yield path.name, node.value


def test_no_sentence_names_a_key_by_its_letter():
    verbs = (
        "tries saves lists brings looks keeps makes begins arms switches takes changes starts gives isolates marks "
        "plots edits leads"
    )
    letter = re.compile(rf"\b([b-zB-Z]|F\d|\^[a-z]) (again |then )?({verbs.replace(' ', '|')}|from now)\b")
    known = ("cli.py", "actions.py", "events.py")  # of Ctrl+C and `M`
    assert [(name, said[:80]) for name, said in sentences() if letter.search(said) and name not in known] == []


def test_what_is_called_a_script_by_keys_shell_and_events_has_no_other_name_in_a_sentence():
    known = ("cli.py", "actions.py")  # of Zenoh; what a script is, for who looks for it by another word
    assert [(name, said[:80]) for name, said in sentences() if "onfiguration" in said and name not in known] == []


@pytest.mark.parametrize("scope", SCOPES)
def test_a_way_that_is_told_is_a_key_of_where_one_is(scope):
    there = {"runs"} & {command.id for command in commands_for(scope)}
    _, sentence = where([BY_ID["compare_runs"]], scope)
    assert ("F3" in sentence or "g f" in sentence) == bool(there) or scope.startswith("file")
