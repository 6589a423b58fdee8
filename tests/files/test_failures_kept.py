"""At which ticks a source could not be read stands in every file, and is told wherever a file is shown."""

import json
from dataclasses import replace

import numpy as np
import pytest

import silo
from silo.cli.codes import EXIT_FOUND
from silo.cli.main import run
from silo.core.recording import NO_FAILURES, Failures
from silo.errors import LogWarning
from silo.files.formats import FORMATS, writer_for

ENDINGS = [one.ending for one in FORMATS if one.reader and one.writer]
EXPECTED = Failures(3, ((1, 2), (5, 5)))


class Robot:
    mode: object = 1


@pytest.fixture
def recording(new_logger):
    """Eight ticks, at three of which the mode could not be read."""
    robot = Robot()
    logger = new_logger(script="/none.yaml")
    logger.add(robot, attr="mode")
    x = logger.array("x")
    logger.start()
    for tick in range(8):
        robot.mode = None if tick in (1, 2, 5) else tick
        x[...] = tick
        logger.collect()
    return logger.snapshot()


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
@pytest.mark.parametrize("ending", ENDINGS)
def test_a_log_that_is_opened_says_what_could_not_be_read(tmp_path, recording, ending):
    path = tmp_path / f"log{ending}"
    writer_for(path)(recording, path, None)
    log = silo.open_log(path)
    assert log["mode"].failures == EXPECTED
    assert log["x"].failures == NO_FAILURES
    assert any("/log/mode: could not be read at 3 ticks (1-2, 5)" in text for text in log.warnings)


def test_opening_warns_of_it(tmp_path, recording):
    path = tmp_path / "log.silo"
    writer_for(path)(recording, path, None)
    with pytest.warns(LogWarning, match="mode: could not be read at 3 ticks"):
        silo.open_log(path)


@pytest.mark.parametrize("source", ENDINGS)
@pytest.mark.parametrize("target", ENDINGS)
@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_convert_carries_it_from_any_format_to_any(tmp_path, recording, source, target):
    first, second = tmp_path / f"a{source}", tmp_path / f"b{target}"
    writer_for(first)(recording, first, None)
    assert run(["convert", str(first), str(second)]) == 0
    assert silo.open_log(second)["mode"].failures == EXPECTED


def test_a_damaged_silo_file_still_says_it(tmp_path, recording):
    path = tmp_path / "log.silo"
    writer_for(path)(recording, path, None)
    data = bytearray(path.read_bytes())
    data[3] ^= 1  # the check of the header fails: it is repaired
    path.write_bytes(data)
    with pytest.warns(LogWarning):
        assert silo.open_log(path)["mode"].failures == EXPECTED


def test_info_of_a_file_has_a_column_of_it(tmp_path, recording, capsys):
    path = tmp_path / "log.silo"
    writer_for(path)(recording, path, None)
    assert run(["info", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].endswith("lost 0, failed 3")
    (head,) = [line for line in lines if line.startswith("element")]
    (row,) = [line for line in lines if line.startswith("/log/mode ")]
    assert (head.split()[-1], row.split()[-1]) == ("failed", "3")
    assert run(["info", str(path), "--json"]) == 0
    (mode, _) = json.loads(capsys.readouterr().out)["elements"]
    assert mode["failures"] == {"count": 3, "spans": [[1, 2], [5, 5]]}


def test_a_file_in_which_nothing_failed_has_no_such_column(tmp_path, recording, capsys):
    path = tmp_path / "log.silo"
    whole = replace(recording, elements=[replace(one, failures=NO_FAILURES) for one in recording.elements], warnings=())
    writer_for(path)(whole, path, None)
    assert b"failures" not in path.read_bytes().partition(b"Binary Data")[0]
    assert run(["info", str(path)]) == 0
    assert "failed" not in capsys.readouterr().out


def test_diff_tells_that_one_of_two_logs_could_not_read_it(tmp_path, recording, capsys):
    paths = [tmp_path / "a.silo", tmp_path / "b.silo"]
    whole = replace(recording, elements=[replace(one, failures=NO_FAILURES) for one in recording.elements])
    for path, each in zip(paths, (recording, whole), strict=True):
        writer_for(path)(each, path, None)
    with pytest.raises(SystemExit) as ended:
        run(["diff", *map(str, paths)])
    assert ended.value.code == EXIT_FOUND
    assert "ticks that could not be read: 3, then 0" in capsys.readouterr().out


# ------------------------------------------------------------------------------------------------- only written


def test_parquet_has_it_in_the_metadata_of_the_column(tmp_path, recording):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    writer_for(path)(recording, path, None)
    schema = parquet.read_schema(path)
    assert json.loads(schema.field("/log/mode").metadata[b"failures"]) == {"count": 3, "spans": [[1, 2], [5, 5]]}
    assert b"failures" not in schema.field("/log/x").metadata


def test_npz_has_it_in_its_json(tmp_path, recording):
    path = tmp_path / "log.npz"
    writer_for(path)(recording, path, None)
    with np.load(path) as arrays:
        facts = json.loads(str(arrays["silo.json"]))
    assert facts["elements"][0]["failures"] == {"count": 3, "spans": [[1, 2], [5, 5]]}


def test_matlab_has_it_in_the_struct(tmp_path, recording):
    matlab = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    writer_for(path)(recording, path, None)
    struct = matlab.loadmat(path)["log_mode"][0, 0]
    assert struct["failed"].item() == 3
    assert struct["failed_ticks"].tolist() == [[1, 2], [5, 5]]


def test_hdf5_has_it_in_the_attributes(tmp_path, recording):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    writer_for(path)(recording, path, None)
    with h5py.File(path) as store:
        assert store["log/mode"].attrs["failed"] == 3
        assert store["log/mode"].attrs["failed_ticks"].tolist() == [[1, 2], [5, 5]]
        assert store["log/x"].attrs["failed"] == 0
