"""At which ticks a source could not be read stands in every file, and is told wherever a file is shown."""

import json
from dataclasses import replace

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


def of_parquet(path):
    schema = pytest.importorskip("pyarrow.parquet").read_schema(path)
    assert b"failures" not in schema.field("/log/x").metadata
    told = json.loads(schema.field("/log/mode").metadata[b"failures"])
    return told["count"], told["spans"]


def of_matlab(path):
    struct = pytest.importorskip("scipy.io").loadmat(path)["log_mode"][0, 0]
    return struct["failed"].item(), struct["failed_ticks"].tolist()


def of_hdf5(path):
    with pytest.importorskip("h5py").File(path) as store:
        assert store["log/x"].attrs["failed"] == 0
        return store["log/mode"].attrs["failed"], store["log/mode"].attrs["failed_ticks"].tolist()


@pytest.mark.parametrize(("ending", "told"), [("parquet", of_parquet), ("mat", of_matlab), ("h5", of_hdf5)])
def test_other_tools_find_it_in_the_words_of_their_format(tmp_path, recording, ending, told):
    path = tmp_path / f"log.{ending}"
    writer_for(path)(recording, path, None)
    assert told(path) == (3, [[1, 2], [5, 5]])
