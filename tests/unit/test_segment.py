"""The segment: its file, its room, its memory limit, what it counts, and what it tells a reader."""

import contextlib
import gc
import os
import signal
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

from silo.core.elements import Action, BufferType
from silo.core.runtime import SEGMENT_SUFFIX, list_segments, runtime_dir
from silo.errors import SegmentError
from silo.loop import generated_code
from silo.segment import reader as segment_reader
from silo.segment import writer as segment
from silo.segment.layout import TIME_RING, RingControl
from silo.segment.reader import SegmentReader
from silo.segment.reasons import StopReason
from tests.waiting import DEADLINE_S, wait_until

GROWING = BufferType.GROWING


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


def reader_of(logger):
    return SegmentReader(logger._present.path)


@pytest.fixture
def small_memory(tmp_path, monkeypatch):
    """A runtime folder in a tmpfs of 4 MB, as in a small container."""
    folder = tmp_path / "shm"
    folder.mkdir(mode=0o700)
    command = ["mount", "-t", "tmpfs", "-o", "size=4m,mode=700", "silo-test", str(folder)]
    if os.getuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("needs the right to mount")
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(folder))
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


# ------------------------------------------------------------------------------------------------------ the room


def test_without_room_start_says_how_much_is_missing_and_what_to_do(new_logger, small_memory):
    logger = new_logger()
    logger.array("x", 1000, size=10_000)
    with pytest.raises(SegmentError, match=r"no room for 8[\d.]+ MB of buffers, [\d.]+ MB are free.*storage=\"file\""):
        logger.start()


def test_a_restart_takes_the_room_of_the_run_before(new_logger, small_memory):
    logger = new_logger()
    logger.array("x", 30, size=10_000)  # 2.6 MB: two of them have no room
    logger.start()
    logger.restart()
    assert len(list_segments()) == 1


def mapped_segments():
    """Those of this test, whatever earlier ones in this process still hold."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    held = {line.split(maxsplit=5)[5] for line in lines if ".segment" in line}
    return {path for path in held if path.startswith(os.environ["SILO_RUNTIME_DIR"])}


def test_the_buffers_of_the_run_before_are_freed_at_once(new_logger):
    logger = new_logger(max_time=0)
    logger.array("x", buffer=GROWING)
    logger.array("y")
    logger.start()
    for _ in range(3):
        logger.collect()
        logger.snapshot()
        logger.restart()
    assert mapped_segments() == {logger._present.path}


def test_a_kept_collect_does_not_keep_the_buffers_of_its_run(new_logger):
    logger = new_logger()
    logger.array("y")
    logger.start()
    kept = logger.collect
    kept()
    logger.restart()
    kept()
    assert logger.ticks == 1
    assert mapped_segments() == {logger._present.path}


def test_a_closed_logger_frees_its_buffers(new_logger):
    logger = new_logger(max_time=0)
    logger.array("x", buffer=GROWING)
    logger.start()
    logger.collect()
    logger.close()
    del logger
    assert mapped_segments() == set()


def test_a_folder_for_logs_that_can_not_be_made_is_a_segment_error(new_logger):
    logger = new_logger(storage="file", folder="/proc/none")
    logger.array("x")
    with pytest.raises(SegmentError, match="can't make the folder for logs"):
        logger.start()


def test_a_growing_buffer_that_finds_no_room_counts_what_it_can_not_keep(new_logger, small_memory):
    logger = new_logger(max_time=0)
    x = logger.array("x", 300, np.int64, buffer=GROWING, size=1)
    logger.start()
    for tick in range(4000):  # 9.7 MB
        x[:] = tick
        logger.collect()
    (element,) = logger.snapshot().elements
    assert 0 < element.count < 2000
    assert element.count + element.lost == logger.ticks
    assert element.entries[0].values.tolist() == list(range(element.count))


def test_buffers_larger_than_the_memory_are_refused_before_the_kernel_kills_the_program(new_logger):
    logger = new_logger()
    logger.array("x", 1000, size=2_000_000_000)
    with pytest.raises(SegmentError, match=r"no memory for 1[\d.]+ TB of buffers, [\d.]+ [MG]B are available"):
        logger.start()


def test_a_limit_on_the_size_of_files_is_an_error_and_no_signal(new_logger, monkeypatch, small_files):
    logger = new_logger()
    logger.array("x", 1000, size=1000)
    with small_files(1_000_000), pytest.raises(SegmentError, match="File too large"):
        logger.start()
    assert signal.getsignal(signal.SIGXFSZ) == signal.SIG_IGN


def test_every_page_of_the_rings_is_there_before_the_first_tick(new_logger):
    logger = new_logger()
    logger.array("x", 100, size=10_000)
    logger.start()
    found = Path(logger._present.path).stat()
    assert found.st_blocks * 512 >= found.st_size - 4096


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("open", "mode is 755, others could look in; run: chmod 700"),
        ("link", "is not a folder of this user"),
        ("file", "set SILO_RUNTIME_DIR to a folder that this user owns"),
    ],
)
def test_a_runtime_folder_that_is_none_of_this_user_alone_is_refused(tmp_path, monkeypatch, name, words):
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(tmp_path / "a" / "b"))
    assert runtime_dir().stat().st_mode & 0o777 == 0o700  # it is made so
    (tmp_path / "open").mkdir(mode=0o755)
    (tmp_path / "link").symlink_to(tmp_path / "a" / "b")
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(tmp_path / name))
    with pytest.raises(SegmentError, match=words):
        runtime_dir()


# ----------------------------------------------------------------------------------------------- the memory limit


def test_at_the_memory_limit_a_growing_buffer_keeps_what_it_has_and_counts_the_rest(new_logger, caplog, until):
    logger = new_logger(max_time=0, memory_limit_mb=4)
    x = logger.array("x", 300, np.int64, buffer=GROWING, size=1)
    logger.start()
    for tick in range(5000):
        x[:] = tick
        logger.collect()
    (element,) = logger.snapshot().elements
    assert logger.is_running
    assert element.entries[-1].values.tolist() == list(range(element.count))
    assert element.lost == 5000 - element.count > 0
    assert "samples could not be kept: the memory limit was reached" in logger.snapshot().warnings[0]
    until(lambda: caplog.messages)
    assert [message.partition(": what")[0] for message in caplog.messages] == [
        "test: the memory limit was reached (memory_limit_mb)"
    ]


def test_growing_buffers_that_begin_beyond_the_limit_are_refused_at_start(new_logger):
    logger = new_logger(memory_limit_mb=10)
    logger.array("x", 1000, buffer=GROWING, size=10_000)
    with pytest.raises(
        SegmentError, match=r"begin with 8\d MB or more, the memory limit is 10 MB: raise memory_limit_mb"
    ):
        logger.start()


def test_when_even_time_stamps_find_no_room_the_logger_stops_by_itself(new_logger, monkeypatch):
    logger = new_logger(max_time=0, frequency=10)
    logger.array("x", (), np.int64, buffer=GROWING, size=1)
    logger.start()
    segment = logger._present.run.segment
    wait_until(lambda: len(segment._next) == 2)  # the thread has a chunk ready for each ring
    monkeypatch.setattr(segment, "_append", lambda ring: (_ for _ in ()).throw(SegmentError("full")))
    segment._next.clear()
    collect(logger, 100_000)
    assert not logger.is_running
    assert logger.stop_reason.startswith("stopped by itself: the folder of the buffers is full")
    recording = logger.snapshot()
    assert len(recording.time_ns) == recording.offset == logger.ticks
    assert recording.elements[0].count <= logger.ticks


def test_a_row_larger_than_a_chunk_has_a_chunk_of_its_own(new_logger, monkeypatch):
    monkeypatch.setattr(segment, "CHUNK_BYTES", 8192)
    logger = new_logger(max_time=0)
    x = logger.array("x", 1100, buffer=GROWING, size=1)  # 8800 bytes
    logger.start()
    for tick in range(5):
        x[:] = tick
        logger.collect()
    (element,) = logger.snapshot().elements
    for entry in element.entries:
        assert entry.values.tolist() == [0, 1, 2, 3, 4]


def test_a_chunk_is_a_megabyte_or_a_whole_row():
    assert segment.chunk_bytes_for(1000) == segment.chunk_bytes_for(131_072) == 1 << 20
    assert segment.chunk_bytes_for(140_000) >= 8 * 140_000


def test_no_thread_is_left_when_a_run_ends(new_logger):
    logger = new_logger(max_time=0)
    logger.array("x", buffer=GROWING)
    logger.start()
    (thread,) = [thread for thread in threading.enumerate() if thread.name == "silo-chunks"]
    logger.stop()
    thread.join(DEADLINE_S)
    assert not thread.is_alive()


# ------------------------------------------------------------------------------------------------------ the reader


def test_a_reader_sees_what_the_logger_was_made_with(new_logger, tmp_path):
    logger = new_logger("arm", frequency=50, max_time=3)
    logger.array("q", 3, unit="rad", description="joint angles", divider=2, size=7)
    logger.start()
    schema = reader_of(logger).schema
    assert (schema.logger, schema.pid, schema.frequency_hz, schema.folder) == ("arm", os.getpid(), 50, str(tmp_path))
    (element,) = schema.elements
    assert element.info == logger.elements[0]


def test_an_element_that_was_not_due_yet_has_no_samples(new_logger):
    logger = new_logger()
    logger.array("x", 3)
    logger.start()
    assert logger.snapshot().elements == []
    assert logger.read_new_values("x").values.shape == (0, 3)


def test_rows_may_be_read_a_few_at_a_time(new_logger):
    logger = new_logger()
    logger.array("x")
    logger.start()
    collect(logger, 10)
    reader = reader_of(logger)
    assert reader.rows(1, 2, limit=3).ticks.tolist() == [2, 3, 4]


@pytest.mark.parametrize("kind", [BufferType.FIXED, BufferType.GROWING])
def test_every_sample_of_a_published_element_passes_its_live_ring(new_logger, kind):
    logger = new_logger(max_time=0)
    x = logger.array("x", (), np.int64, action=Action.SAVE_AND_PUBLISH, buffer=kind, size=3)
    logger.array("other", buffer=GROWING)  # keeps the logger running
    logger.start()
    for tick in range(50):
        x[...] = tick
        logger.collect()
    reader = reader_of(logger)
    element = reader.schema.elements[0]
    assert reader.rows(element.live_ring, 0).column(element.live_entries[0]).tolist() == list(range(50))


# ------------------------------------------------------------------------------------ machines that reorder stores


@pytest.fixture
def weak_memory(monkeypatch):
    """As on ARM, where a row may become visible after its head."""
    monkeypatch.setattr(generated_code, "ORDERED_STORES", False)
    monkeypatch.setattr(segment_reader, "ORDERED_STORES", False)
    monkeypatch.setattr(segment_reader, "UNSAFE_ROWS", 2)


def test_a_reordering_machine_trusts_a_tick_when_the_next_one_is_logged_and_rare_elements_lag_one_alone(
    new_logger, weak_memory
):
    logger = new_logger()
    logger.array("x", divider=10)
    logger.start()
    for ticks, count in ((2, 1), (3, 1)):
        collect(logger, ticks)
        assert logger.snapshot().elements[0].count == count
    assert logger.snapshot().offset == 4


def test_on_a_reordering_machine_a_stopped_log_is_whole(new_logger, weak_memory):
    logger = new_logger(max_time=0)
    for divider in (1, 3, 7):
        for kind in BufferType:
            logger.array(f"x{divider}{kind.name}", divider=divider, buffer=kind, size=4)
    logger.start()
    collect(logger, 30)
    logger.stop()
    recording = logger.snapshot()
    assert recording.offset == 30
    assert [element.count for element in recording.elements] == [4, 4, 30, 4, 4, 10, 4, 4, 5]


def test_on_a_reordering_machine_the_last_row_of_a_dead_writer_counts(new_logger, weak_memory, monkeypatch):
    logger = new_logger()
    logger.array("x")
    logger.start()
    collect(logger, 5)
    monkeypatch.setattr(segment_reader, "process_start", lambda pid: 0)
    assert logger.snapshot().offset == 5


def test_the_control_words_of_a_ring_fit_its_line():
    assert max(RingControl) < 8
    assert TIME_RING == 0
    assert set(StopReason) == {0, 1, 2, 3, 4, 5, 6}


@pytest.mark.parametrize("storage", ["memory", "file"])
@pytest.mark.parametrize("failing", ["generate", "looked_at"])
def test_a_start_that_is_interrupted_leaves_no_segment_and_no_open_file(new_logger, monkeypatch, storage, failing):
    logger = new_logger(storage=storage)
    kept = logger.array("x", buffer="growing")
    logger.start()
    logger.stop()
    logger._present.run.segment._thread.join()  # it may be mapping a chunk
    gc.collect()
    before = open_segments(), logger._present.path
    with monkeypatch.context() as patch:
        patch.setattr(f"silo.loop.run.{failing}", interrupted)
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                logger.start()
    gc.collect()  # the frames of the last one hold its memory
    assert (open_segments(), logger._present.path) == before
    assert [str(path) for path in Path(logger._present.path).parent.glob("*.segment")] in ([logger._present.path], [])
    assert kept.shape == ()


def open_segments() -> list[str]:
    """The files of segments, whole or begun, that this process has open; what else it has is for others to count."""
    found = []
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            found.append(str(descriptor.readlink()))
    return sorted(path for path in found if SEGMENT_SUFFIX in path)


def interrupted(*_, **__):
    raise KeyboardInterrupt
