"""What a client's start does with data that is in no file, what takes long, and what is too large."""

import contextlib
import os
import re
import signal
import threading
from pathlib import Path

import pytest

import silo
from silo.cli.codes import EXIT_FAILED, EXIT_USAGE
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import Edit, ElementOptions, State
from silo.errors import ConnectionLostError, GoesOnError, RefusedError, StateError
from silo.files.event_log import read_events
from silo.fleet.exchange import encoded
from silo.journal.holdings import segment_holdings
from silo.live.requests import OpenView
from silo.net.session import MAX_MESSAGE_BYTES, close, open_client
from silo.requests import Stop
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy
from silo.segment.reader import SegmentReader
from silo.state.requests import ApplyEdits
from tests.waiting import DEADLINE_S, freeze, wait_until


def with_unsaved(bench, client: Client, ticks: int = 20) -> None:
    client.start()
    bench.ticks(ticks)


# -------------------------------------------------------------------- a client's start beside what its program does


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("does", ["start", "set", "set at a cut", "update", "remove", "load_script"])
def test_what_a_program_does_while_it_is_set_up_never_fails_for_the_start_of_a_client(
    bench, client, tmp_path, caplog, does, again
) -> None:
    client.start()
    if again:
        client.restart()
    logger, run = bench.logger, bench.logger._present.run
    logger.array("late")
    (script := tmp_path / "other.yaml").write_text("log_elements: []\n")
    call, at, _ = does.partition(" at a cut")
    given = {"set": ["slow"], "remove": ["kept"], "load_script": [script]}
    options = {"divider": 7} | ({"cut": True} if at else {}) if call == "set" else {}
    getattr(logger, call)(*given.get(call, []), **options)
    assert re.search(
        r"bot: \w+@.* had started it while the program .* that run, without a tick, gives way", caplog.text
    )
    assert (logger.is_running, logger._present.run is not run) == (does == "start", does == "start")
    if does != "start":
        logger.start()
    bench.ticks(3)
    assert (logger.ticks, logger["late"].newest) == (3, 0.0)
    with pytest.raises(StateError, match="runs: stop"):
        logger.start()  # one of its own is a mistake of its own


def test_a_start_of_the_program_saves_what_it_logged_since_a_client_started_it(bench, client, tmp_path, caplog) -> None:
    client.start()
    bench.ticks(4)
    with pytest.raises(StateError, match="runs: stop"):
        bench.logger.set("slow", divider=2)
    bench.logger.start()
    assert re.search(r"\w+@.* had started it: what was logged since is saved, and this start begins anew", caplog.text)
    bench.ticks(2)
    assert (bench.logger.ticks, bench.logger.is_running) == (2, True)
    (saved,) = tmp_path.glob("**/*.silo")
    assert len(silo.open_log(saved).time_ns) == 4


# ---------------------------------------------------------------------------------------------- data in no file


def test_a_start_over_unsaved_data_is_refused_with_what_is_held(bench, client) -> None:
    with_unsaved(bench, client)
    client.stop()
    with pytest.raises(RefusedError, match=r"holds \d+ samples of 8 elements over 0\.19 s, of 20 ticks") as refused:
        client.start()
    assert refused.value.why is RefusedWhy.UNSAVED
    assert "a client by 'save' or 'discard'" in str(refused.value)
    with pytest.raises(RefusedError, match="unsaved must be one of 'refuse', 'save', 'discard', got 'keep'"):
        client.start("keep")
    assert (client.status().state, client.status().ticks) == (State.STOPPED, 20)


def test_a_restart_over_unsaved_data_is_refused_and_logging_goes_on_and_the_program_clears_unasked(
    bench, client
) -> None:
    with_unsaved(bench, client)
    with pytest.raises(RefusedError) as refused:
        client.restart()
    assert refused.value.why is RefusedWhy.UNSAVED
    bench.ticks(5)
    assert client.status().ticks == 25
    bench.logger.restart()
    assert bench.logger.ticks == 0


@pytest.mark.parametrize("restart", [False, True])
def test_with_save_the_last_run_is_in_a_file_before_it_is_cleared_and_the_client_is_told_where(
    bench, client, restart
) -> None:
    with_unsaved(bench, client)
    told: list[str] = []
    if restart:
        status = client.restart("save", told.append)
    else:
        client.stop()
        status = client.start("save", told.append)
    assert (status.state, status.ticks) == (State.RUNNING, 0)
    (file,) = Path(bench.logger.options.folder).glob("*.silo")
    assert str(file) in told[0]
    assert silo.open_log(file)["/log/x"].values.tolist() == list(range(1, 21))


def test_the_file_of_the_last_run_has_what_happened_and_what_was_derived_and_the_event_log_tells_of_it(
    bench, client, heard
) -> None:
    with_unsaved(bench, client)
    client.derive("twice", "2 * x")
    client.stop()
    heard.wait(EventKind.STOPPED)
    folder = Path(bench.logger.options.folder)
    wait_until(lambda: [one for one in read_events(folder, "bot") if one.kind == EventKind.STOPPED.value])
    client.start("save")
    (file,) = folder.glob("*.silo")
    log = silo.open_log(file)
    assert log["twice"].values.tolist() == list(range(2, 42, 2))
    assert [event.kind for event in log.events] == ["started", "edited", "stopped"]
    assert heard.wait(EventKind.SAVED).text == f"the last run was saved before it is cleared: {file}"


@pytest.mark.parametrize("word", ["discard", "save"])
def test_saved_data_needs_no_decision(bench, client, heard, word) -> None:
    with_unsaved(bench, client)
    client.stop()
    client.wait_saved(client.save())
    heard.wait(EventKind.SAVED)
    assert client.start().ticks == 0
    client.stop()
    assert client.start(word).ticks == 0  # nor does nothing at all


@pytest.mark.parametrize("command", ["start", "restart"])
def test_the_commands_name_both_ways_out(bench, client, capsys, command) -> None:
    with_unsaved(bench, client)
    client.stop()
    assert run([command, "bot"]) == EXIT_FAILED
    shown = capsys.readouterr().err
    assert "samples of 8 elements over 0.19 s" in shown
    assert f"`silo {command} {client.found.label} --save` or `--discard`" in shown
    assert run([command, "bot", "--save", "--discard"]) == EXIT_USAGE
    assert bench.logger.ticks == 20
    assert run([command, "bot", "--save"]) == 0
    assert "was saved before it is cleared: " in capsys.readouterr().out


def test_silo_set_restarts_over_unsaved_data_only_when_told(bench, client, capsys) -> None:
    with_unsaved(bench, client)
    assert run(["set", "bot", "/log/x", "divider=2", "--restart"]) == EXIT_FAILED
    assert "add --save or --discard; nothing was changed" in capsys.readouterr().err
    assert (bench.logger.is_running, bench.logger.ticks) == (True, 20)
    assert run(["set", "bot", "/log/x", "divider=2", "--restart", "--discard"]) == 0
    assert (bench.logger.is_running, bench.logger.ticks) == (True, 0)


def test_the_status_says_what_the_buffers_hold_and_not_how_many_ticks_there_were(bench, client) -> None:
    bench.logger.set("/log/x", buffer=silo.BufferType.LOOPING, size=7)
    for element in bench.logger.elements[1:]:
        bench.logger.set(element.name, enabled=False)
    with_unsaved(bench, client, 1000)
    status = client.status()
    held = segment_holdings(SegmentReader(bench.logger._present.path))
    assert (status.ticks, status.held_samples, status.held_s) == (1000, 7, pytest.approx(0.06))
    assert (held.samples, held.seconds) == (status.held_samples, status.held_s)


# -------------------------------------------------------------------------------------------------- what takes long


def test_what_takes_long_goes_on_and_an_event_tells_how_it_ended(bench, client, heard) -> None:
    with bench.logger._life.lock, pytest.raises(GoesOnError, match="start goes on: the robot program has not answered"):
        client.start()
    ended = heard.wait(EventKind.ENDED)
    assert ended.text == "the start that took long is done"
    assert ended.status.state is State.RUNNING
    assert client.status().state is State.RUNNING


def test_what_takes_long_and_is_refused_then_is_told_as_such(bench, client, heard) -> None:
    with_unsaved(bench, client)
    with bench.logger._life.lock, pytest.raises(GoesOnError):
        client.restart()
    assert heard.wait(EventKind.ENDED).text.startswith("the restart that took long was refused: logger 'bot' holds")


# ------------------------------------------------------------------------------------------------- what is too large


def test_a_request_that_is_too_large_is_refused_before_it_is_sent(bench, client) -> None:
    edits = [Edit("/log/" + "x" * 1000, ElementOptions())] * 9_000
    with pytest.raises(RefusedError, match=rf"takes \d+ bytes, .* at most {ApplyEdits.max_bytes}.*nothing was sent"):
        client.apply(edits, -1)
    with pytest.raises(RefusedError, match=rf"at most {OpenView.max_bytes}"):
        encoded(OpenView(view="a-1", values=["x" * 1000] * 3000))


def test_what_is_just_as_large_as_allowed_is_read(bench) -> None:
    assert Stop.max_bytes < MAX_MESSAGE_BYTES
    session = open_client(Path(bench.serving.socket_path))
    try:
        for kind in (ApplyEdits, OpenView):
            replies = list(session.get(f"silo/*/bot/{kind.key}", payload=b"\xc1" * kind.max_bytes, timeout=DEADLINE_S))
            assert b"can't be understood" in replies[0].ok.payload.to_bytes()
    finally:
        close(session)


def test_a_large_request_waits_for_a_helper_process_that_gets_no_processor_for_a_while(bench, client) -> None:
    helper_pid = client.status().helper_pid
    session = open_client(Path(bench.serving.socket_path))
    try:
        freeze(helper_pid)
        threading.Timer(0.6, os.kill, (helper_pid, signal.SIGCONT)).start()
        replies = list(
            session.get(f"silo/*/bot/{ApplyEdits.key}", payload=b"\xc1" * ApplyEdits.max_bytes, timeout=DEADLINE_S)
        )
        assert b"can't be understood" in replies[0].ok.payload.to_bytes()
    finally:
        close(session)


def test_what_the_helper_process_could_write_in_some_of_several_formats_is_saved(bench, client, tmp_path):
    bench.start(5)
    (tmp_path / "x.csv.json").mkdir()
    with pytest.raises(silo.SaveError, match=r"x\.csv.*; saved: .*x\.silo"):
        bench.logger.save(["silo", "csv"], name="x", folder=tmp_path)
    assert not bench.logger.has_unsaved
    client.stop()
    client.start()  # which is refused over what is in no file


def test_what_a_save_of_a_client_writes_while_the_logger_is_closed_is_not_told_as_dropped(
    bench, client, heard, tmp_path, capsys
):
    bench.start(5)

    def save():
        with contextlib.suppress(ConnectionLostError):
            client.save(["csv"])

    saving = threading.Thread(target=save)
    saving.start()
    heard.wait(EventKind.SAVING)
    bench.logger.close()
    saving.join()
    assert list((tmp_path / "logs").glob("*.csv"))
    assert (bench.logger.has_unsaved, capsys.readouterr().err) == (False, "")
