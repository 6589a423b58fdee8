"""Saves that get a process of their own, and what is said when it dies."""

import io
import os
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import msgspec
import pytest

import silo
from silo.core.elements import FileType
from silo.errors import SaveError
from silo.helper.saver import Saver
from silo.logger.serving.answers import robot_state
from silo.recordings import writing
from silo.recordings.requests import Save
from silo.recordings.writing import WriteOrder, WriteReport, write_log
from silo.rpc.refusals import RequestRefusedError
from silo.segment.reader import SegmentReader
from silo.state.replica import Replica
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow


@pytest.fixture
def reader(new_logger):
    logger = new_logger()
    x = logger.array("x")
    logger.start()
    for value in range(50):
        x[...] = value
        logger.collect()
    made = SegmentReader(logger._present.path)
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
    monkeypatch.setattr("silo.recordings.writing.sys.executable", "/bin/false")
    with pytest.raises(SaveError, match=r"exit code 1.*save as \.silo"):
        write_log(reader, order(tmp_path, FileType.BAG), lambda _: None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("awaited", "steps"), [(True, []), (False, [writing.NICER])])
def test_a_writing_process_is_nice_unless_the_robot_program_waits_for_it(tmp_path, monkeypatch, awaited, steps):
    taken = []
    wanted = WriteOrder(str(tmp_path), "bot", [FileType.CSV], "walk", log=str(tmp_path / "none.silo"), awaited=awaited)
    out = io.BytesIO()
    monkeypatch.setattr(writing.os, "nice", taken.append)
    monkeypatch.setattr(writing.sys, "stdin", SimpleNamespace(buffer=io.BytesIO(msgspec.json.encode(wanted))))
    monkeypatch.setattr(writing.sys, "stdout", SimpleNamespace(buffer=out))
    writing.main()
    assert taken == steps
    assert b"none.silo" in out.getvalue()


@pytest.mark.parametrize("for_robot", [True, False])
def test_the_writing_process_knows_whether_the_robot_program_waits(new_logger, monkeypatch, for_robot):
    orders = []
    monkeypatch.setattr("silo.helper.saver.MAX_WAITING", 1)

    def write(reader, order, progress):
        orders.append(order)
        return WriteReport(1.0, True, 1)

    monkeypatch.setattr(writing, "write_log", write)
    logger = new_logger()
    logger.array("x")
    logger.start()
    logger.collect()
    replica = Replica(robot_state(logger, "", -1))
    saver = Saver(
        replica,
        SimpleNamespace(
            publish=lambda *_, **__: None, progress=lambda *_, **__: None, log=SimpleNamespace(of_run=lambda _: [])
        ),
        SimpleNamespace(tell=lambda _: None),
    )
    job = saver.prepare(Save(types=[FileType.BAG], name="", client="x"), for_robot=for_robot)
    saver.submit(job)
    refused = nullcontext() if for_robot else pytest.raises(RequestRefusedError, match="1 saves are waiting already")
    with refused:  # however much clients want, the program's own save is done
        saver.submit(saver.prepare(Save(types=[FileType.BAG], name="", client="x"), for_robot=for_robot))
    saver.start()
    saver.stop()
    assert [order.awaited for order in orders] == [for_robot] * (1 + for_robot)


@pytest.mark.parametrize("said", [b"", b'{"folder": "/tm'])
def test_a_writing_process_whose_helper_was_killed_before_it_said_all_ends_without_a_word(said):
    command = [sys.executable, "-m", "silo.recordings.writing", "--hold", str(os.getpid())]
    done = subprocess.run(command, input=said, capture_output=True, timeout=DEADLINE_S, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (1, b"", b"")
