"""No run gets lost: known before its first tick, kept when the next can't begin, saved when its files are deleted."""

import contextlib
import gc
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import weakref
from pathlib import Path

import numpy as np
import psutil
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import State
from silo.core.runtime import list_held
from silo.errors import SegmentError, StateError
from silo.rpc.published import EventKind
from silo.segment.held_runs import bytes_of
from silo.state.handover import offer_run
from tests.waiting import freeze, wait_until

PROGRAM = """
import os, signal, sys
import numpy as np
import silo
log = silo.Logger("bot", frequency=1000, folder={folder!r}, script={folder!r} + "/none.yaml")
x = log.array("x", 3, np.int64)
serving = log.serve()
log.start()
for tick in range({ticks}):
    x[:] = tick
    log.collect()
{then}
"""


def run_program(folder: Path, ticks: int, then: str) -> subprocess.CompletedProcess[str]:
    code = PROGRAM.format(folder=str(folder), ticks=ticks, then=textwrap.dedent(then))
    with tempfile.TemporaryFile("w+") as told:  # no pipe, whose end comes when the helper process ends
        done = subprocess.run([sys.executable, "-c", code], stdout=told, stderr=told, check=False)
        told.seek(0)
        return subprocess.CompletedProcess(done.args, done.returncode, stderr=told.read())


def saved_values(folder: Path) -> list[int]:
    (path,) = folder.glob("*.silo")
    return silo.open_log(path)["/log/x_x"].values.tolist()


@pytest.fixture
def served(tmp_path):
    made = []

    def make(name="bot", **options):
        log = silo.Logger(name, frequency=1000, folder=tmp_path, script=tmp_path / "none.yaml", **options)
        made.append(log)
        return log

    yield make
    for log in made:
        log.close()


# ---------------------------------------------------------------------------------------- before the first tick


@pytest.mark.parametrize("ticks", [1, 20, 80])
def test_a_save_right_after_the_start_has_every_tick(tmp_path, ticks):
    for number in range(5):
        folder = tmp_path / str(number)
        done = run_program(folder, ticks, "log.save(); log.close()")
        assert done.returncode == 0, done.stderr
        assert saved_values(folder) == list(range(ticks))


@pytest.mark.parametrize("ticks", [1, 7])
@pytest.mark.parametrize("then", ["raise ValueError", "os.kill(os.getpid(), signal.SIGKILL)", "os._exit(3)"])
def test_a_program_that_ends_right_after_the_start_leaves_every_tick(tmp_path, until, ticks, then):
    run_program(tmp_path, ticks, then)
    until(lambda: list(tmp_path.glob("*.silo")))
    assert saved_values(tmp_path) == list(range(ticks))


IN_A_BLOCK = """
log.limit("/log/x", (None, None, 1e9, 2e9))
with log:
    raise ValueError
"""


def test_an_error_that_ends_a_block_is_told_as_such_and_nothing_is_said_to_be_missing(tmp_path, until):
    done = run_program(tmp_path, 7, IN_A_BLOCK)
    until(lambda: list(tmp_path.glob("*.silo")))
    told = [(event.kind, event.text) for event in silo.open_log(*tmp_path.glob("*.silo")).events]
    (crash,) = [text for kind, text in told if kind == "crashed"]
    assert crash.endswith(") ended by an error, or Ctrl-C")
    assert ("stopped", "stopped by an error, or Ctrl-C, that ended the program's `with`") in told
    assert "before its helper process was done" not in done.stderr


DYING = """
print(serving.helper_pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_who_reads_what_a_program_prints_waits_for_no_helper_process_that_outlives_it(tmp_path):
    code = PROGRAM.format(folder=str(tmp_path), ticks=7, then=DYING)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    with Client.connect("bot") as client:  # after its pipes ended
        assert client.status().state is State.DEAD
    assert psutil.pid_exists(int(done.stdout))
    assert "ended without close(); saved 7 samples" in done.stderr


FORKED = """
child = os.fork()
if child == 0:
    signal.pause()
print("forked", child, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_program_is_saved_while_a_child_that_it_forked_lives_on(tmp_path, until):
    child = int(run_program(tmp_path, 7, FORKED).stderr.partition("forked ")[2].split()[0])
    try:
        until(lambda: list(tmp_path.glob("*.silo")))
        assert psutil.pid_exists(child)
    finally:
        os.kill(child, signal.SIGKILL)
    assert saved_values(tmp_path) == list(range(7))


LEAVING = """
helper = serving.helper_pid
with serving:
    if os.fork() == 0:
        raise ValueError
    os.wait()
    log.save()
    print("the same" if serving.helper_pid == helper else "another")
log.close()
"""


def test_a_forked_child_that_leaves_what_serves_its_parent_ends_nothing(tmp_path):
    done = run_program(tmp_path, 7, LEAVING)
    assert done.stderr.rstrip().endswith("the same")
    assert saved_values(tmp_path) == list(range(7))


# ----------------------------------------------------------------------------------------- a start that fails


@pytest.fixture
def small_memory(tmp_path, monkeypatch):
    """A runtime folder of 12 MB."""
    folder = tmp_path / "shm"
    folder.mkdir(mode=0o700)
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=12m,mode=0700", "none", str(folder)], check=False, capture_output=True
    )
    if mounted.returncode:
        pytest.skip("needs the right to mount")
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(folder))
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize("with_helper", [False, True])
def test_a_restart_that_finds_no_room_keeps_the_recording(served, small_memory, with_helper):
    log = served()
    x = log.array("x", 100, size=4000)
    if with_helper:
        log.serve()
    log.start()
    x[:] = 7
    log.collect()
    log.stop()
    log.set("x", size=100_000)
    with pytest.raises(SegmentError, match="no room for"):
        log.start()
    assert log.has_unsaved
    assert log.snapshot().elements[0].entries[0].values.tolist() == [7]
    (file,) = log.save()
    assert silo.open_log(file.path)["/log/x_0"].values.tolist() == [7]


@pytest.mark.parametrize("with_helper", [False, True])
def test_where_two_runs_do_not_fit_the_old_one_is_saved_before_it_is_freed(
    served, small_memory, tmp_path, with_helper, caplog
):
    log = served()
    x = log.array("x", 100, size=8000)  # 6.5 MB
    if with_helper:
        log.serve()
    log.start()
    x[:] = 7
    log.collect()
    log.restart()
    assert (log.ticks, log.is_running) == (0, True)
    assert saved_at(tmp_path, "/log/x_0") == [7]
    assert "the last run was saved before it is cleared" in caplog.text


def saved_at(folder: Path, name: str) -> list[float]:
    (path,) = folder.glob("*.silo")
    return silo.open_log(path)[name].values.tolist()


def test_a_start_without_descriptors_keeps_the_recording(served):
    log = served()
    x = log.array("x")
    log.start()
    x[...] = 7
    log.collect()
    log.stop()
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
    try:
        with pytest.raises(SegmentError):
            log.start()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert log.has_unsaved
    assert log.snapshot().elements[0].entries[0].values.tolist() == [7]


# ------------------------------------------------------------------------------------- what becomes of the last run


def test_a_start_clears_saves_or_refuses_as_it_was_told(served, tmp_path):
    log = served()
    log.array("x")
    for unsaved in ("clear", "save", "refuse"):
        log.start()
        log.collect()
        log.stop()
        if unsaved == "refuse":
            with pytest.raises(StateError, match=r"holds 1 sample of 1 element.*and what is new of it is in no file"):
                log.start(unsaved=unsaved)
            assert log.has_unsaved
        else:
            log.start(unsaved=unsaved)
            log.stop()
        assert len(list(tmp_path.glob("*.silo"))) == (0 if unsaved == "clear" else 1)


def test_a_restart_that_is_refused_goes_on_logging(served):
    log = served()
    log.array("x")
    log.start()
    log.collect()
    with pytest.raises(StateError, match="in no file"):
        log.restart(unsaved="refuse")
    log.collect()
    assert (log.is_running, log.ticks) == (True, 2)


def test_a_save_by_a_client_counts_for_the_robot_program_too(served, until):
    log = served()
    log.array("x")
    log.serve()
    log.start()
    log.collect()
    with Client.connect("bot") as client:
        wait_until(lambda: client.status().ticks)
        client.save([silo.types.FileType.SILO])
        until(lambda: not log.has_unsaved)
    log.collect()
    assert log.has_unsaved


# --------------------------------------------------------------------------------------------- files deleted


def test_what_is_logged_is_saved_and_reachable_when_its_files_are_deleted(served, runtime_folder, tmp_path, until):
    log = served()
    x = log.array("x", (), np.int64)
    serving = log.serve()
    log.start()
    for tick in range(2000):
        x[...] = tick
        log.collect()
    first = serving.helper_pid
    with Client.connect("bot") as client:
        events = []
        client.on_event(events.append)
        shutil.rmtree(runtime_folder)
        until(lambda: any(event.kind is EventKind.FILES_DELETED for event in events))
    until(lambda: list(tmp_path.glob("*.silo")))
    assert saved_at(tmp_path, "/log/x") == list(range(2000))
    until(lambda: serving.helper_pid != first and serving.is_up)
    with Client.connect("bot") as client:
        assert client.status().ticks == 2000
    x[...] = 2000
    log.collect()
    (file,) = log.save()
    assert silo.open_log(file.path)["/log/x"].values.tolist() == list(range(2001))
    log.restart()
    assert Path(log._present.path).exists()


def test_a_save_without_helper_works_when_the_files_are_deleted(served, runtime_folder):
    log = served()
    x = log.array("x")
    log.start()
    x[...] = 3
    log.collect()
    shutil.rmtree(runtime_folder)
    (file,) = log.save()
    assert silo.open_log(file.path)["/log/x"].values.tolist() == [3]


# ------------------------------------------------------------------------------------- the helper process again


def test_a_helper_process_is_started_again_however_often_it_dies(served, until, monkeypatch):
    monkeypatch.setattr("silo.logger.serving.process.RESPAWN_DELAYS_S", (0.0,))
    log = served()
    log.array("x")
    serving = log.serve()
    for _ in range(8):
        pid = serving.helper_pid
        os.kill(pid, signal.SIGKILL)
        until(lambda pid=pid: serving.helper_pid != pid and serving.is_up)
    with Client.connect("bot") as client:
        assert client.status().logger == "bot"


def test_while_there_is_no_helper_process_the_program_saves_by_itself(served, until, monkeypatch, caplog):
    log = served()
    log.array("x")
    serving = log.serve()
    log.start()
    log.collect()
    monkeypatch.setattr("silo.core.child.sys.executable", "/bin/false")
    os.kill(serving.helper_pid, signal.SIGKILL)
    until(lambda: "no helper process:" in caplog.text)
    (file,) = log.save()
    assert silo.open_log(file.path)["/log/x"].values.tolist() == [0.0]
    monkeypatch.undo()
    until(lambda: "a helper process is there again" in caplog.text)


# -------------------------------------------------------------------------------------------- forgotten loggers


def has_words(pid):
    """Whether a process is there: one that ended has no command line, and no file once somebody asked how it ended."""
    try:
        return bool(Path(f"/proc/{pid}/cmdline").read_bytes())
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_forgotten_logger_ends_with_its_helper_process(tmp_path, until, helper_waits):
    helper_waits("silo.helper.dead_robot", WITHOUT_CLIENTS_S=0.2)
    log = silo.Logger("bot", frequency=1000, folder=tmp_path, script=tmp_path / "none.yaml")
    x = log.array("x")
    pid = log.serve().helper_pid
    log.start()
    x[...] = 5
    log.collect()
    gone = weakref.ref(log)
    del log, x
    # what collect() needs of its logger is a circle, and the link thread may hold it for a moment
    until(lambda: gc.collect() >= 0 and gone() is None)
    until(lambda: not has_words(pid))
    assert saved_at(tmp_path, "/log/x") == [5.0]


def test_one_that_is_forgotten_while_no_helper_process_can_be_started_ends_too(tmp_path, monkeypatch, until, caplog):
    log = silo.Logger("bot", folder=tmp_path, script=tmp_path / "none.yaml")
    serving = log.serve()

    def no(_):
        raise OSError("no memory")

    monkeypatch.setattr(type(serving), "_spawn", no)
    os.kill(serving.helper_pid, signal.SIGKILL)
    until(lambda: "no helper process: no memory" in caplog.text)
    gone = weakref.ref(log)
    del log
    until(lambda: gc.collect() >= 0 and gone() is None)
    until(lambda: not serving._thread.is_alive())


def test_a_second_logger_of_the_name_saves_and_closes_the_first(served, tmp_path, capfd):
    first = served()
    x = first.array("x")
    first.start()
    x[...] = 5
    first.collect()
    second = served()
    assert saved_at(tmp_path, "/log/x") == [5.0]
    assert "logger 'bot' was made a second time in this program" in capfd.readouterr().err
    second.array("x")
    second.start()
    with pytest.raises(StateError, match="is closed"):
        first.start()


def test_a_forked_child_says_once_that_it_logs_nothing(served, capfd):
    log = served()
    log.array("x")
    log.start()
    kept = log.collect
    child = os.fork()
    if child == 0:
        try:
            for _ in range(3):
                log.collect()
                kept()
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    error = capfd.readouterr().err
    assert error.count("does nothing in process") == 1
    assert "make a logger of its own there" in error


def test_what_a_forked_child_marks_and_sets_is_not_in_the_log_of_its_parent(served):
    log = served()
    log.array("x")
    gain = log.parameter("kp", 1.0)
    log.start()
    log.collect()
    mark = log.mark
    child = os.fork()
    if child == 0:
        try:
            mark("child")
            gain.value = 2.0
            log.parameters.set({"kp": 3.0})
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    mark("parent")
    log.collect()
    gain.value = 4.0
    log.collect()
    (file,) = log.save()
    run = silo.open_log(file.path)
    assert [event.text for event in run.events if event.kind == EventKind.MARKER.value] == ["parent"]
    assert [change.text for change in run.parameters.changes] == ["kp 1.0 -> 4.0 (program)"]


def test_a_forked_child_keeps_no_memory_of_its_parents_runs(served):
    log = served()
    log.array("x", 1000, buffer="looping")
    log.start()
    log.collect()
    path = log._present.path
    mine, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(theirs, b"held" if path in Path("/proc/self/maps").read_text() else b"free")
        os._exit(0)
    os.waitpid(child, 0)
    assert os.read(mine, 4) == b"free"
    os.close(mine)
    os.close(theirs)


def test_a_new_run_is_known_before_the_files_of_the_last_one_go(served, monkeypatch):
    log = served()
    log.array("x")
    log.serve()
    log.start()
    log.collect()
    last = Path(log._present.path)
    there = []

    def offering(channel, offer, descriptor):
        there.append(last.exists())
        return offer_run(channel, offer, descriptor)

    monkeypatch.setattr("silo.logger.serving.serving.offer_run", offering)
    log.restart()
    assert there == [True]
    assert not last.exists()


# --------------------------------------------------------------------------------- runs that somebody still has to read


def recorded_by_a_frozen_process(log, size: int) -> list[int]:
    """Begins with a recording that comes no further; returns its processes."""
    x = log.array("x", 100, buffer="looping", size=size)
    serving = log.serve()
    log.start()
    x[:] = 7
    log.collect()
    log.record()
    children = sorted(child.pid for child in psutil.Process(serving.helper_pid).children())
    for pid in children:
        freeze(pid)
    return children


def test_runs_that_are_held_keep_no_start_from_its_memory(helper_waits, served, small_memory):
    helper_waits("silo.helper.helper", SAVE_GRACE_S=1.0)  # for a recorder that has no room
    log = served()
    stopped = recorded_by_a_frozen_process(log, 2500)  # 2 MB
    try:
        for _ in range(6):
            log.collect()
            log.restart()
            assert log.is_running
        whole = [path for path in list_held() if bytes_of(path) > 1_000_000]
        assert len(whole) <= 1  # a quarter of 12 MB
        with contextlib.suppress(OSError), (small_memory / "of others").open("wb", buffering=0) as others:
            while True:
                others.write(bytes(50_000))
        log.collect()
        log.restart()  # finds no room, but what is held
        assert log.is_running
    finally:
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)
    (small_memory / "of others").unlink()
    told = log.stop_recording()
    assert " 0 lost" not in told or "and the end of" in told
