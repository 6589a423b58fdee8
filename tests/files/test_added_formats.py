"""Formats of other packages: found by their entry point, left out where they are broken, never loaded by a robot."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.errors import FileFormatError, SaveError
from silo.files.added import added_formats

RECIPES = Path(__file__).resolve().parents[2] / ".docs" / "recipes"

TELEMETRY = """
from silo.files.formats import Format
FORMAT = Format(name="tlm", endings=(".tlm",), about="telemetry", reader="tlm_of_others:read", mark=b"TLM1")

def read(path):
    import numpy, silo
    return silo.Recording("tlm", numpy.arange(3), 3, [])
"""
FAILING = """
from silo.files.formats import Format
FORMAT = Format(name="bad", endings=(".bad",), about="", reader="failing:read", writer="failing:write")

def read(path):
    raise KeyError("topic")

def write(recording, path, progress):
    path.write_text("half")
    raise ValueError("disk on fire")
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install packages of one module each: `installed(name, code)`."""
    folder = tmp_path / "packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))

    def install(module, code, target="FORMAT"):
        about = folder / f"{module}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module.replace('_', '-')}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(f"[silo.formats]\n{module} = {module}:{target}\n")
        (folder / f"{module}.py").write_text(code)
        added_formats.cache_clear()
        return folder

    yield install
    for module in ("added_format", "tlm_of_others", "failing", "broken", "mine"):
        sys.modules.pop(module, None)
    added_formats.cache_clear()


@pytest.fixture
def saved(tmp_path):
    log = silo.Logger("added", frequency=100, folder=tmp_path, script=tmp_path / "no.yaml")
    height = log.array("height", unit="m")
    log.start()
    for height[...] in np.arange(5.0):
        log.collect()
    (file,) = log.save()
    log.close()
    return Path(file.path)


def test_a_format_of_another_package_is_written_opened_and_converted(installed, saved, tmp_path):
    installed("added_format", (RECIPES / "added_format.py").read_text())
    silo.open_log(saved).save(tmp_path / "a.steps")
    assert silo.open_log(tmp_path / "a.steps")["height"].values.tolist() == [0, 1, 2, 3, 4]
    done = CliRunner().invoke(cli, ["convert", str(tmp_path / "a.steps"), str(tmp_path / "b.csv")])
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["convert", str(saved), str(tmp_path / "c.steps")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "c.steps").read_text() == (tmp_path / "a.steps").read_text()
    assert CliRunner().invoke(cli, ["stats", str(tmp_path / "a.steps"), "height"]).exit_code == 0


def test_its_first_bytes_tell_a_file_also_one_of_another_ending(installed, tmp_path):
    for name in ("run.tlm", "run.log"):
        (tmp_path / name).write_bytes(b"TLM1\x01\x12\x35")
    with pytest.raises(FileFormatError, match=r"silo doesn't read \.tlm, only"):
        silo.open_log(tmp_path / "run.tlm")
    installed("tlm_of_others", TELEMETRY)
    for name in ("run.tlm", "run.log"):
        assert silo.open_log(tmp_path / name).name == "tlm"


@pytest.mark.parametrize(
    ("code", "target", "words"),
    [
        ("import nothing_of_that_name", "FORMAT", "No module named 'nothing_of_that_name'"),
        ("FORMAT = 5", "FORMAT", "is no silo.files.formats.Format, but of int"),
        ("FORMAT = 5", "OTHER", "OTHER"),
        (TELEMETRY.replace(".tlm", ".csv").replace(', mark=b"TLM1"', ""), "FORMAT", "silo has '.csv' itself"),
        (TELEMETRY.replace('reader="tlm_of_others:read", ', ""), "FORMAT", "a reader or a writer"),
    ],
)
def test_a_broken_one_is_left_out_and_named_where_it_is_missed(installed, saved, tmp_path, code, target, words):
    installed("broken", code, target)
    installed("added_format", (RECIPES / "added_format.py").read_text())
    silo.open_log(saved).save(tmp_path / "a.steps")
    (tmp_path / "x.unknown").write_bytes(b"12345678")
    with pytest.raises(FileFormatError, match=r"silo doesn't read \.unknown, only") as told:
        silo.open_log(tmp_path / "x.unknown")
    assert "the format 'broken' of the package 'broken' is left out: " in str(told.value)
    assert words in str(told.value)
    with pytest.raises(SaveError, match="package 'broken' is left out"):
        silo.open_log(saved).save(tmp_path / "x.unknown2")


def test_what_its_reader_or_writer_raises_is_an_error_of_silo_and_leaves_no_file(installed, saved, tmp_path):
    installed("failing", FAILING)
    before = sorted(one.name for one in tmp_path.iterdir())
    with pytest.raises(SaveError, match=r"x\.bad': the writer 'failing:write' failed: ValueError: disk on fire"):
        silo.open_log(saved).save(tmp_path / "x.bad")
    assert sorted(one.name for one in tmp_path.iterdir()) == before
    (tmp_path / "y.bad").write_text("")
    with pytest.raises(FileFormatError, match="the reader 'failing:read' failed: KeyError: 'topic'"):
        silo.open_log(tmp_path / "y.bad")


def test_what_silo_reads_itself_asks_no_other_package(installed, saved):
    installed("mine", "import pathlib; pathlib.Path(__file__).with_suffix('.loaded').touch()")
    silo.open_log(saved)
    silo.open_log(saved).save(saved.with_suffix(".csv"))
    silo.open_log(saved.with_suffix(".csv"))
    assert "mine" not in sys.modules


ROBOT = """
import sys, numpy as np, silo
log = silo.Logger("added", frequency=100, folder=sys.argv[1], script=sys.argv[1] + "/no.yaml")
x = log.array("x")
log.serve()
log.start()
for x[...] in range(20):
    log.collect()
log.save(["silo", "csv", "bag"])
log.close()
"""


@pytest.mark.slow
def test_neither_a_robot_program_nor_its_helper_process_loads_one(installed, tmp_path, runtime_folder):
    packages = installed("mine", "import pathlib; pathlib.Path(__file__).with_suffix('.loaded').touch()")
    environment = {**os.environ, "PYTHONPATH": str(packages)}
    made = tmp_path / "run"
    made.mkdir()
    subprocess.run([sys.executable, "-c", ROBOT, str(made)], env=environment, check=True)
    assert len(list(made.glob("added*"))) >= 3
    assert not (packages / "mine.loaded").exists()
    (tmp_path / "x.unknown").write_bytes(b"12345678")
    asks = "import sys, silo; silo.open_log(sys.argv[1])"
    subprocess.run([sys.executable, "-c", asks, str(tmp_path / "x.unknown")], env=environment, check=False)
    assert (packages / "mine.loaded").exists()
