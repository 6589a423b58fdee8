"""What the words of a command mean, without a logger."""

import importlib
import json
import os
import re
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

import silo
from silo.cli.codes import EXIT_FAILED, EXIT_FOUND, EXIT_NO_LOGGER, EXIT_USAGE
from silo.cli.common import logged_for, next_names, split_logger
from silo.cli.edits import select, split_settings
from silo.cli.group import COMMANDS, cli
from silo.cli.loggers.ls import _facts
from silo.cli.logs.recover import _incomplete
from silo.cli.main import main, run
from silo.cli.other_words import OTHER_WORDS
from silo.core.elements import Action, BufferType, ElementOptions, LoggedEvent, State
from silo.core.quantities.writing import duration_text, wall_clock
from silo.core.runtime import RECORDERS_SUFFIX
from silo.errors import ElementError
from silo.fleet.fleet import FleetNow
from silo.fleet.member import Member
from silo.fleet.resolving import Discovery
from silo.fleet.routers import RouterTold
from silo.net.found import LoggerAddress
from silo.rpc.published import Summary
from silo.settings.typed import ElementSettings, RelativeValue, apply_settings, read_settings
from silo.version import VERSION
from tests.waiting import DEADLINE_S

NAMES = ["/log/base/pose", "/log/base/twist", "/log/legs/LF/torque", "/log/legs/RF/torque", "/log/legs/RF/contact"]
HEAVY = ("numpy", "textual", "plotext", "silo.logger.logger", "silo.segment.reader")
NOT_FOR_LS = ("silo.settings.typed", "silo.settings.options", "silo.net.access.admission", "silo.net.access.rights")


def names_of(*patterns: str) -> list[str]:
    return [NAMES[place] for place in select(NAMES, patterns)]


@pytest.mark.parametrize(
    ("patterns", "places"),
    [
        ("/log/base/pose", [0]),
        ("/log/base", [0, 1]),  # a namespace
        ("/log/base/", [0, 1]),
        ("/", [0, 1, 2, 3, 4]),
        ("*", [0, 1, 2, 3, 4]),
        ("*/torque", [2, 3]),  # a star crosses slashes
        ("RF", [3, 4]),  # without a slash in front it may begin anywhere
        ("*/torque /log/legs/LF /log/base/pose", [0, 2, 3]),  # each once, in the order of the table
    ],
)
def test_patterns_name_elements(patterns: str, places: list[int]) -> None:
    assert names_of(*patterns.split()) == [NAMES[place] for place in places]


@pytest.mark.parametrize(
    ("patterns", "words"),
    [
        ("/log/bas", "no element matches '/log/bas'; did you mean '/log/base/pose'?"),  # half a name is no namespace
        ("/log/base/twits", "no element matches '/log/base/twits'; did you mean '/log/base/twist'?"),
        ("nobody /log/base/twist", "no element matches 'nobody'; `silo info -e` lists them; no logger of that "
         "name runs here: `silo ls`"),
    ],
)  # fmt: skip
def test_a_pattern_that_names_nothing_tells_the_nearest_name_or_that_no_logger_has(patterns: str, words: str) -> None:
    with pytest.raises(ElementError) as caught:
        names_of(*patterns.split())
    assert str(caught.value) == words


@pytest.mark.parametrize(
    ("word", "settings"),
    [
        ("on", ElementSettings(enabled=True)),
        ("off", ElementSettings(enabled=False)),
        ("enabled=No", ElementSettings(enabled=False)),
        ("divider=5", ElementSettings(divider=5)),
        ("buffer=Growing", ElementSettings(buffer=BufferType.GROWING)),
        ("buffer=0", ElementSettings(buffer=BufferType.FIXED)),
        ("size=1000", ElementSettings(size=1000)),
        ("size=10s", ElementSettings(size=RelativeValue("s", 10.0))),
        ("size=250ms", ElementSettings(size=RelativeValue("s", 0.25))),
        ("size=1.5min", ElementSettings(size=RelativeValue("s", 90.0))),
        ("action=save", ElementSettings(action=Action.SAVE)),
        ("action=publish", ElementSettings(action=Action.PUBLISH)),
        ("action=both", ElementSettings(action=Action.SAVE_AND_PUBLISH)),
        ("action=save-and-publish", ElementSettings(action=Action.SAVE_AND_PUBLISH)),
    ],
)
def test_a_word_is_a_setting(word: str, settings: ElementSettings) -> None:
    assert read_settings([word]) == settings


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        ("divider=0", "element '/x': divider must be a whole number from 1 to 2147483647, got 0"),
        ("divider=two", "divider must be 1 to 2147483647, 50Hz, *2, /2 or +1, got two"),
        ("size=10x", "size must be 1 to 2147483647, 10k, 10s, *2, /2 or +10, got 10x"),
        ("buffer=round", "buffer must be looping (1), fixed (0) or growing (2), got round"),
        ("action=send", "action must be save (1), both (0) or publish (2), got send"),
        ("enabled=2", "enabled must be on or off, got 2"),
        ("divder=2", "no setting 'divder'; did you mean 'divider'?"),
    ],
)
def test_a_wrong_setting_is_told_in_words(word: str, reason: str) -> None:
    with pytest.raises(ElementError) as error:
        apply_settings(read_settings([word]), [("/x", ElementOptions())], 100.0)
    assert str(error.value) == f"{reason}; nothing was changed"


def test_a_size_as_a_time_follows_the_new_divider() -> None:
    new = apply_settings(read_settings(["size=10s", "divider=4"]), [("/x", ElementOptions(size=7))], 400.0)
    assert new == [ElementOptions(divider=4, size=1000)]


def test_settings_leave_the_other_fields_alone() -> None:
    now = ElementOptions(False, 3, Action.PUBLISH, BufferType.FIXED, 9)
    new = apply_settings(read_settings(["on"]), [("/x", now)], 100.0)
    assert new == [ElementOptions(True, 3, Action.PUBLISH, BufferType.FIXED, 9)]


def test_words_are_split_into_logger_patterns_and_settings() -> None:
    assert split_logger(("demo", "/log", "on")) == ("demo", ["/log", "on"])
    assert split_logger(("demo.4711",)) == ("demo.4711", [])
    assert split_logger(("*/torque", "on")) == (None, ["*/torque", "on"])
    assert split_settings(["/log", "divider=2", "off"]) == (["/log"], ["divider=2", "off"])


@pytest.mark.parametrize(
    ("there", "words", "or_pattern", "wanted"),
    [
        ("demo", "torque on", True, (None, ["torque", "on"])),
        ("demo", "demo on", True, ("demo", ["on"])),
        ("demo", "torque on", False, ("torque", ["on"])),
        ("demo arm", "torque on", True, ("torque", ["on"])),
        ("", "torque on", True, ("torque", ["on"])),
        ("demo", "joints/q on", False, (None, ["joints/q", "on"])),
        ("demo", "robot3/demo on", False, ("robot3/demo", ["on"])),
        ("demo", "*/torque on", True, (None, ["*/torque", "on"])),
        ("demo", "silo:///demo/log/x on", False, ("demo", ["/log/x", "on"])),
        ("demo", "silo:///demo on", False, ("demo", ["on"])),
    ],
)
def test_a_word_is_a_pattern_where_no_logger_can_be_meant_by_it(there, words, or_pattern, wanted, monkeypatch) -> None:
    found = Discovery([LoggerAddress(name, 4711, "", "ann", host="robot3") for name in there.split()], [])
    monkeypatch.setattr("silo.cli.common.discovered", lambda: found)
    assert split_logger(words.split(), or_pattern=or_pattern) == wanted


@pytest.mark.parametrize(
    ("module", "words"),
    [("edits", "set torque divider=2"), ("loggers.watch", "watch torque"), ("logs.record", "record torque")],
)
def test_a_command_that_takes_patterns_is_for_the_only_logger_where_it_begins_with_one(
    module, words, monkeypatch
) -> None:
    asked = []

    def connect(logger):
        asked.append(logger)
        raise silo.SiloError("seen")

    found = Discovery([LoggerAddress("demo", 4711, "", "ann", host="robot3")], [])
    monkeypatch.setattr("silo.cli.common.discovered", lambda: found)
    monkeypatch.setattr(f"silo.cli.{module}.connect", connect)
    run(words.split())
    assert asked == [None]


def test_how_long_it_runs_is_told_of_a_logger_that_runs(monkeypatch) -> None:
    monkeypatch.setattr("time.time_ns", lambda: 10**18 + 12 * 10**9)
    for state, text in ((State.RUNNING, "00:12"), (State.STOPPED, "-")):
        assert logged_for(SimpleNamespace(state=state, run_began_ns=10**18)) == text


def test_completion_stops_at_the_next_slash_where_there_are_too_many_names() -> None:
    many = [f"/log/group{i % 3}/x{i}" for i in range(300)]
    assert next_names(many, "/lo") == ["/log/"]
    assert next_names(many, "/log/") == ["/log/group0/", "/log/group1/", "/log/group2/"]
    assert next_names(many, "/log/group1/x1")[:2] == ["/log/group1/x1", "/log/group1/x10"]


@pytest.mark.parametrize(("seconds", "text"), [(12, "00:12"), (3723, "1:02:03"), (277_445, "3 d 05:04")])
def test_durations_are_short(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_a_time_of_the_clock_is_cut_never_rounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Etc/GMT-2")
    time.tzset()
    try:
        moment = 1_700_000_039_999_600_000  # 22:13:59.9996 UTC
        assert wall_clock(moment) == "00:13:59"
        assert wall_clock(moment, 3) == "00:13:59.999"
        assert wall_clock(moment, 1, date=True) == "2023-11-15 00:13:59.9"
        assert wall_clock(moment, 9)[-10:] == ".999600000"
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in ("completion", "script")])
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "--help"]) == 0
    assert f"  silo {command}" in capsys.readouterr().out


def test_every_line_of_the_help_fits_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    run(["--help"])
    shown = capsys.readouterr().out
    assert all(f"  {name} " in shown for name in COMMANDS)


def test_commands_that_ask_a_logger_say_when_there_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["ls"], ["info"], ["start"], ["stop", "demo"], ["save"], ["set", "*", "on"], ["script", "show"]):
        assert run(words) == EXIT_NO_LOGGER
        shown = capsys.readouterr()
        assert "silo: no logger" in shown.err
        assert "try `silo demo`" in shown.err
        assert shown.out == ""


def test_without_loggers_json_is_an_empty_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ls", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == []


@pytest.mark.parametrize(
    ("words", "way"),
    [
        ("stpo", "no command 'stpo'; did you mean 'stop'?"),
        ("script shwo", "no command 'shwo'; did you mean 'show'?"),
        ("script compare", "no command 'compare'; there are list, show, check, load, save, diff"),
        ("files fetsh", "no command 'fetsh'; did you mean 'fetch'?"),
        ("trigger compare", "no command 'compare'; there are"),
        ("set divider=2", "give a pattern and a setting"),
        ("help", "`silo COMMAND --help`"),
        ("list", "`silo ls` lists the loggers"),
        ("open logs", "`silo-tui LOGGER|FILE`"),
        ("top", "`silo-tui LOGGER|FILE`"),
        ("status bot", "`silo info LOGGER|FILE`"),
        ("echo bot q", "`silo watch LOGGER [NAME]`"),
        ("export run.silo csv", "`silo convert FILE OUT.csv`"),
        ("limit bot q -1 1", "`silo check FILE --limit"),
        ("bot info", "the command comes first: `silo info bot`"),
        (__file__, f"`silo info {__file__}`"),
    ],
)
def test_a_word_that_is_no_command_is_answered_with_the_nearest_or_with_what_does_it(words, way, capsys):
    assert run(words.split()) == EXIT_USAGE
    assert way in capsys.readouterr().err


def test_two_files_in_place_of_one_are_told_of(tmp_path, capsys):
    files = [tmp_path / name for name in ("a.silo", "b.silo")]
    for file in files:
        file.touch()
    assert run(["info", *map(str, files)]) == EXIT_USAGE
    assert f"one file at a time: silo info {files[0]}" in capsys.readouterr().err


def test_what_is_said_instead_is_a_command_that_there_is():
    for word, way in OTHER_WORDS.items():
        assert word not in COMMANDS
        assert set(re.findall(r"`silo ([a-z]\w*)", way)) <= COMMANDS.keys(), way


def test_a_logger_in_place_of_the_words_is_no_mark(bench, capsys):
    bench.logger.start()
    assert run(["mark", "bot"]) == EXIT_USAGE
    assert "'bot' is the logger: which words?" in capsys.readouterr().err


def test_machines_are_told_why_a_logger_has_no_status():
    (fact,) = _facts([Member(LoggerAddress("bot", 4711, "", "ann", host="robot3"), problem="hangs", mute="no answer")])
    assert (fact["state"], fact["error"]) == ("no answer", "hangs")


def test_of_many_hosts_that_are_gone_the_first_are_told_behind_what_routers_refused(capsys):
    of = importlib.import_module("silo.cli.loggers.ls")
    lost = [Member(LoggerAddress("arm", 0, "", "", "lab", f"rob{n:02}"), here=False, since_s=5.0) for n in range(23)]
    of._tell_gone(FleetNow(routers=(RouterTold("desk9", 2, "eve"),)), lost)
    out, told = capsys.readouterr()
    router, *hosts, more = told.splitlines()
    assert (out, router) == ("", "router desk9: 2 logins refused within the last hour, the last: eve")
    assert [line.partition("/arm: unreachable since ")[0] for line in hosts] == [f"rob{n:02}" for n in range(20)]
    assert more == "and 3 hosts more"


def test_a_column_that_one_logger_needs_has_a_word_for_nothing_at_the_others(monkeypatch, capsys):
    of = importlib.import_module("silo.cli.loggers.ls")
    monkeypatch.setattr(of, "_ls_row", lambda _: ("x",) * 10)
    monkeypatch.setattr(of, "_addresses", lambda _: [])
    none = {"durable_ticks": -1, "recorders": 0, "disk_bytes": 0, "alarms": 0, "denied": 0, "clients": []}
    each = [SimpleNamespace(**none), SimpleNamespace(**none | {"durable_ticks": 0, "recorders": 2})]
    of._show_table([SimpleNamespace(found=None, status=one) for one in each])
    shown = [line.split()[10:] for line in capsys.readouterr().out.splitlines()]
    assert shown == [["DURABLE", "TO", "TICK", "REC"], ["-", "0"], ["0", "2"]]


@pytest.mark.parametrize(("state", "cell"), [(State.DEAD, "-"), (State.RUNNING, "0")])
def test_a_list_says_of_no_dead_program_that_it_lost_nothing(state, cell):
    of = importlib.import_module("silo.cli.loggers.ls")
    told = {"host": "rob", "measured_hz": 0.0, "run_ticks": 5, "enabled": 1, "elements": 1, "pid": 7, "user": "me"}
    status = SimpleNamespace(state=state, lost=0, run_began_ns=1, **told)
    one = SimpleNamespace(found=LoggerAddress("arm", 7, "", "me"), word=state.value, stalled=False, status=status)
    one.lost_count = Member(one.found, Summary(state=state)).lost_count
    assert of._ls_row(one)[6] == cell


def test_of_what_happens_from_now_on_that_of_one_kind_is_printed(monkeypatch, capsys):
    of, since = importlib.import_module("silo.cli.loggers.events"), []

    def news(_, newest):
        since.append(newest)
        yield [LoggedEvent(kind, f"{kind} it", 1, 1, 1, "ann", "1f", 8) for kind in ("alarm", "marker")]
        raise KeyboardInterrupt

    monkeypatch.setattr(of, "_news", news)
    of.watch_kind(SimpleNamespace(events=lambda *_: [SimpleNamespace(number=7)]), "marker")
    shown = capsys.readouterr().out
    assert ("marker it" in shown, "alarm it" in shown, since) == (True, False, [7])


@pytest.mark.parametrize(("named", "wanted"), [(None, "ab"), (["/logs"], "a"), (["/logs/walks/deep"], "")])
def test_recordings_into_a_folder_that_is_named_are_completed(runtime_folder, monkeypatch, named, wanted):
    orders = (SimpleNamespace(name="a", folder="/logs/walks"), SimpleNamespace(name="b", folder="/"))
    (runtime_folder / f"bot{RECORDERS_SUFFIX}").touch()
    lists = [("bot", [SimpleNamespace(order=order) for order in orders])]
    monkeypatch.setattr("silo.recorder.left_recordings.left_lists", lambda: lists)
    assert "".join(one.order.name for one in _incomplete(named)) == wanted


def test_what_a_recording_can_not_have_is_told_as_it_begins(monkeypatch, capsys):
    started = SimpleNamespace(name="all", folder="/logs", text="2 elements come to an end")
    client = SimpleNamespace(record=lambda *_: started, found=SimpleNamespace(label="bot"))
    monkeypatch.setattr(importlib.import_module("silo.cli.logs.record"), "connect", lambda _: nullcontext(client))
    assert run(["record", "bot"]) == 0
    said = "recording 'all' to /logs; `silo record bot --stop all` ends it\n"
    assert capsys.readouterr() == (said, "2 elements come to an end\n")


@pytest.mark.parametrize(
    ("more", "code", "out", "err"),
    [
        ("enabled: true", 0, "{}: fine, 1 element\n", ""),
        (
            "rat: 0", EXIT_FOUND, "{}: 1 element, 2 warnings\n",
            "warning: {}:3: element '/log/a': unknown key 'rat' in an element; ",
        ),
        (
            "divider: 2", EXIT_FOUND, "{}: 1 element, 1 warning\n",
            "warning: {}:2: element '/log/a' is off, as it has no key 'enabled': write `enabled: true`",
        ),
        *(
            (
                f"enabled: true\n- name: {name!r}\n  enabled: true", EXIT_FOUND, "{}: 2 elements, 1 warning\n",
                f"warning: {{}}:4: element '{name}': names stand there whole, as `/log/joints/q`",
            ) for name in ("q", "/log/*")
        ),
        (
            "divider: 0", EXIT_FAILED, "",
            "{}:3: element '/log/a': divider must be a whole number from 1 to 2147483647, got 0",
        ),
    ],
)  # fmt: skip
def test_a_script_is_checked_and_told_of_by_its_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: str, code: int, out: str, err: str
) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(f"log_elements:\n- name: /log/a\n  {more}\n")
    assert run(["script", "check", str(path)]) == code
    shown = capsys.readouterr()
    assert shown.out == out.format(path)
    assert err.format(path) in shown.err
    assert bool(err) is bool(shown.err)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_for_each_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["completion", shell]) == 0
    assert "_SILO_COMPLETE" in capsys.readouterr().out


def test_ctrl_c_is_quiet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "main", interrupt)
    assert run(["ls"]) == 130
    assert capsys.readouterr() == ("", "")


def test_ctrl_c_is_quiet_while_commands_are_loaded(monkeypatch, capsys):
    class Interrupted:
        def __getattr__(self, _: str) -> None:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "silo.cli.group", Interrupted())
    monkeypatch.setattr(sys, "argv", ["silo", "ls"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
def test_the_version_is_said_before_anything_is_loaded_that_parses_words() -> None:
    lines = (
        "import sys; sys.argv[1:] = ['--version']",
        "try: from silo.cli import main; main()",
        "except SystemExit as end:",
        "    print(end.code, [name for name in ('click', 'msgspec', 'typing', 'pathlib') if name in sys.modules])",
    )
    home = str(Path(silo.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-S", "-c", "\n".join(lines)],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=True,
        env=dict(os.environ, PYTHONPATH=home),
    )
    assert done.stdout.splitlines() == [f"silo, version {VERSION}", "0 []"]


def test_the_version_is_the_same_wherever_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--read-only", "--version"]) == 0
    assert capsys.readouterr().out == f"silo, version {VERSION}\n"


@pytest.mark.usefixtures("cold")
@pytest.mark.slow
@pytest.mark.parametrize("words", [["ls"], ["info", "demo"], ["set", "*", "on"], ["start"], ["--help"]])
def test_light_commands_import_nothing_heavy(words: list[str]) -> None:
    heavy = [*HEAVY, *NOT_FOR_LS] if words == ["ls"] else HEAVY
    code = (
        f"import sys; from silo.cli.main import run; run({words!r}); print([m for m in {heavy!r} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=True,
        env=dict(os.environ),
    )
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.usefixtures("cold")
@pytest.mark.slow
def test_a_command_that_has_ended_is_not_searched_for_garbage() -> None:
    program = (
        "import atexit, gc, sys; atexit.register(lambda: print(gc.get_freeze_count() > len(gc.get_objects())))\n"
        "from silo.cli import main; sys.argv[1:] = ['completion', 'bash']; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=DEADLINE_S, check=True
    )
    assert done.stdout.splitlines()[-1] == "True"
