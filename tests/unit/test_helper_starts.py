"""Waiting for a helper process that starts: as long as it works at it, and somebody wants it."""

import itertools
import socket
import subprocess
import sys

import pytest

from silo.link.channel import READY, Beat, LinkChannel, LinkReply, LinkSaved
from silo.logger.serving import process
from silo.logger.serving.process import TICK_NS, HelperProcess
from silo.rpc.declaring import Done


class Starting(HelperProcess):
    """One that works and works, and says nothing."""

    def __init__(self, link: socket.socket) -> None:
        self.link, self.channel, self.early = link, LinkChannel(link), []
        self._worked = itertools.count(0, TICK_NS)

    def worked_ns(self) -> int:
        return next(self._worked)


@pytest.mark.parametrize("answers", [False, True])
def test_one_that_hangs_in_its_start_holds_up_the_end_of_its_program_a_little_alone(monkeypatch, answers) -> None:
    monkeypatch.setattr(process, "ENDING_S", 0.1)
    monkeypatch.setattr(process, "READY_TIMEOUT_S", 0.04)
    ours, theirs = socket.socketpair()
    asked = itertools.count()

    def is_wanted() -> bool:
        count = next(asked)
        if answers and count == 4:
            theirs.sendall(b"ready")
        return count < 3

    with ours, theirs:
        assert Starting(ours)._answers(is_wanted) is answers
    assert next(asked) > 4


def test_what_it_tells_before_clients_can_come_is_kept_and_no_reason_to_kill_it() -> None:
    """A successor that ended a capture before it was ready was killed, and the next one: up to 48 s without any."""
    ours, theirs = socket.socketpair()
    saved = LinkSaved(1, [], "")
    with ours, theirs:
        helper = LinkChannel(theirs)
        for message in (saved, Beat(), LinkReply(READY, Done("the socket"))):
            helper.send(message)
        starting = Starting(ours)
        assert starting.wait_until_ready(lambda: True) == "the socket"
        assert starting.early == [saved, Beat()]


@pytest.mark.slow
@pytest.mark.parametrize(("error", "told"), [("ValueError", ["goes on"]), ("GeneratorExit", [])])
def test_a_panic_of_zenoh_ends_the_process_and_an_error_in_a_thread_does_not(error, told) -> None:
    text = f"""
import threading
from silo.helper.__main__ import end_at_panic
threading.excepthook = end_at_panic
def fail():
    raise {error}("what was met")
thread = threading.Thread(target=fail)
thread.start()
thread.join()
print("goes on")
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)
    assert "what was met" in done.stderr
    assert done.stdout.splitlines() == told
    assert done.returncode == (not told)
