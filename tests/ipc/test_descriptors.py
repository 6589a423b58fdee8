"""A helper process that can open no file for a while: it goes on, and makes up for it once it can."""

import errno
import os
import resource
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from silo.core.conditions import NO_CONDITIONS, Conditions, SignalLimits
from silo.core.elements import State
from silo.errors import GoesOnError, SegmentError
from silo.helper.helper import conditions_text
from silo.net import knocking
from silo.net.configuration import LINK
from silo.net.knocking import Door
from silo.net.lingering import descriptors, sockets
from silo.recorder.server import EndlessRecordings
from silo.rpc.published import EventKind
from tests.waiting import DEADLINE_S, wait_until

NONE_MORE = 8


def limit(pid: int, soft: int) -> None:
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (soft, resource.prlimit(pid, resource.RLIMIT_NOFILE)[1]))


def test_a_helper_process_may_open_as_many_files_as_the_system_lets_it(client) -> None:
    soft, hard = resource.prlimit(client.status().helper_pid, resource.RLIMIT_NOFILE)
    assert soft == hard


def test_without_descriptors_it_lives_on_and_what_it_could_not_do_is_done_then(bench, client) -> None:
    bench.logger.trigger("high", "x % 50 == 0", pre="50ms", post="50ms")
    bench.start(20)
    pid = client.status().helper_pid
    soft = resource.prlimit(pid, resource.RLIMIT_NOFILE)[0]
    limit(pid, NONE_MORE)
    try:
        bench.ticks(50)
        assert client.restart("discard").state is State.RUNNING  # its run can't be handed over now
        bench.ticks(50)
        with pytest.raises(GoesOnError, match="the mark is noted"):
            client.mark("in the dark")
    finally:
        limit(pid, soft)
    wait_until(lambda: len({event.run for event in client.events() if event.kind == EventKind.CAPTURED.value}) == 2)
    wait_until(lambda: any(event.text == "in the dark" for event in client.events()))
    assert client.status().helper_pid == pid
    wait_until(lambda: client.status().ticks == 50)


def test_what_became_of_conditions_is_told_without_another_file(monkeypatch) -> None:
    """By the main thread, which has nobody who would catch that a module can't be loaded now."""
    monkeypatch.setitem(sys.modules, "silo.settings.conditions_diff", None)
    limits = SignalLimits("x", bounds=(None, None, 1.0, 2.0))
    assert conditions_text(NO_CONDITIONS, Conditions(limits=(limits,))).startswith("limits x")


def test_a_run_that_begins_meanwhile_is_recorded_from_its_first_tick(bench, client) -> None:
    bench.logger.set(buffer="looping", size=1000)
    bench.logger.start()
    client.record(["x"], name="all")
    bench.ticks(20)
    pid = client.status().helper_pid
    soft = resource.prlimit(pid, resource.RLIMIT_NOFILE)[0]
    limit(pid, NONE_MORE)
    try:
        bench.logger.restart()
        bench.ticks(50)
        with pytest.raises(GoesOnError, match="the mark is noted"):
            client.mark("in the dark")  # by then the helper process knows of the run
    finally:
        limit(pid, soft)
    wait_until(lambda: client.recorders()[0].samples == 70)
    assert "70 samples, 0 lost" in client.stop_recorder("all")
    assert client.status().helper_pid == pid


@pytest.mark.parametrize("code", [errno.EMFILE, errno.EIO])
def test_only_what_will_never_be_readable_is_given_up(runtime_folder, code) -> None:
    told, done, handed = [], [], []
    problems: list[OSError] = [OSError(code, "no")]

    def opened(run: str) -> SimpleNamespace:
        if problems:
            raise SegmentError("can't be mapped") from problems.pop()
        return SimpleNamespace(close=lambda: None)

    robot = SimpleNamespace(logger="bot", pid=os.getpid(), segment="", conditions=None)
    replica = SimpleNamespace(now=SimpleNamespace(robot=robot, options=SimpleNamespace(id="1")), run="", segment="s")
    held = SimpleNamespace(ids=lambda: ["a"], open=opened, conditions=lambda run: None)
    events = SimpleNamespace(publish=lambda kind, text, **more: told.append((kind, text)))
    recordings = EndlessRecordings(replica, events, held)
    recordings._recorders["all"] = SimpleNamespace(
        known=set(), runs=[], ending="", order=SimpleNamespace(name="all"), done=done.append,
        lacks=lambda run: run not in (*done, *handed), follow=lambda *_: not handed.append("a"),
    )  # fmt: skip
    recordings.follow_present()
    recordings.follow_present()
    is_given_up = code == errno.EIO
    assert (done, handed) == ((["a"], []) if is_given_up else ([], ["a"]))
    assert (
        told
        == [(EventKind.RECORDING_FAILED, "recording 'all': run a can't be recorded: can't be mapped")] * is_given_up
    )


# ------------------------------------------------------------------------------------------------ who is not let in


class Listener:
    """A socket that a door watches, and what comes to it; `let_in` are those that a session knows."""

    def __init__(self, stack: ExitStack) -> None:
        self.let_in: list[SimpleNamespace] = []
        self.door = Door(SimpleNamespace(info=SimpleNamespace(links=lambda: self.let_in)))
        stack.callback(self.door.close)
        self._stack = stack
        self._socket = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        self.door.look(sockets())

    def come(self, count: int, says: bytes = b"") -> ExitStack:
        """Have so many connect; until the stack is closed."""
        with ExitStack() as ends:
            for _ in range(count):
                came = ends.enter_context(socket.create_connection(self._socket.getsockname(), timeout=DEADLINE_S))
                came.sendall(says)
                taken = ends.enter_context(self._socket.accept()[0])
                taken.settimeout(DEADLINE_S)
                self._taken = taken, came
            return ends.pop_all()

    def is_open(self) -> bool:
        with socket.socket() as one:
            one.settimeout(0.2)
            try:
                one.connect(self._socket.getsockname())
            except TimeoutError:
                return False
            self._stack.enter_context(self._socket.accept()[0]).close()
            return True

    def newest(self) -> tuple[socket.socket, socket.socket]:
        return self._taken


@pytest.fixture
def listener() -> Iterator[Listener]:
    with ExitStack() as stack:
        yield Listener(stack)


def test_while_too_many_wait_to_be_let_in_no_more_are_taken(listener) -> None:
    with listener.come(knocking.MOST_SILENT):
        listener.door.look(sockets())
        assert listener.is_open()
        with listener.come(1):
            listener.door.look(sockets())
            assert listener.door.is_shut
            assert not listener.is_open()
    listener.door.look(sockets())
    assert listener.is_open()


def test_those_who_were_let_in_are_as_many_as_like_and_go_on_at_a_shut_door(listener) -> None:
    with listener.come(knocking.MOST_SILENT + 1):
        theirs, ours = listener.newest()
        listener.let_in = [SimpleNamespace(dst=f"tls/[::ffff:127.0.0.1]:{ours.getsockname()[1]}")]
        listener.door.look(sockets())
        assert listener.is_open()
        with listener.come(1):
            listener.door.look(sockets())
            assert listener.door.is_shut
            ours.sendall(b"on")
            assert theirs.recv(10) == b"on"


def test_who_says_nothing_is_ended_while_others_wait(listener, monkeypatch) -> None:
    monkeypatch.setattr(knocking, "SILENT_S", 0.0)
    with listener.come(1):
        theirs, ours = listener.newest()
        ours.sendall(b"hello")
        assert theirs.recv(10) == b"hello"
        with listener.come(knocking.MOST_SILENT + 1):
            listener.door.look(sockets())
            assert listener.door.is_shut
            silent, _ = listener.newest()
            assert silent.recv(10) == b""
            ours.sendall(b"hello")
            assert theirs.recv(10) == b"hello"


def test_a_door_is_shut_without_a_descriptor_that_is_free(listener) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with listener.come(knocking.MOST_SILENT + 1), ExitStack() as filled:
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(descriptors()) + 64, hard))
        filled.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        with pytest.raises(OSError, match="Too many open files"):
            while True:
                filled.callback(os.close, os.dup(0))
        listener.door.look(sockets())
        assert listener.door.is_shut


def test_many_who_began_to_speak_do_not_shut_it(listener) -> None:
    with listener.come(knocking.MOST_SILENT + 1, says=b"hello"):
        listener.door.look(sockets())
        assert listener.is_open()


def test_who_comes_by_the_unix_socket_finds_room_while_as_many_as_may_wait_at_the_door() -> None:
    assert LINK["transport"]["unicast"]["accept_pending"] >= 2 * knocking.MOST
