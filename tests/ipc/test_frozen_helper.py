"""A helper process that stands still holds nobody up for ever: the program saves by itself, or is told."""

import contextlib
import io
import os
import signal
import socket
from types import SimpleNamespace

import msgspec
import pytest

import silo
from silo.core.elements import State
from silo.errors import SaveError
from silo.link.channel import Beat, Goodbye, LinkChannel, LinkReply, LinkRequest
from silo.logger.serving import process, serving
from silo.logger.serving.process import DEAF_ROUNDS, FROZEN_ROUNDS, Patience
from silo.rpc.refusals import Refused, RefusedWhy
from silo.state.handover import RobotState
from tests.stand_ins.ticking import collect
from tests.waiting import freeze, wait_until


@pytest.fixture
def served(runtime, tmp_path):
    logger = silo.Logger("arm", folder=tmp_path, script=tmp_path / "none.yaml")
    logger.kept = logger.array("q", 3)
    logger.serve()
    logger.start()
    collect(logger, 5)
    yield logger
    logger.close()


@pytest.fixture
def frozen(served, monkeypatch):
    """Its helper process stands still, and is waited for as shortly as can be told."""

    @contextlib.contextmanager
    def stand_still():
        pid = served._life.serving.helper_pid
        freeze(pid)
        try:
            with monkeypatch.context() as patch:
                patch.setattr(process, "FROZEN_ROUNDS", 1)
                patch.setattr(serving, "LISTENED_S", process.ROUND_S)
                yield
        finally:
            os.kill(pid, signal.SIGCONT)

    return stand_still


@pytest.mark.slow
def test_a_save_is_done_by_the_program_itself_and_only_once(served, frozen, tmp_path, caplog):
    with frozen():
        saved = served.save()
        assert len(silo.open_log(saved.path)["q"]) == 5
    assert "shows no sign of life" in caplog.text
    second = served.save()  # behind the first one in the queue of the helper process
    assert sorted(map(str, tmp_path.glob("*.silo"))) == sorted([saved.path, second.path])


@pytest.mark.slow
def test_recording_is_refused_and_not_begun_later(served, frozen, tmp_path):
    with frozen(), pytest.raises(SaveError, match="shows no sign of life: it is frozen"):
        served.record(name="walk")
    served.save()  # behind it
    assert not (tmp_path / "recordings").exists()


@pytest.mark.slow
def test_a_recording_is_not_stopped_later(served, frozen):
    served.record(name="walk")
    with frozen(), pytest.raises(SaveError, match="shows no sign of life: it is frozen"):
        served.stop_recording()
    assert "walk" in served.stop_recording("walk")


@pytest.mark.slow
def test_a_helper_process_that_works_is_waited_for(served, monkeypatch):
    monkeypatch.setattr(process, "FROZEN_ROUNDS", 1)
    beats = served._life.serving._beats
    assert served.save().size_bytes > 0
    wait_until(lambda: served._life.serving._beats > beats)


def test_patience_ends_without_any_sign_of_life():
    quiet = Patience(lambda: 0, lambda: 0)
    assert [quiet.is_over() for _ in range(FROZEN_ROUNDS)] == [False] * (FROZEN_ROUNDS - 1) + [True]


def test_it_lasts_while_there_are_answers_and_a_while_without_them():
    count = iter(range(10_000))
    assert not any(Patience(lambda: next(count), lambda: 0).is_over() for _ in range(200))
    deaf = Patience(lambda: 0, lambda: next(count))
    assert [deaf.is_over() for _ in range(DEAF_ROUNDS)] == [False] * (DEAF_ROUNDS - 1) + [True]


def test_a_link_whose_other_end_takes_nothing_in_is_given_up(monkeypatch):
    monkeypatch.setattr("silo.link.channel.ASKED_EVERY_S", 0.01)
    ours, theirs = socket.socketpair()
    big = RobotState("arm", 1, State.STOPPED, 0, b"x" * 10_000_000, "", "", "", "", "")
    asked = []
    with ours, theirs, pytest.raises(TimeoutError, match="takes nothing in"):
        LinkChannel(ours).send(big, lambda: bool(asked.append(1)) or len(asked) > 3)
    assert len(asked) == 4


def test_a_link_whose_other_end_reads_is_not(monkeypatch):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        for message in (Beat(), Goodbye()):
            LinkChannel(ours).send(message, lambda: True)
            assert LinkChannel(theirs).receive() == message


def test_a_message_that_comes_in_pieces_is_whole_and_one_that_breaks_off_is_none():
    reply = LinkReply(7, Refused(RefusedWhy.FAILED, "no"))
    body = msgspec.msgpack.encode(reply)
    whole = len(body).to_bytes(4, "little") + body
    for end, found in ((len(whole), reply), (len(whole) - 1, None), (3, None), (0, None)):
        pieces = io.BytesIO(whole[:end])
        channel = LinkChannel(SimpleNamespace(recv_into=lambda view: pieces.readinto(view[:2])))  # noqa: B023
        assert channel.receive() == found


@pytest.mark.slow
def test_a_save_that_finds_the_helper_process_gone_is_done_by_the_program(served, monkeypatch, caplog):
    send = served._life.serving._send

    def died(message):
        if isinstance(message, LinkRequest):  # else its other threads would find it gone first
            raise BrokenPipeError
        send(message)

    wait_until(lambda: served._life.helper_is_up)  # one that is still starting is asked for nothing
    with monkeypatch.context() as patch:
        patch.setattr(served._life.serving, "_send", died)
        (file,) = served.save()
        with pytest.raises(SaveError, match="died just now, a new one is being started: try again"):
            served.record()
    assert len(silo.open_log(file.path)["/log/q"].values) == 5
    assert "died just now, a new one is being started; saving in this process" in caplog.text
