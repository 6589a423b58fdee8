"""What every control program around a logger needs: ticks at a steady rate, and a clean end.

Used by `silo demo` and `silo host`; of use in programs of your own, but no part of logging.
"""

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType


class Rate:
    """Ticks at a steady rate.

    Deadlines are absolute, so that the rate doesn't drift. Deadlines that are over already are skipped and counted in
    `skipped`: a late program goes on at the next deadline, it doesn't rush through those that it missed.
    """

    def __init__(
        self,
        frequency_hz: float,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._period_ns = max(1, round(1e9 / frequency_hz))
        self._clock_ns = clock_ns
        self._sleep = sleep
        self._next_ns = clock_ns() + self._period_ns
        self.skipped = 0

    def wait(self) -> int:
        """Sleep until the next deadline; returns how late it was met, in nanoseconds."""
        missed = (self._clock_ns() - self._next_ns) // self._period_ns
        if missed > 0:
            self.skipped += missed
            self._next_ns += missed * self._period_ns
        while (left_ns := self._next_ns - self._clock_ns()) > 0:
            self._sleep(left_ns * 1e-9)
        self._next_ns += self._period_ns
        return -left_ns


class EndSignals:
    """Within this context Ctrl-C, SIGTERM and a closed terminal only set `received`; a second one acts as usual.

    The loop looks at `received` and ends as it would by itself: stop, save, close.
    """

    def __init__(self) -> None:
        self.received: signal.Signals | None = None
        self._before: dict[signal.Signals, object] = {}

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        self.received = signal.Signals(number)
        self._restore()

    def __enter__(self) -> "EndSignals":
        if threading.current_thread() is threading.main_thread():  # elsewhere Python takes no handlers
            for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                self._before[one] = signal.signal(one, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    def _restore(self) -> None:
        while self._before:
            one, handler = self._before.popitem()
            signal.signal(one, handler)  # type: ignore[arg-type]  # as it was returned
