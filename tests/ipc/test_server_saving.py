"""Saves that get a process of their own, and what is said when it dies."""

import pytest

import silo
from silo.collecting.segment_reader import SegmentReader
from silo.errors import SaveError
from silo.helper.writing import WriteOrder, write_log
from silo.model import FileType

pytestmark = pytest.mark.slow


@pytest.fixture
def reader(new_logger):
    logger = new_logger()
    x = logger.array("x")
    logger.start()
    for value in range(50):
        x[...] = value
        logger.collect()
    made = SegmentReader(logger.segment_path)
    yield made
    made.close()


def order(folder, *types):
    return WriteOrder(str(folder), "bot", list(types), "walk")


@pytest.mark.parametrize("types", [[FileType.SILO], [FileType.CSV], [FileType.BAG, FileType.SILO]])
def test_every_type_is_written_and_read_back(reader, tmp_path, types):
    report = write_log(reader, order(tmp_path, *types), lambda _: None)
    assert (report.error, report.ticks, [file.type for file in report.files]) == ("", 50, types)
    for file in report.files:
        assert list(silo.open_log(file.path)["/log/x"].values) == list(range(50))


def test_a_segment_that_is_deleted_meanwhile_is_still_written(reader, tmp_path):
    reader.path.unlink()
    assert write_log(reader, order(tmp_path, FileType.CSV), lambda _: None).ticks == 50


def test_a_name_that_is_taken_is_refused_by_the_writing_process(reader, tmp_path):
    (tmp_path / "walk.csv").mkdir()
    (tmp_path / "walk.csv" / "in the way").touch()
    report = write_log(reader, order(tmp_path, FileType.CSV, FileType.BAG), lambda _: None)
    assert "walk.csv" in report.error


def test_a_writing_process_that_dies_is_an_error_with_a_way_out(reader, tmp_path, monkeypatch):
    monkeypatch.setattr("silo.helper.writing.sys.executable", "/bin/false")
    with pytest.raises(SaveError, match=r"exit code 1.*save as \.silo"):
        write_log(reader, order(tmp_path, FileType.BAG), lambda _: None)
    assert list(tmp_path.iterdir()) == []
