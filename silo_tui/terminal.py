"""What depends on the terminal that we run in: SSH, a stalled link, a terminal that went away."""

import os
import signal
import threading
from asyncio import AbstractEventLoop
from collections.abc import Callable
from typing import Any

from textual.app import App

# a frame is one or two writes; more of them waiting means that the terminal takes them slower than we paint
BACKLOG_LIMIT = 2
GRACE_S = 3.0


def over_ssh() -> bool:
    """Return whether the terminal is at the other end of SSH; the mouse stays off there, to select text."""
    return any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY", "SSH_CLIENT"))


def backed_up(app: App[Any]) -> bool:
    """Return whether the terminal lags: then live paints wait. With 30 writes queued Textual's event loop blocks.

    The queue is private to Textual; this is the only place that looks at it.
    """
    driver = app._driver
    writer = getattr(driver, "_writer_thread", None)
    queue = getattr(writer, "_queue", None)
    return queue is not None and queue.qsize() > BACKLOG_LIMIT


def take_mouse(app: App[Any], *, wanted: bool) -> None:
    """Take the mouse from the terminal, or leave it to it, while the app runs. Private to Textual's driver."""
    driver: Any = app._driver
    if driver is None or driver._mouse == wanted or not hasattr(driver, "_enable_mouse_support"):
        return
    if wanted:
        driver._mouse = True
        driver._enable_mouse_support()
    else:
        driver._disable_mouse_support()
        driver._mouse = False
    driver.flush()


def mouse_wanted(word: str) -> bool:
    """Return whether the mouse is taken, by the word of the settings."""
    return not over_ssh() if word == "auto" else word == "on"


def end_on_signals(loop: AbstractEventLoop, leave: Callable[[], None], last_words: Callable[[], None]) -> None:
    """End the app on SIGHUP (no terminal), SIGTERM and SIGINT; if it can't, the process ends after a short grace.

    When SSH dies, whatever writes to the terminal may hang or fail: without this an orphan burns a whole core.
    """

    def ended(number: int) -> None:
        watchdog = threading.Timer(GRACE_S, _end_hard, (number, last_words))
        watchdog.daemon = True
        watchdog.start()
        leave()

    for number in (signal.SIGHUP, signal.SIGTERM):
        loop.add_signal_handler(number, ended, number)


def _end_hard(number: int, last_words: Callable[[], None]) -> None:
    last_words()
    os._exit(128 + number)
