"""The event log: what happened, to whom it is told, and that it outlives helper and robot."""

import fcntl
import os
import signal
import subprocess
import sys
import time

import pytest

from silo.errors import GoesOnError, RefusedError
from silo.files.event_log import event_log_path, read_events
from silo.files.formats import read_recording
from silo.rpc.published import EventKind
from tests.ipc.conftest import end_helper
from tests.waiting import answered, wait_until

pytestmark = pytest.mark.slow


def kinds(events):
    return [event.kind for event in events]


def logged(client, kind):
    return wait_until(lambda: next((event for event in client.events() if event.kind == kind), None))


def test_what_happens_is_logged_with_tick_stamp_and_who(bench, client, heard):
    bench.start(5)
    client.stop()
    edit_names = [event.text for event in client.events() if event.kind == "edited"]
    heard.wait(EventKind.STOPPED)
    stopped = logged(client, "stopped")
    assert edit_names == []
    assert (stopped.tick, stopped.stamp_ns) == (4, bench.begin_ns + 4 * bench.tick_ns)
    assert "pytest" in stopped.who or "@" in stopped.who
    assert logged(client, "started").run == stopped.run != ""
    assert [event.number for event in client.events()] == list(range(1, len(client.events()) + 1))


def test_the_last_tick_of_a_run_that_a_restart_followed_is_logged(bench, client):
    bench.start(7)
    first = bench.logger._present.run.id
    bench.logger.restart()
    bench.ticks(3)
    wait_until(lambda: len([event for event in client.events() if event.kind == "started"]) == 2)
    stopped = logged(client, "stopped")
    assert (stopped.run, stopped.tick, stopped.stamp_ns) == (first, 6, bench.begin_ns + 6 * bench.tick_ns)
    kinds_and_runs = [(event.kind, event.run == first) for event in client.events()]
    assert kinds_and_runs.count(("stopped", True)) == 1
    assert ("stopped", False) not in kinds_and_runs


def test_a_mark_of_the_program_comes_to_the_log_and_to_clients(bench, client, heard):
    bench.start(3)
    bench.logger.mark("push 3")
    bench.ticks(2)
    told = heard.wait(EventKind.MARKER)
    assert (told.text, told.tick, told.stamp_ns) == ("push 3", 2, bench.begin_ns + 2 * bench.tick_ns)
    event = logged(client, "marker")
    assert (event.number, event.who, event.stamp_ns) == (told.logged, "bot", told.stamp_ns)


def test_a_mark_of_a_client_that_a_kill_would_still_lose_is_told_to_be_one(bench, client):
    bench.start(3)
    logged(client, "started")
    folder = bench.logger.options.folder
    with event_log_path(folder, "bot").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # as a disk that hangs
        with pytest.raises(GoesOnError, match="a kill of the helper process would lose it"):
            client.mark("slipped")
    wait_until(lambda: "slipped" in [event.text for event in read_events(folder, "bot")])


def test_marks_of_a_client_have_their_tick_and_author_and_events_are_asked_for_from_a_line_on(bench, client):
    bench.start(9)
    logged(client, "started")
    before = client.events()
    for text, tick in (("", None), ("  ", None), ("x", 9)):
        with pytest.raises(RefusedError, match="nothing was marked"):
            client.mark(text, tick)
        assert client.events() == before
    now, then = client.mark("slipped"), client.mark("before", tick=4)
    assert (now.tick, then.tick) == (8, 4)
    assert then.stamp_ns == bench.begin_ns + 4 * bench.tick_ns
    assert now.who == then.who
    assert "@" in now.who
    for number in range(5):
        client.mark(f"m{number}")
    since = client.events()[-3].number
    assert [event.text for event in client.events(since)] == ["m3", "m4"]
    assert [event.text for event in client.events(limit=1)] == ["m4"]
    assert client.events(limit=0) == []
    with pytest.raises(RefusedError, match="limit of events"):
        client.events(limit=-1)


def test_saved_files_have_what_happened_and_each_mark_once(bench, client):
    bench.start(5)
    bench.logger.mark("push 3")
    logged(client, "marker")
    client.mark("slipped", tick=1)
    for kind in ("silo", "csv", "bag"):
        (file,) = client.wait_saved(client.save([kind], name=f"walk_{kind}"))
        events = read_recording(file.path).events
        assert [(e.text, e.tick, e.who) for e in events if e.kind == "marker"] == [
            ("push 3", 4, "bot"),
            ("slipped", 1, client._name),
        ]
        assert events[0].kind == "started"


def test_marks_of_a_run_that_is_over_at_once_are_not_lost(bench, client):
    for number in range(5):
        bench.logger.restart()
        bench.ticks(1)
        bench.logger.mark(f"run {number}")
    texts = wait_until(lambda: [e.text for e in client.events() if e.kind == "marker"][4:] and client.events())
    assert [e.text for e in texts if e.kind == "marker"] == [f"run {number}" for number in range(5)]
    assert len({e.run for e in texts if e.kind == "marker"}) == 5


def test_the_log_outlives_a_helper_that_was_killed_and_no_mark_comes_twice(bench, client):
    bench.start(3)
    bench.logger.mark("push 3")
    before = logged(client, "marker")
    wait_until(lambda: any(e.kind == "marker" for e in read_events(bench.logger.options.folder, "bot")))
    old = bench.serving.helper_pid
    os.kill(old, signal.SIGKILL)
    bench.logger.mark("between")
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != old)

    def with_the_mark():
        told = answered(client.events) or []
        return told if any(event.text == "between" for event in told) else None

    texts = wait_until(with_the_mark)
    marks = [e for e in texts if e.kind == "marker"]
    assert [e.text for e in marks] == ["push 3", "between"]
    assert marks[0] == before
    assert [e.number for e in texts] == sorted({e.number for e in texts})


def test_that_a_helper_process_died_is_told_by_the_next_one_each_time(bench, client):
    bench.start(3)
    for times in (1, 2):
        before_ns = time.time_ns()
        old = bench.serving.helper_pid
        os.kill(old, signal.SIGKILL)
        wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != old)  # noqa: B023 - it waits here
        told = [event for event in wait_until(lambda: answered(client.events)) if event.kind == "helper"]
        assert len(told) == times
        text = "helper process died (exit code -9), and another one was started; logging went on"
        assert (told[-1].text, told[-1].run) == (text, bench.logger._present.run.id)
        assert before_ns < told[-1].time_ns < time.time_ns()


def test_a_run_that_stopped_by_itself_before_its_program_was_killed_is_told_to_have_stopped_once(runtime, tmp_path):
    program = """if True:
        import sys, time, silo
        log = silo.Logger("full", frequency=100, max_time=0.1, folder=sys.argv[1], script=sys.argv[1] + "/none.yaml")
        log.array("x", buffer="growing")
        serving = log.serve()
        log.start()
        print(serving.helper_pid, flush=True)
        sys.stdin.readline()
        while log.is_running:
            log.collect()
        sys.stdin.read()
    """
    started = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(started, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot:
        helper = int(robot.stdout.readline())
        wait_until(lambda: read_events(tmp_path, "full"))
        print("go on", file=robot.stdin, flush=True)
        (stopped,) = wait_until(lambda: [one for one in read_events(tmp_path, "full") if one.kind == "stopped"])
        assert "as not all buffers are looping" in stopped.text
        robot.terminate()
    wait_until(lambda: [one for one in read_events(tmp_path, "full") if one.kind == "recovered"])
    told = [event.kind for event in read_events(tmp_path, "full")]
    assert told == ["started", "stopped", "crashed", "recovered"]
    end_helper(helper)


def test_a_mark_right_before_a_kill_of_the_robot_is_in_log_and_file(robots, runtime, tmp_path):
    robots("bot", "", "fall").process.wait()
    folder = tmp_path / "logs"
    crashed = wait_until(lambda: [e for e in read_events(folder, "bot") if e.kind == "crashed"])
    marks = [e for e in read_events(folder, "bot") if e.kind == "marker"]
    assert [(e.text, e.tick) for e in marks] == [("it falls", 49)]
    assert marks[0].number < crashed[0].number
    (file,) = wait_until(lambda: list(folder.glob("*.silo")))
    kept = [e for e in read_recording(file).events if e.kind == "marker"]
    assert [(e.text, e.tick) for e in kept] == [("it falls", 49)]


def test_a_log_in_a_folder_that_cannot_be_written_is_still_answered_from_memory(bench, client, tmp_path):
    folder = tmp_path / "logs"
    event_log_path(folder, "bot").unlink(missing_ok=True)
    event_log_path(folder, "bot").mkdir(parents=True)
    bench.start(1)
    with pytest.raises(GoesOnError, match="the mark is noted"):
        client.mark("slipped")
    assert "slipped" in [event.text for event in client.events()]
    event_log_path(folder, "bot").rmdir()
    client.mark("again")
    written = wait_until(lambda: read_events(folder, "bot"))
    assert [e.text for e in written if e.kind == "marker"] == ["slipped", "again"]


def test_a_stop_right_before_the_end_is_told(bench) -> None:
    folder = bench.logger.options.folder
    bench.start(50)
    run = bench.logger._present.run.id
    bench.logger.stop()
    bench.logger.close(discard=True)
    told = wait_until(lambda: [one for one in read_events(folder, "bot", run) if one.kind == "stopped"])
    assert [one.tick for one in told] == [49]
