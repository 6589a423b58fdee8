"""Endless recordings across deaths and new starts: every tick is in a file, or is told as lost where it is missing."""

import contextlib
import fcntl
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import AbstractContextManager
from pathlib import Path

import psutil
import pytest

from silo.analysis.opening import open_log
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import RecorderState
from silo.core.runtime import list_held, list_segments, process_start, runtime_dir
from silo.files.event_log import read_events
from silo.files.manifest import read_written
from silo.recorder.process import stored
from silo.segment.held_runs import recorders_path
from tests.ipc.conftest import end_helper
from tests.stand_ins.ticking import turning
from tests.waiting import answered, freeze, wait_until
from tests.whole_bags import read_bag

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("cold_children")]


def recorders_of(helper_pid: int) -> list[psutil.Process]:
    """Recorders, and the one that is kept for the case that one dies."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return [one for one in psutil.Process(helper_pid).children() if "silo.recorder" in one.cmdline()]
    return []


def begin(bench, client: Client) -> Path:
    bench.logger.set(buffer="looping", size=5000)
    bench.logger.start()
    folder = Path(client.record(["x"], to="walks").folder)
    wait_until(lambda: client.recorders()[0].state is RecorderState.RECORDING)
    return folder


def freeze_recorders(client: Client) -> None:
    """From now on nothing is recorded."""
    for one in recorders_of(client.status().helper_pid):
        freeze(one.pid)


def kill_recorders(pid: int) -> None:
    for one in recorders_of(pid):
        with contextlib.suppress(psutil.NoSuchProcess):  # a frozen spare that its helper process has just ended
            one.kill()


def values_of(folder: Path) -> list[int]:
    """All values of x, which counts the ticks of all runs, as the parts have them one after the other."""
    found = []
    for path in sorted(folder.glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2]):
        for element in read_bag(path).elements:
            assert element.lost == 0
            found += element.entries[0].values.astype(int).tolist()
    return found


def test_runs_that_follow_one_another_after_the_recorder_died_are_recorded_whole(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    freeze_recorders(client)
    for ticks in (200, 100, 50):
        bench.ticks(ticks)
        bench.logger.restart()
    bench.ticks(70)
    wait_until(lambda: client.status().held_runs == 3)
    kill_recorders(client.status().helper_pid)
    wait_until(lambda: not client.status().held_runs)
    assert "720 samples, 0 lost" in client.stop_recorder()
    assert values_of(folder) == list(range(1, 721))
    assert list_held() == []


def test_runs_that_no_helper_process_saw_are_recorded_whole_and_told(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    freeze_recorders(client)
    pid = client.status().helper_pid
    recorders = recorders_of(pid)
    freeze(pid)  # it takes nothing in any more
    bench.ticks(40)
    for _ in range(2):
        bench.logger.restart()
        bench.ticks(30)
    for one in recorders:
        one.kill()
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    wait_until(lambda: not list_held())
    bench.ticks(10)
    assert "0 lost" in client.stop_recorder()
    assert values_of(folder) == list(range(1, 411))
    runs = {event.run for event in client.events() if event.kind == "started"}
    assert len(runs - {""}) >= 2


def test_a_recorder_that_was_frozen_and_lost_its_helper_process_is_ended_by_its_successor(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    pid = client.status().helper_pid
    (frozen,) = (one for one in recorders_of(pid) if one.pid == client.recorders()[0].pid)
    freeze(frozen.pid)
    bench.ticks(100)
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    wait_until(lambda: answered(lambda: client.recorders()[0].state) is RecorderState.RECORDING)
    assert not process_start(frozen.pid)
    bench.ticks(50)
    assert "450 samples, 0 lost" in client.stop_recorder()
    assert values_of(folder) == list(range(1, 451))


def test_a_spare_recorder_that_is_frozen_ends_with_its_helper_process(bench, client) -> None:
    begin(bench, client)
    pid, recording = client.status().helper_pid, client.recorders()[0].pid
    (spare,) = wait_until(lambda: [one.pid for one in recorders_of(pid) if one.pid != recording])
    wait_until(lambda: Path(f"/proc/{spare}/wchan").read_text().startswith("__skb_wait"))  # it waits for an order
    freeze(spare)
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: not process_start(spare))


def test_a_recorder_that_had_not_begun_when_its_helper_process_was_killed_touches_nothing(bench, client) -> None:
    bench.logger.set(buffer="looping", size=5000)
    bench.start(50)
    folder = Path(bench.logger.options.folder) / "walks"
    folder.mkdir(parents=True)
    pid = client.status().helper_pid
    with (folder / ".bot.recorder.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        asking = threading.Thread(target=answered, args=[lambda: client.record(["x"], to="walks")])
        asking.start()
        late = wait_until(lambda: [one.pid for one in recorders_of(pid)])[0]
        wait_until(lambda: "walks" in " ".join(file.path for file in psutil.Process(late).open_files()))
        freeze(late)
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    bench.ticks(50)
    bench.logger.close(discard=True)
    asking.join()
    written, parts = read_written(folder, "bot"), values_of(folder)
    assert parts[-50:] == list(range(51, 101))
    os.kill(late, signal.SIGCONT)
    wait_until(lambda: not process_start(late))
    assert (read_written(folder, "bot"), values_of(folder)) == (written, parts)


def test_a_recording_that_fails_after_its_run_is_over_is_told_of_that_run(bench, client) -> None:
    begin(bench, client)
    bench.ticks(300)
    (run,) = {event.run for event in client.events() if event.kind == "started"}
    pid = client.recorders()[0].pid
    freeze(pid)
    bench.ticks(200)
    bench.logger.restart()
    bench.ticks(10)
    wait_until(lambda: sum(event.kind == "started" for event in client.events()) == 2)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, 0))  # as a full disk: it can't write any more
    os.kill(pid, signal.SIGCONT)
    (failed,) = wait_until(lambda: [one for one in client.events() if one.kind == "recording failed"])
    assert (failed.run, 0 <= failed.tick <= 500) == (run, True)


def test_what_is_recorded_when_it_is_ended_while_its_recorder_is_replaced_is_all(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(400)
    freeze_recorders(client)
    bench.ticks(600)
    kill_recorders(client.status().helper_pid)
    assert "1 000 samples, 0 lost" in bench.logger.stop_recording()
    assert values_of(folder) == list(range(1, 1001))


def test_a_logger_that_is_closed_while_its_helper_process_is_down_is_recorded_to_its_end(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(400)
    freeze_recorders(client)
    bench.ticks(100)
    pid = client.status().helper_pid
    freeze(pid)  # else it may start another recorder before it is killed, too
    kill_recorders(pid)
    os.kill(pid, signal.SIGKILL)
    bench.logger.close()
    assert values_of(folder) == list(range(1, 501))
    assert list_held() == []
    assert not recorders_path("bot", bench.logger.options.id).exists()


def killed_each_time(helper_pid: int) -> AbstractContextManager[None]:
    """No recorder of this helper process comes to anything."""

    def kill() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            kill_recorders(helper_pid)

    return turning(kill, 0.01)


def test_what_a_recorder_lacks_that_dies_each_time_it_is_to_end_is_completed_later(
    bench, client, monkeypatch, tmp_path, capsys
) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    freeze_recorders(client)
    bench.ticks(200)
    with killed_each_time(client.status().helper_pid):
        client.stop_recorder()
        ends = "each time it was to end"
        (told,) = wait_until(lambda: [event.text for event in client.events() if ends in event.text])
    assert "`silo recover`" in told
    bench.logger.restart()  # nobody records this one
    bench.ticks(100)
    wait_until(lambda: client.status().held_runs == 1)
    assert "is over" in client.stop_recorder()
    bench.logger.close()
    monkeypatch.chdir(tmp_path)
    assert run(["recover"]) == 0
    assert "500 samples, 0 lost" in capsys.readouterr().out
    assert values_of(folder) == list(range(1, 501))
    assert list_held() == []


def test_what_a_recorder_lacks_that_was_given_up_is_told_when_its_name_goes_to_another_one(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    freeze_recorders(client)
    bench.ticks(200)
    with killed_each_time(client.status().helper_pid):
        client.stop_recorder()
        wait_until(lambda: any("each time it was to end" in event.text for event in client.events()))
    client.record(["x"], to="walks", name="bot")
    bench.ticks(50)
    assert "50 samples, 0 lost" in client.stop_recorder()
    assert values_of(folder)[-50:] == list(range(501, 551))
    assert any("still in memory of it is lost" in event.text for event in client.events())


def test_what_did_not_fit_is_a_gap_in_the_file_in_the_totals_and_in_the_events(bench, client, monkeypatch) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    freeze_recorders(client)
    bench.ticks(200)
    monkeypatch.setattr("silo.segment.held_runs.HELD_RUNS", 1)
    for _ in range(3):
        bench.logger.restart()
        bench.ticks(100)
    pid = client.status().helper_pid
    recorders = recorders_of(pid)
    freeze(pid)
    bench.logger.restart()  # the second one that is held and too many
    for one in recorders:
        one.kill()
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid and not list_held())
    text = client.stop_recorder()
    written = read_written(folder, "bot")
    assert written is not None
    sums = written.sums()
    assert (sums.samples + sums.lost, sums.gone) == (800, 0), [(one.number, one.gone, one.done) for one in written.runs]
    assert sums.lost >= 200
    assert f"{sums.samples} samples, {sums.lost} lost" in text
    lost = sum(element.lost for path in folder.glob("*.mcap") for element in read_bag(path).elements)
    told = [event.text for event in client.events() if "their memory was needed" in event.text]
    assert told
    assert lost or any("in no file" in event.text for path in folder.glob("*.mcap") for event in read_bag(path).events)


# --------------------------------------------------------------------------------------- the program dies, too


def began(robots, **options: object):
    """A robot program of its own that is recorded, with its client closed, and where to."""
    robot = robots("bot", **options)
    with Client.connect("bot") as client:
        folder = Path(client.record(to="walks").folder)
        wait_until(lambda: client.recorders()[0].samples)
    return robot, folder


def all_of(robot) -> list[int]:
    return [robot.pid, robot.helper_pid, *(one.pid for one in recorders_of(robot.helper_pid))]


def recorded(folder: Path, name: str = "/log/x") -> list[int]:
    """The ticks of an element, part by part."""
    found = []
    for path in sorted(folder.glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2]):
        part = read_bag(path)
        for element in part.elements:
            if element.name == name:
                assert element.lost == 0
                found += (part.offset - len(part.time_ns) + element.stamp_indices).tolist()
    return found


def logged(folder: Path) -> int:
    """Ticks of the log that was saved of the program."""
    (log,) = folder.glob("*.silo")
    return open_log(log).recording.offset


def check_whole(folder: Path, tmp_path: Path) -> None:
    """From its first tick on the recording has all that were logged, each once."""
    found = recorded(folder)
    assert found == list(range(found[0], logged(tmp_path / "logs")))


def happened(folder: Path) -> list[str]:
    return [event.kind for path in sorted(folder.glob("*.mcap")) for event in read_bag(path).events]


@pytest.mark.parametrize("frozen", [False, True])
def test_what_is_recorded_of_a_program_that_died_after_helper_and_recorder_is_completed_by_recover(
    robots, tmp_path, monkeypatch, capsys, frozen
) -> None:
    robot, folder = began(robots)
    with Client.connect("bot") as client:
        recording = client.recorders()[0].pid
    program, helper, *recorders = all_of(robot)
    for pid in [*recorders, helper]:
        freeze(pid)
    ticks_s = time.monotonic()
    wait_until(lambda: time.monotonic() > ticks_s + 0.3)  # the program goes on by itself
    for pid in [*recorders, program, helper]:
        if not frozen or pid != recording:  # it stays as it is, and nobody is left who would have it go on
            os.kill(pid, signal.SIGKILL)
    robot.process.wait()
    monkeypatch.chdir(tmp_path)
    assert run(["recover", "--list"]) == 0
    assert f"recording 'bot' in {folder} is not complete" in capsys.readouterr().out
    assert run(["recover"]) == 0
    assert "completed" in capsys.readouterr().out
    assert not process_start(recording)
    check_whole(folder, tmp_path)
    assert happened(folder).count("crashed") == 1
    assert list_held() == list_segments() == []
    assert list(runtime_dir().glob("*.recorders")) == []
    assert run(["recover"]) == 0
    assert "nothing to recover" in capsys.readouterr().out


def test_the_next_start_of_the_program_completes_its_recordings(robots, tmp_path) -> None:
    robot, folder = began(robots)
    program, helper, *recorders = all_of(robot)
    for pid in [*recorders, helper]:
        freeze(pid)
    for pid in [*recorders, program, helper]:
        os.kill(pid, signal.SIGKILL)
    robot.process.wait()
    robots("bot")
    wait_until(lambda: list((tmp_path / "logs").glob("*.silo")))
    wait_until(lambda: len(list_segments()) == 1)
    assert list(runtime_dir().glob("*.recorders")) == []
    check_whole(folder, tmp_path)


def test_a_recorder_that_died_right_before_its_program_is_followed_by_another_one(robots, tmp_path) -> None:
    robot, folder = began(robots)
    program, _, *recorders = all_of(robot)
    for pid in [*recorders, program]:
        os.kill(pid, signal.SIGKILL)
    robot.process.wait()
    wait_until(lambda: list((tmp_path / "logs").glob("*.silo")))
    wait_until(lambda: not list(runtime_dir().glob("*.recorders")) and not list_held())
    check_whole(folder, tmp_path)
    assert happened(folder).count("crashed") == 1


def test_that_a_program_ended_is_in_its_last_part_while_its_process_is_still_there(bench, client) -> None:
    folder = begin(bench, client)
    bench.ticks(300)
    bench.serving.end(bench.logger._present.leave)  # its link ends, as that of a dying one first
    wait_until(lambda: list(folder.glob("*.mcap")))
    assert values_of(folder) == list(range(1, 301))
    assert happened(folder).count("crashed") == 1


def test_a_helper_process_of_another_container_leaves_the_recordings_of_this_one_alone(robots, tmp_path) -> None:
    began(robots)
    lists = list(runtime_dir().glob("*.recorders"))
    inside = ["unshare", "--pid", "--fork", "--mount-proc", "--kill-child"]
    if subprocess.run([*inside, "true"], check=False, capture_output=True).returncode:
        pytest.skip("needs the right to make a container")
    program = (
        "import sys, silo; log = silo.Logger('other', folder=sys.argv[1]); log.array('x'); log.serve(); log.close()"
    )
    recover = "from silo.cli.main import run; run(['recover'])"
    subprocess.run([*inside, sys.executable, "-c", program, str(tmp_path)], check=True)
    subprocess.run([*inside, sys.executable, "-c", recover], check=True, cwd=tmp_path)
    assert list(runtime_dir().glob("*.recorders")) == lists != []
    with Client.connect("bot") as client:
        assert client.recorders()[0].state is RecorderState.RECORDING
        assert "0 lost" in client.stop_recorder()


def left_by(robot, folder: Path) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """What the event log says of the run of a dead program but for figures, and the files, with why they were saved."""
    said = [one for one in read_events(folder, "bot") if str(robot.pid) in one.text and one.kind == "crashed"]
    assert len({one.run for one in said}) == 1
    lines = [
        (one.kind, re.sub(r"[\d.:_-]+(?: \d+)*", "#", one.text)) for one in read_events(folder, "bot", said[0].run)
    ]
    files = [(re.sub(r"\d", "#", path.name), open_log(path).recording.why) for path in folder.rglob("*.silo")]
    return lines, files + [(re.sub(r"\d", "#", path.name), "") for path in sorted(folder.rglob("*.mcap*"))]


@pytest.mark.parametrize("by", ["the next program", "recover"])
def test_whoever_cleans_up_after_a_killed_program_leaves_the_same_event_log_and_files(by, robots, tmp_path) -> None:
    folder = tmp_path / "logs"
    robot, parts = began(robots)
    robot.kill()
    wait_until(lambda: list(folder.glob("*.silo")) and not list_segments())
    # each is told a moment after it is done
    wait_until(lambda: any("ended: " in one.text for one in read_events(folder, "bot")))
    wait_until(lambda: any(one.kind == "recovered" for one in read_events(folder, "bot")))
    by_helper = left_by(robot, folder)
    end_helper(robot.helper_pid)
    shutil.rmtree(folder)
    robot, parts = began(robots)
    wait_until(lambda: any(one.kind == "recording" for one in read_events(folder, "bot")))
    freeze(robot.helper_pid)
    robot.kill()
    os.kill(robot.helper_pid, signal.SIGKILL)
    wait_until(lambda: list(parts.glob("*.mcap")))  # its recorder finishes by itself
    assert happened(parts)[-1] == "crashed"
    by_recorder = [line for line in left_by(robot, folder)[0] if line[0] == "crashed"]
    assert by_recorder == [line for line in by_helper[0] if line[0] == "crashed"]
    if by == "recover":
        assert run(["recover", "--look-in", str(folder)]) == 0
    else:
        robots("bot")
        wait_until(lambda: list(folder.glob("*.silo")) and len(list_segments()) == 1)
    wait_until(lambda: len(left_by(robot, folder)[0]) >= len(by_helper[0]))
    left = left_by(robot, folder)
    assert (Counter(left[0]), left[1]) == (Counter(by_helper[0]), by_helper[1])


@pytest.mark.parametrize("damage", ["turned", "cut", "empty"])
def test_a_list_of_recordings_that_is_damaged_is_told_and_one_begins_anew(
    bench, client, runtime_folder, damage
) -> None:
    begin(bench, client)
    path = recorders_path("bot", bench.logger.options.id)
    pid = client.status().helper_pid
    freeze(pid)
    data = path.read_bytes()
    turned = data.replace(b'"split_s"', b'"spliT_s"')
    assert turned != data
    path.write_bytes({"turned": turned, "cut": data[:-20], "empty": b""}[damage])
    kill_recorders(pid)
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    words = "what was being recorded can't be read"
    wait_until(lambda: [event for event in answered(client.events) or () if words in event.text])
    client.record(["x"], to="again")
    wait_until(lambda: client.recorders()[0].state is RecorderState.RECORDING)
    assert len(stored(path)) == 1
    client.stop_recorder()
