"""A helper process that is killed while it judges: its successor goes on, nothing is judged twice, nothing is lost."""

import os
import signal
import threading
import time
from pathlib import Path

import msgspec
import numpy as np
import psutil
import pytest

import silo
from silo.cli.main import run as silo_run
from silo.conditions.state_file import read_state, store_state
from silo.core.conditions import TriggerWord
from silo.core.runtime import boot_id, list_held, pid_namespace, process_start
from silo.errors import LogWarning
from silo.files.event_log import read_events
from silo.logger.serving import serving
from silo.logger.serving.process import HelperProcess
from silo.rpc.published import EventKind
from silo.segment.held_runs import Program, judge_path
from tests.ipc.conftest import no_process
from tests.waiting import answered, freeze, wait_until


def kill_helper(bench):
    """Kill the helper process and wait for the next one."""
    pid = bench.serving.helper_pid
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)


def judged(client, bench):
    """The triggers, as soon as all that was logged is judged."""

    def find():
        found = answered(client.triggers)
        return found if found is not None and found.tick >= bench.logger.ticks else None

    return {one.options.name: one for one in wait_until(find).triggers}


def spiked(bench, count, spikes):
    """Run the loop; `q_x` is 100 at the ticks of spikes."""
    for _ in range(count):
        bench.q[0] = 100.0 if bench.logger.ticks in spikes else 0.0
        bench.ticks(1)


def happened(bench, kind, run=None):
    """The events of a kind in the log: a client may still look for the next helper process when they are told."""
    found = [one for one in read_events(bench.logger.options.folder, "bot") if one.kind == kind.value]
    return [one for one in found if run in (None, one.run)]


def captured(bench):
    """The file of the only capture, as soon as it is written."""
    try:
        (event,) = wait_until(lambda: happened(bench, EventKind.CAPTURED))
    except AssertionError as error:
        told = read_events(bench.logger.options.folder, "bot")
        raise AssertionError("\n".join(f"{one.kind} at {one.tick}: {one.text}" for one in told)) from error
    return event.text.rpartition(": ")[2]


def test_each_spike_fires_and_is_captured_exactly_once(bench, client, tmp_path):
    kills = 3
    bench.logger.trigger("spike", "q_x > 50", pre="30ms", post="30ms")
    bench.logger.trigger("first", "mean(q_x, 50ms) > 10", mode="single")
    bench.logger.limit("q_x", (None, None, 10.0, 50.0))
    bench.logger.start()
    rng = np.random.default_rng(kills)
    each = 900 // (kills + 1)  # all of it stays in the rings, of 1000 rows, however late it is judged or written
    ticks = each * (kills + 1)
    spikes = set((np.arange(20, ticks - 20, 20) + rng.integers(0, 5, len(range(20, ticks - 20, 20)))).tolist())
    for _ in range(kills):
        at = int(rng.integers(1, each))
        spiked(bench, at, spikes)
        if rng.random() < 0.5:
            judged(client, bench)
        kill_helper(bench)
        spiked(bench, each - at, spikes)
    spiked(bench, each, spikes)
    found = judged(client, bench)
    assert found["spike"].fires == found["spike"].captures == len(spikes)
    assert (found["first"].fires, found["first"].state) == (1, TriggerWord.FIRED)
    run = client.triggers().run
    folder = tmp_path / "logs"
    wait_until(lambda: len(list(folder.glob("*_spike_*.silo"))) == len(spikes))
    wait_until(lambda: len(happened(bench, EventKind.CAPTURED, run)) == len(spikes) + 1)
    fired = [one.tick for one in happened(bench, EventKind.TRIGGERED, run) if "'spike'" in one.text]
    assert fired == sorted(spikes)
    assert len([one for one in happened(bench, EventKind.TRIGGERED, run) if "'first'" in one.text]) == 1
    assert happened(bench, EventKind.BLIND, run) == []
    logs = [silo.open_log(path) for path in folder.glob("*_spike_*.silo")]
    assert sorted(log.recording.conditions.capture.fires[0] for log in logs) == sorted(spikes)
    assert all(log["q_x"].values.tolist() == [0.0] * 3 + [100.0] + [0.0] * 3 for log in logs)
    assert wait_until(lambda: (now := answered(client.alarms)) and now.limits)[0].count == len(spikes)


@pytest.mark.parametrize("until_present", [False, True])
def test_cuts_while_there_was_no_helper_process_change_nothing_of_what_fires(bench, client, until_present):
    bench.logger.trigger("level", "x >= 0", save=(), edge="level", holdoff="100s")
    bench.logger.trigger("turn", "x > 35", save=())
    bench.logger.limit("x", (None, None, 10.0, 2000.0))
    bench.start(30)
    assert judged(client, bench)["level"].fires == 1
    freeze(bench.serving.helper_pid)
    for place in range(3):
        bench.ticks(6)
        bench.logger.set("x", size=900 + place, cut=True)
    kill_helper(bench)
    if until_present:
        bench.ticks(6)
    end = bench.logger._present.run.id, 6 if until_present else 0

    def find():
        found = answered(client.triggers)
        return found if found is not None and (found.run, found.tick) == end else None

    assert [(one.options.name, one.fires) for one in wait_until(find).triggers] == [("level", 1), ("turn", 1)]
    assert client.alarms().limits[0].count == 1


def test_what_somebody_has_seen_stays_seen(bench, client):
    bench.logger.limit("x", (None, None, 10.0, 20.0))
    bench.start(30)
    wait_until(lambda: client.alarms().limits and client.alarms().limits[0].alarm)
    client.acknowledge(who="ann")
    kill_helper(bench)
    found = wait_until(lambda: (now := answered(client.alarms)) and now.limits)[0]
    assert (found.alarm, found.seen_by, found.count) == (False, "ann", 1)


def test_a_capture_that_was_under_way_goes_on(bench, client, heard):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="1s")
    bench.start(60)
    heard.wait(EventKind.TRIGGERED)
    kill_helper(bench)
    bench.ticks(100)
    path = captured(bench)
    log = silo.open_log(path)
    assert log["x"].values.tolist() == list(range(46, 152))
    assert (log.warnings, log.recording.conditions.capture.number) == ((), 1)


def test_of_a_capture_under_way_that_the_rings_hold_no_more_there_is_a_file_that_says_so(bench, client, heard):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="15s")
    bench.start(60)
    heard.wait(EventKind.TRIGGERED)
    kill = bench.serving.helper_pid
    freeze(kill)
    bench.ticks(1200)
    os.kill(kill, signal.SIGCONT)
    kill_helper(bench)
    bench.ticks(600)
    path = captured(bench)
    with pytest.warns(LogWarning, match="were overwritten before they could be copied"):
        log = silo.open_log(path)
    assert log["x"].values[-1] == 50 + 1 + 1500


def test_rows_that_the_rings_hold_no_more_are_told_to_be_blindness(bench, client, heard):
    bench.logger.trigger("high", "q_x > 50")
    bench.logger.start()
    spiked(bench, 50, {10})
    heard.wait(EventKind.TRIGGERED)
    pid = bench.serving.helper_pid
    freeze(pid)
    spiked(bench, 2500, {100, 2500})
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    assert wait_until(lambda: judged(client, bench)["high"].fires == 2)
    run = client.triggers().run
    wait_until(lambda: len(happened(bench, EventKind.TRIGGERED, run)) == 2)
    assert [one.tick for one in happened(bench, EventKind.TRIGGERED, run)] == [10, 2500]
    wait_until(lambda: "were blind for" in "".join(one.text for one in happened(bench, EventKind.BLIND, run)))


def test_a_damaged_state_is_told_and_nothing_fires_anew(bench, client, heard):
    bench.logger.trigger("high", "x > 10")
    bench.start(50)
    heard.wait(EventKind.CAPTURED)
    pid = bench.serving.helper_pid
    freeze(pid)
    path = judge_path("bot", client.status and bench.logger._present.run.id)
    path.write_bytes(path.read_bytes()[:-5])
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    wait_until(lambda: (now := answered(client.triggers)) and now.tick >= bench.logger.ticks)
    wait_until(lambda: any("is damaged" in one.text for one in happened(bench, EventKind.BLIND)))
    assert client.triggers().triggers[0].fires == 0


def test_a_helper_process_that_gives_way_leaves_what_is_under_way_to_the_next(bench, client, heard):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="1s")
    bench.start(60)
    heard.wait(EventKind.TRIGGERED)
    pid = bench.serving.helper_pid
    Path(bench.serving.socket_path).unlink()  # nobody finds it any more: it ends, and the next one makes another
    wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != pid)
    bench.ticks(100)
    path = captured(bench)
    assert silo.open_log(path)["x"].values.tolist() == list(range(46, 152))


def test_a_capture_of_a_run_that_a_new_one_followed_is_written_by_the_next(bench, client, heard):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="1s")
    bench.start(60)
    heard.wait(EventKind.TRIGGERED)
    pid = bench.serving.helper_pid
    freeze(pid)
    bench.logger.restart(unsaved="clear")
    bench.x[...] = 0
    bench.ticks(10)
    os.kill(pid, signal.SIGKILL)
    path = captured(bench)
    with pytest.warns(LogWarning, match="91 ticks before its end"):
        assert silo.open_log(path)["x"].values.tolist() == list(range(46, 61))
    assert happened(bench, EventKind.BLIND) == []


def test_a_run_that_is_over_is_not_judged_anew_by_what_it_began_with(bench, client):
    bench.logger.trigger("spike", "q_x > 50", pre="30ms", post="0s")
    bench.logger.start()
    run = bench.logger._present.run.segment.schema.run
    spiked(bench, 20, {10})
    judged(client, bench)
    client.trigger("spike", "q_x > 50 and x > 35", pre="30ms", post="1s")
    spiked(bench, 20, {30, 38})
    judged(client, bench)
    bench.logger.restart(unsaved="clear")
    bench.ticks(1)
    # with that it is done with the run before: whose capture is written now, and whose rows are let go of after that
    wait_until(lambda: not judge_path("bot", run).exists() or not list_held())
    kill_helper(bench)
    judged(client, bench)
    wait_until(lambda: not list_held())
    assert [one.tick for one in happened(bench, EventKind.TRIGGERED, run)] == [10, 38]
    wait_until(lambda: not judge_path("bot", run).exists())


def test_a_capture_of_a_run_whose_memory_is_gone_is_told_to_be_lost(bench, runtime):
    bench.logger.trigger("high", "x > 50", pre="50ms", post="1s")
    bench.start(60)
    wait_until(lambda: happened(bench, EventKind.TRIGGERED))
    run, pid = bench.logger._present.run.id, bench.serving.helper_pid
    freeze(pid)
    bench.logger.restart(unsaved="clear")
    (held,) = runtime.glob("*.held")
    held.unlink()  # by somebody who makes room, say
    bench.x[...] = 0
    bench.ticks(10)
    os.kill(pid, signal.SIGKILL)
    lost = "capture 1 of 'high', ticks 45 to 150, is lost: the helper process died before"
    wait_until(lambda: any(lost in one.text for one in happened(bench, EventKind.BLIND, run)))
    blind = f"triggers and limits are blind for run {run} from tick"
    wait_until(lambda: any(one.text.startswith(blind) for one in happened(bench, EventKind.BLIND, run)))
    wait_until(lambda: not list(runtime.glob(f"*.{run}.judge")))


@pytest.fixture
def down(bench, client):
    """A logger with a trigger whose helper process was killed, and that gets no other before `up` is called."""
    bench.logger.trigger("high", "q_x > 50", pre="30ms", post="30ms")
    bench.start(5)
    wait_until(lambda: client.triggers().tick >= 5)
    with pytest.MonkeyPatch.context() as broken:
        broken.setattr(serving, "HelperProcess", no_process)
        bench.up = broken.undo
        os.kill(bench.serving.helper_pid, signal.SIGKILL)
        wait_until(lambda: not bench.serving.is_up)
        yield bench


def test_runs_that_ended_while_there_was_no_helper_process_are_judged_by_the_next(down, runtime):
    runs = [down.logger._present.run.id]
    spiked(down, 95, {40, 70})
    for _ in range(2):
        down.logger.restart(unsaved="clear")
        runs.append(down.logger._present.run.id)
        spiked(down, 60, {30})
    down.logger.restart(unsaved="clear")
    runs.append(down.logger._present.run.id)
    spiked(down, 10, {})
    down.up()
    for run, ticks in zip(runs, ([40, 70], [30], [30], []), strict=True):
        wait_until(lambda run=run: happened(down, EventKind.STARTED, run))
        wait_until(lambda run=run, ticks=ticks: len(happened(down, EventKind.CAPTURED, run)) == len(ticks))
        assert [one.tick for one in happened(down, EventKind.TRIGGERED, run)] == ticks
    assert happened(down, EventKind.BLIND) == []
    for event in happened(down, EventKind.CAPTURED):
        assert silo.open_log(event.text.rpartition(": ")[2])["q_x"].values.tolist() == [0.0] * 3 + [100.0] + [0.0] * 3
    wait_until(lambda: not list(runtime.glob("*.held")))
    # what is known of a run goes once its rows are gone
    wait_until(lambda: [path.name.split(".")[1] for path in runtime.glob("*.judge")] == runs[-1:])


def test_what_happened_before_a_logger_was_closed_without_its_helper_process_is_judged(down, runtime):
    run = down.logger._present.run.id
    spiked(down, 95, {40, 70})
    down.up()
    down.logger.close()
    assert [one.tick for one in happened(down, EventKind.TRIGGERED, run)] == [40, 70]
    assert len(happened(down, EventKind.CAPTURED, run)) == 2
    assert [path for path in runtime.iterdir() if path.suffix in (".judge", ".held", ".segment")] == []


def test_a_helper_process_that_is_killed_as_it_ends_has_nothing_told_twice(bench, client, monkeypatch, runtime):
    bench.logger.trigger("high", "q_x > 50", pre="30ms", post="30ms")
    bench.logger.start()
    run = bench.logger._present.run.id
    spiked(bench, 95, {40, 70})
    real, codes = HelperProcess.wait_out, []

    def wait_out(*arguments) -> int:
        codes.append(real(*arguments))
        return codes[-1] if len(codes) > 1 else -signal.SIGKILL  # it was done, and had yet to end

    monkeypatch.setattr(HelperProcess, "wait_out", wait_out)
    bench.logger.close()
    assert codes == [0, 0]
    assert [one.tick for one in happened(bench, EventKind.TRIGGERED, run)] == [40, 70]
    assert len(happened(bench, EventKind.CAPTURED, run)) == 2
    assert [path for path in runtime.iterdir() if path.suffix in (".judge", ".held", ".segment")] == []


def test_rows_of_such_a_run_that_are_gone_are_told_to_be_blindness(down):
    run = down.logger._present.run.id
    spiked(down, 2500, {100, 2490})
    down.logger.restart(unsaved="clear")
    down.up()
    wait_until(lambda: happened(down, EventKind.CAPTURED, run))
    assert [one.tick for one in happened(down, EventKind.TRIGGERED, run)] == [2490]
    (blind,) = happened(down, EventKind.BLIND, run)
    assert "triggers were blind for" in blind.text


def test_a_state_of_a_program_in_another_container_is_nobody_s_to_take_or_remove(bench, client, runtime):
    bench.logger.trigger("high", "x > 50")
    bench.start(60)
    path = judge_path("bot", bench.logger._present.run.id)
    wait_until(path.exists)
    # of a program whose pid is ours there, and its helper process is frozen
    theirs = Program("bot", "c0ffee", os.getpid(), process_start(os.getpid()), boot_id(), pid_namespace() + 1)
    other = msgspec.structs.replace(read_state(path), run="theirs", program=theirs)
    store_state(judge_path("bot", "theirs"), other)
    assert not other.is_orphan
    kill_helper(bench)
    wait_until(lambda: (now := answered(client.triggers)) and now.tick >= 60)
    assert not happened(bench, EventKind.BLIND)
    assert read_state(judge_path("bot", "theirs")) == other


@pytest.fixture
def short_grace(helper_waits) -> None:
    """Captures that are not written yet are waited for no longer than this at a close."""
    helper_waits("silo.helper.helper", CAPTURES_GRACE_S=1.0)


@pytest.mark.slow
def test_captures_that_are_not_written_when_the_logger_is_closed_are_written_by_recover(
    short_grace, bench, client, tmp_path, monkeypatch, runtime
):
    bench.logger.trigger("spike", "q_x > 50", save=("csv",))
    bench.logger.start()
    helper = psutil.Process(client.status().helper_pid)
    spiked(bench, 50, {10})
    (writer,) = wait_until(lambda: [one for one in helper.children() if "silo.recordings.writing" in one.cmdline()])
    freeze(writer.pid)
    spiked(bench, 100, {60, 70, 80, 100})
    closing = threading.Thread(target=bench.logger.close)
    begun_s = time.monotonic()
    closing.start()
    # longer than it waits at a close, and less than until the program ends it; nothing is lost whenever this comes
    wait_until(lambda: time.monotonic() > begun_s + 4 or not closing.is_alive())
    writer.resume()
    closing.join()
    monkeypatch.chdir(tmp_path)
    assert silo_run(["recover", "logs"]) == 0
    assert len(list((tmp_path / "logs").glob("*_spike_*.csv"))) == 5
    assert not list(runtime.glob("*.judge"))
    assert list_held() == []
