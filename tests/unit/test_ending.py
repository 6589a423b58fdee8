"""Commands that run until Ctrl-C end at it, whichever thread the system gives the signal to."""

import os
import signal
import sys
import threading

import pytest

from silo.cli.common import Ending
from tests.waiting import wait_until

ENDS = (signal.SIGINT, signal.SIGTERM)


@pytest.fixture
def ending():
    before = {number: signal.getsignal(number) for number in ENDS}
    yield Ending()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", ENDS)
def test_a_signal_that_another_thread_took_ends_the_wait(ending, number):
    waiter = threading.get_ident()

    def take() -> None:
        wait_until(lambda: sys._current_frames()[waiter].f_code is threading.Condition.wait.__code__)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
        os.kill(os.getpid(), number)

    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {number})
    other = threading.Thread(target=take)
    try:
        assert not ending.within(0.0)
        other.start()
        ending.wait()
        assert ending.within(0.0)
    finally:
        other.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
