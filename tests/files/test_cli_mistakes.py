"""Wrong command lines, in this process: a line of words and an exit code, never a traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import silo
from silo.cli.main import run

CODES = {0, 1, 2, 3, 4}
ENDINGS = ["silo", "csv", "mcap", "parquet"]
BAD_FILES = [
    "nope", "garbage", ".", "pipe", "pipe.silo", "pipe.csv", "huge.csv", "huge.silo", "huge.mcap", "latin.csv", "loop",
    "/dev/null", "/dev/zero", "/proc/self/mem", "x" * 5000, "", "-", "good.silo/x", "a\0b",
    *[f"{kind}.{ending}" for kind in ("garbage", "empty", "folder", "cut") for ending in ENDINGS],
]  # fmt: skip
BAD_TARGETS = [
    "nope/x.csv", "folder.csv", ".", "", "/dev/null", "/dev/full", "out.xyz", "a\0b.csv", "x" * 300 + ".csv",
    "/proc/x.csv", "good.silo", "mixed", "pipe.csv",
]  # fmt: skip
BAD_SCRIPTS = [f"{name}.yaml" for name in ("open", "list", "deep", "bomb", "binary", "pipe", "folder", "nope")]
COMMANDS = ["info", "watch", "set", "start", "stop", "restart", "save", "script", "recover", "convert", "plot", "stats"]
OTHERS = [
    *[[command, *words] for command in COMMANDS for words in (
        ["--nonsense"], ["no-such-logger"], ["x" * 5000], ["a", "b", "c", "d", "e"], ["\0"])],
    *[["--config", file, "ls"] for file in ("nope", "garbage", ".", "a\0b")],
    *[["script", verb, *words] for verb in ("check", "load", "save", "diff", "show")
      for words in (["x.yaml"], ["a", "b"])],
    ["demo", "--frequency", "nan"], ["demo", "--frequency", "x"], ["demo", "--name", "a b"], ["demo", "x"],
    ["host", "x"], ["host", "--frequency", "-1"],
    ["plot", "good.silo"], ["plot", "good.silo", "nope"], ["plot", "good.silo", "["],
    ["plot", "good.silo", "x", "--from", "nan"], ["plot", "good.silo", "x", "--from", "5", "--to", "1"],
    ["plot", "good.silo", "x", "--width", "1000000"], ["plot", "good.silo", "x", "--png", "nope/x.png"],
    ["stats", "good.silo", "nope"], ["info", "good.silo", "nope"],
    *[["recover", file] for file in ("nope", ".", "/dev/null", "garbage", "empty.silo", "pipe")],
    ["completion", "nonsense"], ["nonsense"], [""], ["--nonsense"], ["set", "divider=x"], ["save", "--type", "cvs"],
]  # fmt: skip


def a_log(folder):
    log = silo.Logger("robot", folder=folder, script=folder / "none.yaml")
    x = log.array("x", 3)
    log.update()
    log.start()
    for _ in range(20):
        x += 1
        log.collect()
    log.save(["silo"], "good")
    log.close()


@pytest.fixture
def folder(tmp_path):
    """A folder of logs and of what only looks so."""
    fill(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def to_look_at(tmp_path_factory):
    """Such a folder for all that only read."""
    made = tmp_path_factory.mktemp("files")
    fill(made)
    return made


def fill(folder):
    a_log(folder)
    garbage = bytes((i * 7919 + i // 3) % 256 for i in range(4000))
    (folder / "garbage").write_bytes(garbage)
    for ending in ENDINGS:
        (folder / f"garbage.{ending}").write_bytes(garbage)
        (folder / f"empty.{ending}").touch()
        (folder / f"folder.{ending}").mkdir()
        (folder / f"cut.{ending}").write_bytes((folder / "good.silo").read_bytes()[:300])
    for name in ("pipe", "pipe.silo", "pipe.csv", "pipe.yaml"):
        os.mkfifo(folder / name)
    for name in ("huge.silo", "huge.csv", "huge.mcap"):
        (folder / name).touch()
        os.truncate(folder / name, 10**12)  # without blocks: it takes no room
    (folder / "latin.csv").write_bytes(b"time,\xff\xfe\n1,2\n")
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    (folder / "mixed").mkdir()
    (folder / "mixed" / "one.mcap").write_bytes(garbage)
    (folder / "mixed" / "thesis.tex").write_text("years of work")
    (folder / "open.yaml").write_text("log_elements: [\n")
    (folder / "list.yaml").write_text("- 1\n")
    (folder / "deep.yaml").write_text("[" * 5000)
    again = [f"b{i}: &b{i} [*{f'b{i - 1}' if i else 'a'}, *{f'b{i - 1}' if i else 'a'}]" for i in range(40)]
    (folder / "bomb.yaml").write_text("\n".join(["a: &a [x]", *again]))
    (folder / "binary.yaml").write_bytes(b"\x00\xff")
    (folder / "folder.yaml").mkdir()


@pytest.fixture
def outcome(request, monkeypatch, capsys):
    """Runs a command line in that folder; its exit code, and what it said."""
    folder = request.getfixturevalue("to_look_at" if "to_look_at" in request.fixturenames else "folder")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HOME", str(folder))

    def run_line(*words):
        try:
            code = run(list(words))
        except SystemExit as end:  # `silo diff` of logs that differ
            code = end.code
        said = capsys.readouterr()
        assert code in CODES
        assert "Traceback" not in said.err + said.out
        assert code in (0, 4) or said.err.strip()
        return code, said.err

    return run_line


@pytest.mark.slow
@pytest.mark.parametrize("file", BAD_FILES, ids=ascii)
def test_a_bad_file_is_told_of_by_each_command_and_on_either_side_of_a_comparison(file, outcome, to_look_at, tmp_path):
    for words in (["info", file], ["stats", file], ["plot", file, "x"], ["convert", file, f"{tmp_path}/out.csv"]):
        code, _ = outcome(*words)
        assert code or file in ("latin.csv", "."), words  # a folder means the newest log there
    assert outcome("diff", "good.silo", file)[0]
    assert outcome("diff", file, "good.silo")[0]


@pytest.mark.parametrize("target", BAD_TARGETS, ids=ascii)
def test_a_bad_target_is_told_of_and_stays(target, outcome, folder):
    assert outcome("convert", "good.silo", target)[0]
    if target != "good.silo":
        outcome("convert", "--force", "good.silo", target)
    assert outcome("stats", "good.silo")[0] == 0


def test_a_folder_with_a_bag_and_other_files_is_not_replaced(outcome, folder):
    code, said = outcome("convert", "--force", "good.silo", "mixed")
    assert (code, (folder / "mixed" / "thesis.tex").read_text()) == (1, "years of work")
    assert "it holds thesis.tex" in said


@pytest.mark.parametrize("file", BAD_SCRIPTS)
def test_a_bad_script_is_told_of(file, outcome, to_look_at):
    assert outcome("script", "check", file)[0] in (1, 2, 3)


@pytest.mark.parametrize("words", OTHERS, ids=lambda words: ascii(" ".join(words))[:60])
def test_wrong_words_are_told_of(words, outcome):
    outcome(*words)


@pytest.mark.parametrize(
    ("line", "way"),
    [
        ("script load robot x.yaml --dry-run --all", "--dry-run shows what one logger would change; leave out --all"),
        ("compare good.silo..mixed/one.mcap", "A..B are runs of one folder"),
        ("compare good.silo..good.silo x y", "behind them stands one PATTERN at most"),
    ],
)
def test_words_that_do_not_go_together_are_refused_with_what_does(outcome, line, way):
    code, said = outcome(*line.split())
    assert code == 2
    assert way in " ".join(said.split())


def silo_in_a_shell(line, folder, **more):
    environment = {**os.environ, "PYTHONPATH": str(Path(silo.__file__).parents[1]), **more}
    program = f"'{sys.executable}' -c 'from silo.cli.main import main; main()'"
    command = ["bash", "-c", f"set -o pipefail; {program} {line}"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)


@pytest.mark.slow
def test_a_file_whose_name_is_no_text_is_read_and_written(folder, runtime_folder):
    done = silo_in_a_shell("convert good.silo $'\\xff.csv'", folder, PYTHONIOENCODING="utf-8:strict")
    assert (done.returncode, done.stderr) == (0, b"")
    done = silo_in_a_shell("info $'\\xff.csv'", folder, PYTHONIOENCODING="utf-8:strict")
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr


@pytest.mark.slow
def test_what_is_warned_of_is_a_line_of_words_without_a_place_in_the_code(folder, runtime_folder):
    done = silo_in_a_shell("plot good.silo 'og*'", folder)
    assert done.stderr == b"silo: 'og*' is only a part of names: from the next release on write '*og*'\n"


@pytest.mark.slow
@pytest.mark.parametrize("line", [
    *(f"{line} {end}" for line in (
        "info good.silo", "stats good.silo", "plot good.silo x", "ls", "--help", "info nope", "--version",
        "check good.silo --never 'x > -1e9'") for end in (">&-", ">/dev/full", "| head -c 1")),
    *(f"{line} {end}" for line in ("info good.silo", "info nope", "ls") for end in ("2>&-", "<&-")),
])  # fmt: skip
def test_a_closed_or_full_end_is_no_traceback(line, to_look_at, runtime_folder):
    bare = {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = silo_in_a_shell(line, to_look_at, **bare)
    assert b"Traceback" not in done.stderr
    assert b"Exception ignored" not in done.stderr
    assert done.returncode in CODES | {120, 141}


@pytest.mark.parametrize(
    ("words", "way"),
    [("--type csv", "OUT.csv"), ("--to mcap", "OUT.mcap"), ("--to bag", "OUT, a folder without an ending, is a bag")],
)
def test_who_asks_for_a_type_to_convert_to_is_told_what_says_it(outcome, words, way):
    code, said = outcome("convert", "good.silo", "out", *words.split())
    assert code == 2
    assert f"the ending of OUT says the format: silo convert IN {way}" in said
