"""Saves that get a process of their own, and what is said when it dies."""

import io
import os
import re
import subprocess
import sys
from contextlib import closing, nullcontext
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import FileType
from silo.errors import SaveError
from silo.helper.saver import Saver
from silo.logger.serving.answers import robot_state
from silo.recordings import writing
from silo.recordings.requests import Save
from silo.recordings.writing import WriteOrder, WriteReport, write_log
from silo.rpc.published import EventKind
from silo.rpc.refusals import RequestRefusedError
from silo.segment.reader import SegmentReader
from silo.state.replica import Replica
from tests.waiting import DEADLINE_S, wait_until

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


def _told_of_save(client, *types):
    told = []
    client.on_event(told.append)
    client.save(types)
    ends = (EventKind.SAVED, EventKind.SAVE_FAILED)
    return wait_until(lambda: next((one.text for one in told if one.kind in ends), None))


def _refused(change, *arguments, **options):
    with pytest.raises(silo.RefusedError) as refused:
        change(*arguments, **options)
    return str(refused.value)


def test_what_is_small_is_saved_for_clients_on_a_disk_that_has_no_more_to_leave(runtime_folder, small_disk):
    log = silo.Logger("bot", folder=small_disk / "logs", script=small_disk.parent / "bot.yaml")
    log.array("x")
    with closing(log):
        log.serve()
        log.start()
        log.collect()
        (small_disk / "full").write_bytes(bytes(8 * 2**20 - 120_000))
        with Client.connect("bot") as client:
            assert re.match(r"saved .*/bot_\S+\.silo", _told_of_save(client, FileType.SILO))


# what leaves fewer than 168 kB free: 8.2 MB of rows, or of the text of 450 rows
@pytest.mark.parametrize(
    ("ticks", "write"),
    [
        (1032, lambda client: _told_of_save(client, FileType.SILO)),
        (455, lambda client: _told_of_save(client, FileType.CSV)),
        (1032, lambda client: _refused((client.stop(), client.start)[1], unsaved="save")),
        (1032, lambda client: _refused(client.restart, unsaved="save")),
        (1032, lambda client: _refused(client.apply, [silo.Edit("/log/x", size=2000)], -1, cut=True)),
    ],
    ids=["silo", "csv", "start", "restart", "cut"],
)
def test_what_clients_have_written_leaves_others_room_on_the_disk(runtime_folder, small_disk, ticks, write):
    log = silo.Logger("bot", folder=small_disk / "logs", script=small_disk.parent / "bot.yaml", max_time=0)
    x = log.array("x", 1000, buffer=silo.BufferType.GROWING, size=10)
    with closing(log):
        log.serve()
        log.start()
        x[:] = np.pi
        for _ in range(ticks):
            log.collect()
        with Client.connect("bot") as client:
            assert "are free, and 168 kB of it are left to others" in write(client)
        assert log.ticks == ticks
        assert list((small_disk / "logs").glob("bot*.silo")) == []
        (file,) = log.save()  # the program may
        log.stop()
        with Client.connect("bot") as client:
            client.start("save")  # nothing is to be saved
        log.stop()
        assert len(silo.open_log(file.path)["/log/x_0"]) == ticks
