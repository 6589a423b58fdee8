"""All ways in which a logger ends, in any order, at once, amid one another, and in a forked child.

Whatever comes together, each tick that is kept stands in one file, nothing stands still, and nothing is left over: no
shared memory, no journal, no socket, no helper process.
"""

import contextlib
import functools
import os
import signal
import sys
import threading
import traceback
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.errors import SiloError
from silo.files.event_log import CRASHED, read_events
from silo.files.silo import writer
from silo.logger import unclosed
from silo.logger.serving.serving import Serving
from silo.logger.unclosed import LoggerEnd
from silo.segment.reader import SegmentReader
from silo.segment.reasons import StopReason
from tests.stand_ins.interrupting import Interrupts
from tests.waiting import wait_until

TICKS = 3
ERROR = (KeyboardInterrupt, KeyboardInterrupt(), None)
CLEAN = (None, None, None)

# what becomes of ticks that are in no file: "" where the logger goes on
DOORS = {
    "close": (lambda log, _: log.close(), "dropped"),
    "discard": (lambda log, _: log.close(discard=True), "dropped"),
    "with": (lambda log, _: log.__exit__(*CLEAN), "saved"),
    "with, error": (lambda log, _: log.__exit__(*ERROR), "saved"),
    "exit": (lambda log, _: log._end(LoggerEnd.UNCLOSED), "saved"),
    "forgotten": (lambda log, _: log.__del__(), "left"),
}
SERVED = DOORS | {
    "forgotten": (DOORS["forgotten"][0], "saved"),  # by the helper process
    "server": (lambda _, serving: serving.__exit__(*CLEAN), ""),
    "server, error": (lambda _, serving: serving.__exit__(*ERROR), "saved"),
}
PAIRS = [(first, second) for first in DOORS for second in DOORS]
# who forgets one whose server was closed is as who forgets one that was never served
SERVED_PAIRS = [(first, second) for first in SERVED for second in SERVED if {first, second} != {"server", "forgotten"}]


@pytest.fixture
def logger(tmp_path):
    """Makes a logger with some ticks, `served` or not, with a parameter that has such a check."""

    def made(served, check=None):
        log = silo.Logger(
            "walk", folder=tmp_path, script=tmp_path / "none.yaml", storage="disk" if served else "memory"
        )
        log.add(x := np.zeros(1), "x")
        log.parameter("kp", 1.0, check=check)
        serving = log.serve() if served else None
        log.start()
        for x[0] in range(TICKS):
            log.collect()
        return log, serving

    return made


def pass_through(door, log, serving):
    SERVED[door][0](log, serving)


def check(log, serving, fates, folder, runtime_folder):
    """After the end of the process, which is the last door."""
    log._end(LoggerEnd.UNCLOSED)
    fates = {*fates} - {""} or {"saved"}
    if serving is not None:
        if fates == {"saved"}:
            wait_until(lambda: list(folder.glob("*.silo")))
        if is_there(serving.helper_pid):  # it saved, and stays to be asked what became of it
            os.kill(serving.helper_pid, signal.SIGTERM)
        wait_until(lambda: not is_there(serving.helper_pid))
        assert not serving._thread.is_alive()
        assert serving._over
    files = list(folder.glob("*.silo"))
    assert len(files) in {"saved": {1}, "dropped": {0}, "left": {0}}[fates.pop()] | ({0, 1} if fates else set())
    for file in files:
        assert silo.open_log(file)["x"].values.ravel().tolist() == [*range(TICKS)]
    left = [path.name for path in runtime_folder.iterdir()]
    if log._life.ending is LoggerEnd.FORGOTTEN and serving is None:
        assert left == [Path(log._present.path).name]
        log._present.run.drop()
    else:
        assert [name for name in left if not name.endswith((".lock", ".dead"))] == []
    kept = [path.name for path in folder.iterdir() if path not in files]
    assert [name for name in kept if not name.endswith(("_fileNumber", ".events.jsonl"))] == []
    assert not any(thread.name == "silo-chunks" for thread in threading.enumerate())


def is_there(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def decided(*doors, of=SERVED):
    """What the first of them that decides anything decides."""
    return {next(filter(None, (of[door][1] for door in doors)), "")}


def amid(log, serving, monkeypatch, what):
    """Have something done amid the first end that writes a file, or says goodbye."""
    done = []

    def first(real):
        def call(*arguments):
            if not done:
                done.append(True)
                what()
            return real(*arguments)

        return call

    monkeypatch.setattr(writer, "write_all", first(writer.write_all))
    monkeypatch.setattr(Serving, "_say_goodbye", first(Serving._say_goodbye))
    monkeypatch.setattr(log._present, "drop", first(log._present.drop))
    return done


# ------------------------------------------------------------------------------------------------------ alone


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_one_after_the_other(logger, tmp_path, runtime_folder, first, second):
    log, _ = logger(served=False)
    pass_through(first, log, None)
    pass_through(second, log, None)
    check(log, None, decided(first, second, of=DOORS), tmp_path, runtime_folder)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_at_the_same_time_from_two_threads(logger, tmp_path, runtime_folder, first, second):
    log, _ = logger(served=False)
    at_once(log, None, first, second)
    check(log, None, {DOORS[first][1], DOORS[second][1]}, tmp_path, runtime_folder)


def at_once(log, serving, first, second):
    together = threading.Barrier(2)

    def end(door):
        together.wait()
        pass_through(door, log, serving)

    threads = [threading.Thread(target=end, args=(door,), daemon=True) for door in (first, second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
        assert not thread.is_alive()


@pytest.mark.parametrize("second", DOORS)
@pytest.mark.parametrize("first", DOORS)
def test_in_a_signal_handler_amid_the_other(logger, tmp_path, runtime_folder, monkeypatch, first, second):
    log, _ = logger(served=False)
    with handling(lambda: pass_through(second, log, None)):
        amid(log, None, monkeypatch, lambda: signal.raise_signal(signal.SIGUSR1))
        pass_through(first, log, None)
    check(log, None, decided(first, second, of=DOORS), tmp_path, runtime_folder)


def in_a_thread(what):
    thread = threading.Thread(target=what, daemon=True)
    thread.start()
    thread.join(30)
    assert not thread.is_alive()


@contextlib.contextmanager
def asking(what):
    """A client asks for something, and may hear instead that the logger was closed."""

    def asks():
        with contextlib.suppress(SiloError):
            what(client)

    with silo.connect("walk") as client:
        thread = threading.Thread(target=asks, daemon=True)
        thread.start()
        yield
        thread.join(30)
        assert not thread.is_alive()


@contextlib.contextmanager
def handling(what):
    before = signal.signal(signal.SIGUSR1, lambda *_: what())
    try:
        yield
    finally:
        signal.signal(signal.SIGUSR1, before)


@pytest.mark.parametrize("first", DOORS)
def test_a_signal_handler_that_ends_the_program_amid_it_leaves_the_rest_to_the_end_of_the_process(
    logger, tmp_path, runtime_folder, monkeypatch, first
):
    log, _ = logger(served=False)

    def leave():
        log.close()
        raise SystemExit

    with handling(leave):
        done = amid(log, None, monkeypatch, lambda: signal.raise_signal(signal.SIGUSR1))
        try:
            pass_through(first, log, None)
        except SystemExit:
            assert done
        else:
            assert not done
    check(log, None, decided(first, of=DOORS), tmp_path, runtime_folder)


CALLS = {
    "start": (lambda log, _: log.restart(), "dropped"),
    "cut": (lambda log, _: log.set("x", size="5s", cut=True), "dropped"),
    "save": (lambda log, _: log.save(), "saved"),
    "stop": (lambda log, _: log.stop(), "dropped"),
    "look": (lambda log, _: log["x"], "dropped"),
}


@pytest.mark.sampled
@pytest.mark.parametrize("call", CALLS)
def test_a_signal_handler_that_closes_it_amid_a_call_has_it_end_after_that(
    logger, tmp_path, runtime_folder, drawn, caplog, call
):
    does, fate = CALLS[call]
    watched = lambda code: "/silo/logger/" in code.co_filename and code.co_filename != unclosed.__file__  # noqa: E731
    log, _ = logger(served=False)
    places = Interrupts(watched).places(functools.partial(does, log, None))
    log.close()
    for place in drawn(places, 20):
        for path in tmp_path.iterdir():
            path.unlink()
        log, _ = logger(served=False)
        caplog.clear()
        ended = []
        handler = lambda *_, log=log, ended=ended: ended.append([log.close(), log._life.freed])  # noqa: E731
        Interrupts(watched, handler).interrupt(place, functools.partial(does, log, None))
        assert ended == [[None, False]]
        assert log._life.freed
        assert caplog.text.count("walk: it was to end amid ") == 1
        log.collect()
        check(log, None, {fate}, tmp_path, runtime_folder)


def test_a_signal_handler_that_closes_it_and_raises_before_a_call_begins_has_it_end_at_once(
    logger, tmp_path, runtime_folder
):
    log, _ = logger(served=False)

    def leave(*_):
        log.close()
        raise KeyboardInterrupt

    interrupts = Interrupts(lambda code: code is unclosed.during.__code__, leave)
    assert interrupts.interrupt_at(0, log.save)
    assert log._life.freed
    check(log, None, {"dropped"}, tmp_path, runtime_folder)


@pytest.mark.parametrize("again", [lambda end: end(), in_a_thread], ids=["here", "in another thread"])
@pytest.mark.parametrize("first", DOORS)
def test_one_that_failed_is_done_again_by_who_holds_its_error(
    logger, tmp_path, runtime_folder, monkeypatch, first, again
):
    log, _ = logger(served=False)

    def fails():
        raise KeyboardInterrupt

    assert amid(log, None, monkeypatch, fails) == []
    try:
        pass_through(first, log, None)
    except KeyboardInterrupt:
        again(log.close)
        assert log._life.freed
    check(log, None, decided(first, of=DOORS), tmp_path, runtime_folder)


def test_the_end_of_a_process_ends_all_loggers_though_one_fails(logger, tmp_path, runtime_folder, monkeypatch):
    log, _ = logger(served=False)
    other = silo.Logger("other", folder=tmp_path, script=tmp_path / "none.yaml")

    def fails(_):
        raise OSError("full")

    monkeypatch.setattr(other, "_end", fails)
    monkeypatch.setattr(unclosed, "_living", [other, log, other])
    with pytest.raises(OSError, match="full"):
        unclosed._end_of_process()
    assert log._life.freed
    monkeypatch.undo()
    other.close()


# ----------------------------------------------------------------------------------------------------- served


@pytest.mark.slow
@pytest.mark.sampled
def test_served_one_after_the_other(logger, tmp_path, runtime_folder, drawn, each_pair):
    each_pair(drawn(SERVED_PAIRS, 6), lambda log, serving, *doors: [pass_through(door, log, serving) for door in doors])


@pytest.mark.slow
@pytest.mark.sampled
def test_served_at_the_same_time_from_two_threads(drawn, each_pair):
    each_pair(drawn(SERVED_PAIRS, 6), at_once, at_once=True)


@pytest.mark.slow
@pytest.mark.sampled
def test_served_in_a_signal_handler_amid_the_other(monkeypatch, drawn, each_pair):
    def both(log, serving, first, second):
        with handling(lambda: pass_through(second, log, serving)), monkeypatch.context() as patch:
            amid(log, serving, patch, lambda: signal.raise_signal(signal.SIGUSR1))
            pass_through(first, log, serving)

    each_pair(drawn(SERVED_PAIRS, 6), both)


@pytest.mark.slow
def test_a_logger_goes_on_after_an_error_in_its_served_block_and_what_it_saved_then_is_known_as_that(
    logger, tmp_path, runtime_folder
):
    log, serving = logger(served=True)
    serving.__exit__(*ERROR)
    wait_until(lambda: list(tmp_path.glob("*.silo")) and not is_there(serving.helper_pid))
    told = [event.kind for event in read_events(tmp_path, "walk")]
    assert "closed" in told
    assert CRASHED not in told
    assert SegmentReader(log._present.path).saved_ticks == TICKS
    assert (log.is_running, log.has_unsaved) == (True, False)
    check(log, serving, {"saved"}, tmp_path, runtime_folder)


@pytest.mark.slow
def test_the_collector_may_forget_one_in_the_thread_of_a_server_that_is_just_closed(
    logger, tmp_path, runtime_folder, monkeypatch
):
    log, serving = logger(served=True)
    monkeypatch.setattr(serving, "_look_at_parameters", lambda: None if serving.alive else log.__del__())
    in_a_thread(serving.close)
    check(log, serving, {"saved"}, tmp_path, runtime_folder)


@pytest.mark.slow
def test_a_signal_handler_that_closes_a_served_one_amid_a_call_waits_for_no_thread_that_waits_for_that_call(
    logger, tmp_path, runtime_folder, monkeypatch
):
    log, serving = logger(served=True)
    settle_cut = log._present.settle_cut

    def waits():
        stack = traceback.extract_stack(sys._current_frames()[serving._thread.ident])
        return any(frame.name == "_push_state" for frame in stack)

    def with_the_lock():
        serving.state_changed()
        wait_until(waits)  # for that lock
        signal.raise_signal(signal.SIGUSR1)
        assert serving.alive
        settle_cut()

    monkeypatch.setattr(log._present, "settle_cut", with_the_lock)
    with handling(log.close):
        log.stop()
    assert log._life.freed
    check(log, serving, {"dropped"}, tmp_path, runtime_folder)


@pytest.mark.slow
@pytest.mark.parametrize("amid", ["a set", "the tick with which it stops"])
def test_a_signal_handler_that_closes_a_served_one_waits_for_no_thread_that_waits_for_what_it_came_amid(
    logger, tmp_path, runtime_folder, monkeypatch, amid
):
    log, serving = logger(served=True)
    landing = log.parameters.landing
    owner, name, waits_in, does, asks = {
        "a set": (
            landing.record, "open", "_open", lambda: log.parameters.set({"kp": 3.0}),
            lambda client: client.parameters.set({"kp": 2.0}),
        ),
        "the tick with which it stops": (
            serving._changes, "add", "state_changed", lambda: log._stop_by_itself(StopReason.TIME_FULL),
            lambda client: client.start(unsaved="discard"),
        ),
    }[amid]  # fmt: skip
    real = getattr(owner, name)

    def waits():
        stack = traceback.extract_stack(sys._current_frames()[serving._thread.ident])
        return landing.waiting or any(frame.name == waits_in for frame in stack)

    def interrupted(*arguments):
        monkeypatch.setattr(owner, name, real)
        with asking(asks):
            wait_until(waits)
            signal.raise_signal(signal.SIGUSR1)
            return real(*arguments)

    monkeypatch.setattr(owner, name, interrupted)
    with handling(log.close):
        does()
    assert log._life.freed
    check(log, serving, {"dropped"}, tmp_path, runtime_folder)


@pytest.mark.slow
@pytest.mark.parametrize("asked", ["close", "server"])
@pytest.mark.parametrize("door", ["with", "server, error"])
def test_a_check_that_closes_it_while_another_thread_ends_it_waits_for_no_save_that_waits_for_its_answer(
    logger, tmp_path, runtime_folder, monkeypatch, caplog, door, asked
):
    begins, saves = threading.Event(), threading.Event()

    def ends(_):
        begins.set()
        assert saves.wait(30)
        pass_through(asked, log, serving)

    def saved(*arguments):
        saves.set()
        return save(*arguments)

    log, serving = logger(served=True, check=ends)
    save = serving.save
    monkeypatch.setattr(serving, "save", saved)
    with asking(lambda client: client.parameters.set({"kp": 2.0})):
        assert begins.wait(30)
        in_a_thread(lambda: pass_through(door, log, serving))
    assert "frozen" not in caplog.text
    assert log._life.freed == (asked == "close" or door == "with")
    check(log, serving, {"saved"}, tmp_path, runtime_folder)


@pytest.mark.slow
@pytest.mark.parametrize("is_down", [False, True])
def test_what_was_logged_before_a_cut_is_told_as_dropped_where_it_is_in_no_file_as_its_logger_ends(
    logger, tmp_path, runtime_folder, monkeypatch, capfd, is_down
):
    log, serving = logger(served=True)
    begins, writes, at_drop = threading.Event(), threading.Event(), []
    drop, write_all = log._present.drop, writer.write_all

    def no_helper(*_):
        begins.set()
        wait_until(lambda: is_down or (log._life.closed and not serving.is_up))

    def written(*arguments):
        writes.set()
        wait_until(lambda: serving._over)
        return write_all(*arguments)

    monkeypatch.setattr(log._data, "_saved_by_helper", no_helper)
    monkeypatch.setattr(writer, "write_all", written)
    monkeypatch.setattr(log._present, "drop", lambda: at_drop.append([*tmp_path.glob("*.silo")]) or drop())
    log.set("x", size="5s", cut=True)
    assert (writes if is_down else begins).wait(30)
    log.close()
    assert [len(files) for files in at_drop] == [is_down]
    assert ("3 ticks that were not saved are dropped" in capfd.readouterr().err) is not is_down
    check(log, serving, {"saved" if is_down else "dropped"}, tmp_path, runtime_folder)


@pytest.fixture
def each_pair(logger, tmp_path, runtime_folder):
    def tried(pairs, both, at_once=False):
        for first, second in pairs:
            log, serving = logger(served=True)
            both(log, serving, first, second)
            fates = {SERVED[first][1], SERVED[second][1]} if at_once else decided(first, second)
            try:
                check(log, serving, fates, tmp_path, runtime_folder)
            except AssertionError as error:
                raise AssertionError(f"{first}, {second}: {error}") from error
            for path in tmp_path.iterdir():
                path.unlink()

    return tried


# ------------------------------------------------------------------------------------------------ a forked child


@pytest.mark.slow
@pytest.mark.parametrize("served", [False, True])
@pytest.mark.parametrize("amid_an_end", [False, True])
def test_in_a_forked_child_none_of_them_does_anything(
    logger, tmp_path, runtime_folder, monkeypatch, served, amid_an_end
):
    log, serving = logger(served)
    forked = []

    def fork() -> None:
        child = os.fork()
        if child == 0:
            signal.alarm(20)
            try:
                for first, second in SERVED_PAIRS if served else PAIRS:
                    at_once(log, serving, first, second)
                unclosed._end_of_process()
            except BaseException:  # noqa: BLE001
                os._exit(1)
            os._exit(0)
        forked.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))

    if amid_an_end:
        amid(log, serving, monkeypatch, fork)
        ends = threading.Thread(target=log.__exit__, args=CLEAN)
        ends.start()
        ends.join()
    else:
        fork()
        assert len(log.snapshot().time_ns) == TICKS
    assert forked == [0]
    check(log, serving, {"saved"}, tmp_path, runtime_folder)
