"""What tells of the terminal from outside: SSH, and signals that it went away."""

import os
import signal
import threading
from asyncio import AbstractEventLoop
from collections.abc import Callable

from rich.console import Console

GRACE_S = 1.5


def over_ssh() -> bool:
    """Return whether the terminal is at the other end of SSH; the mouse stays off there, to select text."""
    return any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY", "SSH_CLIENT"))


def mouse_wanted(word: str) -> bool:
    """Return whether the mouse is taken, by the word of the settings."""
    return not over_ssh() if word == "auto" else word == "on"


def has_few_colors() -> bool:
    """Return whether the terminal says of itself that it has sixteen colours: shades can't be told apart in them."""
    return Console(force_terminal=True).color_system == "standard"


def end_on_signals(loop: AbstractEventLoop, leave: Callable[[], object], last_words: Callable[[], object]) -> None:
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
