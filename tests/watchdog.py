"""One thread that ends the process when a test takes too long, for all of its tests.

`pytest-timeout` starts a thread for each and waits for it to end: with ten thousand tests on a busy computer, minutes.
"""

import threading
from collections.abc import Callable
from time import monotonic  # of its own: tests replace that of the module
from typing import Any

import pytest
import pytest_timeout

LOOKS_EVERY_S = 5.0


class Watchdog:
    """Calls `expired` for the test that is watched longer than it may take, found out with the next look."""

    def __init__(self, expired: Callable[[Any, Any], None], looks_every_s: float = LOOKS_EVERY_S) -> None:
        self._expired, self._looks_every_s = expired, looks_every_s
        self._watched: tuple[float, Any, Any] | None = None
        self._never = threading.Event()
        self._thread: threading.Thread | None = None

    def watch(self, item: Any, settings: Any) -> None:
        """Begin with a test."""
        self._watched = (monotonic() + settings.timeout, item, settings)
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._look, name="watchdog of tests", daemon=True)
            self._thread.start()

    def leave(self) -> None:
        """End with a test: it has ended, or somebody debugs it."""
        self._watched = None

    def _look(self) -> None:
        while not self._never.wait(self._looks_every_s):
            watched = self._watched
            if watched is not None and monotonic() > watched[0]:
                self._watched = None
                self._expired(*watched[1:])


_watchdog = Watchdog(pytest_timeout.timeout_timer)


@pytest.hookimpl(tryfirst=True)
def pytest_timeout_set_timer(item: pytest.Item, settings: Any) -> bool | None:
    """Watch a test, in place of a thread of its own."""
    if settings.method != "thread":
        return None
    _watchdog.watch(item, settings)
    item.cancel_timeout = _watchdog.leave  # type: ignore[attr-defined]  # what pytest-timeout calls at its end
    return True
