"""Runs that wait for their consumers: their names, what is left where there is no room, and who may delete them."""

import contextlib
import fcntl
import os
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from silo.core.runtime import list_held, list_segments
from silo.logger.current_run import CurrentRun
from silo.recorder import left_recordings
from silo.recorder.left_recordings import left_lists
from silo.recorder.process import stored
from silo.recovery.left import SavedMeanwhileError
from silo.recovery.runs import look_back
from silo.recovery.segments import claimed, discard, sweep_segments
from silo.segment import held_runs as held
from silo.segment.held_runs import (
    Program,
    all_runs,
    child_of,
    held_runs,
    hold,
    is_due,
    is_live,
    judge_path,
    make_stub,
    program_of,
    recorders_path,
    trim,
)
from silo.segment.reader import SegmentReader
from silo.state.held_runs import tell_left


@pytest.fixture
def held_run(new_logger):
    """Makes runs of a logger that are held, of so many ticks each."""
    log = new_logger("bot", frequency=1000, max_time=0)
    x = log.array("x", 100, buffer="looping", size=500)

    def make(ticks: int) -> Path:
        (log.restart if log.is_running else log.start)()
        for tick in range(ticks):
            x[:] = tick
            log.collect()
        log.stop()
        return log._present.run.drop(held=True)

    make.log = log
    return make


def test_a_run_that_is_held_is_read_as_before_and_is_no_leftover(held_run) -> None:
    path = held_run(7)
    assert (list_held(), list_segments()) == ([path], [])
    (reader,) = held_runs("bot", held_run.log.options.id)
    assert (reader.ticks, reader.dropped, reader.schema.number) == (7, False, 1)
    assert reader.rows(1, 0).words[:, 2].view(np.float64).tolist() == list(range(7))
    assert sweep_segments() == []
    reader.close()


def test_runs_are_found_oldest_first_and_by_their_logger(held_run) -> None:
    paths = [held_run(ticks) for ticks in (3, 4, 5)]
    found = held_runs("bot", held_run.log.options.id)
    assert ([one.path for one in found], [one.ticks for one in found]) == (paths, [3, 4, 5])
    assert [one.schema.number for one in found] == [1, 2, 3]
    assert held_runs("bot", "another") == held_runs("bo") == []


@pytest.mark.parametrize("is_opened", [False, True])
def test_a_run_that_is_let_go_of_while_somebody_looks_is_found_once(new_logger, monkeypatch, is_opened) -> None:
    log = new_logger("bot", frequency=1000, max_time=0)
    log.array("x", 1)
    log.start()
    log.collect()
    log.stop()
    (path,) = list_segments()

    def listed_and_let_go(folder: Path | None = None) -> list[Path]:
        paths = list_segments(folder)
        hold(paths[0])
        return paths

    if not is_opened:
        monkeypatch.setattr(held, "list_segments", listed_and_let_go)
    found = []
    for reader in all_runs("bot", log.options.id):
        found.append(reader.path)
        reader.close()
        if is_opened:
            hold(path)
    assert found == [path if is_opened else held.held_name(path)]


def test_a_stub_tells_how_much_there_was_and_has_no_row(held_run) -> None:
    path = held_run(900)
    taken = path.stat().st_blocks
    before = SegmentReader(path)
    make_stub(path)
    stub = SegmentReader(path)
    assert path.stat().st_blocks < taken / 2
    assert (stub.ticks, stub.dropped, stub.running, stub.size_bytes) == (900, True, False, before.size_bytes)
    assert stub.schema == before.schema
    rows = stub.rows(1, 100)
    assert (rows.first, len(rows)) == (900, 0)
    assert len(before.rows(1, 600)) == 300  # who has it open keeps it
    before.close()
    stub.close()


def test_growing_rings_of_a_stub_have_no_row_either(new_logger) -> None:
    log = new_logger("bot", frequency=1000, max_time=0)
    log.array("x", 100, buffer="growing")
    log.start()
    for _ in range(5000):
        log.collect()
    log.stop()
    path = log._present.run.drop(held=True)
    make_stub(path)
    stub = SegmentReader(path)
    assert (stub.ticks, len(stub.rows(1, 0))) == (5000, 0)
    stub.close()


def test_the_oldest_make_room_first(held_run, monkeypatch) -> None:
    paths = [held_run(600) for _ in range(4)]
    monkeypatch.setattr(held, "bound_of", lambda _: (3, 1 << 40))
    assert trim(paths, in_memory=True) == paths[:1]
    assert trim(paths, in_memory=True) == []
    size = sum(held.bytes_of(path) for path in paths[2:])
    monkeypatch.setattr(held, "bound_of", lambda _: (3, size))
    assert trim(paths, in_memory=True) == paths[1:2]
    assert trim(paths, in_memory=True, room_bytes=1 << 60) == paths[2:]
    assert [SegmentReader(path).dropped for path in paths] == [True] * 4


def test_of_stubs_there_are_no_more_than_their_bound(held_run, monkeypatch) -> None:
    paths = [held_run(600) for _ in range(4)]
    monkeypatch.setattr(held, "STUBS", 2)
    trim(paths, in_memory=True, room_bytes=1 << 60)
    assert [path.exists() for path in paths] == [False, False, True, True]


def test_a_saved_segment_stays_while_a_recorder_or_the_judge_needs_it(new_logger) -> None:
    log = new_logger("bot")
    log.array("x")
    log.start()
    log.collect()
    log.stop()
    reader = SegmentReader(log._present.path)
    schema = reader.schema
    assert not is_due(schema)
    for ledger in (recorders_path("bot", schema.logger_id), judge_path("bot", schema.run)):
        ledger.touch()
        assert is_due(schema)
        ledger.unlink()
    recorders_path("bot", schema.logger_id).touch()
    discard(reader)
    assert [path.suffix for path in list_held()] == [".held"]
    recorders_path("bot", schema.logger_id).unlink()
    reader.close()
    for reader in held_runs("bot"):
        discard(reader)
        reader.close()
    assert list_held() == []


@pytest.mark.parametrize(
    ("ticks", "is_saved", "is_there", "is_refused"),
    [
        (3, False, True, False),
        (3, True, True, False),
        (3, False, False, False),  # deleted without being saved: it is still mapped
        (3, True, False, True),
        (0, False, False, False),
    ],
)
def test_who_would_save_a_segment_that_another_saved_meanwhile_is_told(
    new_logger, ticks, is_saved, is_there, is_refused
) -> None:
    log = new_logger("bot", frequency=1000, max_time=0)
    log.array("x")
    log.start()
    for _ in range(ticks):
        log.collect()
    log.stop()
    path = Path(log._present.path)
    refused = pytest.raises(SavedMeanwhileError, match="saved it meanwhile") if is_refused else contextlib.nullcontext()
    with contextlib.closing(SegmentReader(path)) as reader, path.open("rb") as other:
        if is_saved:
            log.save()
        if not is_there:
            path.unlink()
        with refused, claimed(reader), pytest.raises(BlockingIOError):
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)


@pytest.mark.parametrize("is_held", [True, False])
def test_who_closes_before_the_helper_process_is_done_is_told_what_may_be_missing(
    new_logger, is_held, monkeypatch, capsys
) -> None:
    log = new_logger("bot")
    log.array("x")
    log.start()
    drop = CurrentRun.drop
    monkeypatch.setattr(CurrentRun, "drop", lambda present: drop(present) or is_held)
    log.close(discard=True)
    said = "silo: logger 'bot' was closed before its helper process was done: what is recorded of it"
    assert (said in capsys.readouterr().err) is is_held


@pytest.mark.parametrize("is_left", [False, True])
def test_what_a_helper_process_still_does_of_a_run_that_was_left_to_it_is_not_said_to_be_missing(
    new_logger, is_left
) -> None:
    log = new_logger("bot")
    log.array("x")
    log.start()
    log.collect()
    log.stop()
    log._present._wanted = lambda run: True
    if is_left:
        assert log._present.leave()
    assert log._present.drop() is not is_left


def test_a_logger_lives_as_long_as_its_present_run_has_a_writer(new_logger, held_run) -> None:
    log = new_logger("alone")
    log.array("x")
    assert is_live(child_of("alone", log.options.id, os.getpid()))  # nothing was logged yet
    log.start()
    program = program_of(log._present.run.segment.schema)
    assert is_live(program)
    log.stop()
    assert is_live(program)
    hold(Path(log._present.path))
    assert not is_live(program)  # as if it had been closed
    assert not is_live(Program("alone", "x", os.getpid(), 1, "another boot"))


def test_a_list_of_recorders_that_is_begun_anew_while_somebody_looks_stays(monkeypatch) -> None:
    path = recorders_path("bot", "9811a58f56")
    path.write_bytes(b"[]")

    def ended_and_begun(one: Path) -> list[object]:
        one.unlink()
        found = stored(one)
        one.write_bytes(b"[]")
        return found

    with monkeypatch.context() as beside:
        beside.setattr(left_recordings, "stored", ended_and_begun)
        assert left_lists() == []
    assert path.exists()
    assert left_lists() == []
    assert not path.exists()  # nobody can use it


def test_a_list_of_recorders_that_can_not_be_opened_is_told_and_stays(tmp_path, caplog) -> None:
    path = recorders_path("bot", "9811a58f56")
    path.symlink_to(tmp_path)
    assert left_lists() == []
    assert f"{path} can't be opened (it is a link" in caplog.text
    assert path.is_symlink()


def test_nothing_is_said_of_a_process_of_another_container(monkeypatch) -> None:
    mine = child_of("alone", "id", 2**22 + 5)  # a process that isn't there
    assert not is_live(mine)
    monkeypatch.setattr(held, "pid_namespace", lambda: 1)
    assert is_live(mine)


def test_a_segment_of_a_log_folder_is_held_there_and_found_by_its_link(new_logger, tmp_path) -> None:
    log = new_logger("bot", storage="file")
    log.array("x")
    log.start()
    log.collect()
    log.stop()
    path = log._present.run.drop(held=True)
    assert path.parent == tmp_path
    assert (list_held(), list_segments(tmp_path)) == ([path], [])
    held.remove(path)
    assert list_held() == []


def test_of_runs_that_make_room_at_each_start_is_told_once_and_in_one_number_when_it_is_over(
    new_logger, monkeypatch, caplog
) -> None:
    monkeypatch.setattr(held, "bound_of", lambda _: (1, 1 << 40))
    log = new_logger("bot", frequency=1000, max_time=0)
    log.array("x", 1, buffer="looping", size=100)
    wanted = [True] * 6 + [False] * 2
    monkeypatch.setattr(log, "_is_wanted", lambda _: wanted.pop(0))
    for _ in range(8):
        log.start()
        log.collect()
        log.stop()
    told = [record.getMessage().partition(" before")[0] for record in caplog.records if "made room" in record.message]
    assert told == ["1 run", "5 runs in all made room"]


@pytest.mark.parametrize(
    ("other", "is_told"),
    [({"id": "another"}, True), ({}, False), ({"id": "another", "folder": "/elsewhere"}, False),
     ({"id": "another", "name": "bo"}, False)],
)  # fmt: skip
def test_a_start_beside_another_program_of_that_name_and_folder_tells_of_it(new_logger, caplog, other, is_told) -> None:
    log = new_logger("bot")
    log.array("x")
    log.start()
    assert caplog.messages == []
    look_back(msgspec.structs.replace(log.options, **other), served=True)
    told = f"bot: process {os.getpid()} logs under this name into this folder, too"
    assert [text.partition(": their")[0] for text in caplog.messages] == [told] * is_told
    log.close(discard=True)
    look_back(msgspec.structs.replace(log.options, **other), served=True)
    assert len(caplog.messages) == is_told


@pytest.mark.parametrize("ticks", [0, 1, 5])
@pytest.mark.parametrize("is_over", [False, True])
def test_of_a_run_of_which_nobody_told_begin_and_end_are_told_once_at_their_ticks(new_logger, ticks, is_over):
    times = iter(range(70, 10**9, 10))
    logger = new_logger(clock=lambda: next(times))
    logger.array("x")
    logger.start()
    for _ in range(ticks):
        logger.collect()
    if is_over:
        logger.stop()
    told = {}
    events = SimpleNamespace(
        log=SimpleNamespace(texts=lambda kind, run: [kind for _ in range(kind in told)]),
        publish=lambda kind, text, **more: told.update({kind.value: (text, more["tick"], more["stamp_ns"])}),
    )
    with contextlib.closing(SegmentReader(logger._present.path)) as reader:
        tell_left(reader, events)
        begun, *ends = told.values()
        assert begun[1:] == (0, reader.stamp_of(0))
        assert ends == ([("stopped on request", ticks - 1, reader.last_time_ns)] if is_over else [])
        if ticks:
            assert (reader.stamp_of(0), reader.last_time_ns) == (begun[2], begun[2] + 10 * (ticks - 1))
        before = dict(told)
        told |= dict.fromkeys(told, "told")
        tell_left(reader, events)
    assert told == dict.fromkeys(before, "told")
