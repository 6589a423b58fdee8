"""Commands on a logger that runs: a real one, with its helper process."""

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.cli.codes import EXIT_FAILED, EXIT_NO_LOGGER, EXIT_USAGE
from silo.cli.loggers.watch import show_clock
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import Action, BufferType
from silo.core.quantities.writing import count
from silo.errors import RefusedError
from tests.stand_ins.ticking import turning
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow

Run = Callable[..., "Result"]


class Result:
    """What a command printed and its exit code."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Run:
    def runner(*words: str) -> Result:
        capsys.readouterr()
        code = run(list(words))
        shown = capsys.readouterr()
        return Result(code, shown.out, shown.err)

    return runner


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the logger's segment and socket are; not the folder of a single test."""
    made = tmp_path_factory.mktemp("run")
    made.chmod(0o700)
    return made


@pytest.fixture(scope="module")
def served(runtime: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[silo.Logger]:
    """A logger with four elements, which a thread ticks at 200 Hz whenever it runs; its helper takes 0.7 s to start."""
    folder = tmp_path_factory.mktemp("logs")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("SILO_RUNTIME_DIR", str(runtime))
        log = silo.Logger("arm", frequency=200, folder=folder, script=folder / "arm.yaml", max_time=0)
        q = log.array("q", 3, group="joints", unit="rad", action=Action.SAVE_AND_PUBLISH)
        q[:] = 1.5, -2.0, 0.25
        log.array("tau", 3, group="joints", unit="Nm")
        mode = log.array("mode", dtype="u1", labels={0: "IDLE", 1: "MOVE"}, action=Action.SAVE_AND_PUBLISH)
        mode[...] = 1
        log.add(np.array(b"hello", "S16"), "text", action=Action.SAVE_AND_PUBLISH)
        with log, log.serve(), turning(log.collect, 0.005):
            yield log


@pytest.fixture
def log(served: silo.Logger, runtime: Path, monkeypatch: pytest.MonkeyPatch) -> silo.Logger:
    """The logger, stopped and as it was registered, with an empty folder."""
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(runtime))
    served.stop()
    for element in served.elements:
        published = "tau" not in element.name
        served.set(
            element.name,
            enabled=True,
            divider=1,
            action=Action.SAVE_AND_PUBLISH if published else Action.SAVE,
            buffer=BufferType.LOOPING,
            size=2000,
        )
    for path in Path(served.options.folder).iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return served


@pytest.fixture
def folder(log: silo.Logger) -> Path:
    return Path(log.options.folder)


def start_and_tick(log: silo.Logger) -> None:
    """Start, and wait until something was logged."""
    log.start()
    wait_until(lambda: log.ticks)


def test_ls_shows_the_logger_and_as_json_its_status(log: silo.Logger, command: Run) -> None:
    header, row = command("ls").out.splitlines()
    assert header.split()[:3] == ["LOGGER", "HOST", "STATE"]
    assert row.split()[:3] == ["arm", socket.gethostname(), "stopped"]
    assert "4/4" in row
    (status,) = json.loads(command("ls", "--json").out)
    assert (status["logger"], status["state"], status["elements"]) == ("arm", "stopped", 4)


@pytest.mark.parametrize(
    ("words", "code", "out", "err"),
    [
        ("info", 0, "arm on ", ""),  # it may be left out while it is the only one
        ("info leg", EXIT_NO_LOGGER, "", "no logger 'leg'"),
        ("info leg", EXIT_NO_LOGGER, "", "arm"),  # those that there are
        ("set * divider=9 --dry-run", 0, "would change 4 elements", ""),
        ("set * divider=1", 0, "nothing to change", ""),
        ("watch */mode --rate 20 --count 1", 0, "", "logger is stopped"),
    ],
)
def test_what_changes_nothing_says_what_there_is(
    log: silo.Logger, command: Run, words: str, code: int, out: str, err: str
) -> None:
    before = log.elements, log._table.revision
    shown = command(*words.split())
    assert (shown.code, out in shown.out, err in shown.err) == (code, True, True), shown.err
    assert (log.elements, log._table.revision) == before


def test_with_several_loggers_one_must_be_named(log: silo.Logger, command: Run, folder: Path) -> None:
    with silo.Logger("leg", folder=folder) as other:
        other.array("x")
        with other.serve():
            shown = command("info")
            assert (shown.code, "several loggers run, say which: arm" in shown.err) == (EXIT_USAGE, True)
            assert "leg on " in command("info", "leg").out


def test_info_lists_the_elements_that_match(log: silo.Logger, command: Run) -> None:
    header, q, tau = command("info", "arm", "joints").out.splitlines()
    assert q.split()[:6] == ["/log/joints/q", "rad", "f8[3]", "on", "1", "save_and_publish"]
    assert tau.split()[0] == "/log/joints/tau"
    assert header.startswith("ELEMENT")


def test_start_stop_and_restart_change_the_state(log: silo.Logger, command: Run) -> None:
    started = command("start", "--discard")
    assert (started.code, log.is_running, started.out.startswith("arm: running")) == (0, True, True)
    assert (command("restart", "--discard").code, log.is_running) == (0, True)
    assert (command("stop").code, log.is_running) == (0, False)
    assert command("stop").code == 0


def test_set_changes_what_matches_in_one_transaction(log: silo.Logger, command: Run) -> None:
    shown = command("set", "arm", "joints", "divider=4", "size=2s", "buffer=fixed", "action=both")
    assert shown.code == 0
    assert "changed 2 elements of 2 that match" in shown.out
    options = {element.name: element.options for element in log.elements}
    assert options["/log/joints/tau"] == silo.ElementOptions(True, 4, Action.SAVE_AND_PUBLISH, BufferType.FIXED, 100)
    assert options["/log/mode"].divider == 1


def test_set_shows_each_field_that_changes_of_many_the_first(
    log: silo.Logger, command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = command("set", "*/tau", "divider=2", "off").out.splitlines()
    assert [line.split() for line in lines[:2]] == [
        ["/log/joints/tau", "enabled", "on", "->", "off"],
        ["/log/joints/tau", "divider", "1", "->", "2"],
    ]
    monkeypatch.setattr("silo.cli.edits.MOST_CHANGES", 1)
    lines = command("set", "*/tau", "divider=1", "on").out.splitlines()
    assert lines[0].split() == ["/log/joints/tau", "enabled", "off", "->", "on"]
    assert lines[1] == "... and 1 more change"


@pytest.mark.parametrize("entry", ["joints/tau_y", "tau_y", "/log/joints/tau_y", "joints/tau/y"])
def test_an_entry_of_an_element_has_no_settings_of_its_own_and_it_is_said_which_element_has(
    log: silo.Logger, command: Run, entry: str
) -> None:
    before = log.elements
    shown = command("set", "arm", "joints/q", entry, "divider=3")
    assert shown.code != 0
    assert f"'{entry}' is an entry of '/log/joints/tau'" in shown.err
    assert f"`silo set arm.{os.getpid()} /log/joints/tau ...` sets the element; nothing was changed" in shown.err
    assert log.elements == before


def test_what_is_said_of_an_episode_is_in_the_log_of_the_run(log, command):
    log.start()
    try:
        assert command("episode", "arm", "good").code == EXIT_FAILED
        said = [command("episode", "arm", "begin", "--name", "pick", "--about", "object=cup"),
                command("episode", "arm", "good"), command("episode", "arm", "redo")]  # fmt: skip
        texts = ['episode "pick" begin {"object":"cup"}', 'episode "pick" end good', 'episode "pick" redo']
        assert [one.out.strip().partition(": ")[2] for one in said] == texts
        assert command("episode", "arm", "fine").code == command("episode", "arm", "end").code == EXIT_FAILED
        assert command("episode", "arm", "begin", "--about", "cup").code == EXIT_USAGE
        facts = ["speed=0.4", "wet=true", "turns=3", "number=007", "limit=1e999"]
        typed = command(
            "episode", "arm", "begin", "--name", "turn", *(one for fact in facts for one in ("--about", fact))
        )
        assert typed.out.strip().endswith('{"speed":0.4,"wet":true,"turns":3,"number":"007","limit":"1e999"}')
    finally:
        log.stop()


@pytest.mark.parametrize(
    ("typed", "wanted"),
    [
        (["begin", "pick"], "begin --name pick"), (["arm", "begin", "pick"], "arm begin --name pick"),
        (["begin", "a cup", "speed=0.4"], "begin --name 'a cup' --about speed=0.4"),
        (["good", "bad", "x"], "good bad --name x"),
    ],
)  # fmt: skip
def test_an_episodes_name_behind_the_word_is_told_where_it_belongs(command, typed, wanted):
    refused = command("episode", *typed)
    assert refused.code == EXIT_USAGE
    assert f"episode {wanted}\n" in refused.err


def test_a_running_logger_refuses_to_be_changed(log: silo.Logger, command: Run) -> None:
    log.start()
    shown = command("set", "*", "divider=2")
    assert (shown.code, shown.out) == (EXIT_FAILED, "")
    assert f"logger 'arm' is running: `silo stop arm.{os.getpid()}` first, or add --restart" in shown.err
    assert {element.options.divider for element in log.elements} == {1}


def test_one_that_was_started_since_it_was_looked_at_is_told_of_and_restarted_like_any_that_runs(
    log: silo.Logger, command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Client.connect("arm") as client:
        stopped = client.status()
    log.start()
    monkeypatch.setattr(Client, "status", lambda _client: stopped)
    shown = command("set", "*", "divider=2")
    assert (shown.code, shown.out) == (EXIT_FAILED, "")
    assert f"logger 'arm' is running: `silo stop arm.{os.getpid()}` first, or add --restart" in shown.err
    shown = command("set", "*", "divider=2", "--restart", "--discard")
    assert (shown.code, "logging again" in shown.out, log.is_running) == (0, True, True)


def test_two_clients_change_a_running_logger_at_cuts_and_no_tick_is_lost(log: silo.Logger, command: Run) -> None:
    log.set(buffer="growing")
    log.start()
    names = [element.name for element in log.elements]
    wait_until(lambda: log.ticks)
    with Client.connect("arm") as one, Client.connect("arm") as other:
        began_ns = one.status().started_ns
        cut_by = [
            threading.Thread(target=_cut_often, args=(client, names[place], divider))
            for client, place, divider in ((one, 0, 2), (other, -1, 15))
        ]
        for each in cut_by:
            each.start()
        for each in cut_by:
            each.join()
        shown = command("set", "*", "divider=9", "--cut")
        assert (shown.code, log.is_running) == (0, True), shown.err
        with pytest.raises(RefusedError, match="running"):
            one.apply([silo.Edit(names[0], divider=3)], -1)
        wait_until(lambda: not log._present.cut_off)
        log.stop()
        wait_until(lambda: one.status().run_ticks == log.ticks)
        assert one.status().run_began_ns == began_ns < one.status().started_ns
    log.save()
    whole = silo.open_log(log.options.folder)
    assert len(whole.time_ns) == log.ticks
    assert (np.diff(whole.time_ns) > 0).all()
    told = [event for event in whole.recording.events if event.kind == "cut"]
    assert len(told) == 2 * CUTS + 1
    assert all("@" in event.who for event in told)


def test_ticks_are_of_the_whole_run_as_its_time_is(log: silo.Logger, command: Run) -> None:
    log.set(buffer="growing")
    log.start()
    wait_until(lambda: log.ticks > 10)
    log.set("q", divider=2, cut=True)
    wait_until(lambda: not log._present.cut_off)
    # while it runs, too
    wait_until(lambda: "  cut: /log/joints/q divider 1 -> 2  (arm)\n" in command("events", "arm").out)
    said = command("stop", "arm").out
    whole = count(log.ticks)
    assert f"arm: stopped, {whole} ticks" in said
    assert f"stopped, {whole} ticks" in command("stop", "--all").out
    assert f" {whole} " in command("ls").out
    assert f"{whole} ticks" in command("info", "arm").out
    assert "started: goes on after a cut: its ticks count from 0" in command("events", "arm").out


def test_a_file_that_is_called_as_a_logger_does_not_hide_it(
    log: silo.Logger, command: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm").touch()
    shown = command("info", "arm", "tau")
    assert (shown.code, "/log/joints/tau" in shown.out) == (0, True), shown.err


CUTS = 4


def _cut_often(client: Client, name: str, divider: int) -> None:
    """Cut several times; who comes while another cut has had no tick yet, or after another edit, asks again."""
    for number in range(CUTS):
        edits = [silo.Edit(name, divider=divider + number)]
        wait_until(lambda edits=edits: _is_done(client, edits))


def _is_done(client: Client, edits: list[silo.Edit]) -> bool:
    try:
        return client.apply(edits, -1, cut=True).changed == 1
    except RefusedError as refused:
        assert "no tick yet" in str(refused) or "meanwhile" in str(refused)
        return False


def test_a_script_is_loaded_while_it_runs_where_one_says_so(log: silo.Logger, command: Run) -> None:
    log.set("q", divider=2)
    log.save_script(Path(log.options.script).with_name("apart.yaml"))
    log.set("q", divider=3)
    log.start()
    wait_until(lambda: log.ticks > 10)
    shown = command("script", "load", "arm", "apart.yaml")
    assert (shown.code, "go on as changed (--cut, cut=True)" in shown.err) == (1, True)
    shown = command("script", "load", "arm", "apart.yaml", "--cut")
    assert (shown.code, "1 element changed" in shown.out, log.is_running) == (0, True, True), shown.err
    assert log["q"].options.divider == 2


def test_save_prints_the_files_and_info_reads_one(log: silo.Logger, command: Run, folder: Path) -> None:
    start_and_tick(log)
    shown = command("save", "-t", "silo", "-t", "csv", "--name", "walk")
    assert shown.code == 0
    files = {str(folder / "walk.silo"), str(folder / "walk.csv")}
    assert {line.split("  ")[0] for line in shown.out.splitlines()} == files
    assert "/log/joints/q" in command("info", str(folder / "walk.silo")).out


def test_a_script_is_saved_shown_compared_and_loaded(log: silo.Logger, command: Run, folder: Path) -> None:
    assert command("script", "save", "arm", "walk.yaml").code == 0
    assert command("script", "show", "arm", "walk.yaml").out == (folder / "walk.yaml").read_text()
    assert "no difference" in command("script", "diff", "walk.yaml").out
    log.set("/log/joints/q", divider=7)
    shown = command("script", "diff", "walk.yaml", "--exit-code")
    assert (shown.code, shown.out.splitlines()[0].split()) == (4, ["/log/joints/q", "divider", "7", "->", "1"])
    assert "1 element changed" in command("script", "load", "walk.yaml").out
    assert log.elements[0].options.divider == 1


def test_a_script_that_exists_is_only_replaced_by_force_and_a_missing_folder_made(
    log: silo.Logger, command: Run, folder: Path
) -> None:
    assert command("script", "save", "walk.yaml").code == 0
    assert command("script", "save", "walk.yaml").code == EXIT_FAILED
    assert command("script", "save", "walk.yaml", "--force").code == 0
    assert "walk.yaml" in command("script", "list").out
    assert command("script", "save", "new/walk.yaml").code == 0
    assert (folder / "new" / "walk.yaml").exists()


def test_names_that_the_logger_lacks_are_told(log: silo.Logger, command: Run, folder: Path) -> None:
    path = folder / "old.yaml"
    path.write_text("log_elements:\n- name: /log/joints/qq\n  enabled: true\n")
    assert "/log/joints/qq" in command("script", "load", "old.yaml").err
    shown = command("script", "check", str(path), "--logger", "arm")
    expected = f"silo: {path}:2: no element '/log/joints/qq'; did you mean '/log/joints/q'?\n"
    assert (shown.code, shown.err) == (EXIT_FAILED, expected)


def test_watch_prints_live_values(log: silo.Logger, command: Run) -> None:
    log.start()
    shown = command("watch", "arm", "*/q", "*/mode", "*/text", "--rate", "20", "--count", "3")
    assert shown.code == 0
    rests = [line.split("  ", 1)[1] for line in shown.out.splitlines()]
    assert rests[-3:] == ["/log/joints/q  1.5 -2 0.25 rad", "/log/mode  MOVE", "/log/text  hello"]


def test_watch_without_a_pattern_shows_what_is_on(log: silo.Logger, command: Run, monkeypatch) -> None:
    log.start()
    shown = command("watch", "arm", "--rate", "20", "--count", "1")
    assert "/log/joints/q" in shown.out
    assert "/log/joints/tau" in shown.out  # saved only
    shown = command("watch", "*/tau", "--count", "1")
    assert (shown.code, "/log/joints/tau" in shown.out) == (0, True)
    monkeypatch.setattr("silo.cli.loggers.watch.MOST_LINES", 1)
    few = command("watch", "--rate", "20", "--count", "1")
    assert len(few.out.splitlines()) == 1
    assert "that are on; say which" in few.err


def test_watch_says_what_to_do_for_an_element_that_is_off(log: silo.Logger, command: Run) -> None:
    log.set("joints/tau", enabled=False)
    shown = command("watch", "*/tau")
    assert shown.code == EXIT_FAILED
    assert "/log/joints/tau: off; `silo set PATTERN on`" in shown.err


def test_names_of_loggers_and_elements_are_completed(log: silo.Logger) -> None:
    def completed(words: str, place: int) -> list[str]:
        environment = {**os.environ, "_SILO_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(place)}
        command = [sys.executable, "-c", "from silo.cli import main; main()"]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=DEADLINE_S, check=False)
        return [line.partition(",")[2] for line in done.stdout.splitlines()]

    assert completed("silo stop a", 2) == ["arm"]
    assert completed("silo watch arm /log/j", 3) == ["/log/joints/q", "/log/joints/tau"]
    assert completed("silo watch /log/m", 2) == ["/log/mode"]
    assert completed("silo sc", 1) == ["script"]
    assert completed("silo set arm /log buf", 4) == ["buffer=", "buf="]
    assert completed("silo set arm /log buffer=f", 4) == ["buffer=fixed"]
    log.save_script()
    assert completed("silo script load a", 3) == ["arm", "arm.yaml"]
    assert completed("silo script load arm ", 4) == ["arm.yaml"]


def test_the_clock_of_a_logger_that_never_ran_is_dashes() -> None:
    assert show_clock(0) == "--:--:--.---"


def test_ls_tells_of_recordings_that_are_in_no_file(command: Run) -> None:
    program = "import os, silo; log = silo.Logger('lost'); log.array('x'); log.start(); log.collect(); os._exit(1)"
    subprocess.run(
        [sys.executable, "-c", program], check=False, env=dict(os.environ, PYTHONPATH=str(Path(__file__).parents[2]))
    )
    assert "1 recording of programs that died may be in no file: `silo recover --list`" in command("ls").err


def test_a_word_that_names_no_logger_is_a_pattern_where_one_logger_runs(log: silo.Logger, command: Run) -> None:
    assert command("set", "joints", "divider=3").code == 0
    assert {info.options.divider for info in log.elements if "/joints/" in info.name} == {3}
