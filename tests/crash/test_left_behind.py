"""What dead programs left: swept if it surely is of the dead and holds nothing unsaved, recovered if it does."""

import fcntl
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import LoggerOptions
from silo.core.runtime import open_unfinished, sweep_unfinished, unopened
from silo.errors import SegmentError
from silo.files.atomic import atomic_file, atomic_folder, sweep_parts
from silo.helper.left_logs import recover
from silo.journal.folders import RECORDINGS, remember_folder
from silo.net import session as net_session
from silo.net.session import owner_is_gone, sweep
from silo.recovery.left import damage
from silo.recovery.runs import left_of
from silo.recovery.segments import left_segments, sweep_segments
from silo.rpc.published import EventKind
from silo.segment.layout import ControlWord
from silo.segment.reader import SegmentReader
from tests.waiting import freeze

ROOT = Path(__file__).resolve().parents[2]

NOBODY = 99_999_999  # more than Linux gives to any process

STARTING = """
import sys
import silo
from silo.segment.writer import Segment
fill = Segment._fill
def stop_within(self, *rest):
    fill(self, *rest)
    print("making", flush=True)
    sys.stdin.readline()
Segment._fill = stop_within
log = silo.Logger("arm", folder=sys.argv[1], script="none.yaml", storage=sys.argv[2])
x = log.array("x", 1000, size=100)
log.start()
log.collect()
print(log._present.path, flush=True)
sys.stdin.readline()
"""

SAVING = """
import sys
from silo.files.atomic import atomic_file, atomic_folder
with {what}(sys.argv[1] + "/log") as opened:
    {fill}
    print("writing", flush=True)
    sys.stdin.readline()
"""

DYING = """
import os, sys
import silo
clock = iter(range(0, 10**12, 10_000_000)).__next__
log = silo.Logger(sys.argv[2], folder=sys.argv[1], script="none.yaml", clock=clock)
x = log.array("x", size=int(sys.argv[4]))
log.start()
for i in range(int(sys.argv[3])):
    x[...] = i
    log.collect()
if len(sys.argv) > 5:
    log.save()
print(log._present.path, flush=True)
os.kill(os.getpid(), 9)
"""


def environment() -> dict[str, str]:
    return dict(os.environ, PYTHONPATH=str(ROOT))


@contextmanager
def program(text: str, *arguments: object, prefix: tuple[str, ...] = ()) -> Iterator[subprocess.Popen[str]]:
    """A Python program that printed its first line; killed at the end."""
    command = [*prefix, sys.executable, "-c", text, *map(str, arguments)]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True, env=environment()) as process:
        try:
            process.stdout.readline()
            yield process
        finally:
            process.kill()
            process.stdout.read()  # ends with its last child


def go_on(process: subprocess.Popen[str]) -> None:
    process.stdin.write("\n")
    process.stdin.flush()


def die(folder: Path, name: str = "arm", ticks: int = 5, size: int = 1_000, *options: str) -> Path:
    """A program that logged, and was killed; its segment."""
    command = [sys.executable, "-c", DYING, str(folder), name, str(ticks), str(size), *options]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(), check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return Path(done.stdout.split()[-1])


def unfinished(folder: Path) -> list[Path]:
    return list(folder.glob("*.new"))


# -------------------------------------------------------------------------------------------- unfinished segments


def by_ls(new_logger) -> None:
    run(["ls"])


def by_recover(new_logger) -> None:
    assert run(["recover"]) == 0


def by_start(new_logger, **options: str) -> None:
    logger = new_logger("other", **options)
    logger.array("x")
    logger.start()


@pytest.mark.parametrize("swept", [by_ls, by_recover, by_start])
def test_a_segment_that_a_killed_program_never_finished_is_swept(tmp_path, runtime, new_logger, swept):
    with program(STARTING, tmp_path, "memory"):
        assert len(unfinished(runtime)) == 1
    swept(new_logger)
    assert unfinished(runtime) == []


def test_an_unfinished_segment_on_disk_is_swept_by_the_next_start_there(tmp_path, new_logger):
    with program(STARTING, tmp_path, "file"):
        assert len(list(tmp_path.glob(".*.new"))) == 1
    by_start(new_logger, storage="file")
    assert list(tmp_path.glob(".*.new")) == []


def test_a_segment_that_is_being_made_is_not_swept(tmp_path, runtime):
    with program(STARTING, tmp_path, "memory") as starting:
        assert sweep_unfinished(runtime) == []
        go_on(starting)
        path = Path(starting.stdout.readline().strip())
        assert sweep_segments(tmp_path) == []
        with closing(SegmentReader(path)) as reader:
            assert reader.ticks == 1


@pytest.fixture
def elsewhere() -> tuple[str, ...]:
    """A command before a command that has it count processes by itself, as in a container."""
    prefix = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
    if (
        shutil.which("unshare") is None
        or subprocess.run([*prefix, "true"], check=False, capture_output=True).returncode
    ):
        pytest.skip("needs the right to make a namespace of processes")
    return prefix


def test_a_segment_that_is_being_made_in_another_container_is_not_swept(tmp_path, runtime, elsewhere):
    with program(STARTING, tmp_path, "memory", prefix=elsewhere):
        assert sweep_unfinished(runtime) == []
        assert len(unfinished(runtime)) == 1


def test_a_logger_in_another_container_is_not_taken_for_dead(tmp_path, elsewhere):
    with program(STARTING, tmp_path, "memory", prefix=elsewhere) as starting:
        go_on(starting)
        path = Path(starting.stdout.readline().strip())
        assert left_segments() == []
        assert sweep_segments() == []
        assert run(["recover", str(path)]) == EXIT_FAILED
        assert path.exists()


def test_a_logger_that_died_in_another_container_is_recovered(tmp_path, elsewhere):
    with program(STARTING, tmp_path, "memory", prefix=elsewhere) as starting:
        go_on(starting)
        starting.stdout.readline()
    (stale,) = left_segments()
    assert len(recover(stale.path).files) == 1


def test_a_recording_keeps_its_name_when_a_container_starts_again_with_the_same_pids(tmp_path, elsewhere):
    paths = []
    for _ in range(2):
        with program(STARTING, tmp_path, "memory", prefix=elsewhere) as starting:
            go_on(starting)
            paths.append(starting.stdout.readline().strip())
    assert len(set(paths)) == 2
    assert {str(stale.path) for stale in left_segments()} == set(paths)


SWEEPER = """
import sys
from pathlib import Path
from silo.recovery.segments import sweep_segments
from silo.files.atomic import sweep_parts
from silo.net import session as net_session
from silo.net.session import owner_is_gone, sweep
from silo.core.runtime import runtime_dir
print("sweeping", flush=True)
while True:
    {call}
"""


def test_sweeps_beside_starts_take_none_of_them(tmp_path, new_logger):
    call = "sweep_segments()"
    with program(SWEEPER.format(call=call)), program(SWEEPER.format(call=call)):
        for number in range(200):
            logger = new_logger(f"logger{number}")
            logger.array("x")
            logger.start()
            logger.collect()
            assert Path(logger._present.path).exists()
            logger.restart()
            assert Path(logger._present.path).exists()
            logger.close()


def test_many_opened_files_are_each_held_by_one(runtime):
    """The step that a sweep races with, by itself: it can't be lost between two calls."""
    with program(SWEEPER.format(call="sweep_segments()")):
        for number in range(2000):
            path = runtime / f".x.{number}.0.segment.new"
            with open_unfinished(path, unopened()) as file:
                assert os.path.samestat(os.fstat(file.fileno()), path.stat())
                path.unlink()


# --------------------------------------------------------------------------------------------------- saved files


@pytest.mark.parametrize(
    ("what", "fill"), [("atomic_file", "opened.write(b'x')"), ("atomic_folder", "(opened / 'a').write_text('x')")]
)
def test_what_a_killed_save_left_is_swept_and_a_save_that_goes_on_is_not(tmp_path, what, fill):
    text = SAVING.format(what=what, fill=fill)
    with program(text, tmp_path) as saving:
        (part,) = tmp_path.glob(".silo-*.part")
        assert sweep_parts(tmp_path) == []
        go_on(saving)
        saving.wait()
        assert (tmp_path / "log").exists()
    with program(text.replace("/log", "/other"), tmp_path):
        (part,) = tmp_path.glob(".silo-*.part")
    assert sweep_parts(tmp_path) == [part]
    assert [path.name for path in tmp_path.iterdir()] == ["log"]


def test_recover_sweeps_the_folder_of_the_logs(tmp_path, capsys):
    with program(SAVING.format(what="atomic_file", fill="pass"), tmp_path):
        pass
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert list(tmp_path.iterdir()) == []
    assert "was never finished, its process died; removed" in capsys.readouterr().err


@pytest.mark.parametrize("named", [True, False], ids=["named", "remembered"])
def test_recover_and_ls_sweep_the_folder_of_recordings(tmp_path, named, monkeypatch):
    recordings = tmp_path / "logs" / "recordings"
    recordings.mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    remember_folder(recordings, RECORDINGS)
    for line in (["recover", "--look-in", "logs"] if named else ["recover"], ["ls"]):
        with program(SAVING.format(what="atomic_file", fill="pass"), recordings):
            assert list(recordings.glob(".silo-*.part"))
        run(line)  # `ls` finds no logger, which is another story
        assert list(recordings.iterdir()) == []


def test_a_start_sweeps_what_a_killed_save_left(tmp_path, new_logger):
    with program(SAVING.format(what="atomic_folder", fill="pass"), tmp_path):
        pass
    by_start(new_logger)
    assert list(tmp_path.iterdir()) == []


def test_ls_sweeps_what_a_killed_save_left_in_the_folder_of_a_logger(tmp_path, robots):
    def left() -> list[str]:
        """Names beside the event log, which is there as soon as something happened."""
        return [path.name for path in (tmp_path / "logs").iterdir() if not path.name.endswith(".events.jsonl")]

    (tmp_path / "logs").mkdir()
    robots("bot")
    with program(SAVING.format(what="atomic_file", fill="pass"), tmp_path / "logs"):
        assert len(left()) == 1
    assert run(["ls"]) == 0
    assert left() == []


def test_sweeps_beside_saves_take_none_of_them(tmp_path):
    call = f"sweep_parts({str(tmp_path)!r})"
    with program(SWEEPER.format(call=call)), program(SWEEPER.format(call=call)):
        for number in range(300):
            with atomic_file(tmp_path / f"file{number}") as file:
                file.write(b"x")
            with atomic_folder(tmp_path / f"folder{number}") as folder:
                (folder / "a").write_text("x")
    assert len(list(tmp_path.iterdir())) == 600


# ------------------------------------------------------------------------------------------------------- sockets


def test_every_rest_of_a_dead_helper_is_swept(runtime):
    dead = runtime / "a.1.sock"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(dead))
    for path in (f"{dead}.lock", f"{dead}.dead", f"{dead}.secret", f"{dead}.users", f"{runtime}/b.2.sock.dead"):
        Path(path).touch()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(runtime / "c.3.sock"))  # its lock is gone already
    sweep(runtime)
    assert list(runtime.iterdir()) == []


def test_a_socket_in_use_is_not_swept_even_without_its_lock(runtime):
    locked = runtime / "a.1.sock"
    locked.touch()
    with Path(f"{locked}.lock").open("w") as lock, socket.socket(socket.AF_UNIX) as server:
        fcntl.flock(lock, fcntl.LOCK_EX)
        server.bind(str(runtime / "b.2.sock"))
        server.listen()
        assert sweep(runtime) == []
    assert len(list(runtime.iterdir())) == 3


def test_ls_sweeps_the_sockets_of_helpers_that_were_killed(robots, runtime, until):
    robot = robots("bot")
    freeze(robot.helper_pid)
    robot.kill()
    os.kill(robot.helper_pid, signal.SIGKILL)
    (path,) = runtime.glob("*.sock")
    until(lambda: owner_is_gone(path))  # a killed process holds its locks a moment longer
    run(["ls"])
    assert [path.name for path in runtime.iterdir() if ".sock" in path.name] == []


def test_a_server_can_not_start_at_the_socket_of_a_dead_one_while_it_is_swept(runtime, monkeypatch):
    refused = []

    def starts_meanwhile(path: Path) -> bool:
        with Path(f"{path}.lock").open("a") as lock:  # as Zenoh takes it
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                refused.append(path)
        return False

    monkeypatch.setattr(net_session, "_listens", starts_meanwhile)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(runtime / "bot.1.sock"))  # its lock is gone already
    assert sweep(runtime) == refused == [runtime / "bot.1.sock"]
    assert list(runtime.iterdir()) == []


def test_sweeps_beside_servers_that_start_take_none_of_their_sockets(runtime):
    from silo.net.session import close, open_server

    with program(SWEEPER.format(call="sweep(runtime_dir())")):
        for _ in range(30):
            session, path = open_server(runtime, "bot", 4711)
            assert path.exists()
            assert not owner_is_gone(path)
            close(session)


HOLDING = """
import fcntl, sys
with open(sys.argv[1], "w") as lock:
    fcntl.flock(lock, fcntl.LOCK_EX)
    print("held", flush=True)
    sys.stdin.readline()
"""


def test_a_server_whose_lock_was_swept_while_it_took_it_starts_again(runtime, monkeypatch):
    """The lock file that lies there is the one of another sweep, which is about to remove the socket."""
    from silo.net.session import close, open_server

    opens, sessions = net_session.zenoh.open, []

    def open_beside_a_sweep(settings):
        sessions.append(opens(settings))
        if len(sessions) == 1:
            lock = runtime / "bot.1.sock.lock"
            lock.unlink()
            begun.enter_context(program(HOLDING, lock))
        return sessions[-1]

    monkeypatch.setattr(net_session.zenoh, "open", open_beside_a_sweep)
    with ExitStack() as begun:
        session, path = open_server(runtime, "bot", 1)
        assert len(sessions) == 2
        assert path.exists()
    assert not owner_is_gone(path)
    close(session)


# ------------------------------------------------------------------------------------- segments of dead programs


@pytest.mark.parametrize("options", [(0, 10), (5, 10, "saved")])
def test_a_segment_without_an_unsaved_tick_is_swept_at_the_next_start(tmp_path, new_logger, options):
    path = die(tmp_path, "arm", *options)
    by_start(new_logger)
    assert not path.exists()


@pytest.mark.parametrize("sweeping", [by_ls, by_start])
def test_unsaved_ticks_are_never_swept(tmp_path, new_logger, sweeping):
    path = die(tmp_path)
    before = path.read_bytes()
    sweeping(new_logger)
    assert path.read_bytes() == before


def test_ticks_that_were_saved_before_are_not_saved_again(tmp_path, capsys):
    die(tmp_path, "arm", 5, 10, "saved")
    assert run(["recover"]) == 0
    assert "all its 5 ticks were saved before its process ended; its memory was freed" in capsys.readouterr().out
    assert len(list(tmp_path.glob("*.silo"))) == 1


def test_a_damaged_segment_keeps_no_other_from_being_saved(tmp_path, runtime, capsys):
    (runtime / f"a.{NOBODY}.0.segment").write_bytes(b"nonsense" * 2000)
    broken = die(tmp_path, "broken")
    data = bytearray(broken.read_bytes())
    data[4096:4100] = b"\xff\xfe\xff\xfe"
    broken.write_bytes(data)
    good = die(tmp_path, "good")
    assert run(["recover", "--list"]) == EXIT_FAILED
    listed = capsys.readouterr()
    assert f"{good}  logger 'good': 5 samples of 1 element over 0.04 s, of 5 ticks since start" in listed.out
    assert "is not a silo segment; it stays" in listed.err
    assert f"to free its memory: rm {broken}" in listed.err
    assert run(["recover"]) == EXIT_FAILED
    assert len(list(tmp_path.glob("good_*.silo"))) == 1
    assert "2 segments can't be read" in capsys.readouterr().err
    assert {path.name for path in runtime.glob("*.segment")} == {f"a.{NOBODY}.0.segment", broken.name}
    assert run(["ls"]) != 0  # no logger runs
    assert "2 recordings of programs that died" in capsys.readouterr().err


def test_a_pipe_among_the_segments_holds_nobody_up(runtime):
    os.mkfifo(runtime / "x.1.0.segment")
    (stale,) = left_segments()
    assert "is not a silo segment" in stale.reason


def test_four_recoveries_at_once_save_each_recording_once_and_none_of_them_fails(tmp_path):
    for number in range(4):
        die(tmp_path, f"arm{number}", 50_000, 50_000)
    command = [sys.executable, "-c", "import sys; from silo.cli.main import run; sys.exit(run(['recover']))"]
    recoveries = [subprocess.Popen(command, stdout=-1, stderr=-1, text=True, env=environment()) for _ in range(4)]
    told = [process.communicate() for process in recoveries]
    assert [process.returncode for process in recoveries] == [0] * 4, told
    assert "could not be recovered" not in "".join(out + err for out, err in told)
    assert len(list(tmp_path.glob("*.silo"))) == 4
    assert sum(out.count(".silo") for out, _ in told) == 4


def test_who_waited_for_a_segment_that_another_saved_is_told_so(tmp_path, capsys):
    from silo.recovery.segments import claimed, mark_saved

    path = die(tmp_path)
    with closing(SegmentReader(path)) as reader, claimed(reader):
        codes = []
        waiting = threading.Thread(target=lambda: codes.append(run(["recover"])))
        waiting.start()
        held = f":{path.stat().st_ino} "
        while not any("->" in line and held in line for line in Path("/proc/locks").read_text().splitlines()):
            assert waiting.is_alive()
        mark_saved(reader)
        path.unlink()
    waiting.join()
    assert codes == [0]
    assert "another process saved it meanwhile" in capsys.readouterr().out


def test_zeroed_rows_are_not_saved_as_values_without_a_word(tmp_path, capsys):
    path = die(tmp_path, "arm", 3000, 3000)
    with closing(SegmentReader(path)) as reader:
        ring = reader.schema.rings[reader.schema.elements[0].ring]
    data = np.fromfile(path, np.uint64)
    begin = ring.offset // 8 + 2500 * ring.row_words
    data[begin : begin + 463 * ring.row_words] = 0
    data.tofile(path)
    with closing(SegmentReader(path)) as reader:
        (text,) = damage(reader)
    assert text.startswith("463 of 3000 rows of /log/x are damaged, the first at tick 2500, the last at 2962")
    assert run(["recover"]) == 0
    assert "463 of 3000 rows of /log/x are damaged" in capsys.readouterr().out


def test_a_file_that_is_cut_while_it_is_read_is_a_segment_error(tmp_path):
    path = die(tmp_path, "arm", 5000, 5000)
    with closing(SegmentReader(path)) as reader:
        os.truncate(path, 8192)
        with pytest.raises(SegmentError, match="cut the segment short while it was in use, 8192 of"):
            reader.rows(1, 0)


# ---------------------------------------------------------------------------------------------- the predecessor


def test_a_start_without_a_helper_names_the_command_that_saves_its_predecessor(tmp_path, new_logger, caplog):
    path = die(tmp_path, "arm", 5000, 1000)
    logger = new_logger("arm")
    logger.array("x")
    logger.start()
    (record,) = caplog.records
    assert record.message == (
        "an earlier run of logger 'arm' ended without close(); it left 1 000 samples of 1 element over 9.99 s, of 5 000"
        f" ticks since start, in no file: `silo recover {path}` saves it, and frees its memory"
    )
    logger.restart()
    assert len(caplog.records) == 1


def test_a_logger_of_another_name_or_folder_is_no_predecessor(tmp_path, new_logger, caplog):
    die(tmp_path, "arm2")
    die(tmp_path / "elsewhere", "arm")
    logger = new_logger("arm")
    logger.array("x")
    logger.start()
    assert caplog.records == []


def test_what_died_just_now_is_no_predecessor_of_its_own_helper_process(tmp_path):
    path = die(tmp_path, "arm")
    with closing(SegmentReader(path)) as reader:
        schema = reader.schema
    own, another = (
        LoggerOptions(name="arm", folder=schema.folder, id=drawn) for drawn in (schema.logger_id, "another")
    )
    assert list(left_of(own)) == []
    assert [one.path for one in left_of(another)] == [path]


def test_the_helper_saves_the_predecessor_and_says_so(tmp_path, new_logger, until, capfd):
    path = die(tmp_path, "arm", 5000, 1000)
    logger = new_logger("arm")
    logger.array("x")
    with logger.serve():
        logger.start()
        until(lambda: not path.exists())
    (file,) = tmp_path.glob("*.silo")
    assert silo.open_log(file)["/log/x"].values.tolist() == list(range(4000, 5000))
    told = capfd.readouterr().err
    assert "ended without close(); saved 1 000 samples of 1 element over 9.99 s, of 5 000 ticks since start" in told
    assert str(file) in told


def test_clients_hear_of_a_recovered_predecessor(tmp_path, new_logger, until):
    path = die(tmp_path, "arm")
    with (tmp_path / ".arm_fileNumber").open("w") as counter:
        fcntl.flock(counter, fcntl.LOCK_EX)  # holds up the save until the client is there
        logger = new_logger("arm")
        logger.array("x")
        logger.serve()
        client = Client.connect("arm")
        events = []
        client.on_event(events.append)
        assert path.exists()
    recovered = until(lambda: next((event for event in events if event.kind is EventKind.RECOVERED), None))
    client.close()
    assert [file.path for file in recovered.files] == [str(file) for file in tmp_path.glob("*.silo")]


def test_a_predecessor_that_somebody_saves_already_is_left_to_them(tmp_path, new_logger, capfd):
    path = die(tmp_path, "arm")
    with closing(SegmentReader(path)) as reader:
        fcntl.flock(reader.fileno(), fcntl.LOCK_EX)
        logger = new_logger("arm")
        logger.array("x")
        with logger.serve():
            logger.start()
    assert path.exists()
    assert "could not be saved" not in capfd.readouterr().err


def test_a_crash_tells_samples_and_seconds_not_ticks(robots, until):
    robot = robots("bot")
    client = Client.connect("bot")
    events = []
    client.on_event(events.append)
    until(lambda: client.status().ticks > 100)
    robot.kill()
    crashed = until(lambda: next((event for event in events if event.kind is EventKind.CRASHED), None))
    client.close()
    assert " samples of 2 elements over " in crashed.text
    assert "ticks since start" in crashed.text


def test_without_room_start_says_what_recordings_of_the_dead_hold(tmp_path, new_logger, monkeypatch):
    die(tmp_path, "other")
    monkeypatch.setattr("silo.segment.writer.available_memory_bytes", lambda: 1000)
    logger = new_logger("arm")
    logger.array("x")
    with pytest.raises(SegmentError, match=r"a recording of programs that died hold .* run `silo recover`"):
        logger.start()


def test_a_control_word_of_another_meaning_is_not_touched_by_the_mark(tmp_path):
    from silo.recovery.segments import mark_saved

    path = die(tmp_path)
    with closing(SegmentReader(path)) as reader:
        before = path.read_bytes()
        mark_saved(reader)
        after = path.read_bytes()
        place = reader.control_offset(ControlWord.SAVED_TICKS)
    assert [n for n in range(len(before)) if before[n] != after[n]] == [place]
    assert after[place] == 5
    assert ControlWord.SAVED_TICKS == 3


def test_a_segment_in_a_log_folder_is_found_by_commands_that_do_not_know_the_folder(
    tmp_path, runtime_folder, monkeypatch
):
    with program(STARTING, tmp_path / "logs", "file") as process:
        go_on(process)
        assert process.stdout.readline()  # it logged a tick
    monkeypatch.chdir(tmp_path)
    (stale,) = left_segments()
    assert stale.path.parent == tmp_path / "logs"
    assert run(["recover"]) == 0
    assert len(list((tmp_path / "logs").glob("*.silo"))) == 1
    assert list(runtime_folder.iterdir()) == []
