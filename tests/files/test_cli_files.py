"""The commands on saved logs, as somebody types them."""

import itertools
import json
import subprocess
import sys
from dataclasses import replace

import click
import numpy as np
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.cli.logs.check import check_command
from silo.cli.logs.responses import step
from silo.cli.logs.saved_logs import (
    compare_command,
    convert_command,
    diff_command,
    plot_command,
    print_file_info,
    stats_command,
)
from silo.cli.verbs import Listing
from silo.core.elements import LoggedEvent
from silo.core.recording import Recording, with_events
from silo.errors import LogNotFoundError, LogWarning
from silo.files.bags.writer import write_bag
from silo.files.silo.writer import write_silo
from tests.stand_ins.saved import cut_in_two, element

COMMANDS = [convert_command, diff_command, plot_command, stats_command]
TICKS = 100


def recording(*more, x=None):
    time_ns = 1_700_000_000_000_000_000 + np.arange(TICKS, dtype=np.int64) * 10_000_000
    table = [
        element("/log/x", np.arange(TICKS) * 1.0 if x is None else x, "rad"),
        element("/log/nan", np.full(TICKS, np.nan)),
        element("/log/mode", (np.arange(TICKS) // 60).astype("i1"), labels={0: "STAND", 1: "WALK"}),
        element("/log/text", np.array([b"on", b"on", b"on", b"off"] * 25)),
        element("/log/slow", np.arange(10.0), "degC", divider=10, lost=3),
        *more,
    ]
    return Recording("robot", time_ns, TICKS, table, frequency_hz=100.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")
    write_silo(recording(), tmp_path / "run.silo")
    return tmp_path


@pytest.fixture
def damaged(folder):
    """A bit of the file is another one."""
    data = bytearray((folder / "run.silo").read_bytes())
    data[data.index(b"# Binary Data\n") + 14 + 2 * 8 * TICKS + 100] ^= 4
    (folder / "damaged.silo").write_bytes(data)


@pytest.mark.parametrize("command", ["info", "events"])
def test_what_a_file_says_moves_no_cursor(tmp_path, command):
    told = LoggedEvent("marker", "\x1b]0;mine\x07red", 1_700_000_000_000_000_000, 3, who="anna\x1b[2J")
    hostile = replace(recording(), about={"task": "walk\x1b[2J"}, warnings=("lost\x07",))
    write_silo(with_events(hostile, [told]), tmp_path / "run.silo")
    result = CliRunner().invoke(cli, [command, str(tmp_path / "run.silo")], color=True)
    assert (result.exit_code, "red" in result.stdout) == (0, True)
    assert all(line.isprintable() for line in result.stdout.splitlines()), result.stdout


def test_a_label_of_two_lines_is_a_line(folder):
    element_of = element("/log/q", np.zeros(TICKS, "i1"), labels={0: "two\nlines"})
    write_silo(recording(element_of), folder / "two.silo")
    assert r"/log/q: two\x0alines 100x" in run(stats_command, "two.silo", "q").stdout


def test_damaged_values_are_told_by_info_and_by_whom_asks_for_it(damaged, capsys, recwarn):
    words = "values of '/log/x' are damaged: they aren't those that were written"
    print_file_info("damaged.silo", as_json=False)
    assert words in capsys.readouterr().out
    silo.open_log("damaged.silo")
    assert not recwarn
    with pytest.warns(LogWarning, match=f"^damaged.silo: {words}"):
        log = silo.open_log("damaged.silo", check=True)
    assert log.warnings[0].startswith(words)
    assert log["x"].values[12] != 12


def run(command, *arguments):
    return CliRunner().invoke(cli, [command.name, *arguments])  # errors become the shell's in the group


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_help_shows_an_example(command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert f"  silo {command.name} run" in result.output
    assert max(map(len, result.output.split("\n"))) <= 80


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_a_log_that_is_not_there_is_one_line_on_stderr(command, folder):
    result = run(command, "nothing.silo", "x")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert result.stderr.startswith("Error: ")
    assert "nothing.silo" in result.stderr
    assert len(result.stderr.strip().split("\n")) == 1


def test_names_of_signals_are_completed_from_the_log(folder):
    complete = ShellComplete(plot_command, {}, "silo plot", "_SILO_COMPLETE")
    assert [item.value for item in complete.get_completions(["run.silo"], "slo")] == ["/log/slow"]
    assert complete.get_completions(["no.silo"], "slo") == []


@pytest.mark.slow
def test_what_is_in_a_silo_file_is_told_without_what_reads_bags(folder):
    code = "import sys; from silo.cli.main import run; run(['info', 'run.silo']); assert 'mcap' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)


class TestConvert:
    def test_it_says_what_it_wrote(self, folder):
        result = run(convert_command, "run.silo", "run.mcap")
        size = (folder / "run.mcap").stat().st_size
        assert result.stdout == f"run.mcap  {size} bytes, 5 signals, 100 ticks\n"

    def test_it_keeps_what_exists_without_force(self, folder):
        before = (folder / "run.silo").read_bytes()
        result = run(convert_command, "run.silo", "run.silo")
        assert result.exit_code == 1
        assert "--force" in result.stderr
        assert (folder / "run.silo").read_bytes() == before

    @pytest.mark.parametrize(("ending", "slow", "told"), [(".csv", 20, True), (".csv", 2, False), (".silo", 20, False)])
    def test_a_table_of_which_most_is_empty_is_told_of(self, folder, ending, slow, told):
        seldom = [element(f"/log/s{n}", np.zeros(TICKS // slow), divider=slow) for n in range(40)]
        write_silo(recording(*seldom), folder / "seldom.silo")
        note = run(convert_command, "seldom.silo", f"out{ending}").stderr
        assert (": a value stands in 13.6% of its cells" in note) == told, note

    def test_warnings_of_a_damaged_source_are_told_and_stand_in_what_is_written(self, damaged, folder):
        words = "values of '/log/x' are damaged"
        assert f"warning: {words}" in run(stats_command, "damaged.silo").stderr
        result = run(convert_command, "dam", "out.mcap")  # the start of a name is enough
        assert result.exit_code == 0
        assert f"warning: {words}" in result.stderr
        with pytest.warns(LogWarning, match=words):
            silo.open_log(folder / "out.mcap")
        (folder / "cut.silo").write_bytes((folder / "run.silo").read_bytes()[:-7])
        result = run(convert_command, "cut.silo", "cut.mcap")
        assert (result.exit_code, "warning: " in result.stderr) == (0, True)


class TestStats:
    def test_numbers_strings_and_enumerations(self, folder):
        rows = {row["name"]: row for row in json.loads(run(stats_command, "run.silo", "--json").stdout)}
        assert (rows["/log/x"]["minimum"], rows["/log/x"]["maximum"], rows["/log/x"]["mean"]) == (0, 99, 49.5)
        assert rows["/log/x"]["rms"] == pytest.approx(np.sqrt(np.mean(np.arange(100.0) ** 2)))
        assert (rows["/log/nan"]["not_finite"], rows["/log/nan"]["mean"]) == (100, None)
        assert rows["/log/mode"]["most_common"] == ["STAND 60x", "WALK 40x"]
        assert rows["/log/text"]["most_common"] == ["'on' 75x", "'off' 25x"]

    def test_what_is_infinite_counts_and_json_says_it_in_letters(self, folder, new_logger):
        log = new_logger()
        x = log.array("x")
        log.start()
        for x[...] in (1, np.nan, -np.inf, 4):
            log.collect()
        path = str(log.save().path)
        (row,) = json.loads(run(stats_command, path, "--json").stdout)
        assert (row["minimum"], row["maximum"], row["mean"], row["std"]) == ("-inf", 4, "-inf", None)
        assert (row["samples"], row["not_finite"], row["infinite"]) == (4, 2, 1)
        head, line = run(stats_command, path).stdout.splitlines()
        assert (head.split(), line.split()) == (
            ["signal", "n", "nan", "inf", "min", "max", "mean", "rms"],  # no deviation
            ["/log/x", "4", "1", "1", "-inf", "4", "-inf", "inf"],
        )

    def test_a_window(self, folder):
        rows = json.loads(run(stats_command, "run.silo", "/log/x", "--from", "0.1", "--to", "0.2", "--json").stdout)
        assert (rows[0]["minimum"], rows[0]["maximum"], rows[0]["samples"]) == (10, 20, 11)

    @pytest.mark.parametrize(("start", "told"), [("0.1", False), ("100", True)])
    def test_a_window_without_samples_says_how_long_the_log_is(self, folder, start, told):
        result = run(stats_command, "run.silo", "/log/x", "--from", start)
        assert ("warning: no sample from 100 s on, the log lasts " in result.stderr) == told


class TestDiff:
    def test_the_same_log_in_two_formats_is_equal(self, folder):
        write_bag(recording(), folder / "run.mcap")
        result = run(diff_command, "run.silo", "run.mcap")
        assert (result.exit_code, result.stdout) == (0, "equal: 5 signals, 100 ticks\n")

    def test_values_elements_and_facts_that_differ_are_listed(self, folder):
        changed = np.arange(TICKS) * 1.0
        changed[50:53] += 0.25
        write_silo(recording(element("/log/new", np.zeros(TICKS)), x=changed), folder / "other.silo")
        result = run(diff_command, "run.silo", "other.silo")
        assert result.exit_code == 4
        lines = [line.split(maxsplit=1) for line in result.stdout.strip().split("\n")]
        assert lines == [
            ["/log/new", "only in the second log"],
            ["/log/x", "3 of 100 samples differ, by at most 0.25, first at 0.5 s"],
        ]

    def test_a_tolerance_lets_small_differences_pass_and_integers_beyond_what_floats_hold_are_told_apart(self, folder):
        write_silo(recording(x=np.arange(TICKS) + 1e-9), folder / "other.silo")
        assert run(diff_command, "run.silo", "other.silo").exit_code == 4
        assert run(diff_command, "run.silo", "other.silo", "--tolerance", "1e-8").exit_code == 0
        for name, value in (("a", 2**60), ("b", 2**60 + 1)):
            write_silo(recording(element("/log/big", np.full(TICKS, value))), folder / f"{name}.silo")
        assert run(diff_command, "a.silo", "b.silo").exit_code == 4


class TestPlot:
    def test_it_fits_the_terminal_without_escapes_into_a_pipe(self, folder):
        result = run(plot_command, "run.silo", "/log/x", "slow")
        rows = result.stdout.rstrip("\n").split("\n")
        assert result.exit_code == 0, result.output
        assert "\x1b" not in result.stdout
        assert len(rows) <= 22
        assert max(map(len, rows)) <= 80

    def test_a_png(self, folder):
        result = run(plot_command, "run.silo", "/log/x", "slow", "mode", "--png", "x.png")
        assert result.stdout == "x.png\n"
        assert (folder / "x.png").stat().st_size > 1000

    @pytest.mark.parametrize(
        ("words", "code", "said"),
        [
            ("/log/x --png no/x.png", 1, "no/x.png"),
            ("/log/x -d -s", 2, "--derivative and --spectrum"),
            ("sloww", 1, "/log/slow"),  # a pattern without a signal suggests names
        ],
    )
    def test_what_can_not_be_drawn_is_said(self, folder, words, code, said):
        result = run(plot_command, "run.silo", *words.split())
        assert (result.exit_code, said in result.stderr) == (code, True), result.output


class TestInfo:
    def info(self, path, as_json=False):
        @click.command()
        def command():
            print_file_info(path, as_json)

        return CliRunner().invoke(command, [], catch_exceptions=False).stdout

    def test_the_table_has_every_element_and_fits(self, folder):
        text = self.info(folder / "run.silo")
        assert [line.split()[0] for line in text.split("\n") if line.startswith("/log/")] == [
            "/log/x",
            "/log/nan",
            "/log/mode",
            "/log/text",
            "/log/slow",
        ]
        assert "5 elements, 100 ticks, 0.99 s, 100 Hz, lost 3" in text
        assert max(len(line) for line in text.split("\n")[1:]) <= 80

    def test_json_is_for_machines(self, folder):
        facts = json.loads(self.info(folder / "run.silo", as_json=True))
        slow = facts["elements"][4]
        assert (slow["samples"], slow["rate_hz"], slow["lost"], slow["divider"]) == (10, pytest.approx(10), 3, 10)
        assert facts["elements"][2]["labels"] == {"0": "STAND", "1": "WALK"}

    def test_a_bag_has_the_same_table_and_a_missing_file_is_an_error_of_silo(self, folder):
        write_bag(recording(), folder / "run.bag")
        table = [self.info(folder / name).split("\n", 1)[1] for name in ("run.silo", "run.bag")]
        assert table[0] == table[1]
        with pytest.raises(LogNotFoundError):
            print_file_info(folder / "no.silo", as_json=False)


@pytest.mark.parametrize(
    "words", [["info", "?"], ["stats", "?"], ["plot", "?", "x"], ["check", "?", "--never", "x > 1000"]], ids=" ".join
)
def test_a_folder_means_its_newest_run_to_every_command_and_newer_captures_are_told_of(words, folder):
    for name in ("00001", "00002", "00003_TRIGGER_fall_1"):
        write_silo(recording(), folder / f"robot_20260301_12-00-00_{name}.silo")
    (folder / "run.silo").unlink()
    result = CliRunner().invoke(cli, [str(folder) if word == "?" else word for word in words])
    assert result.exit_code == 0, result.output
    assert "'robot_20260301_12-00-00_00002.silo' was taken, the newest run; one capture is newer" in result.stderr


def test_events_of_a_bag_are_those_in_the_bag(folder):
    write_bag(with_events(recording(), [LoggedEvent("marker", "slipped", 1, 3)]), folder / "drive")
    result = CliRunner().invoke(cli, ["events", str(folder / "drive")])
    assert "slipped" in result.stdout, result.output


def test_a_data_set_is_made_of_several_logs(tmp_path, new_logger):
    for number in range(2):
        log = new_logger(f"arm{number}", clock=itertools.count(-10_000_000, 10_000_000).__next__)
        log.array("q", 3)
        if number:
            log.array("cmd")
        log.array("short", size=30, buffer="fixed")
        log.start()
        for _ in range(50):
            log.collect()
        log.save("silo", name=f"run{number}")
    runs = [str(tmp_path / f"run{number}.silo") for number in range(2)]
    made = run(convert_command, *runs, str(tmp_path / "set"), "--to", "lerobot", "--fps", "20", "--state", "q",
               "--action", "cmd")  # fmt: skip
    assert (made.exit_code, made.stdout) == (0, f"{tmp_path}/set  1 episodes, 10 frames at 20/s\n")
    assert "left out: " in made.stderr
    assert "run0.silo: no signal is meant by 'cmd'" in made.stderr
    made = run(convert_command, runs[1], str(tmp_path / "less"), "--to", "episodes", "--fps", "20", "--state", "short")
    assert (made.exit_code, made.stdout) == (0, f"{tmp_path}/less  1 episodes, 6 frames at 20/s\n")
    assert made.stderr == ""
    made = run(convert_command, runs[1], str(tmp_path / "more"), "--to", "episodes", "--fps", "20", "--state", "short",
               "--action", "q")  # fmt: skip
    assert made.stderr == (
        f"warning: {runs[1]}: 4 of 10 frames are not there: the last sample of '/log/short' holds no longer\n"
    )
    for given, words in (
        ([*runs, "x.csv"], "more than one IN (2) is for data sets: add --to lerobot or --to episodes"),
        ([runs[0], "x.csv", "--fps", "3"], "--fps is for data sets"),
        ([runs[0], "x", "--to", "lerobot", "--fps", "3"], "at least one --state"),
        ([runs[0], "x", "--to", "lerobot", "--fps", "3", "--state", "q", "--rate", "3"], "write --fps instead"),
    ):
        refused = run(convert_command, *given)
        assert (refused.exit_code, words in refused.stderr) == (2, True), refused.stderr


@pytest.mark.parametrize("ending", ["csv", "npz", "mcap", "parquet", "silo"])
def test_who_converts_into_a_folder_that_is_not_there_is_told_which_one_to_make(folder, ending):
    saved, target = folder / "run.silo", folder / "out" / f"x.{ending}"
    refused = run(convert_command, str(saved), str(target))
    assert refused.exit_code == 1
    words = f"can't save '{target}': No such file or directory; there is no folder '{target.parent}': make it, or"
    assert words in refused.stderr
    with pytest.raises(silo.SaveError, match="there is no folder"):
        silo.open_log(saved).save(target)
    assert not target.parent.exists()


@pytest.mark.parametrize(
    ("words", "part", "whole"),
    [
        ((stats_command, "logs"), "q_0      5   10   18", "q_0      15    0   18"),
        ((convert_command, "logs", "out.mat"), "10 ticks", "20 ticks"),
        ((convert_command, "logs", "out.csv", "--rate", "1"), "1 tick", "1 tick"),
        ((plot_command, "logs", "q"), "q_0  10 ... 18", "q_0  0 ... 18"),
        ((diff_command, "logs", "logs"), "10 ticks", "20 ticks"),
        ((compare_command, "logs", "logs"), "2 are alike", "2 are alike"),
        ((step, "logs", "q_0", "q_1"), "from 10 to", "from 0 to"),
        ((check_command, "logs", "--never", "q_0 > 90", "--always", "q_0 > 3"), "nothing violated", "1 of 2 violated"),
    ],
)
def test_one_part_of_a_run_that_was_cut_or_all_as_one_are_read(tmp_path, monkeypatch, words, part, whole):
    monkeypatch.chdir(tmp_path)
    cut_in_two(tmp_path / "logs")
    done = run(*words)
    assert (done.exit_code, part in done.stdout) == (0, True), done.output
    assert "warning: part 2 of run" in done.stderr
    assert "silo.open_log read all as one" in done.stderr
    done = run(*words, "--whole", *(["--force"] if words[0] is convert_command else []))
    assert (whole in done.stdout, "warning" in done.stderr) == (True, False), done.output


def test_of_a_baseline_too_is_told_what_is_read_and_many_runs_are_not_joined(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cut_in_two(tmp_path / "logs")
    assert run(check_command, "logs", "--against", "logs").stderr.count("warning: part 2 of run") == 2
    refused = run(compare_command, "logs..logs", "--whole")
    assert (refused.exit_code, "leave out --whole" in refused.stderr) == (2, True)


def test_a_list_has_heads_rows_and_what_is_odd_or_says_that_it_is_empty(capsys):
    show = Listing(("NAME", "N"), lambda one: one, "none here", right=(1,), below=lambda one: one[0] * (one[1] == "7"))
    show([("a", "10"), ("bc", "7")])
    assert capsys.readouterr().out.splitlines() == ["NAME   N", "a     10", "bc     7", "bc"]
    show([])
    assert capsys.readouterr().out.splitlines() == ["none here"]
