"""What the helper process holds in memory, and what it inherits."""

import ctypes
import itertools
import os
import subprocess
import sys
import weakref
from pathlib import Path

import msgspec
import numpy as np
import pytest

import silo
from silo.core.elements import FileType, Table
from silo.recordings.writing import WriteOrder
from silo.segment.reader import SegmentReader
from silo.state.replica import sharing

pytestmark = pytest.mark.slow

HEAP_BYTES = 64 * 2**20  # what glibc reserves, so aligned, for each arena but the first
glibc = pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="this system's malloc has no arenas")


@pytest.fixture
def warm() -> None:
    """The start that users have: what comes of it is looked at here."""


def further_arenas(pid: int) -> int:
    """Arenas of glibc's malloc in a process, its first one not counted."""
    spans = []
    for line in Path(f"/proc/{pid}/maps").read_text().splitlines():
        span, rights, *_ = line.split()
        spans.append((rights, *(int(address, 16) for address in span.split("-"))))
    # what an arena doesn't use yet follows it; the kernel aligns other large memory so too now and then
    return sum(
        (rights, rest) == ("rw-p", "---p") and not begin % HEAP_BYTES and (end, after) == (follows, begin + HEAP_BYTES)
        for (rights, begin, end), (rest, follows, after) in itertools.pairwise(spans)
    )


@glibc
def test_the_threads_of_a_helper_take_their_memory_from_two_arenas(bench, client, until):
    bench.start(20)
    until(lambda: client.status().ticks >= 20)  # it hears of a start a moment later
    with client.view(["/log/x"], ["/log/x"], rate_hz=10) as view:
        client.wait_saved(client.save([FileType.SILO]))
        client.history(["/log/x"], bench.begin_ns, bench.now_ns, bench.tick_ns)
        assert view is not None
        assert further_arenas(client.status().helper_pid) <= 1


def test_the_helper_takes_memory_from_an_allocator_that_gives_it_back(bench):
    environment = Path(f"/proc/{bench.serving.helper_pid}/environ").read_bytes().split(b"\0")
    assert b"PYTHONMALLOC=malloc" in environment


def test_all_readers_of_a_segment_hold_one_schema(bench):
    bench.logger.start()
    one, other = SegmentReader(bench.logger._present.path), SegmentReader(bench.logger._present.path)
    assert one.schema is other.schema


def test_the_schema_goes_with_its_last_reader(bench):
    bench.logger.start()
    reader = SegmentReader(bench.logger._present.path)
    schema = weakref.ref(reader.schema)
    reader.close()
    del reader
    assert schema() is None


def test_runs_with_other_options_have_other_schemas(bench):
    bench.logger.start()
    before = SegmentReader(bench.logger._present.path)
    bench.logger.stop()
    bench.logger.start()
    assert SegmentReader(bench.logger._present.path).schema.started_ns != before.schema.started_ns


def test_the_table_of_a_running_logger_is_made_of_the_rows_of_its_segment(bench):
    bench.logger.start()
    table = Table(
        3, msgspec.msgpack.decode(msgspec.msgpack.encode(bench.logger.elements), type=Table.__annotations__["elements"])
    )
    schema = SegmentReader(bench.logger._present.path).schema
    shared = sharing(table, schema)
    assert shared == table
    assert all(row is element.info for row, element in zip(shared.elements, schema.elements, strict=True))


def test_rows_that_were_edited_since_the_start_stay_the_tables_own(bench):
    bench.logger.start()
    schema = SegmentReader(bench.logger._present.path).schema
    first, *others = bench.logger.elements
    edited = msgspec.structs.replace(first, options=msgspec.structs.replace(first.options, divider=7))
    shared = sharing(Table(4, [edited, *others]), schema)
    assert shared.elements[0] is edited
    assert shared.elements[1:] == others


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 has no way to keep the present folder out")
def test_the_helper_takes_no_module_from_the_folder_where_the_robot_program_was_started(runtime, tmp_path):
    (tmp_path / "zenoh.py").write_text("raise ImportError('a module of the robot program')\n")
    program = tmp_path / "programs" / "robot.py"
    program.parent.mkdir()
    program.write_text(
        "import silo, sys\n"
        "log = silo.Logger('bot', folder=sys.argv[1])\n"
        "x = log.array('x')\n"
        "with log.serve() as serving:\n"
        "    print(serving.socket_path)\n"
        "log.close()\n"
    )
    environment = dict(os.environ, PYTHONPATH=str(Path(silo.__file__).parents[1]))
    command = [sys.executable, str(program), str(tmp_path)]
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.strip().endswith(".sock")


def test_a_writing_process_whose_helper_was_killed_leaves_no_file_and_says_nothing(new_logger, tmp_path):
    log = new_logger("test", frequency=100)
    kept = log.array("x", 2000, np.float64, size=500)
    log.start()
    for tick in range(500):
        kept[:] = tick
        log.collect()
    before = set(tmp_path.iterdir())
    with SegmentReader(log._present.path).path.open("rb") as segment:
        reading, writing = os.pipe()
        os.close(reading)
        command = [sys.executable, "-m", "silo.recordings.writing", str(segment.fileno())]
        order = msgspec.json.encode(WriteOrder(str(tmp_path), "test", [FileType.CSV], ""))
        run = subprocess.run(
            command,
            input=order,
            stdout=writing,
            stderr=subprocess.PIPE,
            pass_fds=[segment.fileno()],
            env=dict(os.environ, PYTHONPATH=str(Path(silo.__file__).parents[1])),
            check=False,
        )
        os.close(writing)
    assert (run.returncode, run.stderr) == (1, b"")
    assert not [path for path in set(tmp_path.iterdir()) - before if not path.name.endswith("fileNumber")]
