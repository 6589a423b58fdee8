"""How much may be on its way to the terminal: what ssh and TCP hold is not seen at the pty, so the terminal is asked.

Each frame ends with a query; the answer says that the terminal has read that far. Where too much is unanswered nothing
is sent: frames merge, nothing queues. Measured at 8,000 bytes/s: a key shows after 0.26 s instead of 5.1 s.

Plain arithmetic: the driver brings bytes, answers and the time (monotonic seconds).
"""

from collections import deque
from pathlib import Path
from statistics import median

import msgspec

_COUNTS = Path("/proc/thread-self/schedstat")  # on a processor, waiting for one (both ns), how often


def waited_s() -> float:
    """Return how many seconds, since it was started; 0 where the kernel doesn't count."""
    try:
        return int(_COUNTS.read_text().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0


SMALLEST_WINDOW = 3_000
LARGEST_WINDOW = 200_000
QUEUE_S = 0.25  # of the window is allowed to wait on the way: a key comes behind it
SAMPLES = 7
ENOUGH = 1_000  # bytes that must have been sent to judge the throughput by them
FIRST_BYTES = 6_000  # sent before it is known whether the terminal answers
FIRST_S = 0.4  # a terminal that didn't answer by then is not waited for
TIMEOUT_S = 2.0
LONGEST_TIMEOUT_S = 8.0
DEAF_AFTER = 3  # time-outs in a row during which keys came: the link is alive, but the terminal doesn't answer
UNPACED = 1 << 30


class _Mark(msgspec.Struct):
    """A query on its way: all bytes up to it, and when it was sent."""

    total: int
    sent_s: float
    lost: bool = False


class Pacer:
    """What is on its way, and how much more may be."""

    def __init__(self) -> None:
        self.window = SMALLEST_WINDOW
        self.answers = 0
        self.timeouts = 0  # in a row
        self._marks: deque[_Mark] = deque()
        self._total = self._answered = 0
        self._asked_s: float | None = None  # when the first query was sent
        self._silent = True  # whether the terminal is not waited for
        self._answered_s = 0.0
        self._keys_since = False  # whether keys came since the oldest mark was sent
        self._deaf = 0  # time-outs in a row in which keys came
        self._round_trips_s: deque[float] = deque(maxlen=64)
        self._rates: deque[float] = deque(maxlen=SAMPLES)

    # ------------------------------------------------------------------------------------------------ what happens

    def sent(self, size: int, now_s: float) -> None:
        """Note that a frame of `size` bytes with a query at its end was handed to the terminal."""
        self._total += size
        if self._asked_s is None:
            self._asked_s, self._silent = now_s, False
        if not self._waiting:
            self._keys_since = False
        self._marks.append(_Mark(self._total, now_s))

    def answered(self, now_s: float) -> None:
        """Note that the terminal answered the oldest query."""
        self.answers += 1
        self.timeouts = self._deaf = 0
        self._silent = False
        while self._marks and self._marks[0].lost and now_s - self._marks[0].sent_s > 30:
            self._marks.popleft()  # its answer won't come any more
        if not self._marks:
            return
        mark = self._marks.popleft()
        if mark.lost:
            return  # late: its bytes are no longer counted
        size, took_s = mark.total - self._answered, now_s - mark.sent_s
        self._round_trips_s.append(took_s)
        # the link carried these bytes since the answer before, or, where it was idle, since they were sent
        busy_s = now_s - self._answered_s if self._answered_s > mark.sent_s else took_s - self.fastest_s
        self._answered, self._answered_s = mark.total, now_s
        self._keys_since = False
        if size >= ENOUGH:
            self._rates.append(size / max(busy_s, 1e-3))
            wanted = self.bytes_per_s * (self.fastest_s + QUEUE_S)
            self.window = int(max(SMALLEST_WINDOW, min(wanted, 2 * self.window, LARGEST_WINDOW)))

    def key(self) -> None:
        """Note that something was typed: the way from the terminal is open."""
        self._keys_since = True

    def check(self, now_s: float) -> None:
        """Give up waiting for answers that don't come."""
        due_s = self.due_s
        if due_s is None or now_s < due_s:
            return
        self.timeouts += 1
        self._deaf = self._deaf + 1 if self._keys_since else 0
        # who answered once or never doesn't report what we ask for; who did for long may be behind a stalled link
        self._silent = self.answers < 2 or self._deaf >= DEAF_AFTER
        for mark in self._marks:
            mark.lost = True
        self._answered = self._total

    # -------------------------------------------------------------------------------------------------- what is

    @property
    def paced(self) -> bool:
        """Whether the terminal is waited for: it answers, or may still do so for the first time."""
        return not self._silent

    @property
    def unanswered(self) -> int:
        """Bytes that the terminal may not have read yet."""
        return self._total - self._answered

    def room(self, *, urgent: bool = False) -> int:
        """Return how many bytes may be sent now; what a key changed may go beyond the window."""
        if not self.paced:
            return UNPACED
        window = self.window if self.answers else FIRST_BYTES
        return (2 * window if urgent else window) - self.unanswered

    @property
    def due_s(self) -> float | None:
        """When to give up waiting; None where nothing is waited for. Later each time: a link that stalls fills."""
        waiting = self._waiting
        if waiting is None or not self.paced:
            return None
        if self.answers < 2:
            return waiting.sent_s + (TIMEOUT_S if self.answers else FIRST_S)
        return waiting.sent_s + min(LONGEST_TIMEOUT_S, max(TIMEOUT_S, 4 * self.usual_s) * float(2**self.timeouts))

    @property
    def farewell_s(self) -> float | None:
        """Until when answers may come that nobody will wait for after the end; None: none are due."""
        if not self._marks or (not self.paced and not self.answers):
            return None
        return self._marks[-1].sent_s + (FIRST_S if not self.answers else 1.0 + 2 * self.usual_s)

    def lag_s(self, now_s: float) -> float:
        """Return how much longer than the way there and back the newest bytes have waited, or the oldest do now."""
        waiting = self._waiting
        newest = self._round_trips_s[-1] if self._round_trips_s else 0.0
        return max(0.0, max(newest, now_s - waiting.sent_s if waiting else 0.0) - self.fastest_s)

    @property
    def fastest_s(self) -> float:
        """The shortest way there and back of late."""
        return min(self._round_trips_s, default=0.0)

    @property
    def usual_s(self) -> float:
        """The usual time from a frame to its answer of late."""
        return median(list(self._round_trips_s)[-SAMPLES:]) if self._round_trips_s else 0.0

    @property
    def bytes_per_s(self) -> float:
        """What the link carries, as far as was seen; 0 where nothing large enough was sent."""
        return median(self._rates) if self._rates else 0.0

    @property
    def _waiting(self) -> _Mark | None:
        return next((mark for mark in self._marks if not mark.lost), None)


def link_words(pacer: Pacer) -> list[str]:
    """Return what is known of the link: throughput, and the time from a frame to its answer."""
    bits = 8 * pacer.bytes_per_s
    words = [f"{bits / 1e6:.1f} Mbit/s" if bits >= 1e6 else f"{bits / 1e3:.0f} kbit/s"] if bits else []
    return words + ([f"{round(100 * pacer.usual_s) * 10} ms"] if pacer.usual_s else [])
